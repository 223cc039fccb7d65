"""Contacts of a mesh and a curved convex set (a cylinder, cone, ellipsoid, polytope of rounded corners) from Python.

Facets near the set are found for all poses together, and answered singly by the convex engine, of many within the set
some (`swallowed_facets.py`); a kernel makes patches of each pose's facets (`curved_manifolds.py`). How far the set has
to be moved along a patch's normal is proven by slabs in the kernel, and tried here by asking the facets again.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.base.threads import answers_in_order, pieces_of
from collide.contact.contact_rows import CONTACT_DTYPE, OVERLAP, Rows, Slack, joined_rows, no_rows
from collide.contact.curved_contact_call import (
    AS_GOOD,
    CURVED_HEADER,
    FACETS_OF_SINGLE_CALLS,
    MANIFOLDS,
    REACH_OF_BOTH,
    ROWS_OF_SINGLE_CALLS,
    STARTS,
    contacts_single_curved,
)
from collide.contact.curved_manifolds import (
    HEADER,
    POSE_A,
    ROWS_DONE,
    curved_manifolds,
    workspace_words,
)
from collide.contact.curved_patches import LAST_BIT
from collide.contact.distance_contacts import with_distances
from collide.contact.facet_topology import topology_of
from collide.contact.support_face import ROUND
from collide.contact.swallowed_facets import facets_asked, meshes_within
from collide.errors import UnsupportedQuery
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_contacts
from collide.lowering.enclosures import Enclosure, enclosure_of
from collide.lowering.facet_bodies import Body, PosesWithSlop, as_given, body_of, reach_of
from collide.lowering.hull_faces import face_table_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.shape_table import ShapeTable
from collide.mesh.bvh import REACH, MeshTree
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.convex_kernel_calls import space_of_single_calls
from collide.narrowphase.facets.facet_kernel_calls import step_of
from collide.narrowphase.facets.facets_against_curved import facet_rows
from collide.narrowphase.facets.item_questions import EXCHANGED
from collide.narrowphase.facets.near_facets import near_facets
from collide.narrowphase.facets.nearest_item_calls import GapQuestion, facets_of, serves, surface_states
from collide.narrowphase.prepared_pairs import Single
from collide.results import PAIR_DTYPE
from collide.shapes.shape import Shape

#: Facets near a set that are looked at, in all poses of a piece and at most at one; poses of a piece.
_FACETS_OF_PIECE, MAX_FACETS, _POSES_OF_PIECE = 1 << 16, 1 << 18, 256
#: Rows there is space for to begin with, and so many more a pose.
_FIRST_ROWS, _ROWS_PER_POSE = 64, 8
#: Facets are looked at that are farther than a limit by this part of the size: their rows tell what is near.
_LEEWAY = 2.0**-36
#: Lengths tried where slabs prove one longer than the depth, in depths.
_LENGTHS = (1.0 + 2.0**-20, 1.0 + 2.0**-7, 1.25, 2.0, 4.0)
#: Facets asked first whether a set moved clears them.
_FIRST_ASKED = 64


class _Near(NamedTuple):
    """Facets near the set at n poses: meeting facets, the deepest first, then the others, the nearest first.

    facets, places : (k,) numbers in the mesh and in its tree.   rows : (k,) PAIR_DTYPE.   starts : (n + 1,).
    patches : (k,) bits of each facet's patches, once made.
    """

    facets: np.ndarray
    places: np.ndarray
    rows: np.ndarray
    starts: np.ndarray
    patches: np.ndarray


def curved_contacts(
    A: Shape, B: Shape, X_WA, X_WB, margin: float, max_contacts: int, slack: Slack | None, threads: int
) -> Rows:
    """(rows, ends) of a mesh and a curved convex set; as `mesh_contacts.facet_contacts`."""
    exchanged = kind_of(A) is not Kind.MESH
    if exchanged:
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    n = max(len(X_WA), len(X_WB))
    size = max(1, min(_POSES_OF_PIECE, -(-n // max(threads, 1))))
    pieces = pieces_of(n, -(-n // size), 1)
    topology_of(body_of(A)), enclosure_of(B)  # made once, before threads ask for them

    def answer(piece: slice) -> Rows:
        XA, XB = (X if len(X) == 1 else X[piece] for X in (X_WA, X_WB))
        some = None if slack is None else slack.take(piece)
        return _of_poses(A, B, XA, XB, piece.stop - piece.start, margin, max_contacts, some)

    rows, ends = joined_rows(answers_in_order(pieces, answer, threads))
    return exchanged_rows(rows) if exchanged else rows, ends


def exchanged_rows(rows: np.ndarray) -> np.ndarray:
    """The same contacts with A and B exchanged."""
    out = rows.copy()
    for field in ("point", "facet", "feature"):
        out[f"{field}_a"], out[f"{field}_b"] = rows[f"{field}_b"], rows[f"{field}_a"]
    out["normal"] = 0.0 - rows["normal"]
    return out


def _of_poses(
    A: Shape, B: Shape, X_WA, X_WB, n: int, margin: float, max_contacts: int, slack: Slack | None
) -> Rows:
    """The same of a piece of the poses, the mesh being A."""
    body, enclosure = body_of(A), enclosure_of(B)
    packed = enclosure.packed
    PA, PB = (as_given(np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4)))) for X in (X_WA, X_WB))
    limit = np.full(n, margin) if slack is None else margin + slack.each
    reach = margin if slack is None else margin + slack.largest
    some = _within(body, enclosure, PA.X, PB.X, reach)
    if len(some) < n:
        rows, counts = no_rows(), np.zeros(n, dtype=np.int64)
        if len(some):
            of_some = None if slack is None else slack.take(some)
            rows, ends = _of_poses(A, B, PA.X[some], PB.X[some], len(some), margin, max_contacts, of_some)
            counts[some] = np.diff(ends, prepend=0)
        return rows, np.cumsum(counts)
    near = _near(body, enclosure, PA, PB, limit)
    rows, ends, lacks = _patches(body, packed, PA.X, PB.X, near, margin, max_contacts, slack)
    rows = _shortened(body, enclosure, PA, PB, near, rows, ends)
    if lacks.any():
        return with_distances(A, B, PA.X, PB.X, limit, rows, ends, lacks, reach=reach)
    return rows, ends


def _within(body: Body, enclosure: Enclosure, X_WA: np.ndarray, X_WB: np.ndarray, reach: float) -> np.ndarray:
    """Numbers of the poses (n, 4, 4) at which a mesh and a set may be no farther apart than a reach [m].
    Other poses have no contacts: the kernel of gaps sees this in a hundredth of the time of a search for facets.
    """
    if not serves(enclosure.packed):
        return np.arange(len(X_WA))
    states = surface_states(facets_of(body), enclosure.packed, X_WA, X_WB, reach)
    return np.flatnonzero(~states.apart | (states.maybe_inside & body.solid))


def _near(body: Body, enclosure: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, limit: np.ndarray) -> _Near:
    """Facets no farther than a limit a pose [m]; no facets where the whole mesh, of many facets, is within the set:
    left to `distance`. Raises UnsupportedQuery.
    """
    packed = enclosure.packed
    within = meshes_within(body, packed, PA, PB)
    upper = limit if within is None else np.where(within, -np.inf, limit)
    upper = upper + _LEEWAY * (reach_of(body) + packed.reach)
    across = PB.X[:, :3, 3] - PA.X[:, :3, 3]
    candidates = near_facets(body.tree, packed, PA, PB, across, upper)
    pose, place = candidates.pose, candidates.place
    counts = np.bincount(pose, minlength=len(limit))
    if counts.max(initial=0) > MAX_FACETS:
        raise UnsupportedQuery(
            f"contacts: more than {MAX_FACETS} facets lie within {limit.max():g} m of a curved shape: ask with a "
            "smaller margin, or take a coarser mesh"
        )
    is_asked = facets_asked(body, enclosure, PA, PB, candidates, counts)
    rows, keep = np.zeros(len(pose), dtype=PAIR_DTYPE), ~is_asked
    rows["hit"] = keep  # the others' rows have no normal: these start no patch
    asked = np.flatnonzero(is_asked)
    for begin in range(0, len(asked), _FACETS_OF_PIECE):
        some = asked[begin : begin + _FACETS_OF_PIECE]
        rows[some] = facet_rows(body.tree, packed, PA, PB, pose[some], place[some], boolean=False, limit=np.inf)
    keep[asked] = rows["lower"][asked] <= limit[pose[asked]]
    remaining = np.flatnonzero(keep)
    rows, pose, place = rows[remaining], pose[remaining], place[remaining]
    facets = body.tree.ids[place].astype(np.int64)
    order = np.lexsort((facets, rows["distance"], ~rows["hit"], pose))
    starts = np.concatenate([[0], np.cumsum(np.bincount(pose, minlength=len(limit)))])
    return _Near(facets[order], place[order], rows[order], starts, np.zeros(len(order), dtype=np.int64))


def _patches(
    body: Body, packed: PackedConvex, X_WA, X_WB, near: _Near, margin: float, max_contacts: int, slack: Slack | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(rows, ends, (n,) whether no patch tells) of poses (n, 4, 4)."""
    n = len(X_WA)
    capacity, (n_facets, n_corners) = int(np.diff(near.starts).max(initial=0)), _sizes_of(body)
    table, marks = ShapeTable([packed]), (np.zeros(n_facets, dtype=np.int64), np.zeros(n_corners, dtype=np.int64))
    work = np.empty(workspace_words(capacity, face_table_of(table, ROUND).largest))
    facets = (address_of(of) for of in (near.facets, near.rows, near.starts, near.patches))
    header = _header_of(body, table, (*facets, *map(address_of, marks), address_of(work)), capacity, max_contacts)
    ends, lacks = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    out = np.zeros(_FIRST_ROWS + _ROWS_PER_POSE * n, dtype=CONTACT_DTYPE)
    while curved_manifolds(
        address_of(header), address_of(X_WA), step_of(X_WA), address_of(X_WB), step_of(X_WB), n, margin,
        0 if slack is None else address_of(slack.each), address_of(out), len(out), address_of(ends), address_of(lacks),
    ):
        out[header[ROWS_DONE] :] = np.zeros((), dtype=CONTACT_DTYPE)
        out = np.concatenate([out, np.zeros(2 * len(out), dtype=CONTACT_DTYPE)])
    return out[: header[ROWS_DONE]], ends, lacks


