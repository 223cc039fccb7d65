"""Which class a pair is in: by its proven bracket alone, however it was found."""

from __future__ import annotations

import math
from collections import Counter

import naive
import numpy as np
import pytest

import collide
from collide import Box, Compound, Cylinder, Mesh, Sphere, pose
from collide.reports import classes, report
from collide.results import EXACT, PAIR_DTYPE, PLANE, SIMPLEX, UNDECIDED
from collide.scenes import Scene, SceneBody
from collide.scenes.families.ingredients import rotation


def scene_of(*bodies) -> Scene:
    return Scene("pair", [SceneBody(f"body {k}", shape, X) for k, (shape, X) in enumerate(bodies)])


def class_of(*bodies, clearance=0.05) -> str:
    """The one class that a pair is in, or "" where it is not listed."""
    made = report.make(scene_of(*bodies), clearance=clearance)
    listed = [name for name in classes.NAMES if len(getattr(made, name))]
    assert len(listed) <= 1
    return "".join(listed)


def test_parallel_faces_ten_millimetres_apart_never_touch():
    """Integers settle the last digits of such gaps; the report once read that as "below rounding"."""
    rng = np.random.default_rng(7)
    found, settled = Counter(), 0
    for case in range(300):
        R = rotation(rng)
        A, B = Box(rng.uniform(0.02, 0.2, 3)), Box(rng.uniform(0.02, 0.2, 3))
        gap = np.array([0, 0, 0.5 * (A.size[2] + B.size[2]) + 0.01])
        bodies = (A, naive.pose(R, (0, 0, 0))), (B, naive.pose(R, R @ gap))
        settled += collide.distance(A, B, bodies[0][1], bodies[1][1]).how == EXACT
        found[class_of(*bodies)] += 1
        assert found["touching"] == 0, f"case {case}: {bodies}"
        if case % 30 == 0:
            assert class_of(*bodies, clearance=0.0) == ""
    assert found == {"near": 300}
    assert settled > 100, f"only {settled} of 300 were settled by integers: the test meets too few of its cases"


def test_fingers_nine_millimetres_apart_are_near_in_every_output():
    finger, rng = (
        Compound([(Box((0.02, 0.01, 0.05)), pose()), (Box((0.02, 0.012, 0.02)), pose((0, 0.001, 0.02)))]),
        np.random.default_rng(3),
    )
    for _ in range(20):
        R = rotation(rng)
        made = report.make(
            scene_of((finger, naive.pose(R, (0, 0, 0))), (finger, naive.pose(R, R @ (0, 0.0205, 0)))), clearance=0.02
        )
        data = made.to_dict()
        assert (len(data["near"]), data["verdict"]["near"], data["verdict"]["touching"]) == (1, 1, 0)
        assert "touching" not in made.verdict() and data["near"][0]["distance"] == pytest.approx(0.0085, rel=1e-9)


@pytest.mark.parametrize("size", [0.01, 1.0, 300.0])
def test_boxes_that_rest_or_overlap_a_little(size):
    """At rest, an ulp in, half the rounding in: touching. Twice the rounding, 1 µm in: colliding."""
    box, floor = Box((size,) * 3), (Box((2 * size,) * 3), pose((0, 0, -size)))
    sizes = classes.body_sizes(scene_of((box, pose((0, 0, size / 2))), floor).bodies)
    rounding = classes.roundings(*sizes)
    assert 1.4 * size * 2.0**-40 < rounding < 3 * size * 2.0**-40
    at_rest = size / 2
    for z, expected in [
        (at_rest, "touching"), (math.nextafter(at_rest, 0), "touching"), (math.nextafter(at_rest, 9e9), "touching"),
        (at_rest - rounding / 2, "touching"), (at_rest + rounding / 2, "touching"),
        (at_rest - 2 * rounding, "colliding"),
        (at_rest + 2 * rounding, "near"), (at_rest - 1e-6, "colliding"), (at_rest + 1e-6, "near"),
    ]:
        assert class_of((box, pose((0, 0, z))), floor) == expected, (size, z - at_rest, expected)


def test_a_picometre_at_a_metre_is_where_rounding_ends():
    for depth, expected in [(2.0**-52, "touching"), (1e-12, "touching"), (1e-11, "colliding"), (1e-6, "colliding")]:
        assert class_of((Box((1, 1, 1)), pose((0, 0, 0.5 - depth))), (Box((2, 2, 2)), pose((0, 0, -1)))) == expected


def test_meshes_and_curved_shapes_follow_the_same_rule():
    corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3, indexing="ij")).reshape(3, 8).T
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
    mesh = Mesh(corners, faces)
    assert mesh.solid
    table = Box((2, 2, 1)), pose((0, 0, -0.5))
    for z, expected in [(0.5, "touching"), (0.5 - 2.0**-53, "touching"), (0.51, "near"), (0.49, "colliding")]:
        assert class_of((mesh, pose((0, 0, z))), table) == expected, z
        assert class_of((Cylinder(0.4, 1.0), pose((0, 0, z))), table) == expected, z
        assert class_of((Sphere(0.5), pose((0, 0, z))), table) == expected, z


def test_the_rule_looks_at_brackets_alone():
    """Rows of every argument and bracket: the class is what lower, upper and the rounding say."""
    rng = np.random.default_rng(5)
    rows = np.zeros(2000, PAIR_DTYPE)
    ends = np.sort(
        10.0 ** rng.uniform(-18, 0, (2000, 2)) * rng.choice([-1.0, 0.0, 1.0], (2000, 2), p=[0.45, 0.1, 0.45]), axis=1
    )
    rows["lower"], rows["upper"] = ends.T
    rows["distance"] = ends.mean(axis=1)
    rows["how"] = rng.choice([PLANE, SIMPLEX, EXACT], 2000)
    rows["hit"] = ends[:, 1] <= 0
    opened = (ends[:, 0] < 0) & (ends[:, 1] > 0)
    rows["how"][opened], rows["hit"][opened] = UNDECIDED, True
    rounding, clearance, min_depth = 1e-12, 0.1, 1e-3
    found = classes.classify(rows, rounding, clearance=clearance, min_depth=min_depth)
    assert min(map(len, found.values())) > 50
    where = {int(k): name for name, chosen in found.items() for k in chosen}
    assert len(where) == sum(map(len, found.values()))
    for k, (lower, upper) in enumerate(ends):
        if lower < 0 < upper or (-rounding <= lower and upper <= rounding):
            expected = "touching"
        elif upper <= 0:
            expected = "shallow" if -lower < min_depth else "colliding"
        else:
            expected = "near" if lower <= clearance else None  # not proven farther
        assert where.get(k) == expected, (lower, upper, rows["how"][k])
