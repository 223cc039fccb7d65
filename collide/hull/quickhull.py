"""The hull of a cloud in space by quickhull, with exact tests (Barber, Dobkin, Huhdanpaa 1996).

Every point still outside stands in the list of a facet strictly below the point. A facet's farthest point becomes a
corner: the facets strictly below this corner are removed, and a fan from the corner to their rim is put in their place.
Why this is right with exact tests, coplanar points or not:

* the removed region is connected and its rim is a simple cycle. Each edge of the rim belongs to a
  removed facet, so the new corner is not in line with the edge: no facet of the fan has zero area;
* a facet coplanar with the new corner stays. Flat sides stand as triangles and are never made
  anew as a whole, so a side with 32,768 corners is cheap;
* a point q of a removed facet F lies strictly above a facet of the fan, or is not outside. Take the segment to q from
  inside F, a start inside the new hull, F being strictly below the new corner. If q is outside, the
  segment leaves the hull at a point above F, so not through an old facet but through a facet of the fan, and q lies
  strictly above this facet.

So the points dropped are proven to lie in the hull, and at the end no point lies above any facet. Distances in doubles
only choose the next corner.
"""

from __future__ import annotations

import numpy as np

from collide.hull.box_corners import BOX_FACETS, are_box_corners, put_box_hull
from collide.hull.first_simplex import APICES, first_simplex
from collide.hull.growing_hull import (
    ACROSS,
    CORNERS,
    CURSOR,
    FACET,
    FIRST,
    FREE,
    LAST,
    NOW,
    PLANE,
    POINT,
    ROUND,
    STATE,
    TESTS,
    USED,
    GrowingHull,
    above,
    free_facet,
    make_facet,
    put,
)
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.numerics.orientation import DIGITS, WORK, CloudView, orientation, survey

#: Fans of more facets than this are searched by halving; at least 4, since the first four facets are no fan.
WIDE_FAN = 48
#: Tests per point after which corners are no longer chosen by distance. Ordinary clouds need 10 to 50.
BUDGET = 100


@kernel
def distribute(hull, n_orphans, k):
    """Put each orphan into the list of a facet of the fan of k it lies strictly above; the others are in the hull."""
    owner, fan, state = hull.owner, hull.fan, hull.state
    t = 0
    for n in range(n_orphans):
        i = np.int64(hull.orphans[n])
        owner[i] = -1
        tries = k
        if k > WIDE_FAN:
            t, certain = locate(hull, k, i)
            if certain:
                tries = 1
        for _ in range(tries):
            state[TESTS] += 1
            f = np.int64(fan[t])
            over, distance = above(hull, f, i)
            if over:
                put(hull, f, i, distance)
                owner[i] = f
                break  # the next orphan is tried here first: it stood in the same list
            t += 1
            if t == k:
                t = 0


@kernel
def locate(hull, k, i):
    """(place in the fan, whether certain): point i, if above any facet of the fan, is above the facet at this place.

    The half-planes from the line through the fan's apex and a corner of its rim to the other corners turn through at
    most half a circle. A point before the first half-plane is above the first facet, a point after the last above the
    last. For a point strictly between two consecutive half-planes, the facet between them is the only facet bounding
    the cone of the fan there. A point in the plane of the first or the last is tried from another corner; where three
    corners do not settle the place, no facet is certain.
    """
    facets, fan = hull.facets, hull.fan
    apex = np.int64(facets[FACET * fan[0] + 2])
    start = 0
    low = 0
    for _ in range(3):
        first = np.int64(facets[FACET * fan[start]])
        low = 0
        high = k
        place = 1
        while high - low > 1:
            hull.state[TESTS] += 1
            corner = np.int64(facets[FACET * fan[(start + place) % k]])
            sign = orientation(hull.cloud, apex, first, corner, i, -1)
            if sign == 0 and (low == 0 or high == k):
                break
            if sign <= 0:
                low = place
            else:
                high = place
            place = k - 1 if high == k else (low + high) // 2
        if high - low == 1:
            return (start + low) % k, True
        start += k // 3
    return low, False


@kernel
def visible_region(hull, f, i):
    """(number of facets strictly below point i, number of edges of their rim), spreading from facet f, itself below i.

    rim : each edge as the facet across and the edge's place in this facet.
    """
    facets, state, region, rim = hull.facets, hull.state, hull.region, hull.rim
    state[NOW] += 1
    now = state[NOW]
    region[0] = f
    facets[FACET * f + ROUND] = now
    n_visible = 1
    edges = 0
    k = 0
    while k < n_visible:
        at = FACET * region[k]
        k += 1
        for e in range(3):
            g = np.int64(facets[at + ACROSS + e])
            stamp = facets[FACET * g + ROUND]
            if stamp != now and stamp != -now:
                state[TESTS] += 1
                over, _ = above(hull, g, i)
                stamp = now if over else -now
                facets[FACET * g + ROUND] = stamp
                if over:
                    region[n_visible] = g
                    n_visible += 1
            if stamp == -now:
                place = 0
                while facets[FACET * g + place] != facets[at + (e + 1) % 3]:
                    place += 1
                rim[2 * edges] = g
                rim[2 * edges + 1] = place
                edges += 1
    return n_visible, edges


