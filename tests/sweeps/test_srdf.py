"""SRDF that is written, read back by readers of others; SRDF that is compared with; and Worlds that take SRDF and
MoveIt's matrices."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from curved_oracle import bracket
from plain_robots import chain, joint, robot_of

import collide
from collide import Box, SceneError, Sphere, World, pose
from collide.cli.main import main
from collide.scenes import allow_pairs
from collide.scenes.loaders.allowed_pairs import read_allowed_pairs
from collide.scenes.loaders.srdf import read_srdf
from collide.sweeps.pair_comparison import compare_pairs
from collide.sweeps.pair_proposal import propose_disabled_pairs
from collide.sweeps.srdf_text import srdf_text

ROBOTS = Path(__file__).resolve().parents[3] / "shared" / "data" / "robots"


def disabled(text: str) -> set[tuple[str, str, str]]:
    """What the standard library's XML reader finds in an SRDF."""
    root = ET.fromstring(text)
    return {(e.get("link1"), e.get("link2"), e.get("reason")) for e in root.iter("disable_collisions")}


def test_written_pairs_are_read_back(tmp_path):
    proposal = propose_disabled_pairs(chain(6, length=0.25, width=0.06), 500, always_share=0.5)
    text = srdf_text(proposal)
    expected = {(pair.a, pair.b, pair.reason) for pair in proposal.disabled}
    assert disabled(text) == expected and len(expected) >= 5
    file = tmp_path / "chain.srdf"
    file.write_text(text, encoding="utf-8")
    read = read_srdf(file, list(proposal.robot.links), [])
    assert {(a, b, reason.removeprefix("SRDF: ")) for a, b, reason in read.pairs} == expected and not read.notes
    assert "500 random configurations" in text and "A sample is no proof" in text


def test_names_that_xml_must_escape():
    hostile = ['a"<&>', "b--c", "d'e", "f-"]
    robot = robot_of(
        hostile, [joint(f"j{k}", "revolute", hostile[k], hostile[k + 1], at=(0, 0, 1)) for k in range(3)],
        {link: (Sphere(0.1), (0, 0, 0)) for link in hostile},
    )
    proposal = propose_disabled_pairs(robot, 50)
    assert disabled(srdf_text(proposal)) == {(pair.a, pair.b, pair.reason) for pair in proposal.disabled}
    assert {name for pair in disabled(srdf_text(proposal)) for name in pair[:2]} == set(hostile)


@pytest.mark.skipif(not ROBOTS.is_dir(), reason="the shared robots are not here")
@pytest.mark.skipif(find_spec("pinocchio") is None, reason="Pinocchio (pin), the other reader, is not installed")
def test_pinocchio_reads_what_is_written(tmp_path):
    import pinocchio

    urdf = ROBOTS / "panda" / "panda.urdf"
    proposal = propose_disabled_pairs(collide.Robot.load(urdf, meshes="hull"), 1000)
    file = tmp_path / "panda.srdf"
    file.write_text(srdf_text(proposal), encoding="utf-8")
    model = pinocchio.buildModelFromUrdf(str(urdf))
    shapes = pinocchio.buildGeomFromUrdf(model, str(urdf), pinocchio.COLLISION, package_dirs=[str(ROBOTS / "panda")])
    shapes.addAllCollisionPairs()
    link_of = [shape.name.rsplit("_", 1)[0] for shape in shapes.geometryObjects]

    def pairs():
        return {frozenset((link_of[pair.first], link_of[pair.second])) for pair in shapes.collisionPairs}

    before = pairs()
    pinocchio.removeCollisionPairs(model, shapes, str(file), False)
    assert pairs() == before - {frozenset((pair.a, pair.b)) for pair in proposal.disabled}
    assert 15 <= len(pairs()) < len(before) - 15


def said(text: str) -> list[str]:
    """What an SRDF says besides collisions, by the standard library: elements in order, blanks between them off."""
    return [
        ET.canonicalize(ET.tostring(e), strip_text=True) for e in ET.fromstring(text) if "collisions" not in e.tag
    ]


