"""Scene files made to hang, to eat memory or to crash: each is refused at once, with the limit and what to do.

What the work is, is counted, not timed: nodes that are built, names that are compared, bytes that are unpacked.
"""

from __future__ import annotations

import base64
import copy
import gzip
import json
import os
import random
import re
import subprocess
import sys
import threading
from collections import Counter

import numpy as np
import pytest

from collide.base.given_files import LARGEST_TEXT
from collide.cli.main import main
from collide.errors import CollideError, InvalidPose, MissingExtra, SceneError, brief, cut, listing
from collide.robots.robot import Robot
from collide.scenes import load
from collide.scenes import mesh_cache as cache
from collide.scenes.description import Scene, SceneBody, free_name
from collide.scenes.loaders import files, resources, triangles
from collide.scenes.loaders.documents import parse_document, read_document
from collide.scenes.loaders.states import read_state
from collide.shapes import Sphere

BALL = {"sphere": {"radius": 0.1}}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "directory", lambda: tmp_path / "cache")


def doubling(levels: int, entry: str, first: str = "[x]") -> str:
    """Anchors a0, a1, ... of which each repeats the last ten times."""
    lines = [f"a0: &a0 {first}"]
    return "\n".join(lines + [f"a{k + 1}: &a{k + 1} {entry.format(', '.join([f'*a{k}'] * 10), k=k)}" for k in range(levels)]) + "\n"


# --- depth ------------------------------------------------------------------------------------------

DEEP = {
    "lists": "[" * 100_000, "flow mappings": "{a: " * 50_000, "json": '{"a": ' * 50_000, "block lists": "- " * 50_000,
    "compounds": "collide: 1\nbodies: [{name: a, shape: " + "{compound: [{shape: " * 20_000 + "{sphere: {radius: 1}}" + "}]}" * 20_000 + "}]",
    "block mappings": "".join(" " * k + "a:\n" for k in range(300)),
    "a tag on each": "!!seq [" * 50_000,
}


@pytest.mark.many(6)
@pytest.mark.parametrize("case", DEEP)
def test_deep_nesting_is_refused(tmp_path, case):
    """In a process of its own: PyYAML's C code ended it by SIGSEGV."""
    pytest.importorskip("yaml")
    file = tmp_path / "deep.yaml"
    file.write_text(DEEP[case])
    ask = [sys.executable, "-m", "collide", "check", str(file)]
    done = subprocess.run(ask, check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and len(done.stderr) < 1000
    assert "deep.yaml: " in done.stderr and "more than 100 deep in one another: nest less" in done.stderr
    file.rename(tmp_path / "deep.json")
    with pytest.raises(SceneError, match=r"deep\.json: (is not JSON|.*more than 100 deep)"):
        load(tmp_path / "deep.json")


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_the_deepest_compound_is_read_and_one_more_is_not(tmp_path, suffix):
    pytest.importorskip("yaml")

    def scene(levels: int):
        shape = BALL
        for _ in range(levels):
            shape = {"compound": [{"shape": shape}]}
        (tmp_path / f"s{suffix}").write_text(json.dumps({"collide": 1, "bodies": [{"name": "a", "shape": shape}]}))
        return load(tmp_path / f"s{suffix}")

    assert len(scene(31).bodies) == 1
    with pytest.raises(SceneError, match="more than 100 deep"):
        scene(32)


# --- aliases, merge keys, includes ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (doubling(9, "[{}]") + "collide: 1\nname: [*a9]\n", "aliases repeat more than 1,000,000 nodes: write the file without them"),
        (doubling(9, "[{}]") + "collide: 1\nbodies: [{name: b, shape: {hull: {points: *a9}}}]\n", "aliases repeat more than 1,000,000"),
        (doubling(9, "{{<<: [{}], y{k}: 1}}", "{x: 1}"), "line 7.*aliases repeat more than 1,000,000"),
        ("a: &a [*a]", "line 1, column 8: the alias \\*a stands inside what it repeats"),
        ("collide: 1\nbodies: [{name: a, shape: &s {compound: [{shape: *s}]}}]", "the alias \\*s stands inside what it repeats"),
        ("&a [&b {c: *a}]", "the alias \\*a stands inside"),
    ],
)
def test_aliases_that_multiply_are_refused_before_anything_is_built(tmp_path, text, message):
    yaml = pytest.importorskip("yaml")
    (tmp_path / "bomb.yaml").write_text(text)
    with pytest.raises(SceneError, match=message), pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml, "load", lambda *_, **__: pytest.fail("it was built"))
        load(tmp_path / "bomb.yaml")