@kernel
def gather(hull, n_visible, corner):
    """All points in the lists of the region's facets but ``corner`` become orphans; returns how many."""
    n_gathered = 0
    for k in range(n_visible):
        i = hull.facets[FACET * hull.region[k] + POINT]
        while i >= 0:
            if i != corner:
                hull.orphans[n_gathered] = i
                n_gathered += 1
            i = hull.following[i]
    return n_gathered


@kernel
def shuffle(order, count):
    """All points in an order that has nothing to do with the cloud (Fisher and Yates; a congruential generator)."""
    for i in range(count):
        order[i] = i
    mixed = 1
    for i in range(count - 1, 0, -1):
        mixed = (mixed * 1103515245 + 12345) & 0x7FFFFFFF
        j = ((mixed >> 3) * (i + 1)) >> 28
        order[i], order[j] = order[j], order[i]


@kernel
def next_corner(hull, count):
    """(facet, point above the facet) to go on with; facet −1 where no point is left.

    The farthest point of the facet longest in the queue. Crowded clouds can make this choice wrong again and again;
    after too many tests, points are taken in a shuffled order, for which the expected number of facets made is below 6
    per corner whatever the cloud.
    """
    order, owner, state = hull.order, hull.owner, hull.state
    if state[TESTS] <= BUDGET * count:
        f = state[FIRST]
        return f, np.int64(hull.facets[FACET * f + POINT]) if f >= 0 else -1
    if state[CURSOR] < 0:
        shuffle(order, count)
        state[CURSOR] = 0
    while state[CURSOR] < count:
        i = np.int64(order[state[CURSOR]])
        state[CURSOR] += 1
        if owner[i] >= 0:
            return np.int64(owner[i]), i
    return -1, -1


@kernel
def build_fan(hull, i, edges):
    """Facets from every edge of the rim to point i, in its order; False where it is no simple cycle."""
    facets, rim, fan, starting = hull.facets, hull.rim, hull.fan, hull.starting
    for k in range(edges):
        g = rim[2 * k]
        place = rim[2 * k + 1]
        a = np.int64(facets[FACET * g + (place + 1) % 3])
        b = np.int64(facets[FACET * g + place])
        f = make_facet(hull, a, b, i)
        facets[FACET * f + ACROSS] = g
        facets[FACET * g + ACROSS + place] = f
        fan[k] = f
        starting[a] = f
    for k in range(edges):
        f = fan[k]
        g = starting[facets[FACET * f + 1]]
        if g < 0:
            return False
        facets[FACET * f + ACROSS + 1] = g
        facets[FACET * g + ACROSS + 2] = f
    for k in range(edges):
        a = facets[FACET * fan[k]]
        if starting[a] != fan[k]:
            return False
        starting[a] = -1
    for k in range(1, edges):
        fan[k] = facets[FACET * fan[k - 1] + ACROSS + 1]
    return True


@kernel
def first_facets(hull, corners):
    """The four facets of the first simplex, as a fan."""
    facets, fan = hull.facets, hull.fan
    a, b, c, d = corners[0], corners[1], corners[2], corners[3]
    fan[0] = make_facet(hull, a, b, c)
    fan[1] = make_facet(hull, a, d, b)
    fan[2] = make_facet(hull, b, d, c)
    fan[3] = make_facet(hull, c, d, a)
    for k in range(3):
        facets[ACROSS + k] = k + 1
        at = FACET * (k + 1) + ACROSS
        facets[at] = (k + 2) % 3 + 1
        facets[at + 1] = (k + 1) % 3 + 1
        facets[at + 2] = 0


@kernel
def write_surface(hull, count, surface):
    """The facets of points of the cloud, and their corners marked; their number."""
    facets, marks = hull.facets, hull.starting
    n_facets = 0
    for f in range(hull.state[USED]):
        at = FACET * f
        if facets[at] < 0 or max(facets[at], facets[at + 1], facets[at + 2]) >= count:
            continue
        for k in range(3):
            surface[3 * n_facets + k] = facets[at + k]
            marks[facets[at + k]] = 1
        n_facets += 1
    return n_facets


@kernel
def begin(hull, count, corners):
    """The first simplex stands, all other points are orphans; returns how many."""
    starting, state = hull.starting, hull.state
    n_orphans = 0
    for i in range(count):
        starting[i] = -1
        hull.owner[i] = -1
        if i != corners[0] and i != corners[1] and i != corners[2] and i != corners[3]:
            hull.orphans[n_orphans] = i
            n_orphans += 1
    for k in range(count, count + APICES):
        starting[k] = -1
    for k in range(CORNERS):
        state[k] = -1 if k == FREE or k == FIRST or k == LAST or k == CURSOR else 0
    first_facets(hull, corners)
    return n_orphans


