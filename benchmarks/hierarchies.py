"""Hierarchies: depth, size, degrees and build times against the number of vertices, with the lines fitted.

    python benchmarks/hierarchies.py                       # some ten minutes to 10^6 vertices; --plot FILE
    python benchmarks/hierarchies.py --table bounds        # depth and size against the bound on the degrees

Of every body three hierarchies: Dobkin and Kirkpatrick's ("DK"), with bounded degrees ("BDK"), and with bounded
degrees of its polar ("polar", of which n counts the facets). Depths are exact, so they are fitted: depth = a + b·log2 n
for each kind. "degree_1" is the largest degree of the finest level, "degree_2" that of the one after it, "degree" that
of all levels but the finest, "over" how many levels but the finest have one above the bound, "share" the least part by
which a level of 16 vertices or more shrinks where none is cut. A row with more levels over the bound than `MAY_BE_OVER`
names, or a share below a tenth, ends the run with an error. Seconds are of the processor.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from inputs import use_tests

use_tests("papers/hierarchies")
import hierarchy_families as families

from collide.adapters.bench.claims import Claim, Options, check, grid, main
from collide.adapters.bench.growth import Panel, log2_lines
from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy import DEGREE_BOUND, Hierarchy, build_hierarchy
from collide.papers.hierarchies.polar_hull import polar_of_hull

SIZES = (1_000, 10_000, 100_000, 1_000_000)
KINDS: dict[str, Callable[[int], np.ndarray]] = {
    "sphere": families.sphere,
    "degree doubling": lambda n: families.degree_doubling(round(np.log2(n / 3))),
    "bipyramid": families.bipyramid,
    "cone": families.cone,
    "prism": lambda n: families.prism(n // 2),
    "needle": lambda n: families.turned(families.sphere(n) * [1.0, 1e-3, 1e-3]),
    "pancake": lambda n: families.turned(families.sphere(n) * [1.0, 1.0, 1e-3]),
    "moment curve": families.moment_curve,
    "arcs": families.arcs,
    "bipyramid, turned": lambda n: families.turned(families.bipyramid(n, 0.1)),
    "cone, turned": lambda n: families.turned(families.cone(n)),
    "prism, turned": lambda n: families.turned(families.prism(n // 2)),
    "pancake prism, turned": lambda n: families.turned(families.prism(n // 2, 1e-6)),
    "arcs, turned": lambda n: families.turned(families.arcs(n)),
}
#: Levels but the finest that may have a vertex over the bound: two large ones are neighbours in the finest level, and
#: no double lies between them to cut both at once (docs/barba-langerman.md).
MAY_BE_OVER = {("moment curve", "BDK"): 1, ("arcs", "BDK"): 1, ("arcs, turned", "BDK"): 1}


def row_of(kind: str, which: str, n: int, hierarchy: Hierarchy, hull_s: float, build_s: float) -> dict:
    degrees = [int(hierarchy.degrees(level).max()) for level in range(hierarchy.depth)]
    sizes = hierarchy.sizes
    bound = hierarchy.degree_bound or 1 << 30
    return {
        "kind": kind, "which": which, "bound": hierarchy.degree_bound, "vertices": n, "n": int(sizes[0]),
        "depth": hierarchy.depth, "total_per_n": sizes.sum() / sizes[0], "largest_per_n": sizes.max() / sizes[0],
        "degree_1": degrees[0], "degree_2": degrees[1] if len(degrees) > 1 else 0,
        "degree": max(degrees[1:], default=0),
        "over": sum(d > bound for d in degrees[1:]), "share": float(families.removed_shares(hierarchy).min()),
        "added": int((hierarchy.birth > 0).sum()),
        "bytes_per_n": sum(a.nbytes for a in hierarchy if isinstance(a, np.ndarray)) / sizes[0],
        "hull_s": hull_s, "build_s": build_s,
    }


def timed(task):
    """(result, seconds of the processor), which do not count what other processes take meanwhile."""
    started = time.process_time()
    result = task()
    return result, time.process_time() - started


def rows_of(kind: str, n: int, bounds: tuple[int, ...], polar: bool = False):
    """Of one body. Bounds: 0 for a plain hierarchy."""
    points = KINDS[kind](n)
    hull, hull_s = timed(lambda: convex_hull(points))
    for bound in bounds:
        hierarchy, build_s = timed(lambda bound=bound: build_hierarchy(points, hull, bound))
        yield row_of(kind, "BDK" if bound else "DK", n, hierarchy, hull_s, build_s)
    if polar:
        body, build_s = timed(lambda: polar_of_hull(points, hull))
        yield row_of(kind, "polar", n, body.hierarchy, hull_s, build_s)


def growth(options: Options, kind: str, vertices: int) -> list[dict]:
    """Rows that hold B3 beyond the finest level, and the size of the independent sets."""
    rows = list(rows_of(kind, vertices, (0, DEGREE_BOUND), polar=True))
    for row in [row for row in rows if row["bound"]]:
        name, allowed = f"{row['which']} of {kind}, {row['n']}", MAY_BE_OVER.get((kind, row["which"]), 0)
        check(row["over"] <= allowed, f"{name}: {row['over']} levels over the bound, degree {row['degree']}")
        check(row["share"] >= 0.1, f"{name}: a level shrinks by {row['share']:.3f} of itself")
    return rows


def bounds(options: Options, kind: str, vertices: int):
    return rows_of(kind, vertices, (12, 16, 24, 32, 48, 64))


def cases(options: Options):
    return grid(kind=list(KINDS)[: 4 if options.quick else None], vertices=SIZES[: 1 if options.quick else None])


def bdk(row: dict) -> bool:
    return row["which"] == "BDK"


CLAIMS = [
    Claim("hierarchies", "depth, size and degrees of hierarchies", cases, growth, everywhere=True, panels=(
        Panel("levels, degrees bounded", "n", "depth", "kind", where=bdk),
        Panel("largest degree but for the finest level", "n", "degree", "kind", "xy", bdk),
        Panel("time to build [s]", "n", "build_s", "kind", "xy", bdk),
    ), notes=lambda rows: log2_lines(rows, ("which", "kind"), ("depth",))),
    Claim("bounds", "bounds on the degrees", lambda o: grid(kind=KINDS, vertices=SIZES[:1] if o.quick else SIZES[:2]),
          bounds, file="hierarchies-bounds", everywhere=True, asked_for=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
