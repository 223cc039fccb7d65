"""A small body on its way past a large mesh: the facets near the way, and a lower bound of the first contact.

As seen from the mesh's body, the origin of a piece of the small body is at z = Rot_Lᵀ w, w = d + Rot_S a: d leads from
the mesh body's origin to the small body's and changes by v in unit time, a from the small body's origin to its piece's.
Since z″ = Rot_Lᵀ (w″ − 2 ω_L × w′ + ω_L × (ω_L × w)), its acceleration is at most

    K = |ω_S|² |a| + 2 |ω_L| (|v| + |ω_S| |a|) + |ω_L|² (|d| + |a|),

and in a span of length h the origin is within K h² / 8 of the chord between its places at both ends. The chord swept by
a ball of radius K h² / 8 plus the piece's reach holds the piece all the time: facets outside are free in the span. The
ball in which the piece moves (`span_bounds.py`) holds all facets as near as the way is long.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.lowering.facet_bodies import as_given
from collide.lowering.facet_table import Facets
from collide.lowering.packed_convex import pack_points
from collide.lowering.shape_table import RANK, SLOP, ShapeTable
from collide.mesh.bvh import MeshTree
from collide.motion.convex_motions import Tables, earliest_of, header_of
from collide.motion.impact_jobs import find_impacts
from collide.motion.impact_rows import free_rows
from collide.motion.moving_body import ANGLE, ARM, AXIS, DRIFT_REACH, REACH_OF_CORE
from collide.motion.parts_ahead import Spans
from collide.narrowphase.facets.near_facets import near_facets_up_to
from collide.numerics.frames import frame_along

#: More than rounding of poses, of all lengths and angles that they are made of.
_ROUNDING = 2.0**-40


def facets_on_path(
    spans: Spans, tree: MeshTree, side: int, begin: float, end: float, max_facets: int
) -> np.ndarray | None:
    """(k,) facets of a mesh near the other piece's way in a span of time; None for more than about
    ``max_facets``, or where the piece may leave the chord by more than its reach.

    spans : of a mesh, its ``side`` 0 or 1, and the other piece.   tree : of the mesh.
    """
    (X_M, start), (_, stop) = (_seen_from(spans, side, time) for time in (begin, end))
    large, small = spans.bodies[side], spans.bodies[1 - side]
    w_l, w_s, h = large[ANGLE], small[ANGLE], end - begin
    way = max(float(np.linalg.norm(spans.between_origins(time))) for time in (begin, end))
    arm = float(np.linalg.norm(small[ARM : ARM + 3]))
    reach = small[REACH_OF_CORE] - arm
    speed = float(np.linalg.norm(spans.between_origins(1.0) - spans.between_origins(0.0)))
    acceleration = w_s * w_s * arm + 2.0 * w_l * (speed + w_s * arm) + w_l * w_l * (way + arm)
    off_chord = acceleration * h * h / 8.0
    if off_chord > reach:
        return None
    size = (1.0 + w_l + w_s) * (way + speed + small[REACH_OF_CORE] + large[REACH_OF_CORE])
    drift = 2.0 * (large[DRIFT_REACH] + small[DRIFT_REACH])
    radius = reach + off_chord + drift + float(spans.reaches[2]) + _ROUNDING * size
    chord = _turned(stop, large[AXIS : AXIS + 3], -w_l * h) - start
    length = float(np.linalg.norm(chord))
    X_C = np.eye(4)
    X_C[:3, :3], X_C[:3, 3] = frame_along(chord / length if length > 0.0 else X_M[:3, 0]).T, start
    segment = pack_points(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]))
    at = as_given(X_M[None]), as_given(X_C[None]), np.zeros((1, 3))
    near = near_facets_up_to(tree, segment, *at, radius, max_facets)
    return None if near is None else np.unique(tree.ids[near.place])


def _seen_from(spans: Spans, side: int, time: float) -> tuple[np.ndarray, np.ndarray]:
    """(pose (4, 4) of the mesh of a side, (3,) the origin of the other piece) at a time, from the origin of the mesh's
    body."""
    matrices = spans.describe(time, time)[:32].reshape(2, 4, 4).copy()
    if side == 1:  # A's body is where they are from
        matrices[:, :3, 3] -= spans.between_origins(time)
    return matrices[side], matrices[1 - side, :3, 3]


def _turned(p: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """A vector (3,) turned about a unit vector (Rodrigues)."""
    return np.cos(angle) * p + np.sin(angle) * np.cross(axis, p) + (1.0 - np.cos(angle)) * (axis @ p) * axis


def earliest_by_facets(
    spans: Spans, corners: np.ndarray, slop: float, side: int, movers: tuple[ShapeTable, np.ndarray, np.ndarray],
    span: tuple[float, float], tolerance: float,
) -> np.ndarray:
    """(n,) times before which convex sets have no contact with any of some facets: infinity without contact in the
    span.

    spans : of the mesh, its ``side`` 0 or 1, whose row of parts is read.   corners : (k, 3, 3) of the facets.
    slop : of the mesh [m].   movers : table of the sets, their rows in the table (n,),
    and their rows of parts (n, PART).
    """
    table, rows, parts = movers
    k, n = len(corners), len(rows)
    facets = Facets(corners, n)
    facets.numbers[:k, SLOP] = slop
    facets.ints[k:], facets.numbers[k:] = table.ints[rows], table.numbers[rows]
    facets.ints[k:, RANK] += 1
    mover, facet = np.divmod(np.arange(n * k), max(k, 1))
    ends = [[facet, np.zeros(n * k, dtype=np.int64)], [k + mover, 1 + mover]]
    jobs = np.ascontiguousarray(np.stack([mover, *ends[side], *ends[1 - side]], axis=1))
    rows_of_sets = free_rows(n)
    tables = Tables(facets.addresses, k + n, np.concatenate([spans.parts[side : side + 1], parts]))
    header = header_of(tables, spans.motion)
    find_impacts(address_of(header), address_of(jobs), len(jobs), *span, tolerance, address_of(rows_of_sets))
    return earliest_of(rows_of_sets)
