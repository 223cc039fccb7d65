"""What `soak.py` asks of the engine about one pair, and how the oracle judges the answers.

Every judge is a generator of failures: (what was promised, what was found, Python text that asks again). The engine is
handed in, so that a test can hand in a wrong one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from typing import NamedTuple

import curved_oracle
import numpy as np
from soak_pairs import Case, pieces, question, size_of, widest

import collide
from collide.adapters.peers import exact, exact_meshes
from collide.errors import UnsupportedQuery
from collide.results import FIELDS, HOW, flipped

#: Of the size and of coordinates: what points of gaps and normals may be off by rounding; points of overlaps.
FEW_ULPS, POINTS = 64 * 2.0**-53, 1e-12
#: Points of bodies with a cylinder, cone or ellipsoid nearer than rounding: what the search for depths stops at, 2⁻³⁶
#: of the size.
CURVED_POINTS = 2.0**-36
UNDECIDED = HOW.index("undecided")
#: Poses of the ladder of booleans along the normal.
RUNGS = 24

Failure = tuple[str, str, str]


@dataclass
class Engine:
    """The functions asked; `collide`'s own unless a test changes one."""

    collide: object = field(default_factory=lambda: collide.collide)
    distance: object = field(default_factory=lambda: collide.distance)
    contacts: object = field(default_factory=lambda: collide.contacts)
    World: object = field(default_factory=lambda: collide.World)


class Asked:
    """A case, the engine's answer to it, and the truth as far as it is known; each worked out once."""

    def __init__(self, case: Case, engine: Engine):
        self.case, self.engine = case, engine
        self.random = np.random.default_rng([7, case.number])
        self.pair = case.A, case.B, case.X_WA, case.X_WB
        self.r = engine.distance(*self.pair)  # type: ignore[operator]

    @cached_property
    def truth(self) -> curved_oracle.Bracket:
        return curved_oracle.bracket(*self.pair, guesses=[self.r.normal] if np.isfinite(self.r.normal).all() else ())

    @cached_property
    def hit(self) -> bool | None:
        """Whether the bodies meet; of polytopes that integers decide, whatever the bracket says."""
        return self.truth.hit if self.truth.hit is not None else exact_hit(self.case)

    @cached_property
    def S(self) -> float:
        return size_of(self.case)

    @property
    def coordinates(self) -> float:
        """The largest that take part in the world."""
        return self.S + float(max(np.abs(X[:3, 3]).max() for X in (self.case.X_WA, self.case.X_WB)))

    @cached_property
    def one_convex(self) -> bool:
        return all(
            len(pieces(s)) == 1 and not any(isinstance(p, collide.Mesh) for p in pieces(s)) for s in self.pair[:2]
        )

    @cached_property
    def curved(self) -> bool:
        round_ones = collide.Cylinder, collide.Cone, collide.Ellipsoid
        return any(isinstance(p, round_ones) for s in self.pair[:2] for p in pieces(s))

    def text(self, ask: str) -> str:
        return question(self.case) + ask

    def told(self) -> str:
        r, t = self.r, self.truth
        return (
            f"distance {r.distance!r} in [{r.lower!r}, {r.upper!r}], hit {r.hit}, certified {r.certified}, "
            f"{HOW[r.how]}; truth in [{float(t.lower)!r}, {float(t.upper)!r}], hit {self.hit}"
        )

    def failed(self, promise: str, found: str, ask: str = "r = C.distance(A, B, X_WA, X_WB)") -> Failure:
        return promise, f"{found}; {self.told()}", self.text(ask)


def exact_hit(case: Case) -> bool | None:
    """Whether two polytopes meet, swept or not, or meshes, in integers; None of other shapes."""
    bodies = []
    for shape, X in ((case.A, case.X_WA), (case.B, case.X_WB)):
        kind = type(shape).__name__
        if kind == "Mesh":
            bodies.append(exact_meshes.mesh_cells(shape.vertices, shape.faces, shape.solid, X))
        elif kind in ("Sphere", "Box", "Capsule", "ConvexHull"):
            points = np.array(curved_oracle.core_points(shape, kind), dtype=np.float64)
            bodies.append(exact_meshes.convex_cells(points, float(getattr(shape, "radius", 0.0)), X))
        else:
            return None
    if any(body.solid for body in bodies) or max(len(body.faces) for body in bodies) > 1:
        return exact_meshes.judge(*bodies, distances=False).hit
    (P, r, X), (Q, s, Y) = ((b.points.tolist(), b.radius, b.X_WB) for b in bodies)
    return exact.hit(P, X[:3, :3].tolist(), X[:3, 3].tolist(), Q, Y[:3, :3].tolist(), Y[:3, 3].tolist(), r, s)


