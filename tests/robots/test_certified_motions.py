"""Paths and splines: what is said to be free has no collision anywhere, what is between samples is not missed, and of
collisions the earliest is told."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of, rotation
from random_robots import any_pair_hits, plain_link_poses, random_configurations, random_link_shape, random_robot
from random_splines import KINDS, random_spline

import collide
from collide.errors import InvalidArgument
from collide.kernels import address_of
from collide.robots.certified_motions import CertifiedMotion, wrapping_columns
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.kinematic_tree import Joint, Mimic
from collide.robots.motion_bounds import OPEN_INTERVAL, bound_motions
from collide.robots.robot import LinkShape, Robot


def scattered(rng, n: int) -> collide.World:
    world = collide.World()
    for k in range(n):
        world.add(random_link_shape(rng, 0.2), pose(t=rng.uniform(-0.7, 0.7, 3)), name=f"body{k}")
    return world


def pendulum(kind: str = "continuous", limit: float = np.inf) -> Robot:
    """base -turn(z)-> rod, thin and a metre long along x."""
    z_along_x = pose(np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]), (0.5, 0, 0))
    rod = [LinkShape(collide.Capsule(0.001, 1.0), z_along_x, None, "test")]
    turn = Joint("turn", kind, "base", "rod", np.eye(4), (0, 0, 1.0), -limit, limit)
    return Robot("pendulum", ["base", "rod"], [turn], {"rod": rod})


def pin_at(angle: float, radius: float = 0.001, distance: float = 0.9) -> collide.World:
    world = collide.World()
    world.add(collide.Sphere(radius), pose(t=(distance * np.cos(angle), distance * np.sin(angle), 0)), name="pin")
    return world


# --- against samples ------------------------------------------------------------------------------


def proven_at(result: CertifiedMotion, t: np.ndarray) -> np.ndarray:
    """(n,) bool: times said to be free of collisions."""
    segment = np.clip(np.searchsorted(result.breaks, t, "right") - 1, 0, len(result) - 1)
    is_before = ~(t >= result.time[segment])
    is_open = ((result.open["begin"] <= t[:, None]) & (t[:, None] <= result.open["end"])).any(axis=1)
    return is_before & ~is_open


def setting_of(seed: int):
    rng = rng_of("splines of robots", seed)
    robot = random_robot(rng, n_links=5)
    checker = collide.RobotChecker(robot, scattered(rng, 25))
    Q = random_configurations(rng, robot, 60)
    return rng, checker, Q[~checker.collides(Q)][:8]


@pytest.mark.many(3)
@pytest.mark.parametrize("seed", range(12))
def test_free_times_of_splines_have_no_sample_that_collides_and_collisions_do(seed):
    rng, checker, Q = setting_of(seed)
    for q in Q:
        spline = random_spline(rng, q)
        result = checker.certify_spline(spline)
        assert (result.free.astype(int) + result.collides + result.is_open == 1).all()
        t = rng.uniform(spline.breaks[0], spline.breaks[-1], 200)
        t = t[proven_at(result, t)]
        hits = any_pair_hits(checker, spline(t))
        assert not hits.any(), f"seed {seed}, {spline}: proven free, and hits at {t[hits][:3].tolist()}"
        for time in result.time[result.collides]:
            near = spline(np.clip(time + 1e-9 * np.array([-1, 0, 1]), spline.breaks[0], spline.breaks[-1]))
            assert any_pair_hits(checker, near).any(), f"seed {seed}, {spline}: {time}"


def test_of_random_splines_most_are_decided_and_all_verdicts_come():
    free = collides = total = 0
    kinds = dict.fromkeys(KINDS, 0)
    for seed in range(12):
        rng, checker, Q = setting_of(seed)
        for q in Q:
            kind = str(rng.choice(KINDS))
            result = checker.certify_spline(random_spline(rng, q, kind=kind))
            free, collides, total = free + result.is_free, collides + (result.first is not None), total + 1
            kinds[kind] += result.is_free
    assert total >= 60 and free >= 0.15 * total and collides >= 0.2 * total and free + collides >= 0.9 * total
    assert min(kinds.values()) >= 1, kinds


@pytest.mark.parametrize("seed", range(40))
def test_a_speck_on_the_way_of_a_spline_is_never_overlooked(seed):
    """A ball of a hundredth of a millimetre stands where a link's surface is at one moment: between any two samples."""
    rng = rng_of("specks of splines", seed)
    robot = random_robot(rng, n_links=6, shape=lambda rng, size: collide.Sphere(size), size=0.05)
    robot.semantic_pairs = [(a, b, "test") for a in robot.links for b in robot.links if a < b]
    spline = random_spline(rng, random_configurations(rng, robot, 1)[0])
    t = float(rng.uniform(spline.breaks[0], spline.breaks[-1]))
    begin, at = (plain_link_poses(robot, spline(time)) for time in (spline.breaks[0], t))
    link = max(robot.links, key=lambda name: np.abs(at[name] - begin[name]).max())
    element = robot.geometry[link][0]
    direction = rng.normal(size=3)
    p = (at[link] @ element.X_LG)[:3, 3] + direction / np.linalg.norm(direction) * element.shape.radius
    world = collide.World()
    world.add(collide.Sphere(1e-5), pose(t=p), name="speck")
    result = collide.RobotChecker(robot, world).certify_spline(spline, resolution=1e-4)
    segment = int(np.clip(np.searchsorted(spline.breaks, t, "right") - 1, 0, len(spline) - 1))
    assert not result.free[segment], f"seed {seed}: the speck is met at t = {t}"
    assert not result.is_free and result.share < 1.0


