"""Meshes asked of every engine: the exact judge against a plainer one, what each peer is asked, insides as a class of
their own."""

from __future__ import annotations

from math import sqrt

import mesh_corruptions
import naive_triangles
import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere

from collide import Box, Capsule, Cylinder, Halfspace, Mesh, Sphere, pose
from collide.adapters.peers import exact, exact_meshes
from collide.adapters.peers.answers import NO_DEPTH
from collide.adapters.peers.compare import compare
from collide.adapters.peers.protocol import Question, engine
from collide.adapters.peers.question import Body as Posed
from collide.adapters.peers.question import bounds, is_compound_or_mesh
from collide.reports import comparing
from collide.scenes.description import Scene, SceneBody

RING = Mesh(*block_ring())


def present(name: str) -> str:
    if engine(name).missing():
        pytest.skip(str(engine(name).missing()))
    return name


# --- the judge, judged --------------------------------------------------------------------------------


def soup(rng, n: int) -> tuple[np.ndarray, np.ndarray]:
    """n facets on a coarse grid: coplanar, doubled, touching and collapsed ones are common."""
    return rng.integers(-2, 3, size=(n + 3, 3)) * rng.choice([1.0, 0.25, 1e-7]), rng.integers(0, n + 3, size=(n, 3))


def grid_pose(rng) -> np.ndarray:
    if rng.random() < 0.5:
        return pose(rng.integers(-2, 3, 3) * 0.5)
    return pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))


def test_facet_pairs_and_gaps_against_the_plain_reference():
    rng = np.random.default_rng(0)
    counts = {"meet": 0, "apart": 0}
    for k in range(40):
        (v, f), (w, g), X, Y = soup(rng, 6), soup(rng, 5), grid_pose(rng), grid_pose(rng)
        A, B = exact_meshes.mesh_cells(v, f, False, X), exact_meshes.mesh_cells(w, g, False, Y)
        pairs = naive_triangles.facet_pairs(v, f, X, w, g, Y)
        assert exact_meshes.facet_pairs(A, B) == pairs, (
            f"case {k}: {v.tolist()}, {f.tolist()}, {w.tolist()}, {g.tolist()}"
        )
        verdict = exact_meshes.judge(A, B)
        assert verdict.hit == verdict.surfaces == bool(pairs)
        counts["meet" if pairs else "apart"] += 1
        if not pairs:
            squared, _ = naive_triangles.surface_distance(v, f, X, w, g, Y)
            assert verdict.distance == pytest.approx(sqrt(squared), rel=1e-15), f"case {k}"
    assert min(counts.values()) >= 8, counts


def test_windings_against_the_plain_reference():
    rng = np.random.default_rng(1)
    found = []
    for vertices, faces in (block_ring(), box(), bumpy_sphere(60)):
        body = exact_meshes.mesh_cells(vertices, faces, True, np.eye(4))
        corners = naive_triangles.world_points(vertices, np.eye(4))
        for _ in range(25):
            # on the grid: rays graze edges and pass through vertices, and points lie on facets
            p = rng.integers(-6, 7, 3) / np.array([4, 4, 8])
            points, (point,) = naive_triangles.as_integers(corners, naive_triangles.world_points([p], np.eye(4)))
            wanted = naive_triangles.winding([[points[i] for i in face] for face in faces.tolist()], point)
            ((mine,), e) = exact.world_points([p.tolist()], np.eye(3).tolist(), [0.0] * 3)
            assert exact_meshes.winding(body, mine, e) == wanted, f"{p.tolist()}"
            found.append(wanted)
    assert {None, 0, 1} <= set(found) and found.count(1) >= 8 and found.count(None) >= 4


