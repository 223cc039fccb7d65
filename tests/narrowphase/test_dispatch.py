"""The table of pairs: complete, symmetric, true to its files, and the same that kernels and queries go by."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from naive import one_of_each, rng_of

import collide
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import WITH_FACETS, Kind
from collide.lowering.packed_convex import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.narrowphase import kernel_dispatch
from collide.narrowphase.dispatch import OF_FACETS, OF_SETS, OF_UNIONS, TABLE, Method, cells_of, method_of
from collide.narrowphase.dispatch_functions import ANSWERS, OF_ONE_PAIR, answer_of

PACKED = {
    Kind.SPHERE: (POINTS, 1), Kind.CAPSULE: (POINTS, 2), Kind.POLYTOPE: (POINTS, 8), Kind.CYLINDER: (CYLINDER, 0),
    Kind.CONE: (CONE, 0), Kind.ELLIPSOID: (ELLIPSOID, 0), Kind.HALFSPACE: (HALFSPACE, 0),
}
OF_KERNELS = {
    Method.SPHERES: kernel_dispatch.SPHERES, Method.SPHERE_CAPSULE: kernel_dispatch.SPHERE_CAPSULE,
    Method.CAPSULES: kernel_dispatch.CAPSULES, Method.PLANE: kernel_dispatch.HALFSPACE_CONVEX,
    Method.PLANES: kernel_dispatch.HALFSPACES, Method.CONVEX: kernel_dispatch.CONVEX,
}


def test_the_table_is_complete_and_its_own_mirror():
    assert len(TABLE) == len(Kind) and all(len(row) == len(Kind) for row in TABLE)
    for a, b in product(Kind, Kind):
        assert TABLE[a][b] is TABLE[b][a] is method_of(a, b)
    assert {method for row in TABLE for method in row} == set(Method), "a method that no pair has"


def test_every_method_is_carried_out_by_the_file_it_names():
    package = Path(collide.__file__).parent
    assert set(ANSWERS) == set(Method)
    for method in Method:
        assert (package / method.file).is_file(), method
        assert method.meaning


@pytest.mark.plain_kernels
def test_kernels_go_by_the_same_table():
    for a, b in product(PACKED, PACKED):
        assert kernel_dispatch.method(*PACKED[a], *PACKED[b]) == OF_KERNELS[method_of(a, b)], (a, b)


def test_groups_of_methods_are_the_kinds_they_are_named_for():
    """Judged by kinds, cell by cell."""
    meshes, unions = {Kind.MESH, Kind.MESH_COMPOUND}, {Kind.COMPOUND, Kind.MESH_COMPOUND}
    of_facets, of_unions, of_sets = map(cells_of, (OF_FACETS, OF_UNIONS, OF_SETS))
    for a, b in product(Kind, Kind):
        if not {a, b} & {Kind.REGION, Kind.FIELD}:
            assert of_facets[a, b] == bool({a, b} & meshes), (a, b)
            assert of_unions[a, b] == bool({a, b} & unions), (a, b)
            assert of_sets[a, b] == (max(a, b) < Kind.MESH), (a, b)
    assert not (of_facets | of_unions | of_sets)[[Kind.REGION, Kind.FIELD]].any()


def test_each_shape_has_the_kind_of_its_points():
    shapes = one_of_each(rng_of("kinds"))
    expected = {
        "Sphere": Kind.SPHERE,
        "Box": Kind.POLYTOPE,
        "Capsule": Kind.CAPSULE,
        "Halfspace": Kind.HALFSPACE,
        "Cone": Kind.CONE,
    }
    for name, kind in expected.items():
        assert kind_of(shapes[name]) is kind
    point = collide.ConvexHull([(1.0, 2.0, 3.0)], radius=0.5)
    tetrahedron = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    mesh = collide.Mesh(tetrahedron, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    thirds = collide.HPolytope([(3, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], [1.0] * 6)
    assert kind_of(point) is Kind.SPHERE and kind_of(mesh) is Kind.MESH and kind_of(thirds) is Kind.ROUNDED
    assert kind_of(collide.Compound([(point, np.eye(4))])) is Kind.COMPOUND
    assert kind_of(collide.Compound([(mesh, np.eye(4)), (point, np.eye(4))])) is Kind.MESH_COMPOUND
    assert Kind.ROUNDED not in WITH_FACETS and Kind.MESH in WITH_FACETS
    assert answer_of(mesh, point) is ANSWERS[Method.FACETS] and answer_of(point, mesh) is ANSWERS[Method.FACETS]
    assert OF_ONE_PAIR[Kind.MESH, Kind.POLYTOPE] and not OF_ONE_PAIR[Kind.COMPOUND, Kind.POLYTOPE]


@pytest.mark.parametrize("question", ["distance"])
def test_a_refusal_says_why(question):
    plane = collide.Halfspace((0, 0, 1), 0.0)
    with pytest.raises(collide.errors.UnsupportedQuery, match="no end"):
        getattr(collide, question)(plane, plane, np.eye(4), np.eye(4))
