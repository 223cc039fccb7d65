"""Vertices under poses, and piercing points of edges in facets, as the nearest doubles: in double-doubles, with an
error bound that proves most of them.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.numerics import double_double as dd
from collide.numerics.error_free import DD, two_product, two_sum

#: Three products and three sums in two doubles each are off by less than this share of their terms.
_TAIL = 2.0**-98
#: More than what underflows in any of it.
_UNDERFLOW = 2.0**-1060
#: Sizes whose third powers, and what is lost of them, doubles hold.
_LEAST, _LARGEST = 2.0**-240, 2.0**240


@kernel
def _coordinate(X, row, x, at):
    """(row · x + shift as a double-double, a bound of its error): 0 where nothing was rounded."""
    total = X[row + 3]
    tail = 0.0
    size = abs(total)
    exact = True
    for j in range(3):
        product = two_product(X[row + j], x[at + j])
        s = two_sum(total, product.high)
        rest = two_sum(s.low, product.low)
        t = two_sum(tail, rest.high)
        # A product that vanishes, or nearly so, tells of itself nothing exact.
        exact = exact and rest.low == 0.0 and t.low == 0.0
        exact = exact and (abs(product.high) > 2.0**-900 or X[row + j] == 0.0 or x[at + j] == 0.0)
        total = s.high
        tail = t.high
        size += abs(product.high)
    return two_sum(total, tail), 0.0 if exact else _TAIL * size + _UNDERFLOW


@kernel
def _vertex(poses, local, body_of, v):
    """(vertex v in W as a `DDVec3`, a bound of the errors of its coordinates)."""
    X = 16 * body_of[v]
    x, error_x = _coordinate(poses, X, local, 3 * v)
    y, error_y = _coordinate(poses, X + 4, local, 3 * v)
    z, error_z = _coordinate(poses, X + 8, local, 3 * v)
    return dd.DDVec3(x, y, z), max(error_x, error_y, error_z)


@kernel
def _is_nearest(a, error):
    """Whether all numbers within ``error`` of a double-double round to its high part."""
    return a.high + (a.low + error) == a.high and a.high + (a.low - error) == a.high


@kernel
def _put(places, off, proven, k, p, errors):
    """A point and whether its high parts are the nearest doubles.   errors : of its coordinates, three."""
    places[3 * k] = p.x.high
    places[3 * k + 1] = p.y.high
    places[3 * k + 2] = p.z.high
    x = abs(p.x.low) + errors[0]
    y = abs(p.y.low) + errors[1]
    z = abs(p.z.low) + errors[2]
    off[k] = math.sqrt(x * x + y * y + z * z) * (1.0 + 2.0**-40)
    nearest = _is_nearest(p.x, errors[0]) and _is_nearest(p.y, errors[1]) and _is_nearest(p.z, errors[2])
    proven[k] = 1 if nearest else 0


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def round_vertices(poses_at, n_bodies, local_at, body_of_at, n_vertices, rows_at, n, places_at, off_at, proven_at):
    """Vertices of bodies under their poses.   rows : (n,) int64 of them.   places, off, proven : out, per row."""
    poses = view_f64(poses_at, 16 * n_bodies)
    local = view_f64(local_at, 3 * n_vertices)
    body_of = view_i64(body_of_at, n_vertices)
    rows = view_i64(rows_at, n)
    places = view_f64(places_at, 3 * n)
    off = view_f64(off_at, n)
    proven = view_u8(proven_at, n)
    for k in range(n):
        v = rows[k]
        X = 16 * body_of[v]
        x, error_x = _coordinate(poses, X, local, 3 * v)
        y, error_y = _coordinate(poses, X + 4, local, 3 * v)
        z, error_z = _coordinate(poses, X + 8, local, 3 * v)
        _put(places, off, proven, k, dd.DDVec3(x, y, z), (error_x, error_y, error_z))


@kernel
def _largest(a):
    return max(abs(a.x.high), abs(a.y.high), abs(a.z.high))


@kernel
def _size(a):
    """|a| of a double-double."""
    return DD(-a.high, -a.low) if a.high < 0.0 else a


@kernel
def _through(a, b, error_ab, p, q, r, error_pqr):
    """(where the segment from a to b goes through the facet p, q, r, bounds of the errors, whether these are proven).

    With all coordinates off by E, differences of them are by δ = 4E, normals n of edges below L by δ_n = 8Lδ + 2⁻⁹⁸L²,
    heights n · w of ends not farther than F by 8 (L² δ + F δ_n) + 2⁻⁹⁶ L² F, and the share of the edge below the facet
    by four times that over the sum of both.
    """
    error = max(error_ab, error_pqr)
    u = dd.sub_vec3(q, p)
    v = dd.sub_vec3(r, p)
    of_a = dd.sub_vec3(a, p)
    of_b = dd.sub_vec3(b, p)
    normal = dd.cross(u, v)
    height_a = dd.inner(normal, of_a)
    height_b = dd.inner(normal, of_b)
    L = max(_largest(u), _largest(v))
    F = max(L, _largest(of_a), _largest(of_b))
    delta = 4.0 * error + 2.0**-103 * F
    if not (_LEAST < L and F < _LARGEST and delta < L and height_a.high * height_b.high < 0.0):
        return a, (0.0, 0.0, 0.0), False
    of_normal = 8.0 * L * delta + 2.0**-98 * L * L
    of_height = 8.0 * (L * L * delta + F * of_normal) + 2.0**-96 * L * L * F
    above = _size(height_a)
    below = _size(height_b)
    if not (above.high > 4.0 * of_height and below.high > 4.0 * of_height):
        return a, (0.0, 0.0, 0.0), False
    total = dd.add(above, below)
    share = dd.div(above, total)
    of_share = 4.0 * of_height / total.high + 2.0**-97
    d = dd.sub_vec3(b, a)
    x = dd.add(a.x, dd.mul(share, d.x))
    y = dd.add(a.y, dd.mul(share, d.y))
    z = dd.add(a.z, dd.mul(share, d.z))
    error_x = 4.0 * error + 2.0 * abs(d.x.high) * of_share + 2.0**-98 * abs(a.x.high)
    error_y = 4.0 * error + 2.0 * abs(d.y.high) * of_share + 2.0**-98 * abs(a.y.high)
    error_z = 4.0 * error + 2.0 * abs(d.z.high) * of_share + 2.0**-98 * abs(a.z.high)
    return dd.DDVec3(x, y, z), (error_x, error_y, error_z), True


@kernel
def _piercing(poses, local, body_of, vertices, at):
    """Where an edge goes through a facet, as of `_through`.   vertices : both ends, and the three corners, from ``at``
    on.
    """
    a, error_a = _vertex(poses, local, body_of, vertices[at])
    b, error_b = _vertex(poses, local, body_of, vertices[at + 1])
    p, q, r, error = _facet(poses, local, body_of, vertices, at + 2)
    return _through(a, b, max(error_a, error_b), p, q, r, error)


@kernel
def _facet(poses, local, body_of, vertices, at):
    """(three corners, a bound of the errors of their coordinates)."""
    p, error_p = _vertex(poses, local, body_of, vertices[at])
    q, error_q = _vertex(poses, local, body_of, vertices[at + 1])
    r, error_r = _vertex(poses, local, body_of, vertices[at + 2])
    return p, q, r, max(error_p, error_q, error_r)


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def round_piercings(poses_at, n_bodies, local_at, body_of_at, n_vertices, vertices_at, n, places_at, off_at, proven_at):
    """Where edges go through facets.   vertices : (n, 5) int64, both ends of the edge and three corners of the facet.
    """
    poses = view_f64(poses_at, 16 * n_bodies)
    local = view_f64(local_at, 3 * n_vertices)
    body_of = view_i64(body_of_at, n_vertices)
    vertices = view_i64(vertices_at, 5 * n)
    places = view_f64(places_at, 3 * n)
    off = view_f64(off_at, n)
    proven = view_u8(proven_at, n)
    for k in range(n):
        point, errors, is_proven = _piercing(poses, local, body_of, vertices, 5 * k)
        proven[k] = 0
        off[k] = 0.0
        if is_proven:
            _put(places, off, proven, k, point, errors)


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def round_crossings(poses_at, n_bodies, local_at, body_of_at, n_vertices, vertices_at, n, places_at, off_at, proven_at):
    """Where segments go through facets.   vertices : (n, 13) int64, five of each end as of `round_piercings`, and three
    corners.
    """
    poses = view_f64(poses_at, 16 * n_bodies)
    local = view_f64(local_at, 3 * n_vertices)
    body_of = view_i64(body_of_at, n_vertices)
    vertices = view_i64(vertices_at, 13 * n)
    places = view_f64(places_at, 3 * n)
    off = view_f64(off_at, n)
    proven = view_u8(proven_at, n)
    for k in range(n):
        proven[k] = 0
        off[k] = 0.0
        a, errors_a, a_is_proven = _piercing(poses, local, body_of, vertices, 13 * k)
        b, errors_b, b_is_proven = _piercing(poses, local, body_of, vertices, 13 * k + 5)
        if not (a_is_proven and b_is_proven):
            continue
        error = max(errors_a[0], errors_a[1], errors_a[2], errors_b[0], errors_b[1], errors_b[2])
        p, q, r, error_pqr = _facet(poses, local, body_of, vertices, 13 * k + 10)
        point, errors, is_proven = _through(a, b, error, p, q, r, error_pqr)
        if is_proven:
            _put(places, off, proven, k, point, errors)
