"""Worlds through the C interface: after any changes they answer as Python's do, bit by bit, in one thread and in four.

Whether Python's are right is judged in `tests/worlds` and `tests/soak`.
"""

from __future__ import annotations

import collections
import ctypes
import math
from concurrent.futures import ThreadPoolExecutor

import c_library as c
import numpy as np
import pytest
import soak_pairs
from c_world import CBody, CWorld

import collide
from collide.casts.ray_hits import WORLD_HIT_DTYPE
from collide.kernels import mode
from collide.results import PAIR_DTYPE

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid",
)


class Both:
    """A World of Python and one of C under the same random changes, asked the same questions.

    wrong : what was answered differently.   n : questions by sort.   hits, rows : pairs that hit, and pairs told of.
    """

    def __init__(self, seed: int, tally: collections.Counter, with_margins: bool = False):
        self.random, self.seed, self.step = np.random.default_rng([91, seed]), seed, 0
        self.with_margins = with_margins
        self.python, self.own = collide.World(), CWorld()
        self.ids: list[int] = []
        self.made: dict[int, tuple[collide.Shape, c.CShape]] = {}  # holds what is numbered
        self.wrong: list[str] = []
        self.tally = tally

    # --- changes --------------------------------------------------------------------------------

    def in_c(self, shape: collide.Shape) -> c.CShape:
        """The same object of the same shape, so that bodies share it."""
        if id(shape) not in self.made:
            self.made[id(shape)] = shape, c.CShape(shape)
        return self.made[id(shape)][1]

    def drawn(self, number: int) -> soak_pairs.Case:
        return soak_pairs.draw(92 + self.seed, number, 1e4, CONVEX)

    def add_pair(self) -> None:
        """Two bodies, mostly close to touching, or boxes that touch, or miss by the smallest step that a double has."""
        case = self.drawn(int(self.random.integers(1 << 30)))
        pair = (case.A, case.X_WA), (case.B, case.X_WB)
        if self.random.uniform() < 0.4:
            size = self.random.integers(1, 9, 3) * 2.0 ** self.random.integers(-3, 3)
            where = self.random.integers(-1, 2, 3) * 0.5 * (size + size[::-1])
            where[0] = 0.5 * (size[0] + size[2])
            where[0] = self.random.choice([where[0], np.nextafter(where[0], 9e9), np.nextafter(where[0], 0.0)])
            pair = (collide.Box(size), np.eye(4)), (collide.Box(size[::-1]), c.identity_at(*where))
        for shape, X in pair:
            self.add(shape, X)

    def add(self, shape: collide.Shape, X) -> None:
        static, (group, mask) = bool(self.random.uniform() < 0.1), self.random.integers(1, 8, 2).tolist()
        if self.random.uniform() < 0.6:
            group, mask = 7, 0xFFFF
        self.ids.append(self.python.add(shape, X, static=static, group=group, mask=mask))
        assert self.own.add(self.in_c(shape), X, static, group, mask) == (c.OK, self.ids[-1])

    def some(self, n: int) -> list[int]:
        return self.random.choice(self.ids, min(n, len(self.ids)), replace=False).tolist()

    def change(self) -> None:
        """One of all changes that there are."""
        kinds = ["add", "remove", "far", "near", "near", "replace", "allow", "sleep"]
        what = str(self.random.choice(kinds + ["margin", "pair margin"] * self.with_margins))
        self.tally[what] += 1
        if what == "add" or len(self.ids) < 6:
            self.add_pair()
        elif what == "remove":
            (body,) = self.some(1)
            self.ids.remove(body)
            self.python.remove(body)
            assert self.own.remove(body) == c.OK
        elif what == "replace":
            (body,) = self.some(1)
            shape = self.drawn(int(self.random.integers(1 << 30))).A
            if self.random.uniform() < 0.5:  # one that another body has
                shape = self.python.body(self.some(1)[0]).shape
            self.python.replace(body, shape)
            assert self.own.replace(body, self.in_c(shape)) == c.OK
        elif what == "allow":
            pair = self.some(2)
            self.python.allow(*pair)
            assert self.own.allow([pair]) == c.OK
        elif what == "sleep":
            asleep, bodies = bool(self.random.uniform() < 0.6), self.some(3)
            (self.python.sleep if asleep else self.python.wake)(bodies)
            assert self.own.sleep(bodies, asleep) == c.OK
        elif what == "margin":
            bodies, margin = self.some(2), float(self.random.choice([0.0, 1e-50, 1e-6, 0.1, 2.0]))
            for body in bodies:
                self.python.set_margin(body, margin)
            assert self.own.set_margins(bodies, [margin, margin]) == c.OK
        elif what == "pair margin":
            self.change_pair_margin()
        else:
            self.move(what)

    def change_pair_margin(self) -> None:
        """Of the pair of a row: its distance to the last bit, a double less or more, another one, or none any more."""
        pair, margin = self.some(2), float(self.random.choice([0.0, 0.05, 1.0]))
        rows = self.python.distances(3.0).rows
        rows = rows[rows["distance"] > 1e-12]
        if len(rows) and self.random.uniform() < 0.8:
            row = rows[int(self.random.integers(len(rows)))]
            pair, d = [int(row["a"]), int(row["b"])], float(row["distance"])
            margin = float(self.random.choice([d, d, np.nextafter(d, 0.0), np.nextafter(d, 9e9)]))
            self.tally["last digit"] += 1
        if self.random.uniform() < 0.2:
            self.python.set_margin(pair[0], None, partner=pair[1])
            assert self.own.set_pair_margins([pair], None) == c.OK
        else:
            self.python.set_margin(pair[0], margin, partner=pair[1])
            assert self.own.set_pair_margins([pair[::-1]], [margin]) == c.OK

    def move(self, how: str) -> None:
        """Some bodies: to a pose of another pair, or by a step of 1e-16 … 1."""
        bodies = self.some(int(self.random.integers(1, 5)))
        X_WBs = np.stack([self.python.body(body).X_WB for body in bodies])
        if how == "far":
            X_WBs = np.stack([self.drawn(int(self.random.integers(1 << 30))).X_WB for _ in bodies])
        X_WBs[:, :3, 3] += self.random.normal(size=(len(bodies), 3)) * 10.0 ** self.random.uniform(-16, 0)
        self.python.set_poses(bodies, X_WBs)
        assert self.own.move(bodies, X_WBs) == c.OK

    # --- questions ------------------------------------------------------------------------------

    def compare(self, what: str, wanted: np.ndarray, status: int, rows: np.ndarray) -> None:
        self.tally[what] += 1
        if status != c.OK or not are_equal(wanted, rows):
            self.wrong.append(
                f"seed {self.seed}, step {self.step}, {what}: status {status}, {self.own.question_message!r}, "
                f"C {rows}, Python {wanted}"
            )

    def ask(self) -> None:
        limit = float(self.random.choice([0.0, 1e-3, 1.0, math.inf]))
        rows = self.python.distances(limit).rows
        self.tally["rows"] += len(rows)
        self.tally["hit rows"] += int(rows["hit"].sum())
        self.tally["near touching"] += int((np.abs(rows["distance"]) < 1e-6).sum())
        self.tally["exact"] += int((rows["exact"] > 0).sum())
        self.compare("distances", rows, *self.own.distances(limit))
        self.compare("collisions", self.python.collisions().rows, *self.own.collisions())
        nearest = self.python.minimum(limit).rows
        if len(nearest) and nearest["distance"][0] == -math.inf:  # half-spaces: of several pairs Python tells any
            nearest = rows[np.argmin(rows["distance"])][None]
        self.compare("minimum", nearest, *self.own.minimum(limit))
        hitting = self.python.collisions().rows
        self.compare("hits", np.stack([hitting["a"], hitting["b"]], axis=1), *self.own.hits())
        status, hit = self.own.collides()
        self.compare("collides", np.array([self.python.collides()]), status, np.array([hit]))
        self.tally["within margins"] += int((~hitting["hit"]).sum())
        self.ask_within()
        self.ask_contacts(float(self.random.choice([0.0, 1e-3, 1.0])), int(self.random.choice([1, 4, 8, 99])))
        self.ask_from_outside(limit)

    def ask_within(self) -> None:
        """A margin at random, or the least distance, to the last bit or a double off."""
        margin, rows = 0.1, self.python.minimum().rows
        if self.with_margins and len(rows) and 1e-12 < (d := float(rows["distance"][0])) < 1e50:
            margin = float(self.random.choice([0.0, 1e-6, d, np.nextafter(d, 0.0)]))
        status, hit = self.own.within(margin)
        self.compare("within", np.array([self.python.collides(security_margin=margin)]), status, np.array([hit]))

    def ask_contacts(self, margin: float, most: int) -> None:
        try:
            rows = self.python.contacts(margin, max_contacts=most).rows
        except collide.UnsupportedQuery as error:  # two half-spaces, which both sides name
            status, _ = self.own.contacts(margin, most)
            self.compare("endless", np.array([c.ENDLESS_DEPTH]), c.OK, np.array([status]))
            told = self.own.question_message.split(":")[0].split()
            named = [f'"body {number}"' for number in told if number.isdigit()]
            assert all(name in str(error) for name in named) and len(named) == 2, self.own.question_message
            return
        self.tally["contact rows"] += len(rows)
        self.compare("contacts", rows, *self.own.contacts(margin, most))

    def ask_from_outside(self, limit: float) -> None:
        case = self.drawn(int(self.random.integers(1 << 30)))
        X_WS = self.python.body(self.some(1)[0]).X_WB if self.random.uniform() < 0.5 else case.X_WB
        rows = self.python.query(case.B, X_WS, limit).rows
        self.compare("query", rows, *self.own.query(c.CShape(case.B), X_WS, limit))
        low = self.random.normal(size=3)
        ids = np.array(self.python.boxes_near(low, low + 0.5, 0.25), dtype=np.int32)
        self.compare("boxes", ids, *self.own.boxes_near(low, low + 0.5, 0.25))
        origins, directions = self.random.normal(size=(2, 12, 3)) * [[[3.0]], [[1.0]]]
        which = [{}, {"group": 5}, {"mask": 2}, {"group": 3, "mask": 6}][int(self.random.integers(4))]
        reach = float(self.random.choice([1.0, math.inf]))
        wanted = self.python.raycast(origins, directions, max_distance=reach, **which).rows
        status, rows, statuses = self.own.raycast(origins, directions, reach, **which)
        answered = statuses == c.OK
        assert (status == c.OK) == answered.all() and (statuses[~answered] == c.UNSUPPORTED).all()
        self.tally["rays open"] += int((~answered).sum())
        self.tally["rays hit"] += int(rows["hit"].sum())
        self.compare("rays", wanted[answered], c.OK, rows[answered])
        self.ask_casts(case.B, which)
        wanted = self.python.nearest(origins, max_distance=reach, **which).rows
        self.tally["points with a body"] += int(wanted["hit"].sum())
        self.compare("nearest", wanted, *self.own.nearest(origins, reach, **which))


    def ask_casts(self, shape: collide.Shape, which: dict) -> None:
        """A shape from afar towards bodies, or past them, and from a body's pose; directions are of any length."""
        random = np.random.default_rng([63, self.seed, self.step])
        X_WS = np.stack([self.python.body(k).X_WB for k in random.choice(self.ids, 8).tolist()])
        away = random.normal(size=(8, 3)) * 10.0 ** random.uniform(-1.0, 2.5, (8, 1))
        directions = (random.normal(size=(8, 3)) * 0.2 - 1.0) * away
        X_WS[1:, :3, 3] += away[1:]
        directions *= 10.0 ** random.integers(-3, 4, (8, 1))
        reach, flags = float(random.choice([1.0, math.inf])), int(random.choice([0, c.START_NORMALS]))
        status, rows, statuses = self.own.cast(c.CShape(shape), X_WS, directions, reach, flags, **which)
        if isinstance(shape, collide.Halfspace):
            assert status == c.UNSUPPORTED and "shape is a half-space" in self.own.question_message
            return
        options = {"max_distance": reach, "start_normals": flags == c.START_NORMALS}
        wanted = self.python.shape_cast(shape, X_WS, directions, **options, **which).rows
        answered = statuses == c.OK
        assert (status == c.OK) == answered.all() and (statuses[~answered] == c.UNSUPPORTED).all()
        self.tally["casts asked"] += len(rows)
        self.tally["casts open"] += int((~answered).sum())
        self.tally["casts in motion"] += int((rows["hit"] & ~rows["at_start"]).sum())
        self.tally["casts from touching"] += int(rows["at_start"].sum())
        self.tally["casts past bodies"] += int((rows["hit"] == 0).sum())
        self.compare("casts", wanted[answered], c.OK, rows[answered])


