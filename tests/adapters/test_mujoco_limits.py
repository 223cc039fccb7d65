"""How many contacts of a pair MuJoCo takes: as its own functions make them, and asked of another process."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

from collide.errors import UnsupportedQuery

mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from collide.adapters.hosts import mujoco_limits
from collide.adapters.hosts.mujoco_layout import KINDS, OURS, host


def test_limits_are_known_for_all_kinds_that_are_ours():
    counts = mujoco_limits.max_contacts((0, 0))
    for i in OURS:
        for j in OURS:
            wanted = i <= j and KINDS[j] not in ("plane", "hfield")
            most = 50 if KINDS[i] == "hfield" else 8
            assert (1 <= counts[i, j] <= most) == wanted, (KINDS[i], KINDS[j], counts[i, j])
    assert counts[KINDS.index("hfield"), KINDS.index("sphere")] == mujoco.mjMAXCONPAIR == 50
    assert counts[KINDS.index("box"), KINDS.index("box")] == 8
    assert counts[KINDS.index("plane"), KINDS.index("sphere")] == 1
    everything = mujoco_limits.max_contacts((-1, -1))
    assert everything.shape == counts.shape and (everything >= 0).all()


def test_nothing_is_provoked_in_this_process(monkeypatch):
    """The call that MuJoCo refuses runs in the child alone."""
    if not host().has_limits:
        pytest.skip(f"MuJoCo {mujoco.__version__} sets no limits")
    monkeypatch.setattr(mujoco_limits, "_limit", lambda *_: pytest.fail("asked in this process"))
    assert np.array_equal(mujoco_limits._all_limits.__wrapped__()[False, False], mujoco_limits.max_contacts((0, 0)))


def test_a_version_that_does_not_tell_is_refused(monkeypatch):
    if not host().has_limits:
        pytest.skip(f"MuJoCo {mujoco.__version__} sets no limits")

    def fails(command, **options):
        raise subprocess.CalledProcessError(1, command, stderr="Traceback\nUnsupportedQuery: of nothing")

    monkeypatch.setattr(mujoco_limits.subprocess, "run", fails)
    with pytest.raises(UnsupportedQuery, match=r"is not reported \(Unsupp.*of nothing"):
        mujoco_limits._all_limits.__wrapped__()
