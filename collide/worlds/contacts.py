"""Contacts of the pairs of bodies of a World: convex ones by number, straight from its tables; all others as pair
queries answer them.
"""

from __future__ import annotations

import numpy as np

from collide.base.threads import answers_in_order
from collide.contact.contact_batches import contact_batch
from collide.contact.convex_contacts import ConvexPairs, contacts_of
from collide.errors import UnsupportedQuery
from collide.worlds.packed_world import PackedWorld

#: Pairs of bodies that a thread takes at once.
_PAIRS_AT_ONCE = 1024


def contacts_in_pieces(
    packed: PackedWorld, pairs: np.ndarray, margin: float, max_contacts: int, threads: int
) -> tuple[np.ndarray, np.ndarray]:
    """As `contacts_of_bodies`, by at most so many threads; the same bits."""
    if threads < 2 or len(pairs) <= _PAIRS_AT_ONCE:
        return contacts_of_bodies(packed, pairs, margin, max_contacts)
    pieces = np.split(pairs, range(_PAIRS_AT_ONCE, len(pairs), _PAIRS_AT_ONCE))
    answers = answers_in_order(pieces, lambda piece: contacts_of_bodies(packed, piece, margin, max_contacts), threads)
    rows, counts = zip(*answers)
    return np.concatenate(rows), np.concatenate(counts)


def contacts_of_bodies(
    packed: PackedWorld, pairs: np.ndarray, margin: float, max_contacts: int
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, counts) of pairs (k, 2) of positions, sorted: rows of `CONTACT_DTYPE` with ids of bodies, how many a pair.

    Raises UnsupportedQuery, naming the bodies.
    """
    try:
        is_convex = packed.parts.single_convex[pairs[:, 0]] & packed.parts.single_convex[pairs[:, 1]]
        if is_convex.all():
            rows, ends = contacts_of(_convex_pairs(packed, pairs), margin, max_contacts)
            return rows, np.diff(ends, prepend=0)
        return _of_both_kinds(packed, pairs, is_convex, margin, max_contacts)
    except UnsupportedQuery:
        _name_refused(packed, pairs, margin, max_contacts)
        raise


def _of_both_kinds(
    packed: PackedWorld, pairs: np.ndarray, is_convex: np.ndarray, margin: float, max_contacts: int
) -> tuple[np.ndarray, np.ndarray]:
    counts = np.zeros(len(pairs), dtype=np.int64)
    convex, ends = contacts_of(_convex_pairs(packed, pairs[is_convex]), margin, max_contacts)
    counts[is_convex] = np.diff(ends, prepend=0)
    others, ends = contact_batch(*packed.posed_shapes(pairs[~is_convex]), int((~is_convex).sum()), margin, max_contacts)
    counts[~is_convex] = np.diff(ends, prepend=0)
    ids = packed.roster.ids
    others["a"], others["b"] = np.repeat(ids[pairs[~is_convex]], counts[~is_convex], axis=0).T
    of_convex = np.repeat(is_convex, counts)
    rows = np.empty(len(of_convex), dtype=convex.dtype)
    rows[of_convex], rows[~of_convex] = convex, others
    return rows, counts


def _convex_pairs(packed: PackedWorld, pairs: np.ndarray) -> ConvexPairs:
    table, which = packed.convex_sets_of(pairs)
    ids = np.ascontiguousarray(packed.roster.ids, dtype=np.int64)
    return ConvexPairs(table, which, packed.X_WBs, packed.X_WBs, pairs, ids)


def _name_refused(packed: PackedWorld, pairs: np.ndarray, margin: float, max_contacts: int) -> None:
    """Raise for the first pair (of positions) whose contacts are refused, with the bodies' names."""
    names = packed.roster.names
    for i, j in pairs.tolist():
        try:
            contact_batch(*packed.posed_shapes(np.array([[i, j]])), 1, margin, max_contacts)
        except UnsupportedQuery as error:
            raise UnsupportedQuery(f'"{names[i]}" and "{names[j]}": {error}') from None
