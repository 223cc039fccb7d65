"""Bodies as items, and groups of items as a binary tree, for proofs that part one group from another by a plane.

The items of a body are the facets of its meshes and its convex parts, numbered in the order of the parts. Group 0 is
the whole body; group k is cut into the groups 2k + 1 and 2k + 2: of several parts the first half and the rest; of the
facets of a mesh the half with the lesser sums of corners along the longest extent of these sums, in the mesh's frame,
and the rest. Sums of two doubles are the same on every machine, and so are the groups.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from collide.certificates.exact_parts import ExactPart, exact_part, leaves_of
from collide.certificates.point_and_plane import WeightedPoint, flaw_of_normals, holds, in_lowest_terms, seen_from
from collide.certificates.winding_number import winding_number
from collide.lowering.convex_sets import HALFSPACE, POINTS, convex_set
from collide.numerics.exact_points import PlacedPoints, Point
from collide.shapes.shape import Shape

#: Pairs of groups looked at, at most.
MAX_PAIRS = 50_000
#: (group of A, group of B) and the normal of the plane between them.
Planes = dict[tuple[int, int], Point]


class Leaf(NamedTuple):
    """A part of a body: a mesh with its facets, or a convex set.

    poses : the outermost first.   first : the number of its first item.
    """

    shape: Shape
    poses: tuple[np.ndarray, ...]
    first: int
    is_mesh: bool

    def part(self, facets: np.ndarray | None = None) -> ExactPart:
        """The hull of facets given by number; the convex set."""
        if not self.is_mesh:
            return exact_part(convex_set(self.shape), *self.poses)
        vertices = self.shape.vertices[np.unique(self.shape.faces[facets])]  # type: ignore[attr-defined]
        return ExactPart(POINTS, vertices, 0.0, None, *self.poses)

    def holds(self, point: WeightedPoint) -> bool | None:
        """Whether facets of a solid wind around a point; ``None`` where no ray tells."""
        vertices = seen_from(PlacedPoints(self.shape.vertices, self.poses[::-1]), point)  # type: ignore[attr-defined]
        number = winding_number(vertices, self.shape.faces)  # type: ignore[attr-defined]
        return None if number is None else number > 0


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
            is_mesh = bool(leaf.meshed)
            self.leaves.append(Leaf(leaf, poses[::-1], self.n_items, is_mesh))
            self.n_items += len(leaf.faces) if is_mesh else 1  # type: ignore[attr-defined]
        self._groups = {0: self._group(self.leaves)}
        self._parts: dict[int, list[ExactPart]] = {}

    def _group(self, leaves: Sequence[Leaf]) -> Group:
        if len(leaves) > 1 or not leaves[0].is_mesh:
            after = leaves[-1].first + (len(leaves[-1].shape.faces) if leaves[-1].is_mesh else 1)  # type: ignore[attr-defined]
            return Group(leaves, None, after - leaves[0].first)
        return Group(leaves, np.arange(len(leaves[0].shape.faces)), len(leaves[0].shape.faces))  # type: ignore[attr-defined]

    def group(self, k: int) -> Group:
        if k not in self._groups:
            whole = self.group((k - 1) // 2)
            self._groups[k] = _cut_group(whole, self._group)[1 - k % 2]
        return self._groups[k]

    def parts(self, k: int) -> list[ExactPart]:
        """Convex parts whose union has the hull of group k."""
        if k not in self._parts:
            leaves, facets, _ = self.group(k)
            self._parts[k] = [
                leaf.part(np.arange(len(leaf.shape.faces)) if leaf.is_mesh and facets is None else facets)  # type: ignore[attr-defined]
                for leaf in leaves
            ]
        return self._parts[k]

    def number(self, k: int) -> int:
        """The item of a group of one."""
        (leaf,), facets, _ = self.group(k)
        return leaf.first + (int(facets[0]) if facets is not None else 0)

    def item(self, number: int) -> ExactPart | None:
        """The item of a number; ``None`` of other numbers."""
        if not 0 <= number < self.n_items:
            return None
        leaf = next(leaf for leaf in reversed(self.leaves) if leaf.first <= number)
        return leaf.part(np.array([number - leaf.first]) if leaf.is_mesh else None)

    @property
    def solids(self) -> list[tuple[int, Leaf]]:
        """(number, leaf) of parts that are solid meshes."""
        return [(k, leaf) for k, leaf in enumerate(self.leaves) if leaf.is_mesh and leaf.shape.solid]  # type: ignore[attr-defined]

    @cached_property
    def surfaces(self) -> list[tuple[int, ExactPart]]:
        """(number, item): an item of each connected surface, a facet or a convex part. O(facets)."""
        numbers = [
            leaf.first + k for leaf in self.leaves
            for k in (_facets_of_shells(leaf.shape.faces) if leaf.is_mesh else [0])  # type: ignore[attr-defined]
        ]
        return [(k, part) for k in numbers for part in [self.item(k)] if part is not None]


def _cut_group(group: Group, made: Callable[[Sequence[Leaf]], Group]) -> tuple[Group, Group]:
    leaves, facets, _ = group
    if facets is None:
        middle = (len(leaves) + 1) // 2
        return made(leaves[:middle]), made(leaves[middle:])
    corners = leaves[0].shape.vertices[leaves[0].shape.faces[facets]]  # type: ignore[attr-defined]
    sums = corners[:, 0] + corners[:, 1] + corners[:, 2]
    axis = int(np.argmax(sums.max(axis=0) - sums.min(axis=0)))
    order = facets[np.argsort(sums[:, axis], kind="stable")]
    middle = (len(order) + 1) // 2
    first, second = np.sort(order[:middle]), np.sort(order[middle:])
    return Group(leaves, first, len(first)), Group(leaves, second, len(second))


def _facets_of_shells(faces: np.ndarray) -> list[int]:
    """A facet of each set of facets connected by vertices: labels are lowered until facets agree."""
    label = np.arange(int(faces.max()) + 1)
    while True:
        lowest = label[faces].min(axis=1)
        lowered = label.copy()
        np.minimum.at(lowered, faces.ravel(), np.repeat(lowest, 3))
        lowered = lowered[lowered]
        if np.array_equal(lowered, label):
            break
        label = lowered
    _, first = np.unique(label[faces[:, 0]], return_index=True)
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
                return f"no plane parts item {A.number(i)} of A from item {B.number(j)} of B"
            stack += pairs
            continue
        used += 1
        flaw = flaw_of_normals(A.parts(i), B.parts(j), normal)
        if flaw:
            return f"groups {i} and {j}: {flaw}"
    return None if used == len(planes) else "planes between groups that are parts of groups with a plane, or no groups"


def flaw_of_outside(A: BodyGroups, B: BodyGroups) -> str | None:
    """Why bodies whose items are apart are not proven to be outside of each other's solids; ``None`` for a proof.

    No surface reaches across another, so a point of each tells of all. A half-space has no end, and a solid has.
    """
    for solids, body, name in ((A, B, "A"), (B, A, "B")):
        for k, solid in solids.solids:
            for item, part in body.surfaces:
                point = point_of(part)
                if point is not None and solid.holds(point) is not False:
                    return f"item {item} is not proven to be outside of the solid, part {k} of {name}"
    return None


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
