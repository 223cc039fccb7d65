"""Spheres around and within the links of a robot: few, and made in milliseconds.

A convex set is halved across an axis again and again, where the largest sphere around a piece is: a piece is the hull
of its corners, and so within a sphere around these. A sphere within a set is as large as the distance of its centre
from the surface, as `collide.distance` proves it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base.poses_at import poses_at
from collide.hull.exact_hull import convex_hull
from collide.lowering.extents import box_of
from collide.lowering.packed_convex import CYLINDER, POINTS, PackedConvex
from collide.lowering.parts import bounding_parts_of, is_single_convex
from collide.pairs import query
from collide.robots.check_tables import RobotBody, without_meshes
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape, kept_with_shape

#: Radii are larger, or smaller, by this share of all that goes into them: far more than is rounded in a dozen cuts.
ROUNDING = 2.0**-40
#: Spheres around a link; pieces whose halves have no smaller spheres than this share are not halved.
_COUNT, _WORTH = 8, 0.97
#: Steps towards the middle of a sphere around points, and towards the middle of a set.
_STEPS, _ASCENTS = 16, 24


class BodySpheres(NamedTuple):
    """Spheres of a body in its frame.   outer, inner : (n, 4) centres and radii [m]; the body lies within the union of
    the outer ones, and the inner ones lie within the body.   is_exact : whether the body is a union of spheres: outer
    and inner ones are these, larger and smaller by roundings, radii below 0 among them.
    """

    outer: np.ndarray
    inner: np.ndarray
    is_exact: bool


_NOTHING = np.zeros((0, 4))


def spheres_of(body: RobotBody) -> BodySpheres:
    """Those of a body of a robot, whose shape is a `Compound` of collision elements."""
    items = body.shape.items if isinstance(body.shape, Compound) else [(body.shape, np.eye(4))]
    count = max(1, _COUNT // len(items))
    made = [(_spheres_of_shape(shape, count), X) for shape, X in items]
    outer, inner = (
        np.concatenate([_moved((spheres.outer, spheres.inner)[k], X, sign) for spheres, X in made])
        for k, sign in ((0, 1.0), (1, -1.0))
    )
    is_exact = all(spheres.is_exact for spheres, _ in made)
    return BodySpheres(outer, inner if is_exact else inner[inner[:, 3] > 0.0], is_exact)


def _moved(spheres: np.ndarray, X: np.ndarray, sign: float) -> np.ndarray:
    """Spheres (n, 4) at a pose, larger (sign 1) or smaller (−1) where its matrix is not quite a rotation."""
    out, skew = spheres.copy(), float(np.abs(X[:3, :3].T @ X[:3, :3] - np.eye(3)).sum())
    out[:, :3] = spheres[:, :3] @ X[:3, :3].T + X[:3, 3]
    if (X != np.eye(4)).any():
        out[:, 3] += sign * (ROUNDING * (np.abs(out).sum(axis=1) + np.abs(spheres).sum(axis=1)) + skew * spheres[:, 3])
    return out


@kept_with_shape("_link_spheres")
def _spheres_by_count(shape: Shape) -> dict[int, BodySpheres]:
    """What was made, by the number of spheres wanted."""
    return {}


def _spheres_of_shape(shape: Shape, count: int) -> BodySpheres:
    made = _spheres_by_count(shape)
    if count not in made:
        made[count] = _made(shape, count)
    return made[count]


def are_spheres(shape: Shape) -> bool:
    """Whether a shape is a union of spheres, or of points."""
    if isinstance(shape, Compound):
        return all(are_spheres(item) for item, _ in shape.items)
    return not shape.is_asked_whole and all(
        part.kind == POINTS and len(part.points) == 1 for part, _ in bounding_parts_of(shape)
    )


def _made(shape: Shape, count: int) -> BodySpheres:
    parts = bounding_parts_of(shape)
    same = without_meshes(shape)
    if are_spheres(shape):
        rows = [(np.array([[*part.points[0], part.radius]]), X) for part, X in parts]
        outer, inner = (np.concatenate([_moved(row, X, sign) for row, X in rows]) for sign in (1.0, -1.0))
        return BodySpheres(outer, inner, True)
    if is_single_convex(shape):
        outer, inner = _of_swept_box(parts[0][0], count)
        if len(outer):
            return BodySpheres(outer, inner, False)
    share = max(1, count // len(parts))
    outer = np.concatenate([_moved(outer_spheres(part, share), X, 1.0) for part, X in parts])
    return BodySpheres(outer, _inner_spheres(shape if same is None else same, outer[:, :3]), False)


def _of_swept_box(packed: PackedConvex, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Spheres around and within a box or a cylinder swept by a ball, in closed form; empty for further sets.

    Cells of the box are within spheres around their middles. A sphere as large as the shortest half side fits around
    every point of the box shrunk by as much. In a cylinder the middles must be within the circle shrunk by as much:
    up to 4 · 2 cells of the square around the circle have such middles.
    """
    if packed.kind == CYLINDER:
        middle, half = np.zeros(3), np.array([packed.params[0], packed.params[0], packed.params[1]])
    elif packed.kind == POINTS and are_all_corners(packed.points):
        low, high = packed.points.min(axis=0), packed.points.max(axis=0)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
    else:
        return _NOTHING, _NOTHING
    outer, cell = _cells_of(half, count)
    if packed.kind == CYLINDER and (outer[:, :2] == 0.0).all():
        cell = cell * (2.0**-0.5, 2.0**-0.5, 1.0)
    within = float(half.min())
    inner, _ = _cells_of(half - within, _COUNT)
    radii = float(np.linalg.norm(cell)) + packed.radius + packed.slop, within + packed.radius - packed.slop
    spheres = [np.column_stack([middle + at, np.full(len(at), r)]) for at, r in zip((outer, inner), radii)]
    for made, sign in zip(spheres, (1.0, -1.0)):
        made[:, 3] += sign * ROUNDING * (np.abs(made).sum(axis=1) + np.abs(middle).sum() + half.sum())
    return spheres[0], spheres[1][spheres[1][:, 3] > 0.0]


