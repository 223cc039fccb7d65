"""The block of states: several states of a scene, or samples of a trajectory, to slide through.

A path of more samples than a page shows loses samples in between, never samples at which the verdict changes, the
first, the last, or the nearest approach; of too many changes, the page says how many are left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.pages.body_verdicts import NOT_ANSWERED, ORDER, body_verdicts, verdict_columns, worst
from collide.pages.drawn_points import as_base64
from collide.reports import classes
from collide.reports.number_format import count
from collide.reports.report import Report
from collide.reports.state_reports import Stated
from collide.reports.trajectory_report import Look, Watch

#: Samples of a trajectory that a page shows.
MAX_SAMPLES = 600
#: The most listed pairs of a class in a state.
MAX_ROWS = 50
#: Poses beyond are drawn there [m]: single precision ends at 3.4e38.
_LARGEST = 1e30

#: (a, b, distance, lower, upper) of a pair: rows of bodies, and lengths [m], None where unbounded.
PairRow = tuple[int, int, float | None, float | None, float | None]


class ClassRows(NamedTuple):
    """The pairs of a class in a state: the listed pairs, and the number of all."""

    rows: list[PairRow]
    size: int


def of_states(made: Sequence[Stated]) -> dict:
    """The block of a scene reported on in several states.

    made : the reports, one a state, all of the same bodies.
    """
    names = [body.name for body in made[0].scene.bodies]
    row_of = {name: row for row, name in enumerate(names)}
    poses = np.array([[body.X_WB for body in state.scene.bodies] for state in made]).reshape(len(made), -1, 4, 4)
    moving = np.flatnonzero((poses != poses[0]).any(axis=(0, 2, 3)))
    rows, verdicts = [], []
    for state in made:
        by_class = {name: _of_report(getattr(state.report, name), row_of) for name in classes.NAMES}
        rows.append(_state_row(by_class, _least(state), bool(state.report.unanswered)))
        verdicts.append(verdict_columns(body_verdicts(state.scene, state.report), row_of))
    return {
        "labels": [state.label for state in made], "shares": None, "times": None, "samples": None, "start": 0,
        "moving": moving.tolist(), "poses": _poses_as_text(poses[:, moving]), "rows": rows, "body_verdicts": verdicts,
    }


def of_trajectory(stated: Stated, max_samples: int = MAX_SAMPLES) -> dict:
    """The block of a trajectory: rows tell of pairs with moving bodies, verdicts of bodies of all pairs.

    stated : with its ``watch``, after following the trajectory.   max_samples : the most samples shown.
    """
    watch, path = stated.watch, stated.watch.path
    row_of = {body.name: row for row, body in enumerate(stated.scene.bodies)}
    samples, left_out = samples_of_page(watch, max_samples)
    poses, rows, verdicts = [], [], []
    for moment in moments(stated, samples):
        poses.append(moment.poses)
        rows.append(_state_row(_of_look(moment.look), moment.look.least, bool(watch.unanswered)))
        verdicts.append(verdict_columns(moment.verdicts, row_of))
    times = None if path.times is None else path.times[samples].tolist()
    return {
        "labels": [f"{100 * share:.3g} %" for share in path.share[samples]], "shares": path.share[samples].tolist(),
        "times": times, "samples": _about(len(samples), len(path.share), left_out), "start": 0,
        "moving": [row_of[name] for name in watch.moving], "poses": _poses_as_text(np.array(poses)), "rows": rows,
        "body_verdicts": verdicts,
    }


class Moment(NamedTuple):
    """A sample of a trajectory: poses (m, 4, 4) of the moving bodies, the near pairs, and body → verdict."""

    poses: np.ndarray
    look: Look
    verdicts: dict[str, str]


def moments(stated: Stated, samples: np.ndarray) -> Iterator[Moment]:
    """Each of some samples of a trajectory.   stated : as of `of_trajectory`."""
    watch = stated.watch
    standing = _standing_verdicts(stated)
    open_pairs = {entry[side]: NOT_ANSWERED for entry in watch.unanswered for side in ("a", "b")}
    for k, poses in zip(samples.tolist(), watch.poses_at(samples)):
        look = watch.look_at(k, poses)
        verdicts = dict(standing)
        for name, verdict in (*_bodies_of(look, watch.names), *open_pairs.items()):
            verdicts[name] = worst((verdicts.get(name, ORDER[-1]), verdict))
        yield Moment(poses, look, verdicts)


# --- which samples ------------------------------------------------------------------------------


def samples_of_page(watch: Watch, max_samples: int = MAX_SAMPLES) -> tuple[np.ndarray, int]:
    """(n,) samples of a path to show, ascending, and how many changes of verdict are not among them.

    Both sides of a change are shown, the ends, the first collision and the least distance; others evenly between.
    """
    total = len(watch.path.share)
    wanted = {0, total - 1, *(event["sample"] for event in (watch.first, watch.least) if event is not None)}
    changes = np.flatnonzero(np.diff(watch.verdicts)) + 1
    fitting = max(0, (max_samples - len(wanted)) // 2)
    visible = changes if len(changes) <= fitting else changes[np.linspace(0, len(changes) - 1, fitting).astype(int)]
    wanted.update(visible.tolist(), (visible - 1).tolist())
    if total <= max_samples:
        return np.arange(total), 0
    others = np.setdiff1d(np.arange(total), np.array(sorted(wanted)))
    free = max(0, max_samples - len(wanted))
    even = others[np.unique(np.linspace(0, len(others) - 1, free).astype(int))] if free and len(others) else others[:0]
    return np.array(sorted(wanted | set(even.tolist()))), len(changes) - len(visible)


def _about(n: int, total: int, left_out: int) -> str:
    """``600 of 2001``, and what is not among them."""
    return f"{n} of {total}" + (f", without {count(left_out, 'change')} of verdict, of" if left_out else "")


# --- plain data ---------------------------------------------------------------------------------


def _state_row(by_class: Mapping[str, ClassRows], least: float | None, is_open: bool) -> dict:
    verdicts = [name for name, pairs in by_class.items() if pairs.size] + [NOT_ANSWERED] * is_open
    return {
        "verdict": worst(verdicts), **{name: pairs.rows for name, pairs in by_class.items()},
        "left_out": sum(pairs.size - len(pairs.rows) for pairs in by_class.values()), "clearance": least,
    }


def _of_report(pairs, row_of: Mapping[str, int]) -> ClassRows:
    listed = [(row_of[p.a], row_of[p.b], p.distance, p.lower, p.upper) for p in pairs[:MAX_ROWS]]
    return ClassRows(listed, len(pairs))


def _of_look(look: Look) -> dict[str, ClassRows]:
    """Deepest or nearest first; a World's ids are rows of the scene's bodies."""
    listed = {}
    for name, indices in look.by_class.items():
        rows = look.rows[indices]
        rows = rows[np.argsort(rows["distance"], kind="stable")][:MAX_ROWS]
        ends = ([_finite(x) for x in rows[end].tolist()] for end in ("distance", "lower", "upper"))
        listed[name] = ClassRows(list(zip(rows["a"].tolist(), rows["b"].tolist(), *ends)), len(indices))
    return listed


def _bodies_of(look: Look, names: Mapping[int, str]) -> Iterable[tuple[str, str]]:
    """(body, class) of every pair at a sample; a body of several pairs comes several times."""
    for name, indices in look.by_class.items():
        rows = look.rows[indices]
        yield from ((names[body], name) for body in {*rows["a"].tolist(), *rows["b"].tolist()})


def _standing_verdicts(stated: Stated) -> dict[str, str]:
    """Body → its worst class in pairs without moving bodies, constant along the trajectory."""
    report, moving = stated.report, set(stated.watch.moving)
    standing: dict[str, str] = {}
    for verdict, pairs in _named_pairs(report):
        for a, b in pairs:
            if not moving & {a, b}:
                for name in (a, b):
                    standing[name] = worst((standing.get(name, verdict), verdict))
    return standing


def _named_pairs(report: Report) -> Iterable[tuple[str, Iterable[tuple[str, str]]]]:
    for name in classes.NAMES:
        yield name, ((pair.a, pair.b) for pair in getattr(report, name))
    yield NOT_ANSWERED, ((entry["a"], entry["b"]) for entry in report.unanswered)


def _least(stated: Stated) -> float | None:
    """The signed distance of the nearest pair [m]; ``None`` without a pair, or where unbounded or not known."""
    world = stated.scene.world()
    for a, b in stated.report.query["ignored"]:
        world.allow(a, b)
    for entry in stated.report.unanswered:
        world.allow(entry["a"], entry["b"])
    try:
        rows = world.minimum().rows
    except UnsupportedQuery:
        return None
    return _finite(float(rows["distance"][0])) if len(rows) else None


def _finite(value: float) -> float | None:
    return value + 0.0 if math.isfinite(value) else None


def _poses_as_text(poses: np.ndarray) -> str:
    """(states, bodies, 4, 4) as rows of [R | p] in single precision."""
    return as_base64(np.clip(poses[:, :, :3, :], -_LARGEST, _LARGEST).astype("<f4"))
