"""Straight motions: what is said to be free has no collision anywhere, and what is between samples is not missed."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of
from random_robots import plain_link_poses, random_configurations, random_link_shape, random_robot

import collide
from collide.errors import InvalidArgument
from collide.robots import check_tables, check_workspace
from collide.robots.certified_edges import OPEN_DTYPE, CertifiedEdges, sampled_collision
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot


def scattered(rng, n: int) -> collide.World:
    world = collide.World()
    for k in range(n):
        world.add(random_link_shape(rng, 0.2), pose(t=rng.uniform(-0.7, 0.7, 3)), name=f"body{k}")
    return world


@pytest.mark.parametrize("seed", range(10))
def test_free_motions_have_no_sample_that_collides_and_times_do(seed):
    rng = rng_of("edges", seed)
    robot = random_robot(rng, n_links=5)
    checker = collide.RobotChecker(robot, scattered(rng, 25))
    Q0 = random_configurations(rng, robot, 60)
    Q0 = Q0[~checker.collides(Q0)][:20]
    Q1 = Q0 + rng.normal(size=Q0.shape)
    edges = checker.certify_edges(Q0, Q1)
    assert (edges.free.astype(int) + edges.collides + edges.is_open == 1).all()
    for k in np.flatnonzero(edges.free):
        ts = rng.random(300)[:, None]
        hits = checker.collides(Q0[k] + ts * (Q1[k] - Q0[k]))
        assert not hits.any(), f"seed {seed}, edge {k}: proven free, and hits at {ts[hits][:3].ravel().tolist()}"
    for k in np.flatnonzero(edges.collides):
        assert checker.collides(Q0[k] + edges.time[k] * (Q1[k] - Q0[k])), f"seed {seed}, edge {k}: {edges.time[k]}"
    assert set(edges.open["edge"]) == set(np.flatnonzero(edges.is_open))
    assert len(edges.open_names) == len(edges.open) and (edges.open["begin"] < edges.open["end"]).all()


def test_of_random_motions_most_are_decided_and_both_verdicts_come():
    free = collides = total = 0
    for seed in range(10):
        rng = rng_of("edges", seed)
        robot = random_robot(rng, n_links=5)
        checker = collide.RobotChecker(robot, scattered(rng, 25))
        Q0 = random_configurations(rng, robot, 60)
        Q0 = Q0[~checker.collides(Q0)][:20]
        edges = checker.certify_edges(Q0, Q0 + rng.normal(size=Q0.shape))
        free, collides, total = free + edges.free.sum(), collides + edges.collides.sum(), total + len(edges)
    assert total >= 100 and free >= 0.2 * total and collides >= 0.2 * total and free + collides >= 0.9 * total


@pytest.mark.parametrize("seed", range(40))
def test_a_speck_on_the_way_is_never_overlooked(seed):
    """A ball of a hundredth of a millimetre stands where a link's surface is at one moment of the motion."""
    rng = rng_of("specks", seed)
    robot = random_robot(rng, n_links=6, shape=lambda rng, size: collide.Sphere(size), size=0.05)
    robot.semantic_pairs = [(a, b, "test") for a in robot.links for b in robot.links if a < b]
    q0, q1 = random_configurations(rng, robot, 2)
    t = float(rng.uniform(0.02, 0.98))
    before, after = plain_link_poses(robot, q0), plain_link_poses(robot, q1)
    link = max(robot.links, key=lambda name: np.abs(after[name] - before[name]).max())
    element = robot.geometry[link][0]
    X_WG = plain_link_poses(robot, q0 + t * (q1 - q0))[link] @ element.X_LG
    direction = rng.normal(size=3)
    p = X_WG[:3, 3] + direction / np.linalg.norm(direction) * element.shape.radius
    world = collide.World()
    world.add(collide.Sphere(1e-5), pose(t=p), name="speck")
    edges = collide.RobotChecker(robot, world).certify_edges(q0, q1, resolution=1e-4)
    assert not edges.free[0], f"seed {seed}: the speck is met at t = {t}"


def pendulum(length: float = 1.0) -> Robot:
    """base -turn(z)-> rod, thin and long along x."""
    z_along_x = pose(np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]), (length / 2, 0, 0))
    rod = [LinkShape(collide.Capsule(0.001, length), z_along_x, None, "test")]
    turn = Joint("turn", "continuous", "base", "rod", np.eye(4), (0, 0, 1.0))
    return Robot("pendulum", ["base", "rod"], [turn], {"rod": rod})


