"""The growth of EPA's polytope, in doubles."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.bounds import EPA_VERTICES
from collide.narrowphase.epa.initial_polytope import capped_tetrahedron, extremal_tetrahedron
from collide.narrowphase.epa.polytope_surface import (
    FACET,
    PLANE,
    TWIN,
    ample,
    expand,
    find_patch,
    has_room,
    number,
    set_tetrahedron,
    workspace,
)
from collide.narrowphase.epa.prove_facets import prove_facets
from collide.narrowphase.gjk.minkowski_difference import (
    POINT,
    difference_point,
    has_trees,
    inlined_difference_point,
    settle_point,
)
from collide.narrowphase.gjk.simplex import face_weights
from collide.support.block_scan import least

#: How a run ends. EXPANDED: the facet nearest the origin is final, or the cap was met. FLAT: A ⊖ B
#: has no interior as far as rounding can tell.
EXPANDED, FLAT = range(2)


#: With so many vertices a repeated one is looked for among all of them: where faces are nearly parallel, runs went on
#: adding the same ones up to the cap.
_MANY = 64


@kernel(inline=True)
def _is_corner(ids, facets, f, k):
    """Whether point k is a vertex of facet f or of a neighbour, or one of many vertices, by its support vertices."""
    if ids[2 * k] < 0 or ids[2 * k + 1] < 0:
        return False
    for side in range(4):
        g = f if side == 3 else facets[FACET * f + TWIN + side] // FACET
        for corner in range(3):
            v = facets[FACET * g + corner]
            if ids[2 * v] == ids[2 * k] and ids[2 * v + 1] == ids[2 * k + 1]:
                return True
    if k >= _MANY:
        for v in range(k):
            if ids[2 * v] == ids[2 * k] and ids[2 * v + 1] == ids[2 * k + 1]:
                return True
    return False


@kernel(inline=True)
def _print(ids, k):
    """One bit of 64, from point k's support vertices: what has none of the bits met is new."""
    return 1 << ((8 * ids[2 * k] + ids[2 * k + 1]) & 63)


@kernel(inline=True)
def _surface_clearance(clearances, count, error):
    """Least distance of a facet from the origin, or −1 unless every facet provably faces outwards."""
    nearest = clearances[least(clearances, max(count, 8))]
    return nearest if nearest > error else -1.0


