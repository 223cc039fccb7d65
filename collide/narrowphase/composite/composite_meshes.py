"""Unions with meshes: a `Compound` against a mesh, a mesh among the parts of a `Compound`, to any nesting.

Apart, the distance is the least distance of the parts. Convex parts of both sides are answered together, as for
unions of convex parts (`collide/narrowphase/composite/composite.py`); a pair of parts with a mesh is asked about only
where the boxes of both come as near as the distance known already. Overlapping, the row holds a translation proven to
separate the unions.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from collide.base.poses_at import poses_at
from collide.lowering.facet_bodies import PosesWithSlop, body_of, origin_body
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.shape_table import ShapeTable
from collide.narrowphase.composite.composite_mesh_pairs import part_rows, part_states
from collide.narrowphase.composite.composite_parts import Balls, CompoundParts, Part, boxes_near, compound_parts
from collide.narrowphase.convex_batches import convex_hits, convex_rows
from collide.narrowphase.convex_kernel_calls import leaving_touching_open, run_poses
from collide.narrowphase.facets.facet_queries import points_in_solid, surface_distances
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT, OPEN
from collide.narrowphase.facets.separating_translation import SeparatingTranslation, shortened
from collide.narrowphase.facets.touching_facets import PosedPart, settle_rows, settle_states
from collide.narrowphase.facets.winding_numbers import INSIDE, OUTSIDE
from collide.numerics.frames import frame_along
from collide.results import EXACT, FIELDS, PAIR_DTYPE, UNDECIDED, flipped
from collide.shapes.shape import Shape

#: Pairs of parts that trial booleans of a depth search ask about before boxes of all parts are made.
_ASKED_FIRST = 8
#: Pairs of convex sets around parts that are posed at once: they need little memory.
_BOUNDS_AT_ONCE = 1 << 14
#: Of more parts at one mesh, balls around them are asked before they are.
_AT_ONE_MESH = 4
#: Groups are asked about at so many meshes at most: more are small beside a group.
_MAX_MESHES = 8
#: Gaps of boxes of so many pairs of parts are worked out one and all; a walk through both trees takes as long.
_MAX_TABLE = 1 << 12


def compound_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, open_ones: bool = False) -> np.ndarray:
    """(n,) APART, HIT or OPEN.

    open_ones : tell them from hits among convex parts, too, which takes longer.
    """
    return _states(compound_parts(A), compound_parts(B), X_WA, X_WB, open_ones, settle=True)


def _states(
    A: CompoundParts, B: CompoundParts, X_WA, X_WB, open_ones: bool = False, *, settle: bool = False
) -> np.ndarray:
    """`compound_states`; settle : decide meshes touching within rounding, hits to searches for translations."""
    states = np.full(len(X_WA), APART)
    if A.convex is not None and B.convex is not None:
        met = np.flatnonzero(convex_hits(A.convex, B.convex, X_WA, X_WB))
        states[met] = HIT
        if open_ones and len(met):
            rows = convex_rows(A.convex, B.convex, X_WA[met], X_WB[met], limit=0.0)
            states[met[rows["how"] == UNDECIDED]] = OPEN
    meshed = A.columns.meshed[:, None] | B.columns.meshed
    # A hit among any parts is one of the unions. Poses of a depth search are much alike: the pairs whose boxes overlap
    # the most at the first of them decide most of the others, and only what they leave open is asked about all parts.
    first = np.flatnonzero(states != HIT)[:1]
    if len(first) and len(X_WA) > 1 and meshed.size > _ASKED_FIRST:
        gaps = np.where(meshed, _overlaps(A, B, X_WA[first], X_WB[first])[0], math.inf)
        deepest = np.argsort(gaps, axis=None, kind="stable")[:_ASKED_FIRST]
        deepest = deepest[gaps.flat[deepest] <= 0.0]
        for some in (deepest[:1], deepest[1:]):
            i, j = np.unravel_index(some, gaps.shape)
            poses = np.flatnonzero(states != HIT)
            if len(some) and len(poses):
                gaps_ij = _box_gaps(A, B, X_WA[poses], X_WB[poses], i, j)[:, range(len(some)), range(len(some))]
                at, pose = np.nonzero(gaps_ij.T <= 0.0)
                _take_states(A, B, i[at], j[at], poses[pose], X_WA, X_WB, states, settle)
            meshed[i, j] = False
    poses = np.flatnonzero(states != HIT)
    if len(poses):
        gaps = _overlaps(A, B, X_WA[poses], X_WB[poses])
        near = meshed & (gaps <= 0.0)
        for M, N, X_WM, X_WN, of_both in ((A, B, X_WA, X_WB, near), (B, A, X_WB, X_WA, near.transpose(0, 2, 1))):
            states[poses[_leave_out_groups(M, N, X_WM[poses], X_WN[poses], of_both)]] = HIT
        near[states[poses] == HIT] = False
        if len(X_WA) == 1 and near.sum() > _ASKED_FIRST:
            deepest = np.where(near[0], gaps[0], math.inf).argmin().reshape(1)
            first_a, first_b = np.unravel_index(deepest, meshed.shape)
            _take_states(A, B, first_a, first_b, poses, X_WA, X_WB, states, settle)
        pairs = np.argwhere(np.any(near, axis=0))
        begin, size = 0, _ASKED_FIRST
        while begin < len(pairs):  # in blocks, each larger, since poses with a hit are done with
            i, j = pairs[begin : begin + size].T
            begin, size = begin + size, 4 * size
            at, pose = np.nonzero(near[:, i, j].T & (states[poses] != HIT))
            _take_states(A, B, i[at], j[at], poses[pose], X_WA, X_WB, states, settle)
    return states


def _set_gaps(A: CompoundParts, B: CompoundParts, i, j, X_WA, X_WB, within: float = 0.0) -> np.ndarray:
    """(k,) how far parts i and j (k,) are at least at poses (k, 4, 4), looked for up to ``within`` [m], by convex sets
    around both; not above 0 where these may meet.

    A part lies in its convex set, and poses, rounded, put the sets within their slops of where they are: the parts'
    distance is no less than the sets', less both slops.
    """
    gaps = np.zeros(len(i))
    for first in range(0, len(i), _BOUNDS_AT_ONCE):
        some = slice(first, first + _BOUNDS_AT_ONCE)
        about = _about(A, B, i[some], j[some], X_WA[some], X_WB[some])
        sets: list[PackedConvex] = []
        rows, placed, slop = [], [], np.zeros(len(about))
        for side, parts, X in ((A, i[some], X_WA[some]), (B, j[some], X_WB[some])):
            of, row = np.unique(parts, return_inverse=True)
            rows.append(row.ravel() + len(sets))
            sets += [side.parts[k].bound for k in of.tolist()]
            placed.append(side.placed(parts, X, about))
            slop += 1.001 * placed[-1].slop
        distances = np.zeros(len(about), dtype=PAIR_DTYPE)
        run_poses(
            distances, ShapeTable(sets), np.stack(rows, axis=1), placed[0].X, placed[1].X, boolean=False,
            limit=within + float(slop.max()), check=False, depths=False,
        )
        gaps[some] = distances["lower"] - slop
    return gaps


def _leave_out_groups(M: CompoundParts, N: CompoundParts, X_WM, X_WN, near: np.ndarray) -> np.ndarray:
    """(n,) bool: poses at which a group of parts of N lies within a mesh of M. Clears ``near``, (n, parts of M, parts
    of N) bool, in place, for pairs whose group is outside the mesh; larger groups are asked first.

    A ball holds its group: where the ball is clear of every facet, the group is on the side of the ball's centre.
    """
    within = np.zeros(len(near), dtype=bool)
    for balls in N.groups if M.columns.meshed.sum() <= _MAX_MESHES else ():
        members = np.zeros((len(balls.of), len(balls.radii)), dtype=np.int64)
        members[np.arange(len(balls.of)), balls.of] = 1
        for mesh in np.flatnonzero(M.columns.meshed & near.any(axis=(0, 2))).tolist():
            pose, group = np.nonzero((near[:, mesh] @ members > 1) & ~within[:, None])
            if not len(pose):
                continue
            states = _states_of(*_ball_gaps(M, balls, X_WM, X_WN, mesh, group, pose, np.zeros(len(pose))))
            within[pose[states == HIT]] = True
            apart = np.zeros((len(near), len(balls.radii)), dtype=bool)
            apart[pose, group] = states == APART
            near[:, mesh] &= ~apart[:, balls.of]
    return within


def _take_states(
    A: CompoundParts, B: CompoundParts, i, j, poses, X_WA, X_WB, states: np.ndarray, settle: bool
) -> None:
    """Ask about pairs of parts i, j (k,) at poses by number (k,), those of a pair together, and put what is told of the
    unions into ``states`` (n,)."""
    status = np.full(len(poses), OPEN)
    begins = (np.diff(i, prepend=-1) != 0) | (np.diff(j, prepend=-1) != 0)
    for of_mesh, of_other, sides in ((i, j, (A, B, X_WA, X_WB)), (j, i, (B, A, X_WB, X_WA))):
        for number in np.flatnonzero(np.bincount(of_mesh[begins]) > _AT_ONE_MESH).tolist():
            some = np.flatnonzero((status == OPEN) & (of_mesh == number))
            if sides[0].columns.meshed[number]:
                status[some] = _states_by_balls(*sides, number, of_other[some], poses[some])
    states[poses[status == HIT]] = HIT
    some = np.flatnonzero((status == OPEN) & (states[poses] != HIT))
    if begins.sum() > _ASKED_FIRST and len(some) and not (A.unbounded and B.unbounded):
        some = some[_set_gaps(A, B, i[some], j[some], X_WA[poses[some]], X_WB[poses[some]]) <= 0.0]
    if not len(some):
        return
    PA, PB = _placed(A, B, i[some], j[some], X_WA[poses[some]], X_WB[poses[some]])
    of_pair = np.cumsum(begins)[some]
    for rows in np.split(np.arange(len(some)), np.flatnonzero(np.diff(of_pair)) + 1):
        rows = rows[states[poses[some[rows]]] != HIT]
        if len(rows):
            at, first = poses[some[rows]], some[rows[0]]
            part_a, part_b = A.parts[i[first]], B.parts[j[first]]
            state = part_states(part_a.shape, part_b.shape, PA.of(rows), PB.of(rows))
            if settle and part_a.exact and part_b.exact:
                settle_states(state, _parts_of_pair(part_a, part_b, X_WA[at], X_WB[at]))
            states[at] = np.where(state == APART, states[at], state)


def _parts_of_pair(A: Part, B: Part, X_WA, X_WB) -> Callable[[int], tuple[PosedPart, PosedPart]]:
    """Both parts of pair k, of unions at poses (n, 4, 4)."""
    return lambda k: (PosedPart(A.shape, X_WA[k], A.X), PosedPart(B.shape, X_WB[k], B.X))


def _states_by_balls(
    M: CompoundParts, N: CompoundParts, X_WM, X_WN, mesh: int, others: np.ndarray, poses: np.ndarray
) -> np.ndarray:
    """(k,) APART, HIT or OPEN by the balls around parts of N, before a mesh of M, at poses by number.

    A part farther from every facet than rounding moved the part is wholly on the side of its ball's centre.
    """
    return _states_of(*_ball_gaps(M, N.balls, X_WM, X_WN, mesh, others, poses, np.zeros(len(others))))


def _states_of(gaps: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(k,) APART, HIT or OPEN by what `_ball_gaps` gives."""
    return np.where(gaps > 0.0, np.where(sides == OUTSIDE, APART, np.where(sides == INSIDE, HIT, OPEN)), OPEN)


