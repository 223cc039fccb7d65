"""T_P against T_Q: a triangle of three vertices of P, and the edge hull of three edges of Q.

Found is either a common point, or a line with all of T_P on a side and all of T_Q strictly on the other. The point
is a vertex of T_P, or the crossing of an edge of T_P into T_Q with the line of an edge of Q, placed by
signs alone. The line is the line of an edge of Q or of T_P: by Helly's theorem in the plane three half-planes have no
common point, two of them belong to the same triangle, and the line of the third separates. T_Q may be unbounded.

A Q of two vertices is the intersection of four half-planes, two of them across its ends: here T_Q is Q.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.papers.polytopes.planar_layout import P_SLOTS, Q_SLOTS, SIGNS, Line
from collide.papers.polytopes.planar_predicates import minor_of, side_along, side_of, vector_between, vertex_in

#: What `compare_triangles` finds: a vertex of T_P in T_Q; an edge of T_P that enters T_Q; Q in T_P; all of T_P beyond
#: an edge of Q; all of T_Q beyond an edge of T_P; nothing, which cannot be.
VERTEX, CROSSING, INSIDE, BEYOND_Q, BEYOND_P, NOTHING = 0, 1, 2, 3, 4, 5


class Relation(NamedTuple):
    """What, and where.

    i, j : of T_P's vertices; an edge from i to j.   k : of T_Q's edges.
    """

    what: int
    i: int
    j: int
    k: int


@kernel
def line_of_q(pair, k):
    """The line of edge k of T_Q, Q on its left."""
    if pair.m > 2:
        return Line(Q_SLOTS + 2 * k, Q_SLOTS + 2 * k + 1, Q_SLOTS + 2 * k, False)
    if k < 2:
        return Line(Q_SLOTS + k, Q_SLOTS + 1 - k, Q_SLOTS, False)
    return Line(Q_SLOTS + 2 - k + 1, Q_SLOTS + k - 2, Q_SLOTS + k - 2, True)


@kernel
def n_lines(pair):
    """Lines of T_Q."""
    return 3 if pair.m > 2 else 4


@kernel
def compare_triangles(pair, count):
    """The `Relation` of T_P, of ``count`` vertices, and T_Q."""
    signs = pair.doubles
    lines = n_lines(pair)
    for k in range(lines):
        line = line_of_q(pair, k)
        direction = vector_between(signs, line.start, line.end)
        outside = 0
        for i in range(count):
            # 1 : the vertex lies strictly beyond the edge.
            sign = -side_along(pair, line, direction, P_SLOTS + i)
            signs[SIGNS + 3 * k + i] = float(sign)
            outside += 1 if sign > 0 else 0
        if outside == count:
            return Relation(BEYOND_Q, 0, 0, k)
    for i in range(count):
        inside = True
        for k in range(lines):
            inside = inside and signs[SIGNS + 3 * k + i] <= 0.0
        if inside:
            return Relation(VERTEX, i, i, 0)
    for i in range(count if count > 1 else 0):
        j = (i + 1) % count
        k = _entering_line(pair, i, j)
        if k >= 0:
            return Relation(CROSSING, i, j, k)
    if count == 3 and _q_in_triangle(pair):
        return Relation(INSIDE, 0, 0, 0)
    for i in range(count if count > 1 else 0):
        j = (i + 1) % count
        edge = Line(P_SLOTS + i, P_SLOTS + j, P_SLOTS + i, False)
        if side_of(pair, edge, Q_SLOTS) < 0 and _misses_line(pair, i, j):
            return Relation(BEYOND_P, i, j, 0)
    return Relation(NOTHING, 0, 0, 0)


@kernel
def _q_in_triangle(pair):
    """Whether a vertex of Q lies in T_P: with no edge of T_P in T_Q, all of Q does then."""
    for i in range(3):
        j = (i + 1) % 3
        edge = Line(P_SLOTS + i, P_SLOTS + j, P_SLOTS + i, False)
        if side_of(pair, edge, Q_SLOTS) < 0:
            return False
    return True


@kernel
def _is_later(pair, k, second, i, j):
    """Sign of t_k − t_second, where the line through T_P's vertices i and j, at t = 0 and 1, crosses lines of T_Q.

    Both are crossed inwards, or both outwards; where k is crossed inwards and the second outwards, the sign is the
    opposite.
    """
    return -minor_of(pair, line_of_q(pair, k), line_of_q(pair, second), P_SLOTS + i, P_SLOTS + j)


@kernel
def _entering_line(pair, i, j):
    """The line of T_Q crossed by the edge from i to j at its entry, both ends outside T_Q; −1 for a miss."""
    signs = pair.doubles
    enters = -1
    leaves = -1
    for k in range(n_lines(pair)):
        start = signs[SIGNS + 3 * k + i]
        end = signs[SIGNS + 3 * k + j]
        if start > 0.0 and end > 0.0:
            return -1
        if start > 0.0:
            if enters < 0 or _is_later(pair, k, enters, i, j) > 0:
                enters = k
        elif end > 0.0 and (leaves < 0 or _is_later(pair, k, leaves, i, j) < 0):
            leaves = k
    if enters >= 0 and leaves >= 0 and _is_later(pair, enters, leaves, i, j) < 0:
        return -1
    return enters


@kernel
def _misses_line(pair, i, j):
    """Whether T_Q has no point on the line through vertices i and j of T_P."""
    signs = pair.doubles
    enters = -1
    leaves = -1
    for k in range(n_lines(pair)):
        line = line_of_q(pair, k)
        # Where along the line the half-plane begins or ends: whether j lies farther out than i.
        slope = -side_of(pair, Line(line.start, line.end, P_SLOTS + i, line.turned), P_SLOTS + j)
        if slope == 0:
            if signs[SIGNS + 3 * k + i] > 0.0:
                return True
        elif slope < 0:
            if enters < 0 or _is_later(pair, k, enters, i, j) > 0:
                enters = k
        elif leaves < 0 or _is_later(pair, k, leaves, i, j) < 0:
            leaves = k
    return enters >= 0 and leaves >= 0 and _is_later(pair, enters, leaves, i, j) < 0


@kernel
def chord_beyond(pair, relation):
    """The chord of CH(e_0, e_1, e_2) with a relation's point beyond: k for the chord from e_k to e_{k+1}; −1 for a
    point inside.

    The chord of neighbouring edges is a vertex, with no point of T_Q beyond.
    """
    if pair.m <= 2:
        return -1
    i, j = P_SLOTS + relation.i, P_SLOTS + relation.j
    if relation.what == VERTEX:
        for k in range(3):
            end = Q_SLOTS + 2 * k + 1
            start = Q_SLOTS + 2 * ((k + 1) % 3)
            is_chord = vertex_in(pair.doubles, end) != vertex_in(pair.doubles, start)
            if is_chord and side_of(pair, Line(end, start, end, False), i) < 0:
                return k
        return -1
    # The edge from i to j goes inwards over the line of edge k: seen along it, the edge's end lies to the right.
    across = Line(i, j, i, False)
    if side_of(pair, across, Q_SLOTS + 2 * relation.k + 1) > 0:
        return relation.k
    if side_of(pair, across, Q_SLOTS + 2 * relation.k) < 0:
        return (relation.k + 2) % 3
    return -1
