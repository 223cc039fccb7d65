"""pybullet on collide: `Mirror`, a World that follows a client; `attach` and `install` for programs as they are.

    import pybullet as p
    mirror = Mirror(p.connect(p.DIRECT))
    ...
    mirror.update()
    mirror.getClosestPoints(robot, table, 0.1)

Tuples and conventions are pybullet's: the normal stands on B and points to A, distances below 0 are overlaps, link −1
is the base. What only a solver knows (forces, directions of friction) is 0. docs/hosts.md says what is different.
"""

from __future__ import annotations

import functools
import inspect
import sys
import warnings
from collections.abc import Callable
from threading import RLock
from types import ModuleType
from typing import Any

from collide.adapters.hosts.bullet_arguments import (
    BODY_ARGUMENTS,
    SHAPE_ARGUMENTS,
    inertial_frames,
    moved,
    named,
    shape_of_arguments,
)
from collide.adapters.hosts.bullet_bodies import MARK
from collide.adapters.hosts.bullet_mirror import MARGINS, Mirror, genuine_pybullet
from collide.adapters.hosts.stand_in import warn_of_holders
from collide.base import argument_checks as checks
from collide.errors import CollideError, InvalidArgument
from collide.kernels import library
from collide.shapes import Shape

__all__ = ["MARGINS", "QUESTIONS", "Mirror", "attach", "check", "install", "installed", "uninstall"]

#: What collide answers in place of pybullet.
QUESTIONS = ("getClosestPoints", "getContactPoints", "getOverlappingObjects", "rayTest", "rayTestBatch")
#: Where physicsClientId stands among the arguments of what is watched.
_CLIENT_AT = {
    "createCollisionShape": SHAPE_ARGUMENTS.index("physicsClientId"), "createMultiBody": len(BODY_ARGUMENTS) - 1,
    "loadURDF": 7, "loadSDF": 3, "loadMJCF": 3, "resetSimulation": 1, "disconnect": 0, "setCollisionFilterPair": 5,
    "setCollisionFilterGroupMask": 4, "changeDynamics": 24, "setPhysicsEngineParameter": 99, "connect": 99,
}
_CLIENT_AT_OF_QUESTIONS = dict(zip(QUESTIONS, (11, 4, 2, 4, 8)))
_BODIES_OF_QUESTIONS = {"getClosestPoints": (("bodyA", "bodyB"), 1), "getContactPoints": (("bodyA", "bodyB"), 2)}
#: How names begin of functions that move no body and make none.
_LOOKING = ("get", "calculate", "compute", "is", "rayTest", "addUserDebug", "removeUserDebug", "error")
#: Where flags stand among those of what loads bodies.
_FLAGS_AT = {"createMultiBody": BODY_ARGUMENTS.index("flags"), "loadURDF": 5, "loadMJCF": 1}

_before: ModuleType | None = None
_stand_in: ModuleType | None = None


def attach(
    pybullet: Any = None, client: int | None = None, *, questions=QUESTIONS, exclusive: bool = False, **options
) -> ModuleType:
    """pybullet with collide's answers: a module to use in place of it. Every other name is pybullet's own.

    Parameters
    ----------
    pybullet : the module, or a ``BulletClient``; pybullet itself if left out.
    client : the client that calls without physicsClientId are about, and then the only one that is followed. None: 0,
        as in pybullet, and all are followed; of a ``BulletClient`` its own.
    questions : names of `QUESTIONS` that collide answers; the others stay pybullet's.
    exclusive : whether all that the program does with pybullet goes through the returned module. Then bodies of clients
        that it connects with DIRECT are looked at only after a call that may have moved some.
    options : of `Mirror`: ``margins``, ``shapes``, ``contact_margin``.

    Returns
    -------
    module : ``mirror_of(client)`` is the `Mirror` of a client. A mirror is up to date with its client before each
        question. What pybullet does not give back is noted as it passes: filters, flags of self-collision, shapes
        without bodies, height fields and meshes of triangles made from arrays.

    Raises
    ------
    InvalidArgument : questions that are none; what is no pybullet.   MissingExtra : pybullet is not installed.
    """
    unknown = sorted(set(questions) - set(QUESTIONS))
    if unknown:
        raise InvalidArgument(f"attach: questions are among {', '.join(QUESTIONS)}, got {', '.join(unknown)}")
    if pybullet is None:
        pybullet = genuine_pybullet()
    elif client is None and not isinstance(pybullet, ModuleType):
        client = _number_of(pybullet)
    return _StandIn(pybullet, client, tuple(questions), checks.true_or_false("attach: exclusive", exclusive), options)


