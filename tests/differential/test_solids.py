"""Pairs of solids of every family: judged by points and volumes in fractions, results looked at, manifold3d beside.

A line a family: points put elsewhere than the solids' own winding numbers put them, and pairs whose volumes do not
add up in fractions (none may be); results, those that are no closed solid (none), those with facets that cross after
rounding, and how many pairs of facets; triangles of which rounding left nothing. Of manifold3d: volumes asked, and
off by more than 1e-9 of the solids', once where facets of both come within 1e-6 of one plane, once where none do;
solids it does not take, pairs left out because a solid crosses itself.
"""

from __future__ import annotations

import importlib.util
from collections import Counter

import numpy as np
from manifold_solids import OPERATIONS, asked, manifold_of
from many_judge import CASES, judge_many
from samples import sizes, told
from solid_families import SOLIDS
from solid_judge import arrangement_of, exact_corners, judge, six_volumes, snippet, solids_of

import collide
from collide.solids.arrangement import crossings_of

#: Facets are near one plane where all corners of one are this near the other's, in sizes of the solids.
NEAR = 1e-6


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
    for op, keep in zip(OPERATIONS, (held.any(axis=1), held.all(axis=1), held[:, 0] & ~held[:, 1])):
        exact = float(six_volumes(exact_corners(arrangement, arrangement.boundary(keep)[0], [0, 0, 0])) / 6)
        seen[f"asked, {kind}"] += 1
        seen[f"wrong, {kind}"] += abs(asked(first, second, op)[1] - exact) > 1e-9 * size
    return seen


@sizes(1, 231)
def test_solids_are_put_where_winding_numbers_put_them(n):
    """n pairs of each family."""
    has_manifold = importlib.util.find_spec("manifold3d") is not None
    for family in list(SOLIDS)[:: 7 if n == 1 else 1]:
        seen: Counter = Counter()
        for seed in range(n):
            pair = solids_of(family, seed)
            verdict = judge(*pair, 20 if n == 1 else 200, seed)
            assert not verdict.wrong and verdict.adds_up, f"{snippet(family, seed)}: {verdict.wrong}"
            seen.update({"pairs": 1, "points": verdict.n_points})
            seen.update(results_of(*pair))
            if has_manifold:
                seen.update(beside_manifold(*pair))
        told(family, seen)
        assert seen["results"] == 4 * n and not seen["not closed"], (family, seen)


@sizes(1, 20)
def test_sets_of_solids_are_put_where_five_rules_put_them(n):
    """n sets of 2 to 8 solids of each family."""
    for family, r in CASES[:: 12 if n == 1 else 1]:
        verdicts = [judge_many(family, seed, r, 20 if n == 1 else 200) for seed in range(n)]
        assert not any(v.wrong or not v.adds_up for v in verdicts), [(family, r, v.wrong) for v in verdicts]
        counts = {name: sum(getattr(v, f"n_{name}") for v in verdicts) for name in ("points", "near")}
        told(f"{family}, {r} solids", Counter(counts))
