"""algorithm="barba-langerman" against the exact oracle, its counts, its invariants, and what it refuses."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from fractions import Fraction
from pathlib import Path

import hierarchy_families as families
import numpy as np
import pytest
from naive import rng_of

import collide
from collide.adapters.peers import exact
from collide.certificates.nearest_to_origin import nearest_to_origin, weights_towards_origin
from collide.lowering.parts import convex_set_of
from collide.papers.hierarchies.hierarchy_queries import Walks, walk_body
from collide.papers.hierarchies.run_walk import no_walks, run_walks
from collide.papers.hierarchies.validate_walk import validate_rounds
from collide.papers.hierarchies.walk import APART, LOST, MEETING
from collide.scenes.families import HULLS, generate, names
from collide.scenes.families.ingredients import direction, rotation

WALK = "barba-langerman"
EYE = np.eye(4)


def polytopes(name: str, n: int, seed: int):
    return [c for c in generate(name, n, seed) if c.kind == HULLS and c.radius_a == c.radius_b == 0.0]


def is_hit(case) -> bool:
    return exact.hit(case.P, case.R1, case.t1, case.Q, case.R2, case.t2)


def shifted(x, y=0.0, z=0.0) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def turned(rng, shift: float) -> np.ndarray:
    return collide.pose(R=rotation(rng), xyz=shift * direction(rng))


def ball(rng, n: int, stretch=(1.0, 1.0, 1.0)) -> collide.ConvexHull:
    points = rng.standard_normal((n, 3))
    return collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None] * stretch)


def roles(found: Walks, A, B, X_WA, X_WB):
    return (B, A, X_WB, X_WA) if found.exchanged else (A, B, X_WA, X_WB)


# --- equal to the oracle --------------------------------------------------------------------------


@pytest.mark.many(14)
@pytest.mark.parametrize("name", names())
def test_equal_to_the_oracle_on_the_hard_families(name):
    """Both ways round, with the invariants of every round where the walk walked."""
    large = name in ("spheres_big", "cyl1000", "bipyramids", "repeats")
    for case in polytopes(name, 2 if large else 12, 61):
        A, B, X_WA, X_WB = case.shapes()
        truth = is_hit(case)
        for one, other, X_WO, X_WT in ((A, B, X_WA, X_WB), (B, A, X_WB, X_WA)):
            found = collide.walk(one, other, X_WO, X_WT, trace=not large)
            assert found.hit.tolist() == [truth], case.snippet()
            assert found.walked.all() and found.depth_q, f"the walk has proven nothing\n{case.snippet()}"
            row = found.rows[0]  # it went to the bottom of one hierarchy, and no level is missed out
            assert min(row["level_p"], row["level_q"]) == 0 and row["rounds"] <= found.depth_p + found.depth_q - 1
            assert found.exact_rounds[0] <= 10, case.snippet()
            assert collide.collide(one, other, X_WO, X_WT, algorithm=WALK) is truth
            if found.depth_p and not large:
                P, R, X_WP, X_WR = roles(found, one, other, X_WO, X_WT)
                try:
                    validate_rounds(P._walk, R._walk, X_WP, X_WR, found.trace)
                except AssertionError as error:
                    raise AssertionError(f"{error}\n{case.snippet()}") from None


def test_equal_to_the_default_on_many_poses():
    rng = np.random.default_rng(5)
    for n, m in ((4, 4), (8, 30), (60, 12), (500, 900)):
        A, B = ball(rng, n), ball(rng, m, (1.0, 0.8, 0.6))
        X_WA = np.array([turned(rng, rng.uniform(0.8, 2.1)) for _ in range(300)])
        X_WB = np.array([turned(rng, 0.0) for _ in range(300)])
        found = collide.walk(A, B, X_WA, X_WB)
        assert (found.hit == collide.collide(A, B, X_WA, X_WB)).all()
        assert found.walked.mean() > 0.95
        assert 0.05 < found.hit.mean() < 0.95
        assert (found.rows["rounds"] <= found.depth_p + found.depth_q - 1).all()
        packed = convex_set_of(A), convex_set_of(B)
        early, _ = run_walks(A._walk, B._walk, *packed, X_WA, X_WB, early=True)
        assert ((early["status"] == MEETING) == found.hit)[early["status"] >= APART].all()
        assert (early["rounds"] <= found.rows["rounds"]).all()


def test_touching_is_a_hit_and_one_ulp_decides():
    A, B = collide.Box((2, 2, 2)), collide.ConvexHull(np.argwhere(np.ones((2, 2, 2))) * 2.0 - 1.0)
    for shift in ((2.0, 0.5, 0.25), (2.0, 2.0, 0.5), (2.0, -2.0, 2.0)):
        assert collide.collide(A, B, EYE, shifted(*shift), algorithm=WALK)
        beyond = (np.nextafter(shift[0], 3), *shift[1:])
        assert not collide.collide(A, B, EYE, shifted(*beyond), algorithm=WALK)


def test_bodies_without_interior():
    """One of them has an interior and plays R; of two flat ones the second, thickened for the walk, plays it."""
    square = collide.ConvexHull([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 0), (0.5, 0, 0)])
    segment, point = collide.ConvexHull([(0, 0, 0), (0, 0, 3), (0, 0, 1)]), collide.ConvexHull([(0, 0, 0)])
    angle = np.linspace(0, 2 * np.pi, 900, endpoint=False)
    disc = collide.ConvexHull(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    box, rng = collide.Box((1, 1, 1)), np.random.default_rng(4)
    X_WA = np.array([turned(rng, rng.uniform(0, 1.6)) for _ in range(200)])
    for flat in (square, segment, point, disc):
        for A, B in ((flat, box), (box, flat)):
            found = collide.walk(A, B, X_WA, EYE[None])
            assert found.exchanged == (B is flat) and found.depth_q > 1
            assert (found.hit == collide.collide(A, B, X_WA, EYE)).all()
            assert found.walked.mean() > 0.9
        both = collide.walk(flat, square, X_WA, EYE[None])
        assert both.walked.all() and both.depth_p and not both.exchanged
        assert (both.hit == collide.collide(flat, square, X_WA, EYE)).all()
    X = np.array([turned(rng, rng.uniform(0.5, 1.6)) for _ in range(100)])
    assert max(collide.walk(disc, box, X, EYE[None]).rows["rounds"]) > 8


def test_matrices_that_are_no_rotations():
    """R is taken as given: its inverse is its adjugate over its determinant, not its transpose."""
    rng = np.random.default_rng(8)
    A, B = ball(rng, 40), ball(rng, 50)
    for _ in range(60):
        X_WA, X_WB = turned(rng, rng.uniform(0.5, 2.5)), turned(rng, 0.3)
        X_WA[:3, :3] += 0.2 * rng.standard_normal((3, 3))
        X_WB[:3, :3] += 0.2 * rng.standard_normal((3, 3))
        truth = exact.hit(A.points, X_WA[:3, :3], X_WA[:3, 3], B.points, X_WB[:3, :3], X_WB[:3, 3])
        found = collide.walk(A, B, X_WA, X_WB, check_poses=False)
        assert found.hit.tolist() == [truth]


def test_large_stars_and_facets():
    """Bipyramids, prisms: a vertex, or a facet, with thousands of neighbours."""
    rng, angle = np.random.default_rng(2), np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    up = np.array([[0.0, 0.0, 1.0]])
    bipyramid = collide.ConvexHull(np.concatenate([ring, [(0, 0, 1), (0, 0, -1)]]))
    prism = collide.ConvexHull(np.concatenate([ring + up, ring - up]))
    for A, B in ((bipyramid, prism), (prism, bipyramid), (bipyramid, bipyramid)):
        X_WA = np.array([turned(rng, rng.uniform(0.5, 2.4)) for _ in range(150)])
        X_WA[:40, :3, :3] = np.eye(3)  # apex against facet, apex against apex
        X_WA[:40, :3, 3] = [(0.01 * k, 0, 1.9 + 0.005 * k) for k in range(40)]
        found = collide.walk(A, B, X_WA, EYE[None])
        assert (found.hit == collide.collide(A, B, X_WA, EYE)).all()
        assert found.walked.mean() > 0.8


# --- proofs, counts, sameness -----------------------------------------------------------------------


def test_answers_keep_poses_of_their_own():
    box, X_WB = collide.Box((1, 1, 1)), shifted(0.5)
    found, before = collide.walk(box, box, EYE, X_WB), X_WB.copy()
    X_WB[0, 3] = 9.0
    collide.verify(box, box, EYE, before, found)


@pytest.mark.slow
def test_every_answer_of_the_walk_is_proven_and_the_proof_checks():
    """In rational numbers: the plane against all vertices, or the point against all facets."""
    rng = np.random.default_rng(12)
    A, B = ball(rng, 60), ball(rng, 80)
    X_WA = np.array([turned(rng, rng.uniform(0.5, 2.5)) for _ in range(40)])
    found = collide.walk(A, B, X_WA, EYE[None])
    assert found.walked.all()
    Q, _ = exact.world_points(B.points, EYE[:3, :3], EYE[:3, 3])
    for X, row, hit in zip(X_WA, found.rows, found.hit):
        assert row["status"] == (MEETING if hit else APART)
        if not hit:
            P, e_p = exact.world_points(A.points, X[:3, :3], X[:3, 3])
            Q, e_q = exact.world_points(B.points, EYE[:3, :3], EYE[:3, 3])
            (axis,), _ = exact.world_points([row["axis"]], EYE[:3, :3], EYE[:3, 3])
            P = [tuple(c << (e_p - min(e_p, e_q)) for c in p) for p in P]
            Q = [tuple(c << (e_q - min(e_p, e_q)) for c in q) for q in Q]
            assert max(exact.dot(axis, p) for p in P) < min(exact.dot(axis, q) for q in Q)
        else:
            (one,) = collide.walk(A, B, X, EYE).certificate
            point = common_point(A, B, X, EYE, one.pairs)
            for body, pose in ((A, X), (B, EYE)):
                assert is_inside(body, pose, point)
                assert not is_inside(body, pose, [c + 3 for c in point])


@pytest.mark.parametrize("name", ["rand_pen", "near_sep", "touch_ee", "touch_1ulp", "flat", "degenerate"])
def test_every_answer_has_a_certificate_that_verifies(name):
    for case in polytopes(name, 6, 9):
        A, B, X_WA, X_WB = case.shapes()
        found = collide.walk(A, B, X_WA, X_WB)
        collide.verify(A, B, X_WA, X_WB, found)
        (one,) = found.certificate
        assert one.kind in (("together",) if found.hit[0] else ("plane", "apart"))
        with pytest.raises(collide.CertificateRefused):
            wrong = one._replace(kind="apart" if found.hit[0] else "together")
            collide.verify(A, B, X_WA, X_WB, found, certificate=(wrong,))


def moved_exactly(body, X, vertex: int) -> list[Fraction]:
    R, t = X[:3, :3].tolist(), X[:3, 3].tolist()
    p = [Fraction(c) for c in body.points[vertex].tolist()]
    return [Fraction(t[i]) + sum(Fraction(R[i][j]) * p[j] for j in range(3)) for i in range(3)]


def common_point(A, B, X_WA, X_WB, pairs) -> list[Fraction]:
    """The point of A that a certificate's vertex pairs say is one of B too, checked to be the same, in fractions."""
    corners_a = [moved_exactly(A, X_WA, i) for i, _ in pairs]
    corners_b = [moved_exactly(B, X_WB, j) for _, j in pairs]
    scale = 1
    for c in (c for p in (*corners_a, *corners_b) for c in p):
        scale = max(scale, c.denominator)
    _, total, carrier = nearest_to_origin(
        [tuple(int((x - y) * scale) for x, y in zip(p, q)) for p, q in zip(corners_a, corners_b)]
    )
    rows = [tuple(int((x - y) * scale) for x, y in zip(corners_a[k], corners_b[k])) for k in carrier]
    weights = [Fraction(w, total) for w in weights_towards_origin(rows)]
    of_a, of_b = (
        [sum(w * corners[k][i] for w, k in zip(weights, carrier)) for i in range(3)]
        for corners in (corners_a, corners_b)
    )
    assert of_a == of_b and min(weights) > 0 and sum(weights) == 1
    return of_a


