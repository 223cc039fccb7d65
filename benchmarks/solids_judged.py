"""Pairs of solids of every family: judged by points and volumes in fractions, results looked at, manifold3d beside.

    python benchmarks/solids_judged.py
    # 3,003 pairs, 20 minutes; --pairs 20 of each family, --points 200, --families boxes rings; needs manifold3d

A line a family: pairs; points put elsewhere than the solids' own winding numbers put them, and pairs whose volumes do
not add up in fractions; results, those that are no closed solid, those with facets that cross after rounding, and how
many pairs of facets; triangles of which rounding left nothing. Of manifold3d: volumes asked, and off by more than 1e-9
of the solids', once where facets of both come within 1e-6 of one plane, once where none do; solids it does not take,
pairs left out because a solid crosses itself.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS / folder) for folder in ("families", "oracles", "solids")]
from solid_families import SOLIDS
from solid_judge import arrangement_of, exact_corners, judge, six_volumes, snippet, solids_of
from solids import asked, manifold_of

import collide
from collide.solids.arrangement import crossings_of

#: Facets are near one plane where all corners of one are this near the other's, in sizes of the solids.
NEAR = 1e-6
COLUMNS = (
    "pairs", "wrong points", "not adding up", "results", "not closed", "crossing", "crossings", "collapsed",
    "asked, flush", "wrong, flush", "asked, clear", "wrong, clear", "not taken", "crossing itself",
)  # fmt: skip


def results_of(A, B, X, Y) -> Counter:
    """What booleans of a pair are."""
    seen: Counter = Counter()
    for op in ("union", "intersection", "difference", "symmetric_difference"):
        r = collide.boolean(A, B, X, Y, op)
        seen["results"] += 1
        seen["collapsed"] += r.n_collapsed + r.n_thin
        if r.empty:
            continue
        seen["not closed"] += not (r.mesh.solid and is_balanced(r.mesh))
        seen["crossing"] += len(r.self_collisions) > 0
        seen["crossings"] += len(r.self_collisions)
    return seen


def is_balanced(mesh) -> bool:
    """Whether every edge is run along as often one way as the other, by corners' coordinates."""
    _, ids = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)
    start = ids.ravel()[mesh.faces]
    end = np.roll(start, -1, axis=1)
    ways = Counter(zip(start.ravel().tolist(), end.ravel().tolist()))
    return all(ways[q, p] == count for (p, q), count in ways.items())


def near_one_plane(A, B, X, Y) -> bool:
    """Whether a facet of one solid is nearly in the plane of one of the other that it nearly reaches."""
    corners = [mesh.vertices[mesh.faces] @ X_W[:3, :3].T + X_W[:3, 3] for mesh, X_W in ((A, X), (B, Y))]
    reach = NEAR * max(float(np.ptp(c.reshape(-1, 3), axis=0).max()) for c in corners)
    (low_a, high_a), (low_b, high_b) = ((c.min(axis=1) - reach, c.max(axis=1) + reach) for c in corners)
    a, b = np.nonzero(((low_a[:, None] <= high_b) & (low_b <= high_a[:, None])).all(axis=2))
    for (ours, p), (others, q) in (((corners[0], a), (corners[1], b)), ((corners[1], b), (corners[0], a))):
        n = np.cross(ours[:, 1] - ours[:, 0], ours[:, 2] - ours[:, 0])
        with np.errstate(all="ignore"):
            n = n / np.sqrt(np.square(n).sum(axis=1))[:, None]
        heights = ((others[q] - ours[p, :1]) * n[p][:, None]).sum(axis=2)
        if (~(np.abs(heights).max(axis=1) > reach)).any():
            return True
    return False


def beside_manifold(A, B, X, Y) -> Counter:
    if len(crossings_of(A)) or len(crossings_of(B)):
        return Counter({"crossing itself": 1})
    first, second = (
        manifold_of(mesh.vertices @ X_W[:3, :3].T + X_W[:3, 3], mesh.faces) for mesh, X_W in ((A, X), (B, Y))
    )
    if first.is_empty() or second.is_empty():
        return Counter({"not taken": 1})
    kind = "flush" if near_one_plane(A, B, X, Y) else "clear"
    arrangement = arrangement_of(A, B, X, Y)
    held = arrangement.holds()
    size = float(first.volume() + second.volume())
    seen: Counter = Counter()
    for sign, keep in (("+", held.any(axis=1)), ("^", held.all(axis=1)), ("-", held[:, 0] & ~held[:, 1])):
        exact = float(six_volumes(exact_corners(arrangement, arrangement.boundary(keep)[0], [0, 0, 0])) / 6)
        seen[f"asked, {kind}"] += 1
        seen[f"wrong, {kind}"] += abs(asked(first, second, sign)[1] - exact) > 1e-9 * size
    return seen


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=231)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--points", type=int, default=200)
    parser.add_argument("--families", nargs="*", default=list(SOLIDS), choices=list(SOLIDS))
    arguments = parser.parse_args()
    print(f"{'family':20s}" + "".join(f"{name:>16s}" for name in COLUMNS))
    total: Counter = Counter()
    for family in arguments.families:
        seen: Counter = Counter()
        for seed in range(arguments.first, arguments.first + arguments.pairs):
            pair = solids_of(family, seed)
            verdict = judge(*pair, arguments.points, seed)
            if verdict.wrong or not verdict.adds_up:
                print(f"WRONG: {snippet(family, seed)}", flush=True)
            seen.update({"pairs": 1, "wrong points": len(verdict.wrong), "not adding up": int(not verdict.adds_up)})
            seen.update(results_of(*pair))
            seen.update(beside_manifold(*pair))
        total.update(seen)
        print(f"{family:20s}" + "".join(f"{seen[name]:16d}" for name in COLUMNS), flush=True)
    print(f"{'all':20s}" + "".join(f"{total[name]:16d}" for name in COLUMNS), flush=True)


if __name__ == "__main__":
    main()
