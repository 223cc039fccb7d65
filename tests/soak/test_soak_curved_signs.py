"""Some pairs of the soak of curved signs, and that it notices a wrong engine."""

from __future__ import annotations

import pytest
import soak_curved_signs

import collide


@pytest.mark.slow
def test_signs_of_all_families_are_right_and_none_is_open():
    told: list[str] = []
    tally = soak_curved_signs.soak(5, range(800), say=told.append)
    assert not told, "\n".join(told)
    assert set(tally) == set(soak_curved_signs.FAMILIES) and all(len(c["ms"]) == 200 for c in tally.values())


def test_a_wrong_sign_is_noticed():
    family, pair = soak_curved_signs.pair_of(5, 2)
    r = collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB)
    assert soak_curved_signs.flaw_of(family, pair, r) is None
    rows = r.rows.copy()
    rows["hit"] ^= True
    wrong = type("Row", (), {name: rows[name][0] for name in ("hit", "lower", "upper", "how")})
    assert "hit is" in soak_curved_signs.flaw_of(family, pair, wrong)
