"""Where rays first meet a shape: `raycast`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from collide.base import argument_checks as checks
from collide.broadphase.box_tree import BoxTree
from collide.broadphase.boxes_ahead import bodies_ahead
from collide.casts.cast_arguments import checked_rays
from collide.casts.directions import Directions
from collide.casts.grid_rays import begin_in_cells, on_surface
from collide.casts.items_ahead import nearest_first
from collide.casts.leaves import leaves_of, meshed_leaves
from collide.casts.posed_parts import posed_parts
from collide.casts.ray_facets import facets_met
from collide.casts.ray_hits import RayEvents, RayHits, as_hits, in_order, joined, no_hit
from collide.casts.ray_parts import parts_met
from collide.casts.ray_planes import planes_met
from collide.kernels import address_of
from collide.lowering.compound_layout import layout_of, part_balls
from collide.lowering.compound_table import Balls
from collide.lowering.facet_bodies import body_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import moved_pose
from collide.narrowphase.composite.balls_on_ways import SingleWay, near_on_ways
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.fields.field_items import NamedUnion, items_on_way, rounding_of_places
from collide.narrowphase.fields.items_of import items_of
from collide.narrowphase.fields.occupied_cells import Cells
from collide.narrowphase.fields.swept_triangles import SweptTriangles
from collide.narrowphase.fields.terrain_columns import Columns
from collide.narrowphase.prepared_pairs import single_calls_are_safe
from collide.shapes.compound import Compound
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import IDENTITY, Shape, checked_shape, kept_with_shape
from collide.transforms import poses_as_given

#: Boxes of items that are meshes are put into a tree where there are so many for each pose that rays see them at.
_LEAST_ITEMS = 16


def raycast(
    shape: Shape,
    X_WA,
    origins_W,
    directions_W,
    *,
    max_distance: float = math.inf,
    all_hits: bool = False,
    check_poses: bool = True,
) -> RayHits:
    """Where rays first meet the surface of a shape.

    Parameters
    ----------
    shape : any shape. Polytopes take part with the triangles of their hulls, unions with their items.
    X_WA : (4, 4) pose of the shape in the world W [m], or (N, 4, 4), a pose for each ray.
    origins_W : (3,) or (N, 3) where rays begin, in W [m], within 1e50.
    directions_W : (3,) or (N, 3) in W; they need not be unit vectors. A single pose, origin or direction goes with all
        of the others.
    max_distance : [lengths of the direction], ≥ 0: t up to which the surface counts.
    all_hits : report every place where a ray meets the surface, not only the first: all facets, both ends of the way
        through a curved shape.
    check_poses : refuse matrices that are no rotation.

    Returns
    -------
    RayHits. Surfaces are closed sets: a ray through a common edge or corner meets all facets around, a ray from the
        surface meets the surface at 0, a ray in a facet's plane meets the facet where entering. From inside a solid a
        ray meets the wall on its way out; `contains` says what is inside. In a `Compound` walls inside other items
        count, too, in a `VoxelGrid` faces between occupied cells do not. The same bits in single calls and in batches.

    Raises
    ------
    InvalidArgument : numbers not finite, directions of length 0 or with components that differ by more than 2^500,
        unequal lengths of batches.
    InvalidPose : matrices that are no pose.

    Notes
    -----
    Closed forms with error bounds, 0.03 to 0.1 µs a ray in kernels; meshes and polytopes by the tree of their facets,
    1.5 to 2.5 µs a ray through 2,000 to 200,000 facets, about O(log n) for well-shaped ones. Rays that doubles leave
    open of polytopes and meshes (through edges, along facets) take 0.1 ms a facet to some milliseconds.
    """
    is_plain = check_poses is True and all_hits is False and max_distance.__class__ is float and max_distance >= 0.0
    is_union = is_plain and isinstance(shape, Compound) and single_calls_are_safe()
    if is_union and _way_of(shape).ray_misses(X_WA, origins_W, directions_W, max_distance):
        return no_hit()
    checked_shape("raycast: shape", shape)
    limit = checks.limit("raycast: max_distance", max_distance, "")
    X_WA, single_pose = poses_as_given(X_WA, "X_WA", check=check_poses)
    origins, directions, single = checked_rays("raycast", origins_W, directions_W, X_WA=len(X_WA))
    all_hits = checks.true_or_false("raycast: all_hits", all_hits)
    events = surfaces_met(shape, X_WA, origins, directions, limit, every=all_hits)
    return as_hits(events, origins, directions, every=all_hits, single=single_pose and single and not all_hits)


def surfaces_met(
    shape: Shape, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, *, every: bool
) -> RayEvents:
    """Events of n rays and one shape at checked poses (n, 4, 4) or (1, 4, 4), in order.

    every : all events; else at least the first of each ray, and candidates for an earlier event.
    """
    if isinstance(shape, HPolytope) and shape.is_region:
        return planes_met(shape, X_WA, origins, directions, limit, every=every)
    if _is_facets(shape):
        return facets_met(body_of(shape), X_WA, origins, directions, limit, every)
    if shape.is_field:
        return _on_field(shape, X_WA, origins, directions, limit, every)
    if not isinstance(shape, Compound):
        number, near = np.zeros(1, dtype=np.int64), np.ones((len(origins), 1), dtype=bool)
        return in_order(_on_parts([(shape, IDENTITY)], number, X_WA, origins, directions, limit, every, near))
    items = leaves_of(shape)
    meshed = meshed_leaves(shape)
    numbers = np.arange(len(items))
    near = _near_leaves(shape, X_WA, origins, directions, limit)
    convex = numbers[~meshed & near.any(axis=0)]
    events = [
        _on_parts([items[k] for k in convex], convex, X_WA, origins, directions, limit, every, near[:, convex])
    ]

    def ask(k: int, ray: np.ndarray) -> RayEvents:
        """Events of some rays, by number, and mesh k."""
        X = X_WA[ray] if len(X_WA) > 1 else X_WA
        of_rays = Directions(directions.vectors[ray], directions.exponents[ray])
        met = _on_mesh(*items[k], X, origins[ray], of_rays, limit, every)
        return met._replace(ray=ray[met.ray], item=np.full_like(met.item, k))

    events += _on_meshes(shape, numbers[meshed], X_WA, origins, directions, limit, every, ask)
    return in_order(joined(events))


def _on_field(
    field: Shape, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Events of n rays and a field: the items that a ray may meet first, as convex parts. Rays beginning in cells see
    all walls on the way, since walls between cells are left out.
    """
    items, limits, events = items_of(field), directions.limits(limit), []
    if isinstance(items, SweptTriangles):
        return _on_swept_triangles(items, X_WA, origins, directions, limit, every)
    if isinstance(items, Columns):
        return _on_terrain(items, X_WA, origins, directions, limit, every)
    is_whole = np.full(len(origins), every)
    if isinstance(items, Cells):
        is_whole |= begin_in_cells(items, X_WA, origins)
    order = np.argsort(is_whole, kind="stable")
    for some in _together(order[~is_whole[order]]) + _together(order[is_whole[order]]):
        whole = bool(is_whole[some[0]])
        X = X_WA if len(X_WA) == 1 else X_WA[some]
        met = [
            items_on_way(
                items, X[min(i, len(X) - 1)], origins[k], directions.vectors[k], float(limits[k]), 0.0, first=not whole
            )[0] for i, k in enumerate(some.tolist())
        ]
        numbers = np.unique(np.concatenate([*met, items.some()]))  # of no items there are no parts
        near = np.zeros((len(some), len(numbers)), dtype=bool)
        for i, of_ray in enumerate(met):
            near[i, np.searchsorted(numbers, of_ray)] = True
        parts = [(item, items.X_FG) for item in items.hulls(numbers)]
        of_some = Directions(directions.vectors[some], directions.exponents[some])
        on_items = _on_parts(parts, numbers, X, origins[some], of_some, limit, whole, near)
        events.append(on_items._replace(ray=some[on_items.ray]))
    of_all = joined(events)
    if isinstance(items, Cells):
        of_all = of_all.of(on_surface(items, X_WA, origins, directions, of_all))
    return in_order(of_all)


