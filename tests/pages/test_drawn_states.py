"""States and samples of a page, against gaps of boxes along the axes worked out by hand."""

from __future__ import annotations

import base64
import json
from types import SimpleNamespace

import numpy as np
import pytest
from slider_scene import slider_scene

from collide.pages import drawn_states, report_page
from collide.pages.page_file import DataBlock
from collide.reports import report
from collide.reports.state_reports import Stated
from collide.reports.trajectory_report import at_start, watched
from collide.scenes.loaders.trajectories import Trajectory

CLEARANCE = 0.15
#: Boxes of the scene that stand still: middle, sides.
STANDING = {
    "floor": ((0, 0, -0.35), (4, 4, 0.1)),
    "post": ((0.7, 0, 0), (0.2, 0.2, 1)),
    "crate": ((0.35, 0.3, -0.201), (0.2, 0.2, 0.2)),
}


def gap(at, sides, other_at, other_sides) -> float:
    """Signed distance of two boxes along the axes."""
    apart = [abs(x - y) - (s + t) / 2 for x, y, s, t in zip(at, other_at, sides, other_sides)]
    return max(apart) if max(apart) <= 0 else sum(max(0.0, x) ** 2 for x in apart) ** 0.5


def gaps(slide: float) -> dict[str, float]:
    """Of the slider to each box."""
    return {name: gap((slide, 0, 0), (0.2,) * 3, *box) for name, box in STANDING.items()}


def verdict_of(distance: float) -> str | None:
    if distance < -1e-12:
        return "colliding"
    return "touching" if distance < 1e-12 else "near" if distance <= CLEARANCE else None


def poses(block: dict) -> np.ndarray:
    """(states, moving, 3, 4)"""
    array = np.frombuffer(base64.b64decode(block["poses"]), "<f4")
    return array.reshape(len(block["labels"]), len(block["moving"]), 3, 4)


def followed(slides, resolution=0.02, keep=True) -> Stated:
    trajectory = Trajectory("path.csv", [{"slide": x} for x in slides], None)
    scene = at_start(slider_scene(), trajectory)
    made = report.make(scene, clearance=CLEARANCE)
    watch = watched(slider_scene(), trajectory, clearance=CLEARANCE, resolution=resolution, keep=keep)
    made.trajectory = watch.to_dict()
    return Stated("", scene, made, watch)


def plain(block: dict) -> dict:
    assert json.loads(json.dumps(block, allow_nan=False)) == json.loads(json.dumps(block)) != {}
    return json.loads(json.dumps(block))


@pytest.mark.parametrize("keep", [True, False])
def test_samples_of_a_trajectory(keep):
    stated = followed([0.0, 0.8], keep=keep)
    block = plain(drawn_states.of_trajectory(stated))
    names = [body.name for body in stated.scene.bodies]
    slider = names.index("slider")
    assert block["moving"] == [slider]
    assert block["samples"] == "41 of 41" and len(block["labels"]) == 41
    assert not any(row["left_out"] for row in block["rows"])
    seen = set()
    for k, row in enumerate(block["rows"]):
        slide = 0.02 * k
        assert poses(block)[k, 0] == pytest.approx(np.hstack([np.eye(3), [[slide], [0], [0]]]), abs=1e-6)
        wanted = gaps(slide)
        assert row["clearance"] == pytest.approx(min(wanted.values()), abs=1e-12)
        rows = {(name, *sorted(names[i] for i in pair[:2])): pair[2] for name in row_classes(row) for pair in row[name]}
        expected = {(verdict_of(d), *sorted((name, "slider"))): d for name, d in wanted.items() if verdict_of(d)}
        assert rows == {key: pytest.approx(d, abs=1e-12) for key, d in expected.items()}, f"slide = {slide}"
        classes = [verdict_of(d) for d in wanted.values()]
        assert row["verdict"] == next((c for c in ("colliding", "touching", "near") if c in classes), "free")
        bodies = {names[body]: verdict for body, verdict in block["body_verdicts"][k]}
        assert bodies["crate"] == bodies["floor"] == "colliding", "a pair that the path does not move"
        assert bodies.get("slider") == (None if row["verdict"] == "free" else row["verdict"])
        seen.add(row["verdict"])
    assert seen >= {"near", "colliding"}
    assert block["shares"][0] == 0 and block["shares"][-1] == 1 and block["times"] is None


