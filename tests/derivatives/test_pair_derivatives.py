"""Derivatives of pairs beside differences of distances proven in 80 digits, which share no code with the engine."""

from __future__ import annotations

import pickle
from decimal import Decimal
from itertools import combinations_with_replacement

import numpy as np
import pytest
from distance_differences import slope

import collide
from collide import InvalidArgument, Uniqueness

EYE = np.eye(4)
_RNG = np.random.default_rng(20)
_NORMALS = np.concatenate([np.eye(3), -np.eye(3), [[1.0, 1.0, 1.5]]])
SHAPES = {
    "point": collide.ConvexHull([[0.1, 0.2, 0.3]]),
    "sphere": collide.Sphere(0.5),
    "capsule": collide.Capsule(0.3, 1.0),
    "box": collide.Box((1.0, 2.0, 3.0)),
    "hull": collide.ConvexHull(_RNG.normal(size=(20, 3))),
    "rounded": collide.ConvexHull(_RNG.normal(size=(8, 3)), radius=0.2),
    "planes": collide.HPolytope(_NORMALS, np.ones(7)),
    "cylinder": collide.Cylinder(0.6, 1.0),
    "cone": collide.Cone(0.6, 1.2),
    "ellipsoid": collide.Ellipsoid((0.3, 0.5, 1.0)),
    "half-space": collide.Halfspace((0.2, 0.3, 1.0), 0.1),
}
PAIRS = [pair for pair in combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")]


def random_poses(rng, n: int, spread: float) -> np.ndarray:
    """(n, 4, 4) poses turned at random, shifted by about a spread [m]."""
    quaternions = rng.normal(size=(n, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    return collide.poses(spread * rng.normal(size=(n, 3)), quat_wxyz=quaternions)


def gradient_of(r) -> np.ndarray:
    return np.concatenate([r.d_distance_A, r.d_distance_B], axis=-1)


def judge(A, B, X_WA, X_WB, g, rng, step=Decimal(2) ** -24) -> None:
    """Assert a gradient (12,) along a random change of both poses."""
    twist = rng.normal(size=12)
    told = slope(A, B, X_WA, X_WB, twist, step)
    off = abs(told.middle - g @ twist)
    scale = np.linalg.norm(g) * np.linalg.norm(twist)
    assert told.error < 1e-7 * scale, "the oracle does not know"
    assert off <= 1e-6 * scale, f"{A}, {B}, {X_WA.tolist()}, {X_WB.tolist()}, {twist.tolist()}: off by {off}"


@pytest.mark.many(3)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_gradients_are_slopes_of_exact_distances(pair):
    rng = np.random.default_rng([7, PAIRS.index(pair)])
    A, B = (SHAPES[name] for name in pair)
    X_WA, X_WB = random_poses(rng, 24, 0.2), random_poses(rng, 24, 1.0)
    X_WB[:, :3, 3] *= np.linspace(0.1, 3.0, 24)[:, None]
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    assert r.unique.mean() > 0.9 and len(set(r.hit)) == 2 - (pair == ("point", "point"))
    for k in rng.choice(np.flatnonzero(r.unique), 8, replace=False):
        judge(A, B, X_WA[k], X_WB[k], gradient_of(r[int(k)]), rng)


@pytest.mark.many(9)
@pytest.mark.parametrize("distance", [1e-6, 1e-4, -1e-7, -1e-3])
@pytest.mark.parametrize("pair", [p for p in PAIRS if "half-space" not in p and "point" not in p], ids="-".join)
def test_gradients_of_bodies_that_all_but_touch(pair, distance):
    """B moved along the normal of a gap, until bodies are apart or overlap by so little."""
    rng = np.random.default_rng([8, PAIRS.index(pair)])
    A, B = (SHAPES[name] for name in pair)
    X_WA, X_WB = random_poses(rng, 6, 0.2), random_poses(rng, 6, 4.0)
    far = collide.distance(A, B, X_WA, X_WB)
    assert not far.hit.all()
    X_WB[:, :3, 3] -= (far.distance - distance)[:, None] * far.normal
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    known = np.flatnonzero(r.unique & (r.distance * distance > 0.0) & (np.abs(r.distance) > 1e-3 * abs(distance)))
    assert len(known) >= 3
    for k in known[:3]:
        judge(A, B, X_WA[k], X_WB[k], gradient_of(r[int(k)]), rng, Decimal(abs(r.distance[k])) * Decimal(2) ** -16)


BOX, BALL = collide.Box((1, 1, 1)), collide.Sphere(0.5)
FLOOR, PEG = collide.Halfspace((0, 0, 1), 0), collide.Capsule(0.1, 0.5)
SIDEWAYS = collide.pose((0, 0, 1), rpy=(np.pi / 2, 0, 0))
POINTS, PARTS = Uniqueness.SEVERAL_POINTS, Uniqueness.SEVERAL_PARTS
#: Pairs without a derivative: shapes, pose of B, why, and how many active gradients.
NOT_UNIQUE = {
    "faces": (BOX, BOX, collide.pose((0.2, 0, 1.5)), POINTS, 4),
    "edges": (BOX, BOX, collide.pose((1.5, 0.1, 1.5)), POINTS, 2),
    "an edge and a face": (BOX, BOX, collide.pose((0, 0, 2), rpy=(np.pi / 4, 0, 0)), POINTS, 2),
    "capsule on a face": (BOX, PEG, SIDEWAYS, POINTS, 2),
    "capsules": (PEG, collide.Capsule(0.1, 1), collide.pose((1, 0, 0)), POINTS, 2),
    "a cylinder that lies": (FLOOR, collide.Cylinder(0.5, 1), SIDEWAYS, POINTS, 2),
    "a cylinder that stands": (BOX, collide.Cylinder(0.25, 1), collide.pose((0, 0, 2)), POINTS, 32),
    "mesh and box": (
        collide.Mesh(*collide.tessellate(BOX)), BOX, collide.pose((0.2, 0, 1.5)), PARTS, 4,
    ),
    "between two": (
        collide.Compound([(BOX, collide.pose((-2, 0, 0))), (BOX, collide.pose((2, 0, 0)))]), BALL, EYE,
        PARTS, 2,
    ),
}


@pytest.mark.parametrize("name", NOT_UNIQUE)
def test_no_number_where_there_is_no_derivative(name):
    """The distance falls along any change of the poses as the least of the active gradients does."""
    A, B, X_WB, why, count = NOT_UNIQUE[name]
    r = collide.distance(A, B, EYE, X_WB, derivatives=True)
    assert not r.unique and r.uniqueness is why
    for field in ("d_distance_A", "d_distance_B", "d_point_a_A", "d_normal_B", "d2_distance"):
        assert np.isnan(getattr(r, field)).all()
    corners, rng = r.active_gradients(), np.random.default_rng(9)
    assert count <= len(corners) <= count + 2
    kinks = 0
    for _ in range(6):
        twist = rng.normal(size=12)
        told = slope(A, B, EYE, X_WB, twist, Decimal(2) ** -30)
        least, most = (corners @ twist).min(), (corners @ twist).max()
        off = 1e-6 + 0.02 * (most - least) * (count == 32)  # of a rim some corners are told
        assert abs(told.after - least) <= off and abs(told.before - most) <= off, twist.tolist()
        kinks += most - least > 1e-3
    assert kinks >= 3


@pytest.mark.parametrize(
    ("A", "B", "normals"),
    [(BALL, PEG, 8), (BOX, BALL, 6), (BOX, collide.Box((2, 2, 2)), 6), (BOX, collide.Box((2, 2, 3)), 4)],
)
def test_directions_that_are_as_short(A, B, normals):
    """At the middle of each other bodies part along several directions, all of which are told."""
    r = collide.distance(A, B, EYE, EYE, derivatives=True)
    assert not r.unique and np.isnan(r.d_distance_A).all()
    pushes = r.active_gradients()[:, 9:].round(6)
    assert len(np.unique(pushes + 0.0, axis=0)) == normals
    # A little off the middle a direction is the shortest.
    off = collide.distance(A, B, EYE, collide.pose((0.01, 0.004, -0.003)), derivatives=True)
    assert off.unique or off.uniqueness is Uniqueness.SEVERAL_POINTS


@pytest.mark.many(3)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_second_derivatives_and_motions_of_points(pair):
    rng = np.random.default_rng([10, PAIRS.index(pair)])
    A, B = (SHAPES[name] for name in pair)
    X_WA, X_WB = random_poses(rng, 12, 0.2), random_poses(rng, 12, 1.5)
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    H, h = r.d2_distance, 1e-5
    known = np.flatnonzero(~np.isnan(H).any(axis=(1, 2)))
    assert len(known) >= 10 and np.array_equal(H[known], H[known].transpose(0, 2, 1))
    step, judged = Decimal(2) ** -22, 0
    for k in known[:3]:
        twist = rng.normal(size=12)
        told = slope(A, B, X_WA[k], X_WB[k], twist, step)
        second = (told.after - told.before) / float(step)
        scale = 1.0 + np.abs(H[k]).max()
        case = X_WA[k].tolist(), X_WB[k].tolist(), twist.tolist()
        if abs(told.error) < 1e-12:
            assert abs(second - twist @ H[k] @ twist) <= 1e-4 * scale * (twist @ twist), case
            judged += 1
        ends = [
            collide.distance(A, B, turned(X_WA[k], s * h * twist[:6]), turned(X_WB[k], s * h * twist[6:]))
            for s in (-1, 1)
        ]
        for name in ("point_a", "point_b", "normal") if "planes" not in pair else ():  # its corners are rounded
            moved = (getattr(ends[1], name) - getattr(ends[0], name)) / (2 * h)
            by_poses = np.concatenate([getattr(r[int(k)], f"d_{name}_{body}") for body in "AB"], axis=1)
            off = np.abs(moved - by_poses @ twist).max()
            assert off <= 1e-4 * (1.0 + np.abs(by_poses).max()) * (twist @ twist), (name, *case)
    assert judged or "ellipsoid" in pair


def turned(X: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """A pose after a turn by the first three numbers, about its origin, and a shift by the others."""
    out, angle = X.copy(), np.linalg.norm(twist[:3])
    x, y, z = twist[:3] / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out[:3, :3] = (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K) @ X[:3, :3]
    out[:3, 3] += twist[3:]
    return out


# --- unions -------------------------------------------------------------------------------------


def _unions():
    rng = np.random.default_rng(11)
    hull = collide.ConvexHull(0.5 * rng.normal(size=(15, 3)))
    mesh = collide.Mesh(*collide.tessellate(hull))
    item = lambda: random_poses(rng, 1, 1.0)[0]
    several = collide.Compound([(collide.Box((1, 0.8, 1.2)), item()), (BALL, item()), (SHAPES["cylinder"], item())])
    both = collide.Compound([(mesh, item()), (hull, item())])
    return {"mesh": mesh, "compound": several, "compound of a mesh": both, "hull": hull, **SHAPES}


UNIONS = _unions()


@pytest.mark.parametrize(
    ("a", "b"),
    [("mesh", "box"), ("mesh", "mesh"), ("mesh", "cylinder"), ("compound", "compound"), ("compound", "hull"),
     ("compound of a mesh", "capsule"), ("half-space", "mesh"), ("half-space", "compound")],
)  # fmt: skip
def test_gradients_of_unions(a, b):
    rng = np.random.default_rng(12)
    A, B = UNIONS[a], UNIONS[b]
    X_WA, X_WB = random_poses(rng, 12, 0.2), random_poses(rng, 12, 2.0)
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    known = np.flatnonzero(r.unique & (~r.hit | (a == "half-space")))
    assert len(known) >= 4 and not np.isnan(gradient_of(r)[known]).any()
    assert set(np.unique(r.uniqueness[~r.unique])) <= {Uniqueness.NOT_CONVEX, Uniqueness.UNCERTAIN}
    for k in known[:6]:
        judge(A, B, X_WA[k], X_WB[k], gradient_of(r[int(k)]), rng)


def test_gradients_of_clouds_are_those_of_their_balls():
    rng = np.random.default_rng(13)
    points = rng.normal(size=(60, 3))
    cloud = collide.PointCloud(points, radius=0.05)
    balls = collide.Compound([(collide.Sphere(0.05), collide.pose(p)) for p in points])
    swept = collide.SweptMesh(UNIONS["mesh"], 0.1)
    X = random_poses(rng, 12, 3.0)
    one, other = (collide.distance(shape, BOX, EYE, X, derivatives=True) for shape in (cloud, balls))
    known = one.unique & other.unique
    assert known.sum() >= 6 and np.abs(gradient_of(one) - gradient_of(other))[known].max() < 1e-12
    apart = collide.distance(swept, BOX, EYE, X, derivatives=True)
    bare = collide.distance(UNIONS["mesh"], BOX, EYE, X, derivatives=True)
    known = apart.unique & bare.unique & ~apart.hit
    assert known.sum() >= 6 and np.abs(gradient_of(apart) - gradient_of(bare))[known].max() < 1e-12


def test_a_ball_in_a_solid_mesh():
    """Nearest to a face, and as near to two."""
    mesh = collide.Mesh(*collide.tessellate(BOX))
    ball = collide.Sphere(0.1)
    r = collide.distance(mesh, ball, EYE, collide.pose((0.3, 0.1, 0)), derivatives=True)
    assert r.unique and np.allclose(gradient_of(r), [0, 0, 0.1, -1, 0, 0, 0, 0, 0, 1, 0, 0], atol=1e-12)
    r = collide.distance(mesh, ball, EYE, collide.pose((0.3, 0.3, 0)), derivatives=True)
    assert r.uniqueness is Uniqueness.SEVERAL_DIRECTIONS and np.isnan(r.d_distance_B).all()


# --- the answer ---------------------------------------------------------------------------------


def test_answers_are_the_same_with_derivatives_and_without():
    rng = np.random.default_rng(14)
    X_WA, X_WB = random_poses(rng, 300, 0.3), random_poses(rng, 300, 1.0)
    shapes = [SHAPES[name] for name in rng.choice([*SHAPES][:-1], 300)]
    batch = collide.distance(shapes, shapes[::-1], X_WA, X_WB, derivatives=True)
    assert batch.rows.tobytes() == collide.distance(shapes, shapes[::-1], X_WA, X_WB).rows.tobytes()
    for k in range(0, 300, 17):
        one = collide.distance(shapes[k], shapes[::-1][k], X_WA[k], X_WB[k], derivatives=True)
        assert one.is_single and one.unique == batch[k].unique == batch[k : k + 2][0].unique
        for name in ("d_distance_A", "d_distance_B", "d_normal_A", "d_point_b_B", "d2_distance"):
            assert np.array_equal(getattr(one, name), getattr(batch, name)[k], equal_nan=True), (k, name)
            assert np.array_equal(getattr(one, name), getattr(batch[k], name), equal_nan=True)
        assert np.array_equal(one.active_gradients(), batch.active_gradients(k))
    again = pickle.loads(pickle.dumps(batch))
    assert np.array_equal(again.d_distance_A, batch.d_distance_A, equal_nan=True) and len(again) == 300


def test_what_rows_do_not_tell():
    near, far = collide.pose((0.2, 0, 0)), collide.pose((9, 0, 0))
    assert collide.distance(BALL, BALL, EYE, far, max_distance=1.0, derivatives=True).uniqueness is Uniqueness.TOO_FAR
    assert collide.distance(BALL, BALL, EYE, near, signed=False, derivatives=True).uniqueness is Uniqueness.NO_DEPTH
    both = collide.Compound([(BOX, near), (BOX, far)])
    r = collide.distance(both, BOX, EYE, EYE, derivatives=True)
    assert not r.unique and r.active_gradients().shape == (0, 12)
    region = collide.HPolytope([[0, 0, 1.0]], [0.0], bounded=False)
    assert collide.distance(region, BOX, EYE, far, derivatives=True).uniqueness is Uniqueness.NOT_CONVEX


def test_bad_input():
    with pytest.raises(InvalidArgument, match="derivatives"):
        collide.distance(BALL, BOX, EYE, EYE, derivatives="yes")
    r = collide.distance(BALL, BOX, EYE, collide.pose((3, 0, 0)), derivatives=True)
    with pytest.raises(IndexError, match="results 0"):
        r.active_gradients(1)
    with pytest.raises(InvalidArgument, match="number of a result"):
        r.active_gradients("first")
    assert "unique" in f"{r.uniqueness}" and r.uniqueness.meaning.startswith("the distance has")
