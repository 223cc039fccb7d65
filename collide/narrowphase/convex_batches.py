"""Bodies of convex parts at many poses: one convex set each, or several.

Pairs of convex sets in their own frames, by far the most, go through `pose_batches.py` as they are; bodies of several
parts are taken apart and put together again by `composite/`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.compound_layout import layout_of
from collide.lowering.compound_table import CompoundTable
from collide.lowering.convex_sets import PRIMITIVE_NUMBERS
from collide.lowering.parts import convex_set_of, is_single_convex
from collide.lowering.shape_set_tables import tables_of
from collide.lowering.shape_table import ShapeTable
from collide.narrowphase import convex_kernel_calls
from collide.narrowphase.composite.composite import answer_compound_batch, prepared_compounds
from collide.narrowphase.lower_pair import PAIR_WORDS, lower_pair
from collide.narrowphase.prepared_pairs import Prepared, prepared_pair
from collide.results import PAIR_DTYPE
from collide.shapes.shape import Shape
from collide.shapes.shape_set import Picked


class Question(NamedTuple):
    """The question asked of a pair at every pose.

    boolean : only whether the bodies meet; else rows.
    limit : gaps beyond this are not measured [m].
    depths : of rows: whether depths of overlaps are wanted; without it some rows may have a depth all the same.
    check : refuse matrices other than rotations.
    axes : (n, 3) for booleans of convex sets: an axis to try first, pose by pose, replaced by a separating axis.
    """

    boolean: bool
    limit: float = 0.0
    depths: bool = True
    check: bool = False
    axes: np.ndarray | None = None


def convex_hits(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool: whether two bodies of convex parts meet at checked poses (n, 4, 4) or (1, 4, 4)."""
    out = np.zeros(convex_kernel_calls.number_of_poses(X_WA, X_WB), dtype=bool)
    answer_parts(out, A, B, X_WA, X_WB, Question(True))
    return out


def convex_rows(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float = math.inf, depths: bool = True
) -> np.ndarray:
    """Rows of `PAIR_DTYPE` of two bodies of convex parts at checked poses (n, 4, 4) or (1, 4, 4)."""
    out = np.zeros(convex_kernel_calls.number_of_poses(X_WA, X_WB), dtype=PAIR_DTYPE)
    answer_parts(out, A, B, X_WA, X_WB, Question(False, limit, depths))
    return out


def answer_sets(out: np.ndarray, A, B, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> bool:
    """Answer pairs of convex sets in their own frames; False where a matrix is no pose, and ``out`` must then be zeroed
    before its next use.

    out : becomes the answers: bool[n], or n rows of `PAIR_DTYPE`, zeroed before.
    A, B : two shapes, or shapes `Picked` from a set pose by pose.
    X_WA, X_WB : C-contiguous float64 (n, 4, 4), or (1, 4, 4) for a pose paired with all of the other body's.
    """
    if convex_kernel_calls.distrust_doubles:
        return _answer_compounds(out, A, B, X_WA, X_WB, question)
    table, which = shape_table(A, B)
    boolean, limit, depths, check, axes = question
    return convex_kernel_calls.run_poses(
        out, table, which, X_WA, X_WB, boolean=boolean, limit=limit, check=check, axes=axes, depths=depths
    )


def shape_table(A, B) -> tuple[ShapeTable, np.ndarray | None]:
    """(table, its rows pose by pose) of convex sets in their own frames; no rows (None) for rows 0 and 1 throughout."""
    if isinstance(A, Picked):
        return tables_of(A.shape_set).convex, np.stack([A.rows, B.rows], axis=1)
    pair = prepared_pair(A, B)
    if pair is not None and pair.table is not None:
        return pair.table, None
    table = ShapeTable([convex_set_of(A), convex_set_of(B)])
    if pair is not None and pair.header is not None:  # of few numbers: its kernels have a block of their own
        pair.table = table
    return table, None


def answer_parts(out: np.ndarray, A, B, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> bool:
    """`answer_sets` of bodies of convex parts, one each or several."""
    if _are_single(A) and _are_single(B):
        return answer_sets(out, A, B, X_WA, X_WB, question)
    return _answer_compounds(out, A, B, X_WA, X_WB, question)


def _answer_compounds(out: np.ndarray, A, B, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> bool:
    if not len(out):
        return True
    compounds, which = _compound_table(A, B)
    boolean, limit, depths, check, _ = question
    return answer_compound_batch(
        out, compounds, which, X_WA, X_WB, boolean=boolean, limit=limit, check=check, depths=depths
    )


def prepare_sets(A: Shape, B: Shape) -> Prepared:
    """Two convex sets in their own frames made ready for single calls."""
    block = lowered_numbers(A, B)
    if block is None:
        return convex_kernel_calls.prepared_sets(ShapeTable([convex_set_of(A), convex_set_of(B)]))
    return convex_kernel_calls.prepared_by(block)


def lowered_numbers(A: Shape, B: Shape) -> np.ndarray | None:
    """The block of `lower_pair` of two shapes of a few numbers; ``None`` of others."""
    numbers_a, numbers_b = PRIMITIVE_NUMBERS.get(A.__class__), PRIMITIVE_NUMBERS.get(B.__class__)
    if numbers_a is None or numbers_b is None:
        return None
    block = np.empty(PAIR_WORDS, dtype=np.int64)
    lower_pair(address_of(block), convex_kernel_calls.space_of_single_calls().header_at, *numbers_a(A), *numbers_b(B))
    return block


def prepare_parts(A: Shape, B: Shape) -> Prepared:
    """Two bodies of convex parts made ready for single calls."""
    if is_single_convex(A) and is_single_convex(B):
        return prepare_sets(A, B)
    return prepared_compounds(layout_of(A), layout_of(B))


def _are_single(shapes) -> bool:
    """Whether a shape is a single convex set in its own frame; of `Picked` shapes, whether all are."""
    if isinstance(shapes, Picked):
        return bool(tables_of(shapes.shape_set).single_convex[shapes.rows].all())
    return is_single_convex(shapes)


def _compound_table(A, B) -> tuple[CompoundTable, np.ndarray | None]:
    """(table, its bodies pose by pose); no bodies (None) for bodies 0 and 1 throughout."""
    if isinstance(A, Picked):
        return tables_of(A.shape_set).compounds, np.stack([A.rows, B.rows], axis=1)
    pair = prepared_pair(A, B)
    if pair is not None and isinstance(pair.table, CompoundTable):  # two sets may be asked as compounds, too
        return pair.table, None
    return CompoundTable([layout_of(A), layout_of(B)]), None

