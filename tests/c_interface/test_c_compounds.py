"""Unions of convex shapes through the C interface: booleans and rows are Python's, bit by bit, one pose or many.

Whether Python's are right is judged in `tests/narrowphase/composite`.
"""

from __future__ import annotations

import functools
import math
from concurrent.futures import ThreadPoolExecutor

import c_library as c
import numpy as np
import pytest
import soak_pairs

import collide
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = ("sphere", "box", "capsule", "hull", "swept hull", "half-space", "cylinder", "cone", "ellipsoid")


def union(random: np.random.Generator, size: float, n: int) -> collide.Compound:
    """n bounded convex shapes of a tenth to half a size, some flush with each other, within about a size."""
    items = []
    for _ in range(n):
        kind = str(random.choice([kind for kind in CONVEX if kind != "half-space"]))
        X = soak_pairs.rotation(random)
        X[:3, 3] = size * random.uniform(-1, 1, 3)
        if random.uniform() < 0.3:
            X[:3, 3] = size * np.round(4 * random.uniform(-1, 1, 3)) / 4
        items.append((soak_pairs.shape(kind, size * random.uniform(0.1, 0.5), random), X))
    return collide.Compound(items)


@functools.cache
def drawn() -> list[tuple]:
    """(name, A, B, X_WA, X_WB): a union with a union or a convex shape, near each other, either of them first."""
    cases = []
    for number in range(220):
        random = np.random.default_rng([111, number])
        size = 10.0 ** random.uniform(-2, 2)
        A = union(random, size, int(random.choice([1, 2, 3, 8, 40])))
        if number % 3:
            B = union(random, size * random.uniform(0.2, 1), int(random.choice([1, 2, 5, 20])))
        else:
            B = soak_pairs.shape(str(random.choice(CONVEX)), size, random)
        X_WA, X_WB = soak_pairs.rotation(random), soak_pairs.rotation(random)
        X_WA[:3, 3] = size * random.normal(size=3) * random.choice([0.0, 1.0, 1e3])
        X_WB[:3, 3] = X_WA[:3, 3] + size * random.normal(size=3) * random.choice([0.1, 0.4, 1.5])
        if number % 5 == 0:  # about to touch
            row = collide.distance(A, B, X_WA, X_WB, signed=False)
            X_WB[:3, 3] -= row.distance * row.normal
        cases.append((f"case {number}", *((A, B) if number % 2 else (B, A)), X_WA, X_WB))
    return cases


@functools.cache
def made() -> list[tuple]:
    return [(c.CCompound(A), c.CCompound(B)) for _, A, B, *_ in drawn()]


@functools.cache
def answers() -> list[tuple]:
    """Python's boolean, row with a depth, row without, row up to a limit, and that limit."""
    told = []
    for number, (_, A, B, X_WA, X_WB) in enumerate(drawn()):
        X, limit = (X_WA[None], X_WB), float(np.linalg.norm(X_WB[:3, 3] - X_WA[:3, 3])) * (number % 4) * 0.1
        told.append((
            collide.collide(A, B, *X), collide.distance(A, B, *X).rows, collide.distance(A, B, *X, signed=False).rows,
            collide.distance(A, B, *X, max_distance=limit).rows, limit,
        ))
    return told


def differences(_=None) -> list[str]:
    asker, wrong = c.Asker(), []
    for (name, _, _, X_WA, X_WB), pair, (hit, row, gap, near, limit) in zip(drawn(), made(), answers()):
        asked = [
            (hit, {"boolean": True}), (row, {"boolean": False}), (gap, {"boolean": False, "flags": c.UNSIGNED}),
            (near, {"boolean": False, "limit": limit}),
        ]
        for wanted, how in asked:
            status, found, _ = asker.compounds(*pair, X_WA, X_WB, **how)
            if (status, found.tobytes()) != (c.OK, wanted.tobytes()):
                wrong.append(f"{name}, {how}: status {status}, C {found}, Python {wanted}")
    return wrong


def test_single_poses_have_pythons_bits():
    wrong = differences()
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"
    hits = np.array([hit for hit, *_ in answers()])
    beyond = sum(bool(near["beyond"][0]) for *_, near, _ in answers())
    parts = sum(bool(row["part_a"][0] or row["part_b"][0]) for _, row, *_ in answers())
    assert 50 <= hits.sum() <= 170 and beyond >= 60 and parts >= 80, (hits.sum(), beyond, parts)


def test_four_threads_at_once_have_pythons_bits():
    answers(), made()
    with ThreadPoolExecutor(4) as pool:
        wrong = [what for some in pool.map(differences, range(4)) for what in some]
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"


