"""A lock that one thread holds, and that a child forked meanwhile finds open."""

from __future__ import annotations

import os
import threading

import pytest

from collide.base.fork_safe_lock import ForkSafeLock


def taken_elsewhere(lock: ForkSafeLock) -> bool:
    """Whether another thread has to wait for it."""
    answers = []

    def ask() -> None:
        free = lock().acquire(blocking=False)
        answers.append(not free)
        if free:
            lock().release()

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return answers[0]


def test_one_thread_holds_it_as_often_as_it_likes():
    lock = ForkSafeLock()
    assert not taken_elsewhere(lock)
    with lock():
        with lock():
            assert taken_elsewhere(lock)
        assert taken_elsewhere(lock)
    assert not taken_elsewhere(lock)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_child_finds_it_open_and_the_parent_keeps_it():
    lock, held, done = ForkSafeLock(), threading.Event(), threading.Event()

    def hold() -> None:
        with lock():
            held.set()
            done.wait(60)

    holder = threading.Thread(target=hold)
    holder.start()
    try:
        assert held.wait(60) and taken_elsewhere(lock)
        child = os.fork()
        if child == 0:
            os._exit(0 if lock().acquire(blocking=False) else 1)
        _, status = os.waitpid(child, 0)
        assert os.waitstatus_to_exitcode(status) == 0, "the child would wait for a thread that it does not have"
        assert taken_elsewhere(lock)
    finally:
        done.set()
        holder.join()
    assert not taken_elsewhere(lock)
