"""Certificates of pairs with a mesh: they prove what `distance` says, and what is tampered with is refused."""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
import pytest
from mesh_families import grid_case, random_case, random_pose, right_angle_pose
from mesh_shapes import block_ring, box, bumpy_sphere

import collide
from collide.certificates.certificate import Certificate, CertificateRefused

EYE = np.eye(4)


def shapes(rng):
    unused = np.concatenate([box()[0], [[50.0, 50, 50]]]), box()[1]
    pool = [
        collide.Mesh(*box()), collide.Mesh(*block_ring()), collide.Mesh(*unused), collide.Mesh(*bumpy_sphere(60)),
        collide.Mesh(box()[0], box()[1][2:]), collide.Box((0.5, 0.25, 0.5)),
        collide.ConvexHull(rng.normal(size=(9, 3)) * 0.3),
        collide.Sphere(0.25), collide.Capsule(0.125, 0.5), collide.Halfspace((0, 0, 1), -0.5),
    ]
    return pool[rng.integers(5)], pool[rng.integers(len(pool))]


def test_certificates_prove_what_is_said():
    seen: Counter = Counter()
    for seed in range(120):
        rng = np.random.default_rng(seed)
        A, B = shapes(rng)
        pose = random_pose if seed % 2 else right_angle_pose
        X_WA, X_WB = pose(rng), pose(rng)
        if seed % 3 == 0:
            X_WB[:3, 3] *= 2.5
        if seed % 4 == 0:
            A, B, X_WA, X_WB = B, A, X_WB, X_WA
        r = collide.distance(A, B, X_WA, X_WB, signed=bool(seed % 5))
        given = r.certificate
        where = f"seed {seed}: {A}, {B}"
        seen[given[0].kind] += 1
        collide.verify(A, B, X_WA, X_WB, r)
        assert json.loads(json.dumps(given)) == [
            [c.kind, c.part_a, c.part_b, [list(p) for p in c.pairs]] for c in given
        ], where
        away = X_WB.copy()
        away[:3, 3] += 40.0 if r.hit else 0.0
        if r.hit and not any(isinstance(S, collide.Halfspace) for S in (A, B)):
            with pytest.raises(CertificateRefused):
                collide.verify(A, B, X_WA, away, r, certificate=given)
        flipped = [given[0]._replace(kind="together" if given[0].kind == "apart" else "apart")]
        with pytest.raises(CertificateRefused):
            collide.verify(A, B, X_WA, X_WB, r, certificate=flipped)
    assert seen["together"] > 25 and seen["apart"] > 20 and seen["plane"] > 0, seen


def test_soups():
    """Surfaces of loose and of flat facets: what meets is proven by two facets."""
    seen: Counter = Counter()
    for seed in range(20):
        rng = np.random.default_rng(seed)
        a, b, X_WA, X_WB = (grid_case if seed % 2 else random_case)(rng)
        A, B = collide.Mesh(*a, solid=False), collide.Mesh(*b, solid=False)
        r = collide.distance(A, B, X_WA, X_WB, signed=False)
        if r.hit:
            (c,) = r.certificate
            assert (c.kind, c.part_a, c.part_b) == ("together", r.part_a, r.part_b)
            assert all(i in a[1][c.part_a] and j in b[1][c.part_b] for i, j in c.pairs), seed
            collide.verify(A, B, X_WA, X_WB, r)
        seen["hit" if r.hit else "apart"] += 1
    assert seen["hit"] > 8


def test_one_inside_the_other():
    outer, inner = collide.Mesh(*bumpy_sphere(200)), collide.Mesh(*box((-0.1,) * 3, (0.1,) * 3))
    for small in (inner, collide.Box((0.2, 0.2, 0.2)), collide.Sphere(0.1)):
        X_WB = collide.pose((0.1, 0.2, 0.3), rpy=(0.3, 0.2, 0.1))
        for A, B, X, Y in ((outer, small, EYE, X_WB), (small, outer, X_WB, EYE)):
            r = collide.distance(A, B, X, Y)
            (c,) = r.certificate
            assert c.kind == "inside" and -1 in c.pairs[0]
            collide.verify(A, B, X, Y, r)
            out = collide.pose((2.0, 0, 0)) @ X_WB
            with pytest.raises(CertificateRefused, match="does not lie"):
                collide.verify(A, B, *((EYE, out) if A is outer else (out, EYE)), r, certificate=[c])
    surface = collide.Mesh(outer.vertices, outer.faces[1:])
    r = collide.distance(surface, inner, EYE, EYE)
    assert not r.hit and len(r.certificate) > 6 and {c.kind for c in r.certificate} == {"plane"}
    collide.verify(surface, inner, EYE, EYE, r)
    with pytest.raises(CertificateRefused, match="outside of the solid"):
        collide.verify(outer, inner, EYE, EYE, r, certificate=_planes_between(outer, inner))


