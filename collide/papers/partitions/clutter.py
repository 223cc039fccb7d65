"""How cluttered the facets of a mesh are: de Berg's clutter factor, measured from below."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.shapes.mesh import Mesh

_AXES = np.eye(3)


class Clutter(NamedTuple):
    """What cubes without a corner of a facet's box inside them meet.

    max_facets, mean : facets, at most and on average, over the cubes looked at; κ is at least ``max_facets``.
    cubes : how many were looked at.
    """

    max_facets: int
    mean: float
    cubes: int


def clutter(mesh: Mesh, cubes: int = 200, seed: int = 0) -> Clutter:
    """The clutter factor of a mesh's facets, from below: cubes around points of facets, as large as may be.

    Parameters
    ----------
    mesh : facets, not necessarily closed.
    cubes : number of cubes, around random points on random facets.   seed : of the random points.

    Returns
    -------
    Clutter. Hits of facets and cubes are decided in doubles, so nearly touching facets may be counted.

    Notes
    -----
    The clutter factor is the largest number of objects meeting a cube with no corner of an object's axis-aligned box
    inside (M. de Berg, 2000): O(log n) for the facets of local meshes (J. Erickson, "Local polyhedra and geometric
    graphs", lemma 5.1). O(n) a cube.
    """
    if not isinstance(mesh, Mesh):
        raise InvalidArgument(f"clutter: mesh must be a collide.Mesh, got {checks.brief(mesh)}")
    cubes, seed = checks.integer("clutter: cubes", cubes, 1), checks.integer("clutter: seed", seed, 0)
    rng = np.random.default_rng(seed)
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    which = (np.arange(8)[:, None] >> np.arange(3)) & 1
    guards = np.stack([np.stack((low, high), axis=1)[:, which[:, k], k] for k in range(3)], axis=2).reshape(-1, 3)
    guards = np.unique(guards, axis=0)
    counts = []
    for facet in rng.integers(len(corners), size=cubes).tolist():
        centre = rng.dirichlet((1.0, 1.0, 1.0)) @ corners[facet]
        half = float(np.abs(guards - centre).max(axis=1).min())
        near = ((low <= centre + half) & (high >= centre - half)).all(axis=1)
        counts.append(int(_meets_cube(corners[near] - centre, half).sum()))
    return Clutter(max(counts), float(np.mean(counts)), cubes)


def _meets_cube(corners: np.ndarray, half: float) -> np.ndarray:
    """(k,) bool: triangles (k, 3, 3) that meet the cube of half width ``half`` about the origin; 13 separating axes
    decide.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    axes = [np.broadcast_to(axis, (len(corners), 3)) for axis in _AXES]
    axes += [np.cross(edges[:, 0], edges[:, 1])]
    axes += [np.cross(edges[:, k], axis) for k in range(3) for axis in _AXES]
    meets = np.ones(len(corners), dtype=bool)
    for axis in axes:
        along = np.einsum("ijk,ik->ij", corners, axis)
        reach = half * np.abs(axis).sum(axis=1)
        meets &= (along.min(axis=1) <= reach) & (along.max(axis=1) >= -reach)
    return meets