def test_batches_have_pythons_bits():
    asker, hits = c.Asker(), 0
    for number, ((name, A, B, X_WA, X_WB), pair) in list(enumerate(zip(drawn(), made())))[::6]:
        random = np.random.default_rng([112, number])
        moved = np.stack([X_WB] * 90)
        moved[:, :3, 3] += random.normal(size=(90, 3)) * np.linalg.norm(X_WB[:3, 3] - X_WA[:3, 3])
        poses = (X_WA, moved) if number % 2 else (moved, X_WA)
        for boolean in (True, False):
            wanted = collide.collide(A, B, *poses) if boolean else collide.distance(A, B, *poses).rows
            status, found, _ = asker.compounds(*pair, *poses, boolean=boolean)
            assert (status, found.tobytes()) == (c.OK, wanted.tobytes()), (name, boolean)
            hits += int(wanted.sum()) if boolean else 0
    assert hits >= 300, hits


def test_what_python_refuses_is_refused():
    asker, box = c.Asker(), c.CShape(collide.Box(1, 1, 1))
    pair = c.CCompound(collide.Compound([(collide.Box(1, 1, 1), np.eye(4)), (collide.Sphere(1), np.eye(4))]))
    assert c.raw_compound([], np.zeros((0, 4, 4)))[0] == c.INVALID_SHAPE
    assert c.raw_compound([None], np.eye(4))[0] == c.INVALID_ARGUMENT
    for bad in c.odd_poses():
        assert c.raw_compound([box, box], np.stack([np.eye(4), bad]))[0] == c.INVALID_POSE
        with pytest.raises(collide.InvalidPose):
            collide.Compound([(collide.Sphere(1), np.eye(4)), (collide.Sphere(1), bad)])
    for number, bad in enumerate(c.odd_poses()):
        many = np.stack([np.eye(4)] * 20)
        many[13] = bad
        status, _, failed = asker.compounds(pair, pair, np.eye(4), many, boolean=True)
        assert (status, failed) == (c.INVALID_POSE, 13), number
    planes = collide.Compound([(collide.Halfspace((0, 0, 1), 0.0), np.eye(4)), (collide.Sphere(1.0), np.eye(4))])
    own = c.CCompound(planes)
    with pytest.raises(collide.UnsupportedQuery):
        collide.distance(planes, planes, np.eye(4), np.eye(4))
    assert asker.compounds(own, own, np.eye(4), np.eye(4), boolean=False)[0] == c.ENDLESS_DEPTH
    assert asker.compounds(own, own, np.eye(4), np.eye(4), boolean=True)[:2] == (c.OK, [True])
    for limit in (-1.0, math.nan):
        assert asker.compounds(pair, pair, np.eye(4), np.eye(4), boolean=False, limit=limit)[0] == c.INVALID_ARGUMENT
    assert asker.compounds(pair, pair, np.eye(4), np.eye(4), boolean=True, flags=4)[0] == c.INVALID_ARGUMENT
    assert asker.compounds(pair, pair, [np.eye(4)] * 2, [np.eye(4)] * 3, boolean=True)[0] == c.INVALID_ARGUMENT


def test_contacts_have_pythons_bits_or_are_left_to_python():
    asker, told = c.Asker(), {"contacts": 0, "none": 0, "left": 0}
    for number, ((name, A, B, X_WA, X_WB), pair) in enumerate(zip(drawn(), made())):
        random = np.random.default_rng([113, number])
        margin = float(np.linalg.norm(X_WB[:3, 3] - X_WA[:3, 3])) * float(random.choice([0.0, 1e-2, 0.3]))
        most = int(random.choice([1, 4, 8]))
        try:
            wanted = collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most).rows
        except collide.UnsupportedQuery:
            wanted = None
        status, rows, count = asker.many_contacts(*pair, X_WA, X_WB, margin, most)
        if status == c.OK:
            assert count == len(rows) and rows.tobytes() == wanted.tobytes(), (name, margin, most, rows, wanted)
            told["contacts" if count else "none"] += 1
        else:
            assert (status, count) == (c.UNSUPPORTED, 0), (name, status)
            told["left"] += 1
    assert told["contacts"] >= 50 and told["none"] >= 60 and told["left"] <= 20, told


