"""First calls from several threads: kernels are compiled or loaded while other threads use numba, or ask for the first time.

Each test forces the order that was met by chance, in a process of its own: what it is about ended in a crash.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import collide
from collide.kernels import PLAIN_PYTHON

pytestmark = pytest.mark.skipif(PLAIN_PYTHON, reason="nothing is compiled")


def run(code: str, tmp_path, *arguments: str, cache: str | None = None) -> str:
    """What a process says that runs this code from a file; it must end well. cache : a folder of its own for kernels."""
    script = tmp_path / "child.py"
    script.write_text(code)
    environment = {**os.environ, "PYTHONPATH": str(Path(collide.__file__).parent.parent)}
    if cache is not None:
        environment["COLLIDE_CACHE_DIR"] = str(tmp_path / cache)
    child = subprocess.run(
        [sys.executable, script, *arguments], env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert child.returncode == 0, (child.returncode, child.stdout, child.stderr[-3000:])
    return child.stdout


#: While an entry is compiled or loaded in one thread, another calls a function of its own for the first time: it has
#: come as far as numba's lock when the first goes on.
BESIDE = """
import sys, threading
import numba
import numpy as np
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
import collide._lean_compile as lean
from collide import _jit

@_jit.entry("float64(float64)")
def doubled(x):
    return 2.0 * x

@numba.njit
def mine(numbers):
    return numbers[-1]

@numba.njit
def afterwards(numbers):
    return numbers[-2]

def parts():
    return [
        vars(owner)[name]
        for owner, name, _ in lean._translated_once("x", True) + lean._without_idle_work() + lean._silent_events()
    ]

inside, waiting, seen = threading.Event(), threading.Event(), []
numbers, numbas_own, lock = np.arange(3.0), parts(), type(global_compiler_lock)
acquire, post_lowering, rebuild = lock.acquire, CPUContext.post_lowering, CompileResult._rebuild

def meet():
    if threading.current_thread() is compiling and not inside.is_set():
        inside.set()
        seen.append(parts() != numbas_own)
        assert waiting.wait(60), "the other thread never asked for numba's lock"

def met_in_compiling(self, module, library):
    meet()
    return post_lowering(self, module, library)

def met_in_loading(*given):
    meet()
    return rebuild(*given)

def acquired(self):
    if threading.current_thread() is other:
        waiting.set()
    return acquire(self)

CPUContext.post_lowering, CompileResult._rebuild, lock.acquire = met_in_compiling, met_in_loading, acquired
compiling = threading.Thread(target=lambda: seen.append(doubled(1.5)))
other = threading.Thread(target=lambda: (inside.wait(60), seen.append(mine(numbers))))
compiling.start(), other.start(), compiling.join(), other.join()
CPUContext.post_lowering, CompileResult._rebuild, lock.acquire = post_lowering, rebuild, acquire
assert parts() == numbas_own, "collide's parts have stayed in numba"
assert afterwards(numbers) == 1.0 and doubled(2.0) == 4.0
(hits,) = {sum(doubled.ready.stats.cache_hits.values())}
print(seen[0], sorted(seen[1:]), "loaded" if hits else "compiled")
"""


def test_another_thread_may_compile_its_own_meanwhile(tmp_path):
    """It put our parts of numba back for good when it was done: every function after that jumped to address 0."""
    assert run(BESIDE, tmp_path, cache="kernels") == "True [2.0, 3.0] compiled\n"
    assert run(BESIDE, tmp_path, cache="kernels") == "True [2.0, 3.0] loaded\n"


#: Ctrl-C, or its like, at any moment of putting parts of our own into numba and numba's back.
INTERRUPTED = """
import gc, signal, sys
import numpy as np
import collide._lean_compile as lean
from collide import _jit

def parts():
    return [
        vars(owner)[name]
        for owner, name, _ in lean._translated_once("x", True) + lean._without_idle_work() + lean._silent_events()
    ]

@_jit.kernel
def some(x):
    return x

def stop(_number, _frame):
    raise KeyboardInterrupt

def both():
    lean.compiled_lean(some, False, lambda: lean.compiled_lean(some, True, lambda: None))

before, thresholds, interrupted = parts(), gc.get_threshold(), 0
moments = np.random.default_rng(1).uniform(1e-6, float(sys.argv[1]), 4000).tolist()
signal.signal(signal.SIGALRM, stop)
for moment in moments:
    try:
        signal.setitimer(signal.ITIMER_REAL, moment)
        try:
            both()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    except KeyboardInterrupt:
        interrupted += 1
    assert parts() == before and gc.get_threshold() == thresholds and lean._numbas_own == [], moment
print(interrupted > 500)
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers that interrupt")
def test_interrupts_leave_numba_as_it_was(tmp_path):
    assert run(INTERRUPTED, tmp_path, "300e-6") == "True\n"


#: Two threads find no workspace for single calls, both make one, and the first goes on with its own.
AT_ONCE = """
import sys, threading
import numpy as np
import collide
from collide.narrowphase import run
from collide.narrowphase.triangles import single

mesh = collide.Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
module, name, shape = (single, "Workspace", mesh) if sys.argv[1] == "mesh" else (run, "_Workspace", collide.Sphere(1))
X, made, both, out = collide.pose((0.25, 0.5, 0)), [], threading.Barrier(2, timeout=200), [None] * 2
Workspace = getattr(module, name)

class Met(Workspace):
    def __init__(self, *given):
        super().__init__(*given)
        if type(sys._getframe(1).f_locals.get("self")).__name__ != "_OfThread":  # one of each thread: no matter here
            made.append(id(self))
            both.wait()

setattr(module, name, Met)

def ask(k):
    other = collide.Box((1 + k, 1, 1))
    for _ in range(300):
        gap = collide.distance(shape, other, np.eye(4), X + (k + 3) * np.eye(4, k=3)).lower
        out[k] = collide.collide(shape, other, np.eye(4), X), gap > 0.5
        [np.full(n, np.nan) for n in (64, 512, 4096, 20000, 100000)]  # takes the place of what was let go of

threads = [threading.Thread(target=ask, args=(k,)) for k in range(2)]
[t.start() for t in threads], [t.join() for t in threads]
print(len(made), out)
"""


@pytest.mark.parametrize("kind", ["convex", "mesh"])
def test_two_threads_may_make_the_workspace_of_single_calls_at_once(tmp_path, kind):
    """The second one's took the place of the first one's, whose memory kernels were still given."""
    assert run(AT_ONCE, tmp_path, kind) == "2 [(True, True), (True, True)]\n"
