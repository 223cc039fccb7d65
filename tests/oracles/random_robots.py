"""Seeded robots with joints of every kind, where their links stand by a plain computation, and which pairs of bodies a
checker is to test, asked one by one."""

from __future__ import annotations

import math

import numpy as np
from naive import pose, random_pose, rotation, unit

import collide
from collide.robots.kinematic_tree import Joint, Mimic
from collide.robots.robot import LinkShape, Robot
from collide.scenes.loaders.resources import installed_folders

#: Robots of example-robot-data; None where it is not installed.
DEMO = next(
    (robots for folder in installed_folders() if (robots := folder / "example-robot-data/robots").is_dir()), None
)
TYPES = ("revolute", "continuous", "prismatic", "planar", "floating", "fixed")


def random_robot(rng, n_links: int = 6, types=TYPES, shape=None, size: float = 0.1) -> Robot:
    """A tree whose links come in a shuffled order, a third of its single joints following others."""
    names = [f"link{k}" for k in rng.permutation(n_links)]
    joints, geometry = [], {}
    for k in range(1, n_links):
        kind = str(rng.choice(types))
        parent = names[int(rng.integers(max(k - 2, 0), k))]
        axis = np.eye(3)[int(rng.integers(3))] * rng.choice([-1, 1]) if rng.random() < 0.5 else rng.normal(size=3)
        X_PJ = pose(rotation(rng) if rng.random() < 0.5 else None, rng.uniform(-0.3, 0.3, 3))
        followed = [j.name for j in joints if j.type in ("revolute", "continuous", "prismatic")]
        mimic = None
        if kind in ("revolute", "prismatic") and followed and rng.random() < 0.6:
            mimic = Mimic(str(rng.choice(followed)), float(rng.uniform(-2, 2)), float(rng.uniform(-0.3, 0.3)))
        joints.append(Joint(f"joint{k}", kind, parent, names[k], X_PJ, axis, -2.0, 2.0, mimic))
    for name in names:
        made = (shape or random_link_shape)(rng, size)
        geometry[name] = [LinkShape(made, random_pose(rng, size) if rng.random() < 0.5 else np.eye(4), None, "test")]
    order = rng.permutation(len(joints))
    return Robot("random", [names[k] for k in rng.permutation(n_links)], [joints[k] for k in order], geometry)


def random_link_shape(rng, size: float) -> collide.Shape:
    r = size * float(rng.uniform(0.5, 1.0))
    kind = int(rng.integers(7))
    if kind == 0:
        return collide.Sphere(r)
    if kind == 1:
        return collide.Box(2 * r * rng.uniform(0.3, 1.0, 3))
    if kind == 2:
        return collide.Capsule(0.5 * r, r)
    if kind == 3:
        return collide.Cylinder(0.5 * r, r)
    if kind == 4:
        return collide.ConvexHull(r * np.array([unit(p) for p in rng.normal(size=(20, 3))]))
    if kind == 5:
        return collide.Ellipsoid(r * rng.uniform(0.4, 1.0, 3))
    ball, block = collide.Sphere(0.4 * r), collide.Box((r, r, r))
    return collide.Compound([(ball, pose(t=(r, 0, 0))), (block, random_pose(rng, r))])


def some_spheres(rng, size: float) -> collide.Shape:
    return collide.Compound([
        (collide.Sphere(size * float(rng.uniform(0.2, 0.6))), pose(t=rng.uniform(-size, size, 3)))
        for _ in range(int(rng.integers(1, 5)))
    ])


def _obstacle(rng) -> collide.Shape:
    kind = int(rng.integers(5))
    if kind == 0:
        return collide.Halfspace(rng.normal(size=3), -2.5)
    if kind == 1:
        return collide.ConvexHull([(0.0, 0.0, 0.0), tuple(rng.normal(size=3) * 0.2)], radius=0.05)
    if kind == 2:
        corners = 0.2 * rng.normal(size=(4, 3))
        return collide.Mesh(corners, [(0, 1, 2), (0, 1, 3), (1, 2, 3)], solid=False)
    return random_link_shape(rng, 0.25)


def scene_of_spheres(rng, n: int = 5, **options) -> collide.RobotChecker:
    """A robot of spheres among planes, swept segments, open meshes and others."""
    world = collide.World()
    for k in range(n):
        world.add(_obstacle(rng), random_pose(rng, 1.0), name=f"body{k}")
    return collide.RobotChecker(random_robot(rng, n_links=5, shape=some_spheres, size=0.06), world, **options)


