"""What tests of hosts share."""

from __future__ import annotations

import pytest


@pytest.fixture
def client():
    """A client of pybullet without a window, disconnected afterwards."""
    p = pytest.importorskip("pybullet", reason="pybullet is not installed")
    number = p.connect(p.DIRECT)
    yield number
    if p.isConnected(number):
        p.disconnect(number)
