"""Arrays of other libraries, PyTorch's and JAX's above all: how they come in, and how results go out.

An array in the processor's memory comes in by ``__array_interface__``, ``__array__`` or DLPack: as a view of its
memory where it holds doubles in C order. Nothing is fetched from another device, and no gradient is dropped in
silence: `refusal` says what to write instead. No library is imported before an array or a name of the caller's asks
for it.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from collide.errors import InvalidArgument, MissingExtra, brief

#: Libraries by the names of their modules, with the names of packages their classes are defined in.
LIBRARIES = {"numpy": ("numpy",), "torch": ("torch",), "jax": ("jax", "jaxlib")}
#: DLPack's numbers of memory that the processor reads: its own, and what is pinned for CUDA.
_OF_THE_PROCESSOR = (1, 3)
#: What moves an array to the processor, by the package of its class.
_MOVED = {"torch": "x.cpu()", "jax": "jax.device_get(x)", "jaxlib": "jax.device_get(x)", "cupy": "cupy.asnumpy(x)"}
_WIDER = {"torch": "x.float()", "jax": "x.astype('float32')", "jaxlib": "x.astype('float32')"}
#: Names of fields that are bounds, and the way in which they may be rounded.
_ROUNDED_TOWARDS = {"lower": -np.inf, "upper": np.inf}


def package_of(value: Any) -> str:
    """The package in which the class of a value, or a base class, is defined: "torch", "jaxlib", ...; else ""."""
    packages = [kind.__module__.partition(".")[0] for kind in type(value).__mro__]
    return next((package for package in packages if package in _MOVED or package == "numpy"), "")


def refusal(value: Any) -> str | None:
    """Why an array of another library cannot be read, and the line that helps; ``None`` for what can be read.

    Refused: memory of another device, gradients, arrays without numbers as traced by JAX, floats of 8 and 16 bits.
    """
    dtype = getattr(value, "dtype", None)
    if dtype is not None and getattr(value, "ndim", None) and (named := narrow_float(dtype)):
        wider = _WIDER.get(package_of(value), "x.astype('float32')")
        return f"must not be {named}, which has too few digits for a pose or a length: hand in {wider}"
    if not hasattr(type(value), "__dlpack__") or type(value) is np.ndarray:
        return None
    package = package_of(value)
    if package == "jax" and "Tracer" in type(value).__name__:
        return (
            "is traced by jax and has no numbers yet: call outside of jit, grad and vmap, or through "
            "jax.pure_callback; collide.adapters.arrays.jax_distance brings its own rule"
        )
    device = _other_device(value, package)
    if device:
        moved = _MOVED.get(package, "a copy there")
        return f"is on {device}, and collide reads the processor's memory: hand in {moved}"
    if package == "torch" and value.requires_grad:
        return (
            "has requires_grad=True, and no gradient passes through this call: hand in x.detach(), or ask "
            "collide.adapters.arrays.torch_distance, which has a gradient"
        )
    return None


def narrow_float(dtype: Any) -> str:
    """The name of a type of floats of 16 bits or fewer, ``float16`` or ``bfloat16``; "" for other types."""
    name = str(dtype).rpartition(".")[2]
    return name if "float16" in name or name.startswith(("float8", "float4")) else ""


def _other_device(value: Any, package: str) -> str:
    """The device that holds an array; "" for the processor's memory."""
    if package == "torch":
        return "" if value.device.type == "cpu" else f"the device {value.device}"
    if package in ("jax", "jaxlib"):
        away = sorted(str(device) for device in value.devices() if device.platform != "cpu")
        return f"the device {away[0]}" if away else ""
    if not hasattr(value, "__dlpack_device__"):
        return ""
    kind, number = value.__dlpack_device__()
    return "" if int(kind) in _OF_THE_PROCESSOR else f"a device of DLPack's kind {int(kind)}, number {number}"


def read(value: Any) -> np.ndarray:
    """An array of whatever `numpy.asarray` reads, or by DLPack alone."""
    known_to_numpy = hasattr(value, "__array__") or hasattr(value, "__array_interface__")
    if hasattr(type(value), "__dlpack__") and not known_to_numpy:
        return np.from_dlpack(value)
    return np.asarray(value)


# --- results ------------------------------------------------------------------------------------


def library_of(like: Any, what: str = "like") -> str:
    """"numpy", "torch" or "jax", of a name or an example array. Raises InvalidArgument."""
    if isinstance(like, str) and like in LIBRARIES:
        return like
    package = "" if isinstance(like, str) else package_of(like)
    for library, packages in LIBRARIES.items():
        if package in packages:
            return library
    raise InvalidArgument(f'{what} must be "numpy", "torch", "jax" or an array of one of these, got {brief(like)}')


