"""Inputs that several scripts share: random poses, the meshes of shared/data, bodies brought into touch."""

from __future__ import annotations

import gzip
import io
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"
MESHES = SHARED / "meshes"
FILES = {
    "teapot": "teapot_1177.ply", "bunny": "bunny_35947.ply", "env": "env.obj", "rob": "rob.obj",
    "dragon 11k": "dragon_vrip_res4.ply.gz", "dragon 48k": "dragon_vrip_res3.ply.gz",
    "dragon 203k": "dragon_vrip_res2.ply.gz", "dragon 871k": "dragon_vrip.ply.gz",
}


def use_tests(*folders: str) -> None:
    """Make families and oracles of the tests importable."""
    sys.path[:0] = [str(ROOT / "tests" / folder) for folder in folders]


def rotations(quaternions: np.ndarray) -> np.ndarray:
    """(N, 3, 3) from quaternions (N, 4), scalars first, of any length."""
    w, x, y, z = (quaternions / np.sqrt(np.square(quaternions).sum(axis=1))[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def rotation(rng: np.random.Generator) -> np.ndarray:
    return rotations(rng.normal(size=(1, 4)))[0]


def directions(rng: np.random.Generator, n: int) -> np.ndarray:
    """(n, 3) unit vectors, uniform."""
    d = rng.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1)[:, None]


def poses(rng: np.random.Generator, n: int, low: float, high: float | None = None) -> np.ndarray:
    """(n, 4, 4) random rotations, origins uniform in the cube of ±low, or low to high from the origin [m]."""
    X = np.tile(np.eye(4), (n, 1, 1))
    X[:, :3, :3] = rotations(rng.normal(size=(n, 4)))
    X[:, :3, 3] = rng.uniform(-low, low, (n, 3))
    if high is not None:
        X[:, :3, 3] = directions(rng, n) * rng.uniform(low, high, (n, 1))
    return X


def ball(n: int, seed: int = 0, d: int = 3) -> np.ndarray:
    """(n, d) points on the unit sphere."""
    points = np.random.default_rng([seed, n]).normal(size=(n, d))
    return points / np.sqrt(np.square(points).sum(axis=1))[:, None]


def mesh(name: str) -> tuple[np.ndarray, np.ndarray]:
    """(vertices, faces) of a name in `FILES`, its box's diagonal 1 and its middle at the origin; or "hull of" one."""
    import trimesh

    if name.startswith("hull of "):
        from collide.hull.exact_hull import convex_hull

        vertices, _ = mesh(name.removeprefix("hull of "))
        corners, faces = np.unique(convex_hull(vertices).facets, return_inverse=True)
        return vertices[corners], faces.reshape(-1, 3)
    file = MESHES / FILES[name]
    content, suffix = file.read_bytes(), file.suffix
    if suffix == ".gz":
        content, suffix = gzip.decompress(content), Path(file.stem).suffix
    made = trimesh.load(io.BytesIO(content), file_type=suffix[1:], process=False, maintain_order=True, force="mesh")
    return in_unit_box(np.array(made.vertices, dtype=np.float64), np.array(made.faces, dtype=np.int64))


def in_unit_box(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with the box of its facets' corners of diagonal 1, about the origin."""
    corners = vertices[faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return (vertices - (low + high) / 2) / np.linalg.norm(high - low), faces


def meshes_here(*names: str) -> tuple[str, ...]:
    """The names, where shared/data is beside the checkout; else none."""
    if MESHES.is_dir():
        return names
    print("left out: meshes of shared/data, which is not beside this checkout", file=sys.stderr)
    return ()


def touching(A, B, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """(X_WA, X_WB, direction, way) of two trees of facets: B comes from far along a direction, and touches A after
    that way."""
    from collide.narrowphase.facets.facet_queries import surface_distances

    X, Y = np.eye(4), np.eye(4)
    X[:3, :3], Y[:3, :3] = rotation(rng), rotation(rng)
    X[:3, 3] = rng.normal(size=3) * 0.1
    direction = directions(rng, 1)[0]
    way = 2.0
    for _ in range(300):
        Y[:3, 3] = X[:3, 3] + way * direction
        gap = float(surface_distances(A, B, X, Y).distance[0])
        if gap < 1e-9 or way < -1.0:
            break
        way -= gap
    return X, Y, direction, way
