"""Kernels of single calls, bound to their pair of shapes: Python does nothing but the call.

Two poses come as numpy arrays; a pose other than a C-contiguous (4, 4) array of float64 is left to the long way, where
the pose is converted, or refused with its fault named.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.kernels import address_of
from collide.kernels.mode import COMPILED, MODE

#: Signatures: addresses of the header and of two matrices; of rows, where they go, a flag of the kernel's own, and how
#: far apart bodies may be for it to matter [m]. They return −1 where the answer is left to the long way.
BOOLEAN = "int64(int64, int64, int64)"
ROW = "int64(int64, int64, int64, int64, boolean, float64)"

if MODE == COMPILED:
    from collide.kernels.library import glue

    def prepared_boolean(entry, header: np.ndarray) -> Callable:
        """A function of two poses: True, False, or None where the answer is left to the long way.

        entry : of the signature `BOOLEAN`.   header : int64, held as long as the function lives.
        """
        return glue.prepared(entry.__name__, header)

    def prepared_row(entry, header: np.ndarray) -> Callable:
        """A function of two poses, an array for the answer, a flag and a limit: the kernel's boolean, or None."""
        return glue.prepared(entry.__name__, header)
else:

    def prepared_boolean(entry, header: np.ndarray) -> Callable:
        def asked(X_WA, X_WB):
            if not (_is_matrix(X_WA) and _is_matrix(X_WB)):
                return None
            status = entry(address_of(header), address_of(X_WA), address_of(X_WB))
            return None if status < 0 else bool(status)

        return asked

    def prepared_row(entry, header: np.ndarray) -> Callable:
        def asked(X_WA, X_WB, out, flag, limit):
            if not (_is_matrix(X_WA) and _is_matrix(X_WB)):
                return None
            status = entry(address_of(header), address_of(X_WA), address_of(X_WB), address_of(out), flag, limit)
            return None if status < 0 else bool(status)

        return asked


def _is_matrix(X) -> bool:
    if type(X) is not np.ndarray or X.dtype != np.float64 or X.shape != (4, 4):
        return False
    return X.flags.c_contiguous and X.flags.aligned