@kernel(inline=True)
def epa(
    pair, simplex, simplex_ids, enclosed, roomy, many, again, doubles_at, integers_at, overlap_suffices, size, error, tolerance
):  # fmt: skip
    """Expand until the nearest facet of A ⊖ B is known.

    simplex, simplex_ids : four points of A ⊖ B, which are ``enclosed`` if the origin is proven to lie among them, and
        ``roomy`` if it does so clear of rounding by far.   many : of vertices, so that rounds cost more than supports.
    again : how often it has begun elsewhere.
    overlap_suffices : stop once the origin is proven inside (a boolean is asked).
    size, error : of the pair, as in `bounds.py`.   tolerance : stop once the bracket is this narrow.

    Returns
    -------
    status : EXPANDED or FLAT.
    depth : least support value met: moving by it along n (plus ``error``) separates the cores;
        negative where that plane already does.
    clearance : proven least distance of the surface from the origin (before ``error``), or −1.
    nx, ny, nz : unit direction of that support plane.
    facet : the one nearest the origin, −1 where FLAT.   vertices, facets : how many there are. Where FLAT, the
        first vertices span what there is.
    """
    surface = workspace(doubles_at, integers_at)
    points, planes, reaches, clearances, ids, facets, starts, _, _ = surface
    rank = 3
    nx = ny = nz = 0.0
    for k in range(4 if enclosed else 0):
        for j in range(POINT):
            points[POINT * k + j] = simplex[POINT * k + j]
        ids[2 * k] = simplex_ids[2 * k]
        ids[2 * k + 1] = simplex_ids[2 * k + 1]
    # GJK's own tetrahedron saves a dozen supports, if it is nothing like as thin as those of touching bodies.
    if not (enclosed and ((many and capped_tetrahedron(pair, points, ids, size)) or roomy)):
        rank, nx, ny, nz = extremal_tetrahedron(pair, points, ids, error, again)
    if rank < 3:
        up = _extent(pair, points, ids, nx, ny, nz)
        down = _extent(pair, points, ids, -nx, -ny, -nz)
        if down < up:
            return FLAT, down, -1.0, -nx, -ny, -nz, -1, rank + 1, 0
        return FLAT, up, -1.0, nx, ny, nz, -1, rank + 1, 0
    enough = ample(size, error)
    set_tetrahedron(surface, error, enough)
    met = 0
    for k in range(4):
        met |= _print(ids, k)
    count = 4
    depth = math.inf
    facet = 0
    vertices = 4
    f = least(reaches, 8)
    distance = reaches[f]
    while True:
        f = number(f)
        if distance == math.inf:  # no facet is left that could be nearer than the way out that is known
            break
        if overlap_suffices and distance > 2.0 * error and _surface_clearance(clearances, count, error) > error:
            break
        inlined_difference_point(
            pair, points, ids, vertices, planes[PLANE * f], planes[PLANE * f + 1], planes[PLANE * f + 2], False, -1, -1
        )
        value = _height(points, planes, vertices, f)
        if overlap_suffices and value < -error and has_trees(pair):
            settle_point(pair, points, ids, vertices, planes[PLANE * f], planes[PLANE * f + 1], planes[PLANE * f + 2])
            value = _height(points, planes, vertices, f)
        facet = f  # its slot stays with the surface nearest the origin, also when it is exchanged
        if value < depth:
            depth = value
            nx = planes[PLANE * f]
            ny = planes[PLANE * f + 1]
            nz = planes[PLANE * f + 2]
        if overlap_suffices and value < -error:
            return EXPANDED, depth, -1.0, nx, ny, nz, facet, vertices, count
        if depth - distance <= tolerance or not has_room(vertices, count):
            break
        if met & _print(ids, vertices) != 0 and _is_corner(ids, facets, f, vertices):
            break
        starts[2 * vertices + 1] = -1
        found, edges = find_patch(surface, f, vertices, 0.0625 * error)
        # The nearest of what stays, while the cone's planes are worked out: neither has to wait for the other.
        nearest = least(reaches, max(count, 8))
        reach = reaches[nearest]
        count, f, distance = expand(surface, f, vertices, count, found, edges, depth, error, enough)
        stays = reach < distance
        f = nearest if stays else f
        distance = reach if stays else distance
        met |= _print(ids, vertices)
        vertices += 1
    clearance = _surface_clearance(clearances, count, error)
    if clearance < 0.0:
        prove_facets(surface, count)
        clearance = _surface_clearance(clearances, count, error)
    if has_trees(pair):
        depth = _extent(pair, points, ids, nx, ny, nz)
    return EXPANDED, depth, clearance, nx, ny, nz, facet, vertices, count


@kernel(inline=True)
def _height(points, planes, vertex, f):
    """A vertex along the normal of a facet."""
    at = POINT * vertex
    n = PLANE * f
    return planes[n] * points[at] + planes[n + 1] * points[at + 1] + planes[n + 2] * points[at + 2]


@kernel
def facet_of(surface, count, best, x, y, z, slack):
    """The facet that holds (x, y, z), the origin's foot on the final plane: for the witness points.

    It need not be the one that settled the depth. A face of A ⊖ B with more than three corners is
    covered by several facets; and where the bodies just touch, the foot may be a corner or lie on an
    edge of facets in other planes.
    """
    points, _, _, _, _, facets, _, _, _ = surface
    most = -math.inf
    for g in range(count):
        if abs(height_over(surface, g, x, y, z)) <= slack:
            at = FACET * g
            w0, w1, w2 = face_weights(
                points, POINT * number(facets[at]), POINT * number(facets[at + 1]), POINT * number(facets[at + 2]), x, y, z
            )
            inside = min(w0, w1, w2)
            if inside > most:
                most = inside
                best = g
    return best


@kernel(inline=True)
def height_over(surface, g, x, y, z):
    """Height of a point over the plane of a facet."""
    _, planes, _, _, _, _, _, _, _ = surface
    at = PLANE * g
    return planes[at] * x + planes[at + 1] * y + planes[at + 2] * z - planes[at + 3]


@kernel
def _extent(pair, points, ids, nx, ny, nz):
    """Support value of A ⊖ B in a unit direction, for certain."""
    k = EPA_VERTICES + 2
    difference_point(pair, points, ids, k, nx, ny, nz)
    if has_trees(pair):
        settle_point(pair, points, ids, k, nx, ny, nz)
    return points[POINT * k] * nx + points[POINT * k + 1] * ny + points[POINT * k + 2] * nz
