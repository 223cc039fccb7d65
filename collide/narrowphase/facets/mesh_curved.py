"""Meshes against convex shapes without exact facets: cylinders, cones, ellipsoids, polytopes with rounded corners.

A kernel that asks the facets near the shape decides most poses. A polytope around the shape and a polytope inside
decide without rounding wherever the surface of the mesh does not pass between them. Elsewhere facets that may be near
enough are asked about, nearest first: the convex engine proves a bracket for each, and the mesh's bracket is the least.
Signs left open by the brackets stay open.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from collide.lowering.enclosures import Enclosure
from collide.lowering.facet_bodies import Body, PosesWithSlop, as_given, hull_of, reach_of
from collide.lowering.packed_convex import POINTS
from collide.mesh.bvh import MeshTree
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.convex_batches import convex_rows
from collide.narrowphase.convex_kernel_calls import finish_distances, leaving_touching_open, number_of_poses
from collide.narrowphase.facets.facet_kernel_calls import balls_farther, core_hits, farthest_gap, hull_rows
from collide.narrowphase.facets.facet_queries import points_in_solid, surface_distances
from collide.narrowphase.facets.facets_against_curved import facet_rows
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT, OPEN
from collide.narrowphase.facets.near_facets import Facets, likely_facets, near_facets, near_facets_if_few
from collide.narrowphase.facets.nearest_item_calls import facets_of, gap_rows, serves, surface_states
from collide.narrowphase.facets.separating_translation import separating_translation, write_depth
from collide.narrowphase.facets.winding_numbers import OUTSIDE
from collide.narrowphase.fallback_searches import lay_points_apart
from collide.results import EXACT, FIELDS, PAIR_DTYPE, UNDECIDED

#: Facets of a pose that are asked about together: so many first, then so many times more.
_FIRST_ROUND, _GROWTH = 8, 4
#: Of more that may touch at a pose, a likely one and the hull are asked before all are gone through.
_MAX_NEAR_FACETS = 128


class CurvedStates(NamedTuple):
    """n poses of a mesh A and a shape B.

    state : (n,) APART, HIT or OPEN.   how : (n,) index into `results.HOW`.
    point : (n, 3) of the world, in both bodies where either lies inside the other, else NaN.
    place : (n,) the triangle that meets B, or may, in the order of the tree; −1 where no triangle was looked for.
    """

    state: np.ndarray
    how: np.ndarray
    point: np.ndarray
    place: np.ndarray


def curved_states(A: Body, E: Enclosure, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool = False) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4) or (1, 4, 4); check: refuse matrices that are no rotation."""
    n = number_of_poses(X_WA, X_WB)
    near = np.flatnonzero(core_hits(A, E.outer, X_WA, X_WB, check=check).core)
    states = np.full(n, APART)
    if len(near):
        PA, PB = (as_given(np.broadcast_to(X, (n, 4, 4))[near]) for X in (X_WA, X_WB))
        states[near] = settle_curved(A, E, PA, PB, outer_meets=True).state
    return states


def settle_curved(
    A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, *, outer_meets: bool = False
) -> CurvedStates:
    """Whether a mesh and a shape share a point, proven for the poses and everything within their slops.

    outer_meets : the polytope around the shape is known to meet the mesh at all poses, without slop. The polytope
    inside is then asked before the facets: searches of depths ask near the surface, among many facets.
    """
    n = len(PA.X)
    states = CurvedStates(np.full(n, OPEN), np.full(n, EXACT), np.full((n, 3), np.nan), np.full(n, -1))
    exact = np.flatnonzero((PA.slop == 0.0) & (PB.slop == 0.0))
    by_polytopes = partial(_settle_by_polytopes, outer_meets=outer_meets)
    ways = (by_polytopes, _settle_by_walk) if outer_meets else (_settle_by_walk, by_polytopes)
    for settle in ways:
        exact = exact[states.state[exact] == OPEN]
        if len(exact):
            settle(A, E, PA.X, PB.X, exact, states)
    remaining = np.flatnonzero(states.state == OPEN)
    if len(remaining):
        # Refuses poses that are none.
        where = points_in_solid(A.tree, PA.X[remaining], E.outer.points[0], PB.X[remaining])
        _settle_by_facets(A, E, PA, PB, remaining, states)
        if A.solid:
            inside = remaining[(states.state[remaining] == APART) & (where != OUTSIDE)]
            states.state[inside], states.how[inside] = HIT, EXACT
            states.point[inside] = _moved(PB.X[inside], E.outer.points[0])
    return states


