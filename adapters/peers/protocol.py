"""One protocol for every engine: the same `Question` goes in, the same `Table` comes out.

    from collide.adapters.peers.protocol import engine, Question
    table = engine("coal").answer(Question.from_pairs([(A, B, X_WA, X_WB)]))
    table.rows["hit"], table.rows["distance"], table.reasons

Signs and directions are converted here and in the peers' own files, nowhere else: `distance` is
signed, negative inside; `normal` is the unit vector nhat_AB_W from A towards B.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.peers.answers import (
    ANSWERED,
    ASKING,
    BUILDING,
    FAILED,
    STATUSES,
    TABLE_DTYPE,
    UNSUPPORTED,
    Event,
    Reply,
    Table,
    nearest,
)
from collide.adapters.peers.engine_names import ENGINES
from collide.adapters.peers.question import Body, Question, convex_parts
from collide.errors import CollideError, InvalidArgument, MissingExtra, UnsupportedQuery
from collide.shapes import ConvexHull, Shape

__all__ = [
    "ENGINES", "TABLE_DTYPE", "Body", "PairwisePeer", "Peer", "Question", "Reply", "Setting", "Table", "engine",
    "installed",
]

#: Asks one of them in a child process.
_ISOLATED = "collide.adapters.peers.child:IsolatedPeer"
_version = cache(metadata.version)  # it reads a file, and every table asks


class Setting(NamedTuple):
    """Another way to ask an engine than its plain one.

    about : which calls are asked, and how, in one line, as `Peer.about`.
    values : what the engine's own file reads, by name.
    receives, cannot : in place of the engine's `Peer.receives` and `Peer.cannot`; None where they stay.
    """

    about: str
    values: Mapping[str, Any] = {}
    receives: tuple[str, ...] | None = None
    cannot: tuple[str, ...] | None = None


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
    extra
        The extra that brings it.
    about
        Which of its calls are asked, in one line.
    receives
        What it was really given: how its input differs from the question, sentence by sentence.
    cannot
        What it cannot answer, sentence by sentence.
    settings
        Other ways to ask it, by name.
    start_timeout
        How long a child process may take until the engine is ready [s].

    Parameters
    ----------
    setting : str
        One of `settings`; empty for the plain way.

    Raises
    ------
    InvalidArgument
        For an unknown setting.
    """

    name = ""
    package: str | None = None
    module: str | None = None
    isolated = False
    hint = ""
    extra = "peers"
    about = ""
    receives: tuple[str, ...] = ()
    cannot: tuple[str, ...] = ()
    settings: Mapping[str, Setting] = {}
    start_timeout = 60.0

    def __init__(self, setting: str = ""):
        self.values: Mapping[str, Any] = {}
        if not setting:
            return
        if setting not in self.settings:
            raise InvalidArgument(f"{self.name} has no setting {setting!r}; there are {', '.join(self.settings)}")
        named = self.settings[setting]
        self.name = f"{self.name}:{setting}"
        self.about, self.values = named.about, named.values
        self.receives = self.receives if named.receives is None else named.receives
        self.cannot = self.cannot if named.cannot is None else named.cannot

    @property
    def version(self) -> str:
        """The engine's version, without importing it."""
        try:
            return _version(self.package or "collide-robotics")
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
            raise MissingExtra(str(self.package), extra=self.extra, purpose=f"ask the engine {self.name!r}")

    def prepare(self) -> None:
        """Do what counts as starting, not as the first pair's time: import the engine."""
        if self.module is not None:
            import_module(self.module)

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


    def staying(self) -> AbstractContextManager[None]:
        """Keep what answers, such as a child process, from question to question.

        Returns
        -------
        context manager
            At its end what was kept is let go.
        """
        return nullcontext()


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


def complaint(error: BaseException) -> str:
    """An exception in one line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {' '.join(lines)}"[:300] if lines else type(error).__name__


def has_radius(part: Shape) -> bool:
    """True for a hull with a ball around it, which most engines do not have."""
    return isinstance(part, ConvexHull) and part.radius > 0


def load_engine(spec: str) -> Peer:
    """The engine that a ``module:class`` or ``module:class:setting`` text names."""
    module, kind, setting = (*spec.split(":"), "")[:3]
    return _named(f"{module}:{kind}")(setting) if setting else _named(spec)()


def _named(spec: str) -> Any:
    """A class that is found when it is first needed, as engines are: `ENGINES`."""
    module, _, name = spec.partition(":")
    return getattr(import_module(module), name)


def installed() -> list[str]:
    """Names of `ENGINES` whose packages are there, in the table's order.

    Returns
    -------
    list of str
        collide and exact among them.
    """
    return [name for name, spec in ENGINES.items() if not load_engine(spec).missing()]


def check_names(names: Iterable[str]) -> None:
    """Complain about a name that is not in `ENGINES`; InvalidArgument lists those that are."""
    for name in names:
        if name not in ENGINES:
            settings = {base: [s for b, _, s in (n.partition(":") for n in sorted(ENGINES)) if b == base and s]
                        for base in sorted({n.partition(":")[0] for n in ENGINES})}
            listed = (f"{base} (:{', :'.join(of)})" if of else base for base, of in settings.items())
            raise InvalidArgument(f"no engine {name!r}; there are {', '.join(listed)}")


def engine(name: str, *, isolated: bool | None = None, timeout: float = 10.0) -> Peer:
    """An engine by its name in `ENGINES`.

    Parameters
    ----------
    name : str
        For example "coal", or "coal:nesterov".
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
    check_names([name])
    peer = load_engine(ENGINES[name])
    if peer.isolated if isolated is None else isolated:
        return _named(_ISOLATED)(ENGINES[name], timeout=timeout)
    return peer
