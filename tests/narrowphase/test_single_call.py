"""Single `distance(signed=False)`: one call of a kernel, the bits of a batch."""

from __future__ import annotations

import pickle
import sys
import threading
from itertools import combinations_with_replacement

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of

import collide
from collide.base.free_threads import FREE_THREADED
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe
from collide.pairs import query


def test_single_gaps_have_the_bits_of_a_batch(monkeypatch):
    """Of all kinds of shapes, apart, overlapping and touching; most take the one call."""
    rng = rng_of("single gaps")
    kinds = [kind for kind in naive.KINDS if kind != "Halfspace"]
    hits, long_way = [], []
    answer_batch = query.answer_batch
    monkeypatch.setattr(
        query, "answer_batch", lambda *args, **named: (long_way.append(1), answer_batch(*args, **named))[1]
    )
    for kind_a, kind_b in combinations_with_replacement(kinds, 2):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        X, Y = (np.array([random_pose(rng, 0.8) for _ in range(12)]) for _ in range(2))
        rows = collide.distance(A, B, X, Y, signed=False).rows
        for k in range(len(X)):
            with naive.reproducible(Case(A, B, X[k], Y[k])):
                single = collide.distance(A, B, X[k], Y[k], signed=False)
                assert single.rows.tobytes() == rows[k].tobytes()
                assert single.question[2].tobytes() == X[k].tobytes()
        hits.extend(rows["hit"])
    box = collide.Box((1, 1, 1))
    for t in ((1, 0.25, 0.125), (1 + 2**-52, 0.25, 0.125), (1 - 2**-53, 0, 0)):  # the exact stage
        X = collide.pose(t)
        rows = collide.distance(box, box, np.eye(4), X[None], signed=False).rows
        assert collide.distance(box, box, np.eye(4), X, signed=False).rows.tobytes() == rows.tobytes()
    assert 0.2 < naive.share(hits) < 0.9
    if single_calls_are_safe():
        batches = len(list(combinations_with_replacement(kinds, 2))) + 3
        assert len(long_way) - batches < 0.02 * len(hits), "single gaps go the long way"


def test_first_calls_have_the_bits_of_a_batch(monkeypatch):
    """Of new shapes of all kinds: what is prepared answers at once, by the one call that all later ones take."""
    rng = rng_of("first calls")
    kinds = [kind for kind in naive.KINDS if kind not in ("Halfspace", "Mesh", "Compound")]
    answer_batch = query.answer_batch
    long_way, hits = [], []

    def new(shape):
        return pickle.loads(pickle.dumps(shape))

    for kind_a, kind_b in combinations_with_replacement(kinds, 2):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        X, Y = random_pose(rng, 0.8), random_pose(rng, 0.8)
        row = collide.distance(A, B, X[None], Y[None], signed=False).rows
        contacts = collide.contacts(A, B, X[None], Y[None], margin=0.1).rows
        monkeypatch.setattr(
            query, "answer_batch", lambda *args, **named: (long_way.append(1), answer_batch(*args, **named))[1]
        )
        with naive.reproducible(Case(A, B, X, Y)):
            assert collide.collide(new(A), new(B), X, Y) is bool(row["hit"][0])
            assert collide.distance(new(A), new(B), X, Y, signed=False).rows.tobytes() == row.tobytes()
            within = collide.distance(new(A), new(B), X, Y, signed=False).upper <= 0.1
            assert collide.collide(new(A), new(B), X, Y, security_margin=0.1) is bool(within)
            assert collide.contacts(new(A), new(B), X, Y, margin=0.1).rows.tobytes() == contacts.tobytes()
            monkeypatch.undo()
            assert collide.collide(new(A), new(B), X.tolist(), Y) is bool(row["hit"][0])
        hits.append(row["hit"][0])
    assert 0.2 < naive.share(hits) < 0.9
    if single_calls_are_safe():
        assert len(long_way) <= 0.02 * len(hits), "first calls go the long way"


