"""Kernels to LLVM's code, by Numba's front end: for the build of the library, and for kernels compiled just in time.

Kernels have a target of their own beside Numba's, made of subclasses of Numba's target for processors. So Numba's
target is unchanged for its other users in the process, and work useless to kernels is left out: counted references,
wrappers for Python, machine code of each callee. `back_end.py` makes machine code of an entry and all its callees at
once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import _dynfunc
from numba.core import callconv, cgutils, compiler, errors, funcdesc, sigutils, types, typing
from numba.core import typed_passes as typed
from numba.core import untyped_passes as untyped
from numba.core.codegen import AOTCPUCodegen, CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import FunctionPass, PassManager, register_pass
from numba.core.cpu import CPUContext
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUTarget
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry
from numba.core.utils import threadsafe_cached_property
from numba.extending import intrinsic

from collide.kernels import kept_lowered, sources
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
#: For functions within functions, with-blocks, expressions of whole arrays, loops over tuples, messages made as code
#: runs, and reports, of which kernels have none: without these passes a kernel is lowered to the same bytes.
_UNUSED_PASSES = {
    untyped.InlineClosureLikes, untyped.WithLifting, untyped.RewriteDynamicRaises, untyped.MakeFunctionToJitFunction,
    untyped.InlineInlinables, untyped.FindLiterallyCalls, untyped.LiteralUnroll,
    untyped.LiteralPropagationSubPipelinePass, typed.InlineOverloads, typed.NopythonRewrites,
    typed.NoPythonSupportedFeatureValidation, typed.AnnotateTypes, typed.DumpParforDiagnostics,
}


class Kernels(CPU):
    """The target of kernels, for Numba's registries."""


class _Library(CPUCodeLibrary):
    """The code of a kernel as lowered, neither linked nor optimised."""

    def __init__(self, codegen, name):
        super().__init__(codegen, name)
        self.modules: list[bytes] = []
        self.called: list[_Library] = []
        #: What it is kept under, and the type of its result.
        self.kept_as: Any = None
        #: Numba's description of the kernel.
        self.description: Any = None

    def add_linking_library(self, library):
        self.called.append(library)

    def add_llvm_module(self, ll_module):
        self.modules.append(ll_module.as_bitcode())

    def finalize(self):
        self._finalized = True


class _Codegen(AOTCPUCodegen):
    _library_class = _Library


class _Calls(callconv.CPUCallConv):
    def return_user_exc(self, builder, exc, exc_args=None, loc=None, func_name=None):
        """Without the line that raises: nobody sees what is raised, and code does not depend on its place in a file."""
        super().return_user_exc(builder, exc)


class _Context(CPUContext):
    def init(self):
        super().init()
        self._internal_codegen = _Codegen("collide")
        self._sizes: dict[str, int] = {}

    def get_executable(self, library, fndesc, env):
        """Kernels are reached through entries only: what stands for one in Python cannot be called."""
        env = env or _dynfunc.Environment({})
        return _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "a kernel", 0, env, (library,))

    @cached_property
    def call_conv(self):
        return _Calls(self)

    def add_dynamic_addr(self, builder, intaddr, info):
        """Python's objects have addresses of their process; kernels see none of them."""
        return self.get_constant_null(types.voidptr)

    def compile_subroutine(self, builder, impl, sig, locals=None, flags=None, caching=True):
        """Numba's own functions that are called from its instructions: kernels like others."""
        made = _of_instructions(impl)
        made.compile(sig)
        compiled = made.overloads[tuple(sig.args)]
        self.active_code_library.add_linking_library(compiled.library)
        return compiled

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


@register_pass(mutates_CFG=False, analysis_only=True)
class _NameByContent(FunctionPass):
    """A kernel's LLVM name depends on its content, not on the number of kernels compiled before in this process: kept
    code is linked with new code, and the bytes come out the same."""

    _name = "collide_name_by_content"

    def __init__(self):
        FunctionPass.__init__(self)

    def run_pass(self, state) -> bool:
        identity = state.func_id
        identity.unique_id = _made_as(identity.func) or None
        identity.unique_name = f"{identity.func_qualname}${identity.unique_id}"
        return False


