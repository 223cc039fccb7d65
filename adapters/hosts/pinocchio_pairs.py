"""What is known of a Pinocchio geometry model, and which of its pairs may meet."""

from __future__ import annotations

import weakref
from typing import Any, NamedTuple

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_geometry import CollisionGeometry
from collide.adapters.hosts.coal_nearest import GeometryPair, nearest
from collide.adapters.hosts.pinocchio_geometry import geometry_of, numbers_of
from collide.errors import InvalidArgument
from collide.pairs.query import collide as hits
from collide.shapes.shape_set import Picked, ShapeSet

#: Gaps of boxes are less than this part of their coordinates below what they are in doubles.
_SLACK = 1e-12


class KnownPairs(NamedTuple):
    """What is known of a geometry model.

    geometries : of `coal_api`, object by object.   numbers : what tells that they were changed.
    mapping : Pinocchio's table of pairs.   pairs : (n, 2) rows of geometries.   corners : (g, 2, 3) of boxes.
    shape_set : their shapes; of planes a half-space, not to be asked.   is_convex : (n,) bool, pairs for the batch.
    radii : (n,) sums of swept radii [m].
    """

    geometries: list[CollisionGeometry]
    numbers: list[tuple]
    mapping: np.ndarray
    pairs: np.ndarray
    corners: np.ndarray
    shape_set: ShapeSet
    is_convex: np.ndarray
    radii: np.ndarray


_known: weakref.WeakKeyDictionary[Any, KnownPairs] = weakref.WeakKeyDictionary()


def check_models(model, data, geom_model, geom_data) -> None:
    """Pinocchio itself reads past the end of arrays where these do not belong together."""
    if len(geom_data.oMg) != geom_model.ngeoms:
        raise InvalidArgument(
            f"geom_data has {len(geom_data.oMg)} placements and geom_model {geom_model.ngeoms} geometries: "
            "make it anew, geom_model.createData()"
        )
    n_pairs = len(geom_model.collisionPairs)
    if len(geom_data.activeCollisionPairs) != n_pairs:
        raise InvalidArgument(
            f"geom_data knows {len(geom_data.activeCollisionPairs)} pairs and geom_model {n_pairs}: make it anew after "
            "pairs were added or removed, geom_model.createData()"
        )
    if model is None:
        return
    if len(data.oMi) != model.njoints:
        raise InvalidArgument(f"data has {len(data.oMi)} joints and model {model.njoints}: model.createData()")
    for geometry_object in geom_model.geometryObjects:
        if geometry_object.parentJoint >= model.njoints:
            raise InvalidArgument(
                f"geometry {geometry_object.name!r} is fixed to joint {geometry_object.parentJoint}, and model has "
                f"{model.njoints} joints: geom_model belongs to another model"
            )


def known_pairs(geom_model) -> KnownPairs:
    """What is known of a geometry model, read anew where it has changed."""
    objects = list(geom_model.geometryObjects)
    numbers = [numbers_of(geometry_object.geometry) for geometry_object in objects]
    mapping = np.array(geom_model.collisionPairMapping)
    known = _known.get(geom_model)
    if known is not None and known.numbers == numbers and np.array_equal(known.mapping, mapping):
        return known
    before = {} if known is None else dict(zip(known.numbers, known.geometries))
    geometries = [before.get(key) or geometry_of(obj) for key, obj in zip(numbers, objects)]
    pairs = np.array([(pair.first, pair.second) for pair in geom_model.collisionPairs], dtype=np.int64).reshape(-1, 2)
    is_convex = np.array([len(g._shapes) == 1 and not g._has_parts for g in geometries], dtype=bool)
    radii = np.array([g._radius_swept for g in geometries])
    shapes = [g._shape for g in geometries]
    known = _known[geom_model] = KnownPairs(
        geometries, numbers, mapping, pairs, np.array([g._bounds() for g in geometries]).reshape(-1, 2, 3),
        ShapeSet(shapes or [engine.Sphere(1.0)]), np.asarray(is_convex[pairs].all(axis=1)), radii[pairs].sum(axis=1),
    )
    return known


def active_pairs(known: KnownPairs, geom_model, geom_data) -> np.ndarray:
    """Numbers (k,) of the pairs that are active and of which neither geometry is disabled."""
    is_off = np.array([obj.disableCollision for obj in geom_model.geometryObjects], dtype=bool)
    is_on = np.array(list(geom_data.activeCollisionPairs), dtype=bool)
    return np.flatnonzero(is_on & ~is_off[known.pairs].any(axis=1))


def shapes_of(known: KnownPairs, which: np.ndarray) -> tuple[Picked, Picked]:
    """The shapes of both sides of pairs that have one each."""
    a, b = known.pairs[which].T
    return Picked(known.shape_set, a), Picked(known.shape_set, b)


def margins_of(geom_data, which: np.ndarray) -> np.ndarray:
    return np.array([request.security_margin for request in geom_data.collisionRequests], dtype=np.float64)[which]


def box_gaps(known: KnownPairs, X: np.ndarray, which: np.ndarray) -> np.ndarray:
    """(…, k) lower bounds of the distances of pairs, of placements (…, g, 4, 4): gaps of boxes in the world, less
    rounding; 0 where boxes meet.
    """
    is_bounded = np.isfinite(known.corners).all(axis=(1, 2))
    corners = np.where(is_bounded[:, None, None], known.corners, 0.0)
    middles, half_lengths = 0.5 * (corners[:, 0] + corners[:, 1]), 0.5 * (corners[:, 1] - corners[:, 0])
    R, t = X[..., :3, :3], X[..., :3, 3]
    size = np.abs(R)
    middle = (R @ middles[:, :, None])[..., 0] + t
    half = (size @ half_lengths[:, :, None])[..., 0]
    half += _SLACK * ((size @ np.abs(middles)[:, :, None])[..., 0] + np.abs(t) + half)
    half[..., ~is_bounded, :] = np.inf
    a, b = known.pairs[which].T
    apart = np.abs(middle[..., b, :] - middle[..., a, :]) - half[..., a, :] - half[..., b, :]
    return np.linalg.norm(np.maximum(apart, 0.0), axis=-1) * (1.0 - _SLACK)


def meet(known: KnownPairs, X_1: np.ndarray, X_2: np.ndarray, which: np.ndarray, margins: np.ndarray) -> np.ndarray:
    """(k,) bool: which pairs, at placements (k, 4, 4) of both geometries, are at most their margins apart."""
    is_hit = np.zeros(len(which), dtype=bool)
    is_plain = (margins == 0.0) & (known.radii[which] == 0.0)
    is_batched = is_plain & known.is_convex[which]
    in_batch = np.flatnonzero(is_batched)
    if len(in_batch):
        is_hit[in_batch] = hits(*shapes_of(known, which[in_batch]), X_1[in_batch], X_2[in_batch])
    for row in np.flatnonzero(~is_batched).tolist():
        g1, g2 = (known.geometries[g] for g in known.pairs[which[row]].tolist())
        if is_plain[row] and len(g1._shapes) == len(g2._shapes) == 1:
            is_hit[row] = hits(g1._shapes[0], g2._shapes[0], X_1[row], X_2[row])
        else:
            margin = float(margins[row])
            is_hit[row] = nearest(GeometryPair.now(g1, X_1[row], g2, X_2[row]), margin, 0.0, margin < 0.0).is_within
    return is_hit
