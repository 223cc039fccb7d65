"""Motions past the brink: slides along a face, open surfaces that come together flush, thin walls passed at speed.

Bodies are boxes, or unions of boxes, along the axes of one frame, some without thickness; they move without turning.
The judge knows them as numbers alone: first contact is that of slabs, whether they meet at a time is six comparisons a
pair of boxes, both in fractions of the doubles given. COLLIDE_MOTIONS=100000 judges so many.
"""

from __future__ import annotations

import os
from collections import Counter
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest

import collide

N = int(os.environ.get("COLLIDE_MOTIONS", "900"))
EYE = np.eye(4)
#: Sizes that doubles hold exactly, as half of them.
SIZES = (0.25, 0.5, 1.0, 1.5, 0.3, 0.7)
#: Rounding of poses in between, of the size of a pair and of its way; `docs/motion.md` promises some 1e-13.
ROUNDING = 2e-12
#: Along the normal of bodies of unit size that all but touch: of 9,900 motions two overlap by 5e-7, the others not.
LEAN = 1e-6


class Body(NamedTuple):
    """A shape, and the boxes that it is: (n, 2, 3) least and greatest coordinates."""

    kind: str
    shape: collide.Shape
    boxes: np.ndarray


class Case(NamedTuple):
    family: str
    A: Body
    B: Body
    ways: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # where A and B begin and end


def corners_of(low, high) -> np.ndarray:
    return np.array([[x[i] for x, i in zip(zip(low, high), at)] for at in np.ndindex(2, 2, 2)])


def surface(low, high) -> collide.Mesh:
    """Twelve triangles of a box; two of a rectangle, an open surface."""
    flat = [k for k in range(3) if low[k] == high[k]]
    if flat:
        u, v = (k for k in range(3) if k != flat[0])
        points = np.array([low] * 4, dtype=float)
        points[1:3, u], points[2:, v] = high[u], high[v]
        return collide.Mesh(points, [(0, 1, 2), (0, 2, 3)], solid=False)
    vertices, faces, *_ = collide.tessellate(collide.Box((1, 1, 1)))
    return collide.Mesh(np.where(np.asarray(vertices) < 0, low, high), faces)


def body(kind: str, rng, thickness: float | None = None, axis: int = 2) -> Body:
    """A box as a box, a hull, a mesh or a union; of a thickness along an axis, 0 for a rectangle."""
    size = rng.choice(SIZES, 3)
    if thickness is not None:
        size[axis] = thickness
    low, high = -size / 2, size / 2
    if kind == "box":
        return Body(kind, collide.Box(size), np.array([[low, high]]))
    if kind == "hull":
        return Body(kind, collide.ConvexHull(corners_of(low, high)), np.array([[low, high]]))
    if kind in ("mesh", "rectangle"):
        return Body(kind, surface(low, high), np.array([[low, high]]))
    shift = np.zeros(3)
    shift[rng.choice([k for k in range(3) if k != axis])] = 2.0
    shapes = [collide.Box(size), collide.Box(size) if kind == "union" else surface(low, high)]
    union = collide.Compound([(shapes[0], EYE), (shapes[1], collide.pose(shift))])
    return Body(kind, union, np.array([[low, high], [low + shift, high + shift]]))


def _reach(body: Body, axis: int, side: int) -> float:
    """How far a body reaches along an axis, down or up."""
    return float(body.boxes[:, 0, axis].min() if side == 0 else body.boxes[:, 1, axis].max())


def _beside(A: Body, B: Body, axis: int, gap: float, rng) -> np.ndarray:
    """Where B stands on A's face across an axis, a gap over it, somewhere beside it or over it."""
    p = rng.uniform(-0.7, 0.7, 3)
    p[axis] = _reach(A, axis, 1) - _reach(B, axis, 0) + gap
    return p


def slide(rng) -> Case:
    """B over A's plane, on it, an ulp or a hair off it; it goes along it, and hardly towards it."""
    kinds = ("box", "hull", "mesh", "union", "union of a mesh", "rectangle")
    axis = int(rng.integers(3))
    A, B = (body(k, rng, 0.0 if k == "rectangle" else None, axis) for k in rng.choice(kinds, 2))
    p0 = _beside(A, B, axis, float(rng.choice([0.0, 2.0**-53, -(2.0**-53), 1e-15, 1e-13, 1e-9, 1e-6, 1e-3])), rng)
    p1 = rng.uniform(-0.3, 0.3, 3) - p0 if rng.uniform() < 0.8 else rng.uniform(-3, 3, 3)
    p1[axis] = p0[axis] + float(rng.choice([0.0, 0.0, 1.0, -1.0])) * 10.0 ** rng.uniform(-16, -2)
    if rng.uniform() < 0.7:  # past one of its sides to begin with
        k = int(rng.choice([k for k in range(3) if k != axis]))
        p0[k] = _reach(A, k, 1) - _reach(B, k, 0) + float(rng.choice([0.0, 1e-12, 0.1, 1.0]))
        p1[k] = rng.uniform(-3, 0.5)
    return _placed("slide", A, B, p0, p1, rng)


