"""The collision pairs of a Pinocchio model, answered by collide: `compute_collisions` and `compute_distances`.

They take the arguments of ``pinocchio.computeCollisions`` and ``computeDistances``, look at the same pairs at the same
placements with the same requests, and write into the same results, as far as these can be written. Pairs whose boxes
are apart are left out, those of convex shapes are asked in one batch. Geometries are read once a model, and again
where they or the pairs have changed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_nearest import GeometryPair, nearest
from collide.adapters.hosts.coal_queries import checked_request, contact_fields, contact_rows
from collide.adapters.hosts.host_numbers import of_kind
from collide.adapters.hosts.pinocchio_pairs import (
    KnownPairs,
    active_pairs,
    box_gaps,
    check_models,
    known_pairs,
    margins_of,
    meet,
    shapes_of,
)
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, MissingExtra

#: How many pairs are asked together where the first collision ends it.
_BLOCK = 64
#: How many configurations are asked together.
_CONFIGURATIONS = 256


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


def compute_collisions(model, data, geom_model, geom_data, q, stop_at_first=False) -> bool:
    """Whether any active pair collides; ``pinocchio.computeCollisions`` by collide.

    Parameters
    ----------
    model, data, geom_model, geom_data : Pinocchio's; without q, model and data may be None.
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
    which = active_pairs(known, geom_model, geom_data)
    margins = margins_of(geom_data, which)
    gaps = box_gaps(known, X, which)
    near = gaps <= margins
    lower = gaps - margins
    is_hit = np.zeros(len(which), dtype=bool)
    rows = np.flatnonzero(near)
    last = len(which)
    for begin in range(0, len(rows), _BLOCK if stop_at_first else max(1, len(rows))):
        block = rows[begin : begin + _BLOCK] if stop_at_first else rows
        is_hit[block] = meet(known, *_placed(known, X, which[block]), which[block], margins[block])
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


def collide_pair(geom_model, geom_data, k: int, request=None) -> bool:
    """Whether pair ``k`` collides at the placements as they stand; ``pinocchio.computeCollision`` by collide.

    request : coal's, in place of the pair's own. The pair's result is emptied, and takes the contacts.
    """
    known, X = _asked(None, None, geom_model, geom_data, None)
    result = list(geom_data.collisionResults)[k]
    result.clear()
    request = geom_data.collisionRequests[k] if request is None else request
    _add_contacts(_coal(), known, geom_model, X, k, request, result)
    return result.isCollision()


def compute_distances(model, data, geom_model, geom_data, q, *, only: int | None = None) -> int:
    """Distances of all active pairs; ``pinocchio.computeDistances`` by collide.

    Parameters
    ----------
    model, data, geom_model, geom_data, q : as of `compute_collisions`.
    only : a pair's number: no other pair is asked, and this one whether it is active or not.

    Returns
    -------
    int
        The number of the nearest pair; without active pairs, how many there are.

    Notes
    -----
    ``geom_data.distanceResults[k]`` becomes a new result with ``min_distance``, ``normal``, ``b1``, ``b2`` and nearest
    points. The points have no setter: coal writes them as those of two balls of no size that stand there.

    Raises
    ------
    InvalidArgument, InvalidShape, UnsupportedQuery, MissingExtra : as of `compute_collisions`.
    """
    answer = distances(model, data, geom_model, geom_data, q, only=only)
    write, results = _PointWriter(_coal()), geom_data.distanceResults
    for k, distance, normal, point_1, point_2, b1, b2 in zip(
        answer.pair.tolist(), answer.distance.tolist(), answer.normal, answer.point_1, answer.point_2,
        answer.part_1.tolist(), answer.part_2.tolist(),
    ):
        result = write(point_1, point_2)
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
    pin = genuine()
    _check(pin, model, data, geom_model, geom_data)
    Q = checks.array("Q", Q, f"(N, {model.nq})", InvalidArgument)
    if Q.ndim != 2 or Q.shape[1] != model.nq:
        raise InvalidArgument(f"Q must have shape (N, {model.nq}), the model's nq, got {Q.shape}")
    known = known_pairs(geom_model)
    which = active_pairs(known, geom_model, geom_data)
    margins = margins_of(geom_data, which)
    is_free = np.ones(len(Q), dtype=bool)
    for begin in range(0, len(Q), _CONFIGURATIONS):
        block = slice(begin, begin + _CONFIGURATIONS)
        X = np.array([_placements(pin, model, data, geom_model, geom_data, q) for q in Q[block]])
        rows, columns = np.nonzero(box_gaps(known, X, which) <= margins)
        a, b = known.pairs[which[columns]].T
        is_hit = meet(known, X[rows, a], X[rows, b], which[columns], margins[columns])
        is_free[begin + rows[is_hit]] = False
    return ~is_free


