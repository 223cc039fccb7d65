"""Rows of results for pairs of shapes of which one at least is a mesh.

Gaps are the surfaces' distance less the radii, in brackets below 2⁻⁴³ of the size. Overlaps are minus the length of a
translation that is proven to part the bodies (`separating_translation.py`); how much shorter another one might be is not known, so
the bracket reaches up to 0.
"""

from __future__ import annotations

import math

import numpy as np

from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import Body, body_of, farthest_told, has_facets, hull_of, is_halfspace, reach_of
from collide.narrowphase.convex_bodies import convex_hits, convex_rows
from collide.narrowphase.facets.facet_convex import Posed
from collide.narrowphase.facets.facet_queries import surface_distances
from collide.narrowphase.facets.mesh_curved import curved_rows, decide
from collide.narrowphase.facets.mesh_hits import APART, HIT, apart_nearby, core_hits, states, swept_apart
from collide.narrowphase.facets.separating_translation import way_out
from collide.narrowphase.fallback_searches import lay_points_apart
from collide.results import EXACT, FIELDS, FORMULA, PAIR_DTYPE, UNDECIDED, flipped
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape

#: Facets nearer than this share of the pair's size tell its direction badly.
NEAR = 2.0**-24
#: `certified` promises gaps in brackets no wider than this, in units of the pair's size.
PROMISE = 2.0**-43


