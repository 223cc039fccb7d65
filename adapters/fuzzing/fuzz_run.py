"""The search: rounds of invented cases, every disagreement judged, shrunk and kept, in a folder to go on from.

    from collide.adapters.fuzzing.fuzz_run import fuzz
    run = fuzz(["coal", "fcl"], "findings", minutes=10, seed=1)
    run.ours, run.kinds, run.findings()

``fuzz.json`` in the folder holds the seed, the rounds done and what was met; each finding has files of its own. Every
file is there whole or not at all: a run that is killed loses the round it was in.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from collide.adapters.fuzzing import shrink as shrinking
from collide.adapters.fuzzing.disagreements import KINDS, OURS, Examiner, Flaw
from collide.adapters.fuzzing.engine_session import EngineSession
from collide.adapters.fuzzing.findings import Finding, kind_of, load_finding, save_finding, simpler_of
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.invented_scenes import invent
from collide.adapters.peers.protocol import engine
from collide.errors import InvalidArgument
from collide.whole_file import write_whole

STATE = "fuzz.json"
#: Changes where a state written before would be misread.
FORMAT = 1
#: Pairs a round, and pairs asked at a time.
ROUND, BATCH = 60, 20


@dataclass
class FuzzRun:
    """A search and what it has met so far.

    Parameters
    ----------
    folder : str
        Where its files are.
    seed : int
        Other seeds invent other cases.
    engines : list of str
        Those that are asked, collide apart.
    rounds, pairs : int
        Done, and cases in them.
    seconds : float
        Spent, over all times it was gone on with [s].
    kinds : dict of str to int
        "engine | kind | shape | shape | position", as first met → how often.
    shrunk : dict of str to str
        The same → the finding's file.
    """

    folder: str
    seed: int
    engines: list[str]
    rounds: int = 0
    pairs: int = 0
    seconds: float = 0.0
    kinds: dict[str, int] = field(default_factory=dict)
    shrunk: dict[str, str] = field(default_factory=dict)

    @property
    def ours(self) -> int:
        """How many kinds of wrong answers of collide's were met."""
        return sum(kind.split(" | ")[0] == OURS for kind in self.shrunk)

    def findings(self) -> list[Finding]:
        """What is kept, the gravest kinds first.

        Returns
        -------
        list of Finding
            One for each kind, read from the folder.
        """
        findings = [load_finding(Path(self.folder) / name)[0] for name in sorted(set(self.shrunk.values()))]
        return sorted(findings, key=lambda f: (f.flaw.engine, KINDS.index(f.flaw.kind), -f.flaw.severity))

    def counts(self) -> dict[str, Counter]:
        """Wrong answers by engine and kind.

        Returns
        -------
        dict of str to Counter
            Engine → kind of error → how many pairs.
        """
        made: dict[str, Counter] = {name: Counter() for name in (OURS, *self.engines)}
        for kind, times in self.kinds.items():
            name, error, *_ = kind.split(" | ")
            made[name][error] += times
        return made

    def to_dict(self) -> dict[str, Any]:
        """The state for JSON.

        Returns
        -------
        dict
            What `fuzz.json` holds.
        """
        return {
            "format": FORMAT, "seed": self.seed, "engines": self.engines, "rounds": self.rounds, "pairs": self.pairs,
            "seconds": self.seconds, "kinds": self.kinds, "shrunk": self.shrunk,
        }  # fmt: skip

    def save(self) -> None:
        """Write the state into its folder."""
        write_whole(Path(self.folder) / STATE, json.dumps(self.to_dict(), indent=1) + "\n")


