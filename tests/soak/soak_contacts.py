"""Contacts of random pairs by the hundred thousand, each row judged without the engine.

    python tests/soak/soak_contacts.py --pairs 100000 [--seed 1] [--families "thin,along edges"]
    python tests/soak/soak_contacts.py --seed 1 --case 1234          one pair again, with its code

The families below, in turns; `contact_oracle.py` judges what `docs/contacts.md` promises: of convex pairs by planes
found in integers, and closed forms, in long doubles; of meshes facet by facet in fractions. Prints a row a family
(pairs, those that meet, those without rows, rows, pairs that broke a promise), a row a kind of shape, and failures as
they come with code that asks again. Ends with status 1 where anything failed. 100,000 pairs take about ten minutes of a
core.
"""

from __future__ import annotations

import argparse
import collections
import math
import sys
from pathlib import Path
from typing import NamedTuple

TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(TESTS / "oracles"), str(TESTS / "contact")]

import numpy as np
from contact_oracle import ConvexBody, away_from, check_row, facet, failures_of_convex
from naive import pose, turn
from soak_pairs import ball_facets, source

import collide

#: Failures of a family whose code is printed.
SHOWN = 2
#: Shapes of a kind; poses are others each time.
POOL = 40
KINDS = (
    "box", "hull", "plate", "needle", "segment", "collinear", "rounded hull", "swept triangle", "capsule", "sphere",
    "cylinder", "cone", "ellipsoid", "half-space",
)
ROUND = ("capsule", "cylinder")


class Case(NamedTuple):
    """A question.   ends : how many ends of a line its rows must have, at least."""

    kinds: tuple[str, str]
    A: collide.Shape
    B: collide.Shape
    X_WA: np.ndarray
    X_WB: np.ndarray
    margin: float
    ends: int = 0


# --- shapes -----------------------------------------------------------------------------------------


def shape(kind: str, rng) -> collide.Shape:
    """A shape of a kind, of about unit size."""
    L = rng.uniform(0.2, 1.0, 3)
    if kind == "box":
        return collide.Box(L)
    if kind == "hull":
        points = rng.normal(size=(int(rng.integers(4, 9)), 3)) * 0.4
        return collide.ConvexHull(np.round(points * 8) / 8 if rng.uniform() < 0.3 and _is_solid(points) else points)
    if kind == "plate":
        points = rng.normal(size=(int(rng.integers(3, 7)), 3)) * 0.4
        points[:, 2] *= rng.choice([0.0, 1e-17, 1e-15, 1e-13, 1e-9, 1e-4])
        return collide.ConvexHull(points @ _rotation(rng).T if rng.uniform() < 0.5 else points)
    if kind == "needle":
        points = rng.normal(size=(int(rng.integers(4, 7)), 3)) * 0.4
        points[:, 1:] *= 10.0 ** rng.uniform(-12, -2, 2)
        return collide.ConvexHull(points @ _rotation(rng).T)
    if kind == "segment":
        return collide.ConvexHull(rng.normal(size=(2, 3)) * 0.5)
    if kind == "collinear":
        return collide.ConvexHull(_nearly_collinear(rng))
    if kind == "rounded hull":
        return collide.ConvexHull(rng.normal(size=(int(rng.integers(2, 7)), 3)) * 0.4, radius=rng.uniform(0.01, 0.4))
    if kind == "swept triangle":
        return collide.ConvexHull(rng.normal(size=(3, 3)) * 0.4, radius=rng.uniform(0.01, 0.4))
    return {
        "capsule": lambda: collide.Capsule(L[0] / 3, L[1]), "sphere": lambda: collide.Sphere(L[0] / 2),
        "cylinder": lambda: collide.Cylinder(L[0] / 2, L[1]), "cone": lambda: collide.Cone(L[0] / 2, L[1]),
        "ellipsoid": lambda: collide.Ellipsoid(L / 2),
        "half-space": lambda: collide.Halfspace(rng.normal(size=3), 0.3 * rng.normal()),
    }[kind]()


def _is_solid(points) -> bool:
    return np.linalg.matrix_rank(np.round(points * 8)[1:] - np.round(points * 8)[0]) == 3


