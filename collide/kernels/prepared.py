"""Kernels of single calls, bound to their pair of shapes: Python does nothing but the call.

Two poses come as numpy arrays. Functions return ``None``, and leave the call to the long way, where an array is no
C-contiguous (4, 4) array of float64 (the long way converts the array, or says what is wrong), and where the answer
takes more than the kernel.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.kernels import address_of
from collide.kernels.mode import COMPILED, MODE

#: Signatures: addresses of the header and of two matrices; of rows where they go, and a flag of the kernel's own, of
#: contacts how many a patch may have; how far apart bodies may be for it to matter [m]. They return −1 where the answer
#: is left to the long way.
BOOLEAN = "int64(int64, int64, int64)"
WITHIN = "int64(int64, int64, int64, float64)"
ROW = "int64(int64, int64, int64, int64, boolean, float64)"
CONTACTS = "int64(int64, int64, int64, int64, int64, float64)"

if MODE == COMPILED:
    from collide.kernels.library import glue

    def prepared_boolean(entry, header: np.ndarray) -> Callable:
        """A function of two poses: True, False, or None where the answer is left to the long way.

        entry : of the signature `BOOLEAN`.   header : int64, held as long as the function lives.
        """
        return glue.prepared(entry.__name__, header)

    def prepared_within(entry, header: np.ndarray) -> Callable:
        """A function of two poses and a length [m], of the signature `WITHIN`: as `prepared_boolean`."""
        return glue.prepared(entry.__name__, header)

    def prepared_row(entry, header: np.ndarray) -> Callable:
        """A function of two poses, a bytearray that begins with zeros for a row, a flag and a limit [m], of the
        signature `ROW`: returns the kernel's boolean, or ``None``."""
        return glue.prepared(entry.__name__, header)

    def prepared_contacts(entry, header: np.ndarray, rows: np.ndarray) -> Callable:
        """A function of two poses, the most contacts of a patch and a margin [m], of the signature `CONTACTS`: the
        contacts' bytes, or ``None``.

        rows : the kernel's output, with space for the most contacts of a call; kept alive as the header is.
        """
        return glue.prepared(entry.__name__, header, rows)

    #: ``row_fields(row)``: (distance, normal, point_a, point_b, their middle, part_a, part_b, hit) of bytes that begin
    #: with a row of `PAIR_DTYPE`.
    row_fields: Callable = glue.row_fields
    #: ``nearest_of_pair(A, B, X_WA, X_WB, signed)``: `adapters.hosts.nearest_points`; None where
    #: the question is left to the long way. None itself without a library.
    nearest_of_pair: Callable | None = glue.nearest_of_pair
    #: ``query_of_c(function, doc, (min_length, max_length), (usual length, usual option), prepare, result, certify)``:
    #: a public function of single calls as one of C's; None without a library (`narrowphase/single_queries.py`).
    query_of_c: Callable | None = glue.query
else:
    query_of_c = nearest_of_pair = None

    def row_fields(row) -> tuple:
        numbers = np.frombuffer(row, np.float64, _DOUBLES).copy()
        normal, point_a, point_b = numbers[3:].reshape(3, 3)
        parts = np.frombuffer(row, np.int32, 2, 8 * _DOUBLES + 8).tolist()
        return numbers.item(0), normal, point_a, point_b, 0.5 * point_a + 0.5 * point_b, *parts, bool(row[_HIT])

    def prepared_boolean(entry, header: np.ndarray) -> Callable:
        def asked(X_WA, X_WB):
            if not (is_matrix(X_WA) and is_matrix(X_WB)):
                return None
            return _truth_of(entry(address_of(header), address_of(X_WA), address_of(X_WB)))

        return asked

    def prepared_within(entry, header: np.ndarray) -> Callable:
        def asked(X_WA, X_WB, length):
            if not (is_matrix(X_WA) and is_matrix(X_WB)):
                return None
            return _truth_of(entry(address_of(header), address_of(X_WA), address_of(X_WB), length))

        return asked

    def prepared_row(entry, header: np.ndarray) -> Callable:
        def asked(X_WA, X_WB, memory, flag, limit):
            if not (is_matrix(X_WA) and is_matrix(X_WB)):
                return None
            row_at = address_of(np.frombuffer(memory, np.uint8))
            return _truth_of(entry(address_of(header), address_of(X_WA), address_of(X_WB), row_at, flag, limit))

        return asked

    def prepared_contacts(entry, header: np.ndarray, rows: np.ndarray) -> Callable:
        def asked(X_WA, X_WB, max_contacts, margin):
            if not (is_matrix(X_WA) and is_matrix(X_WB)):
                return None
            out = np.zeros_like(rows)
            at = address_of(header), address_of(X_WA), address_of(X_WB), address_of(out)
            n = entry(*at, max_contacts, margin)
            return None if n < 0 else out[:n].tobytes()

        return asked


#: Doubles that a pair's row begins with: the distance and its bounds, the normal, two points.
_DOUBLES = 12
#: The byte of a pair's row that says whether it meets.
_HIT = 157


def _truth_of(status: int) -> bool | None:
    return None if status < 0 else bool(status)


def is_matrix(X) -> bool:
    """Whether X is laid out as kernels read a pose: aligned, C-contiguous float64 (4, 4). Entries are not looked at."""
    if type(X) is not np.ndarray or X.dtype != np.float64 or X.shape != (4, 4):
        return False
    return X.flags.c_contiguous and X.flags.aligned
