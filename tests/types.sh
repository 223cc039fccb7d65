#!/usr/bin/env bash
# mypy over the package as it is installed: adapters and scenes inside collide.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(mktemp -d)
trap 'rm -rf "$target"' EXIT
cp -r collide "$target/" && cp -r adapters scenes "$target/collide/"
MYPYPATH="$target" mypy -p collide
