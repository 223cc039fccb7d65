"""Space partitions, judged in integers: no facet in a cell, volumes add up; points are where `contains` has them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from partition_judge import Judge
from solid_families import SOLIDS, joined, turned_over
from solid_judge import solids_of

import collide
from collide.errors import InvalidArgument, UnsupportedQuery

SNIPPET = """
sys.path[:0] = ["tests/families", "tests/solids", "tests/oracles", "tests/papers/partitions"]
from test_space_partition import mesh_of, points_near
mesh = mesh_of({family!r}, {seed})
"""


def mesh_of(family: str, seed: int) -> collide.Mesh:
    """Both solids of a case as one mesh where they stand: shells that overlap, touch, or lie in one another."""
    A, B, _, _ = solids_of(family, seed)
    parts = [(np.asarray(m.vertices), np.asarray(m.faces)) for m in (A, B)]
    return collide.Mesh(*joined(*parts))


def volume_of_mesh(mesh: collide.Mesh) -> Fraction:
    return Judge(mesh.vertices, mesh.faces, ((0, 0, 0), (1, 1, 1))).mesh_volume()


def around(mesh: collide.Mesh):
    """A box about the mesh with room."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.25 * float((high - low).max())
    return low - room, high + room


def points_near(partition, n: int, seed: int) -> np.ndarray:
    """Points of all kinds: anywhere, corners, middles of edges and facets, on cuts, an ulp off."""
    rng = np.random.default_rng(seed)
    mesh = partition.mesh
    low, high = around(mesh)
    corners = mesh.vertices[mesh.faces]
    some = corners[rng.integers(len(corners), size=n)]
    cells = partition.cells()
    points = [
        rng.uniform(low, high, (n, 3)), some[:, 0], 0.5 * (some[:, 0] + some[:, 1]), some.mean(axis=1),
        0.25 * some[:, 0] + 0.25 * some[:, 1] + 0.5 * some[:, 2],
        cells.vertices[rng.integers(len(cells.vertices), size=n)],
    ]
    on_cut = rng.uniform(low, high, (n, 3))
    axis_rows = np.flatnonzero(cells.axis >= 0)
    rows = axis_rows[rng.integers(len(axis_rows), size=n)]
    on_cut[np.arange(n), cells.axis[rows]] = cells.value[rows]
    flat = np.concatenate([*points, on_cut])
    return np.concatenate((flat, np.nextafter(flat, rng.choice([-np.inf, np.inf], flat.shape))))


@pytest.mark.many(2)
@pytest.mark.parametrize("family", SOLIDS)
def test_cells_hold_no_facets_and_tell_inside_from_outside(family):
    mesh = mesh_of(family, 3)
    limits = around(mesh)
    partition = collide.SpacePartition(mesh, kappa=16)
    cells = partition.cells(limits)
    chosen = some_cells(cells, 8, np.random.default_rng(3))
    verdict = Judge(mesh.vertices, mesh.faces, limits).judge(chosen)
    assert not verdict.wrong, (verdict.wrong[:3], SNIPPET.format(family=family, seed=3))
    assert verdict.n_facet_tests > 0


class SomeCells:
    """Some of the cells."""

    def __init__(self, cells, rows):
        self.cells, self.rows, self.inside = cells, rows, cells.inside[rows]

    def __len__(self):
        return len(self.rows)

    def planes(self, i):
        return self.cells.planes(self.rows[i])


def some_cells(cells, n, rng):
    return SomeCells(cells, rng.permutation(len(cells))[:n])


WHOLE = {
    "box": box(),
    "ring": block_ring(),
    "cavity": joined(box((0, 0, 0), (4, 4, 4)), turned_over(box((1, 1, 1), (3, 3, 3)))),
    "boxes apart": joined(box(), box((2, 0, 0), (3, 1, 1))),
    "boxes that share a wall": joined(box(), box((1, -1, -1), (2, 1, 1))),
    "sphere": bumpy_sphere(16, 2),
    "tiny beside huge": joined(box((0, 0, 0), (1000, 1000, 1000)), box((-1e-12, 0, 0), (0, 1e-12, 1e-12))),
}


