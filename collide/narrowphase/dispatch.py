"""Which method answers which pair of convex sets: the pair matrix, one half and its mirror.

                 point   segment   points   cylinder   cone   ellipsoid   half-space
    point          C        C         G         G        G        G            H
    segment                 C         G         G        G        G            H
    points                            G         G        G        G            H
    cylinder                                    G        G        G            H
    cone                                                 G        G            H
    ellipsoid                                                     G            H
    half-space                                                                 P

    C  capsule_capsule.py    closed form (a sphere is a point, a capsule a segment, each swept)
    H  halfspace_convex.py   closed form, one support query
    P  halfspaces.py         two planes
    G  gjk.py, and epa.py where the cores overlap; small hulls go through small_hulls.py first, unless depths are wanted

Every set may be swept by a ball. Bodies of several sets are unions: `collide.narrowphase.composite.composite` combines the
rows. Triangle meshes are answered over their box-trees (`collide.meshes`), their triangles one by one.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.lowering.packed_convex import HALFSPACE, POINTS

CAPSULES, HALFSPACE_CONVEX, HALFSPACES, CONVEX = range(4)


@kernel(inline=True)
def method(kind_a, n_a, kind_b, n_b):
    """CAPSULES, HALFSPACE_CONVEX, HALFSPACES or CONVEX; a half-space stands first."""
    if kind_a == HALFSPACE:
        return HALFSPACES if kind_b == HALFSPACE else HALFSPACE_CONVEX
    if kind_a == POINTS and kind_b == POINTS and n_a <= 2 and n_b <= 2:
        return CAPSULES
    return CONVEX
