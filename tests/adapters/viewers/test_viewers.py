"""Worlds, reports and trajectories in viser, rerun and Foxglove: what was sent is read back."""

from __future__ import annotations

import io

import numpy as np
import pytest

import collide
from collide import scenes
from collide.adapters import to_foxglove, to_rerun, to_viser

COLLIDING, NEAR, FREE = (213, 94, 0), (86, 180, 233), (121, 194, 170)
#: An arm of one joint about z: a bar of 1 m from the axis along x, and a post that it meets from 60 degrees on.
ARM = """<robot name="arm"><link name="base"/><link name="bar"><collision><origin xyz="0.5 0 0"/><geometry>
<box size="1 0.1 0.1"/></geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/>
<child link="bar"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def small_world() -> collide.World:
    """Two boxes 10 mm in each other, a ball 5 mm over the first, a cloud far away; names with a slash."""
    world = collide.World()
    world.add(collide.Box((1, 1, 1)), np.eye(4), name="a/box")
    world.add(collide.Box((1, 1, 1)), collide.pose((0.99, 0, 0)), name="box")
    world.add(collide.Sphere(0.1), collide.pose((-0.3, 0, 0.605)), name="ball")
    scan = collide.PointCloud([[0, 0, 0], [0, 0, 0.5]], radius=0.02)
    world.add(scan, collide.pose((9, 0, 0), rpy=(0.3, 0, 0)), name="scan")
    return world


@pytest.fixture
def arm(tmp_path) -> scenes.Scene:
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(
        "collide: 1\nrobots: [{urdf: arm.urdf}]\nbodies:\n"
        "  - {name: post, shape: {box: {size: [0.1, 0.1, 1]}}, pose: {xyz: [0, 0.8, 0]}, static: true}\n"
    )
    return scenes.load(tmp_path / "cell.yaml")


def sent_to_viser(server) -> dict[str, dict]:
    """name → its last message of each kind, joined, of what a browser would be sent."""
    import msgspec
    import zstandard

    packed = server.get_scene_serializer().serialize()
    inner = zstandard.ZstdDecompressor().stream_reader(io.BytesIO(packed[8:])).read()
    size = int.from_bytes(inner[:8], "little")
    nodes: dict[str, dict] = {}
    for _, message in msgspec.msgpack.decode(inner[8 : 8 + size])["messages"]:
        name = message.get("name", "")
        if message["type"] == "RemoveSceneNodeMessage":
            nodes = {node: known for node, known in nodes.items() if node != name and not node.startswith(name + "/")}
        elif name:
            node = nodes.setdefault(name, {"props": {}})
            node["props"].update(message.pop("updates", {}) | message.pop("props", {}))
            node.update(message)
    return nodes


@pytest.fixture
def server():
    viser = pytest.importorskip("viser", reason="extra [viser] is not installed")
    made = viser.ViserServer(port=0, verbose=False)
    yield made
    made.stop()


def test_a_world_in_viser(server):
    to_viser(small_world(), server, clearance=0.01)
    nodes = sent_to_viser(server)
    colours = {name: tuple(nodes[f"/collide/bodies/{name}"]["props"]["color"]) for name in ("a|box", "box", "ball")}
    assert colours == {"a|box": COLLIDING, "box": COLLIDING, "ball": NEAR}
    assert np.allclose(nodes["/collide/bodies/box"]["position"], (0.99, 0, 0))
    texts = {node["props"]["text"] for name, node in nodes.items() if name.endswith("/label")}
    assert any("a/box, box: colliding, 10 mm deep" in text for text in texts), texts
    assert any("ball" in text and "near, 5 mm apart" in text for text in texts), texts


def test_shown_again_replaces(server):
    world = small_world()
    to_viser(world, server, clearance=0.01)
    world.set_pose(world.ids[1], collide.pose((3, 0, 0)))
    to_viser(world, server)
    nodes = sent_to_viser(server)
    assert tuple(nodes["/collide/bodies/box"]["props"]["color"]) == FREE
    assert not [name for name in nodes if name.endswith("/label")]


def test_a_trajectory_in_viser_has_a_slider(server, arm):
    to_viser(arm, server, trajectory=[[0.0], [1.5]])
    (slider,) = [handle for handle in server.gui._gui_input_handle_from_uuid.values() if handle.label == "sample"]
    at_start = sent_to_viser(server)
    slider.value = slider.max
    at_end = sent_to_viser(server)
    assert tuple(at_start["/collide/bodies/bar"]["props"]["color"]) == FREE
    assert tuple(at_end["/collide/bodies/bar"]["props"]["color"]) == COLLIDING
    turn = at_end["/collide/bodies/bar"]["wxyz"]
    assert np.allclose(turn, (np.cos(0.75), 0, 0, np.sin(0.75)), atol=1e-6)


def rows_of_rerun(path) -> dict[str, dict[str, list]]:
    """entity → column → its values, in the order of logging."""
    from rerun.chunk import RrdReader

    found: dict[str, dict[str, list]] = {}
    for chunk in RrdReader(str(path)).stream():
        columns = found.setdefault(chunk.entity_path, {})
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if ":" in name:
                columns.setdefault(name, []).extend(batch.column(name).to_pylist())
    return found


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_world_in_rerun(tmp_path):
    rerun = pytest.importorskip("rerun", reason="extra [rerun] is not installed")
    recording = rerun.RecordingStream("collide tests")
    recording.save(tmp_path / "world.rrd")
    assert to_rerun(small_world(), recording, clearance=0.01) is recording
    recording.flush()
    recording.disconnect()
    rows = rows_of_rerun(tmp_path / "world.rrd")
    box = rows["/collide/bodies/box"]
    assert np.allclose(box["Transform3D:translation"], (0.99, 0, 0))
    (packed,) = np.ravel(box["Mesh3D:albedo_factor"])
    assert tuple(int(packed).to_bytes(4, "big")) == (*COLLIDING, 255)
    assert np.ptp(np.reshape(box["Mesh3D:vertex_positions"], (-1, 3)), axis=0).tolist() == [1.0, 1.0, 1.0]
    pairs = rows["/collide/pairs"]
    (labels,) = pairs["Arrows3D:labels"]
    assert any("a/box, box: colliding, 10 mm deep" in text for text in labels), labels
    assert np.allclose(np.reshape(rows["/collide/bodies/scan"]["Points3D:radii"], -1), 0.02)
    assert "1 collision" in np.ravel(rows["/collide/verdict"]["TextLog:text"])[0]


def test_a_trajectory_in_rerun_has_its_samples(tmp_path, arm):
    rerun = pytest.importorskip("rerun", reason="extra [rerun] is not installed")
    recording = rerun.RecordingStream("collide tests")
    recording.save(tmp_path / "plan.rrd")
    to_rerun(arm, recording, trajectory=[[0.0], [1.5]])
    recording.flush()
    recording.disconnect()
    bar = rows_of_rerun(tmp_path / "plan.rrd")["/collide/bodies/bar"]
    turns = np.reshape([m for m in bar["Transform3D:mat3x3"] if m], (-1, 3, 3)).transpose(0, 2, 1)
    angles = np.arctan2(turns[:, 1, 0], turns[:, 0, 0])
    assert angles[0] == 0.0 and abs(angles[-1] - 1.5) < 1e-6 and (np.diff(angles) > 0.0).all() and len(angles) >= 75
    colours = [int(colour[0]).to_bytes(4, "big")[:3] for colour in bar["Mesh3D:albedo_factor"] if colour]
    assert tuple(colours[0]) == FREE and COLLIDING in map(tuple, colours)


def messages_of(path) -> dict[str, list]:
    """topic → its messages, decoded."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    found: dict[str, list] = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


