"""Polygons and cells cut by planes, many at once: clipped one by one in Fractions, and closed."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of

import collide
from collide.papers.partitions.convex_cells import cell_blocks
from collide.papers.partitions.cut_polygons import Edges, Polygons, cut_polygons, edge_rows, joined
from collide.papers.partitions.planes import Planes
from collide.papers.partitions.vertices import Vertices


def height(normal, offset, p):
    return sum(a * x for a, x in zip(normal, p)) - offset


def clipped(polygon: list, axis: int, value: Fraction, side: int) -> list:
    """Sutherland and Hodgman's, exactly."""
    out = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1]):
        hp, hq = side * (p[axis] - value), side * (q[axis] - value)
        if hp >= 0:
            out.append(p)
        if hp * hq < 0:
            t = hp / (hp - hq)
            out.append(tuple(a + t * (b - a) for a, b in zip(p, q)))
    return out


class Work:
    """Facets of a mesh as polygons, to be cut."""

    def __init__(self, vertices, faces, axis, value):
        faces = np.asarray(faces, dtype=np.int64)
        self.planes = Planes(np.asarray(vertices, dtype=float), faces)
        self.cuts = self.planes.add_axis_planes(np.asarray(axis), np.asarray(value, dtype=float))
        self.vertices, self.edges, n = Vertices(self.planes), Edges(), len(faces)
        begin = self.edges.add(faces.ravel(), (n + np.arange(3 * n)))[::3]
        zero = np.zeros(n, dtype=np.int64)
        self.polygons = Polygons(np.arange(n), zero, begin, np.full(n, 3), zero)

    def corners(self, polygons: Polygons, k: int) -> list:
        first, n = int(polygons.begin[k]), int(polygons.count[k])
        vertex = self.edges.vertex.rows[first : first + n]
        unit = Fraction(2) ** self.planes.grid
        return [tuple(Fraction(int(c), int(w)) / unit for c in p) for *p, w in self.vertices.exact(vertex).tolist()]


def same_loop(found: list, expected: list) -> bool:
    """The same corners in the same order, from wherever; repeated ones of a clip once."""
    expected = [p for k, p in enumerate(expected) if p != expected[k - 1]]
    return any(found == expected[k:] + expected[:k] for k in range(max(len(expected), 1)))


@pytest.mark.parametrize("kind", ["box", "random"])
def test_pieces_are_those_of_clipping(kind):
    rng, seen = rng_of("cut polygons", kind), Counter()
    vertices, faces = box() if kind == "box" else bumpy_sphere(20)
    axis = np.array([0, 1, 2, 0])
    value = np.array([0.25, 0.0, 1.0, -1.0]) if kind == "box" else rng.uniform(-0.5, 0.5, 4)
    work = Work(vertices, faces, axis, value)
    some, number = work.polygons, np.arange(len(faces))
    for _ in range(3):  # pieces of pieces
        which = rng.integers(0, 4, len(some.plane))
        before = [work.corners(some, k) for k in range(len(some.plane))]
        cut = cut_polygons(work.vertices, work.edges, some, work.cuts[which])
        halves = dict(zip(cut.both.tolist(), range(len(cut.both))))
        for k, polygon in enumerate(before):
            at, plane = int(axis[which[k]]), Fraction(float(value[which[k]]))
            levels = [p[at] - plane for p in polygon]
            assert (cut.below[k], cut.above[k]) == (min(levels) < 0, max(levels) > 0)
            assert (k in halves) == (min(levels) < 0 < max(levels))
            seen["both" if k in halves else "flat" if not any(levels) else "one side"] += 1
            if k in halves:
                for pieces, side in ((cut.minus, -1), (cut.plus, 1)):
                    assert same_loop(work.corners(pieces, halves[k]), clipped(polygon, at, plane, side))
                    assert pieces.plane[halves[k]] == some.plane[k]
        kept = np.flatnonzero(~(cut.below & cut.above))
        some = joined(some[kept], cut.minus, cut.plus)
        number = np.concatenate([number[kept], number[cut.both], number[cut.both]])
        assert (some.plane == number).all()
    assert seen["both"] > 5 and (seen["flat"] or kind == "random"), seen


