"""Findings drawn as a plate: what is written under the panels, and files that are no pictures or no findings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from collide import Box, Ellipsoid, Sphere, pose
from collide.adapters.fuzzing.case_plate import _ridges, answer_line, body_lines, draw_findings, true_line
from collide.adapters.fuzzing.findings import load_finding
from collide.adapters.fuzzing.fuzz_case import pair_case
from collide.cli import main as cli
from collide.shapes.tessellation import tessellate

CASES = Path(__file__).parent / "cases"


def lines_of(stem: str) -> list[str]:
    finding, about = load_finding(CASES / f"{stem}.json")
    return [*body_lines(finding.case), answer_line(finding), true_line(about)]


def test_what_stands_under_a_panel():
    assert lines_of("fcl-hang-sphere-sphere-deep") == [
        "A and B, at one place: Sphere(radius=1)", "answers: nothing (hang)", "true: -2 m, exact"
    ]
    assert lines_of("fcl-wrong-gap-cone-cylinder-apart") == [
        "A: Cylinder(radius=0.1, length=1)", "B: Cone(radius=0.1, length=1) at [0, 0, -2]",
        "answers: no collision, 1.00499 m", "true: 1 m, proven",
    ]
    assert lines_of("fcl-wrong-points-box-mesh-apart")[-2] == (
        "answers: no collision, 0.5 m; nearest points exchanged"
    )


def test_a_pose_is_told_in_degrees_that_are_not_0():
    case = pair_case(Box((1, 1, 1)), Ellipsoid((1, 2, 3)), pose(), pose((1e6 + 0.04, 0, 0), rpy=(0, 0, np.pi / 4)))
    assert " ".join(" ".join(body_lines(case)).split()) == (
        "A: Box(size=[1, 1, 1]) B: Ellipsoid(radii=[1, 2, 3]) at [1000000.04, 0, 0], turned by yaw 45°"
    )


@pytest.mark.parametrize(("shape", "ridges"), [(Box((1, 2, 3)), 12), (Sphere(1), 0)])
def test_edges_inside_of_a_face_are_not_drawn(shape, ridges):
    made = tessellate(shape)
    assert len(_ridges(made.vertices[made.faces])) == ridges


def test_a_plate_is_written(tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    names = ["fcl-wrong-points-box-mesh-apart", "drake-hang-capsule-capsule-deep"]
    files = [str(CASES / f"{name}.json") for name in names]
    place = tmp_path / "plate.svg"
    assert cli.main(["fuzz", "--draw", *files, "--picture", str(place)]) == 0
    assert "2 findings drawn" in capsys.readouterr().out
    text = place.read_text(encoding="utf-8")
    assert text.count("<path") > 20 and "drake 1.51.1: hang" in text
    assert draw_findings(files[:1], tmp_path / "one.png") == 1 and (tmp_path / "one.png").stat().st_size > 5000
    assert cli.main(["fuzz", "--draw", files[0], "--picture", str(tmp_path / "plate.gif3")]) == 2
    (tmp_path / "odd.json").write_text('{"collide": 1, "bodies": []}')
    assert cli.main(["fuzz", "--draw", str(tmp_path / "odd.json"), "--picture", str(place)]) == 2
    assert "a picture must end in" in capsys.readouterr().err
