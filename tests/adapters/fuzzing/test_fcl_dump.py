"""Dumps in the forms that FCL has written them in, and the proven answers to them.

The first is that of issue 21234 of RobotLocomotion/drake.
"""

from __future__ import annotations

import numpy as np
import pytest

from collide import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.adapters.fuzzing.fcl_dump import answered, parse_fcl_dumps, read_fcl_dumps
from collide.adapters.fuzzing.proofs import proof
from collide.cli import main as cli
from collide.errors import SceneError
from collide.scenes import load

CALLS = """RuntimeError: Error with configuration
  Original error message: bazel-out/a/b/fcl/narrowphase/gjk_libccd-inl.h:(1720): validate(): The origin is outside.
  Shape 1:
Cylinder<double>(0.041000000000000001721, 0.17000000000000001221);
  X_FS1
0.62286449762754547699, 0.71651535568044355529, -0.31407891153229777759, 0.20238033346825459735,
-0.20605566270224237591, -0.23703718387133412837, -0.94939688083050233214, 0.027845683594011010065,
-0.75470582445316081177, 0.65606334948423605802, 4.0172294049188053423e-17, 0.3114233939246693339,
0, 0, 0, 1;
  Shape 2:
Box<double>(0.2999999999999999889, 0.5999999999999999778, 0.016000000000000000333);
  X_FS2
1, 0, 0, 0.4000000000000000222,
0, 1, 0, 0,
0, 0, 1, 0.2688500000000000334,
0, 0, 0, 1;
  Solver: GjkSolver_libccd
    collision_tolerance:      2.0097183471152322134e-14
"""
STREAMS = """> terminate called after throwing an instance of 'std::logic_error'
>   what():  Error with configuration
>   Original error message: /home/x/gjk_libccd-inl.h:(1719): validate(): The origin is outside of the polytope.
>   Shape 1: Box0.5 0.25 1
>   X_FS1
> 1 0 0 0
> 0 1 0 0
> 0 0 1 0
> 0 0 0 1
>   Shape 2: Cylinder(r: 0.5, lz: 1.5)
>   X_FS2
> 0 -1 0 1e-1
> 1  0 0 0.25
> 0  0 1 -0.5
> 0  0 0 1
"""
POSE = "1, 0, 0, {0},\n0, 1, 0, 0,\n0, 0, 1, 0,\n0, 0, 0, 1;\n"


def dump(a: str, b: str = "Sphere<double>(0.25);", x: float = 3.0) -> str:
    return (
        f"Error with configuration\n  Original error message: here\n  Shape 1:\n{a}\n  X_FS1\n{POSE.format(0)}"
        f"  Shape 2:\n{b}\n  X_FS2\n{POSE.format(x)}  Solver: GjkSolver_libccd\n"
    )


def test_calls_of_drake_with_the_doubles_they_were():
    (found,) = parse_fcl_dumps(CALLS)
    A, B = found.case.bodies
    assert A.shape == Cylinder(0.041, 0.17) and B.shape == Box((0.3, 0.6, 0.016))
    assert A.X_WB[0, 0] == 0.62286449762754547699 and B.X_WB[:3, 3].tolist() == [0.4, 0, 0.26885000000000003]
    assert found.message == "gjk_libccd-inl.h:(1720): validate(): The origin is outside."
    known = proof(found.case)
    assert known["hit"] is False and 0 < known["lower"] <= known["upper"] < 1e-10, "3e-11 m apart, proven"
    assert known["by"] == "the bracket that collide proves"


def test_streams_quoted_in_an_issue():
    (found,) = parse_fcl_dumps(STREAMS)
    A, B = found.case.bodies
    assert A.shape == Box((0.5, 0.25, 1)) and B.shape == Cylinder(0.5, 1.5)
    assert B.X_WB[:3].tolist() == [[0, -1, 0, 0.1], [1, 0, 0, 0.25], [0, 0, 1, -0.5]]
    assert found.message.startswith("gjk_libccd-inl.h:(1719)")