def _ball_gaps(
    M: CompoundParts, balls: Balls, X_WM, X_WN, mesh: int, others: np.ndarray, poses: np.ndarray, within: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """((k,) lower bounds [m] of the gaps between parts in balls of N, by number, and the surface of a mesh of M, at
    poses by number, looked for up to ``within`` (k,), -inf where a part may touch; (k,) the sides of the other parts).

    A ball holds its part, and rounding moves the ball by no more than the slop: the part's nearest point to the surface
    is nearer than the ball's centre by radius and slop at most, and while radius and slop are less than the centre's
    distance, no facet parts the point from the centre.
    """
    gaps, sides = np.full(len(others), -math.inf), np.full(len(others), OUTSIDE)
    body, unique = body_of(M.parts[mesh].shape), np.unique(poses, return_inverse=True)
    placed = M.parts[mesh].at(X_WM[unique[0]], np.zeros(len(unique[0]))).of(unique[1])
    centres, radii = balls.at(others, X_WN[poses])
    reach = radii + placed.slop
    some = np.flatnonzero(np.isfinite(reach))
    if len(some):
        X = poses_at(centres[some])
        limit = float((within + reach)[some].max()) * (1.0 + 2.0**-40)
        lower = surface_distances(body.tree, origin_body().tree, placed.X[some], X, limit).lower
        gap = (lower - reach[some]) * (1.0 - 2.0**-40)
        apart = gap > 0.0
        some, X = some[apart], X[apart]
        gaps[some] = gap[apart]
    if len(some) and body.solid:
        sides[some] = points_in_solid(body.tree, placed.X[some], np.zeros(3), X)
    return gaps, sides


def _mesh_pairs(A: CompoundParts, B: CompoundParts, wanted: np.ndarray) -> list[list[int]]:
    """Numbers [part of A, part of B] of the wanted pairs with a mesh."""
    return np.argwhere(wanted & (A.columns.meshed[:, None] | B.columns.meshed)).tolist()


def _parts_at(A: CompoundParts, B: CompoundParts, i: int, j: int, X_WA, X_WB):
    """(part, part, their poses, their poses)."""
    which = np.full(len(X_WA), i), np.full(len(X_WB), j)
    return A.parts[i], B.parts[j], *_placed(A, B, *which, X_WA, X_WB)


def _placed(A: CompoundParts, B: CompoundParts, i, j, X_WA, X_WB) -> tuple[PosesWithSlop, PosesWithSlop]:
    """Poses of pairs of parts by number (k,), of the unions' poses (k, 4, 4)."""
    about = _about(A, B, i, j, X_WA, X_WB)
    return A.placed(i, X_WA, about), B.placed(j, X_WB, about)


def _about(A: CompoundParts, B: CompoundParts, i, j, X_WA, X_WB) -> np.ndarray:
    """(n,) how far from them half-spaces among parts i and j, a number or (n,), are looked at [m]."""
    about = np.sqrt(np.square(X_WB[:, :3, 3] - X_WA[:, :3, 3]).sum(axis=1))
    for columns, k in ((A.columns, i), (B.columns, j)):
        about = about + 2.0 * (columns.reach[k] + columns.radius[k] + np.abs(columns.X[k, :3, 3]).sum(axis=-1))
    return about


def _box_gaps(A: CompoundParts, B: CompoundParts, X_WA, X_WB, of_a=None, of_b=None) -> np.ndarray:
    """(n, parts of A, parts of B) what the parts' distances are at least, by their boxes; not above 0 where these
    overlap. of_a, of_b : numbers of the parts wanted; all without.

    Along an axis boxes are apart by the difference of their ends, and altogether by the root of the sum of the squares:
    no part reaches out of its box.
    """
    a, b = A.boxes(X_WA, of_a)[:, :, None], B.boxes(X_WB, of_b)[:, None]
    largest, square = np.array(-math.inf), np.array(0.0)
    for axis in range(3):  # by axes, since arrays of all parts and axes at once leave the caches
        along = np.maximum(b[..., axis] - a[..., 3 + axis], a[..., axis] - b[..., 3 + axis])
        largest, square = np.maximum(largest, along), square + np.square(np.maximum(along, 0.0))
    length = np.sqrt(square) * (1.0 - 2.0**-40)
    return np.where(largest > 0.0, np.maximum(largest, length), largest)


def _overlaps(A: CompoundParts, B: CompoundParts, X_WA, X_WB) -> np.ndarray:
    """(n, parts of A, parts of B) gaps [m] as of `_box_gaps` where at most 0. Gaps above 0 may be infinite: of many
    pairs only the pairs named by a walk through both trees are measured, and the boxes of all others are apart."""
    if len(A.parts) * len(B.parts) <= _MAX_TABLE:
        return _box_gaps(A, B, X_WA, X_WB)
    gaps = np.full((len(X_WA), len(A.parts), len(B.parts)), math.inf)
    pose, i, j = boxes_near(A, B, X_WA, X_WB, 0.0)
    a, b = A.boxes_of(i, X_WA[pose]), B.boxes_of(j, X_WB[pose])
    gaps[pose, i, j] = np.maximum(b[:, :3] - a[:, 3:], a[:, :3] - b[:, 3:]).max(axis=1)
    return gaps


# --- rows ---------------------------------------------------------------------------------------


def compound_rows(A: Shape, B: Shape, X_WA, X_WB, *, limit: float, depths: bool = True) -> np.ndarray:
    """Rows (PAIR_DTYPE) for poses (n, 4, 4) of two shapes, one at least a union; limit, depths as in `distance`."""
    return _rows_in_order(compound_parts(A), compound_parts(B), X_WA, X_WB, limit, depths)


def _rows_in_order(A: CompoundParts, B: CompoundParts, X_WA, X_WB, limit: float, depths: bool) -> np.ndarray:
    """Rows worked out on the same numbers for swapped questions: unions in the order of their contents, equal ones by
    poses."""
    if B.key < A.key:
        return flipped(_rows_in_order(B, A, X_WB, X_WA, limit, depths))
    rows = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
    swap = np.zeros(len(X_WA), dtype=bool)
    if A.key == B.key:
        swap[:] = [X.tolist() > Y.tolist() for X, Y in zip(X_WA[:, :3], X_WB[:, :3])]
    if swap.any():
        rows[swap] = flipped(_rows(B, A, X_WB[swap], X_WA[swap], limit, depths))
    if not swap.all():
        rows[~swap] = _rows(A, B, X_WA[~swap], X_WB[~swap], limit, depths)
    return rows


def _rows(A: CompoundParts, B: CompoundParts, X_WA, X_WB, limit: float, depths: bool) -> np.ndarray:
    planes = A.is_halfspace or B.is_halfspace
    asked, left_out = _part_rows(A, B, X_WA, X_WB, limit, planes)
    out = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
    for k in range(len(X_WA)):
        rows = asked[k]
        certain = rows[rows["hit"] & (rows["how"] != UNDECIDED)]
        undecided = rows[rows["hit"] & (rows["how"] == UNDECIDED)]
        if planes or not len(certain) + len(undecided):
            out[k] = _least(rows, limit, bool(left_out[k]))
        else:
            _overlap(A, B, X_WA[k], X_WB[k], out[k : k + 1], certain if len(certain) else undecided, rows, depths)
    return out


def _part_rows(
    A: CompoundParts, B: CompoundParts, X_WA, X_WB, limit: float, planes: bool
) -> tuple[list[np.ndarray], np.ndarray]:
    """(rows of the pairs of parts that matter, pose by pose; (n,) bool, whether some beyond the limit were left
    out)."""
    n = len(X_WA)
    sight = math.nextafter(limit, math.inf)
    left_out = np.zeros(n, dtype=bool)
    asked: list[list[np.ndarray]] = [[] for _ in range(n)]
    upper, hit = np.full(n, math.inf), np.zeros(n, dtype=bool)

    def take(rows: np.ndarray, poses: np.ndarray) -> None:
        clean = np.zeros(len(rows), dtype=PAIR_DTYPE)
        for name in FIELDS:  # padding stays 0
            clean[name] = rows[name]
        clean["vertices_a"] = clean["vertices_b"] = -1
        clean["count"], clean["iterations"] = 0, 0
        for k, row in zip(poses.tolist(), clean):
            asked[k].append(row.reshape(1))
        upper[poses] = np.minimum(upper[poses], clean["upper"])
        hit[poses] |= clean["hit"] & (clean["how"] != UNDECIDED)

    if A.convex is not None and B.convex is not None:
        rows = convex_rows(A.convex, B.convex, X_WA, X_WB, limit=limit)
        for name, side in (("part_a", A), ("part_b", B)):
            rows[name] = side.numbers[rows[name]]
        take(rows, np.arange(n))
    gaps = _box_gaps(A, B, X_WA, X_WB)
    meshed = A.columns.meshed[:, None] | B.columns.meshed
    left_out |= (meshed & (gaps > sight)).any(axis=(1, 2))

    placed = None if A.unbounded or B.unbounded else (A.placed_all(X_WA), B.placed_all(X_WB))

    def rows_of(i: int, j: int, poses: np.ndarray) -> np.ndarray:
        if placed is None:
            part_a, part_b, PA, PB = _parts_at(A, B, i, j, X_WA[poses], X_WB[poses])
        else:
            part_a, part_b, PA, PB = A.parts[i], B.parts[j], placed[0][i].of(poses), placed[1][j].of(poses)
        rows = part_rows(part_a.shape, part_b.shape, PA, PB, limit)
        if part_a.exact and part_b.exact:
            settle_rows(rows, _parts_of_pair(part_a, part_b, X_WA[poses], X_WB[poses]), limit)
        for name, side, number in (("part_a", A, i), ("part_b", B, j)):
            if side.is_union:
                rows[name] = number
        return rows

    # What comes near is known at once from the pair whose boxes are nearest, or whose ball is; then in the order of the
    # parts.
    known: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
    if len(A.parts) * len(B.parts) > 1:
        known = _nearest_first(np.where(meshed, gaps, math.inf), np.full(n, sight), rows_of)
    for poses, rows in known.values():
        upper[poses] = np.minimum(upper[poses], np.maximum(rows["upper"], 0.0))
        _raise_along_normals(A, B, X_WA, X_WB, poses, rows, upper, gaps)
    within = np.minimum(upper, sight)
    raised = _raise_by_balls(A, B, X_WA, X_WB, within, gaps)
    raised |= _raise_by_balls(B, A, X_WB, X_WA, within, gaps.transpose(0, 2, 1))
    raised |= _raise_by_sets(A, B, X_WA, X_WB, within, gaps)
    if raised.any():
        left_out |= (meshed & (gaps > sight)).any(axis=(1, 2))
        others = np.where(meshed & raised[:, None, None], gaps, math.inf)
        for (i, j), (poses, _) in known.items():
            others[poses, i, j] = math.inf
        for pair, (poses, rows) in _nearest_first(others, within, rows_of).items():
            upper[poses] = np.minimum(upper[poses], np.maximum(rows["upper"], 0.0))
            before = known.get(pair, (poses[:0], rows[:0]))
            known[pair] = np.concatenate([before[0], poses]), np.concatenate([before[1], rows])
    last = np.argwhere(meshed)[-1].tolist()
    wanted = np.any(gaps <= np.minimum(upper, sight)[:, None, None], axis=0)
    wanted[tuple(last)] = True
    for i, j in _mesh_pairs(A, B, wanted):
        if hit.all() and not planes:
            break
        far = gaps[:, i, j] > np.minimum(upper, sight)
        if [i, j] == last:  # a pose keeps at least one row
            far &= np.array([bool(rows) for rows in asked], dtype=bool)
        remaining = np.flatnonzero(~far & (planes | ~hit))
        if len(remaining):
            if (i, j) in known:
                poses, rows = known[i, j]
                some = np.isin(poses, remaining)
                take(rows[some], poses[some])
                remaining = np.setdiff1d(remaining, poses)
            if len(remaining):
                take(rows_of(i, j, remaining), remaining)
    return [np.concatenate(rows) for rows in asked], left_out


def _raise_along_normals(
    A: CompoundParts, B: CompoundParts, X_WA, X_WB, poses: np.ndarray, rows: np.ndarray, upper: np.ndarray, gaps
) -> None:
    """Raise ``gaps``, as of `_box_gaps`, in place to the gaps of boxes with an axis along the normal of a known row.

    Boxes along the world's axes say little of a large, turned body: all parts of a small union before its face are as
    near. Boxes in a frame whose first axis is the normal tell the parts apart. The frame's rotation and the poses in
    the frame are rounded, which moves a point 1 m from A's origin by some 2⁻⁵⁰ m: 2⁻⁴⁴ of the size of the boxes is
    taken off.
    """
    for k, row in zip(poses.tolist(), rows):
        near = gaps[k] <= upper[k]
        if row["hit"] or row["beyond"] or not row["normal"].any() or near.sum() <= _ASKED_FIRST:
            continue
        X_A, X_B = X_WA[k : k + 1].copy(), X_WB[k : k + 1].copy()
        X_B[:, :3, 3] -= X_A[:, :3, 3]
        X_A[:, :3, 3] = 0.0
        rotation = frame_along(row["normal"])
        for X in (X_A, X_B):
            X[:, :3] = rotation @ X[:, :3]
        of_a, of_b = np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0))
        ends = np.concatenate([side.boxes(X, of)[0] for side, X, of in ((A, X_A, of_a), (B, X_B, of_b))])
        size = float(np.abs(ends[np.isfinite(ends)]).max(initial=0.0))
        raised = _box_gaps(A, B, X_A, X_B, of_a, of_b)[0] - 2.0**-44 * size
        at = np.ix_([k], of_a, of_b)
        gaps[at] = np.maximum(gaps[at], raised)


