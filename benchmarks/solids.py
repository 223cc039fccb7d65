"""Booleans of two solids beside manifold3d: times, volumes, nodes compared with a box, and pairs of facets tested.

    python benchmarks/solids.py
    # some minutes; needs manifold3d; --sizes 1000 10000 100000, --runs N, --exact N pairs judged in fractions

Two bumpy spheres of as many facets stand in each other. Both engines get meshes that are made, and what they keep with
them. Times are of the processor, of all threads, and of the clock, medians of runs in turns: manifold3d has threads,
ours is one. "Judged" asks small solids whose facets lie in one plane, where manifold3d's volume is compared with the
exact one; solids that cross themselves are left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS / folder) for folder in ("families", "oracles", "solids")]
from mesh_shapes import bumpy_sphere
from solid_judge import arrangement_of, exact_corners, six_volumes, solids_of

import collide
from collide.solids.arrangement import crossings_of

OPERATIONS = {"union": "+", "intersection": "^", "difference": "-"}
FLUSH = ("boxes", "cavities", "rings", "touching boxes", "grid shells", "turned grid shells", "identical shells")


def manifold_of(vertices, faces):
    import manifold3d

    mesh = manifold3d.Mesh64(
        vert_properties=np.ascontiguousarray(vertices), tri_verts=np.ascontiguousarray(faces, dtype=np.uint64)
    )
    return manifold3d.Manifold(mesh)


def asked(A, B, sign: str):
    made = A + B if sign == "+" else A ^ B if sign == "^" else A - B
    return made, made.volume()


def timed(task) -> tuple[np.ndarray, object]:
    """(seconds of the processor and of the clock, the answer)."""
    started = time.process_time(), time.perf_counter()
    answer = task()
    return np.subtract((time.process_time(), time.perf_counter()), started), answer


def compare(n: int, runs: int) -> None:
    """One row a size and operation."""
    solids = [bumpy_sphere(n, seed) for seed in (0, 1)]
    A, B = (collide.Mesh(*solid, solid=True) for solid in solids)
    X, Y = np.eye(4), collide.pose((0.9, 0.3, 0.2), rpy=(0.3, 0.5, 0.7))
    manifold_a = manifold_of(*solids[0])
    manifold_b = manifold_of(solids[1][0] @ Y[:3, :3].T + Y[:3, 3], solids[1][1])
    for mesh in (A, B):
        crossings_of(mesh)
    collide.boolean(A, B, X, Y, "union")
    for op, sign in OPERATIONS.items():
        ours, theirs = [], []
        for _ in range(runs):
            seconds, r = timed(lambda op=op: collide.boolean(A, B, X, Y, op))
            ours.append(seconds)
            seconds, (made, volume) = timed(lambda sign=sign: asked(manifold_a, manifold_b, sign))
            theirs.append(seconds)
        volumes = timed(lambda: collide.overlap_volume(A, B, X, Y))[0][0]
        nodes, tested = (int(x) for x in collide.facet_pairs(A, B, X, Y).counters[0, :2])
        exact = r.mesh.report.volume
        (ours_cpu, ours_clock), (peer_cpu, peer_clock) = np.median(ours, axis=0), np.median(theirs, axis=0)
        print(
            f"{n:8d} {op:13s} {1e3 * ours_cpu:8.1f} {1e3 * peer_cpu:8.1f} {peer_cpu / ours_cpu:6.2f}"
            f" {1e3 * ours_clock:8.1f} {1e3 * peer_clock:8.1f} {peer_clock / ours_clock:6.2f}"
            f" {1e3 * volumes:8.1f} {abs(volume - exact) / exact:9.1e} {len(r.mesh.faces):8d} {made.num_tri():8d}"
            f" {len(r.self_collisions):5d} {r.n_meeting:7d} {r.n_cut:7d} {nodes:8d} {tested:8d}",
            flush=True,
        )  # fmt: skip


def judged(count: int) -> None:
    """Of solids whose facets are in one plane: how often volumes are off by more than 1e-9 of the exact one's size."""
    for family in FLUSH:
        wrong = refused = crossing = n_asked = 0
        for seed in range(count):
            A, B, X, Y = solids_of(family, seed)
            if len(crossings_of(A)) or len(crossings_of(B)):
                crossing += 1
                continue
            manifold_a, manifold_b = (
                manifold_of(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.faces) for mesh, pose in ((A, X), (B, Y))
            )
            if manifold_a.is_empty() or manifold_b.is_empty():
                refused += 1
                continue
            arrangement = arrangement_of(A, B, X, Y)
            held = arrangement.holds()
            size = float(manifold_a.volume() + manifold_b.volume())
            for sign, keep in (("+", held.any(axis=1)), ("^", held.all(axis=1)), ("-", held[:, 0] & ~held[:, 1])):
                origin = [0, 0, 0]
                exact = float(six_volumes(exact_corners(arrangement, arrangement.boundary(keep)[0], origin)) / 6)
                n_asked += 1
                wrong += abs(asked(manifold_a, manifold_b, sign)[1] - exact) > 1e-9 * size
        print(
            f"{family:20s} asked {n_asked:5d}  wrong {wrong:4d}  pairs refused {refused:4d}, left out {crossing:4d}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="*", default=[1000, 10_000, 100_000])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--exact", type=int, default=40)
    arguments = parser.parse_args()
    print(
        "  facets operation     collide manifold  ratio  (clock:)           ratio   volume  rel. off    ours    theirs"
        " cross meeting     cut    boxes   tested"
    )
    for n in arguments.sizes:
        compare(n, arguments.runs)
    if arguments.exact:
        judged(arguments.exact)


if __name__ == "__main__":
    main()
