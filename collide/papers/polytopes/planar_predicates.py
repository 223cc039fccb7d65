"""Signs of two posed convex polygons: the side of a line of a vertex, and the order of two crossings.

A pair of polygons is P and Q; the caller decides the roles of A and B. Vertices read by a search stand
in *slots* of the workspace, and lines are named by slots. Every sign is exact: doubles with a bound
of their rounding error first, integers (`planar_exact.py`) for open signs. The bound of a vector
between two vertices of a polygon is relative to the vector's length, so that short edges of large polygons do not need
integers.

u is 2⁻⁵³. A vector within a polygon is a difference (u), turned (two products and a sum): 3 u of its magnitude. A
posed vertex carries 3 u of its magnitude, a difference of two of them 4 u. A product of two difference vectors has an
error below 2·(3 + 4) u + 4 u of the product of their magnitudes, second orders aside; 32 u are taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.papers.polytopes.planar_exact import exact_minor, exact_side, exact_vector
from collide.papers.polytopes.planar_layout import (
    BODY,
    MAGNITUDE,
    N_READ,
    RHO,
    ROTATION,
    SHIFT,
    SLOT,
    SLOTS,
    SURVEYED,
    TRANSLATION,
    VERTEX,
    X,
    Y,
)

#: Bound of the error of `side_value` in units of the product of both magnitudes.
_ERROR = 2.0**-48
#: Of a difference of posed vertices, in units of its magnitude.
_VECTOR_ERROR = 2.0**-50
#: Rounding of a 2 × 2 determinant of sides.
_MINOR_ERROR = 2.0**-51
#: What underflow may add to a product; numbers so small are left to integers.
_TINY = 1e-290


class PolygonPair(NamedTuple):
    """Two posed polygons as a search sees them.

    P, Q : coordinates in the polygons' own frames, two a vertex, counter-clockwise [m].   n, m : numbers of vertices.
    doubles, integers : workspaces (`planar_layout.py`); the first holds both poses.
    """

    P: Any
    n: int
    Q: Any
    m: int
    doubles: Any
    integers: Any


class PlanarVector(NamedTuple):
    """A vector in W [m]; magnitude : no less than either component, in units of which its error is bounded."""

    x: float
    y: float
    magnitude: float


@kernel
def set_planar_poses(doubles, pose_p, pose_q):
    """Write two poses, views of the nine entries of a matrix (3, 3), into the workspace."""
    for body in range(2):
        pose = pose_p if body == 0 else pose_q
        at = ROTATION + 4 * body
        doubles[at] = pose[0]
        doubles[at + 1] = pose[1]
        doubles[at + 2] = pose[3]
        doubles[at + 3] = pose[4]
        doubles[TRANSLATION + 2 * body] = pose[2]
        doubles[TRANSLATION + 2 * body + 1] = pose[5]
        doubles[RHO + body] = max(max(abs(pose[0]), abs(pose[1])), max(abs(pose[3]), abs(pose[4])))
    doubles[SHIFT] = pose_q[2] - pose_p[2]
    doubles[SHIFT + 1] = pose_q[5] - pose_p[5]
    doubles[N_READ] = 0.0
    doubles[SURVEYED] = 0.0


@kernel
def read_vertex(pair, slot, body, vertex):
    """Read a vertex into a slot: its own coordinates, and those relative to P's origin in W's axes."""
    doubles = pair.doubles
    vertices = pair.P if body == 0 else pair.Q
    x = vertices[2 * vertex]
    y = vertices[2 * vertex + 1]
    doubles[N_READ] += 1.0
    at = SLOTS + SLOT * slot
    R = ROTATION + 4 * body
    doubles[at] = x
    doubles[at + 1] = y
    doubles[at + X] = doubles[R] * x + doubles[R + 1] * y
    doubles[at + Y] = doubles[R + 2] * x + doubles[R + 3] * y
    doubles[at + MAGNITUDE] = doubles[RHO + body] * (abs(x) + abs(y))
    if body == 1:
        doubles[at + X] += doubles[SHIFT]
        doubles[at + Y] += doubles[SHIFT + 1]
        doubles[at + MAGNITUDE] += abs(doubles[SHIFT]) + abs(doubles[SHIFT + 1])
    doubles[at + BODY] = float(body)
    doubles[at + VERTEX] = float(vertex)


@kernel
def copy_slot(doubles, to, source):
    """Slot ``to`` becomes what slot ``source`` is."""
    for k in range(SLOT):
        doubles[SLOTS + SLOT * to + k] = doubles[SLOTS + SLOT * source + k]


@kernel
def vertex_in(doubles, slot):
    """Which vertex of its polygon stands in a slot."""
    return int(doubles[SLOTS + SLOT * slot + VERTEX])


@kernel
def body_in(doubles, slot):
    """Whose vertex stands in a slot: 0 for P, 1 for Q."""
    return int(doubles[SLOTS + SLOT * slot + BODY])


@kernel
def vector_between(doubles, i, j):
    """The `PlanarVector` from the vertex in slot i to that in slot j."""
    at_i = SLOTS + SLOT * i
    at_j = SLOTS + SLOT * j
    if doubles[at_i + BODY] != doubles[at_j + BODY]:
        return PlanarVector(
            doubles[at_j + X] - doubles[at_i + X],
            doubles[at_j + Y] - doubles[at_i + Y],
            doubles[at_i + MAGNITUDE] + doubles[at_j + MAGNITUDE],
        )
    body = int(doubles[at_i + BODY])
    R = ROTATION + 4 * body
    x = doubles[at_j] - doubles[at_i]
    y = doubles[at_j + 1] - doubles[at_i + 1]
    return PlanarVector(
        doubles[R] * x + doubles[R + 1] * y,
        doubles[R + 2] * x + doubles[R + 3] * y,
        doubles[RHO + body] * (abs(x) + abs(y)),
    )


class Side(NamedTuple):
    """How far a vertex lies to the left of a line, times the length of its direction [m²], and its error's bound."""

    value: float
    error: float


