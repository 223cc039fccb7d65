"""Chains of random solid operations, each result the next one's operand, judged after every step.

    python tests/soak/soak_solids.py --chains 1000 [--seed 1] [--steps 100] [--families "general position,one frame"]

Families, in turns: general position; one turned frame on a grid of halves, where faces are flush; the same an ulp or
two off; sizes from 1 to 10⁻⁶. After every step the mesh has to be a solid whose edges balance, without crossing facets
(`collide.self_collisions`; every 20th result by `naive_triangles.py` as well) and without flat facets, in fractions;
its volume has to be what the operands' volumes and their exact overlap say, within what rounding may move. Where
manifold3d is installed, it goes the same way with its own results, and facets are compared. Prints a row a family:
chains, steps, refused, open, crossing, flat, wrong volumes, more than 1.2 times manifold3d's facets, facets of both,
how far the surface was moved in units in the last place of the size (99 of 100, and the farthest), and milliseconds
(median, longest). Failures come with the seed. Ends with status 1 where anything but time and number failed. A chain
takes two to five seconds.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(TESTS / "oracles"), str(TESTS / "solids")]

import numpy as np
from manifold_solids import manifold_of
from naive_triangles import cross, facet_pairs, minus

import collide

I = np.eye(4)
FAMILIES = ("general position", "one frame", "an ulp off", "mixed sizes")
COLUMNS = ("steps", "refused", "open", "crossing", "flat", "volume", "moved far", "many facets")
FAILURES = COLUMNS[1:7]
#: Units in the last place of the largest coordinate: farther is a failure.
_FAR = 256.0
#: Facets compared with all others by the naive oracle in every 20th result.
_NAIVE_EVERY, _NAIVE_MOST = 20, 150


def drawn_box(rng: np.random.Generator, family: str, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(size (3,), pose) of the next box of a chain."""
    X = np.eye(4)
    X[:3, :3] = R
    if family == "general position":
        return rng.uniform(0.5, 1.5, 3), collide.pose(rng.uniform(-1.5, 1.5, 3), rpy=rng.uniform(-3, 3, 3))
    if family == "mixed sizes":
        X[:3, 3] = R @ (rng.integers(-3, 4, 3) * 0.25)
        return 10.0 ** rng.uniform(-6, 0) * rng.integers(1, 4, 3) * 0.5, X
    X[:3, 3] = R @ (rng.integers(-3, 4, 3) * 0.5)
    if family == "an ulp off":
        X[:3, 3] += rng.integers(-2, 3, 3) * np.spacing(np.abs(X[:3, 3]))
    return rng.integers(1, 4, 3) * 0.5, X


def facets_of(size, X) -> tuple[np.ndarray, np.ndarray]:
    """A box's vertices in W, rounded, and its faces."""
    vertices, faces = collide.tessellate(collide.Box(size), tolerance=1.0)[:2]
    return vertices @ X[:3, :3].T + X[:3, 3], faces


def edges_balance(faces: np.ndarray) -> bool:
    """Whether every edge is run along as often one way as the other."""
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    n = int(faces.max()) + 1
    keys = np.minimum(starts, ends).astype(np.int64) * n + np.maximum(starts, ends)
    order = np.argsort(keys)
    sums = np.add.reduceat(np.where(starts < ends, 1, -1)[order], np.flatnonzero(np.diff(keys[order], prepend=-1)))
    return not sums.any()


