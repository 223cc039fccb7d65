"""How deep two overlapping bodies are, as far as is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Depth(NamedTuple):
    """length : of a translation as computed.   proven : upper bound of its length.   normal : (3,) its direction.
    least : proven lower bound of the length of every translation that parts the bodies [m]."""

    length: float
    proven: float
    normal: np.ndarray
    least: float

    def at_least(self, least: float) -> Depth:
        """The same with a lower bound of ``least`` [m], or of the one known, where this is larger."""
        return self._replace(least=min(max(self.least, least), self.proven))