def test_a_graze_at_one_instant_is_between_all_samples_and_not_free():
    """A quintic turns back at its largest angle, 5 µrad past a pin's edge: no sampling at 2,000 places sees it."""
    checker = collide.RobotChecker(pendulum(), pin_at(0.0))
    reach = 0.001 / 0.9 + np.arcsin(0.001 / 0.9)
    spline = collide.Spline.min_jerk([[1.0], [reach - 5e-6], [1.0]])
    t = np.concatenate([np.linspace(0, 0.95, 1000), np.linspace(1.05, 2, 1000)])
    assert not checker.collides(spline(t)).any()
    result = checker.certify_spline(spline)
    assert result.first is not None and abs(result.first[1] - 1.0) < 0.05 and not result.is_free
    free = checker.certify_spline(collide.Spline.min_jerk([[1.0], [reach + 1e-3], [1.0]]))
    assert free.is_free and free.share == 1.0 and free.first is None and len(free.open) == 0


# --- bounds ---------------------------------------------------------------------------------------


@pytest.mark.many(3)
@pytest.mark.parametrize("seed", range(10))
def test_bounds_of_curves_and_cells_hold_for_points_of_all_bodies(seed):
    """Corners of bodies against where they are in the middle, robots with planar, floating and mimicking joints."""
    rng = rng_of("bounds of curves", seed)
    robot = random_robot(rng, n_links=5, shape=lambda rng, size: collide.Box(2 * size * rng.uniform(0.3, 1, 3)))
    checker = collide.RobotChecker(robot, scattered(rng, 1))
    spline = random_spline(rng, random_configurations(rng, robot, 1)[0], kind="bezier")
    points = spline.control_points
    low, high = points[0].min(axis=0), points[0].max(axis=0)
    hits = np.zeros((1, robot.dof))
    slack = []
    for is_cell in (False, True):
        space = CheckWorkspace(robot, checker.setting)
        work = space.motions(1e-9)
        if is_cell:
            work.ask_about_boxes(hits, 10)
        else:
            work.ask_about_curves(spline.degree)
        first, second = (low, high) if is_cell else (points, spline.errors)
        for body, name in enumerate(checker.bodies):
            begin, end = np.sort(rng.uniform(0, 1, 2)).tolist()
            row = np.array([[0.0, begin, end, body, -1.0, *((*low, *high) if is_cell else ())]])
            assert row.shape[1] == OPEN_INTERVAL + (2 * robot.dof if is_cell else 0)
            answers = np.empty((1, robot.dof + 2))
            bound_motions(
                space.address, work.address, address_of(np.ascontiguousarray(first)),
                address_of(np.ascontiguousarray(second)), robot.dof, address_of(row), 1, address_of(answers),
            )
            bound, width, middle = answers[0, 0], answers[0, 1], answers[0, 2:]
            if is_cell:
                q = rng.uniform(low, high, (50, robot.dof))
                q[:25] = np.where(rng.random((25, robot.dof)) < 0.5, low, high)
                assert np.allclose(middle, 0.5 * (low + high), atol=1e-15) and width in (0.0, (high - low).max())
                assert width > 0.0 or row[0, 1] == -1.0
            else:
                begins, length = spline.breaks[0], spline.breaks[1] - spline.breaks[0]
                q = spline(begins + length * np.linspace(begin, end, 50))
                assert np.allclose(middle, spline(begins + length * 0.5 * (begin + end)), atol=1e-12)
                assert (2.0 * np.abs(q - middle).max() <= width + 1e-12)
            element = robot.geometry[name][0]
            corners = element.X_LG @ np.array([(*(0.5 * np.array(s) * element.shape.size), 1.0) for s in
                                               np.ndindex(2, 2, 2) for s in [2 * np.array(s) - 1]]).T
            stood = plain_link_poses(robot, middle)[name]
            shifts = np.array([plain_link_poses(robot, at)[name] - stood for at in q]) @ corners
            moved = float(np.linalg.norm(shifts[:, :3], axis=1).max())
            assert bound >= moved - 1e-12, f"seed {seed}, {name}, cell {is_cell}: moved {moved}, bound {bound}"
            if moved > 1e-3:
                slack.append(bound / moved)
    assert slack and min(slack) < 4.0, f"bounds are loose: {slack}"


