"""Meshes of tetrahedra: what is refused, turned, and told of them."""

from __future__ import annotations

import copy
import logging
import pickle
import sys

import numpy as np
import pytest
from cell_families import kuhn_cubes, quiet, random_cells, shaken
from tetrahedra_oracle import placed_cell, volume_of

import collide
from collide import InvalidShape, MissingExtra, SceneError, TetMesh

CORNERS = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
CELL = [[0, 1, 2, 3]]
ABOVE = np.nextafter(1.0, 2.0)


@pytest.mark.parametrize(
    ("vertices", "cells", "words"),
    [
        ([[0, 0, np.nan], *CORNERS], CELL, r"vertices\[0, 2\] is nan"),
        ([[0, 0, 1e51], *CORNERS], CELL, r"must be finite and within"),
        (np.zeros((4, 2)), CELL, r"vertices must have shape \(N, 3\), got \(4, 2\)"),
        (CORNERS, [[0, 1, 2]], r"cells must have shape \(m, 4\), four corners a cell, got \(1, 3\)"),
        (CORNERS, np.zeros((0, 4), int), "cells is empty"),
        (CORNERS, [[0, 1, 2, 3.5]], "cells must be integers, got float64"),
        (CORNERS, [[0, 1, 2, 3], [0, 1, 2, 5]], r"cells\[1\] is \[0, 1, 2, 5\], but there are vertices 0 … 4"),
        (CORNERS, [[0, 1, 2, -1]], r"cells\[0\] is"),
        (CORNERS, [[0, 1, 2, 3], [0, 1, 2, 2]], r"cells\[1\] is \[0, 1, 2, 2\] and .*: it has a corner twice"),
        ([*CORNERS, [1, 0, 0]], [[0, 1, 5, 3]], "two of its corners are in one place"),
        ([*CORNERS, [0.5, 0.25, 0]], [[0, 1, 2, 5]], r"its corners lie in one plane \(1 such cell\); leave them out"),
        (CORNERS, [[0, 1, 2, 3], [1, 2, 3, 4], [3, 2, 1, 0]], r"cells\[2\] has the corners of cells\[0\]"),
    ],
)
def test_what_is_no_mesh(vertices, cells, words):
    with pytest.raises(InvalidShape, match=words):
        TetMesh(vertices, cells)


def test_flat_is_decided_exactly():
    """A plane through doubles that do not lie in it but for their last digit, and one that they do lie in."""
    a, b, c = np.array([0.1, 0.2, 0.3]), np.array([1.1, 0.7, -0.4]), np.array([-0.3, 0.9, 0.2])
    flat = np.array([[0, 0, 0], [1, 1, 0], [2, 2, ABOVE], [3, 3, 7.0]])
    with pytest.raises(InvalidShape, match="one plane"):
        TetMesh(flat, CELL)
    flat[3, 0] = np.nextafter(3.0, 4.0)
    assert quiet(flat, CELL).exact_volume() == volume_of(placed_cell(np.eye(4), flat)) > 0
    near = np.array([a, b, c, a + b - c])
    volume = volume_of(placed_cell(np.eye(4), near))
    assert 0 < volume < 1e-16 and quiet(near, CELL).exact_volume() == volume


def test_cells_that_run_the_other_way_round_are_turned(caplog):
    with caplog.at_level(logging.WARNING, logger="collide"):
        mesh = TetMesh(CORNERS, [[0, 1, 2, 3], [4, 2, 1, 3], [1, 2, 4, 3]][:2])
        other = TetMesh(CORNERS, [[0, 2, 1, 3]])
    assert mesh.turned.tolist() == [k for k in mesh.turned.tolist()] and other.turned.tolist() == [0]
    assert other.cells.tolist() == [[0, 2, 3, 1]] and (mesh.volumes > 0).all() and (other.volumes > 0).all()
    assert "TetMesh: 1 of 1 cells ran the other way round and were turned" in caplog.text


