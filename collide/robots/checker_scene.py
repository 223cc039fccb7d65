"""What a checker asks about: a robot, what it carries, and the bodies of a World, prepared for the kernels.

`RobotChecker` asks the questions; what answers them reads this.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads, pieces_of, share
from collide.errors import InvalidArgument, brief, listing
from collide.kernels import address_of
from collide.robots.bounding_spheres import SphereTables, sphere_tables
from collide.robots.check_configurations import check_configurations
from collide.robots.check_tables import (
    MovedBodies,
    RobotBody,
    RobotTables,
    Setting,
    SpareRows,
    Surroundings,
    robot_tables,
    surroundings_of,
    tables_among,
)
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.object_rows import ObjectRows, rows_of_object
from collide.robots.pair_maps import PairMaps, names_of_pairs, pair_maps
from collide.robots.robot import Robot
from collide.robots.robot_bodies import (
    ALLOWED,
    Attached,
    PairRules,
    SeenWorld,
    bodies_around,
    checked_object,
    refuse_own_margins,
    robot_bodies,
)
from collide.transforms import as_pose
from collide.worlds.world import World

if TYPE_CHECKING:
    from typing_extensions import Self

#: Once so many configurations have been asked, spheres are made of bodies that are not, and maps: in a few tenths of a
#: second, kept with the robot.
_PAY_FOR_SPHERES = 50_000
#: Held for moments, while attributes of a checker are read or written together.
_PUBLISHING = threading.Lock()
#: A thread is handed at least so many configurations.
_LEAST_PIECE = 512


class CheckerScene:
    """A robot among the bodies of a World; arguments as of `RobotChecker`.

    setting : robot and World as of the last `prepare`. A question is asked of `_as_of_now`.
    obstacles : names of links that are obstacles moving along: `padding` swells both bodies of their pairs.
    """

    #: Whether changes of the World do not reach this any more.
    _is_fixed = False

    def __init__(
        self, robot: Robot, world: World | None, X_WR, attached: Iterable, padding, allowed: Iterable[tuple[str, str]],
        mobile: bool, obstacles: frozenset[str] = frozenset(),
    ):
        if not isinstance(robot, Robot):
            raise InvalidArgument(f"RobotChecker: robot must be a collide.Robot, got {checks.brief(robot)}")
        if world is not None and not isinstance(world, World):
            raise InvalidArgument(f"RobotChecker: world must be a collide.World, got {checks.brief(world)}")
        self.robot, self.world = robot, World() if world is None else world
        self._X_WR = np.eye(4) if X_WR is None else as_pose(X_WR, "RobotChecker: X_WR").copy()
        attached = checks.listed_entries("RobotChecker: attached", attached, "tuples (name, link, shape, X_LB)")
        bodies, self._objects = robot_bodies(robot, attached, padding)
        self._bodies = [body._replace(is_obstacle=body.name in obstacles) for body in bodies]
        is_by_name = isinstance(padding, Mapping)
        #: By name, or of all.
        self._padding = {name: float(by) for name, by in padding.items()} if is_by_name else float(padding)
        self._asked = checks.listed_entries("RobotChecker: allowed", allowed, "pairs of names")
        self._mobile = checks.true_or_false("RobotChecker: mobile", mobile)
        self._maps: PairMaps | None = None
        self._around: Surroundings | None = None
        self._names_asked: set[str] = set()  # checked: their bodies may leave the World
        self._make_tables()
        self._names_asked = {name for pair in self._asked for name in pair[:2]}

    @property
    def _links(self) -> list[RobotBody]:
        """The bodies before attached objects."""
        return self._bodies[: len(self._bodies) - len(self._objects)]

    def _make_tables(self) -> None:
        """Those of the robot, and the first setting."""
        matrices = [self.robot.joint_table.doubles[:, :9].reshape(-1, 3, 3), self._X_WR[None, :3, :3]]
        self._tables = self._tables_of_links(np.concatenate(matrices))
        known, of_any = self.robot.link_maps, False
        if known is not None and known[0] == self._key_of_maps():  # another checker has made spheres of these links
            self._maps, of_any = known[1], True
        self._spheres = sphere_tables(self._tables, self._links, of_any=of_any)
        self._n_asked = _PAY_FOR_SPHERES if of_any else 0
        self._setting: Setting | None = None
        self.prepare()

    def _tables_of_links(self, matrices: np.ndarray) -> RobotTables:
        """Tables without padding are kept with the robot, for other checkers as well."""
        if any(self._padding.values() if isinstance(self._padding, dict) else [self._padding]):
            return robot_tables(self._links, matrices, is_padded=True)
        key = matrices.tobytes(), *self._key_of_links()
        if self.robot.link_tables is None or self.robot.link_tables[0] != key:
            self.robot.link_tables = key, robot_tables(self._links, matrices)
        return self.robot.link_tables[1]

    def _key_of_links(self) -> tuple:
        """What tables of links depend on; the shapes are kept with the robot."""
        return tuple(id(body.shape) for body in self._links)

    def _key_of_maps(self) -> tuple:
        """What maps of links depend on: their bounds of roundings, on where the robot stands as well."""
        return self._X_WR.tobytes(), *self._key_of_links()

    def _attach(self, values: tuple) -> None:
        """Attach an object (name, link, shape, X_LS, touch). Raises InvalidArgument, InvalidPose."""
        def change(read: Self) -> dict:
            item = checked_object(self.robot, read._objects, values)
            rows, setting = read._rows_of(item), read.prepare()
            setting = read._carrying(setting, len(setting.objects), [rows])
            return {"_objects": {**read._objects, item.name: item}, "_bodies": setting.bodies, "_setting": setting}

        self._change(change)

    def _detach(self, name: str) -> None:
        """Take an attached object away, and what was allowed for it. Raises InvalidArgument."""
        checks.text("RobotChecker.detach: name", name)

        def change(read: Self) -> dict:
            if name not in read._objects:
                known = listing(read._objects) or "none"
                raise InvalidArgument(
                    f"RobotChecker.detach: name: no attached object is called {brief(name)}; attached: {known}"
                )
            objects, setting, asked = read._objects.copy(), read.prepare(), read._asked
            number = list(objects).index(name)
            del objects[name]
            rules = setting.rules.forgetting(name)
            if rules is not setting.rules:
                asked = [pair for pair in asked if name not in pair[:2]]
                setting = setting._replace(rules=rules)
            setting = read._carrying(setting, number, setting.objects[number + 1 :])
            return {"_objects": objects, "_bodies": setting.bodies, "_asked": asked, "_setting": setting}

        self._change(change)

    def _rows_of(self, item: Attached) -> ObjectRows:
        """The rows of an object, with spheres where links have spheres."""
        padding = self._padding.get(item.name, 0.0) if isinstance(self._padding, dict) else self._padding
        rows = rows_of_object(self.robot, item, padding, is_padded=self._tables.is_padded)
        return rows if self._spheres is None else rows.with_spheres()

    def _carrying(self, setting: Setting, n_kept: int, added: Sequence[ObjectRows]) -> Setting:
        """A setting with its first attached objects, and others behind: tables of links and World are the same."""
        objects, filters = setting.objects[:n_kept], setting.filters.of_first(n_kept)
        bodies, maps = setting.bodies[: len(filters.allowed)], setting.maps
        if maps is not None:
            maps = maps.of_first(len(filters.self_pairs))
        for rows in added:
            before = [attached.item for attached in objects]
            filters = setting.rules.with_object(filters, before, rows.item, rows.body.link)
            objects, bodies = (*objects, rows), [*bodies, rows.body]
        tables, spare = setting.tables, setting.spare
        if not tables.spare_rows.holds(objects):
            tables, spare = tables_among(self._tables, setting.surroundings, SpareRows.of(objects)), []
        return setting._replace(
            bodies=bodies, objects=objects, filters=filters, tables=tables, table=tables.table_with(objects), maps=maps,
            spheres=self._spheres_with(setting.surroundings, objects), spare=spare,
        )

    def _change(self, change: Callable[[Self], dict]) -> None:
        """Publish what a change makes of attributes as read, anew where another thread has published in between.
        Questions begun before go on with what they have read.
        """
        while True:
            read = self._as_it_is()
            if self._publish(read, **change(read), _around=read._around):
                return

    def _as_it_is(self) -> Self:
        """A checker with the attributes of an instant: questions read them while threads attach and allow."""
        read = object.__new__(type(self))
        with _PUBLISHING:
            vars(read).update(vars(self))
        return read

    def _publish(self, read: CheckerScene, **made) -> bool:
        """Keep what was made of attributes as they were read, unless bodies or pairs have changed since."""
        with _PUBLISHING:
            is_current = self._bodies is read._bodies
            if is_current:
                vars(self).update(made)
        return is_current

    def _allow(self, a: str, b: str) -> None:
        """Test a pair no more. Raises InvalidArgument."""
        for argument, name in (("a", a), ("b", b)):
            checks.text(f"RobotChecker.allow: {argument}", name)

        def change(read: Self) -> dict:
            setting = read.prepare()
            rules, filters, maps = setting.rules.allowing(a, b), setting.filters, setting.maps
            first = len(filters.allowed) - len(setting.objects)
            objects = {name: k for k, name in enumerate(read._objects, first)}
            for argument, name in (("a", a), ("b", b)):
                if not (name in objects or name in rules.numbers or name in self.robot.links):
                    unknown = f"no link, attached object or body is called {brief(name)}"
                    raise InvalidArgument(f"RobotChecker.allow: {argument}: {unknown}")
            # A body around may have the name of an object, and the pair is of both.
            for i in (objects.get(a), rules.numbers.get(a)):
                for j in (objects.get(b), rules.numbers.get(b)):
                    if i is None or j is None or i == j or (i < 0 and j < 0):
                        continue
                    filters, row = filters.without_pair(i, j, ALLOWED)
                    if row is not None and maps is not None:
                        maps = maps.without(row)
            again = [*setting.bodies]  # what is published is known by its bodies
            return {
                "_bodies": again, "_asked": [*read._asked, (a, b)], "_names_asked": read._names_asked | {a, b},
                "_setting": setting._replace(bodies=again, rules=rules, filters=filters, maps=maps),
            }

        self._change(change)

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along. What holds addresses is made again."""
        made = ("_setting", "_tables", "_spheres", "_n_asked", "_is_fixed")
        return {name: value for name, value in vars(self).items() if name not in made} | {"_around": None}

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
        return self.setting.filters.n_pairs

    @property
    def skipped(self) -> dict[str, int]:
        """Pairs of bodies that are never tested, by reason."""
        return self.setting.filters.reasons

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
        read = self._as_it_is()
        setting = read._made_setting(SeenWorld(read.world))
        self._publish(read, _setting=setting, _around=read._around)
        return setting

    def _made_setting(self, seen: SeenWorld) -> Setting:
        """The setting of a World as seen; what has not changed since the last setting is taken over."""
        before = self._setting
        if before is not None and seen.differs_in_poses_from(before.seen):
            moved = self._among_moved_bodies(before, seen)
            if moved is not None:
                return moved
        refuse_own_margins(seen, self.robot)
        around = bodies_around(seen, self.robot)
        if before is None:
            objects = tuple(self._rows_of(item) for item in self._objects.values())
        else:
            objects = before.objects
        if before is not None and seen.has_pairs_of(before.seen):
            rules, filters, maps = before.rules, before.filters, before.maps
        else:
            known = {*self._objects, *self._names_asked}
            rules = PairRules(self.robot, self._links, known, seen, around, self._asked, self._mobile)
            filters, items = rules.of_links(), list(self._objects.values())
            maps = None if self._maps is None else self._maps.among(names_of_pairs(self._bodies, filters.self_pairs))
            for k, rows in enumerate(objects):
                filters = rules.with_object(filters, items[:k], rows.item, rows.body.link)
        surroundings = self._around = surroundings_of(around, self._around)
        spare_rows = SpareRows.of(objects) if before is None else before.tables.spare_rows
        tables = tables_among(self._tables, surroundings, spare_rows, before)
        base = np.concatenate([self._X_WR[:3, :3].ravel(), self._X_WR[:3, 3]])
        return Setting(
            self._bodies, base, surroundings, tables, objects, tables.table_with(objects), rules, filters,
            self._spheres_with(surroundings, objects), maps, seen, seen, [],
        )

    def _count(self, n: int) -> None:
        """Take note of n configurations to be asked. Where so many have been asked that spheres pay, they are made."""
        if self._n_asked >= _PAY_FOR_SPHERES:
            return
        self._n_asked += n
        if self._n_asked >= _PAY_FOR_SPHERES:
            read = self._as_of_now()
            read._spheres = sphere_tables(read._tables, read._links, of_any=True)
            setting = read.setting
            if read._spheres is not None:
                objects = tuple(rows.with_spheres() for rows in setting.objects)
                setting = setting._replace(objects=objects)
                setting = read._carrying(setting._replace(maps=None, spare=[]), len(objects), ())
            if setting.spheres is not None:
                maps = pair_maps(self.robot, setting, CheckWorkspace(self.robot, setting))
                setting = setting._replace(maps=maps)
                # Another object may be attached by the same name: maps of links alone are kept.
                read._maps = maps.among([pair for pair in maps.names if read._objects.keys().isdisjoint(pair)])
                self.robot.link_maps = read._key_of_maps(), read._maps
            made = {"_bodies": setting.bodies, "_spheres": read._spheres, "_maps": read._maps}
            if not self._publish(read, _setting=setting, **made):
                self._n_asked = 0

    def make_spheres(self) -> None:
        """Make spheres of bodies, and maps, where the robot may have some, now rather than after many questions."""
        self._count(_PAY_FOR_SPHERES)

    def _spheres_with(self, around: Surroundings, objects: Sequence[ObjectRows]) -> SphereTables | None:
        """Spheres of the links, unless an attached object has none."""
        return self._spheres_among(around) if all(rows.spheres is not None for rows in objects) else None

    def _spheres_among(self, around: Surroundings) -> SphereTables | None:
        """Spheres of the links, but not among fields, whose boxes the robot is in."""
        return None if around.has_fields else self._spheres

    def _among_moved_bodies(self, before: Setting, seen: SeenWorld) -> Setting | None:
        """The setting before, among moved bodies; ``None`` where tables are to be made anew: margins swell parts by how
        their bodies are turned, and matrices not quite rotations change the slack of boxes.
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
        check_configurations(space.address, address_of(q), self.robot.dof, 0, 1, space.verdict_at)
        verdict = space.verdict[0]
        setting.spare.append(space)
        return verdict

    def _workspace(self, setting: Setting) -> CheckWorkspace:
        """A workspace not in use that stands at a setting, to be put back into ``setting.spare``."""
        try:
            space = setting.spare.pop()
        except IndexError:  # all are in use: another thread may have taken the last
            return CheckWorkspace(self.robot, setting)
        return space if space.stands_at(setting) or space.stand(setting) else CheckWorkspace(self.robot, setting)

    def _as_of_now(self) -> Self:
        """The checker among the bodies as they stand now; changes of the World during a question do not reach it."""
        if self._is_fixed:
            return self
        while True:
            setting, fixed = self.prepare(), self._as_it_is()
            if setting.bodies is fixed._bodies:  # nothing was attached in between
                fixed._setting, fixed._is_fixed = setting, True
                return fixed

    def in_pieces(self, n: int, threads: int, progress, work: Callable[[CheckWorkspace, slice], None]) -> None:
        """Have ``work`` done on pieces of n units by so many threads, each with a workspace of its own."""
        threads = check_threads(threads)
        setting, done = self.prepare(), 0

        def on_piece(piece: slice) -> None:
            nonlocal done
            space = self._workspace(setting)
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
