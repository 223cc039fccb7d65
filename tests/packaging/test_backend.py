"""How kernels come into a wheel: link units, levels of processors, machine code that travels in a source archive."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from collide.kernels import sources

ROOT = Path(__file__).resolve().parents[2]
X86_64 = "x86_64-unknown-linux-gnu"


@pytest.fixture(scope="module")
def native():
    """Modules of the build, which stand beside the package."""
    sys.path.insert(0, str(ROOT / "native"))
    try:
        import backend
        import compile_kernels
    finally:
        sys.path.remove(str(ROOT / "native"))
    return backend, compile_kernels


def test_every_module_of_entries_is_of_a_link_unit_and_no_unit_is_empty(native):
    _, compile_kernels = native
    modules = [sources._module_of(path) for path in sources._files_of_entries()]
    units = [compile_kernels.unit_of(module) for module in modules]
    assert len(modules) > 60 and set(units) == set(compile_kernels.UNITS)
    assert compile_kernels.unit_of("collide.narrowphase.facets.x") == "facets"
    with pytest.raises(SystemExit, match=r"UNITS of native/compile_kernels\.py has no link unit for it"):
        compile_kernels.unit_of("collide.nowhere.x")


@pytest.mark.parametrize(
    ("wanted", "levels"),
    [("all", ["v2", "v3", "v4"]), ("v3", ["v3"]), ("v2 v4", ["v2", "v4"]), ("v2,v3", ["v2", "v3"])],
)
def test_levels_are_those_that_are_named(native, wanted, levels):
    assert [level.name for level in native[1].levels_of(X86_64, wanted)] == levels


def test_levels_are_this_machines_alone_where_none_is_named(native):
    pytest.importorskip("llvmlite", reason="asked for the processor: pip install 'collide-robotics[jit]'")
    _, compile_kernels = native
    here = {"x86_64": X86_64, "aarch64": "aarch64-unknown-linux-gnu"}.get(platform.machine(), "arm64-apple-darwin")
    (level,) = compile_kernels.levels_of(here)
    from collide.kernels import library, mode

    if mode.MODE == mode.COMPILED and not os.environ.get("COLLIDE_CPU"):
        assert library.level in (level.name, *library.about()["levels"].split(", "))
        if level.name in library.about()["levels"].split(", "):
            assert library.level == level.name, "the library chooses as the build does"
    elsewhere = "aarch64-unknown-linux-gnu" if platform.machine() == "x86_64" else X86_64
    assert compile_kernels.levels_of(elsewhere) == compile_kernels.levels_of(elsewhere, "all")


def test_platforms_are_those_of_the_table_and_the_compiler_is_that_of_the_extra(native, monkeypatch):
    backend, _ = native
    platforms = backend.platforms
    for name, known in platforms.PLATFORMS.items():
        monkeypatch.setenv("COLLIDE_PLATFORM", name)
        assert platforms.chosen() is known and known.target in known.zig()
        assert platforms.needs_zig(known) and known.options()["bdist_wheel"]["plat_name"] == known.tag
    monkeypatch.setenv("COLLIDE_PLATFORM", "plan9-x86_64")
    with pytest.raises(SystemExit, match="'plan9-x86_64' is no platform; it may be linux-x86_64, linux-aarch64"):
        platforms.chosen()
    monkeypatch.delenv("COLLIDE_PLATFORM")
    assert f'machines = ["{platforms.ZIG}"]' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_a_level_that_is_none_is_refused_by_name(native):
    with pytest.raises(SystemExit, match="'v9' is no level of x86_64; it has v2, v3, v4, and all"):
        native[1].levels_of(X86_64, "v9")
    with pytest.raises(SystemExit, match="cannot be compiled for riscv64-unknown-linux"):
        native[1].levels_of("riscv64-unknown-linux", "all")


@pytest.fixture()
def folder(native, tmp_path, monkeypatch):
    """A folder of emitted objects for this platform, of a few bytes each."""
    backend, _ = native
    monkeypatch.setattr(backend, "FOLDER", tmp_path)
    names = sources.kernel_sources()
    (tmp_path / "one.o").write_bytes(b"machine code")
    known = hashlib.sha256(b"machine code").hexdigest()
    levels = {"v2": [["one.o", known]], "v3": [["one.o", known]]}
    about = {
        "platforms": {f"{sys.platform}-{platform.machine().lower()}": levels},
        "entries": [], "versions": "…", "sources": sources.fingerprint(names), "source_files": names, "hashes": {},
    }
    (tmp_path / "about.json").write_text(json.dumps(about), encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_objects_of_the_archive_are_used_where_they_fit_and_no_compiler_is_asked_for(native, folder):
    backend, _ = native
    made = backend.emitted()
    assert set(made["objects"]) == {"v2", "v3"} and made["objects"]["v2"] == [str(folder / "one.o")]
    assert made["hashes"] == sources.entry_hashes()
    assert list(backend.emitted("v3")["objects"]) == ["v3"]
    assert backend._compilers() == []


@pytest.mark.parametrize("harm", ["no folder", "damaged", "edited", "platform", "level", "no JSON", "cut"])
def test_objects_that_do_not_fit_are_not_used_and_the_compilers_are_asked_for(native, folder, harm):
    backend, _ = native
    place = folder / "about.json"
    about = json.loads(place.read_text(encoding="utf-8"))
    if harm == "no folder":
        place.unlink()
    elif harm == "damaged":
        (folder / "one.o").write_bytes(b"machine c0de")
    elif harm == "edited":
        place.write_text(json.dumps({**about, "sources": about["sources"] ^ 1}), encoding="utf-8")
    elif harm == "platform":
        place.write_text(json.dumps({**about, "platforms": {"plan9-x86_64": {}}}), encoding="utf-8")
    elif harm == "no JSON":
        place.write_text("{", encoding="utf-8")
    elif harm == "cut":
        (folder / "one.o").unlink()
    assert backend.emitted("v4" if harm == "level" else "") is None
    if harm != "level":
        assert backend._compilers() == backend.COMPILERS


@pytest.mark.slow
def test_a_wheel_of_the_source_archive_needs_no_numba_and_has_the_bytes_of_the_checkouts(native, tmp_path):
    """Objects for four levels of two platforms are compiled, one wheel is linked of them without Numba in reach."""
    pytest.importorskip("numba", reason="kernels are compiled by numba: pip install 'collide-robotics[jit]'")
    backend, _ = native
    if f"{sys.platform}-{platform.machine().lower()}" not in backend.EMITTED:
        pytest.skip(f"no objects travel for this platform: {', '.join(backend.EMITTED)}")
    tree = tmp_path / "checkout"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(tree)], check=True)
    asked = "import sys; sys.path.insert(0, 'native'); import backend; backend.{}('{}')"
    own = {name: value for name, value in os.environ.items() if not name.startswith("COLLIDE_")}

    def run(folder: Path, call: str, to: Path, **more: str) -> None:
        command = [sys.executable, "-c", asked.format(call, to)]
        done = subprocess.run(command, cwd=folder, env={**own, **more}, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]

    run(tree, "build_sdist", tmp_path)
    run(tree, "build_wheel", tmp_path / "of_checkout", COLLIDE_LEVELS="all")
    assert not (tree / "emitted").exists()
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        opened.extractall(tmp_path / "unpacked", filter="data")
    (unpacked,) = (tmp_path / "unpacked").iterdir()
    for name in ("numba", "llvmlite"):
        (tmp_path / "without" / name).mkdir(parents=True)
        (tmp_path / "without" / name / "__init__.py").write_text("raise ImportError('not to be had')", encoding="utf-8")
    run(unpacked, "build_wheel", tmp_path / "of_archive", PYTHONPATH=str(tmp_path / "without"))
    (one,), (two,) = ((tmp_path / place).glob("*.whl") for place in ("of_archive", "of_checkout"))
    assert one.name == two.name and one.read_bytes() == two.read_bytes()
