"""`collide.polytopes.meets`: equal to a rational simplex, every answer proven, bad input refused by name."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2] / "oracles")]
import meeting_families as families
from rational_simplex import have_common_point, largest_sum
from reproduction import reproducing

import collide
from collide import polytopes
from collide.certificates.certificate import CertificateRefused
from collide.least_distance import pair_proposals
from collide.papers.polytopes.meeting import Meeting
from collide.papers.polytopes.meets_query import ALGORITHMS

AGAIN = "from collide.polytopes import meets; print(meets({points}, {normals}, {offsets}, algorithm={algorithm}))"
SQUARE = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]]), np.ones(4)


def answered(question: families.Question, algorithm: str = "auto") -> Meeting:
    """An answer, verified, with the sign that the oracle gives."""
    with reproducing(AGAIN, **question._asdict(), algorithm=algorithm):
        answer = polytopes.meets(*question, algorithm=algorithm)
        polytopes.verify(*question, answer)
        assert answer.hit == have_common_point(*question)
    return answer


@pytest.mark.many(2)
@pytest.mark.parametrize("d", [1, 2, 3, 4, 5])
def test_equals_the_rational_simplex(d):
    answers = [(name, answered(question)) for name, question in families.questions(20, d, 72, 16)]
    assert 0.2 <= np.mean([answer.hit for _, answer in answers]) <= 0.8
    kinds = {answer.certificate.kind for _, answer in answers}
    assert kinds == {"common point", "separating plane", "contradiction"}
    for family in families.FAMILIES:
        hits = [answer.hit for name, answer in answers if name == family]
        assert any(hits) and not all(hits), f"{family} asks one question only"
    assert sum(answer.counters.get("exact_programs", 0) for _, answer in answers) >= 2, "doubles were never wrong"


@pytest.mark.parametrize("d", [6, 7, 8])
def test_large_dimensions(d):
    answers = [answered(question) for _, question in families.questions(21, d, 24, 14)]
    assert 0.1 <= np.mean([answer.hit for answer in answers]) <= 0.9


def test_oracle_by_hand():
    """The oracle itself, on questions whose answer is plain to see."""
    assert largest_sum([[Fraction(1), Fraction(-1)]]) == 1 and largest_sum([[Fraction(1), Fraction(2)]]) == 0
    assert have_common_point([[2, 0], [0, 2]], *SQUARE)
    assert not have_common_point([[2, 0], [0, 3]], [[1, 0], [0, 1]], [Fraction(1, 2), Fraction(1, 2)])


def test_distance_of_a_triangle_and_a_square():
    answer = polytopes.meets([[3.0, -1], [3, 1], [9, 0]], *SQUARE)
    assert not answer.hit and not answer
    assert answer.distance == answer.lower == answer.upper == 2.0
    assert answer.normal.tolist() == [-1.0, 0.0]
    assert answer.point_p[0] == 3.0 and answer.point_h[0] == 1.0
    np.testing.assert_allclose(answer.point_h - answer.point_p, answer.distance * answer.normal)


def test_distance_of_irrational_length_is_bracketed():
    answer = polytopes.meets([[2.0, 2.0], [3.0, 2.0], [2.0, 3.0]], *SQUARE)
    assert Fraction(answer.lower) ** 2 < 2 < Fraction(answer.upper) ** 2
    assert math.nextafter(answer.lower, 9.0) == answer.upper


def test_a_unit_in_the_last_place_either_side_of_touching():
    for x, hit in ((1.0, True), (math.nextafter(1.0, 0), True), (math.nextafter(1.0, 2), False)):
        answer = polytopes.meets([[x, 0.5], [4.0, 0.0]], *SQUARE)
        polytopes.verify([[x, 0.5], [4.0, 0.0]], *SQUARE, answer)
        assert answer.hit == hit and answer.distance == max(x - 1.0, 0.0)
    tilted = np.array([[0.1, 0.2, 0.3]])
    for offset in (0.14, math.nextafter(0.14, 0), math.nextafter(0.14, 1)):
        question = families.Question(np.array([[0.1, 0.2, 0.3]]), tilted, np.array([offset]))
        assert answered(question).hit == (sum(Fraction(v) ** 2 for v in tilted[0].tolist()) <= Fraction(offset))


def test_no_plane_that_keeps_the_points_away_cuts_less():
    """The gap along any unit vector is at most the distance, and along the answer's normal it is the distance."""
    rng, angles = np.random.default_rng(9), np.linspace(0, 2 * np.pi, 7)[:-1]
    points = rng.normal((4.0, 1.0), 0.5, (50, 2))
    normals, offsets = np.column_stack((np.cos(angles), np.sin(angles))), rng.uniform(0.8, 1.2, 6)
    answer = polytopes.meets(points, normals, offsets)
    corners = [
        np.linalg.solve(normals[[i, j]], offsets[[i, j]]) for i in range(6) for j in range(i)
        if abs(np.linalg.det(normals[[i, j]])) > 1e-9
    ]
    region = np.array([corner for corner in corners if (normals @ corner <= offsets + 1e-9).all()])

    def gap(n: np.ndarray) -> float:
        return float((points @ n).min() - (region @ n).max())

    assert gap(-answer.normal) == pytest.approx(answer.distance, abs=1e-12)
    tried = [gap(np.array([math.cos(t), math.sin(t)])) for t in rng.uniform(0, 2 * np.pi, 500)]
    assert max(tried) <= answer.distance + 1e-12 and max(tried) > 0.9 * answer.distance
    smaller = np.vstack((normals, -answer.normal)), np.append(offsets, -answer.normal @ answer.point_p - 2.0)
    assert polytopes.meets(points, *smaller).distance == pytest.approx(2.0, abs=1e-12)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_origin_on_the_boundary(algorithm):
    """Of the region, of the hull, of both, which then touch; polars seen from there would have no end."""
    corner = np.array([[-1.0, 0], [0, -1], [1, 1]]), np.array([0.0, 0, 2])
    beyond = np.array([[0.0, 0], [-1, 0], [-1, -1]])
    hits = []
    for points in (beyond, beyond - [0.5, 0], beyond - [-0.25, -0.5], beyond * 3 - [1, 1]):
        hits.append(answered(families.Question(points, *corner), algorithm).hit)
    assert hits == [True, False, True, False]
    assert answered(families.Question(np.zeros((1, 2)), np.array([[1.0, 2]]), np.zeros(1)), algorithm).hit


