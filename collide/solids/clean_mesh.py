"""The solid of an arrangement's triangles in doubles, without crossing facets and without flat facets.

Points are rounded and facets merged (`facet_merging.py`); then facets are asked exactly whether they cross, but for
those that rounding leaves as far apart as they were (`rounded_crossings.py`). While
some do, near features are joined as well (`near_features.py`), with twice the reach in every further round. After
`_ROUNDS` rounds the work ends, and the remaining crossings are told.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.solids.arrangement import Arrangement
from collide.solids.closed_surface import N_VERTICES, PLANE, SurfaceArrays, write_planes
from collide.solids.facet_merging import merge_flat_facets
from collide.solids.placed_facets import PlacedFacets
from collide.solids.rounded_crossings import rounded_crossings, shaken_facets
from collide.solids.rounded_mesh import RoundedMesh, solid_of_facets, used_points, welded
from collide.solids.rounded_points import near_points, rounded_points

#: The reach of the first round, in units in the last place of the largest coordinate.
REACH = 4.0
#: Rounds; in the second half all vertices may go, before that vertices of facets that were cut or cross.
_ROUNDS = 8


class _Sources(NamedTuple):
    """Of every triangle its plane and its class; the planes (p, 6), a point and a unit normal each."""

    plane: np.ndarray
    kind: np.ndarray
    planes: np.ndarray


def clean_mesh(arrangement: Arrangement, triangles: np.ndarray, rows: np.ndarray, kind: np.ndarray) -> RoundedMesh:
    """The solid of triangles (k, 3) of an arrangement that close.

    rows : (k,) their sheets.   kind : (k,) int64, a class; facets of different classes are not merged.
    """
    sources = _sources_of(arrangement, triangles, rows, kind)
    ids, faces = used_points(triangles, len(arrangement.points))
    vertices, off = rounded_points(arrangement.points, ids)
    faces, proper = welded(vertices, faces)
    unit = np.spacing(np.abs(vertices).max(initial=0.0))
    movable = np.zeros(len(ids), dtype=bool)
    is_cut = rows >= len(arrangement.facets.corners) - arrangement.n_cut
    movable[faces[is_cut]] = True
    shaken = shaken_facets(arrangement, unit, len(faces))
    if shaken is not None:
        shaken = shaken[arrangement.sheets.facet[rows]] | is_cut
    for attempt in range(_ROUNDS):
        reach = REACH * 2.0 ** max(attempt - 1, 0) * unit
        made = _merged(vertices, faces[proper], proper, sources, movable, reach, attempt > 0)
        mesh, remaining, n_thin = solid_of_facets(made.vertices, made.corners)
        if mesh is None:
            break
        asked = None
        if shaken is not None:
            source = made.sources[remaining]
            asked = shaken[source] | (made.corners[remaining] != faces[source]).any(axis=1)
        crossing = rounded_crossings(mesh, asked)
        if not len(crossing):
            break
        corners = made.corners[remaining[crossing]]
        movable[corners[corners < len(movable)]] = True
        movable |= attempt >= _ROUNDS // 2
    return RoundedMesh(mesh, made.sources[remaining], off + made.moved, len(triangles) - len(remaining), n_thin)


def _sources_of(arrangement: Arrangement, triangles: np.ndarray, rows: np.ndarray, kind: np.ndarray) -> _Sources:
    facets: PlacedFacets = arrangement.facets
    turned = triangles[:, 0] != arrangement.sheets.triangles[rows, 0]
    sides, plane = used_points(2 * arrangement.sheets.facet[rows] + turned, 2 * len(facets.corners))
    place, planes = near_points(arrangement.points).place, np.empty((len(sides), PLANE))
    write_planes(
        address_of(place), len(place), address_of(facets.corners), len(facets.corners), address_of(sides), len(sides),
        address_of(planes),
    )
    return _Sources(plane, kind, planes)


class _Merged(NamedTuple):
    """A surface with facets merged.   sources : of each of ``corners``.   moved : how far, at most [m]."""

    vertices: np.ndarray
    corners: np.ndarray
    sources: np.ndarray
    moved: float


def _merged(vertices, corners, origin, sources: _Sources, movable, reach: float, joins: bool) -> _Merged:
    arrays = SurfaceArrays(
        vertices, corners, origin, sources.plane[origin], sources.kind, sources.planes, movable, joins
    )
    count = merge_flat_facets(address_of(arrays.header), reach, joins)
    n = arrays.counts[N_VERTICES]
    return _Merged(
        arrays.points[: 3 * n].reshape(-1, 3), arrays.corners[: 3 * count].reshape(-1, 3), arrays.sources[:count],
        float(arrays.far[0]),
    )
