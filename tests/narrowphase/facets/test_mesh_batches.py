"""Batches of a prepared pair of bodies of facets: straight to the kernel, with the answers of the long way."""

from __future__ import annotations

import gc
import inspect
import math
import pickle
import sys
import threading
from collections import Counter

import naive
import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.narrowphase import single_queries
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.convex_kernel_calls import finish_distances
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe
from collide.pairs import query
from collide.pairs.batches import answer_batch

EYE = np.eye(4)
MESH = collide.Mesh(*bumpy_sphere(60))
CUBE = collide.Mesh(*(np.array(v) for v in (
    [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)],
    [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
     (1, 5, 7), (1, 7, 3)],
)))
PARTNERS = {
    "mesh": CUBE, "the same": MESH, "box": collide.Box((0.5, 0.6, 0.7)), "sphere": collide.Sphere(0.4),
    "surface": collide.Mesh(np.eye(3), [[0, 1, 2]], solid=False),
}

prepares = pytest.mark.skipif(not single_calls_are_safe(), reason="pairs are not prepared here")


def long_way(A, B, X_WA, X_WB, question: Question) -> np.ndarray:
    X_WA, X_WB = (np.ascontiguousarray(X).reshape(-1, 4, 4) for X in (X_WA, X_WB))
    if question.boolean:
        return answer_batch(A, B, X_WA, X_WB, question)
    return answer_batch(
        A, B, X_WA, X_WB, question, finish=lambda rows: finish_distances(rows, depths=question.depths) and None
    )


@pytest.fixture()
def no_long_way(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("asked as Python has it")

    monkeypatch.setattr(query, "answer_batch", refuse)


@pytest.mark.many(4)
@pytest.mark.parametrize("name", PARTNERS)
@pytest.mark.parametrize("shared", [None, "X_WA", "X_WB"])
def test_batches_have_the_bytes_of_the_long_way_and_of_single_calls(name, shared):
    rng, seen = rng_of("mesh batches", name, shared), Counter()
    for A, B in ((MESH, PARTNERS[name]), (PARTNERS[name], MESH)):
        X, Y = (np.stack([random_pose(rng, 1.0) for _ in range(24)]) for _ in range(2))
        X, Y = X[0] if shared == "X_WA" else X, Y[:1] if shared == "X_WB" else Y
        collide.collide(A, B, X, Y)  # from here on the pair is ready
        with naive.reproducible(naive.Case(A, B, X.reshape(-1, 4, 4)[0], Y[0])):
            hits = collide.collide(A, B, X, Y)
            assert hits.dtype == np.bool_ and np.array_equal(hits, long_way(A, B, X, Y, Question(True, check=True)))
            seen.update(hits.tolist())
            for limit in (math.inf, 0.2, 0):
                for signed in (True, False):
                    r = collide.distance(A, B, X, Y, max_distance=limit, signed=signed)
                    wanted = long_way(A, B, X, Y, Question(False, limit, signed, True))
                    assert r.rows.tobytes() == wanted.tobytes() and not r.is_single
                    assert r.question[2].shape == X.reshape(-1, 4, 4).shape and not np.shares_memory(r.question[2], X)
            k = int(rng.integers(24))
            X_k, Y_k = X if X.ndim == 2 else X[k], Y[k if len(Y) > 1 else 0]
            assert collide.collide(A, B, X_k, Y_k) is bool(hits[k])
            assert collide.distance(A, B, X_k, Y_k).rows.tobytes() == collide.distance(A, B, X, Y)[k].rows.tobytes()
            back = pickle.loads(pickle.dumps(r))
            assert back.rows.tobytes() == r.rows.tobytes() and np.array_equal(back.question[3], Y)
    assert min(seen[True], seen[False]) >= 4, seen


def test_touching_radii_are_decided():
    """A ball whose radius is its distance from a facet, to rounding: the kernel leaves the sign to facets."""
    rng, n_hits = rng_of("open in batches"), 0
    surface = collide.Mesh([(-2, -2, 0), (2, -2, 0), (0, 3, 0)], [[0, 1, 2]], solid=False)
    for _ in range(6):
        X = random_pose(rng, 1.0)
        radius = float(rng.uniform(0.1, 0.5))
        ball = collide.Sphere(radius)
        at = np.stack([X @ collide.pose((*rng.uniform(-0.3, 0.3, 2), radius)) for _ in range(8)])
        collide.collide(surface, ball, X, at)
        hits = collide.collide(surface, ball, X, at)
        assert np.array_equal(hits, long_way(surface, ball, X, at, Question(True, check=True)))
        for signed in (True, False):
            r = collide.distance(surface, ball, X, at, signed=signed)
            assert r.rows.tobytes() == long_way(surface, ball, X, at, Question(False, math.inf, signed, True)).tobytes()
            assert not (r.how == collide.How.UNDECIDED).any()
            n_hits += int(r.hit.sum())
    assert 8 <= n_hits <= 88, n_hits


@pytest.mark.parametrize("ask", [collide.collide, collide.distance])
def test_what_is_no_pose_is_named_by_the_batch(ask):
    box = collide.Box((1, 1, 1))
    X = np.stack([collide.pose((3, k, 0)) for k in range(5)])
    ask(MESH, box, EYE, X)
    for bad in (2 * EYE, np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0])):
        wrong = X.copy()
        wrong[3] = bad
        with pytest.raises(collide.InvalidPose, match=r"X_WB\[3\]"):
            ask(MESH, box, EYE, wrong)
    stretched = X.copy()
    stretched[3, :3, :3] *= 1.5  # a pose for those who do not look
    said = ask(MESH, box, EYE, stretched, check_poses=False)
    assert len(said) == 5
    for given in (X.tolist(), X.astype(np.float32), np.asfortranarray(X), X[:0], X[::2], X[:, :3]):
        try:
            said = ask(MESH, box, EYE, given)
        except collide.CollideError:
            assert np.shape(given)[1:] != (4, 4)
        else:
            assert len(said) == len(given)
    with pytest.raises(collide.InvalidArgument, match="lengths do not match"):
        ask(MESH, box, X, X[:3])


