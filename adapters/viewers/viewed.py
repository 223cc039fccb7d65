"""What viewers are shown: bodies as triangles and balls, and at each moment their poses, verdicts and near pairs."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.live.scene_of_world import scene_of_world
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.pages import drawn_states
from collide.pages.body_verdicts import body_verdicts
from collide.pages.drawn_shapes import Drawn, drawn
from collide.pages.scene_glb import COLOURS
from collide.reports import classes
from collide.reports import report as reports
from collide.reports.classes import body_sizes
from collide.reports.number_format import parted, widths
from collide.reports.state_reports import Stated
from collide.reports.trajectory_report import at_start, watched
from collide.scenes.description import Scene
from collide.scenes.loaders.trajectories import Trajectory, read_trajectory
from collide.shapes.shape import Shape
from collide.worlds.world import World

#: Pairs of a class that are drawn at a moment: the deepest or nearest.
MAX_PAIRS = 200
#: Arrows are at least this long and labels stand this high, as a part of the scene's size.
LEAST_ARROW = 1.0 / 50.0
#: Balls of clouds are drawn with at least this radius, as a part of the scene's size.
_LEAST_RADIUS = 1e-3
_ENDS = ("distance", "lower", "upper")


class Mark(NamedTuple):
    """A near pair at a moment: an arrow from A's point along the normal, as long as the gap or depth or longer.

    point, arrow : (3,) in W [m].   colour : red, green, blue of 255.
    text : bodies, class, distance and bracket; empty of what touches.
    """

    point: np.ndarray
    arrow: np.ndarray
    colour: tuple[int, int, int]
    text: str


class Moment(NamedTuple):
    """The scene at one time.

    poses : body → X_WB (4, 4).   colours : body → red, green, blue of 255, by its verdict.   marks : near pairs.
    time : [s]; ``None`` of what has no times.   label : the verdict, or the place on a trajectory.
    """

    poses: dict[str, np.ndarray]
    colours: dict[str, tuple[int, int, int]]
    marks: list[Mark]
    time: float | None
    label: str


class Viewed(NamedTuple):
    """What is shown: looks of bodies by name, in their frames, the scene's size [m], and its moments in order."""

    looks: dict[str, Drawn]
    size: float
    moments: list[Moment]


def viewed(
    caller: str, scene: World | Scene, trajectory: Any, clearance: float, min_depth: float, progress=None
) -> Viewed:
    """What a viewer is shown; parameters as of `to_viser`."""
    if not isinstance(scene, (World, Scene)):
        raise InvalidArgument(f"{caller}: give a collide.World or a scene of collide.scenes.load, got {brief(scene)}")
    clearance = checks.length(f"{caller}: clearance", clearance)
    min_depth = checks.length(f"{caller}: min_depth", min_depth)
    if isinstance(scene, World):
        if trajectory is not None:
            raise InvalidArgument(f"{caller}: a trajectory moves the robots of a scene; a World has no robots")
        scene = scene_of_world(scene, "World")
    path = None if trajectory is None else _waypoints(caller, scene, trajectory)
    scene = scene if path is None else at_start(scene, path)
    stated = Stated("", scene, reports.make(scene, clearance, min_depth, progress))
    size = float(body_sizes(scene.bodies).max(initial=0.0)) or 1.0
    shapes = {id(body.shape): body.shape for body in scene.bodies}
    by_shape = {key: _look(shape, size) for key, shape in shapes.items()}
    looks = {body.name: by_shape[id(body.shape)] for body in scene.bodies}
    if path is None:
        return Viewed(looks, size, [_moment_of_report(stated, size)])
    watch = watched(scene, path, clearance=clearance, min_depth=min_depth, progress=progress, keep=True)
    stated = stated._replace(watch=watch)
    return Viewed(looks, size, list(_moments_of_trajectory(stated, size)))


def _look(shape: Shape, size: float) -> Drawn:
    """A shape in its frame, balls of clouds large enough to be seen.   size : of the scene [m]."""
    look = drawn([(shape, np.eye(4))], 2.0 * size)
    if look.points is None:
        return look
    return look._replace(points=look.points._replace(radii=np.maximum(look.points.radii, _LEAST_RADIUS * size)))


