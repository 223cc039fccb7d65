"""A slab for every box of a tree: what lies in the box lies between two planes across its mean normal.

A box around a patch that is flat and lies across its axes is thick in the direction that counts, that of the
patch's normal: as thick as the patch is long. Its slab is as thick as the patch bends, which is quadratically less.
Distances use them: along a direction g, with any number a, a point y of the patch has
g·y = a n·y + (g − a n)·y, the first held by the slab, the second by the box. They are made when first asked for.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f32, view_f64
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    N_NODES,
    NODE,
    NOTHING,
    SLAB,
    WIDTH,
    MeshTree,
    open_tree,
)

#: As in `build_bvh.py`: outward rounding to floats.
_OUTWARD, _LEAST = 2.0**-22, 2.0**-120


def make_slabs(tree: MeshTree) -> np.ndarray:
    """(k, 40) float32: of each node's eight boxes the normals' x, y, z, and the slabs' middles and half widths.

    In the units of the boxes and relative to the tree's centre; rounded outwards. O(m·depth).
    """
    slabs = np.zeros((len(tree.nodes), SLAB), dtype=np.float32)
    work = np.empty(5 * len(tree.nodes))
    fill_slabs(tree.address, address_of(slabs), address_of(work))
    return slabs


@entry("void(int64, int64, int64)")
def fill_slabs(header_at, slabs_at, work_at):
    """work : 5 doubles a node: the sum of its facets' normals, and the first and last of its facets."""
    header, numbers, boxes, links, triangles, _ = open_tree(header_at)
    n = header[N_NODES]
    slabs = view_f32(slabs_at, SLAB * n)
    work = view_f64(work_at, 5 * n)
    scale = math.ldexp(1.0, int(-header[EXPONENT]))
    for node in range(n - 1, -1, -1):
        for k in range(3):
            work[5 * node + k] = 0.0
        work[5 * node + 3] = math.inf
        work[5 * node + 4] = -math.inf
        for slot in range(WIDTH):
            if boxes[NODE * node + 3 * WIDTH + slot] < 0.5 * NOTHING:
                continue
            link = int(links[NODE * node + 6 * WIDTH + slot])
            x, y, z, first, last = _below(triangles, work, link)
            work[5 * node] += x
            work[5 * node + 1] += y
            work[5 * node + 2] += z
            work[5 * node + 3] = min(work[5 * node + 3], float(first))
            work[5 * node + 4] = max(work[5 * node + 4], float(last))
            _set_slab(triangles, numbers, scale, first, last, x, y, z, slabs, SLAB * node + slot)


@kernel
def _below(triangles, work, link):
    """(x, y, z, first, last): the sum of the normals of the facets behind a link, and which they are."""
    if link >= 0:
        at = 5 * link
        return work[at], work[at + 1], work[at + 2], int(work[at + 3]), int(work[at + 4])
    first = ~link >> 3
    last = first + (~link & 7)
    sx = 0.0
    sy = 0.0
    sz = 0.0
    for i in range(first, last):
        a = 9 * i
        ux = triangles[a + 3] - triangles[a]
        uy = triangles[a + 4] - triangles[a + 1]
        uz = triangles[a + 5] - triangles[a + 2]
        vx = triangles[a + 6] - triangles[a]
        vy = triangles[a + 7] - triangles[a + 1]
        vz = triangles[a + 8] - triangles[a + 2]
        sx += uy * vz - uz * vy
        sy += uz * vx - ux * vz
        sz += ux * vy - uy * vx
    return sx, sy, sz, first, last


@kernel
def _set_slab(triangles, numbers, scale, first, last, x, y, z, slabs, at):
    """The slab across (x, y, z) around a run of facets."""
    size = max(abs(x), abs(y), abs(z))
    if not size > 1e-280:
        x = 1.0
        y = 0.0
        z = 0.0
        size = 1.0
    x /= size
    y /= size
    z /= size
    length = math.sqrt(x * x + y * y + z * z)
    nx = np.float32(x / length)
    ny = np.float32(y / length)
    nz = np.float32(z / length)
    x = float(nx)
    y = float(ny)
    z = float(nz)
    low = math.inf
    high = -math.inf
    for k in range(3 * first, 3 * last):
        height = (
            x * (triangles[3 * k] - numbers[CENTRE])
            + y * (triangles[3 * k + 1] - numbers[CENTRE + 1])
            + z * (triangles[3 * k + 2] - numbers[CENTRE + 2])
        )
        low = min(low, height)
        high = max(high, height)
    low *= scale
    high *= scale
    middle = np.float32(0.5 * (low + high))
    half = max(high - float(middle), float(middle) - low)
    slabs[at] = nx
    slabs[at + WIDTH] = ny
    slabs[at + 2 * WIDTH] = nz
    slabs[at + 3 * WIDTH] = middle
    # Heights are good to 8u of the box's size, at most 4 units.
    slabs[at + 4 * WIDTH] = np.float32(half + (half * _OUTWARD + _LEAST + 2.0**-48))
