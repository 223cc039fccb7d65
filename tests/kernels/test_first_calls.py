"""First calls: kernels are compiled or loaded while other threads use numba, are interrupted, or ask for the first
time as well.

Each test forces the order that was met by chance, in a process of its own: what it is about ended in a crash.
"""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path

import pytest
from installed_copy import PACKAGE, child, copied, environment

from collide.kernels import PLAIN_PYTHON

needs_signals = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers that interrupt")


def run(code: str, tmp_path: Path, *arguments: str, **more: str) -> str:
    """What a process says that runs this code from a file; it must end well."""
    script = tmp_path / "child.py"
    script.write_text(code, encoding="utf-8")
    done = child([str(script), *arguments], environment(PACKAGE.parent, **more))
    assert done.returncode == 0, (done.returncode, done.stdout, done.stderr[-3000:])
    return done.stdout


def run_just_in_time(code: str, tmp_path: Path, *arguments: str, cache: str = "kernels") -> str:
    return run(code, tmp_path, *arguments, COLLIDE_JIT="1", COLLIDE_CACHE_DIR=str(tmp_path / cache))


# --- kept on disk -----------------------------------------------------------------------------------

#: Asks for the bounding box of a hull with more points than are listed: the callee `support_vertex` stands in another
#: file. Tells how it came by its kernel.
BOX = """
import json, logging
import numpy as np
import collide
from collide.kernels import object_cache
from collide.broadphase.bounding_boxes import boxes_of
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import ShapeTable, pose_table

logging.basicConfig(level=logging.INFO, format="%(message)s")
packed, X = parts_of(collide.ConvexHull([(k, k * k, k**3) for k in range(20)]))[0]
poses = pose_table(np.eye(4)[None], X[None], np.array([packed.reach]))
print(boxes_of(ShapeTable([packed]), poses.rows, np.zeros(1, dtype=np.int64)).round(6).tolist())
"""


@pytest.mark.own_kernels
def test_kernels_are_kept_until_a_source_of_theirs_is_edited(tmp_path):
    site = copied(tmp_path / "site")
    env = environment(site, COLLIDE_JIT="1", COLLIDE_CACHE_DIR=str(tmp_path / "cache"))

    def ask(compiled: bool) -> str:
        done = child(["-c", BOX], env)
        assert done.returncode == 0, done.stderr[-3000:]
        assert ("compiling kernel bounding_boxes" in done.stderr) == compiled, done.stderr
        assert bool(re.search(r"compiled at their first call \(COLLIDE_JIT is set\)", done.stderr)) == compiled
        return done.stdout.strip()

    def kept() -> dict[str, int]:
        return {file.name: file.stat().st_mtime_ns for file in (tmp_path / "cache" / "kernels").iterdir()}

    right = "[[-0.0, -0.0, -0.0, 19.0, 361.0, 6859.0]]"
    assert ask(compiled=True) == right
    files = kept()
    entries = {re.fullmatch(r"collide\.(.*)\.[0-9a-f]{16}\.o", name)[1] for name in files}
    assert entries == {"broadphase.bounding_boxes.bounding_boxes", "support.point_columns.lay_out_points"}
    assert ask(compiled=False) == right and kept() == files
    world = site / "collide" / "worlds" / "world.py"
    world.write_text(world.read_text(encoding="utf-8") + "\n# a remark\n", encoding="utf-8")
    assert ask(compiled=False) == right and kept() == files

    callee = site / "collide" / "support" / "support_mapping.py"
    source = callee.read_text(encoding="utf-8")
    assert source.count("    return k\n") == 1
    callee.write_text(source.replace("    return k\n", "    return 0\n"), encoding="utf-8")
    assert ask(compiled=True) == "[[-0.0, -0.0, -0.0, 0.0, 0.0, 0.0]]", "an answer of the old source"
    assert files.items() < kept().items()
    callee.write_text(source, encoding="utf-8")
    assert ask(compiled=False) == right


# --- numba in the same process ----------------------------------------------------------------------

