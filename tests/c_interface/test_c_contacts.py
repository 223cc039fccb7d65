"""Contacts through the C interface: rows are Python's, bit by bit, one pair or many, in one thread and in four.

Whether Python's are right is judged in `tests/contact`; faces that C makes of hulls are compared array by array.
"""

from __future__ import annotations

import ctypes
import functools
import math
from concurrent.futures import ThreadPoolExecutor

import c_library as c
import hull_families
import numpy as np
import pytest
import soak_pairs

import collide
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.kernels import mode
from collide.lowering.hull_faces import FACE_INTS, HullFaces, faces_of
from collide.lowering.parts import convex_set_of

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid",
)
#: Where `struct collide_shape` keeps its faces: after eight integers, seven doubles, a digest and three addresses.
_FACES_AT = 8 * (1 + 8 + 7 + 2 + 3)


def rotated(random: np.random.Generator) -> np.ndarray:
    return soak_pairs.rotation(random)


@functools.cache
def drawn() -> list[tuple]:
    """(what is said of it, A, B, X_WA, X_WB, margin, max_contacts): all kinds, and bodies that rest on each other."""
    random = np.random.default_rng(81)
    cases = []
    for number in range(700):
        k = soak_pairs.draw(82, number, 1e4, CONVEX)
        margin = float(random.choice([0.0, 1e-3, 0.1, 10.0]))
        cases.append((f"draw(82, {number})", k.A, k.B, k.X_WA, k.X_WB, margin, int(random.choice([1, 2, 4, 8, 99]))))
    table = collide.Box(2.0, 2.0, 0.2)
    for number in range(300):
        body = (
            collide.Box(0.2, 0.3, 0.4), collide.Cylinder(0.2, 0.4), collide.Capsule(0.1, 0.4), prism(number % 9 + 3),
            collide.ConvexHull(random.normal(size=(30, 3)) * 0.1),
        )[number % 5]
        X_WB = c.identity_at(*random.normal(size=2) * 0.3, 0.3 + 1e-3 * random.normal())
        X_WA = np.eye(4)
        if number % 3 == 0:
            X_WA = rotated(random)
            X_WB = X_WA @ X_WB
        cases.append((f"at rest {number}", table, body, X_WA, X_WB, 2e-2, int(random.choice([4, 8, 99]))))
    return cases


def prism(n: int) -> collide.ConvexHull:
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([0.2 * np.cos(angle), 0.2 * np.sin(angle)], axis=1)
    return collide.ConvexHull(np.concatenate([np.c_[ring, np.full(n, -0.2)], np.c_[ring, np.full(n, 0.2)]]))


@functools.cache
def made() -> list[tuple]:
    return [(c.CShape(A), c.CShape(B)) for _, A, B, *_ in drawn()]


@functools.cache
def answers() -> list:
    """Python's rows; None of half-spaces that overlap without end."""
    told = []
    for _, A, B, X_WA, X_WB, margin, most in drawn():
        try:
            told.append(collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most).rows)
        except collide.UnsupportedQuery:
            told.append(None)
    return told


def differences(_=None) -> list[str]:
    asker, wrong = c.Asker(), []
    for (name, _, _, X_WA, X_WB, margin, most), (A, B), wanted in zip(drawn(), made(), answers()):
        status, rows = asker.contacts(A, B, X_WA, X_WB, margin, most)
        if wanted is None:
            wrong += [] if status == c.ENDLESS_DEPTH and len(rows) == 0 else [f"{name}: endless, status {status}"]
        elif status != c.OK or rows.tobytes() != wanted.tobytes():
            wrong.append(f"{name}: margin={margin}, max_contacts={most}: status {status}, C {rows}, Python {wanted}")
    return wrong


def test_single_calls_have_pythons_bits():
    wrong = differences()
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"
    counts = [len(rows) for rows in answers() if rows is not None]
    assert sum(n > 3 for n in counts) >= 100 and sum(n == 0 for n in counts) >= 70, "few manifolds, or few gaps"
    assert sum(rows is None for rows in answers()) >= 2


def test_four_threads_at_once_have_pythons_bits():
    """Shapes that are new to all of them: faces are made while others make them."""
    made.cache_clear()
    made(), answers()
    with ThreadPoolExecutor(4) as pool:
        wrong = [what for one in pool.map(differences, range(4)) for what in one]
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"