class _Compiler(compiler.CompilerBase):
    def define_pipelines(self):
        whole = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        ours = PassManager("kernels")
        last = {step[0]: step for step in whole.passes}  # branches that are never taken are looked for thrice
        ours.passes = [step for step in whole.passes if step is last[step[0]] and step[0] not in _UNUSED_PASSES]
        ours.add_pass_after(_NameByContent, untyped.TranslateByteCode)
        ours.finalize()
        return [ours]


class KernelDispatcher(Dispatcher):
    """A kernel for the compiler: compiled for each types it is called with by another kernel."""

    targetdescr = _Target(TARGET)

    @cached_property
    def full_name(self) -> tuple[str, str, str]:
        """Module, qualified name, and a hash to tell apart kernels made of the same source."""
        return self.py_func.__module__, self.py_func.__qualname__, _made_as(self.py_func)

    def get_call_template(self, args, kws):
        """An argument written as a constant has no type of its own, or kernels would be compiled for each constant."""
        return super().get_call_template(
            tuple(types.unliteral(a) for a in args), {name: types.unliteral(a) for name, a in kws.items()}
        )

    def compile(self, sig):
        """Lower the kernel for these types, or take the lowered code kept before."""
        arguments, asked = sigutils.normalize_signature(sig)
        known = self.overloads.get(tuple(arguments))
        if known is not None:
            return known.entry_point
        called = kept_lowered.Called(
            self.full_name, tuple(arguments), asked,
            tuple(sorted(self.targetoptions.items())),
        )
        compiled = _taken(called)
        if compiled is None:
            super().compile(sig)
            compiled = self.overloads[tuple(arguments)]
            self._keep(called, compiled)
        else:
            self.targetctx.insert_user_function(compiled.entry_point, compiled.fndesc, [compiled.library])
            self.add_overload(compiled)
        compiled.library.kept_as = called, str(compiled.signature.return_type)
        compiled.library.description = compiled.fndesc
        return compiled.entry_point

    def _keep(self, called: kept_lowered.Called, compiled: compiler.CompileResult) -> None:
        """Write the record, but for kernels calling themselves, or whose names change from process to process."""
        calls = [library.kept_as for library in dict.fromkeys(compiled.library.called)]
        if _folder is None or None in calls or " at 0x" in repr((called, sources.values_held(self.py_func))):
            return
        description = compiled.fndesc
        record = kept_lowered.Record(
            code_hash=_own_hash(called), symbol=description.mangled_name, environment=description.env_name,
            parameters=tuple(description.args), result=compiled.signature.return_type,
            modules=tuple(compiled.library.modules), calls=tuple(calls),
        )
        kept_lowered.write(_folder, called, record)


class _Changed(Exception):
    """A kernel no longer exists, or its results have other types than before."""


def _taken(called: kept_lowered.Called) -> compiler.CompileResult | None:
    """A kernel as lowered before; None where no record is kept, or its code or a callee's result has changed."""
    record = kept_lowered.read(_folder, called, _own_hash(called)) if _folder else None
    if record is None or called in _being_taken:
        return None
    context = KernelDispatcher.targetdescr.target_context
    library = context.codegen().create_library(called.name[1])
    _being_taken.add(called)
    try:
        for callee, result in record.calls:
            library.add_linking_library(_lowered_again(callee, result))
    except (_Changed, errors.NumbaError):
        return None
    finally:
        _being_taken.discard(called)
    library.modules += record.modules
    library.finalize()
    description = funcdesc.FunctionDescriptor(
        native=True, modname=called.name[0], qualname=called.name[1], unique_name=record.symbol, doc="", typemap=None,
        restype=record.result, calltypes=None, args=record.parameters, kws=(),
        mangler=lambda *_types, **_tags: record.symbol, argtypes=called.arguments,
        inline=bool(dict(called.options)["forceinline"]), env_name=record.environment,
    )
    library.kept_as, library.description = (called, str(record.result)), description
    return compiler.compile_result(
        target_context=context, library=library, fndesc=description, objectmode=False,
        entry_point=context.get_executable(library, description, None),
        signature=typing.signature(record.result, *called.arguments),
    )