@pytest.mark.many(2)
@pytest.mark.parametrize("name", WHOLE)
def test_volumes_add_up_in_fractions(name):
    """All cells fill the box; those inside have the mesh's volume, and so have the pieces."""
    mesh = collide.Mesh(*WHOLE[name])
    low, high = limits = around(mesh)
    partition = collide.SpacePartition(mesh)
    judge = Judge(mesh.vertices, mesh.faces, limits)
    all_ = judge.judge(partition.cells(limits))
    assert not all_.wrong
    assert all_.volume == np.prod([Fraction(float(h)) - Fraction(float(l)) for l, h in zip(low, high)])
    assert all_.volume_inside == judge.mesh_volume() > 0
    solid, free = partition.convex_pieces(), partition.convex_pieces(inside=False, box=limits)
    assert judge.judge(solid).volume == all_.volume_inside
    assert judge.judge(free).volume == all_.volume - all_.volume_inside
    assert len(solid) <= partition.size.inside and not free.inside.any()
    assert np.isclose(solid.volumes.sum(), float(all_.volume_inside), rtol=1e-12)


@pytest.mark.many(2)
@pytest.mark.parametrize("family", SOLIDS)
def test_points_are_where_contains_has_them(family):
    on_boundary = inside = total = 0
    for seed in range(2):
        mesh = mesh_of(family, seed)
        partition = collide.SpacePartition(mesh, kappa=24, seed=seed)
        points = points_near(partition, 40, seed)
        found, held = partition.locate(points), collide.contains(mesh, np.eye(4), points)
        wrong = np.flatnonzero(found.inside != held)
        assert not len(wrong), f"{SNIPPET.format(family=family, seed=seed)}\nlocate({points[wrong[0]].tolist()})"
        assert (partition.inside[found.cell] | found.boundary | ~found.inside).all()
        total, inside, on_boundary = total + len(held), inside + held.sum(), on_boundary + found.boundary.sum()
    assert 0.1 * total < inside < 0.9 * total and on_boundary > 0.02 * total, (total, inside, on_boundary)


def test_boundary_is_where_inside_and_outside_meet():
    """Two boxes that share a wall: the wall is inside, its rim is boundary. A box within a box has no boundary."""
    mesh = collide.Mesh(*joined(box(), box((1, -1, -1), (2, 1, 1)), box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))))
    found = collide.SpacePartition(mesh).locate([(1, 0, 0), (1, 1, 0), (-1, 0, 0), (0.5, 0, 0), (3, 0, 0), (2, 1, 1)])
    assert found.inside.tolist() == [True, True, True, True, False, True]
    assert found.boundary.tolist() == [False, True, True, False, False, True]
    one = collide.SpacePartition(mesh).locate((0.1, 0.2, 0.3))
    assert one.inside and not one.boundary and one.cell.shape == ()


def test_facets_with_nothing_behind_them_are_on_the_boundary():
    """Two facets back to back beside a box, and one without area: `contains` has them, and no leaf does."""
    vertices, faces = box()
    fin = np.array([[3.0, 0, 0], [4, 0, 0], [3, 1, 0], [5, 0, 0], [6, 0, 0], [7, 0, 0]])
    mesh = collide.Mesh(
        np.concatenate((vertices, fin)),
        np.concatenate((faces, [[8, 9, 10], [8, 10, 9], [11, 12, 13], [11, 13, 12]])),
    )
    if not mesh.solid:
        pytest.fail(str(mesh.report))
    partition = collide.SpacePartition(mesh)
    points = np.array([[3.25, 0.25, 0], [3.25, 0.25, 1e-9], [3.9, 0.9, 0], [6.5, 0, 0], [6.5, 0, 1e-300], [3, 0, 0]])
    found = partition.locate(points)
    assert found.inside.tolist() == collide.contains(mesh, np.eye(4), points).tolist()
    assert found.inside.tolist() == [True, False, False, True, False, True]
    assert (found.boundary == found.inside).all() and not partition.inside[found.cell].any()
    assert partition.size.thin == 2


