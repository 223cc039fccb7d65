"""A lock found open by a forked child: the thread of the parent holding the lock does not exist in the child."""

from __future__ import annotations

import os
import threading
import weakref

#: Locks that a child is to find open.
_locks: weakref.WeakSet[ForkSafeLock] = weakref.WeakSet()


class ForkSafeLock:
    """Called, gives the lock of this process: ``with lock(): ...``; ``lock.now`` is the same without the call. A thread
    may take the lock more than once. A pickle or copy is another lock, open.
    """

    def __init__(self) -> None:
        self.renew()
        _locks.add(self)

    def __call__(self) -> threading.RLock:  # type: ignore[valid-type]
        return self.now

    def __reduce__(self):
        return ForkSafeLock, ()

    def renew(self) -> None:
        self.now = threading.RLock()


def _renew_all() -> None:
    for lock in _locks:
        lock.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)
