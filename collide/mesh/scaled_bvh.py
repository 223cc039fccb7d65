"""The tree of a scaled copy of a mesh: the same nodes, their boxes scaled and rounded outwards.

No facet is sorted again. A corner of the copy is a corner times the factor, rounded once, by at most 2⁻⁵³ of itself;
so is the centre that boxes are relative to. Floats round 2⁻²⁴ of a box's centre and half length.
"""

from __future__ import annotations

import math

import numpy as np

from collide.mesh.bvh import NOTHING, WIDTH, MeshTree
from collide.mesh.fine_boxes import with_origins


def scaled_tree(tree: MeshTree, vertices: np.ndarray, faces: np.ndarray, factor: float) -> MeshTree:
    """The tree over faces (m, 3) of ``vertices`` (n, 3), the vertices of ``tree`` times ``factor`` > 0, rounded.

    By a power of two nothing is rounded, and the nodes are the same array. O(m), without sorting.
    """
    triangles = vertices[faces[tree.ids]].reshape(-1, 9)
    mantissa, exponent = math.frexp(factor)
    if mantissa == 0.5:
        centre, exponent = tree.centre * factor, tree.exponent + exponent - 1
        return MeshTree(tree.nodes, triangles, tree.ids, centre, exponent, tree.depth, tree.has_origins, False)
    # Between 0.5 and 1: boxes stay within their unit.
    centre, unit = tree.centre * factor, math.ldexp(1.0, tree.exponent + exponent)
    slop = (np.abs(triangles).max() + np.abs(centre).max()) * 2.0**-51 / unit + 1e-37
    nodes = tree.nodes.copy()
    floats = nodes[:, : 6 * WIDTH].view(np.float32).reshape(-1, 2, 3, WIDTH)
    scaled = floats.astype(np.float64) * mantissa
    floats[:, 0] = scaled[:, 0]
    half_lengths = scaled[:, 1] * (1 + 2.0**-22) + np.abs(scaled[:, 0]) * 2.0**-22 + slop
    used = floats[:, 1] > NOTHING / 2
    floats[:, 1] = np.where(used, half_lengths, floats[:, 1])
    scaled_copy = MeshTree(nodes, triangles, tree.ids, centre, tree.exponent + exponent, tree.depth, False, False)
    return with_origins(scaled_copy) if tree.has_origins else scaled_copy
