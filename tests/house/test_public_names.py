"""What a fresh interpreter says: start-up loads no compiler, names resolve, everything is documented."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys

import pytest
from house_sources import ROOT, is_type_checking, shown, sources, tree

import collide


def fresh(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=False, capture_output=True, text=True, timeout=60, cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("what", "code"),
    [
        ("import collide", "import collide"),
        ("shapes", "import collide; collide.Box((1, 2, 3)), collide.pose((0, 0, 1)), collide.InvalidShape"),
        ("scenes", "import collide.scenes; collide.scenes.shipped()"),
        ("adapters", "import collide.adapters.peers"),
        ("--help", "from collide.cli.main import main; assert main(['--help']) == 0"),
        ("report --help", "from collide.cli.main import main; assert main(['report', '--help']) == 0"),
        ("--version", "from collide.cli.main import main; assert main(['--version']) == 0"),
    ],
)
def test_start_up_loads_no_compiler(what, code):
    loaded = fresh(f"import sys\n{code}\nprint(*sys.modules, file=sys.stdout)").split()
    heavy = {"numba", "llvmlite", "rich", "trimesh", "yaml", "scipy", "yourdfpy", "coal", "fcl", "pybullet"}
    assert not heavy & set(loaded), f"{what} loads {sorted(heavy & set(loaded))}"


def test_importing_collide_imports_nothing_but_the_standard_library():
    assert "numpy" not in fresh("import sys, collide; print(*sys.modules)").split()


def test_public_names_resolve_and_are_documented():
    import collide.scenes

    for module in (collide, collide.scenes):
        assert inspect.getdoc(module)
        for name in module.__all__:
            value = getattr(module, name)
            assert name in dir(module)
            assert inspect.getdoc(value), f"{module.__name__}.{name} has no docstring"


def test_public_methods_are_documented():
    """In a docstring of their own, or, attributes, in that of their class."""
    for owner in (collide.World, collide.Robot, collide.PairResult, collide.WorldResult, collide.scenes.Scene):
        for name, value in vars(owner).items():
            if not name.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                told = inspect.getdoc(value) or re.search(rf"\b{name}\b", owner.__doc__)
                assert told, f"{owner.__name__}.{name} is described nowhere"


def test_names_in_all_are_the_lazy_ones():
    """`__init__` names everything three times (types, homes, __all__); they must agree."""
    init = tree(ROOT / "collide" / "__init__.py")
    checked = {
        alias.name
        for node in ast.walk(init) if isinstance(node, ast.If) and is_type_checking(node.test)
        for inner in node.body if isinstance(inner, ast.ImportFrom) and inner.module != "collide"
        for alias in inner.names
    }
    renamed = {own: name for name, (_, own) in collide._RENAMED.items()}
    assert {renamed.get(name, name) for name in checked} == set(collide.__all__) == {*collide._HOME, *collide._RENAMED}


def test_every_module_says_what_it_is():
    for file in [*sources(), *sources("native")]:
        assert ast.get_docstring(tree(file)), f"{shown(file)}: no docstring"


def test_types_are_shipped():
    assert (ROOT / "collide" / "py.typed").is_file()
