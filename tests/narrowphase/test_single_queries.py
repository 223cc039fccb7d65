"""`collide`, `distance` and `contacts` of a prepared pair: functions of C, which are to be told from Python's by their
time alone."""

from __future__ import annotations

import copy
import inspect
import math
import pickle
import pydoc
import threading
from collections import Counter

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of

import collide
from collide.contact import contact_query
from collide.narrowphase import prepared_pairs as P
from collide.narrowphase import single_queries
from collide.pairs import query
from collide.results import EXACT, FIELDS, HOW

EYE = np.eye(4)
QUERIES = collide.collide, collide.distance, collide.contacts


def two_boxes() -> tuple[collide.Box, collide.Box]:
    """Shapes that nothing has been asked about."""
    return collide.Box((1, 1, 1)), collide.Box((0.8, 0.6, 0.7))


def prepared_boxes() -> tuple[collide.Box, collide.Box]:
    A, B = two_boxes()
    for ask in QUERIES:
        ask(A, B, EYE, EYE)
    return A, B


# --- what they look like ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ask", "options"),
    [
        (
            collide.collide,
            {
                "security_margin": 0.0, "check_poses": True, "threads": 1, "axes": None, "algorithm": None,
                "like": None,
            },
        ),
        (
            collide.distance,
            {
                "max_distance": math.inf, "signed": True, "depth": "quick", "check_poses": True, "threads": 1,
                "derivatives": False, "like": None,
            },
        ),
        (collide.contacts, {"margin": 0.0, "max_contacts": 8, "check_poses": True, "threads": 1}),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_signatures_and_pages_of_help(ask, options):
    parameters = inspect.signature(ask).parameters.values()
    assert [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD] == ["A", "B", "X_WA", "X_WB"]
    assert {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY} == options
    assert inspect.isroutine(ask) and pickle.loads(pickle.dumps(ask)) is ask and callable(ask)
    text = pydoc.plain(pydoc.render_doc(ask))
    assert f"{ask.__name__}(A" in text and "X_WB" in text and "InvalidPose" in text
    assert ask.__module__ in ("collide.pairs.query", "collide.contact.contact_query")
    assert inspect.getdoc(ask).splitlines()[0].endswith((".", "margin."))


OPTIONS = {
    collide.collide: [
        {"security_margin": value}
        for value in (0, 1, 0.25, np.float64(0.1), np.float32(0.1), -0.0, 1e-60, 1e60, -1, "1")
    ],
    collide.distance: [{"max_distance": value} for value in (0, 3, 0.25, np.float64(0.1), 10**400, -1.0, None, True)]
    + [{"signed": value} for value in (False, np.True_, 0, 2, "no")],
    collide.contacts: [{"margin": value} for value in (0, 1, 0.25, np.float32(0.1), 1e51, -1.0, math.nan, None, True)]
    + [{"max_contacts": value} for value in (1, np.int32(3), 10**30, 0, True, 2.0, None)],
}
OF_ALL = [
    {"check_poses": False}, {"check_poses": np.True_}, {"check_poses": "no"}, {"check_poses": None}, {"threads": 2},
    {"threads": np.int64(1)}, {"threads": 0}, {"threads": True}, {"threads": 1.0}, {"_prepared": None}, {"axis": None},
    {"axes": None}, {"algorithm": None}, {"algorithm": "gjk"}, {"algorithm": "walk"},
]


@pytest.mark.parametrize("ask", QUERIES, ids=lambda ask: ask.__name__)
def test_options_of_prepared_pairs_are_read_as_those_of_others(ask):
    """A pair asked before took any `check_poses`; one that was not refused it."""
    ready, X, n_refused = prepared_boxes(), collide.pose((0.9, 0.3, 0.1)), 0
    for options in OPTIONS[ask] + OF_ALL:
        told = [_said(ask, *pair, EYE, X, **options) for pair in (two_boxes(), ready, ready)]
        assert told[0] == told[1] == told[2], options
        n_refused += isinstance(told[0], str)
    assert 8 <= n_refused <= len(OPTIONS[ask]) + len(OF_ALL) - 8


@pytest.mark.parametrize("ask", QUERIES, ids=lambda ask: ask.__name__)
def test_poses_and_shapes_of_prepared_pairs_are_read_as_those_of_others(ask):
    ready, n_refused = prepared_boxes(), 0
    X = collide.pose((0.9, 0.3, 0.1), rpy=(0.1, 0.2, 0.3))
    given = [
        X.tolist(), X.astype(np.float32), np.asfortranarray(X), X[:3], (X[:3, :3], X[:3, 3]), X[None],
        np.stack([X, EYE]), 2 * X, np.diag([1.0, 1.0, -1.0, 1.0]), np.full((4, 4), np.nan), X.astype(">f8"), None,
        "pose", np.eye(3), X * 1j, 1.0 + 1e-5 * X, X + 4e-5 * np.eye(4, 4, 1) * (np.arange(4)[:, None] < 2),
    ]
    for Y in given:
        told = [_said(ask, *pair, EYE, Y) for pair in (two_boxes(), ready, ready)]
        assert told[0] == told[1] == told[2], Y
        told = [_said(ask, *pair, Y, X, check_poses=False) for pair in (two_boxes(), ready, ready)]
        assert told[0] == told[1] == told[2], Y
        n_refused += isinstance(told[0], str)
    assert 4 <= n_refused < len(given)
    A, B = ready
    for shapes in ((A, None), (None, B), (A, 1.0), ([A, A], [B, B]), (object(), object())):
        assert _said(ask, *shapes, EYE, X) == _said(ask, *shapes, EYE, X)
    with pytest.raises(TypeError, match="missing"):
        ask(A, B, EYE)
    assert _said(ask, A=A, B=B, X_WA=EYE, X_WB=X) == _said(ask, A, B, EYE, X)


def _said(ask, *arguments, **options):
    """The answer in bytes, or the error in words."""
    try:
        answer = ask(*arguments, **options)
    except (collide.CollideError, TypeError, LongWay) as error:
        return f"{type(error).__name__}: {error}"
    return (answer if isinstance(answer, bool) else getattr(answer, "rows", answer).tobytes())


# --- what they return ---------------------------------------------------------------------------


def test_a_result_of_a_single_call_is_one_of_a_batch():
    """Field by field, read before and after its arrays are there; a copy, and what pickle keeps, too."""
    A, B = prepared_boxes()
    near = collide.pose((1.2, 0.3, 0.2), rpy=(0.2, 0.3, 0.4))
    for X in (near, collide.pose((0.6, 0.2, 0.3)), collide.pose((0.9, 0, 0))):
        of_batch, X_asked = collide.distance(A, B, EYE[None], X[None])[0], X.copy()
        single = collide.distance(A, B, EYE, X_asked)
        X_asked[:] = np.nan  # the question was another one
        for _ in range(2):
            for field in FIELDS:
                got, wanted = getattr(single, field), getattr(of_batch, field)
                assert type(got) is type(wanted) and np.array_equal(got, wanted), field
                if isinstance(got, np.ndarray):
                    assert got.dtype == wanted.dtype and got.flags.writeable and got.base is None
            for r in (single, *(make(single) for make in (copy.copy, copy.deepcopy, _pickled))):
                assert r.is_single is True and len(r) == 1 and repr(r) == repr(of_batch)
                assert r.rows.tobytes() == of_batch.rows.tobytes() and r.rows.dtype == of_batch.rows.dtype
                assert r.question[0] == A and r.question[2].shape == (1, 4, 4)
                assert r.question[3].tobytes() == X.tobytes()
                assert r.certificate == of_batch.certificate
        collide.verify(*single.question, single)
        assert "distance" in dir(single)
        single.rows["distance"] = 7.0
        assert single.distance == 7.0 and collide.distance(A, B, EYE, X).distance == of_batch.distance
        with pytest.raises(AttributeError, match="no field 'depth'; there are distance"):
            _ = single.depth


def test_contacts_of_a_single_call_are_those_of_a_batch():
    A, B = prepared_boxes()
    deep, far, near = (collide.pose(t) for t in ((0.6, 0.2, 0.3), (5, 0, 0), (1, 0, 0)))
    for X, margin in ((deep, 0.0), (far, 0.0), (near, 0.2)):
        of_batch = collide.contacts(A, B, EYE, X[None], margin=margin)
        for first in ("rows", "starts", "normal", "point", "patches"):
            single = collide.contacts(A, B, EYE, X, margin=margin)
            getattr(single, first)
            for c in (single, copy.deepcopy(single), _pickled(single)):
                assert c.rows.tobytes() == of_batch.rows.tobytes() and c.rows.dtype == of_batch.rows.dtype
                assert c.starts.tolist() == of_batch.starts.tolist() and not c.rows.flags.writeable
                assert repr(c) == repr(of_batch) and len(c[0]) == len(c) == len(of_batch)
        with pytest.raises(AttributeError, match="no field 'depth'"):
            _ = single.depth


def _pickled(value):
    return pickle.loads(pickle.dumps(value))


def test_threads_that_ask_about_one_pair_get_results_of_their_own():
    A, B = prepared_boxes()
    poses = [collide.pose((1.0 + 0.1 * k, 0.1, 0.0)) for k in range(8)]
    wanted = [collide.distance(A, B, EYE, X[None]).rows.tobytes() for X in poses]
    touching = [collide.contacts(A, B, EYE, X[None], margin=0.35).rows.tobytes() for X in poses]
    wrong = []

    def ask(k: int) -> None:
        results = [collide.distance(A, B, EYE, poses[k]) for _ in range(300)]
        patches = [collide.contacts(A, B, EYE, poses[k], margin=0.35) for _ in range(300)]
        wrong.extend(k for r in results if r.rows.tobytes() != wanted[k])
        wrong.extend(k for c in patches if c.rows.tobytes() != touching[k])

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and len(set(wanted)) == 8 and len(set(touching)) > 2


# --- who answers --------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [AttributeError, KeyError, TypeError])
@pytest.mark.parametrize(
    ("question", "ask"),
    [
        ("collide", lambda A, B: collide.collide(A, B, EYE, EYE)),
        ("within", lambda A, B: collide.collide(A, B, EYE, EYE, security_margin=0.1)),
        ("distance", lambda A, B: collide.distance(A, B, EYE, EYE)),
        ("contacts", lambda A, B: collide.contacts(A, B, EYE, EYE)),
    ],
)
def test_what_a_pair_raises_is_not_taken_for_a_pair_that_is_not_prepared(question, ask, error):
    """Errors of the engine were swallowed, and the long way answered ten times slower."""

    def broken(*_):
        raise error("of the engine")

    A, B = two_boxes()
    P.keep_prepared(A, B, P.Prepared(**{question: broken}))
    with pytest.raises(error, match="of the engine"):
        ask(A, B)


SOME_OF_EACH_KIND = [
    collide.Sphere(0.5), collide.Box((1, 1, 1)), collide.Cone(0.4, 1.0), collide.Halfspace((0, 0, 1), 0.0),
    collide.Compound([(collide.Sphere(0.4), EYE), (collide.Box((1, 1, 0.5)), collide.pose((0, 0, 0.5)))]),
    collide.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
]


@pytest.mark.parametrize("A", SOME_OF_EACH_KIND, ids=lambda shape: type(shape).__name__)
def test_the_first_single_call_of_a_pair_has_the_bytes_of_a_batch(A):
    """A first call is answered by the pair that it makes ready, in whatever order questions come."""
    rng, n_prepared = np.random.default_rng(11), 0
    for B in SOME_OF_EACH_KIND:
        for gap in (0.3, 0.9, 3.0):
            X = collide.pose(gap * rng.normal(size=3), quat_wxyz=rng.normal(size=4))
            pair = _pickled((A, B))
            asks = list(QUERIES)
            rng.shuffle(asks)
            for ask in asks:
                if type(A) is type(B) is collide.Halfspace and ask is not collide.collide:
                    continue
                single, batch = ask(*pair, X, EYE), ask(A, B, X[None], EYE)
                shown = f"{ask.__name__}: {A!r}, {B!r}, {X.tolist()}"
                if ask is collide.collide:
                    assert single is bool(batch[0]), shown
                else:
                    assert single.rows.tobytes() == batch.rows.tobytes(), shown
            made = P.prepared_pair(*pair)
            n_prepared += made is not None and made.collide is not None
    assert n_prepared >= 6 or not P.single_calls_are_safe(), "pairs are made ready by their first calls"


class LongWay(Exception):
    """Asked as a batch."""


@pytest.fixture()
def no_long_way(monkeypatch):
    def refuse(*_, **__):
        raise LongWay

    monkeypatch.setattr(query, "answer_batch", refuse)
    monkeypatch.setattr(contact_query, "contact_batch", refuse)
    if not P.single_calls_are_safe():
        pytest.skip("single calls go the long way here")


def test_the_same_in_python_answers_alike(no_long_way):
    """Where there is no library, `single_queries.py` does what the functions of C do."""
    prepares = query.prepare_pair, query.prepare_pair, contact_query.prepare_contacts
    for question, ask, prepare in zip(("collide", "distance", "contacts"), QUERIES, prepares):

        def long_way(*_, **__):
            raise LongWay

        long_way.__name__, long_way.__signature__ = question, inspect.signature(ask)
        in_python = single_queries._in_python(long_way, prepare, collide.Contacts, collide.certify)
        new = collide.Box((1, 1, 1)), collide.Box((0.7, 1.3, 0.4))
        told = [_said(f, *new, EYE, collide.pose((0.9, 0.3, 0.1))) for f in (in_python, ask)]
        assert told[0] == told[1] and not isinstance(told[0], str), "a new pair is made ready, and asked"
        pair, n_single = prepared_boxes(), 0
        for X in (collide.pose((0.9, 0.3, 0.1)), collide.pose((0.6, 0.2, 0.3)), EYE.astype(np.float32), 2 * EYE):
            for options in OPTIONS[ask] + OF_ALL:
                told = [_said(f, *pair, EYE, X, **options) for f in (ask, in_python)]
                assert told[0] == told[1] or told[1] == "LongWay: ", (options, X)
                if told[0] == "LongWay: " or told[1] == "LongWay: ":
                    assert isinstance(told[0], str), (options, X, "the one answers and the other does not")
                n_single += not isinstance(told[1], str)
        assert n_single >= 8


def test_curved_bodies_that_touch_take_the_one_call(monkeypatch):
    """A can at rest on a box: doubles do not tell, integers in the same kernel do. Its single call took 63 µs once."""
    rng, seen, n_long = rng_of("resting curved"), Counter(), []
    answer_batch, contact_batch = query.answer_batch, contact_query.contact_batch
    monkeypatch.setattr(query, "answer_batch", lambda *a, **k: (n_long.append(1), answer_batch(*a, **k))[1])
    monkeypatch.setattr(contact_query, "contact_batch", lambda *a, **k: (n_long.append(1), contact_batch(*a, **k))[1])
    for k in range(60):
        h, H, r = (float(v) for v in rng.choice([0.1, 0.3, 0.5, 0.7], size=3))
        can = [collide.Cylinder(r, h), collide.Cone(r, h), collide.Ellipsoid((r, h, h))][k % 3]
        box = collide.Box((2, 2, H))
        floor = [box, collide.Cylinder(1.0, H), collide.Compound([(box, EYE)])][k // 3 % 3]
        half = h if k % 3 == 2 else h / 2
        X_WA = random_pose(rng, 0.0) if k % 2 else EYE
        off = float(rng.choice([0.0, 0.0, 3e-16, -3e-16, 1e-13, -1e-13]))
        X = X_WA @ collide.pose((*rng.uniform(-0.5, 0.5, 2), H / 2 + half + off))
        with naive.reproducible(Case(floor, can, X_WA, X)):
            row = collide.distance(floor, can, X_WA, X[None])
            gap = collide.distance(floor, can, X_WA, X[None], signed=False)
            patch = collide.contacts(floor, can, X_WA, X[None], margin=1e-6)
            hit, near = (collide.collide(floor, can, X_WA, X[None], security_margin=m)[0] for m in (0.0, 1e-6))
            collide.collide(floor, can, X_WA, X)
            seen[HOW[row.how[0]]] += 1
            n_long.clear()
            assert collide.distance(floor, can, X_WA, X).rows.tobytes() == row.rows.tobytes()
            assert collide.distance(floor, can, X_WA, X, signed=False).rows.tobytes() == gap.rows.tobytes()
            assert collide.collide(floor, can, X_WA, X) is bool(hit)
            assert collide.collide(floor, can, X_WA, X, security_margin=1e-6) is bool(near)
            is_convex = not isinstance(floor, collide.Compound)
            assert not (P.single_calls_are_safe() and is_convex) or not n_long, "the long way"
            assert collide.contacts(floor, can, X_WA, X, margin=1e-6).rows.tobytes() == patch.rows.tobytes()
            assert collide.contacts(floor, can, X_WA, X, margin=1e-6).rows.tobytes() == patch.rows.tobytes()
            assert not (P.single_calls_are_safe() and is_convex) or len(n_long) <= 1, "the long way, of contacts"
    assert seen["exact arithmetic"] >= 15 and seen["undecided"] == 0 and seen.total() == 60, seen


def test_bodies_on_a_floor_touch_in_one_call(monkeypatch):
    """What rests on a half-space, exactly or but for rounding, went the long way: 24 to 51 µs a single call."""
    rng, seen, n_long = rng_of("on a floor"), {"exact": 0, "hit": 0, "apart": 0}, []
    for module, name in ((query, "answer_batch"), (contact_query, "contact_batch")):
        ask = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, ask=ask, **k: (n_long.append(1), ask(*a, **k))[1])
    for k in range(60):
        x, y, z = (float(v) for v in rng.choice([0.1, 0.25, 0.3, 0.5, 0.7], size=3))
        corners = np.array([(i * x, j * y, k * z) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        body = [collide.Sphere(z), collide.Box((x, y, 2 * z)), collide.Capsule(x, 2 * (z - 0.1)),
                collide.ConvexHull(corners)][k % 4]
        half = z - 0.1 + x if k % 4 == 2 else z
        floor, H = collide.Halfspace((0, 0, 1), 0.5), 0.5
        X_WA = random_pose(rng, 0.0) if k // 4 % 2 else EYE
        off = float(rng.choice([0.0, 0.0, 3e-17, -3e-17, 1e-16, -1e-16]))
        X = X_WA @ collide.pose((*rng.uniform(-0.5, 0.5, 2), H + half + off))
        with naive.reproducible(Case(floor, body, X_WA, X)):
            row, gap = (collide.distance(floor, body, X_WA, X[None], signed=signed) for signed in (True, False))
            patch = collide.contacts(floor, body, X_WA, X[None], margin=1e-6)
            hit = collide.collide(floor, body, X_WA, X[None])[0]
            for ask in QUERIES:
                ask(floor, body, X_WA, X)  # makes the pair ready
            seen["exact"] += int(row.how[0] == EXACT)
            seen["hit" if hit else "apart"] += 1
            n_long.clear()
            assert collide.distance(floor, body, X_WA, X).rows.tobytes() == row.rows.tobytes()
            assert collide.distance(floor, body, X_WA, X, signed=False).rows.tobytes() == gap.rows.tobytes()
            assert collide.collide(floor, body, X_WA, X) is bool(hit)
            assert collide.contacts(floor, body, X_WA, X, margin=1e-6).rows.tobytes() == patch.rows.tobytes()
            assert not (P.single_calls_are_safe() and n_long), "the long way"
    assert seen["exact"] >= 15 and seen["hit"] >= 15 and seen["apart"] >= 5, seen


def test_flush_boxes_touch_in_one_call(no_long_way):
    """Contacts of what integers settle went the long way: 79 µs of a single call, 13 of a batch."""
    A, B = collide.Box((1, 1, 1)), collide.Box((0.5, 0.75, 0.25))
    for X in (collide.pose((0.125, 0.25, 0.625)), collide.pose((0.75, 0, 0.125)), collide.pose((0.75, 0.875, 0.625))):
        assert collide.contacts(A, B, EYE, X).rows["distance"].max() == 0.0
        assert collide.distance(A, B, EYE, X).distance == 0.0 and collide.collide(A, B, EYE, X)
