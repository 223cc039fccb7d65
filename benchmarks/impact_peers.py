"""Other engines' continuous collision, asked about motions: each in a process of its own, for some abort.

A motion is two pairs of ends; `ask` returns times of contact, −1 where an engine says that a motion is free, and the
seconds of the processor for the questions alone: shapes, transforms and requests are made beforehand.

fcl : python-fcl, continuousCollide by conservative advancement, motions linear with constant angular velocity, as ours;
    tolerance 1e-4, its own default. In about half of all processes it says 0 to every motion of this kind; such a
    process is started again, and counted.
bullet : Bullet 2's convex cast (btContinuousConvexCollision) through panda3d's `sweep_test_closest`, in single
    precision as panda3d is built; B rests, since a cast moves one body. pybullet gives the cast no function.
coal has none any more (coal#421), MuJoCo none.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

import collide


class Question(NamedTuple):
    """n motions: poses (n, 4, 4) of A and B at both ends."""

    A: collide.Shape
    B: collide.Shape
    poses: tuple[np.ndarray, ...]


def _triangles(shape: collide.Shape) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(shape, collide.Mesh):
        return np.asarray(shape.vertices), np.asarray(shape.faces)
    vertices, faces = collide.tessellate(shape, tolerance=1.0)
    return vertices, faces


class Fcl:
    """python-fcl."""

    def __init__(self, question: Question):
        import fcl

        self.fcl = fcl
        # a mesh beside a primitive ends in a segmentation fault
        as_mesh = isinstance(question.A, collide.Mesh) or isinstance(question.B, collide.Mesh)
        A, B = (self._geometry(shape, as_mesh) for shape in (question.A, question.B))
        ends = [[fcl.Transform(X[:3, :3], X[:3, 3]) for X in poses] for poses in question.poses]
        self.motions = [
            (fcl.CollisionObject(A, a0), a1, fcl.CollisionObject(B, b0), b1) for a0, a1, b0, b1 in zip(*ends)
        ]
        self.request = fcl.ContinuousCollisionRequest(
            ccd_motion_type=fcl.CCDMotionType.CCDM_LINEAR,
            ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
        )

    def _geometry(self, shape: collide.Shape, as_mesh: bool) -> Any:
        fcl = self.fcl
        if isinstance(shape, collide.Box) and not as_mesh:
            return fcl.Box(*shape.size.tolist())
        vertices, faces = _triangles(shape)
        if as_mesh:
            model = fcl.BVHModel()
            model.beginModel(len(vertices), len(faces))
            model.addSubModel(vertices, faces)
            model.endModel()
            return model
        padded = np.concatenate([[3, *face] for face in faces.tolist()])
        return fcl.Convex(vertices, len(faces), padded)

    def ask(self) -> tuple[np.ndarray, float]:
        times = np.full(len(self.motions), -1.0)
        begin = time.process_time()
        for k, (a0, a1, b0, b1) in enumerate(self.motions):
            result = self.fcl.ContinuousCollisionResult()
            self.fcl.continuousCollide(a0, a1, b0, b1, self.request, result)
            if result.is_collide:
                times[k] = result.time_of_contact
        return times, time.process_time() - begin


class Bullet:
    """Bullet through panda3d: A moves, B rests at the origin of its own frame."""

    def __init__(self, question: Question):
        from panda3d import bullet, core
        from scipy.spatial.transform import Rotation

        self.bullet, self.core = bullet, core
        X_WA0, X_WA1, X_WB0, X_WB1 = question.poses
        assert np.array_equal(X_WB0, X_WB1), "a cast moves one body"
        self.shape = self._geometry(question.A)
        node = bullet.BulletRigidBodyNode("B")
        node.add_shape(self._geometry(question.B))
        self.world = bullet.BulletWorld()
        self.world.attach(node)
        self.mask = core.BitMask32.all_on()
        ends, unscaled = [], core.LVecBase3f(1.0, 1.0, 1.0)
        for X in (X_WA0, X_WA1):
            X_BA = np.linalg.inv(X_WB0) @ X
            turns = Rotation.from_matrix(X_BA[:, :3, :3]).as_quat()
            ends.append([
                core.TransformState.make_pos_quat_scale(core.LPoint3f(*p), core.LQuaternionf(w, x, y, z), unscaled)
                for p, (x, y, z, w) in zip(X_BA[:, :3, 3].tolist(), turns.tolist())
            ])
        self.motions = list(zip(*ends))

    def _geometry(self, shape: collide.Shape) -> Any:
        if isinstance(shape, collide.Box):
            box = self.bullet.BulletBoxShape(self.core.LVector3f(*(0.5 * shape.size).tolist()))
            box.set_margin(min(0.04, 0.05 * float(min(shape.size))))
            return box
        vertices, faces = _triangles(shape)
        corners = [self.core.LPoint3f(*p) for p in vertices.tolist()]
        if isinstance(shape, collide.Mesh):
            mesh = self.bullet.BulletTriangleMesh()
            for i, j, k in faces.tolist():
                mesh.add_triangle(corners[i], corners[j], corners[k])
            surface = self.bullet.BulletTriangleMeshShape(mesh, dynamic=False)
            surface.set_margin(0.0)
            return surface
        hull = self.bullet.BulletConvexHullShape()
        for corner in corners:
            hull.add_point(corner)
        hull.set_margin(0.0)
        return hull

    def ask(self) -> tuple[np.ndarray, float]:
        times = np.full(len(self.motions), -1.0)
        begin = time.process_time()
        for k, (start, end) in enumerate(self.motions):
            result = self.world.sweep_test_closest(self.shape, start, end, self.mask, 0.0)
            if result.has_hit():
                times[k] = result.hit_fraction
        return times, time.process_time() - begin


PEERS = {"fcl": Fcl, "bullet": Bullet}