def test_the_same_seed_gives_the_same_cells():
    mesh = collide.Mesh(*bumpy_sphere(300))
    one, same, other = (collide.SpacePartition(mesh, seed=seed) for seed in (1, 1, 2))
    assert one.size == same.size and np.array_equal(one.inside, same.inside)
    assert one.size.cuts != other.size.cuts


def test_every_cell_is_found_by_a_point_of_it():
    mesh = collide.Mesh(*bumpy_sphere(200))
    partition = collide.SpacePartition(mesh)
    cells = partition.cells()
    middles = np.array([cells.corners(i).mean(axis=0) for i in range(len(cells))])
    found = partition.locate(middles)
    agrees = found.cell == cells.cell
    thick = cells.volumes > 1e-9  # of the others rounding may take the middle into a neighbour
    assert agrees[thick].all() and agrees.mean() > 0.9 and thick.sum() > 200
    assert (found.inside == cells.inside)[agrees].all()


def test_cells_carry_rounded_planes_and_hulls():
    partition = collide.SpacePartition(collide.Mesh(*block_ring()))
    pieces = partition.convex_pieces()
    for i in range(len(pieces)):
        planes, corners = pieces.planes(i), pieces.corners(i)
        assert (planes.normals @ corners.T <= planes.offsets[:, None] + 1e-12).all()
        assert np.isclose(pieces.hull(i).points.mean(axis=0), corners.mean(axis=0)).all()
    with pytest.raises(InvalidArgument, match="ConvexCells: i must be an integer, one of"):
        pieces.planes(len(pieces))


def test_sizes_grow_as_n_log_n():
    """Cells over n log n within a factor of 2, depth by a fit: benchmarks/partitions.py has 10^3 to 10^5 facets."""
    ratios, depths = [], []
    for n in (400, 1200, 3600):
        size = collide.SpacePartition(collide.Mesh(*bumpy_sphere(n))).size
        ratios.append(size.cells / (size.facets * np.log2(size.facets)))
        depths.append(size.depth / np.log2(size.facets))
    assert max(ratios) < 2 * min(ratios) and max(depths) < 4


@pytest.mark.parametrize("name", ["ring", "cavity", "boxes that share a wall", "sphere"])
def test_portals_cover_the_faces_of_cells(name):
    """All faces but those in the box's sides are portals, from both sides; of free space all but those on facets."""
    mesh = collide.Mesh(*WHOLE[name])
    limits = around(mesh)
    partition = collide.SpacePartition(mesh)
    cells = partition.cells(limits)
    portals = partition.portals(cells)
    faces, area = np.zeros(len(cells)), np.zeros(len(cells))
    for i in range(len(cells)):
        for j in range(cells.face_starts[i], cells.face_starts[i + 1]):
            if cells.axis[j] >= 0 and cells.value[j] in (limits[0][cells.axis[j]], limits[1][cells.axis[j]]):
                continue
            at = cells.vertices[cells.loops[cells.loop_starts[j] : cells.loop_starts[j + 1]]]
            faces[i] += 0.5 * np.linalg.norm(np.cross(at - at[0], np.roll(at, -1, axis=0) - at[0]).sum(axis=0))
    for side in range(2):
        np.add.at(area, portals.cells[:, side], portals.area)
    assert np.allclose(area, faces, rtol=1e-9, atol=1e-12) and (portals.cells[:, 0] < portals.cells[:, 1]).all()
    free = partition.convex_pieces(inside=False, box=limits)
    doors = partition.portals(free)
    assert not (partition.locate(doors.middle[doors.area > 1e-6]).inside).any()
    assert len(np.unique(doors.cells)) == len(free) - (name == "cavity")  # the cavity is a piece without doors
    rows = free.rows_of(np.arange(partition.size.cells))
    assert (rows[free.cell] == np.arange(len(free))).all() and (rows[partition.inside] == -1).all()
    held = np.flatnonzero(~partition.inside & np.isin(np.arange(len(rows)), cells.cell))
    assert (rows[held] >= 0).all() and free.rows_of([0]).shape == (1,)
    crossing = portals.area[partition.inside[cells.cell[portals.cells]].sum(axis=1) == 1]
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    surface = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert np.isclose(crossing.sum(), surface - (8.0 if "wall" in name else 0.0), rtol=1e-9)
    with pytest.raises(InvalidArgument, match="this partition"):
        collide.SpacePartition(mesh).portals(free)


