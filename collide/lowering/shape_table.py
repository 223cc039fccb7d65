"""Layout of the kernels' flat tables: a row a shape, a row a posed part.

Rows are flat because nine arrays cost 500 ns a call in Python and four addresses cost 170.
"""

from __future__ import annotations

import copy
from bisect import bisect_left
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.lazy_structures import may_have_tree, support_tree_of
from collide.lowering.lowered_sets import ChainedSets, LoweredSets, ranks_of
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.set_rows import (
    ADDRESS,
    COARSE_AT,
    COUNT,
    INTS,
    KIND,
    LOWEST,
    NUMBERS,
    PADDED,
    PARAMS,
    RADIUS,
    RANK,
    REACH,
    SLOP,
    TREE,
    write_row,
)

# One row of doubles a posed part: R row by row (9), t (3), slop of the pose (1), the row of the exact terms where R and
# t are a rounded product of two poses (1), else −1, and how much R lengthens a vector at most (1), −1 until a kernel
# asks.
POSE = 15
POSE_SLOP, POSE_TERMS, POSE_STRETCH = 12, 13, 14
#: Doubles whose sum is one entry of a product of two poses: three products, each in two parts, and a shift.
TERMS = 7
#: A row of them: the terms of the 12 entries, then what each entry is more than the row of the pose says (12).
LOW_PARTS = 12 * TERMS
TERM_ROW = LOW_PARTS + 12

#: Rounding of a part's world pose when it is a product of two: at most 4u of its terms an entry, so
#: 4√3u·reach for the rotation and as much for the shift; doubled.
PRODUCT_SLOP = 16 * 2.0**-53

__all__ = [
    "ADDRESS", "COARSE_AT", "COUNT", "INTS", "KIND", "LOWEST", "NUMBERS", "PADDED", "PARAMS", "POSE", "RADIUS", "RANK",
    "REACH", "SLOP", "TREE", "PoseTable", "ShapeTable", "has_own_pose", "moved_pose", "pose_table",
]

#: Once rows are added, ranks are so far apart that others go between them.
_RANK_STEP = 1 << 32


