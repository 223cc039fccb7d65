"""What programs expect of python-fcl and of trimesh's CollisionManager holds for both, python-fcl and its stand-in.

That the expectations are those of python-fcl itself is asked of it in a child process; so is trimesh, which keeps the
fcl that it finds first, and hides an import that fails.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from collide.adapters.hosts import fcl_api

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import fcl_expectations as expected

HAS = {name: importlib.util.find_spec(name) is not None for name in ("fcl", "trimesh")}


def child(code: str) -> None:
    code = f"import sys; sys.path.insert(0, {str(HERE)!r}); import fcl_expectations as expected\n{code}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and done.stdout.endswith("all held\n"), done.stderr


@pytest.mark.parametrize("expectation", expected.FCL, ids=lambda function: function.__name__)
def test_ours_does_what_is_expected(expectation):
    expectation(fcl_api)


@pytest.mark.skipif(not HAS["fcl"], reason="python-fcl is not installed")
def test_python_fcl_does_what_is_expected():
    child("import fcl\nfor function in expected.FCL:\n    function(fcl)\nprint('all held')")


@pytest.mark.slow
@pytest.mark.skipif(not HAS["trimesh"], reason="trimesh is not installed")
@pytest.mark.parametrize("engine", ["ours", "python-fcl"])
def test_trimesh_does_what_is_expected(engine):
    if engine == "python-fcl" and not HAS["fcl"]:
        pytest.skip("python-fcl is not installed")
    install = "from collide.adapters.hosts import fcl_api; fcl_api.install()" if engine == "ours" else ""
    name = "collide.adapters.hosts.fcl_api" if engine == "ours" else "fcl"
    child(f"""{install}
import trimesh, trimesh.collision
assert trimesh.collision.fcl.__name__ == {name!r}, trimesh.collision.fcl
for function in expected.TRIMESH:
    function(trimesh)
print('all held')""")
