"""World: bodies with names and poses, filters between them, and queries over all pairs."""

from __future__ import annotations

import copy
import math
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from collide import argument_checks as checks
from collide.broadphase.filters import CULLED, count_skipped
from collide.certificates.make_certificate import certify
from collide.contact.contact_query import check_margin, check_most, contact_rows
from collide.contact.contact_rows import WorldContacts, no_rows
from collide.errors import InvalidArgument, InvalidPose, UnknownBody, UnsupportedQuery
from collide.log import log_duration
from collide.packed_world import PackedWorld
from collide.results import HOW, UNDECIDED, WorldResult
from collide.security_margin import checked_margin, within
from collide.shapes.shape import Shape
from collide.transforms import as_poses

#: Groups and masks are bit sets of this many bits.
_BITS = 32


@dataclass(frozen=True)
class Body:
    """One body of a World, as it stands now."""

    id: int
    name: str
    shape: Shape
    X_WB: np.ndarray
    static: bool
    group: int
    mask: int

    def __post_init__(self) -> None:
        self.X_WB.flags.writeable = False  # of a copy as well

    def __reduce__(self):
        return Body, (self.id, self.name, self.shape, self.X_WB, self.static, self.group, self.mask)


class World:
    """Bodies that may touch, and the questions one asks of them.

    A pair of bodies is tested unless both are static, their groups and masks exclude each other
    (tested when ``(group_A & mask_B) and (group_B & mask_A)``), or `allow` names the pair.

        world = collide.World()
        world.add(collide.Box((2, 1, 0.04)), pose_of_table, name="table", static=True)
        world.add(collide.Sphere(0.1), pose_of_ball, name="ball")
        for row, (a, b) in zip(rows := world.distances(max_distance=0.05), rows.names): ...

    Packed arrays and the box-tree are made when a query first needs them, and again when bodies
    change; moving bodies refits. A World is not safe to change from one thread while another asks.
    """

    def __init__(self) -> None:
        self._bodies: dict[int, Body] = {}
        self._ids: dict[str, int] = {}
        self._allowed: dict[tuple[int, int], str] = {}
        self._next = 0
        self._packed: PackedWorld | None = None
        self._moved: set[int] = set()
        self._stats: dict = {}
        self._asked: _Asked | None = None

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: bodies, names and what is allowed. The rest is made again."""
        return {
            "_bodies": dict(self._bodies), "_ids": dict(self._ids), "_allowed": dict(self._allowed), "_next": self._next,
            "_packed": None, "_moved": set(), "_stats": copy.deepcopy(self.stats), "_asked": None,
        }  # fmt: skip

    # --- bodies ---------------------------------------------------------------------------------

    def add(
        self, shape: Shape, X_WB=None, *, name: str | None = None, static: bool = False, group: int = 1,
        mask: int = 0xFFFF,
    ) -> int:  # fmt: skip
        """Add a body; returns its id, which is never used again.

        shape : any shape.   X_WB : (4, 4) pose in the world, the identity if left out.
        name : unique; "body 7" and so on if left out.   static : never tested against other static bodies.
        group, mask : bit sets of up to 32 bits.
        """
        if not isinstance(shape, Shape):
            raise InvalidArgument(f"World.add: shape must be a shape, for example collide.Sphere(0.1), got {checks.describe(shape)}")
        X_WB = _one_pose(np.eye(4) if X_WB is None else X_WB, "World.add: X_WB")
        identity = self._next
        name = f"body {identity}" if name is None else name
        if not isinstance(name, str) or not name:
            raise InvalidArgument(f"World.add: name must be a non-empty string, got {checks.describe(name)}")
        if name in self._ids:
            raise InvalidArgument(f'World.add: there is a body named "{name}" already (id {self._ids[name]})')
        body = Body(identity, name, shape, X_WB, _flag("static", static), _bits("group", group), _bits("mask", mask))
        self._bodies[identity], self._ids[name] = body, identity
        self._next += 1
        self._packed = None
        return identity

    def remove(self, body: int | str) -> None:
        """Take a body out, and what was allowed for it."""
        identity = self._id(body)
        del self._ids[self._bodies.pop(identity).name]
        self._allowed = {pair: why for pair, why in self._allowed.items() if identity not in pair}
        self._packed = None

    def set_pose(self, body: int | str, X_WB) -> None:
        """Move a body to a (4, 4) pose."""
        self._move(self._id(body), _one_pose(X_WB, "World.set_pose: X_WB"))

    def set_poses(self, bodies: Iterable[int | str], X_WBs) -> None:
        """Move k bodies to k poses (k, 4, 4)."""
        ids = [self._id(body) for body in bodies]
        X_WBs = as_poses(X_WBs, "World.set_poses: X_WBs")
        if len(X_WBs) != len(ids):
            raise InvalidPose(f"World.set_poses: {len(ids)} bodies but {len(X_WBs)} poses")
        for identity, X_WB in zip(ids, X_WBs):
            self._move(identity, _read_only(X_WB))

    def _move(self, identity: int, X_WB: np.ndarray) -> None:
        body = self._bodies[identity]
        self._bodies[identity] = Body(identity, body.name, body.shape, X_WB, body.static, body.group, body.mask)
        self._moved.add(identity)

    def allow(self, a, b=None, *, reason: str = "allowed") -> None:
        """Never test a pair: ``allow("link3", "link4")``; or many, by a symmetric boolean matrix over
        the bodies in the order of `ids`: ``allow(matrix)``.

        reason : a few words; `stats` counts skipped pairs under it.
        """
        if b is None:
            self._allow_matrix(checks.plain_array("World.allow: matrix", a, "(bodies, bodies)", InvalidArgument), reason)
            return
        i, j = self._id(a), self._id(b)
        if i == j:
            raise InvalidArgument(f'World.allow: "{self._bodies[i].name}" twice; a body is never tested against itself')
        self._allowed.setdefault((min(i, j), max(i, j)), str(reason))
        self._packed = None

    def _allow_matrix(self, matrix: np.ndarray, reason: str) -> None:
        n = len(self._bodies)
        if matrix.shape != (n, n) or matrix.dtype != bool or (matrix != matrix.T).any():
            raise InvalidArgument(
                f"World.allow: a matrix must be symmetric, boolean and ({n}, {n}) for the {n} bodies, "
                f"got {matrix.dtype} {matrix.shape}"
            )
        ids = self.ids
        for i, j in np.argwhere(np.triu(matrix, 1)):
            self._allowed.setdefault((ids[i], ids[j]), str(reason))
        self._packed = None

    def _id(self, body: int | str) -> int:
        if isinstance(body, str):
            if body in self._ids:
                return self._ids[body]
            known = ", ".join(sorted(self._ids)[:12]) or "none"
            raise UnknownBody(f'no body is named "{body}"; there are: {known}{", …" if len(self._ids) > 12 else ""}')
        if not checks.is_integer(body):
            raise UnknownBody(f"a body is named by its id or its name, got {checks.describe(body)}")
        if body not in self._bodies:
            raise UnknownBody(f"no body has id {checks.describe(body)}; it may have been removed")
        return int(body)

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def ids(self) -> list[int]:
        """Ids of all bodies, ascending."""
        return list(self._bodies)

    @property
    def names(self) -> dict[int, str]:
        """Name of each body, by id."""
        return {identity: body.name for identity, body in self._bodies.items()}

    def body(self, body: int | str) -> Body:
        """The body of this id or name."""
        return self._bodies[self._id(body)]

    # --- queries --------------------------------------------------------------------------------

    def collides(self, *, security_margin: float = 0.0) -> bool:
        """Whether any tested pair hits; stops at the first that does.

        security_margin : [m], ≥ 0, finite: pairs at most so far apart are hits, too, decided as by `collide.collide`; which
            those are, `distances` says. Then every pair is asked.
        """
        margin = checked_margin("World.collides: security_margin", security_margin)
        if not margin:
            return bool(self._ask(0.0, boolean=True)["hit"].any())
        rows = self._ask(margin)
        bodies = self._bodies

        def pair(k: int):
            a, b = bodies[int(rows["a"][k])], bodies[int(rows["b"][k])]
            return a.shape, b.shape, a.X_WB, b.X_WB

        return bool(within(rows, margin, pair).any())

    def collisions(self) -> WorldResult:
        """Every hitting pair with its depth, sorted by (a, b)."""
        rows = self._ask(0.0)
        return WorldResult(rows[rows["hit"]], dict(self._bodies), certify)

    def distances(self, max_distance: float = math.inf) -> WorldResult:
        """Every tested pair at most ``max_distance`` [m] apart, hits included, sorted by (a, b).

        None is left out that is not proven farther apart: ``lower ≤ max_distance`` of all of them.
        Two half-spaces that meet have distance −inf.
        """
        limit = checks.limit("World.distances: max_distance", max_distance)
        rows = self._ask(limit)
        return WorldResult(rows[_within(rows, limit)], dict(self._bodies), certify)

    def contacts(self, margin: float = 0.0, *, max_contacts: int = 8) -> WorldContacts:
        """Contacts of every tested pair within ``margin`` [m], sorted by (a, b): one row a contact.

        margin, max_contacts, and what a row says and promises: as in `collide.contacts`. `stats` stays as it is.
        Raises UnsupportedQuery, naming the bodies, where that does.
        """
        margin, most = check_margin("World.contacts", margin), check_most("World.contacts", max_contacts)
        bodies = list(self._bodies.values())
        found = []
        for i, j in self._pack().candidates(margin).tolist():
            A, B = bodies[i], bodies[j]
            try:
                rows = contact_rows(A.shape, B.shape, A.X_WB, B.X_WB, margin, most)
            except UnsupportedQuery as error:
                raise UnsupportedQuery(f'"{A.name}" and "{B.name}": {error}') from None
            rows["a"], rows["b"] = A.id, B.id
            found.append(rows)
        return WorldContacts(np.concatenate([no_rows(), *found]), dict(self._bodies))

    def unanswerable(self, max_distance: float = math.inf) -> list[tuple[int, int, str]]:
        """Pairs for which `distances` up to ``max_distance`` [m] raises UnsupportedQuery: (id, id, reason), sorted.

        Such are some shapes against a mesh. Allow these pairs, and the rest of the World is answered.
        """
        limit = checks.limit("World.unanswerable: max_distance", max_distance)
        packed, ids = self._pack(), list(self._bodies)
        return [(ids[a], ids[b], why) for a, b, why in packed.refused(packed.candidates(limit), limit)]

    def query(self, shape: Shape, X_WS, max_distance: float = 0.0) -> WorldResult:
        """One outside shape S against every body: pairs at most ``max_distance`` apart.

        Field a is −1 for the outside shape, b the body; normals point from the shape to the body.
        Filters do not apply, and `stats` stays that of the last query of the whole World.
        """
        limit = checks.limit("World.query: max_distance", max_distance)
        if not isinstance(shape, Shape):
            raise InvalidArgument(f"World.query: shape must be a shape, got {checks.describe(shape)}")
        X_WS = _one_pose(X_WS, "World.query: X_WS")
        rows = self._pack().against(shape, X_WS, limit)
        rows = rows[_within(rows, limit)]
        rows["b"] = self._pack().ids[rows["b"]]
        rows["a"] = -1
        return WorldResult(rows, {**self._bodies, -1: Body(-1, "query", shape, X_WS, False, 0, 0)}, certify)

    @property
    def allowed(self) -> dict[tuple[int, int], str]:
        """Pairs never tested: {(id, id): reason}, the smaller id first."""
        return dict(self._allowed)

    @property
    def stats(self) -> dict:
        """What the last collides, collisions or distances tested, culled, skipped, decided and took.

        bodies, static, pairs (of all bodies), skipped {reason: pairs}, narrowphase (pairs of bodies
        answered), convex_pairs (of their parts), mesh_pairs (of bodies, one a mesh or with one), hits, undecided, how {argument: pairs},
        gjk_iterations, epa_iterations, seconds {pack, broadphase, narrowphase}.
        """
        if self._asked is not None:
            self._stats, self._asked = self._asked.stats(), None
        return self._stats

    def _ask(self, limit: float, *, boolean: bool = False) -> np.ndarray:
        """Rows of all tested pairs within the limit; of a boolean, rows up to the first hit, without names of bodies."""
        started = time.perf_counter()
        packed = self._pack()
        ready = time.perf_counter()
        candidates = packed.candidates(limit)
        culled = time.perf_counter()
        rows, *answered = packed.answer(candidates, limit, boolean=boolean, stop_at_hit=boolean)
        ended = time.perf_counter()
        seconds = {"pack": ready - started, "broadphase": culled - ready, "narrowphase": ended - culled}
        columns = rows["hit"].copy(), rows["how"].copy(), rows["iterations"].copy()
        self._asked = _Asked(packed, len(candidates), *columns, answered, seconds)
        if not boolean:
            rows["a"], rows["b"] = packed.ids[rows["a"]], packed.ids[rows["b"]]
        return rows

    def _pack(self) -> PackedWorld:
        if self._packed is None:
            position = {identity: k for k, identity in enumerate(self._bodies)}
            allowed = {(position[i], position[j]): reason for (i, j), reason in self._allowed.items()}
            with log_duration("tables and box-tree of a World of %d bodies made", len(self._bodies)):
                self._packed = PackedWorld(list(self._bodies.values()), allowed)
        elif self._moved:
            moved = sorted(self._moved)
            at = np.searchsorted(self._packed.ids, moved)  # ids ascend
            self._packed.move(at, np.array([self._bodies[identity].X_WB for identity in moved]))
        self._moved.clear()
        return self._packed


@dataclass(frozen=True)
class _Asked:
    """What `World.stats` of a question are made of, when they are asked for."""

    packed: PackedWorld
    candidates: int
    hit: np.ndarray
    how: np.ndarray
    iterations: np.ndarray
    answered: list[int]
    seconds: dict

    def stats(self) -> dict:
        """As `World.stats` says."""
        packed, n = self.packed, len(self.packed.ids)
        skipped = count_skipped(packed.static, packed.group, packed.mask, packed.allowed)
        pairs = n * (n - 1) // 2
        skipped[CULLED] = pairs - sum(skipped.values()) - self.candidates
        return {
            "bodies": n, "static": int(packed.static.sum()), "pairs": pairs, "skipped": skipped,
            "narrowphase": self.answered[1], "convex_pairs": self.answered[0], "mesh_pairs": self.answered[2],
            "hits": int(self.hit.sum()), "undecided": int((self.how == UNDECIDED).sum()),
            "how": dict(Counter(HOW[how] for how in self.how)),
            "gjk_iterations": int((self.iterations & 0xFFFF).sum()), "epa_iterations": int((self.iterations >> 16).sum()),
            "seconds": self.seconds,
        }  # fmt: skip


def _within(rows: np.ndarray, limit: float) -> np.ndarray:
    """Pairs that are not proven farther apart than the limit: those whose brackets reach to both sides of it are told, too."""
    return ~(rows["lower"] > limit)


def _one_pose(X, name: str) -> np.ndarray:
    X = as_poses(X, name)
    if len(X) != 1:
        raise InvalidPose(f"{name} must be one (4, 4) pose, got {len(X)}")
    return _read_only(X[0])


def _read_only(X: np.ndarray) -> np.ndarray:
    X = X.copy()
    X.flags.writeable = False
    return X


def _flag(field: str, value) -> bool:
    if isinstance(value, (bool, np.bool_)) or (isinstance(value, (int, np.integer)) and value in (0, 1)):
        return bool(value)
    raise InvalidArgument(f"World.add: {field} must be True or False, got {checks.describe(value)}")


def _bits(field: str, value) -> int:
    if not checks.is_integer(value) or not 0 <= int(value) < 2**_BITS:
        raise InvalidArgument(f"World.add: {field} must be an integer of up to {_BITS} bits, got {checks.describe(value)}")
    return int(value)


