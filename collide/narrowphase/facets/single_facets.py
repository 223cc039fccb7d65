"""Signed distances of single facets, as flat convex sets: facet and convex set, or two facets.

Engines without depths of whole meshes use these depths for contacts: the length of the shortest translation of a facet
out of a solid, or out of another facet. The depth of the whole mesh is never less (`separating_translation.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from struct import Struct
from typing import TYPE_CHECKING

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.kernels import address_of
from collide.kernels.prepared import prepared_row
from collide.lowering.packed_convex import BLOCK, PackedConvex, on_cache_lines, pack_points
from collide.lowering.parts import convex_set_of
from collide.lowering.set_rows import ADDRESS
from collide.lowering.shape_table import ShapeTable
from collide.narrowphase.convex_kernel_calls import space_of_single_calls
from collide.narrowphase.facets.single_facet_kernel import FACET, distance_single_facets
from collide.narrowphase.rows import ROW
from collide.shapes.shape import Shape, kept_with_shape

if TYPE_CHECKING:
    from collide.shapes.mesh import Mesh

_NO_ROW, _words_of = bytes(ROW), Struct(f"={2 * FACET}q").pack


class SingleFacets:
    """Facets of bodies A, each with a convex set, or with facets of bodies B: what kernels read, and write into."""

    def __init__(self, *solid: PackedConvex):
        n_facets = 2 - len(solid)
        corners = [pack_points(np.eye(3)) for _ in range(n_facets)]
        self._table = ShapeTable([*corners, *solid])
        self._columns = on_cache_lines(n_facets, 3 * BLOCK)
        self._space = space_of_single_calls()
        for side in range(n_facets):
            self._table.ints[side, ADDRESS] = address_of(self._columns[side])
        if not self._table.is_built:
            self._table.build_trees(np.arange(2))
        header = np.append(self._space.header_of(self._table), n_facets)
        self._ask = prepared_row(distance_single_facets, header)

    def distance(self, X_WA: np.ndarray, X_WB: np.ndarray, A: Mesh, i: int, B: Mesh | None = None, j: int = 0):
        """The signed distance of facet i of mesh A, and facet j of mesh B, in a bytearray whose beginning is a row of
        `PAIR_DTYPE`; ``None`` where the answer takes more than one call of a kernel.   O(log n) in the points of the
        convex set.
        """
        of_b = (0, 0) if B is None else (address_of(B.vertices), address_of(B.faces))
        words = _words_of(address_of(A.vertices), address_of(A.faces), i, *of_b, j)
        memory = bytearray(_NO_ROW + words)
        return None if self._ask(X_WA, X_WB, memory, True, math.inf) is None else memory


@workspace_under_lock
def two_facets() -> SingleFacets:
    """Facets with facets."""
    return SingleFacets()


def facets_with(solid: Shape) -> SingleFacets:
    """Facets with a shape that is a single convex set."""
    return _facets_with(solid)()


@kept_with_shape("_single_facets")
def _facets_with(solid: Shape) -> Callable[[], SingleFacets]:
    convex = convex_set_of(solid)
    return workspace_under_lock(lambda: SingleFacets(convex))
