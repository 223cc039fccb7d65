"""Some pairs of the soak of contacts, and that it notices a wrong engine. `python tests/soak/soak_contacts.py` judges
100,000."""

from __future__ import annotations

import numpy as np
import pytest
import soak_contacts

import collide

#: Pairs that broke a promise once, or that the judge was wrong about, (seed, case): planes of needles a nanometre thin.
FOUND = [
    *((1, k) for k in (80, 135, 170, 308, 612, 689, 784, 805, 972, 1357, 2196, 9133)), (2, 2620), (2, 10339),
    *((1, k) for k in (16462, 33683, 52922, 64593, 81979, 93074)),
]


@pytest.mark.slow
def test_rows_of_all_families_keep_every_promise():
    told: list[str] = []
    tally = soak_contacts.soak(3, range(660), say=told.append)
    assert not tally.failed, "\n".join(told) + tally.summary()
    for family, count in tally.families.items():
        assert count["pairs"] >= 20 and count["rows"] >= 0.15 * count["pairs"], family
    assert min(count["pairs"] for count in tally.kinds.values()) >= 10
    hits = sum(count["hits"] for count in tally.families.values())
    assert 0.25 * tally.pairs <= hits <= 0.75 * tally.pairs, hits


@pytest.mark.parametrize(("seed", "number"), FOUND)
def test_pairs_that_broke_a_promise_once(seed, number):
    told: list[str] = []
    assert not soak_contacts.soak(seed, [number], say=told.append).failed, told


def wrong(change):
    """`collide.contacts` whose rows a function changes."""

    def contacts(*arguments, **options):
        found = collide.contacts(*arguments, **options)
        return type(found)(change(found.rows.copy()), found.starts)

    return contacts


def shift(rows):
    rows["point_a"] += 1e-6 * rows["normal"]
    return rows


def deepen(rows):
    rows["lower"] -= 1e-6
    rows["upper"] = rows["distance"] = rows["lower"]
    return rows


def drop_all(rows):
    return rows[:0]


def keep_one(rows):
    return rows[:1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "families", "least"),
    [
        (shift, ("touching", "flush, or an ulp off"), 0.9), (deepen, ("touching", "thin"), 0.9),
        (drop_all, ("flush, or an ulp off",), 0.9), (keep_one, ("along edges",), 0.9),
    ],
)
def test_a_wrong_engine_is_noticed(change, families, least):
    with_rows = noticed = 0
    for number in range(60):
        _, case = soak_contacts.draw(4, number, families)
        if len(soak_contacts.judge(case)[0]):
            with_rows += 1
            noticed += bool(soak_contacts.judge(case, wrong(change))[2])
    assert with_rows >= 20 and noticed >= least * with_rows, (noticed, with_rows)


def test_code_of_a_failure_asks_the_same_question():
    told: dict = {}
    _, case = soak_contacts.draw(1, 3)
    exec(soak_contacts.question(case), told)  # noqa: S102 code that the soak itself wrote
    assert np.array_equal(told["c"].rows, collide.contacts(*case[1:5], margin=case.margin).rows)


def test_summary_and_exit_status(capsys):
    assert soak_contacts.main(["--pairs", "3", "--families", "touching"]) == 0
    assert "0 of 3 pairs failed" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        soak_contacts.main(["--families", "cubes"])
