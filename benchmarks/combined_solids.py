"""One solid of many and configuration obstacles: vertices of arrangements by kind, times beside established engines.

    python benchmarks/combined_solids.py
    # ten minutes; needs manifold3d, pyclipper and shapely for the columns of peers, which are left out without them
    # --only judged, vertices, memory, union, robot, space, plane, combs

judged : twenty sets of solids of each family of the tests, 200 points for each of five rules.
vertices : r bumpy spheres in one arrangement: corners, edges through facets, three facets, over r³ n log² n.
memory : bytes a pair of facets, and of segments, takes while it is cut exactly.
union : `combine` beside manifold3d's batch union.   robot : the panda's links in one pose, as hulls.
space, plane : configuration obstacles beside manifold3d's, pyclipper's and shapely's.   combs : figure 10 of the paper.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS / folder) for folder in ("families", "oracles", "solids")]
from many_judge import CASES, judge_many
from mesh_shapes import bumpy_sphere
from planar_obstacle_judge import combs, turned_by

import collide
from collide.solids.arrangement import Arrangement, arrange
from collide.solids.solid_operands import solid_operand

TURNED = collide.pose((0, 0, 0), rpy=(0.3, -0.4, 0.7))[:3, :3]


def peer(name: str):
    """The package, None where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def timed(task):
    start = time.process_time()
    answer = task()
    return time.process_time() - start, answer


def spheres(r: int, n: int):
    """r bumpy spheres of n facets that all overlap."""
    rng = np.random.default_rng(0)
    poses = [collide.pose(rng.uniform(-0.3, 0.3, 3), rpy=rng.uniform(-2, 2, 3)) for _ in range(r)]
    return [collide.Mesh(*bumpy_sphere(n, seed)) for seed in range(r)], np.array(poses)


def arranged(shapes, poses) -> Arrangement:
    names = [f"shapes[{k}]" for k in range(len(shapes))]
    return arrange([solid_operand("benchmark", *named, True) for named in zip(names, shapes, poses)])


def vertex_kinds(arrangement: Arrangement) -> tuple[int, int, int]:
    """(corners of bodies, points where an edge goes through a facet, points of three facets)."""
    points, facets = arrangement.points, arrangement.facets
    on_edge: dict[int, bool] = {}
    for f, triangle in zip(arrangement.sheets.facet.tolist(), arrangement.sheets.triangles.tolist()):
        corners = [points.vertex(v) for v in facets.corners[f].tolist()]
        n = facets.normal(f)
        axis = int(np.argmax([abs(x) for x in n]))
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for p in triangle:
            if p >= points.n_vertices and not on_edge.get(p):
                on_edge[p] = any(points.side(corners[k], corners[k - 2], p, u, v) == 0 for k in range(3))
    n_corners = len({points.vertex(v) for v in np.unique(facets.corners).tolist()})
    n_edges = sum(on_edge.values())
    return n_corners, n_edges, len(on_edge) - n_edges


def judged() -> None:
    print("family                r   sets   points  near a surface  wrong  sets whose volumes do not add up")
    for family, r in CASES:
        verdicts = [judge_many(family, seed, r, 200) for seed in range(20)]
        points, near = (sum(getattr(v, name) for v in verdicts) for name in ("n_points", "n_near"))
        wrong, off = sum(len(v.wrong) for v in verdicts), sum(not v.adds_up for v in verdicts)
        print(f"{family:20s} {r:2d} {len(verdicts):6d} {points:8d} {5 * near:15d} {wrong:6d} {off:6d}", flush=True)


def vertices() -> None:
    print("   r  facets  corners  edge-facet  three facets   all / (r³ n log² n)")
    largest = 0.0
    for r, n in [(2, 200), (3, 200), (4, 200), (6, 200), (8, 200), (4, 50), (4, 100), (4, 400), (4, 800)]:
        shapes, poses = spheres(r, n)
        n = len(shapes[0].faces)
        kinds = vertex_kinds(arranged(shapes, poses))
        c = sum(kinds) / (r**3 * n * np.log2(n) ** 2)
        largest = max(largest, c)
        print(f"{r:4d} {n:7d} {kinds[0]:8d} {kinds[1]:11d} {kinds[2]:13d} {c:20.2e}", flush=True)
    print(f"c = {largest:.2e}")


def memory() -> None:
    from collide.solids import exact_facets, plane_arrangement

    for name, module, task in (
        ("facets", exact_facets, lambda: collide.configuration_obstacle(*spheres(2, 100)[0], TURNED)),
        ("segments", plane_arrangement, lambda: collide.configuration_obstacle(*combs(6))),
    ):
        counts = []
        right = module.Limits.check_memory
        module.Limits.check_memory = lambda self, needed, of, counts=counts: counts.append(of)
        tracemalloc.start()
        task()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        module.Limits.check_memory = right
        n = max(int(of.split()[0].replace(",", "")) for of in counts)
        print(f"{name}: {n} pairs, {peak / n:.0f} bytes a pair", flush=True)


def manifold_of(package, vertices, faces):
    mesh = package.Mesh64(
        vert_properties=np.array(vertices), tri_verts=np.array(faces, dtype=np.uint64)
    )
    return package.Manifold(mesh)


def union() -> None:
    package = peer("manifold3d")
    print("   r  facets  combine ms  manifold3d ms  volumes differ by")
    for r, n in [(2, 200), (4, 200), (8, 200), (8, 1000)]:
        shapes, poses = spheres(r, n)
        ours, made = timed(lambda shapes=shapes, poses=poses: collide.combine(shapes, poses, "union"))
        row = f"{r:4d} {len(shapes[0].faces):7d} {1e3 * ours:11.0f}"
        if package:
            parts = [
                manifold_of(package, s.vertices @ X[:3, :3].T + X[:3, 3], s.faces) for s, X in zip(shapes, poses)
            ]  # fmt: skip
            theirs, volume = timed(
                lambda parts=parts: package.Manifold.batch_boolean(parts, package.OpType.Add).volume()
            )
            off = abs(volume - made.mesh.report.volume) / volume
            row += f" {1e3 * theirs:14.1f} {off:18.1e}"
        print(row, flush=True)