def are_equal(wanted: np.ndarray, rows: np.ndarray) -> bool:
    """Bit by bit; of hits field by field: numpy leaves what is between their fields as it was."""
    if wanted.dtype != WORLD_HIT_DTYPE:
        return wanted.tobytes() == rows.tobytes()
    return all(wanted[name].tobytes() == rows[name].tobytes() for name in wanted.dtype.names)


def scattered(n: int, seed: int = 0) -> tuple[collide.World, CWorld, list[c.CShape]]:
    """n bodies of a few shapes, a third of which hit something."""
    random = np.random.default_rng([93, seed])
    shapes = [collide.Box(random.uniform(0.5, 1.5, 3)) for _ in range(6)]
    shapes += [collide.Sphere(0.5), collide.Cylinder(0.4, 1), collide.ConvexHull(random.normal(size=(300, 3)) * 0.4)]
    own, python, made = CWorld(), collide.World(), [c.CShape(shape) for shape in shapes]
    which, width = random.integers(0, len(shapes), n), (8.0 * n) ** (1 / 3)
    X_WBs = np.stack([collide.pose(random.uniform(0, width, 3), quat_wxyz=random.normal(size=4)) for _ in range(n)])
    python.add_many([shapes[k] for k in which], X_WBs)
    status, ids = own.add_many([(made[k], X, False, 1, 0xFFFF) for k, X in zip(which, X_WBs)])
    assert status == c.OK and ids == python.ids
    return python, own, made


