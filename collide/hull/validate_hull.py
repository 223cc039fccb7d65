"""Checks of a hull in Python integers, without code of the builder.

Solid hulls are checked after Mehlhorn, Näher, Seel, Seidel, Schilz, Schirra, Uhrig, "Checking geometric programs or
verification of geometric structures" (1999). Every edge is run along once in each direction, a point lies strictly
below all facets, and the ray from this point through the middle of a facet meets no other: seen from the point the
facets cover every direction exactly once. Where no facet lies above its neighbour's plane besides, the surface bounds a
convex body. (Convex edges alone are not enough: a pentagram under two apices has convex edges, and winds twice.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull

#: Pairs of a point and a plane that are tested at once.
_BLOCK = 1 << 20
#: Relative error of a determinant in doubles: 8 roundings deep, u = 2⁻⁵³ each, twice that; and all that underflows.
_ERROR, _UNDERFLOW = 2.0**-49, 2.0**-1000


def validate_hull(points: np.ndarray, hull: Hull) -> None:
    """Raise AssertionError naming the first defect; exact.

    points : (n, 3) as given to `convex_hull`. O(f) exact determinants for the surface of f facets;
    every distinct point not kept is tested against every facet, in doubles where they suffice.
    """
    cloud = _Cloud(np.asarray(points, dtype=np.float64))
    vertices, facets = np.asarray(hull.vertices), np.asarray(hull.facets)
    _check_rows(cloud.points, hull.dimension, vertices, facets)
    dropped = _distinct(cloud.points, np.delete(np.arange(len(cloud.points)), vertices), vertices)
    if hull.dimension < 2:
        _check_straight(cloud.exact, vertices, dropped)
        return
    planes = _check_solid(cloud, facets) if hull.dimension == 3 else _check_flat(cloud, facets)
    _check_inside(cloud, planes, dropped)


class _Cloud:
    """The points as given, scaled to [1/2, 1) by a power of two, and as integers in one unit."""

    def __init__(self, points: np.ndarray):
        self.points = points
        fraction, exponent = np.frexp(points)
        self.scaled = np.ldexp(points, -np.frexp(np.abs(points).max())[1])
        mantissa = (fraction * 2.0**53).astype(np.int64)
        lowest = exponent[mantissa != 0].min() if mantissa.any() else 0
        self.exact = mantissa.astype(object) << np.where(mantissa == 0, 0, exponent - lowest).astype(object)


class _Planes(NamedTuple):
    """Planes through points ``base`` (m,) with the normals u × v, exact and in doubles, (m, 3) each."""

    base: np.ndarray
    u: np.ndarray
    v: np.ndarray
    exact_u: np.ndarray
    exact_v: np.ndarray


def _check_rows(points, dimension, vertices, facets) -> None:
    assert dimension in (0, 1, 2, 3), f"dimension is {dimension}"
    assert vertices.ndim == 1 and vertices.dtype == np.int32, "vertices must be a row of int32"
    assert facets.ndim == 2 and facets.shape[1] == 3 and facets.dtype == np.int32, "facets must be (f, 3) int32"
    assert (np.diff(vertices) > 0).all(), "vertices are not sorted, or one is named twice"
    assert len(vertices) and vertices[0] >= 0 and vertices[-1] < len(points), "a vertex is no row of the points"
    assert len(np.unique(points[vertices] + 0.0, axis=0)) == len(vertices), "two vertices are the same point"
    if dimension < 2:
        assert len(vertices) == dimension + 1, f"dimension {dimension} with {len(vertices)} vertices"
        assert not len(facets), f"dimension {dimension} with facets"
    else:
        assert np.array_equal(np.unique(facets), vertices), "the facets' corners are not the vertices"


def _distinct(points, rows, vertices) -> np.ndarray:
    """The first row of each distinct point among the rows, vertices excluded."""
    order = np.concatenate([vertices, rows])
    _, first = np.unique(points[order] + 0.0, axis=0, return_index=True)
    return order[np.sort(first)][len(vertices) :]


# --- determinants: of rows of integers exactly, of rows of doubles with an error bound ----------


def _cross(u, v):
    u, v = u.T, v.T
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], axis=-1)


def _inner(a, b):
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _sizes(u, v):
    """The cross product with all terms taken positive."""
    u, v = np.abs(u).T, np.abs(v).T
    return np.stack([u[1] * v[2] + u[2] * v[1], u[2] * v[0] + u[0] * v[2], u[0] * v[1] + u[1] * v[0]], axis=-1)


def _sign(values: np.ndarray) -> np.ndarray:
    return (values > 0).astype(np.int8) - (values < 0).astype(np.int8)


def _sides(cloud: _Cloud, planes: _Planes, which: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signs of the heights of points over planes ``which``, pair by pair."""
    base, u, v = planes.base[which], planes.u[which], planes.v[which]
    away = cloud.scaled[points] - cloud.scaled[base]
    height = _inner(_cross(u, v), away)
    result = _sign(height)
    ambiguous = np.flatnonzero(np.abs(height) <= _ERROR * _inner(_sizes(u, v), np.abs(away)) + _UNDERFLOW)
    if len(ambiguous):
        normal = _cross(planes.exact_u[which[ambiguous]], planes.exact_v[which[ambiguous]])
        away = cloud.exact[points[ambiguous]] - cloud.exact[base[ambiguous]]
        result[ambiguous] = _sign(_inner(normal, away))
    return result


