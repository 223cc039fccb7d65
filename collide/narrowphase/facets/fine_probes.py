"""Probes of the nodes of a tree whose boxes are relative to their node (`mesh/fine_boxes.py`): nothing in them is
enlarged by the size of a mesh.

With v = 2⁻²⁴, a comparison |c − p| > h + P in floats is off by at most v |p| + 3 v (h + P); one along an axis of the
probe, |s + F·c| > R + |F|·h, by at most 5 v |s| + 6 v |F|·(h + |c|) + 6 v R; a half-space's by twice that at most. The
node's half lengths h are stored larger by 16 v (h + |c|), which holds the parts in h and c; what is left is relative to
numbers of the probe alone. Besides, places in doubles are off by what the placing says.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import kernel
from collide.mesh.box_overlap import PROBE
from collide.mesh.bvh import CENTRE, EXPONENT, HAS_ORIGINS, box_at, origin_of
from collide.mesh.triangle import normal_of, range_along, sum_of_normals
from collide.narrowphase.facets.filtered_triangles import TINY
from collide.narrowphase.facets.posed_surfaces import FRAME_SIZE, FRAMES
from collide.narrowphase.facets.probe_parts import (
    SLAB_AT,
    box_of_triangle,
    clear_slab,
    put_floats,
    triangle_in_units,
    unit_of,
)
from collide.numerics.vec3 import Vec3, absolute, component, cross, divide, dot, max_abs, sub, vec3_at

#: What floats round, of the numbers of a probe: 16 v.
_FLOATS = 2.0**-20


class _Line(NamedTuple):
    """A direction of the probe's frame: what its heights over the node's origin are from those over the tree's centre;
    and what they are off by in doubles."""

    shift: float
    error: float


@kernel
def set_fine_probe(placing, which, tree, ref, link, nodes, node, probe):
    """`box_probes.set_node_probe` for a node that has an origin."""
    origin = origin_of(nodes.links, node)
    _set_box(placing, which, box_at(tree, ref), origin, probe)
    clear_slab(probe)
    if link < 0:
        first = ~link >> 3
        last = first + (~link & 7)
        total = sum_of_normals(tree.triangles, first, last)
        if max_abs(total) > TINY:
            n = divide(total, max_abs(total))
            low, high = range_along(n, tree.triangles, first, last, vec3_at(tree.numbers, CENTRE))
            unit = math.ldexp(1.0, int(-tree.header[EXPONENT]))
            _set_slab(_set_line(placing, which, n, origin, probe, SLAB_AT), low * unit, high * unit, probe)


@kernel
def set_fine_prism(placing, which, tree, facet, nodes, node, probe):
    """`box_probes.set_prism` for a node that has an origin."""
    origin = origin_of(nodes.links, node)
    triangle = triangle_in_units(tree, facet)
    p, q, r = triangle
    _set_box(placing, which, box_of_triangle(triangle), origin, probe)
    n = unit_of(normal_of(triangle))
    low = min(dot(n, p), dot(n, q), dot(n, r))
    high = max(dot(n, p), dot(n, q), dot(n, r))
    _set_slab(_set_line(placing, which, n, origin, probe, SLAB_AT), low, high, probe)
    _set_edge(placing, which, unit_of(cross(sub(q, p), n)), triangle, origin, probe, PROBE)
    _set_edge(placing, which, unit_of(cross(sub(r, q), n)), triangle, origin, probe, PROBE + 4)
    _set_edge(placing, which, unit_of(cross(n, sub(r, p))), triangle, origin, probe, PROBE + 8)


@kernel
def move_probe(nodes, node, frame, probe, moved):
    """A probe from the centre of a tree with origins as a probe from the origin of a node; both may be the same array.

    The probe keeps its size: enlarged for floats from the tree's centre, the probe holds two roundings more.
    """
    o = origin_of(nodes.links, node)
    for k in range(PROBE):
        moved[k] = probe[k]
    put_floats(moved, 0, Vec3(float(probe[0]) - o.x, float(probe[1]) - o.y, float(probe[2]) - o.z))
    for i in range(3):
        along = float(frame[3 * i]) * o.x + float(frame[3 * i + 1]) * o.y + float(frame[3 * i + 2]) * o.z
        moved[6 + i] = np.float32(float(probe[6 + i]) + along)


@kernel(inline=True)
def probe_of_node(nodes, node, frame, probe, workspace):
    """A probe from a tree's centre as compared with a node's boxes; ``workspace`` holds a probe that must move."""
    if nodes.header[HAS_ORIGINS] == 0:
        return probe
    move_probe(nodes, node, frame, probe, workspace)
    return workspace


@kernel
def _set_box(placing, which, box, origin, probe):
    to_probe = FRAMES + FRAME_SIZE * which
    to_node = FRAMES + FRAME_SIZE * (1 - which)
    across = sub(vec3_at(placing, to_probe + 9), box.centre)
    for i in range(3):
        row = vec3_at(placing, to_node + 3 * i)
        middle = dot(row, box.centre) + placing[to_node + 9 + i] - component(origin, i)
        half = dot(absolute(row), box.half)
        probe[i] = np.float32(middle)
        probe[3 + i] = np.float32(half + _FLOATS * (half + abs(middle)) + placing[to_node + 15 + i])
        gap = component(across, i) + dot(vec3_at(placing, to_probe + 3 * i), origin)
        half = component(box.half, i)
        probe[6 + i] = np.float32(gap)
        probe[9 + i] = np.float32(half + _FLOATS * (half + abs(gap)) + placing[to_probe + 15 + i])


@kernel(inline=True)
def _set_line(placing, which, n, origin, probe, at):
    """Write a direction n of the probe's frame as the node's has it."""
    to_probe = FRAMES + FRAME_SIZE * which
    shift = dot(n, vec3_at(placing, to_probe + 9))
    for j in range(3):
        entry = n.x * placing[to_probe + j] + n.y * placing[to_probe + 3 + j] + n.z * placing[to_probe + 6 + j]
        probe[at + j] = np.float32(entry)
        shift += entry * component(origin, j)
    return _Line(shift, 2.0 * dot(absolute(n), vec3_at(placing, to_probe + 15)) + 2.0**-110)


@kernel(inline=True)
def _set_slab(line, low, high, probe):
    """The slab between two heights of the probe's frame."""
    middle = line.shift - 0.5 * (low + high)
    half = 0.5 * (high - low)
    probe[SLAB_AT + 3] = np.float32(middle)
    probe[SLAB_AT + 4] = np.float32(half + _FLOATS * (half + abs(middle)) + line.error)


@kernel(inline=True)
def _set_edge(placing, which, out, triangle, origin, probe, at):
    """The half-space of outward direction ``out`` that just holds a triangle."""
    line = _set_line(placing, which, out, origin, probe, at)
    height = line.shift - max(dot(out, triangle.p), dot(out, triangle.q), dot(out, triangle.r))
    probe[at + 3] = np.float32(height - _FLOATS * abs(height) - line.error)
