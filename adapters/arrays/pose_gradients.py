"""Distances of many pairs, and their gradients by the entries of pose matrices.

`collide.distance(…, derivatives=True)` gives the derivative by the six numbers of a pose: g_ω by a rotation exp([ω]×)
about the body's origin, g_v by a shift, both along the axes of W. A change dR of a rotation R is [ω]× R. The gradient
by the entries of R is taken to be the matrix G in the tangent space {[ω]× R} with

    <G, [ω]× R> = g_ω · ω  for all ω:        G = ½ [g_ω]× R,

because <½ [g]× R, [ω]× R> = ½ tr([g]×ᵀ [ω]×) = g · ω. The gradient by the translation is g_v, by the last row 0. Chains
from any parameters of rotations (quaternions, angles, exponentials) through R are then exact; what a change off the
rotations would do to the distance has no part in G.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import collide
from collide.pairs.pair_arguments import asked_poses


def distances_with_gradients(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, subgradient: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Signed distances (n,) [m], and their gradients by X_WA and by X_WB, both (n, 4, 4).

    subgradient : where the distance has no derivative, the first of its active gradients instead of NaN; still NaN
        where no gradient is active.
    """
    X_WA, X_WB, _ = asked_poses(A, B, X_WA, X_WB)
    r: Any = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    of_a, of_b = r.d_distance_A.copy(), r.d_distance_B.copy()
    for k in np.flatnonzero(~r.unique).tolist() if subgradient else []:
        for both in r.active_gradients(k)[:1]:
            of_a[k], of_b[k] = both[:6], both[6:]
    return r.distance, _by_entries(of_a, X_WA), _by_entries(of_b, X_WB)


def _by_entries(gradient: np.ndarray, X: np.ndarray) -> np.ndarray:
    """(n, 4, 4) gradients by entries, of (n, 6) by rotation and shift."""
    entries = np.zeros((len(gradient), 4, 4))
    # Row i of [g]× R is the i-th row of g × (columns of R): a cross product along the rows' axis.
    entries[:, :3, :3] = 0.5 * np.cross(gradient[:, :3, None], X[:, :3, :3], axis=1)
    entries[:, :3, 3] = gradient[:, 3:]
    return entries