def test_aliases_that_repeat_little_mean_what_they_say(tmp_path):
    pytest.importorskip("yaml")
    text = doubling(5, "[{}]", "[0, 0, 1]") + "b: &b {x: 1}\nc: {<<: *b, y: 2}\nd: &d [*b, 3]\ne: &e 5\nf: [*e, *d]\n"
    data = parse_document(text, tmp_path / "a.yaml")
    assert data["c"] == {"x": 1, "y": 2} and data["f"] == [5, [{"x": 1}, 3]] and len(data["a5"]) == 10
    assert data["a5"][9] is data["a4"]


def test_what_is_counted_is_what_a_walk_meets(tmp_path):
    """Random documents of aliases: the nodes counted are those that a walk through the data meets."""
    pytest.importorskip("yaml")
    rng = random.Random(3)
    refused = 0
    for _ in range(200):
        lines, names = [], []
        for k in range(rng.randrange(1, 8)):
            entries = [f"*{rng.choice(names)}" if names and rng.random() < 0.6 else str(rng.randrange(9)) for _ in range(rng.randrange(5))]
            inner = f"[{', '.join(entries)}]" if rng.random() < 0.5 else "{" + ", ".join(f"k{j}: {e}" for j, e in enumerate(entries)) + "}"
            lines.append(f"n{k}: &n{k} {inner}")
            names.append(f"n{k}")

        def walk(one) -> int:
            if isinstance(one, list):
                return 1 + sum(map(walk, one))
            return 1 + sum(1 + walk(value) for value in one.values()) if isinstance(one, dict) else 1

        text = "\n".join(lines)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("collide.scenes.loaders.documents.MAX_REPEATED", 10**9)
            met = walk(parse_document(text, tmp_path / "a.yaml"))
            written = sum(1 + line.count(",") + ("[" in line or "{" in line) for line in lines)
        assert met >= written // 4
        try:
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("collide.scenes.loaders.documents.MAX_REPEATED", 40)
                parse_document(text, tmp_path / "a.yaml")
            assert met <= 40 + 100
        except SceneError:
            refused += 1
            assert met > 40
    assert 20 < refused < 180, refused


def test_includes_that_multiply_are_refused(tmp_path, monkeypatch):
    read = []
    monkeypatch.setattr("collide.scenes.loaders.scene_yaml.read_text", lambda file: read.append(file) or file.read_text())
    for k in range(8):
        (tmp_path / f"s{k}.json").write_text(json.dumps({"collide": 1, "include": [f"s{k + 1}.json"] * 8}))
    (tmp_path / "s8.json").write_text(json.dumps({"collide": 1}))
    with pytest.raises(SceneError, match=r"with this the scene includes more than 1,000 files, repeats counted: put their bodies in one file"):
        load(tmp_path / "s0.json")
    assert len(read) == 1001
    monkeypatch.setattr("collide.scenes.loaders.scene_yaml.LARGEST_TEXT", 100)
    (tmp_path / "s8.json").write_text(json.dumps({"collide": 1, "about": "x" * 50}))
    (tmp_path / "s7.json").write_text(json.dumps({"collide": 1, "include": ["s8.json"] * 2}))
    with pytest.raises(SceneError, match=r"s7\.json: include\[1\]: with this the scene includes more than 100 characters"):
        load(tmp_path / "s7.json")


# --- files that are none ----------------------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.parametrize("name", ["a.stl", "a.yaml", "a.json", "a.urdf", "a", "a.gltf", "a.stl.gz"])
def test_pipes_and_devices_are_no_files(tmp_path, name):
    """The answer comes though nobody writes into the pipe, and zeros without end are not read."""
    os.mkfifo(tmp_path / name)
    (tmp_path / "zero").mkdir()
    (tmp_path / "zero" / name).symlink_to("/dev/zero")
    said: list[str] = []

    def ask(file):
        try:
            (triangles.read_meshes if name.endswith(".gz") else load)(file)
        except CollideError as error:
            said.append(str(error))

    for place, kind in ((tmp_path / name, "a named pipe"), (tmp_path / "zero" / name, "a device")):
        asking = threading.Thread(target=ask, args=(place,), daemon=True)
        asking.start()
        asking.join(60)
        expected = "unknown format" if name == "a" else f"{name}: is {kind}, not a file: write what it gives to a file first"
        assert not asking.is_alive() and expected in said[-1]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_pipes_in_every_place_where_a_file_is_named(tmp_path):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "r.urdf").write_text('<robot name="r"><link name="a"><collision><geometry><mesh filename="pipe.stl"/></geometry></collision></link></robot>')
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "include": ["pipe.stl"]}))
    for ask in (
        lambda: load(tmp_path / "r.urdf"), lambda: load(tmp_path / "s.json"), lambda: load("workcell", state=tmp_path / "pipe.stl"),
        lambda: Robot.load(tmp_path / "pipe.stl"), lambda: read_state(tmp_path / "pipe.stl"), lambda: Robot.load(tmp_path / "r.urdf", srdf=tmp_path / "pipe.stl"),
    ):
        with pytest.raises(CollideError, match="pipe"):
            ask()


