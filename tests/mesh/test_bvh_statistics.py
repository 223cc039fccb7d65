"""Figures of trees over meshes, and how the walk's counts grow on the worst cases: the bounds that are proven,
counted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import box, bumpy_sphere

import collide
from collide.cli.main import main
from collide.narrowphase.facets.facet_queries import all_hits
from collide.papers.hierarchies.tree_figures import tree_figures
from collide.scenes.worst_cases import accordion, below, chazelle, harpsicordia


@pytest.mark.parametrize("name", ["box", "sphere", "soup", "one facet"])
def test_figures_keep_their_bounds(name):
    rng = np.random.default_rng(3)
    vertices, faces = {
        "box": box, "sphere": lambda: bumpy_sphere(2000), "soup": lambda: soup(rng, 400),
        "one facet": lambda: (np.eye(3), np.array([[0, 1, 2]])),
    }[name]()
    mesh = collide.Mesh(vertices, faces, solid=False)
    figures = tree_figures(mesh)
    assert figures.facets == len(faces) and figures.depth == mesh.tree.depth and figures.nodes == len(mesh.tree.nodes)
    assert len(faces) / 7 <= figures.leaves <= len(faces)
    assert figures.graded_size <= figures.node_bound == max(2 * len(faces) - 1, 2)
    assert 0 <= figures.graded_level <= figures.level_bound and figures.graded_depth <= figures.graded_level + 1
    assert 0 <= figures.outliers <= len(faces) and figures.max_outliers <= figures.outliers
    assert figures.outlier_share == figures.outliers / len(faces)


def counts(A, B) -> tuple[int, int]:
    """(nodes compared with a box, pairs of facets found) for bodies as they stand."""
    found = all_hits(A.tree, B.tree, np.eye(4), np.eye(4))
    return int(found.counters[0, 0]), len(found.pairs)


def test_strings_that_all_meet_cost_their_square():
    """Section 4: no hierarchy of convex volumes does with less."""
    for family in (accordion, chazelle):
        looked = []
        for strings in (32, 64, 128):
            boxes, pairs = counts(family(strings), below(family(strings)))
            assert pairs == (2 * strings) ** 2
            looked.append(boxes)
        exponents = np.diff(np.log2(looked))
        assert (exponents > 1.6).all() and (exponents < 2.3).all(), (family.__name__, exponents)


def test_harpsicordia_cost_their_meetings():
    looked = []
    for n in (1000, 2000, 4000, 8000):
        A, B, meetings = harpsicordia(n, 10.0, 300.0)
        boxes, pairs = counts(A, B)
        assert pairs == 4 * meetings
        looked.append(boxes / meetings)
    assert max(looked) < 1.25 * min(looked) and max(looked) < 8.0, looked


def test_the_command_line_tells_them(tmp_path, capsys):
    vertices, faces = bumpy_sphere(300)
    place = tmp_path / "ball.off"
    rows = [" ".join(map(repr, v)) for v in vertices.tolist()] + [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    place.write_text(f"OFF\n{len(vertices)} {len(faces)} 0\n" + "\n".join(rows) + "\n")
    assert main(["locality", str(place)]) == 0
    shown = capsys.readouterr().out
    assert "TREES" in shown and "outliers" in shown
    assert main(["locality", str(place), "--json", str(tmp_path / "found.json")]) == 0
    trees = json.loads((tmp_path / "found.json").read_text())["meshes"][0]["trees"]
    assert trees["facets"] == len(faces) and trees["graded_size"] <= trees["node_bound"] == 2 * len(faces) - 1
