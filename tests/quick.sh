#!/usr/bin/env bash
# What to run while editing, in a minute, with the library as it is: lint, the house's rules, the first case of each unit
# test that is short, and the bytes of a sixth of the golden groups (another sixth each day).
#
#   bash tests/quick.sh                        all of that; a new test of more than 2 s fails and names itself
#   bash tests/quick.sh tests/mesh -k weld     these tests alone, all their cases; whatever pytest takes
#
# Before a commit: bash tests/run.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
unset PYTHONDONTWRITEBYTECODE # where bytecode is kept, collecting the tests takes a third of the time
if [ $# -gt 0 ]; then exec python -m pytest -q "$@"; fi
status=0
ruff check . || status=$?
apart=(adapters c_interface packaging soak sweeps)
python -m pytest -q --quick --budget 2 -n auto --maxprocesses 4 --dist loadfile "${apart[@]/#/--ignore=tests/}" || status=$?
python tests/golden.py --part "$((10#$(date +%j) % 6 + 1))/6" || status=$?
exit $status
