"""Random pairs of all kinds of shapes, sizes up to 1:10^6, near touching on purpose, each answer judged by an oracle.

    python tests/soak/soak.py --minutes 5 --seed 1 [--ratio 1e6] [--kinds cone,sphere] [--save DIR]
    python tests/soak/soak.py --seed 1 --case 1234          one case again, with its code

Pairs and poses are drawn in `soak_pairs.py`, what is asked of each is in `soak_judges.py`, and the truth comes from
`curved_oracle.py`, which shares no code with the engine. Prints failures as they come, with code that asks again, and
at the end how many there were of each promise and of each pair of kinds. Ends with status 1 where anything failed.
"""

from __future__ import annotations

import argparse
import collections
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "oracles"))

from soak_judges import judge, judge_group
from soak_pairs import KINDS, draw

#: Failures of one promise and pair of kinds whose code is printed.
SHOWN = 1
#: So many cases are asked together as well, in one batch and in one World.
GROUP = 6
#: Longer code is told by its case number alone; --save keeps all of it.
LONGEST = 4000


class Tally:
    """What was judged so far."""

    def __init__(self) -> None:
        self.pairs: collections.Counter = collections.Counter()
        self.failed: collections.Counter = collections.Counter()
        self.promises: dict[str, set[int]] = collections.defaultdict(set)
        self.where: collections.Counter = collections.Counter()
        self.truths: collections.Counter = collections.Counter()
        self.told = 0

    def add(self, case, judged) -> list[tuple[str, str, str]]:
        """Counts a case; the failures of which something is to be printed."""
        self.pairs[case.kinds] += 1
        self.truths[judged.truth] += 1
        self.told += judged.told
        new = []
        for failure in judged.failures:
            self.promises[failure[0]].add(case.number)
            self.where[failure[0], case.kinds] += 1
            if self.where[failure[0], case.kinds] <= SHOWN:
                new.append(failure)
        self.failed[case.kinds] += bool(judged.failures)
        return new

    def add_group(self, number: int, failures) -> list[tuple[str, str, str]]:
        """Counts failures of cases asked together; those that are to be printed."""
        new = []
        for failure in failures:
            self.promises[failure[0]].add(number)
            self.where[failure[0], ("many", "bodies")] += 1
            if self.where[failure[0], ("many", "bodies")] <= SHOWN:
                new.append(failure)
        return new

    def summary(self) -> str:
        total, failed = sum(self.pairs.values()), sum(self.failed.values())
        lines = [
            (
                f"{failed}/{total} pairs failed: {self.truths[False]} apart, {self.truths[True]} hits, "
                f"{self.truths[None]} open; "
                f"the oracle was as sharp as the engine in {self.told}"
            ),
            "",
            *(
                f"{self.failed[kinds]:6d}/{count:<6d} {kinds[0]} | {kinds[1]}"
                for kinds, count in sorted(self.pairs.items())
            ),
            "",
        ]
        for promise, cases in sorted(self.promises.items(), key=lambda item: -len(item[1])):
            kinds = collections.Counter({k[1]: n for k, n in self.where.items() if k[0] == promise}).most_common(3)
            most = ", ".join(f"{a} | {b} {n}" for (a, b), n in kinds)
            lines.append(f"{len(cases):6d} pairs: {promise}   (cases {sorted(cases)[:4]}; {most})")
        return "\n".join(lines if self.promises else [*lines, "no promise was broken"])


def soak(
    seed: int, ratio: float, kinds, *, minutes: float = float("inf"), pairs: int | None = None, say=print, save=None
) -> Tally:
    """Judge cases 0, 1, 2 … until the time is up or so many are judged."""
    tally, began, told = Tally(), time.monotonic(), time.monotonic()
    number, group = 0, []
    while (pairs is None or number < pairs) and time.monotonic() - began < 60 * minutes:
        case = draw(seed, number, ratio, kinds)
        for failure in tally.add(case, judged := judge(case)):
            say(_shown(case, failure))
        if save is not None and judged.failures:
            (save / f"case_{seed}_{number}.py").write_text("\n\n".join(_code(*failure) for failure in judged.failures))
        number += 1
        group = [*group, case][-GROUP:]
        if number % (4 * GROUP) == 0:
            for failure in tally.add_group(number - 1, judge_group(group, _group_code(seed, ratio, kinds, group))):
                say(_code(*failure))
        if time.monotonic() - told > 20:
            told = time.monotonic()
            say(f"… {number} pairs in {told - began:.0f} s, {sum(tally.failed.values())} failed")
    return tally


def _group_code(seed: int, ratio: float, kinds, group) -> str:
    numbers = [case.number for case in group]
    return (
        "import sys, numpy as np, collide as C; sys.path[:0] = ['tests/soak', 'tests/oracles']\nfrom soak_pairs "
        "import draw\n"
        f"cases = [draw({seed}, k, {ratio!r}, {tuple(kinds)!r}) for k in {numbers}]\n"
    )


def _code(promise: str, found: str, text: str) -> str:
    comment = f"{promise}: {found}".replace("\n", "\n# ")
    return f"# {comment}\n{text}\n"


def _shown(case, failure) -> str:
    text = _code(*failure)
    if len(text) > LONGEST:
        text = _code(*failure[:2], "# long: --case shows it")
    return f"--- case {case.number}, {case.kinds[0]} | {case.kinds[1]}, {case.poses}\n{text}"


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--pairs", type=int, help="judge so many pairs, whatever time it takes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ratio", type=float, default=1e6, help="largest ratio of sizes (default 1e6)")
    parser.add_argument("--kinds", help=f"of {', '.join(KINDS)}")
    parser.add_argument("--case", type=int, help="judge this case alone")
    parser.add_argument("--save", type=Path, help="a folder for the code of every failure")
    asked = parser.parse_args(arguments)
    kinds = tuple(asked.kinds.split(",")) if asked.kinds else KINDS
    if unknown := set(kinds) - set(KINDS):
        parser.error(f"--kinds: {', '.join(sorted(unknown))}: there are {', '.join(KINDS)}")
    if asked.case is not None:
        judged = judge(draw(asked.seed, asked.case, asked.ratio, kinds))
        print("\n\n".join(_code(*failure) for failure in judged.failures) or "no promise was broken")
        return bool(judged.failures)
    if asked.save:
        asked.save.mkdir(parents=True, exist_ok=True)
    minutes = asked.minutes if asked.pairs is None else float("inf")
    tally = soak(asked.seed, asked.ratio, kinds, minutes=minutes, pairs=asked.pairs, save=asked.save)
    print(tally.summary())
    return bool(tally.promises)


if __name__ == "__main__":
    sys.exit(main())
