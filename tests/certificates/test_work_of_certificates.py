"""How many vertices of large bodies become integers for a certificate and its check; no time is measured."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import rng_of

import collide
from collide.numerics import exact_points

X_FAR, X_NEAR = collide.pose((2.3, 0.1, 0.2), rpy=(0.3, 0.2, 0.1)), collide.pose((0.6, 0.1, 0.2), rpy=(0.3, 0.2, 0.1))


def large_hull() -> collide.ConvexHull:
    points = rng_of("large hull").normal(size=(5000, 3))
    return collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None], radius=0.01)


def open_sheet() -> collide.Mesh:
    vertices, faces = bumpy_sphere(300)
    return collide.Mesh(vertices, faces[1:])


BODIES = {"hull": large_hull, "ball": lambda: collide.Mesh(*bumpy_sphere(4000)), "sheet": open_sheet,
          "small": lambda: collide.Mesh(*(0.01 * np.asarray(part) if k == 0 else part
                                          for k, part in enumerate(bumpy_sphere(300)))),
          "plane": lambda: collide.Halfspace((0.1, 0.2, -1.0), -1.9)}


@pytest.mark.parametrize(
    "A, B, X_WB, kind",
    [
        ("hull", "ball", X_FAR, "apart"), ("sheet", "hull", X_NEAR, "together"), ("ball", "ball", X_FAR, "apart"),
        ("ball", "small", np.eye(4), "inside"), ("ball", "plane", np.eye(4), "apart"),
        ("hull", "plane", np.eye(4), "apart"),
    ],
)
def test_few_vertices_of_large_bodies_become_integers(A, B, X_WB, kind, monkeypatch):
    A, B = BODIES[A](), BODIES[B]()
    row = collide.distance(A, B, np.eye(4), X_WB)
    made = []
    on_grid = exact_points._on_grid
    monkeypatch.setattr(exact_points, "_on_grid", lambda *args: made.append(1) or on_grid(*args))
    whole = exact_points.integers
    monkeypatch.setattr(exact_points, "integers", lambda values: made.extend(np.ravel(values)) or whole(values))
    (certificate,) = row.certificate
    assert certificate.kind == kind
    collide.verify(*row.question, row)
    assert 0 < len(made) < 1500, len(made)  # three a vertex, of thousands
