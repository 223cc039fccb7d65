"""Random pairs of shapes for `soak.py`: every ordered pair of kinds, sizes far apart, poses near touching on
purpose."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from typing import NamedTuple

import curved_oracle
import numpy as np
from curved_cells import CONTEXT, vector
from naive import turn

import collide
from collide.scenes.families.ingredients import direction

CURVED = ("cylinder", "cone", "ellipsoid")
MESHES = ("solid", "surface", "mesh compound")
KINDS = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space",
    *CURVED, "compound", "solid", "surface", "mesh compound",
)
#: Kinds that only Worlds are soaked with: the oracle of pairs has none of them, or has them among the others.
WORLD_KINDS = (
    *KINDS, "point", "segment", "polygon", "height field", "region", "region with an end", "half-space compound",
    "nested compound",
)
#: Those that have no end.
ENDLESS = ("half-space", "region", "half-space compound")
POSES = ("near", "equal origins", "inside", "anywhere", "one frame")


class Case(NamedTuple):
    """A question.   number : with the seed it names the case.   poses : how they were drawn."""

    number: int
    kinds: tuple[str, str]
    poses: str
    A: collide.Shape
    B: collide.Shape
    X_WA: np.ndarray
    X_WB: np.ndarray


def draw(seed: int, number: int, ratio: float, kinds: tuple[str, ...] = KINDS) -> Case:
    """Case ``number``: the same whenever it is asked for."""
    random = np.random.default_rng([seed, number])
    which = str(random.choice(kinds)), str(random.choice(kinds))
    both = 10.0 ** (random.uniform(-3, 3) if random.uniform() < 0.5 else 0.0)
    sizes = [both, both * ratio ** -random.uniform()]
    random.shuffle(sizes)
    A, B = (shape(kind, size, random) for kind, size in zip(which, sizes))
    X_WA, X_WB = rotation(random), rotation(random)
    if random.uniform() < 0.3:
        X_WB[:3, :3] = X_WA[:3, :3]
    elif random.uniform() < 0.15:  # nearly parallel
        X_WB[:3, :3] = turn(angle=10.0 ** random.uniform(-12, -1), axis=random.normal(size=3)) @ X_WA[:3, :3]
    X_WA[:3, 3] = random.normal(size=3) * sizes[0] * random.choice([0.0, 1.0, 1e3], p=[0.5, 0.4, 0.1])
    poses = str(random.choice(POSES, p=[0.62, 0.1, 0.1, 0.15, 0.03]))
    if poses == "one frame":
        X_WB = X_WA.copy()
        B, which = (A, (which[0], which[0])) if random.uniform() < 0.5 else (B, which)
    elif poses == "near":
        _near(A, B, X_WA, X_WB, sizes, random)
    else:
        far = {"equal origins": 0.0, "inside": 0.3 * random.uniform(), "anywhere": 4.0 * random.uniform()}[poses]
        X_WB[:3, 3] = X_WA[:3, 3] + far * max(sizes) * direction(random)
    return Case(number, which, poses, A, B, X_WA, X_WB)


# --- poses --------------------------------------------------------------------------------------


def rotation(random) -> np.ndarray:
    """A pose at the origin: turned anyhow, not at all, or by right angles."""
    how = random.uniform()
    if how < 0.5:
        return collide.pose(quat_wxyz=random.normal(size=4))
    X = np.eye(4)
    if how < 0.75:
        order, signs = random.permutation(3), random.choice([-1.0, 1.0], size=3)
        X[:3, :3] = np.eye(3)[order] * signs[:, None]
        X[2, :3] *= np.linalg.det(X[:3, :3])
    return X


def _near(A, B, X_WA, X_WB, sizes, random) -> None:
    """Move B to where a direction puts it a gap, or an overlap, of 1e-16 … 10 sizes beside A."""
    u = direction(random) if random.uniform() < 0.6 else X_WA[:3, int(random.integers(3))] * random.choice([-1.0, 1.0])
    size = min(sizes) if random.uniform() < 0.6 else max(sizes)
    gap = size * 10.0 ** random.uniform(-16, 1) if random.uniform() < 0.7 else size * random.uniform(0.1, 1)
    gap *= random.choice([1.0, -1.0], p=[0.7, 0.3])
    planes = [isinstance(S, collide.Halfspace) for S in (A, B)]
    if any(planes):
        X_WB[:3, 3] = X_WA[:3, 3] + random.normal(size=3) * max(sizes)
        if not all(planes):
            found = curved_oracle.bracket(A, B, X_WA, X_WB)
            n = np.array([float(x) for x in found.n])
            X_WB[:3, 3] += (gap - float(found.lower)) * n / np.linalg.norm(n)
        return
    end_a, end_b = extreme(A, X_WA, u), extreme(B, X_WB, -u)
    X_WB[:3, 3] = end_a + gap * u - end_b
    if random.uniform() < 0.3:
        side = np.cross(u, direction(random))
        X_WB[:3, 3] += side * min(sizes) * random.uniform()


def extreme(shape, X, u: np.ndarray) -> np.ndarray:
    """(3,) a point of a bounded body farthest along u."""
    with localcontext(CONTEXT):
        n = vector(u)
        cells = curved_oracle.Body(shape, X).cells
        length = vector([np.linalg.norm(u)])[0]
        ends = [(cell.support(n), cell.radius) for cell in cells]
        (_, p), radius = max(ends, key=lambda end: end[0][0] / length + end[1])
        return np.array([float(x + radius * d / length) for x, d in zip(p, n)], dtype=float)


# --- shapes -------------------------------------------------------------------------------------


def shape(kind: str, size: float, random) -> collide.Shape:
    """A shape of a kind, its largest length about ``size``, the others within a factor of 20 (at times of 1000)."""
    spread = 20.0 if random.uniform() < 0.85 else 1000.0
    lengths = size * spread ** -random.uniform(size=3)
    lengths[random.integers(3)] = size
    if random.uniform() < 0.15:
        lengths[:] = size
    return _MAKERS[kind](lengths, random)


def _hull(lengths, random, radius=0.0):
    count = int(random.choice([4, 6, 12, 40, 166, 300], p=[0.25, 0.2, 0.2, 0.2, 0.1, 0.05]))
    points = random.normal(size=(count, 3))
    if random.uniform() < 0.5:
        points /= np.linalg.norm(points, axis=1)[:, None]
    return collide.ConvexHull(points * lengths / 2, radius=radius)


def _flat_hull(lengths, random):
    points = random.normal(size=(int(random.integers(1, 8)), 3)) * lengths / 2
    points[:, 2] = 0.0
    if random.uniform() < 0.3:
        points[:, 1] = 0.0
    return collide.ConvexHull(
        points, radius=0.0 if random.uniform() < 0.6 or np.abs(points).max() == 0 else float(min(lengths) / 4)
    )


def _h_polytope(lengths, random):
    sides = np.vstack([np.eye(3), -np.eye(3)]) / np.tile(lengths / lengths.max(), 2)[:, None]
    more = random.normal(size=(int(random.integers(0, 5)), 3)) / (lengths / lengths.max())
    normals = np.vstack([sides, more])
    offsets = np.r_[np.full(6, 0.5), 0.5 * np.linalg.norm(more * (lengths / lengths.max()), axis=1)] * lengths.max()
    return collide.HPolytope(normals, offsets * random.uniform(0.6, 1.0, size=len(offsets)))


def _with_no_corners(polytope):
    return collide.HPolytope(polytope.normals, polytope.offsets, bounded=False)


def _compound(lengths, random, kinds):
    items = []
    for _ in range(int(random.integers(1, 4))):
        X = rotation(random)
        X[:3, 3] = random.normal(size=3) * lengths.max() / 2
        items.append((shape(str(random.choice(kinds)), float(lengths.max()) * random.uniform(0.2, 1), random), X))
    return collide.Compound(items)


def _region(lengths, random):
    """One to three half-spaces that hold the origin: without end."""
    normals = random.normal(size=(int(random.integers(1, 4)), 3))
    if random.uniform() < 0.4:
        normals = np.vstack([normals[:1], -normals[:1]])  # a slab
    return collide.HPolytope(normals, random.uniform(0.1, 1, len(normals)) * lengths.max(), bounded=False)


def _half_space_compound(lengths, random):
    plane, ball = _MAKERS["half-space"](lengths, random), collide.Sphere(lengths.max() / 3)
    return collide.Compound([(ball, rotation(random)), (plane, rotation(random))])


def _nested_compound(lengths, random):
    inner = _compound(lengths, random, (*_PLAIN, "solid", "surface"))
    return collide.Compound([(inner, rotation(random)), (_compound(lengths / 2, random, _PLAIN), rotation(random))])


def _height_field(lengths, random):
    heights = random.uniform(0, 1, size=random.integers(2, 6, 2)) * lengths.min()
    return collide.HeightField(heights, lengths.max() / max(heights.shape))


def ball_facets(rings: int = 5, sides: int = 7):
    """Facets of a ball of radius 1, counter-clockwise from outside."""
    points = [(0.0, 0.0, -1.0)]
    for k in range(1, rings):
        z = -math.cos(math.pi * k / rings)
        points += [
            (math.sqrt(1 - z * z) * math.cos(t), math.sqrt(1 - z * z) * math.sin(t), z)
            for t in np.arange(sides) * 2 * math.pi / sides
        ]
    points.append((0.0, 0.0, 1.0))
    top, faces = len(points) - 1, []
    for s in range(sides):
        t = (s + 1) % sides
        faces.append((0, 1 + t, 1 + s))
        for k in range(rings - 2):
            a, b = 1 + k * sides, 1 + (k + 1) * sides
            faces += [(a + s, a + t, b + t), (a + s, b + t, b + s)]
        faces.append((1 + (rings - 2) * sides + s, 1 + (rings - 2) * sides + t, top))
    return np.array(points), np.array(faces)


def _ring_facets(sides: int = 6):
    """Facets of a ring with a square section: a hole that a hull would fill."""
    angle = np.arange(sides) * 2 * math.pi / sides
    section = ((0.4, -0.3), (1.0, -0.3), (1.0, 0.3), (0.4, 0.3))
    points = np.array([(r * math.cos(t), r * math.sin(t), z) for t in angle for r, z in section])
    faces = []
    for s in range(sides):
        for k in range(4):
            a, b = 4 * s + k, 4 * s + (k + 1) % 4
            c, d = (4 * s + 4 + k) % len(points), (4 * s + 4) % len(points) + (k + 1) % 4
            faces += [(a, c, d), (a, d, b)]
    return points, np.array(faces)


def _solid(lengths, random):
    which = random.uniform()
    if which < 0.2:
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
        faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    elif which < 0.45:
        points = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        faces = np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])
    elif which < 0.6:
        points, faces = _ring_facets()
    elif which < 0.75:  # a hollow ball
        points, faces = ball_facets(4, 6)
        points, faces = np.vstack([points, 0.6 * points]), np.vstack([faces, faces[:, ::-1] + len(points)])
    else:  # a ball with bumps
        points, faces = ball_facets()
        points = points * random.uniform(0.6, 1.0, size=(len(points), 1))
    return collide.Mesh(points * lengths / 2, faces)


def _surface(lengths, random):
    if random.uniform() < 0.5:
        points, faces = ball_facets()
        faces = faces[random.permutation(len(faces))[: int(random.integers(1, len(faces)))]]
        return collide.Mesh(points * lengths / 2, faces, solid=False)
    n = int(random.integers(2, 6))
    grid = np.array([(x, y, 0.0) for x in np.linspace(-1, 1, n) for y in np.linspace(-1, 1, n)])
    if random.uniform() < 0.6:
        grid[:, 2] = random.uniform(-0.4, 0.4, size=len(grid))
    corners = [n * i + j for i in range(n - 1) for j in range(n - 1)]
    faces = [f for k in corners for f in ((k, k + n, k + n + 1), (k, k + n + 1, k + 1))]
    return collide.Mesh(grid * lengths / 2, faces, solid=False)


_PLAIN = ("sphere", "box", "capsule", "hull", *CURVED)
_MAKERS = {
    "sphere": lambda L, random: collide.Sphere(L.max() / 2),
    "box": lambda L, random: collide.Box(L),
    "capsule": lambda L, random: collide.Capsule(L[0] / 2, L[1] * (random.uniform() < 0.9)),
    "hull": _hull,
    "swept hull": lambda L, random: _hull(L / 2, random, radius=float(random.choice(L)) / 4),
    "flat hull": _flat_hull,
    "h-polytope": _h_polytope,
    "half-space": lambda L, random: collide.Halfspace(random.normal(size=3), L[0] * random.normal()),
    "cylinder": lambda L, random: collide.Cylinder(L[0] / 2, L[1]),
    "cone": lambda L, random: collide.Cone(L[0] / 2, L[1]),
    "ellipsoid": lambda L, random: collide.Ellipsoid(L / 2),
    "compound": lambda L, random: _compound(L, random, _PLAIN),
    "solid": _solid,
    "surface": _surface,
    "mesh compound": lambda L, random: _compound(L, random, (*_PLAIN, "solid", "solid", "surface")),
    "point": lambda L, random: collide.ConvexHull(random.normal(size=(1, 3)) * L / 2),
    "segment": lambda L, random: collide.ConvexHull(random.normal(size=(2, 3)) * L / 2),
    "polygon": lambda L, random: collide.ConvexHull(random.normal(size=(7, 3)) * (L[0], L[1], 0.0) / 2),
    "height field": _height_field,
    "region": _region,
    "region with an end": lambda L, random: _with_no_corners(_h_polytope(L, random)),
    "half-space compound": _half_space_compound,
    "nested compound": _nested_compound,
}


# --- as text ------------------------------------------------------------------------------------


def source(shape) -> str:
    """Python text that makes a shape, with its exact numbers."""
    kind = type(shape).__name__
    if kind == "Compound":
        return (
            "C.Compound([" + ", ".join(f"({source(item)}, np.array({X.tolist()!r}))" for item, X in shape.items) + "])"
        )
    if kind == "Mesh":
        return f"C.Mesh({shape.vertices.tolist()!r}, {shape.faces.tolist()!r}, solid={bool(shape.solid)})"
    if kind == "ConvexHull":
        return f"C.ConvexHull({shape.points.tolist()!r}, radius={shape.radius!r})"
    names = {"Box": ("size",), "Sphere": ("radius",), "Ellipsoid": ("radii",), "Halfspace": ("normal", "offset"),
             "HPolytope": ("normals", "offsets")}.get(kind, ("radius", "length"))
    values = (getattr(shape, name) for name in names)
    return f"C.{kind}(" + ", ".join(repr(v.tolist() if isinstance(v, np.ndarray) else v) for v in values) + ")"


def question(case: Case) -> str:
    """Python text that asks a case's question."""
    return (
        f"import numpy as np, collide as C\nA = {source(case.A)}\nB = {source(case.B)}\n"
        f"X_WA = np.array({case.X_WA.tolist()!r})\nX_WB = np.array({case.X_WB.tolist()!r})\n"
    )