def flush(rng) -> Case:
    """Open surfaces, or one and a solid, that come together face in face or in one plane."""
    axis = int(rng.integers(3))
    kinds = ("rectangle", str(rng.choice(["rectangle", "mesh", "box", "union of a mesh"])))
    A, B = (body(k, rng, 0.0 if k == "rectangle" else None, axis) for k in kinds)
    p0 = _beside(A, B, axis, float(rng.choice([1.0, 0.1, 1e-3])), rng)
    p1 = _beside(A, B, axis, float(rng.choice([0.0, 0.0, 1e-16, -1e-16, 1e-9, -1e-9, -0.5])), rng)
    if rng.uniform() < 0.5:  # square to the faces
        others = [k for k in range(3) if k != axis]
        p1[others] = p0[others]
    return _placed("flush", A, B, p0, p1, rng)


def wall(rng) -> Case:
    """A wall of 1e-12 … 1e-2 m, or a rectangle, that a body passes at up to a million times its size in unit time."""
    axis = int(rng.integers(3))
    kind = str(rng.choice(["box", "hull", "mesh", "rectangle", "union"]))
    A = body(kind, rng, 0.0 if kind == "rectangle" else 10.0 ** rng.uniform(-12, -2), axis)
    B = body(str(rng.choice(["box", "hull", "mesh", "union of a mesh"])), rng)
    far = 10.0 ** rng.uniform(0, 6)
    p0, p1 = rng.uniform(-0.8, 0.8, (2, 3))
    p0[axis], p1[axis] = far * rng.uniform(0.1, 1), -far * rng.uniform(0.1, 1)
    if rng.uniform() < 0.5:
        across = int(rng.choice([k for k in range(3) if k != axis]))
        p0[across], p1[across] = rng.uniform(-1, 1, 2) * far
    if rng.uniform() < 0.2:  # just beside the rim
        k = int(rng.choice([k for k in range(3) if k != axis]))
        p0[k] = p1[k] = _reach(A, k, 1) - _reach(B, k, 0) + float(rng.choice([0.0, 1e-15, -1e-15, 1e-9, -1e-9]))
    return _placed("wall", A, B, p0, p1, rng)


def _placed(family, A, B, p0, p1, rng) -> Case:
    """Both move, or A rests; bodies may be asked for the other way round."""
    drift = rng.integers(-8, 9, 3) / 4.0 if rng.uniform() < 0.3 else np.zeros(3)
    ways = (np.zeros(3), drift, p0, p1 + drift)
    if rng.uniform() < 0.5:
        return Case(family, B, A, (*ways[2:], *ways[:2]))
    return Case(family, A, B, ways)


FAMILIES = (slide, flush, wall)


# --- judging, in fractions ------------------------------------------------------------------------


def _fractions(x) -> list[Fraction]:
    return [Fraction(float(v)) for v in x]


