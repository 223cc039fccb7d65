"""A result that claims a boolean with a certificate, true or not: what `collide.verify` is asked about."""

from __future__ import annotations

from typing import Any, NamedTuple


class Claim(NamedTuple):
    hit: bool
    certificate: Any

    def __len__(self) -> int:
        return 1
