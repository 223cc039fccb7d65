"""The slowest calls of the public interface: found by a search over bodies, sizes, placements and questions, and kept.

    python benchmarks/slowest_calls.py                        # the forty-two kept, beside the bar; five minutes
    python benchmarks/slowest_calls.py --search --seconds 600 # looks for others; prints the worst, writes no file
    python benchmarks/slowest_calls.py --case "contacts ball:80000 box 1 deep"

A call is timed after one that makes ready what is kept with shapes, so that building is not in the figure: CPU time,
the median of five, or of one where it takes more than a second. Bodies and questions are in `slowest_bodies.py`. The
search prints every case above the bar as it meets it, so that it may be stopped at any time.
"""

from __future__ import annotations

import argparse
import itertools
import random
import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from slowest_bodies import OF_ONE, PLACES, QUESTIONS, RATIOS, all_bodies, body, placed

from collide.adapters.bench.claims import RESULTS
from collide.adapters.bench.machine_stamp import file_name, machine_stamp, write_csv
from collide.errors import CollideError

#: No call on 10^5 facets or 1,000 parts is to take longer, building apart [ms].
BAR = 50.0
#: The worst that searches have met, of each class: "question A B ratio place".
WORST = (
    "contacts ball:80000 box 1 deep", "contacts ball:80000 box 0.2 deep", "within terrain:80000 cans:1000 1 inside",
    "distance terrain:80000 cylinder 1e+07 inside", "contacts cans:1000 balls:1000 1 inside",
    "contacts meshes:100 box 1 deep",
    "collide meshes:1000 box 1 inside", "distance meshes:100 box 1 far", "distance meshes:100 box 1 deep",
    "distance boxes:100 terrain:300 1e+07 far", "gap boxes:1000 slab:300 1e+07 far",
    "within meshes:1000 cylinder 1e+07 inside", "within cans:3 terrain:10000 0.01 inside",
    "distance terrain:80000 rounded:100000 1e+07 touching", "distance terrain:80000 cans:1000 100 inside",
    "distance terrain:80000 capsule 1e+07 inside", "shape_cast cans:1000 boxes:1000 1 far",
    "shape_cast cylinder meshes:1000 100 inside", "certify terrain:10000 hull:1000 1e-07 inside",
    "certify sheet:300 rounded:100000 1 deep", "distance meshes:1000 terrain:80000 1 inside",
    "distance terrain:80000 cans:1000 0.01 near", "contacts sheet:80000 cone 100 inside",
    "shape_cast ball:80000 terrain:10000 100 near", "distance rounded:100000 terrain:300 100 inside",
    "world_minimum meshes:1000 sheet:300 1e+07 inside", "world_minimum boxes:1000 cans:1000 1e+07 touching",
    "world_distances cans:1000 boxes:1000 1e-07 far", "world_rays hull:100000 rounded:10 0.01 deep",
    "world_cast cans:1000 sheet:80000 100 deep", "world_nearest cylinder ball:10000 1e-07 deep",
    "within meshes:1000 terrain:80000 100 deep", "within meshes:1000 planes:300 1e+07 deep",
    "distance meshes:1000 boxes:1000 1 inside", "rays meshes:1000 meshes:1000 1 far",
    "certify_motion hull:100000 cans:1000 1e-07 deep",
    "impact hull:100000 terrain:80000 100 far", "impact ball:10000 hull:100000 1e+07 near",
    "impact sheet:80000 boxes:1000 1e+07 far", "impact cans:1000 slab:300 1e+07 touching",
    "impact balls:3 meshes:1000 0.01 touching", "impact hull:100000 meshes:1000 1e-07 near",
)


def timed(case: str) -> tuple[float, float]:
    """(ms of the first call, ms of a later one) of a case; raises what the call raises."""
    question, A, B, ratio, place = case.split()
    X, Y = placed(A, B, float(ratio), place)
    shapes, small = (body(A), body(B, float(ratio))), min(1.0, float(ratio))
    taken: list[float] = []
    while len(taken) < 2 or (len(taken) < 6 and taken[-1] < 1e3):
        started = time.process_time()
        QUESTIONS[question](*shapes, X, Y, small)
        taken.append(1e3 * (time.process_time() - started))
    return taken[0], statistics.median(taken[1:])


def cases(rng: random.Random, questions: list[str]) -> list[str]:
    """All there are, in random order."""
    bodies = all_bodies()
    every = [
        f"{question} {A} {B} {ratio:g} {place}"
        for question, A, B, ratio, place in itertools.product(questions, bodies, bodies, RATIOS, PLACES)
        if question not in OF_ONE or B in ("sphere", A)
    ]
    rng.shuffle(every)
    return every


def search(seconds: float, seed: int, questions: list[str]) -> None:
    """Ask cases in random order until the time is up, and print those above the bar, then the worst."""
    slowest: list[tuple[float, float, str]] = []
    refused, started = 0, time.process_time()
    for case in cases(random.Random(seed), questions):
        if time.process_time() - started > seconds:
            break
        try:
            first, later = timed(case)
        except CollideError:
            refused += 1
            continue
        slowest.append((later, first, case))
        if later > BAR:
            print(line(first, later, case), flush=True)
    slowest.sort(reverse=True)
    print(f"{len(slowest)} cases, {refused} refused; above {BAR:g} ms: {sum(later > BAR for later, *_ in slowest)}")
    for later, first, case in slowest[:20]:
        print(line(first, later, case))


def line(first: float, later: float, case: str) -> str:
    return f"{later:10.2f} ms  {'above' if later > BAR else '     '}  (first {first:10.1f})  {case}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--search", action="store_true", help="look for slow calls instead of timing those kept")
    parser.add_argument("--seconds", type=float, default=600.0, help="CPU time of a search")
    parser.add_argument("--seed", type=int, default=0, help="of the order in which cases are asked")
    parser.add_argument("--questions", default=",".join(QUESTIONS), help="asked in a search")
    parser.add_argument("--case", action="append", help="time this one, and write no file")
    parser.add_argument("--no-csv", action="store_true")
    asked = parser.parse_args()
    if asked.search:
        search(asked.seconds, asked.seed, asked.questions.split(","))
        return
    rows = []
    for case in asked.case or WORST:
        first, later = timed(case)
        print(line(first, later, case), flush=True)
        rows.append({"case": case, "first_ms": f"{first:.4f}", "later_ms": f"{later:.4f}", "bar_ms": BAR})
    if not (asked.case or asked.no_csv):
        stamp = machine_stamp()
        write_csv(RESULTS / file_name("slowest-calls", stamp), rows, stamp)


if __name__ == "__main__":
    main()
