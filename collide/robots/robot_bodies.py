"""A robot as seen by a checker: bodies moving with its links, and the tested pairs of bodies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.broadphase.filters import ASLEEP, MASKED, STATIC
from collide.errors import InvalidArgument, brief, cut, listing
from collide.robots.check_tables import BodyAround, RobotBody
from collide.robots.kinematic_tree import COLUMNS
from collide.robots.robot import Robot
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape
from collide.transforms import as_pose
from collide.worlds.bodies import Body, Roster
from collide.worlds.world import World

#: The mask of bodies that nothing is said of, as of `World.add`.
_ALL_GROUPS = 0xFFFF


class Attached(NamedTuple):
    """An object attached to a link, for example a grasped part.

    name : unique among links and attached objects.   link : name of the link.   shape : in its own frame S.
    X_LS : (4, 4) pose of S in the link [m].   touch : links, and bodies of the World, whose contact with the object is
        allowed.
    """

    name: str
    link: str
    shape: Shape
    X_LS: Any = None
    touch: tuple[str, ...] = ()


class Filters(NamedTuple):
    """Which pairs are tested.

    self_pairs : (k, 2) int64 of bodies.   allowed : (bodies, around) uint8, 1 where a pair is never tested.
    skipped : {reason: pairs}.
    """

    self_pairs: np.ndarray
    allowed: np.ndarray
    skipped: dict[str, int]


def robot_bodies(robot: Robot, attached: Iterable, padding) -> tuple[list[RobotBody], dict[str, Attached]]:
    """Bodies from the last link to the root, attached objects before all, and attached objects by name.

    Raises InvalidArgument, InvalidPose: unknown links, names used twice, paddings out of range.
    """
    objects: dict[str, Attached] = {}
    for values in attached:
        item = checked_object(robot, objects, values)
        objects[item.name] = item
    swelling = padding_of(padding, {*robot.links, *objects})
    bodies = [body_of_object(robot, item, swelling.get(item.name, 0.0)) for item in objects.values()]
    for number, link in reversed(list(enumerate(robot.links))):
        if link in robot.geometry:
            bodies.append(RobotBody(link, number, _link_shape(robot, link), swelling.get(link, 0.0)))
    if not bodies:
        raise InvalidArgument(
            f"RobotChecker: {robot.place} has no collision geometry, so nothing can be tested; look at its <collision> "
            "elements"
        )
    return bodies, objects


def _link_shape(robot: Robot, link: str) -> Compound:
    """The collision elements of a link as a shape, the same for all checkers: with the shape is kept what is made."""
    elements = tuple(robot.geometry[link])
    known = robot.link_shapes.get(link)
    if known is None or len(known[0]) != len(elements) or any(a is not b for a, b in zip(known[0], elements)):
        known = robot.link_shapes[link] = elements, Compound([(item.shape, item.X_LG) for item in elements])
    return known[1]


def body_of_object(robot: Robot, item: Attached, padding: float) -> RobotBody:
    """The body of an attached object."""
    return RobotBody(item.name, robot.links.index(item.link), Compound([(item.shape, item.X_LS)]), padding)


def checked_object(robot: Robot, objects: Mapping[str, Attached], values) -> Attached:
    """An object to be attached beside others. Raises InvalidArgument, InvalidPose."""
    try:
        item = Attached(*values)
    except TypeError:
        raise InvalidArgument(
            "attached must be objects (name, link, shape, X_LS, touch), the last two optional; got " + brief(values)
        ) from None
    if not isinstance(item.name, str) or not item.name:
        raise InvalidArgument(f"attached: a name must be a non-empty string, got {brief(item.name)}")
    if item.name in robot.links or item.name in objects:
        raise InvalidArgument(f'attached: the name "{cut(item.name)}" is used twice; give the object another name')
    if not isinstance(item.link, str) or item.link not in robot.links:
        raise InvalidArgument(
            f'attached "{cut(item.name)}": {robot.name} has no link {brief(item.link)}; it has {listing(robot.links)}'
        )
    if not isinstance(item.shape, Shape):
        raise InvalidArgument(f'attached "{cut(item.name)}": not a shape but {brief(item.shape)}')
    X_LS = np.eye(4) if item.X_LS is None else as_pose(item.X_LS, f'attached "{cut(item.name)}": X_LS').copy()
    touch = [item.touch] if isinstance(item.touch, str) else checks.listed_texts(
        f'attached "{cut(item.name)}": touch', item.touch, "names of links and bodies"
    )
    return item._replace(X_LS=X_LS, touch=tuple(touch))


def padding_of(padding, names: set[str]) -> dict[str, float]:
    """Body → by how much it is swollen [m]."""
    if not isinstance(padding, Mapping):
        return dict.fromkeys(names, _checked_padding("padding", padding))
    for name in padding:
        if name not in names:
            raise InvalidArgument(f"padding: no link or attached object is called {brief(name)}")
    return {name: _checked_padding(f'padding of "{cut(name)}"', value) for name, value in padding.items()}


def _checked_padding(what: str, value) -> float:
    length = checks.number(value)
    if length is None or not 0.0 <= length < 1e6:
        raise InvalidArgument(f"{what} must be a length [m], 0 or more, got {brief(value)}")
    return length


class SeenWorld:
    """Bodies and filters of a World as of a question, for `bodies_around` and `filters_of`, without later changes.

    world : whose.   X_WBs : (n, 4, 4) copied.   version : number of the World's changes.
    """

    def __init__(self, world: World):
        self.world = world
        self.version, self.roster, self.filters, self.X_WBs = world._read()

    def differs_in_poses_from(self, before: SeenWorld) -> bool:
        """Whether nothing but poses may have changed since."""
        return self.world is before.world and self.roster is before.roster and self.filters is before.filters

    def has_pairs_of(self, before: SeenWorld) -> bool:
        """Whether the same pairs are tested as before: shapes, poses and margins have no say."""
        fields = [name for name in Roster._fields if name not in ("names", "shapes", "margin", "generation")]
        return (
            self.world is before.world and self.filters.reasons == before.filters.reasons
            and np.array_equal(self.filters.allowed, before.filters.allowed)
            and all(np.array_equal(getattr(self.roster, name), getattr(before.roster, name)) for name in fields)
        )

    @cached_property
    def rows(self) -> dict[str, int]:
        """Row of each body in ``X_WBs``, by name."""
        alive = np.flatnonzero(self.roster.alive).tolist()
        return {self.roster.names[k]: k for k in alive}

    @property
    def names(self) -> dict[int, str]:
        """Name of each body, by id."""
        ids = self.roster.ids.tolist()
        return {ids[k]: name for name, k in self.rows.items()}

    @property
    def allowed(self) -> dict[tuple[int, int], str]:
        """{(id, id): reason}."""
        allowed, ids = self.filters.allowed, self.roster.ids
        is_there = self.roster.alive[allowed].all(axis=1).tolist()
        pairs = zip(ids[allowed].tolist(), self.filters.reasons, is_there)
        return {(a, b): reason for (a, b), reason, both in pairs if both}

    def body(self, name: str) -> Body:
        """The body of this name."""
        position = self.rows[name]
        return self.roster.body(position, self.X_WBs[position])


def bodies_around(world: World | SeenWorld, robot: Robot) -> list[BodyAround]:
    """Bodies of a World other than the robot's own, recognised by the names of links."""
    rows = world.rows if isinstance(world, SeenWorld) else {}
    others = (world.body(name) for name in world.names.values() if name not in robot.geometry)
    return [BodyAround(B.name, B.shape, B.X_WB, B.margin, rows.get(B.name, k)) for k, B in enumerate(others)]


