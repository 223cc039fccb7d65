"""What an arrangement of two local meshes has to cut, and what is looked at for it, counted up to 10⁶ facets.

    python benchmarks/solids_growth.py
    # two minutes; --largest 100000

Bumpy spheres in each other, whose facets meet along a curve, and harpsicordia, local by proof, with Σ = n and with
Σ ≤ 1000. A line a size: pairs of facets that meet, pairs of boxes looked at, pairs of facets tested; per meeting and
over n log2 n. Below each family the exponents e of n^e fitted, and c of c n log2 n with the largest factor that any
size is off it. Counts are the same on every machine.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "families"))
from mesh_shapes import bumpy_sphere

import collide
from collide.narrowphase.facets.facet_queries import all_hits
from collide.scenes.worst_cases import harpsicordia

NAMES = "meeting", "boxes", "tested"


def spheres(n: int):
    """(trees of A and B, poses)."""
    trees = [collide.Mesh(*bumpy_sphere(n, seed), solid=False).tree for seed in (0, 1)]
    return *trees, np.eye(4), collide.pose((0.9, 0.3, 0.2), rpy=(0.3, 0.5, 0.7))


def strings(n: int, spread: float | None):
    """Harpsicordia of about n facets: two facets a vertex."""
    A, B, _ = harpsicordia(n // 2, 10.0, spread)
    return A.tree, B.tree, np.eye(4), np.eye(4)


FAMILIES = {
    "bumpy spheres": spheres,
    "harpsicordia, Σ = n": lambda n: strings(n, None),
    "harpsicordia, Σ ≤ 1000": lambda n: strings(n, 1000.0),
}


def counted(case) -> np.ndarray:
    """(facets, meeting, boxes, tested)."""
    A, B, X, Y = case
    hits = all_hits(A, B, X, Y)
    return np.array([len(A.ids), len(hits.pairs), *hits.counters[0, :2]], dtype=float)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=1_000_000)
    largest = parser.parse_args().largest
    sizes = [10**k * m for k in range(3, 7) for m in (1, 3) if 10**k * m <= largest]
    print(f"{'family':24s}{'facets':>9s}" + "".join(f"{name:>10s}" for name in NAMES)
          + "  boxes, tested a meeting   meeting, boxes, tested over n log2 n")  # fmt: skip
    for family, make in FAMILIES.items():
        rows = []
        for size in sizes:
            row = counted(make(size))
            rows.append(row)
            n, meeting, boxes, tested = row
            over = row[1:] / (n * np.log2(n))
            print(f"{family:24s}{n:9.0f}{meeting:10.0f}{boxes:10.0f}{tested:10.0f}{boxes / meeting:13.1f}"
                  f"{tested / meeting:12.1f}   " + "".join(f"{x:10.4f}" for x in over), flush=True)  # fmt: skip
        table = np.array(rows)
        n = table[:, 0]
        for k, name in enumerate(NAMES, 1):
            exponent = np.polyfit(np.log(n), np.log(table[:, k]), 1)[0]
            c = table[:, k] / (n * np.log2(n))
            middle = float(np.exp(np.log(c).mean()))
            off = float(np.exp(np.abs(np.log(c / middle)).max()))
            print(f"    {name:8s} n^{exponent:.2f};  c n log2 n: c = {middle:.4f}, off by {off:.2f} at most")


if __name__ == "__main__":
    main()
