"""EPA: the smallest translation that separates two overlapping cores, with a proven bracket.

van den Bergen 2001. A polytope inside A ⊖ B grows towards the facet whose plane lies nearest the
origin, until the support plane of that facet coincides with it. Three changes make it robust:

* The seed is an extremal tetrahedron, never the last simplex of GJK: from a simplex as thin as
  touching bodies leave it, a prototype took 27 wrong depths in 9,264 lattice poses.
* The seed need not contain the origin. Signed plane distances then start negative, and the same
  rule (expand the facet of least signed distance) reaches the origin.
* Where A ⊖ B has no interior the seed says so, and the depth is 0 across the flat direction.

Upper bound of the depth: the value of any support plane. Lower bound: the surface is closed and
oriented by construction (the horizon is walked over shared edges, a pinched one stops the run). If
each facet is seen from the origin on its inner side, the radial map onto the sphere has positive
degree, so every ray meets a facet, and the ball as large as the least distance lies in A ⊖ B.
"""

from __future__ import annotations

import math

from collide._jit import kernel, view_f64, view_i64
from collide.narrowphase.bounds import EPA_FACETS, EPA_VERTICES
from collide.narrowphase.minkowski import (
    POINT,
    copy_point,
    difference_point,
    has_trees,
    inlined_difference_point,
    settle_point,
)
from collide.narrowphase.simplex import face_weights

#: Doubles stored a facet: unit normal, distance of the plane, proven clearance of the origin behind it or −1.
PLANE = 5

#: Doubles and integers of workspace one run needs (see `workspace`).
DOUBLES = POINT * (EPA_VERTICES + 8) + PLANE * EPA_FACETS
INTEGERS = 2 * (EPA_VERTICES + 8) + 7 * EPA_FACETS + EPA_FACETS + 2 * EPA_VERTICES + 4 * EPA_FACETS

#: Facets kept free for one expansion, so that a run ends at its cap with its surface whole.
_WIDEST_HORIZON = 512

#: How a run ends. EXPANDED: the facet nearest the origin is final, or the cap was met. FLAT: A ⊖ B
#: has no interior as far as rounding can tell.
EXPANDED, FLAT = range(2)


@kernel
def workspace(doubles_at, integers_at):
    """Workspace: points, planes | ids, facets, heap, edge starts, stack."""
    points = view_f64(doubles_at, POINT * (EPA_VERTICES + 8))
    planes = view_f64(doubles_at + 8 * POINT * (EPA_VERTICES + 8), PLANE * EPA_FACETS)
    at = integers_at
    ids = view_i64(at, 2 * (EPA_VERTICES + 8))
    at += 8 * 2 * (EPA_VERTICES + 8)
    facets = view_i64(at, 7 * EPA_FACETS)  # vertices 0..2, neighbours 3..5, alive 6
    at += 8 * 7 * EPA_FACETS
    heap = view_i64(at, EPA_FACETS)
    at += 8 * EPA_FACETS
    starts = view_i64(at, 2 * EPA_VERTICES)  # new facet whose base starts at a vertex, and its round
    at += 8 * 2 * EPA_VERTICES
    stack = view_i64(at, 4 * EPA_FACETS)  # (facet, neighbour's edge) of the horizon; facets to visit
    return points, planes, ids, facets, heap, starts, stack


# --- the seed -----------------------------------------------------------------------------------