# --- the same bits ----------------------------------------------------------------------------------------------------


@pytest.mark.many(8)
@pytest.mark.parametrize("first", range(0, 24, 3))
def test_random_changes_have_pythons_bits(first):
    tally, wrong = collections.Counter(), []
    for seed in range(first, first + 3):
        both = Both(seed, tally)
        for _ in range(5):
            both.add_pair()
        for both.step in range(12):
            for _ in range(int(both.random.integers(1, 4))):
                both.change()
            both.ask()
        assert len(both.own) == len(both.python) == len(both.ids)
        assert all((both.own.pose(body)[1] == both.python.body(body).X_WB).all() for body in both.ids)
        wrong += both.wrong
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"
    least = {
        "add": 4, "remove": 4, "far": 4, "near": 8, "replace": 4, "allow": 4, "sleep": 4, "near touching": 8,
        "exact": 5, "contact rows": 400, "rays hit": 80, "points with a body": 200, "casts in motion": 20,
        "casts from touching": 40, "casts past bodies": 8,
    }
    few = {what: tally[what] for what, n in least.items() if tally[what] < n}
    assert not few and 0.2 < tally["hit rows"] / tally["rows"] < 0.9, (few, tally)
    assert tally["rays open"] < 0.05 * 12 * tally["rays"], tally
    assert tally["casts open"] < 0.02 * tally["casts asked"], tally


@pytest.mark.many(8)
@pytest.mark.parametrize("first", range(0, 24, 3))
def test_margins_of_bodies_and_pairs_have_pythons_bits(first):
    tally, wrong = collections.Counter(), []
    for seed in range(first, first + 3):
        both = Both(100 + seed, tally, with_margins=True)
        for _ in range(5):
            both.add_pair()
        for both.step in range(12):
            for _ in range(int(both.random.integers(2, 6))):
                both.change()
            both.ask()
        wrong += both.wrong
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"
    least = {"margin": 4, "pair margin": 4, "last digit": 3, "within margins": 20, "remove": 3}
    few = {what: tally[what] for what, n in least.items() if tally[what] < n}
    assert not few, (few, tally)


@pytest.mark.parametrize("with_margins", [False, True])
def test_a_world_in_motion_has_pythons_bits(with_margins):
    """So many bodies that trees are of several parts, fitted along paths and made anew; all move, or a few. With
    margins a half-space moves among them, which has no leaf in a tree."""
    python, own, _ = scattered(400)
    random = np.random.default_rng(94)
    if with_margins:
        slope = collide.Halfspace((0.1, 0, 1), -3.0)
        slope_in_c = c.CShape(slope)
        assert own.add(slope_in_c, np.eye(4))[1] == python.add(slope)
    ids = np.array(python.ids)
    X_WBs, n_hits = np.stack([python.body(k).X_WB for k in python.ids]), 0
    for step in range(24):
        if with_margins and step % 6 == 0:
            margined, margins = random.choice(ids, 9, replace=False), random.choice([0.0, 0.01, 0.3, 3.0], 9)
            for body, margin in zip(margined.tolist(), margins.tolist()):
                python.set_margin(body, margin)
            assert own.set_margins(margined, margins) == c.OK
        some = ids if step % 3 == 0 else random.choice(ids, 20, replace=False)
        if with_margins:
            some = np.union1d(some, ids[-1:])
        far = 10.0 if step % 8 == 7 else 0.02
        X_WBs[some, :3, 3] += random.normal(size=(len(some), 3)) * far
        python.set_poses(some, X_WBs[some])
        assert own.move(some, X_WBs[some]) == c.OK
        rows, contacts = python.collisions().rows, python.contacts(0.05).rows
        assert own.collisions()[1].tobytes() == rows.tobytes(), step
        assert own.contacts(0.05)[1].tobytes() == contacts.tobytes(), step
        assert own.minimum()[1].tobytes() == python.minimum().rows.tobytes(), step
        assert own.collides() == (c.OK, bool(len(rows)))
        n_hits += len(rows)
    assert n_hits > 1000, n_hits


def test_coming_and_going_has_pythons_bits():
    """Bodies added one by one and removed at random: rows of removed bodies are closed up, shapes and pairs stay."""
    python, own, _ = scattered(30)
    random, ids, n_hits = np.random.default_rng(95), python.ids, 0
    shapes = [python.body(k).shape for k in ids[:9]] + [collide.Halfspace((0, 0, 1), -1e3)]
    shapes = [(shape, c.CShape(shape)) for shape in shapes]
    for step in range(900):
        shape, in_c = shapes[-1 if step % 200 == 199 else int(random.integers(len(shapes) - 1))]
        X, static = collide.pose(random.uniform(0, 6, 3), quat_wxyz=random.normal(size=4)), bool(random.uniform() < 0.3)
        ids.append(python.add(shape, X, static=static))
        assert own.add(in_c, X, static) == (c.OK, ids[-1])
        if step % 5 == 0:
            pair = random.choice(ids, 2, replace=False).tolist()
            python.allow(*pair)
            assert own.allow([pair]) == c.OK
        while len(ids) > 40:
            body = ids.pop(int(random.integers(len(ids))))
            python.remove(body)
            assert own.remove(body) == c.OK and own.remove(body) == c.INVALID_ARGUMENT
        if step % 30 == 0:
            rows = python.distances(0.3).rows
            assert own.distances(0.3)[1].tobytes() == rows.tobytes(), step
            assert are_equal(python.nearest(np.zeros(3)).rows, own.nearest(np.zeros(3))[1]), step
            n_hits += int(rows["hit"].sum())
    assert n_hits > 300 and own.pose(ids[-1])[0] == c.OK, n_hits


