"""Merged pieces cover the same points, hulls of pieces tell what they miss, and go through every solid operation."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of
from partition_judge import Judge, corners_of, height, passes_through, plane_of, polytope_volume
from solid_families import SOLIDS, joined
from test_space_partition import around, mesh_of

import collide
from collide.errors import InvalidArgument
from collide.papers.partitions import space_partition

I = np.eye(4)
#: Solids of few pieces: the judge tries all threes of planes.
FAMILIES = [
    "cavities", "rings", "degenerate shells", "turned grid shells",
    *(pytest.param(family, marks=pytest.mark.slow) for family in ("boxes", "random shells", "scaled shells")),
]


def exact_volume(judge: Judge, cells) -> Fraction:
    """Of all cells, each from its planes."""
    walls = [judge.walls(cells.planes(i)) for i in range(len(cells))]
    return sum((polytope_volume(w, corners_of(w)) for w in walls), Fraction(0)) / judge.unit**3


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_merged_pieces_are_fewer_and_cover_the_same_points(family):
    """Volumes in fractions fill the box; no facet passes through free space; pieces hold the points located in them."""
    rng, mesh = rng_of("merged", family), mesh_of(family, 0)
    limits, partition = around(mesh), collide.SpacePartition(mesh, kappa=24)
    judge, points = Judge(mesh.vertices, mesh.faces, limits), rng.uniform(*limits, (100, 3))
    leaf = partition.locate(points).cell
    solid, free = partition.convex_pieces(), partition.convex_pieces(False, limits)
    verdict = judge.judge(free)
    assert not verdict.wrong, (family, verdict.wrong[:3])
    box_volume = np.prod([Fraction(h) - Fraction(l) for l, h in zip(limits[0].tolist(), limits[1].tolist())])
    assert exact_volume(judge, solid) + verdict.volume == box_volume, family
    fewer = 0
    for inside, merged in ((True, solid), (False, free)):
        single = partition.convex_pieces(inside, limits, merged=False)
        fewer += len(single) - len(merged)
        assert (merged.rows_of(merged.cell) == np.arange(len(merged))).all()
        assert np.array_equal(merged.rows_of(leaf) >= 0, single.rows_of(leaf) >= 0)
        for p, row in zip(points, merged.rows_of(leaf)):
            planes = merged.planes(max(row, 0))
            assert row < 0 or (planes.normals @ p <= planes.offsets + 1e-9).all(), (family, p.tolist())
    assert fewer > 2


def test_neighbours_make_a_piece_where_the_union_is_convex():
    """A ring is four bars, boxes that share a wall are a box; a sphere's pieces are fewer."""
    for made, most in ((block_ring(), 4), (joined(box(), box((1, -1, -1), (2, 1, 1))), 1), (bumpy_sphere(100), 130)):
        partition = collide.SpacePartition(collide.Mesh(*made))
        assert 1 <= len(partition.convex_pieces()) <= most < len(partition.convex_pieces(merged=False))
    with pytest.raises(InvalidArgument, match="merged must be True or False"):
        partition.convex_pieces(merged=1)


def test_free_space_is_not_merged_across_facets_with_nothing_behind(monkeypatch):
    """Two facets back to back in free space stay between pieces; merged regardless, pieces are caught by the judge."""
    vertices, faces = box()
    fin = np.array([[3.0, 0, 0], [4, 0, 0], [3, 1, 0]])
    mesh = collide.Mesh(np.concatenate((vertices, fin)), np.concatenate((faces, [[8, 9, 10], [8, 10, 9]])))
    limits, partition = around(mesh), collide.SpacePartition(mesh)
    judge = Judge(mesh.vertices, mesh.faces, limits)

    def spoilt() -> bool:
        pieces = partition.convex_pieces(False, limits)
        walls = [judge.walls(pieces.planes(i)) for i in range(len(pieces))]
        return any(passes_through(t, w) for t in judge.triangles for w in walls)

    assert not spoilt()
    monkeypatch.setattr(space_partition, "two_faced", lambda planes: set())
    assert spoilt()


