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
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from collide.adapters.fuzzing.disagreements import KINDS, OURS, Examiner, Flaw
from collide.adapters.fuzzing.engine_session import EngineSession
from collide.adapters.fuzzing.findings import Finding, kind_of, load_finding, save_finding, simpler_of
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.invented_scenes import invent
from collide.adapters.fuzzing.shrink import COSTLY, Shrunk, shrink
from collide.adapters.peers.answers import HUNG
from collide.adapters.peers.protocol import engine
from collide.base.given_files import read_text
from collide.base.whole_file import write_whole
from collide.errors import InvalidArgument

STATE = "fuzz.json"
#: Changes where a state written before would be misread.
FORMAT = 1
#: Pairs asked at a time.
BATCH = 20
#: Simpler cases that may be asked for each pair of the search, and beyond that at all times; what a hang or an abort
#: counts as.
SHRINK_SHARE, SHRINK_AT_LEAST, COSTLY_CASE = 2, 5000, 50
#: How long an engine may be silent about the simpler cases of a hang [s]; the last is asked with the whole limit again.
HURRIED = 1.0


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
    invented : dict of str to int
        Source, "shape X", → how many of the pairs.
    waiting : dict of str to list
        Kinds that are not shrunk yet → number of the round, and of the case in it, where each was met first.
    tried : int
        Simpler cases asked, costly ones counted as several.
    """

    folder: str
    seed: int
    engines: list[str]
    rounds: int = 0
    pairs: int = 0
    seconds: float = 0.0
    kinds: dict[str, int] = field(default_factory=dict)
    shrunk: dict[str, str] = field(default_factory=dict)
    invented: dict[str, int] = field(default_factory=dict)
    waiting: dict[str, list[int]] = field(default_factory=dict)
    tried: int = 0

    @property
    def ours(self) -> int:
        """How many kinds of wrong answers of collide's were met."""
        return sum(kind.split(" | ")[0] == OURS for kind in (*self.shrunk, *self.waiting))

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
            "invented": self.invented, "waiting": self.waiting, "tried": self.tried,
        }

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
        How long to search; what is being shrunk then is finished. Shrinking takes about half of it at most: what was
        not shrunk waits, the gravest kinds before the others, and `FuzzRun.waiting` has what is left.
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
        search = _Search(run, sessions, lru_cache(maxsize=8)(partial(source, seed)), deadline, rename)
        while time.monotonic() < deadline and (rounds is None or run.rounds < rounds):
            if not search.round():
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
        state = json.loads(read_text(place))
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


class _Search:
    """A run at work.

    cases_of : from the number of a round to its cases.   rename : says what is being done.
    """

    def __init__(
        self, run: FuzzRun, sessions: Mapping[str, EngineSession], cases_of: Callable[[int], list[Case]],
        deadline: float, rename: Callable,
    ):
        self.run, self.sessions, self.cases_of = run, sessions, cases_of
        self.deadline, self.rename = deadline, rename
        self.examiner = Examiner({name: session.answer for name, session in sessions.items()})

    def round(self) -> bool:
        """One round; False where time ran out before its end: it is not counted, and what it shrank is kept."""
        run = self.run
        met: Counter = Counter()
        cases = self.cases_of(run.rounds)
        for start in range(0, len(cases), BATCH):
            self.rename(_progress_line(run, start))
            batch = cases[start : start + BATCH]
            for at, (case, flaws) in enumerate(zip(batch, self.examiner.flaws(batch)), start):
                for flaw in flaws:
                    kind = " | ".join(kind_of(case, flaw))
                    met[kind] += 1
                    if kind not in run.shrunk:
                        run.waiting.setdefault(kind, [run.rounds, at])
            self._shrink_waiting()
            if time.monotonic() >= self.deadline:
                return False
        run.kinds = dict(Counter(run.kinds) + met)
        run.invented = dict(Counter(run.invented) + Counter(label for case in cases for label in _labels(case)))
        run.pairs += len(cases)
        return True

    def _shrink_waiting(self) -> None:
        """Shrink kinds that wait, the gravest first, as long as time and their share last; collide's own always."""
        run = self.run
        for kind in sorted(run.waiting, key=_gravity):
            is_ours = kind.startswith(f"{OURS} | ")
            spent = run.tried > SHRINK_AT_LEAST + SHRINK_SHARE * run.pairs or time.monotonic() >= self.deadline
            if spent and not is_ours:
                return
            self.rename(f"round {run.rounds + 1}: shrinking {kind}")
            number, at = run.waiting.pop(kind)
            case = self.cases_of(number)[at]
            for flaw in self.examiner.flaws([case], [kind.split(" | ")[0]])[0]:
                if " | ".join(kind_of(case, flaw)) == kind:  # else it is not there alone: it waits to be met again
                    run.shrunk[kind] = self._shrink_and_save(case, flaw)
                    run.save()

    def _shrink_and_save(self, case: Case, flaw: Flaw) -> str:
        """Shrink a case and write it down, unless a simpler one of its kind is there; the file's name."""
        small = shrunk_in(self.sessions, self.examiner, case, flaw)
        self.run.tried += small.asked * (COSTLY_CASE if flaw.kind in COSTLY else 1)
        finding = Finding(small.case, small.flaw, self.run.seed, self.run.rounds, 1, small.is_minimal)
        place = Path(self.run.folder) / f"{finding.stem}.json"
        if place.exists():
            finding = simpler_of(load_finding(place)[0], finding)
        return save_finding(finding, self.run.folder).name


def _gravity(kind: str) -> int:
    """Where a kind stands among those that wait to be shrunk."""
    name, error, *_ = kind.split(" | ")
    return -1 if name == OURS else KINDS.index(error)


def _labels(case: Case) -> list[str]:
    """What a case is counted as: its source, and the kinds of its shapes."""
    return [case.source or "other", *(f"shape {kind}" for kind in sorted(set(case.kinds)))]


def _progress_line(run: FuzzRun, asked: int) -> str:
    """How far a search is, with the pairs of every source."""
    sources = ", ".join(f"{n} {name}" for name, n in sorted(run.invented.items()) if not name.startswith("shape "))
    kinds = len(set(run.shrunk.values())) + len(run.waiting)
    counts = f"{run.pairs + asked} pairs, {kinds} kinds of wrong answers"
    return f"round {run.rounds + 1}: {counts}" + (f" ({sources})" if sources else "")


def shrunk_in(sessions: Mapping[str, EngineSession], examiner: Examiner, case: Case, flaw: Flaw) -> Shrunk:
    """A case shrunk; one that hangs with a short time limit, and what is left of it asked with the whole one again."""
    if flaw.kind != HUNG or flaw.engine not in sessions:
        return shrink(case, flaw, examiner.flaws)
    with sessions[flaw.engine].hurried(HURRIED):
        small = shrink(case, flaw, examiner.flaws)
    again = next((f for f in examiner.flaws([small.case], [flaw.engine])[0] if flaw.same_way(f)), None)
    return Shrunk(case, flaw, small.asked, False) if again is None else small._replace(flaw=again)