class ShapeTable:
    """Distinct convex sets, row by row, with everything they point to kept alive.

    Support trees are made when a row is first to be asked about: `plant`.

    ``rank`` orders the rows by content, so a pair and its swapped pair are worked on in the same order: swapped
    answers are the exact mirror of each other.
    """

    def __init__(self, packed: list[PackedConvex]):
        self.packed: Any = []
        self.ints, self.numbers = np.empty((len(packed), INTS), dtype=np.int64), np.empty((len(packed), NUMBERS))
        self._without_tree: set[int] = set()
        self._contents: list[bytes] = sorted({p.content for p in packed})
        self._ranks: list[int] = [*range(len(self._contents))]
        self._write(packed)

    @classmethod
    def of_bodies(cls, bodies: Sequence[LoweredSets]) -> ShapeTable:
        """The sets of bodies in turn, copied from their rows. The table takes no further rows."""
        table = cls([])
        table.packed = ChainedSets(bodies)
        table.ints, table.numbers = (
            np.concatenate([getattr(body, name) for body in bodies]) for name in ("ints", "numbers")
        )
        table.ints[:, RANK] = ranks_of(b"".join([body.contents for body in bodies]))
        first = 0
        for body in bodies:
            table._without_tree.update([first + k for k in body.with_tree])
            first += len(body)
        table.addresses = address_of(table.ints), address_of(table.numbers)
        return table

    def copied(self) -> ShapeTable:
        """A table of the same rows, to which others can be added."""
        made = copy.copy(self)
        made.packed, made._contents, made._ranks = list(self.packed), list(self._contents), list(self._ranks)
        made._without_tree = set(self._without_tree)  # first: another thread may be writing a tree's address
        made.ints, made.numbers = self.ints.copy(), self.numbers.copy()
        made.addresses = address_of(made.ints), address_of(made.numbers)
        return made

    def append(self, packed: list[PackedConvex]) -> None:
        """Add rows: O(log n) each, and the copy of all rows where memory has run out."""
        n = len(self.packed) + len(packed)
        if n > len(self.ints):
            capacity = n + max(len(self.packed), 16)
            for name in ("ints", "numbers"):
                rows = getattr(self, name)
                grown = np.zeros((capacity, rows.shape[1]), dtype=rows.dtype)
                grown[: len(self.packed)] = rows[: len(self.packed)]
                setattr(self, name, grown)
        is_ranked_anew = False
        for content in sorted({p.content for p in packed}):
            at = bisect_left(self._contents, content)
            if self._contents[at : at + 1] != [content]:
                below = self._ranks[at - 1] if at else -_RANK_STEP
                above = self._ranks[at] if at < len(self._ranks) else below + 2 * _RANK_STEP
                self._contents.insert(at, content)
                self._ranks.insert(at, (below + above) // 2)
                is_ranked_anew = is_ranked_anew or not below < self._ranks[at] < above
        if is_ranked_anew:
            self._ranks = [rank * _RANK_STEP for rank in range(len(self._contents))]
        self._write(packed)
        if is_ranked_anew:
            self.ints[: len(self.packed), RANK] = [self._rank_of(p) for p in self.packed]

    def _write(self, packed: list[PackedConvex]) -> None:
        """Rows behind the present rows."""
        first = len(self.packed)
        self.packed.extend(packed)
        for k, p in enumerate(packed, first):
            write_row(self.ints, self.numbers, k, p, self._rank_of(p))
            if may_have_tree(p):
                self._without_tree.add(k)
        self.addresses = address_of(self.ints), address_of(self.numbers)
        self.faces: Any = None  # `hull_faces.HullFaceTable`, once contacts are asked for

    def _rank_of(self, packed: PackedConvex) -> int:
        return self._ranks[bisect_left(self._contents, packed.content)]

    @property
    def is_built(self) -> bool:
        """Whether no support tree is still to be made."""
        return not self._without_tree

    def build_trees(self, rows: np.ndarray) -> None:
        """Have the support trees of these rows, so far as their shapes are large enough for one."""
        if self._without_tree:
            for k in self._without_tree.intersection(np.unique(rows).tolist()):
                self.ints[k, TREE] = support_tree_of(self.packed[k]).address
            self._without_tree.difference_update(rows.ravel().tolist())


class PoseTable(NamedTuple):
    """Posed parts as the kernels read them.

    rows : (k, POSE).
    terms : (c, TERM_ROW) for the c parts whose pose is a product: entry j of (R row by row, t) is exactly
        the sum of TERMS doubles. What the row holds is that sum, rounded; low parts are the rest, rounded.
    """

    rows: np.ndarray
    terms: np.ndarray

    def __len__(self) -> int:
        return len(self.rows)

    def followed_by(self, following: PoseTable) -> PoseTable:
        """A table of both, with the parts of this table first."""
        rows = np.concatenate([self.rows, following.rows])
        moved = rows[len(self) :, POSE_TERMS]
        moved[moved >= 0.0] += len(self.terms)
        return PoseTable(rows, np.concatenate([self.terms, following.terms]))

    def exact(self, part: int) -> list[Fraction]:
        """The 12 entries of a part's pose without rounding."""
        row = self.rows[part]
        if row[POSE_TERMS] < 0.0:
            return [Fraction(v) for v in row[:12].tolist()]
        terms = self.terms[int(row[POSE_TERMS]), :LOW_PARTS].reshape(12, TERMS)
        return [sum(map(Fraction, entry), Fraction(0)) for entry in terms.tolist()]


def pose_table(
    X_WB: np.ndarray, X_BP: np.ndarray, reach: np.ndarray, has_pose: np.ndarray | None = None, *, terms: bool = True
) -> PoseTable:
    """Poses of k parts in the world.

    X_WB : (k, 4, 4) body poses.   X_BP : (k, 4, 4) the parts' poses in their bodies.   reach : (k,).
    has_pose : (k,) whether X_BP is not the identity, where known.   terms : False where only rounded poses and
    their slops are read, as boxes do.

    A part without a pose of its own keeps the numbers given, bit by bit, and so does one of a body at
    the origin. Elsewhere the product is written out, so that a batch rounds as a single pose does.
    """
    rows = np.empty((len(X_WB), POSE))
    R_WB, p_WB = X_WB[:, :3, :3], X_WB[:, :3, 3]
    rows[:, :9] = R_WB.reshape(-1, 9)
    rows[:, 9:12] = p_WB
    rows[:, POSE_SLOP] = 0.0
    rows[:, POSE_TERMS] = rows[:, POSE_STRETCH] = -1.0
    needs_pose = has_own_pose(X_BP) if has_pose is None else has_pose
    if not needs_pose.any():
        return PoseTable(rows, NO_TERMS)
    identity = np.eye(4)
    unmoved = needs_pose & (X_WB == identity).all(axis=(1, 2))  # a body at the origin: its parts' own poses
    rows[unmoved, :9], rows[unmoved, 9:12] = X_BP[unmoved, :3, :3].reshape(-1, 9), X_BP[unmoved, :3, 3]
    needs_pose = np.flatnonzero(needs_pose & ~unmoved)
    if not len(needs_pose):
        return PoseTable(rows, NO_TERMS)
    R, p, X = R_WB[needs_pose], p_WB[needs_pose], X_BP[needs_pose]
    rows[needs_pose, :9] = _product(R, X[:, :3, :3]).reshape(-1, 9)
    rows[needs_pose, 9:12] = _product(R, X[:, :3, 3:])[:, :, 0] + p
    stretch = np.maximum(1.0, np.abs(R).sum(axis=2).max(axis=1))  # of a matrix that need be no rotation
    parts = reach[needs_pose] + np.abs(X[:, :3, 3]).sum(axis=1)
    rows[needs_pose, POSE_SLOP] = PRODUCT_SLOP * (stretch * parts + np.abs(p).max(axis=1))
    if not terms:
        return PoseTable(rows, NO_TERMS)
    exact_terms, exact = _terms(R, p, X)
    rows[needs_pose[exact], POSE_TERMS] = np.arange(int(exact.sum()))
    exact_terms, rounded = exact_terms[exact], rows[needs_pose[exact], :12]
    return PoseTable(rows, np.hstack([exact_terms.reshape(-1, LOW_PARTS), _low_parts(exact_terms, rounded)]))


def has_own_pose(X_BP: np.ndarray) -> np.ndarray:
    """(k,) bool: poses (k, 4, 4) that are not the identity."""
    return (X_BP != np.eye(4)).any(axis=(1, 2))


def _low_parts(terms: np.ndarray, rounded: np.ndarray) -> np.ndarray:
    """(k, 12) what sums of terms (k, 12, TERMS) are more than these, in twice the precision."""
    total, rest = np.zeros_like(rounded), np.zeros_like(rounded)
    for j in range(TERMS):
        before, total = total, total + terms[:, :, j]
        low_term = total - before
        rest += (before - (total - low_term)) + (terms[:, :, j] - low_term)
    return rest + (total - rounded)


def moved_pose(X_WB: np.ndarray, X_BP: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(poses (n, 4, 4) of parts in the world, (n,) how far rounding may have moved their points [m]).

    X_WB : (n, 4, 4) body poses.   X_BP : (4, 4) the part's pose in it, or (n, 4, 4) of n parts.   reach : (n,) of its
    points from the part's origin. The products are as in `pose_table`; 0 where they are exact, shifts and right
    angles among them.
    """
    is_body = (X_BP == np.eye(4)).all(axis=(-2, -1))
    if is_body.all():
        return X_WB, np.zeros(len(X_WB))
    total, lost = np.zeros((len(X_WB), 3, 4)), np.zeros((len(X_WB), 3, 4), dtype=bool)
    for k in range(4):
        some = slice(0 if k < 3 else 3, 4)  # only the shift has a fourth term
        if k < 3:
            factor_a, factor = X_WB[:, :3, k, None], X_BP[..., None, k, :]
            high, low = _two_products(factor_a, factor)
            lost |= ~((np.abs(high) > SAFE_PRODUCT) | (factor_a == 0.0) | (factor == 0.0)) | (low != 0.0)
        else:
            high = X_WB[:, :3, 3:]
        before = total[:, :, some]
        sum_ = before + high
        back = sum_ - before
        lost[:, :, some] |= (before - (sum_ - back)) + (high - back) != 0.0
        total[:, :, some] = sum_
    exact = ~lost.any(axis=(1, 2))
    out = np.zeros_like(X_WB)
    out[:, :3], out[:, 3, 3] = total, 1.0
    stretch = np.maximum(1.0, np.abs(X_WB[:, :3, :3]).sum(axis=2).max(axis=1))
    parts = reach + np.abs(X_BP[..., :3, 3]).sum(axis=-1)
    slop = PRODUCT_SLOP * (stretch * parts + np.abs(X_WB[:, :3, 3]).max(axis=1))
    if X_BP.ndim == 3:
        out[is_body] = X_WB[is_body]
        exact |= is_body
    return out, np.where(exact, 0.0, slop)


def _product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    return A[:, :, 0:1] * B[:, 0:1, :] + A[:, :, 1:2] * B[:, 1:2, :] + A[:, :, 2:3] * B[:, 2:3, :]


def _terms(R: np.ndarray, p: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((k, 12, TERMS) doubles that add up to each entry of the product, whether they do exactly).

    Error-free products after Dekker 1971. They are exact unless a low part underflows.
    """
    k = len(R)
    terms = np.zeros((k, 12, TERMS))
    rotation = terms[:, :9].reshape(k, 3, 3, TERMS)
    shift = terms[:, 9:]
    shift[:, :, 6] = p
    exact = np.ones(k, dtype=bool)
    for j in range(3):
        for target, factor in ((rotation, X[:, None, j, :3]), (shift, X[:, j, 3][:, None])):
            factor_a = R[:, :, j, None] if target is rotation else R[:, :, j]
            high, low = _two_products(factor_a, factor)
            target[..., 2 * j], target[..., 2 * j + 1] = high, low
            safe = (np.abs(high) > SAFE_PRODUCT) | (factor_a == 0.0) | (factor == 0.0)
            exact &= safe.reshape(k, -1).all(axis=1)
    return terms, exact


def _two_products(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(high, low) with high + low = a·b exactly."""
    high = a * b
    a_high, b_high = (134217729.0 * v for v in (a, b))
    a_high, b_high = a_high - (a_high - a), b_high - (b_high - b)
    a_low, b_low = a - a_high, b - b_high
    return high, ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low


#: Products larger than this have low parts that are doubles.
SAFE_PRODUCT = 2.0**-900
NO_TERMS = np.zeros((0, TERM_ROW))
