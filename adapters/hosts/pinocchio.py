"""The collision pairs of a Pinocchio model, answered by collide: `compute_collisions` and `compute_distances`.

They take the arguments of ``pinocchio.computeCollisions`` and ``computeDistances``, look at the same pairs at the same
placements with the same requests, and write into the same results, as far as these can be written. Pairs whose boxes
are apart are left out, those of convex shapes are asked in one batch. Geometries are read once a model, and again
where they or the pairs have changed.
"""

from __future__ import annotations

import weakref
from typing import Any, NamedTuple

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_geometry import CollisionGeometry
from collide.adapters.hosts.coal_nearest import nearest
from collide.adapters.hosts.coal_queries import collide_posed
from collide.adapters.hosts.coal_requests import CollisionResult
from collide.adapters.hosts.pinocchio_geometry import geometry_of, numbers_of
from collide.errors import InvalidArgument, MissingExtra
from collide.query import collide as hits
from collide.shapes.shape_set import Picked, ShapeSet

try:
    import pinocchio as pin
except ImportError:
    pin = None

#: How many pairs are asked together where the first collision ends it.
_BLOCK = 64
#: How many configurations are asked together.
_CONFIGURATIONS = 256
#: Gaps of boxes are less than this part of their coordinates below what they are in doubles.
_SLACK = 1e-12


class PairDistances(NamedTuple):
    """How far bodies are apart, one row a pair that is active.

    pair : (n,) numbers of the pairs.   distance : (n,) signed [m]; 0 of two meshes that meet, and of any bodies that
    meet where the pair's request wants no signed distance.   lower : (n,) proven lower bounds of it.
    normal : (n, 3) unit vectors from the first geometry to the second in the world.   point_1, point_2 : (n, 3) nearest
    points in the world [m].   part_1, part_2 : (n,) facets of meshes, −1 of other geometries.
    """

    pair: np.ndarray
    distance: np.ndarray
    lower: np.ndarray
    normal: np.ndarray
    point_1: np.ndarray
    point_2: np.ndarray
    part_1: np.ndarray
    part_2: np.ndarray


class _Pairs(NamedTuple):
    """What is known of a geometry model.

    geometries : of `coal_api`, object by object.   numbers : what tells that they were changed.
    mapping : Pinocchio's table of pairs.   pairs : (n, 2) rows of geometries.   corners : (g, 2, 3) of boxes.
    shape_set : their shapes; of planes a half-space, not to be asked.   is_convex : (n,) bool, pairs for the batch.
    swept : (n,) sums of swept radii [m].
    """

    geometries: list[CollisionGeometry]
    numbers: list[tuple]
    mapping: np.ndarray
    pairs: np.ndarray
    corners: np.ndarray
    shape_set: ShapeSet
    is_convex: np.ndarray
    swept: np.ndarray


_known: weakref.WeakKeyDictionary[Any, _Pairs] = weakref.WeakKeyDictionary()


def compute_collisions(model, data, geom_model, geom_data, q, stop_at_first=False) -> bool:
    """Whether any active pair collides; ``pinocchio.computeCollisions`` by collide.

    Parameters
    ----------
    model, data, geom_model, geom_data : Pinocchio's.
    q : (nq,) configuration; None for placements as they stand in ``geom_data.oMg``.
    stop_at_first : bool
        Pairs after the first that collides are left as they were.

    Returns
    -------
    bool

    Notes
    -----
    ``geom_data.collisionResults[k]`` of every pair looked at is emptied, takes the contacts, if any, and a proven
    ``distance_lower_bound``. ``activeCollisionPairs``, ``disableCollision`` and the pairs' requests count: security
    margins, numbers of contacts, and whether depths are wanted.

    Raises
    ------
    InvalidArgument
        Where model, data and geometries do not belong together, or q has another length.
    InvalidShape, UnsupportedQuery
        Naming the geometry that has no data or is not known.
    MissingExtra
        Without Pinocchio.
    """
    known, X = _asked(model, data, geom_model, geom_data, q)
    which = _active(known, geom_model, geom_data)
    margins = _margins(geom_data, which)
    gaps = _box_gaps(known, X, which)
    near = gaps <= margins
    lower = gaps - margins
    is_hit = np.zeros(len(which), dtype=bool)
    rows = np.flatnonzero(near)
    last = len(which)
    for begin in range(0, len(rows), _BLOCK if stop_at_first else max(1, len(rows))):
        block = rows[begin : begin + _BLOCK] if stop_at_first else rows
        is_hit[block] = _meet(known, *_placed(known, X, which[block]), which[block], margins[block])
        lower[block] = np.where(is_hit[block], lower[block], np.maximum(lower[block], -margins[block]))
        if stop_at_first and is_hit[block].any():
            last = int(block[is_hit[block].argmax()]) + 1
            break
    coal = _coal()
    results, requests = list(geom_data.collisionResults), geom_data.collisionRequests  # a list is read far sooner
    for k, hit, bound in zip(which[:last].tolist(), is_hit.tolist(), lower.tolist()):
        result = results[k]
        result.clear()
        if hit:
            _add_contacts(coal, known, geom_model, X, k, requests[k], result)
        else:
            result.distance_lower_bound = bound
    return bool(is_hit[:last].any())