def row_classes(row: dict) -> list[str]:
    return [name for name in ("colliding", "shallow", "touching", "near") if name in row]


def test_long_paths_keep_what_matters():
    stated = followed([-0.5, 0.9, -0.5, 0.46, -0.5], resolution=0.002)
    watch, total = stated.watch, len(stated.watch.path.share)
    samples, left_out = drawn_states.samples_of_page(watch, 100)
    assert total > 2000 and len(samples) <= 100 and not left_out and (np.diff(samples) > 0).all()
    slides = watch.path.configurations["rail"][:, 0]
    naive = []
    for slide in slides:
        there = [verdict_of(distance) for distance in gaps(slide).values()]
        naive.append(next((name for name in ("colliding", "touching", "near") if name in there), "free"))
    changes = [k for k in range(1, total) if naive[k] != naive[k - 1]]
    assert len(changes) >= 6 and {0, total - 1, *changes, *(k - 1 for k in changes)} <= set(samples.tolist())
    assert watch.least["sample"] in samples and np.diff(samples).max() <= 2 * total / 60, "the rest lies evenly between"
    block = plain(drawn_states.of_trajectory(stated, 100))
    assert block["samples"] == f"{len(samples)} of {total}" and len(block["rows"]) == len(samples)
    for k, row in zip(samples.tolist(), block["rows"]):
        assert row["verdict"] == naive[k]


def test_more_changes_than_samples():
    verdicts = np.arange(5000) % 2
    watch = SimpleNamespace(
        path=SimpleNamespace(share=np.linspace(0, 1, 5000)), verdicts=verdicts, first={"sample": 7},
        least={"sample": 13},
    )
    samples, left_out = drawn_states.samples_of_page(watch, 100)
    assert len(samples) <= 100 and {0, 7, 13, 4999} <= set(samples.tolist()) and 4999 - 48 <= left_out <= 4999
    assert f"{left_out} changes" in drawn_states._about(len(samples), 5000, left_out)


def test_several_states():
    scene = slider_scene()
    slides = {"home": 0.0, "close": 0.4, "hit": 0.6}
    made = []
    for name, slide in slides.items():
        stated = scene.with_state({"slide": slide})
        made.append(Stated(name, stated, report.make(stated, clearance=CLEARANCE)))
    block = plain(drawn_states.of_states(made))
    names = [body.name for body in scene.bodies]
    assert block["labels"] == list(slides) and block["moving"] == [names.index("slider")] and block["samples"] is None
    assert poses(block)[:, 0, 0, 3] == pytest.approx(list(slides.values()))
    for row, slide, verdicts in zip(block["rows"], slides.values(), block["body_verdicts"]):
        assert row["verdict"] == "colliding", "the crate stands in the floor"
        assert row["clearance"] == pytest.approx(min(*gaps(slide).values(), -0.001), abs=1e-9)
        assert dict(verdicts).get(names.index("slider")) == next(
            (c for c in ("colliding", "near") if c in map(verdict_of, gaps(slide).values())), None
        )


def test_long_lists_are_cut_and_counted(monkeypatch):
    monkeypatch.setattr(drawn_states, "MAX_ROWS", 1)
    stated = followed([0.3, 0.45])
    row = drawn_states.of_trajectory(stated)["rows"][-1]
    assert len(row["near"]) == 1 and row["left_out"] == 1 and row["near"][0][2] == pytest.approx(0.05)


def test_the_page_has_them():
    stated = followed([0.0, 0.6])
    blocks = {block.id: block for block in report_page.report_blocks([stated], {})}
    drawing = blocks["drawing"].data
    assert drawing["states"]["labels"][-1] == "100 %" and isinstance(blocks["contacts"], DataBlock)
    assert drawing["bodies"][drawing["states"]["moving"][0]]["X_WB"][3] == 0.0 == poses(drawing["states"])[0, 0, 0, 3]
