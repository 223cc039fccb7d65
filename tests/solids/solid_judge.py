"""What an arrangement of two solids says of points, against how often the solids' own facets wind around them."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from naive_triangles import world_points
from solid_families import SOLIDS
from solid_membership import as_doubles, windings

import collide
from collide.solids.arrangement import Arrangement, arrange
from collide.solids.boolean import OPERATIONS
from collide.solids.solid_operands import solid_operand

#: What each operation keeps, by definition.
BY_DEFINITION = {
    "union": lambda a, b: a or b,
    "intersection": lambda a, b: a and b,
    "difference": lambda a, b: a and not b,
    "symmetric_difference": lambda a, b: a != b,
}


class Verdict(NamedTuple):
    """wrong : descriptions of points judged otherwise.   n_points, n_both, n_near : judged, in both bodies, within 1e-9
    of the size of a surface.   adds_up : vol A + vol B = vol(A ∪ B) + vol(A ∩ B), in fractions."""

    wrong: list[str]
    n_points: int
    n_both: int
    n_near: int
    adds_up: bool


def solids_of(family: str, seed: int):
    """(A, B, X_WA, X_WB) of a case."""
    a, b, X, Y = SOLIDS[family](np.random.default_rng(seed))
    A = collide.Mesh(*a, solid=True)
    return A, A if b is a else collide.Mesh(*b, solid=True), np.asarray(X, dtype=float), np.asarray(Y, dtype=float)


def arrangement_of(A, B, X, Y) -> Arrangement:
    return arrange([solid_operand("test", name, S, P, True) for name, S, P in (("A", A, X), ("B", B, Y))])


def exact_corners(arrangement: Arrangement, triangles: np.ndarray, origin: list[Fraction]) -> list:
    """Corners of triangles in W less an origin, in fractions."""
    unit, start = Fraction(2) ** arrangement.facets.grid, arrangement.facets.origin
    seen = {}
    for p in np.unique(triangles).tolist():
        x = arrangement.points.exact(p)
        seen[p] = [(Fraction(v, x[3]) + s) * unit - o for v, s, o in zip(x[:3], start, origin)]
    return [[seen[p] for p in t] for t in triangles.tolist()]


def six_volumes(corners: list) -> Fraction:
    """Six times what triangles enclose."""
    total = Fraction(0)
    for a, b, c in corners:
        total += a[0] * (b[1] * c[2] - b[2] * c[1])
        total += a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    return total


def judge(A, B, X, Y, n_points: int, seed: int) -> Verdict:
    """n_points points, half of them within 1e-9 of the size of a surface."""
    rng = np.random.default_rng(seed)
    arrangement = arrangement_of(A, B, X, Y)
    origin = world_points(A.vertices[:1], X)[0]
    inputs = [in_world(mesh, pose, origin) for mesh, pose in ((A, X), (B, Y))]
    held = arrangement.holds()
    common = exact_corners(arrangement, arrangement.boundary(held.all(axis=1))[0], origin)
    points, n_near = draw_points(rng, [as_doubles(t) for t in inputs], as_doubles(common), n_points)
    winds = [windings(t, points) for t in inputs]
    wrong, judged, both = [], 0, 0
    volumes = {}
    for name, rule in OPERATIONS.items():
        corners = exact_corners(arrangement, arrangement.boundary(rule(held))[0], origin)
        volumes[name] = six_volumes(corners)
        for k, number in enumerate(windings(corners, points)):
            if winds[0][k] is None or winds[1][k] is None:
                continue  # on a surface: regular sets differ from closed ones
            a, b = winds[0][k] >= 1, winds[1][k] >= 1
            judged, both = judged + 1, both + (a and b)
            if number != int(BY_DEFINITION[name](a, b)):
                wrong.append(f"{name}: winds {number} times around {points[k].tolist()}, A: {a}, B: {b}")
    alone = [six_volumes(exact_corners(arrangement, arrangement.boundary(held[:, k])[0], origin)) for k in range(2)]
    adds_up = sum(alone) == volumes["union"] + volumes["intersection"]
    adds_up &= volumes["symmetric_difference"] == volumes["union"] - volumes["intersection"]
    return Verdict(wrong, judged, both, n_near, adds_up and volumes["difference"] == alone[0] - volumes["intersection"])


def in_world(mesh, X, origin) -> list:
    corners = world_points(mesh.vertices, X)
    return [[[x - o for x, o in zip(corners[v], origin)] for v in face] for face in mesh.faces.tolist()]


def draw_points(rng, surfaces: list[np.ndarray], overlap: np.ndarray, n: int) -> tuple[np.ndarray, int]:
    """Points around both surfaces, half of them next to one; many next to the overlap's."""
    corners = np.concatenate([*surfaces, *[overlap] * (1 + 2 * sum(map(len, surfaces)) // max(len(overlap), 1))])
    low, high = (np.array(bound) for bound in zip(*[(s.min(axis=(0, 1)), s.max(axis=(0, 1))) for s in surfaces]))
    around = np.maximum(low.min(axis=0), -np.inf), high.max(axis=0)
    common = low.max(axis=0), high.min(axis=0)
    if (common[0] >= common[1]).any() or rng.random() < 0.3:
        common = around
    n_near = n // 2
    n_common = (n - n_near) // 2
    far = [rng.uniform(*common, (n_common, 3)), rng.uniform(*around, (n - n_near - n_common, 3))]
    size = np.abs(corners - corners[0, 0]).max()
    weights = rng.dirichlet(np.ones(3), n_near)
    weights[rng.random(n_near) < 0.2, 0] = 0.0  # next to edges
    near = (corners[rng.integers(len(corners), size=n_near)] * weights[:, :, None]).sum(axis=1)
    near /= weights.sum(axis=1)[:, None]
    offsets = rng.normal(size=(n_near, 3))
    near += offsets / np.abs(offsets).max(axis=1)[:, None] * size * 10.0 ** rng.uniform(-12, -9, (n_near, 1))
    return np.concatenate([*far, near]), n_near


def snippet(family: str, seed: int) -> str:
    return f"from solid_judge import *; print(judge(*solids_of({family!r}, {seed}), 200, {seed}))  # on tests' path"
