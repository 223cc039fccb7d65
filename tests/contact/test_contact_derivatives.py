"""Derivatives of contacts beside differences of contacts worked out in NumPy alone.

The twin of polytopes tries all separating axes for the normal, and finds a contact as a corner over a face, or as two
edges that cross, seen along the normal. Balls, capsules and cylinders have closed forms.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from naive import hull_points, random_pose, rng_of

import collide

STEP = 2e-4
NAMES = ("distance", "point_a", "point_b", "normal")


def turned(X: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """A pose turned about its own origin, and shifted."""
    phi, out = twist[:3], X.copy()
    K = np.array([[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]])
    angle = float(np.linalg.norm(phi))
    turn = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * K @ K
    out[:3, :3], out[:3, 3] = turn @ X[:3, :3], X[:3, 3] + twist[3:]
    return out


def differences(contact, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(10, 12) Richardson's differences of what ``contact(X_WA, X_WB)`` says: distance, points, normal."""
    columns = []
    for j in range(12):
        step = np.zeros(12)
        step[j] = STEP
        up, down, up2, down2 = (contact(turned(X_WA, s * step[:6]), turned(X_WB, s * step[6:])) for s in (1, -1, 2, -2))
        columns.append((8.0 * (up - down) - (up2 - down2)) / (12.0 * STEP))
    return np.array(columns).T


def told(D: collide.ContactDerivatives, k: int) -> np.ndarray:
    """(10, 12) the derivatives of row k."""
    rows = [np.hstack([getattr(D, f"d_{name}_A")[k], getattr(D, f"d_{name}_B")[k]]) for name in NAMES]
    return np.vstack(rows)


def assert_same(D, k: int, contact, X_WA: np.ndarray, X_WB: np.ndarray) -> None:
    wanted = differences(contact, X_WA, X_WB)
    assert np.abs(told(D, k) - wanted).max() <= 1e-6 * max(1.0, np.abs(wanted).max())


class Polytope:
    """Faces (corners in a plane, with its normal) and edges of a hull of few points, by all triples of points."""

    def __init__(self, points: np.ndarray):
        self.points, faces = points, {}
        for triple in combinations(range(len(points)), 3):
            p, q, r = points[list(triple)]
            n = np.cross(q - p, r - p)
            if np.linalg.norm(n) < 1e-9:
                continue
            heights = (points - p) @ (n / np.linalg.norm(n))
            for sign in (1.0, -1.0):
                if (sign * heights).max() < 1e-9:
                    on = frozenset(np.flatnonzero(np.abs(heights) < 1e-9).tolist())
                    faces[on] = sign * n / np.linalg.norm(n)
        self.normals, self.corner = np.array(list(faces.values())), [min(on) for on in faces]
        self.edges = sorted(
            {tuple(sorted(f & g)) for f, g in combinations(faces, 2) if len(f & g) == 2}
        )


class Twin:
    """Contacts of two polytopes, seen along the axis of largest separation."""

    def __init__(self, A: Polytope, B: Polytope):
        self.A, self.B, self.choice = A, B, None

    def placed(self, X_WA, X_WB):
        return [P.points @ X[:3, :3].T + X[:3, 3] for P, X in ((self.A, X_WA), (self.B, X_WB))]

    def normal(self, X_WA, X_WB) -> np.ndarray:
        a, b = self.placed(X_WA, X_WB)
        edges = [np.array([p[j] - p[i] for i, j in P.edges]) for P, p in ((self.A, a), (self.B, b))]
        crosses = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
        length = np.linalg.norm(crosses, axis=1)
        crosses = crosses[length > 1e-9] / length[length > 1e-9, None]
        axes = np.vstack([self.A.normals @ X_WA[:3, :3].T, -self.B.normals @ X_WB[:3, :3].T, crosses, -crosses])
        return axes[((axes @ b.T).min(axis=1) - (axes @ a.T).max(axis=1)).argmax()]

    def candidates(self):
        for side, (P, Q) in enumerate(((self.A, self.B), (self.B, self.A))):
            yield from ((side, k, f) for k in range(len(P.points)) for f in range(len(Q.normals)))
        yield from ((2, e, f) for e in self.A.edges for f in self.B.edges)

    def at(self, choice, X_WA, X_WB, n) -> np.ndarray:
        """(10,) distance, points and normal of a candidate; infinite where features are parallel."""
        p, (side, i, f) = self.placed(X_WA, X_WB), choice
        if side == 2:
            (a, a2), (b, b2) = p[0][list(i)], p[1][list(f)]
            M = np.column_stack([a2 - a, b - b2, n])
            if abs(np.linalg.det(M)) < 1e-9:
                return np.full(10, np.inf)
            s, t, _ = np.linalg.solve(M, b - a)
            points = [a + s * (a2 - a), b + t * (b2 - b)]
        else:
            other, X = (self.B, X_WB) if side == 0 else (self.A, X_WA)
            m, corner = X[:3, :3] @ other.normals[f], p[1 - side][other.corner[f]]
            if abs(m @ n) < 1e-9:
                return np.full(10, np.inf)
            points = [p[side][i]] * 2
            points[1 - side] = p[side][i] + (m @ (corner - p[side][i])) / (m @ n) * n
        return np.hstack([(points[1] - points[0]) @ n, *points, n])

    def following(self, row, X_WA, X_WB):
        """What works out the contact of a row at other poses."""
        wanted = np.hstack([row["distance"], row["point_a"], row["point_b"], row["normal"]])
        n = self.normal(X_WA, X_WB)
        same = [c for c in self.candidates() if np.abs(self.at(c, X_WA, X_WB, n) - wanted).max() < 1e-10]
        assert len(same) == 1
        self.choice = same[0][0]
        return lambda X, Y: self.at(same[0], X, Y, self.normal(X, Y))


