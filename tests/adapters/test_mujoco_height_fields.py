"""Height fields of MuJoCo on collide: contacts beside those of `collide.HeightField`, and of a naive oracle; bodies
that fall, rest, and slide.

Fields stand tilted in the world, so that none of this depends on axes. Skipped where MuJoCo is not installed.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest
from separating_axes import Polytope, overlap_depth

import collide
from collide.adapters.hosts.mujoco import install, world
from collide.adapters.hosts.mujoco_geoms import geom_shapes
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)
mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'collide-robotics[mujoco]'")

KINDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
HULL = np.random.default_rng(3).normal(size=(14, 3))
HULL *= 0.08 / np.linalg.norm(HULL, axis=1)[:, None]
TILTED = 'pos="0.3 -0.2 0.1" quat="0.9 0.2 -0.1 0.3"'
LEVEL = ""


def numbers(array) -> str:
    return " ".join(f"{v:.6f}" for v in np.ravel(array))


def form(kind: str, more: str = "") -> str:
    of_kind = 'mesh="hull"' if kind == "mesh" else 'size=".06 .05 .07"'
    return f'<geom type="{kind}" {of_kind} {more}/>'


def model_of(heights, *bodies: str, size="1 1 .1 .1", pose: str = TILTED, option: str = "", field: str = ""):
    """A field of heights (r, c) from 0 to 1, and bodies that float."""
    heights = np.asarray(heights)
    text = (
        f'<mujoco>{option}<asset><mesh name="hull" vertex="{numbers(HULL)}"/>'
        f'<hfield name="h" nrow="{heights.shape[0]}" ncol="{heights.shape[1]}" size="{size}"/></asset>'
        f'<worldbody><geom type="hfield" hfield="h" {pose} {field}/>'
        f"{''.join(f'<body><freejoint/>{body}</body>' for body in bodies)}</worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    model.hfield_data[:] = heights.ravel()
    return model


def matrix(data, k: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = data.geom_xmat[k].reshape(3, 3), data.geom_xpos[k]
    return X


def place(model, data, X_WG) -> None:
    """The geom of the first body that floats, which sits off its body's middle where it is a mesh; no contacts yet."""
    mujoco.mju_quat2Mat(flat := np.zeros(9), model.geom_quat[1])
    R = X_WG[:3, :3] @ flat.reshape(3, 3).T
    data.qpos[:3] = X_WG[:3, 3] - R @ model.geom_pos[1]
    mujoco.mju_mat2Quat(data.qpos[3:7], R.ravel())
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)


def near_the_surface(model, data, random, depth: float, spread: float = 0.8) -> float:
    """Place the body at random over the field, then so that it overlaps by about this depth; the distance then."""
    H, B = shapes_of(model)
    X_WH = matrix(data, 0)
    X_HB = np.eye(4)
    q = random.normal(size=4)
    mujoco.mju_quat2Mat(flat := np.zeros(9), q / np.linalg.norm(q))
    X_HB[:3, :3] = flat.reshape(3, 3)
    X_HB[:3, 3] = *random.uniform(-spread, spread, 2), random.uniform(0.2, 0.3)
    X_WB = X_WH @ X_HB
    start = collide.distance(H, B, X_WH, X_WB)
    X_WB[:3, 3] -= (start.distance + depth) * start.normal
    place(model, data, X_WB)
    return collide.distance(H, B, matrix(data, 0), matrix(data, 1)).distance


def shapes_of(model) -> list:
    shapes, rows, remaining = geom_shapes(model)
    assert not remaining
    return [shapes[row] for row in rows[:2]]


def contacts_of(model, data) -> np.ndarray:
    """(n, 7) distance, place, normal of the contacts of a step with collide."""
    with install(model) as installed:
        assert not installed.remaining
        mujoco.mj_collision(model, data)
    return np.array([(c.dist, *c.pos, *c.frame[:3]) for c in data.contact]).reshape(-1, 7)


def described(model, data) -> str:
    return f"qpos = {data.qpos.tolist()}, heights as of the seed, {model.hfield_size.tolist()}"


