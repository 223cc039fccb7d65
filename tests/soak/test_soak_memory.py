"""Some shapes of the soak of memory, and that it notices what keeps them. `python tests/soak/soak_memory.py` drops a
hundred thousand."""

from __future__ import annotations

import collections
import gc
import os
import sys

import pytest
import soak_memory
from soak_memory import USES, drops, main
from soak_pairs import WORLD_KINDS

import collide
from collide.lowering import facet_bodies, parts
from collide.narrowphase import prepared_pairs

#: COLLIDE_SOAK_SHAPES of more show smaller leaks.
SHAPES = int(os.environ.get("COLLIDE_SOAK_SHAPES", "600"))
#: Memory that Python holds may grow by so many blocks a shape; a pair that stays is some twenty. Resident memory tells
#: more of a long run alone: of a thousand shapes one large mesh is the largest of all so far.
MOST_BLOCKS = 2.0


def _blocks() -> int:
    gc.collect()
    return sys.getallocatedblocks()


@pytest.mark.slow
def test_no_shape_outlives_its_last_user_and_memory_stays(monkeypatch):
    monkeypatch.setattr(parts, "MAX_SHARED", 32)  # full long before half of the shapes: what is kept by numbers stays
    blocks: list[int] = []
    drops(SHAPES // 2, seed=6)  # what is made once
    survivors, answered, refused = drops(SHAPES, seed=5, sample=lambda _: blocks.append(_blocks()))
    assert not survivors, collections.Counter(survivors).most_common(5)
    assert answered > 5 * refused and answered + refused == SHAPES // 2
    assert len(blocks) >= soak_memory.SAMPLES
    assert blocks[-1] - blocks[len(blocks) // 2] <= MOST_BLOCKS * SHAPES / 2, blocks


@pytest.mark.slow
def test_all_kinds_and_uses_are_drawn(monkeypatch):
    drawn: collections.Counter = collections.Counter()
    make = soak_memory.shape
    monkeypatch.setattr(soak_memory, "shape", lambda kind, *given: drawn.update([kind]) or make(kind, *given))
    monkeypatch.setattr(soak_memory, "USES", {use: lambda A, B, use=use: drawn.update([use]) for use in USES})
    assert drops(SHAPES, seed=5)[0] == []
    assert set(drawn) == {*WORLD_KINDS, *USES} and min(drawn.values()) >= 10


@pytest.mark.slow
def test_a_pair_that_holds_its_shapes_is_noticed(monkeypatch):
    kept = []

    def hold(A, B, pair, slot="_prepared"):
        kept.append((A, B))

    monkeypatch.setattr(collide.pairs.batches, "keep_prepared", hold)
    survivors, *_ = drops(60, seed=5, uses=("collide", "distance"))
    assert len(survivors) > 15 and kept


@pytest.mark.slow
def test_a_shape_that_holds_itself_is_noticed(monkeypatch):
    monkeypatch.setattr(facet_bodies, "held_by", lambda owner, shape: lambda: shape)
    survivors, *_ = drops(100, seed=5, uses=("contacts", "distance"))
    assert {kind for survivor in survivors for kind in survivor.kinds} >= {"solid", "surface"}


def test_arguments_and_status(capsys):
    assert main(["--shapes", "60", "--uses", "collide,ray"]) == 0
    told = capsys.readouterr().out
    assert "outlived" in told and "bytes a shape" in told and prepared_pairs.single_calls_are_safe() is not None
    with pytest.raises(SystemExit):
        main(["--uses", "nothing"])
