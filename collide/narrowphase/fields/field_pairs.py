"""A field (point cloud, voxel grid, octree, large terrain, mesh with thickness) and another shape, at n pairs of poses.

Convex sets, and the parts of unions of these, walk to the nearest items (`item_walks.py`, `convex_walk_kernel.py`);
clouds and meshes ask points for facets (`clouds_and_meshes.py`). Open rests, and all other questions (depths,
half-spaces, other fields), go to the union of the items within the upper bound of the gap, or within the depth, of a
box around the other shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.facet_bodies import body_of, has_facets
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.lowering.packed_convex import HALFSPACE, PackedConvex
from collide.lowering.parts import convex_set_of, is_single_convex, parts_of
from collide.lowering.shape_table import moved_pose
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.facets.facet_kernel_calls import body_rows, states
from collide.narrowphase.facets.mesh_collide_kernel import HIT
from collide.narrowphase.facets.mesh_collide_kernel import OPEN as UNTOLD
from collide.narrowphase.facets.nearest_item_calls import gap_rows, prepared_items, surface_states
from collide.narrowphase.facets.touching_facets import PosedPart, settle_rows, settle_states
from collide.narrowphase.fields import clouds_and_meshes
from collide.narrowphase.fields.ball_walk_kernel import MEETS, OPEN, WORK, clouds_meet_balls
from collide.narrowphase.fields.field_items import BoxAround, FieldItems, box_in_frame, lowest_items
from collide.narrowphase.fields.items_of import items_of
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE, UNDECIDED, flipped
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Halfspace
from collide.shapes.shape import IDENTITY, Shape
from collide.shapes.swept_mesh import SweptMesh

#: Items of which a union is made to tell a depth; and by how much a way out is longer than it needs to be, as a part
#: of it.
_MAX_ITEMS, _BEYOND = 1024, 2.0**-40
#: The same beside another field, every item of which is asked as well.
_MAX_OF_FIELDS = 64
#: Stands for the exponent of what rounding moves where poses are exact.
_EXACT = -(1 << 20)
#: Rows of two shapes: ``rows_of_pair(A, B, X_WA, X_WB, limit, depths=)``.
RowsOfPair = Callable[..., np.ndarray]


def answer_field(
    rows_of: RowsOfPair, out: np.ndarray, A: Shape, B: Shape, poses: tuple[np.ndarray, np.ndarray], question: Question
) -> None:
    """Answers of a field and another shape, in either order, at checked poses (n, 4, 4).

    rows_of : what answers two other shapes.   out, question : as of `convex_batches.answer_sets`.
    """
    if not A.is_field:
        rows = np.zeros_like(out)
        answer_field(rows_of, rows, B, A, poses[::-1], question)
        out[:] = rows if question.boolean else flipped(rows)
        return
    X_WA, X_WB = (np.ascontiguousarray(X) for X in poses)
    items, is_open = items_of(A), np.ones(len(out), dtype=bool)
    if isinstance(A, SweptMesh):
        if (has_facets(B) or isinstance(B, SweptMesh)) and len(out):
            is_open = _facets_answer(out, A, B, X_WA, X_WB, question)
    elif isinstance(A, PointCloud) and kind_of(B) is Kind.MESH and len(out):
        is_open = _mesh_answers(rows_of, out, A, B, X_WA, X_WB, question)
    elif items.walked is not None and len(out) and (walks(B) or _is_of_parts(B)):
        if question.boolean:
            meets, apart = _walked(items, B, X_WA, X_WB)
            out[meets] = True
            is_open = ~(meets | apart)
        else:
            near = np.arange(len(out))
            if question.limit < math.inf:
                _, beyond = _walked(items, B, X_WA, X_WB, max(question.limit, 0.0))
                out[beyond] = _beyond(max(question.limit, 0.0))
                near = np.flatnonzero(~beyond)
            rows, is_written = _walked_rows(items, B, X_WA[near], X_WB[near], question.depths)
            out[near[is_written]] = _beyond_limit(rows[is_written], question.limit)
            is_open[:] = False
            is_open[near[~is_written]] = True
    for k in np.flatnonzero(is_open).tolist():
        row = _union_row(rows_of, A, B, X_WA[k : k + 1], X_WB[k : k + 1], question)
        out[k] = bool(row["hit"][0]) if question.boolean else _beyond_limit(row, question.limit)[0]


def _facets_answer(
    out: np.ndarray, A: SweptMesh, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question
) -> np.ndarray:
    """(n,) bool: which poses of a swept mesh and a body of facets are left open; all others are answered."""

    def parts_at(k: int) -> tuple[PosedPart, PosedPart]:
        return PosedPart(A, X_WA[k]), PosedPart(B, X_WB[k])

    if question.boolean:
        answers = states(body_of(A), body_of(B), X_WA, X_WB)
        settle_states(answers, parts_at)
        out[answers == HIT] = True
        return answers == UNTOLD
    rows = body_rows(body_of(A), body_of(B), X_WA, X_WB, limit=question.limit, depths=question.depths)
    settle_rows(rows, parts_at, question.limit)
    out[:] = rows
    return rows["how"] == UNDECIDED


def _mesh_answers(
    rows_of: RowsOfPair, out: np.ndarray, A: PointCloud, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray,
    question: Question,
) -> np.ndarray:
    """The same of a point cloud and a mesh."""
    walked = items_of(A).walked
    assert walked is not None
    pair = clouds_and_meshes.CloudAndMesh(A, walked, B, X_WA, X_WB)
    if question.boolean:
        states = pair.states()
        out[:] = states == clouds_and_meshes.MEETS
        return states == clouds_and_meshes.OPEN
    rows, is_written = pair.gaps(max(question.limit, 0.0))
    out[is_written] = _beyond_limit(rows[is_written], question.limit)
    for k in np.flatnonzero(~is_written & (pair.meeting >= 0)).tolist() if not question.depths else ():
        row = _Nearby(rows_of, items_of(A), B, X_WA[k : k + 1], X_WB[k : k + 1]).row(pair.meeting[k : k + 1], False)
        out[k], is_written[k] = row[0], bool(row["hit"][0])
    return ~is_written


def _is_of_parts(B: Shape) -> bool:
    """Whether a shape is a union of convex sets with an end."""
    return kind_of(B) is Kind.COMPOUND and all(packed.kind != HALFSPACE for packed, _ in parts_of(B))


class _PosedPart(NamedTuple):
    """A convex set of a shape, widened by what rounding may move it, at the poses of some questions, by row."""

    number: int
    packed: PackedConvex
    rows: np.ndarray
    X_WG: np.ndarray
    X_WP: np.ndarray


def _posed_parts(items: FieldItems, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> Iterator[_PosedPart]:
    """The parts of a shape beside items. A part is widened by a power of two: an answer depends on its pose alone,
    not on poses asked together.
    """
    X_WG, slop_of_items = items.poses_of_items(X_WA)
    for k, (packed, X_BP) in enumerate(parts_of(B)):
        X_WP, slop = moved_pose(X_WB, X_BP, np.full(len(X_WB), packed.reach))
        off = np.broadcast_to(slop + slop_of_items, len(X_WB))
        if not off.any():
            yield _PosedPart(k, packed, np.arange(len(X_WB)), X_WG, X_WP)
            continue
        exponents = np.frexp(2.0 * off)[1]
        for exponent in np.unique(np.where(off > 0.0, exponents, _EXACT)).tolist():
            rows = np.flatnonzero(off == 0.0 if exponent == _EXACT else (off > 0.0) & (exponents == exponent))
            slop_of_part = packed.slop + (0.0 if exponent == _EXACT else math.ldexp(1.0, exponent))
            widened = packed if slop_of_part == packed.slop else packed._replace(slop=slop_of_part)
            yield _PosedPart(k, widened, rows, X_WG[rows], X_WP[rows])


def _walked(
    items: FieldItems, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, margin: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) bool each: whether items with a tree and a shape of convex parts meet, and whether they are farther apart
    than a margin [m]; else open.
    """
    assert items.walked is not None
    meets, apart = np.zeros(len(X_WA), dtype=bool), np.ones(len(X_WA), dtype=bool)
    for part in _posed_parts(items, B, X_WA, X_WB):
        rows, X_WG, X_WP = part.rows, part.X_WG, part.X_WP
        if part.number and meets.any():
            some = ~meets[rows]
            rows, X_WG, X_WP = rows[some], X_WG[some], X_WP[some]
        if len(rows):
            walk = surface_states(items.walked, part.packed, X_WG, X_WP, margin)
            meets[rows[walk.meets]] = True
            apart[rows] &= walk.apart
    return meets, apart


