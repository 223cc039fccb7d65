"""Error against time, for `benchmarks/accuracy.py`: hulls of points on a sphere, gaps and depths 1e-1 to 1e-12.

Every pair is placed by collide's own distances, B moved along the normal; the truth of each pose as it then stands is
exact arithmetic's. All poses are timed, the first few are judged. Ours is one batch call; coal and python-fcl are
Python loops over objects that are ready, coal at each of a row of tolerances. Engines take turns.
"""

from __future__ import annotations

import statistics
from decimal import Decimal

import numpy as np
from convex import aligned, log, say, seconds_of
from convex_peers import Coal, Fcl
from convex_shapes import LENGTH, Solid, rotations

from collide.adapters.peers import exact

#: Gaps and depths, as parts of the bodies' length.
LEVELS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
SIDES = {"gap": 1.0, "depth": -1.0}
#: coal's tolerances; None is its default.
TOLERANCES = (None, *(10.0**-k for k in range(3, 13)))
_EYE = np.eye(4)
#: Steps of placing; a depth may find a nearer way out on the way.
_STEPS = 12
#: How long a task is run for one time of it [s].
_STEADY = 3e-3


def placed(A, B, target: float, count: int, random) -> np.ndarray:
    """(N, 4, 4) poses of B at about this signed distance [m], each along a direction and in a turn of its own."""
    from collide import distance

    X = np.tile(_EYE, (count, 1, 1))
    X[:, :3, :3] = rotations(random.normal(size=(count, 4)))
    directions = random.normal(size=(count, 3))
    X[:, :3, 3] = directions * (1.2 * LENGTH / np.sqrt(np.square(directions).sum(axis=1)))[:, None]
    for _ in range(_STEPS):
        result = distance(A, B, _EYE, X)
        X[:, :3, 3] += (target - result.distance)[:, None] * result.normal
    return X


def truths(A, B, X: np.ndarray) -> list[Decimal]:
    return [
        exact.signed_distance(A.points, _EYE[:3, :3], _EYE[:3, 3], B.points, X_WB[:3, :3], X_WB[:3, 3]) for X_WB in X
    ]


def error_against_time(sizes: tuple[int, ...], engines: list[str], quick: bool) -> list[dict]:
    """A row an engine setting, size and level: µs a pair and the errors relative to the exact value."""
    rows = []
    for n in sizes:
        A, B = (Solid("sphere", n, seed) for seed in range(2))
        count, judged = (60, 6) if quick else (200 if n < 1000 else 100, 20 if n < 1000 else 6)
        for side, sign in SIDES.items():
            for level in LEVELS:
                random = np.random.default_rng([n, round(-np.log10(level)), int(sign + 1)])
                X = placed(A.shape, B.shape, sign * level * LENGTH, count, random)
                exactly = truths(A.shape, B.shape, X[:judged])
                rows += _level(n, side, level, (A, B), X, exactly, engines, 3 if quick else 7)
            say(f"n = {n}: {side}s")
    return rows


def _level(n, side, level, solids, X, exactly, engines, repeats) -> list[dict]:
    from collide import distance

    A, B = (solid.shape for solid in solids)
    which = np.tile([0, 1], (len(X), 1))
    tasks: dict = {("collide", "signed"): lambda: distance(A, B, _EYE, X)}
    answers = {("collide", "signed"): distance(A, B, _EYE, X).distance}
    if side == "gap":
        tasks["collide", "unsigned"] = lambda: distance(A, B, _EYE, X, signed=False)
        answers["collide", "unsigned"] = distance(A, B, _EYE, X, signed=False).distance
    if "coal" in engines:
        coal = Coal(list(solids), which, X)
        for tolerance in TOLERANCES:
            name = "coal", "default" if tolerance is None else f"{tolerance:.0e}"
            tasks[name] = coal.loop("signed", tolerance)
            answers[name] = coal.answers("signed", tolerance)
    fcl = Fcl(list(solids), which, X) if "fcl" in engines else None
    times: dict = {name: [] for name in tasks}
    for _ in range(repeats):
        for name, task in tasks.items():
            times[name].append(steady_seconds(task))
        if fcl:
            times.setdefault(("fcl", "default"), []).append(fcl.seconds("signed"))
    if fcl:
        answers["fcl", "default"] = fcl.answers("signed")
        fcl.close()
    rows = []
    for (engine, setting), taken in times.items():
        errors = [float(abs(Decimal(float(d)) - t) / abs(t)) for d, t in zip(answers[engine, setting], exactly)]
        us = [seconds / len(X) * 1e6 for seconds in taken]
        rows.append({
            "n": n, "side": side, "level": f"{level:.0e}", "engine": engine, "setting": setting, "runs": len(us),
            "median_us": statistics.median(us), "min_us": min(us), "judged": len(errors),
            "max_error": f"{max(errors):.2e}", "median_error": f"{statistics.median(errors):.2e}",
        })  # fmt: skip
    return rows


def steady_seconds(task) -> float:
    """Of the fastest of some milliseconds of runs, after one that fills the caches."""
    runs = max(1, round(_STEADY / seconds_of(task)))
    return min(seconds_of(task) for _ in range(runs))


def show_time(rows: list[dict]) -> None:
    """For every size and level, our largest error and time beside coal's default, its best setting, and python-fcl."""
    by_key = {(r["n"], r["side"], r["level"], r["engine"], r["setting"]): r for r in rows}
    settings = [("collide", "signed"), ("coal", "default"), ("coal", "1e-09"), ("coal", "1e-12"), ("fcl", "default")]
    settings = [s for s in settings if any((r["engine"], r["setting"]) == s for r in rows)]
    lines = [["n", "side", "level", *(cell for e, s in settings for cell in (f"{e} {s}", "µs"))]]
    for n, side, level in dict.fromkeys((r["n"], r["side"], r["level"]) for r in rows):
        line = [f"{n:,}", side, level]
        for setting in settings:
            r = by_key[(n, side, level, *setting)]
            line += [r["max_error"], f"{r['min_us']:.2f}"]
        lines.append(line)
    aligned("largest error relative to the exact value, and µs a pair", lines)
    slower = [
        (n, side, level) for n, side, level, e, s in by_key
        if (e, s) == ("coal", "1e-09") and by_key[n, side, level, e, s]["min_us"]
        < by_key[n, side, level, "collide", "signed"]["min_us"]
    ]  # fmt: skip
    log(f"cells in which coal at tolerance 1e-9 is faster: {len(slower)} {slower or ''}".rstrip())
