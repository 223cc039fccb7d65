"""Terrain walked prism by prism, beside distances of points from all facets, and beside the engine for meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from facet_distances import to_facets
from naive import pose, random_pose, rng_of, rotation
from reproduction import reproducing

import collide
from collide.lowering.parts import convex_set_of
from collide.narrowphase.facets.nearest_item_calls import gap_rows, surface_states
from collide.narrowphase.fields.terrain_columns import Columns

_SNIPPET = """
import collide, numpy as np
terrain = collide.HeightField(np.array({heights}), {cell}, bottom={bottom})
print(collide.distance(terrain, {shape}, np.array({X_WF}), np.array({X_WS}), signed=False))
"""


def terrains(rng):
    """Rough ground, ground with holes and a cliff, level ground; sides of cells differ, blocks are cut short."""
    rough = rng.normal(size=(37, 23)) * 0.2
    yield rough, (0.3, 0.2), -1.5
    with_holes = rough.copy()
    with_holes[rng.random(rough.shape) < 0.06] = math.nan
    with_holes[:, 12:] += 2.0
    yield with_holes, (0.25, 0.25), -3.0
    yield np.zeros((20, 40)), (0.1, 0.3), -0.5


def is_inside(points: np.ndarray, field: collide.HeightField) -> np.ndarray:
    """(n,) bool: below the triangle above or below a point, and above the bottom."""
    x, y = field.grid_lines
    j, i = np.searchsorted(x, points[:, 0]) - 1, np.searchsorted(y, points[:, 1]) - 1
    within = (j >= 0) & (j < len(x) - 1) & (i >= 0) & (i < len(y) - 1)
    i, j, z = np.where(within, i, 0), np.where(within, j, 0), field.heights
    u, v = (points[:, 0] - x[j]) / (x[j + 1] - x[j]), (points[:, 1] - y[i]) / (y[i + 1] - y[i])
    first = z[i, j] + u * (z[i, j + 1] - z[i, j]) + v * (z[i + 1, j + 1] - z[i, j + 1])
    second = z[i, j] + v * (z[i + 1, j] - z[i, j]) + u * (z[i + 1, j + 1] - z[i + 1, j])
    height = np.where(u >= v, first, second)
    whole = ~np.isnan(z[i, j] + z[i, j + 1] + z[i + 1, j] + z[i + 1, j + 1])  # NaN is no height
    return within & whole & (points[:, 2] < height) & (points[:, 2] > field.bottom)


@pytest.mark.many(3)
@pytest.mark.parametrize("seed", range(3))
def test_balls_are_as_far_as_the_nearest_facet(seed):
    rng, counts = rng_of("balls over terrain", seed), np.zeros(3, dtype=int)
    for heights, cell, bottom in terrains(rng):
        field = collide.HeightField(heights, cell, bottom=bottom)
        items, surface = Columns(field), collide.Mesh(field.vertices, field.faces, solid=False)
        reach = np.maximum(np.abs(items.low), np.abs(items.high))
        centres = rng.uniform(-1.3, 1.3, (80, 3)) * reach
        far = rng.uniform(-6.0, 6.0, (20, 3)) * reach
        for c in np.concatenate([centres, far]):
            ball, X_WF = collide.Sphere(float(rng.uniform(0.02, 0.4))), random_pose(rng, 3.0)
            X_WS = X_WF @ pose(rotation(rng), c)
            away, inside = float(to_facets(c[None], surface)[0]), bool(is_inside(c[None], field)[0])
            gap = -math.inf if inside else away - ball.radius
            margin = float(max(rng.choice([0.0, gap - 1e-9, gap + 1e-9, 0.3]), 0.0))
            with reproducing(_SNIPPET, heights=heights, cell=cell, bottom=bottom, shape=ball, X_WF=X_WF, X_WS=X_WS):
                asked = items.walked, convex_set_of(ball), X_WF[None], X_WS[None]
                state = surface_states(*asked, margin)
                assert bool(state.apart[0]) == (gap > margin)
                assert not state.meets[0] or gap <= 1e-12
                assert state.meets[0] or margin > 0.0 or not gap < -1e-9  # near ends a walk with a margin
                rows, written = gap_rows(*asked, False)
                if written[0] and not rows["hit"][0]:
                    rows["part_a"] = items.names_of_walked(rows, X_WF[None])
                    row = rows[0]
                    assert row["certified"] and row["lower"] - 1e-12 <= gap <= row["upper"] + 1e-12
                    p = (row["point_a"] - X_WF[:3, 3]) @ X_WF[:3, :3]
                    facets = field.faces if row["part_a"] < 0 else field.faces[row["part_a"]][None]
                    nearest = collide.Mesh(field.vertices, facets, solid=False)
                    assert to_facets(p[None], nearest)[0] <= 1e-9
                    counts[2] += int(row["part_a"] < 0)
                else:
                    assert gap < 1e-9
            counts[:2] += [gap < 0.0, gap > 0.0]
    assert counts.min() > 20, counts


def test_boxes_and_hulls_answer_as_beside_the_mesh():
    rng, hits, n = rng_of("boxes over terrain"), 0, 0
    for heights, cell, bottom in terrains(rng):
        field = collide.HeightField(heights, cell, bottom=bottom)
        items, mesh = Columns(field), collide.Mesh(field.vertices, field.faces)
        shapes = [
            collide.Box((0.5, 0.3, 0.2)), collide.ConvexHull(0.2 * rng.normal(size=(12, 3))), collide.Capsule(0.1, 0.4),
            collide.Cylinder(0.1, 0.3), collide.Ellipsoid((0.3, 0.2, 0.1)),
        ]
        for k in range(60):
            shape, X_WF = shapes[k % 5], random_pose(rng, 2.0)
            p = rng.uniform(-0.9, 0.9, 3) * items.high
            p[2] = items.high[2] + rng.uniform(-0.8, 0.4)
            X_WS = X_WF @ pose(rotation(rng), p)
            with reproducing(_SNIPPET, heights=heights, cell=cell, bottom=bottom, shape=shape, X_WF=X_WF, X_WS=X_WS):
                state = surface_states(items.walked, convex_set_of(shape), X_WF[None], X_WS[None])
                other = collide.distance(mesh, shape, X_WF, X_WS, signed=False)
                assert not state.meets[0] or other.hit
                assert not state.apart[0] or not other.hit
                rows, written = gap_rows(items.walked, convex_set_of(shape), X_WF[None], X_WS[None], False)
                if written[0] and not rows["hit"][0]:
                    assert rows["lower"][0] <= other.upper and other.lower <= rows["upper"][0]
                    assert rows["distance"][0] == pytest.approx(other.distance, abs=1e-9)
            hits, n = hits + bool(other.hit), n + 1
    assert 0.15 * n < hits < 0.85 * n, (hits, n)
