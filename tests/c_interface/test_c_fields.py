"""Point clouds and voxel grids of the C interface: booleans, rows and nearest points are Python's, bit by bit; what C
does not answer is said to be unsupported."""

from __future__ import annotations

import math
import threading
from collections import Counter

import c_library as c
import numpy as np
import pytest
from field_cases import EYE, cases, cloud_of, field_and_own, poses_about, shapes

import collide
from collide.kernels import mode
from collide.results import PAIR_DTYPE

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

NOTHING = bytes(PAIR_DTYPE.itemsize)
@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(910, 914))
def test_booleans_are_pythons_and_none_is_left_out(seed):
    asker, told = c.Asker(), Counter()
    for name, field, shape, F, S, X, Y in cases(seed, 400):
        wanted = collide.collide(field, shape, X, Y)
        assert asker.field_meets(F, S, X, Y) == (c.OK, wanted), name
        told[wanted] += 1
    assert told[True] > 100 and told[False] > 100, told


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(920, 924))
@pytest.mark.parametrize("flags", [c.UNSIGNED, 0])
def test_rows_are_pythons_or_left_to_python(flags, seed):
    asker, told = c.Asker(), Counter()
    for number, (name, field, shape, F, S, X, Y) in enumerate(cases(seed, 250)):
        limit = (math.inf, 0.0, 0.2)[number % 3]
        status, row = asker.field_gap(F, S, X, Y, flags, limit)
        wanted = collide.distance(field, shape, X, Y, signed=not flags, max_distance=limit).rows
        if status == c.OK:
            assert row.tobytes() == wanted.tobytes(), f"{name}: {row}, {wanted}"
        else:
            assert status == c.UNSUPPORTED and row.tobytes() == NOTHING, name
        told[bool(wanted["hit"][0]), status] += 1
    assert told[False, c.OK] > 70 and told[False, c.UNSUPPORTED] < 0.15 * told[False, c.OK], told
    answered, n_hits = 0.75 if flags else 0.1, told[True, c.OK] + told[True, c.UNSUPPORTED]
    assert told[True, c.OK] > answered * n_hits and n_hits > 100, told


def _off(random, k: int, X, Y) -> tuple[np.ndarray, np.ndarray, int]:
    """(poses, flags): rotations but for 1e-14 to 1e-5; or stretched, to be trusted."""
    X, Y = X.copy(), Y.copy()
    if k % 2:
        for Z in (X, Y):
            Z[:3, :3] += random.normal(size=(3, 3)) * 10.0 ** random.uniform(-14, -5.5)
        return X, Y, 0
    X[:3, :3] = X[:3, :3] @ np.diag(random.uniform(0.5, 2.0, 3))
    return X, Y, c.TRUST_POSES


def test_matrices_off_a_rotation_are_answered_alike():
    asker, told = c.Asker(), Counter()
    for k, (name, field, shape, F, S, X, Y) in enumerate(cases(93, 300)):
        X, Y, flags = _off(np.random.default_rng([93, k, 1]), k, X, Y)
        wanted = collide.collide(field, shape, X, Y, check_poses=not flags)
        assert asker.field_meets(F, S, X, Y, flags) == (c.OK, wanted), name
        status, row = asker.field_gap(F, S, X, Y, flags | c.UNSIGNED)
        if status == c.OK:
            rows = collide.distance(field, shape, X, Y, signed=False, check_poses=not flags).rows
            assert row.tobytes() == rows.tobytes(), name
        told[wanted, status] += 1
    assert min(told[True, c.OK], told[False, c.OK]) > 20, told


