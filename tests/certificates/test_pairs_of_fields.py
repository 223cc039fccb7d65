"""Certificates of fields beside curved shapes, meshes and fields: each item one by one says what they must prove."""

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


@pytest.mark.many(3)
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


def test_fields_beside_fields_and_meshes():
    rng, seen = rng_of("fields beside fields and meshes"), Counter()
    for k in range(10):
        ring = torus(1.0, 0.3, 10, 6)
        pool = [
            collide.PointCloud(rng.normal(size=(40, 3)), rng.uniform(0.01, 0.05, 40)),
            collide.SweptMesh(torus(0.8, 0.3, 10, 6), 0.05),
            collide.VoxelGrid(rng.integers(-6, 7, (40, 3)), (0.1, 0.2, 0.15)),
            ring, collide.Compound([(ring, collide.pose((0.2, 0, 0))), (collide.Cylinder(0.1, 0.5), EYE)]),
        ]
        A, B = pool[k % 3], pool[rng.integers(5)]
        X_WA, X_WB = random_pose(rng, 0.2), random_pose(rng, 1.6)
        question = (A, B, X_WA, X_WB) if k % 2 else (B, A, X_WB, X_WA)
        r = collide.distance(*question, signed=False)
        if r.how == UNDECIDED:
            continue
        collide.verify(*question, r, certificate=json.loads(json.dumps(r.certificate)))
        with pytest.raises(CertificateRefused):
            collide.verify(*question, Claim(not r.hit, r.certificate))
        seen[r.certificate[0].kind] += 1
    assert seen["plane"] > 1 and seen["point"] > 1, seen


def test_clouds_beside_each_other_ball_by_ball():
    """Radii differ: groups are swept by the largest, and a forged plane between them is refused."""
    rng, seen = rng_of("clouds beside clouds"), Counter()
    for _ in range(6):
        A, B = (collide.PointCloud(rng.normal(size=(20, 3)), rng.uniform(0.001, 0.2, 20)) for _ in range(2))
        X_WB = random_pose(rng, 0.6)
        r = collide.distance(A, B, EYE, X_WB, signed=False)
        places = B.points @ X_WB[:3, :3].T + X_WB[:3, 3]
        gaps = np.linalg.norm(A.points[:, None] - places[None], axis=2) - A.radii[:, None] - B.radii[None]
        assert r.hit == (gaps.min() <= 0.0)
        collide.verify(A, B, EYE, X_WB, r)
        seen[r.hit] += 1
        for k in range(0, len(r.certificate), 29) if not r.hit else ():
            with pytest.raises(CertificateRefused, match="no plane parts item"):
                collide.verify(A, B, EYE, X_WB, r, certificate=r.certificate[:k] + r.certificate[k + 1 :])
    assert seen[True] and seen[False], seen


def test_a_curved_body_inside_a_solid_with_thickness():
    solid = collide.SweptMesh(torus(1.0, 0.3, 10, 6), 0.01)
    middle = collide.pose(tuple(0.5 * (solid.mesh.vertices[:6].min(axis=0) + solid.mesh.vertices[:6].max(axis=0))))
    for can in (collide.Cylinder(0.01, 0.02), collide.Cone(0.01, 0.02)):
        r = collide.distance(solid, can, EYE, middle)
        assert r.hit and r.certificate[0][:2] == ("point", len(solid.mesh.faces))
        collide.verify(solid, can, EYE, middle, r)
        with pytest.raises(CertificateRefused):
            collide.verify(solid, can, EYE, collide.pose((9, 0, 0)), r)
