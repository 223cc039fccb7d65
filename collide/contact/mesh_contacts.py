"""Contacts of pairs with a mesh, as rows, at many pairs of poses."""

from __future__ import annotations

from threading import local
from typing import Any

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.base.threads import answers_in_order, pieces_of
from collide.contact.contact_rows import CONTACT_DTYPE, Rows, Slack, joined_rows
from collide.contact.convex_contacts import convex_contacts
from collide.contact.distance_contacts import with_distances
from collide.contact.facet_contact_call import (
    FACETS_HEADER,
    KERNEL,
    MANIFOLDS,
    N_ROWS,
    PAIRS_OF_SINGLE_CALLS,
    REACH_OF_BOTH,
    ROWS_OF_SINGLE_CALLS,
    contacts_single_facets,
)
from collide.contact.facet_manifolds import (
    CONTACT_HEADER,
    DONE,
    IS_LARGEST,
    LIMIT,
    MAX_CONTACTS,
    PAIRS_FULL,
    POSES_DONE,
    ROWS_DONE,
    ROWS_FULL,
    TOO_MANY,
    WORDS_AT,
    facet_manifolds,
    workspace_words,
)
from collide.contact.facet_topology import topology_of
from collide.contact.support_face import VERTEX
from collide.errors import UnsupportedQuery
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_contacts
from collide.lowering.facet_bodies import Body, body_of, hull_of, is_halfspace
from collide.lowering.parts import convex_set_of
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.facets.facet_kernel_calls import (
    pair_header,
    serves_single_calls,
    step_of,
    workspace_of_single_calls,
)
from collide.narrowphase.facets.facet_queries import Workspace, not_invertible, stack_of, workspace
from collide.narrowphase.facets.facets_within import list_near_pairs
from collide.narrowphase.facets.mesh_collide_kernel import HEADER
from collide.narrowphase.prepared_pairs import Single
from collide.shapes.shape import Shape

#: Pairs of facets there is space for to begin with, what of it is kept from call to call, and at most: a gigabyte.
_FEWEST_PAIRS, _KEPT_PAIRS, MAX_PAIRS = 1 << 12, 1 << 14, 1 << 18
#: Space that has grown is kept for so many calls, at most 75 MB; to grow it again lists the pairs of one call twice.
_CALLS_KEPT = 256
#: Rows there is space for to begin with, and so many more a pose.
_FIRST_ROWS, _ROWS_PER_POSE = 64, 8
#: Poses that are worth a thread of their own.
_FEWEST_POSES = 16


def halfspace_contacts(
    A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int, slack: Slack | None, threads: int
) -> Rows:
    """Rows of a mesh and a half-space: those of the mesh's hull, with facets of the mesh. As `facet_contacts`."""
    hull_a, hull_b = (S if is_halfspace(S) else hull_of(body_of(S)) for S in (A, B))
    rows, ends = convex_contacts(hull_a, hull_b, X_WA, X_WB, margin, max_contacts, slack=slack, threads=threads)
    for side, shape, hull in (("a", A, hull_a), ("b", B, hull_b)):
        if hull is not shape:
            row_of, facet_of = _rows_of_hull_points(shape, hull)
            feature = rows[f"feature_{side}"]
            is_vertex = (feature >= 0) & (feature % 4 == VERTEX)
            vertex = np.where(is_vertex, feature, 0) // 4
            rows[f"facet_{side}"] = np.where(is_vertex, facet_of[vertex], -1)
            rows[f"feature_{side}"] = np.where(is_vertex, 4 * row_of[vertex] + VERTEX, -1)
    return rows, ends


def _rows_of_hull_points(mesh: Shape, hull: Shape) -> tuple[np.ndarray, np.ndarray]:
    """The mesh's row of each point of its hull, and a facet there."""
    faces, vertices = mesh.faces, mesh.vertices  # type: ignore[attr-defined]
    used, first = np.unique(faces, return_index=True)
    at = {point.tobytes(): k for k, point in reversed(list(enumerate(vertices[used] + 0.0)))}
    which = np.array([at[point.tobytes()] for point in convex_set_of(hull).points + 0.0])
    return used[which], (first // 3)[which]


def facet_contacts(
    A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int, slack: Slack | None, threads: int
) -> Rows:
    """(rows, ends) of two bodies of facets: contacts pose after pose, and where the contacts of each pose end.

    X_WA, X_WB : (n, 4, 4), or (1, 4, 4) for a single pose, checked.
    slack : the margin of a pose is larger by its slack. Exchanged A and B give the same numbers. Raises
    UnsupportedQuery, InvalidPose.
    """
    n = max(len(X_WA), len(X_WB))
    pieces = pieces_of(n, threads, _FEWEST_POSES) if threads > 1 and n >= 2 * _FEWEST_POSES else [slice(0, n)]
    topology_of(body_of(A)), topology_of(body_of(B))  # made once, before threads ask for them

    def answer(piece: slice) -> Rows:
        try:
            return _of_poses(A, B, X_WA, X_WB, piece, margin, max_contacts, slack)
        finally:
            _of_thread.shrink()

    return joined_rows(answers_in_order(pieces, answer, threads))


def _of_poses(
    A: Shape, B: Shape, X_WA, X_WB, piece: slice, margin: float, max_contacts: int, slack: Slack | None
) -> Rows:
    """The same of a piece of the poses, in one thread."""
    n = piece.stop - piece.start
    X_WA, X_WB = (X if len(X) == 1 else X[piece] for X in (X_WA, X_WB))
    slack = None if slack is None else slack.take(piece)
    space, body_a, body_b = _of_thread, body_of(A), body_of(B)
    header = _header_of(body_a, body_b, workspace(stack_of(body_a.tree, body_b.tree)), space.described)
    header[MAX_CONTACTS] = min(max_contacts, 1 << 40)
    slack_at = 0 if slack is None else address_of(slack.each)
    ends, lacks = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.uint8)
    out = np.zeros(_FIRST_ROWS + _ROWS_PER_POSE * n, dtype=CONTACT_DTYPE)
    while True:
        status = facet_manifolds(
            address_of(header), address_of(X_WA), step_of(X_WA), address_of(X_WB), step_of(X_WB), n, margin,
            slack_at, address_of(out), len(out), address_of(ends), address_of(lacks),
        )
        if status == DONE:
            break
        if status == ROWS_FULL:
            out[header[ROWS_DONE] :] = np.zeros((), dtype=CONTACT_DTYPE)
            out = np.concatenate([out, np.zeros(2 * len(out), dtype=CONTACT_DTYPE)])
        elif status == PAIRS_FULL:
            space.grow()
            header[WORDS_AT : IS_LARGEST + 1] = space.described
        elif status == TOO_MANY:
            raise _too_many(margin, body_a, body_b)
        else:
            raise not_invertible(piece.start + int(header[POSES_DONE]))
    rows = out[: header[ROWS_DONE]]
    if lacks.any():
        limit = np.full(n, margin) if slack is None else margin + slack.each
        return with_distances(A, B, X_WA, X_WB, limit, rows, ends, lacks)
    return rows, ends