def has_flat_facets(mesh: collide.Mesh) -> bool:
    """Whether a facet has area 0, in fractions."""
    corners = mesh.vertices[mesh.faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    thin = np.sqrt((n * n).sum(axis=1)) < 1e-13 * np.abs(corners).max() ** 2
    for a, b, c in corners[thin].tolist():
        p, q, r = ([Fraction(x) for x in point] for point in (a, b, c))
        if not any(cross(minus(q, p), minus(r, p))):
            return True
    return False


def crosses_by_the_oracle(mesh: collide.Mesh, rng: np.random.Generator) -> bool:
    """Whether some facets without a common corner meet others, in fractions."""
    rows = rng.permutation(len(mesh.faces))[:_NAIVE_MOST]
    some = mesh.faces[rows]
    pairs = facet_pairs(mesh.vertices, some, I, mesh.vertices, mesh.faces, I)
    return any(not set(some[i].tolist()) & set(mesh.faces[j].tolist()) for i, j in pairs)


class Tally:
    """What was judged of one family."""

    def __init__(self) -> None:
        self.counts = Counter(dict.fromkeys(COLUMNS, 0))
        self.chains = 0
        self.facets: list[tuple[int, int]] = []
        self.moved: list[float] = []
        self.seconds: list[float] = []

    def failed(self) -> bool:
        return any(self.counts[name] for name in FAILURES)

    def line(self, family: str) -> str:
        ours, peer = np.array(self.facets).mean(axis=0) if self.facets else (0.0, 0.0)
        ms, moved = np.array(self.seconds or [0.0]) * 1e3, np.array(self.moved or [0.0])
        cells = [f"{family:18}{self.chains:>7}", *(f"{self.counts[name]:>12}" for name in COLUMNS)]
        cells += [f"{ours:>8.0f}{peer:>8.0f}{np.quantile(moved, 0.99):>8.2f}{moved.max():>9.1f}"]
        return "".join(cells) + f"{np.median(ms):>8.1f}{ms.max():>8.0f}"


def volume_is_off(r, A: collide.Mesh, B: collide.Box, X, op: str, before: float) -> bool:
    """Whether the volume is other than the operands' and their overlap's by more than rounding may move."""
    v = collide.overlap_volume(A, B, I, X)
    of_B = float(np.prod(B.size))
    wanted = {"union": before + of_B - v.volume, "intersection": v.volume, "difference": before - v.volume}[op]
    corners = r.mesh.vertices[r.mesh.faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.sqrt((n * n).sum(axis=1)).sum())
    sums = 1e-14 * (before + of_B)
    return abs(r.mesh.report.volume - wanted) > r.moved * 1.01 * area + v.upper - v.lower + sums


def soak_chain(family: str, seed: list[int], steps: int, tally: Tally, with_peer: bool) -> None:
    """One chain, judged after every step."""
    rng = np.random.default_rng(seed)
    R = collide.pose((0, 0, 0), rpy=rng.uniform(-3, 3, 3))[:3, :3]
    _, X = drawn_box(rng, family, R)
    vertices, faces = facets_of((2.0, 2.0, 2.0), X)
    made = collide.Mesh(vertices, faces)
    peer = manifold_of(vertices, faces) if with_peer else None
    tally.chains += 1
    for step in range(steps):
        size, X = drawn_box(rng, family, R)
        op = str(rng.choice(["union", "difference", "intersection"], p=[0.45, 0.45, 0.1]))
        size = np.array([1.5, 2.0, 2.0]) if op == "intersection" and family == "mixed sizes" else size
        size = 3.0 * size if op == "intersection" else size
        B = collide.Box(size)
        before = made.report.volume
        begin = time.perf_counter()
        try:
            r = collide.boolean(made, B, I, X, op)
        except collide.CollideError as error:
            tally.counts["refused"] += 1
            print(f"FAILED {family} {seed} step {step}: {op} refused: {error}")
            return
        tally.seconds.append(time.perf_counter() - begin)
        tally.counts["steps"] += 1
        if r.empty or r.mesh.report.volume < 1e-3:
            continue
        crossing = len(collide.self_collisions(r.mesh).pairs) > 0
        wrong = {
            "open": not r.mesh.solid or not edges_balance(r.mesh.faces),
            "crossing": crossing or (step % _NAIVE_EVERY == 0 and crosses_by_the_oracle(r.mesh, rng)),
            "flat": has_flat_facets(r.mesh),
            "volume": volume_is_off(r, made, B, X, op, before),
            "moved far": r.moved > _FAR * np.spacing(np.abs(r.mesh.vertices).max()),
        }
        for name in [name for name, is_wrong in wrong.items() if is_wrong]:
            tally.counts[name] += 1
            print(f"FAILED {family} {seed} step {step}: {op}: {name}")
        tally.moved.append(r.moved / np.spacing(np.abs(r.mesh.vertices).max()))
        if with_peer:
            N = manifold_of(*facets_of(size, X))
            peer = peer + N if op == "union" else peer ^ N if op == "intersection" else peer - N
            tally.facets.append((len(r.mesh.faces), peer.num_tri()))
            tally.counts["many facets"] += len(r.mesh.faces) > 1.2 * peer.num_tri()
        made = r.mesh


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chains", type=int, default=40)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--families", default=",".join(FAMILIES))
    options = parser.parse_args(arguments)
    families = options.families.split(",")
    tallies = {family: Tally() for family in families}
    with_peer = find_spec("manifold3d") is not None
    for k in range(options.chains):
        family = families[k % len(families)]
        seed = [options.seed, FAMILIES.index(family), k // len(families)]
        soak_chain(family, seed, options.steps, tallies[family], with_peer)
    titles = [f"{name:>12}" for name in COLUMNS]
    titles += [f"{name:>8}" for name in ("facets", "peer", "ulp 99%")] + [f"{'most':>9}{'ms':>8}{'most':>8}"]
    print(f"{'family':18}{'chains':>7}" + "".join(titles))
    for family, tally in tallies.items():
        print(tally.line(family))
    return int(any(tally.failed() for tally in tallies.values()))


if __name__ == "__main__":
    sys.exit(main())
