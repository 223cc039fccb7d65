#!/usr/bin/env bash
# What to run while editing, in about a minute: kernels run as the Python that they are written in, so nothing is compiled.
#
#   bash tests/quick.sh                        lint, rules of the house, single kernels against exact twins, closed forms
#   bash tests/quick.sh tests/mesh -k weld     these tests alone, in seconds; all that pytest takes
#
# Before a commit: bash tests/run.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
export NUMBA_DISABLE_JIT=1
if [ $# -gt 0 ]; then exec python -m pytest -q "$@"; fi
status=0
ruff check . || status=$?
tests=(python -m pytest -q -n auto --maxprocesses 4 --dist loadfile)
"${tests[@]}" -m plain_kernels tests/kernels tests/numerics tests/hull tests/mesh tests/support tests/narrowphase || status=$?
"${tests[@]}" tests/house tests/broadphase tests/lowering tests/shapes/test_shape.py tests/test_bad_input.py \
    tests/engine/test_closed_forms.py || status=$?
exit $status