def _planes_between(outer, inner) -> list[Certificate]:
    """Of a solid and a body inside of it: planes that part all facets, as of the solid's facets as a surface."""
    facets = collide.Mesh(outer.vertices, outer.faces, solid=False)
    return list(collide.distance(facets, inner, EYE, EYE).certificate)


@pytest.mark.parametrize(
    "tampered",
    [
        Certificate("together", 99, 0, ((0, 0),)), Certificate("together", 0, -1, ((0, 0),)),
        Certificate("together", 0, 0, ((7, 0),)),
        Certificate("together", 0, 0, ()), Certificate("inside", 0, 0, ((-1, -1),)),
        Certificate("inside", 0, 0, ((-1, 99),)),
        Certificate("inside", 0, 0, ((0, 1),)), Certificate("beside", 0, 0, ((0, 0),)),
        Certificate("together", 0, 0, ((0, 0),) * 5),
    ],
)
def test_tampered(tampered):
    mesh = collide.Mesh(*box())
    X_WB = collide.pose((1.5, 0.25, 0.125))
    r = collide.distance(mesh, mesh, EYE, X_WB)
    assert r.hit
    for given in ([tampered], [], [r.certificate[0], tampered]):
        with pytest.raises(CertificateRefused):
            collide.verify(mesh, mesh, EYE, X_WB, r, certificate=given)
    apart = collide.distance(mesh, mesh, EYE, collide.pose((3.0, 0, 0)))
    (c,) = apart.certificate
    for pairs in (((8, 0),), ((0, -1),), (), (*c.pairs, (0, 0), (1, 1), (2, 2), (3, 3))):
        with pytest.raises(CertificateRefused):
            collide.verify(mesh, mesh, EYE, collide.pose((3.0, 0, 0)), apart, certificate=[c._replace(pairs=pairs)])


def test_world_rows_have_them():
    world = collide.World()
    world.add(collide.Mesh(*box()), name="a")
    world.add(collide.Mesh(*box()), collide.pose((1.9, 0, 0)), name="b")
    world.add(collide.Sphere(0.5), collide.pose((0, 0, 3)), name="c")
    rows = world.distances()
    for k in range(len(rows)):
        pair = rows.pair(k)
        collide.verify(*pair.question, pair)
    assert len(rows) == 3


@pytest.mark.parametrize(
    "given",
    [
        5, "x", [5], [None], ["together"], [("together", 0, 0)], [("together", 0, 0, 5)], [("together", 0, 0, [(0,)])],
        [("together", 0, 0, [(0, 1, 2)])], [("together", 0.5, 0, [(0, 0)])], [("together", None, "a", [(0, 0)])],
        [("together", 0, 0, [(0.5, 0)])], [("inside", 0, 0, [(-1, "a")])], [("inside", 0, 0, [(-1, None)])],
        [("apart", 0, 0, None)],
        {"kind": "together"},
    ],
)
def test_what_has_not_the_form_is_refused(given):
    mesh, X_WB = collide.Mesh(*box()), collide.pose((1.5, 0.25, 0.125))
    for B in (mesh, collide.Box((2, 2, 2)), collide.Halfspace((0, 0, 1), 0.0)):
        for A in (mesh, collide.Box((2, 2, 2))):
            r = collide.distance(A, B, EYE, X_WB)
            with pytest.raises(CertificateRefused):
                collide.verify(A, B, EYE, X_WB, r, certificate=given)


def test_half_spaces_have_one_part():
    mesh, plane = collide.Mesh(*box()), collide.Halfspace((0, 0, 1), 0.0)
    r = collide.distance(mesh, plane, EYE, EYE)
    (c,) = r.certificate
    for wrong in (c._replace(part_a=99), c._replace(part_b=1), c._replace(part_b=-1)):
        with pytest.raises(CertificateRefused, match="no facet"):
            collide.verify(mesh, plane, EYE, EYE, r, certificate=[wrong])


def test_verify_names_what_is_no_shape_and_no_result():
    mesh = collide.Mesh(*box())
    r = collide.distance(mesh, mesh, EYE, EYE)
    for arguments in (
        (None, mesh, EYE, EYE, r),
        ([mesh], mesh, EYE, EYE, r),
        (mesh, mesh, EYE, EYE, None),
        (mesh, mesh, EYE, EYE, True),
    ):
        with pytest.raises(collide.InvalidArgument, match="must be a"):
            collide.verify(*arguments)
