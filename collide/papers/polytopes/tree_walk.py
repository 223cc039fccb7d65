"""Whether two preprocessed polytopes meet, down their hierarchical trees (Barba and Langerman 2015, theorem 6.3).

P is the hull of points, R = {x : ⟨w, x⟩ ≤ 1 for all w of Q}, with the origin inside R. A round compares the nets of two
nodes. A point z of the net of Q with ⟨p, z⟩ > 1 on all the net of P lets P's node go down: boundary simplices of P with
⟨p, z⟩ > 1 at every corner do not touch R. A point x of the net of P with ⟨x, w⟩ ≤ 1 on all the net of Q lets Q's node
go down: the half-space of x holds no y with ⟨p, y⟩ > 1 for all p of P.

At the end of P's tree the boundary of P misses R, so that R is apart from P, or inside. The text forgets the latter.
Here the first rounds decide, on P's tree alone, whether the origin is in P: an origin in P is a hit, and with the
origin outside P, R is not inside. At the end of Q's tree no y of this kind is on the boundary of Q, nor inside, since
an inner y could be scaled up; so the bodies meet.

All comparisons are in doubles on rounded points, with a margin η above all rounding. Cases within
the margin are open: `trees_meet` decides them in integers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.least_distance.homogeneous_rows import HomogeneousRows
from collide.least_distance.pair_proposals import Work, propose_pair
from collide.papers.polytopes.facet_tree import FacetTree, Node, apex_height
from collide.papers.polytopes.ray_exit import ray_exit
from collide.papers.polytopes.shell_cones import coefficients_in

HIT, MISS, OPEN = "hit", "miss", "open"
#: Coefficients above this are no less than 0 but for rounding, relative to the largest.
_NEGATIVE = -1e-9


class Grid(NamedTuple):
    """Points as integers: ``points`` ≈ ``centre`` + ``unit`` · ``whole``, each coordinate to one unit.

    points : (n, d) float64.   whole : (n, d) float64, integers of 47 bits.
    """

    points: np.ndarray
    whole: np.ndarray
    centre: np.ndarray
    unit: float


class Relative(NamedTuple):
    """Where P is, seen from R, and what doubles may be off.

    A, a : a grid point q of P is at A q + a in the frame of R whose origin is inside R.
    o : the origin of that frame on the grid of P.
    eta : no product ⟨p, w⟩ of a point of P and one of Q is off by as much.
    zeta : nor a plane's height at o, for planes with max |a| = 1.
    """

    A: np.ndarray
    a: np.ndarray
    o: np.ndarray
    eta: float
    zeta: float


class Plane(NamedTuple):
    """Σ multipliers·rows ≤ Σ multipliers·offsets: in a walk of rows w of Q, ⟨z, x⟩ ≤ Σ multipliers, which R is in."""

    rows: tuple[int, ...]
    multipliers: tuple[float, ...]


class Walk(NamedTuple):
    """status : HIT, MISS or OPEN.   planes : of a miss, the planes that exclude the boundary of P; else the planes so
    far.

    origin_planes : (a, b) on the grid of P: the origin is beyond each, and every boundary simplex of P below some
        plane.
    origin_rounds : rounds on P's tree for the origin; rounds : rounds of two nets.
    points, halfspaces : rows behind the nets' answers.
    simplices_read : number of shell cones read.   net_rows : number of rows of nets read.
    """

    status: str
    planes: list[Plane]
    origin_planes: list[tuple[float, ...]]
    origin_rounds: int
    rounds: int
    points: list[int]
    halfspaces: list[int]
    simplices_read: int
    net_rows: int


class TreeWalk:
    """One query.

    Parameters
    ----------
    hull_tree, polar_tree : FacetTree
        Of P's points and of the points w of R's half-spaces, on their grids.
    polar_grid : Grid
        Of the latter.
    relative : Relative
        Of P and R.
    """

    def __init__(self, hull_tree: FacetTree, polar_tree: FacetTree, polar_grid: Grid, relative: Relative):
        self.hull_tree, self.polar_tree, self.polar_grid, self.relative = hull_tree, polar_tree, polar_grid, relative
        self.work = Work()
        self.planes: list[Plane] = []
        self.origin_planes: list[tuple[float, ...]] = []
        self.points: list[int] = []
        self.halfspaces: list[int] = []
        self.origin_rounds = self.rounds = self.simplices_read = self.net_rows = 0

    def run(self) -> Walk:
        """All rounds."""
        status = self.locate_origin()
        if status == MISS:
            status = self.compare()
        return Walk(
            status, self.planes, self.origin_planes, self.origin_rounds, self.rounds, self.points, self.halfspaces,
            self.simplices_read, self.net_rows,
        )

    # --- the origin ---------------------------------------------------------------------------------------------------

    def locate_origin(self) -> str:
        """HIT for an origin in P, MISS for an origin outside.

        A plane between the origin and a net also separates the net from a ray from the origin, directed away from a
        point of the net. The unbounded ray is not inside P: the ray meets P on the boundary, or not at all.
        """
        o, zeta, tree = self.relative.o, self.relative.zeta, self.hull_tree
        ray = o - tree.centre
        node: Node | None = tree.root
        while node is not None:
            self.origin_rounds += 1
            rows = np.concatenate((tree.first, node.rows))
            self.net_rows += len(rows)
            points = tree.points[rows]
            leaving = ray_exit(points - tree.centre, np.arange(len(tree.first)), ray) if ray.any() else None
            if leaving is None:
                return OPEN
            error = float(np.abs(leaving.weights @ (points[leaving.rows] - tree.centre) - ray).max()) + zeta
            if error <= (1.0 - float(leaving.weights.sum())) * tree.inner_radius:
                return HIT
            a = leaving.normal / np.abs(leaving.normal).max()
            top, height = float((points @ a).max()), float(a @ o)
            if height - top <= 8.0 * zeta:
                return OPEN
            middle = (top + height) / 2.0
            self.origin_planes.append((*a.tolist(), middle))
            if node.is_leaf:
                return MISS
            child = self._go_down(tree, node, a, middle - zeta)
            if isinstance(child, str):
                return OPEN
            if child is node:
                self.origin_planes.pop()  # the net was drawn again
            node = child
        return MISS

    # --- two nets -----------------------------------------------------------------------------------------------------

    def compare(self) -> str:
        """The rounds of two nets."""
        A, a, _, eta, _ = self.relative
        p, q = self.hull_tree.root, self.polar_tree.root
        y, w = self._in_frame_of_region(p), self._polar(q)
        z, x = a, -a
        while True:
            self.rounds += 1
            self.net_rows += len(y) + len(w)
            answer = self._compare_nets(p, q, y, w, z, x)
            if answer is None:
                return OPEN
            is_apart, vector = answer
            tree, node = (self.hull_tree, p) if is_apart else (self.polar_tree, q)
            if node.is_leaf:
                return MISS if is_apart else HIT
            if is_apart:
                z = vector
                child = self._go_down(tree, node, -z @ A, float(a @ z) - 1.0 - eta)
            else:
                x = vector
                grid = self.polar_grid
                child = self._go_down(tree, node, grid.unit * x, 1.0 - eta - float(grid.centre @ x))
            if child is None:
                return MISS if is_apart else HIT
            if isinstance(child, str):
                return OPEN
            if is_apart:
                p, y = child, self._in_frame_of_region(child)
            else:
                q, w = child, self._polar(child)

    def _in_frame_of_region(self, node: Node) -> np.ndarray:
        return self.hull_tree.points[node.rows] @ self.relative.A.T + self.relative.a

    def _polar(self, node: Node) -> np.ndarray:
        return self.polar_grid.centre + self.polar_grid.unit * self.polar_tree.points[node.rows]

    def _compare_nets(self, p: Node, q: Node, y, w, z, x) -> tuple[bool, np.ndarray] | None:
        """(True, z) where z parts the nets, (False, x) where x is in both, by more than η; else None."""
        eta = self.relative.eta
        points = HomogeneousRows(y, 1.0, _no_integers)
        halfspaces = HomogeneousRows(w, 1.0 - 4.0 * eta, _no_integers)
        proposal = propose_pair(
            points, halfspaces, self.work, None, None, [int(np.argmin(y @ z))], [int(np.argmax(w @ x))]
        )
        if proposal is None:
            return None
        weights, multipliers = _coefficients(y[proposal.points], w[proposal.halfspaces], proposal.y, proposal.u)
        total = float(multipliers.sum())
        if total > 0.0:
            plane = multipliers / total
            z = plane @ w[proposal.halfspaces]
            if float((y @ z).min()) > 1.0 + 2.0 * eta:
                rows = q.rows[proposal.halfspaces].tolist()
                self.planes.append(Plane(tuple(rows), tuple(plane.tolist())))
                self._remember(p.rows[proposal.points].tolist(), rows)
                return True, z
        x = weights @ y[proposal.points]
        if float((w @ x).max()) < 1.0 - 2.0 * eta:
            self._remember(p.rows[proposal.points].tolist(), q.rows[proposal.halfspaces].tolist())
            return False, x
        return None

    def _remember(self, points: list[int], halfspaces: list[int]) -> None:
        self.points.extend(row for row in points if row not in self.points)
        self.halfspaces.extend(row for row in halfspaces if row not in self.halfspaces)

    def _go_down(self, tree: FacetTree, node: Node, g: np.ndarray, height: float) -> Node | str | None:
        """The child with every simplex of the node that has a corner with g·x above a height."""
        at_cone = find_cone(tree, node, g)
        if at_cone is None:
            return OPEN
        vertex, cone, coefficients = at_cone
        cones = tree.cones(node, vertex)
        self.simplices_read += len(cones)
        if apex_height(node, cones[cone], g, coefficients, tree.reach) > height:
            return OPEN
        return tree.child(node, vertex, cone)


def _coefficients(points, halfspaces, y: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(weights of sum 1, multipliers), all ≥ 0, that make y of points and u of half-spaces as nearly as doubles can."""
    system = np.vstack((points.T, np.ones(len(points))))
    weights = np.maximum(np.linalg.lstsq(system, np.append(y, 1.0), rcond=None)[0], 0.0)
    if len(halfspaces) == 0:
        return weights / weights.sum(), np.zeros(0)
    multipliers = np.maximum(np.linalg.lstsq(halfspaces.T, u, rcond=None)[0], 0.0)
    return weights / weights.sum(), multipliers


