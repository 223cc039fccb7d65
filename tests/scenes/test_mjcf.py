"""MJCF as robots and scenes, against MuJoCo: where geoms stand, which pairs are tested, what collides."""

from __future__ import annotations

import builtins
import re
from pathlib import Path

import numpy as np
import pytest
from curved_oracle import bracket
from naive import rng_of
from random_mjcf import mujoco_pairs, qpos_of, random_mjcf

import collide
from collide.adapters.hosts.mujoco import world
from collide.errors import MissingExtra, SceneError
from collide.robots.robot import Robot
from collide.scenes import load
from collide.scenes.loaders.mjcf_links import roll_pitch_yaw

mujoco = pytest.importorskip("mujoco", reason="the package mujoco, which reads MJCF, is not installed")
SEEDS = range(24)


@pytest.fixture
def write(tmp_path):
    """what stands in <mujoco> -> a file of it."""

    def make(inside: str, name: str = "m.xml", root: str = '<mujoco model="m">') -> Path:
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{root}{inside}</mujoco>")
        return file

    return make


def geom_of(model, source: str) -> int:
    """Geoms have names in these models, and a source ends in the name."""
    return int(model.geom(source.rsplit(": ", 1)[1]).id)


def owners_of(model, scene) -> dict[int, str]:
    """Geom → body of the scene."""
    robot = next(iter(scene.robots.values()))
    owners = {geom_of(model, element.source): link for link in robot.geometry for element in robot.geometry[link]}
    return owners | {geom_of(model, body.source): body.name for body in scene.bodies if body.owner is None}


def drawn(robot: Robot, rng, n: int) -> np.ndarray:
    lower, upper = np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0)
    is_length = [name.endswith(("/x", "/y", "/z")) for name in robot.joint_names]
    return np.where(is_length, 0.3, 1.0) * rng.uniform(lower, upper, (n, robot.dof))


def values_of(robot: Robot, q) -> dict[str, float]:
    return dict(zip(robot.joint_names, q.tolist()))


# --- random models against MuJoCo -----------------------------------------------------------------


def test_geoms_stand_where_mujoco_has_them(tmp_path):
    """Bodies, too: links of their names. Relative to the largest coordinate."""
    seen = {"free": 0, "ball": 0, "several joints": 0, "anchors": 0, "refs": 0, "followers": 0, "mocap": 0}
    for seed in SEEDS:
        rng = rng_of(f"mjcf kinematics {seed}")
        text = random_mjcf(rng)
        file = tmp_path / f"{seed}.xml"
        file.write_text(text.xml)
        model, scene = mujoco.MjModel.from_xml_path(str(file)), load(file, meshes="hull")
        robot, data = scene.robots["random"], mujoco.MjData(model)
        for q in drawn(robot, rng, 5):
            data.qpos[:] = qpos_of(model, values_of(robot, q), text.followers)
            mujoco.mj_kinematics(model, data)
            X_WLs = dict(zip(robot.links, robot.link_poses(q)[0]))
            moved = {body.name: body for body in scene.with_state(values_of(robot, q)).bodies}
            poses = [(X_WLs[model.body(k).name], data.xpos[k], data.xmat[k]) for k in range(1, model.nbody)]
            for link, elements in robot.geometry.items():
                for element in elements:
                    geom = geom_of(model, element.source)
                    poses.append((X_WLs[link] @ element.X_LG, data.geom_xpos[geom], data.geom_xmat[geom]))
            for body in moved.values():
                if body.owner is None:
                    geom = geom_of(model, body.source)
                    poses.append((body.X_WB, data.geom_xpos[geom], data.geom_xmat[geom]))
            size = max(1.0, float(np.abs(data.geom_xpos).max()))
            for X, p, R in poses:
                assert np.abs(X[:3, 3] - p).max() <= 1e-12 * size, f"seed {seed}: {text.xml}\n{q.tolist()}"
                assert np.abs(X[:3, :3].ravel() - R).max() <= 1e-12, f"seed {seed}: {text.xml}\n{q.tolist()}"
        seen["free"] += int((model.jnt_type == 0).any())
        seen["ball"] += int((model.jnt_type == 1).any())
        seen["several joints"] += int((model.body_jntnum > 1).any())
        seen["anchors"] += int(np.abs(model.jnt_pos).max(initial=0.0) > 0)
        seen["refs"] += int(np.abs(model.qpos0[model.jnt_qposadr[model.jnt_type > 1]]).max(initial=0.0) > 0)
        seen["followers"] += len(text.followers)
        seen["mocap"] += model.nmocap
    assert min(seen.values()) >= 5, seen


