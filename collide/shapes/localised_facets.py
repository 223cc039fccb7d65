"""The facets of a mesh cut until the mesh is local: what `Mesh.localised` refuses, and makes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, InvalidShape
from collide.mesh import facet_pieces, localise, locality, predicted_facets
from collide.mesh.mesh_topology import COLLAPSED
from collide.mesh.weld import weld

if TYPE_CHECKING:
    from collide.mesh.locality import Locality
    from collide.mesh.mesh_survey import Survey


def localised_facets(
    vertices: np.ndarray, survey: Survey, before: Locality, stretch: float, order: int, max_facets: int, progress
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Vertices, facets, of each facet the row of the old one, and how far a vertex moved, as `Mesh.localised` has them.

    survey, before : of the mesh.   stretch, order, max_facets : as `checked` returns them.
    """
    if order >= before.distinct:
        raise InvalidArgument(
            f"Mesh.localised: order must be less than the {before.distinct} distinct vertices of the mesh, got "
            f"{order}: no vertex has so many others"
        )
    rows = np.flatnonzero(survey.flags & COLLAPSED == 0)
    if not len(rows):
        raise InvalidShape("Mesh.localised: no facet has three distinct corners")
    corners = survey.corners[rows].astype(np.int64)
    if before.local_stretches[order - 1] > stretch:
        _refuse_too_many(vertices, corners, stretch, order, max_facets)
    pieces = facet_pieces.Pieces(vertices, corners)
    distinct = np.flatnonzero(weld(vertices) == np.arange(len(vertices)))
    try:
        localise.localise(pieces, distinct, stretch, order, max_facets, progress)
    except localise.Crowded as crowded:
        raise _gave_up(crowded, int(rows[crowded.facet]), stretch, order, max_facets) from None
    return pieces.points, pieces.faces, rows[pieces.source], pieces.moved()


def checked(stretch, order, max_facets) -> tuple[float, int, int]:
    """The arguments of `Mesh.localised`, InvalidArgument where they are none."""
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


def _refuse_too_many(vertices: np.ndarray, corners: np.ndarray, stretch: float, order: int, max_facets: int) -> None:
    ends = facet_pieces.edges_of(corners, np.arange(len(corners))).ends
    predicted = predicted_facets.predicted_facets(vertices, ends, len(corners), stretch, order)
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

