"""Robots of the C interface: from the file of a checker, configurations, distances and motions are the checker's, bit
by bit; files that lie are refused or harmless."""

from __future__ import annotations

import copy
import hashlib
import json
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import c_library as c
import numpy as np
import pytest
import surfaces
from naive import pose, random_pose, rng_of
from random_robots import random_configurations, random_link_shape, random_robot, ring, scene_of_spheres

import collide
from collide.kernels import mode
from collide.robots.checker_file import SECTIONS

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

ROBOTS = Path(__file__).resolve().parents[3] / "shared" / "data" / "robots"
OPEN, FREE, COLLIDES = range(3)
BETWEEN = {"world": 1, "self": 2, "all": 3}


def saved(checker: collide.RobotChecker, folder: Path) -> bytes:
    checker.save(folder / "robot.collide")
    return (folder / "robot.collide").read_bytes()


def crowd(rng, n: int, reach: float, *, margins: bool = False) -> collide.World:
    """Convex bodies of all kinds, and a union, around a robot."""
    world = collide.World()
    shapes = [
        collide.Box(0.3, 0.2, 0.2), collide.Sphere(0.1), collide.Cylinder(0.1, 0.4), collide.Cone(0.1, 0.3),
        collide.Ellipsoid([0.1, 0.2, 0.15]), collide.Capsule(0.05, 0.3), collide.Halfspace([0.0, 0.0, 1.0], -reach),
        collide.ConvexHull(rng.normal(size=(300, 3)) * 0.1),
        collide.ConvexHull(rng.normal(size=(9, 3)) * 0.1, radius=0.02),
        collide.Compound([(collide.Sphere(0.1), np.eye(4)), (collide.Box(0.2, 0.1, 0.1), pose(t=(0.2, 0, 0)))]),
    ]
    for k in range(n):
        margin = 0.01 * (k % 3) if margins else 0.0
        world.add(shapes[k % len(shapes)], random_pose(rng, reach), name=f"b{k}", margin=margin)
    return world


def compared(
    checker: collide.RobotChecker, robot: c.CRobot, q: np.ndarray, q1: np.ndarray, *, first_times: bool = True
) -> Counter:
    """Whatever C answers has Python's bits; how many of what kind were compared.

    first_times : of motions, too; else a time may be another at which Python finds a collision.
    """
    told: Counter = Counter()
    statuses, hits = robot.collides(q)
    good = statuses == c.OK
    assert (hits[good] == checker.collides(q)[good]).all() and not hits[~good].any()
    told.update(hits=int(hits.sum()), free=int((hits[good] == 0).sum()), open=int((~good).sum()))
    for word, between in BETWEEN.items():
        for limit in (np.inf, 0.1):
            statuses, rows, gradients = robot.distances(q, limit, between)
            wanted, good = checker.distances(q, max_distance=limit, between=word), statuses == c.OK
            _are_rows(rows[good], wanted.rows[good], gradients[good], wanted.gradient[good])
            assert not rows[~good].tobytes().strip(b"\0") and np.isnan(gradients[~good]).all()
            told.update(rows=int(good.sum()), open_rows=int((~good).sum()), beyond=int(rows["beyond"].sum()))
    told.update(_near(checker, robot, q))
    edges, (statuses, verdicts, times) = checker.certify_edges(q, q1, resolution=0.05), robot.certify(q, q1, 0.05)
    good, known = statuses == c.OK, np.where(edges.free, FREE, np.where(edges.collides, COLLIDES, OPEN))
    assert (verdicts[good] == known[good]).all() and (verdicts[~good] == OPEN).all()
    others = good & (times != edges.time) & ~(np.isnan(times) & np.isnan(edges.time))
    assert np.isnan(times[~good]).all() and not (first_times and others.any())
    at = times[others, None]
    assert not others.any() or checker.collides(q[others] + at * (q1[others] - q[others])).all()
    told.update({f"edges {kind}": int((known[good] == kind).sum()) for kind in range(3)}, open_edges=int((~good).sum()))
    statuses, hits, times = robot.sample(q, q1, 0.1)
    good = statuses == c.OK
    assert (hits[good] == checker.edge_collides(q, q1, resolution=0.1)[good]).all()
    assert (np.isnan(times) == (hits == 0)).all()
    return told


