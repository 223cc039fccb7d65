"""Gradients of the nearest pair's distance against central differences: gaps, overlaps, hulls, meshes, swollen bodies.

A gradient is right, or NaN with a reason that is told; how many are of which kind is asserted, too.
"""

from __future__ import annotations

import itertools
from collections import Counter

import naive_soups
import numpy as np
import pytest
from curved_oracle import bracket
from hollow_bodies import hollow_scene
from naive import SHARED, pose, random_pose, rng_of
from random_robots import DEMO, asked_one_by_one, random_configurations, random_link_shape, random_robot, slider

import collide
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.robots.robot_distances import NO_GRADIENT

STEP = 1e-6
ROBOTS = {"ur5": "ur_description/urdf/ur5_robot.urdf", "panda": "panda_description/urdf/panda.urdf",
          "xarm": "xarm_description/urdf/xarm7.urdf"}
needs_robots = pytest.mark.skipif(DEMO is None, reason="example-robot-data is not installed")


def differences(checker, q: np.ndarray, names) -> np.ndarray | None:
    """(dof,) central differences of the distance; None where another pair is the nearest a step away."""
    steps = STEP * np.eye(len(q))
    both = checker.distances(np.concatenate([q + steps, q - steps]))
    if set(both.names) != {names}:
        return None
    return (both.distance[: len(q)] - both.distance[len(q) :]) / (2 * STEP)


def judged(checker, Q, told: str, tolerance: float = 2e-4) -> Counter:
    """How many configurations are of which kind: "gap" and "overlap" where the gradient was found right, else the
    reason, "no gradient where …"; those next to a kink do not count."""
    measured, counts = checker.distances(Q), Counter()
    for k, reason in enumerate(measured.no_gradient):
        is_nan = np.isnan(measured.gradient[k])
        say = f"{told}, q = {Q[k].tolist()}: {measured.rows[k]}, {reason}, {measured.gradient[k]}"
        assert is_nan.all() if reason else not is_nan.any(), say
        if reason:
            counts[reason] += 1
            continue
        assert measured.certified[k], say
        expected = differences(checker, Q[k], measured.names[k])
        if expected is None:
            counts["kink"] += 1
            continue
        # Where a witness jumps between q − step and q + step, one side's difference is as good as the other's.
        assert np.abs(expected - measured.gradient[k]).max() <= tolerance * (1 + np.abs(expected).max()), say
        counts["overlap" if measured.hit[k] else "gap"] += 1
    return counts


def boxes_around(rng, n: int = 6) -> collide.World:
    world = collide.World()
    for k in range(n):
        world.add(collide.Box(rng.uniform(0.05, 0.3, 3)), random_pose(rng, 0.8), name=f"box{k}", static=True)
    return world


@needs_robots
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("meshes", ["hull", "mesh"])
def test_shipped_robots(name, meshes):
    rng = rng_of("gradients of shipped robots", name)
    robot = collide.Robot.load(DEMO / ROBOTS[name], meshes=meshes)
    checker = collide.RobotChecker(robot, boxes_around(rng))
    Q = random_configurations(rng, robot, 40)
    hits = checker.collides(Q)
    Q = np.concatenate([Q[~hits][:10], Q[hits][:8]])
    counts = judged(checker, Q, f"{name}, {meshes}")
    n_hits = min(int(hits.sum()), 8)
    assert counts["gap"] >= 8 and n_hits >= 3, counts
    if meshes == "hull":
        assert counts["overlap"] >= n_hits - 1, counts
    else:
        assert counts[NO_GRADIENT["depth"]] + counts["overlap"] >= n_hits - 1, counts


