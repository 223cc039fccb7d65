"""Parts within rounding: a state that is told holds however the parts are moved by their slop."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import box
from naive import random_pose, rng_of, rotation, unit
from naive_triangles import as_integers, facet_pairs, surface_distance, winding, world_points

import collide
from collide.lowering.facet_bodies import PosesWithSlop, body_of
from collide.narrowphase.composite.composite_mesh_pairs import loose_states, part_rows, part_states
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT, OPEN

BOX = collide.Mesh(*box())


def meets(X, Y) -> bool:
    """Whether two boxes from −1 to 1 at poses share a point, exactly."""
    vertices, faces = box()
    if facet_pairs(vertices, faces, X, vertices, faces, Y):
        return True
    for P, Q in ((X, Y), (Y, X)):
        corners, (p, *_) = as_integers(world_points(vertices, P), world_points(vertices, Q))
        if winding([[corners[v] for v in face] for face in faces.tolist()], p):
            return True
    return False


def cases(rng):
    """(pose, pose, slop): from far apart to deep, some on the brink of what the slop leaves open."""
    for k in range(60):
        X, slop = random_pose(rng), float(rng.choice([0.0, 1e-9, 1e-3, 0.05]))
        Y = random_pose(rng)
        if k % 3:  # along a face, a hair from touching
            Y[:3, :3] = X[:3, :3]
            gap = float(rng.choice([-3, -1.5, -0.5, 0.0, 0.5, 1.5, 3])) * max(slop, 1e-12)
            Y[:3, 3] = X[:3, 3] + X[:3, :3] @ [2.0 + gap, *rng.uniform(-1, 1, 2)]
        else:
            Y[:3, 3] = X[:3, 3] + rng.uniform(0.5, 3.5) * unit(rng.normal(size=3))
        yield X, Y, slop


def test_states_hold_within_the_slop():
    rng = rng_of("loose states")
    seen: Counter = Counter()
    for X, Y, slop in cases(rng):
        PA, PB = (PosesWithSlop(Z[None], np.array([s])) for Z, s in ((X, 0.25 * slop), (Y, 0.75 * slop)))
        (state,) = part_states(BOX, BOX, PA, PB)
        told = f"X, Y, slop = {X.tolist()}, {Y.tolist()}, {slop}: {state}"
        assert slop == 0.0 or (loose_states(body_of(BOX), body_of(BOX), PA, PB) == state).all(), told
        for _ in range(3 if slop else 1):
            moved = Y.copy()
            if slop:
                moved[:3, 3] += 0.99 * slop * rotation(rng)[0]
            want = HIT if meets(X, moved) else APART
            assert state in (OPEN, want), told
        assert slop or state != OPEN, told
        seen[int(state), slop > 0] += 1
    assert min(seen[APART, True], seen[HIT, True], seen[OPEN, True]) >= 5 and seen[HIT, False] >= 3, seen


@pytest.mark.parametrize("limit", [np.inf, 0.5])
def test_brackets_hold_within_the_slop(limit):
    rng = rng_of("loose rows", limit)
    vertices, faces = box()
    told_apart = 0
    for X, Y, slop in cases(rng):
        PA, PB = (PosesWithSlop(Z[None], np.array([0.5 * slop])) for Z in (X, Y))
        (row,) = part_rows(BOX, BOX, PA, PB, limit)
        (state,) = part_states(BOX, BOX, PA, PB)
        told = f"X, Y, slop = {X.tolist()}, {Y.tolist()}, {slop}: {row}"
        assert row["hit"] == (state != APART) and row["lower"] <= row["distance"] <= row["upper"], told
        if state == APART:
            moved = Y.copy()
            moved[:3, 3] += 0.99 * slop * rotation(rng)[0]
            square, _ = surface_distance(vertices, faces, X, vertices, faces, moved)
            assert Fraction(row["lower"]) ** 2 <= square, told
            assert row["beyond"] == (row["lower"] > limit), told
            assert row["beyond"] or square <= Fraction(row["upper"]) ** 2, told
            told_apart += 1
    assert told_apart >= 10