def _raise_by_balls(M: CompoundParts, N: CompoundParts, X_WM, X_WN, within: np.ndarray, gaps) -> np.ndarray:
    """Raise ``gaps``, as of `_box_gaps`, in place to the gaps of balls around many parts of N before one mesh of M;
    returns (n,) bool, the poses with a raised gap.

    Neither boxes nor a normal tell the parts of a small union apart beside a rough mesh, or in a valley of the mesh.
    Only outside the mesh is a part as far from the surface as its ball. within : (n,) distances known so far [m];
        poses at 0 are left as they are, since a pair that meets ends the search of a pose.
    """
    near = (gaps <= within[:, None, None]) & M.columns.meshed[:, None] & (within > 0.0)[:, None, None]
    near &= near.sum(axis=2, keepdims=True) > _ASKED_FIRST
    raised = np.zeros(len(gaps), dtype=bool)
    for mesh in np.flatnonzero(near.any(axis=(0, 2))).tolist():
        entries = np.argwhere(near[:, mesh])
        for first in range(0, len(entries), _BOUNDS_AT_ONCE):
            pose, part = entries[first : first + _BOUNDS_AT_ONCE].T
            by_balls, sides = _ball_gaps(M, N.balls, X_WM, X_WN, mesh, part, pose, within[pose])
            by_balls[sides != OUTSIDE] = -math.inf
            gaps[pose, mesh, part] = np.maximum(gaps[pose, mesh, part], by_balls)
            raised[pose[by_balls > -math.inf]] = True
    return raised