def test_packed_files_stop_at_the_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "LARGEST_MESH", 10 * files._PIECE)
    (tmp_path / "bomb.stl.gz").write_bytes(gzip.compress(bytes(100 * files._PIECE)))
    unpacked = []
    honest = gzip.GzipFile.read
    monkeypatch.setattr(gzip.GzipFile, "read", lambda self, size: unpacked.append(size) or honest(self, size))
    with pytest.raises(SceneError, match=r"unpacks to more than 10 MiB, the most that is read of a mesh: make it coarser, or cut it into parts"):
        triangles.read_meshes(tmp_path / "bomb.stl.gz")
    assert len(unpacked) == 11 and set(unpacked) == {files._PIECE}
    for damage, message in ((slice(0, -9), "is not a gzip file that can be unpacked"), (slice(3, None), "is not a gzip file that can be unpacked")):
        (tmp_path / "a.obj.gz").write_bytes(gzip.compress(b"v 0 0 0\n" * 1000)[damage])
        with pytest.raises(SceneError, match=message):
            triangles.read_meshes(tmp_path / "a.obj.gz")


def test_large_files_are_refused_unread(tmp_path):
    with (tmp_path / "large.stl").open("wb") as file:
        file.truncate(files.LARGEST_MESH + 1)
    with (tmp_path / "large.yaml").open("wb") as file:
        file.truncate(LARGEST_TEXT + 1)
    with pytest.raises(SceneError, match=r"large\.stl: is larger than 512 MiB, the most that is read of a mesh"):
        load(tmp_path / "large.stl")
    with pytest.raises(SceneError, match=r"large\.yaml: is larger than 256 MiB, the most that is read of a description"):
        load(tmp_path / "large.yaml")


# --- words and numbers ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: " + "9" * 5000, "line 1, column 4: '9999.*cannot be read as int"),
        ('{"a": ' + "9" * 5000 + "}", "the integer 9999.* has 5000 digits"),
        ("a: " + "9" * 2**20, "line 1, column 4: '9999.*cannot be read as int"),  # seconds to hours, if digits are tried in every way
        ("a: 2001-99-99", "line 1, column 4: '2001-99-99' cannot be read as timestamp"),
        ("a: !!int x", "line 1, column 4: 'x' cannot be read as int"),
        ("a: !!set [1]", "a tag does not fit what stands there"),
        ("a: *nobody", "undefined alias"),
    ],
)
def test_what_cannot_be_a_number_is_told_with_its_place(tmp_path, text, message):
    pytest.importorskip("yaml")
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(SceneError, match=message):
        read_document(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ({"box": {"size": ["1", 1, 1]}}, "box.size: must be 3 numbers, got the text '1'; numbers stand without quotes"),
        ({"box": {"size": [True, 1, 1]}}, "box.size: must be 3 numbers, got True"),
        ({"hull": {"points": [[0, 0, 0], [1, "2", 0]]}}, "hull.points: must be N × 3 numbers, got the text '2'"),
        ({"box": {"size": [10**400, 1, 1]}}, "the integer 1000.* has 401 digits"),
        ({"sphere": {"radius": 10**350}}, "sphere.radius: must be a finite number, got an integer of 1163 bits"),
        ({"mesh": {"file": "file://[::1/x.stl"}}, r"'file://\[::1/x.stl' is no file:// name: Invalid IPv6 URL"),
    ],
)
def test_numbers_and_names_that_are_none(tmp_path, shape, message):
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "bodies": [{"name": "a", "shape": shape}]}))
    with pytest.raises(SceneError, match=message):
        load(tmp_path / "s.json")


def test_addresses_that_are_none_in_includes_and_robots(tmp_path):
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "include": ["file://[::1/x.json"]}))
    (tmp_path / "r.urdf").write_text('<robot name="r"><link name="a"><collision><geometry><mesh filename="file://[::1/x.stl"/></geometry></collision></link></robot>')
    for name, place in (("s.json", r"include\[0\]"), ("r.urdf", 'link "a"')):
        with pytest.raises(SceneError, match=rf"{name}: {place}: 'file://\[::1/x.* is no file:// name"):
            load(tmp_path / name)
    for name in ("x" * 5000, "a\0b.stl", "/" + "y/" * 3000):
        with pytest.raises(SceneError, match="cannot find") as refusal:
            resources.find(name, tmp_path / "s.json")
        assert len(str(refusal.value)) < 4000


