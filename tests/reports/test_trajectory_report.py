"""Trajectories and several states: where a slider first meets a post, in reports, checks and JSON."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from slider_scene import MEETS, slider_scene

import collide.scenes
from collide.cli import main as cli
from collide.errors import InvalidArgument, SceneError
from collide.reports import report
from collide.reports import state_reports as states
from collide.reports.trajectory_report import Watch, follow, sample, verdict
from collide.scenes.loaders.state_words import in_states
from collide.scenes.loaders.trajectories import Trajectory, read_trajectory


def moving(*slides, times=None, **others) -> Trajectory:
    return Trajectory(
        "test",
        [{"slide": s, **{name: values[k] for name, values in others.items()}} for k, s in enumerate(slides)],
        times,
    )


# --- sampling -----------------------------------------------------------------------------------


@pytest.mark.parametrize("resolution", [0.1, 0.02, 0.003])
def test_no_joint_moves_more_than_the_resolution_between_two_samples(resolution):
    path = sample(slider_scene(), moving(0, 0.5, 0.5, -0.3, lift=[0, 0.01, 1, 1]), resolution)
    q = path.configurations["rail"]
    steps = abs(np.diff(q, axis=0)).max(axis=1)
    assert steps.max() <= resolution * (1 + 1e-12) and len(q) < 2.3 / resolution + 5
    # every waypoint is a sample, to the bit
    for corner in ([0, 0], [0.5, 0.01], [0.5, 1], [-0.3, 1]):
        assert (q == corner).all(axis=1).any()
    assert path.share[0] == 0 and path.share[-1] == 1 and (np.diff(path.share) > 0).all()
    assert path.share[path.waypoint == 1][0] == pytest.approx(0.5 / (0.5 + 0.99 + 0.8))


def test_one_waypoint_and_standing_still_are_paths_too():
    for slides in ([0.2], [0.2, 0.2, 0.2]):
        found = follow(slider_scene(), moving(*slides))
        assert found["samples"] == len(slides) and found["moving"] == [] and not found["collides"]
        assert "moves no body" in verdict(found)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_a_resolution_is_above_zero(bad):
    with pytest.raises(InvalidArgument, match="resolution"):
        sample(slider_scene(), moving(0, 1), bad)


# --- what is found ------------------------------------------------------------------------------


def test_the_first_collision_is_where_it_is():
    resolution = 0.01
    found = follow(slider_scene(), moving(0, 0.8, times=[1.0, 5.0]), resolution=resolution)
    first, least = found["first_collision"], found["least"]
    assert found["moving"] == ["slider"] and found["duration"] == 4.0
    assert {first["a"], first["b"]} == {"slider", "post"}
    assert MEETS / 0.8 < first["at"]["share"] <= MEETS / 0.8 + resolution / 0.8 * 1.01
    assert first["at"]["time"] == pytest.approx(1 + 4 * first["at"]["share"])
    assert first["state"]["slide"] == pytest.approx(0.8 * first["at"]["share"]) and first["at"]["waypoint"] == 0
    # deepest in the middle of the post, 0.2 m; every sample of the last stretch collides
    assert least["distance"] == pytest.approx(-0.2, abs=resolution)
    (episode,) = found["colliding"]
    assert episode["from"] == first["at"] and episode["samples"] == found["samples"] - first["at"]["sample"]
    assert verdict(found).startswith("first collision at 6")


def test_without_a_collision_the_least_clearance_is_told():
    found = follow(slider_scene(), moving(-0.2, 0.4, 0.1), clearance=0.15)
    assert not found["collides"] and found["colliding"] == []
    least = found["least"]
    assert {least["a"], least["b"]} == {"slider", "post"} and least["distance"] == pytest.approx(0.1)
    assert least["at"]["share"] == pytest.approx(0.6 / 0.9)
    # the crate is 0.1 m from the way: it comes near, never in it; floor, lamp and crate do not move
    assert {frozenset((pair["a"], pair["b"])) for pair in found["near"]} == {
        frozenset(("slider", "post")), frozenset(("slider", "crate")),
    }
    assert verdict(found).startswith("no collision at ") and "least clearance" in verdict(found)


def test_what_does_not_move_is_told_by_the_report_of_the_start():
    scene = slider_scene()
    made = report.make(scene)
    assert [(pair.a, pair.b) for pair in made.colliding] == [("floor", "crate")]
    found = follow(scene, moving(0, 0.2))
    assert not found["collides"]


def test_touching_at_a_sample_is_no_collision():
    found = follow(slider_scene(), moving(0.0, MEETS), resolution=0.25)
    assert not found["collides"] and len(found["touching"]) == 1
    assert abs(found["least"]["distance"]) < 1e-12


def test_every_sample_says_what_a_report_of_its_state_says():
    """The fast way along a path (poses set in one World) against a scene made anew for each sample."""
    scene, path = slider_scene(), moving(0.3, 0.75, lift=[0.0, 0.1])
    found = follow(scene, path, resolution=0.05)
    colliding, least = [], math.inf
    for q in sample(scene, path, 0.05).configurations["rail"]:
        made = report.make(scene.with_state(dict(zip(("slide", "lift"), q))), clearance=5.0)
        hits = [pair for pair in made.colliding if "slider" in (pair.a, pair.b)]
        colliding.append(bool(hits))
        least = min([least, *(pair.distance for pair in (*hits, *made.near) if "slider" in (pair.a, pair.b))])
    assert found["least"]["distance"] == least and any(colliding) and not all(colliding)
    assert found["first_collision"]["at"]["sample"] == colliding.index(True)


@pytest.mark.parametrize("max_kept", [0, 100])
def test_a_look_at_a_sample_has_the_least_distance_however_far(max_kept):
    """Beyond what was asked for at the sample, and within: as `World.minimum` says."""
    scene = slider_scene()
    path = sample(scene, moving(0.0, MEETS + 0.1), 0.1)
    watch = Watch(scene, path, 0.0, 0.0, max_kept)
    samples = list(watch.poses())
    for k, poses in samples:
        watch.see(k, poses)
    hits = 0
    for k, poses in samples:
        look = watch.look_at(k, poses)
        assert look.least == watch.world.minimum().rows["distance"][0], k
        hits += bool(len(look.by_class["colliding"]))
    assert 0 < hits < len(samples) - 2


def test_joint_values_of_an_event_have_no_negative_zero():
    found = follow(slider_scene(), moving(-0.0, 0.25, lift=[-0.0, -0.0]))
    values = found["least"]["state"]
    assert list(values) == ["slide", "lift"] and math.copysign(1.0, values["lift"]) == 1.0


def test_few_pairs_are_asked_once_something_near_is_known(monkeypatch):
    """The limit of each question is the least clearance so far, not the whole scene."""
    asked = []
    real = collide.World.distances
    monkeypatch.setattr(
        collide.World, "distances", lambda self, max_distance: asked.append(max_distance) or real(self, max_distance)
    )
    follow(slider_scene(), moving(0, 0.45), resolution=0.01)
    assert len(asked) < 60 and max(asked[8:]) < 0.5 and asked[-1] <= 0.07 and max(asked) < math.inf


# --- files --------------------------------------------------------------------------------------

ROS = {"joint_names": ["slide", "lift"], "points": [
    {"positions": [0.0, 0.1], "time_from_start": {"secs": 0, "nsecs": 0}},
    {"positions": [0.5, 0.2], "time_from_start": {"sec": 1, "nanosec": 500000000}},
]}
FILES = {
    "a.csv": "time, slide, lift\n# a remark\n0, 0, 0.1\n1.5, 0.5, 0.2\n",
    "b.csv": "slide;lift;t\n0;0.1;0\n0.5;0.2;1.5\n",
    "c.json": json.dumps([{"slide": 0, "lift": 0.1, "time": 0}, {"slide": 0.5, "lift": 0.2, "time": 1.5}]),
    "d.json": json.dumps({"slide": [0, 0.5], "lift": [0.1, 0.2], "time": [0, 1.5]}),
    "e.json": json.dumps(ROS),
    "f.json": json.dumps({"joint_trajectory": ROS}),
    "g.json": json.dumps({"model_id": "rail", "trajectory": [{"joint_trajectory": ROS}]}),
    "h.json": json.dumps({"waypoints": [{"name": ["slide", "lift"], "position": [0, 0.1], "time_from_start": 0},
                                        {"name": ["slide", "lift"], "position": [0.5, 0.2], "time_from_start": 1.5}]}),
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_every_form_are_one_trajectory(tmp_path, name):
    (tmp_path / name).write_text(FILES[name])
    found = read_trajectory(tmp_path / name)
    assert found.waypoints == [{"slide": 0, "lift": 0.1}, {"slide": 0.5, "lift": 0.2}] and found.times == [0, 1.5]


def test_yaml_as_moveit_prints_it(tmp_path):
    pytest.importorskip("yaml", reason="pyyaml is in the robots extra")
    (tmp_path / "plan.yaml").write_text(
        "joint_trajectory:\n  header: {frame_id: world}\n  joint_names: [slide]\n  points:\n"
        "  - positions: [0.0]\n    velocities: []\n    time_from_start: {secs: 0, nsecs: 0}\n"
        "  - positions: [0.5]\n    time_from_start: {secs: 2, nsecs: 0}\n"
    )
    assert read_trajectory(tmp_path / "plan.yaml").times == [0, 2]


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("x.csv", "", "no waypoint"), ("x.csv", "slide\n", "no waypoint"),
        ("x.csv", "slide,slide\n0,1\n", "every column once"),
        ("x.csv", "slide,lift\n0\n", "row 1.*1 values.*2 columns"), ("x.csv", "slide\nfar\n", "row 1 \"slide\".*'far'"),
        ("x.csv", "time,slide\nnan,0\n", "row 1 \"time\".*finite"), ("x.csv", "slide\ninf\n", "finite"),
        ("x.json", json.dumps({"joint_trajectory": ROS, "multi_dof_joint_trajectory": {"points": [{}]}}),
         "several degrees of freedom"),
        ("x.csv", "time,slide\n1,0\n0,1\n", "times must rise"), ("x.json", "[]", "no waypoint"),
        ("x.json", '{"a": 3}', "no trajectory"),
        ("x.json", '{"joint_names": ["a"], "points": [{"positions": [1, 2]}]}',
         r"points\[0\].positions.*each of the 1"),
        ("x.json", '{"a": [1, 2], "b": [1]}', "no trajectory"), ("x.json", '[{"a": "b"}]', r"\[0\].*number"),
        ("x.json", "3", "must be a mapping"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(SceneError, match=words):
        read_trajectory(tmp_path / name)


def test_unknown_joints_are_told_with_their_waypoint():
    with pytest.raises(SceneError, match=r"waypoint 1.*unknown joint 'swing'.*slide, lift"):
        follow(slider_scene(), Trajectory("plan.csv", [{"slide": 0}, {"swing": 1}]))


def test_paths_without_end_are_refused():
    with pytest.raises(InvalidArgument, match="more than 1000000 samples"):
        follow(slider_scene(), moving(0, 1e9))


def test_a_scene_without_a_robot_cannot_follow():
    scene = slider_scene()
    scene.placements.clear()
    with pytest.raises(InvalidArgument, match="no robot"):
        follow(scene, moving(0, 1))


# --- several states -----------------------------------------------------------------------------


def test_states_are_named_files_values_in_order_or_by_name(tmp_path):
    file = tmp_path / "q.json"
    file.write_text('{"slide": 0.25}')
    scene = slider_scene()
    for words, expected in [
        (["home"], [("home", 0.0)]), (["home,hit"], [("home", 0.0), ("hit", 0.6)]),
        (["hit", "home"], [("hit", 0.6), ("home", 0.0)]),
        (["-0.5,0.1"], [("-0.5,0.1", -0.5)]), (["slide=0.7"], [("slide=0.7", 0.7)]),
        (["slide=0.7, lift=1"], [("slide=0.7, lift=1", 0.7)]),
        ([f"home,{file}"], [("home", 0.0), (str(file), 0.25)]),
    ]:
        found = in_states(scene, words)
        assert [(label, one.state["slide"]) for label, one in found] == expected, words


@pytest.mark.parametrize(
    "word, complaint",
    [("0.1", "1 joint value given.*2 joints: slide, lift"),
     ("1,2,3", "3 joint values"), ("slide=far", "joint slide.*'far'"),
     ("swing=1", "unknown joint 'swing'"), ("away", "unknown state 'away'; it has home, hit"),
     ("home,away", "unknown state 'away'"),
     ("slide=nan", "finite")],
)
def test_states_that_are_none_are_refused(word, complaint):
    with pytest.raises(SceneError, match=complaint):
        in_states(slider_scene(), [word])


# --- the command --------------------------------------------------------------------------------


@pytest.fixture
def command(monkeypatch, capsys):
    """``command(words...)`` runs one on the slider's scene; gives status, out and err."""
    monkeypatch.setattr(
        collide.scenes,
        "load",
        lambda *paths, state=None, **options: slider_scene() if state is None else slider_scene().with_state(state),
    )

    def run(*words):
        status = cli.main(list(words))
        return (status, *capsys.readouterr())

    return run