HAND = """<robot name="hand">
  <!-- by hand -->
  <group name="all &amp; more"><chain base_link="palm" tip_link="tip"/><joint name="bend"/><link name="tip"/></group>
  <group name="both"><group name="all &amp; more"/></group>
  <disable_default_collisions link="palm"/>
  <group_state name="open" group="both"><joint name="bend" value="0.5"/></group_state>
  <enable_collisions link1="palm" link2="tip"/>
  <end_effector name="tool" parent_link="tip" group="both" parent_group="both"/>
  <virtual_joint name="fix" type="fixed" parent_frame="world" child_link="palm"/>
  <passive_joint name="bend"/><disable_collisions link1="palm" link2="tip" reason="Never"/>
  <link_sphere_approximation link="tip"><sphere center="0 0 0" radius="1"/></link_sphere_approximation>
  <joint_property joint_name="bend" property_name="weight" value="2"/>
  <something of="another" tool="1"/>
</robot>"""


def hand(folder: Path) -> Path:
    """A robot of three links with an SRDF beside it."""
    folder.mkdir(exist_ok=True)
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    links = "".join(f'<link name="{name}">{ball}</link>' for name in ("palm", "mid", "tip"))
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{a}"/><child link="{b}"/><origin xyz="0 0 1"/>'
        '<limit lower="-1" upper="1"/></joint>'
        for name, a, b in (("bend", "palm", "mid"), ("turn", "mid", "tip"))
    )
    (folder / "hand.urdf").write_text(f'<robot name="hand">{links}{joints}</robot>')
    (folder / "hand.srdf").write_text(HAND)
    return folder / "hand.urdf"


def test_groups_and_states_are_kept(tmp_path, capsys):
    """Every element but those about collisions, in place of which there are the proposal's; also onto itself."""
    urdf = hand(tmp_path)
    for out in (tmp_path / "new.srdf", tmp_path / "hand.srdf"):
        assert main(["srdf", str(urdf), "--samples", "50", "--out", str(out), "--force"]) == 0
        text = out.read_text()
        assert said(text) == said(HAND) and len(said(text)) == 9
        assert {e.tag for e in ET.fromstring(text)} >= {"disable_collisions", "group"} and "enable_" not in text
        assert {pair[2] for pair in disabled(text)} == {"Adjacent", "Never"}
        words = " ".join(capsys.readouterr().out.split())
        assert "kept from hand.srdf: 2 group, 1 group_state, 1 end_effector, 1 virtual_joint, 1 passive_joint" in words
        assert collide.Robot.load(urdf, srdf=out).states == {"open": {"bend": 0.5}}
    assert main(["srdf", str(urdf), "--samples", "50", "--out", str(out), "--force", "--pairs-only", "--quiet"]) == 0
    assert said(out.read_text()) == [] and disabled(out.read_text()) == disabled(text)


def test_another_srdf_is_kept_from(tmp_path, capsys):
    urdf = hand(tmp_path)
    other, out = tmp_path / "other.srdf", tmp_path / "out.srdf"
    other.write_text('<robot name="hand"><group name="one"><link name="mid"/></group></robot>')
    assert main(["srdf", str(urdf), "--srdf", str(other), "--samples", "5", "--out", str(out), "--quiet"]) == 0
    assert said(out.read_text()) == said(other.read_text())


def test_kept_names_have_the_prefix_of_the_robot(tmp_path):
    """Links and joints, not groups and states: read back by the robot of the scene itself."""
    hand(tmp_path)
    scene = tmp_path / "s.json"
    scene.write_text('{"collide": 1, "robots": [{"urdf": "hand.urdf", "prefix": "L_"}]}')
    out = tmp_path / "out.srdf"
    assert main(["srdf", str(scene), "--samples", "50", "--out", str(out), "--quiet"]) == 0
    expected = HAND
    for name in ("palm", "tip", "bend", "fix"):
        expected = expected.replace(f'="{name}"', f'="L_{name}"')
    assert said(out.read_text()) == said(expected)
    robot = collide.scenes.load(scene).robots["hand"]
    read = read_srdf(out, list(robot.links), list(robot.joint_names))
    assert not read.notes and read.states == {"open": {"L_bend": 0.5}} and len(read.pairs) == 3


