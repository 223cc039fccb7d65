"""Any shape as convex parts, each with its pose in the shape's frame: what a shape is to the rest of the engine.

`convex_sets.py` says what the parts of a class are. Parts are made when first asked for and kept with the shape, which
never changes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct

import numpy as np

from collide.kernels import address_of
from collide.lowering.cell_boxes import CELLS, boxes_of_cells
from collide.lowering.convex_sets import PRIMITIVE_NUMBERS, ConvexSet, convex_set, moved, primitive_numbers_of
from collide.lowering.lower_numbers import N_NUMBERS
from collide.lowering.lowered_sets import LoweredSets, PlacedSets
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex, pack_curved, pack_halfspace, pack_points
from collide.lowering.primitive_numbers import PrimitiveNumbers
from collide.shapes.compound import Compound
from collide.shapes.height_field import HeightField
from collide.shapes.hpolytope import HPolytope
from collide.shapes.mesh import Mesh
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import IDENTITY, Shape, kept_with_shape
from collide.shapes.swept_mesh import SweptMesh
from collide.shapes.voxel_grid import VoxelGrid

#: A convex set and its (4, 4) pose in the shape's frame.
Part = tuple[PackedConvex, np.ndarray]
Parts = Sequence[Part]

#: Shapes of few numbers share parts where these are equal, zeros of different signs apart: programs that make shapes as
#: they go make the same again and again. So many kinds of numbers are remembered, then all are forgotten.
MAX_SHARED = 1024
_KEY = Struct(f"={N_NUMBERS}d")
_parts_of_numbers: dict[bytes, Parts] = {}

#: One product of two poses rounds each coordinate of a point by at most this many units in the
#: last place of its terms: three products and three sums for the rotation, one more for the shift.
_ULPS_PER_PRODUCT = 8
_ULP = 2.0**-53
#: Points that are their own bounds; of more, boxes of cells hold them.
_MAX_OWN_BOUNDS = 512
_CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)


@kept_with_shape("_parts")
def parts_of(shape: Shape) -> Parts:
    """The convex sets whose union a shape is. Raises UnsupportedQuery for meshes and regions."""
    if isinstance(shape, Compound):
        return _compound(shape)
    numbers = primitive_numbers_of(shape)
    if numbers is None:
        return _alone(_packed(convex_set(shape)))
    key = _KEY.pack(*numbers)
    parts = _parts_of_numbers.get(key)
    if parts is None:
        if len(_parts_of_numbers) >= MAX_SHARED:
            _parts_of_numbers.clear()
        parts = _parts_of_numbers[key] = _alone(LoweredSets([numbers])[0])
    return parts


def bounding_parts_of(shape: Shape) -> Parts:
    """Convex sets that hold a shape: its parts, or larger, simpler sets for shapes without parts. For culling."""
    return _bounds_around(shape) if shape.is_asked_whole else parts_of(shape)


@kept_with_shape("_bounds")
def _bounds_around(shape: Compound | Mesh | HPolytope | PointCloud | SweptMesh | VoxelGrid) -> Parts:
    if isinstance(shape, HPolytope):
        return _alone(_half_space_around(shape))
    if isinstance(shape, Compound):
        return _compound(shape, bounding_parts_of)
    if isinstance(shape, SweptMesh):
        return _mesh_bounds(shape.mesh, shape.radius)
    if isinstance(shape, VoxelGrid):
        return _grid_bounds(shape)
    if isinstance(shape, HeightField) and shape.is_field:
        return _terrain_bounds(shape)
    return _cloud_bounds(shape) if isinstance(shape, PointCloud) else _mesh_bounds(shape)


def convex_set_of(shape: Shape) -> PackedConvex:
    """The first, or only, convex part."""
    return parts_of(shape)[0][0]


def is_single_convex(shape: Shape) -> bool:
    """Whether a shape is one convex set in its own frame."""
    if shape.__class__ in PRIMITIVE_NUMBERS:
        return True
    if shape.is_asked_whole:
        return False
    parts = parts_of(shape)
    return len(parts) == 1 and (parts[0][1] is IDENTITY or np.array_equal(parts[0][1], IDENTITY))


def _packed(part: ConvexSet) -> PackedConvex:
    """A convex set as kernels read it."""
    if part.kind == HALFSPACE:
        return pack_halfspace(part.params[:3], part.params[3])
    if part.kind != POINTS:
        return pack_curved(part.kind, part.params, part.curved_reach)
    packed = pack_points(part.points, part.radius, part.slop, part.with_tree, part.params)
    if part.planes is not None:
        packed.prepared.made["planes"] = part.planes
    return packed


def _half_space_around(region: HPolytope) -> PackedConvex:
    """The half-space of least reach beyond the origin, among the half-spaces of a region."""
    exponents = np.frexp(np.abs(region.normals).max(axis=1))[1]
    normals, offsets = np.ldexp(region.normals, -exponents[:, None]), np.ldexp(region.offsets, -exponents)
    least = int(np.argmin(offsets / np.sqrt(np.square(normals).sum(axis=1))))
    return pack_halfspace(tuple(normals[least]), float(offsets[least]))


def _compound(shape: Compound, of_item: Callable[[Shape], Parts] = parts_of) -> PlacedSets:
    rules = [PRIMITIVE_NUMBERS.get(item.__class__) for item, _ in shape.items]
    if None not in rules:
        return PlacedSets(LoweredSets([rule(item) for rule, (item, _) in zip(rules, shape.items)]), shape.poses)  # type: ignore[misc]
    sets: list[PrimitiveNumbers | PackedConvex] = []
    poses: list[np.ndarray] = []
    for rule, (item, X_CS) in zip(rules, shape.items):
        if rule is not None:
            sets.append(rule(item))
            poses.append(X_CS)
            continue
        for packed, X_SP in of_item(item):
            packed, X_CP = _placed(packed, X_CS, X_SP)
            sets.append(packed)
            poses.append(X_CP)
    return PlacedSets(LoweredSets(sets), np.array(poses))


def _alone(packed: PackedConvex) -> tuple[Part]:
    return ((packed, IDENTITY),)


def _placed(packed: PackedConvex, X_CS: np.ndarray, X_SP: np.ndarray) -> Part:
    """A part in the compound's frame, its slop grown by what the product of poses rounds."""
    X_CP = moved(X_CS, X_SP)
    if X_CP is X_CS:
        return packed, X_CS
    scale = packed.reach + np.abs(X_SP[:3, 3]).sum() + np.abs(X_CS[:3, 3]).max()
    return packed._replace(slop=packed.slop + 2 * _ULPS_PER_PRODUCT * _ULP * scale), X_CP