def _cells_of(half: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """((n, 3) middles of at most so many equal cells of a box about the origin, (3,) their half sides), long sides cut
    in half.
    """
    counts = np.ones(3, dtype=np.int64)
    while 2 * counts.prod() <= count:
        cell = half / counts
        longest = int(cell.argmax())
        shorter = cell.copy()
        shorter[longest] *= 0.5
        if not np.linalg.norm(shorter) < _WORTH * np.linalg.norm(cell):
            break
        counts[longest] *= 2
    axes = [half[k] * ((2.0 * np.arange(n) + 1.0) / n - 1.0) for k, n in enumerate(counts.tolist())]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3), half / counts


def are_all_corners(points: np.ndarray) -> bool:
    """Whether the hull of points is their box: the points are its corners, or two of them along an axis, or one."""
    low, high = points.min(axis=0), points.max(axis=0)
    if not ((points == low) | (points == high)).all():
        return False
    n_corners = 2 ** int((low != high).sum())
    return len(np.unique(points, axis=0)) == n_corners


def outer_spheres(packed: PackedConvex, count: int) -> np.ndarray:
    """(n, 4) at most so many spheres whose union holds a convex set."""
    if packed.kind == POINTS:
        corners, beyond = packed.points, packed.radius + packed.slop
    else:
        box = box_of(packed)
        signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        corners, beyond = box[:3] + signs * box[3:], 0.0
    pieces = [(corners, ball_around(corners))]
    whole: list[tuple[np.ndarray, np.ndarray]] = []
    while pieces and len(pieces) + len(whole) < count:
        pieces.sort(key=lambda piece: piece[1][3])
        corners, ball = pieces.pop()
        both = _best_halves(corners)
        if both is None or max(half[1][3] for half in both) > _WORTH * ball[3]:
            whole.append((corners, ball))
        else:
            pieces += both
    spheres = np.array([ball for _, ball in (*pieces, *whole)])
    spheres[:, 3] += beyond + ROUNDING * (np.abs(spheres).sum(axis=1) + beyond)
    return spheres


