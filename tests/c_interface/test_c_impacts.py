"""Times of impact through the C interface: Python's `time_of_impact`, bit by bit, one motion or many.

Whether Python's are right is judged in `tests/motion`.
"""

from __future__ import annotations

import functools
import math

import c_library as c
import numpy as np
import pytest
import soak_pairs

import collide
from collide.kernels import mode
from collide.scenes.families.ingredients import direction

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid",
)


def moved(X: np.ndarray, way: np.ndarray, turn: np.ndarray | None) -> np.ndarray:
    if turn is not None:
        return collide.moved_poses(X, way, turn)
    X = X.copy()
    X[:3, 3] += way
    return X


@functools.cache
def drawn() -> list[tuple]:
    """(what is said of it, A, B, four poses, two angular velocities, tolerance): all kinds, towards each other."""
    cases = []
    for number in range(240):
        k = soak_pairs.draw(95, number, 1e2, CONVEX)
        random = np.random.default_rng([96, number])
        ahead = k.X_WB[:3, 3] - k.X_WA[:3, 3]
        size = float(np.linalg.norm(ahead)) or 1.0
        X_WA, X_WB = k.X_WA.copy(), k.X_WB.copy()
        if number % 3:
            X_WA[:3, 3] -= ahead * random.uniform(0.1, 2)
        ways = [ahead * random.uniform(0, 3) + 0.3 * size * direction(random), 0.2 * size * direction(random)]
        turns = [random.normal(size=3) * random.choice([0.3, 3.0]) if random.uniform() < 0.5 else None for _ in ways]
        if number % 7 == 0:
            ways[1], turns[1] = np.zeros(3), None
        ends = X_WA, moved(X_WA, ways[0], turns[0]), X_WB, moved(X_WB, ways[1], turns[1])
        omegas = [omega if omega is not None and random.uniform() < 0.6 else None for omega in turns]
        cases.append((f"draw(95, {number})", k.A, k.B, ends, omegas, float(random.choice([1e-9, 1e-6, 1e-3]))))
    return cases


def told(impact: collide.TimeOfImpact) -> np.ndarray:
    """A row of C with what Python says."""
    row = np.zeros((), dtype=c.TIME_OF_IMPACT)
    for name, value in impact._asdict().items():
        row[name] = value
    return row


def asked(A, B, ends, omegas, tolerance, **options):
    omega_WA, omega_WB = omegas
    return collide.time_of_impact(A, B, *ends, omega_WA=omega_WA, omega_WB=omega_WB, tolerance=tolerance, **options)


def test_single_motions_have_pythons_bits():
    asker, counts = c.Asker(), {"met": 0, "free": 0, "at start": 0, "open": 0}
    for name, A, B, ends, omegas, tolerance in drawn():
        status, row = asker.impact(c.CShape(A), c.CShape(B), ends, omegas, tolerance)
        wanted = told(asked(A, B, ends, omegas, tolerance))
        assert (status, row.tobytes()) == (c.OK, wanted.tobytes()), (name, status, row, wanted)
        if not row["hit"]:
            counts["free"] += 1
        else:
            counts["open" if row["upper"] == math.inf else "met" if row["upper"] else "at start"] += 1
    assert counts["met"] >= 60 and counts["free"] >= 60 and counts["at start"] >= 40, counts


def test_batches_say_what_single_calls_say():
    asker, met = c.Asker(), 0
    for number, (name, A, B, ends, omegas, tolerance) in enumerate(drawn()[::8]):
        if isinstance(A, collide.Halfspace) and isinstance(B, collide.Halfspace):
            continue
        random, ends = np.random.default_rng([97, number]), list(ends)
        shift = random.normal(size=(12, 3)) * 0.1 * np.linalg.norm(ends[2][:3, 3] - ends[0][:3, 3])
        for k in (0, 1) if number % 2 else (2,):
            ends[k] = np.stack([ends[k]] * 12)
            ends[k][:, :3, 3] += shift
        if omegas[0] is not None and number % 4 == 0:
            omegas = [np.stack([omegas[0]] * 12), omegas[1]]
        wanted = asked(A, B, ends, omegas, tolerance)
        status, rows, statuses, failed = asker.impact_batch(c.CShape(A), c.CShape(B), ends, omegas, tolerance)
        assert (status, failed, statuses.tolist()) == (c.OK, 0, [c.OK] * 12), name
        for k in range(12):
            one = {field: values[k] for field, values in wanted._asdict().items()}
            assert rows[k].tobytes() == told(collide.TimeOfImpact(**one)).tobytes(), (name, k)
        met += int(wanted.hit.sum())
    assert met >= 100, met


