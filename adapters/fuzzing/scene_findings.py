"""Everything that engines get wrong about one scene, shrunk, a finding a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from collide.adapters.fuzzing.disagreements import OURS, Examiner, Flaw
from collide.adapters.fuzzing.engine_session import EngineSession
from collide.adapters.fuzzing.findings import Finding, Kind, kind_of, save_finding, simpler_of
from collide.adapters.fuzzing.fuzz_case import Case, cases_of
from collide.adapters.fuzzing.fuzz_run import BATCH, nullcontext_of, shrunk_in
from collide.adapters.peers.compare import TOLERANCE
from collide.adapters.peers.protocol import engine
from collide.adapters.peers.question import ask


def save_findings(
    of, engines: Sequence[str], folder: str | Path, *, max_distance: float = 0.0, tolerance: float = TOLERANCE,
    timeout: float = 10.0, progress: Callable | None = None,
) -> list[Path]:
    """Shrink and write down what engines get wrong about a scene: one case of each kind.

    Parameters
    ----------
    of : Scene, World, Question, or iterable of (A, B, X_WA, X_WB)
        What is asked: shapes and their (4, 4) poses.
    engines : sequence of str
        Names of `collide.adapters.peers.protocol.ENGINES`; those whose package is missing are left out.
    folder : str or Path
        Where the files go; made if need be.
    max_distance : float
        The clearance of interest [m].
    tolerance : float
        Of distances, as a part of the pair's size.
    timeout : float
        How long an engine may take for one pair [s].
    progress : callable, optional
        As of `fuzz_run.fuzz`.

    Returns
    -------
    list of Path
        The scene files: each reproduces its finding with `collide compare`.

    Raises
    ------
    InvalidArgument
        For unknown engines.
    """
    cases = cases_of(ask(of, max_distance))
    names = [name for name in dict.fromkeys(engines) if name != OURS and not engine(name).missing()]
    with ExitStack() as stack:
        sessions = {name: stack.enter_context(closing(EngineSession(name, timeout))) for name in names}
        rename = stack.enter_context((progress or nullcontext_of)("shrinking")) or (lambda label: None)
        examiner = Examiner({name: session.answer for name, session in sessions.items()}, tolerance)
        worst, times = _worst(cases, examiner)
        findings: dict[Kind, Finding] = {}
        for kind, (case, flaw) in worst.items():
            rename(f"shrinking {' '.join(kind)}")
            small = shrunk_in(sessions, examiner, case, flaw)
            finding = Finding(small.case, small.flaw, times=times[kind], is_minimal=small.is_minimal)
            findings[finding.kind] = (
                simpler_of(findings[finding.kind], finding) if finding.kind in findings else finding
            )
    return [save_finding(finding, folder) for finding in findings.values()]


def _worst(cases: list[Case], examiner: Examiner) -> tuple[dict[Kind, tuple[Case, Flaw]], Counter]:
    """The gravest case of every kind, and how often each kind is met."""
    worst: dict[Kind, tuple[Case, Flaw]] = {}
    times: Counter = Counter()
    for start in range(0, len(cases), BATCH):
        batch = cases[start : start + BATCH]
        for case, flaws in zip(batch, examiner.flaws(batch)):
            for flaw in flaws:
                kind = kind_of(case, flaw)
                times[kind] += 1
                if kind not in worst or flaw.severity > worst[kind][1].severity:
                    worst[kind] = case, flaw
    return worst, times
