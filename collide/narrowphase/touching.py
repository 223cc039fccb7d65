"""The rule for touching bodies, closed sets: a hit. For facets `facets/collide_kernel.py` decides touching exactly."""

from __future__ import annotations

from collide.kernels import kernel


@kernel(inline=True)
def touching_is_a_hit(lower):
    """1 unless bodies are proven to be apart, by a lower bound of their distance: closed sets that touch share a point,
    and an open sign counts as a hit."""
    return 0 if lower > 0.0 else 1
