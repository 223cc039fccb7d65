"""Contacts of many pairs of bodies: compounds taken apart, convex pairs answered together, meshes pair by pair."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from collide.contact.contact_rows import CONTACT_DTYPE, Slack, no_rows
from collide.contact.convex_contacts import convex_contacts
from collide.contact.curved_contacts import curved_contacts
from collide.contact.field_contacts import field_contacts
from collide.contact.mesh_contacts import facet_contacts, halfspace_contacts
from collide.contact.near_the_margin import ROUNDING, leeways
from collide.contact.single_contacts import single_contacts_of
from collide.lowering.closed_regions import closed_shapes
from collide.lowering.compound_layout import body_ball
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.shape_set_tables import tables_of
from collide.narrowphase.composite.balls_on_ways import near_on_ways
from collide.narrowphase.composite.composite_parts import CompoundParts, PartColumns, boxes_near, compound_parts
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.dispatch import OF_SETS, OF_UNIONS, Method, cells_of, method_of
from collide.narrowphase.prepared_pairs import Single
from collide.pairs.batches import answer_batch, of_one_set
from collide.pairs.pair_arguments import pose_at
from collide.shapes.shape import Shape
from collide.shapes.shape_set import Picked, ShapeSet, have_any
from collide.transforms import as_poses

#: What makes the contacts of two bodies, by the method that answers the pair; convex sets go together, and unions are
#: taken apart.
_OF_MESHES = {Method.FACETS: facet_contacts, Method.CURVED: curved_contacts, Method.HULL: halfspace_contacts}
_ARE_SETS = cells_of(OF_SETS)
#: Pairs that are quicker by themselves than in a batch; those of lists than in batches of few poses.
_ALWAYS_BY_SINGLE_CALLS = Method.PARTS, Method.CURVED
_BY_SINGLE_CALLS = cells_of((Method.FACETS, *_ALWAYS_BY_SINGLE_CALLS))
#: Unions of more parts, whose tables are kept with every partner, are not made ready for the pairs of a list.
_MAX_KEPT_PARTS = 64


class PartPairs(NamedTuple):
    """m pairs of single bodies at their poses.

    pair : (m,) number of the pair of bodies they are parts of.   part_a, part_b : (m,).   A, B : (m,) shapes' numbers.
    X_WA, X_WB : (m, 4, 4).   slack : (m,) by how much rounding may have moved them towards each other [m].
    """

    pair: np.ndarray
    part_a: np.ndarray
    part_b: np.ndarray
    A: np.ndarray
    B: np.ndarray
    X_WA: np.ndarray
    X_WB: np.ndarray
    slack: np.ndarray

    def take(self, which) -> PartPairs:
        return PartPairs(*(column[which] for column in self))

    def __len__(self) -> int:  # type: ignore[override]
        return len(self.pair)


def contact_batch(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, n: int, margin: float, max_contacts: int, *, check: bool = False,
    threads: int = 1,
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of n pairs: rows of `CONTACT_DTYPE`, pair after pair, and where the rows of each pair end.

    A, B : shapes, or sequences of n shapes.   X_WA, X_WB : (n, 4, 4) or (1, 4, 4), finite.   check : refuse matrices
    other than rotations. Raises InvalidPose, UnsupportedQuery.
    """
    if n == 0:
        return no_rows(), np.zeros(0, dtype=np.int64)
    if have_any(A, "is_field") or have_any(B, "is_field"):
        X_WA, X_WB = (as_poses(X, name, check=check) for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))

        def rows_of(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
            return contact_batch(A, B, X_WA, X_WB, 1, margin, max_contacts)[0]

        return field_contacts(rows_of, A, B, X_WA, X_WB, n, margin)
    A, B = closed_shapes(A, B, X_WA, X_WB, n, margin)
    if not (isinstance(A, Shape) and isinstance(B, Shape)):
        A, B = of_one_set(A, B, n)
    how = None if isinstance(A, Picked) else method_of(kind_of(A), kind_of(B))
    if how in OF_SETS or (how is None and _all_convex(A, B)):
        return convex_contacts(A, B, X_WA, X_WB, margin, max_contacts, check=check, threads=threads)
    if how in OF_UNIONS:
        near = near_on_ways(body_ball(A), body_ball(B), X_WA, X_WB, n, margin=margin, check=check)
        if near is not None and not near.all():
            counts = np.zeros(n, dtype=np.int64)
            X_WA, X_WB = (X if len(X) == 1 else X[near] for X in (X_WA, X_WB))
            rows, ends = contact_batch(
                A, B, X_WA, X_WB, int(np.count_nonzero(near)), margin, max_contacts, threads=threads
            )
            counts[near] = np.diff(ends, prepend=0)
            return rows, np.cumsum(counts)
    X_WA, X_WB = (as_poses(X, name, check=check) for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))
    # A single call of two shapes comes here where its kernel has left it open.
    if (n > 1 or how is None) and (asks := _single_calls(A, B, n, how)):
        return _by_single_calls(asks, A, B, X_WA, X_WB, n, margin, max_contacts, threads)
    return _by_methods(A, B, X_WA, X_WB, n, margin, max_contacts, threads)