# --- the answer itself ----------------------------------------------------------------------------


def judge_bracket(asked: Asked) -> Iterator[Failure]:
    r, truth = asked.r, asked.truth
    if not all(map(math.isfinite, (r.distance, r.lower, r.upper, *r.normal, *r.point_a, *r.point_b))):
        yield asked.failed("answers are finite", str(r.rows))
        return
    if not r.lower <= r.distance <= r.upper:
        yield asked.failed("lower <= distance <= upper", "")
    if Decimal(r.lower) > truth.upper:
        yield asked.failed("lower <= truth", f"by {float(Decimal(r.lower) - truth.upper):.3g}")
    if Decimal(r.upper) < truth.lower:
        yield asked.failed("truth <= upper", f"by {float(truth.lower - Decimal(r.upper)):.3g}")
    if r.how == UNDECIDED:
        if not r.hit or r.certified or not r.lower <= 0 <= r.upper:
            yield asked.failed("undecided is a hit, uncertified, around 0", "")
    elif asked.hit is not None and r.hit != asked.hit:
        yield asked.failed("hit is right", f"hit {r.hit}")
    if r.certified:
        wide = widest(asked.case, r.distance)
        if r.how == UNDECIDED or (r.upper <= 0) != r.hit:
            yield asked.failed("certified proves the sign", "")
        elif wide is None or Decimal(r.upper) - Decimal(r.lower) > wide:
            yield asked.failed(
                "certified keeps the width promised",
                f"width {r.upper - r.lower:.3g}, promised {wide and float(wide):.3g}",
            )


def judge_normal(asked: Asked) -> Iterator[Failure]:
    r = asked.r
    length = float(np.linalg.norm(r.normal))
    if not abs(length - 1) <= 1e-12:
        yield asked.failed("|normal| = 1", f"length {length!r}")
    off = np.abs(r.point_b - r.point_a - r.distance * r.normal).max()
    coordinates = max(asked.coordinates, *(float(np.abs(p).max()) for p in (r.point_a, r.point_b)))
    wide = r.upper - r.lower
    rounding = FEW_ULPS if r.distance > 0 else POINTS
    allowed = rounding * coordinates + (0.0 if r.distance > 0 and r.certified else wide)
    if not off <= allowed:
        yield asked.failed("point_b - point_a = distance * normal", f"off by {off:.3g}, allowed {allowed:.3g}")


def judge_points(asked: Asked) -> Iterator[Failure]:
    """Witness points lie on their bodies; of unions and meshes that overlap nothing is promised."""
    r = asked.r
    if r.distance <= 0 and not asked.one_convex:
        return
    for name, shape, X in (("point_a", asked.case.A, asked.case.X_WA), ("point_b", asked.case.B, asked.case.X_WB)):
        away = curved_oracle.away_from(shape, X, getattr(r, name))
        rounding = CURVED_POINTS if asked.curved else POINTS
        allowed = (rounding if r.certified else 1e-10) * asked.coordinates + (1 if r.certified else 4) * (
            r.upper - r.lower
        )
        if not away <= allowed:
            sure = "certified " if r.certified else "uncertified "
            yield asked.failed(
                f"{sure}points lie on their bodies", f"{name} is off by {away:.3g}, allowed {allowed:.3g}"
            )


def judge_move(asked: Asked) -> Iterator[Failure]:
    """Moving B by −distance · normal brings the pair to touch, and of unions parts them."""
    r, case = asked.r, asked.case
    tolerance = 4 * POINTS * asked.coordinates + (r.upper - r.lower) * (asked.one_convex or r.distance > 0)
    parts_only = r.distance <= 0 and not asked.one_convex
    moved = case.X_WB.copy()
    moved[:3, 3] -= (r.distance - 1e-9 * asked.S * parts_only) * r.normal
    found = curved_oracle.bracket(case.A, case.B, case.X_WA, moved, depths=not parts_only)
    where = f"[{float(found.lower):.3g}, {float(found.upper):.3g}], tolerance {tolerance:.3g}"
    if parts_only:
        if found.hit:
            yield asked.failed("moving B by -distance * normal parts unions", where)
    elif found.upper < -tolerance or found.lower > tolerance:
        yield asked.failed("moving B by -distance * normal touches", where)


