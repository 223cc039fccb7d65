"""A scene in viser: `to_viser`."""

from __future__ import annotations

from typing import Any

import numpy as np

from collide.adapters.hosts.fcl_transform import quaternion_of
from collide.adapters.viewers.viewed import LEAST_ARROW, Moment, Viewed, body_paths, viewed
from collide.errors import MissingExtra
from collide.scenes.description import Scene
from collide.worlds.world import World

_ROOT = "/collide"


def to_viser(
    scene: World | Scene, server: Any = None, *, trajectory: Any = None, clearance: float = 0.0, min_depth: float = 0.0,
    progress=None,
) -> Any:
    """Show a World, the report of a scene, or a trajectory in viser: bodies in the colours of their verdicts, near
    pairs as arrows with their brackets; a trajectory under a slider.

    Parameters
    ----------
    scene : World or Scene
        As it stands now. Given again on the same server, it takes the place of what is there.
    server : viser.ViserServer, optional
        One is started without (its address is printed by viser).
    trajectory : str, path, Trajectory or (n, joints) array, optional
        What the robots of a scene do: a file, waypoints, or joint values [rad or m] of the only robot.
    clearance : float
        Pairs at most so far apart are marked [m].
    min_depth : float
        Overlaps proven less deep than this are a class of their own [m].
    progress : callable, optional
        As of `collide.boolean`.

    Returns
    -------
    viser.ViserServer

    Raises
    ------
    MissingExtra
        Without viser: ``pip install 'collide-robotics[viser]'``.
    InvalidArgument, SceneError
        For other arguments, and trajectories of unknown joints.
    """
    try:
        import viser
    except ImportError:
        raise MissingExtra("viser", extra="viser", purpose="show a scene in viser") from None
    view = viewed("to_viser", scene, trajectory, clearance, min_depth, progress)
    server = viser.ViserServer() if server is None else server
    with server.atomic():
        for node in (_ROOT, f"{_ROOT}/pairs"):
            server.scene.remove_by_name(node)
        server.scene.set_up_direction("+z")
        server.scene.add_frame(_ROOT, show_axes=False)
        paths = body_paths(view.looks)
        handles = {name: _body(server, view, name, path) for name, path in paths.items()}
        _show(server, view, handles, view.moments[0])
    if len(view.moments) > 1:
        slider = server.gui.add_slider("sample", 0, len(view.moments) - 1, 1, 0)
        slider.on_update(lambda _: _show(server, view, handles, view.moments[int(slider.value)]))
    return server


def _body(server: Any, view: Viewed, name: str, path: str) -> list[Any]:
    """Handles of a body's triangles and points at the identity."""
    look, place = view.looks[name], f"{_ROOT}/bodies/{path}"
    colour = view.moments[0].colours[name]
    handles = []
    if len(look.faces):
        handles.append(
            server.scene.add_mesh_simple(
                place, look.vertices.astype(np.float32), look.faces.astype(np.uint32), color=colour,
                flat_shading=not look.smooth, side="double" if look.unbounded else "front",
            )
        )
    if look.points is not None:
        handles.append(
            server.scene.add_point_cloud(
                f"{place}/points" if handles else place, look.points.centres.astype(np.float32), colour,
                point_size=2.0 * float(look.points.radii.max()), point_shape="circle", precision="float32",
            )
        )
    return handles


def _show(server: Any, view: Viewed, handles: dict[str, list[Any]], moment: Moment) -> None:
    with server.atomic():
        for name, of_body in handles.items():
            X_WB = moment.poses[name]
            for handle in of_body:
                handle.wxyz, handle.position = quaternion_of(X_WB[:3, :3]), X_WB[:3, 3]
                if hasattr(handle, "color"):
                    handle.color = moment.colours[name]
        place, least = f"{_ROOT}/pairs", LEAST_ARROW * view.size
        server.scene.remove_by_name(place)
        server.scene.add_frame(place, show_axes=False)
        for k, mark in enumerate(moment.marks):
            ends = np.array([[mark.point, mark.point + mark.arrow]], dtype=np.float32)
            server.scene.add_arrows(
                f"{place}/{k}", ends, mark.colour, shaft_radius=0.1 * least, head_radius=0.25 * least,
                head_length=0.4 * least,
            )
            if mark.text:
                server.scene.add_label(f"{place}/{k}/label", mark.text, position=tuple(ends[0, 1]))