def test_first_calls_refuse_what_later_ones_do():
    A, B, X = collide.Box((1, 1, 1)), collide.Sphere(0.5), np.eye(4)
    for ask in (collide.collide, collide.distance, collide.contacts):
        for wrong in (2 * np.eye(4), np.full((4, 4), np.nan)):
            with pytest.raises(collide.InvalidPose, match="X_WB"):
                ask(collide.Box((1, 1, 1)), collide.Sphere(0.5), X, wrong)
        with pytest.raises(collide.InvalidArgument, match="check_poses"):
            ask(collide.Box((1, 1, 1)), collide.Sphere(0.5), X, X, check_poses="no")
        with pytest.raises(collide.InvalidArgument, match="A must be a shape"):
            ask(1.0, B, X, X)
        with pytest.raises(collide.InvalidArgument, match="B must be a shape"):
            ask(A, 1.0, X, X)


def functions_walked(call):
    """Names of the functions of Python that a call enters."""
    walked = []
    sys.setprofile(lambda frame, event, _: walked.append(frame.f_code.co_name) if event == "call" else None)
    try:
        call()
    finally:
        sys.setprofile(None)
    return walked[1:]


def test_new_pairs_walk_few_functions():
    """From the call to the answer of two shapes never seen before: those of the standard library and of C apart."""
    if not single_calls_are_safe() or query.collide.__class__.__name__ != "builtin_function_or_method":
        pytest.skip("without the library more of the walk is Python's")
    rng = rng_of("walk of new pairs")
    X, Y = np.eye(4), collide.pose((0.9, 0.1, 0.2))
    kinds = [kind for kind in naive.KINDS if kind in ("Box", "Sphere", "Capsule", "Cylinder", "Cone", "Ellipsoid")]
    assert len(kinds) == 6
    for kind_a, kind_b in combinations_with_replacement(kinds, 2):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        collide.collide(*(naive.one_of_each(rng)[kind] for kind in (kind_a, kind_b)), X, Y)  # loads what is lazy
        walked = functions_walked(lambda A=A, B=B: collide.collide(A, B, X, Y))
        limit = 15 + 2 * FREE_THREADED + 6 * (kind_a, kind_b).count("Capsule")  # a workspace of the thread, looked up
        assert prepared_pair(A, B) is not None and len(walked) <= limit, walked


def test_pairs_of_few_numbers_hold_one_block():
    """Nothing else is kept of two boxes but what the pair needs: no table, no packed sets, until batches ask."""
    if not single_calls_are_safe():
        pytest.skip("plain kernels have no single calls")
    A, B, X, Y = collide.Box((1, 2, 3)), collide.Sphere(0.5), np.eye(4), collide.pose((0.9, 0.0, 0.0))
    assert collide.collide(A, B, X, Y) is True
    pair = prepared_pair(A, B)
    assert pair.table is None and not hasattr(A, "_parts") and not hasattr(B, "_parts")
    assert collide.collide(A, B, X, np.stack([Y, Y])).all() and pair.table is not None
    first = pair.table
    assert collide.distance(A, B, X, np.stack([Y, Y])).hit.all() and pair.table is first


def test_contacts_first_leaves_the_other_questions_to_be_made_ready():
    """Single contacts, then batches that keep a table, then a boolean: each by its kernel."""
    if not single_calls_are_safe():
        pytest.skip("plain kernels have no single calls")
    A, B, X, Y = collide.Box((1, 2, 3)), collide.Box((3, 2, 1)), np.eye(4), collide.pose((0.9, 0.0, 0.0))
    one = collide.contacts(A, B, X, Y)
    pair = prepared_pair(A, B)
    assert pair.contacts is not None and pair.collide is None and pair.table is None
    assert collide.contacts(A, B, X, np.stack([Y, Y])).rows[: len(one)].tobytes() == one.rows.tobytes()
    first = pair.table
    assert first is not None and len(collide.contacts(A, B, X, Y[None])) == len(one) and pair.table is first
    assert collide.collide(A, B, X, Y) is True and pair.collide is not None and pair.distance is not None
    assert prepared_pair(A, B) is pair and pair.table is first