def _nearly_collinear(rng) -> np.ndarray:
    """Three to six points of a line, rounded, or off it by up to 1e-12 of its length."""
    along = rng.choice([rng.integers(-8, 9, 6) / 8.0, rng.uniform(-1, 1, 6), np.array([-0.5, 0, 0.5, -0.25, 0.25, 1])])
    direction = rng.choice([rng.integers(-9, 10, 3) / 8.0, rng.uniform(-1, 1, 3)])
    if not direction.any():
        direction[0] = 0.7
    points = np.outer(along[: int(rng.integers(3, 7))], direction)
    if rng.uniform() < 0.5:
        points += rng.integers(-2, 3, points.shape) * 10.0 ** rng.uniform(-17, -12)
    return points if np.ptp(points, axis=0).max() > 0.1 else points + np.outer(np.arange(len(points)), direction)


_pools: dict[tuple[int, str], list[collide.Shape]] = {}


def _one_of(kind: str, seed: int, rng) -> collide.Shape:
    pool = _pools.setdefault((seed, kind), [])
    if not pool:
        own = np.random.default_rng([seed, KINDS.index(kind)])
        pool += [shape(kind, own) for _ in range(POOL)]
    return pool[int(rng.integers(POOL))]


# --- poses ------------------------------------------------------------------------------------------


def _rotation(rng) -> np.ndarray:
    if rng.uniform() < 0.25:
        R = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)[:, None]
        return R * np.linalg.det(R)
    return collide.pose(quat_wxyz=rng.normal(size=4))[:3, :3]


def _meet(A, B, X_WA, X_WB, gap: float, rng) -> None:
    """Move B along the normal of their distance until it is ``gap``; the judge needs no more of it than to be near."""
    try:
        r = collide.distance(A, B, X_WA, X_WB)
    except collide.UnsupportedQuery:
        return
    X_WB[:3, 3] += (gap - r.distance) * r.normal


def _gap(rng) -> float:
    return float(rng.choice([0.0, 1.0, -1.0], p=[0.15, 0.45, 0.4])) * 10.0 ** rng.uniform(-17, -0.5)


def _margin(rng) -> float:
    return float(rng.choice([0.0, 10.0 ** rng.uniform(-16, -6), 10.0 ** rng.uniform(-6, -0.3)]))


# --- families ---------------------------------------------------------------------------------------


def _pair(kinds, seed, rng, spread=0.7) -> Case:
    A, B = (_one_of(kind, seed, rng) for kind in kinds)
    X_WA, X_WB = pose(_rotation(rng), rng.normal(size=3)), pose(_rotation(rng), np.zeros(3))
    X_WB[:3, 3] = X_WA[:3, 3] + rng.normal(size=3) * spread
    return Case(kinds, A, B, X_WA, X_WB, _margin(rng))


def _kinds(rng, first=KINDS, second=KINDS) -> tuple[str, str]:
    while True:
        kinds = str(rng.choice(first)), str(rng.choice(second))
        if kinds != ("half-space", "half-space"):
            return kinds if rng.uniform() < 0.5 else kinds[::-1]


def at_random(seed, rng) -> Case:
    return _pair(_kinds(rng), seed, rng)


def touching(seed, rng) -> Case:
    """A gap, or an overlap, of 1e-17 … 0.3."""
    case = _pair(_kinds(rng), seed, rng)
    _meet(*case[1:5], _gap(rng), rng)
    return case


def thin(seed, rng) -> Case:
    case = _pair(_kinds(rng, ("plate", "needle", "segment", "swept triangle")), seed, rng)
    _meet(*case[1:5], _gap(rng), rng)
    return case


def collinear(seed, rng) -> Case:
    case = _pair(_kinds(rng, ("collinear",)), seed, rng, spread=0.4)
    if rng.uniform() < 0.6:
        _meet(*case[1:5], _gap(rng), rng)
    return case


def tilted(seed, rng) -> Case:
    """Frames parallel, or off it by 1e-16 … 0.1."""
    case = _pair(_kinds(rng), seed, rng)
    case.X_WB[:3, :3] = turn(rng.normal(size=3), 10.0 ** rng.uniform(-16, -1)) @ case.X_WA[:3, :3]
    _meet(*case[1:5], _gap(rng), rng)
    return case


def tiny_beside_huge(seed, rng) -> Case:
    kinds = _kinds(rng, ("box", "hull", "plate", "collinear"), ("box", "hull", "collinear", "segment"))
    A, B = (_one_of(kind, seed, rng) for kind in kinds)
    scale = 10.0 ** rng.uniform(1, 6)
    A = collide.Box(A.size * scale) if kinds[0] == "box" else collide.ConvexHull(A.points * scale)
    X_WA, X_WB = pose(_rotation(rng), rng.normal(size=3)), pose(_rotation(rng), np.zeros(3))
    X_WB[:3, 3] = X_WA[:3, 3] + rng.normal(size=3) * scale
    _meet(A, B, X_WA, X_WB, _gap(rng), rng)
    return Case(kinds, A, B, X_WA, X_WB, _margin(rng) * float(rng.choice([1.0, scale])))