def _facet_planes(cloud: _Cloud, facets: np.ndarray) -> _Planes:
    a, b, c = facets.T
    scaled, exact = cloud.scaled, cloud.exact
    return _Planes(a, scaled[b] - scaled[a], scaled[c] - scaled[a], exact[b] - exact[a], exact[c] - exact[a])


def _check_areas(planes: _Planes, facets: np.ndarray) -> None:
    zero = np.flatnonzero((_cross(planes.exact_u, planes.exact_v) == 0).all(axis=1))
    assert not len(zero), f"facet {facets[zero[0]].tolist()} has no area"


def _edges(facets: np.ndarray) -> np.ndarray:
    """(3 f, 2) directed edges: the first ones of all facets, the second ones, the third ones."""
    return np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]]).astype(np.int64)


def _twins(facets: np.ndarray) -> np.ndarray:
    """For every directed edge the number of the reversed edge, −1 if missing; no directed edge may appear twice."""
    edges = _edges(facets)
    assert (edges[:, 0] != edges[:, 1]).all(), "a facet names a corner twice"
    key, back = edges @ [1 << 31, 1], edges @ [1, 1 << 31]
    order = np.argsort(key)
    twice = np.flatnonzero(np.diff(key[order]) == 0)
    assert not len(twice), f"edge {edges[order[twice[0]]].tolist()} is run along twice: a facet doubled or flipped"
    place = np.minimum(np.searchsorted(key[order], back), len(key) - 1)
    return np.where(key[order][place] == back, order[place], -1)


# --- by dimension -------------------------------------------------------------------------------


def _check_solid(cloud: _Cloud, facets: np.ndarray) -> _Planes:
    n_facets = len(facets)
    twins = _twins(facets)
    assert (twins >= 0).all(), f"the surface is open at edge {_edges(facets)[np.argmin(twins)].tolist()}"
    euler = len(np.unique(facets)) - 3 * n_facets // 2 + n_facets
    assert euler == 2, f"Euler characteristic is {euler}, not 2"
    planes = _facet_planes(cloud, facets)
    _check_areas(planes, facets)
    opposite = np.concatenate([facets[:, 2], facets[:, 0], facets[:, 1]])[twins]
    which = np.tile(np.arange(n_facets), 3)
    bent = np.flatnonzero(_sides(cloud, planes, which, opposite) > 0)
    assert not len(bent), (
        f"facet {facets[which[bent[0]]].tolist()}: vertex {opposite[bent[0]]} of its neighbour is above it"
    )
    _check_covers_once(cloud, planes, facets)
    return planes


def _check_covers_once(cloud: _Cloud, planes: _Planes, facets: np.ndarray) -> None:
    """Seen from a point inside, the facets face away and cover each direction once."""
    vertices = np.unique(facets)
    off = _sides(cloud, planes, np.zeros(len(vertices), dtype=int), vertices)
    assert off.any(), "all facets lie in one plane"
    # All times 12: the mean of four corners and the middle of a facet are integers.
    inside = (cloud.exact[facets[0]].sum(axis=0) + cloud.exact[vertices[np.argmax(off != 0)]]) * 3
    a, b, c = (cloud.exact[facets[:, k]] * 12 - inside for k in range(3))
    towards = cloud.exact[facets[0]].sum(axis=0) * 4 - inside
    wrong = np.flatnonzero(_inner(_cross(a, b), c) <= 0)
    assert not len(wrong), f"facet {facets[wrong[0]].tolist()} does not turn its back on the inside"
    met = np.ones(len(facets), dtype=bool)
    for u, v in ((a, b), (b, c), (c, a)):
        met &= _inner(_cross(u, v), towards) >= 0
    assert met.sum() == 1, f"the surface winds {met.sum()} times around its inside"


