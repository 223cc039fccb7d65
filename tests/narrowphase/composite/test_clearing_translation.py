"""How deep unions overlap: brackets against slabs of all pairs of boxes, worked out in numpy along many directions."""

from __future__ import annotations

from collections import Counter

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide


def slabs_of(case: Case) -> list[tuple[np.ndarray, np.ndarray]]:
    """A ⊖ B of each pair of boxes as (unit normals (k, 3), heights (k,)): the 15 axes of two boxes, both ways."""
    found = []
    for X, half in boxes_of(case.A, case.X_WA):
        for Y, other in boxes_of(case.B, case.X_WB):
            R, S = X[:3, :3], Y[:3, :3]
            crossed = np.cross(R.T[:, None], S.T[None]).reshape(-1, 3)
            axes = np.concatenate([R.T, S.T, crossed[np.linalg.norm(crossed, axis=1) > 1e-9]])
            axes /= np.linalg.norm(axes, axis=1)[:, None]
            reach = np.abs(axes @ R) @ half + np.abs(axes @ S) @ other
            middle = axes @ (X[:3, 3] - Y[:3, 3])
            found.append((np.concatenate([axes, -axes]), np.concatenate([reach + middle, reach - middle])))
    return found


def boxes_of(shape, X_WC) -> list[tuple[np.ndarray, np.ndarray]]:
    items = shape.items if isinstance(shape, collide.Compound) else [(shape, np.eye(4))]
    return [(X_WC @ X, 0.5 * np.array(box.size)) for box, X in items]


def first_clear(slabs, n: np.ndarray) -> float:
    """The least τ ≥ 0 at which τ·n is in no A ⊖ B, of all the intervals in which it is in one."""
    spans = []
    for normals, heights in slabs:
        along = normals @ n
        ends = heights / np.where(along == 0.0, 1.0, along)
        low = max(ends[along < 0.0], default=-np.inf)
        high = min(ends[along > 0.0], default=np.inf)
        if low < high and (heights[along == 0.0] > 0.0).all():
            spans.append((low, high))
    length = 0.0
    for low, high in sorted(spans):
        if low <= length < high:
            length = high
    return length


def brackets(rng) -> list[collide.Shape]:
    """An L, a U, a ring of boxes and a heap of them, with sides as of furniture."""
    a, b, c, d = rng.uniform(0.05, 2.0, 4)
    thin = float(rng.uniform(0.05, 0.4))
    foot = (collide.Box((a + thin, c, thin)), pose())
    wall = (collide.Box((thin, c, b)), pose(t=(-a / 2, 0, b / 2)))
    far_wall = (collide.Box((thin, c, d)), pose(t=(a / 2, 0, d / 2)))
    lid = (collide.Box((a + thin, c, thin)), pose(t=(0, 0, b)))
    heap = [(collide.Box(rng.uniform(0.1, 1.0, 3)), random_pose(rng, 0.6)) for _ in range(int(rng.integers(2, 6)))]
    u_shape = [foot, wall, far_wall]
    return [collide.Compound(items) for items in ([foot, wall], u_shape, [*u_shape, lid], heap)]


def test_a_ball_five_centimetres_into_the_foot_of_an_l_is_that_deep():
    angle = collide.Compound([(collide.Box((4, 1, 0.3)), pose()), (collide.Box((0.3, 1, 2)), pose(t=(-1.85, 0, 1.15)))])
    r = collide.distance(angle, collide.Sphere(0.1), np.eye(4), pose(t=(1.0, 0.2, 0.2)))
    assert r.certified and r.distance == pytest.approx(-0.05, abs=1e-14) and r.upper - r.lower < 1e-12
    assert r.normal == pytest.approx((0, 0, 1)) and 0.5 * (r.point_a + r.point_b) == pytest.approx((1.0, 0.2, 0.125))


