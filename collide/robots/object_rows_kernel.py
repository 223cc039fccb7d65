"""Rows of an attached object moved to the object's pose in the link."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64
from collide.lowering.compound_table import BALL, CENTRE, MEASURE, PART, TURNED
from collide.numerics.vec3 import Vec3, put_vec3, vec3_at
from collide.robots.check_scene import BOX, HALF, ROUNDINGS_OF_ROTATIONS, UNBOUNDED_HALF, skew_of
from collide.robots.sphere_lanes import LESS_WITHIN, PADDED_RADIUS, RADIUS, SPHERE

#: Boxes and radii are larger, or smaller, by this share of all that goes into them, far more than a dozen roundings.
_ROUNDING = 2.0**-40


@entry("float64(int64, int64, int64, int64, int64)")
def move_parts(X_at, rows_at, out_at, n, box_at):
    """Write rows of parts (n, PART) at a pose X (4, 4), and move the box (BOX,) around them; returns by how much
    farther matrices may be from rotations. A box without end stays.

    out : a copy of the rows.
    """
    X, rows = view_f64(X_at, 16), view_f64(rows_at, PART * n)
    out, box = view_f64(out_at, PART * n), view_f64(box_at, BOX)
    skew = skew_of(X)
    is_turned = False
    for i in range(3):
        for j in range(4):
            is_turned = is_turned or X[4 * i + j] != (1.0 if i == j else 0.0)
    if not is_turned:
        return 0.0
    shift = Vec3(X[3], X[7], X[11])
    for at in range(0, PART * n, PART):
        for i in range(3):
            x, y, z = X[4 * i], X[4 * i + 1], X[4 * i + 2]
            for j in range(3):
                out[at + 3 * i + j] = x * rows[at + j] + y * rows[at + 3 + j] + z * rows[at + 6 + j]
        t = _moved(X, vec3_at(rows, at + 9))
        put_vec3(out, at + 9, t)
        # Where the product is rounded, points are off by 16 roundings of the measure, the shift and the place, which
        # `check_scene.place` adds for a larger measure.
        if rows[at + TURNED] == 0.0:
            out[at + MEASURE] = rows[at + MEASURE] + _sum_of(shift)
        else:
            out[at + MEASURE] = 2.0 * rows[at + MEASURE] + (_sum_of(t) + _sum_of(shift))
        out[at + TURNED] = 1.0
        put_vec3(out, at + CENTRE, _moved(X, vec3_at(rows, at + CENTRE)))
        out[at + BALL] = rows[at + BALL] * (1.0 + skew)
    if box[HALF] < UNBOUNDED_HALF:
        c, h = vec3_at(box, 0), vec3_at(box, HALF)
        size = _ROUNDING * (_sum_of(c) + _sum_of(h) + _sum_of(shift))
        put_vec3(box, 0, _moved(X, c))
        for i in range(3):
            at = 4 * i
            box[HALF + i] = abs(X[at]) * h.x + abs(X[at + 1]) * h.y + abs(X[at + 2]) * h.z + size
    # |Rᵀ(XᵀX − 1)R| of a part's matrix R, a rotation within 1e-4: at most three times the sum of |XᵀX − 1|.
    return 0.0 if skew < ROUNDINGS_OF_ROTATIONS else 4.0 * skew


@entry("void(int64, int64, int64, int64)")
def move_spheres(X_at, rows_at, n, n_growing):
    """Move spheres (n, SPHERE) to a pose X (4, 4). The first hold a body, and become larger by what rounding may have
    moved them and by what the matrix may lengthen; the others lie within the body, and become smaller.
    """
    X, rows = view_f64(X_at, 16), view_f64(rows_at, SPHERE * n)
    skew = skew_of(X)
    for k in range(n):
        at = SPHERE * k
        c = vec3_at(rows, at)
        moved = _moved(X, c)
        radius = abs(rows[at + RADIUS]) + abs(rows[at + PADDED_RADIUS])
        size = _sum_of(c) + _sum_of(moved) + abs(X[3]) + abs(X[7]) + abs(X[11]) + radius
        # A matrix R lengthens vectors by a factor within 1 ± |RᵀR − 1|.
        by = _ROUNDING * size + skew * radius
        put_vec3(rows, at, moved)
        if k >= n_growing:
            by = -by
        rows[at + RADIUS] += by
        rows[at + PADDED_RADIUS] += by
        rows[at + LESS_WITHIN] += 2.0 * (1.0 + _ROUNDING) * abs(by)


@kernel(inline=True)
def _moved(X, p):
    """A point at a pose (4, 4)."""
    return Vec3(
        X[0] * p.x + X[1] * p.y + X[2] * p.z + X[3], X[4] * p.x + X[5] * p.y + X[6] * p.z + X[7],
        X[8] * p.x + X[9] * p.y + X[10] * p.z + X[11],
    )


@kernel(inline=True)
def _sum_of(p):
    return abs(p.x) + abs(p.y) + abs(p.z)