def flush(seed, rng) -> Case:
    """Boxes, and hulls of their corners, in one frame: faces, edges or corners that touch exactly, or an ulp off."""
    sizes = rng.integers(1, 5, (2, 3)) / 4.0
    A, B = collide.Box(sizes[0]), collide.Box(sizes[1])
    if rng.uniform() < 0.5:
        corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        B = collide.ConvexHull(corners * sizes[1])
    off = (sizes[0] + sizes[1]) / 2 * rng.choice([-1.0, 1.0], 3)
    free = rng.permutation(3)[: int(rng.integers(0, 3))]
    off[free] *= rng.integers(-4, 5, len(free)) / 4.0
    X_WA, X_WB = np.eye(4), np.eye(4)
    X_WB[:3, 3] = off
    if rng.uniform() < 0.5:
        X_WB[:3, 3] *= 1.0 + rng.integers(-3, 4, 3) * 2.0**-52
    return Case(("box", type(B).__name__), A, B, X_WA, X_WB, _margin(rng))


def along_edges(seed, rng) -> Case:
    """A capsule, a cylinder or a swept segment along an edge of a box, of its hull or of its facets as a mesh, within
    1e-16 … 1e-4 rad: both ends of what they share are within the margin."""
    size = rng.uniform(0.5, 1.0, 3)
    A: collide.Shape = collide.Box(size)
    if rng.uniform() < 0.5:
        corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * size
        if rng.uniform() < 0.5:  # corners along the edge as well, rounded
            corners = np.concatenate([corners, [[t * size[0], size[1] / 2, size[2] / 2] for t in (-0.2, 0.1)]])
            R0 = _rotation(rng)
            corners = corners @ R0.T
            A, corners = collide.ConvexHull(corners), None
        else:
            A, R0 = collide.ConvexHull(corners), np.eye(3)
    else:
        R0 = np.eye(3)
    which = str(rng.choice(["capsule", "cylinder", "segment"]))
    radius, length = rng.uniform(0.05, 0.3), rng.uniform(0.3, 1.2)
    B = {
        "capsule": collide.Capsule(radius, length), "cylinder": collide.Cylinder(radius, length),
        "segment": collide.ConvexHull([[0, 0, -length / 2], [0, 0, length / 2]], radius=radius),
    }[which]
    angle = 10.0 ** rng.uniform(-16, -4)
    lean = rng.uniform(-0.6, 0.6)
    out = np.array([0.0, math.cos(math.pi / 4 + lean), math.sin(math.pi / 4 + lean)])
    along = np.array([1.0, 0, 0])
    side = np.cross(along, out)
    swung = turn(out, angle)  # about the direction that parts the two: both ends stay as near as may be
    R = swung @ np.stack([out, side, along], axis=1)
    gap = float(rng.choice([0.0, 1e-9, 1e-4, -1e-9, -1e-3]))
    p = np.array([rng.uniform(-0.2, 0.2), size[1] / 2, size[2] / 2]) + (radius + gap) * out
    X_WA = pose(_rotation(rng), rng.normal(size=3))
    X_WB = X_WA @ pose(R0, np.zeros(3)) @ pose(R, p)
    margin = max(gap, 0.0) + 1e-6
    if rng.uniform() < 0.3:
        A = collide.Mesh(*collide.tessellate(A)[:2])
    return Case(("edge", which), A, B, X_WA, X_WB, margin, ends=2)


def curved(seed, rng) -> Case:
    case = _pair(_kinds(rng, ("cylinder", "cone", "ellipsoid")), seed, rng)
    if rng.uniform() < 0.5:
        case.X_WB[:3, :3] = turn(rng.normal(size=3), 10.0 ** rng.uniform(-16, -1)) @ case.X_WA[:3, :3]
    _meet(*case[1:5], _gap(rng), rng)
    return case


def swept(seed, rng) -> Case:
    """Bodies with radii that lean against each other."""
    others = ("box", "half-space", "hull", "capsule", "plate")
    kinds = _kinds(rng, ("capsule", "rounded hull", "swept triangle"), others)
    case = _pair(kinds, seed, rng)
    if rng.uniform() < 0.7:
        case.X_WB[:3, :3] = turn(rng.normal(size=3), 10.0 ** rng.uniform(-6, 0)) @ case.X_WA[:3, :3]
    _meet(*case[1:5], _gap(rng), rng)
    return case._replace(margin=float(rng.choice([0.0, 1e-6, 1e-3, 0.3])))


