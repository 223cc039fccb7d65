"""`Mirror`: a World that follows a pybullet client, and pybullet's questions about it."""

from __future__ import annotations

import importlib
import math
import operator
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from collide import World
from collide.adapters.hosts.bullet_answers import (
    ONE_BY_ONE,
    Tables,
    closest,
    contact_points,
    contact_points_of,
    exchanged,
    overlapping,
    ray_hits,
)
from collide.adapters.hosts.bullet_bodies import ClientBodies, Geom
from collide.adapters.hosts.bullet_filters import CollisionFilters
from collide.adapters.hosts.bullet_shapes import Collider
from collide.adapters.hosts.host_numbers import real
from collide.adapters.hosts.quaternion_poses import pose_of, poses_of
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, MissingExtra, UnknownBody, UnsupportedQuery, brief
from collide.shapes import Shape

MARGINS = ("none", "bullet")
#: Numbers that pybullet takes for every link, and for no shape.
EVERY_LINK, NO_SHAPE = -2, -1
_ALL_GROUPS = 0xFFFF_FFFF


class Mirror:
    """A World that follows a pybullet client, and pybullet's questions about it.

    Parameters
    ----------
    client : physicsClientId, as ``pybullet.connect`` returned it.
    margins : "none" for shapes as they are; "bullet" for hulls and triangles grown by what Bullet adds to them, a
        millimetre unless changed.
    shapes : {(body, link): shape} for links whose shapes pybullet does not give back (height fields, meshes of
        triangles made from arrays); in the frame of the link's centre of mass.
    contact_margin : [m] gap up to which `getContactPoints` lists contacts; None for Bullet's own rule.

    Attributes
    ----------
    world : the `World`; names tell body and link. It is another one after bodies came or went.
    remaining : {(body, link): why} for links that could not be read. Questions that name them raise UnsupportedQuery; a
        RuntimeWarning says so when they are first seen.

    Raises
    ------
    InvalidArgument : no such client, no such margins.
    MissingExtra : pybullet is not installed.

    Notes
    -----
    Bodies are marked by a piece of user data each. About 1.3 µs a body for `update`, nearly all of it pybullet's own.
    """

    #: Whether bodies are looked at when a mirror is made, or at the first update.
    _follows_at_once = True

    def __init__(
        self, client: int = 0, *, margins: Literal["none", "bullet"] = "none",
        shapes: Mapping[tuple[int, int], Shape] | None = None, contact_margin: float | None = None,
    ) -> None:
        if not isinstance(margins, str) or margins not in MARGINS:
            known = ", ".join(map(repr, MARGINS))
            raise InvalidArgument(f"Mirror: margins must be one of {known}, got {brief(margins)}")
        pybullet = genuine_pybullet()
        if not isinstance(client, int) or abs(client) > _ALL_GROUPS or not pybullet.isConnected(client):
            raise InvalidArgument(
                f"Mirror: client must be what pybullet.connect returned, and connected, got {brief(client)}"
            )
        shapes = {} if shapes is None else checks.mapping("Mirror: shapes", shapes, "of shapes by (body, link)")
        for place, shape in shapes.items():
            checks.instance(f"Mirror: shapes[{place!r}]", shape, Shape, "a shape")
        if contact_margin is not None:
            contact_margin = checks.limit("Mirror: contact_margin", contact_margin)
        self.client, self.contact_margin = client, contact_margin
        self.filters = CollisionFilters()
        #: Shapes without a body, by the numbers that createCollisionShape gave.
        self.collision_shapes: dict[int, Shape] = {}
        self._lone_shapes: dict[int, Tables] = {}
        self._bodies = ClientBodies(pybullet, client, margins, shapes)
        self._tables = Tables([], np.empty((0, 4, 4)))
        self._coordinates = np.empty((0, 7))
        #: Where bodies stand that were looked at by themselves, as pybullet said it; none that moved since.
        self._places: dict[int, list[tuple]] = {}
        self._contacts: list[tuple] | None = None
        self._stale_filters = False
        #: Groups of the geoms, which rays have masks for.
        self._groups = np.empty(0, dtype=np.int64)
        self.world = World()
        if self._follows_at_once:
            self.update()

    @property
    def remaining(self) -> dict[tuple[int, int], str]:
        return dict(self._bodies.remaining)

    # --- following ------------------------------------------------------------------------------

    def update(self) -> None:
        """Take over what came, went and moved since.

        Raises
        ------
        InvalidArgument : the client is gone.   InvalidPose : a body's pose is no number.
        """
        if self._bodies.listed_anew():
            self._rebuild()
            return
        if self._stale_filters:
            self._fill_world()
        self._move(np.arange(len(self._coordinates)), self._bodies.coordinates())

    def update_bodies(self, *bodies: int) -> None:
        """Take over where these bodies stand; everything, where one of them is new or gone."""
        if not all(self._bodies.has(body) for body in bodies):
            self.update()
            return
        members = set(bodies)
        places = {body: self._bodies.places_of(body) for body in members}
        if all(self._places.get(body) == place for body, place in places.items()):
            return
        rows = [row for body in members for row in self._tables.rows_of.get(body, [])]
        coordinates = [number for place in places.values() for numbers in place for number in numbers]
        self._move(np.array(rows, dtype=np.int64), np.array(coordinates).reshape(-1, 7))
        self._places |= places

    def refresh(self, body: int | None = None) -> None:
        """Read shapes anew, of one body or all: after changeDynamics of a margin, or resetMeshData."""
        self._bodies.forget(None if body is None else _integers(body=body)[0])
        self.update()

    def set_shape(self, body: int, link: int, shape: Shape) -> None:
        """Take a shape, in the frame of the link's centre of mass, for what pybullet says of a link."""
        body, link = _integers(body=body, link=link)
        self._bodies.replace(body, link, checks.instance("shape", shape, Shape, "a shape"))
        self.update()

    def note_body(self, body: int, flags: int, shapes: Mapping[int, Shape]) -> None:
        """A body was made with these flags; shapes of links, for those that pybullet does not give back."""
        self.set_self_collision(body, flags)
        checks.mapping("note_body: shapes", shapes, "of shapes by link")
        self.filters.forget({body})
        self.set_self_collision(body, flags)
        self._bodies.spare_shapes[body] = dict(shapes)

    def note_margin(self, body: int) -> None:
        """A margin of a body was changed: its shapes are read anew at the next update."""
        self._bodies.forget(*_integers(body=body))

    def forget_everything(self) -> None:
        """The simulation was reset: no body has filters or shapes."""
        self.filters.clear_all()
        self.collision_shapes.clear()
        self._lone_shapes.clear()
        self._bodies.spare_shapes.clear()
        self._bodies.forget()
        self._stale_filters = True

    def set_self_collision(self, body: int, flags: int) -> None:
        """Say with which flags a body was loaded: pybullet's for self-collision, and those that go with it."""
        self.filters.set_self_collision(*_integers(body=body, flags=flags))
        self._stale_filters = True

    def set_filter_mode(self, mode: int) -> None:
        """Say what ``collisionFilterMode`` is: 1, as Bullet begins, or 0 where groups must be in masks both ways."""
        self.filters.needs_both = _integers(mode=mode) == [0]
        self._stale_filters = True

    def setCollisionFilterGroupMask(
        self, bodyUniqueId, linkIndexA, collisionFilterGroup, collisionFilterMask, physicsClientId=None
    ):
        """Note a group and a mask; pybullet does not give them back. They have a say in contacts and rays."""
        self.filters.set_group_mask(*_integers(
            bodyUniqueId=bodyUniqueId, linkIndexA=linkIndexA, collisionFilterGroup=collisionFilterGroup,
            collisionFilterMask=collisionFilterMask,
        ))
        self._stale_filters = True

    def setCollisionFilterPair(
        self, bodyUniqueIdA, bodyUniqueIdB, linkIndexA, linkIndexB, enableCollision, physicsClientId=None
    ):
        """Note that a pair is switched on or off; pybullet does not give it back. It has a say in contacts."""
        *place_a, place_b, link_b, enable = _integers(
            bodyUniqueIdA=bodyUniqueIdA, linkIndexA=linkIndexA, bodyUniqueIdB=bodyUniqueIdB, linkIndexB=linkIndexB,
            enableCollision=enableCollision,
        )
        self.filters.set_pair(*place_a, place_b, link_b, bool(enable))
        self._stale_filters = True

    # --- pybullet's questions -------------------------------------------------------------------

    def getClosestPoints(
        self, bodyA, bodyB, distance, linkIndexA=EVERY_LINK, linkIndexB=EVERY_LINK, collisionShapeA=NO_SHAPE,
        collisionShapeB=NO_SHAPE, collisionShapePositionA=(0, 0, 0), collisionShapePositionB=(0, 0, 0),
        collisionShapeOrientationA=(0, 0, 0, 1), collisionShapeOrientationB=(0, 0, 0, 1), physicsClientId=None,
    ):
        """Nearest points of two bodies, as of the last `update`: one row for each two links within the distance [m].

        Raises
        ------
        UnknownBody : no such body or link.   InvalidArgument : a shape whose number is not known here.
        UnsupportedQuery : a link that could not be read; two half-spaces.
        """
        side_a = _integers(bodyA=bodyA, linkIndexA=linkIndexA, collisionShapeA=collisionShapeA)
        side_b = _integers(bodyB=bodyB, linkIndexB=linkIndexB, collisionShapeB=collisionShapeB)
        A, rows_a = self._side(*side_a, collisionShapePositionA, collisionShapeOrientationA)
        B, rows_b = self._side(*side_b, collisionShapePositionB, collisionShapeOrientationB)
        return closest(A, rows_a, B, rows_b, _number("distance", distance))

    def getContactPoints(
        self, bodyA=-1, bodyB=-1, linkIndexA=EVERY_LINK, linkIndexB=EVERY_LINK, physicsClientId=None
    ):
        """Contacts of the bodies as they stood at the last `update`, of pairs that the filters let meet.

        Bullet lists what its last step met, where bodies stood before they moved. Forces are 0.
        """
        wanted = tuple(_integers(bodyA=bodyA, bodyB=bodyB, linkIndexA=linkIndexA, linkIndexB=linkIndexB))
        if self._stale_filters:
            self._fill_world()
        for body in wanted[:2]:
            if body >= 0:
                self._rows(body, EVERY_LINK)
        if self._contacts is None and min(wanted[:2]) >= 0:
            pairs = self._tested_pairs(*wanted)
            if len(pairs) <= ONE_BY_ONE:
                rows = contact_points_of(pairs, self._tables, self.contact_margin)
                return tuple(row if row[1] == wanted[0] else exchanged(row) for row in rows)
        if self._contacts is None:
            self._contacts = contact_points(self.world, self._tables, self.contact_margin)
        if wanted == (-1, -1, EVERY_LINK, EVERY_LINK):
            return tuple(self._contacts)
        rows = []
        for row in self._contacts:
            _, a, b, link_a, link_b, *_ = row
            if _matches(wanted, (a, b, link_a, link_b)):
                rows.append(row)
            elif _matches(wanted, (b, a, link_b, link_a)):
                rows.append(exchanged(row))
        return tuple(rows)

    def getOverlappingObjects(self, aabbMin, aabbMax, physicsClientId=None):
        """((body, link), …) whose boxes meet a box [m], as of the last `update`; None where there are none."""
        low, high = _vectors("aabbMin", aabbMin)[0], _vectors("aabbMax", aabbMax)[0]
        return overlapping(self.world, self._tables, low, high)

    def rayTest(self, rayFromPosition, rayToPosition, collisionFilterMask=-1, reportHitNumber=-1, physicsClientId=None):
        """((body, link, fraction, position, normal),) of what a ray meets first, as of the last `update`."""
        return self.rayTestBatch(
            [rayFromPosition], [rayToPosition], reportHitNumber=reportHitNumber, collisionFilterMask=collisionFilterMask
        )

    def rayTestBatch(
        self, rayFromPositions, rayToPositions, numThreads=1, parentObjectUniqueId=-1, parentLinkIndex=-1,
        reportHitNumber=-1, collisionFilterMask=-1, fractionEpsilon=-1.0, physicsClientId=None,
    ):
        """What each of n rays meets first, (n, 3) positions in W [m], or in the frame of a parent's centre of mass."""
        if self._stale_filters:
            self._fill_world()
        origins, ends = _vectors("rayFromPositions", rayFromPositions), _vectors("rayToPositions", rayToPositions)
        if len(origins) != len(ends):
            raise InvalidArgument(
                f"rayTestBatch: as many ends as origins are needed, got {len(origins)} origins and {len(ends)} ends"
            )
        parent, link, mask, hit_number = _integers(
            parentObjectUniqueId=parentObjectUniqueId, parentLinkIndex=parentLinkIndex,
            collisionFilterMask=collisionFilterMask, reportHitNumber=reportHitNumber,
        )
        if parent >= 0:
            X = self._pose(parent, link)
            origins, ends = (points @ X[:3, :3].T + X[:3, 3] for points in (origins, ends))
        passed = (self._groups & mask) == 0
        epsilon = _number("fractionEpsilon", fractionEpsilon)
        return ray_hits(self.world, self._tables, origins, ends, passed, hit_number, epsilon)

    # --- how they are answered ------------------------------------------------------------------

    def _rebuild(self) -> None:
        coordinates = self._bodies.coordinates()
        geoms = self._bodies.geoms
        before = {geom.body for geom in self._tables.geoms}
        self.filters.forget(before - {geom.body for geom in geoms})
        self._tables, self._places = Tables([], np.empty((0, 4, 4))), {}
        self._bodies.check(coordinates, np.arange(len(coordinates)))
        self._coordinates = coordinates
        self._tables = Tables(geoms, poses_of(coordinates))
        self._fill_world()

    def _fill_world(self) -> None:
        """Another World of the same geoms, with the filters as they are."""
        tables, filters = self._tables, self.filters
        untouched = filters.are_bullets_own
        self.world = World()
        for geom, shape, X in zip(tables.geoms, tables.shapes, tables.X_WS):
            group, mask = filters.bits(geom) if untouched else (_ALL_GROUPS, _ALL_GROUPS)
            self.world.add(shape, X, name=geom.name, static=untouched and geom.fixed, group=group, mask=mask)
        for a, b, reason in filters.never_tested(tables.geoms):
            self.world.allow(a, b, reason=reason)
        if not untouched:
            for a, b in filters.incompatible(tables.geoms).tolist():
                self.world.allow(a, b, reason="groups and masks")
        self._groups = np.array([filters.bits(geom)[0] for geom in tables.geoms], dtype=np.int64)
        self._contacts, self._stale_filters = None, False

    def _move(self, rows: np.ndarray, coordinates: np.ndarray) -> None:
        moved = (coordinates != self._coordinates[rows]).any(axis=1)
        if not moved.any():
            return
        rows, coordinates = rows[moved], coordinates[moved]
        self._bodies.check(coordinates, rows)
        self._places = {}
        X_WSs = poses_of(coordinates) @ self._tables.X_BS[rows]
        self.world.set_poses(rows, X_WSs)
        self._coordinates[rows], self._tables.X_WS[rows] = coordinates, X_WSs
        self._contacts = None

    def _side(self, body: int, link: int, number: int, position, orientation) -> tuple[Tables, list[int]]:
        """Tables and rows of a body, or of a shape that has none."""
        if number < 0:
            return self._tables, self._rows(body, link)
        if number not in self.collision_shapes:
            raise InvalidArgument(
                f"getClosestPoints: shape {number} is not known; pybullet does not give shapes without bodies back: "
                "make it through attach(), or put it into Mirror.collision_shapes"
            )
        shape = self.collision_shapes[number]
        known = self._lone_shapes.get(number)
        if known is None or known.shapes[0] is not shape:
            geom = Geom(-1, EVERY_LINK, "shape", Collider(shape, None, 0.0, ""), (), False)
            known = self._lone_shapes[number] = Tables([geom], np.eye(4)[None])
        return known.moved_to(pose_of(position, orientation)[None]), [0]

    def _tested_pairs(self, body_a: int, body_b: int, link_a: int, link_b: int) -> list[tuple[int, int]]:
        """Pairs of rows (i, j), i < j, sorted, of links of two bodies that filters let meet."""
        geoms = self._tables.geoms
        pairs = {(min(a, b), max(a, b)) for a in self._rows(body_a, link_a) for b in self._rows(body_b, link_b)}
        return sorted((i, j) for i, j in pairs if i != j and self.filters.tests(geoms[i], geoms[j]))

    def _rows(self, body: int, link: int) -> list[int]:
        """Rows of a body's links, or of one. Raises UnknownBody, UnsupportedQuery."""
        if not self._bodies.knows(body):
            raise UnknownBody(f"pybullet has no body {body}, or it came after the last update()")
        for (unread, place), why in self._bodies.remaining.items():
            if unread == body and link in (EVERY_LINK, place):
                raise UnsupportedQuery(
                    f"body {body}, link {place}: {why}; set_shape(body, link, shape) gives its shape"
                )
        rows = self._tables.rows_of.get(body, [])
        return rows if link == EVERY_LINK else [row for row in rows if self._tables.geoms[row].link == link]

    def _pose(self, body: int, link: int) -> np.ndarray:
        """(4, 4) pose of a link's centre of mass, whether it collides or not."""
        if not self._bodies.knows(body):
            raise UnknownBody(f"pybullet has no body {body}, or it came after the last update()")
        return pose_of(*self._bodies.coordinates_of(body, link))


