"""Chords of rays with posed parts, through the entry that the engine calls: brackets, sides, and normals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cast_oracles import holds, on_ray, support_heights
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.casts import cut_parts as P
from collide.casts.posed_parts import PosedParts, posed_parts
from collide.casts.silhouette import CAST_INTEGERS
from collide.curved.chords import MET, MISSED
from collide.kernels import address_of
from collide.lowering.parts import parts_of

SHAPES = {
    "Sphere": collide.Sphere(0.5), "Capsule": collide.Capsule(0.3, 0.8), "Cylinder": collide.Cylinder(0.4, 0.7),
    "Cone": collide.Cone(0.5, 0.8), "Ellipsoid": collide.Ellipsoid((0.6, 0.3, 0.2)),
    "Box": collide.Box((0.6, 0.8, 0.5)),
    "Halfspace": collide.Halfspace((0.2, -0.3, 0.9), 0.1),
    "ConvexHull": collide.ConvexHull(rng_of("cut hull").normal(size=(12, 3)) * 0.4),
    "Rounded": collide.ConvexHull(rng_of("cut rounded").normal(size=(5, 3)) * 0.3, radius=0.15),
}


def cut(parts: PosedParts, questions, rays, both: bool) -> np.ndarray:
    questions, rays = np.ascontiguousarray(questions, dtype=np.int64), np.ascontiguousarray(rays)
    rows = np.full((len(questions), P.RAY_ROW), np.nan)
    doubles, integers = np.zeros(P.RAY_DOUBLES), np.zeros(CAST_INTEGERS, dtype=np.int64)
    P.cut_parts(
        *parts.table.addresses, address_of(parts.poses.rows), address_of(parts.shape_of), address_of(questions),
        address_of(rays), len(questions), both, address_of(rows), address_of(doubles), address_of(integers),
    )
    return rows


def parts_of_shape(shape, X) -> PosedParts:
    return posed_parts(list(parts_of(shape)), np.asarray(X)[None])


def drawn(name: str, n: int):
    rng = rng_of("cut parts", name)
    X = random_pose(rng, 0.5)
    at, origins = X[:3, 3] + rng.normal(size=(n, 3)) * 0.3, X[:3, 3] + rng.normal(size=(n, 3)) * 2.0
    v = at - origins
    return X, np.hstack([origins, v / (2.0 * np.abs(v).max(axis=1)[:, None])])


@pytest.mark.parametrize("name", SHAPES)
def test_rows_say_where_lines_enter_and_leave(name):
    shape = SHAPES[name]
    X, rays = drawn(name, 40)
    rows = cut(parts_of_shape(shape, X), [(k, 0) for k in range(40)], rays, True)
    n_met = 0
    for ray, row in zip(rays, rows):
        if row[P.STATE] != MET:
            continue
        n_met += 1
        o, d = ray[:3], ray[3:]
        with reproducing("ray = {ray}  # tests/casts/test_cut_parts.py", ray=ray):
            for lower, value, upper, normal, sign in (
                (P.FIRST_LOWER, P.FIRST, P.FIRST_UPPER, P.FIRST_NORMAL, -1.0),
                (P.LAST_LOWER, P.LAST, P.LAST_UPPER, P.LAST_NORMAL, 1.0),
            ):
                if not math.isfinite(row[value]):
                    assert name == "Halfspace"
                    continue
                assert row[lower] <= row[value] <= row[upper] < row[lower] + 1e-8
                n = row[normal : normal + 3]
                assert abs(np.linalg.norm(n) - 1.0) < 1e-12 and sign * (n @ d) > -1e-9
                if name != "Halfspace":  # the plane there holds the body: that makes the normal its own
                    p = o + row[value] * d
                    height = support_heights(shape, X, n[None])[0]
                    assert abs(float(n @ p) - height) < 1e-7
                if name not in ("ConvexHull", "Rounded"):
                    outer, inner = (lower, upper) if sign < 0 else (upper, lower)
                    assert not holds(shape, X, on_ray(o, d, np.nextafter(row[outer], sign * np.inf)))
                    assert holds(shape, X, on_ray(o, d, row[inner]))
    assert n_met > 12


@pytest.mark.parametrize("name", SHAPES)
def test_batches_are_singles_and_misses_are_said(name):
    shape = SHAPES[name]
    X, rays = drawn(name, 12)
    rays[6:, 3:] = np.roll(rays[6:, 3:], 1, axis=1)
    parts = parts_of_shape(shape, X)
    rows = cut(parts, [(k, 0) for k in range(12)], rays, True)
    for k in range(12):
        assert cut(parts, [(k, 0)], rays, True).tobytes() == rows[k].tobytes()
        if rows[k, P.STATE] == MISSED and name not in ("ConvexHull", "Rounded"):
            assert not any(holds(shape, X, on_ray(rays[k, :3], rays[k, 3:], t)) for t in np.linspace(-9, 9, 13))
    entered = cut(parts, [(k, 0) for k in range(12)], rays, False)
    met = (rows[:, P.STATE] == MET) & (rows[:, P.FIRST_LOWER] > 0.0)
    columns = [P.STATE, P.FIRST_LOWER, P.FIRST, P.FIRST_UPPER, *range(P.FIRST_NORMAL, P.FIRST_NORMAL + 3)]
    assert np.array_equal(entered[met][:, columns], rows[met][:, columns])


def test_questions_name_rays_and_parts():
    compound = collide.Compound([(SHAPES["Sphere"], np.eye(4)), (SHAPES["Box"], collide.pose((3, 0, 0)))])
    parts = parts_of_shape(compound, np.eye(4))
    rays = np.array([(-5.0, 0, 0, 0.5, 0, 0), (3.0, 0, 5.0, 0, 0, -0.5)])
    rows = cut(parts, [(0, 1), (1, 0), (0, 0), (1, 1)], rays, True)
    assert (rows[:, P.STATE] == (MET, MISSED, MET, MET)).all()
    np.testing.assert_allclose(rows[[0, 2, 3], P.FIRST], [2 * 7.7, 2 * 4.5, 2 * 4.75], rtol=0, atol=1e-12)
    assert rows[0, P.FIRST_NORMAL] == -1.0 and rows[3, P.FIRST_NORMAL + 2] == 1.0 and rows[3, P.LAST_NORMAL + 2] == -1.0


def test_boxes_and_hulls_of_their_corners_agree():
    """A box has a closed form, a hull of the same corners turned by a lattice rotation is cast upon."""
    box = SHAPES["Box"]
    corners = np.array([[x, y, z] for z in (-0.25, 0.25) for y in (-0.4, 0.4) for x in (-0.3, 0.3)])
    hull = collide.ConvexHull(corners)
    X, rays = drawn("Box", 30)
    questions = [(k, 0) for k in range(30)]
    one, other = (cut(parts_of_shape(shape, X), questions, rays, True) for shape in (box, hull))
    met = (one[:, P.STATE] == MET) & (other[:, P.STATE] == MET)
    assert met.sum() > 15 and not ((one[:, P.STATE] == MET) & (other[:, P.STATE] == MISSED)).any()
    columns = [P.FIRST, P.LAST, *range(P.FIRST_NORMAL, P.RAY_ROW)]
    np.testing.assert_allclose(one[met][:, columns], other[met][:, columns], rtol=0, atol=1e-9)
