"""A point inside every half-space, by a least-distance program in one more dimension."""

from __future__ import annotations

import numpy as np

from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.nearest_pair import EMPTY, nearest_pair
from collide.least_distance.pair_proposals import Work, propose_from_samples


def interior_point(halfspaces: HomogeneousRows, work: Work, exactly: bool) -> np.ndarray | None:
    """A point strictly inside every half-space: proposed in doubles, or exactly; None where FH has no interior.

    (x, s) with a·x − b·s ≤ −1 and s ≥ 0 exists where FH has interior, and x/s is then interior; the shortest vector (x,
    s) has the widest margin, and solves a program in d + 1 variables over all half-spaces, as in theorem 4.5.
    """
    work.add("whole_programs")
    d = halfspaces.dimension
    last = np.broadcast_to(halfspaces.last, len(halfspaces))
    values = np.vstack((np.column_stack((halfspaces.values, -last)), [[0.0] * d + [-1.0]]))
    right = np.full(len(values), -1.0)
    right[-1] = 0.0
    lifted = HomogeneousRows(values, right, lambda row: as_integers([*values[row].tolist(), float(right[row])])[0])
    shortest, margin = _shortest(origin_point(d + 1), lifted, work, exactly)
    halfspaces.n_read += lifted.n_read
    lifted.n_read = 0  # counted now
    if shortest is None:
        return None
    # Half of the margin is spent on a nearer point: where FH holds a cone, s may be 0.
    depth, reach = -float(last.min()), float(np.abs(last).max())
    s = shortest[-1] + 0.5 * margin / (depth if depth > 0.0 else reach if reach > 0.0 else 1.0)
    with np.errstate(all="ignore"):
        interior = shortest[:-1] / s
    return interior if np.isfinite(interior).all() else None


def _shortest(origin, lifted, work: Work, exactly: bool) -> tuple[np.ndarray | None, float]:
    """(the point of the lifted half-spaces nearest the origin, the value of 1 in its units); (None, 0) where they have
    no common point."""
    if not exactly:
        proposal = propose_from_samples(origin, lifted, work, None, None, [0], [])
        return (proposal.y - proposal.u, 1.0) if proposal.is_settled else (None, 0.0)
    pair = nearest_pair(origin, lifted, work)
    if pair.kind == EMPTY:
        return None, 0.0
    scale = 1 << max(max(abs(number) for number in pair.x).bit_length() - 60, 0)
    return np.array([number / scale for number in pair.x]), pair.denominator / scale


def origin_point(d: int) -> HomogeneousRows:
    """The origin of R^d, as the one point of a hull."""
    return HomogeneousRows(np.zeros((1, d)), 1.0, lambda row: [0] * d + [1])
