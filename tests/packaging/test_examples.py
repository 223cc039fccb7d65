"""The examples run, each in an interpreter of its own, and print what their readers are told to see."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

#: Packages that an example cannot do without, beyond the engine.
NEEDS = {
    "06_compare_with_fcl": "fcl", "13_mujoco_pit": "mujoco", "11_meshes_in_scenes": "trimesh",
    "14_programs_for_python_fcl": "trimesh", "16_pybullet_arm": "pybullet", "17_newton_solver": "newton",
    "29_record_and_compare": "pybullet",
    **dict.fromkeys(("18_certified_planning", "19_nearest_obstacles", "20_reachable_positions"), "yaml"),
    "32_depth_camera": "yaml", "33_optimised_trajectory": "yaml scipy",
    "34_free_box": "yaml", "35_clearance_of_an_arm": "scipy", "37_learn_from_contacts": "torch",
}
#: What hosts print when they are imported.
HOSTS_SAY = ("pybullet build time", "Warp CUDA warning")
#: What each example's output must hold.
SHOWS = {
    "22_safe_corridor": ["region 2: the pillar reaches into it", "region 3 with that plane: 0.4000 m away"],
    "23_wrench_polytope": ["friction 0.3, 30 N: not held", "by 3 bounds of the task", "friction 0.8, 30 N: held"],
    "25_workspace_limits": [
        "x = 1.36: forearm and limit 0, limit 0 and tool; ", "x = 1.1: free; +0.2343 m", "camera's view and tool",
        "seen from t = 0.4706 on",
        "radius 0.5 on top of it: touches", "radius 0.49999999999999994 on top of it: apart",
        "half-spaces 0 and 2 contradict each other",
    ],
    "24_footprints": [
        "23.7% of 100000 poses hit", "a common point checked in fractions", "a line between checked in fractions",
        "0.196 m, from [1.381 0.1  ] to [1.381 0.296]", "0.097 m inside", "outside, it falls", "moved by 0 m: stands",
        "moved by -1e-200 m: falls",
    ],
    "27_field_transfer": [
        "1296 and 4374 cells", "conserved: True", "no new extremes: True", "as it is: True",
        "sum to its volume in fractions: True",
    ],
    "26_bezier_regions": ["region 0: entered at 0.000, left at 0.361", "region 2: never entered", "proven outside)"],
    "29_record_and_compare": [
        "fcl-wrong-depth-box-box-touching: .json, .md, .py", "coal-false-miss-cylinder-cylinder",
        "pybullet: 1 pair recorded",
    ],
    "33_optimised_trajectory": [
        "straight: 10 of 32 waypoints collide", "optimised: 0 of 32 waypoints collide", "31 of 31 motions proven free",
        "within the clearance in",
    ],
    "35_clearance_of_an_arm": [
        "planned: least distance +0.0", "bent: least distance +0.06", "21 of 21 motions proven to keep 0.05 m",
    ],
    "36_fit_a_grasp": ["step 5: distances and normals off by ", "normals 0.0000 degrees off"],
    "37_learn_from_contacts": ["the box is 217", "mm off, balls are 0.100 mm"],
    "34_free_box": ["box grown in", "0 of 100000 samples of the box collide", "path of 49 segments", "49 proven free"],
    "32_depth_camera": [
        "4688 points seen; the straight motion collides at", "a path of 4 motions, 4 of them proven free",
        "plan.html, 3.",
    ],
    "31_free_space_cells": ["30 convex cells, 56.490 m³ of 60 m³", "a path through 8 portals", "0 of 900 points"],
    "27_solids": ["solid: True", "0 facets cross", "clash: 0.7200 mm³", "at rest: volume 0.0, patch 625.00 cm²"],
    "30_base_as_a_point": ["an obstacle of ", "a path of 4.81 m in 44 steps", "steps that hit: 0 of 44"],
    "18_certified_planning": [
        "rad, all of it proven free in", "nodes; a path", "motions are proven free", "of it in collision checks",
    ],
    "19_nearest_obstacles": ["in something, gaps up to", "collide, depths up to", "nearest in"],
    "21_look_at_a_world": ["13 bodies at http://127.0.0.1:", "no longer live"],
    "20_reachable_positions": ["200000 postures", "free of collision, layer by layer", "m above the floor"],
    "17_newton_solver": ["newton: ", "collide: ", "of 500 pairs: Newton 20, collide 0"],
    "16_pybullet_arm": ["Bullet says otherwise in", "finger over the table: +0.800 mm, Bullet -0.200 mm", "a World of"],
    "01_two_shapes": ["gap [m]:", "certified: True", "by exact arithmetic"],
    "02_batch_of_poses": ["beyond 2 cm: 2 of 7", "hits:"],
    "03_world_with_filters": ["1 grasped", "static–static", "collisions left: []"],
    "04_robot_in_a_scene": ["right_finger", "sweeping yaw", "free"],
    "05_scene_file_to_report": ["COLLIDING", "HOW EACH ANSWER IS KNOWN", "as data: 1 collision"],
    "06_compare_with_fcl": ["pairs where collide is refuted: 0"],
    "07_many_large_hulls": ["pairs of pebbles meet", "proven", "saved and loaded: True; 20000 vertices"],
    "08_meshes": [
        "solid: True",
        "inside the ring's hole: False",
        "inside its wall: True",
        "comes free",
        "the same tree: True",
        "clears part 0",
    ],
    "09_rays_and_overlays": [
        "shared area 1.000000000000000",
        "beside it: [True, True, False]",
        "inside: [True, True, False]",
        "itself: False True",
    ],
    "10_contacts": [
        "proven free",
        "a ball 1.00 mm above",
        "jaw 1 pushes along [-1.  0.  0.], 4 points",
        "box and ball",
    ],
    "14_programs_for_python_fcl": [
        "import fcl is collide.adapters.hosts.fcl_api",
        "4 contacts, each 0.100 m deep",
        "concentric balls: -1.0 m",
        "above a half-space: 1.50 m",
        "touch at 0.250000",
        "trimesh asks collide.adapters.hosts.fcl_api: [('cube 0', 'cube 1'), ('cube 1', 'cube 2')]",
    ],
    "15_coal_and_pinocchio": ["import coal is collide.adapters.hosts.coal_api: 1 contact of a can in a box, -0.25 m"],
    "13_mujoco_pit": [
        "culled steps have MuJoCo's bits: True", "a World of 41 bodies", "with collide all are seen: True",
    ],
    "12_margins_and_names": [
        "within 5 mm: [True, True, False]",
        "separating plane",
        "m from it, by a simplex of points",
        "contacts of pair 1: 4",
        "is that of the matrix: True",
    ],
    "11_meshes_in_scenes": [
        "as it is: [('bracket', 'chip')]",
        "shell is a surface of 18 facets without an inside (open",
        "by hulls: [('bracket', 'pin'), ('bracket', 'chip')]",
    ],
}


def run(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env={**os.environ, "PYTHONIOENCODING": "utf-8"},
        check=False, capture_output=True, encoding="utf-8", timeout=120,
    )


@pytest.mark.many(7)
@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_example_runs(file):
    for needed in NEEDS.get(file.stem, "").split():
        if find_spec(needed) is None:
            pytest.skip(f"{file.name} compares with {needed}, which is not installed")
    done = run(str(file))
    assert done.returncode == 0, done.stderr
    warned = [line for line in done.stderr.splitlines() if not line.startswith(HOSTS_SAY)]
    assert not warned, "an example prints no warnings"
    assert file.stem in SHOWS, f"say in SHOWS what {file.name} must print"
    for words in SHOWS[file.stem]:
        assert words in done.stdout


def test_example_without_its_peer_says_so():
    """Where the engine is not installed, the example explains and leaves with status 0."""
    example = ROOT / "examples" / "06_compare_with_fcl.py"
    hide = (
        "import importlib.util, runpy; real = importlib.util.find_spec\n"
        "importlib.util.find_spec = lambda name, *a: None if name == 'fcl' else real(name, *a)\n"
        f"runpy.run_path({str(example)!r}, run_name='__main__')"
    )
    done = run("-c", hide)
    assert done.returncode == 0, done.stderr
    assert "is not installed" in done.stdout and "collide-robotics[peers]" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_example_is_short_and_says_what_it_shows(file):
    text = file.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 50
    assert ast.get_docstring(ast.parse(text))


def test_every_example_is_known():
    assert {file.stem for file in EXAMPLES} == set(SHOWS)


#: What a page's Python takes as given: run before it, in a folder with the files of `_FILES`.
GIVEN = {
    "README": "",
    "arrays": "",
    "python": "",
    "clouds": "",
    "voxels": "",
    "viewers": "open('cell.yaml', 'w').write('{collide: 1, robots: [{urdf: panda.urdf}]}')",
    "distance_fields": "",
    "barba-langerman": "from collide.polytopes import planar_pose\n"
    "X_WBs = np.array([planar_pose((x, 0)) for x in (1, 5)])",
    "casts": "shape = A = B = collide.Box((1, 1, 1)); X_WA = X_WS = np.eye(4); X_WB = collide.pose((3, 0, 0))\n"
    "origins_W = points_W = np.zeros((2, 3)); directions_W = [(1, 0, 0), (0, 1, 0)]; direction_W = (1, 0, 0)\n"
    "world = collide.World(); world.add(B, X_WB)",
    "configuration_obstacles": "",
    "life_of_a_query": "X_WA, X_WB = np.eye(4), collide.pose((1, 0, 0))\n"
    "mesh = collide.Mesh(*collide.tessellate(collide.Sphere(0.5))[:2])",
    "locality": "",
    "nested_hulls": "",
    "meshes": "A = B = shape = mesh = collide.Mesh(*collide.tessellate(collide.Sphere(0.5))[:2])\n"
    "X_WA, X_WB = np.eye(4), collide.pose((0.3, 0, 0))\n"
    "points_W = origins_W = np.zeros((2, 3)); directions_W = [(1, 0, 0), (0, 1, 0)]",
    "motion": "A = B = collide.Box((1, 1, 1)); X_WA0 = X_WA1 = np.eye(4); X_WB0 = collide.pose((3, 0, 0))\n"
    "velocity, omega = (-3, 0, 0), (0, 0, 1.0)",
    "overlays": "vertices, cells = np.vstack((np.zeros(3), np.eye(3))), [[0, 1, 2, 3]]\n"
    "B, X_WA, X_WB = collide.TetMesh(vertices, cells), np.eye(4), collide.pose((0.1, 0, 0))",
    "partitions": "mesh = collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1)))[:2]); points = np.zeros((2, 3))\n"
    "low, high = (-2, -2, -2), (2, 2, 2)",
    "derivatives": "robot = collide.Robot.load('two_links.urdf'); Q = np.array([[0.1], [0.4]])\n"
    "world = collide.World(); world.add(collide.Sphere(0.1), collide.pose((0.5, 0.5, 0)), name='ball')",
    "polytopes": "",
    "shapes": "",
    "robots": "X_LS = np.eye(4); world = collide.World(); Q = Q0 = np.zeros((2, 1)); Q1 = Q + 0.1; q = Q[0]\n"
    "scan, X_WC = np.eye(3) * 5, X_LS",
    "planned_motions": "robot = collide.Robot.load('two_links.urdf'); world = collide.World()\n"
    "world.add(collide.Sphere(0.1), collide.pose((3, 1, 1)), name='ball')\n"
    "checker = collide.RobotChecker(robot, world)\n"
    "Q = np.zeros((2, robot.dof)); q, times = Q[0], [0.0, 1.0]\n"
    "knots, coefficients = np.arange(9.0), np.zeros((5, robot.dof))",
    "planning": "q0 = [-2.8, 1.04, 2.76, -1.97, -1.81, 3.39, 2.56, 0.04]\n"
    "q1 = [2.8, 0.37, 0.12, -1.48, -2.48, 3.24, -0.28, 0.03]",
    "solids": "",
    "spheres": "",
    "worlds": "",
    "disabled-pairs": "robot = collide.Robot.load('two_links.urdf')",
    "engines": "",
    "pages": "from collide.cli.main import main\nmain(['report', 'scene.yaml', '--html', 'page.html'])\n"
    "world = collide.World(); ids = [world.add(collide.Sphere(1))]\n"
    "times, poses = (0.0, 0.1), lambda t: [collide.pose((t, 0, 0))]",
    "report-schema": "from collide.cli.main import main\n"
    "main(['report', 'scene.yaml', '--json', 'report.json', '--geometry'])",
    "scene-format": "",
}
#: Packages that a page's Python needs.
NEEDED = {
    "arrays": ("torch",),
    "robots": ("yaml", "mujoco"), "disabled-pairs": ("yaml",), "engines": ("mujoco",), "pages": ("yaml",),
    "viewers": ("yaml", "viser", "rerun", "foxglove"),
    "report-schema": ("yaml", "trimesh"), "scene-format": ("yaml",), "planning": ("yaml", "ompl"),
}
#: Pages whose Python is not run here, and where it is, or why it is not.
ELSEWHERE = {
    "sweeps": "a million configurations in 16 processes: tests/sweeps/test_sweep.py makes the calls, of fewer",
    "fuzzing": "ten minutes, and objects of four engines: tests/adapters/fuzzing makes the calls, of less",
    "hosts": "each part needs its host, and some take the host's place in the process: tests/adapters, one file a host",
}
_ARM = """<robot name="panda"><link name="base"/><link name="panda_hand"><collision><geometry><box size="0.1 0.1 0.1"/>
</geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="panda_hand"/>
<origin xyz="0.5 0 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
_BALL = '<collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>'
_ARM_SDF = (
    f'<sdf version="1.7"><model name="arm"><link name="a">{_BALL}</link><link name="b">{_BALL}</link>'
    '<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>'
    "</model></sdf>"
)
_FILES = {
    "panda.urdf": _ARM,
    "arm.sdf": _ARM_SDF,
    "warehouse.sdf": _ARM_SDF.replace("<model", '<world name="w"><model').replace("</model>", "</model></world>"),
    "two_links.urdf": _ARM.replace(
        '<link name="base"/>',
        '<link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>',
    ),
    "scene.yaml": "collide: 1\nrobots:\n  - {urdf: panda.urdf}\nbodies:\n"
    "  - {name: table, shape: {box: {size: [1, 1, 0.1]}}, pose: {xyz: [0, 0, -1]}}\n",
    "my_scene.yaml": "collide: 1\nbodies:\n  - {name: ball, shape: {sphere: {radius: 1}}}\n",
    "arm.xml": '<mujoco><worldbody><body name="a"><joint name="turn"/><geom size="0.1"/></body></worldbody>'
    '<keyframe><key name="home" qpos="0.5"/></keyframe></mujoco>',
}


