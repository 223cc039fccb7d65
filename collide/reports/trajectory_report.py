"""A scene along a trajectory: the first collision, and the least distances, at samples between the waypoints.

Sampling proves each sample and nothing between two samples: the report says so. A body moved by no waypoint is
taken as fixed here; the report of the start has the collisions of fixed bodies with each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument, SceneError, UnsupportedQuery, brief
from collide.reports import classes
from collide.reports.number_format import brief_length, count
from collide.reports.progress import silent

#: Largest change of a joint [rad] or [m] between two samples, unless another is asked for.
RESOLUTION = 0.02
#: Longer paths are refused: values in another unit, mostly.
MAX_SAMPLES = 1_000_000
#: Samples whose poses are worked out at a time.
_CHUNK = 256
#: Samples of which a `Watch` keeps the rows, where they will be looked at again.
_MAX_KEPT = 20_000


@dataclass
class Path:
    """Joint values at every sample, and the place of each sample on the path.

    configurations : robot -> (n, dof).   share : (n,) of the length of the path, the largest change of a joint
        counting, 0 … 1.   times : (n,) [s] or ``None``.   waypoint : (n,) the last waypoint passed.   notes : of joint
        values.
    """

    configurations: dict[str, np.ndarray]
    share: np.ndarray
    times: np.ndarray | None
    waypoint: np.ndarray
    notes: list[str] = field(default_factory=list)


def sample(scene, trajectory, resolution: float = RESOLUTION) -> Path:
    """The samples of a trajectory, no joint changing by more than ``resolution`` between neighbours.

    trajectory : with ``waypoints``, ``times`` and ``source`` (`collide.scenes.loaders.trajectories.Trajectory`).

    Raises InvalidArgument for a resolution at or below 0, SceneError for joints of no robot.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise InvalidArgument(f"resolution must be above 0 [rad or m], got {brief(resolution)}")
    corners, notes = _corners(scene, trajectory)
    steps = np.max([np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) for q in corners.values()], axis=0)
    if not steps.sum() / resolution <= MAX_SAMPLES:
        raise InvalidArgument(
            f"resolution: the path is {steps.sum():g} rad or m long, more than {MAX_SAMPLES} samples of "
            f"{resolution:g}: "
            "give a larger one (--resolution)"
        )
    counts = np.maximum(1, np.ceil(steps / resolution)).astype(int)
    # sample k lies ``part`` of the way from waypoint ``first`` to the next
    first = np.append(np.repeat(np.arange(len(counts)), counts), len(counts))
    part = np.append(np.concatenate([np.arange(n) / n for n in counts] or [np.zeros(0)]), 0.0)
    after = np.minimum(first + 1, len(counts))

    def between(values: np.ndarray) -> np.ndarray:
        weight = part.reshape(-1, *[1] * (values.ndim - 1))
        return values[first] + weight * (values[after] - values[first])

    length = np.concatenate([[0.0], np.cumsum(steps)])
    share = between(length) / length[-1] if length[-1] > 0 else np.zeros(len(first))
    times = None if trajectory.times is None else between(np.asarray(trajectory.times, dtype=np.float64))
    return Path({name: between(q) for name, q in corners.items()}, share, times, first, notes)


def _corners(scene, trajectory) -> tuple[dict[str, np.ndarray], list[str]]:
    """robot -> its configurations at the waypoints (n, dof), and what is to be said about them."""
    if not scene.placements:
        raise InvalidArgument(f"scene {scene.name}: it has no robot that a trajectory could move")
    at = {name: placement.q for name, placement in scene.placements.items()}
    rows: dict[str, list[np.ndarray]] = {name: [] for name in at}
    notes: dict[str, None] = {}  # a set that keeps its order
    for k, waypoint in enumerate(trajectory.waypoints):
        try:
            shares = scene.joint_shares(waypoint)
            for name, placement in scene.placements.items():
                at[name], about = placement.robot.configuration(shares[name], start=at[name])
                rows[name].append(at[name])
                notes.update(dict.fromkeys(about))
        except InvalidArgument as error:
            raise SceneError(str(error), path=trajectory.source, element=f"waypoint {k}") from None
    return {name: np.array(values) for name, values in rows.items()}, list(notes)


