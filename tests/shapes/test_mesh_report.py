"""What a mesh says of itself: the reason in words, defects with those that spoil a solid first, facets by number."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere

from collide import Mesh
from collide.shapes.mesh_report import Defect, _numbers

BOX, FACES = box()


def joined(*surfaces):
    """Several surfaces as one."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces)])
    return np.concatenate([v for v, _ in surfaces]), np.concatenate([f + n for (_, f), n in zip(surfaces, starts)])


CASES = {
    "closed": ((BOX, FACES), True, {}),
    "open": ((BOX, FACES[1:]), False, {"open edges": {0, 3, 10}}),
    "turned": ((BOX, np.concatenate([FACES[:1, ::-1], FACES[1:]])), False, {"inconsistent orientation": None}),
    "inside out": ((BOX, FACES[:, ::-1]), False, {"inside out": set(range(12))}),
    "doubled": ((BOX, np.concatenate([FACES, FACES[3:4]])), False, {"duplicate facets": {12}}),
    "back to back": (
        (BOX, np.concatenate([FACES, FACES[3:4], FACES[3:4, ::-1]])), True, {"back-to-back facets": None},
    ),
    "no area": ((BOX, np.concatenate([FACES, [[0, 0, 1]]])), True, {"no area": {12}}),
    "two at a vertex": (joined((BOX, FACES), box((1, 1, 1), (2, 2, 2))), True, {"non-manifold vertices": None}),
    "two at an edge": (joined((BOX, FACES), box((1, 1, -1), (2, 2, 1))), True, {"non-manifold edges": None}),
}


@pytest.mark.parametrize("name", CASES)
def test_defects_by_name(name):
    (vertices, faces), solid, expected = CASES[name]
    report = Mesh(vertices, faces).report
    found = {defect.name: set(defect.facets.tolist()) for defect in report.defects}
    assert report.solid is solid == Mesh(vertices, faces).solid
    for defect, facets in expected.items():
        assert defect in found and (facets is None or found[defect] == facets), (report, found)
    if not expected:
        assert not report.defects
    spoils = [defect.spoils for defect in report.defects]
    assert spoils == sorted(spoils, reverse=True), "what spoils a solid comes first"
    assert solid == (not any(spoils))
    if not solid:
        assert report.why == "; ".join(defect.name for defect in report.defects if defect.spoils)
    lines = str(report).splitlines()
    assert lines[0] == f"{'solid' if solid else 'surface'}: {report.why}"
    assert len(lines) == 3 + len(report.defects) and all(line.startswith("- ") for line in lines[3:])


@pytest.mark.parametrize("given", [box(), block_ring(), bumpy_sphere(80), joined(box(), box((2, 2, 2), (3, 3, 3)))])
def test_numbers_are_counted(given):
    vertices, faces = given
    report = Mesh(np.concatenate([vertices, vertices[:2], [[7.0, 7.0, 7.0]]]), faces).report
    edges = {tuple(sorted((f[k], f[k - 1]))) for f in np.asarray(faces).tolist() for k in range(3)}
    assert (report.vertices, report.facets) == (len(vertices) + 3, len(faces))
    assert (report.used, report.welded, report.edges) == (len(np.unique(faces)), 2, len(edges))
    assert report.euler == report.used - report.edges + report.facets
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert report.volume == pytest.approx((a * np.cross(b, c)).sum() / 6)


def test_asked_for_as_a_surface():
    report = Mesh(BOX, FACES, solid=False).report
    assert not report.solid and report.why == "asked for; it could be a solid" and not report.defects
    nothing = Mesh(BOX, [[0, 0, 1], [1, 1, 1]], solid=False).report
    assert nothing.why == "no facet has three distinct corners"


def test_many_facets_are_listed_in_part():
    assert _numbers(np.array([4])) == "facet 4" and _numbers(np.arange(6)) == "facets 0, 1, 2, 3, 4, 5"
    assert _numbers(np.arange(9)) == "facets 0, 1, 2, 3, 4, 5, … (9 in all)"
    defect = Defect("open edges", np.array([2, 5]), True, "an edge alone")
    assert str(defect) == "open edges (an edge alone): facets 2, 5"