def test_contacts_of_a_union_at_rest_and_room_for_them():
    """A table of a board and four legs on a floor of two slabs."""
    legs = [(collide.Box(0.1, 0.1, 0.8), c.identity_at(x, y, 0.4)) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    table = collide.Compound([(collide.Box(1, 1, 0.1), c.identity_at(0, 0, 0.85)), *legs])
    floor = collide.Compound([(collide.Box(2, 4, 0.2), c.identity_at(x, 0, -0.1)) for x in (-1, 1)])
    asker, pair, X = c.Asker(), (c.CCompound(table), c.CCompound(floor)), c.identity_at(0.05, 0.02, -1e-3)
    wanted = collide.contacts(table, floor, X, np.eye(4), margin=1e-3, max_contacts=4).rows
    status, rows, count = asker.many_contacts(*pair, X, np.eye(4), 1e-3, 4)
    assert (status, rows.tobytes()) == (c.OK, wanted.tobytes()) and count == 16, (status, count)
    status, some, count = asker.many_contacts(*pair, X, np.eye(4), 1e-3, 4, capacity=5)
    assert (status, count) == (c.TOO_MANY, 16) and some.tobytes() == rows[:5].tobytes()
    for margin in (-1.0, math.nan, math.inf, 1e51):
        assert asker.many_contacts(*pair, X, np.eye(4), margin, 4)[0] == c.INVALID_ARGUMENT
    assert asker.many_contacts(*pair, X, np.eye(4), 0.0, 0)[0] == c.INVALID_ARGUMENT
    for number, bad in enumerate(c.odd_poses()):
        assert asker.many_contacts(*pair, X, bad, 0.0, 4)[0] == c.INVALID_POSE, number


def test_casts_have_pythons_bits_or_are_left_to_python():
    asker, told = c.Asker(), {"hit": 0, "at start": 0, "miss": 0, "left": 0}
    for number, ((name, A, B, X_WA, X_WB), pair) in enumerate(zip(drawn(), made())):
        random = np.random.default_rng([114, number])
        ahead = X_WB[:3, 3] - X_WA[:3, 3]
        size, X = float(np.linalg.norm(ahead)), X_WA.copy()
        X[:3, 3] -= ahead * random.uniform(0, 4) * (number % 3)
        d = (ahead / size + 0.1 * random.normal(size=3)) * 10.0 ** random.uniform(-2, 2)
        limit = math.inf if number % 8 else size / float(np.linalg.norm(d))
        if isinstance(A, collide.Halfspace):
            assert asker.cast(*pair, X, X_WB, d, limit)[0] == c.UNSUPPORTED
            continue
        wanted = np.zeros((), dtype=c.FIRST_CONTACT)
        for field, value in collide.shape_cast(A, X, d, B, X_WB, max_distance=limit)._asdict().items():
            wanted[field] = value
        status, row = asker.cast(*pair, X, X_WB, d, limit)
        if status == c.OK:
            assert row.tobytes() == wanted.tobytes(), (name, limit, row, wanted)
            told["at start" if row["at_start"] else "hit" if row["hit"] else "miss"] += 1
        else:
            assert status == c.UNSUPPORTED and not row["hit"], (name, status)
            told["left"] += 1
    assert told["hit"] >= 45 and told["at start"] >= 20 and told["miss"] >= 20 and told["left"] <= 30, told


def test_rays_have_pythons_bits_or_are_left_to_python():
    asker, told = c.Asker(), {"met": 0, "missed": 0, "left": 0}
    for number, ((_, A, _, X, _), pair) in enumerate(zip(drawn(), made())):
        if not isinstance(A, collide.Compound):
            continue
        random, size = np.random.default_rng([115, number]), float(np.abs(A.poses[:, :3, 3]).max()) + 1e-2
        origins = X[:3, 3] + size * random.normal(size=(6, 3)) * random.choice([0.3, 3.0], size=(6, 1))
        middles = A.poses[random.integers(len(A.items), size=6), :3, 3] @ X[:3, :3].T + X[:3, 3]
        ways = middles + 0.1 * size * random.normal(size=(6, 3)) - origins
        limit = math.inf if number % 3 else 1.0
        _, rows, statuses, _ = asker.rays(pair[0], X, origins, ways, limit)
        hits = collide.raycast(A, X[None], origins, ways, max_distance=limit)
        for k in range(6):
            wanted = np.zeros((), dtype=c.RAY_HIT)
            for field, values in hits._asdict().items():
                if field != "starts":
                    wanted[field] = values[k]
            if statuses[k] == c.OK:
                assert rows[k].tobytes() == wanted.tobytes(), (number, k, rows[k], wanted)
                told["met" if rows[k]["hit"] else "missed"] += 1
            else:
                assert statuses[k] == c.UNSUPPORTED and not rows[k]["hit"], (number, k)
                told["left"] += 1
    assert told["met"] >= 250 and told["missed"] >= 250 and told["left"] <= 20, told
