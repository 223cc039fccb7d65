"""Kernels to LLVM's code, by Numba's front end: for the build of the library, and for kernels compiled just in time.

Kernels are no part of Numba's own target: they have one beside it, made of subclasses of what Numba has for processors.
So nothing of Numba's is changed for whoever uses it in the same process, and what kernels do not have need not be done:
no counted references, no wrappers for Python, no machine code of each callee. `back_end.py` makes machine code of an
entry and all it calls at once.
"""

from __future__ import annotations

from collections.abc import Callable

import llvmlite.binding as llvm
from llvmlite import ir
from numba import _dynfunc
from numba.core import compiler, sigutils, types, typing, untyped_passes
from numba.core.codegen import AOTCPUCodegen, CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUTarget
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry
from numba.core.typed_passes import NopythonRewrites
from numba.core.utils import threadsafe_cached_property
from numba.extending import intrinsic

from collide.kernels.back_end import FAILED

#: Numba's name for the target of kernels.
TARGET = "collide"
_FLAGS = {
    "nopython": True,
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
#: For functions within functions, with-blocks and expressions of whole arrays, of which kernels have none.
_UNUSED_PASSES = {untyped_passes.InlineClosureLikes, untyped_passes.WithLifting, NopythonRewrites}


class Kernels(CPU):
    """The target of kernels, for Numba's registries."""


class _Library(CPUCodeLibrary):
    """The code of one kernel, as it was lowered; nothing is linked or optimised here."""

    def __init__(self, codegen, name):
        super().__init__(codegen, name)
        self.modules: list[bytes] = []

    def add_linking_library(self, library):
        self._linking_libraries.append(library)

    def add_llvm_module(self, ll_module):
        self.modules.append(ll_module.as_bitcode())

    def finalize(self):
        self._finalized = True


class _Codegen(AOTCPUCodegen):
    _library_class = _Library


class _Context(CPUContext):
    def init(self):
        super().init()
        self._internal_codegen = _Codegen("collide")
        self._sizes: dict[str, int] = {}

    def get_executable(self, library, fndesc, env):
        """Kernels are reached through entries only: what stands for one in Python cannot be called."""
        return _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "a kernel", 0, env, (library,))

    def post_lowering(self, mod, library):
        """Kernels count no references: nothing is to be linked for that."""

    def get_abi_sizeof(self, ty):
        key = str(ty)  # asking LLVM takes a module of its own
        if key not in self._sizes:
            self._sizes[key] = super().get_abi_sizeof(ty)
        return self._sizes[key]

    def declare_function(self, module, fndesc):
        made = super().declare_function(module, fndesc)
        if (fndesc.modname, fndesc.qualname) in _cold:
            made.attributes.add("cold")
        return made


class _Typing(typing.Context):
    """Remembers what type an operator gives for types of operands: the answer is known 39 times of 40."""

    def __init__(self):
        self._known: dict = {}
        super().__init__()

    def resolve_function_type(self, func, args, kws):
        if kws or not isinstance(func, types.Function):
            return super().resolve_function_type(func, args, kws)
        key = func, args
        if key not in self._known:
            resolved = super().resolve_function_type(func, args, kws)
            if resolved is None:
                return None
            self._known[key] = resolved
        return self._known[key]


class _Target(CPUTarget):
    @threadsafe_cached_property
    def _toplevel_target_context(self):
        return _Context(self.typing_context, TARGET)

    @threadsafe_cached_property
    def _toplevel_typing_context(self):
        return _Typing()


class _Compiler(compiler.CompilerBase):
    def define_pipelines(self):
        whole = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        ours = PassManager("kernels")
        ours.passes = [step for step in whole.passes if step[0] not in _UNUSED_PASSES]
        ours.finalize()
        return [ours]


class KernelDispatcher(Dispatcher):
    """A kernel for the compiler: compiled for each types it is called with by another kernel."""

    targetdescr = _Target(TARGET)

    def get_call_template(self, args, kws):
        """An argument written as a constant has no type of its own, or kernels would be compiled for each constant."""
        return super().get_call_template(
            tuple(types.unliteral(a) for a in args), {name: types.unliteral(a) for name, a in kws.items()}
        )


#: Kernels on rarely taken paths, by their modules and names.
_cold: set[tuple[str, str]] = set()