# --- the same question asked otherwise --------------------------------------------------------------


def same_bits(one: np.ndarray, other: np.ndarray, skip=()) -> list[str]:
    """Fields in which rows differ."""
    return [name for name in FIELDS if name not in skip and one[name].tobytes() != other[name].tobytes()]


def judge_swapped(asked: Asked) -> Iterator[Failure]:
    A, B, X_WA, X_WB = asked.pair
    if A == B and np.array_equal(X_WA, X_WB):
        return
    swapped = flipped(asked.engine.distance(B, A, X_WB, X_WA).rows)  # type: ignore[operator]
    if differ := same_bits(asked.r.rows, swapped, skip=("a", "b")):
        yield asked.failed(
            "swapped arguments, mirrored bits",
            f"differ: {differ}",
            "r, s = C.distance(A, B, X_WA, X_WB), C.distance(B, A, X_WB, X_WA)",
        )
    if asked.engine.collide(B, A, X_WB, X_WA) != asked.engine.collide(*asked.pair):  # type: ignore[operator]
        yield asked.failed("swapped booleans", "", "C.collide(A, B, X_WA, X_WB), C.collide(B, A, X_WB, X_WA)")


def judge_ladder(asked: Asked) -> Iterator[Failure]:
    """A batch along the normal: its first row as the single answer, booleans as the signs of distances."""
    A, B, X_WA, X_WB = asked.pair
    random, meshed = asked.random, any(isinstance(p, collide.Mesh) for s in (A, B) for p in pieces(s))
    steps = asked.S * 10.0 ** random.uniform(-16, -6, size=RUNGS) * random.choice([-1.0, 1.0], size=RUNGS)
    steps[0] = 0.0
    if asked.r.distance > 0 or asked.one_convex:
        steps[1:] -= asked.r.distance
    X_WBs = np.repeat(X_WB[None], RUNGS, axis=0)
    X_WBs[:, :3, 3] += steps[:, None] * asked.r.normal
    # Depths of meshes take milliseconds each: gaps alone along the ladder.
    rows = asked.engine.distance(A, B, X_WA, X_WBs, signed=not meshed).rows  # type: ignore[operator]
    if not meshed and (differ := same_bits(asked.r.rows, rows[:1])):
        yield asked.failed(
            "batch and single, the same bits",
            f"differ: {differ}",
            f"X_WBs = np.repeat(X_WB[None], {RUNGS}, axis=0)\nr, s = C.distance(A, B, X_WA, X_WB), C.distance(A, B, "
            f"X_WA, X_WBs)",
        )
    hits = asked.engine.collide(A, B, X_WA, X_WBs)  # type: ignore[operator]
    if hits[0] != asked.engine.collide(*asked.pair):  # type: ignore[operator]
        yield asked.failed(
            "batch and single booleans", "", "C.collide(A, B, X_WA, X_WB), C.collide(A, B, X_WA, X_WB[None])"
        )
    wrong = (hits != rows["hit"]) & (rows["how"] != UNDECIDED)
    for k in np.flatnonzero(wrong)[:1]:
        signed = ", signed=False" if meshed else ""
        ask = f"X_WB[:3, 3] = {X_WBs[k, :3, 3].tolist()!r}\n"
        ask += f"C.collide(A, B, X_WA, X_WB), C.distance(A, B, X_WA, X_WB{signed})"
        bracket = f"[{rows['lower'][k]!r}, {rows['upper'][k]!r}]"
        found = f"{int(wrong.sum())} of {RUNGS}: collide {hits[k]}, distance in {bracket}"
        yield asked.failed("collide == distance.hit", found, ask)


