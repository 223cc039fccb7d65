"""Booleans and distances of convex pairs beside coal and python-fcl, as ratios, with the bars to be met.

    python benchmarks/convex.py --quick                      # a look: small hulls, few poses, no CSV
    python benchmarks/convex.py --table sphere               # one table at all its sizes
    python benchmarks/convex.py --engines coal               # everything, without python-fcl

Tables: hulls of n points on a sphere, an ellipsoid 1:3:10, a pancake 1:50, and cylinders (two n/2-gons); "shapes",
random pairs of hundreds of different hulls, whose data are in no cache; "single", one Python call a pair; "threads",
large batches with `threads=2`, and plain arithmetic in two threads (two cores shared with others are less than two);
"cgal", our boolean beside the times published for CGAL's hull hierarchy, on other hardware. Poses: a third 0.05 to 1
lengths apart, a third within 1 % of touching, a third 5 to 50 % deep, shuffled into one batch that all engines get.
Ours is a batch call, coal and python-fcl are Python loops (`pair_loops.py`); times are µs a pair. "collide, near" and
its like are ours by class, in batches a third as long, which spread the cost of a call over fewer pairs.

"differ" counts booleans that differ from coal's of those that are not within 1e-6 lengths of touching. Bars are the
ratios of a prototype; "stretch" is what is hoped for.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from convex_shapes import CLASSES, LENGTH, Scene, coal_prism, scene
from pair_loops import CoalLoop, FclLoop

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.adapters.bench.turns import Seconds

SIZES = (8, 128, 512, 2048, 8192, 32768, 131072)
SIZES_OF = {"shapes": (8, 128, 2048, 8192), "single": SIZES[:5], "threads": (8, 128, 2048, 8192)}
QUESTIONS = ("boolean", "signed", "unsigned")
#: (table, question) -> n -> the prototype's ratio coal / ours; for threads, one thread's time / two threads'.
BARS: dict[tuple[str, str], dict[int, float]] = {
    ("sphere", "boolean"): dict(zip(SIZES, (4.1, 5.7, 7.1, 7.9, 10.6, 14.6, 54))),
    ("sphere", "signed"): dict(zip(SIZES, (2.4, 2.1, 2.2, 2.3, 3.5, 5.2, 15.7))),
    ("sphere", "unsigned"): dict(zip(SIZES, (3.0, 3.6, 4.0, 4.6, 9, 11, 45))),
    ("ellipsoid", "boolean"): {8192: 10.2}, ("ellipsoid", "signed"): {8192: 4.2},
    ("ellipsoid", "unsigned"): {8192: 5.2},
    ("cylinder", "boolean"): {512: 5.1, 8192: 5.9}, ("cylinder", "signed"): {512: 2.5, 8192: 3.0},
    ("cylinder", "unsigned"): {512: 2.8, 8192: 3.6},
    ("pancake", "boolean"): {32768: 15.7}, ("pancake", "signed"): {32768: 7.2}, ("pancake", "unsigned"): {32768: 8.5},
    ("shapes", "boolean"): {8: 6.0, 128: 13.5, 2048: 10.4, 8192: 22.9},
    ("shapes", "signed"): {8: 2.6, 128: 3.0, 2048: 4.3, 8192: 8.3},
    ("shapes", "unsigned"): {8: 3.3, 128: 5.0, 2048: 6.8, 8192: 12.2},
    ("single", "boolean"): dict(zip(SIZES, (2.0, 3.5, 5, 6.9, 13.9))),
}
STRETCH_BARS = {
    ("sphere", "boolean"): dict(zip(SIZES, (5, 7, 9, 11, 15, 20, 70))),
    ("sphere", "signed"): dict(zip(SIZES, (4, 4, 4, 5, 7, 10, 25))),
}
#: Published times of CGAL's hull hierarchy [µs]; ours must stay below a quarter.
CGAL = {40: 1.7, 100: 2.7, 1000: 12.9, 10_000: 27.9, 100_000: 58.4}
#: Poses so near to touching, in lengths, that engines may disagree.
TOUCHING = 1e-6
#: Poses of each class that two threads share: they pay in batches that take ten milliseconds.
FOR_THREADS = 20_000


def scene_of(options: Options, table: str, n: int) -> Scene:
    """A scene with fewer poses above n = 8,192; of "shapes" as many hulls as fill a cache and are made in a minute."""
    kind = table if table in ("sphere", "ellipsoid", "cylinder", "pancake") else "sphere"
    shapes = 2 if table != "shapes" else 30 if options.quick else min(500, max(60, 500_000 // n))
    poses = 200 if options.quick else FOR_THREADS if table == "threads" else 1000
    return scene(kind, n, max(10, min(poses, poses * 8192 // n)), shapes)


def asks(question: str, asked: Scene, **named):
    """A batch call of ours."""
    of_set = asked.question()
    if question == "boolean":
        return partial(collide.collide, *of_set, **named)
    return partial(collide.distance, *of_set, signed=question == "signed", **named)


def compared(options: Options, table: str, n: int, question: str) -> Race:
    asked = scene_of(options, table, n)
    tasks: dict = {"collide": asks(question, asked)}
    beside: dict = {}
    if table == "single":
        ask = collide.collide if question == "boolean" else partial(collide.distance, signed=question == "signed")
        tasks = {"collide": lambda: [ask(*asked.shapes, np.eye(4), X) for X in asked.X_WBs]}
    engines = [engine for engine in installed(coal="coal", fcl="fcl") if engine in options.engines.split(",")]
    if "coal" in engines:
        coal = CoalLoop(*asked.pairs, *([coal_prism] if table == "cylinder" else []))
        tasks["coal"] = coal.loop(question)
        stretch = STRETCH_BARS.get((table, question), {}).get(n, "")
        beside["coal"] = {"stretch": stretch}
        if question == "boolean":
            apart, hits = np.abs(asked.distances) > TOUCHING * LENGTH, asks("boolean", asked)()
            beside["coal"]["differ"] = int((apart & ((coal.answers("boolean") > 0) != hits)).sum())
    close = bool
    if "fcl" in engines and not (table == "cylinder" and n > 2048):  # its faces would take minutes
        fcl = FclLoop(*asked.pairs)
        tasks["fcl"], close = fcl.loop(question), fcl.close
    count = len(asked.which)
    per = dict.fromkeys(tasks, float(count))
    if table != "single":
        for k, name in enumerate(CLASSES):
            of_class = asked.only(np.flatnonzero(asked.labels == k))
            tasks[f"collide, {name}"], per[f"collide, {name}"] = asks(question, of_class), len(of_class.which)
    bar = BARS.get((table, question), {}).get(n)
    columns = rounds(asked) if question == "signed" else {}
    return Race(tasks, per, columns, beside, {"coal": bar} if bar and "coal" in tasks else {}, close)


def rounds(asked: Scene) -> dict:
    """Means of GJK's and EPA's rounds, each one support point of each body, and the exact stage's share."""
    rows = collide.distance(*asked.question()).rows
    return {"gjk": float((rows["iterations"] & 0xFFFF).mean()), "epa": float((rows["iterations"] >> 16).mean()),
            "exact": float((rows["exact"] > 0).mean())}