def distances(model, data, geom_model, geom_data, q, *, only: int | None = None) -> PairDistances:
    """How far the bodies of every active pair are apart, and where; nothing is written but placements.

    Parameters
    ----------
    model, data, geom_model, geom_data, q, only : as of `compute_distances`.

    Returns
    -------
    PairDistances

    Raises
    ------
    InvalidArgument, InvalidShape, UnsupportedQuery, MissingExtra : as of `compute_collisions`.
    """
    known, X = _asked(model, data, geom_model, geom_data, q)
    which = active_pairs(known, geom_model, geom_data) if only is None else np.array([only])
    wanted = [bool(request.enable_signed_distance) for request in geom_data.distanceRequests]
    is_signed = np.array(wanted, dtype=bool)[which]
    n = len(which)
    columns = {name: np.zeros((n, 3)) for name in ("normal", "point_1", "point_2")}
    parts = {name: np.full(n, -1) for name in ("part_1", "part_2")}
    answer = PairDistances(which, np.zeros(n), np.zeros(n), **columns, **parts)
    in_batch = known.is_convex[which] & (known.radii[which] == 0.0)
    for signed in (True, False):
        some = np.flatnonzero(in_batch & (is_signed == signed))
        if len(some):
            pairs = which[some]
            rows = engine.distance(*shapes_of(known, pairs), *_placed(known, X, pairs), signed=signed).rows
            names = zip(("distance", "lower", "normal", "point_1", "point_2"),
                        ("distance", "lower", "normal", "point_a", "point_b"))
            for name, field in names:
                getattr(answer, name)[some] = rows[field]
    for row in np.flatnonzero(~in_batch).tolist():
        g1, X1, g2, X2 = _bodies(known, X, which[row])
        are_meshes = g1._has_parts and g2._has_parts
        answer_of_pair = nearest(GeometryPair.now(g1, X1, g2, X2), 0.0, np.inf, bool(is_signed[row]) and not are_meshes)
        for name in PairDistances._fields[1:]:
            getattr(answer, name)[row] = getattr(answer_of_pair, name)
    return answer


# --- what is asked ------------------------------------------------------------------------------


def _asked(model, data, geom_model, geom_data, q) -> tuple[KnownPairs, np.ndarray]:
    """What is known of the geometries, and their placements (g, 4, 4), brought up to date with q."""
    pin = genuine()
    _check(pin, model, data, geom_model, geom_data)
    if q is not None:
        of_kind("model", model, pin.Model)
        q = checks.array("q", q, f"({model.nq},)", InvalidArgument)
        if q.shape != (model.nq,):
            raise InvalidArgument(f"q must have shape ({model.nq},), the model's nq, got {q.shape}")
    X = _placements(pin, model, data, geom_model, geom_data, q)
    return known_pairs(geom_model), X


def _check(pin, model, data, geom_model, geom_data) -> None:
    """Raises TypeError, as Pinocchio's bindings do, and InvalidArgument.   model, data : None without q."""
    kinds = {"model": pin.Model, "data": pin.Data, "geom_model": pin.GeometryModel, "geom_data": pin.GeometryData}
    if model is None and data is None:
        del kinds["model"], kinds["data"]
    values = {"model": model, "data": data, "geom_model": geom_model, "geom_data": geom_data}
    for name, kind in kinds.items():
        of_kind(name, values[name], kind)
    check_models(model, data, geom_model, geom_data)


