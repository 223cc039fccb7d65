"""What an arrangement of two local meshes has to cut, and what is looked at for it, counted up to 10⁶ facets.

    python benchmarks/solids_growth.py          # two minutes

Bumpy spheres in each other, whose facets meet along a curve, and harpsicordia, local by proof, with Σ = n and with
Σ ≤ 1000: pairs of facets that meet, boxes looked at, pairs of facets tested; per meeting and over n log2 n. Below, the
exponents e of n^e fitted, and c of c n log2 n with the largest factor that any size is off it. Counts are the same on
every machine.
"""

from __future__ import annotations

import numpy as np
from inputs import use_tests

use_tests("families")
from mesh_shapes import bumpy_sphere

import collide
from collide.adapters.bench.claims import Claim, Options, grid, main
from collide.adapters.bench.growth import groups, power_of
from collide.narrowphase.facets.facet_queries import all_hits
from collide.scenes.worst_cases import harpsicordia

FAMILIES = {"bumpy spheres": None, "harpsicordia, Σ = n": None, "harpsicordia, Σ ≤ 1000": 1000.0}
COUNTS = "meeting", "boxes", "tested"


def measure(options: Options, family: str, size: int) -> list[dict]:
    Y = np.eye(4)
    if family == "bumpy spheres":
        A, B = (collide.Mesh(*bumpy_sphere(size, seed), solid=False) for seed in (0, 1))
        Y = collide.pose((0.9, 0.3, 0.2), rpy=(0.3, 0.5, 0.7))
    else:  # of two facets a vertex
        A, B, _ = harpsicordia(size // 2, 10.0, FAMILIES[family])
    hits = all_hits(A.tree, B.tree, np.eye(4), Y)
    n, counts = len(A.faces), dict(zip(COUNTS, (len(hits.pairs), *hits.counters[0, :2].tolist())))
    return [{
        "facets": n, **counts, "boxes_a_meeting": counts["boxes"] / counts["meeting"],
        "tested_a_meeting": counts["tested"] / counts["meeting"],
        **{f"{name}_over_nlogn": count / (n * np.log2(n)) for name, count in counts.items()},
    }]


def notes(rows):
    for (family,), some in groups(rows, "family"):
        for name in COUNTS:
            c = np.array([row[f"{name}_over_nlogn"] for row in some])
            middle = float(np.exp(np.log(c).mean()))
            e = power_of([row["facets"] for row in some], [row[name] for row in some])
            off = float(np.exp(np.abs(np.log(c / middle)).max()))
            yield f"{family}: {name} n^{e:.2f}; {middle:.4f} n log2 n, off by {off:.2f} at most"


def cases(options: Options):
    return grid(family=FAMILIES, size=[10**k * m for k in range(3, 4 if options.quick else 6) for m in (1, 3)]
                + ([] if options.quick else [10**6]))


CLAIMS = [Claim("solids_growth", "what is looked at", cases, measure, everywhere=True, notes=notes)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
