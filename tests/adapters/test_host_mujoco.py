"""MuJoCo on collide: what stands in its table, whose answers a step has, and that everything is put back.

Contacts are judged against `collide.contacts`, whose own tests judge it exactly; places of geoms are turned into
matrices here, not by the adapter. Skipped where MuJoCo is not installed.
"""

from __future__ import annotations

import copy
import functools
import subprocess
import sys
import threading

import numpy as np
import pytest

import collide
from collide.adapters.hosts import mujoco as mujoco_host
from collide.adapters.hosts import mujoco_layout, mujoco_limits
from collide.adapters.hosts.mujoco import MODES, install, is_hooked, world
from collide.adapters.hosts.mujoco_geoms import geom_shapes
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)
mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'collide-robotics[mujoco]'")

KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
HULL = np.random.default_rng(3).normal(size=(14, 3))
HULL *= 0.1 / np.linalg.norm(HULL, axis=1)[:, None]
ASSET = (
    f'<asset><mesh name="hull" vertex="{" ".join(f"{v:.6f}" for v in HULL.ravel())}"/>'
    '<mesh name="tet" vertex="0 0 0 .3 0 0 0 .3 0 0 0 .3"/></asset>'
)


def geom(kind: str, size=(0.08, 0.07, 0.09), more: str = "") -> str:
    if kind == "mesh":
        return f'<geom type="mesh" mesh="hull" {more}/>'
    return f'<geom type="{kind}" size="{size[0]:.4f} {size[1]:.4f} {size[2]:.4f}" {more}/>'


def body(inner: str, p=(0.0, 0.0, 0.0)) -> str:
    return f'<body pos="{p[0]:.4f} {p[1]:.4f} {p[2]:.4f}"><freejoint/>{inner}</body>'


def model_of(*parts: str, option: str = ""):
    text = f"<mujoco>{option}{ASSET}<worldbody>{''.join(parts)}</worldbody></mujoco>"
    return mujoco.MjModel.from_xml_string(text)


def pair_of(a: str, b: str, more: str = ""):
    """A model of two geoms of these kinds; `a` stands still where it is a plane."""
    return model_of(geom(a, more=more) if a == "plane" else body(geom(a, more=more)), body(geom(b, more=more)))


