#!/usr/bin/env bash
# Windows on x86-64, on a Linux machine: a wheel cross-compiled by the package ziglang; its collide.dll is run by wine,
# by the programs of examples/c. Its Python module is linked, and not run: no Python for Windows is to be had in Debian.
# What it takes from python3.dll has to be in that library's list, of CPython's sources.
#
#   bash tests/machines/windows.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/machines/debian.sh
wine=$(command -v wine64 || command -v wine || ls /usr/lib/wine/wine64 2> /dev/null) ||
    skip "no wine: apt-get install wine64"
need nm binutils
sources=$work/python-source site=$work/windows-site
python_source trixie python3.13 "$sources"
rm -rf "$site"
packages_for "$site" win_amd64 3.13 "" numpy

# Headers: CPython's own, with the sizes of Windows.
mkdir -p "$work/windows-include"
cp -r "$sources/Include/." "$work/windows-include"
sed 's/^#undef Py_GIL_DISABLED$//;s/@.*@//' "$sources/PC/pyconfig.h.in" > "$work/windows-include/pyconfig.h"
COLLIDE_INCLUDE=$work/windows-include:$site/numpy/_core/include wheel_of win32-amd64
python -m zipfile -e "$wheel" "$site"
python tests/machines/dynamic_libraries.py "$wheel"
python - "$sources/PC/python3dll.c" build/kernels/python3/python3.def << 'PYTHON'
import re, sys
from pathlib import Path
exported = set(re.findall(r"^EXPORT_(?:FUNC|DATA)\((\w+)\)", Path(sys.argv[1]).read_text(), re.MULTILINE))
used = set(Path(sys.argv[2]).read_text().split()[3:])
assert used and used <= exported, f"not in python3.dll: {sorted(used - exported)}"
print(f"_glue.pyd takes {len(used)} names from python3.dll, all of them in its list of {len(exported)}")
PYTHON
programs=$work/windows-examples
examples_of "$programs" x86_64-windows-gnu "$site/collide/lib/collide.lib"
cp "$site/collide/lib/collide.dll" "$programs"
export WINEPREFIX=$work/wine WINEDEBUG=-all
examples_agree "$programs" "$wine"
