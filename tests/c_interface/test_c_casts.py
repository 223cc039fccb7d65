"""Casts through the C interface: Python's `shape_cast`, bit by bit; what Python decides in integers is refused.

Whether Python's are right is judged in `tests/casts`.
"""

from __future__ import annotations

import functools
import math

import c_library as c
import numpy as np
import pytest
import soak_pairs

import collide
from collide.casts import convex_casts
from collide.kernels import mode
from collide.scenes.families.ingredients import direction

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid",
)


@pytest.fixture
def integers(monkeypatch) -> list[str]:
    """Names of the functions that decide in integers, as often as they are called."""
    called: list[str] = []
    for name in ("settle_exactly", "_settle_level"):
        function = getattr(convex_casts, name)
        monkeypatch.setattr(
            convex_casts, name, lambda *given, name=name, function=function: (called.append(name), function(*given))[1]
        )
    return called


@functools.cache
def drawn() -> list[tuple]:
    """(what is said of it, A, B, X_WA, X_WB, direction, limit): all kinds, most on their way to the other."""
    cases = []
    for number in range(900):
        k = soak_pairs.draw(91, number, 1e3, CONVEX)
        if isinstance(k.A, collide.Halfspace):
            continue
        random = np.random.default_rng([92, number])
        ahead = k.X_WB[:3, 3] - k.X_WA[:3, 3]
        away = float(np.linalg.norm(ahead)) or 1.0
        X_WA, d = k.X_WA.copy(), ahead / away + 0.3 * random.uniform() * direction(random)
        how = number % 4
        if how == 1:  # along an axis of A
            d = X_WA[:3, number % 3] * random.choice([-1.0, 1.0])
        elif how == 2:  # from farther off
            X_WA[:3, 3] -= away * random.uniform(0, 3) * d
        elif how == 3:
            d = direction(random)
        d = d * 10.0 ** random.uniform(-3, 3)
        limit = math.inf if random.uniform() < 0.5 else float(away * random.uniform(0, 3) / np.linalg.norm(d))
        cases.append((f"draw(91, {number})", k.A, k.B, X_WA, k.X_WB, d, limit))
    return cases


def told(casts: collide.casts.shape_cast.ShapeCasts) -> np.ndarray:
    """A row of C with what Python says."""
    row = np.zeros((), dtype=c.FIRST_CONTACT)
    for name, value in casts._asdict().items():
        row[name] = value
    return row


@pytest.mark.many(2)
@pytest.mark.parametrize("start_normals", [False, True])
def test_single_calls_have_pythons_bits(integers, start_normals):
    asker, counts = c.Asker(), {"hit": 0, "at_start": 0, "miss": 0, "refused": 0, "open": 0}
    for name, A, B, X_WA, X_WB, d, limit in drawn():
        del integers[:]
        wanted = told(collide.shape_cast(A, X_WA, d, B, X_WB, max_distance=limit, start_normals=start_normals))
        flags = c.START_NORMALS if start_normals else 0
        status, row = asker.cast(c.CShape(A), c.CShape(B), X_WA, X_WB, d, limit, flags)
        if integers:
            assert status == c.UNSUPPORTED and not row["hit"], (name, integers, status)
            counts["refused"] += 1
            continue
        assert (status, row.tobytes()) == (c.OK, wanted.tobytes()), (name, d, limit, status, row, wanted)
        counts["at_start" if row["at_start"] else "hit" if row["hit"] else "miss"] += 1
        counts["open"] += not row["certified"]
    print(counts)
    assert counts["hit"] >= 250 and counts["at_start"] >= 100 and counts["miss"] >= 100, counts
    assert counts["refused"] <= 40, counts


def test_batches_say_what_single_calls_say(integers):
    """Of each pair 20 casts at once, their poses or directions one for all in turn; what is refused harms no other."""
    asker, refused = c.Asker(), 0
    for number, (name, A, B, X_WA, X_WB, d, limit) in enumerate(drawn()[::15]):
        random, shapes = np.random.default_rng([93, number]), (c.CShape(A), c.CShape(B))
        moved = np.stack([X_WA] * 20)
        moved[:, :3, 3] += 0.1 * random.normal(size=(20, 3)) * np.linalg.norm(X_WB[:3, 3] - X_WA[:3, 3])
        asked = [(moved, X_WB, d), (X_WA, X_WB, d + 0.2 * np.linalg.norm(d) * random.normal(size=(20, 3)))][number % 2]
        wanted = collide.shape_cast(A, asked[0], asked[2], B, asked[1], max_distance=limit)
        status, rows, statuses, failed = asker.cast_batch(*shapes, *asked[:2], asked[2], limit)
        for k in range(20):
            if statuses[k] == c.OK:
                one = {field: values[k] for field, values in wanted._asdict().items()}
                assert rows[k].tobytes() == told(collide.casts.shape_cast.ShapeCasts(**one)).tobytes(), (name, k)
        wrong = np.flatnonzero(statuses != c.OK)
        assert (status, failed) == ((c.UNSUPPORTED, wrong[0]) if len(wrong) else (c.OK, 0)), name
        assert set(statuses[wrong].tolist()) <= {c.UNSUPPORTED} and len(wrong) <= len(integers), name
        refused += len(wrong)
    assert refused < 30, refused


