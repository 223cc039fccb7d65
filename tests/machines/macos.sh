#!/usr/bin/env bash
# macOS on arm64 and x86-64, on a Linux machine: wheels cross-compiled by the package ziglang, and not run: nothing here
# runs programs of macOS. What its loader reads in their libraries is compared with native/abi.txt, and what their
# Python module takes from Python with what the module of this machine does.
#
#   bash tests/machines/macos.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/machines/debian.sh
need nm binutils
for machine in arm64 x86_64; do
    # Headers of Python are this machine's: integers have the same sizes. numpy's say which headers the system has.
    site=$work/macos-site-$machine
    rm -rf "$site"
    packages_for "$site" "macosx_14_0_$machine" 3.13 "" numpy
    COLLIDE_INCLUDE=$site/numpy/_core/include wheel_of "darwin-$machine"
    python tests/machines/dynamic_libraries.py "$wheel"
done