@kernel
def grow(hull, count, n_orphans):
    """Add corners until no point is outside; False where the rim of a region is no simple cycle."""
    edges = 4
    while True:
        distribute(hull, n_orphans, edges)
        f, i = next_corner(hull, count)
        if f < 0:
            return True
        n_visible, edges = visible_region(hull, f, i)
        n_orphans = gather(hull, n_visible, i)
        hull.owner[i] = -1
        for k in range(n_visible):
            free_facet(hull, np.int64(hull.region[k]))
        if not build_fan(hull, i, edges):
            return False


#: Bytes that `grow_hull` works in, of each point and besides. A header; doubles: the points, the points scaled, WORK,
#: planes; integers: digits, the state; 32-bit integers: facets, eleven rows of one a point, and the surface, six.
HULL_EACH = 8 * (3 + 3 + 2 * PLANE) + 4 * (2 * FACET + 10 + 6)
HULL_FIXED = APICES * HULL_EACH + 8 * (4 + WORK + DIGITS + STATE)
#: Integers of the header: how many facets and vertices, and where their rows stand.
N_FACETS, N_VERTICES, FACETS_AT, VERTICES_AT = range(4)


@kernel
def grow_hull(points_at, count, memory_at):
    """The dimension of a cloud of points (count, 3); −1: the rim of a region was no simple cycle, a case excluded by
    exact tests.

    memory : HULL_EACH·count + HULL_FIXED bytes. Its header holds where facets (f, 3) begin, both sides of a flat cloud,
    and where the vertices begin, in order, two of a segment, a single vertex of a point; 32-bit integers, rows of the
    points.
    """
    capacity = count + APICES
    header = view_i64(memory_at, 4)
    originals_at = memory_at + 32
    scaled_at = originals_at + 24 * capacity
    work_at = scaled_at + 24 * capacity
    planes_at = work_at + 8 * WORK
    digits_at = planes_at + 16 * PLANE * capacity
    state_at = digits_at + 8 * DIGITS
    facets_at = state_at + 8 * STATE
    at = facets_at + 8 * FACET * capacity
    row = 4 * capacity
    vertices, surface = view_i32(at + 8 * row, capacity), view_i32(at + 10 * row, 6 * capacity)
    header[FACETS_AT] = at + 10 * row
    header[VERTICES_AT] = at + 8 * row
    if are_box_corners(points_at, count):
        put_box_hull(vertices, surface)
        header[N_FACETS] = BOX_FACETS
        header[N_VERTICES] = count
        return 3
    header[N_FACETS] = 0
    header[N_VERTICES] = 0
    cloud_points = view_f64(points_at, 3 * count)
    originals, scaled = view_f64(originals_at, 3 * capacity), view_f64(scaled_at, 3 * capacity)
    work = view_f64(work_at, WORK)
    for k in range(3 * count):
        originals[k] = cloud_points[k]
    exponent = np.int64(survey(originals, scaled, count, work))
    cloud = CloudView(scaled, originals, work, view_i64(digits_at, DIGITS), 0, exponent)
    hull = GrowingHull(
        cloud, view_i32(facets_at, 2 * FACET * capacity), view_f64(planes_at, 2 * PLANE * capacity),
        view_i64(state_at, STATE), view_i32(at, capacity), view_i32(at + row, capacity),
        view_i32(at + 2 * row, capacity), view_i32(at + 3 * row, 2 * capacity),
        view_i32(at + 5 * row, 2 * capacity), view_i32(at + 7 * row, capacity),
        view_i32(at + 8 * row, capacity), view_i32(at + 9 * row, capacity),
    )
    corners = view_i64(state_at + 8 * CORNERS, 4)
    dimension = first_simplex(cloud, count, corners)
    if dimension >= 2 and not grow(hull, count, begin(hull, count, corners)):
        return -1
    for k in range(capacity):
        vertices[k] = 0
    if dimension >= 2:
        header[N_FACETS] = write_surface(hull, count, surface)
    else:
        vertices[corners[0]] = 1
        vertices[corners[1]] = 1
    if dimension == 2:
        half = header[N_FACETS]
        for k in range(3 * half):
            surface[3 * half + k] = surface[k - k % 3 + (2 - k % 3)]
        header[N_FACETS] = 2 * half
    n_vertices = 0
    for k in range(count):
        if vertices[k] == 1:
            vertices[n_vertices] = k
            n_vertices += 1
    header[N_VERTICES] = n_vertices
    return dimension


@entry("int64(int64, int64, int64)")
def quickhull(points_at, count, memory_at):
    """`grow_hull`, for callers outside kernels."""
    return grow_hull(points_at, count, memory_at)