def test_tested_pairs_are_those_of_mujoco(tmp_path):
    """Pairs that a scene tests, and pairs of which MuJoCo finds contacts with all geoms in one place: by geoms, so
    that links are neither tested too much nor too little."""
    filtered = excluded = 0
    for seed in SEEDS:
        rng = rng_of(f"mjcf pairs {seed}")
        file = tmp_path / f"{seed}.xml"
        file.write_text(random_mjcf(rng).xml)
        model, scene = mujoco.MjModel.from_xml_path(str(file)), load(file, meshes="hull")
        owners = owners_of(model, scene)
        never = {frozenset(pair[:2]) for pair in scene.allowed}
        static = {body.name for body in scene.bodies if body.static}
        assert {body.name for body in scene.bodies} == set(owners.values())
        theirs = mujoco_pairs(mujoco, model, rng)
        ours = {
            frozenset((a, b)) for a in owners for b in owners
            if owners[a] != owners[b] and frozenset((owners[a], owners[b])) not in never
            and not {owners[a], owners[b]} <= static
        }
        named = {frozenset(pair) for pair in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist())}
        rigid = {pair for pair in named if len(set(model.body_weldid[model.geom_bodyid[list(pair)]])) == 1}
        still = {pair for pair in named if {owners[geom] for geom in pair} <= static}
        assert ours == theirs - rigid - still, f"seed {seed}: {file.read_text()}"
        reasons = [pair[2] for pair in scene.allowed]
        filtered += "MuJoCo: contype and conaffinity" in reasons
        excluded += "MuJoCo: excluded" in reasons
    assert filtered >= 20 and excluded >= 15, (filtered, excluded)


@pytest.mark.parametrize("flag", ["contact", "constraint", None])
def test_contacts_that_a_model_turns_off_are_off(tmp_path, flag):
    """Two balls in a floor and in each other, a named pair among them: no contact in MuJoCo, none here, and a note."""
    off = f'<option><flag {flag}="disable"/></option>' if flag else ""
    file = tmp_path / "off.xml"
    file.write_text(
        f'<mujoco>{off}<worldbody><geom name="floor" type="plane" size="1 1 1"/>'
        '<body name="one" pos="0 0 .05"><freejoint/><geom name="a" size=".1"/></body>'
        '<body name="two" pos="0 0 .12"><freejoint/><geom name="b" size=".1" contype="0" conaffinity="0"/></body>'
        '</worldbody><contact><pair geom1="a" geom2="b"/></contact></mujoco>'
    )
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = load(file)
    assert data.ncon == (0 if flag else 2)
    assert len(scene.world().collisions()) == data.ncon
    assert [pair[2] for pair in scene.allowed].count("MuJoCo: contacts are off") == (3 if flag else 0)
    notes = [note for note in scene.robots["off"].notes if "turns contacts off" in note]
    assert len(notes) == bool(flag) and all(f'<flag {flag}="disable"/>' in note for note in notes), notes
    assert len(world(model, data).collisions()) == data.ncon


