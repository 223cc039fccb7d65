"""Configurations checked many at a time against pairs asked one by one."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import (
    asked_one_by_one,
    pairs_to_test,
    random_configurations,
    random_link_shape,
    random_robot,
    slider,
)

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


@pytest.mark.many(6)
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


def test_margins_of_bodies_around_count_as_in_the_world():
    """By a World that holds the links, too: it decides margins in integers. Every shape, padding besides; the walls
    stand so that half of the questions are within a digit or two of the margin."""
    n_hits = n_near = 0
    for seed in range(40):
        rng = rng_of("margins of a checker", seed)
        robot, world = slider(random_link_shape(rng, 0.2) if seed % 3 else dented()), collide.World()
        shape = (collide.Halfspace(rng.normal(size=3), 0.1), dented(), random_link_shape(rng, 0.3))[min(seed % 5, 2)]
        margin = float(rng.choice([0.05, 0.1, 1e-3, 1 / 3]))
        link = robot.geometry["cart"][0].shape
        X_WB = random_pose(rng, 0.3)
        X_WB[0, 3] += 0.8
        q = np.linspace(-1.0, 1.0, 9)[:, None]
        gaps = [collide.distance(link, shape, pose(t=(x, 0, 0)), X_WB) for x in q[:, 0]]
        k = int(np.argmin([abs(gap.distance - margin) for gap in gaps]))
        if gaps[k].distance > 0 and seed % 2:  # moved along the normal until the gap is the margin, but for rounding
            X_WB[:3, 3] += (margin - gaps[k].distance) * gaps[k].normal
        world.add(shape, X_WB, name="wall", margin=margin)
        padding = 0.02 if seed % 4 == 0 else 0.0
        checker = collide.RobotChecker(robot, world, padding=padding)
        expected = [
            collide.collide(link, shape, pose(t=(x, 0, 0)), X_WB, security_margin=margin + padding) for x in q[:, 0]
        ]
        told = f"seed {seed}: {link!r}, {shape!r}, {X_WB.tolist()}, margin {margin}, padding {padding}"
        assert checker.collides(q).tolist() == expected, told
        measured = checker.distances(q)
        for row, x, hit in zip(measured.rows, q[:, 0], expected):
            gap = collide.distance(link, shape, pose(t=(x, 0, 0)), X_WB)
            if gap.distance > 0:
                assert abs(row["distance"] - (gap.distance - margin - padding)) <= 1e-9, told
                apart = (row["point_b"] - row["point_a"]) @ row["normal"]
                assert abs(apart - row["distance"]) <= 1e-8, told
            n_near += abs(gap.distance - margin - padding) < 1e-12
            n_hits += hit
        edges = checker.certify_edges(q[:-1], q[1:])
        assert not (edges.free & (np.array(expected[:-1]) | np.array(expected[1:]))).any(), told
        report = checker.explain(q[k])
        assert report.collides == expected[k], told
    assert 60 < n_hits < 300 and n_near >= 8, (n_hits, n_near)


def test_margins_are_decided_to_the_last_digit():
    """By fractions: sums of radius and margin, offset and margin are no doubles here, and a digit decides."""
    ball, plane = collide.Sphere(0.1), collide.Halfspace((-1.0, 0, 0), -1.0)
    beside = np.spacing(0.125) * np.arange(-3, 4)
    cases = [  # half of the link, columns of q, shape, its x, where it begins, margin
        (0.25, beside - 0.25, ball, 0.30000000000000004, Fraction(0.30000000000000004) - Fraction(0.1), 0.2),
        (0.75, 0.15 + beside, plane, 0.0, Fraction(1), 0.1),
    ]
    for half, q, shape, x, begin, margin in cases:
        world = collide.World()
        world.add(shape, pose(t=(x, 0, 0)), name="wall", margin=margin)
        checker = collide.RobotChecker(slider(collide.Box((2 * half, 0.1, 0.1))), world)
        expected = [begin - Fraction(margin) <= Fraction(value) + Fraction(half) for value in q.tolist()]
        assert checker.collides(q[:, None]).tolist() == expected and len(set(expected)) == 2


def test_brackets_hold_whatever_margins_are():
    """By fractions: a face of the link before a ball, and before a plane, both with margins."""
    rng, n_certified = rng_of("brackets of margins"), 0
    for _ in range(60):
        radius, margin, half, x, scale = rng.uniform(0.1, 1.0, 5).tolist()
        q = rng.uniform(-1.0, 0.0, 8)
        for shape, at, begin in (
            (collide.Sphere(radius), x, Fraction(x) - Fraction(radius)),
            (collide.Halfspace((-scale, 0, 0), -x), 0.0, Fraction(x) / Fraction(scale)),
        ):
            world = collide.World()
            world.add(shape, pose(t=(at, 0, 0)), name="wall", margin=margin)
            checker = collide.RobotChecker(slider(collide.Box((2 * half, 4.0, 4.0))), world)
            for row, value in zip(checker.distances(q[:, None]).rows, q.tolist()):
                truth = begin - Fraction(margin) - Fraction(value) - Fraction(half)
                told = f"{shape!r} at {x!r}, margin {margin!r}, half {half!r}, q {value!r}: {row} and {float(truth)}"
                if truth > 0:
                    assert Fraction(float(row["lower"])) <= truth <= Fraction(float(row["upper"])), told
                    assert row["upper"] - row["lower"] <= 1e-13 * (1 + truth), told
                n_certified += bool(row["certified"])
    assert n_certified > 300


def test_margins_are_seen_when_they_change():
    world = collide.World()
    wall = world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall", static=True)
    checker = collide.RobotChecker(slider(), world)
    q = [[0.75], [0.85]]
    assert checker.collides(q).tolist() == [False, True]
    world.set_margin(wall, 0.06)
    assert checker.collides(q).tolist() == [True, True] and abs(checker.distances(q).distance[0] + 0.01) <= 1e-12
    assert checker.certify_edges([0.0], [0.73]).free[0] and not checker.certify_edges([0.0], [0.75]).free[0]
    world.set_margin(wall, 0.0)
    assert checker.collides(q).tolist() == [False, True]


@pytest.mark.parametrize("partner", [None, "wall"])
def test_margins_of_links_are_refused(partner):
    """They would be of links among each other, too, which a checker does not keep."""
    world = collide.World()
    for name in ("cart", "wall"):
        world.add(collide.Sphere(0.1), name=name)
    checker = collide.RobotChecker(slider(), world)
    world.set_margin("cart", 0.1, partner=partner)
    for ask in (lambda: collide.RobotChecker(slider(), world), lambda: checker.collides([0.5])):
        with pytest.raises(InvalidArgument, match=r'margin of "cart".*give padding= for links'):
            ask()
    world.set_margin("cart", None if partner else 0.0, partner=partner)
    assert not checker.collides([0.5])


def test_sleeping_bodies_are_obstacles():
    """To whatever moves. Of a fixed base and a body that sleeps neither does, as in a World; judged by one."""
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(0.5, 0, 0)), name="crate")
    ball = [LinkShape(collide.Sphere(0.5), np.eye(4), None, "test")]  # the base rests on the crate
    robot = slider(base=ball)
    checker = collide.RobotChecker(robot, world)
    assert checker.collides([[-0.9], [0.5]]).tolist() == [True, True]
    world.sleep(["crate"])
    assert checker.collides([[-0.9], [0.5]]).tolist() == [False, True] and checker.skipped["sleeping"] == 1
    assert collide.RobotChecker(robot, world, mobile=True).collides([-0.9])
    world.wake(["crate"])
    assert checker.collides([-0.9]) and "sleeping" not in checker.skipped


def test_groups_and_masks_are_those_of_the_world():
    """Also of links that the World holds, among each other; pairs found again from the World's own rows."""
    rng, n_masked = rng_of("groups of a checker"), 0
    for _ in range(30):
        world = collide.World()
        ball = [LinkShape(collide.Sphere(0.1), np.eye(4), None, "test")]
        robot = slider(base=ball)
        robot.semantic_pairs = ()
        for name in ("base", "cart", "a", "b", "c"):
            if name != "cart" or rng.random() < 0.7:
                bits = rng.integers(0, 4, 2).tolist()
                static = name == "base" or (name != "cart" and bool(rng.random() < 0.3))
                world.add(collide.Sphere(0.1), name=name, group=bits[0], mask=bits[1], static=static)
        if "cart" not in world.names.values():
            world.add(collide.Sphere(0.1), name="cart")
        expected = {frozenset(pair) for pair in world.collisions().names}
        of_robot = {pair for pair in expected if pair & {"base", "cart"}}
        checker = collide.RobotChecker(robot, world)
        assert checker.n_pairs == len(of_robot) and checker.collides([0.0]) == bool(of_robot)
        report = checker.explain([0.0])
        assert {frozenset((pair.a, pair.b)) for pair in report.collisions} == of_robot
        n_masked += checker.skipped.get("filtered by group and mask", 0) > 0
    assert n_masked > 15


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
        (lambda: checker.collides([[0.0], [np.nan]]), r"Q\[1\], joint slide"),
        (lambda: checker.explain([[0.0], [0.1]]), "one configuration"),
        (lambda: checker.edge_collides([0.0], [1.0], resolution=0.0), "resolution"),
        (lambda: checker.certify_edges(np.zeros((2, 1)), np.zeros((3, 1))), "2.*3"),
        (lambda: collide.RobotChecker("panda.urdf", world), "Robot"),
        (lambda: collide.RobotChecker(robot, robot), "World"),
        (lambda: collide.RobotChecker(Robot("bare", ["base"], []), world), "no collision geometry"),
        (lambda: collide.RobotChecker(robot, world, attached=[("tool", "hand", ball)]), "no link 'hand'"),
        (lambda: collide.RobotChecker(robot, world, attached=[("cart", "cart", ball)]), "used twice"),
        (lambda: collide.RobotChecker(robot, world, attached=[("tool", "cart", 3)]), "not a shape"),
        (lambda: checker.attach("tool", np.zeros(2), ball), r"no link array\(\[0., 0.\]\); it has base, cart"),
        (lambda: checker.attach("tool", np.array(["cart", "base"]), ball), "no link array.*it has base, cart"),
        (lambda: checker.attach("tool", ["cart"], ball), r"no link \['cart'\]; it has base, cart"),
        (lambda: checker.attach("tool", "cart", ball, touch=np.zeros((2, 2))),
         r"touch must be names of links and bodies, got array\(\[0., 0.\]\) as entry 0"),
        (lambda: checker.attach("tool", "cart", ball, touch=["base", 3]), "touch must be names.*got 3 as entry 1"),
        (lambda: collide.RobotChecker(robot, world, attached=[("tool", "cart", ball, None, 3)]), "touch must be names"),
        (lambda: collide.RobotChecker(robot, world, attached=[3]), "name, link, shape"),
        (lambda: collide.RobotChecker(robot, world, padding=-1.0), "padding"),
        (lambda: collide.RobotChecker(robot, world, padding={"hand": 0.1}), "hand"),
        (lambda: collide.RobotChecker(robot, world, allowed=[("cart", "wall")]), "wall"),
        (lambda: collide.RobotChecker(robot, world, allowed=["cart"]), "pairs of names"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            ask()
    assert checker.bodies == collide.RobotChecker(robot, world).bodies  # nothing was attached
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


def _shape_that_may_have_no_end(rng, size: float) -> collide.Shape:
    plane = collide.Halfspace((0, 0, 1) if rng.random() < 0.5 else rng.normal(size=3), -float(rng.uniform(0, 2)))
    kind = rng.random()
    if kind < 0.3:
        return plane
    if kind < 0.4:
        return collide.Compound([(collide.Sphere(size), np.eye(4)), (plane, random_pose(rng, size))])
    return random_link_shape(rng, size)


@pytest.mark.parametrize("padding", [0.0, 0.03])
def test_links_without_end_are_asked_like_others(padding):
    """Half-spaces on links: a box of half sides ∞ times an axis of 0 once was no number, met nothing, and motions were
    certified free through walls.
    """
    hits = free = told = 0
    for seed in range(10):
        rng = rng_of("links without end", seed)
        types = ("prismatic", "fixed") if seed % 2 else ("revolute", "prismatic", "continuous")
        robot = random_robot(rng, n_links=3, types=types, shape=_shape_that_may_have_no_end)
        checker = collide.RobotChecker(robot, random_world(rng, 3), padding=padding)
        Q = random_configurations(rng, robot, 12)
        found = checker.collides(Q)
        number = {link: k for k, link in enumerate(robot.links)}
        for k, X_WL in enumerate(robot.link_poses(Q)):
            expected = any(
                collide.collide(
                    A, B, X_WL[number[a]], X_WL[number[b]] if X_WB is None else X_WB,
                    security_margin=0.0 if X_WB is None else padding,
                ) for A, a, B, b, X_WB in pairs_to_test(checker)
            )
            assert found[k] == expected, f"seed {seed}, configuration {Q[k].tolist()}"
        ends = Q + rng.normal(size=Q.shape) * 0.2
        certified = checker.certify_edges(Q, ends)
        for k in np.flatnonzero(certified.free).tolist():
            path = Q[k] + np.linspace(0, 1, 40)[:, None] * (ends[k] - Q[k])
            assert not checker.collides(path).any(), f"seed {seed}, edge {Q[k].tolist()} to {ends[k].tolist()}"
        hits, free, told = hits + int(found.sum()), free + int(certified.free.sum()), told + len(Q)
    assert 0.2 < hits / told < 0.9 and free > 10, (hits, free, told)


def test_an_attached_half_space_meets_what_is_in_it():
    base = Robot("one", ["base", "hand"], [Joint("j", "prismatic", "base", "hand", axis=np.array([0, 0, 1.0]))], {})
    world = collide.World()
    world.add(collide.Sphere(0.5), pose(t=(3, 4, 0)))
    checker = collide.RobotChecker(base, world, attached=[("plate", "hand", collide.Halfspace((0, 0, 1), 0.0))])
    assert checker.collides([[-1.0], [-0.25], [0.0], [9.0]]).tolist() == [False, True, True, True]
    assert checker.distances([[-1.0]]).rows["distance"][0] == pytest.approx(0.5)
    certified = checker.certify_edges([[-1.0], [-1.0], [-9.0]], [[-0.6], [1.0], [-0.501]])
    assert certified.free.tolist() == [True, False, True]


def test_a_checker_of_a_scene():
    """Its robot where it stands with what it carries, other bodies with their groups, and pairs that are allowed."""
    ball, X_WR = collide.Sphere(0.1), pose(t=(3.0, 0, 0))
    carried = {"cart": ("cart", np.eye(4)), "cup": ("cart", pose(t=(0, 0.5, 0)))}
    bodies = [
        SimpleNamespace(name=name, shape=ball, X_WB=pose(t=(x, y, 0)), static=static, group=group, mask=0xFFFF)
        for name, x, y, static, group in (
            ("cart", 3.0, 0, False, 1), ("cup", 3.0, 0.5, False, 1), ("post", 3.5, 0.5, True, 1),
            ("ghost", 3.0, 0, False, 0), ("wall", 3.5, 0.0, True, 1),
        )
    ]
    placements = {"slider": SimpleNamespace(robot=slider(), X_WR=X_WR, carried=carried)}
    scene = SimpleNamespace(name="scene", placements=placements, bodies=bodies, allowed=[("cart", "wall")])
    for name in (None, "slider"):
        checker = collide.RobotChecker.from_scene(scene, name, padding=0.0)
        assert checker.bodies == ["cart", "cup"] and checker.around == ["post", "ghost", "wall"]
        assert checker.collides([[0.0], [0.5]]).tolist() == [False, True]
        assert checker.explain([0.5]).collisions[0][:2] == ("cup", "post") and checker.n_pairs == 3
        assert checker.world.body("post").static and not checker.world.body("ghost").static
    assert not collide.RobotChecker.from_scene(scene, allowed=[("cup", "post")]).collides([0.5])
    placements["other"] = placements["slider"]
    for asked in (None, "arm"):
        with pytest.raises(InvalidArgument, match=f"scene scene: robot={asked!r}; its robots: slider, other"):
            collide.RobotChecker.from_scene(scene, asked)
    placements.clear()
    with pytest.raises(InvalidArgument, match="scene scene: robot=None; its robots: none"):
        collide.RobotChecker.from_scene(scene)
    with pytest.raises(InvalidArgument, match=r"scene must be what collide.scenes.load gives, got 3"):
        collide.RobotChecker.from_scene(3)


def test_edges_of_one_end_or_many_and_resolutions_that_are_none():
    world = collide.World()
    world.add(collide.Sphere(0.1), pose(t=(0.5, 0, 0)), name="ball")
    checker = collide.RobotChecker(slider(), world)
    assert checker.edge_collides([0.0], [[0.25], [1.0]]).tolist() == [False, True]
    assert checker.edge_collides([[0.0], [1.0]], [0.0]).tolist() == [False, True]
    for wrong in (0.0, -1.0, np.inf, np.nan, "fine", None):
        for ask in (checker.edge_collides, checker.certify_edges):
            with pytest.raises(InvalidArgument, match=r"resolution must be a positive number .*, got"):
                ask([0.0], [1.0], resolution=wrong)


@pytest.mark.parametrize(("options", "words"), [
    ({"per": "body"}, r'RobotChecker.distances: per must be one of "robot", "link", "pair", got \'body\''),
    ({"per": None}, r'per must be one of "robot", "link", "pair", got None'),
    ({"per": ["pair"]}, r"per must be one of .*, got \['pair'\]"),
    ({"between": "obstacles"}, r'between must be one of "all", "world", "self", got \'obstacles\''),
    ({"between": 1}, r"between must be one of .*, got 1"),
    ({"max_distance": -0.1}, r"max_distance must be a number ≥ 0 \[m\].*, got -0.1"),
    ({"max_distance": np.nan}, r"max_distance must be a number ≥ 0"),
    ({"max_distance": "near", "per": "pair"}, r"max_distance must be a number ≥ 0.*, got 'near'"),
])
def test_what_distances_are_asked_for_is_checked(options, words):
    checker = collide.RobotChecker(slider())
    with pytest.raises(InvalidArgument, match=words):
        checker.distances([[0.0]], **options)
