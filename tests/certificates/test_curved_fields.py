"""Certificates of fields beside cylinders, cones and ellipsoids: each item one by one says what they must prove."""

from __future__ import annotations

import json
from collections import Counter
from unittest import mock

import numpy as np
import pytest
from claimed_result import Claim
from hollow_bodies import torus
from naive import random_pose, rng_of
from naive_certificates import items_of

import collide
from collide.certificates.certificate import CertificateRefused
from collide.results import UNDECIDED
from collide.shapes import height_field

EYE = np.eye(4)


@pytest.fixture(autouse=True)
def large_fields():
    """Every height field is one of too many cells to make triangles of all."""
    with mock.patch.object(height_field, "_MAX_MESHED", 0):
        yield


def fields(rng) -> dict:
    heights = rng.integers(-4, 5, (9, 8)) / 8
    return {
        "cloud": collide.PointCloud(rng.normal(size=(60, 3)), rng.uniform(0.01, 0.1, 60)),
        "terrain": collide.HeightField(heights, (0.25, 0.5), bottom=-3.0),
        "swept": collide.SweptMesh(torus(1.0, 0.3, 10, 6), 0.05),
    }


def bodies(rng) -> list:
    can = collide.Cylinder(0.15, 0.5)
    return [
        can, collide.Cone(0.2, 0.4), collide.Ellipsoid((0.1, 0.2, 0.3)),
        collide.Compound([(can, random_pose(rng, 0.3)), (collide.Box((0.1, 0.2, 0.3)), EYE)]),
    ]


@pytest.mark.parametrize("kind", ["cloud", "terrain", "swept"])
def test_every_decided_answer_has_a_certificate(kind):
    rng, seen = rng_of(f"curved bodies and fields {kind}"), Counter()
    for k in range(12):
        field, body = fields(rng)[kind], bodies(rng)[k % 4]
        X_WF, X_WB = random_pose(rng, 0.2), random_pose(rng, 1.2)
        question = (field, body, X_WF, X_WB) if k % 3 else (body, field, X_WB, X_WF)
        r = collide.distance(*question)
        if r.how == UNDECIDED:
            continue
        certificate = json.loads(json.dumps(r.certificate))
        collide.verify(*question, r, certificate=certificate)
        with pytest.raises(CertificateRefused):
            collide.verify(*question, Claim(not r.hit, r.certificate))
        if kind != "swept":  # a solid has an inside besides its items
            met = any(
                collide.collide(collide.ConvexHull(np.unique(points, axis=0), radius=radius), body, X_WF, X_WB)
                for points, radius in items_of(field)
            )
            assert met == r.hit, question
        seen[r.certificate[0].kind] += 1
        if not r.hit:
            with pytest.raises(CertificateRefused):
                collide.verify(*question, r, certificate=[])
    assert seen["plane"] > 1 and seen["point"] > 1, seen


def test_a_curved_body_inside_a_solid_with_thickness():
    solid = collide.SweptMesh(torus(1.0, 0.3, 10, 6), 0.01)
    middle = collide.pose(tuple(0.5 * (solid.mesh.vertices[:6].min(axis=0) + solid.mesh.vertices[:6].max(axis=0))))
    for can in (collide.Cylinder(0.01, 0.02), collide.Cone(0.01, 0.02)):
        r = collide.distance(solid, can, EYE, middle)
        assert r.hit and r.certificate[0][:2] == ("point", len(solid.mesh.faces))
        collide.verify(solid, can, EYE, middle, r)
        with pytest.raises(CertificateRefused):
            collide.verify(solid, can, EYE, collide.pose((9, 0, 0)), r)
