"""The answer of ``distance(…, derivatives=True)``: a `PairResult` with derivatives by both poses."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from collide.derivatives.active_gradients import gradients_of_row
from collide.derivatives.derived_rows import Derived
from collide.derivatives.differentiate import Ask, differentiate
from collide.derivatives.gradient_rows import GRADIENT, STATE, UNIQUE
from collide.derivatives.implicit import Motion, motion_of
from collide.derivatives.uniqueness import Uniqueness
from collide.results import Form, PairResult, row_number

if TYPE_CHECKING:
    from collide.results import Batch, Bools, Field, Floats, Ints, Single


class PairDerivatives(PairResult[Form]):
    """A `PairResult` with derivatives by the poses of A and of B.

    A pose has six numbers here: a rotation ω [rad] about the origin o of the body, then a shift v [m], along the axes
    of W. A point p of the body has the velocity v + ω × (p − o).

    Parameters
    ----------
    result : `PairResult`, of the same rows.
    ask : answers pairs at other poses, for directions that are as short.
    derived : what is known of the rows; ``None`` to work out.

    Attributes
    ----------
    unique : bool, or (N,) bool. Whether the distance has a derivative.
    uniqueness : `Uniqueness`, or (N,) int64 of its values: why there is none.
    d_distance_A, d_distance_B : (6,) or (N, 6) derivatives of ``distance`` [m/rad, m/m]; NaN unless unique.
    d_point_a_A, d_point_a_B, d_point_b_A, d_point_b_B : (3, 6) or (N, 3, 6) derivatives of witness points.
    d_normal_A, d_normal_B : (3, 6) or (N, 3, 6) derivatives of the normal [1/rad, 1/m].
    d2_distance : (12, 12) or (N, 12, 12) second derivatives of ``distance`` along ``exp(ω) R``, ``o + v``: the six
        numbers of A, then of B.

    Notes
    -----
    Derivatives of points, of the normal and second derivatives are worked out when first asked for. They are NaN
    unless unique, and where the features that hold the witness points change at poses nearby. docs/derivatives.md has
    the equations.
    """

    __slots__ = ("__dict__", "_ask", "_derived")

    if TYPE_CHECKING:
        unique: Field[bool, Bools]
        uniqueness: Field[Uniqueness, Ints]
        d_distance_A: Field[Floats, Floats]
        d_distance_B: Field[Floats, Floats]
        d_point_a_A: Field[Floats, Floats]
        d_point_a_B: Field[Floats, Floats]
        d_point_b_A: Field[Floats, Floats]
        d_point_b_B: Field[Floats, Floats]
        d_normal_A: Field[Floats, Floats]
        d_normal_B: Field[Floats, Floats]
        d2_distance: Field[Floats, Floats]

    def __init__(self, result: PairResult, ask: Ask, derived: Derived | None = None):
        super().__init__(result.rows, result.is_single, result.question, result._certify)
        self._ask = ask
        self._derived = differentiate(self.rows, self.question, ask) if derived is None else derived

    def __reduce__(self):
        result = PairResult(self.rows, self.is_single, self.question, self._certify)
        return type(self), (result, self._ask, self._derived)

    @overload
    def __getitem__(self, k: int) -> PairDerivatives[Single]: ...
    @overload
    def __getitem__(self, k: slice) -> PairDerivatives[Batch]: ...
    def __getitem__(self, k):
        """Result k of a batch, or a batch of those in a slice. Raises IndexError, InvalidArgument."""
        result = super().__getitem__(k)
        some = k if isinstance(k, slice) else slice(row_number(k, len(self)), None)
        return PairDerivatives(result, self._ask, Derived(*(column[some][: len(result)] for column in self._derived)))

    def active_gradients(self, k: int = 0) -> np.ndarray:
        """The corners of the generalised gradient of row k.

        Parameters
        ----------
        k : the number of a row; 0 of a single pair.

        Returns
        -------
        (m, 12) derivatives by A's six numbers, then by B's. A unique derivative is a single row; without witness points
        m is 0. Else a row belongs to a pair of witness points as near as the named pair: to corners of areas that face
        each other, to directions that are as short, to parts that are as near. Of bodies apart the distance changes,
        along a change of the poses, by the least product of the change with a row.

        Raises
        ------
        IndexError, InvalidArgument : k is the number of no row.
        """
        k = row_number(k, len(self))
        return gradients_of_row(self.rows[k : k + 1], self[k].question, self._derived, k, self._ask)

    @cached_property
    def _motion(self) -> Motion:
        _, _, X_WA, X_WB = self.question
        n = len(self.rows)
        return motion_of(self._derived, *(np.broadcast_to(X[:, :3, 3], (n, 3)) for X in (X_WA, X_WB)))

    def _part(self, column: np.ndarray) -> Any:
        return column[0].copy() if self.is_single else column

    if not TYPE_CHECKING:  # checkers are to know the fields above

        @property
        def unique(self):
            """Whether the distance has a derivative."""
            unique = self._derived.kinds[:, STATE] == UNIQUE
            return bool(unique[0]) if self.is_single else unique

        @property
        def uniqueness(self):
            """`Uniqueness`, why the distance has no derivative; of batches the values."""
            states = self._derived.kinds[:, STATE]
            return Uniqueness(int(states[0])) if self.is_single else states

        @property
        def d_distance_A(self):
            """Derivatives of the distance by the pose of A."""
            return self._part(self._derived.numbers[:, GRADIENT : GRADIENT + 6])

        @property
        def d_distance_B(self):
            """Derivatives of the distance by the pose of B."""
            return self._part(self._derived.numbers[:, GRADIENT + 6 : GRADIENT + 12])

        @property
        def d2_distance(self):
            """Second derivatives of the distance by both poses."""
            return self._part(self._motion.gradient)


def _moving(name: str, first: int, what: str) -> property:
    """A property: derivatives of a point or normal by six numbers of the poses."""

    def field(self: PairDerivatives) -> Any:
        return self._part(getattr(self._motion, name)[:, :, first : first + 6])

    return property(field, doc=f"Derivatives of {what} by the pose of {'B' if first else 'A'}.")


if not TYPE_CHECKING:
    for _name, _what in (("point_a", "the witness point of A"), ("point_b", "the witness point of B"),
                         ("normal", "the normal")):
        setattr(PairDerivatives, f"d_{_name}_A", _moving(_name, 0, _what))
        setattr(PairDerivatives, f"d_{_name}_B", _moving(_name, 6, _what))
