"""Making meshes and measuring their locality: time against the number of facets.

    python benchmarks/mesh_shapes.py [MESH...]
    # a minute; --no-csv. Without files: the real inputs, where they are

For each mesh, in milliseconds, the fastest of several runs: `Mesh` as it comes (welding, defects, shells, volumes),
the same as loose triangles the way an STL has them, taken as a surface without a look, read from a pickle; and
`Mesh.locality`. Then generated harpsicordia, where stretch and size are chosen, for the lines of growth.
"""

from __future__ import annotations

import argparse
import csv
import pickle
import time
from pathlib import Path

import numpy as np

import collide
from collide.scenes.loaders.triangles import read_meshes
from collide.scenes.worst_cases import harpsicordia

REAL = Path(__file__).resolve().parents[2] / "shared/data/meshes"
NAMES = ("teapot_1177.ply", "env.obj", "bunny_35947.ply", "dragon_vrip_res2.ply.gz", "dragon_vrip.ply.gz")
SIZES = (1_000, 10_000, 100_000)


def least(task, seconds: float = 1.5) -> float:
    """Milliseconds of the fastest of as many runs as fit, three at least."""
    taken: list[float] = []
    while len(taken) < 3 or (sum(taken) < seconds and len(taken) < 50):
        started = time.perf_counter()
        task()
        taken.append(time.perf_counter() - started)
    return 1e3 * min(taken)


def measured(name: str, vertices: np.ndarray, faces: np.ndarray) -> dict:
    mesh = collide.Mesh(vertices, faces)
    pickled = pickle.dumps(mesh)
    corners, ids = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    locality = mesh.locality()
    return {
        "mesh": name, "facets": len(faces), "solid": mesh.solid, "shells": mesh.report.shells,
        "mesh_ms": least(lambda: collide.Mesh(vertices, faces)), "soup_ms": least(lambda: collide.Mesh(corners, ids)),
        "surface_ms": least(lambda: collide.Mesh(vertices, faces, solid=False)),
        "unpickle_ms": least(lambda: pickle.loads(pickled)),
        "locality_ms": least(mesh.locality), "sigma": locality.local_stretches[0],
        "sigma_10": locality.local_stretches[9],
        "Sigma": locality.global_stretch,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="*", metavar="MESH", help="mesh files")
    parser.add_argument("--no-csv", action="store_true", help="print only")
    args = parser.parse_args()
    files = args.meshes or [REAL / name for name in NAMES if (REAL / name).is_file()]
    inputs = [(name, mesh.vertices, mesh.faces) for file in files for name, mesh in read_meshes(file)]
    inputs += [(f"harpsicordia_{n}", m.vertices, m.faces) for n in SIZES for m in harpsicordia(n)[:1]]
    rows: list[dict] = []
    for source in inputs:
        rows.append(measured(*source))
        if len(rows) == 1:
            print("  ".join(f"{title:>12}" for title in rows[0]))
        print(
            "  ".join(f"{v:>12,.4g}" if isinstance(v, float) else f"{v!s:>12.12}" for v in rows[-1].values()),
            flush=True,
        )
    if not args.no_csv:
        with (Path(__file__).parent / "results" / "mesh_shapes.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)


if __name__ == "__main__":
    main()
