"""Vertices inserted into a convex surface in sequence, by exact tests alone: the fallback of `vertex_cutting`.

The triangles below a new point make a connected region; a fan from the point to its rim takes their place.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import kernel
from collide.papers.hierarchies.half_edges import drop_triangle, following, join, new_triangle, preceding
from collide.papers.hierarchies.symbolic_perturbation import side


@kernel
def sees(cloud, mesh, t, v):
    """Whether v lies above triangle t."""
    corners = mesh.corners
    a, b, c = np.int64(corners[3 * t]), np.int64(corners[3 * t + 1]), np.int64(corners[3 * t + 2])
    return side(cloud, a, b, c, v) > 0


@kernel
def insert_near(cloud, mesh, seen, v, near, region, rim, stack):
    """Put v, above a triangle at vertex ``near``, into the surface; ``False`` if v is above no triangle at ``near``.

    seen : by triangle, the last vertex found above.
    region, rim, stack : an entry for each half-edge visible from v.
    Vertices removed from the surface have −1 in ``leaving``.
    """
    corners, twins, leaving = mesh.corners, mesh.twins, mesh.leaving
    first = np.int64(leaving[near])
    h = first
    while not sees(cloud, mesh, h // 3, v):
        h = np.int64(twins[preceding(h)])
        if h == first:
            return False
    n_seen = 1
    edges = 0
    region[0] = h // 3
    seen[h // 3] = v
    stack[0], stack[1], stack[2] = preceding(h), following(h), h
    depth = 3
    # Depth first, edges in their order: the rim comes out in its order, too.
    while depth > 0:
        depth -= 1
        g = np.int64(twins[stack[depth]])
        t = g // 3
        if seen[t] == v:
            continue
        if sees(cloud, mesh, t, v):
            seen[t] = v
            region[n_seen] = t
            n_seen += 1
            stack[depth], stack[depth + 1] = preceding(g), following(g)
            depth += 2
        else:
            rim[edges] = g
            edges += 1
    for k in range(n_seen):
        for e in range(3 * region[k], 3 * region[k] + 3):
            leaving[corners[e]] = -1
    for k in range(n_seen):
        drop_triangle(mesh, region[k])
    before = np.int64(-1)
    start = np.int64(-1)
    for k in range(edges):
        g = rim[k]
        h = new_triangle(mesh, np.int64(corners[following(g)]), np.int64(corners[g]), v)
        join(mesh, h, g)
        if k == 0:
            start = h
        else:
            join(mesh, before + 1, h + 2)
        before = h
    join(mesh, before + 1, start + 2)
    return True
