"""Kernels that make a support tree: neighbours in cyclic order, and the candidates of coarse vertices.

Let W be a set of points in convex position and V a subset. In direction g the extreme point of V may be
v, that of W is w: then w has to stand in the list of v. That is so for some g exactly if the normal cone
of w in the hull of W meets the normal cone of v in the hull of V. Cones are convex and the fine cone of v
lies in its coarse cone, so a path inside the coarse cone of v, from a point it shares with the cone of w
to the fine cone of v, leaves the cone of w through an arc: the directions between the normals of two
facets that share an edge of w. It is therefore enough to find, for every edge of the fine hull, the
vertices of V that are extreme somewhere along its arc. No coarse hull is intersected with anything.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.support.support_tree_query import walk

#: Arcs are followed between points this fraction inside their ends. At the ends themselves, which are facet
#: normals, many coarse vertices may tie (those around the cap of a prism, say), and only the arc tells which
#: of them are extreme for directions of any extent.
_INSET = 2.0**-20
#: Facets whose unit normals differ less are taken for one: the arc between them is nothing but rounding.
SAME_NORMAL = 1e-12
#: Directions asked about along one arc, at most. What is left out then costs a climbing step in queries.
_LONGEST_ARC = 4096
#: Intervals of one arc that may wait to be looked at.
STACK = 512


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def order_rings(
    points_at, n, facets_at, n_facets, starts_at, ring_at, ring_facets_at, following_at, place_at, normals_at
):
    """Fill starts (n + 1), ring and ring_facets (3·n_facets) and unit normals (n_facets, 3).

    Ring place i of a vertex holds neighbour i and the facet between neighbours i and i + 1. Returns 0; 1 where
    two facets have the same directed edge, as both sides of a flat hull may; 2 where the surface is not closed
    or a vertex joins several sheets. place (n) ends as the number of edges at a vertex whose facets have
    different normals: fewer than 3 make no corner. following (6·n_facets) is room to work in. O(n_facets).
    """
    points = view_f64(points_at, 3 * n)
    facets = view_i32(facets_at, 3 * n_facets)
    starts = view_i32(starts_at, n + 1)
    ring = view_i32(ring_at, 3 * n_facets)
    ring_facets = view_i32(ring_facets_at, 3 * n_facets)
    following = view_i32(following_at, 6 * n_facets)
    place = view_i32(place_at, n)
    normals = view_f64(normals_at, 3 * n_facets)
    for i in range(n + 1):
        starts[i] = 0
    for i in range(3 * n_facets):
        starts[facets[i] + 1] += 1
    for i in range(n):
        starts[i + 1] += starts[i]
        place[i] = starts[i]
    for facet in range(n_facets):
        _unit_normal(points, facets, facet, normals)
        for k in range(3):
            vertex = facets[3 * facet + k]
            slot = place[vertex]
            place[vertex] += 1
            ring[slot] = facets[3 * facet + (k + 1) % 3]
            following[2 * slot] = facets[3 * facet + (k + 2) % 3]
            following[2 * slot + 1] = facet
    for i in range(n):
        place[i] = -1
    for vertex in range(n):
        status = _order_ring(starts[vertex], starts[vertex + 1], ring, ring_facets, following, place)
        if status != 0:
            return status
    for vertex in range(n):
        place[vertex] = _bends(normals, ring_facets, starts[vertex], starts[vertex + 1])
    return 0


@kernel
def _bends(normals, ring_facets, begin, end):
    """How many edges of a ring have facets of different normals on their sides."""
    bends = 0
    for k in range(begin, end):
        p = 3 * ring_facets[k - 1 if k > begin else end - 1]
        q = 3 * ring_facets[k]
        if _differ(normals[p] - normals[q], normals[p + 1] - normals[q + 1], normals[p + 2] - normals[q + 2]):
            bends += 1
    return bends


@kernel
def _differ(x, y, z):
    return max(abs(x), abs(y), abs(z)) > SAME_NORMAL


@kernel
def _order_ring(begin, end, ring, ring_facets, following, place):
    """Bring one ring into cyclic order; ``place`` finds the slot of a neighbour."""
    for slot in range(begin, end):
        neighbour = ring[slot]
        if begin <= place[neighbour] < end:
            return 1
        place[neighbour] = slot
    slot = begin
    for i in range(begin, end):
        if not begin <= slot < end or (slot == begin and i > begin):
            return 2
        # The slot's own neighbour is what the slot before it says follows: ``ring`` may be overwritten.
        follower = following[2 * slot]
        ring_facets[i] = following[2 * slot + 1]
        slot = place[follower]
        ring[i] = follower
    if end > begin and slot != begin:
        return 2
    # What was written is one place late: turn it back.
    if end > begin:
        last = ring[end - 1]
        for i in range(end - 1, begin, -1):
            ring[i] = ring[i - 1]
        ring[begin] = last
    return 0


@kernel
def _unit_normal(points, facets, facet, normals):
    """Outward unit normal, or 0 where rounding leaves nothing of it."""
    a = 3 * facets[3 * facet]
    b = 3 * facets[3 * facet + 1]
    c = 3 * facets[3 * facet + 2]
    ux = points[b] - points[a]
    uy = points[b + 1] - points[a + 1]
    uz = points[b + 2] - points[a + 2]
    vx = points[c] - points[a]
    vy = points[c + 1] - points[a + 1]
    vz = points[c + 2] - points[a + 2]
    _store_unit(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx, normals, 3 * facet)


@kernel
def _store_unit(x, y, z, out, at):
    largest = max(abs(x), abs(y), abs(z))
    length = 0.0
    if largest > 0.0:
        x /= largest
        y /= largest
        z /= largest
        length = math.sqrt(x * x + y * y + z * z)
    out[at] = x / length if length > 0.0 else 0.0
    out[at + 1] = y / length if length > 0.0 else 0.0
    out[at + 2] = z / length if length > 0.0 else 0.0


@entry(
    "int64(int64, int64, int64, int64, int64, int64, int64, int64, int64,"
    " int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)"
)
def candidate_lists(
    points_at, n, fine_at, n_fine, starts_at, ring_at, ring_facets_at, normals_at, n_facets,
    nodes_at, entries_at, coordinates_at, n_nodes, depth, coarse_at, n_coarse, first_node,
    pairs_at, capacity, list_starts_at, room_at,
):  # fmt: skip
    """Candidate lists of ``n_coarse`` vertices among ``n_fine`` ones; returns how many pairs were met.

    fine : rows of the fine vertices; rings and facet normals as `order_rings` gives them, which may know more
    vertices: those are no candidates.
    nodes, entries, coordinates, depth : the tree so far; ``depth`` scans end at node first_node + i for
    coarse vertex i, row coarse[i].
    pairs : room for ``capacity`` pairs of integers. Where more are met nothing is made: call again with more.
    list_starts : (n_coarse + 1), out; the rows of list i end up at pairs[list_starts[i] : list_starts[i + 1]].
    room : doubles to work in, n + capacity + 2·STACK of them.
    """  # fmt: skip
    points = view_f64(points_at, 3 * n)
    fine = view_i32(fine_at, n_fine)
    starts = view_i32(starts_at, n + 1)
    ring = view_i32(ring_at, starts[n])
    ring_facets = view_i32(ring_facets_at, starts[n])
    normals = view_f64(normals_at, 3 * n_facets)
    nodes = view_i32(nodes_at, n_nodes + 1)
    entries = view_i32(entries_at, nodes[n_nodes])
    coordinates = view_f64(coordinates_at, 3 * nodes[n_nodes])
    coarse = view_i32(coarse_at, n_coarse)
    pairs = view_i32(pairs_at, 2 * capacity)
    stack = view_f64(room_at, 2 * STACK)
    stamp = view_i32(room_at + 16 * STACK, n)
    known = view_i32(room_at + 16 * STACK + 4 * n, n)
    rows = view_i32(room_at + 16 * STACK + 8 * n, 2 * capacity)
    list_starts = view_i32(list_starts_at, n_coarse + 1)
    size = _sizes(points, fine, n_fine)
    for i in range(n):
        stamp[i] = -1
        known[i] = 0
    for j in range(n_fine):
        known[fine[j]] = 1
    # A coarse vertex is a candidate of its own.
    found = 0
    for i in range(n_coarse):
        found = _note(pairs, found, capacity, stamp, i, coarse[i])
    for j in range(n_fine):
        a = fine[j]
        begin = starts[a]
        end = starts[a + 1]
        for k in range(begin, end):
            b = ring[k]
            if a < b or known[b] == 0:
                before = ring_facets[k - 1 if k > begin else end - 1]
                found = _follow_edge(
                    points, a, b, known[b] != 0, normals, 3 * before, 3 * ring_facets[k], nodes, entries, coordinates, depth,
                    coarse, first_node, size, stack, stamp, pairs, found, capacity,
                )  # fmt: skip
    if found <= capacity:
        _sort_pairs(pairs, found, n, n_coarse, list_starts, stamp, rows)
    return found


@kernel
def _sizes(points, fine, n_fine):
    """Largest coordinate in size along each axis."""
    x = 0.0
    y = 0.0
    z = 0.0
    for j in range(n_fine):
        at = 3 * fine[j]
        x = max(x, abs(points[at]))
        y = max(y, abs(points[at + 1]))
        z = max(z, abs(points[at + 2]))
    return x, y, z


@kernel
def _note(pairs, found, capacity, stamp, owner, row):
    """Note a candidate; a repetition right after another is left out."""
    if stamp[row] == owner:
        return found
    stamp[row] = owner
    if found < capacity:
        pairs[2 * found] = owner
        pairs[2 * found + 1] = row
    return found + 1


@kernel
def _follow_edge(
    points, a, b, both, normals, p, q, nodes, entries, coordinates, depth, coarse, first_node, size, stack, stamp, pairs, found,
    capacity,
):  # fmt: skip
    """Follow the arc of one edge a → b, from the facet on its right, whose normal is at p, to that on its left."""
    px = normals[p]
    py = normals[p + 1]
    pz = normals[p + 2]
    qx = normals[q]
    qy = normals[q + 1]
    qz = normals[q + 2]
    if px * px + py * py + pz * pz == 0.0 or qx * qx + qy * qy + qz * qz == 0.0:
        return found
    pieces = 1
    mx = qx
    my = qy
    mz = qz
    if px * qx + py * qy + pz * qz <= 0.0:
        # An arc of 90° and more, up to the 180° of a flat hull's border: through the outward normal.
        ex = points[3 * b] - points[3 * a]
        ey = points[3 * b + 1] - points[3 * a + 1]
        ez = points[3 * b + 2] - points[3 * a + 2]
        dx = qx - px
        dy = qy - py
        dz = qz - pz
        _store_unit(ey * dz - ez * dy, ez * dx - ex * dz, ex * dy - ey * dx, stack, 0)
        mx = stack[0]
        my = stack[1]
        mz = stack[2]
        pieces = 2
    for piece in range(pieces):
        if piece == 1:
            px = mx
            py = my
            pz = mz
            mx = qx
            my = qy
            mz = qz
        if _differ(mx - px, my - py, mz - pz):
            found = _follow_arc(
                points, a, b, both, px, py, pz, mx - px, my - py, mz - pz, nodes, entries, coordinates, depth,
                coarse, first_node, size, stack, stamp, pairs, found, capacity,
            )  # fmt: skip
    return found


@kernel
def _follow_arc(
    points, a, b, both, px, py, pz, dx, dy, dz, nodes, entries, coordinates, depth, coarse, first_node, size, stack, stamp, pairs,
    found, capacity,
):  # fmt: skip
    """Note a, and b if ``both``, as candidates of every coarse vertex that is extreme along p + t·d, 0 < t < 1.

    Between two directions with different owners both are equally far in one direction: who is farthest
    there either is one of them, and nobody comes between, or splits the interval in two.
    """
    none = view_i64(0, 0)
    # Point 0 of the loop asks at the end of the arc, point 1 at its start, later ones where two owners tie.
    waiting = 0
    t = 1.0 - _INSET
    t_low = 0.0
    low = -1
    t_high = 0.0
    high = -1
    step = 0
    while step < _LONGEST_ARC:
        gx = px + t * dx
        gy = py + t * dy
        gz = pz + t * dz
        node, x, y, z, _ = walk(nodes, entries, coordinates, 0, depth, gx, gy, gz, none)
        owner = node - first_node
        new = True
        if step >= 2:
            v = 3 * coarse[low]
            gain = (x - points[v]) * gx + (y - points[v + 1]) * gy + (z - points[v + 2]) * gz
            noise = 1e-15 * (size[0] * abs(gx) + size[1] * abs(gy) + size[2] * abs(gz))
            new = owner != low and owner != high and gain > noise
        if new:
            found = _note(pairs, found, capacity, stamp, owner, a)
            if both:
                found = _note(pairs, found, capacity, stamp, owner, b)
        if step == 0:
            t_high = t
            high = owner
            t = _INSET
            step = 1
            continue
        step += 1
        if step == 2:
            t_low = t
            low = owner
        elif new:
            if waiting < STACK:
                stack[2 * waiting] = t_high
                stack[2 * waiting + 1] = float(high)
                waiting += 1
            t_high = t
            high = owner
        else:
            # Nobody between low and high: on to the interval that waits behind.
            t_low = t_high
            low = high
            if waiting == 0:
                return found
            waiting -= 1
            t_high = stack[2 * waiting]
            high = int(stack[2 * waiting + 1])
        if low == high:  # the whole arc; ends of later intervals differ
            return found
        t = _crossing(points, coarse[low], coarse[high], px, py, pz, dx, dy, dz)
        t = min(max(t, t_low), t_high)
    return found


@kernel
def _crossing(points, a, b, px, py, pz, dx, dy, dz):
    """The t where p + t·d is as far along a as along b."""
    x = points[3 * a] - points[3 * b]
    y = points[3 * a + 1] - points[3 * b + 1]
    z = points[3 * a + 2] - points[3 * b + 2]
    rate = x * dx + y * dy + z * dz
    ahead = x * px + y * py + z * pz
    return -ahead / rate if rate != 0.0 else 0.5


@kernel
def _sort_pairs(pairs, found, n, n_coarse, list_starts, stamp, rows):
    """Group the rows by owner, each row once; the owners' lists replace the pairs."""
    for i in range(n_coarse + 1):
        list_starts[i] = 0
    for k in range(found):
        list_starts[pairs[2 * k] + 1] += 1
    for i in range(n_coarse):
        list_starts[i + 1] += list_starts[i]
    for k in range(found):
        owner = pairs[2 * k]
        rows[list_starts[owner]] = pairs[2 * k + 1]
        list_starts[owner] += 1
    for i in range(n):
        stamp[i] = -1
    total = 0
    begin = 0
    for i in range(n_coarse):
        end = list_starts[i]
        list_starts[i] = total
        for k in range(begin, end):
            row = rows[k]
            if stamp[row] != i:
                stamp[row] = i
                pairs[total] = row
                total += 1
        begin = end
    list_starts[n_coarse] = total