def test_what_slides_over_a_floor_is_decided(integers):
    """Bodies over tilted floors, moved along the floor exactly, or towards it by a last digit."""
    asker, slid, refused = c.Asker(), 0, 0
    for number in range(200):
        random = np.random.default_rng([94, number])
        normal = random.integers(-3, 4, 3) + np.array((0.0, 0.0, 4.0))
        floor, X_WB = collide.Halfspace(normal, 0.0), soak_pairs.rotation(random)
        if np.count_nonzero(X_WB[:3, :3]) != 3:
            X_WB = np.eye(4)
        n_W = X_WB[:3, :3] @ normal
        X_WA = soak_pairs.rotation(random)
        X_WA[:3, 3] = n_W * random.uniform(1.0, 2.0)
        d = np.cross(n_W, random.integers(-5, 6, 3).astype(float))
        if not d.any():
            continue
        if number % 4 == 0:
            d = d - n_W * 2.0**-51 * random.integers(-1, 2)
        body = [collide.Box(0.5, 0.4, 0.3), collide.Cylinder(0.2, 0.5), collide.Sphere(0.3)][number % 3]
        del integers[:]
        wanted = told(collide.shape_cast(body, X_WA, d, floor, X_WB))
        status, row = asker.cast(c.CShape(body), c.CShape(floor), X_WA, X_WB, d)
        if integers:
            assert status == c.UNSUPPORTED, number
            refused += 1
        else:
            assert (status, row.tobytes()) == (c.OK, wanted.tobytes()), (number, row, wanted)
            slid += not row["hit"]
    assert slid >= 120 and 1 <= refused <= 40, (slid, refused)


def test_arguments_out_of_range_are_told():
    asker, box, floor = c.Asker(), c.CShape(collide.Box(1, 1, 1)), c.CShape(collide.Halfspace((0, 0, 1), 0.0))
    far, d = c.identity_at(0, 0, 5), [0, 0, -1.0]
    assert asker.cast(box, floor, far, np.eye(4), d)[1]["distance"] == 4.5
    for direction_W in ([0, 0, 0], [math.nan, 0, 1], [math.inf, 0, 0], [1e101, 0, 0], [1e-101, 0, 0], [1, 1e-200, 0]):
        with pytest.raises(collide.InvalidArgument):
            collide.shape_cast(collide.Box(1, 1, 1), far, direction_W, collide.Box(1, 1, 1), np.eye(4))
        assert asker.cast(box, box, far, np.eye(4), direction_W)[0] == c.INVALID_ARGUMENT, direction_W
    for limit in (-1.0, math.nan):
        assert asker.cast(box, box, far, np.eye(4), d, limit)[0] == c.INVALID_ARGUMENT
    with pytest.raises(collide.UnsupportedQuery):
        collide.shape_cast(collide.Halfspace((0, 0, 1), 0.0), far, d, collide.Box(1, 1, 1), np.eye(4))
    assert asker.cast(floor, box, far, np.eye(4), d)[0] == c.UNSUPPORTED
    assert asker.cast(box, box, far, np.eye(4), d, flags=c.UNSIGNED)[0] == c.INVALID_ARGUMENT
    many = np.stack([np.eye(4)] * 5)
    assert asker.cast_batch(box, box, many, many[:3], [d])[0] == c.INVALID_ARGUMENT
    for number, bad in enumerate(c.odd_poses()):
        for flags, check in ((0, True), (c.TRUST_POSES, False)):
            for poses in ((bad, far), (far, bad)):
                try:
                    wanted = c.OK, told(collide.shape_cast(
                        collide.Box(1, 1, 1), poses[0], d, collide.Box(1, 1, 1), poses[1], check_poses=check
                    )).tobytes()
                except collide.InvalidPose:
                    wanted = c.INVALID_POSE, None
                status, row = asker.cast(box, box, *poses, d, flags=flags)
                assert (status, None if status == c.INVALID_POSE else row.tobytes()) == wanted, (number, flags)
