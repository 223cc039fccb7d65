"""Booleans and volumes of overlaps, judged by the solids' own winding numbers and by volumes in fractions."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive_triangles import cross, inner, minus, world_points
from solid_families import SOLIDS, joined, turned_over
from solid_judge import judge, snippet, solids_of

import collide
from collide.errors import CollideError, InvalidArgument, InvalidPose, UnsupportedQuery
from collide.solids import around_edges, facet_cuts, rays, split_facets

I = np.eye(4)
OPERATIONS = ("union", "intersection", "difference", "symmetric_difference")


@pytest.mark.many(2)
@pytest.mark.parametrize("family", SOLIDS)
def test_points_are_where_the_solids_hold_them(family):
    """Half the points within 1e-9 of a surface; volumes add up in fractions."""
    for seed in (1,):
        verdict = judge(*solids_of(family, seed), 40, seed)
        assert not verdict.wrong, f"{verdict.wrong[:3]}\n{snippet(family, seed)}"
        assert verdict.adds_up, snippet(family, seed)
        assert verdict.n_points >= 100 and verdict.n_near == 20


def test_the_families_overlap():
    """Points in both bodies are judged, and many of them: otherwise little is tested."""
    both = Counter()
    for family in ("boxes", "cavities", "smooth", "random shells", "turned grid shells"):
        for seed in range(3, 5):
            both[family] += judge(*solids_of(family, seed), 24, seed).n_both
    assert sum(both.values()) >= 60 and sum(count > 0 for count in both.values()) >= 4, both


def edges_balance(mesh) -> bool:
    """Whether every edge is run along as often one way as the other."""
    runs = Counter()
    for a, b, c in mesh.faces.tolist():
        for p, q in ((a, b), (b, c), (c, a)):
            runs[min(p, q), max(p, q)] += 1 if p < q else -1
    return not any(runs.values())


@pytest.mark.many(2)
@pytest.mark.parametrize("family", ["smooth", "boxes", "rings", "turned grid shells", "identical shells"])
def test_results_are_closed_and_say_whose_facets_they_are_of(family):
    for seed in range(2):
        A, B, X, Y = solids_of(family, seed)
        for op in OPERATIONS:
            r = collide.boolean(A, B, X, Y, op)
            if r.empty:
                assert len(r.body) == len(r.facet) == 0
                continue
            assert r.mesh.solid and edges_balance(r.mesh), (family, seed, op)
            size = np.abs(r.mesh.vertices).max()
            assert r.moved <= 2.0**-52 * size * 3**0.5
            for body, (mesh, pose) in enumerate(((A, X), (B, Y))):
                rows = np.flatnonzero(r.body == body)
                corners = mesh.vertices[mesh.faces[r.facet[rows]]] @ pose[:3, :3].T + pose[:3, 3]
                n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                n /= np.sqrt((n * n).sum(axis=1))[:, None]
                new = r.mesh.vertices[r.mesh.faces[rows]] - corners[:, :1]
                assert np.abs((new * n[:, None]).sum(axis=2)).max(initial=0.0) <= 1e-12 * size


def test_a_body_with_itself():
    A = collide.Mesh(*bumpy_sphere(60))
    X = collide.pose((0.3, -1, 2), rpy=(0.1, 0.2, 0.3))
    for op in ("union", "intersection"):
        r = collide.boolean(A, A, X, X, op)
        corners = {tuple(sorted(map(tuple, t))) for t in r.mesh.vertices[r.mesh.faces].tolist()}
        placed = [[tuple(map(float, p)) for p in world_points(A.vertices[f], X)] for f in A.faces]
        assert corners == {tuple(sorted(t)) for t in placed}
    for op in ("difference", "symmetric_difference"):
        assert collide.boolean(A, A, X, X, op).empty
    r = collide.overlap_volume(A, A, X, X)
    assert r.lower <= A.report.volume * (1 + 1e-12) and r.upper >= A.report.volume * (1 - 1e-12)
    assert r.area_a == r.area_b == r.patch_area == 0.0 and r.flush_area > 0.0


def test_boxes_on_one_another():
    """No volume, and a patch; the union has no wall between."""
    low, high = collide.Box((2, 2, 1)), collide.Box((1, 1, 1))
    X = collide.pose((0, 0, 1))
    r = collide.overlap_volume(low, high, I, X)
    assert (r.volume, r.lower, r.upper) == (0.0, 0.0, 0.0)
    assert r.patch_area == 1.0 and r.flush_area == 0.0 and r.centroid.tolist() == [0, 0, 0.5]
    union = collide.boolean(low, high, I, X, "union").mesh
    assert union.report.volume == 5.0 and union.report.shells == 1 and not len(collide.self_collisions(union).pairs)
    assert collide.boolean(low, high, I, X, "intersection").empty
    assert collide.boolean(low, high, I, X, "difference").mesh.report.volume == 4.0


@pytest.mark.parametrize("shift", [*permutations((1.0, 0.0, 1.0), 3), (1.0, 1.0, 1.0), (-1.0, -1.0, 1.0)])
def test_boxes_that_touch_in_an_edge_or_a_corner(shift):
    b = collide.Box((1, 1, 1))
    r = collide.overlap_volume(b, b, I, collide.pose(shift))
    assert r.volume == r.upper == r.patch_area == 0.0
    union = collide.boolean(b, b, I, collide.pose(shift), "union").mesh
    assert union.solid and union.report.volume == 2.0 and union.report.shells == 2


def test_cavities_and_nested_bodies():
    outer, inner_box = collide.Box((4, 4, 4)), collide.Box((2, 2, 2))
    hollow = collide.boolean(outer, inner_box, I, I, "difference").mesh
    assert hollow.report.volume == 56.0 and hollow.report.shells == 2
    assert collide.boolean(hollow, inner_box, I, I, "intersection").empty
    assert collide.boolean(hollow, inner_box, I, I, "union").mesh.report.volume == 64.0
    assert collide.overlap_volume(hollow, inner_box, I, I).patch_area == pytest.approx(24.0, abs=1e-12)
    assert collide.boolean(outer, inner_box, I, I, "union").mesh.report.shells == 1
    assert collide.boolean(inner_box, outer, I, I, "difference").empty


def test_shells_that_overlap_count_as_their_union():
    """A body of two boxes that cross, turned over inside a third: windings of 2 and of −1 + 1."""
    crossed = collide.Mesh(*joined(box(), box((0, 0, 0), (2, 2, 2))))
    far = collide.Box((1, 1, 1))
    r = collide.boolean(crossed, far, I, collide.pose((9, 0, 0)), "union")
    assert r.mesh.report.volume == 15.0 + 1.0 and not len(r.self_collisions)
    hollow = collide.Mesh(*joined(box((0, 0, 0), (4, 4, 4)), turned_over(box((1, 1, 1), (3, 3, 3)))))
    assert collide.overlap_volume(hollow, crossed, I, I).volume == pytest.approx(8.0 - 1.0, abs=1e-12)


def test_thin_and_tiny():
    """Overlaps of 1e-12 m; facets of 1e-12 m beside those of 1 km; turned, so that nothing is a double."""
    b = collide.Box((1, 1, 1))
    for depth in (1e-3, 1e-9, 1e-12, 2.0**-52):
        X = collide.pose((0, 0, 1 - depth), rpy=(0, 0, 0.3))
        r = collide.overlap_volume(b, b, I, X)
        assert 0 < r.lower <= r.volume <= r.upper <= r.lower * (1 + 1e-9)
        assert r.volume == pytest.approx(0.8885505699885345 * (1 - (1 - depth)), rel=1e-9)
    X = collide.pose((500.0, 3.0, -2.0), rpy=(0.2, 0.1, 0.7))
    r = collide.overlap_volume(collide.Box((1000, 1000, 1000)), collide.Box((1e-12,) * 3), I, X)
    assert 0 < r.lower <= r.upper < 1e-36 and r.upper <= r.lower * (1 + 1e-9)


def test_volume_brackets_hold():
    for seed in range(3):
        A, B, X, Y = solids_of("smooth", seed)
        r = collide.overlap_volume(A, B, X, Y)
        exact = sum(
            inner(a, cross(b, c))
            for a, b, c in _rounded_corners(collide.boolean(A, B, X, Y, "intersection").mesh)
        ) / 6
        assert abs(float(exact) - r.volume) <= 1e-12 * r.volume
        assert 0 < r.lower <= r.volume <= r.upper <= r.lower * (1 + 1e-10)


def _rounded_corners(mesh):
    corners = [[Fraction(x) for x in p] for p in mesh.vertices.tolist()]
    return [[minus(corners[v], corners[0]) for v in face] for face in mesh.faces.tolist()]


def test_hulls_and_polytopes():
    hull = collide.ConvexHull(np.random.default_rng(2).normal(size=(30, 3)))
    cube = collide.HPolytope(np.vstack([np.eye(3), -np.eye(3)]), np.ones(6))
    r = collide.boolean(hull, cube, I, collide.pose((0.5, 0, 0)), "intersection")
    assert r.mesh.solid and set(r.body.tolist()) == {0, 1}
    v = collide.overlap_volume(hull, cube, I, collide.pose((0.5, 0, 0)))
    assert v.volume == pytest.approx(r.mesh.report.volume, rel=1e-12)


def test_facets_without_area_do_no_harm():
    """An edge of a box is cut at a corner of a facet without area on one side only."""
    vertices, faces = box()
    middle = (vertices[0] + vertices[1]) / 2
    vertices = np.vstack([vertices, middle])
    rows = [k for k, f in enumerate(faces.tolist()) if {0, 1} <= set(f)]
    a, b, c = faces[rows[0]]
    while {a, b} != {0, 1}:
        a, b, c = b, c, a
    faces = np.vstack([np.delete(faces, rows[0], axis=0), [[a, 8, c], [8, b, c], [a, b, 8]]])
    A, B = collide.Mesh(vertices, faces, solid=True), collide.Box((1, 1, 1))
    for pose in (collide.pose((9, 0, 0)), collide.pose((-1.5, -1.5, -1)), collide.pose((0, 0, 0.5), rpy=(0, 0, 0.5))):
        r = collide.boolean(A, B, I, pose, "difference")
        assert r.mesh.solid
        assert r.mesh.report.volume == pytest.approx(8 - collide.overlap_volume(A, B, I, pose).volume)


def test_rings():
    ring = collide.Mesh(*block_ring())
    r = collide.boolean(ring, collide.Box((1, 1, 1)), I, I, "union")
    assert r.mesh.report.volume == 9.0 and r.mesh.report.euler == 2
    assert collide.boolean(ring, collide.Box((0.5, 0.5, 3)), I, I, "intersection").empty


def test_bad_input():
    b = collide.Box((1, 1, 1))
    surface = collide.Mesh(b_vertices := [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InvalidArgument, match=r"B has no inside: open edges .*facet 0"):
        collide.boolean(b, surface, I, I, "union")
    with pytest.raises(InvalidArgument, match="solid=False"):
        collide.overlap_volume(collide.Mesh(*box(), solid=False), b, I, I)
    with pytest.raises(InvalidArgument, match="one plane"):
        collide.boolean(collide.ConvexHull(b_vertices), b, I, I, "union")
    with pytest.raises(InvalidArgument, match="'union', 'intersection'"):
        collide.boolean(b, b, I, I, "xor")
    with pytest.raises(InvalidPose, match="one \\(4, 4\\) pose, got \\(2, 4, 4\\)"):
        collide.boolean(b, b, np.stack([I, I]), I, "union")
    with pytest.raises(InvalidPose):
        collide.overlap_volume(b, b, 2 * I, I)
    compound, halfspace = collide.Compound([(b, I)]), collide.Halfspace((0, 0, 1), 0)
    for shape in (collide.Sphere(1), collide.Cylinder(1, 1), compound, halfspace):
        with pytest.raises(UnsupportedQuery, match=f"{type(shape).__name__}.*tessellate"):
            collide.boolean(shape, b, I, I, "union")


def one_sided():
    """A Möbius band of three tetrahedra's width: every edge but its border's has two facets."""
    angle = np.arange(6) * np.pi / 3
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6)])
    tilt = np.cos(angle / 2)[:, None] * outward + np.column_stack([np.zeros((6, 2)), np.sin(angle / 2)])
    vertices = np.concatenate([3 * outward - tilt, 3 * outward + tilt])
    faces = []
    for k in range(6):
        a, b, c, d = k, 6 + k, (k + 1) % 6, 6 + (k + 1) % 6
        if k == 5:
            c, d = d, c
        faces += [[a, b, c], [c, b, d]]
    return vertices, np.array(faces)


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        ((box()[0], box()[1][:-1]), r"A has no inside: .*open edges.*facet"),
        (one_sided(), r"A has no inside: .*one.sided.*facet"),
        (turned_over(box()), r"A has no inside: .*inside.out.*facet"),
        ((box()[0], np.vstack([box()[1][:1, ::-1], box()[1][1:]])), r"A has no inside: .*turned over.*facet 0"),
    ],
)
def test_meshes_without_an_inside_are_refused_with_their_facets(mesh, words):
    for ask in (collide.overlap_volume, lambda *pair: collide.boolean(*pair, "union")):
        with pytest.raises(InvalidArgument, match=words):
            ask(collide.Mesh(*mesh), collide.Box((1, 1, 1)), I, I)


def test_meshes_that_cross_themselves_follow_their_winding():
    """Two boxes that cross count as one, whatever is asked; a box inside-out in part is a cavity there."""
    crossed = collide.Mesh(*joined(box((0, 0, 0), (2, 2, 2)), box((1, 1, 1), (3, 3, 3))))
    slab = collide.Box((10, 10, 2))
    common = collide.boolean(crossed, slab, I, collide.pose((0, 0, 2)), "intersection").mesh  # 1 ≤ z ≤ 3
    assert common.report.volume == pytest.approx(4 + 8 - 1, abs=1e-12) and edges_balance(common)
    assert collide.overlap_volume(crossed, slab, I, collide.pose((0, 0, 2))).volume == pytest.approx(11.0, abs=1e-12)


def test_a_picometre_beside_a_kilometre():
    """Facets of 1e-12 m on one of 1 km, added to it and taken off; shells of which rounding leaves nothing are told."""
    big, speck = collide.Box((1000, 1000, 1000)), collide.Box((1e-12,) * 3)
    at_corner = collide.pose((0, 0, 0))
    corner_box = collide.Mesh(*box((0, 0, 0), (1000, 1000, 1000)))
    union = collide.boolean(corner_box, speck, I, at_corner, "union")
    left = collide.boolean(corner_box, speck, I, at_corner, "difference")
    for r, n_min in ((union, 20), (left, 20)):
        assert r.mesh.solid and edges_balance(r.mesh) and len(r.mesh.faces) >= n_min and r.moved < 1e-27
        assert r.mesh.vertices.max() == 1000.0 and 0 < np.abs(r.mesh.vertices)[r.mesh.vertices != 0].min() <= 1e-12
    dust = collide.Box((1e-15,) * 3)
    far = collide.boolean(big, dust, I, collide.pose((500.0, 300.0, -200.0), rpy=(0.2, 0.1, 0.7)), "union")
    assert far.mesh.solid and edges_balance(far.mesh) and far.n_collapsed + far.n_thin > 0
    assert far.mesh.report.volume == pytest.approx(1e9, rel=1e-12)


def test_faults_are_noticed(monkeypatch):
    """Wrong orders around edges, crossings left out, steps of one body dropped: refused, or judged wrong."""

    def around_backwards(sheets, points, low, high, sheet, upward, right=around_edges.around_edge):
        return right(sheets, points, low, high, sheet, upward)[::-1]

    def without_an_ear(*arguments, right=split_facets.clip_parts):
        return max(right(*arguments) - 1, 0)

    def noticed(family, seed) -> bool:
        try:
            verdict = judge(*solids_of(family, seed), 40, seed)
        except CollideError:
            return True
        return bool(verdict.wrong) or not verdict.adds_up

    faults = [
        (around_edges, "around_edge", around_backwards),
        (facet_cuts.FacetCuts, "_cross_segments", lambda self, f: None),
        (facet_cuts.FacetCuts, "_lies_within", lambda self, p, s, u, v: False),
        (rays, "count_passages", lambda tree, X, points, axes, skipped, slack: (0, np.zeros((0, 2), dtype=np.int64))),
        (split_facets, "clip_parts", without_an_ear),
    ]
    for owner, name, fault in faults:
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, fault)
            families = ("random shells", "boxes", "turned grid shells", "smooth")
            assert any(noticed(family, 1) for family in families), name
