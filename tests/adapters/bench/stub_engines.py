"""Engines made for the tests of benchmarks: wrong by what they are told, slow, crashing, silent."""

from __future__ import annotations

import os
import time

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer

#: How far the wrong one is off [m].
OFF = 1e-3


class Right(PairwisePeer):
    """Spheres and hulls by the distance of their frames' origins, less nothing: only the tests' own pairs fit it."""

    name = "right"

    def build(self, part):
        return part

    def ask(self, A, X_WA, B, X_WB):
        gap = float(np.abs(X_WB[:3, 3] - X_WA[:3, 3]).max()) - 1.0
        return Reply(gap <= 0, gap)


class Wrong(Right):
    name = "wrong"

    def ask(self, A, X_WA, B, X_WB):
        gap = super().ask(A, X_WA, B, X_WB).distance + OFF
        return Reply(gap <= 0, gap)


class Slow(Right):
    name = "slow"

    def ask(self, A, X_WA, B, X_WB):
        ends = time.process_time() + 2e-3
        while time.process_time() < ends:
            pass
        return super().ask(A, X_WA, B, X_WB)


class Crashing(Right):
    name = "crashing"

    def ask(self, A, X_WA, B, X_WB):
        os.abort()


class Fragile(Right):
    """Answers once a pair, and dies when it is asked again and again."""

    name = "fragile"
    calls = 0

    def ask(self, A, X_WA, B, X_WB):
        self.calls += 1
        if self.calls > 4:
            os.abort()
        return super().ask(A, X_WA, B, X_WB)


class Silent(Right):
    name = "silent"

    def ask(self, A, X_WA, B, X_WB):
        reply = super().ask(A, X_WA, B, X_WB)
        return Reply(reply.hit)