def _number_of(bullet_client: Any) -> int:
    """The client of a BulletClient, by the argument that it gives to every function of pybullet."""
    number = getattr(getattr(bullet_client, "isConnected", None), "keywords", {}).get("physicsClientId")
    if not isinstance(number, int):
        raise InvalidArgument(
            f"attach: pybullet must be the module or a BulletClient, got {type(bullet_client).__name__}, whose "
            "functions have no physicsClientId of their own; say client="
        )
    return number


def install(**options) -> _Installed:
    """Let ``import pybullet`` find `attach`'s module, until `uninstall`, or to the end of a ``with`` block.

    Parameters
    ----------
    options : as of `attach`: ``questions``, ``margins``, ``shapes``, ``contact_margin``.

    Returns
    -------
    context manager : its value is that module. Installing twice is as once.

    Notes
    -----
    Modules that imported pybullet before keep it: a RuntimeWarning names them. Without any, ``exclusive`` is as if it
    was said. Programs that make a ``BulletClient``
    need collide's compiled library, for it gives its number to builtins alone: a RuntimeWarning says so without.
    """
    global _before, _stand_in
    if _stand_in is None:
        genuine = genuine_pybullet()
        held = warn_of_holders(genuine, "pybullet", stacklevel=2)
        _before, _stand_in = genuine, attach(genuine, **{"exclusive": not held} | options)
        sys.modules["pybullet"] = _stand_in
        if library.glue is None:
            warnings.warn(
                "collide runs without its compiled library: what it answers or watches of a BulletClient's calls is "
                "about client 0; use attach(it) instead",
                RuntimeWarning,
                stacklevel=2,
            )
    return _Installed()


def uninstall() -> None:
    """Let ``import pybullet`` find pybullet again; modules that hold ours keep it."""
    global _before, _stand_in
    if _before is not None:
        sys.modules["pybullet"] = _before
    _before = _stand_in = None


def installed() -> bool:
    """Whether ``import pybullet`` finds collide's module."""
    return _stand_in is not None


class _Installed:
    """Leaving the block takes the stand-in away."""

    def __enter__(self) -> ModuleType:
        return sys.modules["pybullet"]

    def __exit__(self, *exception) -> None:
        uninstall()


def _as_builtin(name: str, function: Callable) -> Callable:
    """pybullet's functions are builtins: programs that hold several clients give a client's number to these alone."""
    return function if library.glue is None else library.glue.builtin_of(name, function)


class _WatchedMirror(Mirror):
    """Told of bodies before it looks at them."""

    _follows_at_once = False