def test_pairs_left_out_by_balls_bar_no_way():
    """Moved by −lower the unions are apart, and along the normal no more is asked for than slabs of all pairs say; far
    from the origin, too."""
    rng, opened = rng_of("balls along a way"), 0
    for case in range(12):
        kinds = brackets(rng)
        A, B = kinds[case % 4], kinds[(case + 1) % 4]
        far = 10.0 ** rng.uniform(-1, 3) * rng.normal(size=3)
        X_WA, X_WB = random_pose(rng, 0.1), random_pose(rng, 0.1)
        X_WA[:3, 3] += far
        X_WB[:3, 3] += far
        r = collide.distance(A, B, X_WA, X_WB)
        if not r.hit or r.distance == 0.0:
            continue
        X_out = X_WB.copy()
        X_out[:3, 3] -= (r.lower - 1e-12 - 1e-15 * np.abs(far).max()) * r.normal
        assert collide.distance(A, B, X_WA, X_out).lower > -1e-11 and -r.lower <= first_clear(
            slabs_of(Case(A, B, X_WA, X_WB)), r.normal
        ) + 1e-9, case
        opened += 1
    assert opened >= 8, opened


@pytest.mark.slow
def test_depths_of_unions_of_boxes_lie_in_their_brackets():
    """No direction has a shorter way out than −upper; along the normal −lower is one, and none is shorter."""
    rng = rng_of("unions of boxes")
    seen: Counter = Counter()
    ratios = []
    for k in range(100):
        kinds = brackets(rng)
        A = kinds[k % 4]
        B = collide.Box(rng.uniform(0.05, 0.8, 3)) if k % 3 == 0 else brackets(rng)[k // 4 % 4]
        X, Y = (random_pose(rng, 0.7), random_pose(rng, 0.7)) if k % 2 else (pose(t=rng.uniform(-1, 1, 3)), pose())
        case = Case(A, B, X, Y)
        r = collide.distance(*case)
        seen["hits"] += r.hit
        if not r.hit:
            continue
        with naive.reproducible(case):
            slabs = slabs_of(case)
            sampled = np.concatenate([rng.normal(size=(60, 3)), *(normals for normals, _ in slabs)])
            shortest = min(first_clear(slabs, naive.unit(n)) for n in sampled)
            along = first_clear(slabs, r.normal)
            assert r.lower <= r.distance <= r.upper < 0.0
            assert -r.upper <= shortest + 1e-12, "a shorter way out than the bound allows"
            assert -r.lower == pytest.approx(along, abs=1e-11) and -r.distance == pytest.approx(along, abs=1e-11)
            assert not collide.collide(*case.with_b_moved(-r.lower * (1 + 1e-9) * r.normal)), "still together"
            assert not r.certified or -r.distance <= shortest + 1e-9
            ratios.append(-r.distance / shortest)
            seen["certified"] += r.certified
            swapped = collide.distance(case.B, case.A, case.X_WB, case.X_WA)
            assert swapped.distance == r.distance and (swapped.normal == -r.normal).all()
    # How near the least way out of 60 directions and all normals it comes.
    assert seen["hits"] > 40 and seen["certified"] > 15, seen
    assert np.median(ratios) < 1.001 and np.mean(np.array(ratios) > 1.3) < 0.15, np.quantile(ratios, [0.5, 0.9, 1.0])


def test_worlds_batches_and_single_calls_tell_the_same_way_out():
    rng = rng_of("ways out in worlds")
    hits = 0
    for _ in range(20):
        A, B = brackets(rng)[0], brackets(rng)[1]
        X, Y = random_pose(rng, 0.4), random_pose(rng, 0.4)
        with naive.reproducible(Case(A, B, X, Y)):
            single = collide.distance(A, B, X, Y)
            batch = collide.distance(A, B, X[None], Y[None])
            world = collide.World()
            world.add(A, X), world.add(B, Y)
            assert not naive.same_bits(single.rows, batch.rows)
            rows = world.collisions().rows
            assert len(rows) == single.hit
            if single.hit:
                hits += 1
                for name in ("distance", "lower", "upper", "normal", "point_a", "point_b", "part_a", "part_b"):
                    assert np.array_equal(rows[name][0], single.rows[name][0]), name
    assert hits >= 8
