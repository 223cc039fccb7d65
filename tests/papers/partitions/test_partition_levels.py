"""Both levels of a partition, its finished tree, and labels of leaves: pieces in cells, leaves that hold points."""

from __future__ import annotations

from contextlib import nullcontext
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of
from partition_judge import Judge, corners_of, middle, winding
from reproduction import reproducing
from solid_families import joined

import collide
from collide.papers.partitions.cut_polygons import Edges, edge_rows
from collide.papers.partitions.facet_level import cut_along_facets
from collide.papers.partitions.finished_tree import FinishedTree, exact_points
from collide.papers.partitions.leaf_labels import links_of, winding_numbers, witnesses_of_axes
from collide.papers.partitions.orthogonal_level import OrthogonalLevel
from collide.papers.partitions.partition_tree import EMPTY, PartitionTree
from collide.papers.partitions.planes import Planes
from collide.papers.partitions.vertices import Vertices

MESHES = {"box": box(), "ring": block_ring(), "sphere": bumpy_sphere(30)}


class Grown:
    """A partition as `SpacePartition` grows one, each step kept."""

    def __init__(self, name: str, kappa: int, n_spared: int = 4, seed: int = 0):
        vertices, faces = MESHES[name]
        self.mesh = collide.Mesh(vertices, faces)
        self.planes = Planes(self.mesh.vertices, self.mesh.faces.astype(np.int64))
        self.tree, self.vertices, self.edges = PartitionTree(1 << 30), Vertices(self.planes), Edges()
        self.level = OrthogonalLevel(self.tree, self.vertices, self.edges, kappa, n_spared)
        self.told: list[str] = []

        def progress(label: str):
            self.told.append(label)
            return nullcontext()

        self.level.grow(progress)
        self.n_first = self.tree.plane.n
        self.pieces, self.empty = self.level.polygons, self.level.leaves_without_facets()
        self.held_first = list(self.tree.held)
        self.areas = [self.area(k) for k in range(len(self.pieces.cell))]
        cut_along_facets(self.tree, self.vertices, self.edges, self.pieces, np.random.default_rng(seed), progress)
        self.tree.links.append(links_of(self.tree, *witnesses_of_axes(self.level), self.tree.held))
        self.finished = FinishedTree(self.tree, self.planes)

    def corners(self, k: int) -> np.ndarray:
        rows, _ = edge_rows(self.pieces[np.array([k])])
        return self.vertices.xyz.rows[self.edges.vertex.rows[rows]]

    def area(self, k: int) -> float:
        p = self.corners(k)
        return 0.5 * float(np.linalg.norm(np.cross(p - p[0], np.roll(p, -1, axis=0) - p[0]).sum(axis=0)))


