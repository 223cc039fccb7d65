"""A lock found open by a forked child: the thread of the parent holding the lock does not exist in the child."""

from __future__ import annotations

import os
import threading


class ForkSafeLock:
    """Called, gives the lock of this process: ``with lock(): ...``. A thread may take the lock more than once."""

    def __init__(self) -> None:
        self._renew()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._renew)

    def __call__(self) -> threading.RLock:  # type: ignore[valid-type]
        return self._lock

    def _renew(self) -> None:
        self._lock = threading.RLock()
