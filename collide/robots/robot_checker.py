"""RobotChecker: configurations and motions of one robot among the bodies of a World, many at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from collide import argument_checks as checks
from collide.errors import InvalidArgument, brief, listing
from collide.robots.certified_edges import CertifiedEdges, certify, sampled_collision
from collide.robots.check_tables import Setting, check_tables, surroundings_of
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.configuration_batches import check_piece, measure_piece
from collide.robots.configuration_report import ConfigurationReport
from collide.robots.robot import Robot
from collide.robots.robot_bodies import bodies_around, filters_of, robot_bodies
from collide.robots.robot_distances import NEAREST_DTYPE, RobotDistances
from collide.threads import check_threads, pieces_of, share
from collide.transforms import as_poses
from collide.world import World

#: A thread is handed at least so many configurations.
_LEAST_PIECE = 512


class RobotChecker:
    """Checks whole configurations of a robot: against itself, and against the bodies of a World.

        checker = collide.RobotChecker(robot, world)
        free = ~checker.collides(Q)                        # Q (N, dof)
        edges = checker.certify_edges(Q[:-1], Q[1:])       # edges.free: proven, not sampled

    Parameters
    ----------
    robot : Robot
        Its collision geometry, as given: meshes are meshes. `Robot.load(path, meshes="hull")` makes hulls of them,
        which takes a tenth of the time where they are not convex.
    world : World, optional
        What is around. Bodies named like links of the robot with collision geometry are the robot itself, as in
        `Scene.world`: they are left out, and pairs allowed for them hold. When the World changes, the next call sees
        it; bodies that move while a call runs stand where they stood when it began.
    X_WR : (4, 4), optional
        Pose of the robot's root in the world W [m], by default the identity.
    attached : iterable of (name, link, shape, X_LS, touch)
        Objects that move with a link: `X_LS` is their pose in it, by default the identity, `touch` names of links and
        bodies that they may touch. The link itself they always may.
    padding : float or mapping of str to float
        By how much links and attached objects are swollen against what is around [m], not against each other.
    allowed : iterable of (str, str)
        Pairs never tested, of links, attached objects and bodies of the World by name; besides those that robot and
        World disable.
    mobile : bool
        The base moves, too: links of it are tested against static bodies.

    Attributes
    ----------
    bodies, around : list of str
        What moves and what is around, by name.
    skipped : dict of str to int
        How many pairs are never tested, by reason. ``n_pairs`` are.

    Raises
    ------
    InvalidArgument, InvalidPose
        Naming the argument: robots without geometry, unknown links and bodies, names used twice.
    """

    def __init__(
        self, robot: Robot, world: World | None = None, *, X_WR=None, attached: Iterable = (), padding=0.0,
        allowed: Iterable[tuple[str, str]] = (), mobile: bool = False,
    ):  # fmt: skip
        if not isinstance(robot, Robot):
            raise InvalidArgument(f"RobotChecker: robot must be a collide.Robot, got {checks.describe(robot)}")
        if world is not None and not isinstance(world, World):
            raise InvalidArgument(f"RobotChecker: world must be a collide.World, got {checks.describe(world)}")
        self.robot, self.world = robot, World() if world is None else world
        self._X_WR = np.eye(4) if X_WR is None else as_poses(X_WR, "RobotChecker: X_WR")[0].copy()
        self._bodies, self._objects = robot_bodies(robot, attached, padding)
        self._asked, self._mobile = list(allowed), bool(mobile)
        self._seen: tuple | None = None
        self._spare: list[CheckWorkspace] = []
        self._prepare()

    @classmethod
    def from_scene(cls, scene, robot: str | None = None, **options) -> RobotChecker:
        """A checker of a robot in a scene: where it stands, what it carries, and what is never tested.

        Parameters
        ----------
        scene : Scene
            Of `collide.scenes.load`. Its other robots stand still.
        robot : str, optional
            Name of the robot; may be left out where there is one.
        **options
            Those of the class but ``X_WR`` and ``attached``.

        Returns
        -------
        RobotChecker

        Raises
        ------
        InvalidArgument
            Where the scene has no such robot, or several and none is named.
        """
        if robot is None and len(scene.placements) == 1:
            robot = next(iter(scene.placements))
        if robot not in scene.placements:
            known = listing(scene.placements) or "none"
            raise InvalidArgument(f"scene {scene.name}: robot={brief(robot)}; its robots: {known}")
        placement, world = scene.placements[robot], World()
        attached = []
        for body in scene.bodies:
            if body.name not in placement.carried:
                world.add(body.shape, body.X_WB, name=body.name, static=body.static, group=body.group, mask=body.mask)
            elif body.name not in placement.robot.geometry:
                link, X_LB = placement.carried[body.name]
                attached.append((body.name, link, body.shape, X_LB))
        options["allowed"] = [*scene.allowed, *options.get("allowed", ())]
        return cls(placement.robot, world, X_WR=placement.X_WR, attached=attached, **options)

    def __repr__(self) -> str:
        return (
            f"RobotChecker({self.robot.name!r}, {len(self.bodies)} bodies among {len(self.around)}, "
            f"{self.n_pairs} pairs tested)"
        )

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along. What holds addresses is made again."""
        return {name: value for name, value in vars(self).items() if name not in ("setting", "_seen", "_spare")}

    def __setstate__(self, state: dict) -> None:
        vars(self).update(state, _seen=None, _spare=[])
        self._prepare()

    # --- questions ------------------------------------------------------------------------------

    def collides(self, Q, *, threads: int = 1, progress: Callable[[int, int], None] | None = None):
        """Whether configurations collide: links with each other, or with what is around.

        Parameters
        ----------
        Q : (N, dof) or (dof,) array_like
            Configurations [rad or m], columns as in `Robot.joint_names`. Limits are not looked at: `within_limits`.
        threads : int
            At most so many; the answers are the same.
        progress : callable, optional
            Called with (done, N) now and then, by one thread.

        Returns
        -------
        (N,) bool, or bool for a single configuration
            Touching is a hit, decided as by `collide.collide` at the poses of `Robot.link_poses`. A few microseconds
            each, of convex geometry; about O(links · log n) for n bodies around.

        Raises
        ------
        InvalidArgument
            For another number of columns; for values that are not finite, naming row and joint.
        """
        q, is_single = self._configurations(Q)
        out = np.zeros(len(q), dtype=bool)
        self._in_pieces(len(q), threads, progress, lambda space, piece: check_piece(self, space, q[piece], out[piece]))
        return bool(out[0]) if is_single else out

    def distances(
        self, Q, *, max_distance: float = math.inf, threads: int = 1, progress: Callable[[int, int], None] | None = None
    ) -> RobotDistances:
        """The nearest pair of each configuration, or the deepest where some overlap.

        Parameters
        ----------
        Q, threads, progress
            As of `collides`.
        max_distance : float
            [m], ≥ 0: what is farther apart does not count.

        Returns
        -------
        RobotDistances
            Signed distance with its proven bracket, the two bodies by name, witness points, normal, and the gradient
            with respect to q. Of a body of several convex parts the nearest or deepest part counts.

        Raises
        ------
        InvalidArgument
            As of `collides`. UnsupportedQuery as of `collide.distance`.
        """
        limit = checks.limit("RobotChecker.distances: max_distance", max_distance)
        q, _ = self._configurations(Q)
        rows, gradient = np.zeros(len(q), dtype=NEAREST_DTYPE), np.zeros(q.shape)
        self._in_pieces(
            len(q), threads, progress,
            lambda space, piece: measure_piece(self, space, q[piece], rows[piece], gradient[piece], limit),
        )  # fmt: skip
        return RobotDistances(rows, gradient, self.bodies, self.around)

    def edge_collides(self, Q0, Q1, *, resolution: float = 0.01, threads: int = 1) -> np.ndarray:
        """Whether straight motions collide at samples: what lies between two of them is not looked at.

        Parameters
        ----------
        Q0, Q1 : (N, dof) or (dof,) array_like
            Where the motions begin and end [rad or m]; a single one goes with all of the other.
        resolution : float
            No column changes by more from one sample to the next [rad or m].
        threads : int
            As of `collides`.

        Returns
        -------
        (N,) bool
            Both ends are samples. Halves come before quarters: motions that collide are mostly known after a few.
        """
        q0, q1 = self._edges(Q0, Q1)
        step = _positive("RobotChecker.edge_collides: resolution", resolution)
        return ~np.isnan(sampled_collision(q0, q1, step, lambda q: self.collides(q, threads=threads)))

    def certify_edges(
        self, Q0, Q1, *, resolution: float = 1e-3, threads: int = 1, progress: Callable[[int, int], None] | None = None
    ) -> CertifiedEdges:
        """Proves straight motions free, all of the way, or names a time at which they collide.

        Parameters
        ----------
        Q0, Q1 : (N, dof) or (dof,) array_like
            As of `edge_collides`.
        resolution : float
            Intervals in which no column changes by more [rad or m] are not halved any more: they stay open. Motions
            that pass something at a distance d need about d / (length of the arm).
        threads, progress
            As of `collides`.

        Returns
        -------
        CertifiedEdges
            ``free`` (proven), ``time`` of a collision, ``open`` intervals: of every motion one of the three.

        Notes
        -----
        Distances in the middle of an interval against how far anything can move within half of it
        (`motion_bounds.py` says how it is bounded). Mimicking, prismatic, planar and floating joints move straight in
        their columns as well.
        """
        q0, q1 = self._edges(Q0, Q1)
        step = _positive("RobotChecker.certify_edges: resolution", resolution)
        return certify(self, q0, q1, step, threads, progress)

    def explain(self, q) -> ConfigurationReport:
        """Which pairs of a configuration collide, how deep, and what is nearest otherwise, to be printed.

        Parameters
        ----------
        q : (dof,) array_like
            A configuration [rad or m].

        Returns
        -------
        ConfigurationReport
            ``collisions``, ``nearest``, ``notes`` about limits, and ``str()`` of it.

        Raises
        ------
        InvalidArgument
            For anything but one configuration.
        """
        q, is_single = self._configurations(q)
        if not is_single:
            raise InvalidArgument(f"RobotChecker.explain: one configuration ({self.robot.dof},), got {q.shape}")
        self._prepare()
        return ConfigurationReport.of(self, q[0])

    def within_limits(self, Q) -> np.ndarray:
        """Whether configurations keep the joints' limits, those of mimicking joints, too.

        Parameters
        ----------
        Q : (N, dof) or (dof,) array_like

        Returns
        -------
        (N,) bool
        """
        q, _ = self._configurations(Q)
        return self.robot.within_limits(q)

    # --- what they stand on ---------------------------------------------------------------------

    @property
    def bodies(self) -> list[str]:
        """Links with collision geometry and attached objects."""
        return [body.name for body in self._bodies]

    @property
    def around(self) -> list[str]:
        """Bodies of the World that the robot is tested against."""
        return [body.name for body in self.setting.surroundings.bodies]

    @property
    def n_pairs(self) -> int:
        """Pairs of bodies that are tested."""
        return len(self.setting.self_pairs) + int((self.setting.allowed == 0).sum())

    @property
    def skipped(self) -> dict[str, int]:
        """Pairs of bodies that are never tested, by reason."""
        return dict(self.setting.skipped)

    def names_of(self, a: int, b: int) -> tuple[str, str]:
        """Names of two bodies by the numbers that results have for them.

        Parameters
        ----------
        a : int
            Number of a body.
        b : int
            Number of a body, or −1 − the number of one around.

        Returns
        -------
        (str, str)
        """
        return self.bodies[a], self.bodies[b] if b >= 0 else self.around[-1 - b]

    def link_poses(self, q) -> np.ndarray:
        """`Robot.link_poses` of the robot where it stands.

        Parameters
        ----------
        q : (N, dof) or (dof,) array_like
            Configurations [rad or m].

        Returns
        -------
        (N, links, 4, 4) float64
            Poses X_WL [m].
        """
        return self.robot.link_poses(q, self._X_WR)

    def _prepare(self) -> None:
        """The setting of the World as it stands now; nothing is made again while it stays."""
        packed = self.world._pack()
        before, now = self._seen, (packed.roster, self.world.allowed, packed.X_WBs)
        if before is not None and before[0] is now[0] and before[1] == now[1] and np.array_equal(before[2], now[2]):
            return
        self._seen = now[0], now[1], now[2].copy()
        around = bodies_around(self.world, self.robot)
        filters = filters_of(self.robot, self._bodies, self._objects, self.world, around, self._asked, self._mobile)
        surroundings = surroundings_of(around)
        matrices = [self.robot.joint_table.doubles[:, :9].reshape(-1, 3, 3), self._X_WR[None, :3, :3]]
        base = np.concatenate([self._X_WR[:3, :3].ravel(), self._X_WR[:3, 3]])
        tables = check_tables(self._bodies, surroundings, np.concatenate(matrices))
        self.setting = Setting(self._bodies, base, surroundings, tables, *filters)
        self._spare = []

    def _configurations(self, Q) -> tuple[np.ndarray, bool]:
        """((N, dof) C-contiguous, whether a single one was given). Raises InvalidArgument."""
        q = np.ascontiguousarray(self.robot.checked_configurations(Q))
        return q, np.ndim(Q) == 1

    def _edges(self, Q0, Q1) -> tuple[np.ndarray, np.ndarray]:
        q0, q1 = self._configurations(Q0)[0], self._configurations(Q1)[0]
        n = checks.matched_count("RobotChecker: edges", Q0=len(q0), Q1=len(q1))
        return tuple(np.ascontiguousarray(np.broadcast_to(q, (n, q.shape[1]))) for q in (q0, q1))  # type: ignore

    def _in_pieces(self, n: int, threads: int, progress, work: Callable[[CheckWorkspace, slice], None]) -> None:
        """Have ``work`` done on pieces of n units by so many threads, each with a workspace of its own."""
        threads = check_threads(threads)
        self._prepare()
        spare, setting, done = self._spare, self.setting, 0

        def on_piece(piece: slice) -> None:
            nonlocal done
            try:
                space = spare.pop()
            except IndexError:  # all are in use: another thread may have taken the last
                space = CheckWorkspace(self.robot.joint_table, setting)
            work(space, piece)
            spare.append(space)
            done += piece.stop - piece.start
            if progress is not None:
                progress(done, n)

        if threads == 1 and progress is None:
            if n:
                on_piece(slice(0, n))
        else:
            share(pieces_of(n, max(threads, 8 if progress else 1), _LEAST_PIECE), on_piece, threads)


def _positive(what: str, value) -> float:
    number = checks.number(value)
    if number is None or not 0.0 < number < math.inf:
        raise InvalidArgument(f"{what} must be a positive number [rad or m], got {checks.describe(value)}")
    return number