def genuine():
    """Pinocchio itself, also while `pinocchio_module.install` has put ours in its place. Raises MissingExtra."""
    try:
        import pinocchio
    except ImportError:
        raise MissingExtra("pin", extra="pinocchio", purpose="ask the pairs of a Pinocchio model") from None
    return getattr(pinocchio, "__wrapped__", pinocchio)


def _placements(pin, model, data, geom_model, geom_data, q) -> np.ndarray:
    """Where geometries are (g, 4, 4), at q (nq,), or as they stand."""
    if q is not None:
        if not np.isfinite(q).all():
            raise InvalidArgument(f"q must be finite, got {q.tolist()}")
        pin.updateGeometryPlacements(model, data, geom_model, geom_data, q)
    return np.array([placement.homogeneous for placement in geom_data.oMg]).reshape(-1, 4, 4)


def _bodies(known: KnownPairs, X: np.ndarray, k: int):
    """(g1, X1, g2, X2) of a pair."""
    a, b = known.pairs[k]
    return known.geometries[a], X[a], known.geometries[b], X[b]


def _placed(known: KnownPairs, X: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Placements (k, 4, 4) of both sides of pairs."""
    a, b = known.pairs[which].T
    return X[a], X[b]


def _add_contacts(coal, known: KnownPairs, geom_model, X, k: int, request, result) -> None:
    """The contacts of a pair that collides, into Pinocchio's own result."""
    limit, margin = checked_request(request)
    pair = GeometryPair.now(*_bodies(known, X, k))
    rows, bound = contact_rows(pair, request.enable_contact, margin, request.distance_upper_bound, limit)
    first, second = (geom_model.geometryObjects[g].geometry for g in known.pairs[k].tolist())
    for row in rows:
        b1, b2, normal, depth, _, pos = contact_fields(*row)
        result.addContact(coal.Contact(first, second, b1, b2, pos, normal, depth))
    result.distance_lower_bound = bound


class _PointWriter:
    """Results of coal's with given nearest points: coal's own answer about two balls of a radius that no sum of doubles
    notices.
    """

    def __init__(self, coal):
        self._coal, self._ball, self._request = coal, coal.Sphere(1e-300), coal.DistanceRequest()
        self._places = coal.Transform3s(), coal.Transform3s()

    def __call__(self, point_1: np.ndarray, point_2: np.ndarray):
        """A ``DistanceResult`` with these points; with none, as of pairs that reach to infinity, where they are not
        finite.
        """
        result = self._coal.DistanceResult()
        if np.isfinite(point_1).all() and np.isfinite(point_2).all():
            first, second = self._places
            first.setTranslation(point_1)
            second.setTranslation(point_2)
            self._coal.distance(self._ball, first, self._ball, second, self._request, result)
        return result


def _coal():
    """The coal that Pinocchio works with, whoever stands in for it in ``sys.modules``."""
    pin = genuine()
    return pin.coal if hasattr(pin, "coal") else pin.hppfcl


def check() -> str:
    """Ask two balls, apart and together, and look at what was written: one line for `collide doctor`.

    Raises
    ------
    MissingExtra : without Pinocchio.
    RuntimeError : what does not hold.
    """
    pin = genuine()
    model, geom_model = pin.Model(), pin.GeometryModel()
    for k in range(2):
        placement = pin.SE3(np.eye(3), np.array([2.0 * k, 0.0, 0.0]))
        geom_model.addGeometryObject(pin.GeometryObject(f"ball {k}", 0, placement, _coal().Sphere(0.5)))
    geom_model.addCollisionPair(pin.CollisionPair(0, 1))
    data, geom_data = model.createData(), geom_model.createData()
    q = np.zeros(0)
    compute_distances(model, data, geom_model, geom_data, q)
    gap = geom_data.distanceResults[0].min_distance
    geom_data.collisionRequests[0].security_margin = 1.25
    is_hit = compute_collisions(model, data, geom_model, geom_data, q)
    if gap != 1.0 or not is_hit or geom_data.collisionResults[0].numContacts() != 1:
        raise RuntimeError(f"two balls 1 m apart: {gap!r} m, with a margin of 1.25 m {is_hit}")
    return "a pair was read, answered and written back"
