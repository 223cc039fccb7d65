"""Contacts of a mesh and a cylinder, cone or ellipsoid at a single pair of poses: from matrices to rows in a kernel.

The facets within the margin by a walk down the mesh's tree (`item_walks.py`), their patches by the kernel of
batches (`curved_manifolds.py`).
"""

from __future__ import annotations

from collide.contact.curved_manifolds import HEADER, MAX_CONTACTS, POSES_DONE, ROWS_DONE, SIGNATURE
from collide.contact.near_the_margin import is_near_the_margin
from collide.contact.patch_rows import CONTACT, clear_words, flip_row, is_cleared_by, patch_of_row
from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i64
from collide.mesh.bvh import open_tree
from collide.narrowphase.facets.item_questions import (
    EXCHANGED,
    MAYBE_INSIDE,
    NEAR,
    SURFACES_APART,
    place_pair,
)
from collide.narrowphase.facets.item_questions import HEADER as GAP_HEADER
from collide.narrowphase.facets.nearest_item_kernel import (
    rows_within,
)
from collide.narrowphase.rows import DISTANCE, HIT, ROW, copy_row, view_row

_curved_manifolds_at = native_call(SIGNATURE)

# Header: the kernel of batches; how many rows there is space for; how far both bodies reach from their origins, summed
# (a double) [m]; address of the header of `item_questions.py`; whether the mesh is solid; facets that there is
# space for, addresses of their rows and places as they are met, of their order, of their numbers and rows in order; of
# the call where the facets begin and end, where the contacts end, and what they lack. Then the header of
# `curved_manifolds.py`.
(
    KERNEL, N_ROWS, REACH_OF_BOTH, GAP_AT, SOLID, CAPACITY, ROWS_AT, PLACES_AT, ORDER_AT, FACETS_AT, ORDERED_AT,
    STARTS, _END_OF_FACETS, _END, _LACKS, MANIFOLDS,
) = range(16)
CURVED_HEADER = MANIFOLDS + HEADER
#: Facets whose boxes are near the shape, fewer than MAX_ASKED, and rows, that a single call has space for: more are
#: left to the long way.
FACETS_OF_SINGLE_CALLS, ROWS_OF_SINGLE_CALLS = 448, 1024
#: A length that is longer than the depth by no more than this part is as good as one can be.
AS_GOOD = 1.0 + 2.0**-10


@entry(prepared.CONTACTS, nogil=False)
def contacts_single_curved(header_at, XA_at, XB_at, out_at, max_contacts, margin):
    """The contacts of a mesh and a curved shape at a pair of poses; their number, or −1 where the caller has to ask as
    of a batch.

    header : of CURVED_HEADER integers; EXCHANGED of its gap header says whether the shape stands first.   out :
    `CONTACT_DTYPE`, zeroed, of N_ROWS rows. All threads share the workspace: the kernel keeps Python's lock.
    """
    header = view_i64(header_at, CURVED_HEADER)
    exchanged = view_i64(header[GAP_AT], GAP_HEADER)[EXCHANGED] != 0
    of_mesh, of_shape = (XB_at, XA_at) if exchanged else (XA_at, XB_at)
    is_placed, walk = place_pair(header[GAP_AT], of_mesh, of_shape, True)
    if not is_placed:
        return -1
    state, n = rows_within(walk, margin, header[CAPACITY], header[ROWS_AT], header[PLACES_AT])
    if state == SURFACES_APART or (state == MAYBE_INSIDE and header[SOLID] == 0):
        return 0
    if state != NEAR:
        return -1
    _put_in_order(header, n)
    header[STARTS], header[_END_OF_FACETS] = 0, n
    header[MANIFOLDS + MAX_CONTACTS] = max_contacts
    header[MANIFOLDS + POSES_DONE] = header[MANIFOLDS + ROWS_DONE] = 0
    is_full = _curved_manifolds_at(
        header[KERNEL],
        (
            header_at + 8 * MANIFOLDS, of_mesh, 0, of_shape, 0, 1, margin, 0, out_at, header[N_ROWS],
            header_at + 8 * _END, header_at + 8 * _LACKS,
        ),
    )
    if is_full or header[_LACKS] != 0:
        return -1
    n_rows, reach = header[_END], view_f64(header_at + 8 * REACH_OF_BOTH, 1)[0]
    if is_near_the_margin(out_at, n_rows, margin, reach, XA_at, XB_at) or _has_long_way(out_at, n_rows):
        return -1
    clear_words(out_at, n_rows)
    if exchanged:
        for k in range(n_rows):
            flip_row(out_at + CONTACT * k)
    return n_rows


@kernel
def _put_in_order(header, n):
    """Sort n facets and rows as `curved_manifolds` takes them: by whether a facet meets the shape, by distance, by
    number."""
    ids = open_tree(header[MANIFOLDS]).ids
    order, places = view_i64(header[ORDER_AT], n), view_i64(header[PLACES_AT], n)
    facets = view_i64(header[FACETS_AT], n)
    for i in range(n):
        k = i
        while k > 0 and _is_before(header, ids, places, i, order[k - 1]):
            order[k] = order[k - 1]
            k -= 1
        order[k] = i
    for i in range(n):
        facets[i] = ids[places[order[i]]]
        copy_row(header[ROWS_AT] + ROW * order[i], header[ORDERED_AT] + ROW * i)


@kernel(inline=True)
def _is_before(header, ids, places, i, j):
    a, b = view_row(header[ROWS_AT] + ROW * i), view_row(header[ROWS_AT] + ROW * j)
    hit_a, hit_b = a.flags[HIT] != 0, b.flags[HIT] != 0
    if hit_a != hit_b:
        return hit_a
    if a.doubles[DISTANCE] != b.doubles[DISTANCE]:
        return a.doubles[DISTANCE] < b.doubles[DISTANCE]
    return ids[places[i]] < ids[places[j]]


@kernel
def _has_long_way(out_at, n_rows):
    """Whether facets, asked again, may prove that a patch is cleared by a shorter way than slabs prove."""
    patch = -1
    for k in range(n_rows):
        row_at = out_at + CONTACT * k
        if patch_of_row(row_at) != patch:  # its deepest contact
            patch = patch_of_row(row_at)
            if not is_cleared_by(row_at, AS_GOOD):
                return True
    return False
