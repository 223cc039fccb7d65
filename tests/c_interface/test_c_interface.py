"""The C interface: its answers are Python's, bit by bit, in one thread and in four; what Python refuses it refuses.

Nothing here judges whether the answers are right: that is judged of Python's. Programs in C and C++ are built with
the system's compilers and run.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import c_library as c
import hull_families
import numpy as np
import pytest
import soak_pairs

import collide
from collide.casts.ray_hits import WORLD_HIT_DTYPE
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.kernels import mode
from collide.kernels.library import library_path
from collide.lowering.lazy_structures import may_have_tree, support_tree_of
from collide.lowering.parts import convex_set_of, parts_of
from collide.results import PAIR_DTYPE, flipped

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "c"
CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid",
)
STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic"]


def header_folder() -> Path:
    """Where collide.h lies: as installed, or in the checkout."""
    get_include = getattr(collide, "get_include", None)
    return Path(get_include()) if get_include else ROOT / "native"


def compiler(*names: str) -> str:
    found = next((name for name in names if shutil.which(name)), None)
    if found is None:
        pytest.skip(f"no compiler: none of {', '.join(names)} is there")
    return found


def run(*command, **options) -> str:
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False, timeout=300, **options
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def built(tmp_path: Path, text: str, *options: str) -> Path:
    """A program in C of this text, linked to the library."""
    source, program = tmp_path / "program.c", tmp_path / "program"
    source.write_text(text, encoding="utf-8")
    library = Path(library_path())
    run(
        compiler("cc", "gcc", "clang"), "-std=c99", *STRICT, *options, f"-I{header_folder()}", source, library,
        f"-Wl,-rpath,{library.parent}", "-lm", "-o", program,
    )
    return program


# --- the header and programs ------------------------------------------------------------------------------------------


def test_header_is_c99_and_cpp(tmp_path):
    for name, tool, standard in (("h.c", compiler("cc", "gcc"), "c99"), ("h.cpp", compiler("c++", "g++"), "c++11")):
        (tmp_path / name).write_text('#include "collide.h"\n#include "collide.h"\n', encoding="utf-8")
        run(tool, f"-std={standard}", *STRICT, "-fsyntax-only", f"-I{header_folder()}", tmp_path / name)


_ROWS = (
    ("collide_pair", PAIR_DTYPE), ("collide_contact", CONTACT_DTYPE), ("collide_world_hit", WORLD_HIT_DTYPE),
)


def test_rows_are_those_of_python(tmp_path):
    fields = ""
    for struct, dtype in _ROWS:
        for name in dtype.names:
            fields += f'    printf("{struct}.{name} %zu\\n", offsetof({struct}, {name}));\n'
        fields += f'    printf("{struct} %zu\\n", sizeof({struct}));\n'
    text = f'#include "collide.h"\n#include <stdio.h>\nint main(void) {{\n{fields}    return 0;\n}}\n'
    told = dict(line.split() for line in run(built(tmp_path, text)).splitlines())
    for struct, dtype in _ROWS:
        assert told.pop(struct) == str(dtype.itemsize)
        for name in dtype.names:
            assert told.pop(f"{struct}.{name}") == str(dtype.fields[name][1])
    assert not told


def test_version_is_that_of_the_package():
    assert c.library().collide_version().decode() == collide.__version__
    assert f'#define COLLIDE_VERSION "{collide.__version__}"' in (header_folder() / "collide.h").read_text(
        encoding="utf-8"
    )


def test_library_exports_its_headers_and_nothing_else():
    if not sys.platform.startswith("linux") or shutil.which("nm") is None:
        pytest.skip("nm of Linux tells the symbols")
    headers = "".join(
        (ROOT / "native" / name).read_text(encoding="utf-8")
        for name in ("collide.h", "kernels_of_level.h", "host_mujoco.h")
    )
    declared = re.findall(r"^COLLIDE_(?:API|EXPORT)\b[^;(]*?(\w+)\(", headers, re.MULTILINE)
    exported = [line.split()[-1] for line in run("nm", "-D", "--defined-only", library_path()).splitlines()]
    assert sorted(exported) == sorted(declared)
    assert set(c._TYPES) <= set(declared), "the tests call what the header does not have"


@pytest.mark.slow
def test_examples_are_built_by_make_and_run(tmp_path):
    """As a reader builds them, with nothing of Python's in the environment."""
    for tool in ("make", "pkg-config", "cc", "c++"):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool}")
    shutil.copytree(EXAMPLES, tmp_path / "c")
    library = Path(library_path())
    (tmp_path / "collide.pc").write_text(
        f"libdir={library.parent}\n\nName: collide\nDescription: collisions\nVersion: {collide.__version__}\n"
        f"Cflags: -I{header_folder()}\nLibs: -L${{libdir}} -lcollide\n", encoding="utf-8",
    )
    bare = {"PATH": os.environ["PATH"], "PKG_CONFIG_PATH": str(tmp_path)}
    flags = " ".join(STRICT)
    run("make", f"CFLAGS=-O2 {flags}", f"CXXFLAGS=-O2 {flags}", cwd=tmp_path / "c", env=bare)
    told = run(tmp_path / "c" / "two_shapes", env=bare)
    assert f"collide {collide.__version__}, kernels for " in told
    assert "x = 0.8 m: free" in told and "x = 0.7 m: they meet" in told and "a matrix is no pose" in told
    told = run(tmp_path / "c" / "resting", env=bare)
    assert "4 contacts, the normal is (0, 0, 1)" in told and told.count("gap 1.0000 mm") == 4
    assert "the first within the margin is 30, with a gap of 2.00 mm; 280 rows" in told
    told = run(tmp_path / "c" / "reaching", env=bare)
    assert "goes down 0.360 m, then part 1 touches" in told and "meets the table after 0.480 m" in told
    assert "arrives at 0.48 of its way" in told and "8 contacts, of parts 1 to 2, 0.5 mm apart" in told
    told = run(tmp_path / "c" / "point_cloud", env=bare)
    assert "cloud: met from z = 0.50 m on; from 1 m it is 0.4900 m away, item 5050" in told
    assert "voxels: met from z = 0.50 m on" in told and "101 points are within 0.2 m of it" in told
    told = run(tmp_path / "c" / "falling_boxes", env=bare)
    assert "5.00 s: 24 contacts, the top box is at 1.64" in told
    assert "at rest: yes; a stack of 6 boxes is 1.79" in told
    told = run(tmp_path / "c" / "threads", env=bare)
    assert "1838 of 4000 pairs meet" in told and "4000 answers of four threads are those of one" in told


