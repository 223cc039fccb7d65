"""Cells as arrays, portals, clutter, and the partition's own arguments: against points, areas and loops."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of
from reproduction import reproducing

import collide
from collide.errors import InvalidArgument
from collide.papers.partitions.cell_records import ConvexCells, _chained
from collide.papers.partitions.clutter import _meets_cube, clutter
from collide.papers.partitions.portals import Portals
from collide.papers.partitions.space_partition import PartitionSize, SpacePartition

MESHES = {"box": box(), "ring": block_ring(), "sphere": bumpy_sphere(30)}
BOX = (np.full(3, -1.5), np.full(3, 1.5))


def made(name: str) -> tuple[SpacePartition, ConvexCells]:
    partition = SpacePartition(collide.Mesh(*MESHES[name]), kappa=8)
    return partition, partition.cells(BOX)


def faces_of(cells: ConvexCells, i: int) -> list[np.ndarray]:
    return [cells.vertices[cells.loops[cells.loop_starts[j] : cells.loop_starts[j + 1]]]
            for j in range(cells.face_starts[i], cells.face_starts[i + 1])]


@pytest.mark.parametrize("name", MESHES)
def test_cells_are_what_their_planes_and_corners_say(name):
    partition, cells = made(name)
    assert cells.volumes.sum() == pytest.approx(27.0) and (cells.volumes > -1e-12).all()
    assert cells.volumes[cells.inside].sum() == pytest.approx(volume(partition.mesh))
    for i in range(0, len(cells), max(len(cells) // 25, 1)):
        planes, corners = cells.planes(i), cells.corners(i)
        heights = corners @ planes.normals.T - planes.offsets
        assert (heights <= 1e-9).all() and (heights.max(axis=0) > -1e-12).all()  # touched by each
        total = 0.0
        for face, n in zip(faces_of(cells, i), planes.normals):
            turn = np.cross(face - face[0], np.roll(face, -1, axis=0) - face[0]).sum(axis=0)
            assert turn @ n >= -1e-14  # counter-clockwise seen from outside
            total += sum(float(np.linalg.det([face[0] - corners[0], a - corners[0], b - corners[0]]))
                         for a, b in pairwise(face[1:])) / 6
        assert cells.volumes[i] == pytest.approx(total, abs=1e-12)
        for facet, axis, value, side, n in zip(planes.facet, planes.axis, planes.value, planes.side, planes.normals):
            assert (facet >= 0) == (axis < 0) == np.isnan(value)
            if axis >= 0:
                assert np.array_equal(n, -side * np.eye(3)[axis])
            else:
                a, b, c = partition.mesh.vertices[partition.mesh.faces[facet]]
                outward = -side * np.cross(b - a, c - a)
                np.testing.assert_allclose(n, outward / np.linalg.norm(outward), rtol=0, atol=1e-12)
        if cells.volumes[i] > 1e-6:
            assert collide.contains(cells.hull(i), np.eye(4), corners.mean(axis=0)[None])[0]


def volume(mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("name", ["ring", "sphere"])
@pytest.mark.parametrize("inside", [False, True])
def test_rows_of_leaves_are_the_cells_that_hold_them(name, inside):
    """Also of pieces that several leaves make up; −1 of leaves that no cell holds."""
    rng, (partition, _) = rng_of("rows of leaves", name, inside), made(name)
    pieces = partition.convex_pieces(inside, BOX)
    points = rng.uniform(-1.4, 1.4, (200, 3))
    row, truth = pieces.rows_of(partition.locate(points).cell), partition.locate(points).inside
    assert ((row >= 0) == (truth == inside)).all() and len(set(row.tolist())) > 3
    for p, i in zip(points[row >= 0], row[row >= 0].tolist()):
        planes = pieces.planes(i)
        with reproducing("p = {p}", p=p):
            assert (planes.normals @ p <= planes.offsets + 1e-9).all()
    every = pieces.rows_of(np.arange(partition.size.cells))
    assert np.array_equal(every[pieces.cell], np.arange(len(pieces)))
    assert pieces.volumes.sum() == pytest.approx(volume(partition.mesh) if inside else 27.0 - volume(partition.mesh))
    assert (pieces.inside == inside).all() and len(pieces) <= partition.size.cells
    for wrong in (len(pieces), -len(pieces) - 1, 0.5):
        with pytest.raises(InvalidArgument, match="ConvexCells: i"):
            pieces.corners(wrong)
    with pytest.raises(InvalidArgument, match=r"ConvexCells\.rows_of: leaves"):
        pieces.rows_of([0.5])


def shared_area(cells: ConvexCells, i: int, j: int) -> float:
    """Of faces of two cells in opposite planes, clipped by each other's planes."""
    total = 0.0
    planes_i, planes_j = cells.planes(i), cells.planes(j)
    for face, n, b in zip(faces_of(cells, i), planes_i.normals, planes_i.offsets):
        if not any(n @ m < -1 + 1e-9 and abs(b + c) < 1e-9 for m, c in zip(planes_j.normals, planes_j.offsets)):
            continue
        polygon = list(face)
        for m, c in zip(planes_j.normals, planes_j.offsets):
            if abs(n @ m) > 1 - 1e-9:
                continue
            out = []
            for p, q in zip(polygon, polygon[1:] + polygon[:1]):
                hp, hq = m @ p - c, m @ q - c
                out += [p] if hp <= 0 else []
                out += [p + hp / (hp - hq) * (q - p)] if hp * hq < 0 else []
            polygon = out
        if len(polygon) > 2:
            p = np.array(polygon)
            total += 0.5 * float(np.linalg.norm(np.cross(p - p[0], np.roll(p, -1, axis=0) - p[0]).sum(axis=0)))
    return total


