"""Certificates of curved pairs, of unions with curved parts and of half-spaces, judged by decimals of 80 digits."""

from __future__ import annotations

import json
import pickle
from collections import Counter
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from claimed_result import Claim
from curved_cells import CONTEXT
from curved_oracle import Body, away_from
from naive import random_pose, rng_of
from touching_pairs import KINDS, OTHERS, body, exact_pair, near_pair

import collide
from collide.certificates.certificate import Certificate, CertificateRefused
from collide.certificates.exact_parts import exact_parts
from collide.certificates.proof_search import common_point, exact_normal, parting_normal, quick_normal
from collide.results import UNDECIDED

EYE = np.eye(4)


def proves(A, B, X_WA, X_WB, certificate: Certificate) -> bool:
    """Whether a "point" or a "plane" is what a certificate of convex bodies says, to 60 digits and 1e-15."""
    (row,) = certificate.pairs
    if certificate.kind == "point":
        x = [Fraction(c, row[3]) for c in row[:3]]
        size = float(Body(A, X_WA).scale + Body(B, X_WB).scale)
        return max(away_from(A, X_WA, x), away_from(B, X_WB, x)) <= 1e-15 * size
    with localcontext(CONTEXT):
        (a,), (b,) = Body(A, X_WA).cells, Body(B, X_WB).cells
        n, down = tuple(map(Decimal, row)), tuple(Decimal(-c) for c in row)
        length = sum(Decimal(c) ** 2 for c in row).sqrt()
        sums = a.support(down)[0] + b.support(n)[0] + (a.radius + b.radius) * length
        return sums < Decimal("1e-60") * length


def test_pairs_that_touch_and_pairs_beside():
    """Each decided row has a certificate, which proves its claim and not the opposite."""
    rng, seen = rng_of("certificates of curved pairs"), Counter()
    for k in range(60):
        pair = exact_pair(rng) if k % 2 else near_pair(rng)
        if k % 3 == 0:
            X_WB = pair.X_WB.copy()
            X_WB[:3, 3] += rng.normal(size=3) * 10.0 ** rng.integers(-14, 1)
            pair = pair._replace(X_WB=X_WB)
        _check(pair, seen, signed=bool(k % 5))
    assert seen["point"] > 20 and seen["plane"] > 10 and not seen["undecided"], seen


@pytest.mark.slow
def test_many_pairs_that_touch_and_pairs_beside():
    rng, seen = rng_of("many certificates of curved pairs"), Counter()
    for k in range(2000):
        scale = 2.0 ** int(rng.integers(-30, 31)) if k % 3 == 0 else 1.0
        pair = exact_pair(rng, scale, 2.0**-40 if k % 7 == 0 else 1.0) if k % 2 else near_pair(rng, scale)
        _check(pair, seen, signed=bool(k % 5))
    assert seen["point"] > 1000 and seen["plane"] > 300 and not seen["undecided"], seen


def _check(pair, seen: Counter, signed: bool) -> None:
    question = pair[:4]
    r = collide.distance(*question, signed=signed, check_poses=False)
    if r.how == UNDECIDED:
        seen["undecided"] += 1
        return
    (certificate,) = r.certificate
    collide.verify(*question, r)
    assert certificate.kind == ("point" if r.hit else "plane"), pair
    assert proves(*question, certificate), (pair, certificate)
    assert pickle.loads(pickle.dumps(r.certificate)) == r.certificate
    collide.verify(*question, r, certificate=json.loads(json.dumps(r.certificate)))
    with pytest.raises(CertificateRefused):
        collide.verify(*question, Claim(not r.hit, r.certificate))
    seen[certificate.kind] += 1