def test_the_page_says_what_runs(tmp_path):
    (snippet,) = re.findall(
        r"```c\n(.*?)```", (ROOT / "docs" / "c-interface.md").read_text(encoding="utf-8"), flags=re.DOTALL
    )
    includes = "".join(f"#include <{name}>\n" for name in ("collide.h", "math.h", "stdio.h"))
    ending = '    printf("%.17g %d\\n", pair.distance, status);\n    return 0;\n'
    text = f"{includes}int main(void)\n{{\n{snippet}{ending}}}\n"
    assert run(built(tmp_path, text)).split() == ["1.25", "0"]


@pytest.mark.slow
def test_memory_that_runs_out_changes_no_world(tmp_path):
    """Each allocation of changes and of questions fails once: that is told, and the call can be made again."""
    if not sys.platform.startswith("linux"):
        pytest.skip("the program stands before the allocations of glibc")
    text = Path(__file__).with_name("failing_memory.c").read_text(encoding="utf-8")
    told = run(built(tmp_path, text))
    n = int(told.split()[0])
    assert n >= 60 and told == f"{n} allocations, 0 different, 0 untold\n", told


def test_rounding_of_the_caller_changes_nothing(tmp_path):
    """Rounding upwards, and small numbers flushed to 0 where the processor can."""
    told = run(built(tmp_path, _ROUNDING)).splitlines()
    assert len(told) == 3 and len(set(told)) == 1, told


_ROUNDING = r"""
#include "collide.h"
#include <fenv.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif
int main(void)
{
    double X[16] = {0.8, -0.6, 0, 0.1, 0.6, 0.8, 0, 0.7, 0, 0, 1, 0.3, 0, 0, 0, 1};
    double Y[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    double size[3] = {0.1, 0.3, 0.7}, radii[3] = {0.11, 0.13, 0.17}, points[3 * 300];
    int way, k;
    for (k = 0; k < 900; k++) points[k] = 0.2 * sin(k * k + 0.5);
    for (way = 0; way < 3; way++) {
        collide_shape *shapes[4] = {0, 0, 0, 0};
        collide_workspace *workspace = NULL;
        uint64_t sum = 0;
        int i, j, hit;
        if (way == 1) fesetround(FE_UPWARD);
#if defined(__x86_64__)
        if (way == 2) _mm_setcsr(_mm_getcsr() | 0x8040);
#endif
        if (collide_box(size, &shapes[0]) || collide_ellipsoid(radii, &shapes[1]) ||
            collide_cone(0.1, 0.3, &shapes[2]) ||
            collide_hull(points, 300, 0.01, &shapes[3]) || collide_workspace_create(&workspace))
            return 1;
        for (i = 0; i < 4; i++)
            for (j = 0; j < 4; j++)
                for (k = 0; k < 20; k++) {
                    collide_pair pair;
                    unsigned char bytes[sizeof pair];
                    size_t b;
                    Y[3] = k / 16.0; /* exact, however it rounds */
                    if (collide_distance(workspace, shapes[i], shapes[j], X, Y, INFINITY, 0, &pair)) return 2;
                    if (collide_collide(workspace, shapes[i], shapes[j], X, Y, 0, &hit)) return 3;
                    memcpy(bytes, &pair, sizeof pair);
                    for (b = 0; b < sizeof pair; b++) sum = sum * 1099511628211u + bytes[b];
                    sum += (uint64_t)hit;
                }
        if (way == 1 && fegetround() != FE_UPWARD) return 4; /* put back */
        fesetround(FE_TONEAREST);
        printf("%llu\n", (unsigned long long)sum);
        for (i = 0; i < 4; i++) collide_shape_free(shapes[i]);
        collide_workspace_free(workspace);
    }
    return 0;
}
"""


