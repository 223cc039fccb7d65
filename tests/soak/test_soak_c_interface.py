"""Some calls of the soak of the C interface, and that it notices planted faults and repeats them.
`python tests/soak/soak_c_interface.py` makes millions, under sanitizers."""

from __future__ import annotations

import re

import pytest
from soak_c_interface import ROOT, SOURCE, NoTools, build, soak

from collide.kernels import mode

pytestmark = pytest.mark.slow
if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

#: What stands before `collide_distance`: after the call it changes what it may not, or an answer.
_PLANTED = """
#include "collide.h"
static inline collide_status planted(collide_workspace *workspace, const collide_shape *A, const collide_shape *B,
                                     const double *X_WA, const double *X_WB, double limit, unsigned flags,
                                     collide_pair *pair)
{
    collide_status status = collide_distance(workspace, A, B, X_WA, X_WB, limit, flags, pair);
    %s
    return status;
}
#define collide_distance planted
"""


def _built(folder, *options):
    try:
        return build(folder, False, *options)
    except NoTools as error:
        pytest.skip(f"no C compiler: {error}")


def test_every_function_is_called():
    header = (ROOT / "native" / "collide.h").read_text(encoding="utf-8")
    declared = re.findall(r"^COLLIDE_API\b[^;(]*?(\w+)\(", header, re.MULTILINE)
    source = SOURCE.read_text(encoding="utf-8")
    assert len(declared) > 90
    assert not {name for name in declared if f"{name}(" not in source}


def test_calls_from_four_threads_contradict_nothing(tmp_path):
    done = soak(_built(tmp_path), 60_000, 7, 4)
    assert done.returncode == 0, done.stderr
    calls, asked_twice = map(int, re.findall(r"(\d+) calls, (\d+) questions", done.stdout)[0])
    assert calls >= 60_000 and asked_twice > 0.3 * calls, done.stdout
    told = {text: int(count) for count, text in re.findall(r"^ *(\d+)  (.*)$", done.stdout, re.MULTILINE)}
    assert told["done"] > 0.6 * calls and min(told["not supported by the C interface"], told["a matrix is no pose: "
        "finite, a rotation, last row 0 0 0 1"], told["more answers than there is room for"]) > 300, told


@pytest.mark.parametrize(
    ("fault", "violation"),
    [
        ("((unsigned char *)(pair + 1))[3] = 0;", "bytes behind the caller's room were written to"),
        ("if (status == COLLIDE_OK) pair->upper = pair->lower - 1.0;", "a distance outside its bracket"),
        ("static int calls = 0; if (calls++ % 50 == 0) pair->iterations++;", "an equal question has other rows"),
    ],
)
def test_planted_faults_are_noticed_and_repeated(tmp_path, fault, violation):
    (tmp_path / "planted.h").write_text(_PLANTED % fault, encoding="utf-8")
    program = _built(tmp_path, "-include", tmp_path / "planted.h")
    done = soak(program, 20_000, 7, 1)
    assert done.returncode == 1 and f"VIOLATION: {violation}" in done.stderr, done.stdout + done.stderr
    call = re.search(r"--repeat (\S+)\)", done.stderr)[1]
    assert soak(program, 20_000, 7, 1, call).stderr == done.stderr
