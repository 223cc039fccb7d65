from __future__ import annotations

import sys
from pathlib import Path

import pytest

import collide
from collide.narrowphase import convex_kernel_calls


@pytest.fixture(autouse=True)
def without_integers_of_python(monkeypatch):
    """C has the kernels' answers. What kernels leave open of curved pairs Python goes on to decide by itself: not here,
    where bytes are compared (docs/c-interface.md); `test_open_pairs.py` looks at the difference."""
    monkeypatch.setattr(convex_kernel_calls, "settle_curved", lambda *arguments: None)


@pytest.fixture
def folder(tmp_path):
    """A fresh folder, with the command `collide` of this installation in its ``bin``, for the lines of a shell."""
    command = tmp_path / "bin" / "collide"
    command.parent.mkdir()
    root = Path(collide.__file__).parents[1]
    command.write_text(f'#!/bin/sh\nPYTHONPATH="{root}" exec "{sys.executable}" -m collide "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    return tmp_path