def compute_distances(model, data, geom_model, geom_data, q) -> int:
    """Distances of all active pairs; ``pinocchio.computeDistances`` by collide.

    Parameters
    ----------
    model, data, geom_model, geom_data, q : as of `compute_collisions`.

    Returns
    -------
    int
        The number of the nearest pair; without active pairs, how many there are.

    Notes
    -----
    ``geom_data.distanceResults[k]`` becomes a new result with ``min_distance``, ``normal``, ``b1`` and ``b2``. Its
    nearest points cannot be written: `distances` has them.

    Raises
    ------
    InvalidArgument, InvalidShape, UnsupportedQuery, MissingExtra : as of `compute_collisions`.
    """
    answer = distances(model, data, geom_model, geom_data, q)
    coal, results = _coal(), geom_data.distanceResults
    for k, distance, normal, b1, b2 in zip(
        answer.pair.tolist(), answer.distance.tolist(), answer.normal, answer.part_1.tolist(), answer.part_2.tolist()
    ):
        result = coal.DistanceResult()
        result.min_distance, result.normal, result.b1, result.b2 = distance, normal, b1, b2
        results[k] = result
    if not len(answer.pair):
        return len(geom_model.collisionPairs)
    return int(answer.pair[answer.distance.argmin()])


def collides(model, data, geom_model, geom_data, Q) -> np.ndarray:
    """Of many configurations, whether any active pair collides; no result is written.

    Parameters
    ----------
    model, data, geom_model, geom_data : as of `compute_collisions`.
    Q : (N, nq) configurations.

    Returns
    -------
    (N,) bool

    Notes
    -----
    The pairs of convex shapes of a few hundred configurations are one batch. Placements are afterwards those of the
    last configuration.

    Raises
    ------
    InvalidArgument, InvalidShape, UnsupportedQuery, MissingExtra : as of `compute_collisions`.
    """
    _needs_pinocchio()
    _check_models(model, data, geom_model, geom_data)
    Q = np.asarray(Q, dtype=np.float64)
    if Q.ndim != 2 or Q.shape[1] != model.nq:
        raise InvalidArgument(f"Q must have shape (N, {model.nq}), the model's nq, got {Q.shape}")
    known = _prepared(geom_model)
    which = _active(known, geom_model, geom_data)
    margins = _margins(geom_data, which)
    is_free = np.ones(len(Q), dtype=bool)
    for begin in range(0, len(Q), _CONFIGURATIONS):
        block = slice(begin, begin + _CONFIGURATIONS)
        X = np.array([_placements(model, data, geom_model, geom_data, q) for q in Q[block]])
        rows, columns = np.nonzero(_box_gaps(known, X, which) <= margins)
        a, b = known.pairs[which[columns]].T
        is_hit = _meet(known, X[rows, a], X[rows, b], which[columns], margins[columns])
        is_free[begin + rows[is_hit]] = False
    return ~is_free


