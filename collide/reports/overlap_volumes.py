"""How much colliding bodies have in common: volumes of solids, worked out after the tests."""

from __future__ import annotations

from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lowering.facet_bodies import has_facets
from collide.reports.mesh_notes import meshes_of
from collide.reports.pair_classes import Pairs
from collide.shapes.mesh import Mesh
from collide.solids.boolean import boolean
from collide.solids.overlap_volume import overlap_volume

#: Pairs looked at, and facets of their meshes, each pair with its own: a second, and a fraction of one.
MAX_PAIRS = 100
MAX_FACETS = 300_000
_NUMBERS = ("volume", "lower", "upper", "area_a", "area_b", "patch_area", "flush_area")


def of_pairs(scene, *groups: Pairs) -> list[dict]:
    """Overlap volumes of pairs as plain data, in the order of the scene's pairs.

    Left out are bodies other than solids with facets (curved shapes, surfaces, unions, clouds), and pairs beyond the
    limits.
    """
    entries: list[dict] = []
    remaining = MAX_FACETS
    bodies = {body.name: body for body in scene.bodies if _is_polyhedral(body.shape)}
    for pair in [pair for pairs in groups for pair in pairs.among(bodies)[:MAX_PAIRS]][:MAX_PAIRS]:
        A, B = bodies[pair.a], bodies[pair.b]
        remaining -= sum(len(mesh.faces) for body in (A, B) for mesh in meshes_of(body.shape))
        if remaining < 0:
            break
        overlap = of_bodies(A, B)
        if overlap is not None:
            entries.append({"a": pair.a, "b": pair.b, **overlap})
    return entries


def _is_polyhedral(shape) -> bool:
    return has_facets(shape) and not getattr(shape, "radius", 0.0)


def of_bodies(A, B) -> dict | None:
    """What two bodies of a scene have in common, as plain data; None where they are no solids with facets."""
    try:
        overlap = overlap_volume(A.shape, B.shape, A.X_WB, B.X_WB)
    except (InvalidArgument, UnsupportedQuery):
        return None
    return {"centroid": (overlap.centroid + 0.0).tolist(), **{name: getattr(overlap, name) for name in _NUMBERS}}


def common_solid(A, B) -> Mesh | None:
    """The intersection of two solids with facets as a mesh in W; None without interior points."""
    return boolean(A.shape, B.shape, A.X_WB, B.X_WB, "intersection").mesh
