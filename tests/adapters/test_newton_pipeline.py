"""Contacts of collide in Newton's buffers: what they say, and bodies that fall and rest on them.

Separations are judged by closed forms where bodies stand, and by Newton's own pipeline where it has closed forms.
Skipped where newton is not installed.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import collide
from collide.adapters.hosts.newton import Pipeline
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery

newton = pytest.importorskip("newton", reason="newton is not installed: pip install 'collide-robotics[newton]'")
wp = pytest.importorskip("warp")
wp.config.quiet = True
CORNERS = np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.3, 0.3) for z in (-0.1, 0.1)], dtype=np.float32)
FACETS = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
HALF = np.array([0.2, 0.3, 0.1])


def quaternion(random: np.random.Generator) -> np.ndarray:
    q = random.normal(size=4)
    return q / np.linalg.norm(q)


def rotation(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def add(builder, kind: str, place, q, **config) -> None:
    body = builder.add_body(xform=wp.transform(wp.vec3(*place), wp.quat(*q)))
    frame = wp.transform(wp.vec3(0.05, -0.1, 0.02), wp.quat(0.5, 0.5, 0.5, 0.5))
    cfg = newton.ModelBuilder.ShapeConfig(**config)
    if kind == "box":
        builder.add_shape_box(body, xform=frame, hx=0.2, hy=0.3, hz=0.1, cfg=cfg)
    elif kind == "sphere":
        builder.add_shape_sphere(body, xform=frame, radius=0.15, cfg=cfg)
    elif kind == "capsule":
        builder.add_shape_capsule(body, xform=frame, radius=0.1, half_height=0.2, cfg=cfg)
    elif kind == "mesh":
        builder.add_shape_mesh(body, xform=frame, mesh=newton.Mesh(CORNERS, FACETS), cfg=cfg)
    else:
        builder.add_shape_convex_hull(body, xform=frame, mesh=newton.Mesh(CORNERS, FACETS), cfg=cfg)


FRAME_R = rotation(np.array([0.5, 0.5, 0.5, 0.5]))
FRAME_T = np.array([0.05, -0.1, 0.02])


def lowest(kind: str, place: np.ndarray, q: np.ndarray) -> float:
    """Height of a body's lowest point."""
    R, t = rotation(q) @ FRAME_R, place + rotation(q) @ FRAME_T
    if kind == "sphere":
        return t[2] - 0.15
    if kind == "capsule":
        return t[2] - 0.2 * abs(R[2, 2]) - 0.1
    return t[2] - np.abs(R[2]) @ HALF


def separations(model, contacts, state) -> np.ndarray:
    """As Newton works them out."""
    out = wp.zeros(len(contacts.rigid_contact_shape0), dtype=float, device="cpu")
    newton.eval_rigid_contact_kinematics(model, state, contacts, out_distance=out)
    return out.numpy()[: int(contacts.rigid_contact_count.numpy()[0])].astype(np.float64)


@pytest.mark.parametrize("kind", ["box", "sphere", "capsule", "mesh", "convex"])
@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_separations_from_the_ground_are_those_of_closed_forms(kind, margin):
    random = np.random.default_rng(3)
    within = 0
    for _ in range(12):
        place, q = random.uniform([-1, -1, 0.1], [1, 1, 0.6]), quaternion(random)
        builder = newton.ModelBuilder()
        builder.add_ground_plane()
        add(builder, kind, place, q, margin=margin, gap=0.05)
        model = builder.finalize(device="cpu")
        pipeline, state = Pipeline(model), model.state()
        contacts = pipeline.contacts()
        pipeline.collide(state, contacts)
        room = float(model.shape_gap.numpy().sum())
        height = lowest(kind, place, q) - margin
        n = int(contacts.rigid_contact_count.numpy()[0])
        assert (n > 0) == (height <= room), (height, room)
        if n:
            found = separations(model, contacts, state)
            assert abs(found.min() - height) < 1e-6 and found.max() <= room + 1e-6
            assert set(contacts.rigid_contact_shape0.numpy()[:n]) == {0}
            assert np.allclose(contacts.rigid_contact_normal.numpy()[:n], [0, 0, 1])
            within += 1
    assert within >= 4


