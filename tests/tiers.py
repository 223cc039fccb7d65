"""Tiers of tests: which cases run while editing, at every change, and nightly.

    bash tests/quick.sh       --quick    the first case of each function, none that took long the last time, no peers
    bash tests/run.sh                    all cases but those marked slow, and of those marked many a part
    bash tests/nightly.sh     -m ""      all cases

    @pytest.mark.slow       takes long: nightly
    @pytest.mark.many(6)    of the cases of this function every sixth at every change, all nightly

``--skips FILE`` makes a test that is skipped a failure, unless a line of the file names the reason.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
#: Seconds of the longest case of each function that is not short, as the last night measured them: see time_budget.py.
DURATIONS = HERE / "durations.json"
#: What the quick tier leaves out: functions whose longest case took longer [s of processor time], and what asks peers,
#: compilers or other processes.
AT_MOST = 0.15
APART = ("adapters", "c_interface", "packaging", "soak", "sweeps")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("tiers of tests")
    group.addoption("--quick", action="store_true", help="first cases alone, of functions that take no time")
    group.addoption("--skips", type=Path, metavar="FILE", help="reasons for which tests may be skipped")


def pytest_configure(config: pytest.Config) -> None:
    if (file := config.getoption("--skips")) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(SkipReasons(allowed(file)))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Before -m looks at marks."""
    kept, left = [], []
    seen = dict[str, int]()
    took = last_durations() if config.getoption("--quick") else {}
    for item in items:
        function = item.nodeid.split("[")[0]
        number = seen[function] = seen.get(function, -1) + 1
        for mark in item.iter_markers("many"):
            if number % mark.args[0]:
                item.add_marker(pytest.mark.slow)
        quick = not number and took.get(function, 0.0) <= AT_MOST and function.split("/")[1] not in APART
        (kept if quick or not config.getoption("--quick") else left).append(item)
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = kept


def last_durations() -> dict[str, float]:
    return json.loads(DURATIONS.read_text(encoding="utf-8"))


def allowed(file: Path) -> list[re.Pattern[str]]:
    """Patterns of a file: a line each, ``pattern  # why the tests cannot run``."""
    lines = (line.split("  #")[0].strip() for line in file.read_text(encoding="utf-8").splitlines())
    return [re.compile(line) for line in lines if line and not line.startswith("#")]


class SkipReasons:
    """Gathers why tests were skipped, in the process that reports come to."""

    def __init__(self, patterns: list[re.Pattern[str]]):
        self.patterns, self.unexpected = patterns, dict[str, list[str]]()

    def _skipped(self, nodeid: str, reason: str) -> None:
        if not any(pattern.search(reason) for pattern in self.patterns):
            self.unexpected.setdefault(reason, []).append(nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.skipped and not hasattr(report, "wasxfail"):
            self._skipped(report.nodeid, _reason(report))

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self._skipped(report.nodeid, _reason(report))

    def pytest_terminal_summary(self, terminalreporter) -> None:
        for reason, tests in sorted(self.unexpected.items()):
            terminalreporter.write_line(f"skipped without being expected: {len(tests)} tests, {tests[0]}: {reason}")

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.unexpected and not session.exitstatus:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    return report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
