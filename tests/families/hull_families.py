"""Hulls for tests of support trees, directions to ask them about, and what is farthest, in Python integers."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np


def hull_of(points):
    """Facets of the hull of points in convex position, by Qhull; both sides of a flat one."""
    from scipy import spatial

    centred = points - points.mean(axis=0)
    _, size, axes = np.linalg.svd(centred, full_matrices=False)
    if size[2] < 1e-9 * size[0]:
        ring = spatial.ConvexHull(centred @ axes[:2].T).vertices
        return double_sided(ring)
    facets = spatial.ConvexHull(points).simplices
    a, b, c = (points[facets[:, k]] for k in range(3))
    inward = ((a - points.mean(axis=0)) * np.cross(b - a, c - a)).sum(axis=1) < 0
    facets[inward] = facets[inward][:, [0, 2, 1]]
    return facets.astype(np.int32)


def fan(ring):
    return np.stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]], axis=1).astype(np.int32)


def double_sided(ring):
    return np.concatenate([fan(ring), fan(ring)[:, ::-1]])


def circle(m):
    angle = 2 * np.pi * np.arange(m) / m
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(m)], axis=1)


def ellipsoid(n, radii=(1, 1, 1), seed=0):
    points = np.random.default_rng(seed).normal(size=(n, 3))
    points *= np.array(radii) / np.sqrt((points * points).sum(axis=1))[:, None]
    return points, hull_of(points)


def prism(m):
    up = np.array([0, 0, 1])
    points = np.concatenate([circle(m) + up, circle(m) - up])
    i, j = np.arange(m), np.roll(np.arange(m), -1)
    sides = np.concatenate([np.stack([i + m, j + m, j], axis=1), np.stack([i + m, j, i], axis=1)])
    return points, np.concatenate([sides, fan(i), fan(i)[:, ::-1] + m]).astype(np.int32)


def bipyramid(m):
    points = np.concatenate([circle(m), [(0, 0, 1), (0, 0, -1)]])
    i, j = np.arange(m), np.roll(np.arange(m), -1)
    up = np.stack([i, j, np.full(m, m)], axis=1)
    return points, np.concatenate([up, np.stack([j, i, np.full(m, m + 1)], axis=1)]).astype(np.int32)


def cone(m):
    points = np.concatenate([circle(m), [(0, 0, 1)]])
    i, j = np.arange(m), np.roll(np.arange(m), -1)
    return points, np.concatenate([np.stack([i, j, np.full(m, m)], axis=1), fan(i)[:, ::-1]]).astype(np.int32)


def polygon(m):
    return circle(m), double_sided(np.arange(m))


def tilted_polygon(m):
    """Corners on a parabola, all integers, exactly in one plane that is no coordinate plane."""
    t = np.arange(m) - m // 2
    u, v = t.astype(float), (t * t).astype(float)
    return np.stack([u + 2 * v, 3 * u - v, u + v], axis=1), double_sided(np.arange(m)[::-1])


def gridded_square(k):
    """A flat hull with vertices inside and along its border."""
    index = np.arange((k + 1) ** 2).reshape(k + 1, k + 1)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    upper = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    x, y = np.meshgrid(np.arange(k + 1.0), np.arange(k + 1.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), (x + 2 * y).ravel()], axis=1)
    return points, np.concatenate([upper, upper[:, ::-1]]).astype(np.int32)


def gridded_box(k):
    """Every face a grid of k × k squares: most vertices are corners of nothing."""
    faces, points, index = [], [], {}
    for axis in range(3):
        for side in (0, k):
            for i in range(k):
                for j in range(k):
                    square = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        place = [0, 0, 0]
                        place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3] = side, i + di, j + dj
                        square.append(index.setdefault(tuple(place), len(index)))
                    square = square if side else square[::-1]
                    faces += [(square[0], square[1], square[2]), (square[0], square[2], square[3])]
    points = np.array(list(index), dtype=float) / k - 0.5
    return points * (1, 2, 3), np.array(faces, dtype=np.int32)


def lattice():
    """Integer points near a sphere: many parallel edges and coplanar facets."""
    rng = np.random.default_rng(8)
    points = rng.normal(size=(6000, 3))
    points = np.unique(np.rint(40 * points / np.sqrt((points * points).sum(axis=1))[:, None]), axis=0)
    return points, hull_of(points)


def moved(points, facets):
    return points + np.array([1000.0, 2000.0, -3000.0]), facets


def with_points_inside(points, facets):
    """Rows that are no vertices, before, between and after the vertices."""
    n = len(points)
    place = np.random.default_rng(9).permutation(2 * n)[:n]
    wider = np.random.default_rng(10).uniform(-0.1, 0.1, size=(2 * n, 3))
    wider[place] = points
    return wider, place[facets].astype(np.int32)


HULLS = {
    "sphere": lambda: ellipsoid(2500),
    "small sphere": lambda: ellipsoid(100),
    "tetrahedron": lambda: ellipsoid(4),
    "ellipsoid": lambda: ellipsoid(2000, (1, 3, 10)),
    "pancake": lambda: ellipsoid(2000, (1, 1, 0.02)),
    "needle": lambda: ellipsoid(2000, (1e-3, 1e-3, 1)),
    "far away": lambda: moved(*ellipsoid(1500, seed=4)),
    "prism": lambda: prism(1000),
    "bipyramid": lambda: bipyramid(2000),
    "cone": lambda: cone(1500),
    "polygon": lambda: polygon(1500),
    "tilted polygon": lambda: tilted_polygon(1000),
    "gridded box": lambda: gridded_box(16),
    "gridded square": lambda: gridded_square(30),
    "lattice": lattice,
    "points inside": lambda: with_points_inside(*ellipsoid(1200, seed=5)),
}
LARGE = {
    "sphere": lambda: ellipsoid(16384),
    "pancake": lambda: ellipsoid(8192, (1, 1, 0.02)),
    "needle": lambda: ellipsoid(8192, (1e-3, 1e-3, 1)),
    "ellipsoid": lambda: ellipsoid(8192, (1, 3, 10)),
    "prism": lambda: prism(8192),
    "bipyramid": lambda: bipyramid(30000),
    "cone": lambda: cone(16384),
    "polygon": lambda: polygon(16384),
}


@cache
def made(name, large=False):
    from collide.support.build_support_tree import build_support_tree

    points, facets = (LARGE if large else HULLS)[name]()
    return points, facets, build_support_tree(points, np.unique(facets), facets)


# --- directions and what is farthest in them ----------------------------------------------------


def normals_of(points, facets):
    a, b, c = (points[facets[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def directions_for(points, facets, seed, each=40):
    """Random ones, facet normals, directions between them, axes, with zeros, very large and very small ones."""
    rng = np.random.default_rng(seed)
    random = rng.normal(size=(each, 3))
    normals = normals_of(points, facets)
    unit = normals / np.sqrt((normals * normals).sum(axis=1))[:, None]
    some = rng.choice(len(facets), size=each)
    edges = {tuple(sorted(edge)): k for k, (a, b, c) in enumerate(facets.tolist()) for edge in ((a, b), (b, c), (c, a))}
    pairs = [
        (k, edges[tuple(sorted(edge))])
        for k, (a, b, c) in enumerate(facets.tolist()) for edge in ((a, b), (b, c), (c, a))
        if edges[tuple(sorted(edge))] != k
    ]
    between = np.array([unit[k] + unit[m] for k, m in rng.permutation(pairs)[:each]])
    axes = np.concatenate([np.eye(3), -np.eye(3), [(0.0, -0.0, 1.0), (1, 1, 0), (0, -1, 1), (0, 0, 0)]])
    zeros = random[: each // 2] * rng.integers(0, 2, size=(each // 2, 3))
    sizes = [random[k : k + 3] * 10.0**power for k, power in enumerate((-300, -160, -20, 20, 160, 300))]
    uneven = rng.normal(size=(each // 2, 3)) * 10.0 ** rng.integers(-200, 200, size=(each // 2, 3))
    return np.concatenate([random, normals[some], unit[some], between, axes, zeros, *sizes, uneven])


def integers(values):
    """The doubles, times one power of two, as integers."""
    exact = [Fraction(value) for value in np.asarray(values).ravel().tolist()]
    scale = max(number.denominator for number in exact)
    return np.array([int(number * scale) for number in exact], dtype=object).reshape(np.shape(values))


def farthest_of(whole_points, g):
    """Rows farthest in direction g, exactly."""
    gx, gy, gz = integers(g)
    values = whole_points[:, 0] * gx + whole_points[:, 1] * gy + whole_points[:, 2] * gz
    return set(np.flatnonzero(values == values.max()).tolist())


def snippet(name, g):
    return f"made({name!r})[2] asked in direction np.array({g.tolist()})"
