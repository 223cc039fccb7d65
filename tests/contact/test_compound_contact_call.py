"""Single contacts of unions inside a kernel: the bytes of batches, whatever the parts, and faces of few parts."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.contact import contact_batches
from collide.contact.contact_batches import contact_batch
from collide.lowering import hull_faces
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe

EYE = np.eye(4)
pytestmark = pytest.mark.skipif(not single_calls_are_safe(), reason="single calls go the long way here")

MAKERS = (
    lambda w: collide.Box(2 * w), lambda w: collide.Sphere(w[0]), lambda w: collide.Capsule(w[0], w[1]),
    lambda w: collide.Cylinder(w[0], w[1]), lambda w: collide.Cone(w[0], w[1]),
    lambda w: collide.ConvexHull(np.vstack([np.diag(w), -np.diag(w[::-1]), [w]])),
)


def random_pose(rng, spread: float, on_lattice: bool) -> np.ndarray:
    """A pose; on a lattice products of poses are exact, and faces are flush."""
    X = collide.pose(rng.uniform(-spread, spread, 3), rpy=rng.uniform(-3, 3, 3))
    if on_lattice:
        X[:3, 3] = np.round(4 * X[:3, 3]) / 4
        X[:3, :3] = np.eye(3)[rng.permutation(3)]
        X[:3, 0] *= np.linalg.det(X[:3, :3])
    return X


@pytest.mark.parametrize("kinds", ["boxes on a lattice", "boxes", "all"])
def test_single_calls_have_the_bytes_of_batches(kinds):
    rng = np.random.default_rng(len(kinds))
    on_lattice, n_kinds, by_kernel, hits = kinds.endswith("lattice"), len(MAKERS) if kinds == "all" else 1, 0, 0

    def union(n: int) -> collide.Compound:
        spread = 0.4 * n ** (1 / 3)
        return collide.Compound([
            (MAKERS[int(rng.integers(n_kinds))](rng.uniform(0.1, 0.4, 3)), random_pose(rng, spread, on_lattice))
            for _ in range(n)
        ])

    for case in range(16):
        n = int(rng.integers(1, 60))
        B = (union(int(rng.integers(1, 60))), collide.Box((0.5, 0.6, 0.7)), collide.Halfspace((0, 0, 1), 0.1))[case % 3]
        A = union(n)
        for turn in range(6):
            X_WA = EYE if turn % 3 == 0 else random_pose(rng, 1.0, on_lattice)
            X_WB = random_pose(rng, n ** (1 / 3), on_lattice)
            margin, most = (0.0, 0.02, 0.3)[turn % 3], int(rng.integers(1, 9))
            rows, _ = contact_batch(A, B, X_WA[None], X_WB[None], 1, margin, most, check=True)
            single = collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most).rows
            assert single.tobytes() == rows.tobytes(), (kinds, case, turn)
            by_kernel += prepared_pair(A, B).contacts(X_WA, X_WB, most, margin) is not None
            hits += len(rows) > 0
    assert by_kernel > 0.95 * 16 * 6 and hits > 20, (by_kernel, hits)


def test_batches_have_the_bytes_of_single_calls(monkeypatch):
    """Poses that the kernel leaves open, near a half-space turned in its union, go with the others; by parts in numpy
    the rows are the same."""
    rng = np.random.default_rng(8)
    boxes = [(collide.Box(rng.uniform(0.1, 0.4, 3)), random_pose(rng, 1.0, False)) for _ in range(40)]
    A = collide.Compound(boxes)
    turned = collide.Compound([*boxes, (collide.Halfspace((0, 0, 1), -1.5), collide.pose(rpy=(0.1, 0.2, 0.3)))])
    X_WAs, X_WBs = (np.array([random_pose(rng, 1.5, False) for _ in range(60)]) for _ in range(2))
    for B in (collide.Box((0.5, 0.6, 0.7)), A, turned):
        batch = collide.contacts(A, B, X_WAs, X_WBs, margin=0.02)
        singles = [collide.contacts(A, B, X, Y, margin=0.02).rows for X, Y in zip(X_WAs, X_WBs)]
        assert batch.rows.tobytes() == b"".join(rows.tobytes() for rows in singles)
        assert batch.starts.tolist() == np.cumsum([0, *map(len, singles)]).tolist() and len(batch) > 100
        some = collide.contacts(A, B, X_WAs[0], X_WBs, margin=0.02)
        with monkeypatch.context() as without:
            without.setattr(contact_batches, "single_contacts_of", lambda A, B: None)
            assert collide.contacts(A, B, X_WAs, X_WBs, margin=0.02).rows.tobytes() == batch.rows.tobytes()
            assert collide.contacts(A, B, X_WAs[0], X_WBs, margin=0.02).rows.tobytes() == some.rows.tobytes()
    assert prepared_pair(A, turned).contacts(X_WAs[0], X_WBs[0], 8, 0.02) is None


@pytest.mark.parametrize("kind", ["flat", "nested", "with a mesh"])
def test_rows_on_the_brink_have_the_same_bits_whatever_else_is_in_the_batch(kind):
    """Parts far from the world's origin are asked farther beyond the margin; once with them, so were all others."""
    rng = np.random.default_rng(len(kind))
    hits = 0
    for case in range(60):
        unions = []
        for _ in range(2):
            shapes = [MAKERS[int(rng.integers(len(MAKERS)))](rng.uniform(0.1, 0.4, 3)) for _ in range(2)]
            if kind == "with a mesh":
                shapes[0] = collide.Mesh(*collide.tessellate(collide.Box(rng.uniform(0.1, 0.4, 3)))[:2])
            parts = [(shape, random_pose(rng, 0.5, False)) for shape in shapes]
            item = collide.Compound(parts)
            unions.append(collide.Compound([(item, random_pose(rng, 0.5, False))]) if kind == "nested" else item)
        X, Y = random_pose(rng, 2.5, False), random_pose(rng, 2.5, False)
        gap = float(collide.distance(*unions, X, Y).distance)
        if gap <= 0.0:
            continue
        away = [pose.copy() for pose in (X, Y)]
        for pose in away:
            pose[:3, 3] += (900.0, 500.0, 300.0)
        one = collide.contacts(*unions, X, Y, margin=gap).rows
        some = collide.contacts(*unions, np.stack([X, away[0]]), np.stack([Y, away[1]]), margin=gap)
        assert some[0].rows.tobytes() == one.tobytes(), case
        hits += len(one) > 0
    assert hits > 15, hits


