"""Contacts of two bodies of facets at a single pair of poses: from matrices to rows inside a kernel."""

from __future__ import annotations

from collide.contact.facet_manifolds import CONTACT_HEADER, DONE, MAX_CONTACTS, POSES_DONE, ROWS_DONE, SIGNATURE
from collide.contact.near_the_margin import is_near_the_margin
from collide.contact.patch_rows import clear_words
from collide.kernels import entry, native_call, prepared, view_f64, view_i64
from collide.narrowphase.facets.mesh_collide_kernel import is_rigid

_facet_manifolds_at = native_call(SIGNATURE)

# Header: the kernel of batches; how many rows there is space for; how far both bodies reach from their origins, summed
# (a double) [m]; of the call where its rows end, and what they lack. Then the header of `facet_manifolds.py`.
KERNEL, N_ROWS, REACH_OF_BOTH, _END, _LACKS, MANIFOLDS = range(6)
FACETS_HEADER = MANIFOLDS + CONTACT_HEADER
#: Pairs of facets, and rows, that a single call has space for; calls of more are left to the long way.
PAIRS_OF_SINGLE_CALLS, ROWS_OF_SINGLE_CALLS = 1 << 12, 1 << 10


@entry(prepared.CONTACTS, nogil=False)
def contacts_single_facets(header_at, XA_at, XB_at, out_at, max_contacts, margin):
    """The contacts of two bodies of facets at one pair of poses; how many, or −1 where the caller has to ask as of a
    batch.

    header : of FACETS_HEADER integers.   out : `CONTACT_DTYPE`, as many rows as the header says. All threads share the
    workspace: the kernel keeps Python's lock.
    """
    if not (is_rigid(XA_at, True) and is_rigid(XB_at, True)):
        return -1
    header = view_i64(header_at, FACETS_HEADER)
    header[_LACKS] = 0
    header[MANIFOLDS + MAX_CONTACTS] = max_contacts
    header[MANIFOLDS + POSES_DONE] = header[MANIFOLDS + ROWS_DONE] = 0
    status = _facet_manifolds_at(
        header[KERNEL],
        (
            header_at + 8 * MANIFOLDS, XA_at, 0, XB_at, 0, 1, margin, 0, out_at, header[N_ROWS], header_at + 8 * _END,
            header_at + 8 * _LACKS,
        ),
    )
    if status != DONE or header[_LACKS] != 0:
        return -1
    n_rows, reach = header[_END], view_f64(header_at + 8 * REACH_OF_BOTH, 1)[0]
    if is_near_the_margin(out_at, n_rows, margin, reach, XA_at, XB_at):
        return -1
    clear_words(out_at, n_rows)
    return n_rows

