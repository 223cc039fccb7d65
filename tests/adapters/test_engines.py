"""Every engine behind the protocol, against closed forms and against exact arithmetic.

Oracles: distances worked out by hand for one case per shape, `exact` for 200 random pairs of
polytopes, spheres and capsules. Tolerances are the worst errors seen of each engine, rounded up;
what each engine does not have is listed, so that a silent gap would show.
"""

from __future__ import annotations

import math
import pickle
import subprocess
import sys

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
    HPolytope,
    InvalidArgument,
    Sphere,
    pose,
)
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.protocol import ENGINES, Question, engine, load_engine
from collide.adapters.peers.question import bounds, convex_parts, corners

CUBE = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5).astype(float)
UNIT = HPolytope(np.vstack([np.eye(3), -np.eye(3)]), np.full(6, 0.5))
TILTED = pose((0, 0, 2), rpy=(math.pi / 4, 0, 0))
L_SHAPE = Compound([(Box((2, 1, 1)), pose()), (Compound([(Box((1, 1, 1)), pose((0, 0, 1)))]), pose((0.5, 0, 0)))])

#: name: A, B, X_WA, X_WB, signed distance, nhat_AB_W
CASES = {
    "boxes apart": (Box((1, 1, 1)), Box((1, 1, 1)), pose(), pose((1.5, 0.1, 0.2)), 0.5, (1, 0, 0)),
    "boxes overlapping": (Box((1, 1, 1)), Box((1, 1, 1)), pose(), pose((0.75, 0.1, 0.2)), -0.25, (1, 0, 0)),
    "sphere capsule": (Sphere(0.3), Capsule(0.2, 1.0), pose(), pose((1, 0, 0.2)), 0.5, (1, 0, 0)),
    "sphere in capsule": (Sphere(0.3), Capsule(0.2, 1.0), pose(), pose((0.4, 0, 0.2)), -0.1, (1, 0, 0)),
    "half-space box": (Halfspace((0, 0, 1), 0), Box((1, 1, 1)), pose(), TILTED, 2 - math.sqrt(0.5), (0, 0, 1)),
    "half-space sphere": (Halfspace((0, 0, 2), 1), Sphere(0.25), pose(), pose((3, 4, 0.5)), -0.25, (0, 0, 1)),
    "cylinder box": (Cylinder(0.5, 2), Box((1, 1, 1)), pose(), pose((0, 0, 1.75)), 0.25, (0, 0, 1)),
    "cone sphere": (Cone(0.5, 1), Sphere(0.5), pose(), pose((0, 0, 2)), 1.0, (0, 0, 1)),
    "ellipsoid sphere": (Ellipsoid((1, 2, 3)), Sphere(0.5), pose(), pose((0, 0, 4)), 0.5, (0, 0, 1)),
    "hull box": (ConvexHull(CUBE), Box((1, 1, 1)), pose(), pose((1.5, 0.1, 0.2)), 0.5, (1, 0, 0)),
    "swept hull": (ConvexHull(CUBE, radius=0.25), Sphere(0.25), pose(), pose((0, 2, 0)), 1.0, (0, 1, 0)),
    "polytope box": (UNIT, Box((1, 1, 1)), pose(), pose((0.1, 0.2, 0.75)), -0.25, (0, 0, 1)),
    "union sphere": (L_SHAPE, Sphere(0.5), pose((1, 0, 0)), pose((1.5, 0, 3)), 1.0, (0, 0, 1)),
}
SWEPT, PLANES = {"swept hull"}, {"half-space box", "half-space sphere"}
CURVED = {"cylinder box", "cone sphere", "ellipsoid sphere"}
APART = {case for case, (*_, distance, _normal) in CASES.items() if distance > 0}
#: By name, or by the name before the colon, as the next ones: cases that the engine has no shape for.
UNSUPPORTED = {
    "collide": set(), "coal": set(), "fcl": SWEPT, "pybullet": SWEPT | {"cone sphere", "ellipsoid sphere"},
    "mujoco": SWEPT | {"cone sphere"}, "drake": SWEPT | {"cone sphere", "half-space box"},
    "drake:penetration": SWEPT | {"cone sphere"},
    "trimesh": {case for case, (A, B, *_) in CASES.items() if {type(A), type(B)} & {Sphere, Halfspace, Cylinder}},
    "rapier": {"ellipsoid sphere"}, "rapier:nonlinear": {"ellipsoid sphere"} | PLANES,
    "distance3d": PLANES, "newton": SWEPT,
    "cgal": CASES.keys() - {"boxes apart", "boxes overlapping", "hull box", "polytope box"},
    "exact": CURVED | PLANES,
}
#: Cases answered by a boolean alone.
WITHOUT_DISTANCE = {
    "fcl": PLANES, "fcl:indep": APART, "mujoco": APART, "mujoco:distance": set(), "mujoco:distance-libccd": set(),
    "drake:penetration": APART, "rapier": set(), "rapier:cast": CASES.keys() - APART,
    "rapier:nonlinear": CASES.keys() - APART, "distance3d": CASES.keys() - APART, "distance3d:epa": set(),
    "distance3d:mpr": APART, "cgal": CASES.keys(),
}
#: [m] at sizes of about 1 m. Bullet snaps hull corners to a grid; FCL and coal stop at 1e-6 on what is round; MuJoCo
#: holds corners, and trimesh's managers poses, in single precision; Rapier's points near round shapes are off by more.
TOLERANCE = {
    "collide": 1e-9, "coal": 1e-6, "fcl": 2e-5, "pybullet": 1e-3, "pybullet:margins": 3e-3, "mujoco": 2e-6,
    "drake": 2e-5, "trimesh": 2e-6, "rapier": 1e-4, "rapier:cast": 1e-3, "rapier:nonlinear": 3e-4, "exact": 1e-14,
    "distance3d": 1e-6, "distance3d:nesterov": 1e-5, "distance3d:epa": 1e-2, "distance3d:mpr": 1e-4, "newton": 1e-5,
    "cgal": 1e-14,
}
#: Distances of random pairs are off by more: depths of FCL's own EPA, MuJoCo's capsule and box, and all that libccd's
#: MPR finds, as distance3d's and Newton's, gaps of Rapier's manifolds, and what distance3d's accelerated GJK says of a
#: sphere or a capsule beside a hull or a cone: it counts the radius twice.
WRONG_DISTANCES = {
    "fcl:indep", "mujoco", "mujoco:libccd", "mujoco:distance", "mujoco:distance-libccd", "drake:penetration", "rapier",
    "distance3d:nesterov", "distance3d:mpr", "newton",
}
#: One of them is a closed form.
WRONG_CASES = {"mujoco:distance-libccd": {"polytope box"}, "distance3d:nesterov": {"cone sphere", "swept hull"}}
#: distance3d's EPA and MPR end with directions that are rougher than others'.
ROUGH_NORMALS = {"distance3d:epa": 0.2, "distance3d:mpr": 0.02}
#: Rapier's normal of a sphere whose centre lies on a plane is not the plane's.
WRONG_NORMALS = {"rapier": {"half-space sphere"}, "rapier:cast": set()}
#: Rows of random pairs without an answer: two boxes 0.39 m apart have no contact in Rapier, however far it looks;
#: distance3d's EPA raises where its 64 faces are full.
WITHOUT_CONTACT = {
    "rapier": {34}, "rapier:cast": {34}, "rapier:nonlinear": {34},
    "distance3d:epa": {31, 89, 99, 103, 110, 131, 154, 163, 166, 171, 195, 197},
}
#: Engines without some of the shapes of random pairs.
WITHOUT_SHAPES = {"trimesh", "cgal"}
#: And booleans of pairs clear of touching.
WRONG_BOOLEANS = {"mujoco:distance-libccd", "distance3d:nesterov"}