def _together(rays: np.ndarray) -> list[np.ndarray]:
    """Numbers of rays, as many as are asked together at a time."""
    return [rays[k : k + _RAYS_TOGETHER] for k in range(0, len(rays), _RAYS_TOGETHER)]


def _on_swept_triangles(
    items: SweptTriangles, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Events of n rays and a swept mesh: each ray with the triangles on its way, as a union."""
    limits, events = directions.limits(limit), []
    for k in range(len(origins)):
        of_k = Directions(directions.vectors[k : k + 1], directions.exponents[k : k + 1])
        X = X_WA[k if len(X_WA) > 1 else 0]
        some = items_on_way(items, X, origins[k], directions.vectors[k], float(limits[k]), 0.0)[0]
        some = np.unique(np.append(some, 0))  # of no triangles there is no union
        union = items.union_of(some)
        met = surfaces_met(union.shape, X[None], origins[k : k + 1], of_k, limit, every=every)
        events.append(met._replace(ray=np.full_like(met.ray, k), item=some[met.item]))
    return in_order(joined(events))


def _on_terrain(
    items: Columns, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Events of n rays and large terrain, by the tiles on the way of each ray."""
    X = np.broadcast_to(X_WA, (len(origins), 4, 4))
    places = ((origins - X[:, :3, 3])[:, None] @ X[:, :3, :3])[:, 0]
    vectors = (directions.vectors[:, None] @ X[:, :3, :3])[:, 0]
    limits, slack = directions.limits(limit), rounding_of_places(items, X, origins)
    tiles = items.tiles_on_rays(places, vectors, limits, slack)
    events = [_on_tile(items.union_of(items.some()), np.arange(0), X_WA, origins, directions, limit, every)]
    is_open, step = np.array([len(numbers) > 0 for numbers, _ in tiles]), 0
    while is_open.any():  # the next tile of each ray
        rays = np.flatnonzero(is_open)
        numbers = np.array([tiles[k][0][step] for k in rays.tolist()])
        for number in np.unique(numbers).tolist():
            some = rays[numbers == number]
            met = _on_tile(items.tile(number), some, X_WA, origins, directions, limit, every)
            events.append(met)
        step += 1
        is_open &= np.array([len(numbers) > step for numbers, _ in tiles])
        if not every:
            met = joined(events)
            until = np.full(len(is_open), math.inf)
            np.minimum.at(until, met.ray[met.proven], met.t[met.proven, 2])
            is_open &= np.array([not is_open[k] or tiles[k][1][step] <= until[k] for k in range(len(is_open))])
    return in_order(joined(events))


def _on_tile(
    tile: NamedUnion, some: np.ndarray, X_WA, origins, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Events of some rays, by number, and a part of terrain."""
    X = X_WA if len(X_WA) == 1 else X_WA[some]
    of_some = Directions(directions.vectors[some], directions.exponents[some])
    met = facets_met(body_of(tile.shape), X, origins[some], of_some, limit, every)
    return met._replace(ray=some[met.ray], facet=tile.numbers[met.facet])


#: Rays asked together about the items that they meet.
_RAYS_TOGETHER = 32
#: Rays that parts of a union are told apart for, by balls, before these are posed: of more the parts are posed once.
_MAX_CULLED = 32


def _near_leaves(shape: Compound, X_WA, origins, directions: Directions, limit: float) -> np.ndarray:
    """(n, leaves) bool: which leaves each ray may meet, by the balls around them (`balls_on_ways.py`)."""
    n, balls = len(origins), part_balls(shape)
    if not 0 < n <= _MAX_CULLED:
        return np.ones((n, balls.n), dtype=bool)
    X_WR = np.tile(np.eye(4), (n, 1, 1))
    X_WR[:, :3, 3] = origins
    point, limits, near = Balls(address_of(_POINT), 0, 1), directions.limits(limit), []
    for k in range(n):
        X_WAk = X_WA if len(X_WA) == 1 else X_WA[k : k + 1]
        vectors, until = np.repeat(directions.vectors[k : k + 1], balls.n, axis=0), np.repeat(limits[k], balls.n)
        near.append(near_on_ways(point, balls, X_WR[k : k + 1], X_WAk, balls.n, vectors=vectors, limits=until))
    return np.array([np.ones(balls.n, dtype=bool) if row is None else row for row in near])


#: The ball of a ray's origin.
_POINT = np.zeros(5)


@kept_with_shape("_ray_way")
def _way_of(shape: Compound) -> SingleWay:
    return SingleWay(None, layout_of(shape).ball)


def _on_mesh(
    mesh: Shape, X_AM: np.ndarray, X_WA, origins, directions: Directions, limit: float, every: bool
) -> RayEvents:
    body = body_of(mesh)
    reach = np.full(len(X_WA), body.reach + float(np.abs(body.centre).sum()))
    X_WM, slop = moved_pose(X_WA, X_AM, reach)
    met = facets_met(body, X_WM, origins, directions, limit, every)
    # Where the product of the poses is rounded, what is exact of it is not of the mesh.
    proven = met.proven & ~(slop > 0.0)[met.ray if len(slop) > 1 else 0]
    return met._replace(proven=proven, certified=proven)


def _on_meshes(
    shape: Shape, numbers: np.ndarray, X_WA, origins, directions: Directions, limit: float, every: bool,
    ask: Callable[[int, np.ndarray], RayEvents],
) -> Iterator[RayEvents]:
    """Events of n rays and a union's meshes, by number; of many meshes only where a ray enters the box, the nearest
    first, until a wall is proven nearer than all others can be.
    """
    n = len(origins)
    poses, of_ray = X_WA[:1], np.zeros(n, dtype=np.int64)
    if len(X_WA) > 1:
        rows, which = np.unique(X_WA.reshape(n, 16), axis=0, return_inverse=True)
        poses, of_ray = rows.reshape(-1, 4, 4), which.ravel()
    if len(numbers) < _LEAST_ITEMS * max(len(poses), 1):  # a tree of boxes for every pose takes longer
        yield from (ask(k, np.arange(n)) for k in numbers.tolist())
        return
    for pose in range(len(poses)):
        rays = np.flatnonzero(of_ray == pose)
        tree = BoxTree(compound_parts(shape).boxes(poses[pose : pose + 1], numbers)[0])
        limits = directions.limits(limit)[rays, None]
        sweeps = np.hstack([origins[rays], origins[rays], directions.vectors[rays], limits])
        pairs, bounds = bodies_ahead(tree, sweeps)
        best = np.full(len(rays), np.inf)
        for some in [np.arange(len(pairs))] if every else nearest_first(pairs[:, 0], bounds, best):
            ray, item = pairs[some].T
            for k in np.unique(item).tolist():
                met = ask(int(numbers[k]), rays[ray[item == k]])
                known = met.ray[met.proven]
                np.minimum.at(
                    best, np.searchsorted(rays, known), np.ldexp(met.t[met.proven, 2], directions.exponents[known])
                )
                yield met


def _is_facets(shape: Shape) -> bool:
    """Whether a shape's surface is that of its facets."""
    kind = kind_of(shape)
    return kind == Kind.MESH or (kind in (Kind.SPHERE, Kind.CAPSULE, Kind.POLYTOPE) and body_of_points(shape))


def body_of_points(shape: Shape) -> bool:
    """Whether a hull of doubles is swept by no ball."""
    return parts_of(shape)[0][0].radius == 0.0


def _on_parts(
    items, numbers, X_WA, origins, directions: Directions, limit: float, every: bool, near: np.ndarray
) -> RayEvents:
    """Events of n rays and m convex items (shape, pose), whose numbers the events name.

    near : (n, m) bool, which items each ray is asked about.
    """
    m = len(items)
    parts = posed_parts([(parts_of(item)[0][0], X_AI) for item, X_AI in items], X_WA)
    ray, item = np.nonzero(near)
    part = item + (m * ray if len(X_WA) > 1 else 0)
    events = parts_met(parts, np.stack([ray, part], axis=1), origins, directions, limit, every)
    return events._replace(item=numbers[item[events.item]])