def test_what_samples_miss_is_met():
    world = collide.World()
    world.add(collide.Sphere(0.001), pose(t=(0.9 * np.cos(0.505), 0.9 * np.sin(0.505), 0)), name="pin")
    checker = collide.RobotChecker(pendulum(), world)
    assert not checker.edge_collides([0.0], [1.0], resolution=0.02)[0]
    edges = checker.certify_edges([0.0], [1.0])
    assert edges.collides[0] and abs(edges.time[0] - 0.505) < 0.003
    assert checker.edge_collides([0.0], [1.0], resolution=0.002)[0]


def test_what_is_passed_closely_is_proven_and_what_is_grazed_stays_open():
    world = collide.World()
    pin = world.add(collide.Sphere(0.01), pose(t=(1.0135, 0.0, 0)), name="pin")
    checker = collide.RobotChecker(pendulum(), world)
    edges = checker.certify_edges([-1.0], [1.0])
    assert edges.free[0] and edges.n_checked < 400 and len(edges.open) == 0
    world.set_pose(pin, pose(t=(1.011 + 1e-9, 0.0, 0)))  # a nanometre away
    edges = checker.certify_edges([-1.0], [1.0], resolution=1e-2)
    assert edges.is_open[0] and edges.open_names == [("rod", "pin")] * len(edges.open)
    assert (edges.open["begin"] < 0.5).any() and (edges.open["end"] - edges.open["begin"] < 0.03).all()


def test_motions_that_stay_are_configurations():
    world = collide.World()
    world.add(collide.Sphere(0.1), pose(t=(0.5, 0.0, 0)), name="ball")
    checker = collide.RobotChecker(pendulum(), world)
    edges = checker.certify_edges([[0.0], [1.0]], [[0.0], [1.0]])
    assert edges.time[0] == 0.0 and edges.free.tolist() == [False, True]


def test_samples_are_no_farther_apart_than_asked():
    world = collide.World()
    world.add(collide.Sphere(0.006), pose(t=(0.9, 0.0, 0)), name="pin")
    checker = collide.RobotChecker(pendulum(), world)
    rng = rng_of("samples")
    start = rng.uniform(-2, 0, (200, 1))
    assert checker.edge_collides(start - 0.01, start + 2.01, resolution=0.014).all()
    assert checker.edge_collides(start - 0.01, start + 2.01, resolution=0.5).mean() < 0.5


def test_threads_give_the_same():
    rng = rng_of("threads of edges")
    robot = random_robot(rng, n_links=5)
    checker = collide.RobotChecker(robot, scattered(rng, 25))
    checker._count(10**6)  # spheres and maps, which prove other intervals, are there from the beginning
    Q = random_configurations(rng, robot, 2001)
    one, two = checker.certify_edges(Q[:-1], Q[1:], resolution=0.05), checker.certify_edges(
        Q[:-1], Q[1:], resolution=0.05, threads=2)
    for field in ("free", "time", "open"):
        assert getattr(one, field).tobytes() == getattr(two, field).tobytes()
    assert one.n_checked == two.n_checked


# --- samples --------------------------------------------------------------------------------------


def rail(*places: float, mesh: bool = False) -> collide.RobotChecker:
    """A point-like ball that slides along x by its single column, among others at these places."""
    joint = Joint("slide", "prismatic", "base", "cart", np.eye(4), (1.0, 0.0, 0.0), lower=-1e300, upper=1e300)
    ball = LinkShape(collide.Sphere(1e-3), np.eye(4), None, "test")
    world, small = collide.World(), collide.Mesh([(1e-3, 0, 0), (0, 1e-3, 0), (0, 0, 1e-3), (-1e-3, -1e-3, -1e-3)],
                                                 [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)], solid=False)
    for place in places:
        world.add(small if mesh else collide.Sphere(1e-3), pose(t=(place, 0, 0)))
    return collide.RobotChecker(Robot("rail", ["base", "cart"], [joint], {"cart": [ball]}), world)


def time_of(place: float, q0: float, q1: float, step: float, most: int | None = None, mesh: bool = False) -> float:
    checker = rail(place, mesh=mesh)
    return float(sampled_collision(checker, np.array([[q0]]), np.array([[q1]]), step, 1, most)[0])


