"""Worlds of every kind of body under random changes, every answer beside those of their pairs asked one by one.

    python tests/soak/soak_worlds.py --questions 100000 --seed 1
    python tests/soak/soak_worlds.py --seed 1 --world 17          one World again, with what differs

A World of a few bodies is changed (bodies added, one or many at once, moved far and to a hair's breadth of others,
replaced and removed, given other shapes, put to sleep and woken, allowed, with margins of bodies and of pairs, copied
and pickled) and asked everything that a World
offers. What it is to answer comes from pair queries about each two of its bodies, or about a body and what asks from
outside, and from filters, margins and sleep kept in dictionaries here: no box, tree, bound or cached pair has a say.
Rows are compared bit by bit, hits of rays and casts within their brackets. A pair whose bracket holds the limit itself
is open to the query of the pair, which counts it as within; a World may have proven it beyond by boxes or hulls, and
leaves it out: that alone is let pass, and counted. The shapes are those of `soak_pairs.py`.

Prints what differs as it comes, and at the end how many questions each kind of body had a part in, of each sort and
after each change, and how much of what was asked hit. Ends with status 1 where anything differs, or where a kind was
never asked something. A question is one call of a World; it is judged for all its pairs.
"""

from __future__ import annotations

import argparse
import collections
import copy
import itertools
import pickle
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "oracles"))

import numpy as np
from soak_pairs import ENDLESS, WORLD_KINDS, rotation, shape

import collide
from collide import UnsupportedQuery
from collide.adapters.live.scene_of_world import scene_of_world
from collide.reports import report
from collide.results import PAIR_DTYPE

#: What a body is added with.
TRAITS = ("static", "group", "mask", "margin")
#: Changes before questions, questions after them, and steps of a World.
CHANGES, QUESTIONS, STEPS = 3, 12, 16
#: Bodies of a World, and how many of them have no end at most.
FEWEST, MOST, MOST_ENDLESS = 5, 11, 3
#: Kinds whose pairs take up to 0.1 s, and how many bodies of a World are of these at most.
SLOW, MOST_SLOW = ("mesh compound", "nested compound"), 1
#: Of every sort of question at least so many pairs hit, and as many do not.
LEAST_SHARE = 0.005
#: Pairs of solids that overlap, and pairs that are refused, are few: there are some.
RARE = ("overlaps", "unanswerable")
#: Rays and casts are compared within this, for each metre.
CLOSE = 1e-9
#: Of pairs judged at most so many may be open at the limit.
MOST_OPEN = 0.01
#: Kinds of which two are within a margin or not for certain: integers decide (docs of `collide.collide`).
EXACT = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "point", "segment", "polygon", "half-space",
)
#: Fields of rows that say nothing of the pair.
_SKIPPED = ("a", "b", "iterations")
_PAIR_FIELDS = tuple(name for name in PAIR_DTYPE.names or () if name not in _SKIPPED)
_POINT = collide.ConvexHull(np.zeros((1, 3)))
_OF_OVERLAPS = ("volume", "lower", "upper", "centroid", "area_a", "area_b", "patch_area", "flush_area")


@dataclass
class Body:
    """A body as it is to be.   version : another one after each move.   changes : what has been done to it."""

    kind: str
    shape: collide.Shape
    X: np.ndarray
    static: bool
    group: int
    mask: int
    margin: float
    asleep: bool = False
    version: int = 0
    changes: set[str] = field(default_factory=lambda: {"added"})

    def counts_for(self, group: int | None, mask: int | None) -> bool:
        return (group is None or bool(group & self.mask)) and (mask is None or bool(self.group & mask))


@dataclass
class Refused:
    """What a pair query refuses.   endless : the bodies overlap without end, and a World says −∞."""

    why: str
    endless: bool = False


