"""Threads are used where they help, and change nothing: counted, with clocks of the tests' own."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.base import threads as workers
from collide.errors import InvalidArgument, InvalidPose

EYE = np.eye(4)


class Clocks:
    """Seconds that pass only while units are worked on, and how much of them a thread was at work."""

    def __init__(self, monkeypatch, busy: float):
        self.now, self.busy = {}, busy
        told = SimpleNamespace(perf_counter=self.wall, thread_time=lambda: busy * self.wall())
        monkeypatch.setattr(workers, "time", told)

    def wall(self) -> float:
        return self.now.get(threading.get_ident(), 0.0)

    def work(self, seconds: float) -> None:
        self.now[threading.get_ident()] = self.wall() + seconds


def shared(monkeypatch, n: int, seconds: float, busy: float, count: int = 2) -> tuple[list[slice], list[slice]]:
    """(pieces of the caller, of helpers) of n units that take so long each; a helper comes first wherever it may."""
    clocks, caller, mine, theirs = Clocks(monkeypatch, busy), threading.get_ident(), [], []
    submitted, taken = [], threading.Event()
    real = workers._pool(count - 1)
    monkeypatch.setattr(
        workers, "_pool", lambda _n: SimpleNamespace(submit=lambda f: submitted.append(f) or real.submit(f))
    )

    def work(piece: slice) -> None:
        own = threading.get_ident() == caller
        (mine if own else theirs).append(piece)
        if own and submitted:
            assert taken.wait(60), "no helper came"
        clocks.work(seconds * (piece.stop - piece.start))
        if not own:
            taken.set()

    workers.share_if_it_helps(n, work, count)
    assert len(submitted) in (0, count - 1)
    done = sorted((piece.start, piece.stop) for piece in mine + theirs)
    assert [start for start, _ in done] == [0, *(stop for _, stop in done[:-1])] and done[-1][1] == n
    return mine, theirs


@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 1000])
def test_little_work_is_done_by_the_caller_in_two_pieces(monkeypatch, n):
    mine, theirs = shared(monkeypatch, n, seconds=40e-3 / n, busy=1.0)
    assert len(mine) <= 2 and not theirs


def test_a_helper_that_waits_leaves_and_the_caller_cuts_no_more_pieces(monkeypatch):
    mine, theirs = shared(monkeypatch, 10_000, seconds=1e-3, busy=0.5)
    assert len(theirs) == 1, "it takes one piece to see that it only waits"
    assert len(mine) <= 4 and max(piece.stop - piece.start for piece in mine) > 5000


def test_a_helper_that_is_at_work_stays(monkeypatch):
    mine, theirs = shared(monkeypatch, 10_000, seconds=1e-3, busy=0.9)
    assert len(mine) + len(theirs) > 50 and theirs
    assert max(piece.stop - piece.start for piece in theirs) * 1e-3 <= workers._LONGEST


def test_an_error_stops_all_and_leaves_no_thread_at_work(monkeypatch):
    monkeypatch.setattr(workers, "_ALONE", 0.0)
    at_work = []

    def work(piece: slice) -> None:
        at_work.append(1)
        try:
            if piece.start > 100:
                raise InvalidPose("of a piece")
        finally:
            at_work.pop()

    with pytest.raises(InvalidPose, match="of a piece"):
        workers.share_if_it_helps(10_000, work, 3)
    assert not at_work


def bodies(rng) -> list[collide.Shape]:
    box, ball = collide.Box((0.8, 1, 0.5)), collide.Sphere(0.4)
    hulls = [collide.ConvexHull(rng.normal(size=(n, 3)) * 0.4) for n in (12, 40)]
    meshes = [collide.Mesh(hull.points, hull.hull.facets) for hull in hulls]
    union = collide.Compound([(box, EYE), (ball, random_pose(rng, 0.5))])
    return [box, ball, *meshes, union, collide.Compound([(meshes[0], EYE), (ball, random_pose(rng, 0.5))])]


def test_lists_with_meshes_and_unions_give_the_same_bits_in_threads(monkeypatch):
    for name, value in (("_ALONE", 0.0), ("_SHORTEST", 1e-4), ("_LONGEST", 1e-3), ("_GAIN", 0.0)):
        monkeypatch.setattr(workers, name, value)
    rng, used = rng_of("lists in threads"), set()
    shapes, n = bodies(rng), 200
    A, B = ([shapes[k] for k in rng.integers(len(shapes), size=n)] for _ in range(2))
    X_WA, X_WB = (np.array([random_pose(rng, 1.2) for _ in range(n)]) for _ in range(2))
    share = workers._Rest.share
    monkeypatch.setattr(
        workers._Rest, "share", lambda self, *given: used.add(threading.get_ident()) or share(self, *given)
    )
    hits = collide.collide(A, B, X_WA, X_WB)
    assert 20 < hits.sum() < 180 and not used
    one = collide.distance(A, B, X_WA, X_WB, signed=False)
    assert np.array_equal(collide.collide(A, B, X_WA, X_WB, threads=3), hits)
    threaded = collide.distance(A, B, X_WA, X_WB, signed=False, threads=3)
    assert threaded.rows.tobytes() == one.rows.tobytes() and len(used) > 1
    assert all(np.array_equal(a, b) for a, b in zip(threaded.question[2:], (X_WA, X_WB)))
    for k in range(0, n, 20):
        alone = collide.distance(A[k], B[k], X_WA[k], X_WB[k], signed=False)
        assert alone.rows.tobytes() == one.rows[k : k + 1].tobytes(), k
    X_WB[77] *= 1.5
    for threads in (1, 3):
        with pytest.raises(InvalidPose, match=r"X_WB\[77\]"):
            collide.collide(A, B, X_WA, X_WB, threads=threads)


@pytest.mark.parametrize(
    "threads",
    [0, -1, 10**400, -(10**5000), True, 1.0, 2.5, "2", None, np.ones(2), float("inf")],
    ids=lambda value: type(value).__name__,
)
def test_numbers_of_threads_that_are_none_are_refused(threads):
    box, many = collide.Box((1, 1, 1)), np.tile(EYE, (3, 1, 1))
    collide.collide(box, box, EYE, EYE)  # prepared for single calls
    for X in (EYE, many):
        for ask in (collide.collide, collide.distance):
            with pytest.raises(InvalidArgument, match="threads"):
                ask(box, box, EYE, X, threads=threads)
    with pytest.raises(InvalidArgument, match="threads"):
        collide.collide(box, box, EYE, EYE, threads=threads, algorithm="barba-langerman")
    for number in (1, np.int64(1), np.uint8(2), 10**9):
        assert collide.collide(box, box, EYE, EYE, threads=number)
