"""Which bodies a pybullet client has, what they collide with, and where they stand, by pybullet's interface alone."""

from __future__ import annotations

import itertools
import os
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.hosts.bullet_shapes import Collider, ShapeReader
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.shapes import Shape

_serial = itertools.count()
#: How the keys of marks begin.
MARK = "collide mirror"
#: Link number of a body's base.
BASE = -1


class Geom(NamedTuple):
    """One link of one body that collides; a row of all tables of a mirror.

    body, link : pybullet's numbers, −1 for the base.   name : unique.   parents : links it hangs on, nearest first.
    fixed : whether it is a base without mass, which Bullet puts in its group of static bodies.
    """

    body: int
    link: int
    name: str
    collider: Collider
    parents: tuple[int, ...]
    fixed: bool


class ClientBodies:
    """The bodies of a client, listed anew when some came or went.

    A body's number is given to another once it is gone, in the same place of the list. So each body is marked by a
    piece of user data, under a key of this mirror, which goes with it.

    geoms : of all bodies, bases first.   remaining : {(body, link): why its shape cannot be read}.
    """

    def __init__(self, pybullet: Any, client: int, margins: str, shapes: Mapping[tuple[int, int], Shape]):
        self._pybullet, self._client, self._shapes = pybullet, client, dict(shapes)
        self._reader = ShapeReader(pybullet, client, margins)
        #: Shapes of links, in the frames of their centres of mass, for those that pybullet does not give back.
        self.spare_shapes: dict[int, dict[int, Shape]] = {}
        self._key = f"{MARK} {os.getpid()} {next(_serial)}"
        self._bodies: list[int] = []
        self._marks: list[int] = []
        self._mark_of: dict[int, int] = {}
        self._geoms_of: dict[int, list[Geom]] = {}
        self.geoms: list[Geom] = []
        self.remaining: dict[tuple[int, int], str] = {}
        self._bases: list[int] = []
        self._links: dict[int, list[int]] = {}

    def listed_anew(self) -> bool:
        """Look at the list of bodies; True where it changed. About 0.15 µs a body."""
        p, client = self._pybullet, self._client
        try:
            bodies = list(map(p.getBodyUniqueId, range(p.getNumBodies(client)), itertools.repeat(client)))
        except p.error as error:
            raise InvalidArgument(f"Mirror: physics client {client} does not answer ({error}); connect first") from None
        marks = self._marks_of(bodies)
        if bodies == self._bodies and marks == self._marks:
            return False
        known = dict(zip(self._bodies, self._marks))
        for body, mark in zip(bodies, marks):
            if mark < 0 or known.get(body) != mark:
                self._geoms_of[body] = self._read(body)
                if mark < 0:
                    p.addUserData(body, self._key, "followed", physicsClientId=client)
        self._bodies, self._marks = bodies, self._marks_of(bodies)
        self._mark_of = dict(zip(self._bodies, self._marks))
        self._geoms_of = {body: self._geoms_of[body] for body in bodies}
        for body in set(known) - set(bodies):
            self.spare_shapes.pop(body, None)
        self.remaining = {place: why for place, why in self.remaining.items() if place[0] in self._geoms_of}
        self._lay_out()
        return True

    def has(self, body: int) -> bool:
        """Whether a body is there, and is the one that was listed."""
        return body in self._geoms_of and self._mark(body) == self._mark_of[body]

    def knows(self, body: int) -> bool:
        """Whether a body was there when the list was looked at."""
        return body in self._geoms_of

    def forget(self, body: int | None = None) -> None:
        """Read a body, or all of them, anew the next time."""
        for place in [place for place in self.remaining if body is None or place[0] == body]:
            del self.remaining[place]
        self._marks = [-2 if body in (None, b) else mark for b, mark in zip(self._bodies, self._marks)]
        self._mark_of = dict(zip(self._bodies, self._marks))

    def replace(self, body: int, link: int, shape: Shape) -> None:
        """Take a shape for a link, whatever pybullet says."""
        self._shapes[body, link] = shape
        self.forget(body)

    def coordinates(self) -> np.ndarray:
        """(n, 7) position and quaternion x, y, z, w of every geom's collider, in W."""
        client, get, numbers = self._client, self._pybullet.getBasePositionAndOrientation, list[float]()
        for body in self._bases:
            position, orientation = get(body, client)
            numbers += position
            numbers += orientation
        for body, links in self._links.items():
            for place in self._places_of_links(body, links):
                numbers += place
        return np.array(numbers).reshape(-1, 7)

    def places_of(self, body: int) -> list[tuple]:
        """The same of one body, in tuples one after another: the base, then links, where they collide."""
        places: list[tuple] = []
        geoms = self._geoms_of[body]
        if geoms and geoms[0].link == BASE:
            places += self._pybullet.getBasePositionAndOrientation(body, self._client)
        if body in self._links:
            places += self._places_of_links(body, self._links[body])
        return places

    def _places_of_links(self, body: int, links: list[int]) -> list[tuple]:
        # Without the last 1 links stand where they were a step ago; their colliders do not.
        states = self._pybullet.getLinkStates(body, links, 0, 1, self._client)
        return [place for state in states for place in state[:2]]

    def coordinates_of(self, body: int, link: int) -> tuple:
        """Position and quaternion of one link's centre of mass, in W."""
        p, client = self._pybullet, self._client
        if link < 0:
            return p.getBasePositionAndOrientation(body, client)
        return p.getLinkState(body, link, 0, 1, client)[:2]

    def check(self, coordinates: np.ndarray, rows: np.ndarray) -> None:
        """Raise InvalidPose for the first of these geoms whose coordinates are no numbers."""
        bad = ~np.isfinite(coordinates).all(axis=1)
        if bad.any():
            geom = self.geoms[int(rows[np.flatnonzero(bad)[0]])]
            raise InvalidPose(f"{geom.name}: its pose in pybullet is not finite; the simulation has diverged")

    # --- reading --------------------------------------------------------------------------------

    def _mark(self, body: int) -> int:
        return self._pybullet.getUserDataId(body, self._key, -1, -1, self._client)

    def _marks_of(self, bodies: list[int]) -> list[int]:
        every = itertools.repeat
        return list(
            map(self._pybullet.getUserDataId, bodies, every(self._key), every(-1), every(-1), every(self._client))
        )

    def _read(self, body: int) -> list[Geom]:
        p, client = self._pybullet, self._client
        name = p.getBodyInfo(body, client)[1].decode(errors="replace") or "body"
        parent_of = {BASE: BASE - 1}
        labels = {BASE: f"{name} {body}"}
        for link in range(p.getNumJoints(body, client)):
            joint = p.getJointInfo(body, link, client)
            parent_of[link], labels[link] = joint[16], f"{name} {body} {joint[12].decode(errors='replace')} {link}"
        geoms = []
        for link in parent_of:
            collider = self._collider(body, link, labels[link])
            if collider is not None:
                fixed = link == BASE and p.getDynamicsInfo(body, BASE, client)[0] == 0.0
                geoms.append(Geom(body, link, labels[link], collider, _chain(parent_of, link), fixed))
        return geoms

    def _collider(self, body: int, link: int, label: str) -> Collider | None:
        place = body, link
        self.remaining.pop(place, None)
        try:
            collider = self._reader.collider(body, link, self._shapes.get(place))
        except UnsupportedQuery as error:
            if link in self.spare_shapes.get(body, {}):
                return self._reader.collider(body, link, self.spare_shapes[body][link])
            self.remaining[place] = str(error)
            warnings.warn(
                f'"{label}" is left out: {error}; give its shape: Mirror(shapes={{({body}, {link}): shape}})',
                RuntimeWarning,
                stacklevel=6,
            )
            return None
        if collider is not None and collider.note:
            warnings.warn(f'"{label}" is approximated: {collider.note}', RuntimeWarning, stacklevel=6)
        return collider

    def _lay_out(self) -> None:
        every = [geom for body in self._bodies for geom in self._geoms_of[body]]
        bases = [geom for geom in every if geom.link == BASE]
        self.geoms = bases + [geom for geom in every if geom.link != BASE]
        self._bases = [geom.body for geom in bases]
        links: dict[int, list[int]] = {}
        for geom in self.geoms[len(bases) :]:
            links.setdefault(geom.body, []).append(geom.link)
        self._links = links


def _chain(parent_of: dict[int, int], link: int) -> tuple[int, ...]:
    """The links that a link hangs on, up to the base, nearest first."""
    chain = []
    while link != BASE:
        link = parent_of[link]
        chain.append(link)
    return tuple(chain)
