"""What makes machine code of kernels: the same bytes every time, and nothing that could fail unseen or would need
Python."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from collide.kernels import WITH_NUMBA, address_of, kernel, view_f64, view_i64

pytestmark = [pytest.mark.own_kernels]
NATIVE = Path(__file__).resolve().parents[2] / "native"

if WITH_NUMBA:
    from collide.kernels.back_end import BackEndError, Target, host, machine_code
    from collide.kernels.front_end import Lowered


def _compiled(function, signature: str = "int64(int64, int64)") -> bytes:
    code = Lowered()
    code.add("entry", function, signature)
    return machine_code(code.names, code.modules, host())


def test_an_entry_that_may_raise_is_refused():
    """Nobody looks at an entry's status: where it could be an error, the answer would be a silent 0."""

    def one_of_a_tuple(a, b):
        return (a, b, a + b)[view_i64(a, 1)[0]]

    def raises(a, b):
        if a > b:
            raise ValueError
        return a

    def through_a_kernel(a, b):
        return _raising(a) + b

    for function in (one_of_a_tuple, raises, through_a_kernel):
        with pytest.raises(BackEndError, match="a kernel may raise, and nobody would see it: called by entry"):
            _compiled(function)


@kernel
def _raising(a):
    if a == 3:
        raise ValueError
    return a


def test_what_cannot_raise_is_no_entry_that_may():
    def divides(a, b):
        return a // b + a % b

    def loops(a, b):
        total = 0
        for k in range(0, a, 3):
            total += view_i64(b, a)[k]
        return total

    for function in (divides, loops):
        assert len(_compiled(function)) > 100


def test_what_needs_python_is_refused():
    def random(a, b):
        return int(np.random.random() * a) + b

    with pytest.raises(BackEndError, match="not to be had without Python: numba_"):
        _compiled(random)


_CODE = """
import hashlib, sys
from collide.kernels.back_end import Target, machine_code
from collide.kernels.front_end import Lowered
from collide.narrowphase.finish_rows import finish_rows
from collide.hull.quickhull import quickhull
code = Lowered()
for entry in (finish_rows, quickhull):
    code.add(entry.__name__, entry.function, entry.signature)
for cpu in ("x86-64-v2", "x86-64-v3") if "x86" in __import__("platform").machine() else ("generic",):
    print(hashlib.sha256(machine_code(code.names, code.modules, Target(cpu), prefix="p_")).hexdigest())
"""


@pytest.mark.slow
def test_kernels_compile_to_the_same_bytes():
    """Whatever order Python's sets have in a process."""
    told = []
    for seed in ("1", "2"):
        environment = {**os.environ, "COLLIDE_JIT": "1", "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", _CODE], env=environment, capture_output=True, text=True, check=False, timeout=300
        )
        assert done.returncode == 0, done.stderr
        told.append(done.stdout)
    assert told[0] == told[1] and told[0]


def test_other_platforms_are_emitted_too():
    """Linked and run nowhere here; an object file of the right kind comes out."""

    def adds(a, b):
        return a + b

    code = Lowered()
    code.add("entry", adds, "int64(int64, int64)")
    heads = {
        "aarch64-unknown-linux-gnu": b"\x7fELF", "arm64-apple-macosx11.0": b"\xcf\xfa\xed\xfe",
        "x86_64-pc-windows-msvc": b"\x64\x86",
    }
    for triple, head in heads.items():
        cpu = "x86-64-v2" if triple.startswith("x86") else "generic" if "linux" in triple else "apple-m1"
        assert machine_code(code.names, code.modules, Target(cpu, triple=triple)).startswith(head), triple


def test_a_view_reads_where_it_is_told():
    """Below its beginning, too: no index counts from the end. Tests of compiled kernels rely on it nowhere else."""
    from collide.kernels import entry

    @entry("float64(int64, int64)")
    def one(at, k):
        return view_f64(at, 2)[k]

    numbers = np.array([1.0, 2.0, 3.0, 4.0])
    middle = address_of(numbers) + 16
    assert [one(middle, k) for k in (-2, -1, 0, 1)] == [1.0, 2.0, 3.0, 4.0]


def test_entries_of_one_name_are_refused(monkeypatch):
    sys.path.insert(0, str(NATIVE))
    try:
        import compile_kernels
    finally:
        sys.path.remove(str(NATIVE))
    from collide.kernels import jit

    monkeypatch.setattr(jit, "entries", [*jit.entries])
    compile_kernels._entries()

    def finish_rows(a, b):
        return a

    finish_rows.__module__ = "collide.somewhere_else"
    jit.entry("int64(int64, int64)")(finish_rows)
    compile_kernels._entries.cache_clear()
    with pytest.raises(SystemExit, match="two entries have one name: finish_rows"):
        compile_kernels._entries()


def test_no_contraction_of_products_and_sums():
    """a·b + c rounds twice: fused, (1 + 2⁻³⁰)² − (1 + 2⁻²⁹) would be 2⁻⁶⁰, not 0."""
    from collide.kernels import entry

    @entry("float64(float64, float64, float64)")
    def product_and_sum(a, b, c):
        return a * b + c

    a = 1.0 + 2.0**-30
    assert product_and_sum(a, a, -(1.0 + 2.0**-29)) == a * a - (1.0 + 2.0**-29) == 0.0