#: Whatever stands in numba's classes and modules that kernels are compiled with; and kernels, numba's functions.
NUMBAS = """
import gc, importlib, os, signal, sys, threading
import numba
import numpy as np

MODULES = [
    importlib.import_module(f"numba.core.{name}")
    for name in ("codegen", "cpu", "dispatcher", "typing.context", "compiler", "base", "lowering")
]

def parts():
    found = {}
    for module in MODULES:
        for name, value in vars(module).items():
            found[module.__name__, name] = value
            if isinstance(value, type) and value.__module__ == module.__name__:
                found.update({(module.__name__, name, attribute): part for attribute, part in vars(value).items()})
    return found

def changed(before):
    now = parts()
    return sorted(str(key) for key in before.keys() | now.keys() if before.get(key) is not now.get(key))

def numbas_own():
    '''A function of somebody's, with what numba writes in Python and in LLVM's code.'''
    @numba.njit
    def last_of_sorted(numbers, i):
        return np.sort(numbers)[i] + np.sum(numbers) * np.ones(3)[i]
    return last_of_sorted

def is_sound():
    '''Numba compiles, indices count from the end, and kernels can be compiled.'''
    assert numbas_own()(np.array([5.0, 1.0, 3.0]), -1) == 14.0
    return True

numbas_own()(np.ones(3), 0)  # what numba itself makes at its first use
before, thresholds = parts(), gc.get_threshold()
assert len(before) > 700, len(before)
from collide.kernels import address_of, entry, front_end, jit, kernel, object_cache, view_f64

@kernel
def twice(x):
    return 2.0 * x

@entry("float64(float64, int64)")
def power(x, n):
    '''x to the power 2ⁿ, doubled.'''
    for _ in range(n):
        x = x * x
    return twice(max(x, 0.0))

@entry("float64(int64, int64, int64)")
def element(at, n, i):
    return view_f64(at, n)[i]

@entry("float64(float64)")
def wrong(x):
    return nobody_knows_this(x)
"""

COMPILES = (
    NUMBAS
    + """
assert power(3.0, 2) == 162.0
numbers = np.arange(10.0)
assert element(address_of(numbers) + 40, 3, -1) == 4.0, "kernels count no index from the end"
for _ in range(2):
    try:
        wrong(1.0)
    except Exception as error:
        assert "nobody_knows_this" in str(error), error
    else:
        raise AssertionError("compiled what is not there")
assert is_sound() and gc.get_threshold() == thresholds
print(changed(before))
"""
)


@pytest.mark.own_kernels
def test_nothing_of_numba_is_changed(tmp_path):
    assert run_just_in_time(COMPILES, tmp_path) == "[]\n"


#: Two threads ask an entry for the first time: the second has come as far as it can when the first goes on.
ONCE = (
    NUMBAS
    + """
asking, compiled = threading.Event(), []
made, machine_code = jit.Entry._made, jit.machine_code

def met_in_asking(self):
    if threading.current_thread() is second:
        asking.set()
    return made(self)

def met_in_compiling(*given, **named):
    compiled.append(given[0])
    if not second.is_alive():
        second.start()
    assert asking.wait(60)
    return machine_code(*given, **named)

jit.Entry._made, jit.machine_code = met_in_asking, met_in_compiling
answers, out = [], []
first = threading.Thread(target=lambda: answers.append(power(3.0, 2)))
second = threading.Thread(target=lambda: answers.append(power(2.0, 1)))
first.start(), first.join(), second.join()
print(sorted(answers), compiled)
"""
)


@pytest.mark.own_kernels
def test_two_first_calls_compile_once(tmp_path):
    assert run_just_in_time(ONCE, tmp_path) == "[8.0, 162.0] [['power']]\n"


#: While an entry is compiled or loaded in one thread, another calls functions of its own for the first time. In
#: numba's part it comes as far as numba's lock, elsewhere to the end.
BESIDE = (
    NUMBAS
    + """
from numba.core.compiler_lock import global_compiler_lock

inside, waiting, seen = threading.Event(), threading.Event(), []
owner, name = {
    "lowering": (front_end._Context, "post_lowering"), "machine code": (jit, "machine_code"),
    "loading": (object_cache, "_read_kept"),
}[sys.argv[1]]
kept, acquire, mine = getattr(owner, name), type(global_compiler_lock).acquire, numbas_own()

def met(*given, **named):
    if threading.current_thread() is compiling and not inside.is_set():
        inside.set()
        assert waiting.wait(100), "the other thread never came"
    return kept(*given, **named)

def acquired(self):
    if threading.current_thread() is other and sys.argv[1] == "lowering":
        waiting.set()
    return acquire(self)

def ask():
    inside.wait(60)
    seen.append(mine(np.array([5.0, 1.0, 3.0]), -1))
    waiting.set()

setattr(owner, name, met)
type(global_compiler_lock).acquire = acquired
compiling = threading.Thread(target=lambda: seen.append(power(3.0, 2)))
other = threading.Thread(target=ask)
compiling.start(), other.start(), compiling.join(), other.join()
setattr(owner, name, kept)
type(global_compiler_lock).acquire = acquire
assert inside.is_set() and is_sound() and power(2.0, 1) == 8.0
print(sorted(seen), changed(before))
"""
)


@pytest.mark.slow
@pytest.mark.own_kernels
@pytest.mark.parametrize("where", ["lowering", "machine code", "loading"])
def test_another_thread_may_compile_its_own_meanwhile(tmp_path, where):
    """It put parts of ours into numba for good when it was done: every function after that jumped to address 0."""
    assert run_just_in_time(BESIDE, tmp_path, where) == "[14.0, 162.0] []\n"


