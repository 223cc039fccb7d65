"""The parts of a union that meshes are asked about: single bodies and where they stand, to any nesting."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.broadphase.walk_posed_trees import PosedTree
from collide.lowering.extents import extent_of
from collide.lowering.facet_bodies import PosesWithSlop, is_halfspace
from collide.lowering.packed_convex import HALFSPACE, PackedConvex
from collide.lowering.parts import bounding_parts_of
from collide.lowering.shape_table import RADIUS, REACH, SLOP, ShapeTable, moved_pose, pose_table
from collide.narrowphase.bounds import ERROR
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.shape import IDENTITY, Shape, held_by, kept_with_shape

#: Boxes of parts that are made at once; of so few pairs of parts all are compared, of more through a box-tree.
_BOXES_AT_ONCE, _MAX_PAIRS = 1 << 16, 256
#: Parts of a group, and groups of a larger one.
_OF_A_GROUP = 32
#: Outside half-spaces: a rounded turn moves what is far away by more.
_UP = 1 + 2.0**-40


class Part(NamedTuple):
    """One body of a union.

    of : a mesh, or a convex shape (`held_by`).   X : (4, 4) its pose in the union's frame.
    rotation, shift : by how much, at most, rounding moved a point for each metre from the part's origin, and besides
        [m]: a pose within a pose is their exact product, rounded once.
    """

    of: Callable[[], Any]
    X: np.ndarray
    rotation: float
    shift: float

    @property
    def shape(self) -> Any:
        return self.of()

    def at(self, X_WB: np.ndarray, about: np.ndarray) -> PosesWithSlop:
        """Its poses in the world, for poses (n, 4, 4) of the union.

        about : (n,) how far from it half-spaces are looked at [m].
        """
        return _placed(X_WB, self.X, _reach_of(self.bound, about), self.rotation, self.shift)

    @property
    def exact(self) -> bool:
        """Whether rounding moved no point of the part in the union."""
        return self.rotation == self.shift == 0.0

    @property
    def bound(self) -> PackedConvex:
        """A convex set that holds the part, in the part's own frame."""
        return bounding_parts_of(self.shape)[0][0]


def _reach_of(bound: PackedConvex, about: np.ndarray) -> np.ndarray:
    """(n,) how far from its origin a part is looked at [m]."""
    return np.full(len(about), bound.reach) if bound.kind != HALFSPACE else about + abs(bound.params[3])


def _placed(X_WB: np.ndarray, X_BP: np.ndarray, reach: np.ndarray, rotation, shift) -> PosesWithSlop:
    """Poses in the world of a part, or of n parts, as `Part` describes them."""
    X, slop = moved_pose(X_WB, X_BP, reach)
    stretch = np.sqrt(np.square(X_WB[:, :3, :3]).sum(axis=(1, 2)))
    return PosesWithSlop(X, slop + stretch * (rotation * reach + shift) * _UP)


def _stretch_of(R: np.ndarray) -> np.ndarray:
    """(k,) at least how much longer matrices (k, 3, 3) make a vector, and 1: the root of the norm of R^T R."""
    gram = np.abs(R.transpose(0, 2, 1) @ R).sum(axis=2).max(axis=1)
    return np.maximum(np.sqrt(gram), 1.0) * _UP


