"""The comparison counts what it should: agreements, disagreements, verdicts, skips.

Liars with known lies stand in for engines, so that every count is known beforehand; the real ones
are asked about a small scene.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import collide
from collide import Box, Compound, Cylinder, InvalidArgument, Sphere, pose
from collide.adapters.peers import protocol
from collide.adapters.peers.compare import compare
from collide.adapters.peers.protocol import Question
from collide.scenes import Scene
from collide.scenes.description import SceneBody

LIARS = '''
from collide.adapters.peers.exact_peer import ExactPeer
from collide.adapters.peers.protocol import PairwisePeer, Reply


class Liar(ExactPeer):
    """Says the opposite about every pair whose true distance is below 0.6, and keeps the distance."""
    name = "liar"
    certified = False

    def ask(self, *pair):
        true = super().ask(*pair)
        return true._replace(hit=true.hit != (true.distance < 0.6), certified=self.certified)


class Proud(Liar):
    name, certified = "proud", True


class Off(ExactPeer):
    """Right booleans, distances off by 1 %."""
    name = "off"

    def ask(self, *pair):
        true = super().ask(*pair)
        return true._replace(distance=true.distance * 1.01)


class Skewed(PairwisePeer):
    """What collide says, and a millimetre more; where bodies touch, a depth of 0.9 m."""
    name = "skewed"

    def build(self, part):
        return part

    def ask(self, A, X_WA, B, X_WB):
        import collide
        r = collide.distance(A, B, X_WA, X_WB)
        return Reply(bool(r.hit), -0.9 if abs(r.distance) < 1e-12 else r.distance + 1e-3)


class Yes(PairwisePeer):
    name = "yes"

    def build(self, part):
        return part

    def ask(self, *pair):
        return Reply(True)


class Away(Yes):
    name, package, module, hint = "away", "away", "no_such_module", "it went away"
'''


@pytest.fixture(autouse=True)
def liars(tmp_path, monkeypatch):
    (tmp_path / "liars.py").write_text(LIARS)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("Liar", "Proud", "Off", "Skewed", "Yes", "Away"):
        monkeypatch.setitem(protocol.ENGINES, name.lower(), f"liars:{name}")


def scene() -> Scene:
    """A table with three things on it; the tray stands on the table by one rounding error."""
    table = SceneBody("table", Box((1, 1, 0.1)), pose((0, 0, -0.05)), static=True)
    wall = SceneBody("wall", Box((0.1, 1, 1)), pose((-0.5, 0, 0.4)), static=True)
    tray = SceneBody("tray", Box((0.2, 0.2, 0.05)), pose((0.2, 0, np.nextafter(0.025, 1))))
    ball = SceneBody("ball", Sphere(0.1), pose((0.3, 0.05, 0.1)))
    far = SceneBody("far", Sphere(0.1), pose((0, 0, 5)))
    return Scene("bench", [table, wall, tray, ball, far], allowed=[("ball", "table", "lies on it")])


def test_pairs_are_those_the_scene_tests_and_near_enough():
    question = Question.from_scene(scene())
    names = [question.names(k) for k in range(len(question.pairs))]
    assert names == [("table", "tray"), ("wall", "tray"), ("tray", "ball")] or names == [
        ("table", "tray"), ("tray", "ball")
    ]
    every = Question.from_scene(scene(), every_pair=True)
    # ten pairs, less the static pair and the allowed one
    assert len(every.pairs) == 8
    grouped = scene()
    grouped.bodies[3].mask = 0
    assert len(Question.from_scene(grouped, every_pair=True).pairs) == 5


def test_a_question_of_a_world_keeps_its_filters():
    described = scene()
    asked = Question.from_scene(described.world(), every_pair=True)
    expected = Question.from_scene(described, every_pair=True)
    assert [b.name for b in asked.bodies] == [b.name for b in expected.bodies]
    assert asked.pairs == expected.pairs


def test_lies_are_found_and_charged_to_the_liar():
    comparison = compare(scene(), ("liar", "off", "yes"), reference="exact", every_pair=True)
    liar, off, yes = (comparison.summary(n) for n in ("liar", "off", "yes"))
    # tray-ball overlap; tray-table are one rounding error apart; wall-tray and wall-ball are near
    assert liar.asked == liar.answered == 8
    assert (liar.hit_disagreements, liar.agreeing) == (3, 5) or liar.hit_disagreements == 4
    assert liar.wrong == liar.hit_disagreements - 1 and liar.wrong_within_rounding == 1
    assert liar.contradictions == liar.wrong
    assert off.wrong == off.hit_disagreements == 0
    assert off.wrong_distances == off.distance_disagreements >= 6
    assert yes.without_distance == 8 and yes.agreeing == 1 and yes.hit_disagreements == 7
    assert comparison.ours_wrong == 0


def test_lies_of_the_reference_are_ours():
    comparison = compare(scene(), ("exact",), reference="liar", every_pair=True)
    liar = comparison.summaries[0]
    assert liar.wrong >= 2 and liar.wrong_within_rounding == 1
    assert comparison.ours_wrong == liar.wrong + liar.contradictions
    assert comparison.summary("exact").wrong == 0
    # a claim of proof leaves no excuse within rounding
    proud = compare(scene(), ("exact",), reference="proud", every_pair=True).summaries[0]
    assert proud.wrong == liar.wrong + 1 and proud.wrong_within_rounding == 0


def test_what_exact_arithmetic_cannot_judge_counts_against_nobody():
    pairs = [(Cylinder(0.5, 1), Sphere(0.5), pose(), pose((2, 0, 0)))]
    comparison = compare(pairs, ("coal",) if not protocol.engine("coal").missing() else (), reference="yes")
    assert comparison.ours_wrong == 0
    for dispute in comparison.disagreements:
        assert dispute.kind == "hit" and dispute.wrong == [] and "Cylinder" in dispute.not_judged


def test_the_depth_of_a_union_is_not_compared():
    union = Compound([(Box((1, 1, 1)), pose()), (Box((1, 1, 1)), pose((1, 0, 0)))])
    pairs = [(union, Sphere(0.5), pose(), pose(xyz)) for xyz in ((0.5, 0, 0), (0.5, 0, 3))]
    comparison = compare(pairs, ("off",), reference="exact")
    off = comparison.summary("off")
    assert (off.depth.pairs, off.gap.pairs) == (0, 1)
    assert off.gap.difference == pytest.approx(0.02)


def test_absent_engines_are_skipped_with_the_reason():
    comparison = compare(scene(), ("away", "yes"), reference="exact")
    assert comparison.summary("away").skipped == "away is not installed (it went away)"
    headers, rows = comparison.table()
    assert [len(row) for row in rows] == [len(headers)] * 3
    assert rows[1][:2] == ["away", "skipped: away is not installed (it went away)"]


def test_arguments_are_checked():
    with pytest.raises(InvalidArgument, match="no engine 'bullet'; there are"):
        compare(scene(), ("bullet",), reference="exact")
    with pytest.raises(InvalidArgument, match="engines must be a sequence of names, got 'coal'"):
        compare(scene(), "coal", reference="exact")
    with pytest.raises(InvalidArgument, match="got int"):
        compare(3, ("yes",), reference="exact")


def test_plain_data_and_table():
    comparison = compare(scene(), ("liar", "yes"), reference="exact", max_distance=0.05)
    data = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
    assert data["ours_wrong"] == 0 and [s["engine"] for s in data["summaries"]] == ["exact", "liar", "yes"]
    headers, rows = comparison.table()
    assert all(isinstance(cell, str) for row in rows for cell in row)
    assert rows[0][headers.index("engine")] == "exact"


def test_collide_and_its_peers_agree_on_a_scene():
    comparison = compare(scene(), max_distance=0.1, every_pair=True)
    assert comparison.reference == "collide" and comparison.ours_wrong == 0
    ours = comparison.summaries[0]
    assert ours.answered == ours.asked == 8 and not ours.failed
    for summary in comparison.summaries[1:]:
        if summary.skipped:
            continue
        assert summary.answered == 8 and not summary.failed
        assert summary.wrong == 0, [d for d in comparison.disagreements if d.engine == summary.engine]
        assert summary.gap.difference < 1e-3 and summary.depth.difference < 1e-3


def test_a_world_that_drops_a_pair_is_found_out(monkeypatch):
    real = collide.World.distances

    def forgetful(self, max_distance=0.1):
        result = real(self, max_distance)
        result.rows = result.rows[1:]
        return result

    monkeypatch.setattr(collide.World, "distances", forgetful)
    comparison = compare(scene(), ("exact",), max_distance=0.1)
    assert [d.kind for d in comparison.disagreements if d.engine == "collide"] == ["left out"]
    assert comparison.ours_wrong == 1


def test_distances_that_exact_arithmetic_cannot_judge_are_judged_by_the_proven_bracket():
    can = Cylinder(0.1, 0.2)
    pairs = [(can, Sphere(0.1), pose(), pose((x, 0, 0.01 * k))) for k, x in enumerate((0.21, 0.3, 0.5, 0.19))]
    comparison = compare(pairs, ("skewed",))
    skewed = comparison.summary("skewed")
    assert (skewed.wrong, skewed.wrong_distances, skewed.not_judged) == (0, 4, 0)
    assert skewed.furthest_off.difference == pytest.approx(1e-3, rel=1e-6)
    assert comparison.ours_wrong == 0 and comparison.peers_wrong == 4
    for dispute in comparison.disagreements:
        assert dispute.judged_by == "the proven bracket" and dispute.wrong == ["skewed"]
        assert dispute.lower <= dispute.reference_distance <= dispute.upper
        assert dispute.off == max(dispute.lower - dispute.distance, dispute.distance - dispute.upper)
    assert compare(pairs, ("skewed",), tolerance=0.1).peers_wrong == 0


def test_a_ball_that_rests_on_a_table_of_several_parts_is_judged_exactly():
    """A depth of 0.9 m for a ball at rest was "not judged", for the pose of a part of the table might be rounded."""
    legs = [(Box((0.06, 0.06, 0.68)), pose((x, y, 0.34), rpy=(0, 0, 0.3))) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    table = Compound([(Box((1.4, 0.8, 0.04)), pose((0, 0, 0.7), rpy=(0, 0, 0.1))), *legs])
    scene = Scene("kitchen", [
        SceneBody("table", table, pose((0.3, 0.1, 0), rpy=(0, 0, 0.7)), static=True),
        SceneBody("ball", Sphere(0.08), pose((0.31, 0.12, 0.72 + 0.08 + 4e-16))),
    ])
    comparison = compare(scene, ("skewed", "exact"))
    (wrong,) = [d for d in comparison.disagreements if d.engine == "skewed" and d.kind == "distance"]
    assert not wrong.not_judged and wrong.judged_by == "exact arithmetic" and wrong.touching
    assert abs(wrong.exact_distance) < 1e-15 and wrong.off == pytest.approx(0.9)
    assert comparison.summary("skewed").wrong_distances == 1 and comparison.ours_wrong == 0


def test_parts_of_a_compound_enter_exactly():
    """The product of two poses is not rounded: the gap of a part is that of its corners in fractions."""
    from fractions import Fraction

    rng = np.random.default_rng(4)
    differing = 0
    for _ in range(20):
        X_CS, X_WC = (pose(rng.normal(size=3), rpy=rng.normal(size=3)) for _ in range(2))
        body = Compound([(Compound([(Sphere(0.25), X_CS)]), pose((0, 0, 0)))])
        other = pose(rng.normal(size=3) * 50)
        question = Question.from_pairs([(body, Sphere(0.25), X_WC, other)])
        told = protocol.engine("exact").answer(question).rows[0]["distance"]
        centre = [
            sum((Fraction(X_WC[i, k]) * Fraction(X_CS[k, 3]) for k in range(3)), Fraction(X_WC[i, 3])) for i in range(3)
        ]
        squared = sum((c - Fraction(other[i, 3])) ** 2 for i, c in enumerate(centre))
        # the square root is right to the last digit where its neighbours' squares lie on either side
        gap, half = Fraction(told) + Fraction(1, 2), Fraction(np.spacing(told))
        assert (gap - half) ** 2 <= squared <= (gap + half) ** 2
        differing += centre != [Fraction(c) for c in (X_WC @ X_CS)[:3, 3]]
    assert differing > 10, "poses that multiply out exactly show nothing"


@pytest.mark.parametrize(
    "options, status",
    [
        ([], 0),
        (["--fail-on", "peer-wrong"], 1),
        (["--fail-on", "ours-wrong"], 0),
        (["--fail-on", "peer-wrong", "--tolerance", "0.1"], 0),
    ],
)
def test_the_command_can_fail_on_a_wrong_peer(monkeypatch, capsys, options, status):
    from collide.cli import main as cli

    can = SceneBody("can", Cylinder(0.1, 0.2), pose())
    asked = Scene("two", [can, SceneBody("ball", Sphere(0.1), pose((0.3, 0, 0)))])
    monkeypatch.setattr(collide.scenes, "load", lambda *paths, **options: asked)
    assert cli.main(["compare", "two.yaml", "--engines", "skewed", *options]) == status
    assert ("1 wrong distance (1000 µm off at worst)" in " ".join(capsys.readouterr().out.split())) == (
        "--tolerance" not in options
    )
