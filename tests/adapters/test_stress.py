"""`stress.run` finds nothing wrong with collide on the hard families, and finds what is wrong with a liar."""

from __future__ import annotations

import json
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import collide
from collide.adapters.peers import exact, stress
from collide.adapters.peers.protocol import engine
from collide.adapters.peers.stress import Reply, run
from collide.adapters.peers.stress_truth import DIGITS, gap_along, halfspace_distance, truth
from collide.errors import InvalidArgument
from collide.results import HOW, UNDECIDED
from collide.scenes.families import Case, generate, mesh_names, names

#: Families of hundreds of vertices, where exact arithmetic takes its time.
LARGE = ("spheres_big", "cyl1000", "bipyramids", "repeats")
SMALL = [name for name in names() if name not in LARGE]
TOUCHING = ("touch_vf", "touch_ee", "touch_ff", "touch_vv", "touch_ve")


@pytest.fixture(scope="module")
def ours() -> stress.StressTable:
    return run(SMALL, n=8, seed=2)


@pytest.fixture(params=["halfspace_near", "swept_near", "near_sep"])
def case(request) -> Case:
    return generate(request.param, 1, 4)[0]


# --- collide itself -------------------------------------------------------------------------------


@pytest.mark.many(2)
@pytest.mark.parametrize("name", SMALL)
def test_nothing_is_wrong(ours, name):
    result = next(f for f in ours.families if f.family == name)
    complaint = "\n\n".join(f.snippet for f in ours.findings if f.family == name)
    assert result.wrong == result.missed == result.failed == result.unsupported == 0, complaint
    assert result.cases == result.answered == sum(result.how.values()) == 8


@pytest.mark.many(2)
@pytest.mark.parametrize("name", LARGE)
def test_nothing_is_wrong_with_many_vertices(name):
    table = run(name, n=3, seed=2)
    assert table.wrong == table.failed == 0, "\n\n".join(f.snippet for f in table.findings)


def test_every_family_by_default():
    assert [f.family for f in run(n=0).families] == [*names(), *mesh_names()]


def test_totals(ours):
    assert ours.wrong == ours.failed == 0 and ours.findings == []
    total = ours.total()
    assert total.cases == 8 * len(SMALL) and total.hits == sum(f.hits for f in ours.families)
    assert sum(total.how.values()) == total.cases and set(total.how) <= set(HOW)
    assert total.how.get(HOW[UNDECIDED], 0) == total.undecided == ours.undecided


def test_undecided_means_touching_within_rounding(ours):
    assert all((f.undecided_gap or 0.0) < 1e-13 for f in ours.families)


def test_touching_lattices_are_decided(ours):
    assert all(f.hits == 8 and f.undecided == 0 for f in ours.families if f.family in TOUCHING)


def test_printed(ours):
    headers, rows = ours.table()
    assert all(len(row) == len(headers) and all(isinstance(cell, str) for cell in row) for row in rows)
    assert [row[0] for row in rows] == [*SMALL, "all"]
    data = json.loads(json.dumps(ours.to_dict(), allow_nan=False))
    assert data["wrong"] == 0 and data["n"] == 8 and len(data["families"]) == len(SMALL)
    assert len(run("rand_sep", n=2).table()[1]) == 1  # one family is its own total


def test_a_seed_repeats(ours):
    again = run(["near_pen"], n=8, seed=2)
    assert again.families[0] == next(f for f in ours.families if f.family == "near_pen")
    assert run(["near_pen"], n=8, seed=3).families[0] != again.families[0]


def test_progress():
    seen: list[str] = []
    run(["rand_sep", "rand_pen"], n=1, progress=lambda result: seen.append(result.family))
    assert seen == ["rand_sep", "rand_pen"]


# --- what is wrong is found -----------------------------------------------------------------------


def answered_by(monkeypatch, answer, family="near_pen", n=15) -> stress.StressTable:
    """A run in which collide's honest reply goes through `answer` first."""
    honest = stress._ask_collide
    monkeypatch.setattr(stress, "_ask_collide", lambda case: answer(honest(case)))
    return run([family], n=n, seed=1)


def test_a_wrong_boolean_is_found(monkeypatch):
    table = answered_by(monkeypatch, lambda r: r._replace(hits=(not r.hits[0], r.hits[1]), undecided=False))
    (result,) = table.families
    assert table.wrong == result.wrong == result.false_misses == len(table.findings) == 15
    assert 1e-3 < result.wrong_gap < 1
    assert {f.kind for f in table.findings} == {"boolean"} and table.table()[1][0][3].startswith("15n @")


