"""Poses as users have them: quaternions of any length, either order, scipy's rotations and rigid transforms."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import collide
from collide import Box, InvalidPose, Sphere, distance, pose
from collide.papers.polytopes.convex_polygon import planar_poses
from collide.transforms import as_poses

EYE = np.eye(4)
HALF_TURN_X = np.diag([1.0, -1, -1, 1])


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize("scale", [1e308, 1e200, 1.0, 1e-9, 1e-200, 1e-308, 5e-324])
def test_only_the_direction_of_a_quaternion_counts(scale):
    assert np.allclose(pose(quat_wxyz=(0, scale, 0, 0)), HALF_TURN_X, atol=1e-15)
    assert np.allclose(pose(quat_wxyz=(scale, 0, 0, scale)), pose(rpy=(0, 0, np.pi / 2)), atol=1e-15)
    assert np.array_equal(pose(quat_xyzw=(scale, 0, 0, 0)), pose(quat_wxyz=(0, scale, 0, 0)))


def test_components_of_very_different_size():
    assert np.allclose(pose(quat_wxyz=(1, 1e308, 0, 0)), HALF_TURN_X, atol=1e-15)
    assert np.allclose(pose(quat_wxyz=(1e308, 1, 0, 1e-308)), EYE, atol=1e-15)


def test_ordinary_quaternions_keep_their_bits():
    """As they were before lengths were taken care of: scaling by a power of two rounds nothing."""
    rng = np.random.default_rng(3)
    for q in rng.normal(size=(500, 4)) * 10.0 ** rng.integers(-5, 5, 500)[:, None]:
        w, x, y, z = q / np.linalg.norm(q)
        assert pose(quat_wxyz=q)[0, 0] == 1 - 2 * (y * y + z * z) and pose(quat_wxyz=q)[2, 1] == 2 * (y * z + w * x)
        assert np.array_equal(pose(quat_xyzw=np.roll(q, -1)), pose(quat_wxyz=q))


@pytest.mark.parametrize(
    "q", [(0, 0, 0, 0), (np.nan, 0, 0, 1), (np.inf, 0, 0, 0), (1, 0, 0, 10**400), (1, 0, 0, 1j), ("1", 0, 0, 0)]
)
def test_quaternions_that_are_none(q):
    for name in ("quat_wxyz", "quat_xyzw"):
        with pytest.raises(InvalidPose, match="quat"):
            pose(**{name: q})


def test_one_description_of_a_rotation():
    with pytest.raises(InvalidPose, match="at most one of rpy, quat_wxyz, quat_xyzw and R"):
        pose(quat_wxyz=(1, 0, 0, 0), quat_xyzw=(0, 0, 0, 1))


class Turn:
    """What scipy's Rotation looks like from outside."""

    def __init__(self, matrix):
        self.matrix = np.asarray(matrix, dtype=float)

    def as_matrix(self):
        return self.matrix


def test_rotations_by_what_they_can_do():
    R = pose(rpy=(0.1, 0.2, 0.3))[:3, :3]
    X = pose((1, 2, 3), R=R)
    assert np.array_equal(pose((1, 2, 3), R=Turn(R)), X)
    assert np.array_equal(as_poses((Turn(R), (1, 2, 3)))[0], X)
    assert np.array_equal(as_poses(Turn(R))[0], pose(R=R)) and np.array_equal(as_poses(Turn(X))[0], X)
    many = np.stack([R, np.eye(3)])
    assert np.array_equal(as_poses((Turn(many), (1, 2, 3)))[0], X) and as_poses(Turn(many)).shape == (2, 4, 4)
    a, b = Box(1, 2, 3), Sphere(0.1)
    assert distance(a, b, Turn(X), EYE).rows.tobytes() == distance(a, b, X, EYE).rows.tobytes()
    assert len(distance(a, b, (Turn(many), (1, 2, 3)), EYE)) == 2
    world = collide.World()
    world.add(a, (Turn(R), (1, 2, 3)), name="a")
    assert np.array_equal(world.body("a").X_WB, X)
    assert collide.contains(a, Turn(X), (1, 2, 3)) is True
    with pytest.raises(InvalidPose, match="mirrors"):
        as_poses(Turn(-np.eye(3)))
    with pytest.raises(InvalidPose, match=r"\(2, 2\)"):
        as_poses(Turn(np.eye(2)))


def test_scipys_own():
    spatial = pytest.importorskip("scipy.spatial.transform", reason="scipy is not installed")
    turn = spatial.Rotation.from_euler("xyz", [0.1, 0.2, 0.3])
    assert np.allclose(pose((1, 2, 3), R=turn), pose((1, 2, 3), rpy=(0.1, 0.2, 0.3)), atol=1e-15)
    assert np.allclose(pose(quat_xyzw=turn.as_quat()), pose(R=turn), atol=1e-15)
    turns = spatial.Rotation.random(5, random_state=1)
    hits = collide.collide(Sphere(1), Sphere(1), EYE, (turns, np.zeros((5, 3))))
    assert hits.shape == (5,) and hits.all()
    if hasattr(spatial, "RigidTransform"):
        X = spatial.RigidTransform.from_components([1, 2, 3], turn)
        assert np.array_equal(as_poses(X)[0], X.as_matrix())


@pytest.mark.parametrize(
    "entry, value, words",
    [((0, 2), np.nan, "not finite"), ((2, 0), 1.0, "must end in the row"), ((0, 2), 2e50, "exceeds"),
     ((0, 1), 2e-4, "is not a rotation"), ((0, 0), -1.0, "mirrors"), ((0, 1), 5e-5, None)],
)
def test_poses_of_the_plane_and_of_space_are_refused_alike(entry, value, words):
    """The same defect in both, at the same place of a batch; the last is within the tolerance."""
    plane, space = np.tile(np.eye(3), (3, 1, 1)), np.tile(np.eye(4), (3, 1, 1))
    row, column = entry
    plane[1, row, column] = value
    space[1, row + (row == 2), column + (column == 2)] = value  # z is left as it is
    for X, read in ((plane, planar_poses), (space, as_poses)):
        if words is None:
            read(X, "X_WA")
            continue
        with pytest.raises(InvalidPose, match=rf"X_WA\[1\] .*{words}"):
            read(X, "X_WA")
