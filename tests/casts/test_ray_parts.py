"""Rays against posed parts: walls by exact clipping and by formulas, candidates of a tree beside all parts."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, pose, random_pose, rng_of
from reproduction import reproducing

import collide
from collide.broadphase.box_tree import BoxTree
from collide.casts.cast_arguments import checked_rays
from collide.casts.posed_parts import PosedParts, posed_parts
from collide.casts.ray_parts import TreeOfParts, candidate_parts, parts_met
from collide.casts.rays_in_tree import TREE_RAY_DOUBLES, TREE_RAY_INTEGERS, parts_on_rays
from collide.kernels import address_of
from collide.lowering.parts import parts_of
from collide.worlds.hits import WORLD_HIT_DTYPE

EYE = np.eye(4)


def parts_for(items, X_WA=EYE[None]) -> PosedParts:
    return posed_parts([(parts_of(shape)[0][0], X) for shape, X in items], X_WA)


def chord_of_box(half, o, d) -> tuple[Fraction, Fraction] | None:
    first, last = None, None
    for h, x, v in zip(half, o, d):
        if v == 0:
            if abs(x) > h:
                return None
            continue
        near, far = sorted(((-h - x) / v, (h - x) / v))
        first, last = near if first is None else max(first, near), far if last is None else min(last, far)
    assert first is not None and last is not None
    return (first, last) if first <= last else None


@pytest.mark.parametrize("kind", ["box", "hull", "ring of tetrahedron"])
@pytest.mark.parametrize("every", [False, True])
def test_walls_of_lattice_boxes_are_exact(kind, every):
    """From inside, from walls, along walls, through edges and corners: what doubles leave open is decided in integers;
    hulls of the same corners, and with points to spare, answer as boxes do.
    """
    rng, seen = rng_of("walls", kind, every), Counter()
    half = np.array((1.0, 0.5, 1.5))
    corners = np.array(list(product((-1.0, 1.0), repeat=3))) * half
    if kind == "ring of tetrahedron":
        corners = np.vstack([corners, 0.5 * corners, [(1.0, 0.0, 0.0)]])
    shape = collide.Box(2 * half) if kind == "box" else collide.ConvexHull(corners)
    for _ in range(6):
        X = pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-2, 3, 3) * 0.5)
        local_o, local_d = rng.integers(-6, 7, (8, 3)) * 0.5, rng.integers(-2, 3, (8, 3)).astype(float)
        local_o[::2] = rng.integers(-2, 3, (4, 3)) * half * 0.5
        local_d[~local_d.any(axis=1)] = (1, 0, 0)
        limit = float(rng.choice([math.inf, 1.5]))
        origins, directions, _ = checked_rays("f", local_o @ X[:3, :3].T + X[:3, 3], local_d @ X[:3, :3].T)
        questions = np.stack([np.arange(8), np.zeros(8, dtype=np.int64)], axis=1)
        with reproducing("X, o, d = {X}, {o}, {d}  # in the box's frame", X=X, o=local_o, d=local_d):
            events = parts_met(parts_for([(shape, EYE)], X[None]), questions, origins, directions, limit, every)
            for k in range(8):
                chord = chord_of_box(
                    [Fraction(h) for h in half], *([Fraction(v) for v in w[k]] for w in (local_o, local_d))
                )
                walls = sorted({t for t in chord or () if 0 <= t <= limit})
                seen[len(walls)] += 1
                mine = np.flatnonzero(events.ray == k)
                mine = mine[np.argsort(events.t[mine, 0])]
                if not every and walls:
                    mine, walls = mine[:1], walls[:1]
                assert len(mine) == len(walls) and events.proven[mine].all() and events.certified[mine].all()
                for row, t in zip(mine, walls):
                    value, lower, upper = events.t[row].tolist()
                    assert Fraction(lower) <= t <= Fraction(upper) and lower <= value <= upper
                    assert events.item[row] == k
    assert all(seen[k] > 2 for k in range(3)), seen


def test_halfspaces_have_one_wall():
    half = collide.Halfspace((0, 0, 1), 0.5)
    rays = [((0, 0, 2), (0, 0, -1)), ((0, 0, 0), (0, 0, 2)), ((0, 0, 2), (0, 0, 1)), ((0, 0, 0.5), (1, 0, 0)),
            ((0, 0, 0), (1, 0, 0)), ((0, 0, 0.5), (0, 0, -1)), ((0, 0, 0.5), (0, 0, 1))]
    origins, directions, _ = checked_rays("f", *(np.array(side, dtype=float) for side in zip(*rays)))
    questions = np.stack([np.arange(7), np.zeros(7, dtype=np.int64)], axis=1)
    events = parts_met(parts_for([(half, EYE)]), questions, origins, directions, math.inf, True)
    assert dict(zip(events.ray.tolist(), events.t[:, 0].tolist())) == {0: 1.5, 1: 0.25, 3: 0.0, 5: 0.0, 6: 0.0}
    assert len(events.ray) == 5 and events.proven.all() and (events.normal == (0, 0, 1)).all()
    nothing = parts_met(parts_for([(half, EYE)]), questions[:0], origins, directions, math.inf, True)
    assert len(nothing.ray) == 0 and nothing.t.shape == (0, 3)


def test_balls_by_the_formula():
    rng = rng_of("rays and balls")
    X, o, at = random_pose(rng), rng.normal(size=(60, 3)) * 2, rng.normal(size=(60, 3)) * 0.4
    d = at + X[:3, 3] - o
    origins, directions, _ = checked_rays("f", o, d)
    questions = np.stack([np.arange(60), np.zeros(60, dtype=np.int64)], axis=1)
    events = parts_met(parts_for([(collide.Sphere(0.5), EYE)], X[None]), questions, origins, directions, 1.0, True)
    m = o - X[:3, 3]
    a, b, c = (d * d).sum(axis=1), (m * d).sum(axis=1), (m * m).sum(axis=1) - 0.25
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    ends = np.stack([(-b - root) / a, (-b + root) / a], axis=1).tolist()
    expected = [(k, t) for k in range(60) if b[k] ** 2 > a[k] * c[k] for t in ends[k] if 0 <= t <= 1]
    order = np.lexsort((events.t[:, 0], events.ray))
    assert events.ray[order].tolist() == [k for k, _ in expected] and 30 < len(expected) < 119
    np.testing.assert_allclose(events.t[order, 0], [t for _, t in expected], rtol=0, atol=1e-12)
    p = origins[events.ray] + events.t[:, :1] * d[events.ray]
    np.testing.assert_allclose(events.normal, 2.0 * (p - X[:3, 3]), rtol=0, atol=1e-12)
    assert events.proven.all() and events.certified.all()


class Scene:
    """Bodies of one to three balls and boxes, in a tree."""

    def __init__(self, rng, n: int):
        counts = rng.integers(1, 4, n)
        self.first = np.append(0, np.cumsum(counts)).astype(np.int64)
        self.items = []
        for _ in range(self.first[-1]):
            ball, block = collide.Sphere(float(rng.uniform(0.1, 0.4))), collide.Box(rng.uniform(0.2, 0.7, 3))
            X = pose(t=rng.uniform(-1, 1, 3) + 4.0 * rng.integers(-1, 2, 3))
            self.items.append((ball if rng.random() < 0.5 else block, X))
        self.parts = parts_for(self.items)
        half = np.array(
            [np.full(3, s.radius) if isinstance(s, collide.Sphere) else 0.5 * s.size for s, _ in self.items]
        )
        middle = np.array([X[:3, 3] for _, X in self.items])
        low, high = (np.array([f(b[i:j], axis=0) for i, j in zip(self.first, self.first[1:])])
                     for f, b in ((np.min, middle - half), (np.max, middle + half)))
        self.tree = BoxTree(np.hstack([low, high]), np.zeros(n, dtype=bool))
        self.low, self.high = low, high
        self.skipped, self.meshed = (rng.random((2, n)) < 0.25).astype(np.int64)

    def bodies(self) -> TreeOfParts:
        parts = self.parts
        return TreeOfParts(parts.table, parts.poses, parts.shape_of, self.tree, self.first, self.meshed)


@pytest.mark.parametrize("every", [False, True])
@pytest.mark.parametrize("limit", [math.inf, 1.0])
def test_candidates_hold_all_walls_and_none_of_what_is_skipped(every, limit):
    rng = rng_of("candidates", every, limit)
    scene = Scene(rng, 30)
    o = rng.uniform(-6, 6, (25, 3))
    at = np.array([scene.items[k][1][:3, 3] for k in rng.integers(0, len(scene.items), 25)])
    origins, directions, _ = checked_rays("f", o, at - o + 0.1 * rng.normal(size=(25, 3)))
    rows = None if every else np.empty(25, dtype=WORLD_HIT_DTYPE)
    found = candidate_parts(scene.bodies(), scene.skipped, origins, directions, limit, rows)
    pairs = set(map(tuple, found.tolist()))
    assert len(pairs) == len(found)
    body = np.searchsorted(scene.first, np.arange(len(scene.items)), "right") - 1
    assert not any(scene.skipped[body[part]] for _, part in pairs)
    asked = np.array([(k, part) for k in range(25) for part in range(len(scene.items))
                      if not scene.skipped[body[part]] and not scene.meshed[body[part]]])
    events = parts_met(scene.parts, asked, origins, directions, limit, True)
    n_needed = n_answered = 0
    for k in range(25):
        mine = np.flatnonzero(events.ray == k)
        needed = mine if every else mine[np.argsort(events.t[mine, 0])[:1]]
        n_needed += len(needed)
        if not every and not any(ray == k for ray, _ in pairs):  # answered: the first wall, or none
            row, n_answered = rows[k], n_answered + 1
            assert row["ray"] == k and row["hit"] == bool(len(needed)) and row["certified"] and not row["at_start"]
            for event in needed:
                part = asked[events.item[event], 1]
                assert (row["body"], row["item"]) == (body[part], part - scene.first[body[part]])
                assert [row["distance"], row["lower"], row["upper"]] == events.t[event].tolist()
                assert (row["normal"] == events.normal[event]).all() and row["facet"] == events.facet[event]
                point = o[k] + row["distance"] * (directions.vectors[k] * 2.0 ** directions.exponents[k])
                assert (row["point"] == point).all()
            continue
        assert all((k, asked[events.item[row], 1]) in pairs for row in needed)
    assert n_needed > 4 and (every or n_answered)
    # Of a mesh all parts, where the ray comes to its box: not beyond the limit, and in any case nowhere else.
    for k, part in pairs:
        if scene.meshed[body[part]]:
            with np.errstate(divide="ignore"):
                ends = np.array([scene.low[body[part]], scene.high[body[part]]]) - o[k]
                t = np.sort(ends / (directions.vectors[k] * 2.0 ** directions.exponents[k]), axis=0)
            assert t[0].max() <= min(t[1].min(), limit) + 1e-9 and t[1].min() >= -1e-9
            assert all((k, p) in pairs for p in np.flatnonzero(body == body[part]).tolist())


def test_more_candidates_than_room_are_counted():
    """The entry writes what there is room for, and says how many there are."""
    rng = rng_of("room for candidates")
    scene = Scene(rng, 12)
    o = rng.uniform(-6, 6, (10, 3))
    at = np.array([X[:3, 3] for _, X in scene.items[:10]])
    origins, directions, _ = checked_rays("f", o, at - o)
    scene.skipped, scene.meshed = scene.skipped * 0, scene.meshed * 0
    whole = candidate_parts(scene.bodies(), scene.skipped, origins, directions, math.inf, None)
    header = np.array([
        address_of(scene.tree.nodes), address_of(scene.tree.links), scene.tree.n_nodes, address_of(scene.first), 12,
        address_of(scene.skipped), address_of(scene.meshed), address_of(scene.tree.unbounded), 0,
    ])
    rays, limits = np.hstack([origins, directions.vectors]), np.full(10, math.inf)
    doubles, integers = np.zeros(TREE_RAY_DOUBLES), np.zeros(TREE_RAY_INTEGERS, dtype=np.int64)
    pairs = np.full((5, 2), -7, dtype=np.int64)
    count = parts_on_rays(
        *scene.parts.table.addresses, address_of(scene.parts.poses.rows), address_of(scene.parts.shape_of),
        address_of(header), address_of(rays), address_of(limits), address_of(directions.exponents), 10, 0,
        address_of(pairs), 3, address_of(doubles), address_of(integers),
    )
    assert count == len(whole) > 3 and np.array_equal(pairs[:3], whole[:3]) and (pairs[3:] == -7).all()
