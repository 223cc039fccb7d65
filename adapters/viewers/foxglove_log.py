"""A scene in Foxglove: `to_foxglove`."""

from __future__ import annotations

from time import time as clock
from typing import Any

import numpy as np

from collide.adapters.hosts.fcl_transform import quaternion_of
from collide.adapters.viewers.viewed import LEAST_ARROW, Mark, Viewed, body_paths, viewed
from collide.errors import MissingExtra
from collide.numerics.frames import frame_along
from collide.scenes.description import Scene
from collide.worlds.world import World

#: Topics, and the frame of the world.
SCENE_TOPIC, FRAMES_TOPIC, WORLD_FRAME = "/collide/scene", "/collide/tf", "world"


def to_foxglove(
    scene: World | Scene, context: Any = None, *, trajectory: Any = None, clearance: float = 0.0,
    min_depth: float = 0.0, time: float | None = None, progress=None,
) -> None:
    """Send a World, the report of a scene, or a trajectory to Foxglove: to the sinks of its SDK that are open, a file
    ("with foxglove.open_mcap(path):") or programs that listen ("foxglove.start_server").

    A frame a body, under ``world``, on the topic ``/collide/tf``; triangles in the colours of the verdicts, arrows and
    labels of near pairs on ``/collide/scene``.

    Parameters
    ----------
    scene, trajectory, clearance, min_depth, progress
        As of `to_viser`.
    context : foxglove.Context, optional
        Of the sinks; the SDK's own without.
    time : float, optional
        When this is [s since 1970, or of a simulation]; now without. A trajectory begins there, and takes its own times
        from there on, or a thirtieth of a second a sample.

    Raises
    ------
    MissingExtra
        Without foxglove: ``pip install 'collide-robotics[foxglove]'``.
    InvalidArgument, SceneError
        As of `to_viser`.
    """
    try:
        from foxglove import channels, messages
    except ImportError:
        raise MissingExtra("foxglove-sdk", extra="foxglove", purpose="send a scene to Foxglove") from None
    view = viewed("to_foxglove", scene, trajectory, clearance, min_depth, progress)
    start = clock() if time is None else float(time)
    scene_channel = channels.SceneUpdateChannel(SCENE_TOPIC, context=context)
    frames_channel = channels.FrameTransformsChannel(FRAMES_TOPIC, context=context)
    frames = body_paths(view.looks)
    drawn: dict[str, tuple] = {}
    began = view.moments[0].time or 0.0
    for k, moment in enumerate(view.moments):
        seconds = start + (k / 30.0 if moment.time is None else moment.time - began)
        nanoseconds = round(seconds * 1e9)
        stamp = messages.Timestamp(sec=nanoseconds // 10**9, nsec=nanoseconds % 10**9)
        frames_channel.log(
            messages.FrameTransforms(transforms=[
                _transform(messages, stamp, frames[name], X_WB) for name, X_WB in moment.poses.items()
            ]), log_time=nanoseconds,
        )
        changed = [name for name in frames if drawn.get(name) != moment.colours[name]]
        drawn.update((name, moment.colours[name]) for name in changed)
        entities = [_body(messages, stamp, view, name, frames[name], drawn[name]) for name in changed]
        entities.append(_pairs(messages, stamp, view, moment.marks))
        scene_channel.log(messages.SceneUpdate(entities=entities), log_time=nanoseconds)


def _transform(messages: Any, stamp: Any, frame: str, X_WB: np.ndarray) -> Any:
    return messages.FrameTransform(
        timestamp=stamp, parent_frame_id=WORLD_FRAME, child_frame_id=frame,
        translation=_vector(messages, X_WB[:3, 3]), rotation=_quaternion(messages, X_WB[:3, :3]),
    )


def _pose(messages: Any, p, R: np.ndarray) -> Any:
    return messages.Pose(position=_vector(messages, p), orientation=_quaternion(messages, R))


def _vector(messages: Any, v) -> Any:
    return messages.Vector3(**dict(zip("xyz", map(float, v))))


def _quaternion(messages: Any, R: np.ndarray) -> Any:
    return messages.Quaternion(**dict(zip("wxyz", quaternion_of(R).tolist())))


def _colour(messages: Any, colour, alpha: float = 1.0) -> Any:
    r, g, b = (channel / 255.0 for channel in colour)
    return messages.Color(r=r, g=g, b=b, a=alpha)


def _body(messages: Any, stamp: Any, view: Viewed, name: str, frame: str, colour) -> Any:
    look, paint = view.looks[name], _colour(messages, colour)
    triangles, spheres = [], []
    if len(look.faces):
        points = [messages.Point3(x=x, y=y, z=z) for x, y, z in look.vertices.tolist()]
        triangles = [
            messages.TriangleListPrimitive(
                pose=_pose(messages, np.zeros(3), np.eye(3)), points=points, color=paint,
                indices=look.faces.ravel().tolist(),
            )
        ]
    if look.points is not None:
        for centre, radius in zip(look.points.centres, look.points.radii.tolist()):
            size = messages.Vector3(x=2.0 * radius, y=2.0 * radius, z=2.0 * radius)
            spheres.append(
                messages.SpherePrimitive(pose=_pose(messages, centre, np.eye(3)), size=size, color=paint)
            )
    return messages.SceneEntity(
        timestamp=stamp, frame_id=frame, id=name, frame_locked=True, triangles=triangles, spheres=spheres
    )


def _pairs(messages: Any, stamp: Any, view: Viewed, marks: list[Mark]) -> Any:
    least = LEAST_ARROW * view.size
    arrows, texts = [], []
    for mark in marks:
        length = float(np.linalg.norm(mark.arrow))
        if not length > 0.0:
            continue
        paint, head = _colour(messages, mark.colour), min(0.3 * least, length)
        arrows.append(
            messages.ArrowPrimitive(
                pose=_pose(messages, mark.point, frame_along(mark.arrow / length).T), shaft_length=length - head,
                shaft_diameter=0.2 * least, head_length=head, head_diameter=0.5 * least, color=paint,
            )
        )
        if mark.text:
            texts.append(
                messages.TextPrimitive(
                    pose=_pose(messages, mark.point + mark.arrow, np.eye(3)), billboard=True, font_size=12.0,
                    scale_invariant=True, color=paint, text=mark.text,
                )
            )
    return messages.SceneEntity(
        timestamp=stamp, frame_id=WORLD_FRAME, id="pairs", frame_locked=True, arrows=arrows, texts=texts
    )