def _sizes_of(body: Body) -> tuple[int, int]:
    """Facets and corners of a mesh."""
    return len(body.tree.ids), len(topology_of(body).fan_starts)


def _header_of(
    body: Body, table: ShapeTable, buffers: tuple[int, ...], capacity: int, max_contacts: int
) -> np.ndarray:
    """What `curved_manifolds` reads of a mesh and row 0 of a table.

    buffers : addresses, as the header has them from the facets on to the workspace.   capacity : in facets.
    """
    header, faces = np.zeros(HEADER, dtype=np.int64), face_table_of(table, ROUND)
    header[:POSE_A] = (
        body.tree.address, address_of(topology_of(body).header), body.solid, len(body.tree.ids), *table.addresses,
        address_of(faces.ints), faces.largest, *buffers, capacity, min(max_contacts, 1 << 40),
    )
    return header


def _shortened(
    body: Body, enclosure: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, near: _Near, rows: np.ndarray,
    ends: np.ndarray,
) -> np.ndarray:
    """Rows whose ``apart`` is no longer than what facets, asked again, prove: B moved by it clears them, and A."""
    pose = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
    begins = np.flatnonzero((np.diff(pose, prepend=-1) != 0) | (np.diff(rows["patch"], prepend=-1) != 0))
    sizes = np.diff(np.append(begins, len(rows)))
    depth = np.maximum(-rows["lower"][begins], 0.0)
    is_long = (rows["kind"][begins] == OVERLAP) & (rows["apart"][begins] > AS_GOOD * depth)
    begins, sizes, depth = begins[is_long], sizes[is_long], depth[is_long]
    if not len(begins):
        return rows
    for factor in _LENGTHS:
        length = factor * depth
        trying = np.flatnonzero((length < rows["apart"][begins]) & (length > 0.0))
        if not len(trying):
            continue
        some = begins[trying]
        parted = _parted(body, enclosure, PA, PB, near, rows[some], pose[some], length[trying])
        for i in trying[parted].tolist():
            rows["apart"][begins[i] : begins[i] + sizes[i]] = length[i]
    return rows


