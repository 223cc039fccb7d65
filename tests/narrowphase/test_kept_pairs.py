"""A pair is one object, whatever is asked of it first: casts, impacts, contacts, distances."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import collide
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe

BALL = collide.tessellate(collide.Sphere(0.5))
EYE, FAR = np.eye(4), collide.pose((3.0, 0.1, 0.2))
SHAPES = {
    "box": lambda: collide.Box((1, 1, 1)), "can": lambda: collide.Cylinder(0.5, 1.0),
    "hull": lambda: collide.ConvexHull(np.random.default_rng(0).normal(size=(12, 3)) * 0.3),
    "union": lambda: collide.Compound(
        [(collide.Box((0.1, 0.1, 0.1)), collide.pose((0.2 * k, 0, 0))) for k in range(40)]
    ),
    "mesh": lambda: collide.Mesh(BALL.vertices, BALL.faces),
}
ASKED = {
    "collide": lambda A, B: bool(collide.collide(A, B, EYE, FAR)),
    "distance": lambda A, B: collide.distance(A, B, EYE, FAR).rows.tobytes(),
    "contacts": lambda A, B: collide.contacts(A, B, EYE, FAR, margin=5.0).rows.tobytes(),
    "cast": lambda A, B: [np.asarray(x).tobytes() for x in collide.shape_cast(A, EYE, (0.0, 1.0, 0.0), B, FAR)],
    "impact": lambda A, B: [
        np.asarray(x).tobytes() for x in collide.time_of_impact(A, B, EYE, collide.pose((2.5, 0, 0)), FAR, FAR)
    ],
}


@pytest.mark.parametrize("kinds", ["box box", "box can", "hull box", "union box", "union union", "mesh box"])
def test_answers_do_not_depend_on_what_was_asked_before(kinds):
    make_a, make_b = (SHAPES[kind] for kind in kinds.split())
    fresh = {name: ask(make_a(), make_b()) for name, ask in ASKED.items()}
    for order in itertools.islice(itertools.permutations(ASKED), 0, 120, 11):
        A, B = make_a(), make_b()
        for name in (*order, *order):
            assert ASKED[name](A, B) == fresh[name], (order, name)
        if single_calls_are_safe():
            assert len(A._prepared) == 1 and len(A._partners) == 1, order


def test_a_pair_asked_for_impacts_first_is_made_ready_for_all():
    if not single_calls_are_safe():
        pytest.skip("plain Python has no single calls")
    A, B = SHAPES["box"](), SHAPES["box"]()
    ASKED["impact"](A, B)
    pair = prepared_pair(A, B)
    assert pair.impact is not None and pair.collide is None
    for name in ("contacts", "collide", "distance"):
        ASKED[name](A, B)
    assert prepared_pair(A, B) is pair and pair.impact is not None
    assert pair.collide is not None and pair.distance is not None and pair.contacts is not None
    other = SHAPES["box"]()
    ASKED["impact"](A, other)
    ASKED["collide"](A, other)
    assert prepared_pair(A, other).collide is not None


def test_the_end_of_a_partner_is_the_end_of_all_that_was_ready():
    A, B = SHAPES["box"](), SHAPES["can"]()
    for ask in ASKED.values():
        ask(A, B)
    assert len(A._prepared) == 1
    del B
    assert not A._prepared and not A._partners
