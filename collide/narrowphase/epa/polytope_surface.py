"""The growing polytope of EPA: a closed, oriented surface of triangles over points of A ⊖ B.

A facet is a slot: three vertices and the three half-edges across its own. Expanding takes a patch of facets out and
puts a cone over the patch's border in, into the same slots and two new ones, so all slots up to the number of
facets are in use.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.bounds import EPA_FACETS, EPA_VERTICES
from collide.narrowphase.gjk.minkowski_difference import POINT, copy_point

#: Doubles a facet's plane: unit normal, and the least of its corners along it.
PLANE = 4
#: Integers a facet: vertices 0 … 2 and vertex 0 again, half-edges across 0→1, 1→2, 2→0, marks. The half-edge that
#: begins at corner e of facet f is the number FACET·f + e: its origin stands there, its end next to it, and the
#: half-edge across TWIN places on.
FACET, TWIN, MARKS = 8, 4, 7
#: Marks: the facet is seen from the apex; the origin lies behind it wherever its corners truly are.
SEEN, SURE = 1, 2
#: Vertices stand in this many points; the last ones are for trying.
POINTS = EPA_VERTICES + 8
#: Rounding of the determinant of three corners, in units of |a|·|b − a|·|c − a| as sums of coordinates: eight roundings
#: in a row, doubled.
DETERMINANT_ERROR = 16 * 2.0**-53
#: Most edges of a border.
WIDEST_BORDER = 512
#: Above every number of a vertex, facet or half-edge.
_NUMBERS = (1 << 16) - 1

#: Doubles and integers of workspace one run needs (see `workspace`).
DOUBLES = (POINT + 6) * POINTS + (PLANE + 4) * EPA_FACETS
INTEGERS = 3 * POINTS + (FACET + 1) * EPA_FACETS + 2 * EPA_VERTICES + 2 * WIDEST_BORDER


@kernel(inline=True)
def number(stored):
    """A vertex, facet or half-edge as it is stored. The mask changes nothing but what the compiler knows: an index that
    may be negative is compared and replaced at every access."""
    return stored & _NUMBERS


@kernel(inline=True)
def workspace(doubles_at, integers_at):
    """Views: points, planes, reaches, clearances | ids, facets, starts, border, patch.

    reaches : distance of each facet's plane from the origin, ∞ where it is farther than a known way out.
    clearances : proven distance of each facet from the origin, seen from its inner side, or −1.
    starts : by vertex, the new facet whose base begins there, and the apex it was made for.
    """
    at = doubles_at
    points = view_f64(at, POINT * POINTS)
    at += 8 * POINT * POINTS
    planes = view_f64(at, PLANE * EPA_FACETS)
    at += 8 * PLANE * EPA_FACETS
    reaches = view_f64(at, EPA_FACETS)
    at += 8 * EPA_FACETS
    clearances = view_f64(at, EPA_FACETS)
    at = integers_at
    ids = view_i64(at, 2 * POINTS)
    at += 8 * 2 * POINTS
    facets = view_i64(at, FACET * EPA_FACETS)
    at += 8 * FACET * EPA_FACETS
    starts = view_i64(at, 2 * EPA_VERTICES)
    at += 8 * 2 * EPA_VERTICES
    border = view_i64(at, 2 * WIDEST_BORDER)
    at += 8 * 2 * WIDEST_BORDER
    patch = view_i64(at, EPA_FACETS)
    return points, planes, reaches, clearances, ids, facets, starts, border, patch


@kernel(inline=True)
def fine_workspace(doubles_at, integers_at):
    """Views for `refine_depth.py`: fine points, fine distances (two doubles a facet) | whether a vertex's point is there."""
    at = doubles_at + 8 * (POINT * POINTS + (PLANE + 2) * EPA_FACETS)
    fine = view_f64(at, 6 * POINTS)
    distances = view_f64(at + 8 * 6 * POINTS, 2 * EPA_FACETS)
    at = integers_at + 8 * (2 * POINTS + (FACET + 1) * EPA_FACETS + 2 * EPA_VERTICES + 2 * WIDEST_BORDER)
    return fine, distances, view_i64(at, POINTS)


@kernel(inline=True)
def ample(size, error):
    """A determinant of three points of A ⊖ B above this is clear of rounding, and of ``error``, whatever their triangle.

    Coordinates of a point add up to √3·size at most, those of an edge to twice that: the bounds of `_sides` for such.
    """
    return 128.0 * error * size * size


@kernel(inline=True)
def _sides(determinant, ax, ay, az, ex, ey, ez, fx, fy, fz, error):
    """(behind, sure) of `plane_of`, from the lengths of this very triangle."""
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    a = abs(ax) + abs(ay) + abs(az)
    return determinant > DETERMINANT_ERROR * a * e * f, determinant > 2.0 * error * (e * f + 2.0 * a * (e + f))