def test_verdicts_are_those_of_mujoco(tmp_path):
    """Whole configurations by `RobotChecker`, pairs by a World. Where MuJoCo differs, which happens within its
    tolerances, a bracket proven in decimals judges: ours are never wrong."""
    hits, configurations, differ = 0, 0, 0
    for seed in SEEDS:
        rng = rng_of(f"mjcf verdicts {seed}")
        text = random_mjcf(rng)
        file = tmp_path / f"{seed}.xml"
        file.write_text(text.xml)
        model, scene = mujoco.MjModel.from_xml_path(str(file)), load(file, meshes="hull")
        robot, data, owners = scene.robots["random"], mujoco.MjData(model), owners_of(model, scene)
        Q = drawn(robot, rng, 6)
        verdicts = collide.RobotChecker.from_scene(scene).collides(Q)
        for q, verdict in zip(Q, verdicts):
            data.qpos[:] = qpos_of(model, values_of(robot, q), text.followers)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_collision(model, data)
            world = scene.with_state(values_of(robot, q)).world()
            static = {name for name in world.names.values() if world.body(name).static}
            ours = {frozenset(pair) for pair in world.collisions().names}
            theirs = {
                frozenset(owners[int(geom)] for geom in contact.geom)
                for contact in data.contact[: data.ncon] if contact.dist <= 0
            }
            theirs = {pair for pair in theirs if len(pair) == 2 and not pair <= static}
            theirs -= {frozenset(pair[:2]) for pair in scene.allowed}  # pairs that the model names, welded together
            for a, b in ours ^ theirs:
                A, B = world.body(a), world.body(b)
                proven = bracket(A.shape, B.shape, A.X_WB, B.X_WB)
                hit = frozenset((a, b)) in ours
                assert proven.upper <= 0 if hit else proven.lower > 0, f"seed {seed}: {text.xml}\n{q.tolist()} {a} {b}"
                differ += 1
            assert bool(verdict) == bool(ours), f"seed {seed}: {text.xml}\n{q.tolist()}"
            hits, configurations = hits + len(ours), configurations + bool(ours)
    assert hits > 400 and 30 < configurations and differ < hits / 20, (hits, configurations, differ)


# --- what files say -------------------------------------------------------------------------------

BALL = '<geom name="{}" size=".1"/>'


def test_defaults_units_limits_and_includes(write):
    """By hand: nested classes, degrees, limits that follow from a range, a file within a file."""
    write(
        '<worldbody><body name="hand" pos="0 0 1"><joint name="grip" type="slide" class="slow"/><geom name="palm" '
        'class="big"/></body></worldbody>', "parts/hand.xml",
    )
    file = write(
        '<compiler angle="degree"/><default><geom type="box" size=".1 .1 .1"/><default class="slow"><joint axis="1 0 0"'
        ' range="-.5 .25"/><default class="fast"><joint range="-90 45" axis="0 1 0" ref="30"/></default></default>'
        '<default class="big"><geom type="capsule" size=".2 .5"/></default></default><worldbody><body name="arm" '
        'childclass="fast"><joint name="turn"/><joint name="spin" axis="0 0 1" limited="false"/><geom name="boxed"/>'
        '</body></worldbody><include file="parts/hand.xml"/>', root='<mujoco model="gripper">',
    )
    robot = Robot.load(file)
    assert robot.name == "gripper" and robot.joint_names == ("turn", "spin", "grip")
    kinds = {joint.name: joint.type for joint in robot.joints}
    assert kinds == {"turn": "revolute", "spin": "continuous", "grip": "prismatic"}
    assert robot.lower == pytest.approx([-np.pi / 2, -np.inf, -0.5]) and robot.upper[[0, 2]] == pytest.approx(
        [np.pi / 4, 0.25]
    )
    assert robot.states["qpos0"] == pytest.approx({"turn": np.pi / 6, "spin": np.pi / 6, "grip": 0})
    assert robot.geometry["arm"][0].shape == collide.Box((0.2, 0.2, 0.2))
    assert robot.geometry["hand"][0].shape == collide.Capsule(0.2, 1.0)
    X_WLs = dict(zip(robot.links, robot.link_poses(robot.configuration(robot.states["qpos0"])[0])[0]))
    assert np.allclose(X_WLs["arm"], np.eye(4), atol=1e-15), "at qpos0 bodies stand as the file has them"


def test_links_of_several_joints_keep_the_names_of_bodies(write):
    robot = Robot.load(write(
        '<worldbody><body name="a"><joint name="x" type="slide"/><joint name="y" pos="0 0 1"/><geom size=".1"/>'
        '<body><joint/><geom size=".1"/></body></body></worldbody>'
    ))
    assert robot.links == ("world", "a/x", "a/y", "a", "body 2")
    assert [(joint.name, joint.parent, joint.child) for joint in robot.joints] == [
        ("x", "world", "a/x"), ("y", "a/x", "a/y"), ("a/fixed", "a/y", "a"), ("body 2/joint", "a", "body 2")
    ]
    assert robot.base_links == ("world",)