def test_four_threads_at_once_have_pythons_bits():
    """A world that nobody changes, each thread with a workspace: hulls get their faces while others ask for them."""
    python, own, _ = scattered(300, seed=1)
    points = np.random.default_rng(96).uniform(0, 12, (40, 3))
    wanted = (
        python.collisions().rows, python.distances(0.2).rows, python.contacts(0.1).rows, python.minimum().rows,
        python.nearest(points).rows,
    )

    def answers(_) -> list[bool]:
        asker, equal = c.Asker(), []
        for _ in range(5):
            given = (
                own.collisions(asker), own.distances(0.2, asker), own.contacts(0.1, asker=asker),
                own.minimum(asker=asker), own.nearest(points, asker=asker),
            )
            equal += [status == c.OK and are_equal(rows, one) for rows, (status, one) in zip(wanted, given)]
        return equal

    with ThreadPoolExecutor(4) as pool:
        assert all(all(equal) for equal in pool.map(answers, range(4)))
    assert len(wanted[0]) > 50


# --- moved shapes -----------------------------------------------------------------------------------------------------


def test_casts_through_many_bodies_have_pythons_bits():
    """From anywhere in any direction among 400 bodies: rounds of candidates, limits that shrink, and ways out."""
    python, own, _held = scattered(400, seed=2)
    random, n_moved, n_open = np.random.default_rng(61), 0, 0
    few = collide.Sphere(0.01), collide.Box(0.02, 0.03, 0.04), collide.ConvexHull(random.normal(size=(40, 3)) * 0.05)
    for shape in (*few, collide.Cone(0.02, 0.05)):
        at = random.uniform(-2.0, 17.0, (500, 3))
        X_WS = np.stack([collide.pose(x, quat_wxyz=random.normal(size=4)) for x in at])
        directions = random.normal(size=(500, 3))
        wanted = python.shape_cast(shape, X_WS, directions).rows
        status, rows, statuses = own.cast(c.CShape(shape), X_WS, directions)
        answered = statuses == c.OK
        assert are_equal(wanted[answered], rows[answered]) and (status == c.OK) == answered.all(), shape
        n_moved += int((rows["hit"] & ~rows["at_start"]).sum())
        n_open += int((~answered).sum())
    assert n_moved > 500 and n_open < 40, (n_moved, n_open)


def test_of_bodies_touched_at_the_same_place_the_least_id_is_told():
    """Boxes and balls on a grid, cast along its lines: whatever is met at once, normal and point are the body's."""
    python, own, random, n_ties, n_open = collide.World(), CWorld(), np.random.default_rng(62), 0, 0
    shapes = [(shape, c.CShape(shape)) for shape in (collide.Box(1, 1, 1), collide.Sphere(0.5))]
    for k in range(60):
        X = c.identity_at(*random.integers(0, [6, 6, 2]).astype(float))
        assert own.add(shapes[k % 2][1], X) == (c.OK, python.add(shapes[k % 2][0], X))
    X_WS = np.stack([c.identity_at(*(random.integers(-2, 16, 3) * 0.5)) for _ in range(400)])
    directions = random.integers(-1, 2, (400, 3)) * [1.0, 1.0, 2.0]
    directions[(directions == 0.0).all(axis=1)] = 0.0, 1.0, 0.0
    for shape in (collide.Box(1, 1, 1), collide.Sphere(0.5), collide.Box(2.5, 1.5, 0.5)):
        wanted = python.shape_cast(shape, X_WS, directions).rows
        _, rows, statuses = own.cast(c.CShape(shape), X_WS, directions)
        for k in np.flatnonzero(statuses == c.OK):
            assert are_equal(wanted[k : k + 1], rows[k : k + 1]), (shape, k, rows[k], wanted[k])
            if rows["hit"][k]:
                met = python.body(int(rows["body"][k]))
                alone = collide.shape_cast(shape, X_WS[k], directions[k], met.shape, met.X_WB)
                same = (rows[k]["normal"] == alone.normal) & (rows[k]["point"] == alone.point)
                assert same.all(), (shape, k, rows[k], alone)
                n_ties += not rows["at_start"][k]
        n_open += int((statuses != c.OK).sum())
    assert n_ties > 80 and n_open < 120, (n_ties, n_open)


