"""Bodies at rest on the manifolds of `collide.World.contacts`, for seconds of simulated time (`stepper.py`).

Where the bodies come from and what may happen on the way is bounded by mechanics: energy is never more than at the
start, and a contact under load sinks into its spring by load / mass as it feels it / ω². Of the last seconds the test
asks that the same contacts, known by their features alone, are there in every step, in the same places, with the same
normals, and that bodies neither move nor creep. All bounds are stated where they are used.
"""

from __future__ import annotations

import numpy as np
import pytest
from contact_scenes import table
from mesh_shapes import box
from stepper import GRAVITY, HERTZ, Step, Stepper

import collide

EYE = np.eye(4)
FLOOR, X_FLOOR = collide.Box((4, 4, 0.5)), collide.pose((0, 0, -0.25))
PLANE = collide.Halfspace((0, 0, 1), 0.0)
MESH = collide.Mesh(*table(6))  # facets of a third of a metre
OMEGA = 2 * np.pi * HERTZ


def box_inertia(mass, size):
    x, y, z = np.square(size)
    return mass / 12 * np.array([y + z, x + z, x + y])


def rod_inertia(mass, radius, length):
    across = mass * (3 * radius**2 + length**2) / 12
    return np.array([across, across, mass * radius**2 / 2])


def run(stepper: Stepper, seconds: float) -> list[Step]:
    """All steps; energy never rises above what there was, springs giving back what they were given, or less, but for
    the error of a substep of free fall: m (g h)² a body."""
    start = stepper.energy()
    steps = [stepper.step() for _ in range(round(seconds / stepper.dt))]
    highest = max(step.energy for step in steps)
    assert highest <= start + stepper.mass.sum() * (9.81 * stepper.dt / stepper.substeps) ** 2, (start, highest)
    return steps


def check_steady(steps: list[Step], speed=1e-4, moved=1e-5, places=1e-5) -> None:
    """The same contacts in all of these steps, in the same places but for ``places`` [m] a step; bodies stay.

    speed : no body is faster [m/s, rad/s].   moved : nor moves or turns farther from first to last [m, rad].
    """
    first, last = steps[0], steps[-1]
    assert len(first.keys) == len(set(first.keys)) > 0, first.keys
    before = first
    for number, step in enumerate(steps):
        came, went = set(step.keys) - set(before.keys), set(before.keys) - set(step.keys)
        assert not came and not went, f"step {number} of {len(steps)}: {came} came, {went} went"
        rows, old = step.contacts, before.contacts[[before.keys.index(key) for key in step.keys]]
        for field, most in (("point_a", places), ("point_b", places), ("normal", 1e-4)):
            change = np.abs(rows[field] - old[field]).max()
            assert change <= most, f"step {number} of {len(steps)}: {field} jumps by {change:.2g}"
        assert np.abs(step.V).max() <= speed, f"step {number} of {len(steps)}: {np.abs(step.V).max():.2g} m/s"
        before = step
    assert np.abs(last.X - first.X).max() <= moved, np.abs(last.X - first.X).max()


def sag(load: float, contacts: int, inverse_mass: float) -> float:
    """How far contacts sink [m] that share a load [N]: the spring of `stepper.spring` at rest.

    inverse_mass : of the bodies as a contact feels them, along its normal [1/kg].
    """
    return load / contacts * inverse_mass / OMEGA**2


@pytest.mark.slow
@pytest.mark.parametrize(("turned", "seconds", "rest"), [(0.3, 6.0, 1.5), (0.0, 7.0, 1.5)], ids=["turned", "in line"])
def test_a_stack_of_ten_boxes(turned, seconds, rest):
    """Boxes turned against each other rest on up to 8 corners each; equal ones in line on 4, each at an edge or a
    vertex of the other, which takes longer to find its rest."""
    rng = np.random.default_rng(3)
    size, n = (0.4, 0.3, 0.2), 10
    stepper = Stepper()
    stepper.add(FLOOR, X_FLOOR)
    for k in range(n):
        x, y, yaw = rng.uniform(-1, 1, 3) * (0.07 * turned, 0.07 * turned, turned)
        X = collide.pose((x, y, size[2] * (k + 0.5)), rpy=(0, 0, yaw))
        stepper.add(collide.Box(size), X, 1.0, box_inertia(1, size))
    start = stepper.X.copy()
    steps = run(stepper, seconds)
    last = steps[-round(rest / stepper.dt) :]
    check_steady(last, speed=2e-3, moved=1e-4, places=3e-5)
    # A corner of a box of these sides feels 1/m + r²/I = (1 + 3 + 3)/m at most; two boxes meet there.
    deepest = -min(step.contacts["distance"].min() for step in last)
    assert deepest <= sag(n * 9.81, 4, 14.0), deepest
    moved = np.abs(stepper.X - start)[:, :3, 3].max(axis=0)
    # From no impulses at all it leans while it finds them, by less than a hundredth of its height.
    assert moved[2] <= n * sag(n * 9.81, 4, 14.0) and moved[:2].max() < 0.01 * n * size[2], moved
    assert {(a, b) for a, b, *_ in steps[-1].keys} == {(k, k + 1) for k in range(n)}