def refuse_own_margins(packed: SeenWorld, robot: Robot) -> None:
    """Refuse a World with margins of links among each other: a checker does not keep these.

    Raises InvalidArgument naming the link.
    """
    names = packed.roster.names
    asked = [(k,) for k in np.flatnonzero(packed.roster.alive & (packed.roster.margin > 0.0)).tolist()]
    asked += [divmod(key, 1 << 32) for key in packed.filters.margin_keys.tolist()]
    for positions in asked:
        link = next((names[k] for k in positions if names[k] in robot.geometry), None)
        if link is not None:
            partner = next((f' and "{cut(names[k])}"' for k in positions if names[k] != link), "")
            raise InvalidArgument(
                f'RobotChecker: the World has a margin of "{cut(link)}"{partner}, a link of the robot: margins are of '
                "bodies around; take it back by World.set_margin, and give padding= for links"
            )


def filters_of(
    robot: Robot, bodies: list[RobotBody], objects: dict[str, Attached], world: World | SeenWorld,
    around: list[BodyAround], allowed: Iterable[tuple[str, str]], mobile: bool, gone: Iterable[str] = (),
) -> Filters:
    """Tested pairs, and the number of untested pairs by reason.

    gone : names of bodies that have left the World, which ``allowed`` may have as well.

    Never tested: pairs disabled by the robot, pairs named in ``allowed`` or in the World, links of a fixed base against
    static or sleeping bodies, and pairs excluded by groups and masks: a link has group and mask of the World's body of
    its name, else group 1 with all.
    """
    known = {body.name for body in bodies} | {body.name for body in around} | set(gone)
    reasons = _named_pairs(robot, objects, world, allowed, known)
    skipped: dict[str, int] = {}

    def is_skipped(a: str, b: str, why: str | None = None, *, last: str | None = None) -> bool:
        why = why or reasons.get((a, b)) or reasons.get((b, a)) or last
        if why:
            skipped[why] = skipped.get(why, 0) + 1
        return bool(why)

    traits = _groups_and_masks(bodies, objects, world)
    self_pairs = []
    for i, A in enumerate(bodies):
        for j in range(i + 1, len(bodies)):
            same = "moves with the same link" if A.link == bodies[j].link else None
            masked = None if _are_tested(traits[i], traits[j]) else MASKED
            if not is_skipped(A.name, bodies[j].name, same or masked):
                self_pairs.append((i, j))
    base = set() if mobile else {robot.links.index(link) for link in robot.base_links}
    matrix = np.zeros((len(bodies), len(around)), dtype=np.uint8)
    for k, B in enumerate(around):
        body = world.body(B.name)
        for i, A in enumerate(bodies):
            masked = None if _are_tested(traits[i], (body.group, body.mask)) else MASKED
            fixed = STATIC if body.static and A.link in base else None
            resting = ASLEEP if body.sleeping and A.link in base else None
            matrix[i, k] = is_skipped(A.name, B.name, fixed or masked, last=resting)
    return Filters(np.array(self_pairs, dtype=np.int64).reshape(-1, 2), matrix, skipped)


