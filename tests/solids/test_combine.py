"""One solid of many, judged by the solids' own winding numbers; whatever their order, the same bytes."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import contextmanager

import numpy as np
import pytest
from many_judge import CASES, judge_many, many_solids, random_table, same_bits, snippet_many
from mesh_shapes import bumpy_sphere

import collide
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.solids import arrangement, cut_segments
from collide.solids import limits as limits_module

I = np.eye(4)


@pytest.fixture(scope="module")
def verdicts():
    return {case: judge_many(case[0], 1, case[1], 16) for case in CASES}


@pytest.mark.many(2)
@pytest.mark.parametrize("family,r", CASES)
def test_points_are_where_the_rule_puts_them(family, r, verdicts):
    """Half the points within 1e-9 of a surface; volumes of a rule and of its opposite add up in fractions."""
    v = verdicts[family, r]
    assert not v.wrong, f"{v.wrong[:3]}\n{snippet_many(family, 1, r, 16)}"
    assert v.adds_up and v.n_points >= 60 and v.n_near == 8, snippet_many(family, 1, r, 16)


def test_both_outcomes_occur(verdicts):
    """Otherwise little is tested."""
    inside, judged = (sum(getattr(v, name) for v in verdicts.values()) for name in ("n_in", "n_points"))
    assert 0.1 * judged < inside < 0.9 * judged
    assert {r for _, r in CASES} == set(range(2, 9))


@pytest.mark.parametrize("family,r", [("boxes", 8), ("grid shells", 5), ("smooth", 3), ("identical shells", 4)])
def test_the_order_of_the_bodies_changes_no_bit(family, r):
    shapes, poses = many_solids(family, 2, r)
    table = random_table(r, 5)
    rng = np.random.default_rng(3)
    expected = collide.combine(shapes, poses, table)
    counts = Counter()
    for _ in range(3):
        p = rng.permutation(r)
        back = np.argsort(p)

        def turned(bits, back=back):
            return table(tuple(bits[k] for k in back))

        q = collide.combine([shapes[k] for k in p], poses[p], turned)
        assert same_bits(q, expected), (family, p)
        assert (q.before == expected.before[:, p]).all() and (q.behind == expected.behind[:, p]).all()
        counts["moved"] += int((p != np.arange(r)).any())
        same_body = [shapes[a] is shapes[b] and (poses[a] == poses[b]).all() for a, b in zip(p[q.body], expected.body)]
        assert all(same_body) and (q.facet == expected.facet).all()
    assert counts["moved"] and (family == "identical shells" or not expected.empty)


def test_of_two_it_is_the_boolean():
    A, B = collide.Mesh(*bumpy_sphere(60)), collide.Mesh(*bumpy_sphere(60, 1))
    X = collide.pose((0.5, 0.1, 0.2), rpy=(0.1, 0.2, 0.3))
    pairs = [("union", "union"), ("intersection", "intersection"), ("parity", "symmetric_difference"),
             (lambda bits: bits[0] and not bits[1], "difference"), ("at least 2", "intersection")]
    for rule, op in pairs:
        many, two = collide.combine([A, B], [I, X], rule), collide.boolean(A, B, I, X, op)
        assert many.mesh.report.volume == pytest.approx(two.mesh.report.volume, rel=1e-12)
        assert sorted(map(tuple, many.mesh.vertices.tolist())) == sorted(map(tuple, two.mesh.vertices.tolist()))
        assert Counter(zip(many.body.tolist(), many.facet.tolist())) == Counter(
            zip(two.body.tolist(), two.facet.tolist())
        )


def test_before_and_behind_tell_what_holds_both_sides():
    boxes = [collide.Box((2, 2, 2)), collide.Box((1, 1, 1)), collide.Box((1, 1, 1))]
    r = collide.combine(boxes, [I, I, collide.pose((1.5, 0, 0))], lambda bits: (bits[0] and not bits[1]) or bits[2])
    assert r.mesh.report.volume == 8 - 1 + 1
    at_cavity = r.body == 1
    assert (r.behind[at_cavity] == [True, False, False]).all() and (r.before[at_cavity] == [True, True, False]).all()
    assert at_cavity.sum() == 12
    assert not (r.behind == r.before).all(axis=1).any()


def test_one_body_and_none_left():
    crossed = collide.combine([collide.Box((1, 1, 1))] * 2, [I, collide.pose((0.5, 0, 0))], "union").mesh
    assert collide.combine([crossed], [I], "union").mesh.report.volume == 1.5
    far = collide.combine([collide.Box((1, 1, 1))] * 3, [I, I, collide.pose((9, 0, 0))], "intersection")
    assert far.empty and far.before.shape == far.behind.shape == (0, 3)


def test_bad_rules_and_lists():
    b = collide.Box((1, 1, 1))
    shapes, poses = [b, b, b], [I, collide.pose((0.5, 0, 0)), collide.pose((0, 0.5, 0))]

    def raises(bits):
        if bits == (True, False, True):
            raise KeyError("no such part")
        return any(bits)

    for rule, words in [
        ("xor", "rule must be 'union'.*'at least k'"), ("at least 0", "k ≥ 1"), (7, "function of 3 bools"),
        (raises, r"rule .* raised KeyError of bodies \[0, 2\] of 3: .*no such part"),
        (lambda bits: sum(bits), "must answer True or False, of bodies .* it answered 0"),
        (lambda bits: None, "it answered None"), (lambda bits: np.array(bits), "must answer True or False"),
        (lambda bits: not any(bits), "no body holds belongs"), (lambda: True, "rule .* raised TypeError"),
    ]:
        with pytest.raises(InvalidArgument, match=words):
            collide.combine(shapes, poses, rule)
    with pytest.raises(InvalidArgument, match=r"3 shapes need as many poses, .* got 2"):
        collide.combine(shapes, poses[:2], "union")
    for nothing in ([], b, None):
        with pytest.raises(InvalidArgument, match="one or more solids"):
            collide.combine(nothing, poses, "union")
    surface = collide.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InvalidArgument, match=r"shapes\[2\] has no inside: open edges"):
        collide.combine([b, b, surface], poses, "union")
    with pytest.raises(InvalidPose, match=r"poses\[1\]"):
        collide.combine(shapes, [I, 2 * I, I], "union")
    with pytest.raises(UnsupportedQuery, match=r"Sphere"):
        collide.combine([b, collide.Sphere(1), b], poses, "union")


def test_rules_are_asked_once_for_each_combination():
    asked = Counter()

    def rule(bits):
        asked[bits] += 1
        return bits[0]

    collide.combine([collide.Box((1, 1, 1))] * 3, [collide.pose((0.1 * k, 0.2 * k, 0.3 * k)) for k in range(3)], rule)
    asked[False, False, False] -= 1  # once before anything is cut
    assert set(asked.values()) == {1} and len(asked) >= 6


def test_crossings_of_facets_of_three_bodies_are_cut_in_kernels(monkeypatch):
    """Nearly no facet of bodies in general position is cut in integers, and integers make the same points."""
    rng, part = np.random.default_rng(0), collide.Mesh(*bumpy_sphere(196))
    shapes = [part] * 5
    poses = [collide.pose(rng.uniform(-0.5, 0.5, 3), rpy=rng.uniform(-3, 3, 3)) for _ in shapes]
    exactly = Counter()

    def counted(cuts, f, right=arrangement.cut_facet):
        exactly["facets"] += 1
        return right(cuts, f)

    monkeypatch.setattr(arrangement, "cut_facet", counted)
    quick = collide.combine(shapes, poses, "at least 2", rounding="exact")
    n_quick = exactly.pop("facets", 0)
    monkeypatch.setattr(cut_segments, "MAX_SEGMENTS", 0)
    slow = collide.combine(shapes, poses, "at least 2", rounding="exact")
    assert n_quick < 0.02 * quick.n_cut < 0.3 * quick.n_cut < exactly["facets"]
    assert (np.unique(quick.mesh.vertices, axis=0) == np.unique(slow.mesh.vertices, axis=0)).all()
    assert len(quick.mesh.faces) == len(slow.mesh.faces) and quick.moved <= slow.moved


@pytest.mark.slow
def test_crossings_in_an_unproven_order_along_a_segment():
    """Their pieces once said in which direction they run, and the sheets around them were put in a wrong order."""
    v = judge_many("turned grid shells", 15, 4, 16)
    assert not v.wrong and v.adds_up, snippet_many("turned grid shells", 15, 4, 16)


def hard_pair():
    """Two solids with some hundred pairs of facets that are cut exactly."""
    A = collide.combine(
        [collide.Mesh(*bumpy_sphere(60, k)) for k in range(2)], [I, collide.pose((0.4, 0, 0))], "union"
    ).mesh
    return [A, A, A], [I, I, collide.pose((0.3, 0.2, 0.1), rpy=(0.1, 0, 0))]


def test_limits_are_kept_and_say_what_it_would_take():
    shapes, poses = hard_pair()
    with pytest.raises(
        UnsupportedQuery, match=r"pairs of facets .* would take about [\d,]+ bytes, more than memory=10,000"
    ):
        collide.combine(shapes, poses, "union", memory=10_000)
    with pytest.raises(UnsupportedQuery, match="not done after time_limit=1e-06 s, while"):
        collide.boolean(*shapes[:2], *poses[:2], "union", time_limit=1e-6)
    for bad in (0, -1, "1", True):
        with pytest.raises(InvalidArgument, match="time_limit must be a positive number"):
            collide.combine(shapes, poses, "union", time_limit=bad)
    with pytest.raises(InvalidArgument, match="progress must be called"):
        collide.overlap_volume(*shapes[:2], *poses[:2], progress=3)
    assert not collide.combine(shapes, poses, "union", memory=1 << 30, time_limit=600).empty


def test_a_slow_part_says_how_long_it_would_take(monkeypatch):
    """A clock by which every look takes a second."""
    now = iter(range(10**6))
    monkeypatch.setattr(limits_module, "time", type("Clock", (), {"monotonic": staticmethod(lambda: float(next(now)))}))
    shapes, poses = hard_pair()
    with pytest.raises(UnsupportedQuery, match=r"\(\d+ of \d+: this part would take about [\d.e+]+ s\); raise it"):
        collide.combine(shapes, poses, "union", time_limit=60.0)


def test_progress_is_told_and_what_is_cancelled_leaves_nothing(monkeypatch):
    """The same bytes after a run that was stopped in any of its parts."""
    monkeypatch.setattr(limits_module, "_REPORTS", 0.0)
    shapes, poses = hard_pair()
    expected = collide.combine(shapes, poses, "at least 2")
    labels, open_now = [], []

    def progress(stop_at=None):
        @contextmanager
        def about(label):
            open_now.append(label)

            def rename(label):
                labels.append(label)
                if stop_at is not None and stop_at in label:
                    raise KeyboardInterrupt

            try:
                yield rename
            finally:
                open_now.pop()

        return about

    assert same_bits(collide.combine(shapes, poses, "at least 2", progress=progress()), expected)
    parts = [
        "finding facets that meet",
        "drawing what facets share",
        "crossing segments",
        "cutting facets",
        "cells apart",
    ]
    assert all(any(part in label for label in labels) for part in parts) and any("50 %" in label for label in labels)
    for part in [*parts, "crossing segments, ", "cutting facets, "]:
        with pytest.raises(KeyboardInterrupt):
            collide.combine(shapes, poses, "at least 2", progress=progress(part))
        assert not open_now
    assert same_bits(collide.combine(shapes, poses, "at least 2"), expected)
    started = time.monotonic()
    with pytest.raises(UnsupportedQuery):
        collide.combine(shapes, poses, "union", progress=progress(), time_limit=1e-3)
    assert not open_now and time.monotonic() - started < 5.0