def is_inside(body, X, point) -> bool:
    """In fractions, against every facet."""
    for a, b, c in body.hull.facets.tolist():
        p, q, r = (moved_exactly(body, X, v) for v in (a, b, c))
        if exact.dot(exact.cross(exact.minus(q, p), exact.minus(r, p)), exact.minus(point, p)) > 0:
            return False
    return True


def test_planes_of_the_walk_are_certificates_by_substitution():
    """The walk's plane stands in the certificate as it is; another one is refused. A plane parts a mesh of the same
    vertices as well, and none that meets A."""
    rng = np.random.default_rng(14)
    A, B = ball(rng, 60), ball(rng, 80)
    X_WA = np.array([turned(rng, 2.3) for _ in range(10)])
    for X in X_WA:
        found = collide.walk(A, B, X, EYE)
        (one,) = found.certificate
        assert not found.hit[0] and one.kind == "plane"
        (normal,) = one.pairs
        axis = [Fraction(c) for c in found.rows["axis"][0].tolist()]
        assert exact.cross(axis, normal) == (0, 0, 0) and exact.dot(axis, normal) < 0
        collide.verify(A, B, X, EYE, found)
        for wrong in (tuple(-c for c in normal), (0, 0, 0), (1, 2), (0.5, 1, 1)):
            with pytest.raises(collide.CertificateRefused):
                collide.verify(A, B, X, EYE, found, certificate=(one._replace(pairs=(wrong,)),))
    mesh = collide.Mesh(B.points, B.hull.facets)
    collide.verify(A, mesh, X, EYE, collide.distance(A, mesh, X, EYE), certificate=(one,))
    with pytest.raises(collide.CertificateRefused):
        collide.verify(A, mesh, EYE, EYE, collide.distance(A, mesh, EYE, EYE), certificate=(one,))