@pytest.mark.parametrize(
    ("polynomial", "types", "noted"),
    [
        ("0.1 -2 0 0 0", {"a": "revolute", "b": "continuous"}, None),
        ("0.1 -2 0.5 0 0", {"a": "revolute", "b": "continuous"}, "constraints that are NOT kept.*: joint bent"),
        ("0.1 0 0 0 0", {"a": "fixed", "b": "continuous"}, "joints that a constraint holds are fixed: a at 0.1"),
    ],
)
def test_joints_that_follow(write, polynomial, types, noted):
    file = write(
        '<worldbody><body name="u"><joint name="a" range="-60 60"/><geom size=".1"/></body>'
        '<body name="v"><joint name="b"/><geom size=".1"/></body></worldbody><equality><joint name="bent" joint1="a" '
        f'joint2="b" polycoef="{polynomial}"/><joint joint1="b" joint2="a" active="false"/></equality>'
    )
    robot = Robot.load(file)
    assert {joint.name: joint.type for joint in robot.joints} == types
    follows = noted is None
    assert (robot.joints[0].mimic is not None) == follows
    assert robot.joint_names == (("b",) if follows or types["a"] == "fixed" else ("a", "b"))
    if noted:
        assert [note for note in robot.notes if re.search(noted, note)], robot.notes
    if follows:
        assert robot.joint_value("a", np.array([0.2])) == pytest.approx(0.1 - 0.4)


def test_geoms_of_other_bits_are_links_of_their_own(write):
    """Of one body, one geom meets the ball and the other does not: two links, joined; judged by MuJoCo's contacts."""
    file = write(
        '<worldbody><body name="a"><freejoint name="f"/><geom name="g1" size=".1" contype="1" conaffinity="1"/>'
        '<geom name="g2" size=".1" contype="2" conaffinity="2"/><geom name="g3" size=".1"/><geom name="seen" size="1" '
        'contype="0" conaffinity="0"/></body><body name="b"><freejoint name="h"/>'
        '<geom name="ball" size=".1" contype="1" conaffinity="1"/></body></worldbody>'
    )
    scene = load(file)
    robot = scene.robots["m"]
    assert [element.source.rsplit(": ")[1] for element in robot.geometry["a"]] == ["g1", "g3"]
    assert list(robot.geometry) == ["a", "a/g2", "b"] and robot.rigid_clusters[1] == ("a", "a/g2")
    assert [tuple(pair) for pair in scene.world().collisions().names] == [("a", "b")]
    assert any("contype = conaffinity = 0 are NOT checked, 1 in all" in note for note in scene.notes)


def test_surroundings_are_bodies_of_a_scene(write):
    file = write(
        '<asset><hfield name="hills" nrow="3" ncol="4" size="1 2 .5 .1" elevation="0 1 2 3 1 2 3 4 0 0 0 1"/></asset>'
        '<worldbody><geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/><geom type="hfield" hfield="hills" '
        'pos="0 0 -5"/><body name="stand" pos="0 0 1" euler="0 90 0"><geom name="side" type="plane" size="1 1 1"/>'
        '<geom name="leg" type="box" size=".1 .1 .1"/></body><body name="ball"><freejoint/><geom name="round" size=".1"'
        '/></body></worldbody>'
    )
    robot, scene = Robot.load(file), load(file)
    assert list(robot.geometry) == ["stand", "ball"] and robot.base_links == ("world", "stand")
    assert "what stands in the world is no part of the robot: floor, world/geom 1, side" in robot.notes[-1]
    around = {body.name: body for body in scene.bodies if body.owner is None}
    assert list(around) == ["floor", "world/geom 1", "side"] and all(body.static for body in around.values())
    assert around["side"].shape == collide.Halfspace((0, 0, 1), 0)
    assert np.allclose(around["side"].X_WB[:3, :3] @ (0, 0, 1), (1, 0, 0), atol=1e-15)
    model = mujoco.MjModel.from_xml_path(str(file))
    heights = around["world/geom 1"].shape.heights
    assert heights.shape == (3, 4) and heights.ravel() == pytest.approx(0.5 * model.hfield_data, abs=1e-7)
    # at (0, 0, 0) the ball is 0.1 m in the leg's side plane x ≤ 0, 0.9 above the floor
    rows = scene.world().distances(5.0)
    near = {frozenset(pair): float(distance) for pair, distance in zip(map(tuple, rows.names), rows["distance"])}
    assert near[frozenset(("floor", "ball"))] == pytest.approx(0.9)
    assert near[frozenset(("side", "ball"))] == pytest.approx(-0.1)


