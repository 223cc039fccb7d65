"""RobotChecker: configurations and motions of one robot among the bodies of a World, many at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads
from collide.base.whole_file import whole_file
from collide.errors import InvalidArgument, brief, listing
from collide.robots.certified_boxes import CertifiedBoxes, certify_boxes
from collide.robots.certified_edges import CertifiedEdges, certify, sampled_collision
from collide.robots.certified_motions import CertifiedMotion, certify_pieces, refuse_degrees, shortest_ways
from collide.robots.check_configurations import COLLIDES, IS_OPEN
from collide.robots.checker_file import checker_bytes
from collide.robots.checker_scene import CheckerScene
from collide.robots.configuration_batches import check_piece
from collide.robots.configuration_report import ConfigurationReport
from collide.robots.distance_batches import distance_question, jacobians, measure
from collide.robots.moving_obstacles import among_moving
from collide.robots.robot import Robot
from collide.robots.robot_bodies import padding_of
from collide.robots.robot_distances import RobotDistances
from collide.robots.self_filter import points_in_world, points_of_robot
from collide.robots.splines import Spline
from collide.shapes.point_cloud import PointCloud
from collide.transforms import LARGEST, as_pose
from collide.worlds.world import World

#: A motion counts as so many configurations.
_CONFIGURATIONS_OF_A_MOTION = 20


class RobotChecker(CheckerScene):
    """Checks whole configurations of a robot: against itself, and against the bodies of a World.

        checker = collide.RobotChecker(robot, world)
        free = ~checker.collides(Q)                        # Q (N, dof)
        edges = checker.certify_edges(Q[:-1], Q[1:])       # edges.free: proven, not sampled

    Parameters
    ----------
    robot : Robot
        Its collision geometry, as given: meshes are meshes. `Robot.load(path, meshes="hull")` makes hulls of them,
        a tenth of the time for meshes that are not convex.
    world : World, optional
        The surroundings. Bodies named like links of the robot with collision geometry are the robot itself, as in
        `Scene.world`: they are left out; pairs allowed for them, their groups and masks hold. Margins of the others
        swell them against the robot; sleeping bodies are obstacles, too. The next call sees every change of the
        World: a moved body costs microseconds, another shape a millisecond of tables, none of the robot's. A call is
        answered as of its begin, whatever other threads change.
    X_WR : (4, 4), optional
        Pose of the robot's root in the world W [m], by default the identity.
    attached : iterable of (name, link, shape, X_LS, touch)
        Objects attached to a link: `X_LS` is their pose in the link, by default the identity, `touch` names of links
        and bodies they may touch, beside their own link.
    padding : float or mapping of str to float
        Swelling of links and attached objects against the surroundings [m], not against each other.
    allowed : iterable of (str, str)
        Pairs never tested, of links, attached objects and bodies of the World by name; besides the pairs disabled by
        robot and World.
    mobile : bool
        The base moves, too: its links are tested against static bodies.

    Attributes
    ----------
    bodies, around : list of str
        Names of the bodies of the robot, links from the last to the root and attached objects behind, and of the
        surroundings.
    skipped : dict of str to int
        Number of pairs never tested, by reason; ``n_pairs`` is the number of tested pairs.

    Raises
    ------
    InvalidArgument, InvalidPose
        Naming the argument: robots without geometry, unknown links and bodies, names used twice, margins of links in
        the World.
    """

    def __init__(
        self, robot: Robot, world: World | None = None, *, X_WR=None, attached: Iterable = (), padding=0.0,
        allowed: Iterable[tuple[str, str]] = (), mobile: bool = False,
    ):
        super().__init__(robot, world, X_WR, attached, padding, allowed, mobile)

    @classmethod
    def from_scene(cls, scene, robot: str | None = None, **options) -> RobotChecker:
        """A checker of a robot in a scene, with its base pose, attached objects and untested pairs.

        Parameters
        ----------
        scene : Scene
            Of `collide.scenes.load`. Its other robots stand still.
        robot : str, optional
            Name of the robot; may be left out in a scene with a single robot.
        **options
            Arguments of the class except ``X_WR`` and ``attached``.

        Returns
        -------
        RobotChecker

        Raises
        ------
        InvalidArgument
            For a robot not in the scene, and without a name where the scene has several robots.
        """
        if not hasattr(scene, "placements"):
            raise InvalidArgument(
                f"RobotChecker.from_scene: scene must be what collide.scenes.load gives, got {brief(scene)}"
            )
        if robot is not None:
            checks.text("RobotChecker.from_scene: robot", robot)
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

    # --- changes --------------------------------------------------------------------------------

    def attach(self, name: str, link: str, shape, X_LS=None, *, touch: Iterable[str] = ()) -> None:
        """Attach an object to a link, as with ``attached``: a grasped part.

        Parameters
        ----------
        name : str
            Unique among links and attached objects.
        link : str
            It carries the object.
        shape : Shape
        X_LS : (4, 4), optional
            Pose of the shape in the link [m], by default the identity.
        touch : iterable of str
            Links and bodies whose contact with the object is allowed, beside its own link.

        Raises
        ------
        InvalidArgument, InvalidPose
            Naming the argument; nothing is attached.

        Notes
        -----
        Tables of links and World stay, the object is a row behind: O(links + bodies around), 20 µs for a primitive or
        for a hull or mesh that was attached before, and 10 µs at the next question. Questions begun before are
        answered without the object. A number as ``padding`` holds for the object, too.
        """
        names = [touch] if isinstance(touch, str) else checks.listed_entries(
            "RobotChecker.attach: touch", touch, "names of links and bodies")
        self._attach((name, link, shape, X_LS, tuple(names)))

    def detach(self, name: str) -> None:
        """Take an attached object away: a part that was put down.

        Parameters
        ----------
        name : str
            Of an attached object.

        Raises
        ------
        InvalidArgument
            Where no attached object has this name.
        """
        self._detach(name)

    def allow(self, a: str, b: str) -> None:
        """Never test a pair from now on, as with ``allowed``.

        Parameters
        ----------
        a, b : str
            Names of links, attached objects or bodies of the World.

        Raises
        ------
        InvalidArgument
            For unknown names.
        """
        self._allow(a, b)

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
        if is_single and threads == 1 and progress is None:
            verdict = self._verdict(q)
            if verdict != IS_OPEN:
                return verdict == COLLIDES
        self._count(len(q))
        out = np.zeros(len(q), dtype=bool)
        now = self._as_of_now()
        now.in_pieces(len(q), threads, progress, lambda space, piece: check_piece(now, space, q[piece], out[piece]))
        return bool(out[0]) if is_single else out

    def distances(
        self, Q, *, max_distance: float = math.inf, per: str = "robot", between: str = "all", threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> RobotDistances:
        """Signed distances of tested pairs within a limit: the nearest of each configuration, of each link, or all.

        Parameters
        ----------
        Q, threads, progress
            As of `collides`.
        max_distance : float
            [m], ≥ 0: what is farther apart does not count.
        per : "robot", "link" or "pair"
            Rows of the result: the nearest pair of a configuration, or the deepest where some overlap; the nearest pair
            of each body of the robot, in the order of ``bodies``; all pairs within ``max_distance``, and every tested
            pair without a limit.
        between : "all", "world" or "self"
            Pairs with bodies around, among bodies of the robot, or both. The nearest pair of a robot is often two of
            its links at a distance that hardly changes, with a gradient of 0: optimisers ask for "world", or per pair.

        Returns
        -------
        RobotDistances
            Of M rows, sorted by configuration: signed distance with its proven bracket, the two bodies by name, witness
            points, normal, and the gradient with respect to q. Of a body of several convex parts the nearest or deepest
            part counts.

        Raises
        ------
        InvalidArgument
            As of `collides`, and for other words than these. UnsupportedQuery as of `collide.distance`.

        Notes
        -----
        Pairs whose boxes are farther apart than ``max_distance`` cost a comparison, others about a microsecond, of
        convex parts. O(N P) for all P pairs without a limit.
        """
        question = distance_question("RobotChecker.distances", max_distance, per, between)
        q, _ = self._configurations(Q)
        return measure(self._as_of_now(), q, question, threads, progress)

    def point_jacobians(self, Q, bodies, points_W) -> np.ndarray:
        """How points that move with bodies of the robot change with the columns of q.

        Parameters
        ----------
        Q : (M, dof) or (dof,) array_like, float64
            A configuration for each point, or a single one for all.
        bodies : (M,) array_like of int
            Numbers of bodies, as rows of `distances` and ``bodies`` have them: links, and what is attached to these.
        points_W : (M, 3) array_like, float64
            The points in W [m], at these configurations.

        Returns
        -------
        (M, 3, dof) float64
            Derivatives of the points, fixed to the bodies, in W [m/rad or m/m]: with n and both points of a row of
            `distances`, ``gradient`` is n · (J_b − J_a). Witness points themselves also slide over the bodies.

        Raises
        ------
        InvalidArgument
            As of `collides`, for numbers of no body of the robot, and for other numbers of points.

        Notes
        -----
        O(M joints).
        """
        who = "RobotChecker.point_jacobians"
        points, _ = checks.vectors(who, "points_W", points_W)
        q, _ = self._configurations(Q)
        numbers = checks.whole_numbers(f"{who}: bodies", bodies).reshape(-1)
        count = checks.matched_count(who, Q=len(q), bodies=len(numbers), points_W=len(points))
        outside = (numbers < 0) | (numbers >= len(self.bodies))
        checks.refuse_rows(who, "bodies", numbers, outside, f"is no body of the robot, which has {len(self.bodies)}")
        q, numbers = (np.ascontiguousarray(np.broadcast_to(a, (count, *a.shape[1:]))) for a in (q, numbers))
        return jacobians(self._as_of_now(), q, numbers, np.ascontiguousarray(np.broadcast_to(points, (count, 3))))

    def edge_collides(self, Q0, Q1, *, resolution: float = 0.01, wrap: bool = False, threads: int = 1) -> np.ndarray:
        """Whether straight motions collide at samples; motions between two samples are not checked.

        Parameters
        ----------
        Q0, Q1 : (N, dof) or (dof,) array_like
            Where the motions begin and end [rad or m]; a single configuration goes with all of the other.
        resolution : float
            No column changes by more from one sample to the next [rad or m].
        wrap : bool
            Angles without limits go the shortest way: continuous joints, yaws of planar and angles of floating ones
            take whole turns off ``Q1``. Of an even choice, half a turn, the way of the given sign is kept.
        threads : int
            As of `collides`.

        Returns
        -------
        (N,) bool
            Both ends are samples. Halves come before quarters: most collisions are found after a few samples.
        """
        q0, q1 = self._edges(Q0, Q1, wrap)
        step = _positive("RobotChecker.edge_collides: resolution", resolution)
        self._count(_CONFIGURATIONS_OF_A_MOTION * len(q0))
        return ~np.isnan(sampled_collision(self._as_of_now(), q0, q1, step, threads))

    def certify_edges(
        self, Q0, Q1, *, resolution: float = 1e-3, wrap: bool = False, threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> CertifiedEdges:
        """Proves straight motions free, all of the way, or names a time of a collision.

        Parameters
        ----------
        Q0, Q1 : (N, dof) or (dof,) array_like
            As of `edge_collides`.
        resolution : float
            Intervals in which no column changes by more [rad or m] are not halved any more: they stay open. Motions
            past an obstacle at a distance d need about d / (length of the arm).
        wrap : bool
            As of `edge_collides`.
        threads, progress
            As of `collides`.

        Returns
        -------
        CertifiedEdges
            ``free`` (proven), ``time`` of a collision, ``open`` intervals: each motion is exactly free, colliding or
            open.

        Notes
        -----
        Distances in the middle of an interval are compared with bounds of the motion within half the interval
        (`motion_bounds.py`). Mimicking, prismatic, planar and floating joints move straight in
        their columns as well.

        O(N I P) for N motions: in the middles of I intervals each, the distances of the P pairs of parts not yet proven
        apart in an interval around. I grows as the path length of a point over the least gap, and is at most four times
        the largest change of a column over ``resolution``, where pairs stay open. Meshes that are not convex cost a
        `collide.distance` in each. A fixed number of samples is checked for collisions first.
        """
        q0, q1 = self._edges(Q0, Q1, wrap)
        step = _positive("RobotChecker.certify_edges: resolution", resolution)
        self._count(_CONFIGURATIONS_OF_A_MOTION * len(q0))
        return certify(self._as_of_now(), q0, q1, step, threads, progress)

    def certify_path(
        self, Q, times=None, *, wrap: bool = False, moving: Mapping[str, Spline] | None = None,
        resolution: float = 1e-3, threads: int = 1, progress: Callable[[int, int], None] | None = None,
    ) -> CertifiedMotion:
        """Proves a path of straight segments free, all of the way, or names its first known collision.

        Parameters
        ----------
        Q : (M, dof) array_like
            Waypoints [rad or m], two or more.
        times : (M,) array_like, optional
            When the robot passes the waypoints, increasing: the unit of all times of the result. By default 0, 1, 2, ….
        wrap : bool
            As of `edge_collides`, from waypoint to waypoint.
        moving, resolution, threads, progress
            As of `certify_spline`.

        Returns
        -------
        CertifiedMotion
            A verdict for each segment, and of the whole: ``is_free``, ``share`` proven, ``first`` collision, ``open``.

        Raises
        ------
        InvalidArgument
            As of `certify_spline`.
        """
        q, _ = self._configurations(Q)
        if len(q) < 2:
            raise InvalidArgument(f"RobotChecker.certify_path: Q must be two waypoints or more, got {brief(Q)}")
        refuse_degrees(self.robot, "RobotChecker.certify_path: Q", q)
        if checks.true_or_false("RobotChecker.certify_path: wrap", wrap):
            q = q.copy()
            for k in range(1, len(q)):
                q[k] = shortest_ways(self.robot, q[k - 1 : k], q[k : k + 1])[0]
        spline = Spline.straight(q, times)
        lengths = np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) if times is None else np.diff(spline.breaks)
        return self._certify("RobotChecker.certify_path", spline, lengths, moving, resolution, threads, progress)

    def certify_spline(
        self, motion, *, moving: Mapping[str, Spline] | None = None, resolution: float = 1e-3, threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> CertifiedMotion:
        """Proves a motion of piecewise polynomials free, at all times, or names its first known collision.

        Parameters
        ----------
        motion : Spline
            Of the robot's columns: B-splines, Bézier curves, polynomials, quintic segments (`collide.Spline`); or a
            BSpline or PPoly of scipy.
        moving : mapping of str to Spline, optional
            Bodies of the World that move meanwhile, by name: the position of the body's origin in W, three columns
            [m], the body turned as it stands; or six, with roll, pitch and yaw [rad] about W's axes. Margins and pairs
            never tested stay those of the World; links of a fixed base are tested against what moves. The motion is to
            last at least as long as the robot's.
        resolution : float
            Intervals in which no column differs by more [rad or m] are not halved any more: they stay open.
        threads, progress
            As of `collides`.

        Returns
        -------
        CertifiedMotion
            A verdict for each piece of the motion, and of the whole.

        Raises
        ------
        InvalidArgument
            For a motion of other columns, for angles that look like degrees, for unknown moving bodies.

        Notes
        -----
        As of `certify_edges`, with the hull of a piece's control points as the bound of each column in an interval
        (`motion_bounds.py`); roundings of the pieces are part of the bound (`splines.py`). After a hit the search goes
        on before the hit, so that what lies before the told time is proven free or open. Moving bodies are bodies of a
        robot behind floating joints: their motion is bounded, not sampled. A call with ``moving`` makes the tables of
        robot and World anew, some milliseconds.
        """
        name = "RobotChecker.certify_spline"
        spline = Spline.of(motion)
        if spline.columns != self.robot.dof:
            raise InvalidArgument(
                f"{name}: the motion must have {self.robot.dof} columns, one for each of "
                f"{listing(self.robot.joint_names) or 'no joints'}; got {spline.columns}"
            )
        refuse_degrees(self.robot, f"{name}: motion", spline.control_points.reshape(-1, spline.columns))
        return self._certify(name, spline, np.diff(spline.breaks), moving, resolution, threads, progress)

    def certify_boxes(
        self, lo, hi, *, resolution: float = 1e-2, max_cells: int = 10_000, threads: int = 1,
        progress: Callable[[int, int], None] | None = None,
    ) -> CertifiedBoxes:
        """Proves boxes of configurations free, all of their inside, or names a colliding configuration.

        Parameters
        ----------
        lo, hi : (N, dof) or (dof,) array_like
            Lowest and highest corners [rad or m], lo ≤ hi in each column.
        resolution : float
            Columns no wider are not halved any more [rad or m]: a cell without a wider column for its pair stays open.
        max_cells : int
            So many cells of a box are asked, at most; the others stay open.
        threads, progress
            As of `collides`.

        Returns
        -------
        CertifiedBoxes
            ``free`` (proven), a colliding ``configuration``, open cells: each box is exactly free, colliding or open.

        Raises
        ------
        InvalidArgument
            For corners of another shape, not finite, or with lo above hi, naming row and joint.

        Notes
        -----
        As of `certify_edges`, with half a cell's width as the bound of each column. A cell with pairs not proven apart
        is halved in the column that moves the first pair by most: joints that do not move a pair stay whole. The number
        of cells grows as (width / gap) to the power of the number of joints that move the pair.
        """
        name = "RobotChecker.certify_boxes"
        low, high = self._configurations(lo, "lo")[0], self._configurations(hi, "hi")[0]
        n = checks.matched_count(f"{name}: corners", lo=len(low), hi=len(high))
        low, high = (np.ascontiguousarray(np.broadcast_to(q, (n, q.shape[1]))) for q in (low, high))
        wrong = np.argwhere(~((low <= high) & (np.abs(low) <= LARGEST) & (np.abs(high) <= LARGEST)))
        if len(wrong):
            row, column = wrong[0]
            raise InvalidArgument(
                f"{name}: box {row}, joint {self.robot.joint_names[column]}, goes from {low[row, column]:g} to "
                f"{high[row, column]:g}: lo must be at most hi, and both within ±{LARGEST:g}"
            )
        cells = min(checks.integer(f"{name}: max_cells", max_cells, 1), 1 << 40)
        step = _positive(f"{name}: resolution", resolution)
        return certify_boxes(self._as_of_now(), low, high, step, cells, threads, progress)

    def _certify(self, name, spline, lengths, moving, resolution, threads, progress) -> CertifiedMotion:
        checker: CheckerScene
        step = _positive(f"{name}: resolution", resolution)
        breaks, checker = spline.breaks, self._as_of_now()
        if moving is not None:
            checker, spline = among_moving(self, name, spline, moving)
        return certify_pieces(checker, spline, breaks, lengths, step, threads, progress)

    def explain(self, q) -> ConfigurationReport:
        """Colliding pairs of a configuration with their depths, or the nearest pairs, to be printed.

        Parameters
        ----------
        q : (dof,) array_like
            A configuration [rad or m].

        Returns
        -------
        ConfigurationReport
            ``collisions``, ``nearest``, ``notes`` about limits; ``str()`` prints all.

        Raises
        ------
        InvalidArgument
            For anything but a single configuration.
        """
        q, is_single = self._configurations(q, "q")
        if not is_single:
            wanted = f"one configuration ({self.robot.dof},)"
            raise InvalidArgument(f"RobotChecker.explain: q must be {wanted}, got {q.shape}")
        return ConfigurationReport.of(self._as_of_now(), q[0])

    def save(self, path) -> None:
        """Write a file from which programs in C answer the same questions, bit by bit: `collide_robot_load`.

        Parameters
        ----------
        path : str or PathLike
            The file, written whole or not at all.

        Raises
        ------
        UnsupportedQuery
            With clouds, grids and large terrain around.
        OSError
            Where the file cannot be written.

        Notes
        -----
        Of robot, attached objects, untested pairs and World as they stand; docs/c-interface.md says what C answers.
        Spheres and maps of the links are made first, unless made already: a few tenths of a second. Some hundred
        kilobytes.
        """
        path = checks.file_path("RobotChecker.save: path", path)
        self.make_spheres()
        made = checker_bytes(self._as_of_now())
        with whole_file(path) as stream:
            stream.write(made)

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

    def self_filter(self, points, Q, *, padding=0.0, X_WC=None, threads: int = 1):
        """Which points of a cloud are the robot itself, as a sensor sees it.

        Parameters
        ----------
        points : (n, 3) array_like, or PointCloud
            In the world, or in a sensor's frame C with ``X_WC`` [m].
        Q : (dof,) or (N, dof) array_like
            The configuration, or N configurations during the scan [rad or m].
        padding : float or mapping of str to float
            Points so near to the geometry of a link or an attached object belong, too [m], by name with a mapping,
            0 for names left out. The checker's own padding does not count.
        X_WC : (4, 4), optional
            Pose of the points' frame in W [m], by default the identity.
        threads : int
            As of `collides`.

        Returns
        -------
        (n,) bool, or (N, n) bool for N configurations
            True for points of the robot: on its geometry swollen by the padding, or inside, surface included.
        PointCloud
            Of a cloud: without balls nearer than the padding at any configuration; ``dropped`` counts these.

        Raises
        ------
        InvalidArgument, InvalidPose
            Naming the argument. InvalidShape where no ball of a cloud is left.

        Notes
        -----
        Decided as by `collide.collide`, exactly for polytopes and swept hulls. With ``X_WC``, whose product with a
        point is rounded, points within rounding of the surface belong: the others are proven outside. O(n) for a box
        around the robot, then 1 µs for each point in the box of a convex link, 3 µs of a mesh.
        """
        cloud = points if isinstance(points, PointCloud) else None
        name, threads = "RobotChecker.self_filter: points", check_threads(threads)
        p_C = checks.array(name, points, "(n, 3)", InvalidArgument) if cloud is None else cloud.points
        if p_C.ndim != 2 or p_C.shape[1] != 3 or not np.abs(p_C).max(initial=0.0) <= LARGEST:
            raise InvalidArgument(f"{name} must be (n, 3), finite and within ±{LARGEST:g} m, got {brief(points)}")
        setting = self.setting
        by_name = padding_of(padding, {*(body.name for body in setting.bodies), *self.robot.links})
        q, is_single = self._configurations(Q)
        p_W, slop = points_in_world(p_C, None if X_WC is None else as_pose(X_WC, "RobotChecker.self_filter: X_WC"))
        radii = 0.0 if cloud is None else cloud.radius
        X_WLs = self.link_poses(q)
        boxes = setting.body_boxes
        masks = [points_of_robot(setting.bodies, boxes, X, p_W, radii, by_name, slop, threads) for X in X_WLs]
        mask = np.array(masks, dtype=bool).reshape(len(q), len(p_W))
        if cloud is not None:
            return cloud._only(~np.logical_or.reduce(mask, axis=0), "self_filter")
        return mask[0] if is_single else mask

    def _configurations(self, Q, name: str = "Q") -> tuple[np.ndarray, bool]:
        """((N, dof) C-contiguous, whether a single one was given). Raises InvalidArgument."""
        q = self.robot.checked_configurations(Q, name)
        return q if q.flags.c_contiguous else np.ascontiguousarray(q), np.ndim(Q) == 1

    def _edges(self, Q0, Q1, wrap: bool = False) -> tuple[np.ndarray, np.ndarray]:
        q0, q1 = self._configurations(Q0, "Q0")[0], self._configurations(Q1, "Q1")[0]
        if len(q0) != len(q1):
            n = checks.matched_count("RobotChecker: edges", Q0=len(q0), Q1=len(q1))
            q0, q1 = (np.ascontiguousarray(np.broadcast_to(q, (n, q.shape[1]))) for q in (q0, q1))
        is_wrapped = checks.true_or_false("RobotChecker: wrap", wrap)
        return q0, shortest_ways(self.robot, q0, q1) if is_wrapped else q1


def _positive(what: str, value) -> float:
    number = checks.number(value)
    if number is None or not 0.0 < number < math.inf:
        raise InvalidArgument(f"{what} must be a positive number [rad or m], got {brief(value)}")
    return number
