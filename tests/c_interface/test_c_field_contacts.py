"""Contacts, rays and casts of point clouds and voxel grids through the C interface: Python's, bit by bit, or left to
Python.

Whether Python's are right is judged in `tests/contact` and `tests/casts`.
"""

from __future__ import annotations

import math
from collections import Counter

import c_library as c
import numpy as np
import pytest
from field_cases import EYE, cases
from test_c_casts import told as told_of_cast
from test_c_rays import told as told_of_ray

import collide
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(940, 944))
def test_contacts_are_pythons_or_left_to_python(seed):
    asker, told = c.Asker(), Counter()
    for number, (name, field, shape, F, S, X, Y) in enumerate(cases(seed, 150)):
        margin, most = (0.0, 0.01, 0.1)[number % 3], (1, 4, 8, 1 << 40)[number % 4]
        status, rows, count = asker.many_contacts(F, S, X, Y, margin, most)
        wanted = collide.contacts(field, shape, X, Y, margin=margin, max_contacts=most).rows
        if status == c.OK:
            assert rows[:count].tobytes() == wanted.tobytes(), f"{name}: {margin}, {most}: {rows[:count]}, {wanted}"
            told["rows"] += len(wanted)
            if count > 1:
                status, rows, count = asker.many_contacts(F, S, X, Y, margin, most, capacity=len(wanted) - 1)
                assert (status, count, rows.tobytes()) == (c.TOO_MANY, len(wanted), wanted[:-1].tobytes()), name
        else:
            assert (status, count) == (c.UNSUPPORTED, 0), name
        told[status == c.UNSUPPORTED, len(wanted) > 0] += 1
    assert told[False, True] > 45 and told[False, False] > 22 and told["rows"] > 220, told
    assert told[True, True] < 0.3 * told[False, True] and told[True, False] < 0.15 * told[False, False], told


def test_a_box_at_rest_on_cells_has_contacts_with_the_surface_alone():
    """Faces between cells have none, and a box that stands over four cells is told of as over one box."""
    occupied = np.ones((4, 4, 2), dtype=bool)
    grid = collide.VoxelGrid(occupied, 0.25)
    F, asker, box = c.CField(grid, occupied), c.Asker(), collide.Box(0.5, 0.5, 0.5)
    X = c.identity_at(0.5, 0.5, 0.75 + 2.0**-12)
    status, rows, count = asker.many_contacts(F, c.CShape(box), EYE, X, 0.01, 8)
    assert (status, count) == (c.OK, 4) and (rows["normal"][:4] == (0, 0, 1)).all()
    assert rows[:4].tobytes() == collide.contacts(grid, box, EYE, X, margin=0.01).rows.tobytes()
    beside = c.identity_at(0.5, 0.5, 0.25)  # within the grid, flush with cells all around
    status, rows, count = asker.many_contacts(F, c.CShape(box), EYE, beside, 0.0, 8)
    assert status == c.UNSUPPORTED or rows[:count].tobytes() == collide.contacts(grid, box, EYE, beside).rows.tobytes()


def _rays_at(random, field, number: int, X) -> tuple[np.ndarray, np.ndarray]:
    """Six rays, most towards items: from outside and inside, along axes, or on eighths, where they pass along edges."""
    is_cloud = isinstance(field, collide.PointCloud)
    items = field.points if is_cloud else (field.cells + random.random((field.count, 3))) * field.cell + field.X[:3, 3]
    items = items + 0.02 * random.normal(size=items.shape)
    origins = X[:3, 3] + 2.0 * random.normal(size=(6, 3))
    targets = items[random.integers(len(items), size=6)] @ X[:3, :3].T + X[:3, 3]
    ways = (targets - origins) * random.choice([0.1, 1.0, 3.0])
    ways[0], origins[2] = X[:3, number % 3], targets[2]
    if number % 5 == 0:
        origins, ways = np.round(8.0 * origins) / 8.0, np.round(4.0 * ways) / 4.0 + (0.0, 0.0, 0.25)
        ways[:, number % 2] *= number % 3
        ways[(ways == 0.0).all(axis=1)] = 0.5
    return origins, ways


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(950, 954))
def test_rays_are_pythons_or_left_to_python(seed):
    asker, told = c.Asker(), Counter()
    for number, (name, field, _, F, _, X, _) in enumerate(cases(seed, 120)):
        random = np.random.default_rng([seed, number, 1])
        origins, ways = _rays_at(random, field, number, X)
        limit = (math.inf, 1.0, 0.5)[number % 3]
        status, rows, statuses, failed = asker.rays(F, X, origins, ways, limit)
        hits = collide.raycast(field, X, origins, ways, max_distance=limit)
        for k in range(6):
            wanted, kind = told_of_ray(hits, k), type(field).__name__
            if statuses[k] == c.OK:
                assert rows[k].tobytes() == wanted.tobytes(), f"{name}: ray {k}: {rows[k]}, {wanted}"
            else:
                assert statuses[k] == c.UNSUPPORTED and not rows[k]["hit"], (name, k)
            told[kind, int(statuses[k]), bool(wanted["hit"])] += 1
        first = next((k for k, said in enumerate(statuses) if said != c.OK), 0)
        assert (status, failed) == (statuses[first], first), name
    for kind in ("PointCloud", "VoxelGrid"):
        answered = told[kind, c.OK, True] + told[kind, c.OK, False]
        assert told[kind, c.OK, True] > 80 and told[kind, c.OK, False] > 60, told
        assert told[kind, c.UNSUPPORTED, True] + told[kind, c.UNSUPPORTED, False] < 0.15 * answered, told


