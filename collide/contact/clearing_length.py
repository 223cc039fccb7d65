"""Lengths of translations proven to clear overlapping facets of each other."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.contact.contact_pairs import N_REACHED
from collide.contact.contact_points import see_pair
from collide.contact.shallow_overlaps import STEP_ERRORS
from collide.kernels import kernel, view_f64, view_i64
from collide.mesh.box_overlap import PROBE
from collide.mesh.bvh import open_tree
from collide.narrowphase.facets.exact_corners import CORNERS
from collide.narrowphase.facets.facets_within import FACET_A, FACET_B, INTS_OF_PAIR
from collide.narrowphase.facets.posed_surfaces import (
    PLACING,
    put_in_frame_of_a,
    put_in_world,
    shift_between,
)
from collide.narrowphase.facets.posed_trees import facets_meet, pose_trees
from collide.narrowphase.facets.triangle_distance import nearest_points, separated_by
from collide.numerics.vec3 import Vec3, norm1, scale

#: Workspace: two poses, two triangles, two points, a counter.
CLEARING_WORDS = 32 + 18 + 6 + 2


class Clearing(NamedTuple):
    """Who is moved, and what for.

    tree_a, tree_b, XA, XB : addresses.   exact, doubles, integers : addresses of the exact stage and its workspace.
    words : address of CLEARING_WORDS.   radius : of both bodies [m].   error : of a coordinate [m].
    """

    tree_a: int
    tree_b: int
    XA: int
    XB: int
    exact: int
    doubles: int
    integers: int
    words: int
    radius: float
    error: float


@kernel
def clearing_length(pairs, A, B, axes, depth, clearing, seen):
    """A length [m] along the normal; B moved by the length is proven to clear all REACHED pairs; infinite if not known.

    Proven of the poses with the translation ``X_WB[:3, 3] + length * n``, as doubles add up, and of A moved against n
    as well. Swept bodies are clear where their cores are farther apart than both radii.
    """
    for attempt in range(6):
        factor = 1.0
        if attempt == 1:
            factor = 1.0 + 2.0**-20
        elif attempt == 2:
            factor = 1.0 + 2.0**-7
        elif attempt == 3:
            factor = 1.25
        elif attempt > 3:
            factor = 2.0 * (attempt - 3)
        length = max(depth, 0.0) * factor + STEP_ERRORS * clearing.error
        if _slabs_part(pairs, axes, length, clearing, seen) or (
            _facets_part(pairs, A, B, axes, length, clearing, False)
            and _facets_part(pairs, A, B, axes, length, clearing, True)
        ):
            return length
    return math.inf


@kernel
def _slabs_part(pairs, axes, length, clearing, seen):
    """Whether slabs across the normal part all pairs after a translation: rounding of seven terms is counted in."""
    wanted = clearing.radius - length + 8.0 * clearing.error
    for i in range(pairs.search[N_REACHED]):
        least, _ = see_pair(pairs, pairs.queue[i], axes, seen)
        if not least > wanted:
            return False
    return True


@kernel
def _facets_part(pairs, A, B, axes, length, clearing, move_a):
    """Whether no REACHED pair meets, nor their radii, after B is moved along the normal, or A against it; exactly."""
    moved = view_f64(clearing.words, 32)
    XA, XB = view_f64(clearing.XA, 16), view_f64(clearing.XB, 16)
    for i in range(16):
        moved[i] = XA[i]
        moved[16 + i] = XB[i]
    step = scale(-length if move_a else length, axes.nhat)
    first = 0 if move_a else 16
    moved[first + 3] += step.x
    moved[first + 7] += step.y
    moved[first + 11] += step.z
    trees, invertible = pose_trees(
        open_tree(clearing.tree_a), clearing.words, open_tree(clearing.tree_b), clearing.words + 128, clearing.doubles,
        clearing.doubles + 8 * (PLACING + CORNERS), PROBE, clearing.integers, clearing.exact,
    )
    if not invertible:
        return False
    triangles = view_f64(clearing.words + 256, 18)
    points = view_f64(clearing.words + 400, 6)
    counters = view_i64(clearing.words + 448, 2)
    shift = shift_between(trees.XA, trees.XB)
    error = clearing.error + 2.0**-50 * (norm1(step) + norm1(shift))
    for i in range(pairs.search[N_REACHED]):
        k = pairs.queue[i]
        a = int(A.places[pairs.facets[INTS_OF_PAIR * k + FACET_A]])
        b = int(B.places[pairs.facets[INTS_OF_PAIR * k + FACET_B]])
        put_in_frame_of_a(trees.placing, trees.B.triangles, 9 * b, trees.corners, 9)
        if facets_meet(trees, a, b, counters, 0):
            return False
        if clearing.radius > 0.0:
            put_in_world(trees.XA, Vec3(0.0, 0.0, 0.0), trees.A.triangles, 9 * a, triangles, 0)
            put_in_world(trees.XB, shift, trees.B.triangles, 9 * b, triangles, 9)
            if not separated_by(triangles, clearing.radius + 8.0 * error):
                least, width = nearest_points(triangles, points)
                if not min(least, width) > clearing.radius + 8.0 * error:
                    return False
    return True
