"""The soak of threads is quiet where threads answer as one thread does, and tells a pair and a World that do not."""

from __future__ import annotations

import threading

import pytest
import soak_threads

import collide


@pytest.mark.slow
def test_four_threads_answer_as_one_does():
    assert not soak_threads.run_round(24, 5)


def test_other_answers_are_told(monkeypatch):
    """Answers of the threads that the soak starts are made others: of one pair, and of the World."""
    pair = collide.Box((1, 1, 1)), collide.Sphere(0.5), collide.pose(), collide.pose((2, 0, 0))
    known = iter([b"first", b"second"])

    def is_started() -> bool:
        return threading.current_thread() is not threading.main_thread()

    def answers(pairs, order):
        return [b"other" if k == 3 and is_started() else bytes([k]) for k in range(len(pairs))]

    monkeypatch.setattr(soak_threads, "fresh_pairs", lambda n, seed: [pair] * n)
    monkeypatch.setattr(soak_threads, "answers", answers)
    monkeypatch.setattr(soak_threads, "ask_crowd", lambda world: b"third" if is_started() else next(known))
    failures = soak_threads.run_round(8, 5)
    assert failures.count((5, 3)) == soak_threads.THREADS and (5, "World") in failures and len(set(failures)) == 2
