"""Arrays of other libraries: read where they lie, refused by name where a copy or a gradient would be lost in silence,
and given back as they came."""

from __future__ import annotations

import pickle
from importlib import import_module

import numpy as np
import pytest

import collide
from collide.base import argument_checks as checks
from collide.base.array_libraries import as_bound, narrow_float, refusal
from collide.errors import InvalidArgument, InvalidPose

EYE = np.eye(4)
A, B = collide.Box((1, 1, 1)), collide.Sphere(0.25)
LIBRARIES = ["torch", "jax"]


def library(name: str):
    """numpy, torch or jax.numpy; a test without the extra is skipped."""
    pytest.importorskip(name, reason=f"{name} is not installed: pip install 'collide-robotics[{name}]'")
    return import_module("jax.numpy" if name == "jax" else name)


def shifts(n: int = 300) -> np.ndarray:
    """(n, 4, 4) poses without rounding in float32, of which a part hits."""
    rng = np.random.default_rng(3)
    X = np.tile(EYE, (n, 1, 1))
    X[:, :3, 3] = rng.integers(-16, 17, (n, 3)) / 16
    return X


class ByDlpack:
    """An array that speaks DLPack and nothing else."""

    def __init__(self, values: np.ndarray, device: tuple[int, int] = (1, 0)):
        self._values, self._device = values, device
        self.dtype, self.shape, self.ndim = values.dtype, values.shape, values.ndim

    def __dlpack__(self, **options):
        return self._values.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._device


class ByInterface:
    """An array that describes its memory and nothing else."""

    def __init__(self, values: np.ndarray):
        self._values, self.__array_interface__ = values, values.__array_interface__


# --- coming in ----------------------------------------------------------------------------------


@pytest.mark.parametrize("wrap", [ByDlpack, ByInterface])
def test_an_array_by_its_protocol_alone_is_read_where_it_lies(wrap):
    X = shifts()
    read = checks.array("x", wrap(X), "", InvalidArgument)
    assert read.ctypes.data == X.ctypes.data and read.shape == X.shape
    assert np.array_equal(collide.collide(A, B, EYE, wrap(X)), collide.collide(A, B, EYE, X))
    assert np.array_equal(collide.distance(A, B, EYE, wrap(X)).rows, collide.distance(A, B, EYE, X).rows)


@pytest.mark.parametrize("name", LIBRARIES)
def test_an_array_of_a_library_is_read_where_it_lies(name):
    xp = library(name)
    single, double = (xp.asarray(shifts().astype(kind)) for kind in (np.float32, np.float64))
    expected = collide.distance(A, B, EYE, shifts()).rows
    for X in (single, double):
        read = checks.plain_array("x", X, "", InvalidArgument)
        assert read.ctypes.data == np.asarray(X).ctypes.data
        assert np.array_equal(collide.distance(A, B, EYE, X).rows, expected)
        assert np.array_equal(collide.collide(A, B, X[0], X), collide.collide(A, B, shifts()[0], shifts()))
        world = collide.World()
        world.add(A, X[0])
        world.add_many(B, X[:20])
        assert len(world.ids) == 21

    cloud = collide.PointCloud(xp.asarray(shifts()[:, :3, 3]), radius=0.01)
    assert len(cloud.points) == 300


@pytest.mark.parametrize("form", ["float32", "strided", "reversed", "Fortran", "rows"])
def test_other_layouts_cost_a_single_copy_and_no_more(form):
    """Exactly one array as large as the batch of doubles is made, as `tracemalloc` counts numpy's memory."""
    import tracemalloc

    X = shifts(20_000)
    given = {
        "float32": X.astype(np.float32), "strided": np.repeat(X, 2, 0)[::2], "reversed": X[::-1],
        "Fortran": np.asfortranarray(X), "rows": np.ascontiguousarray(X[:, :3]),
    }[form]
    collide.collide(A, B, EYE, X)
    tracemalloc.start()
    hits = collide.collide(A, B, EYE, given)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert X.nbytes <= most < 1.3 * X.nbytes, most / X.nbytes
    expected = collide.collide(A, B, EYE, X)
    assert np.array_equal(hits, expected[::-1] if form == "reversed" else expected)
    assert 0.05 < hits.mean() < 0.95


def test_doubles_in_order_are_not_copied_read_only_or_not():
    import tracemalloc

    X = shifts(20_000)
    X.flags.writeable = False
    collide.collide(A, B, EYE, X)
    tracemalloc.start()
    collide.collide(A, B, EYE, X)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 0.1 * X.nbytes


# --- refused by name ----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [2, 8, 10])
def test_memory_of_another_device_is_refused_by_name(kind):
    with pytest.raises(InvalidPose, match=rf"X_WB is on a device of DLPack's kind {kind}, number 0.*hand in"):
        collide.collide(A, B, EYE, ByDlpack(EYE, (kind, 0)))
    with pytest.raises(InvalidPose, match=r"X_WA is on a device"):  # devices mixed
        collide.collide(A, B, ByDlpack(EYE, (kind, 0)), EYE)
    assert refusal(ByDlpack(EYE, (3, 0))) is None  # memory of the processor, pinned


