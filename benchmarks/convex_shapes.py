"""Shapes and poses of `benchmarks/convex.py`: round, long, flat and prismatic hulls, placed at chosen distances.

Points are drawn with a fixed seed and shifted to their mean, so that the origin lies inside every hull. A
linear map keeps a hull's faces, so ellipsoids and pancakes take theirs from the sphere; the faces of prisms
are written down, since Qhull takes time quadratic in the corners of a cap (32 s at n = 32,768).

Two bodies are placed along the line of their centres. Signed distance is convex along that line, so a
bracketed secant finds the place of any distance wanted.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

#: Semi-axes that the unit sphere is stretched to; the longest is 1.
STRETCH = {"sphere": (1.0, 1.0, 1.0), "ellipsoid": (0.1, 0.3, 1.0), "pancake": (1.0, 1.0, 0.02)}
#: Classes of poses, in the order of `Scene.labels`.
CLASSES = ("separated", "near", "overlap")
#: What all shapes measure from end to end, about; gaps and depths are parts of it.
LENGTH = 2.0
_EYE = np.eye(4)[None]
#: Hulls of this many points on a sphere hold a ball of radius 0.9; EPA on concentric ones is slow, and not needed.
ROUND_ENOUGH = 512


class Solid:
    """One hull: ``points`` (n, 3), and ``faces`` (m, 3) counterclockwise from outside, worked out when asked for."""

    def __init__(self, kind: str, n: int, seed: int):
        import collide

        self.kind, self.n = kind, n
        if kind == "cylinder":
            points = prism(n // 2)
        else:
            self._sphere = np.random.default_rng([seed, n]).normal(size=(n, 3))
            self._sphere /= np.sqrt(np.square(self._sphere).sum(axis=1))[:, None]
            points = self._sphere * STRETCH[kind]
        self.points = points - points.mean(axis=0)
        self.shape = collide.ConvexHull(self.points)

    @cached_property
    def faces(self) -> np.ndarray:
        if self.kind == "cylinder":
            return prism_faces(self.n // 2)
        from scipy.spatial import ConvexHull

        hull = ConvexHull(self._sphere)
        assert len(hull.vertices) == self.n, "every point on a sphere is a corner of the hull"
        p, q, r = (self._sphere[hull.simplices[:, k]] for k in range(3))
        inwards = (np.cross(q - p, r - p) * hull.equations[:, :3]).sum(axis=1) < 0
        faces = hull.simplices.copy()
        faces[inwards] = faces[inwards][:, ::-1]
        return faces


def prism(corners: int) -> np.ndarray:
    """Two regular polygons of radius √½ at heights ±√½: as long as the other shapes from end to end."""
    if corners < 3:
        raise SystemExit("a cylinder needs at least 6 points")
    angle = np.arange(corners) * (2 * np.pi / corners)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.ones(corners)]) * np.sqrt(0.5)
    return np.concatenate([ring * (1.0, 1.0, -1.0), ring])


def prism_faces(corners: int) -> np.ndarray:
    """Faces of `prism`; arcs of the caps are halved again and again.

    A fan gives coal a vertex of 255 or more neighbours, which it refuses; zigzag strips make its walk from
    vertex to vertex long (43 instead of 11 µs a boolean at n = 8,192). Halving is the kindest cut found.
    """
    cap, arcs = [], [(0, corners - 1)]
    while arcs:
        first, last = arcs.pop()
        if last - first >= 2:
            middle = (first + last) // 2
            cap.append((first, middle, last))
            arcs += [(first, middle), (middle, last)]
    top = np.array(cap) + corners
    k = np.arange(corners)
    after = (k + 1) % corners
    sides = [np.column_stack([k, after, after + corners]), np.column_stack([k, after + corners, k + corners])]
    return np.concatenate([np.array(cap)[:, ::-1], top, *sides])


class Scene(NamedTuple):
    """Pairs at poses: pair k is solid ``which[k, 0]`` at the origin and ``which[k, 1]`` at ``X_WBs[k]``.

    which : (N, 2).   X_WBs : (N, 4, 4).   labels : (N,) indices into `CLASSES`.   distances : (N,) ours, signed.
    """

    solids: list[Solid]
    which: np.ndarray
    X_WBs: np.ndarray
    labels: np.ndarray
    distances: np.ndarray

    def only(self, indices: np.ndarray) -> Scene:
        return self._replace(**{f: getattr(self, f)[indices] for f in ("which", "X_WBs", "labels", "distances")})


class WorldSolids:
    """collide's batch over a scene of many shapes: a pair of them at every pose."""

    def __init__(self, solids: list[Solid]):
        import collide

        self._set = collide.ShapeSet([solid.shape for solid in solids])

    def hits(self, which: np.ndarray, X_WBs: np.ndarray) -> np.ndarray:
        import collide

        return collide.collide(self._set[which[:, 0]], self._set[which[:, 1]], _EYE, X_WBs)

    def rows(self, which: np.ndarray, X_WBs: np.ndarray, signed: bool = True) -> np.ndarray:
        import collide

        return collide.distance(self._set[which[:, 0]], self._set[which[:, 1]], _EYE, X_WBs, signed=signed).rows