def test_contacts_of_pairs_of_equal_numbers_are_equal_and_made_once():
    """Pairs hold what they read, and nothing is added with a call."""
    if not single_calls_are_safe():
        pytest.skip("plain kernels have no single calls")
    X, Y = np.eye(4), collide.pose((0.9, 0.0, 0.0))
    rows = []
    for _ in range(3):
        A, B = collide.Box((1, 1.25, 1)), collide.Capsule(0.5, 0.75)
        rows.append(collide.contacts(A, B, X, Y).rows.tobytes())
        del A, B
    assert rows[0] == rows[1] == rows[2] and len(rows[0]) > 0
    A, B = collide.Box((1, 1.25, 1)), collide.Capsule(0.5, 0.75)
    collide.collide(A, B, X, Y), collide.contacts(A, B, X, Y)
    before = prepared_pair(A, B).held
    collide.contacts(A, B, X, Y), collide.distance(A, B, X, Y)
    assert prepared_pair(A, B).held is before


def test_faces_of_few_numbers_have_the_bits_of_packed_sets():
    """Contacts by the one block, and by a `HullFaceTable` of packed sets: of all aspects, slivers among them."""
    if not single_calls_are_safe():
        pytest.skip("plain kernels have no single calls")
    rng, n_rows = rng_of("faces of few numbers"), 0
    for k in range(150):
        size = np.exp(rng.normal(size=3) * (0.2, 2.0, 12.0)[k % 3]) if k % 4 else rng.integers(1, 4, 3) * 0.5
        A = collide.Box(np.clip(size, 1e-8, 1e8))
        least, most = float(A.size.min()), float(A.size.max())
        B = (collide.Box(A.size[::-1]), collide.Sphere(least), collide.Capsule(least, most))[k % 3]
        X, Y = np.eye(4), collide.pose((0.5 * A.size[0], 0.0, 0.0)) @ random_pose(rng, 0.0)
        with naive.reproducible(Case(A, B, X, Y)):
            rows = collide.contacts(A, B, X, Y, margin=0.01).rows
            assert prepared_pair(A, B).table is None, "the one block has no space for these faces"
            assert rows.tobytes() == collide.contacts(A, B, X[None], Y[None], margin=0.01).rows.tobytes()
        n_rows += len(rows)
    assert n_rows > 300


def test_single_gaps_of_what_has_no_depth():
    """Half-spaces that overlap without end are at distance 0: only their depth is refused."""
    floor, wall = collide.Halfspace((0, 0, 1), 0.0), collide.Halfspace((1, 0, 0), 0.0)
    for _ in range(2):  # the second time prepared
        r = collide.distance(floor, wall, np.eye(4), np.eye(4), signed=False)
        assert r.hit and r.distance == 0.0 and (r.normal == 0.0).all()
        with pytest.raises(collide.errors.UnsupportedQuery, match="no end"):
            collide.distance(floor, wall, np.eye(4), np.eye(4))


def test_touching_boxes_take_the_one_call():
    """Boxes that stand parallel, on a lattice: apart, touching and overlapping, by whole numbers.

    What doubles leave open of two hulls is settled inside the kernel: nothing but a depth goes the long way.
    """
    rng = rng_of("parallel boxes")
    signs = []
    for _ in range(60):
        sizes, t = 2.0 * rng.integers(1, 4, size=(2, 3)), rng.integers(-4, 5, size=3).astype(np.float64)
        A, B, X = collide.Box(sizes[0]), collide.Box(sizes[1]), collide.pose(t)
        gap = np.abs(t) - sizes.sum(axis=0) / 2.0
        with naive.reproducible(Case(A, B, np.eye(4), X)):
            row = collide.distance(A, B, np.eye(4), X[None], signed=False).rows
            for _ in range(2):  # the second time prepared
                assert collide.collide(A, B, np.eye(4), X) == (gap.max() <= 0.0)
            if single_calls_are_safe():
                pair = prepared_pair(A, B)
                assert pair.collide(np.eye(4), X) == (gap.max() <= 0.0)
                memory = bytearray(row.nbytes)
                assert pair.distance(np.eye(4), X, memory, False, np.inf) is not None and memory == row.tobytes()
        signs.append(np.sign(gap.max()))
    assert min(signs.count(sign) for sign in (-1.0, 0.0, 1.0)) >= 5