def test_contact_at_the_last_pose_alone_is_a_contact_by_then():
    """A box that comes to rest on another, flush."""
    box, lower = collide.Box(1, 1, 1), np.eye(4)
    ends = c.identity_at(0.25, 0, 3), c.identity_at(0.25, 0, 1), lower, lower
    wanted = told(asked(box, box, ends, (None, None), 1e-9))
    status, row = c.Asker().impact(c.CShape(box), c.CShape(box), ends)
    assert status == c.OK and row.tobytes() == wanted.tobytes() and row["upper"] == 1.0 and row["hit"]


def test_half_spaces_are_refused_unless_they_meet_at_the_start():
    plane, still = collide.Halfspace((0, 0, 1), 0.0), np.eye(4)
    over = np.diag([1.0, -1.0, -1.0, 1.0]) + c.identity_at(0, 0, 1) - np.eye(4)
    own = c.CShape(plane)
    with pytest.raises(collide.UnsupportedQuery):
        asked(plane, plane, (still, still, over, over), (None, None), 1e-9)
    assert c.Asker().impact(own, own, (still, still, over, over))[0] == c.UNSUPPORTED
    wanted = told(asked(plane, plane, (still, still, still, still), (None, None), 1e-9))
    status, row = c.Asker().impact(own, own, (still, still, still, still))
    assert status == c.OK and row.tobytes() == wanted.tobytes() and row["hit"] and row["upper"] == 0.0


def test_arguments_out_of_range_are_told():
    asker, shape = c.Asker(), collide.Box(1, 1, 1)
    box, still = c.CShape(shape), (np.eye(4), np.eye(4))
    ends = (*still, c.identity_at(3, 0, 0), c.identity_at(1, 0, 0))
    assert asker.impact(box, box, ends)[0] == c.OK
    for tolerance in (0.0, 1e-15, 2.0, math.nan):
        assert asker.impact(box, box, ends, tolerance=tolerance)[0] == c.INVALID_ARGUMENT
    for omega in ([0, 0, math.nan], [math.inf, 0, 0], [1e7, 0, 0], [1.0, 0, 0]):
        with pytest.raises(collide.InvalidArgument):
            asked(shape, shape, ends, (omega, None), 1e-9)
        assert asker.impact(box, box, ends, (omega, None))[0] == c.INVALID_ARGUMENT, omega
    assert asker.impact(box, box, ends, flags=c.UNSIGNED)[0] == c.INVALID_ARGUMENT
    uneven = np.stack(still * 2), np.stack([np.eye(4)] * 3), *ends[2:]
    assert asker.impact_batch(box, box, uneven)[0] == c.INVALID_ARGUMENT
    refused = 0
    for number, bad in enumerate(c.odd_poses()):
        for at in range(4):
            for flags, check in ((0, True), (c.TRUST_POSES, False)):
                poses = [bad if k == at else X for k, X in enumerate(ends)]
                status, row = asker.impact(box, box, poses, flags=flags)
                try:
                    wanted = told(asked(shape, shape, poses, (None, None), 1e-9, check_poses=check))
                except collide.InvalidPose:
                    refused += 1
                    assert status == c.INVALID_POSE, (number, at, flags)
                else:
                    assert (status, row.tobytes()) == (c.OK, wanted.tobytes()), (number, at, flags)
    assert refused >= 40, refused