# --- the same bits --------------------------------------------------------------------------------


@functools.cache
def drawn() -> list[tuple[str, collide.Shape, collide.Shape, np.ndarray, np.ndarray]]:
    """Pairs of all kinds, sizes up to 1 : 10⁶, most of them near touching; (name, A, B, X_WA, X_WB)."""
    cases = [soak_pairs.draw(71, number, 1e6, CONVEX) for number in range(2000)]
    return [(f"draw(71, {k.number}): {k.kinds}, {k.poses}", k.A, k.B, k.X_WA, k.X_WB) for k in cases] + _touching()


def _touching() -> list:
    """Bodies that touch exactly, or miss or overlap by the smallest step a double has: for the exact stage."""
    random = np.random.default_rng(72)
    pairs = []
    for number in range(600):
        size = random.integers(1, 9, 3) * 2.0 ** random.integers(-3, 4)
        A, B = collide.Box(size), collide.Box(size[::-1] * float(random.choice([1.0, 0.5, 1e-5])))
        if number % 3 == 1:
            B = collide.ConvexHull(random.integers(-3, 4, (12, 3)) * 0.25, radius=float(random.choice([0.0, 0.5])))
        if number % 3 == 2:
            A = collide.Capsule(0.25, 1.0)
        reach = 0.5 * (_extent(A) + _extent(B))
        where = random.integers(-1, 2, 3) * reach
        axis = int(random.integers(3))
        where[axis] = reach[axis]
        where[axis] = [where[axis], np.nextafter(where[axis], 9e9), np.nextafter(where[axis], 0.0)][number % 4 % 3]
        pairs.append((f"touching {number}", A, B, np.eye(4), c.identity_at(*where)))
    for number in range(60):
        normal = 1.0 * random.integers(-3, 4, 3)
        normal[2] += 0.5
        scale = [-1.0, -2.5, -0.3][number % 3]
        A = collide.Halfspace(normal, random.normal())
        B = collide.Halfspace(scale * normal, -scale * A.offset * [1.0, 1 + 2e-16, -1.0][number % 4 % 3])
        X = soak_pairs.rotation(random)
        X[:3, 3] = random.normal(size=3) * 10.0 ** random.integers(-8, 9)
        pairs.append((f"opposite half-spaces {number}", A, B, X, X.copy()))
    return pairs


def _extent(shape) -> np.ndarray:
    if isinstance(shape, collide.Capsule):
        return 2 * shape.radius + np.array([0.0, 0.0, shape.length])
    return 2 * np.abs(convex_set_of(shape).points).max(axis=0) + 2 * convex_set_of(shape).radius


@functools.cache
def made() -> list[tuple]:
    return [(c.CShape(A), c.CShape(B)) for _, A, B, _, _ in drawn()]


@functools.cache
def answers() -> list[tuple]:
    """Python's (hit, row, gap's row) of each pair; the rows None where a depth has no end."""
    told = []
    for _, A, B, X_WA, X_WB in drawn():
        hit = collide.collide(A, B, X_WA, X_WB)
        try:
            row = collide.distance(A, B, X_WA, X_WB).rows
        except collide.UnsupportedQuery:
            row = None
        told.append((hit, row, collide.distance(A, B, X_WA, X_WB, signed=False).rows if row is not None else None))
    return told


def differences(asker, numbers) -> list[str]:
    """What single calls of C say differently."""
    wrong = []
    for k in numbers:
        name, _, _, X_WA, X_WB = drawn()[k]
        (A, B), (hit, row, gap) = made()[k], answers()[k]
        if asker.collide(A, B, X_WA, X_WB) != (c.OK, hit):
            wrong.append(f"{name}: boolean {asker.collide(A, B, X_WA, X_WB)}, Python {hit}")
        for flags, wanted in ((0, row), (c.UNSIGNED, gap)):
            status, found = asker.distance(A, B, X_WA, X_WB, flags)
            if wanted is None:
                wrong += [f"{name}: endless, status {status}"] if flags == 0 and status != c.ENDLESS_DEPTH else []
            elif status != c.OK or found.tobytes() != wanted.tobytes():
                wrong.append(f"{name}: flags {flags}, status {status}, C {found}, Python {wanted}")
    return wrong