def at_start(scene, trajectory):
    """The scene at the first waypoint."""
    try:
        return scene.with_state(trajectory.waypoints[0])
    except InvalidArgument as error:
        raise SceneError(str(error), path=trajectory.source, element="waypoint 0") from None


def follow(
    scene, trajectory, *, clearance: float = 0.0, min_depth: float = 0.0, resolution: float = RESOLUTION, progress=None
) -> dict:
    """Collisions and least distances along a trajectory, as the plain data ``trajectory`` of ``schema.json``.

    scene : at a state; joints not named in the trajectory keep its values.
    clearance, min_depth : as in `report.make` [m].   progress : as in `report.make`.
    """
    return watched(
        scene, trajectory, clearance=clearance, min_depth=min_depth, resolution=resolution, progress=progress
    ).to_dict()


def watched(
    scene, trajectory, *, clearance: float = 0.0, min_depth: float = 0.0, resolution: float = RESOLUTION,
    progress=None, keep: bool = False,
) -> Watch:
    """As `follow`, for those who want to look at samples again: what has followed the trajectory to its end.

    keep : samples will be looked at again; rows of the first 20,000 are kept.
    """
    path = sample(scene, trajectory, resolution)
    with (progress or silent)("following the trajectory") as set_label:
        watch = Watch(scene, path, clearance, min_depth, _MAX_KEPT if keep else 0)
        for k, poses in watch.poses():
            watch.see(k, poses)
            if set_label:
                set_label(f"following the trajectory: {path.share[k]:.0%}")
    watch.about = {
        "source": str(trajectory.source), "waypoints": len(trajectory.waypoints), "samples": len(path.share),
        "resolution": resolution, "certified": False, "moving": watch.moving,
        "duration": None if path.times is None else float(path.times[-1] - path.times[0]),
    }
    return watch


class Look(NamedTuple):
    """Near pairs at a sample: rows of `collide.results.PAIR_DTYPE`, and the indices of the rows of each class.

    least : signed distance of the nearest pair [m]; ``None`` without a pair, or where not known.
    """

    rows: np.ndarray
    by_class: dict[str, np.ndarray]
    least: float | None