def genuine_pybullet() -> Any:
    """pybullet itself, also while `install` has put ours in its place. Raises MissingExtra."""
    try:
        module = importlib.import_module("pybullet")
    except ImportError as error:
        raise MissingExtra(
            "pybullet", extra="pybullet", purpose="follow its bodies (wheels up to Python 3.11)"
        ) from error
    return getattr(module, "__wrapped__", module)


def _integers(**values: Any) -> list[int]:
    """Numbers of bodies, links and shapes, bits and flags. Raises TypeError as pybullet does, InvalidArgument."""
    numbers = []
    for name, value in values.items():
        if value.__class__ is int and -_ALL_GROUPS <= value <= _ALL_GROUPS:
            numbers.append(value)
            continue
        try:
            number = operator.index(value)
        except TypeError:
            raise TypeError(f"{name} must be an integer, got {brief(value)}") from None
        if abs(number) > _ALL_GROUPS:
            raise InvalidArgument(f"{name} must be an integer of 32 bits, got {brief(value)}")
        numbers.append(number)
    return numbers


def _number(name: str, value: Any) -> float:
    number = real(name, value)
    if math.isnan(number):
        raise InvalidArgument(f"{name} must be a number, got nan")
    return number


def _matches(wanted: tuple, places: tuple) -> bool:
    """Whether bodies and links are those asked for; negative bodies, and every link, are any."""
    return (
        (wanted[0] < 0 or wanted[0] == places[0]) and (wanted[1] < 0 or wanted[1] == places[1])
        and wanted[2] in (EVERY_LINK, places[2]) and wanted[3] in (EVERY_LINK, places[3])
    )


def _vectors(name: str, values) -> np.ndarray:
    """(n, 3) finite float64."""
    array = checks.array(name, values, "(n, 3)", InvalidArgument)
    if array.ndim == 1 and array.size:
        array = array[None]
    if array.size == 0 and isinstance(values, list | tuple | np.ndarray) and not len(values):
        return np.empty((0, 3))
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise InvalidArgument(f"{name} must be finite positions of three numbers each, got {brief(values)}")
    return array