# --- verdicts of the whole ------------------------------------------------------------------------


def test_the_earliest_collision_is_told_and_what_lies_before_is_proven():
    checker = collide.RobotChecker(pendulum(), pin_at(0.505))
    path = np.array([[0.0], [0.2], [0.8], [0.4]])
    result = checker.certify_path(path, resolution=1e-4)
    contact = 0.505 - np.arcsin(0.002 / 0.9)
    assert result.free.tolist() == [True, False, False] and result.collides.tolist() == [False, True, True]
    segment, time = result.first
    assert segment == 1 and 0 <= time - (1 + (contact - 0.2) / 0.6) < 1e-3
    assert result.proven[0] == 1.0 and abs(result.proven[1] - (time - 1)) < 1e-3
    assert abs(result.share - (0.2 + result.proven[1] * 0.6 + result.proven[2] * 0.4) / 1.2) < 1e-12
    assert (result.open["end"] <= result.time[result.open["edge"]]).all()
    timed = checker.certify_path(path, [0.0, 10.0, 11.0, 12.0], resolution=1e-4)
    assert timed.first[0] == 1 and abs(timed.first[1] - 10 - (time - 1)) < 1e-9
    assert abs(timed.share - (10 + timed.proven[1] + timed.proven[2]) / 12) < 1e-12
    assert "collides at" in repr(timed) and "3 segments: 1 proven free, 2 collide, 0 open" in repr(timed)


def test_a_path_agrees_with_its_edges():
    rng = rng_of("paths and edges")
    free = collides = 0
    for seed in range(6):
        robot = random_robot(rng, n_links=4)
        checker = collide.RobotChecker(robot, scattered(rng, 12))
        Q = random_configurations(rng, robot, 25)
        path, edges = checker.certify_path(Q, resolution=1e-3), checker.certify_edges(Q[:-1], Q[1:])
        assert np.array_equal(path.free, edges.free) and np.array_equal(path.collides, edges.collides), seed
        both = edges.collides
        assert (path.time[both] - np.arange(24)[both] <= edges.time[both] + 1e-9).all()
        free, collides = free + edges.free.sum(), collides + both.sum()
    assert free >= 10 and collides >= 20


def test_what_begins_in_a_collision_collides_at_once_and_what_grazes_stays_open():
    checker = collide.RobotChecker(pendulum(), pin_at(0.0))
    result = checker.certify_path([[0.0], [1.0]])
    assert result.first == (0, 0.0) and result.share == 0.0
    world = pin_at(0.0, radius=0.01, distance=1.011 + 1e-9)  # a nanometre from the tip
    result = collide.RobotChecker(pendulum(), world).certify_spline(
        collide.Spline.min_jerk([[-1.0], [1.0]]), resolution=1e-2
    )
    assert result.is_open.tolist() == [True] and result.open_names == [("rod", "pin")] * len(result.open)
    assert 0.9 < result.share < 1.0 and (result.open["begin"] <= 0.5).any()


def test_threads_and_resolution_of_roundings_end():
    rng = rng_of("threads of splines")
    robot = random_robot(rng, n_links=5)
    checker = collide.RobotChecker(robot, scattered(rng, 25))
    Q = random_configurations(rng, robot, 1200)
    one, two = (checker.certify_path(Q, resolution=0.05, threads=k) for k in (1, 2))
    for field in ("free", "time", "open"):
        assert getattr(one, field).tobytes() == getattr(two, field).tobytes()
    assert one.n_checked == two.n_checked
    world = pin_at(0.0, radius=0.01, distance=1.011)  # touches at one instant
    result = collide.RobotChecker(pendulum(), world).certify_path([[-30.0], [30.0]], resolution=1e-300)
    assert not result.is_free and result.n_checked < 10_000_000