def test_random_robots_of_every_shape():
    """Curved links and unions, joints of every kind, meshes among what is around, padding and margins."""
    counts: Counter = Counter()
    for seed in range(10):
        rng = rng_of("gradients of random robots", seed)
        robot = random_robot(rng, n_links=5, size=0.2)
        world = boxes_around(rng, 2)
        dented = collide.Mesh(*collide.tessellate(collide.Sphere(0.2), size=0.15)[:2])
        corners = np.where(np.arange(len(dented.vertices))[:, None] % 3 == 0, 0.6, 1.0) * dented.vertices
        world.add(collide.Mesh(corners, dented.faces), random_pose(rng, 0.6), name="dented", margin=0.02 * (seed % 2))
        world.add(random_link_shape(rng, 0.3), random_pose(rng, 0.6), name="other")
        checker = collide.RobotChecker(robot, world, padding=0.01 * (seed % 3))
        counts += judged(checker, random_configurations(rng, robot, 12), f"seed {seed}")
    assert counts["gap"] >= 25 and counts["overlap"] >= 40 and 0 < counts[NO_GRADIENT["depth"]] < 30, counts
    assert counts[NO_GRADIENT["bracket"]] < 5, counts


def test_every_reason_is_told():
    notch = collide.Compound([(collide.Mesh(*collide.tessellate(collide.Box((0.2, 0.2, 0.2)))[:2]), pose(t=(x, 0, 0)))
                              for x in (0.0, 0.3)])
    world = collide.World()
    world.add(collide.Box((0.5, 0.5, 0.5)), pose(t=(1.0, 0, 0)), name="wall")
    ball = collide.RobotChecker(slider(collide.Sphere(0.25)), world)
    measured = ball.distances([[-1.0], [0.0], [0.5], [0.75]], max_distance=1.0)
    assert measured.no_gradient == [NO_GRADIENT["beyond"], None, NO_GRADIENT["touching"], None]
    assert measured.gradient[[1, 3], 0].tolist() == [-1.0, -1.0] and np.isnan(measured.gradient[[0, 2], 0]).all()
    two = collide.RobotChecker(slider(collide.Compound([(collide.Sphere(0.1), np.eye(4)), *notch.items])), world)
    assert two.distances([[0.0], [0.6]]).no_gradient == [None, None]  # meshes that are their hulls
    shell = collide.Mesh(*collide.tessellate(collide.Box((0.2, 0.2, 0.2)))[:2], solid=False)
    of_shell = collide.RobotChecker(slider(shell), world).distances([[0.0], [0.7]])
    assert of_shell.no_gradient == [None, NO_GRADIENT["depth"]] and not of_shell.certified[1]


def test_reasons_speak_of_the_pair_named():
    """A hull deep in a wall, and a mesh deeper in another: that the mesh's is named, and that its depth is a bound."""
    rng, n_named = rng_of("named pair"), 0
    for _ in range(10):
        shell = collide.Mesh(*collide.tessellate(collide.Box((0.4, 0.4, 0.4)))[:2], solid=False)
        world = collide.World()
        world.add(shell, random_pose(rng, 0.2), name="shell")
        world.add(collide.Box((0.3, 0.3, 0.3)), random_pose(rng, 0.2), name="box")
        checker = collide.RobotChecker(slider(collide.Box((0.3, 0.2, 0.1))), world)
        measured = checker.distances([[0.0]])
        (pairs,) = asked_one_by_one(checker, np.zeros((1, 1)), collide.distance)
        assert measured.lower[0] <= min(pair.lower for pair in pairs) + 1e-12
        is_mesh = measured.names[0] is not None and measured.names[0][1] == "shell"
        assert (measured.no_gradient[0] == NO_GRADIENT["depth"]) == (is_mesh and bool(measured.hit[0]))
        n_named += is_mesh
    assert 2 <= n_named <= 9, n_named


# --- near pairs: every row against differences of its own pair ------------------------------------

MODELS = {name: SHARED / "data" / "robots" / name / f"{name}.urdf" for name in ("panda", "ur5", "fetch")}
needs_models = pytest.mark.skipif(not MODELS["panda"].is_file(), reason="../shared/data/robots is absent")


def parts_of_row(checker, names) -> tuple:
    """(parts of A, link of A, parts of B, link of B or None, X_WB or None) of two bodies by name; a part is (shape,
    X_LG).
    """
    robot, (a, b) = checker.robot, names
    number = {link: k for k, link in enumerate(robot.links)}
    of_a = [(element.shape, element.X_LG) for element in robot.geometry[a]]
    if b in robot.geometry:
        return of_a, number[a], [(element.shape, element.X_LG) for element in robot.geometry[b]], number[b], None
    body = checker.world.body(b)
    return of_a, number[a], [(body.shape, np.eye(4))], None, body.X_WB


