"""How much two solids overlap: the volume with its bracket, its centroid, and the areas of both surfaces there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.shapes.shape import Shape
from collide.solids.arrangement import Arrangement, arrange
from collide.solids.limits import Limits
from collide.solids.solid_operands import solid_operand
from collide.solids.triangle_sums import areas, enclosed, mean_point


class OverlapVolume(NamedTuple):
    """The overlap of two solids.

    volume, lower, upper : of the points inside both [m³], lower ≤ truth ≤ upper proven; all 0 without common inner
        points.
    centroid : (3,) of the overlap in W [m]; of the patch where the volume is 0; zeros without either.
    area_a, area_b : area of A's surface inside B, and of B's inside A [m²].
    patch_area : area of coinciding surfaces facing each other, as of a box on a table [m²].
    flush_area : area of coinciding surfaces facing the same way [m²].
    n_meeting, n_cut : number of meeting pairs of facets, and of cut facets.
    """

    volume: float
    lower: float
    upper: float
    centroid: np.ndarray
    area_a: float
    area_b: float
    patch_area: float
    flush_area: float
    n_meeting: int
    n_cut: int


def overlap_volume(
    A: Shape, B: Shape, X_WA, X_WB, *, check_poses: bool = True, progress=None, time_limit: float | None = None,
    memory: int | None = None, exact: bool = False,
) -> OverlapVolume:
    """Volume, centroid and surfaces of the overlap of two posed solids; no mesh is made.

    Parameters
    ----------
    A, B : solids with facets, as for `boolean`.
    X_WA, X_WB : (4, 4) poses in the world W [m].
    check_poses : refuse matrices other than rotations.
    progress, time_limit, memory : as of `boolean`.
    exact : add volumes up in integers, for a bracket of a few units in the last place.

    Returns
    -------
    OverlapVolume. Whether the volume is 0 is exact, and so is the coincidence of surfaces: a box on top of
    another has volume 0 and a patch. Brackets are some 1e-13 of the volume wide, of thousands of shells as well, and at
    most 2⁻³²: where doubles leave more open, as for the thinnest overlaps, volumes are added up in integers. Areas and
    centroids are rounded.

    Raises
    ------
    InvalidArgument : ``exact`` not True or False, and as of `boolean`.
    InvalidPose, UnsupportedQuery : as of `boolean`.

    Notes
    -----
    The cells are the cells of `boolean`, at the same cost less the mesh.
    """
    if not isinstance(exact, (bool, np.bool_)):
        raise InvalidArgument(f"overlap_volume: exact must be True or False, got {checks.brief(exact)}")
    operands = [
        solid_operand("overlap_volume", name, shape, X, check_poses)
        for name, shape, X in (("A", A, X_WA), ("B", B, X_WB))
    ]
    with Limits("overlap_volume", progress, time_limit, memory) as limits:
        arrangement = arrange(operands, limits)
    holds = arrangement.holds()
    triangles, rows = arrangement.boundary(holds[:, 0] & holds[:, 1])
    volume, size = enclosed(arrangement.points, triangles, exact)
    steps = arrangement.sheets.steps[rows] != 0
    patch, places = _patch(arrangement, holds)
    centroid = volume.centroid if len(triangles) else mean_point(patch, places)
    return OverlapVolume(
        volume.volume, volume.lower, volume.upper, centroid, float(size[steps[:, 0] & ~steps[:, 1]].sum()),
        float(size[steps[:, 1] & ~steps[:, 0]].sum()), float(patch.sum()), float(size[steps.all(axis=1)].sum()),
        arrangement.n_meeting, arrangement.n_cut,
    )


def _patch(arrangement: Arrangement, holds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(areas, centroids) of the sheets with A alone on one side and B alone on the other."""
    before, behind = (holds[arrangement.cells.sides[:, k]] for k in range(2))
    rows = (before != behind).all(axis=1) & (before[:, 0] != before[:, 1])
    return areas(arrangement.points, arrangement.sheets.triangles[rows])