def meshes(seed, rng) -> Case:
    """A ball of facets, or a table, and a mesh, a box, a capsule or a hull."""
    points, faces = ball_facets(4, 6)
    A = collide.Mesh(points * rng.uniform(0.3, 0.6, 3), faces)
    if rng.uniform() < 0.5:
        k = np.linspace(-1, 1, 4)
        grid = np.array([(x, y, 0.0) for x in k for y in k])
        cells = [4 * i + j for i in range(3) for j in range(3)]
        facets = [f for c in cells for f in ((c, c + 4, c + 5), (c, c + 5, c + 1))]
        A = collide.Mesh(grid, facets, solid=False)
    kind = str(rng.choice(["mesh", "box", "hull", "capsule", "sphere", "swept triangle"]))
    B = collide.Mesh(points * rng.uniform(0.2, 0.5, 3), faces) if kind == "mesh" else _one_of(kind, seed, rng)
    X_WA, X_WB = pose(_rotation(rng), rng.normal(size=3)), pose(_rotation(rng), np.zeros(3))
    X_WB[:3, 3] = X_WA[:3, 3] + 3 * _rotation(rng)[0]
    if rng.uniform() < 0.5:
        X_WB[:3, :3] = turn(rng.normal(size=3), 10.0 ** rng.uniform(-12, -1)) @ X_WA[:3, :3]
    _meet(A, B, X_WA, X_WB, float(rng.choice([1e-3, 1e-6, 0.0, -1e-6, -1e-3])), rng)
    return Case(("mesh", kind), A, B, X_WA, X_WB, float(rng.choice([0.0, 2e-3])))


FAMILIES = {
    "at random": at_random, "touching": touching, "thin": thin, "nearly collinear": collinear, "tilted": tilted,
    "tiny beside huge": tiny_beside_huge, "flush, or an ulp off": flush, "along edges": along_edges,
    "curved": curved, "swept": swept, "meshes": meshes,
}
#: Of so many cases of a family that is slow to judge, all but the first are of the others.
RARE = {"meshes": 3}


# --- judging ----------------------------------------------------------------------------------------