def _near(checker: collide.RobotChecker, robot: c.CRobot, q: np.ndarray) -> Counter:
    statuses, rows, gradients, starts = robot.near(q, 0.3)
    wanted = checker.distances(q, max_distance=0.3, per="pair")
    good = np.repeat(statuses == c.OK, np.diff(wanted.starts))
    assert (np.diff(starts) == np.where(statuses == c.OK, np.diff(wanted.starts), 0)).all()
    _are_rows(rows, wanted.rows[good], gradients, wanted.gradient[good])
    return Counter(near=len(rows))


def _are_rows(rows, wanted, gradients, wanted_gradients) -> None:
    for field in wanted.dtype.names:
        assert rows[field].tobytes() == wanted[field].tobytes(), f"{field}: {rows[field]}, {wanted[field]}"
    assert gradients.tobytes() == wanted_gradients.tobytes()


@pytest.mark.parametrize("seed", range(6))
def test_random_robots_have_pythons_bits(seed, tmp_path):
    """All kinds of joints and shapes, padding, margins, an attached object, allowed pairs, a turned base."""
    rng = rng_of("robots in C", seed)
    robot, options = random_robot(rng), {}
    if seed % 2:
        options = {"padding": 0.02, "X_WR": random_pose(rng, 0.3), "mobile": True}
    checker = collide.RobotChecker(robot, crowd(rng, 10, 1.5, margins=seed % 3 == 2), **options)
    if seed % 3 == 1:
        checker.attach("part", checker.bodies[0], collide.Box(0.1, 0.1, 0.2), pose(t=(0, 0, 0.1)), touch=["b0"])
        checker.allow("part", "b1")
    q = random_configurations(rng, robot, 80)
    told = compared(checker, c.CRobot(saved(checker, tmp_path)), q, q + rng.normal(size=q.shape) * 0.1)
    assert told["hits"] > 3 and told["hits"] + told["free"] > 70 and told["rows"] > 400 and told["near"] > 80, told
    assert told["edges 2"] > 3 and told["open"] + told["open_edges"] < 8, told


@pytest.mark.parametrize("seed", range(2))
def test_robots_of_spheres_have_pythons_bits(seed, tmp_path):
    rng = rng_of("robots of spheres in C", seed)
    checker = scene_of_spheres(rng, 12)
    q = random_configurations(rng, checker.robot, 100)
    told = compared(checker, c.CRobot(saved(checker, tmp_path)), q, q + rng.normal(size=q.shape) * 0.05)
    assert told["hits"] > 3 and told["free"] > 3 and told["open"] == 0, told
    assert checker.setting.spheres is not None and checker.setting.maps is not None


def test_bodies_that_have_moved_are_where_they_stand(tmp_path):
    rng = rng_of("moved around a robot in C")
    robot, world = random_robot(rng), crowd(rng, 10, 1.2)
    checker = collide.RobotChecker(robot, world)
    q = random_configurations(rng, robot, 60)
    before = checker.collides(q)
    for k in range(5):
        world.set_pose(f"b{k}", random_pose(rng, 0.4))
    told = compared(checker, c.CRobot(saved(checker, tmp_path)), q, q + 0.05)
    assert told["hits"] > before.sum() > 0 or (checker.collides(q) != before).any()


def mesh_shape(rng, size: float) -> collide.Shape:
    """Solids and open surfaces that are not convex, and convex shapes of all kinds."""
    kind = int(rng.integers(4))
    if kind == 0:
        return ring().scaled(1.5 * size)
    if kind == 1:
        vertices, faces = surfaces.torus()
        return collide.Mesh(vertices * size, faces)
    if kind == 2:
        return collide.Mesh(size * rng.normal(size=(4, 3)), [(0, 1, 2), (0, 1, 3), (1, 2, 3)], solid=False)
    return random_link_shape(rng, size)


