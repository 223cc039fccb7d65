"""ACIT of Barba and Mulzer: right by itself, without the exact search behind it; its invariants; the text's traps."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2] / "oracles")]
import meeting_families as families
from rational_simplex import have_common_point
from reproduction import reproducing

import collide
from collide import polytopes
from collide.least_distance.homogeneous_rows import HomogeneousRows
from collide.least_distance.input_rows import input_rows
from collide.least_distance.interior_point import interior_point
from collide.least_distance.nearest_pair import APART, nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.papers.polytopes import acit
from collide.papers.polytopes.recentred_polars import recentred_spaces

#: So small that some dozens of rows are pruned several times.
SMALL = acit.Sizes(0.3, 12, 16)
AGAIN = """
import numpy as np
from collide.papers.polytopes import acit
from collide.least_distance.input_rows import input_rows
from collide.least_distance.pair_proposals import Work
rows = input_rows(np.array({points}), np.array({normals}), np.array({offsets}))
print(acit.acit(rows, Work(), acit.Sizes(0.3, 12, 16)))
"""


class Asked:
    """A question in the form that the recursion wants: None where theorem 4.5 needs no recursion."""

    def __init__(self, question: families.Question):
        rows, self.work, self.spaces = input_rows(*question), Work(), None
        interior = interior_point(rows.halfspaces, self.work, exactly=True)
        if interior is None:
            return
        spaces = recentred_spaces(rows.points, rows.halfspaces, interior)
        if spaces is None:  # so thin that no double is inside
            return
        primal, polar, _ = spaces
        if acit._centre_in_hull(primal, rows.points, self.work) is None:
            self.spaces = primal, polar

    def verdict(self, limits=SMALL, base=nearest_pair, pruning=acit.PrimalDualPruning) -> acit.Verdict:
        primal = self.spaces[0]
        run = pruning(self.spaces, self.work, limits, base)
        return run.test(acit.PRIMAL, np.arange(len(primal.points)), np.arange(len(primal.halfspaces)))


def pruned(seed: int, d: int, count: int):
    """(question, it as the recursion wants it) for those of many questions that are pruned."""
    for _, question in families.questions(seed, d, count, 60):
        asked = Asked(question)
        if asked.spaces is not None and max(len(question.points), len(question.offsets)) > SMALL.alpha:
            yield question, asked


@pytest.mark.many(8)
@pytest.mark.parametrize("d", [1, 2, 3, 4, 5])
def test_the_recursion_alone_equals_the_oracle(d):
    spaces, depths, rounds = [], [], []
    for question, asked in pruned(31, d, 30 if d > 1 else 60):
        with reproducing(AGAIN, **question._asdict()):
            verdict = asked.verdict()
            assert (verdict.space != acit.PRIMAL) == have_common_point(*question)
        spaces.append(verdict.space)
        depths.append(asked.work.counters["depth"])
        rounds.append(asked.work.counters.get("most_net_rounds", 1))
    assert len(spaces) >= 8 and {acit.PRIMAL, acit.POLAR} <= set(spaces)
    assert max(depths) >= 3 and (d == 1 or max(rounds) >= 2) and max(rounds) <= 2 * d + 1


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_answers_are_proven_and_need_no_further_search(d):
    n_pruned = 0
    for _, question in families.questions(32, d, 30, 50):
        rows, work = input_rows(*question), Work()
        with reproducing(AGAIN, **question._asdict()):
            pair = acit.acit(rows, work, SMALL)
            polytopes.verify(*question, polytopes.meets(*question, algorithm="acit"))
            assert (pair.kind == "meeting") == polytopes.meets(*question).hit
        n_pruned += work.counters.get("net_rounds", 0) > 0
    assert n_pruned >= 8


def test_eight_dimensions_need_a_ninth():
    """A point inside all half-spaces is a program in one dimension more than questions have."""
    rng, kinds = np.random.default_rng(37), []
    for k in range(6):
        normals, points = rng.normal(size=(40, 8)), rng.normal(size=(30, 8)) + (2.5 if k % 2 else 0.3)
        question = families.Question(points, normals, np.full(40, 1.5))
        answer = polytopes.meets(*question, algorithm="acit")
        polytopes.verify(*question, answer)
        assert answer.distance == polytopes.meets(*question).distance
        kinds.append(answer.hit)
    assert any(kinds) and not all(kinds)


def test_touching_is_a_third_answer():
    """Squares with many redundant half-spaces, and points on and beyond one of their edges."""
    rng, kinds, rounds = np.random.default_rng(33), [], []
    square, rest = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]]), np.array([[2.0, 1], [2, -1], [-1, 3], [1, 2]])
    normals = np.vstack((square, np.tile(rest, (10, 1))))
    for _ in range(40):
        offsets = np.concatenate((np.ones(4), np.abs(normals[4:]).sum(axis=1) + rng.integers(0, 5, 40)))
        points = np.column_stack((1 + rng.integers(0, 4, 40) / 2, rng.integers(-8, 9, 40) / 2))
        asked = Asked(families.Question(points, normals, offsets))
        kinds.append(asked.verdict().space)
        rounds.append(asked.work.counters["most_net_rounds"])
        assert (kinds[-1] is None) == have_common_point(points, normals, offsets)
    assert kinds.count(None) >= 20 and max(rounds) <= 5


def test_large_sets_with_the_sizes_of_the_paper():
    rng, n, d = np.random.default_rng(4), 12_000, 3
    points, normals = rng.normal(size=(n, d)), rng.normal(size=(n, d))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    question = families.Question(points, normals, 1.0 + normals @ [2.0, 0.5, 0.0])
    answer = polytopes.meets(*question, algorithm="acit")
    polytopes.verify(*question, answer)
    assert not answer.hit and answer.distance == polytopes.meets(*question).distance
    assert answer.counters["depth"] >= 3 and answer.counters["most_net_rounds"] <= 2 * d + 1
    assert answer.counters["points_read"] + answer.counters["halfspaces_read"] < 60 * n


def test_base_solver_sees_at_most_alpha_rows():
    largest = 0

    def strict(points, halfspaces, work, point_rows, halfspace_rows):
        nonlocal largest
        largest = max(largest, len(point_rows), len(halfspace_rows))
        if largest > SMALL.alpha:
            raise RuntimeError(f"{largest} rows")
        return nearest_pair(points, halfspaces, work, point_rows, halfspace_rows)

    n_asked = sum(asked.verdict(base=strict) is not None for _, asked in pruned(34, 3, 40))
    assert n_asked >= 10 and largest > SMALL.sample


def test_a_sample_that_is_no_net_is_drawn_again():
    redrawn = 0
    for question, asked in pruned(35, 3, 16):
        verdict = asked.verdict(limits=acit.Sizes(0.1, 6, 12))
        assert (verdict.space != acit.PRIMAL) == polytopes.meets(*question).hit
        redrawn += asked.work.counters.get("nets_redrawn", 0)
    assert redrawn >= 3


# --- planted faults ---------------------------------------------------------------------------------------------------


class ClosedConflicts(acit.PrimalDualPruning):
    """Points on the plane conflict as well."""

    def conflicts(self, space, verdict, point_rows):
        case_2 = verdict.space == space
        rows = self.spaces[space].points if case_2 else self.spaces[1 - space].halfspaces
        pair = verdict.pairs[space if case_2 else 1 - space]
        beyond = rows.negative([-number for number in (pair.plane if case_2 else pair.corner)], point_rows).rows
        return np.setdiff1d(point_rows, beyond)


class NoConflicts(acit.PrimalDualPruning):
    """The sample's answer is taken for that of all."""

    def conflicts(self, space, verdict, point_rows):
        return point_rows[:0]