def test_tensors_elsewhere_with_gradients_and_of_few_digits_are_refused_by_name():
    torch = library("torch")
    for X, words in (
        (torch.empty(4, 4, device="meta"), r"is on the device meta.*x\.cpu\(\)"),
        (torch.eye(4, requires_grad=True), r"requires_grad=True.*x\.detach\(\).*torch_distance"),
        (torch.nn.Parameter(torch.eye(4)), r"requires_grad=True"),
        (torch.eye(4).half(), r"must not be float16.*x\.float\(\)"),
        (torch.eye(4).bfloat16(), r"must not be bfloat16.*x\.float\(\)"),
        (torch.eye(4).to_sparse(), "to_dense"),
    ):
        with pytest.raises(InvalidPose, match=f"(?s)X_WB.*{words}"):
            collide.collide(A, B, EYE, X)
    assert collide.collide(A, B, EYE, torch.eye(4, requires_grad=True).detach()) is True


def test_traced_arrays_and_few_digits_of_jax_are_refused_by_name():
    jnp, jax = library("jax"), import_module("jax")
    with pytest.raises(InvalidPose, match="X_WB is traced by jax"):
        jax.jit(lambda X: collide.collide(A, B, EYE, X))(jnp.eye(4))
    with pytest.raises(InvalidPose, match=r"must not be bfloat16.*x\.astype\('float32'\)"):
        collide.collide(A, B, EYE, jnp.eye(4, dtype=jnp.bfloat16))


def test_half_precision_of_numpy_is_refused_as_an_array_and_a_number_is_not():
    with pytest.raises(InvalidPose, match="X_WB must not be float16"):
        collide.collide(A, B, EYE, EYE.astype(np.float16))
    assert collide.Sphere(np.float16(0.5)) == collide.Sphere(0.5)
    assert not narrow_float(np.dtype(np.float32)) and narrow_float(np.dtype(np.float16)) == "float16"


# --- going out ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LIBRARIES)
def test_results_go_out_as_arrays_of_the_library(name):
    xp = library(name)
    X = xp.asarray(shifts())
    plain = collide.distance(A, B, EYE, shifts())
    for like in (name, X):
        r = collide.distance(A, B, EYE, X, like=like)
        for field in ("distance", "normal", "point_a", "hit", "how", "vertices_a", "a"):
            value = getattr(r, field)
            assert type(value) is type(X), field
            assert np.allclose(np.asarray(value), getattr(plain, field), rtol=1e-6, atol=1e-7), field
        assert len(r) == len(plain) and r[3].distance == plain[3].distance and type(r[3].normal) is type(X)
        assert np.array_equal(r.result.rows, plain.rows) and type(r[2:7].normal) is type(X)
        hits = collide.collide(A, B, EYE, X, like=like)
        assert type(hits) is type(X) and np.array_equal(np.asarray(hits), plain.hit)
        assert type(pickle.loads(pickle.dumps(r)).normal) is type(X)
    world = collide.World()
    world.add_many(B, shifts(30))
    rows = world.distances()
    assert type(rows.to(X)["distance"]) is type(X) and len(rows.to(X)) == len(rows)
    assert type(collide.to_library(np.zeros((2, 3)), X)) is type(X)


def test_tensors_share_memory_with_the_rows():
    library("torch")
    r = collide.distance(A, B, EYE, shifts())
    r.to("torch").distance[0] = 12.0
    assert r.distance[0] == 12.0


def test_bounds_stay_bounds_as_float32_of_jax():
    jax = library("jax") and import_module("jax")
    assert not jax.config.jax_enable_x64
    rng = np.random.default_rng(4)
    X = collide.poses(rng.uniform(-2, 2, (400, 3)), quat_wxyz=rng.normal(size=(400, 4)))
    plain, r = collide.distance(A, B, EYE, X), collide.distance(A, B, EYE, X, like="jax")
    lower, upper = np.asarray(r.lower), np.asarray(r.upper)
    assert lower.dtype == np.float32
    assert (lower.astype(float) <= plain.lower).all() and (upper.astype(float) >= plain.upper).all()
    to_nearest = plain.lower.astype(np.float32).astype(float)
    assert (to_nearest > plain.lower).any(), "rounding to nearest would have passed"


def test_bounds_as_float32_at_the_ends_of_the_range():
    values = np.array([1e50, -1e50, 1e-60, -1e-60, np.inf, -np.inf, 0.0, 0.1])
    for towards in (-np.inf, np.inf):
        bounds = as_bound(values, towards).astype(float)
        assert (bounds <= values).all() if towards < 0 else (bounds >= values).all()
        assert np.abs(bounds[6:] - values[6:]).max() < 1e-8


def test_bad_likes_are_refused_by_name():
    for like in ("cupy", "", 3, [1.0], "Torch", object()):
        with pytest.raises(InvalidArgument, match='like must be "numpy", "torch", "jax"'):
            collide.collide(A, B, EYE, shifts(3), like=like)
        with pytest.raises(InvalidArgument, match='like must be'):
            collide.distance(A, B, EYE, shifts(3)).to(like)
    with pytest.raises(InvalidArgument, match="column"):
        collide.to_library(collide.distance(A, B, EYE, shifts(3)).rows, "numpy")
    r = collide.distance(A, B, EYE, shifts(3), like="numpy")
    assert isinstance(r, collide.PairResult) and collide.collide(A, B, EYE, EYE, like="numpy") is True
