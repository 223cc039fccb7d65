"""Kinds of bodies to the narrowphase: the rows and columns of `narrowphase/dispatch.py`.

Kernels are made from these: no shape is imported. `kind_of_shape.py` tells a shape's kind.
"""

from __future__ import annotations

from enum import IntEnum

from collide.curved.shape_kinds import HALFSPACE, NUMBERS, POINTS


class Kind(IntEnum):
    """SPHERE, CAPSULE and POLYTOPE are one, two, or more points swept by a ball, whatever class they come from."""

    SPHERE = 0
    CAPSULE = 1
    POLYTOPE = 2
    ROUNDED = 3
    CYLINDER = 4
    CONE = 5
    ELLIPSOID = 6
    HALFSPACE = 7
    MESH = 8
    COMPOUND = 9
    MESH_COMPOUND = 10
    REGION = 11
    FIELD = 12


#: Kinds whose surface is that of a hull of doubles swept by a ball, or a mesh: `facet_bodies.body_of` serves them.
WITH_FACETS = frozenset((Kind.SPHERE, Kind.CAPSULE, Kind.POLYTOPE, Kind.MESH))
#: Kinds that are no points, by the numbers that kernels know them by.
OF_NUMBER = {number: Kind[name] for name, number in NUMBERS.items() if number != POINTS}
#: Kinds of curved sets: `curved/curved_kinds.py` has the same.
CURVED_KINDS = frozenset(kind for number, kind in OF_NUMBER.items() if number != HALFSPACE)