# --- sizes and what is promised of them -----------------------------------------------------------


def pieces(shape) -> list:
    """The shapes a compound is made of, or the shape alone."""
    return [p for item, _ in shape.items for p in pieces(item)] if isinstance(shape, collide.Compound) else [shape]


def reach(shape) -> float:
    """The largest distance of a body's points from its frame's origin, or |offset| of a half-space, about."""
    kind = type(shape).__name__
    if kind == "Compound":
        return max(reach(item) + float(np.linalg.norm(X[:3, 3])) for item, X in shape.items)
    if kind == "Halfspace":
        return abs(shape.offset) / float(np.linalg.norm(shape.normal))
    if kind == "Mesh":
        return float(np.linalg.norm(shape.vertices, axis=1).max())
    if kind == "Ellipsoid":
        return float(shape.radii.max())
    if kind in ("Cylinder", "Cone"):
        return math.hypot(shape.radius, shape.length / 2)
    points = curved_oracle.core_points(shape, kind)
    return max(math.hypot(*map(float, p)) for p in points) + float(getattr(shape, "radius", 0.0))


def size_of(case: Case) -> float:
    """S of docs/conventions.md."""
    return reach(case.A) + reach(case.B) + float(np.linalg.norm(case.X_WA[:3, 3] - case.X_WB[:3, 3]))


def widest(case: Case, d: float) -> Decimal | None:
    """How wide a certified bracket may be, by the table of docs/conventions.md; None where none is certified."""
    S = size_of(case)
    parts = [*pieces(case.A), *pieces(case.B)]
    names = {type(p).__name__ for p in parts}
    united = any(isinstance(s, collide.Compound) and len(pieces(s)) > 1 for s in (case.A, case.B))
    if d < 0 and "Mesh" in names and "Halfspace" not in names:
        return None
    if names & {"Cylinder", "Cone", "Ellipsoid"}:
        return Decimal(2.0**-26 * S)
    if "HPolytope" in names or (d < 0 and united):
        return Decimal(2.0**-40 * S)
    if "Mesh" in names and ("Halfspace" not in names or any(isinstance(s, collide.Compound) for s in (case.A, case.B))):
        return Decimal(2.0**-43 * S)
    return Decimal(abs(d)) * (Decimal(2) ** -50 if d >= 0 else Decimal("1e-12"))