@pytest.mark.parametrize(
    ("text", "shape"),
    [
        ("Sphere<double>(1.5);", Sphere(1.5)), ("Sphere(1.5)", Sphere(1.5)),
        ("Capsule<double>(0.5, 2);", Capsule(0.5, 2)), ("Capsule(r: 0.5, lz: 2)", Capsule(0.5, 2)),
        ("Cone<float>(0.5, 2);", Cone(0.5, 2)), ("Box 1 2 3e-1", Box((1, 2, 0.3))),
        ("Ellipsoid<double>(1, 2, 3);", Ellipsoid((1, 2, 3))), ("Ellipsoid(radii: 1 2 3)", Ellipsoid((1, 2, 3))),
        ("Halfspace<double>(0, 0, 1, -0.5);", Halfspace((0, 0, 1), -0.5)),
        ("Halfspace(n: 0 0 1, d: -0.5)", Halfspace((0, 0, 1), -0.5)),
    ],
)
def test_every_shape_in_both_forms(text, shape):
    (found,) = parse_fcl_dumps(dump(text))
    assert found.case.bodies[0].shape == shape


CONVEX = """Convex<double>(
  std::make_shared<std::vector<Vector3<double>>>(
    std::initializer_list<Vector3<double>>{
      Vector3<double>(1, 0, 0),
      Vector3<double>(-1, 1, 0),
      Vector3<double>(-1, -1, 0),
      Vector3<double>(0, 0, 2.5),}),
    4,
    std::make_shared<std::vector<int>>(
        std::initializer_list<int>{
             3, 0, 1, 2, 3, 0, 1, 3, 3, 1, 2, 3, 3, 2, 0, 3,}),
    false);"""


def test_a_convex_is_the_hull_of_its_points_and_has_an_exact_answer():
    (found,) = parse_fcl_dumps(dump(CONVEX))
    shape = found.case.bodies[0].shape
    assert isinstance(shape, ConvexHull) and shape.points.tolist() == [[1, 0, 0], [-1, 1, 0], [-1, -1, 0], [0, 0, 2.5]]
    known = proof(found.case)
    assert known["distance"] == "1.75" and known["by"] == "exact arithmetic on integers", "3 − 1 − 0.25"
    assert known["certificate"]["vertices"] == [[0, 0, "1"]]


def test_several_dumps_and_text_between_them():
    text = f"log\n{dump('Sphere(1)')}\nmore log 1 2 3\n{dump('Sphere(2)')}".replace("\n", "\\n", 3)
    assert [d.case.bodies[0].shape for d in parse_fcl_dumps(text)] == [Sphere(1), Sphere(2)]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("nothing", "no dump of FCL's"), (dump("Convex(v count: 8, f count: 6)"), "only how many vertices"),
        (dump("Torus<double>(1, 2);"), "no shape is called 'Torus'"), (dump("Box<double>(1, 2);"), "takes 3 numbers"),
        (dump("Sphere<double>(-1);"), "Shape 1"), (dump("Sphere(1)").replace("0, 0, 1, 0,", "0, 0, 1,", 1), "got 15"),
        (dump("Sphere(1)").replace("0, 0, 1, 0,", "0, 0, 2, 0,", 1), "dump 1"), (dump("Convex<double>();"), "vertices"),
    ],
)
def test_what_is_no_dump_is_told(text, complaint):
    with pytest.raises(SceneError, match=complaint):
        parse_fcl_dumps(text)


def test_the_command_proves_and_saves(tmp_path, capsys):
    (tmp_path / "log.txt").write_text(CALLS)
    assert cli.main(["compare", "--from-fcl-error", str(tmp_path / "log.txt"), "--save", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "proven: they are apart: signed distance within [" in text and "Cylinder(radius=0.041, length=0.17)" in text
    scene = load(tmp_path / "out" / "fcl-error-1.json")
    expected = read_fcl_dumps(tmp_path / "log.txt")[0].case.bodies
    assert all(np.array_equal(a.X_WB, b.X_WB) and a.shape == b.shape for a, b in zip(scene.bodies, expected))
    assert cli.main(["compare", "--from-fcl-error", str(tmp_path / "none.txt")]) == 2
    assert cli.main(["compare", "workcell", "--from-fcl-error", "x"]) == 2 and cli.main(["compare"]) == 2
    assert "takes no SCENE" in capsys.readouterr().err


def test_exact_answers_are_told_with_their_digits():
    (found,) = parse_fcl_dumps(dump("Box<double>(1, 1, 1);", "Box<double>(1, 1, 1);", 1.5))
    assert answered(found, proof(found.case))[-1] == (
        "proven: they are apart: signed distance 0.5 m, by exact arithmetic on integers"
    )