def _mesh_bounds(mesh: Mesh, radius: float = 0.0) -> Parts:
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces] = True
    return _alone(pack_points(_points_around(mesh.vertices[used]), radius))


def _cloud_bounds(cloud: PointCloud) -> Parts:
    return _alone(pack_points(_points_around(cloud.points), float(np.max(cloud.radius))))


def _grid_bounds(grid: VoxelGrid) -> Parts:
    low, high = grid.tree.coarse_boxes(_MAX_OWN_BOUNDS)
    points = np.unique(np.where(_CORNERS, high[:, None], low[:, None]).reshape(-1, 3), axis=0)
    if grid.X_FG is IDENTITY:
        return _alone(pack_points(points))
    R, t = grid.X_FG[:3, :3], grid.X_FG[:3, 3]
    slack = 2 * _ULPS_PER_PRODUCT * _ULP * (np.abs(points).sum(axis=1).max() + np.abs(t).sum())
    return _alone(pack_points(points @ R.T + t, float(slack)))


def _terrain_bounds(field: HeightField) -> Parts:
    (x, y), top = field.grid_lines, field.pyramid.top
    return _alone(pack_points(np.where(_CORNERS, (x[-1], y[-1], top), (x[0], y[0], field.bottom))))


def _points_around(points: np.ndarray) -> np.ndarray:
    """Points (k, 3) whose hull holds the ones given, and is not much larger: few, or corners of boxes around groups."""
    if len(points) <= _MAX_OWN_BOUNDS:
        return points
    boxes = np.empty((CELLS**3, 2, 3))
    boxes_of_cells(address_of(points), len(points), address_of(boxes))
    lows, highs = boxes[boxes[:, 0, 0] < np.inf].transpose(1, 0, 2)[:, :, None]
    return np.unique(np.where(_CORNERS, highs, lows).reshape(-1, 3), axis=0)
