"""Eight doubles at once: every lane has the bits that doubles have, compiled and as plain Python, whatever its
neighbours."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import collide
from collide.kernels import address_of, entry, kernel, view_f64
from collide.kernels.lanes import LANES, any_of, root_of, select, transpose_eight, view_lanes
from collide.narrowphase.gap import gap_layout as at
from collide.narrowphase.gap import precise_pair as fine
from collide.narrowphase.gap.refine_gap import refine_gaps
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.error_free import dekker_product, two_product, two_sum

#: Numbers that go into one round of all operations, and that come out.
IN, OUT = 12, 50


@kernel
def _everything(x, y):
    """All that lanes can do, and the kernels that are compiled for them; x and y are views of doubles or of lanes."""
    a = x[0]
    b = x[1]
    c = x[2]
    d = x[3]
    y[0] = a + b
    y[1] = a - b
    y[2] = a * b
    y[3] = a / b
    y[4] = -a
    y[5] = abs(a)
    y[6] = root_of(abs(a))
    y[7], y[8] = two_sum(a, b)
    y[9], y[10] = two_product(a, b)
    y[11] = 1.5 * a + b / 3.0 - 1.0
    y[12] = 1.0 / (2.0 - a)
    s = a
    s += b
    s -= c
    s *= 0.75
    s /= d
    y[13] = s
    y[14] = select(a < b, a, b)
    y[15] = select(a <= b, a, 1.0)
    y[16] = select((a > b) & (c >= d), 1.0, 0.0)
    y[17] = select((a == b) | (c != d), a, c)
    y[18] = select(~(a < 0.0), a, -a)
    y[19] = select(0.0 < a, 2.0, d)
    y[20], y[21] = dd.add(DD(a, b), DD(c, d))
    y[22], y[23] = dd.sub(DD(a, b), DD(c, d))
    y[24], y[25] = dd.mul(DD(a, b), DD(c, d))
    y[26], y[27] = dd.div(DD(a, b), DD(c, d))
    y[28], y[29] = dd.sqrt(DD(a, b))
    y[30], y[31], y[32] = dd.bracket(DD(a, b), abs(c))
    u = dd.vec3_at(x, 0)
    v = dd.vec3_at(x, dd.STRIDE)
    dd.put_vec3(y, 33, dd.cross(u, v))
    y[39], y[40] = dd.inner(u, v)
    y[41], y[42] = dekker_product(a, b)
    y[43] = fine.larger(a, b)
    y[44] = fine.smaller(a, b)
    y[45] = a
    y[46] = b
    if any_of(a > b):
        y[45] = select(a > b, c, a)
    if not any_of(c >= 0.0):
        y[46] = select(c >= 0.0, a, b)
    t = 0.0
    for k in range(4):
        t = fine.larger(t, x[k])
    y[47] = t
    y[48] = 0.0
    y[49] = select(c > d, y[48], y[47])


@entry("void(int64, int64, int64)")
def _eight_at_once(x_at, y_at, n):
    for k in range(n):
        _everything(view_lanes(x_at + 8 * LANES * IN * k, IN), view_lanes(y_at + 8 * LANES * OUT * k, OUT))


@entry("void(int64, int64, int64)")
def _one_by_one(x_at, y_at, n):
    for k in range(n):
        _everything(view_f64(x_at + 8 * IN * k, IN), view_f64(y_at + 8 * OUT * k, OUT))


@entry("void(int64, int64)")
def _transpose(addresses_at, target_at):
    transpose_eight(addresses_at, target_at)


@pytest.mark.own_kernels
def test_eight_rows_from_anywhere_become_lanes():
    numbers = np.random.default_rng(12).normal(size=1000)
    for first in (0, 1, 3, 8, 100):
        places = np.array([first + 7 * k for k in (5, 0, 99, 3, 3, 42, 17, 120)])
        addresses, target = address_of(numbers) + 8 * places, np.zeros((LANES + 1, LANES))
        _transpose(address_of(addresses), address_of(target) + 8)
        found = target.ravel()[1 : 1 + LANES * LANES].reshape(LANES, LANES)
        assert np.array_equal(found, np.stack([numbers[place : place + LANES] for place in places], axis=1))
        assert target.ravel()[0] == 0.0 and not target.ravel()[1 + LANES * LANES :].any()


def _numbers() -> np.ndarray:
    """(n, IN, LANES): of all sizes, nearly equal ones, and all that is odd about doubles."""
    rng = np.random.default_rng(11)
    x = rng.normal(size=(1000, IN, LANES)) * 2.0 ** rng.integers(-60, 60, size=(1000, IN, LANES))
    x[:300, 1::2] = x[:300, ::2] * rng.uniform(-1, 1, size=(300, IN // 2, LANES)) * 2.0**-54
    x[100:200, 4:6] = x[100:200, :2] * (1 + rng.integers(-3, 4, size=(100, 1, LANES)) * 2.0**-52)
    odd = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        np.inf,
        -np.inf,
        np.nan,
        5e-324,
        -5e-324,
        2.2e-308,
        1.7e308,
        -1.7e308,
        1 + 2**-52,
        3.0,
        2.0**-1000,
    ]
    x[300:700] = rng.choice(odd, size=(400, IN, LANES))
    return x


def _columns(x: np.ndarray) -> np.ndarray:
    """Lanes as rows of their own, each in one piece of memory."""
    return np.ascontiguousarray(x.transpose(0, 2, 1))


def _bits(x: np.ndarray) -> np.ndarray:
    """Words that are equal where doubles are the same; NaN is NaN, of whatever sign."""
    return np.where(np.isnan(x), 0x7FF8000000000000, np.ascontiguousarray(x).view(np.int64))


def _run(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    n = len(x)
    x = np.ascontiguousarray(x)
    eight, apart, ones = np.zeros((n, OUT, LANES)), _columns(x), np.zeros((n, LANES, OUT))
    with np.errstate(all="ignore"):
        _eight_at_once(address_of(x), address_of(eight), n)
        _one_by_one(address_of(apart), address_of(ones), n * LANES)
    return _columns(eight), ones


@pytest.mark.own_kernels
def test_lanes_have_the_bits_of_doubles():
    x = _numbers()
    eight, ones = _run(x)
    wrong = np.argwhere(_bits(eight) != _bits(ones))
    for k, lane, field in wrong[:1]:
        raise AssertionError(
            f"number {field} of {x[k, :, lane].tolist()}: {eight[k, lane, field]!r}, not {ones[k, lane, field]!r}"
        )
    assert np.isfinite(ones).mean() > 0.6


@pytest.mark.own_kernels
def test_lanes_do_not_see_each_other():
    x = _numbers()
    turned, _ = _run(x[:, :, np.roll(np.arange(LANES), 3)])
    mixed, _ = _run(np.concatenate([x[1:], x[:1]]))
    eight, _ = _run(x)
    assert np.array_equal(_bits(eight)[:, np.roll(np.arange(LANES), 3)], _bits(turned))
    assert np.array_equal(_bits(np.roll(eight, -1, axis=0)), _bits(mixed))


@pytest.mark.own_kernels
def test_without_compilation_the_bits_are_the_same():
    """Only where nothing over- or underflows: there Dekker's products have not the error that a fused one has."""
    x = np.ascontiguousarray(_numbers()[:200])
    code = (
        f"import sys, numpy as np; sys.path.insert(0, {str(Path(__file__).parent)!r}); import test_lanes\n"
        "from collide import kernels; assert kernels.PLAIN_PYTHON\n"
        "x = np.frombuffer(sys.stdin.buffer.read()).reshape(200, test_lanes.IN, test_lanes.LANES)\n"
        "sys.stdout.buffer.write(np.stack(test_lanes._run(x)).tobytes())\n"
    )
    child = subprocess.run(
        [sys.executable, "-c", code], input=x.tobytes(), env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(collide.__file__).parents[1], capture_output=True, timeout=120, check=False,
    )
    assert child.returncode == 0, child.stderr.decode()[-2000:]
    plain = np.frombuffer(child.stdout).reshape(2, 200, LANES, OUT)
    for found in plain:
        assert np.array_equal(_bits(found), _bits(_run(x)[0]))


