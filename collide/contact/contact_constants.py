"""Sizes of what contacts of meshes and unions read and work in, for callers in C, who cannot read constants."""

from __future__ import annotations

import numpy as np

from collide.contact import curved_contact_call, curved_manifolds
from collide.contact.compound_contact_call import COMPOUND_HEADER
from collide.contact.contact_facets import TOPOLOGY
from collide.contact.curved_contact_call import CURVED_HEADER
from collide.contact.facet_contact_call import FACETS_HEADER, PAIRS_OF_SINGLE_CALLS, ROWS_OF_SINGLE_CALLS
from collide.contact.facet_manifolds import workspace_words
from collide.contact.support_face import ROUND
from collide.kernels import entry, view_i64

#: In this order (`native/capi_mesh_contacts.c`, `native/capi_compound_contacts.c`,
#: `native/capi_curved_contacts.c`).
_CONSTANTS = np.array(
    [
        FACETS_HEADER, TOPOLOGY, PAIRS_OF_SINGLE_CALLS, ROWS_OF_SINGLE_CALLS, workspace_words(PAIRS_OF_SINGLE_CALLS),
        COMPOUND_HEADER, CURVED_HEADER,
        curved_contact_call.FACETS_OF_SINGLE_CALLS, curved_contact_call.ROWS_OF_SINGLE_CALLS,
        curved_manifolds.workspace_words(curved_contact_call.FACETS_OF_SINGLE_CALLS, ROUND),
    ],
    dtype=np.int64,
)


@entry("int64(int64, int64)")
def write_contact_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