def test_single_calls_have_pythons_bits():
    wrong = differences(c.Asker(), range(len(drawn())))
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"
    rows = np.concatenate([row for _, row, _ in answers() if row is not None])
    assert len(rows) >= 2000
    exact = int((rows["exact"] > 0).sum())
    assert exact >= 300, f"only {exact} of {len(rows)} pairs needed the exact stage"
    hits = int(rows["hit"].sum())
    assert 0.2 < hits / len(rows) < 0.8, f"{hits} of {len(rows)} hit"


def test_a_capsule_without_length_has_pythons_zeros():
    """At a pose with minus zeros, which shows the sign of a zero of its end."""
    A, B = collide.Capsule(1.25, 0.0), collide.Capsule(0.0045, 0.009)
    X_WA, minus_zeros = np.array([[0.0, 1, 0, 0], [-0.0, -0.0, -1, -0.0], [-1, -0.0, -0.0, -0.0], [0, 0, 0, 1]]), 0
    for z in np.linspace(-0.002, 0.001, 13):
        X_WB = c.identity_at(-0.0118, 0.0183, z)
        wanted = collide.distance(A, B, X_WA, X_WB).rows
        status, found = c.Asker().distance(c.CShape(A), c.CShape(B), X_WA, X_WB)
        assert status == c.OK and found.tobytes() == wanted.tobytes(), (z, found, wanted)
        minus_zeros += int((np.signbit(wanted["point_a"]) & (wanted["point_a"] == 0.0)).sum())
    assert minus_zeros >= 5


def test_four_threads_at_once_have_pythons_bits():
    many = len(drawn())
    made(), answers()  # here, not in a thread
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: differences(c.Asker(), range(many)), range(4)))
    wrong = [what for one in found for what in one]
    assert not wrong, f"{len(wrong)} differ, the first: {wrong[0]}"


def test_swapped_pairs_are_mirrored():
    """As Python's are: of two bodies that are one and the same there is no mirror."""
    asker, compared, mirrored = c.Asker(), 0, 0
    for (name, A, B, X_WA, X_WB), (own_a, own_b), (_, row, _) in zip(drawn(), made(), answers()):
        if row is None:
            continue
        status, found = asker.distance(own_b, own_a, X_WB, X_WA)
        wanted = collide.distance(B, A, X_WB, X_WA).rows
        assert status == c.OK and found.tobytes() == wanted.tobytes(), f"{name}: {found}, {wanted}"
        back = flipped(found)
        back["a"], back["b"] = 0, 1
        compared, mirrored = compared + 1, mirrored + (back.tobytes() == row.tobytes())
    assert compared >= 2000 and mirrored >= 0.98 * compared, f"{mirrored} of {compared} are mirrored"


def test_sets_and_limits_have_pythons_bits():
    """All pairs as one batch of a set: rows, gaps, rows within a limit, booleans with and without axes."""
    cases = [k for k, (_, row, _) in enumerate(answers()) if row is not None]
    shapes = c.CSet([shape for k in cases for shape in made()[k]])
    which = np.arange(2 * len(cases)).reshape(-1, 2)
    X_WA, X_WB = (np.stack([drawn()[k][at] for k in cases]) for at in (3, 4))
    A, B = ([drawn()[k][at] for k in cases] for at in (1, 2))
    asker = c.Asker()
    near, touching = {"max_distance": 0.01}, {"max_distance": 0.0, "signed": False}
    for flags, options in ((0, {}), (c.UNSIGNED, {"signed": False}), (0, near), (c.UNSIGNED, touching)):
        limit = options.get("max_distance", math.inf)
        status, rows, _ = asker.batch((shapes, which), X_WA, X_WB, boolean=False, flags=flags, limit=limit)
        wanted = collide.distance(A, B, X_WA, X_WB, **options).rows
        assert status == c.OK
        odd = [k for k in range(len(cases)) if rows[k].tobytes() != wanted[k].tobytes()]
        assert not odd, (
            f"{options}: {len(odd)} differ, the first: {drawn()[cases[odd[0]]][0]}: {rows[odd[0]]}, {wanted[odd[0]]}"
        )
        beyond = int(rows["beyond"].sum())
        assert beyond > 100 or "max_distance" not in options, f"{beyond} beyond the limit"
    hits = np.array([answers()[k][0] for k in cases])
    axes = np.zeros((len(cases), 3))
    for _ in range(3):
        status, found, _ = asker.batch((shapes, which), X_WA, X_WB, boolean=True, axes=axes)
        assert status == c.OK and np.array_equal(found, hits), np.flatnonzero(found != hits)
    assert (axes[~hits] != 0).any(axis=1).mean() > 0.5, "few axes were found"
    own = np.zeros((len(cases), 3))
    collide.collide(A, B, X_WA, X_WB, axes=own)
    for _ in range(2):
        collide.collide(A, B, X_WA, X_WB, axes=own)
    assert own.tobytes() == axes.tobytes()


