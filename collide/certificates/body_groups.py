"""Bodies as items, and groups of items as a binary tree, for proofs that part one group from another by a plane.

The items of a body are the facets of its meshes, the items of a field (balls, cells, swept triangles) and its convex
parts, numbered in the order of the parts. Group 0 is the whole body; group k is cut into the groups 2k + 1 and 2k + 2:
of several parts the first half and the rest; of the facets of a mesh the half with the lesser sums of corners along the
longest extent of these sums, in the mesh's frame, and the rest. Sums of two doubles are the same on every machine, and
so are the groups. A group is swept by the largest of its radii.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np

from collide.certificates.certificate import APART, PLANE, POINT, TOGETHER, Certificate
from collide.certificates.exact_parts import ExactPart, exact_part, leaves_of
from collide.certificates.point_and_plane import WeightedPoint, flaw_of_normals, holds, in_lowest_terms, seen_from
from collide.certificates.swept_hulls import hulls_of
from collide.certificates.winding_number import winding_number
from collide.lowering.convex_sets import HALFSPACE, POINTS, convex_set
from collide.numerics.exact_points import PlacedPoints, Point
from collide.shapes.height_field import HeightField
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape
from collide.shapes.swept_mesh import SweptMesh

#: Pairs of groups looked at, at most.
MAX_PAIRS = 50_000
#: (group of A, group of B) and the normal of the plane between them.
Planes = dict[tuple[int, int], Point]


class Leaf(NamedTuple):
    """A part of a body: a convex set, or items of a mesh or a field.

    poses : (4, 4), the outermost first.   first : the number of its first item.
    vertices, corners, radii : (n, 3), (m, k) vertices of items, (m,) of the balls swept over them; ``None`` of a convex
    set.   solid : whether the items are triangles around an inside.
    """

    shape: Shape
    poses: tuple[np.ndarray, ...]
    first: int
    vertices: np.ndarray | None = None
    corners: np.ndarray | None = None
    radii: np.ndarray | None = None
    solid: bool = False

    @property
    def n_items(self) -> int:
        return 1 if self.corners is None else len(self.corners)

    def part(self, items: np.ndarray | None = None) -> ExactPart:
        """The hull of items given by number, all where ``None``; the convex set."""
        if self.vertices is None or self.corners is None or self.radii is None:
            return exact_part(convex_set(self.shape), *self.poses)
        items = np.arange(self.n_items) if items is None else items
        vertices = self.vertices[np.unique(self.corners[items])]
        return ExactPart(POINTS, vertices, float(self.radii[items].max()), None, *self.poses)

    def holds(self, point: WeightedPoint) -> bool | None:
        """Whether facets of a solid wind around a point; ``None`` where no ray tells."""
        vertices = seen_from(PlacedPoints(self.vertices, self.poses[::-1]), point)  # type: ignore[arg-type]
        number = winding_number(vertices, self.corners)  # type: ignore[arg-type]
        return None if number is None else number > 0


def _leaf(shape: Shape, poses: tuple[np.ndarray, ...], first: int) -> Leaf:
    mesh, radius = (shape.mesh, shape.radius) if isinstance(shape, SweptMesh) else (shape, 0.0)
    if isinstance(mesh, Mesh):
        radii = np.full(len(mesh.faces), radius)
        return Leaf(shape, poses, first, mesh.vertices, mesh.faces, radii, bool(mesh.solid))
    if not shape.is_field:
        return Leaf(shape, poses, first)
    items = hulls_of(shape, poses[0])
    points = items.corners
    corners = np.arange(len(points) * points.shape[1]).reshape(len(points), -1)
    return Leaf(shape, items.poses[::-1], first, points.reshape(-1, 3), corners, items.radii)


def has_groups(shape: Shape) -> bool:
    """Whether a shape has items: large terrain, whose items are made where they are needed, and regions have not."""
    return not (shape.is_region or (isinstance(shape, HeightField) and shape.is_field))


class Group(NamedTuple):
    """Several leaves, or facets of a single leaf (``None``: the leaf as a whole)."""

    leaves: Sequence[Leaf]
    facets: np.ndarray | None
    n_items: int


class BodyGroups:
    """The items of a shape at a pose X (4, 4), and their groups."""

    def __init__(self, shape: Shape, X: np.ndarray):
        self.leaves: list[Leaf] = []
        self.n_items = 0
        for leaf, poses in leaves_of(shape, (X,)):
            self.leaves.append(_leaf(leaf, poses[::-1], self.n_items))
            self.n_items += self.leaves[-1].n_items
        self._groups = {0: self._group(self.leaves)}
        self._parts: dict[int, list[ExactPart]] = {}

    def _group(self, leaves: Sequence[Leaf]) -> Group:
        n = sum(leaf.n_items for leaf in leaves)
        return Group(leaves, np.arange(n) if len(leaves) == 1 and n > 1 else None, n)

    def group(self, k: int) -> Group:
        if k not in self._groups:
            whole = self.group((k - 1) // 2)
            self._groups[k] = _cut_group(whole, self._group)[1 - k % 2]
        return self._groups[k]

    def parts(self, k: int) -> list[ExactPart]:
        """Convex parts whose union has the hull of group k."""
        if k not in self._parts:
            leaves, facets, _ = self.group(k)
            self._parts[k] = [leaf.part(facets) for leaf in leaves]
        return self._parts[k]

    def numbers(self, k: int) -> list[int]:
        """The items of a group."""
        leaves, facets, n = self.group(k)
        first = leaves[0].first
        return list(range(first, first + n)) if facets is None else (first + facets).tolist()

    def item(self, number: int) -> ExactPart | None:
        """The item of a number; ``None`` of other numbers."""
        if not 0 <= number < self.n_items:
            return None
        leaf = next(leaf for leaf in reversed(self.leaves) if leaf.first <= number)
        return leaf.part(np.array([number - leaf.first]))

    @property
    def solids(self) -> list[tuple[int, Leaf]]:
        """(number, leaf) of parts that are solid meshes."""
        return [(k, leaf) for k, leaf in enumerate(self.leaves) if leaf.solid]

    @cached_property
    def surfaces(self) -> list[int]:
        """Items, one of each connected surface: a facet, a ball, or a convex part. O(items)."""
        return [
            leaf.first + k for leaf in self.leaves
            for k in ([0] if leaf.corners is None else _items_of_shells(leaf.corners))
        ]


def _cut_group(group: Group, made: Callable[[Sequence[Leaf]], Group]) -> tuple[Group, Group]:
    leaves, facets, _ = group
    if facets is None:
        middle = (len(leaves) + 1) // 2
        return made(leaves[:middle]), made(leaves[middle:])
    leaf = leaves[0]
    assert leaf.vertices is not None and leaf.corners is not None
    sums = reduce(np.add, (leaf.vertices[column] for column in leaf.corners[facets].T))
    axis = int(np.argmax(sums.max(axis=0) - sums.min(axis=0)))
    order = facets[np.argsort(sums[:, axis], kind="stable")]
    middle = (len(order) + 1) // 2
    first, second = np.sort(order[:middle]), np.sort(order[middle:])
    return Group(leaves, first, len(first)), Group(leaves, second, len(second))


def _items_of_shells(corners: np.ndarray) -> list[int]:
    """An item of each set of items connected by vertices: labels are lowered until items agree."""
    label = np.arange(int(corners.max()) + 1)
    while True:
        lowered = label.copy()
        np.minimum.at(lowered, corners.ravel(), np.repeat(label[corners].min(axis=1), corners.shape[1]))
        lowered = lowered[lowered]
        if np.array_equal(lowered, label):
            break
        label = lowered
    _, first = np.unique(label[corners[:, 0]], return_index=True)
    return first.tolist()


def cut_pair(A: BodyGroups, B: BodyGroups, i: int, j: int) -> list[tuple[int, int]]:
    """Pairs of groups that make up a pair: the group of more items is cut, A's of two alike. Empty for single items."""
    n, m = A.group(i).n_items, B.group(j).n_items
    if max(n, m) == 1:
        return []
    return [(2 * i + 1, j), (2 * i + 2, j)] if n >= m else [(i, 2 * j + 1), (i, 2 * j + 2)]


