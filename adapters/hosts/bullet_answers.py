"""Answers of a mirror in pybullet's tuples: nearest points, contacts, boxes and rays."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import numpy as np

import collide
from collide import World
from collide.adapters.hosts.bullet_bodies import Geom
from collide.results import PAIR_DTYPE
from collide.shapes import Box, Compound, Halfspace, Mesh, Shape, ShapeSet, Sphere

#: Of two links Bullet keeps contacts up to this part of the smaller one's reach from its origin.
BREAKING_THRESHOLD = 0.02
#: Bullet's manifolds have at most so many points.
MAX_CONTACTS = 4
#: Up to so many pairs are asked one by one; more are a batch of those that are near.
ONE_BY_ONE = 4
#: Spheres around links are this much larger, for rounding.
_SLACK = 1e-9
#: The first of a result's numbers: distance, lower, upper, normal, and the two points.
_N_NUMBERS = 12
assert list(PAIR_DTYPE.names or ())[:6] == ["distance", "lower", "upper", "normal", "point_a", "point_b"]
_NO_DIRECTION = (0.0, 0.0, 0.0)
_NO_HIT = (-1, -1, 1.0, _NO_DIRECTION, _NO_DIRECTION)


class Tables:
    """Colliders of geoms in columns; row k is one of them, and its body in the World has id k.

    shapes : of each, in its frame S.   X_BS, X_WS : (n, 4, 4).   margins : (n,) of triangles [m].
    centers, reaches : of a ball around each in S [m].   thresholds : (n,) gap up to which Bullet keeps contacts [m].
    """

    def __init__(self, geoms: Sequence[Geom], X_WBs: np.ndarray):
        self.geoms = list(geoms)
        self.shapes: list[Shape] = [geom.collider.shape for geom in geoms]
        self.shape_set = ShapeSet(self.shapes) if geoms else None
        self.X_BS = np.array([_pose(geom.collider.X_BS) for geom in geoms]).reshape(-1, 4, 4)
        self.X_WS = X_WBs @ self.X_BS
        self.margins = np.array([geom.collider.margin for geom in geoms])
        self.any_margin = bool(self.margins.any())
        self.spheres = np.array([isinstance(shape, Sphere) for shape in self.shapes], dtype=bool)
        self.boxes = np.array([isinstance(shape, Box) for shape in self.shapes], dtype=bool)
        self.two_sided = np.array([_has_two_sides(shape) for shape in self.shapes], dtype=bool)
        boxes = boxes_of(self.shapes, np.tile(np.eye(4), (len(geoms), 1, 1)))
        self.centers, self.reaches = _balls(boxes)
        centers, reaches = _balls(boxes_of(self.shapes, self.X_BS))
        self.thresholds = BREAKING_THRESHOLD * (np.sqrt(np.square(centers).sum(axis=1)) + reaches)
        moving = np.array([not geom.fixed for geom in geoms], dtype=bool) & np.isfinite(self.thresholds)
        #: The largest gap at which Bullet keeps a contact of a body that moves [m].
        self.largest_threshold = float(self.thresholds[moving].max(initial=0.0))
        self.rows_of: dict[int, list[int]] = {}
        for row in sorted(range(len(geoms)), key=lambda k: geoms[k].link):
            self.rows_of.setdefault(geoms[row].body, []).append(row)

    def margins_of(self, a: int, b: int) -> tuple[float, float]:
        """What Bullet adds to each of two links [m]: nothing against balls."""
        return float(self.margins[a] * (not self.spheres[b])), float(self.margins[b] * (not self.spheres[a]))

    def threshold_of(self, a: int, b: int) -> float:
        """The gap up to which Bullet keeps contacts of two links [m]: 0 of two boxes and of two balls."""
        if (self.boxes[a] and self.boxes[b]) or (self.spheres[a] and self.spheres[b]):
            return 0.0
        return min(float(self.thresholds[a]), float(self.thresholds[b]))

    def moved_to(self, X_WSs: np.ndarray) -> Tables:
        """The same colliders at other poses (n, 4, 4)."""
        tables = copy.copy(self)
        tables.X_WS = X_WSs
        return tables

    def place(self, row: int) -> tuple[int, int]:
        """Body and link."""
        return self.geoms[row].body, self.geoms[row].link


def boxes_of(shapes: Sequence[Shape], poses: np.ndarray) -> np.ndarray:
    """(n, 6) boxes around posed shapes: low x, y, z, high x, y, z [m]; infinite of half-spaces."""
    world = World()
    for shape, X in zip(shapes, poses):
        world.add(shape, X)
    return world.bounding_boxes()[1]


def closest(A: Tables, rows_a: Sequence[int], B: Tables, rows_b: Sequence[int], limit: float) -> tuple:
    """pybullet's tuples of each pair of a link of A and one of B at most ``limit`` apart [m]: its nearest points."""
    pairs = [(a, b) for a in rows_a for b in rows_b if a != b or A is not B]
    reach = max(limit, 0.0)
    if A.any_margin or B.any_margin:
        reach += float(A.margins.max(initial=0.0) + B.margins.max(initial=0.0))
    if len(pairs) > ONE_BY_ONE:
        i, j = np.array(pairs).T
        near = _gaps(A, i, B, j) <= reach
        pairs, i, j = [pair for pair, is_near in zip(pairs, near.tolist()) if is_near], i[near], j[near]
    if len(pairs) > ONE_BY_ONE:
        assert A.shape_set is not None and B.shape_set is not None  # there are rows
        r = collide.distance(A.shape_set[i], B.shape_set[j], A.X_WS[i], B.X_WS[j], max_distance=reach)
        answers = _numbers(r)
    else:
        answers = [_nearest(A, a, B, b, reach) for a, b in pairs]
    rows = []
    for (a, b), (distance, lower, _, n_x, n_y, n_z, *points) in zip(pairs, answers):
        if A.any_margin or B.any_margin:
            margin_a, margin_b = float(A.margins[a] * (not B.spheres[b])), float(B.margins[b] * (not A.spheres[a]))
            shifts = (margin_a * n_x, margin_a * n_y, margin_a * n_z, -margin_b * n_x, -margin_b * n_y, -margin_b * n_z)
            points = [x + shift for x, shift in zip(points, shifts)]
            lower, distance = lower - (margin_a + margin_b), distance - (margin_a + margin_b)
        if lower <= limit:
            normal = (0.0 - n_x, 0.0 - n_y, 0.0 - n_z)
            rows.append(_row(A.place(a), B.place(b), tuple(points[:3]), tuple(points[3:]), normal, distance))
    return tuple(rows)


