"""A surface against itself: pairs of facets that share more than the corners and edges they have in common.

Corners are the same where their coordinates are. Facets with no common corner must not meet at all. Facets with a
single common corner v share more exactly if the edge opposite v of either meets the other: from v the ray through any
further common point leaves one of them first, over its edge opposite v. Facets with two common corners overlap exactly
if they lie in one plane on the same side of the common edge. Facets with three are equal. Common corners are points,
each counted once. A facet without area is the segment or the point spanned by its corners: a segment equal to an edge
of a neighbour shares nothing more, a longer segment does.

Asked with a *margin*, the walk also says which facets are steady: two steady facets share nothing more wherever all
corners are moved by no more than the margin along each axis, equal corners alike.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.mesh.box_overlap import FRAME, PROBE, boxes_meeting
from collide.mesh.bvh import EXPONENT, HAS_ORIGINS, N_FACETS, NODE, WIDTH, box_at, box_size, open_tree, origin_of
from collide.mesh.triangle import Triangle, normal_of, put_triangle, triangle_at
from collide.narrowphase.facets.exact_corners import B_LOCAL_AT, CORNERS
from collide.narrowphase.facets.exact_triangles import MEET, OVERLAP, ask_exactly
from collide.narrowphase.facets.filtered_triangles import (
    AMBIGUOUS,
    APART,
    TINY,
    meeting_in_doubles,
    orientation,
    segment_against_triangle,
    sign_error,
)
from collide.narrowphase.facets.posed_surfaces import FRAMES, PLACING
from collide.narrowphase.facets.posed_trees import MAX_FACET_PAIRS, PosedTrees, pose_trees
from collide.narrowphase.facets.probe_parts import put_floats
from collide.narrowphase.facets.traversal import OF_B, make_traversal, opens_b, pair_of_trees, push_children, word_of
from collide.numerics.vec3 import Vec3, add, cross, dot, equal_at, max_abs, put_vec3, sub, vec3_at

#: Doubles and floats of workspace: a placing, corners, and a pose that moves nothing.
DOUBLES, FLOATS = PLACING + CORNERS + 16, 2 * FRAME + PROBE
# Counters, integers: nodes compared with a box, pairs of triangles tested, of them decided exactly.
NODES, TRIANGLES, EXACT = range(3)
#: Doubles of a facet's plane: a normal (3), and the largest component of an edge, squared.
PLANE = 4
# Progress, integers: the stack's height, the facet pairs found.
TOP, N_PAIRS = range(2)
DONE, FULL = range(2)


class _Query(NamedTuple):
    """A tree as both of a pair, unmoved.

    planes : PLANE doubles a facet.   unit, slack : the unit of the boxes, and by how much facets leave them.
    margin : how far corners may be moved along each axis, 0 where that is not asked.   is_steady : out, a facet, by
    number.   pairs : out, room for ``capacity`` facet pairs.   progress, counters : as above.
    """

    trees: PosedTrees
    planes: np.ndarray
    unit: float
    slack: float
    margin: float
    is_steady: np.ndarray
    pairs: np.ndarray
    capacity: int
    progress: np.ndarray
    counters: np.ndarray


# --- facets with common corners -----------------------------------------------------------------


@kernel(inline=True)
def _common_corners(points, a, b):
    """(number of points that are corners of both facets, the last common corner's number in a, and in b)."""
    count = 0
    of_a = -1
    of_b = -1
    for j in range(3):
        if (j > 0 and equal_at(points, b, b + 3 * j)) or (j > 1 and equal_at(points, b + 3, b + 3 * j)):
            continue
        for i in range(3):
            if equal_at(points, a + 3 * i, b + 3 * j):
                count += 1
                of_a = i
                of_b = j
                break
    return count, of_a, of_b


@kernel
def _ask(query, what, a, b):
    """What the exact stage says about two triangles.   a, b : where the three corners of each stand."""
    points, corners = query.trees.A.triangles, query.trees.corners
    of_a = Triangle(vec3_at(points, a[0]), vec3_at(points, a[1]), vec3_at(points, a[2]))
    of_b = Triangle(vec3_at(points, b[0]), vec3_at(points, b[1]), vec3_at(points, b[2]))
    query.counters[EXACT] += 1
    put_triangle(corners, 0, of_a)
    put_triangle(corners, 9, of_b)
    put_triangle(corners, B_LOCAL_AT, of_b)
    return ask_exactly(query.trees.exact, what)


@kernel
def _between(query, v, p, q):
    """Whether corner v lies between corners p and q: facets without area can be so, and no others."""
    points = query.trees.A.triangles
    for axis in range(3):
        x = points[p + axis]
        y = points[q + axis]
        if points[v + axis] < min(x, y) or points[v + axis] > max(x, y):
            return False
    return _ask(query, MEET, (v, v, v), (p, q, q)) != 0


@kernel
def _opposite_meets(query, a, i, b):
    """Whether what facet a has opposite its corner i meets facet b: an edge, or less where a has no area."""
    points = query.trees.A.triangles
    v = a + 3 * i
    p = a + 3 * ((i + 1) % 3)
    q = a + 3 * ((i + 2) % 3)
    if equal_at(points, p, v):
        p = q
    if equal_at(points, q, v):
        q = p
    if equal_at(points, p, v):
        return False
    if _between(query, v, p, q):
        return _edge_meets(query, p, p, b) or _edge_meets(query, q, q, b)
    return _edge_meets(query, p, q, b)


@kernel
def _edge_meets(query, p, q, b):
    """Whether the edge between corners p and q of one facet meets facet b."""
    points = query.trees.A.triangles
    if segment_against_triangle(points, b, points, p, q, 0.0)[0] == APART:
        return False
    return _ask(query, MEET, (b, b + 3, b + 6), (p, q, q)) != 0


@kernel(inline=True)
def _certainly_one_side(points, v, face, i, facet, j):
    """Whether the corners of a facet besides its common corner j are certainly on one side of a face's plane.

    v : the common corner, corner i of the face.
    """
    common = vec3_at(points, v)
    c = sub(vec3_at(points, face + 3 * ((i + 1) % 3)), common)
    d = sub(vec3_at(points, face + 3 * ((i + 2) % 3)), common)
    p = sub(vec3_at(points, facet + 3 * ((j + 1) % 3)), common)
    q = sub(vec3_at(points, facet + 3 * ((j + 2) % 3)), common)
    n = cross(c, d)
    side_p = dot(n, p)
    side_q = dot(n, q)
    limit = sign_error(max(max_abs(c), max_abs(d), max_abs(p), max_abs(q)), 0.0)
    return (side_p > limit and side_q > limit) or (side_p < -limit and side_q < -limit)


@kernel
def _conflict(query, a, b):
    """Whether two facets, whose corners stand at a and b, share more than corners and edges."""
    points = query.trees.A.triangles
    count, i, j = _common_corners(points, a, b)
    if count == 0:
        verdict = meeting_in_doubles(points, a, points, b, 0.0)
        if verdict != AMBIGUOUS:
            return verdict != APART
        return _ask(query, MEET, (a, a + 3, a + 6), (b, b + 3, b + 6)) == 1
    if count == 1:
        if _certainly_one_side(points, a + 3 * i, b, j, a, i) or _certainly_one_side(points, a + 3 * i, a, i, b, j):
            return False
        return _opposite_meets(query, a, i, b) or _opposite_meets(query, b, j, a)
    if count == 2:
        return _conflict_at_edge(query, a, b)
    return True


@kernel
def _conflict_at_edge(query, a, b):
    """`_conflict` of facets with two corners in common."""
    points = query.trees.A.triangles
    free_a = _uncommon_corner(points, a, b)
    free_b = _uncommon_corner(points, b, a)
    if free_a < 0 or free_b < 0:
        return False  # a facet without area on an edge of the other
    x = a + 3 * free_a
    y = b + 3 * free_b
    far = 0.0
    origin = vec3_at(points, x)
    for k in range(0, 9, 3):
        far = max(far, max_abs(sub(vec3_at(points, a + k), origin)), max_abs(sub(vec3_at(points, b + k), origin)))
    v = a + 3 * ((free_a + 1) % 3)
    w = a + 3 * ((free_a + 2) % 3)
    if abs(orientation(points, v, points, w, points, x, points, y)) > sign_error(far, 0.0):
        return False
    edge_b = b + 3 * ((free_b + 1) % 3), b + 3 * ((free_b + 2) % 3), y
    if _ask(query, OVERLAP, (v, w, x), edge_b) != 0:
        return True
    for _ in range(2):  # neither has an area, and both reach beyond the same end of the common edge
        if _between(query, w, v, x) and _between(query, w, v, y):
            return True
        v, w = w, v
    return False


@kernel
def _uncommon_corner(points, a, b):
    """The corner of a that is no corner of b; −1 where all corners are common."""
    for i in range(3):
        common = False
        for j in range(3):
            common = common or equal_at(points, a + 3 * i, b + 3 * j)
        if not common:
            return i
    return -1


# --- planes: what culls nearly all neighbours ---------------------------------------------------


@kernel
def _set_planes(points, n, planes):
    """PLANE doubles a facet."""
    for facet in range(n):
        triangle = triangle_at(points, 9 * facet)
        edge = max(max_abs(sub(triangle.q, triangle.p)), max_abs(sub(triangle.r, triangle.p)))
        put_vec3(planes, PLANE * facet, normal_of(triangle))
        planes[PLANE * facet + 3] = edge * edge


@kernel(inline=True)
def _is_corner(triangle, x):
    """Whether a point is a corner. No branches: they cannot be predicted, and cost more than all of this."""
    return _coincide(triangle.p, x) | _coincide(triangle.q, x) | _coincide(triangle.r, x)


@kernel(inline=True)
def _coincide(p, q):
    return (p.x == q.x) & (p.y == q.y) & (p.z == q.z)


@kernel(inline=True)
def _off_plane(points, planes, face, facet, reach, margin):
    """Whether a facet has corners besides a face's, all certainly on one side of the face's plane.

    Then the facet meets the plane only in the common corners and the points between them. Coordinates are exact, so
    with edges up to L a side at distance w is off by 64 u L² w, as in `filtered_triangles.py`. reach : bound of all w
    along every axis, D, and of L. Corners moved by a margin ε ≤ L / 64 change edges and w by 2ε, normals by 8.2 Lε and
    sides by 3 (2L² 2ε + 8.2 Lε (D + 2ε)) < 64 εD².
    """
    of_face = triangle_at(points, 9 * face)
    facet_b = triangle_at(points, 9 * facet)
    n = vec3_at(planes, PLANE * face)
    p = dot(n, sub(facet_b.p, of_face.p))
    q = dot(n, sub(facet_b.q, of_face.p))
    r = dot(n, sub(facet_b.r, of_face.p))
    limit = planes[PLANE * face + 3] * reach * 2.0**-47 + TINY + 64.0 * margin * reach * reach
    above = (p > limit) | (q > limit) | (r > limit)
    below = (p < -limit) | (q < -limit) | (r < -limit)
    return (
        (above != below)
        & ((abs(p) > limit) | _is_corner(of_face, facet_b.p))
        & ((abs(q) > limit) | _is_corner(of_face, facet_b.q))
        & ((abs(r) > limit) | _is_corner(of_face, facet_b.r))
    )


@kernel
def _beyond_a_side(points, planes, face, facet, reach, margin):
    """Whether, seen along a face's normal, a facet's corners are certainly beyond some side of the face, or its ends.

    Facets around a vertex of a smooth surface are so. The wall on a side holds nothing of the face but the side, and of
    the facet its common corners with the side. Sides of points at distance w: 256 u L³ w. Corners moved by a margin
    ε as in `_off_plane` change the wall's normal, at most 4L³, by 25 L²ε and sides by less than 128 L²εD.
    """
    n = vec3_at(planes, PLANE * face)
    square = planes[PLANE * face + 3]
    limit = square * math.sqrt(square) * reach * 2.0**-44 + TINY + 128.0 * margin * square * reach
    for k in range(3):
        start = vec3_at(points, 9 * face + 3 * k)
        end = vec3_at(points, 9 * face + 3 * ((k + 1) % 3))
        m = cross(sub(end, start), n)
        beyond = True
        proper = False
        for at in range(9 * facet, 9 * facet + 9, 3):
            corner = vec3_at(points, at)
            w = sub(corner, start)
            outside = dot(m, w) > limit
            proper = proper | outside
            beyond = beyond & (outside | _coincide(w, Vec3(0.0, 0.0, 0.0)) | _coincide(corner, end))
        if beyond & proper:
            return True
    return False


@kernel
def _stay_apart(points, a, b, margin):
    """Whether two facets certainly share no more than a corner, all corners moved by a margin.

    By edges: opposite a common corner, all edges without. `sign_error` is of four corners off by E, as here.
    """
    count, i, j = _common_corners(points, a, b)
    if count > 1:
        return False
    for k in range(3):
        onward = 3 * ((k + 1) % 3)
        if (count == 0 or k == (i + 1) % 3) and not _edge_is_apart(points, a + 3 * k, a + onward, b, margin):
            return False
        if (count == 0 or k == (j + 1) % 3) and not _edge_is_apart(points, b + 3 * k, b + onward, a, margin):
            return False
    return True


@kernel
def _edge_is_apart(points, p, q, facet, margin):
    return segment_against_triangle(points, facet, points, p, q, margin)[0] == APART


# --- the traversal ------------------------------------------------------------------------------


@kernel(inline=True)
def _unless_full(query, _stack, top):
    return -top if query.progress[N_PAIRS] + MAX_FACET_PAIRS > query.capacity else top


@kernel(inline=True)
def _visit_leaves(query, pair):
    tree, planes, progress = query.trees.A, query.planes, query.progress
    points = tree.triangles
    run_a = ~pair.link_a
    run_b = ~pair.link_b
    # Boxes that meet hold both facets: no coordinate differs by more than their widths, and what probes are enlarged
    # by.
    reach = query.unit * (2.01 * (box_size(tree.boxes, pair.a) + box_size(tree.boxes, pair.b)) + query.slack)
    for i in range(run_a & 7):
        a = (run_a >> 3) + i
        for j in range(i + 1 if pair.a == pair.b else 0, run_b & 7):
            b = (run_b >> 3) + j
            query.counters[TRIANGLES] += 1
            margin = query.margin
            if _off_plane(points, planes, a, b, reach, margin) or _off_plane(points, planes, b, a, reach, margin):
                continue
            if _beyond_a_side(points, planes, a, b, reach, margin):
                continue
            if margin > 0.0:
                if _beyond_a_side(points, planes, b, a, reach, margin) or _stay_apart(points, 9 * a, 9 * b, margin):
                    continue
                query.is_steady[tree.ids[a]] = 0
                query.is_steady[tree.ids[b]] = 0
            if _conflict(query, 9 * a, 9 * b):
                smaller = int(min(tree.ids[a], tree.ids[b]))
                larger = int(max(tree.ids[a], tree.ids[b]))
                query.pairs[progress[N_PAIRS]] = smaller * tree.header[N_FACETS] + larger
                progress[N_PAIRS] += 1
    return False


@kernel(inline=True)
def _children_meeting(query, ref, node):
    """Mask of a node's boxes that meet the box behind a reference: in a common tree only its own axes separate."""
    trees = query.trees
    probe = trees.probe
    query.counters[NODES] += 1
    box = box_at(trees.A, ref)
    centre = box.centre
    if trees.A.header[HAS_ORIGINS] != 0:
        centre = sub(centre, origin_of(trees.A.links, node))
    put_floats(probe, 0, centre)
    put_floats(probe, 3, add(box.half, vec3_at(trees.placing, FRAMES + 12)))
    return boxes_meeting(trees.A.boxes, NODE * node, trees.frame_a, probe)


@kernel(inline=True)
def _open_pair(query, pair, stack, top):
    tree = query.trees.A
    link = pair.link_a
    if pair.a == pair.b:
        # Every child with itself and with those after it.
        for slot in range(WIDTH):
            child = WIDTH * link + slot
            if not tree.boxes[NODE * link + 3 * WIDTH + slot] < 0.0:
                mask = (_children_meeting(query, child, link) >> slot) << slot
                top = push_children(stack, top, mask, word_of(child, WIDTH * link), OF_B)
        return top
    if opens_b(tree, tree, pair, 1.0):
        mask = _children_meeting(query, pair.a, pair.link_b)
        return push_children(stack, top, mask, word_of(pair.a, WIDTH * pair.link_b), OF_B)
    mask = _children_meeting(query, pair.b, link)
    return push_children(stack, top, mask, word_of(pair.b, WIDTH * link), OF_B)


_traverse = make_traversal(_unless_full, pair_of_trees, _visit_leaves, _open_pair)


@kernel
def _keep_own_axes_only(frame, probe):
    """Nothing is culled along the axes of the probe's frame, nor by a slab."""
    for k in range(FRAME):
        frame[k] = np.float32(0.0)
    for k in range(6, PROBE):
        probe[k] = np.float32(0.0)
    for k in range(9, 12):
        probe[k] = np.float32(1.0)


@kernel
def _set_steady(tree, planes, margin, is_steady):
    """Start with all facets whose longest edge is over 64 margins; without facets in trees with origins."""
    for facet in range(tree.header[N_FACETS]):
        is_long = planes[PLANE * facet + 3] > 4096.0 * margin * margin
        is_steady[tree.ids[facet]] = 1 if is_long and tree.header[HAS_ORIGINS] == 0 else 0


@entry("int64(int64, int64, int64, int64, int64, int64, float64, int64, int64, int64, int64, int64, int64)")
def walk_itself(
    header_at, pairs_at, capacity, counters_at, progress_at, planes_at, margin, steady_at, stack_at, n_stack,
    doubles_at, integers_at, exact_at
):
    """Pairs of facets of a surface that share more than corners and edges; DONE or FULL, then to be called again.

    Arguments are flat, as of all entries.
    planes : room for PLANE doubles a facet, kept between calls.
    margin : 0, or at most 2⁻⁴⁰ of the unit of boxes and of the tree's size; boxes apart are so by 2⁻²⁰ of the unit:
    half lengths are enlarged by more than comparisons in floats round.   steady : out, uint8, by facet number, for a
    margin above 0.
    pairs : out, the smaller facet number times the number of facets plus the larger.
    """
    tree = open_tree(header_at)
    n_facets = tree.header[N_FACETS]
    planes = view_f64(planes_at, PLANE * n_facets)
    progress = view_i64(progress_at, 2)
    stack = view_i64(stack_at, n_stack)
    identity_at = doubles_at + 8 * (PLACING + CORNERS)
    identity = view_f64(identity_at, 16)
    for k in range(16):
        identity[k] = 1.0 if k % 5 == 0 else 0.0
    trees, _ = pose_trees(
        tree, identity_at, tree, identity_at, doubles_at, doubles_at + 8 * DOUBLES, PROBE, integers_at, exact_at
    )
    _keep_own_axes_only(trees.frame_a, trees.probe)
    rounding = vec3_at(trees.placing, FRAMES + 12)
    query = _Query(
        trees, planes, math.ldexp(1.0, int(tree.header[EXPONENT])),
        2.0**-16 + 2.0 * max(rounding.x, rounding.y, rounding.z), margin, view_u8(steady_at, n_facets),
        view_i64(pairs_at, capacity), capacity, progress, view_i64(counters_at, 3),
    )
    if progress[TOP] == 0:
        _set_planes(tree.triangles, n_facets, planes)
        if margin > 0.0:
            _set_steady(tree, planes, margin, query.is_steady)
        stack[0] = 0
        progress[TOP] = 1
    progress[TOP] = -_traverse(query, stack, progress[TOP])
    return FULL if progress[TOP] > 0 else DONE