def _raise_by_sets(A: CompoundParts, B: CompoundParts, X_WA, X_WB, within: np.ndarray, gaps) -> np.ndarray:
    """Raise ``gaps``, as of `_box_gaps`, in place to the gaps of convex sets around the parts, at poses with many pairs
    as near as ``within`` (n,) [m] still; returns (n,) bool, the poses with a raised gap.

    Rows beyond a limit have no normal, and only the larger body's own faces tell the parts of a union before it apart.
    """
    meshed = A.columns.meshed[:, None] | B.columns.meshed
    near = meshed & (gaps <= within[:, None, None]) & (within > 0.0)[:, None, None]
    near &= near.sum(axis=(1, 2), keepdims=True) > _ASKED_FIRST
    raised = np.zeros(len(gaps), dtype=bool)
    if A.unbounded or B.unbounded or not near.any():
        return raised
    pose, i, j = np.nonzero(near)
    farthest = within[pose].max()
    by_sets = _set_gaps(A, B, i, j, X_WA[pose], X_WB[pose], float(farthest))
    raised[pose[by_sets > gaps[pose, i, j]]] = True
    gaps[pose, i, j] = np.maximum(gaps[pose, i, j], by_sets)
    return raised


def _nearest_first(
    gaps: np.ndarray, sight: np.ndarray, rows_of
) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
    """{(part of A, part of B): (poses, their rows)}: at each pose the pair with the nearest boxes, if in sight.

    gaps : (n, parts of A, parts of B) [m], infinite of pairs not asked about here.   sight : (n,) [m].
    """
    n = len(gaps)
    nearest = gaps.reshape(n, -1).argmin(axis=1)
    least = gaps.reshape(n, -1)[np.arange(n), nearest]
    in_sight = (least <= sight) & (least < math.inf)
    known = {}
    for which in np.unique(nearest[in_sight]).tolist():
        poses = np.flatnonzero(in_sight & (nearest == which))
        i, j = divmod(which, gaps.shape[2])
        known[i, j] = poses, rows_of(i, j, poses)
    return known