def test_the_distance_has_a_boolean_too(monkeypatch):
    table = answered_by(monkeypatch, lambda r: r._replace(hits=(r.hits[0], not r.hits[1]), undecided=False), "rand_sep")
    assert table.families[0].false_hits == 15


def test_undecided_is_not_wrong_and_is_counted(monkeypatch):
    table = answered_by(monkeypatch, lambda r: r._replace(hits=(False, False), undecided=True))
    (result,) = table.families
    assert table.wrong == 0 and result.undecided == result.undecided_wrong == 15 and result.undecided_gap > 1e-3


@pytest.mark.parametrize(
    "change",
    [
        lambda r: {"lower": r.distance + 1e-3, "distance": r.distance + 2e-3, "upper": 1e9},
        lambda r: {"lower": -1.0, "distance": r.distance - 2e-3, "upper": r.distance - 1e-3},
        lambda r: {"lower": np.nan},
        lambda r: {"upper": np.nan},
        lambda r: {"distance": np.nan},
        lambda r: {"distance": 2 * r.upper},  # the bracket holds the truth, but not the distance
    ],
)
def test_a_bracket_that_misses_is_found(monkeypatch, change):
    table = answered_by(monkeypatch, lambda r: r._replace(**change(r)), "rand_sep")
    assert table.wrong == table.families[0].missed == 15 and table.families[0].wrong == 0
    assert {f.kind for f in table.findings} == {"bracket"}


def test_a_failure_is_a_finding(monkeypatch):
    table = answered_by(monkeypatch, lambda r: Reply(failed="ValueError: no"))
    assert table.failed == 15 and table.wrong == 0 and table.families[0].reasons == {"ValueError: no": 15}
    assert {f.kind for f in table.findings} == {"failed"}
    refused = answered_by(monkeypatch, lambda r: Reply(unsupported="no such shape"))
    assert refused.failed == 0 and refused.families[0].unsupported == 15 and refused.findings == []


def test_an_exception_of_the_engine_is_a_failure(monkeypatch, case):
    def broken(*_):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(collide, "distance", broken)
    assert stress._ask_collide(case).failed == "ZeroDivisionError: by zero"


def test_findings_are_saved_with_all_their_numbers(monkeypatch, tmp_path):
    table = answered_by(monkeypatch, lambda r: r._replace(hits=(False,), distance=np.inf, upper=np.inf), n=3)
    table.save(tmp_path / "wrong.json")
    saved = json.loads((tmp_path / "wrong.json").read_text())
    assert saved["engine"] == "collide" and saved["seed"] == 1 and len(saved["findings"]) == 3
    for finding, made in zip(saved["findings"], generate("near_pen", 3, 1)):
        again = Case.from_dict(finding["case"])
        assert np.array_equal(again.P, made.P) and np.array_equal(again.t2, made.t2) and again.index == made.index
        assert float(finding["exact"]) == float(truth(made).distance) and finding["answer"]["distance"] is None
        assert finding["snippet"] == made.snippet()


def test_a_wrong_normal_shows_as_its_excess(monkeypatch):
    (honest,) = run(["rand_sep"], n=15, seed=1).families
    assert honest.normal_excess < 1e-12
    (turned,) = answered_by(monkeypatch, lambda r: r._replace(normal=tuple(np.roll(r.normal, 1))), "rand_sep").families
    assert turned.normal_excess > 1e-2 and turned.wrong == 0


def test_gap_along_a_direction_is_at_most_the_distance():
    rng = np.random.default_rng(0)
    for case in generate("swept_near", 10, 1):
        assert all(gap_along(case, rng.standard_normal(3)) <= truth(case).distance for _ in range(5))
        assert gap_along(case, (0, 0, 0)) is None and gap_along(case, (np.nan, 0, 1)) is None
    # Two swept points, the second straight above: exactly their distance less the radii.
    above = case._replace(
        P=np.zeros((1, 3)), Q=np.zeros((1, 3)), t1=np.zeros(3), t2=np.array([0, 0, 4.0]), radius_a=1, radius_b=0.5
    )
    assert gap_along(above, (0, 0, 7.0)) == truth(above).distance == Decimal("2.5")
    assert gap_along(generate("halfspace_near", 1, 1)[0], (0, 0, 1)) is None


def test_errors_are_parts_of_the_exact_value(monkeypatch):
    (result,) = answered_by(
        monkeypatch, lambda r: r._replace(distance=1.01 * r.distance, upper=2 * r.upper), "rand_sep"
    ).families
    assert result.distance_error == pytest.approx(0.01, rel=1e-6) and result.depth_error is None
    assert 0 < result.distance_error_of_size


