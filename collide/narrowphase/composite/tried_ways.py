"""Many ways out of a union at once: where pairs of parts bar them, and how short they become."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.composite.clearing_translation import CLEARING, Length, barred_length, clearing_length
from collide.narrowphase.composite.composite_rows import PosedParts
from collide.narrowphase.composite.shorter_ways import SHORTER, shorter_way
from collide.numerics.vec3 import add, neg, put_vec3, scale, vec3_at

#: Doubles of workspace of both entries; and of a way: its direction, then its length as computed and as proven.
TRYING, WAY = CLEARING + SHORTER, 5
#: From each way, so many times at most shorter ones are looked for.
_TIMES = 8


@kernel(inline=True)
def _parts_at(ints_at, numbers_at, poses_at, shape_of_at, n):
    return PosedParts(
        view_i64(ints_at, INTS * n), view_f64(numbers_at, NUMBERS * n), view_f64(poses_at, POSE * n),
        view_i64(shape_of_at, n),
    )


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def spans_along(
    ints_at, numbers_at, poses_at, shape_of_at, n_parts, pairs_at, n_pairs, directions_at, n, work_at, out_at
):
    """Write for n unit vectors and n_pairs pairs of parts from where to where the pair bars the way along the vector
    [m], as far as planes tell: outside of both numbers the way is clear of the pair, but for rounding. Returns 0.

    ints, numbers, poses, shape_of : as in `answer_pairs`, of n_parts shapes and parts.   work : TRYING doubles.
    """
    parts = _parts_at(ints_at, numbers_at, poses_at, shape_of_at, n_parts)
    pairs, directions = view_i64(pairs_at, 2 * n_pairs), view_f64(directions_at, 3 * n)
    out = view_f64(out_at, 2 * n * n_pairs)
    for k in range(n):
        way = vec3_at(directions, 3 * k)
        for pair in range(n_pairs):
            pa, pb, at = pairs[2 * pair], pairs[2 * pair + 1], 2 * (k * n_pairs + pair)
            out[at] = -barred_length(parts, pa, pb, neg(way), work_at).value
            out[at + 1] = barred_length(parts, pa, pb, way, work_at).value
    return 0


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def shorten_ways(ints_at, numbers_at, poses_at, shape_of_at, n_a, n_b, directions_at, n, work_at, out_at):
    """Write a way out for each of n unit vectors, found from the vector on; returns 0.

    The first n_a parts are A's, then come B's n_b.   Others as of `spans_along`.   out : (n, WAY).
    """
    parts = _parts_at(ints_at, numbers_at, poses_at, shape_of_at, n_a + n_b)
    directions, out = view_f64(directions_at, 3 * n), view_f64(out_at, WAY * n)
    zero = Length(0.0, 0.0)
    for k in range(n):
        way = vec3_at(directions, 3 * k)
        best = clearing_length(parts, 0, n_a, n_a, n_b, way, zero, math.inf, work_at)
        for _ in range(_TIMES):
            if not best.proven < math.inf:
                break
            nearer = shorter_way(parts, 0, n_a, n_a, n_b, way, best.proven, work_at + 8 * CLEARING, work_at)
            length = clearing_length(parts, 0, n_a, n_a, n_b, nearer, zero, best.proven, work_at)
            if not length.proven < best.proven:
                break
            best, way = length, nearer
        put_vec3(out, WAY * k, add(way, scale(0.0, way)))
        out[WAY * k + 3] = best.value
        out[WAY * k + 4] = best.proven
    return 0