def _least(rows: np.ndarray, limit: float, left_out: bool) -> np.ndarray:
    """The row of the nearest parts, its bracket widened to hold for all."""
    row = rows[np.argmin(rows["distance"])].copy()
    lower, upper = rows["lower"].min(), rows["upper"].min()
    rivals = rows[rows["lower"] <= upper]
    row["lower"], row["upper"] = lower, upper
    row["hit"] = bool(rows["hit"].any())
    row["certified"] = bool(rivals["certified"].all())
    row["beyond"] = bool(rows["beyond"].all() or lower > limit)
    if row["beyond"]:
        lower = min(float(lower), math.nextafter(limit, math.inf)) if left_out else lower
        row["lower"] = lower
        row["distance"], row["upper"], row["certified"] = lower, math.inf, True
    else:
        row["distance"] = min(max(float(row["distance"]), float(lower)), float(upper))
    return row


def _overlap(
    A: CompoundParts, B: CompoundParts, X_WA, X_WB, out: np.ndarray, meeting: np.ndarray, rows, depths: bool
) -> None:
    """Write the row of two unions that meet, or may meet: at the parts proven deepest."""
    row = meeting[np.lexsort((meeting["distance"], meeting["upper"]))[0]].copy()
    certain = row["how"] != UNDECIDED
    point = 0.5 * (row["point_a"] + row["point_b"])
    row["hit"], row["beyond"], row["certified"] = True, False, certain
    row["upper"] = 0.0 if certain else max(0.0, float(rows["upper"].min()))
    row["point_a"] = row["point_b"] = point
    row["distance"], row["lower"], row["normal"] = 0.0, 0.0, 0.0
    if certain:
        row["how"] = row["how"] or EXACT
    if depths:
        if A.unbounded or B.unbounded:
            length, bound, normal = _way_out(A, B, X_WA, X_WB, meeting)
        else:
            with leaving_touching_open():
                length, bound, normal = _separating_translation(A, B, X_WA, X_WB, meeting)
        if certain:  # what separates the unions separates their deepest convex parts, too
            row["upper"] = min(0.0, float(meeting["upper"].min()))
        row["distance"], row["lower"] = min(0.0 - length, float(row["upper"])), 0.0 - bound
        row["normal"] = normal + 0.0
        length = -float(row["distance"]) if bound < math.inf else 0.0
        row["point_a"], row["point_b"] = point + 0.5 * length * normal, point - 0.5 * length * normal
        row["certified"] = bool(certain and bound == 0.0)
    out[0] = row


