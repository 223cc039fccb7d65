"""`contacts`: the public call, pose after pose and part after part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from collide import argument_checks as checks
from collide.batches import answer_batch, length_of
from collide.contact.contact_rows import Contacts, no_rows
from collide.contact.convex_contacts import convex_contacts
from collide.contact.mesh_contacts import curved_contacts, facet_contacts, halfspace_contacts
from collide.errors import InvalidArgument
from collide.lowering.kinds import kind_of
from collide.lowering.parts import bounding_parts_of
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.dispatch import Method, method_of
from collide.pair_arguments import asked_poses, pose_at, shape_at
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape
from collide.transforms import as_poses

if TYPE_CHECKING:
    from collide.transforms import PoseLike

    Shapes = Shape | Sequence[Shape]

#: What makes the contacts of a pair, by the method that answers it; compounds are taken apart before.
_CONTACTS = {
    Method.CLOSED: convex_contacts,
    Method.PLANE: convex_contacts,
    Method.PLANES: convex_contacts,
    Method.CONVEX: convex_contacts,
    Method.FACETS: facet_contacts,
    Method.CURVED: curved_contacts,
    Method.HULL: halfspace_contacts,
}
_U = 2.0**-53
#: Contacts nearer to the margin than this part of the pair's size are judged by the bodies' distance.
_ROUNDING = 2.0**-40
#: Margins beyond this are no margins, and would overflow squared.
_LARGEST_MARGIN = 1e50


def contacts(
    A: Shapes, B: Shapes, X_WA: PoseLike, X_WB: PoseLike, *, margin: float = 0.0, max_contacts: int = 8,
    check_poses: bool = True,
) -> Contacts:  # fmt: skip
    """Contact manifolds of A and B: where they touch, overlap, or come within a margin.

    Parameters
    ----------
    A, B : shapes; or sequences of shapes, one a pose, as in `collide.collide`: a list, or picked from a `ShapeSet`.
    X_WA, X_WB : (4, 4) poses in the world W [m], or batches (N, 4, 4); a single pose goes with every pose of the
        other's batch.
    margin : [m], ≥ 0, finite: bodies, and parts of them, up to so far apart are in contact, too.
    max_contacts : of each patch, ≥ 1: the deepest is kept, then those that span the greatest area. No patch is left
        out.
    check_poses : refuse matrices that are no rotation.

    Returns
    -------
    Contacts : columns ``normal``, ``point_a``, ``point_b``, ``distance``, ``lower``, ``upper``, ``patch``, ``kind`` …,
    one row a contact (`contact/contact_rows.py` describes them); no rows where the bodies are farther apart than the
    margin. Those of pair k are ``rows[starts[k]:starts[k + 1]]``, or ``result[k]``.

    Raises
    ------
    InvalidArgument : a margin or a number of contacts out of range, lengths of batches that do not match.
    InvalidPose : matrices that are no pose.
    UnsupportedQuery : shapes that `collide.distance` refuses, two half-spaces that overlap, or more facets within the
        margin than can be looked at.

    Notes
    -----
    ``point_b − point_a = distance · normal``, both points within rounding of the surfaces. ``lower`` and ``upper`` hold
    the true distance, along the normal, between the two facets named at that place.

    *Apart*: there is a patch for every local minimum within the margin of the distance between facets, its normal the
    line between the nearest points; its first row is that gap.

    *Overlapping*: the normal is one of those of facets, of crossed edges or their mean, along which the facets that
    meet come apart after a short way; a shorter one may be. With B at ``X_WB[:3, 3] + apart * normal`` no facet pair of
    the patch meets, proven (`inf`: no such length is known); of convex bodies the bodies are apart but for touching.
    Bodies that grip each other have several patches, none of which need separate the bodies. Where a body lies within a
    solid, or facets meet too deeply for a patch (deeper than half the smaller body's radius), a row of kind
    "translation" is the answer of `distance`. A part of a mesh that lies within the other body, without facets that
    meet, adds nothing while other facets meet.

    Two convex shapes have one patch, with the normal of `distance`. Parts of a Compound are asked one by one. A pair
    near the surface costs about a millisecond, which grows with the facets within the margin.
    """
    margin, max_contacts = check_margin("contacts", margin), check_max_contacts("contacts", max_contacts)
    X_WA, X_WB, _ = asked_poses(A, B, X_WA, X_WB)
    X_WA, X_WB = (as_poses(X, name, check=check_poses) for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))
    of_pairs = [
        contact_rows(shape_at(A, k), shape_at(B, k), pose_at(X_WA, k), pose_at(X_WB, k), margin, max_contacts)
        for k in range(length_of(A, B, X_WA, X_WB))
    ]
    starts = np.concatenate([[0], np.cumsum([len(rows) for rows in of_pairs])]).astype(np.int64)
    return Contacts(np.concatenate([no_rows(), *of_pairs]), starts)


def contact_rows(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, margin: float, max_contacts: int
) -> np.ndarray:
    """Rows of two shapes at checked poses (4, 4): none where `distance` proves them farther apart than the margin."""
    rows = _rows_of_parts(A, B, X_WA, X_WB, margin, max_contacts)
    # Parts are asked a little beyond the margin, for what rounding may have moved; where it matters `distance` decides.
    size = _reach(A) + _reach(B) + float(np.abs(X_WB[:3, 3] - X_WA[:3, 3]).sum())
    near = not len(rows) or rows["upper"].min() <= margin - _ROUNDING * size
    if near or answer_batch(A, B, X_WA[None], X_WB[None], Question(False, math.inf))["lower"][0] <= margin:
        return rows
    return no_rows()


def _rows_of_parts(A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray:
    parts_a, parts_b = _parts(A, X_WA), _parts(B, X_WB)
    if len(parts_a) == len(parts_b) == 1 and parts_a[0][2] == parts_b[0][2] == 0.0:
        return contacts_of_pair(parts_a[0][0], parts_b[0][0], parts_a[0][1], parts_b[0][1], margin, max_contacts)
    rows_of_parts, patches = [], 0
    for i, (A_i, X_WAi, off_a) in enumerate(parts_a):
        for j, (B_j, X_WBj, off_b) in enumerate(parts_b):
            off = off_a + off_b
            rows = contacts_of_pair(A_i, B_j, X_WAi, X_WBj, margin + off, max_contacts)
            rows["part_a"], rows["part_b"] = i, j
            rows["lower"] -= off
            rows["upper"] += off
            rows["patch"] += patches
            patches = int(rows["patch"].max(initial=patches - 1)) + 1
            rows_of_parts.append(rows)
    return np.concatenate([no_rows(), *rows_of_parts])


def contacts_of_pair(A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray:
    """Rows of two shapes that are no compounds, by the table of pairs."""
    return _CONTACTS[method_of(kind_of(A), kind_of(B))](A, B, X_WA, X_WB, margin, max_contacts)


def _parts(shape: Shape, X: np.ndarray) -> list[tuple[Shape, np.ndarray, float]]:
    """(shape, its pose, how far the pose's rounding moves a point) of every part of a compound, nested ones too."""
    if not isinstance(shape, Compound):
        return [(shape, X, 0.0)]
    parts = []
    for item, X_CS in shape.items:
        X_WS = X.copy()
        X_WS[:3] = (X[:3, :, None] * X_CS[None]).sum(axis=1)
        size = _reach(item) + float(np.abs(X_CS[:3, 3]).sum() + np.abs(X[:3, 3]).sum())
        off = 0.0 if np.array_equal(X_CS, np.eye(4)) else 32.0 * _U * size
        parts += [(part, X_WP, off + more) for part, X_WP, more in _parts(item, np.ascontiguousarray(X_WS))]
    return parts


def _reach(shape: Shape) -> float:
    parts = bounding_parts_of(shape)
    return max(4.0 * (part.reach + part.radius) + float(np.abs(X[:3, 3]).sum()) for part, X in parts)


def check_margin(name: str, value) -> float:
    """A margin [m]."""
    number = checks.number(value)
    if number is None or not 0.0 <= number <= _LARGEST_MARGIN:
        raise InvalidArgument(f"{name}: margin must be finite and ≥ 0 [m], got {checks.describe(value)}")
    return number


def check_max_contacts(name: str, value) -> int:
    """How many contacts a patch may have."""
    return checks.integer(f"{name}: max_contacts", value, 1)
