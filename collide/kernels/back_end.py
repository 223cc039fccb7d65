"""LLVM's code of entries to machine code: all in one module, optimised once, for one processor or level of processors.

One module lets entries share the kernels that they call, and lets the compiler see all calls of each. Numba's own two
rounds of passes follow one another, as numba has them: the first makes functions small and simple before they are
inlined into each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import llvmlite.binding as llvm

#: What an entry calls where a kernel of it would raise, whose status nobody looks at; in a sound one it is optimised
#: away.
FAILED = "collide_kernel_failed"

#: Functions of Numba's that are the C library's, under names of its own.
_OF_C = {"numba_frexp": "frexp", "numba_ldexp": "ldexp"}
#: What objects may leave to whoever links them.
MAY_BE_UNDEFINED = {
    "frexp", "ldexp", "fma", "sqrt", "memset", "memcpy", "memmove", "__chkstk", "_fltused", "_GLOBAL_OFFSET_TABLE_",
}


class BackEndError(RuntimeError):
    """Kernels cannot become machine code that runs without Python."""


@dataclass(frozen=True)
class Target:
    """Whose machine code. Empty strings for the triple: of this machine."""

    cpu: str
    features: str = ""
    triple: str = ""
    #: Whether each function is simplified alone before they are put together: pays on some levels only.
    function_passes: bool = False
    #: Fit for a library at any place.
    position_independent: bool = True

    def machine(self) -> llvm.TargetMachine:
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        place = (
            {"reloc": "pic", "codemodel": "small"}
            if self.position_independent
            else {"reloc": "static", "codemodel": "jitdefault"}
        )
        target = llvm.Target.from_triple(self.triple or llvm.get_process_triple())
        return target.create_target_machine(cpu=self.cpu, features=self.features, opt=3, **place)


def host(position_independent: bool = True) -> Target:
    """This very processor."""
    return Target(
        llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten(), position_independent=position_independent
    )


def machine_code(names: Iterable[str], modules: Iterable[bytes], target: Target, prefix: str = "") -> bytes:
    """An object file of C functions of these names, with a prefix if so wished; all else in it is its own affair.

    modules : bitcode, as `front_end.Lowered` has it.
    Raises BackEndError where a kernel may raise, or needs what is not to be had without Python.
    """
    machine = target.machine()
    whole = _linked(modules, target, machine)
    for name in names:
        entry = whole.get_function(name)
        entry.name = prefix + name
        if target.position_independent:
            entry.visibility = "hidden"  # for the library's own modules
    _keep_inside(whole, {prefix + name for name in names})
    _optimise(whole, machine)
    _check(whole, {prefix + name for name in names})
    return machine.emit_object(whole)


def joined(modules: Iterable[bytes]) -> bytes:
    """All bitcode in one module's."""
    whole = llvm.parse_assembly("")
    whole.name = "collide"
    for code in modules:
        whole.link_in(llvm.parse_bitcode(code))
    return whole.as_bitcode()


def _linked(modules: Iterable[bytes], target: Target, machine) -> llvm.ModuleRef:
    whole = llvm.parse_assembly("")
    whole.name = "collide"
    whole.triple = target.triple or llvm.get_process_triple()
    whole.data_layout = str(machine.target_data)
    for code in modules:
        module = llvm.parse_bitcode(code)
        module.triple, module.data_layout = whole.triple, whole.data_layout
        if target.function_passes:
            _simplify(module, machine)
        whole.link_in(module)
    for kernel, name in _OF_C.items():
        if any(function.name == kernel for function in whole.functions):
            whole.get_function(kernel).name = name
    return whole


def _simplify(module, machine) -> None:
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    passes = builder.getFunctionPassManager()
    for function in module.functions:
        passes.run(function, builder)


def _keep_inside(whole, names: set[str]) -> None:
    for thing in (*whole.functions, *whole.global_variables):
        if not thing.is_declaration and thing.name not in names:
            thing.linkage = "internal"


def _optimise(whole, machine) -> None:
    options = llvm.create_pipeline_tuning_options(speed_level=0)
    options.loop_vectorization = options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    passes = builder.getModulePassManager()
    passes.add_loop_rotate_pass()
    passes.add_instruction_combine_pass()
    passes.add_jump_threading_pass()
    passes.run(whole, builder)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization, options.slp_vectorization = True, False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(whole, builder)


def _check(whole, names: set[str]) -> None:
    """Nothing missing, nothing undefined, no status that somebody would have to look at."""
    whole.verify()
    defined = {function.name for function in whole.functions if not function.is_declaration}
    if missing := names - defined:
        raise BackEndError(f"not in the machine code: {', '.join(sorted(missing))}")
    called = {
        function.name
        for function in whole.functions
        if function.is_declaration and not function.name.startswith("llvm.")
    }
    if FAILED in called:
        raise BackEndError(
            f"a kernel may raise, and nobody would see it: called by {', '.join(_callers(whole, FAILED))}"
        )
    if strange := called - MAY_BE_UNDEFINED:
        raise BackEndError(f"not to be had without Python: {', '.join(sorted(strange))}")


def _callers(whole, name: str) -> list[str]:
    return [
        function.name for function in whole.functions
        for block in function.blocks for instruction in block.instructions if f"@{name}(" in str(instruction)
    ]
