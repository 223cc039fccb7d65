"""A broken surface made a solid as far as that is safe, and every step told: `repaired`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.mesh.mesh_survey import INSIDE_OUT
from collide.shapes.mesh import Mesh
from collide.solids.arrangement import crossings_of
from collide.solids.combine import combine
from collide.solids.limits import Limits
from collide.solids.repair_steps import (
    LONGEST_CYCLE,
    NEW,
    Chain,
    Hole,
    consistently_oriented,
    holes_of,
    turned_outside,
    with_holes_closed,
    with_joined_vertices,
    without_flat_facets,
    without_repeats,
    without_walls,
)

#: Of the diagonal of the mesh's box: how near vertices of open edges are joined, and how wide holes are closed.
_WELD, _WIDEST_HOLE = 1e-6, 0.1
_MAX_LISTED = 6


class Unrepaired(NamedTuple):
    """A defect after all steps.

    what : the defect, in the words of `Mesh.report`.   facets : (k,) rows of the old mesh's faces.   why : the reason.
    """

    what: str
    facets: np.ndarray
    why: str

    def __str__(self) -> str:
        return f"{self.what}: {self.why}: {_rows(self.facets)}"


class MeshRepair(NamedTuple):
    """The steps of a repair, in their order. Facets are rows of the old mesh's faces.

    welded : (k,) rows of vertices at open edges joined to others.
    repeated : (k,) facets left out as repeats of others, and pairs of opposite facets.
    walls : (k,) facets left out between two parts of the inside, and fins.
    turned : (k,) facets turned over.
    holes : closed holes, with the facets around.
    flat : (k,) facets left out for want of an area; neighbours are split at their corners.
    crossings : (k, 2) pairs of facets resolved by winding numbers; −1 for a facet that closes a hole.
    moved : the farthest any point of the surface was moved, by joining and by rounding [m].
    unrepaired : remaining defects, each with reason and facets.
    size : the diagonal of the mesh's box [m]: holes are told in percent of it.
    """

    welded: np.ndarray
    repeated: np.ndarray
    walls: np.ndarray
    turned: np.ndarray
    holes: tuple[Hole, ...]
    flat: np.ndarray
    crossings: np.ndarray
    moved: float
    unrepaired: tuple[Unrepaired, ...]
    size: float

    @property
    def changed(self) -> bool:
        """Whether the mesh is another than before."""
        return bool(self.steps())

    def steps(self) -> list[str]:
        """The steps in words, a line each, with facet numbers; no lines where nothing was done."""
        lines = []
        if len(self.welded):
            lines.append(f"joined {_counted(len(self.welded), 'vertex', 'vertices')} at open edges to others")
        for rows, what in (
            (self.repeated, "left out repeats"), (self.walls, "left out walls inside"), (self.turned, "turned over"),
        ):
            if len(rows):
                lines.append(f"{what}: {_rows(rows)}")
        if self.holes:
            widest = max(hole.width for hole in self.holes)
            around = np.unique(np.concatenate([hole.facets for hole in self.holes]))
            wide = f"{_share(widest, self.size)} of the size wide at most"
            lines.append(f"closed {_counted(len(self.holes), 'hole')}, {wide}, at {_rows(around)}")
        if len(self.flat):
            lines.append(f"left out without an area: {_rows(self.flat)}")
        if len(self.crossings):
            pairs = _counted(len(self.crossings), "pair of crossing facets", "pairs of crossing facets")
            lines.append(f"resolved {pairs} by winding numbers: {_rows(_old(self.crossings))}")
        return lines

    def __str__(self) -> str:
        lines = [*(self.steps() or ["nothing to repair"])]
        if self.moved:
            lines.append(f"moved by {self.moved:.3g} m at most")
        lines += [f"not repaired: {entry}" for entry in self.unrepaired[:_MAX_LISTED]]
        if len(self.unrepaired) > _MAX_LISTED:
            lines.append(f"not repaired: {len(self.unrepaired) - _MAX_LISTED} more")
        return "\n".join(f"- {line}" for line in lines)


class RepairedMesh(NamedTuple):
    """The result of `Mesh.repaired`.

    mesh : the repaired `Mesh`; the old mesh itself where nothing was done.
    source_facets : (k,) int64, for every facet of ``mesh`` the row of the old facet around it; −1 over holes.
    report : the steps, and what remains: `MeshRepair`.
    """

    mesh: Mesh
    source_facets: np.ndarray
    report: MeshRepair


def repaired(
    mesh: Mesh, *, weld: float | None = None, widest_hole: float | None = None, crossings: bool = True, progress=None,
    time_limit: float | None = None, memory: int | None = None,
) -> RepairedMesh:
    """A mesh made a solid without crossing facets, as far as that is safe, and a report of every step.

    Parameters
    ----------
    mesh : any `Mesh`.
    weld : vertices at open edges are joined within this distance [m]; by default 1e-6 of the box's diagonal.
    widest_hole : the widest hole to close, by `Hole.width` [m]: the diagonal of a square hole, twice the width of a
        slit; by default a tenth of the box's diagonal. Infinity closes all. A mesh with a wider hole keeps all of its
        holes: closing some makes no solid.
    crossings : resolve facets that cross: inside is what facets wind around once or more.
    progress, time_limit, memory : as of `boolean`.

    Returns
    -------
    RepairedMesh. Where defects remain, ``mesh`` is a surface, with the other steps done, and ``report.unrepaired``
    has reasons and facets.

    Raises
    ------
    InvalidArgument : arguments out of range.
    UnsupportedQuery : a limit was reached.

    Notes
    -----
    Steps on a surface that does not close: vertices joined at open edges; repeated facets left out; orientation made
    the same across edges of two facets, by the greater part; walls inside left out; holes closed by triangles of least
    area. Then on all meshes: facets of no area left out, the surface unchanged; parts inside out turned over; crossings
    resolved in an exact arrangement. O(n log n), n³ for a hole of n edges, 1,000 at most.
    """
    if not isinstance(mesh, Mesh):
        raise InvalidArgument(f"repaired: mesh must be a collide.Mesh, got {brief(mesh)}")
    size = float(np.sqrt(np.square(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0)).sum()))
    weld = _WELD * size if weld is None else checks.length("repaired: weld", weld)
    widest = _WIDEST_HOLE * size if widest_hole is None else _width(widest_hole)
    crossings = checks.true_or_false("repaired: crossings", crossings)
    with Limits("repaired", progress, time_limit, memory) as limits:
        limits.stage("closing the surface")
        log = _Log(size, widest)
        chain = _repaired_chain(mesh, weld, log)
        made = Mesh(chain.vertices, chain.corners)
        if not log.changed and made.solid is mesh.solid:
            made = mesh
    source, crossing = chain.source, np.zeros((0, 2), dtype=np.int64)
    if crossings and made.solid:
        made, source, crossing = _resolved(made, source, log, progress, time_limit, memory)
    if not made.solid:
        log.unrepaired += _remaining(made, source, log)
    return RepairedMesh(made, source, log.report(crossing))


def _width(widest_hole) -> float:
    value = checks.number(widest_hole)
    if value is None or isinstance(widest_hole, bool) or not value >= 0.0:
        raise InvalidArgument(f"repaired: widest_hole must be a length of 0 or more [m], got {brief(widest_hole)}")
    return value


class _Log:
    """What the steps did, by old rows."""

    def __init__(self, size: float, widest: float):
        self.size, self.widest = size, widest
        self.reset([])

    def reset(self, unrepaired: list[Unrepaired]) -> None:
        """No step done, and what remains."""
        nothing = np.zeros(0, dtype=np.int64)
        self.rows = {name: nothing for name in ("welded", "repeated", "walls", "flat")}
        self._turns: dict[int, int] = {}
        self.holes: list[Hole] = []
        self.wide: list[Hole] = []
        self.why_open = "no step repairs this"
        self.moved, self.unrepaired = 0.0, unrepaired

    @property
    def changed(self) -> bool:
        return bool(self.holes) or any(len(rows) for rows in self.rows.values()) or len(self.turned) > 0

    @property
    def turned(self) -> np.ndarray:
        """(k,) rows turned an odd number of times."""
        return np.array(sorted(row for row, turns in self._turns.items() if turns % 2 and row != NEW), dtype=np.int64)

    def less(self, name: str, before: Chain, after: Chain) -> Chain:
        """Note the old facets of which nothing remains; gives the chain after."""
        gone = np.setdiff1d(before.source[before.source != NEW], after.source)
        self.rows[name] = np.union1d(self.rows[name], gone)
        return after

    def note_turned(self, rows: np.ndarray) -> None:
        for row in np.unique(rows).tolist():
            self._turns[row] = self._turns.get(row, 0) + 1

    def report(self, crossing: np.ndarray) -> MeshRepair:
        return MeshRepair(
            self.rows["welded"], self.rows["repeated"], self.rows["walls"], self.turned, tuple(self.holes),
            self.rows["flat"], crossing, self.moved, tuple(self.unrepaired), self.size,
        )


def _repaired_chain(mesh: Mesh, weld: float, log: _Log) -> Chain:
    """All steps but crossings; the mesh's own faces where no step does anything."""
    survey, whole = mesh.survey, Chain(mesh.vertices, mesh.faces, np.arange(len(mesh.faces)))
    chain = whole._replace(corners=survey.corners)
    if not survey.closed or not survey.signs.any():
        chain = _closed_chain(chain, weld, log)
    chain = log.less("flat", chain, without_flat_facets(chain))
    if not len(chain.corners):
        log.reset([Unrepaired("no area", whole.source, "nothing else would remain")])
        return whole
    if chain.survey().closed:
        chain, rows = turned_outside(chain, INSIDE_OUT)
        log.note_turned(chain.source[rows])
        if log.holes and not (chain.survey().signs > 0).any():
            log.holes, log.why_open = [], "the surface and triangles over its holes enclose nothing"
            chain = chain.only(chain.source != NEW)
    return chain if log.changed else whole