def _python_of(page: Path) -> str:
    return "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL))


PAGES = {page.stem: page for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))) if _python_of(page)}


def test_python_of_every_page_is_run_somewhere():
    assert set(PAGES) == set(GIVEN) | set(ELSEWHERE) and not set(GIVEN) & set(ELSEWHERE)


@pytest.mark.many(5)
@pytest.mark.parametrize("name", GIVEN)
def test_python_in_pages_runs(name, tmp_path):
    """All of a page's Python, in order, in one interpreter, after what the page takes as given."""
    missing = [package for package in NEEDED.get(name, ()) if find_spec(package) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed")
    for file, text in _FILES.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    begin = f"import os, numpy as np, collide\nos.chdir({str(tmp_path)!r})"
    done = run("-c", "\n".join((begin, GIVEN[name], _python_of(PAGES[name]))))
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(find_spec("yaml") is None, reason="PyYAML is not installed: the scene cannot be read")
def test_example_of_planning_proves_all_of_its_path():
    """Each run has a path of several motions, every one of them proven, and most of the time goes into checks."""
    done = run(str(ROOT / "examples" / "18_certified_planning.py"))
    (free, motions), (share,) = (
        re.search(pattern, done.stdout).groups()
        for pattern in (r"(\d+) of its (\d+) motions are proven free", r"(\d+) % of it in collision checks")
    )
    assert int(free) == int(motions) >= 2 and 10 <= int(share) <= 100


@pytest.mark.skipif(find_spec("pinocchio") is None, reason="Pinocchio (pin) is not installed")
def test_example_of_pinocchio_finds_what_is_missed():
    done = run(str(ROOT / "examples" / "15_coal_and_pinocchio.py"))
    assert "_right_hand.urdf: pair 5, 40.8 mm deep, is missed by Pinocchio" in done.stdout
    assert re.search(r"panda.urdf: 5 of 200 collide; \d+ µs each, Pinocchio \d+ µs", done.stdout)
