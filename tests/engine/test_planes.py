"""Planes and walls met from both sides, in every query that regions take, beside closed forms."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from mesh_shapes import block_ring
from naive import one_of_each, pose, random_pose, rng_of
from reproduction import reproducing

import collide
from collide import InvalidShape, Plane, UnsupportedQuery
from collide.pages.drawn_shapes import ShapeTable
from collide.scenes import load, save

EYE = np.eye(4)
RING = collide.Mesh(*block_ring()).scaled(0.3)


def interval(shape, X_WB, u) -> tuple[float, float]:
    """Where the shape begins and ends along a unit vector of W, by distances from two half-spaces."""
    far = 50.0
    low = collide.distance(collide.Halfspace(u, -far), shape, EYE, X_WB).distance - far
    high = far - collide.distance(collide.Halfspace(-u, -far), shape, EYE, X_WB).distance
    return float(low), float(high)


@pytest.mark.parametrize("kind", [*one_of_each(rng_of("kinds")), "Mesh", "PointCloud"])
def test_distances_and_depths_are_those_along_the_normal(kind):
    rng, seen = rng_of("walls", kind), [0, 0]
    for k in range(9):
        more = {"Mesh": RING, "PointCloud": collide.PointCloud(rng.normal(size=(9, 3)), 0.1)}
        shape = (one_of_each(rng) | more)[kind]
        normal, X_WA, X_WB = rng.normal(size=3), random_pose(rng), random_pose(rng, 1.2)
        thickness, length = (0.0, 0.25, 1.0)[k % 3], float(np.linalg.norm(normal))
        wall = Plane(normal, rng.normal() * 0.3, thickness * length)
        u = X_WA[:3, :3] @ normal / length
        if kind == "Halfspace":
            with pytest.raises(UnsupportedQuery, match="no translation of finite length"):
                collide.distance(wall, shape, X_WA, X_WB)
            assert collide.collide(wall, shape, X_WA, X_WB)  # no two are parallel here
            seen = [9, 9]
            continue
        middle = float(u @ X_WA[:3, 3]) + wall.offset / length
        low, high = interval(shape, X_WB, u)
        step = middle - 0.5 * (low + high)
        step += rng.uniform(-0.2, 0.2) if k % 2 else rng.choice((-1, 1)) * (2.0 + high - low)
        low, high, X_WB = low + step, high + step, pose(X_WB[:3, :3], X_WB[:3, 3] + step * u)
        over = min(high - (middle - 0.5 * thickness), middle + 0.5 * thickness - low)  # < 0: the gap
        with reproducing("A, B, X_WA, X_WB = {A}, {B}, {X_WA}, {X_WB}", A=wall, B=shape, X_WA=X_WA, X_WB=X_WB):
            if kind in ("Mesh", "Compound", "PointCloud") and over >= -1e-9:
                # not convex: they meet unless the wall stands in a hollow; the way out is not always the shortest
                r = collide.distance(wall, shape, X_WA, X_WB)
                assert not r.hit or r.upper >= -over - 1e-9
                parted = pose(X_WB[:3, :3], X_WB[:3, 3] - (r.distance * 1.000001 - 1e-9) * r.normal)
                assert not r.hit or not collide.collide(wall, shape, X_WA, parted)
            else:
                for A, B, X, Y in ((wall, shape, X_WA, X_WB), (shape, wall, X_WB, X_WA)):
                    r = collide.distance(A, B, X, Y)
                    assert r.distance == pytest.approx(-over, abs=1e-7) and r.hit == (over >= 0.0), over
                    assert collide.collide(A, B, X, Y) == r.hit
                    c = collide.contacts(A, B, X, Y, margin=0.1)
                    assert (len(c) > 0) == (over >= -0.1)
        seen[int(over >= 0.0)] += 1
    assert min(seen) >= 4, seen


def test_a_plane_is_thin_and_without_end():
    plane, ball = Plane((0, 0, 1), 0.5), collide.Sphere(0.25)
    for z, gap in ((0.75, 0.0), (0.25, 0.0), (1.0, 0.25), (0.0, 0.25), (0.5, -0.25), (0.625, -0.125)):
        r = collide.distance(plane, ball, EYE, pose(t=(1e3, -1e3, z)))
        assert r.distance == pytest.approx(gap, abs=1e-9) and r.hit == (gap <= 0.0) and r.certified, z
    up, down = (collide.distance(plane, ball, EYE, pose(t=(0, 0, z))).normal[2] for z in (1.0, 0.0))
    assert up == pytest.approx(1.0) and down == pytest.approx(-1.0)
    r = collide.raycast(plane, EYE, [(9, 9, 2), (9, 9, -2), (0, 0, 1)], [(0, 0, -1), (0, 0, 1), (1, 0, 0)])
    assert r.hit.tolist() == [True, True, False] and r.distance[:2].tolist() == [1.5, 2.5]
    assert r.facet[:2].tolist() == [0, 1] and r.normal[:2].tolist() == [[0, 0, 1], [0, 0, -1]]
    assert collide.contains(plane, EYE, [(7, 8, 0.5), (7, 8, 0.5 + 1e-15)]).tolist() == [True, False]
    for side in (1, -1):
        cast = collide.shape_cast(ball, pose(t=(0, 0, 0.5 + 2 * side)), (0, 0, -side), plane, EYE)
        assert cast.hit and cast.distance == pytest.approx(1.75, abs=1e-9)
        ways = pose(t=(0, 0, 0.5 + 2 * side)), pose(t=(0, 0, 0.5 - 2 * side))
        t = collide.time_of_impact(ball, plane, *ways, EYE, EYE)
        assert t.hit and t.lower <= 1.75 / 4 <= t.upper
    assert collide.collide(plane, Plane((0, 0, 1), 0.0, 1.0), EYE, EYE) and collide.collide(plane, plane, EYE, EYE)
    assert not collide.collide(plane, Plane((0, 0, 1), 0.0), EYE, EYE)
    assert collide.collide(plane, Plane((0, 1e-6, 1), 0.0), EYE, EYE)
    assert collide.distance(plane, Plane((0, 0, 2), -1.0), EYE, EYE).distance == pytest.approx(1.0)
    r = collide.distance(plane, collide.Box((1, 1, 1)), EYE, EYE)
    collide.verify(plane, collide.Box((1, 1, 1)), EYE, EYE, r)


def test_a_wall_in_a_world_a_file_and_a_page(tmp_path):
    wall, world = Plane((1, 0, 0), 2.0, 0.5), collide.World()
    world.add(wall, name="glass", static=True)
    world.add(collide.Box((1, 1, 1)), name="box")
    world.add(collide.Sphere(0.5), pose(t=(3, 0, 0)), name="behind")
    assert world.distances(2.0)["distance"].tolist() == pytest.approx([1.25, 0.25, 2.0])
    assert world.raycast((1, 0, 0.75), (1, 0, 0)).names == ["glass"]
    world.set_pose("box", pose(t=(1.375, 9, 9)))
    assert world.collides() and world.collisions().names == [("glass", "box")]
    save(world, tmp_path / "cell.json")
    bodies = {body.name: body.shape for body in load(tmp_path / "cell.json").bodies}
    assert bodies["glass"] == wall and isinstance(bodies["glass"], Plane)
    (tmp_path / "mm.yaml").write_text(
        "collide: 1\nunits: mm\nbodies:\n"
        "  - {name: a, static: true, shape: {plane: {normal: [0, 0, 1], offset: 250}}}\n"
    )
    assert load(tmp_path / "mm.yaml").bodies[0].shape == Plane((0, 0, 1), 0.25)
    page = ShapeTable(2.0)
    page.row([(wall, EYE)])
    assert page.written()[0]["unbounded"] and page.written()[0]["triangle_count"] >= 8
    assert len(collide.tessellate(Plane((1, 2, 3), 0.5), size=1.0).faces) >= 2


def test_values_and_what_is_refused():
    wall = Plane((0, 0, 2), 1.0, 0.25)
    assert wall == pickle.loads(pickle.dumps(wall)) != Plane((0, 0, 2), 1.0) and isinstance(wall, collide.HPolytope)
    assert repr(wall) == "Plane(normal=[0.0, 0.0, 2.0], offset=1.0, thickness=0.25)" and wall.is_region
    assert wall.normals.tolist() == [[0, 0, 2], [0, 0, -2]] and wall.offsets.tolist() == [1.125, -0.875]
    for arguments, words in (
        (((0, 0, 0), 1), "Plane: normal must have a length"), (((0, 0, 1), np.nan), "Plane: offset must be finite"),
        (((0, 0, 1), 0, -1), "Plane: thickness must be ≥ 0, got -1"), (((0, 1), 0), "Plane: normal must have shape"),
        (((0, 0, 1), 0, "1"), "Plane: thickness must be a number"),
    ):
        with pytest.raises(InvalidShape, match=words):
            Plane(*arguments)
    with pytest.raises(InvalidShape, match=r"Compound: items\[0\] is an HPolytope with bounded=False, or a Plane"):
        collide.Compound([(wall, EYE)])
    with pytest.raises(UnsupportedQuery, match="or a Plane, may have no end"):
        collide.tessellate(wall)
    with pytest.raises(UnsupportedQuery, match="Plane"):
        collide.shape_cast(wall, EYE, (1, 0, 0), collide.Sphere(1), EYE)
    with pytest.raises(UnsupportedQuery, match="Plane and Halfspace: neither has an end"):
        collide.contacts(wall, collide.Halfspace((0, 1, 0), 0), EYE, EYE)
