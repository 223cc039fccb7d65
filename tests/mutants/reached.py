"""A plugin of pytest that keeps which functions of the package each test calls, and how long the test takes.

    REACHED=FILE python -m pytest -p reached tests/worlds      # {test: [seconds, ["collide/worlds/world.py:pose", …]]}

Calls in other threads and processes are not seen.
"""

from __future__ import annotations

import json
import os
import sys
import time
from functools import cache
from pathlib import Path
from types import CodeType, FrameType

import pytest

import collide

PACKAGE = Path(collide.__file__).resolve().parents[1]
_reached: dict[str, tuple[float, list[str]]] = {}


@cache
def name_of(code: CodeType) -> str:
    """Of a function of the package, which a checkout may have as a link; else nothing."""
    file = Path(code.co_filename).resolve()
    return f"{file.relative_to(PACKAGE).as_posix()}:{code.co_name}" if file.is_relative_to(PACKAGE) else ""


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item):
    """Fixtures count for the test that makes them."""
    codes: set[CodeType] = set()

    def see(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            codes.add(frame.f_code)

    begun = time.process_time()
    sys.setprofile(see)
    try:
        return (yield)
    finally:
        sys.setprofile(None)
        names = {name for code in codes if (name := name_of(code))}
        _reached[item.nodeid] = time.process_time() - begun, sorted(names)


def pytest_sessionfinish() -> None:
    Path(os.environ["REACHED"]).write_text(json.dumps(_reached), encoding="utf-8")
