"""The obstacle to a translating body: all positions with a hit of another body, `configuration_obstacle`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.mesh.mesh_survey import NO_AREA
from collide.mesh.mesh_topology import COLLAPSED
from collide.numerics.exact_points import Point, on_one_grid, placed
from collide.numerics.exact_vectors import inner
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape
from collide.solids.arrangement import Arrangement, crossings_of
from collide.solids.cell_points import CellPoints
from collide.solids.convolution import ExactSurface, Pieces, convolution, exact_surface
from collide.solids.exact_facets import ExactFacets, arrangement_of_facets
from collide.solids.limits import UNLIMITED, Limits
from collide.solids.planar_obstacle import PlanarObstacle, planar_obstacle
from collide.solids.rounded_mesh import rounded_mesh
from collide.solids.solid_operands import solid_operand
from collide.solids.translated_solids import TranslatedSolids


class ConfigurationObstacle(NamedTuple):
    """The positions x [m] with a hit of A and R B + x.

    mesh : the solid of these positions.
    facets : (k, 2) int64, for every facet of the mesh a facet of A and a facet of B touching at its positions: the
        touching facet, or a facet at the touching vertex or edge.
    moved : the farthest a vertex was moved by rounding to doubles [m].
    n_collapsed, n_thin : number of triangles and of shells left out of the mesh: rounding made them flat.
    n_pieces, n_cells, n_asked : number of triangles of the convolution, of cells of their arrangement, and of cells
        decided by asking the bodies at a point.
    """

    mesh: Mesh
    facets: np.ndarray
    moved: float
    n_collapsed: int
    n_thin: int
    n_pieces: int
    n_cells: int
    n_asked: int

    @property
    def self_collisions(self) -> np.ndarray:
        """(k, 2) facets of the mesh that cross each other, by rounding alone: asked when first read, and kept."""
        return crossings_of(self.mesh)


class ExactObstacle(NamedTuple):
    """The same before rounding: an arrangement of the pieces, which cells belong, and the facets behind the pieces."""

    arrangement: Arrangement
    keep: np.ndarray
    facets: np.ndarray
    n_asked: int


def configuration_obstacle(
    A, B, R=None, *, check_poses: bool = True, progress=None, time_limit: float | None = None, memory: int | None = None
) -> ConfigurationObstacle | PlanarObstacle:
    """All x with a hit of A and R B + x: the Minkowski sum of A and −R B as a solid or polygon, decided exactly.

    A stands at the pose I; B's pose is (R, x). A translating body B is free of A exactly where the point x
    is outside.

    Parameters
    ----------
    A, B : solids with facets, as for `boolean`, without crossing facets, two facets at every edge. In the plane lists
        of rings (k, 2) [m]: outer rings counter-clockwise, holes clockwise, touching nowhere.
    R : (3, 3) rotation of B, (2, 2) in the plane; ``None`` for the identity.
    check_poses : refuse matrices other than rotations.
    progress, time_limit, memory : as of `boolean`.

    Returns
    -------
    ConfigurationObstacle; PlanarObstacle in the plane. The set of x is exact on the numbers given; vertices are
    rounded once, by ``moved`` at most. The set is closed: on its border the bodies touch. Positions of mere touching,
    hemmed in on all sides, belong.

    Raises
    ------
    InvalidArgument : a surface without an inside; crossing facets, edges of more than two facets and facets without
        area, by number; rings touching, crossing or in the wrong direction.
    InvalidPose : R is not a rotation.
    UnsupportedQuery : curved shapes, unions and half-spaces, and a limit reached.

    Notes
    -----
    The border lies on sums of a facet and a vertex, and of two edges, whose normals agree (`convolution.py`). The
    winding number of a cell in the exact arrangement of these pieces is the Euler characteristic of A ∩ (R B + x): not
    0, the bodies meet; 0, the bodies are asked at a point of the cell. N pieces cost O(N log N + k) for k meeting
    pairs; N is O(n²), a few n for nearly convex solids. J. Erickson, "Local polyhedra and geometric graphs" (2005),
    theorems 7.1 and 7.2: Θ(n³) corners in the plane and Θ(n⁴) vertices in space, up to logarithms, for local polygons
    and polyhedra. docs/configuration_obstacles.md has figures.
    """
    if isinstance(A, Shape) != isinstance(B, Shape):
        raise InvalidArgument(
            f"configuration_obstacle: A and B must be two solids or two polygons, got {brief(A)} and {brief(B)}"
        )
    if not isinstance(A, Shape):
        with Limits("configuration_obstacle", progress, time_limit, memory) as limits:
            return planar_obstacle(A, B, R, limits, check_poses)
    rotation = np.eye(3) if R is None else checks.array("configuration_obstacle: R", R, "(3, 3)", InvalidArgument)
    if rotation.shape != (3, 3):
        raise InvalidArgument(f"configuration_obstacle: R must be a (3, 3) rotation, got shape {rotation.shape}")
    X = np.eye(4)
    X[:3, :3] = rotation
    with Limits("configuration_obstacle", progress, time_limit, memory) as limits:
        exact = exact_obstacle(A, B, X, limits, check_poses)
        triangles, sheets = exact.arrangement.boundary(exact.keep)
        made = rounded_mesh(exact.arrangement.points, triangles)
    if made.mesh is None:
        raise InvalidArgument(
            "configuration_obstacle: rounding leaves nothing of it: A and B are too small for doubles"
        )
    facets = exact.facets[exact.arrangement.sheets.facet[sheets[made.rows]]]
    moved = float(np.sqrt(np.square(0.5 * np.spacing(np.abs(made.mesh.vertices))).sum(axis=1).max()))
    return ConfigurationObstacle(
        made.mesh, facets, moved, made.n_collapsed, made.n_thin, len(exact.facets), len(exact.keep), exact.n_asked
    )


def exact_obstacle(A: Shape, B: Shape, X: np.ndarray, limits: Limits = UNLIMITED, check: bool = True) -> ExactObstacle:
    """Before rounding.   X : (4, 4) pose of B without a translation."""
    limits.stage("putting facets, vertices and edges together")
    surface_a, surface_b, numbers, grid = _surfaces(A, B, X, check)
    pieces = convolution(surface_a, surface_b)
    facets, of_facet = _as_facets(surface_a, surface_b, pieces, grid)
    arrangement = arrangement_of_facets(facets, limits)
    keep = arrangement.cells.winding[:, 0] != 0
    open_cells = np.flatnonzero(~keep)
    if len(open_cells):
        within, solids = CellPoints(arrangement), TranslatedSolids(surface_a, surface_b)
        for cell in limits.watched("asking the bodies themselves", open_cells.tolist()):
            keep[cell] = solids.meet(within.within(cell))
    rows = np.stack([numbers[k][of_facet[:, k]] for k in range(2)], axis=1)
    return ExactObstacle(arrangement, keep, rows, len(open_cells))


def _surfaces(A: Shape, B: Shape, X: np.ndarray, check: bool):
    """(A and −R B in integers on one grid, the numbers of their facets, the grid)."""
    operands = [
        solid_operand("configuration_obstacle", "A", A, np.eye(4), check),
        solid_operand("configuration_obstacle", "B", B, X, check, "the pose of R"),
    ]
    reflected = -X
    reflected[3, 3] = 1.0
    groups, grid = on_one_grid(
        placed(np.eye(4), operands[0].mesh.vertices), placed(reflected, operands[1].mesh.vertices)
    )
    surfaces, numbers = [], []
    for name, operand, points, turned in zip("AB", operands, groups, (False, True)):
        rows, faces = _checked_faces(name, operand.mesh)
        used, faces = np.unique(faces[:, ::-1] if turned else faces, return_inverse=True)
        surfaces.append(exact_surface([points[v] for v in used.tolist()], faces.reshape(-1, 3)))
        numbers.append(rows)
    return *surfaces, numbers, grid


def _checked_faces(name: str, mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """(rows of the facets of a mesh that are more than an edge, their corners)."""

    def refuse(what: str, rows) -> InvalidArgument:
        some = ", ".join(str(row) for row in np.asarray(rows).ravel()[:6].tolist())
        return InvalidArgument(f"configuration_obstacle: {name} has {what}: facets {some}")

    flags = mesh.survey.flags
    thin = np.flatnonzero((flags & NO_AREA != 0) & (flags & COLLAPSED == 0))
    if len(thin):
        raise refuse("facets whose corners lie on a line; give it without them", thin)
    crossing = crossings_of(mesh)
    if len(crossing):
        raise refuse("facets that cross; combine([shape], [pose], 'union') makes a solid without", crossing[0])
    rows = np.flatnonzero(flags & COLLAPSED == 0)
    faces = mesh.survey.corners[rows].astype(np.int64)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, which, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    n_wrong = np.flatnonzero(counts[which.ravel()] != 2)
    if len(n_wrong):
        raise refuse("an edge with more than two facets; move the parts that touch there apart", rows[n_wrong // 3])
    return rows, faces


def _as_facets(A: ExactSurface, B: ExactSurface, pieces: Pieces, grid: int) -> tuple[ExactFacets, np.ndarray]:
    """(pieces with an area as facets, less pieces cancelled by opposite pieces; for each the facets of A and B)."""
    ids: dict[Point, int] = {}
    pairs, which = np.unique(pieces.corners.reshape(-1, 2), axis=0, return_inverse=True)
    of_pair = np.empty(len(pairs), dtype=np.int64)
    for k, (i, j) in enumerate(pairs.tolist()):
        (a, b, c), (x, y, z) = A.points[i], B.points[j]
        of_pair[k] = ids.setdefault((a + x, b + y, c + z), len(ids))
    faces = of_pair[which.reshape(-1, 3)]
    points = list(ids)
    rows = _left_over(faces)
    rows = rows[[_has_area(points, face) for face in faces[rows].tolist()]]
    return ExactFacets(points, faces[rows], grid), pieces.facets[rows]


def _left_over(faces: np.ndarray) -> np.ndarray:
    """Rows of the triangles left after equal triangles of opposite orientation cancel."""
    shifted = np.argmin(faces, axis=1)[:, None] + np.arange(3)
    turned = np.take_along_axis(faces, shifted % 3, axis=1)
    sense = np.where(turned[:, 1] < turned[:, 2], 1, -1)
    _, which = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    which = which.ravel()
    total = np.bincount(which, weights=sense).astype(np.int64)
    order = np.lexsort((np.arange(len(faces)), -sense * np.sign(total[which]), which))
    place = np.arange(len(faces)) - np.searchsorted(which[order], which[order])
    remaining = order[place < np.abs(total[which[order]])]
    return np.sort(remaining)


def _has_area(points: list[Point], face: list[int]) -> bool:
    a, b, c = (points[v] for v in face)
    u, v = ([x - y for x, y in zip(p, a)] for p in (b, c))
    return bool(inner(u, u) * inner(v, v) - inner(u, v) ** 2)