def _settle_by_walk(A: Body, E: Enclosure, X_WA, X_WB, poses: np.ndarray, states: CurvedStates) -> None:
    """HIT where a facet meets the shape, or the shape lies inside the mesh, APART where neither does."""
    if not serves(E.packed):
        return
    surface = surface_states(facets_of(A), E.packed, X_WA[poses], X_WB[poses])
    states.state[poses[surface.apart]] = APART
    meeting = poses[surface.meets]
    states.state[meeting], states.how[meeting] = HIT, surface.how[surface.meets]
    states.place[meeting] = surface.place[surface.meets]
    inside = poses[surface.maybe_inside]
    if A.solid and len(inside):
        inside = inside[points_in_solid(A.tree, X_WA[inside], E.outer.points[0], X_WB[inside]) != OUTSIDE]
        states.state[inside], states.point[inside] = HIT, _moved(X_WB[inside], E.outer.points[0])


def _settle_by_polytopes(
    A: Body, E: Enclosure, X_WA, X_WB, poses: np.ndarray, states: CurvedStates, outer_meets: bool
) -> None:
    """APART where the mesh misses the polytope around the shape, HIT where the mesh meets the polytope inside."""
    if not outer_meets:
        meets = core_hits(A, E.outer, X_WA[poses], X_WB[poses]).core
        states.state[poses[~meets]] = APART
        poses = poses[meets]
    if E.inner is not None and len(poses):
        inner = core_hits(A, E.inner, X_WA[poses], X_WB[poses])
        states.state[poses[inner.core]] = HIT
        states.point[poses] = inner.inside


def _settle_by_facets(
    A: Body, E: Enclosure, X_WA: PosesWithSlop, X_WB: PosesWithSlop, poses: np.ndarray, states: CurvedStates
) -> None:
    """Ask about every facet that may touch, until a facet does. Where many may, as of a mesh wholly between the
    polytopes, a likely facet is asked first, then the mesh's hull, before all facets are gone through.

    A mesh is within its hull: where the hull is farther from the shape than rounding moved both, mesh and shape are
    apart.
    """
    n, PA, PB = len(poses), X_WA.of(poses), X_WB.of(poses)
    hit, ambiguous = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    how, place = np.full(n, EXACT), np.full(n, -1)

    def ask(pose: np.ndarray, facets: np.ndarray) -> None:
        rows = facet_rows(A.tree, E.packed, PA, PB, pose, facets, boolean=True, limit=0.0)
        for k in np.flatnonzero(rows["hit"]).tolist():
            p, proven = pose[k], rows["how"][k] != UNDECIDED
            if not hit[p] and (proven or not ambiguous[p]):
                place[p], how[p] = facets[k], rows["how"][k]
            hit[p] |= proven
            ambiguous[p] |= not proven

    def ask_all(near: Facets, of: np.ndarray) -> None:
        for some in _rounds(near, lambda facets: ~hit[of[facets.pose]]):
            ask(of[near.pose[some]], near.place[some])

    across, nothing = _across(A, E, PA, PB), np.zeros(n)
    near, exceeds = near_facets_if_few(A.tree, E.packed, PA, PB, across, nothing, _MAX_NEAR_FACETS)
    ask_all(near, np.arange(n))
    remaining = np.flatnonzero(exceeds)
    if len(remaining):
        ask(remaining, likely_facets(A.tree, E.packed, PA.of(remaining), PB.of(remaining), across[remaining]))
        remaining = remaining[~hit[remaining]]
        remaining = remaining[~_hulls_apart(A, E, PA.of(remaining), PB.of(remaining))]
        if len(remaining):
            at = PA.of(remaining), PB.of(remaining)
            ask_all(near_facets(A.tree, E.packed, *at, across[remaining], nothing[remaining]), remaining)
    states.state[poses] = np.where(hit, HIT, np.where(ambiguous, OPEN, APART))
    states.how[poses], states.place[poses] = how, place


