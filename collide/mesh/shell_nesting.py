"""Which shells with a negative volume are cavities, and which are inside out: exact winding numbers.

A shell that runs the wrong way round is the wall of a cavity where everything else winds around it at
least once, and inside out where it does not. Rays are cast from one of its points in fixed directions, in
doubles with an error bound, and in Python integers for the facets where that leaves a sign open.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.mesh.shell_volumes import Shells, exact_integers, permanent, scaled_to_one
from collide.numerics.vec3 import Vec3, absolute, add, cross, dot, scale, sub, vec3_at

#: Of a determinant of differences: eight roundings deep, four times that; and all that underflows.
_ERROR, _UNDERFLOW = 2.0**-48, 2.0**-960
#: The sum of three coordinates below 1, and three times one, round by less than this.
_ROUNDED_MIDDLE = 2.0**-49
#: Directions tried before a point is given up, and points of a shell tried before it is.
_DIRECTIONS, _POINTS = 6, 24


def inside_out(vertices: np.ndarray, parts: Shells, signs: np.ndarray) -> np.ndarray:
    """(shells,) bool: shells of negative volume that are not the wall of a cavity.

    signs : (shells,) of their volumes. Shells are taken not to cross each other; then one point of each
    decides. A shell none of whose points is clear of the others' facets counts as inside out.
    """
    wrong = signs < 0
    if wrong.any() and (signs > 0).any():
        low, high = _boxes(vertices, parts)
        scaled, _ = scaled_to_one(vertices)
        shared = _shared_vertices(len(vertices), parts)
        for shell in np.flatnonzero(wrong).tolist():
            wrong[shell] = not _is_cavity(vertices, scaled, parts, low, high, signs, shared, shell)
    return wrong


def _boxes(vertices: np.ndarray, parts: Shells) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.full((parts.n, 3), np.inf), np.full((parts.n, 3), -np.inf)
    used = parts.shells >= 0
    for k in range(3):
        points = vertices[parts.corners[used, k]]
        np.minimum.at(low, parts.shells[used], points)
        np.maximum.at(high, parts.shells[used], points)
    return low, high


def _shared_vertices(n: int, parts: Shells) -> np.ndarray:
    """(n,) bool: vertices of several shells. They lie on other shells' facets, so rays from them decide nothing."""
    used = parts.shells >= 0
    lowest, highest = np.full(n, parts.n, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    for k in range(3):
        np.minimum.at(lowest, parts.corners[used, k], parts.shells[used])
        np.maximum.at(highest, parts.corners[used, k], parts.shells[used])
    return lowest < highest


def _is_cavity(vertices, scaled, parts, low, high, signs, shared, shell) -> bool:
    facets = parts[shell]
    unshared = np.unique(facets)
    unshared = unshared[~shared[unshared]]
    others = np.arange(parts.n) != shell
    for rows in (unshared[:_POINTS, None], facets[:_POINTS]):
        for row in rows:
            # Shells whose boxes miss the facet, or the vertex, do not wind around a point of it.
            lowest, highest = vertices[row].min(axis=0), vertices[row].max(axis=0)
            around = others & (low <= highest).all(axis=1) & (high >= lowest).all(axis=1)
            if not (around & (signs > 0)).any():
                return False
            around_it = np.concatenate([parts[k] for k in np.flatnonzero(around).tolist()])
            winding = _winding(vertices, scaled, around_it, row)
            if winding is not None:
                return winding >= 1
    return False


def _winding(vertices, scaled, corners, row) -> int | None:
    """How often facets wind around the middle of vertices ``row``.

    None where it lies on one, or all directions met an edge.
    """
    n = len(row)
    ambiguous = np.empty(len(corners), dtype=np.int32)
    total = np.empty(1, dtype=np.int64)
    for k in range(_DIRECTIONS):
        direction = [_direction(k, axis) for axis in range(3)]
        ray = np.array([*scaled[row].sum(axis=0), *direction, n, 0.0 if n == 1 else _ROUNDED_MIDDLE])
        count = cast_ray(
            address_of(scaled), len(scaled), address_of(corners), len(corners), address_of(ray), address_of(total),
            address_of(ambiguous),
        )
        sides, heights = _exact_signs(vertices, corners[ambiguous[:count]], row, direction)
        up, down, level = ((sides == s).any(axis=1) for s in (1, -1, 0))
        met = ~(up & down)
        if (met & level).any():
            continue
        if (heights[met] == 0).any():
            return None
        return int(total[0]) + int(sides[met & (heights == sides[:, 0]), 0].sum())
    return None


def _direction(k: int, axis: int) -> int:
    """A fixed component within ±2¹⁹; few planes of a mesh will hold such a direction."""
    h = (3 * k + axis + 1) * 0x9E3779B1 & 0xFFFFFFFF
    h = (h ^ (h >> 15)) * 0x85EBCA6B & 0xFFFFFFFF
    return ((h ^ (h >> 13)) & 0xFFFFF) - 0x80000


def _exact_signs(vertices, corners, row, direction) -> tuple[np.ndarray, np.ndarray]:
    """Seen from the middle of vertices ``row``, in integers: on which side of each facet's three edges the ray
    passes (f, 3), and on which side of the facet the point lies (f,)."""
    if not len(corners):
        return np.zeros((0, 3), dtype=np.int8), np.zeros(0, dtype=np.int8)
    rows, ids = np.unique(np.append(corners.ravel(), row), return_inverse=True)
    exact, ids = exact_integers(vertices[rows]), ids.ravel()
    middle = exact[ids[-len(row) :]].sum(axis=0)
    away = [exact[ids[: -len(row)].reshape(-1, 3)[:, k]] * len(row) - middle for k in range(3)]
    normals = [np.cross(away[k], away[(k + 1) % 3]) for k in range(3)]
    along = np.array(direction, dtype=object)
    values = np.stack(
        [(a * n).sum(axis=1) for a, n in zip((along, along, along, away[0]), (*normals, normals[1]))], axis=1
    )
    signs = (values > 0).astype(np.int8) - (values < 0).astype(np.int8)
    return signs[:, :3], signs[:, 3]


@kernel
def _proven_sign(u, v, w, slack_u, slack):
    """Sign of the determinant of u, v, w, whose entries are off by the slacks at most; 0 where that leaves it open."""
    value = dot(u, cross(v, w))
    size = permanent(u, v, w)
    margin = _ERROR * size + _UNDERFLOW
    if slack > 0.0:
        wide = permanent(_widened(u, slack_u), _widened(v, slack), _widened(w, slack))
        margin = _ERROR * wide + 1.01 * (wide - size) + _UNDERFLOW
    if value > margin:
        return 1
    return -1 if value < -margin else 0


@kernel(inline=True)
def _widened(a, slack):
    return add(absolute(a), Vec3(slack, slack, slack))


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def cast_ray(points_at, n, corners_at, n_facets, ray_at, total_at, ambiguous_at):
    """Facets that a ray certainly passes, +1 outwards and −1 inwards; returns how many are undecided, and which.

    ray : eight doubles: the sum of some points, the direction, how many points, and how far that sum may be off.
    total : one int64 out.   ambiguous : (n_facets,) int32 out.
    """
    points = view_f64(points_at, 3 * n)
    corners = view_i32(corners_at, 3 * n_facets)
    ray = view_f64(ray_at, 8)
    ambiguous = view_i32(ambiguous_at, n_facets)
    start = vec3_at(ray, 0)
    d = vec3_at(ray, 3)
    n_points = ray[6]
    slack = ray[7]
    count = 0
    winding = 0
    for f in range(n_facets):
        a = sub(scale(n_points, vec3_at(points, 3 * corners[3 * f])), start)
        b = sub(scale(n_points, vec3_at(points, 3 * corners[3 * f + 1])), start)
        c = sub(scale(n_points, vec3_at(points, 3 * corners[3 * f + 2])), start)
        ab = _proven_sign(d, a, b, 0.0, slack)
        bc = _proven_sign(d, b, c, 0.0, slack)
        if ab * bc < 0:
            continue
        ca = _proven_sign(d, c, a, 0.0, slack)
        if ab * ca < 0 or bc * ca < 0:
            continue
        side = _proven_sign(a, b, c, slack, slack)
        if ab * bc * ca == 0 or side == 0:
            ambiguous[count] = f
            count += 1
        elif side == ab:
            winding += ab
    view_i64(total_at, 1)[0] = winding
    return count
