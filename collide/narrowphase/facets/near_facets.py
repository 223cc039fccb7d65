"""Facets of a mesh that may be within some distance of a convex set: a walk down the box-tree, many poses at once.

Boxes and triangles are parted from the set along a few directions a pose: the mesh's axes, the set's, and a direction
known to the caller. Three gaps along the axes of a frame add up as a diagonal does, less how far the axes are from
right angles. The result is a lower bound of the distance, rounding taken off: facets are left out only where proven
farther.
"""

from __future__ import annotations

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.curved.curved_kinds import CURVED
from collide.lowering.facet_bodies import PosesWithSlop
from collide.lowering.packed_convex import POINTS, PackedConvex
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.mesh.bvh import NOTHING, REACH, WIDTH, MeshTree, leaf_runs

#: More boxes at once are walked in two parts of the poses.
_MAX_BOXES = 1 << 16
#: Of more points than these the farthest is looked for by the support tree.
_MAX_SCANNED = 2048
#: Of the largest numbers met, what rounding takes off a gap; unit vectors are this much shorter than 1.
_ROUNDING, _SHORTER = 2.0**-46, 1 - 2.0**-40


class Facets:
    """Facets found: ``pose`` (k,), ``place`` (k,) in the order of the tree, ``bound`` (k,) of their distance [m].

    Sorted by pose, then bound, then place.
    """

    def __init__(self, pose: np.ndarray, place: np.ndarray, bound: np.ndarray):
        order = np.lexsort((place, bound, pose))
        self.pose, self.place, self.bound = pose[order], place[order], bound[order]

    def ranks(self) -> np.ndarray:
        """(k,) how many stand before each, at its pose."""
        starts = np.flatnonzero(np.diff(self.pose, prepend=-1))
        counts = np.diff(np.append(starts, len(self.pose)))
        return np.arange(len(self.pose)) - np.repeat(starts, counts)


def near_facets_up_to(
    tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop, along: np.ndarray, upper: float,
    max_facets: int,
) -> Facets | None:
    """`near_facets` at a pair of poses; ``None``, after few facets, where more than about ``max_facets`` are near."""
    facets, exceeds = near_facets_if_few(tree, packed, A, B, along, np.array([upper]), max_facets)
    return None if exceeds[0] else facets


def near_facets_if_few(
    tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop, along: np.ndarray, upper: np.ndarray,
    max_facets: int,
) -> tuple[Facets, np.ndarray]:
    """(`near_facets` of the poses with at most about ``max_facets``, (n,) bool: the poses with more)."""
    spans, exceeds = _Spans(tree, packed, A, B, along), np.zeros(len(upper), dtype=bool)
    pose, place, bound = map(
        np.concatenate, zip(*_walk(tree, spans, upper, np.arange(len(upper)), (max_facets, exceeds)))
    )
    exceeds |= np.bincount(pose, minlength=len(exceeds)) > max_facets
    some = ~exceeds[pose]
    return Facets(pose[some], place[some], bound[some]), exceeds


def near_facets(
    tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop, along: np.ndarray, upper: np.ndarray
) -> Facets:
    """Facets of A not proven farther than ``upper`` (n,) from the set at B, at n pairs of poses.

    along : (n, 3) a direction worth trying, of any length.
    """
    spans = _Spans(tree, packed, A, B, along)
    blocks = _walk(tree, spans, upper, np.arange(len(upper)))
    return Facets(*(np.concatenate(column) for column in zip(*blocks)))


def likely_facets(
    tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop, along: np.ndarray
) -> np.ndarray:
    """(n,) a facet that is likely to meet the set, at n pairs of poses, by its place in the order of the tree: down the
    tree through the box whose bound is the least; O(depth) boxes a pose. Proves nothing."""
    spans, links, scale = _Spans(tree, packed, A, B, along), tree.links(), np.ldexp(1.0, tree.exponent)
    link, going = np.zeros(len(along), dtype=np.int64), np.arange(len(along))
    while len(going):
        at = link[going]
        centres, half_lengths = ((of.reshape(-1, 3) * scale) for of in tree.boxes(at))
        bounds = spans.of_boxes(np.repeat(going, WIDTH), tree.centre + centres, half_lengths).reshape(-1, WIDTH)
        nearest = np.where(tree.used(at), bounds, np.inf).argmin(axis=1)
        link[going] = links[at, nearest]
        going = going[link[going] >= 0]
    return leaf_runs(link)[0]


def _walk(tree: MeshTree, spans: _Spans, upper: np.ndarray, poses: np.ndarray, limit: tuple | None = None):
    """Yields (pose, place, bound) of the facets that may be near enough, block by block.

    limit : (how many boxes a pose may have, each with a facet inside; mask (n,) of poses with more, marked by the walk
        and left out).
    """
    links = tree.links()
    pose, at = poses, np.zeros(len(poses), dtype=np.int64)
    runs = []
    while len(at):
        centres, half_lengths = tree.boxes(at)
        used = half_lengths[:, :, 0] > NOTHING / 2
        pose = np.repeat(pose, WIDTH).reshape(-1, WIDTH)[used]
        link = links[at][used].astype(np.int64)
        scale = np.ldexp(1.0, tree.exponent)
        centres = tree.centre + centres[used] * scale
        near = ~(spans.of_boxes(pose, centres, half_lengths[used] * scale) > upper[pose])
        pose, link = pose[near], link[near]
        leaf = link < 0
        runs.append((pose[leaf], link[leaf]))
        pose, at = pose[~leaf], link[~leaf]
        if limit is not None:
            boxes = sum(np.bincount(of, minlength=len(limit[1])) for of in (pose, *(run for run, _ in runs)))
            limit[1][boxes > limit[0]] = True
            pose, at = pose[~limit[1][pose]], at[~limit[1][pose]]
        if len(at) * WIDTH > _MAX_BOXES and len(poses) > 1:
            half = len(poses) // 2
            yield from _walk(tree, spans, upper, poses[:half], limit)
            yield from _walk(tree, spans, upper, poses[half:], limit)
            return
    pose, link = (np.concatenate(column) for column in zip(*runs))
    if limit is not None:
        pose, link = pose[~limit[1][pose]], link[~limit[1][pose]]
    first, count = leaf_runs(link)
    pose = np.repeat(pose, count)
    place = np.repeat(first - (np.cumsum(count) - count), count) + np.arange(len(pose))
    for begin in range(0, max(len(pose), 1), _MAX_BOXES):
        some = slice(begin, begin + _MAX_BOXES)
        bound = spans.of_triangles(pose[some], tree.triangles[place[some]].reshape(-1, 3, 3))
        near = ~(bound > upper[pose[some]])
        yield pose[some][near], place[some][near], bound[near]


