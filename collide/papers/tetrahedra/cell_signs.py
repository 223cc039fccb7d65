"""Whether two tetrahedra share inner points, by signs of determinants: heights over planes, and pairs of edges.

Interiors of two bodies are disjoint exactly where 0 is not inside their Minkowski difference, whose facets have the
normals of a facet of either or of two edges, one of each. So 44 planes decide. Here they are tried in doubles with
error bounds, and, where corners are doubles, exactly: a bound is a share of the determinant's terms, so a corner that
both cells have makes terms and bound exactly 0, and most cells that touch are told apart without exact arithmetic.

Cells stand as twelve doubles, four corners, positively oriented: corner 3 sees corners 0, 1, 2 counter-clockwise.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.numerics.orientation import one_of_four, sign_of_rows, write_difference
from collide.numerics.vec3 import Vec3, absolute, cross, dot, equal_at, norm1, sub, vec3_at

#: Doubles of a cell's corners; of the heights of four corners over four planes, and of their bounds behind them.
CELL, HEIGHTS = 12, 16
#: Of the sum of a determinant's terms: differences, products and sums in doubles, as in `numerics/orientation.py`.
ERROR = 2.0**-49
#: Where nothing says that products of differences cannot underflow; coordinates are at most 1.
SLACK = 2.0**-900
#: Two ends of a part of an edge are told apart from this on; they are good to a few units in the last place.
_LEAST_SHARE = 1e-12


@kernel(inline=True)
def face_corner(face, k):
    """Corner k of face number ``face``, opposite to corner number ``face``; counter-clockwise seen from the opposite
    corner.

    The plane through corners a, b, c, with rows b − a, c − a, x − a, is then positive on the cell's side.
    """
    if k == 0:
        return one_of_four(face, 1, 0, 0, 0)
    if k == 1:
        return one_of_four(face, 3, 2, 3, 1)
    return one_of_four(face, 2, 3, 1, 2)


@kernel(inline=True)
def edge_corner(edge, k):
    """Corner k of the six edges: the first two are its ends, the last two those of the opposite edge."""
    pair = edge if k < 2 else 5 - edge
    if (k & 1) == 0:
        return 0 if pair < 3 else (1 if pair < 5 else 2)
    return one_of_four(pair, 1, 2, 3, 2) if pair < 4 else 3


@kernel(inline=True)
def bound_of(size, a, b, c, error):
    """Of a determinant in doubles: ``size`` the sum of its terms, a, b, c the sums of magnitudes in its rows.

    error : of a coordinate; 0 where the doubles are the corners.
    """
    bound = ERROR * size
    if error > 0.0:
        bound += lost_by_corners(a, b, c, error)
    return bound


@kernel(inline=True)
def lost_by_corners(a, b, c, error):
    """Bound of a determinant's change by errors of corners, a, b, c being the sums of magnitudes in its rows.

    Components of rows are off by at most e = 2 error. A single row changes the determinant by at most e times the
    product of the others' sums; two or three rows by less than the 9e added to each row here.
    """
    e = 2.0 * error
    a += 9.0 * e
    b += 9.0 * e
    c += 9.0 * e
    return 1.001 * e * (a * b + b * c + c * a) + SLACK


@kernel
def write_heights(work, planes, corners, out, error):
    """Heights of a cell's corners over the other's faces, times twice the face's area: row j those over face j.

    out : HEIGHTS values, positive on the cell's side; HEIGHTS bounds of their errors. error : of a coordinate; 0 where
        the doubles are the corners.
    """
    for face in range(4):
        a = planes + 3 * face_corner(face, 0)
        b = planes + 3 * face_corner(face, 1)
        c = planes + 3 * face_corner(face, 2)
        origin = vec3_at(work, a)
        u = sub(vec3_at(work, b), origin)
        v = sub(vec3_at(work, c), origin)
        n = cross(u, v)
        terms = Vec3(
            abs(u.y * v.z) + abs(u.z * v.y), abs(u.z * v.x) + abs(u.x * v.z), abs(u.x * v.y) + abs(u.y * v.x)
        )
        u1 = norm1(u)
        v1 = norm1(v)
        for k in range(4):
            x = corners + 3 * k
            w = sub(vec3_at(work, x), origin)
            height = dot(n, w)
            bound = bound_of(dot(terms, absolute(w)), u1, v1, norm1(w), error)
            is_shared = equal_at(work, x, a) or equal_at(work, x, b) or equal_at(work, x, c)
            if is_shared and error == 0.0:
                height = 0.0
                bound = 0.0
            out_at = out + 4 * face + k
            work[out_at] = height
            work[out_at + HEIGHTS] = bound


@kernel
def face_parts(work, heights):
    """Whether a face is proven to have all corners of the other cell on its outer side, or in its plane."""
    for face in range(4):
        n = 0
        for k in range(heights + 4 * face, heights + 4 * face + 4):
            if work[k] <= -work[k + HEIGHTS]:
                n += 1
        if n == 4:
            return True
    return False


@kernel
def edge_enters(work, heights):
    """Whether an edge of the cell whose corners have these heights is proven to have a point inside the other.

    Along an edge a height less its bound is at least what its ends, less the larger bound, say.
    """
    for edge in range(6):
        first = heights + edge_corner(edge, 0)
        second = heights + edge_corner(edge, 1)
        low = 0.0
        high = 1.0
        for face in range(0, 16, 4):
            bound = max(work[first + face + HEIGHTS], work[second + face + HEIGHTS])
            s = work[first + face] - bound
            t = work[second + face] - bound
            if s <= 0.0 and t <= 0.0:
                high = -1.0
            elif s <= 0.0:
                low = max(low, s / (s - t))
            elif t <= 0.0:
                high = min(high, s / (s - t))
        if high - low > _LEAST_SHARE:
            return True
    return False


@kernel
def face_parts_exactly(work, digits, planes, corners, heights):
    """As `face_parts`, for cells whose corners are doubles, whatever their rounding."""
    for face in range(4):
        n = 0
        for k in range(4):
            at = heights + 4 * face + k
            if work[at] > work[at + HEIGHTS]:
                break
            if work[at] > -work[at + HEIGHTS]:
                a = planes + 3 * face_corner(face, 0)
                write_difference(work, a, planes + 3 * face_corner(face, 1), digits, 0)
                write_difference(work, a, planes + 3 * face_corner(face, 2), digits, 1)
                write_difference(work, a, corners + 3 * k, digits, 2)
                if sign_of_rows(digits) > 0:
                    break
            n += 1
        if n == 4:
            return True
    return False


@kernel
def edges_part(work, digits, A, B, error, exactly):
    """Whether a plane along an edge of A and an edge of B is proven to separate A from B.

    Touching is allowed. ``exactly`` : for cells whose corners are doubles, whatever their rounding.
    """
    for edge_a in range(6):
        for edge_b in range(6):
            if _pair_parts(work, digits, A, edge_a, B, edge_b, error, exactly):
                return True
    return False


@kernel
def _pair_parts(work, digits, A, edge_a, B, edge_b, error, exactly):
    a = A + 3 * edge_corner(edge_a, 0)
    b = B + 3 * edge_corner(edge_b, 0)
    end_a = A + 3 * edge_corner(edge_a, 1)
    end_b = B + 3 * edge_corner(edge_b, 1)
    e = sub(vec3_at(work, end_a), vec3_at(work, a))
    f = sub(vec3_at(work, end_b), vec3_at(work, b))
    n = cross(e, f)
    terms = Vec3(abs(e.y * f.z) + abs(e.z * f.y), abs(e.z * f.x) + abs(e.x * f.z), abs(e.x * f.y) + abs(e.y * f.x))
    # The sign of A's side, if any, strict for at least a corner: else the edges are parallel.
    side = 0
    for k in range(5):
        if k < 2:
            base = a
            tip = A + 3 * edge_corner(edge_a, 2 + k)
        elif k < 4:
            base = b
            tip = B + 3 * edge_corner(edge_b, k)
        else:
            base = a
            tip = b
        w = sub(vec3_at(work, tip), vec3_at(work, base))
        height = dot(n, w)
        bound = bound_of(dot(terms, absolute(w)), norm1(e), norm1(f), norm1(w), error)
        sign = 0
        if height > bound:
            sign = 1
        elif height < -bound:
            sign = -1
        elif bound > 0.0:
            if not exactly:
                return False
            write_difference(work, a, end_a, digits, 0)
            write_difference(work, b, end_b, digits, 1)
            write_difference(work, base, tip, digits, 2)
            sign = sign_of_rows(digits)
        if k < 2:
            if sign * side < 0:
                return False
            if sign != 0:
                side = sign
        elif sign * side > 0:
            return False
        if k == 1 and side == 0:
            return False
    return True