@pytest.mark.parametrize("still", ["A", "B", "neither"])
def test_batches_of_a_pair_have_pythons_bits(still):
    random = np.random.default_rng(73)
    some = [k for k, (_, row, _) in enumerate(answers()) if row is not None][:: len(drawn()) // 40]
    asker, exact = c.Asker(), 0
    for k in [*some, *range(2000, 2600, 40)]:
        name, A, B, X_WA, X_WB = drawn()[k]
        steps = np.concatenate([[0.0], random.normal(size=199) * 10.0 ** random.uniform(-18, 1, 199)])
        moved = np.stack([X_WB] * 200)
        moved[:, int(random.integers(3)), 3] += steps
        others = X_WA if still == "A" else np.stack([X_WA] * 200)
        poses = (moved, others) if still == "B" else (others, moved)
        if still == "B":
            poses = moved, X_WA
        status, rows, _ = asker.batch(made()[k], *poses, boolean=False)
        wanted = collide.distance(A, B, *poses).rows
        assert status == c.OK and rows.tobytes() == wanted.tobytes(), name
        status, hits, _ = asker.batch(made()[k], *poses, boolean=True)
        assert status == c.OK and np.array_equal(hits, collide.collide(A, B, *poses)), name
        exact += int((rows["exact"] > 0).sum())
    assert exact >= 500, f"only {exact} needed the exact stage"


# --- large hulls, and polytopes of half-spaces ------------------------------------------------------------------------


def _tree_of(shape: c.CShape):
    """(integers of the header, arrays) of a shape's support tree, read where kernels read it; None where there is
    none."""
    address = (ctypes.c_int64 * 8).from_address(shape.handle)[7]
    if address == 0:
        return None
    header = np.ctypeslib.as_array((ctypes.c_int64 * 13).from_address(address))
    n, _, nodes, entries, links = header[:5].tolist()
    sizes = {5: 4 * (nodes + 1), 6: 4 * entries, 7: 24 * entries, 8: 4 * (n + 1), 9: 4 * links, 10: 24, 12: 24 * n}
    return [*header[:5].tolist(), int(header[11])], [
        ctypes.string_at(int(header[k]), size) for k, size in sizes.items()
    ]


def _clouds() -> dict[str, np.ndarray]:
    random = np.random.default_rng(74)
    angle = 2 * np.pi * np.arange(600) / 600
    disc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    found = {name: hull_families.HULLS[name]()[0] for name in hull_families.HULLS}
    found |= {
        "just large enough": random.normal(size=(224, 3)),
        "mostly inside": random.normal(size=(3000, 3)),
        "filled disc": np.concatenate([disc, 0.5 * disc]),
        "cone on a filled disc": np.concatenate([disc, 0.5 * disc, [[0, 0, 1.0]]]),
        "a segment": np.outer(np.arange(300), [1.0, 2.0, 3.0]),
        "one point": np.ones((300, 3)),
        "pancake of 1e-12": hull_families.ellipsoid(4000)[0] * [1, 1, 1e-12],
        "huge": hull_families.ellipsoid(700)[0] * 1e40,
        "tiny": hull_families.ellipsoid(700)[0] * 1e-40,
        "rounded": np.round(hull_families.ellipsoid(20000)[0] * 200.0),
        "negative zeros": -np.abs(np.round(random.normal(size=(400, 3)))) * [1.0, -0.0, 1.0],
    }
    return found


def test_support_trees_are_pythons():
    trees = 0
    for name, points in _clouds().items():
        shape = collide.ConvexHull(points)
        packed, found = convex_set_of(shape), _tree_of(c.CShape(shape))
        tree = support_tree_of(packed).tree if may_have_tree(packed) else None
        if tree is None:
            assert found is None, name
            continue
        trees += 1
        assert found is not None, name
        integers = [*tree.header[:5].tolist(), int(tree.flat)]
        arrays = [tree.nodes, tree.entries, tree.list_coordinates, tree.ring_starts, tree.ring, tree.range, tree.points]
        assert found == (integers, [array.tobytes() for array in arrays]), name
    assert trees >= 15, f"only {trees} hulls had a tree"


def test_large_hulls_have_pythons_bits():
    random = np.random.default_rng(75)
    shapes = [collide.ConvexHull(points, radius=0.0 if k % 3 else 0.25) for k, points in enumerate(_clouds().values())]
    shapes += [collide.Box(1, 2, 3), collide.Cylinder(0.5, 1.0), collide.Halfspace((0, 1, 1), 0.3), collide.Sphere(0.5)]
    both = [(shape, c.CShape(shape)) for shape in shapes]
    asker = c.Asker()
    for number in range(400):
        (A, own_a), (B, own_b) = (both[int(k)] for k in random.choice(len(both), 2))
        if isinstance(A, collide.Halfspace) and isinstance(B, collide.Halfspace):
            continue
        X_WA, X_WB = soak_pairs.rotation(random), soak_pairs.rotation(random)
        X_WB[:3, 3] = random.normal(size=3) * random.choice([0.5, 2.0, 10.0])
        if number % 4 == 0:
            X_WA, X_WB = np.eye(4), c.identity_at(*np.round(random.normal(size=3)))
        status, found = asker.distance(own_a, own_b, X_WA, X_WB)
        wanted = collide.distance(A, B, X_WA, X_WB).rows
        assert status == c.OK and found.tobytes() == wanted.tobytes(), (number, A, B, found, wanted)
        assert asker.collide(own_a, own_b, X_WA, X_WB) == (c.OK, collide.collide(A, B, X_WA, X_WB)), (number, A, B)


def _halfspaces(number: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng([76, number])
    m = int(random.integers(4, 30))
    normals = random.normal(size=(m, 3)) if number % 3 else random.integers(-2, 3, (m, 3)).astype(float)
    normals = normals[normals.any(axis=1)] if normals.any() else np.ones((1, 3))
    if number % 5 == 0:
        normals *= 10.0 ** random.integers(-20, 20, (len(normals), 1))
    offsets = np.abs(random.normal(size=len(normals))) * np.sqrt((normals**2).sum(axis=1))
    if number % 7 == 0:
        offsets = np.ceil(offsets)
    if number % 13 == 0:
        offsets -= 1.5
    return np.concatenate([normals, normals[:2]]), np.concatenate([offsets, offsets[:2]])


def test_polytopes_of_halfspaces_are_pythons():
    """Their digests are: of all vertices, in order; and whether there are any is decided alike."""
    refused = 0
    for number in range(200):
        normals, offsets = _halfspaces(number)
        try:
            packed = parts_of(collide.HPolytope(normals, offsets))[0][0]
        except collide.InvalidShape:
            packed = None
        status, handle = c.raw_shape("collide_hpolytope", normals, offsets, len(offsets))
        assert (status == c.OK) == (packed is not None), f"{number}: {c.library().collide_status_text(status)}"
        if packed is None:
            refused += 1
            assert status == c.INVALID_SHAPE and handle is None, number
            continue
        numbers = np.ctypeslib.as_array((ctypes.c_double * 3).from_address(handle + 72)).tolist()
        content = ctypes.string_at(handle + 72 + 56, 16)
        c.library().collide_shape_free(handle)
        assert numbers == [0.0, packed.reach, packed.slop] and content == packed.content, number
    assert 20 < refused < 180, refused


# --- what is refused ------------------------------------------------------------------------------

_INF, _NAN = math.inf, math.nan
#: (function, constructor in Python, arguments): numbers that make no shape, and some on the brink that do.
NUMBERS = [
    ("collide_sphere", collide.Sphere, radius) for radius in (0.0, -1.0, _NAN, _INF, 1e-51, 1e51, 1e-50, 1e50, 5e-324)
] + [
    (f"collide_{kind.__name__.lower()}", kind, pair) for kind in (collide.Capsule, collide.Cylinder, collide.Cone)
    for pair in ((1.0, 0.0), (0.0, 1.0), (1.0, -1.0), (_NAN, 1.0), (1.0, _INF), (1e-50, 1e50),
                 (1e50, 1e-51), (1.0, -0.0))
] + [
    (f"collide_{name}", kind, np.array(three)) for name,
    kind in (("box", collide.Box), ("ellipsoid", collide.Ellipsoid))
    for three in ((1.0, 1.0, 0.0), (1.0, _NAN, 1.0), (-1.0, 1.0, 1.0), (1e50, 1e-50, 1.0), (1e51, 1.0, 1.0))
] + [
    ("collide_halfspace", collide.Halfspace, (np.array(normal), offset)) for normal, offset in (
        ((0.0, 0.0, 0.0), 0.0), ((0.0, 0.0, 1e-7), 0.0), ((0.0, 0.0, 1e-6), 1e50), ((0.0, 0.0, 1e6), -1e50),
        ((0.0, 0.0, 1.1e6), 0.0),
        ((0.0, _NAN, 1.0), 0.0), ((0.0, 0.0, 1.0), _INF), ((0.0, 0.0, 1.0), 1e51), ((1e51, 0.0, 0.0), 0.0),
    )
]


def test_what_is_no_shape_is_refused_as_python_does():
    refused = 0
    for function, kind, given in NUMBERS:
        arguments = given if isinstance(given, tuple) else (given,)
        try:
            kind(*arguments)
            wanted = c.OK
        except collide.InvalidShape:
            wanted = c.INVALID_SHAPE
            refused += 1
        status, handle = c.raw_shape(function, *arguments)
        assert status == wanted and (handle is None) == (wanted != c.OK), (function, given, status)
        c.library().collide_shape_free(handle)
    assert 15 < refused < len(NUMBERS) - 5, refused
    for point, radius in (
        ((_NAN, 0, 0), 0.0),
        ((0, 0, 1e51), 0.0),
        ((1e-60, 0, 0), 0.0),
        ((1, 0, 0), -1.0),
        ((1, 0, 0), 1e-60),
    ):
        array = np.array([point], dtype=float)
        with pytest.raises(collide.InvalidShape):
            collide.ConvexHull(array, radius=radius)
        assert c.raw_shape("collide_hull", array, 1, radius) == (c.INVALID_SHAPE, None), point
    assert c.raw_shape("collide_hull", np.zeros((1, 3)), 0, 0.0)[0] == c.INVALID_SHAPE
    for name in ("collide_box", "collide_ellipsoid"):
        assert c.raw_shape(name, None) == (c.INVALID_ARGUMENT, None)


def test_what_is_no_pose_is_refused_as_python_does():
    shape, asker, good = collide.Box(1, 1, 1), c.Asker(), np.eye(4)
    own = c.CShape(shape)
    for number, bad in enumerate(c.odd_poses()):
        for flags, check in ((0, True), (c.TRUST_POSES, False)):
            for poses in ((bad, good), (good, bad)):
                try:
                    wanted = c.OK, collide.collide(shape, shape, *poses, check_poses=check)
                except collide.InvalidPose:
                    wanted = c.INVALID_POSE, False
                assert asker.collide(own, own, *poses, flags) == wanted, (number, flags)
                assert asker.distance(own, own, *poses, flags)[0] == wanted[0], (number, flags)
        many = np.stack([good] * 200)
        many[137] = bad
        status, _, failed = asker.batch((own, own), good, many, boolean=number % 2 == 0)
        assert (status, failed) == (c.INVALID_POSE, 137), number


def test_too_small_pairs_and_endless_depths_are_told():
    asker = c.Asker()
    speck, floor = c.CShape(collide.ConvexHull([[0.0, 0.0, 0.0]])), c.CShape(collide.Halfspace((0, 0, 1), 0.0))
    near = c.identity_at(1e-60, 0, 0)
    with pytest.raises(collide.UnsupportedQuery):
        collide.distance(collide.ConvexHull([[0.0, 0.0, 0.0]]), collide.ConvexHull([[0.0, 0.0, 0.0]]), np.eye(4), near)
    assert asker.distance(speck, speck, np.eye(4), near)[0] == c.OUT_OF_RANGE
    assert asker.collide(speck, speck, np.eye(4), near)[0] == c.OUT_OF_RANGE
    many = np.stack([c.identity_at(1.0, 0, 0)] * 100)
    many[77] = near
    assert asker.batch((speck, speck), np.eye(4), many, boolean=True)[::2] == (c.OUT_OF_RANGE, 77)
    assert asker.distance(floor, floor, np.eye(4), np.eye(4))[0] == c.ENDLESS_DEPTH
    assert asker.collide(floor, floor, np.eye(4), np.eye(4)) == (c.OK, True)
    many = np.stack([np.diag([1.0, -1, -1, 1])] * 100)
    many[:, 2, 3] = 1.0
    many[55] = np.eye(4)
    status, rows, failed = asker.batch((floor, floor), np.eye(4), many, boolean=False)
    assert (status, failed) == (c.ENDLESS_DEPTH, 55) and rows["distance"][55] == -math.inf
    assert (np.delete(rows["distance"], 55) == 1.0).all()
    assert asker.distance(floor, floor, np.eye(4), np.eye(4), c.UNSIGNED)[0] == c.OK


def test_arguments_out_of_range_are_told():
    asker, box = c.Asker(), c.CShape(collide.Box(1, 1, 1))
    library, hit, X = c.library(), ctypes.c_int(7), np.eye(4).ctypes.data
    for at in range(5):
        given = [asker.handle, box.handle, box.handle, X, X]
        given[at] = None
        assert library.collide_collide(*given, 0, hit) == c.INVALID_ARGUMENT and hit.value == 0
    assert library.collide_collide(asker.handle, box.handle, box.handle, X, X, 4, hit) == c.INVALID_ARGUMENT
    assert library.collide_collide(asker.handle, box.handle, box.handle, X, X, 0, None) == c.INVALID_ARGUMENT
    assert library.collide_workspace_create(None) == c.INVALID_ARGUMENT
    for limit in (-1.0, _NAN):
        assert asker.distance(box, box, np.eye(4), np.eye(4), limit=limit)[0] == c.INVALID_ARGUMENT
    many = np.stack([np.eye(4)] * 5)
    assert asker.batch((box, box), many, many[:3], boolean=True)[0] == c.INVALID_ARGUMENT
    for axis in (_NAN, 1e101):
        assert asker.batch((box, box), many, many, boolean=True, axes=np.full((5, 3), axis))[0] == c.INVALID_ARGUMENT
    shapes = c.CSet([box, box])
    for which in ([[0, 2]], [[-1, 0]]):
        assert asker.batch((shapes, which), many[:1], many[:1], boolean=True)[::2] == (c.INVALID_ARGUMENT, 0)
    status, hits, _ = asker.batch((shapes, np.zeros((0, 2))), np.zeros((0, 4, 4)), np.zeros((0, 4, 4)), boolean=True)
    assert status == c.OK and len(hits) == 0
    assert c.library().collide_status_text(99).decode() == "unknown status"
    for function in ("collide_shape_free", "collide_shape_set_free", "collide_workspace_free"):
        getattr(library, function)(None)


def test_handles_that_were_freed_or_are_of_another_type_are_refused():
    """As long as their memory is nobody else's, and what frees them does nothing."""
    library, X, row = c.library(), np.eye(4), np.zeros(1, PAIR_DTYPE)
    tetrahedron = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    handles, points = {"shape": c.raw_shape("collide_sphere", 0.5)[1]}, np.vstack([np.zeros(3), np.eye(3)])
    of_one = (ctypes.c_void_p * 1)(handles["shape"])
    for name, function, arguments in (
        ("shape_set", "collide_shape_set_create", (of_one, 1)), ("workspace", "collide_workspace_create", ()),
        ("compound", "collide_compound_create", (of_one, X, 1)), ("world", "collide_world_create", ()),
        ("field", "collide_point_cloud_create", (points, 4, np.full(1, 0.1), 1)),
    ):
        status, handles[name] = c.raw_shape(function, *arguments)
        assert status == c.OK, name
    handles["mesh"] = c.raw_mesh(points, tetrahedron, c.SOLID)[1]
    body, world = c.Asker(), handles["world"]

    def statuses() -> dict[str, int]:
        """What each handle is told in the place of each other."""
        one = ctypes.c_size_t(1)
        at, space, out = X.ctypes.data, body.handle, row.ctypes.data
        asked: dict[str, int] = {}
        for name, handle in handles.items():
            poses = c.Poses(at, 1)
            asked["shape", name] = library.collide_distance(space, handle, handle, at, at, 1.0, 0, out)
            asked["mesh", name] = library.collide_mesh_collide(space, handle, handle, at, at, 0, ctypes.c_int())
            asked["compound", name] = library.collide_compound_distance(
                space, handle, handle, poses, poses, 1.0, 0, out, one)
            asked["field", name] = library.collide_point_cloud_within(handle, points.ctypes.data, 1.0, None, 0, one)
            asked["world", name] = library.collide_world_collides(handle, space, ctypes.c_int())
            asked["shape_set", name] = library.collide_collide_each(
                space, handle, np.zeros(2, np.int64).ctypes.data, 1, poses, poses, 0, None, out, one)
            asked["workspace", name] = library.collide_world_collides(world, handle, ctypes.c_int())
        return asked

    for (wanted, name), status in statuses().items():
        assert (status != c.INVALID_ARGUMENT) is (wanted == name), (wanted, name, status)
    for wanted in handles:
        for name, handle in handles.items():
            if wanted != name:
                getattr(library, f"collide_{wanted}_free")(handle)
    assert sum(status != c.INVALID_ARGUMENT for status in statuses().values()) == len(handles), "one was freed"
    for name in ("shape_set", "compound", "world", "shape", "workspace", "field", "mesh"):
        for _ in range(2):
            getattr(library, f"collide_{name}_free")(handles[name])
    assert set(statuses().values()) == {c.INVALID_ARGUMENT}


def test_processors_level_is_that_of_the_environment():
    ask = (
        "import ctypes, sys; lib = ctypes.CDLL(sys.argv[1]); level = ctypes.c_char_p(); out = ctypes.c_void_p();"
        "said = lib.collide_level(ctypes.byref(level)), lib.collide_workspace_create(ctypes.byref(out));"
        "print(*said, level.value, out.value is None)"
    )
    from collide.kernels import built as made_of
    from collide.kernels import library

    oldest = made_of.LEVELS[0]
    here = f"0 0 {library.level.encode()} False"
    for wanted, told in (("", here), (oldest, f"0 0 {oldest.encode()} False"), ("v9", "8 8 None True")):
        said = run(sys.executable, "-c", ask, library_path(), env={**os.environ, "COLLIDE_CPU": wanted})
        assert said.strip() == told, wanted
