"""Families of mesh pairs: seeded, exact where they promise it, and every answer of collide right."""

from __future__ import annotations

import json

import numpy as np
import pytest

import collide
from collide.adapters.peers import stress
from collide.adapters.peers.protocol import engine
from collide.adapters.peers.stress_truth import truth
from collide.errors import InvalidArgument
from collide.scenes.families import MeshCase, describe, generate, mesh_names, names

CASES = 24


@pytest.fixture(scope="module")
def ours():
    return stress.run(mesh_names(), n=CASES)


def test_nothing_is_wrong(ours):
    assert [(f.kind, f.snippet) for f in ours.findings] == []
    for family in ours.families:
        assert family.answered == CASES and family.unsupported == 0 and family.undecided == 0, family
        assert family.hits >= 3, f"{family.family}: {family.hits} hits"
    assert sum(f.cases - f.hits for f in ours.families) >= 40


def test_families_of_meshes_are_no_families_of_hulls():
    assert not set(names()) & set(mesh_names()) and len(mesh_names()) == 6
    assert all(describe(name).endswith(".") for name in mesh_names())
    with pytest.raises(InvalidArgument, match="mesh_nested"):
        generate("mesh", 1)


@pytest.mark.parametrize("name", mesh_names())
def test_a_case_depends_on_family_seed_and_index_alone(name):
    cases, again, other = generate(name, 5, 3), generate(name, 4, 3), generate(name, 5, 4)
    assert all(isinstance(case, MeshCase) and case.family == name and case.index == k for k, case in enumerate(cases))
    texts = [json.dumps(case.to_dict(), allow_nan=False) for case in cases]
    assert texts[:4] == [json.dumps(case.to_dict()) for case in again]
    assert not set(texts) & {json.dumps(case.to_dict()) for case in other}


@pytest.mark.many(3)
@pytest.mark.parametrize("name", mesh_names())
def test_what_a_family_promises(name):
    cases = generate(name, 30, 1)
    truths = [truth(case) for case in cases]
    if name == "mesh_nested":
        assert sum(t.inside for t in truths) == sum(t.hit for t in truths) >= 5
    elif name == "mesh_identical":
        assert all(t.hit for t in truths)
    elif name == "mesh_gaps":
        gaps = [float(t.distance) for t in truths if t.distance is not None]
        assert len(gaps) >= 5 and max(gaps) < 2e-9
    elif name == "mesh_scales":
        assert {t.inside for t in truths} == {False, True}
    elif name == "mesh_grids":
        assert {0.0 if t.distance is None else round(float(t.distance) * 2**30, 3) for t in truths} >= {0.0, 1.0}
    else:
        areas = [np.cross(*(np.diff(c.a.vertices[f], axis=0))) for c in cases for f in c.a.faces]
        assert sum(not a.any() for a in areas) >= 30 and sum(t.hit for t in truths) >= 5


def test_a_snippet_asks_the_same_question(capsys):
    case = generate("mesh_nested", 3, 2)[-1]
    exec(compile(case.snippet(), "snippet", "exec"), {})  # noqa: S102 - a snippet is there to be run
    assert capsys.readouterr().out.startswith(str(collide.collide(*case.shapes())))


def test_a_wrong_boolean_is_found(monkeypatch):
    honest = collide.collide
    monkeypatch.setattr(collide, "collide", lambda *question, **options: not honest(*question, **options))
    table = stress.run("mesh_grids", n=6)
    assert table.wrong == 6 and {f.kind for f in table.findings} == {"boolean"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fcl", "coal"])
def test_other_engines_see_surfaces(name):
    if engine(name).missing():
        pytest.skip(str(engine(name).missing()))
    (family,) = stress.run("mesh_nested", n=20, engine=name).families
    assert family.wrong == 0 and family.reasons == {stress.SURFACES: family.unsupported} and family.unsupported >= 3
