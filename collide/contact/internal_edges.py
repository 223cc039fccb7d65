"""Which pairs of facets are connected, and whose nearest points are local minima: no contacts at internal edges."""

from __future__ import annotations

import numpy as np

from collide.contact.contact_facets import Pairs, Side, Topology, cross, facing, lengths_of, rotated
from collide.lowering.facet_bodies import Body

#: Sines of angles that count as none.
FLAT = 2.0**-30
#: Nearest points this near to a corner or an edge, in lengths of the longest edge, are on it.
_ON = 2.0**-30


class Links:
    """Connections of pairs of facets: two pairs share a corner on both bodies, or a facet on one, a corner on the
    other.
    """

    def __init__(self, pairs: Pairs, n_corners_b: int):
        keys = pairs.a.ids[:, :, None] * n_corners_b + pairs.b.ids[:, None, :]
        _, self._keys = np.unique(keys.reshape(-1), return_inverse=True)
        self._keys = self._keys.reshape(-1, 9)
        self._n_keys = int(self._keys.max()) + 1 if len(keys) else 0

    def reached(self, seeds: np.ndarray, among: np.ndarray) -> np.ndarray:
        """(k,) bool: the seeds (k,), and the pairs of ``among`` (k,) that are connected with them by such pairs."""
        pairs_reached = seeds.copy()
        is_reached = np.zeros(self._n_keys, dtype=bool)
        new_pairs = pairs_reached
        while new_pairs.any():
            is_reached[self._keys[new_pairs]] = True
            new_pairs = among & ~pairs_reached & is_reached[self._keys].any(axis=1)
            pairs_reached |= new_pairs
        return pairs_reached


def local_minima(pairs: Pairs, u: np.ndarray, slack: np.ndarray, A: Body, B: Body, topologies, poses) -> np.ndarray:
    """(k,) bool: whether the line u (k, 3) between the nearest points leaves A, and enters B, at right angles.

    That is: no facet around either point comes nearer, and of solids the line lies outside. Elsewhere the points are
    nearest within these two facets only, and a neighbour has nearer ones.
    """
    (top_a, top_b), (R_a, R_b, shift) = topologies, poses
    out = _leaves(pairs.a, pairs.near.point_a, u, slack, top_a, A, R_a, np.zeros(3))
    return out & _leaves(pairs.b, pairs.near.point_b, -u, slack, top_b, B, R_b, shift)


def _leaves(side: Side, point, u, slack, topology: Topology, body: Body, R, shift) -> np.ndarray:
    held = _feature(side.corners, point)
    first = np.argmax(held, axis=1)
    rows = np.arange(len(point))
    corner = side.ids[rows, first]
    begin, end = topology.starts[corner], topology.starts[corner + 1]
    pair = np.repeat(rows, end - begin)
    within = np.arange(len(pair)) - np.repeat(np.cumsum(end - begin) - (end - begin), end - begin)
    facet = topology.fans[begin[pair] + within]
    feature_ids = np.where(held, side.ids, -1)[pair]
    has = (feature_ids[:, :, None] == topology.corners[facet][:, None, :]).any(axis=2) | (feature_ids < 0)
    around = has.all(axis=1)
    pair, facet = pair[around], facet[around]
    corners = rotated(R, body.tree.triangles[topology.place[facet]].reshape(-1, 3, 3)) + shift
    away = corners - point[pair][:, None]
    rise = (away * u[pair][:, None]).sum(axis=2)
    least = slack[pair][:, None] * lengths_of(away) + _ON * lengths_of(corners[:, 1] - corners[:, 0])[:, None]
    steep = (rise > least).any(axis=1)
    good = np.ones(len(point), dtype=bool)
    good[pair[steep]] = False
    if topology.solid:
        outward = np.zeros((len(point), 3))
        np.add.at(outward, pair, _weighted(corners, point[pair], held[pair].sum(axis=1)))
        good &= (outward * u).sum(axis=1) >= -slack * np.maximum(lengths_of(outward), FLAT)
    return good


def _weighted(corners: np.ndarray, point: np.ndarray, n_held: np.ndarray) -> np.ndarray:
    """Normals, times the angle at the point where that is a corner.

    J. A. Bærentzen, H. Aanæs, "Signed distance computation using the angle weighted pseudonormal" (2005).
    """
    n = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = lengths_of(n)
    n = np.where((lengths > 0.0)[:, None], n / np.where(lengths > 0.0, lengths, 1.0)[:, None], 0.0)
    away = corners - point[:, None]
    at = np.argmin(lengths_of(away), axis=1)
    rows = np.arange(len(at))
    p, q = corners[rows, (at + 1) % 3] - corners[rows, at], corners[rows, (at + 2) % 3] - corners[rows, at]
    angle = np.arctan2(lengths_of(cross(p, q)), (p * q).sum(axis=1))
    return n * np.where(n_held == 1, angle, 1.0)[:, None]


def _feature(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(k, 3) bool: the corners of the feature of each triangle that a point of it lies on: one, two or all three."""
    edges = corners[:, [1, 2, 0]] - corners
    away = point[:, None] - corners
    square = np.square(edges).sum(axis=2)
    size = np.sqrt(square.max(axis=1))[:, None]
    at_corner = lengths_of(away) <= _ON * size
    along = np.clip((away * edges).sum(axis=2) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    on_edge = lengths_of(away - along[..., None] * edges) <= _ON * size
    held = np.ones((len(point), 3), dtype=bool)
    row, k = np.nonzero(on_edge)
    held[row] = False
    for i, j in zip(row[::-1].tolist(), k[::-1].tolist()):  # the first edge stays
        held[i] = False
        held[i, [j, (j + 1) % 3]] = True
    some = at_corner.any(axis=1)
    held[some] = False
    held[np.flatnonzero(some), np.argmax(at_corner[some], axis=1)] = True
    return held


def snapped(pairs: Pairs, k: int, u: np.ndarray, slack: float) -> np.ndarray:
    """The normal of a facet of pair k, or the cross product of two of its edges, where u is that but for rounding."""
    normal_a, normal_b = pairs.a.normals[k], pairs.b.normals[k]
    edges = [T[[1, 2, 0]] - T for T in (pairs.a.corners[k], pairs.b.corners[k])]
    crosses = cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    lengths = lengths_of(crosses)
    well_conditioned = lengths > FLAT * (lengths_of(edges[0])[:, None] * lengths_of(edges[1])[None]).ravel()
    guesses = np.concatenate([[normal_a, normal_b], crosses[well_conditioned] / lengths[well_conditioned][:, None]])
    off = lengths_of(cross(guesses, u))
    off[~guesses.any(axis=1)] = np.inf
    for group in (slice(0, 2), slice(2, None)):  # faces first
        if len(off[group]) and off[group].min() <= slack:
            best = guesses[group][int(np.argmin(off[group]))]
            return best if (best * u).sum() > 0.0 else 0.0 - best
    return u


def aligned(pairs: Pairs, n: np.ndarray, solid_a: bool, solid_b: bool, cosine: float) -> np.ndarray:
    """(k,) bool: one facet of the pair at least faces along n."""
    return (facing(pairs.a.normals, n, solid_a) >= cosine) | (facing(pairs.b.normals, -n, solid_b) >= cosine)
