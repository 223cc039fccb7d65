"""Contacts of a mesh and a curved convex set at many pairs of poses, from the rows of `distance` of facets near it.

Patches of facets meeting the set come first, the deepest first; where no facet of them starts a patch, a translation
along a facet's normal to part all of them does. Then patches of gaps, the nearest first (`curved_patches.py`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.carrying_points import CELLS
from collide.contact.clip_polygons import Clipped
from collide.contact.contact_facets import open_facets
from collide.contact.contact_patches import DEEPEST, NearestPoint, least_gap_of, put_nearest
from collide.contact.contact_points import PatchPoints
from collide.contact.curved_patches import (
    COVERED,
    REACHED,
    Look,
    NearFacets,
    cover_facets,
    forget_facets,
    grow_over,
    highest_of,
    pose_facets,
    seed_of,
)
from collide.contact.manifold_points import POINT, ManifoldPoints
from collide.contact.patch_rows import CONTACT, PatchSpace, RowsOf, choose_points, facet_of_row, put_row, widen_row
from collide.contact.reduce_patch import HullSpace, column_words
from collide.contact.shallow_overlaps import STEP_ERRORS
from collide.contact.support_face import axes_across, seen_along, support_face, swept_face
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import CYLINDER
from collide.lowering.shape_table import INTS, NUMBERS, POSE, RADIUS, REACH, SLOP
from collide.mesh.bvh import REACH as TREE_REACH
from collide.mesh.bvh import open_tree
from collide.narrowphase.facets.mesh_collide_kernel import FacetBody
from collide.narrowphase.pose_batches import set_pose
from collide.narrowphase.posed_pair import posed_pair
from collide.narrowphase.rows import DISTANCE, HIT, LOWER, POINT_A, ROW, UPPER, view_row
from collide.numerics.vec3 import Vec3, add, neg, norm, norm1, scale, sub, vec3_at

# Header: addresses of the mesh's tree and topology, whether it is solid, how many facets it has; of the curved set's
# row in a `ShapeTable`, integers and numbers, and in a `HullFaceTable`; most corners of a face; of the facets near it,
# pose after pose, their rows, where those of each pose begin, and bits of each one's patches; of words by facet and
# corner of the mesh, zeroed; of the workspace, and for how many facets it is; max_contacts; of the poses in hand. Then
# what a call has done.
(
    TREE_AT, TOPOLOGY_AT, SOLID, N_MESH, INTS_AT, NUMBERS_AT, FACES_AT, LARGEST, FACETS_AT, ROWS_AT, STARTS_AT,
    PATCHES_AT, SLOTS_AT, SEEN_AT, WORDS_AT, CAPACITY, MAX_CONTACTS, POSE_A, POSE_B, POSES_DONE, ROWS_DONE,
) = range(21)
HEADER = 21
#: Facets that meet the set whose normals are tried where none of them starts a patch.
_TRIED = 16


class _Task(NamedTuple):
    """A mesh and a curved set at their poses.

    near : the facets.   pair : the set, twice, for `support_face`.   faces, doubles, integers : addresses of its faces
    and of buffers.   largest : corners of a face.   radius : swept [m].
    error : by which rows may be off beyond the errors of their gaps [m].   space : where rows go.
    """

    near: NearFacets
    pair: Any
    faces: int
    doubles: int
    integers: int
    largest: int
    radius: float
    error: float
    space: PatchSpace


def workspace_words(capacity: int, largest: int) -> int:
    """64-bit words the kernel works in, for so many facets, and faces of so many corners."""
    corners = 3 + largest + 8
    points = corners * capacity + 1
    of_face = 5 * largest + 2 * 3 * corners + (POINT + 2) * corners
    return POSE + 9 + 6 + of_face + 14 * capacity + 20 * points + CELLS + column_words(points) + 64


@kernel(inline=True)
def _doubles(at, n):
    return view_f64(at, n), at + 8 * n


@kernel(inline=True)
def _integers(at, n):
    return view_i64(at, n), at + 8 * n


@kernel
def _open_points(at, n):
    """(`PatchPoints` for n points, the address behind)."""
    points, at = _doubles(at, POINT * n)
    features, at = _integers(at, 2 * n)
    errors, at = _doubles(at, n)
    pairs, at = _integers(at, n)
    seen, at = _doubles(at, 18)
    return PatchPoints(ManifoldPoints(points, features), errors, pairs, seen), at


@kernel
def _open_near(words, at, first, n, error, pair):
    """(`NearFacets` of n facets from row ``first`` on, not posed, the address behind).

    error : of a coordinate [m].   pair : the set, twice.
    """
    capacity, n_mesh = words[CAPACITY], words[N_MESH]
    c = 3 + words[LARGEST] + 8
    face, at = _doubles(at, 9)
    face_features, at = _integers(at, 3)
    face_edges, at = _integers(at, 3)
    points_1, at = _doubles(at, 2 * c)
    sides_1, at = _integers(at, c)
    points_2, at = _doubles(at, 2 * c)
    sides_2, at = _integers(at, c)
    overlap, at = _doubles(at, POINT * c)
    features, at = _integers(at, 2 * c)
    corners, at = _doubles(at, 9 * capacity)
    normals, at = _doubles(at, 3 * capacity)
    states, at = _integers(at, capacity)
    queue, at = _integers(at, capacity)
    points, at = _open_points(at, c * capacity + 1)
    body = FacetBody(words[TREE_AT], words[SOLID], 0, 0, 0.0)
    zero = Vec3(0.0, 0.0, 0.0)
    mesh = open_facets(body, words[TOPOLOGY_AT], words[POSE_A], zero)
    X = view_f64(words[POSE_A], 16)
    origin, R = Vec3(X[3], X[7], X[11]), pair.poses
    axis = Vec3(R[2], R[5], R[8]) if pair.B.kind == CYLINDER else zero
    axis = scale(1.0 / norm(axis), axis) if norm(axis) > 0.0 else zero
    near = NearFacets(
        n, mesh, view_i64(words[FACETS_AT] + 8 * first, n), words[ROWS_AT] + ROW * first, corners, normals, states,
        queue, view_i64(words[PATCHES_AT] + 8 * first, n), view_i64(words[SLOTS_AT], n_mesh),
        view_i64(words[SEEN_AT], mesh.n_corners), origin, error, sub(vec3_at(R, 9), origin), axis, points, face,
        face_features, face_edges, Clipped(points_1, sides_1), Clipped(points_2, sides_2),
        ManifoldPoints(overlap, features),
    )
    return near, at


@kernel
def _open_task(header_at, first, n, margin, slack, out_at, capacity):
    """The `_Task` of n facets from row ``first`` on, at the poses that the header names."""
    words = view_i64(header_at, HEADER)
    largest = words[LARGEST]
    poses = view_f64(words[WORDS_AT], POSE)
    set_pose(poses, 0, view_f64(words[POSE_B], 16), False)
    buffers_at = words[WORDS_AT] + 8 * POSE
    pair = posed_pair(view_i64(words[INTS_AT], INTS), view_f64(words[NUMBERS_AT], NUMBERS), poses, 0, 0, 0, 0)
    X = view_f64(words[POSE_A], 16)
    shift = sub(vec3_at(poses, 9), Vec3(X[3], X[7], X[11]))
    error = _error(open_tree(words[TREE_AT]).numbers, pair, shift)
    near, at = _open_near(words, buffers_at + 40 * largest, first, n, error, pair)
    n_points = (3 + largest + 8) * words[CAPACITY] + 1
    target, at = _open_points(at, n_points)
    order, at = _integers(at, n_points + 1)
    corners, at = _integers(at, n_points + 1)
    remaining, at = _integers(at, n_points + 1)
    by_place, at = _integers(at, n_points + 1)
    hull = HullSpace(order, corners, remaining, by_place, view_i64(at, CELLS), at + 8 * CELLS)
    space = PatchSpace(target, hull, near.origin, out_at, capacity, words[MAX_CONTACTS], margin + slack)
    error = 8.0 * error + pair.numbers[SLOP] + slack
    return _Task(
        near, pair, words[FACES_AT], buffers_at, buffers_at + 24 * largest, largest, pair.numbers[RADIUS], error, space,
    )


@kernel(inline=True)
def _error(reaches, pair, shift):
    """Bound of the rounding of a coordinate, as in `convex_manifolds.py`."""
    of_mesh = norm(Vec3(reaches[TREE_REACH], reaches[TREE_REACH + 1], reaches[TREE_REACH + 2]))
    reach = 1.01 * (of_mesh + pair.numbers[REACH]) + norm1(shift) + pair.numbers[RADIUS]
    return 2.0**-49 * reach


SIGNATURE = "int64(int64, int64, int64, int64, int64, int64, float64, int64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def curved_manifolds(
    header_at, XA_at, step_a, XB_at, step_b, n, margin, slack_at, out_at, capacity, ends_at, lacks_at
):
    """Contacts at pairs of poses from header[POSES_DONE] on, of n; returns 1 where rows do not fit.

    XA, XB : checked matrices of the mesh and of the set; step 16 or, for a single pose, 0.   margin : [m].
    slack : 0, or a double a pose, added to the margin.   out : `CONTACT_DTYPE`, zeroed, ``capacity`` rows,
    filled from header[ROWS_DONE] on.   ends : where the contacts of each pose end.
    lacks : a word a pose: no patch decides, and the row of `distance` is the only contact.

    Twelve arguments: called by Python and `curved_contact_call.py`, with integers and doubles alone.
    """
    header = view_i64(header_at, HEADER)
    starts = view_i64(header[STARTS_AT], n + 1)
    ends, lacks = view_i64(ends_at, n), view_i64(lacks_at, n)
    for k in range(header[POSES_DONE], n):
        slack = view_f64(slack_at + 8 * k, 1)[0] if slack_at != 0 else 0.0
        header[POSE_A] = XA_at + 8 * step_a * k
        header[POSE_B] = XB_at + 8 * step_b * k
        n_rows = header[ROWS_DONE]
        n_near = starts[k + 1] - starts[k]
        if n_near > 0:
            task = _open_task(header_at, starts[k], n_near, margin, slack, out_at, capacity)
            pose_facets(task.near)
            n_rows = _put_patches(task, n_rows)
            forget_facets(task.near)
            if n_rows < 0:
                return 1
        lacks[k] = 1 if n_rows == header[ROWS_DONE] else 0
        ends[k] = n_rows
        header[ROWS_DONE] = n_rows
        header[POSES_DONE] = k + 1
    return 0


@kernel
def _put_patches(task, n_rows):
    """Append the rows of all patches; returns the new number of rows, −1 where they do not fit."""
    near = task.near
    number = 0
    n_meeting = 0
    for k in range(near.n):  # in order: those that meet the set, the deepest first, then the others, the nearest first
        meets = view_row(near.rows_at + ROW * k).flags[HIT] != 0
        if meets:
            n_meeting += 1
        elif number == 0 and n_meeting > 0:
            n_rows, number = _put_parted(task, n_meeting, n_rows)
            if number == 0:
                return n_rows
        if n_rows < 0:
            return n_rows
        if near.states[k] & COVERED:
            continue
        starts_one, nhat, feature = seed_of(near, k)
        if starts_one:
            near.queue[0] = k
            n_rows, n_put = _put_patch(task, k, nhat, feature, number, n_rows)
            number += n_put
    if number == 0 and n_meeting > 0:
        n_rows, number = _put_parted(task, n_meeting, n_rows)
    return n_rows


@kernel
def _put_patch(task, k, nhat, feature, number, n_rows):
    """Append the rows of facet k's patch; (new number of rows, 1, or 0 without a point)."""
    near, points = task.near, task.near.points
    row = view_row(near.rows_at + ROW * k)
    meets = row.flags[HIT] != 0
    axes = axes_across(nhat)
    of_set = _swept_support(task, axes)
    distance = row.doubles[DISTANCE]
    deepest = DEEPEST * max(-distance, 0.0) if meets else task.radius
    look = Look(axes, -deepest - STEP_ERRORS * near.error, task.space.margin)
    n = grow_over(near, 1, of_set, look)
    bracket = max(row.doubles[UPPER] - distance, distance - row.doubles[LOWER])
    slack = STEP_ERRORS * near.error + 2.0 * of_set.flatness
    if least_gap_of(points, n) - 4.0 * near.error > distance + bracket + slack:
        # Put in front: the nearest points, where corners are farther apart.
        a = seen_along(axes, sub(vec3_at(row.doubles, POINT_A), near.origin))
        nearest = NearestPoint(
            a.x, a.y, distance, a.z + 0.5 * distance, max(bracket, 4.0 * near.error), k, feature,
            of_set.features[0] if of_set.n == 1 else of_set.feature,
        )
        n = put_nearest(points, n, nearest, task.radius)
    first = task.space.out + CONTACT * n_rows
    n_rows = _put_rows(task, axes, n, meets, number, n_rows)
    if n_rows > 0 and not meets and near.facets[k] == facet_of_row(first):
        widen_row(first, distance, row.doubles[LOWER], row.doubles[UPPER])
    return n_rows, 1


