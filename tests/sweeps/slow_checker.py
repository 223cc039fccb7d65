"""A checker whose answers are known by hand, that takes its time and keeps a diary: for tests that kill who asks it.

Run as a script it sweeps with it, so that a whole process can be killed: slow_checker.py FOLDER DIARY ROWS SECONDS
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from collide import InvalidArgument, Robot
from collide.robots.kinematic_tree import Joint


class Least(NamedTuple):
    """What `SlowChecker.distances` gives."""

    hit: np.ndarray
    distance: np.ndarray
    names: list


class SlowChecker:
    """A point on a rail and a post at x > 0.25: it collides where q[0] ≥ 0.25, at the distance 0.25 − q[0].

    seconds : every batch takes.   diary : a file to which each batch adds a line: its first value, rows, process.
    """

    def __init__(self, seconds: float = 0.0, diary: str | None = None, post: float = 0.25):
        slide = Joint("slide", "prismatic", "base", "slider", lower=-1.0, upper=1.0)
        self.robot = Robot("rail", ["base", "slider"], [slide])
        self.seconds, self.diary, self.post = seconds, diary, post

    def state(self):
        return [self.post]

    def collides(self, Q):
        time.sleep(self.seconds)
        if self.diary is not None:
            with open(self.diary, "a", encoding="utf-8") as file:
                file.write(f"{Q[0, 0]!r} {len(Q)} {os.getpid()}\n")
        if isinstance(self.post, str):
            raise InvalidArgument(self.post)
        return Q[:, 0] >= self.post

    def distances(self, Q):
        hit = self.collides(Q)
        return Least(hit, self.post - Q[:, 0], [("slider", "post")] * len(Q))


def diary_lines(file: Path) -> list[list[str]]:
    """What each batch wrote."""
    return [line.split() for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []


if __name__ == "__main__":
    import slow_checker  # not as the script: workers must find the class by name

    from collide.sweeps.configurations import DrawnConfigurations
    from collide.sweeps.sweep import sweep

    folder, diary, rows, seconds = sys.argv[1:]
    checker = slow_checker.SlowChecker(float(seconds), diary)
    sweep(checker, DrawnConfigurations(int(rows), 3), folder, workers=2, chunk=100)