def distances(model, data, geom_model, geom_data, q) -> PairDistances:
    """How far the bodies of every active pair are apart, and where; nothing is written but placements.

    Parameters
    ----------
    model, data, geom_model, geom_data, q : as of `compute_collisions`.

    Returns
    -------
    PairDistances

    Raises
    ------
    InvalidArgument, InvalidShape, UnsupportedQuery, MissingExtra : as of `compute_collisions`.
    """
    known, X = _asked(model, data, geom_model, geom_data, q)
    which = _active(known, geom_model, geom_data)
    wanted = [bool(request.enable_signed_distance) for request in geom_data.distanceRequests]
    is_signed = np.array(wanted, dtype=bool)[which]
    n = len(which)
    columns = {name: np.zeros((n, 3)) for name in ("normal", "point_1", "point_2")}
    parts = {name: np.full(n, -1) for name in ("part_1", "part_2")}
    answer = PairDistances(which, np.zeros(n), np.zeros(n), **columns, **parts)
    in_batch = known.is_convex[which] & (known.swept[which] == 0.0)
    for signed in (True, False):
        some = np.flatnonzero(in_batch & (is_signed == signed))
        if len(some):
            pairs = which[some]
            rows = engine.distance(*_shapes_of(known, pairs), *_placed(known, X, pairs), signed=signed).rows
            names = zip(("distance", "lower", "normal", "point_1", "point_2"),
                        ("distance", "lower", "normal", "point_a", "point_b"))  # fmt: skip
            for name, field in names:
                getattr(answer, name)[some] = rows[field]
    for row in np.flatnonzero(~in_batch).tolist():
        g1, X1, g2, X2 = _bodies(known, X, which[row])
        are_meshes = g1._has_parts and g2._has_parts
        one = nearest(g1, X1, g2, X2, 0.0, np.inf, bool(is_signed[row]) and not are_meshes)
        for name in PairDistances._fields[1:]:
            getattr(answer, name)[row] = getattr(one, name)
    return answer


# --- what is asked ------------------------------------------------------------------------------


def _asked(model, data, geom_model, geom_data, q) -> tuple[_Pairs, np.ndarray]:
    """What is known of the geometries, and their placements (g, 4, 4), brought up to date with q."""
    _needs_pinocchio()
    _check_models(model, data, geom_model, geom_data)
    if q is not None:
        q = np.asarray(q, dtype=np.float64)
        if q.shape != (model.nq,):
            raise InvalidArgument(f"q must have shape ({model.nq},), the model's nq, got {q.shape}")
    X = _placements(model, data, geom_model, geom_data, q)
    return _prepared(geom_model), X


def _needs_pinocchio() -> None:
    if pin is None:
        raise MissingExtra("pin", extra="pinocchio", purpose="the pairs of a Pinocchio model")


def _placements(model, data, geom_model, geom_data, q) -> np.ndarray:
    """Where geometries are (g, 4, 4), at q (nq,), or as they stand."""
    if q is not None:
        if not np.isfinite(q).all():
            raise InvalidArgument(f"q must be finite, got {q.tolist()}")
        pin.updateGeometryPlacements(model, data, geom_model, geom_data, q)
    return np.array([placement.homogeneous for placement in geom_data.oMg]).reshape(-1, 4, 4)


def _check_models(model, data, geom_model, geom_data) -> None:
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
    if len(data.oMi) != model.njoints:
        raise InvalidArgument(f"data has {len(data.oMi)} joints and model {model.njoints}: model.createData()")
    for geometry_object in geom_model.geometryObjects:
        if geometry_object.parentJoint >= model.njoints:
            raise InvalidArgument(
                f"geometry {geometry_object.name!r} is fixed to joint {geometry_object.parentJoint}, and model has "
                f"{model.njoints} joints: geom_model belongs to another model"
            )


def _prepared(geom_model) -> _Pairs:
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
    swept = np.array([g._radius_swept for g in geometries])
    shapes = [g._shape for g in geometries]
    known = _known[geom_model] = _Pairs(
        geometries, numbers, mapping, pairs, np.array([g._bounds() for g in geometries]).reshape(-1, 2, 3),
        ShapeSet(shapes or [engine.Sphere(1.0)]), is_convex[pairs].all(axis=1), swept[pairs].sum(axis=1),
    )  # fmt: skip
    return known


def _active(known: _Pairs, geom_model, geom_data) -> np.ndarray:
    """Numbers (k,) of the pairs that are active and of which neither geometry is disabled."""
    is_off = np.array([obj.disableCollision for obj in geom_model.geometryObjects], dtype=bool)
    is_on = np.array(list(geom_data.activeCollisionPairs), dtype=bool)
    return np.flatnonzero(is_on & ~is_off[known.pairs].any(axis=1))