def _separating_translation(
    A: CompoundParts, B: CompoundParts, X_WA, X_WB, meeting: np.ndarray
) -> SeparatingTranslation:
    """A translation of B that separates the unions, proven."""
    axes = np.concatenate([np.eye(3), X_WA[:3, :3].T, X_WB[:3, :3].T])
    axes /= np.sqrt(np.square(axes).sum(axis=1))[:, None]
    normals = meeting["normal"][np.square(meeting["normal"]).sum(axis=1) > 0.5]
    directions = np.concatenate([normals, axes, -axes])
    best: SeparatingTranslation | None = None
    (extents_a, error_a), (extents_b, error_b) = A.extents(X_WA, directions), B.extents(X_WB, -directions)
    for n, a, b in zip(directions, extents_a.tolist(), extents_b.tolist()):
        depth, bound = max(a + b, 0.0), max(a + b + error_a + error_b, 0.0)
        if best is None or bound < best.bound:
            best = SeparatingTranslation(depth, bound, n)
    assert best is not None
    if best.bound == 0.0:
        return best
    return _shortened(A, B, X_WA, X_WB, best, directions, meeting)


def _shortened(A: CompoundParts, B: CompoundParts, X_WA, X_WB, known, directions, meeting) -> SeparatingTranslation:
    """`shortened` of two unions; the translations of their parts' rows are tried first."""
    more = [-float(row["distance"]) * row["normal"] for row in meeting if -math.inf < row["distance"] < 0.0]
    return shortened(meets(A, B), X_WA, X_WB, known, directions, more)