def box_points(size) -> np.ndarray:
    return (np.array(list(np.ndindex(2, 2, 2))) - 0.5) * size


def nearly_flush(rng, A, B) -> tuple[np.ndarray, np.ndarray]:
    """Poses: bodies in any place, B above A or tilted, 1 cm apart or overlapping along z of A."""
    X_WA = random_pose(rng, 1.0)
    tilt = rng.normal(size=3) * float(rng.choice([0.02, 1.0]))
    X_WB = X_WA @ turned(collide.pose((0.1, 0.05, 0.0)), np.append(tilt, (0, 0, 0)))
    for _ in range(8):
        apart = collide.distance(A, B, X_WA, X_WB).distance
        X_WB[:3, 3] += X_WA[:3, 2] * (0.01 - apart)
    X_WB[:3, 3] -= X_WA[:3, 2] * float(rng.choice([0.0, 0.03]))
    return X_WA, X_WB


@pytest.mark.parametrize("kinds", ["box box", "box hull", "hull box", "hull hull"])
def test_polytopes(kinds):
    rng, kinds_met, followed, rows = rng_of("contact derivatives", kinds), set(), 0, 0
    for _ in range(6):
        points = [box_points((1.0, 0.8, 0.6)) if kind == "box" else hull_points(rng, 8) for kind in kinds.split()]
        A, B = (collide.ConvexHull(p) if k == "hull" else collide.Box((1.0, 0.8, 0.6))
                for p, k in zip(points, kinds.split()))
        X_WA, X_WB = nearly_flush(rng, A, B)
        D = collide.contact_derivatives(A, B, X_WA, X_WB, margin=0.05)
        rows += len(D.reason)
        for k, row in enumerate(D.contacts):
            if D.reason[k] is None:
                twin = Twin(*(Polytope(p) for p in points))
                assert_same(D, k, twin.following(row, X_WA, X_WB), X_WA, X_WB)
                kinds_met.add(twin.choice)
                followed += 1
            else:
                assert np.isnan(told(D, k)).all()
    assert rows and followed >= 0.9 * rows
    assert kinds != "box box" or kinds_met == {0, 1, 2}  # corners of both bodies, and edges that cross


def test_a_box_lying_flat_on_a_half_space_keeps_its_four_corners():
    rng = rng_of("contact derivatives", "flat")
    ground, box = collide.Halfspace((0, 0, 1), 0.0), collide.Box((1.0, 0.8, 0.6))
    X_WA = random_pose(rng, 1.0)
    X_WB = X_WA @ collide.pose((0.3, 0.2, 0.3 - 1e-3))
    D = collide.contact_derivatives(ground, box, X_WA, X_WB)
    assert D.reason == [None] * 4

    def contact(corner):
        def at(X, Y):
            n, b = X[:3, 2], Y[:3, :3] @ corner + Y[:3, 3]
            return np.hstack([n @ (b - X[:3, 3]), b - n * (n @ (b - X[:3, 3])), b, n])
        return at

    for k, row in enumerate(D.contacts):
        corner = np.round(X_WB[:3, :3].T @ (row["point_b"] - X_WB[:3, 3]), 9)
        assert_same(D, k, contact(corner), X_WA, X_WB)


def nearest_on(kind: str, p: np.ndarray) -> np.ndarray:
    """The point nearest to p outside: of a box, a cylinder, the segment of a capsule."""
    if kind == "box":
        return np.clip(p, (-0.5, -0.4, -0.3), (0.5, 0.4, 0.3))
    if kind == "cylinder":
        r = np.hypot(p[0], p[1])
        return np.array([*(p[:2] * min(1.0, 0.3 / r)), np.clip(p[2], -0.4, 0.4)])
    return np.array([0.0, 0.0, np.clip(p[2], -0.4, 0.4)])