def test_casts_leave_what_comes_before_a_mesh_answered():
    """A ball before a mesh, or a cloud ahead, is met and told of; behind the mesh the cast is open."""
    python, own, ball = collide.World(), CWorld(), collide.Sphere(0.5)
    mesh = soak_pairs.shape("solid", 1.0, np.random.default_rng(98))
    cloud = collide.PointCloud([[0.0, 0, 0]], 0.1)
    held = [(mesh, c.CMesh(mesh), 0.0), (cloud, c.CField(cloud), 50.0), (ball, c.CShape(ball), -9.0)]
    for shape, in_c, x in held:
        assert own.add(in_c, c.identity_at(x, 0, 0)) == (c.OK, python.add(shape, c.identity_at(x, 0, 0)))
    X_WS = np.stack([c.identity_at(x, 0, 0) for x in (-20.0, -5.0, 30.0, 30.0)])
    directions = np.array([[2.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [0.0, 1.0, 0]])
    status, rows, statuses = own.cast(held[2][1], X_WS, directions)
    assert status == c.UNSUPPORTED and statuses.tolist() == [c.OK, c.UNSUPPORTED, c.OK, c.OK]
    assert own.question_message.startswith("collide_world_cast: cast 1 and body 0: onto a mesh: "), own.question_message
    wanted = python.shape_cast(ball, X_WS, directions).rows[[0, 2, 3]]
    assert are_equal(wanted, rows[[0, 2, 3]]) and wanted["body"].tolist() == [2, 1, -1]
    assert rows["ray"].tolist() == [0, 1, 2, 3] and not any(rows[1][name] for name in ("hit", "certified"))
    assert own.cast(held[2][1], X_WS[1], directions[1], 1.0)[0] == c.OK


# --- meshes and fields ------------------------------------------------------------------------------------------------


#: Groups and masks by which fields are tested with convex shapes alone.
_OF_CONVEX, _OF_MESHES, _OF_FIELDS = (1, 7), (4, 5), (2, 1)


def drawn_whole(random: np.random.Generator) -> tuple[collide.Shape, c.CShape | c.CMesh | c.CField, tuple[int, int]]:
    """A mesh, a field or a convex shape, the same in C, and its group and mask."""
    convex = "box", "sphere", "capsule", "hull", "swept hull", "cylinder", "ellipsoid"
    kind = str(random.choice(["cloud", "grid", "solid", "surface", *convex]))
    if kind == "cloud":
        cloud = collide.PointCloud(random.normal(size=(200, 3)), 0.05)
        return cloud, c.CField(cloud), _OF_FIELDS
    if kind == "grid":
        occupied = random.random((6, 6, 6)) < 0.3
        grid = collide.VoxelGrid(occupied, 0.2)
        return grid, c.CField(grid, occupied), _OF_FIELDS
    shape = soak_pairs.shape(kind, 0.7, random)
    return (shape, c.CMesh(shape), _OF_MESHES) if kind in soak_pairs.MESHES else (shape, c.CShape(shape), _OF_CONVEX)


def drawn_pose(random: np.random.Generator) -> np.ndarray:
    X = soak_pairs.rotation(random)
    X[:3, 3] = random.normal(size=3) * 1.6
    return X


def hitting_pairs(python: collide.World) -> list[list[int]]:
    """Those that `collide` says meet, of those that filters let through."""
    bodies, pairs = [python.body(k) for k in python.ids], []
    for i, a in enumerate(bodies):
        for b in bodies[i + 1 :]:
            if (a.group & b.mask) and (b.group & a.mask) and collide.collide(a.shape, b.shape, a.X_WB, b.X_WB):
                pairs.append([a.id, b.id])
    return pairs


@pytest.mark.many(4)
@pytest.mark.parametrize("seed", range(4))
def test_meshes_and_fields_have_pythons_answers_or_none(seed):
    tally = collections.Counter()
    for number in range(4):
        random, python, own, held = np.random.default_rng([97, seed, number]), collide.World(), CWorld(), []
        for _ in range(10):
            shape, in_c, (group, mask) = drawn_whole(random)
            X = drawn_pose(random)
            assert own.add(in_c, X, False, group, mask) == (c.OK, python.add(shape, X, group=group, mask=mask))
            held.append((in_c, (group, mask)))
        for step in range(6):
            change_wholes(random, python, own, held)
            ask_wholes(python, own, tally, (seed, number, step))
    wanted = "hits answered", "pairs", "rows", "hit", "rays hit", "rays at meshes", "minimum", "query", "nearest"
    few = [what for what in wanted if tally[what] < 4]
    assert not few and tally["hit"] < tally["hits answered"], (few, tally)


def change_wholes(random, python: collide.World, own: CWorld, held: list) -> None:
    """A body somewhere else, and another that is something else, of its group."""
    body, X = int(random.choice(python.ids)), drawn_pose(random)
    python.set_pose(body, X)
    assert own.move([body], X[None]) == c.OK
    body = int(random.choice(python.ids))
    shape, in_c, bits = drawn_whole(random)
    if bits == held[body][1]:
        python.replace(body, shape)
        assert own.replace(body, in_c) == c.OK
        held[body] = in_c, bits


def ask_wholes(python: collide.World, own: CWorld, tally: collections.Counter, name: tuple) -> None:
    wanted = hitting_pairs(python)
    status, pairs = own.hits()
    if status == c.OK:
        assert pairs.tolist() == wanted, name
        assert own.collides() == (c.OK, bool(wanted)), name
        tally["hits answered"] += 1
        tally["hit"] += bool(wanted)
        tally["pairs"] += len(wanted)
    else:
        told = own.question_message.split(":")[0].split()
        refused = [python.body(int(number)).shape for number in told if number.isdigit()]
        assert status == c.UNSUPPORTED and any(shape.is_asked_whole for shape in refused), (name, told)
    for limit in (0.0, 0.3):
        status, rows = own.distances(limit)
        assert status in (c.OK, c.UNSUPPORTED), (name, own.question_message)
        if status == c.OK:
            assert rows.tobytes() == python.distances(limit).rows.tobytes(), (name, limit)
            tally["rows"] += len(rows)
        tally["refused"] += status != c.OK
    ask_wholes_from_outside(python, own, tally, name)
    directions = np.random.default_rng(len(wanted)).normal(size=(len(python), 3))  # to the middle of every body
    origins = np.stack([python.body(k).X_WB[:3, 3] for k in python.ids]) - directions
    _, rows, statuses = own.raycast(origins, directions)
    answered = statuses == c.OK
    assert are_equal(python.raycast(origins, directions).rows[answered], rows[answered]), name
    met = rows["body"][answered & rows["hit"].astype(bool)]
    tally["rays at meshes"] += int(sum(isinstance(python.body(int(k)).shape, collide.Mesh) for k in met))
    tally["rays"] += int(answered.sum())
    tally["rays hit"] += int(rows["hit"].sum())


def ask_wholes_from_outside(python: collide.World, own: CWorld, tally: collections.Counter, name: tuple) -> None:
    """The nearest pair, shapes and points: at bodies and away from all of them."""
    ball, scales = collide.Sphere(0.2), np.array([4.0, 4.0, 3.0, 2.0, 2.0, 1.0])
    points = np.random.default_rng(name).normal(size=(6, 3)) * scales[:, None]
    asked = [("minimum", python.minimum, own.minimum())]
    for at in points:
        X = c.identity_at(*at)
        asked.append(("query", lambda X=X: python.query(ball, X, 2.0), own.query(c.CShape(ball), X, 2.0)))
        asked.append(("nearest", lambda at=at: python.nearest(at), own.nearest(at)))
    for what, wanted, (status, rows) in asked:
        assert status in (c.OK, c.UNSUPPORTED), (name, own.question_message)
        if status == c.OK:
            assert are_equal(wanted().rows, rows), (name, what, wanted().rows, rows)
            tally[what] += len(rows)


def test_contacts_on_a_terrain_have_pythons_bits():
    """Boxes, balls, capsules and hulls a little above a rough surface of triangles, or a little within it."""
    random = np.random.default_rng(99)
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0.2 * random.normal(size=81)], axis=1)
    at = np.arange(81).reshape(9, 9)
    a, b, d, e = (k.ravel() for k in (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]))
    terrain = collide.Mesh(vertices, np.concatenate([np.stack([a, b, e], 1), np.stack([a, e, d], 1)]), solid=False)
    shapes = [collide.Box(0.4, 0.3, 0.2), collide.Sphere(0.2), collide.Capsule(0.1, 0.3)]
    shapes.append(collide.ConvexHull(random.normal(size=(20, 3)) * 0.15))
    made, on_mesh, n_answered, n_rows = [c.CShape(shape) for shape in shapes], c.CMesh(terrain), 0, 0
    for number in range(12):
        python, own = collide.World(), CWorld()
        bodies = [(shapes[k % 4], made[k % 4], drawn_pose(random)) for k in range(8)]
        for k, (shape, in_c, X) in enumerate([*bodies, (terrain, on_mesh, np.eye(4))]):
            if shape is not terrain:  # down until it is a hundredth apart, or as much within
                X[:3, 3] = *random.uniform(1.0, 7.0, 2), 2.0
                gap = collide.distance(shape, terrain, X, np.eye(4)).distance
                fall = collide.shape_cast(shape, X, (0, 0, -1.0), terrain, np.eye(4)).distance
                X[2, 3] -= fall + random.choice([-0.005, 0.005])
                assert gap > 0.0
            assert own.add(in_c, X, shape is terrain) == (c.OK, python.add(shape, X, static=shape is terrain)), k
        status, rows = own.contacts(0.02)
        assert status in (c.OK, c.UNSUPPORTED), own.question_message
        if status == c.OK:
            wanted = python.contacts(0.02).rows
            assert rows.tobytes() == wanted.tobytes(), number
            n_answered, n_rows = n_answered + 1, n_rows + len(rows)
    assert n_answered >= 8 and n_rows >= 100, (n_answered, n_rows)


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_contacts_casts_and_rays_at_fields_have_pythons_bits(seed):
    """Shapes about a cloud and a grid, which are added before them or behind them."""
    tally = collections.Counter()
    for number in range(12):
        random, python, own, held = np.random.default_rng([96, seed, number]), collide.World(), CWorld(), []
        occupied = random.random((6, 6, 6)) < 0.3
        cloud, grid = collide.PointCloud(random.normal(size=(200, 3)), 0.05), collide.VoxelGrid(occupied, 0.2)
        fields = [(cloud, c.CField(cloud)), (grid, c.CField(grid, occupied))]
        kinds = random.choice(["box", "sphere", "capsule", "hull", "cylinder"], 6)
        bodies = [(one, c.CShape(one)) for one in (soak_pairs.shape(str(kind), 0.4, random) for kind in kinds)]
        poses = [drawn_pose(random), drawn_pose(random)]
        places = cloud.points, 0.2 * grid.cells + 0.1
        items = [X[:3, :3] @ p + X[:3, 3] for X, of_field in zip(poses, places) for p in of_field]
        for shape, in_c in fields + bodies if number % 2 else bodies + fields:
            X, (group, mask) = drawn_pose(random), _OF_CONVEX
            X[:3, 3] = items[random.integers(len(items))] + 0.2 * random.normal(size=3)
            if shape.is_field:
                X, (group, mask) = poses[shape is grid], _OF_FIELDS
            assert own.add(in_c, X, False, group, mask) == (c.OK, python.add(shape, X, group=group, mask=mask))
            held.append(in_c)
        status, rows = own.contacts(0.05)
        if status == c.OK:
            assert rows.tobytes() == python.contacts(0.05).rows.tobytes(), (seed, number)
            tally["contacts"] += len(rows)
        tally["contacts", status] += 1
        starts = np.stack([drawn_pose(random) for _ in range(8)])
        starts[:, :3, 3] *= 2.0
        ways = np.array(items)[random.integers(len(items), size=8)] + 0.1 * random.normal(size=3) - starts[:, :3, 3]
        asked = (
            ("cast", python.shape_cast(bodies[0][0], starts, ways), own.cast(bodies[0][1], starts, ways)),
            ("ray", python.raycast(starts[:, :3, 3], ways), own.raycast(starts[:, :3, 3], ways)),
        )
        for what, wanted, (_, rows, statuses) in asked:
            answered = statuses == c.OK
            assert are_equal(wanted.rows[answered], rows[answered]), (seed, number, what)
            is_field = np.isin(wanted.rows["body"], [k for k in python.ids if python.body(k).shape.is_field])
            tally[what, "answered"] += int((answered & is_field).sum())
            tally[what, "open"] += int((~answered).sum())
    assert tally["contacts", c.OK] >= 6 and tally["contacts"] >= 30, tally
    for what in ("cast", "ray"):
        assert tally[what, "answered"] >= 20 and tally[what, "open"] < 0.2 * tally[what, "answered"], tally


