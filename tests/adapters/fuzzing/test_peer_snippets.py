"""Snippets run in an interpreter of their own, without collide, and print the peer's answer and the true one."""

from __future__ import annotations

import ast
import re
import subprocess
import sys

import numpy as np
import pytest

from collide import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere, pose
from collide.adapters.fuzzing.disagreements import Flaw
from collide.adapters.fuzzing.fuzz_case import Case, isolated, pair_case
from collide.adapters.fuzzing.peer_snippets import FORMS, MAX_LINES, snippet
from collide.adapters.fuzzing.proofs import expected_text, proof
from collide.adapters.peers.protocol import ENGINES, engine

TETRAHEDRON = ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
SURFACE = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3]])
AWAY, TURNED = pose((3.25, 0.5, 0.125)), pose((2.5, 0.25, 0.125), rpy=(0.3, 0.2, 0.1))
PAIRS: dict[str, tuple[Shape, Shape]] = {
    "boxes": (Box((1, 2, 3)), Box((1, 1, 1))), "rounds": (Sphere(0.5), Capsule(0.25, 1)),
    "curved": (Cylinder(0.5, 1), Sphere(0.25)), "hulls": (TETRAHEDRON, TETRAHEDRON),
    "mesh": (SURFACE, Sphere(0.25)), "hull and mesh": (TETRAHEDRON, SURFACE),
    "plane": (Halfspace((0, 0, 2), -8), Box((1, 1, 1))),
    "cones": (Cone(0.5, 1), Ellipsoid((0.1, 0.2, 0.3))),
}
#: Rapier's casts have no form.
SETTINGS = [
    name for name in ENGINES if name.partition(":")[0] in FORMS and name not in ("rapier:cast", "rapier:nonlinear")
]
#: Engines that give no nearest points, or whose form has none.
WITHOUT_POINTS = ("rapier", "newton", "cgal", "distance3d:nesterov", "distance3d:mpr")
#: How the lines of snippets begin; pybullet prints others.
PRINTED = ("true: ", "fcl ", "coal ", "pybullet dist", "pybullet points", "mujoco ", "drake ", "trimesh ", "rapier ",
           "distance3d ", "newton ", "cgal ")


def flaw(name: str, kind: str = "wrong gap") -> Flaw:
    return Flaw(name, kind, "apart", False, 1.0, "", False, 1.0, None, None, "exact arithmetic", 1.0)


def printed(text: str) -> list[str]:
    program = [sys.executable, "-I", "-c", _without_collide(text)]
    ended = subprocess.run(program, check=False, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    return [line for line in ended.stdout.splitlines() if line.startswith(PRINTED)]


def _without_collide(text: str) -> str:
    """The snippets of a test in one interpreter, which may not import collide; those of coal need its path."""
    return f"import sys\nsys.path[:] = {sys.path!r}\nsys.modules['collide'] = None\n{text}"


@pytest.mark.many(6)
@pytest.mark.parametrize("name", SETTINGS)
def test_snippets_say_what_the_peer_says(name):
    peer = engine(name)
    if peer.missing():
        pytest.skip(str(peer.missing()))
    cases = [pair_case(A, B, X, Y) for A, B in PAIRS.values() for X, Y in ((pose(), AWAY), (TURNED, pose((0, 6, 0))))]
    texts = [snippet(flaw(name), case, proof(case)) for case in cases]
    table = peer.answer(isolated(cases))
    asked = [k for k in range(len(cases)) if table.rows["answered"][k]]
    assert len(asked) >= (4 if name == "cgal" else 6) and all(texts[k] for k in asked)
    for text in filter(None, texts):
        assert len(text.splitlines()) <= MAX_LINES
        assert _imported(text) <= {str(peer.module), "numpy"} | ({"warp"} if name == "newton" else set())
    of_points = snippet(flaw(name, "wrong points"), cases[asked[0]], proof(cases[asked[0]]))
    per_case = _grouped(printed("\n".join([*(str(texts[k]) for k in asked), of_points or ""])))
    if of_points is not None:
        assert len(of_points.splitlines()) <= MAX_LINES
        _check_points(per_case.pop(), table.rows[asked[0]])
    assert len(per_case) == len(asked) and (of_points or name in WITHOUT_POINTS)
    for k, said in zip(asked, per_case):
        assert said[0] == f"true: {expected_text(proof(cases[k]))}"
        row = table.rows[k]
        if any(line.split(": ")[0].endswith("collide") for line in said):
            assert said[1].endswith(str(bool(row["hit"]))), (cases[k], said)
        distances = [float(line.split(": ")[1]) for line in said if "distance: " in line and line != said[0]]
        if distances and row["has_distance"]:
            assert distances == pytest.approx([row["distance"]], rel=1e-14, abs=0), (cases[k], said)


def _check_points(said: list[str], row) -> None:
    """Where the engine gives nearest points of bodies apart they are printed, as the peer reads them."""
    printed_points = [line for line in said if " points: " in line]
    assert bool(printed_points) == bool(np.isfinite(row["point_a"]).all() and not row["hit"]), said
    for line in printed_points:
        numbers = [float(x) for x in re.findall(r"-?\d+(?:\.\d*)?(?:e-?\d+)?", line.split(": ")[1])]
        assert numbers == pytest.approx([*row["point_a"], *row["point_b"]], rel=1e-12, abs=1e-12)


def _imported(text: str) -> set[str]:
    """Packages that a program imports."""
    nodes = list(ast.walk(ast.parse(text)))
    names = [a.name for node in nodes if isinstance(node, ast.Import) for a in node.names]
    names += [str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in names}


def _grouped(lines: list[str]) -> list[list[str]]:
    groups: list[list[str]] = []
    for line in lines:
        if line.startswith("true: "):
            groups.append([])
        groups[-1].append(line)
    return groups


def test_what_has_no_snippet():
    case = pair_case(Box((1, 1, 1)), Sphere(1), pose(), AWAY)
    known = proof(case)
    assert snippet(flaw("exact"), case, known) is None and snippet(flaw("collide"), case, known) is None
    assert snippet(flaw("fcl"), Case(case.bodies, world=True), known) is None
    many = ConvexHull(np.random.default_rng(0).standard_normal((200, 3)))
    assert snippet(flaw("fcl"), pair_case(many, many, pose(), AWAY), known) is None
    flat = ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert snippet(flaw("coal"), pair_case(flat, flat, pose(), AWAY), known) is None, "coal cannot be given it"


def test_proofs_are_told_with_where_they_come_from():
    apart = proof(pair_case(Box((1, 1, 1)), Box((1, 1, 1)), pose(), pose((1.5, 0, 0))))
    assert expected_text(apart) == "apart, signed distance 0.5 m (exact arithmetic on integers)"
    deep = proof(pair_case(Box((1, 1, 1)), Sphere(0.25), pose(), pose((0.5, 0, 0))))
    assert deep["distance"] == "-0.25" and deep["certificate"]["facet_normal"] is not None
    curved = proof(pair_case(Cylinder(1, 1), Sphere(0.5), pose(), pose((0, 0, 2))))
    assert curved["lower"] <= 1.0 <= curved["upper"] and curved["by"] == "the bracket that collide proves"
    union = proof(pair_case(SURFACE, Sphere(0.25), pose(), pose()))
    assert union["hit"] is True and union["distance"] is None