def judge_unsigned(asked: Asked) -> Iterator[Failure]:
    u, ask = asked.engine.distance(*asked.pair, signed=False), "r = C.distance(A, B, X_WA, X_WB, signed=False)"  # type: ignore[operator]
    truth = asked.truth
    if u.hit != asked.r.hit:
        yield asked.failed("signed=False, the same boolean", f"hit {u.hit}", ask)
    if u.hit and u.how != UNDECIDED:
        if not u.distance == u.lower == u.upper == 0 or u.normal.any():
            yield asked.failed("signed=False of a hit is 0", f"{u.distance!r} in [{u.lower!r}, {u.upper!r}]", ask)
    elif (
        Decimal(u.lower) > max(truth.upper, Decimal(0))
        or Decimal(u.upper) < truth.lower
        or not u.lower <= u.distance <= u.upper
    ):
        yield asked.failed(
            "signed=False: lower <= truth <= upper", f"{u.distance!r} in [{u.lower!r}, {u.upper!r}]", ask
        )


# --- limits, margins, worlds -------------------------------------------------------------------------


def limits(asked: Asked, random) -> list[float]:
    """Limits about the distance, of its order, and of the sizes of the pair."""
    r, found = asked.r, []
    if r.distance > 0:
        found.append(
            float(np.nextafter(max(float(asked.truth.upper), 0.0), math.inf))
        )  # the truth is within, if only just
        found += [
            r.distance * f for f in (random.uniform(0.1, 0.99), 1 - 1e-9, 1 + 1e-9, random.uniform(1.01, 3), 10.0)
        ]
    return [*found, 0.0, asked.S * 10.0 ** random.uniform(-12, 0.5)]


def judge_limits(asked: Asked) -> Iterator[Failure]:
    r, truth = asked.r, asked.truth
    for limit in limits(asked, asked.random):
        q = asked.engine.distance(*asked.pair, max_distance=limit)  # type: ignore[operator]
        ask = f"r = C.distance(A, B, X_WA, X_WB, max_distance={limit!r})"
        told = f"beyond {q.beyond}, {q.distance!r} in [{q.lower!r}, {q.upper!r}], max_distance {limit!r}"
        if q.beyond:
            if Decimal(q.lower) > truth.upper:
                yield asked.failed("beyond: lower <= truth", told, ask)
            if truth.upper < Decimal(limit):
                yield asked.failed("beyond only where beyond", told, ask)
            if not q.lower >= limit or q.upper != math.inf or q.hit:
                yield asked.failed("beyond: lower >= max_distance, upper infinite, no hit", told, ask)
            continue
        if Decimal(q.lower) > truth.upper or Decimal(q.upper) < truth.lower or not q.lower <= q.distance <= q.upper:
            yield asked.failed("with a limit: lower <= truth <= upper", told, ask)
        if q.lower > limit:
            yield asked.failed("proven beyond is beyond", told, ask)
        if not abs(np.linalg.norm(q.normal) - 1) <= 1e-12:
            yield asked.failed("with a limit: |normal| = 1", f"{q.normal}; {told}", ask)
        wide = 2 * max(q.upper - q.lower, r.upper - r.lower)
        if (q.hit != r.hit and UNDECIDED not in (q.how, r.how)) or abs(q.distance - r.distance) > wide:
            yield asked.failed("with a limit, the same answer", told, ask)


def judge_world(asked: Asked) -> Iterator[Failure]:
    A, B, X_WA, X_WB = asked.pair
    world = asked.engine.World()  # type: ignore[operator]
    world.add(A, X_WA)
    world.add(B, X_WB)
    text = "w = C.World(); w.add(A, X_WA); w.add(B, X_WB)\n"
    hits = world.collisions().rows
    if world.collides() != bool(len(hits)):
        yield asked.failed(
            "World.collides() == any collisions()",
            f"collides {world.collides()}, {len(hits)} rows",
            text + "w.collides(), len(w.collisions())",
        )
    if asked.hit is not None and bool(len(hits)) != asked.hit and not (len(hits) and hits["how"][0] == UNDECIDED):
        yield asked.failed("World.collisions() is right", f"{len(hits)} rows", text + "len(w.collisions())")
    for limit in limits(asked, np.random.default_rng([8, asked.case.number])):
        rows, ask = world.distances(limit).rows, text + f"w.distances({limit!r}).rows"
        if not len(rows) and asked.truth.upper < Decimal(limit):
            sure = "" if asked.r.upper <= limit else ", those too whose bracket reaches beyond the limit"
            yield asked.failed(f"World.distances holds all pairs within{sure}", f"limit {limit!r}: no row", ask)
        if len(rows) and asked.truth.lower > Decimal(limit) and rows["lower"][0] > limit:
            yield asked.failed("World.distances holds pairs within alone", f"limit {limit!r}: a row", ask)
        if len(rows):
            q = asked.engine.distance(A, B, X_WA, X_WB, max_distance=limit).rows  # type: ignore[operator]
            if differ := same_bits(rows, q, skip=("a", "b", "iterations")):
                yield asked.failed(
                    "a World's row, the bits of distance",
                    f"limit {limit!r}: {differ}",
                    ask + f", C.distance(A, B, X_WA, X_WB, max_distance={limit!r}).rows",
                )