def _closed_chain(chain: Chain, weld: float, log: _Log) -> Chain:
    """The chain closed, where all of its holes are narrow enough."""
    joined, log.rows["welded"], log.moved = with_joined_vertices(chain, weld)
    a, b, c = joined.corners.T
    joined = log.less("flat", joined, joined.only((a != b) & (b != c) & (c != a)))
    chain = log.less("repeated", joined, without_repeats(joined))
    chain, rows = consistently_oriented(chain)
    log.note_turned(chain.source[rows])
    chain = log.less("walls", chain, without_walls(chain))
    chain, rows = consistently_oriented(chain)
    log.note_turned(chain.source[rows])
    holes = holes_of(chain, log.widest)
    log.wide = [hole for hole, triangles in holes if not len(triangles)]
    if log.wide:
        return chain
    log.holes = [hole for hole, _ in holes]
    return with_holes_closed(chain, [triangles for _, triangles in holes])


def _resolved(mesh: Mesh, source: np.ndarray, log: _Log, progress, time_limit, memory):
    """(the solid without crossing facets, its source facets, the pairs that crossed, by old rows)."""
    pairs = crossings_of(mesh)
    if not len(pairs):
        return mesh, source, pairs
    crossing = source[pairs]
    r = combine([mesh], np.eye(4)[None], "union", progress=progress, time_limit=time_limit, memory=memory)
    if r.mesh is None:
        log.unrepaired.append(Unrepaired("crossing facets", _old(crossing), "they wind around nothing"))
        return mesh, source, crossing[:0]
    log.moved += r.moved
    source = source[r.facet]
    if len(r.self_collisions):
        facets = _old(source[r.self_collisions])
        log.unrepaired.append(Unrepaired("crossing facets", facets, "they cross again once corners are rounded"))
    return r.mesh, source, crossing