def pit(n: int, kinds=KINDS[1:], seed: int = 0):
    """Bodies that fall on a plane within walls."""
    random = np.random.default_rng(seed)
    side = int(np.ceil(n ** (1 / 3)))
    parts = [geom("plane", (5, 5, 1))]
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        w = 0.13 * side + 0.15
        parts.append(f'<geom type="plane" size="5 5 1" pos="{w * x} {w * y} 0" zaxis="{-x} {-y} 0"/>')
    for k in range(n):
        grid = np.array([k % side, k // side % side, k // side**2])
        p = 0.25 * (grid - [side / 2, side / 2, 0.0]) + 0.05 * random.random(3) + [0.0, 0.0, 0.15]
        parts.append(body(geom(kinds[k % len(kinds)], 0.05 + 0.03 * random.random(3)), p))
    return model_of(*parts, option='<option timestep=".004"/><size memory="100M"/>')


def matrix(data, k: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = data.geom_xmat[k].reshape(3, 3), data.geom_xpos[k]
    return X


def stepped(model, n: int):
    data = mujoco.MjData(model)
    for _ in range(n):
        mujoco.mj_step(model, data)
    return data


def table() -> list:
    return list(mujoco_layout.host().table)


@pytest.fixture(autouse=True)
def nothing_stays(tmp_path, monkeypatch):
    """MuJoCo writes its warnings into the current folder."""
    monkeypatch.chdir(tmp_path)
    before = table()
    yield
    assert table() == before and not is_hooked(), "a test left its functions in the table"


# --- contacts ---------------------------------------------------------------------------------------------------------


@pytest.mark.many(2)
@pytest.mark.parametrize("a", KINDS)
def test_contacts_are_those_of_collide(a):
    """Distances, normals and places of random pairs, with a margin: bit by bit, but for normals."""
    random = np.random.default_rng(KINDS.index(a))
    n_touching = n_gaps = n_empty = 0
    for b in KINDS[max(1, KINDS.index(a)) :]:
        model = pair_of(a, b, more='margin="0.01"')
        shapes, rows, _ = geom_shapes(model)
        A, B = (shapes[row] for row in rows)
        most = int(mujoco_limits.max_contacts((0, 0))[tuple(sorted(model.geom_type.tolist()))])
        data = mujoco.MjData(model)
        with install(model):
            for _ in range(40):
                direction = random.normal(size=3)
                direction *= random.uniform(0.05, 0.3) / np.linalg.norm(direction)
                data.qpos[-7:-4] = direction if a != "plane" else (0.0, 0.0, abs(direction).sum() / 2)
                data.qpos[-4:] = random.normal(size=4)
                mujoco.mj_forward(model, data)
                margin = data.contact[0].includemargin if data.ncon else margin_of_two()
                X_WA, X_WB = matrix(data, 0), matrix(data, 1)
                expected = collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most)
                said = f"{a} {b} qpos = {data.qpos.tolist()}"
                assert data.ncon == len(expected.rows), said
                got = sorted((c.dist, *c.pos, *c.frame[:3]) for c in data.contact)
                wanted = sorted(
                    (row["distance"], *(0.5 * (row["point_a"] + row["point_b"])), *row["normal"])
                    for row in expected.rows
                )
                got, wanted = np.array(got).reshape(-1, 7), np.array(wanted).reshape(-1, 7)
                np.testing.assert_array_equal(got[:, :4], wanted[:, :4], err_msg=said)
                # MuJoCo makes normals of unit length once more.
                np.testing.assert_allclose(got[:, 4:], wanted[:, 4:], rtol=0.0, atol=1e-15, err_msg=said)
                n_touching += any(c.dist < 0.0 for c in data.contact)
                n_gaps += any(c.dist > 0.0 for c in data.contact)
                n_empty += data.ncon == 0
    assert n_touching >= 10 and n_gaps >= 2 and n_empty >= 5, (n_touching, n_gaps, n_empty)


@functools.cache
def margin_of_two() -> float:
    """The margin of a pair: versions add those of the geoms, or take the larger. Two balls, 15 mm apart, tell."""
    ball = geom("sphere", more='margin="0.01"')
    two = model_of(body(ball), body(ball, (0.175, 0, 0)))
    data = mujoco.MjData(two)
    mujoco.mj_forward(two, data)
    return 0.02 if data.ncon else 0.01


@pytest.mark.parametrize("a", KINDS)
def test_bodies_that_creep_up(a):
    """Pairs that come nearer step by step, through the margin, turning a little: directions that parted them before are
    tried first, and leave nothing out."""
    random = np.random.default_rng(10 + KINDS.index(a))
    margin, n_apart, n_met = 0.01, 0, 0
    for b in KINDS[max(1, KINDS.index(a)) :]:
        model = pair_of(a, b)
        model.geom_margin[1] = margin
        shapes, rows, _ = geom_shapes(model)
        A, B = (shapes[row] for row in rows)
        data = mujoco.MjData(model)
        q, direction = random.normal(size=4), random.normal(size=3)
        direction = np.array([0.0, 0.0, 1.0]) if a == "plane" else direction / np.linalg.norm(direction)
        with install(model):
            for length in np.geomspace(0.5, 0.05, 60):
                data.qpos[-7:-4], data.qpos[-4:] = length * direction, q + 1e-3 * random.normal(size=4)
                mujoco.mj_forward(model, data)
                expected = collide.distance(A, B, matrix(data, 0), matrix(data, 1))
                said = f"{a} {b} qpos = {data.qpos.tolist()}"
                if expected.lower > margin:
                    assert data.ncon == 0, said
                    n_apart += 1
                elif expected.upper <= margin:
                    assert data.ncon > 0 and min(c.dist for c in data.contact) <= expected.upper + 1e-12, said
                    n_met += 1
    assert n_apart >= 15 and n_met >= 10, (n_apart, n_met)


def test_directions_and_signs():
    """A box 3 mm deep in a plane: normals from the first geom to the second, distances negative, places halfway."""
    model = model_of(geom("plane"), body(geom("box", (0.1, 0.2, 0.05)), (0.3, 0.0, 0.047)))
    with install(model):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
    assert data.ncon == 4
    for contact in data.contact:
        assert contact.dist == pytest.approx(-0.003, abs=1e-15)
        assert contact.frame[:3].tolist() == [0.0, 0.0, 1.0] and contact.pos[2] == pytest.approx(-0.0015, abs=1e-15)
    corners = {(round(c.pos[0], 12), round(c.pos[1], 12)) for c in data.contact}
    assert corners == {(0.2, -0.2), (0.2, 0.2), (0.4, -0.2), (0.4, 0.2)}


def test_a_tetrahedron_within_itself():
    """A case that MuJoCo has wrong: a tetrahedron at its own place has contacts, as deep as it is."""
    random = np.random.default_rng(5)
    model = model_of(*(body('<geom type="mesh" mesh="tet"/>') for _ in range(2)))
    missed = 0
    for _ in range(30):
        data = mujoco.MjData(model)
        q = random.normal(size=4)
        data.qpos[3:7] = data.qpos[10:14] = q
        data.qpos[:3] = data.qpos[7:10] = random.normal(size=3)
        mujoco.mj_forward(model, data)
        missed += data.ncon == 0
        with install(model):
            mujoco.mj_forward(model, data)
        assert data.ncon > 0 and min(c.dist for c in data.contact) < -0.05, data.qpos.tolist()
    print(f"MuJoCo alone misses {missed} of 30")


def test_geom_distance_asks_the_table():
    model = pair_of("box", "mesh")
    data = mujoco.MjData(model)
    data.qpos[7:10] = 0.5, 0.1, 0.2
    mujoco.mj_forward(model, data)
    shapes, rows, _ = geom_shapes(model)
    wanted = collide.distance(shapes[rows[0]], shapes[rows[1]], matrix(data, 0), matrix(data, 1)).distance
    fromto = np.zeros(6)
    with install(model):
        got = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, fromto)
    assert got == pytest.approx(wanted, abs=1e-12)


# --- steps ------------------------------------------------------------------------------------------------------------


def test_cull_is_bit_identical():
    model = pit(40)
    alone = stepped(model, 250)
    with install(model, "cull"):
        culled = stepped(model, 250)
    assert alone.ncon > 20
    np.testing.assert_array_equal(alone.qpos, culled.qpos)
    np.testing.assert_array_equal(alone.qvel, culled.qvel)


def test_two_boxes_are_bit_identical_under_cull():
    """Level ones and turned ones: versions before 3.6 drop some of their contacts, by which function stands in the
    table.
    """
    random = np.random.default_rng(4)
    model = pair_of("box", "box")
    data = mujoco.MjData(model)
    places = []
    for case in range(400):
        for k in range(2):
            q = np.array([1.0, 0.0, 0.0, 0.0]) if case % 2 else random.normal(size=4)
            data.qpos[7 * k : 7 * k + 7] = *random.uniform(-0.08, 0.08, 3), *q / np.linalg.norm(q)
        places.append(data.qpos.copy())

    def found() -> list:
        out = []
        for data.qpos[:] in places:
            mujoco.mj_fwdPosition(model, data)
            out.append([(c.dist, *c.pos, *c.frame) for c in data.contact])
        return out

    alone = found()
    with install(model, "cull"):
        culled = found()
    assert alone == culled, next(places[k].tolist() for k in range(400) if alone[k] != culled[k])
    assert sum(len(contacts) > 1 for contacts in alone) > 200


def test_modes_exclude_each_other_where_mujoco_looks_at_its_table(monkeypatch):
    """Versions before 3.6; others are told that they are one."""
    monkeypatch.setattr(mujoco_host, "host", lambda: mujoco_layout.host()._replace(drops_of_boxes=True))
    before, model, other = table(), pit(3), pit(4)
    for first, second in (MODES, MODES[::-1]):
        with install(model, first):
            with pytest.raises(collide.UnsupportedQuery, match=f"mode '{second}' while .* in mode '{first}'.*boxes"):
                install(other, second)
            with install(other, first):
                pass
            assert is_hooked()
        assert table() == before
    with install(model, "cull"):
        k = mujoco_layout.N * mujoco_layout.BOX + mujoco_layout.BOX
        assert table()[k] == before[k] and table() != before


def test_a_pit_comes_to_rest():
    """Boxes and hulls with our contacts: nobody sinks through the floor, nothing gains speed."""
    model = pit(20, kinds=("box", "mesh", "capsule"))
    with install(model):
        data = stepped(model, 750)
    assert data.ncon >= 40
    assert np.isfinite(data.qpos).all() and np.abs(data.qvel).max() < 2.0
    assert data.xpos[1:, 2].min() > 0.02
    assert min(contact.dist for contact in data.contact) > -0.01


def test_copies_and_threads():
    """Rollouts step in threads of their own; a batch, where MuJoCo has one, on copies of the model: all have our
    bits."""
    rollout = pytest.importorskip("mujoco.rollout")
    model = pit(12)
    state = mujoco.mjtState.mjSTATE_FULLPHYSICS
    first = np.zeros(mujoco.mj_stateSize(model, state))
    mujoco.mj_getState(model, mujoco.MjData(model), first, state)
    with install(model):
        alone = stepped(model, 60)
        ends, _ = rollout.rollout(
            [model] * 4, [mujoco.MjData(model) for _ in range(2)], np.repeat(first[None], 4, axis=0), nstep=60
        )
        of_copy = stepped(copy.copy(model), 60)
        pooled = mujoco.MjData(model)
        if hasattr(mujoco, "mju_threadpool"):
            mujoco.mju_threadpool(pooled, 2)
        for _ in range(60):
            mujoco.mj_step(model, pooled)
        if hasattr(mujoco, "mju_threadpool"):  # since then there are batches
            batch = pytest.importorskip("mujoco.batch").Batch(model, 3, 2)
            of_batch = batch.bind("qpos")
            for _ in range(60):
                batch.step()
            np.testing.assert_array_equal(of_batch, np.repeat(alone.qpos[None], 3, axis=0))
    plain = stepped(model, 60)
    last = np.zeros_like(first)
    mujoco.mj_getState(model, alone, last, state)
    for k in range(4):
        np.testing.assert_array_equal(ends[k, -1], last)
    np.testing.assert_array_equal(of_copy.qpos, alone.qpos)
    np.testing.assert_array_equal(pooled.qpos, alone.qpos)
    assert not np.array_equal(plain.qpos, alone.qpos), "with MuJoCo's contacts the same: nothing was installed"


def test_many_threads_at_once():
    model = pit(10)
    with install(model):
        alone = stepped(model, 40)
        answers: list = [None] * 6

        def work(k: int) -> None:
            answers[k] = stepped(model, 40).qpos.copy()

        threads = [threading.Thread(target=work, args=(k,)) for k in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    for answer in answers:
        np.testing.assert_array_equal(answer, alone.qpos)


def test_other_models_keep_their_bits():
    """One of the same structure, too, whose mesh is another."""
    ours, other = pit(8), pit(8, seed=1)
    alone = stepped(other, 80).qpos
    with install(ours):
        np.testing.assert_array_equal(stepped(other, 80).qpos, alone)


# --- installing -------------------------------------------------------------------------------------------------------


of_both_modes = pytest.mark.skipif(
    mujoco_layout.host().drops_of_boxes, reason="this version of MuJoCo takes one mode at a time"
)


@of_both_modes
def test_uninstalled_after_exceptions_nested_and_twice():
    before, one, two = table(), pit(3), pit(4)
    with pytest.raises(KeyError), install(one):
        raise KeyError
    assert table() == before
    first = install([one, two])
    second = install(one, "cull")
    assert is_hooked() and table() != before
    first.uninstall()
    assert is_hooked()
    second.uninstall()
    second.uninstall()
    assert table() == before


@of_both_modes
def test_the_latest_counts():
    model = pit(6)
    alone = stepped(model, 60).qpos
    with install(model), install(model, "cull"):
        np.testing.assert_array_equal(stepped(model, 60).qpos, alone)


def test_a_changed_size_is_reported_and_refreshed():
    model = pair_of("sphere", "sphere")
    data = mujoco.MjData(model)
    data.qpos[7:10] = 0.15, 0.0, 0.0
    with install(model) as installed:
        mujoco.mj_forward(model, data)
        assert data.ncon == 1 and data.contact[0].dist == pytest.approx(-0.01, abs=1e-15)
        model.geom_size[1, 0] = 0.06
        with pytest.raises(mujoco.FatalError, match=r"collide: geom 0 or 1 .* refresh\(\)"):
            mujoco.mj_forward(model, data)
        installed.refresh()
        model.geom_rbound[1] = 0.08
        mujoco.mj_forward(model, data)
        assert data.ncon == 0
        model.geom_size[1, 0] = 0.08
        installed.refresh()
        mujoco.mj_forward(model, data)
        assert data.ncon == 1
    with pytest.raises(collide.InvalidArgument, match="uninstalled"):
        installed.refresh()


def test_at_exit_the_table_is_put_back():
    """A process that ends while installed ends well."""
    text = (
        "import mujoco\nfrom collide.adapters.hosts.mujoco import install\n"
        "m = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom type=\"plane\" size=\"1 1 1\"/>"
        "<body pos=\"0 0 .05\"><freejoint/><geom size=\".1\"/></body></worldbody></mujoco>')\n"
        "d = mujoco.MjData(m)\ninstall(m)\nmujoco.mj_step(m, d)\nprint(d.ncon)\n"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "1"), done.stderr


def test_a_diverged_state_is_mujocos():
    """Poses that are no poses go to MuJoCo, which resets the state."""
    model = pair_of("box", "mesh")
    data = mujoco.MjData(model)
    data.qvel[:] = np.nan
    with install(model):
        mujoco.mj_step(model, data)
        data.geom_xpos[:] = np.nan
        mujoco.mj_collision(model, data)
    assert np.isfinite(data.qpos).all()


def test_bad_arguments():
    model = pit(2)
    for bad in (None, 3, [], [model, 3], "model"):
        with pytest.raises(collide.InvalidArgument, match=r"mujoco\.MjModel"):
            install(bad)
    with pytest.raises(collide.InvalidArgument, match="mode must be one of 'contacts', 'cull', got 'fast'"):
        install(model, "fast")
    with pytest.raises(collide.InvalidArgument, match=r"mujoco\.MjModel"):
        world(3)
    assert MODES == ("contacts", "cull")


def test_a_version_laid_out_otherwise_is_refused(monkeypatch):
    monkeypatch.setattr(mujoco_layout, "_bytes_at", lambda address, n: bytes(n))
    with pytest.raises(collide.UnsupportedQuery, match=r"MuJoCo \d+\.\d+\.\d+: .* cannot be hooked"):
        mujoco_layout.host.__wrapped__()


# --- worlds -----------------------------------------------------------------------------------------------------------


def test_world_tests_the_pairs_that_mujoco_tests():
    """Pairs that meet in the World are those that MuJoCo has contacts of, on a chain of bodies, filters and walls."""
    chain = body(
        geom("box") + '<body pos="0 0 .12"><joint axis="1 0 0"/><geom name="mid" type="capsule" size=".06 .08"/>'
        '<body pos=".1 0 .1"><joint axis="0 1 0"/><geom name="tip" size=".09"/></body></body>', (0.0, 0.0, 0.05),
    )
    loose = [
        body(geom("mesh", more=f'contype="{1 + k % 3}" conaffinity="{k % 2}"'), (0.05 * k, 0.05, 0.1)) for k in range(8)
    ]
    model = model_of(geom("plane"), geom("box"), chain, *loose)
    data = mujoco.MjData(model)
    n = 0
    random = np.random.default_rng(0)
    for _ in range(10):
        data.qpos[:] += 0.02 * random.normal(size=model.nq)
        with install(model):
            mujoco.mj_forward(model, data)
        pairs = {tuple(sorted(int(g) for g in contact.geom)) for contact in data.contact if contact.dist < 0.0}
        made = world(model, data)
        names = [model.geom(k).name or f"geom {k}" for k in range(model.ngeom)]
        met = made.collisions()
        assert {tuple(sorted((names.index(a), names.index(b)))) for a, b in met.names} == pairs
        n += len(pairs)
    assert n > 40


def test_a_can_on_the_edges_of_two_boxes_rests():
    """It lies across a gap, on an edge on either side, whose faces are at 30° to the ways out: contacts that were a
    face's in some steps and the edge's in others kept it turning at 2e-3 rad/s. MuJoCo alone has it roll at 0.2 to 6
    rad/s."""
    for roll, yaw in ((90, 0), (90.5, 0), (90, 1)):
        model = mujoco.MjModel.from_xml_string(
            '<mujoco><worldbody><geom type="box" size="0.1 0.3 0.1" pos="-0.14 0 0.1"/>'
            '<geom type="box" size="0.1 0.3 0.1" pos="0.14 0 0.1"/>'
            f'<body pos="0 0.01 0.26" euler="{roll} 0 {yaw}"><freejoint/><geom type="cylinder" size="0.08 0.1"/></body>'
            "</worldbody></mujoco>")
        data, fastest = mujoco.MjData(model), 0.0
        with install(model):
            for step in range(2000):
                mujoco.mj_step(model, data)
                fastest = max(fastest, float(np.abs(data.qvel[3:]).max()) if step >= 1500 else 0.0)
        assert data.ncon == 4 and fastest < 1e-4, (roll, yaw, fastest)
