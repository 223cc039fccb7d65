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
from collide.lowering.extents import extent_of
from collide.lowering.facet_bodies import PosesWithSlop, is_halfspace
from collide.lowering.packed_convex import HALFSPACE, PackedConvex
from collide.lowering.parts import bounding_parts_of
from collide.lowering.shape_table import ShapeTable, moved_pose, pose_table
from collide.narrowphase.bounds import ERROR
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.shape import IDENTITY, Shape, held_by, kept_with_shape

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
        bound = self.bound
        reach = np.full(len(X_WB), bound.reach) if bound.kind != HALFSPACE else about + abs(bound.params[3])
        X, slop = moved_pose(X_WB, self.X, reach)
        stretch = np.sqrt(np.square(X_WB[:, :3, :3]).sum(axis=(1, 2)))
        return PosesWithSlop(X, slop + stretch * (self.rotation * reach + self.shift) * _UP)

    @property
    def bound(self) -> PackedConvex:
        """A convex set that holds it, in its own frame."""
        return bounding_parts_of(self.shape)[0][0]


class CompoundParts:
    """A shape as a union: of one part, where it is none.

    parts : single bodies in the order of the items.   numbers : of those among them that are no meshes.
    is_union, is_halfspace : whether the shape is a Compound, and whether it is a half-space.
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
        """The parts that are no meshes as one shape; None where there are none."""
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
        """(7,) numbers as of a `MeshTree`, of which centre and radius of a ball around all parts count; None of
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

    @property
    def unbounded(self) -> bool:
        """Whether a half-space is among the parts."""
        return any(packed.kind == HALFSPACE for packed in self._bounds)

    def boxes(self, X_WB: np.ndarray) -> np.ndarray:
        """(n, parts, 6) world boxes of the parts at n poses, low then high, rounded outwards."""
        n, k = len(X_WB), len(self._bounds)
        X_BP = np.tile(self._X_BP, (n, 1, 1))
        reach = np.tile([packed.reach for packed in self._bounds], n)
        poses = pose_table(np.repeat(X_WB, k, axis=0), X_BP, reach)
        return boxes_of(ShapeTable(self._bounds), poses.rows, np.tile(np.arange(k), n)).reshape(n, k, 6)

    def extent(self, X_WB: np.ndarray, n: np.ndarray) -> tuple[float, float]:
        """(what no product of its points with the unit vector n exceeds, error of that), at a pose (4, 4)."""
        value, size, slop = -math.inf, 0.0, 0.0
        for part in self.parts:
            at_pose = part.at(X_WB[None], np.zeros(1))
            X, packed = at_pose.X[0], part.bound
            part_extent = extent_of(packed, X, n)
            value, slop = max(value, part_extent), max(slop, float(at_pose.slop[0]) + packed.slop)
            size = max(size, 2 * packed.reach + packed.radius + float(np.abs(X[:3, 3]).sum()))
        return value, ERROR * size + slop


@kept_with_shape("_union")
def compound_parts(shape: Shape) -> CompoundParts:
    """The parts of a shape."""
    return CompoundParts(shape)


def _leaves(shape: Shape, X: list[list[Fraction]] | None):
    """Yields (single body, its exact pose in the outermost frame, rows of four)."""
    if not isinstance(shape, Compound):
        yield shape, X
        return
    for item, X_CS in shape.items:
        R_p = [[Fraction(v) for v in row] for row in X_CS.tolist()]
        yield from _leaves(item, R_p if X is None else _times(X, R_p))


def _times(X: list[list[Fraction]], Y: list[list[Fraction]]) -> list[list[Fraction]]:
    return [[sum((X[i][k] * Y[k][j] for k in range(4)), Fraction(0)) for j in range(4)] for i in range(4)]


def _rounded(X: list[list[Fraction]] | None) -> tuple[np.ndarray, float, float]:
    """(pose rounded once, what that turns a metre by, what it shifts), the last two rounded upwards."""
    if X is None:
        return IDENTITY, 0.0, 0.0
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
