"""An engine in a child process: a crash, an abort or a hang costs the pair at hand and no more.

The parent starts ``python -m collide.adapters.peers.child module:class[:setting]``, sends one pickled job
down its input and reads pickled events back as they come, each led by its length in 8 bytes. When
the child dies or falls silent, the pair (or the body) it was at is marked failed with the reason,
and a new child goes on behind it. The child's own output is kept apart from the events: what
libraries print goes to stderr, whose last words are part of the reason.
"""

from __future__ import annotations

import os
import pickle
import queue
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from collide.adapters.peers.answers import ABORTED, BUILDING, FAILED, HUNG, STATUSES, Event
from collide.adapters.peers.protocol import Peer, Question, load_engine
from collide.shapes import Shape

_LENGTH = struct.Struct("<Q")
#: How many children a question may use up before the rest is given up.
MAX_RESTARTS = 100
#: How many characters of a dead child's stderr go into a reason.
LAST_WORDS = 240


class IsolatedPeer(Peer):
    """Any engine, asked in child processes.

    spec : ``module:class`` or ``module:class:setting`` of the engine.
    timeout : how long the child may be silent about one pair [s].
    """

    isolated = True

    def __init__(self, spec: str, *, timeout: float = 10.0, max_restarts: int = MAX_RESTARTS):
        self._spec, self._timeout, self._max_restarts = spec, timeout, max_restarts
        self._peer = load_engine(spec)
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
        lost: dict[int, tuple[str, str]] = {}
        for _ in range(self._max_restarts + 1):
            yield from _of_lost_bodies(question, unanswered, lost)
            unanswered = [k for k in unanswered if not lost.keys() & question.pairs[k]]
            if not unanswered:
                return
            building = None
            limits = self._timeout, self._peer.start_timeout
            with _child(self._spec, question, unanswered, *limits) as child:
                for event in child.events():
                    if event.kind in STATUSES:
                        unanswered.remove(event.at)
                        yield event
                    building = event.at if event.kind == BUILDING else None
                if not unanswered:
                    return
                mishap, reason = child.epitaph()
            if not child.started:
                break
            if building is None:
                yield Event(FAILED, unanswered.pop(0), None, reason, mishap=mishap)
            else:
                lost[building] = f"building {question.bodies[building].name!r}: {reason}", mishap
        else:
            reason = f"given up after {self._max_restarts} restarts; the last: {reason}"
        yield from (Event(FAILED, k, None, reason, mishap=mishap) for k in unanswered)


def _of_lost_bodies(question: Question, rows: list[int], lost: dict[int, tuple[str, str]]) -> Iterator[Event]:
    """Failures of the rows whose body could not even be built."""
    for k in rows:
        for i in question.pairs[k]:
            if i in lost:
                reason, mishap = lost[i]
                yield Event(FAILED, k, None, reason, mishap=mishap)
                break


@contextmanager
def _child(
    spec: str, question: Question, wanted: list[int], timeout: float, start_timeout: float
) -> Iterator[_Child]:
    """A child process at work on one job; its end is the end of the block."""
    with tempfile.TemporaryFile() as stderr:
        command = [sys.executable, "-m", "collide.adapters.peers.child", spec]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=stderr)
        try:
            yield _Child(process, stderr, (question, wanted), timeout, start_timeout)
        finally:
            process.kill()
            process.wait()
            assert process.stdout is not None  # it was asked for
            process.stdout.close()


class _Child:
    """The parent's end of a child process."""

    def __init__(self, process: subprocess.Popen, stderr, job: tuple, timeout: float, start_timeout: float):
        self.started, self._start_timeout = False, start_timeout
        self._process, self._stderr, self._timeout, self._silent_for = process, stderr, timeout, 0.0
        self._inbox: queue.SimpleQueue = queue.SimpleQueue()
        # Two threads, so that neither a full pipe nor a silent child can hold the parent up.
        for work in ((self._send, job), (self._receive,)):
            threading.Thread(target=work[0], args=work[1:], daemon=True).start()

    def _send(self, job: tuple) -> None:
        stdin = self._process.stdin
        assert stdin is not None  # it was asked for
        try:
            pickle.dump(sys.path, stdin)  # first, so that the rest can be unpickled
            pickle.dump(job, stdin)
            stdin.close()
        except OSError:
            pass  # the child died first, which its silence will show

    def _receive(self) -> None:
        for event in _read(self._process.stdout):
            self._inbox.put(event)
        self._inbox.put(None)

    def events(self) -> Iterator[Event]:
        """What the child reports, until it is done, dead, or silent for too long."""
        while True:
            limit = self._timeout if self.started else self._start_timeout
            try:
                event = self._inbox.get(timeout=limit)
            except queue.Empty:
                self._silent_for = limit
                return
            if event is None:
                return
            if event.kind == "ready":
                self.started = True
            else:
                yield event

    def epitaph(self) -> tuple[str, str]:
        """The mishap, and why it is over, with the child's last words."""
        if self._silent_for:
            return HUNG, f"no answer in {self._silent_for:g} s"
        code = self._process.wait()
        what = f"process ended with code {code}"
        if code < 0:
            try:
                what = f"process aborted ({signal.Signals(-code).name})"
            except ValueError:
                what = f"process aborted (signal {-code})"
        self._stderr.seek(0)
        words = last_words(self._stderr.read().decode(errors="replace"))
        return ABORTED, f"{what}: {words}" if words else what


def last_words(stderr: str) -> str:
    """What a dead process said, in one short line without folders.

    A C++ exception that nobody caught prints its message first and what it carried after it; of
    anything else the end matters most.
    """
    text = re.sub(r"(?:/[\w.+-]+)+/(?=[\w.+-])", "", " ".join(stderr.split()))
    _, separator, message = text.rpartition("what(): ")
    return message[:LAST_WORDS] if separator else text[-LAST_WORDS:]


def _read(stream) -> Iterator[Event]:
    """Events from a pipe, until it closes; half of one, left by a crash, counts as none."""
    while True:
        try:
            head = stream.read(_LENGTH.size)
            body = stream.read(*_LENGTH.unpack(head)) if len(head) == _LENGTH.size else b""
        except (OSError, ValueError):
            return
        if len(head) < _LENGTH.size or len(body) < _LENGTH.unpack(head)[0]:
            return
        yield pickle.loads(body)


def main(spec: str) -> None:
    """The child: read a job, answer it pair by pair."""
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not mix with the events

    def send(event: Event) -> None:
        body = pickle.dumps(event)
        pipe.write(_LENGTH.pack(len(body)) + body)
        pipe.flush()

    sys.path[:] = pickle.load(sys.stdin.buffer)
    peer = load_engine(spec)
    question, wanted = pickle.load(sys.stdin.buffer)
    peer.prepare()
    send(Event("ready", 0))
    for event in peer.stream(question, wanted):
        send(event)


if __name__ == "__main__":
    main(sys.argv[1])
