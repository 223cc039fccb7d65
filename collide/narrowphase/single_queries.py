"""Public functions of two shapes at a pair of poses, or at many: the pair made ready for such calls is asked first.

In a process with the library these functions are C's (`native/python_module.c`): no Python runs between the call and
the result. Elsewhere this module does the same in Python. Questions left open by the pair, and calls of other forms,
go to the decorated function, which checks arguments, answers the other batches, and raises.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import partial, wraps
from typing import Any, TypeVar

import numpy as np

from collide.base import argument_checks as checks
from collide.kernels.prepared import is_matrix, query_of_c
from collide.narrowphase.prepared_pairs import prepared_pair
from collide.results import PAIR_DTYPE, PairResult
from collide.transforms import LARGEST, SMALLEST

Function = TypeVar("Function", bound=Callable)

#: More contacts than a patch can have, and a number that kernels take.
ALL_CONTACTS = 2**31 - 1


def asks_prepared_pairs(
    prepare: Callable[[Any, Any], bool], result: type | None = None, certify: Callable | None = None
) -> Callable[[Function], Function]:
    """Decorates `collide`, `distance` or `contacts`.

    prepare : makes two shapes ready, and says whether the call has done so; False of anything else. Asked where a pair
    of matrices meets a pair of shapes that is not ready, and then the pair is asked.
    result : the type of the returned object, whose row is opened when fields are asked for; ``None`` of booleans.
    certify : makes certificates of results.
    """

    def decorate(function: Function) -> Function:
        if query_of_c is None:
            return _in_python(function, prepare, result, certify)
        name = function.__name__
        return query_of_c(function, _described(function), _LENGTHS[name], _USUAL[name], prepare, result, certify)

    return decorate


#: The length and the option that calls have unless they say otherwise.
_USUAL: dict[str, tuple] = {"collide": (0.0, None), "distance": (math.inf, True), "contacts": (0.0, 8)}
#: The least and the most length [m] besides 0; others are for the decorated function to look at.
_LENGTHS = {"collide": (SMALLEST, LARGEST), "distance": (0.0, math.inf), "contacts": (0.0, LARGEST)}


def _described(function: Callable) -> str:
    """Its docstring behind the line that `inspect.signature` reads of functions of C."""
    signature = inspect.signature(function)
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in signature.parameters.values()]
    line = str(signature.replace(parameters=bare, return_annotation=inspect.Signature.empty))
    return f"{function.__name__}{line.replace('=inf', '=math.inf')}\n--\n\n{inspect.getdoc(function)}"


# --- the same in Python -------------------------------------------------------------------------


def _in_python(function: Any, prepare: Callable, result: Any, certify: Callable | None) -> Any:
    ask = {"collide": _collide, "distance": partial(_distance, certify), "contacts": partial(_contacts, result)}

    known = inspect.signature(function).parameters.keys()

    @wraps(function)
    def query(*arguments, **options):
        is_single = options.keys() <= known and _are_plain(arguments, **options)
        answer = ask[function.__name__](*arguments, **options) if is_single else None
        if is_single and answer is None and _are_matrices(*arguments[2:]) and prepare(*arguments[:2]):
            answer = ask[function.__name__](*arguments, **options)
        return function(*arguments, **options) if answer is None else answer

    return query


def _are_plain(
    arguments: tuple, *, check_poses=True, threads=1, axes=None, algorithm=None, depth="quick", derivatives=False,
    like=None, **_,
) -> bool:
    plain = check_poses.__class__ is bool and threads.__class__ is int and threads == 1
    plain = plain and isinstance(depth, str) and depth == "quick" and derivatives is False
    return len(arguments) == 4 and plain and axes is None and algorithm is None and like is None


def _are_batch(X_WA: Any, X_WB: Any) -> bool:
    """Whether two arrays are a batch of poses as kernels read them, either perhaps a single pose for all of the
    other's."""
    lengths = {_n_poses(X_WA), _n_poses(X_WB)} - {1}
    return len(lengths) < 2 and 0 not in lengths and max(X_WA.ndim, X_WB.ndim) == 3


def _n_poses(X: Any) -> int:
    """Of a batch or a single pose; 0 of what kernels do not read."""
    if type(X) is not np.ndarray or X.shape[-2:] != (4, 4) or X.ndim not in (2, 3) or not X.size:
        return 0
    return X.size // 16 if is_matrix(X.reshape(-1, 4, 4)[0]) and X.flags.c_contiguous else 0


def _are_matrices(X_WA, X_WB) -> bool:
    return is_matrix(X_WA) and is_matrix(X_WB)


def _length(question: str, value: Any) -> float | None:
    """A length [m] as a float; ``None`` where the decorated function has to look at the value."""
    if value.__class__ is bool or not isinstance(value, (float, int)):
        return None
    length, (min_length, max_length) = checks.number(value), _LENGTHS[question]
    assert length is not None
    return length if length == value and (length == 0.0 or min_length <= length <= max_length) else None


def _collide(A, B, X_WA, X_WB, *, security_margin=0.0, **_) -> bool | None:
    pair, margin = prepared_pair(A, B), _length("collide", security_margin)
    if pair is None or margin is None:
        return None
    if margin == 0.0:
        ask = pair.collide_poses if _are_batch(X_WA, X_WB) else pair.collide
        return ask and ask(X_WA, X_WB)
    return pair.within and pair.within(X_WA, X_WB, margin)


def _distance(certify, A, B, X_WA, X_WB, *, max_distance=math.inf, signed=True, **_) -> PairResult | None:
    pair, limit = prepared_pair(A, B), _length("distance", max_distance)
    if pair is None or limit is None or signed.__class__ is not bool:
        return None
    if _are_batch(X_WA, X_WB):
        answer = pair.distance_poses and pair.distance_poses(X_WA, X_WB, signed, limit)
        return answer and PairResult(answer[0], False, (A, B, *answer[1:]), certify)
    if pair.distance is None:
        return None
    if not _are_matrices(X_WA, X_WB):
        return None
    memory = bytearray(PAIR_DTYPE.itemsize) + X_WA.tobytes() + X_WB.tobytes()
    if pair.distance(X_WA, X_WB, memory, signed, limit) is None:
        return None
    single: Any = PairResult.__new__(PairResult)
    single._single = A, B, memory, certify
    return single


def _contacts(result, A, B, X_WA, X_WB, *, margin=0.0, max_contacts=8, **_) -> Any:
    pair, length = prepared_pair(A, B), _length("contacts", margin)
    if pair is None or length is None or pair.contacts is None or max_contacts.__class__ is not int:
        return None
    if not 1 <= max_contacts <= ALL_CONTACTS:
        return None
    rows = pair.contacts(X_WA, X_WB, max_contacts, length)
    if rows is None:
        return None
    single = result.__new__(result)
    single._single = rows
    return single
