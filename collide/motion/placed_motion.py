"""Where bodies in motion are: their poses at times, from one kernel, so all callers ask about the same motion."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_f64, view_i64
from collide.lowering.compound_table import PART
from collide.lowering.shape_table import POSE
from collide.motion.moving_body import BODY, place_body, set_body
from collide.numerics.vec3 import Vec3, add, scale, sub

#: Doubles of workspace: a body, a row of parts that is none, a pose.
_PARTS_AT, _POSE_AT = BODY, BODY + PART
WORKSPACE = _POSE_AT + POSE


@entry("float64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def place_motions(ends_at, step0, step1, omega_at, step_omega, times_at, step_time, n, work_at, out_at):
    """Poses of n motions at a time each; returns by how much a matrix at the end misses what the motion says, at most.

    ends : addresses of the poses at the start and at the end, with steps of 16 or 0 doubles.
    omega : 0, or angular velocities, with a step of 3 or 0.   times : with a step of 1 or 0.
    work : WORKSPACE doubles, zeroed.   out : n matrices of 16 doubles.
    """
    ends = view_i64(ends_at, 2)
    body, parts = view_f64(work_at, BODY), view_f64(work_at + 8 * _PARTS_AT, PART)
    pose = view_f64(work_at + 8 * _POSE_AT, POSE)
    worst = 0.0
    for k in range(n):
        X0, X1 = view_f64(ends[0] + 8 * step0 * k, 16), view_f64(ends[1] + 8 * step1 * k, 16)
        has_omega = omega_at != 0
        omega = view_f64(omega_at + 8 * step_omega * k if has_omega else ends[0], 3)
        worst = max(worst, set_body(body, X0, X1, omega, has_omega, parts, 0, 0.0))
        time = view_f64(times_at + 8 * step_time * k, 1)[0]
        p0 = Vec3(X0[3], X0[7], X0[11])
        p = add(p0, scale(time, sub(Vec3(X1[3], X1[7], X1[11]), p0)))
        place_body(body, time, pose, 0, p, 0.0)
        out = view_f64(out_at + 128 * k, 16)
        for i in range(3):
            for j in range(3):
                out[4 * i + j] = pose[3 * i + j]
            out[4 * i + 3] = pose[9 + i]
            out[12 + i] = 0.0
        out[15] = 1.0
    return worst


def poses_at(X0: np.ndarray, X1: np.ndarray, omega: np.ndarray | None, time: np.ndarray) -> tuple[np.ndarray, float]:
    """((n, 4, 4), `place_motions`' misfit) for poses (n, 4, 4) or (1, 4, 4), angular velocities (n, 3), (1, 3) or None,
    times (n,) or (1,); all C-contiguous float64."""
    counts = [len(X0), len(X1), len(time)] + ([] if omega is None else [len(omega)])
    n = max(counts) if min(counts) else 0
    out = np.empty((n, 4, 4))
    ends = np.array([address_of(X0), address_of(X1)], dtype=np.int64)
    work = np.zeros(WORKSPACE)
    worst = place_motions(
        address_of(ends), 16 * (len(X0) > 1), 16 * (len(X1) > 1), 0 if omega is None else address_of(omega),
        0 if omega is None else 3 * (len(omega) > 1), address_of(time), int(len(time) > 1), n, address_of(work),
        address_of(out),
    )
    return out, float(worst)