@dataclass
class Tally:
    """questions : calls by sort.   cells : (kind, sort or change) → questions.   judged, hits : pairs by sort."""

    questions: collections.Counter = field(default_factory=collections.Counter)
    cells: collections.Counter = field(default_factory=collections.Counter)
    judged: collections.Counter = field(default_factory=collections.Counter)
    hits: collections.Counter = field(default_factory=collections.Counter)
    refused: collections.Counter = field(default_factory=collections.Counter)
    open: collections.Counter = field(default_factory=collections.Counter)
    differing: list[str] = field(default_factory=list)

    def share(self, sort: str) -> float:
        return self.hits[sort] / max(self.judged[sort], 1)

    def empty_cells(self) -> list[tuple[str, str]]:
        columns = (*ASKED, *CHANGED)
        return [
            (kind, what) for kind in WORLD_KINDS for what in columns
            if not self.cells[kind, what] and (kind, what) not in NEVER
        ]

    def is_mostly_decided(self) -> bool:
        return sum(self.open.values()) <= MOST_OPEN * sum(self.judged.values())

    def one_sided(self) -> list[str]:
        """Sorts of questions whose answers were nearly all the same."""
        least = {sort: 1e-9 if sort in RARE else LEAST_SHARE for sort in ASKED}
        return [sort for sort in ASKED if not least[sort] <= self.share(sort) <= 1 - LEAST_SHARE]

    def text(self) -> str:
        lines = [f"{sum(self.questions.values())} questions, {len(self.differing)} differ", ""]
        lines += [
            f"{sort:24} {n:7d} questions, {self.judged[sort]:8d} pairs judged, {self.share(sort):6.1%} hit or named, "
            f"{self.refused[sort]} refused, {self.open[sort]} open" for sort, n in self.questions.items()
        ]
        for columns in (tuple(ASKED), CHANGED):
            width = max(map(len, columns)) + 1
            lines += ["", " " * 20 + "".join(f"{name:>{width}}" for name in columns)]
            lines += [
                f"{kind:20}" + "".join(f"{self.cells[kind, name]:{width}d}" for name in columns) for kind in WORLD_KINDS
            ]
        return "\n".join(lines)


