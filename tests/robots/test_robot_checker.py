"""Configurations checked many at a time against pairs asked one by one."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import random_configurations, random_link_shape, random_robot

import collide
from collide.errors import InvalidArgument
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot

BRICK = collide.Mesh(*collide.tessellate(collide.Box((0.2, 0.1, 0.15))))


def dented() -> collide.Mesh:
    """A solid mesh that is not convex: a star-shaped surface with dents."""
    ball = collide.tessellate(collide.Sphere(0.12), size=0.05)
    scale = np.where(np.arange(len(ball.vertices)) % 3 == 0, 0.6, 1.0)[:, None]
    return collide.Mesh(ball.vertices * scale, ball.faces)


def random_world(rng, n: int, meshes: bool = False) -> collide.World:
    world = collide.World()
    for k in range(n):
        shape = random_link_shape(rng, 0.25)
        if meshes and k % 3 == 0:
            shape = dented() if k % 2 else BRICK
        world.add(shape, random_pose(rng, 0.6), name=f"body{k}", static=bool(rng.random() < 0.5))
    return world


def pairs_to_test(checker) -> list[tuple]:
    """(shape, link, shape, link or None, X_WB or None, name, name) of what is to be tested, found again from robot and
    World."""
    robot, world = checker.robot, checker.world
    disabled = {frozenset(pair[:2]) for pair in robot.disabled_pairs}
    links = [link for link in robot.links if link in robot.geometry]
    shape = {link: collide.Compound([(e.shape, e.X_LG) for e in robot.geometry[link]]) for link in links}
    pairs = []
    for k, a in enumerate(links):
        for b in links[k + 1 :]:
            if frozenset((a, b)) not in disabled:
                pairs.append((shape[a], a, shape[b], b, None))
        for body in map(world.body, world.ids):
            if not (body.static and a in robot.base_links):
                pairs.append((shape[a], a, body.shape, body.name, body.X_WB))
    return pairs


def asked_one_by_one(checker, Q, ask):
    """For each configuration, what ``ask`` says of every pair."""
    robot = checker.robot
    number = {link: k for k, link in enumerate(robot.links)}
    answers = []
    for X_WL in robot.link_poses(Q):
        answers.append([
            ask(A, B, X_WL[number[a]], X_WL[number[b]] if X_WB is None else X_WB)
            for A, a, B, b, X_WB in pairs_to_test(checker)
        ])
    return answers


@pytest.mark.parametrize("seed", range(12))
def test_equal_to_pairs_asked_one_by_one(seed):
    rng = rng_of("checker", seed)
    robot = random_robot(rng, n_links=5)
    checker = collide.RobotChecker(robot, random_world(rng, 8, meshes=seed % 3 == 0))
    Q = random_configurations(rng, robot, 25)
    hits = checker.collides(Q)
    expected = [any(pairs) for pairs in asked_one_by_one(checker, Q, collide.collide)]
    assert hits.tolist() == expected, f"seed {seed}"
    assert checker.n_pairs == len(pairs_to_test(checker))
    measured = checker.distances(Q, max_distance=0.5)
    nearest = [
        min(pairs) for pairs in asked_one_by_one(checker, Q, lambda *case: collide.distance(*case).distance)
    ]
    for k, least in enumerate(nearest):
        told = f"seed {seed}, q = {Q[k].tolist()}: {measured.distance[k]} and {least}"
        if least > 0.5:
            assert measured.beyond[k] and measured.names[k] is None, told
        elif least > 0.0:
            assert abs(measured.distance[k] - least) <= 1e-9 and not measured.hit[k], told
        else:
            assert measured.hit[k] and measured.distance[k] <= 0.0, told


def test_half_of_the_random_configurations_collide_and_half_do_not():
    shares = []
    for seed in range(12):
        rng = rng_of("checker", seed)
        robot = random_robot(rng, n_links=5)
        checker = collide.RobotChecker(robot, random_world(rng, 8, meshes=seed % 3 == 0))
        shares.append(checker.collides(random_configurations(rng, robot, 25)).mean())
    assert 0.2 < np.mean(shares) < 0.9


def test_threads_pieces_and_single_rows_give_the_same():
    rng = rng_of("threads of a checker")
    robot = random_robot(rng, n_links=6)
    checker = collide.RobotChecker(robot, random_world(rng, 12, meshes=True))
    Q = random_configurations(rng, robot, 3000)
    hits, seen = checker.collides(Q), []
    assert (checker.collides(Q, threads=2, progress=lambda done, n: seen.append((done, n))) == hits).all()
    assert seen[-1] == (3000, 3000) and len(seen) > 1
    assert [checker.collides(q) for q in Q[:50]] == hits[:50].tolist() and isinstance(checker.collides(Q[0]), bool)
    one, two = checker.distances(Q[:400]), checker.distances(Q[:400], threads=2)
    assert one.rows.tobytes() == two.rows.tobytes() and one.gradient.tobytes() == two.gradient.tobytes()
    assert len(checker.collides(np.zeros((0, robot.dof)))) == 0


def slider(shape=None, **geometry) -> Robot:
    """base -slide(x)-> cart."""
    ball = [LinkShape(shape or collide.Sphere(0.1), np.eye(4), None, "test")]
    joints = [Joint("slide", "prismatic", "base", "cart", np.eye(4), (1.0, 0, 0), -1.0, 1.0)]
    return Robot("slider", ["base", "cart"], joints, {"cart": ball, **geometry})


def test_padding_swells_against_the_surroundings_alone():
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall", static=True)
    ball = [LinkShape(collide.Sphere(0.1), pose(t=(-0.5, 0, 0)), None, "test")]
    robot = slider(base=ball)
    robot.semantic_pairs = ()  # base and cart are tested
    q = np.array([[0.75], [0.85], [-0.25], [-0.31]])
    assert collide.RobotChecker(robot, world).collides(q).tolist() == [False, True, False, True]
    swollen = collide.RobotChecker(robot, world, padding=0.08)
    assert swollen.collides(q).tolist() == [True, True, False, True]
    assert abs(swollen.distances(q).distance[0] + 0.03) <= 1e-12
    assert collide.RobotChecker(robot, world, padding={"cart": 0.08}).collides(q).tolist() == [True, True, False, True]
    assert not collide.RobotChecker(robot, world, padding={"base": 0.08}).collides(q)[0]
    as_mesh = collide.RobotChecker(slider(dented()), world, padding=0.08)
    gap = collide.distance(dented(), collide.Box((0.2, 0.2, 0.2)), pose(t=(0.65, 0, 0)), pose(t=(1.0, 0, 0))).distance
    assert not as_mesh.collides([0.65]) and as_mesh.collides([0.72])
    assert abs(as_mesh.distances([0.65]).distance[0] - (gap - 0.08)) <= 1e-9


def test_attached_objects_move_with_their_link():
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall", static=True)
    tool = ("tool", "cart", collide.Box((0.4, 0.02, 0.02)), pose(t=(0.2, 0, 0)))
    checker = collide.RobotChecker(slider(), world, attached=[tool])
    assert checker.collides([[0.45], [0.55]]).tolist() == [False, True]
    assert checker.distances([0.45]).names == [("tool", "wall")]
    assert abs(checker.distances([0.45]).distance[0] - 0.05) <= 1e-12
    allowed = collide.RobotChecker(slider(), world, attached=[(*tool, ("wall",))])
    assert not allowed.collides([0.55]) and allowed.collides([0.95])
    assert not collide.RobotChecker(slider(), world, attached=[tool], allowed=[("tool", "wall")]).collides([0.55])


def test_the_world_is_seen_as_it_stands_at_each_call():
    world = collide.World()
    wall = world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall")
    checker = collide.RobotChecker(slider(), world)
    assert not checker.collides([0.0])
    world.set_pose(wall, pose(t=(0.1, 0, 0)))
    assert checker.collides([0.0])
    world.remove(wall)
    assert not checker.collides([0.0]) and checker.n_pairs == 0
    world.add(collide.Halfspace((1.0, 0, 0), -0.05), name="ground")
    assert checker.collides([0.0]) and not checker.collides([0.5])
    assert abs(checker.distances([0.5]).distance[0] - 0.45) <= 1e-12


def test_bodies_named_like_links_are_the_robot_itself():
    world = collide.World()
    world.add(collide.Sphere(0.1), name="cart")
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall", static=True)
    world.allow("cart", "wall", reason="said so")
    checker = collide.RobotChecker(slider(), world)
    assert checker.around == ["wall"] and checker.skipped == {"said so": 1} and not checker.collides([1.0])


def test_fixed_bases_are_not_tested_against_static_bodies():
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), name="stand", static=True)
    ball = [LinkShape(collide.Sphere(0.1), np.eye(4), None, "test")]
    robot = slider(base=ball)
    assert not collide.RobotChecker(robot, world).collides([0.5])
    assert collide.RobotChecker(robot, world, mobile=True).collides([0.5])


@pytest.mark.parametrize("seed", range(6))
def test_gradients_are_those_of_differences(seed):
    rng = rng_of("gradients", seed)
    robot = random_robot(rng, n_links=6)
    checker = collide.RobotChecker(robot, random_world(rng, 3))
    Q = random_configurations(rng, robot, 30)
    measured = checker.distances(Q)
    step, n_compared = 1e-6, 0
    for k, q in enumerate(Q):
        if measured.distance[k] < 1e-3:
            continue
        both = checker.distances(np.concatenate([q + step * np.eye(robot.dof), q - step * np.eye(robot.dof)]))
        if set(both.names) != {measured.names[k]}:
            continue
        differences = (both.distance[: robot.dof] - both.distance[robot.dof :]) / (2 * step)
        worst = np.abs(differences - measured.gradient[k]).max()
        assert worst <= 2e-4, f"seed {seed}, q = {q.tolist()}: gradient is off by {worst:.2e}"
        n_compared += 1
    assert n_compared >= 3


def test_explain_names_pairs_depths_limits_and_what_was_skipped():
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall", static=True)
    report = collide.RobotChecker(slider(), world).explain([1.05])
    assert report.collides and report.collisions[0][:2] == ("cart", "wall")
    assert abs(report.collisions[0].distance + 0.15) <= 1e-9
    text = str(report)
    assert "in collision" in text and "cart and wall" in text and "outside its limits" in text
    free = collide.RobotChecker(slider(), world).explain([0.75])
    assert not free.collides and "50 mm apart" in str(free)
    assert "nothing within" in str(collide.RobotChecker(slider(), world).explain([-1.0]))


def test_bad_arguments_are_named():
    robot, world, ball = slider(), collide.World(), collide.Sphere(0.1)
    checker = collide.RobotChecker(robot, world)
    for ask, words in (
        (lambda: checker.collides(np.zeros((2, 3))), r"slide.*\(2, 3\)"),
        (lambda: checker.collides([[0.0], [np.nan]]), r"q\[1\], joint slide"),
        (lambda: checker.explain([[0.0], [0.1]]), "one configuration"),
        (lambda: checker.edge_collides([0.0], [1.0], resolution=0.0), "resolution"),
        (lambda: checker.certify_edges(np.zeros((2, 1)), np.zeros((3, 1))), "2.*3"),
        (lambda: collide.RobotChecker("panda.urdf", world), "Robot"),
        (lambda: collide.RobotChecker(robot, robot), "World"),
        (lambda: collide.RobotChecker(Robot("bare", ["base"], []), world), "no collision geometry"),
        (lambda: collide.RobotChecker(robot, world, attached=[("tool", "hand", ball)]), "no link 'hand'"),
        (lambda: collide.RobotChecker(robot, world, attached=[("cart", "cart", ball)]), "used twice"),
        (lambda: collide.RobotChecker(robot, world, attached=[("tool", "cart", 3)]), "not a shape"),
        (lambda: collide.RobotChecker(robot, world, attached=[3]), "name, link, shape"),
        (lambda: collide.RobotChecker(robot, world, padding=-1.0), "padding"),
        (lambda: collide.RobotChecker(robot, world, padding={"hand": 0.1}), "hand"),
        (lambda: collide.RobotChecker(robot, world, allowed=[("cart", "wall")]), "wall"),
        (lambda: collide.RobotChecker(robot, world, allowed=["cart"]), "pairs of names"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            ask()
    assert checker.within_limits([[0.5], [1.5], [1.0 + 1e-12]]).tolist() == [True, False, True]


def test_there_is_space_for_all_that_one_configuration_leaves_to_others():
    """A link of a hundred parts within sixty meshes that are not convex: six thousand pairs of parts."""
    rng = rng_of("many parts")
    beads = collide.Compound([(collide.Sphere(0.001), pose(t=rng.uniform(-0.05, 0.05, 3))) for _ in range(100)])
    world, mesh = collide.World(), dented()
    for k in range(60):
        world.add(mesh, pose(t=(0.01 * (k % 6), 0.01 * (k // 6), 0)), name=f"mesh{k}")
    checker = collide.RobotChecker(slider(beads), world)
    assert checker.collides([[0.0], [1.0]]).tolist() == [True, False]
    measured = checker.distances([[0.0], [0.9]])
    assert measured.hit.tolist() == [True, False] and 0.5 < measured.distance[1] < 0.9