def test_batches_answer_as_single_calls_do():
    asker, told = c.Asker(), Counter()
    for number in range(26):
        random = np.random.default_rng([94, number])
        field, F = field_and_own(random, number)
        shape = shapes(random)[number % 13]
        S, (X, Y) = c.CShape(shape), np.array([poses_about(random, field) for _ in range(15)]).transpose(1, 0, 2, 3)
        X = X if number % 3 else X[:1]
        pairs = list(zip(np.broadcast_to(X, Y.shape), Y))
        status, hits, _, failed = asker.field_batch(F, S, X, Y, boolean=True)
        assert (status, failed) == (c.OK, 0)
        assert hits.tolist() == [asker.field_meets(F, S, *pair)[1] for pair in pairs]
        assert hits.tolist() == collide.collide(field, shape, X, Y).tolist()
        for flags, limit in ((0, math.inf), (c.UNSIGNED, math.inf), (c.UNSIGNED, 0.1)):
            singles = [asker.field_gap(F, S, *pair, flags, limit) for pair in pairs]
            status, rows, statuses, failed = asker.field_batch(F, S, X, Y, boolean=False, flags=flags, limit=limit)
            assert statuses.tolist() == [status for status, _ in singles]
            assert rows.tobytes() == b"".join(row.tobytes() for _, row in singles)
            first = next((k for k, said in enumerate(statuses) if said != c.OK), 0)
            assert (status, failed) == (statuses[first], first)
            wanted = collide.distance(field, shape, X, Y, signed=not flags, max_distance=limit).rows
            good = statuses == c.OK
            assert rows[good].tobytes() == wanted[good].tobytes(), (number, flags, limit)
            told.update(statuses.tolist())
    assert told[c.OK] > 700 and told[c.UNSUPPORTED] > 60, told


# --- trees and nearest points ---------------------------------------------------------------------------------------


def _words(address: int, n: int, dtype=np.int64) -> np.ndarray:
    return np.ctypeslib.as_array((np.ctypeslib.as_ctypes_type(dtype) * n).from_address(int(address))).copy()


def test_trees_are_pythons_array_by_array():
    random, depths = np.random.default_rng(95), set()
    for n in (1, 2, 6, 7, 8, 56, 57, 500, 30_000):
        for points in (random.normal(size=(n, 3)), random.integers(0, 9, (n, 3)) / 8.0, np.full((n, 3), 1e-320)):
            cloud = collide.PointCloud(points, 0.01)
            mine, tree = c.CField(cloud), cloud.tree
            header = _words(mine.handle + 8, 9)  # behind the handle's word
            assert header[4:8].tolist() == [len(tree._nodes), n, tree.depth, tree._header[7]]
            assert _words(header[0], tree._nodes.size, np.int32).tobytes() == tree._nodes.tobytes(), n
            assert _words(header[1], 3 * n, np.float64).tobytes() == points.tobytes()
            assert _words(header[2], n, np.int32).tobytes() == tree.ids.tobytes(), n
            assert _words(header[3], 7, np.float64).tobytes() == tree._numbers.tobytes(), n
            assert _words(header[8], tree._floats.size, np.int32).tobytes() == tree._floats.tobytes(), n
            depths.add(tree.depth)
    for shape in ((1, 1, 1), (4, 4, 4), (5, 1, 3), (16, 17, 3), (70, 33, 12), (257, 2, 8)):
        occupied = (random.random(shape) < 0.3) * random.integers(1, 256, shape)
        occupied[-1, 0, 0] = 255
        grid = collide.VoxelGrid(occupied > 0, (0.1, 0.2, 0.3), c.identity_at(1.0, 0.1, -0.7))
        mine, tree = c.CField(grid, occupied), grid.tree
        header = _words(mine.handle + 8, 22)
        assert header[[5, 6]].tolist() == [grid.count, tree.levels]
        assert header[13:].tolist() == tree._header[13:].tolist()
        for k, part in enumerate(tree.nodes):
            assert _words(header[10 + k], len(part)).tobytes() == part.tobytes(), shape
        assert _words(header[3], 13, np.float64).tobytes() == tree._numbers.tobytes(), shape
    assert len(depths) >= 4


