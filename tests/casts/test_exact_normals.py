"""Normals of exact casts: a plane through the point of touching has both bodies on its sides, also where they graze."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import rng_of
from reproduction import reproducing

import collide
from collide.casts.exact_cast import cast_exactly


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_planes_of_touching_part_the_bodies(n):
    """Points, segments, flat and solid sets on a small lattice: most casts graze, or touch in a corner or an edge."""
    rng, seen = rng_of("exact normals", n), Counter()
    for _ in range(120):
        A, B = (rng.integers(-2, 3, (k, 3)).tolist() for k in (n, int(rng.integers(1, 5))))
        shift = rng.integers(2, 6, 3) * rng.integers(-1, 2, 3)
        B = [[x + int(s) for x, s in zip(b, shift)] for b in B]
        d = [int(x) for x in np.sign(shift) * rng.integers(1, 3, 3)]
        if not any(d):
            continue
        source = "from collide.casts.exact_cast import cast_exactly; print(cast_exactly({A}, {B}, {d}))"
        with reproducing(source, A=A, B=B, d=d):
            contact = cast_exactly(A, B, d)
            if not contact.t:
                seen["start" if contact.t == 0 else "miss"] += 1
                assert contact.normal == (0, 0, 0) and (contact.t == 0) == bool(contact.weights)
                continue
            normal = contact.normal
            ahead = max(dot(normal, a) for a in A) + contact.t * dot(normal, d)
            assert ahead == min(dot(normal, b) for b in B) and dot(normal, d) > 0
            seen["hit"] += 1
    assert seen["hit"] > 5, seen


def test_boxes_that_graze_have_a_normal_of_both():
    """An edge passes along a face, an ulp would part them: the normal is one of a face, or between two that meet."""
    A, B = collide.Box((1, 1, 1)), collide.Box((2, 2, 2))
    for y, z in ((1.5, 0.3), (-1.5, 0.3), (0.2, 1.5), (1.5, 1.5)):
        r = collide.shape_cast(A, collide.pose((-5, y, z)), (2, 0, 0), B, np.eye(4))
        assert r.hit and r.certified
        reach_a = np.abs(r.normal) @ (0.5, 0.5, 0.5) + r.normal @ (-5 + 2 * r.distance, y, z)
        reach_b = -np.abs(r.normal) @ (1.0, 1.0, 1.0)
        np.testing.assert_allclose([reach_a, reach_b], r.normal @ r.point, rtol=0, atol=1e-12)
        assert r.normal[0] >= 0.0