@kernel(inline=True)
def _support(task, axes):
    """What of the set's core supports the normal."""
    return support_face(
        task.pair, task.pair.B, task.faces, axes, -1.0, task.near.shift, task.largest, task.doubles, task.integers
    )


@kernel(inline=True)
def _swept_support(task, axes):
    """What of the set supports the normal."""
    return swept_face(_support(task, axes), -1.0, task.radius, task.near.error)


@kernel
def _put_rows(task, axes, n, meets, number, n_rows):
    """Append the rows of n points, and put facets into the patch; how many rows there are then."""
    near, space = task.near, task.space
    cover_facets(near, axes.nhat, number)
    apart = _slab_length(task, axes) if meets else 0.0
    n = choose_points(near.points, n, near.error, space.margin, space)
    if n_rows + n > space.capacity:
        return -1
    rows = RowsOf(axes, space.origin, 0.0, 0.0, task.error, meets, apart, number)
    for i in range(n):
        k = space.hull.order[i]
        facet = near.facets[space.target.pairs[k]]
        put_row(space.out + CONTACT * (n_rows + i), space.target, k, facet, -1, rows)
    return n_rows + n


@kernel
def _slab_length(task, axes):
    """A length along the normal by which the set moved is proven to clear all REACHED facets [m]."""
    of_set, lowest = _support(task, axes), math.inf
    for i in range(of_set.n):
        lowest = min(lowest, of_set.corners[3 * i + 2])
    overlap = highest_of(task.near, axes.nhat) - lowest + task.radius + 2.0 * of_set.flatness
    return max(overlap, 0.0) + STEP_ERRORS * task.near.error + 2.0 * task.error