def _bodies(known: _Pairs, X: np.ndarray, k: int):
    """(g1, X1, g2, X2) of a pair."""
    a, b = known.pairs[k]
    return known.geometries[a], X[a], known.geometries[b], X[b]


def _shapes_of(known: _Pairs, which: np.ndarray) -> tuple[Picked, Picked]:
    """The shapes of both sides of pairs that have one each."""
    a, b = known.pairs[which].T
    return Picked(known.shape_set, a), Picked(known.shape_set, b)


def _placed(known: _Pairs, X: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Placements (k, 4, 4) of both sides of pairs."""
    a, b = known.pairs[which].T
    return X[a], X[b]


def _margins(geom_data, which: np.ndarray) -> np.ndarray:
    return np.array([request.security_margin for request in geom_data.collisionRequests], dtype=np.float64)[which]


def _box_gaps(known: _Pairs, X: np.ndarray, which: np.ndarray) -> np.ndarray:
    """(…, k) lower bounds of the distances of pairs, of placements (…, g, 4, 4): gaps of boxes in the world, less
    rounding; 0 where boxes meet.
    """
    is_bounded = np.isfinite(known.corners).all(axis=(1, 2))
    corners = np.where(is_bounded[:, None, None], known.corners, 0.0)
    middles, halves = 0.5 * (corners[:, 0] + corners[:, 1]), 0.5 * (corners[:, 1] - corners[:, 0])
    R, t = X[..., :3, :3], X[..., :3, 3]
    size = np.abs(R)
    middle = (R @ middles[:, :, None])[..., 0] + t
    half = (size @ halves[:, :, None])[..., 0]
    half += _SLACK * ((size @ np.abs(middles)[:, :, None])[..., 0] + np.abs(t) + half)
    half[..., ~is_bounded, :] = np.inf
    a, b = known.pairs[which].T
    apart = np.abs(middle[..., b, :] - middle[..., a, :]) - half[..., a, :] - half[..., b, :]
    return np.linalg.norm(np.maximum(apart, 0.0), axis=-1) * (1.0 - _SLACK)


def _meet(known: _Pairs, X_1: np.ndarray, X_2: np.ndarray, which: np.ndarray, margins: np.ndarray) -> np.ndarray:
    """(k,) bool: which pairs, at placements (k, 4, 4) of both geometries, are at most their margins apart."""
    is_hit = np.zeros(len(which), dtype=bool)
    is_plain = (margins == 0.0) & (known.swept[which] == 0.0)
    is_batched = is_plain & known.is_convex[which]
    in_batch = np.flatnonzero(is_batched)
    if len(in_batch):
        is_hit[in_batch] = hits(*_shapes_of(known, which[in_batch]), X_1[in_batch], X_2[in_batch])
    for row in np.flatnonzero(~is_batched).tolist():
        g1, g2 = (known.geometries[g] for g in known.pairs[which[row]].tolist())
        if is_plain[row] and len(g1._shapes) == len(g2._shapes) == 1:
            is_hit[row] = hits(g1._shapes[0], g2._shapes[0], X_1[row], X_2[row])
        else:
            margin = float(margins[row])
            is_hit[row] = nearest(g1, X_1[row], g2, X_2[row], margin, 0.0, margin < 0.0).is_within
    return is_hit


def _add_contacts(coal, known: _Pairs, geom_model, X, k: int, request, result) -> None:
    """The contacts of a pair that collides, into Pinocchio's own result."""
    ours = CollisionResult()
    collide_posed(*_bodies(known, X, k), request, ours)
    a, b = known.pairs[k].tolist()
    g1, g2 = geom_model.geometryObjects[a].geometry, geom_model.geometryObjects[b].geometry
    for contact in ours.getContacts():
        result.addContact(coal.Contact(
            g1, g2, contact.b1, contact.b2, contact.pos, contact.normal, contact.penetration_depth
        ))  # fmt: skip
    result.distance_lower_bound = ours.distance_lower_bound


def _coal():
    """The coal that Pinocchio works with, whoever stands in for it in ``sys.modules``."""
    return pin.coal if hasattr(pin, "coal") else pin.hppfcl
