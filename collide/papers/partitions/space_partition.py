"""Space cut into convex cells that no facet of a solid passes through: `SpacePartition`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.poses_at import poses_at
from collide.errors import InvalidArgument
from collide.lowering.facet_bodies import body_of
from collide.mesh.shell_volumes import without_area
from collide.mesh.weld import weld
from collide.narrowphase.facets.facet_queries import surfaces_meet
from collide.papers.partitions.cell_records import CellSource, ConvexCells, part_of_block
from collide.papers.partitions.convex_cells import cell_blocks
from collide.papers.partitions.convex_parts import ConvexParts, parts_of, solid_volume
from collide.papers.partitions.cut_polygons import Edges
from collide.papers.partitions.facet_level import cut_along_facets
from collide.papers.partitions.finished_tree import FinishedTree
from collide.papers.partitions.leaf_labels import links_of, winding_numbers, witnesses_of_axes
from collide.papers.partitions.merged_cells import PlaneKey, merged_block, two_faced
from collide.papers.partitions.orthogonal_level import OrthogonalLevel
from collide.papers.partitions.partition_tree import PartitionTree
from collide.papers.partitions.planes import Planes
from collide.papers.partitions.portals import Portals, portals_of_block
from collide.papers.partitions.vertices import Vertices
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.surface_queries.contains import thin_facets
from collide.transforms import LARGEST

#: What a first-level cell may hold without being cut: corners of facets' boxes, and facets.
_KAPPA, _N_SPARED = 64, 4
_POINT = ConvexHull(np.zeros((1, 3)))


class Located(NamedTuple):
    """Places of points, (k,) each.

    inside : bool, whether the point belongs to the solid, as of `contains`; the surface belongs.
    boundary : bool, on the solid's boundary: every ball around the point has parts inside and outside.
    cell : int64, the first leaf whose closure holds the point, leaves inside before others.
    """

    inside: np.ndarray
    boundary: np.ndarray
    cell: np.ndarray


class PartitionSize(NamedTuple):
    """The size of a partition.

    facets, thin : number of facets with an area, and of facets without, which cut nothing.
    cells, inside : leaves, and leaves inside the solid.   cuts : leaves − 1.
    first_cells, pieces : cells of the first level with facets, and pieces of facets in them.
    max_facets : in a cell of the first level.   kappa : the most corners of facets' boxes in a cell of the first level.
    depth, mean_depth : cuts above a leaf, at most and on average.
    integers : signs decided in integers.
    """

    facets: int
    thin: int
    cells: int
    inside: int
    cuts: int
    first_cells: int
    pieces: int
    max_facets: int
    kappa: int
    depth: int
    mean_depth: float
    integers: int


class SpacePartition:
    """A binary space partition of a solid: convex cells, each wholly inside or outside, without facets passing through.

    Parameters
    ----------
    mesh : a solid `Mesh` (closed; inside are points of winding number 1 or more: docs/meshes.md).
    kappa : the most corners of facets' boxes in a cell of the first level (de Berg's guards; the clutter factor
        of the lemma). More make fewer and flatter cells.
    seed : of the random order of cutting facets: the same seed, the same cells.
    memory : the most bytes of the growing partition.
    progress : called with a label, gives a context manager around long work.

    Attributes
    ----------
    mesh : as given.   size : a `PartitionSize`.
    winding : (leaves,) int64, how often facets wind around each leaf.
    inside : (leaves,) bool, leaves of the solid: of winding number 1 or more.

    Raises
    ------
    InvalidArgument : a mesh without an inside, with its defects and facet numbers; an argument out of range.
    UnsupportedQuery : more than ``memory`` would be needed; the message has the work done and left.

    Notes
    -----
    Cutting planes are the facets' own and axis-parallel planes at doubles; sides are decided exactly, by doubles with
    error bounds, by planes through a vertex by name, or in integers: every cell is exactly an intersection of
    half-spaces. Facets of no area have no plane and cut nothing.

    J. Erickson, "Local polyhedra and geometric graphs" (2005), section 5: lemma 5.2's orthogonal level with κ, then
    M. S. Paterson and F. F. Yao's planes of facets in each of its cells. A local mesh makes O(n log n) cells of depth
    O(log n) (docs/partitions.md).
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        kappa: int = _KAPPA,
        seed: int = 0,
        memory: int = 1 << 32,
        progress: Callable[[str], AbstractContextManager] = nullcontext,
    ):
        _check_mesh(mesh)
        kappa = checks.integer("SpacePartition: kappa", kappa, 1)
        seed = checks.integer("SpacePartition: seed", seed, 0)
        memory = checks.integer("SpacePartition: memory", memory, 0)
        self.mesh = mesh
        corners = weld(mesh.vertices)[mesh.faces].astype(np.int64)
        self._facets = np.flatnonzero(~without_area(mesh.vertices, np.ascontiguousarray(corners, dtype=np.int32)))
        planes = Planes(mesh.vertices, corners[self._facets])
        grown, vertices, edges = PartitionTree(memory), Vertices(planes), Edges()
        level = OrthogonalLevel(grown, vertices, edges, kappa, _N_SPARED)
        level.grow(progress)
        facets_in = np.bincount(level.polygons.cell)
        facets_in = facets_in[facets_in > 0]
        grown.prediction = _predicted(facets_in, grown.plane.n)
        cut_along_facets(grown, vertices, edges, level.polygons, np.random.default_rng(seed), progress)
        self._tree = FinishedTree(grown, planes)
        with progress(f"telling which of {self._tree.n_leaves:,} cells are inside"):
            beside, witnesses = witnesses_of_axes(level)
            grown.links.append(links_of(grown, beside, witnesses, grown.held))
            self.winding = winding_numbers(self._tree, grown.links)
            self.inside = self.winding > 0
        self.size = PartitionSize(
            planes.n, len(mesh.faces) - planes.n, self._tree.n_leaves, int(self.inside.sum()), len(self._tree.plane),
            len(facets_in), int(facets_in.sum()), int(facets_in.max()), kappa, self._tree.depth, self._tree.mean_depth,
            vertices.n_exact + beside.n_exact,
        )

    def locate(self, points) -> Located:
        """The cells of points, and whether inside, on the boundary or outside of the solid: exactly.

        Parameters
        ----------
        points : (3,) or (k, 3) in the frame of the mesh [m], within 1e50.

        Returns
        -------
        Located, of arrays (k,), or of single values for a single point.

        Notes
        -----
        O(depth) a point on no cut, in a kernel as long as doubles tell sides. A point on a cut is sent down both sides,
        and is on the boundary if touching cells are of both kinds.
        """
        points, single = checks.vectors("locate", "points", points)
        if np.abs(points).max(initial=0.0) > LARGEST:
            far = np.abs(points).max(axis=1) > LARGEST
            checks.refuse_rows("locate", "points", points, far, f"exceeds {LARGEST:g}")
        cell = self._tree.leaves(points)
        rows = np.flatnonzero(cell < 0)
        inside, boundary, on_cuts = self.inside[cell], np.zeros(len(points), dtype=bool), rows[:0]
        if len(rows):
            inside[rows], boundary[rows], cell[rows], on_cuts = self._touched(points[rows])
            on_cuts = rows[on_cuts]
        on_facets = self._on_facets_outside(points, inside, on_cuts)
        inside[on_facets] = boundary[on_facets] = True
        answer = Located(inside, boundary, cell)
        return Located(*(column[0] for column in answer)) if single else answer

    def _touched(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(inside (k,), boundary (k,), cell (k,), rows on cuts) by all cells that touch the points, not by facets."""
        touched = self._tree.touches(points)
        leaf_inside = self.inside[touched.leaf]
        some, all_ = np.zeros(len(points), dtype=bool), np.ones(len(points), dtype=bool)
        some[touched.point[leaf_inside]] = True
        all_[touched.point[~leaf_inside]] = False
        cell = np.full(len(points), self._tree.n_leaves)
        best = leaf_inside | ~some[touched.point]
        np.minimum.at(cell, touched.point[best], touched.leaf[best])
        return some, some & ~all_, cell, np.unique(touched.on_point)

    def _on_facets_outside(self, points: np.ndarray, inside: np.ndarray, on_cuts: np.ndarray) -> np.ndarray:
        """Rows of points on a facet without solid behind: facets touched by cells outside alone."""
        tree = body_of(self.mesh).tree
        thin = thin_facets(self.mesh, tree)
        rows = on_cuts[~inside[on_cuts]] if thin is None else np.flatnonzero(~inside)
        X = poses_at(points[rows])
        hit = np.zeros(len(rows), dtype=bool)
        for facets in (tree, thin):
            if facets is not None and len(rows):
                hit |= surfaces_meet(facets, body_of(_POINT).tree, np.eye(4), X)
        return rows[hit]

    def cells(self, box=None) -> ConvexCells:
        """All cells within a box.

        Parameters
        ----------
        box : (low, high), two corners [m], low < high; the mesh's own box by default.

        Returns
        -------
        ConvexCells. Cells outside of the box are left out, others clipped by the box: cells at the rim are unbounded.

        Raises
        ------
        InvalidArgument : a box not of two corners, low < high.
        """
        low, high = self._box("cells", box)
        whole = np.zeros(len(self._tree.plane), dtype=bool)
        return self._made(np.arange(self._tree.n_leaves), low, high, whole)

    def convex_pieces(self, inside: bool = True, box=None, *, merged: bool = True) -> ConvexCells:
        """The solid, or the free space around it, as convex pieces without common inner points.

        Parameters
        ----------
        inside : pieces of the solid; ``False``: of the free space.
        box : (low, high), two corners [m], clips the pieces. Free space is unbounded and needs a box.
        merged : join neighbours with a convex union, exactly, among each 8,192 consecutive pieces; ``False`` is
            quicker. Free space is not joined across planes with facets of both senses.

        Returns
        -------
        ConvexCells. Their union is exactly the closure of the interior of the solid, or of the free space in the
        box. Cells separated by a needless cut make a single piece.

        Raises
        ------
        InvalidArgument : no box for free space, or a box not of two corners, low < high.
        """
        for name, value in (("inside", inside), ("merged", merged)):
            if not isinstance(value, (bool, np.bool_)):
                raise InvalidArgument(f"convex_pieces: {name} must be True or False, got {checks.brief(value)}")
        if box is None and not inside:
            raise InvalidArgument("convex_pieces: free space has no end; give box=(low, high), two corners of a box")
        low, high = self._box("convex_pieces", box)
        tree = self._tree
        before = np.append(0, np.cumsum(self.inside == inside))
        whole = before[tree.last + 1] - before[tree.first] == tree.last - tree.first + 1
        if not inside:  # a facet with nothing behind it lies in no piece of free space
            n_held = np.append(0, np.cumsum(np.diff(tree.held_starts)[np.argsort(tree.first, kind="stable")]))
            firsts = np.sort(tree.first, kind="stable")
            whole &= n_held[np.searchsorted(firsts, tree.last, "right")] == n_held[np.searchsorted(firsts, tree.first)]
        wanted = self.inside == inside
        follows = np.zeros(tree.n_leaves + 1, dtype=np.int64)  # all leaves of a whole cut but the first
        np.add.at(follows, tree.first[whole] + 1, 1)
        np.add.at(follows, tree.last[whole] + 1, -1)
        wanted &= np.cumsum(follows)[:-1] == 0
        barred = None
        if merged and (inside or self.winding.min() >= 0):
            barred = set() if inside else two_faced(tree.planes)
        return self._made(np.flatnonzero(wanted), low, high, whole, barred)

    def portals(self, cells: ConvexCells) -> Portals:
        """Common faces of cells of this partition: the graph of a planner.

        Parameters
        ----------
        cells : of `cells` or `convex_pieces` of this partition.

        Raises
        ------
        InvalidArgument : cells of another partition.

        Returns
        -------
        Portals: pairs of cells whose closures share a piece of a face with an area, exactly, each piece once. Cells
        touching in an edge or a corner have no portal.
        """
        if not isinstance(cells, ConvexCells) or cells.source.tree is not self._tree:
            raise InvalidArgument(
                f"portals: cells must come from cells() or convex_pieces() of this partition, got {checks.brief(cells)}"
            )
        tree, leaves, low, high, whole = cells.source
        row = np.full(tree.n_leaves, -1)
        row[cells.members] = cells.member_rows
        answer = [portals_of_block(tree, block, whole) for block in cell_blocks(tree, leaves, low, high, whole)]
        if not answer:
            return Portals(np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3)), np.zeros(0))
        near, far, _, middle, area = (np.concatenate(columns) for columns in zip(*answer))
        both = (row[far] >= 0) & (row[near] != row[far])
        pairs = np.stack((row[near[both]], row[far[both]]), axis=1)
        return Portals(np.sort(pairs, axis=1), middle[both], area[both])

    def parts(self, pieces: ConvexCells) -> ConvexParts:
        """Pieces as hulls, for hosts of convex shapes, and the exact difference of volumes.

        Parameters
        ----------
        pieces : of `convex_pieces` or `cells` of this partition, of a box that holds the mesh.

        Returns
        -------
        ConvexParts. Pieces cover exactly; hulls have their corners rounded, once.

        Raises
        ------
        InvalidArgument : pieces of another partition, or of a box that cuts the mesh.

        Notes
        -----
        Milliseconds a piece. Where shells overlap, leaves wound around twice take fractions of many digits besides.
        """
        if not isinstance(pieces, ConvexCells) or pieces.source.tree is not self._tree:
            raise InvalidArgument(
                f"parts: pieces must come from convex_pieces() or cells() of this partition, got {checks.brief(pieces)}"
            )
        low, high = self._box("parts", None)
        if (pieces.source.low > low).any() or (pieces.source.high < high).any():
            raise InvalidArgument("parts: the box of the pieces cuts the mesh; give convex_pieces() a larger box")
        x, y, z = (Fraction(b) - Fraction(a) for a, b in zip(pieces.source.low.tolist(), pieces.source.high.tolist()))
        some, all_ = pieces.inside.any(), pieces.inside.all()
        volume = x * y * z if not all_ else Fraction(0)
        if some == all_:  # of a kind, inside or outside
            volume += (1 if all_ else -1) * solid_volume(self._tree, self.winding)
        return parts_of([pieces.corners(i) for i in range(len(pieces))], volume)

    def _made(self, leaves: np.ndarray, low, high, whole, barred: set[PlaneKey] | None = None) -> ConvexCells:
        """Cells of leaves; merged, but not across barred planes, unless ``barred`` is ``None``."""
        source = CellSource(self._tree, leaves, low, high, whole)
        parts = []
        for block in cell_blocks(*source):
            members, rows = block.leaf, np.arange(len(block.leaf))
            if barred is not None:
                block, rows = merged_block(self._tree, block, whole, low, high, barred)
            parts.append(part_of_block(block, members, rows))
        return ConvexCells(self.inside, self._facets, parts, source)

    def _box(self, caller: str, box) -> tuple[np.ndarray, np.ndarray]:
        if box is None:
            corners = self.mesh.vertices[self.mesh.faces].reshape(-1, 3)
            return corners.min(axis=0), corners.max(axis=0)
        corners, _ = checks.vectors(caller, "box", box)
        if len(corners) != 2 or not (corners[0] < corners[1]).all() or np.abs(corners).max() > LARGEST:
            raise InvalidArgument(
                f"{caller}: box must be (low, high), corners [m] with low < high within {LARGEST:g}, "
                f"got {checks.brief(box)}"
            )
        return corners[0], corners[1]


def _check_mesh(mesh) -> None:
    if not isinstance(mesh, Mesh):
        raise InvalidArgument(
            f"SpacePartition: mesh must be a collide.Mesh, got {checks.brief(mesh)}; "
            "collide.Mesh(*collide.tessellate(shape)[:2]) makes one of a shape"
        )
    if not mesh.solid:
        spoilt = "; ".join(str(defect) for defect in mesh.report.defects if defect.spoils)
        raise InvalidArgument(f"SpacePartition: the mesh has no inside: {spoilt or 'it was made with solid=False'}")


def _predicted(facets_in: np.ndarray, n_cuts: int) -> str:
    """What the second level may come to: k facets make at most O(k²) cells, and k where no plane cuts another facet."""
    least = n_cuts + 1 + int(facets_in.sum())
    return (
        f"the first level has {len(facets_in):,} cells with up to {int(facets_in.max()):,} facets: {least:,} cells "
        f"where no plane cuts other facets, some {n_cuts + int((facets_in.astype(float) ** 2).sum()):,} where all do; "
    )
