"""One hard case: two posed bodies as plain numbers, and the words that reproduce it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.shapes import ConvexHull, Halfspace

HULLS, HALFSPACE = KINDS = "hulls", "halfspace"
#: Above this many points a snippet asks the generator instead of listing them.
MAX_POINTS_LISTED = 160


class Body(NamedTuple):
    """Points (n, 3) [m] in the body's frame, and its pose: R (3, 3) and t (3,) [m]."""

    points: np.ndarray
    R: np.ndarray
    t: np.ndarray

    def world(self) -> np.ndarray:
        """World vertices (n, 3), rounded."""
        return self.points @ self.R.T + self.t

    def diagonal(self) -> float:
        """Diagonal of the box around the points, in the body's frame [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


class Case(NamedTuple):
    """A pair of bodies; every double is meant as the real number it is.

    P, Q : (n, 3), (m, 3) points in the bodies' frames [m]; the bodies are their hulls.
    R1, t1, R2, t2 : (3, 3) and (3,) [m]; world vertices are R p + t.
    radius_a, radius_b : of balls swept over the hulls, in the world [m]; 0 in the 27 families.
    kind : "hulls", or "halfspace": then P is (1, 3), a normal n, and A is the image of
        {x : n·x ≤ offset} under its pose.
    seed : with family and index, what the generator was asked for; size : its further arguments.
    """

    family: str
    index: int  # type: ignore[assignment]  # hides the method of tuples, which nobody asks of a case
    P: np.ndarray
    R1: np.ndarray
    t1: np.ndarray
    Q: np.ndarray
    R2: np.ndarray
    t2: np.ndarray
    radius_a: float = 0.0
    radius_b: float = 0.0
    kind: str = HULLS
    offset: float = 0.0
    seed: int = 0
    size: tuple = ()

    @property
    def a(self) -> Body:
        return Body(self.P, self.R1, self.t1)

    @property
    def b(self) -> Body:
        return Body(self.Q, self.R2, self.t2)

    def swapped(self) -> Case:
        """The same pair with the roles exchanged; not for half-spaces, which come first."""
        if self.kind != HULLS:
            raise ValueError(f"{self.family}[{self.index}]: a half-space comes first, it cannot be swapped")
        return self._replace(
            P=self.Q, R1=self.R2, t1=self.t2, radius_a=self.radius_b,
            Q=self.P, R2=self.R1, t2=self.t1, radius_b=self.radius_a,
        )

    def moved(self, step) -> Case:
        """B moved by a step (3,) [m], its translation rounded once."""
        return self._replace(t2=self.t2 + np.asarray(step, dtype=float))

    def shapes(self) -> tuple:
        """(A, B, X_WA, X_WB) as `collide.distance` takes them: two shapes and two (4, 4) poses."""
        plane = self.kind == HALFSPACE
        A = Halfspace(self.P[0], self.offset) if plane else ConvexHull(self.P, radius=self.radius_a)
        return A, ConvexHull(self.Q, radius=self.radius_b), _matrix(self.R1, self.t1), _matrix(self.R2, self.t2)

    def to_dict(self) -> dict:
        """Plain data for JSON; floats survive the way there and back."""
        numbers = {name: getattr(self, name).tolist() for name in ("P", "R1", "t1", "Q", "R2", "t2")}
        return {**self._asdict(), **numbers, "size": dict(self.size)}

    @classmethod
    def from_dict(cls, data: dict) -> Case:
        """What `to_dict` wrote down."""
        numbers = {name: np.array(data[name], dtype=float) for name in ("P", "R1", "t1", "Q", "R2", "t2")}
        fields = {name: data[name] for name in cls._fields if name in data} | numbers
        return cls(**fields | {"size": tuple(sorted(data.get("size", {}).items()))})

    def snippet(self) -> str:
        """Python that asks collide this question again: all numbers, or the generator's call where
        there are too many."""
        lines = ["import numpy as np", "", "import collide", ""]
        if len(self.P) + len(self.Q) > MAX_POINTS_LISTED:
            call = ", ".join(
                [repr(self.family), str(self.index + 1), str(self.seed), *(f"{k}={v!r}" for k, v in self.size)]
            )
            lines += [
                "from collide.scenes.families import generate",
                "",
                f"A, B, X_WA, X_WB = generate({call})[-1].shapes()",
            ]
        else:
            lines += [
                f"A = {self._shape_text(self.P, self.radius_a, self.kind)}",
                f"B = {self._shape_text(self.Q, self.radius_b, HULLS)}",
                f"X_WA = (np.array({self.R1.tolist()}), np.array({self.t1.tolist()}))",
                f"X_WB = (np.array({self.R2.tolist()}), np.array({self.t2.tolist()}))",
            ]
        lines += ["print(collide.collide(A, B, X_WA, X_WB), collide.distance(A, B, X_WA, X_WB))"]
        return "\n".join(lines) + "\n"

    def _shape_text(self, points: np.ndarray, radius: float, kind: str) -> str:
        if kind == HALFSPACE:
            return f"collide.Halfspace({points[0].tolist()}, {float(self.offset)!r})"
        return f"collide.ConvexHull({points.tolist()}, radius={float(radius)!r})"


def pair(a: Body, b: Body, *, radius_a: float = 0.0, radius_b: float = 0.0) -> Case:
    """A case that still has no family and index."""
    R1, t1, R2, t2 = (np.array(x, dtype=float) for x in (a.R, a.t, b.R, b.t))
    P, Q = np.array(a.points, dtype=float), np.array(b.points, dtype=float)
    return Case("", 0, P, R1, t1, Q, R2, t2, float(radius_a), float(radius_b))


def mean_diagonal(case: Case) -> float:
    """L of the recipes: the mean of the two bodies' diagonals [m]."""
    return (case.a.diagonal() + case.b.diagonal()) / 2


def _matrix(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, t
    return X
