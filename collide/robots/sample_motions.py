"""Samples of straight motions: both ends first, the middle, quarters, …, up to the first hit."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.kernels.lanes import LANES
from collide.robots.check_configurations import (
    COLLIDES,
    IS_FREE,
    IS_OPEN,
    settle_eight,
    verdict_among,
    verdict_in_lane,
)
from collide.robots.check_scene import N_OPEN, OPEN_CAPACITY, SPHERE_HEADER_AT, view_scene

# Where sampling goes on: a motion, and its sample; and how many samples were left to others.
MOTION, SAMPLE, N_OPEN_SAMPLES = range(3)
CURSOR = 3
#: Doubles of a sample left to others: its motion, its time.
OPEN_SAMPLE = 2


@entry("void(int64, int64, int64, int64, int64, float64, int64, int64, int64, int64, int64)")
def sample_motions(header_at, q0_at, q1_at, dof, n, step, max_halvings, q_at, cursor_at, samples_at, times_at):
    """Write a time of a collision of each of n motions from the cursor on, or leave NaN.

    A motion is halved until no column changes by more than ``step``, at most so often.   q : (LANES, dof) of workspace.
    cursor : CURSOR integers. The kernel ends early, and is to be called again, once pairs left to others exceed the
        workspace.   samples : (OPEN_CAPACITY, OPEN_SAMPLE) named by these pairs; a motion with a hit names none.
    """
    scene = view_scene(header_at)
    words = scene.words
    q0, q1, q = view_f64(q0_at, dof * n), view_f64(q1_at, dof * n), view_f64(q_at, LANES * dof)
    cursor = view_i64(cursor_at, CURSOR)
    samples = view_f64(samples_at, OPEN_SAMPLE * words[OPEN_CAPACITY])
    times = view_f64(times_at, n)
    words[N_OPEN] = 0
    cursor[N_OPEN_SAMPLES] = 0
    while cursor[MOTION] < n:
        k = cursor[MOTION]
        n_open = words[N_OPEN]
        n_before = cursor[N_OPEN_SAMPLES]
        halvings = halvings_of(q0, q1, dof * k, dof, step, max_halvings)
        # Both ends, and with each halving as many as there were intervals.
        n_samples = 2 if halvings == 0 else (1 << halvings) + 1
        state = _sample(scene, q0, q1, dof * k, dof, n_samples, q, cursor, samples, times)
        if state == IS_OPEN:
            return
        if state == COLLIDES:
            words[N_OPEN] = n_open
            cursor[N_OPEN_SAMPLES] = n_before
        cursor[MOTION] = k + 1
        cursor[SAMPLE] = 0


@kernel(inline=True)
def halvings_of(q0, q1, at, dof, step, max_halvings):
    """How often a motion is halved until no column changes by more than ``step``."""
    change = 0.0
    for j in range(dof):
        change = max(change, abs(q1[at + j] - q0[at + j]))
    n = 0
    while n < max_halvings and change > step:
        step *= 2.0
        n += 1
    return n


@kernel(inline=True)
def time_of_sample(k):
    """0, 1, 1/2, 1/4, 3/4, 1/8, …: the time of sample k of a motion."""
    if k < 2:
        return float(k)
    n = 1
    while 2 * n < k:
        n *= 2
    return (k - 1 - n + 0.5) / n


@kernel
def _sample(scene, q0, q1, at, dof, n_samples, q, cursor, samples, times):
    """COLLIDES, and the time is written; 0 where no sample is known to; IS_OPEN without space: the cursor stands at the
    sample that is to be asked next.
    """
    words = scene.words
    while cursor[SAMPLE] < n_samples:
        count = min(LANES, n_samples - cursor[SAMPLE])
        for lane in range(count):
            time = time_of_sample(cursor[SAMPLE] + lane)
            for j in range(dof):
                a = q0[at + j]
                q[dof * lane + j] = a + time * (q1[at + j] - a) if time < 1.0 else q1[at + j]
        in_lanes = words[SPHERE_HEADER_AT] != 0 and settle_eight(scene, q, dof, 0, count) > 0
        for lane in range(count):
            verdict = verdict_in_lane(scene, lane) if in_lanes else IS_OPEN
            if verdict == IS_FREE:
                cursor[SAMPLE] += 1
                continue
            n_open = words[N_OPEN]
            if verdict == IS_OPEN:
                verdict = verdict_among(scene, q, dof * lane, cursor[N_OPEN_SAMPLES], lane, in_lanes)
            time = time_of_sample(cursor[SAMPLE])
            if verdict == COLLIDES:
                times[cursor[MOTION]] = time
                return COLLIDES
            if words[N_OPEN] > words[OPEN_CAPACITY]:
                words[N_OPEN] = n_open
                return IS_OPEN
            if verdict == IS_OPEN:
                samples[OPEN_SAMPLE * cursor[N_OPEN_SAMPLES]] = float(cursor[MOTION])
                samples[OPEN_SAMPLE * cursor[N_OPEN_SAMPLES] + 1] = time
                cursor[N_OPEN_SAMPLES] += 1
            cursor[SAMPLE] += 1
    return 0
