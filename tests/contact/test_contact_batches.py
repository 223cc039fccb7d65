"""Contacts of compounds of many parts: those of the parts one by one, and no work for parts that are far."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.narrowphase.composite import composite_meshes, composite_parts
from collide.narrowphase.composite.composite_parts import CompoundParts

EYE = np.eye(4)


def clutter(rng, n: int, spread: float) -> collide.Compound:
    makers = (lambda w: collide.Box((w, w, w)), lambda w: collide.Sphere(w), lambda w: collide.Cylinder(w, w))
    return collide.Compound([
        (makers[int(rng.integers(3))](rng.uniform(0.05, 0.1)), collide.pose(p, rpy=r))
        for p, r in zip(rng.uniform(-spread, spread, (n, 3)), rng.uniform(-3, 3, (n, 3)))
    ])


@pytest.fixture
def posed_rows(monkeypatch):
    """How many poses of parts are made."""
    rows: list[int] = []
    placed = CompoundParts.placed

    def counted(self, which, X_WB, about):
        rows.append(len(which))
        return placed(self, which, X_WB, about)

    monkeypatch.setattr(CompoundParts, "placed", counted)
    return rows


@pytest.mark.many(2)
@pytest.mark.parametrize(("n_a", "n_b"), [(1, 200), (12, 15), (60, 60)])
def test_rows_are_those_of_the_parts_one_by_one(n_a, n_b, posed_rows):
    """Against every part of A with every part of B, through the box-tree and without; hits and misses both."""
    rng = np.random.default_rng(n_b)
    hits = 0
    for trial in range(3):
        A, B = clutter(rng, n_a, 0.1), clutter(rng, n_b, 0.5 if n_b > 50 else 0.25)
        X_WA, X_WB = collide.pose(rng.uniform(-0.3, 0.3, 3)), collide.pose((0, 0, 0), rpy=rng.uniform(-3, 3, 3))
        found = collide.contacts(A, B, X_WA[None], X_WB, margin=0.01)
        pairs = {tuple(pair) for pair in np.stack([found.rows["part_a"], found.rows["part_b"]], axis=1).tolist()}
        expected = {
            (i, j)
            for i, (a, X_a) in enumerate(A.items)
            for j, (b, X_b) in enumerate(B.items)
            if collide.distance(a, b, X_WA @ X_a, X_WB @ X_b).distance <= 0.01
        }
        assert pairs == expected, f"seed {n_b}, trial {trial}: {pairs ^ expected}"
        hits += len(pairs)
        n_near = posed_rows.pop()
        assert posed_rows.pop() == n_near <= 0.5 * n_a * n_b and not posed_rows
    assert hits >= 3


def test_far_compounds_pose_no_part(posed_rows):
    rng = np.random.default_rng(3)
    A, B = clutter(rng, 300, 0.5), clutter(rng, 300, 0.5)
    far = collide.pose((5, 0, 0))
    for X_WB in (far[None], far):
        assert not len(collide.contacts(A, B, EYE, X_WB, margin=0.1))
        assert not posed_rows


def test_half_spaces_are_near_whatever_their_boxes(posed_rows):
    rng = np.random.default_rng(4)
    A = collide.Compound([(collide.Halfspace((0.6, 0.0, 0.8), 0.1), EYE), (collide.Sphere(0.1), EYE)])
    B = clutter(rng, 300, 0.5)
    found = collide.contacts(A, B, EYE, EYE)
    below = {
        j for j, (shape, X) in enumerate(B.items) if collide.distance(A.items[0][0], shape, EYE, X).distance <= 0.0
    }
    assert {j for i, j in zip(found.rows["part_a"], found.rows["part_b"]) if i == 0} == below and len(below) > 50


def test_parts_with_meshes_that_cannot_be_nearest_are_not_asked(monkeypatch):
    """A row of 60 mesh cubes beside a box: the distance is that of the nearest, and few are asked for theirs; where
    they overlap, few parts' support values are worked out."""
    cube = collide.Mesh(*collide.tessellate(collide.Box((0.1, 0.1, 0.1))))
    A = collide.Compound([(cube, collide.pose((0.2 * k, 0.01 * k, 0))) for k in range(60)])
    B = collide.Box((0.3, 0.3, 0.3))
    asked: list[int] = []
    part_rows = composite_meshes.part_rows
    monkeypatch.setattr(composite_meshes, "part_rows", lambda *given: asked.append(1) or part_rows(*given))
    for x in (-0.7, 3.1, 12.8):
        asked.clear()
        X = collide.pose((x, -1.0, 0))
        found = collide.distance(A, B, EYE, X)
        nearest = min(collide.distance(cube, B, Y, X).distance for _, Y in A.items)
        assert found.lower <= nearest + 1e-12 and abs(found.distance - nearest) < 1e-12
        assert len(asked) <= 12
    values: list[int] = []
    extent_of = composite_parts.extent_of
    monkeypatch.setattr(composite_parts, "extent_of", lambda *given: values.append(1) or extent_of(*given))
    assert collide.distance(A, B, EYE, collide.pose((0.2, 0.0, 0.0))).hit
    assert len(values) < 19 * (60 + 1) // 2


