"""What convex pieces leave outside, and how far they exceed: closed forms, and points judged one at a time."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from facet_distances import to_facets
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of
from solid_membership import windings

import collide
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.spheres.body_facets import body_parts
from collide.spheres.moved_cells import SolidFacets
from collide.spheres.sphere_audit import audit_spheres

CUBE = collide.Mesh(*box())
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def boxes(*sizes_and_middles) -> collide.Compound:
    return collide.Compound([(collide.Box(size), collide.pose(middle)) for size, middle in sizes_and_middles])


def angle() -> collide.Mesh:
    """A square of side 2, a square of side 1 cut from a corner, 1 high."""
    rim = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    vertices = np.vstack([np.column_stack([rim, np.full(6, z)]) for z in (0.0, 1.0)])
    fan = [(0, k, k + 1) for k in range(1, 5)]
    sides = [((k, j, j + 6), (k, j + 6, k + 6)) for k in range(6) for j in [(k + 1) % 6]]
    top = [tuple(k + 6 for k in t) for t in fan]
    return collide.Mesh(vertices, [*(t[::-1] for t in fan), *top, *(t for pair in sides for t in pair)])


def test_a_hull_contains_its_mesh_and_fills_the_notch():
    """The farthest place of the hull is the middle of the slope over the notch: half from both sides of the notch."""
    shape = angle()
    for X in (np.eye(4), random_pose(rng_of("a hull"))):
        audit = collide.audit_pieces(
            collide.Compound([(shape, X)]), collide.Compound([(collide.ConvexHull(shape.vertices), X)])
        )
        assert audit.encloses and audit.outside == audit.share == (0.0, 0.0)
        assert audit.excess[0] <= 0.5 <= audit.excess[1] < audit.excess[0] + 0.007, audit.excess
    less = collide.audit_pieces(shape, boxes(((2, 1, 1), (1, 0.5, 0.5))))
    assert less.outside[0] <= 1.0 <= less.outside[1] < 1.001 and not less.encloses
    assert less.excess[1] < 1e-6


def test_a_cube_cut_in_two_is_neither_missed_nor_exceeded():
    audit = collide.audit_pieces(CUBE, boxes(((1, 2, 2), (-0.5, 0, 0)), ((1, 2, 2), (0.5, 0, 0))))
    assert audit.outside[0] == 0.0 and audit.outside[1] < 1e-12 and audit.share[1] < 1e-8
    assert audit.excess[0] == 0.0 and audit.excess[1] < 1e-6
    apart = collide.audit_pieces(CUBE, boxes(((1, 2, 2), (-0.51, 0, 0)), ((1, 2, 2), (0.51, 0, 0))))
    assert apart.outside[0] <= 0.01 <= apart.outside[1] < 0.0101
    assert apart.excess[0] <= 0.01 <= apart.excess[1] < 0.0113
    share = 4 * 2 * 0.02 / 24  # a slot around the cube
    assert apart.share[0] <= share <= apart.share[1] < share + 0.005


def test_pieces_that_overlap_contain_a_solid():
    audit = collide.audit_pieces(CUBE, boxes(((1.2, 2.2, 2.2), (-0.5, 0, 0)), ((1.2, 2.2, 2.2), (0.5, 0, 0))))
    assert audit.encloses and audit.outside == (0.0, 0.0) and not len(audit.patches) and not len(audit.holes)
    assert audit.excess[0] <= 0.03**0.5 <= audit.excess[1] < 0.03**0.5 * 1.02  # over a corner, by 0.1 each way


def test_walls_around_a_solid_leave_a_hole():
    """Six plates hold all facets of a cube, and no point of the middle."""
    axes = np.eye(3, dtype=bool)
    plates = boxes(*((np.where(k, 0.3, 2.2), np.where(k, side, 0.0)) for k in axes for side in (-1, 1)))
    audit = collide.audit_pieces(CUBE, plates)
    assert not audit.encloses and audit.outside == (0.0, 0.0) and len(audit.holes)
    assert np.abs(audit.holes).max() < 0.85
    surface = collide.Mesh(CUBE.vertices, CUBE.faces, solid=False)
    assert collide.audit_pieces(surface, plates).encloses


def test_a_corner_left_out_is_measured():
    """Three quarters of the way along its edges a corner is cut off."""
    cut = collide.ConvexHull(np.vstack([CORNERS[:-1], 1.0 - 0.5 * np.eye(3)]))
    audit = collide.audit_pieces(CUBE, cut)
    assert audit.outside[0] <= 0.5 / 3**0.5 <= audit.outside[1] < audit.outside[0] + 1e-3
    assert audit.farthest == pytest.approx(np.ones(3)) and audit.area == pytest.approx(24.0)
    assert audit.share[0] <= 3 * 0.125 / 24 <= audit.share[1] < audit.share[0] + 0.006
    assert audit.excess[1] < 1e-6


@pytest.mark.parametrize(
    "shape",
    [collide.Cylinder(0.5, 1.0), collide.Cone(0.5, 1.0), collide.Ellipsoid((0.3, 0.4, 0.5)), collide.Capsule(0.2, 0.5),
     collide.ConvexHull(CORNERS, radius=0.1), collide.Box((1, 2, 3))],
)
def test_a_shape_contains_itself_exactly(shape):
    X = random_pose(rng_of("itself", type(shape).__name__))
    audit = collide.audit_pieces(collide.Compound([(shape, X)]), collide.Compound([(shape, X)]))
    assert audit.encloses and audit.outside == audit.excess == (0.0, 0.0)


def test_cylinders_around_a_cube():
    """A cylinder of radius r around a cube goes beyond most at the rim over a side, and contains it from √2 on."""
    for radius in (1.5, 1.35):
        audit = collide.audit_pieces(CUBE, collide.Cylinder(radius, 2.2))
        assert audit.encloses == (radius > 2**0.5)
        beyond = np.hypot(radius - 1.0, 0.1)
        assert audit.excess[0] <= beyond <= audit.excess[1] < beyond * 1.01 + 0.016, audit.excess
        missed = max(2**0.5 - radius, 0.0)
        assert audit.outside[0] <= missed <= audit.outside[1] < missed + 1e-3


def test_spheres_are_judged_as_spheres():
    centers, radii = np.array([(0.3, 0, 0), (-0.3, 0, 0)]), np.array([1.3, 1.4])
    balls = collide.Compound([(collide.Sphere(r), collide.pose(c)) for c, r in zip(centers, radii)])
    audit, same = collide.audit_pieces(CUBE, balls), audit_spheres(CUBE, centers, radii)
    assert all(np.array_equal(a, b) for a, b in zip(audit, same)) and audit.outside[0] > 0.0


def test_two_blocks_of_a_mesh_lie_in_a_hull_each():
    """No piece holds all of the mesh, each shell lies in a piece: the inside is known from the shells."""
    (v, f), step = box(), np.array([3.0, 0.0, 0.0])
    mesh = collide.Mesh(np.vstack([v, v + step]), np.vstack([f, f + len(v)]))
    pieces = collide.Compound([(collide.ConvexHull(v + k * step), np.eye(4)) for k in (0, 1)])
    audit = collide.audit_pieces(mesh, pieces)
    assert audit.encloses and audit.excess[1] < 1e-6
    whole = collide.audit_pieces(mesh, collide.ConvexHull(mesh.vertices))
    assert whole.encloses and whole.excess[0] <= 0.5 <= whole.excess[1] < 0.54


def test_an_open_mesh_is_exceeded_from_nothing():
    mesh = collide.Mesh(box()[0], box()[1][:-2])
    audit = collide.audit_pieces(mesh, collide.Box((2.2, 2.2, 2.2)))
    assert audit.encloses and audit.excess[0] == 0.0 and audit.excess[1] >= 0.03**0.5


def test_a_cavity_inside_a_cell_is_seen():
    """A tetrahedron in a solid with a small cavity meets no facet, and is not in the solid."""
    v, f = box()
    for center, is_within in (((0.0, 0.0, 0.0), False), ((0.8, 0.8, 0.8), True)):
        hollow = collide.Mesh(np.vstack([v, 0.02 * v + center]), np.vstack([f, f[:, ::-1] + len(v)]))
        assert hollow.solid
        (part,) = body_parts(hollow)
        cell = 0.5 * np.array([(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)])
        cell[:, 0] += 0.1  # the middle beside the cavity
        assert SolidFacets(part, 1e-14).hold_moved(cell[None], 1e-9, 1.0).tolist() == [is_within]


# --- points, one at a time ----------------------------------------------------------------------


def far_from_box(points: np.ndarray, size: np.ndarray, X: np.ndarray) -> np.ndarray:
    away = np.abs((points - X[:3, 3]) @ X[:3, :3]) - 0.5 * size
    return np.sqrt(np.square(np.maximum(away, 0.0)).sum(axis=1))


def far_from_tetrahedron(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    weights = np.linalg.solve(np.vstack([corners.T, np.ones(4)]), np.vstack([points.T, np.ones(len(points))]))
    away = to_facets(points, collide.Mesh(corners, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)], solid=False))
    return np.where((weights >= 0.0).all(axis=0), 0.0, away)


def far_from_solid(points: np.ndarray, mesh: collide.Mesh) -> np.ndarray:
    triangles = [[[Fraction(float(x)) for x in p] for p in t] for t in mesh.vertices[mesh.faces]]
    inside = np.array([number is None or number > 0 for number in windings(triangles, points)])
    return np.where(inside, 0.0, to_facets(points, mesh))


def of_facets(mesh: collide.Mesh, n: int, rng) -> np.ndarray:
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    some = corners[rng.choice(len(corners), n, p=area / area.sum())]
    return np.einsum("ij,ijk->ik", rng.dirichlet(np.ones(3), n), some)


@pytest.mark.parametrize("case", range(6))
@pytest.mark.many(6)
def test_points_keep_within_the_brackets(case):
    """Random boxes and tetrahedra beside random meshes: no point is farther than an upper bound, and points drawn where
    bounds say are nearly as far as the lower.
    """
    rng = rng_of("pieces", case)
    mesh = collide.Mesh(*(block_ring() if case % 2 else bumpy_sphere(120, case)))
    extent = np.ptp(mesh.vertices, axis=0).max()
    sizes = extent * rng.uniform(0.1, 0.6, (3, 3))
    poses = [random_pose(rng, 0.3 * extent) for _ in sizes]
    corners = mesh.vertices[rng.choice(len(mesh.vertices), (3, 4))] + rng.normal(size=(3, 4, 3)) * 0.2 * extent
    pieces = collide.Compound(
        [(collide.Box(size), X) for size, X in zip(sizes, poses)]
        + [(collide.ConvexHull(some), np.eye(4)) for some in corners]
    )
    audit = collide.audit_pieces(mesh, pieces)

    surface = of_facets(mesh, 3000, rng)
    away = np.min([far_from_box(surface, size, X) for size, X in zip(sizes, poses)]
                  + [far_from_tetrahedron(surface, some) for some in corners], axis=0)
    assert away.max() <= audit.outside[1] + 1e-12, (case, away.max(), audit.outside)
    assert away.max() >= 0.7 * audit.outside[0], (case, away.max(), audit.outside)
    there = np.min([far_from_box(audit.farthest[None], size, X) for size, X in zip(sizes, poses)]
                   + [far_from_tetrahedron(audit.farthest[None], some) for some in corners])
    assert there >= audit.outside[0] - 1e-12 > 0.0, (case, there, audit.outside)
    share, spread = (away > 0.0).mean(), 4 * 0.5 / 3000**0.5
    assert audit.share[0] - spread <= share <= audit.share[1] + spread, (case, share, audit.share)
    assert 0.05 < share < 0.99, case

    inside = [(rng.uniform(-0.5, 0.5, (200, 3)) * size) @ X[:3, :3].T + X[:3, 3] for size, X in zip(sizes, poses)]
    inside += [(0.5 * size * CORNERS) @ X[:3, :3].T + X[:3, 3] for size, X in zip(sizes, poses)]
    inside += [np.vstack([rng.dirichlet(np.ones(4), 200) @ some, some]) for some in corners]
    beyond = far_from_solid(np.concatenate(inside), mesh)
    assert (beyond > 0.0).mean() > 0.1, case
    assert 0.7 * audit.excess[0] <= beyond.max() <= audit.excess[1] + 1e-12, (case, beyond.max(), audit.excess)
    assert audit.excess[1] <= 1.03 * audit.excess[0] + 0.01 * extent, (case, audit.excess)


# --- arguments ----------------------------------------------------------------------------------


def test_what_is_no_piece_is_refused():
    for pieces, error, words in (
        (angle(), UnsupportedQuery, "pieces: a Mesh of 20 facets is not convex: give ConvexHull"),
        (collide.Mesh(box()[0], box()[1][:-2]), UnsupportedQuery, "is not convex"),
        (collide.Halfspace((0, 0, 1), 0.0), UnsupportedQuery, "pieces: a Halfspace has no facets around it"),
        (collide.PointCloud(np.zeros((1, 3)), 0.1), UnsupportedQuery, "pieces: a PointCloud"),
        ([collide.Box((1, 1, 1))], InvalidArgument, "audit_pieces: pieces must be a shape"),
    ):
        with pytest.raises(error, match=words):
            collide.audit_pieces(CUBE, pieces)
    with pytest.raises(InvalidArgument, match="audit_pieces: shape must be a shape"):
        collide.audit_pieces(None, CUBE)
    with pytest.raises(UnsupportedQuery, match="shape: a Halfspace"):
        collide.audit_pieces(collide.Halfspace((0, 0, 1), 0.0), CUBE)
    assert collide.audit_pieces(CUBE, CUBE).encloses  # a convex mesh is its own hull
