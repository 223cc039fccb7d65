"""A trajectory proven free at all times, between samples, too.

A single robot may move. Links and carried bodies are tested against all other bodies as of the first waypoint, by
`RobotChecker.certify_path`; a clearance pads links and carried bodies against bodies around.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import collide
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.reports.number_format import brief_length, count
from collide.reports.progress import silent

if TYPE_CHECKING:
    from collide.reports.trajectory_report import Path

#: Intervals in which no joint moves by more [rad or m] are not halved any more.
RESOLUTION = 1e-3
_PROVING = "proving the trajectory"


def prove(scene, path: Path, clearance: float = 0.0, resolution: float = RESOLUTION, progress=None) -> dict:
    """The plain data ``proof`` of a trajectory in ``schema.json``: shares of the path proven, open, and the first hit.

    scene : at the first waypoint.   path : sampled, with all waypoints.   clearance, resolution : [m], [rad or m].
    progress : as in `report.make`.
    """
    with (progress or silent)(_PROVING) as set_label:
        set_share = (lambda done, n: set_label(f"{_PROVING}: {done / n:.0%}")) if set_label else None
        proof = _prove(scene, path, clearance, resolution, set_share)
    return {**proof, "text": _in_words(proof)}


def _prove(scene, path: Path, clearance: float, resolution: float, set_share) -> dict:
    """The proof without words.   set_share : called with the motions done and their number, or None."""
    corners = np.unique(path.waypoint, return_index=True)[1]
    waypoints = {name: q[corners] for name, q in path.configurations.items()}
    moving = [name for name, q in waypoints.items() if (q != q[0]).any()]
    if len(moving) > 1:
        return _nothing(clearance, f"{count(len(moving), 'robot moves', 'robots move')} at once: proofs are of one")
    robot = (moving or list(waypoints))[0]
    q, shares = waypoints[robot], path.share[corners]
    if len(q) == 1:
        q, shares = np.concatenate([q, q]), np.array([0.0, 1.0])
    try:
        checker = collide.RobotChecker.from_scene(scene, robot, padding=clearance)
        made = checker.certify_path(q, resolution=resolution, progress=set_share)
    except (InvalidArgument, UnsupportedQuery) as error:
        return _nothing(clearance, str(error))
    at = np.interp
    segments = np.arange(len(shares))
    open_rows = [
        {"a": a, "b": b, "begin": float(at(begin, segments, shares)), "end": float(at(end, segments, shares))}
        for (a, b), begin, end in zip(made.open_names, made.open["begin"], made.open["end"])
    ]
    proven = [[float(v) for v in at(ends, segments, shares)] for ends in _proven_intervals(made)]
    return {
        "robot": robot, "why": None, "clearance": clearance, "free": made.is_free, "share": made.share,
        "first_collision": _first(scene, robot, made, q, shares, path.times if path.times is None
                                  else path.times[corners]),
        "proven": proven, "open": open_rows, "checked": made.n_checked,
    }


def _nothing(clearance: float, why: str) -> dict:
    return {
        "robot": None, "why": why, "clearance": clearance, "free": False, "share": 0.0, "first_collision": None,
        "proven": [], "open": [], "checked": 0,
    }


def _proven_intervals(made) -> list[tuple[float, float]]:
    """Intervals of a path proven free, neighbours as one."""
    out: list[tuple[float, float]] = []
    for k in range(len(made)):
        begin, end = float(made.breaks[k]), float(made.breaks[k + 1])
        last = end if np.isnan(made.time[k]) else float(made.time[k])
        cuts = made.open[made.open["edge"] == k]
        for low, high in [*zip(cuts["begin"].tolist(), cuts["end"].tolist()), (last, last)]:
            if low > begin:
                joins = bool(out) and out[-1][1] == begin
                out[-1:] = [(out[-1][0], low)] if joins else [*out[-1:], (begin, low)]
            begin = max(begin, high)
    return out


def _first(scene, robot: str, made, q: np.ndarray, shares: np.ndarray, times: np.ndarray | None) -> dict | None:
    """The first collision, or the first place nearer than the clearance: the nearest pair there, and where."""
    if made.first is None:
        return None
    segment, time = made.first
    part = time - segment
    plain = collide.RobotChecker.from_scene(scene, robot)
    d = plain.distances((q[segment] + part * (q[segment + 1] - q[segment]))[None])
    a, b = d.names[0] or ("", "")
    place = np.arange(len(shares))
    return {
        "a": a, "b": b, "distance": float(d.distance[0]), "share": float(np.interp(time, place, shares)),
        "time": None if times is None else float(np.interp(time, place[: len(times)], times)),
    }


def _in_words(proof: dict) -> str:
    """The proof in words."""
    if proof["why"] is not None:
        return f"not proven between samples: {proof['why']}"
    beyond = f", {brief_length(proof['clearance'])} and more from what is around" if proof["clearance"] else ""
    if proof["free"]:
        return f"all of the path is proven free{beyond}"
    first = proof["first_collision"]
    text = f"{100 * proof['share']:.4g} % of the path is proven free{beyond}"
    if first is not None:
        meets = "collide" if first["distance"] <= 0.0 else f"are {brief_length(first['distance'])} apart"
        text += f"; at {100 * first['share']:.4g} % {first['a']} and {first['b']} {meets}"
    if proof["open"]:
        text += f"; {count(len(proof['open']), 'interval stays', 'intervals stay')} open"
    return text