@pytest.mark.many(3)
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_robots_with_meshes_have_pythons_bits(seed, tmp_path):
    """Meshes on links and around: booleans and motions; distances of meshes are left to Python."""
    rng = rng_of("robots with meshes in C", seed)
    robot, world = random_robot(rng, shape=mesh_shape, size=0.15), crowd(rng, 8, 1.2)
    for k in range(6):
        world.add(mesh_shape(rng, 0.3), random_pose(rng, 0.8), name=f"mesh{k}")
    checker = collide.RobotChecker(robot, world, padding={robot.links[0]: 0.01} if seed % 2 else 0.0)
    if seed == 0:
        checker.attach("ring", robot.links[-1], ring().scaled(0.1), pose(t=(0, 0, 0.1)), touch=robot.links)
    q = random_configurations(rng, robot, 60)
    told = compared(checker, c.CRobot(saved(checker, tmp_path)), q, q + rng.normal(size=q.shape) * 0.05)
    assert told["hits"] > 10 and told["free"] > 3 and told["open"] < 20 and told["open_edges"] < 30, told
    assert told["edges 2"] > 10, told


@pytest.mark.many(3)
@pytest.mark.parametrize("form", ["spheres", "hulls", "meshes"])
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_arms_have_pythons_bits(name, form, tmp_path):
    folder = ROBOTS / name
    if not folder.is_dir():
        pytest.skip("../shared/data/robots is absent")
    urdf = folder / (f"{name}_spherized.urdf" if form == "spheres" else f"{name}.urdf")
    robot = collide.Robot.load(urdf, srdf=folder / f"{name}.srdf", meshes="mesh" if form == "meshes" else "hull")
    rng, world = rng_of("arms in C", name, form), collide.World()
    world.add(collide.Box(1.0, 1.0, 0.1), collide.pose([0.9, 0.0, -0.2]), name="table")
    world.add(collide.Cylinder(0.1, 0.6), collide.pose([0.5, 0.3, 0.4]), name="pole")
    checker = collide.RobotChecker(robot, world)
    q = random_configurations(rng, robot, 80 if form == "meshes" else 200)
    told = compared(checker, c.CRobot(saved(checker, tmp_path)), q, q + rng.normal(size=q.shape) * 0.1)
    assert told["open"] + told["open_edges"] <= 3 * (form == "meshes") and told["hits"] > 5, told
    assert (told["open_rows"] == 0) == (form != "meshes")
    if name == "panda":
        assert told["free"] > 40 and told["edges 1"] > 30 and (told["near"] > 600) == (form != "meshes"), told


def test_threads_share_a_robot(tmp_path):
    rng = rng_of("threads of a robot in C")
    checker = collide.RobotChecker(random_robot(rng), crowd(rng, 10, 1.5))
    content, q = saved(checker, tmp_path), random_configurations(rng, checker.robot, 400)
    robot, wanted = c.CRobot(content), checker.collides(q)

    def work(piece: slice) -> np.ndarray:
        own = c.CRobot.__new__(c.CRobot)  # a workspace of its own, for the same robot
        own.__dict__.update(robot.__dict__, workspace=None)
        own.workspace = c.raw_handle("collide_robot_workspace_create", robot.handle)
        statuses, hits = c.CRobot.collides(own, q[piece])
        c.library().collide_robot_workspace_free(own.workspace)
        own.workspace = None
        return np.where(statuses == c.OK, hits, 2)

    with ThreadPoolExecutor(4) as pool:
        hits = np.concatenate([*pool.map(work, [slice(k, k + 25) for k in range(0, 400, 25)])])
    assert ((hits == wanted) | (hits == 2)).all() and (hits < 2).mean() > 0.9 and 0 < wanted.sum() < 400


def test_names_and_numbers(tmp_path):
    rng = rng_of("names of a robot in C")
    robot, world = random_robot(rng), crowd(rng, 3, 1.0)
    checker = collide.RobotChecker(robot, world)
    made, library = c.CRobot(saved(checker, tmp_path)), c.library()
    n = library.collide_robot_bodies(made.handle)
    columns = [library.collide_robot_column_name(made.handle, k).decode() for k in range(made.columns)]
    assert columns == list(robot.joint_names) and library.collide_robot_column_name(made.handle, len(columns)) is None
    bodies = [library.collide_robot_body_name(made.handle, k) for k in range(n)]
    n_around = library.collide_robot_around(made.handle)
    around = [library.collide_robot_body_name(made.handle, -1 - k) for k in range(n_around)]
    assert [name.decode() for name in bodies] == checker.bodies
    assert [name.decode() for name in around] == checker.around
    for beyond in (n, -1 - len(around), 2**31 - 1, -(2**31)):
        assert library.collide_robot_body_name(made.handle, beyond) is None