def _check_flat(cloud: _Cloud, facets: np.ndarray) -> _Planes:
    """Triangles of equal orientation within a convex border cover its inside once. Returns the border's planes, square
    to an axis."""
    half = len(facets) // 2
    front = facets[:half]
    assert half and np.array_equal(front, facets[half:, ::-1]), "the second half is not the first seen from behind"
    planes = _facet_planes(cloud, front)
    _check_areas(planes, front)
    exact = cloud.exact
    normal = _cross(planes.exact_u[:1], planes.exact_v[:1])[0]
    off = np.flatnonzero(_inner(exact - exact[front[0, 0]], normal) != 0)
    assert not len(off), f"point {off[0]} is not in the plane"
    axis = int(np.argmax(normal != 0))
    up = np.zeros(3, dtype=object)
    up[axis] = 1 if normal[axis] > 0 else -1
    turned = np.flatnonzero(_cross(planes.exact_u, planes.exact_v)[:, axis] * up[axis] <= 0)
    assert not len(turned), f"triangle {front[turned[0]].tolist()} is turned over"
    a = _border(front)
    b = np.roll(a, -1)
    _check_convex_border(exact, a, b, axis, up)
    along, upright = exact[b] - exact[a], np.tile(up, (len(a), 1))
    return _Planes(a, cloud.scaled[b] - cloud.scaled[a], upright.astype(float), along, upright)


def _border(front: np.ndarray) -> np.ndarray:
    """Vertices of the single ring of edges without a reversed twin."""
    edges = _edges(front)[_twins(front) < 0]
    after = dict(edges.tolist())
    assert len(after) == len(edges), "the border passes a vertex twice"
    ring = [int(edges[0, 0])]
    while after[ring[-1]] != ring[0]:
        ring.append(after[ring[-1]])
        assert len(ring) <= len(edges), "the border is no ring"
    assert len(ring) == len(edges), "the border has several rings"
    return np.array(ring)


def _check_convex_border(exact, a, b, axis, up) -> None:
    """Left turns only, and a single turn in all: the edges' directions rise over a single run and fall over the other.
    """
    along = (exact[b] - exact[a])[:, [(axis + 1) % 3, (axis + 2) % 3]]
    after = np.roll(along, -1, axis=0)
    turns = (along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]) * up[axis]
    right = np.flatnonzero(turns < 0)
    assert not len(right), f"the border turns inwards at vertex {b[right[0]]}"
    rises = np.where(along[:, 0] == 0, along[:, 1] > 0, along[:, 0] > 0)
    changes = rises != np.roll(rises, -1)
    assert not (changes & (turns == 0)).any(), "the border runs back on itself"
    assert changes.sum() == 2, "the border winds several times"


def _check_straight(exact, vertices, dropped) -> None:
    assert len(vertices) > 1 or not len(dropped), f"point {dropped[0]} is another point than the vertex"
    first, last = exact[vertices[0]], exact[vertices[-1]]
    away = exact[dropped] - first
    along = np.tile(last - first, (len(dropped), 1))
    off = np.flatnonzero((_cross(along, away) != 0).any(axis=1))
    assert not len(off), f"point {dropped[off[0]]} is not on the line"
    place = _inner(along, away)
    off = np.flatnonzero((place < 0) | (place > _inner(along, along)))
    assert not len(off), f"point {dropped[off[0]]} is beyond the ends"


def _check_inside(cloud: _Cloud, planes: _Planes, dropped: np.ndarray) -> None:
    """No dropped point above any plane. Doubles first, good to 16 u of the normal's terms for coordinates below 1."""
    normals = _cross(planes.u, planes.v)
    offsets = _inner(normals, cloud.scaled[planes.base])
    margins = 2.0**-48 * _sizes(planes.u, planes.v).sum(axis=1) + _UNDERFLOW
    step = max(1, _BLOCK // len(normals))
    for at in range(0, len(dropped), step):
        block = dropped[at : at + step]
        x, y, z = cloud.scaled[block].T[:, :, None]
        heights = normals[:, 0] * x + normals[:, 1] * y + normals[:, 2] * z - offsets
        which, near = np.nonzero(heights >= -margins)[::-1]
        if len(near):
            over = np.flatnonzero(_sides(cloud, planes, which, block[near]) > 0)
            assert not len(over), f"point {block[near[over[0]]]} is outside"
