"""`contacts`: the public call, pose after pose and part after part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads
from collide.contact.contact_batches import contact_batch
from collide.contact.contact_rows import Contacts
from collide.contact.single_contacts import prepare_contacts
from collide.errors import InvalidArgument
from collide.narrowphase.single_queries import ALL_CONTACTS, asks_prepared_pairs
from collide.pairs.batches import length_of
from collide.pairs.pair_arguments import asked_poses
from collide.shapes.shape import Shape
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from collide.transforms import PoseLike

    Shapes = Shape | Sequence[Shape]


@asks_prepared_pairs(prepare_contacts, Contacts)
def contacts(
    A: Shapes, B: Shapes, X_WA: PoseLike, X_WB: PoseLike, *, margin: float = 0.0, max_contacts: int = 8,
    check_poses: bool = True, threads: int = 1,
) -> Contacts:
    """Contact manifolds of A and B: where they touch, overlap, or come within a margin.

    Parameters
    ----------
    A, B : shapes; or sequences of shapes, a shape for each pose, as in `collide.collide`: a list, or picked from a
        `ShapeSet`.
    X_WA, X_WB : (4, 4) poses in the world W [m], or batches (N, 4, 4); a single pose goes with every pose of the
        other's batch.
    margin : [m], ≥ 0, finite: bodies, and parts of them, up to so far apart are in contact, too.
    max_contacts : of each patch, ≥ 1: the deepest is kept, then points spanning the greatest area. No patch is left
        out.
    check_poses : refuse matrices other than rotations.
    threads : at most so many answer; the rows are the same bits.

    Returns
    -------
    Contacts : columns ``normal``, ``point_a``, ``point_b``, ``distance``, ``lower``, ``upper``, ``patch``, ``kind`` …,
    a row for each contact (`contact/contact_rows.py` describes them); no rows where the bodies are farther apart than
    the margin. Rows of pair k are ``rows[starts[k]:starts[k + 1]]``, or ``result[k]``.

    Raises
    ------
    InvalidArgument : a margin or a number of contacts out of range, unequal lengths of batches.
    InvalidPose : matrices that are no pose.
    UnsupportedQuery : shapes refused by `collide.distance`, two overlapping half-spaces, or more facets within the
        margin than can be handled.

    Notes
    -----
    ``point_b − point_a = distance · normal``, both points within rounding of the surfaces. ``lower`` and ``upper`` hold
    the true distance, along the normal, between the two facets named, at the contact's place.

    *Apart*: a patch for every local minimum within the margin of the distance between facets, its normal the
    line between the nearest points; its first row is the minimum gap.

    *Overlapping*: the normal is a facet's, two crossed edges', or a mean normal, along which the meeting facets come
    apart after a short way; shorter ways may exist. With B at ``X_WB[:3, 3] + apart * normal`` no facet pair of the
    patch meets, proven (`inf`: no such length is known); of convex bodies the bodies are apart but for touching. Bodies
    that grip each other have several patches, none of which need separate the bodies. Where a body lies within a solid,
    a mesh of more than 512 facets within a cylinder, cone or ellipsoid, or facets meet too deeply for a patch (deeper
    than the smaller body's diameter), a row of kind "translation" is the answer of `distance`. A part of a mesh within
    the other body, without meeting facets, adds nothing while other facets meet.

    Two convex shapes have one patch, with the normal of `distance`: about a microsecond a pair. Of unions of convex
    parts those are asked whose balls come within the margin, found by a tree over both: some microseconds for few near
    parts. Two bodies of facets, and a curved shape on a mesh, cost tens of microseconds; a millisecond where a curved
    shape is so deep in a mesh that slabs do not prove the shortest way out. The time for meshes grows as k log k with
    the k pairs of facets within the margin or, for overlapping bodies, that a patch may reach, about a microsecond a
    pair: n·m at worst; beyond 2¹⁸ pairs apart within the margin the question is refused, of overlaps `distance`
    answers.
    """
    margin = check_margin("contacts", margin)
    max_contacts = check_max_contacts("contacts", max_contacts)
    threads = check_threads(threads)
    X_WA, X_WB, single = asked_poses(A, B, X_WA, X_WB)
    n = length_of(A, B, X_WA, X_WB)
    check = checks.true_or_false("check_poses", check_poses)
    if prepare_contacts(A, B) and single:  # batches, too, read a table that is kept with the pair
        return contacts(
            A, B, X_WA[0], X_WB[0], margin=margin, max_contacts=max_contacts, check_poses=check, threads=threads
        )
    rows, ends = contact_batch(A, B, X_WA, X_WB, n, margin, max_contacts, check=check, threads=threads)
    return Contacts(rows, np.concatenate([[0], ends]).astype(np.int64))


def check_margin(name: str, value) -> float:
    """A margin [m]."""
    number = checks.number(value)
    if number is None or not 0.0 <= number <= LARGEST:
        raise InvalidArgument(f"{name}: margin must be finite and ≥ 0 [m], got {checks.brief(value)}")
    return number


def check_max_contacts(name: str, value) -> int:
    """How many contacts a patch may have; a number that no patch reaches stands for all of them."""
    return min(checks.integer(f"{name}: max_contacts", value, 1), ALL_CONTACTS)
