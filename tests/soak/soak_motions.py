"""Random motions by the hundred thousand, each time of impact judged by dense sampling and subdivision.

    python tests/soak/soak_motions.py --motions 1000000 [--seed 1] [--families "boxes at random,grazing"]

The families of `tests/families/motions.py`, in turns. `motion_oracle.py` judges every motion twice: `judge` samples
the time before `lower`, ever closer where bodies come nearest, and `subdivide` leaves no time out, so that a contact
deeper than a millionth of the bodies' size would be seen, however short. Contact at `upper` is looked at, too. Prints a
row a family: motions, hits, free ones, open ones, brackets wider than the tolerance, contacts missed and made up, and
the time a motion took; failures as they come, with code that asks again. Ends with status 1 where anything failed. A
million take about an hour of one core, nearly all of it the judge's.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(TESTS / "oracles"), str(TESTS / "families")]

import motion_oracle as oracle
import motions
import numpy as np

import collide

#: Motions of a group, of one pair of shapes; fewer where making or judging them is slow.
GROUP = 500
FEWER = {"grazing": 20, "unions": 100, "a solid mesh and a box": 100, "a surface and a tetrahedron": 50}
#: Spans in which bodies move by less than this share of their size are not subdivided.
FLOOR = 1e-6
#: Seeds of a family's groups begin with its number and go on with that of the group.
COLUMNS = ("motions", "hits", "free", "open", "wide", "missed", "made up", "µs")


class Tally:
    """What was judged of one family."""

    def __init__(self) -> None:
        self.counts = dict.fromkeys(COLUMNS[:-1], 0)
        self.seconds = 0.0

    def line(self, family: str) -> str:
        n = max(self.counts["motions"], 1)
        cells = [f"{value:>9}" for value in self.counts.values()] + [f"{self.seconds / n * 1e6:>9.2f}"]
        return f"{family:38}" + "".join(cells)


def soak_group(family: str, seed: list[int], n: int, tally: Tally) -> None:
    """Ask and judge one group."""
    group = motions.FAMILIES[family](np.random.default_rng(seed), n)
    turns = {"omega_WA": group.omega_WA, "omega_WB": group.omega_WB}
    begin = time.perf_counter()
    r = collide.time_of_impact(group.A, group.B, *group.poses, **turns)
    tally.seconds += time.perf_counter() - begin
    tolerance = motions.resolution(group)
    verdict = oracle.judge(group.gap, *group.motions(), r.lower, r.upper, tolerance=tolerance)
    closer = oracle.subdivide(group.gap, *group.motions(), r.lower, group.speeds(), FLOOR * group.size, tolerance)
    missed = verdict.missed | closer.missed
    depth, when = np.maximum(verdict.depth, closer.depth), np.where(verdict.missed, verdict.time, closer.time)
    proven = r.hit & np.isfinite(r.upper)
    made_up = proven & (verdict.at_upper > tolerance)
    bad = missed | made_up | ~(r.lower <= r.upper) | (~r.hit & ~r.certified)
    for k in np.flatnonzero(bad)[:3].tolist():
        print(
            f"FAILED motions.FAMILIES[{family!r}](np.random.default_rng({seed}), {n}), motion {k}: lower "
            f"{r.lower[k]!r}, upper {r.upper[k]!r}; {depth[k]:.3g} m deep at {when[k]!r}, "
            f"{verdict.at_upper[k]:.3g} m apart at upper",
            flush=True,
        )
    counted = (
        np.ones(n, dtype=bool), proven, ~r.hit, r.hit & ~proven, proven & ~r.certified, missed, made_up
    )
    for name, mask in zip(tally.counts, counted):
        tally.counts[name] += int(mask.sum())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", type=int, default=20_000, help="how many in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--families", help="names with commas between; all without")
    arguments = parser.parse_args()
    names = arguments.families.split(",") if arguments.families else list(motions.FAMILIES)
    tallies = {name: Tally() for name in names}
    sizes = {name: FEWER.get(name, GROUP) for name in names}
    for k in range(-(-arguments.motions // sum(sizes.values()))):
        for number, (name, size) in enumerate(sizes.items()):
            soak_group(name, [arguments.seed, number, k], size, tallies[name])
    print(f"{'family':38}" + "".join(f"{name:>9}" for name in COLUMNS))
    for name, tally in tallies.items():
        print(tally.line(name))
    failed = sum(tally.counts["missed"] + tally.counts["made up"] for tally in tallies.values())
    total = sum(tally.counts["motions"] for tally in tallies.values())
    print(f"{total} motions, {failed} failures")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
