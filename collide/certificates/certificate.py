"""Certificates: numbers proving a hit of two bodies, or a gap between them.

A certificate carries vertex ids and integers, no rounded number. Write D for the difference points a_i − b_j of its
vertex pairs, r_A and r_B for the radii swept over the bodies:

apart     v, the point of hull(D) nearest the origin (one to four pairs), is a separating axis:
          v·(a − b) > (r_A + r_B)|v| for all vertices a of A and b of B.
together  hull(D) (one to four pairs) comes within r_A + r_B of the origin. For a half-space and a body: a named
          vertex lies within the body's radius of the half-space, or inside.
plane     apart: three integers in place of vertex pairs, a normal n with n·(a − b) > 0 for all points a of A and b of
          B, radii and curved surfaces included (`point_and_plane.py`).
point     together: four integers (x, y, z, w), w > 0: both bodies hold the point (x, y, z)/w of the world [m].
inside    a single named vertex, −1 for the other body, lies in the other body, a solid mesh: the winding number
          of its facets around the vertex is positive.

Pairs of vertices, radii and half-spaces have "apart" and "together"; pairs with a cylinder, cone or ellipsoid, and two
half-spaces, have "plane" and "point". Unions of convex parts: together, a single certificate names the two meeting
parts; apart, every pair of parts has its own.

Pairs with a mesh, vertices and radii alone: together, a single certificate names two facets within r_A + r_B of each
other, with the named vertices as corners (a convex shape is taken whole, its facet is 0); apart, a single axis between
the hulls. All other pairs with a mesh go by items (`body_groups.py`), the facets and convex parts of a body, numbered
in the order of the parts: together, a "point" of two items, −1 − k standing for the inside of part k, a solid mesh;
apart, "plane" certificates between groups of items, numbered as nodes of a binary tree, which leave no pair of items
out, and no surface of a body in a solid of the other.

Fields (`field_proofs.py`) have items in the place of parts: a row of ``points`` of a cloud, the number of a cell of a
grid, a row of ``faces`` of a swept mesh, a facet on top of large terrain, for the prism between facet and bottom.
Vertices of an item are numbered in sorted order. together, or for a curved part a point, one item and one part meet;
inside, a vertex of a part lies in a swept solid, whose inside is the item after its triangles; apart, for every part of
the other body "plane" certificates with the item −1: every item lies beyond one of these planes, by more than both
radii. Fields beside meshes and fields go by items as meshes do, cells of a grid numbered in their order.

A region of half-spaces (`HPolytope` with ``bounded=False``) and points swept by a ball have a certificate of their own
(`region_proofs.py`), naming half-spaces.

Without a certificate are: regions beside other bodies; large terrain beside meshes and fields; results with an open
sign.

Vertex ids are rows of `PackedConvex.points`: the points of a `ConvexHull` as handed in, the corners of a `Box` by sign
(−−−, −−+, …), the ends of a `Capsule`, the rounded ``vertices`` of an `HPolytope`; of a `Mesh` rows of its
``vertices``.
"""

from __future__ import annotations

from operator import index
from typing import Any, NamedTuple

from collide.errors import CollideError, brief

APART, TOGETHER, INSIDE, PLANE, POINT = "apart", "together", "inside", "plane", "point"
#: Stands for a body that names no vertex: a half-space, or the solid that holds the other body's vertex.
NO_VERTEX = -1

#: Bits of a number at most: what the algebra of two curved sets needs is far less.
_MAX_BITS = 1 << 17

#: (vertex of A, vertex of B).
VertexPair = tuple[int, int]


class Certificate(NamedTuple):
    """Proof of a boolean about two parts or facets, as plain data: it survives pickle and JSON.

    Parameters
    ----------
    kind : "apart", "together", "plane", "point" or "inside".
    part_a, part_b : numbers of the parts of A and of B, of facets, items or groups where a body is a mesh or a union
        with meshes; 0 for convex bodies.
    pairs : ((vertex of A, vertex of B), …), at most four; −1 where a body names no vertex. Of a plane ((x, y, z),), of
        a point ((x, y, z, w),).
    """

    kind: str
    part_a: int
    part_b: int
    pairs: tuple[Any, ...]


class CertificateRefused(CollideError):
    """A certificate does not prove what the result claims; the message says where it fails."""


def read_certificates(values) -> list[Certificate]:
    """Certificates of Python integers from what may come from a file. Raises CertificateRefused for another form."""
    try:
        return [Certificate(_name(kind), _whole(i), _whole(j), _read_rows(kind, rows)) for kind, i, j, rows in values]
    except (TypeError, ValueError):
        raise CertificateRefused(
            "a certificate is rows of (kind, part, part, pairs of vertex numbers), all numbers whole, got "
            f"{brief(values)}"
        ) from None


def _read_rows(kind: str, rows) -> tuple[Any, ...]:
    if kind == PLANE:
        ((x, y, z),) = rows
        return ((_whole(x), _whole(y), _whole(z)),)
    if kind == POINT:
        ((x, y, z, w),) = rows
        return ((_whole(x), _whole(y), _whole(z), _whole(w)),)
    return tuple((_whole(p), _whole(q)) for p, q in rows)


def _name(kind) -> str:
    if not isinstance(kind, str):
        raise TypeError
    return kind


def _whole(value) -> int:
    number = index(value)
    if number.bit_length() > _MAX_BITS:
        raise ValueError
    return number
