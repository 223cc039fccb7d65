"""The minimal cases of docs/engines.md: the verdicts are as stored, collide is right, and the engines still err.

An engine that is absent, or of another version than the one that erred, is skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

import collide
from collide.adapters.fuzzing.disagreements import Examiner
from collide.adapters.fuzzing.engine_session import EngineSession
from collide.adapters.fuzzing.findings import load_finding
from collide.adapters.fuzzing.fuzz_case import isolated
from collide.adapters.fuzzing.proofs import proof
from collide.adapters.fuzzing.support_bounds import lower_bound
from collide.adapters.peers.protocol import engine

PLACES = sorted((Path(__file__).parent / "cases").glob("*.json"))
CASES = pytest.mark.parametrize("place", PLACES, ids=lambda place: place.stem)
ROOT = Path(__file__).resolve().parents[3]


def test_there_are_cases_and_the_page_has_them_all():
    assert len(PLACES) >= 10
    page = (ROOT / "docs" / "engines.md").read_text(encoding="utf-8")
    missing = [place.stem for place in PLACES if place.stem not in page]
    assert not missing, f"docs/engines.md lacks {missing}"


@CASES
def test_the_verdict_is_as_stored(place):
    found, about = load_finding(place)
    known, stored = proof(found.case), about["exact"]
    for name in ("hit", "distance", "by"):
        assert known[name] == stored[name]
    if known["by"] == "exact arithmetic on integers":
        assert known["certificate"] == stored["certificate"]
    else:
        assert known["lower"] <= stored["upper"] and stored["lower"] <= known["upper"], "brackets of one number"


@CASES
def test_collide_is_right(place):
    found, about = load_finding(place)
    stored = about["exact"]
    r = collide.distance(*found.case.pair())
    assert collide.collide(*found.case.pair()) == r.hit == stored["hit"]
    if stored["distance"] is not None:
        truth = float(stored["distance"])
        assert np.nextafter(r.lower, -np.inf) <= truth <= np.nextafter(r.upper, np.inf)
    bound = lower_bound(*found.case.pair())
    if bound is not None:
        assert bound[0] <= r.upper + 1e-12, "no direction parts the bodies by more"
        assert bound[0] >= r.lower - 1e-3 * isolated([found.case]).sizes()[0], "and one parts them by about as much"
    assert Examiner({}).flaws([found.case]) == [[]]


@pytest.fixture(scope="module")
def session_of() -> Iterator[Callable[[str], EngineSession]]:
    """One process an engine for all of its cases."""
    sessions: dict[str, EngineSession] = {}
    with ExitStack() as stack:
        def started(name: str) -> EngineSession:
            if name not in sessions:
                sessions[name] = stack.enter_context(closing(EngineSession(name, 10.0)))
            return sessions[name]

        yield started


@pytest.mark.slow
@CASES
def test_the_engine_still_errs(place, session_of):
    found, about = load_finding(place)
    peer = engine(found.flaw.engine)
    if peer.missing():
        pytest.skip(str(peer.missing()))
    if peer.version != about["versions"][str(peer.package)]:
        pytest.skip(f"{peer.package} {peer.version} is not {about['versions'][str(peer.package)]}, which erred")
    session = session_of(found.flaw.engine)
    with session.hurried(0.7 if found.flaw.kind == "hang" else 10.0):
        (flaws,) = Examiner({found.flaw.engine: session.answer}).flaws([found.case], [found.flaw.engine])
    assert [(flaw.kind, flaw.position) for flaw in flaws] == [(found.flaw.kind, found.flaw.position)]
    if found.flaw.distance is not None:
        assert flaws[0].distance == pytest.approx(found.flaw.distance, rel=1e-6)