def _remaining(mesh: Mesh, source: np.ndarray, log: _Log) -> list[Unrepaired]:
    """Why the mesh is no solid still."""
    entries = []
    for hole in sorted(log.wide, key=lambda hole: -hole.width):
        length, width, widest = (_share(x, log.size) for x in (hole.length, hole.width, log.widest))
        size = f"a hole of {hole.edges} edges, {length} of the size long and {width} wide"
        limit = f"over widest_hole={widest}"
        if hole.edges > LONGEST_CYCLE:
            limit = f"more than {LONGEST_CYCLE} edges"
        entries.append(Unrepaired("open edges", hole.facets, f"{size}, {limit}"))
    for defect in mesh.report.defects:
        if defect.spoils and not (entries and defect.name in ("open edges", "unbalanced edges")):
            entries.append(Unrepaired(defect.name, _old(source[defect.facets]), log.why_open))
    return entries


def _old(rows: np.ndarray) -> np.ndarray:
    """(k,) the old facets among rows, each once."""
    rows = np.unique(rows)
    return rows[rows != NEW]


def _rows(facets: np.ndarray) -> str:
    listed = ", ".join(str(f) for f in facets[:_MAX_LISTED].tolist())
    more = f", … ({len(facets)} in all)" if len(facets) > _MAX_LISTED else ""
    return f"facet{'s' * (len(facets) != 1)} {listed}{more}"


def _counted(n: int, noun: str, nouns: str | None = None) -> str:
    return f"{n} {noun if n == 1 else nouns or noun + 's'}"


def _share(length: float, size: float) -> str:
    return f"{100.0 * length / size if size else 0.0:.3g} %"
