"""The search behind `plan`: trees grown on samples by kernels, and the edges of a path through them proven.

An edge not proven is cut from its tree, with all nodes behind, and the search goes on.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from collide.kernels import address_of
from collide.kernels.lanes import LANES
from collide.robots import rrt_connect as words
from collide.robots.certified_edges import certify, sampled_collision
from collide.robots.check_configurations import COLLIDES, IS_FREE
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.robot_checker import RobotChecker
from collide.robots.rrt_connect import grow_trees, shorten_path

#: Samples drawn at first, as many again each time, and at once at most. Places for nodes in each tree, doubled at need.
_SAMPLES, _MAX_SAMPLES, _NODES = 64, 4096, 256
#: A node from which an edge has collided grows to samples so near, as a share of the root mean square distance of two
#: samples: 2/3 solves MotionBenchMaker's problems with half the edges that 1 takes, and smaller shares leave some out.
_REACH = 2.0 / 3.0


@dataclass(frozen=True)
class SearchSettings:
    """Of `plan`.   lower, upper : (dof,) of samples.   deadline : as of `time.perf_counter` [s]."""

    lower: np.ndarray
    upper: np.ndarray
    step: float
    spacing: float
    resolution: float
    max_iterations: int
    deadline: float


class PlanSearch:
    """Both trees, with the buffers of their kernels.

    checker : as of the begin of the call.   ends : (1 + k, dof) the start and k goals, free.
    path, simplified : (M, dof) and (K, dof), proven; without rows before.
    n_drawn, n_proofs, n_refused : samples, edges to be proven, and edges not proven; `refused_pair` of an open edge.
    """

    def __init__(self, checker: RobotChecker, ends: np.ndarray, settings: SearchSettings, random: np.random.Generator):
        self.checker, self.settings, self._random = checker, settings, random
        self._dof, n_goals = ends.shape[1], len(ends) - 1
        self.words = np.zeros(words.SEARCH, dtype=np.int64)
        # Coordinates u, v drawn evenly from an interval of length L have the mean square (u − v)² = L² / 6.
        spread = math.sqrt(float(((settings.upper - settings.lower) ** 2).sum()) / 6.0)
        self.words[words.STEP :].view(np.float64)[:] = settings.step, settings.spacing, _REACH * spread
        self.words[words.DOF], self.words[words.N_START], self.words[words.N_GOALS] = self._dof, 1, n_goals
        self._nodes, self._parents = np.empty((2, 0, self._dof)), np.empty((2, 0), dtype=np.int64)
        self._has_failed = np.empty((2, 0), dtype=np.uint8)
        self._make_space(max(_NODES, len(ends) + 1))
        self._nodes[0, 0], self._nodes[1, :n_goals], self._parents[:, :n_goals] = ends[0], ends[1:], -1
        self._target, self._candidate = np.zeros((2, self._dof))
        self._samples, self._edge = np.empty((0, self._dof)), np.zeros((LANES, self._dof))
        buffers = self._target, self._candidate, self._edge
        self.words[words.TARGET_AT : words.EDGE_AT + 1] = [*map(address_of, buffers)]
        # The first edges go straight from the start to the nearest goal.
        nearest = int(np.square(ends[1:] - ends[0]).sum(axis=1).argmin())
        self.words[words.PHASE], self.words[words.TO], self._target[:] = words.CONNECTING, nearest, ends[1 + nearest]
        self.n_drawn = self.n_proofs = self.n_refused = 0
        self.refused_pair: tuple[str, str] | None = None
        self.path = self.simplified = np.zeros((0, self._dof))

    def _make_space(self, capacity: int) -> None:
        """For so many nodes in each tree."""
        n = self._nodes.shape[1]
        nodes, parents = np.empty((2, capacity, self._dof)), np.empty((2, capacity), dtype=np.int64)
        has_failed = np.zeros((2, capacity), dtype=np.uint8)
        nodes[:, :n], parents[:, :n], has_failed[:, :n] = self._nodes, self._parents, self._has_failed
        self._nodes, self._parents, self._has_failed = nodes, parents, has_failed
        self.words[words.CAPACITY] = capacity
        self.words[words.NODES_AT : words.HAS_FAILED_AT + 1] = [*map(address_of, (nodes, parents, has_failed))]

    def _draw_samples(self) -> bool:
        """As many as were drawn before; false at the end of the search."""
        settings = self.settings
        n = min(max(self.n_drawn, _SAMPLES), _MAX_SAMPLES, settings.max_iterations - self.n_drawn)
        if n <= 0 or time.perf_counter() > settings.deadline:
            return False
        self._samples = settings.lower + (settings.upper - settings.lower) * self._random.random((n, self._dof))
        self.n_drawn += n
        self.words[words.SAMPLES_AT], self.words[words.N_SAMPLES] = address_of(self._samples), n
        self.words[words.NEXT_SAMPLE] = 0
        return True

    @property
    def n_iterations(self) -> int:
        """Samples that the trees have grown to."""
        return self.n_drawn - int(self.words[words.N_SAMPLES] - self.words[words.NEXT_SAMPLE])

    def run(self, space: CheckWorkspace) -> None:
        """Grow the trees until a path through them is proven, or the search ends; then shorten the path."""
        answer = words.UNKNOWN
        while True:
            why = grow_trees(space.address, address_of(self.words), answer)
            answer = words.UNKNOWN
            if why == words.NEEDS_SPACE:
                self._make_space(2 * self._nodes.shape[1])
            elif why == words.NEEDS_ANSWER:
                if time.perf_counter() > self.settings.deadline:
                    return
                begin = self._nodes[self.words[words.TREE], self.words[words.FROM]]
                answer = self._sampled(begin, self._candidate)
            elif why == words.NEEDS_SAMPLES and not self._draw_samples():
                return
            elif why == words.CONNECTED and self._prove_path():
                self._shorten(space)
                return

    def _sampled(self, q0: np.ndarray, q1: np.ndarray) -> int:
        """The answer to an edge left open by the kernel, near meshes that are not convex."""
        time_of_hit = sampled_collision(self.checker, q0[None], q1[None], self.settings.spacing, 1)
        return IS_FREE if np.isnan(time_of_hit[0]) else COLLIDES

    def _prove(self, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
        """(n,) bool: edges proven free."""
        edges = certify(self.checker, q0, q1, self.settings.resolution, 1, None)
        self.n_proofs += len(q0)
        self.n_refused += int(np.count_nonzero(~edges.free))
        if edges.open_names:
            self.refused_pair = edges.open_names[0]
        return edges.free

    def _prove_path(self) -> bool:
        """Whether the path through the node shared by both trees is proven; edges that are not are cut."""
        tree = int(self.words[words.TREE])
        sides = [(tree, self._chain(tree, int(self.words[words.FROM])))]
        sides.append((1 - tree, self._chain(1 - tree, int(self.words[words.TO]))))
        sides.sort()  # the start's first
        rows = [self._nodes[side, chain] for side, chain in sides]
        path = np.concatenate([rows[0][::-1], rows[1][1:]])
        free = self._prove(path[:-1], path[1:])
        if free.all():
            self.path = path
            return True
        n = len(rows[0]) - 1
        for (side, chain), of_side in zip(sides, (free[:n][::-1], free[n:])):
            if not of_side.all():  # of each side the edge nearest to the root, whose far node comes first in the chain
                self._cut(side, chain[int(np.flatnonzero(~of_side)[-1])])
        self.words[words.PHASE] = words.EXTENDING
        return False

    def _chain(self, tree: int, node: int) -> list[int]:
        """Nodes of a tree from a node to the root."""
        chain = [node]
        while (node := int(self._parents[tree, node])) >= 0:
            chain.append(node)
        return chain

    def _cut(self, tree: int, node: int) -> None:
        """Take a node and all nodes behind from a tree. Parents stand before their children."""
        n = int(self.words[words.N_START + tree])
        nodes, parents, has_failed = self._nodes[tree], self._parents[tree], self._has_failed[tree]
        remains = np.ones(n, dtype=bool)
        remains[node] = False
        for k in range(node + 1, n):
            remains[k] = parents[k] < 0 or remains[parents[k]]
        number, before = np.cumsum(remains) - 1, parents[:n][remains]
        m = len(before)
        nodes[:m], has_failed[:m] = nodes[:n][remains], has_failed[:n][remains]
        parents[:m] = np.where(before < 0, -1, number[before])
        self.words[words.N_START + tree] = m

    def _shorten(self, space: CheckWorkspace) -> None:
        """The path with shortcuts from node to node; a shortcut that is not proven becomes the path's own edges."""
        n = len(self.path)
        remaining, task = np.zeros(n, dtype=np.int64), np.zeros(words.SHORTENING, dtype=np.int64)
        task[:] = address_of(self.path), n, address_of(remaining), 1, 0, n - 1
        answer = words.UNKNOWN
        while shorten_path(space.address, address_of(self.words), address_of(task), answer) == words.NEEDS_ANSWER:
            answer = self._sampled(self.path[task[words.BEGIN]], self.path[task[words.END]])
        remaining = remaining[: task[words.N_REMAINING]]
        begin, end = remaining[:-1], remaining[1:]
        jumps = np.flatnonzero(end > begin + 1)
        if len(jumps):
            refused = jumps[~self._prove(self.path[begin[jumps]], self.path[end[jumps]])]
            between = [np.arange(begin[k] + 1, end[k]) for k in refused]
            remaining = np.sort(np.concatenate([remaining, *between]))
        self.simplified = self.path[remaining]
