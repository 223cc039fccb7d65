"""What models ask for besides shapes: margins, gaps, distances, sensors; and models that change while installed.

Numbers are judged by closed forms of balls and planes, and by `collide.distance`.
"""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.adapters.hosts.mujoco import install
from collide.adapters.hosts.mujoco_geoms import geom_shapes
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)
mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'collide-robotics[mujoco]'")

MESH = '<asset><mesh name="m" vertex="0 0 0 .3 0 0 0 .3 0 0 0 .3 .2 .2 .2"/></asset>'
#: Of each kind: its size, and how it stands on a plane at height 0: half its height [m].
FORMS = {
    "sphere": ("0.1", 0.1), "capsule": ("0.1 0.2", 0.3), "ellipsoid": ("0.1 0.2 0.3", 0.3),
    "cylinder": ("0.1 0.2", 0.2), "box": ("0.1 0.2 0.3", 0.3),
}


def model_of(inner: str, before: str = "", after: str = ""):
    return mujoco.MjModel.from_xml_string(f"<mujoco>{before}{MESH}<worldbody>{inner}</worldbody>{after}</mujoco>")


def body(inner: str, p=(0.0, 0.0, 0.0), name: str = "") -> str:
    named = f'name="{name}"' if name else ""
    return f'<body {named} pos="{p[0]!r} {p[1]!r} {p[2]!r}"><freejoint/>{inner}</body>'