def test_faces_between_cells_are_no_surface():
    """From within a block of cells the first wall is that of the block, however many cells lie on the way."""
    occupied = np.ones((9, 8, 7), dtype=bool)
    grid, asker, n = collide.VoxelGrid(occupied, 0.3), c.Asker(), 0
    F = c.CField(grid, occupied)
    for number in range(40):
        random = np.random.default_rng([960, number])
        X = collide.pose(random.normal(size=3), quat_wxyz=random.normal(size=4))
        origin = X[:3, :3] @ random.uniform(0.2, (2.5, 2.2, 1.9)) + X[:3, 3]
        way = random.normal(size=3)
        status, rows, _, _ = asker.rays(F, X, origin, way)
        wanted = told_of_ray(collide.raycast(grid, X[None], origin, way), 0)
        assert status == c.UNSUPPORTED or rows[0].tobytes() == wanted.tobytes(), number
        n += status == c.OK
        place = X[:3, :3].T @ (rows[0]["point"] - X[:3, 3]) / (2.7, 2.4, 2.1)
        assert status != c.OK or np.minimum(np.abs(place), np.abs(place - 1.0)).min() < 1e-12, number
    assert n >= 36, n


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(970, 974))
def test_casts_are_pythons_or_left_to_python(seed):
    asker, told = c.Asker(), Counter()
    for number, (name, field, shape, F, S, X, Y) in enumerate(cases(seed, 160)):
        random, start = np.random.default_rng([seed, number, 1]), Y.copy()
        d = (random.normal(size=3), Y[:3, 3] - X[:3, 3], X[:3, number % 3])[number // 13 % 3] * 2.0 ** (number % 5 - 2)
        start[:3, 3] -= 2.0 * d
        limit = math.inf if number % 3 else 2.0
        status, row = asker.cast(S, F, start, X, d, limit)
        if isinstance(shape, collide.Halfspace):
            assert status == c.UNSUPPORTED
            continue
        wanted = told_of_cast(collide.shape_cast(shape, start, d, field, X, max_distance=limit))
        if status == c.OK:
            assert row.tobytes() == wanted.tobytes(), f"{name}: {row}, {wanted}"
        else:
            assert status == c.UNSUPPORTED and not row["hit"], name
        told[status == c.UNSUPPORTED, bool(wanted["hit"])] += 1
    assert told[False, True] > 60 and told[False, False] > 10, told
    assert told[True, True] < 0.2 * told[False, True] and told[True, False] < 0.3 * told[False, False], told


def test_arguments_are_checked():
    occupied = np.ones((1, 1, 1), bool)
    cloud, grid = c.CField(collide.PointCloud(np.eye(3), 0.1)), c.CField(collide.VoxelGrid(occupied, 1.0), occupied)
    asker, ball, d = c.Asker(), c.CShape(collide.Sphere(0.1)), (0.0, 0.0, -1.0)
    for margin, most, flags in ((-1.0, 8, 0), (math.nan, 8, 0), (math.inf, 8, 0), (0.1, 0, 0), (0.1, 8, 2)):
        assert asker.many_contacts(cloud, ball, EYE, EYE, margin, most, flags=flags)[0] == c.INVALID_ARGUMENT
    no_directions = ((0, 0, 0), 1.0, 0), ((math.nan, 0, 1), 1.0, 0)
    for direction, limit, flags in (*no_directions, (d, -1.0, 0), (d, math.nan, 0), (d, 1.0, 2)):
        assert asker.cast(ball, cloud, EYE, EYE, direction, limit, flags)[0] == c.INVALID_ARGUMENT, direction
        assert asker.rays(grid, EYE, [0.0, 0, 5], direction, limit, flags)[0] == c.INVALID_ARGUMENT, direction
    for bad in c.odd_poses():
        for F in (cloud, grid):
            for X, Y in ((bad, EYE), (EYE, bad)):
                assert asker.many_contacts(F, ball, X, Y, 0.1, 8)[::2] == (c.INVALID_POSE, 0)
                status, row = asker.cast(ball, F, X, Y, d)
                assert status == c.INVALID_POSE and not row["hit"]
            assert asker.rays(F, bad, [0.0, 0, 5], d)[0] == c.INVALID_POSE
    for name in ("collide_field_contacts", "collide_field_cast", "collide_field_raycast"):
        function = getattr(c.library(), name)
        none = [0 if kind in (c.c_double, c.c_uint, c.c_size_t) else c.Poses() if kind is c.Poses else
                c.Vectors() if kind is c.Vectors else None for kind in function.argtypes]
        assert function(*none) == c.INVALID_ARGUMENT, name
