"""Some Worlds of the soak, and that it notices wrong ones. `python tests/soak/soak_worlds.py` asks a hundred thousand
questions."""

from __future__ import annotations

import os

import numpy as np
import pytest
import soak_worlds
from soak_pairs import WORLD_KINDS
from soak_worlds import ASKED, Model, Tally, main, soak

import collide
from collide.broadphase import bounding_boxes
from collide.worlds.packed_world import PackedWorld

QUESTIONS = int(os.environ.get("COLLIDE_SOAK_QUESTIONS", "250"))


@pytest.fixture(scope="module")
def soaked() -> Tally:
    return soak(9, QUESTIONS, say=lambda line: None, steps=2)


def test_worlds_of_all_kinds_answer_as_their_pairs_do(soaked):
    assert not soaked.differing, "\n".join(soaked.differing)
    assert sum(soaked.questions.values()) >= QUESTIONS
    assert set(soaked.questions) == set(ASKED)
    for sort, least, most in (("collides", 0.1, 0.5), ("collisions", 0.1, 0.5), ("distances", 0.2, 0.7)):
        assert least < soaked.share(sort) < most, (sort, soaked.share(sort))
    assert soaked.is_mostly_decided()


def test_every_kind_has_a_part_in_every_sort_asked_often_and_every_change(soaked):
    assert {kind for kind, what in soaked.cells if what in ASKED} == set(WORLD_KINDS)
    for sort in ("collides", "collisions", "distances", "minimum"):
        assert sum(soaked.cells[kind, sort] > 0 for kind in WORLD_KINDS) >= len(WORLD_KINDS) - 3, sort
    assert {what for _, what in soaked.cells} >= {*ASKED, "added", "moved", "moved near", "margin set", "woken"}


@pytest.mark.slow
def test_a_world_is_the_same_whenever_it_is_drawn():
    one, other = Tally(), Tally()
    for tally in (one, other):
        Model(4, 1, tally).run(3)
    assert one.text() == other.text() and sum(one.questions.values()) == 3 * soak_worlds.QUESTIONS


# --- wrong Worlds are noticed ----------------------------------------------------------------------


def differing(
    make_world=collide.World, sorts: str = "collides collisions", worlds: int = 3, steps: int = 3
) -> list[str]:
    tally = Tally()
    for number in range(worlds):
        Model(4, number, tally, make_world).run(steps, sorts.split())
    return tally.differing


@pytest.fixture
def wide_margins(monkeypatch):
    """Half of the bodies and pairs with margins as large as bodies."""
    monkeypatch.setattr(Model, "_margin", lambda self: float(self.random.choice([0.0, 1.0])))


@pytest.mark.slow
def test_boxes_without_room_for_margins_are_noticed(monkeypatch, wide_margins):
    monkeypatch.setattr("collide.worlds.packed_world.widened", lambda boxes, room: boxes)
    lost = differing(sorts="collides collisions distances", worlds=12)
    assert len(lost) >= 5, lost


def test_boxes_of_nan_lose_nothing(monkeypatch):
    """The room that boxes were given once: of bodies without end and without margins no number. Trees take such boxes
    for boxes without end, where bodies are added (`_comparable`) and, in a kernel, where they move."""
    of_nan = [0]

    def old(boxes, room):
        room = room[:, None]
        with np.errstate(invalid="ignore"):
            out = room + (np.abs(boxes).max(axis=1, keepdims=True) + room) * 2.0**-50 * (room > 0.0)
        made = np.hstack([boxes[:, :3] - out, boxes[:, 3:] + out])
        of_nan[0] += np.isnan(made).any(axis=1).sum()
        return made

    monkeypatch.setattr("collide.worlds.packed_world.widened", old)
    assert bounding_boxes.widened is not old
    rng, world = np.random.default_rng(7), collide.World()
    ball, floor = collide.Sphere(0.1), collide.Halfspace((0, 0, 1), 0)
    X = [collide.pose((0, 0, z)) for z in (-3.0, -4.0)] + [collide.pose(rng.uniform(-2, 2, 3)) for _ in range(20)]
    shape = [floor] * 2 + [ball] * 20
    floors = [world.add(floor, X[k]) for k in range(2)]
    for k in range(2, 22):
        world.add(ball, X[k], margin=0.05 * (k % 2))
    for _ in range(20):
        X[0] = collide.pose((0, 0, rng.uniform(-2, 1)), rpy=(rng.uniform(-0.3, 0.3), 0, 0))
        world.set_pose(floors[0], X[0])
        expected = {
            (i, j) for i in range(22) for j in range(i + 1, 22) if collide.collide(
                shape[i], shape[j], X[i], X[j], security_margin=0.05 * (i % 2 * (i >= 2) + j % 2 * (j >= 2)))
        }
        rows = world.collisions().rows
        assert {*zip(rows["a"].tolist(), rows["b"].tolist())} == expected
        assert len(expected) >= 2
    assert of_nan[0] >= 15, of_nan


@pytest.mark.slow
def test_a_forgotten_filter_margin_or_limit_is_noticed(monkeypatch):
    monkeypatch.setattr(PackedWorld, "margins_of", lambda self, pairs: np.zeros(len(pairs)))
    assert len(differing(worlds=5, steps=12)) >= 3
    monkeypatch.undo()
    monkeypatch.setattr(PackedWorld, "_take_sleep", lambda self, before, roster: None)
    assert len(differing(sorts="collides collisions distances", worlds=5, steps=12)) >= 3


class Hasty(collide.World):
    """Names the first pair within reach, and rounds what is nearest."""

    def minimum(self, max_distance=np.inf, **options):
        found = self.distances(max_distance, **options)
        found.rows = found.rows[:1]
        return found

    def nearest(self, points_W, **options):
        found = super().nearest(points_W, **options)
        found.rows["distance"] = np.nextafter(found.rows["distance"], np.inf)
        return found


@pytest.mark.slow
def test_a_world_that_ends_its_search_early_is_noticed():
    assert len(differing(Hasty, "minimum")) >= 3
    assert len(differing(Hasty, "nearest")) >= 3


@pytest.mark.slow
def test_one_world_again_and_exit_status(capsys):
    assert soak(4, 1, first=3, steps=1).questions.total() == soak_worlds.QUESTIONS
    assert main(["--seed", "4", "--questions", "1"]) == 1, "so few leave cells empty"
    assert "never asked" in capsys.readouterr().out
