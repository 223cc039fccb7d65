"""Signs of pairs that touch, or nearly, with a cylinder, cone or ellipsoid, by the hundred thousand.

    python tests/soak/soak_curved_signs.py --pairs 100000 [--seed 1]
    python tests/soak/soak_curved_signs.py --seed 1 --case 1234          one pair again

Families of `touching_pairs.py`, in turns: exact touches, which have to be hits; touches moved by an ulp in all
coordinates, and bodies brought together along their normal, judged by `curved_oracle.py` in decimals of 80 digits.
Prints a row a family (pairs, those left open, those judged, wrong signs, brackets that miss, milliseconds in the
median, the last hundredth and at most), and failures as they come. Ends with status 1 where a sign or bracket is wrong.
100,000 pairs take about forty minutes of a core.
"""

from __future__ import annotations

import argparse
import collections
import sys
import time
from decimal import Decimal
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "oracles"))

import numpy as np
from curved_oracle import bracket
from touching_pairs import Pair, exact_pair, near_pair

import collide

FAMILIES = "touching", "an ulp beside", "brought together", "brought together, scaled"


def pair_of(seed: int, case: int) -> tuple[str, Pair]:
    """(family, pair) of a case."""
    rng = np.random.default_rng([seed, case])
    family = FAMILIES[case % len(FAMILIES)]
    scale = 2.0 ** int(rng.integers(-30, 31)) if rng.random() < 0.3 or family.endswith("scaled") else 1.0
    if family.startswith("brought"):
        return family, near_pair(rng, scale)
    pair = exact_pair(rng, scale, 1.0 + 2.0**-40 if rng.random() < 0.2 else 1.0)
    if family == "an ulp beside":
        pair.X_WB[:3, 3] = np.nextafter(pair.X_WB[:3, 3], np.where(rng.random(3) < 0.5, -np.inf, np.inf))
    return family, pair


def flaw_of(family: str, pair: Pair, r) -> str | None:
    """What is wrong about a row; None for a row that is right."""
    if family == "touching":
        return None if r.hit and r.lower <= 0.0 <= r.upper else f"touches, but {r.lower} to {r.upper}"
    known = bracket(pair.A, pair.B, pair.X_WA, pair.X_WB, depths=False)
    if r.how != 0 and known.hit not in (None, r.hit):
        return f"hit is {r.hit}, but {float(known.lower)} to {float(known.upper)}"
    if known.lower > Decimal(r.upper) or known.upper < Decimal(r.lower):
        return f"{r.lower} to {r.upper} misses {float(known.lower)} to {float(known.upper)}"
    return None


def soak(seed: int, cases, say=print) -> dict[str, dict]:
    """Counts of each family; failures are told as they come."""
    tally: dict[str, dict] = collections.defaultdict(lambda: {"open": 0, "wrong": 0, "ms": []})
    for case in cases:
        family, pair = pair_of(seed, case)
        count = tally[family]
        start = time.perf_counter()
        r = collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB)
        count["ms"].append(1e3 * (time.perf_counter() - start))
        flaw = flaw_of(family, pair, r)
        if flaw is None and collide.collide(pair.A, pair.B, pair.X_WA, pair.X_WB) != r.hit:
            flaw = "collide and distance differ"
        if r.how == 0:
            count["open"] += 1
            say(f"open: case {case}\n{pair}")
        if flaw:
            count["wrong"] += 1
            say(f"wrong: case {case}: {flaw}\n{pair}")
    return tally


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", type=int)
    args = parser.parse_args()
    tally = soak(args.seed, range(args.pairs) if args.case is None else [args.case])
    for family, count in tally.items():
        median, late, most = np.quantile(count["ms"], [0.5, 0.99, 1.0])
        print(
            f"{family:26} pairs {len(count['ms']):6}  open {count['open']:4}  wrong {count['wrong']:4}"
            f"  ms {median:.3f} {late:.1f} {most:.1f}"
        )
    return int(any(count["wrong"] for count in tally.values()))


if __name__ == "__main__":
    sys.exit(main())
