"""Chords in closed form: what their brackets say is so by exact membership, and intervals combine as intervals do."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from cast_oracles import holds, on_ray
from naive import rng_of
from reproduction import reproducing

import collide
from collide.curved import chords as C
from collide.curved.cone import cone_chord
from collide.curved.cylinder import cylinder_chord
from collide.curved.ellipsoid import ellipsoid_chord
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

SOURCE = "o, d = {o}, {d}  # tests/curved/test_chords.py"
EYE = np.eye(4)


def chord_of(shape, o, d) -> C.Chord:
    size = float(np.linalg.norm(o)) + 2.0
    line = C.Line(Vec3(*o.tolist()), Vec3(*d.tolist()), float(np.linalg.norm(d)), 2.0**-47 * size)
    half = 0.5 * getattr(shape, "length", 0.0)
    name = type(shape).__name__
    if name == "Sphere":
        return C.ball_chord(line.origin, line.direction, shape.radius, line.error, 0)
    if name == "Capsule":
        return C.capsule_chord(line, Vec3(0.0, 0.0, -half), Vec3(0.0, 0.0, half), shape.radius)
    if name == "Cylinder":
        return cylinder_chord(line, shape.radius, half)
    if name == "Cone":
        return cone_chord(line, shape.radius, half)
    if name == "Ellipsoid":
        return ellipsoid_chord(line, Vec3(*shape.radii.tolist()))
    if name == "Box":
        return C.box_chord(line, Vec3(*(0.5 * shape.size).tolist()))
    return C.halfspace_chord(line, Vec3(*shape.normal.tolist()), shape.offset, line.error)


SHAPES = [
    collide.Sphere(0.5), collide.Capsule(0.3, 0.8), collide.Cylinder(0.4, 0.7), collide.Cone(0.5, 0.8),
    collide.Ellipsoid((0.6, 0.3, 0.2)), collide.Box((0.6, 0.8, 0.5)), collide.Halfspace((0.2, -0.3, 0.9), 0.1),
]


def check(shape, o, d, chord: C.Chord) -> None:
    inside = lambda t: holds(shape, EYE, on_ray(o, d, t))
    if chord.state == C.MISSED:
        assert not any(inside(t) for t in np.linspace(-6.0, 6.0, 13))
        return
    assert chord.first_lower <= chord.first <= chord.first_upper
    assert chord.last_lower <= chord.last <= chord.last_upper
    if math.isfinite(chord.first_lower):
        assert not inside(np.nextafter(chord.first_lower, -np.inf))
    if math.isfinite(chord.last_upper):
        assert not inside(np.nextafter(chord.last_upper, np.inf))
    if chord.state == C.MET:
        ends = [t for t in (chord.first_upper, chord.last_lower) if math.isfinite(t)]
        assert all(inside(t) for t in ends)
        assert all(np.ptp(ends) < 1e-9 or inside(t) for t in np.linspace(min(ends), max(ends), 5))
        width = max(chord.first_upper - chord.first_lower if math.isfinite(chord.first) else 0.0,
                    chord.last_upper - chord.last_lower if math.isfinite(chord.last) else 0.0)
        assert width < 1e-6


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_brackets_hold_what_is_inside(shape):
    """Lines of chance, along the axis, across it, and through points of the surface."""
    rng = rng_of("chords", type(shape).__name__)
    seen: Counter = Counter()
    for k in range(60):
        o, d = rng.uniform(-1, 1, 3), rng.normal(size=3)
        if k % 3 == 1:
            d = np.eye(3)[int(rng.integers(3))] * rng.choice([-2.0, 0.5])
        if k % 3 == 2:
            o, d = rng.integers(-2, 3, 3) * 0.125, rng.integers(-2, 3, 3) * 0.5
        if not d.any():
            continue
        with reproducing(SOURCE, o=o, d=d):
            chord = chord_of(shape, o, d)
            check(shape, o, d, chord)
            back = chord_of(shape, o, -d)
            assert {chord.state, back.state} != {C.MISSED, C.MET}
            if chord.state == back.state == C.MET:  # the same chord seen from behind
                np.testing.assert_allclose([back.first, back.last], [-chord.last, -chord.first], rtol=0, atol=1e-9)
                if min(chord.last - chord.first, 1.0) > 1e-6 and not isinstance(shape, collide.Halfspace):
                    assert (back.first_side, back.last_side) == (chord.last_side, chord.first_side)
        seen[chord.state] += 1
    assert seen[C.MET] > 12 and (seen[C.MISSED] > 5 or isinstance(shape, collide.Halfspace)), seen


@pytest.mark.parametrize(
    ("shape", "o", "d", "first", "last", "sides"),
    [
        (SHAPES[0], (-2, 0, 0), (1, 0, 0), 1.5, 2.5, (0, 0)), (SHAPES[1], (0, 0, 3), (0, 0, -2), 1.15, 1.85, (2, 1)),
        (SHAPES[1], (1, 0, 0.1), (-1, 0, 0), 0.7, 1.3, (0, 0)),
        (SHAPES[2], (0.1, 0, 1), (0, 0, -1), 0.65, 1.35, (2, 1)),
        (SHAPES[2], (-1, 0, 0), (1, 0, 0), 0.6, 1.4, (0, 0)), (SHAPES[3], (0.25, 0, -1), (0, 0, 1), 0.6, 1.0, (1, 0)),
        (SHAPES[4], (0, 1, 0), (0, -2, 0), 0.35, 0.65, (0, 0)), (SHAPES[5], (-1, 0, 0), (1, 0, 0), 0.7, 1.3, (1, 2)),
        (SHAPES[5], (0, 0, 1), (0, 0, -1), 0.75, 1.25, (6, 5)), (SHAPES[5], (0, -1, 0), (0, 1, 0), 0.6, 1.4, (3, 4)),
    ],
)
def test_by_hand(shape, o, d, first, last, sides):
    chord = chord_of(shape, np.array(o, dtype=float), np.array(d, dtype=float))
    assert chord.state == C.MET and (chord.first_side, chord.last_side) == sides
    np.testing.assert_allclose([chord.first, chord.last], [first, last], rtol=0, atol=1e-12)


def test_halfspaces_have_one_end():
    half = collide.Halfspace((0, 0, 2), 1.0)
    down, up, within, above, level = (
        chord_of(half, np.array(o, dtype=float), np.array(d, dtype=float))
        for o, d in (((0, 0, 2), (0, 0, -1)), ((0, 0, 0), (0, 0, 1)), ((0, 0, 0), (1, 0, 0)), ((0, 0, 1), (1, 0, 0)),
                     ((0, 0, 0.5), (0, 1, 0)))
    )
    assert (down.state, down.first, down.last) == (C.MET, 1.5, math.inf) and (down.first_side, down.last_side) == (
        0,
        -1,
    )
    assert (up.state, up.first, up.last) == (C.MET, -math.inf, 0.5) and (up.first_side, up.last_side) == (-1, 0)
    assert (within.state, within.first, within.last) == (C.MET, -math.inf, math.inf)
    assert above.state == C.MISSED and level.state == C.UNCLEAR


def test_rays_that_touch_are_left_open():
    """A line that grazes is not said to miss, nor to meet."""
    for shape, o, d in ((SHAPES[0], (0.5, 0, -2), (0, 0, 1)), (SHAPES[2], (0.4, 0, -2), (0, 0, 1)),
                        (SHAPES[5], (0.3, 0, -2), (0, 0, 1)), (SHAPES[4], (0.6, 0, -2), (0, 0, 1))):
        o, d = np.array(o, dtype=float), np.array(d, dtype=float)
        assert chord_of(shape, o, d).state == C.UNCLEAR
        assert chord_of(shape, o * (1 + 1e-9), d).state == C.MISSED
        assert chord_of(shape, o * (1 - 1e-9), d).state == C.MET
    assert C.ball_chord(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), 1.0, 0.0, 0) == C.everything(C.UNCLEAR)


def interval(rng) -> C.Chord:
    """A chord whose brackets are random, in a state."""
    if rng.random() < 0.2:
        return C.nothing()
    first, last = sorted(rng.integers(-5, 6, 2).tolist())
    wide = rng.choice([0.0, 0.25, 1.0], 4).tolist()
    state = C.MET if rng.random() < 0.7 and first + wide[1] <= last - wide[2] else C.UNCLEAR
    return C.Chord(
        state, first - wide[0], float(first), first + wide[1], last - wide[2], float(last), last + wide[3],
        int(rng.integers(3)), int(rng.integers(3)),
    )


def truths(chord: C.Chord, rng) -> list:
    """Intervals that a chord may stand for; None for nothing."""
    if chord.state == C.MISSED:
        return [None]
    out: list = [None] if chord.state == C.UNCLEAR else []
    for _ in range(6):
        first = Fraction(float(rng.choice([chord.first_lower, chord.first, chord.first_upper])))
        last = Fraction(float(rng.choice([chord.last_lower, chord.last, chord.last_upper])))
        out += [(first, last)] if first <= last else []
    return out


def may_be(chord: C.Chord, truth) -> bool:
    """Whether a chord's state and brackets allow that this is what there is."""
    if truth is None or chord.state == C.MISSED:
        return truth is None and chord.state != C.MET
    if not (chord.first_lower <= truth[0] and truth[1] <= chord.last_upper):
        return False
    return chord.state == C.UNCLEAR or (truth[0] <= chord.first_upper and chord.last_lower <= truth[1])


def test_common_and_together_hold_for_all_that_brackets_allow():
    rng, seen = rng_of("intervals"), Counter()
    for _ in range(150):
        a, b = interval(rng), interval(rng)
        common, together = C.common(a, b), C.together(a, b)
        with reproducing("a, b = {a}, {b}", a=a, b=b):
            for p in truths(a, rng):
                for q in truths(b, rng):
                    both = p and q and (max(p[0], q[0]), min(p[1], q[1]))
                    both = both if both and both[0] <= both[1] else None
                    assert may_be(common, both)
                    if p and q and both:  # a union that is an interval
                        assert may_be(together, (min(p[0], q[0]), max(p[1], q[1])))
                    elif not (p and q):
                        assert may_be(together, p or q)
        seen[common.state] += 1
    assert min(seen.values()) > 10 and len(seen) == 3, seen
