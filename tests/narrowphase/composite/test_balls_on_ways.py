"""Balls that stay apart on a straight way: no pair that comes within the margin is left out, few others are kept."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.lowering.compound_layout import body_ball, part_balls
from collide.narrowphase.composite.balls_on_ways import near_on_ways

AGAIN = (
    "import collide, numpy as np\n"
    "A, B = (collide.Compound([(collide.Sphere(r), np.array(X))]) for r, X in zip({radii}, {items}))\n"
    "print(collide.shape_cast(A, np.array({X}), {v}, B, np.array({Y}), max_distance={limit}))"
)


def centre_of(X: np.ndarray, X_BP: np.ndarray) -> list[Fraction]:
    """Where a pose puts the origin of another, exactly."""
    R, p, c = X[:3, :3].tolist(), X[:3, 3].tolist(), X_BP[:3, 3].tolist()
    return [sum((Fraction(a) * Fraction(b) for a, b in zip(row, c)), Fraction(t)) for row, t in zip(R, p)]


def nearest_square(d: list[Fraction], v: list[Fraction], limit: float) -> Fraction:
    """The least of |d − t v|² for 0 ≤ t ≤ limit, exactly."""
    t = max(sum(a * b for a, b in zip(d, v)) / sum(b * b for b in v), Fraction(0))
    t = t if limit == np.inf else min(t, Fraction(limit))
    return sum((a - t * b) ** 2 for a, b in zip(d, v))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_balls_that_come_within_the_margin_are_kept_and_few_others(scale):
    """Balls that graze each other to the last digits among them: at the start, on the way and where it ends."""
    rng, told = rng_of("balls on ways", scale), {"near": 0, "grazing": 0, "apart": 0}
    for _ in range(300):
        X, Y, *items = (random_pose(rng, scale) for _ in range(4))
        v = rng.normal(size=3)
        v *= rng.uniform(0.5, 1.0) / np.abs(v).max()
        limit = float(rng.choice([0.0, scale * rng.uniform(0.1, 2.0), np.inf]))
        d = [b - a for a, b in zip(centre_of(X, items[0]), centre_of(Y, items[1]))]
        square = nearest_square(d, [Fraction(x) for x in v.tolist()], limit)
        margin = float(rng.choice([0.0, 0.01 * scale]))
        share = float(rng.choice([0.9, 1.0, 1.0 - 2.0**-52, 1.0 + 2.0**-52, 1.01]))
        reach = share * float(square) ** 0.5 - margin
        if reach < 1e-9 * scale:
            continue
        radii = [0.3 * reach, 0.7 * reach]
        with reproducing(AGAIN, radii=radii, items=items, X=X, Y=Y, v=v, limit=limit):
            A, B = (collide.Compound([(collide.Sphere(r), item)]) for r, item in zip(radii, items))
            way = {"vectors": v[None], "limits": np.array([limit]), "margin": margin}
            near = near_on_ways(body_ball(A), body_ball(B), X[None], Y[None], 1, **way)
            assert near is not None
            exact = sum(map(Fraction, radii)) + Fraction(margin)
            if square <= exact * exact:
                assert near[0]
                told["near" if share < 0.95 else "grazing"] += 1
            elif share < 0.95:
                assert not near[0]
                told["apart"] += 1
            swapped = near_on_ways(
                body_ball(B), body_ball(A), Y[None], X[None], 1, **{**way, "vectors": np.array(-v[None])}
            )
            assert swapped is not None and swapped[0] >= (square <= exact * exact)
    assert told["grazing"] > 50 and told["apart"] > 30 and told["near"] + told["grazing"] > 100, told


def test_rows_are_those_of_each_ball_alone():
    """Many poses of two bodies, many balls of one, all with the same bytes as one by one; half-spaces are near."""
    rng, n = rng_of("rows of balls"), 40
    A = collide.Compound([(collide.Box((0.2, 0.1, 0.3)), random_pose(rng, 1.0)) for _ in range(n)])
    B = collide.Cylinder(0.2, 0.5)
    X, Y = (np.array([random_pose(rng, 2.0) for _ in range(n)]) for _ in range(2))
    v, limits = rng.uniform(0.5, 1.0, (n, 3)), rng.uniform(0.0, 1.0, n)
    a, b, parts = body_ball(A), body_ball(B), part_balls(A)
    for balls, poses in ((a, X), (parts, X[:1]), (parts, X)):
        together = near_on_ways(balls, b, poses, Y, n, vectors=v, limits=limits, margin=1.0)
        assert together is not None and 3 < together.sum() < n - 3
        for k in range(n):
            at = balls._replace(at=balls.at + 8 * k * balls.stride)
            pose = poses[k : k + 1] if len(poses) > 1 else poses
            way = {"vectors": v[k : k + 1], "limits": limits[k : k + 1], "margin": 1.0}
            one = near_on_ways(at, b, pose, Y[k : k + 1], 1, **way)
            assert one is not None and one[0] == together[k], k
    plane = body_ball(collide.Compound([(collide.Halfspace((0, 0, 1), 0.0), np.eye(4)), (B, np.eye(4))]))
    assert near_on_ways(a, plane, X, Y, n).all()


@pytest.mark.parametrize("wrong", [np.diag([1.0, 1, 1, 2]), np.diag([1.0, 1.1, 1, 1]), np.full((4, 4), np.nan)])
def test_what_is_no_pose_is_left_to_the_caller(wrong):
    ball, here = body_ball(collide.Sphere(1.0)), np.eye(4)[None]
    assert near_on_ways(ball, ball, np.stack([here[0], wrong]), here, 2, check=True) is None


def union(n: int, seed: str) -> collide.Compound:
    rng = rng_of(seed)
    return collide.Compound([(collide.Box(rng.uniform(0.02, 0.1, 3)), random_pose(rng, 1.0)) for _ in range(n)])


def test_casts_past_a_union_pose_no_part_of_it_and_others_few(monkeypatch):
    """A box of 1,000 on either side: misses ask balls alone, hits pose what is near the way."""
    from collide.casts import cast_batches, union_casts

    posed, make = [], cast_batches.posed_sides

    def recorded(*args, **options):
        sides = make(*args, **options)
        posed.append(len(sides.parts.shape_of))
        return sides

    monkeypatch.setattr(cast_batches, "posed_sides", recorded)
    A, B, eye = union(1000, "cast"), collide.Box((0.05, 0.05, 0.05)), np.eye(4)
    away = np.array([collide.pose((40.0, y, 0.0)) for y in (0.0, 1.0, 2.0)])
    for casts in (
        collide.shape_cast(A, eye, (0, 1, 0), B, away), collide.shape_cast(B, away, (0, 1, 0), A, eye),
        collide.shape_cast(A, eye, (1, 0, 0), B, away, max_distance=30.0),
    ):
        assert not casts.hit.any() and casts.certified.all() and not posed
    assert collide.shape_cast(A, eye, (1, 0, 0), B, away).hit.any() and not posed
    monkeypatch.setattr(union_casts.UnionWay, "first_contact", lambda *_: None)  # the kernel leaves all open
    assert collide.shape_cast(A, eye, (1, 0, 0), B, away).hit.any()
    assert 0 < sum(posed) < 150, posed


def test_contacts_of_many_poses_far_away_ask_no_boxes_of_parts(monkeypatch):
    from collide.contact import contact_batches

    asked, near = [], contact_batches.boxes_near
    monkeypatch.setattr(
        contact_batches, "boxes_near", lambda *args: (asked.append(len(args[2])), near(*args))[1]
    )
    monkeypatch.setattr(contact_batches, "single_contacts_of", lambda A, B: None)  # no kernel
    A, B = union(300, "contacts"), collide.Box((0.4, 0.4, 0.4))
    X = np.array([collide.pose((40.0 if k % 4 else 0.1 * k, 0.0, 0.0)) for k in range(20)])
    rows, ends = collide.contacts(A, B, X, np.eye(4)), []
    assert asked == [5]
    for k in range(20):
        one = collide.contacts(A, B, X[k], np.eye(4))
        ends.append(len(one))
        assert (len(one) > 0) >= (k == 0) and (k % 4 == 0 or not len(one))
    assert sum(ends) > 0 and [len(rows[k]) for k in range(20)] == ends


def test_motions_past_a_union_list_none_of_its_parts(monkeypatch):
    from collide.motion import convex_motions

    asked, search = [], convex_motions.SingleUnions.search
    monkeypatch.setattr(
        convex_motions.SingleUnions, "search", lambda *args: (asked.append(1), search(*args))[1]
    )
    A, B, eye = union(200, "motions"), collide.Box((0.3, 0.3, 0.3)), np.eye(4)
    starts = np.array([collide.pose((40.0 if k % 4 else 5.0, 0.1, 0.0)) for k in range(20)])
    ends = np.array([collide.pose((30.0 if k % 4 else -5.0, 0.0, 0.0)) for k in range(20)])
    together = collide.time_of_impact(A, B, eye, eye, starts, ends)
    assert len(asked) == 5 and together.hit.sum() == 5
    for k in range(20):
        one = collide.time_of_impact(A, B, eye, eye, starts[k], ends[k])
        assert (one.hit, one.lower, one.upper) == (together.hit[k], together.lower[k], together.upper[k])