def test_convex_bodies_as_one_cell():
    """A box as a cell is the box as twelve facets that are a solid; a ball as a point and a radius is its distance."""
    rng = np.random.default_rng(2)
    hits = 0
    for k in range(30):
        X = pose(rng.normal(size=3) * 1.5, rpy=rng.uniform(-3, 3, 3))
        ring = exact_meshes.mesh_cells(RING.vertices, RING.faces, True, np.eye(4))
        vertices, faces = box(-0.3 * np.ones(3), 0.3 * np.ones(3))
        one = exact_meshes.judge(ring, exact_meshes.convex_cells(vertices, 0.0, X))
        other = exact_meshes.judge(ring, exact_meshes.mesh_cells(vertices, faces, True, X))
        assert one.hit == other.hit and one.distance == other.distance, f"case {k}"
        ball = exact_meshes.judge(ring, exact_meshes.convex_cells(np.zeros((1, 3)), 0.25, X))
        point = exact_meshes.judge(ring, exact_meshes.convex_cells(np.zeros((1, 3)), 0.0, X))
        if not ball.hit:
            assert ball.distance == pytest.approx(point.distance - 0.25, rel=1e-12)
        hits += one.hit
    assert 5 <= hits <= 25, hits


# --- what the engines say ---------------------------------------------------------------------------------

#: name -> A, B, X_WB, hit, gap; A stands at the origin
CASES = {
    "box in the hole": (RING, Box((0.5, 0.5, 0.5)), pose(), False, 0.25),
    "box in the wall": (RING, Box((0.5, 0.5, 2.0)), pose((1.0, 0.2, 0.0)), True, None),
    "ball in the hole": (RING, Sphere(0.3), pose((0.1, 0, 0)), False, 0.1),
    "capsule over it": (RING, Capsule(0.1, 1.0), pose((1, 0, 1.2)), False, 0.1),
    "ring over ring": (RING, RING, pose((0, 0, 1.25)), False, 0.25),
    "ring through ring": (RING, RING, pose((0.3, 0.1, 0.2), rpy=(0.4, 0.5, 0.6)), True, None),
    "cylinder in the hole": (RING, Cylinder(0.25, 0.5), pose(), False, 0.25),
}
INSIDE = {
    "box inside": (RING, Box((0.1, 0.2, 0.3)), pose((1, 0, 0))),
    "ring inside": (RING, RING.scaled(0.125), pose((1, 1, 0))),
    "ball inside": (RING, Sphere(0.2), pose((-1, -1, 0))),
}


