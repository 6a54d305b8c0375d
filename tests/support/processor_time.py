"""What each test takes of the processor, its child processes included, and which files are above their budget.

`make times` runs the quick tests with this plugin. Whatever else the machine does, processor time stays what it is.
"""

from __future__ import annotations

import os
from collections import Counter

import pytest

SUITE = 420.0
"""What all quick tests may take together [s]: four minutes on two processors, with 20 s each to start and collect."""
FILE = 4.0
"""What a new test file may take [s]."""
TEST = 0.5
"""What a new test may take [s]."""
_MEASURED = "processor_seconds"
_FILES_SHOWN = 40
_TESTS_SHOWN = 60


def _processor_seconds() -> float:
    """Of this process and of those that it started and that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item):
    """Count set-up, call and teardown: a longer-lived fixture in its first test, a longer-lived process in its last."""
    item.stash[_BEGAN] = _processor_seconds()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]):
    report = yield
    if call.when == "teardown":
        report.user_properties.append((_MEASURED, _processor_seconds() - item.stash[_BEGAN]))
    return report


def pytest_terminal_summary(terminalreporter) -> None:
    files: Counter[str] = Counter()
    tests: Counter[str] = Counter()
    for report in (report for reports in terminalreporter.stats.values() for report in reports):
        for name, seconds in getattr(report, "user_properties", ()):
            if name == _MEASURED and report.when == "teardown":
                tests[report.nodeid] += seconds
                files[report.nodeid.split("::")[0]] += seconds
    write = terminalreporter.write_line
    terminalreporter.section("processor time")
    write(f"{files.total():7.1f} s of {SUITE:g} s for {len(tests)} tests")
    write(f"slowest files, of {FILE:g} s each:")
    for file, seconds in files.most_common(_FILES_SHOWN):
        write(f"{seconds:7.1f} s  {file}")
    write(f"tests above {TEST:g} s:")
    for test, seconds in tests.most_common(_TESTS_SHOWN):
        if seconds > TEST:
            write(f"{seconds:7.1f} s  {test}")


_BEGAN = pytest.StashKey[float]()