def test_a_world_in_foxglove(tmp_path):
    foxglove = pytest.importorskip("foxglove", reason="extra [foxglove] is not installed")
    pytest.importorskip("mcap_protobuf", reason="mcap-protobuf-support is not installed")
    context = foxglove.Context()
    with foxglove.open_mcap(tmp_path / "world.mcap", context=context):
        to_foxglove(small_world(), context, clearance=0.01, time=5.0)
    sent = messages_of(tmp_path / "world.mcap")
    ((stamp, frames),) = sent["/collide/tf"]
    assert stamp == 5_000_000_000
    at = {frame.child_frame_id: frame for frame in frames.transforms}
    assert at["box"].parent_frame_id == "world" and at["box"].translation.x == 0.99
    scan = at["scan"].rotation
    assert np.allclose((scan.w, scan.x, scan.y, scan.z), (np.cos(0.15), np.sin(0.15), 0, 0))
    ((_, update),) = sent["/collide/scene"]
    entities = {entity.id: entity for entity in update.entities}
    paint = entities["box"].triangles[0].color
    assert np.allclose((paint.r, paint.g, paint.b), np.array(COLLIDING) / 255.0)
    assert len(entities["scan"].spheres) == 2 and entities["scan"].spheres[0].size.x == 0.04
    texts = [text.text for text in entities["pairs"].texts]
    assert any("a/box, box: colliding, 10 mm deep" in text for text in texts), texts
    arrow = entities["pairs"].arrows[0]
    w, x, y, z = arrow.pose.orientation.w, arrow.pose.orientation.x, arrow.pose.orientation.y, arrow.pose.orientation.z
    along = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    assert np.allclose(np.abs(along), (1, 0, 0), atol=1e-12)


