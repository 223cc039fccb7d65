"""One protocol for every engine: the same `Question` goes in, the same `Table` comes out.

    from collide.adapters.peers.protocol import engine, Question
    table = engine("coal").answer(Question.from_pairs([(A, B, X_WA, X_WB)]))
    table.rows["hit"], table.rows["distance"], table.reasons

Signs and directions are converted here and in the peers' own files, nowhere else: `distance` is
signed, negative inside; `normal` is the unit vector nhat_AB_W from A towards B.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Iterator
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.peers.question import Body, Question, convex_parts
from collide.errors import CollideError, InvalidArgument, MissingExtra, UnsupportedQuery
from collide.shapes import ConvexHull, Shape

__all__ = ["ENGINES", "TABLE_DTYPE", "Body", "PairwisePeer", "Peer", "Question", "Reply", "Table", "engine"]

#: One row per pair asked. `a`, `b` index the question's bodies. `answered`: the engine gave a boolean.
#: `has_distance`: and a usable number; else `distance` is NaN. `certified`: the engine claims a proof
#: (collide only). `undecided`: it says itself that rounding leaves the boolean open, and calls it a hit
#: (collide only). `lower`, `upper` [m]: its proven bracket. `failed`: it crashed, raised or ran out of
#: time. `unsupported`: it has no such shape or question. Numbers that the engine does not give are NaN.
#: `seconds` is wall time inside this interface, for orientation: Python overhead included, never a
#: benchmark.
TABLE_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"),
        ("normal", "f8", 3), ("point_a", "f8", 3), ("point_b", "f8", 3), ("seconds", "f8"),
        ("a", "i4"), ("b", "i4"),
        ("hit", "?"), ("answered", "?"), ("has_distance", "?"), ("certified", "?"), ("undecided", "?"),
        ("failed", "?"), ("unsupported", "?"),
    ],
    align=True,
)

#: The engines by name, each as ``module:class``; loaded when first asked for.
ENGINES = {
    "collide": "collide.adapters.peers.collide_peer:CollidePeer",
    "fcl": "collide.adapters.peers.fcl_peer:FclPeer",
    "coal": "collide.adapters.peers.coal_peer:CoalPeer",
    "pybullet": "collide.adapters.peers.pybullet_peer:PybulletPeer",
    "exact": "collide.adapters.peers.exact_peer:ExactPeer",
}
#: Asks one of them in a child process.
_ISOLATED = "collide.adapters.peers.child:IsolatedPeer"

#: The note of meshes that meet, of engines that look at one pair of facets at a time.
NO_DEPTH = "boolean only: it gives no depth of meshes"

ANSWERED, FAILED, UNSUPPORTED = STATUSES = "answered", "failed", "unsupported"
BUILDING, ASKING = "building", "asking"
_NOWHERE = (math.nan,) * 3


class Reply(NamedTuple):
    """What an engine says about one pair; plain data, since it crosses process borders.

    distance : signed [m]; NaN where the engine gives none.
    normal, point_a, point_b : (3,) in the world; NaN where the engine gives none.
    certified, undecided, lower, upper : as in `TABLE_DTYPE`; only collide fills them.
    note : a remark that belongs to an answer ("the distance was no number").
    """

    hit: bool
    distance: float = math.nan
    normal: tuple = _NOWHERE
    point_a: tuple = _NOWHERE
    point_b: tuple = _NOWHERE
    certified: bool = False
    note: str = ""
    undecided: bool = False
    lower: float = math.nan
    upper: float = math.nan


class Event(NamedTuple):
    """One step of an engine at work.

    kind : a row's status (ANSWERED, FAILED, UNSUPPORTED), or where the engine is now: BUILDING a
        body, ASKING a row. A child process that dies is known to have died there.
    at : index of the body for BUILDING, of the row otherwise.
    """

    kind: str
    at: int
    reply: Reply | None = None
    reason: str = ""
    seconds: float = 0.0


class Table:
    """Answers of one engine: ``rows`` of `TABLE_DTYPE` in the order asked, and ``reasons``.

    ``reasons`` has one text per row: empty, or why there is no answer, or a remark about it.

    Parameters
    ----------
    question : Question
        What was asked.
    engine, version : str
        Who answers.
    """

    def __init__(self, question: Question, engine: str, version: str):
        self.engine, self.version = engine, version
        self.rows = np.zeros(len(question.pairs), TABLE_DTYPE)
        self.reasons = [""] * len(question.pairs)
        for name in ("distance", "lower", "upper", "normal", "point_a", "point_b"):
            self.rows[name] = np.nan
        if question.pairs:
            self.rows["a"], self.rows["b"] = np.array(question.pairs).T

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        counts = ", ".join(f"{int(self.rows[n].sum())} {n}" for n in STATUSES)
        return f"Table({self.engine} {self.version}: {len(self)} rows, {counts})"

    def record(self, event: Event) -> None:
        """Write one row's event down; distances that are no finite length are dropped, with a remark.

        Parameters
        ----------
        event : Event
            About one row.
        """
        row = self.rows[event.at]
        row["seconds"], row[event.kind] = event.seconds, True
        self.reasons[event.at] = event.reason
        if event.reply is None:
            return
        reply = event.reply
        for name in ("hit", "certified", "undecided", "lower", "upper", "normal", "point_a", "point_b"):
            row[name] = getattr(reply, name)
        remark = reply.note
        if abs(reply.distance) < 1e300:
            row["distance"], row["has_distance"] = reply.distance, True
        elif not math.isnan(reply.distance):
            remark = f"the distance {reply.distance:g} is no length"
        self.reasons[event.at] = remark or event.reason


class Peer:
    """An engine behind the protocol.

    Attributes
    ----------
    name
        As in `ENGINES`.
    package
        Its distribution, None where collide brings it.
    module
        What to import.
    isolated
        Ask it in a child process by default, because it can end the interpreter, or prints where it should not.
    hint
        Added to the reason where the package is missing.
    """

    name = ""
    package: str | None = None
    module: str | None = None
    isolated = False
    #: Added to the reason where the package is missing.
    hint = ""

    @property
    def version(self) -> str:
        """The engine's version, without importing it."""
        try:
            return metadata.version(self.package or "collide-robotics")
        except metadata.PackageNotFoundError:
            return "unknown"

    def missing(self) -> str | None:
        """Why the engine cannot be asked here.

        Returns
        -------
        str or None
            None where it can.
        """
        if self.module is None or find_spec(self.module) is not None:
            return None
        return f"{self.package} is not installed" + (f" ({self.hint})" if self.hint else "")

    def require(self) -> None:
        """Complain where the engine's package is absent.

        Raises
        ------
        MissingExtra
            Naming the package and the extra that brings it.
        """
        if self.missing():
            raise MissingExtra(str(self.package), extra="peers", purpose=f"ask the engine {self.name!r}")

    def supports(self, shape: Shape) -> str | None:
        """Why the engine cannot hold a shape.

        A shape may still turn out unsupported when it is built: a hull of given points may be flat.

        Parameters
        ----------
        shape : Shape
            Any.

        Returns
        -------
        str or None
            None where, by its kind, it can.
        """
        for part, _ in convex_parts(shape, np.eye(4)):
            reason = self.refuses(part)
            if reason:
                return reason
        return None

    def refuses(self, part: Shape) -> str | None:
        """`supports` for one convex part.

        Parameters
        ----------
        part : Shape
            Convex.

        Returns
        -------
        str or None
            The reason, or None.
        """
        return None

    def stream(self, question: Question, wanted: Iterable[int]) -> Iterator[Event]:
        """Answers to the rows wanted, in order, with BUILDING and ASKING announced between them.

        Parameters
        ----------
        question : Question
            Bodies and pairs.
        wanted : iterable of int
            Rows: pairs by their number in the question.

        Returns
        -------
        iterator of Event
            One that answers for each row.

        Raises
        ------
        TypeError
            Where a subclass does not define it.
        """
        raise TypeError(f"{type(self).__name__} answers nothing: derive it from Peer and define stream")

    def answer(self, question: Question) -> Table:
        """Answers to all pairs of a question.

        What goes wrong with a single pair stands in its row.

        Parameters
        ----------
        question : Question
            Bodies and pairs.

        Returns
        -------
        Table
            A row a pair, in the order asked.

        Raises
        ------
        MissingExtra
            Where the engine's package is not installed.
        """
        self.require()
        table = Table(question, self.name, self.version)
        for event in self.stream(question, range(len(question.pairs))):
            if event.kind in STATUSES:
                table.record(event)
        return table


