"""Bodies deep in height fields of MuJoCo, on collide: fields that are planes push as planes do, of cells of any size.

Judges: supports written out here, and MuJoCo's own plane. Skipped where MuJoCo is not installed.
"""

from __future__ import annotations

import numpy as np
import pytest
from naive import unit

from collide.adapters.hosts.mujoco import install
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)
mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'collide-robotics[mujoco]'")

HULL = np.random.default_rng(3).normal(size=(14, 3))
HULL *= 0.03 / np.linalg.norm(HULL, axis=1)[:, None]
#: Lengths [m] about those of the cells.
SIZES = {
    "sphere": 'size=".02"', "capsule": 'size=".015 .03"', "ellipsoid": 'size=".02 .03 .015"',
    "cylinder": 'size=".02 .025"', "box": 'size=".02 .03 .015"', "mesh": 'mesh="hull"',
}
#: Rises of fields along x and y.
SLOPES = (0.0, 0.0), (0.3, -0.2), (0.9, 0.5)
GROUND = 0.5  # m, the field's height at its middle


def model_of(kind: str, n: int, heights: np.ndarray | None, slope=(0.0, 0.0)):
    """A field of n times n grid points, 0.8 m wide, or with `heights` None MuJoCo's plane; and a body."""
    hull = " ".join(f"{v:.9f}" for v in HULL.ravel())
    N = np.array([-slope[0], -slope[1], 1.0])
    axis = " ".join(f"{v:.17g}" for v in N)
    ground = f'<geom type="plane" size="1 1 1" pos="0 0 {GROUND}" zaxis="{axis}"/>'
    if heights is not None:
        ground = '<geom type="hfield" hfield="h"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="hull" vertex="{hull}"/><hfield name="h" nrow="{n}" ncol="{n}" size=".4 .4 1 1"/>'
        f'</asset><worldbody>{ground}<body><freejoint/><geom type="{kind}" {SIZES[kind]}/></body></worldbody></mujoco>'
    )
    if heights is not None:
        model.hfield_data[:] = heights.ravel()
    return model, N / np.linalg.norm(N)


def plane_heights(n: int, slope) -> np.ndarray:
    x = np.linspace(-0.4, 0.4, n)
    return GROUND + slope[0] * x[None, :] + slope[1] * x[:, None]


def support(kind: str, model, R_WB, p_WB, nhat_W) -> np.ndarray:
    """The point of the body that is farthest along a unit vector; of several any."""
    m, size = R_WB.T @ nhat_W, model.geom_size[1]
    if kind == "sphere":
        v = size[0] * m
    elif kind == "capsule":
        v = np.array([0.0, 0.0, np.sign(m[2]) * size[1]]) + size[0] * m
    elif kind == "ellipsoid":
        v = size**2 * m / np.linalg.norm(size * m)
    elif kind == "cylinder":
        v = np.array([*size[0] * m[:2] / max(np.hypot(*m[:2]), 1e-300), np.sign(m[2]) * size[1]])
    elif kind == "box":
        v = np.sign(m) * size
    else:
        v = model.mesh_vert[np.argmax(model.mesh_vert @ m)].astype(float)
    return p_WB + R_WB @ v


def put(model, data, q, p_WG) -> np.ndarray:
    """The body turned by q, its geom's middle at p_WG; the geom's rotation."""
    data.qpos[:3], data.qpos[3:] = 0.0, q
    mujoco.mj_kinematics(model, data)
    data.qpos[:3] = p_WG - data.geom_xpos[1]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data.geom_xmat[1].reshape(3, 3)


@pytest.mark.many(3)
@pytest.mark.parametrize("kind", SIZES)
def test_fields_that_are_planes_push_as_planes(kind):
    """From a tenth of a millimetre to five centimetres deep, cells of 10 cm to 5 mm: every normal is the plane's, the
    deepest contact is as deep as the body, and stands at the body's lowest point: midway between that and the plane.
    """
    random = np.random.default_rng(sorted(SIZES).index(kind))
    n_deep = n_several = 0
    for n in (9, 33, 81, 161):
        for slope in SLOPES:
            model, N = model_of(kind, n, plane_heights(n, slope), slope)
            data = mujoco.MjData(model)
            for case in range(12):
                depth = 10.0 ** random.uniform(-4.0, -1.3)
                q = unit(random.normal(size=4))
                p_WG = np.array([*random.uniform(-0.1, 0.1, 2), 0.0])
                R_WB = put(model, data, q, p_WG)
                lowest = N @ support(kind, model, R_WB, p_WG, -N) - N @ [0.0, 0.0, GROUND]
                p_WG[2] -= (lowest + depth) / N[2]
                put(model, data, q, p_WG)
                with install(model):
                    mujoco.mj_collision(model, data)
                said = f"n = {n}, slope = {slope}, case {case}, qpos = {data.qpos.tolist()}, {depth} m deep"
                assert data.ncon > 0, said
                for contact in data.contact:
                    np.testing.assert_allclose(contact.frame[:3], N, atol=1e-5, err_msg=said)
                deepest = min(data.contact, key=lambda contact: contact.dist)
                assert deepest.dist == pytest.approx(-depth, abs=2e-7), said
                middle = support(kind, model, R_WB, p_WG, -N) + 0.5 * depth * N
                assert np.linalg.norm(deepest.pos - middle) < 1e-4, (deepest.pos, middle, said)
                n_deep += depth > 0.015
                n_several += data.ncon > 1
    print(f"{kind}: {n_deep} of 144 deeper than the body's least half, {n_several} of several contacts")
    assert n_deep >= 15 and n_several >= 40 * (kind in ("box", "mesh", "capsule")), (n_deep, n_several)


