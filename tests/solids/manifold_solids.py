"""manifold3d's booleans of two solids, for the benchmark of solids and the tests that judge its volumes."""

from __future__ import annotations

import numpy as np

OPERATIONS = ("union", "intersection", "difference")


def manifold_of(vertices, faces):
    import manifold3d

    # Copies: its binding takes no arrays that are read-only.
    corners, triangles = np.array(vertices, order="C"), np.array(faces, dtype=np.uint64, order="C")
    return manifold3d.Manifold(manifold3d.Mesh64(vert_properties=corners, tri_verts=triangles))


def asked(A, B, op: str):
    """(the result, its volume)."""
    made = A + B if op == "union" else A ^ B if op == "intersection" else A - B
    return made, made.volume()
