"""coal, Bullet and MuJoCo asked for manifolds of many posed pairs, by `contacts.py` and by the tests of agreement.

Each is made of two lists of shapes and of poses, and has

    detect()     what is timed: every pair's contacts once, geometries, transforms and requests being ready
    manifolds()  one `Manifold` a pair: points (k, 3), the unit normal from A to B, distances (k,) along it [m]

and `calls`: whether a pair costs a call from Python (coal), or all are asked by one (MuJoCo's `mj_collision` on a model
whose pairs are declared, Bullet's `performCollisionDetection` on a world where pairs stand 100 m apart).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide import Box, Capsule, Cylinder, Shape, Sphere
from collide.adapters.peers.coal_peer import CoalPeer
from collide.adapters.peers.pybullet_peer import collision_shape, quaternion_xyzw

#: How far apart pairs stand in Bullet's world [m].
_SPACING = 100.0


class Manifold(NamedTuple):
    """Contacts of one pair. point : (k, 3) midway between both surfaces; normal : (k, 3); distance : (k,) [m]."""

    point: np.ndarray
    normal: np.ndarray
    distance: np.ndarray


def manifold_of(points, normals, distances) -> Manifold:
    return Manifold(
        np.array(points, dtype=float).reshape(-1, 3), np.array(normals, dtype=float).reshape(-1, 3),
        np.array(distances, dtype=float).reshape(-1),
    )


class CoalContacts:
    """`coal.collide` with contacts: one point a convex pair; with ``patches`` `coal.computeContactPatch` after it."""

    calls = True

    def __init__(self, As: list[Shape], Bs: list[Shape], X_WAs, X_WBs, margin: float, patches=False, max_contacts=1):
        import coal

        self.coal, self.patches = coal, patches
        self.name = "coal + patch" if patches else "coal"
        peer, built = CoalPeer(), {}
        for shape in (*As, *Bs):
            if id(shape) not in built:
                built[id(shape)] = peer.build(shape)
        self.pairs = [
            (built[id(A)], _coal_pose(coal, X), built[id(B)], _coal_pose(coal, Y))
            for A, B, X, Y in zip(As, Bs, X_WAs, X_WBs)
        ]
        self.request = coal.CollisionRequest()
        self.request.enable_contact, self.request.num_max_contacts = True, max_contacts
        self.request.security_margin = margin
        self.result, self.patch_request, self.patch_result = (
            coal.CollisionResult(), coal.ContactPatchRequest(), coal.ContactPatchResult(),
        )

    def detect(self) -> None:
        ask, patch, result, request = self.coal.collide, self.coal.computeContactPatch, self.result, self.request
        for A, X, B, Y in self.pairs:
            result.clear()
            ask(A, X, B, Y, request, result)
            if self.patches:
                self.patch_result.clear()
                patch(A, X, B, Y, result, self.patch_request, self.patch_result)

    def manifolds(self) -> list[Manifold]:
        out = []
        for A, X, B, Y in self.pairs:
            self.result.clear()
            self.coal.collide(A, X, B, Y, self.request, self.result)
            contacts = [self.result.getContact(k) for k in range(self.result.numContacts())]
            depths = [c.penetration_depth for c in contacts]  # negative ones
            out.append(manifold_of([c.pos for c in contacts], [c.normal for c in contacts], depths))
        return out


def _coal_pose(coal, X):
    return coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3]))


class BulletContacts:
    """A world of pairs that do not see each other; B has a mass, or Bullet would not look."""

    calls, name = False, "bullet"

    def __init__(self, As: list[Shape], Bs: list[Shape], X_WAs, X_WBs, margin: float):
        import pybullet

        self.pybullet, self.margin = pybullet, margin
        self.client = pybullet.connect(pybullet.DIRECT)
        self.pairs, self.shift = [], []
        shapes: dict[int, int] = {}
        for k, (A, B, X, Y) in enumerate(zip(As, Bs, X_WAs, X_WBs)):
            i, j = divmod(k, 100)
            shift = np.array([_SPACING * i, _SPACING * j, 0.0])
            self.pairs.append((self._body(A, X, 0, shift, shapes), self._body(B, Y, 1, shift, shapes)))
            self.shift.append(shift)

    def _body(self, shape: Shape, X, mass: int, shift, shapes) -> int:
        if id(shape) not in shapes:
            shapes[id(shape)] = bullet_shape(self.pybullet, shape, self.client)
        body = self.pybullet.createMultiBody(mass, shapes[id(shape)], physicsClientId=self.client)
        self.pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=self.client)
        self.pybullet.resetBasePositionAndOrientation(
            body, (X[:3, 3] + shift).tolist(), quaternion_xyzw(X[:3, :3]), physicsClientId=self.client
        )
        return body

    def detect(self) -> None:
        self.pybullet.performCollisionDetection(physicsClientId=self.client)

    def manifolds(self) -> list[Manifold]:
        """The world's own contacts, within the margin, of a world that has been asked once."""
        self.detect()
        out = []
        for (a, b), shift in zip(self.pairs, self.shift):
            near = [c for c in self.pybullet.getContactPoints(a, b, physicsClientId=self.client) if c[8] <= self.margin]
            middles = [0.5 * (np.array(c[5]) + np.array(c[6])) - shift for c in near]
            out.append(manifold_of(middles, [-np.array(c[7]) for c in near], [c[8] for c in near]))
        return out

    def closest_points(self, k: int = 0) -> None:
        """One call from Python."""
        self.pybullet.getClosestPoints(*self.pairs[k], self.margin, physicsClientId=self.client)

    def close(self) -> None:
        self.pybullet.disconnect(self.client)


