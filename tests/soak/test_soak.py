"""Some pairs of the soak, and that it notices a wrong engine. `python tests/soak/soak.py --minutes 5` judges many
more."""

from __future__ import annotations

import collections

import numpy as np
import pytest
import soak_judges
from soak import Tally, _group_code, main, soak
from soak_judges import Engine, judge, judge_group
from soak_pairs import CURVED, KINDS, draw, question

import collide

SEED, PAIRS, RATIO = 1, 60, 1e6
#: Pairs that found a failure once, (seed, case): 1, 3, 4, 11 and 13 of the attack on the engine, and later ones.
FOUND = [
    *((2, k) for k in (1, 37, 95, 101, 137, 182, 225, 304, 322, 395, 539, 653, 921, 957, 1140, 1327, 1394, 1480, 2104)),
    *((2, k) for k in (2138, 2338, 2365)),
    *((3, k) for k in (298, 572, 1548, 1602, 1701)),
    *((101, 5087), (202, 1746), (202, 2725), (202, 2916)),
]


@pytest.mark.slow
def test_pairs_of_all_kinds_keep_every_promise():
    failures: list[str] = []
    truths: collections.Counter = collections.Counter()
    sharp = 0
    for seed, number in [*((SEED, number) for number in range(PAIRS)), *FOUND]:
        case = draw(seed, number, RATIO)
        judged = judge(case)
        truths[judged.truth] += 1
        sharp += judged.told
        for promise, found, _ in judged.failures:
            failures.append(
                f"python tests/soak/soak.py --seed {seed} --case {number}   # {case.kinds}: {promise}: {found}"
            )
    assert not failures, "\n".join(failures)
    assert truths[True] >= PAIRS / 5 and truths[False] >= PAIRS / 3 and truths[None] <= PAIRS / 50
    assert sharp >= 0.9 * PAIRS, "the oracle is too coarse to judge the engine"


def test_draws_are_repeatable_cover_all_kinds_and_go_near():
    cases = [draw(3, number, RATIO) for number in range(300)]
    assert {kind for case in cases for kind in case.kinds} == set(KINDS)
    again = draw(3, 17, RATIO)
    assert question(again) == question(cases[17])
    ratios = [soak_judges.size_of(case) for case in cases]
    assert min(ratios) > 0
    assert len({case.poses for case in cases}) == 5


def test_code_of_a_failure_asks_the_same_question():
    for number in range(30):
        case = draw(4, number, RATIO)
        told: dict = {}
        exec(question(case), told)  # noqa: S102 code that the soak itself wrote
        assert told["A"] == case.A and told["B"] == case.B, case.kinds
        assert np.array_equal(told["X_WA"], case.X_WA) and np.array_equal(told["X_WB"], case.X_WB)


# --- a wrong engine is noticed ---------------------------------------------------------------------


def changed(change):
    """`collide.distance` whose rows a function changes in place."""

    def distance(*arguments, **options):
        found = collide.distance(*arguments, **options)
        change(found.rows)  # what its fields are read from
        return found

    return distance


def scale_normal(rows):
    rows["normal"] *= 1 + 1e-9


def turn_normal(rows):
    rows["normal"] *= -1.0


def raise_lower(rows):
    rows["lower"] += 1e-3 * np.abs(rows["distance"]) + rows["upper"] - rows["lower"]
    rows["upper"] = np.maximum(rows["upper"], rows["lower"])
    rows["distance"] = np.maximum(rows["distance"], rows["lower"])


def drop_upper(rows):
    rows["upper"] -= 1e-3 * np.abs(rows["distance"]) + rows["upper"] - rows["lower"]
    rows["lower"] = np.minimum(rows["upper"], rows["lower"])
    rows["distance"] = np.minimum(rows["upper"], rows["distance"])


def flip_hit(rows):
    rows["hit"] = ~rows["hit"]


def move_point(rows):
    size = np.abs(rows["point_a"]).max() + np.abs(rows["distance"]).max()
    for name in ("point_a", "point_b"):
        rows[name] += 0.1 * size * np.array([1.0, -0.7, 0.4])


def shift_point(rows):
    rows["point_b"] += 1e-6 * np.abs(rows["point_b"]).max()


def claim_beyond(rows):
    rows["beyond"], rows["hit"], rows["upper"] = True, False, np.inf


#: Change, promise it breaks, the least part of pairs in which that is noticed.
MUTATIONS = [
    (scale_normal, "|normal| = 1", 0.99),
    (turn_normal, "point_b - point_a = distance * normal", 0.7),
    (raise_lower, "lower <= truth", 0.6),
    (drop_upper, "truth <= upper", 0.6),
    (flip_hit, "hit is right", 0.9),
    (move_point, "points lie on their bodies", 0.5),
    (shift_point, "point_b - point_a = distance * normal", 0.8),
    (claim_beyond, "beyond only where beyond", 0.9),
]


