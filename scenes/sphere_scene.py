"""A robot beside its spheres as a scene to look at: links, their spheres, and what lies outside; no pair is tested."""

from __future__ import annotations

import numpy as np

from collide.reports.sphere_report import link_words
from collide.robots.robot import Robot
from collide.scenes.description import Scene, SceneBody
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Sphere
from collide.shapes.shape import Shape


def sphere_scene(robot: Robot, bodies: dict, published: dict, links: list) -> tuple[Scene, dict]:
    """(the scene at the default configuration; link → the look of what is outside its spheres).

    bodies : link → its shape in the frame of the link.   published : link → (centres, radii).   links : `AuditedLink`s.
    """
    X_WLs = robot.link_poses(robot.default_configuration(), np.eye(4))[0]
    at = {link: X_WLs[k] for k, link in enumerate(robot.links)}
    scene, looks = Scene(f"{robot.name} and spheres", sources=list(robot.sources)), {}
    for audited in links:
        link = audited.link
        shapes: list[tuple[str, Shape, str | None]] = [(link, bodies[link], link_words(audited))]
        if audited.audit is not None:
            shapes.append((spheres_of(link), _union(*published[link]), None))
            if len(audited.audit.pieces):
                looks[link] = [(_patch(audited.audit.pieces), np.eye(4))]
        for name, shape, note in shapes:  # a mask of 0 tests no pair
            scene.bodies.append(SceneBody(name, shape, at[link], mask=0, approximation=note, owner=robot.name))
    return scene, looks


def spheres_of(link: str) -> str:
    """What the spheres of a link are called in the scene."""
    return f"{link}: spheres"


def _union(centers: np.ndarray, radii: np.ndarray) -> Compound:
    poses = np.tile(np.eye(4), (len(radii), 1, 1))
    poses[:, :3, 3] = centers
    return Compound([(Sphere(radius), X) for radius, X in zip(radii.tolist(), poses)])


def _patch(pieces: np.ndarray) -> Mesh:
    vertices, faces = np.unique(pieces.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices, faces.reshape(-1, 3), solid=False)
