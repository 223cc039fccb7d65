"""The soak of solids: it counts what it judges, and sees an engine whose results cross, or have another volume."""

from __future__ import annotations

import pytest
import soak_solids

import collide


@pytest.mark.many(2)
@pytest.mark.parametrize("family", soak_solids.FAMILIES)
def test_a_chain_is_judged_and_counted(family):
    tally = soak_solids.Tally()
    soak_solids.soak_chain(family, [3, 0, 0], 8, tally, with_peer=False)
    assert tally.counts["steps"] == 8 == len(tally.seconds) and not tally.failed()
    assert max(tally.moved) > 0.0 and tally.line(family).startswith(family)


def test_thin_triangles_are_not_split_in_turns():
    """Two thin triangles once took turns until a cap, and the surface was said to have moved by 0.3 mm."""
    tally = soak_solids.Tally()
    soak_solids.soak_chain("an ulp off", [52, 2, 34], 36, tally, with_peer=False)
    assert tally.counts["steps"] == 36 and not tally.failed() and max(tally.moved) < 64.0


def test_an_engine_without_merging_is_seen(monkeypatch, capsys):
    def unmerged(*arguments):
        return ask(*arguments, rounding="exact")

    ask = collide.boolean
    monkeypatch.setattr(collide, "boolean", unmerged)
    tally = soak_solids.Tally()
    soak_solids.soak_chain("one frame", [4, 0, 7], 6, tally, with_peer=False)
    assert tally.counts["crossing"] + tally.counts["flat"] >= 2 and "FAILED" in capsys.readouterr().out


def test_an_engine_with_another_volume_is_seen(monkeypatch, capsys):
    def swollen(*arguments):
        r = ask(*arguments)
        return r._replace(mesh=collide.Mesh(r.mesh.vertices * (1.0 + 1e-12), r.mesh.faces))

    ask = collide.boolean
    monkeypatch.setattr(collide, "boolean", swollen)
    tally = soak_solids.Tally()
    soak_solids.soak_chain("general position", [5, 0, 0], 4, tally, with_peer=False)
    assert tally.counts["volume"] >= 3 and "FAILED" in capsys.readouterr().out