def test_the_checking_mode_sees_what_is_wrong():
    rng = np.random.default_rng(21)
    A, B = ball(rng, 80), ball(rng, 80)
    X_WA, X_WB = turned(rng, 1.85), turned(rng, 0.0)
    found = collide.walk(A, B, X_WA, X_WB, trace=True)
    good = found.trace
    assert len(good) > 6
    validate_rounds(A._walk, B._walk, X_WA, X_WB, good)
    for number in (1, len(good) - 1):
        one = good[number]
        own = "z" if one.invariant == "separation" else "x"
        for changed in (
            one._replace(**{own: 2.0 * getattr(one, own) + 0.5}), one._replace(level_p=one.level_p + 1),
            one._replace(vertex_p=-1, vertex_q=-1), one._replace(p_star=10**6, q_star=10**6),
        ):
            with pytest.raises(AssertionError):
                validate_rounds(A._walk, B._walk, X_WA, X_WB, (*good[:number], changed, *good[number + 1 :]))


def test_what_proofs_rest_on():
    """Facets go with their polar points, and the ball about the origin lies inside, exactly."""
    rng = np.random.default_rng(22)
    lattice = collide.ConvexHull(rng.integers(-3, 4, (60, 3)).astype(float))
    for body in (ball(rng, 40), collide.Box((1, 2, 3)), lattice):
        side = walk_body(body).polar
        points = walk_body(body).points
        origin = [Fraction(c) for c in side.origin.tolist()]
        assert side.radius > 0 and len(side.starts) == len(side.body.points) + 1
        for k, q in enumerate(side.body.points):
            triangles = side.triangles[side.starts[k] : side.starts[k + 1]]
            assert len(triangles)
            for a, b, c in points[triangles].tolist():
                heights = (np.array([a, b, c]) - side.origin) @ q
                assert np.abs(heights - 1).max() < 1e-9
                a, b, c = ([Fraction(v) - o for v, o in zip(p, origin)] for p in (a, b, c))
                n = exact.cross(exact.minus(b, a), exact.minus(c, a))
                assert exact.dot(n, a) > 0
                assert exact.dot(n, a) ** 2 >= Fraction(side.radius) ** 2 * exact.dot(n, n)


