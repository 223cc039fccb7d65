"""A slab for every box of a tree: the facets in the box lie between two planes across their mean normal.

A box around a flat patch askew to the axes is thick in the direction that counts, along the patch's
normal: as thick as the patch is long. Its slab is as thick as the patch bends, which is quadratically less.
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
    HAS_ORIGINS,
    N_NODES,
    NODE,
    NOTHING,
    SLAB,
    WIDTH,
    MeshTree,
    float_column_at,
    link_of,
    open_tree,
    origin_of,
)
from collide.mesh.triangle import range_along, sum_of_normals
from collide.numerics.vec3 import Vec3, add, divide, dot, max_abs, put_vec3, vec3_at

#: As in `build_bvh.py`: outward rounding to floats.
_OUTWARD, _SMALLEST = 2.0**-22, 2.0**-120


def make_slabs(tree: MeshTree) -> np.ndarray:
    """(k, 40) float32: of each node's eight boxes the normals' x, y, z, and the slabs' middles and half widths.

    In the units of the boxes and relative to what they are; rounded outwards. O(m·depth).
    """
    slabs = np.zeros((len(tree.nodes), SLAB), dtype=np.float32)
    work = np.empty(5 * len(tree.nodes))
    fill_slabs(tree.address, address_of(slabs), address_of(work))
    return slabs


@entry("void(int64, int64, int64)")
def fill_slabs(header_at, slabs_at, work_at):
    """work : 5 doubles a node: the sum of its facets' normals, and the first and last of its facets."""
    tree = open_tree(header_at)
    n = tree.header[N_NODES]
    slabs = view_f32(slabs_at, SLAB * n)
    work = view_f64(work_at, 5 * n)
    for node in range(n - 1, -1, -1):
        total = Vec3(0.0, 0.0, 0.0)
        work[5 * node + 3] = math.inf
        work[5 * node + 4] = -math.inf
        for slot in range(WIDTH):
            if tree.boxes[NODE * node + 3 * WIDTH + slot] < 0.5 * NOTHING:
                continue
            normal, first, last = _normals_below(tree.triangles, work, link_of(tree.links, WIDTH * node + slot))
            total = add(total, normal)
            work[5 * node + 3] = min(work[5 * node + 3], float(first))
            work[5 * node + 4] = max(work[5 * node + 4], float(last))
            _set_slab(tree, node, first, last, normal, slabs, SLAB * node + slot)
        put_vec3(work, 5 * node, total)


@kernel
def _normals_below(triangles, work, link):
    """(sum of the normals of the facets behind a link, the first of them, the last)."""
    if link >= 0:
        at = 5 * link
        return vec3_at(work, at), int(work[at + 3]), int(work[at + 4])
    first = ~link >> 3
    last = first + (~link & 7)
    return sum_of_normals(triangles, first, last), first, last


@kernel
def _set_slab(tree, node, first, last, normal, slabs, at):
    """The slab across a direction around a run of facets."""
    size = max_abs(normal)
    if not size > 1e-280:
        normal = Vec3(1.0, 0.0, 0.0)
        size = 1.0
    normal = divide(normal, size)
    normal = divide(normal, math.sqrt(dot(normal, normal)))
    slabs[at] = np.float32(normal.x)
    slabs[at + WIDTH] = np.float32(normal.y)
    slabs[at + 2 * WIDTH] = np.float32(normal.z)
    low, high = range_along(float_column_at(slabs, at), tree.triangles, first, last, vec3_at(tree.numbers, CENTRE))
    scale = math.ldexp(1.0, int(-tree.header[EXPONENT]))
    low *= scale
    high *= scale
    if tree.header[HAS_ORIGINS] != 0:
        height = dot(float_column_at(slabs, at), origin_of(tree.links, node))
        low -= height
        high -= height
    middle = np.float32(0.5 * (low + high))
    half = max(high - float(middle), float(middle) - low)
    slabs[at + 3 * WIDTH] = middle
    # Heights are good to 8u of the box's size, at most 4 units.
    slabs[at + 4 * WIDTH] = np.float32(half + (half * _OUTWARD + _SMALLEST + 2.0**-48))
