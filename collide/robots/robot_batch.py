"""A robot in N worlds with other poses of bodies: a configuration a world, all worlds in a single call.

The kernel of moved surroundings (`move_surroundings.py`) brings a workspace from world to world, and kernels answer in
each; the time of a World, its checker and Python to notice a move is saved. Rows are the rows of a checker among the
bodies of each world, byte for byte.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.kernels import address_of
from collide.results import PAIR_DTYPE
from collide.robots.check_configurations import COLLIDES, IS_OPEN, check_configurations
from collide.robots.check_tables import MovedBodies
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.configuration_batches import check_piece
from collide.robots.distance_batches import (
    DistanceQuestion,
    Slots,
    distance_question,
    finish_rows,
    joined_pieces,
    near_piece,
    nearest_at,
    nearest_rows,
    put_gradients,
)
from collide.robots.distance_gradients import WITNESS
from collide.robots.move_surroundings import FIELD_MOVED, SKEWED
from collide.robots.nearest_pairs import FIRST_LIMIT, OF_BODY, OF_PAIR
from collide.robots.robot_checker import RobotChecker
from collide.robots.robot_distances import NEAREST_DTYPE, RobotDistances
from collide.transforms import as_poses


class _Standing(NamedTuple):
    """Where the bodies of a World stand in a world of the batch, as a setting has them."""

    X_WBs: np.ndarray


class _OneWorld:
    """A workspace brought to a world, and the checker there, made when kernels leave pairs to Python."""

    __slots__ = ("_made", "_now", "_standing", "space")

    def __init__(
        self, now: RobotChecker, space: CheckWorkspace, made: RobotChecker | None, standing: _Standing | None = None
    ):
        self._now, self.space, self._made, self._standing = now, space, made, standing

    @property
    def checker(self) -> RobotChecker:
        """The checker among the bodies of this world."""
        if self._made is None and self._standing is not None:
            setting, X_WBs = self._now.setting, self._standing.X_WBs.copy()
            around = setting.surroundings
            around = around._replace(bodies=MovedBodies(around.bodies, X_WBs))
            self._made = self._now._as_it_is()
            self._made._setting = setting._replace(seen=_Standing(X_WBs), surroundings=around)
        assert self._made is not None
        return self._made


class RobotBatch:
    """A robot among bodies that stand elsewhere in each of N worlds.

        batch = collide.RobotBatch(checker, moving=["crate", "cup"])
        hits = batch.collides(Q, X_WBs)                          # Q (N, dof), X_WBs (N, 2, 4, 4) → (N,) bool
        near = batch.distances(Q, X_WBs, max_distance=0.05)      # rows of configuration k in world k

    Parameters
    ----------
    checker : RobotChecker
        As it is now, with its World: later changes have no say.
    moving : sequence of m ids or names
        Bodies of the World with poses in the questions, in this order; others stand where they are.

    Raises
    ------
    InvalidArgument, UnknownBody

    Notes
    -----
    A world takes what its configuration does, and O(parts and nodes around) for the moves. Not for several threads at
    once.
    """

    def __init__(self, checker: RobotChecker, moving) -> None:
        checks.instance("RobotBatch: checker", checker, RobotChecker, "a collide.RobotChecker")
        self._checker = checker._as_of_now()
        listed = checks.listed_entries("RobotBatch: moving", moving, "ids or names of bodies")
        seen = self._checker.setting.seen
        ids = [seen.world._bodies.id_of(body, f"RobotBatch: moving[{k}]") for k, body in enumerate(listed)]
        self.moving = [seen.names[body] for body in ids]
        rows = [seen.rows[name] for name in self.moving]
        if len(set(rows)) < len(listed):
            raise InvalidArgument(f"RobotBatch: moving must name no body twice, got {checks.brief(moving)}")
        self._rows = np.array(rows, dtype=np.int64)

    def collides(self, Q, X_WBs) -> np.ndarray:
        """Whether configuration k collides in world k, for all k.

        Parameters
        ----------
        Q : (N, dof) or (dof,) array_like
            Configurations [rad or m]; a single one is asked in all worlds.
        X_WBs : (N, m, 4, 4) array_like
            Poses of the moving bodies in W [m].

        Returns
        -------
        (N,) bool, as of `RobotChecker.collides`.

        Raises
        ------
        InvalidArgument, InvalidPose
        """
        q, X_WBs = self._asked("collides", Q, X_WBs)
        verdicts, out = np.zeros(len(q), dtype=np.uint8), np.zeros(len(q), dtype=bool)
        q_at, dof, verdicts_at = address_of(q), q.shape[1], address_of(verdicts)
        for k, world in enumerate(self._worlds(X_WBs)):
            check_configurations(world.space.address, q_at, dof, k, k + 1, verdicts_at)
            if verdicts[k] == IS_OPEN:
                check_piece(world.checker, world.space, q[k : k + 1], out[k : k + 1])
        return out | (verdicts == COLLIDES)

    def distances(
        self, Q, X_WBs, *, max_distance: float = math.inf, per: str = "robot", between: str = "all"
    ) -> RobotDistances:
        """Signed distances of tested pairs of configuration k in world k, for all k.

        Parameters
        ----------
        Q, X_WBs : as of `collides`.
        max_distance : float
            [m], ≥ 0: what is farther apart does not count.
        per, between : as of `RobotChecker.distances`.

        Returns
        -------
        RobotDistances, of which ``configuration`` is the number of the world, too.

        Raises
        ------
        InvalidArgument, InvalidPose
        """
        question = distance_question("RobotBatch.distances", max_distance, per, between)
        q, X_WBs = self._asked("distances", Q, X_WBs)
        if question.per == OF_PAIR:
            return self._near(q, X_WBs, question)
        now, n = self._checker, len(q)
        width = len(now.setting.bodies) if question.per == OF_BODY else 1
        nearest, within = np.zeros((n, width), dtype=PAIR_DTYPE), np.full(n, min(FIRST_LIMIT, question.limit))
        rows, gradient = np.zeros(n * width, dtype=NEAREST_DTYPE), np.empty((n * width, q.shape[1]))
        witness, of = np.empty((n * width, WITNESS)), np.arange(n)
        for k, world in enumerate(self._worlds(X_WBs)):
            space, some = world.space, slice(k, k + 1)
            if not nearest_at(space, q, k, within, nearest, Slots.of(question, space), question.limit):
                nearest[k] = nearest_rows(world.checker, space, q[some], question)[0]
            to = slice(width * k, width * (k + 1))
            put_gradients(now, space, q, of[some], nearest[some], gradient[to], witness[to], question)
        finish_rows(nearest.reshape(-1), rows, question.limit)
        return RobotDistances(rows, gradient, now.bodies, now.around, width * np.arange(n + 1), witness)

    def _near(self, q: np.ndarray, X_WBs: np.ndarray, question: DistanceQuestion) -> RobotDistances:
        """All pairs within the limit."""
        pieces = [
            near_piece(world.checker, world.space, q[k : k + 1], question)
            for k, world in enumerate(self._worlds(X_WBs))
        ]
        rows, gradient, witness, counts = joined_pieces(pieces, q.shape[1])
        starts = np.concatenate([[0], np.cumsum(counts)])
        return RobotDistances(rows, gradient, self._checker.bodies, self._checker.around, starts, witness)

    def _asked(self, caller: str, Q, X_WBs) -> tuple[np.ndarray, np.ndarray]:
        """(configurations (N, dof), poses (N, m, 4, 4)) of a question."""
        q = self._checker.robot.checked_configurations(Q, "Q")
        what, m = f"RobotBatch.{caller}: X_WBs", len(self._rows)
        X = checks.array(what, X_WBs, f"(N, {m}, 4, 4)", InvalidArgument)
        if X.ndim != 4 or X.shape[1:] != (m, 4, 4):
            raise InvalidArgument(f"{what} must have shape (N, {m}, 4, 4), got {X.shape}")
        as_poses(X.reshape(-1, 4, 4), what)
        if len(q) != len(X):
            n = checks.matched_count(f"RobotBatch.{caller}", Q=len(q), X_WBs=len(X))
            q, X = (np.broadcast_to(array, (n, *array.shape[1:])) for array in (q, X))
        return np.ascontiguousarray(q), np.ascontiguousarray(X)

    def _worlds(self, X_WBs: np.ndarray) -> Iterator[_OneWorld]:
        """One world after the other."""
        now = self._checker
        setting = now.setting
        space, may_move = now._workspace(setting), not setting.surroundings.has_margins
        # A workspace compares with where bodies stood before: two arrays by turns.
        turns = [_Standing(setting.seen.X_WBs.copy()) for _ in range(2)]
        for k, X in enumerate(X_WBs):
            standing = turns[k % 2]
            standing.X_WBs[self._rows] = X
            moved = space.follow(standing) if may_move else SKEWED
            if moved == SKEWED:
                made = self._made_anew(X)
                yield _OneWorld(now, made._workspace(made.setting), made)
                continue
            world = _OneWorld(now, space, None, standing)
            if moved == FIELD_MOVED:
                space._walk_fields(world.checker.setting)
            yield world
        setting.spare.append(space)

    def _made_anew(self, X: np.ndarray) -> RobotChecker:
        """The checker in a world that no workspace can be brought to: margins swell bodies by how they are turned."""
        checker = self._checker._as_it_is()
        checker.world, checker._is_fixed = copy.copy(self._checker.setting.seen.world), False
        checker.world.set_poses(self.moving, X)
        return checker._as_of_now()