def known(by_name: dict, name: str, default=None):
    """What is written down of an engine with its setting, else of the engine."""
    return by_name.get(name, by_name.get(name.partition(":")[0], default))


def available(name: str, **options):
    peer = engine(name, **options)
    if peer.missing():
        pytest.skip(peer.missing())
    return peer


@pytest.mark.many(2)
@pytest.mark.parametrize("name", ENGINES)
def test_closed_forms(name):
    question = Question.from_pairs(case[:4] for case in CASES.values())
    table = available(name).answer(question)
    assert not table.rows["failed"].any(), table.reasons
    for k, (case, (*_, distance, normal)) in enumerate(CASES.items()):
        row = table.rows[k]
        assert row["unsupported"] == (case in known(UNSUPPORTED, name)), (case, table.reasons[k])
        assert row["answered"] != row["unsupported"]
        if row["unsupported"]:
            assert table.reasons[k]
            continue
        assert row["hit"] == (distance <= 0), case
        assert row["has_distance"] == (case not in known(WITHOUT_DISTANCE, name, ())), (case, table.reasons[k])
        if case in known(WRONG_CASES, name, ()):
            assert abs(row["distance"] - distance) > 0.1, case
        elif row["has_distance"]:
            assert row["distance"] == pytest.approx(distance, abs=known(TOLERANCE, name)), case
        if case in known(WRONG_NORMALS, name, ()):
            assert abs(row["normal"] @ normal) < 1e-6, case
        elif case not in known(WRONG_CASES, name, ()) and not np.isnan(row["normal"]).any():
            assert row["normal"] == pytest.approx(normal, abs=known(ROUGH_NORMALS, name, 3e-3)), case
            step, off = row["point_b"] - row["point_a"], known(TOLERANCE, name)
            assert np.isnan(step).all() or step == pytest.approx(row["distance"] * row["normal"], abs=off), case


