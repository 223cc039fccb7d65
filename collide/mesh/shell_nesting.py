"""Which shells with a negative volume are cavities, and which are inside out: exact winding numbers.

A shell that runs the wrong way round is the wall of a cavity where everything else winds around it at
least once, and inside out where it does not. Rays are cast from one of its points in fixed directions, in
doubles with an error bound, and in Python integers for the facets that come too close.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.mesh.shell_volumes import Shells, cross, exact_integers, inner, scaled_to_one

#: Of a determinant of differences: eight roundings deep, four times that; and all that underflows.
_ERROR, _UNDERFLOW = 2.0**-48, 2.0**-960
#: The sum of three coordinates below 1, and three times one, round by less than this.
_ROUNDED_MIDDLE = 2.0**-49
#: Directions tried before a point is given up, and points of a shell tried before it is.
_DIRECTIONS, _POINTS = 6, 24


def inside_out(vertices: np.ndarray, parts: Shells, signs: np.ndarray) -> np.ndarray:
    """(shells,) bool: shells of negative volume that are not the wall of a cavity.

    signs : (shells,) of their volumes. Shells are taken not to cross each other; then one point of each
    decides. A shell of which no point could be told from the others' facets counts as inside out.
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
    low, high = np.full((parts.many, 3), np.inf), np.full((parts.many, 3), -np.inf)
    used = parts.shells >= 0
    for k in range(3):
        points = vertices[parts.corners[used, k]]
        np.minimum.at(low, parts.shells[used], points)
        np.maximum.at(high, parts.shells[used], points)
    return low, high


def _shared_vertices(n: int, parts: Shells) -> np.ndarray:
    """(n,) bool: vertices of several shells. They lie on other shells' facets, so they tell nothing."""
    used = parts.shells >= 0
    least, most = np.full(n, parts.many, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    for k in range(3):
        np.minimum.at(least, parts.corners[used, k], parts.shells[used])
        np.maximum.at(most, parts.corners[used, k], parts.shells[used])
    return least < most


def _is_cavity(vertices, scaled, parts, low, high, signs, shared, shell) -> bool:
    own = parts[shell]
    alone = np.unique(own)
    alone = alone[~shared[alone]]
    others = np.arange(parts.many) != shell
    for rows in (alone[:_POINTS, None], own[:_POINTS]):
        for row in rows:
            # Shells whose boxes miss the facet, or the vertex, do not wind around a point of it.
            lowest, highest = vertices[row].min(axis=0), vertices[row].max(axis=0)
            around = others & (low <= highest).all(axis=1) & (high >= lowest).all(axis=1)
            if not (around & (signs > 0)).any():
                return False
            facets = np.concatenate([parts[k] for k in np.flatnonzero(around).tolist()])
            winding = _winding(vertices, scaled, facets, row)
            if winding is not None:
                return winding >= 1
    return False


def _winding(vertices, scaled, corners, row) -> int | None:
    """How often facets wind around the middle of vertices ``row``; None where it lies on one, or all directions met an edge."""
    many = len(row)
    unsure = np.empty(len(corners), dtype=np.int32)
    total = np.empty(1, dtype=np.int64)
    for k in range(_DIRECTIONS):
        direction = [_direction(k, axis) for axis in range(3)]
        ray = np.array([*scaled[row].sum(axis=0), *direction, many, 0.0 if many == 1 else _ROUNDED_MIDDLE])
        count = cast_ray(
            address_of(scaled), len(scaled), address_of(corners), len(corners), address_of(ray), address_of(total),
            address_of(unsure),
        )  # fmt: skip
        sides, heights = _exact_signs(vertices, corners[unsure[:count]], row, direction)
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
    normals = [cross(away[k], away[(k + 1) % 3]) for k in range(3)]
    along = np.array(direction, dtype=object)
    values = np.stack([*(inner(along, n) for n in normals), inner(away[0], normals[1])], axis=1)
    signs = (values > 0).astype(np.int8) - (values < 0).astype(np.int8)
    return signs[:, :3], signs[:, 3]


@kernel
def _sure_sign(ux, uy, uz, vx, vy, vz, wx, wy, wz, slack_u, slack):
    """Sign of the determinant of u, v, w, whose entries are off by the slacks at most; 0 where that leaves it open."""
    value = ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)
    size = _size(ux, uy, uz, vx, vy, vz, wx, wy, wz, 0.0, 0.0)
    margin = _ERROR * size + _UNDERFLOW
    if slack > 0.0:
        wide = _size(ux, uy, uz, vx, vy, vz, wx, wy, wz, slack_u, slack)
        margin = _ERROR * wide + 1.01 * (wide - size) + _UNDERFLOW
    if value > margin:
        return 1
    return -1 if value < -margin else 0


@kernel
def _size(ux, uy, uz, vx, vy, vz, wx, wy, wz, slack_u, slack):
    """The determinant's terms, all taken positive and with entries that much larger."""
    vx = abs(vx) + slack
    vy = abs(vy) + slack
    vz = abs(vz) + slack
    wx = abs(wx) + slack
    wy = abs(wy) + slack
    wz = abs(wz) + slack
    size = (abs(ux) + slack_u) * (vy * wz + vz * wy)
    size += (abs(uy) + slack_u) * (vz * wx + vx * wz)
    return size + (abs(uz) + slack_u) * (vx * wy + vy * wx)


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def cast_ray(points_at, n, corners_at, facets, ray_at, total_at, unsure_at):
    """Facets that a ray surely passes, counted +1 outwards and −1 inwards; returns how many are left open, and which.

    ray : eight doubles: the sum of ``many`` points, the direction, ``many``, and how far that sum may be off.
    total : one int64 out.   unsure : (facets,) int32 out.
    """
    points = view_f64(points_at, 3 * n)
    corners = view_i32(corners_at, 3 * facets)
    ray = view_f64(ray_at, 8)
    total = view_i64(total_at, 1)
    unsure = view_i32(unsure_at, facets)
    x, y, z = ray[3], ray[4], ray[5]
    many = ray[6]
    slack = ray[7]
    count = 0
    winding = 0
    for f in range(facets):
        a = 3 * corners[3 * f]
        b = 3 * corners[3 * f + 1]
        c = 3 * corners[3 * f + 2]
        ax = many * points[a] - ray[0]
        ay = many * points[a + 1] - ray[1]
        az = many * points[a + 2] - ray[2]
        bx = many * points[b] - ray[0]
        by = many * points[b + 1] - ray[1]
        bz = many * points[b + 2] - ray[2]
        cx = many * points[c] - ray[0]
        cy = many * points[c + 1] - ray[1]
        cz = many * points[c + 2] - ray[2]
        first = _sure_sign(x, y, z, ax, ay, az, bx, by, bz, 0.0, slack)
        second = _sure_sign(x, y, z, bx, by, bz, cx, cy, cz, 0.0, slack)
        if first * second < 0:
            continue
        third = _sure_sign(x, y, z, cx, cy, cz, ax, ay, az, 0.0, slack)
        if first * third < 0 or second * third < 0:
            continue
        side = _sure_sign(ax, ay, az, bx, by, bz, cx, cy, cz, slack, slack)
        if first * second * third == 0 or side == 0:
            unsure[count] = f
            count += 1
        elif side == first:
            winding += first
    total[0] = winding
    return count
