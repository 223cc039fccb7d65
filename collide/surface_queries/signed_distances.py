"""How far points are from a mesh, inside or outside: `signed_distances`.

Distances are the walk's (`nearest_facet_kernel.py`). The sign is that of the exact winding number (`contains.py`),
asked of few points: where balls around two points overlap and hold no facet, the surface winds around both as often.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads, share
from collide.errors import UnsupportedQuery
from collide.narrowphase.facets.nearest_facets import facets_nearest, leaders_of, pieces_of
from collide.narrowphase.facets.winding_numbers import INSIDE, ON_SURFACE, OUTSIDE
from collide.shapes.mesh import Mesh
from collide.surface_queries.contains import on_facets, where_in_solid
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: The least distance of a point off the surface: 0 says that the point lies on a facet.
_LEAST = 5e-324
_EYE = np.eye(4)[None]


class SignedDistances(NamedTuple):
    """Distances of n points from the facets of a mesh; of a single point numbers.

    distance : (n,) [m], below 0 inside, and 0 exactly where a point lies on a facet.
    lower, upper : (n,) [m] lower ≤ truth ≤ upper, proven.
    facet : (n,) int64, number of the nearest facet, of facets as near the least number.
    point : (n, 3) nearest place on the facet, rounded, in the mesh's frame [m].
    """

    distance: Any
    lower: Any
    upper: Any
    facet: Any
    point: Any


def signed_distances(mesh: Mesh, points: ArrayLike, *, signed: bool = True, threads: int = 1) -> SignedDistances:
    """How far points are from the facets of a mesh, negative inside.

    Parameters
    ----------
    mesh : Mesh
        A solid; with ``signed=False`` a surface as well.
    points : (3,) or (n, 3) array_like, float64
        In the frame of the mesh [m], coordinates within 1e50; n may be 0.
    signed : bool
        False gives distances without sign.
    threads : int
        At most so many; answers are the same bits.

    Returns
    -------
    SignedDistances
        Distances with proven brackets, facets and nearest places.

    Raises
    ------
    InvalidArgument
        For anything but a `Mesh`; points not finite or beyond 1e50.
    UnsupportedQuery
        For a surface, which has no inside, unless ``signed=False``.

    Notes
    -----
    A distance is off by at most 2⁻⁴⁷ of itself and the mesh's longest side together, wherever the mesh lies; bounds are
    so far apart. The sign is exact: negative where the facets wind around the point once or more, decided in integers.
    A distance is that from the nearest facet, also where parts of a solid overlap and the facet lies within another
    part: `combine` with "at least 1" leaves the outer boundary alone. Answers are the same bits whatever the batch.

    O(log n) for well-shaped meshes and points near the surface; more where much of the surface is about as far. The
    first call makes a table, 112 bytes a facet. docs/distance_fields.md has measured times. J. A. Bærentzen and
    H. Aanæs, "Signed distance computation using the angle weighted pseudonormal" (2005), take signs from normals, which
    fail where a mesh crosses itself.
    """
    checks.instance("signed_distances: mesh", mesh, Mesh, "a Mesh; of other shapes Mesh(*collide.tessellate(shape))")
    rows, single = checks.vectors("signed_distances", "points", points)
    checks.refuse_rows("signed_distances", "points", rows, np.abs(rows).max(axis=1) > LARGEST, f"exceeds {LARGEST:g}")
    signed, workers = checks.true_or_false("signed_distances: signed", signed), check_threads(threads)
    if signed and not mesh.solid:
        raise UnsupportedQuery(
            "signed_distances: mesh is a surface, no solid: print(mesh.report) tells why; signed=False gives distances "
            "without sign"
        )
    near = facets_nearest(mesh.tree, rows, workers)
    lower, upper = np.maximum(near.distance - near.error, 0.0), near.distance + near.error
    where = _where(mesh, rows, near, workers) if signed else _on_surface(mesh, rows, np.flatnonzero(lower == 0.0))
    on = where == ON_SURFACE
    distance = np.maximum(near.distance, _LEAST)
    distance[on] = lower[on] = upper[on] = 0.0
    near.point[on] = rows[on]
    inside = where == INSIDE
    distance[inside] = -distance[inside]
    lower[inside], upper[inside] = -upper[inside], 0.0 - lower[inside]
    answer = SignedDistances(distance, lower, upper, near.facet, near.point)
    return SignedDistances(*(column[0] for column in answer)) if single else answer


def _where(mesh: Mesh, points: np.ndarray, near, workers: int) -> np.ndarray:
    """(n,) OUTSIDE, ON_SURFACE or INSIDE of a solid, by the winding numbers of the leaders."""
    leaders = leaders_of(points, near, workers)
    asked = np.flatnonzero(leaders == np.arange(len(points)))
    where = np.full(len(points), OUTSIDE)

    def ask(piece: slice) -> None:
        some = asked[piece]
        where[some] = where_in_solid(mesh, _EYE, points[some])

    share(pieces_of(len(asked)), ask, workers)
    return where[leaders]


def _on_surface(mesh: Mesh, points: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """(n,) ON_SURFACE, or OUTSIDE; ``asked`` : rows of the points that may lie on a facet."""
    where = np.full(len(points), OUTSIDE)
    if len(asked):
        where[asked[on_facets(mesh.tree, _EYE, points[asked])]] = ON_SURFACE
    return where