def test_single_limits_and_margins_have_the_bits_of_a_batch(monkeypatch):
    """Of all kinds of shapes, within the limit and beyond it; most take the one call, of meshes none."""
    rng = rng_of("single limits")
    kinds = [kind for kind in naive.KINDS if kind != "Halfspace"]
    beyond, long_way, asked = [], [], 0
    answer_batch = query.answer_batch
    monkeypatch.setattr(
        query, "answer_batch", lambda *args, **named: (long_way.append(1), answer_batch(*args, **named))[1]
    )
    for kind_a, kind_b in combinations_with_replacement(kinds, 2):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        X, Y = (np.array([random_pose(rng, 0.8) for _ in range(6)]) for _ in range(2))
        limit = float(rng.choice([1e-3, 0.05, 0.2]))
        for signed in (True, False):
            rows = collide.distance(A, B, X, Y, max_distance=limit, signed=signed).rows
            for k in range(len(X)):
                with naive.reproducible(Case(A, B, X[k], Y[k])):
                    single = collide.distance(A, B, X[k], Y[k], max_distance=limit, signed=signed)
                    assert single.rows.tobytes() == rows[k].tobytes()
        within = collide.collide(A, B, X, Y, security_margin=limit)
        long_way.clear()
        for k in range(len(X)):
            with naive.reproducible(Case(A, B, X[k], Y[k])):
                told = collide.collide(A, B, X[k], Y[k], security_margin=limit)
                assert told is bool(within[k])
        if kind_a != "Mesh" and kind_b != "Mesh":
            beyond.extend(rows["beyond"])
            asked += len(X) - len(long_way)
    assert 0.1 < naive.share(beyond) < 0.9
    if single_calls_are_safe():
        assert asked > 0.9 * len(beyond), "margins go the long way"


def test_single_margins_of_exactly_the_gap_go_the_long_way():
    """The margin lies within the bracket: integers say, on grown bodies; one call leaves it to them."""
    A, B, X = collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), collide.pose((1.3, 0, 0))
    gap = collide.distance(A, B, np.eye(4), X)
    answers = set()
    for margin in (np.nextafter(gap.lower, 0.0), gap.lower, gap.distance, gap.upper, np.nextafter(gap.upper, 1.0)):
        for _ in range(2):  # the second time prepared
            answers.add((float(margin), collide.collide(A, B, np.eye(4), X, security_margin=float(margin))))
    assert len({margin for margin, _ in answers}) == len(answers), "an answer depends on what was asked before"
    assert {told for _, told in answers} == {True, False}
    if single_calls_are_safe():
        assert prepared_pair(A, B).within(np.eye(4), X, 0.5) is True
        assert prepared_pair(A, B).within(np.eye(4), X, 0.1) is False


def test_threads_that_ask_with_limits_of_their_own():
    """The limit and the margin come with the call: threads that share a prepared pair do not share them."""
    A, B, X = collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), collide.pose((1.25, 0, 0))
    collide.distance(A, B, np.eye(4), X)
    collide.contacts(A, B, np.eye(4), X)
    wrong = []

    def ask(limit: float) -> None:
        for _ in range(400):
            if bool(collide.distance(A, B, np.eye(4), X, max_distance=limit).beyond) is not (limit < 0.25):
                wrong.append(limit)
            if len(collide.contacts(A, B, np.eye(4), X, margin=limit)) != (0 if limit < 0.25 else 4):
                wrong.append(limit)

    threads = [threading.Thread(target=ask, args=(limit,)) for limit in (0.0, 0.1, 0.3, 1.0)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