# --- the truth ------------------------------------------------------------------------------------


def test_truth_is_the_oracle_s(case):
    if case.kind == "hulls":
        radii = {"radius_a": case.radius_a, "radius_b": case.radius_b}
        assert truth(case).distance == exact.signed_distance(*case[2:8], **radii)
        assert truth(case).hit == exact.hit(*case[2:8], **radii)


@pytest.mark.parametrize("index", range(12))
def test_half_space_distance_agrees_with_plain_arithmetic(index):
    case = generate("halfspace_near", 12, 6)[index]._replace(offset=0.25)
    rng = np.random.default_rng(index)
    case = case._replace(R1=case.R1 + 1e-5 * rng.standard_normal((3, 3)))
    # {x : m·x ≤ b} as its boundary points, carried along by the matrix as it stands
    n = np.linalg.inv(case.R1).T @ case.P[0]
    foot = case.R1 @ (case.P[0] * case.offset / (case.P[0] @ case.P[0])) + case.t1
    plain = ((case.b.world() - foot) @ n).min() / np.linalg.norm(n) - case.radius_b
    hit, distance = halfspace_distance(case)
    assert float(distance) == pytest.approx(plain, abs=1e-14) and hit == (distance <= 0)


@pytest.mark.parametrize(
    ("height", "radius"), [(5.0, 5.0), (5.0, np.nextafter(5.0, 6)), (5.0, np.nextafter(5.0, 4)), (0.0, 0.0)]
)
def test_half_space_distance_is_exact_at_touching(height, radius):
    # normal (0, 3, 4) of length 5: the point stands exactly `height` above the plane
    case = generate("halfspace_near", 1, 0)[0]._replace(
        P=np.array([[0.0, 3, 4]]), R1=np.eye(3), t1=np.zeros(3), offset=0.0, Q=np.array([[0.0, 3, 4]]) * height / 5,
        R2=np.eye(3), t2=np.zeros(3), radius_b=radius,
    )
    hit, distance = halfspace_distance(case)
    exactly = Decimal(height) - Decimal(radius)
    assert abs(distance - exactly) <= abs(exactly) * Decimal("1e-28") and hit == (radius >= height)


def test_misses_is_strict_where_the_bodies_touch():
    touching = truth(generate("touch_ee", 1, 1)[0])
    assert touching.distance == 0 and not touching.misses(0.0, 0.0)
    assert touching.misses(5e-324, 1.0) and touching.misses(-1.0, -5e-324)
    apart = truth(generate("rand_sep", 1, 1)[0])
    below = float(apart.distance)
    below = below if Decimal(below) <= apart.distance else np.nextafter(below, 0)
    assert not apart.misses(below, np.nextafter(below, np.inf)) and apart.misses(0.0, np.nextafter(below, 0))
    assert Fraction(apart.distance) == Fraction(str(apart.distance)) and len(apart.distance.as_tuple().digits) <= DIGITS


# --- other engines, refusals ----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["exact", "coal", "fcl", "pybullet"])
def test_other_engines(name):
    missing = engine(name).missing()
    if missing:
        pytest.skip(missing)
    table = run(["rand_sep", "touch_vv", "halfspace_near"], n=3, seed=5, engine=name)
    assert table.engine == name and table.version
    apart, touching, halfspaces = table.families
    assert apart.wrong == 0 and apart.answered == 3 and apart.distance_error < 0.1
    assert touching.answered == 3 and touching.hits == 3 and touching.how == {}
    assert halfspaces.answered + halfspaces.unsupported == 3
    if name == "exact":
        assert table.wrong == 0 and halfspaces.unsupported == 3
    if name == "pybullet":
        assert touching.false_misses == touching.wrong == 3  # Bullet's margins and grid


def test_batches_keep_their_order(monkeypatch):
    whole = run(["rand_pen"], n=12, seed=1, engine="exact")
    monkeypatch.setattr(stress, "BATCH", 2)
    assert run(["rand_pen"], n=12, seed=1, engine="exact") == whole
    assert whole.wrong == 0 and 0 < whole.families[0].hits < 12


def test_refused():
    with pytest.raises(InvalidArgument, match=r"no engine 'bullet'; there are .*coal \(:nesterov, .*collide, "):
        run(["rand_sep"], n=1, engine="bullet")
    with pytest.raises(InvalidArgument, match="no family has the name 'rand'; there are rand_sep, rand_pen"):
        run(["rand_sep", "rand"], n=1)
