"""What a fresh interpreter pays: `python -m benchmarks.imports [SOURCE]`.

Processor time of importing the library, of `shapephase --help`, of loading the cat, reconstructing and splitting its
righting, and of the shares of eight groups of its joints by the command, each in interpreters of their own that take
turns; medians, and ratios to importing NumPy and Pinocchio.
SOURCE is the `src` folder of another checkout, to be compared in the same turns.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
from pathlib import Path

TURNS = 9
ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
CAT = "import shapephase as sp; body = sp.load_body('cat')"
READ = f"{CAT}; path = sp.read_shape_path({str(ROOT / 'robots' / 'cat_righting.csv')!r}, body)"
MOTION = f"{READ}; motion = sp.reconstruct(sp.articulated(body, path), [0.0125, 0.0, 0.025])"
HELP = "import sys, runpy; sys.argv = ['shapephase', '--help']; runpy.run_module('shapephase', run_name='__main__')"
GROUPS = "a=front_left* b=front_right* c=neck* d=waist_pitch e=waist_yaw f=waist_roll g=rear* h=tail*"
SHARES = f"contributions cat cat_righting --of twist --lateral y --longitudinal x --groups {GROUPS}"
WORK = {
    "numpy and pinocchio": "import numpy, pinocchio",
    "import shapephase": "import shapephase",
    "shapephase --help": HELP,
    "load the cat": CAT,
    "reconstruct": MOTION,
    "split": f"{MOTION}; sp.split(motion)",
    "contributions": HELP.replace("['shapephase', '--help']", repr(["shapephase", *SHARES.split()])),
}


def main() -> None:
    """Print the table."""
    sources = [SOURCE, *map(Path, sys.argv[1:])]
    seconds: dict[tuple[str, Path], list[float]] = {}
    for _ in range(TURNS):
        for name, code in WORK.items():
            for source in sources:
                seconds.setdefault((name, source), []).append(processor_time(code, source))
    print(f"{'processor time [s]':24}" + "".join(f"{label:>22}" for label in ("here", *sys.argv[1:])))
    for name in WORK:
        row = ""
        for source in sources:
            median = statistics.median(seconds[name, source])
            alone = statistics.median(seconds["numpy and pinocchio", source])
            row += f"{median:12.3f} {median / alone:7.2f} x"
        print(f"{name:24}{row}")


def processor_time(code: str, source: Path) -> float:
    """User and system time of an interpreter that runs the code."""
    environment = {**os.environ, "PYTHONPATH": str(source), "OPENBLAS_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