def sides_split_by_rounding() -> dict:
    """Polytopes whose flat sides are many facets in doubles, since they are turned."""
    rng, angle, up = np.random.default_rng(31), np.arange(40) * np.pi / 20, np.array([0.0, 0.0, 1.0])
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    cube = np.argwhere(np.ones((2, 2, 2))) * 2.0 - 1.0
    points = {
        "cube": cube, "flat box": cube * (1.0, 0.3, 0.1), "grid cube": np.argwhere(np.ones((5, 5, 5))) * 0.5 - 1.0,
        "prism of 40": np.concatenate([ring + up, ring - up]),
        "cone of 40": np.concatenate([ring, [(0, 0, 1)]]),
    }
    return {name: collide.ConvexHull(own @ turned(rng, 0.0)[:3, :3].T) for name, own in points.items()}


def test_invariants_hold_where_rounding_split_flat_sides():
    """Polar points an ulp apart: of each cluster one is kept, or the walk looks around the wrong one."""
    rng, shapes = np.random.default_rng(32), sides_split_by_rounding()
    prism = walk_body(shapes["prism of 40"]).polar
    assert len(prism.body.points) == 42 < len(prism.body.groups)
    shapes["ball"] = ball(rng, 60)
    for name, R in shapes.items():
        for other in ("ball", "prism of 40", "cube"):
            P = shapes[other]
            for _ in range(40):
                X_WP = turned(rng, rng.uniform(0, 2))
                found = collide.walk(P, R, X_WP, EYE, trace=True)
                assert found.hit[0] == collide.collide(P, R, X_WP, EYE)
                try:
                    validate_rounds(P._walk, R._walk, X_WP, EYE, found.trace)
                except AssertionError as error:
                    raise AssertionError(f"{error}\n{other} against {name}, X_WP = {X_WP.tolist()}") from None