def cell_of(grown: Grown, place: int) -> tuple[np.ndarray, np.ndarray]:
    """(low, high) of a place of the first level, by the cuts above."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    above = {int(c): at for at, c in enumerate(grown.tree.below.rows.tolist()) if c >= 0}
    while place:
        cut, is_above = divmod(place - 1, 2)
        k = int(grown.tree.plane.rows[cut]) - 4 * grown.planes.n
        axis, value = int(grown.planes.axis.rows[k]), float(grown.planes.value.rows[k])
        if is_above:
            low[axis] = max(low[axis], value)
        else:
            high[axis] = min(high[axis], value)
        place = above[cut]
    return low, high


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("kappa", [1, 8])
def test_pieces_of_facets_are_in_their_cells_and_none_is_lost(name, kappa):
    grown = Grown(name, kappa)
    low_corner = np.array([cell_of(grown, int(place)) for place in grown.pieces.cell])
    for k in range(len(grown.pieces.cell)):
        p = grown.corners(k)
        low, high = low_corner[k]
        assert (p >= low - 1e-9).all() and (p <= high + 1e-9).all()
        assert any((p[:, axis] > low[axis] + 1e-9).any() for axis in range(3))
    facet = np.cross(*np.diff(grown.mesh.vertices[grown.mesh.faces], axis=1).transpose(1, 0, 2))
    held = np.bincount(
        np.concatenate([np.zeros(0, dtype=int), *(f for _, f in grown.held_first)]), minlength=grown.planes.n
    )
    total = np.bincount(grown.pieces.plane, grown.areas, minlength=grown.planes.n)
    whole = 0.5 * np.linalg.norm(facet, axis=1)
    np.testing.assert_allclose(total[held == 0], whole[held == 0], rtol=1e-9)
    assert (total[held > 0] < whole[held > 0] * (1 + 1e-9)).all()
    # cells are those that need no further cut
    low, high = grown.level.low.rows, grown.level.high.rows
    for place in set(grown.pieces.cell.tolist()):
        guards = int((grown.level.guards.cell == place).sum())
        facets = int((grown.pieces.cell == place).sum())
        wide = (low[place] < high[place]).all()
        assert guards <= kappa or facets <= 4 or not wide
    assert set(grown.empty.tolist()).isdisjoint(grown.pieces.cell.tolist())
    below = grown.tree.below.rows[: 2 * grown.n_first + 1]
    leaves = set(np.flatnonzero((below == EMPTY) | (below >= grown.n_first)).tolist())
    assert set(grown.empty.tolist()) | set(grown.pieces.cell.tolist()) == leaves


def test_guards_are_strictly_inside_their_cells():
    grown = Grown("sphere", 24)
    assert len(grown.level.guards.xyz) > 10
    for p, place in zip(grown.level.guards.xyz, grown.level.guards.cell.tolist()):
        low, high = cell_of(grown, place)
        assert (low < p).all() and (p < high).all()
    assert grown.told and grown.told[0].startswith("cutting space along the axes, round 1: 1 cells")
    assert any("cutting space along facets, 0 %" in label for label in grown.told)


def naive_leaves(grown: Grown, p: list[Fraction]) -> list[int]:
    """All leaves whose closures hold a point, by a walk in Fractions."""
    tree, unit = grown.finished, Fraction(2) ** grown.planes.grid
    waiting, found = [0], []
    while waiting:
        place = waiting.pop()
        cut = int(tree.below[place])
        if cut < 0:
            found.append(~cut)
            continue
        a, b, c, d = grown.planes.coefficients(tree.plane[cut : cut + 1])[0]
        value = (a * p[0] + b * p[1] + c * p[2]) * unit + d
        waiting += [2 * cut + 1] * (value <= 0) + [2 * cut + 2] * (value >= 0)
    return sorted(found)


@pytest.mark.parametrize("name", MESHES)
def test_points_touch_the_leaves_of_a_walk_in_fractions(name):
    rng, grown = rng_of("touches", name), Grown(name, 8)
    corners = grown.mesh.vertices[grown.mesh.faces]
    weights = rng.integers(0, 3, (30, 3)) + np.array([1, 0, 0])
    on_facets = np.einsum(
        "ij,ijk->ik", weights / weights.sum(axis=1)[:, None], corners[rng.integers(0, len(corners), 30)]
    )
    beside = np.nextafter(on_facets, rng.choice([-np.inf, np.inf], on_facets.shape))
    far = [(1e50, -1e50, 1e-300)]
    points = np.vstack([on_facets, grown.mesh.vertices[:10], rng.uniform(-3, 3, (20, 3)), beside, far])
    touched, leaf = grown.finished.touches(points), grown.finished.leaves(points)
    n_many = 0
    for k, p in enumerate(points):
        with reproducing("p = {p}", p=p):
            expected = naive_leaves(grown, [Fraction(x) for x in p.tolist()])
            assert touched.leaf[touched.point == k].tolist() == expected
            assert leaf[k] == -1 or [leaf[k]] == expected, "the kernel's leaf is another"
            n_many += len(expected) > 1
    assert n_many > 8 and (np.diff(touched.point) >= 0).all() and 20 <= (leaf >= 0).sum() < len(points) - n_many
    exact = exact_points(grown.planes, points)
    unit = Fraction(2) ** grown.planes.grid
    for (x, y, z, w), p in zip(exact, points.tolist()):
        assert w > 0 and [Fraction(int(c), int(w)) / unit for c in (x, y, z)] == [Fraction(v) for v in p]
    on = set(zip(touched.on_point.tolist(), touched.on_cut.tolist()))
    for k, cut in on:
        value = sum(
            int(a) * int(c) for a, c in zip(grown.planes.coefficients(grown.finished.plane[cut : cut + 1])[0], exact[k])
        )
        assert value == 0
    nothing = grown.finished.touches(np.zeros((0, 3)))
    assert all(len(column) == 0 for column in nothing)


@pytest.mark.parametrize("name", MESHES)
def test_leaves_are_numbered_from_left_to_right(name):
    tree = Grown(name, 8).finished
    order, depths = [], []

    def walk(place: int, depth: int) -> tuple[int, int]:
        cut = int(tree.below[place])
        if cut < 0:
            order.append(~cut)
            depths.append(depth)
            assert tree.place[~cut] == place
            return ~cut, ~cut
        first, _ = walk(2 * cut + 1, depth + 1)
        _, last = walk(2 * cut + 2, depth + 1)
        assert (tree.first[cut], tree.last[cut]) == (first, last)
        return first, last

    assert walk(0, 0) == (0, tree.n_leaves - 1) and order == list(range(tree.n_leaves))
    assert tree.depth == max(depths) and tree.mean_depth == pytest.approx(np.mean(depths))
    assert len(tree.held_starts) == len(tree.plane) + 1 and tree.held_starts[-1] == len(tree.held)
    for cut in range(len(tree.plane)):  # a facet in a cut's plane
        for facet in tree.held[tree.held_starts[cut] : tree.held_starts[cut + 1]].tolist():
            a, b = tree.planes.coefficients(np.array([facet, tree.plane[cut]]))[:, :3].tolist()
            assert a[1] * b[2] == a[2] * b[1] and a[2] * b[0] == a[0] * b[2] and a[0] * b[1] == a[1] * b[0]


def test_a_partition_of_one_cut():
    vertices = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
    planes = Planes(vertices, np.array([[0, 1, 2]]))
    tree = PartitionTree(1 << 20)
    tree.cut(np.array([0]), np.array([0]))
    tree.hold(np.array([0]), np.array([0]))
    finished = FinishedTree(tree, planes)
    assert finished.n_leaves == 2 and finished.below.tolist() == [0, ~0, ~1] and finished.depth == 1
    touched = finished.touches(np.array([(0.2, 0.2, -1e-300), (0.2, 0.2, 0.0), (5.0, 5.0, 1.0)]))
    assert list(zip(touched.point.tolist(), touched.leaf.tolist())) == [(0, 0), (1, 0), (1, 1), (2, 1)]
    assert (touched.on_point.tolist(), touched.on_cut.tolist()) == ([1], [0])
    whole = FinishedTree(PartitionTree(1 << 20), planes)
    assert whole.n_leaves == 1 and whole.depth == 0 and whole.touches(vertices).leaf.tolist() == [0, 0, 0]


@pytest.mark.parametrize("name", MESHES)
def test_leaves_inside_are_those_whose_points_are(name):
    """Random points of leaves against `contains`; the order in which facets are taken changes no answer."""
    rng = rng_of("leaf labels", name)
    for seed in range(2):
        grown = Grown(name, 8, seed=seed)
        inside = winding_numbers(grown.finished, grown.tree.links) > 0
        points = rng.uniform(-1.2, 1.2, (60, 3))
        touched = grown.finished.touches(points)
        single = np.bincount(touched.point, minlength=60) == 1
        truth = collide.contains(grown.mesh, np.eye(4), points)
        assert np.array_equal(inside[touched.leaf[single[touched.point]]], truth[single]) and truth[single].any()
        assert 0 < inside.sum() < len(inside)


def judged_grate(layers: int, is_turned: bool) -> tuple[np.ndarray, np.ndarray]:
    """Bars in one plane, or in two planes across; a turned grate's tops are in one plane but for rounding."""
    bars = [box((2.0 * k, -1, 0), (2 * k + 1.0, 7, 1)) for k in range(3)]
    bars += [box((-1.0, 2 * k, layers - 1.0), (6, 2 * k + 1.0, float(layers))) for k in range(3)]
    vertices, faces = joined(*bars)
    q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    return (vertices @ (q * np.linalg.det(q)).T if is_turned else vertices), faces


