"""Lines of contact along rims and sharp edges of meshes: both ends of what is shared are there, on both surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from contact_oracle import ConvexBody, away_from, facet

import collide

EYE = np.eye(4)
RADIUS, LENGTH = 0.2, 0.8
ROUND = {
    "capsule": collide.Capsule(RADIUS, LENGTH), "cylinder": collide.Cylinder(RADIUS, LENGTH),
    "segment": collide.ConvexHull([[0, 0, -LENGTH / 2], [0, 0, LENGTH / 2]], radius=RADIUS),
}  # fmt: skip


def square(n: int) -> collide.Mesh:
    """An open square of side 2 across z, of n · n cells: a rim along y at x = 1."""
    k = np.linspace(-1.0, 1.0, n + 1)
    cells = [(n + 1) * i + j for i in range(n) for j in range(n)]
    faces = [f for c in cells for f in ((c, c + n + 1, c + n + 2), (c, c + n + 2, c + 1))]
    return collide.Mesh([(x, y, 0.0) for x in k for y in k], faces, solid=False)


def wedge(degrees: float, n: int) -> collide.Mesh:
    """A solid prism with an edge of this angle along y at x = 1, z = 0, cut into n pieces along it."""
    half = np.deg2rad(degrees) / 2
    outline = [(1.0, 0.0), (1.0 - 2 * np.cos(half), 2 * np.sin(half)), (1.0 - 2 * np.cos(half), -2 * np.sin(half))]
    points = [(x, y, z) for y in np.linspace(-1.0, 1.0, n + 1) for x, z in outline]
    sides = [(3 * i + p, 3 * i + (p + 1) % 3) for i in range(n) for p in range(3)]
    faces = [f for p, q in sides for f in ((p, q, q + 3), (p, q + 3, p + 3))]
    return collide.Mesh(points, [*faces, (0, 2, 1), (3 * n, 3 * n + 1, 3 * n + 2)])


#: Meshes, and angles in the plane across their edge, from x, at which a line leans on it.
TARGETS = {
    **{f"rim {n}": (square(n), np.deg2rad([90, 70, 53, 45, 30, 1, -60])) for n in (1, 3)},
    **{f"edge of {a}, {n}": (wedge(a, n), np.deg2rad((90 - a / 2) * np.array([-0.9, -0.5, 0, 0.7, 0.95])))
       for a in (20, 90, 120, 170) for n in (1, 3)},
}  # fmt: skip


@pytest.mark.many(2)
@pytest.mark.parametrize("body", ROUND)
@pytest.mark.parametrize("target", TARGETS)
def test_a_line_along_a_rim_or_a_sharp_edge_has_both_ends(target, body):
    """A line that turned by a hair from the edge ended where a steep facet did, or where it left a flat one."""
    (mesh, angles), B = TARGETS[target], ROUND[body]
    rng = np.random.default_rng(5)
    turned = 0
    for angle in angles:
        out, along = np.array([np.cos(angle), 0, np.sin(angle)]), np.array([0.0, 1.0, 0.0])
        for _ in range(4):
            turn = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, -3.1)
            gap, aside = rng.choice([1e-5, -1e-5, 1e-9, -1e-9, 0.0]), rng.choice([0.0, 1e-6, -1e-6])
            across = np.cross(along, out)
            X = np.eye(4)
            line = np.cos(turn) * along + np.sin(turn) * across
            X[:3, :3] = np.stack([out, np.cross(line, out), line], axis=1)
            X[:3, 3] = (1.0, rng.uniform(-0.2, 0.2), 0.0) + (RADIUS + gap) * out + aside * across
            where = f"{target}, {body}: X_WB = np.array({X.tolist()!r})"
            c = collide.contacts(mesh, B, EYE, X, margin=1e-3)
            assert np.ptp(c.point_a[:, 1]) > LENGTH - 1e-3, where
            swapped = collide.contacts(B, mesh, X, EYE, margin=1e-3)
            assert np.array_equal(swapped.point_b, c.point_a), where
            assert (c.lower <= c.distance).all() and (c.distance <= c.upper).all(), where
            off = np.abs(ConvexBody(B, X).signed(c.point_b)).astype(float)
            assert (off <= 1e-9).all(), (where, off)
            on_facet = [away_from(facet(mesh.vertices, mesh.faces, EYE, r["facet_a"]), r["point_a"]) for r in c.rows]
            assert max(on_facet) <= 1e-9, (where, on_facet)
            turned += abs(turn) > 1e-6
    assert turned >= len(angles)


@pytest.mark.parametrize("body", ROUND)
@pytest.mark.parametrize("beside", [0.0, 0.05, 0.15, 0.5])
def test_a_line_on_a_flat_face_beside_its_edge_has_no_others(body, beside):
    """The ends that the edge would have are farther than the face's own."""
    box = collide.Mesh(*collide.tessellate(collide.Box((2, 2, 2)))[:2])
    X = collide.pose((1.0 - beside, 0.0, 1.0 + RADIUS), rpy=(np.pi / 2, 0, 0))
    c = collide.contacts(box, ROUND[body], EYE, X, margin=1e-3)
    assert len(c) == 2 and np.abs(c.point_a[:, 0] - (1.0 - beside)).max() < 1e-9