def flaw_of_planes(A: BodyGroups, B: BodyGroups, planes: Planes) -> str | None:
    """Why planes fail to part two bodies, each pair of items by one; ``None`` for a proof."""
    stack, used = [(0, 0)], 0
    while stack:
        i, j = stack.pop()
        normal = planes.get((i, j))
        if normal is None:
            pairs = cut_pair(A, B, i, j)
            if not pairs:
                return f"no plane parts item {A.numbers(i)[0]} of A from item {B.numbers(j)[0]} of B"
            stack += pairs
            continue
        used += 1
        flaw = flaw_of_normals(A.parts(i), B.parts(j), normal)
        if flaw:
            return f"groups {i} and {j}: {flaw}"
    return None if used == len(planes) else "planes between groups that are parts of groups with a plane, or no groups"


def flaw_of_outside(A: BodyGroups, B: BodyGroups, planes: Planes) -> str | None:
    """Why bodies, whose items planes part, are not proven to be outside of each other's solids; ``None`` for a proof.

    No surface reaches across another, so a point of each tells of all, and items beyond a plane of a whole body are
    outside of its solids. A half-space has no end, and a solid has.
    """
    for solids, body, side in ((A, B, 1), (B, A, 0)):
        if not solids.solids:
            continue
        beyond = {number for pair in planes if pair[1 - side] == 0 for number in body.numbers(pair[side])}
        for number in body.surfaces:
            point = None if number in beyond else point_of(body.item(number))  # type: ignore[arg-type]
            for k, solid in solids.solids if point else ():
                if solid.holds(point) is not False:  # type: ignore[arg-type]
                    return f"item {number} is not proven to be outside of the solid, part {k} of {'AB'[1 - side]}"
    return None


