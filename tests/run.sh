#!/usr/bin/env bash
# Install what is missing into the current environment, then lint, check types, and test: everything with the library of
# kernels, then what defines kernels of its own, compiled just in time. Both say how they end; one failure is the script's.
set -euo pipefail
cd "$(dirname "$0")/.."
python -m pip install --quiet --disable-pip-version-check -e ".[demo,peers,plots,dev]"
ruff check .
bash tests/types.sh
tests=(python -m pytest -n auto --maxprocesses 4 --dist loadfile)
status=0
"${tests[@]}" "$@" || status=$?
of_own=0
COLLIDE_JIT=1 "${tests[@]}" -m "own_kernels and not slow" "$@" || of_own=$?
if [[ $of_own == 5 && $# -gt 0 ]]; then of_own=0; fi # none among the tests that were named
exit $((status ? status : of_own))