class Passage:
    """B seen from A: where it begins, and its way."""

    def __init__(self, case: Case):
        a0, a1, b0, b1 = map(_fractions, case.ways)
        self.start = [b - a for a, b in zip(a0, b0)]
        self.way = [(d - b) - (c - a) for a, b, c, d in zip(a0, b0, a1, b1)]
        self.pairs = [
            ([list(map(Fraction, map(float, x))) for x in a], [list(map(Fraction, map(float, x))) for x in b])
            for a in case.A.boxes for b in case.B.boxes
        ]

    def first(self) -> Fraction | None:
        """The first time within 0 … 1 at which the closed bodies touch."""
        best: Fraction | None = None
        for a, b in self.pairs:
            begin, end = Fraction(0), Fraction(1)
            for k in range(3):
                low, high = a[0][k] - b[1][k], a[1][k] - b[0][k]  # where B's origin is while they overlap
                x, v = self.start[k], self.way[k]
                if v == 0:
                    if not low <= x <= high:
                        begin, end = Fraction(1), Fraction(0)
                    continue
                first, last = sorted(((low - x) / v, (high - x) / v))
                begin, end = max(begin, first), min(end, last)
            if begin <= end and (best is None or begin < best):
                best = begin
        return best

    def gap(self, time: float) -> Fraction:
        """How far the nearest boxes are apart along the axis that tells most; at most 0 where they meet."""
        t = Fraction(time)
        at = [x + t * v for x, v in zip(self.start, self.way)]
        return min(
            max(max(a[0][k] - at[k] - b[1][k], at[k] + b[0][k] - a[1][k]) for k in range(3)) for a, b in self.pairs
        )

    def apart_along(self, time: float, nhat) -> float:
        """How far two boxes are apart along a direction from A to B, the least of all pairs of boxes."""
        t, n = Fraction(time), _fractions(nhat)
        at = [x + t * v for x, v in zip(self.start, self.way)]
        gaps = []
        for a, b in self.pairs:
            ends = [(min(x * low, x * high), max(y * x for y in of_a)) for x, low, high, *of_a in zip(n, *b, *a)]
            gaps.append(sum(x * d for x, d in zip(n, at)) + sum(least - most for least, most in ends))
        return float(min(gaps))


def failures(case: Case, r) -> list[str]:
    """What an answer broke of what `docs/motion.md` promises."""
    passage = Passage(case)
    first = passage.first()
    way = float(sum(abs(v) for v in passage.way))
    size = float(np.abs(case.A.boxes).max() + np.abs(case.B.boxes).max() + np.abs(case.ways).max())
    told = []
    if not r.lower <= r.time <= r.upper:
        told.append("time is not in its bracket")
    if not r.hit:
        if first is not None:
            told.append(f"no impact, though they touch at {float(first)!r}")
        return told
    if first is not None and Fraction(r.lower) > first:
        told.append(f"lower {r.lower!r} is later than the contact at {float(first)!r}")
    if np.isfinite(r.upper):
        if passage.gap(r.upper) > 0:
            told.append(f"{float(passage.gap(r.upper)):.3g} m apart at upper {r.upper!r}")
    elif passage.gap(r.lower) > ROUNDING * (size + way):
        told.append(f"open, though {float(passage.gap(r.lower)):.3g} m apart at lower {r.lower!r}")
    if r.certified and r.upper - r.lower > 1e-9:
        told.append(f"certified, and {r.upper - r.lower:.3g} wide")
    is_wide = np.isfinite(r.upper) and r.upper - r.lower > 1e-6
    if is_wide and r.lower > 0 and passage.gap(min(r.lower + 1e-6, 1.0)) < -ROUNDING * (size + way):
        told.append(f"{r.upper - r.lower:.3g} wide")
    n = np.asarray(r.normal)
    is_rounding = passage.gap(r.lower) <= ROUNDING * (size + way) and not {case.A.kind, case.B.kind} <= {"box", "hull"}
    if r.lower > 0 and not is_rounding and len(case.A.boxes) == len(case.B.boxes) == 1:
        along = passage.apart_along(r.lower, n)
        if along < -LEAN - ROUNDING * (size + way):
            told.append(f"overlap by {-along:.3g} m along the normal at lower")
    if r.lower > 0 and abs(float(n @ n) - 1) >= 1e-9:
        told.append(f"no normal: {n}")
    return told


def draw(number: int) -> Case:
    return FAMILIES[number % len(FAMILIES)](np.random.default_rng([11, number]))


def question(case: Case) -> str:
    poses = ", ".join(f"collide.pose({w.tolist()!r})" for w in case.ways)
    return f"{case.family}: {case.A.kind} {case.A.boxes.tolist()!r}, {case.B.kind} {case.B.boxes.tolist()!r}, {poses}"


@pytest.mark.many(3)
@pytest.mark.parametrize("part", range(3))
def test_no_contact_is_missed_late_or_made_up(part):
    seen: Counter = Counter()
    for number in range(part, N, 3):
        case = draw(number)
        r = collide.time_of_impact(case.A.shape, case.B.shape, *(collide.pose(w) for w in case.ways))
        told = failures(case, r)
        assert not told, (number, told, question(case))
        seen["hit" if r.hit and np.isfinite(r.upper) else "open" if r.hit else "free"] += 1
        seen["contact"] += Passage(case).first() is not None
    assert seen["contact"] >= 0.25 * sum(seen[k] for k in ("hit", "open", "free")) and min(seen.values()) > 0, seen