# --- where no facet starts a patch --------------------------------------------------------------


@kernel
def _put_parted(task, n_meeting, n_rows):
    """Append the rows of the patch of all facets meeting the set, along a facet's normal, or the normals' sum: the
    normal of the least translation to part all; (new number of rows, 1, or 0 where no translation is shorter than the
    set).
    """
    near, pair = task.near, task.pair
    total = Vec3(0.0, 0.0, 0.0)
    best, normal = 2.0 * (pair.numbers[REACH] + task.radius), total
    stride = (n_meeting + _TRIED - 1) // _TRIED
    for k in range(n_meeting):
        near.states[k] |= REACHED
        total = add(total, vec3_at(near.normals, 3 * k))
    for i in range(_TRIED + 1):
        k = i * stride
        if k >= n_meeting + stride:
            break
        v = vec3_at(near.normals, 3 * k) if k < n_meeting else total
        length = norm(v)
        if not length > 2.0**-20:
            continue
        v = scale(1.0 / length, v)
        for side in range(1 if near.mesh.solid else 2):
            n = v if side == 0 else neg(v)
            depth = _slab_length(task, axes_across(n))
            if depth < best:
                best, normal = depth, n
    if norm(normal) == 0.0:
        return n_rows, 0
    axes = axes_across(normal)
    of_set = _swept_support(task, axes)
    for k in range(n_meeting):
        near.queue[k] = k
    low = -DEEPEST * best - STEP_ERRORS * near.error
    n = grow_over(near, n_meeting, of_set, Look(axes, low, task.space.margin))
    if n == 0:
        return n_rows, 0
    return _put_rows(task, axes, n, True, 0, n_rows), 1
