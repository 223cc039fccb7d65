"""Two half-spaces: unless their outward normals are exactly opposite they meet, and the overlap has no end."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.halfspace_convex import plane_in_world
from collide.narrowphase.rows import CERTIFIED, DISTANCE, HIT, HOW, LOWER, UPPER, write_vectors
from collide.numerics.vec3 import cross, divide, dot, vec3_at
from collide.results import FORMULA, UNDECIDED

#: Sine of the angle between normals that may be exactly opposite, also of composed poses.
_OPPOSITE = 512.0 * 2.0**-53


@kernel
def halfspace_halfspace(pair, flip, row):
    """Write the row of two half-spaces. Opposite within rounding is left open, for `opposite_halfspaces.py` to
    settle."""
    A = plane_in_world(pair, pair.A)
    B = plane_in_world(pair, pair.B)
    across = cross(A.normal, B.normal)
    opposite = dot(A.normal, B.normal) < 0.0 and math.sqrt(dot(across, across)) <= _OPPOSITE * A.length * B.length
    row.doubles[LOWER] = -math.inf
    row.doubles[DISTANCE] = -math.inf
    row.doubles[UPPER] = 0.0
    row.flags[HIT] = 1
    row.flags[HOW] = UNDECIDED if opposite else FORMULA
    row.flags[CERTIFIED] = 0 if opposite else 1
    p_WA, p_WB = vec3_at(pair.poses, pair.A.pose_at + 9), vec3_at(pair.poses, pair.B.pose_at + 9)
    write_vectors(row, divide(A.normal, A.length), p_WA, p_WB, flip)
