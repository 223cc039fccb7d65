"""Union, intersection and difference of two solids, decided exactly: `boolean`."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument, brief
from collide.shapes.mesh import Mesh, save_triangles
from collide.shapes.shape import Shape
from collide.solids.arrangement import Arrangement, arrange, crossings_of
from collide.solids.clean_mesh import clean_mesh
from collide.solids.limits import Limits
from collide.solids.rounded_mesh import rounded_mesh
from collide.solids.solid_operands import solid_operand

#: Which cells belong, of whether A and B hold them, (c, 2) bool.
OPERATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "union": lambda held: held[:, 0] | held[:, 1],
    "intersection": lambda held: held[:, 0] & held[:, 1],
    "difference": lambda held: held[:, 0] & ~held[:, 1],
    "symmetric_difference": lambda held: held[:, 0] != held[:, 1],
}


class BooleanResult(NamedTuple):
    """A boolean of two solids, or of many (`combine`).

    mesh : the solid, vertices in the world W [m]; ``None`` for a result without interior points.
    body : (k,) int64, the body of origin of every facet of the mesh: 0 for A, 1 for B (for common facets: 0).
    facet : (k,) int64, the number of the facet of origin in its body. Facets of convex shapes are numbered as in
        `facet_pairs`.
    before, behind : (k, r) bool, bodies that hold the points just outside each facet, and just inside; a body with a
        surface at the facet differs in the two.
    moved : the farthest the surface was moved by rounding to doubles [m].
    n_collapsed, n_thin : number of triangles, and of shells, left out of the mesh: merged, or made flat by rounding.
    n_meeting, n_cut : number of meeting pairs of facets, and of cut facets.
    """

    mesh: Mesh | None
    body: np.ndarray
    facet: np.ndarray
    before: np.ndarray
    behind: np.ndarray
    moved: float
    n_collapsed: int
    n_thin: int
    n_meeting: int
    n_cut: int

    @property
    def empty(self) -> bool:
        """Whether nothing is inside."""
        return self.mesh is None

    @property
    def self_collisions(self) -> np.ndarray:
        """(k, 2) facets of the mesh that cross each other, by rounding alone; asked when first read, and kept.

        Clean rounding leaves no crossing facets, but for results told here.
        """
        return np.zeros((0, 2), dtype=np.int64) if self.mesh is None else crossings_of(self.mesh)

    def save(self, path) -> None:
        """Write the mesh as `Mesh.save` does, facets in the colours of their bodies of origin.

        Parameters
        ----------
        path : the file. PLY, OFF, 3MF and GLB have colours, OBJ a group for each body; STL and ``.npz`` have neither.

        Raises
        ------
        InvalidArgument : the result is empty.
        InvalidShape : another suffix; the file cannot be written.
        """
        if self.mesh is None:
            raise InvalidArgument("BooleanResult.save: nothing is inside: the result is empty, and no file was written")
        if not save_triangles("BooleanResult", path, self.mesh.vertices, self.mesh.faces, self.body):
            self.mesh.save(path)


def boolean(
    A: Shape, B: Shape, X_WA, X_WB, op: str, *, rounding: str = "clean", check_poses: bool = True, progress=None,
    time_limit: float | None = None, memory: int | None = None,
) -> BooleanResult:
    """Union, intersection or difference of two posed solids, as a mesh: decided exactly on the poses as given.

    Parameters
    ----------
    A, B : solids with facets: `Mesh` (closed; overlapping shells count as their union, docs/meshes.md), `Box`,
        `ConvexHull` without a radius, `HPolytope` whose corners are doubles.
    X_WA, X_WB : (4, 4) poses in the world W [m].
    op : "union", "intersection", "difference" (A without B) or "symmetric_difference".
    rounding : "clean" for a mesh without crossing facets, without flat facets and with as few facets as rounding
        allows; "exact" for all exact points of the two surfaces, each rounded once, whatever facets cross afterwards.
    check_poses : refuse matrices other than rotations.
    progress : callable, optional. Called with a label, returns a context manager of a function that changes the label.
    time_limit, memory : the most seconds, and bytes, of the call; ``None`` for no limit. A stopped call leaves
        nothing behind.

    Returns
    -------
    BooleanResult, with the solid as a `Mesh` in W. The solid is the interior of the operation's result, with its
    border: touching sets intersect in the empty set, and no wall is left between flush bodies. Every edge is shared
    exactly; vertices are exact points of the two surfaces, rounded once to the nearest doubles. Clean rounding merges
    what is nearer than four units in the last place of the largest coordinate, farther only where facets would still
    cross; ``moved`` is how far. Of merged facets ``facet`` has one.

    Raises
    ------
    InvalidArgument : a surface without an inside, with its defects and facet numbers; an unknown operation or rounding.
    InvalidPose : matrices other than poses.
    UnsupportedQuery : curved shapes, unions and half-spaces, by name; a limit reached, with an estimate of the need.

    Notes
    -----
    Meeting facets are found by the box-trees, cut along exact segments, and the cells between them told apart by
    exact winding numbers; all others are taken whole. O(n log n) for local meshes (J. Erickson, "Local polyhedra and
    geometric graphs" (2005), corollary 3.2 and theorem 3.6). docs/solids.md has the figures.
    """
    rule = OPERATIONS.get(op) if isinstance(op, str) else None
    if rule is None:
        names = ", ".join(repr(name) for name in OPERATIONS)
        raise InvalidArgument(f"boolean: op must be one of {names}, got {brief(op)}")
    check_rounding("boolean", rounding)
    operands = [
        solid_operand("boolean", name, shape, X, check_poses) for name, shape, X in (("A", A, X_WA), ("B", B, X_WB))
    ]
    with Limits("boolean", progress, time_limit, memory) as limits:
        arrangement = arrange(operands, limits)
        return solid_of(arrangement, rule(arrangement.holds()), rounding)


def check_rounding(caller: str, rounding) -> None:
    """Refuse what is no kind of rounding."""
    if not isinstance(rounding, str) or rounding not in ("clean", "exact"):
        raise InvalidArgument(f"{caller}: rounding must be 'clean' or 'exact', got {brief(rounding)}")


def solid_of(arrangement: Arrangement, keep: np.ndarray, rounding: str) -> BooleanResult:
    """The cells of an arrangement to keep, (c,) bool, as one solid in doubles."""
    triangles, sheets = arrangement.boundary(keep)
    if rounding == "exact":
        made = rounded_mesh(arrangement.points, triangles)
    else:
        made = clean_mesh(arrangement, triangles, sheets, _classes(arrangement, sheets))
    rows = sheets[made.rows]
    source = arrangement.sheets.facet[rows]
    sides = arrangement.cells.sides[rows]
    turned = keep[sides[:, 0]]
    sides = np.where(turned[:, None], sides[:, ::-1], sides)
    before, behind = (arrangement.holds()[sides[:, k]] for k in range(2))
    return BooleanResult(
        made.mesh, arrangement.facets.body[source], arrangement.facets.number[source], before, behind, made.moved,
        made.n_collapsed, made.n_thin, arrangement.n_meeting, arrangement.n_cut,
    )


def _classes(arrangement: Arrangement, rows: np.ndarray) -> np.ndarray:
    """(k,) int64: equal for sheets of a body with the same bodies on both sides."""
    holds = arrangement.holds()
    held = np.zeros(len(holds), dtype=np.int64)
    for of_body in holds.T:
        held = np.unique(2 * held + of_body, return_inverse=True)[1]
    sides = np.sort(held[arrangement.cells.sides[rows]], axis=1)
    n = len(held)
    return (arrangement.facets.body[arrangement.sheets.facet[rows]] * n + sides[:, 0]) * n + sides[:, 1]