def resolved(found: np.ndarray, rounds: int = 200) -> np.ndarray:
    """A translation of the body after which no contact overlaps, found by going along one normal after another."""
    t = np.zeros(3)
    for _ in range(rounds):
        for row in found:
            t -= min(0.0, row[0] + t @ row[4:]) * row[4:]
    return t


# --- contacts -----------------------------------------------------------------------------------------------------


@pytest.mark.many(3)
@pytest.mark.parametrize("kind", KINDS)
def test_contacts_are_those_of_python(kind):
    """Shallow overlaps: as deep as `collide.contacts` has them, with its normal and place; or, where both have one
    normal, a shorter way out along another. Gaps within the margin: the same to the last digits.
    """
    random = np.random.default_rng(KINDS.index(kind))
    n_same = n_shorter = n_gaps = n_several = 0
    for n_cells, height in ((23, 0.1), (59, 0.05)):
        model = model_of(random.random((n_cells + 1, n_cells)), form(kind), size=f"1 1 {height} .1")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        H, B = shapes_of(model)
        for case in range(40):
            is_gap = case % 4 == 0
            model.geom_margin[:] = 1e-3 if is_gap else 0.0
            distance = near_the_surface(model, data, random, -5e-4 if is_gap else 10.0 ** random.uniform(-5, -3))
            found, said = contacts_of(model, data), described(model, data)
            if distance > 0.0:
                assert (len(found) > 0) == (distance <= model.geom_margin[1]), said
                if len(found):
                    n_gaps += 1
                    assert found[:, 0].min() == pytest.approx(distance, abs=1e-9), said
                continue
            wanted = collide.contacts(H, B, matrix(data, 0), matrix(data, 1))
            assert len(found) > 0, said
            deepest, theirs = found[found[:, 0].argmin()], wanted.rows[wanted.rows["distance"].argmin()]
            if np.ptp(found[:, 4:], axis=0).max() > 1e-6 or np.ptp(wanted.rows["normal"], axis=0).max() > 1e-6:
                n_several += 1
            elif np.abs(deepest[4:] - theirs["normal"]).max() < 1e-4 * (kind in ("ellipsoid", "cylinder")) + 1e-9:
                n_same += 1
                assert deepest[0] == pytest.approx(theirs["distance"], abs=1e-8), said
                middle = 0.5 * (wanted.rows["point_a"] + wanted.rows["point_b"])
                assert np.linalg.norm(middle - deepest[1:4], axis=1).min() < 2e-5, said
            else:
                n_shorter += 1
                assert -deepest[0] <= theirs["apart"] * 1.05 + 1e-12, said
    print(f"{kind}: {n_same} the same, {n_shorter} shorter, {n_gaps} gaps, {n_several} of several normals")
    assert n_same >= 25 and n_gaps >= 10, (n_same, n_shorter, n_gaps, n_several)


def prisms_near(model, data, reach: float) -> list[np.ndarray]:
    """In the world: below each triangle of the grid that is not farther from the body than this, seen from above."""
    x, y, z, base = model.hfield_size[0]
    n_rows, n_columns = int(model.hfield_nrow[0]), int(model.hfield_ncol[0])
    heights = z * model.hfield_data.reshape(n_rows, n_columns).astype(float)
    X_WH = matrix(data, 0)
    middle = X_WH[:3, :3].T @ (data.geom_xpos[1] - X_WH[:3, 3])
    out = []
    for i in range(n_rows - 1):
        for j in range(n_columns - 1):
            for triangle in (((i, j), (i, j + 1), (i + 1, j + 1)), ((i, j), (i + 1, j + 1), (i + 1, j))):
                steps = 2 * x / (n_columns - 1), 2 * y / (n_rows - 1)
                top = np.array([(steps[0] * c - x, steps[1] * r - y, heights[r, c]) for r, c in triangle])
                if (np.abs(top[:, :2] - middle[:2]).min(axis=0) < reach + steps[0]).all():
                    points = np.concatenate([top, top * [1, 1, 0] - [0, 0, base]])
                    out.append(points @ X_WH[:3, :3].T + X_WH[:3, 3])
    return out