def _walked_rows(
    items: FieldItems, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, depths: bool
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, (n,) bool whether they are written) of items with a tree and a shape of convex parts: of the nearest part,
    its bracket that of the least distance of all parts.
    """
    assert items.walked is not None
    out, is_written = np.zeros(len(X_WA), dtype=PAIR_DTYPE), np.ones(len(X_WA), dtype=bool)
    for part in _posed_parts(items, B, X_WA, X_WB):
        rows, written = gap_rows(items.walked, part.packed, part.X_WG, part.X_WP, depths)
        rows["part_b"] = part.number
        rows["part_a"] = items.names_of_walked(rows, part.X_WG)
        is_written[part.rows] &= written
        out[part.rows] = _nearer(out[part.rows], rows) if part.number else rows
    return out, is_written


def _nearer(before: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(n,) the nearer of each two rows, its bracket a bracket of the least distance of both."""
    is_nearer = rows["hit"] & ~before["hit"] | (rows["hit"] == before["hit"]) & (rows["distance"] < before["distance"])
    nearest, farther = np.where(is_nearer, rows, before), np.where(is_nearer, before, rows)
    nearest["lower"] = np.minimum(nearest["lower"], farther["lower"])
    is_rival = farther["lower"] <= nearest["upper"]
    nearest["certified"] &= nearest["hit"] | farther["certified"] | ~is_rival
    nearest["upper"] = np.minimum(nearest["upper"], farther["upper"])
    return nearest