class PlaneThroughX(acit.PrimalDualPruning):
    """Case 2 with the plane through the nearest point of FH in place of that of CH."""

    def conflicts(self, space, verdict, point_rows):
        if verdict.space != space:
            return super().conflicts(space, verdict, point_rows)
        pair = verdict.pairs[space]
        level = sum(a * b for a, b in zip(pair.u, pair.x))
        plane = [*(number * pair.denominator for number in pair.u), -level]
        return self.spaces[space].points.negative(plane, point_rows).rows


class CasesConfused(acit.PrimalDualPruning):
    """Apart in the polar space is read as apart here."""

    def solve_base(self, space, point_rows, halfspace_rows):
        verdict = super().solve_base(space, point_rows, halfspace_rows)
        return verdict if verdict.space is None else acit.Verdict(1 - verdict.space, verdict.pairs[::-1])


def base_without_a_row(points, halfspaces, work, point_rows, halfspace_rows):
    """A base solver that leaves the last half-space out."""
    return nearest_pair(points, halfspaces, work, point_rows, halfspace_rows[:-1])


FAULTS = {
    "closed conflict sets": {"pruning": ClosedConflicts},
    "no conflicts": {"pruning": NoConflicts},
    "plane through x": {"pruning": PlaneThroughX},
    "cases confused": {"pruning": CasesConfused},
    "a row left out": {"base": base_without_a_row},
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_noticed(fault):
    """By a wrong answer, or by an invariant that refuses to give one."""
    noticed = 0
    for question, asked in pruned(36, 2, 90):
        try:
            verdict = asked.verdict(**FAULTS[fault])
            pair = None if verdict.space is None else verdict.pairs[verdict.space]
            right = _is_final(asked, verdict.space, pair) and (
                (verdict.space != acit.PRIMAL) == polytopes.meets(*question).hit
            )
        except (AssertionError, AttributeError, collide.UnsupportedQuery):
            right = False
        noticed += not right
    assert noticed >= 1


def _is_final(asked: Asked, space: int | None, pair) -> bool:
    """Whether no row of the whole input is beyond the answer."""
    if space is None:
        return True
    points, halfspaces = asked.spaces[space]
    return not len(points.negative(pair.plane).rows) and not len(halfspaces.negative(pair.corner).rows)


def test_no_fault_no_notice():
    for _, asked in pruned(36, 2, 90):
        verdict = asked.verdict()
        assert _is_final(asked, verdict.space, None if verdict.space is None else verdict.pairs[verdict.space])


# --- traps in the text ------------------------------------------------------------------------------------------------


def test_closed_conflict_sets_are_never_empty():
    """Lemma 3.7's set, closed as section 3.2 defines it, holds the points of the net that the plane goes through."""
    points = np.array([[2.0, 1], [2, -1], [5, 0]])
    rows = input_rows(points, np.array([[1.0, 0]]), np.array([0.0]))
    pair = nearest_pair(rows.points, rows.halfspaces, Work())
    assert pair.kind == APART
    on_the_plane = [row for row in range(3) if sum(a * b for a, b in zip(pair.plane, rows.points.integers(row))) == 0]
    assert on_the_plane, "the closed set has members although the answer is final"
    assert not len(rows.points.negative(pair.plane).rows)


def test_an_unbounded_region_is_not_embracing():
    """CH of the polars of an unbounded FH does not hold o (lemma 3.2 needs it bounded), and answers are right."""
    normals, offsets = np.array([[1.0, 0], [1, 1], [1, -1]]), np.ones(3)
    polars = normals / offsets[:, None]
    assert polars[:, 0].min() > 0  # all beyond x = 0: o is not in their hull
    for x, hit in ((-50.0, True), (3.0, False)):
        question = families.Question(np.array([[x, 0.25], [x, -0.25], [x + 1, 0]]), normals, offsets)
        answer = polytopes.meets(*question, algorithm="acit")
        assert answer.hit == hit == have_common_point(*question)


def test_a_flat_region_has_answers():
    """e* = 0 in theorem 4.5: no point to move the origin to."""
    normals, offsets = np.array([[0.0, 1], [0, -1], [1, 0], [-1, 0]]), np.array([1.0, -1, 2, 2])
    for shift, hit in ((0.0, True), (2.5, False)):
        question = families.Question(np.array([[shift, 0.5], [1 + shift, 1], [0.5 + shift, 3]]), normals, offsets)
        rows, work = input_rows(*question), Work()
        assert (acit.acit(rows, work).kind == "meeting") == hit == have_common_point(*question)
        assert work.counters["flat_or_empty"] == 1


def test_nets_of_the_paper_do_not_make_the_recurrence_linear():
    """Two levels make (2d + 1)² calls; round i of 2d + 1 hands on iε of the rows, (d + 1)ε in the mean."""
    for d in (2, 3, 4, 5):
        assert (2 * d + 1) ** 2 * (d + 1) * Fraction(1, d**4) > 1
        inverse = round(1 / acit.sizes(d).epsilon)
        assert (2 * d + 1) ** 2 * (d + 1) * Fraction(1, inverse) == Fraction(1, 2)
    assert round(1 / acit.sizes(3).epsilon) == 392


def test_polars_keep_signs():
    """A point in a half-space is a polar point in a polar half-space, exactly, row by row."""
    rng = np.random.default_rng(6)
    points, normals = rng.normal(size=(30, 3)), rng.normal(size=(20, 3))
    rows = input_rows(points, normals, np.full(20, 1.5))
    primal, polar, _ = recentred_spaces(rows.points, rows.halfspaces, np.array([0.1, 0.2, 0.05]))
    inside = []
    for i in range(30):
        for j in range(20):
            here = _excess(primal.points, i, primal.halfspaces, j)
            there = _excess(polar.points, j, polar.halfspaces, i)
            assert (here > 0) == (there < 0) and (here == 0) == (there == 0)
            inside.append(here <= 0)
    assert 0.1 < np.mean(inside) < 0.9
    assert recentred_spaces(rows.points, rows.halfspaces, np.full(3, 9.0)) is None


def _excess(points: HomogeneousRows, i: int, halfspaces: HomogeneousRows, j: int) -> int:
    *v, v0 = points.integers(i)
    *a, b = halfspaces.integers(j)
    return sum(x * y for x, y in zip(a, v)) - b * v0
