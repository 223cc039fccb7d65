"""Chunks answered by processes of this machine; one that dies is replaced, and its chunk alone is asked again."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

from collide.errors import InvalidArgument
from collide.sweeps.pool_worker import read_frame, write_frame

#: A chunk at which so many processes died is given up.
MAX_DEATHS = 3


class ProcessPool:
    """Processes that answer chunks of one question.

    Parameters
    ----------
    question
        Anything that pickles and has ``answer(chunk)``.
    workers : int
        How many processes.
    """

    def __init__(self, question: Any, workers: int):
        self.n_workers = workers
        self._question = pickle.dumps(question, protocol=5)
        self._chunks: queue.SimpleQueue = queue.SimpleQueue()
        self._answers: queue.SimpleQueue = queue.SimpleQueue()
        self._processes: dict[int, subprocess.Popen] = {}
        self._closed = False
        self._threads = [threading.Thread(target=self._serve, args=(k,), daemon=True) for k in range(workers)]
        for thread in self._threads:
            thread.start()

    def answers(self, chunks: Iterator) -> Iterator[tuple[Any, Any]]:
        """(chunk, answer) for every chunk, as they come; a few are under way at a time.

        Raises what answering raised, and InvalidArgument naming a chunk that ends the processes that answer it.
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
        """One thread for each process: it waits where the process works."""
        while (chunk := self._chunks.get()) is not None:
            if self._closed:
                break
            try:
                self._answers.put((chunk, self._ask(place, chunk)))
            except BaseException as error:  # noqa: BLE001 - raised where answers are waited for
                self._answers.put((chunk, error))
        with contextlib.suppress(KeyError):
            _end(self._processes.pop(place))

    def _ask(self, place: int, chunk: Any) -> Any:
        for _ in range(MAX_DEATHS):
            try:
                process = self._processes.get(place) or self._start(place)
                write_frame(process.stdin, pickle.dumps(chunk, protocol=5))  # type: ignore[arg-type]
                fine, answer = pickle.loads(read_frame(process.stdout))  # type: ignore[arg-type]
            except (EOFError, OSError):
                if self._closed:
                    break
                _end(self._processes.pop(place))
                continue
            if not fine:
                raise answer
            return answer
        raise InvalidArgument(
            f"{chunk}: {MAX_DEATHS} processes ended while they answered it; look for the reason in what they wrote, "
            "for the system's out-of-memory messages, or use fewer workers"
        )

    def _start(self, place: int) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, "-m", "collide.sweeps.pool_worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )  # fmt: skip
        self._processes[place] = process
        write_frame(process.stdin, self._question)  # type: ignore[arg-type]
        return process


def _end(process: subprocess.Popen) -> None:
    process.kill()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()
    process.wait()
