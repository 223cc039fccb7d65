"""Poses as users have them: quaternions of any length, either order, scipy's rotations and rigid transforms."""

from __future__ import annotations

import warnings
from fractions import Fraction

import numpy as np
import pytest

import collide
from collide import Box, InvalidPose, Sphere, distance, pose, poses
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
    with pytest.raises(InvalidPose, match="at most one of rpy, rpy_deg, quat_wxyz, quat_xyzw and R"):
        pose(quat_wxyz=(1, 0, 0, 0), quat_xyzw=(0, 0, 0, 1))


@pytest.mark.parametrize("rpy", [(90, 0, 0), (0, -6.3, 0), (0, 0, 1e9)])
def test_radians_beyond_a_full_turn_are_asked_about(rpy):
    with pytest.raises(InvalidPose, match=r"pose: rpy holds radians, .* are these degrees\? Then write rpy_deg="):
        pose(rpy=rpy)
    with pytest.raises(InvalidPose, match=r"poses: rpy\[1\] holds radians"):
        poses((0, 0, 0), rpy=[(0, 0, 0), rpy])


def test_a_full_turn_of_radians_as_files_write_it():
    for angle in (2 * np.pi, 6.2832, -6.2832):
        assert np.allclose(pose(rpy=(0, 0, angle)), EYE, atol=1e-4)


def test_degrees_are_exact_at_right_angles():
    assert pose((1, 2, 3), rpy_deg=(0, 90, 0)).tolist() == [[0, 0, 1, 1], [0, 1, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1]]
    assert np.array_equal(pose(rpy_deg=(720, -90, 180)), pose(rpy_deg=(0, 270, -180)))
    rng = np.random.default_rng(5)
    for angles in rng.uniform(-180, 180, (50, 3)):
        assert np.allclose(pose(rpy_deg=angles), pose(rpy=np.radians(angles)), atol=4e-16), angles


def test_arrays_of_degrees_and_of_scalar_last_quaternions():
    rng = np.random.default_rng(6)
    p, angles, q = rng.normal(size=(20, 3)), rng.uniform(-400, 400, (20, 3)), rng.normal(size=(20, 4))
    assert np.array_equal(poses(p, rpy_deg=angles), [pose(x, rpy_deg=a) for x, a in zip(p, angles)])
    assert np.allclose(poses(p, quat_xyzw=q), [pose(x, quat_xyzw=a) for x, a in zip(p, q)], atol=1e-15)
    assert poses(np.zeros((0, 3)), rpy_deg=np.zeros((0, 3))).shape == (0, 4, 4)
    with pytest.raises(InvalidPose, match="at most one of quat_wxyz, quat_xyzw, rpy and rpy_deg"):
        poses(p, rpy=angles, rpy_deg=angles)
    with pytest.raises(InvalidPose, match=r"quat_xyzw .* \(N, 4\)"):
        poses(p, quat_xyzw=angles)


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