def arithmetic(share: int) -> None:
    """Some ten milliseconds a share of work that touches no more than a cache holds, and lets other threads run."""
    numbers = np.linspace(0.0, 1.0, 20_000)
    for _ in range(100 * share):
        np.sin(numbers, out=numbers)


def threaded(options: Options, table: str, n: int, question: str) -> Race:
    """The same batch by two threads and by one; what two gain of nothing but arithmetic says what the cores give."""
    if question == "arithmetic":
        pool = ThreadPoolExecutor(2)
        return Race({"two threads": lambda: list(pool.map(arithmetic, (1, 1))), "collide": lambda: arithmetic(2)},
                    close=pool.shutdown)
    asked = scene_of(options, table, n)
    tasks = {"two threads": asks(question, asked, threads=2), "collide": asks(question, asked)}
    return Race(tasks, len(asked.which), bars={"collide": 1.8})


def beside_cgal(options: Options, table: str, n: int, question: str) -> Race:
    asked = scene_of(options, table, n)
    published = Seconds(CGAL[n] * 1e-6 * len(asked.which))
    tasks = {"collide": asks(question, asked), "CGAL, published": lambda: published}
    return Race(tasks, len(asked.which), bars={"CGAL, published": 4.0})


def claim(table: str, measure, sizes=SIZES, questions=QUESTIONS) -> Claim:
    def cases(options: Options):
        return grid(table=[table], n=sizes[:2] if options.quick else SIZES_OF.get(table, sizes), question=questions)

    clock = time.perf_counter if table == "threads" else time.process_time
    return Claim(table, "µs a pair of hulls of n vertices", cases, measure, clock=clock, file=f"convex-{table}")


CLAIMS = [claim(table, compared) for table in ("sphere", "ellipsoid", "cylinder", "pancake", "shapes")]
CLAIMS += [claim("single", compared, questions=QUESTIONS[:2])]
CLAIMS += [claim("threads", threaded, questions=(*QUESTIONS, "arithmetic"))]
CLAIMS += [claim("cgal", beside_cgal, tuple(CGAL), QUESTIONS[:1])]


def arguments(parser) -> None:
    parser.add_argument("--engines", default="coal,fcl", help="coal, fcl, or both with a comma (default)")


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