@pytest.mark.parametrize("name", ["box", "ring"])
@pytest.mark.parametrize("inside", [False, True])
def test_portals_are_the_faces_that_pieces_share(name, inside):
    partition, _ = made(name)
    pieces = partition.convex_pieces(inside, BOX)
    portals = partition.portals(pieces)
    assert isinstance(portals, Portals) and (portals.cells[:, 0] < portals.cells[:, 1]).all()
    area: dict[tuple, float] = {}
    for (i, j), middle, size in zip(portals.cells.tolist(), portals.middle, portals.area.tolist()):
        area[i, j] = area.get((i, j), 0.0) + size
        for k in (i, j):  # a point of both
            planes = pieces.planes(k)
            assert (planes.normals @ middle <= planes.offsets + 1e-9).all()
    n_pairs = 0
    for i in range(len(pieces)):
        for j in range(i):
            expected = shared_area(pieces, i, j)
            n_pairs += expected > 1e-9
            assert area.get((j, i), 0.0) == pytest.approx(expected, abs=1e-9)
    assert n_pairs == sum(size > 1e-9 for size in area.values()) and (n_pairs > 2 or (name, inside) == ("box", True))


def test_starts_of_parts_follow_one_another():
    parts = [np.array([0, 2, 5]), np.array([0]), np.array([0, 1])]
    assert _chained(parts).tolist() == [0, 2, 5, 6] and _chained([np.array([0])]).tolist() == [0]


@pytest.mark.parametrize("seed", range(3))
def test_triangles_that_meet_a_cube_hold_a_point_of_it(seed):
    """Against many points of each triangle, and of triangles apart against a plane between."""
    rng = rng_of("cubes", seed)
    corners = rng.normal(size=(60, 3, 3)) * rng.uniform(0.3, 2.0, (60, 1, 1))
    meets = _meets_cube(corners, 0.5)
    weights = rng.dirichlet(np.ones(3), 4000)
    near = np.abs(np.einsum("ij,kjl->kil", weights, corners)).max(axis=2).min(axis=1)
    assert meets[near <= 0.5].all() and not meets[near > 0.6].any()
    assert 5 < meets.sum() < 55


def test_clutter_is_what_cubes_of_chance_meet():
    mesh = collide.Mesh(*box())
    found = clutter(mesh, cubes=30, seed=3)
    assert found == clutter(mesh, cubes=30, seed=3) != clutter(mesh, cubes=31, seed=4) and found.cubes == 30
    assert 1 <= found.mean <= found.max_facets <= 12
    apart = collide.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 9), (1, 0, 9), (0, 1, 9)], [(0, 1, 2), (3, 4, 5)])
    assert clutter(apart).max_facets == 1 and clutter(apart).mean == 1.0
    for arguments, words in ((("mesh",), "mesh must be a collide.Mesh"), ((mesh, 0), "clutter: cubes"),
                             ((mesh, 5, -1), "clutter: seed"), ((mesh, 2.5), "clutter: cubes")):
        with pytest.raises(InvalidArgument, match=words):
            clutter(*arguments)


@pytest.mark.parametrize("name", MESHES)
def test_sizes_count_what_there_is(name):
    partition, cells = made(name)
    size = partition.size
    assert isinstance(size, PartitionSize) and size.facets + size.thin == len(partition.mesh.faces) and size.thin == 0
    assert size.cells == size.cuts + 1 == len(partition.inside) and size.inside == partition.inside.sum()
    assert size.kappa == 8 and size.mean_depth <= size.depth < size.cells and size.first_cells <= size.pieces
    assert len(set(cells.cell.tolist())) == len(cells) and np.array_equal(cells.inside, partition.inside[cells.cell])


@pytest.mark.parametrize("name", MESHES)
def test_points_are_located_one_by_one_as_in_batches(name):
    rng, (partition, cells) = rng_of("located", name), made(name)
    points = np.vstack([rng.uniform(-1.4, 1.4, (20, 3)), partition.mesh.vertices[:5],
                        partition.mesh.vertices[partition.mesh.faces[:5]].mean(axis=1)])
    batch = partition.locate(points)
    assert np.array_equal(batch.inside, collide.contains(partition.mesh, np.eye(4), points))
    assert batch.boundary[20:25].all() and batch.inside[batch.boundary].all() and not batch.boundary[:20].all()
    rows = cells.rows_of(batch.cell)
    for p, row, k in zip(points, rows.tolist(), range(len(points))):
        one = partition.locate(p)
        assert (one.inside, one.boundary, one.cell) == (batch.inside[k], batch.boundary[k], batch.cell[k])
        planes = cells.planes(row)
        assert (planes.normals @ p <= planes.offsets + 1e-9).all()
        assert one.inside or not partition.inside[one.cell]
    empty = partition.locate(np.zeros((0, 3)))
    assert empty.inside.shape == empty.cell.shape == (0,)
    with pytest.raises(InvalidArgument, match="points"):
        partition.locate((0, 0, 1.1e50))
    with pytest.raises(InvalidArgument, match="cells must come from"):
        partition.portals(made(name)[1])
    for box_ in ([(0, 0, 0), (1, 1, 0)], [(0, 0, 0)], [(0, 0, 0), (1, 1, 2e50)]):
        with pytest.raises(InvalidArgument, match="box must be"):
            partition.cells(box_)
