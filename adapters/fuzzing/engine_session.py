"""An engine in a child process that stays alive from question to question, and is started anew where it dies.

The child reads pickled jobs and writes pickled messages, each led by its length in 8 bytes. A crash, an abort or a
silence longer than the time limit costs the pair at hand; the reason says which it was.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

from collide.adapters.peers import protocol
from collide.adapters.peers.answers import ABORTED, FAILED, HUNG, STATUSES, Event, Table
from collide.adapters.peers.child import last_words
from collide.adapters.peers.question import Question

_LENGTH = struct.Struct("<Q")
#: Deaths without a single answer between them, after which an engine is given up for the question at hand.
MAX_IDLE_DEATHS = 5


class EngineSession:
    """One engine, asked question after question.

    Parameters
    ----------
    name : str
        A name of `collide.adapters.peers.protocol.ENGINES`.
    timeout : float
        How long it may be silent about one pair [s].
    """

    def __init__(self, name: str, timeout: float = 5.0):
        self.name, self.timeout = name, timeout
        peer = protocol.engine(name, isolated=False)
        self.version, self._start_timeout = peer.version, peer.start_timeout
        self._process: subprocess.Popen | None = None
        self.starts = 0

    def answer(self, question: Question) -> Table:
        """The engine's table for a question of unrelated pairs.

        Parameters
        ----------
        question : Question
            Bodies and pairs.

        Returns
        -------
        Table
            A row a pair; where the engine died or fell silent the row has failed, with the reason.
        """
        table, idle = Table(question, self.name, self.version), 0
        unanswered = list(range(len(question.pairs)))
        while unanswered:
            before = len(unanswered)
            self._start()
            mishap, reason = self._ask(question, unanswered, table)
            if not unanswered:
                break
            idle = idle + 1 if before == len(unanswered) else 0
            lost = unanswered if idle > MAX_IDLE_DEATHS else unanswered[:1]
            for k in list(lost):
                table.record(Event(FAILED, k, None, reason, mishap=mishap))
                unanswered.remove(k)
        return table

    @contextmanager
    def hurried(self, seconds: float) -> Iterator[None]:
        """With a shorter time limit for a while.

        Parameters
        ----------
        seconds : float
            The limit, where it is below the session's own [s].
        """
        patient, self.timeout = self.timeout, min(self.timeout, seconds)
        try:
            yield
        finally:
            self.timeout = patient

    def close(self) -> None:
        """End the child."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                try:
                    pipe.close()  # type: ignore[union-attr]  # both were asked for
                except OSError:
                    pass  # what was still to be written to a dead child
            self._stderr.close()
            self._process = None

    def _start(self) -> None:
        if self._process is not None:
            return
        self.starts += 1
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - it is closed with the child
        command = [sys.executable, "-m", "collide.adapters.fuzzing.engine_session", self.name]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._stderr
        )
        self._inbox: queue.SimpleQueue = queue.SimpleQueue()
        # A thread, so that a silent child cannot hold the parent up.
        threading.Thread(target=_receive, args=(self._process.stdout, self._inbox), daemon=True).start()
        self._ready = False

    def _ask(self, question: Question, unanswered: list[int], table: Table) -> tuple[str, str]:
        """Send what is unanswered, and record what comes; the mishap that ended the child, and the reason."""
        assert self._process is not None and self._process.stdin is not None
        try:
            if not self._ready:
                _write(self._process.stdin, (sys.path, dict(protocol.ENGINES)))
            _write(self._process.stdin, (question, list(unanswered)))
        except OSError:
            pass  # it died before: what it said last is read below
        while True:
            limit = self.timeout if self._ready else self._start_timeout
            try:
                message = self._inbox.get(timeout=limit)
            except queue.Empty:
                self.close()
                return HUNG, f"no answer in {limit:g} s"
            if message is None:
                return self._epitaph()
            if message == "done":
                return "", ""
            if message == "ready":
                self._ready = True
            elif message.kind in STATUSES:
                unanswered.remove(message.at)
                table.record(message)

    def _epitaph(self) -> tuple[str, str]:
        """The mishap, and why the child is dead, with its last words."""
        assert self._process is not None
        code = self._process.wait()
        name = f"code {code}"
        if code < 0:
            name = signal.Signals(-code).name if -code in list(signal.Signals) else f"signal {-code}"
        self._stderr.seek(0)
        words = last_words(self._stderr.read().decode(errors="replace"))
        self.close()
        return ABORTED, f"process ended ({name})" + (f": {words}" if words else "")


def _write(pipe: IO[bytes], value: Any) -> None:
    body = pickle.dumps(value)
    pipe.write(_LENGTH.pack(len(body)) + body)
    pipe.flush()


def _read(pipe: IO[bytes]) -> Iterator[Any]:
    """Messages, until the pipe closes; half of one, left by a crash, counts as none."""
    while True:
        try:
            head = pipe.read(_LENGTH.size)
            body = pipe.read(*_LENGTH.unpack(head)) if len(head) == _LENGTH.size else b""
        except (OSError, ValueError):
            return
        if len(head) < _LENGTH.size or len(body) < _LENGTH.unpack(head)[0]:
            return
        yield pickle.loads(body)


def _receive(pipe: IO[bytes], inbox: queue.SimpleQueue) -> None:
    for message in _read(pipe):
        inbox.put(message)
    inbox.put(None)


def main(name: str) -> None:
    """The child: answer questions until there are no more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not mix with the messages
    jobs = _read(sys.stdin.buffer)
    sys.path[:], engines = next(jobs)
    protocol.ENGINES.update(engines)
    peer = protocol.engine(name, isolated=False)
    peer.prepare()
    _write(answers, "ready")
    for question, wanted in jobs:
        for event in peer.stream(question, wanted):
            _write(answers, event)
        _write(answers, "done")


if __name__ == "__main__":
    main(sys.argv[1])