def _parted(
    body: Body, enclosure: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop, near: _Near, rows: np.ndarray,
    pose: np.ndarray, length: np.ndarray,
) -> np.ndarray:
    """(m,) bool: whether the set moved by a length along a patch's normal is proven clear of the patch's facets, and
    also the mesh moved against the normal.

    The highest facets along the normal are asked first: where some of them meet the set, no others are.
    """
    parted = np.ones(len(rows), dtype=bool)
    steps = length[:, None] * rows["normal"]
    bits = 1 << np.minimum(rows["patch"].astype(np.int64), LAST_BIT)
    begins, ends = near.starts[pose].tolist(), near.starts[pose + 1].tolist()
    members = [i + np.flatnonzero(near.patches[i:j] & bit) for i, j, bit in zip(begins, ends, bits)]
    which = np.repeat(np.arange(len(rows)), [len(m) for m in members])
    places = near.places[np.concatenate(members)]
    above = _heights_above(body.tree, enclosure.outer, PA.X[pose], PB.X[pose], rows["normal"], length, which, places)
    order = np.argsort(-above, kind="stable")[: np.count_nonzero(above >= 0.0)]
    moved = (PA.X[pose], _moved(PB.X[pose], steps)), (_moved(PA.X[pose], -steps), PB.X[pose])
    n = _FIRST_ASKED
    while len(order):
        some, order, n = order[:n], order[n:], 8 * n
        for X_A, X_B in moved:
            some = some[parted[which[some]]]
            asked = facet_rows(
                body.tree, enclosure.packed, as_given(X_A), as_given(X_B), which[some], places[some], boolean=True,
                limit=0.0,
            )
            parted[which[some[asked["hit"]]]] = False
        order = order[parted[which[order]]]
    return parted


