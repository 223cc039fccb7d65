"""Samples of straight motions: both ends first, the middle, quarters, …, up to the first hit."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.robots.check_configurations import COLLIDES, IS_OPEN, verdict_of
from collide.robots.check_scene import N_OPEN, OPEN_CAPACITY, view_scene

# Where sampling goes on: a motion, a level of halving (0 of the ends), a sample of the level; and how many samples were
# left to others.
MOTION, LEVEL, SAMPLE, N_OPEN_SAMPLES = range(4)
CURSOR = 4
#: Doubles of a sample left to others: its motion, its time.
OPEN_SAMPLE = 2


@entry("void(int64, int64, int64, int64, int64, float64, int64, int64, int64, int64, int64)")
def sample_motions(header_at, q0_at, q1_at, dof, n, step, max_halvings, q_at, cursor_at, samples_at, times_at):
    """Write a time of a collision of each of n motions from the cursor on, or leave NaN.

    A motion is halved until no column changes by more than ``step``, at most so often.   q : dof doubles of workspace.
    cursor : CURSOR integers. The kernel ends early, and is to be called again, once pairs left to others exceed the
        workspace.   samples : (OPEN_CAPACITY, OPEN_SAMPLE) named by these pairs; a motion with a hit names none.
    """
    scene = view_scene(header_at)
    words = scene.words
    q0, q1, q = view_f64(q0_at, dof * n), view_f64(q1_at, dof * n), view_f64(q_at, dof)
    cursor = view_i64(cursor_at, CURSOR)
    samples = view_f64(samples_at, OPEN_SAMPLE * words[OPEN_CAPACITY])
    times = view_f64(times_at, n)
    words[N_OPEN] = 0
    cursor[N_OPEN_SAMPLES] = 0
    while cursor[MOTION] < n:
        k = cursor[MOTION]
        n_open = words[N_OPEN]
        n_samples_before = cursor[N_OPEN_SAMPLES]
        halvings = halvings_of(q0, q1, dof * k, dof, step, max_halvings)
        state = _sample(scene, q0, q1, dof * k, dof, halvings, q, cursor, samples, times)
        if state == IS_OPEN:
            return
        if state == COLLIDES:
            words[N_OPEN] = n_open
            cursor[N_OPEN_SAMPLES] = n_samples_before
        cursor[MOTION] = k + 1
        cursor[LEVEL] = 0
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


@kernel
def _sample(scene, q0, q1, at, dof, halvings, q, cursor, samples, times):
    """COLLIDES, and the time is written; 0 where no sample is known to; IS_OPEN without space: the cursor stands at the
    sample that is to be asked next.
    """
    words = scene.words
    while cursor[LEVEL] <= halvings:
        n_samples = 2 if cursor[LEVEL] == 0 else 1 << (cursor[LEVEL] - 1)
        while cursor[SAMPLE] < n_samples:
            time = float(cursor[SAMPLE]) if cursor[LEVEL] == 0 else (cursor[SAMPLE] + 0.5) / n_samples
            for j in range(dof):
                q[j] = q0[at + j] + time * (q1[at + j] - q0[at + j]) if time < 1.0 else q1[at + j]
            n_open = words[N_OPEN]
            verdict = verdict_of(scene, q, 0, cursor[N_OPEN_SAMPLES])
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
        cursor[LEVEL] += 1
        cursor[SAMPLE] = 0
    return 0