def find_cone(tree: FacetTree, node: Node, g: np.ndarray) -> tuple[int, int, np.ndarray] | None:
    """(vertex, cone, coefficients ≥ 0): the shell cone of a net's hull whose normals' cone holds g; None in doubt."""
    vertex = int(np.argmax(tree.points[node.rows] @ g))
    cones = tree.cones(node, vertex)
    if not len(cones):
        return None
    coefficients = coefficients_in(cones, node.hull.planes, g)
    least = coefficients.min(axis=1)
    cone = int(np.argmax(least))
    if least[cone] < _NEGATIVE * float(np.abs(coefficients[cone]).max()):
        return None
    return vertex, cone, np.maximum(coefficients[cone], 0.0)


def _no_integers(row: int) -> list[int]:
    raise AssertionError("nets are compared in doubles")


def extreme_row(tree: FacetTree, g: np.ndarray) -> tuple[int, int, int] | None:
    """(row, nodes, shell cones read) of a point of the tree with the largest g·x, to rounding; ``None`` in doubt.

    From the root down: points higher than the net's highest are outside the shell cone of g.
    """
    node: Node | None = tree.root
    best, best_row, n_nodes, n_read = -np.inf, -1, 0, 0
    while node is not None:
        n_nodes += 1
        heights = tree.points[node.rows] @ g
        at = int(np.argmax(heights))
        if heights[at] > best:
            best, best_row = float(heights[at]), int(node.rows[at])
        if node.is_leaf:
            break
        at_cone = find_cone(tree, node, g)
        if at_cone is None:
            return None
        vertex, cone, _ = at_cone
        n_read += len(tree.cones(node, vertex))
        node = tree.child(node, vertex, cone)
    return best_row, n_nodes, n_read