def _single_calls(A, B, n: int, how: Method | None) -> dict[int, Single]:
    """{number of a pair: its kernel of single calls}, of pairs that have no kernel of batches as quick."""
    if not isinstance(A, Picked):
        ask = single_contacts_of(A, B) if how in _ALWAYS_BY_SINGLE_CALLS else None
        return {} if ask is None else dict.fromkeys(range(n), ask)
    kinds, shapes = tables_of(A.shape_set).kinds, A.shape_set.shapes
    is_small = cache(lambda a: len(compound_parts(shapes[a]).parts) <= _MAX_KEPT_PARTS)
    known = cache(lambda a, b: single_contacts_of(shapes[a], shapes[b]) if is_small(a) and is_small(b) else None)
    some = np.flatnonzero(_BY_SINGLE_CALLS[kinds[A.rows], kinds[B.rows]]).tolist()
    asks = {k: known(int(A.rows[k]), int(B.rows[k])) for k in some}
    return {k: ask for k, ask in asks.items() if ask is not None}


def _by_methods(
    A, B, X_WA, X_WB, n: int, margin: float, max_contacts: int, threads: int
) -> tuple[np.ndarray, np.ndarray]:
    """`contact_batch` of checked poses: of two shapes, one of them a mesh, in a batch; of others part by part."""
    how = None if isinstance(A, Picked) else method_of(kind_of(A), kind_of(B))
    if how not in _OF_MESHES:
        return _by_parts(A, B, X_WA, X_WB, n, margin, max_contacts, threads)
    rows, ends = _OF_MESHES[how](A, B, X_WA, X_WB, margin, max_contacts, None, threads)
    of_pair = np.repeat(np.arange(n), np.diff(ends, prepend=0))
    return _only_within_margin(rows, of_pair, n, A, B, X_WA, X_WB, margin)


def _by_parts(
    A, B, X_WA, X_WB, n: int, margin: float, max_contacts: int, threads: int
) -> tuple[np.ndarray, np.ndarray]:
    """`contact_batch` of checked poses, with all pairs of parts in few batches."""
    shapes: tuple[Shape, ...] = (A, B)
    which = None
    if isinstance(A, Picked):
        shapes, which = A.shape_set.shapes, np.stack([A.rows, B.rows], axis=1)
    singles: list[Shape] = []
    part_pairs = _part_pairs(shapes, which, X_WA, X_WB, n, margin, singles)
    if not len(part_pairs):
        return no_rows(), np.zeros(n, dtype=np.int64)
    every = np.arange(n)
    leeway = np.broadcast_to(leeways(_reaches(A, every) + _reaches(B, every), X_WA, X_WB), n).copy()
    np.maximum.at(leeway, part_pairs.pair, part_pairs.slack)
    rows, ends = _rows_of_parts(singles, part_pairs, leeway[part_pairs.pair], margin, max_contacts, threads)
    starts = np.concatenate([[0], ends[:-1]])
    of_pair = np.repeat(part_pairs.pair, ends - starts)
    rows["part_a"] = np.repeat(part_pairs.part_a, ends - starts)
    rows["part_b"] = np.repeat(part_pairs.part_b, ends - starts)
    _number_patches(rows, of_pair)
    return _only_within_margin(rows, of_pair, n, A, B, X_WA, X_WB, margin)


