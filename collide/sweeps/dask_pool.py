"""Chunks answered by the workers of a Dask scheduler. The client alone writes files: workers need no common disk."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Iterator
from typing import Any

from collide.errors import InvalidArgument, MissingExtra

#: A chunk whose future was lost so often is given up.
MAX_LOSSES = 5
#: Dask asks a chunk again by itself where its worker died, so often.
_RETRIES = 3


class DaskPool:
    """Workers of a scheduler, answering chunks of a question.

    Parameters
    ----------
    question
        Any picklable object with ``answer(chunk)``.
    scheduler : str or distributed.Client
        Address, such as ``"tcp://10.0.0.1:8786"``, or a client, left open.
    name : str
        Name of the question, unique on these workers.
    """

    def __init__(self, question: Any, scheduler: Any, name: str):
        self._distributed = _distributed()
        self._name, self._blob = name, pickle.dumps(question, protocol=5)
        self._connects = isinstance(scheduler, str)
        try:
            self.client = self._distributed.Client(scheduler, set_as_default=False) if self._connects else scheduler
        except (OSError, ValueError) as error:
            raise InvalidArgument(f"no Dask scheduler answers at {scheduler}: {error}") from None
        self.n_workers = max(1, len(self.client.scheduler_info(n_workers=-1)["workers"]))
        self._scattered: Any = None

    def answers(self, chunks: Iterator) -> Iterator[tuple[Any, Any]]:
        """(chunk, answer) for every chunk, as they come; a few are under way at a time.

        Raises what answering raised, and InvalidArgument naming a chunk that is lost again and again.
        """
        # The loop of this client: that of another, which may be the process's default, would wait for ever or fail.
        running = self._distributed.as_completed(loop=self.client.loop)
        chunk_of: dict[Any, tuple[Any, int]] = {}
        chunks = iter(chunks)
        self._submit_some(chunks, running, chunk_of)
        while chunk_of:
            future = next(running)
            chunk, losses = chunk_of.pop(future.key)
            answer = self._result(future)
            if answer is None:
                if losses >= MAX_LOSSES:
                    raise InvalidArgument(f"{chunk}: the workers that answered it were lost {losses + 1} times")
                self._scattered = None  # it may have been what was lost
                self._submit(chunk, losses + 1, running, chunk_of)
                continue
            yield chunk, answer
            self._submit_some(chunks, running, chunk_of)

    def _submit_some(self, chunks: Iterator, running: Any, chunk_of: dict) -> None:
        for chunk in chunks:
            self._submit(chunk, 0, running, chunk_of)
            if len(chunk_of) >= 3 * self.n_workers:
                break

    def _submit(self, chunk: Any, losses: int, running: Any, chunk_of: dict) -> None:
        if self._scattered is None:
            self._scattered = self.client.scatter(self._blob, broadcast=True, hash=False)
        key = f"collide-sweep-{self._name}-{chunk.number}-{losses}"
        future = self.client.submit(
            answer_chunk, self._scattered, self._name, chunk, key=key, pure=False, retries=_RETRIES
        )
        chunk_of[future.key] = chunk, losses
        running.add(future)

    def _result(self, future: Any) -> Any:
        """The answer, or ``None`` where lost with a worker."""
        if future.status in ("cancelled", "lost"):
            return None
        try:
            return future.result()
        except (self._distributed.KilledWorker, self._distributed.CancelledError):
            return None
        finally:
            future.release()

    def close(self) -> None:
        """Leave the scheduler as it was."""
        self._scattered = None
        if self._connects:
            self.client.close()


def _distributed():
    try:
        import distributed
    except ImportError:
        raise MissingExtra("distributed", extra="sweep", purpose="sweep on Dask") from None
    return distributed


#: What this thread of a worker was asked last, by its name: checkers are no business of several threads.
_ASKED = threading.local()


def answer_chunk(blob: bytes, name: str, chunk: Any) -> Any:
    """What a worker does: the question is unpickled once."""
    if getattr(_ASKED, "name", None) != name:
        _ASKED.name, _ASKED.question = name, pickle.loads(blob)
    return _ASKED.question.answer(chunk)
