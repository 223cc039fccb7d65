"""Lines through Minkowski differences: the outline, the first portal and rounded guesses, called as Python, against all
vertices at once.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from naive import hull_points, random_pose, rng_of
from reproduction import reproducing

import collide
from collide.casts import portal, rounded_entry, silhouette
from collide.casts.posed_parts import posed_sides
from collide.kernels import address_of, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk.minkowski_difference import POINT, point_at
from collide.narrowphase.posed_pair import posed_pair, radius_of, size_and_slop
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

SOURCE = "P, Q, d = {P}, {Q}, {d}  # world points of A and of B; tests/casts/test_line_kernels.py"


class Drawn:
    """A cast of two hulls, swept by balls or not, and everything that has to stay in memory for it."""

    def __init__(self, rng, radius: float, spread: float):
        hulls = [collide.ConvexHull(0.5 * hull_points(rng, int(rng.integers(1, 10))), radius=radius) for _ in range(2)]
        X = [random_pose(rng, 0.3) for _ in range(2)]
        X[0][:3, 3] -= 3.0 * (along := rng.normal(size=3)) / np.linalg.norm(along)
        d = X[1][:3, 3] - X[0][:3, 3] + spread * rng.normal(size=3)
        self.d = d / (2.0 * np.abs(d).max())
        self.P, self.Q = (h.points @ Y[:3, :3].T + Y[:3, 3] for h, Y in zip(hulls, X))
        self.pairs = posed_sides(*hulls, X[0][None], X[1][None], 1).all_pairs(np.arange(1))
        self.doubles, self.integers = (
            np.zeros(silhouette.CAST_DOUBLES),
            np.zeros(silhouette.CAST_INTEGERS, dtype=np.int64),
        )
        table, (pa, pb) = self.pairs.parts.table, self.pairs.pairs[0].tolist()
        ints = view_i64(table.addresses[0], INTS * len(table.packed))
        numbers = view_f64(table.addresses[1], NUMBERS * len(table.packed))
        poses, (sa, sb) = self.pairs.parts.poses.rows.ravel(), self.pairs.parts.shape_of[[pa, pb]].tolist()
        pair = posed_pair(ints, numbers, poses, sa, pa, sb, pb)
        size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
        self.radius = 2.0 * radius
        self.cast = silhouette.open_cast(
            pair, Vec3(*self.d.tolist()), radius_of(pair, pair.A), radius_of(pair, pair.B), ERROR * size + slop, size,
            address_of(self.doubles), address_of(self.integers),
        )
        #: Points of A ⊖ B.
        self.D = (self.P[:, None] - self.Q[None]).reshape(-1, 3)

    def height(self, v) -> float:
        """How far A ⊖ B reaches along a vector."""
        return float((self.D @ v).max()) + self.radius * float(np.linalg.norm(v))

    def clearance(self) -> float:
        """How deep the line is in the difference seen along it, by many directions; negative outside."""
        across, up = (np.array(v) for v in (self.cast.across, self.cast.up))
        angles = np.linspace(0, 2 * np.pi, 720, endpoint=False)
        v = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * up
        return float((self.D @ v.T).max(axis=0).min()) + self.radius


def vector(v) -> np.ndarray:
    return np.array([v.x, v.y, v.z])


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_support_points_are_the_farthest(radius):
    rng = rng_of("sample", radius)
    for _ in range(15):
        case, v = Drawn(rng, radius, 0.5), rng.normal(size=3)
        e = vector(case.cast.e)
        axes = np.array([vector(case.cast.across), vector(case.cast.up), e / case.cast.length])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-15)
        assert np.array_equal(e, -case.d) and np.linalg.det(axes) > 0  # across, up, e are right-handed
        found = silhouette.sample(case.cast, 5, Vec3(*v.tolist()))
        assert found == pytest.approx(case.height(v), abs=1e-12)
        w = vector(point_at(case.cast.points, 5))
        assert w @ v == pytest.approx(found, abs=1e-12)
        np.testing.assert_allclose(case.cast.seen[10:12], axes[:2] @ w, rtol=0, atol=1e-14)


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_outlines_tell_lines_that_pass_from_those_that_cross(radius):
    rng, seen = rng_of("outlines", radius), Counter()
    for _ in range(40):
        case = Drawn(rng, radius, 0.7)
        with reproducing(SOURCE, P=case.P, Q=case.Q, d=case.d):
            outline, truth = silhouette.line_through(case.cast), case.clearance()
            seen[outline.outcome] += 1
            if outline.outcome == silhouette.MISSED:
                assert truth < 1e-4
            elif outline.outcome == silhouette.CROSSED:
                assert outline.n > 2 and 0.0 < outline.clearance <= truth + 1e-4
                at = case.cast.ring[: outline.n]
                x, y = case.cast.seen[2 * at], case.cast.seen[2 * at + 1]
                turns = x * np.roll(y, -1) - y * np.roll(x, -1)
                assert (turns > 0.0).all()  # counter-clockwise, with the line to the left of every edge
            else:
                assert abs(truth) < 1e-3 or outline.n < 3
    assert min(seen[silhouette.MISSED], seen[silhouette.CROSSED]) > 6, seen


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_entries_lie_on_a_plane_that_all_is_behind(radius):
    """lower: a plane across the normal has all of the difference behind; value: a point of it near the line."""
    rng, seen = rng_of("entries", radius), Counter()
    for _ in range(30):
        case = Drawn(rng, radius, 0.5)
        with reproducing(SOURCE, P=case.P, Q=case.Q, d=case.d):
            met = portal.cast_line(case.cast, math.inf, False)
            seen[met.status] += 1
            if met.status == portal.MISS:
                assert case.clearance() < 1e-4 or case.height(-case.d) < 0.0
            if met.status != portal.HIT:
                continue
            n = vector(met.normal)
            assert abs(np.linalg.norm(n) - 1.0) < 1e-12 and n @ case.d > 0.0
            assert case.height(n) + met.lower * float(n @ case.d) < 1e-9
            assert 0.0 < met.lower <= met.value <= met.upper < met.lower + 1e-6
            behind = portal.cast_line(case.cast, 0.5 * met.lower, False)
            assert behind.status == portal.MISS and (behind.lower, behind.upper) == (met.lower, met.upper)
            within = portal.cast_line(case.cast, 0.5 * (met.lower + met.upper), False)
            assert within.status == (portal.OPEN if met.upper > met.lower else portal.HIT)
            # the point where A touches: in B's frame of axes from its origin, on B's own surface along the normal
            touching = float(n @ (vector(met.point) + case.pairs.parts.body_poses[case.pairs.pairs[0, 1], :3, 3]))
            assert touching == pytest.approx(float((case.Q @ n).min()) - 0.5 * case.radius, abs=1e-7)
    assert seen[portal.HIT] > 8, seen


def test_bodies_behind_are_missed_unless_the_whole_line_counts():
    rng, n = rng_of("behind"), 0
    for _ in range(12):
        case = Drawn(rng, 0.0, 0.1)
        there = portal.cast_line(case.cast, math.inf, False)
        back = case.cast._replace(e=Vec3(*case.d.tolist()), up=Vec3(*(-vector(case.cast.up)).tolist()))
        behind = portal.cast_line(back, math.inf, False)
        whole = portal.cast_line(back, math.inf, True)
        if there.status != portal.HIT:
            continue
        n += 1
        assert behind.status == portal.MISS and whole.status in (portal.BEHIND, portal.OPEN)
        assert whole.upper <= 0.0 and whole.lower <= -there.lower + 1e-9
    assert n > 4


@pytest.mark.parametrize("features", [1, 2, 3])
def test_rounded_guesses_are_of_their_features(features):
    """A ball, a cylinder, a plane: the guess lies on the line, on the swept surface, with the normal of its feature."""
    rng, n_exist = rng_of("guesses", features), 0
    for _ in range(60):
        case = Drawn(rng, 0.25, 0.2)
        cast, slots = case.cast, (10, 11, 12)
        ids = [(int(rng.integers(len(case.P))), int(rng.integers(len(case.Q)))) for _ in range(features)]
        if len(set(ids)) < features:
            continue
        for k, slot in enumerate(slots):
            cast.ids[2 * slot], cast.ids[2 * slot + 1] = ids[min(k, features - 1)]
        guess = rounded_entry.guess_entry(cast, *slots)
        if not guess.exists:
            continue
        n_exist += 1
        n, w, e = vector(guess.normal), vector(guess.w), vector(cast.e)
        corners = np.array([case.P[i] - case.Q[j] for i, j in ids])
        with reproducing(SOURCE, P=case.P, Q=case.Q, d=case.d):
            assert abs(np.linalg.norm(n) - 1.0) < 1e-9 and n @ e < 1e-9
            np.testing.assert_allclose(np.cross(w, e), 0.0, rtol=0, atol=1e-9)
            foot = w - case.radius * n
            weights, *_ = np.linalg.lstsq(np.vstack([corners.T, np.ones(features)]), np.append(foot, 1.0), rcond=None)
            np.testing.assert_allclose(corners.T @ weights, foot, rtol=0, atol=1e-7)
            assert weights.min() > -1e-7
            for edge in corners[1:] - corners[0]:
                assert abs(edge @ n) < 1e-7
    assert n_exist > 3
    for k in range(2):  # an unnamed vertex: nothing is guessed
        cast.ids[2 * slots[k] + k] = -1
        assert not rounded_entry.guess_entry(cast, *slots).exists


def test_workspace_is_as_large_as_said():
    case = Drawn(rng_of("workspace"), 0.0, 0.1)
    assert len(case.cast.points) + len(case.cast.seen) == silhouette.CAST_DOUBLES
    assert len(case.cast.ids) + len(case.cast.ring) == silhouette.CAST_INTEGERS
    assert len(case.cast.points) == POINT * silhouette.SLOTS
