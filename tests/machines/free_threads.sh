#!/usr/bin/env bash
# Pythons without the lock. A wheel is built for python3.14t or python3.13t, or for one made of Debian's sources of 3.13;
# tests of threads and a soak of four threads run under it. The stable interface of such builds (abi3t, Python 3.15) is
# compiled, and the module run under Debian's Python 3.15 with the lock, which loads it, too.
#
#   bash tests/machines/free_threads.sh                # a quarter of an hour on one core, and as long to build a Python
#   PYTHON=/opt/python3.14t/bin/python3 bash tests/machines/free_threads.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/machines/debian.sh

built_python() {
    local home=$work/python3.13t
    if [ ! -x "$home/bin/python3.13t" ]; then
        python_source trixie python3.13 "$work/python-source"
        mkdir -p "$work/python-build"
        (
            cd "$work/python-build"
            "$work/python-source/configure" --quiet --prefix="$home" \
                --disable-gil --disable-test-modules --with-ensurepip=no
            nice -n 10 make -s && make -s install
        ) > "$work/python-build.log" 2>&1 || { tail "$work/python-build.log"; exit 1; }
    fi
    echo "$home/bin/python3.13t"
}
free_python=${PYTHON:-$(command -v python3.14t || command -v python3.13t || built_python)}
version=$("$free_python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
site=$work/site-${version}t
rm -rf "$site"
packages_for "$site" x86_64 "$version" "cp${version/./}t" numpy pytest setuptools
# Its compiler of kernels has no packages for such a Python: their objects are made by this one.
trap 'rm -rf emitted' EXIT
python -c "import sys; sys.path.insert(0, 'native'); import backend; backend.emit(('linux-x86_64',), '')"
export COLLIDE_REQUIRE_COMPILED=1
rm -rf "$work/wheels/${version}t"
PYTHONPATH=$site "$free_python" - "$work/wheels/${version}t" > "$work/build.log" 2>&1 << 'PYTHON' || { tail "$work/build.log"; exit 1; }
import sys
sys.path.insert(0, "native")
import backend
backend.build_wheel(sys.argv[1])
PYTHON
python -m zipfile -e "$work/wheels/${version}t"/*.whl "$site"
export PYTHONSAFEPATH=1 # the checkout's package is for this machine's Python
free() { PYTHONPATH=$site "$free_python" "$@"; }
free -W error -c '
import sys, collide
from collide.kernels import mode
assert mode.MODE == mode.COMPILED and not sys._is_gil_enabled(), "the module asks for the lock"
print(f"Python {sys.version.split()[0]} without the lock: kernels", mode.describe_mode())'
free tests/soak/soak_threads.py --pairs 100 --rounds 3
free -m pytest -q -p no:cacheprovider -k "not pages_of_help" tests/worlds/test_live_worlds.py tests/narrowphase/test_single_queries.py \
    tests/narrowphase/test_single_call.py tests/pairs/test_batches.py tests/narrowphase/facets/test_mesh_batches.py

home=$work/python3.15 site=$work/site-abi3t
late_python 3.15
rm -rf "$site"
packages_for "$site" x86_64 3.15 cp315 numpy
COLLIDE_INTERFACE=abi3t COLLIDE_INCLUDE=$site/numpy/_core/include:$home/usr/include/python3.15:$home/usr/include \
    python setup.py -q build --build-lib "$site" > "$work/build.log" 2>&1 || { tail "$work/build.log"; exit 1; }
[ -e "$site/collide/kernels/_glue.abi3t.so" ]
PYTHONPATH=$site "$late" -c '
import sys, collide
from collide.kernels import library, mode
assert mode.MODE == mode.COMPILED and library.glue.__file__.endswith(".abi3t.so")
print(f"Python {sys.version.split()[0]} with the lock, module abi3t: kernels", mode.describe_mode())'
PYTHONPATH=$site "$late" tests/soak/soak_threads.py --pairs 100 --rounds 1
