"""What a mesh is and what is wrong with it, in words and facet numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module

if TYPE_CHECKING:
    from collide.mesh.mesh_survey import Survey

topology = lazy_module("collide.mesh.mesh_topology")
flags = lazy_module("collide.mesh.mesh_survey")

#: Facet numbers shown of each defect; `Defect.facets` has them all.
_MAX_LISTED = 6


class Defect(NamedTuple):
    """A kind of defect of a mesh.

    name : the same words for every mesh.
    facets : (k,) rows of ``mesh.faces`` with the defect, sorted.
    spoils : whether the defect leaves an inside undefined; the mesh is then no solid.
    meaning : what these facets are.
    """

    name: str
    facets: np.ndarray
    spoils: bool
    meaning: str

    def __str__(self) -> str:
        return f"{self.name} ({self.meaning}): {_numbers(self.facets)}"


class MeshReport(NamedTuple):
    """What `Mesh.report` says; printed, text for a person.

    solid : whether the mesh is taken as a solid.   why : the reason, in words.
    vertices, facets : as given.   used : distinct vertices of facets.   welded : vertices
    equal to an earlier one.   edges : of the welded mesh.   shells : parts that close, or hang together, by themselves.
    euler : distinct vertices − edges + facets.   volume : enclosed [m³], cavities taken off; 0 where not closed.
    defects : everything found wrong, what spoils a solid first.
    """

    solid: bool
    why: str
    vertices: int
    facets: int
    used: int
    welded: int
    edges: int
    shells: int
    euler: int
    volume: float
    defects: tuple[Defect, ...]

    def __str__(self) -> str:
        shells = f"{self.shells} shell{'s' * (self.shells != 1)}"
        lines = [
            f"{'solid' if self.solid else 'surface'}: {self.why}",
            f"{self.facets} facets, {self.edges} edges, {self.used} distinct vertices in use of {self.vertices}",
            f"{shells}, Euler characteristic {self.euler}, volume {self.volume:.6g} m³",
        ]
        return "\n".join([*lines, *(f"- {defect}" for defect in self.defects)])


def _numbers(facets: np.ndarray) -> str:
    listed = ", ".join(str(f) for f in facets[:_MAX_LISTED].tolist())
    if len(facets) > _MAX_LISTED:
        return f"facets {listed}, … ({len(facets)} in all)"
    return f"facet{'s' * (len(facets) != 1)} {listed}"


def find_defects(survey: Survey) -> tuple[Defect, ...]:
    """The defects that a survey flags, what spoils a solid first."""
    nothing = bool(len(survey.signs)) and not (survey.signs > 0).any()
    kinds = [
        (
            topology.DOUBLED,
            not survey.closed,
            "duplicate facets",
            "the same corners as an earlier facet, the same way round",
        ),
        (topology.OPEN, True, "open edges", "an edge has no other facet"),
        (topology.UNBALANCED, True, "unbalanced edges", "three or more meet at an edge, more of them one way round"),
        (topology.TURNED, True, "inconsistent orientation", "turned over against their neighbours"),
        (topology.ONE_SIDED, True, "one-sided", "where the surface closes to a band with one side"),
        (flags.INSIDE_OUT, True, "inside out", "parts that run clockwise seen from outside, and are no cavities"),
        (flags.EMPTY, nothing, "encloses nothing", "parts without volume"),
        (topology.BACK_TO_BACK, False, "back-to-back facets", "the same corners as another facet, the other way round"),
        (topology.SEVERAL, False, "non-manifold edges", "four or more meet at an edge"),
        (topology.PINCHED, False, "non-manifold vertices", "touching others in a vertex only"),
        (flags.NO_AREA, False, "no area", "corners on one line"),
    ]
    defects = [
        Defect(name, np.flatnonzero(survey.flags & bit), spoils, meaning)
        for bit, spoils, name, meaning in kinds
        if (survey.flags & bit).any()
    ]
    return tuple(sorted(defects, key=lambda defect: not defect.spoils))


def make_report(vertices: int, solid: bool, survey: Survey) -> MeshReport:
    """The report on a mesh of so many vertices, taken as a solid or not."""
    defects = find_defects(survey)
    spoilt = [defect for defect in defects if defect.spoils]
    if solid:
        why = "every edge is run along as often one way as the other"
    elif spoilt or not survey.edges:
        why = "; ".join(defect.name for defect in spoilt) or "no facet has three distinct corners"
    else:
        why = "asked for; it could be a solid"
    return MeshReport(
        solid, why, vertices, len(survey.flags), survey.used, survey.welded, survey.edges, survey.n_shells,
        survey.euler, float(survey.volumes.sum()), defects,
    )
