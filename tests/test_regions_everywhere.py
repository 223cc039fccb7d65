"""Regions of half-spaces in Worlds, robots, casts, motions, scene files, reports and pages."""

from __future__ import annotations

import json

import numpy as np
import pytest
from naive import one_of_each, pose, random_pose, rng_of
from random_robots import random_configurations, random_robot
from regions import FAMILIES, by_far_box, region_rows
from reproduction import reproducing

import collide
from collide.adapters.peers.question import ask
from collide.pages.drawn_shapes import ShapeTable
from collide.reports import report
from collide.scenes import load

CLOSED = tuple(family for family in FAMILIES if family not in ("many", "flat"))


def shapes_of(rng, n: int):
    """(shape, whether it is a region) of bodies, every fourth a region."""
    for k in range(n):
        if k % 4 == 0:
            yield collide.HPolytope(*region_rows(rng, CLOSED[k // 4 % len(CLOSED)]), bounded=False), True
        else:
            shapes = one_of_each(rng)
            del shapes["Halfspace"], shapes["HPolytope"]
            yield list(shapes.values())[k % len(shapes)], False


def near(world: collide.World, limit: float) -> dict[tuple[int, int], float]:
    """What pairs of a World's bodies are at most that far apart, asked pair by pair."""
    bodies = [world.body(k) for k in world.ids]
    distances = {}
    for i, a in enumerate(bodies):
        for b in bodies[i + 1 :]:
            if (a.static and b.static) or (a.id, b.id) in world.allowed or not (a.group & b.mask and b.group & a.mask):
                continue
            r = collide.distance(a.shape, b.shape, a.X_WB, b.X_WB)
            if r.lower <= limit:
                distances[a.id, b.id] = float(r.distance)
    return distances


def test_a_world_that_changes_says_what_pairs_say():
    rng, hits = rng_of("regions in worlds"), 0
    world = collide.World()
    for k, (shape, is_region) in enumerate(shapes_of(rng, 16)):
        group, mask = (2, 0xFFFF) if k % 5 == 1 else (1, 1 if k % 5 == 2 else 0xFFFF)
        X_WB = random_pose(rng, 2.0)
        world.add(shape, X_WB, name=f"b{k}", static=is_region or k % 7 == 1, group=group, mask=mask)
    world.allow("b4", "b1")
    for step in range(5):
        movable = [k for k, name in world.names.items() if name not in ("b3", "b8")]
        for k in rng.choice(movable, 4, replace=False).tolist():
            world.set_pose(k, random_pose(rng, 2.0 if step < 3 else 400.0))  # far away: boxes grow
        if step == 2:
            world.remove("b5")
            world.add(collide.HPolytope([(0, 0, 1.0)], [-0.5], bounded=False), static=True, name="floor")
        expected = near(world, 0.4)
        for threads in (1, 2):
            r = world.distances(0.4, threads=threads)
            got = {(int(row["a"]), int(row["b"])): float(row["distance"]) for row in r}
            assert got.keys() == expected.keys()
            assert all(abs(got[pair] - expected[pair]) < 1e-6 for pair in got)
        hit = {pair for pair, distance in expected.items() if distance <= 0.0}
        r = world.collisions()
        assert {(int(row["a"]), int(row["b"])) for row in r} == hit and world.collides() == bool(hit)
        least = world.minimum(0.4)
        assert len(least) == bool(expected)
        assert not expected or abs(least["distance"][0] - min(expected.values())) < 1e-6
        touched = world.contacts(margin=0.1)
        assert {(int(row["a"]), int(row["b"])) for row in touched} == {p for p, d in expected.items() if d <= 0.1}
        hits += len(hit)
    assert hits >= 15, hits


def test_margins_and_questions_from_outside():
    world = collide.World()
    frustum = collide.HPolytope([(1, 0, -1), (-1, 0, -1), (0, 1, -1), (0, -1, -1.0)], np.zeros(4), bounded=False)
    world.add(frustum, pose(t=(0, 0, 1)), name="view", static=True)
    ball = world.add(collide.Sphere(0.1), pose(t=(2.0, 0, 1.0)), name="ball")
    gap = float(world.distances()["distance"][0])
    assert gap == pytest.approx(2.0 / 2**0.5 - 0.1, abs=1e-12) and not world.collides()
    world.set_margin("ball", gap + 1e-9)
    assert world.collides() and len(world.collisions()) == 1
    world.set_margin("ball", gap - 1e-9)
    assert not world.collides() and world.collides(security_margin=2e-9)
    world.set_pose(ball, pose(t=(0, 0, 5.0)))
    box, X_WB = collide.Box((0.5, 0.5, 0.5)), pose(t=(1.0, 0, 1.5))
    r = world.query(box, X_WB, max_distance=1.0)
    assert r["distance"][0] == collide.distance(box, frustum, X_WB, pose(t=(0, 0, 1))).distance
    r = world.query(collide.HPolytope([(0, 0, -1.0)], [-4.0], bounded=False), np.eye(4))
    assert r["hit"].tolist() == [True, True] and np.isneginf(r["distance"][0])  # both go on upwards for ever
    hits = world.raycast([(3, 0, 2.5), (3, 0, 0.5), (0, 0, 4.95)], [(-1, 0, 0), (-1, 0, 0), (1, 0, 0)])
    assert hits["hit"].tolist() == [True, False, True] and hits["distance"][0] == 1.5 and hits["facet"][0] == 0
    cast = world.shape_cast(collide.Sphere(0.25), pose(t=(5, 0, 2.0)), (-1, 0, 0))
    assert cast["distance"] == pytest.approx(4.0 - 0.25 * 2**0.5, abs=1e-9)
    assert world.nearest((0, 0, 0.5))["distance"] == pytest.approx(0.5)


def test_a_robot_among_regions():
    rng = rng_of("regions and robots")
    robot = random_robot(rng, n_links=4)
    world, region = collide.World(), collide.HPolytope(*region_rows(rng, "cone"), bounded=False)
    X_WB = random_pose(rng, 0.3)
    world.add(region, X_WB, name="keep out", static=True)
    checker, alone = collide.RobotChecker(robot, world), collide.RobotChecker(robot, collide.World())
    Q = random_configurations(rng, robot, 40)
    number = {link: k for k, link in enumerate(robot.links)}
    links = [link for link in robot.links if link in robot.geometry and link not in robot.base_links]
    expected = [
        bool(own) or any(
            collide.collide(element.shape, region, X_WL[number[link]] @ element.X_LG, X_WB)
            for link in links for element in robot.geometry[link]
        )
        for own, X_WL in zip(alone.collides(Q), robot.link_poses(Q))
    ]
    assert checker.collides(Q).tolist() == expected and 0 < sum(expected) < 40, sum(expected)


@pytest.mark.many(2)
@pytest.mark.parametrize("family", CLOSED)
def test_casts_rays_and_motions_as_closed_by_a_far_box(family):
    rng, seen = rng_of("region casts", family), [0, 0, 0]
    for _ in range(3):
        normals, offsets = region_rows(rng, family)
        region, closed = collide.HPolytope(normals, offsets, bounded=False), by_far_box(normals, offsets)
        X = random_pose(rng, 0.3)
        origins, goals = rng.normal(size=(40, 3)) * 3.0, rng.normal(size=(40, 3)) * 0.5
        rays = origins, goals - origins
        with reproducing("region = {normals}, {offsets}; X_WA = {X}", normals=normals, offsets=offsets, X=X):
            r, known = (collide.raycast(S, X, *rays, max_distance=3.0) for S in (region, closed))
            assert (r.hit == known.hit).all() and r.certified.all()
            assert np.allclose(r.distance[r.hit], known.distance[r.hit], atol=1e-11)
            assert np.allclose(r.normal[r.hit], known.normal[r.hit], atol=1e-9)
            seen[0] += int(r.hit.sum())
            r, known = (collide.raycast(S, X, *rays, max_distance=3.0, all_hits=True) for S in (region, closed))
            assert (r.starts == known.starts).all() and np.allclose(r.distance, known.distance, atol=1e-11)
            points = rng.normal(size=(30, 3))
            assert (collide.contains(region, X, points) == collide.contains(closed, X, points)).all()
            for kind, shape in list(one_of_each(rng).items())[:6]:
                start, goal = pose(t=rng.normal(size=3) * 4.0), pose(t=rng.normal(size=3) * 0.5)
                way = (goal - start)[:3, 3]
                r, known = (collide.shape_cast(shape, start, way, S, X, max_distance=1.0) for S in (region, closed))
                assert r.hit == known.hit and (r.certified or r.upper - r.lower < 1e-8), kind
                assert not r.hit or abs(r.distance - known.distance) < 1e-6
                endless = collide.shape_cast(shape, start, way, region, X)
                assert endless.hit >= r.hit and (not r.hit or abs(endless.distance - r.distance) < 1e-6)
                seen[1] += bool(r.hit)
                r, known = (collide.time_of_impact(S, shape, X, X, start, goal) for S in (region, closed))
                assert r.hit == known.hit and abs(r.time - known.time) < 1e-6, kind
                seen[2] += bool(r.hit)
    assert min(seen) >= 3, seen


def test_casts_along_planes():
    region = collide.HPolytope([(0, 0, 1.0), (1, 0, 0)], [0.0, 5.0], bounded=False)
    ball, X = collide.Sphere(0.5), np.eye(4)
    beside = collide.shape_cast(ball, pose(t=(-3, 0, 1.0)), (1, 0, 0), region, X)
    assert not beside.hit and beside.certified  # above the plane all the way, exactly
    grazing = collide.shape_cast(ball, pose(t=(9, 0, 0.25)), (-1, 0, 0), region, X)
    assert grazing.hit and grazing.distance == pytest.approx(4.0 - (0.5**2 - 0.25**2) ** 0.5, abs=1e-9)
    slowly = collide.shape_cast(ball, pose(t=(-3, 0, 1.0)), (-1, 0, -1e-4), region, X)
    assert slowly.hit and slowly.distance == pytest.approx(5000.0, rel=1e-9)
    never = collide.shape_cast(ball, pose(t=(-3, 0, 1.0)), (-1, 0, -1e-15), region, X)
    assert not never.hit and not never.certified  # too far to be followed: and said so
    r = collide.raycast(region, X, [(5, 0, -1), (6, 0, 0), (0, 0, 0)], [(0, 0, 1), (-1, 0, 0), (1, 0, 0)])
    assert r.hit.all() and r.distance.tolist() == [0.0, 1.0, 0.0] and r.facet.tolist() == [1, 0, 0]


SCENE = {
    "collide": 1,
    "units": "mm",
    "bodies": [
        {
            "name": "view", "static": True,
            "shape": {"hpolytope": {
                "normals": [[1, 0, -1], [-1, 0, -1], [0, 1, -1], [0, -1, -1], [0, 0, -1]],
                "offsets": [0, 0, 0, 0, -100], "bounded": False,
            }},
        },
        {"name": "can", "shape": {"cylinder": {"radius": 30, "length": 140}}, "pose": {"xyz": [0, 0, 300]}},
        {"name": "ball", "shape": {"sphere": {"radius": 20}}, "pose": {"xyz": [230, 0, 200]}},
    ],
}


def test_scene_files_reports_and_pages(tmp_path):
    file = tmp_path / "cell.json"
    file.write_text(json.dumps(SCENE))
    scene = load(file)
    view = scene.bodies[0]
    normals = SCENE["bodies"][0]["shape"]["hpolytope"]["normals"]
    assert view.shape == collide.HPolytope(normals, [0, 0, 0, 0, -0.1], bounded=False)
    made = report.make(scene, clearance=0.01)
    assert [{pair.a, pair.b} for pair in made.colliding] == [{"view", "can"}]
    assert [{pair.a, pair.b} for pair in made.near] == [{"view", "ball"}]
    page = ShapeTable(2.0)
    page.row([(view.shape, np.eye(4))])
    (drawn,) = page.written()
    assert drawn["unbounded"] and drawn["triangle_count"] >= 8 and page.boxes() == [None]


def test_peers_are_asked_about_regions_as_hulls():
    region, ball = collide.HPolytope([(0, 0, 1.0)], [0.0], bounded=False), collide.Sphere(0.5)
    pairs = [(region, ball, pose(t=(0, 0, 7.0)), pose(t=(0, 0, z))) for z in (8.0, 7.4)]
    asked = ask(pairs)
    assert all(isinstance(body.shape, (collide.ConvexHull, collide.Sphere)) for body in asked.bodies)
    up, low = (
        collide.distance(asked.bodies[i].shape, asked.bodies[j].shape, asked.bodies[i].X_WB, asked.bodies[j].X_WB)
        for i, j in asked.pairs
    )
    assert up.distance == pytest.approx(0.5, abs=1e-12) and low.distance == pytest.approx(-0.1, abs=1e-12)