def test_balls_have_the_separations_of_newtons_own_pipeline():
    random = np.random.default_rng(5)
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    for _ in range(40):
        add(builder, "sphere", random.uniform(0, 1, 3), quaternion(random))
    model = builder.finalize(device="cpu")
    state, answers = model.state(), []
    for pipeline in (Pipeline(model), newton.CollisionPipeline(model)):
        contacts = pipeline.contacts()
        pipeline.collide(state, contacts)
        n = int(contacts.rigid_contact_count.numpy()[0])
        pairs = zip(
            contacts.rigid_contact_shape0.numpy()[:n].tolist(), contacts.rigid_contact_shape1.numpy()[:n].tolist()
        )
        answers.append(
            {tuple(sorted(pair)): gap for pair, gap in zip(pairs, separations(model, contacts, state).tolist())}
        )
    assert answers[0].keys() == answers[1].keys() and len(answers[0]) > 60
    assert max(abs(answers[0][pair] - answers[1][pair]) for pair in answers[0]) < 1e-6


def test_bodies_fall_and_rest_on_our_contacts():
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    upright = (0.0, 0.0, 0.0, 1.0)
    for k, kind in enumerate(("box", "convex", "capsule", "mesh", "sphere")):
        add(builder, kind, (2.0 * k, 0.0, 0.6), upright, mu=1.0)
    model = builder.finalize(device="cpu")
    heights = {}
    for pipeline in (Pipeline(model), newton.CollisionPipeline(model)):
        before, after, control = model.state(), model.state(), model.control()
        contacts, solver = pipeline.contacts(), newton.solvers.SolverXPBD(model, iterations=8)
        for _ in range(400):
            before.clear_forces()
            pipeline.collide(before, contacts)
            solver.step(before, after, control, contacts, 1 / 200)
            before, after = after, before
        heights[type(pipeline)] = before.body_q.numpy()[:, 2]
        if isinstance(pipeline, Pipeline):
            pipeline.collide(before, contacts)
            assert np.abs(before.body_qd.numpy()[[0, 1, 3]]).max() < 0.02  # what lies on a face
            assert separations(model, contacts, before).min() > -2e-3
    ours, theirs = heights.values()
    assert np.abs(ours - theirs)[[0, 1, 4]].max() < 2e-3


def test_pairs_are_those_of_the_model():
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    for k in range(4):
        add(builder, "box", (0.05 * k, 0, 0.2), (0, 0, 0, 1), collision_group=(1, 1, 2, -1)[k])
    builder.shape_collision_filter_pairs.append((1, 2))
    builder.add_shape_box(0, hx=0.2, hy=0.2, hz=0.2, cfg=newton.ModelBuilder.ShapeConfig(has_shape_collision=False))
    model = builder.finalize(device="cpu")
    pipeline = Pipeline(model)
    contacts = pipeline.contacts()
    pipeline.collide(model.state(), contacts)
    n = int(contacts.rigid_contact_count.numpy()[0])
    shapes = (contacts.rigid_contact_shape0.numpy()[:n].tolist(), contacts.rigid_contact_shape1.numpy()[:n].tolist())
    pairs = {tuple(sorted(pair)) for pair in zip(*shapes)}
    assert pairs == {tuple(sorted(pair)) for pair in model.shape_contact_pairs.numpy().tolist()}
    assert (1, 2) not in pairs and (1, 4) in pairs and (3, 4) in pairs and (1, 3) not in pairs
    assert len(pipeline.world) == 5


