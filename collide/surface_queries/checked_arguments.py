"""Arguments of questions about surfaces, checked: two bodies of facets."""

from __future__ import annotations

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.lowering.facet_bodies import Body, facet_body
from collide.transforms import as_poses


def two_bodies(caller: str, A, B, X_WA, X_WB, check: bool) -> tuple[Body, Body, np.ndarray, np.ndarray]:
    """(body of A, body of B, poses, poses (n, 4, 4)) of a question about the facets of two shapes, one of them a mesh.

    Raises InvalidArgument, InvalidPose; UnsupportedQuery for shapes without facets.
    """
    body_a, body_b = facet_body(A, f"{caller}: A"), facet_body(B, f"{caller}: B")
    if not (A.meshed or B.meshed):
        raise InvalidArgument(
            f"{caller}: {type(A).__name__} and {type(B).__name__}: one of them at least must be a Mesh; "
            "Mesh(*...) of a hull's vertices and facets is one"
        )
    X_WA, X_WB = (as_poses(X, name, check=check) for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))
    n = checks.matched_count(caller, X_WA=len(X_WA), X_WB=len(X_WB))
    X_WA, X_WB = (np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in (X_WA, X_WB))
    return body_a, body_b, X_WA, X_WB