def test_working_sets_outgrow_their_room(monkeypatch):
    """Answers and counts are the same where the state of the search has room for one row of each kind at first."""
    asked = [question for _, question in families.questions(22, 4, 24, 40)]
    before = [polytopes.meets(*question) for question in asked]
    monkeypatch.setattr(pair_proposals, "_CAPACITY", 1)
    n_grown = 0
    for question, known in zip(asked, before):
        monkeypatch.setattr(pair_proposals, "_of_thread", pair_proposals._OfThread())
        answer = polytopes.meets(*question)
        assert (answer.hit, answer.distance, answer.certificate) == (known.hit, known.distance, known.certificate)
        assert answer.counters["points_read"] == known.counters["points_read"]
        n_grown += pair_proposals._of_thread.state.capacity > 2
    assert n_grown >= 12


def test_contradictory_planes_are_answered_with_multipliers():
    answer = polytopes.meets([[0.0, 0]], [[1, 0], [-2, 0], [0, 1]], [1, -2.5, 5])
    assert not answer.hit and answer.distance == answer.lower == answer.upper == math.inf
    assert answer.point_p is None and answer.normal is None
    assert answer.certificate.halfspaces == (0, 1)
    first, second = answer.certificate.multipliers
    assert first == 2 * second
    polytopes.verify([[0.0, 0]], [[1, 0], [-2, 0], [0, 1]], [1, -2.5, 5], answer)


@pytest.mark.parametrize("far", [0.0, 3.0])
def test_one_point_many_times(far):
    points = np.tile([0.1 + far, 0.2, 0.3], (100_000, 1))
    normals, offsets = np.array([[1.0, 0, 0], [0, 1, 0], [1, 1, 1]]), np.array([0.1, 0.2, 0.6])
    answer = polytopes.meets(points, normals, offsets)
    assert answer.hit == have_common_point(points[:1], normals, offsets)
    polytopes.verify(points, normals, offsets, answer)


@pytest.mark.parametrize(
    ("unit", "length"), [(1e-150, 1e-140), (1e-150, 1e140), (1e-60, 1.0), (1e60, 1e-140), (1e148, 1.0), (1.0, 1e140)]
)
def test_magnitudes(unit, length):
    """Answers do not depend on the unit of length, nor on how long the normals are."""
    rng, distances = np.random.default_rng(3), []
    points, normals = rng.normal((9.0, 0, 0), 1.0, (20, 3)), rng.normal(size=(9, 3))
    for scale, factor in ((1.0, 1.0), (2.0 ** round(math.log2(unit)), 2.0 ** round(math.log2(length)))):
        question = families.Question(points * scale, normals * factor, np.full(9, 0.25 * scale * factor))
        answer = answered(question)
        assert not answer.hit
        distances.append(answer.distance / scale)
    assert distances[0] == pytest.approx(distances[1], rel=1e-12)


