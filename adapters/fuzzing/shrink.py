"""A case made as small as it can be while an engine still errs in the same way.

The simpler cases are tried the boldest first, and the first that still shows the flaw is gone on from, until none does:
delta debugging (Zeller and Hildebrandt, Simplifying and isolating failure-inducing input, 2002) on shapes and poses.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from collide.adapters.fuzzing.disagreements import Flaw
from collide.adapters.fuzzing.fuzz_case import Case, isolated
from collide.adapters.fuzzing.simpler_cases import STEPS, complexity, fingerprint
from collide.adapters.peers.answers import ABORTED, HUNG
from collide.adapters.peers.question import convex_parts
from collide.shapes import Mesh

#: Cases asked at a time, at most. Kinds of flaws that cost a process each are asked one by one.
CHUNK = 16
COSTLY = ABORTED, HUNG
#: A case may get smaller, and an error less grave, down to this part of what they were.
LEAST = 0.1
#: Cases that shrinking one may ask, and how long it may take [s].
MAX_CASES, MAX_SECONDS = 2500, 60.0


class Shrunk(NamedTuple):
    """case, flaw : the smallest found.   asked : cases tried.   is_minimal : no simpler one errs in the same way."""

    case: Case
    flaw: Flaw
    asked: int
    is_minimal: bool


def shrink(
    case: Case, flaw: Flaw, flaws: Callable[[Sequence[Case], Sequence[str]], list[list[Flaw]]], *,
    max_cases: int = MAX_CASES, max_seconds: float = MAX_SECONDS,
) -> Shrunk:
    """The smallest case that was found to show the same flaw.

    Parameters
    ----------
    case, flaw : Case, Flaw
        What was found.
    flaws : callable
        From cases, and the engines to ask, to the flaws of each: `Examiner.flaws`.
    max_cases : int
        How many simpler cases may be tried.
    max_seconds : float
        How long it may take [s].

    Returns
    -------
    Shrunk
        Never more complicated than what was given.
    """
    search = _Search(case, flaw, flaws, max_cases, time.monotonic() + max_seconds)
    progress = True
    while progress and not search.is_spent:
        progress = False
        for step in STEPS:
            while search.takes(step):
                progress = True
    return Shrunk(search.case, search.flaw, search.asked, not search.is_spent)


class _Search:
    """The smallest case so far, and what was tried."""

    def __init__(self, case: Case, flaw: Flaw, flaws: Callable, max_cases: int, deadline: float):
        self.case, self.flaw, self._flaws = case, flaw, flaws
        self._max_cases, self._deadline, self.asked = max_cases, deadline, 0
        self._tried: set[tuple] = {fingerprint(case)}
        self._least_severity = LEAST * flaw.severity
        self._least_size = LEAST * _size(case)
        self._flat_facets = has_flat_facets(case)

    @property
    def is_spent(self) -> bool:
        return self.asked >= self._max_cases or time.monotonic() >= self._deadline

    def takes(self, step: Callable[[Case], Iterator[Case | None]]) -> bool:
        """Go on from the first case of a step that is simpler and shows the flaw; False where there is none."""
        candidates, size = self._new(step), 1
        while not self.is_spent and (batch := list(itertools.islice(candidates, size))):
            self.asked += len(batch)
            for tried, its_flaws in zip(batch, self._flaws(batch, [self.flaw.engine])):
                same = next((f for f in its_flaws if self.flaw.same_way(f)), None)
                if same is not None and same.severity >= self._least_severity:
                    self.case, self.flaw = tried, same
                    return True
            size = size if self.flaw.kind in COSTLY else min(2 * size, CHUNK)
        return False

    def _new(self, step: Callable[[Case], Iterator[Case | None]]) -> Iterator[Case]:
        """Cases of a step that are simpler, and were not tried before."""
        limit = complexity(self.case)
        for made in step(self.case):
            if made is None or complexity(made) >= limit or _size(made) < self._least_size:
                continue
            if not self._flat_facets and has_flat_facets(made):
                continue  # an error about facets without area is another one
            key = fingerprint(made)
            if key not in self._tried:
                self._tried.add(key)
                yield made


def _size(case: Case) -> float:
    """Of the pair: the larger bounded body's diagonal [m]; 1 where neither is bounded."""
    return isolated([case]).sizes()[0]


def has_flat_facets(case: Case) -> bool:
    """Whether a mesh of the pair has a facet without area."""
    for body in case.bodies[:2]:
        for part, _ in convex_parts(body.shape, np.eye(4)):
            if isinstance(part, Mesh):
                corners = part.vertices[part.faces]
                cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                if not np.abs(cross).max(axis=1).all():
                    return True
    return False
