"""What casts against a World return: rows with the ids of bodies, and who these are.

=============== ===================================================================================
ray             number of the ray, cast or point of the question
body            id of the body met, −1 where nothing is
item            number of its part, of a Compound; 0 otherwise, −1 where nothing is met
facet           as of `collide.raycast`; −1 for polytopes and swept hulls, for casts and for nearest bodies
hit             whether anything is met, or there is a body
distance        t of the place where it is met, in lengths of the direction; of nearest bodies the signed distance [m];
                inf where nothing is met
lower, upper    lower ≤ truth ≤ upper, proven where ``certified``
point           (3,) in W [m], of the body; zeros where nothing is met
normal          (3,) unit vector in W: outward from the body for rays, from what is cast, or the point, to the body for
                others; zeros where nothing is met, and of casts at_start unless start_normals are asked for
certified       as of `collide.raycast`, `collide.shape_cast` and `collide.distance`
at_start        of casts: whether they touch before they move
=============== ===================================================================================
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from collide.casts.ray_hits import WORLD_HIT_DTYPE
from collide.results import with_columns
from collide.worlds.bodies import Roster


def empty_hits(n: int) -> np.ndarray:
    """Rows of n questions that meet nothing; bodies are positions, or ids, alike."""
    rows = np.zeros(n, dtype=WORLD_HIT_DTYPE)
    rows["ray"] = np.arange(n)
    rows["body"] = rows["item"] = rows["facet"] = -1
    rows["distance"] = rows["lower"] = rows["upper"] = np.inf
    rows["certified"] = True
    return rows


@with_columns(WORLD_HIT_DTYPE)
class WorldHits:
    """Rows of a cast against a World: a row a question, or with ``all_hits`` a row for each place on a ray.

    Parameters
    ----------
    rows : (n,) `WORLD_HIT_DTYPE`, as the module `collide.worlds.hits` says.
    roster : the bodies, for their names.
    starts : (N + 1,) where the rows of each ray begin and end, with ``all_hits``; ``None`` otherwise.

    Notes
    -----
    Every field is an attribute, a column. Indexing by the name of a field gives the column, by a number a row, by a
    slice or a mask rows. ``names`` are the names of the bodies row by row, ``None`` where nothing is met.
    """

    __slots__ = ("_roster", "rows", "starts")

    if TYPE_CHECKING:
        distance: np.ndarray
        lower: np.ndarray
        upper: np.ndarray
        normal: np.ndarray
        point: np.ndarray
        ray: np.ndarray
        body: np.ndarray
        item: np.ndarray
        facet: np.ndarray
        hit: np.ndarray
        certified: np.ndarray
        at_start: np.ndarray

    def __init__(self, rows: np.ndarray, roster: Roster, starts: np.ndarray | None = None):
        self.rows, self._roster, self.starts = rows, roster, starts

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self.rows)

    def __getitem__(self, key):
        return self.rows[key]

    def __repr__(self) -> str:
        return f"WorldHits({len(self.rows)} rows, {int(self.rows['hit'].sum())} of them hits)"

    @property
    def names(self) -> list[str | None]:
        """Names of the bodies, row by row; None where nothing is met."""
        ids, names = self._roster.ids, self._roster.names
        bodies = self.rows["body"]
        return [None if b < 0 else names[k] for b, k in zip(bodies.tolist(), np.searchsorted(ids, bodies).tolist())]