def _best_halves(corners: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """Both halves of the hull of points, with spheres around them, cut across the axis of the smallest spheres."""
    edges, best = _edges_of(corners), None
    low, high = corners.min(axis=0), corners.max(axis=0)
    for axis in np.argsort(low - high)[:2].tolist():
        at = 0.5 * (low[axis] + high[axis])
        heights = corners[:, axis] - at
        a, b = heights[edges[:, 0]], heights[edges[:, 1]]
        crossing = (a < 0.0) != (b < 0.0)
        share = (a[crossing] / (a[crossing] - b[crossing]))[:, None]
        first, second = corners[edges[crossing, 0]], corners[edges[crossing, 1]]
        cut = first + share * (second - first)
        if not len(cut):
            continue
        both = [np.concatenate([corners[side], cut]) for side in (heights < 0.0, heights >= 0.0)]
        candidates = [(half, ball_around(half)) for half in both]
        if best is None or max(ball[3] for _, ball in candidates) < max(ball[3] for _, ball in best):
            best = candidates
    return best


def _edges_of(points: np.ndarray) -> np.ndarray:
    """(k, 2) edges of the hull of points."""
    hull = convex_hull(points)
    if hull.dimension < 2:
        return hull.vertices[None, [0, -1]] if hull.dimension else np.zeros((0, 2), dtype=np.int64)
    return np.concatenate([hull.facets[:, [0, 1]], hull.facets[:, [1, 2]], hull.facets[:, [2, 0]]])


def ball_around(centres: np.ndarray, radii: np.ndarray | float = 0.0, *, steps: int = _STEPS) -> np.ndarray:
    """(4,) a sphere around spheres or points: about the middle of their box, moved towards the farthest, ever less
    (Badoiu and Clarkson, "Smaller core-sets for balls", 2003).   radii : (n,), or of all.   steps : how often.
    """
    beyond = np.reshape(radii, (-1, 1))
    centre = 0.5 * ((centres - beyond).min(axis=0) + (centres + beyond).max(axis=0))
    best = np.full(4, np.inf)
    for step in range(steps):
        reach = np.sqrt(((centres - centre) ** 2).sum(axis=1)) + radii
        k = int(reach.argmax())
        if reach[k] < best[3]:
            best = np.array([*centre, reach[k]])
        centre = centre + (centres[k] - centre) / (step + 2.0)
    return best


def _inner_spheres(shape: Shape, centres: np.ndarray) -> np.ndarray:
    """(n, 4) spheres within a shape, about centres (k, 3) moved inwards; none within surfaces."""
    if isinstance(shape, Compound):
        made = [_moved(_inner_spheres(item, _in_frame(centres, X)), X, -1.0) for item, X in shape.items]
        return np.concatenate(made or [_NOTHING])
    if isinstance(shape, Mesh) and shape.meshed:
        return _within_mesh(shape, centres) if shape.solid else _NOTHING
    if not is_single_convex(shape):
        return _NOTHING
    packed = bounding_parts_of(shape)[0][0]
    if packed.kind == POINTS:
        centres = _moved_inwards(packed.points, centres)
    rows = query.distance(shape, _POINT, np.eye(4), poses_at(centres), check_poses=False).rows
    return _with_radii(centres, -rows["upper"])


_POINT = ConvexHull(np.zeros((1, 3)))


def _in_frame(points: np.ndarray, X: np.ndarray) -> np.ndarray:
    return (points - X[:3, 3]) @ X[:3, :3]


def _with_radii(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(n, 4) spheres of the positive radii, a little smaller; of such within each other the largest."""
    spheres = np.column_stack([centres, radii - ROUNDING * (np.abs(centres).sum(axis=1) + np.abs(radii))])
    spheres = spheres[spheres[:, 3] > 0.0]
    spread: list[np.ndarray] = []
    for sphere in spheres[np.argsort(-spheres[:, 3])]:
        if all(np.linalg.norm(sphere[:3] - larger[:3]) > 0.25 * larger[3] for larger in spread):
            spread.append(sphere)
    return np.array(spread[:_COUNT]).reshape(-1, 4)


def _moved_inwards(points: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Centres (k, 3) moved away from the nearest facets of the hull of points, and their mean."""
    hull = convex_hull(points)
    if hull.dimension < 3:
        return centres
    corners = points[hull.facets]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0.0] / lengths[lengths > 0.0, None]
    offsets = (normals * corners[lengths > 0.0, 0]).sum(axis=1)
    middle = points[hull.vertices].mean(axis=0)
    centres = np.concatenate([centres, middle[None], 0.5 * (centres + middle)])
    best, radii = centres.copy(), np.full(len(centres), -np.inf)
    step = 0.3 * float((points.max(axis=0) - points.min(axis=0)).min())
    for _ in range(_ASCENTS):
        depths = offsets - centres @ normals.T
        nearest = depths.argmin(axis=1)
        depth = depths[np.arange(len(centres)), nearest]
        better = depth > radii
        best[better], radii[better] = centres[better], depth[better]
        centres = centres - step * normals[nearest]
        step *= 0.8
    return best


def _within_mesh(mesh: Mesh, centres: np.ndarray) -> np.ndarray:
    """Spheres within a solid mesh: about points inside, as large as the distance to the surface."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    cells = np.maximum(1, np.minimum(8, np.ceil(6 * (high - low) / (high - low).max()))).astype(int)
    axes = [low[k] + (np.arange(n) + 0.5) / n * (high[k] - low[k]) for k, n in enumerate(cells.tolist())]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.concatenate([centres, grid])
    points = points[query.collide(mesh, _POINT, np.eye(4), poses_at(points), check_poses=False)]
    if not len(points):
        return _NOTHING
    surface = Mesh(mesh.vertices, mesh.faces, solid=False)
    rows = query.distance(surface, _POINT, np.eye(4), poses_at(points), check_poses=False).rows
    return _with_radii(points, rows["lower"])
