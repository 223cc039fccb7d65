"""A facet and a convex set, or two facets, each a flat convex set, at a single pair of poses: inside one kernel."""

from __future__ import annotations

from collide.kernels import entry, prepared, view_f64, view_i32, view_i64
from collide.lowering.packed_convex import BLOCK
from collide.lowering.set_rows import ADDRESS, INTS, LOWEST, NUMBERS, REACH
from collide.narrowphase.pose_batches import DOUBLES_AT, HEADER, INTS_AT, NUMBERS_AT
from collide.narrowphase.rows import ROW
from collide.narrowphase.single_call import write_distance
from collide.numerics.vec3 import put_vec3, vec3_at
from collide.support.point_columns import put_points

#: Behind the header of a pair: how many of the two sets are facets.
N_FACETS = HEADER
#: Behind the row, words of each facet: addresses of a mesh's vertices and faces, and the facet's number.
FACET = 3


@entry(prepared.ROW, nogil=False)
def distance_single_facets(header_at, XA_at, XB_at, row_at, depths, limit):
    """`single_call.distance_single` of a pair whose first set, or both, are facets.

    row : zeros, then the words of the facets.
    """
    header = view_i64(header_at, N_FACETS + 1)
    corners_at = header[DOUBLES_AT]
    for side in range(header[N_FACETS]):
        words = view_i64(row_at + ROW + 8 * FACET * side, FACET)
        ints = view_i64(header[INTS_AT] + 8 * INTS * side, INTS)
        corners, faces = view_f64(corners_at, 9), view_i32(words[1] + 12 * words[2], 3)
        for k in range(3):
            put_vec3(corners, 3 * k, vec3_at(view_f64(words[0] + 24 * faces[k], 3), 0))
        reach_at = header[NUMBERS_AT] + 8 * (NUMBERS * side + REACH)
        ints[LOWEST] = put_points(corners_at, 3, ints[ADDRESS], BLOCK, reach_at)
    return write_distance(header_at, XA_at, XB_at, row_at, depths, limit)