def fuzz(
    engines: Sequence[str], folder: str | Path, *, minutes: float = 60.0, rounds: int | None = None, seed: int = 0,
    resume: bool = False, timeout: float = 5.0, progress: Callable | None = None,
    source: Callable[[int, int], list[Case]] = invent,
) -> FuzzRun:
    """Invent scenes, ask engines, keep one small case of every kind of wrong answer.

    Parameters
    ----------
    engines : sequence of str
        Names of `collide.adapters.peers.protocol.ENGINES`. collide itself is always asked and judged.
    folder : str or Path
        Where findings and the state go; made if need be.
    minutes : float
        How long to search; what is being shrunk then is finished.
    rounds : int, optional
        Stop after so many rounds in all.
    seed : int
        Other seeds invent other cases.
    resume : bool
        Go on with what the folder holds.
    timeout : float
        How long an engine may take for one pair [s].
    progress : callable, optional
        Called with a label, gives a context manager, which gives a function that changes the label.
    source : callable
        From (seed, number of the round) to its cases.

    Returns
    -------
    FuzzRun
        What was met, in this and earlier times.

    Raises
    ------
    InvalidArgument
        For unknown engines, and a folder that holds another run, or one that is not to be gone on with.
    MissingExtra
        Where an engine's package is absent.
    """
    names = list(dict.fromkeys(name for name in engines if name != OURS))
    for name in names:
        engine(name).require()
    run = _opened(Path(folder), seed, names, resume)
    deadline, started, before = time.monotonic() + 60.0 * minutes, time.monotonic(), run.seconds
    with ExitStack() as stack:
        sessions = {name: stack.enter_context(closing(EngineSession(name, timeout))) for name in names}
        rename = stack.enter_context((progress or nullcontext_of)("fuzzing")) or (lambda label: None)
        examiner = Examiner({name: session.answer for name, session in sessions.items()})
        while time.monotonic() < deadline and (rounds is None or run.rounds < rounds):
            if not _round(run, examiner, source(seed, run.rounds), deadline, rename):
                break
            run.rounds, run.seconds = run.rounds + 1, before + time.monotonic() - started
            run.save()
    return run


def nullcontext_of(label: str):
    """A progress that says nothing."""
    return nullcontext()


def _opened(folder: Path, seed: int, names: list[str], resume: bool) -> FuzzRun:
    """The run of a folder, new or gone on with."""
    place = folder / STATE
    if not place.exists():
        folder.mkdir(parents=True, exist_ok=True)
        run = FuzzRun(str(folder), seed, names)
        run.save()
        return run
    try:
        state = json.loads(place.read_text(encoding="utf-8"))
        known = state.pop("format")
        run = FuzzRun(str(folder), **state)
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InvalidArgument(f"{place} is no state of a search: give another folder") from None
    if known != FORMAT:
        raise InvalidArgument(f"{place} was written by another version of collide: give another folder")
    if not resume:
        raise InvalidArgument(
            f"{folder} holds a search of {run.rounds} rounds: go on with it (--resume), or give another folder"
        )
    if (run.seed, run.engines) != (seed, names):
        raise InvalidArgument(
            f"{folder} holds a search with seed {run.seed} of {', '.join(run.engines)}: go on with the same, or give "
            "another folder"
        )
    return run


def _round(run: FuzzRun, examiner: Examiner, cases: list[Case], deadline: float, rename: Callable) -> bool:
    """One round; False where time ran out before its end: it is not counted, and what it shrank is kept."""
    met: Counter = Counter()
    for start in range(0, len(cases), BATCH):
        rename(
            f"round {run.rounds + 1}: {run.pairs + start} pairs asked, {len(set(run.shrunk.values()))} kinds of wrong "
            "answers"
        )
        batch = cases[start : start + BATCH]
        for case, flaws in zip(batch, examiner.flaws(batch)):
            for flaw in flaws:
                kind = " | ".join(kind_of(case, flaw))
                met[kind] += 1
                if kind not in run.shrunk:
                    rename(f"round {run.rounds + 1}: shrinking {kind}")
                    run.shrunk[kind] = _shrink_and_save(run, examiner, case, flaw)
                    run.save()
                    if time.monotonic() >= deadline:
                        return False
    run.kinds = dict(Counter(run.kinds) + met)
    run.pairs += len(cases)
    return True


def _shrink_and_save(run: FuzzRun, examiner: Examiner, case: Case, flaw: Flaw) -> str:
    """Shrink a case and write it down, unless a simpler one of its kind is there; the file's name."""
    small = shrinking.shrink(case, flaw, examiner.flaws)
    finding = Finding(small.case, small.flaw, run.seed, run.rounds, 1, small.is_minimal)
    place = Path(run.folder) / f"{finding.stem}.json"
    if place.exists():
        finding = simpler_of(load_finding(place)[0], finding)
    return save_finding(finding, run.folder).name