def meets(A: CompoundParts, B: CompoundParts) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """(poses of A, poses of B), each (n, 4, 4), → (n,) bool, False only where the bodies are proven apart: for searches
    of translations."""
    return lambda X_WA, X_WB: _states(A, B, X_WA, X_WB) != APART


#: How far a way out of half-spaces is followed, in sizes of the pair without them.
_FARTHEST = (4.0, 64.0, 1024.0)


def _way_out(A: CompoundParts, B: CompoundParts, X_WA, X_WB, meeting: np.ndarray) -> SeparatingTranslation:
    """A proven translation of B out of A, at least one of the unions with half-spaces; infinite where no translation
    was found, as of two half-spaces."""
    nothing = SeparatingTranslation(math.inf, math.inf, np.array([0.0, 0.0, 1.0]))
    if A.unbounded and B.unbounded:
        return nothing
    normals, depths = _planes(A, B, X_WA, X_WB) if A.unbounded else _planes(B, A, X_WB, X_WA)
    normals = normals if A.unbounded else -normals
    ways = [x for x in (_shortest_way(normals, depths), _shortest_way(normals, np.ones(len(depths)))) if x is not None]
    rows = meeting["normal"][np.square(meeting["normal"]).sum(axis=1) > 0.5]
    directions = np.concatenate([np.array(ways).reshape(-1, 3), rows, normals])
    directions /= np.sqrt(np.square(directions).sum(axis=1))[:, None]
    size = float(np.abs(depths).max() + np.abs(X_WA[:3, 3] - X_WB[:3, 3]).sum()) + A.reach + B.reach
    # Between half-spaces that face each other a long way leads into the other one, but for along both.
    shortest = _shortest_way(normals, depths + 2.0**-40 * size)
    shortest = np.zeros(3) if shortest is None else shortest
    along = _across_all(normals)
    steps = [shortest[None], *(shortest + factor * size * along for factor in _FARTHEST)]
    steps += [factor * size * directions for factor in _FARTHEST]
    for some in steps:
        moved = np.repeat(X_WB[None], len(some), axis=0)
        moved[:, :3, 3] += some
        apart = some[_states(A, B, np.repeat(X_WA[None], len(moved), axis=0), moved) == APART]
        if len(apart):
            lengths = np.sqrt(np.square(apart).sum(axis=1))
            length, k = float(lengths.min()), int(lengths.argmin())
            known = SeparatingTranslation(length, length * (1.0 + 2.0**-40), apart[k] / length)
            return _shortened(A, B, X_WA, X_WB, known, np.concatenate([directions, along]), meeting)
    return nothing


