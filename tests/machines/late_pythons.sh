#!/usr/bin/env bash
# Pythons that are newer than this machine's: the wheel that serves all of them is built here, its C by the package
# ziglang. Under Debian's newest 3.14 and 3.15, each with the numpy that PyPI has for the version, tests of the engine
# run, and all answers of tests/golden.py are compared, bit by bit, with those of this checkout's own library.
#
#   bash tests/machines/late_pythons.sh                          # some minutes
#   bash tests/machines/late_pythons.sh tests/worlds             # these tests instead
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/machines/debian.sh
[ "$(uname -sm)" = "Linux x86_64" ] || skip "these Pythons are for Linux on x86-64"
chosen=("$@")
[ ${#chosen[@]} -gt 0 ] || chosen=("${engine_tests[@]}")
wheel_of linux-x86_64
python tests/golden.py --keep "$work/answers"
for version in 3.14 3.15; do
    late_python $version
    site=$work/site-$version
    rm -rf "$site"
    packages_for "$site" x86_64 $version cp${version/./} pytest hypothesis scipy "$wheel"
    PYTHONPATH=$site "$late" -P -W error -c '
import sys, numpy, collide
from collide.kernels import mode
assert mode.MODE == mode.COMPILED, mode.WHY
print(f"Python {sys.version.split()[0]}, numpy {numpy.__version__}: kernels", mode.describe_mode())'
    PYTHONPATH=$site "$late" -P tests/golden.py --against "$work/answers"
    PYTHONPATH=$site "$late" -P -m pytest -q -p no:cacheprovider "${chosen[@]}"
done
