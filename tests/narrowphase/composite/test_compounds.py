"""Parts with a pose of their own, in bodies that have one too: decided on the exact product of the poses.

Every boolean is proven by its certificate in Python integers, which multiplies the poses exactly.
"""

from __future__ import annotations

import itertools
from fractions import Fraction
from functools import partial

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of

import collide
from collide.kernels import address_of, entry, view_f64
from collide.lowering.compound_layout import layout_of
from collide.lowering.compound_table import BALL, CENTRE, PART, SWEPT_RADIUS, lay_out
from collide.lowering.parts import convex_set_of, parts_of
from collide.lowering.place_parts import place_part, write_terms
from collide.lowering.shape_table import POSE, POSE_STRETCH, POSE_TERMS, TERM_ROW, ShapeTable, pose_table
from collide.narrowphase import convex_kernel_calls as run
from collide.narrowphase.composite import composite as unions
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe
from collide.pairs import batches, query
from collide.results import EXACT, PAIR_DTYPE, SWEPT, UNDECIDED, flipped

CASES = 60


def _gap(*asked, **named):
    return collide.distance(*asked, signed=False, **named)


@entry("int64(int64, int64, int64)")
def placed(poses_at, parts_at, terms_at):
    """Row 1 of poses becomes where part 0 of a body at row 0 stands, with all its terms."""
    poses = view_f64(poses_at, 2 * POSE)
    parts = view_f64(parts_at, PART)
    place_part(poses, POSE, 0, parts, 0, terms_at + 8 * TERM_ROW)
    write_terms(poses, 0, parts, 0, terms_at + 8 * TERM_ROW)
    return 0


def _pose(rng) -> np.ndarray:
    return collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3))


def _flush(rng) -> np.ndarray:
    """From a unit box to one that lies on it, turned and shifted."""
    return collide.pose((*rng.uniform(-0.3, 0.3, 2), 1.0), rpy=(0, 0, rng.uniform(-3, 3)))


def _box_on(rng, X_WP):
    return collide.Box((1, 1, 1)), X_WP @ _flush(rng)


def _part_on(rng, X_WP):
    X_BP = _pose(rng)
    return collide.Compound([(collide.Box((1, 1, 1)), X_BP)]), X_WP @ _flush(rng) @ np.linalg.inv(X_BP)


def _capsule_on(rng, X_WP):
    X_BP = collide.pose((0, 0, 0.5), rpy=rng.uniform(-1, 1, 3))
    standing = collide.Compound([(collide.Capsule(0.5, 1.0), X_BP)])
    return standing, X_WP @ _flush(rng) @ collide.pose((0, 0, 0.5)) @ np.linalg.inv(X_BP)


def _halfspace_on(rng, X_WP):
    X_BP = _pose(rng)
    above = collide.Compound([(collide.Halfspace((0, 0, -1), 0.5), X_BP)])
    return above, X_WP @ collide.pose((0, 0, 1.0)) @ np.linalg.inv(X_BP)


@pytest.mark.many(2)
@pytest.mark.parametrize("lay", [_box_on, _part_on, _capsule_on, _halfspace_on])
def test_flush_parts_of_posed_bodies_are_decided_exactly(lay):
    rng = np.random.default_rng(5)
    hits = 0
    for case in range(CASES):
        X_WA, X_AP = _pose(rng), _pose(rng)
        A = collide.Compound([(collide.Box((1, 1, 1)), X_AP)])
        B, X_WB = lay(rng, X_WA @ X_AP)
        r = collide.distance(A, B, X_WA, X_WB)
        snippet = f"case {case}: A={A!r} B={B!r} X_WA={X_WA.tolist()} X_WB={X_WB.tolist()}"
        assert r.how in (EXACT, SWEPT) and r.certified, snippet
        assert abs(r.distance) < 1e-15 and r.lower <= r.distance <= r.upper, snippet
        assert collide.collide(A, B, X_WA, X_WB) == r.hit, snippet
        assert collide.distance(B, A, X_WB, X_WA).hit == r.hit, snippet
        collide.verify(A, B, X_WA, X_WB, r)
        hits += r.hit
    assert CASES // 6 <= hits <= CASES - CASES // 6, f"{hits} of {CASES} touch: the cases no longer lie on the edge"