def test_half_spaces():
    rng, seen = rng_of("certificates of half-spaces"), Counter()
    for k in range(120):
        A, features = body((*KINDS, *OTHERS)[k % 10], rng)
        floor = collide.Halfspace((0, 0, 1), 0.25)
        X_WA, X_WB = EYE.copy(), EYE
        if k % 2:  # on the plane exactly, or an ulp off
            low = min(f.point[2] for f in features)
            X_WA[2, 3] = float(Fraction(1, 4) - low) + (k % 3 - 1) * 2.0**-50
        else:
            X_WA, X_WB = random_pose(rng), random_pose(rng)
        for question in ((A, floor, X_WA, X_WB), (floor, A, X_WB, X_WA)):
            r = collide.distance(*question)
            if r.how == UNDECIDED:
                continue
            collide.verify(*question, r)
            seen[r.certificate[0].kind, r.hit] += 1
            with pytest.raises(CertificateRefused):
                collide.verify(*question, Claim(not r.hit, r.certificate))
    assert seen["point", True] > 20 and seen["plane", False] > 15, seen


def test_two_half_spaces():
    floor, below = collide.Halfspace((0, 0, 1), 0.0), np.diag([1.0, -1.0, -1.0, 1.0])
    tilted = collide.pose((1, 0, 0), rpy=(1, 2, 3))
    for X_WB, hit in ((EYE, True), (collide.pose((0, 0, 1)), True), (below, True), (tilted, True),
                      (collide.pose((0, 0, 1)) @ below, False), (collide.pose((0, 0, -1)) @ below, True)):
        for A in (floor, collide.Compound([(floor, EYE)])):
            r = collide.distance(A, floor, EYE, X_WB, signed=False)
            assert r.hit == hit and r.certificate[0].kind == ("point" if hit else "plane")
            collide.verify(A, floor, EYE, X_WB, r)
            with pytest.raises(CertificateRefused):
                collide.verify(A, floor, EYE, X_WB, Claim(not hit, r.certificate))


def test_unions_with_curved_parts():
    rng, seen = rng_of("unions with curved parts"), Counter()
    for k in range(40):
        A, B = (
            collide.Compound([(body((*KINDS, *OTHERS)[rng.integers(10)], rng)[0], random_pose(rng)) for _ in range(3)])
            for _ in range(2)
        )
        if k % 4 == 0:  # nested: poses are multiplied exactly
            A = collide.Compound([(A, random_pose(rng))])
        question = A, B, random_pose(rng), random_pose(rng, 1.5 + 3.0 * (k % 2))
        r = collide.distance(*question)
        certificates = r.certificate
        assert len(certificates) == (1 if r.hit else 9)
        collide.verify(*question, r)
        seen[r.hit] += 1
        with pytest.raises(CertificateRefused):
            collide.verify(*question, Claim(not r.hit, certificates))
        if not r.hit:
            with pytest.raises(CertificateRefused, match="9 pairs of parts, 8"):
                collide.verify(*question, r, certificate=certificates[:4] + certificates[5:])
    assert seen[True] > 5 and seen[False] > 5, seen


def test_distances_beyond_the_question_are_proven_too():
    question = collide.Cone(1, 1), collide.Ellipsoid((1, 2, 3)), EYE, collide.pose((9, 1, 0))
    r = collide.distance(*question, max_distance=0.5)
    assert r.beyond and r.certificate[0].kind == "plane"
    collide.verify(*question, r)


def test_what_doubles_miss_is_found_in_integers():
    """Gaps of some 2^-52 of the size: no direction of few bits parts the bodies, one of integers does."""
    missed = 0
    for seed in range(8):
        pair = near_pair(rng_of(f"missed {seed}"))
        (a,), (b,) = exact_parts(pair.A, pair.X_WA), exact_parts(pair.B, pair.X_WB)
        r = collide.distance(*pair[:4], check_poses=False)
        quick, n = quick_normal(a, b), parting_normal(a, b)
        assert (n is None) == r.hit and (quick is None or n == quick), pair
        assert (common_point(a, b) is None) != r.hit, pair
        if quick is None and not r.hit:
            assert n == exact_normal(a, b), pair
            missed += 1
    assert missed > 1, missed
