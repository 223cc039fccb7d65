"""What is asked: bodies, the pairs to answer, and how far apart they may be to matter.

A `Question` is plain data. It pickles, so that it can be asked in a child process, and it holds the
scene's own rules about which pairs count, so that collide can be asked as a whole World while the
other engines are asked pair by pair.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument
from collide.shapes import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HPolytope,
    Mesh,
    PointCloud,
    Shape,
    Sphere,
)
from collide.transforms import as_poses

#: Pairs farther apart than this part of the scene are left out, unless every pair is asked for.
NEARBY = 0.1


class Body(NamedTuple):
    """A posed shape: name, shape, X_WB (4, 4) [m], and what the filters look at."""

    name: str
    shape: Shape
    X_WB: np.ndarray
    static: bool = False
    group: int = 1
    mask: int = 0xFFFF


@dataclass(frozen=True)
class Question:
    """The same question for every engine.

    Parameters
    ----------
    bodies : list of Body
        What is where; ids in tables are indices into this list.
    pairs : list of (i, j)
        i < j, in the order in which answers come.
    max_distance : float
        How far apart a pair may be and still be reported by a World [m].
    allowed : list of (i, j)
        Pairs that the scene never tests.
    isolated : bool
        The pairs stand for themselves (bodies of different pairs may lie anywhere), so they are asked one by one even
        of an engine that answers whole worlds.

    Regions of half-spaces (`HPolytope` with bounded=False), which no peer knows, are asked of every engine as hulls of
    their corners in a box that all bodies with an end are well inside: that changes no answer by more than rounding.
    """

    bodies: list[Body]
    pairs: list[tuple[int, int]]
    max_distance: float = 0.0
    allowed: list[tuple[int, int]] = field(default_factory=list)
    isolated: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "bodies", _with_regions_closed(self.bodies))

    @classmethod
    def from_pairs(cls, pairs: Iterable[tuple], max_distance: float = 0.0) -> Question:
        """A question of unrelated pairs.

        Parameters
        ----------
        pairs : iterable of (A, B, X_WA, X_WB)
            Two shapes and their (4, 4) poses each.
        max_distance : float
            [m]

        Returns
        -------
        Question
            Isolated: two bodies a pair.

        Raises
        ------
        InvalidArgument
            Where an item is no such tuple.
        """
        bodies = []
        for k, item in enumerate(pairs):
            if len(item) != 4:
                raise InvalidArgument(f"pairs[{k}] must be (A, B, X_WA, X_WB), got {len(item)} items")
            A, B, X_WA, X_WB = item
            for side, shape, X in (("a", A, X_WA), ("b", B, X_WB)):
                if not isinstance(shape, Shape):
                    raise InvalidArgument(f"pairs[{k}]: {side} must be a shape, got {type(shape).__name__}")
                bodies.append(Body(f"{side}{k}", shape, as_poses(X, f"pairs[{k}] X_W{side.upper()}")[0]))
        return cls(bodies, [(k, k + 1) for k in range(0, len(bodies), 2)], max_distance, isolated=True)

    @classmethod
    def from_scene(cls, scene, max_distance: float = 0.0, *, every_pair: bool = False) -> Question:
        """A question of the pairs that a scene's own rules test, near enough to matter.

        The rules are read from the description, not from a World, and no broadphase is asked: a pair that the engine
        wrongly drops is still among the questions.

        Parameters
        ----------
        scene : Scene or World
            Its bodies, filters and allowed pairs are taken over.
        max_distance : float
            The clearance of interest [m].
        every_pair : bool
            Also ask pairs whose bounding boxes are farther apart than ``max_distance`` and than a tenth of the scene.

        Returns
        -------
        Question
            Not isolated.
        """
        bodies, allowed = _read(scene)
        bodies = _with_regions_closed(bodies)
        tested = _tested(bodies, allowed)
        if not every_pair:
            tested = _near(bodies, tested, max_distance)
        return cls(bodies, tested, max_distance, allowed)

    def sizes(self) -> list[float]:
        """What "small" is measured against, pair by pair.

        Returns
        -------
        list of float
            The larger bounded body's diagonal [m]; 1 where neither is bounded.
        """
        diagonals = [diagonal(*bounds(body)) for body in self.bodies]
        of_pairs = ([d for d in (diagonals[i], diagonals[j]) if np.isfinite(d)] for i, j in self.pairs)
        return [max(lengths, default=1.0) for lengths in of_pairs]

    def names(self, k: int) -> tuple[str, str]:
        """Names of the bodies of a pair.

        Parameters
        ----------
        k : int
            Number of the pair.

        Returns
        -------
        (str, str)
            A's and B's.
        """
        i, j = self.pairs[k]
        return self.bodies[i].name, self.bodies[j].name


def ask(of, max_distance: float = 0.0, *, every_pair: bool = False) -> Question:
    """A `Question` from a Question (returned as it is), a Scene, a World, or (A, B, X_WA, X_WB) tuples."""
    if isinstance(of, Question):
        return of
    if hasattr(of, "bodies") or hasattr(of, "ids"):
        return Question.from_scene(of, max_distance, every_pair=every_pair)
    try:
        pairs = list(of)
    except TypeError:
        raise InvalidArgument(
            "a question is made from a Scene, a World, a Question or (A, B, X_WA, X_WB) tuples, got "
            f"{type(of).__name__}"
        ) from None
    return Question.from_pairs(pairs, max_distance)


def _read(scene) -> tuple[list[Body], list[tuple[int, int]]]:
    if hasattr(scene, "ids"):  # a World: ids may have gaps where bodies were removed
        posed_shapes = [scene.body(i) for i in scene.ids]
        listed = scene._allowed  # pairs of ids; the World shows them nowhere else
        key = {b.id: k for k, b in enumerate(posed_shapes)}
    else:
        posed_shapes, listed = list(scene.bodies), scene.allowed
        key = {b.name: k for k, b in enumerate(posed_shapes)}
    bodies = [Body(b.name, b.shape, np.array(b.X_WB), b.static, b.group, b.mask) for b in posed_shapes]
    # A body that the scene allows but does not hold has nothing to ask.
    pairs = [(key[a], key[b]) for a, b, *_ in listed if a in key and b in key]
    return bodies, sorted({(min(p), max(p)) for p in pairs})


def _with_regions_closed(bodies: list[Body]) -> list[Body]:
    """The bodies with the hull of its corners for each region."""
    if not any(isinstance(body.shape, HPolytope) and body.shape.is_region for body in bodies):
        return bodies
    boxes = [bounds(body) for body in bodies if not body.shape.is_region]
    corners_of_all = np.array([box for box in boxes if np.isfinite(box).all()]).reshape(-1, 3)
    closed = list(bodies)
    for k, body in enumerate(bodies):
        if isinstance(body.shape, HPolytope) and body.shape.is_region:
            about = np.linalg.norm(corners_of_all - body.X_WB[:3, 3], axis=1).max(initial=1.0)
            size = math.ldexp(1.0, math.frexp(4.0 * (2.0 * about + body.shape.boundary_within))[1])
            closed[k] = body._replace(shape=ConvexHull(body.shape.closed(size).vertices))
    return closed


def _tested(bodies: list[Body], allowed) -> list[tuple[int, int]]:
    skip = set(allowed)
    return [
        (i, j)
        for i, A in enumerate(bodies)
        for j, B in enumerate(bodies[i + 1 :], i + 1)
        if not (A.static and B.static) and (A.group & B.mask) and (B.group & A.mask) and (i, j) not in skip
    ]


def _near(bodies: list[Body], pairs, max_distance: float) -> list[tuple[int, int]]:
    if not pairs:
        return []
    boxes = np.array([bounds(b) for b in bodies])
    finite = boxes[np.isfinite(boxes).all(axis=(1, 2))]
    size = diagonal(finite[:, 0].min(axis=0), finite[:, 1].max(axis=0)) if len(finite) else 0.0
    reach = max(max_distance, NEARBY * size)
    i, j = np.array(pairs).T
    between = np.maximum(boxes[i, 0] - boxes[j, 1], boxes[j, 0] - boxes[i, 1]).max(axis=1)
    return [pair for pair, gap in zip(pairs, between) if gap <= reach]


# --- parts and boxes of shapes, written apart from the engine, which is under test ----------------


def convex_parts(shape: Shape, X_WB: np.ndarray) -> Iterator[tuple[Shape, np.ndarray]]:
    """The convex shapes, meshes and clouds whose union a body is, each with its pose in the world (4, 4)."""
    if isinstance(shape, Compound):
        for part, X_BP in shape.items:
            yield from convex_parts(part, X_WB @ X_BP)
    else:
        yield shape, X_WB


def is_compound_or_mesh(shape: Shape) -> bool:
    """True where the body is a union of several parts, a mesh or a cloud: how deep it overlaps no engine can say."""
    parts = [part for part, _ in convex_parts(shape, np.eye(4))]
    return len(parts) > 1 or has_mesh(shape) or shape.is_field


def has_mesh(shape: Shape) -> bool:
    """True where the body is a mesh, or has one among its parts."""
    return any(isinstance(part, Mesh) for part, _ in convex_parts(shape, np.eye(4)))


def corners(shape: Shape) -> tuple[np.ndarray, float] | None:
    """A polytope or swept polytope as points (n, 3) in its frame and a radius [m]; else None."""
    if isinstance(shape, Sphere):
        return np.zeros((1, 3)), shape.radius
    if isinstance(shape, Capsule):
        return np.array([(0, 0, -0.5), (0, 0, 0.5)]) * shape.length, shape.radius
    if isinstance(shape, Box):
        return (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * shape.size, 0.0
    if isinstance(shape, ConvexHull):
        return shape.points, shape.radius
    if isinstance(shape, HPolytope):
        return shape.vertices, 0.0
    return None


def bounds(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Axis-aligned box (low, high), (3,) each [m], of a body in the world; infinite for half-spaces."""
    boxes = np.array([_part_bounds(shape, X) for shape, X in convex_parts(body.shape, body.X_WB)])
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _part_bounds(shape: Shape, X_WP: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    R_WP, p_WP = X_WP[:3, :3], X_WP[:3, 3]
    points = (shape.vertices[np.unique(shape.faces)], 0.0) if isinstance(shape, Mesh) else corners(shape)
    if points is not None:
        world = points[0] @ R_WP.T + p_WP
        return world.min(axis=0) - points[1], world.max(axis=0) + points[1]
    if isinstance(shape, PointCloud):
        world, radii = shape.points @ R_WP.T + p_WP, shape.radii[:, None]
        return (world - radii).min(axis=0), (world + radii).max(axis=0)
    if isinstance(shape, Ellipsoid):
        half = np.linalg.norm(R_WP * shape.radii, axis=1)
    elif isinstance(shape, Cylinder | Cone):  # the cone by the cylinder around it
        half = np.linalg.norm(R_WP[:, :2], axis=1) * shape.radius + np.abs(R_WP[:, 2]) * shape.length / 2
    else:
        half = np.full(3, np.inf)
    return p_WP - half, p_WP + half


def diagonal(low: np.ndarray, high: np.ndarray) -> float:
    """Length of a box's diagonal [m]."""
    return float(np.linalg.norm(high - low)) if np.isfinite(high - low).all() else np.inf