class Model:
    """World number ``number`` of a seed, and what it is to answer."""

    def __init__(self, seed: int, number: int, tally: Tally, make_world: Callable = collide.World):
        self.random = np.random.default_rng([seed, number, 2])
        self.name, self.tally, self.world = (seed, number), tally, make_world()
        self.bodies: dict[int, Body] = {}
        self.allowed: set[tuple[int, int]] = set()
        self.pair_margins: dict[tuple[int, int], float] = {}
        self.known: dict[tuple, object] = {}
        self.step = 0
        self.margins = bool(self.random.uniform() < 0.7)

    # --- changes --------------------------------------------------------------------------------

    def change(self) -> None:
        random = self.random
        what = str(random.choice(CHANGED))
        if len(self.bodies) < FEWEST:
            what = "added"
        elif what in ("added", "added many") and len(self.bodies) >= MOST:
            what = "removed"
        getattr(self, f"_{what.replace(' ', '_')}")()

    def some(self, k: int) -> list[int]:
        return sorted(self.random.choice(list(self.bodies), min(k, len(self.bodies)), replace=False).tolist())

    def _note(self, ids, what: str) -> None:
        for identity in ids:
            self.bodies[identity].changes.add(what)

    def _shape_beside(self, others: list[Body]) -> tuple[str, collide.Shape]:
        """(its kind, a shape of a body among others)."""
        n_endless, n_slow = (sum(body.kind in kinds for body in others) for kinds in (ENDLESS, SLOW))
        left_out = (ENDLESS if n_endless >= MOST_ENDLESS else ()) + (SLOW if n_slow >= MOST_SLOW else ())
        kind = str(self.random.choice([kind for kind in WORLD_KINDS if kind not in left_out]))
        return kind, shape(kind, 10.0 ** self.random.uniform(-0.5, 0.3), self.random)

    def _body_beside(self, others: list[Body]) -> Body:
        random = self.random
        return Body(
            *self._shape_beside(others), self._anywhere(), bool(random.uniform() < 0.2),
            int(random.choice([1, 1, 3, 2])), int(random.choice([3, 3, 1, 2])),
            self._margin() if random.uniform() < 0.5 else 0.0,
        )

    def _added(self, name: str | None = None) -> int:
        body = self._body_beside(list(self.bodies.values()))
        identity = self.world.add(body.shape, body.X, name=name, **{trait: getattr(body, trait) for trait in TRAITS})
        self.bodies[identity] = body
        return identity

    def _added_many(self) -> None:
        """Each with its own shape and traits, or all with those of the first."""
        others, bodies = list(self.bodies.values()), []
        for _ in range(int(self.random.integers(1, 4))):
            bodies.append(self._body_beside(others + bodies))
        first, X_WBs = bodies[0], np.array([body.X for body in bodies])
        if first.kind not in ENDLESS + SLOW and self.random.uniform() < 0.4:
            bodies = [replace(first, X=body.X, changes=set(first.changes)) for body in bodies]
            shapes, traits = first.shape, {trait: getattr(first, trait) for trait in TRAITS}
        else:
            shapes = [body.shape for body in bodies]
            traits = {trait: [getattr(body, trait) for body in bodies] for trait in TRAITS}
        ids = self.world.add_many(shapes, X_WBs, **traits).tolist()
        self.bodies |= dict(zip(ids, bodies))
        self._note(ids, "added many")

    def _shape_replaced(self) -> None:
        """Another shape of the same body."""
        (identity,) = self.some(1)
        body = self.bodies[identity]
        body.kind, body.shape = self._shape_beside([other for other in self.bodies.values() if other is not body])
        body.version += 1
        self.world.replace(identity, body.shape)
        self._note([identity], "shape replaced")

    def _margin(self) -> float:
        return float(self.random.choice([0.0, 0.0, 0.02, 0.3])) if self.margins else 0.0

    def _anywhere(self) -> np.ndarray:
        X = rotation(self.random)
        X[:3, 3] = self.random.uniform(-1.3, 1.3, 3)
        return X

    def _removed(self) -> None:
        (identity,) = self.some(1)
        self.world.remove(identity)
        del self.bodies[identity]
        self.allowed = {pair for pair in self.allowed if identity not in pair}
        self.pair_margins = {pair: m for pair, m in self.pair_margins.items() if identity not in pair}
        self._note(self.bodies, "removed")

    def _replaced(self) -> None:
        """Another body by the name of one that goes."""
        (identity,) = self.some(1)
        name = self.world.names[identity]
        self.world.remove(identity)
        del self.bodies[identity]
        self.allowed = {pair for pair in self.allowed if identity not in pair}
        self.pair_margins = {pair: m for pair, m in self.pair_margins.items() if identity not in pair}
        self._note([self._added(name)], "replaced")

    def _moved(self) -> None:
        ids = self.some(int(self.random.integers(1, 4)))
        for identity in ids:
            self._place(identity, self._anywhere())
        self.world.set_poses(ids, np.array([self.bodies[k].X for k in ids]))
        self._note(ids, "moved")

    def _moved_near(self) -> None:
        """To a gap or a depth from another body, of any size, or as large as their margin."""
        random, (i, j) = self.random, self.some(2)
        self._place(j, self._anywhere())
        row = self.distance(i, j, np.inf)
        if not isinstance(row, Refused) and np.isfinite(row["distance"]):
            gap = self.margin_of(i, j) if random.uniform() < 0.3 else 10.0 ** random.uniform(-12, 0)
            gap = -gap if random.uniform() < 0.25 else gap
            X = self.bodies[j].X.copy()
            X[:3, 3] += (gap - row["distance"]) * row["normal"]
            self._place(j, X)
        self.world.set_pose(j, self.bodies[j].X)
        self._note([i, j], "moved near")

    def _place(self, identity: int, X: np.ndarray) -> None:
        body = self.bodies[identity]
        body.X, body.version = X, body.version + 1

    def _margin_set(self) -> None:
        (identity,) = self.some(1)
        self.bodies[identity].margin = self._margin()
        self.world.set_margin(identity, self.bodies[identity].margin)
        self._note([identity], "margin set")

    def _pair_margin(self) -> None:
        i, j = self.some(2)
        if self.random.uniform() < 0.6:
            self.pair_margins[i, j] = self._margin()
            self.world.set_margin(j, self.pair_margins[i, j], partner=i)
        else:
            self.pair_margins.pop((i, j), None)
            self.world.set_margin(i, None, partner=j)
        self._note([i, j], "pair margin")

    def _allowed_pair(self) -> None:
        i, j = self.some(2)
        if len(self.allowed) < 3:
            self.allowed.add((i, j))
            self.world.allow(j, i)
            self._note([i, j], "allowed pair")

    def _put_to_sleep(self) -> None:
        ids = self.some(2)
        for identity in ids:
            self.bodies[identity].asleep = True
        self.world.sleep(ids)
        self._note(ids, "put to sleep")

    def _woken(self) -> None:
        ids = self.some(4)
        for identity in ids:
            self.bodies[identity].asleep = False
        self.world.wake(ids)
        self._note(ids, "woken")

    def _copied(self) -> None:
        self.world = copy.copy(self.world) if self.random.uniform() < 0.5 else pickle.loads(pickle.dumps(self.world))
        self._note(self.bodies, "copied")

    # --- pairs, one by one ----------------------------------------------------------------------

    def margin_of(self, i: int, j: int) -> float:
        return self.pair_margins.get((i, j), self.bodies[i].margin + self.bodies[j].margin)

    def tested(self) -> list[tuple[int, int]]:
        pairs = []
        for i, j in itertools.combinations(sorted(self.bodies), 2):
            a, b = self.bodies[i], self.bodies[j]
            still = (a.static or a.asleep) and (b.static or b.asleep)
            if not still and a.group & b.mask and b.group & a.mask and (i, j) not in self.allowed:
                pairs.append((i, j))
        return pairs

    def distance(self, i: int, j: int, limit: float):
        """A row, or `Refused`."""
        a, b = self.bodies[i], self.bodies[j]
        key = "distance", i, a.version, j, b.version, limit
        return self._once(key, lambda: asked_alone(a.shape, b.shape, a.X, b.X, limit))

    def hits(self, i: int, j: int, margin: float):
        """Whether they are within a margin, or `Refused`."""
        a, b = self.bodies[i], self.bodies[j]

        def ask():
            try:
                return collide.collide(a.shape, b.shape, a.X, b.X, security_margin=margin)
            except UnsupportedQuery as error:
                return Refused(str(error))

        return self._once(("hits", i, a.version, j, b.version, margin), ask)

    def contacts(self, i: int, j: int, margin: float, most: int):
        a, b = self.bodies[i], self.bodies[j]

        def ask():
            try:
                return collide.contacts(a.shape, b.shape, a.X, b.X, margin=margin, max_contacts=most).rows
            except UnsupportedQuery as error:
                return Refused(str(error))

        return self._once(("contacts", i, a.version, j, b.version, margin, most), ask)

    def _once(self, key: tuple, ask: Callable):
        if key not in self.known:
            self.known[key] = ask()
        return self.known[key]

    # --- questions ------------------------------------------------------------------------------

    def run(self, steps: int = STEPS, sorts=None) -> None:
        """Change and ask.   sorts : of questions, by name; all by default."""
        while len(self.bodies) < FEWEST + 2:
            self._added()
        sorts = list(sorts or ASKED)
        shares = np.array([ASKED[sort][0] for sort in sorts])
        for self.step in range(steps):
            for _ in range(int(self.random.integers(1, CHANGES + 1))):
                self.change()
            for sort in self.random.choice(sorts, size=QUESTIONS, p=shares / shares.sum()).tolist():
                self.ask(sort)

    def ask(self, sort: str) -> None:
        tally = self.tally
        tally.questions[sort] += 1
        for body in self.bodies.values():
            tally.cells[body.kind, sort] += 1
            for change in body.changes:
                tally.cells[body.kind, change] += 1
        try:
            wrong = list(ASKED[sort][1](self))
        except Exception as error:  # noqa: BLE001 whatever it is, it differs
            wrong = [f"{type(error).__name__}: {error}"]
        seed, number = self.name
        tally.differing += [
            f"python tests/soak/soak_worlds.py --seed {seed} --world {number}   # step {self.step}, {sort}: {what}"
            for what in wrong
        ]

    def tell(self, sort: str, n: int, hits: int) -> None:
        self.tally.judged[sort] += n
        self.tally.hits[sort] += hits

    def names(self, pair) -> str:
        return " and ".join(f"{k} ({self.bodies[k].kind})" for k in pair)

    def refused(self, sort: str, error: UnsupportedQuery, may: list) -> Iterator[str]:
        """A World refuses where one of its pairs does."""
        self.tally.refused[sort] += 1
        if not may:
            yield f"refused, and no pair is: {error}"

    def boolean(self, margin: float, sort: str) -> Iterator[str]:
        expected = {pair: self.hits(*pair, margin + self.margin_of(*pair)) for pair in self.tested()}
        refused = [pair for pair, hit in expected.items() if isinstance(hit, Refused)]
        hits = [pair for pair, hit in expected.items() if hit is True]
        self.tell(sort, len(expected), len(hits))
        threads = int(self.random.integers(1, 3))
        try:
            told = self.world.collides(security_margin=margin, threads=threads)
        except UnsupportedQuery as error:
            yield from self.refused(sort, error, refused)
            return
        sure = [pair for pair in hits if not self.is_open(pair, margin + self.margin_of(*pair))]
        self.tally.open[sort] += len(hits) - len(sure)
        if not (bool(sure) <= told <= bool(hits or refused)):
            yield f"{told}, but {[self.names(pair) for pair in hits]} of {len(expected)} pairs hit"

    def collisions(self) -> Iterator[str]:
        expected: dict[tuple[int, int], object] = {}
        for pair in self.tested():
            margin = self.margin_of(*pair)
            hit = self.hits(*pair, margin)
            if isinstance(hit, Refused):
                expected[pair] = hit
            elif hit:
                expected[pair] = self.distance(*pair, margin)
        may_lack = {pair for pair in expected if self.is_open(pair, self.margin_of(*pair))}
        yield from self._rows("collisions", lambda: self.world.collisions(), expected, may_lack)

    def distances(self) -> Iterator[str]:
        limit = float(self.random.choice([0.0, 0.05, 0.5, np.inf]))
        expected = {}
        for pair in self.tested():
            row = self.distance(*pair, limit)
            if isinstance(row, Refused) or not row["lower"] > limit:
                expected[pair] = row
        may_lack = {pair for pair, row in expected.items() if _straddles(row, limit)}
        yield from self._rows("distances", lambda: self.world.distances(limit), expected, may_lack)

    def is_open(self, pair: tuple[int, int], margin: float) -> bool:
        """Whether a pair counts as within a margin because nothing says that it is not."""
        if margin == 0.0 or all(self.bodies[k].kind in EXACT for k in pair):
            return False
        return _straddles(self.distance(*pair, np.inf), margin)

    def _rows(self, sort: str, ask: Callable, expected: dict, may_lack: set) -> Iterator[str]:
        """Rows of a World beside those of its pairs.   may_lack : pairs that it may have proven beyond."""
        refused = [pair for pair, row in expected.items() if isinstance(row, Refused) and not row.endless]
        self.tell(sort, len(self.tested()), len(expected))
        try:
            rows = ask().rows
        except UnsupportedQuery as error:
            yield from self.refused(sort, error, refused)
            return
        found = {(int(row["a"]), int(row["b"])): row for row in rows}
        if list(found) != sorted(found) or len(found) != len(rows):
            yield f"rows are not sorted, each pair once: {list(found)}"
        for pair, row in expected.items():
            told = found.pop(pair, None)
            if isinstance(row, Refused):
                if row.endless and (told is None or told["distance"] != -np.inf or not told["hit"]):
                    yield f"{self.names(pair)} overlap without end: {told}"
            elif told is None and pair in may_lack:
                self.tally.open[sort] += 1
            elif told is None:
                yield f"{self.names(pair)} lost: {row['distance']!r} in [{row['lower']!r}, {row['upper']!r}]"
            elif differ := _differing(told, row, _PAIR_FIELDS):
                yield f"{self.names(pair)}: {differ}"
        for pair in found:
            yield f"{self.names(pair)}: a row of no pair, {found[pair]['distance']!r}"

    def minimum(self) -> Iterator[str]:
        limit = float(self.random.choice([0.05, 1.0, np.inf, np.inf]))
        rows = {pair: self.distance(*pair, np.inf) for pair in self.tested()}
        endless = [pair for pair, row in rows.items() if isinstance(row, Refused) and row.endless]
        refused = [pair for pair, row in rows.items() if isinstance(row, Refused) and not row.endless]
        known = {pair: row for pair, row in rows.items() if not isinstance(row, Refused)}
        try:
            told = self.world.minimum(limit).rows
        except UnsupportedQuery as error:
            yield from self.refused("minimum", error, refused)
            return
        self.tell("minimum", 1, len(told))
        found = (int(told["a"][0]), int(told["b"][0])) if len(told) else None
        if endless:
            if found not in endless or told["distance"][0] != -np.inf:
                yield f"{[self.names(pair) for pair in endless]} overlap without end: {told}"
            return
        least = min(known, key=lambda pair: (known[pair]["distance"], pair), default=None)
        if least is None or known[least]["distance"] > limit:
            if found is not None:
                yield f"{self.names(found)} named, nothing is within {limit}"
        elif found not in known:
            yield f"{found} named, {self.names(least)} is {known[least]['distance']!r} apart, within {limit}"
        else:
            row, other = known[found], known[least]
            width = float(row["upper"] - row["lower"] + other["upper"] - other["lower"])
            if found != least and not row["distance"] - other["distance"] <= width:
                yield f"{self.names(found)}, {row['distance']!r}; {self.names(least)} {other['distance']!r}"
            if differ := _differing(told[0], row, _PAIR_FIELDS):
                yield f"{self.names(found)}: {differ}"

    def all_contacts(self) -> Iterator[str]:
        margin, most = float(self.random.choice([0.0, 0.01, 0.2])), int(self.random.choice([1, 4, 8]))
        expected = {pair: self.contacts(*pair, margin + self.margin_of(*pair), most) for pair in self.tested()}
        refused = [pair for pair, rows in expected.items() if isinstance(rows, Refused)]
        try:
            told = self.world.contacts(margin, max_contacts=most).rows
        except UnsupportedQuery as error:
            yield from self.refused("contacts", error, refused)
            return
        fields = [name for name in told.dtype.names if name not in ("a", "b", "pair")]
        self.tell("contacts", len(expected), sum(len(rows) > 0 for rows in expected.values() if _is_known(rows)))
        for pair, rows in expected.items():
            mine = told[(told["a"] == pair[0]) & (told["b"] == pair[1])]
            told = told[(told["a"] != pair[0]) | (told["b"] != pair[1])]
            if isinstance(rows, Refused):
                continue
            if len(mine) != len(rows):
                yield f"{self.names(pair)}: {len(mine)} rows, {len(rows)} asked alone, margin {margin}"
            elif differ := _differing(mine, rows, fields):
                yield f"{self.names(pair)}: {differ}, margin {margin}"
        if len(told):
            yield f"rows of no pair: {told[['a', 'b']].tolist()}"

    def unanswerable(self) -> Iterator[str]:
        limit = float(self.random.choice([0.1, np.inf]))
        told = {(a, b) for a, b, _ in self.world.unanswerable(limit)}
        rows = {pair: self.distance(*pair, limit) for pair in self.tested()}
        refused = {pair for pair, row in rows.items() if isinstance(row, Refused) and not row.endless}
        self.tell("unanswerable", len(rows), len(refused))
        if told - refused or (limit == np.inf and refused - told):
            yield f"{sorted(told)}, asked alone {sorted(refused)}"

    def overlaps(self) -> Iterator[str]:
        expected, without = {}, set()
        for i, j in self.tested():
            a, b = self.bodies[i], self.bodies[j]
            try:
                found = collide.overlap_volume(a.shape, b.shape, a.X, b.X)
                if found.n_meeting or found.volume > 0.0:
                    expected[i, j] = found
            except (UnsupportedQuery, collide.InvalidArgument):
                if self.hits(i, j, 0.0) is True:
                    without.add((i, j))
        refused = [pair for pair in self.tested() if isinstance(self.hits(*pair, 0.0), Refused)]
        try:
            told = self.world.overlaps()
        except UnsupportedQuery as error:
            yield from self.refused("overlaps", error, refused)
            return
        self.tell("overlaps", len(self.tested()), len(expected))
        if {(a, b) for a, b, _ in told.unanswered} != without:
            yield f"unanswered {told.unanswered}, asked alone {sorted(without)}"
        if told.rows[["a", "b"]].tolist() != sorted(expected):
            yield f"{told.rows[['a', 'b']].tolist()}, asked alone {sorted(expected)}"
            return
        for row, (pair, found) in zip(told.rows, sorted(expected.items())):
            if differ := [name for name in _OF_OVERLAPS if not np.array_equal(row[name], getattr(found, name))]:
                yield f"{self.names(pair)}: {differ}"

    def report(self) -> Iterator[str]:
        """The clearance of a report, which has no margins: every pair within it is in a class."""
        clearance = float(self.random.choice([0.02, 0.4]))
        names = self.world.names
        rows = {pair: self.distance(*pair, clearance) for pair in self.tested()}
        refused = [pair for pair, row in rows.items() if isinstance(row, Refused)]
        within = {pair for pair, row in rows.items() if _is_known(row) and row["upper"] <= clearance * (1 - 1e-6)}
        try:
            told = report.make(scene_of_world(self.world, "soaked"), clearance)
        except UnsupportedQuery as error:
            yield from self.refused("report", error, refused)
            return
        self.tell("report", len(rows), len(within))
        listed = [row for part in (told.colliding, told.shallow, told.touching, told.near) for row in part.dicts()]
        known = {name: identity for identity, name in names.items()}
        pairs = {tuple(sorted((known[row["a"]], known[row["b"]]))) for row in listed}
        if lost := within - pairs:
            yield f"within {clearance}, not reported: {[self.names(pair) for pair in lost]}"
        beyond = [pair for pair in pairs if _is_known(rows[pair]) and rows[pair]["lower"] > clearance * (1 + 1e-6)]
        if beyond:
            yield f"reported within {clearance}: {[self.names(pair) for pair in beyond]}"

    # --- from outside ---------------------------------------------------------------------------

    def _filter(self) -> dict:
        return {
            name: None if self.random.uniform() < 0.6 else int(self.random.integers(1, 4)) for name in ("group", "mask")
        }

    def _counted(self, which: dict) -> list[int]:
        return [k for k, body in sorted(self.bodies.items()) if body.counts_for(**which)]

    def nearest(self) -> Iterator[str]:
        points, which = self.random.uniform(-2, 2, size=(4, 3)), self._filter()
        limit = float(self.random.choice([0.1, np.inf, np.inf]))
        told = self.world.nearest(points, max_distance=limit, **which).rows
        counted = self._counted(which)
        for point, row in zip(points, told):
            X = np.eye(4)
            X[:3, 3] = point
            found = []
            for k in counted:
                answer = asked_alone(_POINT, self.bodies[k].shape, X, self.bodies[k].X, np.inf)
                if isinstance(answer, Refused):  # within a union with a half-space
                    answer = np.zeros(1, dtype=PAIR_DTYPE)[0]
                    answer["distance"] = answer["lower"] = answer["upper"] = -np.inf
                found.append((float(answer["distance"]), k, answer))
            self.tell("nearest", len(counted), int(row["body"] >= 0))
            least = min(found, key=lambda item: item[:2], default=None)
            if least is None or least[2]["lower"] > limit:
                if row["body"] != -1:
                    yield f"point {point.tolist()}: body {row['body']}, nothing is within {limit}"
            elif row["body"] != least[1] or row["distance"] != least[0]:
                told_of = f"body {row['body']} at {row['distance']!r}"
                yield f"point {point.tolist()}: {told_of}, {self.names(least[1:2])} is at {least[0]!r}"
            elif least[0] == -np.inf:
                continue
            elif differ := _differing(row, least[2], ("normal", "certified")):
                yield f"point {point.tolist()}, {self.names(least[1:2])}: {differ}"
            elif row["lower"] > min(item[2]["upper"] for item in found):
                yield f"point {point.tolist()}: lower {row['lower']!r} is beyond another body"

    def rays(self) -> Iterator[str]:
        n, which = 5, self._filter()
        limit = float(self.random.choice([1.0, np.inf]))
        origins, directions = self.random.uniform(-3, 3, (n, 3)), self.random.normal(size=(n, 3))
        directions[0] = np.eye(3)[int(self.random.integers(3))]
        first = self.world.raycast(origins, directions, max_distance=limit, **which).rows
        every = self.world.raycast(origins, directions, max_distance=limit, all_hits=True, **which).rows
        counted = self._counted(which)
        ts: list[list[tuple[float, int]]] = [[] for _ in range(n)]
        for k in counted:
            body = self.bodies[k]
            met = collide.raycast(body.shape, body.X, origins, directions, max_distance=limit, all_hits=True)
            for ray in range(n):
                ts[ray] += [(t, k) for t in met.distance[met.starts[ray] : met.starts[ray + 1]].tolist()]
        for ray in range(n):
            of_ray = every[every["ray"] == ray]
            mine = list(zip(of_ray["distance"].tolist(), of_ray["body"].tolist()))
            theirs, row = sorted(ts[ray]), first[ray]
            self.tell("rays", len(counted), len({k for _, k in theirs}))
            ask = f"ray {origins[ray].tolist()} along {directions[ray].tolist()}, limit {limit}"
            if [k for _, k in sorted(mine, key=_by_body)] != [k for _, k in sorted(theirs, key=_by_body)] or any(
                not abs(a[0] - b[0]) <= CLOSE * (1 + abs(b[0]))
                for a, b in zip(sorted(mine, key=_by_body), sorted(theirs, key=_by_body))
            ):
                yield f"{ask}, all hits: {mine}, asked alone {theirs}"
            if bool(row["hit"]) != bool(theirs):
                yield f"{ask}: {row['body']}, asked alone {theirs}"
            elif theirs and not abs(row["distance"] - theirs[0][0]) <= CLOSE * (1 + theirs[0][0]):
                yield f"{ask}: {row['distance']!r}, asked alone {theirs[0]}"

    def casts(self) -> Iterator[str]:
        which, X, direction = self._filter(), self._anywhere(), self.random.normal(size=3)
        X[:3, 3] *= 2
        kind = str(self.random.choice(["sphere", "box", "capsule", "cylinder", "hull", "solid", "compound"]))
        cast, limit = shape(kind, 0.5, self.random), float(self.random.choice([1.0, np.inf]))
        found, refused = [], []
        counted = self._counted(which)
        for k in counted:
            body = self.bodies[k]
            try:
                met = collide.shape_cast(cast, X, direction, body.shape, body.X, max_distance=limit)
            except UnsupportedQuery:
                refused.append(k)
                continue
            if met.hit:
                found.append((float(met.distance), float(met.upper), float(met.lower), k))
        try:
            row = self.world.shape_cast(cast, X, direction, max_distance=limit, **which).rows[0]
        except UnsupportedQuery as error:
            yield from self.refused("casts", error, refused)
            return
        self.tell("casts", len(counted), len(found))
        ask = f"{kind} from {X[:3, 3].tolist()} along {direction.tolist()}, limit {limit}"
        if bool(row["hit"]) != bool(found):
            yield f"{ask}: body {row['body']}, asked alone {found}"
        elif found:
            t, upper, lower, _ = min(found)
            wide = (upper - lower) + float(row["upper"] - row["lower"]) + CLOSE * (1 + t)
            if not abs(row["distance"] - t) <= wide:
                yield f"{ask}: {row['distance']!r} to {row['body']}, asked alone {min(found)}"

    def query(self) -> Iterator[str]:
        kind = str(self.random.choice([kind for kind in WORLD_KINDS if kind not in ENDLESS]))
        asked, X = shape(kind, 0.8, self.random), self._anywhere()
        limit = float(self.random.choice([0.0, 0.3, np.inf]))
        expected, refused = {}, []
        for k, body in sorted(self.bodies.items()):
            try:
                row = collide.distance(asked, body.shape, X, body.X, max_distance=limit).rows[0]
            except UnsupportedQuery:
                refused.append(k)
                continue
            if _straddles(row, limit):
                self.tally.open["query"] += 1
                refused.append(k)  # by hulls or boxes it may be beyond
            elif not row["lower"] > limit:
                expected[k] = row
        try:
            rows = self.world.query(asked, X, limit, threads=int(self.random.integers(1, 3))).rows
        except UnsupportedQuery as error:
            yield from self.refused("query", error, refused)
            return
        self.tell("query", len(self.bodies), len(expected))
        if [b for b in rows["b"].tolist() if b not in refused] != list(expected):
            yield f"{kind} within {limit}: {rows['b'].tolist()}, asked alone {list(expected)}"
            return
        for row in rows[~np.isin(rows["b"], refused)]:
            if differ := _differing(row, expected[int(row["b"])], _PAIR_FIELDS):
                yield f"{kind} and {self.names([int(row['b'])])}: {differ}"

    def boxes(self) -> Iterator[str]:
        low = self.random.uniform(-2, 1.5, 3)
        high, margin = low + self.random.uniform(0.01, 2, 3), float(self.random.choice([0.0, 0.25]))
        told = self.world.boxes_near(low, high, margin)
        ids, boxes = self.world.bounding_boxes()
        meets = ((boxes[:, :3] - margin <= high) & (low - margin <= boxes[:, 3:])).all(axis=1)
        region, X = collide.Box(high - low), np.eye(4)
        X[:3, 3] = 0.5 * (low + high)
        self.tell("boxes", len(self.bodies), len(told))
        if ids.tolist() != sorted(self.bodies) or np.isnan(boxes).any() or told != ids[meets].tolist():
            yield f"{told}, by their boxes {ids[meets].tolist()}"
        for k, body in self.bodies.items():
            row = asked_alone(region, body.shape, X, body.X, np.inf)
            if k not in told and (not _is_known(row) or row["upper"] < margin - 1e-12):
                yield f"{self.names([k])} is not near the box: {row}"


