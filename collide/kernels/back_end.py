"""LLVM's code of entries to machine code: all in a single module, optimised once, for a processor or a level of
processors.

A single module lets entries share their kernels, and shows the compiler all calls of each kernel. Numba's own two
rounds of passes follow each other in Numba's order: the first makes functions small and simple before they are inlined.
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


def machine_code(
    names: Iterable[str], modules: Iterable[bytes], target: Target, prefix: str = "", outside: Iterable[str] = ()
) -> bytes:
    """An object file of C functions of these names, with a prefix if given; all other symbols are internal.

    modules : bitcode, as `front_end.Lowered` has it.   outside : C functions of other object files called by the code.
    Raises BackEndError where a kernel may raise, or needs a function of Python's.
    """
    machine = target.machine()
    whole = _linked(modules, target, machine)
    for name in (*names, *(outside := {*outside})):
        entry = whole.get_function(name)
        entry.name = prefix + name
        if target.position_independent:
            entry.visibility = "hidden"  # for the library's own modules
    _keep_inside(whole, {prefix + name for name in names})
    _optimise(whole, machine)
    _check(whole, {prefix + name for name in names}, {prefix + name for name in outside})
    return machine.emit_object(whole)


def _linked(modules: Iterable[bytes], target: Target, machine) -> llvm.ModuleRef:
    parsed = []
    for code in modules:
        parsed.append(module := llvm.parse_bitcode(code))
        module.triple, module.data_layout = target.triple or llvm.get_process_triple(), str(machine.target_data)
        if target.function_passes:
            _simplify(module, machine)
    while len(parsed) > 1:  # eight by eight: the time to take in a module is that of what it is taken into
        for first in (groups := [parsed[k : k + 8] for k in range(0, len(parsed), 8)]):
            for module in first[1:]:
                first[0].link_in(module)
        parsed = [group[0] for group in groups]
    (whole,) = parsed
    whole.name = "collide"
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


def _check(whole, names: set[str], outside: set[str]) -> None:
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
    if strange := called - MAY_BE_UNDEFINED - outside:
        raise BackEndError(f"not to be had without Python: {', '.join(sorted(strange))}")


def _callers(whole, name: str) -> list[str]:
    return [
        function.name for function in whole.functions
        for block in function.blocks for instruction in block.instructions if f"@{name}(" in str(instruction)
    ]