def test_edges_are_listed_polygon_after_polygon():
    rng = rng_of("edge rows")
    count, begin = rng.integers(0, 6, 20), rng.integers(0, 90, 20)
    polygons = Polygons(*(np.zeros(20, dtype=np.int64),) * 2, begin, count, np.zeros(20, dtype=np.int64))
    rows, owner = edge_rows(polygons)
    expected = [(int(b) + i, k) for k, (b, n) in enumerate(zip(begin, count)) for i in range(n)]
    assert list(zip(rows.tolist(), owner.tolist())) == expected
    two = joined(polygons[[3, 1]], polygons[np.arange(20) == 7])
    assert two.begin.tolist() == [begin[3], begin[1], begin[7]] and len(two.columns()) == 5


def exact_volume(block, cell: int) -> Fraction:
    """Of a cell, by its faces' corners in Fractions; also tells that they close."""
    faces = block.faces[np.flatnonzero(block.faces.cell == cell)]
    unit, total, edges = Fraction(2) ** block.vertices.planes.grid, Fraction(0), Counter()
    for k in range(len(faces.plane)):
        vertex = block.edges.vertex.rows[faces.begin[k] : faces.begin[k] + faces.count[k]]
        p = [[Fraction(int(c), int(w)) / unit for c in q] for *q, w in block.vertices.exact(vertex).tolist()]
        keys = [tuple(q) for q in p]
        edges.update(zip(keys, keys[1:] + keys[:1]))
        for a, b, c in ((p[0], p[i], p[i + 1]) for i in range(1, len(p) - 1)):
            total += sum(a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]) for i in range(3))
        sign = np.array([int(s) for s in block.vertices.sides(vertex, np.repeat(faces.plane[k], len(vertex))).sign])
        assert not sign.any()  # corners are in the plane of their face
    assert all(edges[q, p] == n for (p, q), n in edges.items())
    return total / 6


@pytest.mark.parametrize("name", ["box", "ring"])
def test_cells_close_and_fill_the_box(name):
    mesh = collide.Mesh(*(box() if name == "box" else block_ring()))
    partition = collide.SpacePartition(mesh, kappa=8)
    tree, low, high = partition._tree, np.full(3, -2.5), np.full(3, 2.5)
    (block,) = cell_blocks(tree, np.arange(tree.n_leaves), low, high)
    assert (np.diff(block.leaf) > 0).all() and (np.diff(block.faces.cell) >= 0).all()
    volumes = [exact_volume(block, k) for k in range(len(block.leaf))]
    assert sum(volumes) == 125 and min(volumes) > 0
    inside = sum(v for v, leaf in zip(volumes, block.leaf) if partition.inside[leaf])
    assert inside == (8 if name == "box" else sum(signed(mesh)))
    some = np.arange(0, tree.n_leaves, 3)
    (part,) = cell_blocks(tree, some, low, high)
    assert set(part.leaf.tolist()) <= set(some.tolist())
    at = dict(zip(block.leaf.tolist(), volumes))
    assert [exact_volume(part, k) for k in range(len(part.leaf))] == [at[leaf] for leaf in part.leaf.tolist()]
    everything = np.zeros(len(tree.plane), dtype=bool)
    everything[tree.below[0]] = True
    (one,) = cell_blocks(tree, np.array([0]), low, high, everything)
    assert one.leaf.tolist() == [0] and exact_volume(one, 0) == 125
    outside = list(cell_blocks(tree, np.zeros(0, dtype=np.int64), low, high))
    assert outside == []


def signed(mesh) -> list[Fraction]:
    corners = [[[Fraction(c) for c in mesh.vertices[k].tolist()] for k in face] for face in mesh.faces.tolist()]
    return [sum(a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]) for i in range(3)) / 6
            for a, b, c in corners]