def test_a_scene_without_a_name(tmp_path):
    with pytest.raises(SceneError, match="path is '': give a file, or the name of a shipped scene"):
        load("")
    for name in ("x" * 5000, "x" * 5000 + ".yaml", "a\0b"):
        with pytest.raises(SceneError, match="no such file") as refusal:
            load(name)
        assert len(str(refusal.value)) < 1000


MEGABYTE = "n" * 2**20


@pytest.mark.many(2)
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.urdf", f'<robot name="r"><link name="{MEGABYTE}"><collision><geometry><box size="{"1 " * 2**19}"/></geometry></collision></link></robot>'),
        ("a.urdf", f'<robot name="r"><link name="{MEGABYTE}"/><link name="{MEGABYTE}"/></robot>'),
        ("a.urdf", f'<robot name="r"><link name="a"/><joint name="{MEGABYTE}" type="{MEGABYTE}"><parent link="a"/><child link="{MEGABYTE}"/></joint></robot>'),
        ("a.urdf", f'<robot name="r"><link name="a"><collision><geometry><mesh filename="{MEGABYTE}"/></geometry></collision></link></robot>'),
        ("a.urdf", f'<robot name="r"><link name="a"><collision><geometry><{MEGABYTE}/></geometry></collision></link></robot>'),
        ("a.urdf", '<robot name="r">' + "".join(f'<link name="link_{k}"/>' for k in range(50_000)) + "</robot>"),
        ("a.xml", f"<{MEGABYTE}/>"),
        ("a.json", json.dumps({"collide": 1, MEGABYTE: 1})),
        ("a.json", json.dumps({"collide": 1, "bodies": [{"name": MEGABYTE, "shape": {MEGABYTE: 1}}]})),
        ("a.json", json.dumps({"collide": 1, "bodies": [{"name": MEGABYTE, "shape": {"sphere": {"radius": -1}}}]})),
        ("a.json", json.dumps({"collide": 1, "bodies": [{"name": MEGABYTE, "shape": BALL}] * 2})),
        ("a.json", json.dumps({"collide": 1, "bodies": [{"name": "a", "shape": BALL, "pose": {"quat_wxyz": [0] * 2**18}}]})),
        ("a.json", json.dumps({"collide": 1, "bodies": [{"name": f"b{k}", "shape": BALL} for k in range(3000)], "allow": [[MEGABYTE, "b1"]]})),
        ("a.json", json.dumps({"collide": 1, "include": [MEGABYTE]})),
        ("a.json", json.dumps({"collide": 1, "units": MEGABYTE})),
        ("a.json", json.dumps({"robot_model_name": MEGABYTE})),
        ("a.json", f'{{"{MEGABYTE}": 1, "{MEGABYTE}": 2}}'),
    ],
)
def test_messages_stay_short_whatever_the_names(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(CollideError) as refusal:
        load(tmp_path / name)
    assert len(str(refusal.value)) < 5000 and str(refusal.value).startswith(str(tmp_path / name))


def test_values_are_cut_and_never_written_out_whole():
    class Counting(list):
        asked = 0

        def __iter__(self):
            for entry in super().__iter__():
                Counting.asked += 1
                yield entry

    bomb = Counting([1] * 1000)
    for _ in range(9):
        bomb = [bomb] * 10
    assert len(brief(bomb)) <= 80 and Counting.asked < 10_000
    assert brief("x" * 2**20) == repr("x" * 77) + "..." and brief([1, 2.5, "a"]) == "[1, 2.5, 'a']"
    assert brief(10**5000) == "an integer of 16610 bits" and len(cut("y" * 1000, 50)) <= 50
    assert listing(range(40)).endswith("29 and 10 more") and listing(["a", "b"]) == "a, b"


def test_poses_that_leave_the_range_name_the_link_and_the_file(tmp_path):
    up = '<origin xyz="0 0 9e49"/>'
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="a"/><link name="b"/><link name="far"><collision><geometry><sphere radius="1"/></geometry></collision></link>'
        f'<joint name="j" type="fixed"><parent link="a"/><child link="b"/>{up}</joint>'
        f'<joint name="k" type="fixed"><parent link="b"/><child link="far"/>{up}</joint></robot>'
    )
    with pytest.raises(InvalidPose, match=r'r\.urdf: robot r: link "far" stands at .* within 1e\+50; look at the origin of joint "k"'):
        load(tmp_path / "r.urdf")
    off = [[1, 9e-5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    links = [{"name": "a"}, {"name": "b"}, {"name": "c", "collision": [{"shape": BALL}]}]
    joints = [{"name": n, "type": "fixed", "parent": p, "child": c, "origin": {"matrix": off}} for n, p, c in (("j", "a", "b"), ("k", "b", "c"))]
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "robots": [{"robot": {"name": "r", "links": links, "joints": joints}}]}))
    with pytest.raises(InvalidPose, match=r's\.json: robot r: the pose of "c", on link "c", is not a rotation'):
        load(tmp_path / "s.json")


