"""A scene in rerun: `to_rerun`."""

from __future__ import annotations

from typing import Any

import numpy as np

from collide.adapters.viewers.viewed import LEAST_ARROW, Moment, Viewed, body_paths, viewed
from collide.errors import InvalidArgument, MissingExtra
from collide.pages.drawn_shapes import Drawn
from collide.scenes.description import Scene
from collide.worlds.world import World

_ROOT = "collide"


def to_rerun(
    scene: World | Scene, recording: Any = None, *, trajectory: Any = None, clearance: float = 0.0,
    min_depth: float = 0.0, progress=None,
) -> Any:
    """Log a World, the report of a scene, or a trajectory to rerun: bodies in the colours of their verdicts, near
    pairs as arrows with their brackets, the report's line as text.

    Parameters
    ----------
    scene, trajectory, clearance, min_depth, progress
        As of `to_viser`.
    recording : rerun.RecordingStream, optional
        The process's own without, as made by ``rerun.init(…, spawn=True)``. For a World that moves set its time first:
        ``recording.set_time("step", sequence=k)``. Samples of a trajectory are logged on the timelines ``sample`` and,
        where they have times, ``time``.

    Returns
    -------
    rerun.RecordingStream

    Raises
    ------
    MissingExtra
        Without rerun: ``pip install 'collide-robotics[rerun]'``.
    InvalidArgument, SceneError
        As of `to_viser`; where no recording is to be had.
    """
    try:
        import rerun
    except ImportError:
        raise MissingExtra("rerun-sdk", extra="rerun", purpose="log a scene to rerun") from None
    view = viewed("to_rerun", scene, trajectory, clearance, min_depth, progress)
    recording = rerun.get_data_recording() if recording is None else recording
    if recording is None:
        raise InvalidArgument("to_rerun: there is no recording: call rerun.init(\"name\", spawn=True), or hand one in")
    recording.log(_ROOT, rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    places = {name: [_ROOT, "bodies", path] for name, path in body_paths(view.looks).items()}
    before: Moment | None = None
    for k, moment in enumerate(view.moments):
        if len(view.moments) > 1:
            recording.set_time("sample", sequence=k)
            if moment.time is not None:
                recording.set_time("time", duration=moment.time)
        for name, place in places.items():
            if before is None or moment.colours[name] != before.colours[name]:
                _log_look(rerun, recording, place, view.looks[name], moment.colours[name])
            X_WB = moment.poses[name]
            if before is None or (X_WB != before.poses[name]).any():
                recording.log(place, rerun.Transform3D(translation=X_WB[:3, 3], mat3x3=X_WB[:3, :3]))
        _log_marks(rerun, recording, view, moment)
        before = moment
    return recording


def _log_look(rerun: Any, recording: Any, place: list, look: Drawn, colour) -> None:
    if len(look.faces):
        mesh = rerun.Mesh3D(
            vertex_positions=look.vertices.astype(np.float32), triangle_indices=look.faces.astype(np.uint32),
            albedo_factor=[*colour, 255],
        )
        recording.log(place, mesh)
    if look.points is not None:
        points = rerun.Points3D(look.points.centres, radii=look.points.radii, colors=[*colour, 255])
        recording.log(place, points)


def _log_marks(rerun: Any, recording: Any, view: Viewed, moment: Moment) -> None:
    arrows = rerun.Arrows3D(
        origins=np.array([mark.point for mark in moment.marks]).reshape(-1, 3),
        vectors=np.array([mark.arrow for mark in moment.marks]).reshape(-1, 3),
        radii=0.1 * LEAST_ARROW * view.size, colors=[[*mark.colour, 255] for mark in moment.marks],
        labels=[mark.text for mark in moment.marks],
    )
    recording.log(f"{_ROOT}/pairs", arrows)
    recording.log(f"{_ROOT}/verdict", rerun.TextLog(moment.label))