def test_height_fields_carry_balls_as_newtons_do():
    """Hills, scaled and turned about: the nearest contact of each ball is as far as in Newton's own pipeline; a ball
    that is dropped stays above.
    """
    random = np.random.default_rng(4)
    x = np.linspace(0.0, 6.0, 25)
    hills = np.sin(x)[:, None] * np.cos(0.7 * x)[None, :21]
    field = newton.Heightfield(hills, nrow=25, ncol=21, hx=2.0, hy=3.0)
    builder = newton.ModelBuilder()
    turn = wp.quat(0.0, 0.0, float(np.sin(0.4)), float(np.cos(0.4)))
    builder.add_shape_heightfield(
        xform=wp.transform(wp.vec3(0.2, -0.1, 0.3), turn), heightfield=field, scale=wp.vec3(1.5, 1.0, 0.4)
    )
    for _ in range(60):
        body = builder.add_body(xform=wp.transform(wp.vec3(*random.uniform([-2, -2, -0.2], [2, 2, 1.2])), turn))
        builder.add_shape_sphere(body, radius=0.2, cfg=newton.ModelBuilder.ShapeConfig(gap=0.1))
    model = builder.finalize(device="cpu")
    state, answers = model.state(), []
    for pipeline in (Pipeline(model), newton.CollisionPipeline(model)):
        contacts = pipeline.contacts()
        pipeline.collide(state, contacts)
        n = int(contacts.rigid_contact_count.numpy()[0])
        least: dict[int, float] = {}
        sides = (contacts.rigid_contact_shape0.numpy()[:n], contacts.rigid_contact_shape1.numpy()[:n])
        for pair, gap in zip(np.stack(sides, axis=1).tolist(), separations(model, contacts, state).tolist()):
            if 0 in pair:
                least[max(pair)] = min(gap, least.get(max(pair), np.inf))
        answers.append(least)
    ours, theirs = answers
    shared = [k for k in ours if k in theirs and min(ours[k], theirs[k]) > -0.05]
    assert len(shared) >= 10 and {k for k in theirs if theirs[k] < 0.05} <= set(ours), (ours, theirs)
    assert max(abs(ours[k] - theirs[k]) for k in shared) < 2e-3, [(k, ours[k], theirs[k]) for k in shared]


def test_arguments_of_newtons_pipeline_are_taken_or_refused_by_name():
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    add(builder, "box", (0, 0, 0), (0, 0, 0, 1))
    model = builder.finalize(device="cpu")
    for mode_of_search in ("nxn", "sap", "explicit"):
        pipeline = Pipeline(model, broad_phase=mode_of_search, soft_contact_gap=0.02, contact_matching="disabled")
        contacts = pipeline.contacts()
        pipeline.collide(model.state(), contacts, dt=0.01)
        assert int(contacts.rigid_contact_count.numpy()[0]) > 0
    none = Pipeline(model, shape_pairs_filtered=model.shape_contact_pairs[:0])
    none.collide(model.state(), contacts)
    assert int(contacts.rigid_contact_count.numpy()[0]) == 0
    for name, value in (
        ("contact_matching", "sticky"), ("speculative_contact_gap_max", 0.1), ("requires_grad", True),
        ("include_static_kinematic_pairs", False), ("contact_report", True),
    ):
        with pytest.raises(UnsupportedQuery, match=f"{name}={value!r} is not done here; .*newton.CollisionPipeline"):
            Pipeline(model, **{name: value})
    with pytest.raises(TypeError, match="no argument 'broad_fase'"):
        Pipeline(model, broad_fase="nxn")


def test_particles_have_newtons_own_contacts():
    """Particles above a box and in it, beside a box on the ground: soft contacts are Newton's, the others ours."""
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    add(builder, "box", (0, 0, 0.1), (0, 0, 0, 1))
    for place in ((0.05, -0.1, 0.3), (0.0, 0.0, 0.1), (3.0, 0.0, 0.004), (3.0, 0.0, 2.0)):
        builder.add_particle(pos=wp.vec3(*place), vel=wp.vec3(0.0, 0.0, 0.0), mass=0.1, radius=0.02)
    model = builder.finalize(device="cpu")
    state, counts = model.state(), []
    for pipeline in (Pipeline(model, soft_contact_gap=0.02), newton.CollisionPipeline(model, soft_contact_gap=0.02)):
        contacts = pipeline.contacts()
        pipeline.collide(state, contacts)
        counts.append((int(contacts.soft_contact_count.numpy()[0]), int(contacts.rigid_contact_count.numpy()[0]) > 0))
    assert counts[0] == counts[1] and counts[0][0] >= 2 and counts[0][1]