@kernel
def _seed(pair, points, ids, error):
    """Points 0..3 become an extremal tetrahedron; returns (rank found, n) with n across what is flat."""
    spare = EPA_VERTICES
    least = math.inf
    most = -math.inf
    # The farthest pair among extremes of the axes, by the axis of greatest width.
    for axis in range(3):
        d0 = 1.0 if axis == 0 else 0.0
        d1 = 1.0 if axis == 1 else 0.0
        d2 = 1.0 if axis == 2 else 0.0
        difference_point(pair, points, ids, spare, d0, d1, d2)
        difference_point(pair, points, ids, spare + 1, -d0, -d1, -d2)
        width = points[POINT * spare + axis] - points[POINT * (spare + 1) + axis]
        if width > most:
            most = width
            copy_point(points, ids, spare, 0)
            copy_point(points, ids, spare + 1, 1)
        least = min(least, width)
    if most <= 8.0 * error:
        return 0, 0.0, 0.0, 1.0
    ex = points[POINT] - points[0]
    ey = points[POINT + 1] - points[1]
    ez = points[POINT + 2] - points[2]
    ux, uy, uz = _across(ex, ey, ez)
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex /= length
    ey /= length
    ez /= length
    farthest = -1.0
    nx = ux
    ny = uy
    nz = uz
    for turn in range(4):
        if turn > 0:  # a quarter turn about the edge, from u to e × u and on to their opposites
            ux, uy, uz = ey * uz - ez * uy, ez * ux - ex * uz, ex * uy - ey * ux
        difference_point(pair, points, ids, spare, ux, uy, uz)
        qx = points[POINT * spare] - points[0]
        qy = points[POINT * spare + 1] - points[1]
        qz = points[POINT * spare + 2] - points[2]
        cx = ey * qz - ez * qy
        cy = ez * qx - ex * qz
        cz = ex * qy - ey * qx
        height = math.sqrt(cx * cx + cy * cy + cz * cz)
        if height > farthest:
            farthest = height
            copy_point(points, ids, spare, 2)
            nx = cx
            ny = cy
            nz = cz
    if farthest <= 8.0 * error:
        ux, uy, uz = _across(ex, ey, ez)
        return 1, ux, uy, uz
    nx /= farthest
    ny /= farthest
    nz /= farthest
    difference_point(pair, points, ids, 3, nx, ny, nz)
    difference_point(pair, points, ids, spare, -nx, -ny, -nz)
    above = _height(points, 3, nx, ny, nz)
    below = -_height(points, spare, nx, ny, nz)
    if below > above:
        copy_point(points, ids, spare, 3)
    if above <= 8.0 * error and below <= 8.0 * error:
        return 2, nx, ny, nz
    return 3, nx, ny, nz


@kernel
def _height(points, k, nx, ny, nz):
    at = POINT * k
    return (points[at] - points[0]) * nx + (points[at + 1] - points[1]) * ny + (points[at + 2] - points[2]) * nz


@kernel
def _across(x, y, z):
    """A unit vector orthogonal to (x, y, z), made from its two largest coordinates."""
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        length = math.sqrt(y * y + z * z)
        return 0.0, -z / length, y / length
    if abs(y) <= abs(z):
        length = math.sqrt(x * x + z * z)
        return z / length, 0.0, -x / length
    length = math.sqrt(x * x + y * y)
    return -y / length, x / length, 0.0


# --- facets and the heap ------------------------------------------------------------------------


