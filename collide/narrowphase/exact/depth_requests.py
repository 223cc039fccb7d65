"""What `answer` tells the exact stage of depths below rounding: the facets nearest the origin, more than one perhaps.

A list in the workspace of one call: how many integers it takes, then an entry a row: the row's number, whether all other
facets are farther for certain, the number of facets, and of each the vertex pairs of its three corners.
"""

from __future__ import annotations

from collide.kernels import kernel

#: Facets an entry may name: around a corner that touches a face there are a dozen.
MOST_TIED = 24
#: Rows that are answered before the exact stage has its turn; integers of one entry, without its row, and of a list that
#: fits if all of these rows ask.
ROWS_TOGETHER = 256
ENTRY = 2 + 6 * MOST_TIED
REQUESTS = 1 + ROWS_TOGETHER * (1 + ENTRY)


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
def find_request(requests, at, row):
    """Where the entry of a row begins, behind the row's number, or the place to look on for later rows; whether it is."""
    while at <= requests[0] and requests[at] < row:
        at += 3 + 6 * requests[at + 2]
    return at + 1, at <= requests[0] and requests[at] == row
