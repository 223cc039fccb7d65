#!/usr/bin/env bash
# Install what is missing into the current environment, then lint, check types, and test.
set -euo pipefail
cd "$(dirname "$0")/.."
python -m pip install --quiet --disable-pip-version-check -e ".[demo,peers,plots,dev]"
ruff check .
mypy_target=$(mktemp -d)
trap 'rm -rf "$mypy_target"' EXIT
python -m pip install --quiet --disable-pip-version-check --no-deps --target "$mypy_target" .
MYPYPATH="$mypy_target" mypy -p collide
python -m pytest -n auto --maxprocesses 4 --dist loadfile "$@"
