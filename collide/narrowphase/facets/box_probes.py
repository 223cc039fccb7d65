"""Probes: a box or a triangle of one tree as the boxes of the other tree are compared with it (`mesh/box_overlap.py`).

All lengths are in the units of the probe's tree, all half lengths and half-spaces enlarged by bounds of what rounding
to floats and the relation of the frames (`posed_surfaces.py`) can do.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import kernel
from collide.mesh.box_overlap import PROBE
from collide.mesh.bvh import CENTRE, EXPONENT, Box, box_at
from collide.mesh.triangle import Triangle, normal_of, range_along, sum_of_normals, triangle_at
from collide.narrowphase.facets.filtered_triangles import TINY
from collide.narrowphase.facets.posed_surfaces import FRAME_SIZE, FRAMES
from collide.numerics.vec3 import Vec3, absolute, add, cross, divide, dot, max_abs, scale, sub, vec3_at

_FLOAT_ERROR = 2.0**-19
#: Where the slab of a probe stands: its normal (3), its middle and its half width.
_SLAB = 12


@kernel(inline=True)
def set_probe(placing, which, boxes, ref, probe):
    """Make the box behind a reference the probe.   which : 0 for a box of A, 1 for one of B."""
    _set_box(placing, which, box_at(boxes, ref), probe)


@kernel(inline=True)
def _set_box(placing, which, box, probe):
    """Make a box of A or B the probe."""
    to_probe = FRAMES + FRAME_SIZE * which
    to_node = FRAMES + FRAME_SIZE * (1 - which)
    for i in range(3):
        row = vec3_at(placing, to_node + 3 * i)
        probe[i] = np.float32(dot(row, box.centre) + placing[to_node + 9 + i])
        probe[3 + i] = np.float32(dot(absolute(row), box.half) + placing[to_node + 12 + i])
    put_floats(probe, 6, sub(vec3_at(placing, to_probe + 9), box.centre))
    put_floats(probe, 9, add(box.half, vec3_at(placing, to_probe + 12)))


@kernel(inline=True)
def put_floats(floats, at, a):
    floats[at] = np.float32(a.x)
    floats[at + 1] = np.float32(a.y)
    floats[at + 2] = np.float32(a.z)


@kernel(inline=True)
def set_node_probe(placing, which, tree, ref, link, probe):
    """Make a box the probe, with a slab around its facets where it holds a leaf."""
    set_probe(placing, which, tree.boxes, ref, probe)
    if link < 0:
        _set_slab(placing, which, tree, ~link, probe)
    else:
        clear_slab(probe)


@kernel
def set_prism(placing, which, tree, facet, probe):
    """Make a facet the probe: its box, the slab along its plane, and a half-space along each edge.

    A large triangle across its axes fills little of its box, whose finer neighbours in the other tree only this culls.
    """
    unit = math.ldexp(1.0, int(-tree.header[EXPONENT]))
    centre = vec3_at(tree.numbers, CENTRE)
    corners = triangle_at(tree.triangles, 9 * facet)
    p = scale(unit, sub(corners.p, centre))
    q = scale(unit, sub(corners.q, centre))
    r = scale(unit, sub(corners.r, centre))
    triangle = Triangle(p, q, r)
    low = Vec3(min(p.x, q.x, r.x), min(p.y, q.y, r.y), min(p.z, q.z, r.z))
    high = Vec3(max(p.x, q.x, r.x), max(p.y, q.y, r.y), max(p.z, q.z, r.z))
    _set_box(placing, which, Box(scale(0.5, add(low, high)), scale(0.5, sub(high, low))), probe)
    n = _unit(normal_of(triangle))
    middle, reach = _set_line(placing, which, n, probe, _SLAB)
    low_n = min(dot(n, p), dot(n, q), dot(n, r))
    high_n = max(dot(n, p), dot(n, q), dot(n, r))
    probe[_SLAB + 3] = np.float32(middle - 0.5 * (low_n + high_n))
    probe[_SLAB + 4] = np.float32(reach + 0.5 * (high_n - low_n) + _FLOAT_ERROR * abs(middle))
    _set_edge(placing, which, _unit(cross(sub(q, p), n)), triangle, probe, PROBE)
    _set_edge(placing, which, _unit(cross(sub(r, q), n)), triangle, probe, PROBE + 4)
    _set_edge(placing, which, _unit(cross(n, sub(r, p))), triangle, probe, PROBE + 8)


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


@kernel(inline=True)
def _unit(n):
    """Scaled so that its largest component is 1; 0 where it is next to nothing."""
    size = max_abs(n)
    if not size > TINY:
        return Vec3(0.0, 0.0, 0.0)
    return divide(n, size)


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
    probe[_SLAB + 3] = np.float32(middle)
    probe[_SLAB + 4] = np.float32(_set_direction(placing, to_probe, n, reach, probe, _SLAB))


@kernel(inline=True)
def clear_slab(probe):
    for k in range(_SLAB, PROBE):
        probe[k] = np.float32(0.0)
