"""Buffers of kernels, and that kernels stop where there is no space, go on where they stopped, and say the same."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of
from random_robots import slider

import collide
from collide.kernels import address_of
from collide.results import PAIR_DTYPE
from collide.robots import check_scene as layout
from collide.robots import motion_bounds as motions
from collide.robots.certify_meshes import settle_meshes
from collide.robots.certify_motions import certify_motions
from collide.robots.check_configurations import COLLIDES, IS_FREE, IS_OPEN, check_configurations
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.distance_batches import DistanceQuestion, Slots
from collide.robots.distance_gradients import distance_gradients
from collide.robots.kinematic_tree import Joint
from collide.robots.motion_bounds import bound_motions
from collide.robots.nearest_pairs import FIRST_LIMIT, NONE, nearest_pairs
from collide.robots.part_pairs import BEYOND_MARGIN, HITTING, NEAR, OPEN
from collide.robots.robot import LinkShape, Robot
from collide.robots.robot_checker import RobotChecker

#: A box without its lid: an open mesh, which only others can ask about.
CLOSED = collide.tessellate(collide.Box((0.4, 0.4, 0.4)))
LIDLESS = collide.Mesh(CLOSED.vertices, CLOSED.faces[:-2])


def checker_of(*shapes, robot: Robot | None = None) -> RobotChecker:
    world = collide.World()
    for k, shape in enumerate(shapes):
        world.add(shape, pose(t=(0.5 * (k + 1), 0, 0)), name=f"body{k}")
    return RobotChecker(robot or slider(), world)


def space_of(checker: RobotChecker, **words: int) -> CheckWorkspace:
    space = CheckWorkspace(checker.robot, checker.setting)
    assert space.stand(checker.setting)
    for name, value in words.items():
        space.header[getattr(layout, name)] = value
    return space


def verdicts_of(space: CheckWorkspace, q: np.ndarray, first: int = 0) -> tuple[int, list[int], list[list[int]]]:
    """Where the kernel stopped, verdicts, and (configuration, body, partner) of what is left to others."""
    out = np.full(len(q), 9, dtype=np.uint8)
    end = check_configurations(space.address, address_of(q), q.shape[1], first, len(q), address_of(out))
    return end, out.tolist(), space.open_pairs[:, :3].tolist()


def test_states_and_words_are_numbers_of_their_own():
    assert sorted((BEYOND_MARGIN, NEAR, HITTING, OPEN)) == [0, 1, 2, 3]
    words = [value for name, value in vars(layout).items() if name.isupper() and name not in (
        "BODY", "SKIP", "NODE_LINK", "MEASURE", "PART", "TURNED", "POSE", "POSE_SLOP", "POSE_STRETCH", "POSE_TERMS",
        "PRODUCT_SLOP", "HEADER", "LINK", "FIRST", "COUNT", "TWINS", "BODY_INTS", "CENTRE", "HALF", "BOX", "OPEN_INTS",
        "OPEN_LOWER", "ROUNDINGS_OF_ROTATIONS", "UNBOUNDED_HALF",
    )]
    assert sorted(words) == list(range(layout.HEADER))
    assert motions.ROUNDING + 1 == motions.MOTION_HEADER and motions.RESOLUTION + 1 == motions.ROUNDING


def test_verdicts_and_what_is_left_to_others():
    """A ball within an open box may touch it: left to others. Half a metre on it meets a ball, and half on nothing."""
    checker = checker_of(LIDLESS, collide.Sphere(0.1))
    q = np.array([[0.5], [1.0], [-0.5], [0.75], [0.25]])
    end, verdicts, left = verdicts_of(space_of(checker), q)
    assert end == 5 and verdicts[:3] == [IS_OPEN, COLLIDES, IS_FREE] and left[0] == [0, 0, -1]
    assert all(verdicts[k] == IS_OPEN for k, _, _ in left)
    assert verdicts_of(space_of(checker), q[:0]) == (0, [], [])
    assert verdicts_of(space_of(checker), q, 2)[1][:2] == [9, 9]  # those before the first are not written


@pytest.mark.parametrize("capacity", [1, 2, 3])
def test_a_kernel_stops_where_there_is_no_space_and_goes_on(capacity):
    checker = checker_of(LIDLESS)
    q = np.array([[0.5], [-0.5], [0.51], [0.49], [-0.6], [0.5]])
    whole = verdicts_of(space_of(checker), q)
    assert whole == (6, [IS_OPEN, IS_FREE, IS_OPEN, IS_OPEN, IS_FREE, IS_OPEN], [[k, 0, -1] for k in (0, 2, 3, 5)])
    space, done, left = space_of(checker, OPEN_CAPACITY=capacity), 0, []
    while done < len(q):
        end, verdicts, pairs = verdicts_of(space, q, done)
        assert end > done and len(pairs) <= capacity and verdicts[done:end] == whole[1][done:end]
        done, left = end, left + pairs
    assert left == whole[2]


def test_what_a_colliding_configuration_left_is_taken_back():
    checker = checker_of(LIDLESS, collide.Sphere(0.1))
    world = checker.world
    world.set_pose("body1", pose(t=(0.5, 0, 0)))
    checker.prepare()
    assert verdicts_of(space_of(checker), np.array([[0.5], [-0.5]])) == (2, [COLLIDES, IS_FREE], [])


def nearest(checker: RobotChecker, q: np.ndarray, limit: float, within: float = FIRST_LIMIT):
    space = space_of(checker)
    rows, limits = np.zeros(len(q), dtype=PAIR_DTYPE), np.full(len(q), min(within, limit))
    end = nearest_pairs(
        space.address, address_of(q), q.shape[1], 0, len(q), limit, address_of(limits),
        Slots(DistanceQuestion(), checker.setting).address, address_of(rows),
    )
    assert end == len(q)
    return space, rows, limits


def test_limits_grow_until_a_pair_is_within():
    checker = checker_of(collide.Sphere(0.1))  # its surface is 0.3 m from that of the cart at 0
    q = np.array([[0.0], [0.25], [-100.0]])
    _, rows, limits = nearest(checker, q, np.inf)
    assert rows["a"].tolist() == [0, 0, 0] and np.allclose(rows["distance"], (0.3, 0.05, 100.3), atol=1e-13)
    assert (limits >= rows["distance"]).all() and limits[0] == 0.4 and limits[2] == np.inf
    _, rows, limits = nearest(checker, q, 0.2)
    assert rows["a"].tolist() == [NONE, 0, NONE] and limits[[0, 2]].tolist() == [0.2, 0.2]


def test_gradients_of_rows_that_have_one():
    checker = checker_of(collide.Sphere(0.1))
    q = np.array([[0.0], [0.875], [0.0], [0.0]])
    space, rows, _ = nearest(checker, q, np.inf)
    rows["certified"][2], rows["a"][3] = False, NONE
    out, of = np.full((4, 1), 7.0), np.arange(4)
    distance_gradients(
        space.address, address_of(q), 1, 4, address_of(of), 4, address_of(checker.robot.moves), address_of(rows), 0,
        address_of(out),
    )
    assert np.allclose(out[:2, 0], (-1.0, 1.0), atol=1e-12) and np.isnan(out[2:]).all()


# --- motions --------------------------------------------------------------------------------------


def motion(checker: RobotChecker, q0, q1, capacity: int | None = None, resolution: float = 1e-2):
    space = space_of(checker)
    work = space.motions(resolution)
    if capacity is not None:
        work.header[[motions.OPEN_INTERVAL_CAPACITY, motions.MESH_PAIR_CAPACITY]] = capacity
    q0, q1, times = np.array(q0, dtype=float), np.array(q1, dtype=float), np.full(len(q0), np.nan)
    end = certify_motions(
        space.address, work.address, address_of(q0), address_of(q1), q0.shape[1], 0, len(q0), address_of(times)
    )
    return end, times, space, work


def test_motions_are_free_or_collide():
    end, times, _, work = motion(checker_of(collide.Sphere(0.1)), [[0.0], [0.0], [-1.0]], [[0.25], [1.0], [0.2]])
    assert end == 3 and np.isnan(times[[0, 2]]).all() and 0.3 <= times[1] <= 0.7
    assert len(work.open_intervals) == len(work.mesh_pairs) == 0 and work.n_checked >= 3


def test_a_motion_without_space_for_its_intervals_is_begun_again():
    """Grazing at a nanometre leaves one interval open, two motions two; the first without space has no time."""
    ball = [LinkShape(collide.Sphere(0.1), pose(t=(0, 0.2 + 1e-9, 0)), None, "test")]
    checker = checker_of(collide.Sphere(0.1), robot=slider(cart=ball))
    ends = [[0.25], [0.0], [0.3]], [[0.75], [-0.5], [0.7]]
    end, times, _, work = motion(checker, *ends)
    assert end == 3 and np.isnan(times).all() and work.open_intervals[:, 0].tolist() == [0.0, 2.0]
    assert work.open_intervals[:, 3:].tolist() == [[0.0, -1.0]] * 2
    end, times, _, work = motion(checker, *ends, capacity=1)
    assert end == 2 and np.isnan(times).all() and work.open_intervals[:, 0].tolist() == [0.0]
    before = work.header[motions.OPEN_INTERVAL_CAPACITY], work.header[motions.OPEN_INTERVALS_AT]
    work.grow()
    assert work.header[motions.OPEN_INTERVAL_CAPACITY] > before[0] == 1
    assert work.header[motions.MESH_PAIR_CAPACITY] == work.header[motions.OPEN_INTERVAL_CAPACITY] == len(work._open)


def test_meshes_of_a_motion_are_left_to_others_and_settled():
    checker = checker_of(LIDLESS)
    ends = np.array([[0.1], [-1.0]]), np.array([[0.9], [-0.5]])
    end, times, space, work = motion(checker, *ends, resolution=0.1)
    assert end == 2 and np.isnan(times).all() and set(work.mesh_pairs[:, 0].tolist()) == {0.0}
    settled = settle_meshes(checker, space, work, *ends, work.mesh_pairs.copy(), times, 0.1)
    assert 0.0 < times[0] < 1.0 and np.isnan(times[1])
    assert all(len(rows) == 0 or (rows[:, 0] == 0).all() for rows in settled)
    assert collide.RobotChecker(slider(), checker.world).collides(ends[0][0] + times[0] * (ends[1] - ends[0])[0])
    assert settle_meshes(checker, space, work, *ends, np.zeros((0, motions.OPEN_INTERVAL)), times, 1e-2) == []


def test_bounds_of_motions_are_of_the_half_interval_and_hold():
    """Points of a body against where they are in the middle: a chain of a turn, a slide and a turn."""
    rng = rng_of("bounds of motions")
    joints = [Joint("turn", "revolute", "base", "a", pose(t=(0, 0, 0.2)), (0, 0, 1.0)),
              Joint("slide", "prismatic", "a", "b", pose(t=(0.3, 0, 0)), (0, 1.0, 0)),
              Joint("bend", "continuous", "b", "c", pose(t=(0.2, 0, 0)), (0.6, 0, 0.8))]
    box = [LinkShape(collide.Box((0.2, 0.1, 0.3)), pose(t=(0.1, 0, 0)), None, "test")]
    robot = Robot("chain", ["base", "a", "b", "c"], joints, {"a": box, "c": box})
    checker = checker_of(collide.Sphere(0.1), robot=robot)
    space = space_of(checker)
    work = space.motions(1e-3)
    q0, q1 = rng.normal(size=(2, 20, 3))
    assert checker.bodies == ["c", "a"]
    corners = np.array([(0.1 + x, y, z, 1.0) for x in (-0.1, 0.1) for y in (-0.05, 0.05) for z in (-0.15, 0.15)])
    tightest = np.inf
    for begin, end in ((0.0, 1.0), (0.25, 0.5), (0.5, 0.5)):
        for body, link in ((0, 3), (1, 1)):
            rows = np.array([(k, begin, end, body, -1) for k in range(20)], dtype=float)
            answers = np.empty((20, 5))
            bound_motions(space.address, work.address, address_of(q0), address_of(q1), 3, address_of(rows), 20,
                          address_of(answers))
            bounds, middle = answers[:, 0], 0.5 * (begin + end)
            assert np.array_equal(answers[:, 1], np.abs(q1 - q0).max(axis=1) * (end - begin))
            assert np.array_equal(answers[:, 2:], q0 + middle * (q1 - q0))
            at_middle = robot.link_poses(q0 + middle * (q1 - q0))[:, link] @ corners.T
            moved = np.zeros(20)
            for t in np.linspace(begin, end, 33):
                there = robot.link_poses(q0 + t * (q1 - q0))[:, link] @ corners.T
                moved = np.maximum(moved, np.linalg.norm(there - at_middle, axis=1).max(axis=1))
            assert (bounds >= moved - 1e-12).all(), (begin, end, link)
            if begin < end:
                tightest = min(tightest, float((bounds / moved).min()))
            else:
                assert (bounds <= 1e-9).all()
    assert tightest < 3.0


def test_workspaces_of_motions_are_made_once_and_take_each_resolution():
    joints = [Joint("weld", "fixed", "base", "a", pose(t=(0, 0, 0.2)))]
    box = [LinkShape(collide.Box((0.2, 0.1, 0.3)), np.eye(4), None, "test")]
    checker = checker_of(collide.Sphere(0.1), robot=Robot("still", ["base", "a"], joints, {"a": box}))
    space = space_of(checker)
    work = space.motions(0.5)
    assert work.header[motions.RESOLUTION : motions.ROUNDING].view(np.float64).tolist() == [0.5]
    assert work.header[motions.PATH_STRIDE] == 1 and work.header[motions.ITEM_CAPACITY] == 15 * motions.MAX_INTERVALS
    work.header[motions.N_CHECKED] = 7
    assert space.motions(0.25) is work and work.n_checked == 0
    assert work.header[motions.RESOLUTION : motions.ROUNDING].view(np.float64).tolist() == [0.25]
    assert checker.certify_edges(np.zeros((2, 0)), np.zeros((2, 0))).free.all()