def are_balls(A: Shape, B: Shape) -> bool:
    """Whether a pair is a cloud of equal balls and a ball."""
    cloud, ball_shape = (A, B) if isinstance(A, PointCloud) else (B, A)
    is_uniform = isinstance(cloud, PointCloud) and np.ndim(cloud.radius) == 0
    return is_uniform and kind_of(ball_shape) is Kind.SPHERE


def answer_balls(
    rows_of: RowsOfPair, out: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question
) -> bool:
    """Booleans of a cloud of equal balls and a ball; False where a matrix is no pose.

    out, poses : as of `convex_batches.answer_sets`.
    """
    if not isinstance(A, PointCloud):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    assert isinstance(A, PointCloud)
    packed, n, work = convex_set_of(B), len(out), np.empty(WORK)
    states, centre = np.empty(n, dtype=np.uint8), np.ascontiguousarray(packed.points[0])
    (XA, step_a), (XB, step_b) = ((np.ascontiguousarray(X), 16 * (len(X) > 1)) for X in (X_WA, X_WB))
    done = clouds_meet_balls(
        A.tree.address, A.radius, address_of(centre), packed.radius, address_of(XA), step_a, address_of(XB), step_b, n,
        question.check, address_of(states), address_of(work),
    )
    if done < n:
        return False
    out[:] = states == MEETS
    for k in np.flatnonzero(states == OPEN).tolist():
        X_A, X_B = (X[k : k + 1] if len(X) > 1 else X for X in (XA, XB))
        out[k] = bool(_union_row(rows_of, A, B, X_A, X_B, question)["hit"][0])
    return True


def walks(shape: Shape) -> bool:
    """Whether a shape is a convex set with an end."""
    return is_single_convex(shape) and not isinstance(shape, Halfspace)


def prepare_field(A: Shape, B: Shape) -> Prepared | None:
    """A field and a convex set with an end made ready for single calls; ``None`` of other pairs."""
    exchanged = not A.is_field
    field, shape = (B, A) if exchanged else (A, B)
    items = items_of(field)
    if not walks(shape) or items.walked is None or items.X_FG is not IDENTITY:
        return None
    prepared = prepared_items(items.walked, convex_set_of(shape), exchanged)
    if items.names_are_changed:
        prepared.distance = None
    return prepared


def _beyond(limit: float) -> np.ndarray:
    """The row of bodies that are farther apart than a limit [m], and no more is known."""
    row = np.zeros(1, dtype=PAIR_DTYPE)
    row["lower"] = row["distance"] = math.nextafter(limit, math.inf)
    row["upper"], row["beyond"], row["certified"] = math.inf, True, True
    return row


def _beyond_limit(rows: np.ndarray, limit: float) -> np.ndarray:
    """Rows farther apart than a limit [m] say no more than that they are."""
    beyond = rows["lower"] > limit
    rows["beyond"], rows["certified"] = beyond, rows["certified"] | beyond
    rows["distance"][beyond], rows["upper"][beyond] = rows["lower"][beyond], math.inf
    return rows


# --- unions of the items nearby ------------------------------------------------------------------


def _union_row(
    rows_of: RowsOfPair, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question
) -> np.ndarray:
    """The row of a field and another shape at a pair of poses (1, 4, 4)."""
    nearby = _Nearby(rows_of, items_of(A), B, X_WA, X_WB)
    if isinstance(B, Halfspace):
        some = lowest_items(nearby.items, X_WB[0, :3, :3] @ B.normal, X_WA[0], X_WB[0])
        return nearby.row(some, question.depths)
    box = box_in_frame(B, nearby.items.pose(X_WA[0]), X_WB[0])
    some = nearby.items.within(box, 0.0)
    row = nearby.row(some, False) if len(some) else None
    if row is not None and row["hit"][0]:
        return row if question.boolean or not question.depths else _depth(nearby, some, box, row)
    if question.boolean:
        return np.zeros(1, dtype=PAIR_DTYPE) if row is None else row
    first = nearby.row(nearby.items.nearest(box), False) if row is None else row
    return nearby.row(nearby.items.within(box, float(first["upper"][0])), False)


