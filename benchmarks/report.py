"""How long people wait for a report: `python -m benchmarks.report`.

The body of 36 joints from example-robot-data along a loop of shapes, with momentum: the split alone, the 3-D page, the
whole report; and `import shapephase`, the best of five fresh interpreters. Goals: report under 5 s, import under 0.6 s.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import shapephase as sp
from shapephase.plots import report, view


def main() -> None:
    """Print the times."""
    body, rng = sp.load_body("example:human"), np.random.default_rng(1)
    cosines, sines = 0.2 * rng.uniform(-1.0, 1.0, (2, body.n_shape, 2))
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), cosines, sines, 2.0, joint_names=body.joint_names)
    with TemporaryDirectory() as folder:
        began = time.process_time()
        motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 8.0])
        split = sp.split(motion)
        computed = time.process_time()
        view(motion).write(Path(folder) / "page.html")
        shown = time.process_time()
        report(motion, split, shape_path=path).write(Path(folder) / "report.html")
        written = time.process_time()
        size = (Path(folder) / "report.html").stat().st_size
    print(f"{body.n_shape} joints: split {computed - began:.2f} s, page {shown - computed:.2f} s")
    print(f"report {written - shown:.2f} s (goal: under 5), {size / 1e6:.1f} MB")
    print(f"import shapephase {min(import_time() for _ in range(5)):.2f} s (goal: under 0.6)")


def import_time() -> float:
    """Of a fresh interpreter, without its own start."""
    code = "import time; t = time.process_time(); import shapephase; print(time.process_time() - t)"
    return float(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout)


if __name__ == "__main__":
    main()