def test_a_mimic_of_huge_multiplier_is_told(tmp_path):
    ball = "<collision><geometry><sphere radius='1'/></geometry></collision>"
    limits = '<limit lower="-10" upper="10"/>'
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r"><link name="a"/><link name="b">{ball}</link><link name="c">{ball}</link>'
        f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{limits}</joint>'
        f'<joint name="k" type="revolute"><parent link="b"/><child link="c"/>{limits}<mimic joint="j" multiplier="1e308"/></joint></robot>'
    )
    with pytest.raises(InvalidPose, match=r'r\.urdf: robot r: link "c" stands at .*joint "k", which follows j'):
        load(tmp_path / "r.urdf", state={"j": 5.0})
    with pytest.raises(SceneError, match="joint j: the value must be a finite number, got inf"):
        load(tmp_path / "r.urdf", state={"j": float("inf")})


# --- junk in every place ------------------------------------------------------------------------------

URDF = (
    '<robot name="r"><link name="a"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    '<link name="b"><collision><origin xyz="0 0 1" rpy="0 0 1"/><geometry><mesh filename="t.obj" scale="1 1 1"/></geometry></collision></link>'
    '<link name="c"/><joint name="j" type="revolute"><origin xyz="0 0 1" rpy="0 0 1"/><axis xyz="0 0 1"/><parent link="a"/><child link="b"/>'
    '<limit lower="-1" upper="1"/></joint><joint name="k" type="revolute"><parent link="b"/><child link="c"/><limit lower="-1" upper="1"/>'
    '<mimic joint="j" multiplier="2" offset="0.1"/></joint></robot>'
)
SCENE = {
    "collide": 1, "name": "n", "about": "x", "units": "m", "include": ["i.json"],
    "robots": [
        {"urdf": "r.urdf", "name": "left", "prefix": "l_", "pose": {"xyz": [0, 5, 0], "rpy": [0, 0, 1]}, "state": {"j": 0.5},
         "base": "fixed", "meshes": "hull", "srdf": False},
        {"robot": {
            "name": "arm", "links": [{"name": "base", "collision": [{"shape": BALL, "pose": {"quat_wxyz": [1, 0, 0, 0]}}]}, {"name": "hand"}],
            "joints": [{"name": "s", "type": "prismatic", "parent": "base", "child": "hand", "origin": {"xyz": [0, 0, 1]}, "axis": [1, 0, 0],
                        "limits": [0, 2], "mimic": {"joint": "x", "multiplier": 1, "offset": 0}}],
            "allow": [["base", "hand", "why"]], "states": {"out": {"s": 1.0}},
        }, "state": "out"},
    ],
    "bodies": [
        {"name": "a", "shape": {"box": {"size": [1, 1, 1]}}, "static": True, "group": 1, "mask": 3, "pose": {"matrix": np.eye(4).tolist()}},
        {"name": "m", "shape": {"mesh": {"file": "t.obj", "scale": [1, 1, 2], "as": "hull"}}},
        {"name": "c", "shape": {"compound": [{"shape": {"capsule": {"radius": 1, "length": 1}}, "pose": {"rpy_deg": [0, 90, 0]}}]}},
        {"name": "h", "shape": {"hull": {"points": [[0, 0, 0], [1, 0, 0]], "radius": 1}}},
        {"name": "f", "shape": {"heightfield": {"heights": [[0, 1], [1, 0]], "cell": [1, 1], "bottom": -1}}},
        {"name": "p", "shape": {"hpolytope": {"normals": np.vstack([np.eye(3), -np.eye(3)]).tolist(), "offsets": [1] * 6}}},
    ],
    "allow": [["a", "m", "r"]], "states": {"st": {"l_j": 0.1}},
}
PLANNING = {
    "name": "x", "robot_model_name": "r",
    "robot_state": {
        "joint_state": {"name": ["j"], "position": [0.1]},
        "multi_dof_joint_state": {"joint_names": ["v"], "transforms": [{"translation": {"x": 0, "y": 0, "z": 0}, "rotation": {"w": 1}}]},
        "attached_collision_objects": [{"link_name": "b", "touch_links": ["a"], "object": {
            "id": "held", "pose": {"position": [0, 0, 1]}, "primitives": [{"type": 1, "dimensions": [1, 1, 1]}], "primitive_poses": [{"position": [0, 0, 0]}],
        }}],
    },
    "fixed_frame_transforms": [{"header": {"frame_id": "world"}, "child_frame_id": "f", "transform": {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1]}}],
    "allowed_collision_matrix": {"entry_names": ["a", "b"], "entry_values": [[True, False], {"enabled": [False, True]}],
                                 "default_entry_names": ["a"], "default_entry_values": [True]},
    "link_padding": [{"link_name": "a", "padding": 0.1}],
    "world": {"octomap": {"octomap": {"id": "OcTree", "resolution": 0.1, "binary": True, "data": [1, 0]}}, "collision_objects": [{
        "id": "o", "header": {"frame_id": "f"}, "operation": 0, "pose": {"position": {"x": 1, "y": 0, "z": 0}, "orientation": [0, 0, 0, 1]},
        "meshes": [{"vertices": [{"x": 0, "y": 0, "z": 0}, {"x": 1}, {"y": 1}], "triangles": [{"vertex_indices": [0, 1, 2]}]}], "mesh_poses": [{}],
        "planes": [{"coef": [0, 0, 1, 0]}], "plane_poses": [{}], "primitives": [{"type": "sphere", "dimensions": [1]}],
    }]},
}
STATE = {"joint_state": {"name": ["j"], "position": [0.5]}}
JUNK = [
    None, True, 0, -1, 1.5, 1e60, float("nan"), 10**60, "", "x", "1", [], [1], [[]], ["x"], {}, {"x": 1}, [None], [{}], {"a": {"b": [1]}},
    [[1, 2, 3]], "\0", [True],
]