def _nearest(A: Tables, a: int, B: Tables, b: int, reach: float) -> list[float]:
    """The numbers of one pair. A limit saves work where there are meshes, and costs some where there are none."""
    shape_a, shape_b = A.shapes[a], B.shapes[b]
    limit = reach if shape_a.meshed or shape_b.meshed else math.inf
    return _numbers(collide.distance(shape_a, shape_b, A.X_WS[a], B.X_WS[b], max_distance=limit))[0]


def _numbers(result: collide.PairResult) -> list[list[float]]:
    """Distance, lower, upper, normal, and the two points of each row."""
    return result.rows.view(np.float64).reshape(len(result.rows), -1)[:, :_N_NUMBERS].tolist()


def _row(place_a: tuple, place_b: tuple, point_a: tuple, point_b: tuple, normal: tuple, distance: float) -> tuple:
    """One of pybullet's tuples for contacts; forces and their directions are 0.   normal : on B, to A."""
    return (
        0, place_a[0], place_b[0], place_a[1], place_b[1], point_a, point_b, normal, distance,
        0.0, 0.0, _NO_DIRECTION, 0.0, _NO_DIRECTION,
    )


def contact_points(world: World, tables: Tables, contact_margin: float | None) -> list[tuple]:
    """pybullet's tuples of all contacts of a World, at most 4 of a patch.

    contact_margin : gap up to which contacts count [m]; None for Bullet's rule: a fiftieth of the smaller link's reach,
        0 for two boxes and for two spheres.
    """
    if not tables.geoms:
        return []
    rows = world.contacts(_largest_gap(tables, contact_margin), max_contacts=MAX_CONTACTS).rows
    return _contacts_of(rows, rows["a"].tolist(), rows["b"].tolist(), tables, contact_margin)