def deepest_of(prisms: list[np.ndarray], body: np.ndarray) -> float:
    """How deep a body overlaps the prism that it overlaps deepest; the boxes of the others do not meet its own."""
    low, high = body.min(axis=0), body.max(axis=0)
    near = [p for p in prisms if (p.min(axis=0) <= high).all() and (low <= p.max(axis=0)).all()]
    polytope = Polytope(body)
    return max((overlap_depth(Polytope(prism), polytope) for prism in near), default=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_overlaps_are_those_of_all_axes(kind):
    """Up to two centimetres deep, cells of nine and of four: the deepest contact is no less deep than any prism by
    itself, and moved out of its contacts the body overlaps no prism.
    """
    random = np.random.default_rng(20 + KINDS.index(kind))
    points = np.array([[a, b, c] for a in (-0.06, 0.06) for b in (-0.05, 0.05) for c in (-0.07, 0.07)])
    n_deep = n_shallow = 0
    for n_cells in (23, 50):
        model = model_of(random.random((n_cells, n_cells)), form(kind), size="1 1 .08 .1")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        if kind == "mesh":  # MuJoCo keeps them about their middle
            points = model.mesh_vert.astype(float)
        for _ in range(20 if kind == "box" else 8):
            depth = 10.0 ** random.uniform(-5, -1.7)
            if near_the_surface(model, data, random, depth) > 0.0:
                continue
            found, said = contacts_of(model, data), described(model, data)
            prisms, X_WB = prisms_near(model, data, 0.1), matrix(data, 1)
            body = points @ X_WB[:3, :3].T + X_WB[:3, 3]
            deepest = deepest_of(prisms, body)
            assert -found[:, 0].min() >= deepest - 1e-9, said
            left = deepest_of(prisms, body + resolved(found))
            assert left < 1e-6 * deepest + 1e-8, (left, deepest, said)
            n_deep += deepest > 2e-3
            n_shallow += deepest <= 2e-3
    assert n_deep >= 3 and n_shallow >= 5, (n_deep, n_shallow)


def test_a_flat_field_is_a_floor():
    """However fine its cells are: four corners of a box, as deep as it is, upright; eight of a cylinder."""
    for n in (2, 5, 40):
        model = model_of(np.full((n, n), 0.5), form("box"), pose=LEVEL)
        data = mujoco.MjData(model)
        X = np.eye(4)
        X[:3, 3] = 0.011, 0.017, 0.05 + 0.07 - 1e-3
        place(model, data, X)
        found = contacts_of(model, data)
        np.testing.assert_allclose(found[:, 4:], [[0.0, 0.0, 1.0]] * len(found), atol=1e-12)
        np.testing.assert_allclose(found[:, 0], -1e-3, atol=1e-9)
        corners = {(round(p[1] - 0.011, 6), round(p[2] - 0.017, 6)) for p in found}
        assert corners >= {(a, b) for a in (-0.06, 0.06) for b in (-0.05, 0.05)} and len(found) <= 8, n
        model = model_of(np.full((n, n), 0.5), form("cylinder"), pose=LEVEL)
        data = mujoco.MjData(model)
        X[2, 3] = 0.05 + 0.05 - 1e-3
        place(model, data, X)
        found = contacts_of(model, data)
        assert 4 <= len(found) <= 8 and np.ptp(found[:, 1:3], axis=0).min() > 0.1, n


def test_base_and_rims():
    """Balls below the field, beside it and at its upper edge are pushed out there; inside it, up."""
    model = model_of(np.full((7, 9), 0.5), form("sphere"), size="1 .8 .2 .3", pose=LEVEL)
    data = mujoco.MjData(model)
    for p, normal, distance in (
        ((0.1, 0.2, -0.355), (0, 0, -1), -0.005), ((1.055, 0.2, -0.1), (1, 0, 0), -0.005),
        ((0.1, -0.855, -0.1), (0, -1, 0), -0.005), ((0.1, 0.2, 0.05), (0, 0, 1), -0.11),
        ((1.04, 0.2, 0.14), (0.5**0.5, 0, 0.5**0.5), 0.04 * 2**0.5 - 0.06),
    ):
        X = np.eye(4)
        X[:3, 3] = p
        place(model, data, X)
        found = contacts_of(model, data)
        deepest = found[found[:, 0].argmin()]
        np.testing.assert_allclose(deepest[4:], normal, atol=1e-7, err_msg=str(p))
        assert deepest[0] == pytest.approx(distance, abs=1e-7), p


def test_distances():
    """`mj_geomDistance` near and far, and beyond its limit; where they meet, minus the depth of the deepest contact."""
    random = np.random.default_rng(5)
    heights, fromto, n_far = random.random((24, 24)), np.zeros(6), 0
    for kind in KINDS:
        model = model_of(heights, form(kind))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        H, B = shapes_of(model)
        for gap in (0.003, 0.05, 0.3, 2.0, 20.0):
            near_the_surface(model, data, random, -gap)
            wanted = collide.distance(H, B, matrix(data, 0), matrix(data, 1))
            with install(model):
                got = mujoco.mj_geomDistance(model, data, 0, 1, 100.0, fromto)
                assert got == pytest.approx(wanted.distance, rel=1e-9, abs=1e-9), (kind, data.qpos.tolist())
                assert np.linalg.norm(fromto[3:] - fromto[:3]) == pytest.approx(got, rel=1e-6), kind
                half = 0.5 * got
                assert mujoco.mj_geomDistance(model, data, 0, 1, half, fromto) == half, kind
            n_far += got > 0.2
        near_the_surface(model, data, random, 1e-3)
        deepest = contacts_of(model, data)[:, 0].min()
        with install(model):
            assert mujoco.mj_geomDistance(model, data, 0, 1, 10.0, fromto) == pytest.approx(deepest, abs=1e-12), kind
    assert n_far >= 12, n_far


# --- steps --------------------------------------------------------------------------------------------------------


def hills(n: int, random) -> np.ndarray:
    x = np.linspace(0.0, 8.0, n)
    heights = np.sin(x)[:, None] * np.cos(0.9 * x)[None] + 0.15 * random.random((n, n))
    return (heights - heights.min()) / np.ptp(heights)


def dropped(n: int = 18, seed: int = 0):
    """Bodies of all kinds over hills of 9 cm cells."""
    random = np.random.default_rng(seed)
    grip = 'friction="1.5 .05 .02" condim="6"'
    model = model_of(
        hills(24, random), *(form(KINDS[k % 6], grip) for k in range(n)), size="1 1 .2 .1", pose=LEVEL,
        option='<option timestep=".004" cone="elliptic"/>', field=grip,
    )
    data = mujoco.MjData(model)
    q = data.qpos.reshape(n, 7)
    q[:, 3:] = random.normal(size=(n, 4))
    for k in range(n):
        q[k, :3] = 0.32 * (k % 5 - 2), 0.32 * (k // 5 - 1.5), 0.32
    return model, data


def test_bodies_come_to_rest():
    """Three seconds after they were dropped: none below the surface, all slow, no contact deep."""
    model, data = dropped()
    with install(model):
        for _ in range(750):
            mujoco.mj_step(model, data)
        deepest = min(contact.dist for contact in data.contact)
    assert np.isfinite(data.qpos).all() and data.ncon >= 18
    x, y, z, _ = model.hfield_size[0]
    heights = z * model.hfield_data.reshape(24, 24)
    for p in data.geom_xpos[1:]:
        i, j = np.round((p[1] + y) / (2 * y) * 23).astype(int), np.round((p[0] + x) / (2 * x) * 23).astype(int)
        around = heights[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        assert p[2] > around.min(), p
    speeds = np.abs(data.qvel.reshape(-1, 6)[:, :3]).max(axis=1)
    assert np.median(speeds) < 0.02 and deepest > -0.01, (speeds, deepest)


def test_inner_edges_do_not_kick():
    """A box slides over two metres of a frictionless field, flat or a slope that it goes along and down: nothing turns
    it, and nothing slows it.
    """
    for slope in (0.0, 0.1):
        heights = np.add.outer(np.linspace(0, 1, 21), np.zeros(31)) if slope else np.full((21, 31), 0.5)
        model = model_of(
            heights, form("box", 'condim="1"'), size=f"3 2 {4 * slope or 0.1} .1", pose=LEVEL,
            option='<option timestep=".002"/>', field='condim="1"',
        )
        data = mujoco.MjData(model)
        tilt = np.arctan(slope)
        X = np.eye(4)
        X[1:3, 1:3] = [[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]]
        X[:3, 3] = [-1.5, 0.0, 0.2 if slope else 0.05] + 0.0698 * X[:3, 2]
        place(model, data, X)
        data.qvel[:3] = 2.0, 0.3, 0.3 * slope
        with install(model):
            for _ in range(200):  # the contacts are springs: it sinks a little
                mujoco.mj_step(model, data)
            lift = data.geom_xpos[1] @ X[:3, 2]
            for _ in range(300):
                mujoco.mj_step(model, data)
                assert abs(data.geom_xpos[1] @ X[:3, 2] - lift) < 1e-7, (slope, data.time)
        assert data.qvel[0] == pytest.approx(2.0, abs=1e-6) and np.abs(data.qvel[3:]).max() < 1e-5, slope
        assert data.qpos[0] == pytest.approx(0.5, abs=1e-5), slope


def test_cull_is_bit_identical():
    model, data = dropped()
    other = copy.copy(data)
    for _ in range(150):
        mujoco.mj_step(model, data)
    with install(model, "cull"):
        for _ in range(150):
            mujoco.mj_step(model, other)
    assert data.ncon > 10
    np.testing.assert_array_equal(data.qpos, other.qpos)
    np.testing.assert_array_equal(data.qvel, other.qvel)


def test_threads_have_the_same_bits():
    rollout = pytest.importorskip("mujoco.rollout")
    model, data = dropped()
    state = mujoco.mjtState.mjSTATE_FULLPHYSICS
    first, last = (np.zeros(mujoco.mj_stateSize(model, state)) for _ in range(2))
    mujoco.mj_getState(model, data, first, state)
    with install(model):
        ends, _ = rollout.rollout(
            [model] * 4, [mujoco.MjData(model) for _ in range(2)], np.repeat(first[None], 4, axis=0), nstep=80
        )
        for _ in range(80):
            mujoco.mj_step(model, data)
    mujoco.mj_getState(model, data, last, state)
    for k in range(4):
        np.testing.assert_array_equal(ends[k, -1], last)


def test_heights_may_change_from_step_to_step():
    """They are read where MuJoCo has them: no refresh is needed, in copies of the model neither."""
    model = model_of(np.full((5, 5), 0.5), form("sphere"), pose=LEVEL)
    data = mujoco.MjData(model)
    X = np.eye(4)
    X[2, 3] = 0.1
    place(model, data, X)
    with install(model):
        for height in (0.5, 0.2, 0.7):
            model.hfield_data[:] = height
            mujoco.mj_collision(model, data)
            depth = 0.1 * height + 0.06 - 0.1
            assert [c.dist for c in data.contact] == ([pytest.approx(-depth, abs=1e-8)] if depth > 0 else []), height
        twin = copy.copy(model)
        twin.hfield_data[:] = 0.6
        other = mujoco.MjData(twin)
        place(twin, other, X)
        mujoco.mj_collision(twin, other)
        assert [c.dist for c in other.contact] == [pytest.approx(-0.02, abs=1e-8)]


def test_worlds_have_height_fields():
    """Bodies that meet the field in the World are those that have contacts on it."""
    model, data = dropped(12)
    n_met = 0
    with install(model):
        for _ in range(100):
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
    pairs = {tuple(sorted(int(g) for g in c.geom)) for c in data.contact if c.dist < 0.0}
    names = [f"geom {k}" for k in range(model.ngeom)]
    met = {tuple(sorted((names.index(a), names.index(b)))) for a, b in world(model, data).collisions().names}
    assert met == pairs
    n_met += sum(0 in pair for pair in met)
    assert n_met >= 4, n_met


def test_a_diverged_state_is_mujocos(tmp_path, monkeypatch):
    """Poses that are no numbers end nothing, in either mode. MuJoCo writes its warnings into the current folder."""
    monkeypatch.chdir(tmp_path)
    model, data = dropped(6)
    for mode_of_hook in ("contacts", "cull"):
        with install(model, mode_of_hook):
            mujoco.mj_forward(model, data)
            data.geom_xpos[1:4] = np.nan
            data.geom_xpos[4:] = np.inf
            mujoco.mj_collision(model, data)
            data.qvel[:] = np.nan
            mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
