"""Meshes as hulls of few vertices: ``meshes="hull:64"``, 64 of their vertices, and ``"hull+:64"``, 64 corners around
all of them. Simulators limit the vertices of a hull; a planner wants a body that contains the link."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import SceneError
from collide.shapes.convex_hull import ConvexHull

if TYPE_CHECKING:
    from collide.hull_levels import nested_hulls
else:  # with kernels, for a word that few files use
    nested_hulls = lazy_module("collide.hull_levels.nested_hulls")

#: The least numbers of vertices: a box has eight planes less two, eight planes have twelve corners.
_LEAST = {"": 8, "+": 12}


class HullLevel(NamedTuple):
    """vertices : at most so many.   contains : whether the hull is around the mesh, or of the mesh's vertices."""

    vertices: int
    contains: bool


def split_level(meshes: str) -> tuple[str, HullLevel | None]:
    """("hull", the level) of "hull:64" and "hull+:64"; (meshes, None) of others. Raises SceneError for few vertices."""
    named = re.fullmatch(r"hull(\+?):(\d{1,6})", meshes)
    if named is None:
        return meshes, None
    least = _LEAST[named[1]]
    if int(named[2]) < least:
        raise SceneError(f'meshes: "hull{named[1]}:N" takes N from {least} on, got {checks.brief(meshes)}')
    return "hull", HullLevel(int(named[2]), bool(named[1]))


def hull_of_level(points: np.ndarray, level: HullLevel) -> tuple[ConvexHull, str | None]:
    """(a hull of at most so many vertices, what sets it apart from the hull of all points, None: nothing)."""
    whole = ConvexHull(points)
    extreme = len(whole.hull.vertices)
    if extreme <= level.vertices:
        return whole, None
    if level.contains:
        (hull,) = nested_hulls.nested_hulls(whole, [(level.vertices + 4) // 2])
        far = hull.outer_within * 1e3
        return hull.outer, f"{len(hull.outer.points)} corners around its {extreme}, at most {far:.3g} mm outside"
    (hull,) = nested_hulls.nested_hulls(whole, [level.vertices])
    far = hull.inner_within * 1e3
    return hull.inner, f"{len(hull.inner.points)} of its {extreme} corners, which reach at most {far:.3g} mm farther"