def ask(name: str, cases):
    return engine(present(name)).answer(Question.from_pairs([(A, B, np.eye(4), X) for A, B, X, *_ in cases]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["collide", "exact", "fcl", "coal", "pybullet"])
def test_closed_forms(name):
    table = ask(name, CASES.values())
    for row, why, (case, (_, B, _, hit, gap)) in zip(table.rows, table.reasons, CASES.items()):
        if not row["answered"]:
            lacking = {"exact": Cylinder, "collide": Cylinder, "pybullet": Mesh}
            assert isinstance(B, lacking.get(name, ())) and why, f"{name}: {case}: {why}"
            continue
        assert row["hit"] == hit, f"{name}: {case}"
        if gap is not None:
            assert row["distance"] == pytest.approx(gap, abs=1e-6), f"{name}: {case}"
        elif name != "collide":
            assert not row["has_distance"] and why in (NO_DEPTH, ""), f"{name}: {case}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["collide", "exact", "fcl", "coal", "pybullet"])
def test_only_solids_have_an_inside(name):
    table = ask(name, INSIDE.values())
    for row, (case, (_, B, _)) in zip(table.rows, INSIDE.items()):
        if name == "pybullet" and isinstance(B, Mesh):
            assert row["unsupported"]
        else:
            assert row["hit"] == (name in ("collide", "exact")), f"{name}: {case}"


def test_insides_are_a_class_of_their_own():
    bodies = [SceneBody("ring", RING, np.eye(4)), SceneBody("pip", Box((0.1, 0.2, 0.3)), pose((1, 0, 0)))]
    bodies += [
        SceneBody("bar", Box((0.5, 0.5, 2.0)), pose((-1, 0.2, 0.0))),
        SceneBody("ball", Sphere(0.3), pose((0.1, 0, 0))),
    ]
    comparison = compare(Scene("s", bodies), engines=[present("fcl"), present("coal")], max_distance=1.0)
    assert comparison.ours_wrong == 0
    for name in ("fcl", "coal"):
        summary = comparison.summary(name)
        assert (
            summary.inside == 1
            and summary.hit_disagreements == 0
            and summary.wrong == 0
            and summary.agreeing == summary.asked - 1 == 4
        )
    kinds = {(d.engine, d.kind, d.a, d.b) for d in comparison.disagreements}
    assert kinds == {("fcl", "inside", "ring", "pip"), ("coal", "inside", "ring", "pip")}
    assert all(d.exact_hit and d.exact_distance is None and not d.wrong for d in comparison.disagreements)
    data = comparison.to_dict()
    assert "2 answers about insides of solids, which others do not see" in comparing.verdict(data)
    assert "no disagreement" in comparing.verdict(data)
    text = "\n".join("".join(t for t, _ in line) for line in comparing.render(comparison, width=140))
    assert "INSIDE  one body lies inside the other" in text


LIARS = '''
from collide.adapters.peers.collide_peer import CollidePeer
from collide.adapters.peers.answers import Event


class Hollow(CollidePeer):
    """collide, blind for insides and for holes: its booleans are those of surfaces, turned round where asked."""
    name = "hollow"
    turned = False

    def stream(self, question, wanted):
        for event in super().stream(question, wanted):
            if event.reply is not None:
                event = event._replace(reply=event.reply._replace(hit=self.turned, certified=False))
            yield event


class Full(Hollow):
    name, turned = "full", True
'''


def test_a_reference_blind_for_insides_is_wrong(tmp_path, monkeypatch):
    """Turned round, the class must not excuse the reference."""
    from collide.adapters.peers import protocol

    (tmp_path / "mesh_liars.py").write_text(LIARS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(protocol.ENGINES, "hollow", "mesh_liars:Hollow")
    monkeypatch.setitem(protocol.ENGINES, "full", "mesh_liars:Full")
    pairs = [(RING, Box((0.1, 0.2, 0.3)), np.eye(4), pose((1, 0, 0)))]
    blind = compare(pairs, engines=["collide"], reference="hollow")
    assert blind.ours_wrong >= 1 and blind.summary("collide").wrong == 0 and blind.summary("collide").inside == 0
    free = [(RING, Box((0.5, 0.5, 0.5)), np.eye(4), np.eye(4))]
    assert compare(free, engines=["collide"], reference="full").ours_wrong >= 1
    assert (
        compare(free, engines=["full"]).ours_wrong == 0 and compare(free, engines=["full"]).summary("full").wrong == 1
    )


def test_random_pairs_agree_or_are_judged():
    """Rings, bumpy spheres and boxes at random: peers that answer agree, but for insides and rounding."""
    rng = np.random.default_rng(4)
    ball = Mesh(*bumpy_sphere(80))
    shapes = [RING, ball, Box((0.8, 0.5, 0.3)), Sphere(0.4), RING.scaled(0.3)]
    pairs = []
    for k in range(60):
        X, Y = (pose(rng.normal(size=3) * 0.7, rpy=rng.uniform(-3, 3, 3)) for _ in range(2))
        pairs.append((shapes[k % 2], shapes[rng.integers(5)], X, Y))
    comparison = compare(pairs, engines=[present("fcl"), present("coal"), present("pybullet"), "exact"])
    assert comparison.ours_wrong == 0, comparison.disagreements
    hits = comparison.summaries[0].hits
    assert 15 <= hits <= 50, hits
    judged = comparison.summary("exact")
    assert judged.answered == 60 and judged.agreeing == 60 and judged.distance_disagreements == 0
    for name in ("fcl", "coal"):
        summary = comparison.summary(name)
        assert summary.answered == 60 and summary.agreeing + summary.inside + summary.hit_disagreements == 60
    assert comparison.summary("pybullet").unsupported, "pybullet has no pairs of concave meshes"


def test_questions_about_meshes():
    low, high = bounds(Posed("ring", RING, pose((1, 2, 3))))
    assert low.tolist() == [-0.5, 0.5, 2.5] and high.tolist() == [2.5, 3.5, 3.5] and is_compound_or_mesh(RING)
    table = ask("exact", [(RING, Halfspace((0, 0, 1), 0), np.eye(4))])
    assert table.rows["unsupported"][0] and "no exact form" in table.reasons[0]


def test_corruptions_are_seeded():
    vertices, faces = box()
    for kind in mesh_corruptions.KINDS:
        one, other = (mesh_corruptions.spoil(np.random.default_rng(5), vertices, faces, kind) for _ in range(2))
        assert np.array_equal(one.vertices, other.vertices, equal_nan=True) and np.array_equal(one.faces, other.faces)
