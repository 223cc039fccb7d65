"""Arguments of questions about surfaces, checked: vectors, lengths of batches, two bodies of facets."""

from __future__ import annotations

import numpy as np

from collide import argument_checks as checks
from collide.errors import InvalidArgument
from collide.lowering.facet_bodies import Body, facet_body
from collide.transforms import as_poses


def vectors(caller: str, name: str, values) -> tuple[np.ndarray, bool]:
    """((n, 3) finite float64, whether a single vector was handed in). Raises InvalidArgument."""
    array = checks.array(f"{caller}: {name}", values, "(3,) or (N, 3)", InvalidArgument)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise InvalidArgument(f"{caller}: {name} must be (3,) or (N, 3), got {array.shape}")
    rows = np.ascontiguousarray(array.reshape(-1, 3))
    refuse_rows(caller, name, rows, ~np.isfinite(rows).all(axis=1), "has entries that are not finite")
    return rows, array.ndim == 1


def refuse_rows(caller: str, name: str, rows: np.ndarray, bad: np.ndarray, complaint: str) -> None:
    """Raises InvalidArgument naming the first bad row, where there is one."""
    if bad.any():
        k = int(np.argmax(bad))
        raise InvalidArgument(f"{caller}: {name}[{k}] {complaint}, got {rows[k].tolist()}")


def matched_count(caller: str, **counts: int) -> int:
    """The length of a batch: that of all arguments, or of all but single ones. Raises InvalidArgument."""
    n = max(counts.values()) if min(counts.values()) else 0
    if any(count not in (1, n) for count in counts.values()):
        lengths = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise InvalidArgument(
            f"{caller}: lengths do not match: {lengths}; batches must be equally long, or a single one"
        )
    return n


def two_bodies(caller: str, A, B, X_WA, X_WB, check: bool) -> tuple[Body, Body, np.ndarray, np.ndarray]:
    """(body of A, body of B, poses, poses (n, 4, 4)) of a question about the facets of two shapes, one of them a mesh.

    Raises InvalidArgument, InvalidPose; UnsupportedQuery for shapes without facets.
    """
    body_a, body_b = facet_body(A, caller), facet_body(B, caller)
    if not (A.meshed or B.meshed):
        raise InvalidArgument(
            f"{caller}: {type(A).__name__} and {type(B).__name__}: one of them at least must be a Mesh; "
            "Mesh(*...) of a hull's vertices and facets is one"
        )
    X_WA, X_WB = (as_poses(X, name, check=check) for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))
    n = matched_count(caller, X_WA=len(X_WA), X_WB=len(X_WB))
    X_WA, X_WB = (np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in (X_WA, X_WB))
    return body_a, body_b, X_WA, X_WB