@entry("void(int64, int64, int64, int64)")
def _refine(question_at, out_at, n, parts):
    """A lane block of questions; out: the feature, its direction, the answer."""
    direction_at = out_at + 8 * LANES * at.FEATURE
    refine_gaps(
        view_lanes(question_at, at.QUESTION), n, parts, False, view_lanes(out_at, at.FEATURE),
        view_lanes(direction_at, dd.STRIDE), view_lanes(direction_at + 8 * LANES * dd.STRIDE, at.ANSWER),
    )


@entry("void(int64, int64, int64, int64)")
def _refine_one(question_at, out_at, n, parts):
    direction_at = out_at + 8 * at.FEATURE
    refine_gaps(
        view_f64(question_at, at.QUESTION), n, parts, False, view_f64(out_at, at.FEATURE),
        view_f64(direction_at, dd.STRIDE), view_f64(direction_at + 8 * dd.STRIDE, at.ANSWER),
    )


@pytest.mark.own_kernels
@pytest.mark.parametrize("parts", [1, 2])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_gaps_eight_at_a_time_are_those_one_by_one(n, parts):
    """The same source, compiled for doubles; questions are random, or have an edge that is nothing or a direction
    too."""
    rng = np.random.default_rng(100 * n + parts)
    block = rng.normal(size=(at.QUESTION, LANES))
    block[at.POSE_B + 9] += 8.0
    block[at.SCALE] = 2.0**-4
    block[[at.SLOP, at.ERROR]] = 0.0
    block[at.PARALLELOGRAM] = rng.integers(0, 2, LANES)
    for edge in range(2):
        for part in range(2):
            block[at.EDGES + at.EDGE * edge + at.PART * part + at.OF_A] = (
                (1 - part) if parts == 2 else rng.integers(0, 2, LANES)
            )
    block[at.EDGES : at.EDGES + 3, 5] = block[at.EDGES + 3 : at.EDGES + 6, 5]
    block[at.POSE_A : at.POSE_B + 12, 6] = block[at.CORNER_A : at.CORNER_B + 3, 6] = 0.0
    size = at.FEATURE + dd.STRIDE + at.ANSWER
    eight = np.zeros((size, LANES))
    _refine(address_of(block), address_of(eight), n, parts)
    for lane in range(LANES):
        question, one = np.ascontiguousarray(block[:, lane]), np.zeros(size)
        _refine_one(address_of(question), address_of(one), n, parts)
        assert np.array_equal(_bits(one), _bits(eight[:, lane])), (lane, question.tolist())