def test_boxes_near_are_all_pairs_within_the_margin(monkeypatch):
    """With and without the tree the same pairs, and none is lost to rounding at the margin."""
    rng = np.random.default_rng(6)
    A, B = (CompoundParts(clutter(rng, 40, 0.5)) for _ in range(2))
    X_WA, X_WB = (
        np.array([collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(5)]) for _ in "ab"
    )
    a, b = A.boxes(X_WA)[:, :, None], B.boxes(X_WB)[:, None]
    apart = np.maximum(b[..., :3] - a[..., 3:], a[..., :3] - b[..., 3:]).max(axis=-1)
    for few in (0, 1 << 20):
        monkeypatch.setattr(composite_parts, "_MAX_PAIRS", few)
        found = set(zip(*(column.tolist() for column in composite_parts.boxes_near(A, B, X_WA, X_WB, 0.05))))
        assert found == set(map(tuple, np.argwhere(apart <= 0.05).tolist())) and len(found) > 20


@pytest.mark.parametrize("rotated", [True, False])
def test_a_walk_through_both_trees_names_what_all_pairs_of_boxes_tell(rotated, monkeypatch):
    """At matrices that shrink, stretch and shear, far from the origin, with spheres, whose radius no matrix changes,
    with a half-space, and of nested unions."""
    monkeypatch.setattr(composite_parts, "_MAX_PAIRS", 0)
    rng = np.random.default_rng(11)
    named = asked = 0
    for case in range(40):
        items = [
            (collide.Sphere(10.0 ** rng.uniform(-2, -0.3)) if k % 2 else collide.Box(rng.uniform(0.02, 0.3, 3)),
             collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)))
            for k in range(30)
        ]
        if case % 4 == 0:
            items.append((collide.Halfspace((0.0, 0.0, 1.0), -0.5), np.eye(4)))
        A = CompoundParts(collide.Compound([(collide.Compound(items), collide.pose(rpy=rng.uniform(-3, 3, 3)))]))
        B = CompoundParts(clutter(rng, 30, 0.3))
        X_WA, X_WB = (collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)) for _ in "ab")
        if not rotated:
            X_WA[:3, :3] = rng.normal(scale=0.4, size=(3, 3))
            X_WB[:3, :3] *= rng.uniform(0.3, 2.0)
        far = 10.0 ** rng.uniform(-3, 6) * rng.normal(size=3)
        X_WA[:3, 3] += far
        X_WB[:3, 3] += far
        margin = float(rng.choice([0.0, 0.05, 0.3]))
        a, b = A.boxes(X_WA[None])[0][:, None], B.boxes(X_WB[None])[0][None]
        apart = np.maximum(b[..., :3] - a[..., 3:], a[..., :3] - b[..., 3:]).max(axis=-1)
        found = set(map(tuple, A.tree.pairs_near(B.tree, X_WA, X_WB, margin).tolist()))
        wanted = set(map(tuple, np.argwhere(apart <= margin).tolist()))
        assert wanted <= found, (case, rotated, margin, X_WA.tolist(), X_WB.tolist(), wanted - found)
        _, i, j = composite_parts.boxes_near(A, B, X_WA[None], X_WB[None], margin)
        assert wanted <= set(zip(i.tolist(), j.tolist()))
        named, asked = named + len(found), asked + len(wanted)
    assert 500 < asked and named < 5 * asked, (named, asked)


