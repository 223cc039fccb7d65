"""What python-fcl's default callbacks come to over many pairs, answered in batches: the same results, sooner."""

from __future__ import annotations

import sys
from collections.abc import Iterable

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_contacts import contacts_of_pairs
from collide.adapters.hosts.fcl_queries import (
    checked_limit,
    defaultCollisionCallback,
    defaultDistanceCallback,
    meet,
)
from collide.adapters.hosts.fcl_requests import CollisionData, DistanceData
from collide.adapters.hosts.object_tree import ObjectTree, in_chunks
from collide.adapters.hosts.posed_objects import HostObject
from collide.errors import CollideError

#: So many pairs are asked one by one at first; a batch has at most the second number.
_FIRST, _MAX_BATCH = 16, 8192


def collide_in_batches(
    tree: ObjectTree, against: ObjectTree | HostObject | None, blocks: Iterable[np.ndarray], cdata: CollisionData
) -> None:
    """`defaultCollisionCallback` of all pairs, until it says that it is done.

    blocks : (k, 2) rows of the tree and of the other one, None the same; of one object the second is 0.
    """
    mine, theirs = tree.objects, _their_objects(tree, against)
    for chunk in in_chunks(blocks, _FIRST, _MAX_BATCH):
        if cdata.done:
            return
        answer = None
        if len(chunk) > _FIRST and checked_limit(cdata.request):
            answer = _hits(tree, against, chunk)
        if answer is None:
            for i, j in chunk.tolist():
                if defaultCollisionCallback(mine[i], theirs[j], cdata):
                    return
        else:
            _add_contacts([(mine[i], theirs[j]) for i, j in chunk[answer].tolist()], cdata)


def _their_objects(tree: ObjectTree, against: ObjectTree | HostObject | None) -> list:
    if isinstance(against, HostObject):
        return [against]
    return tree.objects if against is None else against.objects


def _hits(tree: ObjectTree, against: ObjectTree | HostObject | None, pairs: np.ndarray) -> np.ndarray | None:
    """(k,) bool of pairs (k, 2); None where one has no answer, which is then found, and told, pair by pair."""
    hits = np.zeros(len(pairs), dtype=bool)
    single = _both_single(tree, against, pairs)
    try:
        if single.any():
            a, b = pairs[single].T
            hits[single] = engine.collide(*tree.batch(a, against, b))
        mine, theirs = tree.objects, _their_objects(tree, against)
        for k in np.flatnonzero(~single).tolist():
            hits[k] = meet(mine[pairs[k, 0]], theirs[pairs[k, 1]])
    except CollideError:
        return None
    return hits


def _both_single(tree: ObjectTree, against: ObjectTree | HostObject | None, pairs: np.ndarray) -> np.ndarray:
    single = tree.is_single(pairs[:, 0])
    if isinstance(against, HostObject):
        return single & (len(against._geometry._shapes) == 1)
    return single & (tree if against is None else against).is_single(pairs[:, 1])


def _add_contacts(hits: list, cdata: CollisionData) -> None:
    """Contacts of pairs that meet, into the result, until there are more than are wanted."""
    request, result = cdata.request, cdata.result
    limit = checked_limit(request)
    while hits and not cdata.done:
        missing = max(1, limit + 1 - len(result.contacts))  # each pair adds one at least
        some, hits = hits[:missing], hits[missing:]
        result.is_collision = True
        for contacts in contacts_of_pairs(some, limit, bool(request.enable_contact)):
            result.contacts.extend(contacts)
            if len(result.contacts) > limit:
                cdata.done = True
                break


def distance_in_batches(tree: ObjectTree, against: ObjectTree | HostObject | None, cdata: DistanceData) -> None:
    """`defaultDistanceCallback` of pairs that may be the nearest, until it says that it is done."""
    if cdata.done:
        return
    mine, theirs = tree.objects, _their_objects(tree, against)
    least = [np.inf]
    for gaps, rows in tree.near(against, least):
        begin, size = 0, _FIRST
        while begin < len(rows) and gaps[begin] < least[0]:
            wanted = rows[begin : begin + size][gaps[begin : begin + size] < least[0]]
            chunk = wanted if begin == 0 or len(wanted) <= _FIRST else _nearest_of(tree, against, wanted, least[0])
            nearest = chunk is not wanted
            for gap, (i, j) in zip(gaps[begin:].tolist(), chunk.tolist()):
                if gap >= least[0] and not nearest:
                    break
                is_done, least[0] = defaultDistanceCallback(mine[i], theirs[j], cdata)
                if is_done:
                    return
            begin, size = begin + size, min(4 * size, _MAX_BATCH)


def _nearest_of(tree: ObjectTree, against, pairs: np.ndarray, least: float) -> np.ndarray:
    """Of pairs (k, 2) those that are to be asked: one that meets, or the nearest, and what batches do not answer."""
    single = _both_single(tree, against, pairs)
    asked, rest = pairs[single], pairs[~single]
    if not len(asked):
        return rest
    limit = least if 0.0 < least < sys.float_info.max else np.inf
    try:
        answer = engine.distance(*tree.batch(asked[:, 0], against, asked[:, 1]), max_distance=limit, signed=False)
    except CollideError:
        return pairs
    k = int(np.argmax(answer.hit)) if np.any(answer.hit) else int(np.argmin(answer.distance))
    return np.concatenate([asked[k : k + 1], rest])
