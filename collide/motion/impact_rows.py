"""Rows of first contacts, as kernels write them."""

from __future__ import annotations

import numpy as np

#: One row a motion: bracket of the first contact, normal and points in W [m]; which parts meet; questions to GJK; how
#: the search ended (`convex_impact.py`).
IMPACT_DTYPE = np.dtype(
    [
        ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point_a", "f8", 3), ("point_b", "f8", 3),
        ("part_a", "<i4"), ("part_b", "<i4"), ("queries", "<i4"), ("status", "<i4"),
    ],
    align=True,
)  # fmt: skip