def distances_at(checker, names, Q) -> tuple[np.ndarray, np.ndarray]:
    """((n,) distances, (n,) widths of brackets) of two bodies at configurations: the least of any two parts."""
    of_a, link_a, of_b, link_b, X_WB = parts_of_row(checker, names)
    X_WLs = checker.link_poses(Q)
    distance, width = np.full(len(Q), np.inf), np.zeros(len(Q))
    for (A, X_A), (B, X_B) in itertools.product(of_a, of_b):
        X_WBs = np.broadcast_to(X_WB, (len(Q), 4, 4)) if link_b is None else X_WLs[:, link_b] @ X_B
        r = collide.distance(A, B, X_WLs[:, link_a] @ X_A, X_WBs)
        width = np.where(r.distance < distance, r.upper - r.lower, width)
        distance = np.minimum(distance, r.distance)
    return distance, width


def slopes(checker, measured, Q, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """((M, 3, dof) differences backward, central and forward of each row's own pair, (M,) widths of brackets)."""
    n, dof = len(measured), checker.robot.dof
    out, widths, names = np.zeros((n, 3, dof)), np.zeros(n), np.array([" ".join(pair) for pair in measured.names])
    steps = step * np.concatenate([np.eye(dof), -np.eye(dof), np.zeros((1, dof))])
    for pair in sorted(set(measured.names)):
        rows = np.flatnonzero(names == " ".join(pair))
        asked = (Q[measured.configuration[rows], None] + steps).reshape(-1, dof)
        d, width = (values.reshape(len(rows), -1) for values in distances_at(checker, pair, asked))
        after, before, at = d[:, :dof], d[:, dof:-1], d[:, -1:]
        out[rows] = np.stack([at - before, 0.5 * (after - before), after - at], axis=1) / step
        widths[rows] = width.max(axis=1)
    return out, widths


def judged_rows(checker, Q, told: str, limit: float = 0.15, step: float = STEP) -> Counter:
    """How many rows of near pairs are of which kind, as of `judged`: gradients are right to 1e-6, where the brackets of
    both ends are narrow enough to tell; beside a kink they lie between the slopes of both sides."""
    measured, counts = checker.distances(Q, max_distance=limit, per="pair"), Counter()
    expected, widths = slopes(checker, measured, Q, step)
    for k, reason in enumerate(measured.no_gradient):
        gradient, (before, central, after) = measured.gradient[k], expected[k]
        say = f"{told}, {measured.names[k]}, q = {Q[measured.configuration[k]].tolist()}: {gradient}, {central}"
        assert np.isnan(gradient).all() if reason else not np.isnan(gradient).any(), say
        if reason:
            counts[reason] += 1
        elif np.abs(after - before).max() > 1e-2:
            low, high = np.minimum(before, after), np.maximum(before, after)
            assert ((gradient >= low - 1e-3) & (gradient <= high + 1e-3)).all(), say
            counts["kink"] += 1
        elif widths[k] > step * 1e-6:
            assert np.abs(gradient - central).max() <= 1e-6 + widths[k] / step, say
            counts["wide"] += 1
        else:
            assert np.abs(gradient - central).max() <= 1e-6, say
            counts["overlap" if measured.hit[k] else "gap"] += 1
    return counts


@needs_models
@pytest.mark.many(3)
@pytest.mark.parametrize("name", MODELS)
def test_near_pairs_of_hulls(name):
    rng = rng_of("gradients of near pairs", name)
    robot = Robot.load(MODELS[name], meshes="hull")
    checker = collide.RobotChecker(robot, boxes_around(rng))
    counts = judged_rows(checker, random_configurations(rng, robot, 250), name)
    assert counts["gap"] >= 300 and counts["overlap"] >= 20 and set(counts) <= {"gap", "overlap", "kink"}, counts
    assert counts["kink"] <= 0.01 * sum(counts.values()), counts


@needs_models
@pytest.mark.many(3)
@pytest.mark.parametrize("name", MODELS)
def test_near_pairs_of_meshes(name):
    """Gaps have gradients; overlaps of meshes have the reason, in place of a wrong one."""
    rng = rng_of("gradients of near meshes", name)
    robot = Robot.load(MODELS[name], meshes="mesh")
    checker = collide.RobotChecker(robot, boxes_around(rng))
    Q = random_configurations(rng, robot, 40)
    counts = judged_rows(checker, Q, name, limit=0.1)
    assert counts["gap"] >= 30 and counts[NO_GRADIENT["depth"]] >= 3, counts
    assert counts["kink"] <= 0.02 * sum(counts.values()), counts
    with_hulls = checker.distances(Q, max_distance=0.0, per="pair")
    assert (with_hulls.certified | np.isnan(with_hulls.gradient).all(axis=1)).all()


def test_near_pairs_of_rings_and_shells_against_every_triangle():
    """Gaps of bodies far from their hulls: differences of the least of all triangles against all others, in numpy."""
    counts: Counter = Counter()
    for seed in (4, 5, 8, 10):
        rng, robot, world = hollow_scene(seed)
        checker = collide.RobotChecker(robot, world)
        Q = random_configurations(rng, robot, 6)
        measured = checker.distances(Q, max_distance=0.3, per="pair")
        for k in rng.permutation(np.flatnonzero(~measured.hit))[:8]:
            q, way = Q[measured.configuration[k]], rng.normal(size=robot.dof)
            before, at, after = (gap_of_triangles(checker, measured.names[k], q + t * 1e-5 * way) for t in (-1, 0, 1))
            if None in (before, at, after):
                counts["curved"] += 1
                continue
            slopes_of_sides = (at - before) / 1e-5, (after - at) / 1e-5
            slope, say = float(measured.gradient[k] @ way), f"seed {seed}, {measured.names[k]}, q = {q.tolist()}"
            if abs(slopes_of_sides[1] - slopes_of_sides[0]) > 1e-2:
                assert min(slopes_of_sides) - 1e-3 <= slope <= max(slopes_of_sides) + 1e-3, say
                counts["kink"] += 1
            else:
                assert abs(slope - (after - before) / 2e-5) <= 1e-6, say
                counts["gap"] += 1
    assert counts["gap"] >= 15 and counts["kink"] <= 2, counts


def gap_of_triangles(checker, names, q) -> float | None:
    """The least distance of two bodies by name, by their triangles alone; ``None`` for curved shapes."""
    of_a, link_a, of_b, link_b, X_WB = parts_of_row(checker, names)
    X_WL = checker.link_poses(q)[0]
    gaps = [
        naive_soups.gap(A, B, X_WL[link_a] @ X_A, X_WB if link_b is None else X_WL[link_b] @ X_B, limit=0.5)
        for (A, X_A), (B, X_B) in itertools.product(of_a, of_b)
    ]
    return None if None in gaps else min(gaps)


def test_near_pairs_of_curved_links():
    """Cones, cylinders, ellipsoids and hulls, in trees of joints of all kinds."""
    counts: Counter = Counter()
    for seed in range(12):
        rng = rng_of("gradients of curved links", seed)
        robot = random_robot(rng, n_links=5, size=0.25, shape=curved_or_hull)
        world = collide.World()
        for k in range(6):
            world.add(curved_or_hull(rng, 0.3), random_pose(rng, 0.6), name=f"body{k}")
        checker = collide.RobotChecker(robot, world)
        counts += judged_rows(checker, random_configurations(rng, robot, 20), f"seed {seed}", step=1e-5)
    assert counts["gap"] >= 300 and counts["overlap"] >= 200 and counts["kink"] <= 10, counts
    assert counts["wide"] <= 0.1 * sum(counts.values()) and counts[NO_GRADIENT["normal"]] <= 5, counts


def curved_or_hull(rng, size: float) -> collide.Shape:
    r, kind = size * float(rng.uniform(0.5, 1.0)), int(rng.integers(4))
    if kind == 0:
        return collide.Cone(0.6 * r, 1.5 * r)
    if kind == 1:
        return collide.Ellipsoid(r * rng.uniform(0.4, 1.0, 3))
    return collide.Cylinder(0.5 * r, r) if kind == 2 else collide.ConvexHull(r * rng.normal(size=(12, 3)))


@pytest.mark.parametrize("name", [*MODELS, "random"])
def test_near_pairs_against_brackets_in_decimals(name):
    """Along a random direction, by proven brackets of 80 digits that share nothing with the engine."""
    if name in MODELS and not MODELS[name].is_file():
        pytest.skip("../shared/data/robots is absent")
    rng = rng_of("gradients in decimals", name)
    robot = Robot.load(MODELS[name], meshes="hull") if name in MODELS else random_robot(rng, n_links=6, size=0.15)
    checker = collide.RobotChecker(robot, boxes_around(rng))
    Q, counts = random_configurations(rng, robot, 30), Counter()
    measured = checker.distances(Q, max_distance=0.2, per="pair")
    rows = rng.permutation(len(measured))
    hits = measured.hit[rows]
    for k in [*rows[hits][:6], *rows[~hits][:10]]:
        of_a, link_a, of_b, link_b, X_WB = parts_of_row(checker, measured.names[k])
        if len(of_a) > 1 or len(of_b) > 1 or any(isinstance(s, collide.Compound) for s, _ in (*of_a, *of_b)):
            continue
        (A, X_A), (B, X_B) = of_a[0], of_b[0]
        q, way = Q[measured.configuration[k]], rng.normal(size=robot.dof)
        ends = []
        for X_WL in robot.link_poses(np.stack([q + STEP * way, q - STEP * way])):
            ends.append(bracket(A, B, X_WL[link_a] @ X_A, X_WB if link_b is None else X_WL[link_b] @ X_B))
        low, high = (float(x) / (2 * STEP) for x in (ends[0].lower - ends[1].upper, ends[0].upper - ends[1].lower))
        slope = float(measured.gradient[k] @ way)
        assert high - low <= 1e-6 and low - 1e-6 <= slope <= high + 1e-6, (measured.names[k], q.tolist(), slope, low)
        counts["overlap" if measured.hit[k] else "gap"] += 1
    assert counts["gap"] >= 5 and counts["overlap"] >= 2, counts


def test_gradients_at_kinks_lie_between_the_slopes_of_both_sides():
    """Boxes face to face, where every turn brings some corner nearer; a face in the middle between two walls."""
    joints = [
        Joint("slide", "prismatic", "base", "stage", np.eye(4), (1.0, 0, 0), -1.0, 1.0),
        Joint("turn", "revolute", "stage", "arm", np.eye(4), (0, 0, 1.0), -1.0, 1.0),
        Joint("tilt", "revolute", "arm", "block", np.eye(4), (0, 1.0, 0), -1.0, 1.0),
    ]
    block = [LinkShape(collide.Box((0.2, 0.2, 0.2)), np.eye(4), None, "test")]
    robot = Robot("block", ["base", "stage", "arm", "block"], joints, {"block": block})
    world = collide.World()
    for x in (-1.0, 1.0):
        world.add(collide.Box((0.2, 2.0, 2.0)), pose(t=(x, 0, 0)), name=f"wall {x}")
    checker = collide.RobotChecker(robot, world)
    Q = np.array([(x, turn, 0.0) for x in (-0.9, -0.5, 0.0, 0.25, 0.85) for turn in (0.0, 0.5)])
    counts = judged_rows(checker, Q, "block", limit=2.0)
    assert counts["kink"] >= 10 and counts["gap"] + counts["overlap"] + counts["kink"] == 20, counts
    measured = checker.distances(Q, per="pair")
    assert (np.abs(measured.gradient[:, 0]) > 0.999).all()  # along x nothing is a kink


def moved(X: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """A pose turned about the origin of W, then shifted, to second order in (6,) small numbers."""
    turn = np.cross(twist[:3], np.eye(3)).T
    return np.block([[np.eye(3) + turn + turn @ turn / 2, twist[3:, None]], [np.zeros((1, 3)), np.eye(1)]]) @ X


def test_poses_of_bodies_around_and_of_the_base():
    """Beside differences of distances by a World that moves as a whole, or of which a body moves: moving the base is
    moving all that is around the other way."""
    n_base = n_body = 0
    for seed in range(6):
        rng = rng_of("poses of bodies around", seed)
        robot, world = random_robot(rng, n_links=4, size=0.2), boxes_around(rng, 3)
        checker = collide.RobotChecker(robot, world)
        Q = random_configurations(rng, robot, 6)
        measured = checker.distances(Q, between="world")
        known = ~np.isnan(measured.gradient).any(axis=1)
        assert np.array_equal(known, ~np.isnan(measured.d_pose_b).any(axis=1))
        poses = {i: world.body(i).X_WB.copy() for i in world.ids}
        for k in np.flatnonzero(known).tolist():
            for whole in (True, False):
                bodies = poses if whole else [i for i in poses if world.body(i).name == measured.names[k][1]]
                sides = np.empty((2, 6))
                for side, step in enumerate((STEP, -STEP)):
                    for j in range(6):
                        for i in bodies:
                            world.set_pose(i, moved(poses[i], step * np.eye(6)[j]))
                        row = checker.distances(Q[k], between="world")
                        sides[side, j] = row.distance[0] if row.names == [measured.names[k]] else np.nan
                        for i in bodies:
                            world.set_pose(i, poses[i])
                slopes = (sides[0] - sides[1]) / (2 * STEP)
                if np.isnan(slopes).any():
                    continue
                told = -measured.d_base[k] if whole else measured.d_pose_b[k]
                assert np.abs(slopes - told).max() <= 2e-4 * (1 + np.abs(slopes).max()), (seed, k, whole, slopes, told)
                n_base, n_body = n_base + whole, n_body + (not whole)
    assert n_base >= 15 and n_body >= 15


def test_base_moves_no_two_links_apart():
    robot = random_robot(rng_of("base"), n_links=5, size=0.2)
    measured = collide.RobotChecker(robot).distances(random_configurations(rng_of("base q"), robot, 20), per="pair")
    known = ~np.isnan(measured.gradient).any(axis=1)
    assert known.sum() > 20 and not measured.d_base[known].any() and np.isnan(measured.d_base[~known]).all()


def test_jacobians_of_points():
    """Beside differences of link poses; and with the normal they are the gradients of distances."""
    asked = 0
    for seed in range(6):
        rng = rng_of("jacobians", seed)
        robot, world = random_robot(rng, n_links=5, size=0.2), boxes_around(rng, 3)
        checker = collide.RobotChecker(robot, world)
        Q = random_configurations(rng, robot, 5)
        bodies = rng.integers(len(checker.bodies), size=5)
        points = rng.normal(size=(5, 3))
        told = checker.point_jacobians(Q, bodies, points)
        names = [link if link in robot.links else None for link in (checker.bodies[b] for b in bodies)]
        for k, name in enumerate(names):
            if name is None:
                continue
            link = robot.links.index(name)
            fixed = np.append(points[k], 1.0)
            X_WL = robot.link_poses(Q[k])[0, link]
            steps = STEP * np.eye(robot.dof)
            moved_points = [
                [robot.link_poses(Q[k] + sign * step)[0, link] @ np.linalg.solve(X_WL, fixed) for step in steps]
                for sign in (1.0, -1.0)
            ]
            slopes = ((np.array(moved_points[0]) - moved_points[1]) / (2 * STEP))[:, :3].T
            assert np.abs(slopes - told[k]).max() <= 1e-5 * (1 + np.abs(slopes).max()), (seed, k)
            asked += 1
        measured = checker.distances(Q, between="world")
        known = ~np.isnan(measured.gradient).any(axis=1) & ~measured.hit & (measured.distance > 1e-3)
        J = checker.point_jacobians(Q[known], measured.a[known], measured.point_a[known])
        by_points = -np.einsum("ki,kij->kj", measured.normal[known], J)
        assert np.allclose(by_points, measured.gradient[known], atol=1e-6)
    assert asked >= 15


@pytest.mark.parametrize(
    ("bodies", "points", "said"),
    [
        ([9], [(0, 0, 0)], "is no body"), ([0], [(0, 0)], "points_W must be"), ([0.5], [(0, 0, 0)], "integers"),
        ([0, 0, 0], [(0, 0, 0)] * 2, "lengths do not match"),
    ],
)
def test_jacobians_of_what_is_no_point(bodies, points, said):
    checker = collide.RobotChecker(slider(collide.Sphere(0.1)))
    with pytest.raises(collide.InvalidArgument, match=said):
        checker.point_jacobians([0.0], bodies, points)
