"""Numba's compiler without the work that kernels have no use for: half the seconds of a first call.

Everything here changes how long compiling takes, not what comes out of it, and only while an entry is
compiled. Each step was measured on `answer_pairs` (226 kernels, 27 s with numba as it is but for the first):

* optimise and translate the entry alone, with all it calls linked in (half of 40 s);
* remember what type an operator gives for types of operands: 22,000 times of 22,600 the answer is known (5 s);
* look for garbage rarely: hundreds of megabytes of syntax trees live to the end anyway (3 s);
* leave out two passes for what kernels do not have, and numba's checks of its own passes (3 s).

Where a numba has no such part, that step is left out: slower, not wrong.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from typing import Any

from numba import _dynfunc
from numba.core import base, compiler
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.targetconfig import TargetConfig
from numba.core.types.functions import BaseFunction

#: Passes for functions within functions and for expressions of whole arrays, of which kernels have none.
_UNUSED_PASSES = {"InlineClosureLikes", "NopythonRewrites"}
#: New objects between two looks for garbage while an entry is compiled; Python's own 700 make it look 20,000 times.
_OBJECTS_BETWEEN_COLLECTIONS = 100_000


@contextmanager
def lean_compiling(function: Callable) -> Iterator[None]:
    """While the entry of this function is compiled."""
    # The lock first: another thread may have these parts replaced, and they must not be taken for numba's.
    with global_compiler_lock, ExitStack() as stack:
        for owner, name, part in [*_translated_once(function.__qualname__), *_without_idle_work()]:
            stack.enter_context(_replaced(owner, name, part))
        stack.enter_context(_rarely_collecting())
        yield


@contextmanager
def _replaced(owner: Any, name: str, part: Any) -> Iterator[None]:
    """An attribute of one of numba's classes or modules exchanged for a while."""
    own = vars(owner)[name]
    setattr(owner, name, part)
    try:
        yield
    finally:
        setattr(owner, name, own)


@contextmanager
def _rarely_collecting() -> Iterator[None]:
    thresholds = gc.get_threshold()
    if 0 < thresholds[0] < _OBJECTS_BETWEEN_COLLECTIONS:  # 0: somebody has switched it off
        gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def _translated_once(own: str) -> list[tuple[Any, str, Any]]:
    """Numba's three steps after lowering, done for the function of this name alone.

    Numba does them for every callee as well, and once more for each caller on the way up. Kernels are reached
    through entries only, so that work is lost.
    """
    if not all(hasattr(CPUCodeLibrary, name) for name in ("_optimize_final_module", "_finalize_final_module")):
        return []
    optimise, finish = CPUCodeLibrary._optimize_final_module, CPUCodeLibrary._finalize_final_module
    executable = CPUContext.get_executable

    def optimise_entry(library):
        if library.name == own:
            optimise(library)

    def finish_entry(library):
        if library.name == own:
            finish(library)
        else:
            library._finalized = True

    def executable_of_entry(context, library, fndesc, env):
        if library.name == own:
            return executable(context, library, fndesc, env)
        return _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "not callable", 0, env, (library,))

    return [
        (CPUCodeLibrary, "_optimize_final_module", optimise_entry),
        (CPUCodeLibrary, "_finalize_final_module", finish_entry),
        (CPUContext, "get_executable", executable_of_entry),
    ]


def _without_idle_work() -> list[tuple[Any, str, Any]]:
    """What the compiler's front end need not do, or not twice; of what this numba has."""
    builder = compiler.DefaultPassBuilder
    pipelines = ("define_untyped_pipeline", "define_typed_pipeline", "define_nopython_lowering_pipeline")
    changed: list[tuple[Any, str, Callable[[Any], Any]]] = [
        (BaseFunction, "get_call_type", _remembering_types),
        (base, "_has_loc", lru_cache(maxsize=None)),
        (TargetConfig, "values", _values_of_options),
        (PassManager, "_ENFORCING", lambda _own: False),
        *((builder, name, _without_unused_passes) for name in pipelines),
    ]
    return [(owner, name, change(getattr(owner, name))) for owner, name, change in changed if name in vars(owner)]


def _remembering_types(call_type):
    """The type of an operator's or a built-in function's result, asked once for each types of its arguments."""
    known = {}

    def remembered(self, context, args, kws):
        if kws:
            return call_type(self, context, args, kws)
        key = id(self), args
        if key not in known:
            known[key] = self, call_type(self, context, args, kws)  # self is held, so that its id stays its own
        return known[key][1]

    return remembered


def _values_of_options(_own):
    """All of a configuration's values without a property call for each: two are compared a hundred thousand times."""

    def values(self):
        return {name: self._values.get(name, option.default) for name, option in self.options.items()}

    return values


def _without_unused_passes(pipeline):
    def leaner(state, *args, **kwargs):
        manager = pipeline(state, *args, **kwargs)
        manager.passes = [step for step in manager.passes if step[0].__name__ not in _UNUSED_PASSES]
        return manager

    return staticmethod(leaner)