@kernel
def side_value(doubles, line, slot):
    """The `Side` of the vertex in a slot, in doubles: direction × (vertex − a point of the line)."""
    return _side_value(doubles, line, vector_between(doubles, line.start, line.end), slot)


@kernel(inline=True)
def _side_value(doubles, line, d, slot):
    e = vector_between(doubles, line.through, slot)
    value = d.x * e.y - d.y * e.x
    if line.turned:
        value = -(d.x * e.x + d.y * e.y)
    return Side(value, _ERROR * d.magnitude * e.magnitude + _TINY)


@kernel
def side_of(pair, line, slot):
    """1 where the vertex in a slot lies to the left of the line, −1 to the right, 0 on it: exactly."""
    return side_along(pair, line, vector_between(pair.doubles, line.start, line.end), slot)


@kernel
def side_along(pair, line, direction, slot):
    """The same, where the line's direction is at hand as a `PlanarVector`."""
    side = _side_value(pair.doubles, line, direction, slot)
    if abs(side.value) > side.error:
        return 1 if side.value > 0.0 else -1
    return exact_side(pair.doubles, pair.integers, line, slot)


@kernel
def minor_of(pair, line, second, i, j):
    """Sign of F(line, i)·F(second, j) − F(line, j)·F(second, i), F a `Side` and i, j slots: exactly."""
    doubles = pair.doubles
    a = side_value(doubles, line, i)
    b = side_value(doubles, second, j)
    c = side_value(doubles, line, j)
    d = side_value(doubles, second, i)
    p = a.value * b.value
    q = c.value * d.value
    value = p - q
    error = abs(a.value) * b.error + abs(b.value) * a.error + a.error * b.error
    error += abs(c.value) * d.error + abs(d.value) * c.error + c.error * d.error
    error = error * (1.0 + 2.0**-40) + _MINOR_ERROR * (abs(p) + abs(q)) + _TINY
    if abs(value) > error:
        return 1 if value > 0.0 else -1
    return exact_minor(doubles, pair.integers, line, second, i, j)


@kernel
def in_one_place(pair, i, j):
    """Whether the vertices in two slots, of different polygons, are one point of W: exactly."""
    d = vector_between(pair.doubles, i, j)
    if max(abs(d.x), abs(d.y)) > _VECTOR_ERROR * d.magnitude + _TINY:
        return False
    return exact_vector(pair.doubles, pair.integers, i, j)