@pytest.mark.skipif(not ROBOTS.is_dir(), reason="the shared robots are not here")
@pytest.mark.skipif(find_spec("pinocchio") is None, reason="Pinocchio (pin), the other reader, is not installed")
@pytest.mark.parametrize("name", ["panda", "fetch"])
def test_pinocchio_reads_what_is_kept(name, tmp_path):
    import pinocchio

    urdf = ROBOTS / name / f"{name}.urdf"
    out = tmp_path / "out.srdf"
    options = ["--meshes", "hull", "--missing-meshes", "skip", "--samples", "20", "--rounds", "0", "--quiet"]
    assert main(["srdf", str(urdf), *options, "--out", str(out)]) == 0
    theirs = (ROBOTS / name / f"{name}.srdf").read_text()
    assert said(out.read_text()) == said(theirs) and len(said(theirs)) >= 6
    states = []
    for file in (urdf.with_suffix(".srdf"), out):
        model = pinocchio.buildModelFromUrdf(str(urdf))
        pinocchio.loadReferenceConfigurations(model, str(file), False)
        states.append({entry.key(): entry.data().tolist() for entry in model.referenceConfigurations})
    assert states[0] == states[1] and (name == "fetch" or len(states[0]) >= 3)


@pytest.mark.many(2)
@pytest.mark.skipif(not ROBOTS.is_dir(), reason="the shared robots are not here")
@pytest.mark.parametrize(
    "name, wrong",
    [
        ("panda", {("panda_link2", "panda_link6")}),
        ("fetch", {("shoulder_pan_link", "forearm_roll_link"), ("head_pan_link", "shoulder_lift_link"),
                   ("shoulder_pan_link", "wrist_flex_link")}),
        ("ur5", set()),
    ],
)
def test_shipped_srdf_are_judged(name, wrong):
    """Pairs that they say never collide, in configurations in which a bracket proven in 80 digits says they do."""
    robot = collide.Robot.load(ROBOTS / name / f"{name}.urdf", meshes="hull", missing_meshes="skip")
    comparison = compare_pairs(propose_disabled_pairs(robot, 3000), robot.semantic_pairs)
    assert {(pair.a, pair.b) for pair in comparison.wrong} == wrong
    for pair in comparison.wrong:
        assert (pair.q >= robot.lower - 1e-12).all() and (pair.q <= robot.upper + 1e-12).all()
        X_WLs = robot.link_poses(pair.q)[0]
        (element_a,), (element_b,) = robot.geometry[pair.a], robot.geometry[pair.b]
        X_WA = X_WLs[robot.links.index(pair.a)] @ element_a.X_LG
        X_WB = X_WLs[robot.links.index(pair.b)] @ element_b.X_LG
        proven = bracket(element_a.shape, element_b.shape, X_WA, X_WB)
        assert proven.upper < 0 and float(proven.lower) - 1e-9 <= -pair.depth <= float(proven.upper) + 1e-9
        assert pair.depth > 1e-3


def test_comparison_by_hand():
    proposal = propose_disabled_pairs(chain(5, length=0.2, width=0.15), 500)
    by_reason = {reason: [p for p in proposal.pairs if p.reason == reason] for reason in ("Adjacent", None)}
    adjacent, tested = by_reason["Adjacent"][0], by_reason[None][0]
    strangers = ("nobody", "l0", "SRDF: Never")
    for reason, wrong in (("Never", True), ("never", True), ("User", False), ("no reason given", False)):
        theirs = [(adjacent.b, adjacent.a, "SRDF: Adjacent"), (tested.b, tested.a, f"SRDF: {reason}"), strangers]
        result = compare_pairs(proposal, [*theirs, *theirs])
        assert result.both == [(adjacent.a, adjacent.b, "Adjacent", "Adjacent")]
        assert [(d.a, d.b, d.reason, d.wrong) for d in result.only_theirs] == [(tested.a, tested.b, reason, wrong)]
        assert len(result.only_ours) == len(proposal.disabled) - 1
        assert result.not_comparable[0] == ("nobody", "l0")
        assert result.only_theirs[0].depth > 0 and len(result.wrong) == wrong


def test_pairs_left_out_that_always_collide_are_named():
    """Neighbours that overlap at their joint, whatever its value; a pair that never meets may be left out."""
    proposal = propose_disabled_pairs(chain(4, length=0.3, width=0.1), 300)
    theirs = [(p.a, p.b, p.reason) for p in proposal.disabled]
    assert not compare_pairs(proposal, theirs).left_out and ("l0", "l1", "Adjacent") in theirs
    for pair in theirs:
        result = compare_pairs(proposal, [other for other in theirs if other != pair])
        assert [(p.a, p.b, p.reason) for p in result.left_out] == [pair] * (pair[2] == "Adjacent")
        assert all(p.share == 1.0 and p.depth > 0 for p in result.left_out) and not result.wrong
        assert len(result.only_ours) == 1