def robot() -> None:
    from collide.scenes import load

    scene = load("panda_workbench")
    shapes, poses, n_meshes = [], [], 0
    for body in scene.bodies:
        if body.owner is None:
            continue
        shape = body.shape
        solid = isinstance(shape, collide.Mesh) and shape.solid
        n_meshes += solid
        shapes.append(shape if solid else collide.ConvexHull(np.asarray(collide.tessellate(shape, tolerance=1e-3)[0])))
        poses.append(body.X_WB)
    seconds, made = timed(lambda: collide.combine(shapes, poses, "union"))
    r = made.mesh.report
    print(
        f"{len(shapes)} links, {n_meshes} of them solid meshes as they are, the others hulls: "
        f"{len(made.mesh.faces)} facets, "
        f"{r.shells} shells, {1e3 * r.volume:.4f} l, {len(made.self_collisions)} crossings, {seconds:.1f} s"
    )


def space() -> None:
    package = peer("manifold3d")
    print("  facets of A, B  pieces   cells  asked  facets   s   manifold3d s  volumes differ by  crossings")
    for n, m in [(20, 20), (50, 20), (50, 50), (100, 50), (200, 50)]:
        A, B = collide.Mesh(*bumpy_sphere(n, 0)), collide.Mesh(*bumpy_sphere(m, 1))
        seconds, r = timed(lambda A=A, B=B: collide.configuration_obstacle(A, B, TURNED))
        row = f"{len(A.faces):8d} {len(B.faces):6d} {r.n_pieces:7d} {r.n_cells:7d} {r.n_asked:6d}"
        row += f" {len(r.mesh.faces):7d} {seconds:6.1f}"
        if package:
            first = manifold_of(package, A.vertices, A.faces)
            second = manifold_of(package, -B.vertices @ TURNED.T, B.faces[:, ::-1])
            theirs, volume = timed(
                lambda first=first, second=second: first.minkowski_sum(second).volume()
            )
            row += f" {theirs:12.1f} {abs(volume - r.mesh.report.volume) / volume:18.1e}"
        print(row, len(r.self_collisions), flush=True)


def outline(n: int, bumps: int, depth: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    radius = 1 + depth * np.cos(bumps * angle)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def plane() -> None:
    clipper, shapely = peer("pyclipper"), peer("shapely")
    print("corners of A, B  pieces  points    s   pyclipper s  off by   shapely s  off by")
    for n in (25, 100, 250, 500, 1000):
        A, B = outline(n, 5, 0.1), outline(n, 7, 0.2)
        R = turned_by(0.4)
        seconds, r = timed(lambda A=A, B=B, R=R: collide.configuration_obstacle([A], [B], R))
        row = f"{n:7d} {n:6d} {r.n_pieces:8d} {r.n_corners:7d} {seconds:7.2f}"
        reflected = -B @ R.T
        if clipper and n <= 500:  # its time grows as n⁴
            theirs, area = timed(partial(_by_clipper, clipper, A, reflected, 2.0**40))
            row += f" {theirs:10.2f} {abs(area - r.area) / r.area:9.1e}"
        if shapely:
            theirs, area = timed(partial(_by_shapely, shapely, A, reflected))
            row += f" {theirs:10.2f} {abs(area - r.area) / r.area:9.1e}"
        print(row, flush=True)


def _by_clipper(clipper, A, B, scale: float) -> float:
    """The boundary of A moved along that of B, and B moved to a corner of A, in integers."""
    first, second = (np.round(x * scale).astype(np.int64).tolist() for x in (A, B))
    union = clipper.Pyclipper()
    union.AddPaths(clipper.MinkowskiSum(first, second, True), clipper.PT_SUBJECT, True)
    solution = union.Execute(clipper.CT_UNION, clipper.PFT_NONZERO, clipper.PFT_NONZERO)
    return sum(clipper.Area(path) for path in solution if clipper.Orientation(path)) / scale**2


def _by_shapely(shapely, A, B) -> float:
    """The parallelograms of all pairs of edges, united, holes filled: polygons without holes here."""
    a, b = np.roll(A, -1, axis=0), np.roll(B, -1, axis=0)
    corners = np.stack(
        [A[:, None] + B[None], a[:, None] + B[None], a[:, None] + b[None], A[:, None] + b[None]], axis=2
    ).reshape(-1, 4, 2)
    made = shapely.union_all(shapely.polygons(corners))
    return shapely.Polygon(made.exterior).area


def figure_10() -> None:
    print("   n  corners of A  pieces  points  corners of A − R B   holes  holes / n³")
    for n in (2, 4, 6, 8, 12):
        A, B, R = combs(n)
        r = collide.configuration_obstacle(A, B, R)
        n_corners = sum(map(len, r.rings))
        print(f"{n:4d} {len(A[0]):13d} {r.n_pieces:7d} {r.n_corners:7d} {n_corners:19d} {len(r.rings) - 1:7d}"
              f" {(len(r.rings) - 1) / n**3:11.3f}", flush=True)  # fmt: skip


PARTS = {
    "judged": judged, "vertices": vertices, "memory": memory, "union": union, "robot": robot, "space": space,
    "plane": plane, "combs": figure_10,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    for name in parser.parse_args().only:
        print(f"--- {name}")
        PARTS[name]()


if __name__ == "__main__":
    main()
