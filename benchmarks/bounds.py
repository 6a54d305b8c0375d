"""How tight the bounds are on random deformations: `python -m benchmarks.bounds [count]`.

For each bound of `bounds.bounds`: how often it was given; median, lower quartile and least of its tightness,
the smaller of bound and value over the larger (1 is sharp, 0 says nothing); and how often it was false, which must be
never. Then how often the regime was certain, by kind of deformation.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import sys
import time
from collections import defaultdict

import numpy as np
from tests.support.random_deformations import KINDS, random_case

from shapephase import reconstruct
from shapephase.bounds import bounds, regime_certificate

# Random deformations: some dozens of each kind, in a few minutes.
COUNT = 450
# Relative: a bound passed by less than this is passed by the error of the motion, reconstructed to 1e-9 rad.
ALLOWED = 1e-8


def main() -> None:
    """Print both tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    tightness: dict[str, list[float]] = defaultdict(list)
    false: dict[str, int] = defaultdict(int)
    certain: dict[str, list[bool]] = defaultdict(list)
    begin = time.process_time()
    for seed in range(count):
        kind, deformation, momentum = random_case(seed)
        for bound in bounds(reconstruct(deformation, momentum)):
            scale = max(abs(bound.limit), abs(bound.value))
            tightness[bound.name].append(bound.tightness)
            false[bound.name] += bound.slack < -ALLOWED * scale
        certain[kind].append(regime_certificate(deformation, momentum).certain)
    print(f"{count} random deformations, {(time.process_time() - begin) / count:.3f} s each")
    print(f"{'bound':<40}{'given':>7}{'median':>9}{'quarter':>9}{'least':>9}{'false':>7}")
    for name, values in tightness.items():
        row = np.array(values)
        print(
            f"{name:<40}{len(row):7d}{np.median(row):9.4f}{np.quantile(row, 0.25):9.4f}{row.min():9.4f}{false[name]:7d}"
        )
    print(f"\n{'kind of deformation':<40}{'regime certain':>16}")
    for kind in KINDS:
        if certain[kind]:
            print(f"{kind:<40}{np.mean(certain[kind]):16.0%}")


if __name__ == "__main__":
    main()