def places(data, above=()):
    """The place of everything in a document, as keys."""
    yield above
    for key in data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ():
        yield from places(data[key], (*above, key))


def put(data, place, value):
    if not place:
        return value
    data = copy.copy(data)
    data[place[0]] = put(data[place[0]], place[1:], value)
    return data


@pytest.fixture
def beside(tmp_path):
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "i.json").write_text('{"collide": 1}')
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["scene", "planning", "state"])
def test_junk_in_every_place_of_a_document(beside, kind):
    """A scene that a World can be made of, or one error of ours; a sample of every place with every kind of junk."""
    document = {"scene": SCENE, "planning": PLANNING, "state": STATE}[kind]

    def ask(data) -> str:
        (beside / "s.json").write_text(json.dumps(data))
        try:
            load(beside / "r.urdf", state=beside / "s.json") if kind == "state" else load(beside / "s.json", robot=beside / "r.urdf").world()
        except CollideError as error:
            assert len(str(error)) < 5000
            return "refused"
        return "taken"

    assert ask(document) == "taken"
    cases = [(place, junk) for place in places(document) for junk in JUNK]
    outcomes = Counter()
    for place, junk in random.Random(kind).sample(cases, min(len(cases), 400)):
        try:
            outcomes[ask(put(document, place, junk))] += 1
        except Exception as error:
            raise AssertionError(f"{place}: {junk!r}") from error
    assert outcomes["refused"] > 80 and outcomes["taken"] > 3, outcomes


def test_junk_in_every_attribute_of_a_urdf(beside):
    junk = ("", "x", "nan", "1e308", "-1e308", "1e400", "0", "-1", "1 2", "1 2 3", "0 0 0", "1e60 0 0", "a", "b", "j", "\u0661", "9" * 5000, "1_0")
    outcomes = Counter()
    for found in re.finditer(r'="([^"]*)"', URDF):
        for value in junk:
            (beside / "r.urdf").write_text(URDF[: found.start(1)] + value + URDF[found.end(1) :])
            try:
                load(beside / "r.urdf", state={"j": 0.5}).world()
                outcomes["taken"] += 1
            except CollideError as error:
                outcomes["refused"] += 1
                assert len(str(error)) < 1000
            except Exception as error:
                raise AssertionError(f"{URDF[found.start(1) - 20 : found.end(1)]}: {value!r}") from error
    assert min(outcomes.values()) > 50, outcomes


# --- as much work as there is to do -----------------------------------------------------------------


class Counted(str):
    """A name that counts how often it is compared."""

    comparisons = 0

    def __eq__(self, other):
        Counted.comparisons += 1
        return str.__eq__(self, other)

    __hash__ = str.__hash__


