"""A robot among obstacles, and MuJoCo and Pinocchio asked whether its configurations collide, from the same shapes."""

from __future__ import annotations

import numpy as np

import collide
from collide.errors import CollideError
from collide.scenes.loaders.resources import installed_folders

PANDA = "example-robot-data/robots/panda_description/urdf/panda.urdf"


def panda() -> tuple[collide.Robot, str]:
    folder = next((f for f in installed_folders() if (f / "example-robot-data").is_dir()), None)
    if folder is None:
        raise CollideError("this needs robots of example-robot-data: pip install example-robot-data")
    path = folder / PANDA
    srdf = path.parents[1] / "srdf" / "panda.srdf"
    return collide.Robot.load(path, srdf=srdf, meshes="hull", package_path=[folder]), str(path)


def clutter(n: int, seed: int = 0) -> collide.World:
    """A table and n boxes and hulls around a robot, none within 0.25 m of its axis."""
    rng = np.random.default_rng([seed, n])
    world = collide.World()
    world.add(collide.Box((2.0, 2.0, 0.04)), collide.pose((0, 0, -0.05)), name="table", static=True)
    k = 0
    while k < n:
        p = rng.uniform((-0.9, -0.9, 0.0), (0.9, 0.9, 1.1))
        if np.hypot(p[0], p[1]) < 0.25:
            continue
        size = rng.uniform(0.02, 0.07)
        points = rng.normal(size=(32, 3))
        points *= size / np.linalg.norm(points, axis=1)[:, None]
        shape = collide.Box(2 * size * rng.uniform(0.5, 1.0, 3)) if k % 2 else collide.ConvexHull(points)
        X = collide.pose(p, rpy=rng.uniform(-3.1, 3.1, 3))
        world.add(shape, X, name=f"obstacle{k}", static=True)
        k += 1
    return world


def at_random(robot: collide.Robot, n: int, seed: int = 5) -> np.ndarray:
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (n, robot.dof))


def rotation_quaternion(R: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of a rotation matrix."""
    import mujoco

    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
    return quaternion


class MujocoRobot:
    """A model built from a `collide.Robot` and the bodies of a World: all contacts are made, as MuJoCo does."""

    def __init__(self, robot: collide.Robot, world: collide.World):
        import mujoco

        self._mujoco, self._robot = mujoco, robot
        spec = mujoco.MjSpec()
        self._meshes = 0
        bodies = {robot.root: spec.worldbody.add_body(name=robot.root)}
        for joint in robot.sorted_joints:
            X = joint.X_PJ
            body = bodies[joint.parent].add_body(name=joint.child, pos=X[:3, 3], quat=rotation_quaternion(X[:3, :3]))
            bodies[joint.child] = body
            if joint.type in ("revolute", "continuous"):
                body.add_joint(name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis)
            elif joint.type == "prismatic":
                body.add_joint(name=joint.name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=joint.axis)
        for link, elements in robot.geometry.items():
            for element in elements:
                self._add(spec, bodies[link], element.shape, element.X_LG)
        for identity in world.ids:
            body = world.body(identity)
            self._add(spec, spec.worldbody, body.shape, body.X_WB)
        for a, b, _ in robot.disabled_pairs:
            spec.add_exclude(bodyname1=a, bodyname2=b)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._joints = [
            (self.model.joint(joint.name).qposadr[0], joint.name)
            for joint in robot.joints if joint.type in ("revolute", "continuous", "prismatic")
        ]

    def _add(self, spec, body, shape, X: np.ndarray) -> None:
        mujoco = self._mujoco
        place = {"pos": X[:3, 3], "quat": rotation_quaternion(X[:3, :3]), "mass": 1.0}
        if isinstance(shape, collide.Box):
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * shape.size, **place)
            return
        self._meshes += 1
        name = f"mesh{self._meshes}"
        # MuJoCo moves a mesh into axes of its own and says where; the geom is moved back by its compiler.
        spec.add_mesh(name=name, uservert=shape.points.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **place)

    def configurations(self, Q: np.ndarray) -> np.ndarray:
        """(N, nq) of MuJoCo's own columns, mimicking joints included."""
        out = np.empty((len(Q), self.model.nq))
        for row, q in enumerate(Q):
            for address, name in self._joints:
                out[row, address] = self._robot.joint_value(name, q)
        return out

    def collides(self, qpos: np.ndarray) -> np.ndarray:
        mujoco, model, data = self._mujoco, self.model, self.data
        out = np.empty(len(qpos), dtype=bool)
        for row, q in enumerate(qpos):
            data.qpos[:] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_collision(model, data)
            out[row] = data.ncon > 0
        return out


class PinocchioRobot:
    """A geometry model of the same shapes; pairs one by one, or its broadphase manager, both up to the first hit."""

    def __init__(self, robot: collide.Robot, world: collide.World, urdf: str):
        import coal
        import pinocchio as pin

        self._pin, self.model = pin, pin.buildModelFromUrdf(urdf)
        self.data = self.model.createData()
        self.geometry = pin.GeometryModel()
        links: dict[str, list[int]] = {}
        for link, elements in robot.geometry.items():
            frame = self.model.frames[self.model.getFrameId(link)]
            for element in elements:
                place = frame.placement * pin.SE3(element.X_LG)
                of_link = links.setdefault(link, [])
                name = f"{link}_{len(of_link)}"
                of_link.append(self._add(coal, name, frame.parentJoint, element.shape, place))
        around = []
        for identity in world.ids:
            body = world.body(identity)
            around.append(self._add(coal, body.name, 0, body.shape, pin.SE3(body.X_WB)))
        disabled = {frozenset(pair[:2]) for pair in robot.disabled_pairs}
        names = list(links)
        for i, a in enumerate(names):
            partners = [k for b in names[i + 1 :] if frozenset((a, b)) not in disabled for k in links[b]]
            if a not in robot.base_links:
                partners = around + partners
            for g in links[a]:
                for h in partners:
                    self.geometry.addCollisionPair(pin.CollisionPair(g, h))
        self.geometry_data = pin.GeometryData(self.geometry)
        make_manager = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager
        self.manager = make_manager(self.model, self.geometry, self.geometry_data)
        self._order = [(self.model.joints[self.model.getJointId(j.name)].idx_q, j.name) for j in robot.joints
                       if j.type in ("revolute", "continuous", "prismatic")]
        self._robot = robot

    def _add(self, coal, name: str, joint: int, shape, place) -> int:
        if isinstance(shape, collide.Box):
            geometry = coal.Box(*shape.size.tolist())
        else:
            points = coal.StdVec_Vec3s()
            points.extend(list(shape.points))
            geometry = coal.ConvexBase.convexHull(points, False, "Qt")
        return self.geometry.addGeometryObject(self._pin.GeometryObject(name, joint, place, geometry))

    def configurations(self, Q: np.ndarray) -> np.ndarray:
        """(N, nq) of Pinocchio's own columns."""
        out = np.empty((len(Q), self.model.nq))
        for row, q in enumerate(Q):
            for address, name in self._order:
                out[row, address] = self._robot.joint_value(name, q)
        return out

    def collides(self, Q: np.ndarray) -> np.ndarray:
        pin = self._pin
        ask = (self.model, self.data, self.geometry, self.geometry_data)
        return np.array([pin.computeCollisions(*ask, q, True) for q in Q])

    def collides_by_manager(self, Q: np.ndarray) -> np.ndarray:
        pin = self._pin
        return np.array([pin.computeCollisions(self.model, self.data, self.manager, q, True) for q in Q])
