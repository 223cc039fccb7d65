#!/usr/bin/env bash
# Everything that takes long, in an hour and a half on two cores: every extra, all cases of all tests, other processors'
# levels, other Pythons and other machines, soaks, a search for wrong answers of engines, faults planted in the code.
#
#   bash tests/nightly.sh                  all steps; logs and a table in build/nightly
#   bash tests/nightly.sh tests soaks      these steps alone
#
# A step that fails does not keep the others from running; the script then ends with status 1. A test that is skipped is
# a failure unless tests/skips.txt names the reason. Durations of functions are kept in tests/durations.json, and what
# grew is told: the file belongs into a commit.
set -euo pipefail
cd "$(dirname "$0")/.."
unset PYTHONDONTWRITEBYTECODE # where bytecode is kept, collecting the tests takes a third of the time
steps=(install tests own plain matrix machines soaks faults site)
chosen=("${@:-${steps[@]}}")
log=build/nightly
mkdir -p "$log"
: > "$log/steps"
seed=$((10#$(date +%y%j)))

run() { # NAME COMMAND...: the command's output goes to a file, how it ended to the table
    local begun=$SECONDS status=0 ended
    "${@:2}" > "$log/$1.log" 2>&1 || status=$?
    case $status in
        0) ended=passed ;;
        77) ended=$(tail -n 1 "$log/$1.log") ;; # skipped: and why
        *) ended="failed: $log/$1.log" ;;
    esac
    printf '%-16s %5d s  %s\n' "$1" $((SECONDS - begun)) "$ended" | tee -a "$log/steps"
}
tests=(python -m pytest -q -n auto --maxprocesses 4 --dist loadfile -rfE)

install() {
    if ! command -v chromium > /dev/null && [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null; then
        run chromium apt-get install -y --no-install-recommends chromium chromium-driver
    fi
    # kernels of all levels of this kind of processor
    COLLIDE_LEVELS=all run install python -m pip install --disable-pip-version-check -e ".[all]"
}
tests() {
    run tests "${tests[@]}" -m "" --skips tests/skips.txt --durations-file tests/durations.json
    grep '^slower' "$log/tests.log" || true
}
own() {
    local own
    mapfile -t own < <(grep -rl --include='test_*.py' 'mark.own_kernels' tests)
    COLLIDE_JIT=1 run own "${tests[@]}" -m own_kernels "${own[@]}"
}
plain() { NUMBA_DISABLE_JIT=1 run plain python -m pytest -q tests/contact/test_facet_manifolds.py -k no_patch_may_reach; }
matrix() { run matrix bash tests/matrix.sh; }
machines() {
    local script
    for script in arm64 late_pythons free_threads windows macos; do run "$script" bash "tests/machines/$script.sh"; done
}
soaks() {
    rm -rf "$log/fuzz" # of the last night: a search goes on from its folder only where it is told to
    run fuzz collide fuzz --minutes 20 --seed "$seed" --save "$log/fuzz" --quiet & # one core
    run soak-worlds python tests/soak/soak_worlds.py --questions 30000 --seed "$seed"
    run soak-memory python tests/soak/soak_memory.py --shapes 30000 --seed "$seed"
    run soak-pairs python tests/soak/soak.py --minutes 6 --seed "$seed"
    run soak-contacts python tests/soak/soak_contacts.py --pairs 20000 --seed "$seed"
    run soak-c-interface python tests/soak/soak_c_interface.py --calls 3000000 --seed "$seed"
    run soak-motions python tests/soak/soak_motions.py --motions 5000 --seed "$seed"
    run soak-solids python tests/soak/soak_solids.py --chains 80 --seed "$seed"
    run soak-threads python tests/soak/soak_threads.py --pairs 200 --rounds 3 --seed "$seed"
    wait
}
faults() { run faults python tests/mutants/planted_faults.py --faults 200 --seed 1; }
site() { run site python -m sphinx -W -q -c docs . build/site; }

for step in "${chosen[@]}"; do
    [[ " ${steps[*]} " == *" $step "* ]] || { echo "no step $step: ${steps[*]}"; exit 2; }
done
for step in "${chosen[@]}"; do "$step"; done
printf 'all %24d s\n' $SECONDS
! grep -q failed "$log/steps"