def test_margins_beside_meshes_and_fields_have_pythons_answers_or_none():
    """Whether bodies come within their margins, and the rows of those, where nothing overlaps a mesh."""
    tally = collections.Counter()
    for number in range(40):
        random, python, own, held = np.random.default_rng([98, number]), collide.World(), CWorld(), []
        for _ in range(6):
            shape, in_c, (group, mask) = drawn_whole(random)
            X, margin = drawn_pose(random) * [[1, 1, 1, 2.0]], float(random.choice([0.0, 0.2, 1.0]))
            X[3, 3] = 1.0
            body = python.add(shape, X, group=group, mask=mask, margin=margin)
            assert own.add(in_c, X, False, group, mask) == (c.OK, body) and own.set_margins([body], [margin]) == c.OK
            held.append(in_c)
        for what, wanted, (status, rows) in (
            ("collisions", python.collisions, own.collisions()), ("contacts", python.contacts, own.contacts()),
        ):
            assert status in (c.OK, c.UNSUPPORTED), (number, own.question_message)
            if status == c.OK:
                assert rows.tobytes() == wanted().rows.tobytes(), (number, what)
                tally[what] += len(rows)
        for margin in (0.0, 0.1):
            status, hit = own.within(margin)
            assert status in (c.OK, c.UNSUPPORTED), (number, own.question_message)
            if status == c.OK:
                assert hit == python.collides(security_margin=margin), (number, margin)
                tally[hit] += 1
    assert tally[True] >= 15 and tally[False] >= 15 and min(tally["collisions"], tally["contacts"]) >= 5, tally


