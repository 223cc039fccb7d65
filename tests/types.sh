#!/usr/bin/env bash
# mypy over the package as it is installed: adapters and scenes inside collide. In one place, so that mypy's cache serves.
set -euo pipefail
cd "$(dirname "$0")/.."
target=build/types
rm -rf "$target"
mkdir -p "$target"
cp -r collide "$target/" && cp -r adapters scenes "$target/collide/"
MYPYPATH="$target" mypy -p collide