@kernel(inline=True)
def plane_of(ax, ay, az, bx, by, bz, cx, cy, cz, error, enough):
    """(nx, ny, nz, distance, clearance, sure) of a triangle, counter-clockwise from outside; n = 0 where it has no area.

    enough : `ample`, which nearly all triangles are beyond, or ∞.
    distance : the least of the corners' along the unit normal: for any unit normal, however badly a thin triangle
        defines it, no point of the triangle lies nearer the origin.
    clearance : the same where the origin provably lies behind the triangle of the corners as they stand, else −1.
    sure : whether it would with corners anywhere within ``error`` of these (see `simplex._height_behind`).
    """
    ex = bx - ax
    ey = by - ay
    ez = bz - az
    fx = cx - ax
    fy = cy - ay
    fz = cz - az
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    square = nx * nx + ny * ny + nz * nz
    determinant = nx * ax + ny * ay + nz * az
    behind = True
    sure = True
    if not determinant > enough:
        if square == 0.0:
            return 0.0, 0.0, 0.0, math.inf, -1.0, False
        behind, sure = _sides(determinant, ax, ay, az, ex, ey, ez, fx, fy, fz, error)
    shorten = 1.0 / math.sqrt(square)
    nx *= shorten
    ny *= shorten
    nz *= shorten
    distance = nx * ax + ny * ay + nz * az
    distance = min(distance, nx * bx + ny * by + nz * bz)
    distance = min(distance, nx * cx + ny * cy + nz * cz)
    return nx, ny, nz, distance, distance if behind else -1.0, sure


@kernel(inline=True)
def set_facet(surface, f, i, j, k, error, enough, depth):
    """Slot f becomes the facet on vertices i, j, k, counter-clockwise from outside; returns its reach.

    Eight at a time in vectors took longer than one by one: corners have to be gathered, and what is stored singly
    is slow to load together.
    """
    points, planes, reaches, clearances, _, facets, _, _, _ = surface
    f = number(f)
    a = POINT * number(i)
    b = POINT * number(j)
    c = POINT * number(k)
    nx, ny, nz, distance, clearance, sure = plane_of(
        points[a], points[a + 1], points[a + 2], points[b], points[b + 1], points[b + 2],
        points[c], points[c + 1], points[c + 2], error, enough,
    )  # fmt: skip
    at = FACET * f
    facets[at] = i
    facets[at + 1] = j
    facets[at + 2] = k
    facets[at + 3] = i
    facets[at + MARKS] = SURE if sure else 0
    at = PLANE * f
    planes[at] = nx
    planes[at + 1] = ny
    planes[at + 2] = nz
    planes[at + 3] = distance
    # A facet farther off than a known way out will never be the nearest.
    reach = distance if distance <= depth else math.inf
    reaches[f] = reach
    clearances[f] = clearance
    return reach


@kernel
def set_tetrahedron(surface, error, enough):
    """The first four facets, outwards, over points 0 … 3, with their neighbours."""
    points, _, reaches, clearances, ids, facets, starts, _, _ = surface
    ex = points[POINT] - points[0]
    ey = points[POINT + 1] - points[1]
    ez = points[POINT + 2] - points[2]
    fx = points[2 * POINT] - points[0]
    fy = points[2 * POINT + 1] - points[1]
    fz = points[2 * POINT + 2] - points[2]
    gx = points[3 * POINT] - points[0]
    gy = points[3 * POINT + 1] - points[1]
    gz = points[3 * POINT + 2] - points[2]
    if gx * (ey * fz - ez * fy) + gy * (ez * fx - ex * fz) + gz * (ex * fy - ey * fx) > 0.0:
        # Vertex 3 must lie behind facet 0, 1, 2.
        copy_point(points, ids, 1, EPA_VERTICES)
        copy_point(points, ids, 2, 1)
        copy_point(points, ids, EPA_VERTICES, 2)
    for f in range(4):  # (0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)
        i = 0 if f < 2 else f - 1
        j = 1 if f == 0 else 3
        k = 2 if f == 0 or f == 2 else (1 if f == 1 else 0)
        set_facet(surface, f, i, j, k, error, enough, math.inf)
        starts[2 * f + 1] = -1
        reaches[f + 4] = math.inf
        clearances[f + 4] = math.inf
    join(facets, 0, FACET + 2)
    join(facets, 1, 2 * FACET + 2)
    join(facets, 2, 3 * FACET + 2)
    join(facets, FACET, 3 * FACET + 1)
    join(facets, FACET + 1, 2 * FACET)
    join(facets, 2 * FACET + 1, 3 * FACET)


@kernel(inline=True)
def join(facets, s, t):
    """Two half-edges lie across from one another."""
    facets[s + TWIN] = t
    facets[t + TWIN] = s