@pytest.mark.many(6)
@pytest.mark.parametrize("name", ENGINES)
def test_swapping_the_bodies_negates_the_normal(name):
    cases = [CASES[c] for c in ("boxes apart", "boxes overlapping", "sphere capsule", "hull box")]
    there = available(name).answer(Question.from_pairs(c[:4] for c in cases)).rows
    back = available(name).answer(Question.from_pairs((B, A, X_WB, X_WA) for A, B, X_WA, X_WB, *_ in cases)).rows
    assert back["distance"] == pytest.approx(there["distance"], abs=known(TOLERANCE, name), nan_ok=True)
    assert back["normal"] == pytest.approx(-there["normal"], abs=3e-3, nan_ok=True)


def random_pairs(n: int, seed: int):
    """Boxes, spheres, capsules and hulls of about 1 m, about half of the pairs meeting."""
    rng = np.random.default_rng(seed)

    def shape():
        kind = rng.integers(5)
        if kind == 0:
            return Sphere(rng.uniform(0.2, 0.8))
        if kind == 1:
            return Capsule(rng.uniform(0.2, 0.5), rng.uniform(0.2, 1.0))
        if kind == 2:
            return Box(rng.uniform(0.2, 1.5, 3))
        return ConvexHull(rng.normal(size=(rng.integers(4, 20), 3)) * 0.5)

    def place():
        return pose(rng.normal(size=3) * 0.5, quat_wxyz=rng.normal(size=4))

    return Question.from_pairs((shape(), shape(), place(), place()) for _ in range(n))


