"""Certificates of clouds and grids: every boolean beside convex parts has one, and none that was tampered with
passes.
"""

from __future__ import annotations

import json
from fractions import Fraction
from unittest import mock

import numpy as np
import pytest
from field_unions import random_grid

import collide
from collide.certificates.certificate import CertificateRefused
from collide.shapes import height_field

EYE = np.eye(4)


def bodies(rng) -> list:
    return [
        collide.Sphere(0.05), collide.Box((0.1, 0.2, 0.1)), collide.Capsule(0.03, 0.2),
        collide.ConvexHull(rng.normal(size=(12, 3)) * 0.05), collide.Halfspace((0, 0.6, 0.8), -1.0),
        collide.Compound([(collide.Sphere(0.05), collide.pose((0.1, 0, 0))), (collide.Box((0.1, 0.1, 0.1)), EYE)]),
    ]


def field_of(rng, case: int) -> collide.Shape:
    if case % 2 == 0:
        return random_grid(rng)
    points = rng.uniform(-1, 1, (int(rng.integers(1, 500)), 3))
    return collide.PointCloud(points, rng.uniform(0, 0.05, len(points)) if case % 3 else 0.02)


def test_every_boolean_has_a_proof_that_checks():
    rng, asked, hits = np.random.default_rng(1), 0, 0
    for case in range(96):
        field, B = field_of(rng, case), bodies(rng)[case // 2 % 6]
        X = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
        Y = X @ collide.pose(rng.uniform(-0.8, 0.8, 3), rpy=rng.uniform(-3, 3, 3))
        if case % 5 == 0:  # flush faces, touching balls
            X, Y = EYE, collide.pose(rng.integers(-6, 7, 3) / 8.0)
        for pair in ((field, B, X, Y), (B, field, Y, X)):
            row = collide.distance(*pair, signed=bool(case % 4))
            proof = json.loads(json.dumps(row.certificate))
            collide.verify(*pair, row, certificate=proof)
            asked, hits = asked + 1, hits + bool(row.hit)
            refuse(pair, row, proof)
    assert hits > 0.1 * asked and asked - hits > 0.4 * asked, (asked, hits)


def refuse(pair, row, proof) -> None:
    """A plane less, no normal, an item that is not there, the proof of the opposite."""
    field_first = pair[0].is_field
    wrong = [[[kind, -7 if field_first else i, j if field_first else -7, rows] for kind, i, j, rows in proof]]
    if not row.hit:
        wrong += [proof[:-1], [["together", 0, 0, [[0, 0]]]]]
        if not any(isinstance(shape, collide.Halfspace) for shape in pair):  # whose own plane is what is checked
            wrong.append([[kind, i, j, [[0, 0, 0]]] for kind, i, j, _ in proof])
    for certificate in wrong:
        with pytest.raises(CertificateRefused):
            collide.verify(*pair, row, certificate=certificate)


def test_gaps_of_an_ulp_are_proven_by_fractions():
    """Points on a grid around a box, one of them an ulp away: doubles leave the plane open."""
    box, proven = collide.Box((1.0, 1.0, 1.0)), 0
    for k in range(8):
        points = np.array(list(np.ndindex(5, 5, 5))) * 0.75 - 1.5
        points = points[(np.abs(points) > 0.5).any(axis=1)]
        points[k, 2] = 0.5 + 2.0**-53 * (k % 2)
        points[k, :2] = 0.25
        row = collide.distance(collide.PointCloud(points), box, EYE, EYE, signed=False)
        assert bool(row.hit) == (Fraction(points[k, 2]) <= Fraction(1, 2))
        collide.verify(collide.PointCloud(points), box, EYE, EYE, row)
        proven += not row.hit
    assert proven == 4


def test_a_large_cloud_needs_few_planes():
    rng = np.random.default_rng(2)
    cloud, box = collide.PointCloud(rng.uniform(-1, 1, (100_000, 3)), 0.002), collide.Box((0.03, 0.03, 0.03))
    for _ in range(400):
        X = collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3))
        row = collide.distance(cloud, box, EYE, X, signed=False)
        if not row.hit:
            break
    assert not row.hit and len(row.certificate) < 40 and len(json.dumps(row.certificate)) < 4000
    collide.verify(cloud, box, EYE, X, row)


def test_what_has_no_proof_says_so():
    """Large terrain has no list of items, which pairs with meshes and fields go by."""
    cloud, far = collide.PointCloud([(0, 0, 0)], 0.1), collide.pose((0, 0, 3))
    with mock.patch.object(height_field, "_MAX_MESHED", 0):
        terrain = collide.HeightField(np.zeros((4, 4)), (0.5, 0.5), bottom=-1.0)
        row = collide.distance(terrain, cloud, EYE, far)
        assert not row.hit and row.certificate is None
        with pytest.raises(collide.InvalidArgument, match="carries no certificate"):
            collide.verify(terrain, cloud, EYE, far, row)
