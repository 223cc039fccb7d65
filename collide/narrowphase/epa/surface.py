"""The growing polytope of EPA: a closed, oriented surface of triangles over points of A ⊖ B.

A facet is a slot: three vertices and the three slots across its edges. Expanding takes a patch of facets out and
puts a cone over the patch's border in, into the same slots and two new ones, so all slots up to the number of
facets are in use.
"""

from __future__ import annotations

import math

from collide._jit import kernel, view_f64, view_i64
from collide.narrowphase.bounds import EPA_FACETS, EPA_VERTICES
from collide.narrowphase.minkowski import POINT, copy_point

#: Doubles a facet's plane: unit normal, and the least of its corners along it.
PLANE = 4
#: Integers a facet: vertices 0 … 2, slots across the edges 0→1, 1→2, 2→0, whether it is seen from the apex, and whether
#: the origin lies behind it wherever its corners truly are.
FACET = 8
SEEN, SURE = 6, 7
#: Vertices stand in this many points; the last ones are for trying.
POINTS = EPA_VERTICES + 8
#: Rounding of the determinant of three corners, in units of |a|·|b − a|·|c − a| as sums of coordinates: eight roundings
#: in a row, doubled.
DETERMINANT_ERROR = 16 * 2.0**-53
#: Most edges of a border.
WIDEST_BORDER = 512

#: Doubles and integers of workspace one run needs (see `workspace`).
DOUBLES = (POINT + 6) * POINTS + (PLANE + 4) * EPA_FACETS
INTEGERS = 3 * POINTS + (FACET + 1) * EPA_FACETS + 2 * EPA_VERTICES + 2 * WIDEST_BORDER


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
    """Views for `refine.py`: fine points, fine distances (two doubles a facet) | whether a vertex's point is there."""
    at = doubles_at + 8 * (POINT * POINTS + (PLANE + 2) * EPA_FACETS)
    fine = view_f64(at, 6 * POINTS)
    distances = view_f64(at + 8 * 6 * POINTS, 2 * EPA_FACETS)
    at = integers_at + 8 * (2 * POINTS + (FACET + 1) * EPA_FACETS + 2 * EPA_VERTICES + 2 * WIDEST_BORDER)
    return fine, distances, view_i64(at, POINTS)


