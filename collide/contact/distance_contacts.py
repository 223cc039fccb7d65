"""Contacts where no patch tells: the answer of `distance`, as a row."""

from __future__ import annotations

import numpy as np

from collide.contact.contact_rows import CONTACT_DTYPE, GAP, TRANSLATION
from collide.lowering.facet_bodies import has_facets
from collide.narrowphase.facets.mesh_pairs import mesh_rows
from collide.shapes.shape import Shape


def with_distances(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: np.ndarray, rows: np.ndarray, ends: np.ndarray,
    lacks: np.ndarray, *, reach: float = np.inf,
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) with rows of `distance` behind the contacts of poses marked in ``lacks``.

    limit : (n,) largest distance of a row added to a pose without contacts [m].   reach : largest distance searched
        [m].
    """
    poses = np.flatnonzero(lacks)
    XA, XB = (X if len(X) == 1 else np.ascontiguousarray(X[poses]) for X in (X_WA, X_WB))
    counts = np.diff(ends, prepend=0)
    has_patches = counts[poses] > 0
    answers = mesh_rows(A, B, XA, XB, limit=reach)
    appended = np.zeros(len(poses), dtype=CONTACT_DTYPE)
    _write_distances(A, B, answers, appended)
    keep = has_patches | (~answers["beyond"] & (answers["lower"] <= limit[poses]))
    last = np.maximum(ends[poses] - 1, 0)
    if len(rows):
        appended["patch"] = np.where(has_patches, rows["patch"][last] + 1, 0)
    appended["upper"][has_patches & answers["hit"]] = 0.0  # how much shorter another translation might be: not known
    behind, appended = ends[poses][keep], appended[keep]
    counts[poses[keep]] += 1
    return np.insert(rows, behind, appended), np.cumsum(counts)


def _write_distances(A: Shape, B: Shape, answers: np.ndarray, rows: np.ndarray) -> None:
    """Make contacts, zeroed before, of rows of `distance`."""
    hit = answers["hit"]
    for name in ("normal", "point_a", "point_b", "distance", "lower", "upper"):
        rows[name] = answers[name]
    for part, name, shape in (("part_a", "facet_a", A), ("part_b", "facet_b", B)):
        rows[name] = answers[part] if has_facets(shape) else -1
    rows["apart"] = np.where(hit, -answers["lower"], 0.0)
    rows["kind"] = np.where(hit, TRANSLATION, GAP)
    rows["feature_a"] = rows["feature_b"] = -1
    rows["b"] = 1
