"""MuJoCo's and Bullet's manifolds beside ours on 10,000 resting pairs; where they differ, who is right.

    python benchmarks/contact_agreement.py      # some minutes; prints tables, writes results/contact-agreement_*.csv
    python benchmarks/contact_agreement.py --pairs 900 --judge 40 --no-csv

Boxes, hulls, cylinders standing and lying, capsules and spheres rest on boxes, hulls and cylinders, level or tilted by
up to a hundredth, sunk or above by up to a millimetre (`resting_pairs.py`); all are asked with a margin of 2 mm. Of
every manifold:

found     shares of pairs within the margin that have contacts at all
points    contacts a pair
holds     shares of pairs whose contacts carry B: its middle stands over them, up to a hundredth of its size, of those
          where it stands over what is within the margin
area      that the contacts span, as a part of what is within the margin, where that is a face (median)
depth     how far the deepest contact is off the truth [m]; normal: how much less the bodies are apart along it than
          along the best [m]; surface: how far its points are off the bodies' surfaces [m]; medians and largest

The truth of depths and normals: pairs on which the three agree to 1e-6 m count as right. The others are judged by
`tests/oracles/curved_oracle.py`, which proves a bracket of the signed distance in decimals of 80 digits and shares no
code with any of them; a draw of them where they are many. What is within the margin is found along a grid of lines.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).resolve().parents[1] / "tests" / "oracles")]
from contact_peers import BulletContacts, Manifold, MujocoContacts, installed, manifold_of
from convex import aligned, log, say, write
from curved_oracle import bracket
from resting_pairs import Pair, interval, off_surface, resting_pairs, separation, support
from scipy.spatial import ConvexHull, QhullError
from startup import machine

import collide

MARGIN = 2e-3
#: Depths and normals that differ by less agree [m].
AGREE = 1e-6
#: Pairs asked at once; lines of the grid a side.
CHUNK, GRID = 450, 32


class Scores(dict):
    """What is measured of one manifold; NaN where it does not apply."""


def ask(pairs: list[Pair]) -> dict[str, list[Manifold]]:
    """Everyone's manifolds."""
    As, Bs = [p.A for p in pairs], [p.B for p in pairs]
    X_WAs, X_WBs = np.array([p.X_WA for p in pairs]), np.array([p.X_WB for p in pairs])
    c = collide.contacts(As, Bs, X_WAs, X_WBs, margin=MARGIN)
    ours = [manifold_of(r.point, r.normal, r.distance) for r in (c[k] for k in range(len(pairs)))]
    manifolds_of = {"collide": ours}
    for engine in installed([MujocoContacts, BulletContacts]):
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


def score(pair: Pair, m: Manifold, region: Region) -> Scores:
    if not len(m.distance):
        return Scores(found=0.0, points=0.0, holds=0.0 if region.holds else np.nan, area=np.nan, surface=np.nan)
    holds, area = region.score(m)
    half = 0.5 * m.distance[:, None] * m.normal
    surface = max(
        off_surface(shape, X, points).max()
        for shape, X, points in ((pair.A, pair.X_WA, m.point - half), (pair.B, pair.X_WB, m.point + half))
    )
    return Scores(found=1.0, points=float(len(m.distance)), holds=holds, area=area, surface=surface)


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


def judged(pairs: list[Pair], manifolds_of: dict[str, list[Manifold]], max_judged: int) -> tuple[dict, dict, Counter]:
    """{(engine, k): (error, loss)}, what was judged {k: truth}, and how many differ by kind of top."""
    differing = [k for k, pair in enumerate(pairs) if differ(pair, [manifolds_of[name][k] for name in manifolds_of])]
    counts = Counter(pairs[k].kind[0] for k in differing)
    drawn = differing
    if len(differing) > max_judged:
        drawn = sorted(np.random.default_rng(1).choice(differing, max_judged, replace=False).tolist())
    started, truths = time.perf_counter(), {}
    for k in drawn:
        truths[k] = truth_of(pairs[k], [manifolds_of[name][k] for name in manifolds_of])
    say(f"{len(differing)} of {len(pairs)} pairs differ; {len(drawn)} judged in {time.perf_counter() - started:.0f} s")
    errors = {(name, k): verdict(pairs[k], manifolds_of[name][k], truths[k]) for name in manifolds_of for k in drawn}
    return errors, truths, counts


def summary(rows: list[Scores], key: str, of) -> float:
    values = np.array([row[key] for row in rows if not np.isnan(row[key])])
    return float(of(values)) if len(values) else np.nan


def table_rows(pairs: list[Pair], scores: dict, errors: dict, truths: dict, counts: Counter) -> list[dict]:
    rows = []
    for top in dict.fromkeys(pair.kind[0] for pair in pairs):
        of_top = [k for k, pair in enumerate(pairs) if pair.kind[0] == top]
        judged_here = [k for k in of_top if k in truths and not np.isnan(truths[k])]
        for name in scores:
            some = [scores[name][k] for k in of_top]
            pairs_of = np.array([errors[name, k] for k in judged_here]).reshape(-1, 2)
            depth, normal = pairs_of.T
            rows.append({
                "top": top, "engine": name, "pairs": len(of_top), "found": summary(some, "found", np.mean),
                "points": summary(some, "points", np.mean), "holds": summary(some, "holds", np.mean),
                "area": summary(some, "area", np.median), "surface_median": summary(some, "surface", np.median),
                "surface_max": summary(some, "surface", np.max), "differ": counts[top], "judged": len(judged_here),
                "right": int(((depth <= AGREE) & (normal <= AGREE)).sum()),
                "depth_wrong": int((depth > AGREE).sum()), "normal_wrong": int((normal > AGREE).sum()),
                "depth_max": float(depth[np.isfinite(depth)].max(initial=0.0)),
                "normal_max": float(normal[np.isfinite(normal)].max(initial=0.0)),
            })  # fmt: skip
    return rows


def show(rows: list[dict]) -> None:
    def cell(value) -> str:
        return value if isinstance(value, str) else f"{value:,}" if isinstance(value, int) else f"{value:.3g}"

    aligned("contacts of resting pairs", [list(rows[0]), *([cell(v) for v in row.values()] for row in rows)])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10_000, help="how many (default: 10,000)")
    parser.add_argument("--judge", type=int, default=10_000, help="how many that differ are judged (default: all)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-csv", action="store_true", help="print the tables alone")
    options = parser.parse_args()
    pairs = resting_pairs(options.pairs, options.seed)
    manifolds_of = ask(pairs)
    scores: dict[str, list[Scores]] = {name: [] for name in manifolds_of}
    for k, pair in enumerate(pairs):
        normals = [deepest(some[k])[1] for some in manifolds_of.values() if len(some[k].distance)] or [pair.X_WA[:3, 2]]
        region = Region(pair, max(normals, key=lambda n, pair=pair: separation(pair, n)))
        for name in manifolds_of:
            scores[name].append(score(pair, manifolds_of[name][k], region))
    errors, truths, counts = judged(pairs, manifolds_of, options.judge)
    rows = table_rows(pairs, scores, errors, truths, counts)
    show(rows)
    worst = [k for (name, k), both in errors.items() if name == "collide" and max(both) > AGREE]
    for k in worst[:10]:
        log(f"ours is wrong: resting_pairs({k + 1}, {options.seed})[-1], {pairs[k].kind}, {errors['collide', k]}")
    if not options.no_csv:
        texts = [{key: f"{v:.4g}" if isinstance(v, float) else v for key, v in row.items()} for row in rows]
        log(f"written: {write('contact-agreement', texts, machine()).name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