def test_deep_hits_are_proven_where_rounding_split_flat_sides():
    """The ray from the centre leaves by another sliver than the tangent one, and slivers' planes are known loosely."""
    rng = np.random.default_rng(33)
    small = ball(rng, 40, (0.05, 0.05, 0.05))
    for name, R in sides_split_by_rounding().items():
        assert walk_body(R).polar.radius > 0
        X_WA = np.array([turned(rng, rng.uniform(0, 1.2)) for _ in range(200)])
        found, truth = collide.walk(small, R, X_WA, EYE), collide.distance(small, R, X_WA, EYE)
        assert (found.hit == truth.hit).all()
        deep = truth.distance < -1e-6
        assert deep.sum() >= 8 and found.walked[deep].all(), (name, X_WA[deep & ~found.walked][:1].tolist())


def test_a_body_whose_walk_is_lost_is_handed_over(monkeypatch):
    """Small programs that say they could not be solved: every answer comes from the default, and is right."""
    rng = np.random.default_rng(23)
    A, B = ball(rng, 50), ball(rng, 50)
    X_WA = np.array([turned(rng, rng.uniform(0.8, 2.1)) for _ in range(20)])
    truth = collide.collide(A, B, X_WA, EYE)

    def lost(body_p, body_r, packed_p, packed_r, X_WP, X_WR, *, trace=False):
        return no_walks(len(X_WP)), ()

    monkeypatch.setattr("collide.papers.hierarchies.hierarchy_queries.run_walks", lost)
    found = collide.walk(A, B, X_WA, EYE[None])
    assert not found.walked.any() and (found.rows["status"] == LOST).all() and (found.hit == truth).all()


