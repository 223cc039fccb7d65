"""THE table: the method of every pair of shapes.

Lowering makes a `Kind` of a shape (`lowering/kind_of_shape.py`); `TABLE` holds a `Method` for every two kinds. Half of
the table is written, the other half is its mirror: the method is the same, A and B are exchanged. A method is carried
out by the file of its name; `dispatch_functions.py` names its function for each public question.

Kernels choose among the methods of two convex sets by numbers made from this table (`kernel_dispatch.py`); contacts,
casts and motions name what carries out their question for its methods, or for a group of them. No other code chooses a
method.

To add a kind or a method: CONTRIBUTING.md lists the files, "Adding things".
"""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum

import numpy as np

from collide.lowering.kinds import CURVED_KINDS, Kind


class Method(Enum):
    """How a pair is answered: (name of its file or files in this room, what happens there)."""

    SPHERES = "sphere_sphere", "closed form: the distance of two points"
    SPHERE_CAPSULE = "sphere_capsule", "closed form: the point of a segment nearest to a point"
    CAPSULES = "capsule_capsule", "closed form: the nearest points of two segments"
    PLANE = "halfspace_convex", "closed form: one support query against the plane"
    PLANES = "halfspace_halfspace", "two planes: they meet unless exactly opposite"
    CONVEX = (
        "convex_convex",
        "GJK, EPA where cores overlap; MPR first for small hulls, box_sphere for its booleans; last digits of gaps in "
        + "double-doubles (gap/refine_gap); exact integers where doubles leave a sign open (exact/exact_stage)",
    )
    FACETS = "facets/mesh_pairs", "two BVHs of facets traversed together, exact triangle tests"
    CURVED = "facets/mesh_curved", "facets against a polytope inside and one around, then facet by facet with GJK"
    HULL = "facets/mesh_pairs", "the hull of the mesh answers against the plane"
    PARTS = "composite/composite", "pairs of convex parts, culled by balls, combined to one row"
    MESH_PARTS = (
        "composite/composite_meshes",
        "pairs of parts of which some are meshes, culled by boxes, combined to one row",
    )
    REGION = (
        "region_pairs",
        "the region is closed by a box that changes nothing, then as the table says; touching by its planes",
    )
    FIELD = (
        "fields/field_pairs",
        "a walk down the tree over points or cells, single ones by the table; else those nearby as a union",
    )
    REGIONS = "region_pairs", "both without end: booleans by a program over all planes; boxes that grow until they tell"

    @property
    def file(self) -> str:
        return f"narrowphase/{self.value[0]}.py"

    @property
    def meaning(self) -> str:
        return self.value[1]


D, I, C = Method.SPHERES, Method.SPHERE_CAPSULE, Method.CAPSULES
H, P, G = Method.PLANE, Method.PLANES, Method.CONVEX
F, E, L = Method.FACETS, Method.CURVED, Method.HULL
U, M = Method.PARTS, Method.MESH_PARTS
R, S, W = Method.REGION, Method.REGIONS, Method.FIELD

#: Rows and columns in the order of `Kind`, its curved kinds taken together; what stands below the diagonal is mirrored.
#: The column "both" is of compounds with meshes among their parts, the last of an `HPolytope` kept as planes.
#: ROUNDED is an `HPolytope` whose corners are not doubles: to kernels it is points, to meshes it has no exact facets.
_UPPER_HALF = (
    # sphere capsule polytope rounded curved halfspace mesh compound both region field
    (D,      I,      G,       G,      G,     H,        F,   U,       M,   R,     W),  # sphere
    (        C,      G,       G,      G,     H,        F,   U,       M,   R,     W),  # capsule
    (                G,       G,      G,     H,        F,   U,       M,   R,     W),  # polytope
    (                         G,      G,     H,        E,   U,       M,   R,     W),  # rounded
    (                                 G,     H,        E,   U,       M,   R,     W),  # curved
    (                                        P,        L,   U,       M,   S,     W),  # half-space
    (                                                  F,   M,       M,   R,     W),  # mesh
    (                                                       U,       M,   R,     W),  # compound
    (                                                                M,   R,     W),  # both
    (                                                                     S,     R),  # region
    (                                                                            W,),  # field
)
_ORDER = list(dict.fromkeys("curved" if kind in CURVED_KINDS else kind for kind in Kind))
_LINES = [_ORDER.index("curved" if kind in CURVED_KINDS else kind) for kind in Kind]
#: TABLE[kind of A][kind of B].
TABLE: tuple[tuple[Method, ...], ...] = tuple(
    tuple(_UPPER_HALF[min(_LINES[a], _LINES[b])][abs(_LINES[a] - _LINES[b])] for b in Kind) for a in Kind
)
#: Methods of two convex sets, in the order of the numbers that kernels know them by; of unions, which are taken apart;
#: and of pairs with a mesh.
OF_SETS, OF_UNIONS, OF_FACETS = (D, I, C, H, P, G), (U, M), (F, E, L, M)

#: Questions that a method does not answer, and why, in the words of the error.
REFUSED: dict[tuple[Method, str], str] = {
    (Method.PLANES, "distance"): (
        "their overlap has no end, so no translation of finite length separates them; collide() still answers"
    ),
}
REFUSED[Method.REGIONS, "distance"] = REFUSED[Method.PLANES, "distance"]
# Of unions with half-spaces there may be a way out that is not found, or none, as out of a corridor too narrow.
REFUSED[Method.PARTS, "distance"] = REFUSED[Method.MESH_PARTS, "distance"] = (
    "no translation was found that clears all half-spaces and all other parts; collide(), contacts() and "
    "distance(signed=False) still answer, and distance() of the items one by one"
)


def method_of(kind_a: Kind, kind_b: Kind) -> Method:
    """The method for a pair of kinds, in either order."""
    return TABLE[kind_a][kind_b]


def cells_of(methods: Collection[Method]) -> np.ndarray:
    """[kind of A, kind of B] bool: whether the pair's method is one of these."""
    return np.array([[method in methods for method in row] for row in TABLE])
