"""The hull of a box's eight corners, known without a search: facet ``2 k`` and ``2 k + 1`` are face k.

Faces are −x, +x, −y, +y, −z, +z. Quickhull puts these twelve triangles in some forty orders, by the proportions of the
box, and takes twenty times as long.
"""

from __future__ import annotations

from collide.kernels import kernel, view_f64

_CORNERS = 8
#: Faces of a box, and triangles.
BOX_FACES, BOX_FACETS = 6, 12


@kernel
def are_box_corners(points_at, count):
    """Whether points (count, 3) are a box's corners with edges along the axes, in the order of their signs.

    Bits of a corner's number tell its sides along x, y, z, z being the lowest bit. Comparisons are exact, and so is
    the hull.
    """
    if count != _CORNERS:
        return False
    points = view_f64(points_at, 3 * _CORNERS)
    for axis in range(3):
        low, high = points[axis], points[3 * (_CORNERS - 1) + axis]
        if not low < high:
            return False
        for k in range(_CORNERS):
            if points[3 * k + axis] != (high if (k >> (2 - axis)) & 1 else low):
                return False
    return True


@kernel(inline=True)
def box_corner(face, k):
    """The corner with number k of a face, counter-clockwise seen from outside, the least first."""
    axis = face // 2
    along, across = 1 << (2 - (axis + 1) % 3), 1 << (2 - (axis + 2) % 3)
    if face % 2 == 0:
        along, across = across, along
    corner = (face % 2) << (2 - axis)
    if k == 1 or k == 2:
        corner += along
    return corner + across if k >= 2 else corner


@kernel
def put_box_hull(vertices, surface):
    """Write the numbers of the corners, and the triangles, counter-clockwise seen from outside."""
    for k in range(_CORNERS):
        vertices[k] = k
    for face in range(BOX_FACES):
        for triangle in range(2):
            at = 6 * face + 3 * triangle
            surface[at] = box_corner(face, 0)
            surface[at + 1] = box_corner(face, 1 + triangle)
            surface[at + 2] = box_corner(face, 2 + triangle)
