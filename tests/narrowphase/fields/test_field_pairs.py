"""Fields beside brute force in fractions, and beside a Compound of the same items, whatever the other shape."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from field_unions import as_union, random_grid
from mesh_shapes import block_ring, box
from naive import spell
from reproduction import reproducing

import collide
from collide.narrowphase.fields import ball_walk_kernel, field_pairs

EYE = np.eye(4)
_SNIPPET = """
import collide
import numpy as np
cloud = collide.PointCloud({points}, np.array({radius}))
print(collide.distance(cloud, {shape}, np.array({X_WC}), np.array({X_WB}), signed=False))
"""
_GRID_SNIPPET = """
import collide
grid = collide.VoxelGrid({cells}, (0.125, 0.25, 0.5), {X})
print(collide.distance(grid, {shape}, {X_WC}, {X_WB}, signed=False))
"""
#: Quarter turns: matrices of zeros and ones, so that fractions follow them.
TURNS = [np.eye(3), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])]


def turned(rng) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = TURNS[rng.integers(3)]
    X[:3, 3] = rng.integers(-4, 5, 3) / 8.0
    return X


def placed(X: np.ndarray, p) -> list[Fraction]:
    return [sum(Fraction(X[i, j]) * Fraction(p[j]) for j in range(3)) + Fraction(X[i, 3]) for i in range(3)]


def seen(X: np.ndarray, p: list[Fraction]) -> list[Fraction]:
    """A place of the world in the frame of a quarter turn."""
    d = [p[i] - Fraction(X[i, 3]) for i in range(3)]
    return [sum(Fraction(X[i, j]) * d[i] for i in range(3)) for j in range(3)]


def square_from_box(p: list[Fraction], half) -> Fraction:
    return sum(max(abs(c) - Fraction(h), Fraction(0)) ** 2 for c, h in zip(p, half))


def families(rng):
    """(name, points, radius): grids on eighths, duplicates, no radius, tiny ones, far from the origin, any doubles."""
    grid = rng.integers(-6, 7, (40, 3)) / 8.0
    yield "grid", grid, 0.125
    yield "duplicates", np.repeat(grid[:8], 5, axis=0), 0.25
    yield "points", grid, 0.0
    yield "tiny", grid, 1e-9
    yield "far", grid + 2.0**20, 0.125
    yield "any", rng.normal(size=(40, 3)), 0.1
    yield "each", grid, rng.integers(0, 4, 40) / 8.0


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_balls_and_boxes_are_decided_as_fractions_decide(seed):
    """On exact multiples: flush faces, corners at the very distance of the radius, balls that touch."""
    rng, asked, hits, flush = np.random.default_rng([11, seed]), 0, 0, 0
    for _ in range(7):
        for name, points, radius in families(rng):
            cloud, X_WC, X_WB = collide.PointCloud(points, radius), turned(rng), turned(rng)
            if name == "far":
                X_WC[:3, 3] -= X_WC[:3, :3] @ np.full(3, 2.0**20)
            size = rng.integers(1, 9, 3) / 8.0
            for shape, half, r in ((collide.Box(size), size / 2.0, 0.0), (collide.Sphere(0.25), np.zeros(3), 0.25)):
                squares = [square_from_box(seen(X_WB, placed(X_WC, p)), half) for p in points]
                sums = [(Fraction(q) + Fraction(r)) ** 2 for q in cloud.radii.tolist()]
                wanted = any(square <= limit for square, limit in zip(squares, sums))
                flush += any(square == limit for square, limit in zip(squares, sums))
                with reproducing(_SNIPPET, points=points, radius=radius, shape=spell(shape), X_WC=X_WC, X_WB=X_WB):
                    assert collide.collide(cloud, shape, X_WC, X_WB) == wanted
                    assert collide.collide(shape, cloud, X_WB[None], X_WC[None]).tolist() == [wanted]
                    gap = collide.distance(cloud, shape, X_WC, X_WB, signed=False)
                    exact = max(min(float(s) ** 0.5 - q - r for s, q in zip(squares, cloud.radii.tolist())), 0.0)
                    assert gap.lower - 1e-12 <= exact <= gap.upper + 1e-12 and gap.hit == wanted
                asked, hits = asked + 1, hits + wanted
    assert hits > 0.2 * asked and flush > 0.05 * asked and asked - hits > 0.1 * asked, (asked, hits, flush)


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_cells_and_boxes_are_decided_as_fractions_decide(seed):
    """On exact multiples: flush faces, edges and corners, gaps of an eighth, balls that touch."""
    rng, asked, hits, flush = np.random.default_rng([16, seed]), 0, 0, 0
    for _ in range(40):
        cells = rng.integers(-5, 6, (int(rng.integers(1, 60)), 3))
        X_WC, X_WB, X = turned(rng), turned(rng), np.eye(4)
        X[:3, 3] = rng.integers(-4, 5, 3) / 8.0
        grid, size = collide.VoxelGrid(cells, (0.125, 0.25, 0.5), X), rng.integers(1, 9, 3) / 8.0
        for shape, half, r in ((collide.Box(size), size / 2.0, 0.0), (collide.Sphere(0.25), np.zeros(3), 0.25)):
            squares = []
            for cell in cells:
                corners = [seen(X_WB, placed(X_WC, (cell + k) * grid.cell + X[:3, 3])) for k in (0, 1)]
                gaps = (max(min(a, b) - Fraction(h), -max(a, b) - Fraction(h)) for a, b, h in zip(*corners, half))
                squares.append(sum(max(gap, Fraction(0)) ** 2 for gap in gaps))
            limit = Fraction(r) ** 2
            wanted, is_flush = min(squares) <= limit, min(squares) == limit > 0 or (r == 0.0 and min(squares) == 0)
            with reproducing(_GRID_SNIPPET, cells=cells, X=X, shape=spell(shape), X_WC=X_WC, X_WB=X_WB):
                assert collide.collide(grid, shape, X_WC, X_WB) == wanted
                assert collide.collide(shape, grid, X_WB[None], X_WC[None]).tolist() == [wanted]
                gap = collide.distance(grid, shape, X_WC, X_WB, signed=False)
                exact = max(float(min(squares)) ** 0.5 - r, 0.0)
                assert gap.lower - 1e-12 <= exact <= gap.upper + 1e-12 and gap.hit == wanted
            asked, hits, flush = asked + 1, hits + wanted, flush + is_flush
    assert hits > 0.2 * asked and flush > 0.05 * asked and asked - hits > 0.1 * asked, (asked, hits, flush)


def others(rng) -> list:
    pts = rng.normal(size=(20, 3))
    return [
        collide.Sphere(0.1), collide.Box((0.3, 0.2, 0.1)), collide.Capsule(0.05, 0.2), collide.ConvexHull(0.15 * pts),
        collide.Cylinder(0.1, 0.2), collide.Cone(0.1, 0.2), collide.Ellipsoid((0.2, 0.1, 0.1)),
        collide.Halfspace((0.0, 0.6, 0.8), 0.0), collide.Mesh(*box()).scaled(0.3),
        collide.Mesh(*block_ring()).scaled(0.2),
        collide.Compound([(collide.Box((0.1, 0.1, 0.1)), collide.pose((0.1, 0, 0))), (collide.Sphere(0.1), EYE)]),
        collide.PointCloud(rng.normal(size=(30, 3)) * 0.2, 0.02),
        collide.HPolytope(np.vstack([np.eye(3), -np.eye(3)])[:5], np.full(5, 0.1), bounded=False),
        random_grid(rng, 3),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_half_spaces_meet_the_lowest_ball_however_long_their_normal(seed):
    """A normal of another length is the same plane: answers are those of the union, gaps those of a unit normal."""
    rng, hits, asked = np.random.default_rng([18, seed]), 0, 0
    for _ in range(40):
        n, r = int(rng.integers(1, 12)), rng.uniform(0, 0.5, 12)
        cloud = collide.PointCloud(rng.uniform(-1, 1, (n, 3)), r[:n])
        X_WC, X_WB = collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4)), collide.pose(rng.normal(size=3))
        normal = rng.normal(size=3)
        normal *= float(10.0 ** rng.integers(-5, 6)) / np.linalg.norm(normal)
        length, p_W = float(np.linalg.norm(normal)), cloud.points @ X_WC[:3, :3].T + X_WC[:3, 3] - X_WB[:3, 3]
        low = min(p_W @ normal / length - r[:n])
        half = collide.Halfspace(normal, (low + float(rng.uniform(-0.05, 0.05))) * length)
        with reproducing(_QUESTION, field=spell(cloud), shape=spell(half), X_WC=X_WC, X_WB=X_WB):
            hit = collide.collide(cloud, half, X_WC, X_WB)
            gap = collide.distance(cloud, half, X_WC, X_WB)
            assert hit == gap.hit == collide.collide(as_union(cloud), half, X_WC, X_WB)
            wanted = low - half.offset / length
            assert abs(gap.distance - wanted) < 1e-9 and gap.certified, (gap, wanted)
            cast = collide.shape_cast(cloud, X_WC, normal * (-3.0 / length), half, X_WB)
            assert hit or abs(3.0 * cast.distance - wanted) < 1e-9, (cast, wanted)
        asked, hits = asked + 1, hits + hit
    assert 0.2 * asked < hits < 0.8 * asked, (hits, asked)


_QUESTION = "import collide\nprint(collide.distance({field}, {shape}, {X_WC}, {X_WB}, signed=False))"


def random_field(rng, case: int) -> collide.Shape:
    if case % 2:
        return random_grid(rng)
    points = rng.uniform(-1, 1, (int(rng.integers(1, 50)), 3))
    return collide.PointCloud(points, rng.uniform(0, 0.1, len(points)) if case % 4 else float(rng.choice([0.0, 0.1])))


@pytest.mark.many(4)
@pytest.mark.parametrize("seed", range(8))
def test_all_questions_are_those_of_the_union_of_the_items(seed):
    rng, asked, hits = np.random.default_rng([12, seed]), 0, 0
    for case in range(28):
        B, field = others(rng)[case // 2 % 14], random_field(rng, case)
        pair = field, B, as_union(field), as_union(B) if B.is_field else B
        X = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
        Y = X @ collide.pose(rng.uniform(-0.8, 0.8, 3), rpy=rng.uniform(-3, 3, 3))
        for C, D, U, V, X_C, X_D in ((*pair, X, Y), (pair[1], pair[0], pair[3], pair[2], Y, X)):
            with reproducing(_QUESTION, field=spell(pair[2]), shape=spell(pair[3]), X_WC=X, X_WB=Y):
                mine, theirs = (collide.distance(*S, X_C, X_D, signed=False) for S in ((C, D), (U, V)))
                assert mine.hit == theirs.hit and mine.distance == pytest.approx(theirs.distance, abs=1e-12)
                assert mine.lower <= theirs.upper and theirs.lower <= mine.upper
                assert collide.collide(C, D, X_C, X_D) == mine.hit
                within = collide.collide(C, D, X_C, X_D, security_margin=0.05)
                assert within == collide.collide(U, V, X_C, X_D, security_margin=0.05)
                batch = collide.distance(C, D, X_C[None], X_D[None], signed=False)
                assert batch.distance[0] == mine.distance and batch.lower[0] == mine.lower
                deep, other = (collide.distance(*S, X_C, X_D) for S in ((C, D), (U, V)))
                assert deep.hit == other.hit and (deep.hit or deep.distance == mine.distance)
                assert not deep.hit or deep.lower <= deep.distance <= deep.upper
            asked, hits = asked + 1, hits + bool(mine.hit)
    assert hits > 0.1 * asked and hits < 0.9 * asked, (asked, hits)


def test_a_depth_takes_the_bodies_apart():
    rng, hits = np.random.default_rng(13), 0
    for case in range(100):
        cloud = collide.PointCloud(rng.uniform(-0.5, 0.5, (60, 3)), 0.05) if case % 2 else random_grid(rng)
        B = others(rng)[case // 2 % 7]
        X_WB = collide.pose(rng.uniform(-0.4, 0.4, 3), rpy=rng.uniform(-3, 3, 3))
        r = collide.distance(cloud, B, EYE, X_WB)
        if r.hit:
            hits += 1
            moved = X_WB.copy()
            moved[:3, 3] -= r.normal * float(r.distance)
            assert collide.distance(cloud, B, EYE, moved).upper >= -1e-9, case
    assert hits > 30


def test_limits_lists_sets_and_worlds_ask_the_same():
    rng = np.random.default_rng(14)
    cloud, shapes = collide.PointCloud(rng.uniform(-1, 1, (500, 3)), 0.02), others(rng)[:7]
    Y = np.array([collide.pose(rng.uniform(-2, 2, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(35)])
    asked = [shapes[k % 7] for k in range(35)]
    single = [collide.distance(cloud, B, EYE, X, signed=False) for B, X in zip(asked, Y)]
    rows = collide.distance([cloud] * 35, asked, EYE, Y, signed=False)
    assert rows.distance.tolist() == [float(r.distance) for r in single]
    near = collide.distance(cloud, shapes[1], EYE, Y, max_distance=0.1, signed=False)
    assert near.beyond.any() and not near.beyond.all() and (near.lower[near.beyond] > 0.1).all()
    picked = collide.ShapeSet([cloud, *shapes])
    by_set = collide.collide(picked[np.zeros(35, dtype=int)], picked[1 + np.arange(35) % 7], EYE, Y)
    assert by_set.tolist() == [bool(r.hit) for r in single]
    world = collide.World()
    world.add(cloud, EYE)
    for B, X in zip(asked, Y):
        world.add(B, X)
    hit = {(int(r["a"]), int(r["b"])) for r in world.collisions().rows}
    assert {b for a, b in hit if a == 0} == {k + 1 for k, r in enumerate(single) if r.hit}
    assert world.collides() == bool(hit)


def test_what_the_walk_leaves_open_is_decided_by_the_union(monkeypatch):
    """Kernels that decide nothing: the same booleans."""
    rng = np.random.default_rng(15)
    cloud = collide.PointCloud(rng.uniform(-1, 1, (200, 3)), 0.05)
    Y = np.array([collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(40)])
    for B in (collide.Sphere(0.1), collide.Box((0.2, 0.3, 0.1))):
        wanted = collide.collide(cloud, B, EYE, Y)
        assert wanted.any() and not wanted.all()
        with monkeypatch.context() as patch:
            patch.setattr(field_pairs, "walks", lambda shape: False)
            patch.setattr(field_pairs, "are_balls", lambda A, B: False)
            assert np.array_equal(collide.collide(cloud, B, EYE, Y), wanted)
    states = np.full(40, ball_walk_kernel.OPEN, dtype=np.uint8)
    monkeypatch.setattr(field_pairs, "clouds_meet_balls", lambda *args: _write(args[-2], states) or 40)
    ball = collide.Sphere(0.1)
    assert np.array_equal(collide.collide(cloud, ball, EYE, Y), collide.collide(as_union(cloud), ball, EYE, Y))


def _write(address: int, states: np.ndarray) -> None:
    import ctypes

    ctypes.memmove(address, states.ctypes.data, len(states))


def test_matrices_that_are_no_poses_are_refused_by_number():
    cloud, Y = collide.PointCloud([(0, 0, 0)], 0.1), np.repeat(EYE[None], 5, axis=0)
    Y[3, 0, 0] = 2.0
    for B in (collide.Sphere(0.1), collide.Box((1, 1, 1))):
        with pytest.raises(collide.InvalidPose, match=r"X_WB\[3\]"):
            collide.collide(cloud, B, EYE, Y)


@pytest.mark.slow
def test_depths_among_very_many_balls_are_ways_out():
    """Boxes and balls deep in thousands of points: what is told parts them, and no ball alone is deeper."""
    rng, hits = np.random.default_rng(17), 0
    cloud = collide.PointCloud(rng.uniform(-1, 1, (6000, 3)), 0.01)
    for case in range(8):
        B = (collide.Box((0.5, 0.4, 0.3)), collide.Sphere(0.2))[case % 2]
        X = collide.pose(rng.uniform(-0.7, 0.7, 3), rpy=rng.uniform(-3, 3, 3))
        row = collide.distance(cloud, B, EYE, X)
        assert row.hit and row.lower <= row.distance <= row.upper < 0.0
        moved = X.copy()
        moved[:3, 3] += row.normal * (-float(row.distance) * (1 + 1e-9) + 1e-9)
        assert not collide.collide(cloud, B, EYE, moved), case
        near = cloud.within(X[:3, 3], 0.1)
        ball = collide.Sphere(0.01)
        single = [float(collide.distance(ball, B, collide.pose(cloud.points[k]), X).distance) for k in near]
        assert row.distance <= min(single) + 1e-12
        hits += 1
    assert hits == 8


def diagonal() -> np.ndarray:
    """The z axis along (1, 1, 1): a rod whose box holds far more than the rod."""
    u = np.ones(3) / 3.0**0.5
    x = np.cross(u, [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3] = np.column_stack([x, np.cross(u, x), u])
    return X


def test_the_one_ball_that_is_met_has_its_say_among_thousands():
    """A rod through one ball, 1,500 more within its box: a subset of them without that ball is apart."""
    rng, X = np.random.default_rng(18), diagonal()
    for place in range(5):
        others_near = np.array([-0.4, 0.4, 0.0]) + rng.uniform(-0.05, 0.05, (1500, 3))
        points = np.insert(others_near, place, [0.0, 0.0, 0.0], axis=0)
        row = collide.distance(collide.PointCloud(points, 0.005), collide.Box((0.02, 0.02, 1.8)), EYE, X)
        assert row.hit and row.distance == pytest.approx(-0.015, abs=1e-9), place
    occupied = rng.random((60, 60, 60)) < 0.03
    middles = (np.indices((60, 60, 60)).reshape(3, -1).T + 0.5) * 0.02 - 0.61
    along = middles @ X[:3, 2]
    occupied.reshape(-1)[np.linalg.norm(middles - along[:, None] * X[:3, 2], axis=1) < 0.2] = False
    occupied[30, 30, 30] = True
    grid = collide.VoxelGrid(occupied, 0.02, collide.pose((-0.61, -0.61, -0.61)))
    row = collide.distance(grid, collide.Box((0.02, 0.02, 1.7)), EYE, X)
    assert row.hit and -0.1 < row.distance < 0.0


def test_what_is_asked_together_has_no_say():
    """A part's pose far away in the same batch: the same bits."""
    X = diagonal()
    union = collide.Compound([(collide.Box((0.1, 0.1, 0.1)), X), (collide.Sphere(0.1), collide.pose((1, 0, 0)))])
    A, B = X.copy(), X.copy()
    A[:3, 3], B[:3, 3] = (3.0, 0.0, 0.2), (1e5, 0.0, 0.0)
    turned_grid = collide.VoxelGrid([(0, 0, 0)], 0.1, collide.pose((0, 0, 0), rpy=(1, 2, 3)))
    for field in (collide.PointCloud([[0, 0, 0]], 0.1), turned_grid):
        alone = collide.distance(field, union, EYE, A)
        together = collide.distance(field, union, EYE, np.array([A, B]))[0]
        assert (alone.lower, alone.distance, alone.upper) == (together.lower, together.distance, together.upper)
