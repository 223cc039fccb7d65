"""Where the numbers of a pair of polygons stand in the workspaces of planar kernels."""

from __future__ import annotations

from typing import NamedTuple

# Doubles: rotations of P and Q, row by row; translations; the largest magnitude of a rotation's entries, of P and Q;
# p_WQ − p_WP; how many vertices were read; whether the poses' digits are made.
ROTATION, TRANSLATION, RHO, SHIFT, N_READ, SURVEYED, SLOTS = 0, 8, 12, 14, 16, 17, 20
# A slot: coordinates in the polygon's frame (2), relative to P's origin in W's axes, magnitude, polygon, vertex.
X, Y, MAGNITUDE, BODY, VERTEX, SLOT = 2, 3, 4, 5, 6, 8
#: Slots of a workspace.
N_SLOTS = 20
# Signs of T_P's vertices against T_Q's lines, three a line.
SIGNS = SLOTS + SLOT * N_SLOTS
#: Doubles of workspace.
DOUBLES = SIGNS + 12

# What the slots hold: T_P's vertices; the ends of T_Q's edges, two each; both neighbours of a vertex; the last line
# that kept a chain of P, as the ends of its direction and a vertex on it; vertices of P whose segment holds a point
# beyond the chord of Q's chain; a vertex where a third line is tried.
P_SLOTS, Q_SLOTS, NEXT, PREVIOUS, KEPT_LINE, KEPT_POINT, PENCIL = 0, 3, 9, 10, 11, 14, 16

#: Most digits of a coordinate: 2^2600 between the largest and the smallest bit. Coordinates to 1e50 times rotations of
#: entries below 2 have fewer.
LONGEST = 112
# Integers, in units of LONGEST: the rotations' entries, one coordinate, two vectors, four sides, a determinant,
# what is known of the poses.
ROTATIONS_AT, COORDINATE_AT, VECTORS_AT, SIDES_AT = 0, 8 * LONGEST, 9 * LONGEST, 13 * LONGEST
MINOR_AT, SURVEY_AT = 21 * LONGEST, 25 * LONGEST
#: Integers of workspace.
INTEGERS = 26 * LONGEST

# A row of results, of integers: hit, how it is proven, rounds, vertices read, whether P is B; vertices of P and of Q
# whose hulls meet, −1 where there are fewer; two lines (polygon of the direction + 2 where it is turned, its ends, the
# vertex of P on it); a vertex of P.
HIT, HOW, ROUNDS, READ, SWAPPED, OF_P, OF_Q, LINE, SECOND_LINE, TANGENT, ROW = 0, 1, 2, 3, 4, 5, 9, 15, 19, 23, 24
# How a pair is proven: by a common point; a line; a line between two; two different points; not at all.
COMMON_POINT, ONE_LINE, TWO_LINES, TWO_POINTS, LOST = 0, 1, 2, 3, 4


class Line(NamedTuple):
    """A line, by slots: its direction is from ``start`` to ``end``, its point is ``through``.

    turned : the direction is from ``start`` to ``end``, turned left by a right angle.
    """

    start: int
    end: int
    through: int
    turned: bool