def ring() -> collide.Mesh:
    """A square frame across z, 2 m wide with a hole of 1 m: its hull fills the hole."""
    outer, inner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]), 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = np.array([(*xy, z) for z in (-0.05, 0.05) for xy in (*outer, *inner)], dtype=float)
    quads = []
    for k in range(4):
        j = (k + 1) % 4
        quads += [(k, 4 + k, 4 + j, j), (8 + k, 8 + j, 12 + j, 12 + k)]
        quads += [(k, j, 8 + j, 8 + k), (4 + k, 12 + k, 12 + j, 4 + j)]
    return collide.Mesh(corners, [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])


@pytest.mark.parametrize("seed", range(8))
def test_free_times_among_meshes_have_no_sample_that_collides(seed):
    """Links of all kinds among frames and open tubes, splines and boxes: swept, curved and flat parts beside facets."""
    rng = rng_of("splines among meshes", seed)
    frame = collide.Mesh(0.25 * ring().vertices, ring().faces)
    square = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    tube = 0.2 * np.array([(x, y, z) for z in (-1, 1) for x, y in square], dtype=float)
    sides = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    pipe = collide.Mesh(tube, [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])
    world = collide.World()
    for k in range(10):
        world.add((frame, pipe)[k % 2], pose(rotation(rng), rng.uniform(-0.7, 0.7, 3)), name=f"body{k}")
    kinds = [lambda rng, size: collide.Capsule(0.3 * size, size), lambda rng, size: collide.Sphere(size), None]
    Q, n_free = np.zeros((0, 0)), 0
    while len(Q) < 5:  # of some robots no configuration is free
        robot = random_robot(rng, n_links=4, shape=kinds[seed % 3])
        checker = collide.RobotChecker(robot, world)
        Q = random_configurations(rng, robot, 60)
        Q = Q[~checker.collides(Q)][:5]
    for q in Q:
        spline = random_spline(rng, q)
        result = checker.certify_spline(spline, resolution=5e-3)
        t = rng.uniform(spline.breaks[0], spline.breaks[-1], 200)
        t = np.concatenate([t, spline.breaks[:-1], (result.time - 1e-3)[result.collides]]).clip(*spline.breaks[[0, -1]])
        t = t[proven_at(result, t)]
        hits = any_pair_hits(checker, spline(t))
        assert not hits.any(), f"seed {seed}, {spline}: proven free, and hits at {t[hits][:3].tolist()}"
        n_free += len(t)
        width = rng.uniform(0.0, 0.2, q.shape)
        boxes = checker.certify_boxes(q - width, q + width, resolution=0.02, max_cells=100)
        if boxes.free[0]:
            ends = np.sign(rng.normal(size=(150, len(q)))) * (rng.random((150, len(q))) < 0.7)
            hits = any_pair_hits(checker, q + width * ends)
            assert not hits.any(), f"seed {seed}: a free box around {q.tolist()} collides"
    assert n_free >= 50


def test_meshes_of_curves_are_proven_by_their_own_distances():
    """A rod goes through a ring along an arc; a higher arc meets the ring, and the earliest time is told."""
    world = collide.World()
    world.add(ring(), name="ring")
    joints = [Joint("slide", "prismatic", "base", "rod", np.eye(4), (0, 0, 1.0), -2.0, 2.0),
              Joint("shift", "prismatic", "rod", "tip", np.eye(4), (1.0, 0, 0), -2.0, 2.0)]
    rod = [LinkShape(collide.Capsule(0.1, 0.4), np.eye(4), None, "test")]
    checker = collide.RobotChecker(Robot("rod", ["base", "rod", "tip"], joints, {"tip": rod}), world)
    free = checker.certify_spline(collide.Spline.bezier([[-1.0, 0.7], [0.0, -0.1], [1.0, 0.7]]))
    assert free.is_free
    spline = collide.Spline.bezier([[-1.0, 0.0], [0.0, 1.6], [1.0, 0.0]])
    hit = checker.certify_spline(spline, resolution=1e-3)
    t = np.linspace(0, 1, 20001)
    first = t[checker.collides(spline(t))][0]
    assert hit.first is not None and abs(hit.first[1] - first) < 2e-3
    assert proven_at(hit, np.array([0.5 * first]))[0]


