"""Trees of clouds whose points come and go: their structure, and answers beside those of clouds made anew."""

from __future__ import annotations

import itertools
import threading
import time

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from validate_point_tree import validate_point_tree

import collide
from collide.fields import point_tree, point_tree_changes
from collide.fields.point_tree import PointTree, remaining_points
from collide.mesh.bvh import MAX_LEAF

EYE = np.eye(4)
N = 2000


def wall(rng, n: int) -> np.ndarray:
    """Points on the walls of a corner; the last is across, so that units hold a metre more."""
    points = rng.uniform(-1.0, 1.0, (n, 3))
    points[np.arange(n), rng.integers(0, 3, n)] = -1.0
    points[-1] = 1.0
    return points


def some(cloud, rng, n: int) -> np.ndarray:
    return rng.choice(len(cloud), n, replace=False)


#: (points that come, rows that go) of a cloud.
CHANGES = {
    "come and go": lambda cloud, rng: (wall(rng, 12), some(cloud, rng, 12)),
    "come": lambda cloud, rng: (0.99 * rng.uniform(-1.0, 1.0, (9, 3)), None),
    "go": lambda cloud, rng: (None, some(cloud, rng, 15)),
    "a ball moves": lambda cloud, rng: (
        rng.uniform(-0.7, 0.7, 3) + rng.normal(size=(20, 3)) * 0.03, cloud.nearest(rng.uniform(-1, 1, 3), 20).row),
    "duplicates": lambda cloud, rng: (cloud.points[np.repeat(some(cloud, rng, 2), 9)], some(cloud, rng, 18)),
    "all of a leaf": lambda cloud, rng: (None, leaf_of(cloud, rng)),
    "a row of a scan": lambda cloud, rng: (
        np.column_stack([np.linspace(-1, 1, 40), np.full((40, 2), rng.uniform(-1, 1, 2))]), some(cloud, rng, 40)),
    "those outside": lambda cloud, rng: (None, np.unique(np.abs(cloud.points).argmax(axis=0))),
    "somewhat outside": lambda cloud, rng: (rng.uniform(-1.1, 1.1, (3, 3)), some(cloud, rng, 3)),
}
#: Where a tree must be made anew.
LARGE_CHANGES = {
    "far away": lambda cloud, rng: (rng.uniform(4.0, 9.0, (1, 3)), None),
    "half": lambda cloud, rng: (None, some(cloud, rng, len(cloud) // 2)),
    "many": lambda cloud, rng: (wall(rng, len(cloud) // 8), None),
}


def leaf_of(cloud, rng) -> np.ndarray:
    """Rows of the points in a leaf, or in two."""
    leaves = validate_point_tree(cloud.tree)
    rows = [cloud.tree.ids[leaves.first[k] : leaves.first[k] + leaves.count[k]] for k in rng.integers(0, 50, 2)]
    return np.unique(np.concatenate(rows))


def with_radii(cloud, points, rng):
    return points if points is None or np.ndim(cloud.radius) == 0 else collide.PointCloud(
        points, rng.uniform(0.0, 0.03, len(points)))


def with_tree(points, radius=0.0) -> collide.PointCloud:
    cloud = collide.PointCloud(points, radius)
    assert cloud.tree.depth > 0
    return cloud


def is_patched(cloud) -> bool:
    return cloud.tree._n_changed > 0


def answers(cloud, rng) -> tuple:
    """What no tree may change, and how often balls were met: (answers, hits)."""
    places, X = rng.uniform(-1.2, 1.2, (12, 3)), np.array([random_pose(rng, 0.9) for _ in range(30)])
    X[::2, :3, 3] = cloud.points[rng.integers(0, len(cloud), 15)] + rng.uniform(-0.07, 0.07, (15, 3))
    shapes = collide.Sphere(0.05), collide.Box((0.1, 0.05, 0.2)), collide.Capsule(0.03, 0.1)
    near = [cloud.nearest(places, k) for k in (1, 9)]
    met = [collide.collide(cloud, shape, EYE, X, security_margin=m) for shape in shapes for m in (0.0, 0.02)]
    touching = collide.contacts(cloud, shapes[1], EYE, X[0], margin=0.1)
    cast = collide.shape_cast(shapes[0], pose(t=places[0]), -2.0 * places[0], cloud, EYE)
    ray = collide.raycast(cloud, EYE, places[:4], -places[:4])
    told = (
        *(array.tobytes() for pair in near for array in pair), *(cloud.within(p, 0.2).tobytes() for p in places),
        *(state.tobytes() for state in met), touching.rows.tobytes(), str(cast), str(ray),
    )
    return told, sum(int(state.sum()) for state in met)


@pytest.mark.many(2)
@pytest.mark.parametrize("radii", ["one", "each"])
@pytest.mark.parametrize("seed", range(2))
def test_chains_of_changes_keep_the_tree_whole_and_answers_as_they_are_anew(seed, radii):
    rng = rng_of("chains of changes", seed, radii)
    points = wall(rng, N) if seed else rng.uniform(-1.0, 1.0, (N, 3))
    cloud = with_tree(points, 0.01 if radii == "one" else rng.uniform(0.0, 0.03, N))
    names, n_patched, n_met, deepest = [*CHANGES], 0, 0, 0
    for step in range(200):
        name = names[int(rng.integers(len(names)))] if step % 40 else [*LARGE_CHANGES][step // 40 % 3]
        added, removed = {**CHANGES, **LARGE_CHANGES}[name](cloud, rng)
        gone = np.zeros(0, dtype=int) if removed is None else removed
        new = np.zeros((0, 3)) if added is None else added
        expected = np.vstack([np.delete(cloud.points, gone, axis=0), new])
        before = cloud
        cloud = before.updated(added=with_radii(cloud, added, rng), removed=removed)
        case = f"seed {seed}, radii {radii}, step {step}: {name}"
        assert np.array_equal(cloud.points, expected) and not cloud.points.flags.writeable, case
        validate_point_tree(cloud.tree)
        assert name not in LARGE_CHANGES or not is_patched(cloud), case
        n_patched, deepest = n_patched + is_patched(cloud), max(deepest, cloud.tree.depth)
        if step % 10 == 0:
            validate_point_tree(before.tree)
            ask = rng_of("questions", seed, step)
            anew = collide.PointCloud(cloud.points, cloud.radius)
            (found, n), (wanted, _) = answers(cloud, ask), answers(anew, rng_of("questions", seed, step))
            assert found == wanted, case
            n_met += n
    assert n_patched > 120 and n_met > 400 and deepest > anew.tree.depth, (n_patched, n_met, deepest)


def test_gaps_hold_the_distance_of_the_nearest_ball():
    rng, n_apart = rng_of("gaps of changed clouds"), 0
    cloud = with_tree(wall(rng, N), 0.01)
    for _ in range(11):
        cloud = cloud.updated(added=wall(rng, 9), removed=some(cloud, rng, 9))
        X = np.array([pose(t=p) for p in rng.uniform(-0.9, 0.9, (10, 3))])
        found = collide.distance(cloud, collide.Sphere(0.05), EYE, X, signed=False)
        away = np.linalg.norm(cloud.points - X[:, None, :3, 3], axis=2).min(axis=1) - 0.06
        assert is_patched(cloud) and (found.lower <= np.maximum(away, 0.0) + 1e-15).all()
        assert (found.upper >= np.maximum(away, 0.0) - 1e-15).all() and found.certified.all()
        n_apart += int((away > 0.0).sum())
    assert n_apart > 50, n_apart


@pytest.mark.parametrize("size", [0, 4, 5, 6, 7, 54, 55, 200])
def test_small_clouds_grow_and_shrink_point_by_point(size):
    """The share that may change is set aside, so that trees of one leaf are patched, too."""
    rng = rng_of("small clouds", size)
    points = np.vstack([rng.uniform(-1.0, 1.0, (size, 3)), [[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]]])
    tree, alive = PointTree(points), points
    for step in range(2 * size + 30):
        removed = np.array([rng.integers(len(alive) - 1)]) if step % 3 == 2 and len(alive) > 1 else np.zeros(0, int)
        new = rng.uniform(-0.5, 0.9, (1, 3)) if step % 3 != 2 else np.zeros((0, 3))
        tree = patched(tree, removed, new)
        assert tree is not None, (size, step)
        alive = np.vstack([np.delete(alive, removed, axis=0), new])
        assert np.array_equal(tree.points, alive)
        validate_point_tree(tree)
    squares, rows = tree.nearest(alive[:20], 1, np.inf)
    assert np.array_equal(rows[:, 0], np.arange(min(20, len(alive)))) and not squares.any()
    while len(alive) > 1:
        removed = np.sort(rng.choice(len(alive), min(len(alive) - 1, 5), replace=False))
        tree, alive = patched(tree, removed, np.zeros((0, 3))), np.delete(alive, removed, axis=0)
        validate_point_tree(tree)
    assert tree.in_box(alive[0], alive[0]).tolist() == [0]


def patched(tree: PointTree, removed, new) -> PointTree | None:
    points, numbers = remaining_points(tree.points, removed, new)
    made = tree._patched(points, removed, numbers)
    if made is not None:
        made._n_changed, made._n_built = 1, tree._n_built
    return made


def test_points_in_a_row_hang_in_one_slot_as_a_tree_with_branches():
    """Each row stands beyond the last: a list of them would be 500 levels deep."""
    tree = PointTree(rng_of("rows of points").uniform(-1.0, 1.0, (400, 3)))
    for step in range(20):
        row = np.column_stack([np.linspace(0.0, 1e-9, 200) + 1e-8 * step, np.zeros((200, 2))])
        tree = patched(tree, np.zeros(0, dtype=np.int64), row)
    validate_point_tree(tree)
    assert len(tree.points) == 4400 and 6 <= tree.depth <= 10, tree.depth


@pytest.mark.plain_kernels
def test_plain_python_makes_the_same_tree_and_gives_up_where_levels_end(monkeypatch):
    rng = rng_of("plain changes")
    tree = PointTree(np.vstack([rng.uniform(-1.0, 1.0, (300, 3)), [[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]]]))
    removed, new = np.arange(0, 300, 5), rng.uniform(0.0, 0.3, (150, 3))
    compiled = patched(tree, removed, new)
    monkeypatch.setattr(point_tree, "change_point_tree", point_tree_changes.change_tree)
    plain = patched(tree, removed, new)
    for name in ("_nodes", "ids", "_floats"):
        assert np.array_equal(getattr(plain, name), getattr(compiled, name)), name
    assert compiled.depth > tree.depth
    monkeypatch.setattr(point_tree_changes, "MAX_LEVELS", compiled.depth - 1)
    assert patched(tree, removed, new) is None
    monkeypatch.setattr(point_tree_changes, "MAX_LEVELS", compiled.depth)
    assert patched(tree, removed, new).depth == compiled.depth


def test_places_of_leaves_that_lost_points_are_taken_again():
    """Ten changes at the same places need no leaf more than the first."""
    rng = rng_of("places taken again")
    points = rng.uniform(-1.0, 1.0, (7000, 3))
    cloud = with_tree(points)
    rows = np.arange(30)
    for _ in range(10):
        cloud = cloud.updated(added=cloud.points[rows], removed=rows)
        assert is_patched(cloud)
        rows = np.arange(len(cloud) - 30, len(cloud))
    assert len(cloud.tree.ids) <= len(points) + 30 * MAX_LEAF


def test_four_threads_read_the_old_cloud_while_others_are_made_of_it():
    rng = rng_of("readers of an old cloud")
    cloud = collide.PointCloud(wall(rng, N), 0.01)
    expected, tree = answers(cloud, rng_of("asked"))[0], cloud.tree
    before = [array.tobytes() for array in (tree._nodes, tree.ids, tree._floats, tree._header, cloud.points)]
    ended, wrong, n_read = threading.Event(), [], itertools.count()

    def read() -> None:
        while not ended.is_set():
            if answers(cloud, rng_of("asked"))[0] != expected:
                wrong.append(next(n_read))
            next(n_read)

    readers = [threading.Thread(target=read) for _ in range(4)]
    for reader in readers:
        reader.start()
    until, n_made, made = time.monotonic() + 1.5, 0, cloud
    while time.monotonic() < until:
        made = cloud.updated(added=wall(rng, 40), removed=some(cloud, rng, 30))
        n_made += is_patched(made)
        made = made.updated(removed=np.arange(20))
    ended.set()
    for reader in readers:
        reader.join()
    validate_point_tree(made.tree)
    after = [array.tobytes() for array in (tree._nodes, tree.ids, tree._floats, tree._header, cloud.points)]
    assert not wrong and after == before and n_made > 20 and next(n_read) > 8


def test_points_out_of_the_range_of_units_make_a_new_tree():
    """Corners at ± 1 make units of 2 m, and floats are good to 2⁻²⁴ units within ± 1 unit."""
    cloud = with_tree(np.vstack([wall(rng_of("range"), 1000), [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]]))
    for place, is_within in ((1.999, True), (-1.999, True), (2.0, False), (-2.001, False), (5e49, False)):
        for axis in range(3):
            made = cloud.updated(added=place * np.eye(3)[axis : axis + 1])
            validate_point_tree(made.tree)
            assert is_patched(made) == is_within, (place, axis)


def test_clouds_without_a_tree_make_none():
    points = wall(rng_of("no tree"), 100)
    assert not hasattr(collide.PointCloud(points).updated(removed=[3]), "_tree")
    assert hasattr(with_tree(points).updated(removed=[3]), "_tree")
