"""Rows given to the kernel with their convex sets and poses, and what the kernel writes of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from collide.derivatives.gradient_rows import (
    DERIVATIVE,
    DERIVATIVE_INTS,
    GRADIENT_DOUBLES,
    GRADIENT_HEADER,
    NOT_CONVEX,
    STATE,
    differentiate_rows,
)
from collide.derivatives.settle_features import SETTLE_INTS
from collide.kernels import address_of
from collide.lowering.lowered_sets import in_rows
from collide.lowering.parts import parts_of
from collide.lowering.set_rows import RADIUS
from collide.shapes.shape import Shape


class Derived(NamedTuple):
    """What the kernel wrote of n rows.

    numbers : (n, DERIVATIVE).   kinds : (n, DERIVATIVE_INTS).   radii : (n, 2) of the balls swept over the cores [m].
    """

    numbers: np.ndarray
    kinds: np.ndarray
    radii: np.ndarray


class SetTable(NamedTuple):
    """Convex sets of several shapes in rows (`set_rows.py`).   sets : objects that hold what the rows point to."""

    ints: np.ndarray
    numbers: np.ndarray
    sets: Any


def unwritten_derived(n: int) -> Derived:
    """Room for n rows of which the kernel writes all."""
    return Derived(np.empty((n, DERIVATIVE)), np.empty((n, DERIVATIVE_INTS), np.int64), np.empty((n, 2)))


def empty_derived(n: int) -> Derived:
    """Of n rows of which nothing is known."""
    derived = Derived(np.full((n, DERIVATIVE), np.nan), np.zeros((n, DERIVATIVE_INTS), np.int64), np.zeros((n, 2)))
    derived.kinds[:, STATE] = NOT_CONVEX
    return derived


def table_of(shapes: Sequence[Shape], is_convex: np.ndarray) -> SetTable:
    """A row for each shape; rows of shapes that are no single convex set stand empty."""
    placed = [in_rows(parts_of(shape)) if convex else None for shape, convex in zip(shapes, is_convex.tolist())]
    known = next(sets for sets in placed if sets is not None)
    rows = [known if sets is None else sets for sets in placed]
    ints, numbers = (np.concatenate([getattr(sets.sets, name) for sets in rows]) for name in ("ints", "numbers"))
    return SetTable(ints, numbers, placed)


def run_rows(rows: np.ndarray, table: SetTable, sets: tuple, X_WP: tuple, X_WB: tuple, out: Derived) -> None:
    """Write derivatives of rows.

    sets : (n,) rows of the table, of A and of B.   X_WP, X_WB : poses (n, 4, 4) or (1, 4, 4) of the sets and of the
    bodies, of A and of B.
    """
    work, (ints, header) = np.empty(GRADIENT_DOUBLES), (np.empty(k, np.int64) for k in (SETTLE_INTS, GRADIENT_HEADER))
    sets = tuple(np.ascontiguousarray(of, dtype=np.int64) for of in sets)
    X = [np.ascontiguousarray(X_W, dtype=np.float64) for X_W in (*X_WP, *X_WB)]
    rows = np.ascontiguousarray(rows)
    poses = [word for X_W in X for word in (address_of(X_W), 16 * (len(X_W) > 1))]
    header[:] = (
        address_of(rows), address_of(table.ints), address_of(table.numbers), *map(address_of, sets), *poses,
        address_of(out.numbers), address_of(out.kinds), address_of(work), address_of(ints),
    )
    differentiate_rows(address_of(header), len(rows))
    out.radii[:, 0], out.radii[:, 1] = (table.numbers[of, RADIUS] for of in sets)