class PairwisePeer(Peer):
    """An engine that is asked pair by pair, a union as all pairs of its parts.

    A union hits where any part does; its distance is the least of its parts', which for an overlap
    is only a bound of the depth.
    """

    def build(self, part: Shape) -> Any:
        """The engine's own geometry for one convex shape; raises UnsupportedQuery with the reason."""
        raise TypeError(f"{type(self).__name__} builds nothing: derive it from PairwisePeer and define build")

    def parts(self, body: Body) -> Iterator[tuple[Any, np.ndarray]]:
        """The engine's geometries of a body, each with its pose in the world (4, 4)."""
        return ((self.build(part), X_WP) for part, X_WP in convex_parts(body.shape, body.X_WB))

    def ask(self, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Reply:
        """Two geometries at two poses (4, 4)."""
        raise TypeError(f"{type(self).__name__} asks nothing: derive it from PairwisePeer and define ask")

    def stream(self, question: Question, wanted: Iterable[int]) -> Iterator[Event]:
        built: dict[int, list | CollideError] = {}
        for k in wanted:
            for i in question.pairs[k]:
                if i not in built:
                    yield Event(BUILDING, i)
                    built[i] = self._build_body(question.bodies[i])
            yield Event(ASKING, k)
            yield self._row(k, [built[i] for i in question.pairs[k]])

    def _build_body(self, body: Body) -> list | CollideError:
        try:
            reason = self.supports(body.shape)
            if reason:
                return UnsupportedQuery(reason)
            return list(self.parts(body))
        except UnsupportedQuery as error:
            return error
        except Exception as error:  # noqa: BLE001 - whatever a binding throws costs this body alone
            return CollideError(f"building {body.name!r}: {complaint(error)}")

    def _row(self, k: int, bodies: list) -> Event:
        for body in bodies:
            if isinstance(body, CollideError):
                return Event(UNSUPPORTED if isinstance(body, UnsupportedQuery) else FAILED, k, None, str(body))
        start = time.perf_counter()
        try:
            replies = [self.ask(*A, *B) for A, B in itertools.product(*bodies)]
        except UnsupportedQuery as error:
            return Event(UNSUPPORTED, k, None, str(error))
        except Exception as error:  # noqa: BLE001 - or this pair alone
            return Event(FAILED, k, None, complaint(error), time.perf_counter() - start)
        return Event(ANSWERED, k, nearest(replies), "", time.perf_counter() - start)


def nearest(replies: list[Reply]) -> Reply:
    """The reply of a union: it hits where any part hits, and is as far as its nearest part."""
    if len(replies) == 1:
        return replies[0]
    hit = any(reply.hit for reply in replies)
    silent = [reply for reply in replies if math.isnan(reply.distance)]
    if silent:  # the nearest part may be the one without a number
        return Reply(hit, note=silent[0].note)
    return min(replies, key=lambda reply: reply.distance)._replace(hit=hit)


def complaint(error: BaseException) -> str:
    """An exception in one line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {' '.join(lines)}"[:300] if lines else type(error).__name__


def has_radius(part: Shape) -> bool:
    """True for a hull with a ball around it, which most engines do not have."""
    return isinstance(part, ConvexHull) and part.radius > 0


def load_engine(spec: str) -> Peer:
    """The engine that a ``module:class`` text names."""
    return _named(spec)()


def _named(spec: str) -> Any:
    """A class that is found when it is first needed, as engines are: `ENGINES`."""
    module, _, name = spec.partition(":")
    return getattr(import_module(module), name)


def engine(name: str, *, isolated: bool | None = None, timeout: float = 10.0) -> Peer:
    """An engine by its name in `ENGINES`.

    Parameters
    ----------
    name : str
        For example "coal".
    isolated : bool, optional
        Ask it in a child process, so that a crash or a hang costs one pair; None leaves it to the engine.
    timeout : float
        Of a child's answer to one pair [s].

    Returns
    -------
    Peer
        A missing package shows when it is asked.

    Raises
    ------
    InvalidArgument
        For an unknown name.
    """
    if name not in ENGINES:
        raise InvalidArgument(f"no engine {name!r}; there are {', '.join(sorted(ENGINES))}")
    peer = load_engine(ENGINES[name])
    if peer.isolated if isolated is None else isolated:
        return _named(_ISOLATED)(ENGINES[name], timeout=timeout)
    return peer
