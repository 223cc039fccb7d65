"""Chunks asked of a Dask client that answers in this process: under way, lost, asked again, given up."""

from __future__ import annotations

import pickle
from types import SimpleNamespace

import pytest

from collide import InvalidArgument
from collide.sweeps import dask_pool
from collide.sweeps.dask_pool import MAX_LOSSES, DaskPool, answer_chunk
from collide.sweeps.sweep_question import Chunk


class KilledWorker(Exception):
    pass


class CancelledError(Exception):
    pass


class Question:
    """Twice the number of a chunk, with a factor of its own."""

    def __init__(self, factor: int = 2):
        self.factor = factor

    def answer(self, chunk: Chunk) -> int:
        return self.factor * chunk.number


class Future:
    def __init__(self, client, key: str, answer):
        self.client, self.key, self._answer, self.is_released = client, key, answer, False
        self.status = answer if answer in ("lost", "cancelled") else "finished"

    def result(self):
        assert self.status == "finished"
        if isinstance(self._answer, type):
            raise self._answer(self.key)
        return self._answer

    def release(self) -> None:
        self.is_released = True


class Client:
    """losses : of each chunk's number, what becomes of it one time after the other before it is answered."""

    loop = "its loop"

    def __init__(self, workers: int = 2, losses=None):
        self.workers, self.losses = workers, {number: list(many) for number, many in (losses or {}).items()}
        self.scattered, self.futures, self.is_closed = [], [], False

    def scheduler_info(self, n_workers: int = 5) -> dict:
        return {"workers": dict.fromkeys(range(self.workers if n_workers == -1 else min(n_workers, self.workers)))}

    def scatter(self, blob, broadcast, hash):
        assert broadcast and not hash
        self.scattered.append(blob)
        return blob

    def submit(self, function, blob, name, chunk, key, pure, retries):
        assert function is answer_chunk and not pure and retries > 0 and blob is self.scattered[-1]
        assert key not in [future.key for future in self.futures]
        losses = self.losses.get(chunk.number)
        self.futures.append(Future(self, key, losses.pop(0) if losses else function(blob, name, chunk)))
        return self.futures[-1]

    def close(self) -> None:
        self.is_closed = True


class Completed:
    """`distributed.as_completed` of what is done at once; the most that were waiting at a time."""

    largest = 0

    def __init__(self, loop):
        assert loop == Client.loop
        self.waiting = []

    def add(self, future) -> None:
        self.waiting.append(future)
        Completed.largest = max(Completed.largest, len(self.waiting))

    def __next__(self):
        return self.waiting.pop(0)


@pytest.fixture(autouse=True)
def distributed(monkeypatch):
    def connect(address, set_as_default):
        assert not set_as_default
        if address == "tcp://nowhere":
            raise OSError("nobody is there")
        return Client()

    module = SimpleNamespace(
        as_completed=Completed, Client=connect, KilledWorker=KilledWorker, CancelledError=CancelledError
    )
    monkeypatch.setattr(dask_pool, "_distributed", lambda: module)
    monkeypatch.setattr(Completed, "largest", 0)
    for name in ("name", "question"):
        monkeypatch.setattr(dask_pool._ASKED, name, None, raising=False)


def chunks(n: int):
    return (Chunk(k, 10 * k, 10 * k + 10, []) for k in range(n))


@pytest.mark.parametrize(("workers", "most"), [(0, 3), (1, 3), (2, 6), (7, 20)])
def test_three_chunks_a_worker_are_under_way_and_all_are_answered(workers, most):
    client = Client(workers)
    pool = DaskPool(Question(), client, "sweep")
    assert pool.n_workers == max(workers, 1)
    answers = {chunk.number: answer for chunk, answer in pool.answers(chunks(20))}
    assert answers == {k: 2 * k for k in range(20)} and Completed.largest == most
    assert len(client.scattered) == 1 and all(future.is_released for future in client.futures[:20])
    assert client.futures[3].key == "collide-sweep-sweep-3-0"
    pool.close()
    assert not client.is_closed


@pytest.mark.parametrize("how", ["lost", "cancelled", KilledWorker, CancelledError])
def test_a_chunk_lost_with_its_worker_is_asked_again_with_the_question_sent_anew(how):
    client = Client(losses={1: [how] * MAX_LOSSES, 3: [how]})
    answers = {chunk.number: answer for chunk, answer in DaskPool(Question(), client, "s").answers(chunks(5))}
    assert answers == {k: 2 * k for k in range(5)} and len(client.scattered) == 1 + MAX_LOSSES + 1
    keys = [future.key for future in client.futures]
    assert [key for key in keys if key.startswith("collide-sweep-s-1-")] == [
        f"collide-sweep-s-1-{losses}" for losses in range(MAX_LOSSES + 1)
    ]


def test_a_chunk_that_is_lost_too_often_is_named():
    client = Client(losses={1: [KilledWorker] * 99})
    words = f"chunk 1, rows 10 to 19: the workers that answered it were lost {MAX_LOSSES + 1} times"
    with pytest.raises(InvalidArgument, match=words):
        list(DaskPool(Question(), client, "s").answers(chunks(2)))
    assert len(client.futures) == 1 + MAX_LOSSES + 1


def test_errors_of_answering_are_raised_as_they_are():
    client = Client(losses={1: [ZeroDivisionError]})
    with pytest.raises(ZeroDivisionError):
        list(DaskPool(Question(), client, "s").answers(chunks(2)))


def test_a_client_that_the_pool_made_is_closed_with_it():
    pool = DaskPool(Question(), "tcp://somewhere", "s")
    assert len(list(pool.answers(chunks(3)))) == 3
    pool.close()
    assert pool.client.is_closed
    with pytest.raises(InvalidArgument, match="no Dask scheduler answers at tcp://nowhere: nobody is there"):
        DaskPool(Question(), "tcp://nowhere", "s")


def test_a_worker_reads_a_question_once():
    chunk = Chunk(3, 0, 1, [])
    assert answer_chunk(pickle.dumps(Question(2)), "one", chunk) == 6
    assert answer_chunk(b"not read", "one", chunk) == 6
    assert answer_chunk(pickle.dumps(Question(5)), "two", chunk) == 15
    assert answer_chunk(pickle.dumps(Question(7)), "one", chunk) == 21