def _rotation_by_hamilton(q) -> np.ndarray:
    """What q e q* makes of the axes e, in exact arithmetic of what is given, divided by |q|²."""
    w, x, y, z = map(Fraction, np.asarray(q, dtype=np.float64).tolist())

    def times(a, b):
        (s, i, j, k), (t, m, n, o) = a, b
        return (
            s * t - i * m - j * n - k * o, s * m + i * t + j * o - k * n,
            s * n - i * o + j * t + k * m, s * o + i * n - j * m + k * t,
        )

    length = w * w + x * x + y * y + z * z
    axes = ((0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    columns = [times(times((w, x, y, z), axis), (w, -x, -y, -z))[1:] for axis in axes]
    return np.array([[float(v / length) for v in column] for column in columns]).T


def test_poses_of_arrays():
    rng = np.random.default_rng(5)
    p, q, rpy = rng.normal(size=(40, 3)), rng.normal(size=(40, 4)), rng.uniform(-np.pi, np.pi, size=(40, 3))
    by_quaternion, by_angles = poses(p, quat_wxyz=q), poses(p, rpy=rpy)
    for k in range(40):
        shown = f"poses({p[k].tolist()}, {q[k].tolist()}), rpy={rpy[k].tolist()}"
        assert np.abs(by_quaternion[k, :3, :3] - _rotation_by_hamilton(q[k])).max() < 2e-15, shown
        assert np.abs(by_angles[k] - pose(p[k], rpy=rpy[k])).max() < 2e-15, shown
        assert by_quaternion[k, :, 3].tolist() == [*p[k], 1.0] and by_quaternion[k, 3].tolist() == [0, 0, 0, 1], shown
    assert np.array_equal(poses(p)[7], pose(p[7])) and poses(p).shape == (40, 4, 4) and poses(p).flags.c_contiguous
    assert np.array_equal(poses(p[0], q), poses(np.tile(p[0], (40, 1)), q)), "a single row goes with all"
    assert np.array_equal(poses(p, q[0]), poses(p, np.tile(q[0], (40, 1))))
    assert poses((1, 2, 3)).shape == (1, 4, 4) and poses(np.zeros((0, 3)), np.zeros((0, 4))).shape == (0, 4, 4)
    assert np.allclose(poses((0, 0, 0), (1e-308, 0, 0, 1e-308))[0], pose(rpy=(0, 0, np.pi / 2)), atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"p": np.zeros((2, 3)), "rpy": (0, 0, 0), "quat_wxyz": (1, 0, 0, 0)}, "at most one"),
        ({"p": np.zeros((2, 3)), "quat_wxyz": np.ones((3, 4))}, r"p \(2, 3\), quat_wxyz \(3, 4\)"),
        ({"p": np.zeros((0, 3)), "rpy": np.zeros((2, 3))}, r"p \(0, 3\), rpy \(2, 3\)"),
        ({"p": np.zeros((2, 4))}, r"poses: p must have shape \(N, 3\)"),
        ({"p": [[0, 0, 0], [0, np.nan, 0]]}, r"p\[1\] has entries that are not finite"),
        ({"p": [[0, 0, 0], [0, 1e60, 0]]}, r"poses\[1\] exceeds"),
        ({"p": (0, 0, 0), "quat_wxyz": [(1, 0, 0, 0), (0, 0, 0, 0)]}, r"quat_wxyz\[1\] is of length 0"),
        ({"p": "abc"}, "poses: p must be real numbers"),
    ],
)
def test_rows_that_make_no_poses(arguments, said):
    with pytest.raises(InvalidPose, match=said):
        poses(**arguments)


def test_a_translation_is_read_as_before_it_had_a_short_way():
    for xyz in ((1, 2.5, -3), [0.0, -0.0, 5e-324], np.array([1.0, 2, 3]), (2**60 + 1, 0, 0), np.array([1, 2, 3])):
        want = np.eye(4)
        want[:3, 3] = np.asarray(xyz, dtype=np.float64)
        assert pose(xyz).tobytes() == want.tobytes(), f"pose({xyz!r})"
    for xyz in ((1, 2), (1, 2, np.nan), (1, 2, 1e51), (1, 2, 10**60), (1, 2, "3"), (1, 2, 1j), np.zeros((3, 1)), None):
        with pytest.raises(InvalidPose, match="pose"):
            pose(xyz)
    first = pose((1, 2, 3))
    first[:] = 7.0
    assert pose((1, 2, 3)).tolist() == [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], "poses share no memory"


def test_first_three_rows_are_poses_and_rows_of_seven_are_asked_to_say_their_order():
    X = poses(np.random.default_rng(2).normal(size=(5, 3)), rpy=(0.1, 0.2, 0.3))
    assert np.array_equal(as_poses(X[:, :3]), X) and np.array_equal(as_poses(X[0, :3]), X[:1])
    box = Box((1, 1, 1))
    assert distance(box, box, X[:, :3], EYE).rows.tobytes() == distance(box, box, X, EYE).rows.tobytes()
    assert distance(box, box, X[0, :3], EYE[:3]).is_single
    for rows in (np.zeros((5, 7)), np.zeros(7)):
        with pytest.raises(InvalidPose, match=r"X_WA.*got .*collide\.poses\(.*scalar comes first.*last"):
            distance(box, box, rows, EYE)
