"""Run time and operations against size, with fitted slopes: hulls of n points on a sphere.

Time: one signed distance, engines in turns, in processes of their own (`engine_timer.py`). Operations: vertices that a
settled support query looks at, counted by the support tree itself; no clock is in them. Slopes are of log against log
over the upper half of the sizes: 0 does not grow, 1 grows as n.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.adapters.bench.engine_timer import EngineTimer
from collide.adapters.bench.growth import Panel
from collide.adapters.bench.pareto import check_engines, engine_of, number, over_rounds, quantile
from collide.adapters.bench.timed_calls import Pair
from collide.adapters.bench.turns import turns
from collide.adapters.peers.protocol import ENGINES
from collide.hull.exact_hull import convex_hull
from collide.scenes.families.ingredients import direction, rotation
from collide.shapes import ConvexHull
from collide.support.build_support_tree import build_support_tree
from collide.support.support_tree_query import COUNTERS, extreme_vertices

SIZES = (8, 32, 128, 512, 2048, 8192, 32768)
#: Poses a size, directions a size, and how long a turn may take [s].
POSES, DIRECTIONS, TURN_TIMEOUT = 12, 2000, 60.0
#: What operations are called in place of an engine.
OPERATIONS = "support query"
MIN_ROUNDS, MAX_ROUNDS = 3, 9
#: Two panels of a picture; slopes of lines stand in the table.
PANELS = (
    Panel("µs a signed distance", "n", "value", "what", "xy", lambda row: row["what"] != OPERATIONS,
          x_label="vertices of each hull"),
    Panel("vertices looked at", "n", "value", "what", "xy", lambda row: row["what"] == OPERATIONS,
          x_label="vertices of each hull"),
)


class Growth(NamedTuple):
    """What grows: an engine's µs a call, or `OPERATIONS`' vertices.   values : one a size; NaN where there is none."""

    name: str
    unit: str
    sizes: list[int]
    values: list[float]

    @property
    def slope(self) -> float:
        """Of log(value) against log(n), over the upper half of the sizes; NaN where fewer than two have a value."""
        return fitted_slope(self.sizes, self.values)

    def rows(self) -> list[dict]:
        """A row a size, for the CSV."""
        return [
            {"what": self.name, "unit": self.unit, "n": n, "value": number(value), "slope": number(self.slope)}
            for n, value in zip(self.sizes, self.values)
        ]


def fitted_slope(sizes: list[int], values: list[float]) -> float:
    """Least squares of log(value) against log(n) over the upper half of those that have a value."""
    valid = [(math.log(n), math.log(v)) for n, v in zip(sizes, values) if v > 0 and math.isfinite(v)]
    valid = valid[len(valid) // 2 - (len(valid) % 2 == 0) if len(valid) > 3 else 0 :]
    if len(valid) < 2:
        return math.nan
    x, y = np.array(valid).T
    return float(np.polyfit(x, y, 1)[0])


def measure(
    engines: list[str], sizes: tuple[int, ...] = SIZES, *, minutes: float = 2.0, seed: int = 0,
    progress: Callable[[str], object] | None = None,
) -> list[Growth]:
    """Engines and operations at all sizes.

    engines : of `ENGINES`.   sizes : numbers of points, 4 or more.   minutes : about how long to time in all.
    """
    check_engines(engines)
    columns: dict[str, list[float]] = {name: [] for name in engines}
    looked_at = []
    for n in sizes:
        if progress is not None:
            progress(f"{n:,} vertices")
        for name, us in _times(engines, n, seed, 60.0 * minutes / len(sizes)).items():
            columns[name].append(us)
        looked_at.append(operations(n, seed))
    grown = [Growth(name, "µs", list(sizes), values) for name, values in columns.items()]
    return [*grown, Growth(OPERATIONS, "vertices", list(sizes), looked_at)]


def sphere(n: int, seed: int) -> np.ndarray:
    """(n, 3) points on the unit sphere."""
    points = np.random.default_rng([n, seed]).normal(size=(n, 3))
    return points / np.sqrt(np.square(points).sum(axis=1))[:, None]


def operations(n: int, seed: int) -> float:
    """Vertices that a settled support query looks at, the mean over random directions."""
    points = sphere(n, seed)
    hull = convex_hull(points)
    tree = build_support_tree(points, hull.vertices, hull.facets)
    counters = np.zeros(COUNTERS, dtype=np.int64)
    extreme_vertices(tree, np.random.default_rng([1, n]).normal(size=(DIRECTIONS, 3)), True, counters)
    return float(counters[0] + counters[2]) / DIRECTIONS  # scanned in the nodes' lists, and looked at on the climb


def _times(engines: list[str], n: int, seed: int, seconds: float) -> dict[str, float]:
    """µs a call by engine, the median over poses of the median over rounds."""
    random = np.random.default_rng([2, n, seed])
    A, B = ConvexHull(sphere(n, seed)), ConvexHull(sphere(n, seed + 1))
    pairs: list[Pair] = []
    for k in range(POSES):
        X_WA, X_WB = np.eye(4), np.eye(4)
        X_WA[:3, :3], X_WB[:3, :3] = rotation(random), rotation(random)
        X_WB[:3, 3] = direction(random) * (2.0 + (0.5, 0.01, -0.4)[k % 3])
        pairs.append((A, B, X_WA, X_WB))
    timers = [EngineTimer(name, ENGINES[engine_of(name)], [pairs], TURN_TIMEOUT) for name in engines]
    taken: dict[str, list[np.ndarray]] = {name: [] for name in engines}
    try:
        for contestants in turns(timers, MIN_ROUNDS, MAX_ROUNDS, seconds):
            for timer in contestants:
                taken[timer.name].append(timer.seconds(0))
    finally:
        for timer in timers:
            timer.close()
    return {name: 1e6 * quantile(over_rounds(rounds), 0.5) for name, rounds in taken.items()}