#: A signal's handler asks an entry, and a function of somebody else's, while another entry is compiled.
NESTED = (
    NUMBAS
    + """
went_on, meanwhile = front_end._Context.post_lowering, []

def handle(_number, _frame):
    meanwhile.extend([power(3.0, 2), numbas_own()(np.array([5.0, 1.0, 3.0]), -1)])

def interrupted(self, module, library):
    front_end._Context.post_lowering = went_on
    signal.pthread_kill(threading.main_thread().ident, signal.SIGALRM)
    return went_on(self, module, library)

signal.signal(signal.SIGALRM, handle)
front_end._Context.post_lowering = interrupted
numbers = np.arange(3.0)
assert element(address_of(numbers), 3, 2) == 2.0
assert is_sound()
print(meanwhile, power(3.0, 2), changed(before))
"""
)


@pytest.mark.slow
@pytest.mark.own_kernels
@needs_signals
def test_what_handlers_of_signals_compile_meanwhile_is_compiled_as_well(tmp_path):
    assert run_just_in_time(NESTED, tmp_path) == "[162.0, 14.0] 162.0 []\n"


#: Ctrl-C, or its like, at any moment of compiling, or just when LLVM's lock has been taken.
INTERRUPTED = (
    NUMBAS
    + """
import time
from numba.core import event

start_event, at_the_lock = event.start_event, []

def interrupting(kind, data=None):
    if kind == "numba:llvm_lock" and at_the_lock:
        at_the_lock.clear()
        signal.pthread_kill(threading.main_thread().ident, signal.SIGALRM)
    return start_event(kind, data)

event.start_event = interrupting

def entry_of(k):
    @entry("float64(float64, int64)")
    def of_its_own(x, n):
        for _ in range(n):
            x = twice(x) + k
        return x
    return of_its_own

def stop(_number, _frame):
    raise KeyboardInterrupt

def timed(k):
    started = time.perf_counter()
    assert entry_of(k)(1.0, 2) == 4.0 + 3 * k
    return time.perf_counter() - started

timed(-1), timed(-2)
usual = timed(-3)
signal.signal(signal.SIGALRM, stop)
rng, interrupted = np.random.default_rng(1), 0
for k in range(60):
    asked = entry_of(k)
    try:
        if sys.argv[1] == "at the lock":
            at_the_lock.append(k)
        else:
            signal.setitimer(signal.ITIMER_REAL, rng.uniform(1e-5, 0.9 * usual))
        try:
            asked(1.0, 2)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    except KeyboardInterrupt:
        interrupted += 1
    answers = []
    thread = threading.Thread(target=lambda: answers.append(asked(1.0, 2)), daemon=True)
    thread.start(), thread.join(30)
    if answers != [4.0 + 3 * k] or asked(2.0, 2) != 8.0 + 3 * k:
        print("not sound after interrupt", k, answers, flush=True)
        os._exit(1)  # other threads may wait for ever
assert is_sound() and gc.get_threshold() == thresholds
print(interrupted >= 20, changed(before))
"""
)


@pytest.mark.slow
@pytest.mark.own_kernels
@needs_signals
@pytest.mark.parametrize("when", ["at any moment", "at the lock"])
def test_interrupts_leave_all_sound(tmp_path, when):
    """Within LLVM's and Numba's own code they left locks held, and other threads waiting for ever."""
    assert run_just_in_time(INTERRUPTED, tmp_path, when) == "True []\n"


# --- workspaces of single calls ---------------------------------------------------------------------

#: Two threads find no workspace for single calls, both make one, and the first goes on with its own.
AT_ONCE = """
import sys, threading
import numpy as np
import collide
from collide.narrowphase.composite import composite as unions
from collide.narrowphase import convex_kernel_calls as run
from collide.narrowphase.facets import facet_kernel_calls

mesh = collide.Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
union = collide.Compound([(collide.Sphere(1), np.eye(4)), (collide.Sphere(0.5), np.eye(4))])
module, name, shape = {
    "convex": (run, "BlockWorkspace", collide.Sphere(1)), "union": (unions, "_SingleSpace", union),
    "mesh": (facet_kernel_calls, "Workspace", mesh),
}[sys.argv[1]]
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


@pytest.mark.many(2)
@pytest.mark.skipif(PLAIN_PYTHON, reason="there are no single calls")
@pytest.mark.parametrize("kind", ["convex", "union", "mesh"])
def test_two_threads_may_make_the_workspace_of_single_calls_at_once(tmp_path, kind):
    """The second one's took the place of the first one's, whose memory kernels were still given."""
    jit = {} if os.environ.get("COLLIDE_JIT") is None else {"COLLIDE_JIT": os.environ["COLLIDE_JIT"]}
    assert run(AT_ONCE, tmp_path, kind, **jit) == "2 [(True, True), (True, True)]\n"
