#!/usr/bin/env bash
# Install what is missing into the current environment, then lint, check types, and test what a change can break:
# everything with the library of kernels, then what defines kernels of its own, compiled just in time. Each part says how
# it ends; one failure is the script's. What takes long, and other parts of many cases: bash tests/nightly.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
unset PYTHONDONTWRITEBYTECODE # where bytecode is kept, collecting the tests takes a third of the time
python -m pip install --quiet --disable-pip-version-check -e ".[demo,peers,pinocchio,sweep,plots,dev]"
ruff check .
types=$(mktemp)
trap 'rm -f "$types"' EXIT
bash tests/types.sh > "$types" 2>&1 &
of_types=$!
tests=(python -m pytest -q -n auto --maxprocesses 4 --dist loadfile)
status=0
"${tests[@]}" "$@" || status=$?
of_own=0
own=("$@")
[ $# -gt 0 ] || mapfile -t own < <(grep -rl --include='test_*.py' 'mark.own_kernels' tests)
COLLIDE_JIT=1 "${tests[@]}" -m "own_kernels and not slow" "${own[@]}" || of_own=$?
if [[ $of_own == 5 && $# -gt 0 ]]; then of_own=0; fi # none among the tests that were named
wait $of_types || status=1
cat "$types"
exit $((status ? status : of_own))
