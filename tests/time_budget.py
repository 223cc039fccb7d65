"""Processor time of each test: a limit that a tier of tests sets, and a file of those that take long.

    python -m pytest --budget 2             a test that takes longer, and is not marked slow, fails and names itself
    python -m pytest --durations-file F     seconds of the longest case of each function, those that grew are told

Seconds are those of processors, of the process and of its children that ended: a machine that does other work besides
changes them little.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

#: Name of the property that a report carries from a worker to the process that writes the file.
PROPERTY = "processor seconds"
#: A function is told as slower than the last time from this ratio and difference [s] on.
SLOWER, BY = 1.5, 1.0
#: What takes less [s] is not kept.
SHORT = 0.2


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("processor time")
    group.addoption("--budget", type=float, metavar="SECONDS", help="a test of more fails, if it is not marked slow")
    group.addoption("--durations-file", type=Path, metavar="FILE", help="keep seconds a function, told beside the last")


def processor_seconds() -> float:
    """Of this process and of its children that ended."""
    own = time.process_time()
    if resource is None:
        return own
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return own + children.ru_utime + children.ru_stime


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item):
    begun = processor_seconds()
    result = yield
    seconds = processor_seconds() - begun
    item.user_properties.append((PROPERTY, seconds))
    budget = item.config.getoption("--budget")
    if budget is not None and seconds > budget and not item.get_closest_marker("slow"):
        took = f"{seconds:.1f} s of processor time, more than {budget:g}"
        pytest.fail(f"{item.nodeid} took {took}: quicken it, or mark it slow")
    return result


def pytest_configure(config: pytest.Config) -> None:
    if (file := config.getoption("--durations-file")) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Durations(file))


class Durations:
    """Gathers seconds of all functions in the process that reports come to, and writes them at the end."""

    def __init__(self, file: Path):
        self.file, self.seconds = file, dict[str, float]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            function, took = report.nodeid.split("[")[0], dict(report.user_properties).get(PROPERTY)
            if isinstance(took, float):
                self.seconds[function] = max(round(took, 1), self.seconds.get(function, 0.0))

    def pytest_terminal_summary(self, terminalreporter) -> None:
        try:
            last = json.loads(self.file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            last = {}
        for line in slower_than(last, self.seconds):
            terminalreporter.write_line(line)
        kept = {name: seconds for name, seconds in {**last, **self.seconds}.items() if seconds >= SHORT}
        self.file.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n", encoding="utf-8")


def slower_than(last: dict[str, float], now: dict[str, float]) -> list[str]:
    """Lines that tell of functions that took longer than the last time."""
    found = [
        (seconds - last[name], name) for name, seconds in now.items()
        if name in last and seconds > SLOWER * last[name] and seconds > last[name] + BY
    ]
    names = [name for _, name in sorted(found, reverse=True)]
    return [f"slower: {name}, {last[name]:.1f} s before, {now[name]:.1f} s now" for name in names]
