"""plan: a path between two configurations, every edge of the path proven free."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.robots.plan_arguments import checked_ends, positive, refuse_collisions, sampled_box
from collide.robots.plan_search import PlanSearch, SearchSettings
from collide.robots.robot_checker import RobotChecker
from collide.robots.rrt_connect import N_CHECKED, N_EDGES, N_GOALS, N_START

#: Edges of a motion across all limits, at most.
_MAX_EDGES = 1 << 20


@dataclass(frozen=True)
class MotionPlan:
    """A path with every edge proven free; or the account of a search without success, which is false.

    Parameters
    ----------
    path : (M, dof) float64
        Configurations from the start to a goal [rad or m], as the trees have them; (0, dof) without success.
    simplified : (K, dof) float64
        The path after shortcuts.
    proven : bool
        Every edge of both paths is proven free as by `RobotChecker.certify_edges`: so in every plan that is true.
    n_iterations, n_nodes : int
        Samples to which trees were grown, configurations in both trees.
    n_edges, n_checked : int
        Edges asked by samples, and configurations asked for them.
    n_proofs, n_refused : int
        Edges to be proven, and how many were not: colliding between samples, or open.
    refused_pair : (str, str) or None
        Two bodies of an open edge, not proven apart at the resolution.
    seconds : float
        Of the whole call.
    """

    path: np.ndarray
    simplified: np.ndarray
    proven: bool
    n_iterations: int
    n_nodes: int
    n_edges: int
    n_checked: int
    n_proofs: int
    n_refused: int
    refused_pair: tuple[str, str] | None
    seconds: float

    @property
    def length(self) -> float:
        """Of the simplified path: the sum of Euclidean distances of its configurations [rad or m]."""
        return float(np.linalg.norm(np.diff(self.simplified, axis=0), axis=1).sum())

    def __bool__(self) -> bool:
        return self.proven

    def __repr__(self) -> str:
        done = f"{self.n_iterations} samples, {self.n_nodes} nodes, {self.n_edges} edges, {self.seconds * 1e3:.3g} ms"
        if self:
            n, k = len(self.path) - 1, len(self.simplified) - 1
            return f"MotionPlan({n} edges, {k} after shortcuts, all proven free; {done})"
        pair = "" if self.refused_pair is None else f", {' and '.join(self.refused_pair)} not proven apart"
        return f"MotionPlan(without a path; {done}; {self.n_refused} of {self.n_proofs} edges not proven{pair})"


def plan(
    checker: RobotChecker, start, goal, *, joints: Iterable[str] | None = None, seed: int = 0, step: float = 1.0,
    spacing: float = 0.1, resolution: float = 1e-3, max_iterations: int = 10_000_000, max_seconds: float = 10.0,
) -> MotionPlan:
    """A path from a start to one of several goals, every edge proven free.

    Parameters
    ----------
    checker : RobotChecker
        The robot and the bodies around, asked as of the begin of the call.
    start : (dof,) array_like, or mapping of str to float
        [rad or m], columns as in `Robot.joint_names`; or joint → value, other joints as `Robot.configuration` has them.
    goal : (dof,) or (k, dof) array_like, mapping, or sequence of mappings
        A single goal or several; joints left out of a mapping stay as in the start.
    joints : iterable of str, optional
        Columns that move, by default all. The others stay: start and goals must agree in them.
    seed : int
        The same seed gives the same plan, unless time ends the search.
    step : float
        The longest edge of a tree, a Euclidean distance of configurations [rad or m].
    spacing : float
        No column changes by more between two samples of an edge [rad or m]. What samples overlook, proofs refuse.
    resolution : float
        Of the proofs, as of `RobotChecker.certify_edges` [rad or m].
    max_iterations : int
        Samples drawn at most.
    max_seconds : float
        No further samples are drawn after this time [s].

    Returns
    -------
    MotionPlan
        With ``path`` and ``simplified``, ends included. Without a path, and false, where samples or time have ended.

    Raises
    ------
    InvalidArgument
        Where start or goal collide, naming the pair, or are outside the limits, naming the joint; unknown joints;
        lengths without limits, as of a floating joint; a step of less than a millionth of the way across the limits.

    Notes
    -----
    RRT-Connect: edges of the trees are sampled, edges of a path through both trees are proven; an edge not proven is
    cut from its tree, and the search goes on. Shortcuts lead from a node to the last node of the path with a free
    straight motion between. Joints without limits turn up to half a turn beyond start and goals.

    O(n²) comparisons for n nodes, and O(1) checks a node. Robots of convex parts are asked in kernels alone; an edge
    near a mesh that is not convex costs calls of Python, about 0.2 ms.
    """
    started = time.perf_counter()
    if not isinstance(checker, RobotChecker):
        raise InvalidArgument(f"plan: checker must be a collide.RobotChecker, got {brief(checker)}")
    lengths = positive("step", step), positive("spacing", spacing), positive("resolution", resolution)
    n_samples = checks.integer("plan: max_iterations", max_iterations, 1)
    deadline = started + positive("max_seconds", max_seconds)
    random = np.random.default_rng(checks.integer("plan: seed", seed, 0))
    ends = checked_ends(checker.robot, start, goal)
    low, high = sampled_box(checker.robot, joints, ends)
    if np.sqrt(np.square(high - low).sum()) > _MAX_EDGES * lengths[0]:
        raise InvalidArgument(
            f"plan: step {lengths[0]:g} cuts a motion across the limits into more than {_MAX_EDGES:,} edges; take a "
            "larger step"
        )
    settings = SearchSettings(low, high, *lengths, n_samples, deadline)
    now = checker._as_of_now()
    refuse_collisions(now, ends)
    search = PlanSearch(now, ends, settings, random)
    now.in_pieces(1, 1, None, lambda space, _: search.run(space))
    count = search.words.tolist()
    checker._count(count[N_CHECKED])
    return MotionPlan(
        search.path, search.simplified, len(search.path) > 0, search.n_iterations, count[N_START] + count[N_GOALS],
        count[N_EDGES], count[N_CHECKED], search.n_proofs, search.n_refused, search.refused_pair,
        time.perf_counter() - started,
    )