def test_rows_do_not_depend_on_who_waits_with_them():
    """Gaps of all kinds in one list: the same rows in another order, and one by one."""
    rng = np.random.default_rng(12)
    hulls = [collide.ConvexHull(rng.normal(size=(n, 3))) for n in (4, 9, 60)]
    shapes = [
        *hulls, collide.ConvexHull(rng.normal(size=(6, 3)), radius=0.3), collide.Box((1, 1, 1)), collide.Sphere(0.5),
        collide.Capsule(0.3, 1.0), collide.ConvexHull([(0, 0, 0), (1, 1, 0)]),
    ]
    A, B = zip(*[(shapes[i], shapes[j]) for i, j in rng.integers(0, len(shapes), size=(400, 2))])
    X = np.array([collide.pose(rng.uniform(-3, 3, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(400)])
    X[::4, :3, :3] = np.eye(3)  # level faces
    rows = collide.distance(list(A), list(B), np.eye(4), X, signed=False).rows
    assert (rows["distance"] > 0.0).sum() > 200
    order = rng.permutation(400)
    again = collide.distance([A[k] for k in order], [B[k] for k in order], np.eye(4), X[order], signed=False).rows
    for field in rows.dtype.names:
        assert np.array_equal(rows[field][order], again[field]), field
    for k in range(0, 400, 7):
        alone = collide.distance([A[k]], [B[k]], np.eye(4), X[k : k + 1], signed=False).rows
        assert alone.tobytes() == rows[k : k + 1].tobytes(), (A[k], B[k], X[k].tolist())
