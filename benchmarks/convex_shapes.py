"""Shapes and poses of `convex.py`: round, long, flat and prismatic hulls, placed at chosen distances.

Two bodies are placed along the line of their centres: signed distance is convex along that line, so a bracketed secant
finds the place of any distance wanted. The faces of prisms are written down, since Qhull takes time quadratic in the
corners of a cap (32 s at n = 32,768).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from inputs import ball, directions, poses

import collide

#: Semi-axes that the unit sphere is stretched to; the longest is 1.
STRETCH = {"sphere": (1.0, 1.0, 1.0), "ellipsoid": (0.1, 0.3, 1.0), "pancake": (1.0, 1.0, 0.02)}
#: Classes of poses, in the order of `Scene.labels`.
CLASSES = ("separated", "near", "overlap")
#: What all shapes measure from end to end, about; gaps and depths are parts of it.
LENGTH = 2.0
#: Hulls of this many points on a sphere hold a ball of radius 0.9; EPA on concentric ones is slow, and not needed.
ROUND_ENOUGH = 512


def hull(kind: str, n: int, seed: int) -> collide.ConvexHull:
    """A hull of n points, their mean at the origin."""
    points = prism(n // 2) if kind == "cylinder" else ball(n, seed) * STRETCH[kind]
    return collide.ConvexHull(points - points.mean(axis=0))


def prism(corners: int) -> np.ndarray:
    """Two regular polygons of radius √½ at heights ±√½: as long as the other shapes from end to end."""
    angle = np.arange(corners) * (2 * np.pi / corners)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.ones(corners)]) * np.sqrt(0.5)
    return np.concatenate([ring * (1.0, 1.0, -1.0), ring])


def coal_prism(shape: collide.ConvexHull):
    """coal's geometry of a `prism`; arcs of the caps are halved again and again.

    A fan gives coal a vertex of 255 or more neighbours, which it refuses; zigzag strips make its walk from vertex to
    vertex long (43 instead of 11 µs a boolean at n = 8,192). Halving is the kindest cut found.
    """
    import coal

    corners = len(shape.points) // 2
    cap, arcs = [], [(0, corners - 1)]
    while arcs:
        first, last = arcs.pop()
        if last - first >= 2:
            middle = (first + last) // 2
            cap.append((first, middle, last))
            arcs += [(first, middle), (middle, last)]
    k = np.arange(corners)
    after = (k + 1) % corners
    sides = [np.column_stack([k, after, after + corners]), np.column_stack([k, after + corners, k + corners])]
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(shape.points))
    faces = np.concatenate([np.array(cap)[:, ::-1], np.array(cap) + corners, *sides])
    triangles.extend([coal.Triangle(*face) for face in faces.tolist()])
    return coal.Convex(points, triangles)


class Scene(NamedTuple):
    """Pairs at poses: pair k is shape ``which[k, 0]`` at the origin and ``which[k, 1]`` at ``X_WBs[k]``.

    which : (N, 2).   X_WBs : (N, 4, 4).   labels : (N,) indices into `CLASSES`.   distances : (N,) ours, signed.
    """

    shapes: list[collide.ConvexHull]
    which: np.ndarray
    X_WBs: np.ndarray
    labels: np.ndarray
    distances: np.ndarray

    def only(self, indices: np.ndarray) -> Scene:
        return self._replace(**{f: getattr(self, f)[indices] for f in ("which", "X_WBs", "labels", "distances")})

    @property
    def pairs(self) -> tuple[list, list, np.ndarray, np.ndarray]:
        """(As, Bs, X_WAs, X_WBs), as peers are asked."""
        As, Bs = ([self.shapes[k] for k in side.tolist()] for side in self.which.T)
        return As, Bs, np.tile(np.eye(4), (len(As), 1, 1)), self.X_WBs

    def question(self) -> tuple:
        """(A, B, X_WA, X_WBs), as collide is asked: one pair of shapes, or a set that rows pick from."""
        if len(self.shapes) == 2:
            return *self.shapes, np.eye(4), self.X_WBs
        shapes = collide.ShapeSet(self.shapes)
        return shapes[self.which[:, 0]], shapes[self.which[:, 1]], np.eye(4)[None], self.X_WBs


@cache
def scene(kind: str, n: int, count: int, shapes: int = 2) -> Scene:
    """``count`` pairs of each class, shuffled; two hulls, or random pairs of ``shapes`` different ones."""
    random = np.random.default_rng([n, shapes, sum(map(ord, kind))])
    hulls = [hull(kind, n, seed) for seed in range(shapes)]
    total = count * len(CLASSES)
    which = np.tile([0, 1], (total, 1))
    if shapes > 2:
        which = np.array([random.permutation(shapes)[:2] for _ in range(total)])
    labels = random.permutation(np.repeat(np.arange(len(CLASSES)), count))
    towards, X = directions(random, total), poses(random, total, 0.0)
    made = Scene(hulls, which, X, labels, np.zeros(total))

    def signed(rows: np.ndarray, along: np.ndarray) -> np.ndarray:
        at = X[rows]
        at[:, :3, 3] = towards[rows] * along[:, None]
        return collide.distance(*made.only(rows)._replace(X_WBs=at).question()).distance

    everything = np.arange(total)
    if kind == "sphere" and n >= ROUND_ENOUGH:
        deepest = np.full(total, -0.9 * LENGTH)
    else:
        deepest = signed(everything, np.zeros(total))
    along, distances = place(signed, wanted(labels, deepest, random), deepest)
    X[:, :3, 3] = towards * along[:, None]
    return made._replace(distances=distances)


def wanted(labels: np.ndarray, deepest: np.ndarray, random) -> np.ndarray:
    """Signed distances by class: a gap of 0.05 to 1 lengths, ±1 % of a length, a depth of 5 to 50 %, of the depth with
    the centres in one place where that is less than the length."""
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
