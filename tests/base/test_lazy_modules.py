"""Modules that are named early and loaded late."""

from __future__ import annotations

import subprocess
import sys

import pytest

from collide.base.lazy_modules import lazy_module


@pytest.fixture
def module_on_path(tmp_path, monkeypatch):
    (tmp_path / "loaded_late.py").write_text("answer = 42\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield "loaded_late"
    sys.modules.pop("loaded_late", None)


def test_a_module_is_loaded_when_an_attribute_is_used(module_on_path):
    late = lazy_module("loaded_late")
    assert module_on_path not in sys.modules
    assert late.answer == 42 and module_on_path in sys.modules
    sys.modules[module_on_path].answer = 43
    assert late.answer == 43, "it is the module itself that is asked, every time"


def test_what_is_not_there_says_so(module_on_path):
    with pytest.raises(AttributeError, match="question"):
        _ = lazy_module("loaded_late").question
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        _ = lazy_module("no_such_module").answer


def test_documented_names_work_after_import_collide():
    """And `import collide` loads none of them: what is documented by a path is found when it is named."""
    code = (
        "import sys, collide\n"
        "assert not [name for name in sys.modules if name.startswith(('collide.scenes', 'collide.adapters'))]\n"
        "assert 'numpy' not in sys.modules\n"
        "print(collide.scenes.load('workcell').name, collide.adapters.view.__name__, collide.adapters.peers.__name__)\n"
        "print(collide.adapters.hosts.mujoco.install.__name__, collide.adapters.hosts.fcl_api.install.__name__)\n"
        "for owner, name in ((collide, 'skenes'), (collide.adapters, 'vue'), (collide.adapters.hosts, 'mujoko')):\n"
        "    try: getattr(owner, name)\n"
        "    except AttributeError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[:2] == ["workcell view collide.adapters.peers", "install install"] and len(lines) == 5
