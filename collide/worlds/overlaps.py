"""How much bodies of a World overlap: volumes, centroids, areas of every pair of solids that hits.

=============== ===================================================================================
a, b            ids of the bodies, a < b
volume          of what is inside both [m³]
lower, upper    lower ≤ volume ≤ upper, proven
centroid        (3,) of the overlap in W [m]; of the patch where the volume is 0
area_a, area_b  of a's surface inside b, and of b's inside a [m²]
patch_area      of where both surfaces lie on each other and face each other [m²]
flush_area      of where they lie on each other and face the same way [m²]
=============== ===================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from collide.errors import InvalidArgument, UnsupportedQuery
from collide.results import with_columns
from collide.solids.overlap_volume import overlap_volume
from collide.worlds.packed_world import PackedWorld

OVERLAP_DTYPE = np.dtype(
    [
        ("volume", "f8"), ("lower", "f8"), ("upper", "f8"), ("centroid", "f8", 3), ("area_a", "f8"), ("area_b", "f8"),
        ("patch_area", "f8"), ("flush_area", "f8"), ("a", "i4"), ("b", "i4"),
    ],
    align=True,
)
_FIELDS = ("volume", "lower", "upper", "centroid", "area_a", "area_b", "patch_area", "flush_area")


@with_columns(OVERLAP_DTYPE)
class WorldOverlaps:
    """Rows of `World.overlaps`, sorted by (a, b).

    Parameters
    ----------
    rows : (n,) `OVERLAP_DTYPE`, as the module `collide.worlds.overlaps` says.
    bodies : {id: body at the time of the query}.
    unanswered : [(id, id, reason), …] hits without a volume to tell: curved shapes, surfaces, unions.

    Notes
    -----
    Indexing by the name of a field gives a column, by a number a row, by a slice or a mask rows. ``names``
    resolves the ids.
    """

    __slots__ = ("_bodies", "rows", "unanswered")

    def __init__(self, rows: np.ndarray, bodies: Mapping, unanswered: list[tuple[int, int, str]]):
        self.rows, self._bodies, self.unanswered = rows, bodies, unanswered

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, key):
        return self.rows[key]

    @property
    def names(self) -> list[tuple]:
        """The names of both bodies, row by row."""
        return [(self._bodies[a].name, self._bodies[b].name) for a, b in self.rows[["a", "b"]].tolist()]

    def __repr__(self) -> str:
        return f"WorldOverlaps({len(self)} rows, {len(self.unanswered)} unanswered)"


def overlaps_of(packed: PackedWorld, threads: int) -> WorldOverlaps:
    """The overlaps of all tested pairs that hit."""
    candidates = packed.candidates(0.0)
    shapes, X_WBs, ids = packed.roster.shapes, packed.X_WBs, packed.roster.ids.tolist()
    rows, unanswered = [], []
    for k, (a, b) in enumerate(candidates.tolist()):
        try:
            overlap = overlap_volume(shapes[a], shapes[b], X_WBs[a], X_WBs[b], check_poses=False)
        except (InvalidArgument, UnsupportedQuery) as error:
            answer = packed.answer(candidates[k : k + 1], 0.0, boolean=True, stop_at_hit=False, threads=threads)
            if answer.rows["hit"].any():
                unanswered.append((ids[a], ids[b], str(error)))
            continue
        if overlap.n_meeting or overlap.volume > 0.0:
            rows.append((*(getattr(overlap, name) for name in _FIELDS), ids[a], ids[b]))
    table = np.array(rows, dtype=OVERLAP_DTYPE)
    table = table[np.lexsort((table["b"], table["a"]))]
    return WorldOverlaps(table, packed.bodies_named(candidates.ravel()), sorted(unanswered))
