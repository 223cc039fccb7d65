"""A lock that a forked child finds open: the thread of the parent that may hold it does not exist there."""

from __future__ import annotations

import os
import threading


class ForkSafeLock:
    """Called, it gives the lock of this process: ``with lock(): ...``. One thread may take it more than once."""

    def __init__(self) -> None:
        self._renew()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._renew)

    def __call__(self) -> threading.RLock:  # type: ignore[valid-type]
        return self._lock

    def _renew(self) -> None:
        self._lock = threading.RLock()
