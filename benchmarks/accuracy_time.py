"""Error against time of hulls at chosen gaps and depths, and the brackets of curved pairs.

    python benchmarks/accuracy_time.py --plot accuracy.png       # what docs/accuracy.md shows

time    hulls of 8, 128 and 2,048 vertices at relative gaps and depths of 1e-1 to 1e-12, placed by collide's own
        distances: the error of every engine setting, as a part of the exact value, against µs a call
curved  bracket widths of cylinders, cones and ellipsoids in units of the size S of docs/conventions.md, for random
        shapes in four kinds of pose (`curved_pairs.py`)
"""

from __future__ import annotations

import statistics
from decimal import Decimal

import numpy as np
from convex_shapes import LENGTH, hull
from curved_pairs import PAIRS, POSES, widths
from inputs import poses
from pair_loops import CoalLoop, FclLoop

import collide
from collide.adapters.bench.claims import Claim, Options, Race, Row, grid, installed, main
from collide.adapters.bench.growth import Panel
from collide.adapters.peers import exact

#: Gaps and depths, as parts of the bodies' length; coal's tolerances, None its default.
LEVELS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
TOLERANCES = {"default": None, **{f"1e-{k}": 10.0**-k for k in range(3, 13)}}


def placed(A, B, target: float, count: int, random) -> np.ndarray:
    """(N, 4, 4) poses of B at about this signed distance [m]; a depth may find a nearer way out on the way."""
    X = poses(random, count, 1.2 * LENGTH, 1.2 * LENGTH)
    for _ in range(12):
        result = collide.distance(A, B, np.eye(4), X)
        X[:, :3, 3] += (target - result.distance)[:, None] * result.normal
    return X


def against_time(options: Options, n: int, side: str, level: float) -> Race:
    """µs a pair and the errors relative to the exact value, of every engine setting."""
    A, B, count = hull("sphere", n, 0), hull("sphere", n, 1), 60 if options.quick else 200 if n < 1000 else 100
    sign = 1.0 if side == "gap" else -1.0
    X = placed(A, B, sign * level * LENGTH, count, np.random.default_rng([n, round(-np.log10(level)), side == "gap"]))
    eye, judged = np.eye(4), 6 if options.quick or n > 1000 else 20
    here = A.points, eye[:3, :3], eye[:3, 3], B.points
    truths = [exact.signed_distance(*here, Y[:3, :3], Y[:3, 3]) for Y in X[:judged]]
    tasks: dict = {"collide": lambda: collide.distance(A, B, eye, X)}
    answers = {"collide": collide.distance(A, B, eye, X).distance}
    if side == "gap":
        tasks["collide unsigned"] = lambda: collide.distance(A, B, eye, X, signed=False)
        answers["collide unsigned"] = tasks["collide unsigned"]().distance
    lists, close = ([A] * count, [B] * count, np.tile(eye, (count, 1, 1)), X), bool
    for name in installed(coal="coal", fcl="fcl"):
        if name == "coal":
            coal = CoalLoop(*lists)
            for setting, tolerance in TOLERANCES.items():
                tasks[f"coal {setting}"] = coal.loop("signed", tolerance)
                answers[f"coal {setting}"] = coal.answers("signed", tolerance)
        else:
            fcl = FclLoop(*lists)
            tasks["fcl"], answers["fcl"], close = fcl.loop("signed"), fcl.answers("signed"), fcl.close
    errors = {name: [float(abs(Decimal(float(d)) - t) / abs(t)) for d, t in zip(values, truths)]
              for name, values in answers.items()}
    beside = {name: {"max_error": max(e), "median_error": statistics.median(e)} for name, e in errors.items()}
    return Race(tasks, count, {"judged": judged}, beside, close=close)


def curved(options: Options, a: str, b: str, where: str) -> list[Row]:
    """The largest brackets over all seeds."""
    seeds, count = (1, 50) if options.quick else (4, 1000)
    some = [widths(a, b, where, count, seed) for seed in range(100, 100 + seeds)]
    width, hits, certified = (np.concatenate([getattr(w, name) for w in some]) for name in some[0]._fields[:3])
    row: Row = {"gaps": int((~hits).sum()), "depths": int(hits.sum()), "us": min(w.us for w in some)}
    for name, of in (("gap", width[~hits]), ("depth", width[hits]), ("depth_certified", width[hits & certified])):
        row[f"{name}_width"] = float(of.max()) if len(of) else ""
        row[f"{name}_width_median"] = float(np.median(of)) if len(of) else ""
    return [row | {"uncertified": int((~certified).sum())}]


def time_cases(options: Options):
    sizes, levels = (8, 128, 2048), LEVELS[:: 4 if options.quick else 1]
    return grid(n=sizes[: 2 if options.quick else 3], side=("gap", "depth"), level=levels)


def curved_cases(options: Options):
    return ({"a": a, "b": b, "where": where} for a, b in PAIRS[: 2 if options.quick else None] for where in POSES)


DRAWN = ("collide", "coal default", "coal 1e-9", "coal 1e-12", "fcl")
CLAIMS = [
    Claim("time", "µs a pair, and errors", time_cases, against_time, turns=7, file="accuracy-time", panels=tuple(
              Panel(f"{side}s, {n:,} vertices: largest relative error", "level", "max_error", "engine", "xy",
                    lambda row, n=n, side=side: (row["n"], row["side"]) == (n, side) and row["engine"] in DRAWN,
                    x_label="gap or depth, as a part of the length", floor=2e-17)
              for side in ("gap", "depth") for n in (8, 128, 2048))),
    Claim("curved", "brackets in units of S", curved_cases, curved, file="accuracy-curved", panels=tuple(
              Panel(f"largest bracket of a {side}, in units of S", "us", f"{side}_width", "where", "xy", style="o",
                    x_label="µs a pair") for side in ("gap", "depth"))),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
