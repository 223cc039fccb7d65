"""What `answer_pairs` asks of the exact stage: depths below rounding, by the facets of A ⊖ B nearest the origin, maybe
several.

A list in the workspace of one call: how many integers are used, then an entry a row, in the order of rows: the row's
number, whether all other facets are farther for certain, the number of facets, and of each the vertex pairs of its
three corners.
"""

from __future__ import annotations

from collide.kernels import kernel

#: Facets an entry may name: around a corner that touches a face there are a dozen.
MAX_TIED_FACETS = 24
#: Rows that are answered before the exact stage has its turn; integers of one entry, without its row, and of a list
#: that fits if all of these rows ask.
ROWS_PER_BATCH = 256
ENTRY = 2 + 6 * MAX_TIED_FACETS
REQUESTS = 1 + ROWS_PER_BATCH * (1 + ENTRY)


@kernel
def add_request(requests, row, tied):
    """Append an entry ``tied``: whether it is complete, how many facets, their corners."""
    used = requests[0]
    length = 2 + 6 * tied[1]
    requests[used + 1] = row
    for k in range(length):
        requests[used + 2 + k] = tied[k]
    requests[0] = used + 1 + length


@kernel
def find_request(requests, row):
    """Place of the entry of a row, behind the row's number; 0 where the row has no entry."""
    at = 1
    while at <= requests[0] and requests[at] < row:
        at += 3 + 6 * requests[at + 2]
    return at + 1 if at <= requests[0] and requests[at] == row else 0