def _lowered_again(called: kept_lowered.Called, result: str) -> _Library:
    """The library of a kernel called by a kept kernel. Raises _Changed, or numba's errors."""
    known = _dispatcher_of(called)
    if known is not None:
        known.compile(typing.signature(called.asked, *called.arguments) if called.asked else called.arguments)
        compiled = known.overloads[called.arguments]
    else:  # of Numba's own, which are there once they are asked for
        compiled = _taken(called)
    if compiled is None or str(compiled.signature.return_type) != result:
        raise _Changed
    return compiled.library


def _dispatcher_of(called: kept_lowered.Called) -> KernelDispatcher | None:
    """The package's kernel of this name; None for an unknown name, and for Numba's own functions."""
    candidates = _dispatchers.get(called.name[:2], ())
    return next((known for known in candidates if known.full_name == called.name), None)


@cache
def _own_hash(called: kept_lowered.Called) -> str:
    """Hash of a kernel's own source, its callees left out, and of the compilers' versions. Values held by a closure are
    in its name."""
    known = _dispatcher_of(called)
    code_hash = sources.of_own_code(known.py_func) if known is not None else sources.of_compiler()
    return f"{code_hash}, {sources.compiler_versions()}"


def _made_as(function: Callable) -> str:
    """What tells a function from others of its module and name: those of a module's own level are the only ones."""
    if function.__module__.startswith("collide.") and sources.is_defined_in_module(function):
        return ""
    return hashlib.sha256(sources.values_held(function).encode()).hexdigest()[:16]


#: Where lowered kernels are kept; nowhere, unless somebody asks for it.
_folder: Path | None = None
_being_taken: set[kept_lowered.Called] = set()
#: All kernels, by their modules and names.
_dispatchers: dict[tuple[str, str], list[KernelDispatcher]] = {}


def keep_lowered(folder: Path) -> None:
    """From now on, keep lowered kernels in a folder, and take from there what is still right."""
    global _folder
    folder.mkdir(parents=True, exist_ok=True)
    _folder = folder


#: Kernels on rarely taken paths, by their modules and names.
_cold: set[tuple[str, str]] = set()


def dispatcher(function: Callable, *, inline: bool = False, cold: bool = False) -> KernelDispatcher:
    """A kernel, as `collide.kernels.kernel` makes it."""
    if cold:
        _cold.add((function.__module__, function.__qualname__))
    options = {**_FLAGS, "forceinline": inline}
    made = KernelDispatcher(function, targetoptions=options, pipeline_class=_Compiler)
    if function.__module__.startswith("collide."):
        _dispatchers.setdefault((function.__module__, function.__qualname__), []).append(made)
    return made


@cache
def _of_instructions(function: Callable) -> KernelDispatcher:
    return dispatcher(function)


def _of_numba(*args, **options):
    """Numba's own functions, where it has them in Python, compiled for kernels like kernels."""
    if args:
        return dispatcher(args[0])
    return lambda function: dispatcher(function, inline=bool(options.get("forceinline")))


target_registry[TARGET] = Kernels
jit_registry[Kernels] = _of_numba
dispatcher_registry[Kernels] = KernelDispatcher


