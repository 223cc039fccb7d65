"""What a checker asks about: a robot, what it carries, and the bodies of a World, prepared for the kernels.

`RobotChecker` asks the questions; what answers them reads this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads, pieces_of, share
from collide.errors import InvalidArgument
from collide.kernels import address_of
from collide.robots.bounding_spheres import SphereTables, sphere_tables
from collide.robots.check_configurations import check_configurations
from collide.robots.check_tables import MovedBodies, Setting, Surroundings, robot_tables, surroundings_of, tables_among
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.pair_maps import pair_maps
from collide.robots.robot import Robot
from collide.robots.robot_bodies import SeenWorld, bodies_around, filters_of, refuse_own_margins, robot_bodies
from collide.transforms import as_pose
from collide.worlds.world import World

if TYPE_CHECKING:
    from typing_extensions import Self

#: Once so many configurations have been asked, spheres are made of bodies that are not: in a tenth of a second.
_PAY_FOR_SPHERES = 20_000
#: A thread is handed at least so many configurations.
_LEAST_PIECE = 512


class CheckerScene:
    """A robot among the bodies of a World; arguments as of `RobotChecker`.

    setting : robot and World as of the last `prepare`. A question is asked of `_as_of_now`.
    """

    #: Whether changes of the World do not reach this any more.
    _is_fixed = False

    def __init__(
        self, robot: Robot, world: World | None, X_WR, attached: Iterable, padding, allowed: Iterable[tuple[str, str]],
        mobile: bool,
    ):
        if not isinstance(robot, Robot):
            raise InvalidArgument(f"RobotChecker: robot must be a collide.Robot, got {checks.brief(robot)}")
        if world is not None and not isinstance(world, World):
            raise InvalidArgument(f"RobotChecker: world must be a collide.World, got {checks.brief(world)}")
        self.robot, self.world = robot, World() if world is None else world
        self._X_WR = np.eye(4) if X_WR is None else as_pose(X_WR, "RobotChecker: X_WR").copy()
        attached = checks.listed_entries("RobotChecker: attached", attached, "tuples (name, link, shape, X_LB)")
        self._bodies, self._objects = robot_bodies(robot, attached, padding)
        self._asked = checks.listed_entries("RobotChecker: allowed", allowed, "pairs of names")
        self._mobile = checks.true_or_false("RobotChecker: mobile", mobile)
        self._make_tables()

    def _make_tables(self) -> None:
        """Those of the robot, and the first setting."""
        matrices = [self.robot.joint_table.doubles[:, :9].reshape(-1, 3, 3), self._X_WR[None, :3, :3]]
        self._tables = robot_tables(self._bodies, np.concatenate(matrices))
        self._spheres = sphere_tables(self._tables, self._bodies, of_any=False)
        self._n_asked = _PAY_FOR_SPHERES if self._spheres is not None else 0
        self._setting: Setting | None = None
        self.prepare()

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along. What holds addresses is made again."""
        made = ("_setting", "_tables", "_spheres", "_n_asked", "_is_fixed")
        return {name: value for name, value in vars(self).items() if name not in made}

    def __setstate__(self, state: dict) -> None:
        vars(self).update(state)
        self._make_tables()

    @property
    def setting(self) -> Setting:
        """Robot and World as of the last `prepare`."""
        assert self._setting is not None
        return self._setting

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
        """Names of two bodies by their numbers in results.

        Parameters
        ----------
        a : int
            Number of a body.
        b : int
            Number of a body, or −1 − the number of a body around.

        Returns
        -------
        (str, str)
        """
        bodies, around = self.bodies, self.around
        a = checks.checked_index("RobotChecker.names_of: a", a, len(bodies))
        if checks.is_integer(b) and b < 0:
            return bodies[a], around[len(around) - 1 - checks.checked_index("RobotChecker.names_of: b", b, len(around))]
        return bodies[a], bodies[checks.checked_index("RobotChecker.names_of: b", b, len(bodies))]

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

    def prepare(self) -> Setting:
        """Make the setting of the World as of now; an unchanged World keeps the last setting.

        Returns
        -------
        Setting
            Where bodies have moved, all tables are taken over, and workspaces bring poses up to date; where shapes are
            replaced, the tables of the robot. Threads asking at once may make a setting each.
        """
        before, world = self._setting, self.world
        if before is not None and (
            self._is_fixed or (before.seen.world is world and world._is_as_of(before.seen.version))
        ):
            return before
        seen = SeenWorld(world)
        if before is not None and seen.differs_in_poses_from(before.seen):
            moved = self._among_moved_bodies(before, seen)
            if moved is not None:
                self._setting = moved
                return moved
        refuse_own_margins(seen, self.robot)
        around = bodies_around(seen, self.robot)
        if before is not None and seen.has_pairs_of(before.seen):
            filters = before.self_pairs, before.allowed, before.skipped
        else:
            filters = filters_of(self.robot, self._bodies, self._objects, seen, around, self._asked, self._mobile)
        surroundings = surroundings_of(around, None if before is None else before.surroundings)
        base = np.concatenate([self._X_WR[:3, :3].ravel(), self._X_WR[:3, 3]])
        tables = tables_among(self._tables, surroundings, before)
        spheres = self._spheres_among(surroundings)
        maps = before.maps if before is not None and filters[0] is before.self_pairs else None
        setting = Setting(self._bodies, base, surroundings, tables, *filters, spheres, maps, seen, seen, [])
        self._setting = setting
        return setting

    def _count(self, n: int) -> None:
        """Take note of n configurations to be asked. Where so many have been asked that spheres pay, they are made."""
        if self._n_asked >= _PAY_FOR_SPHERES:
            return
        self._n_asked += n
        if self._n_asked >= _PAY_FOR_SPHERES:
            setting, self._spheres = self.prepare(), sphere_tables(self._tables, self._bodies, of_any=True)
            spheres = self._spheres_among(setting.surroundings)
            setting = self._setting = setting._replace(spheres=spheres, spare=[])
            if spheres is not None:
                maps = pair_maps(self.robot, setting, CheckWorkspace(self.robot, setting))
                self._setting = setting._replace(maps=maps, spare=[])

    def _spheres_among(self, around: Surroundings) -> SphereTables | None:
        """Spheres of the robot, but not among fields, whose boxes the robot is in."""
        return None if any(body.shape.is_field for body in around.bodies) else self._spheres

    def _among_moved_bodies(self, before: Setting, seen: SeenWorld) -> Setting | None:
        """The setting before among bodies that have at most moved; ``None`` where tables are to be made anew: margins
        swell parts by how their bodies are turned, matrices that are no rotations change the slack of boxes.
        """
        if before.surroundings.has_margins:
            return None
        bodies = MovedBodies(before.surroundings.bodies, seen.X_WBs)
        moved = before._replace(seen=seen, surroundings=before.surroundings._replace(bodies=bodies))
        space = self._workspace(before)
        stands = space.stand(moved)
        before.spare.append(space)
        return moved if stands else None

    def _verdict(self, q: np.ndarray) -> int:
        """IS_FREE, COLLIDES or IS_OPEN, of a configuration (1, dof)."""
        setting = self.prepare()
        space = self._workspace(setting)
        space.stand(setting)
        check_configurations(space.address, address_of(q), self.robot.dof, 0, 1, space.verdict_at)
        verdict = space.verdict[0]
        setting.spare.append(space)
        return verdict

    def _workspace(self, setting: Setting) -> CheckWorkspace:
        """A workspace not in use, to be put back into ``setting.spare``."""
        try:
            return setting.spare.pop()
        except IndexError:  # all are in use: another thread may have taken the last
            return CheckWorkspace(self.robot, setting)

    def _as_of_now(self) -> Self:
        """The checker among the bodies as they stand now; changes of the World during a question do not reach it."""
        if self._is_fixed:
            return self
        fixed = object.__new__(type(self))
        vars(fixed).update(vars(self), _setting=self.prepare(), _is_fixed=True)
        return fixed

    def in_pieces(self, n: int, threads: int, progress, work: Callable[[CheckWorkspace, slice], None]) -> None:
        """Have ``work`` done on pieces of n units by so many threads, each with a workspace of its own."""
        threads = check_threads(threads)
        setting, done = self.prepare(), 0

        def on_piece(piece: slice) -> None:
            nonlocal done
            space = self._workspace(setting)
            space.stand(setting)
            work(space, piece)
            setting.spare.append(space)
            done += piece.stop - piece.start
            if progress is not None:
                progress(done, n)

        if threads == 1 and progress is None:
            if n:
                on_piece(slice(0, n))
        else:
            share(pieces_of(n, max(threads, 8 if progress else 1), _LEAST_PIECE), on_piece, threads)