def test_a_trajectory_in_report_and_check(command, tmp_path):
    plan = tmp_path / "plan.csv"
    plan.write_text("time,slide\n0,0.2\n2,0.6\n")
    status, out, err = command(
        "report", "rail.yaml", "--trajectory", str(plan), "--resolution", "0.01", "--ignore", "crate,floor"
    )
    assert (
        status == 0
        and out.startswith("first collision at 77.5 % of the path (1.55 s): ")
        and "not certified in between" in " ".join(out.split())
    )
    status, out, err = command("check", "rail.yaml", "--trajectory", str(plan), "--ignore", "crate,floor")
    assert status == 1 and out.startswith("collision\tpost\tslider\t-0.1") and out.splitlines()[0].endswith(" s)")
    assert "not certified" in err
    plan.write_text("slide\n0.2\n0.4\n")
    status, out, err = command("check", "rail.yaml", "--trajectory", str(plan), "--ignore", "floor,crate")
    assert (status, out) == (0, "")
    status, out, err = command(
        "check", "rail.yaml", "--trajectory", str(plan), "--ignore", "floor,crate", "--state", "home,hit"
    )
    assert status == 2 and "one state" in err


def test_json_of_trajectories_and_states_is_what_the_schema_says(command, tmp_path):
    plan = tmp_path / "plan.csv"
    plan.write_text("slide\n0.2\n0.6\n")
    _, out, _ = command(
        "report", "rail.yaml", "--trajectory", str(plan), "--clearance", "20cm", "--geometry", "--json", "-"
    )
    data = json.loads(out)
    validate(data)
    assert data["trajectory"]["first_collision"]["state"]["slide"] > MEETS and data["trajectory"]["certified"] is False
    _, out, _ = command("report", "rail.yaml", "--state", "home,hit", "--json", "-")
    several = json.loads(out)
    assert several["schema"] == states.SCHEMA and [one["name"] for one in several["states"]] == ["home", "hit"]
    for one in several["states"]:
        validate(one["report"])
    assert [len(one["report"]["colliding"]) for one in several["states"]] == [1, 2] and several["verdict"]["collides"]


def test_states_have_a_line_and_a_page_each(command):
    status, out, _ = command("report", "rail.yaml", "--state", "home", "--state", "-0.5,0", "--state", "slide=0.6")
    assert status == 0 and out.startswith("collisions in 3 of 3 states: home, -0.5,0, slide=0.6\n")
    assert "── STATE -0.5,0 ──" in out
    assert command("report", "rail.yaml", "--state", "-0.5,0")[1].startswith("1 collision, ")
    assert "1 joint value given" in command("report", "rail.yaml", "--state", "-0.5")[2]
    status, out, err = command("check", "rail.yaml", "--state", "home,hit", "--ignore", "floor,crate")
    assert status == 1 and out.startswith("collision\tpost\tslider\t-0.") and out.endswith("\thit\n")
    assert "collide: home: no collision" in err


def validate(data):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is in the dev extra")
    from importlib import resources

    schema = json.loads(resources.files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
