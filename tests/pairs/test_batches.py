"""The ways to ask the same question: one pair, a batch, many shapes, several threads. All give the same bits."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import collide
from collide.base import threads as workers_module
from collide.errors import InvalidArgument, InvalidPose
from collide.pairs import batches

EYE = np.eye(4)


@pytest.fixture(autouse=True)
def threads_for_few_poses(monkeypatch):
    monkeypatch.setattr(batches, "_MIN_POSES_PER_THREAD", 1)
    monkeypatch.setattr(workers_module, "_ALONE", 0.0)
    monkeypatch.setattr(workers_module, "_SHORTEST", 1e-5)
    monkeypatch.setattr(workers_module, "_LONGEST", 1e-4)
    monkeypatch.setattr(workers_module, "_GAIN", 0.0)


def _shapes(rng):
    return [
        collide.Box((1, 0.5, 0.25)),
        collide.Sphere(0.4),
        collide.Capsule(0.2, 0.7),
        collide.Cylinder(0.3, 0.8),
        collide.ConvexHull(rng.normal(size=(9, 3)) * 0.5),
        collide.ConvexHull(rng.normal(size=(60, 3)) * 0.4, radius=0.05),
        collide.Halfspace((0, 0.3, 1), -0.2),
        collide.Compound([(collide.Box((1, 1, 0.1)), collide.pose((0, 0, 0.3))), (collide.Sphere(0.2), EYE)]),
    ]


def _poses(rng, n, spread=0.8):
    return np.array([collide.pose(rng.uniform(-spread, spread, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])


def _many(rng, n):
    """n pairs of shapes and poses, none of two half-spaces."""
    shapes = _shapes(rng)
    picks = [
        (shapes[i], shapes[j]) for i, j in rng.integers(0, len(shapes), size=(4 * n, 2)) if min(i, j) != 6 or i != j
    ]
    A, B = zip(*picks[:n])
    return list(A), list(B), _poses(rng, n), _poses(rng, n)


def test_single_calls_give_the_bits_of_batches():
    rng = np.random.default_rng(1)
    hits = 0
    for A in _shapes(rng):
        for B in _shapes(rng)[:6]:
            X_WA, X_WB = _poses(rng, 1)[0], _poses(rng, 20)
            X_WB[::5] = X_WA  # deep, and for equal shapes the exact stage
            batch = collide.distance(A, B, X_WA, X_WB)
            booleans = collide.collide(A, B, X_WA, X_WB)
            for k in range(20):
                for _ in range(2):  # the first call prepares the pair, the second finds it prepared
                    one = collide.distance(A, B, X_WA, X_WB[k])
                    assert one.rows.tobytes() == batch.rows[k : k + 1].tobytes(), (
                        A,
                        B,
                        X_WA.tolist(),
                        X_WB[k].tolist(),
                    )
                    said = collide.collide(A, B, X_WA, X_WB[k])
                    assert isinstance(said, bool) and said == booleans[k] == one.hit
            hits += booleans.sum()
    assert 300 < hits < 900


def test_sequences_of_shapes_answer_like_pairs():
    rng = np.random.default_rng(2)
    A, B, X_WA, X_WB = _many(rng, 150)
    hits, rows = collide.collide(A, B, X_WA, X_WB), collide.distance(A, B, X_WA, X_WB)
    assert 20 < hits.sum() < 130
    for k in range(150):
        one = collide.distance(A[k], B[k], X_WA[k], X_WB[k])
        assert np.array_equal(rows[k].rows, one.rows) and hits[k] == one.hit
        assert rows[k].question[:2] == (A[k], B[k])
    certificates = rows.certificate
    for k in range(0, 150, 10):
        if certificates[k] is not None:
            collide.verify(A[k], B[k], X_WA[k], X_WB[k], rows[k], certificate=certificates[k])
    against_one = collide.collide(A, B[0], X_WA, X_WB)
    assert [bool(h) for h in against_one] == [collide.collide(A[k], B[0], X_WA[k], X_WB[k]) for k in range(150)]


def test_shape_sets_answer_like_lists():
    rng = np.random.default_rng(21)
    shapes = _shapes(rng)
    i, j = rng.integers(0, 6, size=(2, 200))
    X_WA, X_WB = _poses(rng, 200), _poses(rng, 200)
    for members in (shapes[:6], shapes):  # the second holds a union, so nothing of it goes the short way
        library = collide.ShapeSet(members)
        assert len(library) == len(members) and library[3] is members[3]
        A, B = library[i], library[j]
        lists = [members[k] for k in i], [members[k] for k in j]
        for threads in (1, 3):
            hits = collide.collide(A, B, X_WA, X_WB, threads=threads)
            assert 40 < hits.sum() < 160 and np.array_equal(hits, collide.collide(*lists, X_WA, X_WB))
            r = collide.distance(A, B, X_WA, X_WB, threads=threads)
            assert np.array_equal(r.rows, collide.distance(*lists, X_WA, X_WB).rows)
        assert np.array_equal(
            collide.collide(A, members[0], X_WA, X_WB), collide.collide(lists[0], members[0], X_WA, X_WB)
        )
        assert r[7].question[:2] == (members[i[7]], members[j[7]])
    with pytest.raises(InvalidArgument, match="0 … 7"):
        library[np.array([0, 8])]
    with pytest.raises(InvalidArgument, match="integers"):
        library[np.array([0.5])]
    with pytest.raises(collide.InvalidShape, match=r"shapes\[1\]"):
        collide.ShapeSet([shapes[0], 3])


@pytest.mark.parametrize("threads", [2, 3, 8])
def test_threads_give_the_same_bits(threads):
    rng = np.random.default_rng(3)
    A, B, X_WA, X_WB = _many(rng, 200)
    assert np.array_equal(collide.collide(A, B, X_WA, X_WB, threads=threads), collide.collide(A, B, X_WA, X_WB))
    hull = _shapes(rng)[4]
    X_WB[::2] = EYE  # half of them with an exact stage
    for boolean in (collide.collide, lambda *args, **options: collide.distance(*args, **options).rows):
        one = boolean(hull, hull, EYE, X_WB)
        assert np.array_equal(boolean(hull, hull, EYE, X_WB, threads=threads), one)


def test_single_calls_from_many_threads_do_not_mix():
    rng = np.random.default_rng(4)
    A, B = collide.ConvexHull(rng.normal(size=(20, 3))), collide.Box((1, 1, 1))
    X_WB = _poses(rng, 400, 2.0)
    expected = collide.distance(A, B, EYE, X_WB).rows
    wrong = []

    def work(offset):
        for k in range(offset, 400, 4):
            if collide.distance(A, B, EYE, X_WB[k]).rows.tobytes() != expected[k : k + 1].tobytes():
                wrong.append(k)
            if collide.collide(A, B, EYE, X_WB[k]) != expected["hit"][k]:
                wrong.append(k)

    workers = [threading.Thread(target=work, args=(t,)) for t in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not wrong and 50 < expected["hit"].sum() < 350


@pytest.mark.parametrize("n", [1, 63, 64, 65, 130])
def test_blocks_end_where_they_should(n):
    """The exact stage takes the rows of one block; open rows stand at either end of it."""
    box = collide.Box((1, 1, 1))
    X_WB = np.tile(collide.pose((0, 0, 2)), (n, 1, 1))
    X_WB[[0, n // 2, -1]] = collide.pose((0, 0, 1))
    expected = np.zeros(n, dtype=bool)
    expected[[0, n // 2, -1]] = True
    assert np.array_equal(collide.collide(box, box, EYE, X_WB), expected)
    r = collide.distance(box, box, EYE, X_WB)
    assert np.array_equal(r.hit, expected) and (r.exact[expected] > 0).all() and not r.exact[~expected].any()


@pytest.mark.parametrize("form", ["read-only", "Fortran", "strided", "float32", "list", "tuple"])
def test_poses_in_any_form(form):
    rng = np.random.default_rng(5)
    A, B = collide.Box((1, 1, 1)), collide.ConvexHull(rng.normal(size=(12, 3)))
    exact32 = np.eye(4)
    exact32[:3, 3] = 0.5, 0.25, 1.25
    given = {
        "read-only": np.array(exact32), "Fortran": np.asfortranarray(exact32),
        "strided": np.repeat(np.repeat(exact32, 2, 0), 2, 1)[::2, ::2], "float32": exact32.astype(np.float32),
        "list": exact32.tolist(), "tuple": (exact32[:3, :3], exact32[:3, 3]),
    }[form]
    if form == "read-only":
        given.flags.writeable = False
    expected = collide.distance(A, B, EYE, exact32.copy()).rows.tobytes()
    for _ in range(2):
        assert collide.distance(A, B, EYE, given).rows.tobytes() == expected
        assert collide.collide(A, B, EYE, given) is True


def test_a_bad_pose_in_a_single_call_and_anywhere_in_a_batch_is_named():
    box = collide.Box((1, 1, 1))
    collide.collide(box, box, EYE, EYE)  # prepared
    X = np.tile(EYE, (300, 1, 1))
    for fault, value in (("nan", np.nan), ("large", 1e60), ("stretched", 1.5), ("mirrored", -1.0)):
        bad = EYE.copy()
        bad[0, 0] = value
        with pytest.raises(InvalidPose, match="X_WB"):
            collide.collide(box, box, EYE, bad)
        with pytest.raises(InvalidPose, match="X_WA"):
            collide.distance(box, box, bad, EYE)
        for threads in (1, 3):
            X[:] = EYE
            X[217] = bad
            with pytest.raises(InvalidPose, match=r"X_WB\[217\]"):
                collide.collide(box, box, EYE, X, threads=threads)
        if fault in ("stretched", "mirrored"):
            assert collide.collide(box, box, EYE, bad, check_poses=False)
    bent = EYE.copy()
    bent[3, 0] = 1e-9
    with pytest.raises(InvalidPose, match=r"\(0, 0, 0, 1\)"):
        collide.collide(box, box, EYE, bent)
    with pytest.raises(InvalidPose, match="shape"):
        collide.collide(box, box, EYE, np.eye(3))


def test_wrong_arguments_are_named():
    box = collide.Box((1, 1, 1))
    with pytest.raises(InvalidArgument, match="X_WB 3, A 2"):
        collide.collide([box, box], box, EYE, np.tile(EYE, (3, 1, 1)))
    with pytest.raises(InvalidArgument, match="A 1"):
        collide.collide([box], box, EYE, np.tile(EYE, (3, 1, 1)))
    with pytest.raises(InvalidArgument, match="A must be a shape"):
        collide.collide(collide.Box, box, EYE, EYE)
    with pytest.raises(InvalidPose, match="X_WA"):
        collide.collide(box, box, [[1, 2], [3]], EYE)
    for wrong in (None, box):
        with pytest.raises(collide.InvalidShape, match="sequence"):
            collide.ShapeSet(wrong)
    with pytest.raises(IndexError, match="shapes 0 … 0"):
        collide.ShapeSet([box])[5]
    r = collide.distance(box, box, EYE, np.tile(EYE, (3, 1, 1)))
    with pytest.raises(IndexError, match="results 0 … 2"):
        r[3]
    with pytest.raises(InvalidArgument, match="number"):
        r["a"]
    assert len(r[1:]) == 2 and np.array_equal(r[1:].rows, r.rows[1:])
    collide.verify(box, box, EYE, EYE, r[1:][0])
    with pytest.raises(InvalidArgument, match="B must be a shape"):
        collide.collide(box, [box, 3], EYE, EYE)
    with pytest.raises(InvalidArgument, match="threads"):
        collide.collide(box, box, EYE, np.tile(EYE, (3, 1, 1)), threads=0)


@pytest.mark.slow
def test_a_prepared_pair_is_never_taken_for_another():
    """Partners are looked up by id; one that is gone must not lend its id to a different shape."""
    A = collide.Box((1, 1, 1))
    X = collide.pose((0, 0, 1.2))
    for k in range(300):
        B = collide.Sphere(0.1 + 0.002 * k)
        assert collide.collide(A, B, EYE, X) == (0.1 + 0.002 * k >= 0.7), k
        del B
        if k % 50 == 0:
            gc.collect()
    assert len(A._prepared) <= 1, "shapes that are gone are not held"


def test_a_result_keeps_the_poses_it_was_asked_at():
    box = collide.Box((1, 1, 1))
    for poses in (collide.pose((0, 0, 3)), np.tile(collide.pose((0, 0, 3)), (2, 1, 1))):
        r = collide.distance(box, box, EYE, poses)
        asked = poses.copy()
        poses[..., 2, 3] = 0.0
        first = r if poses.ndim == 2 else r[0]
        collide.verify(box, box, EYE, asked if poses.ndim == 2 else asked[0], first)


@pytest.mark.parametrize("threads", [1, 3])
def test_axes_save_time_and_change_nothing(threads):
    rng = np.random.default_rng(6)
    A, B, X_WA, X_WB = _many(rng, 150)
    for pair in (
        (A, B, X_WA, X_WB),
        (_shapes(rng)[4], _shapes(rng)[0], EYE, X_WB),
        (_shapes(rng)[0], _shapes(rng)[6], EYE, X_WB),
    ):
        expected = collide.collide(*pair)
        assert 10 < expected.sum() < 140
        for start in (np.zeros((150, 3)), rng.normal(size=(150, 3)), rng.normal(size=(150, 3)) * 1e-200):
            axes = start.copy()
            assert np.array_equal(collide.collide(*pair, axes=axes, threads=threads), expected)
            assert np.array_equal(axes[expected], start[expected]), "axes of hits are left alone"
            assert np.array_equal(collide.collide(*pair, axes=axes, threads=threads), expected)


def test_nobody_writes_axes_after_an_error():
    """The first thread to fail was told of while the others went on."""
    box, n = collide.Box((1, 1, 1)), 100_000
    X_WB = np.tile(EYE, (n, 1, 1))
    X_WB[:, 0, 3] = np.linspace(1.1, 3, n)
    X_WB[0, 0, 0] = 2.0
    axes = np.zeros((n, 3))
    with pytest.raises(InvalidPose, match=r"X_WB\[0\]"):
        collide.collide(box, box, EYE, X_WB, axes=axes, threads=2)
    after = axes.copy()
    time.sleep(0.3)
    assert np.array_equal(axes, after)


def test_threads_are_done_without_where_python_ends():
    """Of a thread that outlives the main one, and at exit, no more can be started."""
    code = (
        "import atexit, threading, numpy as np, collide\n"
        "box, X = collide.Box((1, 1, 1)), np.tile(np.eye(4), (5000, 1, 1))\n"
        "ask = lambda: print(collide.collide(box, box, X, X, threads=2).all())\n"
        "collide.collide(box, box, X, X)\n"
        "atexit.register(ask)\n"
        "def late():\n    threading.main_thread().join()\n    ask()\n"
        "threading.Thread(target=late).start()\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False)
    assert run.stdout == "True\nTrue\n", run.stderr[-2000:]


def test_axes_that_come_back_part_the_bodies():
    rng = np.random.default_rng(7)
    A, B = collide.ConvexHull(rng.normal(size=(30, 3))), collide.ConvexHull(rng.normal(size=(30, 3)), radius=0.2)
    X_WB = _poses(rng, 200, 3.0)
    axes = np.zeros((200, 3))
    hits = collide.collide(A, B, EYE, X_WB, axes=axes)
    assert 20 < hits.sum() < 180
    for n, X in zip(axes[~hits], X_WB[~hits]):
        assert abs((n * n).sum() - 1) < 1e-12
        assert (A.points @ n).max() + B.radius < ((B.points @ X[:3, :3].T + X[:3, 3]) @ n).min() + 1e-12


def test_axes_that_are_none_are_refused():
    box, X = collide.Box((1, 1, 1)), np.tile(EYE, (4, 1, 1))
    for axes, word in (
        ([0, 0, 1], "list"), (np.zeros((3, 3)), r"\(4, 3\)"), (np.zeros((4, 3), dtype=np.float32), "float32"),
        (np.full((4, 3), np.nan), "finite"), (np.full((4, 3), 1e200), "longer"), (np.zeros((3, 4)).T, "contiguous"),
    ):
        with pytest.raises(InvalidArgument, match=word):
            collide.collide(box, box, EYE, X, axes=axes)


def test_a_single_pose_goes_with_lists_and_empty_lists_give_nothing():
    rng = np.random.default_rng(33)
    A, B, _, X_WB = _many(rng, 40)
    expected = [collide.collide(a, b, EYE, X_WB[0]) for a, b in zip(A, B)]
    assert [bool(h) for h in collide.collide(A, B, EYE, X_WB[0])] == expected
    assert len(collide.collide([], [], X_WB[:0], X_WB[:0])) == 0
    library = collide.ShapeSet(_shapes(rng))
    assert len(library[[]]) == 0 and len(library[2:5]) == 3


def test_a_fork_while_a_tree_grows_does_not_hang():
    """The child has none of its parent's threads: a lock that one of them holds is never released there."""
    code = (
        "import os, threading, time, numpy as np, collide\n"
        "small = collide.ConvexHull(np.random.default_rng(0).normal(size=(1000, 3)))\n"
        "X = collide.pose((5, 0, 0))\ncollide.collide(small, small, np.eye(4), X)\n"
        "points = np.random.default_rng(1).normal(size=(150000, 3))\n"
        "points /= np.sqrt((points ** 2).sum(axis=1))[:, None]\n"
        "large = collide.ConvexHull(points)\n"
        "thread = threading.Thread(target=collide.collide, args=(large, small, np.eye(4), X))\n"
        "thread.start()\ntime.sleep(0.25)\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    other = collide.ConvexHull(points[:2000])\n"
        "    os._exit(0 if collide.collide(other, small, np.eye(4), np.eye(4)) else 1)\n"
        "assert os.waitpid(child, 0)[1] == 0\nthread.join()\n"
    )
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]


