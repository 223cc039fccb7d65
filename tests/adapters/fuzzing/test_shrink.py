"""Cases with planted errors end at the smallest one, by hand known; what is right is no finding."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from collide import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    Mesh,
    Sphere,
    pose,
)
from collide.adapters.fuzzing.disagreements import Examiner, Flaw
from collide.adapters.fuzzing.engine_session import EngineSession
from collide.adapters.fuzzing.fuzz_case import Case, pair_case
from collide.adapters.fuzzing.invented_scenes import invent
from collide.adapters.fuzzing.shrink import Shrunk, shrink
from collide.adapters.fuzzing.simpler_cases import STEPS, complexity, degrees, n_digits
from collide.adapters.peers.protocol import engine
from collide.adapters.peers.question import Body

RNG = np.random.default_rng(5)
TURNED = pose((0.3127, -0.2519, 0.1973), rpy=(0.31, -0.52, 1.13))
POINTS = RNG.standard_normal((14, 3)) * 1.3


def in_process(name: str) -> Examiner:
    return Examiner({name: engine(name, isolated=False).answer})


def smallest(name: str, case: Case, kind: str) -> Shrunk:
    examiner = in_process(name)
    (flaws,) = examiner.flaws([case], [name])
    assert [flaw.kind for flaw in flaws] == [kind]
    made = shrink(case, flaws[0], examiner.flaws)
    assert made.is_minimal and made.flaw.kind == kind and made.flaw.position == flaws[0].position
    assert complexity(made.case) <= complexity(case)
    return made


def test_a_large_box_becomes_a_plain_one(stubs):
    case = pair_case(Box((0.7231, 1.1931, 3.3719)), ConvexHull(POINTS, radius=0.1), pose((5, 6, 7)) @ TURNED,
                     pose((5.2, 6.1, 7.3)))
    A, B = smallest("large_boxes", case, "false miss").case.bodies
    assert sorted(A.shape.size)[:2] == [1.0, 1.0] and max(A.shape.size) == 3.0
    assert isinstance(B.shape, ConvexHull) and len(B.shape.points) == 1 and B.shape.radius == 0
    assert np.array_equal(A.X_WB, np.eye(4)) and np.array_equal(B.X_WB[:3, :3], np.eye(3))


def test_parts_and_facets_go(stubs):
    parts = [(Sphere(0.2), pose((3, 0, 0))), (Box((2.51, 0.3, 0.4)), TURNED), (Capsule(0.1, 0.2), pose((0, 4, 0)))]
    block = Mesh(*_block((0.9, 0.8, 0.7)))
    A, B = smallest("large_boxes", pair_case(Compound(parts), block, pose(), pose()), "false miss").case.bodies
    assert isinstance(A.shape, Box) and A.shape.size.max() == 3.0
    assert isinstance(B.shape, Mesh) and len(B.shape.faces) == 1


def test_numbers_that_are_none(stubs):
    A, B = smallest("spheres_nan", pair_case(Sphere(0.731), Sphere(1.139), pose(), TURNED), "NaN").case.bodies
    assert (A.shape.radius, B.shape.radius) == (1.0, 1.0)
    made = smallest("spheres_nan", pair_case(Box((0.7, 0.3, 0.9)), Sphere(1.139), pose(), TURNED), "no length")
    assert made.case.kinds == ("Box", "Sphere") and made.flaw.distance is None and made.flaw.hit


def test_an_exception_is_a_flaw_and_keeps_its_reason(stubs):
    case = pair_case(Sphere(0.5), Sphere(0.7), pose(), pose((7.123, 1.234, 0.77)))
    made = smallest("raises", case, "exception")
    assert made.flaw.reason == "RuntimeError: too far" and made.flaw.exact_distance > 5
    X = made.case.bodies[1].X_WB
    assert np.count_nonzero(X[:3, 3]) == 1, "the two bodies lie on an axis"


def test_a_wrong_distance_stays_as_grave(stubs):
    case = pair_case(Capsule(0.31, 0.72), Capsule(0.2, 1.1), pose(), pose((1.7, 0.3, 0.1)) @ TURNED)
    made = smallest("raises", case, "wrong gap")
    assert made.flaw.distance - made.flaw.exact_distance == pytest.approx(0.01)
    assert made.flaw.judged_by == "exact arithmetic"


def test_nearest_points_that_are_none(stubs):
    apart = pose((7.1, 0.3, 0.2))
    made = smallest("exchanges_points", pair_case(Sphere(0.31), Sphere(0.72), pose(), apart), "wrong points")
    assert "exchanged: each is on the other body" in made.flaw.reason and made.flaw.judged_by == "the proven bracket"
    made = smallest("exchanges_points", pair_case(Box((1, 1, 1)), Box((2, 1, 1)), pose(), apart), "wrong points")
    assert "the one on A 0.01" in made.flaw.reason and made.flaw.severity * made.case.bodies[0].shape.size.max() < 0.01
    right = [pair_case(Sphere(0.5), Box((1, 1, 1)), pose(), apart), pair_case(Sphere(1), Sphere(1), pose(), pose())]
    assert in_process("exchanges_points").flaws(right) == [[], []], "overlaps are not judged"
    tiny = Mesh([[0, 0, 0], [0, 0, 9e-13], [0, 1e-12, 0]], [[0, 2, 1]])
    far = pair_case(tiny, Halfspace((0, 0, 1), -0.06), pose(), pose((0, 0, -1000)))
    assert Examiner({}).flaws([far]) == [[]], "rounding of where a tiny body is"


def test_an_abort_and_a_hang_are_shrunk_in_children(stubs):
    with closing(EngineSession("cones_abort")) as aborting, closing(EngineSession("ellipsoids_hang", 2.0)) as hanging:
        examiner = Examiner({"cones_abort": aborting.answer, "ellipsoids_hang": hanging.answer})
        cone = pair_case(Cone(1, 1), Box((1, 1, 0.5)), pose(), pose())
        oblong = pair_case(Sphere(1), Ellipsoid((1, 1, 2)), pose(), pose())
        right = pair_case(Sphere(1), Box((1, 1, 2)), pose(), pose())
        flaws = examiner.flaws([right, cone, oblong, right])
        assert [[(flaw.engine, flaw.kind) for flaw in found] for found in flaws] == [
            [], [("cones_abort", "abort")], [("ellipsoids_hang", "hang")], []
        ]
        assert "SIGABRT" in flaws[1][0].reason and flaws[2][0].reason == "no answer in 2 s"
        starts = aborting.starts
        assert examiner.flaws([right])[0] == [] and aborting.starts == starts, "a child stays from question to question"
        small = shrink(cone, flaws[1][0], examiner.flaws)
        assert small.case.bodies[1].shape == Box((1, 1, 1)) and small.is_minimal


def test_what_is_right_is_no_finding(stubs):
    cases = invent(3, 0, 40)
    flaws = in_process("stub").flaws(cases)
    assert not any(flaws), next((case, found) for case, found in zip(cases, flaws) if found)
    assert sum(case.world for case in cases) + len({case.kinds for case in cases}) > 15


def test_a_world_loses_the_bodies_that_do_not_matter():
    others = tuple(Body(f"C{k}", Sphere(0.1), pose((k, 9, 9))) for k in range(7))
    pair = pair_case(Box((3, 1, 1)), Sphere(1), pose(), pose())
    case = Case(pair.bodies + others, world=True)
    flaw = Flaw("collide", "left out of a World", "deep", True, -1.0, "", True, -1.0, None, None, "", 1.0)
    made = shrink(case, flaw, lambda cases, engines: [[flaw] if "C5" in _names(case) else [] for case in cases])
    assert [body.name for body in made.case.bodies] == ["A", "B", "C5"]


def _names(case: Case) -> list[str]:
    return [body.name for body in case.bodies]


@pytest.mark.parametrize(
    "shape", [HPolytope(np.vstack([np.eye(3), -np.eye(3), [[1, 1, 0]]]), [0.4] * 7), Cylinder(0.37, 1.21),
              HeightField(np.arange(12.0).reshape(3, 4), 0.5), Ellipsoid((0.3, 0.41, 0.52))],
)
def test_every_step_gives_cases_that_can_be_asked(shape):
    case = pair_case(shape, Box((0.71, 0.83, 0.97)), TURNED, pose((0.123, 0.456, 0.789)))
    made = [tried for step in STEPS for tried in step(case) if tried is not None]
    assert len(made) > 20 and any(complexity(tried) < complexity(case) for tried in made)


@pytest.mark.parametrize(
    ("x", "digits"), [(0.0, 0), (1.0, 1), (-1.0, 2), (2.0, 2), (0.5, 2), (0.125, 4), (100.0, 2), (1e-16, 18)]
)
def test_how_long_numbers_are(x, digits):
    assert n_digits(x) == digits


def test_angles_of_few_digits_are_found_again():
    for rpy in ((0, 0, 90), (30, 0, 0), (15, 45, 75), (0, 90, 0), (0, -90, 20)):
        R = pose((0, 0, 0), rpy=np.radians(rpy))[:3, :3]
        assert np.allclose(pose(rpy=np.radians(degrees(R)))[:3, :3], R, atol=1e-12)


def _block(size):
    corners = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * size
    faces = [(0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5), (2, 3, 7), (2, 7, 6), (0, 2, 6),
             (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return corners, faces
