"""Motions of robots of rings, shells and height fields against brute force that shares no code with the engine.

Links stand by `random_robots.plain_link_poses`; bodies are soups of triangles swept by balls (`naive_soups`). Two
bodies meet where an edge of one goes through a triangle of the other, or where triangles are nearer than the radii of
the balls, in numpy. A body that lies within a solid and touches no surface is not found by the judge. Dense samples of
a motion that is certified free may not meet.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from hollow_bodies import hollow
from naive import random_pose, rng_of
from naive_soups import soups_of, triangle_gap
from random_robots import plain_link_poses, random_configurations, random_robot

import collide

#: COLLIDE_SOAK_ROBOTS of more find rarer mistakes.
SEEDS, N_SAMPLES = int(os.environ.get("COLLIDE_SOAK_ROBOTS", "6")), 15


def soup_shape(rng, size: float) -> collide.Shape:
    """A body that is far from its hull, of triangles and balls alone."""
    while soups_of(shape := hollow(rng, size)) is None:
        pass
    return shape


def pierces(P: np.ndarray, Q: np.ndarray) -> bool:
    """Whether an edge of triangles P (n, 3, 3) goes through the inside of one of Q (m, 3, 3): through by a thousandth
    of both, so that rounding cannot have made it so."""
    a = P.reshape(-1, 3)
    d = np.roll(P, -1, axis=1).reshape(-1, 3) - a
    origin, e, f = Q[:, 0], Q[:, 1] - Q[:, 0], Q[:, 2] - Q[:, 0]
    across = np.cross(d[:, None], f[None])
    determinant = np.einsum("mk,nmk->nm", e, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = a[:, None] - origin[None]
        u = np.einsum("nmk,nmk->nm", s, across) / determinant
        turned = np.cross(s, e[None])
        v = np.einsum("nk,nmk->nm", d, turned) / determinant
        t = np.einsum("mk,nmk->nm", f, turned) / determinant
    small = 1e-3
    return bool(((u > small) & (v > small) & (u + v < 1 - small) & (t > small) & (t < 1 - small)).any())


def near(P: np.ndarray, Q: np.ndarray, reach: float) -> np.ndarray:
    """Triangles of P whose boxes come within the reach of the box around all of Q: others cannot meet any of Q's."""
    low, high = Q.reshape(-1, 3).min(axis=0) - reach, Q.reshape(-1, 3).max(axis=0) + reach
    return P[((P.max(axis=1) >= low) & (P.min(axis=1) <= high)).all(axis=1)]


def meet(one: list, other: list) -> bool:
    """Whether two bodies, each placed triangles with radii, clearly meet."""
    for P, radius in one:
        for Q, other_radius in other:
            reach = radius + other_radius
            P_near, Q_near = near(P, Q, reach), near(Q, P, reach)
            if not len(P_near) or not len(Q_near):
                continue
            if reach > 0.0 and triangle_gap(P_near, Q_near) < reach - 1e-9:
                return True
            if pierces(P_near, Q_near) or pierces(Q_near, P_near):
                return True
    return False


def placed(shape, X: np.ndarray) -> list:
    return [(corners @ X[:3, :3].T + X[:3, 3], radius) for corners, radius in soups_of(shape)]


class Setting:
    """A seeded robot, what stands around, and motions from configurations that hit nothing."""

    def __init__(self, seed: int):
        rng = rng_of("hollow robots", seed)
        self.robot = random_robot(rng, n_links=4, shape=soup_shape, size=0.15)
        self.world = collide.World()
        for k in range(9):
            self.world.add(soup_shape(rng, 0.2), random_pose(rng, 0.8), name=f"body{k}")
        self.checker = collide.RobotChecker(self.robot, self.world)
        Q0 = random_configurations(rng, self.robot, 150)
        self.Q0 = Q0[~self.checker.collides(Q0)][:8]
        self.Q1 = self.Q0 + rng.normal(size=self.Q0.shape)
        self.times = rng.random(N_SAMPLES)
        self.around = [placed(body.shape, body.X_WB) for body in map(self.world.body, self.world.ids)]
        disabled = {frozenset(pair[:2]) for pair in self.robot.disabled_pairs}
        links = [link for link in self.robot.links if link in self.robot.geometry]
        self.pairs = [(a, b) for k, a in enumerate(links) for b in links[k + 1 :] if frozenset((a, b)) not in disabled]

    def collides(self, q: np.ndarray) -> bool:
        """By brute force."""
        X_WL = plain_link_poses(self.robot, q)
        soups = {
            link: [soup for part in parts for soup in placed(part.shape, X_WL[link] @ part.X_LG)]
            for link, parts in self.robot.geometry.items()
        }
        return any(meet(soups[a], soups[b]) for a, b in self.pairs) or any(
            meet(soup, other) for soup in soups.values() for other in self.around
        )


@pytest.fixture(scope="module")
def settings() -> list[Setting]:
    return [Setting(seed) for seed in range(SEEDS)]


@pytest.mark.slow
def test_motions_that_are_certified_free_have_no_sample_that_meets(settings):
    free = collides = total = found = 0
    for seed, setting in enumerate(settings):
        edges = setting.checker.certify_edges(setting.Q0, setting.Q1, resolution=0.01)
        free, collides, total = free + edges.free.sum(), collides + edges.collides.sum(), total + len(edges)
        for k in range(len(edges)):
            step = setting.Q1[k] - setting.Q0[k]
            if edges.free[k]:
                hits = [t for t in setting.times.tolist() if setting.collides(setting.Q0[k] + t * step)]
                assert not hits, f"Setting({seed}), motion {k} is certified free, and meets at t = {hits[0]!r}"
            elif edges.collides[k]:
                found += any(setting.collides(setting.Q0[k] + t * step) for t in setting.times.tolist())
    assert total >= 3 * SEEDS and free >= 0.2 * total and collides >= 0.1 * total, (free, collides, total)
    assert found >= 0.7 * collides, f"the judge finds {found} of {collides} motions that collide: it would notice"


def test_configurations_that_are_free_do_not_meet_and_the_judge_finds_most_that_collide(settings):
    hits = found = 0
    for seed, setting in enumerate(settings):
        for q in random_configurations(rng_of("hollow configurations", seed), setting.robot, 12):
            says, judged = bool(setting.checker.collides(q)), setting.collides(q)
            assert says or not judged, f"Setting({seed}).collides({q.tolist()})"
            hits, found = hits + says, found + (says and judged)
    assert hits >= 4 * SEEDS and found >= 0.8 * hits, (found, hits)


def test_the_judge_knows_closed_forms():
    triangle = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    through = np.array([[[0.25, 0.25, -1.0], [0.25, 0.25, 1], [2, 2, 1]]])
    above = through + np.array([0, 0, 1.5])
    assert meet([(triangle, 0.0)], [(through, 0.0)]) and not meet([(triangle, 0.0)], [(above, 0.0)])
    ball = np.zeros((1, 3, 3)) + np.array([0.2, 0.2, 0.3])
    assert meet([(triangle, 0.0)], [(ball, 0.31)]) and not meet([(triangle, 0.0)], [(ball, 0.29)])
