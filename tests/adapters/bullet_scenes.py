"""Bodies of pybullet clients for the tests of the mirror; imported once pybullet was seen to be there."""

from __future__ import annotations

import numpy as np
import pybullet as p
import pybullet_data
import unit_cube
from naive import unit

DATA = pybullet_data.getDataPath()
CORNERS, FACETS = unit_cube.CORNERS.tolist(), unit_cube.FACETS.ravel().tolist()


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
    return unit(random.normal(size=4)).tolist()


def rotation(q) -> np.ndarray:
    return np.array(p.getMatrixFromQuaternion(q)).reshape(3, 3)


def sphere_of(client: int, radius: float, position) -> int:
    return body(client, position=position, shapeType=p.GEOM_SPHERE, radius=radius)


def pairs_of(rows) -> set:
    return {frozenset([(row[1], row[3]), (row[2], row[4])]) for row in rows}