@pytest.mark.parametrize("kind", ["box", "sphere", "capsule", "convex"])
def test_planes_with_ends_are_rectangles(kind):
    """Bodies over a rectangle of half lengths 0.5 and 1 m are as far from it as from a plane; beside it is nothing."""
    random, n_met = np.random.default_rng(8), 0
    turn = quaternion(random)
    R, t = rotation(turn), np.array([0.1, 0.2, 0.3])
    for k in range(72):
        is_beside = k % 3 == 2
        place, q = np.array([0.0, random.uniform(-0.5, 0.5), random.uniform(0.12, 0.4)]), quaternion(random)
        place[0] = 1.4 if is_beside else random.uniform(-0.05, 0.05)
        height = lowest(kind, place, q)  # over the plane, in its frame
        builder = newton.ModelBuilder()
        builder.add_shape_plane(
            plane=None, xform=wp.transform(wp.vec3(*t), wp.quat(*turn)), width=0.5, length=1.0,
            cfg=newton.ModelBuilder.ShapeConfig(gap=0.0),
        )
        add(builder, kind, R @ place + t, product(turn, q), gap=0.05)
        model = builder.finalize(device="cpu")
        state, pipeline = model.state(), Pipeline(model)
        contacts = pipeline.contacts()
        pipeline.collide(state, contacts)
        gaps = separations(model, contacts, state)
        if is_beside or height > 0.05:
            assert len(gaps) == 0, (k, place, q, gaps)
        elif height > -0.02:
            assert len(gaps) and gaps.min() == pytest.approx(height, abs=2e-6), (k, place, q, gaps, height)
            n_met += 1
    assert n_met > 3, n_met


def product(p, q) -> np.ndarray:
    """Of quaternions x, y, z, w."""
    (a, s), (b, t) = (p[:3], p[3]), (q[:3], q[3])
    return np.append(s * b + t * a + np.cross(a, b), s * t - a @ b)


def test_what_goes_wrong_is_named():
    builder = newton.ModelBuilder()
    field = newton.Heightfield(data=np.zeros((3, 3), dtype=np.float32), nrow=3, ncol=3, hx=1.0, hy=1.0)
    builder.add_shape_heightfield(heightfield=field, scale=wp.vec3(1.0, 0.0, 1.0))
    add(builder, "box", (0, 0, 0), (0, 0, 0, 1))
    add(builder, "box", (0, 0, 0.1), (0, 0, 0, 1))
    model = builder.finalize(device="cpu")
    with pytest.warns(RuntimeWarning, match="shape 0 is left out: shapes of kind HFIELD"):
        pipeline = Pipeline(model, rigid_contact_max=2)
    assert list(pipeline.remaining) == [0]
    state, contacts = model.state(), pipeline.contacts()
    with pytest.raises(UnsupportedQuery, match="contacts, but there is room for 2"):
        pipeline.collide(state, contacts)
    state.body_q.numpy()[1, 0] = np.nan
    with pytest.raises(InvalidPose, match="body 1: its pose is not finite"):
        pipeline.collide(state, contacts)
    with pytest.raises(InvalidArgument, match="model must be a newton.Model, got World".replace(".", r"\.")):
        Pipeline(collide.World())


def test_the_extra_is_named_where_newton_is_missing():
    code = (
        "import sys; sys.modules['newton'] = None\n"
        "from collide.adapters.hosts.newton import Pipeline\n"
        "from collide.errors import MissingExtra\n"
        "try:\n  Pipeline(0)\nexcept MissingExtra as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install 'collide-robotics[newton]'" in done.stdout