def test_sets_and_room_have_pythons_bits():
    """All pairs of a margin as one batch of a set, with little room, so that it is asked for again and again."""
    some = [k for k, rows in enumerate(answers()) if rows is not None and drawn()[k][5] == 0.1]
    shapes = c.CSet([shape for k in some for shape in made()[k]])
    which = np.arange(2 * len(some)).reshape(-1, 2)
    X_WA, X_WB = (np.stack([drawn()[k][at] for k in some]) for at in (3, 4))
    A, B = ([drawn()[k][at] for k in some] for at in (1, 2))
    wanted = collide.contacts(A, B, X_WA, X_WB, margin=0.1, max_contacts=5)
    asker, first, calls, found = c.Asker(), 0, 0, []
    while first < len(some):
        status, rows, starts, failed = asker.contact_batch(
            (shapes, which[first:]), X_WA[first:], X_WB[first:], 0.1, 5, capacity=40
        )
        assert status in (c.OK, c.TOO_MANY)
        done = failed if status == c.TOO_MANY else len(some) - first
        assert done > 0, "a pair alone has more rows than 40"
        found += [rows[starts[k] : starts[k + 1]] for k in range(done)]
        first, calls = first + done, calls + 1
    for k, (rows, name) in enumerate(zip(found, (drawn()[k][0] for k in some))):
        assert rows.tobytes() == wanted[k].rows.tobytes(), name
    assert calls > 3 and len(wanted.rows) > 100, (calls, len(wanted.rows))


@pytest.mark.parametrize("still", ["A", "B", "neither"])
def test_batches_of_a_pair_have_pythons_bits(still):
    random = np.random.default_rng(83)
    asker, n_rows = c.Asker(), 0
    for k in random.choice(len(drawn()), 60, replace=False).tolist():
        name, A, B, X_WA, X_WB, margin, most = drawn()[k]
        if answers()[k] is None:
            continue
        moved = np.stack([X_WB] * 50)
        steps = random.normal(size=50) * 10.0 ** random.uniform(-9, 0, 50)
        moved[:, int(random.integers(3)), 3] += steps
        poses = {"A": (X_WA, moved), "B": (moved, X_WA), "neither": (np.stack([X_WA] * 50), moved)}[still]
        status, rows, starts, _ = asker.contact_batch(made()[k], *poses, margin, most, capacity=50 * 99)
        wanted = collide.contacts(A, B, *poses, margin=margin, max_contacts=most)
        assert status == c.OK and starts.tolist() == wanted.starts.tolist(), name
        assert rows[: starts[-1]].tobytes() == wanted.rows.tobytes(), name
        n_rows += len(wanted.rows)
    assert n_rows > 500, n_rows


# --- faces ------------------------------------------------------------------------------------------------------------


def clouds() -> dict[str, np.ndarray]:
    """Points whose hulls have faces of many triangles, exactly coplanar or turned and rounded, flat ones, and none."""
    random = np.random.default_rng(84)
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    angle = 2 * np.pi * np.arange(40) / 40
    disc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    found = {name: hull_families.HULLS[name]()[0] for name in hull_families.HULLS}
    found = {name: points for name, points in found.items() if len(points) <= 3000}
    found |= {
        "grid": grid, "disc": disc, "drum": np.concatenate([disc, disc + np.array([0, 0, 1])]),
        "flat grid": grid * [1, 1, 0], "segment": np.outer(np.arange(9.0) - 3.0, [1.0, 2.0, -3.0]),
        "point": np.ones((4, 3)), "alone": np.zeros((1, 3)),
        "triangle": np.eye(3), "pancake": random.normal(size=(80, 3)) * [1, 1, 1e-13],
    }
    for number in range(40):  # slivers: hulls that are lines but for rounding, and points on edges
        line = np.outer(random.uniform(-1, 1, int(random.integers(3, 9))), random.uniform(-1, 1, 3))
        found[f"line {number}"] = line + random.integers(-2, 3, line.shape) * 10.0 ** random.uniform(-18, -11)
        along = [[t, a, b] for t in random.uniform(-1, 1, 4) for a, b in ((1, 1), (-1, 1), (1, -1))]
        cube = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        found[f"points on edges {number}"] = np.concatenate([cube, along]) @ rotated(random)[:3, :3].T
    for number in range(60):
        points = np.round(random.normal(size=(int(random.integers(4, 60)), 3)) * random.choice([1.0, 2.0, 5.0]))
        found[f"rounded {number}"] = points
        found[f"rounded and turned {number}"] = points @ rotated(random)[:3, :3].T
    for name in ("grid", "drum", "disc", "flat grid"):
        found[f"{name} turned"] = found[name] @ rotated(random)[:3, :3].T
    return found


