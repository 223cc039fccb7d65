"""Bodies swept by balls that rest on meshes, alone and in unions, and whether they touch: by fractions alone.

A feature of each core, a normal 5 long, and radii of 5/64: bodies share exactly a point, with coordinates that are
doubles. An ulp beside, or anywhere turned, `separation` judges by squares of distances of triangles as the poses
place them: exact products of poses, without rounding.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from facet_distances import square_to_triangle
from naive_triangles import as_integers, cross, inner, minus, triangles_meet
from touching_pairs import TURNS

import collide

NORMALS = {
    "face": [(0, 0, 5)], "edge": [(0, 0, 5), (3, 0, 4), (4, 0, 3), (5, 0, 0)],
    "corner": [(0, 0, 5), (3, 0, 4), (0, 3, 4), (3, 4, 0)],
}
MESHES, OTHERS = ("table", "box", "pair", "triangle"), ("sphere", "capsule", "rounded", "mesh")


class Resting(NamedTuple):
    """A pair, its family's name, and whether the bodies were made to touch exactly."""

    A: object
    B: object
    X_WA: np.ndarray
    X_WB: np.ndarray
    family: str

    def __repr__(self) -> str:
        poses = f"X_WA = {self.X_WA.tolist()}\nX_WB = {self.X_WB.tolist()}"
        return f"A = {self.A!r}\nB = {self.B!r}\n{poses}  # {self.family}"


class Core(NamedTuple):
    """A shape, and points of its core at which a feature's normals point out."""

    shape: object
    features: list[tuple[tuple[float, ...], str]]


def box_mesh(half) -> collide.Mesh:
    return collide.Mesh(*collide.tessellate(collide.Box(2.0 * np.array(half)), tolerance=0.1)[:2])


def _box_features(half) -> list:
    x, y, z = half
    return [((x / 2, -y / 4, z), "face"), ((x, y / 4, z), "edge"), ((x, y, z), "corner")]


def mesh_core(name: str, rng) -> Core:
    half = rng.integers(1, 9, 3) / 8.0
    if name == "box":
        return Core(box_mesh(half), _box_features(half))
    if name == "pair":
        box = box_mesh(half)
        shift = np.array([0.0, 0.0, -4.0])
        both = collide.Mesh(np.concatenate([box.vertices, box.vertices + shift]),
                            np.concatenate([box.faces, box.faces + len(box.vertices)]))
        return Core(both, _box_features(half))
    if name == "triangle":
        corners = [(-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (0.0, 2.0, 0.0)]
        surface = collide.Mesh(corners, [[0, 1, 2]], solid=False)
        return Core(surface, [((0.0, 0.25, 0.0), "face"), ((0.0, 2.0, 0.0), "face")])
    ends = np.arange(-4, 5) / 4.0
    vertices = [(x, y, 0.0) for y in ends for x in ends]
    corners = [9 * j + i for j in range(8) for i in range(8)]
    faces = [[a, a + 1, a + 10] for a in corners] + [[a, a + 10, a + 9] for a in corners]
    places = [(*tuple(p / 8.0), 0.0) for p in rng.integers(-7, 8, (2, 2))]  # on corners and edges of facets, too
    return Core(collide.Mesh(vertices, faces, solid=False), [(p, "face") for p in places])


def swept_core(name: str, radius: float, rng) -> Core:
    half = rng.integers(1, 9, 3) / 8.0
    if name == "sphere":
        return Core(collide.Sphere(radius), [((0.0, 0.0, 0.0), "corner")])
    if name == "capsule":
        return Core(collide.Capsule(radius, 2.0 * half[2]), [((0.0, 0.0, half[2]), "corner")])
    if name == "rounded":
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
        return Core(collide.ConvexHull(points, radius=radius), _box_features(half))
    return mesh_core(MESHES[rng.integers(4)], rng)


def resting(rng, kind: str, *, swept: bool, unions: bool, exact: bool) -> Resting:
    """A mesh A, swept by a ball or not, and a body B of a kind that rests on A.

    unions : put B, and A unless swept, among the parts of a union, at poses that products of matrices may round; a
    mesh B is then not swept.   exact : bodies touch exactly; else an ulp beside, or turned anyhow.
    """
    while True:
        radii = 5.0 * rng.integers(1, 9, 2) / 64.0
        name = MESHES[rng.integers(4)]
        core_a, core_b = mesh_core(name, rng), swept_core(kind, radii[1], rng)
        (p, on), (q, of) = (core.features[rng.integers(len(core.features))] for core in (core_a, core_b))
        normal = NORMALS[on][rng.integers(len(NORMALS[on]))]
        R = TURNS[rng.integers(24)]
        if not any((R @ np.array(n) == -np.array(normal)).all() for n in NORMALS[of]):
            continue
        A = collide.SweptMesh(core_a.shape, radii[0]) if swept else core_a.shape
        radii[1] = 0.0 if kind == "mesh" and unions else radii[1]
        B = collide.SweptMesh(core_b.shape, radii[1]) if kind == "mesh" and not unions else core_b.shape
        r = radii[1] + (radii[0] if swept else 0.0)
        X_WA, X_WB = np.eye(4), np.eye(4)
        X_WB[:3, :3] = R
        X_WB[:3, 3] = np.array(p) + r / 5.0 * np.array(normal) - R @ np.array(q)
        if not exact:
            if rng.random() < 0.5:
                turn = collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4))
                X_WA, X_WB = turn, turn @ X_WB
            X_WB[:3, 3] += rng.integers(-1, 2, 3) * np.spacing(np.abs(X_WB[:3, 3]).max())
        family = f"{kind} on {'swept ' * swept}{name}, {on}"
        if unions:
            A, X_WA = in_union(A, X_WA, rng, 40.0, exact) if not swept and rng.random() < 0.5 else (A, X_WA)
            B, X_WB = in_union(B, X_WB, rng, 80.0, exact)
            family += ", in unions"
        return Resting(A, B, X_WA, X_WB, family)