def _heights_above(
    tree: MeshTree, outer: Body, X_WA: np.ndarray, X_WB: np.ndarray, nhat: np.ndarray, length: np.ndarray,
    which: np.ndarray, places: np.ndarray,
) -> np.ndarray:
    """(k,) how far facets reach beyond the begin of a set moved by a length along a normal, each for one of m normals
    [m].

    max n·p over their corners, less min n·q + length over the corners of a polytope around the set, seen from the
    mesh's origin, rounding added: where negative n parts them.
    """
    around = outer.tree.triangles.reshape(-1, 3)
    along_a, along_b = ((X[:, :3, :3] * nhat[:, :, None]).sum(axis=1) for X in (X_WA, X_WB))
    shift = ((X_WB[:, :3, 3] - X_WA[:, :3, 3]) * nhat).sum(axis=1)
    lowest = (along_b @ around.T).min(axis=1) + shift + length
    size = tree.numbers[REACH : REACH + 3].sum() + np.abs(around).max() + length
    size += np.abs(X_WB[:, :3, 3]).sum(axis=1) + np.abs(X_WA[:, :3, 3]).sum(axis=1)
    highest = np.concatenate(
        [(tree.triangles[places[which == i]].reshape(-1, 3) @ n).reshape(-1, 3).max(axis=1)
         for i, n in enumerate(along_a)]
    )
    return highest - (lowest - 2.0**-44 * size)[which]


def _moved(X: np.ndarray, steps: np.ndarray) -> np.ndarray:
    moved = X.copy()
    moved[:, :3, 3] += steps
    return moved


# --- single calls -------------------------------------------------------------------------------


def single_curved_contacts(A: Shape, B: Shape) -> tuple[Single, Any] | None:
    """(`Prepared.contacts` of a mesh and a curved shape, what it uses besides); ``None`` of rounded polytopes."""
    exchanged = kind_of(A) is not Kind.MESH
    body, enclosure = (body_of(B), enclosure_of(A)) if exchanged else (body_of(A), enclosure_of(B))
    if not serves(enclosure.packed):
        return None
    block, table = space_of_single_calls(), ShapeTable([enclosure.packed])
    question = GapQuestion(facets_of(body), enclosure.packed, block.addresses)
    question.header[EXCHANGED] = exchanged
    space = _space_of_single_calls(face_table_of(table, ROUND).largest)
    marks = _marks(1 << max(_sizes_of(body)).bit_length())
    header = np.zeros(CURVED_HEADER, dtype=np.int64)
    header[:STARTS] = (
        code_of(curved_manifolds), len(space.out), 0, address_of(question.header), body.solid, FACETS_OF_SINGLE_CALLS,
        *(address_of(of) for of in (space.listed, space.places, space.order, space.facets, space.rows)),
    )
    header.view(np.float64)[REACH_OF_BOTH] = compound_parts(A).reach + compound_parts(B).reach
    buffers = (address_of(of) for of in (space.facets, space.rows, header[STARTS:], space.patches, *marks, space.work))
    header[MANIFOLDS:] = _header_of(body, table, tuple(buffers), FACETS_OF_SINGLE_CALLS, 1)
    asked = prepared_contacts(contacts_single_curved, header, space.out)
    return asked, (body, enclosure, block, table, question, space, marks)


class _SpaceOfSingleCalls:
    """What single calls work in: rows and numbers of facets as the walk lists them, and in order; contacts."""

    def __init__(self, largest: int):
        n = FACETS_OF_SINGLE_CALLS
        self.listed, self.rows = np.zeros((2, n), dtype=PAIR_DTYPE)
        self.places, self.order, self.facets, self.patches = np.zeros((4, n), dtype=np.int64)
        self.work = np.empty(workspace_words(n, largest))
        self.out = np.zeros(ROWS_OF_SINGLE_CALLS, dtype=CONTACT_DTYPE)


#: One for all pairs whose shape has faces of so many corners: the kernels keep Python's lock.
_space_of_single_calls = workspace_under_lock(_SpaceOfSingleCalls)


@cache
def _marks(n: int) -> np.ndarray:
    """(2, n) words for marks of a mesh's facets and corners, zeros between calls: for all meshes of no more than n."""
    return np.zeros((2, n), dtype=np.int64)
