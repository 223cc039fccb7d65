"""Configuration obstacles of solids: where the moved bodies meet, pieces of two edges, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import box
from obstacle_judge import TETRAHEDRON, TURNED, cases, judge_obstacle, pose_of, snippet_obstacle
from solid_families import joined, turned_over

import collide
from collide.errors import CollideError, InvalidArgument, InvalidPose, UnsupportedQuery
from collide.solids import configuration_obstacle as module
from collide.solids import convolution as convolution_module

I = np.eye(4)


@pytest.mark.many(2)
@pytest.mark.parametrize(
    "name", [name for name in cases() if name not in ("rings", "turned boxes", "cells 1", "bumpy")]
)
def test_positions_are_where_the_bodies_meet(name):
    """Around, within 1e-9 of facets, an ulp off, and on them, where they touch."""
    v = judge_obstacle(*cases()[name], 60, 1, 1)
    assert not v.wrong, f"{v.wrong[:3]}\n{snippet_obstacle(name, 60, 1, 1)}"
    assert 0.1 * v.n_points < v.n_in < 0.9 * v.n_points


def test_two_tetrahedra_have_facets_that_no_copy_has():
    """Facets edge + edge lie in no plane of the copies p + B and A + q, which theorem 7.2's proof arranges."""
    A = collide.Mesh(*TETRAHEDRON)
    r = collide.configuration_obstacle(A, A, TURNED)
    sums = (A.vertices[:, None] - (A.vertices @ TURNED.T)[None]).reshape(-1, 3)
    hull = collide.Mesh(*collide.tessellate(collide.ConvexHull(sums))[:2])
    assert r.mesh.report.volume == pytest.approx(hull.report.volume, rel=1e-12)
    normals = _normals(A.vertices[A.faces])
    of_copies = np.concatenate([normals, -normals @ TURNED.T])
    of_sum = _normals(r.mesh.vertices[r.mesh.faces])
    on_none = (np.abs(of_sum @ of_copies.T) < 1 - 1e-9).all(axis=1)
    assert 8 <= on_none.sum() < len(on_none)


def _normals(corners):
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return n / np.sqrt((n * n).sum(axis=1))[:, None]


def test_the_mesh_is_what_was_decided_but_for_rounding():
    A, B, R = cases()["bumpy"]
    r = collide.configuration_obstacle(A, B, R)
    exact = module.exact_obstacle(A, B, pose_of(R))
    triangles, _ = exact.arrangement.boundary(exact.keep)
    points = exact.arrangement.points
    grid = 2.0**exact.arrangement.facets.grid
    near = np.array([points.near(p) for p in np.unique(triangles).tolist()]) * grid
    gaps = np.abs(near[:, None] - r.mesh.vertices[None]).max(axis=2)
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) <= r.moved + 1e-15
    assert r.moved <= 3**0.5 * 2.0**-53 * np.abs(r.mesh.vertices).max() * 2 and not len(r.self_collisions)
    assert r.mesh.solid and r.n_collapsed == r.n_thin == 0


