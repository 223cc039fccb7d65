"""Bodies of pybullet clients for the tests of the mirror; imported once pybullet was seen to be there."""

from __future__ import annotations

import numpy as np
import pybullet as p
import pybullet_data

DATA = pybullet_data.getDataPath()
CORNERS = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
FACETS = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]


def body(
    client: int, mass: float = 1.0, position=(0, 0, 0), turned=(0, 0, 0, 1), *, frame=None, inertial=None, **shape
):
    """A body of one shape.   frame, inertial : position and quaternion of its shape and of its centre of mass."""
    if frame:
        shape |= {"collisionFramePosition": list(frame[0]), "collisionFrameOrientation": list(frame[1])}
    number = p.createCollisionShape(physicsClientId=client, **shape)
    more = {}
    if inertial:
        more = {"baseInertialFramePosition": list(inertial[0]), "baseInertialFrameOrientation": list(inertial[1])}
    return p.createMultiBody(
        mass, number, basePosition=list(position), baseOrientation=list(turned), physicsClientId=client, **more
    )


def quaternion(random: np.random.Generator) -> list[float]:
    q = random.normal(size=4)
    return (q / np.linalg.norm(q)).tolist()


def rotation(q) -> np.ndarray:
    return np.array(p.getMatrixFromQuaternion(q)).reshape(3, 3)


def sphere_of(client: int, radius: float, position) -> int:
    return body(client, position=position, shapeType=p.GEOM_SPHERE, radius=radius)


def pairs_of(rows) -> set:
    return {frozenset([(row[1], row[3]), (row[2], row[4])]) for row in rows}