def test_meshes_as_they_are_or_as_hulls(write, tmp_path):
    """A step, whose hull fills its corner; the file's numbers, in single precision."""
    outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    vertices = [(x, y, z) for z in (0, 1) for x, y in outline]
    sides = [f for k in range(6) for f in ((k, (k + 1) % 6, k + 6), ((k + 1) % 6, (k + 1) % 6 + 6, k + 6))]
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [*sides, *(f[::-1] for f in caps), *(tuple(v + 6 for v in f) for f in caps)]
    rows = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (tmp_path / "step.obj").write_text("\n".join(rows))
    file = write(
        '<asset><mesh name="step" file="step.obj" scale=".1 .1 -.1"/></asset><worldbody><body name="s" pos="1 0 0">'
        '<freejoint/><geom type="mesh" mesh="step"/></body></worldbody>'
    )
    robots = {meshes: Robot.load(file, meshes=meshes) for meshes in ("mesh", "hull")}
    element = robots["mesh"].geometry["s"][0]
    assert isinstance(element.shape, collide.Mesh) and element.shape.solid and element.approximation is None
    X_WG = robots["mesh"].link_poses(np.zeros(6))[0, 1] @ element.X_LG
    placed = element.shape.vertices @ X_WG[:3, :3].T + X_WG[:3, 3]
    expected = np.array(vertices) * (0.1, 0.1, -0.1) + (1, 0, 0)
    assert np.allclose(sorted(placed.round(6).tolist()), sorted(expected.round(6).tolist()), atol=2e-7)
    hull = robots["hull"].geometry["s"][0]
    assert isinstance(hull.shape, collide.ConvexHull) and hull.approximation == "hull of 12 vertices of a closed mesh"
    X_WB = collide.pose((1.14, 0.14, -0.05))  # 0.04 m from both walls of the corner
    hits = [collide.collide(e.shape, collide.Sphere(0.02), X_WG, X_WB) for e in (element, hull)]
    assert hits == [False, True] and (hull.X_LG == element.X_LG).all()


def test_keyframes_are_states(write):
    """Also of joints that stand elsewhere at 0: geoms stand where MuJoCo has them in the keyframe."""
    file = write(
        '<worldbody><body name="a" pos="1 2 3" quat="1 1 0 0"><freejoint name="f"/><geom name="ga" size=".1"/></body>'
        '<body name="b" pos="0 1 0"><joint name="t" type="ball" pos=".1 0 0"/><geom name="gb" pos=".3 .2 .1" size=".1"'
        '/><body name="c"><joint name="h" ref="20" range="-90 90"/><geom name="gc" pos=".3 .2 .1" size=".1"/></body>'
        '</body></worldbody><keyframe><key name="home" qpos="4 5 6 .1 .2 .3 .4 1 2 3 4 .5"/>'
        '<key qpos="0 0 1 1 0 -1 0 1 0 1 0 -.25"/></keyframe>'
    )
    model, scene = mujoco.MjModel.from_xml_path(str(file)), load(file)
    assert list(scene.states) == ["qpos0", "home", "key 1"]
    data = mujoco.MjData(model)
    for k, state in enumerate(("home", "key 1")):
        mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_kinematics(model, data)
        for body in scene.with_state(state).bodies:
            assert np.abs(body.X_WB[:3, 3] - data.geom_xpos[geom_of(model, body.source)]).max() < 1e-14
    assert scene.state["h"] == pytest.approx(np.radians(20)), "a scene stands where MuJoCo starts"
    assert load(file, state="home").state["h"] == 0.5


