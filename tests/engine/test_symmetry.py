"""The same question gives the same bits: swapped, in batches, in any order, in several threads."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations_with_replacement

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of

import collide
from collide.results import flipped

PAIRS = list(combinations_with_replacement(naive.KINDS, 2))
CASES_PER_PAIR = 8


def cases_of(kind_a: str, kind_b: str) -> list[Case]:
    rng = rng_of("symmetry", kind_a, kind_b)
    cases = []
    for k in range(CASES_PER_PAIR):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        B = A if kind_a == kind_b and k == 0 else B
        cases.append(Case(A, B, random_pose(rng, 0.7), random_pose(rng, 0.7)))
    return cases


def rows_of(case: Case) -> np.ndarray:
    """The row of a distance query; of the boolean where the overlap has no end."""
    try:
        return collide.distance(*case).rows
    except collide.UnsupportedQuery:
        assert collide.collide(*case) is True
        return collide.collide(*case)


@pytest.mark.many(2)
@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_swapping_swaps_points_and_negates_the_normal(kind_a, kind_b):
    for case in cases_of(kind_a, kind_b):
        with naive.reproducible(case):
            one, other = rows_of(case), rows_of(case.swapped())
            if one is not True:
                differing = naive.same_bits(one, flipped(other))
                assert not differing, f"{differing} differ:\n{one}\n{flipped(other)}"
            assert collide.collide(*case) == collide.collide(*case.swapped())


def test_swapping_touching_and_identical_bodies():
    """Where nothing but a convention can break the tie; the normal of identical bodies is any minimiser."""
    rng = rng_of("ties")
    shapes = naive.one_of_each(rng)
    for name, A in shapes.items():
        X = random_pose(rng)
        if name == "Halfspace":
            continue
        for Y in (X, X @ naive.pose(t=(0.25, 0, 0)), X @ naive.pose(t=(0, 0, 1e-9))):
            case = Case(A, A, X, Y)
            with naive.reproducible(case):
                one, other = collide.distance(*case).rows, collide.distance(*case.swapped()).rows
                fields = [f for f in naive.ANSWER_FIELDS if Y is not X or f in ("distance", "lower", "upper", "hit")]
                assert not naive.same_bits(one, flipped(other), fields)


def test_flipping_twice_changes_nothing():
    case = cases_of("Box", "Cone")[0]
    rows = collide.distance(*case).rows
    assert not naive.same_bits(flipped(flipped(rows)), rows, naive.FIELDS)


@pytest.mark.many(2)
@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_a_batch_answers_like_single_queries(kind_a, kind_b):
    """Also where one pose goes with many; half-spaces in half-spaces have a boolean only."""
    A, B = cases_of(kind_a, kind_b)[-1][:2]
    rng = rng_of("batch", kind_a, kind_b)
    X_WA = np.array([random_pose(rng, 0.7) for _ in range(12)])
    X_WB = np.array([random_pose(rng, 0.7) for _ in range(12)])
    endless = kind_a == kind_b == "Halfspace"
    for one, other in ((X_WA, X_WB), (X_WA, X_WB[0]), (X_WA[0], X_WB)):
        Xs, Ys = (np.broadcast_to(X, (12, 4, 4)) for X in (one, other))
        singles = [Case(A, B, X, Y) for X, Y in zip(Xs, Ys)]
        assert collide.collide(A, B, one, other).tolist() == [collide.collide(*case) for case in singles]
        if endless:
            continue
        batch = collide.distance(A, B, one, other)
        assert len(batch) == 12
        for k, case in enumerate(singles):
            with naive.reproducible(case):
                differing = naive.same_bits(batch.rows[k], collide.distance(*case).rows[0])
                assert not differing, f"{differing} differ"


def test_what_was_asked_before_does_not_matter():
    cases = [case for pair in PAIRS for case in cases_of(*pair)[:2] if pair != ("Halfspace", "Halfspace")]
    first = [collide.distance(*case).rows for case in cases]
    rng = rng_of("order")
    for order in (range(len(cases)), rng.permutation(len(cases)), range(len(cases) - 1, -1, -1)):
        for k in order:
            assert not naive.same_bits(collide.distance(*cases[k]).rows, first[k]), naive.snippet(cases[k])


def test_shapes_made_anew_answer_alike():
    """Nothing depends on identity: equal numbers, equal bits."""
    for pair in (("Box", "ConvexHull"), ("Compound", "Ellipsoid"), ("HPolytope", "Cylinder")):
        for one, again in zip(cases_of(*pair), cases_of(*pair)):
            assert one.A is not again.A
            assert not naive.same_bits(collide.distance(*one).rows, collide.distance(*again).rows)


def test_several_threads_get_the_same_bits():
    cases = [case for pair in PAIRS for case in cases_of(*pair)[:3] if pair != ("Halfspace", "Halfspace")]
    expected = [collide.distance(*case).rows for case in cases]

    def differing(seed):
        order = np.random.default_rng(seed).permutation(len(cases))
        return [k for k in order if naive.same_bits(collide.distance(*cases[k]).rows, expected[k])]

    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(differing, range(8)):
            assert not found, naive.snippet(cases[found[0]])


def test_a_limit_does_not_change_answers_within_it():
    for pair in PAIRS:
        for case in cases_of(*pair)[:3]:
            if pair == ("Halfspace", "Halfspace"):
                continue
            full = collide.distance(*case)
            if full.hit or "Compound" in pair:
                continue
            with naive.reproducible(case):
                limited = collide.distance(*case, max_distance=full.distance * 1.5)
                assert limited.lower <= full.upper and full.lower <= limited.upper
                assert not limited.beyond and math.isfinite(limited.upper)


def test_the_cases_are_neither_all_hits_nor_all_misses():
    hits = [collide.collide(*case) for pair in PAIRS for case in cases_of(*pair)]
    assert 0.2 < naive.share(hits) < 0.9
