"""Shapes as triangles, to draw them or to hand them to programs that know triangles alone.

Every convex shape becomes a closed polyhedron inside the shape, its vertices on the surface (rounded once), facets
counter-clockwise seen from outside; no point of the shape is farther from the polyhedron than the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.height_field import HeightField
from collide.shapes.hpolytope import HPolytope
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import Shape, checked_shape
from collide.shapes.swept_mesh import SweptMesh
from collide.shapes.voxel_grid import VoxelGrid

#: Where no tolerance is given: this part of a shape's largest radius.
_USUAL = 0.01
#: Larger tessellations are refused: a tolerance in the wrong unit, mostly.
MAX_VERTICES = 2_000_000
#: Cells that the surface of a grid is looked for among, at most.
_MAX_DRAWN_CELLS = 1 << 27


class Tessellation(tuple):
    """``vertices, faces = collide.tessellate(shape)``; and how far it is off.

    vertices : (V, 3) float64 [m], in the frame of the shape.   faces : (F, 3) int64 rows of ``vertices``,
        counter-clockwise seen from outside.
    deviation : no point of the shape is farther from the triangles' solid than this [m]; 0 of polytopes and meshes.
    """

    deviation: float

    def __new__(cls, vertices: np.ndarray, faces: np.ndarray, deviation: float = 0.0):
        made = super().__new__(cls, (vertices, faces))
        made.deviation = deviation
        return made

    def __getnewargs__(self):
        return (*self, self.deviation)

    @property
    def vertices(self) -> np.ndarray:
        return self[0]

    @property
    def faces(self) -> np.ndarray:
        return self[1]


def tessellate(shape: Shape, tolerance: float | None = None, *, size: float | None = None) -> Tessellation:
    """A shape as triangles in its own frame, outward oriented, inside the shape.

    Parameters
    ----------
    shape : Shape
        Convex shapes give a closed surface. A `ConvexHull` or `Box` without an inside gives both sides of a flat
        polygon, or no triangle at all (a segment, a point). A `VoxelGrid` gives its outer faces. A mesh is returned
        as it is; a `Compound` part by part, parts overlapping.
    tolerance : float, optional
        No point of the shape is farther than this [m] from the solid that the triangles bound; by default a hundredth
        of each shape's largest radius.
    size : float, optional
        Edge length [m] of the square that stands for a `Halfspace`, which is unbounded: around the point of its plane
        nearest the origin, facing out of the solid, open. Of an `HPolytope` with ``bounded=False`` the part in a box
        around the origin, of twice this edge length at most, or more where the region is farther away, closed.

    Returns
    -------
    Tessellation
        A tuple ``(vertices, faces)``: (V, 3) float64 [m] and (F, 3) int64; its ``deviation`` [m] says what tolerance
        was reached.

    Raises
    ------
    InvalidArgument
        For a tolerance or size that is not above 0, and where a shape would take more than 2,000,000 vertices.
    UnsupportedQuery
        For a half-space, and an `HPolytope` with ``bounded=False``, without ``size``; for a `PointCloud`, balls by the
        million: its points and radii are what to draw.
    """
    checked_shape("tessellate: shape", shape, "collide.Sphere(0.1)")
    for name, value in (("tolerance", tolerance), ("size", size)):
        if value is not None and not 0.0 < _length(value) < math.inf:
            raise InvalidArgument(
                f"tessellate: {name} must be a finite length above 0 [m], got {checks.brief(value)}"
            )
    if isinstance(shape, Compound):
        return _together([(tessellate(part, tolerance=tolerance, size=size), X) for part, X in shape.items])
    if isinstance(shape, Halfspace):
        return _square(shape, size)
    if shape.is_region:
        return _within_box(shape, size)
    for kind, made in _KINDS.items():
        if isinstance(shape, kind):
            return made(shape, tolerance)
    if isinstance(shape, HeightField) and shape.heights.size > MAX_VERTICES:
        raise InvalidArgument(
            f"tessellate: the terrain has {shape.heights.size} grid points, and {MAX_VERTICES} are the most; draw "
            "every n-th: HeightField(field.heights[::n, ::n], n * field.cell)"
        )
    if hasattr(shape, "vertices") and hasattr(shape, "faces"):
        return Tessellation(shape.vertices, np.asarray(shape.faces, dtype=np.int64))
    what = "is balls around points: draw its points and radii" if isinstance(shape, PointCloud) else "has none here"
    raise UnsupportedQuery(f"tessellate: a {type(shape).__name__} has no triangles: it {what}")


def _length(value) -> float:
    read = None if isinstance(value, bool) else checks.number(value)
    return math.nan if read is None else read


def _together(parts: list[tuple[Tessellation, np.ndarray]]) -> Tessellation:
    """Posed parts beside each other, each with the vertices of its own."""
    vertices = [part.vertices @ X[:3, :3].T + X[:3, 3] for part, X in parts]
    starts = np.cumsum([0, *map(len, vertices)])
    faces = [part.faces + start for (part, _), start in zip(parts, starts)]
    return Tessellation(np.concatenate(vertices), np.concatenate(faces), max(part.deviation for part, _ in parts))


def _within_box(shape: Shape, size: float | None) -> Tessellation:
    if size is None:
        raise UnsupportedQuery(
            "tessellate: an HPolytope with bounded=False, or a Plane, may have no end; give the size [m] of a box to "
            "stand for it"
        )
    assert isinstance(shape, HPolytope)
    half = max(0.5 * size, 2.0 * shape.boundary_within)
    return _hull(shape.closed(math.ldexp(1.0, math.frexp(half)[1])).vertices)


def _square(shape: Halfspace, size: float | None) -> Tessellation:
    if size is None:
        raise UnsupportedQuery("tessellate: a Halfspace has no end; give the size [m] of a square to stand for it")
    length = float(np.linalg.norm(shape.normal))
    normal = shape.normal / length
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    middle = shape.offset / length * normal
    vertices = np.array([middle + size * (x * first + y * second) for x, y in corners])
    return Tessellation(vertices, np.array([[0, 1, 2], [0, 2, 3]]))


# --- polytopes, and what is swept over them ------------------------------------------------------


def _hull(points: np.ndarray) -> Tessellation:
    """The hull of points, over its corners alone."""
    surface = ConvexHull(points).hull
    corners = surface.vertices
    row = np.zeros(len(points), dtype=np.int64)
    row[corners] = np.arange(len(corners))
    return Tessellation(points[corners], row[surface.facets.reshape(-1, 3)])


def _box(shape: Box, _) -> Tessellation:
    signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3, indexing="ij")).reshape(3, 8).T
    if not shape.size.all():
        return _hull(signs * shape.size + 0.0)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Tessellation(signs * shape.size, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]))


def _swept_hull(points: np.ndarray, radius: float, tolerance: float | None) -> Tessellation:
    """The hull of points with a ball swept over it: the hull of what the ball's own tessellation covers.

    The sum of an exact set and a set off by the ball's deviation is off by the same deviation. Sums are made only where
    they may be corners: of a point and a direction both extreme in some direction nearby.
    """
    if radius == 0.0:
        return _hull(points)
    ball = _ball(radius, tolerance)
    directions = ball.vertices / radius
    edge = np.linalg.norm(directions[ball.faces] - directions[np.roll(ball.faces, 1, axis=1)], axis=2).max()
    corners = points[ConvexHull(points).hull.vertices] if len(points) > 1 else points
    reach = float(np.linalg.norm(np.ptp(corners, axis=0)))
    made = []
    for start in range(0, len(directions), 256):
        some = directions[start : start + 256]
        heights = corners @ some.T
        # a corner of the sum has a facet's normal within an edge of its direction
        k, d = np.nonzero(heights >= heights.max(axis=0) - 2 * reach * edge)
        made.append(corners[k] + radius * some[d])
        _refuse_more_than(sum(map(len, made)), tolerance)
    vertices, faces = _hull(np.unique(np.concatenate(made), axis=0))
    return Tessellation(vertices, faces, ball.deviation)


def _swept_mesh(shape: SweptMesh, tolerance: float | None) -> Tessellation:
    if tolerance is not None and tolerance < shape.radius:
        raise InvalidArgument(
            f"tessellate: a SweptMesh is drawn by the triangles of its mesh, which are {shape.radius!r} m off; give a "
            f"tolerance no smaller, got {tolerance!r}"
        )
    return Tessellation(shape.mesh.vertices, np.asarray(shape.mesh.faces, dtype=np.int64), shape.radius)


def _voxel_grid(grid: VoxelGrid, _tolerance: float | None) -> Tessellation:
    """Both triangles of every face between an occupied and a free cell."""
    tree = grid.tree
    if math.prod(tree.shape) > _MAX_DRAWN_CELLS:
        raise InvalidArgument(
            f"tessellate: the grid spans {math.prod(tree.shape)} cells, and {_MAX_DRAWN_CELLS} are the most; draw the "
            "middles of its cells"
        )
    occupied = np.zeros(np.array(tree.shape) + 2, dtype=bool)
    occupied[tuple((grid.cells - tree.least + 1).T)] = True
    quads = []
    for axis in range(3):
        step = np.diff(occupied.astype(np.int8), axis=axis)
        u, v = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        for side in (1, -1):  # the cell begins, or ends, behind the plane
            corner = np.argwhere(step == side) - 1 + np.eye(3, dtype=np.int64)[axis]
            around = (0 * u, v, u + v, u) if side > 0 else (0 * u, u, u + v, v)
            quads.append(corner[:, None] + np.array(around))
    corners, faces = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    if len(corners) > MAX_VERTICES:
        raise InvalidArgument(f"tessellate: the cells have {len(corners)} corners, and {MAX_VERTICES} are the most")
    quad = faces.reshape(-1, 4)
    vertices = ((corners + tree.least) * tree.sides + tree.origin) @ grid.X_FG[:3, :3].T + grid.X_FG[:3, 3]
    return Tessellation(vertices, np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]))


# --- curved shapes -------------------------------------------------------------------------------


def _cylinder(shape: Cylinder, tolerance: float | None) -> Tessellation:
    ring, deviation = _ring(shape.radius, tolerance)
    n, half = len(ring), 0.5 * shape.length
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (-half, half)])
    k, after = np.arange(n), np.roll(np.arange(n), -1)
    sides = np.concatenate([np.column_stack([k, after, after + n]), np.column_stack([k, after + n, k + n])])
    return Tessellation(vertices, np.concatenate([sides, _fan(n)[:, ::-1], _fan(n) + n]), deviation)


def _cone(shape: Cone, tolerance: float | None) -> Tessellation:
    ring, deviation = _ring(shape.radius, tolerance)
    n, half = len(ring), 0.5 * shape.length
    vertices = np.vstack([np.column_stack([ring, np.full(n, -half)]), [[0.0, 0.0, half]]])
    k = np.arange(n)
    sides = np.column_stack([k, np.roll(k, -1), np.full(n, n)])
    return Tessellation(vertices, np.concatenate([sides, _fan(n)[:, ::-1]]), deviation)


def _ring(radius: float, tolerance: float | None) -> tuple[np.ndarray, float]:
    """Points on a circle (n, 2), and how far their polygon is off."""
    part = _part(radius, tolerance)
    n = max(8, math.ceil(math.pi / math.acos(1.0 - part)) if part < 1 else 8)
    n += -n % 4  # the axes are met exactly
    angles = np.arange(n) * (2 * math.pi / n)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)]), radius * _off(math.pi / n)


def _fan(n: int) -> np.ndarray:
    """A convex polygon of n corners, as triangles."""
    k = np.arange(1, n - 1)
    return np.column_stack([np.zeros_like(k), k, k + 1])


def _ellipsoid(shape: Ellipsoid, tolerance: float | None) -> Tessellation:
    largest = float(shape.radii.max())
    ball = _ball(largest, tolerance)
    # a linear image is off by no more than its longest axis times
    return Tessellation(ball.vertices / largest * shape.radii, ball.faces, ball.deviation)


def _ball(radius: float, tolerance: float | None) -> Tessellation:
    """A ball by an icosahedron whose facets are cut into small ones and pushed outwards."""
    part = _part(radius, tolerance)
    cuts = 2  # even ones: the axes are among the directions then, and a swept box keeps its flat sides
    while (sphere := _geodesic(cuts))[2] > part:
        # the deviation falls with the square of the cuts
        cuts = max(cuts + 2, 2 * math.floor(0.5 * cuts * math.sqrt(sphere[2] / part)))
        _refuse_more_than(10 * cuts * cuts + 2, tolerance)
    directions, faces, off = sphere
    return Tessellation(radius * directions, faces, radius * off)


@lru_cache(maxsize=16)
def _geodesic(cuts: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Unit vectors (10 cuts² + 2, 3), faces, and how far the polyhedron is from the unit ball at most."""
    corners, sides = _icosahedron()
    i, j = (k.ravel() for k in np.meshgrid(np.arange(cuts + 1), np.arange(cuts + 1), indexing="ij"))
    inside = i + j <= cuts
    i, j = i[inside], j[inside]
    weights = np.column_stack([cuts - i - j, i, j])
    # corners, edges and insides of the twenty facets, told apart by which corners they lie between, and how
    keys = np.concatenate([_keys(weights, side) for side in sides])
    points = np.concatenate([weights @ corners[side] for side in sides])
    _, first, ids = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    directions = points[first] / np.linalg.norm(points[first], axis=1)[:, None]
    at = {pair: k for k, pair in enumerate(zip(i.tolist(), j.tolist()))}
    small = [(at[a, b], at[a + 1, b], at[a, b + 1]) for a, b in at if a + b < cuts]
    small += [(at[a + 1, b], at[a + 1, b + 1], at[a, b + 1]) for a, b in at if a + b < cuts - 1]
    starts = len(weights) * np.arange(len(sides))
    faces = ids.reshape(-1)[np.array(small)[None] + starts[:, None, None]].reshape(-1, 3)
    a, b, c = (directions[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    heights = np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)
    directions.flags.writeable = faces.flags.writeable = False
    return directions, faces, float(1.0 - heights.min())


def _keys(weights: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(n, 12): the weight of each corner of the icosahedron, equal for one point of two facets."""
    keys = np.zeros((len(weights), 12), dtype=np.int32)
    keys[:, side] = weights
    return keys


def _icosahedron() -> tuple[np.ndarray, np.ndarray]:
    golden = (1 + math.sqrt(5)) / 2
    corners = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)])
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    near = np.linalg.norm(corners[:, None] - corners[None], axis=2) < 2.1
    sides = [
        (a, b, c)
        for a in range(12) for b in range(a + 1, 12) for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    outward = [np.linalg.det(corners[list(side)]) > 0 for side in sides]
    return corners, np.array([side if out else side[::-1] for side, out in zip(sides, outward)])


def _part(radius: float, tolerance: float | None) -> float:
    """The tolerance as a part of a radius. Raises InvalidArgument where a circle alone has too many corners."""
    part = _USUAL if tolerance is None else float(tolerance) / radius
    # n corners are off by π²/(2n²)
    _refuse_more_than(math.pi / math.sqrt(2 * part) if part > 0.0 else math.inf, tolerance)
    return part


def _off(angle: float) -> float:
    """1 − cos, to the last digit."""
    return 2 * math.sin(angle / 2) ** 2


def _refuse_more_than(vertices: float, tolerance: float | None) -> None:
    if vertices > MAX_VERTICES:
        raise InvalidArgument(
            f"tessellate: the tolerance {tolerance} m would take more than {MAX_VERTICES} vertices; give a larger one"
        )


_KINDS: dict[type[Shape], Callable[..., Tessellation]] = {
    Box: _box,
    Sphere: lambda shape, tolerance: _ball(shape.radius, tolerance),
    Capsule: lambda shape, tolerance: _swept_hull(
        np.array([(0.0, 0.0, -0.5), (0.0, 0.0, 0.5)]) * shape.length, shape.radius, tolerance
    ),
    Cylinder: _cylinder,
    Cone: _cone,
    Ellipsoid: _ellipsoid,
    ConvexHull: lambda shape, tolerance: _swept_hull(shape.points, shape.radius, tolerance),
    HPolytope: lambda shape, _: _hull(shape.vertices),
    SweptMesh: _swept_mesh,
    VoxelGrid: _voxel_grid,
}