def contact_points_of(pairs: Sequence[tuple[int, int]], tables: Tables, contact_margin: float | None) -> list[tuple]:
    """The same of some pairs of rows, each with the smaller row first: what the World has of them."""
    margin, contacts = _largest_gap(tables, contact_margin), []
    for i, j in pairs:
        X_i, X_j = tables.X_WS[i], tables.X_WS[j]
        rows = collide.contacts(
            tables.shapes[i], tables.shapes[j], X_i, X_j, margin=margin, max_contacts=MAX_CONTACTS
        ).rows
        if len(rows):
            contacts += _contacts_of(rows, [i] * len(rows), [j] * len(rows), tables, contact_margin)
    return contacts


def _largest_gap(tables: Tables, contact_margin: float | None) -> float:
    """The margin [m] with which shapes are asked for contacts."""
    margin = tables.largest_threshold if contact_margin is None else contact_margin
    return margin + 2.0 * float(tables.margins.max(initial=0.0)) if tables.any_margin else margin


def _contacts_of(
    rows: np.ndarray, a: list[int], b: list[int], tables: Tables, contact_margin: float | None
) -> list[tuple]:
    """pybullet's tuples of rows of contacts between rows a and b (n,) of the tables, where they count."""
    limits: dict[tuple[int, int], float] = {}
    contacts = []
    columns = (rows[name].tolist() for name in ("distance", "normal", "point_a", "point_b"))
    for i, j, distance, normal, point_a, point_b in zip(a, b, *columns):
        if (i, j) not in limits:
            limits[i, j] = tables.threshold_of(i, j) if contact_margin is None else contact_margin
        if tables.any_margin:
            margin_a, margin_b = tables.margins_of(i, j)
            distance = distance - margin_a - margin_b
            point_a = [x + margin_a * n for x, n in zip(point_a, normal)]
            point_b = [x - margin_b * n for x, n in zip(point_b, normal)]
        if distance <= limits[i, j]:
            to_a = (0.0 - normal[0], 0.0 - normal[1], 0.0 - normal[2])
            contacts.append(_row(tables.place(i), tables.place(j), tuple(point_a), tuple(point_b), to_a, distance))
    return contacts


def exchanged(row: tuple) -> tuple:
    """A contact with A and B exchanged."""
    flag, body_a, body_b, link_a, link_b, point_a, point_b, normal, *rest = row
    return flag, body_b, body_a, link_b, link_a, point_b, point_a, tuple(0.0 - x for x in normal), *rest


def overlapping(world: World, tables: Tables, low: np.ndarray, high: np.ndarray) -> tuple | None:
    """((body, link), …) whose boxes meet a box, sorted; None where there are none, as in pybullet."""
    rows = np.searchsorted(world.ids, world.boxes_near(low, high))
    places = sorted(tables.place(row) for row in rows.tolist())
    return tuple(places) or None


