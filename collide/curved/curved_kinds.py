"""The kinds of curved sets, and where each answers. Other kinds have no answer: NaN in kernels, KeyError outside."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.curved.chords import UNCLEAR, everything
from collide.curved.cone import cone_chord, cone_extents, cone_normal, cone_polytopes, cone_support, within_cone
from collide.curved.cylinder import (
    cylinder_chord,
    cylinder_extents,
    cylinder_normal,
    cylinder_polytopes,
    cylinder_support,
    within_cylinder,
)
from collide.curved.ellipsoid import (
    ellipsoid_chord,
    ellipsoid_extents,
    ellipsoid_normal,
    ellipsoid_polytopes,
    ellipsoid_support,
    within_ellipsoid,
)
from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, vec3_at


class CurvedKind(NamedTuple):
    """What numpy code asks of a kind; ``params`` are the numbers of a set (`PackedConvex.params`).

    extents : (params, g (…, 3)) → (…,) support values.
    within : (params, points (3, m), error) → (m,) bool: proven within, coordinates off by ``error`` at most.
    polytopes : (params) → corners (n, 3) of a solid polytope around the set, and of a polytope within.
    """

    extents: Callable[[np.ndarray, np.ndarray], np.ndarray]
    within: Callable[[np.ndarray, np.ndarray, np.ndarray | float], np.ndarray]
    polytopes: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


CURVED: dict[int, CurvedKind] = {
    CYLINDER: CurvedKind(cylinder_extents, within_cylinder, cylinder_polytopes),
    CONE: CurvedKind(cone_extents, within_cone, cone_polytopes),
    ELLIPSOID: CurvedKind(ellipsoid_extents, within_ellipsoid, ellipsoid_polytopes),
}


@kernel(inline=True)
def curved_support(kind, params, at, g):
    """The point of a curved set farthest along g."""
    if kind == ELLIPSOID:
        return ellipsoid_support(params, at, g)
    if kind == CYLINDER:
        return cylinder_support(params, at, g)
    if kind == CONE:
        return cone_support(params, at, g)
    return Vec3(math.nan, math.nan, math.nan)


@kernel(inline=True)
def curved_normal(kind, params, at, p, side):
    """An outward normal of a curved set at a point p of a side; sides as of `Chord`."""
    if kind == ELLIPSOID:
        return ellipsoid_normal(params, at, p)
    if side != 0:
        return Vec3(0.0, 0.0, -1.0 if side == 1 else 1.0)
    if kind == CYLINDER:
        return cylinder_normal(p)
    if kind == CONE:
        return cone_normal(params, at, p)
    return Vec3(math.nan, math.nan, math.nan)


@kernel(inline=True)
def curved_chord(kind, params, at, line):
    """The chord of a line in a curved set."""
    if kind == CYLINDER:
        return cylinder_chord(line, params[at], params[at + 1])
    if kind == CONE:
        return cone_chord(line, params[at], params[at + 1])
    if kind == ELLIPSOID:
        return ellipsoid_chord(line, vec3_at(params, at))
    return everything(UNCLEAR)