class Lowered:
    """The code of entries and of the kernels called from them, each kernel once.

    apart : module and name of kernels with object files of their own, "collide.narrowphase.gjk.gjk.gjk" say.
        A call to such a kernel calls a function defined elsewhere.
    """

    def __init__(self, apart: frozenset[str] = frozenset()) -> None:
        self.names: list[str] = []
        self.modules: list[bytes] = []
        #: Kernels that stand apart and are called here, and the names of their C functions.
        self.outside: dict[str, _Library] = {}
        self._apart = apart
        self._known: set = set()

    def add(self, name: str, function: Callable, signature: str) -> None:
        """Lower an entry, and those of its callees not lowered yet. In LLVM's code the entry is a C function of this
        name.

        Raises numba's errors for a function outside the subset of kernels.
        """
        made = dispatcher(function)
        with target_override(TARGET), global_compiler_lock:
            made.targetctx.refresh()  # LLVM numbers kinds of metadata as it meets them: Numba's own first, always
            made.compile(signature)
        (compiled,) = made.overloads.values()
        self.names.append(name)
        self.modules.append(_c_function(name, compiled, made.targetctx))
        self._add_code(compiled.library)

    def add_apart(self, name: str, library: _Library) -> None:
        """Add a kernel with an object file of its own, under its name in `outside`."""
        self.names.append(name)
        self.modules.append(_apart_function(name, library.description, defined=True))
        self._add_code(library)

    def _add_code(self, root: _Library) -> None:
        waiting = [root]
        while waiting:
            library = waiting.pop()
            if library.kept_as in self._known:
                continue
            self._known.add(library.kept_as)
            if library is not root and self._stands_apart(library):
                name = _name_apart(library)
                self.outside[name] = library
                self.modules.append(_apart_function(name, library.description, defined=False))
            else:
                self.modules += library.modules
                waiting += reversed(library.called)

    def _stands_apart(self, library: _Library) -> bool:
        return f"{library.description.modname}.{library.description.qualname}" in self._apart


def _name_apart(library: _Library) -> str:
    symbol = library.description.mangled_name
    return f"{library.description.qualname.split('.')[-1]}_{hashlib.sha256(symbol.encode()).hexdigest()[:12]}"


def _apart_function(name: str, description: funcdesc.FunctionDescriptor, *, defined: bool) -> bytes:
    """Bitcode of a bridge. defined : a function without a status, calling a kernel in its own object file; else the
    kernel's function with status 0, calling the function without: an object file with a status that may be an error was
    refused."""
    context = KernelDispatcher.targetdescr.target_context
    module = ir.Module(name, context=ir.Context())
    module.triple = llvm.get_process_triple()
    kind = context.call_conv.get_function_type(description.restype, description.argtypes)
    result_at, raised_at, *arguments = kind.args
    native = ir.Function(module, kind, description.mangled_name)
    bare = ir.Function(module, ir.FunctionType(ir.VoidType(), [result_at, *arguments]), name)
    bare.attributes.add("nounwind")
    if (description.modname, description.qualname) in _cold:
        bare.attributes.add("cold")
    made = bare if defined else native
    builder = ir.IRBuilder(made.append_basic_block("entry"))
    if defined:
        raised = cgutils.alloca_once(builder, raised_at.pointee)
        status = builder.call(native, [made.args[0], raised, *made.args[1:]])
        with builder.if_then(builder.icmp_signed("!=", status, ir.Constant(status.type, 0)), likely=False):
            builder.call(ir.Function(module, ir.FunctionType(ir.VoidType(), []), FAILED), [])
        builder.ret_void()
    else:
        made.attributes.add("alwaysinline")
        builder.call(bare, [made.args[0], *made.args[2:]])
        builder.ret(ir.Constant(kind.return_type, 0))
    return llvm.parse_assembly(str(module)).as_bitcode()


def c_function_type(context, arguments: tuple, result: types.Type) -> ir.FunctionType:
    """LLVM's type of an entry as a C function: booleans are bytes."""
    kinds = [context.get_data_type(kind) for kind in arguments]
    return ir.FunctionType(ir.VoidType() if result == types.none else context.get_data_type(result), kinds)


def _c_function(name: str, compiled, context) -> bytes:
    """Bitcode of a C function calling an entry; an error in the entry's status ends in `FAILED`."""
    description = compiled.fndesc
    arguments, result = description.argtypes, description.restype
    module = ir.Module(name, context=ir.Context())  # without types that others defined before
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
    """A kernel ``call(address, arguments)``: runs the entry of this signature at the address."""
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