def _across_all(normals: np.ndarray) -> np.ndarray:
    """Unit vectors (k, 3) along all planes with these normals, both ways; k = 0, 2 or 4."""
    _, lengths, axes = np.linalg.svd(normals)
    free = axes[int((lengths > 2.0**-30).sum()) :]
    return np.concatenate([free, -free])


def _planes(A: CompoundParts, B: CompoundParts, X_WA, X_WB) -> tuple[np.ndarray, np.ndarray]:
    """((k, 3) outward normals of the half-spaces of A, (k,) how deep B reaches into each [m]), but for rounding."""
    normals, offsets = planes_of(A, X_WA)
    return normals, offsets + B.extents(X_WB, -normals)[0]


def planes_of(A: CompoundParts, X_WA: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((k, 3) outward normals of the half-spaces of A in the world, (k,) offsets of their planes [m]), but for
    rounding."""
    which = np.flatnonzero(~np.isnan(A.columns.plane))
    X = A.placed(which, np.broadcast_to(X_WA, (len(which), 4, 4)), np.zeros(len(which))).X
    planes = np.array([A.parts[k].bound.params[:4] for k in which.tolist()])
    lengths = np.sqrt(np.square(planes[:, :3]).sum(axis=1))
    normals = np.einsum("kij,kj->ki", X[:, :3, :3], planes[:, :3]) / lengths[:, None]
    return normals, planes[:, 3] / lengths + (normals * X[:, :3, 3]).sum(axis=1)


def _shortest_way(normals: np.ndarray, depths: np.ndarray) -> np.ndarray | None:
    """The shortest x other than 0 with normals · x ≥ depths, but for rounding; ``None`` where no x is found.

    The shortest x is the nearest point to 0 of a plane, or of the intersection of two or three planes.
    """
    best = None
    for n in (1, 2, 3):
        for some in map(list, itertools.combinations(range(len(depths)), n)):
            x = np.linalg.pinv(normals[some]) @ depths[some]
            length = float(np.linalg.norm(x))
            clears = (normals @ x >= depths - 2.0**-40 * (length + np.abs(depths))).all()
            if clears and length > 0.0 and (best is None or length < np.linalg.norm(best)):
                best = x
    return best