def test_flush_boxes_that_doubles_cannot_decide_are_met_at_their_contact():
    """Equal cubes in one row: faces beside each other lie in common planes at all times."""
    block = [LinkShape(collide.Box((0.2, 0.2, 0.2)), np.eye(4), None, "test")]
    slide = Joint("slide", "prismatic", "base", "cart", np.eye(4), (1.0, 0, 0))
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(0.7, 0, 0)), name="post")
    checker = collide.RobotChecker(Robot("cart", ["base", "cart"], [slide], {"cart": block}), world)
    for motion in (collide.Spline.straight([[0.0], [0.9]]), collide.Spline.min_jerk([[0.0], [0.9]])):
        result = checker.certify_spline(motion, resolution=1e-4)
        assert result.first is not None and 0.0 <= motion(result.first[1])[0] - 0.5 < 1e-3, result
        assert result.proven[0] * 0.9 < 0.5 or motion.degree > 1
    boxes = checker.certify_boxes([[0.0], [0.4], [0.55]], [[0.49], [0.6], [0.6]])
    assert boxes.free.tolist() == [True, False, False] and boxes.collides.tolist() == [False, True, True]


# --- shortest ways --------------------------------------------------------------------------------


def test_continuous_joints_go_the_short_way_and_others_do_not():
    checker = collide.RobotChecker(pendulum(), pin_at(0.0, radius=0.05))
    long, short = checker.certify_edges([3.0], [-3.0]), checker.certify_edges([3.0], [-3.0], wrap=True)
    assert long.collides[0] and short.free[0]
    assert checker.edge_collides([3.0], [-3.0])[0] and not checker.edge_collides([3.0], [-3.0], wrap=True)[0]
    path = checker.certify_path([[2.0], [3.0], [-3.0], [-2.0], [2.0 + 20 * np.pi]], wrap=True)
    assert path.is_free and path.lengths.max() < 2.3
    assert not checker.certify_path([[2.0], [3.0], [-3.0]]).is_free
    limited = collide.RobotChecker(pendulum("revolute", 3.1), pin_at(0.0, radius=0.05))
    assert limited.certify_edges([3.0], [-3.0], wrap=True).collides[0]
    with pytest.raises(InvalidArgument, match="wrap must be True or False"):
        checker.certify_edges([3.0], [-3.0], wrap="yes")


def test_columns_wrap_where_a_turn_changes_no_pose():
    rng, seen = rng_of("wrapping"), 0
    for _ in range(40):
        robot = random_robot(rng, n_links=6)
        wraps = wrapping_columns(robot)
        q = random_configurations(rng, robot, 1)[0]
        for k in np.flatnonzero(wraps):
            turned = q.copy()
            turned[k] += 2 * np.pi
            assert np.allclose(robot.link_poses(q), robot.link_poses(turned), atol=1e-12), robot.joint_names[k]
        for k in np.flatnonzero(~wraps):
            name = robot.joint_names[k]
            joint = next(j for j in robot.joints if name.split("/")[0] == j.name)
            is_followed = any(j.mimic is not None for j in robot.joints)
            assert joint.type in ("revolute", "prismatic") or name.endswith(("/x", "/y", "/z")) or is_followed
        seen += wraps.sum()
    assert seen >= 40
    slide = Joint("slide", "prismatic", "rod", "tip", np.eye(4), (1.0, 0, 0), mimic=Mimic("turn", 0.1, 0.0))
    base = pendulum()
    screw = Robot("screw", ["base", "rod", "tip"], [*base.joints, slide], base.geometry)
    assert wrapping_columns(base).tolist() == [True] and wrapping_columns(screw).tolist() == [False]


# --- what is refused ------------------------------------------------------------------------------


def test_bad_motions_are_refused_by_name():
    checker = collide.RobotChecker(pendulum("revolute", 3.0), pin_at(0.0))
    for ask, words in (
        (lambda: checker.certify_spline(collide.Spline.straight(np.zeros((2, 3)))), "1 columns, one for each.*; got 3"),
        (lambda: checker.certify_spline("here to there"), "must be a collide.Spline"),
        (lambda: checker.certify_path([[0.0], [90.0]]), "joint turn reaches 90 rad, 14 turns.*are these degrees"),
        (lambda: checker.certify_spline(collide.Spline.straight([[0.0], [-90.0]])), "are these degrees"),
        (lambda: checker.certify_path([[0.0], [1.0]], resolution=0.0), "certify_path: resolution must be a positive"),
        (lambda: checker.certify_path([0.0]), "two waypoints or more, got"),
        (lambda: checker.certify_path([[0.0], [1.0]], [0.0, 0.0]), "times must increase"),
        (lambda: checker.certify_path([[0.0], [np.nan]]), "joint turn, is nan"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            ask()
    assert not collide.RobotChecker(pendulum(), pin_at(0.0)).certify_path([[1.0], [90.0]]).is_free  # may turn so far