def _waypoints(caller: str, scene: Scene, trajectory: Any) -> Trajectory:
    """A trajectory as such, from a file, or from configurations (n, joints) of the scene's only robot."""
    if isinstance(trajectory, Trajectory):
        return trajectory
    if isinstance(trajectory, (str, os.PathLike)):
        return read_trajectory(trajectory)
    if len(scene.placements) != 1:
        raise InvalidArgument(
            f"{caller}: an array of configurations is for a scene with one robot, this scene has "
            f"{len(scene.placements)}: give a Trajectory, or a file"
        )
    ((name, placement),) = scene.placements.items()
    joints = placement.robot.joint_names
    q = checks.array(f"{caller}: trajectory", trajectory, f"(n, {len(joints)})", InvalidArgument)
    if q.ndim != 2 or q.shape[1] != len(joints) or not len(q):
        raise InvalidArgument(
            f"{caller}: trajectory has shape {q.shape}, must be (n, {len(joints)}) for {name}: {', '.join(joints)}"
        )
    return Trajectory(caller, [dict(zip(joints, row)) for row in q.tolist()])


def _moment_of_report(stated: Stated, size: float) -> Moment:
    scene, report = stated.scene, stated.report
    marks = _marks_of_report(report, set(), size)
    poses = {body.name: np.asarray(body.X_WB) for body in scene.bodies}
    return Moment(poses, _colours(body_verdicts(scene, report)), marks, None, report.verdict())


def _moments_of_trajectory(stated: Stated, size: float) -> Iterator[Moment]:
    """At the samples that a page would show: changes of verdict, the nearest approach, and others between."""
    watch = stated.watch
    samples, _ = drawn_states.samples_of_page(watch)
    first = _moment_of_report(stated, size)
    standing = _marks_of_report(stated.report, set(watch.moving), size)
    free = dict.fromkeys(watch.moving, COLOURS["free"])
    for k, moment in zip(samples.tolist(), drawn_states.moments(stated, samples)):
        marks = [
            _mark(name, watch.names[int(row["a"])], watch.names[int(row["b"])], row, size)
            for name, indices in moment.look.by_class.items() for row in moment.look.rows[indices[:MAX_PAIRS]]
        ]
        poses = {**first.poses, **dict(zip(watch.moving, moment.poses))}
        colours = {**first.colours, **free, **_colours(moment.verdicts)}
        time = None if watch.path.times is None else float(watch.path.times[k])
        yield Moment(poses, colours, standing + marks, time, f"{100 * watch.path.share[k]:.3g} %")


def _marks_of_report(report: reports.Report, without: set[str], size: float) -> list[Mark]:
    """Marks of the pairs of a report without some bodies."""
    return [
        _mark(name, pair.a, pair.b, vars(pair), size)
        for name in classes.NAMES
        for pair in getattr(report, name)[:MAX_PAIRS]
        if not without & {pair.a, pair.b}
    ]


def _colours(verdicts: Mapping[str, str]) -> dict[str, tuple[int, int, int]]:
    return {name: COLOURS[verdict] for name, verdict in verdicts.items()}


def _mark(verdict: str, a: str, b: str, row: Any, size: float) -> Mark:
    """The mark of a row of results, or of a `Pair` as a mapping."""
    distance, lower, upper = (math.inf if row[end] is None else float(row[end]) for end in _ENDS)
    width = widths([upper - lower if math.isfinite(lower) else math.inf])[0]
    is_known = math.isfinite(distance)
    distance_text = parted(distance) if is_known else "of unbounded depth"
    # What stands on a table touches it a dozen times: labels there would hide what matters.
    text = "" if verdict == classes.TOUCHING else f"{a}, {b}: {verdict}, {distance_text}, bracket {width}"
    length = max(abs(distance) if is_known else 0.0, LEAST_ARROW * size)
    arrow = length * np.asarray(row["normal"], dtype=np.float64)
    return Mark(np.asarray(row["point_a"], dtype=np.float64), arrow, COLOURS[verdict], text)


def body_paths(names) -> dict[str, str]:
    """Body → a name without slashes, which viewers read as folders; names stay apart."""
    taken: dict[str, str] = {}
    for name in names:
        path = name.replace("/", "|")
        while path in taken.values():
            path += "'"
        taken[name] = path
    return taken