def ring() -> collide.Mesh:
    """A square frame in the plane across z, 2 m wide with a hole of 1 m: its hull fills the hole."""
    outer, inner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]), 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = np.array([(*xy, z) for z in (-0.05, 0.05) for xy in (*outer, *inner)], dtype=float)
    faces = []
    for k in range(4):
        j = (k + 1) % 4
        across = (k, 4 + k, 4 + j, j), (8 + k, 8 + j, 12 + j, 12 + k)
        around = (k, j, 8 + j, 8 + k), (4 + k, 12 + k, 12 + j, 4 + j)
        for a, b, c, d in across + around:
            faces += [(a, b, c), (a, c, d)]
    return collide.Mesh(corners, faces)


def plain_link_poses(robot: Robot, q: np.ndarray) -> dict[str, np.ndarray]:
    """Link → (4, 4) pose by matrix products and `math`, from the joints as they were given."""
    column = {name: k for k, name in enumerate(robot.joint_names)}
    by_name = {joint.name: joint for joint in robot.joints}

    def value(joint: Joint) -> float:
        if joint.mimic is None:
            return float(q[column[joint.name]])
        return joint.mimic.multiplier * value(by_name[joint.mimic.joint]) + joint.mimic.offset

    def motion(joint: Joint) -> np.ndarray:
        if joint.type == "fixed":
            return np.eye(4)
        if joint.type == "prismatic":
            return pose(t=value(joint) * np.array(joint.axis))
        if joint.type == "planar":
            return planar(joint, *(float(q[column[joint.name + s]]) for s in ("/x", "/y", "/yaw")))
        if joint.type == "floating":
            x, y, z, roll, pitch, yaw = (
                float(q[column[joint.name + s]]) for s in ("/x", "/y", "/z", "/roll", "/pitch", "/yaw")
            )
            R = turned((0, 0, 1), yaw) @ turned((0, 1, 0), pitch) @ turned((1, 0, 0), roll)
            return pose(R, (x, y, z))
        return pose(turned(joint.axis, value(joint)))

    poses = {robot.root: np.eye(4)}
    remaining = list(robot.joints)
    while remaining:
        for joint in remaining[:]:
            if joint.parent in poses:
                poses[joint.child] = poses[joint.parent] @ joint.X_PJ @ motion(joint)
                remaining.remove(joint)
    return poses


def turned(axis, angle: float) -> np.ndarray:
    """(3, 3) of a turn, by how it acts on vectors along and across the axis."""
    n = unit(np.array(axis, dtype=float))
    columns = []
    for e in np.eye(3):
        along = (e @ n) * n
        columns.append(along + math.cos(angle) * (e - along) + math.sin(angle) * np.cross(n, e))
    return np.array(columns).T


def planar(joint: Joint, x: float, y: float, yaw: float) -> np.ndarray:
    """A shift across the normal, then a turn about it; axes as `Robot` says: farthest coordinate axis first."""
    n = unit(np.array(joint.axis, dtype=float))
    first = np.eye(3)[int(np.argmin(np.abs(n)))]
    first = unit(first - (first @ n) * n)
    return pose(turned(n, yaw), x * first + y * np.cross(n, first))


def random_configurations(rng, robot: Robot, n: int) -> np.ndarray:
    low, high = np.maximum(robot.lower, -2.0), np.minimum(robot.upper, 2.0)
    return rng.uniform(low, high, (n, robot.dof))


def slider(shape=None, **geometry) -> Robot:
    """base -slide(x)-> cart."""
    ball = [LinkShape(shape or collide.Sphere(0.1), np.eye(4), None, "test")]
    joints = [Joint("slide", "prismatic", "base", "cart", np.eye(4), (1.0, 0, 0), -1.0, 1.0)]
    return Robot("slider", ["base", "cart"], joints, {"cart": ball, **geometry})


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


def any_pair_hits(checker, Q) -> np.ndarray:
    """(N,) bool: configurations at which `collide.collide` finds a hit of some pair that is to be tested."""
    robot, hits = checker.robot, np.zeros(len(Q), dtype=bool)
    X_WLs, number = robot.link_poses(Q), {link: k for k, link in enumerate(robot.links)}
    for A, a, B, b, X_WB in pairs_to_test(checker):
        X_WBs = X_WLs[:, number[b]] if X_WB is None else np.broadcast_to(X_WB, (len(Q), 4, 4))
        hits |= collide.collide(A, B, X_WLs[:, number[a]], np.ascontiguousarray(X_WBs))
    return hits