@pytest.mark.skipif(not ROBOTS.is_dir(), reason="the shared robots are not here")
def test_the_srdf_of_the_ur5_does_not_fit_its_spheres(capsys):
    folder = ROBOTS / "ur5"
    spheres = ["srdf", str(folder / "ur5_spherized.urdf"), "--samples", "500", "--rounds", "0"]
    assert main([*spheres, "--compare", str(folder / "ur5.srdf")]) == 1
    said = capsys.readouterr().out
    assert "LEFT OUT OF ur5.srdf" in said and "1 of them always in collision" in " ".join(said.split())
    table = said.split("LEFT OUT OF")[1].split("NOT IN")[0]
    assert "wrist_2_link" in table and "fts_robotside" in table and "robotiq" not in table
    meshes = ["srdf", str(folder / "ur5.urdf"), "--samples", "500", "--rounds", "0", "--meshes", "hull"]
    assert main([*meshes, "--compare", str(folder / "ur5.srdf")]) == 0
    assert "LEFT OUT" not in capsys.readouterr().out


# --- into a World ---------------------------------------------------------------------------------


def world_of(names) -> World:
    world = World()
    for k, name in enumerate(names):
        world.add(Box((1, 1, 1)), pose((0.1 * k, 0, 0)), name=name)
    return world


def pairs_of(world) -> set[tuple[str, str]]:
    return {(world.names[a], world.names[b]) for a, b in world.allowed}


def test_srdf_into_a_world(tmp_path):
    file = tmp_path / "r.srdf"
    file.write_text('<robot name="r"><disable_collisions link1="b" link2="a" reason="Never"/>'
                    '<disable_collisions link1="c" link2="elsewhere" reason="User"/></robot>')
    world = world_of("abc")
    assert allow_pairs(world, file) == [("b", "a", "SRDF: Never")]
    assert pairs_of(world) == {("a", "b")} and len(world.collisions()) == 2
    twin = world_of(["left_a", "left_b", "a", "c"])
    allow_pairs(twin, file, prefix="left_")
    assert pairs_of(twin) == {("left_a", "left_b")}


@pytest.mark.parametrize("whole", [True, False])
def test_matrix_into_a_world(tmp_path, whole):
    """By the definition: an entry decides, else the defaults of both, of which a False wins."""
    matrix = {
        "entry_names": ["a", "b", "c"],
        "entry_values": [[True, True, False], {"enabled": [True, True, False]}, [False, False, True]],
        "default_entry_names": ["d", "c"], "default_entry_values": [True, False],
    }
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({"robot_model_name": "r", "allowed_collision_matrix": matrix} if whole else matrix))
    world = world_of("abcd")
    allow_pairs(world, file)
    assert pairs_of(world) == {("a", "b"), ("a", "d"), ("b", "d")}


@pytest.mark.parametrize(
    "text, words",
    [
        ("<robot><disable_collisions link1='x' link2='y'/></robot>", "names none of the bodies: a, b"),
        ("<robot><disable_collisions link1='a'/></robot>", "needs link1 and link2"),
        ('{"entry_names": ["x"], "entry_values": [[true]]}', "names none of the bodies"),
        ('{"entry_names": ["a", "b"], "entry_values": [[true]]}', "2 rows of 2 values"),
        ('{"joints": {}}', "no allowed_collision_matrix"),
    ],
)
def test_files_that_say_nothing_about_the_world(tmp_path, text, words):
    file = tmp_path / ("f.srdf" if text.startswith("<") else "f.json")
    file.write_text(text)
    with pytest.raises(SceneError, match=words):
        read_allowed_pairs(file, ["a", "b"])


def test_gaps_of_pairs_are_not_those_of_hulls():
    """A link in the hollow of another: hulls overlap, the links do not. Judged by the geometry: 0.1 m to each wall."""
    hollow = collide.Compound([(Box((0.1, 1, 1)), pose((s * 0.4, 0, 0))) for s in (-1, 1)])
    robot = robot_of(
        ["ball", "x", "hollow"],
        [joint("a", "prismatic", "ball", "x", axis=(0, 0, 1)), joint("b", "fixed", "x", "hollow")],
        {"hollow": (hollow, (0, 0, 0)), "ball": (Sphere(0.25), (0, 0, 0)), "x": (Sphere(0.01), (0, 0, 9))},
    )
    pair = propose_disabled_pairs(robot, 50, rounds=8).pair("ball", "hollow")
    assert pair.reason == "Never" and pair.nearest.gap == pytest.approx(0.1, abs=1e-9)
    assert np.isfinite(pair.nearest.q).all()