def mesh_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4) of two shapes, a mesh among them. Raises UnsupportedQuery."""
    if is_halfspace(A) or is_halfspace(B):
        return np.where(convex_hits(hull_shape(A), hull_shape(B), X_WA, X_WB), HIT, APART)
    if not has_facets(A):
        return mesh_states(B, A, X_WB, X_WA)
    if not has_facets(B):
        return decide(body_of(A), enclosure_of(B), given(X_WA), given(X_WB)).state
    one, other = body_of(A), body_of(B)
    return states(one, other, X_WA, X_WB) if one.key <= other.key else states(other, one, X_WB, X_WA)


def mesh_rows(A: Shape, B: Shape, X_WA, X_WB, *, limit: float, depths: bool = True) -> np.ndarray:
    """Rows (PAIR_DTYPE) for poses (n, 4, 4); part_a and part_b are facets, 0 where none decided.

    limit, depths : as in `distance`.
    """
    if is_halfspace(A) or is_halfspace(B):
        rows = convex_rows(hull_shape(A), hull_shape(B), X_WA, X_WB, limit=limit, depths=depths)
        rows["count"], rows["vertices_a"], rows["vertices_b"] = 0, -1, -1  # of the hull, not of the mesh
        return rows
    if not has_facets(A):
        return flipped(mesh_rows(B, A, X_WB, X_WA, limit=limit, depths=depths))
    if not has_facets(B):
        return curved_rows(body_of(A), enclosure_of(B), given(X_WA), given(X_WB), limit=limit, depths=depths)
    rows = rows_in_order(_rows, body_of(A), body_of(B), X_WA, X_WB, limit, depths)
    out = np.zeros(len(rows), dtype=PAIR_DTYPE)
    for name in FIELDS:  # padding stays 0: equal answers are equal bytes
        out[name] = rows[name]
    return out


def rows_in_order(rows_of, one, other, X_WA, X_WB, limit: float, depths: bool) -> np.ndarray:
    """``rows_of(one, other, X_WA, X_WB, limit, depths)``, worked out on the same numbers for swapped questions.

    one, other : bodies or unions, whose ``key`` orders them by content.
    """
    if other.key < one.key:
        return flipped(rows_of(other, one, X_WB, X_WA, limit, depths))
    if one.key == other.key:
        turned = np.array([X.tolist() > Y.tolist() for X, Y in zip(X_WA[:, :3], X_WB[:, :3])], dtype=bool)
        if turned.any():
            rows = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
            rows[~turned] = rows_of(one, other, X_WA[~turned], X_WB[~turned], limit, depths)
            rows[turned] = flipped(rows_of(other, one, X_WB[turned], X_WA[turned], limit, depths))
            return rows
    return rows_of(one, other, X_WA, X_WB, limit, depths)


def facet_rows_of(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """Rows of two bodies of facets, without depths."""
    return rows_in_order(_rows, body_of(A), body_of(B), X_WA, X_WB, math.inf, False)


def given(X: np.ndarray) -> Posed:
    """Poses as they were given."""
    return Posed(X, np.zeros(len(X)))


def hull_shape(shape: Shape) -> Shape:
    """The hull of a mesh, any other shape itself."""
    return shape.convex_hull if isinstance(shape, Mesh) else shape


def _rows(A: Body, B: Body, X_WA, X_WB, limit: float, depths: bool) -> np.ndarray:
    rows = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
    rows["vertices_a"] = rows["vertices_b"] = -1
    core, inside = core_hits(A, B, X_WA, X_WB)
    radius = A.radius + B.radius
    left = np.flatnonzero(~core)
    out_of_sight = math.nextafter(math.nextafter(limit, math.inf) + radius, math.inf)
    found = surface_distances(A.tree, B.tree, X_WA[left], X_WB[left], out_of_sight)
    apart, sure = swept_apart(A, B, found)
    if not sure.all():
        apart[~sure] = apart_nearby(A, B, X_WA[left[~sure]], X_WB[left[~sure]])
        sure |= apart
    rows[left] = _gaps(A, B, X_WA[left], X_WB[left], found, limit)
    if limit > farthest_told(A, B):
        for k in left[found.facets[:, 0] < 0].tolist():
            rows[k] = _far_gap(A, B, X_WA[k], X_WB[k], limit)
    rows["hit"], rows["hit"][left] = True, ~apart
    rows["how"][core], rows["how"][left] = EXACT, np.where(sure, FORMULA, UNDECIDED)
    for k in np.flatnonzero(rows["hit"]).tolist():
        at = int(np.searchsorted(left, k)) if not core[k] else -1
        point, step = _common(A, B, X_WA[k], X_WB[k], inside[k], rows[k], found, at)
        _overlap(A, B, X_WA[k], X_WB[k], rows, k, point, step, depths)
    return rows


def _gaps(A: Body, B: Body, X_WA, X_WB, found, limit: float) -> np.ndarray:
    """Rows of bodies whose cores are apart."""
    rows = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
    rows["vertices_a"] = rows["vertices_b"] = -1
    radius = A.radius + B.radius
    unseen = found.facets[:, 0] < 0
    across = X_WB[:, :3, 3] + (X_WB[:, :3, :3] * B.centre).sum(axis=2)
    start = X_WA[:, :3, 3] + (X_WA[:, :3, :3] * A.centre).sum(axis=2)
    normal = np.where(unseen[:, None], _unit(across - start), found.normal)
    lost = (normal == 0.0).all(axis=1)
    normal[lost] = _unit((across - start)[lost])
    turned = _of_hulls(A, B, X_WA, X_WB, found, normal)
    rows["normal"] = normal + 0.0
    rows["lower"] = np.maximum(_down(found.lower - radius) if radius else found.lower, 0.0)
    rows["upper"] = np.maximum(_up(found.upper - radius) if radius else found.upper, 0.0)
    rows["distance"] = np.clip(found.distance - radius, rows["lower"], rows["upper"])
    # Apart, and nearer than the bracket is wide: 0 would say that they touch.
    none = rows["distance"] == 0.0
    rows["distance"][none] = rows["upper"][none]
    rows["point_a"], rows["point_b"] = found.point_a + A.radius * normal, found.point_b - B.radius * normal
    lay_points_apart(rows, turned)
    rows["part_a"], rows["part_b"] = np.maximum(found.facets[:, 0], 0), np.maximum(found.facets[:, 1], 0)
    beyond = unseen | (rows["lower"] > limit)
    rows["beyond"] = beyond
    narrow = rows["upper"] <= rows["lower"] + PROMISE * _size(A, B, X_WA, X_WB)
    rows["certified"] = (narrow | beyond) & ((rows["lower"] > 0.0) | (radius == 0.0))
    if beyond.any():
        # Without a limit, what is unseen is for `_far_gap` to write.
        rows["lower"][unseen] = math.nextafter(limit, math.inf) if limit < math.inf else 0.0
        rows["distance"][beyond], rows["upper"][beyond] = rows["lower"][beyond], math.inf
        middle = 0.5 * (start + across)[unseen]
        half = 0.5 * rows["distance"][unseen, None] * normal[unseen]
        rows["point_a"][unseen], rows["point_b"][unseen] = middle - half, middle + half
    rows["exact"] = np.minimum(found.counters[:, 2], 255)
    return rows


def _of_hulls(A: Body, B: Body, X_WA, X_WB, found, normal: np.ndarray) -> np.ndarray:
    """Numbers of the rows whose ``normal`` becomes, in place, that of the hulls.

    Of a pair of facets that all but touch rounding leaves many directions, and the pair found may be one around the corner of
    two faces that lie on each other. Hulls that are as far apart, as far as is proven, know the bodies' own direction.
    """
    near = np.flatnonzero((found.facets[:, 0] >= 0) & (found.distance <= NEAR * _size(A, B, X_WA, X_WB)))
    if not len(near):
        return near
    hulls = convex_rows(hull_of(A), hull_of(B), X_WA[near], X_WB[near])
    as_far = hulls["upper"] + A.radius + B.radius >= found.lower[near]
    near, hulls = near[as_far], hulls[as_far]
    normal[near] = hulls["normal"]
    return near


def _far_gap(A: Body, B: Body, X_WA, X_WB, limit: float) -> np.ndarray:
    """The row of bodies so far apart that boxes in floats could not tell how far: their hulls and one point of each do."""
    row = convex_rows(hull_of(A), hull_of(B), X_WA[None], X_WB[None], limit=limit)
    row["count"], row["part_a"], row["part_b"] = 0, 0, 0
    row["vertices_a"] = row["vertices_b"] = -1
    if not row["beyond"][0]:
        one, other = (X[:3, 3] + (X[:3, :3] * body.points[0]).sum(axis=1) for body, X in ((A, X_WA), (B, X_WB)))
        across = float(np.sqrt(np.square(other - one).sum())) * (1 + 2.0**-45) - A.radius - B.radius
        row["upper"] = max(across, float(row["upper"][0]))
        if row["lower"][0] <= 0.0:  # the hulls meet, and these points are all that is known
            row["normal"] = _unit((other - one)[None])
            row["lower"], row["distance"] = 0.0, row["upper"]
            row["point_a"], row["point_b"] = one + A.radius * row["normal"], other - B.radius * row["normal"]
        size = _size(A, B, X_WA[None], X_WB[None])[0]
        row["certified"] = bool(row["lower"][0] > 0.0 and row["upper"][0] <= row["lower"][0] + PROMISE * size)
    return row[0]


def _common(A: Body, B: Body, X_WA, X_WB, inside, row, found, at: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """(a point of both bodies, translations that may part them); ``at`` is the row of ``found``, −1 of cores that meet."""
    if at >= 0:  # only the radii overlap
        overlap = (A.radius + B.radius - float(found.lower[at])) * (1 + 1e-12) + 1e-300
        middle = 0.5 * (row["point_a"] + row["point_b"])
        return middle, [overlap * row["normal"]] if overlap > 0.0 else []
    if not np.isnan(inside[0]):
        return inside, []
    meeting = surface_distances(A.tree, B.tree, X_WA, X_WB)
    row["part_a"], row["part_b"] = np.maximum(meeting.facets[0], 0)
    return meeting.point_a[0], []


def _overlap(A: Body, B: Body, X_WA, X_WB, rows, k: int, point, more, depths: bool) -> None:
    """Fill in row k of bodies that meet."""
    row = rows[k]
    decided = row["how"] != UNDECIDED
    row["upper"] = 0.0 if decided else max(float(row["upper"]), 0.0)
    row["beyond"] = False
    if not depths:
        row["distance"], row["lower"], row["normal"] = 0.0, 0.0, 0.0
        row["point_a"], row["point_b"], row["certified"] = point, point, decided
        return
    hulls = convex_rows(hull_of(A), hull_of(B), X_WA[None], X_WB[None])[0]
    length, bound, normal = way_out(A, B, X_WA, X_WB, hulls, more)
    row["distance"], row["lower"], row["normal"] = 0.0 - length, 0.0 - bound, normal + 0.0
    row["point_a"], row["point_b"] = point + 0.5 * length * normal, point - 0.5 * length * normal
    row["certified"] = bool(decided and bound == 0.0)


def _size(A: Body, B: Body, X_WA, X_WB) -> np.ndarray:
    """(n,) S of docs/conventions.md: reaches of both from their frames' origins, and the distance between these."""
    x, y, z = (X_WB[:, :3, 3] - X_WA[:, :3, 3]).T
    return (reach_of(A) + reach_of(B)) + np.sqrt(x * x + y * y + z * z)


def _unit(v: np.ndarray) -> np.ndarray:
    lengths = np.sqrt(np.square(v).sum(axis=1))[:, None]
    return np.where(lengths > 0.0, v / np.where(lengths > 0.0, lengths, 1.0), (0.0, 0.0, 1.0))


def _down(values: np.ndarray) -> np.ndarray:
    return np.nextafter(values, -math.inf)


def _up(values: np.ndarray) -> np.ndarray:
    return np.nextafter(values, math.inf)