@pytest.mark.parametrize("kind", ["box", "cylinder", "capsule"])
def test_a_ball_beside(kind):
    rng = rng_of("contact derivatives", "ball", kind)
    body, radius = {
        "box": (collide.Box((1.0, 0.8, 0.6)), 0.0), "cylinder": (collide.Cylinder(0.3, 0.8), 0.0),
        "capsule": (collide.Capsule(0.2, 0.8), 0.2),
    }[kind]

    def contact(X, Y):
        core = X[:3, :3] @ nearest_on(kind, X[:3, :3].T @ (Y[:3, 3] - X[:3, 3])) + X[:3, 3]
        n = (Y[:3, 3] - core) / np.linalg.norm(Y[:3, 3] - core)
        a, b = core + radius * n, Y[:3, 3] - 0.25 * n
        return np.hstack([(b - a) @ n, a, b, n])

    followed = 0
    for _ in range(12):
        X_WA, X_WB = random_pose(rng, 1.0), random_pose(rng, 1.0)
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        X_WB[:3, 3] = X_WA[:3, 3] + 2.0 * way
        for _ in range(8):
            X_WB[:3, 3] += way * (0.01 - collide.distance(body, collide.Sphere(0.25), X_WA, X_WB).distance)
        D = collide.contact_derivatives(body, collide.Sphere(0.25), X_WA, X_WB, margin=0.1)
        for k, why in enumerate(D.reason):
            if why is None:
                assert_same(D, k, contact, X_WA, X_WB)
                followed += 1
    assert followed >= 10


def test_no_number_where_there_is_no_derivative():
    box, eye = collide.Box((1.0, 1.0, 1.0)), np.eye(4)
    flush = collide.contact_derivatives(box, box, eye, collide.pose((0.2, 0.1, 0.999)))
    assert len(flush.reason) == 4 and all("normal has no derivative" in why for why in flush.reason)
    union = collide.Compound([(box, eye), (box, collide.pose((2.0, 0, 0)))])
    parts = collide.contact_derivatives(union, box, eye, collide.pose((0.2, 0.1, 0.999)))
    assert parts.reason and all("ask about their convex parts" in why for why in parts.reason)
    for D in (flush, parts):
        assert all(np.isnan(told(D, k)).all() for k in range(len(D.reason)))
    nothing = collide.contact_derivatives(box, box, eye, collide.pose((3.0, 0, 0)))
    assert nothing.reason == [] and nothing.d_normal_B.shape == (0, 3, 6)


def test_a_tilted_capsule_across_an_edge_of_a_face_is_not_followed():
    """Its surface, seen along the normal, is not the core's point moved by the radius."""
    rng = rng_of("contact derivatives", "tilted capsule")
    box, capsule, seen = collide.Box((1.0, 0.8, 0.6)), collide.Capsule(0.2, 1.0), 0
    for _ in range(20):
        tilt = np.pi / 2 + rng.uniform(0.005, 0.03)  # the lower end over the box, the other beyond an edge
        X_WB = collide.pose((-0.3, 0.0, 0.0), rpy=(0.0, tilt, rng.uniform(-0.3, 0.3)))
        for _ in range(8):
            X_WB[2, 3] += 0.01 - collide.distance(box, capsule, np.eye(4), X_WB).distance
        D = collide.contact_derivatives(box, capsule, np.eye(4), X_WB, margin=0.1)
        for k, row in enumerate(D.contacts):
            core = row["point_b"] + 0.2 * row["normal"]
            off = np.linalg.norm(np.cross(core - X_WB[:3, 3], X_WB[:3, 2]))
            if off > 1e-8:
                assert D.reason[k] is not None
                seen += 1
    assert seen


def test_a_batch_has_the_rows_of_single_calls():
    rng, box, ball = rng_of("contact derivatives", "batch"), collide.Box((1.0, 0.8, 0.6)), collide.Sphere(0.25)
    poses = np.array([nearly_flush(rng, box, box)[1] for _ in range(3)])
    D = collide.contact_derivatives([box, box, box], [box, ball, box], poses, poses[::-1].copy(), margin=0.1)
    at = 0
    for k, B in enumerate((box, ball, box)):
        one = collide.contact_derivatives(box, B, poses[k], poses[2 - k], margin=0.1)
        assert D.reason[at : at + len(one.reason)] == one.reason
        for name in ("d_distance_A", "d_point_b_A", "d_normal_B"):
            mine = getattr(D, name)[at : at + len(one.reason)]
            assert np.array_equal(mine, getattr(one, name), equal_nan=True)
        at += len(one.reason)
    assert at == len(D.reason) == len(D.contacts)