@pytest.mark.parametrize("mesh", [False, True])
def test_samples_are_the_ends_then_the_middle_then_quarters(mesh):
    for place, time in ((0.0, 0.0), (8.0, 1.0), (4.0, 0.5), (2.0, 0.25), (6.0, 0.75), (1.0, 0.125), (7.0, 0.875)):
        assert time_of(place, 0.0, 8.0, 1.0, mesh=mesh) == time, place
        assert time_of(-place, 0.0, -8.0, 1.0, mesh=mesh) == time, place
    assert np.isnan([time_of(0.5, 0.0, 8.0, 1.0, mesh=mesh), time_of(8.1, 0.0, 8.0, 1.0, mesh=mesh)]).all()
    order, q0, q1 = (0.0, 8.0, 4.0, 2.0, 6.0, 1.0, 3.0, 5.0, 7.0), np.array([[0.0]]), np.array([[8.0]])
    for k, first in enumerate(order):  # of several hits the first in this order counts
        assert sampled_collision(rail(*order[k:], mesh=mesh), q0, q1, 1.0, 1)[0] == first / 8.0


def test_motions_are_halved_until_no_step_is_longer_than_asked():
    for step, halvings in ((1.0, 0), (0.5, 1), (0.49, 2), (2.0, 0), (0.25, 2), (0.125, 3)):
        for level in range(5):
            time = 0.5**level
            assert (time_of(-time, 0.0, -1.0, step) == time) == (level <= halvings), (step, level)
    for most in range(3):
        assert [time_of(0.5**k, 0.0, 1.0, 1e-3, most) == 0.5**k for k in range(4)] == [k <= most for k in range(4)]
    assert np.isnan(time_of(1.0, 0.0, 1e300, 1e-300, 0))  # a quotient beyond the doubles


def test_the_last_sample_is_the_end_itself():
    """From −0.9 to −0.3, a + 1.0 · (b − a) is another double than b: a wall that ends in between is met by b alone."""
    a, b = -0.9, -0.3
    assert a + 1.0 * (b - a) != b
    low, high = sorted((b, a + 1.0 * (b - a)))
    sign = 1.0 if b == high else -1.0
    wall = collide.Halfspace((-sign, 0, 0), -sign * high) if sign > 0 else collide.Halfspace((1, 0, 0), low)
    point = LinkShape(collide.ConvexHull([(0.0, 0.0, 0.0)]), np.eye(4), None, "test")
    joint = Joint("slide", "prismatic", "base", "cart", np.eye(4), (1.0, 0.0, 0.0), lower=-9.0, upper=9.0)
    world = collide.World()
    world.add(wall)
    checker = collide.RobotChecker(Robot("rail", ["base", "cart"], [joint], {"cart": [point]}), world)
    assert checker.collides([b]) and not checker.collides([a + 1.0 * (b - a)])
    begin = a if not checker.collides([a]) else 0.9
    assert sampled_collision(checker, np.array([[begin]]), np.array([[b]]), 1.0, 1).tolist() == [1.0]


def test_of_many_motions_each_has_its_own_time():
    q0, q1 = np.array([[4.0], [0.0], [0.0], [9.0]]), np.array([[0.0], [4.0], [8.0], [9.5]])
    for mesh in (False, True):
        times = sampled_collision(rail(4.0, mesh=mesh), q0, q1, 4.0, 1)
        assert times.tolist()[:3] == [0.0, 1.0, 0.5] and np.isnan(times[3])
    assert sampled_collision(rail(1.0), np.zeros((0, 1)), np.zeros((0, 1)), 1.0, 1).shape == (0,)