def judge_contacts(asked: Asked) -> Iterator[Failure]:
    r, truth = asked.r, asked.truth
    margins = [0.0, *([r.lower * 0.5, r.upper * (1 + 1e-6), r.upper * 2] if r.lower > 0 else [asked.S * 1e-3])]
    for margin in margins:
        ask = f"c = C.contacts(A, B, X_WA, X_WB, margin={margin!r})"
        rows = asked.engine.contacts(*asked.pair, margin=margin).rows  # type: ignore[operator]
        told = f"{len(rows)} rows, margin {margin!r}"
        if not len(rows) and (truth.upper < Decimal(margin) or asked.hit):
            yield asked.failed("contacts within the margin", told, ask)
        if len(rows) and r.lower > margin and truth.lower > Decimal(margin):
            yield asked.failed("no contacts beyond the margin", f"{told}, least {rows['distance'].min()!r}", ask)
        for found in _contact_failures(asked, rows):
            yield asked.failed(*found, ask)


def _contact_failures(asked: Asked, rows) -> Iterator[tuple[str, str]]:
    for k, row in enumerate(rows):
        n, d = row["normal"], row["distance"]
        if not abs(np.linalg.norm(n) - 1) <= 1e-12:
            yield "contacts: |normal| = 1", f"row {k}: {n}"
        if not row["lower"] <= d <= row["upper"]:
            yield "contacts: lower <= distance <= upper", f"row {k}"
        off, wide = np.abs(row["point_b"] - row["point_a"] - d * n).max(), row["upper"] - row["lower"]
        allowed = POINTS * asked.coordinates + wide
        if not off <= allowed:
            yield "contacts: point_b - point_a = distance * normal", f"row {k}: off by {off:.3g}, allowed {allowed:.3g}"
        if row["kind"] == 2 or (d <= 0 and not asked.one_convex) or k > 4:
            continue
        for name, shape, X in (("point_a", asked.case.A, asked.case.X_WA), ("point_b", asked.case.B, asked.case.X_WB)):
            away = curved_oracle.away_from(shape, X, row[name])
            if not away <= 1e-9 * asked.coordinates + wide:
                yield (
                    "contacts: points lie on their bodies",
                    f"row {k}, {name}: off by {away:.3g}, distance {float(d)!r}",
                )


def judge_certificate(asked: Asked) -> Iterator[Failure]:
    """Where there is a certificate, it stands against all vertices in integers."""
    if (
        asked.random.uniform() < 0.7
        or sum(len(getattr(p, "points", ())) for s in asked.pair[:2] for p in pieces(s)) > 100
    ):
        return
    if asked.r.certificate is None:
        return
    try:
        collide.verify(*asked.pair, asked.r)
    except collide.CertificateRefused as error:
        yield asked.failed(
            "certificates are accepted", str(error), "r = C.distance(A, B, X_WA, X_WB); C.verify(A, B, X_WA, X_WB, r)"
        )


JUDGES = (
    judge_bracket, judge_normal, judge_points, judge_move, judge_swapped, judge_ladder, judge_unsigned, judge_limits,
    judge_world, judge_contacts, judge_certificate,
)


class Judged(NamedTuple):
    """failures : (promise, found, text).   apart, hit, open : the truth.   told : the oracle is as sharp as the
    engine."""

    failures: list[Failure]
    truth: bool | None
    told: bool