def test_angles_wherever_the_pitch_is():
    rng, upright = rng_of("roll pitch yaw"), 0
    for _ in range(300):
        pitch = rng.choice([rng.uniform(-np.pi, np.pi), np.pi / 2, -np.pi / 2 + rng.uniform(-1, 1) * 1e-9])
        R = collide.pose(rpy=(rng.uniform(-4, 4), pitch, rng.uniform(-4, 4)))[:3, :3]
        upright += abs(R[2, 0]) > 1 - 1e-12
        assert np.abs(collide.pose(rpy=roll_pitch_yaw(R))[:3, :3] - R).max() < 4e-16 * 4
    assert upright > 100


def test_an_srdf_beside_it_counts_too(write, tmp_path):
    file = write(
        '<worldbody><body name="a"><freejoint/>' + BALL.format("ga") + '</body><body name="b"><freejoint/>'
        + BALL.format("gb") + '</body><body name="c"><freejoint/>' + BALL.format("gc")
        + '</body></worldbody><contact><exclude body1="a" body2="b"/></contact>'
    )
    (tmp_path / "m.srdf").write_text('<robot name="m"><disable_collisions link1="b" link2="c" reason="User"/></robot>')
    assert Robot.load(file).disabled_pairs == [("a", "b", "MuJoCo: excluded"), ("b", "c", "SRDF: User")]
    assert Robot.load(file, srdf=False).disabled_pairs == [("a", "b", "MuJoCo: excluded")]


def test_scene_files_name_models(write, tmp_path):
    """Twice one robot with what stands around it, turned and moved; a state by the names of the file."""
    write(
        '<worldbody><geom name="wall" type="box" size=".1 1 1" pos="2 0 0" contype="2" conaffinity="2"/><body name="a" '
        'pos="1 0 0"><joint name="j" ref="10"/><geom name="ga" size=".1" pos=".1 0 0"/></body></worldbody><keyframe>'
        '<key name="up" qpos="1"/></keyframe>'
    )
    scene_file = tmp_path / "s.json"
    scene_file.write_text(
        '{"collide": 1, "robots": [{"mjcf": "m.xml", "state": "up"}, {"mjcf": "m.xml", "prefix": "B_", "name": "B", '
        '"pose": {"xyz": [0, 0, 5], "rpy_deg": [0, 0, 90]}, "state": {"j": 0.5}}]}'
    )
    scene = load(scene_file)
    assert [body.name for body in scene.bodies] == ["a", "wall", "B_a", "B_wall"]
    assert scene.state == {"j": 1.0, "B_j": 0.5}
    assert np.allclose(scene.body("B_wall").X_WB[:3, 3], (0, 2, 5)) and scene.body("B_wall").static
    assert scene.allowed == [
        ("wall", "a", "MuJoCo: contype and conaffinity"), ("B_wall", "B_a", "MuJoCo: contype and conaffinity")
    ]


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        ('<worldbody><geom type="cube"/></worldbody>', "m.xml: MuJoCo refuses it: .*invalid keyword: 'cube'"),
        ('<asset><mesh name="x" file="gone.stl"/></asset>', "m.xml: MuJoCo refuses it: .*gone.stl"),
        ('<include file="m.xml"/>', "with this the model includes more than .* files"),
        ("<worldbody>" + "<body>" * 600 + "</body>" * 600 + "</worldbody>", "m.xml"),
        ("<worldbody>", "is not well-formed XML"),
    ],
)
def test_bad_models_are_one_clear_error(write, inside, message):
    for reader in (Robot.load, load):
        with pytest.raises(SceneError, match=message):
            reader(write(inside))


def test_without_mujoco(write, monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "mujoco":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtra, match=r"mujoco is needed to read m\.xml.*\[mujoco\]"):
        Robot.load(write(""))


def test_models_without_geometry_say_so(write):
    robot = Robot.load(write('<worldbody><geom name="floor" type="plane" size="1 1 1"/></worldbody>'))
    assert any("no link has collision geometry" in note for note in robot.notes)
    with pytest.raises(SceneError, match="outermost element of a URDF is <robot>; a scene file names an MJCF model"):
        Robot.load(write("", "m.urdf"))


def test_commands_take_models(write, capsys):
    from collide.cli.main import main

    file = write(
        '<worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="a" pos="0 0 .05"><freejoint/>'
        + BALL.format("g") + "</body></worldbody>"
    )
    assert main(["check", str(file)]) == 1
    out = capsys.readouterr().out
    assert "floor" in out and "a" in out