@kernel(inline=True)
def _set_facet(points, planes, facets, f, i, j, k, error):
    """Facet f on vertices i, j, k, counter-clockwise from outside; its plane's signed distance.

    The distance is the least of the three vertices': for any unit normal, however badly a thin
    triangle defines it, no point of the facet lies nearer the origin. False where it has no area.
    """
    facets[7 * f] = i
    facets[7 * f + 1] = j
    facets[7 * f + 2] = k
    facets[7 * f + 6] = 1
    a = POINT * i
    b = POINT * j
    c = POINT * k
    ex = points[b] - points[a]
    ey = points[b + 1] - points[a + 1]
    ez = points[b + 2] - points[a + 2]
    fx = points[c] - points[a]
    fy = points[c + 1] - points[a + 1]
    fz = points[c + 2] - points[a + 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    square = nx * nx + ny * ny + nz * nz
    at = PLANE * f
    if square == 0.0:
        planes[at] = 0.0
        planes[at + 1] = 0.0
        planes[at + 2] = 0.0
        planes[at + 3] = math.inf
        planes[at + 4] = -1.0
        return False
    # Whether the origin is provably behind it: the bound of `simplex._height_behind`, here from what is at hand.
    edges = (abs(ex) + abs(ey) + abs(ez)) * (abs(fx) + abs(fy) + abs(fz))
    sides = abs(ex) + abs(ey) + abs(ez) + abs(fx) + abs(fy) + abs(fz)
    corner = abs(points[a]) + abs(points[a + 1]) + abs(points[a + 2])
    behind = nx * points[a] + ny * points[a + 1] + nz * points[a + 2] > 2.0 * error * (edges + 2.0 * corner * sides)
    shorten = 1.0 / math.sqrt(square)
    nx *= shorten
    ny *= shorten
    nz *= shorten
    distance = min(
        nx * points[a] + ny * points[a + 1] + nz * points[a + 2],
        nx * points[b] + ny * points[b + 1] + nz * points[b + 2],
        nx * points[c] + ny * points[c + 1] + nz * points[c + 2],
    )
    planes[at] = nx
    planes[at + 1] = ny
    planes[at + 2] = nz
    planes[at + 3] = distance
    planes[at + 4] = distance if behind else -1.0
    return True


@kernel(inline=True)
def _push(heap, size, planes, f):
    k = size
    heap[k] = f
    while k > 0:
        parent = (k - 1) // 2
        if planes[PLANE * heap[parent] + 3] <= planes[PLANE * heap[k] + 3]:
            break
        heap[parent], heap[k] = heap[k], heap[parent]
        k = parent
    return size + 1


@kernel(inline=True)
def _pop(heap, size, planes):
    top = heap[0]
    size -= 1
    heap[0] = heap[size]
    k = 0
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and planes[PLANE * heap[child + 1] + 3] < planes[PLANE * heap[child] + 3]:
            child += 1
        if planes[PLANE * heap[k] + 3] <= planes[PLANE * heap[child] + 3]:
            break
        heap[k], heap[child] = heap[child], heap[k]
        k = child
    return top, size


# --- expansion ----------------------------------------------------------------------------------


@kernel(inline=True)
def _horizon(points, planes, facets, stack, f, apex, slack):
    """Kill the facets that see the apex, spreading from f over shared edges; returns horizon edges.

    The edges stand in ``stack`` from the far end: pairs (facet that stays, its edge).
    """
    x = points[POINT * apex]
    y = points[POINT * apex + 1]
    z = points[POINT * apex + 2]
    facets[7 * f + 6] = 0
    stack[0] = f
    pending = 1
    edges = 0
    top = 4 * EPA_FACETS
    while pending > 0:
        pending -= 1
        g = stack[pending]
        for e in range(3):
            h = facets[7 * g + 3 + e]
            if facets[7 * h + 6] == 0:
                continue
            if planes[PLANE * h] * x + planes[PLANE * h + 1] * y + planes[PLANE * h + 2] * z > planes[PLANE * h + 3] + slack:
                facets[7 * h + 6] = 0
                stack[pending] = h
                pending += 1
            else:
                # The same edge, as the neighbour that stays runs through it.
                start = facets[7 * g + (e + 1) % 3]
                edge = 0
                while edge < 2 and facets[7 * h + edge] != start:
                    edge += 1
                edges += 1
                stack[top - 2 * edges] = h
                stack[top - 2 * edges + 1] = edge
    return edges


@kernel(inline=True)
def _expand(points, planes, facets, heap, size, starts, stack, f, apex, count, depth, error):
    """Replace the facets that see the apex by a cone to it; returns (heap size, facets used, sound).

    Not sound: the horizon is pinched or a new facet has no area. The surface is then not to be
    used any further.
    """
    edges = _horizon(points, planes, facets, stack, f, apex, 0.0625 * error)
    top = 4 * EPA_FACETS
    sound = count + edges <= EPA_FACETS
    if not sound:
        return size, count, False
    for k in range(1, edges + 1):
        h = stack[top - 2 * k]
        edge = stack[top - 2 * k + 1]
        start = facets[7 * h + (edge + 1) % 3]
        end = facets[7 * h + edge]
        new = count + k - 1
        if starts[2 * start + 1] == apex:
            sound = False
        starts[2 * start] = new
        starts[2 * start + 1] = apex
        sound = _set_facet(points, planes, facets, new, start, end, apex, error) and sound
        facets[7 * new + 3] = h
        facets[7 * h + 3 + edge] = new
    for k in range(edges):
        new = count + k
        end = facets[7 * new + 1]
        if starts[2 * end + 1] != apex:
            return size, count + edges, False
        following = starts[2 * end]
        facets[7 * new + 4] = following
        facets[7 * following + 5] = new
    if sound and size + edges <= EPA_FACETS:
        for k in range(edges):
            # A facet farther off than a known way out will never be the nearest.
            if planes[PLANE * (count + k) + 3] <= depth:
                size = _push(heap, size, planes, count + k)
    else:
        sound = False
    return size, count + edges, sound


@kernel(inline=True)
def _is_corner(ids, facets, f, k):
    """Whether point k is a vertex of facet f or of a neighbour, by its support vertices."""
    if ids[2 * k] < 0 or ids[2 * k + 1] < 0:
        return False
    for side in range(4):
        g = f if side == 3 else facets[7 * f + 3 + side]
        for corner in range(3):
            v = facets[7 * g + corner]
            if ids[2 * v] == ids[2 * k] and ids[2 * v + 1] == ids[2 * k + 1]:
                return True
    return False


@kernel(inline=True)
def _surface_clearance(planes, facets, count, error):
    """Least distance of a facet from the origin, or −1 unless every facet provably faces outwards."""
    least = math.inf
    for g in range(count):
        if facets[7 * g + 6] == 1:
            least = min(least, planes[PLANE * g + 4])
    return least if least > error else -1.0


@kernel
def epa(pair, simplex, simplex_ids, doubles_at, integers_at, overlap_suffices, error, tolerance):
    """Expand until the nearest facet of A ⊖ B is known.

    simplex, simplex_ids : four points of A ⊖ B around the origin to begin with, clear of rounding by far;
        or no doubles, and an extremal tetrahedron is found.
    overlap_suffices : stop once the origin is proven inside (a boolean is asked).
    error : absolute error of a bound.   tolerance : stop once the bracket is this narrow.

    Returns
    -------
    status : EXPANDED or FLAT.
    depth : least support value met: moving by it along n (plus ``error``) separates the cores;
        negative where that plane already does.
    clearance : proven least distance of the surface from the origin (before ``error``), or −1.
    nx, ny, nz : unit direction of that support plane.
    facet : its facet, −1 where FLAT; its corners are points and ids in the workspace.
    rounds : vertices added.
    """
    points, planes, ids, facets, heap, starts, stack = workspace(doubles_at, integers_at)
    rank = 3
    nx = ny = nz = 0.0
    if len(simplex) == 0:
        rank, nx, ny, nz = _seed(pair, points, ids, error)
    else:
        for k in range(4):
            for j in range(POINT):
                points[POINT * k + j] = simplex[POINT * k + j]
            ids[2 * k] = simplex_ids[2 * k]
            ids[2 * k + 1] = simplex_ids[2 * k + 1]
    if rank < 3:
        up = _extent(pair, points, ids, nx, ny, nz)
        down = _extent(pair, points, ids, -nx, -ny, -nz)
        if down < up:
            return FLAT, down, -1.0, -nx, -ny, -nz, -1, 0
        return FLAT, up, -1.0, nx, ny, nz, -1, 0
    count, size = _tetrahedron(points, planes, ids, facets, heap, error)
    for v in range(4):
        starts[2 * v + 1] = -1
    depth = math.inf
    facet = -1
    clearance = -1.0
    rounds = 0
    vertices = 4
    sound = True
    while size > 0:
        f, size = _pop(heap, size, planes)
        if facets[7 * f + 6] == 0:
            continue
        distance = planes[PLANE * f + 3]
        if overlap_suffices and distance > 2.0 * error:
            clearance = _surface_clearance(planes, facets, count, error)
            if clearance > error:
                break
        inlined_difference_point(
            pair, points, ids, vertices, planes[PLANE * f], planes[PLANE * f + 1], planes[PLANE * f + 2], False
        )
        at = POINT * vertices
        value = planes[PLANE * f] * points[at] + planes[PLANE * f + 1] * points[at + 1] + planes[PLANE * f + 2] * points[at + 2]
        if value < depth:
            depth = value
            facet = f
        if overlap_suffices and value < -error and has_trees(pair):
            settle_point(pair, points, ids, vertices, planes[PLANE * f], planes[PLANE * f + 1], planes[PLANE * f + 2])
            value = planes[PLANE * f] * points[at] + planes[PLANE * f + 1] * points[at + 1] + planes[PLANE * f + 2] * points[at + 2]
            depth = value
        if overlap_suffices and value < -error:
            return EXPANDED, depth, -1.0, planes[PLANE * facet], planes[PLANE * facet + 1], planes[PLANE * facet + 2], facet, rounds
        final = depth - distance <= tolerance or _is_corner(ids, facets, f, vertices)
        if final or vertices + 1 >= EPA_VERTICES or count + _WIDEST_HORIZON > EPA_FACETS:
            clearance = _surface_clearance(planes, facets, count, error)
            break
        starts[2 * vertices + 1] = -1
        rounds += 1
        size, count, sound = _expand(
            points, planes, facets, heap, size, starts, stack, f, vertices, count, depth, error
        )
        vertices += 1
        if not sound:
            break
    if sound and clearance < 0.0:  # no facet is left that could be nearer than the way out that is known
        clearance = _surface_clearance(planes, facets, count, error)
    nx = planes[PLANE * facet]
    ny = planes[PLANE * facet + 1]
    nz = planes[PLANE * facet + 2]
    if has_trees(pair):
        depth = _extent(pair, points, ids, nx, ny, nz)
    facet = _facet_of(
        points, planes, facets, count, facet, depth * nx, depth * ny, depth * nz, tolerance + 2.0 * error
    )
    return EXPANDED, depth, clearance, nx, ny, nz, facet, rounds


@kernel
def _facet_of(points, planes, facets, count, best, x, y, z, slack):
    """The facet that holds (x, y, z), the origin's foot on the final plane: for the witness points.

    It need not be the one that settled the depth. A face of A ⊖ B with more than three corners is
    covered by several facets; and where the bodies just touch, the foot may be a corner or lie on an
    edge of facets in other planes.
    """
    most = -math.inf
    for g in range(count):
        if facets[7 * g + 6] == 0:
            continue
        height = planes[PLANE * g] * x + planes[PLANE * g + 1] * y + planes[PLANE * g + 2] * z - planes[PLANE * g + 3]
        if abs(height) <= slack:
            w0, w1, w2 = face_weights(
                points, POINT * facets[7 * g], POINT * facets[7 * g + 1], POINT * facets[7 * g + 2], x, y, z
            )
            inside = min(w0, w1, w2)
            if inside > most:
                most = inside
                best = g
    return best


@kernel
def _extent(pair, points, ids, nx, ny, nz):
    """Support value of A ⊖ B in a unit direction, for certain."""
    k = EPA_VERTICES + 2
    difference_point(pair, points, ids, k, nx, ny, nz)
    if has_trees(pair):
        settle_point(pair, points, ids, k, nx, ny, nz)
    return points[POINT * k] * nx + points[POINT * k + 1] * ny + points[POINT * k + 2] * nz


@kernel
def _tetrahedron(points, planes, ids, facets, heap, error):
    """The first four facets, outwards, with their neighbours; returns (facets used, heap size)."""
    ex = points[POINT] - points[0]
    ey = points[POINT + 1] - points[1]
    ez = points[POINT + 2] - points[2]
    fx = points[2 * POINT] - points[0]
    fy = points[2 * POINT + 1] - points[1]
    fz = points[2 * POINT + 2] - points[2]
    if _height(points, 3, ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx) > 0.0:
        # Vertex 3 must lie behind facet 0, 1, 2.
        copy_point(points, ids, 1, EPA_VERTICES)
        copy_point(points, ids, 2, 1)
        copy_point(points, ids, EPA_VERTICES, 2)
    _set_facet(points, planes, facets, 0, 0, 1, 2, error)
    _set_facet(points, planes, facets, 1, 0, 3, 1, error)
    _set_facet(points, planes, facets, 2, 1, 3, 2, error)
    _set_facet(points, planes, facets, 3, 2, 3, 0, error)
    _set_neighbours(facets, 0, 1, 2, 3)
    _set_neighbours(facets, 1, 3, 2, 0)
    _set_neighbours(facets, 2, 1, 3, 0)
    _set_neighbours(facets, 3, 2, 1, 0)
    size = 0
    for f in range(4):
        size = _push(heap, size, planes, f)
    return 4, size


@kernel
def _set_neighbours(facets, f, across_first, across_second, across_third):
    facets[7 * f + 3] = across_first
    facets[7 * f + 4] = across_second
    facets[7 * f + 5] = across_third
