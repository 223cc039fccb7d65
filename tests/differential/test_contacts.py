"""MuJoCo's and Bullet's manifolds beside ours on resting pairs; where they differ, who is right.

Boxes, hulls, cylinders standing and lying, capsules and spheres rest on boxes, hulls and cylinders, level or tilted by
up to a hundredth, sunk or above by up to a millimetre (`resting_pairs.py`); all are asked with a margin of 2 mm. Of
every manifold:

found     shares of pairs within the margin that have contacts at all
points    contacts a pair
holds     shares of pairs whose contacts carry B: its middle stands over them, up to a hundredth of its size, of those
          where it stands over what is within the margin
area      that the contacts span, as a part of what is within the margin, where that is a face (median)
depth     how far the deepest contact is off the truth [m]; normal: how much less the bodies are apart along it than
          along the best [m]; surface: how far its points are off the bodies' surfaces [m]; largest

The truth of depths and normals: pairs on which the three agree to 1e-6 m count as right. The others are judged by
the oracle, which proves a bracket of the signed distance in decimals of 80 digits. What is within the margin is found
along a grid of lines.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("scipy", reason="Qhull spans areas")
sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))
from contact_peers import BulletContacts, Manifold, MujocoContacts, manifold_of
from curved_oracle import bracket
from resting_pairs import Pair, interval, off_surface, resting_pairs, separation, support
from samples import sizes
from scipy.spatial import ConvexHull, QhullError

import collide

MARGIN = 2e-3
#: Depths and normals that differ by less agree [m].
AGREE = 1e-6
#: Pairs asked at once; lines of the grid a side.
CHUNK, GRID = 450, 32
PEERS = [peer for package, peer in (("mujoco", MujocoContacts), ("pybullet", BulletContacts))
         if importlib.util.find_spec(package)]
pytestmark = pytest.mark.skipif(not PEERS, reason="neither mujoco nor pybullet is installed")


def ask(pairs: list[Pair]) -> dict[str, list[Manifold]]:
    """Everyone's manifolds."""
    As, Bs = [p.A for p in pairs], [p.B for p in pairs]
    X_WAs, X_WBs = np.array([p.X_WA for p in pairs]), np.array([p.X_WB for p in pairs])
    c = collide.contacts(As, Bs, X_WAs, X_WBs, margin=MARGIN)
    ours = [manifold_of(r.point, r.normal, r.distance) for r in (c[k] for k in range(len(pairs)))]
    manifolds_of = {"collide": ours}
    for engine in PEERS:
        manifolds_of[engine.name] = []
        for begin in range(0, len(pairs), CHUNK):
            some = slice(begin, begin + CHUNK)
            made = engine(As[some], Bs[some], X_WAs[some], X_WBs[some], MARGIN)
            manifolds_of[engine.name] += made.manifolds()
            if engine is BulletContacts:
                made.close()
    return manifolds_of


def hull_of(flat: np.ndarray) -> tuple[float, np.ndarray]:
    """(area, corners around) of points in a plane."""
    if len(flat) > 2:
        try:
            hull = ConvexHull(flat)
            return float(hull.volume), flat[hull.vertices]
        except QhullError:
            along = (flat - flat[0]) @ np.linalg.svd(flat - flat[0])[2][0]
            flat = flat[[along.argmin(), along.argmax()]]
    return 0.0, flat


def outside(corners: np.ndarray, p: np.ndarray) -> float:
    """How far a point is from a convex polygon given around, a segment or a point; 0 within."""
    if not len(corners):
        return np.inf
    edges = np.roll(corners, -1, axis=0) - corners
    away = p - corners
    if len(corners) > 2 and (edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0] >= 0).all():
        return 0.0
    square = np.maximum((edges**2).sum(axis=1), 1e-300)
    t = np.clip((away * edges).sum(axis=1) / square, 0, 1)
    return float(np.linalg.norm(away - t[:, None] * edges, axis=1).min())


class Region:
    """What of two bodies is within the margin along n, by a grid of lines; flat coordinates across n."""

    def __init__(self, pair: Pair, n: np.ndarray):
        e = np.cross(n, np.eye(3)[np.abs(n).argmin()])
        self.axes = np.stack([e / np.linalg.norm(e), np.cross(n, e / np.linalg.norm(e))])
        low, high = (
            np.array([s * support(pair.B, pair.X_WB[:3, :3], s * axis) for axis in self.axes]) for s in (-1.0, 1.0)
        )
        self.size = float((high - low).max())
        self.middle = self.axes @ pair.X_WB[:3, 3]
        steps = (np.arange(GRID) + 0.5) / GRID
        u, v = np.meshgrid(*(self.middle[k] + low[k] + steps * (high - low)[k] for k in range(2)))
        flat = np.stack([u.ravel(), v.ravel()], axis=1)
        # From A's origin's height, so that numbers stay small.
        origins = flat @ self.axes + (pair.X_WA[:3, 3] @ n) * n
        _, top = interval(pair.A, pair.X_WA, origins, n)
        bottom, _ = interval(pair.B, pair.X_WB, origins, n)
        with np.errstate(invalid="ignore"):
            self.area, self.corners = hull_of(flat[bottom - top <= MARGIN])
        self.holds = outside(self.corners, self.middle) <= 0.01 * self.size

    def score(self, m: Manifold) -> tuple[float, float]:
        """(whether it holds, the share of the area), NaN where there is nothing to hold, and no face."""
        area, corners = hull_of(m.point @ self.axes.T)
        holds = float(outside(corners, self.middle) <= 0.01 * self.size) if self.holds else np.nan
        return holds, area / self.area if self.area > 0.05 * self.size**2 else np.nan


