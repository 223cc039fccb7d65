"""A case: posed bodies of which the first two are asked about, as plain data and as a scene document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.peers.question import Body, Question
from collide.scenes.write_scene import scene_document
from collide.shapes import Shape
from collide.transforms import as_poses


class Case(NamedTuple):
    """Bodies, the first two of which are the pair in question.

    world : the flaw is one of a whole World: the bodies beside the pair, and how it is asked, matter.
    source : of an invented case, a name of `invented_scenes.SOURCES`.
    """

    bodies: tuple[Body, ...]
    world: bool = False
    source: str = ""

    @property
    def kinds(self) -> tuple[str, str]:
        """Names of the two shapes' classes, sorted."""
        a, b = sorted(type(body.shape).__name__ for body in self.bodies[:2])
        return a, b

    def pair(self) -> tuple[Shape, Shape, np.ndarray, np.ndarray]:
        """(A, B, X_WA, X_WB) as queries take them."""
        A, B = self.bodies[:2]
        return A.shape, B.shape, A.X_WB, B.X_WB

    def replaced(self, index: int, **changes: Any) -> Case:
        """The case with some fields of one body changed."""
        bodies = list(self.bodies)
        bodies[index] = bodies[index]._replace(**changes)
        return self._replace(bodies=tuple(bodies))

    def document(self, about: dict[str, Any] | None = None, name: str = "") -> dict[str, Any]:
        """The case as a scene file's data."""
        return scene_document(self.bodies, name=name, about=about)


def pair_case(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> Case:
    """Two shapes (4, 4) posed, called A and B."""
    X_WA, X_WB = (as_poses(X, name)[0] for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))
    return Case((Body("A", A, X_WA), Body("B", B, X_WB)))


def cases_of(question: Question) -> list[Case]:
    """Every pair of a question as a case of its own."""
    return [pair_of(question, i, j) for i, j in question.pairs]


def pair_of(question: Question, i: int, j: int) -> Case:
    """Bodies i and j of a question as a case: A and B."""
    A, B = question.bodies[i], question.bodies[j]
    return Case((Body("A", A.shape, A.X_WB), Body("B", B.shape, B.X_WB)))


def isolated(cases: Sequence[Case]) -> Question:
    """The pairs of cases as one question; row k is case k."""
    return Question.from_pairs([case.pair() for case in cases])
