"""Pairs of tetrahedra that share inner points, and the volumes they share, against fractions and each other."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from cell_families import (
    carried_into,
    edges_near_edges,
    edges_near_faces,
    kuhn_cubes,
    lattice_cells,
    pairs_of_meshes,
    random_cells,
    shaken,
    soup,
)
from mesh_families import random_pose
from tetrahedra_oracle import placed_cell, shared, volume_of

import collide
from collide import InvalidArgument, InvalidPose, Mesh
from collide.papers.tetrahedra import cell_overlaps, exact_cells, walk_cells
from collide.papers.tetrahedra.overlap_kernel import MEET

EYE = np.eye(4)
FAMILIES = pairs_of_meshes(5)
#: Of each family: how many pairs overlap, touch with boxes that overlap, and were settled in Python, at least.
HITS = {
    "random": (8, 3, 0), "random, posed": (8, 2, 0), "random, 1e9 m": (6, 2, 0), "random, 1e-9 m": (6, 2, 0),
    "whole numbers": (50, 20, 0), "tenths": (20, 20, 0), "tenths, moved": (5, 20, 3), "a quarter turn": (30, 15, 0),
    "one frame, turned": (30, 15, 0), "slivers": (8, 5, 2), "slivers, posed": (4, 5, 1),
    "edges near faces": (5, 5, 1), "edges near edges": (5, 5, 0),
    "edges near faces and edges, far away": (12, 15, 2), "tiny within large": (12, 10, 0),
    "cubes on themselves": (6, 20, 0), "cubes by halves": (40, 100, 0),
    "cubes by halves in one frame": (40, 100, 0), "cubes by tenths": (8, 8, 1), "cubes, mirrored": (6, 5, 0),
}


def snippet(name, A, B, X, Y, a, b) -> str:
    """The pair as lines to run."""
    return (
        f"{name}: A = collide.TetMesh({A.vertices[A.cells[a]].tolist()}, [[0, 1, 2, 3]]); "
        f"B = collide.TetMesh({B.vertices[B.cells[b]].tolist()}, [[0, 1, 2, 3]]); "
        f"collide.overlapping_cells(A, B, {X.tolist()}, {Y.tolist()}, volumes=True, check_poses=False)"
    )


def check_every_pair(name, A, B, X, Y) -> tuple[int, int, int]:
    """Every pair against the oracle; (pairs that overlap, that do not though their boxes do, settled in Python)."""
    got = collide.overlapping_cells(A, B, X, Y, volumes=True, centroids=True, check_poses=False)
    assert got.pairs.tolist() == sorted(got.pairs.tolist())
    assert np.array_equal(collide.overlapping_cells(A, B, X, Y, check_poses=False).pairs, got.pairs), name
    rows = {tuple(pair): k for k, pair in enumerate(got.pairs.tolist())}
    cells_a = [placed_cell(X, A.vertices[cell]) for cell in A.cells]
    cells_b = [placed_cell(Y, B.vertices[cell]) for cell in B.cells]
    touching = 0
    for i, cell_a in enumerate(cells_a):
        for j, cell_b in enumerate(cells_b):
            volume, centroid = shared(cell_a, cell_b)
            case = snippet(name, A, B, X, Y, i, j)
            assert (volume > 0) == ((i, j) in rows), case
            if not volume:
                boxes = [(max(p[k] for p in a) < min(p[k] for p in b)) for k in range(3)
                         for a, b in ((cell_a, cell_b), (cell_b, cell_a))]
                touching += not any(boxes)
                continue
            k = rows[i, j]
            assert got.volumes[k] == float(volume), case
            assert abs(Fraction(got.volumes[k]) - volume) <= Fraction(got.volume_errors[k]), case
            assert got.volume_errors[k] <= 0.5 * np.spacing(got.volumes[k]), case
            largest = max(abs(float(x)) for p in cell_a + cell_b for x in p)
            off = max(abs(x - Fraction(y)) for x, y in zip(centroid, got.centroids[k].tolist()))
            assert off <= 4 * np.spacing(largest), case
    return len(rows), touching, int(got.counters[0, 2:].max())


@pytest.mark.many(6)
@pytest.mark.parametrize("name", list(FAMILIES))
def test_equal_to_fractions(name):
    hits = check_every_pair(name, *FAMILIES[name])
    assert all(n >= least for n, least in zip(hits, HITS[name])), (name, hits)


@pytest.mark.many(2)
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("make", [edges_near_faces, edges_near_edges])
def test_verdicts_within_rounding_of_touching(make, far):
    """Pairs that overlap by a hair or miss each other by one: cell k of A and cell k of B."""
    rng = np.random.default_rng(17)
    X, Y = (random_pose(rng, 1e4), random_pose(rng, 1e4)) if far else (EYE, EYE)
    A, B = (soup(carried_into(pose, cells)) for pose, cells in zip((X, Y), make(rng, 60)))
    pairs = {tuple(pair) for pair in collide.overlapping_cells(A, B, X, Y).pairs.tolist()}
    thin = 0
    for k in range(60):
        volume = shared(*(placed_cell(P, mesh.vertices[mesh.cells[k]]) for P, mesh in ((X, A), (Y, B))))[0]
        assert (volume > 0) == ((k, k) in pairs), snippet(make.__name__, A, B, X, Y, k, k)
        thin += 0 < volume < 1e-12
    apart = 60 - sum((k, k) in pairs for k in range(60))
    assert thin >= 10 and apart >= 10, (thin, apart)


def test_the_exact_end_is_equal_to_fractions():
    """What is settled in Python, asked about every pair of some families."""
    pairs = 0
    for name in ("random, posed", "whole numbers", "cubes on themselves", "cubes, mirrored", "edges near faces"):
        A, B, X, Y = FAMILIES[name]
        for a in range(0, len(A.cells), 2):
            for b in range(0, len(B.cells), 3):
                want = shared(placed_cell(X, A.vertices[A.cells[a]]), placed_cell(Y, B.vertices[B.cells[b]]))
                assert cell_overlaps.exact_overlap(A, B, X, Y, a, b) == want, snippet(name, A, B, X, Y, a, b)
                pairs += want[0] > 0
    assert pairs >= 20


def test_pieces_of_a_cell_sum_to_its_volume_in_fractions():
    """Two meshes of one body: every cell of either is covered once, exactly."""
    A, B = kuhn_cubes(1), shaken(np.random.default_rng(2), 2)
    X = random_pose(np.random.default_rng(3))
    got = collide.overlapping_cells(A, B, X, X, volumes=True)
    pieces = [cell_overlaps.exact_overlap(A, B, X, X, a, b).volume for a, b in got.pairs.tolist()]
    for column, mesh in ((0, A), (1, B)):
        for cell in range(len(mesh.cells)):
            whole = volume_of(placed_cell(X, mesh.vertices[mesh.cells[cell]]))
            assert sum(pieces[k] for k in np.flatnonzero(got.pairs[:, column] == cell)) == whole, cell
    assert [float(v) for v in pieces] == got.volumes.tolist() and len(pieces) > 90


def test_volumes_of_the_bodies_overlap():
    """The sum over all pairs is the volume of what the two bodies share: of boxes, in closed form."""
    A, B = shaken(np.random.default_rng(0), 4), shaken(np.random.default_rng(1), 5)
    got = collide.overlapping_cells(A, B, EYE, collide.pose((0.5, 0.25, 0.125)), volumes=True)
    assert got.volumes.sum() == pytest.approx(0.5 * 0.75 * 0.875, rel=1e-14) and len(got.pairs) > 2000


def test_swapped_batched_and_in_threads_the_same_bits():
    A, B = shaken(np.random.default_rng(0), 3), shaken(np.random.default_rng(1), 3)
    poses = np.array([EYE, collide.pose((0.3, 0.2, 0.1), rpy=(0.1, 0.2, 0.3)), collide.pose((5, 0, 0))])
    many = collide.overlapping_cells(A, B, EYE, poses, volumes=True, centroids=True, threads=2)
    assert many.starts[1] > 500 and many.starts[2] > many.starts[1] + 100 and many.starts[3] == many.starts[2]
    for k, X in enumerate(poses):
        alone = collide.overlapping_cells(A, B, EYE, X, volumes=True, centroids=True)
        rows = slice(many.starts[k], many.starts[k + 1])
        for part, whole in zip(alone[:1] + alone[2:5], many[:1] + many[2:5]):
            assert np.array_equal(part, whole[rows])
        swapped = collide.overlapping_cells(B, A, X, EYE, volumes=True)
        order = np.lexsort((swapped.pairs[:, 0], swapped.pairs[:, 1]))
        assert np.array_equal(swapped.pairs[order][:, ::-1], alone.pairs)
        assert np.array_equal(swapped.volumes[order], alone.volumes)
    only = collide.overlapping_cells(A, B, EYE, poses)
    assert np.array_equal(only.pairs, many.pairs) and only.volumes is only.centroids is only.volume_errors is None


def test_doubles_settle_meshes_that_touch_everywhere():
    """A mesh on itself: cells share faces, edges and corners with some seventy others, and nothing is left open."""
    mesh = shaken(np.random.default_rng(4), 5)
    got = collide.overlapping_cells(mesh, mesh, EYE, EYE, volumes=True)
    assert np.array_equal(got.pairs, np.repeat(np.arange(len(mesh.cells))[:, None], 2, axis=1))
    assert got.counters[0, 1] > 60 * len(mesh.cells) and got.counters[0, 2:].tolist() == [0, 0]
    assert got.volumes == pytest.approx(mesh.volumes, rel=1e-14)


def test_volumes_left_as_they_are_have_a_bound():
    A, B, X, Y = FAMILIES["slivers"]
    rough = collide.overlapping_cells(A, B, X, Y, volumes=True, settle=False)
    exact = collide.overlapping_cells(A, B, X, Y, volumes=True)
    assert np.array_equal(rough.pairs, exact.pairs) and rough.counters[0, 3] < exact.counters[0, 3]
    assert (np.abs(rough.volumes - exact.volumes) <= rough.volume_errors + exact.volume_errors).all()


def test_overlaps_within_one_mesh():
    rng = np.random.default_rng(7)
    assert len(collide.self_overlapping_cells(shaken(rng, 2))) == 0
    mesh = lattice_cells(rng, 12)
    cells = [placed_cell(EYE, mesh.vertices[cell]) for cell in mesh.cells]
    want = [[i, j] for i in range(12) for j in range(i + 1, 12) if shared(cells[i], cells[j])[0]]
    assert collide.self_overlapping_cells(mesh).tolist() == want and len(want) > 10


def test_large_cells_and_few_pairs_at_a_time(monkeypatch):
    """Space for pairs runs out within a cell, and is made larger."""
    monkeypatch.setattr(walk_cells, "_PAIRS_A_CELL", 1)
    monkeypatch.setattr(walk_cells, "_CELLS_A_CALL", 2)
    B = kuhn_cubes(4)
    A = soup([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0.5, 0.5, 0.5], [1, 0, 0], [0, 1, 0], [0, 0, 1]]] * 2)
    got = collide.overlapping_cells(A, B, EYE, EYE, volumes=True)
    assert got.volumes.sum() == pytest.approx(2 * A.volumes[:2].sum(), rel=1e-14) and len(got.pairs) > 200


def test_progress_is_told(monkeypatch):
    labels = []

    class Stage:
        def __init__(self, label):
            labels.append(label)

        def __enter__(self):
            return labels.append

        def __exit__(self, *error):
            labels.append("end")

    A = kuhn_cubes(2)
    collide.overlapping_cells(A, A, EYE, EYE, progress=Stage)
    assert labels == ["overlaying 48 and 48 cells", "overlaying cells: 48 of 48", "end"]


def test_bad_arguments_are_named():
    A = kuhn_cubes(1)
    box = Mesh(A.vertices, A.boundary.faces)
    wrong = ((A, box), "B must be a TetMesh, got Mesh; surfaces have collide.overlay"), ((3, A), "A must be")
    for bad, words in wrong:
        with pytest.raises(InvalidArgument, match=words):
            collide.overlapping_cells(*bad, EYE, EYE)
    with pytest.raises(InvalidPose, match="X_WB"):
        collide.overlapping_cells(A, A, EYE, 2 * EYE)
    with pytest.raises(InvalidPose, match="X_WA has a matrix without an inverse"):
        collide.overlapping_cells(A, A, np.diag([1.0, 1, 0, 1]), EYE, check_poses=False)
    with pytest.raises(InvalidArgument, match="lengths do not match"):
        collide.overlapping_cells(A, A, np.stack([EYE] * 2), np.stack([EYE] * 3))
    with pytest.raises(InvalidArgument, match=r"mesh must be a TetMesh, got Mesh.*; surfaces have self_collisions"):
        collide.self_overlapping_cells(box)
    with pytest.raises(InvalidArgument, match="threads"):
        collide.overlapping_cells(A, A, EYE, EYE, threads=0)


MUTANTS = {
    "a piece of a prism forgotten": (exact_cells, "_inside", lambda f: lambda *a: f(*a)[:2]),
    "meets said of what is open": (walk_cells, "walk", lambda f: lambda *a: _all_meet(f(*a))),
    "queries in another place": (walk_cells, "_queries", lambda f: lambda *a: (f(*a)[0] + 1.0, f(*a)[1])),
    "low parts forgotten": (walk_cells, "place_corners", lambda f: lambda *a: _without_low(f(*a))),
    "a mirror overlooked": (walk_cells, "_oriented", lambda f: lambda cells, X, local: cells),
}


def _all_meet(walked):
    return walked._replace(status=np.full_like(walked.status, MEET))


def _without_low(corners):
    for part in (corners.A, corners.B):
        part[:, 3:] = 0.0
    return corners._replace(plain=True, exact=True, error=0.0, wide_error=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("mutant", list(MUTANTS))
def test_mutants_are_noticed(mutant, monkeypatch):
    module, name, change = MUTANTS[mutant]
    monkeypatch.setattr(module, name, change(getattr(module, name)))
    with pytest.raises((AssertionError, IndexError, ZeroDivisionError)):
        for family in ("random, posed", "tenths, moved", "cubes, mirrored", "slivers", "cubes by tenths"):
            check_every_pair(family, *FAMILIES[family])


def test_cells_of_all_sizes():
    """From a billionth of a metre to a million kilometres, one within the other."""
    rng = np.random.default_rng(11)
    A = soup(np.concatenate([random_cells(rng, 3, s).vertices.reshape(-1, 4, 3) for s in (1e-9, 1e-3, 1, 1e9)]))
    hits = check_every_pair("sizes", A, A, EYE, EYE)
    assert hits[0] >= 25
