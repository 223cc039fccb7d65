"""Tools that check types find collide's types in an editable install, without running the code that finds modules."""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
USER = """import collide
from collide.adapters import view
r = collide.distance(collide.Box((1, 1, 1)), collide.Sphere(1.0), collide.pose(), collide.pose())
reveal_type(r)
reveal_type(view)
collide.Box(half=1)
"""


@pytest.fixture(scope="module")
def editable_types():
    sys.path.insert(0, str(ROOT / "native"))
    try:
        import editable_types
    finally:
        sys.path.remove(str(ROOT / "native"))
    return editable_types


@pytest.fixture
def checkout(tmp_path) -> Path:
    """A folder whose parts are this checkout's."""
    root = tmp_path / "checkout"
    root.mkdir()
    for name in ("collide", "adapters", "scenes"):
        (root / name).symlink_to(ROOT / name)
    return root


pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="links are not made on Windows")


def test_the_wheel_gets_a_path_file_and_says_so(editable_types, checkout, tmp_path):
    wheel = tmp_path / "made.whl"
    with zipfile.ZipFile(wheel, "w") as made:
        made.writestr("x.dist-info/RECORD", "a.pth,,\n")
        made.writestr("a.pth", "import a")
    editable_types.add_types(wheel, checkout)
    with zipfile.ZipFile(wheel) as made:
        line, record = made.read("__collide_types__.pth"), made.read("x.dist-info/RECORD").decode()
        assert made.read("a.pth") == b"import a" and made.testzip() is None
    folder = Path(line.decode().strip())
    assert folder == checkout / "build" / "typing" and (folder / "collide-stubs" / "__init__.pyi").exists()
    digest = base64.urlsafe_b64encode(hashlib.sha256(line).digest()).rstrip(b"=").decode()
    assert record == f"a.pth,,\n__collide_types__.pth,sha256={digest},{len(line)}\n"
    assert (folder / "collide-stubs" / "adapters" / "viewers" / "viewed.py").exists()
    assert (folder / "collide-stubs" / "py.typed").exists()


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")
def test_mypy_reads_them(editable_types, checkout, tmp_path):
    home = tmp_path / "environment"
    venv.create(home, with_pip=False, symlinks=True)
    places = sysconfig.get_paths(vars={"base": str(home), "platbase": str(home)})
    site = Path(places["purelib"])
    (site / "types.pth").write_text(f"{editable_types.link_tree(checkout)}\n")
    (tmp_path / "user.py").write_text(USER)
    options = ["--python-executable", str(home / "bin" / "python"), "--ignore-missing-imports"]
    command = [sys.executable, "-m", "mypy", *options, "user.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "PairResult" in done.stdout and "WorldViewer" in done.stdout, done.stdout + done.stderr
    assert 'Unexpected keyword argument "half" for "Box"' in done.stdout and "Found 1 error in 1 file" in done.stdout
