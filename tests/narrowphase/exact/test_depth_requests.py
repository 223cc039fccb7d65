"""The list of requests to the exact stage, against a dictionary."""

from __future__ import annotations

import pytest
from naive import rng_of

from collide.narrowphase.exact import depth_requests as D

pytestmark = pytest.mark.plain_kernels


@pytest.mark.parametrize("n_rows", [0, 1, 7, D.ROWS_PER_BATCH])
def test_entries_are_found(n_rows):
    """By row, in order; none for a row that asks nothing. A list in which every row asks the most fits."""
    rng = rng_of("depth requests", n_rows)
    requests = [0] + [-1] * (D.REQUESTS - 1)
    entries = {}
    for row in range(n_rows):
        if n_rows == D.ROWS_PER_BATCH or rng.random() < 0.6:
            n_facets = D.MAX_TIED_FACETS if n_rows == D.ROWS_PER_BATCH else int(rng.integers(0, 5))
            tied = [int(rng.integers(2)), n_facets, *rng.integers(0, 100, 6 * n_facets).tolist()]
            assert len(tied) <= D.ENTRY
            D.add_request(requests, row, [*tied, 77, 78])
            entries[row] = tied
    for row in range(n_rows + 2):
        at = D.find_request(requests, row)
        assert (at > 0) == (row in entries)
        if at:
            assert requests[at : at + len(entries[row])] == entries[row]
    assert 77 not in requests[requests[0] + 1 :] and len(requests) == D.REQUESTS
    assert n_rows < D.ROWS_PER_BATCH or requests[0] == D.REQUESTS - 1