@kernel(inline=True)
def plane_of(ax, ay, az, bx, by, bz, cx, cy, cz, error):
    """(nx, ny, nz, distance, clearance, sure) of a triangle, counter-clockwise from outside; n = 0 where it has no area.

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
    if square == 0.0:
        return 0.0, 0.0, 0.0, math.inf, -1.0, False
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    a = abs(ax) + abs(ay) + abs(az)
    determinant = nx * ax + ny * ay + nz * az
    behind = determinant > DETERMINANT_ERROR * a * e * f
    sure = determinant > 2.0 * error * (e * f + 2.0 * a * (e + f))
    shorten = 1.0 / math.sqrt(square)
    nx *= shorten
    ny *= shorten
    nz *= shorten
    distance = nx * ax + ny * ay + nz * az
    distance = min(distance, nx * bx + ny * by + nz * bz)
    distance = min(distance, nx * cx + ny * cy + nz * cz)
    return nx, ny, nz, distance, distance if behind else -1.0, sure


@kernel(inline=True)
def set_facet(surface, f, i, j, k, error, depth):
    """Slot f becomes the facet on vertices i, j, k, counter-clockwise from outside.

    Eight at a time in vectors took longer than one by one: corners have to be gathered, and what is stored singly
    is slow to load together.
    """
    points, planes, reaches, clearances, _, facets, _, _, _ = surface
    a = POINT * i
    b = POINT * j
    c = POINT * k
    nx, ny, nz, distance, clearance, sure = plane_of(
        points[a], points[a + 1], points[a + 2], points[b], points[b + 1], points[b + 2],
        points[c], points[c + 1], points[c + 2], error,
    )  # fmt: skip
    facets[FACET * f] = i
    facets[FACET * f + 1] = j
    facets[FACET * f + 2] = k
    facets[FACET * f + SEEN] = 0
    facets[FACET * f + SURE] = 1 if sure else 0
    at = PLANE * f
    planes[at] = nx
    planes[at + 1] = ny
    planes[at + 2] = nz
    planes[at + 3] = distance
    # A facet farther off than a known way out will never be the nearest.
    reaches[f] = distance if distance <= depth else math.inf
    clearances[f] = clearance


@kernel
def set_tetrahedron(surface, error):
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
        set_facet(surface, f, i, j, k, error, math.inf)
        starts[2 * f + 1] = -1
        reaches[f + 4] = math.inf
        clearances[f + 4] = math.inf
    _set_neighbours(facets, 0, 1, 2, 3)
    _set_neighbours(facets, 1, 3, 2, 0)
    _set_neighbours(facets, 2, 1, 3, 0)
    _set_neighbours(facets, 3, 2, 1, 0)


@kernel(inline=True)
def _set_neighbours(facets, f, across_first, across_second, across_third):
    facets[FACET * f + 3] = across_first
    facets[FACET * f + 4] = across_second
    facets[FACET * f + 5] = across_third


@kernel(inline=True)
def edge_from(facets, f, vertex):
    """The edge of facet f that begins at one of its vertices."""
    if facets[FACET * f] == vertex:
        return 0
    return 1 if facets[FACET * f + 1] == vertex else 2


@kernel(inline=True)
def is_seen(planes, h, x, y, z, slack):
    """Whether a point lies beyond the plane of facet h by more than the slack."""
    at = PLANE * h
    return planes[at] * x + planes[at + 1] * y + planes[at + 2] * z > planes[at + 3] + slack


@kernel(inline=True)
def find_patch(surface, f, apex, slack):
    """(facets, border edges) of what the apex sees, spreading from f over shared edges; marks it as seen.

    The border stands in ``border``: pairs (facet that stays, its edge).
    """
    points, planes, _, _, _, facets, _, border, patch = surface
    x = points[POINT * apex]
    y = points[POINT * apex + 1]
    z = points[POINT * apex + 2]
    facets[FACET * f + SEEN] = 1
    patch[0] = f
    found = 1
    visited = 0
    edges = 0
    while visited < found:
        g = patch[visited]
        visited += 1
        for e in range(3):
            h = facets[FACET * g + 3 + e]
            if facets[FACET * h + SEEN] == 1:
                continue
            if is_seen(planes, h, x, y, z, slack) and found < WIDEST_BORDER - 2:
                facets[FACET * h + SEEN] = 1
                patch[found] = h
                found += 1
            else:
                # The same edge, as the neighbour that stays runs through it.
                border[2 * edges] = h
                border[2 * edges + 1] = edge_from(facets, h, facets[FACET * g + (e + 1) % 3])
                edges += 1
    return found, edges


@kernel(inline=True)
def expand(surface, f, apex, count, found, edges, depth, error):
    """Replace the patch that the apex sees by a cone to it; returns the number of facets.

    Where the patch is no disc, as rounding may have it, the facet f alone is replaced.
    """
    _, planes, reaches, clearances, _, facets, starts, border, patch = surface
    for k in range(edges):
        start = facets[FACET * border[2 * k] + (border[2 * k + 1] + 1) % 3]
        if starts[2 * start + 1] == apex:
            edges = 0  # pinched: the border passes a vertex twice
            break
        starts[2 * start + 1] = apex
    if edges == 0:
        for k in range(1, found):
            facets[FACET * patch[k] + SEEN] = 0
        for e in range(3):
            h = facets[FACET * f + 3 + e]
            border[2 * e] = h
            border[2 * e + 1] = edge_from(facets, h, facets[FACET * f + (e + 1) % 3])
        found = 1
        edges = 3
    for k in range(edges):
        h = border[2 * k]
        edge = border[2 * k + 1]
        start = facets[FACET * h + (edge + 1) % 3]
        end = facets[FACET * h + edge]
        new = patch[k] if k < found else count + k - found
        patch[k] = new
        starts[2 * start] = new
        border[2 * k] = end
        set_facet(surface, new, start, end, apex, error, depth)
        facets[FACET * new + 3] = h
        facets[FACET * h + 3 + edge] = new
    for k in range(edges):
        new = patch[k]
        following = starts[2 * border[2 * k]]
        facets[FACET * new + 4] = following
        facets[FACET * following + 5] = new
    for k in range(edges, found):  # slots of a patch around several vertices: given up
        reaches[patch[k]] = math.inf
        clearances[patch[k]] = math.inf
        planes[PLANE * patch[k] + 3] = math.inf
    return count + max(edges - found, 0)


@kernel
def flip(surface, f, e, error):
    """Exchange the diagonal of facet f and its neighbour across edge e: two facets with the same border."""
    _, _, _, _, _, facets, _, _, _ = surface
    h = facets[FACET * f + 3 + e]
    p = facets[FACET * f + e]
    q = facets[FACET * f + (e + 1) % 3]
    r = facets[FACET * f + (e + 2) % 3]
    across_qr = facets[FACET * f + 3 + (e + 1) % 3]
    across_rp = facets[FACET * f + 3 + (e + 2) % 3]
    begin = edge_from(facets, h, p)
    v = facets[FACET * h + (begin + 1) % 3]
    across_pv = facets[FACET * h + 3 + begin]
    across_vq = facets[FACET * h + 3 + (begin + 1) % 3]
    facets[FACET * across_pv + 3 + edge_from(facets, across_pv, v)] = f
    facets[FACET * across_qr + 3 + edge_from(facets, across_qr, r)] = h
    set_facet(surface, f, p, v, r, error, math.inf)
    set_facet(surface, h, v, q, r, error, math.inf)
    facets[FACET * f + 3] = across_pv
    facets[FACET * f + 4] = h
    facets[FACET * f + 5] = across_rp
    facets[FACET * h + 3] = across_vq
    facets[FACET * h + 4] = across_qr
    facets[FACET * h + 5] = f


@kernel(inline=True)
def has_room(vertices, count):
    """Whether one more expansion fits."""
    return vertices + 1 < EPA_VERTICES and count + 2 < EPA_FACETS