@pytest.mark.many(10)
@pytest.mark.parametrize("name", [name for name in ENGINES if name != "exact"])
def test_random_pairs_agree_with_exact_arithmetic(name):
    question = random_pairs(200, seed=20)
    truth = engine("exact").answer(question).rows
    assert truth["answered"].all()
    assert 0.3 <= truth["hit"].mean() <= 0.7
    answers = available(name).answer(question)
    rows = answers.rows
    silent = known(WITHOUT_DISTANCE, name, set())
    lost = np.isin(np.arange(len(rows)), list(known(WITHOUT_CONTACT, name, ())))
    mishaps = np.array([bool(kind) for kind in answers.mishaps])
    assert (mishaps | rows["unsupported"])[lost].all() and not mishaps[~lost].any(), answers.reasons
    asked = ~lost & ~(rows["unsupported"] & (name in WITHOUT_SHAPES))
    assert asked.mean() > 0.25
    rows, truth = rows[asked], truth[asked]
    hit = rows["hit"] if name in WRONG_BOOLEANS else truth["hit"]
    told = np.where(hit, "boxes overlapping" not in silent, "boxes apart" not in silent)
    assert rows["answered"].all() and (rows["has_distance"] == told).all(), answers.reasons
    # Booleans may differ only where the truth is nearer to touching than the engine's own error.
    clear = np.abs(truth["distance"]) > known(TOLERANCE, name)
    assert clear.mean() > 0.95
    assert (rows["hit"] == truth["hit"])[clear].all() == (name not in WRONG_BOOLEANS)
    told = rows["has_distance"]
    off = np.abs(rows["distance"] - truth["distance"])[told] > known(TOLERANCE, name)
    assert off.any() == (name in WRONG_DISTANCES)
    lengths = np.linalg.norm(rows["normal"][told], axis=1)
    assert lengths[~np.isnan(lengths)] == pytest.approx(1, abs=1e-12)


def test_round_shapes_agree_with_coal():
    # Exact arithmetic has no word on these; coal is the most accurate engine that has them all.
    rng = np.random.default_rng(4)

    def shape():
        radius, length = rng.uniform(0.2, 0.6), rng.uniform(0.3, 1.0)
        kinds = Cylinder(radius, length), Cone(radius, length), Ellipsoid(rng.uniform(0.2, 0.7, 3)), Box((1, radius, 1))
        return kinds[rng.integers(4)]

    def place():
        return pose(rng.normal(size=3) * 0.45, quat_wxyz=rng.normal(size=4))

    question = Question.from_pairs((shape(), shape(), place(), place()) for _ in range(300))
    coal, ours = available("coal").answer(question).rows, engine("collide").answer(question).rows
    assert ours["answered"].all() and coal["has_distance"].all()
    assert 0.3 <= coal["hit"].mean() <= 0.7
    clear = np.abs(coal["distance"]) > 1e-5
    assert (ours["hit"] == coal["hit"])[clear].all()
    assert ours["distance"] == pytest.approx(coal["distance"], abs=1e-5)
    assert (ours["lower"] <= ours["distance"]).all() and (ours["distance"] <= ours["upper"]).all()


def test_flat_hulls_are_refused_with_a_reason_by_engines_that_want_faces():
    flat = ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0.5, 0.5, 0)])
    question = Question.from_pairs([(flat, Sphere(0.1), pose(), pose((0.5, 0.5, 1)))])
    for name in ("fcl", "coal"):
        table = available(name).answer(question)
        assert table.rows["unsupported"][0]
        assert "flat hull" in table.reasons[0]
    assert engine("exact").answer(question).rows["distance"][0] == 0.9


