#!/usr/bin/env bash
# One wheel, every Python that is on this machine: built once, then installed and tested under each of them, away from the checkout.
#
#   bash tests/matrix.sh                 # the engine's tests that need no extras, a minute or two a Python
#   bash tests/matrix.sh tests/engine/test_closed_forms.py     # other tests
#   WHEEL=dist/….whl PYTHONS="3.10 3.13" bash tests/matrix.sh
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chosen=("$@")
[ ${#chosen[@]} -gt 0 ] || chosen=(
    tests/engine/test_closed_forms.py tests/pairs/test_batches.py tests/engine/test_exact_answers.py tests/engine/test_symmetry.py
    tests/hull/test_exact_hull.py tests/support/test_support_tree_query.py
    tests/narrowphase/facets/test_surface_distance.py tests/contact/test_mesh_contacts.py
)
if [ -z "${WHEEL:-}" ]; then
    echo "building the wheel (a minute)"
    COLLIDE_REQUIRE_COMPILED=1 python -m pip wheel --quiet --no-deps --wheel-dir "$work" .
    WHEEL=$(echo "$work"/*.whl)
fi
WHEEL=$(realpath "$WHEEL")
cp -r tests pyproject.toml "$work" # pyproject.toml: marks, and which run
echo "wheel: $(basename "$WHEEL"), $(stat -c %s "$WHEEL" 2>/dev/null || stat -f %z "$WHEEL") bytes"

# Every python3.X on the path, and those of pyenv.
found() {
    for version in ${PYTHONS:-3.10 3.11 3.12 3.13 3.14 3.15}; do
        for candidate in "python$version" "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$version".*/bin/python; do
            if "$candidate" -c 'import sys; sys.exit("%d.%d" % sys.version_info[:2] != "'"$version"'")' 2>/dev/null; then
                echo "$candidate"
                break
            fi
        done
    done
}
# A process of its own for each Python: within `( … ) || …` a failing command would not end the commands after it.
cat > "$work/one.sh" <<'SHELL'
set -euo pipefail
python=$1 environment=$2 wheel=$3
shift 3
"$python" -m venv "$environment"
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check "$wheel" pytest hypothesis
"$environment/bin/python" - <<'PYTHON'
import sys, time
started = time.perf_counter()
import collide
box = collide.Box((1, 1, 1))
hit = collide.collide(box, box, collide.pose(), collide.pose((1.5, 0, 0)))
seconds = time.perf_counter() - started
import numpy
from collide.kernels import mode
compilers = [name for name in sys.modules if name.startswith(("numba", "llvmlite"))]
assert mode.MODE == mode.COMPILED and hit is False and not compilers, (mode.describe_mode(), hit, compilers)
print(f"Python {sys.version.split()[0]}, numpy {numpy.__version__}: kernels {mode.describe_mode()}, "
      f"import to first boolean {seconds:.3f} s")
PYTHON
# Not `python -m pytest`: that would put this folder on the path.
"$environment/bin/pytest" -q -p no:cacheprovider "$@" | tail -n 1
SHELL
tried=0 failed=()
for python in $(found); do
    name=$("$python" -c 'import platform; print(platform.python_version())')
    (cd "$work" && exec bash one.sh "$python" "$work/$name" "$WHEEL" "${chosen[@]}") || failed+=("$name")
    tried=$((tried + 1))
done
if [ $tried = 0 ]; then echo "no Python of ${PYTHONS:-3.10 to 3.15} on this machine"; exit 1; fi
if [ ${#failed[@]} -gt 0 ]; then echo "failed under Python ${failed[*]}"; exit 1; fi
echo "passed under all $tried"