def test_bad_meshes_are_refused_with_facet_numbers():
    vertices, faces = box()
    with pytest.raises(InvalidArgument, match=r"open edges.*facet"):
        collide.SpacePartition(collide.Mesh(vertices, faces[:-1]))
    with pytest.raises(InvalidArgument, match="inside out"):
        collide.SpacePartition(collide.Mesh(vertices, faces[:, ::-1]))
    with pytest.raises(InvalidArgument, match="encloses nothing"):
        collide.SpacePartition(collide.Mesh(vertices * [1, 1, 0], faces))
    with pytest.raises(InvalidArgument, match="solid=False"):
        collide.SpacePartition(collide.Mesh(vertices, faces, solid=False))
    with pytest.raises(InvalidArgument, match="Mesh"):
        collide.SpacePartition(collide.Box((1, 1, 1)))


def test_bad_arguments_are_refused():
    mesh = collide.Mesh(*box())
    partition = collide.SpacePartition(mesh)
    for bad in ({"kappa": 0}, {"kappa": 1.5}, {"seed": -1}, {"memory": "much"}):
        with pytest.raises(InvalidArgument, match=next(iter(bad))):
            collide.SpacePartition(mesh, **bad)
    for points in ([(0, 0)], [(0, 0, np.nan)], [(0, 0, 1e60)], "here"):
        with pytest.raises(InvalidArgument, match="points"):
            partition.locate(points)
    assert len(partition.locate(np.zeros((0, 3))).cell) == 0
    with pytest.raises(InvalidArgument, match="no end"):
        partition.convex_pieces(inside=False)
    for limits in (((0, 0, 0), (1, 1, 0)), ((1, 1, 1), (0, 0, 0)), (0, 1), ((0, 0, 0), (1, 1, np.inf))):
        with pytest.raises(InvalidArgument, match="box"):
            partition.convex_pieces(inside=False, box=limits)
    with pytest.raises(InvalidArgument, match="inside"):
        partition.convex_pieces(inside="yes")


def test_memory_is_limited_and_progress_told():
    mesh = collide.Mesh(*bumpy_sphere(2000))
    with pytest.raises(UnsupportedQuery, match=r"cells so far take .* memory=100,000"):
        collide.SpacePartition(mesh, memory=100_000)
    with pytest.raises(UnsupportedQuery, match=r"the first level has .* cells with up to"):
        collide.SpacePartition(mesh, memory=3_000_000)
    labels = []

    class Told:
        def __init__(self, label):
            labels.append(label)

        def __enter__(self):
            return lambda label: None

        def __exit__(self, *_):
            return None

    collide.SpacePartition(mesh, progress=Told)
    assert any("axes" in label for label in labels) and any("along facets" in label for label in labels)


def test_a_box_that_holds_nothing_of_the_solid_is_one_piece_or_none():
    partition = collide.SpacePartition(collide.Mesh(*box()))
    far = ((5, 5, 5), (6, 7, 8))
    assert len(partition.convex_pieces(box=far)) == 0
    free = partition.convex_pieces(inside=False, box=far)
    assert free.volumes.sum() == 6.0
    within = partition.convex_pieces(box=((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
    assert np.isclose(within.volumes.sum(), 1.0, rtol=1e-14)