def test_nearest_points_and_points_within_are_pythons():
    n_found = n_within = 0
    for number in range(60):
        random = np.random.default_rng([96, number])
        cloud = cloud_of(random) if number % 4 else collide.PointCloud(random.normal(size=(5000, 3)))
        F, places = c.CField(cloud), np.vstack([random.normal(size=(8, 3)), random.integers(-8, 9, (8, 3)) / 8.0])
        k, limit = int(random.choice([1, 2, 7, len(cloud) + 3, 600])), float(random.choice([math.inf, 0.5, 0.25, 0.0]))
        wanted = cloud.nearest(places, k, max_distance=limit)
        status, distances, rows = F.nearest(places, k, limit)
        assert status == c.OK and distances.tobytes() == wanted.distance.tobytes(), (number, k, limit)
        assert rows.tobytes() == wanted.row.tobytes(), (number, k, limit)
        n_found += np.count_nonzero(rows >= 0)
        for place in places:
            r = float(random.choice([0.0, 0.125, 0.25, 0.5, 2.0]))
            inside = cloud.within(place, r)
            status, _, count = F.within(place, r, 0)
            assert (status, count) == (c.TOO_MANY if len(inside) else c.OK, len(inside))
            status, some, count = F.within(place, r, len(inside))
            assert status == c.OK and count == len(inside) and some.tobytes() == inside.tobytes(), (number, r)
            if len(inside) > 1:
                status, some, count = F.within(place, r, len(inside) - 1)
                assert (status, count) == (c.TOO_MANY, len(inside)) and some.tobytes() == inside[:-1].tobytes()
            n_within += len(inside)
    assert n_found > 20_000 and n_within > 10_000, (n_found, n_within)


def test_four_threads_share_a_field():
    asked, wrong = list(cases(97, 200)), []
    asker = c.Asker()
    wanted = [(asker.field_meets(F, S, X, Y), asker.field_gap(F, S, X, Y)) for *_, F, S, X, Y in asked]

    def ask(first: int) -> None:
        own = c.Asker()
        for k in range(len(asked)):
            k = (k + first) % len(asked)
            *_, F, S, X, Y = asked[k]
            (status, row), ((_, hit), (other, as_alone)) = own.field_gap(F, S, X, Y), wanted[k]
            if own.field_meets(F, S, X, Y) != (c.OK, hit) or status != other or row.tobytes() != as_alone.tobytes():
                wrong.append(k)

    threads = [threading.Thread(target=ask, args=(first,)) for first in range(0, 200, 50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and sum(row["distance"][0] > 0.0 for _, (_, row) in wanted) > 50


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "radii"),
    [
        (np.zeros((0, 3)), 0.1), ([[0.0, 0.0, math.nan]], 0.1), ([[0.0, math.inf, 0.0]], 0.1),
        ([[0.0, 0.0, 1.1e50]], 0.1),
        (np.zeros((2, 3)), -0.1), (np.zeros((2, 3)), math.nan), (np.zeros((2, 3)), math.inf), (np.zeros((2, 3)), 1e-51),
        (np.zeros((2, 3)), [0.1, -0.1]), (np.zeros((2, 3)), [0.1, math.nan]), (np.zeros((2, 3)), [0.1, 1e-51]),
    ],
)
def test_what_python_takes_for_no_cloud_is_none(points, radii):
    with pytest.raises(collide.InvalidShape):
        collide.PointCloud(points, radii)
    assert c.raw_cloud(points, radii) == (c.INVALID_SHAPE, None)