@pytest.mark.parametrize("workers", (2, 3, 8))
def test_pieces_of_a_batch_are_all_of_it_and_none_too_small(workers):
    for n in (2 * workers, 2 * workers + 1, 97, 4096):
        pieces = workers_module.pieces_of(n, workers, 2)
        assert [k for piece in pieces for k in range(n)[piece]] == list(range(n))
        lengths = [piece.stop - piece.start for piece in pieces]
        assert len(lengths) >= workers and min(lengths) >= 2
        assert max(lengths) <= -(-n // workers) and sum(lengths[-workers:]) <= max(n // 4, 4 * workers)


def test_poses_of_a_batch_in_threads_are_kept_for_its_certificates():
    rng = np.random.default_rng(13)
    box = collide.Box((1.0, 1.0, 1.0))
    X_WB = np.stack([collide.pose(rng.uniform(-1.5, 1.5, 3), rpy=rng.uniform(-3.0, 3.0, 3)) for _ in range(4500)])
    given = X_WB.copy()
    found = collide.distance(box, box, EYE, given, threads=2)
    given[:] = 7.0
    assert np.array_equal(found.question[3], X_WB) and np.array_equal(found.question[2], EYE[None])
    for k in (0, 2100, 4499):
        collide.verify(*found[k].question, found[k])
