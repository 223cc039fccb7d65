"""What a trajectory's report lists: which event of a pair, in which order, where on the path, in plain numbers."""

from __future__ import annotations

import json
import math
import re

import pytest
from slider_scene import MEETS, slider_scene

from collide.reports import classes
from collide.reports.trajectory_report import Watch, _finite, follow, place, sample, verdict, watched
from collide.scenes.loaders.trajectories import Trajectory


def path(*corners, times=None) -> Trajectory:
    """Through (slide, lift) one after the other."""
    return Trajectory("test", [{"slide": slide, "lift": lift} for slide, lift in corners], times)


def partners(pairs: list[dict]) -> list[str]:
    return [({pair["a"], pair["b"]} - {"slider"}).pop() for pair in pairs]


#: The slider meets the post with 0.02 m, and later, lowered, the floor with 0.1 m: its top is 0.2 m below.
POST_THEN_FLOOR = path((0.3, 0.0), (MEETS + 0.02, 0.0), (-0.2, 0.0), (-0.2, -0.3), (-0.2, 0.0))


@pytest.mark.parametrize(("min_depth", "name"), [(0.0, "colliding"), (0.5, "shallow")])
def test_collisions_are_listed_as_they_begin_each_where_it_is_deepest(min_depth, name):
    found = follow(slider_scene(), POST_THEN_FLOOR, min_depth=min_depth)
    first, second = found[name]
    assert partners(found[name]) == ["post", "floor"] and first["distance"] > second["distance"]
    for pair, depth, waypoint in ((first, 0.02, 1), (second, 0.1, 3)):
        assert pair["distance"] == pytest.approx(-depth) and pair["at"]["waypoint"] == waypoint
        assert pair["from"]["sample"] < pair["at"]["sample"] and pair["samples"] >= 2
    assert found["collides"] == (name == "colliding") == (found["first_collision"] is not None)
    assert found["colliding" if name == "shallow" else "shallow"] == []
    assert found["least"]["distance"] == second["distance"] and found["least"]["at"] == second["at"]


def test_near_pairs_are_listed_the_nearest_first_whenever_they_are_met():
    found = follow(slider_scene(), path((-0.2, 0.0), (0.45, 0.0)), clearance=0.25)
    assert partners(found["near"]) == ["post", "crate", "floor"] and found["colliding"] == []
    begins = [pair["from"]["sample"] for pair in found["near"]]
    assert begins[2] == 0 < begins[0]
    assert [pair["distance"] for pair in found["near"]] == pytest.approx([0.05, 0.1, 0.2], rel=1e-3)


def test_a_pair_is_listed_in_its_worst_class_alone():
    found = follow(slider_scene(), path((0.3, 0.0), (MEETS, 0.0), (MEETS + 0.05, 0.0)), clearance=0.3, resolution=0.05)
    assert partners(found["colliding"]) == ["post"] and found["touching"] == []
    assert "post" not in partners(found["near"])


def test_plain_numbers_have_no_negative_zero():
    """Whatever the signs of zeros in rows of the World."""
    watch = watched(slider_scene(), path((0.0, -0.0), (MEETS + 0.1, 0.0)), clearance=0.3)
    rows = [state["event"]["row"] for states in watch.worst.values() for state in states.values()]
    vectors = [row[name] for row in rows for name in ("normal", "point_a", "point_b")]
    for vector in vectors:
        vector[vector == 0] = -0.0
    assert sum(int((vector == 0).sum()) for vector in vectors) >= 4
    assert not re.search(r"-0\.0\b", json.dumps(watch.to_dict(), allow_nan=False))
    assert math.copysign(1.0, _finite(-0.0)) == 1.0 and _finite(-math.inf) is None and _finite(-0.5) == -0.5


def test_where_on_the_path_and_when():
    found = follow(slider_scene(), path((0.0, 0.0), (0.2, 0.0), (0.4, 0.0), times=[3.0, 4.0, 8.0]), resolution=0.1)
    at = found["least"]["at"]
    assert found["samples"] == 5 and found["duration"] == 5.0 and found["waypoints"] == 3
    assert at == {"share": 1.0, "time": 8.0, "sample": 4, "waypoint": 2}
    assert found["least"]["state"] == {"slide": 0.4, "lift": 0.0}
    times = sample(slider_scene(), path((0.0, 0.0), (0.2, 0.0), (0.4, 0.0), times=[3.0, 4.0, 8.0]), 0.1).times
    assert times == pytest.approx([3.0, 3.5, 4.0, 6.0, 8.0])
    assert place({"share": 0.25, "time": None}) == "25 %" and place(at, " of it") == "100 % of it (8 s)"


def test_verdicts_count_the_pairs_after_the_first():
    at = {"share": 0.5, "time": None}
    pair = {"a": "x", "b": "y", "at": at, "distance": -0.1}
    told = lambda n, **values: verdict({"moving": ["x"], "samples": 3, "first_collision": pair, "least": pair,
                                        "colliding": [pair] * n, **values})
    assert told(1) == "first collision at 50 % of the path: x and y"
    assert told(2) == "first collision at 50 % of the path: x and y; 1 more pair collides along it"
    assert told(4).endswith("; 3 more pairs collide along it")
    free = told(0, first_collision=None)
    assert free == "no collision at 3 samples of the path; least clearance 0 mm at 50 % of it: x and y"
    assert told(0, first_collision=None, least=None).endswith("; nothing near")
    assert told(0, moving=[]) == "the trajectory moves no body: 3 samples at one place"


def test_verdicts_of_samples_are_rows_of_classes():
    """The worst class at each sample: near, touching, colliding, and none."""
    way = path((0.0, 0.0), (MEETS, 0.0), (MEETS + 0.1, 0.0))
    watch = watched(slider_scene(), way, clearance=0.45, resolution=0.125)
    known = [classes.NAMES[verdict] if verdict < len(classes.NAMES) else "" for verdict in watch.verdicts]
    assert known == ["near"] * 4 + ["touching", "colliding"], known
    assert watch.first["sample"] == 5
    free = watched(slider_scene(), path((0.0, 0.0), (0.1, 0.0)), clearance=0.0, resolution=0.125)
    assert (free.verdicts == len(classes.NAMES)).all()


def test_the_depth_of_the_first_collision_is_the_deepest_of_its_sample():
    """Post and floor are both met at the last sample, the floor more deeply."""
    found = follow(slider_scene(), path((0.3, 0.0), (MEETS + 0.05, -0.3)), resolution=1.0)
    assert found["samples"] == 2 and partners([found["first_collision"]]) == ["floor"]
    assert found["first_collision"]["distance"] == min(pair["distance"] for pair in found["colliding"])
    assert len(found["colliding"]) == 2


@pytest.mark.parametrize("max_kept", [0, 1, 3, 100])
def test_no_more_searches_are_kept_than_may_be(max_kept):
    scene = slider_scene()
    watch = Watch(scene, sample(scene, path((0.0, 0.0), (0.4, 0.0)), 0.1), 0.0, 0.0, max_kept)
    for k, poses in watch.poses():
        watch.see(k, poses)
    assert len(watch._searches) == min(max_kept, 5)
