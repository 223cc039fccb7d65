"""Pairs of convex polygons: equal to fractions over all edges, proven, and in as few rounds as Theorem 2.1 says."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pytest
from planar_families import FAMILIES, pose_at
from planar_oracle import polygons_meet_exactly
from reproduction import reproducing

from collide import ConvexPolygon
from collide.certificates.certificate import CertificateRefused
from collide.errors import InvalidArgument, InvalidPose
from collide.kernels import PLAIN_PYTHON
from collide.papers.polytopes.planar_layout import DOUBLES, HIT, HOW, INTEGERS, READ, ROUNDS, ROW, TWO_LINES
from collide.papers.polytopes.planar_predicates import PolygonPair, set_planar_poses
from collide.papers.polytopes.planar_search import search_planar
from collide.polytopes import planar_pose, polygon_distance, polygons_meet, verify_polygons

AGAIN = """import numpy as np
from collide.polytopes import ConvexPolygon, polygons_meet
r = polygons_meet(ConvexPolygon({A}), ConvexPolygon({B}), np.array({X_WA}), np.array({X_WB}))
print(r.hit, r.certificate())"""


def check_family(family, n: int, seed: int) -> tuple[np.ndarray, int]:
    """(hits, pairs that a line between two proves), of n pairs that were equal to the oracle, their proofs checked."""
    rng = np.random.default_rng(seed)
    cases = [family(rng) for _ in range(n)]
    polygons = [[ConvexPolygon(case[k]) for case in cases] for k in range(2)]
    poses = [np.array([case[k] for case in cases]) for k in (2, 3)]
    answers = polygons_meet(*polygons, *poses)
    for k, (A, B, X_WA, X_WB) in enumerate(zip(*polygons, *poses)):
        with reproducing(AGAIN, A=A.vertices, B=B.vertices, X_WA=X_WA, X_WB=X_WB):
            assert answers.hit[k] == polygons_meet_exactly(A.vertices, B.vertices, X_WA, X_WB)
            certificate = answers.certificate(k)
            assert certificate.hit == answers.hit[k]
            verify_polygons(A, B, X_WA, X_WB, certificate)
            sizes = len(A.vertices), len(B.vertices)
            assert answers.rounds[k] <= np.log2(sizes[0]) + np.log2(sizes[1]) + 6
            assert answers.vertices_read[k] <= 12 * (np.log2(sizes[0]) + np.log2(sizes[1])) + 60
    return answers.hit, int((answers._rows[:, HOW] == TWO_LINES).sum())


#: Of how many pairs the rarer answer is at least.
RARER = {"nested": 0.0, "magnitudes": 0.02}


@pytest.mark.many(6)
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_equal_to_fractions(family):
    hit, _ = check_family(family, 250, 1)
    assert min(hit.mean(), 1 - hit.mean()) >= RARER.get(family.__name__, 0.08)


def test_line_between_two_lines_is_reached():
    _, between = check_family(FAMILIES[5], 400, 2)
    assert between >= 3


def parabola(n: int) -> np.ndarray:
    """n corners of integer coordinates, counter-clockwise."""
    x = np.arange(n, dtype=float) - n // 2
    return np.c_[x, x * x]


class CountingArray:
    """Coordinates that count which were read."""

    def __init__(self, points: np.ndarray):
        self.values, self.n_read = points.ravel(), 0

    def __getitem__(self, k):
        self.n_read += 1
        return float(self.values[k])


@pytest.mark.plain_kernels
@pytest.mark.parametrize("n", [10, 1000, 10**6])
def test_search_reads_few_vertices(n):
    """Counted by the arrays themselves; answers by how parabolas lie: y ≥ x² and y ≤ c − x² meet where c ≥ 0."""
    rng = np.random.default_rng(n)
    corners = parabola(n)
    hits = []
    for k in range(60):
        m = int(rng.choice([10, 1000, n]))
        P, Q = CountingArray(corners), CountingArray(-parabola(m))
        shift = float(rng.choice([-(10.0**9), -1.0, -0.5, 0.0, 0.5, 1.0, 10.0]))
        place = float(rng.integers(-2, 3)) if k % 2 else rng.uniform(-m, m)
        work, integers, row = [0.0] * DOUBLES, [0] * INTEGERS, [0] * ROW
        X_WB = pose_at((place, shift))
        set_planar_poses(work, np.eye(3).ravel().tolist(), X_WB.ravel().tolist())
        search_planar(PolygonPair(P, n, Q, m, work, integers), row, 0)
        bound = np.log2(n) + np.log2(m)
        assert row[ROUNDS] <= bound + 6
        assert (P.n_read + Q.n_read) // 2 == row[READ] <= 12 * bound + 60
        if place == 0.0:
            assert row[HIT] == (shift >= 0.0)
        hits.append(row[HIT])
    assert 0.1 < np.mean(hits) < 0.9


def test_batch_equals_single_calls_and_swapped():
    rng = np.random.default_rng(5)
    A, B = ConvexPolygon(rng.normal(size=(20, 2))), ConvexPolygon(rng.normal(size=(30, 2)))
    X_WBs = np.array([pose_at(rng.normal(size=2) * 2.5, rng.uniform(0, 7)) for _ in range(50)])
    batch = polygons_meet(A, B, planar_pose(), X_WBs)
    assert 5 < batch.hit.sum() < 45
    assert np.array_equal(batch.hit, polygons_meet(B, [A] * 50, X_WBs, np.eye(3)).hit)
    for k, X_WB in enumerate(X_WBs):
        single = polygons_meet(A, B, np.eye(3), X_WB)
        assert (single.hit, single.rounds, single.vertices_read) == (
            batch.hit[k], batch.rounds[k], batch.vertices_read[k],
        )
        assert single.certificate() == batch.certificate(k)
    assert polygons_meet([], [], np.eye(3), np.eye(3)).hit.shape == (0,)


@pytest.mark.parametrize("ask", [polygons_meet, polygon_distance])
def test_threads_give_the_same_bits(ask, monkeypatch):
    monkeypatch.setattr("collide.base.threads._ALONE", 0.0)  # else so few pairs are shared by nobody
    rng = np.random.default_rng(8)
    n = 40_000 if not PLAIN_PYTHON else 40
    many = [ConvexPolygon(rng.normal(size=(k, 2))) for k in (3, 12, 40)]
    A = [many[k] for k in rng.integers(0, 3, n)]
    X_WAs = np.array([pose_at(rng.normal(size=2) * 2.0, rng.uniform(0, 7)) for _ in range(n)])
    for B, X_WB in ((many[2], pose_at((0.5, 0.1), 0.3)), (A[::-1], X_WAs[::-1])):
        one, three = ask(A, B, X_WAs, X_WB), ask(A, B, X_WAs, X_WB, threads=3)
        assert 0.1 < one.hit.mean() < 0.9
        assert np.array_equal(one._rows, three._rows)
        if ask is polygon_distance:
            assert np.array_equal(one.distance, three.distance) and np.array_equal(one.point_b, three.point_b)
    with pytest.raises(InvalidArgument, match="threads must be an integer"):
        ask(A, many[0], X_WAs, np.eye(3), threads=0)


def test_tampered_certificates_are_refused():
    square = ConvexPolygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    touching, apart = planar_pose((1, 0.5)), planar_pose((1.5, 0))
    hit = polygons_meet(square, square, np.eye(3), touching).certificate()
    miss = polygons_meet(square, square, np.eye(3), apart).certificate()
    verify_polygons(square, square, np.eye(3), touching, hit)
    verify_polygons(square, square, np.eye(3), apart, miss)
    doubled = tuple((vertex, 2 * weight) for vertex, weight in hit.weights_a)
    for X_WB, wrong in (
        (apart, hit), (touching, miss), (apart, miss._replace(offset=miss.offset + 1)),
        (apart, miss._replace(normal=(-miss.normal[0], miss.normal[1]))), (apart, miss._replace(normal=None)),
        (touching, hit._replace(weights_a=doubled)), (touching, hit._replace(weights_a=())),
        (touching, hit._replace(weights_b=((7, hit.weights_b[0][1]),))),
        (touching, hit._replace(point=(hit.point[0] + 1, hit.point[1]))),
        (planar_pose((1, 0)), miss._replace(normal=(miss.normal[0], miss.normal[1]), offset=miss.offset)),
    ):
        with pytest.raises(CertificateRefused):
            verify_polygons(square, square, np.eye(3), X_WB, wrong)


@pytest.mark.parametrize(
    ("question", "complaint"),
    [
        (("square", "square", np.eye(3), np.eye(4)), r"X_WB must have shape \(3, 3\)"),
        (("square", "square", np.eye(3) * 2, np.eye(3)), "X_WA must end in the row"),
        (("square", "square", np.diag([1.0, -1.0, 1.0]), np.eye(3)), "X_WA mirrors"),
        (("square", "square", np.diag([1.1, 1.0, 1.0]), np.eye(3)), "X_WA is not a rotation"),
        (("square", "square", np.full((3, 3), np.nan), np.eye(3)), "X_WA has entries that are not finite"),
        (("square", "square", np.eye(3), np.array([[1, 0, 1e60], [0, 1, 0], [0, 0, 1]])), "X_WB exceeds 1e"),
        (("square", "square", np.eye(3)[None].repeat(2, 0), np.eye(3)[None].repeat(3, 0)), "lengths do not match"),
        (("square", ["square", 3], np.eye(3), np.eye(3)), "B must be a ConvexPolygon or a list"),
        ((4, "square", np.eye(3), np.eye(3)), "A must be a ConvexPolygon or a list"),
    ],
)
def test_wrong_arguments_are_named(question, complaint):
    square = ConvexPolygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    put = {"square": square}
    A, B = (([put.get(q, q) for q in side] if isinstance(side, list) else put.get(side, side)) for side in question[:2])
    with pytest.raises((InvalidArgument, InvalidPose), match=complaint):
        polygons_meet(A, B, *question[2:])


def test_results_are_read():
    square = ConvexPolygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    r = polygons_meet(square, square, np.eye(3), planar_pose((3, 0)))
    assert repr(r) == "PolygonHits(False)" and len(r) == 1
    assert pickle.loads(pickle.dumps(r.certificate())) == r.certificate()
    with pytest.raises(InvalidArgument, match="from 0 to 0, got 1"):
        r.certificate(1)
    with pytest.raises(InvalidPose, match="planar_pose"):
        planar_pose((1, 2, 3))


if __name__ == "__main__":  # python tests/papers/polytopes/test_planar_pairs.py N: N pairs of all families together
    for index, some in enumerate(FAMILIES):
        done, lines = check_family(some, int(sys.argv[1]) // len(FAMILIES), 100 + index)
        print(f"{some.__name__}: {len(done)} pairs equal and proven, {done.mean():.2f} hits, {lines} by two lines")