def test_arguments_are_checked(tmp_path):
    rng = rng_of("arguments of a robot in C")
    checker = collide.RobotChecker(random_robot(rng), crowd(rng, 3, 1.0))
    made, library = c.CRobot(saved(checker, tmp_path)), c.library()
    q = random_configurations(rng, checker.robot, 3)
    bad = q.copy()
    bad[1, 0] = np.nan
    hits, rows = np.zeros(3, dtype=np.uint8), np.zeros(3, dtype=c.PAIR_DTYPE)
    space, out = made.workspace, (hits.ctypes.data, None, None)
    assert library.collide_robot_collide(space, bad.ctypes.data, 3, *out) == c.INVALID_ARGUMENT
    assert library.collide_robot_collide(space, None, 3, *out) == c.INVALID_ARGUMENT
    assert library.collide_robot_collide(None, q.ctypes.data, 3, *out) == c.INVALID_ARGUMENT
    assert library.collide_robot_collide(space, None, 0, None, None, None) == c.OK
    for limit, between in ((-1.0, 3), (np.nan, 3), (1.0, 0), (1.0, 4)):
        status = library.collide_robot_distance(
            space, q.ctypes.data, 3, limit, between, rows.ctypes.data, None, None, None
        )
        assert status == c.INVALID_ARGUMENT, (limit, between)
    for resolution in (0.0, -1.0, np.nan, np.inf):
        status = library.collide_robot_certify(space, q.ctypes.data, q.ctypes.data, 3, resolution, *out, None)
        assert status == c.INVALID_ARGUMENT, resolution
    far = q + 1.0
    status = library.collide_robot_sample(space, q.ctypes.data, far.ctypes.data, 3, 1e-12, *out, None)
    assert status == c.INVALID_ARGUMENT, "an endless number of samples"
    starts = np.zeros(4, dtype=np.uint64)
    near = (q.ctypes.data, 3, np.inf, 3, rows.ctypes.data, None, 1, starts.ctypes.data, None)
    failed = c.c_size_t(9)
    assert library.collide_robot_near(space, *near, failed) == c.TOO_MANY and failed.value == 0
    assert library.collide_robot_load(str(tmp_path / "none").encode(), c.ctypes.byref(c.c_void_p())) == c.INVALID_FILE
    assert library.collide_robot_load(str(tmp_path).encode(), c.ctypes.byref(c.c_void_p())) == c.INVALID_FILE
    loaded = c.c_void_p()
    assert library.collide_robot_load(str(tmp_path / "robot.collide").encode(), c.ctypes.byref(loaded)) == c.OK
    library.collide_robot_free(loaded)


def test_fields_around_are_refused_in_words(tmp_path):
    rng, world = rng_of("fields around a robot in C"), collide.World()
    world.add(collide.PointCloud(rng.normal(size=(20, 3)), 0.1), name="scan")
    with pytest.raises(collide.UnsupportedQuery, match=r"RobotChecker\.save: clouds"):
        collide.RobotChecker(random_robot(rng), world).save(tmp_path / "robot.collide")
    assert not list(tmp_path.iterdir())


# --- bodies around that move ------------------------------------------------------------------------------------------


def moved(rng, checker: collide.RobotChecker, robot: c.CRobot, n: int, reach: float) -> None:
    """Give n bodies around other poses, in Python's World and in C; a body named twice takes the last."""
    numbers = rng.choice(len(checker.around), size=n, replace=False)
    X_WBs = np.array([random_pose(rng, reach) for _ in numbers])
    for number, X_WB in zip(numbers.tolist(), X_WBs):
        checker.world.set_pose(checker.around[number], X_WB)
    before = -1 - np.concatenate([numbers[:1], numbers])
    assert robot.move(before.tolist(), np.concatenate([[random_pose(rng, reach)], X_WBs])) == (c.OK, 0)
    for number, name in enumerate(checker.around):
        assert (robot.pose(-1 - number) == checker.world.body(name).X_WB).all()


def scene_that_moves(form: str, rng) -> collide.RobotChecker:
    if form == "spheres":
        return scene_of_spheres(rng, 12)
    world = crowd(rng, 10, 1.5)
    robot = random_robot(rng, shape=mesh_shape, size=0.15) if form == "meshes" else random_robot(rng)
    for k in range(6 * (form == "meshes")):
        world.add(mesh_shape(rng, 0.3), random_pose(rng, 0.8), name=f"mesh{k}")
    checker = collide.RobotChecker(robot, world, padding=0.01)
    checker.attach("part", checker.bodies[0], collide.Box(0.1, 0.1, 0.2), pose(t=(0, 0, 0.1)), touch=["b0"])
    return checker


