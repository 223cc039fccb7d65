"""Bodies that are hard for a hierarchy, by number of vertices; used by tests, benchmarks have the same names."""

from __future__ import annotations

import numpy as np


def ring(n: int, z: float = 0.0, radius: float = 1.0, phase: float = 0.0) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n + phase
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, z)])


def turned(points: np.ndarray) -> np.ndarray:
    """Rotated by no special angle, rounded."""
    w, x, y, z = np.array([0.3, -0.5, 0.7, 0.41]) / np.sqrt(0.3**2 + 0.5**2 + 0.7**2 + 0.41**2)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.column_stack([sum(r * points[:, k] for k, r in enumerate(row)) for row in rows])


def degree_doubling(rounds: int) -> np.ndarray:
    """Section 4's example: a tetrahedron with a vertex q; each round adds a vertex slightly above each facet at q.

    (3·2^rounds + 1, 3), q first, at the origin, with all others as neighbours: they lie on the rays of a round cone.
    The vertices of a round stand half-way between those before, half as far from q as the round before: in the
    middle of a facet and above it by the sagitta of the cone, which is below all planes of other facets.
    """
    rows = [np.zeros((1, 3)), ring(3, -1.0)]
    for k in range(rounds):
        many = 3 * 2**k
        rows.append(ring(many, -1.0, 1.0, np.pi / many) * 0.5 ** (k + 1))
    return np.concatenate(rows)


def bipyramid(n: int, height: float = 1.0) -> np.ndarray:
    """(n + 2, 3): two vertices with n neighbours each."""
    return np.concatenate([ring(n), [[0, 0, height], [0, 0, -height]]])


def cone(n: int) -> np.ndarray:
    return np.concatenate([ring(n), [[0, 0, 2]]])


def prism(n: int, height: float = 1.0) -> np.ndarray:
    """(2 n, 3): two flat sides with n corners each."""
    return np.concatenate([ring(n, -height), ring(n, height)])


def sphere(n: int) -> np.ndarray:
    points = np.random.default_rng(n).normal(size=(n, 3))
    return points / np.sqrt(np.square(points).sum(axis=1))[:, None]


def cube_grid(m: int) -> np.ndarray:
    """Lattice points on the surface of a cube: 8 vertices, all others on sides and edges."""
    grid = np.stack(np.meshgrid(*[np.arange(m)] * 3), axis=-1).reshape(-1, 3)
    return grid[((grid == 0) | (grid == m - 1)).any(axis=1)].astype(float)


def moment_curve(n: int) -> np.ndarray:
    """Two vertices that are neighbours of each other and of all others."""
    t = np.linspace(-1, 1, n)
    return np.column_stack([t, t * t, t**3])


def arcs(n: int) -> np.ndarray:
    """Two arcs: four vertices with n / 2 neighbours each, some of them neighbours."""
    t = np.linspace(-1, 1, n // 2)
    return np.concatenate([np.c_[t, 0 * t, 1 - 0.1 * t * t], np.c_[0 * t, t, 0.1 * t * t - 1]])


def crowded(n: int) -> np.ndarray:
    """A curve whose points crowd together at one end, over 15 decimal places."""
    fine = 2.0 ** -np.linspace(0, 50, n)
    return np.column_stack([fine, fine * fine, fine**3])


def random_ring(n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) points of the unit circle at random angles: the nearest two are some 6/n² apart."""
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
    return np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])


def irregular(name: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """A body of about n vertices at random places: bipyramid, cone, prism, cap or doubling; "…, turned" as well."""
    if name.endswith(", turned"):
        return turned(irregular(name.removesuffix(", turned"), n, rng))
    if name == "doubling":
        return degree_doubling(int(np.log2(n / 3))) * rng.uniform(0.5, 2.0, 3)
    if name == "cap":
        z, angle = 1.0 - 0.1 * rng.random(n), rng.uniform(0.0, 2.0 * np.pi, n)
        return np.column_stack([np.sqrt(1.0 - z * z) * np.cos(angle), np.sqrt(1.0 - z * z) * np.sin(angle), z])
    ring = random_ring(n // 2 if name == "prism" else n, rng)
    if name == "prism":
        up = np.array([0.0, 0.0, 1.0])
        return np.concatenate([ring + up, ring - up])
    tips = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]] if name == "bipyramid" else [[0.0, 0.0, 2.0]]
    return np.concatenate([ring, tips])


IRREGULAR = (
    "bipyramid", "bipyramid, turned", "cone", "cone, turned", "prism", "prism, turned", "cap", "doubling",
)


def families(n: int) -> dict[str, np.ndarray]:
    """Bodies with interior, of about n vertices."""
    rounds = max(1, int(np.log2(n / 3)))
    return {
        "sphere": sphere(n), "degree doubling": degree_doubling(rounds), "bipyramid": bipyramid(n),
        "bipyramid, turned": turned(bipyramid(n, 0.1)), "cone": cone(n), "cone, turned": turned(cone(n)),
        "prism": prism(n // 2), "prism, turned": turned(prism(n // 2)), "pancake, turned": turned(prism(n // 2, 1e-6)),
        "needle, turned": turned(sphere(n) * [1.0, 1e-6, 1e-6]), "cube": cube_grid(4),
        "cube, turned": turned(cube_grid(4)),
        "moment curve": moment_curve(n), "arcs": arcs(n), "arcs, turned": turned(arcs(n)), "crowded": crowded(n),
    }


#: Families in which vertices of large degree are neighbours, or cannot all be cut.
STUBBORN = {"moment curve", "arcs", "arcs, turned", "crowded"}


def removed_shares(hierarchy, least: int = 16) -> np.ndarray:
    """(levels,) by which part each level of at least so many vertices shrinks to the next one, where none is cut.

    A P-independent set has a tenth of the vertices or more (Barba and Langerman, section 4); cuts are another step.
    """
    leaves = np.bincount(hierarchy.last[hierarchy.birth >= 0], minlength=hierarchy.depth)
    without_cut = np.ones(hierarchy.depth, dtype=bool)
    without_cut[hierarchy.birth[hierarchy.birth > 0] - 1] = False
    without_cut[-1] = False
    counted = without_cut & (hierarchy.sizes >= least)
    return leaves[counted] / hierarchy.sizes[counted]
