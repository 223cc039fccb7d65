"""The slowest calls of the public interface: what searches over bodies, sizes, placements and questions have met.

    python benchmarks/slowest_calls.py                           # those kept, beside the bar; five minutes
    python benchmarks/slowest_calls.py --search 600 --seed 3     # looks for others; prints the worst, writes no file
    python benchmarks/slowest_calls.py --only "case=contacts ball:80000 box 1 deep"

A call is timed after one that makes ready what is kept with shapes, so that building is not in the figure: CPU time,
the median of five, or of one where it takes more than a second. Bodies and questions are in `slowest_bodies.py`. A
search may be stopped at any time: what it has met above the bar is told.
"""

from __future__ import annotations

import argparse
import itertools
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from slowest_bodies import OF_ONE, PLACES, QUESTIONS, RATIOS, all_bodies, body, placed

from collide.adapters.bench.claims import Claim, Options, Race, Row, check, main
from collide.errors import CollideError

#: No call on 10^5 facets or 1,000 parts is to take longer, building apart [ms].
BAR = 50.0
#: The worst that searches have met, of each class: "question A B ratio place".
WORST = (
    "collide meshes:1000 box 1 inside", "distance terrain:80000 cylinder 1e+07 inside", "distance meshes:100 box 1 far",
    "distance meshes:100 box 1 deep", "distance boxes:100 terrain:300 1e+07 far",
    "distance terrain:80000 rounded:100000 1e+07 touching", "distance terrain:80000 cans:1000 100 inside",
    "distance terrain:80000 capsule 1e+07 inside", "distance meshes:1000 terrain:80000 1 inside",
    "distance terrain:80000 cans:1000 0.01 near", "distance rounded:100000 terrain:300 100 inside",
    "distance meshes:1000 boxes:1000 1 inside", "gap boxes:1000 slab:300 1e+07 far",
    "within terrain:80000 cans:1000 1 inside", "within meshes:1000 cylinder 1e+07 inside",
    "within cans:3 terrain:10000 0.01 inside", "within meshes:1000 terrain:80000 100 deep",
    "within meshes:1000 planes:300 1e+07 deep", "certify terrain:10000 hull:1000 1e-07 inside",
    "certify sheet:300 rounded:100000 1 deep", "contacts ball:80000 box 1 deep", "contacts ball:80000 box 0.2 deep",
    "contacts cans:1000 balls:1000 1 inside", "contacts meshes:100 box 1 deep", "contacts sheet:80000 cone 100 inside",
    "contacts sheet:80000 cone 3 inside", "contacts terrain:80000 cylinder 1 inside",
    "shape_cast cans:1000 boxes:1000 1 far", "shape_cast cylinder meshes:1000 100 inside",
    "shape_cast ball:80000 terrain:10000 100 near", "shape_cast meshes:1000 hull:100000 1 inside",
    "shape_cast meshes:1000 balls:1000 0.01 inside", "shape_cast sheet:80000 meshes:1000 1e-07 near",
    "shape_cast rounded:100000 sheet:80000 1e-07 far", "shape_cast hull:100000 terrain:10000 1e+07 touching",
    "shape_cast boxes:1000 hull:100000 0.01 near", "shape_cast boxes:1000 ball:80000 1e+07 near",
    "shape_cast cans:3 sheet:80000 1e-07 touching", "rays meshes:1000 meshes:1000 1 far",
    "impact hull:100000 terrain:80000 100 far", "impact ball:10000 hull:100000 1e+07 near",
    "impact sheet:80000 boxes:1000 1e+07 far", "impact cans:1000 slab:300 1e+07 touching",
    "impact balls:3 meshes:1000 0.01 touching", "impact hull:100000 meshes:1000 1e-07 near",
    "impact terrain:10000 ball:80000 1e-07 touching", "impact sheet:80000 terrain:10000 1e+07 near",
    "impact sheet:80000 cans:3 1e+07 deep", "impact cylinder slab:80000 1e-07 near",
    "impact sheet:80000 boxes:1000 0.01 deep", "impact halfspace meshes:1000 1 deep",
    "impact cans:1000 ball:80000 1e-07 deep", "certify_motion hull:100000 cans:1000 1e-07 deep",
    "world_rays hull:100000 terrain:10000 1e-07 deep", "world_minimum meshes:1000 sheet:300 1e+07 inside",
    "world_minimum boxes:1000 cans:1000 1e+07 touching", "world_distances cans:1000 boxes:1000 1e-07 far",
    "world_rays hull:100000 rounded:10 0.01 deep", "world_cast cans:1000 sheet:80000 100 deep",
    "world_nearest cylinder ball:10000 1e-07 deep",
)




def cases(options: Options) -> Iterator[Row]:
    """What is kept; of a search all there are, in random order, until its time is up."""
    if options.search is None:
        yield from ({"case": case} for case in WORST)
        return
    options.no_csv = True
    unknown = set(options.questions) - QUESTIONS.keys()
    check(not unknown, f"no question {min(unknown, default='')!r}: {', '.join(QUESTIONS)}")
    bodies = all_bodies()
    every = [
        f"{question} {A} {B} {ratio:g} {place}"
        for question, A, B, ratio, place in itertools.product(options.questions, bodies, bodies, RATIOS, PLACES)
        if question not in OF_ONE or B in ("sphere", A)
    ]
    random.Random(options.seed).shuffle(every)
    started = time.process_time()
    for case in every:
        if time.process_time() - started > options.search:
            return
        yield {"case": case}


def measure(options: Options, case: str) -> Race | list[Row]:
    """The call, after a first one; of a search nothing where the call is refused, or below the bar."""
    question, A, B, ratio, place = case.split()
    X, Y = placed(A, B, float(ratio), place)
    shapes, small = (body(A), body(B, float(ratio))), min(1.0, float(ratio))

    def ask() -> float:
        """CPU ms of a call."""
        started = time.process_time()
        QUESTIONS[question](*shapes, X, Y, small)
        return 1e3 * (time.process_time() - started)

    try:
        first = ask()
        if options.search is not None and ask() <= BAR:
            return []
    except CollideError:
        if options.search is None:
            raise
        return []
    return Race({"collide": ask}, beside={"collide": {"first_ms": first}}, bars={"collide": BAR})


def more(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--search", type=float, metavar="SECONDS", help="look for slow calls for so much CPU time")
    parser.add_argument("--seed", type=int, default=0, help="of the order in which a search asks")
    parser.add_argument("--questions", nargs="+", default=list(QUESTIONS), metavar="NAME", help="that a search asks")


CLAIMS = [
    Claim(
        "slowest-calls", "beside 50 ms; CPU time", cases, measure, unit="ms", turns=5, seconds=2.0, bar="median",
    )
]

if __name__ == "__main__":
    main(__doc__, CLAIMS, more)