def scene(kind: str, n: int, poses: int, shapes: int = 2) -> Scene:
    """``poses`` pairs of each class, shuffled; two solids, or random pairs of ``shapes`` different ones."""
    random = np.random.default_rng([n, shapes, sum(map(ord, kind))])
    solids = [Solid(kind, n, seed) for seed in range(shapes)]
    count = poses * len(CLASSES)
    which = np.tile([0, 1], (count, 1))
    if shapes > 2:
        which = np.array([random.permutation(shapes)[:2] for _ in range(count)])
    labels = random.permutation(np.repeat(np.arange(len(CLASSES)), poses))
    directions = random.normal(size=(count, 3))
    directions /= np.sqrt(np.square(directions).sum(axis=1))[:, None]
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = rotations(random.normal(size=(count, 4)))
    in_world = WorldSolids(solids)

    def signed(rows: np.ndarray, along: np.ndarray) -> np.ndarray:
        at = X[rows]
        at[:, :3, 3] = directions[rows] * along[:, None]
        return in_world.rows(which[rows], at)["distance"]

    everything = np.arange(count)
    if kind == "sphere" and n >= ROUND_ENOUGH:
        deepest = np.full(count, -0.9 * LENGTH)
    else:
        deepest = signed(everything, np.zeros(count))
    targets = wanted(labels, deepest, random)
    along, distances = place(signed, targets, deepest)
    X[:, :3, 3] = directions * along[:, None]
    return Scene(solids, which, X, labels, distances)


def wanted(labels: np.ndarray, deepest: np.ndarray, random) -> np.ndarray:
    """Signed distances by class: a gap of 0.05 to 1 lengths, ±1 % of a length, a depth of 5 to 50 %.

    A depth is a part of the depth with the centres in one place where that is less than the length:
    a flat shape has no deeper.
    """
    n = len(labels)
    apart = random.uniform(0.05, 1.0, n) * LENGTH
    near = np.maximum(random.uniform(-0.01, 0.01, n) * LENGTH, 0.5 * deepest)
    deep = random.uniform(0.05, 0.5, n) * np.maximum(-LENGTH, deepest)
    return np.choose(labels, [apart, near, deep])


def place(signed: Callable, targets: np.ndarray, deepest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places along the lines of centres with the signed distances wanted, to 1e-4 lengths, and the distances there."""
    n = len(targets)
    low, f_low = np.zeros(n), deepest - targets
    high = 2 * LENGTH + np.maximum(targets, 0.0)  # beyond both reaches, which shifted means have made longer than 1
    f_high = signed(np.arange(n), high) - targets
    assert (f_low < 0).all() and (f_high > 0).all(), "the distances wanted lie on the lines of centres"
    along, values, last = high.copy(), f_high + targets, np.zeros(n, dtype=int)
    open_rows = np.arange(n)
    for _ in range(60):
        r = open_rows
        along[r] = (low[r] * f_high[r] - high[r] * f_low[r]) / (f_high[r] - f_low[r])
        values[r] = signed(r, along[r])
        error = values[r] - targets[r]
        side = np.where(error < 0, -1, 1)
        # Illinois: an end that stays twice has its value halved, so that both ends close in.
        halved = np.where(side == last[r], 0.5, 1.0)
        f_low[r], f_high[r] = np.where(side < 0, [error, halved * f_high[r]], [halved * f_low[r], error])
        low[r], high[r] = np.where(side < 0, [along[r], high[r]], [low[r], along[r]])
        last[r] = side
        open_rows = r[np.abs(error) > 1e-4 * LENGTH]
        if not len(open_rows):
            return along, values
    raise AssertionError(f"{len(open_rows)} of {n} poses found no place")


def rotations(quaternions: np.ndarray) -> np.ndarray:
    """(N, 3, 3) from quaternions (N, 4) of any length."""
    w, x, y, z = (quaternions / np.sqrt(np.square(quaternions).sum(axis=1))[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