class _StandIn(ModuleType):
    """pybullet, but for the questions; and what passes is looked at."""

    def __init__(
        self, pybullet: Any, client: int | None, questions: tuple[str, ...], exclusive: bool, options: dict
    ) -> None:
        super().__init__("pybullet", "pybullet; nearest points, contacts, boxes and rays are collide's.")
        self.__wrapped__ = pybullet
        self.__all__ = [name for name in dir(pybullet) if not name.startswith("_")]
        self._client, self._options = client, options
        self._exclusive = exclusive and isinstance(pybullet, ModuleType)
        #: Clients that no one else can reach. How many calls may have moved bodies; and how many there were when a
        #: client, or (client, body), was looked at last.
        self._alone: set[int] = set()
        self._n_changes = 0
        self._looked_at: dict[Any, int] = {}
        self._asking = RLock()
        self._mirrors: dict[int, Mirror] = {}
        self._shapes: dict[tuple[int, int], Shape] = {}
        made = {name: self._answering(name) for name in questions}
        made |= {name: self._watching(name) for name in _CLIENT_AT}
        made |= {"getNumUserData": self._n_user_data, "getUserDataInfo": self._user_data_info}
        for name, function in made.items():
            setattr(self, name, _as_builtin(name, function))

    def __getattr__(self, name: str):
        """pybullet's own, about this module's client: BulletClients give theirs by themselves, and 0 is the default."""
        attribute = getattr(self.__wrapped__, name)
        is_of_clients = name != "connect" and inspect.isbuiltin(attribute)
        if self._exclusive and is_of_clients and not name.startswith(_LOOKING):
            attribute = _as_builtin(name, functools.partial(self._change, attribute))
        if self._client and is_of_clients and isinstance(self.__wrapped__, ModuleType):
            return functools.partial(self._of_client, attribute)
        return attribute

    def _change(self, function: Callable, *values, **keywords):
        """Bodies may have moved."""
        try:
            return function(*values, **keywords)
        finally:
            self._n_changes += 1

    def _of_client(self, function: Callable, *values, **keywords):
        """A function about this module's client, which programs may name, too, by its place."""
        try:
            return function(*values, **{"physicsClientId": self._client, **keywords})
        except TypeError:
            if not values:
                raise
            return function(*values, **keywords)

    def __dir__(self):
        return sorted({*dir(self.__wrapped__), "mirror_of"})

    def mirror_of(self, client: int | None = None) -> Mirror:
        """The `Mirror` of a client, up to date. Raises InvalidArgument."""
        mirror = self._mirror(client)
        mirror.update()
        return mirror

    def _mirror(self, client: int | None) -> Mirror:
        client = self._number(client)
        if client not in self._mirrors:
            mirror = self._mirrors[client] = _WatchedMirror(client, **self._options)
            for (owner, number), shape in self._shapes.items():
                if owner == client:
                    mirror.collision_shapes[number] = shape
        return self._mirrors[client]

    def _number(self, client: int | None) -> int:
        return client if client is not None else self._client or 0

    def _answering(self, name: str) -> Callable:
        method, place = getattr(Mirror, name), _CLIENT_AT_OF_QUESTIONS[name]
        #: Arguments that name bodies, and of how many the answer is about these bodies alone.
        sides, n_needed = _BODIES_OF_QUESTIONS.get(name, ((), 1))

        @functools.wraps(method)
        def answer(*values, **keywords):
            client = keywords.get("physicsClientId", values[place] if len(values) > place else None)
            if self._client is not None and client not in (None, self._client):
                return getattr(self.__wrapped__, name)(*values, **keywords)
            with self._asking:
                return ask(client, values, keywords)

        def ask(client: int | None, values: tuple, keywords: dict):
            mirror, number, n_changes = self._mirror(client), self._number(client), self._n_changes
            if self._looked_at.get(number) == n_changes:
                return method(mirror, *values, **keywords)
            bodies = [keywords.get(side, values[k] if len(values) > k else -1) for k, side in enumerate(sides)]
            known = [body for body in bodies if body >= 0]
            if known and len(known) >= n_needed:
                places: list[Any] = [(number, body) for body in known]
                if any(self._looked_at.get(place) != n_changes for place in places):
                    mirror.update_bodies(*known)
            else:
                places = [number]
                mirror.update()
            if number in self._alone:
                self._looked_at.update(dict.fromkeys(places, n_changes))
            return method(mirror, *values, **keywords)

        return answer

    def _watching(self, name: str) -> Callable:
        note = getattr(self, f"_note_{name}", None) or functools.partial(self._note_bodies, name)

        def watched(*values, **keywords):
            place = _CLIENT_AT[name]
            client = keywords.get("physicsClientId", values[place] if len(values) > place else None)
            # Looked up at the call: to look up a BulletClient's disconnect disconnects it.
            function = getattr(self.__wrapped__, name) if len(values) > place else self.__getattr__(name)
            try:
                result = function(*values, **keywords)
            finally:
                self._n_changes += 1
            if self._client is None or client in (None, self._client):
                note(self._client if client is None else client, values, keywords, result)
            return result

        watched.__name__ = watched.__qualname__ = name
        return watched

    # --- user data without the marks of mirrors -------------------------------------------------

    def _n_user_data(self, bodyUniqueId, physicsClientId=None) -> int:
        return len(self._user_data(bodyUniqueId, physicsClientId))

    def _user_data_info(self, bodyUniqueId, userDataIndex, physicsClientId=None) -> tuple:
        client = self._number(physicsClientId)
        places = self._user_data(bodyUniqueId, physicsClientId)
        if not 0 <= userDataIndex < len(places):
            places, userDataIndex = [-1], 0  # pybullet says what is wrong
        return self.__wrapped__.getUserDataInfo(bodyUniqueId, places[userDataIndex], physicsClientId=client)

    def _user_data(self, body: int, client: int | None) -> list[int]:
        """Places in pybullet's list of those that the program has made."""
        p, client = self.__wrapped__, self._number(client)
        places = range(p.getNumUserData(body, physicsClientId=client))
        marked = MARK.encode()
        return [k for k in places if not p.getUserDataInfo(body, k, physicsClientId=client)[1].startswith(marked)]

    # --- what passes ----------------------------------------------------------------------------

    def _note_connect(self, _client: int | None, values: tuple, keywords: dict, number: int) -> None:
        """A number is given anew, or none is (-1): what was known of it is about a client that is gone."""
        if number >= 0:
            self._note_disconnect(number)
            if self._exclusive and keywords.get("method", *values[:1]) == self.__wrapped__.DIRECT:
                self._alone.add(number)

    def _note_disconnect(self, client: int | None, *_) -> None:
        number = self._number(client)
        self._note_resetSimulation(number)
        self._mirrors.pop(number, None)
        self._alone.discard(number)
        self._looked_at.clear()

    def _note_resetSimulation(self, client: int | None, *_) -> None:
        number = self._number(client)
        self._shapes = {place: shape for place, shape in self._shapes.items() if place[0] != number}
        if number in self._mirrors:
            self._mirrors[number].forget_everything()

    def _note_createCollisionShape(self, client: int | None, values: tuple, keywords: dict, number: int) -> None:
        try:
            shape = shape_of_arguments(self.__wrapped__, named(SHAPE_ARGUMENTS, values, keywords))
        except CollideError:
            shape = None  # it is asked about, or not: then the question says that it is not known
        if shape is not None and number >= 0:
            self._shapes[self._number(client), number] = shape
            if self._number(client) in self._mirrors:
                self._mirrors[self._number(client)].collision_shapes[number] = shape

    def _note_bodies(self, name: str, client: int | None, values: tuple, keywords: dict, result: Any) -> None:
        """Bodies were loaded or made: their flags, and shapes that pybullet does not give back."""
        mirror = self._mirror(client)
        place = _FLAGS_AT.get(name)
        flags = keywords.get("flags", values[place] if place is not None and len(values) > place else 0)
        shapes: dict[int, Shape] = {}
        if name == "createMultiBody":
            for link, (number, X) in inertial_frames(named(BODY_ARGUMENTS, values, keywords)).items():
                shape = mirror.collision_shapes.get(number)
                if shape is not None:
                    shapes[link] = moved(shape, X)
        for body in result if isinstance(result, tuple | list) else (result,):
            if body >= 0:
                mirror.note_body(body, flags, shapes)

    def _note_setCollisionFilterPair(self, client: int | None, values: tuple, keywords: dict, _: Any) -> None:
        self._mirror(client).setCollisionFilterPair(*values, **keywords)

    def _note_setCollisionFilterGroupMask(self, client: int | None, values: tuple, keywords: dict, _: Any) -> None:
        self._mirror(client).setCollisionFilterGroupMask(*values, **keywords)

    def _note_changeDynamics(self, client: int | None, values: tuple, keywords: dict, _: Any) -> None:
        if "collisionMargin" in keywords or len(values) > 19:
            self._mirror(client).note_margin(keywords.get("bodyUniqueId", values[0] if values else -1))

    def _note_setPhysicsEngineParameter(self, client: int | None, values: tuple, keywords: dict, _: Any) -> None:
        if "collisionFilterMode" in keywords:
            self._mirror(client).set_filter_mode(keywords["collisionFilterMode"])


def check() -> str:
    """For `collide doctor`: two hulls in a client of their own, asked through `attach`.

    Returns
    -------
    One line that says what held.

    Raises
    ------
    RuntimeError : where the answer is not the one that is known.   MissingExtra : pybullet is not installed.
    """
    genuine = genuine_pybullet()
    corners = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    client = genuine.connect(genuine.DIRECT)
    try:
        p = attach(genuine, client)
        hull = p.createCollisionShape(genuine.GEOM_MESH, vertices=corners, physicsClientId=client)
        A, B = (p.createMultiBody(1.0, hull, basePosition=[x, 0, 0], physicsClientId=client) for x in (0.0, 3.0))
        for x in (3.0, 4.0):
            genuine.resetBasePositionAndOrientation(B, [x, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], client)
            ((*_, gap, _, _, _, _, _),) = p.getClosestPoints(A, B, 9.0, physicsClientId=client)
            if abs(gap - (x - 1.0)) > 1e-12:
                raise RuntimeError(f"two cubes of 1 m whose middles are {x} m apart: {gap!r} m")
    finally:
        genuine.disconnect(client)
    return "two hulls followed, apart as they stand"
