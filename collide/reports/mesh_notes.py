"""Meshes in a report: which bodies are triangles as they are, whether they have an inside, and why not."""

from __future__ import annotations

from collections.abc import Iterator

#: Names of facets' defects shown of each mesh; ``mesh.report`` has them all.
_MAX_LISTED = 3


def meshes_of(shape) -> Iterator:
    """Every `collide.Mesh` that a shape consists of, in order."""
    for item, _ in getattr(shape, "items", ()):
        yield from meshes_of(item)
    if getattr(shape, "meshed", False) and hasattr(shape, "faces"):
        yield shape


def is_meshed(shape) -> bool:
    """Whether a shape is a mesh, or has one among its parts."""
    return next(meshes_of(shape), None) is not None


def of_scene(scene) -> list[dict]:
    """A row for every mesh of every body, in the order of the bodies: plain data for `Report.meshes`."""
    return [
        {
            "body": body.name, "solid": mesh.solid, "facets": len(mesh.faces), "what": describe(mesh),
            "source": body.source,
        }
        for body in scene.bodies
        for mesh in meshes_of(body.shape)
    ]


def describe(mesh) -> str:
    """What a mesh was taken as, in a line: ``solid of 200 facets``; for a surface also what spoils it, with facets."""
    facets = f"{len(mesh.faces)} facet{'s' * (len(mesh.faces) != 1)}"
    if mesh.solid:
        return f"solid of {facets}"
    spoilt = [defect for defect in mesh.report.defects if defect.spoils]
    why = "; ".join(f"{defect.name}: {_brief(defect.facets)}" for defect in spoilt[:_MAX_LISTED])
    more = f"; {len(spoilt) - _MAX_LISTED} more" if len(spoilt) > _MAX_LISTED else ""
    return f"surface of {facets} without an inside ({why or mesh.report.why}{more})"


def _brief(facets) -> str:
    listed = ", ".join(map(str, facets[:_MAX_LISTED].tolist()))
    more = f", … {len(facets)} in all" if len(facets) > _MAX_LISTED else ""
    return f"facet{'s' * (len(facets) != 1)} {listed}{more}"
