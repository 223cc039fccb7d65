"""collide itself behind the protocol: a World for a scene, pair queries for unrelated pairs.

A scene is answered by `World.collisions` and `World.distances`, broadphase and all. Pairs that the
World leaves out get their number from a pair query, and a row that the World should have held is
reported.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator

import collide
from collide.adapters.peers.answers import ANSWERED, FAILED, UNSUPPORTED, Event, Reply
from collide.adapters.peers.protocol import Peer, Question, complaint
from collide.errors import UnsupportedQuery
from collide.results import UNDECIDED


class CollidePeer(Peer):
    """The engine under test."""

    name = "collide"
    about = "World.collisions and World.distances of a scene; collide and distance of unrelated pairs"
    receives = ("doubles, as they stand",)
    cannot = ("depths of meshes that meet",)

    def stream(self, question: Question, wanted: Iterable[int]) -> Iterator[Event]:
        if question.isolated:
            for k in wanted:
                yield _timed(k, lambda k=k: _pair(question, k))
            return
        wanted = list(wanted)
        start = time.perf_counter()
        try:
            world = _world(question)
            hits = set(zip(*(world.collisions().rows[side].tolist() for side in ("a", "b"))))
            rows = world.distances(max_distance=question.max_distance).rows
        except Exception as error:  # noqa: BLE001 - any failure of the engine under test is a finding
            yield from (Event(FAILED, k, None, complaint(error)) for k in wanted)
            return
        rows_by_pair = {(int(row["a"]), int(row["b"])): row for row in rows}
        share = (time.perf_counter() - start) / max(len(wanted), 1)
        for k in wanted:
            yield _timed(k, lambda k=k: _from_world(question, k, hits, rows_by_pair), share)


def _timed(k: int, answer, share: float = 0.0) -> Event:
    start = time.perf_counter()
    try:
        reply = answer()
    except UnsupportedQuery as error:
        return Event(UNSUPPORTED, k, None, str(error))
    except Exception as error:  # noqa: BLE001 - as above
        return Event(FAILED, k, None, complaint(error))
    return Event(ANSWERED, k, reply, "", share + time.perf_counter() - start)


def _world(question: Question):
    """A World whose ids are the question's indices."""
    world = collide.World()
    ids = [
        world.add(b.shape, b.X_WB, name=b.name, static=b.static, group=b.group, mask=b.mask)
        for b in question.bodies
    ]
    if ids != list(range(len(ids))):
        raise AssertionError(f"a new World counts its bodies from 0, got {ids[:5]}")
    for i, j in question.allowed:
        world.allow(i, j, reason="allowed")
    return world


def _from_world(question: Question, k: int, hits: set, rows: dict) -> Reply:
    """What the World says of pair k; its own contradictions stand in the note."""
    pair = question.pairs[k]
    hit = pair in hits
    if pair in rows:
        return _reply(rows[pair])._replace(hit=hit)
    alone = _pair(question, k)
    note = ""
    if alone.distance is not None and alone.distance <= question.max_distance:
        note = f"the World left this pair out, the pair query finds it at {alone.distance!r} m"
    return alone._replace(hit=hit, note=note)


def _pair(question: Question, k: int) -> Reply:
    A, B = (question.bodies[i] for i in question.pairs[k])
    reply = _reply(collide.distance(A.shape, B.shape, A.X_WB, B.X_WB).rows[0])
    # The boolean is asked by itself: it takes shorter ways, which are under test too.
    hit = bool(collide.collide(A.shape, B.shape, A.X_WB, B.X_WB))
    return reply._replace(hit=hit, certified=reply.certified and hit == reply.hit)


def _reply(row) -> Reply:
    normal, point_a, point_b = (tuple(row[name].tolist()) for name in ("normal", "point_a", "point_b"))
    distance = None if math.isnan(row["distance"]) else float(row["distance"])
    return Reply(
        bool(row["hit"]), distance, normal, point_a, point_b, certified=bool(row["certified"]),
        undecided=bool(row["how"] == UNDECIDED), lower=float(row["lower"]), upper=float(row["upper"]),
    )