class Balls(NamedTuple):
    """Balls that hold a union's parts, or groups of parts: centres (k, 3) and radii (k,) in the union's frame [m], and
    (parts,) the number of each part's ball."""

    centres: np.ndarray
    radii: np.ndarray
    of: np.ndarray

    def at(self, which: np.ndarray, X_WB: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(centres (m, 3), radii (m,) [m]) of balls (m,) by number, at the union's poses (m, 4, 4).

        Three products and three sums of each coordinate are rounded.
        """
        R, p = X_WB[:, :3, :3], X_WB[:, :3, 3]
        terms = R * self.centres[which, None]
        radii = _stretch_of(R) * self.radii[which] * _UP
        radii = radii + 2.0**-45 * (np.abs(terms).sum(axis=(1, 2)) + np.abs(p).sum(axis=1))
        return terms.sum(axis=2) + p, radii


def _balls_around(centres: np.ndarray, radii: np.ndarray, of: np.ndarray) -> Balls:
    """Balls around groups of balls: what is within one of these is within its radius and the way between the
    centres."""
    k = int(of.max()) + 1
    low, high = np.full((k, 3), math.inf), np.full((k, 3), -math.inf)
    np.minimum.at(low, of, centres)
    np.maximum.at(high, of, centres)
    middles, around = 0.5 * (low + high), np.zeros(k)
    np.maximum.at(around, of, (np.sqrt(np.square(centres - middles[of]).sum(axis=1)) + radii) * _UP)
    return Balls(middles, around, of)


def _by_place(points: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Numbers of points (k, 3), cut in two along their longest axis again and again, whole groups on one side."""
    if len(which) <= _OF_A_GROUP:
        return which
    along = points[which, np.ptp(points[which], axis=0).argmax()]
    order, half = which[np.argsort(along, kind="stable")], max(len(which) // 2 // _OF_A_GROUP, 1) * _OF_A_GROUP
    return np.concatenate([_by_place(points, order[:half]), _by_place(points, order[half:])])


class PartColumns(NamedTuple):
    """All parts of a union, a row each.

    X : (k, 4, 4) poses.   rotation, shift : as of `Part`.   reach, radius, slop : of what holds them [m].
    plane : |offset| of half-spaces, NaN of others [m].   meshed : bool.
    """

    X: np.ndarray
    rotation: np.ndarray
    shift: np.ndarray
    reach: np.ndarray
    radius: np.ndarray
    slop: np.ndarray
    plane: np.ndarray
    meshed: np.ndarray


class CompoundParts:
    """A shape as a list of convex sets and meshes, each at its pose in the shape's frame.

    parts : a `Part` for each leaf of a `Compound`, in the order of the items; of any other shape, the shape alone.
    numbers : places in ``parts`` of the convex sets.
    is_union, is_halfspace : whether the shape is a `Compound`, and whether the shape is a half-space.
    """

    def __init__(self, shape: Shape):
        self.parts = [Part(held_by(shape, s), *_rounded(X)) for s, X in _leaves(shape, None)]
        self.is_union, self.is_halfspace = isinstance(shape, Compound), is_halfspace(shape)
        # A height field has the bytes of the answers of its mesh.
        self._name = Mesh.__name__ if isinstance(shape, Mesh) else type(shape).__name__
        self.numbers = np.array([k for k, part in enumerate(self.parts) if not part.shape.meshed], dtype=np.int64)
        convex = _convex_part(shape)
        self._convex = None if convex is None else held_by(shape, convex)
        bounds = bounding_parts_of(shape)
        self._bounds, self._X_BP = [packed for packed, _ in bounds], np.array([X for _, X in bounds])

    @property
    def convex(self) -> Shape | None:
        """The parts that are no meshes as a single shape; ``None`` where all are meshes."""
        return None if self._convex is None else self._convex()

    @cached_property
    def key(self) -> bytes:
        """Orders the bodies of a pair, so that swapped questions are worked out on the same numbers."""
        digest = hashlib.blake2b(self._name.encode(), digest_size=16)
        for part in self.parts:
            shape = part.shape
            if isinstance(shape, Mesh):
                digest.update((shape.vertices + 0.0).tobytes() + shape.faces.tobytes() + bytes([shape.solid]))
            else:
                digest.update(part.bound.content)
            digest.update((part.X + 0.0).tobytes())
        return digest.digest()

    @cached_property
    def ball(self) -> np.ndarray | None:
        """(7,) numbers as of a `MeshTree`: centre, zeros and radius of a ball around all parts [m]; ``None`` of
        half-spaces."""
        if self.unbounded:
            return None
        at = self._X_BP[:, :3, 3]
        centre = 0.5 * (at.min(axis=0) + at.max(axis=0))
        across = np.sqrt(np.square(at - centre).sum(axis=1))
        reach = np.array([packed.reach + packed.radius + packed.slop for packed in self._bounds])
        # 1 but for what poses of items are off rotations
        stretch = np.array([np.linalg.norm(X[:3, :3], 2) for X in self._X_BP])
        size = np.abs(at).max() + np.abs(centre).max()
        radius = float((across + stretch * reach).max()) * _UP + 2.0**-40 * size
        return np.array([*centre, 0.0, 0.0, 0.0, radius])

    @cached_property
    def unbounded(self) -> bool:
        """Whether a half-space is among the parts."""
        return any(packed.kind == HALFSPACE for packed in self._bounds)

    @cached_property
    def columns(self) -> PartColumns:
        """The parts, and what holds them."""
        bounds = [part.bound for part in self.parts]
        return PartColumns(
            np.array([part.X for part in self.parts]), np.array([part.rotation for part in self.parts]),
            np.array([part.shift for part in self.parts]), np.array([bound.reach for bound in bounds]),
            np.array([bound.radius for bound in bounds]), np.array([bound.slop for bound in bounds]),
            np.array([abs(bound.params[3]) if bound.kind == HALFSPACE else math.nan for bound in bounds]),
            np.array([part.shape.meshed for part in self.parts]),
        )

    @cached_property
    def reach(self) -> float:
        """How far any part reaches from the origin, at most, half-spaces apart [m]."""
        of_parts = zip(self._bounds, self._X_BP)
        return max(packed.reach + packed.radius + float(np.abs(X[:3, 3]).sum()) for packed, X in of_parts)

    @cached_property
    def radius(self) -> float:
        """Radius [m] of a ball around the union's origin that holds all bounded parts."""
        columns = self.columns
        at = np.sqrt(np.square(columns.X[:, :3, 3]).sum(axis=1))
        reach = np.where(np.isnan(columns.plane), 1.001 * (columns.reach + columns.radius + columns.slop), 0.0)
        return float((at + reach).max()) * (1.0 + 2.0**-30)

    @cached_property
    def slop(self) -> float:
        """How far rounding moved any part in the union at most [m]."""
        columns = self.columns
        return float((columns.rotation * columns.reach + columns.shift).max()) * (1.0 + 2.0**-40)

    @cached_property
    def _table(self) -> ShapeTable:
        return ShapeTable(self._bounds)

    def placed(self, which: np.ndarray, X_WB: np.ndarray, about: np.ndarray) -> PosesWithSlop:
        """Poses in the world of parts (m,) by number, of the union's poses (m, 4, 4); about : as of `Part.at`."""
        columns = self.columns
        plane = columns.plane[which]
        reach = np.where(np.isnan(plane), columns.reach[which], about + plane)
        return _placed(X_WB, columns.X[which], reach, columns.rotation[which], columns.shift[which])

    def placed_all(self, X_WB: np.ndarray) -> list[PosesWithSlop]:
        """What `Part.at` gives of every part at n poses, worked out at once; of unions without half-spaces."""
        n, k = len(X_WB), len(self.parts)
        X, slop = self.placed(np.repeat(np.arange(k), n), np.tile(X_WB, (k, 1, 1)), np.zeros(k * n))
        return [PosesWithSlop(*rows) for rows in zip(X.reshape(k, n, 4, 4), slop.reshape(k, n))]

    def boxes(self, X_WB: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """(n, parts, 6) world boxes of parts, or of those by number, at n poses, low then high, rounded outwards."""
        which = np.arange(len(self._bounds)) if which is None else which
        if len(X_WB) > 1 and (X_WB[1:] == X_WB[0]).all():  # one body of a depth search stands still
            return np.repeat(self.boxes(X_WB[:1], which), len(X_WB), axis=0)
        n, k = len(X_WB), len(which)
        return self.boxes_of(np.tile(which, n), np.repeat(X_WB, k, axis=0)).reshape(n, k, 6)

    def boxes_of(self, which: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
        """(m, 6) the same of parts (m,) by number, each at a pose (m, 4, 4) of its own."""
        poses = pose_table(X_WB, self._X_BP[which], self._table.numbers[which, REACH], terms=False)
        return boxes_of(self._table, poses.rows, np.ascontiguousarray(which))

    @cached_property
    def tree(self) -> PosedTree:
        """Over the parts' boxes, in the union's frame."""
        radii = self._table.numbers[:, [RADIUS, SLOP]].sum(axis=1)
        return PosedTree(self.boxes(IDENTITY[None])[0], float(radii.max()))

    @cached_property
    def balls(self) -> Balls:
        """Around each part's origin, as it stands in the union's frame; infinite of half-spaces."""
        columns = self.columns
        held = _stretch_of(columns.X[:, :3, :3]) * columns.reach + columns.radius + columns.slop
        held += columns.rotation * columns.reach + columns.shift
        return Balls(columns.X[:, :3, 3], np.where(np.isnan(columns.plane), held, math.inf), np.arange(len(held)))

    @cached_property
    def groups(self) -> list[Balls]:
        """Balls around groups of parts near each other, the largest groups first, all parts in each `Balls`; empty of
        unions with too few parts for groups to pay."""
        centres, radii, _ = self.balls
        place = np.empty(len(radii), dtype=np.int64)
        place[_by_place(centres, np.arange(len(radii)))] = np.arange(len(radii))
        sizes = [_OF_A_GROUP**k for k in range(1, 8) if _OF_A_GROUP**k < _OF_A_GROUP * len(radii)]
        return [_balls_around(centres, radii, place // size) for size in reversed(sizes)] if len(sizes) > 1 else []

    def extents(self, X_WB: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, float]:
        """((d,) what no product of its points with each of d unit vectors exceeds, error of these), at a pose (4, 4).

        No part reaches beyond the ball around its origin; poses stretch by 1e-4 at most. The farthest balls come first:
        what a ball holds back from the largest value found is not worked out.
        """
        columns, k = self.columns, len(self.parts)
        at_pose = self.placed(np.arange(k), np.broadcast_to(X_WB, (k, 4, 4)), np.zeros(k))
        shift = at_pose.X[:, :3, 3]
        size = 2 * columns.reach + columns.radius + np.abs(shift).sum(axis=1)
        balls = directions @ shift.T + ((1.0 + 1e-3) * (columns.reach + columns.radius) + 2.0**-40 * size)
        balls[:, ~np.isnan(columns.plane)] = math.inf
        values = np.full(len(directions), -math.inf)
        for d, (n, of_parts) in enumerate(zip(directions, balls)):
            for part in np.argsort(-of_parts, kind="stable").tolist():
                if of_parts[part] < values[d]:
                    break
                values[d] = max(values[d], extent_of(self.parts[part].bound, at_pose.X[part], n))
        return values, ERROR * float(size.max()) + float((at_pose.slop + columns.slop).max())


@kept_with_shape("_union")
def compound_parts(shape: Shape) -> CompoundParts:
    """The parts of a shape."""
    return CompoundParts(shape)


def boxes_near(
    A: CompoundParts, B: CompoundParts, X_WA: np.ndarray, X_WB: np.ndarray, margin: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(poses, parts of A, parts of B) by number, with boxes within the margin [m], or a little farther apart.

    Boxes hold the parts at their rounded poses, and all that rounding may have moved the parts by: parts whose boxes
    are apart along an axis by more than the margin are farther apart than the margin. Of many pairs a walk through both
    trees leaves out most beforehand: near parts have near nodes. Boxes are made in blocks of little memory.
    """
    if len(A.parts) * len(B.parts) > _MAX_PAIRS:
        met = [A.tree.pairs_near(B.tree, X, Y, margin) for X, Y in zip(X_WA, X_WB)]
        pose = np.repeat(np.arange(len(met)), [len(of_pose) for of_pose in met])
        i, j = np.concatenate([*met, np.zeros((0, 2), dtype=np.int64)]).T
        a, b = A.boxes_of(i, X_WA[pose]), B.boxes_of(j, X_WB[pose])
        near = np.maximum(b[:, :3] - a[:, 3:], a[:, :3] - b[:, 3:]).max(axis=1) <= _outwards(a, b, margin)
        return pose[near], i[near], j[near]
    pairs = [np.zeros((3, 0), dtype=np.int64)]
    step = max(1, _BOXES_AT_ONCE // (len(A.parts) + len(B.parts)))
    for first in range(0, len(X_WA), step):
        a, b = A.boxes(X_WA[first : first + step])[:, :, None], B.boxes(X_WB[first : first + step])[:, None]
        apart = np.maximum(b[..., :3] - a[..., 3:], a[..., :3] - b[..., 3:]).max(axis=3)
        near = np.stack(np.nonzero(apart <= _outwards(a, b, margin)))
        pairs.append(near + np.array([[first], [0], [0]]))
    pose, i, j = np.concatenate(pairs, axis=1)
    return pose, i, j


def _outwards(a: np.ndarray, b: np.ndarray, margin: float) -> float:
    """The margin, and more than rounding takes from a difference of two boxes' ends [m]."""
    ends = np.concatenate([a.ravel(), b.ravel()])
    return margin + 2.0**-40 * (margin + float(np.abs(ends[np.isfinite(ends)]).max(initial=0.0)))


def _leaves(shape: Shape, X: np.ndarray | list[list[Fraction]] | None):
    """Yields (single body, its exact pose in the outermost frame: a given matrix, rows of four fractions of a product,
    or ``None`` for the identity)."""
    if not isinstance(shape, Compound):
        yield shape, X
        return
    for item, X_CS in shape.items:
        yield from _leaves(item, X_CS if X is None else _times(_exact(X), _exact(X_CS)))


def _exact(X: np.ndarray | list[list[Fraction]]) -> list[list[Fraction]]:
    return [[Fraction(v) for v in row] for row in X.tolist()] if isinstance(X, np.ndarray) else X


def _times(X: list[list[Fraction]], Y: list[list[Fraction]]) -> list[list[Fraction]]:
    return [[sum((X[i][k] * Y[k][j] for k in range(4)), Fraction(0)) for j in range(4)] for i in range(4)]


def _rounded(X: np.ndarray | list[list[Fraction]] | None) -> tuple[np.ndarray, float, float]:
    """(pose rounded once, how far rounding turns a point 1 m from the origin [m], how far rounding shifts the origin
    [m]), the last two rounded upwards."""
    if X is None:
        return IDENTITY, 0.0, 0.0
    if isinstance(X, np.ndarray):
        return X + 0.0, 0.0, 0.0
    rounded = np.array([[float(v) for v in row] for row in X])
    lost = [[abs(v - Fraction(float(v))) for v in row[:4]] for row in X]
    lost_rotation = sum((v for row in lost for v in row[:3]), Fraction(0))
    shift = sum((row[3] for row in lost), Fraction(0))
    return rounded, float(lost_rotation) * _UP, float(shift) * _UP


def _convex_part(shape: Shape) -> Shape | None:
    """What is left of a shape without its meshes, in the same nesting."""
    if not shape.meshed:
        return shape
    if not isinstance(shape, Compound):
        return None
    items = [(_convex_part(item), X) for item, X in shape.items]
    items = [(item, X) for item, X in items if item is not None]
    return Compound(items) if items else None