class _Spans:
    """A convex set between pairs of planes, and the mesh's frame along their normals, pose by pose.

    Everything is relative to the origin of A's frame.
    """

    def __init__(self, tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop, along: np.ndarray):
        RA, RB = A.X[:, :3, :3], B.X[:, :3, :3]
        D = np.concatenate([RA.transpose(0, 2, 1), RB.transpose(0, 2, 1), along[:, None]], axis=1)
        lengths = np.sqrt(_dot(D, D))
        D = np.where(lengths[:, :, None] > 0.0, D / np.where(lengths > 0.0, lengths, 1.0)[:, :, None], 0.0) * _SHORTER
        t = B.X[:, :3, 3] - A.X[:, :3, 3]
        across = _dot(D, t[:, None])
        self.along = _turned(D, RA)
        g = _turned(D, RB)
        slop = (packed.radius + packed.slop + A.slop + B.slop)[:, None]
        self.high = across + _support(packed, g) + slop
        self.low = across - _support(packed, -g) - slop
        reach_a = _dot(np.abs(self.along), tree.numbers[REACH : REACH + 3])
        reach_b = packed.reach * np.sqrt(_dot(g, g))
        self.slack = _ROUNDING * (reach_a + reach_b + np.abs(t).sum(axis=1)[:, None] + slop)
        self.worth = np.stack([_worth(D[:, :3]), _worth(D[:, 3:6])], axis=1)

    def of_boxes(self, pose, centres, half_lengths) -> np.ndarray:
        """(k,) bounds for boxes of the mesh's frame, by centres and half lengths (k, 3)."""
        along = self.along[pose]
        middle, half = _dot(along, centres[:, None]), _dot(np.abs(along), half_lengths[:, None])
        return self._bound(pose, middle - half, middle + half)

    def of_triangles(self, pose, corners) -> np.ndarray:
        """(k,) bounds for triangles (k, 3, 3) of the mesh's frame."""
        products = _dot(self.along[pose][:, None], corners[:, :, None])
        return self._bound(pose, products.min(axis=1), products.max(axis=1))

    def _bound(self, pose, low, high) -> np.ndarray:
        gaps = np.maximum(self.low[pose] - high, low - self.high[pose]) - self.slack[pose]
        positive = np.maximum(gaps, 0.0)
        of_a, of_b = (np.sqrt(_dot(positive[:, k : k + 3], positive[:, k : k + 3])) for k in (0, 3))
        bound = np.maximum(of_a * self.worth[pose, 0], of_b * self.worth[pose, 1])
        return np.where(bound > 0.0, np.maximum(bound, gaps[:, 6]), gaps.max(axis=1))


def _worth(D: np.ndarray) -> np.ndarray:
    """(n,) what a diagonal over gaps along three unit vectors is worth: 1 over the root of their Gram matrix's norm."""
    gram = _dot(D[:, :, None], D[:, None])
    return (1 - 2.0**-40) / np.sqrt(np.abs(gram).sum(axis=2).max(axis=1) + 2.0**-40)


def _support(packed: PackedConvex, g: np.ndarray) -> np.ndarray:
    """(…,) support values of a core along g (…, 3)."""
    if packed.kind == POINTS and len(packed.points) > _MAX_SCANNED:
        return _support_by_tree(packed, g)
    if packed.kind == POINTS:
        return _dot(g[:, :, None], packed.points).max(axis=-1)
    return CURVED[packed.kind].extents(packed.params, g)


def _support_by_tree(packed: PackedConvex, g: np.ndarray) -> np.ndarray:
    """The same of many points, from above: high ends of boxes whose axes are the directions, three at a time."""
    table, which = ShapeTable([packed]), np.zeros(-(-g[..., 0].size // 3), dtype=np.int64)
    table.build_trees(which)
    X = np.tile(np.eye(4), (len(which), 1, 1))
    rows = X[:, :3, :3].reshape(-1, 3).copy()
    rows[: g[..., 0].size] = g.reshape(-1, 3)
    X[:, :3, :3] = rows.reshape(-1, 3, 3)
    poses = pose_table(X, np.tile(np.eye(4), (len(X), 1, 1)), np.full(len(X), packed.reach), terms=False)
    highs = boxes_of(table, poses.rows, which)[:, 3:].reshape(-1)[: g[..., 0].size]
    return highs.reshape(g.shape[:-1]) - packed.radius


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products along the last axis, added in one order whatever the batch."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _turned(D: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(n, k, 3) directions (n, k, 3) times matrices (n, 3, 3): what they are in the frame turned."""
    return D[:, :, 0, None] * R[:, None, 0] + D[:, :, 1, None] * R[:, None, 1] + D[:, :, 2, None] * R[:, None, 2]
