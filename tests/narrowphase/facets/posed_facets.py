"""Two triangles at two poses as the kernels of facets see them, and families of pairs that touch or nearly do."""

from __future__ import annotations

import numpy as np
from naive import LATTICE_ROTATIONS, pose, random_pose
from naive_triangles import as_integers, triangles_meet, world_points

from collide.kernels import address_of
from collide.narrowphase.facets.exact_corners import (
    B_LOCAL_AT,
    CORNERS,
    DIGITS,
    STATE,
    ExactPair,
    invalidate_pose_cache,
)
from collide.narrowphase.facets.exact_triangles import INTEGERS, decide_exactly
from collide.narrowphase.facets.posed_surfaces import EXTENT, PLACING, Extent, place, put_in_frame_of_a

FAMILIES = ("lattice", "coplanar", "touching", "near touching", "random", "degenerate", "in line")


def numbers_of(points: np.ndarray) -> np.ndarray:
    """Centre, reach and radius, as of a tree."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = np.linalg.norm(points - centre, axis=1).max() * (1 + 1e-12)
    return np.array([*centre, *np.abs(points).max(axis=0), radius])


class PosedFacets:
    """Triangles P of A and Q of B, (3, 3) each; the buffers are kept alive here."""

    def __init__(self, P, Q, X_WA, X_WB):
        self.doubles = np.zeros(PLACING + CORNERS)
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.XA, self.XB = (np.ascontiguousarray(X, dtype=float).ravel() for X in (X_WA, X_WB))
        self.placing, self.corners = self.doubles[:PLACING], self.doubles[PLACING:]
        frames = np.zeros((2, 9), dtype=np.float32)
        A, B = Extent(numbers_of(P), 1, EXTENT), Extent(numbers_of(Q), 1, EXTENT)
        self.invertible = place(A, self.XA, B, self.XB, self.placing, *frames)
        self.corners[:9], self.corners[B_LOCAL_AT : B_LOCAL_AT + 9] = P.ravel(), Q.ravel()
        put_in_frame_of_a(self.placing, self.corners, B_LOCAL_AT, self.corners, 9)
        state, digits = self.integers[:STATE], self.integers[STATE : STATE + DIGITS]
        invalidate_pose_cache(state)
        self.pair = ExactPair(self.corners, self.placing, digits, state, self.XA, self.XB)

    def ask(self, what: int) -> int:
        at = address_of(self.doubles)
        arguments = (address_of(self.integers), address_of(self.XA), address_of(self.XB))
        return decide_exactly(what, at + 8 * PLACING, at, *arguments)




def posed_pair(rng, family: str):
    """(P, Q, X_WA, X_WB) of a family."""
    P, Q = rng.uniform(-1.0, 1.0, (2, 3, 3))
    X_WA, X_WB = random_pose(rng), random_pose(rng)
    if family in ("lattice", "coplanar", "degenerate"):
        P, Q = rng.integers(-2, 3, (2, 3, 3)).astype(float)
        turns = [LATTICE_ROTATIONS[k] for k in rng.integers(24, size=2)]
        X_WA, X_WB = (pose(R, rng.integers(-1, 2, 3) * 0.5) for R in turns)
    if family == "coplanar":
        P[:, 2] = Q[:, 2] = 0.0
        X_WA = X_WB = random_pose(rng)
    if family == "degenerate":  # a segment or a point
        P[2] = P[int(rng.integers(2))]
        if rng.random() < 0.5:
            Q[1] = 0.5 * (Q[0] + Q[2])
        if rng.random() < 0.5:
            X_WB = X_WA = random_pose(rng)
    if family == "in line":  # along an axis, a diagonal or any other direction of a lattice
        along, start = rng.choice([0, 0, 1, -2], 3), rng.integers(-2, 3, 3)
        P, Q = (start + rng.integers(-3, 4, (3, 1)) * along for _ in "AB")
        P, Q = P.astype(float), Q.astype(float) + (rng.random() < 0.2)
        X_WB = X_WA
    if family == "touching":  # a corner of Q is a dyadic combination of P's corners
        P, Q = rng.integers(-8, 9, (2, 3, 3)).astype(float)
        a, b = rng.choice([-0.25, 0.0, 0.0, 0.25, 0.5, 1.0, 1.25], 2)
        Q[int(rng.integers(3))] = P[0] + a * (P[1] - P[0]) + b * (P[2] - P[0])
        X_WB = X_WA
    if family == "near touching":  # to rounding, in the world
        weights = rng.dirichlet(np.ones(3)) if rng.random() < 0.6 else rng.permutation([0.0, 0.25, 0.75])
        point = X_WA[:3, :3] @ (weights @ P) + X_WA[:3, 3]
        Q[int(rng.integers(3))] = X_WB[:3, :3].T @ (point - X_WB[:3, 3])
    return P, Q, X_WA, X_WB


def exact_corners(P, Q, X_WA, X_WB) -> list[list[list[int]]]:
    """Both triangles in the world, as integers of one unit."""
    return as_integers(world_points(P, X_WA), world_points(Q, X_WB))


def meet(P, Q, X_WA, X_WB) -> bool:
    return triangles_meet(*exact_corners(P, Q, X_WA, X_WB))


def told(P, Q, X_WA, X_WB) -> str:
    """Source of a failing case."""
    named = {"P": P, "Q": Q, "X_WA": X_WA, "X_WB": X_WB}
    return "; ".join(f"{name} = np.array({value.tolist()})" for name, value in named.items())
