"""Casts and rays at bodies of many facets or parts look at few of them; counted, not timed."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of
from reproduction import reproducing
from test_casts_of_unions import clutter

import collide
from collide.casts import cast_batches, convex_casts, exact_cast, mesh_casts, raycast, starts
from collide.casts.cast_trees import CASTS
from collide.numerics.exact_points import PlacedPoints
from collide.worlds import casts as world_casts

EYE = np.eye(4)


def rough_sheet(n: int, size: float = 1.0) -> collide.Mesh:
    """2 n² facets of an open surface."""
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, n + 1)] * 2)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([at, at + 1, at + n + 2], 1), np.stack([at, at + n + 2, at + n + 1], 1)])
    z = 0.05 * np.sin(9 * x) * np.cos(7 * y)
    return collide.Mesh(size * np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, solid=False)


@pytest.fixture
def walks(monkeypatch) -> list[tuple[int, int]]:
    """(questions, casts of facets) of every walk along trees."""
    seen: list[tuple[int, int]] = []
    walk = mesh_casts.cast_into_tree

    def counted(header_at, first, n, count_at, *rest):
        count = (ctypes.c_int64 * 2).from_address(count_at)
        before = count[CASTS]
        done = walk(header_at, first, n, count_at, *rest)
        seen.append((n - first, count[CASTS] - before))
        return done

    monkeypatch.setattr(mesh_casts, "cast_into_tree", counted)
    return seen


CURVED = {
    "rounded": collide.ConvexHull(0.4 * rng_of("a rounded hull").normal(size=(60, 3)), radius=0.1),
    "cone": collide.Cone(0.4, 0.8), "capsule": collide.Capsule(0.2, 0.6),
    "ellipsoid": collide.Ellipsoid((0.5, 0.3, 0.2)), "hull": collide.ConvexHull(bumpy_sphere(300)[0]),
}


@pytest.mark.parametrize("size", [1e-6, 0.01, 1.0])
@pytest.mark.parametrize("kind", CURVED)
def test_a_convex_set_before_a_fine_surface_is_cast_at_few_facets(walks, kind, size):
    """Within the box of the set are all facets; within how far it reaches along the normals of its casts are few."""
    sheet = rough_sheet(50, size)
    X = collide.pose((0.6 * 4, 0.48 * 4, 0.64 * 4), rpy=(0.3, -0.2, 0.5))
    for A, X_WA, B, X_WB, d in (
        (CURVED[kind], X, sheet, EYE, -X[:3, 3]), (sheet, EYE, CURVED[kind], X, X[:3, 3])
    ):
        walks.clear()
        r = collide.shape_cast(A, X_WA, d, B, X_WB)
        assert r.hit and r.certified and sum(casts for _, casts in walks) < 0.03 * len(sheet.faces), walks


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", CURVED)
def test_facets_that_are_left_out_come_later(kind):
    """The first contact is that of all facets, each cast at as a hull of its own."""
    sheet, hits = rough_sheet(6), 0
    facets = [collide.ConvexHull(sheet.vertices[face]) for face in sheet.faces]
    for seed in range(8):
        rng = rng_of("left out", kind, seed)
        X, Y = random_pose(rng, 0.0), random_pose(rng, 0.1)
        way = rng.normal(size=3)
        X[:3, 3] = Y[:3, 3] - 3.0 * way / np.linalg.norm(way)
        d, size = way + 0.2 * rng.normal(size=3), float(rng.choice([0.01, 1.0, 30.0]))
        mesh = collide.Mesh(size * sheet.vertices, sheet.faces, solid=False)
        ones = [collide.ConvexHull(size * facet.points) for facet in facets]
        again = "kind, size, X, d, Y = {kind!r}, {size}, np.array({X}), {d}, np.array({Y})"
        with reproducing(again, kind=kind, size=size, X=X.tolist(), d=d.tolist(), Y=Y.tolist()):
            r = collide.shape_cast(CURVED[kind], X, d, mesh, Y)
            each = collide.shape_cast(CURVED[kind], X, d, ones, Y)
            assert r.hit == each.hit.any()
            if r.hit:
                hits += 1
                assert each.lower[each.hit].min() <= r.upper and r.lower <= each.upper[each.hit].min()
    assert hits >= 4, hits


@pytest.mark.parametrize("moves", ["can", "mesh"])
def test_many_parts_before_one_surface_are_walked_together(walks, moves):
    """200 parts, all within the hull of a surface far larger: few walks, each no farther than the contacts before."""
    union, sheet = clutter((moves,), 200, "before a surface"), rough_sheet(30, 100.0)
    X = collide.pose((60.0, 48.0, 64.0), rpy=(0.3, -0.2, 0.5))
    for A, X_WA, B, X_WB, d in ((union, X, sheet, EYE, -X[:3, 3]), (sheet, EYE, union, X, X[:3, 3])):
        walks.clear()
        r = collide.shape_cast(A, X_WA, d, B, X_WB)
        assert r.hit and r.certified
        assert len(walks) <= 24 and sum(casts for _, casts in walks) < 2 * 200, walks


def test_meshes_are_cast_in_the_order_of_sets_around_them(walks, monkeypatch):
    """300 meshes before a large turned face, which the boxes of all come to at once."""
    union = clutter(("mesh",), 300, "before a face")
    large = collide.Box((1000.0, 1000.0, 1000.0))
    r = collide.shape_cast(union, collide.pose((0.0, 0.0, 900.0)), (0, 0, -1), large, collide.pose(rpy=(0.6, 0.5, 0.1)))
    assert r.hit and r.certified and 0 < len(walks) < 30, walks


def test_no_depth_is_worked_out_unless_it_is_asked_for(monkeypatch):
    asked: list[bool] = []
    for module in (cast_batches, starts):
        answer = module.answer_batch
        monkeypatch.setattr(
            module, "answer_batch", lambda *args, answer=answer: (asked.append(args[4].depths), answer(*args))[1]
        )
    union, other = clutter(("mesh",), 40, "A"), clutter(("mesh", "box"), 30, "B")
    r = collide.shape_cast(union, EYE, (1, 0, 0), other, EYE)
    assert r.hit and r.at_start and r.certified and not r.normal.any()
    parts = [collide.Compound([side.items[k]]) for side, k in ((union, r.item_a), (other, r.item_b))]
    assert collide.collide(*parts, EYE, EYE)
    for part in parts:  # the point is of both
        assert collide.distance(collide.Sphere(1e-9), part, collide.pose(r.point), EYE).distance <= 1e-12
    asked.clear()
    s = collide.shape_cast(union, EYE, (1, 0, 0), other, EYE, start_normals=True)
    own = collide.distance(*parts, EYE, EYE)
    assert asked.count(True) >= 1 and (s.item_a, s.item_b) == (r.item_a, r.item_b)
    assert np.array_equal(s.normal, own.normal) and np.array_equal(s.point, own.point_b)


@pytest.mark.parametrize("kinds", [("box",), ("mesh",), ("sphere", "mesh")])
def test_normals_at_the_start_are_those_of_distance(kinds):
    """One by one and in batches, of a World, too; every cast that touches, of some that do not."""
    A, B = clutter(("box", "sphere"), 12, "A"), clutter(kinds, 12, "B")
    rng, n = rng_of("start normals", *kinds), 12
    X = np.array([random_pose(rng, 0.7) for _ in range(n)])
    d = rng.normal(size=(n, 3))
    r, plain = (collide.shape_cast(A, X, d, B, EYE, start_normals=wanted) for wanted in (True, False))
    world = collide.World()
    world.add(B, EYE)
    of_world = world.shape_cast(A, X, d, start_normals=True)
    assert 3 <= r.at_start.sum() < n
    for k in range(n):
        if not r.at_start[k]:
            assert np.array_equal(r.normal[k], plain.normal[k]) and np.array_equal(r.point[k], plain.point[k])
            continue
        parts = [collide.Compound([side.items[i]]) for side, i in ((A, r.item_a[k]), (B, r.item_b[k]))]
        own = collide.distance(*parts, X[k], EYE)
        assert own.hit and np.array_equal(r.normal[k], own.normal) and np.array_equal(r.point[k], own.point_b)
        assert not plain.normal[k].any() and abs(np.linalg.norm(r.normal[k]) - 1.0) < 1e-12
        assert np.array_equal(of_world["normal"][k], r.normal[k])
        assert np.array_equal(collide.shape_cast(A, X[k], d[k], B, EYE, start_normals=True).normal, r.normal[k])


def test_start_normals_are_true_or_false():
    ball = collide.Sphere(1.0)
    for ask in (
        lambda: collide.shape_cast(ball, EYE, (1, 0, 0), ball, EYE, start_normals=1.5),
        lambda: collide.World().shape_cast(ball, EYE, (1, 0, 0), start_normals="yes"),
    ):
        with pytest.raises(collide.InvalidArgument, match="start_normals"):
            ask()


def test_what_touches_at_the_start_ends_a_cast_of_unions(monkeypatch):
    """Of 300 balls within a hull one is enough."""
    asked: list[int] = []
    answer = convex_casts.answer_part_pairs
    monkeypatch.setattr(
        convex_casts, "answer_part_pairs", lambda *args: (asked.append(len(args[1])), answer(*args))[1]
    )
    r = collide.shape_cast(clutter(("sphere",), 300, "within"), EYE, (1, 0, 0), collide.Box((9.0, 9.0, 9.0)), EYE)
    assert r.at_start and r.certified and sum(asked) <= 32, asked


def test_exact_casts_of_many_points_make_few_of_them_in_integers(monkeypatch):
    """A hull that grazes a box along an edge: doubles leave it open."""
    made: list[int] = []
    monkeypatch.setattr(
        PlacedPoints, "__iter__", lambda self: made.append(len(self)) or self._made(self._points.ravel().tolist())
    )
    points = rng_of("many points").normal(size=(20_000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    hull = collide.ConvexHull(np.concatenate([points, [(2.0, 0.0, 0.0)]]))
    r = collide.shape_cast(hull, collide.pose((-9.0, 0.0, 0.0)), (1, 0, 0), collide.Box((2.0, 2.0, 2.0)), EYE)
    graze = collide.shape_cast(
        hull, collide.pose((-9.0, 0.0, 0.0)), (0, 0, 1), collide.Box((14.0, 2.0, 2.0)), collide.pose((0, 0, 9.0))
    )
    assert r.hit and r.distance == 6.0 and graze.hit and graze.certified
    assert all(n < exact_cast._MIN_BY_DOUBLES for n in made), made


@pytest.mark.parametrize("all_hits", [False, True])
def test_rays_at_a_union_ask_meshes_whose_boxes_they_come_to(monkeypatch, all_hits):
    union = clutter(("mesh",), 300, "on rays")
    rng, n = rng_of("rays at a union"), 10
    origins = np.array([[3.0, 0.0, 0.0]]) + 0.2 * rng.normal(size=(n, 3))
    d = -origins + 0.3 * rng.normal(size=(n, 3))
    asked: list[int] = []
    met = raycast.facets_met
    monkeypatch.setattr(raycast, "facets_met", lambda *args: (asked.append(len(args[2])), met(*args))[1])
    hits = collide.raycast(union, EYE, origins, d, all_hits=all_hits)
    assert hits.hit.sum() >= 4 and sum(asked) < 0.1 * n * 300, sum(asked)
    world = collide.World()
    world.add(union, EYE)
    asked.clear()
    world.raycast(origins, d, all_hits=all_hits)
    assert sum(asked) < 0.1 * n * 300, sum(asked)
    rows = [collide.raycast(collide.Compound([item]), EYE, origins, d) for item in union.items]
    first = np.array([row.distance for row in rows])
    of_rays = hits.distance if not all_hits else np.array(
        [hits.distance[a:b].min(initial=np.inf) for a, b in zip(hits.starts[:-1], hits.starts[1:])]
    )
    assert np.array_equal(of_rays, first.min(axis=0))


def test_later_bodies_of_a_world_are_cast_at_no_farther_than_the_first(monkeypatch):
    """40 slanted bars one behind another, whose boxes overlap: a limit from the second body on."""
    limits: list[float] = []
    cast = world_casts.cast_batch
    monkeypatch.setattr(
        world_casts, "cast_batch", lambda *args: (limits.extend(args[5].tolist()), cast(*args))[1]
    )
    world = collide.World()
    for k in range(40):
        world.add(collide.Box((0.1, 4.0, 0.1)), collide.pose((5.0 + 0.05 * k, 0.0, 0.0), rpy=(0.0, 0.0, 0.7)))
    box, bodies = collide.Box((0.4, 0.4, 0.4)), [world.body(i) for i in world.ids]
    hits = world.shape_cast(box, EYE, (1, 0, 0))
    alone = [collide.shape_cast(box, EYE, (1, 0, 0), body.shape, body.X_WB) for body in bodies]
    assert hits["body"].tolist() == [world.ids[0]] and hits["certified"].all()
    assert hits["distance"][0] == min(r.distance for r in alone)
    assert np.isinf(limits[0]) and len(limits) > 1  # of vectors half as long as the direction
    assert max(limits[1:]) < 2.0 * hits["distance"][0] * (1 + 1e-5), limits