def test_pairs_on_the_brink_of_the_margin_and_moved_half_spaces_are_left_to_the_long_way():
    """A gap of 1 m and a margin of as much, of bodies far from the origin; a half-space at a pose of its own."""
    box = collide.Box((1.0, 1.0, 1.0))
    A = collide.Compound([(box, collide.pose((0.0, 0.0, 3.0 * k), rpy=(0.3, 0.2, 0.1))) for k in range(40)])
    ground = collide.Compound([(collide.Halfspace((0, 0, 1), 0.0), collide.pose(rpy=(0.1, 0.2, 0.3))), (box, EYE)])
    X_WA, X_WB = collide.pose((1e3, 0.1, 0.2), rpy=(0.4, 0.0, 0.0)), collide.pose((0.0, 0.3, -0.8))
    gap = collide.distance(A, box, X_WA, X_WB).distance
    for B, margin in ((box, gap), (box, gap * (1 + 2e-16)), (ground, 0.1)):
        rows, _ = contact_batch(A, B, X_WA[None], X_WB[None], 1, margin, 8)
        assert collide.contacts(A, B, X_WA, X_WB, margin=margin).rows.tobytes() == rows.tobytes()
        assert prepared_pair(A, B).contacts(X_WA, X_WB, 8, margin) is None
    with pytest.raises(collide.InvalidPose):
        collide.contacts(A, box, 2.0 * EYE, X_WB)


def test_faces_of_few_parts_are_made(monkeypatch):
    """Of 400 hulls beside 400, fewer than half; a hull of many corners enlarges the workspace."""
    made, kept = [], hull_faces.kept_faces
    monkeypatch.setattr(hull_faces, "kept_faces", lambda points: (made.append(len(points)), kept(points))[1])
    rng = np.random.default_rng(4)
    disc = [(np.cos(a), np.sin(a), h) for a in np.linspace(0, 6, 60) for h in (-0.1, 0.1)]

    def union() -> collide.Compound:
        hulls = [collide.ConvexHull(0.2 * rng.normal(size=(8, 3))) for _ in range(399)]
        poses = [collide.pose(rng.uniform(-3, 3, 3), rpy=rng.uniform(-3, 3, 3)) for _ in hulls]
        return collide.Compound([*zip(hulls, poses), (collide.ConvexHull(disc), collide.pose((0, 0, -6.0)))])

    A, B = union(), union()
    hits = 0
    for turn in range(12):
        beside = collide.pose((0.3 * turn, 0.0, 5.5), rpy=(0.0, 0.0, turn % 6.0))
        X_WB = beside if turn < 8 else collide.pose((0.5, 0, -11.8))
        rows = collide.contacts(A, B, EYE, X_WB, margin=0.05).rows
        hits += len(rows) > 0
        assert rows.tobytes() == contact_batch(A, B, EYE[None], X_WB[None], 1, 0.05, 8)[0].tobytes()
    assert hits > 4 and 0 < len(made) < 400 and 120 in made, (hits, len(made))
