"""The library's log of its own work, ``logging.getLogger("collide")``: slow work behind a call.

INFO: kernels compiled or loaded, trees, surveys, hulls and tables made, each with its size and seconds. WARNING: faults
for a person to look at, for example an unusable cache. Quiet by default: without a handler Python prints warnings
alone. ``logging.basicConfig(level=logging.INFO)`` shows the rest.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

log = logging.getLogger("collide")


@contextmanager
def log_duration(what: str, *sizes: int) -> Iterator[None]:
    """Say what was made within, and how long it took. what : a format of the sizes, as logging has them."""
    started = time.perf_counter()
    yield
    log.info(f"{what}: %.3f s", *sizes, time.perf_counter() - started)
