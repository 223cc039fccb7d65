"""A robot in N worlds: the bytes of its checker among the bodies of each."""

from __future__ import annotations

import naive
import numpy as np
import pytest

import collide

N = 40
ARM = """<robot name="arm"><link name="base"><collision><geometry><cylinder radius="0.1" length="0.2"/></geometry>
</collision></link>{links}</robot>"""
LINK = """<link name="l{k}"><collision><origin xyz="0.2 0 0"/><geometry>{shape}</geometry></collision></link>
<joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/><origin xyz="{x} 0 0.1"/>
<axis xyz="0 {y} {z}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
SHAPES = ('<box size="0.4 0.08 0.08"/>', '<sphere radius="0.1"/>', '<cylinder radius="0.05" length="0.3"/>')


def checker_among(tmp_path, rng, *, with_mesh: bool = False, margin: float = 0.0) -> tuple:
    """(checker, its World, names of bodies that move)."""
    links = "".join(
        LINK.format(k=k, parent=f"l{k - 1}" if k else "base", x=0.4 if k else 0.0, y=k % 2, z=1 - k % 2, shape=shape)
        for k, shape in enumerate(SHAPES)
    )
    place = tmp_path / "arm.urdf"
    place.write_text(ARM.format(links=links))
    world = collide.World()
    bodies = {
        "table": collide.Box((2, 2, 0.1)), "crate": collide.Box((0.3, 0.2, 0.2)), "ball": collide.Sphere(0.15),
        "rock": collide.ConvexHull(0.15 * rng.normal(size=(20, 3))), "can": collide.Cylinder(0.1, 0.3),
    }
    if with_mesh:
        ring = [[np.cos(t), np.sin(t), z] for t in np.arange(8) * np.pi / 4 for z in (-0.2, 0.2)]
        points = np.concatenate([0.2 * np.array(ring), 0.12 * np.array(ring)])
        bodies["bowl"] = collide.Mesh(points, hollow_ring())
    for name, shape in bodies.items():
        world.add(shape, collide.pose((0, 0, -1)), name=name)
    if margin:
        world.set_margin("crate", margin)
    checker = collide.RobotChecker(collide.Robot.load(place), world)
    checker.allow("base", "l0")
    return checker, world, list(bodies)[1:]


def hollow_ring() -> np.ndarray:
    """Facets of a ring of eight sides, corners in the order that `checker_among` gives them."""
    facets = []
    for k in range(8):
        a, b = 2 * k, 2 * ((k + 1) % 8)
        outer, inner = (a, b, b + 1, a + 1), (16 + b, 16 + a, 17 + a, 17 + b)
        for quad in (outer, inner, (a + 1, b + 1, 17 + b, 17 + a), (b, a, 16 + a, 16 + b)):
            facets += [quad[:3], (quad[0], quad[2], quad[3])]
    return np.array(facets)


def worlds_of(rng, n: int, m: int) -> np.ndarray:
    """Poses (n, m, 4, 4) around the arm; every fourth world is the one before."""
    X = collide.poses(rng.uniform(-0.8, 0.8, (n * m, 3)), quat_wxyz=rng.normal(size=(n * m, 4))).reshape(n, m, 4, 4)
    X[3::4] = X[2::4][: len(X[3::4])]
    return X


def one_by_one(world, names, X_WBs, ask) -> list:
    """Answers of the checker as its World moves."""
    answers = []
    for k, X in enumerate(X_WBs):
        world.set_poses(names, X)
        answers.append(ask(k))
    return answers


@pytest.mark.parametrize("with_mesh", [False, True])
@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_booleans_are_those_of_every_world(tmp_path, with_mesh, margin):
    rng = naive.rng_of("robot batch", with_mesh, margin)
    checker, world, names = checker_among(tmp_path, rng, with_mesh=with_mesh, margin=margin)
    batch = collide.RobotBatch(checker, names)
    X_WBs, Q = worlds_of(rng, N, len(names)), rng.uniform(-1.5, 1.5, (N, 3))
    hits = batch.collides(Q, X_WBs)
    assert hits.tolist() == one_by_one(world, names, X_WBs, lambda k: checker.collides(Q[k]))
    assert 5 <= hits.sum() <= N - 5
    assert batch.collides(Q, X_WBs).tolist() == hits.tolist(), "the World has moved since, the batch has not"


@pytest.mark.parametrize("with_mesh", [False, True])
@pytest.mark.parametrize("per", ["robot", "link", "pair"])
@pytest.mark.parametrize("max_distance", [np.inf, 0.3])
def test_distances_are_those_of_every_world(tmp_path, with_mesh, per, max_distance):
    rng = naive.rng_of("robot batch distances", with_mesh, per, max_distance)
    checker, world, names = checker_among(tmp_path, rng, with_mesh=with_mesh)
    X_WBs, Q = worlds_of(rng, N, len(names)), rng.uniform(-1.5, 1.5, (N, 3))
    options = {"per": per, "max_distance": max_distance}
    together = collide.RobotBatch(checker, names).distances(Q, X_WBs, **options)
    single = one_by_one(world, names, X_WBs, lambda k: checker.distances(Q[k], **options))
    assert together.rows.tobytes() == b"".join(each.rows.tobytes() for each in single)
    for field in ("gradient", "normal", "point_a", "point_b"):
        assert getattr(together, field).tobytes() == b"".join(getattr(each, field).tobytes() for each in single), field
    assert np.diff(together.starts).tolist() == [len(each.rows) for each in single] and len(together.rows) >= N


def test_one_configuration_goes_with_all_worlds(tmp_path):
    rng = naive.rng_of("robot batch single")
    checker, world, names = checker_among(tmp_path, rng)
    X_WBs = worlds_of(rng, 8, 2)
    batch = collide.RobotBatch(checker, names[:2])
    hits = batch.collides([0.1, 0.2, 0.3], X_WBs)
    assert hits.tolist() == one_by_one(world, names[:2], X_WBs, lambda _: checker.collides([0.1, 0.2, 0.3]))
    assert batch.moving == names[:2]
    nothing = batch.distances(np.zeros((0, 3)), np.zeros((0, 2, 4, 4)))
    assert len(nothing.rows) == 0 and batch.collides(np.zeros((0, 3)), np.zeros((0, 2, 4, 4))).tolist() == []


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda c: collide.RobotBatch("arm", []), "checker must be a collide.RobotChecker"),
        (lambda c: collide.RobotBatch(c, ["ball", "ball"]), "moving must name no body twice"),
        (lambda c: collide.RobotBatch(c, ["nobody"]), "nobody"),
        (lambda c: collide.RobotBatch(c, ["ball"]).collides(np.zeros(3), np.zeros((4, 4))), r"shape \(N, 1, 4, 4\)"),
        (lambda c: collide.RobotBatch(c, ["ball"]).collides(np.zeros(3), np.zeros((2, 1, 4, 4))), "X_WBs"),
        (lambda c: collide.RobotBatch(c, ["ball"]).collides(np.zeros((3, 3)), np.tile(np.eye(4), (2, 1, 1, 1))), "Q"),
        (lambda c: collide.RobotBatch(c, ["ball"]).distances(np.zeros(3), np.tile(np.eye(4), (1, 1, 1, 1)), per="x"),
         "RobotBatch.distances: per must be one of"),
    ],
)
def test_what_is_refused(tmp_path, call, message):
    checker, *_ = checker_among(tmp_path, naive.rng_of("robot batch refused"))
    with pytest.raises(collide.CollideError, match=message):
        call(checker)