class Watch:
    """A World that follows a path, and the worst state seen of every pair.

    verdicts : (samples,) row of the worst class in `classes.NAMES` at each sample, the number of classes where all
    classes are empty.
    """

    def __init__(self, scene, path: Path, clearance: float, min_depth: float, max_kept: int = 0):
        self._max_kept, self._searches = max_kept, list[tuple[np.ndarray, float]]()
        self.scene, self.path, self.clearance, self.min_depth = scene, path, clearance, min_depth
        self.moving = self._movers()
        fixed = [replace(body, static=body.name not in self.moving) for body in scene.bodies]
        self.world = replace(scene, bodies=fixed).world()
        self.names = self.world.names
        self.ids = {name: identity for identity, name in self.names.items()}
        self.size = classes.body_sizes(scene.bodies)
        self.reach = self.size - [np.abs(body.X_WB[:3, 3]).max() for body in scene.bodies]
        self.worst: dict[str, dict[tuple[int, int], dict]] = {name: {} for name in classes.NAMES}
        self.first: dict | None = None
        self.least: dict | None = None
        self.unanswered: list[dict] = []
        self.about: dict = {}
        self.verdicts = np.full(len(path.share), len(classes.NAMES), dtype=np.int8)

    def _movers(self) -> list[str]:
        """Names of the bodies that stand elsewhere at some waypoint, in the order of the scene."""
        corners = np.unique(self.path.waypoint, return_index=True)[1]
        moved = {
            name
            for name, X in self._carried(corners)
            if (X != X[0]).any()
        }
        return [body.name for body in self.scene.bodies if body.name in moved]

    def _carried(self, samples: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """(body, its poses (n, 4, 4)) of everything that robots carry, at samples."""
        for robot, placement in self.scene.placements.items():
            X_WLs = placement.robot.link_poses(self.path.configurations[robot][samples], placement.X_WR)
            links = {link: k for k, link in enumerate(placement.robot.links)}
            for name, (link, X_LB) in placement.carried.items():
                yield name, X_WLs[:, links[link]] @ X_LB

    def poses(self) -> Iterator[tuple[int, np.ndarray]]:
        """(sample, poses of the moving bodies (m, 4, 4)), one after the other."""
        count = len(self.path.share)
        for start in range(0, count, _CHUNK):
            samples = np.arange(start, min(start + _CHUNK, count))
            yield from zip(samples.tolist(), self.poses_at(samples))

    def poses_at(self, samples: np.ndarray) -> np.ndarray:
        """(n, m, 4, 4) poses of the moving bodies at samples."""
        carried = dict(self._carried(samples))
        stacked = np.array([carried[name] for name in self.moving]).reshape(len(self.moving), len(samples), 4, 4)
        return stacked.transpose(1, 0, 2, 3)

    def see(self, k: int, poses: np.ndarray) -> None:
        """Ask the World at sample k, and keep what is first, worst or nearest."""
        self._go_to(poses)
        rows, searched = self._near_rows()
        by_class = self._sorted(rows)
        if k == len(self._searches) < self._max_kept:
            self._searches.append((rows, searched))
        for name, indices in by_class.items():
            for row in rows[indices]:
                self._keep(self.worst[name], k, row)
        self.verdicts[k] = next((n for n, name in enumerate(classes.NAMES) if len(by_class[name])), len(classes.NAMES))
        hits = rows[by_class[classes.COLLIDING]]
        if self.first is None and len(hits):
            self.first = self._event(k, hits[np.argmin(hits["distance"])])
        apart = rows[~rows["beyond"]]
        if len(apart):
            nearest = apart[np.argmin(apart["distance"])]
            if self.least is None or nearest["distance"] < self.least["order"]:
                self.least = self._event(k, nearest)

    def look_at(self, k: int, poses: np.ndarray) -> Look:
        """What is near at sample k, whose moving bodies are at these poses (m, 4, 4): kept, or asked once more."""
        self._go_to(poses)
        needed = max(self.clearance, self._largest_rounding())
        rows, searched = self._searches[k] if k < len(self._searches) else (self._rows(needed), needed)
        apart = rows[~rows["beyond"]]
        if not _least(rows) <= searched:  # the nearest pair may be farther than any that was asked for
            try:
                apart = self.world.minimum().rows
            except UnsupportedQuery:  # a pair far away that the path never comes near
                pass
        return Look(rows, self._sorted(rows), _finite(apart["distance"].min()) if len(apart) else None)

    def _go_to(self, poses: np.ndarray) -> None:
        moved = [self.ids[name] for name in self.moving]
        self.world.set_poses(moved, poses)
        self.size[moved] = np.abs(poses[:, :3, 3]).max(axis=1, initial=0.0) + self.reach[moved]

    def _sorted(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        rounding = classes.roundings(self.size[rows["a"]], self.size[rows["b"]])
        return classes.classify(rows, rounding, clearance=self.clearance, min_depth=self.min_depth)

    def _largest_rounding(self) -> float:
        return float(classes.roundings(self.size, 0.0).max(initial=0.0))

    def _near_rows(self) -> tuple[np.ndarray, float]:
        """Pairs as near as any seen so far, or within the clearance or rounding, and how far was searched [m].

        What a search does not name is farther apart than its limit, and a row may be, too: only its lower bound is
        within. So a row whose distance is within the limit is the nearest, or none is known.
        """
        needed = max(self.clearance, self._largest_rounding())
        if self.least is not None:
            limit = max(needed, float(self.least["order"]))
            return self._rows(limit), limit
        limit = max(needed, 0.01 * float(self.size.max(initial=0.0)))
        while not _least(rows := self._rows(limit)) <= limit and math.isfinite(limit):
            limit = limit * 4 if limit < 4 * float(self.size.max(initial=0.0)) else math.inf
        return rows, limit

    def _rows(self, limit: float) -> np.ndarray:
        """The World's rows; pairs without an answer are noted, once, and left out."""
        try:
            return self.world.distances(max_distance=limit).rows
        except UnsupportedQuery:
            refused = self.world.unanswerable(max_distance=limit)
            if not refused:
                raise
        for a, b, why in refused:
            self.world.allow(a, b, reason="cannot be answered")
            self.unanswered.append({"a": self.names[a], "b": self.names[b], "why": why})
        return self._rows(limit)

    def _keep(self, worst: dict, k: int, row) -> None:
        """The deepest or nearest row of a pair, where the pair is first in this class, and how often it is."""
        pair = int(row["a"]), int(row["b"])
        previous = worst.get(pair)
        if previous is None:
            worst[pair] = {"first": k, "samples": 1, "event": self._event(k, row)}
            return
        previous["samples"] += 1
        if row["distance"] < previous["event"]["order"]:
            previous["event"] = self._event(k, row)

    def _event(self, k: int, row) -> dict:
        return {"order": float(row["distance"]), "sample": k, "row": row.copy()}

    # --- plain data -----------------------------------------------------------------------------

    def to_dict(self) -> dict:
        """The path and the worst states seen along the path, as plain data."""
        listed = {name: self._listed(name) for name in classes.NAMES}
        return {
            **self.about, "collides": self.first is not None,
            "first_collision": None if self.first is None else self._entry(self.first),
            "least": None if self.least is None else self._entry(self.least),
            **listed, "unanswered": self.unanswered, "notes": self.path.notes,
        }

    def _listed(self, name: str) -> list[dict]:
        """Pairs that are in this class at worst: collisions in the order they begin, others the nearest first."""
        worse = [self.worst[worse_class] for worse_class in classes.NAMES[: classes.NAMES.index(name)]]
        events = [
            event for pair, event in self.worst[name].items() if not any(pair in worse_class for worse_class in worse)
        ]
        by_start = name in (classes.COLLIDING, classes.SHALLOW)
        ordered = sorted(events, key=lambda event: (event["first"] if by_start else 0.0, event["event"]["order"]))
        return [
            {**self._entry(event["event"]), "from": self._place(event["first"]), "samples": event["samples"]}
            for event in ordered
        ]

    def _entry(self, event: dict) -> dict:
        row, k = event["row"], event["sample"]
        ends = {name: _finite(row[name]) for name in ("distance", "lower", "upper")}
        vectors = {name: [float(v) + 0.0 for v in row[name]] for name in ("normal", "point_a", "point_b")}
        names = {"a": self.names[int(row["a"])], "b": self.names[int(row["b"])]}
        return {**names, **ends, **vectors, "at": self._place(k), "state": self._state(k)}

    def _place(self, k: int) -> dict:
        path = self.path
        return {
            "share": float(path.share[k]), "time": None if path.times is None else float(path.times[k]),
            "sample": k, "waypoint": int(path.waypoint[k]),
        }

    def _state(self, k: int) -> dict[str, float]:
        """Joint values of all robots at sample k."""
        return {
            joint: float(value)
            for robot, placement in self.scene.placements.items()
            for joint, value in zip(placement.robot.joint_names, self.path.configurations[robot][k])
        }


def _least(rows: np.ndarray) -> float:
    """The least distance of rows [m], infinite without rows."""
    return float(rows["distance"][~rows["beyond"]].min(initial=math.inf))


def _finite(value) -> float | None:
    number = float(value) + 0.0
    return number if math.isfinite(number) else None


def verdict(trajectory: dict) -> str:
    """A trajectory in one line."""
    if not trajectory["moving"]:
        return f"the trajectory moves no body: {count(trajectory['samples'], 'sample')} at one place"
    first, least = trajectory["first_collision"], trajectory["least"]
    if first is not None:
        others = len(trajectory["colliding"]) - 1
        more = f"; {count(others, 'more pair collides', 'more pairs collide')} along it" if others else ""
        return f"first collision at {place(first['at'], ' of the path')}: {first['a']} and {first['b']}{more}"
    near = "nothing near" if least is None else (
        f"least clearance {brief_length(max(0.0, least['distance']))} at {place(least['at'], ' of it')}: "
        f"{least['a']} and {least['b']}"
    )
    return f"no collision at {count(trajectory['samples'], 'sample')} of the path; {near}"


def place(at: dict, of: str = "") -> str:
    """The place on the path: its share, and the time of a path with times."""
    time = "" if at["time"] is None else f" ({at['time']:.3g} s)"
    return f"{100 * at['share']:.3g} %{of}{time}"