def test_faces_are_pythons():
    asker, merged, flat, ends = c.Asker(), 0, 0, 0
    ball = c.CShape(collide.Sphere(1.0))
    for name, points in clouds().items():
        shape = collide.ConvexHull(points)
        own, wanted = c.CShape(shape), faces_of(convex_set_of(shape)).arrays
        assert asker.contacts(own, ball, np.eye(4), c.identity_at(1e9, 0, 0), 0.0, 1)[0] == c.OK
        address = ctypes.c_int64.from_address(own.handle + _FACES_AT).value
        row = (ctypes.c_int64 * FACE_INTS).from_address(address)
        assert row[:3] == [len(wanted.vertex_ids), wanted.columns.shape[1], len(wanted.triangles)], name
        for at, field, array in zip(range(3, FACE_INTS), HullFaces._fields, wanted):
            assert ctypes.string_at(row[at], array.nbytes) == array.tobytes(), (name, field)
        lengths = np.diff(wanted.starts)
        merged += bool((lengths > 3).any()) and len(lengths) > 2
        flat += len(lengths) == 2
        ends += len(lengths) < 2
    assert merged >= 60 and flat >= 5 and ends >= 2, (merged, flat, ends)


# --- what is refused --------------------------------------------------------------------------------------------------


def test_arguments_out_of_range_are_told():
    asker, box = c.Asker(), c.CShape(collide.Box(1, 1, 1))
    for margin in (-1.0, math.nan, math.inf, 1e51):
        with pytest.raises(collide.InvalidArgument):
            collide.contacts(collide.Box(1, 1, 1), collide.Box(1, 1, 1), np.eye(4), np.eye(4), margin=margin)
        assert asker.contacts(box, box, np.eye(4), np.eye(4), margin, 4)[0] == c.INVALID_ARGUMENT
    assert asker.contacts(box, box, np.eye(4), np.eye(4), 0.0, 0)[0] == c.INVALID_ARGUMENT
    assert asker.contacts(box, box, np.eye(4), np.eye(4), 0.0, 4, flags=c.UNSIGNED)[0] == c.INVALID_ARGUMENT
    many = np.stack([np.eye(4)] * 5)
    assert asker.contact_batch((box, box), many, many[:3], 0.0, 4, capacity=99)[0] == c.INVALID_ARGUMENT
    shapes = c.CSet([box])
    assert asker.contact_batch((shapes, [[0, 1]]), many[:1], many[:1], 0.0, 4, capacity=99)[0] == c.INVALID_ARGUMENT
    status, _, starts, _ = asker.contact_batch((box, box), many[:0], many[:0], 0.0, 4, capacity=99)
    assert status == c.OK and starts.tolist() == [0]


def test_what_is_no_pose_is_refused_as_python_does():
    shape, asker, good, refused = collide.Box(1, 1, 1), c.Asker(), np.eye(4), 0
    own = c.CShape(shape)
    for number, bad in enumerate(c.odd_poses()):
        for flags, check in ((0, True), (c.TRUST_POSES, False)):
            for poses in ((bad, good), (good, bad)):
                try:
                    wanted = c.OK, collide.contacts(shape, shape, *poses, check_poses=check).rows.tobytes()
                except collide.InvalidPose:
                    wanted, refused = (c.INVALID_POSE, b""), refused + 1
                status, rows = asker.contacts(own, own, *poses, 0.0, 8, flags)
                assert (status, rows.tobytes()) == wanted, (number, flags)
        many = np.stack([good] * 20)
        many[13] = bad
        status, _, _, failed = asker.contact_batch((own, own), good, many, 0.0, 8, capacity=999)
        assert (status, failed) == (c.INVALID_POSE, 13), number
    assert refused >= 20, refused


def test_rows_are_laid_out_as_pythons():
    """Of a box 3 mm deep in a floor, field by field."""
    floor, box = c.CShape(collide.Halfspace((0, 0, 1), 0.0)), c.CShape(collide.Box(1, 1, 1))
    status, rows = c.Asker().contacts(floor, box, np.eye(4), c.identity_at(0.25, 0, 0.497), 0.0, 8)
    assert status == c.OK and len(rows) == 4 and rows.dtype == CONTACT_DTYPE
    assert np.abs(rows["distance"] + 0.003).max() < 1e-15 and (rows["normal"] == [0, 0, 1]).all()
    assert {(x, y) for x, y, _ in rows["point_a"].tolist()} == {(x, y) for x in (-0.25, 0.75) for y in (-0.5, 0.5)}
    assert (rows["kind"] == 1).all() and (rows["b"] == 1).all() and (rows["facet_a"] == -1).all()
