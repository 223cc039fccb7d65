"""Volumes of overlaps in a report: its JSON, its tables, and what is left out."""

from __future__ import annotations

import json
from importlib import resources

import numpy as np
import pytest

import collide
from collide.reports import overlap_volumes, report, report_tables
from collide.scenes import Scene, SceneBody


def overlaps_and_tables():
    shapes = [
        ("table", collide.Box((2, 2, 1)), (0, 0, 0)), ("crate", collide.Box((1, 1, 1)), (0, 0, 0.75)),
        ("ball", collide.Sphere(0.2), (0.5, 0.5, 0.5)), ("part", collide.Box((0.1, 0.1, 0.1)), (0, 0, 0.5)),
        ("far", collide.Box((1, 1, 1)), (9, 0, 0)),
    ]
    bodies = [SceneBody(name, shape, collide.pose(place)) for name, shape, place in shapes]
    made = report.make(Scene("boxes", bodies))
    return made, {name: report_tables.tables(made, name == "all", False) for name in ("page", "all")}


def test_volumes_are_told():
    made, tables = overlaps_and_tables()
    data = json.loads(json.dumps(made.to_dict(), allow_nan=False))
    found = {frozenset((entry["a"], entry["b"])): entry for entry in data["overlaps"]}
    assert set(found) == {frozenset(pair) for pair in (("table", "crate"), ("table", "part"), ("crate", "part"))}
    for pair, volume, centroid in (
        (("table", "crate"), 0.25, (0, 0, 0.375)), (("table", "part"), 5e-4, (0, 0, 0.475)),
        (("crate", "part"), 1e-3, (0, 0, 0.5)),
    ):
        entry = found[frozenset(pair)]
        assert entry["lower"] <= entry["volume"] <= entry["upper"]
        assert entry["volume"] == pytest.approx(volume, rel=1e-12)
        assert np.allclose(entry["centroid"], centroid, atol=1e-12)
    (line,) = (row for table in tables["page"] for row in table.rows if row[0] == "overlaps")
    assert line[1].startswith("3 pairs of solids with a volume in common: 0.25 m³ of ") and "500 cm³" in line[1]
    (table,) = (table for table in tables["all"] if table.title.startswith("OVERLAPS"))
    assert len(table.rows) == 3


def test_json_is_as_its_schema_says():
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(resources.files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8"))
    made, _ = overlaps_and_tables()
    jsonschema.validate(made.to_dict(), schema)
    made.overlaps[0].pop("lower")
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(made.to_dict(), schema)


def test_no_more_pairs_are_looked_at_than_it_says(monkeypatch):
    box = collide.Box((1, 1, 1))
    mesh = collide.Mesh(*collide.tessellate(box, tolerance=1e-3)[:2])

    def overlaps(*shapes):
        bodies = [SceneBody(f"body {k}", shape, collide.pose((0.1 * k, 0, 0))) for k, shape in enumerate(shapes)]
        return report.make(Scene("heap", bodies)).overlaps

    balls = [collide.Sphere(0.5)] * 10
    assert len(overlaps(*balls, box, box, box)) == 3
    monkeypatch.setattr(overlap_volumes, "MAX_PAIRS", 3)
    assert len(overlaps(box, box, box, box)) == 3
    assert len(overlaps(*balls, box, box, box)) == 3, "pairs without a volume take no one's place"
    monkeypatch.setattr(overlap_volumes, "MAX_FACETS", 2 * len(mesh.faces))
    assert len(overlaps(mesh, box, box)) == 3 and len(overlaps(mesh, mesh, box)) == 1