def test_samples_left_to_others_go_on_where_space_ended(monkeypatch):
    """The hull of a mesh around the way is met by every sample, the mesh by none but the last asked."""
    corners = np.array([(x, y, z) for x in (-40.0, 40.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    sides = [(0, 1, 3), (0, 3, 2), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 3, 7), (2, 7, 6)]
    monkeypatch.setattr(check_tables.SpareRows, "of", lambda objects: check_tables.SpareRows(0, 0, 0))
    checker = rail()
    checker.world.add(collide.Mesh(corners, sides, solid=False), name="tunnel")
    checker.world.add(collide.Sphere(1e-3), pose(t=(31.0 / 32.0 * 16.0, 0, 0)))
    monkeypatch.setattr(check_workspace, "_LEAST_OPEN", 3)
    q0, q1 = np.array([[0.0], [0.0], [-16.0]]), np.array([[16.0], [8.0], [0.0]])
    times = sampled_collision(checker, q0, q1, 0.5, 1)
    assert times[0] == 31.0 / 32.0 and np.isnan(times[1:]).all()
    assert len(checker._workspace(checker.setting)._open) < 16


def test_more_samples_than_can_be_asked_are_refused_with_the_motion():
    q0, q1 = np.zeros((3, 1)), np.array([[1.0], [-(2.0**30) * 1.5], [2.0]])
    with pytest.raises(InvalidArgument, match=r"motion 1 changes a column by 1\.61061e\+09 .* more than 2\^30 samples"):
        sampled_collision(rail(), q0, q1, 1.0, 1)
    # 2^30 samples may be asked; the first is a hit
    assert sampled_collision(rail(0.0), q0[:1], np.array([[2.0**30]]), 1.0, 1).tolist() == [0.0]


# --- results --------------------------------------------------------------------------------------


def test_every_motion_is_free_or_collides_or_is_open():
    time = np.array([np.nan, 0.0, np.nan, 1.0])
    edges = CertifiedEdges(np.array([True, False, False, False]), time, np.zeros(2, OPEN_DTYPE), [("a", "b")] * 2, 7)
    assert edges.collides.tolist() == [False, True, False, True]
    assert edges.is_open.tolist() == [False, False, True, False]
    assert len(edges) == 4
    assert repr(edges) == "CertifiedEdges(4 motions: 1 proven free, 2 collide, 1 open)"


def test_intervals_that_stay_open_are_in_order_and_name_their_motion():
    """Of four motions two graze a pin by a nanometre, one collides, one is free: numbers are those of the four."""
    world = collide.World()
    world.add(collide.Sphere(0.01), pose(t=(1.011 + 1e-9, 0.0, 0)), name="pin")
    world.add(collide.Sphere(0.1), pose(t=(-0.5, 0.0, 0)), name="post")
    checker = collide.RobotChecker(pendulum(), world)
    edges = checker.certify_edges([[0.9], [-1.0], [2.9], [-0.9]], [[1.0], [1.0], [3.5], [1.0]], resolution=1e-2)
    assert edges.free.tolist() == [True, False, False, False] and edges.is_open.tolist() == [False, True, False, True]
    assert edges.collides.tolist() == [False, False, True, False]
    assert sorted(set(edges.open["edge"].tolist())) == [1, 3]
    places = list(zip(edges.open["edge"].tolist(), edges.open["begin"].tolist()))
    assert places == sorted(places) and set(edges.open_names) == {("rod", "pin")}
    one = checker.certify_edges([0.9], [1.0])
    assert one.n_checked >= 1 and one.free.tolist() == [True] and one.open.dtype == OPEN_DTYPE


def test_no_motions_at_all():
    edges = collide.RobotChecker(pendulum(), collide.World()).certify_edges(np.zeros((0, 1)), np.zeros((0, 1)))
    assert len(edges) == len(edges.open) == edges.n_checked == 0
    assert repr(edges) == "CertifiedEdges(0 motions: 0 proven free, 0 collide, 0 open)"


def test_links_that_cannot_be_told_apart_are_both_named():
    """Two sliders side by side with 1e-9 m between them: a pair of the robot, not of what is around."""
    block = [LinkShape(collide.Box((1.0, 1.0, 1.0)), np.eye(4), None, "test")]
    joints = [Joint(name, "prismatic", "base", name, pose(t=(0, y, 0)), (1.0, 0, 0))
              for name, y in (("left", 0.0), ("right", 1.0 + 1e-9))]
    robot = Robot("pair", ["base", "left", "right"], joints, {"left": block, "right": block})
    edges = collide.RobotChecker(robot).certify_edges([[-3.0, 0.0]], [[3.0, 0.0]], resolution=1e-2)
    assert edges.is_open[0] and set(edges.open_names) == {("right", "left")}
    assert edges.open["begin"][0] <= 0.34 and edges.open["end"][-1] >= 0.66


@pytest.mark.parametrize("space", [0, 1, 2])
def test_intervals_that_more_pairs_leave_open_than_there_is_space_for_are_named(space, monkeypatch):
    """Of sliders side by side two pairs cannot be told apart, and the lists of pairs have too little space."""
    monkeypatch.setattr(check_workspace, "_MAX_ITEMS", space)
    block = [LinkShape(collide.Box((1.0, 1.0, 1.0)), np.eye(4), None, "test")]
    links = {"far": 100.0, "farther": 200.0, "left": -1.0 - 1e-9, "middle": 0.0, "right": 1.0 + 1e-9}
    joints = [Joint(name, "prismatic", "base", name, pose(t=(0, y, 0)), (1.0, 0, 0)) for name, y in links.items()]
    robot = Robot("three", ["base", *links], joints, dict.fromkeys(links, block))
    q = np.array([[0.0, 0.0, 0.0, 3.0, 0.0]])
    edges = collide.RobotChecker(robot).certify_edges(-q, q, resolution=1e-2)
    assert edges.is_open[0] and {frozenset(names) for names in edges.open_names} <= {
        frozenset(("left", "middle")), frozenset(("middle", "right"))
    }
    assert edges.open["begin"].min() <= 0.34 and edges.open["end"].max() >= 0.66