def test_faces_that_lie_level_have_all_their_corners():
    """A box sunk into a level field by a fifth of its height to more than all of it: as deep at four corners."""
    half = np.array([0.02, 0.03, 0.015])
    n_sunk = 0
    for n in (5, 21, 41, 81):
        model, _ = model_of("box", n, plane_heights(n, (0.0, 0.0)))
        data = mujoco.MjData(model)
        for depth in (0.006, 0.014, 0.016, 0.024, 0.035):
            put(model, data, [1, 0, 0, 0], np.array([0.0031, 0.0043, GROUND + half[2] - depth]))
            with install(model):
                mujoco.mj_collision(model, data)
            spots = np.array([contact.pos for contact in data.contact]) - [0.0031, 0.0043, GROUND - 0.5 * depth]
            corners = [(a, b, 0.0) for a in (-half[0], half[0]) for b in (-half[1], half[1])]
            away = [np.linalg.norm(spots - corner, axis=1).min() for corner in corners]
            assert max(away) < 1e-6, (n, depth, spots)
            assert np.ptp([contact.dist for contact in data.contact]) < 1e-6, (n, depth)
            n_sunk += depth > half[2]
    assert n_sunk == 12


def test_balls_are_pushed_through_their_middle():
    """On hills and on noise, at any depth: a contact of a ball lies on the line along its normal through the middle."""
    random = np.random.default_rng(7)
    n_below = n_contacts = 0
    for n in (11, 41, 81):
        x = np.linspace(0.0, 9.0, n)
        for rough in (0.0, 0.02):
            hills = GROUND + 0.05 * np.sin(x)[:, None] * np.cos(1.3 * x)[None] + rough * random.random((n, n))
            model, _ = model_of("sphere", n, hills)
            data = mujoco.MjData(model)
            for case in range(40):
                p_WG = np.array([*random.uniform(-0.3, 0.3, 2), 0.0])
                i, j = np.round((p_WG[[1, 0]] + 0.4) / 0.8 * (n - 1)).astype(int)
                p_WG[2] = hills[i, j] + random.uniform(-0.03, 0.02)
                put(model, data, [1, 0, 0, 0], p_WG)
                with install(model):
                    mujoco.mj_collision(model, data)
                n_below += p_WG[2] < hills[i, j]
                for contact in data.contact:
                    lowest = p_WG - 0.02 * contact.frame[:3]
                    off = contact.pos - (lowest - 0.5 * contact.dist * contact.frame[:3])
                    assert np.linalg.norm(off) < 1e-6, (n, rough, case, off, contact.dist, contact.frame[:3])
                    n_contacts += 1
    assert n_below >= 100 and n_contacts >= 200, (n_below, n_contacts)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.05, -0.03)])
def test_balls_that_are_dropped_do_as_on_a_plane(slope):
    """From half a metre above, on cells of 2 to 0.5 cm, which the ball sinks into beyond its middle: for a second it
    moves as on MuJoCo's own plane, which is installed nowhere.
    """
    n_sunk = 0
    plane, N = model_of("sphere", 2, None, slope)
    start = np.array([0.003, 0.004, GROUND + 0.52])
    for n in (41, 81, 161):
        field, _ = model_of("sphere", n, plane_heights(n, slope), slope)
        of_plane, of_field = mujoco.MjData(plane), mujoco.MjData(field)
        of_plane.qpos[:3] = of_field.qpos[:3] = start
        with install(field):
            for _ in range(500):
                mujoco.mj_step(plane, of_plane)
                mujoco.mj_step(field, of_field)
                n_sunk += (of_field.qpos[:3] - [0.0, 0.0, GROUND]) @ N < 0.0
        assert np.abs(of_field.qpos - of_plane.qpos).max() < 1e-4, (n, of_field.qpos, of_plane.qpos)
        assert np.abs(of_field.qvel - of_plane.qvel).max() < 1e-3, (n, of_field.qvel, of_plane.qvel)
        if slope == (0.0, 0.0):
            assert np.abs(of_field.qpos[:2] - start[:2]).max() < 1e-7 and np.abs(of_field.qvel).max() < 1e-2, n
    assert n_sunk >= 3, n_sunk