def test_terms_add_up_to_the_exact_product():
    rng = np.random.default_rng(6)
    X_WB, X_BP = (np.array([_pose(rng) for _ in range(50)]) for _ in range(2))
    X_WB[0], X_BP[1] = np.eye(4), np.eye(4)
    table = pose_table(X_WB, X_BP, np.ones(50))
    assert (table.rows[:2, POSE_TERMS] == -1).all() and (table.rows[2:, POSE_TERMS] == np.arange(48)).all()
    for k in range(50):
        W, P = ([[Fraction(v) for v in row] for row in X.tolist()] for X in (X_WB[k], X_BP[k]))
        product = [[sum(W[i][m] * P[m][j] for m in range(4)) for j in range(4)] for i in range(3)]
        assert table.exact(k) == [v for row in product for v in row[:3]] + [row[3] for row in product]


def test_products_too_small_to_be_exact_stay_open():
    """Low parts that underflow: the pose is not known exactly, and the pair is not decided on a guess."""
    X = np.eye(4)
    X[0, 1], X[1, 0] = 1e-170, -1e-170
    A = collide.Compound([(collide.Box((1, 1, 1)), X)])
    r = collide.distance(A, collide.Box((1, 1, 1)), X, collide.pose((0, 0, 1)))
    assert r.how == UNDECIDED and r.hit and not r.certified and r.lower < 0 < r.upper


def test_rows_of_a_world_carry_certificates():
    rng = np.random.default_rng(7)
    world = collide.World()
    for k in range(24):
        shape = collide.Compound([(collide.Box((1, 1, 1)), _pose(rng)), (collide.Sphere(0.3), _pose(rng))])
        world.add(shape if k % 3 else collide.ConvexHull(rng.normal(size=(12, 3))), collide.pose(rng.uniform(-2, 2, 3)))
    rows = world.distances(0.3)
    world.set_pose(0, collide.pose((9, 9, 9)))  # the rows keep the poses they were asked at
    hits = 0
    for k in range(len(rows)):
        r = rows.pair(k)
        assert r.rows.tobytes() == rows.rows[k : k + 1].tobytes()
        collide.verify(*r.question, r)
        hits += r.hit
    assert 20 < hits < len(rows)
    outside = world.query(collide.Box((2, 2, 2)), np.eye(4), 0.1)
    assert len(outside) > 3
    for k in range(len(outside)):
        r = outside.pair(k)
        collide.verify(*r.question, r)
    with pytest.raises(IndexError):
        rows.pair(len(rows))


# --- what a compound costs, counted, and what it must not cost: bits ------------------------------


def _row_of_boxes(parts: int) -> collide.Compound:
    """Boxes side by side with gaps as wide as themselves."""
    return collide.Compound([(collide.Box((1, 1, 1)), collide.pose((2.0 * k, 0, 0))) for k in range(parts)])


def _asked(question) -> int:
    """How many pairs of parts a batch asks the narrowphase about."""
    before = unions.of_thread.asked
    question()
    return unions.of_thread.asked - before


@pytest.mark.parametrize("ask", [collide.collide, collide.distance, _gap])
def test_parts_far_away_are_not_asked(ask):
    A, B = (
        _row_of_boxes(64),
        collide.Compound([(collide.Box((0.2, 0.2, 0.2)), collide.pose((0, 0, 0.1 * k))) for k in range(2)]),
    )
    rng = np.random.default_rng(8)
    X = np.array([collide.pose((2.0 * rng.integers(64), 0.0, rng.uniform(-1.5, 0.2))) for _ in range(200)])
    turned = np.array([collide.pose(rpy=(0.1, 0.2, 0.3))])
    X = turned @ X
    hits = collide.collide(A, B, turned, X)
    assert 20 < hits.sum() < 180
    count = _asked(lambda: ask(A, B, turned, X))
    assert 100 < count <= 8 * len(X), f"{count} of {64 * 2 * len(X)} pairs of parts"


def test_booleans_of_bodies_far_apart_ask_nothing():
    A = _row_of_boxes(16)
    X = np.array([collide.pose((0, 0, 40 + k)) for k in range(50)])
    assert not collide.collide(A, A, np.eye(4), X).any()
    assert _asked(lambda: collide.collide(A, A, np.eye(4), X)) == 0
    assert _asked(lambda: collide.distance(A, A, np.eye(4), X)) >= len(X)


