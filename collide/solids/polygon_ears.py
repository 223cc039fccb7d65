"""Parts of facets between paths, from step to step around each, as triangles: ears that doubles prove to be ears."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.narrowphase.facets.facet_crossings import corner_error, posed_corner
from collide.numerics.vec3 import Vec3, component, cross, sub

#: Parts with more corners are left to the sweep.
MAX_CORNERS = 40
#: Doubles: of each corner two coordinates and its id, and room for one more.
WORKSPACE = 3 * (MAX_CORNERS + 1)
_U = 2.0**-53


@kernel
def posed_facet(poses, X, local, a, b, c):
    """(corners a, b, c of a facet in W, rounded, a bound of the errors of their coordinates).   X : as of
    `posed_corner`."""
    off = max(corner_error(poses, X, local, a), corner_error(poses, X, local, b))
    p, q, r = posed_corner(poses, X, local, a), posed_corner(poses, X, local, b), posed_corner(poses, X, local, c)
    return p, q, r, max(off, corner_error(poses, X, local, c))


@kernel
def front_axes(p, q, r):
    """(u, v): the coordinates in which a facet is seen largest, turning counter-clockwise from its front."""
    normal = cross(sub(q, p), sub(r, p))
    axis = 0
    for k in range(1, 3):
        if abs(component(normal, k)) > abs(component(normal, axis)):
            axis = k
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return (u, v) if component(normal, axis) > 0.0 else (v, u)


@kernel
def _look_at(facet, ids, m, place, n_vertices, u, v, seen):
    """The points of a polygon seen along an axis, from the facet's first corner; how large the coordinates are.

    facet : its three ids, and where these are.   seen : out, m pairs of coordinates.
    """
    a, b, _, p, q, r = facet
    largest = 0.0
    for k in range(m):
        point = int(ids[k])
        if point >= n_vertices:
            row = 3 * (point - n_vertices)
            x = Vec3(place[row], place[row + 1], place[row + 2])
        else:
            x = p if point == a else (q if point == b else r)
        w = sub(x, p)
        seen[2 * k] = component(w, u)
        seen[2 * k + 1] = component(w, v)
        largest = max(largest, abs(w.x), abs(w.y), abs(w.z))
    return largest


@kernel
def _area(seen, a, b, c):
    e = seen[2 * b] - seen[2 * a]
    f = seen[2 * b + 1] - seen[2 * a + 1]
    g = seen[2 * c] - seen[2 * a]
    h = seen[2 * c + 1] - seen[2 * a + 1]
    return e * h - f * g


@kernel
def _square(seen, a, b):
    e = seen[2 * b] - seen[2 * a]
    f = seen[2 * b + 1] - seen[2 * a + 1]
    return e * e + f * f


@kernel
def _is_empty(seen, m, i, j, k, limit):
    """Whether all other points are proven to be outside the triangle of three."""
    for p in range(m):
        if (
            p != i and p != j and p != k
            and not (
                _area(seen, i, j, p) < -limit or _area(seen, j, k, p) < -limit or _area(seen, k, i, p) < -limit
            )
        ):
            return False
    return True


@kernel
def _best_ear(seen, m, limit):
    """The roundest proven ear, −1 without a proven ear."""
    best, roundest = -1, 0.0
    for j in range(m):
        i = (j + m - 1) % m
        k = (j + 1) % m
        area = _area(seen, i, j, k)
        if not area > limit:
            continue
        roundness = area / (_square(seen, i, j) + _square(seen, j, k) + _square(seen, k, i))
        if roundness > roundest and _is_empty(seen, m, i, j, k, limit):
            best, roundest = j, roundness
    return best


@kernel
def area_limit(size, error):
    """A bound of the errors of twice the areas of points whose coordinates differ by ``size`` at most.

    Differences are off by 2E + 2u of themselves: determinants by 4 D (2 E + 2 u D) and 4 u D².
    """
    return 16.0 * size * (error + 2.0 * _U * size) + 1e-300


@kernel
def clip_polygon(ids, m, seen, error, triangles, count):
    """Append the triangles of a polygon; returns the number of triangles after, −1 where an ear is not proven."""
    size = 0.0
    for k in range(m):
        size = max(size, abs(seen[2 * k] - seen[0]), abs(seen[2 * k + 1] - seen[1]))
    limit = area_limit(2.0 * size, error)
    while m > 2:
        j = _best_ear(seen, m, limit)
        if j < 0:
            return -1
        triangles[3 * count] = ids[(j + m - 1) % m]
        triangles[3 * count + 1] = ids[j]
        triangles[3 * count + 2] = ids[(j + 1) % m]
        count += 1
        m -= 1
        for k in range(j, m):
            ids[k] = ids[k + 1]
            seen[2 * k] = seen[2 * k + 2]
            seen[2 * k + 1] = seen[2 * k + 3]
    return count


@kernel
def _walk_around(following, points, rows, seen_step, head, ids):
    """The corners of the part from a step on; returns their number, 0 where the walk around the part does not close."""
    m = 0
    step = head
    while True:
        if m == MAX_CORNERS or rows[step] != rows[head] or seen_step[step] != 0:
            return 0
        ids[m] = points[step]
        seen_step[step] = 1
        m += 1
        step = following[step]
        if step == head:
            return m


@entry(
    "int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, "
    "int64, int64, int64, int64, int64)"
)
def clip_parts(
    poses_at, n_bodies, local_at, n_vertices, corners_at, body_at, n_facets, place_at, error_at, n_points, following_at,
    points_at, rows_at, n, n_border, seen_at, failed_at, triangles_at, owners_at, workspace_at,
):
    """The number of triangles made, triangles of failed facets included.

    poses, local, corners, body : of `PlacedFacets`.   place, error : of points other than vertices, in W.
    following : (n,) from each step the next around the same part; the first ``n_border`` are along borders.
    points, rows : (n,) where a step starts, and its facet.   seen : (n,) uint8, 0 at first.
    failed : (F,) uint8, set for facets with a ring of cuts, too many corners or no proven ear.
    triangles, owners : out, (n, 3) ids of points and (n,) facets.   workspace : WORKSPACE doubles.
    """
    poses = view_f64(poses_at, 16 * n_bodies)
    local = view_f64(local_at, 3 * n_vertices)
    corners = view_i64(corners_at, 3 * n_facets)
    body = view_i64(body_at, n_facets)
    place = view_f64(place_at, 3 * n_points)
    error = view_f64(error_at, n_points)
    following = view_i64(following_at, n)
    points = view_i64(points_at, n)
    rows = view_i64(rows_at, n)
    seen_step = view_u8(seen_at, n)
    failed = view_u8(failed_at, n_facets)
    triangles = view_i64(triangles_at, 3 * n)
    owners = view_i64(owners_at, n)
    seen = view_f64(workspace_at, 2 * (MAX_CORNERS + 1))
    ids = view_i64(workspace_at + 16 * (MAX_CORNERS + 1), MAX_CORNERS + 1)
    count = 0
    for head in range(n_border):
        f = rows[head]
        if seen_step[head] != 0 or failed[f] != 0:
            continue
        m = _walk_around(following, points, rows, seen_step, head, ids)
        if m < 3:
            failed[f] = 1
            continue
        X = 16 * body[f]
        a, b, c = int(corners[3 * f]), int(corners[3 * f + 1]), int(corners[3 * f + 2])
        p, q, r, off = posed_facet(poses, X, local, a, b, c)
        bound = off
        for k in range(m):
            if ids[k] >= n_vertices:
                bound = max(bound, error[ids[k] - n_vertices])
        u, v = front_axes(p, q, r)
        largest = _look_at((a, b, c, p, q, r), ids, m, place, n_vertices, u, v, seen)
        made = clip_polygon(ids, m, seen, bound + off + _U * largest, triangles, count)
        if made < 0:
            failed[f] = 1
            continue
        for k in range(count, made):
            owners[k] = f
        count = made
    for step in range(n_border, n):
        if seen_step[step] == 0:
            failed[rows[step]] = 1
    return count
