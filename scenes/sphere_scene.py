"""A robot beside spheres or other convex pieces as a scene to look at: links, pieces, and what lies outside; no pair is
tested.
"""

from __future__ import annotations

import numpy as np

from collide.reports.sphere_report import audited_kind, link_words
from collide.robots.robot import Robot
from collide.scenes.description import Scene, SceneBody
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape


def sphere_scene(robot: Robot, bodies: dict, published: dict, links: list) -> tuple[Scene, dict]:
    """(the scene at the default configuration; link → the look of what is outside its pieces).

    bodies, published : link → its shape, and its pieces, in the frame of the link.   links : `AuditedLink`s.
    """
    X_WLs = robot.link_poses(robot.default_configuration(), np.eye(4))[0]
    at = {link: X_WLs[k] for k, link in enumerate(robot.links)}
    kind = audited_kind(links)
    scene, looks = Scene(f"{robot.name} and {kind}", sources=list(robot.sources)), {}
    for audited in links:
        link = audited.link
        shapes: list[tuple[str, Shape, str | None]] = [(link, bodies[link], link_words(audited))]
        if audited.audit is not None:
            shapes.append((pieces_of(link, kind), published[link], None))
            if len(audited.audit.patches):
                looks[link] = [(_patch(audited.audit.patches), np.eye(4))]
        for name, shape, note in shapes:  # a mask of 0 tests no pair
            scene.bodies.append(SceneBody(name, shape, at[link], mask=0, approximation=note, owner=robot.name))
    return scene, looks


def pieces_of(link: str, kind: str) -> str:
    """What the pieces of a link are called in the scene.   kind : "spheres" or "pieces"."""
    return f"{link}: {kind}"


def _patch(pieces: np.ndarray) -> Mesh:
    vertices, faces = np.unique(pieces.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices, faces.reshape(-1, 3), solid=False)