def test_beyond_a_limit_few_parts_are_asked_and_its_bounds_hold():
    """Beyond it no pair has an upper bound, by which others are left out; what is told of them holds for all."""
    rng, beyond = rng_of("parts beyond a limit"), 0
    box, ball = collide.Box((0.2, 0.1, 0.15)), collide.Sphere(0.1)
    for case in range(6):
        A, B = (collide.Compound([((box, ball)[k % 2], random_pose(rng, 0.7)) for k in range(40)]) for _ in "ab")
        X_WA = np.array([random_pose(rng, 1.0) for _ in range(8)])
        X_WB = X_WA @ np.array([collide.pose((4.0 + case, 0.3, 0.2), rpy=rng.uniform(-3, 3, 3)) for _ in range(8)])
        rows = collide.distance(A, B, X_WA, X_WB).rows
        for limit in (0.01, 0.999 * rows["distance"].min(), float(np.median(rows["distance"])), 1e3):
            limit = max(float(limit), 0.0)
            before = unions.of_thread.asked
            within = collide.distance(A, B, X_WA, X_WB, max_distance=limit).rows
            count = unions.of_thread.asked - before
            assert count <= 60 * len(X_WA), (case, limit, count)
            far = ~rows["hit"] & (rows["distance"] > limit)
            assert (within["beyond"] == far).all(), (case, limit)
            assert (within["lower"][far] > limit).all() and (within["lower"][far] <= rows["upper"][far]).all()
            same = all((within[~far][of] == rows[~far][of]).all() for of in ("lower", "distance", "upper", "normal"))
            assert same, (case, limit)
            swapped = collide.distance(B, A, X_WB, X_WA, max_distance=limit).rows
            assert all((swapped[of] == within[of]).all() for of in ("lower", "distance", "upper", "beyond"))
            beyond += int(far.sum())
    assert 60 < beyond < 160, beyond


@pytest.mark.parametrize("lay", ["scattered", "in a grid"])
def test_groups_of_parts_leave_no_nearest_pair_out(lay):
    """Two unions of many parts, far apart, near and meeting; in a grid, many pairs are equally near: the first in order
    is named, the one that every pair asked alone tells."""
    rng, n, hits = rng_of("groups", lay), 70, 0
    ball = collide.Sphere(0.06)
    if lay == "in a grid":
        places = np.stack(np.meshgrid(range(7), range(10), [0.0], indexing="ij"), axis=-1).reshape(-1, 3) * 0.25
        poses = [collide.pose(p) for p in rng.permutation(places)]
    else:
        poses = [random_pose(rng, 1.0) for _ in range(n)]
    A, B = (collide.Compound([(ball, X) for X in some]) for some in (poses, poses[::-1]))
    for z in (0.1, 0.3, 1.0, 6.0):
        X_WB = collide.pose((0.0, 0.0, z), rpy=(0, 0, 0) if lay == "in a grid" else rng.uniform(-3, 3, 3))
        r = collide.distance(A, B, np.eye(4), X_WB, signed=False)
        at = np.array([X[:3, 3] for X in poses]), np.array([(X_WB @ X)[:3, 3] for X in poses[::-1]])
        gaps = np.sqrt(np.square(at[0][:, None] - at[1][None]).sum(axis=2)) - 0.12
        hits += bool(r.hit)
        assert r.hit == (gaps.min() <= 0.0) == collide.collide(A, B, np.eye(4), X_WB)
        if not r.hit:
            assert abs(r.distance - gaps.min()) < 1e-12
            assert gaps[r.part_a, r.part_b] < gaps.min() + 1e-12
            first = np.flatnonzero(gaps.ravel() < gaps.min() + 1e-12)[0]
            assert r.part_a * n + r.part_b == first
    assert 1 <= hits < 4, hits


def test_gaps_alone_stop_at_the_first_overlap():
    """Boxes in one place: with depths each has a say, without them one is enough."""
    A = collide.Compound([(collide.Box((1, 1, 1)), collide.pose((0.01 * k, 0, 0))) for k in range(12)])
    X = np.array([collide.pose((0.1, 0.1, 0.1 * k), rpy=(0.1, 0.2, 0.3)) for k in range(5)])
    assert _asked(lambda: collide.distance(A, collide.Box((1, 1, 1)), np.eye(4), X)) == 12 * len(X)
    assert _asked(lambda: collide.distance(A, collide.Box((1, 1, 1)), np.eye(4), X, signed=False)) == len(X)


