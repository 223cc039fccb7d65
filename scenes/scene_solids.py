"""The bodies of scenes as solids with facets: operands of booleans, partitions and obstacles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import collide
from collide.errors import CollideError, InvalidArgument, UnsupportedQuery, brief, listing
from collide.lowering.facet_bodies import facet_body
from collide.scenes.description import Scene
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape
from collide.shapes.tessellation import tessellate


class PlacedSolid(NamedTuple):
    """A solid of a scene.   name : of its body.   X_WS : (4, 4) its pose in the world."""

    name: str
    shape: Shape
    X_WS: np.ndarray


def solids_of(scene: Scene, tolerance: float | None = None) -> list[PlacedSolid]:
    """Every body of a scene as a solid with facets, unions part by part.

    tolerance : for shapes without facets of their own, how far their triangles may be off [m]; None refuses them.
    Raises InvalidArgument for surfaces without an inside, and an empty scene; UnsupportedQuery for shapes without
    facets, by the name of the body.
    """
    solids = [
        PlacedSolid(body.name, _with_facets(shape, f"{scene.name}: {body.name}", tolerance), X)
        for body in scene.bodies
        for shape, X in _parts(body.shape, body.X_WB)
    ]
    if not solids:
        raise InvalidArgument(f"scene {scene.name} has no bodies to make a solid of")
    return solids


def without(scenes: list[Scene], names: list[str]) -> list[Scene]:
    """The scenes without bodies of these names. Raises InvalidArgument for a name that none has."""
    known = {body.name for scene in scenes for body in scene.bodies}
    for name in names:
        if name not in known:
            raise InvalidArgument(f"--without: no body has the name {brief(name)}; there are {listing(sorted(known))}")
    return [replace(scene, bodies=[body for body in scene.bodies if body.name not in names]) for scene in scenes]


def union_of(solids: list[PlacedSolid], progress=None) -> tuple[Mesh, float]:
    """(the union of solids as one mesh in the world, how far rounding moved it [m])."""
    shapes, poses = [solid.shape for solid in solids], [solid.X_WS for solid in solids]
    r = collide.combine(shapes, poses, "union", progress=progress)
    if r.mesh is None:
        raise InvalidArgument(f"{solids[0].name} and the bodies with it enclose nothing once corners are doubles")
    return r.mesh, r.moved


def _parts(shape: Shape, X: np.ndarray) -> Iterator[tuple[Shape, np.ndarray]]:
    if isinstance(shape, Compound):
        for part, X_SP in shape.items:
            yield from _parts(part, X if np.array_equal(X_SP, np.eye(4)) else X @ X_SP)
    else:
        yield shape, X


def _with_facets(shape: Shape, place: str, tolerance: float | None) -> Shape:
    try:
        body = facet_body(shape, place)
    except UnsupportedQuery as error:
        if tolerance is None:
            raise UnsupportedQuery(f"{error}; --tolerance 1mm takes triangles within a millimetre for it") from None
        try:
            return Mesh(*tessellate(shape, tolerance=tolerance)[:2])
        except CollideError as unbounded:
            raise UnsupportedQuery(f"{place}: {unbounded}; --without leaves a body out") from None
    if not body.solid:
        what = "its points lie in one plane"
        if isinstance(shape, Mesh):
            what = "; ".join(str(defect) for defect in shape.report.defects if defect.spoils) or brief(shape)
            what += "; --repair makes a solid of it where that is safe"
        raise InvalidArgument(f"{place} has no inside: {what}")
    return shape
