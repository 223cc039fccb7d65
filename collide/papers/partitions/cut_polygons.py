"""Convex polygons cut by planes, many at once, with vertices named by planes: nothing is rounded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from collide.numerics.growing_rows import GrowingRows
from collide.papers.partitions.vertices import Sides, Vertices


@dataclass(frozen=True)
class Polygons:
    """Convex polygons, pieces of facets or faces of cells, (k,) int64 each.

    plane : number of the plane.   cell : the cell it lies in.   begin, count : its edges, rows of `Edges`.
    side : of a face of a cell, where the cell lies of its plane: 1 above, −1 below; 0 of a piece of a facet.
    """

    plane: np.ndarray
    cell: np.ndarray
    begin: np.ndarray
    count: np.ndarray
    side: np.ndarray

    def __getitem__(self, rows) -> Polygons:
        return Polygons(*(column[rows] for column in self.columns()))

    def columns(self) -> tuple[np.ndarray, ...]:
        return self.plane, self.cell, self.begin, self.count, self.side


def joined(*groups: Polygons) -> Polygons:
    """The polygons of several groups, one after another."""
    return Polygons(*(np.concatenate(columns) for columns in zip(*(group.columns() for group in groups))))


class Edges:
    """The edges of all polygons, in order around each.

    vertex : where an edge begins.   carrier : the other plane that the edge lies in.
    """

    def __init__(self) -> None:
        self.vertex, self.carrier = GrowingRows.empty(np.int64), GrowingRows.empty(np.int64)

    def add(self, vertex: np.ndarray, carrier: np.ndarray) -> np.ndarray:
        self.carrier.add(carrier)
        return self.vertex.add(vertex)

    def cut_back(self, n: int) -> None:
        self.vertex.cut_back(n)
        self.carrier.cut_back(n)

    @property
    def n_bytes(self) -> int:
        return self.vertex.n_bytes + self.carrier.n_bytes


def edge_rows(polygons: Polygons) -> tuple[np.ndarray, np.ndarray]:
    """(rows of all their edges, which polygon each belongs to), polygon after polygon."""
    owner = np.repeat(np.arange(len(polygons.count)), polygons.count)
    first = np.cumsum(polygons.count) - polygons.count
    return np.arange(len(owner)) - first[owner] + polygons.begin[owner], owner


class Cut(NamedTuple):
    """Polygons after a cut by planes.

    below, above : (k,) bool, polygons with points strictly on the side; polygons with neither lie in the plane.
    minus, plus : the pieces of cut polygons, in the order of `both`.
    both : rows of the cut polygons.
    sign : of every vertex of all polygons, in the order of `edge_rows`.
    """

    below: np.ndarray
    above: np.ndarray
    both: np.ndarray
    minus: Polygons
    plus: Polygons
    sign: np.ndarray


def cut_polygons(vertices: Vertices, edges: Edges, polygons: Polygons, planes: np.ndarray, shared: bool = False) -> Cut:
    """Cut each polygon by its plane. Edges and vertices of the pieces are added to `edges` and `vertices`.

    planes : (k,).   shared : polygons are the faces of cells: two faces of a cell share a new vertex.
    """
    rows, owner = edge_rows(polygons)
    vertex = edges.vertex.rows[rows]
    sides = _sides(vertices, vertex, planes[owner], shared)
    below, above = np.zeros(len(planes), dtype=bool), np.zeros(len(planes), dtype=bool)
    below[owner[sides.sign < 0]] = True
    above[owner[sides.sign > 0]] = True
    both = np.flatnonzero(below & above)
    number = np.full(len(planes), -1)
    number[both] = np.arange(len(both))
    selected = number[owner] >= 0
    if len(both) == 0:
        nothing = polygons[both]
        return Cut(below, above, both, nothing, nothing, sides.sign)
    rows, owner, vertex = rows[selected], number[owner[selected]], vertex[selected]
    part = polygons[both]
    minus, plus = _split_in_two(
        vertices, edges, part, planes[both], rows, owner, vertex, Sides(*(column[selected] for column in sides)), shared
    )
    return Cut(below, above, both, minus, plus, sides.sign)


def _sides(vertices: Vertices, vertex: np.ndarray, planes: np.ndarray, shared: bool) -> Sides:
    """Sides of vertices; the side of a vertex of several faces is found once."""
    if not shared:
        return vertices.sides(vertex, planes)
    pairs, back = np.unique(vertex + (planes << 32), return_inverse=True)
    asked = vertices.sides(pairs & 0xFFFFFFFF, pairs >> 32)
    back = np.ravel(back)
    return Sides(*(column[back] for column in asked))


def _split_in_two(vertices, edges, polygons, planes, rows, owner, vertex, sides, shared) -> tuple[Polygons, Polygons]:
    following = np.arange(1, len(rows) + 1)
    ends = np.cumsum(polygons.count)
    following[ends - 1] = ends - polygons.count
    carrier, sign = edges.carrier.rows[rows], sides.sign
    crossing = np.flatnonzero(sign * sign[following] < 0)
    new = np.full(len(rows), -1)
    new[crossing] = _new_vertices(
        vertices, polygons, planes, owner[crossing], vertex[crossing], vertex[following[crossing]], carrier[crossing],
        Sides(*(column[crossing] for column in sides)), Sides(*(column[following[crossing]] for column in sides)),
        shared,
    )
    parts = []
    for side in (-1, 1):
        here, there = sign * side, sign[following] * side
        # A vertex of this side begins its edge, or where the polygon leaves this side at it, an edge in the plane.
        leaves = (here == 0) & (there < 0)
        first = np.where(leaves, planes[owner], carrier)
        second = np.where(here > 0, planes[owner], carrier)  # a new vertex: the polygon leaves at it, or comes back
        emit = np.stack((here >= 0, new >= 0), axis=1).ravel()
        whose = np.repeat(owner, 2)[emit]
        count = np.bincount(whose, minlength=len(planes))
        pairs = (np.stack(two, axis=1).ravel()[emit] for two in ((vertex, new), (first, second)))
        begin = edges.add(*pairs)
        parts.append(replace(polygons, begin=begin[0] + np.cumsum(count) - count, count=count))
    return parts[0], parts[1]


def _new_vertices(vertices, polygons, planes, owner, tail, head, carrier, at_tail, at_head, shared) -> np.ndarray:
    """Numbers of the vertices in which edges cross their polygons' planes."""
    names = np.stack((polygons.plane[owner], carrier, planes[owner]), axis=1)
    back = None
    if shared:
        low, high = np.minimum(names[:, 0], carrier), np.maximum(names[:, 0], carrier)
        keys = np.stack((polygons.cell[owner], low, high), axis=1)
        _, first_of, back = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        names, tail, head = names[first_of], tail[first_of], head[first_of]
        at_tail, at_head = (Sides(*(column[first_of] for column in at)) for at in (at_tail, at_head))
    a, b = (np.maximum(at.height * at.sign, 0.0) for at in (at_tail, at_head))
    sum_ = a + b
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = np.where(sum_ > 0.0, a / sum_, 0.5)
        # The share is a weighted mean of the two bounds over the sum, and lies within [0, 1] whatever they are.
        off = np.where(sum_ > 0.0, np.minimum(1.0, 1.01 * np.maximum(at_tail.bound, at_head.bound) / sum_ + 2e-15), 1.0)
    p, q = vertices.xyz.rows[tail], vertices.xyz.rows[head]
    e = np.maximum(vertices.error.rows[tail], vertices.error.rows[head])
    xyz = p + t[:, None] * (q - p)
    largest = np.maximum(np.abs(p), np.abs(q)).max(axis=1)
    error = 1.01 * (e + off * (np.abs(q - p).max(axis=1) + 2.0 * e)) + 1e-15 * largest
    made = vertices.add(xyz, error, names)
    return made if back is None else made[np.ravel(back)]