def draw(seed: int, number: int, families=tuple(FAMILIES)) -> tuple[str, Case]:
    """Case ``number``: the same whenever it is asked for."""
    family = families[number % len(families)]
    if family in RARE and len(families) > 1 and number // len(families) % RARE[family]:
        family = families[(number // len(families)) % (len(families) - 1)]
    return family, FAMILIES[family](seed, np.random.default_rng([seed, number]))


def facets_of(S):
    """(vertices, faces, radius) of a mesh or of a shape that contacts take as one; None of others."""
    if isinstance(S, collide.Mesh):
        return S.vertices, S.faces, 0.0
    return None


def judge(case: Case, ask=None):
    """(rows, `distance`, failures)."""
    pair = case.A, case.B, case.X_WA, case.X_WB
    ask = ask or collide.contacts
    r = collide.distance(*pair)
    rows = ask(*pair, margin=case.margin).rows
    if isinstance(case.A, collide.Mesh):
        failures = failures_of_meshes(case, rows, r)
    else:
        failures = failures_of_convex(*pair, case.margin, rows, r)
    if case.ends and len(rows) < case.ends:
        failures.append(f"{len(rows)} rows: an end of the line is lost")
    elif case.ends:
        span = np.linalg.norm(rows["point_a"][:, None] - rows["point_a"][None], axis=2).max()
        wanted = shared_length(case)
        if span < wanted - 1e-3:
            failures.append(f"rows span {span:.4f} of {wanted:.4f}: an end of the line is lost")
    return rows, r, failures


def shared_length(case: Case) -> float:
    """How much of B's line lies beside the edge of A along it."""
    e = case.X_WB[:3, 2]
    if isinstance(case.A, collide.Mesh):
        points = case.A.vertices
    elif isinstance(case.A, collide.ConvexHull):
        points = case.A.points
    else:
        points = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * case.A.size
    along = (points @ case.X_WA[:3, :3].T + case.X_WA[:3, 3] - case.X_WB[:3, 3]) @ e
    half = case.B.length / 2 if hasattr(case.B, "length") else float(np.abs(case.B.points[:, 2]).max())
    return float(min(along.max(), half) - max(along.min(), -half))


def failures_of_meshes(case: Case, rows, r) -> list[str]:
    """Rows of pairs of meshes facet by facet; of a mesh and a shape what any row promises."""
    failures = []
    if len(rows) == 0 and r.lower <= case.margin and not r.hit and r.upper < case.margin:
        failures.append("no rows within the margin")
    a, b = facets_of(case.A), facets_of(case.B)
    for k, row in enumerate(rows[:12]):
        if row["kind"] == 2:
            continue
        if row["lower"] > case.margin:
            failures.append(f"row {k}: beyond the margin")
        if b is not None:
            try:
                check_row(row, a[:2], b[:2], case.X_WA, case.X_WB, nearest=k == 0 and row["kind"] == 0, tolerance=1e-8)
            except AssertionError as error:
                failures.append(f"row {k}: {error}")
        else:
            wide, body = row["upper"] - row["lower"] + 1e-9, ConvexBody(case.B, case.X_WB)
            off = float(body.signed(row["point_b"][None])[0])
            if abs(off) > wide:
                failures.append(f"row {k}: point_b is off its body by {off:.3g}")
            off = away_from(facet(*a[:2], case.X_WA, row["facet_a"]), row["point_a"])
            if off > wide:
                failures.append(f"row {k}: point_a is off its facet by {off:.3g}")
    return failures


def question(case: Case) -> str:
    return (
        f"import numpy as np, collide as C\nA = {source(case.A)}\nB = {source(case.B)}\n"
        f"X_WA = np.array({case.X_WA.tolist()!r})\nX_WB = np.array({case.X_WB.tolist()!r})\n"
        f"r, c = C.distance(A, B, X_WA, X_WB), C.contacts(A, B, X_WA, X_WB, margin={case.margin!r})\n"
    )


class Tally:
    """What was judged so far, by family and by kinds of shapes."""

    def __init__(self) -> None:
        self.families: dict[str, collections.Counter] = {family: collections.Counter() for family in FAMILIES}
        self.kinds: dict[str, collections.Counter] = collections.defaultdict(collections.Counter)
        self.what: collections.Counter = collections.Counter()

    def add(self, family: str, case: Case, rows, r, failures) -> None:
        for count in [self.families[family], *(self.kinds[kind] for kind in set(case.kinds))]:
            count["pairs"] += 1
            count["hits"] += bool(r.hit)
            count["without rows"] += not len(rows)
            count["rows"] += len(rows)
            count["failed"] += bool(failures)
        for what in failures:
            text = what.partition(": ")[2] if what.startswith("row ") else what
            self.what[" ".join(w for w in text.split() if not any(c.isdigit() for c in w))] += 1

    @property
    def failed(self) -> int:
        return sum(count["failed"] for count in self.families.values())

    @property
    def pairs(self) -> int:
        return sum(count["pairs"] for count in self.families.values())

    def summary(self) -> str:
        names = ("pairs", "hits", "without rows", "rows", "failed")
        lines = [f"{'':24}" + "".join(f"{name:>14}" for name in names)]
        for table in (self.families, dict(sorted(self.kinds.items()))):
            lines += [f"{k:24}" + "".join(f"{c[name]:>14}" for name in names) for k, c in table.items() if c["pairs"]]
            lines.append("")
        lines += [f"{n:8} {what}" for what, n in self.what.most_common(20)]
        return "\n".join([*lines, f"{self.failed} of {self.pairs} pairs failed"])


def soak(seed: int, numbers, families=tuple(FAMILIES), ask=None, say=print) -> Tally:
    """Judge cases by number."""
    tally: Tally = Tally()
    for number in numbers:
        family, case = draw(seed, number, families)
        rows, r, failures = judge(case, ask)
        tally.add(family, case, rows, r, failures)
        if failures and tally.families[family]["failed"] <= SHOWN:
            say(f"--- {family}, case {number}: {'; '.join(failures)[:600]}\n{question(case)}"[:3000])
    return tally


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--families", help=f"of {', '.join(FAMILIES)}")
    parser.add_argument("--case", type=int, help="judge this case alone")
    asked = parser.parse_args(arguments)
    families = tuple(asked.families.split(",")) if asked.families else tuple(FAMILIES)
    if unknown := set(families) - set(FAMILIES):
        parser.error(f"--families: {', '.join(sorted(unknown))}: there are {', '.join(FAMILIES)}")
    numbers = range(asked.first, asked.first + asked.pairs) if asked.case is None else [asked.case]
    tally = soak(asked.seed, numbers, families)
    print(tally.summary())
    return bool(tally.failed)


if __name__ == "__main__":
    sys.exit(main())
