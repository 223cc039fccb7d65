"""Contacts of pairs with a mesh, as rows."""

from __future__ import annotations

import numpy as np

from collide.contact.contact_facets import Posed, posed
from collide.contact.contact_patches import Patch, patches_of
from collide.contact.contact_points import across
from collide.contact.contact_rows import GAP, OVERLAP, WAY_OUT, Finished, no_rows, rows_of, turned_round
from collide.contact.convex_contacts import against_plane
from collide.contact.reduce_manifold import chosen
from collide.contact.shallow_overlaps import CLEAR
from collide.lowering.facet_bodies import Body, body_of, has_facets, is_halfspace
from collide.narrowphase.facets.mesh_rows import mesh_rows
from collide.shapes.shape import Shape

#: Points nearer than so many errors of a coordinate, or this share of the patch, are one point.
_ERRORS, _SHARE = 64.0, 2.0**-30


def surface_contacts(A: Shape, B: Shape, X_WA, X_WB, margin: float, most: int) -> np.ndarray:
    """Rows for single poses (4, 4). Raises UnsupportedQuery, naming the shape."""
    if is_halfspace(A):
        return against_plane(A, B, X_WA, X_WB, margin, most)
    if is_halfspace(B):
        return turned_round(against_plane(B, A, X_WB, X_WA, margin, most))
    if not (has_facets(A) and has_facets(B)):
        return _witness(A, B, X_WA, X_WB, margin)
    one, other = body_of(A), body_of(B)
    later = other.key < one.key or (one.key == other.key and X_WA[:3].tolist() > X_WB[:3].tolist())
    if later:
        return turned_round(_ordered(other, one, B, A, X_WB, X_WA, margin, most))
    return _ordered(one, other, A, B, X_WA, X_WB, margin, most)


def _witness(A: Shape, B: Shape, X_WA, X_WB, margin: float) -> np.ndarray:
    """Where a curved body is nearest to a mesh, or a way out of it: what `distance` says, and no more."""
    row = mesh_rows(A, B, X_WA[None], X_WB[None], limit=margin)[0]
    if row["beyond"] or row["lower"] > margin:
        return no_rows()
    found = rows_of([_told(A, B, row)])
    found["lower"], found["upper"] = row["lower"], row["upper"]
    return found


def _ordered(one: Body, other: Body, A: Shape, B: Shape, X_WA, X_WB, margin: float, most: int) -> np.ndarray:
    here = posed(one, other, X_WA, X_WB)
    rounding = 0.0 if margin + one.radius + other.radius == 0.0 else CLEAR * here.error
    patches, deep = patches_of(here, margin + rounding)
    if not patches:
        return _witness(A, B, X_WA, X_WB, margin) if deep else no_rows()
    made = [finished(here, patch, margin, most) for patch in patches]
    if deep:
        made.append(_way_out(A, B, X_WA, X_WB))
    rows = rows_of([patch for patch in made if len(patch.distance)])
    last = rows["kind"] == WAY_OUT
    rows["upper"][last] = 0.0  # how much shorter another way might be is not known
    return rows


def finished(here: Posed, patch: Patch, margin: float, most: int) -> Finished:
    """A few of the patch's points, radii added, in the world."""
    n, points = patch.normal, patch.points
    radius = here.A.radius + here.B.radius
    points = points.take((points.gap - radius <= margin + points.error) | (points.gap == points.gap.min(initial=np.inf)))
    flat = (across(n)[None] * points.b[:, None]).sum(axis=2)
    size = float((flat.max(axis=0) - flat.min(axis=0)).max())
    tolerance = max(_ERRORS * here.error, _SHARE * size)
    kept = points.take(chosen(flat, points.gap, points.error, most, tolerance))
    distance = kept.gap - radius
    facets = patch.facets[np.searchsorted(patch.points.pair, kept.pair)] if len(patch.facets) == 1 else _facets(patch, kept)
    kind = OVERLAP if patch.meets else GAP
    error = kept.error + 8.0 * here.error * (radius > 0.0)
    if patch.meets:  # what touches is no gap, though it may come out as one
        distance = np.where((distance > 0.0) & (distance <= error), 0.0, distance)
    middle = 0.5 * (kept.a + kept.b) + 0.5 * (here.A.radius - here.B.radius) * n + here.X_WA[:3, 3]
    half = 0.5 * distance[:, None] * n
    return Finished(n, middle - half, middle + half, distance, error, facets, kind, patch.apart)


def _facets(patch: Patch, kept) -> np.ndarray:
    by_pair = dict(zip(patch.points.pair.tolist(), patch.facets.tolist()))
    return np.array([by_pair[k] for k in kept.pair.tolist()]).reshape(-1, 2)


def _way_out(A: Shape, B: Shape, X_WA, X_WB) -> Finished:
    return _told(A, B, mesh_rows(A, B, X_WA[None], X_WB[None], limit=np.inf)[0])


def _told(A: Shape, B: Shape, row) -> Finished:
    """One contact from a row of `distance`."""
    kind = WAY_OUT if row["hit"] else GAP
    facets = np.array([[row[part] if has_facets(shape) else -1 for part, shape in (("part_a", A), ("part_b", B))]])
    distance = np.array([row["distance"]])
    apart = -float(row["lower"]) if kind == WAY_OUT else 0.0
    return Finished(
        row["normal"], row["point_a"][None], row["point_b"][None], distance, distance - row["lower"], facets, kind, apart
    )
