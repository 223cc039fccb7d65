"""The block of contacts: contacts of colliding or touching bodies, as patches of points with a common normal each.

Patches are worked out for the picture, after the tests. They cost more than a distance, above all between large meshes
with deep overlap, so a page holds patches of the worst pairs only, and says of how many. The same holds for
``overlap``, the overlap volume of two solids with facets, null for other bodies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from collide.contact.contact_query import contacts
from collide.errors import UnsupportedQuery
from collide.pages.drawn_points import as_base64
from collide.reports import classes
from collide.reports.mesh_notes import meshes_of
from collide.reports.overlap_volumes import common_solid, of_bodies
from collide.reports.pair_classes import Pair
from collide.reports.state_reports import Stated

#: Pairs whose patches a page holds, of all its states.
MAX_PAIRS = 100
#: Facets of the meshes of these pairs, each pair with its own. Two spheres of 98,000 facets each that overlapped by a
#: tenth took 9 s, by half 0.2 s.
_MAX_FACETS = 60_000
#: Triangles of what two bodies have in common: more are not drawn.
_MAX_TRIANGLES = 4_000
#: Points of one patch.
_MAX_POINTS = 8


def of_states(made: Sequence[Stated], max_pairs: int = MAX_PAIRS) -> tuple[list[dict], dict | None]:
    """The block, and its coverage (``drawing.contacts``); ``None`` without a hit.

    made : the reports, a report a state; of a trajectory the start. Collisions first, the deepest first of each state.
    max_pairs : the most pairs to work out.
    """
    entries: list[dict] = []
    of_all = left_out = unanswered = 0
    remaining = _MAX_FACETS
    for k, name, pair in _meeting(made):
        of_all += 1
        bodies = [made[k].scene.body(side) for side in (pair.a, pair.b)] if of_all <= max_pairs else []
        facets = sum(len(mesh.faces) for body in bodies for mesh in meshes_of(body.shape))
        if not bodies or facets > remaining:
            left_out += 1
            continue
        remaining -= facets
        patches = _patches(*bodies)
        unanswered += not patches
        if patches:
            state = {"state": k} if len(made) > 1 else {}
            overlap = _overlap(*bodies)
            entries.append({"a": pair.a, "b": pair.b, **state, "class": name, "patches": patches, "overlap": overlap})
    if not of_all:
        return [], None
    return entries, {"pairs": len(entries), "of": of_all, "note": _about(len(entries), of_all, left_out, unanswered)}


def _meeting(made: Sequence[Stated]) -> Iterator[tuple[int, str, Pair]]:
    """(state, class, pair) of all that meets: collisions of all states before what only touches."""
    for name in (classes.COLLIDING, classes.SHALLOW, classes.TOUCHING):
        for k, state in enumerate(made):
            yield from ((k, name, pair) for pair in getattr(state.report, name))


def _patches(A, B) -> list[dict]:
    """Patches of two bodies, in the world; an empty list for bodies without contacts in the library."""
    margin = float(classes.roundings(*classes.body_sizes([A, B])))
    try:
        manifold = contacts(A.shape, B.shape, A.X_WB, B.X_WB, margin=margin, max_contacts=_MAX_POINTS)
    except UnsupportedQuery:
        return []
    patches = []
    for number in np.unique(manifold.rows["patch"]).tolist():
        some = np.flatnonzero(manifold.rows["patch"] == number)
        points, depths = manifold.point[some], -manifold.rows["distance"][some]
        if np.isfinite(points).all() and np.isfinite(depths).all():
            patches.append({
                "points": points.tolist(), "normal": (manifold.rows["normal"][some[0]] + 0.0).tolist(),
                "depths": (depths + 0.0).tolist(),
            })
    return patches


def _overlap(A, B) -> dict | None:
    """What two bodies have in common: the volume [m³], and its triangles where there are few.

    ``triangles`` are corners (3k, 3) in single precision about ``origin`` in W [m].
    """
    overlap = of_bodies(A, B)
    if overlap is None:
        return None
    known = {"volume": overlap["volume"], "certified": True}
    common = common_solid(A, B) if overlap["volume"] else None
    if common is None or len(common.faces) > _MAX_TRIANGLES:
        return known
    origin = common.vertices.mean(axis=0)
    corners = (common.vertices - origin)[common.faces.ravel()]
    return {**known, "origin": origin.tolist(), "triangles": as_base64(corners.astype("<f4"))}


def _about(n: int, of_all: int, left_out: int, unanswered: int) -> str:
    notes = [f"contacts of {n} of {of_all} pairs that collide or touch"]
    notes += [f"{left_out} left out for the time they would take"] if left_out else []
    notes += [f"{unanswered} for which there are none"] if unanswered else []
    return "; ".join(notes) + "; volumes of what solids with facets have in common"
