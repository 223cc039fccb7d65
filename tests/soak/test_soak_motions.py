"""The soak of motions: it counts what it judges, and sees an engine that is late."""

from __future__ import annotations

import numpy as np
import soak_motions

import collide


def test_a_group_is_judged_and_counted():
    tally = soak_motions.Tally()
    for family in ("boxes at random", "a solid mesh and a box"):
        soak_motions.soak_group(family, [3, 0, 0], 40, tally)
    counts = tally.counts
    assert counts["motions"] == 80 == counts["hits"] + counts["free"] + counts["open"]
    assert counts["hits"] >= 10 and counts["free"] >= 20 and counts["missed"] == counts["made up"] == 0


def test_an_engine_that_is_late_is_seen(monkeypatch, capsys):
    def late(*arguments, **options):
        r = ask(*arguments, **options)
        by = np.where(r.hit & (r.lower > 0.0) & (r.lower < 0.99), 1e-2, 0.0)
        return r._replace(lower=r.lower + by, upper=r.upper + by)

    ask = collide.time_of_impact
    monkeypatch.setattr(collide, "time_of_impact", late)
    tally = soak_motions.Tally()
    soak_motions.soak_group("tetrahedra at random", [4, 0, 0], 40, tally)
    assert tally.counts["missed"] >= 5 and "FAILED" in capsys.readouterr().out