def test_volumes_and_unused_vertices():
    mesh = shaken(np.random.default_rng(0), 3)
    assert mesh.volume == 1.0 == float(mesh.exact_volume()) and mesh.volumes.sum() == pytest.approx(1.0, rel=1e-14)
    exact = [volume_of(placed_cell(np.eye(4), mesh.vertices[cell])) for cell in mesh.cells]
    assert [mesh.exact_volume(k) for k in range(len(exact))] == exact and sum(exact) == mesh.exact_volume() == 1
    assert TetMesh(CORNERS, CELL).unused.tolist() == [4] and len(mesh.unused) == 0


def test_the_boundary_is_a_solid():
    mesh = shaken(np.random.default_rng(1), 3)
    assert mesh.boundary.solid and len(mesh.boundary.faces) == 6 * 9 * 2 and mesh.boundary is mesh.boundary
    assert mesh.boundary.report.volume == pytest.approx(1.0, rel=1e-12)
    assert not collide.self_collisions(mesh.boundary).hit
    points = [[0.5, 0.5, 0.5], [1.0, 1, 1], [1, 1, ABOVE]]
    assert collide.contains(mesh.boundary, np.eye(4), points).tolist() == [True, True, False]
    single = TetMesh(CORNERS, CELL)
    assert single.boundary.report.volume == pytest.approx(1 / 6)
    three = quiet([*CORNERS[:4], [0.1, 0.2, 2], [0, 0, -1]], [[0, 1, 2, k] for k in (3, 4, 5)])
    with pytest.raises(InvalidShape, match=r"face of vertices \[0, 1, 2\] belongs to 3 cells, cells\[0\] among them"):
        three.boundary  # noqa: B018
    assert collide.self_overlapping_cells(three).tolist() == [[0, 1]]


def test_value_and_copies():
    mesh, same = kuhn_cubes(2), kuhn_cubes(2)
    assert mesh == same and hash(mesh) == hash(same) and mesh != kuhn_cubes(1) and mesh != 3
    assert pickle.loads(pickle.dumps(mesh)) == mesh and copy.deepcopy(mesh) == mesh
    assert repr(mesh) == "TetMesh(27 vertices, 48 cells)"
    for change in (lambda: setattr(mesh, "cells", 1), lambda: delattr(mesh, "cells")):
        with pytest.raises(AttributeError, match="TetMesh is immutable"):
            change()
    for array in (mesh.vertices, mesh.cells, mesh.turned):
        with pytest.raises(ValueError):
            array[:] = 0


def test_files(tmp_path):
    meshio = pytest.importorskip("meshio", reason="reads files of tetrahedra")
    mesh = shaken(np.random.default_rng(2), 2)
    faces = [("triangle", mesh.boundary.faces)]
    for name in ("body.vtk", "body.msh", "body.mesh", "body.vtu"):
        meshio.Mesh(mesh.vertices, [*faces, ("tetra", mesh.cells)]).write(tmp_path / name)
        assert TetMesh.from_file(tmp_path / name) == mesh, name
    meshio.Mesh(mesh.vertices, faces).write(tmp_path / "surface.vtk")
    points = random_cells(np.random.default_rng(0), 3).vertices[:10]
    meshio.Mesh(points, [("tetra10", np.arange(10)[None])]).write(tmp_path / "q.vtk")
    (tmp_path / "broken.vtk").write_text("# nothing of the kind")
    (tmp_path / "body.unknown").write_text("")
    for name, words in (
        ("surface.vtk", "it has no tetrahedra; its cells are: triangle"), ("q.vtk", "kind tetra10; make them linear"),
        ("broken.vtk", "meshio cannot read it"), ("body.unknown", "meshio cannot read it"),
        ("none.vtk", "no such file"),
    ):
        with pytest.raises(SceneError, match=words):
            TetMesh.from_file(tmp_path / name)


def test_without_meshio(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(MissingExtra, match=r"meshio is needed to read files of tetrahedra: .*\[tets\]"):
        TetMesh.from_file(tmp_path / "body.vtk")