def test_a_trajectory_in_foxglove_takes_its_time(tmp_path, arm):
    foxglove = pytest.importorskip("foxglove", reason="extra [foxglove] is not installed")
    pytest.importorskip("mcap_protobuf", reason="mcap-protobuf-support is not installed")
    (tmp_path / "plan.csv").write_text("time,turn\n2,0\n4,1.5\n")
    context = foxglove.Context()
    with foxglove.open_mcap(tmp_path / "plan.mcap", context=context):
        to_foxglove(arm, context, trajectory=tmp_path / "plan.csv", time=100.0)
    sent = messages_of(tmp_path / "plan.mcap")
    stamps = [stamp for stamp, _ in sent["/collide/tf"]]
    assert stamps[0] == 100 * 10**9 and stamps[-1] == 102 * 10**9 and len(stamps) >= 75
    # Triangles are sent again only where a verdict changes.
    bars = [entity for _, update in sent["/collide/scene"] for entity in update.entities if entity.id == "bar"]
    assert 2 <= len(bars) < 6


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda arm: to_viser("scene.yaml"), "give a collide.World or a scene of collide.scenes.load"),
        (lambda arm: to_rerun(small_world(), trajectory=[[0.0]]), "a World has no robots"),
        (lambda arm: to_foxglove(arm, trajectory=[[0.0, 1.0]]), "must be \\(n, 1\\) for arm: turn"),
        (lambda arm: to_viser(arm, clearance=-1.0), "to_viser: clearance"),
        (lambda arm: to_rerun(small_world()), "call rerun.init"),
    ],
)
def test_what_is_refused(arm, call, message):
    for package in ("viser", "rerun", "foxglove"):
        pytest.importorskip(package, reason=f"extra [{package}] is not installed")
    with pytest.raises(collide.errors.InvalidArgument, match=message):
        call(arm)


@pytest.mark.parametrize("way, package", [(to_viser, "viser"), (to_rerun, "rerun"), (to_foxglove, "foxglove")])
def test_a_missing_extra_is_named(monkeypatch, way, package):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(collide.errors.MissingExtra, match=rf"collide-robotics\[{package}\]"):
        way(small_world())