def test_questions_that_meshes_are_not_asked_are_refused_by_name():
    """Depths: of the nearest pair, of shapes and points from outside within a mesh; far from it they are answered."""
    mesh = soak_pairs.shape("solid", 1.0, np.random.default_rng(98))
    own, ball, in_c = CWorld(), c.CShape(collide.Sphere(0.1)), c.CMesh(mesh)
    own.add(in_c, np.eye(4))
    own.add(ball, c.identity_at(*np.asarray(mesh.vertices)[0]))
    asked = {
        "bodies 0 and 1: of a mesh and a convex shape: ": (own.minimum, own.collisions),
        "the shape and body 0: of a mesh: ": (lambda: own.query(ball, np.eye(4)),),
        "a point and body 0: of a mesh: ": (lambda: own.nearest([0, 0, 0]),),
    }
    for text, questions in asked.items():
        for question in questions:
            assert question()[0] == c.UNSUPPORTED and own.question_message.startswith(text), own.question_message
    scan, cells = c.CField(collide.PointCloud(np.eye(3) * 0.1, 0.2)), np.ones((1, 1, 2), dtype=bool)
    grid = c.CField(collide.VoxelGrid(cells, 1.0), cells)
    for part, kind in ((scan, "a point cloud and a convex shape"), (grid, "a voxel grid and a convex shape")):
        beside = CWorld()
        beside.add(part, np.eye(4))
        beside.add(ball, c.identity_at(0, 0, 1.0) if part is grid else np.eye(4))
        assert beside.collisions()[0] == c.UNSUPPORTED and f"of {kind}: " in beside.question_message
    python = collide.World()
    python.add(mesh)
    python.add(collide.Sphere(0.1), c.identity_at(*np.asarray(mesh.vertices)[0]))
    rows = python.contacts(0.01).rows
    assert own.contacts(0.01)[1].tobytes() == rows.tobytes() and len(rows) > 0
    assert own.hits()[1].tolist() == [[0, 1]] and own.collides() == (c.OK, True)
    assert own.move([1], c.identity_at(50.0, 0, 0)[None]) == c.OK
    assert own.contacts(1.0)[0] == own.collisions()[0] == own.query(ball, c.identity_at(9.0, 0, 0))[0] == c.OK
    assert own.nearest([50.0, 0, 0])[1]["body"].tolist() == [1] and own.collides() == (c.OK, False)
    assert own.replace(1, in_c) == c.OK and own.replace(0, ball) == c.OK and own.remove(1) == c.OK and len(own) == 1


def test_rays_along_faces_are_left_open_and_never_guessed():
    """On the brink of boxes, where Python answers in integers: what C answers is the same, and some are left open."""
    python, own = collide.World(), CWorld()
    box, n_open, n_hit = collide.Box(1, 1, 1), 0, 0
    in_c = c.CShape(box)
    for k in range(5):
        python.add(box, c.identity_at(2.0 * k, 0, 0))
        own.add(in_c, c.identity_at(2.0 * k, 0, 0))
    origins = np.array([[-3.0, y, z] for y in (-0.5, 0.0, 0.5) for z in (-0.5, 0.25, 0.5, np.nextafter(0.5, 1.0))])
    for direction in ((1.0, 0, 0), (1.0, 1e-17, 0)):
        wanted = python.raycast(origins, np.array(direction)).rows
        status, rows, statuses = own.raycast(origins, np.tile(direction, (len(origins), 1)))
        for k, one in enumerate(statuses.tolist()):
            if one == c.OK:
                assert are_equal(wanted[k : k + 1], rows[k : k + 1]), (k, wanted[k], rows[k])
                n_hit += int(rows["hit"][k])
            else:
                assert one == status == c.UNSUPPORTED and not rows["hit"][k] and rows["certified"][k] == 0
                n_open += 1
    assert n_open >= 4 and n_hit >= 2 and "ray 0 touches" in own.question_message, (n_open, n_hit)


# --- room, and what is refused ----------------------------------------------------------------------------------------


def test_rows_beyond_the_room_are_counted():
    python, own, _ = scattered(60, seed=2)
    for what, wanted in (
        ("collisions", python.collisions().rows), ("distances", python.distances().rows),
        ("contacts", python.contacts().rows), ("boxes", np.array(python.ids, dtype=np.int32)),
        ("hits", np.stack([python.collisions().rows[name] for name in ("a", "b")], axis=1)),
    ):
        ask = {
            "collisions": own.collisions, "distances": own.distances, "contacts": own.contacts, "hits": own.hits,
            "boxes": lambda capacity: own.boxes_near([-math.inf] * 3, [math.inf] * 3, capacity=capacity),
        }[what]
        n = len(wanted)
        for capacity in (0, 1, n - 1, n, n + 5):
            status, rows = ask(capacity=capacity)
            assert status == (c.OK if capacity >= n else c.TOO_MANY), (what, capacity)
            assert rows.tobytes() == wanted[:capacity].tobytes(), (what, capacity)
            assert capacity >= n or own.question_message == f"there are {n}, and room for {capacity}", what
        assert n > 20, what


def test_an_empty_world_is_met_by_nothing():
    own = CWorld()
    assert own.collides() == (c.OK, False) and len(own) == 0
    for status, rows in (own.collisions(), own.distances(), own.minimum(), own.contacts(1.0)):
        assert status == c.OK and len(rows) == 0
    assert own.boxes_near([-1.0] * 3, [1.0] * 3)[1].tolist() == []
    wanted = collide.World().nearest((0, 0, 0)).rows
    assert are_equal(wanted, own.nearest((0, 0, 0))[1]) and are_equal(wanted, own.raycast((0, 0, 0), (1.0, 0, 0))[1])
    assert own.add_many([]) == (c.OK, []) and own.move([], np.zeros((0, 4, 4))) == c.OK