def incline(angle):
    """A plane that falls along x, and the pose of a frame on it."""
    normal = np.array([np.sin(angle), 0, np.cos(angle)])
    return collide.Halfspace(normal, 0.0), collide.pose((0, 0, 0), rpy=(0, angle, 0))


def test_a_box_slides_down_a_slope_and_stops():
    """Coulomb: with g sin on the way and μ g cos against it, after v²/2 over the difference."""
    angle, speed, size = 0.3, 1.0, (0.3, 0.2, 0.1)
    plane, X_WP = incline(angle)
    stepper = Stepper(friction=0.5)
    stepper.add(plane, EYE)
    X_WB = X_WP @ collide.pose((0, 0, 0.05), rpy=(0, 0, 0.4))
    downhill = X_WP[:3, 0]
    body = stepper.add(collide.Box(size), X_WB, 1.0, box_inertia(1, size), [*(speed * downhill), 0, 0, 0])
    steps = run(stepper, 6.0)
    slid = (stepper.X[body, :3, 3] - X_WB[:3, 3]) @ X_WP[:3, :3]
    wanted = speed**2 / (2 * 9.81 * (0.5 * np.cos(angle) - np.sin(angle)))
    # Stepping is off by a substep's speed once, and the box may turn a little, as more weight is on its lower edge.
    assert abs(slid[0] - wanted) < 0.02 * wanted and abs(slid[1]) < 0.02 * wanted, (slid, wanted)
    check_steady(steps[-240:])
    assert len(steps[-1].keys) == 4


@pytest.mark.parametrize("ground", [(PLANE, EYE), (FLOOR, X_FLOOR)], ids=["plane", "box"])
def test_a_tilted_box_falls_slides_and_stops(ground):
    """From its lowest corner it comes to lie on a face, slides, and stops, its energy spent."""
    size = (0.3, 0.2, 0.1)
    stepper = Stepper(friction=0.5, margin=0.01)
    stepper.add(*ground)
    X_WB = collide.pose((-0.5, 0, 0.12), rpy=(0.3, 0.2, 0.5))
    body = stepper.add(collide.Box(size), X_WB, 1.0, box_inertia(1, size), [1.0, 0.2, 0, 0, 0, 0])
    steps = run(stepper, 6.0)
    assert abs(stepper.X[body, 2, 2]) > 1 - 1e-6 and abs(stepper.X[body, 2, 3] - 0.05) < 1e-3
    slid = np.linalg.norm(stepper.X[body, :2, 3] - X_WB[:2, 3])
    assert 0.03 < slid < 1.04 / (2 * 9.81 * 0.5) + 0.1, slid  # v²/2μg, and what it tumbles
    check_steady(steps[-300:])
    assert len(steps[-1].keys) == 4
    resting = GRAVITY[2] * -stepper.X[body, 2, 3]
    assert abs(stepper.energy() - resting) < 1e-6


ROUND = {
    "cylinder": (collide.Cylinder(0.1, 0.5), rod_inertia(1, 0.1, 0.5)),
    "capsule": (collide.Capsule(0.1, 0.5), rod_inertia(1, 0.1, 0.6)),
}


@pytest.mark.many(3)
@pytest.mark.parametrize("ground", [(PLANE, EYE), (FLOOR, X_FLOOR), (MESH, EYE)], ids=["plane", "box", "mesh"])
@pytest.mark.parametrize("name", list(ROUND))
def test_round_bodies_lie_on_their_sides(name, ground):
    """Two contacts, the ends of the line; nothing makes it roll."""
    shape, inertia = ROUND[name]
    stepper = Stepper()
    stepper.add(*ground)
    body = stepper.add(shape, collide.pose((0, 0, 0.1), rpy=(np.pi / 2, 0, 0.3)), 1.0, inertia)
    start = stepper.X[body].copy()
    steps = run(stepper, 6.0)
    check_steady(steps, speed=0.1, moved=1e-3, places=1e-3)  # from the first step on
    check_steady(steps[60:], speed=1e-6, moved=1e-6, places=1e-6)
    ends = steps[-1].contacts["point_b"]
    assert len(ends) == 2 and abs(np.linalg.norm(ends[1] - ends[0]) - 0.5) < 1e-6
    # An end of a thin rod feels 1/m + (L/2)²/(m L²/12) = 4/m.
    assert np.abs(stepper.X[body] - start)[:3, 3].max() <= sag(9.81, 2, 4.0)


