"""Proposals of disabled pairs in words: shares, gaps, what "Never" rests on, and the pairs of one side as JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest
from plain_robots import chain, joint, robot_of

from collide import InvalidArgument, Sphere
from collide.sweeps import pair_proposal, pair_tables
from collide.sweeps.pair_comparison import PairComparison, PairDifference, compare_pairs
from collide.sweeps.pair_proposal import ADJACENT, ALWAYS, DEFAULT, NEVER, LinkPair, Proposal, propose_disabled_pairs
from collide.sweeps.pair_search import Nearest
from collide.sweeps.random_configurations import sampled_limits, unlimited_lengths
from collide.sweeps.srdf_text import never_words, srdf_text

Q = np.array([0.5, -1.25])


def proposal_of(*pairs: LinkPair, always_share: float = 1.0) -> Proposal:
    return Proposal(chain(3, length=0.3, width=0.1), 1000, 7, 3, always_share, list(pairs))


def never(a="a", b="b", samples=1000, **values) -> LinkPair:
    return LinkPair(a, b, NEVER, samples, **values)


# --- what "Never" rests on ------------------------------------------------------------------------


def test_never_is_said_to_be_no_proof_of_pairs_that_move():
    assert list(never_words(proposal_of(never(fixed=True), LinkPair("a", "c", ADJACENT)))) == []
    sample, *_ = never_words(proposal_of(never(), LinkPair("a", "c", None, 10, 5), never(samples=1, fixed=True)))
    worst = never().share_bounds[1]
    assert f"up to 1 of {int(1 / worst):,} configurations" in sample and 300 < 1 / worst < 500
    (alone,) = never_words(proposal_of(never()))
    assert alone == sample


def test_the_least_gap_of_the_search_is_named():
    far, near = (never(b=name, nearest=Nearest(gap, Q)) for name, gap in (("c", 0.25), ("d", 0.0125)))
    words = list(never_words(proposal_of(never(), far, near)))
    assert len(words) == 2 and words[1].endswith("the least gap met is 12.5 mm, of a and d.")


@pytest.mark.parametrize(("share", "words"), [
    (1.0, "Always: in collision in every configuration of the sample"),
    (0.95, "Always: in collision in at least 95 % of the sample"),
])
def test_comments_of_an_srdf_say_why(share, words):
    text = srdf_text(proposal_of(LinkPair("a", "b", ALWAYS, 9, 9), LinkPair("c", "d", ADJACENT), always_share=share))
    comments = [line.strip() for line in text.splitlines() if line.startswith("  <!--")]
    assert comments == [
        "<!-- Adjacent: joined by a joint, or through links without collision geometry -->", f"<!-- {words} -->",
    ]


# --- tables ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("pair", "words"), [
    (LinkPair("a", "b"), ""), (LinkPair("a", "b", samples=1, hits=1, fixed=True), "all"),
    (LinkPair("a", "b", samples=1, fixed=True), "none"), (never(), "0 % (≤ 0.27 %)"),
    (LinkPair("a", "b", samples=8, hits=1), "12.5 %"), (LinkPair("a", "b", samples=8, hits=8), "100 %"),
])
def test_shares_of_the_sample(pair, words):
    assert pair_tables._share(pair) == words


def test_every_pair_has_a_row_where_all_are_asked_for():
    pairs = [never(nearest=Nearest(0.0125, Q)), LinkPair("a", "c", None, 8, 1, q=Q),
             LinkPair("a", "d", None, 8, 0, q=Q, searched=True, nearest=Nearest(0.0, Q)),
             LinkPair("b", "c", DEFAULT, 8, 8), LinkPair("b", "d", ALWAYS, 8, 7)]
    proposal = proposal_of(*pairs)
    assert pair_tables.summary(proposal) == (
        "plain: 3 of 5 pairs of links need no test, 2 do; 1,000 configurations, seed 7"
    )
    by_title = {table.title.split()[0]: table for table in pair_tables.proposal_tables(proposal, everything=True)}
    assert list(by_title) == ["PAIRS", "HIDDEN", "RARE"]
    assert [row[1:] for row in by_title["HIDDEN"].rows] == [["d", "87.5 %"]]
    assert by_title["RARE"].rows == [["a", "d"]] and by_title["RARE"].notes == ["a and d: --state=0.5,-1.25"]
    *_, every = pair_tables.proposal_tables(proposal, everything=True)
    assert [row[2:] for row in every.rows] == [
        ["Never", "0 % (≤ 0.27 %)", "12.500 mm"], ["tested", "12.5 %", ""],
        ["tested", pair_tables._share(pairs[2]), ""], ["Default", "100 %", ""], ["Always", "87.5 %", ""],
    ]
    assert len(pair_tables.proposal_tables(proposal)) == 3
    assert len(pair_tables.proposal_tables(proposal_of(*pairs[:2]))) == 1


def difference(a="a", **values) -> PairDifference:
    return PairDifference(**{"a": a, "b": "b", "reason": NEVER, "share": 0.125, "wrong": False, "q": None,
                             "depth": None, "gap": None, **values})


def test_pairs_of_one_side_in_tables_and_in_a_line():
    wrong = difference(wrong=True, q=Q, depth=0.002)
    comparison = PairComparison([("a", "c", NEVER, NEVER)], [wrong, difference("c")],
                                [difference("d", gap=0.05), difference("e", reason=ADJACENT)], [])
    theirs, ours = pair_tables.comparison_tables(comparison, "x.srdf")
    assert [row[2:] for row in theirs.rows] == [
        ["Never", "12.5 %", "2.000 mm", "wrong"], ["Never", "12.5 %", "", "meant"],
    ]
    assert theirs.title == "ONLY IN x.srdf" and theirs.notes[1:] == ["a and b: --state=0.5,-1.25"]
    assert [row[2:] for row in ours.rows] == [["Never", "12.5 %", "50.000 mm"], ["Adjacent", "12.5 %", ""]]
    words = "x.srdf: 1 pairs in both, 2 only there (1 wrong), 2 only here"
    assert pair_tables.comparison_words(comparison, "x.srdf") == words
    comparison.not_comparable.append(("a", "z"))
    assert pair_tables.comparison_words(comparison, "x.srdf") == (
        f"{words}; 1 pair with a link without collision geometry"
    )
    assert pair_tables.comparison_tables(PairComparison(), "x.srdf") == []
    data = pair_tables.to_dict(proposal_of(never(q=Q), never(nearest=Nearest(0.5, Q))), comparison, "x.srdf")
    assert data == json.loads(json.dumps(data))
    assert [pair["q"] for pair in data["compared"]["only_theirs"]] == [[0.5, -1.25], None]
    assert [(pair["collide_at"], pair["least_gap"]) for pair in data["pairs"]] == [([0.5, -1.25], None), (None, 0.5)]
    assert "compared" not in pair_tables.to_dict(proposal_of(), None, None)


def test_differences_have_reasons_shares_gaps_and_depths():
    proposal = propose_disabled_pairs(chain(5, length=0.2, width=0.15), 300, rounds=2)
    tested = [pair for pair in proposal.pairs if pair.reason is None]
    compared = compare_pairs(proposal, [(pair.a, pair.b, "Never") for pair in tested])
    assert [(d.a, d.b, d.reason) for d in compared.only_ours] == [(p.a, p.b, p.reason) for p in proposal.disabled]
    for side, pairs in ((compared.only_theirs, tested), (compared.only_ours, proposal.disabled)):
        for found, pair in zip(side, pairs, strict=True):
            if pair.samples:
                assert found.share == pair.hits / pair.samples
            else:  # neighbours that overlap at their joint are asked by the comparison
                assert pair.reason == ADJACENT and found.share == 1.0 and found.always
            assert found.gap == (pair.nearest and pair.nearest.gap) and (found.q is None) == (found.depth is None)
    assert all(found.wrong and found.depth > 0 for found in compared.only_theirs) and len(tested) >= 2
    assert any(found.gap is None for found in compared.only_ours)


# --- proposals ------------------------------------------------------------------------------------


def touching_robot():
    """A slider that touches a post at its default configuration alone, and never another."""
    return robot_of(
        ["base", "slider", "post", "far"],
        [joint("slide", "prismatic", "base", "slider", axis=(1, 0, 0), lower=0.0, upper=1.0),
         joint("weld", "fixed", "base", "post"), joint("weld_far", "fixed", "base", "far")],
        {"base": (Sphere(0.1), (0, 0, 9)), "slider": (Sphere(0.5), (0, 0, 0)), "post": (Sphere(0.5), (-1, 0, 0)),
         "far": (Sphere(0.5), (0, 3, 0))},
    )


def test_a_pair_that_only_the_default_has_in_collision_is_default():
    stages = []

    class Progress:
        def __init__(self, label):
            stages.append(label)

        def __enter__(self):
            return stages.append

        def __exit__(self, *error):
            return None

    proposal = propose_disabled_pairs(touching_robot(), 20, rounds=2, progress=Progress)
    pair = proposal.pair("slider", "post")
    assert (pair.reason, pair.hits, pair.samples, pair.searched) == (DEFAULT, 0, 20, False)
    assert pair.q.tolist() == [0.0] and pair.nearest is None
    assert stages == [
        "plain: sampling", "plain: 0 of 20 configurations", "plain: searching pair 1 of 1, slider and far",
    ]
    hit = propose_disabled_pairs(chain(5, length=0.2, width=0.15), 300, rounds=2)
    tested = [pair for pair in hit.pairs if pair.reason is None]
    assert tested and not any(pair.searched or pair.nearest for pair in tested if pair.hits)


def test_a_sample_is_the_same_in_batches(monkeypatch):
    whole = propose_disabled_pairs(chain(5, length=0.2, width=0.15), 100, rounds=0)
    monkeypatch.setattr(pair_proposal, "_BATCH", 30)
    again = propose_disabled_pairs(chain(5, length=0.2, width=0.15), 100, rounds=0)
    for one, two in zip(whole.pairs, again.pairs, strict=True):
        assert (one.reason, one.samples, one.hits) == (two.reason, two.samples, two.hits)
        assert (one.q is None) == (two.q is None) and (one.q is None or np.array_equal(one.q, two.q))
    fixed = propose_disabled_pairs(touching_robot(), 100, rounds=0).pair("post", "far")
    assert (fixed.fixed, fixed.samples, fixed.hits) == (True, 1, 0)


@pytest.mark.parametrize("name", ["samples", "rounds"])
def test_as_many_as_there_may_be(monkeypatch, name):
    monkeypatch.setattr(pair_proposal, "_MAX_SAMPLES", 12)
    options = {"samples": 5, "rounds": 1}
    propose_disabled_pairs(touching_robot(), **{**options, name: 12})
    with pytest.raises(InvalidArgument, match=f"{name} must be at most 12, got 13"):
        propose_disabled_pairs(touching_robot(), **{**options, name: 13})


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_shares_of_always_at_their_ends(share):
    assert propose_disabled_pairs(touching_robot(), 5, rounds=0, always_share=share).always_share == share
    with pytest.raises(InvalidArgument, match=r"between 0\.5 and 1"):
        propose_disabled_pairs(touching_robot(), 5, rounds=0, always_share=share + 0.5 if share == 1 else 0.49)


def test_pairs_are_found_by_either_order_of_their_names():
    proposal = propose_disabled_pairs(touching_robot(), 5, rounds=0)
    assert proposal.pair("slider", "far") is proposal.pair("far", "slider") is not None
    assert proposal.pair("slider", "nobody") is None and proposal.pair("slider", "slider") is None


# --- limits of columns ----------------------------------------------------------------------------


def test_columns_of_joints_with_a_slash_in_their_names():
    inf = np.inf
    robot = robot_of(
        ["a", "b", "c", "d"],
        [joint("arm/one", "prismatic", "a", "b", lower=-inf, upper=inf),
         joint("arm/two", "revolute", "b", "c", axis=(0, 0, 1), lower=-inf, upper=inf),
         joint("arm", "floating", "c", "d", lower=-inf, upper=inf)],
        {link: (Sphere(0.1), (0, 0, 0)) for link in "abcd"},
    )
    lower, upper = sampled_limits(robot)
    angles = [name for name, low, high in zip(robot.joint_names, lower, upper) if high > low]
    assert angles == ["arm/two", "arm/roll", "arm/pitch", "arm/yaw"] and (upper - lower).max() <= 2 * np.pi
    assert unlimited_lengths(robot) == ["arm/one", "arm/x", "arm/y", "arm/z"]