def flaw_of_group_certificates(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, certificates: Sequence[Certificate], claim: str
) -> str | None:
    """Why planes between groups, or a point of two items, fail to prove a claim; ``None`` for a proof."""
    kinds = {certificate.kind for certificate in certificates}
    if not (has_groups(A) and has_groups(B)):
        return "these shapes have no certificate"
    if claim == APART and kinds == {PLANE}:
        planes: Planes = {(i, j): rows[0] for _, i, j, rows in certificates}
        a, b = BodyGroups(A, X_WA), BodyGroups(B, X_WB)
        return flaw_of_planes(a, b, planes) or flaw_of_outside(a, b, planes)
    if claim == TOGETHER and kinds == {POINT} and len(certificates) == 1:
        ((_, i, j, (point,)),) = certificates
        return flaw_of_meeting(BodyGroups(A, X_WA), BodyGroups(B, X_WB), i, j, point)
    return f"the result says {claim}, the certificates {', '.join(sorted(kinds)) or 'nothing'}"


def flaw_of_meeting(A: BodyGroups, B: BodyGroups, i: int, j: int, point: WeightedPoint) -> str | None:
    """Why a point fails to lie in both bodies, in the items named, or for −1 − k in the inside of part k, a solid."""
    if point[3] <= 0:
        return "a point (x, y, z, w) needs w > 0"
    for body, number, name in ((A, i, "A"), (B, j, "B")):
        item, solids = body.item(number), [leaf for k, leaf in body.solids if k == -1 - number]
        if item is None and not solids:
            return f"{name} has no item and no solid {number}"
        if not (solids[0].holds(point) if item is None else holds(item, point)):
            return f"{name} does not hold the point in {number}"
    return None


def point_of(part: ExactPart) -> WeightedPoint | None:
    """A point of a part, the first vertex or the middle; ``None`` of a half-space."""
    if part.kind == HALFSPACE:
        return None
    if part.kind != POINTS:
        return in_lowest_terms(part.placement[1])
    return vertex_of(part, 0)


def vertex_of(part: ExactPart, k: int) -> WeightedPoint:
    """Vertex k of a part."""
    return in_lowest_terms([c * Fraction(2) ** part.vertices.grid for c in part.vertices[k]])
