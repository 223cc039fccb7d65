"""Two convex polygons in O(log n + log m), nothing prepared: section 2 of Barba and Langerman, Theorem 2.1.

A round compares T_P, the hull of three vertices of P, with T_Q, the intersection of the half-planes of three edges of Q
(`planar_triangles.py`), and halves the vertices or the edges that may still matter. Invariants after every round:

* P and Q meet if and only if CH(V*) and EH(E*) do, V* the remaining chain of P, EH(E*) the edge hull of the remaining
  chain of edges of Q. (The paper speaks of an *edge* of E*; a P inside Q meets no edge.)
* If V* is not all of P, a line through an end of V*, the hot end, has Q strictly beyond and of P only points of
  CH(V*) beyond.
* If E* is not all of Q, P has a point x in EH(E*) strictly beyond the chord of E*.

Separated, a line through a vertex v of T_P, not crossed by T_P, with Q strictly beyond, keeps the chain of P
on its far side, or no chain. If P crosses the line on the side of a chain given up, P and Q are apart: no point of P is
between the line and the hot line. At the hot vertex the edge of P then separates; at the other end a line
through the crossing of both separates, tangent to P between the ends, found by halving the same chain on
(`_tangent_between`).

Not separated, a point x of both triangles lies in CH(e_0, e_1, e_2), a part of Q, or beyond a chord of its three
chords. The edges cut off by the chord are kept. If P also has a point y of the new edge hull not beyond the chord, the
segment xy, in P (the paper writes in Q), crosses the chord: hence the other edges have no say, and a point y like this
in a later round is a hit. x need not lie on the boundary of T_Q, and T_Q may be unbounded.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.papers.polytopes.planar_layout import (
    COMMON_POINT,
    HIT,
    HOW,
    KEPT_LINE,
    KEPT_POINT,
    LINE,
    LOST,
    N_READ,
    NEXT,
    OF_P,
    OF_Q,
    ONE_LINE,
    P_SLOTS,
    PENCIL,
    PREVIOUS,
    Q_SLOTS,
    READ,
    ROUNDS,
    ROW,
    SECOND_LINE,
    TANGENT,
    TWO_LINES,
    TWO_POINTS,
    Line,
)
from collide.papers.polytopes.planar_predicates import (
    body_in,
    copy_slot,
    in_one_place,
    minor_of,
    read_vertex,
    side_of,
    vertex_in,
)
from collide.papers.polytopes.planar_triangles import (
    BEYOND_P,
    CROSSING,
    INSIDE,
    NOTHING,
    chord_beyond,
    compare_triangles,
    line_of_q,
)

#: Which of T_P's vertices is hot, beside 0 and 2: none, all of P remains; and outcomes of a pruning: P and Q are apart,
#: proven by one line; or apart, by a line between two that is to be relation.
_ALL_OF_P, _APART, _APART_BETWEEN = -1, -2, -3

#: Rounds halve a chain: polygons of 2³¹ vertices take 68. Whoever takes more has lost its way.
_MAX_ROUNDS = 128


class ChainOfP(NamedTuple):
    """The chain kept by a pruning: from T_P's vertex ``first`` to the next, and its hot end in ``hot``, 0 or 2, or the
    reason to stop.
    """

    first: int
    hot: int


@kernel
def search_planar(pair, out, at):
    """Whether P and Q meet, and why: writes the row of `planar_layout.py` that begins at out[at], but for SWAPPED.

    P may be a point or a segment; Q has no fewer vertices than P then.
    """
    doubles = pair.doubles
    for k in range(ROW):
        out[at + k] = -1
    out[at + HIT] = 0
    count = _start(pair)
    hot = _ALL_OF_P
    chain_of_q = False
    rounds = 0
    if pair.m == 1:
        _compare_points(pair, out, at)
        rounds = 1
    while rounds == 0 or out[at + HOW] < 0:
        rounds += 1
        relation = compare_triangles(pair, count)
        if relation.what == NOTHING or rounds > _MAX_ROUNDS:
            out[at + HOW] = LOST
        elif relation.what <= INSIDE:
            k = chord_beyond(pair, relation) if relation.what != INSIDE else -1
            if k < 0 or (chain_of_q and k == 2):
                _write_hit(pair, relation, chain_of_q, out, at)
            else:
                _keep_edges(pair, relation, k)
                chain_of_q = True
        else:
            chain = _chain_beyond(pair, relation, hot, out, at)
            if chain.hot >= 0:
                _keep_vertices(pair, chain)
            elif chain.hot == _APART_BETWEEN:
                rounds += _tangent_between(pair, hot, out, at)
            hot = chain.hot
    out[at + ROUNDS] = rounds
    out[at + READ] = int(doubles[N_READ])


@kernel
def _start(pair):
    """Read the first T_P and T_Q; returns the number of T_P's vertices."""
    count = min(pair.n, 3)
    for i in range(count):
        read_vertex(pair, P_SLOTS + i, 0, i * pair.n // count)
    if pair.m <= 2:
        for k in range(pair.m):
            read_vertex(pair, Q_SLOTS + k, 1, k)
        return count
    for k in range(3):
        _read_edge(pair, k, k * pair.m // 3)
    return count


@kernel
def _read_edge(pair, k, vertex):
    """Make the edge of Q from a vertex on edge k of T_Q."""
    read_vertex(pair, Q_SLOTS + 2 * k, 1, vertex)
    read_vertex(pair, Q_SLOTS + 2 * k + 1, 1, (vertex + 1) % pair.m)


@kernel
def _compare_points(pair, out, at):
    """P and Q are points."""
    out[at + OF_P] = 0
    out[at + OF_Q] = 0
    if in_one_place(pair, P_SLOTS, Q_SLOTS):
        out[at + HIT] = 1
        out[at + HOW] = COMMON_POINT
    else:
        out[at + HOW] = TWO_POINTS


@kernel
def _write_hit(pair, relation, chain_of_q, out, at):
    """Write vertices of P and of Q whose hulls meet."""
    doubles = pair.doubles
    out[at + HIT] = 1
    out[at + HOW] = COMMON_POINT
    if relation.what == INSIDE:
        for i in range(3):
            out[at + OF_P + i] = vertex_in(doubles, P_SLOTS + i)
        out[at + OF_Q] = vertex_in(doubles, Q_SLOTS)
        return
    out[at + OF_P] = vertex_in(doubles, P_SLOTS + relation.i)
    if relation.what == CROSSING:
        out[at + OF_P + 1] = vertex_in(doubles, P_SLOTS + relation.j)
    if chain_of_q:
        out[at + OF_P + 2] = vertex_in(doubles, KEPT_POINT)
        out[at + OF_P + 3] = vertex_in(doubles, KEPT_POINT + 1)
    for k in range(6 if pair.m > 2 else 2):
        out[at + OF_Q + k] = vertex_in(doubles, Q_SLOTS + k)


# --- edges of Q ---------------------------------------------------------------------------------


@kernel
def _copy_edge(doubles, to, source):
    copy_slot(doubles, Q_SLOTS + 2 * to, Q_SLOTS + 2 * source)
    copy_slot(doubles, Q_SLOTS + 2 * to + 1, Q_SLOTS + 2 * source + 1)


@kernel
def _keep_edges(pair, relation, k):
    """Keep the chain of Q from edge k of T_Q to the next; T_Q becomes its ends and its median, x is kept."""
    doubles = pair.doubles
    copy_slot(doubles, KEPT_POINT, P_SLOTS + relation.i)
    copy_slot(doubles, KEPT_POINT + 1, P_SLOTS + relation.j)
    first = vertex_in(doubles, Q_SLOTS + 2 * k)
    last = vertex_in(doubles, Q_SLOTS + 2 * ((k + 1) % 3))
    length = (last - first + pair.m) % pair.m
    if k == 0:
        _copy_edge(doubles, 2, 1)
    elif k == 1:
        _copy_edge(doubles, 0, 1)
    else:  # from edge 2 to edge 0: they change places over edge 1
        _copy_edge(doubles, 1, 0)
        _copy_edge(doubles, 0, 2)
        _copy_edge(doubles, 2, 1)
    _read_edge(pair, 1, (first + length // 2) % pair.m)


# --- vertices of P ------------------------------------------------------------------------------


@kernel
def _write_line(pair, line, out, at):
    """A line through a vertex of P, P to its right, Q strictly to its left."""
    doubles = pair.doubles
    out[at] = body_in(doubles, line.start) + (2 if line.turned else 0)
    out[at + 1] = vertex_in(doubles, line.start)
    out[at + 2] = vertex_in(doubles, line.end)
    out[at + 3] = vertex_in(doubles, line.through)


@kernel
def _gap_after(pair, i):
    """Edges of P from T_P's vertex i to the next."""
    first = vertex_in(pair.doubles, P_SLOTS + i)
    last = vertex_in(pair.doubles, P_SLOTS + (i + 1) % 3)
    return (last - first + pair.n) % pair.n


@kernel
def _chain_beyond(pair, relation, hot, out, at):
    """The `ChainOfP` beyond the line of a relation; that line becomes KEPT_LINE, or the row's proof."""
    doubles = pair.doubles
    if relation.what == BEYOND_P:
        line = Line(P_SLOTS + relation.j, P_SLOTS + relation.i, P_SLOTS + relation.i, False)
        removed = hot >= 0 and relation.i == 2
        if removed:
            _write_hot_edge(pair, hot, out, at)
            return ChainOfP(0, _APART)
        if pair.n > 3 and _gap_after(pair, relation.i) > 1:
            _keep_line(doubles, line)
            return ChainOfP(relation.i, 0)
        _write_proof(pair, line, out, at)
        return ChainOfP(0, _APART)
    edge = line_of_q(pair, relation.k)
    v = _nearest_to(pair, edge, hot)
    line = Line(edge.start, edge.end, P_SLOTS + v, edge.turned)
    if pair.n > 3:
        vertex = vertex_in(doubles, P_SLOTS + v)
        for step in range(2):  # towards the next vertex, towards the one before
            slot = NEXT if step == 0 else PREVIOUS
            read_vertex(pair, slot, 0, (vertex + (1 if step == 0 else pair.n - 1)) % pair.n)
            if side_of(pair, line, slot) > 0:
                if hot >= 0 and v == (2 if step == 0 else 0):
                    return _apart_beyond_end(pair, line, v, hot, out, at)
                _keep_line(doubles, line)
                return ChainOfP(v, 0) if step == 0 else ChainOfP((v + 2) % 3, 2)
    _write_proof(pair, line, out, at)
    return ChainOfP(0, _APART)


@kernel
def _nearest_to(pair, edge, hot):
    """The vertex of T_P nearest to the line of an edge of Q, T_P beyond the line; of two nearest the hot vertex."""
    v = max(hot, 0)
    for i in range(min(pair.n, 3)):
        if i != v and side_of(pair, Line(edge.start, edge.end, P_SLOTS + v, edge.turned), P_SLOTS + i) > 0:
            v = i
    return v


@kernel
def _keep_line(doubles, line):
    """Copy the line to KEPT_LINE, since its own slots will be overwritten."""
    copy_slot(doubles, KEPT_LINE, line.start)
    copy_slot(doubles, KEPT_LINE + 1, line.end)
    copy_slot(doubles, KEPT_LINE + 2, line.through)


@kernel
def _write_proof(pair, line, out, at):
    out[at + HOW] = ONE_LINE
    _write_line(pair, line, out, at + LINE)


@kernel
def _write_hot_edge(pair, hot, out, at):
    """The proof is the edge of P at the hot vertex, on the side of the chain that remains."""
    h = vertex_in(pair.doubles, P_SLOTS + hot)
    out[at + HOW] = ONE_LINE
    out[at + LINE] = 0
    out[at + LINE + 1] = (h + 1) % pair.n if hot == 0 else h
    out[at + LINE + 2] = h if hot == 0 else (h + pair.n - 1) % pair.n
    out[at + LINE + 3] = h


@kernel
def _apart_beyond_end(pair, line, v, hot, out, at):
    """P crosses the line through an end of V* on the side of what was given up: P and Q are apart."""
    if v == hot:
        _write_hot_edge(pair, hot, out, at)
        return ChainOfP(0, _APART)
    out[at + HOW] = TWO_LINES
    first_line = Line(KEPT_LINE, KEPT_LINE + 1, KEPT_LINE + 2, False)
    _write_line(pair, first_line, out, at + LINE)
    _write_line(pair, line, out, at + SECOND_LINE)
    copy_slot(pair.doubles, NEXT, line.start)
    copy_slot(pair.doubles, NEXT + 1, line.end)
    return ChainOfP(0, _APART_BETWEEN)


@kernel
def _keep_vertices(pair, chain):
    """T_P becomes the ends and the median of a chain of P."""
    doubles = pair.doubles
    i = chain.first
    first = vertex_in(doubles, P_SLOTS + i)
    length = _gap_after(pair, i)
    if i == 0:
        copy_slot(doubles, P_SLOTS + 2, P_SLOTS + 1)
    elif i == 1:
        copy_slot(doubles, P_SLOTS, P_SLOTS + 1)
    else:
        copy_slot(doubles, P_SLOTS + 1, P_SLOTS)
        copy_slot(doubles, P_SLOTS, P_SLOTS + 2)
        copy_slot(doubles, P_SLOTS + 2, P_SLOTS + 1)
    read_vertex(pair, P_SLOTS + 1, 0, (first + length // 2) % pair.n)


@kernel
def _tangent_between(pair, hot, out, at):
    """Find the vertex of V* where a line through the crossing of two lines is tangent to P; returns the rounds taken.

    KEPT_LINE passes through the hot end, the second line, whose direction stands in the slots from NEXT, through the
    other end. Write f and g for how far a point lies to the left of them: Q has f, g > 0, the chain g ≤ 0, what was
    given up f ≤ 0. At a vertex w of the chain with f(w) > 0 the line through w is −g(w) f + f(w) g = 0, and Q is
    strictly to its left. It is tangent to P where no neighbour of w is to its left, too; else the search goes on
    towards that neighbour.
    """
    doubles = pair.doubles
    cold = 2 - hot
    step = 1 if hot == 0 else pair.n - 1
    hot_vertex = vertex_in(doubles, P_SLOTS + hot)
    first_line = Line(KEPT_LINE, KEPT_LINE + 1, KEPT_LINE + 2, False)
    second_line = Line(NEXT, NEXT + 1, P_SLOTS + cold, False)
    low = 0
    high = (vertex_in(doubles, P_SLOTS + 2) - vertex_in(doubles, P_SLOTS) + pair.n) % pair.n
    rounds = 0
    while high - low > 1:
        rounds += 1
        middle = (low + high) // 2
        read_vertex(pair, PENCIL, 0, (hot_vertex + step * middle) % pair.n)
        if side_of(pair, first_line, PENCIL) <= 0:
            high = middle
            continue
        read_vertex(pair, PENCIL + 1, 0, (hot_vertex + step * (middle - 1)) % pair.n)
        # −g(w) f(x) + f(w) g(x), of the neighbour x towards the hot end, then of the other.
        if minor_of(pair, first_line, second_line, PENCIL, PENCIL + 1) > 0:
            high = middle
            continue
        read_vertex(pair, PENCIL + 1, 0, (hot_vertex + step * (middle + 1)) % pair.n)
        if minor_of(pair, first_line, second_line, PENCIL, PENCIL + 1) > 0:
            low = middle
            continue
        out[at + TANGENT] = vertex_in(doubles, PENCIL)
        return rounds
    out[at + HOW] = LOST
    return rounds