def _pairs_of_unions():
    """(A, B, X_WA, X_WB): unions of all kinds of parts, some nested, some in one place."""
    rng = rng_of("costs")
    kinds = [kind for kind in naive.KINDS if kind not in ("Halfspace", "Compound")]
    for case in range(24):
        made = []
        for _ in range(2):
            parts = []
            for kind in rng.choice(kinds, int(rng.integers(1, 6))):
                part = naive.one_of_each(rng)[kind]
                if rng.random() < 0.2:
                    part = collide.Compound([(part, random_pose(rng, 0.3))])
                parts.append((part, random_pose(rng, 0.8) if rng.random() < 0.8 else np.eye(4)))
            made.append(collide.Compound(parts))
        A, B = made if case % 3 else (made[0], naive.one_of_each(rng)[kinds[case // 3]])
        spread = (0.6, 1.5, 4.0)[case % 4 % 3]
        yield A, B, *(np.array([random_pose(rng, spread) for _ in range(40)]) for _ in range(2))


def test_unions_have_the_same_bits_single_batched_swapped_in_threads_lists_and_sets(monkeypatch):
    monkeypatch.setattr(batches, "_MIN_POSES_PER_THREAD", 8)
    hits = []
    for A, B, X_WA, X_WB in _pairs_of_unions():
        n = len(X_WA)
        library = collide.ShapeSet([B, collide.Sphere(1), A])
        for question in (collide.distance, _gap):
            rows = question(A, B, X_WA, X_WB).rows
            hits.extend(rows["hit"])
            assert (collide.collide(A, B, X_WA, X_WB) == rows["hit"]).all()
            for k in range(n):
                with naive.reproducible(Case(A, B, X_WA[k], X_WB[k])):
                    question(A, B, X_WA[k], X_WB[k])  # prepared by now
                    assert question(A, B, X_WA[k], X_WB[k]).rows.tobytes() == rows[k].tobytes()
                    assert collide.collide(A, B, X_WA[k], X_WB[k]) == rows["hit"][k]
            others = {
                "threads": question(A, B, X_WA, X_WB, threads=3).rows,
                "list": question([A] * n, B, X_WA, X_WB).rows,
                "set": question(library[np.full(n, 2)], library[np.zeros(n, dtype=int)], X_WA, X_WB).rows,
                "mixed list": question([A, collide.Box((1, 1, 1))] * (n // 2), B, X_WA, X_WB).rows[::2],
            }
            for name, found in others.items():
                assert not naive.same_bits(found, rows[:: n // len(found)]), (name, A, B)
            swapped = flipped(question(B, A, X_WB, X_WA).rows)
            for field in ("distance", "lower", "upper", "hit", "certified", "how"):
                assert (swapped[field] == rows[field]).all(), (field, A, B)
    assert 0.2 < np.mean(hits) < 0.8


def test_parts_left_out_have_no_say():
    """Every pair of parts asked on its own, as unions were once: the same gaps, the same ends of brackets."""
    compared = 0
    for A, B, X_WA, X_WB in _pairs_of_unions():
        found = collide.distance(A, B, X_WA, X_WB).rows
        every = np.array([_rows_of_part(*one, *other, X_WA, X_WB) for one in parts_of(A) for other in parts_of(B)])
        least = every["distance"].min(axis=0)
        apart = ~found["hit"]
        assert (found["distance"][apart] == least[apart]).all() and (
            found["lower"][apart] == every["lower"].min(axis=0)[apart]
        ).all()
        assert (found["upper"] == every["upper"].min(axis=0)).all()
        assert (found["hit"] == every["hit"].any(axis=0)).all()
        compared += apart.sum()
    assert compared > 200


def _rows_of_part(one, X, other, Y, X_WA, X_WB) -> np.ndarray:
    """The rows of two parts by themselves, with poses multiplied out by the table."""
    n = len(X_WA)
    poses = pose_table(
        np.concatenate([X_WA, X_WB]), np.concatenate([np.tile(X, (n, 1, 1)), np.tile(Y, (n, 1, 1))]),
        np.repeat([one.reach, other.reach], n),
    )
    pairs = np.stack([np.arange(n), n + np.arange(n)], axis=1)
    return run.run_pairs(ShapeTable([one, other]), poses, np.repeat([0, 1], n), pairs, boolean=False, limit=np.inf)


@pytest.mark.own_kernels
def test_poses_of_parts_are_those_of_the_pose_table():
    """Bit by bit, low parts too: a part placed in the kernel of unions and one of a World."""
    rng = np.random.default_rng(9)
    part = collide.Box((0.3, 0.4, 0.5))
    made = 0
    for k in range(60):
        X_WB, X_BP = (random_pose(rng, 10.0 ** rng.integers(-6, 6)) for _ in range(2))
        X_WB = np.eye(4) if k == 0 else X_WB
        X_BP = np.eye(4) if k == 1 else X_BP
        if k == 2:
            X_BP[0, 1], X_WB[1, 0] = 1e-170, 1e-170
        expected = pose_table(X_WB[None], X_BP[None], np.array([convex_set_of(part).reach]))
        body = pose_table(X_WB[None], np.eye(4)[None], np.zeros(1)).rows
        poses, terms = np.zeros((2, POSE)), np.zeros((2, TERM_ROW))
        poses[0], poses[0, POSE_STRETCH] = body[0], 1.0
        laid_out = lay_out(((convex_set_of(part), X_BP),)).parts
        placed(address_of(poses), address_of(laid_out), address_of(terms))
        assert poses[1, :POSE_TERMS].tobytes() == expected.rows[0, :POSE_TERMS].tobytes(), (k, X_WB, X_BP)
        assert (poses[1, POSE_TERMS] >= 0) == (expected.rows[0, POSE_TERMS] >= 0), (k, X_WB, X_BP)
        if len(expected.terms):
            assert (terms[1] == expected.terms[0]).all(), (k, X_WB, X_BP)
            made += 1
    assert made == 57


def test_a_single_union_is_one_call(monkeypatch):
    """Once prepared, nothing of Python is between the call and the kernel's answer."""
    if not single_calls_are_safe():
        pytest.skip("single calls go the long way here")
    A, B = _row_of_boxes(4), collide.Box((1, 1, 1))
    X, Y = np.eye(4), collide.pose((0.2, 0.3, 0.4), rpy=(0.1, 0.2, 0.3))
    before = [collide.collide(A, B, X, Y), collide.distance(A, B, X, Y), collide.distance(A, B, X, Y, signed=False)]

    def refuse(*_, **__):
        raise AssertionError("the long way")

    monkeypatch.setattr(query, "answer_batch", refuse)
    after = [collide.collide(A, B, X, Y), collide.distance(A, B, X, Y), collide.distance(A, B, X, Y, signed=False)]
    assert before[0] == after[0] and all(r.rows.tobytes() == s.rows.tobytes() for r, s in zip(before[1:], after[1:]))
    with pytest.raises(AssertionError, match="the long way"):
        collide.distance(A, B, X, Y.astype(np.float32))


def test_more_pairs_of_parts_than_a_list_holds():
    """Poses whose pairs of parts take several lists, beside ones that take none: as one by one."""
    rng = np.random.default_rng(10)
    A = collide.Compound([(collide.Box(rng.uniform(0.5, 1, 3)), random_pose(rng, 0.3)) for _ in range(24)])
    X = np.array([random_pose(rng, 0.3 if k % 2 else 30.0) for k in range(6)])
    rows = collide.distance(A, A, np.eye(4), X).rows
    assert _asked(lambda: collide.distance(A, A, np.eye(4), X)) > 256
    for k in range(6):
        assert collide.distance(A, A, np.eye(4), X[k : k + 1]).rows.tobytes() == rows[k].tobytes()
        assert collide.collide(A, A, np.eye(4), X[k]) == rows["hit"][k] == bool(k % 2)


def test_near_parts_are_listed_in_the_order_of_their_numbers():
    """Listed as groups are opened, and sorted: a single pose, whose groups are placed once, has the bytes of a batch,
    and the distance of the nearest part."""
    rng, n_far = rng_of("near parts in order"), 0
    A = collide.Compound([(collide.Sphere(float(rng.uniform(0.02, 0.1))), random_pose(rng, 0.7)) for _ in range(300)])
    B = collide.Compound([(collide.Box(rng.uniform(0.05, 0.2, 3)), random_pose(rng, 0.3)) for _ in range(3)])
    X = np.stack([random_pose(rng, 0.1) for _ in range(12)])
    Y = np.stack([random_pose(rng, 0.1) @ collide.pose(rng.normal(size=3) * 0.3 * k) for k in range(12)])
    for ask in (collide.distance, partial(collide.distance, signed=False), partial(collide.distance, max_distance=0.3)):
        batch = ask(A, B, X, Y)
        for k in range(12):
            single = ask(A, B, X[k], Y[k])
            assert single.rows.tobytes() == batch[k].rows.tobytes(), k
    gaps = collide.distance(A, B, X, Y, signed=False)
    for k in range(12):
        parts = min(
            collide.distance(a, b, X[k] @ X_A, Y[k] @ X_B, signed=False).distance
            for (a, X_A), (b, X_B) in itertools.product(A.items, B.items)
        )
        assert gaps.lower[k] - 1e-12 <= parts <= gaps.upper[k] + 1e-12, k
        n_far += parts > 0.5
    assert 3 <= n_far <= 11, n_far


@pytest.mark.skipif(not single_calls_are_safe(), reason="single calls go the long way here")
def test_single_calls_of_many_parts_have_the_bytes_of_batches():
    """More pairs of parts than a single call answers: far, near, meeting, and with more overlaps than listed."""
    rng, answered = rng_of("single calls of many parts"), {"collide": 0, "distance": 0}
    A, B = (collide.Compound([(collide.Box(rng.uniform(0.1, 0.3, 3)), random_pose(rng, 1.0)) for _ in range(90)])
            for _ in "ab")
    X_WA = random_pose(rng, 1.0)
    for away in (0.0, 0.6, 1.4, 1.7, 2.0, 2.5, 9.0, 100.0):
        X_WB = random_pose(rng, 1.0)
        X_WB[:3, 3] = X_WA[:3, 3] + away * np.array([0.6, 0.48, 0.64])
        single, batch = collide.collide(A, B, X_WA, X_WB), collide.collide(A, B, X_WA[None], X_WB[None])
        assert single == batch[0]
        for options in ({"signed": False}, {}, {"max_distance": 0.3}):
            row = collide.distance(A, B, X_WA, X_WB, **options)
            many = collide.distance(A, B, X_WA[None], X_WB[None], **options)
            assert [row.lower, row.upper, row.distance, *row.normal, row.part_a, row.part_b, row.how] == [
                many.lower[0], many.upper[0], many.distance[0], *many.normal[0], many.part_a[0], many.part_b[0],
                many.how[0],
            ]
        pair = prepared_pair(A, B)
        answered["collide"] += pair.collide(X_WA, X_WB) is not None
        answered["distance"] += pair.distance(X_WA, X_WB, bytearray(PAIR_DTYPE.itemsize), True, np.inf) is not None
    assert answered["collide"] == 8 and 3 <= answered["distance"] < 8, answered


@pytest.mark.parametrize("away", [3.0, 20.0, 200.0])
def test_planes_leave_out_most_parts_that_are_near_by_their_balls(away):
    """Slabs, balls, capsules and small hulls: the distance is that of the parts one by one, and few are asked."""
    rng, asked, n_near, half = rng_of("planes", away), 0, 0, np.array((0.2, 0.15, 0.1))
    makers = (lambda w: collide.Box(w), lambda w: collide.Sphere(w[0]), lambda w: collide.Capsule(w[0], w[1]),
              lambda w: collide.ConvexHull(np.vstack([np.diag(w), -np.diag(w[::-1])])))
    B = collide.Box(2 * half)
    for _ in range(12):
        items = [(makers[int(rng.integers(4))](rng.uniform(0.05, 0.5, 3) * (1, 1, 0.3)), random_pose(rng, 1.0))
                 for _ in range(150)]
        A, X_WA, X_WB = collide.Compound(items), random_pose(rng, 1.0), random_pose(rng, 1.0)
        X_WB[:3, 3] = X_WA[:3, 3] + away * naive.unit(rng.normal(size=3))
        rows = [collide.distance(shape, B, X_WA @ X, X_WB, signed=False) for shape, X in items]
        of_all = collide.distance(A, B, X_WA, X_WB, signed=False)
        asked += _asked(lambda A=A, X=X_WA, Y=X_WB: collide.distance(A, B, X[None], Y[None], signed=False))
        assert abs(of_all.distance - min(row.distance for row in rows)) < 1e-13 * away
        balls = layout_of(A).parts
        centres = balls[:, CENTRE : CENTRE + 3] @ X_WA[:3, :3].T + X_WA[:3, 3] - X_WB[:3, 3]
        gaps = np.linalg.norm(centres, axis=1) - balls[:, BALL] - balls[:, SWEPT_RADIUS] - np.linalg.norm(half)
        n_near += int((gaps <= rows[int(gaps.argmin())].distance).sum())
    assert 12 <= asked < 0.7 * n_near, (asked, n_near)
