"""Contacts of pairs with a mesh, as rows."""

from __future__ import annotations

import numpy as np

from collide.contact.contact_facets import ContactFrame, contact_frame
from collide.contact.contact_patches import Patch, patches_of
from collide.contact.contact_points import across
from collide.contact.contact_rows import GAP, OVERLAP, TRANSLATION, PatchContacts, flipped_contacts, no_rows, rows_of
from collide.contact.convex_contacts import convex_contacts
from collide.contact.reduce_manifold import reduce_manifold
from collide.contact.shallow_overlaps import STEP_ERRORS
from collide.contact.support_face import VERTEX
from collide.lowering.facet_bodies import Body, body_of, has_facets, hull_of, is_halfspace
from collide.lowering.parts import convex_set_of
from collide.narrowphase.facets.mesh_methods import mesh_rows
from collide.shapes.shape import Shape

#: Points nearer than so many errors of a coordinate, or this part of the patch's size, are one point.
_ERRORS, _SHARE = 64.0, 2.0**-30


def halfspace_contacts(A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray:
    """Rows of a mesh and a half-space at single poses (4, 4): those of the mesh's hull, with facets of the mesh."""
    hull_a, hull_b = (S if is_halfspace(S) else hull_of(body_of(S)) for S in (A, B))
    rows, _ = convex_contacts(hull_a, hull_b, X_WA[None], X_WB[None], margin, max_contacts)
    for side, shape, hull in (("a", A, hull_a), ("b", B, hull_b)):
        if hull is not shape:
            facet_of = _facet_of_hull_points(shape, hull)
            vertex = rows[f"feature_{side}"]
            rows[f"facet_{side}"] = np.where(vertex % 4 == VERTEX, facet_of[np.maximum(vertex, 0) // 4], -1)
    return rows


def _facet_of_hull_points(mesh: Shape, hull: Shape) -> np.ndarray:
    """A facet of the mesh at each point of its hull."""
    faces, vertices = mesh.faces, mesh.vertices  # type: ignore[attr-defined]
    used, first = np.unique(faces, return_index=True)
    facet_at = {point.tobytes(): facet for point, facet in zip(vertices[used] + 0.0, (first // 3).tolist())}
    return np.array([facet_at[point.tobytes()] for point in convex_set_of(hull).points + 0.0])


def facet_contacts(A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int) -> np.ndarray:
    """Rows of two bodies of facets at single poses (4, 4), on the same numbers when A and B are exchanged."""
    body_a, body_b = body_of(A), body_of(B)
    exchanged = body_b.key < body_a.key or (body_a.key == body_b.key and X_WA[:3].tolist() > X_WB[:3].tolist())
    if exchanged:
        return flipped_contacts(_ordered(body_b, body_a, B, A, X_WB, X_WA, margin, max_contacts))
    return _ordered(body_a, body_b, A, B, X_WA, X_WB, margin, max_contacts)


def curved_contacts(A: Shape, B: Shape, X_WA, X_WB, margin: float, _max_contacts: int) -> np.ndarray:
    """One row for a mesh and a shape without exact facets: the answer of `distance`; none beyond the margin."""
    row = mesh_rows(A, B, X_WA[None], X_WB[None], limit=margin)[0]
    if row["beyond"] or row["lower"] > margin:
        return no_rows()
    rows = rows_of([_as_contact(A, B, row)])
    rows["lower"], rows["upper"] = row["lower"], row["upper"]
    return rows


def _ordered(
    body_a: Body, body_b: Body, A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int
) -> np.ndarray:
    frame = contact_frame(body_a, body_b, X_WA, X_WB)
    rounding = 0.0 if margin + body_a.radius + body_b.radius == 0.0 else STEP_ERRORS * frame.error
    patches, deep = patches_of(frame, margin + rounding)
    if not patches:
        return curved_contacts(A, B, X_WA, X_WB, margin, max_contacts) if deep else no_rows()
    of_patches = [patch_contacts(frame, patch, margin, max_contacts) for patch in patches]
    if deep:
        of_patches.append(_of_distance(A, B, X_WA, X_WB))
    rows = rows_of([patch for patch in of_patches if len(patch.distance)])
    last = rows["kind"] == TRANSLATION
    rows["upper"][last] = 0.0  # how much shorter another translation might be is not known
    return rows


def patch_contacts(frame: ContactFrame, patch: Patch, margin: float, max_contacts: int) -> PatchContacts:
    """At most ``max_contacts`` of the patch's points, radii added, in the world."""
    n, points = patch.normal, patch.points
    radius = frame.A.radius + frame.B.radius
    is_nearest = points.gap == points.gap.min(initial=np.inf)
    points = points.take((points.gap - radius <= margin + points.error) | is_nearest)
    flat = (across(n)[None] * points.b[:, None]).sum(axis=2)
    size = float((flat.max(axis=0) - flat.min(axis=0)).max())
    tolerance = max(_ERRORS * frame.error, _SHARE * size)
    selected = points.take(reduce_manifold(flat, points.gap, points.error, max_contacts, tolerance))
    distance = selected.gap - radius
    if len(patch.facets) == 1:
        facets = patch.facets[np.searchsorted(patch.points.pair, selected.pair)]
    else:
        facets = _facets(patch, selected)
    kind = OVERLAP if patch.meets else GAP
    error = selected.error + 8.0 * frame.error * (radius > 0.0)
    if patch.meets:  # what touches is no gap, though it may come out as one
        distance = np.where((distance > 0.0) & (distance <= error), 0.0, distance)
    middle = 0.5 * (selected.a + selected.b) + 0.5 * (frame.A.radius - frame.B.radius) * n + frame.X_WA[:3, 3]
    half = 0.5 * distance[:, None] * n
    return PatchContacts(n, middle - half, middle + half, distance, error, facets, kind, patch.apart)


def _facets(patch: Patch, selected) -> np.ndarray:
    by_pair = dict(zip(patch.points.pair.tolist(), patch.facets.tolist()))
    return np.array([by_pair[k] for k in selected.pair.tolist()]).reshape(-1, 2)


def _of_distance(A: Shape, B: Shape, X_WA, X_WB) -> PatchContacts:
    return _as_contact(A, B, mesh_rows(A, B, X_WA[None], X_WB[None], limit=np.inf)[0])


def _as_contact(A: Shape, B: Shape, row) -> PatchContacts:
    """One contact from a row of `distance`."""
    kind = TRANSLATION if row["hit"] else GAP
    facets = np.array([[row[part] if has_facets(shape) else -1 for part, shape in (("part_a", A), ("part_b", B))]])
    distance = np.array([row["distance"]])
    apart = -float(row["lower"]) if kind == TRANSLATION else 0.0
    point_a, point_b = row["point_a"][None], row["point_b"][None]
    return PatchContacts(row["normal"], point_a, point_b, distance, distance - row["lower"], facets, kind, apart)
