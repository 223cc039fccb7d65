"""Certificates of meshes whose hulls meet, of meshes beside curved shapes, and of unions of all of these."""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
import pytest
from claimed_result import Claim
from curved_oracle import bracket
from hollow_bodies import torus
from mesh_families import random_pose, right_angle_pose
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of

import collide
from collide.certificates.certificate import CertificateRefused
from collide.results import UNDECIDED

EYE = np.eye(4)


def shapes() -> list:
    ring, half_box = collide.Mesh(*block_ring()), collide.Mesh(box()[0], box()[1][2:])
    union = collide.Compound([
        (ring, collide.pose((0.3, 0, 0))), (collide.Cylinder(0.1, 3), collide.pose((2, 0, 0))),
        (half_box, collide.pose((0, 2, 0))),
    ])
    convex = collide.Compound([
        (collide.Box((0.2, 0.2, 0.2)), collide.pose((0.3, 0, 0))), (collide.Cone(0.1, 1), collide.pose((0.3, 0, 0.5))),
    ])
    return [
        collide.Mesh(*box()), ring, collide.Mesh(*bumpy_sphere(60)), half_box, union, collide.Cylinder(0.4, 0.9),
        collide.Cone(0.2, 1.2), collide.Ellipsoid((0.1, 0.3, 0.5)), collide.Capsule(0.1, 0.6), convex,
        collide.Halfspace((0, 0, 1), -0.5),
    ]


@pytest.mark.many(6)
@pytest.mark.parametrize("seed", range(12))
def test_every_decided_answer_has_a_certificate(seed):
    rng, pool, seen = rng_of(f"certificates of meshes {seed}"), shapes(), Counter()
    for k in range(25):
        A, B = pool[rng.integers(5)], pool[rng.integers(len(pool))]
        X_WA, X_WB = (random_pose(rng) if k % 2 else right_angle_pose(rng) for _ in range(2))
        if k % 3 == 0:
            X_WB[:3, 3] *= 1.5
        question = (A, B, X_WA, X_WB) if k % 4 else (B, A, X_WB, X_WA)
        r = collide.distance(*question, signed=bool(k % 2))
        if r.how == UNDECIDED:
            continue
        assert r.certificate is not None, (k, question, r)
        collide.verify(*question, r, certificate=json.loads(json.dumps(r.certificate)))
        with pytest.raises(CertificateRefused):
            collide.verify(*question, Claim(not r.hit, r.certificate))
        seen[r.certificate[0].kind] += 1
    assert seen["point"] > 1 and seen["plane"] > 1, seen


LINKED = collide.pose((1, 0.02, 0.01), rpy=(np.pi / 2, 0.1, 0))
THROUGH = collide.pose((0.05, 0, 0), rpy=(0.1, 0.05, 0))


@pytest.mark.many(3)
@pytest.mark.parametrize("B, X_WB", [
    (torus(1.0, 0.3, 20, 12), LINKED), (collide.Cylinder(0.5, 3), THROUGH), (collide.Ellipsoid((0.5, 0.5, 3)), THROUGH),
    (collide.Capsule(0.5, 3), THROUGH),
    (collide.Compound([(collide.Cylinder(0.5, 3), EYE), (torus(1.0, 0.3, 10, 6), collide.pose((0, 0, 1)))]), THROUGH),
], ids=["link", "cylinder", "ellipsoid", "capsule", "union"])
def test_planes_between_linked_bodies_are_few(B, X_WB):
    A = torus(1.0, 0.3, 20, 12)
    r = collide.distance(A, B, EYE, X_WB)
    assert not r.hit and 4 < len(r.certificate) < 60 and len(json.dumps(r.certificate)) < 2000
    collide.verify(A, B, EYE, X_WB, r)
    for k in range(len(r.certificate)):
        with pytest.raises(CertificateRefused, match="no plane parts"):
            collide.verify(A, B, EYE, X_WB, r, certificate=r.certificate[:k] + r.certificate[k + 1 :])


def test_a_link_that_only_just_is_open():
    """Facets 2^-50 apart: the planes are found in integers."""
    A, B = collide.Mesh(*box()), collide.Mesh(*block_ring())
    for gap in (2.0**-50, 0.0, -(2.0**-50)):
        high = B.vertices[:, 2].max() - A.vertices[:, 2].min() + gap
        X_WA = collide.pose((0, 0, high))
        r = collide.distance(A, B, X_WA, EYE)
        assert r.hit == (gap <= 0.0)
        collide.verify(A, B, X_WA, EYE, r)


def test_booleans_are_the_oracles():
    rng, seen = rng_of("meshes and curved shapes, the oracle"), Counter()
    A, can = collide.Mesh(*block_ring()), collide.Cone(0.3, 1.2)
    for _ in range(6):
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        r = collide.distance(A, can, X_WA, X_WB)
        judged = bracket(A, can, X_WA, X_WB, depths=False)
        assert judged.hit is None or judged.hit == (r.certificate[0].kind == "point"), (X_WA, X_WB)
        seen[judged.hit] += 1
    assert seen[True] and seen[False], seen


def test_a_curved_body_inside_a_solid():
    A = collide.Mesh(*bumpy_sphere(60))
    two = collide.Compound([(collide.Cone(0.1, 0.1), EYE), (collide.Sphere(0.1), EYE)])
    for B in (collide.Cylinder(0.1, 0.1), two):
        r = collide.distance(A, B, EYE, EYE)
        assert r.hit and (r.certificate[0].kind, r.certificate[0].part_a) == ("point", -1)
        collide.verify(A, B, EYE, EYE, r)
        with pytest.raises(CertificateRefused, match="does not hold"):
            collide.verify(A, B, EYE, collide.pose((5, 0, 0)), r)