def matrix(data, k: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = data.geom_xmat[k].reshape(3, 3), data.geom_xpos[k]
    return X


def forward(model, data) -> list:
    """Contacts with collide."""
    with install(model):
        mujoco.mj_forward(model, data)
    return list(data.contact)


@pytest.mark.parametrize("kind", FORMS)
def test_planes_meet_every_kind_at_its_height(kind):
    """Sunk by a millimetre, and lifted by one, in planes that lean any way."""
    size, half = FORMS[kind]
    random = np.random.default_rng(1)
    for _ in range(20):
        q = random.normal(size=4)
        q /= np.linalg.norm(q)
        turned = " ".join(repr(float(v)) for v in q)
        frame = (
            f'<geom type="plane" size="1 1 1" quat="{turned}" pos="1 2 3"/><body quat="{turned}" pos="1 2 3">'
            f'<joint type="slide" axis="0 0 1"/><geom type="{kind}" size="{size}"/></body>'
        )
        model = model_of(frame)
        data = mujoco.MjData(model)
        for lift in (-1e-3, 1e-3):
            data.qpos[0] = half + lift
            found = forward(model, data)
            said = f"{kind} {q.tolist()} lift {lift}"
            if lift > 0:
                assert not found, said
                continue
            assert found and min(c.dist for c in found) == pytest.approx(lift, abs=1e-14), said
            for contact in found:
                np.testing.assert_allclose(contact.frame[:3], data.geom_xmat[0].reshape(3, 3)[:, 2], atol=1e-14)


def test_margin_and_gap_are_mujocos():
    """Balls 2, 6 and 40 mm above a plane, margins of 10 mm and gaps of 5: the first pushes, the second is there."""
    ball = '<geom size="0.1" margin="0.01" gap="0.005"/>'
    lifts = (0.002, 0.006, 0.04)
    balls = "".join(body(ball, (0.5 * k, 0.0, 0.1 + lift)) for k, lift in enumerate(lifts))
    model = model_of(f'<geom type="plane" size="5 5 1"/>{balls}')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    alone = [(int(c.geom[1]), c.exclude, c.includemargin) for c in data.contact]
    found = forward(model, data)
    assert [(int(c.geom[1]), c.exclude, c.includemargin) for c in found] == alone
    assert {int(c.geom[1]) - 1 for c in found} >= {0, 1} and len(found) < 3, "the margin is not asked for"
    for contact in found:
        assert contact.dist == pytest.approx(lifts[int(contact.geom[1]) - 1], abs=1e-15)


def test_distances_of_all_kinds():
    """`mj_geomDistance` of each two kinds is that of collide, with its points; beyond the limit it is that."""
    forms = [f'<geom type="{kind}" size="{size}"/>' for kind, (size, _) in FORMS.items()]
    model = model_of("".join(body(form) for form in [*forms, '<geom type="mesh" mesh="m"/>']))
    data = mujoco.MjData(model)
    random = np.random.default_rng(2)
    data.qpos.reshape(-1, 7)[:] = random.normal(size=(6, 7))
    mujoco.mj_kinematics(model, data)
    shapes, rows, _ = geom_shapes(model)
    fromto, n = np.zeros(6), 0
    with install(model):
        for a in range(6):
            for b in range(6):
                if a == b:
                    continue
                r = collide.distance(shapes[rows[a]], shapes[rows[b]], matrix(data, a), matrix(data, b))
                got = mujoco.mj_geomDistance(model, data, a, b, 10.0, fromto)
                assert got == pytest.approx(r.distance, abs=1e-12), (a, b)
                if r.distance > 0.0:
                    n += 1
                    assert np.linalg.norm(fromto[3:] - fromto[:3]) == pytest.approx(r.distance, abs=1e-9), (a, b)
                    near = 0.5 * r.distance
                    assert mujoco.mj_geomDistance(model, data, a, b, near, fromto) == near, (a, b)
    assert n >= 16, n


def test_sensors_of_distances():
    sensors = '<sensor><distance name="d" geom1="a" geom2="b" cutoff="5"/></sensor>'
    two = body('<geom name="a" type="box" size=".1 .1 .1"/>') + body('<geom name="b" size=".1"/>', (0.5, 0.0, 0.0))
    model = model_of(two, after=sensors)
    data = mujoco.MjData(model)
    forward(model, data)
    assert data.sensordata[0] == pytest.approx(0.3, abs=1e-15)


def test_pairs_have_margins_of_their_own():
    """A named pair between geoms that else never meet."""
    two = body('<geom name="a" size=".1" contype="0" conaffinity="0"/>') + body(
        '<geom name="b" size=".1" contype="0" conaffinity="0"/>', (0.21, 0.0, 0.0)
    )
    model = model_of(two, after='<contact><pair geom1="a" geom2="b" margin="0.02"/></contact>')
    (contact,) = forward(model, mujoco.MjData(model))
    assert contact.dist == pytest.approx(0.01, abs=1e-15)


# --- changes while installed ------------------------------------------------------------------------------------------


def test_poses_in_the_model_may_change():
    """Where a geom sits on its body, margins, friction: read at every step, by MuJoCo or here."""
    model = model_of('<geom type="plane" size="1 1 1"/>' + body('<geom size="0.1" pos="0 0 0.01"/>', (0.0, 0.0, 0.15)))
    data = mujoco.MjData(model)
    with install(model):
        mujoco.mj_forward(model, data)
        assert data.ncon == 0
        model.geom_pos[1, 2] = -0.06
        mujoco.mj_forward(model, data)
        assert data.ncon == 1 and data.contact[0].dist == pytest.approx(-0.01, abs=1e-15)
        model.geom_pos[1, 2], model.geom_margin[1] = 0.0, 0.06
        mujoco.mj_forward(model, data)
        assert data.ncon == 1 and data.contact[0].dist == pytest.approx(0.05, abs=1e-15)


def test_vertices_of_a_mesh_that_change_need_a_refresh():
    model = model_of(body('<geom type="mesh" mesh="m"/>') + body('<geom size="0.05"/>', (0.3, 0.3, 0.3)))
    data = mujoco.MjData(model)
    with install(model) as installed:
        mujoco.mj_forward(model, data)
        assert data.ncon == 0
        model.mesh_vert[:] *= 2.0
        model.geom_rbound[0] *= 2.0
        model.geom_aabb[0] *= 2.0
        mujoco.mj_forward(model, data)
        assert data.ncon == 0, "noticed: docs/hosts.md says that it is not"
        installed.refresh()
        mujoco.mj_forward(model, data)
        assert data.ncon == 1


def test_a_model_compiled_anew_is_another_model():
    """Geoms added to a specification: the new model is MuJoCo's until it is installed; the old one stays ours."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body pos="0 0 .0999999999"><freejoint/><geom type="ellipsoid" size=".2 .2 .1"/></body>'
        '<geom type="plane" size="1 1 1"/></worldbody></mujoco>'
    )
    old = spec.compile()
    with install(old) as installed:
        assert forward_alone(old)[0] == pytest.approx(-1e-10, abs=1e-15)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], pos=[3, 0, 0])
        new = spec.compile()
        assert new.ngeom == 3 and forward_alone(new)[1] == 1
        assert forward_alone(old)[0] == pytest.approx(-1e-10, abs=1e-15)
        installed.refresh()
    with install([old, new]):
        assert forward_alone(new)[0] == pytest.approx(-1e-10, abs=1e-15)


def forward_alone(model) -> tuple[float, int]:
    """The deepest contact's distance and how many there are, with whatever stands in the table."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return min((c.dist for c in data.contact), default=np.inf), data.ncon


def test_errors_are_raised_by_whatever_asked(capfd):
    """A kind that changed: steps, forward, distances, each names the geoms, and none goes on without contacts."""
    model = model_of('<geom type="plane" size="1 1 1"/>' + body('<geom size="0.1"/>', (0.0, 0.0, 0.05)))
    data = mujoco.MjData(model)
    with install(model):
        model.geom_type[1] = int(mujoco.mjtGeom.mjGEOM_BOX)
        asked = (
            lambda: mujoco.mj_step(model, data),
            lambda: mujoco.mj_forward(model, data),
            lambda: mujoco.mj_collision(model, data),
            lambda: mujoco.mj_geomDistance(model, data, 0, 1, 1.0, np.zeros(6)),
        )
        for ask in asked:
            with pytest.raises(mujoco.FatalError, match=r"collide: geom 0 or 1 .* refresh\(\)"):
                ask()
    mujoco.mj_forward(model, mujoco.MjData(model))  # MuJoCo's again


#: Options of MuJoCo 4 that look ahead: contacts of bodies that will meet within a step, and barriers.
AHEAD = {
    "SPECULATIVE": '<option gravity="0 0 0"><flag speculative="enable"/></option>',
    "IPC": '<option gravity="0 0 0" integrator="discrete"><flag ipc="enable"/></option>',
}


@pytest.mark.parametrize("flag", AHEAD)
@pytest.mark.parametrize("kinds", [("plane", "sphere"), ("box", "box"), ("box", "ellipsoid"), ("mesh", "mesh")])
def test_contacts_ahead_of_time_are_mujocos(flag, kinds):
    """Of bodies that are apart and come fast: MuJoCo makes these itself, and asks its table besides. With collide they
    have the same bits in either mode, and a body that overlaps has collide's contact.
    """
    if not hasattr(mujoco.mjtEnableBit, f"mjENBL_{flag}"):
        pytest.skip(f"MuJoCo {mujoco.__version__} has no such flag")
    forms = {"plane": 'size="1 1 1"', "sphere": 'size=".02"', "mesh": 'mesh="m"'}
    first, second = (f'<geom type="{kind}" {forms.get(kind, """size=".02 .03 .015" """)}/>' for kind in kinds)
    model = model_of(first + body(second, (0.003, 0.004, 0.4)), AHEAD[flag])

    def found(z: float, speed: float) -> list:
        data = mujoco.MjData(model)
        data.qpos[2], data.qvel[2] = z, -speed
        mujoco.mj_forward(model, data)
        return [(c.dist, *c.pos, *c.frame) for c in data.contact]

    ahead = found(0.4, 250.0)
    assert (len(ahead) > 0) == (flag == "SPECULATIVE"), ahead
    touching = found(0.01, 0.0)
    for mode_of_hook in ("contacts", "cull"):
        with install(model, mode_of_hook):
            assert found(0.4, 250.0) == ahead
            if mode_of_hook == "cull":
                assert found(0.01, 0.0) == touching
            else:
                data = mujoco.MjData(model)
                data.qpos[2] = 0.01
                mujoco.mj_forward(model, data)
                shapes, rows, _ = geom_shapes(model)
                wanted = collide.contacts(shapes[rows[0]], shapes[rows[1]], matrix(data, 0), matrix(data, 1))
                deepest = min(contact.dist for contact in data.contact)
                assert deepest == pytest.approx(wanted.rows["distance"].min(), abs=1e-9)
