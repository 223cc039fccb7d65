"""Probes: a box or a triangle of one tree as compared with the boxes of the other tree (`mesh/box_overlap.py`).

All lengths are in the units of the probe's tree. Half lengths and half-spaces are enlarged by bounds of the errors of
rounding to floats and of the relation of the frames (`posed_surfaces.py`).
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import kernel
from collide.mesh.box_overlap import PROBE
from collide.mesh.bvh import CENTRE, EXPONENT, HAS_ORIGINS, box_at
from collide.mesh.triangle import normal_of, range_along, sum_of_normals
from collide.narrowphase.facets.filtered_triangles import TINY
from collide.narrowphase.facets.fine_probes import set_fine_prism, set_fine_probe
from collide.narrowphase.facets.posed_surfaces import FRAME_SIZE, FRAMES
from collide.narrowphase.facets.probe_parts import (
    SLAB_AT,
    box_of_triangle,
    clear_slab,
    put_floats,
    triangle_in_units,
    unit_of,
)
from collide.numerics.vec3 import absolute, add, cross, divide, dot, max_abs, sub, vec3_at

_FLOAT_ERROR = 2.0**-19


@kernel(inline=True)
def set_box(placing, which, box, probe):
    """Make a box the probe.   which : 0 for a box of A, 1 for a box of B."""
    to_probe = FRAMES + FRAME_SIZE * which
    to_node = FRAMES + FRAME_SIZE * (1 - which)
    for i in range(3):
        row = vec3_at(placing, to_node + 3 * i)
        probe[i] = np.float32(dot(row, box.centre) + placing[to_node + 9 + i])
        probe[3 + i] = np.float32(dot(absolute(row), box.half) + placing[to_node + 12 + i])
    put_floats(probe, 6, sub(vec3_at(placing, to_probe + 9), box.centre))
    put_floats(probe, 9, add(box.half, vec3_at(placing, to_probe + 12)))


@kernel(inline=True)
def set_node_probe(placing, which, tree, ref, link, nodes, node, probe):
    """Make a box the probe of a node of the other tree, with a slab around its facets where it holds a leaf.

    tree, ref, link : of the box.   nodes, node : the other tree and its node.
    """
    if nodes.header[HAS_ORIGINS] != 0:
        set_fine_probe(placing, which, tree, ref, link, nodes, node, probe)
        return
    set_box(placing, which, box_at(tree, ref), probe)
    if link < 0:
        _set_slab(placing, which, tree, ~link, probe)
    else:
        clear_slab(probe)


@kernel
def set_prism(placing, which, tree, facet, nodes, node, probe):
    """Make a facet the probe: its box, the slab along its plane, and a half-space along each edge.

    A large triangle across its axes fills little of its box, whose finer neighbours in the other tree only this culls.
    """
    if nodes.header[HAS_ORIGINS] != 0:
        set_fine_prism(placing, which, tree, facet, nodes, node, probe)
        return
    triangle = triangle_in_units(tree, facet)
    p, q, r = triangle
    set_box(placing, which, box_of_triangle(triangle), probe)
    n = unit_of(normal_of(triangle))
    middle, reach = _set_line(placing, which, n, probe, SLAB_AT)
    low_n = min(dot(n, p), dot(n, q), dot(n, r))
    high_n = max(dot(n, p), dot(n, q), dot(n, r))
    probe[SLAB_AT + 3] = np.float32(middle - 0.5 * (low_n + high_n))
    probe[SLAB_AT + 4] = np.float32(reach + 0.5 * (high_n - low_n) + _FLOAT_ERROR * abs(middle))
    _set_edge(placing, which, unit_of(cross(sub(q, p), n)), triangle, probe, PROBE)
    _set_edge(placing, which, unit_of(cross(sub(r, q), n)), triangle, probe, PROBE + 4)
    _set_edge(placing, which, unit_of(cross(n, sub(r, p))), triangle, probe, PROBE + 8)


@kernel(inline=True)
def _set_edge(placing, which, out, triangle, probe, at):
    """The half-space of outward direction ``out`` that just holds a triangle."""
    middle, reach = _set_line(placing, which, out, probe, at)
    top = max(dot(out, triangle.p), dot(out, triangle.q), dot(out, triangle.r))
    probe[at + 3] = np.float32(middle - top - reach - _FLOAT_ERROR * abs(middle))


@kernel(inline=True)
def _set_line(placing, which, n, probe, at):
    """Write a direction n of the probe's frame as the node's has it; returns n · shift and a bound of its rounding."""
    to_probe = FRAMES + FRAME_SIZE * which
    middle = dot(n, vec3_at(placing, to_probe + 9))
    # Of the frame, of heights and of the sums of floats; a triangle is within its units.
    reach = _FLOAT_ERROR * 6.0 + 2.0**-110
    return middle, _set_direction(placing, to_probe, n, reach, probe, at)


@kernel(inline=True)
def _set_direction(placing, to_probe, n, reach, probe, at):
    """Write a direction of the probe's frame as the node's has it; returns ``reach`` plus the frame's rounding."""
    reach += dot(absolute(n), vec3_at(placing, to_probe + 12))
    for j in range(3):
        entry = n.x * placing[to_probe + j] + n.y * placing[to_probe + 3 + j] + n.z * placing[to_probe + 6 + j]
        probe[at + j] = np.float32(entry)
        reach += _FLOAT_ERROR * abs(entry)
    return reach


@kernel
def _set_slab(placing, which, tree, run, probe):
    """Add the slab around a leaf's facets to the probe of its box.

    A box around a large triangle across its axes holds whole regions of a finer mesh: where leaves are compared with
    nodes, the slab culls those.
    """
    first = run >> 3
    last = first + (run & 7)
    total = sum_of_normals(tree.triangles, first, last)
    if not max_abs(total) > TINY:
        clear_slab(probe)
        return
    n = divide(total, max_abs(total))
    low, high = range_along(n, tree.triangles, first, last, vec3_at(tree.numbers, CENTRE))
    unit = math.ldexp(1.0, int(-tree.header[EXPONENT]))
    to_probe = FRAMES + FRAME_SIZE * which
    middle = dot(n, vec3_at(placing, to_probe + 9)) - 0.5 * (low + high) * unit
    # What rounding can do to the frame, to heights and to the sums of floats.
    reach = 0.5 * (high - low) * unit + _FLOAT_ERROR * (3.0 + abs(middle)) + 2.0**-110
    probe[SLAB_AT + 3] = np.float32(middle)
    probe[SLAB_AT + 4] = np.float32(_set_direction(placing, to_probe, n, reach, probe, SLAB_AT))
