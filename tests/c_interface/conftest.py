from __future__ import annotations

import pytest

from collide.narrowphase import convex_kernel_calls


@pytest.fixture(autouse=True)
def without_integers_of_python(monkeypatch):
    """C has the kernels' answers. What kernels leave open of curved pairs Python goes on to decide by itself: not here,
    where bytes are compared (docs/c-interface.md); `test_open_pairs.py` looks at the difference."""
    monkeypatch.setattr(convex_kernel_calls, "settle_curved", lambda *arguments: None)