@kernel(inline=True)
def following(t):
    """The next half-edge of the same facet."""
    return t - 2 if t % FACET == 2 else t + 1


@kernel(inline=True)
def find_patch(surface, f, apex, slack):
    """(facets, border edges) of what the apex sees, spreading from f over shared edges; marks it as seen.

    ``border`` gets the half-edges of facets that stay, ``patch`` the facets, whose reach becomes ∞. No branch depends
    on what is seen: a mispredicted one costs more than an edge.
    """
    points, planes, reaches, _, _, facets, _, border, patch = surface
    at = POINT * number(apex)
    x = points[at]
    y = points[at + 1]
    z = points[at + 2]
    facets[FACET * f + MARKS] |= SEEN
    patch[0] = f
    found = 1
    visited = 0
    edges = 0
    while visited < found:
        g = number(patch[visited])
        reaches[g] = math.inf
        first = FACET * g + TWIN
        visited += 1
        margin = slack if found < WIDEST_BORDER - 4 else math.inf
        for e in range(3):
            t = number(facets[first + e])
            h = t // FACET
            marks = facets[FACET * h + MARKS]
            at = PLANE * h
            height = planes[at] * x + planes[at + 1] * y + planes[at + 2] * z
            fresh = 1 - (marks & SEEN)
            seen = fresh if height > planes[at + 3] + margin else 0
            facets[FACET * h + MARKS] = marks | seen
            patch[number(found)] = h
            found += seen
            border[number(edges)] = t
            edges += fresh - seen
    return found, edges


@kernel(inline=True)
def expand(surface, f, apex, count, found, edges, depth, error, enough):
    """Replace the patch that the apex sees by a cone to it; returns (number of facets, nearest of patch and cone, its reach).

    Where the patch is no disc, as rounding may have it, the facet f alone is replaced.
    """
    _, planes, reaches, clearances, _, facets, starts, border, patch = surface
    nearest = EPA_FACETS
    least_reach = math.inf
    for k in range(edges):
        start = number(facets[number(border[k]) + 1])
        if starts[2 * start + 1] == apex:
            edges = 0  # pinched: the border passes a vertex twice
            break
        starts[2 * start] = patch[k] if k < found else count + k - found
        starts[2 * start + 1] = apex
    if edges == 0:
        for k in range(1, found):
            h = number(patch[k])
            facets[FACET * h + MARKS] &= SURE
            distance = planes[PLANE * h + 3]
            reaches[h] = distance if distance <= depth else math.inf
            if reaches[h] < least_reach:
                least_reach = reaches[h]
                nearest = h
        found = 1
        edges = 3
        for e in range(3):
            t = number(facets[FACET * f + TWIN + e])
            border[e] = t
            starts[2 * number(facets[t + 1])] = f if e == 0 else count + e - 1
    for k in range(edges):
        t = number(border[k])
        end = number(facets[t])
        start = number(facets[t + 1])
        new = number(starts[2 * start])
        patch[k] = new
        reach = set_facet(surface, new, start, end, apex, error, enough, depth)
        nearer = reach < least_reach
        least_reach = reach if nearer else least_reach
        nearest = new if nearer else nearest
        join(facets, FACET * new, t)
        join(facets, FACET * new + 1, FACET * number(starts[2 * end]) + 2)
    for k in range(edges, found):  # slots of a patch around several vertices: given up
        h = number(patch[k])
        reaches[h] = math.inf
        clearances[h] = math.inf
        planes[PLANE * h + 3] = math.inf
    return count + max(edges - found, 0), nearest, least_reach


@kernel
def flip(surface, f, e, error):
    """Exchange the diagonal of facet f and its neighbour across edge e: two facets with the same border."""
    _, _, _, _, _, facets, _, _, _ = surface
    s = FACET * f + e
    t = facets[s + TWIN]
    h = t // FACET
    across_qr = facets[following(s) + TWIN]
    across_rp = facets[following(following(s)) + TWIN]
    across_pv = facets[following(t) + TWIN]
    across_vq = facets[following(following(t)) + TWIN]
    p = facets[s]
    q = facets[s + 1]
    r = facets[following(s) + 1]
    v = facets[following(t) + 1]
    set_facet(surface, f, p, v, r, error, math.inf, math.inf)
    set_facet(surface, h, v, q, r, error, math.inf, math.inf)
    join(facets, FACET * f, across_pv)
    join(facets, FACET * f + 1, FACET * h + 2)
    join(facets, FACET * f + 2, across_rp)
    join(facets, FACET * h, across_vq)
    join(facets, FACET * h + 1, across_qr)


@kernel(inline=True)
def has_room(vertices, count):
    """Whether one more expansion fits."""
    return vertices + 1 < EPA_VERTICES and count + 2 < EPA_FACETS
