"""An engine in a child process: a crash, an abort or a hang costs the pair at hand and no more.

When the child dies or falls silent, the pair (or the body) it was at is marked failed with the reason, and a new child
goes on behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager

from collide.adapters.peers.answers import ABORTED, BUILDING, FAILED, HUNG, STATUSES, Event
from collide.adapters.peers.protocol import Peer, Question, load_engine
from collide.base.child_process import ChildProcess
from collide.shapes import Shape

#: How many children a question may use up before the rest is given up.
MAX_RESTARTS = 100
#: What a child tells besides an engine's events: it is about to answer, and it has.
_READY, _DONE = "ready", "done"
#: The last event of a child that died or fell silent, with mishap and reason.
_ENDED = "ended"


class IsolatedPeer(Peer):
    """Any engine, asked in child processes.

    spec : ``module:class`` or ``module:class:setting`` of the engine.
    timeout : how long the child may be silent about one pair [s].
    max_restarts : children that a question may use up.
    """

    isolated = True
    #: Whether the child stays from question to question, until `close`: always, or within `staying`.
    _stays = False
    #: Whether only children that answered nothing count for `max_restarts`.
    _counts_idle_deaths = False

    def __init__(self, spec: str, *, timeout: float = 10.0, max_restarts: int = MAX_RESTARTS):
        self._spec, self.timeout, self._max_restarts = spec, timeout, max_restarts
        self._peer = load_engine(spec)
        self._child: ChildProcess | None = None
        self._started = False
        #: How many children were started.
        self.starts = 0
        names = "name", "package", "module", "hint", "extra", "about", "receives", "cannot", "settings", "values"
        for attribute in names:
            setattr(self, attribute, getattr(self._peer, attribute))

    @property
    def version(self) -> str:
        return self._peer.version

    def missing(self) -> str | None:
        return self._peer.missing()

    def supports(self, shape: Shape) -> str | None:
        return self._peer.supports(shape)

    def stream(self, question: Question, wanted: Iterable[int]) -> Iterator[Event]:
        unanswered = list(wanted)
        lost: dict[int, Event] = {}
        deaths = 0
        while True:
            yield from _of_lost_bodies(question, unanswered, lost)
            unanswered = [k for k in unanswered if not lost.keys() & question.pairs[k]]
            if not unanswered:
                return
            building, before = None, len(unanswered)
            with closing(self._events(question, unanswered)) as events:
                for event in events:
                    if event.kind in STATUSES:
                        unanswered.remove(event.at)
                        yield event
                    if event.kind != _ENDED:
                        building = event.at if event.kind == BUILDING else None
            if not unanswered:
                return
            deaths = 0 if self._counts_idle_deaths and len(unanswered) < before else deaths + 1
            if not self._started or deaths > self._max_restarts:
                break
            if building is None:
                yield _failed(unanswered.pop(0), event)
            else:
                lost[building] = event._replace(reason=f"building {question.bodies[building].name!r}: {event.reason}")
        if self._started:
            event = event._replace(reason=f"given up after {self._max_restarts} restarts; the last: {event.reason}")
        yield from (_failed(k, event) for k in unanswered)

    def _events(self, question: Question, rows: list[int]) -> Generator[Event, None, None]:
        """What a child tells about rows, until it has answered them; the last event says so, or that it ended."""
        kind = ""
        try:
            if self._child is None:
                self._child, self._started = ChildProcess(f"{__name__}:answer_questions", self._spec), False
                self.starts += 1
            self._child.send((question, rows))
            while kind not in (_DONE, _ENDED):
                event = self._next(self._child)
                kind = event.kind
                yield event
        finally:
            if kind != _DONE or not self._stays:
                self.close()

    def _next(self, child: ChildProcess) -> Event:
        limit = self.timeout if self._started else self._peer.start_timeout
        try:
            event = child.receive(limit)
        except TimeoutError:
            return Event(_ENDED, 0, reason=f"no answer in {limit:g} s", mishap=HUNG)
        except EOFError:
            return Event(_ENDED, 0, reason=child.how_it_ended(), mishap=ABORTED)
        self._started = True
        return event

    @contextmanager
    def staying(self) -> Iterator[None]:
        stayed, self._stays = self._stays, True
        try:
            yield
        finally:
            self._stays = stayed
            self.close()

    def close(self) -> None:
        """End the child."""
        if self._child is not None:
            self._child.close()
            self._child = None


def _failed(row: int, end: Event) -> Event:
    return Event(FAILED, row, None, end.reason, mishap=end.mishap)


def _of_lost_bodies(question: Question, rows: list[int], lost: dict[int, Event]) -> Iterator[Event]:
    """Failures of the rows whose body could not even be built."""
    for k in rows:
        for i in question.pairs[k]:
            if i in lost:
                yield _failed(k, lost[i])
                break


def answer_questions(
    questions: Iterator[tuple[Question, list[int]]], send: Callable[[Event], None], spec: str
) -> None:
    """The child: answer questions pair by pair."""
    peer = load_engine(spec)
    peer.prepare()
    send(Event(_READY, 0))
    for question, rows in questions:
        for event in peer.stream(question, rows):
            send(event)
        send(Event(_DONE, 0))
