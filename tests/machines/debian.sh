# For the scripts of this folder, which source it: packages of Debian for any processor, unpacked into a folder of this
# checkout. Nothing of the machine's own is changed, and no rights are needed.
work=$PWD/build/machines
mkdir -p "$work"
# Tests of the engine that need no extras, as tests/matrix.sh runs them.
engine_tests=(
    tests/engine/test_closed_forms.py tests/engine/test_exact_answers.py tests/engine/test_symmetry.py
    tests/pairs/test_batches.py tests/hull/test_exact_hull.py tests/support/test_support_tree_query.py
    tests/narrowphase/facets/test_surface_distance.py tests/contact/test_mesh_contacts.py
)

skip() { echo "skipped: $*" >&2; exit 77; }
need() { command -v "$1" > /dev/null || skip "no $1: apt-get install $2"; }

apt_of() { # SUITE ARCHITECTURE: a folder of its own for apt-get's lists, in APT_CONFIG
    local home=$work/apt-$1-$2 keys=/usr/share/keyrings/debian-archive-keyring.gpg
    need apt-get apt
    [ -e $keys ] || skip "no keys of Debian's archive: apt-get install debian-archive-keyring"
    export APT_CONFIG=$home/apt.conf
    [ -e "$home/updated" ] && return
    mkdir -p "$home"/{state,lists/partial,cache/archives/partial,parts}
    touch "$home/status"
    printf '%s [arch=%s signed-by=%s] http://deb.debian.org/debian %s main\n' deb "$2" $keys "$1" deb-src "$2" $keys "$1" \
        > "$home/sources.list"
    cat > "$APT_CONFIG" << CONF
Dir::State "$home/state";
Dir::State::Lists "$home/lists";
Dir::State::status "$home/status";
Dir::Cache "$home/cache";
Dir::Etc::SourceList "$home/sources.list";
Dir::Etc::SourceParts "$home/parts";
Dir::Etc::PreferencesParts "$home/parts";
APT::Architecture "$2";
APT::Architectures { "$2"; };
APT::Sandbox::User "root";
Acquire::Languages "none";
CONF
    apt-get -q update > "$home/log" 2>&1 || { cat "$home/log"; skip "Debian's archive of $1 cannot be reached"; }
    touch "$home/updated"
}

unpacked() { # SUITE ARCHITECTURE FOLDER PACKAGE...: the packages' files
    local folder=$3
    [ -e "$folder/unpacked" ] && return
    (
        apt_of "$1" "$2"
        mkdir -p "$folder/packages"
        cd "$folder/packages"
        apt-get -q download "${@:4}" > log 2>&1 || { cat log; exit 1; }
        for package in *.deb; do dpkg -x "$package" "$folder"; done
        rm -r "$folder/packages"
    )
    touch "$folder/unpacked"
}

packages_for() { # FOLDER PLATFORM VERSION ABI PACKAGE...: of PyPI, for a Python in which no pip runs; ABI "" is any
    local kind=(--platform "$2") # a platform's whole name; for Linux the kind of processor
    case $2 in
        x86_64 | aarch64) kind=(--platform "manylinux_2_28_$2" --platform "manylinux_2_27_$2" --platform "manylinux2014_$2") ;;
    esac
    python -m pip install --quiet --disable-pip-version-check --target "$1" --only-binary :all: --ignore-requires-python \
        --implementation cp --python-version "$3" ${4:+--abi "$4"} "${kind[@]}" "${@:5}"
}

late_python() { # VERSION: Debian's newest Python of that version, for x86-64: its command, in $late, with its own C library
    local home=$work/python$1 path
    unpacked sid amd64 "$home" libc6 zlib1g libexpat1 libffi8 libssl3t64 libzstd1 libbz2-1.0 liblzma5 libsqlite3-0 libuuid1 \
        "python$1-minimal" "libpython$1-minimal" "libpython$1-stdlib" "libpython$1-dev"
    late=$work/python-$1 path=$home/usr/lib/x86_64-linux-gnu
    # Under --argv0 the script stands for Python's own file: processes that Python starts are started by it, too.
    cat > "$late" << SHELL
#!/bin/sh
PYTHONHOME='$home/usr' exec '$home/usr/lib64/ld-linux-x86-64.so.2' --argv0 '$late' --library-path '$path' \
    '$home/usr/bin/python$1' "\$@"
SHELL
    chmod +x "$late"
}

python_source() { # SUITE PACKAGE FOLDER: the sources of a Python, as they are without Debian's changes
    [ -e "$3/configure" ] && return
    need dpkg-source dpkg-dev
    (
        apt_of "$1" "$(dpkg --print-architecture)"
        mkdir -p "$work/sources"
        cd "$work/sources"
        apt-get -q source --download-only "$2" > log 2>&1 || { cat log; exit 1; }
        dpkg-source --no-check --no-copy --skip-patches -x "$2"_*.dsc "$3" > log
    ) || skip "Debian's archive has no sources of $2"
}

wheel_of() { # PLATFORM: its wheel, in $wheel; kernels of unchanged sources are there from the last time
    python -c 'import ziglang' 2> /dev/null || skip "no cross compiler: pip install 'collide-robotics[machines]'"
    rm -rf "$work/wheels/$1"
    COLLIDE_PLATFORM=$1 COLLIDE_REQUIRE_COMPILED=1 nice -n 10 \
        python -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir "$work/wheels/$1" .
    wheel=$(echo "$work/wheels/$1"/*.whl)
    echo "wheel: $(basename "$wheel")"
}

examples_of() { # FOLDER TARGET LIBRARY...: programs of examples/c for a target of zig, linked to a library
    mkdir -p "$1"
    local source language
    for source in examples/c/*.c*; do
        case $source in *.cpp) language=c++ ;; *) language=cc ;; esac
        nice -n 10 python -m ziglang $language -target "$2" -O2 -Wall -Wextra -Werror -Inative "$source" "${@:3}" \
            -o "$1/$(basename "${source%.*}").exe"
    done
}

examples_agree() { # FOLDER RUN...: what the programs print is what this machine's own print
    local own=$work/examples library program
    library=$(python -c 'import collide; print(collide.get_library())')
    examples_of "$own" x86_64-linux-gnu "$library"
    for program in two_shapes resting point_cloud threads; do
        # The level of the processor is another.
        LD_LIBRARY_PATH=$(dirname "$library") "$own/$program.exe" | sed 's/kernels for .*//' > "$own/$program.txt"
        "${@:2}" "$1/$program.exe" | sed 's/kernels for .*//;s/\r$//' | diff "$own/$program.txt" - ||
            { echo "examples/c/$program answers otherwise"; return 1; }
    done
    echo "examples/c: 4 programs say what they say on this machine"
}