def test_contacts_of_many_parts_make_boxes_of_those_that_are_near_alone(monkeypatch):
    """Of 1,000 parts no box is made where the other body is far, and as many as are near where it is not; its trees are
    made once."""
    rng = np.random.default_rng(12)
    box = collide.Box((0.05, 0.04, 0.03))
    union, other = (
        collide.Compound([(box, collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3))) for _ in range(1000)])
        for _ in "ab"
    )
    ask = collide.Box((0.4, 0.3, 0.2))
    collide.contacts(union, ask, EYE, collide.pose((0.1, 0.0, 0.0)))
    collide.contacts(union, other, EYE, collide.pose((1.8, 0.0, 0.0)))
    made: list[int] = []
    boxes_of = composite_parts.boxes_of

    def counted(table, rows, which):
        made.append(len(which))
        return boxes_of(table, rows, which)

    monkeypatch.setattr(composite_parts, "boxes_of", counted)
    poses = np.array([collide.pose((2.0 + k, 0.0, 0.0)) for k in range(3)])
    assert not len(collide.contacts(union, ask, EYE, poses)) and not sum(made)
    parts = [composite_parts.compound_parts(shape) for shape in (union, ask, other)]
    beside, overlapping = collide.pose((1.9, 0.1, 0)), collide.pose((0.3, 0.2, 0.1))
    for B, body, X_WB in ((parts[1], ask, overlapping), (parts[2], other, beside)):
        made.clear()
        assert len(collide.contacts(union, body, EYE, X_WB)) > 0
        n_made = sum(made)
        near = composite_parts.boxes_near(parts[0], B, EYE[None], X_WB[None], 0.0)
        assert 0 < len(near[0]) < 200 and n_made <= 2 * 2.5 * len(near[0]), (n_made, len(near[0]))


def test_contacts_of_a_union_far_away_are_asked_of_balls_alone(monkeypatch):
    """Once a pair was asked; nearer, with a margin, and at what is no pose, the long way answers the same."""
    rng = np.random.default_rng(13)
    union, box = clutter(rng, 40, 0.3), collide.Box((0.2, 0.2, 0.2))
    near, far = collide.pose((0.2, 0.1, 0.0)), collide.pose((9.0, 0.0, 0.0))
    first = collide.contacts(union, box, EYE, near)
    assert len(first) and collide.contacts(union, box, EYE, near).rows.tobytes() == first.rows.tobytes()
    with pytest.raises(collide.InvalidPose):
        collide.contacts(union, box, EYE, 2.0 * far)
    assert len(collide.contacts(union, box, EYE, far, margin=9.0))
    monkeypatch.setattr("collide.contact.contact_query.contact_batch", None)
    for X_WA, X_WB in ((EYE, far), (far, EYE), (far + 0.0, far @ far)):
        result = collide.contacts(union, box, X_WA, X_WB, margin=0.5)
        assert len(result) == 0 and len(result.starts) == 2 and len(result[0]) == 0
    assert collide.contacts(union, box, EYE, near).rows.tobytes() == first.rows.tobytes()


def test_balls_leave_no_contact_of_a_union_out():
    """Poses about as far as the balls of both reach, with matrices that are barely rotations."""
    rng, hits, far = np.random.default_rng(14), 0, 0
    for case in range(200):
        at = rng.uniform(-1, 1, (1 + case % 2, 3))
        sphere = collide.Compound([(collide.Sphere(0.5), collide.pose(p)) for p in at])
        other = collide.Sphere(0.25)
        collide.contacts(sphere, other, EYE, EYE)
        X_WA = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
        X_WA[:3, :3] *= 1.0 + rng.uniform(-1e-5, 1e-5)
        centre = X_WA[:3, :3] @ sphere.items[0][1][:3, 3] + X_WA[:3, 3]
        n = rng.normal(size=3)
        gap = rng.choice([0.0, 1e-9, 0.1])
        X_WB = collide.pose(centre + (0.75 + gap) * n / np.linalg.norm(n))
        found = len(collide.contacts(sphere, other, X_WA, X_WB, margin=gap * (1 + 1e-6) + 1e-12))
        hits += found > 0
        far += len(collide.contacts(sphere, other, X_WA, X_WB, margin=0.5 * gap)) == 0
        assert found, (case, gap, X_WA.tolist(), X_WB.tolist())
    assert hits == 200 and far > 100