def test_adding_bodies_compares_no_names():
    def comparisons(n: int) -> int:
        Counted.comparisons, scene = 0, Scene("s")
        for k in range(n):
            scene.add(SceneBody(Counted(f"b{k}"), Sphere(1), None))
        return Counted.comparisons

    assert comparisons(2000) < 200
    scene = Scene("s", bodies=[SceneBody("a", Sphere(1), None, source="here")])
    with pytest.raises(SceneError, match='a body named "a" exists already, from here'):
        scene.add(SceneBody("a", Sphere(1), None))
    scene.bodies.clear()
    scene.add(SceneBody("a", Sphere(1), None))


def test_equal_names_are_numbered_in_one_step_each():
    class Taken(dict):
        looked = 0

        def __contains__(self, name):
            Taken.looked += 1
            return super().__contains__(name)

    taken = Taken({"part_3": 1})
    assert [free_name("part", taken) for _ in range(5)] == ["part", "part_2", "part_4", "part_5", "part_6"]
    Taken.looked = 0
    for _ in range(1000):
        free_name("part", taken)
    assert Taken.looked < 3000


def test_a_mesh_that_many_bodies_name_is_read_once(tmp_path, monkeypatch):
    opened = []
    honest = files.read_bytes
    monkeypatch.setattr(files, "read_bytes", lambda path, *more: opened.append(path) or honest(path, *more))
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    bodies = [{"name": f"b{k}", "shape": {"mesh": {"file": "t.obj", "scale": 2}}} for k in range(50)]
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "bodies": bodies}))
    scene = load(tmp_path / "s.json")
    assert [path.name for path in opened if path.suffix == ".obj"] == ["t.obj"]
    assert all(body.shape is scene.bodies[0].shape for body in scene.bodies)


def urdf_chain(n: int) -> str:
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    links = "".join(f'<link name="l{k}">{ball}</link>' for k in range(n))
    limits = '<limit lower="-1" upper="1"/>'
    joints = "".join(f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>{limits}</joint>' for k in range(n - 1))
    return f'<robot name="r">{links}{joints}</robot>'


def gltf_chain(n: int) -> str:
    """Nodes one below the other, the last with a mesh of one triangle."""
    nodes = [{"translation": [0, 0, 1], **({"children": [k + 1]} if k < n - 1 else {"mesh": 0})} for k in range(n)]
    data = base64.b64encode(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes()).decode()
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": f"data:;base64,{data}"}],
    })


LONG = {
    "bodies.json": lambda n: json.dumps({
        "collide": 1, "bodies": [{"name": f"b{k}", "shape": BALL, "pose": {"xyz": [k, 0, 0]}} for k in range(n)],
        "allow": [[f"b{k}", f"b{k + 1}"] for k in range(n - 1)],
    }),
    "equal objects.obj": lambda n: "".join(f"o part{k}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n" for k in range(n)),
    "chain.urdf": urdf_chain, "chain.gltf": gltf_chain,
    "pieces.stl": lambda n: "".join(f"solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 {k}\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n" for k in range(n)),
}


@pytest.mark.many(2)
@pytest.mark.parametrize("name", LONG)
def test_twice_the_file_is_twice_the_work(tmp_path, name):
    """Calls of functions, Python's and C's, while a file is read."""
    if name.endswith("gltf"):
        pytest.importorskip("trimesh")

    def calls(n: int) -> int:
        (tmp_path / f"{n} {name}").write_text(LONG[name](n))
        count = 0

        def counted(frame, event, argument):
            nonlocal count
            count += event in ("call", "c_call")

        before = sys.getprofile()
        sys.setprofile(counted)
        try:
            scene = load(tmp_path / f"{n} {name}")
        finally:
            sys.setprofile(before)
        assert len(scene.bodies) in (1, n)
        return count

    calls(10)
    n = 400 if name.endswith("gltf") else 100
    few, many = calls(n), calls(2 * n)
    assert few > 1000 and many < 2.2 * few, (few, many)