def score(pair: Pair, m: Manifold, region: Region) -> dict:
    if not len(m.distance):
        holds = 0.0 if region.holds else np.nan
        return {"found": 0.0, "points": 0.0, "holds": holds, "area": np.nan, "surface": np.nan}
    holds, area = region.score(m)
    half = 0.5 * m.distance[:, None] * m.normal
    surface = max(
        off_surface(shape, X, points).max()
        for shape, X, points in ((pair.A, pair.X_WA, m.point - half), (pair.B, pair.X_WB, m.point + half))
    )
    return {"found": 1.0, "points": float(len(m.distance)), "holds": holds, "area": area, "surface": surface}


def deepest(m: Manifold) -> tuple[float, np.ndarray]:
    k = int(m.distance.argmin())
    return float(m.distance[k]), m.normal[k]


def differ(pair: Pair, manifolds: list[Manifold]) -> bool:
    """Whether depths, or what normals are good for, differ, or somebody has nothing."""
    if not all(len(m.distance) for m in manifolds):
        return any(len(m.distance) for m in manifolds)
    depths, normals = zip(*(deepest(m) for m in manifolds))
    values = [*depths, *(separation(pair, n) for n in normals)]
    return max(values) - min(values) > AGREE


def truth_of(pair: Pair, manifolds: list[Manifold]) -> float:
    """The middle of the proven bracket of the signed distance; NaN where it is wider than a tenth of what counts."""
    guesses = [tuple(deepest(m)[1].tolist()) for m in manifolds if len(m.distance)]
    proven = bracket(pair.A, pair.B, pair.X_WA, pair.X_WB, guesses=guesses)
    low, high = float(proven.lower), float(proven.upper)
    return 0.5 * (low + high) if high - low < 0.1 * AGREE else np.nan


def verdict(pair: Pair, m: Manifold, truth: float) -> tuple[float, float]:
    """(error of the deepest contact, what the normal loses) [m]; inf where there is none and should be."""
    if not len(m.distance):
        return (np.inf, np.inf) if truth <= MARGIN else (0.0, 0.0)
    depth, n = deepest(m)
    return abs(depth - truth), truth - separation(pair, n)


@sizes(180, 10_000)
def test_depths_normals_and_what_carries_are_ours(n):
    pairs = resting_pairs(n, 0)
    manifolds_of, scores, errors, n_differ = ask(pairs), {}, {}, 0
    for k, pair in enumerate(pairs):
        some = {name: manifolds[k] for name, manifolds in manifolds_of.items()}
        normals = [deepest(m)[1] for m in some.values() if len(m.distance)] or [pair.X_WA[:3, 2]]
        region = Region(pair, max(normals, key=lambda n, pair=pair: separation(pair, n)))
        differs = differ(pair, list(some.values()))
        truth = truth_of(pair, list(some.values())) if differs else np.nan
        n_differ += differs
        for name, m in some.items():
            scores.setdefault((pair.kind[0], name), []).append(score(pair, m, region))
            if not np.isnan(truth):
                off = verdict(pair, m, truth)
                errors.setdefault((pair.kind[0], name), []).append(off)
                assert name != "collide" or max(off) <= AGREE, f"resting_pairs({n}, 0)[{k}]: {pair.kind}, off by {off}"
    print(f"\n{n} resting pairs, {n_differ} differ")
    for (top, name), rows in scores.items():
        means = {key: np.nanmean([row[key] for row in rows]) for key in ("found", "points", "holds")}
        means["surface"] = np.nanmax([row["surface"] for row in rows])
        areas = [row["area"] for row in rows if not np.isnan(row["area"])]
        means["area"] = np.median(areas) if areas else np.nan
        off = np.array(errors.get((top, name), [])).reshape(-1, 2)
        wrong = dict(zip(("depth wrong", "normal wrong"), (off > AGREE).sum(axis=0).tolist()))
        print(top, name, {key: f"{value:.3g}" for key, value in means.items()}, wrong)
        if name == "collide":
            assert means["surface"] < AGREE and means["holds"] > 0.75, (top, means)
    assert n_differ >= 0.02 * n