REFUSED = {
    "NaN": ([[math.nan, 0]], [[1, 0]], [1], r"points\[0, 0\] must be a number"),
    "infinite": ([[1, 0]], [[1, 0]], [math.inf], r"offsets\[0\] must be a number"),
    "zero normal": ([[1, 0]], [[1, 0], [0, 0]], [1, 1], r"normals\[1\] is zero"),
    "short normal": ([[1, 0]], [[1e-200, 0]], [1], r"normals\[0\] is shorter"),
    "unlike d": ([[1, 0]], [[1, 0, 0]], [1], "give both as many columns"),
    "unlike lengths": ([[1, 0]], [[1, 0]], [1, 2], r"offsets must be \(1,\)"),
    "d > 8": (np.zeros((1, 9)), np.ones((1, 9)), [1], "1 ≤ d ≤ 8"),
    "points is empty": (np.zeros((0, 2)), [[1, 0]], [1], "points is empty"),
    "no planes": ([[1, 0]], np.zeros((0, 2)), [], "m ≥ 1"),
    "too large": ([[1e151, 0]], [[1, 0]], [1], r"within ±1e\+150"),
    "too far": ([[1, 0]], [[1e-3, 0]], [1e149], "farther than"),
    "text": ("here", [[1, 0]], [1], "points"),
    "one row": ([1, 0], [[1, 0]], [1], r"points must be \(n, d\)"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_by_name(what):
    *question, message = REFUSED[what]
    with pytest.raises(collide.InvalidArgument, match=message):
        polytopes.meets(*question)


def test_unknown_algorithm_and_work():
    with pytest.raises(collide.InvalidArgument, match="algorithm must be auto or one of"):
        polytopes.meets([[1.0]], [[1.0]], [1.0], algorithm="fast")
    with pytest.raises(collide.InvalidArgument, match="work must be an integer"):
        polytopes.meets([[1.0]], [[1.0]], [1.0], work=0)


@pytest.mark.parametrize("algorithm", [name for name in ALGORITHMS if name != "brute-force"])
def test_work_limit_is_kept(algorithm):
    rng = np.random.default_rng(0)
    question = rng.normal((9, 0, 0), 1.0, (1000, 3)), rng.normal(size=(1000, 3)), np.ones(1000)
    with pytest.raises(collide.UnsupportedQuery, match="more than work=1500 allows"):
        polytopes.meets(*question, algorithm=algorithm, work=1500)
    assert not polytopes.meets(*question, algorithm=algorithm, work=10**7).hit


# --- certificates -----------------------------------------------------------------------------------------------------


def _tampered(answer: Meeting):
    """Answers that must be refused: one thing changed in each."""
    certificate = answer.certificate

    def with_(**fields):
        return replace(answer, **fields)

    yield "hit", with_(hit=not answer.hit)
    yield "kind", with_(certificate=certificate._replace(kind="closed form"))
    for name, numbers in (("points", "weights"), ("halfspaces", "multipliers")):
        rows, values = getattr(certificate, name), getattr(certificate, numbers)
        if rows:
            yield name, with_(certificate=certificate._replace(**{name: (10**6, *rows[1:])}))
            yield f"negative {numbers}", with_(certificate=certificate._replace(**{numbers: (-values[0], *values[1:])}))
            yield f"fewer {name}", with_(certificate=certificate._replace(**{name: rows[1:]}))
            yield numbers, with_(certificate=certificate._replace(**{numbers: (values[0] * 2, *values[1:])}))
    if not answer.hit and math.isfinite(answer.upper):
        yield "lower", with_(lower=answer.lower * 1.0001, distance=answer.upper * 1.0001, upper=answer.upper * 1.001)
        yield "upper", with_(lower=answer.lower * 0.99, distance=answer.lower * 0.99, upper=answer.lower * 0.999)


def test_verify_refuses_what_was_tampered_with():
    rng, tried = np.random.default_rng(5), set()
    points, normals, offsets = rng.normal(size=(20, 3)), rng.normal(size=(12, 3)), np.full(12, 0.3)
    normals[1], both = -normals[0], np.where(np.arange(12) < 2, -0.3, 0.3)
    for shift, planes in ((0.4, offsets), (5.0, offsets), (0.0, both)):
        question = points + shift, normals, planes
        answer = polytopes.meets(*question)
        polytopes.verify(*question, answer)
        for what, wrong in _tampered(answer):
            tried.add((answer.certificate.kind, what))
            if answer.certificate.kind == "separating plane" and what == "multipliers":
                continue  # another plane, which may separate as well
            with pytest.raises(CertificateRefused):
                polytopes.verify(*question, wrong)
    assert len(tried) >= 20, tried


def test_verify_reads_the_input_alone():
    """A certificate of one question proves nothing about another."""
    apart = np.array([[3.0, 0.0]]), *SQUARE
    answer = polytopes.meets(*apart)
    with pytest.raises(CertificateRefused, match="does not separate point 0"):
        polytopes.verify([[0.5, 0.0]], *SQUARE, answer)
    with pytest.raises(CertificateRefused, match="does not separate point 1"):
        polytopes.verify([[3.0, 0.0], [0.0, 0.0]], *SQUARE, answer)


def test_a_certificate_is_plain_and_small():
    for d in (2, 3, 6):
        rng = np.random.default_rng(d)
        answer = polytopes.meets(rng.normal(size=(500, d)) + 3, rng.normal(size=(300, d)), np.ones(300))
        assert len(answer.certificate.points) <= d and len(answer.certificate.halfspaces) <= d
        assert type(answer.certificate.points[0]) is int and type(answer.certificate.weights[0]) is Fraction
