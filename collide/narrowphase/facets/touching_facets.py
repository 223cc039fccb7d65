"""Meshes that touch other bodies within rounding: facet by facet, by the convex engine.

A triangle is a convex set, swept by a ball or not, so each pair of a facet and a convex set, or of two facets, is
decided exactly: on the poses as given, and in unions on the exact product of the union's pose and the part's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.base.poses_at import poses_at
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import Body, PosesWithSlop, body_of, has_facets, is_halfspace, origin_body
from collide.lowering.packed_convex import PackedConvex, pack_points
from collide.lowering.parts import bounding_parts_of, convex_set_of
from collide.lowering.shape_table import ShapeTable, moved_pose, pose_table
from collide.narrowphase.bounds import PROMISE_STORED
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.narrowphase.facets.facet_queries import facets_within, points_in_solid, surface_distances
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT, OPEN
from collide.narrowphase.facets.near_facets import near_facets_if_few
from collide.narrowphase.facets.winding_numbers import OUTSIDE
from collide.narrowphase.fallback_searches import lay_points_apart
from collide.results import EXACT, UNDECIDED, flipped
from collide.shapes.mesh import Mesh
from collide.shapes.shape import IDENTITY, Shape
from collide.shapes.swept_mesh import SweptMesh

#: Of more pairs of facets than this the sign stays open; pairs asked at once, nearest first: so many, then so many
#: times more.
_MAX_PAIRS, _FIRST_ROUND, _GROWTH = 1 << 14, 8, 4
#: Of the sum of the radii: it is rounded itself.
_ROUNDED = 1.0 + 2.0**-50
#: Stands for the whole of a convex shape among facet numbers.
_WHOLE = -1


class Touching(NamedTuple):
    """What is proven of two bodies.

    is_hit : whether both share a point, ``None`` where open.   row : (1,) of the deciding pair of facets, the nearest
    pair of bodies apart.
    """

    is_hit: bool | None
    row: np.ndarray


class PosedPart(NamedTuple):
    """A mesh or a convex shape, the pose (4, 4) of the surrounding union in the world, and of the part in the union."""

    shape: Shape
    X_WB: np.ndarray
    X_BP: np.ndarray = IDENTITY

    def placed(self) -> PosesWithSlop:
        """The pose (1, 4, 4) in the world, rounded, and the slop of points that the facets and the shape reach to."""
        reach = np.array([bounding_parts_of(self.shape)[0][0].reach])
        return PosesWithSlop(*moved_pose(self.X_WB[None], self.X_BP, reach))

    def packed(self, facet: int) -> PackedConvex:
        """A facet of a mesh, with the ball swept over it, or the whole of a convex shape."""
        if facet == _WHOLE:
            return convex_set_of(self.shape.convex_hull if isinstance(self.shape, Mesh) else self.shape)
        mesh, radius = (self.shape.mesh, self.shape.radius) if isinstance(self.shape, SweptMesh) else (self.shape, 0.0)
        return pack_points(mesh.vertices[mesh.faces[facet]], radius)  # type: ignore[attr-defined]


def settle_states(states: np.ndarray, part_at: Callable[[int], tuple[PosedPart, PosedPart]]) -> None:
    """Settle states (n,) left OPEN, in place; part_at: both bodies of pair k."""
    for k in np.flatnonzero(states == OPEN).tolist():
        touching = settle_touching(*part_at(k))
        if touching is not None and touching.is_hit is not None:
            states[k] = HIT if touching.is_hit else APART


def settle_rows(rows: np.ndarray, part_at: Callable[[int], tuple[PosedPart, PosedPart]], limit: float) -> None:
    """Settle rows (n,) left undecided, in place; part_at: both bodies of pair k.   limit : as in `distance`."""
    for k in np.flatnonzero(rows["how"] == UNDECIDED).tolist():
        touching = settle_touching(*part_at(k))
        if touching is not None and touching.is_hit:
            row = rows[k : k + 1]
            row["hit"], row["how"], row["upper"] = True, EXACT, np.minimum(row["upper"], 0.0)
            row["distance"] = np.minimum(row["distance"], row["upper"])
            row["lower"] = np.minimum(row["lower"], row["distance"])
            size = np.abs(row["point_a"]).max() + np.abs(row["point_b"]).max()
            row["certified"] = row["upper"] - row["lower"] <= PROMISE_STORED * size
        elif touching is not None and touching.is_hit is False:
            make_gaps(rows, np.array([k]), touching.row, limit)


def make_gaps(rows: np.ndarray, which: np.ndarray, apart: np.ndarray, limit: float) -> None:
    """Make undecided rows gaps, in place, where rows ``apart`` of what holds the bodies are proven above 0."""
    row = rows[which]
    row["hit"], row["how"], row["normal"] = False, apart["how"], apart["normal"]
    row["lower"] = apart["lower"]
    row["beyond"] = row["lower"] > limit
    row["certified"] = row["beyond"]
    upper = np.maximum(row["upper"], row["lower"])
    row["distance"] = np.where(row["beyond"], row["lower"], np.clip(apart["distance"], row["lower"], upper))
    row["upper"] = np.where(row["beyond"], math.inf, upper)
    lay_points_apart(row, np.arange(len(row)))
    rows[which] = row


def settle_touching(A: PosedPart, B: PosedPart) -> Touching | None:
    """What facets prove of two bodies, a mesh among them; ``None`` where too many facets, or none, are near, and where
    a body may lie inside the other."""
    if _comes_first(B, A):
        swapped = settle_touching(B, A)
        return None if swapped is None else swapped._replace(row=flipped(swapped.row))
    pairs = _near_pairs(A, B, A.placed(), B.placed())
    return None if pairs is None or not len(pairs) else _asked(A, B, pairs)


def _asked(A: PosedPart, B: PosedPart, pairs: np.ndarray) -> Touching:
    """What pairs (k, 2) of facets prove, the nearest first: by the first meeting pair, or by all pairs apart."""
    (of_a, a), (of_b, b) = (np.unique(column, return_inverse=True) for column in pairs.T)
    packed = [side.packed(k) for side, facets in ((A, of_a), (B, of_b)) for k in facets.tolist()]
    counts = len(of_a), len(of_b)
    X_W, X_P = (
        np.concatenate([np.repeat(X[None], n, axis=0) for X, n in zip(of, counts)])
        for of in ((A.X_WB, B.X_WB), (A.X_BP, B.X_BP))
    )
    poses = pose_table(X_W, X_P, np.array([part.reach for part in packed]))
    table, numbers = ShapeTable(packed), np.stack([a.ravel(), len(of_a) + b.ravel()], axis=1)
    begin, size, nearest, is_open = 0, _FIRST_ROUND, None, False
    while begin < len(pairs):
        some = numbers[begin : begin + size]
        rows = run_pairs(table, poses, np.arange(len(packed)), some, boolean=False, limit=math.inf, depths=False)
        met = np.flatnonzero(rows["hit"] & (rows["how"] != UNDECIDED))
        if len(met):
            return Touching(True, rows[met[:1]])
        is_open |= bool(rows["hit"].any())
        k = int(rows["lower"].argmin())
        nearest = rows[k : k + 1] if nearest is None or rows["lower"][k] < nearest["lower"][0] else nearest
        begin, size = begin + size, _GROWTH * size
    assert nearest is not None
    return Touching(None if is_open else False, nearest)


def _comes_first(A: PosedPart, B: PosedPart) -> bool:
    """Whether A stands before B, so that swapped questions are worked out on the same numbers: meshes first."""
    if is_mesh(A.shape) != is_mesh(B.shape):
        return is_mesh(A.shape)
    if not is_mesh(A.shape):
        return False
    return (body_of(A.shape).key, *_poses(A)) < (body_of(B.shape).key, *_poses(B))


def _poses(part: PosedPart) -> tuple[list, list]:
    return part.X_WB.tolist(), part.X_BP.tolist()


def is_mesh(shape: Shape) -> bool:
    """Whether a shape is a mesh, or a mesh swept by a ball."""
    return isinstance(shape, (Mesh, SweptMesh))


def _near_pairs(A: PosedPart, B: PosedPart, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray | None:
    """(k, 2) pairs of facets of A and of B, or wholes, that may touch, the nearest first: a pair farther apart at the
    rounded poses than the radii and both slops is apart. ``None`` of too many, and where insides may meet."""
    if is_halfspace(B.shape):
        return np.array([[_WHOLE, _WHOLE]])  # a half-space meets a mesh where it meets the hull
    slop = 1.001 * float(PA.slop[0] + PB.slop[0])
    a = body_of(A.shape)
    if not (has_facets(B.shape) or is_mesh(B.shape)):
        E = enclosure_of(B.shape)
        across = PB.X[:, :3, 3] - PA.X[:, :3, 3]
        listed, exceeds = near_facets_if_few(a.tree, E.packed, PA, PB, across, np.zeros(1), _MAX_PAIRS)
        if exceeds[0] or not _is_outside(E.outer, a, PB, PA, slop):
            return None
        return np.stack([a.tree.ids[listed.place], np.full(len(listed.place), _WHOLE)], axis=1)
    b = body_of(B.shape)
    radius = a.radius + b.radius
    near = facets_within(a.tree, b.tree, PA.X[0], PB.X[0], (radius + slop) * _ROUNDED, _MAX_PAIRS)
    if near is None:
        return None
    if slop > 0.0 and not (_is_outside(a, b, PA, PB, slop) and _is_outside(b, a, PB, PA, slop)):
        return None
    facets = near.facets[np.argsort(near.lower, kind="stable")]
    if not is_mesh(B.shape):
        facets[:, 1] = _WHOLE
        facets = facets[np.sort(np.unique(facets[:, 0], return_index=True)[1])]
    return facets


def _is_outside(A: Body, B: Body, PA: PosesWithSlop, PB: PosesWithSlop, slop: float) -> bool:
    """Whether no connected part of A is inside B without touching B's facets: a point of each is outside, farther from
    the facets than rounding moves it."""
    if not B.solid:
        return True
    points = A.points
    if len(points) == 1:  # a single part may be told by any corner: the farthest
        corners = np.concatenate([points, A.tree.triangles.reshape(-1, 3)])
        middle = PB.X[0, :3, :3] @ B.centre + PB.X[0, :3, 3]
        away = corners @ PA.X[0, :3, :3].T + (PA.X[0, :3, 3] - middle)
        points = corners[[np.square(away).sum(axis=1).argmax()]]
    at = poses_at(points @ PA.X[0, :3, :3].T + PA.X[0, :3, 3])
    gaps = surface_distances(B.tree, origin_body().tree, PB.X[0], at).lower
    size = np.abs(at[:, :3, 3]).max() + np.abs(points).max()
    return bool(
        (gaps > slop + 2.0**-48 * size).all() and (points_in_solid(B.tree, PB.X[0], np.zeros(3), at) == OUTSIDE).all()
    )