@pytest.mark.many(3)
@pytest.mark.parametrize("form", ["hulls", "spheres", "meshes"])
def test_bodies_moved_in_c_have_pythons_bits(form, tmp_path):
    """After every move C has the bits of the checker whose World moves, and the booleans of a checker made anew."""
    rng = rng_of("moved in C", form)
    checker = scene_that_moves(form, rng)
    robot, q = c.CRobot(saved(checker, tmp_path)), random_configurations(rng, checker.robot, 30)
    told, changed = Counter(), 0
    before = checker.collides(q)
    for n in (1, 3, len(checker.around)):
        moved(rng, checker, robot, n, 1.2 if form == "hulls" else 0.7)
        told += compared(checker, robot, q, q + rng.normal(size=q.shape) * 0.05)
        statuses, hits = robot.collides(q)
        good, anew = statuses == c.OK, copy.copy(checker).collides(q)
        assert (hits[good] == anew[good]).all()
        changed, before = changed + int((hits[good] != before[good]).sum()), anew
    assert told["hits"] > 20 and told["free"] > 15 and told["rows"] > 150 and changed > 3, (told, changed)
    assert (told["near"] > 50) == (form == "hulls") and told["edges 1"] > 10 and told["edges 2"] > 10, told


def test_workspaces_move_bodies_apart(tmp_path):
    """Of threads each moves bodies in its own workspace: the others' answers, and a new workspace's, stay."""
    rng = rng_of("moved by threads in C")
    robot, q = random_robot(rng), None
    content = saved(collide.RobotChecker(robot, crowd(rng, 10, 1.0)), tmp_path)
    loaded, q = c.CRobot(content), random_configurations(rng, robot, 50)
    first = loaded.collides(q)[1]
    scenes = [np.array([random_pose(rng, 0.6) for _ in range(10)]) for _ in range(8)]

    def work(X_WBs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = c.CRobot.__new__(c.CRobot)
        own.__dict__.update(loaded.__dict__, workspace=c.raw_handle("collide_robot_workspace_create", loaded.handle))
        before = c.CRobot.collides(own, q)[1]
        assert own.move([-1 - k for k in range(10)], X_WBs) == (c.OK, 0)
        hits = c.CRobot.collides(own, q)[1]
        c.library().collide_robot_workspace_free(own.workspace)
        own.workspace = None
        return before, hits

    with ThreadPoolExecutor(4) as pool:
        answers = [*pool.map(work, scenes)]
    for X_WBs, (before, hits) in zip(scenes, answers):
        again = c.CRobot(content)
        assert again.move([-1 - k for k in range(10)], X_WBs) == (c.OK, 0)
        assert (before == first).all() and (again.collides(q)[1] == hits).all()
    assert (loaded.collides(q)[1] == first).all() and len({hits.tobytes() for _, hits in answers}) > 4


def test_moves_that_are_refused_move_nothing(tmp_path):
    rng = rng_of("refused moves in C")
    robot, world = random_robot(rng), crowd(rng, 4, 0.6)
    checker = collide.RobotChecker(robot, world)
    made, q, X = c.CRobot(saved(checker, tmp_path)), random_configurations(rng, robot, 40), random_pose(rng, 0.3)
    rows, library = made.distances(q)[1], c.library()
    for number in (0, 1, -5, 2**31 - 1, -(2**31)):
        assert made.move([-1, number], [X, X]) == (c.INVALID_ARGUMENT, 1), number
        assert library.collide_robot_pose_around(made.workspace, number, X.ctypes.data) == c.INVALID_ARGUMENT
    for odd in c.odd_poses():
        assert made.move([-2, -1, -2], [X, odd, X]) == (c.INVALID_POSE, 1), odd
    skewed = X.copy()
    skewed[:3, 0] *= 1.0 + 1e-12
    assert made.move([-2, -1], [X, skewed]) == (c.UNSUPPORTED, 0)
    number, failed = np.array([-1], dtype=np.int32), c.c_size_t(9)
    assert library.collide_robot_move_around(None, number.ctypes.data, 1, X.ctypes.data, failed) == c.INVALID_ARGUMENT
    assert library.collide_robot_move_around(made.workspace, None, 1, X.ctypes.data, failed) == c.INVALID_ARGUMENT
    assert library.collide_robot_move_around(made.workspace, number.ctypes.data, 1, None, failed) == c.INVALID_ARGUMENT
    assert library.collide_robot_move_around(made.workspace, None, 0, None, None) == c.OK and failed.value == 0
    assert made.distances(q)[1].tobytes() == rows.tobytes()
    assert made.move([-1], [X]) == (c.OK, 0) and made.distances(q)[1].tobytes() != rows.tobytes()
    world.set_margin("b1", 0.01)
    swollen = c.CRobot(saved(checker, tmp_path))
    assert swollen.move([-1], [X]) == (c.UNSUPPORTED, 0) and (swollen.pose(-1) == world.body("b0").X_WB).all()


# --- objects that are attached, pairs that are allowed ----------------------------------------------------------------


def without_spheres(checker: collide.RobotChecker) -> None:
    """A checker whose spheres are gone: C does without while anything is attached, which leaves more motions open."""
    checker._spheres, checker._maps, checker._n_asked, checker._setting = None, None, -(10**9), None
    checker.prepare()
    assert checker.setting.spheres is None


class Carrying:
    """A checker and the same robot in C under the same changes of what it carries.

    objects : names of what was attached here, in order.   held : unions in C, which are not copied.
    """

    def __init__(self, rng, checker: collide.RobotChecker, robot: c.CRobot):
        self.rng, self.checker, self.robot, self.held = rng, checker, robot, {}
        self.padding, self.n_before, self.count = 0.0, len(checker.bodies), 0

    @property
    def objects(self) -> list[str]:
        return self.checker.bodies[self.n_before :]

    def attach(self) -> None:
        bodies, around, rng = self.checker.bodies, self.checker.around, self.rng
        shape = random_link_shape(rng, 0.15)
        if rng.random() < 0.2:
            shape = collide.ConvexHull(rng.normal(size=(300, 3)) * 0.08)
        links = [k for k, body in enumerate(self.checker._bodies) if body.name in self.checker.robot.links]
        carrier, name, X = int(rng.choice(links)), f"object{self.count}", random_pose(rng, 0.15)
        touch = rng.choice(len(bodies), 2).tolist() + (-1 - rng.choice(len(around), 2)).tolist()
        names = [bodies[k] if k >= 0 else around[-1 - k] for k in touch]
        self.checker.attach(name, bodies[carrier], shape, X, touch=names)
        self.held[name], self.count = c.CCompound(shape), self.count + 1
        wanted = c.OK, len(bodies)
        assert self.robot.attach(carrier, self.held[name], X, self.padding, tuple(touch)) == wanted
        assert self.checker.bodies[-1] == name

    def detach(self) -> None:
        name = str(self.rng.choice(self.objects))
        number = self.checker.bodies.index(name)
        self.checker.detach(name)
        assert self.robot.detach(number) == c.OK
        del self.held[name]

    def allow(self) -> None:
        bodies, around = self.checker.bodies, self.checker.around
        a, b = self.rng.choice(len(bodies), 2, replace=False).tolist()
        other = -1 - int(self.rng.integers(len(around)))
        for pair, names in (((a, b), (bodies[a], bodies[b])), ((other, a), (around[-1 - other], bodies[a]))):
            self.checker.allow(*names)
            assert self.robot.allow(pair, pair[::-1]) == c.OK

    def change(self, step: int) -> None:
        if step % 4 == 3:
            self.allow()
        elif len(self.objects) < 2 or (len(self.objects) < 5 and self.rng.random() < 0.6):
            self.attach()
        else:
            self.detach()


@pytest.mark.parametrize("form", ["hulls", "padded", "spheres", pytest.param("meshes", marks=pytest.mark.slow)])
def test_objects_attached_in_c_have_pythons_bits(form, tmp_path):
    """After every change, and after moves of bodies around, C has the bits of the checker that carries the same."""
    rng = rng_of("carried in C", form)
    if form == "hulls":
        checker = collide.RobotChecker(random_robot(rng), crowd(rng, 10, 1.5))
    else:
        checker = scene_that_moves("hulls" if form == "padded" else form, rng)
    scene = Carrying(rng, checker, c.CRobot(saved(checker, tmp_path)))
    without_spheres(checker)
    scene.padding = 0.01 if form in ("padded", "meshes") else 0.0
    q, told = random_configurations(rng, checker.robot, 25), Counter()
    alone, changed = checker.collides(q), 0
    for step in range(12):
        scene.change(step)
        if step % 3 == 2:
            moved(rng, checker, scene.robot, 3, 1.0)
        ends = q + rng.normal(size=q.shape) * 0.05
        told += compared(checker, scene.robot, q, ends, first_times=form != "meshes")
        hits = checker.collides(q)
        changed, alone = changed + int((hits != alone).sum()), hits
    assert told["hits"] > 20 and told["free"] > 20 and changed > 2, (told, changed)
    assert told["edges 1"] > 10 and told["edges 2"] > 10 and told["rows"] > (300 if form == "meshes" else 900), told
    while scene.objects:
        scene.detach()
    told = compared(copy.copy(checker), scene.robot, q, q + rng.normal(size=q.shape) * 0.05)
    assert told["open"] == 0 or form == "meshes", told


def test_objects_that_cannot_be_carried_are_refused_and_change_nothing(tmp_path):
    rng = rng_of("refused objects in C")
    checker = collide.RobotChecker(random_robot(rng), crowd(rng, 4, 1.0))
    robot, q = c.CRobot(saved(checker, tmp_path)), random_configurations(rng, checker.robot, 40)
    before, n = robot.collides(q)[1], len(checker.bodies)
    ball, plane = c.CCompound(collide.Sphere(0.1)), c.CCompound(collide.Halfspace([0, 0, 1.0], 0.0))
    many = c.CCompound(collide.Compound([(collide.Sphere(0.1), pose(t=(k, 0, 0))) for k in range(17)]))
    eye = np.eye(4)
    for given, wanted in (
        ((n, ball, eye), c.INVALID_ARGUMENT), ((-1, ball, eye), c.INVALID_ARGUMENT),
        ((0, ball, np.diag([2.0, 1, 1, 1])), c.INVALID_POSE), ((0, ball, eye, -1.0), c.INVALID_ARGUMENT),
        ((0, ball, eye, np.nan), c.INVALID_ARGUMENT), ((0, ball, eye, 0.0, (n,)), c.INVALID_ARGUMENT),
        ((0, ball, eye, 0.0, (-5,)), c.INVALID_ARGUMENT), ((0, plane, eye), c.UNSUPPORTED),
        ((0, ball, eye, 0.01), c.UNSUPPORTED), ((0, many, eye), c.TOO_MANY),
    ):
        assert robot.attach(*given) == (wanted, -1), given
    assert robot.detach(0) == robot.detach(n) == robot.detach(-1) == c.INVALID_ARGUMENT
    assert robot.allow((0, n)) == robot.allow((0, 1), (-5, 0)) == c.INVALID_ARGUMENT
    assert (robot.collides(q)[1] == before).all() and 0 < before.sum()
    far = pose(t=(50.0, 0, 0))
    numbers = [robot.attach(0, ball, far)[1] for _ in range(16)]
    assert numbers == list(range(n, n + 16)) and robot.attach(0, ball, far) == (c.TOO_MANY, -1)
    assert robot.detach(n + 3) == c.OK and robot.attach(0, ball, far) == (c.OK, n + 15)
    assert (robot.collides(q)[1] == before).all()


# --- files that lie ---------------------------------------------------------------------------------------------------


def test_damage_is_told(tmp_path):
    """Every prefix on a grid, and a flipped bit in every 97th byte: the digest tells."""
    rng = rng_of("damaged robots in C")
    content = saved(collide.RobotChecker(random_robot(rng), crowd(rng, 10, 1.0)), tmp_path)
    for n in [*range(0, 700, 7), *range(700, len(content), 977), len(content) - 8]:
        assert c.raw_robot(content[:n]) == (c.INVALID_FILE, None), n
    assert c.raw_robot(content + bytes(8)) == (c.INVALID_FILE, None)
    for at in range(0, len(content), 97):
        spoilt = bytearray(content)
        spoilt[at] ^= 1 << at % 8
        assert c.raw_robot(bytes(spoilt)) == (c.INVALID_FILE, None), at


def lying(content: bytes, rng) -> tuple[str, bytes]:
    """A file with a word of some section replaced, and the digest of what it says."""
    words = np.frombuffer(content, dtype=np.int64).copy()
    table = words[5 : 5 + 2 * len(SECTIONS)].reshape(-1, 2)
    names = [*SECTIONS]
    k = int(rng.integers(-1, len(names)))
    if k < 0 or table[k, 1] == 0:
        at, name = int(rng.integers(5, 5 + table.size)), "table of sections"
    else:
        end = table[k + 1, 0] if k + 1 < len(names) else len(words)
        at, name = int(rng.integers(table[k, 0], end)), names[k]
    old = int(words[at])
    if name in names and SECTIONS[name] == "<f8":
        value = float(words[at : at + 1].view(np.float64)[0])
        values = [np.nan, np.inf, -np.inf, -value, 1e308, 1e49, 0.0, 1.0, value + 1e-3, 5e-324]
        words[at : at + 1].view(np.float64)[0] = values[rng.integers(len(values))]
    else:
        near, far = [0, 1, 2, -1, 7, old + 1, old - 1], [2**31, 2**62, -(2**63)]
        words[at] = [*near, *far, *rng.integers(0, (64, 2**62)).tolist()][rng.integers(12)]
    message = words[5:].tobytes()
    words[3:5] = np.frombuffer(hashlib.blake2b(message, digest_size=16).digest(), dtype=np.int64)
    return name, words.tobytes()


def survivors(path: str, first: int, n: int) -> dict[str, list[int]]:
    """{section: [refused, taken]} of n lying files; those taken are asked everything. Run in a process of its own."""
    content, told = Path(path).read_bytes(), {}
    columns = c.CRobot(content).columns
    for number in range(first, first + n):
        rng = np.random.default_rng([17, number])
        name, spoilt = lying(content, rng)
        print(f"lying file {number}: {name}", file=sys.stderr, flush=True)
        counts = told.setdefault(name, [0, 0])
        status, handle = c.raw_robot(spoilt)
        counts[status == c.OK] += 1
        if status != c.OK:
            assert status in (c.INVALID_FILE, c.NO_MEMORY) and handle is None, (number, name, status)
            continue
        c.library().collide_robot_free(handle)
        robot = c.CRobot(spoilt)
        q = rng.uniform(-3.0, 3.0, (20, robot.columns))
        assert robot.columns == columns or name == "sizes"
        robot.collides(q)
        robot.distances(q[:4])
        robot.near(q[:4], 0.2)
        robot.certify(q[:4], q[4:8], 0.5)
        robot.sample(q[:4], q[4:8], 0.5)
        if c.library().collide_robot_around(robot.handle) and robot.move([-1], [np.eye(4)])[0] == c.OK:
            robot.collides(q)
            robot.distances(q[:4])
    return told


@pytest.mark.many(3)
@pytest.mark.parametrize("form", ["hulls", "spheres", "meshes"])
def test_files_that_lie_are_refused_or_harmless(form, tmp_path):
    """Of 600 files with a word replaced and a digest that fits, each is refused or answers something; none ends the
    process, or goes on for ever."""
    rng = rng_of("lying robots in C", form)
    robot = random_robot(rng, shape=mesh_shape if form == "meshes" else None)
    checker = collide.RobotChecker(robot, crowd(rng, 10, 1.0), padding=0.01 * (form == "hulls"))
    saved(scene_of_spheres(rng) if form == "spheres" else checker, tmp_path)
    program = (
        "import json, sys; sys.path[:0] = json.loads(sys.argv[1]); import test_c_robots as t; "
        "print(json.dumps(t.survivors(sys.argv[2], 0, 600)))"
    )
    command = [sys.executable, "-c", program, json.dumps(sys.path), str(tmp_path / "robot.collide")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, cwd=Path(__file__).parent)
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-600:]}"
    told = json.loads(done.stdout)
    refused, taken = map(sum, zip(*told.values()))
    assert refused > 150 and taken > 100 and len(told) > 25, told
    for name in ("table of sections", "sizes", "joint_ints", "bodies", "node_links", "shape_of"):
        assert told.get(name, [1])[0] > 0, (name, told)
