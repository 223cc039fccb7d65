#!/usr/bin/env bash
# Linux on arm64, run on another kind of processor: a wheel cross-compiled by the package ziglang, run by qemu-user with
# Debian's Python for arm64. Programs in C, the C interface, tests of the engine; all answers of tests/golden.py, bit by
# bit, against this machine's.
#
#   bash tests/machines/arm64.sh                          # some ten minutes on one core
#   bash tests/machines/arm64.sh tests/worlds             # these tests instead
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/machines/debian.sh
need qemu-aarch64 qemu-user
chosen=("$@")
[ ${#chosen[@]} -gt 0 ] || chosen=(tests/c_interface "${engine_tests[@]}")
root=$work/arm64 site=$work/arm64-site
unpacked bookworm arm64 "$root" \
    libc6 libgcc-s1 libstdc++6 zlib1g libexpat1 libffi8 libbz2-1.0 liblzma5 libssl3 libsqlite3-0 libcrypt1 libuuid1 \
    python3.11-minimal libpython3.11-minimal libpython3.11-stdlib
wheel_of linux-aarch64
rm -rf "$site"
packages_for "$site" aarch64 3.11 "" pytest hypothesis scipy "$wheel"

# Python's processes start others by its own name: a script that has qemu run it.
arm=(qemu-aarch64 -L "$root")
cat > "$work/python-arm64" << SHELL
#!/bin/sh
exec '$(command -v qemu-aarch64)' -L '$root' -0 '$work/python-arm64' '$root/usr/bin/python3.11' -P "\$@"
SHELL
chmod +x "$work/python-arm64"
arm_python() { PYTHONHOME=$root/usr PYTHONPATH=$site "$work/python-arm64" "$@"; }

arm_python -c '
import platform, collide
from collide.kernels import mode
assert mode.MODE == mode.COMPILED, mode.WHY
print("Python", platform.python_version(), "on", platform.machine(), "kernels:", mode.describe_mode())'
examples_of "$work/arm64-examples" aarch64-linux-gnu.2.28 "$site/collide/lib/libcollide.so"
examples_agree "$work/arm64-examples" "${arm[@]}" -E LD_LIBRARY_PATH="$site/collide/lib"
python tests/golden.py --keep "$work/answers"
arm_python tests/golden.py --against "$work/answers"
# No compiler on the path: it would make programs of this machine's kind. Forks of threads do not end in qemu.
mkdir -p "$work/nothing"
PATH=$work/nothing arm_python -m pytest -q -p no:cacheprovider -k "not a_fork_while" "${chosen[@]}"
