"""Sides of sheets at the same cell: around every edge, neighbours in the angular order of the sheets.

Side 2 i is the front of sheet i, side 2 i + 1 its back. Turning counter-clockwise about an edge, from its lower end to
its higher, the turn leaves a sheet on its front where the edge runs upward in the sheet, and enters the sheet on the
other side.
"""

from __future__ import annotations

from functools import cmp_to_key
from typing import NamedTuple

import numpy as np

from collide.errors import CollideError
from collide.numerics.exact_points import Point
from collide.numerics.exact_vectors import cross, inner
from collide.solids.cut_points import CutPoints


class Sheets(NamedTuple):
    """Triangles without crossings, each once.

    triangles : (k, 3) ids of points, counter-clockwise seen from the front.
    facet : (k,) row of the facet holding the triangle, with the same front; of several facets the first.
    steps : (k, r) int8: each body's winding number behind the sheet less its winding number before.
    """

    triangles: np.ndarray
    facet: np.ndarray
    steps: np.ndarray


class _HalfEdges(NamedTuple):
    """Edges of sheets from point to point, half-edges between the same points together.

    keys : (m,) of both points.   sheet, upward : (m,) the sheet of the edge, and whether the edge runs to the point
        with the higher id.
    first, counts : (g,) first half-edge of each edge, and the number of its half-edges.
    """

    keys: np.ndarray
    sheet: np.ndarray
    upward: np.ndarray
    first: np.ndarray
    counts: np.ndarray


def joined_sides(
    sheets: Sheets, points: CutPoints, is_cut: np.ndarray, crossings: np.ndarray, ids: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of sides at the same cell.

    Only edges of cut facets, and edges of other than two sheets, are visited: other edges join whole facets of a part.
    Parameters as of `cells.cells_of`.
    """
    if not is_cut.any() and not any(len(of_body.odd) for of_body in points.facets.edges):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    edges = _half_edges(sheets, points, is_cut)
    leaves = 2 * edges.sheet + ~edges.upward
    enters = leaves ^ 1
    pairs = edges.first[edges.counts == 2]
    fours, is_ordered = _around_crossings(edges, sheets, points, crossings, ids)
    first = [leaves[pairs], leaves[pairs + 1], leaves[fours].ravel()]
    second = [enters[pairs + 1], enters[pairs], enters[np.roll(fours, -1, axis=1)].ravel()]
    for at, count in zip(edges.first[~is_ordered].tolist(), edges.counts[~is_ordered].tolist()):
        group = np.arange(at, at + count)
        low, high = divmod(int(edges.keys[at]), len(points))
        rows = group[around_edge(sheets, points, low, high, edges.sheet[group], edges.upward[group])]
        first.append(leaves[rows])
        second.append(enters[np.roll(rows, -1)])
    return np.concatenate(first), np.concatenate(second)


def _half_edges(sheets: Sheets, points: CutPoints, is_cut: np.ndarray) -> _HalfEdges:
    """Those of cut facets' sheets, and of whole facets at edges of cut ones or without exactly two facets."""
    facets, T = points.facets, sheets.triangles
    cut = np.flatnonzero(is_cut)
    n_whole = len(is_cut) - len(cut)
    edges = np.unique(facets.edge[cut])
    beside = facets.beside(edges).ravel()
    slot = np.argmax(facets.edge[beside] == np.repeat(edges, 2)[:, None], axis=1)
    of_whole = np.concatenate([(3 * beside + slot)[beside >= 0], facets.odd_half_edges()])
    facet = of_whole // 3
    of_whole = (of_whole - 3 * np.searchsorted(cut, facet))[~is_cut[facet]]
    rows = np.concatenate([of_whole, np.arange(3 * n_whole, 3 * len(T))])
    sheet, slot = rows // 3, rows % 3
    starts, ends = T[sheet, slot], T[sheet, (slot + 1) % 3]
    keys = np.minimum(starts, ends) * len(points) + np.maximum(starts, ends)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.append(True, keys[1:] != keys[:-1])) if len(keys) else np.zeros(0, dtype=np.int64)
    return _HalfEdges(keys, sheet[order], (starts < ends)[order], first, np.diff(np.append(first, len(keys))))


def _around_crossings(
    edges: _HalfEdges, sheets: Sheets, points: CutPoints, crossings: np.ndarray, ids: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """((k, 4) half-edges in order around the edge of a clear crossing of facets a, b, (g,) bool: edges of two sheets,
    or with such an order).

    About n_a × n_b the half of a whose edge runs along n_a × n_b is followed by the same half of b, then the other
    halves.
    """
    is_ordered = edges.counts == 2
    four = np.flatnonzero(edges.counts == 4)
    if not len(ids) or not len(four):
        return np.zeros((0, 4), dtype=np.int64), is_ordered
    low = ids.min(axis=1)
    keys = low * len(points) + ids.max(axis=1)
    order = np.argsort(keys)
    wanted = edges.keys[edges.first[four]]
    segment = order[np.minimum(np.searchsorted(keys[order], wanted), len(order) - 1)]
    a, b = crossings[segment].T
    rows = edges.first[four][:, None] + np.arange(4)
    of = sheets.facet[edges.sheet[rows]]
    known = (keys[segment] == wanted) & ((of == a[:, None]) | (of == b[:, None])).all(axis=1)
    role = 2 * (of == b[:, None]) + ~edges.upward[rows]
    places = np.argsort(role, axis=1)
    known &= (np.take_along_axis(role, places, axis=1) == np.arange(4)).all(axis=1)
    agrees = ids[segment, 0] == low[segment]
    order_of_roles = np.where(agrees[:, None], [0, 2, 1, 3], [0, 3, 1, 2])
    rows = np.take_along_axis(rows, np.take_along_axis(places, order_of_roles, axis=1), axis=1)
    is_ordered[four[known]] = True
    return rows[known], is_ordered


def around_edge(
    sheets: Sheets, points: CutPoints, low: int, high: int, sheet: np.ndarray, upward: np.ndarray
) -> list[int]:
    """The order in which sheets stand around an edge, counter-clockwise seen against its direction, exactly."""
    p, q = points.exact(low), points.exact(high)
    d: Point = tuple(y * p[3] - x * q[3] for x, y in zip(p[:3], q[:3]))  # type: ignore[assignment]
    normals = []
    for k, up in zip(sheet.tolist(), upward.tolist()):
        n = points.facets.normal(int(sheets.facet[k]))
        normals.append(n if up else (-n[0], -n[1], -n[2]))
    # A sheet lies in the direction n × d from the edge; such directions make the angles that their n make.
    reference = normals[0]

    def half_turn(n: Point) -> int:
        sign = inner(d, cross(reference, n))
        return 0 if sign > 0 or (sign == 0 and inner(reference, n) > 0) else 1

    sector = [half_turn(n) for n in normals]

    def compare(i: int, j: int) -> int:
        if sector[i] != sector[j]:
            return sector[i] - sector[j]
        sign = inner(d, cross(normals[i], normals[j]))
        if sign == 0 and i != j:
            raise CollideError("an arrangement of solids has two sheets in one place; please report it")
        return -1 if sign > 0 else 1

    return sorted(range(len(normals)), key=cmp_to_key(compare))
