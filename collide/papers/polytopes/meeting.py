"""`Meeting`: the answer of `meets`, and its certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, NamedTuple

import numpy as np


class MeetingCertificate(NamedTuple):
    """Plain data that proves a `Meeting`, checked by `collide.polytopes.verify`.

    Attributes
    ----------
    kind : str
        ``"common point"``: Σ weights·points lies in every half-space. ``"separating plane"``: with
        u = Σ multipliers·normals and c = Σ multipliers·offsets, u·x ≤ c for every x of FH and u·p > c for every point
        p; Σ weights·points is the point of CH nearest to FH. ``"contradiction"``: Σ multipliers·normals = 0 and
        Σ multipliers·offsets < 0, so that FH is empty.
    points : tuple of int
        Rows of the points: at most d + 1 of a common point, at most d beside a plane.
    weights : tuple of Fraction
        Positive, of sum 1.
    halfspaces : tuple of int
        Rows of the half-spaces: at most d of a plane, at most d + 1 of a contradiction.
    multipliers : tuple of Fraction
        Positive.
    """

    kind: Literal["common point", "separating plane", "contradiction"]
    points: tuple[int, ...]
    weights: tuple[Fraction, ...]
    halfspaces: tuple[int, ...]
    multipliers: tuple[Fraction, ...]


@dataclass(frozen=True)
class Meeting:
    """Whether the hull CH of points and the intersection FH of half-spaces have a point in common.

    Attributes
    ----------
    hit : bool
        Whether they have a common point; touching is a hit.
    point : (d,) float64 or ``None``
        Of a hit, the common point of the certificate, rounded once [units of the points].
    distance : float
        The least distance of a point of CH and a point of FH, rounded [units of the points]: 0 of a hit, infinite where
        FH is empty.
    point_p, point_h : (d,) float64 or ``None``
        The two nearest points, of CH and of FH, each rounded once; both ``point`` of a hit, ``None`` where FH is empty.
    normal : (d,) float64 or ``None``
        Of a miss, the unit vector from CH towards FH.
    lower, upper : float
        Proven: lower ≤ the exact distance ≤ upper, at most a unit in the last place apart.
    certificate : MeetingCertificate
        Proof of the answer; `verify` checks the proof against the input.
    counters : mapping
        Work done, by name: rows read, rounds, pivots, rows decided in integers, and of ACIT the calls, their
        depth and the nets redrawn.
    """

    hit: bool
    point: np.ndarray | None
    distance: float
    point_p: np.ndarray | None
    point_h: np.ndarray | None
    normal: np.ndarray | None
    lower: float
    upper: float
    certificate: MeetingCertificate
    counters: Mapping[str, int | str]

    def __bool__(self) -> bool:
        return self.hit
