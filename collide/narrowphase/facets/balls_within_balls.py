"""Balls within larger balls."""

from __future__ import annotations

from collide.kernels import entry, view_f64, view_u8


@entry("int64(int64, int64, int64, int64, int64)")
def within_balls(balls_at, n_balls, points_at, n, out_at):
    """Write for n balls, centres and radii (n, 4), whether any of n_balls larger balls holds the ball; returns 0.

    balls : (n_balls, 4), the largest first. The holder of the ball before is asked first.
    """
    balls, points, out = view_f64(balls_at, 4 * n_balls), view_f64(points_at, 4 * n), view_u8(out_at, n)
    last = 0
    for k in range(n):
        x, y, z, radius = points[4 * k], points[4 * k + 1], points[4 * k + 2], points[4 * k + 3]
        for k_ball in range(-1, n_balls):
            i = 4 * (last if k_ball < 0 else k_ball)
            reach = balls[i + 3] - radius
            if not reach > 0.0:
                if k_ball < 0:
                    continue
                break
            p, q, r = balls[i] - x, balls[i + 1] - y, balls[i + 2] - z
            if p * p + q * q + r * r < reach * reach * (1.0 - 2.0**-40):
                out[k] = 1
                last = i // 4
                break
    return 0
