"""Numba's compiler without the work that kernels have no use for: half the seconds of a first call.

Everything here is done only while an entry is compiled, and all but the second and the last two change how long compiling takes,
not what comes out of it. Each step was measured on `answer_pairs` (226 kernels, 27 s with numba as it is but
for the first):

* optimise and translate the entry alone, with all it calls linked in, once (half of 40 s);
* of hasty entries, make each kernel only smaller before that, since all of LLVM's passes come again when everything is in
  one place: 8 % less to compile, and kernels 1 to 2 % slower, which is why not all entries are hasty;
* remember what type an operator gives for types of operands: 22,000 times of 22,600 the answer is known (5 s);
* look for garbage rarely: hundreds of megabytes of syntax trees live to the end anyway (3 s);
* ask LLVM once how large a type is, which takes a module of its own; find the variables of statements in one list;
  tell nobody of 150,000 events to which nobody listens (together 1 s);
* leave out two passes for what kernels do not have, and numba's checks of its own passes (3 s);
* do not clear variables that are seen for the last time, as numba does for references, which kernels have none of (0.5 s);
* do not let negative indices count from the end: no kernel has any, but wherever the compiler could not know that, it
  compared, added and selected at every access (kernels 3 to 9 % faster);
* tell the compiler which kernels are called seldom: loops in which they may be called keep their numbers in registers
  all the same (gaps up to 10 % faster).

Where a numba has no such part, that step is left out: slower, not wrong.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from functools import cache, lru_cache
from typing import Any

import llvmlite.binding
from numba import _dynfunc
from numba.core import base, compiler, event, ir, lowering, types
from numba.core.codegen import CPUCodegen, CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.dispatcher import _DispatcherBase as Dispatcher
from numba.core.targetconfig import TargetConfig
from numba.core.types.functions import BaseFunction
from numba.np import arrayobj

#: Kernels that are called seldom, by their modules and names (`_jit.kernel`).
SELDOM: set[tuple[str, str]] = set()
#: How the names of kernels begin, as numba writes them in machine code.
_OF_COLLIDE = "_ZN7collide"
#: Passes for functions within functions and for expressions of whole arrays, of which kernels have none.
_UNUSED_PASSES = {"InlineClosureLikes", "NopythonRewrites"}
#: New objects between two looks for garbage while an entry is compiled; Python's own 700 make it look 20,000 times.
_OBJECTS_BETWEEN_COLLECTIONS = 100_000


#: Numba's own steps after lowering, of this numba: `_translated_once` exchanges them.
_STEPS = [
    (owner, name, vars(owner)[name])
    for owner, name in [
        (CPUCodeLibrary, "finalize"), (CPUContext, "get_executable"), (CPUCodeLibrary, "_optimize_functions"),
    ]
    if name in vars(owner)
]  # fmt: skip


#: Whether single passes of LLVM's can be asked for.
_CAN_CHOOSE = hasattr(CPUCodegen, "_pass_builder") and hasattr(llvmlite.binding, "create_new_function_pass_manager")


#: Numba's own parts while an entry is compiled and others stand in their places.
_numbas_own: list[tuple[Any, str, Any]] = []


def compiled_lean(function: Callable, hasty: bool, compile_it: Callable[[], Any]) -> Any:
    """What ``compile_it`` gives, called while the entry of this function is compiled, or read from the disk cache.

    hasty : at some expense of its speed.
    """
    global _numbas_own
    # The lock first: another thread may have these parts replaced, and they must not be taken for numba's.
    with global_compiler_lock:
        parts = [*_translated_once(function.__qualname__, hasty), *_without_idle_work(), *_silent_events()]
        there, back = _exchange(parts)
        before, thresholds = _numbas_own, gc.get_threshold()
        # Of an entry compiled amid another one, by a signal's handler, numba's are those before the outer one.
        own = before or [(owner, name, vars(owner)[name]) for owner, name, _ in parts]
        try:
            _numbas_own = own
            any(there)
            _collect_rarely(thresholds)
            return compile_it()
        finally:
            _numbas_own = before
            try:
                any(back)
            finally:
                gc.set_threshold(*thresholds)


def _exchange(parts: list[tuple[Any, str, Any]]) -> tuple[Iterator[None], Iterator[None]]:
    """(attributes of numba's classes and modules become others when this is run down, they become what they are now).

    For who holds the compiler's lock: whoever comes without it would take these parts for numba's own, and put them back
    for good. To run one down, `any` will do: one call, in which no Python runs and no interrupt comes.
    """
    owners, names, others = [owner for owner, _, _ in parts], [name for _, name, _ in parts], [part for _, _, part in parts]
    own = [vars(owner)[name] for owner, name in zip(owners, names)]
    return map(setattr, owners, names, others), map(setattr, owners, names, own)


def _collect_rarely(thresholds: tuple) -> None:
    if 0 < thresholds[0] < _OBJECTS_BETWEEN_COLLECTIONS:  # 0: somebody has switched it off
        gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS, *thresholds[1:])


def _translated_once(own: str, hasty: bool) -> list[tuple[Any, str, Any]]:
    """Numba's steps after lowering, done for the function of this name alone.

    Numba does them for every callee as well, and once more for each caller on the way up. Kernels are reached
    through entries only, so that work is lost.
    """
    if len(_STEPS) < 3 or "_compile_for_args" not in vars(Dispatcher):
        return []
    (_, _, finish), (_, _, executable), (_, _, optimise) = _STEPS
    call = vars(Dispatcher)["_compile_for_args"]

    def finish_entry(library):
        if library.name == own:
            library._linking_libraries = _all_called(library)
            finish(library)
        else:
            library._raise_if_finalized()
            library._finalized = True

    def executable_of_entry(context, library, fndesc, env):
        if library.name == own:
            return executable(context, library, fndesc, env)
        return _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "not callable", 0, env, (library,))

    def compile_for_call(dispatcher, *args, **kws):
        """A call from Python is none of this entry's: of another thread, which is to wait for the compiler's lock as ever
        and finds numba as it was; or in this one, of a signal's handler or a finalizer."""
        if not global_compiler_lock.is_locked():  # by this thread, that is
            return call(dispatcher, *args, **kws)
        there, back = _exchange(_numbas_own)
        try:
            any(there)
            return call(dispatcher, *args, **kws)
        finally:
            any(back)

    return [
        (Dispatcher, "_compile_for_args", compile_for_call),
        (CPUCodeLibrary, "finalize", finish_entry),
        (CPUContext, "get_executable", executable_of_entry),
        (CPUCodeLibrary, "_optimize_functions", _make_smaller if hasty and _CAN_CHOOSE else optimise),
    ]


def _make_smaller(library, module) -> None:
    """Variables become values, and what follows from that at once."""
    module.data_layout = library._codegen._data_layout
    options = library._codegen._pass_builder()
    for function in module.functions:
        if not function.is_declaration:
            passes = llvmlite.binding.create_new_function_pass_manager()
            passes.add_sroa_pass()
            passes.add_instruction_combine_pass()
            passes.add_simplify_cfg_pass()
            passes.run(function, options)


def _all_called(library) -> list:
    """The libraries that one calls, and those that they call in turn, each once."""
    found: dict[Any, None] = {}
    waiting = list(reversed(library._linking_libraries))
    while waiting:
        one = waiting.pop()
        if one not in found:
            found[one] = None
            waiting += reversed(one._linking_libraries)
    return list(found)


def _without_idle_work() -> list[tuple[Any, str, Any]]:
    """What the compiler's front end need not do, or not twice; of what this numba has."""
    builder = compiler.DefaultPassBuilder
    pipelines = ("define_untyped_pipeline", "define_typed_pipeline", "define_nopython_lowering_pipeline")
    changed: list[tuple[Any, str, Callable[[Any], Any]]] = [
        (BaseFunction, "get_call_type", _remembering_types),
        (base, "_has_loc", lru_cache(maxsize=None)),
        (TargetConfig, "values", _values_of_options),
        (PassManager, "_ENFORCING", lambda _own: False),
        (base.BaseContext, "get_abi_sizeof", _remembering_sizes),
        (ir.Inst, "_rec_list_vars", lambda _own: _variables_of),
        (arrayobj, "fix_integer_index", _without_counting_from_the_end),
        (lowering.Lower, "delvar", _without_forgetting),
        (base.BaseContext, "declare_function", _with_seldom_called),
        *((builder, name, _without_unused_passes) for name in pipelines),
    ]
    return [(owner, name, change(getattr(owner, name))) for owner, name, change in changed if name in vars(owner)]


def _silent_events() -> list[tuple[Any, str, Any]]:
    """What tells of steps, where nobody listens; numba tells of every one of its locks and passes."""
    if any(getattr(event, "_registered", {"": True}).values()):
        return []
    nothing = nullcontext()
    silent = {
        "start_event": lambda *_args, **_kws: None, "end_event": lambda *_args, **_kws: None,
        "trigger_event": lambda *_args, **_kws: nothing,
    }  # fmt: skip
    return [(event, name, function) for name, function in silent.items() if hasattr(event, name)]


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


def _remembering_sizes(size_of):
    """The bytes of a type of LLVM's, asked once."""
    known = {}

    def remembered(self, kind):
        key = id(self), str(kind)
        if key not in known:
            known[key] = self, size_of(self, kind)  # as above
        return known[key][1]

    return remembered


def _variables_of(_statement, value) -> list:
    """The variables in a statement's parts, as numba finds them, with one list for all."""
    found: list = []
    waiting = [value]
    while waiting:
        part = waiting.pop()
        kind = _kind_of(part.__class__)
        if kind is ir.Var:
            found.append(part)
        elif kind is ir.Inst:
            found += part.list_vars()
        elif kind is list:
            waiting += reversed(part)
        elif kind is dict:
            waiting += reversed(part.values())
    return found


@cache
def _kind_of(part: Any) -> type | None:
    for kind in (ir.Var, ir.Inst, dict):
        if issubclass(part, kind):
            return kind
    return list if issubclass(part, (list, tuple)) else None


def _without_counting_from_the_end(fixed):
    """Numba's index of an array, where an integer below 0 is one counted from the end: in kernels as it is."""

    def index(context, builder, kind, value, size):
        # By name: a function of numba's or of somebody else's, compiled meanwhile, may have such indices.
        if not builder.function.name.startswith(_OF_COLLIDE):
            return fixed(context, builder, kind, value, size)
        return context.cast(builder, value, kind, types.intp if kind.signed else types.uintp)

    return index


def _with_seldom_called(declare):
    """Numba's declaration of a function, marked where it is called `SELDOM`."""

    def declared(self, module, fndesc):
        made = declare(self, module, fndesc)
        if (fndesc.modname, fndesc.qualname) in SELDOM:
            made.attributes.add("cold")
        return made

    return declared


def _without_forgetting(forget):
    """What numba does where a variable is seen last: it gives up its reference, of which kernels have none."""

    def forgotten(self, name):
        if self.context.enable_nrt:
            forget(self, name)

    return forgotten


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
