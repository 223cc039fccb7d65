"""Facets cut into pieces until each is in a ball, or the greatest distance of the facets outside balls is bracketed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.certificates.sphere_cover import CUT_AT, PartCover
from collide.spheres.body_facets import BodyPart
from collide.spheres.convex_pieces import Balls, ConvexPieces

#: Distances of corners from balls worked on at a time.
_BLOCK = 1 << 20
#: Cuts above a piece at most.
_MAX_DEPTH = 48


class FacetCover(NamedTuple):
    """How far facets are outside balls, by pieces.

    lower, upper : of the greatest signed distance of a point of the facets from the union of the balls, negative where
        all facets lie inside [m]: lower ≤ truth ≤ upper in exact arithmetic.
    farthest : (3,) where ``lower`` is reached.
    pieces : (k,) int32, as of `PartCover`: every piece is in the ball named, if radii grow by ``upper``.
    starts : (m,) where the pieces of each facet begin.
    corners, owners, values : (l, 3, 3), (l,), (l,) the last pieces, the ball of each, and their own upper bounds.
    """

    lower: float
    upper: float
    farthest: np.ndarray
    pieces: np.ndarray
    starts: np.ndarray
    corners: np.ndarray
    owners: np.ndarray
    values: np.ndarray


def cover_facets(
    corners: np.ndarray, cover: Balls | ConvexPieces, tolerance: float, *, least: float = -np.inf
) -> FacetCover:
    """Cut facets (m, 3, 3) until the bracket of their greatest distance outside balls, or other convex sets, is as
    narrow as a tolerance [m].

    Radii of balls may be negative: only differences count. ``least`` : pieces that are no farther outside need not be
    cut.

    The signed distance of a convex set, of a ball |x − c| − r, is convex in x: on a triangle a corner has the largest.
    So the least over sets of the largest over corners bounds a piece from above, and the least over sets at any point
    from below.
    """
    lower, farthest, levels = -np.inf, corners[0, 0], []
    depth = 0
    while len(corners):
        owners, values, reached, at = _judge(corners, cover)
        if reached > lower:
            lower, farthest = reached, at
        is_cut = (values > max(lower + tolerance, least)) & (depth < _MAX_DEPTH)
        pieces, edges = bisected(corners[is_cut])
        owners[is_cut] = CUT_AT - edges
        levels.append((corners, owners, values, is_cut))
        corners, depth = pieces, depth + 1
    leaf_corners = np.concatenate([level[0][~level[3]] for level in levels])
    leaf_owners = np.concatenate([level[1][~level[3]] for level in levels])
    leaf_values = np.concatenate([level[2][~level[3]] for level in levels])
    return FacetCover(
        lower, float(leaf_values.max()), farthest, *_in_preorder(levels), leaf_corners, leaf_owners, leaf_values
    )


def _judge(
    corners: np.ndarray, cover: Balls | ConvexPieces
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """(the best set for each piece, its value; the farthest corner's distance, and the corner)."""
    owners, values = np.empty(len(corners), dtype=np.int32), np.empty(len(corners))
    reached, at = -np.inf, corners[0, 0]
    step = max(1, _BLOCK // (3 * cover.size))
    for start in range(0, len(corners), step):
        some = corners[start : start + step]
        outside = cover.away(some)
        worst = outside.max(axis=1)
        owners[start : start + step] = worst.argmin(axis=1)
        values[start : start + step] = worst.min(axis=1)
        nearest = outside.min(axis=2)
        k = int(nearest.argmax())
        if nearest.flat[k] > reached:
            reached, at = float(nearest.flat[k]), some[divmod(k, 3)]
    return owners, values, reached, at


def bisected(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(the halves of m triangles, (2 m, 3, 3), cut at the middle of their longest edges; (m,) the edges)."""
    edges = np.square(np.roll(corners, -1, axis=1) - corners).sum(axis=2).argmax(axis=1)
    rows = np.arange(len(corners))
    first, second = corners[rows, edges], corners[rows, (edges + 1) % 3]
    pieces = np.repeat(corners, 2, axis=0)
    middle = 0.5 * (first + second)
    pieces[2 * rows, (edges + 1) % 3] = middle
    pieces[2 * rows + 1, edges] = middle
    return pieces, edges


def _in_preorder(levels: list) -> tuple[np.ndarray, np.ndarray]:
    """(the pieces of all levels, each cut piece before its halves; where those of the first level stand)."""
    sizes: list[np.ndarray] = []
    for _, _, _, is_cut in reversed(levels):
        size = np.ones(len(is_cut), dtype=np.int64)
        if sizes:
            size[is_cut] += sizes[-1].reshape(-1, 2).sum(axis=1)
        sizes.append(size)
    sizes.reverse()
    pieces = np.empty(int(sizes[0].sum()), dtype=np.int32)
    at = starts = np.cumsum(sizes[0]) - sizes[0]
    for k, (_, owners, _, is_cut) in enumerate(levels):
        pieces[at] = owners
        if is_cut.any():
            at = at[is_cut][:, None] + 1 + np.column_stack([np.zeros_like(sizes[k + 1][::2]), sizes[k + 1][::2]])
            at = at.reshape(-1)
    return pieces, starts


def certificate_of(parts: list[BodyPart], cover: FacetCover, used: np.ndarray) -> tuple[PartCover, ...]:
    """The certificate of a cover of all facets of parts, with the balls of rows ``used``, numbered anew."""
    numbers = np.zeros(int(max(cover.pieces.max(), used.max())) + 1, dtype=np.int32)
    numbers[used] = np.arange(len(used))
    pieces = np.where(cover.pieces < 0, cover.pieces, numbers[np.maximum(cover.pieces, 0)])
    ends = np.cumsum([len(part.mesh.faces) for part in parts])
    cuts = np.append(cover.starts, len(pieces))[np.concatenate([[0], ends])]
    return tuple(
        PartCover(-1, part.vertices, part.faces, pieces[start:end]) for part, start, end in zip(parts, cuts, cuts[1:])
    )