def _groups_and_masks(
    bodies: list[RobotBody], objects: dict[str, Attached], world: World | SeenWorld
) -> list[tuple[int, int]]:
    """(group, mask) of each body: of the World's of its name, if it is a link."""
    names = set(world.names.values()) - objects.keys()
    in_world = [world.body(body.name) if body.name in names else None for body in bodies]
    return [(1, _ALL_GROUPS) if body is None else (body.group, body.mask) for body in in_world]


def _are_tested(A: tuple[int, int], B: tuple[int, int]) -> bool:
    """Whether groups and masks of two bodies let their pair be tested."""
    return bool(A[0] & B[1]) and bool(B[0] & A[1])


def _named_pairs(
    robot: Robot, objects: dict[str, Attached], world: World | SeenWorld, allowed: Iterable[tuple[str, str]],
    known: set[str],
) -> dict[tuple[str, str], str]:
    """(name, name) → why the pair is never tested."""
    reasons = {(a, b): reason for a, b, reason in robot.disabled_pairs}
    names = world.names
    for (i, j), reason in world.allowed.items():
        reasons.setdefault((names[i], names[j]), reason)
    for item in objects.values():
        for name in (item.link, *item.touch):
            reasons.setdefault((item.name, name), "attached object may touch")
    for pair in allowed:
        if not (isinstance(pair, (tuple, list)) and len(pair) in (2, 3)):
            raise InvalidArgument(f"allowed must be pairs of names, got {brief(pair)}")
        for name in pair[:2]:
            if name not in known and name not in robot.links:
                raise InvalidArgument(f"allowed: no link, attached object or body is called {brief(name)}")
        reasons.setdefault((pair[0], pair[1]), pair[2] if len(pair) == 3 else "allowed")
    return reasons


def paths_to_root(robot: Robot, links: list[int]) -> list[list[str]]:
    """Of each link, the joints that move, from the link to the root."""
    above = {joint.child: joint for joint in robot.joints}
    paths = []
    for link in links:
        path, name = [], robot.links[link]
        while name in above:
            joint = above[name]
            if COLUMNS[joint.type]:
                path.append(joint.name)
            name = joint.parent
        paths.append(path)
    return paths