@prepares
def test_batches_of_a_prepared_pair_do_not_go_the_long_way(no_long_way):
    """A call's fixed cost was 28 µs, and 38 µs of distances: 2.9 and 5.8 now, the arrays of the answer among them."""
    box, X = collide.Box((1, 1, 1)), np.stack([collide.pose((9, k, 0)) for k in range(5)])
    for B in (MESH, box, collide.Sphere(0.5), collide.Mesh(*bumpy_sphere(30))):
        for A in (MESH, collide.Mesh(*bumpy_sphere(40))):
            collide.collide(A, B, EYE, X[0])  # makes the pair ready
            collide.distance(A, B, X, EYE)  # makes slabs around facets, and this thread its workspace
            for options in ({}, {"max_distance": 0.1}, {"signed": False}, {"check_poses": True, "threads": 1}):
                n, r = _python_calls(collide.distance, A, B, X, EYE, **options)
                assert n <= 16 and len(r) == 5 and not r.hit.any(), n
            n, hits = _python_calls(collide.collide, A, B, EYE, X)
            assert n <= 12 and not hits.any(), n


def _python_calls(ask, *arguments, **options):
    """(functions of Python called by a call, its answer), without those at the end of other tests' shapes."""
    calls = []
    gc.disable()
    sys.setprofile(lambda frame, event, _: calls.append(frame.f_code.co_name) if event == "call" else None)
    try:
        answer = ask(*arguments, **options)
    finally:
        sys.setprofile(None)
        gc.enable()
    return len(calls), answer


@prepares
def test_bodies_of_very_many_parts_are_prepared_for_batches_alone(monkeypatch):
    vertices, faces = bumpy_sphere(6)
    at = np.array([(x, y, 0.0) for x in range(9) for y in range(9)]) * 4.0
    many = collide.Mesh(
        np.concatenate([vertices + t for t in at]),
        np.concatenate([faces + len(vertices) * k for k in range(len(at))]),
    )
    box, X = collide.Box((1, 1, 1)), np.stack([EYE, collide.pose((2, 2, 0)), collide.pose((0, 0, 9))])
    first = collide.collide(many, box, EYE, X)
    pair = prepared_pair(many, box)
    assert pair.collide is None and pair.collide_poses is not None
    assert first.tolist() == [collide.collide(many, box, EYE, Y) for Y in X] == [True, False, False]
    assert prepared_pair(many, box) is pair, "prepared once"
    monkeypatch.setattr(query, "answer_batch", None)
    assert np.array_equal(collide.collide(many, box, EYE, X), first)


@prepares
def test_threads_that_ask_about_one_pair_work_in_spaces_of_their_own():
    B, wrong = collide.Mesh(*bumpy_sphere(50)), []
    rng = rng_of("threads of a mesh pair")
    batches = [np.stack([random_pose(rng, 1.2) for _ in range(40)]) for _ in range(6)]
    wanted = [long_way(MESH, B, EYE, X, Question(False, math.inf, False, True)).tobytes() for X in batches]
    collide.collide(MESH, B, EYE, batches[0])

    def ask(k: int) -> None:
        for _ in range(12):
            if collide.distance(MESH, B, EYE, batches[k], signed=False).rows.tobytes() != wanted[k]:
                wrong.append(k)

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and len(set(wanted)) == 6


@prepares
@pytest.mark.parametrize("ask", [collide.collide, collide.distance])
def test_batches_of_the_same_in_python(ask):
    """Where there is no library, `single_queries.py` does what the functions of C do."""

    def refuse(*_, **__):
        raise AssertionError("asked as Python has it")

    refuse.__name__, refuse.__signature__ = ask.__name__, inspect.signature(ask)
    in_python = single_queries._in_python(refuse, lambda *_: False, None, collide.certify)
    X = np.stack([collide.pose((1.1 + 0.2 * k, 0, 0)) for k in range(4)])
    collide.collide(MESH, CUBE, EYE, X)
    for poses in ((EYE, X), (X, EYE), (X, X), (X[:1], X)):
        of_c, of_python = ask(MESH, CUBE, *poses), in_python(MESH, CUBE, *poses)
        assert np.array_equal(getattr(of_c, "rows", of_c), getattr(of_python, "rows", of_python))
    for poses in ((EYE, X[:0]), (X, X[:3]), (X.tolist(), X), (X.astype(np.float32), X), (X[::2], X[:2])):
        with pytest.raises(AssertionError, match="as Python has it"):
            in_python(MESH, CUBE, *poses)
