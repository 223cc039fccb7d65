"""Point clouds: how they are made, what they leave out, and neighbours beside brute force."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import collide
from collide import InvalidArgument, InvalidShape, PointCloud
from collide.shapes.shape_files import write_arrays

EYE = np.eye(4)


def test_points_and_radii_are_kept_as_given():
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    cloud = PointCloud(points, 0.01)
    assert len(cloud) == 50 and np.array_equal(cloud.points, points.astype(np.float64)) and cloud.dropped == 0
    assert not cloud.points.flags.writeable and cloud.radii.tolist() == [0.01] * 50
    each = PointCloud(points, np.linspace(0.0, 1.0, 50))
    assert np.array_equal(each.radii, np.linspace(0.0, 1.0, 50))
    for made in (cloud, each):
        again = pickle.loads(pickle.dumps(made))
        assert again == made and hash(again) == hash(made) and repr(again) == repr(made)
    assert cloud != each and "50 points" in repr(cloud)
    with pytest.raises(AttributeError, match="immutable"):
        cloud.radius = 1.0


def test_points_that_are_not_finite_are_refused_or_dropped_and_counted():
    points = np.zeros((6, 3))
    points[1, 2], points[4, 0] = np.nan, np.inf
    with pytest.raises(InvalidShape, match=r"points\[1, 2\] is nan"):
        PointCloud(points)
    cloud = PointCloud(points, np.arange(6.0), drop_invalid=True)
    assert len(cloud) == 4 and cloud.dropped == 2 and cloud.radii.tolist() == [0.0, 2.0, 3.0, 5.0]
    with pytest.raises(InvalidShape, match="none of 2 points is finite"):
        PointCloud(np.full((2, 3), np.nan), drop_invalid=True)


@pytest.mark.parametrize(
    ("points", "radius", "message"),
    [
        (np.zeros((0, 3)), 0.1, r"points is empty, \(0, 3\); of a scan without echoes make no body"),
        ([], 0.1, "points is empty"), ("a.pcd", 0.1, r"must be numbers, got 'a\.pcd'; files are read by PointCloud"),
        ([(0, 0, np.nan)], 0.1, r"points\[0, 2\] is nan.*; drop_invalid=True leaves out points"),
        (np.zeros((2, 2)), 0.1, "points must have shape"),
        ([[1, 2, "x"]], 0.1, "points"), (np.zeros((2, 3)), -1.0, "radius must be ≥ 0"),
        (np.zeros((2, 3)), [0.1, -1.0], r"radius\[1\] must be ≥ 0"),
        (np.zeros((2, 3)), [1e-60, 0.1], r"radius\[0\] must be 0, or at least"),
        (np.zeros((2, 3)), [0.1] * 3, "one for each of 2"),
        (np.zeros((2, 3)), np.nan, "radius must be finite"), (np.full((1, 3), 1e60), 0.0, "within"),
    ],
)
def test_bad_clouds_are_named(points, radius, message):
    with pytest.raises(InvalidShape, match=message):
        PointCloud(points, radius)


@pytest.mark.parametrize("size", [1, 7, 8, 57, 3000])
def test_neighbours_are_those_of_brute_force(size):
    rng = np.random.default_rng(size)
    points = rng.integers(-8, 9, (size, 3)) / 4.0 if size % 2 else rng.normal(size=(size, 3))  # ties, and none
    cloud, places = PointCloud(points), np.vstack([rng.normal(size=(40, 3)) * 2.0, points[:10]])
    squares = np.square(places[:, None] - points).sum(axis=2)
    order = np.lexsort((np.broadcast_to(np.arange(size), squares.shape), squares), axis=1)
    for k in (1, 5):
        near = cloud.nearest(places, k)
        wanted = np.full((len(places), k), -1)
        wanted[:, : min(k, size)] = order[:, :k]
        assert np.array_equal(near.row.reshape(len(places), k), wanted)
        assert near.distance.reshape(len(places), k)[:, 0] == pytest.approx(np.sqrt(squares.min(axis=1)), rel=1e-15)
        assert np.isinf(near.distance.reshape(len(places), k)[wanted < 0]).all()
    single = cloud.nearest(places[0])
    assert np.ndim(single.row) == 0 and single.row == order[0, 0]
    limit = float(np.sqrt(np.median(squares.min(axis=1))))
    near = cloud.nearest(places, max_distance=limit)
    assert np.array_equal(near.row >= 0, squares.min(axis=1) <= limit * limit) and (near.row >= 0).any()
    for place in places[:10]:
        for r in (0.0, 0.25, 1.0):
            inside = np.square(points - place).sum(axis=1) <= r * r
            assert np.array_equal(cloud.within(place, r), np.flatnonzero(inside))


def test_clouds_that_are_cropped_filtered_and_updated_say_what_they_leave_out():
    rng = np.random.default_rng(3)
    points, radii = rng.uniform(-1, 1, (2000, 3)), rng.uniform(0, 0.1, 2000)
    cloud = PointCloud(points, radii)
    part = cloud.cropped([(-0.5, -np.inf, 0.0), (0.5, 0.2, np.inf)])
    keep = (np.abs(points[:, 0]) <= 0.5) & (points[:, 1] <= 0.2) & (points[:, 2] >= 0.0)
    assert np.array_equal(part.points, points[keep]) and np.array_equal(part.radii, radii[keep])
    assert part.dropped == 2000 - keep.sum()
    thin = cloud.filtered(0.2)
    assert 700 < len(thin) < 1001 and thin.dropped == 2000 - len(thin)
    assert (thin.nearest(points).distance <= 0.2 * np.sqrt(3.0)).all()
    more = PointCloud(points[:3], 0.5).updated(added=[(9.0, 9.0, 9.0)], removed=[1])
    assert np.array_equal(more.points, [*points[[0, 2]], (9.0, 9.0, 9.0)]) and more.radius == 0.5
    both = cloud.updated(added=PointCloud([(5.0, 5.0, 5.0)], 0.3), removed=points[:, 0] > 0.0)
    assert len(both) == (points[:, 0] <= 0.0).sum() + 1 and both.radii[-1] == 0.3
    assert len(cloud) == 2000, "the old cloud stays"
    mixed = PointCloud(points[:3], 0.5).updated(added=PointCloud(points[3:5], 0.1), removed=[0])
    assert mixed.radii.tolist() == [0.5, 0.5, 0.1, 0.1] and not mixed.radius.flags.writeable
    alike = PointCloud(points[:3], 0.5).updated(added=PointCloud(points[3:5], 0.5), removed=[0, 1, 2])
    assert alike.radius == 0.5 and np.array_equal(alike.points, points[3:5])
    with pytest.raises(InvalidShape, match="updated: no point of 3 is left"):
        PointCloud(points[:3]).updated(removed=[2, 0, 1, 1])
    with pytest.raises(InvalidShape, match="added is empty"):
        PointCloud(points[:3]).updated(added=np.zeros((0, 3)))
    assert collide.collide(both, collide.Sphere(0.1), EYE, collide.pose((5, 5, 5.35)))
    with pytest.raises(InvalidShape, match="no point of 2000 is left"):
        cloud.cropped([(5, 5, 5), (6, 6, 6)])


def test_how_many_points_were_dropped_is_kept(tmp_path):
    points = np.random.default_rng(4).uniform(-1, 1, (300, 3))
    points[::7] = np.nan
    finite = PointCloud(points, 0.01, drop_invalid=True)
    part = finite.cropped([(-0.5,) * 3, (0.5,) * 3])
    image = PointCloud.from_depth([[0.0, 1.0, 2.0]], fx=1.0, fy=1.0)
    assert [cloud.dropped for cloud in (finite, part, image)] == [43, 257 - len(part), 1] and part.dropped > 50
    path = tmp_path / "cloud.npz"
    for cloud in (finite, part, image):
        cloud.save(path)
        read = PointCloud.load(path), PointCloud.from_file(path), PointCloud.from_file(path, 0.5)
        pickled = [pickle.loads(pickle.dumps(cloud, protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)]
        assert {copied.dropped for copied in (*read, *pickled, cloud.scaled(2.0))} == {cloud.dropped}
        assert all(copied == cloud for copied in (*read[:2], *pickled))
        assert PointCloud(cloud.points, cloud.radius) == cloud, "the number is not compared"
        cloud.save(tmp_path / "cloud.pcd")
        assert PointCloud.from_file(tmp_path / "cloud.pcd").dropped == 0


def test_files_without_the_number_of_dropped_points_are_read_and_numbers_below_0_refused(tmp_path):
    arrays, path = {"points": np.eye(3), "radius": np.array(0.1)}, tmp_path / "cloud.npz"
    write_arrays("PointCloud", path, 1, arrays)
    assert PointCloud.load(path) == PointCloud(np.eye(3), 0.1) and PointCloud.load(path).dropped == 0
    write_arrays("PointCloud", path, 1, {**arrays, "dropped": np.array(-2)})
    with pytest.raises(InvalidShape, match=r"cloud\.npz: dropped must be ≥ 0, got -2"):
        PointCloud.load(path)


def test_depth_images_become_points_in_the_frame_of_the_camera():
    image = np.array([[1000, 0, 2000], [0, 500, 0]], dtype=np.uint16)
    cloud = PointCloud.from_depth(image, fx=2.0, fy=4.0, cx=1.0, cy=0.0, radius=0.01, scale=0.001)
    assert cloud.points.tolist() == [[-0.5, 0.0, 1.0], [1.0, 0.0, 2.0], [0.0, 0.125, 0.5]] and cloud.dropped == 3
    assert cloud.radius == 0.01
    middle = PointCloud.from_depth(np.array([[np.nan, 2.0], [2.0, 9.0]]), fx=1.0, fy=1.0, max_depth=5.0)
    assert middle.points.tolist() == [[1.0, -1.0, 2.0], [-1.0, 1.0, 2.0]] and middle.dropped == 2
    for bad, message in ((np.zeros((2, 2)), "no pixel"), (np.zeros(4), "shape"), (-np.ones((2, 2)), "below 0")):
        with pytest.raises(InvalidShape, match=message):
            PointCloud.from_depth(bad, fx=1.0, fy=1.0)
    with pytest.raises(InvalidShape, match="fx must be > 0"):
        PointCloud.from_depth(image, fx=0.0, fy=1.0)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (lambda c: c.nearest((1, 2)), "p must be"), (lambda c: c.nearest((0, 0, np.nan)), "p must be"),
        (lambda c: c.nearest((0, 0, 0), 0), "k must"), (lambda c: c.nearest((0, 0, 0), max_distance=-1.0), "max_dist"),
        (lambda c: c.within((0, 0, 0), np.inf), "finite"), (lambda c: c.within(np.zeros((2, 3)), 1.0), "single place"),
        (lambda c: c.cropped([(1, 1, 1), (0, 2, 2)]), "least and a largest"), (lambda c: c.filtered(1e-9), "2²⁰ cells"),
        (lambda c: c.updated(removed=[5]), "0 … 1"), (lambda c: c.updated(removed=[0.5]), "rows"),
        (lambda c: PointCloud([(0, 0, 0)], [0.1]).updated(added=[(1, 1, 1)]), "a radius each"),
    ],
)
def test_bad_arguments_are_named(asked, message):
    with pytest.raises(InvalidArgument, match=message):
        asked(PointCloud([(0, 0, 0), (1, 0, 0)]))


def test_clouds_are_no_parts_of_compounds():
    with pytest.raises(InvalidShape, match=r"items\[1\] is a PointCloud"):
        collide.Compound([(collide.Sphere(1.0), EYE), (PointCloud([(0, 0, 0)]), EYE)])


def test_more_neighbours_than_points_are_none():
    """Sorted all at once where many are wanted: the same as by the walk, and −1 behind the last."""
    rng = np.random.default_rng(21)
    points = np.round(rng.uniform(-1, 1, (700, 3)), 2)
    cloud, places = collide.PointCloud(points), rng.uniform(-1, 1, (3, 3))
    many, few = cloud.nearest(places, k=900), cloud.nearest(places, k=300)
    assert np.array_equal(many.row[:, :300], few.row) and np.array_equal(many.distance[:, :300], few.distance)
    assert (many.row[:, 700:] == -1).all() and np.isinf(many.distance[:, 700:]).all()
    assert (np.sort(many.row[:, :700], axis=1) == np.arange(700)).all()
    near = cloud.nearest(places[0], k=900, max_distance=0.5)
    assert np.array_equal(near.row[near.row >= 0], many.row[0, : np.count_nonzero(many.distance[0] <= 0.5)])