def test_facets_name_what_touches():
    """At a position on the border the facets that are told touch, up to rounding."""
    A, B, R = cases()["horseshoes"]
    r = collide.configuration_obstacle(A, B, R)
    at = r.mesh.vertices[r.mesh.faces].mean(axis=1)
    for x, (f, g) in list(zip(at, r.facets))[:: max(len(at) // 20, 1)]:
        both = [collide.Mesh(M.vertices[M.faces[k]], [[0, 1, 2]]) for M, k in ((A, f), (B, g))]
        assert collide.distance(*both, I, pose_of(R, x)).distance <= 1e-12


def test_what_just_fits_and_what_fits_with_an_ulp():
    """A box as large as the hole of a ring touches all around: no position is free. An ulp smaller, a shaft is."""
    ring = cases()["a ring and a box"][0]
    tight = collide.configuration_obstacle(ring, collide.Box((1, 1, 0.5)))
    assert tight.mesh.report.euler == 2
    loose = collide.configuration_obstacle(ring, collide.Box((1 - 2.0**-40, 1, 0.5)))
    assert loose.mesh.report.euler == 2
    loose = collide.configuration_obstacle(ring, collide.Box((1 - 2.0**-40, 1 - 2.0**-40, 0.5)))
    assert loose.mesh.report.euler == 0
    assert np.abs(loose.mesh.vertices[:, 0]).min() == 2.0**-41


def test_shells_cavities_and_several_parts():
    """A box within a cavity is free there, and two parts far from one another give two solids."""
    hollow = collide.Mesh(*joined(box((0, 0, 0), (4, 4, 4)), turned_over(box((1, 1, 1), (3, 3, 3)))))
    r = collide.configuration_obstacle(hollow, collide.Box((1, 1, 1)))
    assert r.mesh.report.shells == 2 and r.mesh.report.volume == 5.0**3 - 1.0
    filled = collide.configuration_obstacle(hollow, collide.Box((2, 1, 1)))
    assert filled.mesh.report.shells == 1 and filled.mesh.report.volume == 6.0 * 5 * 5
    two = collide.Mesh(*joined(box(), box((9, 0, 0), (10, 1, 1))))
    r = collide.configuration_obstacle(two, collide.Box((1, 1, 1)))
    assert r.mesh.report.shells == 2 and r.mesh.report.volume == 27.0 + 8.0


def test_a_position_of_a_base():
    """The sign: the obstacle is where x puts the body's origin, and R turns the body, not the obstacle."""
    wall, base = collide.Box((1, 1, 1)), collide.ConvexHull(box((0, 0, 0), (2, 1, 1))[0])
    r = collide.configuration_obstacle(wall, base)
    assert r.mesh.vertices.min(axis=0).tolist() == [-2.5, -1.5, -1.5]
    assert r.mesh.vertices.max(axis=0).tolist() == [0.5, 0.5, 0.5]
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    r = collide.configuration_obstacle(wall, base, quarter)
    assert r.mesh.vertices.min(axis=0).tolist() == [-0.5, -2.5, -1.5]
    for x, meets in (((0.4, 0, 0), True), ((1.4, 0, 0), True), ((1.6, 0, 0), False)):
        assert collide.collide(wall, base, I, pose_of(quarter, x)) == bool(collide.contains(r.mesh, I, [x])[0]) == meets


def test_bad_input():
    b = collide.Box((1, 1, 1))
    with pytest.raises(InvalidArgument, match=r"R must be a \(3, 3\) rotation"):
        collide.configuration_obstacle(b, b, np.eye(4))
    with pytest.raises(InvalidPose):
        collide.configuration_obstacle(b, b, 2 * np.eye(3))
    with pytest.raises(UnsupportedQuery, match="tessellate"):
        collide.configuration_obstacle(b, collide.Sphere(1))
    crossed = collide.Mesh(*joined(box(), box((0, 0, 0), (2, 2, 2))))
    with pytest.raises(InvalidArgument, match=r"A has facets that cross; combine.*facets \d+, \d+"):
        collide.configuration_obstacle(crossed, b)
    in_an_edge = collide.boolean(b, b, I, collide.pose((1, 1, 0)), "union").mesh
    with pytest.raises(InvalidArgument, match="B has an edge with more than two facets"):
        collide.configuration_obstacle(b, in_an_edge)
    surface = collide.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InvalidArgument, match="A has no inside"):
        collide.configuration_obstacle(surface, b)
    with pytest.raises(UnsupportedQuery, match="more than memory=1,000"):
        collide.configuration_obstacle(b, b, memory=1000)
    with pytest.raises(UnsupportedQuery, match="time_limit"):
        collide.configuration_obstacle(b, b, time_limit=1e-9)


def test_faults_are_noticed(monkeypatch):
    """Reflex edges taken for convex ones, counts of vertices left at one, cells of number 0 left out."""

    def noticed(name) -> bool:
        try:
            return bool(judge_obstacle(*cases()[name], 200, 0, 1).wrong)
        except CollideError:
            return True

    def without_asking(*args, right=module.TranslatedSolids):
        solids = right(*args)
        solids.meet = lambda x: False
        return solids

    def convex_alone(points, faces, right=module.exact_surface):
        made = right(points, faces)
        return made._replace(bend=abs(made.bend))

    def of_edges_wrong(*args, right=convolution_module._crossings):
        return abs(right(*args))

    faults = [
        (module, "TranslatedSolids", without_asking, "a ring and a box larger than its hole"),
        (module, "exact_surface", convex_alone, "horseshoes"),
        (convolution_module, "_crossings", of_edges_wrong, "tetrahedra"),
    ]
    for owner, fault_name, fault, name in faults:
        with monkeypatch.context() as patch:
            patch.setattr(owner, fault_name, fault)
            assert noticed(name), fault_name