def _hulls_apart(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    """(n,) bool: whether the hull of a mesh is proven apart from a shape."""
    slop = PA.slop + PB.slop
    rows = convex_rows(hull_of(A), hull_of(E.outer), PA.X, PB.X, limit=float(slop.max(initial=0.0)), depths=False)
    return rows["lower"] > 1.001 * slop


def _rounds(near: Facets, wanted):
    """Yields indices of facets to be asked about next: nearest first, as many of every pose whatever the others."""
    ranks = near.ranks()
    begin, size = 0, _FIRST_ROUND
    end = int(ranks.max()) + 1 if len(ranks) else 0
    while begin < end:
        some = np.flatnonzero((ranks >= begin) & (ranks < begin + size))
        some = some[wanted(near)[some]]
        if len(some):
            yield some
        begin += size
        size *= _GROWTH


def _across(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    """(n, 3) from the mesh's middle to the shape's."""
    return _moved(PB.X, E.outer.centre) - _moved(PA.X, A.centre)


def _moved(X: np.ndarray, point: np.ndarray) -> np.ndarray:
    return (X[..., :3, :3] * point).sum(axis=-1) + X[..., :3, 3]


# --- rows ---------------------------------------------------------------------------------------


def curved_rows(
    A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, *, limit: float, depths: bool
) -> np.ndarray:
    """Rows (PAIR_DTYPE) of a mesh A and a shape B; limit, depths as in `distance`, depths of poses without slop
    only."""
    rows = np.zeros(len(PA.X), dtype=PAIR_DTYPE)
    rows["vertices_a"] = rows["vertices_b"] = -1
    exact = (PA.slop == 0.0) & (PB.slop == 0.0)
    far = exact & _balls_beyond(A, E, PA.X, PB.X, limit)
    rows[far] = _beyond(A, E, PA.X[far], PB.X[far], limit)
    near = np.flatnonzero(~far)
    if not len(near):
        return rows
    states = settle_curved(A, E, PA.of(near), PB.of(near))
    for group, reach in ((exact[near], limit), (~exact[near], math.inf)):  # what is seen must not depend on the batch
        apart = near[(states.state == APART) & group]
        if len(apart):
            rows[apart] = _gaps(A, E, PA.of(apart), PB.of(apart), reach, limit)
    for k in np.flatnonzero(states.state != APART).tolist():
        _write_overlap(rows[near[k]], A, E, PA.of(near[k : k + 1]), PB.of(near[k : k + 1]), states, k, depths)
    return rows


def _balls_beyond(A: Body, E: Enclosure, X_WA: np.ndarray, X_WB: np.ndarray, limit: float) -> np.ndarray:
    """(n,) bool: whether balls around both are beyond the limit, no traversal being wanted to see it."""
    if limit > farthest_gap(A, E.outer):
        return np.zeros(len(X_WA), dtype=bool)
    return balls_farther(A.tree.numbers, E.outer.tree.numbers, X_WA, X_WB, math.nextafter(limit, math.inf))


def _gaps(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, reach: float, limit: float) -> np.ndarray:
    """Rows of bodies that are known to be apart; only what is no farther than ``reach`` [m] is looked for."""
    rows = np.zeros(len(PA.X), dtype=PAIR_DTYPE)
    facets = _first_facets(A, E, PA, PB, reach)
    seen, unseen = np.flatnonzero(facets >= 0), np.flatnonzero(facets < 0)
    if len(seen):
        rows[seen] = _nearest(A, E, PA.of(seen), PB.of(seen), facets[seen])
    if reach <= farthest_gap(A, E.outer):
        rows[unseen] = _beyond(A, E, PA.X[unseen], PB.X[unseen], reach)
    else:
        for k in unseen.tolist():
            rows[k] = _far(A, E, PA, PB, k, reach)
    rows["vertices_a"] = rows["vertices_b"] = -1
    rows["hit"] = False
    beyond = (rows["lower"] > limit) | rows["beyond"]
    rows["beyond"], rows["certified"] = beyond, rows["certified"] | beyond
    rows["distance"][beyond], rows["upper"][beyond] = rows["lower"][beyond], math.inf
    return rows


def _first_facets(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, reach: float) -> np.ndarray:
    """(n,) a facet of the mesh near the shape; −1 where every facet is proven farther away than ``reach`` [m].

    Known by the surface of the polytope around the shape: a point nearer to the shape than the reach either is as near
    to the polytope's surface, or lies inside the polytope. So a part of the mesh wholly inside, however far from the
    surface, is not beyond the reach; a point of every part tells whether a part is inside.
    """
    facets = surface_distances(A.tree, E.outer.tree, PA.X, PB.X, math.nextafter(reach, math.inf)).facets[:, 0].copy()
    unseen = np.flatnonzero(facets < 0)
    if len(unseen) and reach < math.inf:
        enclosed = unseen[core_hits(E.outer, A, PB.X[unseen], PA.X[unseen]).core]
        if len(enclosed):
            nearest = surface_distances(A.tree, E.outer.tree, PA.X[enclosed], PB.X[enclosed]).facets[:, 0]
            facets[enclosed] = np.maximum(nearest, 0)  # any facet will do to begin with
    return facets


def _nearest(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, facets: np.ndarray) -> np.ndarray:
    """Rows of the nearest facets of bodies that are apart; ``facets`` (n,) are numbers of near facets.

    Exact poses go through a kernel each; poses left open by the kernel are asked about round by round.
    """
    exact = np.flatnonzero((PA.slop == 0.0) & (PB.slop == 0.0)) if serves(E.packed) else np.zeros(0, dtype=np.int64)
    rows, remaining = np.zeros(len(facets), dtype=PAIR_DTYPE), np.ones(len(facets), dtype=bool)
    if len(exact):
        rows[exact], is_written = gap_rows(facets_of(A), E.packed, PA.X[exact], PB.X[exact])
        remaining[exact] = ~is_written
    some = np.flatnonzero(remaining)
    if len(some):
        rows[some] = _nearest_by_rounds(A, E, PA.of(some), PB.of(some), facets[some])
    return rows


def _nearest_by_rounds(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, facets: np.ndarray) -> np.ndarray:
    """The same in rounds of many facets of all poses.

    Gaps alone are asked for: where a facet's sign is open, the points of a gap lie on the bodies, those of a depth need
    not.
    """

    def gaps_at(pose: np.ndarray, place: np.ndarray) -> np.ndarray:  # without a limit: the same whatever the batch
        return facet_rows(A.tree, E.packed, PA, PB, pose, place, boolean=False, limit=math.inf, depths=False)

    def may_be_nearer(facets: Facets) -> np.ndarray:
        return (facets.bound <= upper[facets.pose]) & (facets.place != first[facets.pose])

    first = A.tree.places[facets]
    poses, places = [np.arange(len(PA.X))], [first]
    rows = [gaps_at(poses[0], first)]
    upper = rows[0]["upper"].copy()
    near = near_facets(A.tree, E.packed, PA, PB, rows[0]["normal"], upper)
    for some in _rounds(near, may_be_nearer):
        poses.append(near.pose[some])
        places.append(near.place[some])
        rows.append(gaps_at(poses[-1], places[-1]))
        np.minimum.at(upper, poses[-1], rows[-1]["upper"])
    return _least(A, E, PA, PB, np.concatenate(poses), np.concatenate(places), np.concatenate(rows), upper)


def _least(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, pose, place, rows, upper) -> np.ndarray:
    """A row for each pose from the rows of its facets."""
    # The nearest by its upper bound and the width of its bracket: where that is wide, distance and points are guesses.
    order = np.lexsort((place, 2.0 * rows["upper"] - rows["lower"], pose))
    best = order[np.flatnonzero(np.diff(pose[order], prepend=-1))]
    out = np.zeros(len(best), dtype=PAIR_DTYPE)
    for name in FIELDS:  # padding stays 0
        out[name] = rows[best][name]
    out["part_a"], out["part_b"], out["count"], out["iterations"] = A.tree.ids[place[best]], 0, 0, 0
    lower = np.full(len(best), np.inf)
    np.minimum.at(lower, pose, rows["lower"])
    certified = np.ones(len(best), dtype=bool)
    np.logical_and.at(certified, pose, rows["certified"] | (rows["lower"] > upper[pose]))
    out["lower"], out["upper"] = np.maximum(lower, 0.0), np.maximum(upper, 0.0)
    out["distance"] = np.clip(out["distance"], out["lower"], out["upper"])
    zero = out["distance"] == 0.0  # apart, and nearer than the bracket is wide: 0 would say that they touch
    out["distance"][zero] = np.maximum(out["upper"][zero], 5e-324)
    out["upper"] = np.maximum(out["upper"], out["distance"])
    moved = (out["distance"] != rows["distance"][best]) | (rows["how"][best] == UNDECIDED)
    lay_points_apart(out, np.flatnonzero(moved))
    promise = PROMISE_STORED if E.packed.kind == POINTS else PROMISE_CURVED
    out["certified"] = certified | (out["upper"] - out["lower"] <= promise * _size(A, E, PA, PB))
    out["how"][out["how"] == UNDECIDED] = EXACT  # the polytope around it is apart from the mesh
    return out


def _size(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    """(n,) S of `narrowphase/bounds.py`."""
    return reach_of(A) + E.packed.reach + np.sqrt(np.square(PB.X[:, :3, 3] - PA.X[:, :3, 3]).sum(axis=1))


def _far(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, k: int, limit: float):
    """The row of bodies farther apart than boxes of floats can measure: between their hulls, and one point of each."""
    row = hull_rows(A, E.outer, PA.X[k : k + 1], PB.X[k : k + 1], limit)[0]
    slop = float(PA.slop[k] + PB.slop[k])
    row["count"], row["part_a"], row["part_b"], row["iterations"] = 0, 0, 0, 0
    row["lower"] = max(float(row["lower"]) - slop, 0.0)
    across = _moved(PB.X[k], E.outer.points[0]) - _moved(PA.X[k], A.points[0])
    upper = float(np.sqrt(np.square(across).sum())) * (1 + 2.0**-45) + slop
    row["upper"] = max(upper, float(row["upper"]))
    row["certified"] = bool(row["lower"] > 0.0 and row["upper"] - row["lower"] <= PROMISE_STORED * upper)
    return row


def _beyond(A: Body, E: Enclosure, X_WA: np.ndarray, X_WB: np.ndarray, limit: float) -> np.ndarray:
    """Rows of bodies beyond a limit: halfway between their middles, as far apart as is proven."""
    rows = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
    start, end = _moved(X_WA, A.centre), _moved(X_WB, E.outer.centre)
    across = end - start
    length = np.sqrt(np.square(across).sum(axis=1))[:, None]
    normal = np.where(length > 0.0, across / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    rows["distance"] = rows["lower"] = math.nextafter(limit, math.inf)
    rows["upper"], rows["beyond"], rows["how"], rows["normal"] = math.inf, True, EXACT, normal + 0.0
    rows["vertices_a"] = rows["vertices_b"] = -1
    rows["certified"] = True
    half = 0.5 * rows["distance"][:, None] * normal
    rows["point_a"], rows["point_b"] = 0.5 * (start + end) - half, 0.5 * (start + end) + half
    return rows


def _write_overlap(
    row, A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, states: CurvedStates, k: int, depths: bool
) -> None:
    """Make a row the row of bodies that meet, or may meet, in place; a single pair of poses, number k of the states."""
    proven = states.state[k] == HIT
    row["hit"], row["how"] = True, states.how[k] if proven else UNDECIDED
    point, place = states.point[k], states.place[k : k + 1]
    if np.isnan(point[0]) and place[0] >= 0:
        pose = np.zeros(1, dtype=np.int64)
        facets = facet_rows(A.tree, E.packed, PA, PB, pose, place, boolean=False, limit=math.inf, depths=not proven)
        if proven:
            finish_distances(facets, depths=False)  # at a point of both
        facet = facets[0]
        point = 0.5 * (facet["point_a"] + facet["point_b"])
        row["part_a"] = A.tree.ids[place[0]]
        row["upper"] = 0.0 if proven else max(float(facet["upper"]), 0.0)
    elif np.isnan(point[0]):
        meeting = surface_distances(A.tree, E.inner.tree, PA.X, PB.X)  # type: ignore[union-attr]
        point = meeting.point_a[0]
        row["part_a"] = max(int(meeting.facets[0, 0]), 0)
    elif serves(E.packed):
        row["part_a"] = _facet_at(A.tree, PA.X[0], point)
    row["point_a"] = row["point_b"] = point
    row["certified"] = proven
    if depths:
        hulls = hull_rows(A, E.outer, PA.X, PB.X, math.inf)[0]

        def hits(A: Body, B: Body, X_WA, X_WB) -> np.ndarray:
            return curved_states(A, E, X_WA, X_WB) != APART

        with leaving_touching_open():
            translation = separating_translation(A, E.outer, PA.X[0], PB.X[0], hulls, [], hits)
        write_depth(row, point, translation)


def _facet_at(tree: MeshTree, X_WM: np.ndarray, point: np.ndarray) -> int:
    """The facet with the corner nearest to a point of the world: where a vertex of the mesh lies inside a shape."""
    corners = tree.triangles.reshape(-1, 3)
    nearest = np.square(corners - (point - X_WM[:3, 3]) @ X_WM[:3, :3]).sum(axis=1).argmin()
    return int(tree.ids[nearest // 3])
