"""What spheres leave outside: brackets against closed forms, and against points in fractions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.spheres.sphere_audit import audit_spheres

BALL = np.zeros((1, 3)), np.array([1.2])


def test_a_ball_inside_a_cube_leaves_known_parts_outside():
    """Of a cube of side 2 a ball of radius r, 1 < r < √2, covers on each side a disc of radius √(r² − 1)."""
    audit = audit_spheres(collide.Box((2, 2, 2)), *BALL)
    outside = 3**0.5 - 1.2
    assert not audit.encloses and audit.outside[0] <= outside <= audit.outside[1]
    assert audit.outside[1] - audit.outside[0] < 1e-3
    assert np.linalg.norm(audit.farthest) == pytest.approx(3**0.5)
    share = 1.0 - math.pi * (1.2**2 - 1.0) / 4.0
    assert audit.share[0] <= share <= audit.share[1] <= audit.share[0] + 0.006
    assert audit.area == pytest.approx(24.0) and audit.excess[0] <= 0.2 <= audit.excess[1] + 1e-12
    drawn = np.cross(audit.patches[:, 1] - audit.patches[:, 0], audit.patches[:, 2] - audit.patches[:, 0])
    assert 0.5 * np.linalg.norm(drawn, axis=1).sum() == pytest.approx(share * 24.0, rel=0.02)


@pytest.mark.slow
def test_spheres_that_enclose_are_known_to():
    for name, shape in {
        "ring": collide.Mesh(*block_ring()), "capsule": collide.Capsule(0.1, 1.0),
        "open": collide.Mesh(box()[0], box()[1][:-2]),
    }.items():
        made = collide.enclosing_spheres(shape, 6)
        audit = audit_spheres(shape, made.centers, made.radii)
        assert audit.encloses and audit.outside == audit.share == (0.0, 0.0), name
        assert not len(audit.patches) and not len(audit.holes)
        less = audit_spheres(shape, made.centers, made.radii * 0.98)
        assert not less.encloses and less.outside[1] > 0.0, name


def test_a_sphere_is_inside_itself_and_in_no_smaller_ball():
    X = random_pose(rng_of("a sphere in itself"))
    shape = collide.Compound([(collide.Sphere(0.5), X)])
    assert audit_spheres(shape, X[None, :3, 3], np.array([0.5])).encloses
    less = audit_spheres(shape, X[None, :3, 3], np.array([0.45]))
    assert not less.encloses and less.outside[0] <= 0.05 <= less.outside[1] < 0.06


def test_balls_all_over_a_solid_leave_a_hole_inside():
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3), axis=-1).reshape(-1, 3)
    skin = grid[np.abs(grid).max(axis=1) == 1.0]
    audit = audit_spheres(collide.Mesh(*box()), skin, np.full(len(skin), 0.2))
    assert not audit.encloses and len(audit.holes) and np.abs(audit.holes).max() < 1.0
    assert audit_spheres(collide.Mesh(*box(), solid=False), skin, np.full(len(skin), 0.2)).encloses


def test_brackets_hold_for_points_of_the_surface():
    """Random balls around random meshes: points of facets in fractions are as far outside as the brackets say."""
    rng, n_outside = rng_of("audits"), 0
    for case in range(8):
        mesh = collide.Mesh(*(block_ring() if case % 2 else bumpy_sphere(200, case)))
        centers = mesh.vertices[rng.integers(0, len(mesh.vertices), 6)] * rng.uniform(0.2, 0.9)
        radii = rng.uniform(0.3, 1.2, 6)
        audit = audit_spheres(mesh, centers, radii)
        corners = mesh.vertices[mesh.faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        facets = rng.choice(len(corners), 4000, p=area / area.sum())
        u = np.sort(rng.random((4000, 2)), axis=1)
        weights = np.column_stack([u[:, 0], u[:, 1] - u[:, 0], 1 - u[:, 1]])
        points = np.einsum("ij,ijk->ik", weights, corners[facets])
        away = (np.linalg.norm(points[:, None] - centers, axis=2) - radii).min(axis=1)
        n_outside += int((away > 0).sum())
        assert away.max() <= audit.outside[1] + 1e-12, (case, away.max(), audit.outside)
        assert away.max() >= 0.8 * audit.outside[0] - 0.02, (case, away.max(), audit.outside)
        share, spread = (away > 0).mean(), 4 * 0.5 / 4000**0.5
        assert audit.share[0] - spread <= share <= audit.share[1] + spread, (case, share, audit.share)
        if audit.outside[0] > 0.0:  # where it is said to be outside by so much it is
            p = [Fraction(float(x)) for x in audit.farthest]
            squares = [sum((x - Fraction(float(y))) ** 2 for x, y in zip(p, c)) for c in centers]
            reach = [(Fraction(float(r)) + Fraction(audit.outside[0])) ** 2 for r in radii]
            assert all(s >= t for s, t in zip(squares, reach)), case
    assert n_outside > 4000
