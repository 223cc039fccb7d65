"""Contacts of bodies at rest from step to step, by collide, MuJoCo, Bullet and Newton: how far they move.

    python -m pytest tests/differential/test_contact_drift.py -m slow -s       # the table of docs/contacts.md

The bodies move by less than a micrometre from step to step (`resting_bodies.py`). Measured is how far the farthest
contact is from the nearest one of the step before, and in how many steps there are more or fewer. Other engines have
no number of a feature to tell contacts by.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from resting_bodies import BODIES, CORNERS, FACETS, FLOORS, PRISM, WITHIN, moved_poses

import collide

pytestmark = pytest.mark.slow
#: Bullet gathers contacts over some steps, a new one in each.
FIRST, STEPS = 8, 30
ASKED_FLOORS = ("plane", "box", "height field")


def by_collide(floor: str, body: str) -> Callable[[np.ndarray], np.ndarray]:
    ground, X_WF = FLOORS[floor]

    def points(X_WB: np.ndarray) -> np.ndarray:
        rows = collide.contacts(ground, BODIES[body].shape, X_WF, X_WB, margin=1e-4, max_contacts=16).rows
        return 0.5 * (rows["point_a"] + rows["point_b"])

    return points


def by_mujoco(floor: str, body: str) -> Callable[[np.ndarray], np.ndarray]:
    mujoco = pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    hull = " ".join(" ".join(map(repr, p)) for p in np.array(PRISM if body == "hull" else CORNERS).tolist())
    geoms = {
        "box": 'type="box" size="0.15 0.1 0.05"', "mesh": 'type="mesh" mesh="m"', "hull": 'type="mesh" mesh="m"',
        "can": 'type="cylinder" size="0.05 0.05"', "can on its side": 'type="cylinder" size="0.05 0.1"',
    }
    floors = {
        "plane": '<geom type="plane" size="1 1 1"/>', "box": '<geom type="box" size="1 1 0.1" pos="0 0 -0.1"/>',
        "height field": '<geom type="hfield" hfield="h"/>',
    }
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" vertex="{hull}"/>'
        '<hfield name="h" nrow="41" ncol="41" size="1 1 1 0.1"/></asset>'
        f'<worldbody>{floors[floor]}<body><freejoint/><geom margin="1e-4" {geoms[body]}/></body></worldbody></mujoco>')
    data = mujoco.MjData(model)

    def points(X_WB: np.ndarray) -> np.ndarray:
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, X_WB[:3, :3].ravel())
        data.qpos[:3], data.qpos[3:7] = X_WB[:3, 3], quat
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        return np.array([data.contact[k].pos for k in range(data.ncon)]).reshape(-1, 3)

    return points


def by_bullet(floor: str, body: str) -> Callable[[np.ndarray], np.ndarray]:
    bullet = pytest.importorskip("pybullet", reason="the package pybullet is not installed")
    client = {"physicsClientId": bullet.connect(bullet.DIRECT)}
    shapes = {
        "box": (bullet.GEOM_BOX, {"halfExtents": [0.15, 0.1, 0.05]}),
        "mesh": (bullet.GEOM_MESH, {"vertices": CORNERS.tolist()}),
        "hull": (bullet.GEOM_MESH, {"vertices": PRISM}),
        "can": (bullet.GEOM_CYLINDER, {"radius": 0.05, "height": 0.1}),
        "can on its side": (bullet.GEOM_CYLINDER, {"radius": 0.05, "height": 0.2}),
    }
    heights = {"heightfieldData": [0.0] * 41 * 41, "numHeightfieldRows": 41, "numHeightfieldColumns": 41}
    floors = {
        "plane": (bullet.GEOM_PLANE, {}), "box": (bullet.GEOM_BOX, {"halfExtents": [1, 1, 0.1]}),
        "height field": (bullet.GEOM_HEIGHTFIELD, {"meshScale": [0.05, 0.05, 1], **heights}),
    }

    def made(mass: float, kind: int, options: dict, at: tuple = (0, 0, 0)) -> int:
        shape = bullet.createCollisionShape(kind, **options, **client)
        return bullet.createMultiBody(mass, shape, basePosition=at, **client)

    made(0.0, *floors[floor], at=(0, 0, -0.1) if floor == "box" else (0, 0, 0))
    moving = made(1.0, *shapes[body])

    def points(X_WB: np.ndarray) -> np.ndarray:
        w, x, y, z = _quaternion(X_WB)
        bullet.resetBasePositionAndOrientation(moving, X_WB[:3, 3].tolist(), [x, y, z, w], **client)
        bullet.performCollisionDetection(**client)
        rows = bullet.getContactPoints(moving, **client) or ()
        return np.array([0.5 * (np.array(row[5]) + np.array(row[6])) for row in rows]).reshape(-1, 3)

    return points


def by_newton(floor: str, body: str) -> Callable[[np.ndarray], np.ndarray]:
    newton = pytest.importorskip("newton", reason="newton is not installed")
    import warp as wp

    wp.config.quiet = True
    builder = newton.ModelBuilder()
    config = newton.ModelBuilder.ShapeConfig(gap=1e-4)
    if floor == "plane":
        builder.add_ground_plane(cfg=config)
    elif floor == "box":
        builder.add_shape_box(-1, hx=1, hy=1, hz=0.1, xform=wp.transform((0, 0, -0.1), wp.quat_identity()), cfg=config)
    else:
        field = newton.Heightfield(np.zeros((41, 41), dtype=np.float32), 41, 41, hx=1.0, hy=1.0)
        builder.add_shape_heightfield(heightfield=field, cfg=config)
    number = builder.add_body()
    if body == "box":
        builder.add_shape_box(number, hx=0.15, hy=0.1, hz=0.05, cfg=config)
    elif body.startswith("can"):
        builder.add_shape_cylinder(number, radius=0.05, half_height=0.05 if body == "can" else 0.1, cfg=config)
    else:
        points = PRISM if body == "hull" else CORNERS
        mesh = newton.Mesh(np.array(points, dtype=np.float32), _hull_facets(points))
        add = builder.add_shape_convex_hull if body == "hull" else builder.add_shape_mesh
        add(number, mesh=mesh, cfg=config)
    model = builder.finalize(device="cpu")
    state, pipeline = model.state(), newton.CollisionPipeline(model)
    contacts = pipeline.contacts()

    def points_of(X_WB: np.ndarray) -> np.ndarray:
        w, x, y, z = _quaternion(X_WB)
        state.body_q.numpy()[0] = [*X_WB[:3, 3], x, y, z, w]
        pipeline.collide(state, contacts)
        n = int(contacts.rigid_contact_count.numpy()[0])
        shapes, points = contacts.rigid_contact_shape0.numpy()[:n], contacts.rigid_contact_point0.numpy()[:n]
        moves = model.shape_body.numpy()[shapes] >= 0
        p = points.astype(float)
        p[moves] = p[moves] @ X_WB[:3, :3].T + X_WB[:3, 3]
        return p

    return points_of


def _hull_facets(points) -> np.ndarray:
    vertices, faces = collide.tessellate(collide.ConvexHull(points))[:2]
    numbers = [int(np.argmin(np.square(np.array(points) - v).sum(axis=1))) for v in vertices]
    return np.array(numbers)[faces].ravel() if len(points) != len(CORNERS) else np.ravel(FACETS)


def _quaternion(X: np.ndarray) -> tuple[float, float, float, float]:
    """(w, x, y, z) of a pose."""
    R = X[:3, :3]
    w = 0.5 * np.sqrt(max(1.0 + np.trace(R), 0.0))
    if w < 1e-3:
        raise ValueError(f"a half turn: {R}")
    return w, (R[2, 1] - R[1, 2]) / (4 * w), (R[0, 2] - R[2, 0]) / (4 * w), (R[1, 0] - R[0, 1]) / (4 * w)


def drift(points_of: Callable[[np.ndarray], np.ndarray], floor: str, body: str) -> tuple[float, int, int]:
    """(farthest that a contact is from those of the step before [m], steps with more or fewer, most contacts)."""
    farthest, changed, most = 0.0, 0, 0
    for depth in WITHIN[:2]:  # gaps need a margin, which engines have differently
        before = np.zeros((0, 3))
        poses = moved_poses(BODIES[body].X_WB, min(depth, -1e-6), FIRST + STEPS, seed=f"{floor} {body} {depth}")
        for step, X_WB in enumerate(poses):
            now = points_of(X_WB)
            if step > FIRST:
                most = max(most, len(now))
                changed += len(now) != len(before)
                for p in now:
                    farthest = max(farthest, np.abs(before - p).max(axis=1).min(initial=np.inf))
            before = now
    return farthest, changed, most


ENGINES = {"collide": by_collide, "MuJoCo": by_mujoco, "Bullet": by_bullet, "Newton": by_newton}


@pytest.mark.parametrize("engine", ENGINES)
def test_contacts_at_rest_move_no_more_than_the_body(engine):
    print(f"\n{engine}: µm to the nearest contact of the step before; steps of {2 * STEPS - 2} with more or fewer")
    worst = {}
    for floor in ASKED_FLOORS:
        for body in BODIES:
            try:
                worst[floor, body] = drift(ENGINES[engine](floor, body), floor, body)
            except (RuntimeError, TypeError, ValueError, AttributeError) as error:
                if engine == "collide":
                    raise
                print(f"  {body} on {floor}: not asked, {error!r:.80}")
                continue
            farthest, changed, most = worst[floor, body]
            print(f"  {body} on {floor}: {1e6 * farthest:.3g} µm, {changed} steps, {most} contacts")
    assert len(worst) >= 10
    if engine == "collide":
        assert all(farthest <= 1e-6 and changed == 0 for farthest, changed, _ in worst.values()), worst