#: What `collide.distance` says of pairs of which a World says −∞: no way out there is, or was found.
WITHOUT_END = ("overlap has no end", "no translation was found")


def asked_alone(A, B, X_WA, X_WB, limit: float):
    """A row, or `Refused`."""
    try:
        return collide.distance(A, B, X_WA, X_WB, max_distance=limit).rows[0]
    except UnsupportedQuery as error:
        return Refused(str(error), any(why in str(error) for why in WITHOUT_END))


def _differing(one, other, fields) -> list[str]:
    return [name for name in fields if np.asarray(one[name]).tobytes() != np.asarray(other[name]).tobytes()]


def _straddles(row, limit: float) -> bool:
    """Whether a bracket does not say on which side of a limit the truth is."""
    return _is_known(row) and not row["hit"] and bool(row["lower"] <= limit < row["upper"])


def _is_known(answer) -> bool:
    return not isinstance(answer, Refused)


def _by_body(hit: tuple[float, int]) -> tuple[int, float]:
    return hit[1], hit[0]


#: Sorts of questions: share, and what judges one.
ASKED: dict[str, tuple[float, Callable[[Model], Iterator[str]]]] = {
    "collides": (0.13, lambda m: m.boolean(0.0, "collides")),
    "security margin": (0.07, lambda m: m.boolean(float(m.random.choice([0.01, 0.3])), "security margin")),
    "collisions": (0.16, Model.collisions), "distances": (0.13, Model.distances), "minimum": (0.13, Model.minimum),
    "contacts": (0.06, Model.all_contacts), "nearest": (0.08, Model.nearest), "rays": (0.07, Model.rays),
    "casts": (0.03, Model.casts), "query": (0.06, Model.query), "boxes": (0.04, Model.boxes),
    "unanswerable": (0.02, Model.unanswerable), "overlaps": (0.01, Model.overlaps), "report": (0.01, Model.report),
}
#: Changes.
CHANGED = (
    "added", "added many", "moved", "moved near", "replaced", "shape replaced", "removed", "margin set", "pair margin",
    "allowed pair", "put to sleep", "woken", "copied",
)
#: Cells that stay empty, and why: none.
NEVER: dict[tuple[str, str], str] = {}


def soak(seed: int, questions: int, say: Callable = print, first: int = 0, steps: int = STEPS) -> Tally:
    """Worlds ``first``, … of a seed until so many questions are asked."""
    tally, told, shown = Tally(), time.monotonic(), 0
    for number in itertools.count(first):
        if sum(tally.questions.values()) >= questions:
            return tally
        Model(seed, number, tally).run(steps)
        for line in tally.differing[shown:]:
            say(line)
        shown = len(tally.differing)
        if time.monotonic() - told > 30:
            told = time.monotonic()
            say(f"… {sum(tally.questions.values())} questions, {shown} differ")


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--questions", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--world", type=int, help="ask this World alone")
    asked = parser.parse_args(arguments)
    if asked.world is not None:
        tally = soak(asked.seed, 1, first=asked.world)
        return bool(tally.differing)
    tally = soak(asked.seed, asked.questions)
    print(tally.text())
    if empty := tally.empty_cells():
        print(f"never asked: {empty}")
    if one_sided := tally.one_sided():
        print(f"answers nearly all the same: {one_sided}")
    return bool(tally.differing or empty or one_sided or not tally.is_mostly_decided())


if __name__ == "__main__":
    sys.exit(main())