def _header_of(A: Body, B: Body, work: Workspace, described: tuple[int, int, bool]) -> np.ndarray:
    """What `facet_manifolds` reads, but for how many contacts a patch may have.

    work : of the traversals.   described : as `_OfThread.described`. The caller keeps bodies and workspaces alive.
    """
    exchanged = B.key < A.key
    ordered = (B, A) if exchanged else (A, B)
    header = np.zeros(CONTACT_HEADER, dtype=np.int64)
    header[:HEADER] = pair_header(*ordered, exchanged, work)
    header[HEADER:MAX_CONTACTS] = (
        *(address_of(topology_of(body).header) for body in ordered), 0, code_of(list_near_pairs), *described
    )
    header.view(np.float64)[LIMIT] = _longest_translation(*ordered)
    return header


def _longest_translation(A: Body, B: Body) -> float:
    """How far bodies may overlap for patches to describe it [m]: the smaller body's diameter."""
    smaller = min(A.reach, B.reach)
    return 2.0 * (smaller if smaller > 0.0 else max(A.reach, B.reach))


def _too_many(margin: float, A: Body, B: Body) -> UnsupportedQuery:
    reach = margin + A.radius + B.radius
    return UnsupportedQuery(
        f"contacts: more than {MAX_PAIRS} pairs of facets lie within {reach:g} m (margin and radii) of each "
        "other: ask with a smaller margin, or take coarser meshes"
    )


# --- single calls -------------------------------------------------------------------------------


def single_facet_contacts(A: Shape, B: Shape) -> tuple[Single, Any] | None:
    """(`Prepared.contacts` of two bodies of facets, what it uses besides), or ``None`` of too many parts."""
    body_a, body_b = body_of(A), body_of(B)
    if not serves_single_calls(body_a, body_b):
        return None
    work, (words, rows) = workspace_of_single_calls(body_a, body_b), _space_of_single_calls()
    header = np.zeros(FACETS_HEADER, dtype=np.int64)
    header[[KERNEL, N_ROWS]] = code_of(facet_manifolds), len(rows)
    header.view(np.float64)[REACH_OF_BOTH] = compound_parts(A).reach + compound_parts(B).reach
    header[MANIFOLDS:] = _header_of(body_a, body_b, work, (address_of(words), PAIRS_OF_SINGLE_CALLS, False))
    return prepared_contacts(contacts_single_facets, header, rows), (body_a, body_b, work, words)


@workspace_under_lock
def _space_of_single_calls() -> tuple[np.ndarray, np.ndarray]:
    """(workspace, rows), one for all: the kernels keep Python's lock."""
    return np.empty(workspace_words(PAIRS_OF_SINGLE_CALLS)), np.zeros(ROWS_OF_SINGLE_CALLS, dtype=CONTACT_DTYPE)


class _OfThread(local):
    """The workspace of a thread. Memory never touched costs nothing."""

    def __init__(self) -> None:
        self._keep(_FEWEST_PAIRS)

    def _keep(self, capacity: int) -> None:
        self._capacity, self._calls = capacity, 0
        self._words = np.empty(workspace_words(capacity))

    @property
    def described(self) -> tuple[int, int, bool]:
        """Address and capacity in pairs of the workspace, and whether no workspace is larger."""
        return address_of(self._words), min(self._capacity, MAX_PAIRS), self._capacity >= MAX_PAIRS

    def grow(self) -> None:
        self._keep(min(4 * self._capacity, MAX_PAIRS))

    def shrink(self) -> None:
        """After a call: shrink a workspace of more than _KEPT_PAIRS pairs to _KEPT_PAIRS, so the next call repeats less
        for want of space; after _CALLS_KEPT calls to the least size."""
        self._calls += 1
        if self._capacity > _KEPT_PAIRS:
            self._keep(_KEPT_PAIRS)
        elif self._capacity > _FEWEST_PAIRS and self._calls >= _CALLS_KEPT:
            self._keep(_FEWEST_PAIRS)


_of_thread = _OfThread()