def judge(case: Case, engine: Engine | None = None, judges=JUDGES) -> Judged:
    """All failures of one case. An exception is one, too."""
    engine = engine or Engine()
    pair = case.A, case.B, case.X_WA, case.X_WB
    try:
        asked = Asked(case, engine)
    except UnsupportedQuery:
        endless = curved_oracle.bracket(*pair)
        if endless.lower == -Decimal("inf") and engine.collide(*pair):  # type: ignore[operator]
            return Judged([], True, True)
        return Judged(
            [("only endless overlaps are refused", str(endless), question(case) + "C.distance(A, B, X_WA, X_WB)")],
            None,
            True,
        )
    failures: list[Failure] = []
    for judge_one in judges:
        try:
            failures += judge_one(asked)
        except Exception as error:  # noqa: BLE001 whatever it is, it is a failure
            failures.append(
                (f"no exception in {judge_one.__name__}", f"{type(error).__name__}: {error}", question(case))
            )
    width = asked.truth.upper - asked.truth.lower
    return Judged(
        failures, asked.hit, width <= 2 * max(Decimal(asked.r.upper) - Decimal(asked.r.lower), Decimal(1e-15 * asked.S))
    )


# --- many pairs at once ------------------------------------------------------------------------------


def judge_group(cases: list[Case], text: str, engine: Engine | None = None) -> Iterator[Failure]:
    """Cases asked in one batch of lists of shapes, in threads too, and all their bodies in one World.

    text : code that makes ``cases``.
    """
    engine = engine or Engine()
    cases = [c for c in cases if not all(isinstance(s, collide.Halfspace) for s in (c.A, c.B))]
    columns = (
        [c.A for c in cases],
        [c.B for c in cases],
        np.array([c.X_WA for c in cases]),
        np.array([c.X_WB for c in cases]),
    )
    singles = np.concatenate([engine.distance(c.A, c.B, c.X_WA, c.X_WB).rows for c in cases])  # type: ignore[operator]
    lists = "[c.A for c in cases], [c.B for c in cases], "
    lists += "np.array([c.X_WA for c in cases]), np.array([c.X_WB for c in cases])"
    for threads in (1, 2):
        rows = engine.distance(*columns, threads=threads).rows  # type: ignore[operator]
        if differ := same_bits(rows, singles):
            where = [c.number for c, one, other in zip(cases, rows, singles) if same_bits(one, other)]
            yield (
                f"lists of shapes in {threads} threads, the bits of singles",
                f"{differ} in cases {where}",
                text + f"C.distance({lists}, threads={threads})",
            )
    hits = engine.collide(*columns)  # type: ignore[operator]
    alone = np.array([engine.collide(c.A, c.B, c.X_WA, c.X_WB) for c in cases])  # type: ignore[operator]
    if (hits != alone).any():
        yield (
            "booleans of lists of shapes, those of singles",
            f"cases {[c.number for c in np.array(cases, dtype=object)[hits != alone]]}",
            text + f"C.collide({lists})",
        )
    yield from _world_failures(cases, text, engine)


def _world_failures(cases: list[Case], text: str, engine: Engine) -> Iterator[Failure]:
    """A World of all bodies has the rows that its pairs have one by one."""
    bodies = [(s, X) for c in cases for s, X in ((c.A, c.X_WA), (c.B, c.X_WB)) if not isinstance(s, collide.Halfspace)]
    world = engine.World()  # type: ignore[operator]
    for shape, X in bodies:
        world.add(shape, X)
    text += "w = C.World()\nfor c in cases:\n    for s, X in ((c.A, c.X_WA), (c.B, c.X_WB)):\n"
    text += "        isinstance(s, C.Halfspace) or w.add(s, X)\n"
    limit = float(np.median([size_of(c) for c in cases])) * 0.1
    rows = world.distances(limit).rows
    found = {(int(row["a"]), int(row["b"])): row for row in rows}
    told, lost, other = f"limit {limit!r}: {len(rows)} rows", [], []
    for i, (A, X_WA) in enumerate(bodies):
        for j in range(i + 1, len(bodies)):
            q = engine.distance(A, bodies[j][0], X_WA, bodies[j][1], max_distance=limit).rows  # type: ignore[operator]
            row = found.pop((i, j), None)
            if row is None:
                lost += [(i, j)] * bool(q["upper"][0] <= limit)
            elif q["lower"][0] > limit or same_bits(row, q, skip=("a", "b", "iterations")):
                other.append((i, j))
    if lost or found:
        yield (
            "a World has the rows of its pairs",
            f"{told}; lost {lost}, of no pair {list(found)}",
            text + f"w.distances({limit!r}).rows",
        )
    if other:
        yield "a World has the bits of its pairs", f"{told}; pairs {other}", text + f"w.distances({limit!r}).rows"
    if world.collides() != bool(len(world.collisions())):
        yield "World.collides() == any collisions()", told, text + "w.collides(), len(w.collisions())"
