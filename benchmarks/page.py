"""The results on the page of benchmarks: `python -m benchmarks.page` writes them into docs/benchmarks.md.

They are those of `benchmarks/results.txt`, which `make bench` writes; at its top are date, machine and versions, and
where they are of another state of the library a `note: ...` that says so.
"""

from __future__ import annotations

import datetime
import os
import platform
import re
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import shapephase as sp

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results.txt"
PAGE = ROOT / "docs" / "benchmarks.md"
_PACKAGES = ("numpy", "scipy", "pin", "numba")
_BEGIN, _END = "<!-- results -->\n", "<!-- end of results -->\n"
_MEDIAN = re.compile(
    r"^  ours +(known|box) +(asked|same error) +median +([\d.]+) +from +[\d.]+ to +[\d.]+((?: +[\d.]+)+)$",
    re.MULTILINE,
)
_KINDS = ("loop", "move", "samples")
_ROWS = {"known": "the path as it is", "box": "the same as a function of time"}


def circumstances() -> list[str]:
    """When, where and with which versions: `date: ...`, `machine: ...`, `versions: ...`."""
    versions = [f"shapephase {sp.__version__}", f"Python {platform.python_version()}"]
    for name in _PACKAGES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            versions.append(f"no {name}")
    system = f"{platform.system()} {platform.release()} {platform.machine()}"
    return [
        f"date: {datetime.datetime.now(datetime.UTC).date().isoformat()}",
        f"machine: {_processor()}, {os.cpu_count()} processors, {system}",
        f"versions: {', '.join([*versions, *_compiler()])}",
    ]


def _processor() -> str:
    try:
        found = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        found = None
    return found[1] if found else platform.processor() or "a processor without a name"


def _compiler() -> list[str]:
    """The first line of what the compiler of the peer says of its version, if there is one."""
    try:
        said = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return []
    return said.splitlines()[:1]


def section(results: str) -> str:
    """The results as the page has them: circumstances, the medians as a table, then all numbers."""
    said = dict(re.findall(r"^(date|machine|versions|note): (.*)$", results, re.MULTILINE))
    by_way: dict[str, dict[str, list[float]]] = {}
    for way, asked, of_all, kinds in _MEDIAN.findall(results):
        numbers = [*map(float, kinds.split()[: len(_KINDS)]), float(of_all)]
        by_way.setdefault(way, {})[asked] = numbers
    rows = [
        f"| {title} | "
        + " | ".join(f"{_short(a)} and {_short(b)}" for a, b in zip(*by_way[key].values(), strict=True))
        + " |"
        for key, title in _ROWS.items()
        if key in by_way
    ]
    cases, _, workloads = results.partition("\nmedians of the ratios to C++")
    workloads = workloads.partition("\n\n")[2]
    return "\n".join(
        [
            f"Measured on {said['date']} on {said['machine']}, with {said['versions']}.",
            *([f"\n{said['note']}"] if "note" in said else []),
            "",
            "| times C++ | Fourier loops | moves | splines of 12 samples | all |",
            "|---|---|---|---|---|",
            *rows,
            "",
            "What follows a reconstruction, many at once, and recordings:",
            "",
            "```text",
            workloads.strip("\n"),
            "```",
            "",
            "All cases, in ms; `known` is the path as it is, `box` the same as a function of time; `to` is the",
            "relative tolerance of the C++, `evals` counts evaluations of the body:",
            "",
            "```text",
            cases[cases.index("case  ") :].strip("\n"),
            "```",
            "",
        ]
    )


def _short(ratio: float) -> str:
    return f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.1f}"


def with_results(page: str, results: str) -> str:
    """The page with the results between its two marks."""
    before, _, rest = page.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return f"{before}{_BEGIN}{section(results)}{_END}{after}"


def main() -> None:
    """Write the page."""
    results = RESULTS.read_text(encoding="utf-8")
    PAGE.write_text(with_results(PAGE.read_text(encoding="utf-8"), results), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
