"""What snippets of every engine share: numbers, poses, hulls and simple shapes as Python text."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.question import corners
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere


class Asked(NamedTuple):
    """What a snippet is about.

    setting : of the engine; empty for the plain one.   expected : what is true, in words.
    points : the nearest points are what is wrong, and are printed.
    """

    case: Case
    setting: str
    expected: str
    points: bool = False

    def true_line(self) -> str:
        """The line that prints what is true; before the engine is asked, which may end the process."""
        return f"print({f'true: {self.expected}'!r}, flush=True)"


def n_rows(shape: Shape) -> int:
    """Points and facets of a shape that a snippet would have to list."""
    if isinstance(shape, Mesh):
        return len(shape.vertices) + len(shape.faces)
    points = None if isinstance(shape, Halfspace) else corners(shape)
    return 0 if points is None else len(points[0])


def numbers(array) -> str:
    """An array as a list."""
    return repr(np.asarray(array).tolist())


def poses(case: Case) -> list[str]:
    """Lines that define R and t of both bodies."""
    return [
        f"R_{letter}, t_{letter} = {rotation(body.X_WB)}, np.array({numbers(body.X_WB[:3, 3])})"
        for letter, body in zip("AB", case.bodies)
    ]


def rotation(X: np.ndarray) -> str:
    """The rotation of a pose (4, 4)."""
    return "np.eye(3)" if np.array_equal(X[:3, :3], np.eye(3)) else f"np.array({numbers(X[:3, :3])})"


def unit(shape: Halfspace) -> tuple[str, float]:
    """A half-space's unit normal, and its offset [m]."""
    length = float(np.linalg.norm(shape.normal))
    return f"np.array({numbers(shape.normal / length)})", float(shape.offset / length)


def primitive(module: str, shape: Shape) -> str | None:
    """The call that makes a shape which fcl and coal both have under the same name."""
    if isinstance(shape, Sphere):
        return f"{module}.Sphere({shape.radius!r})"
    if isinstance(shape, Box):
        return f"{module}.Box({', '.join(map(repr, shape.size.tolist()))})"
    for kind in (Capsule, Cylinder, Cone):
        if isinstance(shape, kind):
            return f"{module}.{kind.__name__}({shape.radius!r}, {shape.length!r})"
    if isinstance(shape, Ellipsoid):
        return f"{module}.Ellipsoid({', '.join(map(repr, shape.radii.tolist()))})"
    if isinstance(shape, Halfspace):
        normal, offset = unit(shape)
        return f"{module}.Halfspace({normal}, {offset!r})"
    return None


def hull(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (k, 3) of a polytope, as the peers are given them; KeyError of others."""
    points = corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return triangulate(points[0])
