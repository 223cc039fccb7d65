"""Surfaces to test with, and what may be known of them from dictionaries and fractions alone."""

from __future__ import annotations

from collections import defaultdict
from fractions import Fraction

import numpy as np

_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box(low=(0, 0, 0), high=(1, 1, 1)) -> tuple[np.ndarray, np.ndarray]:
    """(8, 3) vertices and (12, 3) facets, outward."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    facets = [t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))]
    return low + corners * (high - low), np.array(facets)


def torus(around=12, across=7, radius=0.3) -> tuple[np.ndarray, np.ndarray]:
    """A closed surface of genus 1, outward."""
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    r = 1 + radius * np.cos(b)
    points = np.stack([r * np.cos(a), r * np.sin(a), radius * np.sin(b)], axis=-1).reshape(-1, 3)

    def name(i, j):
        return (i % around) * across + j % across

    facets = [
        t
        for i in range(around)
        for j in range(across)
        for t in (
            (name(i, j), name(i + 1, j), name(i + 1, j + 1)), (name(i, j), name(i + 1, j + 1), name(i, j + 1)),
        )
    ]
    return points, np.array(facets)


def ball(rings=5, sides=9) -> tuple[np.ndarray, np.ndarray]:
    """A closed convex-looking surface of genus 0, outward, with fans of ``sides`` facets at its poles."""
    points = [(0.0, 0.0, 1.0)]
    for i in range(1, rings):
        t = np.pi * i / rings
        points += [
            (np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)) for p in 2 * np.pi * np.arange(sides) / sides
        ]
    points.append((0.0, 0.0, -1.0))
    last = len(points) - 1

    def name(i, j):
        return 1 + (i - 1) * sides + j % sides

    facets = [(0, name(1, j), name(1, j + 1)) for j in range(sides)]
    for i in range(1, rings - 1):
        for j in range(sides):
            facets += [
                (name(i, j), name(i + 1, j), name(i + 1, j + 1)),
                (name(i, j), name(i + 1, j + 1), name(i, j + 1)),
            ]
    facets += [(last, name(rings - 1, j + 1), name(rings - 1, j)) for j in range(sides)]
    return np.array(points), np.array(facets)


def striped_cylinder(sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Radius and height 1; caps cut into strips, so that no vertex has many edges."""
    angles = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [(i, j, sides + i), (j, sides + j, sides + i)]
    low, high = 0, sides - 1
    while high - low > 1:
        for a, b, c in ((low, high, low + 1), (low + 1, high, high - 1)):
            if len({a, b, c}) == 3:
                faces += [(a, b, c), (sides + c, sides + b, sides + a)]
        low, high = low + 1, high - 1
    return np.concatenate([rim, rim + np.array([0.0, 0.0, 1.0])]), np.array(faces)


def joined(*surfaces) -> tuple[np.ndarray, np.ndarray]:
    """Several surfaces as one mesh."""
    points, facets, n = [], [], 0
    for vertices, faces in surfaces:
        points.append(vertices)
        facets.append(np.asarray(faces) + n)
        n += len(vertices)
    return np.concatenate(points), np.concatenate(facets)


def loosened(vertices, faces) -> tuple[np.ndarray, np.ndarray]:
    """As an STL has it: three vertices of its own for every facet."""
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


class Known:
    """What dictionaries know of a surface: sets of facet numbers under the names of the flags."""

    def __init__(self, vertices, faces):
        first: dict = {}
        ids = [first.setdefault(tuple((p + 0.0).tolist()), k) for k, p in enumerate(np.asarray(vertices, dtype=float))]
        self.corners = [tuple(ids[v] for v in face) for face in np.asarray(faces).tolist()]
        self.kept = [f for f, c in enumerate(self.corners) if len(set(c)) == 3]
        self.edges = defaultdict(list)
        for f in self.kept:
            c = self.corners[f]
            for k in range(3):
                a, b = c[k], c[(k + 1) % 3]
                self.edges[min(a, b), max(a, b)].append((f, 1 if a < b else -1))
        self.collapsed = set(range(len(self.corners))) - set(self.kept)
        nets = {edge: sum(d for _, d in there) for edge, there in self.edges.items()}
        self.open = {f for edge, there in self.edges.items() if len(there) == 1 for f, _ in there}
        self.unbalanced = {f for edge, there in self.edges.items() if len(there) > 2 and nets[edge] for f, _ in there}
        self.several = {f for edge, there in self.edges.items() if len(there) > 2 and not nets[edge] for f, _ in there}
        self.balanced = not any(nets.values())
        self.euler = len({v for f in self.kept for v in self.corners[f]}) - len(self.edges) + len(self.kept)

    def classes(self) -> list[set[int]]:
        """Facets joined through edges of two facets."""
        beside = defaultdict(set)
        for there in self.edges.values():
            if len(there) == 2:
                beside[there[0][0]].add(there[1][0])
                beside[there[1][0]].add(there[0][0])
        return _connected(self.kept, beside)

    def shells(self) -> list[set[int]]:
        """The same, and joined where those of one class at an edge of several do not cancel."""
        classes = self.classes()
        of = {f: k for k, members in enumerate(classes) for f in members}
        beside = defaultdict(set)
        for there in self.edges.values():
            net = defaultdict(int)
            for f, d in there:
                net[of[f]] += d
            if len(there) > 2 and any(net.values()):
                for k in net:
                    beside[k] |= set(net)
        return [set().union(*(classes[k] for k in group)) for group in _connected(range(len(classes)), beside)]

    def doubled(self) -> tuple[set[int], set[int]]:
        """(facets that repeat an earlier one, facets with one the other way round)."""
        senses = defaultdict(list)
        for f in self.kept:
            c = self.corners[f]
            k = c.index(min(c))
            senses[tuple(sorted(c))].append((f, c[(k + 1) % 3] < c[(k + 2) % 3]))
        same, opposite = set(), set()
        for there in senses.values():
            for sense in (True, False):
                same |= {f for f, s in there if s == sense and any(g < f and t == sense for g, t in there)}
            if len({s for _, s in there}) == 2:
                opposite |= {f for f, _ in there}
        return same, opposite

    def pinched(self) -> set[int]:
        """Facets at vertices around which their edges do not join all facets."""
        at = defaultdict(list)
        for f in self.kept:
            for v in self.corners[f]:
                at[v].append(f)
        found = set()
        for v, facets in at.items():
            beside = defaultdict(set)
            for f in facets:
                for g in facets:
                    if f != g and len(set(self.corners[f]) & set(self.corners[g]) - {v}) >= 1:
                        beside[f].add(g)
            if len(_connected(facets, beside)) > 1:
                found |= set(facets)
        return found


def _connected(things, beside) -> list[set]:
    found, seen = [], set()
    for start in things:
        if start not in seen:
            group, todo = set(), [start]
            while todo:
                k = todo.pop()
                if k not in group:
                    group.add(k)
                    todo += beside[k]
            seen |= group
            found.append(group)
    return found


def exact_volume(vertices, faces) -> Fraction:
    """Of closed facets, exactly."""
    points = [[Fraction(c) for c in p] for p in np.asarray(vertices).tolist()]
    total = Fraction(0)
    for i, j, k in np.asarray(faces).tolist():
        a, b, c = points[i], points[j], points[k]
        total += (
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
    return total / 6


def exact_area_is_zero(vertices, face) -> bool:
    a, b, c = ([Fraction(x) for x in vertices[v]] for v in face)
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
    return all(u[(k + 1) % 3] * v[(k + 2) % 3] == u[(k + 2) % 3] * v[(k + 1) % 3] for k in range(3))