@pytest.mark.many(2)
@pytest.mark.parametrize("ground", [(PLANE, EYE), (FLOOR, X_FLOOR)], ids=["plane", "box"])
@pytest.mark.parametrize("tilt", [0.0, 0.05])
def test_a_cylinder_stands(ground, tilt):
    """On eight corners of its rim, which do not go around as the tilt becomes one of rounding."""
    stepper = Stepper(margin=0.01)
    stepper.add(*ground)
    shape, inertia = ROUND["cylinder"]
    X_WB = collide.pose((0, 0, 0.25 + 0.1 * np.sin(tilt)), rpy=(tilt, 0.4 * tilt, 0.3))
    body = stepper.add(shape, X_WB, 1.0, inertia)
    steps = run(stepper, 6.0)
    check_steady(steps[-60:], speed=1e-6, moved=1e-6, places=1e-6)
    assert len(steps[-1].keys) == 8 and stepper.X[body, 2, 2] > 1 - 1e-9
    assert abs(stepper.X[body, 2, 3] - 0.25) < 1e-4


def test_a_prism_of_twelve_sides_rests_on_all_its_corners():
    """Dropped, tilted; with fewer contacts than corners it would never rest: the deepest are others in every step."""
    angles = 2 * np.pi * np.arange(12) / 12
    ring = 0.15 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    prism = collide.ConvexHull(np.concatenate([np.column_stack([ring, np.full(12, z)]) for z in (-0.1, 0.1)]))
    stepper = Stepper(margin=0.01, max_contacts=12)
    stepper.add(FLOOR, X_FLOOR)
    stepper.add(prism, collide.pose((0, 0, 0.103), rpy=(0.02, 0.01, 0.3)), 1.0, rod_inertia(1, 0.15, 0.2))
    steps = run(stepper, 6.0)
    check_steady(steps[-240:], speed=1e-6, moved=1e-6, places=1e-6)
    assert len(steps[-1].keys) == 12


@pytest.mark.slow
@pytest.mark.parametrize("cells", [1, 5])
@pytest.mark.parametrize("is_mesh", [False, True])
def test_a_body_rests_on_a_mesh(cells, is_mesh):
    """A box, and a cube of 12 facets, over the edges within a flat floor of 2 and of 50 facets."""
    size = (0.5, 0.4, 0.3)
    shape = collide.Mesh(*box(-0.5 * np.array(size), 0.5 * np.array(size))) if is_mesh else collide.Box(size)
    stepper = Stepper()
    stepper.add(collide.Mesh(*table(cells)), EYE)
    body = stepper.add(shape, collide.pose((0.03, 0.02, 0.15), rpy=(0, 0, 0.2)), 2.0, box_inertia(2, size))
    steps = run(stepper, 6.0)
    check_steady(steps[60:], speed=1e-5, moved=1e-6, places=1e-6)
    assert np.abs(steps[-1].contacts["normal"] - (0, 0, 1)).max() < 1e-6
    assert abs(stepper.X[body, 2, 3] - 0.15) < sag(2 * 9.81, 4, 7.0)


@pytest.mark.many(2)
@pytest.mark.parametrize("floor", ["two triangles", "solid", "wide"])
def test_a_box_slides_over_inner_edges_as_over_a_plane(floor):
    """No ghost contacts: without friction a box crosses edges within a flat floor at the speed that it had, straight,
    level, and without turning; with friction it stops where it would on a plane."""
    vertices, faces = table(1 if floor != "wide" else 7, size=4.0)
    ground = collide.Mesh(vertices, faces)
    if floor == "two triangles":
        ground = collide.Mesh([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2), (0, 2, 3)], solid=False)
    size = (0.3, 0.2, 0.1)
    for friction in (0.0, 0.3):
        stepper = Stepper(friction=friction)
        stepper.add(ground, EYE)
        start, velocity = collide.pose((-0.6, 0.4, 0.05), rpy=(0, 0, 0.3)), np.array([1.0, -0.5, 0, 0, 0, 0])
        body = stepper.add(collide.Box(size), start, 1.0, box_inertia(1, size), velocity)
        steps = run(stepper, 1.0)
        along = velocity[:3] / np.linalg.norm(velocity)
        for step in steps:
            tilt = np.abs(step.contacts["normal"] - (0, 0, 1)).max()  # normals are the floor's, or of the box's face
            assert tilt < 1e-3, step.contacts
            if friction == 0.0:
                assert np.abs(step.V[body] - velocity).max() < 5e-3, step.V[body]
            assert abs(step.V[body, 2]) < 0.05 and np.abs(step.V[body, 3:5]).max() < 0.3, step.V[body]
        path = stepper.X[body, :3, 3] - start[:3, 3]
        assert np.linalg.norm(path[:2] - (path @ along) * along[:2]) < 2e-3, path
        if friction > 0.0:
            assert abs(path @ along - 1.25 / (2 * 9.81 * friction)) < 5e-3, path
    assert len(steps[-1].keys) >= 4