def bullet_shape(pybullet, shape: Shape, client: int) -> int:
    """The number of a collision shape."""
    return pybullet.createCollisionShape(**collision_shape(pybullet, shape)[0], physicsClientId=client)


class MujocoContacts:
    """One model of all pairs, each declared as a contact pair: no broadphase, no filters."""

    calls, name = False, "mujoco"

    def __init__(self, As: list[Shape], Bs: list[Shape], X_WAs, X_WBs, margin: float):
        import mujoco

        self.mujoco, self.n = mujoco, len(As)
        bodies, pairs = [], []
        shapes = Assets()
        for k, both in enumerate(zip(As, Bs)):
            for side, shape in zip("ab", both):
                bodies.append(f'<body><freejoint/><geom name="{side}{k}" {shapes.attributes(shape)} mass="1" '
                              'contype="0" conaffinity="0"/></body>')
            pairs.append(f'<pair geom1="a{k}" geom2="b{k}" margin="{margin!r}"/>')
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><size memory="200M"/><option><flag multiccd="enable"/></option><asset>{shapes.xml()}</asset>'
            f'<worldbody>{"".join(bodies)}</worldbody><contact>{"".join(pairs)}</contact></mujoco>'
        )
        self.data = mujoco.MjData(self.model)
        poses = np.stack([np.asarray(X_WAs), np.asarray(X_WBs)], axis=1).reshape(-1, 4, 4)
        self.data.qpos[:] = np.concatenate([qpos_of(X) for X in poses])
        mujoco.mj_kinematics(self.model, self.data)

    def detect(self) -> None:
        self.mujoco.mj_collision(self.model, self.data)

    def manifolds(self) -> list[Manifold]:
        self.detect()
        contact = self.data.contact
        geoms, frames = np.array(contact.geom).reshape(-1, 2), np.array(contact.frame).reshape(-1, 9)
        points, distances = np.array(contact.pos).reshape(-1, 3), np.array(contact.dist)
        # Geoms may be exchanged: those of kinds of lower number come first.
        signs = np.where(geoms[:, 0] < geoms[:, 1], 1.0, -1.0)
        pair = geoms.min(axis=1) // 2
        return [
            manifold_of(points[pair == k], (signs[:, None] * frames[:, :3])[pair == k], distances[pair == k])
            for k in range(self.n)
        ]


class Assets:
    """Meshes of a MuJoCo model, and what it calls shapes."""

    def __init__(self) -> None:
        self._meshes: dict[int, tuple[str, str]] = {}

    def attributes(self, shape: Shape) -> str:
        if isinstance(shape, Box):
            return f'type="box" size="{numbers(shape.size / 2)}"'
        if isinstance(shape, Sphere):
            return f'type="sphere" size="{float(shape.radius)!r}"'
        if isinstance(shape, Capsule | Cylinder):
            return f'type="{type(shape).__name__.lower()}" size="{numbers((shape.radius, shape.length / 2))}"'
        if id(shape) not in self._meshes:
            name = f"mesh{len(self._meshes)}"
            self._meshes[id(shape)] = name, f'<mesh name="{name}" vertex="{numbers(shape.points.ravel())}"/>'
        return f'type="mesh" mesh="{self._meshes[id(shape)][0]}"'

    def xml(self) -> str:
        return "".join(xml for _, xml in self._meshes.values())


def numbers(values) -> str:
    return " ".join(repr(float(x)) for x in values)


def qpos_of(X: np.ndarray) -> np.ndarray:
    """(7,) of a free joint: place, quaternion with the scalar first."""
    x, y, z, w = quaternion_xyzw(X[:3, :3])
    return np.array([*X[:3, 3], w, x, y, z])
