"""A mesh made local, as `Mesh.localised` returns it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, InvalidShape
from collide.mesh import facet_pieces, localise, locality, predicted_facets
from collide.mesh.mesh_topology import COLLAPSED
from collide.mesh.weld import weld

if TYPE_CHECKING:
    from collide.mesh.locality import Locality
    from collide.shapes.mesh import Mesh


class LocalisedMesh(NamedTuple):
    """What `Mesh.localised` returns.

    mesh : the same solid or surface, a `Mesh`. Its first vertices are those of the mesh that was localised, row by row.
    source_facets : (k,) int64, of every facet of ``mesh`` the row of the old facet that it is part of.
    moved : no new vertex is farther than this from the point of its old facet (on an old edge: of that edge) that it
        stands for, by rounding to doubles [the unit of the mesh]; 0 where all of them lie there exactly.
    before, after : `Locality` of both.
    """

    mesh: Mesh
    source_facets: np.ndarray
    moved: float
    before: Locality
    after: Locality


def localised_mesh(mesh: Mesh, stretch: float, order: int, max_facets: int, progress) -> LocalisedMesh:
    """Of `Mesh.localised`, which says what the arguments are."""
    stretch, order, max_facets = _check(stretch, order, max_facets)
    before = mesh.locality(progress=progress)
    if order >= before.distinct:
        raise InvalidArgument(
            f"Mesh.localised: order must be less than the {before.distinct} distinct vertices of the mesh, got "
            f"{order}: no vertex has so many others"
        )
    survey = mesh.survey
    rows = np.flatnonzero(survey.flags & COLLAPSED == 0)
    if not len(rows):
        raise InvalidShape("Mesh.localised: no facet has three distinct corners")
    corners = survey.corners[rows].astype(np.int64)
    if before.local_stretches[order - 1] > stretch:
        _refuse_too_many(mesh, corners, stretch, order, max_facets)
    pieces = facet_pieces.Pieces(mesh.vertices, corners)
    distinct = np.flatnonzero(weld(mesh.vertices) == np.arange(len(mesh.vertices)))
    try:
        localise.localise(pieces, distinct, stretch, order, max_facets, progress)
    except localise.Crowded as crowded:
        raise _gave_up(crowded, int(rows[crowded.facet]), stretch, order, max_facets) from None
    made = type(mesh)(pieces.points, pieces.faces, solid=mesh.solid)
    return LocalisedMesh(made, rows[pieces.source], pieces.moved(), before, made.locality(progress=progress))


def _check(stretch, order, max_facets) -> tuple[float, int, int]:
    value = checks.number(stretch)
    if value is None or not np.isfinite(value) or value < localise.LEAST_STRETCH:
        raise InvalidArgument(
            f"Mesh.localised: stretch must be a number of at least {localise.LEAST_STRETCH:g}, got "
            f"{checks.brief(stretch)}: a cut leaves 5/16 of an "
            "edge or more, and below 16/5 it would stand nearer to the edge's ends than others do"
        )
    order = checks.integer("Mesh.localised: order", order, 1)
    if order > locality.ORDERS:
        got = checks.brief(order)
        raise InvalidArgument(f"Mesh.localised: order must be within 1 … {locality.ORDERS}, got {got}")
    return value, order, checks.integer("Mesh.localised: max_facets", max_facets, 1)


def _refuse_too_many(mesh: Mesh, corners: np.ndarray, stretch: float, order: int, max_facets: int) -> None:
    ends = facet_pieces.edges_of(corners, np.arange(len(corners))).ends
    predicted = predicted_facets.predicted_facets(mesh.vertices, ends, len(corners), stretch, order)
    if predicted > max_facets:
        raise InvalidArgument(
            f"Mesh.localised: about {predicted} facets would be needed for σ_{order} ≤ {stretch:g}, more than "
            f"max_facets = {max_facets}: long edges are packed closely. Allow more, or a greater stretch or order"
        )


def _gave_up(crowded, facet: int, stretch: float, order: int, max_facets: int) -> InvalidArgument:
    why = "new vertices came ever nearer to each other"
    if crowded.n_facets > max_facets:
        why = f"more than max_facets = {max_facets}"
    return InvalidArgument(
        f"Mesh.localised: σ_{order} ≤ {stretch:g} was not reached: {why}, with {crowded.n_facets} facets and "
        f"σ_{order} = {crowded.stretch:.4g}. Edges crowd in facet {facet}, near its corner {crowded.vertex}: more of "
        "them than a stretch allows side by side, or at one vertex (docs/locality.md). Allow a greater stretch or order"
    )

