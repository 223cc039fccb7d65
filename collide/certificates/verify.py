"""`verify`: the certificate of a result, checked in Python integers. No kernel is imported."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from collide.base import argument_checks as checks
from collide.certificates.body_groups import flaw_of_group_certificates
from collide.certificates.certificate import (
    APART,
    PLANE,
    POINT,
    TOGETHER,
    Certificate,
    CertificateRefused,
    read_certificates,
)
from collide.certificates.convex_proofs import flaw_of_proof
from collide.certificates.exact_parts import exact_parts
from collide.certificates.field_proofs import flaw_of_field_certificates, has_field_certificates
from collide.certificates.mesh_proofs import flaw_of_mesh_certificates
from collide.certificates.point_and_plane import flaw_of_normal, flaw_of_point
from collide.certificates.region_proofs import flaw_of_region_certificate
from collide.errors import InvalidArgument
from collide.shapes.shape import checked_shape
from collide.transforms import as_poses

#: Kinds of certificates that prove a claim about convex parts.
_PROOFS = {APART: (APART, PLANE), TOGETHER: (TOGETHER, POINT)}


def verify(A, B, X_WA, X_WB, r, *, certificate=None) -> None:
    """Check in Python integers that the certificate of a single result proves its boolean.

    Parameters
    ----------
    A, B : shapes of the question.
    X_WA, X_WB : (4, 4) their poses in the world W [m]. Every entry is taken as an exact number; the matrices
        may be other than rotations.
    r : `PairResult` of `collide.distance`, or a result of `collide.walk`, at a single pair of poses (``r[k]`` of a
        batch): ``r.hit`` is proven, from ``r.certificate``.
    certificate : rows of (kind, part_a, part_b, pairs) to be checked instead of ``r.certificate``, for example read
        from a JSON file.

    Returns
    -------
    ``None``, for a certificate that proves A and B meeting or apart, as ``r.hit`` says.

    Raises
    ------
    CertificateRefused : the certificate proves nothing; the message names the failing step.
    InvalidArgument : nothing to check: no shape, no single result, or a result without a certificate.
    InvalidPose : poses other than (4, 4) matrices of finite numbers.

    O(vertices) doubles a pair of parts, and integers for vertices left in doubt; O(facets) where a
    body lies inside a solid mesh; O(vertices of two groups) doubles a plane between meshes, O(facets) a surface outside
    a solid; O(items) doubles a plane beside fields, of terrain O(heights) once and boxes around
    blocks. The kinds of certificates, and their proofs:
    `collide.certificates.certificate`.
    """
    check_question("verify", [A], [B], r)
    X_WA, X_WB = as_poses(X_WA, "X_WA", check=False), as_poses(X_WB, "X_WB", check=False)
    if len(X_WA) != 1 or len(X_WB) != 1 or len(r) != 1:
        raise InvalidArgument(
            f"verify: X_WA and X_WB must be one pose each and r one result, got {X_WA.shape}, {X_WB.shape} and "
            f"{len(r)}; index a batch first"
        )
    certificate = r.certificate if certificate is None else certificate
    if certificate is None:
        raise InvalidArgument(
            "verify: this result carries no certificate (an open sign; a region beside another body; large terrain "
            "beside a mesh or a field)"
        )
    claim = TOGETHER if bool(np.all(r.hit)) else APART
    if A.is_region or B.is_region:
        flaw = flaw_of_region_certificate(A, B, X_WA[0], X_WB[0], certificate, claim)
        if flaw:
            raise CertificateRefused(flaw)
        return
    certificates = read_certificates(certificate)
    flaw_of = flaw_of_mesh_certificates if A.meshed or B.meshed else _flaw_of_parts
    if A.is_field or B.is_field:
        flaw_of = flaw_of_field_certificates if has_field_certificates(A, B) else flaw_of_group_certificates
    flaw = flaw_of(A, B, X_WA[0], X_WB[0], certificates, claim)
    if flaw:
        raise CertificateRefused(flaw)


def check_question(caller: str, A, B, r) -> None:
    """Raises InvalidArgument where a sequence A or B holds what is no shape, or r is no result."""
    for name, shapes in (("A", A), ("B", B)):
        for shape in shapes:
            checked_shape(f"{caller}: {name}", shape)
    if not (hasattr(r, "hit") and hasattr(r, "__len__")):
        raise InvalidArgument(f"{caller}: r must be a result of distance, got {checks.brief(r)}")


def _flaw_of_parts(A, B, X_WA, X_WB, certificates: Sequence[Certificate], claim: str) -> str | None:
    """Why certificates fail to prove two shapes of convex parts "together" or "apart"; ``None`` for a proof."""
    parts_a, parts_b = exact_parts(A, X_WA), exact_parts(B, X_WB)
    proven = set()
    for kind, i, j, pairs in certificates:
        if kind not in _PROOFS[claim]:
            return f"the result says {claim}, the certificate {kind!r}"
        if not (0 <= i < len(parts_a) and 0 <= j < len(parts_b)):
            return f"there are no parts {i} and {j}"
        if kind == PLANE:
            flaw = flaw_of_normal(parts_a[i], parts_b[j], pairs[0])
        elif kind == POINT:
            flaw = flaw_of_point(parts_a[i], parts_b[j], pairs[0])
        else:
            flaw = flaw_of_proof(parts_a[i], parts_b[j], pairs, hit=kind == TOGETHER)
        if flaw:
            return f"parts {i} and {j}: {flaw}"
        proven.add((i, j))
    n_pairs = len(parts_a) * len(parts_b)
    if not proven or (claim == APART and len(proven) < n_pairs):
        return f"{n_pairs} pairs of parts, {len(proven)} of them certified"
    return None