def dispatcher(function: Callable, *, inline: bool = False, cold: bool = False) -> KernelDispatcher:
    """A kernel, as `collide.kernels.kernel` makes it."""
    if cold:
        _cold.add((function.__module__, function.__qualname__))
    options = {**_FLAGS, "forceinline": inline}
    return KernelDispatcher(function, targetoptions=options, pipeline_class=_Compiler)


def _of_numba(*args, **options):
    """Numba's own functions, where it has them in Python, compiled for kernels like kernels."""
    if args:
        return dispatcher(args[0])
    return lambda function: dispatcher(function, inline=bool(options.get("forceinline")))


target_registry[TARGET] = Kernels
jit_registry[Kernels] = _of_numba
dispatcher_registry[Kernels] = KernelDispatcher


class Lowered:
    """The code of entries and of the kernels that they call, each kernel once."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.modules: list[bytes] = []
        self._known: set[_Library] = set()

    def add(self, name: str, function: Callable, signature: str) -> None:
        """Lower an entry, and what of its callees is not there yet. In LLVM's code it is a C function of this name.

        Raises numba's errors where it is no kernel.
        """
        arguments, result = sigutils.normalize_signature(signature)
        target, flags = KernelDispatcher.targetdescr, compiler.Flags()
        target.options.parse_as_flags(flags, _FLAGS)
        with target_override(TARGET), global_compiler_lock:
            compiled = compiler.compile_extra(
                target.typing_context, target.target_context, function, arguments, result, flags, {}, None, _Compiler
            )
        self.names.append(name)
        self.modules.append(_c_function(name, compiled, target.target_context))
        for library in _all_called(compiled.library):
            if library not in self._known:
                self._known.add(library)
                self.modules += library.modules


def _all_called(library: _Library) -> list[_Library]:
    """A library, those that it calls, and those that they call in turn, each once."""
    reached: dict[_Library, None] = {}
    waiting = [library]
    while waiting:
        current = waiting.pop()
        if current not in reached:
            reached[current] = None
            waiting += reversed(current._linking_libraries)
    return list(reached)


def c_function_type(context, arguments: tuple, result: types.Type) -> ir.FunctionType:
    """LLVM's type of an entry as a C function: booleans are bytes."""
    kinds = [context.get_data_type(kind) for kind in arguments]
    return ir.FunctionType(ir.VoidType() if result == types.none else context.get_data_type(result), kinds)


def _c_function(name: str, compiled, context) -> bytes:
    """Bitcode of a C function that calls an entry; a status that is an error ends in `FAILED`."""
    description = compiled.fndesc
    arguments, result = description.argtypes, description.restype
    module = ir.Module(name)
    module.triple = llvm.get_process_triple()
    native = ir.Function(module, context.call_conv.get_function_type(result, arguments), description.llvm_func_name)
    made = ir.Function(module, c_function_type(context, arguments, result), name)
    builder = ir.IRBuilder(made.append_basic_block("entry"))
    values = [context.data_model_manager[kind].from_data(builder, value) for kind, value in zip(arguments, made.args)]
    status, value = context.call_conv.call_function(builder, native, result, arguments, values)
    with builder.if_then(status.is_error, likely=False):
        builder.call(ir.Function(module, ir.FunctionType(ir.VoidType(), []), FAILED), [])
    if result == types.none:
        builder.ret_void()
    else:
        builder.ret(context.data_model_manager[result].as_data(builder, value))
    return llvm.parse_assembly(str(module)).as_bitcode()


def native_call(signature: str):
    """A kernel ``call(address, arguments)``: runs the entry of this signature that stands there."""
    arguments, result = sigutils.normalize_signature(signature)

    def make(_context, address, values):
        def codegen(context, builder, _signature, args):
            manager = context.data_model_manager
            unpacked = [
                manager[kind].as_data(builder, builder.extract_value(args[1], k)) for k, kind in enumerate(arguments)
            ]
            place = builder.inttoptr(args[0], c_function_type(context, arguments, result).as_pointer())
            value = builder.call(place, unpacked)
            return context.get_dummy_value() if result == types.none else manager[result].from_data(builder, value)

        return result(types.int64, types.Tuple(arguments)), codegen

    return intrinsic(make)
