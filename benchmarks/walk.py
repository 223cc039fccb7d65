"""The walk of Barba and Langerman: rounds, constant-size tests a round and time against the number of vertices.

    python benchmarks/walk.py                # some minutes; --only kind=sphere, --plot FILE

Pairs of bodies of n vertices of several kinds, at poses of which about half meet and many nearly touch. Counts are
exact, so they are fitted: rounds ≤ a + b·(log2 n + log2 m), for the mean and for the largest of all poses, and tests a
round, which must not grow: a mean above MAX_TESTS ends the run with an error. Every answer is compared with the
default's, in turns with which it is timed, µs of the processor a query. Two hybrids are beside: the walk that tries
every new plane against the whole bodies at once ("early kernel"), and the default given the walk's last plane to begin
with, free of charge ("default with axes").
"""

from __future__ import annotations

import time

import numpy as np
from inputs import directions, rotations, use_tests
from supports import cloud

use_tests("papers/hierarchies")
import hierarchy_families as families

import collide
from collide.adapters.bench.claims import Claim, Options, Race, check, grid, main
from collide.adapters.bench.growth import Panel, log2_lines
from collide.lowering.parts import convex_set_of
from collide.papers.hierarchies.run_walk import run_walks
from collide.papers.hierarchies.walk import APART

SIZES = (32, 128, 512, 2048, 8192, 32768, 131072, 1000000)
KINDS = ("sphere", "pancake", "cylinder", "bipyramid", "doubling", "moment curve")
#: Tests a round that no row may exceed in the mean. A round scans what went beside one vertex, some ten vertices, and
#: one in ten plays a game of two stars. The most, 16.7, is of a bipyramid of 128 vertices, whose two apexes are in play
#: in many of its 17 rounds; larger bodies have less.
MAX_TESTS = 20.0
POSES = 1000


def body(kind: str, n: int, seed: int) -> collide.ConvexHull:
    """About n vertices. "doubling" is the example of section 4: the degree of one vertex doubles level by level."""
    if kind == "doubling":
        return collide.ConvexHull(families.degree_doubling(round(np.log2(n / 3))))
    if kind == "moment curve":  # t from −1 in steps so short that t³ is a double: rounded, it would take minutes
        t = (np.arange(n + seed) - n // 2) / 2.0 ** np.ceil(np.log2(n // 2))
        return collide.ConvexHull(np.column_stack([t, t * t, t**3]))
    points = cloud(kind, n + seed)
    return collide.ConvexHull(points)


def poses(A, B, rng) -> np.ndarray:
    """A turned at random about the origin, and moved so far along a random line that the bodies are near touching."""
    X = np.tile(np.eye(4), (POSES, 1, 1))
    X[:, :3, :3], line = rotations(rng.standard_normal((POSES, 4))), directions(rng, POSES)
    # Extents along the line overlap by −10 % to 30 %; a random tenth is at a thousandth of that.
    reach_a = extents(A.points, np.einsum("kij,ki->kj", X[:, :3, :3], line))
    reach_b = extents(B.points, line)
    share = rng.uniform(-0.3, 0.1, POSES)
    share[::10] *= 1e-3
    X[:, :3, 3] = -line * ((reach_a + reach_b) * (1 + share))[:, None]
    return X


def extents(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far all points (n, 3) reach along each of the directions (k, 3)."""
    blocks = (points[first : first + 10_000] for first in range(0, len(points), 10_000))
    return np.max([(directions @ block.T).max(axis=1) for block in blocks], axis=0)


def measure(options: Options, kind: str, asked: int) -> Race:
    rng = np.random.default_rng(asked)
    A, B = body(kind, asked, 0), body(kind, asked, 2)
    X, Y = poses(A, B, rng), np.eye(4)[None]
    small = body("sphere", 32, 0)
    collide.walk(small, small, np.eye(4), np.eye(4))  # what a first call loads is in no row
    started = time.process_time()
    result = collide.walk(A, B, X, Y)
    prepared = time.process_time() - started
    truth, rows = collide.collide(A, B, X, Y), result.rows
    check(bool((result.hit == truth).all()), f"{kind} {asked}: the walk and the default disagree")
    axes = rows["axis"] * np.where(result.exchanged, -1.0, 1.0) * (rows["status"] == APART)[:, None]
    packed, Ys = (convex_set_of(A), convex_set_of(B)), np.broadcast_to(Y, (POSES, 4, 4))
    tests = float(rows["tests"].sum() / rows["rounds"].sum())
    check(tests <= MAX_TESTS, f"{kind} {asked}: {tests:.1f} tests a round")
    n, m = len(A.hull.vertices), len(B.hull.vertices)
    return Race({
        "default": lambda: collide.collide(A, B, X, Y), "walk": lambda: collide.walk(A, B, X, Y),
        "walk kernel": lambda: run_walks(A._walk, B._walk, *packed, X, Ys, early=False),
        "early kernel": lambda: run_walks(A._walk, B._walk, *packed, X, Ys, early=True),
        "default with axes": lambda: collide.collide(A, B, X, Y, axes=axes.copy()),
    }, POSES, {
        "n": n, "m": m, "nm": n * m, "facets_of_r": len(B._walk.polar.starts) - 1, "depth_p": result.depth_p,
        "depth_q": result.depth_q, "hits": float(truth.mean()),
        **{f"{name}_{of}": float(f(rows[name])) for name in ("rounds", "tests", "games", "pivots")
           for of, f in (("mean", np.mean), ("most", np.max))},
        "tests_a_round": tests, "tests_a_round_most": float((rows["tests"] / rows["rounds"]).max()),
        "proven": float(result.walked.mean()), "prepare_ms": prepared * 1e3,
        "bytes_a_vertex_p": A._walk.hierarchy.bytes / asked, "bytes_a_vertex_q": B._walk.polar.hierarchy.bytes / asked,
    })


def walked(row: dict) -> bool:
    return row["engine"] == "walk kernel"


def notes(rows):
    names = ("rounds_mean", "rounds_most", "tests_mean", "tests_most", "tests_a_round", "median_us")
    of = [row for row in rows if walked(row)]
    yield from log2_lines(of, ("kind",), names, "nm", "(log2 n + log2 m)")
    yield from log2_lines([row | {"kind": "all"} for row in of], ("kind",), names, "nm", "(log2 n + log2 m)")


def cases(options: Options):
    return grid(kind=KINDS, asked=SIZES[: 3 if options.quick else None])


CLAIMS = [Claim("walk", "µs a query, and what it counts", cases, measure, notes=notes, everywhere=True, panels=(
    Panel("rounds of a query: most of 1000, and (dashed) mean", "n", "rounds_most", "kind", "x", walked, "rounds_mean"),
    Panel("tests a round, mean", "n", "tests_a_round", "kind", "x", walked),
    Panel("µs a query: the walk's kernel", "n", "median_us", "kind", "xy", walked),
    Panel("µs a query: the default", "n", "median_us", "kind", "xy", lambda row: row["engine"] == "default"),
))]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
