"""Height fields, planes and half-spaces: beside intervals of heights in fractions, at all sizes, and what is made."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from unittest import mock

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, random_pose
from naive_terrain import Terrain

import collide
from collide.narrowphase.fields import terrain_columns
from collide.shapes import height_field


def fields(heights, cell, bottom) -> list[collide.HeightField]:
    """Terrain as a mesh, and as if of too many cells for one."""
    small = collide.HeightField(heights, cell, bottom=bottom)
    with mock.patch.object(height_field, "_MAX_MESHED", 0):
        return [small, collide.HeightField(heights, cell, bottom=bottom)]


def column_intervals(field, X_WT, normal, t_WP) -> list[tuple[Fraction, Fraction]]:
    """Of each cell that is no hole the least and the largest normal · (p − t_WP) of its column's points p."""
    by_hand = Terrain(np.nan_to_num(field.heights), field.cell, field.bottom)
    R, t = ([[Fraction(float(v)) for v in row] for row in X_WT[:3, :3]], [Fraction(float(v)) for v in X_WT[:3, 3]])
    n = [Fraction(float(v)) for v in normal]
    along = [sum(n[k] * R[k][axis] for k in range(3)) for axis in range(3)]
    start = sum(n[k] * (t[k] - Fraction(float(t_WP[k]))) for k in range(3))
    found = []
    for i in range(field.heights.shape[0] - 1):
        for j in range(field.heights.shape[1] - 1):
            if np.isnan(field.heights[i : i + 2, j : j + 2]).any():
                continue
            corners = [
                start + along[0] * by_hand.x[v] + along[1] * by_hand.y[u] + along[2] * z
                for u in (i, i + 1) for v in (j, j + 1) for z in (by_hand.z[u][v], by_hand.bottom)
            ]
            found.append((min(corners), max(corners)))
    return found


def over_length(value: Fraction, normal) -> Decimal:
    """value / |normal|, to 60 digits."""
    square = sum(Fraction(float(v)) ** 2 for v in normal)
    with localcontext(prec=60):
        return Decimal(value.numerator) / Decimal(value.denominator) / (
            Decimal(square.numerator) / Decimal(square.denominator)
        ).sqrt()


def cases(rng, case: int):
    """(fields, X_WT, normal, t_WP): any poses, or multiples of an eighth turned by quarters."""
    shape, lattice = rng.integers(2, 9, 2), case % 2
    heights = rng.integers(0, 2, shape) / 8 if lattice else rng.normal(size=shape) * 0.2
    if case % 3 == 0:
        heights[rng.random(shape) < 0.15] = np.nan
        heights[:2, :2] = 0.125
    X_WT, normal = np.eye(4) if case % 4 == 1 else random_pose(rng, 0.5), rng.normal(size=3)
    t_WP = rng.normal(size=3) * 0.1
    if lattice:
        X_WT[:3, :3] = LATTICE_ROTATIONS[int(rng.integers(len(LATTICE_ROTATIONS)))]
        X_WT[:3, 3], t_WP = rng.integers(-4, 5, (2, 3)) / 8
        normal = rng.permutation([int(rng.integers(0, 2)), 0, int(rng.choice((-2, 1)))])
    return fields(heights, 0.25, -1.0), X_WT, normal.astype(float), t_WP


def offset_near(rng, intervals) -> float:
    """Of a plane through the terrain, beside it, or at an end of its heights to the last bit or but for it."""
    low, high = min(least for least, _ in intervals), max(most for _, most in intervals)
    end = float(low if rng.random() < 0.5 else high)
    kind = int(rng.integers(4))
    if kind < 2:
        return float(rng.uniform(float(low) - 0.3, float(high) + 0.3))
    return end if kind == 2 else float(np.nextafter(end, rng.choice((-np.inf, np.inf))))


@pytest.mark.many(9)
@pytest.mark.parametrize("seed", range(9))
def test_planes_and_half_spaces_beside_fractions(seed, monkeypatch):
    monkeypatch.setattr(terrain_columns, "_MAX_LEVEL", 2)
    rng, hits, touching, asked = np.random.default_rng([7, seed]), 0, 0, 0
    for case in range(24):
        both, X_WT, normal, t_WP = cases(rng, case)
        intervals, X_WP = column_intervals(both[0], X_WT, normal, t_WP), collide.pose(t_WP)
        offset, thickness = offset_near(rng, intervals), float(rng.choice((0.0, 0.0, 0.25)))
        plane = collide.Plane(normal, offset, thickness)
        high, low = Fraction(plane.offsets[0]), -Fraction(plane.offsets[1])
        meets = any(least <= high and most >= low for least, most in intervals)
        least, most = min(a for a, _ in intervals), max(b for _, b in intervals)
        signed = over_length(max(least - high, low - most), normal)
        below = over_length(least - Fraction(offset), normal)
        nearest = min(max(a - high, low - b) for a, b in intervals)
        for field in both:
            if field.has_holes and abs(nearest) < 1e-12:
                continue  # a mesh and the corners of a box around the plane, which are rounded
            named = (seed, case, field.is_field)
            half = collide.distance(field, collide.Halfspace(normal, offset), X_WT, X_WP)
            assert half.hit == (below <= 0) and Decimal(half.lower) <= below <= Decimal(half.upper), named
            for turned in (False, True):
                pair = (plane, field, X_WP, X_WT) if turned else (field, plane, X_WT, X_WP)
                assert collide.collide(*pair) == meets, named
                r, gap = collide.distance(*pair), collide.distance(*pair, signed=False)
                assert r.hit == gap.hit == meets, named
                if not field.has_holes:  # else columns may be apart, and a plane leave between them
                    assert Decimal(r.lower) <= signed <= Decimal(r.upper) and r.certified, named
                    part, off = r.part_b if turned else r.part_a, 1e-14 if meets else 1e-12
                    assert abs(float(signed) - r.distance) <= off, named
                    assert r.point_b - r.point_a == pytest.approx(r.distance * r.normal, abs=off), named
                    assert part == -1 if meets else part >= -1, named
                height = float(normal @ (gap.point_a - t_WP))
                assert gap.distance > 0.0 or float(low) - 1e-12 <= height <= float(high) + 1e-12, named
        asked, hits, touching = asked + 1, hits + meets, touching + (abs(nearest) < 1e-12)
    assert 0.3 * asked < hits < 0.9 * asked and touching >= 3, (asked, hits, touching)


def test_a_plane_through_terrain_asks_for_no_tree_and_every_batch_agrees():
    rng = np.random.default_rng(8)
    field, plane = collide.HeightField(rng.normal(size=(400, 300)), 0.1), collide.Plane((0.01, -0.02, 1.0), 0.1)
    X_WP = np.array([collide.pose((0, 0, z), rpy=(0.01, 0, 0)) for z in np.linspace(-2.0, 2.0, 5)])
    r = collide.distance(field, plane, np.eye(4), X_WP)
    assert r.hit.all() and r.certified.all() and collide.collide(field, plane, np.eye(4), X_WP).all()
    assert not hasattr(field, "_tree"), "a tree over the triangles takes seconds"
    above = np.array([collide.pose((0, 0, z)) for z in (0.0, 9.0)])
    far = collide.distance(field, plane, np.eye(4), above, max_distance=1.0)
    assert far.hit.tolist() == [True, False] and far.beyond.tolist() == [False, True]
    for k, X in enumerate(X_WP):
        assert collide.distance(field, plane, np.eye(4), X).rows.tobytes() == r.rows[k : k + 1].tobytes(), k
