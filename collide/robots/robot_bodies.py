"""A robot as seen by a checker: bodies moving with its links, and the tested pairs of bodies."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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
#: Group and mask of bodies that nothing is said of.
_ANY = 1, _ALL_GROUPS
#: Why pairs are never tested.
SAME_LINK, TOUCHES, ALLOWED = "moves with the same link", "attached object may touch", "allowed"


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
    """Tested pairs.

    self_pairs : (k, 2) int64 of bodies, those of links first, then of each attached object with the bodies before.
    allowed : (bodies, around) uint8, 1 where a pair is never tested.
    skipped : {reason: pairs} of links, then of each attached object.
    starts : of each attached object, how many self_pairs stand before its own.
    """

    self_pairs: np.ndarray
    allowed: np.ndarray
    skipped: tuple[dict[str, int], ...]
    starts: tuple[int, ...] = ()

    @property
    def n_pairs(self) -> int:
        """Pairs that are tested."""
        return len(self.self_pairs) + int((self.allowed == 0).sum())

    @property
    def reasons(self) -> dict[str, int]:
        """{reason: number of pairs never tested}."""
        counts: Counter[str] = Counter()
        for of_body in self.skipped:
            counts.update(of_body)
        return dict(counts)

    def of_first(self, n: int) -> Filters:
        """Those of links and the first n attached objects."""
        if n == len(self.starts):
            return self
        n_bodies = len(self.allowed) - len(self.starts) + n
        pairs = self.self_pairs[: self.starts[n]]
        return Filters(pairs, self.allowed[:n_bodies], self.skipped[: n + 1], self.starts[:n])

    def without_pair(self, a: int, b: int, reason: str) -> tuple[Filters, int | None]:
        """(those less a tested pair, its row of self_pairs); (the same, ``None``) where the pair is not tested.

        a, b : numbers of bodies, or of a single body and −1 − a body around.
        """
        a, b = (min(a, b), max(a, b)) if a >= 0 and b >= 0 else (max(a, b), min(a, b))
        row, pairs, allowed, starts = None, self.self_pairs, self.allowed, self.starts
        if b < 0:
            if allowed[a, -1 - b]:
                return self, None
            allowed = allowed.copy()
            allowed[a, -1 - b] = 1
        else:
            rows = np.flatnonzero((pairs[:, 0] == a) & (pairs[:, 1] == b))
            if not len(rows):
                return self, None
            row = int(rows[0])
            pairs, starts = np.delete(pairs, row, axis=0), tuple([first - (row < first) for first in starts])
        of = max(0, max(a, b) - (len(allowed) - len(starts)) + 1)
        counts = {**self.skipped[of], reason: self.skipped[of].get(reason, 0) + 1}
        return Filters(pairs, allowed, (*self.skipped[:of], counts, *self.skipped[of + 1 :]), starts), row


def robot_bodies(robot: Robot, attached: Iterable, padding) -> tuple[list[RobotBody], dict[str, Attached]]:
    """Bodies from the last link to the root, attached objects behind, and attached objects by name.

    Raises InvalidArgument, InvalidPose: unknown links, names used twice, paddings out of range.
    """
    objects: dict[str, Attached] = {}
    for values in attached:
        item = checked_object(robot, objects, values)
        objects[item.name] = item
    swelling = padding_of(padding, {*robot.links, *objects})
    bodies = [
        RobotBody(link, number, _link_shape(robot, link), swelling.get(link, 0.0))
        for number, link in reversed(list(enumerate(robot.links))) if link in robot.geometry
    ]
    bodies += [body_of_object(robot, item, swelling.get(item.name, 0.0)) for item in objects.values()]
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
    shape = item.shape
    if shape.is_region or shape.is_field:
        compound = Compound([(shape, item.X_LS)])  # which says what to do instead
    else:
        compound = object.__new__(Compound)  # of a pose that is checked, in a tenth of the time
        compound._store(items=((shape, item.X_LS),), meshed=shape.meshed, poses=item.X_LS[None])
    return RobotBody(item.name, robot.links.index(item.link), compound, padding)


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
    X_LS.flags.writeable = False
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


class PairRules:
    """Pairs never tested, and reasons: rows of links, and rows of each object to be attached.

    Never tested: pairs of bodies on one link, pairs disabled by the robot, pairs named in ``allowed`` or in the World,
    links of a fixed base against static or sleeping bodies, and pairs excluded by groups and masks: a link has group
    and mask of the World's body of its name, else group 1 with all; objects have group 1 with all.

    known : further names for ``allowed``: of attached objects, and of bodies gone from the World.
    """

    def __init__(
        self, robot: Robot, links: Sequence[RobotBody], known: Iterable[str], world: World | SeenWorld,
        around: Sequence[BodyAround], allowed: Iterable, mobile: bool,
    ):
        in_world = set(world.names.values())
        self._links = links
        self._traits = [
            _traits_of(world.body(body.name)) if body.name in in_world else _ANY for body in links]
        self._around = [world.body(body.name) for body in around]
        self._base = set() if mobile else {robot.links.index(link) for link in robot.base_links}
        #: Numbers of links, and −1 − numbers of bodies around, by name.
        self.numbers = {body.name: -1 - k for k, body in enumerate(around)}
        self.numbers |= {body.name: k for k, body in enumerate(links)}
        #: Name → partner → why their pair is never tested: of robot and World, and of what a checker allows.
        self._reasons: dict[str, dict[str, str]] = {}
        self._allowed: dict[str, dict[str, str]] = {}
        for pair in robot.disabled_pairs:
            _note(self._reasons, *pair)
        names = world.names
        for (i, j), reason in world.allowed.items():
            _note(self._reasons, names[i], names[j], reason)
        known = {*known, *self.numbers, *robot.links}
        for pair in allowed:
            if not (isinstance(pair, (tuple, list)) and len(pair) in (2, 3)):
                raise InvalidArgument(f"allowed must be pairs of names, got {brief(pair)}")
            for name in pair[:2]:
                if name not in known:
                    raise InvalidArgument(f"allowed: no link, attached object or body is called {brief(name)}")
            _note(self._allowed, pair[0], pair[1], pair[2] if len(pair) == 3 else ALLOWED)
        #: Link → what an object there is never tested against, whatever its name: `_row_on`.
        self._on_links: dict[int, tuple[list[int], np.ndarray, dict[str, int]]] = {}

    def _row(self, link: int, traits: tuple[int, int], named: Mapping[str, str], first: int) -> tuple[list, list]:
        """Why a body isn't tested against links from the first on, and against bodies around; ``None`` where it is."""
        among = [
            SAME_LINK if body.link == link else MASKED if not _are_tested(traits, others) else named.get(body.name)
            for body, others in zip(self._links[first:], self._traits[first:])
        ]
        rests = link in self._base
        around = [
            STATIC if rests and body.static else MASKED if not _are_tested(traits, _traits_of(body))
            else named.get(body.name) or (ASLEEP if rests and body.sleeping else None) for body in self._around
        ]
        return among, around

    def of_links(self) -> Filters:
        """Those of a robot without attached objects. O(links · (links + bodies around))."""
        pairs, reasons = [], []
        allowed = np.zeros((len(self._links), len(self._around)), dtype=np.uint8)
        for i, (body, traits) in enumerate(zip(self._links, self._traits)):
            named = {**self._allowed.get(body.name, {}), **self._reasons.get(body.name, {})}
            among, around = self._row(body.link, traits, named, i + 1)
            pairs += [(i, j) for j, why in enumerate(among, i + 1) if not why]
            allowed[i] = [bool(why) for why in around]
            reasons += among + around
        return Filters(np.array(pairs, dtype=np.int64).reshape(-1, 2), allowed, (dict(Counter(filter(None, reasons))),))

    def _row_on(self, link: int) -> tuple[list[int], np.ndarray, dict[str, int]]:
        """(links that an object on a link is tested against, (1, around) its row of ``allowed``, {reason: pairs})."""
        if link not in self._on_links:
            among, around = self._row(link, _ANY, {}, 0)
            row = np.array([[bool(why) for why in around]], dtype=np.uint8).reshape(1, -1)
            tested = [k for k, why in enumerate(among) if not why]
            self._on_links[link] = tested, row, dict(Counter(filter(None, among + around)))
        return self._on_links[link]

    def with_object(self, filters: Filters, before: Sequence[Attached], item: Attached, link: int) -> Filters:
        """Filters with rows of an object behind the rows of all bodies before. O(links + bodies around) in numpy.

        before : objects attached before.   link : number of the object's.
        """
        tested, row, skipped = self._row_on(link)
        tested, row, skipped = tested.copy(), row.copy(), skipped.copy()
        named = dict.fromkeys((item.link, *item.touch), TOUCHES)
        named = {**self._allowed.get(item.name, {}), **named, **self._reasons.get(item.name, {})}
        for name, why in named.items():
            number = self.numbers.get(name)
            if number is None or (number not in tested if number >= 0 else row[0, -1 - number]):
                continue
            if number >= 0:
                tested.remove(number)
            else:
                row[0, -1 - number] = 1
            skipped[why] = skipped.get(why, 0) + 1
        for k, earlier in enumerate(before, len(self._links)):
            reason = TOUCHES if item.name in earlier.touch else named.get(earlier.name)
            reason = SAME_LINK if earlier.link == item.link else reason
            if reason:
                skipped[reason] = skipped.get(reason, 0) + 1
            else:
                tested.append(k)
        pairs = np.empty((len(tested), 2), dtype=np.int64)
        pairs[:, 0], pairs[:, 1] = tested, len(filters.allowed)
        return Filters(
            np.concatenate((filters.self_pairs, pairs)), np.concatenate((filters.allowed, row)),
            (*filters.skipped, skipped), (*filters.starts, len(filters.self_pairs)),
        )

    def allowing(self, a: str, b: str) -> PairRules:
        """The rules with a pair that is never tested, either."""
        rules = copy.copy(self)
        rules._allowed = dict(self._allowed)
        for name, partner in ((a, b), (b, a)):
            rules._allowed[name] = {**self._allowed.get(name, {}), partner: ALLOWED}
        return rules

    def forgetting(self, name: str) -> PairRules:
        """The rules without pairs allowed to an object of this name, unless a body around has the name as well."""
        if name not in self._allowed or name in self.numbers:
            return self
        rules = copy.copy(self)
        rules._allowed = {
            body: {partner: why for partner, why in partners.items() if partner != name}
            for body, partners in self._allowed.items() if body != name
        }
        return rules


def _note(reasons: dict[str, dict[str, str]], a: str, b: str, reason: str) -> None:
    reasons.setdefault(a, {}).setdefault(b, reason)
    reasons.setdefault(b, {}).setdefault(a, reason)


def _traits_of(body: Body) -> tuple[int, int]:
    return body.group, body.mask


def _are_tested(A: tuple[int, int], B: tuple[int, int]) -> bool:
    """Whether groups and masks of two bodies let their pair be tested."""
    return bool(A[0] & B[1]) and bool(B[0] & A[1])


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
