"""Whether two posed bodies of facets share a point: their surfaces meet, or one lies inside the other.

Bodies whose surfaces do not meet lie wholly on one side of each other, part by part: one point of every part tells.
All signs are exact, but for swept balls that touch within the bracket of a distance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body
from collide.narrowphase.facets.facet_queries import (
    FARTHER,
    SurfaceDistances,
    points_in_solid,
    surface_distances,
    surfaces_meet,
)
from collide.narrowphase.facets.winding_numbers import OUTSIDE

#: What is known of a pose.
APART, HIT, OPEN = range(3)
#: As many points and poses are looked at in one go.
_CHUNK = 1 << 16
#: Below so many points and poses, asking takes no longer than leaving out those far away.
_FEW = 8


class Hits(NamedTuple):
    """What is known about n poses; ``inside`` holds points of the world, NaN where no part is inside.

    core : (n,) bool, facets or insides meet without any radius.   inside : (n, 3).
    """

    core: np.ndarray
    inside: np.ndarray


def core_hits(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> Hits:
    """Exactly, for poses (n, 4, 4), whether the bodies without their radii share a point."""
    core = surfaces_meet(A.tree, B.tree, X_WA, X_WB)
    inside = np.full((len(core), 3), np.nan)
    for body, other, X_WO, X_WP in ((A, B, X_WA, X_WB), (B, A, X_WB, X_WA)):
        if body.solid:
            left = np.flatnonzero(~core)
            if len(left):
                _mark_inside(body, other.points, X_WO, X_WP, left, core, inside)
    return Hits(core, inside)


def holds_points(body: Body, points: np.ndarray, X_WO: np.ndarray, X_WP: np.ndarray) -> np.ndarray:
    """(n,) bool, exactly: whether the solid at X_WO (n, 4, 4) holds one of the points (k, 3) of a frame at X_WP."""
    held = np.zeros(len(X_WO), dtype=bool)
    _mark_inside(body, points, X_WO, X_WP, np.arange(len(X_WO)), held, np.full((len(X_WO), 3), np.nan))
    return held


def _mark_inside(body: Body, points, X_WO, X_WP, left, core, inside) -> None:
    """Mark poses ``left`` at which one of the points (k, 3) of the other body lies in the solid."""
    for begin in range(0, len(points), max(1, _CHUNK // len(left))):
        some = points[begin : begin + max(1, _CHUNK // len(left))]
        pose, which = np.repeat(left, len(some)), np.tile(np.arange(len(some)), len(left))
        if len(pose) > _FEW:
            near = _near(body, some, X_WO, X_WP, left)
            pose, which = pose[near], which[near]
        if not len(pose):
            continue
        where = points_in_solid(body.tree, X_WO[pose], some[which], X_WP[pose])
        found = np.flatnonzero(where != OUTSIDE)
        for k in found[::-1]:  # the first of them stays
            core[pose[k]] = True
            inside[pose[k]] = _moved(X_WP[pose[k]], some[which[k]])


def _near(body: Body, points, X_WO, X_WP, left) -> np.ndarray:
    """(len(left)·len(points),) bool, in that order: not clearly farther away than the body reaches."""
    centre = _moved(X_WO[left], body.centre)[:, None]
    placed = (X_WP[left][:, None, :3, :3] * points[None, :, None]).sum(axis=3) + X_WP[left][:, None, :3, 3]
    size = np.abs(centre).sum(axis=2) + np.abs(placed).sum(axis=2)
    stretch = np.sqrt(np.square(X_WO[left][:, :3, :3]).sum(axis=(1, 2)))[:, None]
    away = np.sqrt(np.square(placed - centre).sum(axis=2))
    return (away <= stretch * body.reach * (1 + 1e-9) + 1e-9 * size).ravel()


def _moved(X: np.ndarray, point: np.ndarray) -> np.ndarray:
    return (X[..., :3, :3] * point).sum(axis=-1) + X[..., :3, 3]


def swept_apart(A: Body, B: Body, found: SurfaceDistances) -> tuple[np.ndarray, np.ndarray]:
    """(apart, sure), both (n,) bool, of bodies with radii whose cores are as far apart as found."""
    radius = A.radius + B.radius
    apart = found.lower > radius
    if radius == 0.0:
        apart = ~found.meets
    return apart, apart | (found.upper <= radius) | found.meets


def states(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) APART, HIT or OPEN: whether the bodies share a point; rounding leaves open swept balls only."""
    answer = np.where(core_hits(A, B, X_WA, X_WB).core, HIT, APART)
    radius = A.radius + B.radius
    left = np.flatnonzero(answer == APART)
    if radius > 0.0 and len(left):
        found = surface_distances(A.tree, B.tree, X_WA[left], X_WB[left], radius * FARTHER)
        apart, sure = swept_apart(A, B, found)
        if not sure.all():
            more = surface_distances(A.tree, B.tree, X_WA[left[~sure]], X_WB[left[~sure]])
            apart[~sure], sure[~sure] = swept_apart(A, B, more)
        answer[left] = np.where(apart, APART, np.where(sure, HIT, OPEN))
    return answer


def hits(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool: False only where the bodies are proven apart."""
    return states(A, B, X_WA, X_WB) != APART


def apart_nearby(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool: which swept bodies a search no farther than their radii proves apart: a bracket may be too wide to."""
    radius = A.radius + B.radius
    return swept_apart(A, B, surface_distances(A.tree, B.tree, X_WA, X_WB, radius * FARTHER))[0]
