"""Stub engines under names that children know, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from collide.adapters.peers import protocol

STUBS = {
    "stub": "Honest", "large_boxes": "LargeBoxes", "cones_abort": "ConesAbort", "ellipsoids_hang": "EllipsoidsHang",
    "spheres_nan": "SpheresNaN", "raises": "Raises",
    "exchanges_points": "ExchangesPoints",
}


@pytest.fixture
def stubs(monkeypatch) -> None:
    """The engines of `stub_engines`, by the keys of `STUBS`; ``sys.path`` goes to children."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    for name, kind in STUBS.items():
        monkeypatch.setitem(protocol.ENGINES, name, f"stub_engines:{kind}")
