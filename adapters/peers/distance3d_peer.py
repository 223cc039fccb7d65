"""distance3d: GJK in three flavours, EPA and MPR, in Python and Numba.

Its functions are compiled at their first call, a minute or two of it once a machine; then they come from Numba's cache.
"""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer, Setting
from collide.adapters.peers.question import corners
from collide.errors import CollideError, UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

#: The tolerance of its gjk_intersection, taken for its distances where they alone are asked [m].
TOUCHING = 1e-10
_SHAPES = ("half-spaces", "meshes other than as their hull")
_NO_DEPTH, _NO_GAP = "depths: its GJK gives none", "gaps: bodies apart have no penetration"
_DEPTHLESS, _GAPLESS = "boolean only: its GJK gives no depth", "boolean only: bodies apart have no penetration"


class Distance3dPeer(PairwisePeer):
    """`gjk_intersection` for the boolean and `gjk_distance` for gaps, both as Jolt does it."""

    name, package, module = "distance3d", "distance3d", "distance3d"
    isolated, extra, start_timeout = True, "all-peers", 600.0
    about = "gjk_intersection for the boolean, gjk_distance for gaps, both after Jolt"
    receives = (
        "doubles; corners in world coordinates", "hulls with a radius as a Margin of it",
        "max_distance_squared infinite instead of 1e5",
    )
    cannot = (_NO_DEPTH, *_SHAPES)
    settings = {
        "original": Setting(f"gjk_distance_original, a hit below {TOUCHING:g} m", {"flavour": "original"}),
        "nesterov": Setting(
            "gjk_nesterov_accelerated with use_nesterov_acceleration, which is off by default", {"flavour": "nesterov"}
        ),
        "epa": Setting(
            f"gjk_distance after Jolt, a hit below {TOUCHING:g} m; epa of the simplex it ends with", {"flavour": "epa"},
            cannot=("most depths of what is round: its polytope is full at 64 faces", *_SHAPES),
        ),
        "mpr": Setting("mpr_penetration", {"flavour": "mpr"}, cannot=(_NO_GAP, *_SHAPES)),
    }

    def prepare(self) -> None:
        warnings.filterwarnings("ignore", module="distance3d")  # Numba's, about the speed of products
        # What is compiled on the way is no part of a pair's time. Some of MPR and of Nesterov's GJK, 20 seconds of it,
        # is compiled only when two kinds of bodies, or a hull, are asked about.
        hull = ConvexHull([(-1, -1, -1), (1, -1, 0), (0, 1, -1), (0, 0, 1)])
        bodies = (Sphere(1.0), Box((1, 1, 1)), Capsule(1.0, 1.0), Cylinder(1.0, 1.0), Ellipsoid((1, 1, 2)), hull)
        for A, B in itertools.product(bodies, bodies):
            for x in 3.5, 0.25:
                apart = np.eye(4)
                apart[0, 3] = x
                try:
                    self.ask(A, np.eye(4), B, apart)
                except Exception:  # noqa: BLE001, S110 - pairs are asked later, each on its own account
                    pass

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Halfspace):
            return "distance3d has no half-space"
        return "distance3d takes the hull of a mesh" if isinstance(part, Mesh) else None

    def build(self, part: Shape) -> Shape:
        """The part itself: its colliders are made where they stand."""
        collider(part, np.eye(4))
        return part

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        return flavoured(self.values.get("flavour", "jolt"), collider(A, X_WA), collider(B, X_WB))


def collider(part: Shape, X: np.ndarray) -> Any:
    """distance3d's collider of a convex shape at a pose (4, 4)."""
    from distance3d import colliders

    X = np.ascontiguousarray(X)
    if isinstance(part, Sphere):
        return colliders.Sphere(X[:3, 3].copy(), part.radius)
    if isinstance(part, Box):
        return colliders.Box(X, part.size.copy())
    if isinstance(part, Capsule | Cylinder):
        return getattr(colliders, type(part).__name__)(X, part.radius, part.length)
    if isinstance(part, Cone):
        return colliders.Cone(cone_pose(part, X), part.radius, part.length)
    if isinstance(part, Ellipsoid):
        return colliders.Ellipsoid(X, part.radii.copy())
    points = corners(part)
    if points is None:
        raise UnsupportedQuery(f"distance3d has no {type(part).__name__}")
    hull = colliders.ConvexHullVertices(np.ascontiguousarray(points[0] @ X[:3, :3].T + X[:3, 3]))
    return colliders.Margin(hull, points[1]) if points[1] else hull


def cone_pose(part: Cone, X: np.ndarray) -> np.ndarray:
    """(4, 4) distance3d's cone has its frame in the middle of its base."""
    X_WC = X.copy()
    X_WC[:3, 3] -= 0.5 * part.length * X[:3, 2]
    return X_WC


def flavoured(flavour: str, A: Any, B: Any) -> Reply:
    """What one of its algorithms says about two colliders."""
    from distance3d import gjk, mpr

    if flavour == "mpr":
        hit, depth, direction, _ = mpr.mpr_penetration(A, B)
        no_gap = Reply(False, note=_GAPLESS)
        return Reply(True, -float(depth), unit_normal(direction)) if hit else no_gap
    if flavour == "nesterov":
        hit, gap, *_ = gjk.gjk_nesterov_accelerated(A, B, use_nesterov_acceleration=True)
        return Reply(True, note=_DEPTHLESS) if hit else Reply(False, float(gap))
    if flavour == "original":
        gap, point_a, point_b, *_ = gjk.gjk_distance_original(A, B)
        return _of_gap(gap, point_a, point_b)
    gap, point_a, point_b, simplex = gjk.gjk_distance_jolt(A, B, max_distance_squared=math.inf)
    if flavour == "epa":
        return _by_epa(simplex, A, B) if gap < TOUCHING else _of_gap(gap, point_a, point_b)
    if gjk.gjk_intersection_jolt(A, B):
        return Reply(True, note=_DEPTHLESS)
    return Reply(False, float(gap), unit_normal(point_b - point_a), tuple(point_a), tuple(point_b))


def _of_gap(gap: float, point_a: np.ndarray, point_b: np.ndarray) -> Reply:
    if gap < TOUCHING:
        return Reply(True, note=_DEPTHLESS)
    return Reply(False, float(gap), unit_normal(point_b - point_a), tuple(point_a), tuple(point_b))


def _by_epa(simplex: np.ndarray, A: Any, B: Any) -> Reply:
    from distance3d import epa

    step, _, converged = epa.epa(simplex, A, B)
    if not converged:
        raise CollideError("distance3d says that its EPA did not converge")
    return Reply(True, -float(np.linalg.norm(step)), unit_normal(step))


def unit_normal(step: np.ndarray) -> tuple:
    """Of length 1; NaN for none."""
    length = float(np.linalg.norm(step))
    return tuple(np.asarray(step) / length) if 0.0 < length < math.inf else (math.nan,) * 3