@pytest.mark.parametrize(
    ("occupied", "cell", "origin"),
    [
        (np.zeros((2, 3, 4), bool), 0.1, None), (np.ones((2, 2, 2), bool), 0.0, None),
        (np.ones((2, 2, 2), bool), (0.1, -1.0, 0.1), None), (np.ones((2, 2, 2), bool), (0.1, 0.1, math.nan), None),
        (np.ones((1 << 16 | 1, 1, 1), bool), 0.1, None), (np.ones((2, 2, 2), bool), 0.6e50, None),
        (np.ones((2, 2, 2), bool), 0.1, (0.9e50, 0.0, 0.0)), (np.ones((0, 2, 2), bool), 0.1, None),
    ],
)
def test_what_python_takes_for_no_grid_is_none(occupied, cell, origin):
    with pytest.raises(collide.InvalidShape):
        collide.VoxelGrid(occupied, cell, None if origin is None else c.identity_at(*origin))
    assert c.raw_grid(occupied, cell, origin) == (c.INVALID_SHAPE, None)


def test_arguments_are_checked():
    occupied = np.ones((1, 1, 1), bool)
    cloud, grid = c.CField(collide.PointCloud(np.eye(3), 0.1)), c.CField(collide.VoxelGrid(occupied, 1.0), occupied)
    asker, ball = c.Asker(), c.CShape(collide.Sphere(0.1))
    assert c.raw_cloud(np.zeros((3, 3)), [0.1, 0.1]) == (c.INVALID_ARGUMENT, None), "radii for two of three points"
    assert c.raw_grid(np.ones((2, 2, 2)), 0.1, (math.nan, 0.0, 0.0)) == (c.INVALID_SHAPE, None)
    assert asker.field_meets(cloud, ball, EYE, EYE, 4)[0] == c.INVALID_ARGUMENT
    for limit in (-1.0, math.nan):
        assert asker.field_gap(cloud, ball, EYE, EYE, 0, limit)[0] == c.INVALID_ARGUMENT
        assert cloud.nearest(np.zeros(3), 1, limit)[0] == c.INVALID_ARGUMENT
        assert cloud.within(np.zeros(3), limit, 4)[0] == c.INVALID_ARGUMENT
    assert grid.nearest(np.zeros(3), 1)[0] == grid.within(np.zeros(3), 1.0, 4)[0] == c.INVALID_ARGUMENT
    assert cloud.nearest(np.zeros(3), 0)[0] == cloud.nearest([math.nan, 0, 0], 1)[0] == c.INVALID_ARGUMENT
    assert cloud.within(np.zeros(3), math.inf, 4)[0] == cloud.within([0, 0, 1e51], 1.0, 4)[0] == c.INVALID_ARGUMENT
    for boolean in (False, True):
        said = asker.field_batch(cloud, ball, np.repeat(EYE[None], 2, 0), np.repeat(EYE[None], 3, 0), boolean=boolean)
        assert said[0] == c.INVALID_ARGUMENT, "two poses and three"
        assert asker.field_batch(cloud, ball, EYE[None], np.zeros((0, 4, 4)), boolean=boolean)[0] == c.OK
    for bad in c.odd_poses():
        poses = np.array([EYE, EYE, bad, EYE])
        for F in (cloud, grid):
            for X, Y in ((bad, EYE), (EYE, bad)):
                assert asker.field_meets(F, ball, X, Y) == (c.INVALID_POSE, False)
                status, row = asker.field_gap(F, ball, X, Y)
                assert status == c.INVALID_POSE and row.tobytes() == NOTHING
            for boolean in (False, True):
                for X, Y in ((poses, EYE), (EYE, poses)):
                    status, *_, failed = asker.field_batch(F, ball, X, Y, boolean=boolean)
                    assert (status, failed) == (c.INVALID_POSE, 2)
    for function, arguments in (
        ("collide_point_cloud_create", (None, 1, None, 1)), ("collide_voxel_grid_create", (None, None, None, None)),
    ):
        assert c.raw_shape(function, *arguments) == (c.INVALID_ARGUMENT, None)
    assert c.library().collide_field_collide(None, None, None, None, None, 0, None) == c.INVALID_ARGUMENT
    assert c.library().collide_field_distance(None, None, None, None, None, 0.0, 0, None) == c.INVALID_ARGUMENT
    c.library().collide_field_free(None)