@pytest.mark.parametrize("thickness", [1.0, 1e-6, 1e-12])
def test_faces_of_a_hull_are_closed_and_look_outwards(thickness):
    pytest.importorskip("scipy", reason="scipy is not installed")
    rng = np.random.default_rng(3)
    points = np.vstack([CUBE, rng.uniform(-0.4, 0.4, (20, 3))]) * (1, 2, thickness)
    vertices, triangles = triangulate(points @ pose(rpy=(0.3, 0.4, 0.5))[:3, :3].T)
    edges = [(int(t[k]), int(t[k - 1])) for t in triangles for k in range(3)]
    assert len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)
    p, q, r = (vertices[triangles[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", p - vertices.mean(axis=0), np.cross(q - p, r - p)).sum() / 6
    assert volume == pytest.approx(2 * thickness, rel=1e-3)


def test_coal_hulls_with_crowded_corners_are_refused_with_a_reason():
    angle = np.linspace(0, 2 * math.pi, 300, endpoint=False)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(300)])
    disk = ConvexHull(np.vstack([rim, (0, 0, 1), (0, 0, -1)]))
    table = available("coal").answer(Question.from_pairs([(disk, Sphere(1), pose(), pose((5, 0, 0)))]))
    assert table.rows["unsupported"][0] and "neighbours" in table.reasons[0]


def test_supports_says_why_not():
    assert engine("fcl", isolated=False).supports(Box((1, 1, 1))) is None
    nested = Compound([(Compound([(Cone(1, 1), pose())]), pose())])
    assert engine("pybullet").supports(nested) == "pybullet has no Cone"
    assert "Cone" in str(engine("exact").supports(nested))


def test_unknown_engines_are_named_together_with_the_known_ones():
    with pytest.raises(InvalidArgument, match=r"no engine 'ode'; there are .*coal \(:nesterov, .*collide, "):
        engine("ode")


def test_questions_are_plain_data():
    question = Question.from_pairs(case[:4] for case in CASES.values())
    copy = pickle.loads(pickle.dumps(question))
    assert [b.shape for b in copy.bodies] == [b.shape for b in question.bodies]
    assert copy.pairs == question.pairs
    with pytest.raises(InvalidArgument, match=r"pairs\[0\]: b must be a shape, got str"):
        Question.from_pairs([(Box((1, 1, 1)), "box", pose(), pose())])


def test_boxes_of_bodies_hold_their_points():
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for shape in (Box((1, 2, 3)), Sphere(0.5), Capsule(0.3, 1), Cylinder(0.5, 2), Ellipsoid((1, 2, 3)), L_SHAPE):
        X = pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4))
        body = Question.from_pairs([(shape, shape, X, X)]).bodies[0]
        low, high = bounds(body)
        for part, X_WP in convex_parts(shape, X):
            points = surface(part, directions) @ X_WP[:3, :3].T + X_WP[:3, 3]
            assert (points >= low - 1e-12).all() and (points <= high + 1e-12).all()
        assert (high - low < 8).all()


def surface(part, directions):
    """Points of a shape's surface, one per direction."""
    if isinstance(part, Ellipsoid):
        return directions * part.radii
    if isinstance(part, Cylinder):
        radial = directions[:, :2] / np.linalg.norm(directions[:, :2], axis=1)[:, None] * part.radius
        return np.column_stack([radial, np.sign(directions[:, 2]) * part.length / 2])
    points, radius = corners(part)
    return points[np.argmax(directions @ points.T, axis=1)] + directions * radius


def test_settings_are_listed_under_their_engines():
    peers = {name: load_engine(spec) for name, spec in ENGINES.items()}
    for name, peer in peers.items():
        base, _, setting = name.partition(":")
        assert peer.name == name and (not setting or setting in peers[base].settings)
        listed = [other.partition(":")[2] for other in ENGINES if other.startswith(base + ":")]
        assert sorted(listed) == sorted(peers[base].settings)
        for told in (*peer.receives, *peer.cannot, peer.about):
            assert told and told == told.strip(" .") and len(told) < 120, (name, told)
        assert peer.receives, f"{name} says nothing about what it is given"
        assert set(engine(name, isolated=True).receives) == set(peer.receives)


def test_a_setting_that_is_not_there_is_named():
    with pytest.raises(InvalidArgument, match="coal has no setting 'sharp'; there are tight, nesterov"):
        load_engine("collide.adapters.peers.coal_peer:CoalPeer:sharp")


def test_importing_the_protocol_imports_no_engine():
    code = (
        "import sys, collide.adapters.peers.compare; "
        "print(sorted({'coal', 'fcl', 'pybullet', 'scipy', 'numba'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"
