"""Forged certificates: of the opposite claim all are refused, and nothing but CertificateRefused is ever raised."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from claimed_result import Claim
from mesh_shapes import block_ring, box
from naive import rng_of

import collide

EYE = np.eye(4)
KINDS = ("apart", "together", "inside", "plane", "point", "", "Plane", "point ")


def questions() -> list[tuple]:
    """(a question of bodies that meet, one of the same bodies apart), the poses near each other but for the last."""
    ring, cube, can = collide.Mesh(*block_ring()), collide.Mesh(*box()), collide.Cylinder(0.25, 0.5)
    cone, egg = collide.Cone(0.25, 0.5), collide.Ellipsoid((0.25, 0.5, 0.125))
    union = collide.Compound([(can, EYE), (cone, collide.pose((0, 0, 0.5)))])
    meshes = collide.Compound([(ring, EYE), (egg, collide.pose((5, 0, 0)))])
    pairs = [
        (can, egg, (0.5, 0, 0), (0.5000001, 0, 0)), (cone, can, (0.5, 0, -0.25), (0.5000001, 0, -0.25)),
        (can, collide.Halfspace((0, 0, 1), 0.0), (0, 0, -0.25), (0, 0, -0.2500001)),
        (union, egg, (0.5, 0, 0), (0.6, 0, 0)),
        (union, union, (0.5, 0, 0), (0.5000001, 0, 0)), (can, collide.Box((1, 1, 1)), (0.75, 0, 0), (0.7500001, 0, 0)),
        (egg, collide.Capsule(0.25, 0.5), (0.5, 0, 0), (0.5000001, 0, 0)),
        (cube, cone, (1.25, 0, 0), (1.2500001, 0, 0)),
        (cube, cube, (2, 0, 0), (2.0000001, 0, 0)), (meshes, can, (5.25, 0, 0), (6, 0, 0)),
    ]
    surface = collide.Mesh(ring.vertices, ring.faces, solid=False)
    pairs.append((surface, can, (0.4, 0.3, 0.1), (1, 0, 0)))
    return [tuple((A, B, EYE, collide.pose(place)) for place in places) for A, B, *places in pairs]


def _number(rng):
    return [
        0, 1, -1, int(rng.integers(-9, 10)), int(rng.integers(-(2**60), 2**60)), 10**400, -(10**60), 1 << 140000,
        math.nan, math.inf, 0.5, None, "1", np.int64(3), np.float64(2.0), True, (1,), 1.0,
    ][rng.integers(18)]


def _forged(rng, certificates, foreign):
    """A certificate with something changed: of this pair, of another one, or made up."""
    rows = [list(c) for c in (certificates if rng.random() < 0.7 else foreign)]
    rows = [[kind, i, j, [list(p) for p in pairs]] for kind, i, j, pairs in rows]
    for _ in range(int(rng.integers(1, 4))):
        if not rows:
            break
        row = rows[rng.integers(len(rows))]
        change = rng.integers(9)
        if change == 0:
            row[0] = KINDS[rng.integers(len(KINDS))]
        elif change in (1, 2):
            row[change] = _number(rng)
        elif change in (3, 4) and _is_rows(row[3]):
            numbers = row[3][rng.integers(len(row[3]))]
            k = rng.integers(len(numbers))
            whole = isinstance(numbers[k], int) and numbers[k].bit_length() < 500
            numbers[k] = numbers[k] + int(rng.integers(-3, 4)) if whole and change == 4 else _number(rng)
        elif change == 5:
            row[3] = [[_number(rng) for _ in range(int(rng.integers(0, 6)))] for _ in range(int(rng.integers(0, 4)))]
        elif change == 6:
            rows.remove(row)
        elif change == 7:
            rows.append([row[0], row[2], row[1], row[3]])
        else:
            row[3] = [0, None, "x", row, [row[3]], (), [[]]][rng.integers(7)]
    return rows


def _is_rows(pairs) -> bool:
    return isinstance(pairs, list) and bool(pairs) and all(isinstance(p, list) and p for p in pairs)


def _tries(seed: str, count: int) -> Counter:
    rng, seen, pairs = rng_of(seed), Counter(), questions()
    results = [[collide.distance(*q) for q in both] for both in pairs]
    proofs = [[r.certificate for r in both] for both in results]
    for which in range(len(pairs)):
        assert [bool(r.hit) for r in results[which]] == [True, False] and all(proofs[which]), pairs[which]
    for _ in range(count):
        which, side = int(rng.integers(len(pairs))), int(rng.integers(2))
        question, hit = pairs[which][side], side == 0
        # The strongest forgery of the opposite claim is the proof of the pose beside it.
        forged = _forged(rng, proofs[which][1 - side], proofs[rng.integers(len(pairs))][rng.integers(2)])
        with pytest.raises(collide.CertificateRefused):
            collide.verify(*question, Claim(not hit, None), certificate=forged)
        forged = _forged(rng, proofs[which][side], proofs[rng.integers(len(pairs))][side])
        try:
            collide.verify(*question, Claim(hit, None), certificate=forged)
        except collide.CertificateRefused as error:
            assert str(error)
            seen["refused"] += 1
        else:
            seen["still true"] += 1
    return seen


def test_forgeries():
    seen = _tries("forged certificates", 150)
    assert seen["refused"] > 75 and seen["still true"] > 5, seen


@pytest.mark.slow
def test_ten_thousand_forgeries():
    seen = _tries("many forged certificates", 5000)
    assert seen["refused"] > 2500 and seen["still true"] > 150, seen


def test_whole_values_that_are_no_certificates():
    question = questions()[0][0]
    for given in (7, "x", {}, {"a": 1}, [None], [[]], [("plane", 0, 0, ((1, 2), (3, 4)))],
                  [("point", 0, 0, ((1, 2, 3),))],
                  [(["plane"], 0, 0, ((1, 2, 3),))], [(np.array(["plane"]), 0, 0, ((1, 2, 3),))], [], ()):
        for hit in (True, False):
            with pytest.raises(collide.CertificateRefused):
                collide.verify(*question, Claim(hit, None), certificate=given)