class _Nearby(NamedTuple):
    """A field's items and another shape at a pair of poses (1, 4, 4)."""

    rows_of: RowsOfPair
    items: FieldItems
    B: Shape
    X_WA: np.ndarray
    X_WB: np.ndarray

    def meets(self, some: np.ndarray) -> bool:
        """Whether the other shape meets an item; among some items are all that may be met."""
        if self.items.walked is not None and (walks(self.B) or _is_of_parts(self.B)):
            meets, apart = _walked(self.items, self.B, self.X_WA, self.X_WB)
            if meets[0] or apart[0]:
                return bool(meets[0])
        return bool(self.row(some, False)["hit"][0])

    def row(self, some: np.ndarray, depths: bool) -> np.ndarray:
        """The row of some items and the other shape; of another field with its items that may be nearest."""
        _, items, B, X_WA, X_WB = self
        union = items.merged(some)
        if B.is_field:  # the other field stands first, and sees a union
            row = np.zeros(1, dtype=PAIR_DTYPE)
            answer_field(self.rows_of, row, B, union.shape, (X_WB, X_WA), Question(False, math.inf, depths))
            row = flipped(row)
        else:
            row = self.rows_of(union.shape, B, X_WA, X_WB, math.inf, depths=depths)
        if not (union.names_facets and depths and row["hit"][0]):  # depths name no facet of a mesh
            row["part_a"] = items.name(union, row["part_a"], (row["point_a"] - X_WA[:, :3, 3]) @ X_WA[0, :3, :3])
        row["vertices_a"], row["count"] = -1, 0
        return row


def _depth(nearby: _Nearby, some: np.ndarray, box: BoxAround, hit: np.ndarray) -> np.ndarray:
    """The row of an overlap: all items within its depth have a say, or, of very many, all that are in the way out.

    hit : the row without a depth.
    """
    asked, max_items = some, _MAX_OF_FIELDS if nearby.B.is_field else _MAX_ITEMS
    while len(some) <= max_items or nearby.items.is_one_part:
        row = nearby.row(some, True)
        depth = max(-float(row["lower"][0]), -float(row["distance"][0]), 0.0)
        more = nearby.items.within(box, depth)
        if len(more) <= len(some):
            return row
        asked, some = some, more
    return _out_of_box(nearby, hit, box) if nearby.B.is_field else _way_out(nearby, asked, box, hit)


def _way_out(nearby: _Nearby, some: np.ndarray, box: BoxAround, hit: np.ndarray) -> np.ndarray:
    """The row of a translation between B and all items: of some items first, then also of further items met behind the
    translation, as long as B meets any. For too many items the translation goes along an axis of the items' frame, out
    of the box around all items.

    The lower bound of the depth is the bound of the items asked.
    """
    items = nearby.items
    some = np.union1d(some[:: -(-len(some) // _MAX_ITEMS)], hit["part_a"])
    while True:
        row = nearby.row(some, True)
        if not row["hit"][0]:  # none of these items meets B
            return _out_of_box(nearby, hit, box)
        moved = nearby.X_WB.copy()
        moved[0, :3, 3] += row["normal"][0] * (-float(row["distance"][0]) * (1.0 + _BEYOND) + _BEYOND)
        met = np.setdiff1d(items.within(box_in_frame(nearby.B, items.pose(nearby.X_WA[0]), moved[0]), 0.0), some)
        if not len(met) or not nearby._replace(X_WB=moved).meets(met):
            return row
        if len(some) + len(met) > _MAX_ITEMS:
            met = met[:: -(-len(met) // max(len(some), 1))]
        if len(some) + len(met) > 4 * _MAX_ITEMS:
            return _out_of_box(nearby, row, box)
        some = np.union1d(some, met)


def _out_of_box(nearby: _Nearby, row: np.ndarray, box: BoxAround) -> np.ndarray:
    """A row with a translation along an axis of the items' frame, out of the box around all items."""
    items = nearby.items
    ways = np.concatenate([items.high - box.low, box.high - items.low])
    k = int(np.argmin(ways))
    normal = items.pose(nearby.X_WA[0])[:3, k % 3] * (1.0 if k < 3 else -1.0)
    length = float(ways[k]) * (1.0 + _BEYOND) + _BEYOND
    row["distance"], row["lower"], row["normal"], row["certified"] = -length, -length, normal, False
    row["upper"], row["hit"] = np.minimum(row["upper"], 0.0), True
    row["point_a"] = row["point_b"] + length * normal
    return row