def in_union(shape, X: np.ndarray, rng, away: float, exact: bool) -> tuple[object, np.ndarray]:
    """(a union with the shape and a body ``away`` [m], its pose), which puts the shape at X but for rounding; exactly
    at poses of 0, 1, −1 and short shifts."""
    item = np.eye(4)
    item[:3, :3], item[:3, 3] = TURNS[rng.integers(24)], rng.integers(-16, 17, 3) / 8.0
    if not exact and rng.random() < 0.5:
        item = collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4))
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = item[:3, :3].T, -item[:3, :3].T @ item[:3, 3]
    other = item @ collide.pose((0.0, 0.0, away))
    return collide.Compound([(shape, item), (collide.Box((0.5, 0.5, 0.5)), other)]), X @ back


# --- judged ---------------------------------------------------------------------------------------


def separation(pair: Resting) -> int:
    """The sign of the distance of both bodies less their radii: 1 apart, 0 touching, −1 deeper. Bodies with radii have
    cores apart; facets of bodies without any may meet, which is 0 as well."""
    sides = [pieces(shape, exact_pose(X)) for shape, X in ((pair.A, pair.X_WA), (pair.B, pair.X_WB))]
    signs = [1]
    for triangle, r in sides[0]:
        for other, s in sides[1]:
            reach = float(r + s) * (1.0 + 1e-9)
            if box_gap(triangle, other) <= reach + 1e-12:
                meets = r + s == 0 and triangles_meet(*as_integers(triangle, other))
                off = Fraction(0) if meets else square_between(triangle, other) - (r + s) ** 2
                signs.append((off > 0) - (off < 0))
    return min(signs)


def exact_pose(X) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in row] for row in np.asarray(X)[:3]]


def product(X, Y) -> list[list[Fraction]]:
    turned = [[sum(X[i][k] * Y[k][j] for k in range(3)) for j in range(4)] for i in range(3)]
    return [[*row[:3], row[3] + X[i][3]] for i, row in enumerate(turned)]


def pieces(shape, X) -> list:
    """[(three corners as fractions, radius)] of the facets of all parts at an exact pose."""
    if isinstance(shape, collide.Compound):
        return [piece for item, Y in shape.items for piece in pieces(item, product(X, exact_pose(Y)))]
    radius = Fraction(float(getattr(shape, "radius", 0.0)))
    if isinstance(shape, collide.SweptMesh):
        shape = shape.mesh
    if isinstance(shape, collide.Sphere):
        corners = np.zeros((1, 3, 3))
    elif isinstance(shape, collide.Capsule):
        ends = np.array([[0.0, 0.0, -shape.length / 2], [0.0, 0.0, shape.length / 2]])
        corners = ends[None, [0, 1, 1]]
    elif isinstance(shape, collide.Mesh):
        corners = shape.vertices[shape.faces]
    else:  # a box, or a box swept by a ball
        half = 0.5 * np.asarray(shape.size) if isinstance(shape, collide.Box) else shape.points.max(axis=0)
        box = box_mesh(half)
        corners = box.vertices[box.faces]
    return [([placed(X, corner) for corner in triangle], radius) for triangle in corners.tolist()]


def placed(X, point) -> list[Fraction]:
    return [sum(X[i][k] * Fraction(point[k]) for k in range(3)) + X[i][3] for i in range(3)]


def box_gap(T, U) -> float:
    t, u = np.array(T, dtype=float), np.array(U, dtype=float)
    gap = np.maximum(t.min(axis=0) - u.max(axis=0), u.min(axis=0) - t.max(axis=0))
    return float(np.sqrt(np.square(np.maximum(gap, 0.0)).sum()))


def square_between(T, U) -> Fraction:
    """The squared distance of two triangles that share no point: a corner and a facet, or two edges, are nearest."""
    squares = [square_to_triangle(p, other) for S, other in ((T, U), (U, T)) for p in S]
    return min(squares + [square_of_edges(T[i - 1], T[i], U[j - 1], U[j]) for i in range(3) for j in range(3)])


def square_of_edges(a, b, c, d) -> Fraction:
    """The squared distance of the lines of two edges, where their nearest points lie on both; else infinite."""
    u, v, w = minus(b, a), minus(d, c), minus(c, a)
    n = cross(u, v)
    nn = inner(n, n)
    if not nn:
        return Fraction(10**12)
    s, t = inner(cross(w, v), n) / nn, inner(cross(w, u), n) / nn
    return inner(w, n) ** 2 / nn if 0 <= s <= 1 and 0 <= t <= 1 else Fraction(10**12)