def to_library(values: Any, like: Any) -> Any:
    """Arrays, or a result with arrays, as arrays of NumPy, PyTorch or JAX.

    Parameters
    ----------
    values : an array of numbers or booleans of any shape; or what a query returns, `PairResult` and `WorldResult` for
        instance.
    like : "numpy", "torch" or "jax"; or an array of the library wanted. Its dtype and shape have no say.

    Returns
    -------
    An array of the library in the processor's memory; or, of a result, an object with the same fields, columns and
    length, whose arrays are of the library; ``result`` is the result itself. Numbers of single results stay Python's.
    PyTorch's tensors share the memory of the arrays, JAX's arrays are copies.

    Raises
    ------
    InvalidArgument : for other libraries.   MissingExtra : where the library is not installed.

    Notes
    -----
    Doubles stay doubles, whatever the type of the poses, because bounds of distances are proven as doubles. JAX makes
    them float32 unless ``jax_enable_x64`` is set; the fields ``lower`` and ``upper`` of results are then rounded
    downwards and upwards, and hold. O(1) for PyTorch, a copy of each array asked for with JAX.
    """
    library = library_of(like)
    convert = _converter(library)
    if isinstance(values, np.ndarray):
        if values.dtype.names:
            raise InvalidArgument("to_library: values must be an array of numbers; hand in a result, or a column of it")
        return convert(values)
    values = values.result if isinstance(values, ResultIn) else values
    return values if library == "numpy" else ResultIn(values, library)


def _converter(library: str) -> Callable[..., Any]:
    """A function of an array, and perhaps the direction to round in, to an array of a library."""
    if library == "numpy":
        return lambda values, towards=None: values
    try:
        module: Any = import_module("jax.numpy" if library == "jax" else library)
    except ImportError:
        purpose = f'return arrays of {library} (like="{library}")'
        raise MissingExtra(library, extra=library, purpose=purpose) from None
    return _into_jax(module) if library == "jax" else _into_torch(module)


def _into_torch(torch: Any) -> Callable[..., Any]:
    def convert(values: np.ndarray, towards: float | None = None) -> Any:
        shares = values.flags.writeable and min(values.strides, default=0) >= 0 and values.flags.aligned
        return torch.from_numpy(values if shares else values.copy())

    return convert


def _into_jax(jnp: Any) -> Callable[..., Any]:
    def convert(values: np.ndarray, towards: float | None = None) -> Any:
        if towards is not None and jnp.zeros(0).dtype == np.float32:  # without jax_enable_x64
            values = as_bound(values, towards)
        return jnp.array(values)

    return convert


def as_bound(values: np.ndarray, towards: float) -> np.ndarray:
    """Doubles as float32, rounded towards −∞ or ∞: a bound stays a bound."""
    with np.errstate(over="ignore"):
        narrow = values.astype(np.float32)
        is_off = narrow > values if towards < 0 else narrow < values
        return np.where(is_off, np.nextafter(narrow, np.float32(towards)), narrow)


class ToLibrary:
    """Results whose arrays may be those of another library."""

    __slots__ = ()

    def to(self, like: Any) -> Any:
        """The same result with arrays of PyTorch or JAX in place of NumPy's (`collide.to_library`).

        Parameters
        ----------
        like : "numpy", "torch", "jax", or an array of one of these libraries.

        Returns
        -------
        An object with the same fields and columns. Tensors of PyTorch share memory with ``rows``; numbers of a single
        result stay Python's.

        Raises
        ------
        InvalidArgument, MissingExtra
        """
        return to_library(self, like)


class ResultIn:
    """A result with arrays of a library: fields by attribute, columns and rows by index, as of ``result``."""

    __slots__ = ("_convert", "library", "result")

    def __init__(self, result: Any, library: str):
        self.result, self.library, self._convert = result, library, _converter(library)

    def __getattr__(self, name: str) -> Any:
        return self._of(getattr(self.result, name), name)

    def __getitem__(self, key: Any) -> Any:
        return self._of(self.result[key], key)

    def __len__(self) -> int:
        return len(self.result)

    def __repr__(self) -> str:
        return repr(self.result)

    def __reduce__(self):
        return ResultIn, (self.result, self.library)

    def _of(self, value: Any, name: Any) -> Any:
        if isinstance(value, np.ndarray) and not value.dtype.names:
            return self._convert(value, _ROUNDED_TOWARDS.get(name) if isinstance(name, str) else None)
        return ResultIn(value, self.library) if type(value) is type(self.result) else value
