"""Modules that are named early and loaded late."""

from __future__ import annotations

import sys

import pytest

from collide.lazy_modules import lazy_module


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
