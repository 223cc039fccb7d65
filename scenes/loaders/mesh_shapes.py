"""The meshes of a file as shapes: as they are, as hulls, or as unions of convex pieces.

As they are is the rule: a mesh becomes a `collide.Mesh`, solid where it closes. One whose facets are exactly the
surface of its own hull becomes that `ConvexHull`: the same set, with quicker answers and proven depths. Points
without facets are their hull. Only hulls and pieces leave something out, and say what.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.errors import InvalidShape, SceneError
from collide.mesh.convex_surface import is_own_hull
from collide.scenes.loaders.hull_levels import HullLevel, hull_of_level, split_level
from collide.scenes.loaders.mesh_file import AS_THEY_ARE, CONVEX_RATIO, REPAIRED
from collide.scenes.loaders.mesh_parts import NOT_REPAIRED, MeshFile, MeshPart, described, distinct
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape


class Taken(NamedTuple):
    """What a mesh became.   approximation : what the shape leaves out of the mesh; None: nothing."""

    shape: Shape
    approximation: str | None


def part_shape(part: MeshPart, scale, place: str) -> Taken:
    """One part of a file as a shape.

    scale : (3,) factors; negative ones mirror, and the facets of a mesh are then turned over.   place : for messages.
    Raises InvalidShape for sizes out of range.
    """
    factors = np.broadcast_to(np.asarray(scale, dtype=np.float64), (3,))
    try:
        if part.pieces is not None and not _is_convex(part):
            return Taken(_union([ConvexHull(_times(points, factors)) for points in part.pieces]), _about_pieces(part))
        if part.facets is not None:
            return Taken(_as_it_is(part, factors), _about_repairs(part))
        return _hull(_times(part.points, factors), part.level, _about_hull(part))
    except InvalidShape as error:
        raise InvalidShape(f"{place}: {error}") from None


def extent(file: MeshFile, scale) -> float:
    """The longest side of the box around all meshes of a file, times their scale."""
    points = _times(np.concatenate([part.points for part in file.parts]), scale)
    with np.errstate(invalid="ignore"):
        return float(np.ptp(points, axis=0).max())


def _times(points: np.ndarray, factors) -> np.ndarray:
    """Points scaled; what becomes infinite is refused by the shape made of them."""
    with np.errstate(over="ignore"):
        return points * factors


def element_shapes(file: MeshFile, scale, place: str) -> list[Taken]:
    """The shapes of a file that stands for one thing, such as a link: together they are that thing.

    Meshes as they are: where the facets of all parts together close, they are one solid; else those parts that
    close are one, and the open ones one surface. Hulls: closed meshes stay apart, since the union of their hulls
    is nearer to them than one hull; open ones may be patches of one surface, and become one point set.
    """
    parts = file.parts
    if len(parts) == 1 or parts[0].pieces is not None:
        return [part_shape(part, scale, place) for part in parts]
    if all(part.facets is None for part in parts):
        together = parts if all(part.closed for part in parts) else [_joined_points(parts)]
        return [part_shape(part, scale, place) for part in together]
    clouds = [part for part in parts if part.facets is None]
    meshes = [part for part in parts if part.facets is not None]
    if all(part.own_hull for part in meshes):
        return [part_shape(part, scale, place) for part in parts]
    whole = _joined(meshes)
    groups = [whole] if whole.closed else [
        _joined(group) for closed in (True, False) if (group := [part for part in meshes if part.closed is closed])
    ]
    return [part_shape(part, scale, place) for part in (*groups, *clouds)]


def inline_shape(vertices: np.ndarray, faces: np.ndarray, meshes: str, place: str) -> Taken:
    """A mesh that a scene file holds itself: (n, 3) vertices, and (m, 3) facets, of which there may be none.

    meshes : "mesh", "repaired", or anything else for the hull of the vertices. Raises SceneError for ids out of range.
    """
    if meshes in AS_THEY_ARE and len(faces):
        if (outside := ((faces < 0) | (faces >= len(vertices))).any(axis=1)).any():
            row = int(np.argmax(outside))
            raise SceneError(
                f"triangle {row} names vertices {faces[row].tolist()}, but there are {len(vertices)}", element=place
            )
        return part_shape(described("mesh", vertices, faces, repair=meshes == REPAIRED), 1.0, place)
    hull = ConvexHull(vertices).without_repeats()
    about = f"hull of {len(hull.points)} vertices of a mesh in the file"
    return _hull(hull.points, split_level(meshes)[1], about)


def _hull(points: np.ndarray, level: HullLevel | None, about: str | None) -> Taken:
    if level is None:
        return Taken(ConvexHull(points), about)
    hull, difference = hull_of_level(points, level)
    return Taken(hull, "; ".join(filter(None, (about, difference))) or None)


def _as_it_is(part: MeshPart, factors: np.ndarray) -> Shape:
    key = tuple(factors.tolist())
    if key not in part.made:
        part.made[key] = _scaled(part, factors)
    return part.made[key]


def _scaled(part: MeshPart, factors: np.ndarray) -> Shape:
    """What is known of the mesh at its own size stays known where nothing is rounded, or its tree can be shared."""
    facets = part.facets
    assert facets is not None
    mesh = Mesh._known(part.points, facets, part.closed).scaled(factors)
    exact = (np.abs(np.frexp(factors)[0]) == 0.5).all()
    convex = part.own_hull if exact else mesh.solid and is_own_hull(mesh.vertices, mesh.faces)
    return ConvexHull(mesh.vertices) if convex else mesh


def _joined(parts: list[MeshPart]) -> MeshPart:
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    faces = np.concatenate([part.facets + start for part, start in zip(parts, starts.tolist())])  # type: ignore[operator]
    repair = any(part.repairs is not None for part in parts)
    joined = described(parts[0].name, np.concatenate([part.points for part in parts]), faces, repair)
    if repair:
        joined.repairs = [line for part in parts for line in _of_part(part)] + (joined.repairs or [])
    return joined


def _joined_points(parts: list[MeshPart]) -> MeshPart:
    points = distinct(np.concatenate([part.points for part in parts]))
    faces = sum(part.faces for part in parts)
    return MeshPart(parts[0].name, points, np.nan, False, faces, level=parts[0].level)


def _union(hulls: list[ConvexHull]) -> Shape:
    return hulls[0] if len(hulls) == 1 else Compound([(hull, np.eye(4)) for hull in hulls])


# --- what a shape leaves out ----------------------------------------------------------------------


def _about_repairs(part: MeshPart) -> str | None:
    """The steps; of a mesh that stays as it is, why."""
    steps = part.repairs or []
    changed = any(not line.startswith(NOT_REPAIRED) for line in steps)
    return f"{'repaired: ' if changed else ''}{'; '.join(steps)}" if steps else None


def _of_part(part: MeshPart) -> list[str]:
    """What was repaired of a part of several, by its name; what stays broken the whole has to say."""
    return [f"{part.name}: {line}" for line in part.repairs or () if not line.startswith(NOT_REPAIRED)]


def _about_hull(part: MeshPart) -> str | None:
    hull = f"hull of {len(part.points)} vertices"
    if not part.faces:
        return f"{hull} without faces"
    if not part.closed:
        return f"{hull} of an open mesh"
    if np.isnan(part.fill):
        return f"{hull} of a closed mesh"
    if _is_convex(part):
        return None
    extra = (1.0 / part.fill - 1.0) * 100.0
    amount = f"{extra:.0f}" if extra >= 10 else f"{extra:.2g}"
    return f"{hull}, fills {amount} % more volume"


def _is_convex(part: MeshPart) -> bool:
    """Whether the mesh has its hull's volume: then that hull is nearer to it than a decomposition, which resamples."""
    return part.closed and part.fill >= CONVEX_RATIO


def _about_pieces(part: MeshPart) -> str:
    pieces = part.pieces or []
    return (
        f"{len(pieces)} convex {'piece' if len(pieces) == 1 else 'pieces'} of a mesh of {len(part.points)} "
        "vertices (coacd)"
    )
