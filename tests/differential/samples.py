"""How many cases a differential test takes: a small sample with every run of the suite, a large one where asked for.

    python -m pytest tests/differential/test_coal.py -m slow -s                        # the sample of the page
    COLLIDE_DIFFERENTIAL=100000 python -m pytest tests/differential/test_coal.py -m slow -s

What differs between an engine and collide is counted, printed (-s shows it), and judged by oracles that share no code
with the engine. A test fails where a judge finds collide wrong, and names the case.
"""

from __future__ import annotations

import os
from collections import Counter

import pytest


def sizes(small: int, large: int):
    """Parametrises ``n``."""
    asked = int(os.environ.get("COLLIDE_DIFFERENTIAL", large))
    return pytest.mark.parametrize("n", [small, pytest.param(asked, marks=pytest.mark.slow)])


def told(title: str, counts: Counter) -> None:
    """Print counts, by what stands in their keys."""
    print(f"\n{title}")
    for key, count in sorted(counts.items(), key=str):
        print(f"  {' | '.join(map(str, key)) if isinstance(key, tuple) else key}: {count}")