def test_refused_changes_name_what_is_to_blame_and_change_nothing():
    own, ball, good = CWorld(), c.CShape(collide.Sphere(1.0)), np.eye(4)
    assert [own.add(ball, c.identity_at(k, 0, 0))[1] for k in range(4)] == [0, 1, 2, 3]
    assert own.remove(2) == c.OK and own.message == ""
    before = own.collisions()[1].tobytes()
    bad = np.stack([good, np.diag([2.0, 1, 1, 1])])
    other, empty = CBody(0, ball.handle), CBody(ctypes.sizeof(CBody))
    ids = np.zeros(2, dtype=np.int32)
    add = c.library().collide_world_add
    for status, wanted, text in (
        (
            lambda: own.add_many([(ball, good, False, 1, 1), (ball, bad[1], False, 1, 1)])[0], c.INVALID_POSE,
            "collide_world_add: bodies[1]: X_WB is no pose",
        ),
        (lambda: add(own.handle, ctypes.byref(other), 1, ids.ctypes.data), c.INVALID_ARGUMENT, "bodies[0]: size is 0"),
        (lambda: add(own.handle, ctypes.byref(empty), 1, ids.ctypes.data), c.INVALID_ARGUMENT, "one of shape, mesh"),
        (lambda: add(own.handle, None, 1, ids.ctypes.data), c.INVALID_ARGUMENT, "bodies is NULL"),
        (lambda: own.remove(2), c.INVALID_ARGUMENT, "no body has id 2; it may have been removed"),
        (lambda: own.move([0, 2], np.stack([good, good])), c.INVALID_ARGUMENT, "ids[1]: no body has id 2"),
        (lambda: own.move([0, 3], bad), c.INVALID_POSE, "collide_world_move: X_WBs[1], of body 3, is no pose"),
        (lambda: own.replace(77, ball), c.INVALID_ARGUMENT, "no body has id 77"),
        (lambda: own.sleep([0, -1], True), c.INVALID_ARGUMENT, "ids[1]: no body has id -1"),
        (lambda: own.allow([[0, 1], [3, 3]]), c.INVALID_ARGUMENT, "pair 1 is body 3 twice"),
        (lambda: own.allow([[0, 2]]), c.INVALID_ARGUMENT, "pairs[1]: no body has id 2"),
        (lambda: own.set_margins([0, 2], [1.0, 1.0]), c.INVALID_ARGUMENT, "ids[1]: no body has id 2"),
        (lambda: own.set_margins([0, 1], [1.0, -1.0]), c.INVALID_ARGUMENT, "margins[1] is -1; it must be 0 or within"),
        (lambda: own.set_pair_margins([[0, 1], [1, 1]], None), c.INVALID_ARGUMENT, "pair 1 is body 1 twice"),
        (lambda: own.set_pair_margins([[0, 1]], [math.nan]), c.INVALID_ARGUMENT, "margins[0] is nan"),
    ):
        assert status() == wanted and text in own.message, (text, own.message)
    assert own.collisions()[1].tobytes() == before and len(own) == 3
    assert own.pose(2)[0] == c.INVALID_ARGUMENT


def test_refused_questions_name_what_is_to_blame():
    own, asker, count = CWorld(), c.Asker(), ctypes.c_size_t()
    ball = c.CShape(collide.Sphere(1.0))
    own.add(ball, np.eye(4))
    own.asker = asker
    zero, away = np.zeros((2, 3)), np.array([[1.0, 0, 0], [0, 0, 0]])
    ask = c.library().collide_world_collisions
    for status, wanted, text in (
        (lambda: ask(own.handle, asker.handle, None, 4, count), c.INVALID_ARGUMENT, "rows or count is NULL"),
        (lambda: ask(None, asker.handle, None, 0, count), c.INVALID_ARGUMENT, "world is NULL"),
        (lambda: own.distances(-1.0)[0], c.INVALID_ARGUMENT, "max_distance is below 0"),
        (lambda: own.distances(math.nan)[0], c.INVALID_ARGUMENT, "max_distance is below 0"),
        (lambda: own.within(1e-60)[0], c.INVALID_ARGUMENT, "collide_world_within: hit is NULL, or margin is neither 0"),
        (lambda: own.contacts(math.inf)[0], c.INVALID_ARGUMENT, "margin is outside"),
        (lambda: own.contacts(0.0, 0)[0], c.INVALID_ARGUMENT, "max_contacts is 0"),
        (lambda: own.query(ball, np.diag([1.0, 1, -1, 1]))[0], c.INVALID_POSE, "X_WS is no pose"),
        (lambda: own.raycast(zero, away)[0], c.INVALID_ARGUMENT, "directions_W[1] is 0"),
        (lambda: own.raycast([[math.nan, 0, 0]], [[1.0, 0, 0]])[0], c.INVALID_ARGUMENT, "origins_W[0]"),
        (lambda: own.raycast(zero, [[1.0, 0, 0], [math.nan, 1, 0]])[0], c.INVALID_ARGUMENT, "directions_W[1]"),
        (lambda: own.cast(ball, np.eye(4), away)[0], c.INVALID_ARGUMENT, "collide_world_cast: directions_W[1] is 0"),
        (lambda: own.cast(ball, np.eye(4), [[0, math.nan, 1.0]])[0], c.INVALID_ARGUMENT, "directions_W[0] is 0, not"),
        (lambda: own.cast(ball, np.diag([1.0, 2, 1, 1]), away[0])[0], c.INVALID_POSE, "X_WS[0] is no pose"),
        (lambda: own.cast(ball, np.tile(np.eye(4), (3, 1, 1)), away)[0], c.INVALID_ARGUMENT, "counts are neither n"),
        (lambda: own.cast(ball, np.eye(4), away[0], -1.0)[0], c.INVALID_ARGUMENT, "max_distance is below 0"),
        (lambda: own.cast(ball, np.eye(4), away[0], flags=8)[0], c.INVALID_ARGUMENT, "a flag is none of casts"),
        (lambda: own.nearest([[0, 0, 0], [1e51, 0, 0]])[0], c.INVALID_ARGUMENT, "points_W[1]"),
        (lambda: own.boxes_near([0, 0, 1], [0, 0, 0])[0], c.INVALID_ARGUMENT, "low <= high"),
    ):
        assert status() == wanted and text in own.question_message, (text, own.question_message)
    assert own.collides() == (c.OK, False) and own.question_message == ""
    assert ask(own.handle, None, None, 0, count) == c.INVALID_ARGUMENT


def test_pairs_too_small_to_measure_are_named():
    """Shapes and distance below 1e-50 m together: both refuse, C with the ids."""
    python, own = collide.World(), CWorld()
    points = [collide.ConvexHull([[0.0, 0, 0]]), collide.ConvexHull([[0.0, 0, 0], [1e-50, 0, 0]])]
    made = [c.CShape(shape) for shape in points]
    for k in (0, 1, 1):
        python.add(points[k])
        own.add(made[k], np.eye(4))
    try:
        wanted = python.distances().rows
    except collide.UnsupportedQuery:
        status, _ = own.distances()
        assert status == c.OUT_OF_RANGE and own.question_message.startswith("bodies "), own.question_message
    else:
        assert own.distances()[1].tobytes() == wanted.tobytes() and wanted.dtype == PAIR_DTYPE