def ray_hits(
    world: World, tables: Tables, origins: np.ndarray, ends: np.ndarray, passed: np.ndarray, number: int, epsilon: float
) -> tuple:
    """pybullet's tuples of rays from origins to ends (n, 3): the first hit, or the hit of a number, nearest first.

    passed : (n,) bool: bodies that rays pass through.   number : which hit, from 0; below 0 the first.
    epsilon : hits of one link whose fractions differ by at most so much are one; below 0 none are.

    Walls on the way out of a solid do not count, as in Bullet; surfaces and half-spaces have two sides.
    """
    directions = ends - origins
    moving = (directions != 0.0).any(axis=1)
    out: list[tuple] = [_NO_HIT] * len(origins)
    which = np.flatnonzero(moving)
    if not len(which) or not tables.geoms:
        return tuple(out)
    open_rays = which
    if number < 0:
        hits = world.raycast(origins[which], directions[which], max_distance=1.0).rows
        met = hits["hit"]
        leaving = met & _leaving(hits, directions[which], tables, passed)
        for k in np.flatnonzero(met & ~leaving).tolist():
            out[which[k]] = _hit(hits[k], directions[which[k]], tables)
        open_rays = which[leaving]
    if len(open_rays):
        every = world.raycast(origins[open_rays], directions[open_rays], max_distance=1.0, all_hits=True)
        assert every.starts is not None
        for k, ray in enumerate(open_rays.tolist()):
            hits = every.rows[every.starts[k] : every.starts[k + 1]]
            hits = hits[~_leaving(hits, np.repeat(directions[ray][None], len(hits), axis=0), tables, passed)]
            hit = _numbered(hits, max(number, 0), epsilon)
            if hit is not None:
                out[ray] = _hit(hit, directions[ray], tables)
    return tuple(out)


def _leaving(hits: np.ndarray, directions: np.ndarray, tables: Tables, passed: np.ndarray) -> np.ndarray:
    """(k,) bool: rows that are walls on the way out of a solid, or of bodies that rays pass through."""
    outward = np.einsum("ki,ki->k", hits["normal"], directions) > 0.0
    return (outward & ~tables.two_sided[hits["body"]]) | passed[hits["body"]]


def _numbered(hits: np.ndarray, number: int, epsilon: float) -> np.void | None:
    """The hit of a number among those of one ray, nearest first; None where there are fewer."""
    last: dict[int, float] = {}
    for hit in hits:
        body, fraction = int(hit["body"]), float(hit["distance"])
        if body in last and fraction - last[body] <= epsilon:
            continue
        last[body] = fraction
        if number == 0:
            return hit
        number -= 1
    return None


def _hit(hit: np.void, direction: np.ndarray, tables: Tables) -> tuple:
    """pybullet's tuple of one hit; normals of two-sided shapes stand against the ray."""
    row = int(hit["body"])
    normal = hit["normal"]
    if tables.two_sided[row] and normal @ direction > 0.0:
        normal = 0.0 - normal
    return (*tables.place(row), float(hit["distance"]), tuple(hit["point"].tolist()), tuple(normal.tolist()))


# --- balls around links -------------------------------------------------------------------------


def _has_two_sides(shape: Shape) -> bool:
    """Whether rays meet it from either side: surfaces and half-spaces."""
    if isinstance(shape, Compound):
        return all(_has_two_sides(item) for item, _ in shape.items)
    return isinstance(shape, Halfspace) or (isinstance(shape, Mesh) and not shape.solid)


def _pose(X: np.ndarray | None) -> np.ndarray:
    return np.eye(4) if X is None else X


def _balls(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles (n, 3) and half diagonals (n,) of boxes (n, 6); at the origin and infinite of unbounded ones."""
    unbounded = ~np.isfinite(boxes).all(axis=1)
    low, high = np.where(unbounded[:, None], 0.0, boxes).reshape(-1, 2, 3).swapaxes(0, 1)
    reaches = 0.5 * np.sqrt(np.square(high - low).sum(axis=1))
    reaches[unbounded] = math.inf
    return 0.5 * (low + high), reaches


def _gaps(A: Tables, i: np.ndarray, B: Tables, j: np.ndarray) -> np.ndarray:
    """(k,) lower bounds of the distances between rows i of A and j of B, by the balls around them [m]."""
    places = [
        np.einsum("nij,nj->ni", tables.X_WS[rows, :3, :3], tables.centers[rows]) + tables.X_WS[rows, :3, 3]
        for tables, rows in ((A, i), (B, j))
    ]
    size = np.abs(places[0]).max(axis=1) + np.abs(places[1]).max(axis=1)
    between = np.sqrt(np.square(places[1] - places[0]).sum(axis=1))
    return between - (A.reaches[i] + B.reaches[j]) * (1.0 + _SLACK) - _SLACK * size
