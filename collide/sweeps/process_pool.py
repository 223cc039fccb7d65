"""Chunks answered by processes of this machine; a dead process is replaced, and its chunk alone is asked again.

A `distributed.LocalCluster` with `DaskPool` would do the same, but a script calling a `LocalCluster` needs
``if __name__ == "__main__"``, and 40 MB of packages. Measured with two workers on two cores: a `LocalCluster` took
4.8 to 6.3 s for 100 rows, this pool 1.2 to 1.8 s; for 400,000 rows in chunks of 1,000 the times were 13 to 17 s and
4.2 to 6.0 s.
"""

from __future__ import annotations

import pickle
import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any

from collide.base.child_process import ChildProcess
from collide.errors import InvalidArgument

#: A chunk at which so many processes died is given up.
MAX_DEATHS = 3


class ProcessPool:
    """Processes, answering chunks of a question.

    Parameters
    ----------
    question
        Any picklable object with ``answer(chunk)``.
    workers : int
        Number of processes.
    """

    def __init__(self, question: Any, workers: int):
        self.n_workers = workers
        self._question = pickle.dumps(question, protocol=5)
        self._chunks: queue.SimpleQueue = queue.SimpleQueue()
        self._answers: queue.SimpleQueue = queue.SimpleQueue()
        self._processes: dict[int, ChildProcess] = {}
        self._closed = False
        self._threads = [threading.Thread(target=self._serve, args=(k,), daemon=True) for k in range(workers)]
        for thread in self._threads:
            thread.start()

    def answers(self, chunks: Iterator) -> Iterator[tuple[Any, Any]]:
        """(chunk, answer) for every chunk, as answers come; a few chunks are under way at a time.

        Raises errors of answering, and InvalidArgument naming a chunk whose processes die.
        """
        waiting = 0
        chunks = iter(chunks)
        for chunk in chunks:
            self._chunks.put(chunk)
            waiting += 1
            if waiting >= 2 * self.n_workers:
                yield self._next()
                waiting -= 1
        for _ in range(waiting):
            yield self._next()

    def _next(self) -> tuple[Any, Any]:
        chunk, answer = self._answers.get()
        if isinstance(answer, BaseException):
            raise answer
        return chunk, answer

    def pids(self) -> list[int]:
        """Numbers of the processes."""
        return [process.pid for process in list(self._processes.values())]

    def close(self) -> None:
        """End the processes."""
        self._closed = True
        for _ in self._threads:
            self._chunks.put(None)
        for process in list(self._processes.values()):
            process.kill()
        for thread in self._threads:
            thread.join(timeout=10)

    def _serve(self, place: int) -> None:
        """A thread for each process: the thread waits while the process works."""
        while (chunk := self._chunks.get()) is not None:
            if self._closed:
                break
            try:
                self._answers.put((chunk, self._ask(place, chunk)))
            except BaseException as error:  # noqa: BLE001 - raised where answers are waited for
                self._answers.put((chunk, error))
        if place in self._processes:
            self._processes.pop(place).close()

    def _ask(self, place: int, chunk: Any) -> Any:
        reason = ""
        for _ in range(MAX_DEATHS):
            if place not in self._processes:
                self._processes[place] = ChildProcess(f"{__name__}:answer_chunks", self._question, keep_stderr=False)
            process = self._processes[place]
            process.send(chunk)
            try:
                fine, answer = process.receive()
            except EOFError:
                if self._closed:
                    break
                reason = process.how_it_ended()
                self._processes.pop(place).close()
                continue
            if not fine:
                raise answer
            return answer
        raise InvalidArgument(
            f"{chunk}: {MAX_DEATHS} processes ended while they answered it, the last so: {reason}; look for the reason "
            "in what they wrote, for the system's out-of-memory messages, or use fewer workers"
        )


# --- in a process of the pool: it writes no file, so that it may be killed at any time ----------------


def answer_chunks(chunks: Iterator, send: Callable[[Any], None], blob: bytes) -> None:
    """Send ``(True, columns)`` for each chunk, or ``(False, error)`` where answering failed."""
    question = _question(blob)
    for chunk in chunks:
        answer: tuple[bool, Any]
        try:
            answer = True, question.answer(chunk)
        except Exception as error:  # noqa: BLE001 - whatever it is, the process that asked tells it
            answer = False, error
        try:
            send(answer)
        except OSError:
            return  # nobody is there
        except Exception as error:  # noqa: BLE001 - an error that does not pickle is told in words
            send((False, RuntimeError(f"{type(answer[1]).__name__}: {answer[1]} ({error})")))


class _Unreadable:
    """Stands for a question that this process cannot read."""

    def __init__(self, error: Exception):
        self._error = error

    def answer(self, chunk: Any) -> Any:
        raise InvalidArgument(
            f"the processes of a sweep cannot read what they are asked: {self._error}; a class of your own "
            "must be of a module that they can import, not of the script itself"
        )


def _question(blob: bytes) -> Any:
    try:
        return pickle.loads(blob)
    except Exception as error:  # noqa: BLE001 - told at each chunk
        return _Unreadable(error)