@pytest.mark.many(4)
@pytest.mark.parametrize("layers, is_turned", [(1, False), (1, True), (2, False), (2, True)])
def test_winding_numbers_are_those_of_a_point_of_each_leaf(layers, is_turned):
    """Bars that overlap or lie on one another, by the judge's rays in fractions: 0, 1 and 2 times around a leaf."""
    vertices, faces = judged_grate(layers, is_turned)
    limits = (vertices.min(axis=0) - 1.0, vertices.max(axis=0) + 1.0)
    partition = collide.SpacePartition(collide.Mesh(vertices, faces), kappa=16)
    cells, judge = partition.cells(limits), Judge(vertices, faces, limits)
    rows = np.random.default_rng(0).permutation(len(cells))
    thin = rows[cells.volumes[rows] < 1e-13]
    assert (len(thin) > 100) == is_turned
    seen: dict[int, int] = {}
    for i in np.concatenate((thin[:40], rows[:60])).tolist():
        point = middle(corners_of(judge.walls(cells.planes(i))))
        expected = winding(judge.triangles, point)
        assert partition.winding[cells.cell[i]] == expected, (layers, is_turned, i, point)
        seen[expected] = seen.get(expected, 0) + 1
    may = {0, 1, 2} if layers == 1 or is_turned else {0, 1}  # turned bars that touched may overlap by a rounding
    assert {0, 1} <= set(seen) <= may and (layers == 2 or seen[2] > 4) and min(seen[0], seen[1]) > 4, seen