OF_DISTANCE = (soak_judges.judge_bracket, soak_judges.judge_normal, soak_judges.judge_points, soak_judges.judge_limits)


@pytest.fixture(scope="module")
def unchanged():
    """[(case, promises it breaks as it is)]"""
    cases = [draw(21, number, RATIO, ("sphere", "box", "hull", "solid", *CURVED)) for number in range(16)]
    return [(case, {found[0] for found in judge(case, judges=OF_DISTANCE).failures}) for case in cases]


@pytest.mark.slow
@pytest.mark.parametrize(("change", "promise", "least"), MUTATIONS, ids=lambda value: getattr(value, "__name__", None))
def test_a_wrong_distance_is_noticed(change, promise, least, unchanged):
    noticed = 0
    for case, before in unchanged:
        after = {found[0] for found in judge(case, Engine(distance=changed(change)), OF_DISTANCE).failures}
        noticed += any(promise in name for name in after - before)
    assert noticed >= least * len(unchanged), f"{noticed} of {len(unchanged)}"


def test_a_wrong_boolean_is_noticed():
    noticed = 0
    for number in range(30):
        case = draw(22, number, RATIO)
        engine = Engine(
            collide=lambda *a, **k: (
                not np.any(collide.collide(*a, **k)) if np.ndim(a[3]) == 2 else ~collide.collide(*a, **k)
            )
        )
        noticed += any(
            "collide" in found[0] or "booleans" in found[0]
            for found in judge(case, engine, (soak_judges.judge_ladder,)).failures
        )
    assert noticed >= 27, noticed


def test_wrong_contacts_are_noticed():
    def longer(*arguments, **options):
        found = collide.contacts(*arguments, **options)
        rows = found.rows.copy()
        rows["normal"] *= 1.001
        return type(found)(rows, found.starts)

    def none(*arguments, **options):
        found = collide.contacts(*arguments, **options)
        return type(found)(found.rows[:0].copy(), found.starts)

    for wrong, promise, least in ((longer, "contacts: |normal| = 1", 15), (none, "contacts within the margin", 15)):
        cases = [draw(23, number, RATIO, ("sphere", "box", "hull", *CURVED)) for number in range(20)]
        found = [judge(case, Engine(contacts=wrong), (soak_judges.judge_contacts,)).failures for case in cases]
        assert sum(any(name == promise for name, *_ in failures) for failures in found) >= least


def test_a_world_that_loses_a_pair_is_noticed():
    class Forgetful(collide.World):
        def distances(self, max_distance=np.inf):
            found = super().distances(max_distance)
            found.rows = found.rows[:0]
            return found

    cases = [draw(24, number, RATIO, ("sphere", "box", "hull")) for number in range(15)]
    found = [judge(case, Engine(World=Forgetful), (soak_judges.judge_world,)).failures for case in cases]
    assert (
        sum(any(name == "World.distances holds all pairs within" for name, *_ in failures) for failures in found) >= 13
    )


def test_many_bodies_at_once_and_a_batch_that_mixes_them_up_is_noticed():
    cases = [draw(SEED, number, RATIO, KINDS) for number in range(8)]
    text = _group_code(SEED, RATIO, KINDS, cases)
    told: dict = {}
    exec(text, told)  # noqa: S102 code that the soak itself wrote
    assert question(told["cases"][3]) == question(cases[3])
    assert not list(judge_group(cases, text))

    def mixed_up(A, *arguments, **options):
        found = collide.distance(A, *arguments, **options)
        if isinstance(A, list):
            found.rows = found.rows[::-1].copy()
        return found

    promises = [promise for promise, *_ in judge_group(cases, text, Engine(distance=mixed_up))]
    assert "lists of shapes in 2 threads, the bits of singles" in promises


def test_an_exception_is_a_failure():
    def breaks(*arguments, **options):
        raise ZeroDivisionError("oops")

    found = judge(draw(1, 0, RATIO, ("sphere", "box")), Engine(collide=breaks), (soak_judges.judge_ladder,)).failures
    assert len(found) == 1 and "oops" in found[0][1]


def test_summary_and_exit_status(capsys, tmp_path):
    told: list[str] = []
    tally = soak(5, 100.0, ("sphere", "box"), pairs=6, say=told.append)
    assert isinstance(tally, Tally) and not tally.promises and "no promise was broken" in tally.summary()
    assert main(["--pairs", "3", "--kinds", "sphere,box", "--save", str(tmp_path)]) == 0
    assert main(["--case", "1", "--kinds", "sphere,box"]) == 0
    assert "0/" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--kinds", "cube"])