def test_rounds_grow_with_the_logarithm():
    rng = np.random.default_rng(1)
    most = []
    for n in (30, 300, 3000):
        A, B = ball(rng, n), ball(rng, n)
        X_WA = np.array([turned(rng, rng.uniform(1.6, 2.0)) for _ in range(200)])
        found = collide.walk(A, B, X_WA, EYE[None])
        a_round = found.rows["tests"] / found.rows["rounds"]
        assert (a_round > 0).all() and a_round.mean() < 12 and a_round.max() < 40, "a round is O(1)"
        most.append(int(found.rows["rounds"].max()))
    assert most[2] <= 12 + 3.5 * 2 * np.log2(3000) and most[2] < 2.5 * most[1]


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["bipyramid", "cone", "prism", "degree doubling", "moment curve"])
def test_tests_a_round_do_not_grow_with_a_degree(kind):
    """Bodies with a vertex or a facet of degree n: a mean of a few tests a round, at eight times the vertices too."""
    make = {
        "bipyramid": families.bipyramid, "cone": families.cone, "prism": lambda n: families.prism(n // 2),
        "degree doubling": lambda n: families.degree_doubling(round(np.log2(n / 3))),
        "moment curve": families.moment_curve,
    }[kind]
    rng, farthest = rng_of("tests a round", kind), 4.0 if kind == "prism" else 2.5  # it is longer
    means = []
    for n in (800, 6400):
        A, B = collide.ConvexHull(make(n)), collide.ConvexHull(make(n))
        X_WA = np.array([turned(rng, rng.uniform(0.3, farthest)) for _ in range(150)])
        found = collide.walk(A, B, X_WA, EYE[None])
        assert 0.1 < found.hit.mean() < 0.9 and found.walked.all(), (kind, n, found.hit.mean())
        means.append(found.rows["tests"].sum() / found.rows["rounds"].sum())
    assert max(means) < 12.0 and means[1] < 1.25 * means[0], (kind, means)


def test_same_bits_single_batch_and_from_threads():
    rng = np.random.default_rng(7)
    A, B = ball(rng, 100), ball(rng, 100)
    X_WA = np.array([turned(rng, rng.uniform(1.5, 2.1)) for _ in range(50)])
    together = collide.walk(A, B, X_WA, EYE[None])
    singly = np.concatenate([collide.walk(A, B, X, EYE).rows for X in X_WA])
    assert together.rows.tobytes() == singly.tobytes()
    again, threads = [], []
    for _ in range(4):
        fresh_a, fresh_b = collide.ConvexHull(A.points), collide.ConvexHull(B.points)
        run = lambda a=fresh_a, b=fresh_b: again.append(collide.walk(a, b, X_WA, EYE[None]).rows)
        threads.append(threading.Thread(target=run))
        threads[-1].start()
    for thread in threads:
        thread.join()
    assert len(again) == 4 and all(rows.tobytes() == together.rows.tobytes() for rows in again)


PLAIN = """
import pickle, sys
import collide
from collide import kernels
assert kernels.PLAIN_PYTHON
asked = pickle.load(sys.stdin.buffer)
pickle.dump([collide.walk(*case).rows.tobytes() for case in asked], sys.stdout.buffer)
"""


def test_kernels_are_plain_python_too():
    rng = np.random.default_rng(10)
    asked = [c.shapes() for name in ("rand_pen", "touch_ff", "flat", "needles") for c in polytopes(name, 2, 3)]
    asked.append((ball(rng, 25), ball(rng, 25), turned(rng, 1.9), turned(rng, 0.0)))
    child = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PLAIN], input=pickle.dumps(asked), capture_output=True, check=False,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(Path(collide.__file__).parent.parent)},
    )
    assert child.returncode == 0, child.stderr.decode()
    assert pickle.loads(child.stdout) == [collide.walk(*case).rows.tobytes() for case in asked]


def test_shapes_that_are_polytopes():
    box = collide.Box((1, 2, 3))
    slab = collide.HPolytope([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], [1, 1, 1, 1, 1, 1])
    for shift, hit in ((0.5, True), (1.4, True), (1.6, False)):
        assert collide.collide(box, slab, EYE, shifted(shift), algorithm=WALK) is hit
        assert collide.collide(slab, box, EYE, shifted(shift), algorithm=WALK) is hit
    assert collide.collide(box, slab, np.array([EYE] * 3), EYE, algorithm=WALK).tolist() == [True] * 3
    assert len(collide.collide(box, slab, np.zeros((0, 4, 4)), EYE, algorithm=WALK)) == 0


def test_what_it_refuses():
    box = collide.Box((1, 1, 1))
    for shape in (
        collide.Sphere(1), collide.Capsule(1, 1), collide.Cylinder(1, 1), collide.Halfspace((0, 0, 1), 0),
        collide.ConvexHull(np.eye(3), radius=0.1), collide.Compound([(box, EYE), (box, shifted(2))]),
    ):
        for A, B in ((shape, box), (box, shape)):
            with pytest.raises(collide.UnsupportedQuery, match=type(shape).__name__):
                collide.collide(A, B, EYE, EYE, algorithm=WALK)
    for wrong in ("quick", np.array(["gjk", "gjk"]), 3):
        with pytest.raises(collide.InvalidArgument, match="gjk"):
            collide.collide(box, box, EYE, EYE, algorithm=wrong)
    with pytest.raises(collide.InvalidArgument, match="axes"):
        collide.collide(box, box, EYE[None], EYE, algorithm=WALK, axes=np.zeros((1, 3)))
    with pytest.raises(collide.InvalidArgument, match="A must be a shape"):
        collide.collide([box], box, EYE[None], EYE, algorithm=WALK)
    with pytest.raises(collide.InvalidPose):
        collide.collide(box, box, 2 * EYE, EYE, algorithm=WALK)
    assert collide.collide(box, box, EYE, EYE, algorithm="gjk") is True