def hull_volume(points: np.ndarray) -> Fraction:
    """By all planes through three points with the others on a side, in integers."""
    unit = max(Fraction(x).denominator for x in points.ravel().tolist())
    corners = sorted({(*(int(Fraction(x) * unit) for x in p), 1) for p in points.tolist()})
    walls = set()
    for three in combinations(corners, 3):
        plane = plane_of(*(p[:3] for p in three))
        heights = [height(plane, p) for p in corners]
        if any(plane[:3]) and (max(heights) <= 0 or min(heights) >= 0):
            common = np.gcd.reduce(np.array(plane, dtype=object)) * (1 if max(heights) <= 0 else -1)
            walls.add(tuple(x // common for x in plane))
    corners = [p for p in corners if sum(height(wall, p) == 0 for wall in walls) > 2]  # not those within a face or edge
    return polytope_volume(sorted(walls), corners) / unit**3 if len(walls) > 3 else Fraction(0)


@pytest.mark.parametrize("family", ["random shells", "turned grid shells"])
def test_the_excess_of_parts_is_the_difference_of_volumes(family):
    mesh = mesh_of(family, 1)
    partition = collide.SpacePartition(mesh, kappa=24)
    pieces = partition.convex_pieces()
    parts = partition.parts(pieces)
    held = [hull_volume(pieces.corners(i)) for i in range(len(pieces))]
    covered = exact_volume(Judge(mesh.vertices, mesh.faces, around(mesh)), pieces)
    assert parts.volume == float(covered) and parts.excess == float(sum(held) - covered), family
    assert [v > 0 for v in held] == np.isin(np.arange(len(pieces)), parts.piece).tolist()
    assert parts.n_flat == len(pieces) - len(parts.hulls) and abs(parts.excess) < 1e-13 * parts.volume
    assert parts.excess != 0.0 and len(pieces) > 5


def test_parts_of_doubles_cover_exactly_and_shells_that_overlap_count_once():
    bars = [box((2.0 * k, -1, 0), (2 * k + 1.0, 5, 1)) for k in range(3)]
    across = [box((-1.0, 2 * k, 0), (6, 2 * k + 1.0, 1)) for k in range(3)]
    partition = collide.SpacePartition(collide.Mesh(*joined(*bars, *across)))
    assert (partition.winding > 1).any()
    area = 3 * 6 + 3 * 7 - 9
    parts = partition.parts(partition.convex_pieces())
    assert (parts.volume, parts.excess, parts.n_flat) == (area, 0.0, 0) and len(parts.hulls) < 20
    limits = (np.full(3, -2.0), np.full(3, 8.0))
    free = partition.parts(partition.convex_pieces(False, limits))
    assert (free.volume, free.excess) == (1000.0 - area, 0.0)
    every = partition.parts(partition.cells(limits))
    assert (every.volume, every.excess) == (1000.0, 0.0)
    with pytest.raises(InvalidArgument, match="box of the pieces cuts the mesh"):
        partition.parts(partition.convex_pieces(box=(np.zeros(3), np.ones(3))))
    with pytest.raises(InvalidArgument, match="this partition"):
        partition.parts(collide.SpacePartition(partition.mesh).cells())


@pytest.mark.slow
@pytest.mark.parametrize("family", SOLIDS)
def test_pieces_go_through_every_solid_operation(family):
    """104 partitions: a piece taken from its solid leaves the rest, joined again the whole; the rest is partitioned."""
    n_solids = n_rests = 0
    for seed in range(8):
        mesh = mesh_of(family, seed)
        partition = collide.SpacePartition(mesh, seed=seed)
        parts = partition.parts(partition.convex_pieces())
        size = float(np.abs(mesh.vertices).max())
        slack, rng = 1e-11 * size**3, rng_of("pieces", family, seed)
        for k in rng.permutation(len(parts.hulls))[:1].tolist():
            hull, case = parts.hulls[k], (family, seed, k)
            held = collide.overlap_volume(mesh, hull, I, I)
            alone = collide.Mesh(*collide.tessellate(hull)).volume
            assert held.volume == pytest.approx(alone, abs=slack), case
            united, rest = (collide.boolean(mesh, hull, I, I, op) for op in ("union", "difference"))
            assert united.mesh.volume == pytest.approx(parts.volume, abs=slack), case
            n_solids += 1
            if rest.empty:
                assert alone == pytest.approx(parts.volume, abs=slack), case
                continue
            assert rest.mesh.solid and rest.mesh.volume + alone == pytest.approx(parts.volume, abs=slack), case
            again = collide.SpacePartition(rest.mesh)
            assert again.parts(again.convex_pieces()).volume == pytest.approx(rest.mesh.volume, abs=slack), case
            whole = collide.boolean(rest.mesh, hull, I, I, "union")
            assert whole.mesh.volume == pytest.approx(parts.volume, abs=slack), case
            n_rests += 1
    assert n_solids == 8 and n_rests >= (0 if family == "touching boxes" else 3), (n_solids, n_rests)
