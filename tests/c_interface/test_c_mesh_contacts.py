"""Contacts of meshes through the C interface: rows are Python's, bit by bit, or left to Python.

Whether Python's are right is judged in `tests/contact`.
"""

from __future__ import annotations

import math
from collections import Counter

import c_library as c
import numpy as np
import pytest
import soak_pairs
import surfaces

import collide
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

FACETED = ("solid", "surface", "solid", "surface", "box", "capsule", "sphere", "hull", "swept hull", "flat hull")


def bodies() -> list[tuple]:
    """(name, A, B, X_WA, X_WB, margin, max_contacts): random pairs, and bodies that rest on a bumpy or a flat mesh."""
    cases = []
    for number in range(220):
        k, random = soak_pairs.draw(121, number, 1e2, FACETED), np.random.default_rng([122, number])
        if k.A.meshed or k.B.meshed:
            size = float(np.linalg.norm(k.X_WB[:3, 3] - k.X_WA[:3, 3])) or 1.0
            margin = size * float(random.choice([0.0, 1e-3, 0.1]))
            cases.append((f"draw(121, {number})", k.A, k.B, k.X_WA, k.X_WB, margin, int(random.choice([1, 4, 8, 99]))))
    ground = collide.Mesh(*surfaces.box((-2, -2, -0.2), (2, 2, 0)))
    torus = collide.Mesh(*surfaces.torus())
    for number in range(80):
        random = np.random.default_rng([123, number])
        hull = collide.ConvexHull(random.normal(size=(30, 3)) * 0.2)
        body = [collide.Box(0.3, 0.4, 0.2), collide.Capsule(0.1, 0.3), hull, torus, collide.Sphere(0.2)][number % 5]
        X_WB = soak_pairs.rotation(random)
        gap = collide.distance(ground, body, np.eye(4), X_WB + c.identity_at(0, 0, 5) - np.eye(4)).distance
        X_WB[:3, 3] = *random.uniform(-1, 1, 2), 5.0 - gap + random.choice([0.0, 1e-3, -1e-3, 5e-3])
        X_W = soak_pairs.rotation(random) if number % 2 else np.eye(4)
        pair = (ground, body, X_W, X_W @ X_WB) if number % 3 else (body, ground, X_W @ X_WB, X_W)
        cases.append((f"at rest {number}", *pair, 2e-3, int(random.choice([4, 8]))))
    return cases


def test_contacts_have_pythons_bits_or_are_left_to_python():
    asker, told, meshes = c.Asker(), Counter(), {}
    for name, A, B, X_WA, X_WB, margin, most in bodies():
        own = [meshes.setdefault(id(S), (c.CMesh(S), S))[0] for S in (A, B)]
        wanted = collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most).rows
        status, rows, count = asker.many_contacts(*own, X_WA, X_WB, margin, most)
        if status == c.OK:
            assert count == len(rows) and rows.tobytes() == wanted.tobytes(), (name, margin, most, rows, wanted)
            told["contacts" if count else "none"] += 1
        else:
            assert (status, count) == (c.UNSUPPORTED, 0), (name, status)
            told["left to Python"] += 1
    assert told["contacts"] >= 100 and told["none"] >= 60 and told["left to Python"] <= 25, told


def test_room_and_arguments():
    asker, floor = c.Asker(), c.CMesh(collide.Mesh(*surfaces.box((-2, -2, -0.2), (2, 2, 0))))
    box, over = c.CMesh(collide.Box(1, 1, 1)), c.identity_at(0, 0, 0.499)
    _, rows, count = asker.many_contacts(floor, box, np.eye(4), over, 0.0, 4)
    assert count == 4 and np.abs(rows["distance"] + 0.001).max() < 1e-12
    status, some, told = asker.many_contacts(floor, box, np.eye(4), over, 0.0, 4, capacity=2)
    assert (status, told) == (c.TOO_MANY, 4) and some.tobytes() == rows[:2].tobytes()
    for margin in (-1.0, math.nan, math.inf, 1e51):
        assert asker.many_contacts(floor, box, np.eye(4), over, margin, 4)[0] == c.INVALID_ARGUMENT
    assert asker.many_contacts(floor, box, np.eye(4), over, 0.0, 0)[0] == c.INVALID_ARGUMENT
    assert asker.many_contacts(floor, box, np.eye(4), over, 0.0, 4, flags=c.UNSIGNED)[0] == c.INVALID_ARGUMENT
    assert asker.many_contacts(box, box, np.eye(4), over, 0.0, 4)[0] == c.INVALID_ARGUMENT  # neither is a mesh
    for number, bad in enumerate(c.odd_poses()):
        assert asker.many_contacts(floor, box, np.eye(4), bad, 0.0, 4)[0] == c.INVALID_POSE, number
