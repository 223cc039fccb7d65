"""`collide srdf` and `collide sweep` as a person and a script meet them."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from importlib.util import find_spec

import numpy as np
import pytest

from collide.cli import main as cli
from collide.scenes import load
from collide.sweeps.random_configurations import random_configurations

needs_pyarrow = pytest.mark.skipif(
    find_spec("pyarrow") is None, reason="pyarrow is not installed: pip install 'collide-robotics[sweep]'"
)
SRDF = '<robot name="arm">\n{}</robot>\n'
PAIR = '  <disable_collisions link1="{}" link2="{}" reason="{}"/>\n'


@pytest.fixture(scope="module")
def arm():
    return load("workcell").robots["arm"]


def run(capsys, *words) -> tuple[int, str, str]:
    status = cli.main([str(word) for word in words])
    return status, *capsys.readouterr()


# --- srdf -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [80, 120])
def test_srdf_fits_the_terminal(capsys, monkeypatch, tmp_path, width, arm):
    monkeypatch.setenv("COLUMNS", str(width))
    links = [link for link in arm.links if link in arm.geometry]
    file = tmp_path / "theirs.srdf"
    file.write_text(SRDF.format("".join(PAIR.format(links[0], link, "Never") for link in links[1:])))
    status, out, _ = run(capsys, "srdf", "workcell", "--samples", 2000, "--compare", file, "--all")
    assert max(map(len, out.splitlines())) <= width
    assert re.match(r"arm: \d+ of \d+ pairs of links need no test, \d+ do; 2,000 configurations, seed 0", out)
    for title in ("PAIRS OF LINKS", "PAIRS\n", "ONLY IN theirs.srdf", "NOT IN theirs.srdf"):
        assert title in out
    assert "A sample is no proof" in " ".join(out.split())
    wrong = re.search(r"(\d+) only there \((\d+) wrong\)", " ".join(out.split()))
    assert status == 1 and int(wrong[2]) >= 2 and out.count("--state=") >= int(wrong[2])


def test_srdf_is_written_and_right_about_itself(capsys, tmp_path):
    file = tmp_path / "arm.srdf"
    status, out, err = run(capsys, "srdf", "workcell", "--samples", 500, "--out", file, "--quiet")
    assert (status, out, err) == (0, "", "")
    written = [element.get("reason") for element in ET.parse(file).iter("disable_collisions")]
    assert set(written) >= {"Adjacent", "Never"}
    status, out, _ = run(capsys, "srdf", "workcell", "--samples", 500, "--compare", file)
    assert status == 0 and f"{len(written)} pairs in both, 0 only there (0 wrong), 0 only here" in out
    status, _, err = run(capsys, "srdf", "workcell", "--samples", 5, "--out", file)
    assert status == 2 and "exists: --force overwrites" in err
    assert run(capsys, "srdf", "workcell", "--samples", 5, "--out", file, "--force", "--quiet")[0] == 0


def test_srdf_as_json(capsys, arm):
    status, out, _ = run(capsys, "srdf", "workcell", "--samples", 300, "--json", "-", "--seed", 4)
    data = json.loads(out)
    n = sum(link in arm.geometry for link in arm.links)
    assert status == 0 and data["samples"] == 300 and data["seed"] == 4 and len(data["pairs"]) == n * (n - 1) // 2
    for pair in data["pairs"]:
        if pair["reason"] is None:
            assert len(pair["collide_at"]) == arm.dof
        elif pair["reason"] == "Never" and not pair["fixed"]:
            assert pair["hits"] == 0 and pair["least_gap"] > 0 and 0 < pair["share_at_most"] < 0.02


@pytest.mark.parametrize(
    "words, complaint",
    [
        (["nowhere.urdf"], "nowhere.urdf"), (["workcell", "--name", "leg"], "no robot 'leg': --name takes one of arm"),
        (["workcell", "--samples", "0"], "must be 1 or more"), (["workcell", "--always", "0.1"], "share from 0.5 to 1"),
        (["workcell", "--out", "x.xml"], "must end in .srdf"), (["workcell", "--compare", "none.srdf"], "none.srdf"),
        (["workcell", "--rounds", "-1"], "0 or more"),
        (["workcell", "--srdf", "arm.srdf"], "--srdf: workcell is a scene, which names the SRDF"),
        (["workcell", "--seed", "-1"], "seed"),
    ],
)
def test_srdf_says_what_is_wrong(capsys, words, complaint):
    status, out, err = run(capsys, "srdf", *words)
    assert status == 2 and complaint in err and not out and len(err.splitlines()) == 1


# --- sweep ----------------------------------------------------------------------------------------


@needs_pyarrow
@pytest.mark.parametrize("width", [80, 120])
def test_sweep_fits_the_terminal(capsys, monkeypatch, tmp_path, width, arm):
    monkeypatch.setenv("COLUMNS", str(width))
    Q = random_configurations(arm, 0, 40, 0)
    Q[3, 1], Q[5, 0] = np.nan, 99.0
    np.save(tmp_path / "q.npy", Q)
    words = ["sweep", "workcell", "--configurations", tmp_path / "q.npy", "--out", tmp_path / "s", "--workers", 0]
    status, out, _ = run(capsys, *words, "--distances")
    assert status == 0 and max(map(len, out.splitlines())) <= width
    text = " ".join(out.split())
    assert text.startswith("40 rows: ") and "1 without an answer, 1 outside the limits" in text
    assert f"{arm.joint_names[1]} is nan" in text and f"{arm.joint_names[0]} 99 outside" in text
    assert "least distance" in text


@needs_pyarrow
def test_sweep_goes_on_and_tells_scripts(capsys, tmp_path):
    words = ["sweep", "workcell", "--random", 300, "--out", tmp_path / "s", "--chunk", 100, "--workers", 0]
    first = run(capsys, *words, "--json", "-")
    data = json.loads(first[1])
    assert first[0] == 0 and data["rows"] == 300 == data["colliding"] + data["free"]
    assert 0 < data["colliding"] < 300
    (tmp_path / "s" / "chunk-00000001.parquet").unlink()
    assert json.loads(run(capsys, *words, "--json", "-")[1]) == data
    status, _, err = run(capsys, *words[:3], 301, *words[4:])
    assert status == 2 and "the configurations are others" in err and "--restart" in err
    status, _, err = run(capsys, *words, "--state", "yaw=0.5")
    assert status == 0, "the state of the joints that are swept is no part of the question"


@needs_pyarrow
def test_formats_of_configurations_agree(capsys, tmp_path, arm):
    import pyarrow
    from pyarrow import parquet

    Q, names = random_configurations(arm, 0, 50, 9), list(arm.joint_names)
    np.save(tmp_path / "q.npy", Q)
    backwards = range(arm.dof)[::-1]
    lines = [",".join(names[k] for k in backwards), *(",".join(repr(float(q[k])) for k in backwards) for q in Q)]
    (tmp_path / "q.csv").write_text("\n".join(lines) + "\n")
    parquet.write_table(pyarrow.table({names[k]: Q[:, k] for k in backwards}), tmp_path / "q.parquet")
    answers = []
    for suffix in ("npy", "csv", "parquet"):
        status, _, err = run(capsys, "sweep", "workcell", "--configurations", tmp_path / f"q.{suffix}", "--out",
                             tmp_path / suffix, "--workers", 0, "--values", "--quiet")
        assert status == 0, err
        table = parquet.read_table(tmp_path / suffix)
        answers.append((table["collides"].to_pylist(), np.stack([table[name].to_numpy() for name in names], axis=1)))
    assert all(verdicts == answers[0][0] and np.array_equal(values, Q) for verdicts, values in answers)


@needs_pyarrow
def test_scenes_one_by_one(capsys, tmp_path):
    """Each row is what the scene alone says, and `check` of it."""
    from pyarrow import parquet

    scenes = [_slider_scene(tmp_path / f"scene{k}", x) for k, x in enumerate((0.3, 0.9, 2.0))]
    status, _, err = run(capsys, "sweep", *scenes, "--each", "--out", tmp_path / "s", "--workers", 0, "--random", 40,
                           "--values", "--chunk", 7)
    assert status == 0, err
    table = parquet.read_table(tmp_path / "s").to_pydict()
    assert table["row"] == list(range(120)) and table["scene"] == [str(s) for s in scenes for _ in range(40)]
    # A cube of 0.2 m on a rail along x, and a wall from x − 0.1 to x + 0.1: they meet where |slide − x| ≤ 0.2.
    meets = [abs(slide - x) <= 0.2 for slide, x in zip(table["slide"], np.repeat((0.3, 0.9, 2.0), 40))]
    assert table["collides"] == meets and 10 < sum(meets) < 60
    status, _, err = run(capsys, "sweep", *scenes, "--each", "--out", tmp_path / "own", "--workers", 0)
    assert status == 0 and parquet.read_table(tmp_path / "own")["collides"].to_pylist() == [False, False, False]
    scenes[1].write_text(scenes[1].read_text().replace("0.9", "0.8"))
    status, _, err = run(capsys, "sweep", *scenes, "--each", "--out", tmp_path / "own", "--workers", 0)
    assert status == 2 and "the scene or the robot changed" in err


def _slider_scene(folder, x):
    """A scene file beside a URDF of a cube on a rail; a wall stands at x."""
    folder.mkdir()
    (folder / "rail.urdf").write_text(
        '<robot name="rail"><link name="base"/><link name="slider"><collision><geometry><box size=".2 .2 .2"/>'
        '</geometry></collision></link><joint name="slide" type="prismatic"><parent link="base"/><child link="slider"/>'
        '<axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    file = folder / "scene.json"
    wall = {"name": "wall", "shape": {"box": {"size": [0.2, 2, 2]}}, "pose": {"xyz": [x, 0, 0]}, "static": True}
    file.write_text(json.dumps({"collide": 1, "robots": [{"urdf": "rail.urdf"}], "bodies": [wall]}))
    return file


@needs_pyarrow
@pytest.mark.parametrize(
    "content, suffix, complaint",
    [
        ("a,b\n1,2\n", "csv", "lacks columns for yaw"), ("yaw,yaw\n", "csv", "lacks"), ("", "csv", "lacks columns"),
        (b"\x93NUMPY no", "npy", "no array of numbers"), ("PAR1", "parquet", "no table of numbers"),
        ("x", "txt", ".npy, .csv, .parquet"),
    ],
)
def test_files_that_are_no_configurations(capsys, tmp_path, content, suffix, complaint):
    file = tmp_path / f"q.{suffix}"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    status, _, err = run(capsys, "sweep", "workcell", "--configurations", file, "--out", tmp_path / "s")
    assert status == 2 and complaint in err and str(file) in err and len(err.splitlines()) == 1
    assert not (tmp_path / "s").exists()


@needs_pyarrow
def test_rows_of_csv_are_named(capsys, tmp_path, arm):
    header, row = ",".join(arm.joint_names), ",".join("0" for _ in arm.joint_names)
    words = ["sweep", "workcell", "--configurations", tmp_path / "q.csv", "--out", tmp_path / "s", "--workers", 0]
    for text, complaint in (("0,0", "line 3: has 2 values"), (row.replace("0", "zero", 1), "line 3: must be numbers")):
        (tmp_path / "q.csv").write_text(f"{header}\n{row}\n{text}\n")
        status, _, err = run(capsys, *words)
        assert status == 2 and complaint in err
    (tmp_path / "q.csv").write_text(f"{header}\n{row}\n{row.replace('0', '', 1)}\n")
    status, out, _ = run(capsys, *words)
    assert status == 0 and "1 without an answer" in out and f"{arm.joint_names[0]} is nan" in out


@pytest.mark.parametrize(
    "words, complaint",
    [
        ([], "which configurations?"), (["--random", "5", "--configurations", "q.npy"], "give one of them"),
        (["--random", "0"], "must be 1 or more"), (["--random", "5", "--name", "leg"], "leg"),
        (["--random", "5", "--seed", "-3"], "seed"), (["--configurations", "none.npy"], "there is no such file"),
        (["--random", "5", "--state", "yaw=0", "--state", "yaw=1"], "takes one state"),
    ],
)
def test_sweep_says_what_is_wrong(capsys, tmp_path, words, complaint):
    status, out, err = run(capsys, "sweep", "workcell", "--out", tmp_path / "s", *words)
    assert status == 2 and complaint in err and not out


def test_sweep_without_pyarrow_names_the_extra(capsys, monkeypatch, tmp_path):
    import sys

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    status, _, err = run(capsys, "sweep", "workcell", "--random", 5, "--out", tmp_path / "s")
    assert status == 2 and "pip install 'collide-robotics[sweep]'" in err and not (tmp_path / "s").exists()


@needs_pyarrow
def test_sweep_without_dask_names_the_extra(capsys, monkeypatch, tmp_path):
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    status, _, err = run(capsys, "sweep", "workcell", "--random", 5, "--out", tmp_path / "s", "--scheduler", "tcp://x:1")
    assert status == 2 and "pip install 'collide-robotics[sweep]'" in err


@pytest.mark.parametrize("command", ["srdf", "sweep"])
def test_help_teaches(capsys, command):
    status, out, _ = run(capsys, command, "--help")
    assert status == 0 and f"collide {command} " in out.split("examples:")[1] and "exit status" in out
    assert max(map(len, out.split("examples:")[1].splitlines())) <= 80


@needs_pyarrow
def test_files_that_change_while_they_are_asked(capsys, monkeypatch, tmp_path):
    """A scene file is written anew after the third of ten chunks: the run stops; what is there is of the old one."""
    from collide.sweeps import sweep as sweep_module
    from collide.sweeps.sweep_directory import SweepDirectory

    scene = _slider_scene(tmp_path / "scene", 0.5)
    write_chunk = SweepDirectory.write_chunk

    def write_and_change(directory, number, columns, manifest):
        write_chunk(directory, number, columns, manifest)
        if number == 2:
            scene.write_text(scene.read_text().replace("[0.5, 0, 0]", "[9.5, 0, 0]"))

    monkeypatch.setattr(SweepDirectory, "write_chunk", write_and_change)
    monkeypatch.setattr(sweep_module, "_LOOK_EVERY", 0.0)
    words = ["sweep", scene, "--random", 100, "--out", tmp_path / "s", "--chunk", 10, "--workers", 0]
    status, _, err = run(capsys, *words)
    assert status == 2 and "the scene changed while the sweep ran" in err and "--restart" in err
    assert len(list((tmp_path / "s").glob("chunk-*"))) == 3
    status, _, err = run(capsys, *words)
    assert status == 2 and "the scene or the robot changed since this sweep began" in err
    monkeypatch.undo()
    status, out, _ = run(capsys, *words, "--restart")
    assert status == 0 and out.startswith("100 rows: 0 in collision, 100 free")