def test_copies_of_scenes_go_to_files_alone(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text("collide: 1")
    for name in (str(tmp_path / "mine"), "../../mine", "x" * 5000, "a\0b", ""):
        assert main(["scenes", "--copy", name]) == 2
        assert "no shipped scene has the name" in (said := capsys.readouterr().err) and len(said) < 400
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.json")
        assert main(["scenes", "--force", "--copy", "workcell", "pipe.json"]) == 2
        assert "pipe.json is no file" in capsys.readouterr().err
    assert main(["scenes", "--copy", "workcell"]) == 0 and load(tmp_path / "workcell.json").bodies


def test_locality_reads_as_safely_as_scenes(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(files, "LARGEST_MESH", 2 * files._PIECE)
    (tmp_path / "bomb.stl.gz").write_bytes(gzip.compress(bytes(9 * files._PIECE)))
    (tmp_path / "cut.stl").write_bytes(bytes(80) + b"\5\0\0\0" + bytes(120))
    for name, message in (("bomb.stl.gz", "unpacks to more than 2 MiB"), ("cut.stl", "says 5 facets, but the file holds 2.4"), ("gone.ply", "no such file")):
        assert main(["locality", str(tmp_path / name)]) == 2 and message in capsys.readouterr().err


def test_missing_yaml_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    (tmp_path / "a.yaml").write_text("collide: 1")
    with pytest.raises(MissingExtra, match=r"pyyaml is needed to read a\.yaml"):
        load(tmp_path / "a.yaml")


# --- what goes round the limits ---------------------------------------------------------------------


def mjcf(asset: str = "", world: str = "") -> str:
    return f"<mujoco><asset>{asset}</asset><worldbody>{world}<geom size='1'/></worldbody></mujoco>"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (mjcf('<hfield name="h" nrow="2000000000" ncol="2" size="1 1 1 1"/>'), "2000000000 × 2 samples, at most 16,777,216"),
        (mjcf('<hfield name="h" nrow="1e400" ncol="2" size="1 1 1 1"/>'), "samples, at most"),
        (mjcf(world='<replicate count="1000000" offset="1 0 0"><body><geom size="1"/></body></replicate>'), "copies, at most 10,000"),
        (mjcf(world='<replicate count="200"><replicate count="200"><geom size="1"/></replicate></replicate>'), "copies, at most 10,000"),
        (mjcf(world='<body><composite type="particle" count="300 300 300" spacing="1"><geom size=".1"/></composite></body>'), "copies, at most"),
        (mjcf('<mesh name="m" file="pipe.stl"/>'), "pipe.stl: is a named pipe"),
        ('<mujoco><compiler meshdir="sub"/><asset><mesh name="m" file="p.obj"/></asset></mujoco>', "p.obj: is a named pipe"),
        ('<mujoco><include file="part.xml"/></mujoco>', "pipe.stl: is a named pipe"),
        ('<mujoco><include file="pipe.xml"/></mujoco>', "pipe.xml: is a named pipe"),
        (mjcf('<hfield name="h" file="zero.png" size="1 1 1 1"/>'), "zero.png: is a device"),
        ('<mujoco><include file="round.xml"/></mujoco>', "includes more than"),
    ],
)
def test_models_are_looked_at_before_mujoco_reads_them(tmp_path, text, words):
    mujoco = pytest.importorskip("mujoco")
    if not hasattr(os, "mkfifo"):
        pytest.skip("no named pipes here")
    (tmp_path / "sub").mkdir()
    for name in ("pipe.stl", "pipe.xml", "sub/p.obj"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "zero.png").symlink_to("/dev/zero")
    (tmp_path / "part.xml").write_text(mjcf('<mesh name="m" file="pipe.stl"/>'))
    (tmp_path / "round.xml").write_text('<mujoco><include file="round.xml"/></mujoco>')
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(SceneError, match=re.escape(words)), pytest.MonkeyPatch.context() as patch:
        patch.setattr(mujoco.MjModel, "from_xml_path", lambda *_: pytest.fail("MuJoCo read it"))
        load(tmp_path / "a.xml")


def test_models_within_the_limits_are_read(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "part.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    row = '<replicate count="30" offset="3 0 0"><body><freejoint/><geom size="1"/></body></replicate>'
    (tmp_path / "a.xml").write_text(f"<mujoco><include file='part.xml'/><worldbody>{row}</worldbody></mujoco>")
    assert len(load(tmp_path / "a.xml").bodies) == 31


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.parametrize("place", ["pipe", "/dev/zero", ".", "absent"])
def test_options_that_name_files_have_the_same_limits(tmp_path, place, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    words = {"pipe": "is a named pipe", "/dev/zero": "is a device", ".": "is a folder", "absent": "no such file"}[place]
    for command in (["check", "workcell", "--baseline", place], ["compare", "--from-fcl-error", place]):
        assert main(command) == 2
        assert f"{place}: {words}" in capsys.readouterr().err


def test_deep_and_long_files_of_options(tmp_path, capsys):
    (tmp_path / "known.json").write_text("[" * 200_000)
    assert main(["check", "workcell", "--baseline", str(tmp_path / "known.json")]) == 2
    assert "known.json: is not JSON" in capsys.readouterr().err
    (tmp_path / "way.csv").write_text("a,b\n1," + "2" * 131_073 + "\n")
    assert main(["check", "workcell", "--trajectory", str(tmp_path / "way.csv")]) == 2
    said = capsys.readouterr().err
    assert "way.csv: " in said and "bug" not in said and len(said) < 1000
