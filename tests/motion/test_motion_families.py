"""Times of impact of hard families of motions, judged by dense sampling and subdivision. `tests/soak` runs a
million."""

from __future__ import annotations

import motion_oracle as oracle
import motions
import numpy as np
import pytest

import collide

#: Groups of a family, and motions of a group.
GROUPS, N = 4, 40


def judged(group: motions.Group, r) -> tuple[oracle.Judged, float]:
    """What the oracle says of a result, and within how much [m] it can tell."""
    tolerance = motions.resolution(group)
    return oracle.judge(group.gap, *group.motions(), r.lower, r.upper, tolerance=tolerance), tolerance


def asked(group: motions.Group, **options):
    return collide.time_of_impact(
        group.A, group.B, *group.poses, omega_WA=group.omega_WA, omega_WB=group.omega_WB, **options
    )


def snippet(family: str, seed: list[int], k: int, r) -> str:
    return (
        f"group = motions.FAMILIES[{family!r}](np.random.default_rng({seed}), {N}); motion {k}: lower {r.lower[k]!r}, "
        f"upper {r.upper[k]!r}, hit {r.hit[k]}"
    )


@pytest.mark.many(28)
@pytest.mark.parametrize("family", list(motions.FAMILIES))
def test_no_contact_is_missed_and_none_is_made_up(family):
    n_hits = n_free = n_open = 0
    for k in range(GROUPS if family != "grazing" else 2):
        seed = [21, k, len(family)]
        group = motions.FAMILIES[family](np.random.default_rng(seed), N)
        r = asked(group)
        verdict, tolerance = judged(group, r)
        floor = 1e-5 * group.size
        closer = oracle.subdivide(group.gap, *group.motions(), r.lower, group.speeds(), floor, tolerance)
        late = np.flatnonzero(closer.missed)
        assert not len(late), f"missed at {closer.time[late[0]]!r}: " + snippet(family, seed, late[0], r)
        bad = np.flatnonzero(verdict.missed)
        assert not len(bad), f"missed by {verdict.depth[bad[0]]:.3g} m at {verdict.time[bad[0]]!r}: " + snippet(
            family, seed, bad[0], r
        )
        proven = r.hit & np.isfinite(r.upper)
        wrong = np.flatnonzero(proven & (verdict.at_upper > tolerance))
        assert not len(wrong), f"{verdict.at_upper[wrong[0]]:.3g} m apart: " + snippet(family, seed, wrong[0], r)
        assert (r.lower <= r.upper).all() and (r.time == r.lower).all()
        assert (r.upper - r.lower)[r.hit & r.certified].max(initial=0.0) <= 1e-9
        assert (~r.hit <= r.certified).all()
        n_hits, n_free, n_open = n_hits + proven.sum(), n_free + (~r.hit).sum(), n_open + (~r.certified).sum()
    assert n_hits >= 16 and n_free >= 8, "the family is to have both"
    assert n_open <= (0.25 if family == "grazing" else 0.01) * GROUPS * N


def test_grazing_motions_are_decided_or_said_to_be_open():
    group = motions.FAMILIES["grazing"](np.random.default_rng(3), 120)
    r = asked(group)
    least = oracle.judge(group.gap, *group.motions(), np.ones(120), np.ones(120), samples=96, rounds=12).least
    near = np.abs(least) < 1e-6
    assert near.sum() >= 60, "they are to graze"
    clear = least > 1e-11
    assert clear.sum() >= 20 and not r.hit[clear & (least > 1e-10)].any()
    assert r.hit[least < -1e-11].all()


def test_the_judge_sees_a_miss():
    """The oracle is not blind: answers that are late by a thousandth of the time are told from right ones."""
    n_late = n_seen = 0
    for family in ("boxes at random", "ten kilometres", "capsules at random"):
        group = motions.FAMILIES[family](np.random.default_rng(5), N)
        r = asked(group)
        late = r.hit & (r.lower > 0.0) & (r.lower < 0.99)
        by = np.where(late, 1e-3, 0.0)
        shifted = r._replace(lower=r.lower + by, upper=r.upper + by)
        speed, floor = group.speeds(), 1e-5 * group.size
        closer = oracle.subdivide(group.gap, *group.motions(), shifted.lower, speed, floor, motions.resolution(group))
        seen = judged(group, shifted)[0].missed
        assert (closer.missed | ~seen).all(), "what sampling sees, subdivision sees"
        n_late, n_seen = n_late + late.sum(), n_seen + (seen & late).sum()
        assert not (seen & ~late).any()
    assert n_late >= 20 and n_seen >= 0.8 * n_late


def test_a_contact_that_lasts_a_ten_thousandth_of_the_time_is_found():
    """Spheres of a millimetre fly past each other at ten kilometres: they touch for 2e-7 of the time."""
    rng = np.random.default_rng(8)
    n = 300
    at, share = rng.uniform(0.1, 0.9, n), rng.uniform(0.0, 1.98e-3, n)
    along = np.eye(3)[rng.integers(0, 3, n)] * 1e4
    across = np.roll(along, 1, axis=1) / 1e4 * share[:, None]
    X0, X1 = np.tile(np.eye(4), (n, 1, 1)), np.tile(np.eye(4), (n, 1, 1))
    X0[:, :3, 3], X1[:, :3, 3] = across - at[:, None] * along, across + (1.0 - at)[:, None] * along
    S = collide.Sphere(1e-3)
    r = collide.time_of_impact(S, S, np.eye(4), np.eye(4), X0, X1)
    truth = at - np.sqrt((2e-3) ** 2 - share**2) / 1e4
    assert r.hit.all()
    assert (r.lower <= truth + 1e-15).all() and (r.upper >= truth - 1e-15).all()