def _by_single_calls(
    asks: dict[int, Single], A, B, X_WA, X_WB, n: int, margin: float, max_contacts: int, threads: int
) -> tuple[np.ndarray, np.ndarray]:
    """`contact_batch` of checked poses by kernels of single calls; all else, and what they leave open, in one batch."""
    X_WA, X_WB = (np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in (X_WA, X_WB))
    answers = ((k, ask(X_WA[k], X_WB[k], max_contacts, margin)) for k, ask in asks.items())
    pieces: dict[int, bytes] = {k: rows for k, rows in answers if rows is not None}
    is_open = [k for k in range(n) if k not in pieces]
    if is_open:
        A, B = (S if isinstance(S, Shape) else S[np.array(is_open)] for S in (A, B))
        rows, ends = _by_methods(A, B, X_WA[is_open], X_WB[is_open], len(is_open), margin, max_contacts, threads)
        pieces |= {k: some.tobytes() for k, some in zip(is_open, np.split(rows, ends))}
    rows = np.frombuffer(bytearray().join(pieces[k] for k in range(n)), dtype=CONTACT_DTYPE)
    return rows, np.cumsum([len(pieces[k]) // CONTACT_DTYPE.itemsize for k in range(n)])


def _only_within_margin(
    rows, of_pair, n: int, A, B, X_WA, X_WB, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of the pairs within the margin."""
    keep = _within_margin(rows, of_pair, A, B, X_WA, X_WB, margin)
    if not keep.all():
        rows, of_pair = rows[keep], of_pair[keep]
    return rows, np.cumsum(np.bincount(of_pair, minlength=n))


def _all_convex(A: Picked, B: Picked) -> bool:
    single = tables_of(A.shape_set).single_convex
    return bool(single[A.rows].all() and single[B.rows].all())


def _part_pairs(shapes, which, X_WA, X_WB, n: int, margin: float, singles: list[Shape]) -> PartPairs:
    """Pairs of parts that come within the margin, sorted by pair and parts. singles : becomes the shapes numbered."""
    numbers: dict[int, int] = {}

    def number(shape: Shape) -> int:
        if id(shape) not in numbers:  # held by the shapes asked about
            numbers[id(shape)] = len(singles)
            singles.append(shape)
        return numbers[id(shape)]

    def numbered(parts: CompoundParts, some: np.ndarray) -> np.ndarray:
        used, places = np.unique(some, return_inverse=True)
        return np.array([number(parts.parts[k].shape) for k in used.tolist()], dtype=np.int64)[places]

    keys = np.zeros(n, dtype=np.int64) if which is None else which[:, 0] * len(shapes) + which[:, 1]
    of_keys: list[PartPairs] = []
    for key in np.unique(keys).tolist():
        poses = np.flatnonzero(keys == key)
        A, B = (shapes[0], shapes[1]) if which is None else (shapes[k] for k in which[poses[0]])
        X_WAs, X_WBs = (np.broadcast_to(X, (n, 4, 4))[poses] for X in (X_WA, X_WB))
        near = _near_parts(compound_parts(A), compound_parts(B), X_WAs, X_WBs, margin)
        numbers_a, numbers_b = numbered(compound_parts(A), near.part_a), numbered(compound_parts(B), near.part_b)
        of_keys.append(PartPairs(poses[near.pair], near.part_a, near.part_b, numbers_a, numbers_b, *near[5:]))
    together = PartPairs(*(np.concatenate(columns) for columns in zip(*of_keys)))
    return together.take(np.lexsort((together.part_b, together.part_a, together.pair)))


def _near_parts(A: CompoundParts, B: CompoundParts, X_WA: np.ndarray, X_WB: np.ndarray, margin: float) -> PartPairs:
    """Pairs of parts that may come within the margin at n poses (n, 4, 4), without numbers of shapes.

    Only parts whose boxes come near are posed. About a microsecond a part and pose, and half a microsecond a near pair
    of parts; all pairs with half-spaces count as near.
    """
    apart = np.sqrt(np.square(X_WB[:, :3, 3] - X_WA[:, :3, 3]).sum(axis=1))
    pose, i, j = boxes_near(A, B, X_WA, X_WB, margin)
    at_a = A.placed(i, X_WA[pose], B.reach + apart[pose])
    at_b = B.placed(j, X_WB[pose], A.reach + apart[pose])
    slack = at_a.slop + at_b.slop
    near = _may_come_within(A.columns, B.columns, i, j, at_a.X, at_b.X, margin + slack)
    none = np.zeros(len(pose), dtype=np.int64)
    return PartPairs(pose, i, j, none, none, at_a.X, at_b.X, slack).take(near)


def _may_come_within(a: PartColumns, b: PartColumns, i, j, X_WA, X_WB, limit: np.ndarray) -> np.ndarray:
    """(m,) bool: whether balls around two parts come within a limit (m,)."""
    apart = np.sqrt(np.square(X_WB[:, :3, 3] - X_WA[:, :3, 3]).sum(axis=1))
    stretched = (1.0 + 1e-3) * (a.reach[i] + b.reach[j])  # poses stretch by 1e-4 at largest
    reach = stretched + a.radius[i] + b.radius[j] + a.slop[i] + b.slop[j]
    return (apart * (1.0 - 2.0**-40) <= reach + limit) | ~np.isnan(a.plane[i]) | ~np.isnan(b.plane[j])


def _rows_of_parts(
    singles: list[Shape], pairs: PartPairs, leeway: np.ndarray, margin: float, max_contacts: int, threads: int
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of pairs of parts: convex pairs together, pairs with meshes batch by batch for two shapes. Pairs of
    equal leeways, no less than their slacks, go into a batch; of meshes those at exact poses by themselves."""
    kinds = np.array([kind_of(shape) for shape in singles])
    counts = np.zeros(len(pairs), dtype=np.int64)
    blocks, owners = [no_rows()], [np.zeros(0, dtype=np.int64)]
    keys = np.where(_ARE_SETS[kinds[pairs.A], kinds[pairs.B]], -1, pairs.A * len(singles) + pairs.B)
    shape_set, are_moved = ShapeSet(singles), (keys >= 0) & (pairs.slack > 0.0)
    for key, largest, is_moved in np.unique(np.stack([keys, leeway, are_moved], axis=1), axis=0).tolist():
        which = np.flatnonzero((keys == key) & (leeway == largest) & (are_moved == is_moved))
        some = pairs.take(which)
        X_WA, X_WB = np.ascontiguousarray(some.X_WA), np.ascontiguousarray(some.X_WB)
        slack = Slack(np.ascontiguousarray(some.slack), largest)
        if key < 0:
            A, B = Picked(shape_set, some.A), Picked(shape_set, some.B)
            rows, ends = convex_contacts(A, B, X_WA, X_WB, margin, max_contacts, slack=slack, threads=threads)
        else:
            a, b = divmod(int(key), len(singles))
            make, asked = _OF_MESHES[method_of(kinds[a], kinds[b])], slack if is_moved else None
            rows, ends = make(singles[a], singles[b], X_WA, X_WB, margin, max_contacts, asked, threads)
        counts[which] = np.diff(ends, prepend=0)
        if is_moved:
            rows["lower"] -= np.repeat(some.slack, counts[which])
            rows["upper"] += np.repeat(some.slack, counts[which])
        blocks.append(rows)
        owners.append(np.repeat(which, counts[which]))
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(blocks)[order], np.cumsum(counts)


def _number_patches(rows: np.ndarray, of_pair: np.ndarray) -> None:
    """Patches of each pair are counted on, from part to part."""
    if not len(rows):
        return
    keys = np.stack([of_pair, rows["part_a"], rows["part_b"], rows["patch"]], axis=1)
    begins = np.concatenate([[True], (keys[1:] != keys[:-1]).any(axis=1)])
    number = np.cumsum(begins)
    first = np.concatenate([[True], of_pair[1:] != of_pair[:-1]])
    rows["patch"] = number - np.repeat(number[first], np.diff(np.flatnonzero(np.append(first, True))))


def _within_margin(rows, of_pair, A, B, X_WA, X_WB, margin: float) -> np.ndarray:
    """(k,) bool: rows of pairs within the margin.

    Facets, and parts with rounded poses, are asked a little beyond the margin; where the excess matters, `distance`
    decides.
    """
    keep = np.ones(len(rows), dtype=bool)
    if not len(rows):
        return keep
    starts = np.flatnonzero(np.diff(of_pair, prepend=-1))
    pairs, ends = of_pair[starts], np.append(starts[1:], len(rows))
    across = np.abs(_some(X_WB, pairs)[:, :3, 3] - _some(X_WA, pairs)[:, :3, 3]).sum(axis=1)
    size = 4.0 * (_reaches(A, pairs) + _reaches(B, pairs)) + across
    near = np.minimum.reduceat(rows["upper"], starts) > margin - ROUNDING * size
    for i in np.flatnonzero(near).tolist():
        k = int(pairs[i])
        shape_a, shape_b = (A, B) if isinstance(A, Shape) else (A[k], B[k])
        X_A, X_B = pose_at(X_WA, k), pose_at(X_WB, k)
        row = answer_batch(shape_a, shape_b, X_A[None], X_B[None], Question(False, math.inf))
        if row["lower"][0] > margin:
            keep[starts[i] : ends[i]] = False
    return keep


def _some(X: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Poses of some pairs."""
    return X if len(X) == 1 else X[pairs]


def _reaches(shapes, pairs: np.ndarray):
    """How far the shapes of some pairs reach from their origins [m]: a number, or one a pair."""
    if isinstance(shapes, Shape):
        return compound_parts(shapes).reach
    return np.array([compound_parts(shapes[k]).reach for k in pairs.tolist()])
