"""Certificates of results: the vertices decisive in doubles, or the last vertices of an exact search from them; planes
and points of curved pairs, and planes between groups of facets.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from collide.certificates.body_groups import BodyGroups, has_groups
from collide.certificates.certificate import APART, INSIDE, NO_VERTEX, PLANE, POINT, TOGETHER, Certificate, VertexPair
from collide.certificates.convex_proofs import flaw_of_proof
from collide.certificates.exact_parts import ExactPart, common_vertices, exact_parts
from collide.certificates.field_proofs import field_certificate, has_field_certificates
from collide.certificates.group_search import meeting, parted
from collide.certificates.mesh_proofs import ProofBody, flaw_of_inside_proof
from collide.certificates.nearest_to_origin import nearest_vertex_pairs
from collide.certificates.point_and_plane import flaw_of_normal
from collide.certificates.proof_search import common_point, parting_normal
from collide.certificates.region_proofs import RegionCertificate, make_region_certificate
from collide.certificates.verify import check_question
from collide.errors import InvalidArgument, brief
from collide.lowering.convex_sets import HALFSPACE, POINTS
from collide.numerics.exact_points import in_integers
from collide.results import UNDECIDED, PairResult, question_of_row
from collide.transforms import as_poses

#: Certificates of a pair of bodies, or of a region and another body; None without a certificate.
Certificates = tuple[Certificate, ...] | RegionCertificate | None


def certify(A, B, X_WA, X_WB, r: PairResult) -> Certificates | list[Certificates]:
    """Certificates of the results of `collide.distance`, as in ``r.certificate``.

    Parameters
    ----------
    A, B : shapes of the question, or sequences of them, a shape a row of r.
    X_WA, X_WB : (4, 4) or (N, 4, 4) poses of the question in the world W [m], entries taken as exact numbers.
    r : the `PairResult` of ``collide.distance(A, B, X_WA, X_WB)``.

    Returns
    -------
    A tuple of `Certificate`, for each pair of parts in the proof; ``None`` for pairs without a certificate (an
    open sign, …: `collide.certificates.certificate` lists them). A list of tuples for
    batches.

    Raises
    ------
    InvalidArgument : shapes, results or numbers of poses of different questions.
    InvalidPose : poses other than (4, 4) matrices of finite numbers.

    The vertices decisive in doubles are tried first, O(vertices) doubles; where they prove nothing exactly,
    Gilbert's, Johnson's and Keerthi's algorithm goes on from them, O(vertices) doubles a round: integers decide among
    the vertices possibly farthest by a proven bound of rounding. Meshes apart use the vertices of their hulls: O(n + m)
    a round; meeting meshes two facets; a body inside the other, O(m) a connected part of the surface. Meshes apart
    whose hulls meet: a search for a plane, some 1 ms, for each pair of groups of facets looked at. Fields get planes
    beside the nearest item not parted yet: O(items) doubles a plane. For unions apart every pair of parts has a
    certificate: O(k l) searches for k and l parts. Of curved pairs the row's normal and points are tried first, then
    the algebra of docs/curved-signs.md: up to some 0.1 s where bodies touch within rounding.
    """
    shapes_a, shapes_b = (S if isinstance(S, Sequence) else [S] for S in (A, B))
    check_question("certify", shapes_a, shapes_b, r)
    if not isinstance(r, PairResult):
        raise InvalidArgument(f"certify: r must be a PairResult, got {type(r).__name__}")
    X_WA, X_WB = as_poses(X_WA, "X_WA", check=False), as_poses(X_WB, "X_WB", check=False)
    sides = {"A": (A, shapes_a), "B": (B, shapes_b), "X_WA": (X_WA, X_WA), "X_WB": (X_WB, X_WB)}
    for name, (value, batch) in sides.items():
        if len(batch) not in (1, len(r)):
            raise InvalidArgument(f"certify: {len(r)} results, but {name} has {len(batch)}: {brief(value)}")
    questions = (question_of_row((A, B, X_WA, X_WB), k) for k in range(len(r)))
    certificates = [certificate_of_row(*question, row) for question, row in zip(questions, r.rows)]
    return certificates[0] if r.is_single else certificates


def certificate_of_row(A, B, X_WA, X_WB, row) -> Certificates:
    """The certificate of a row of `distance` at poses (1, 4, 4); ``None`` for a pair without a certificate."""
    if row["how"] == UNDECIDED:
        return None
    if (A.is_field or B.is_field) and has_field_certificates(A, B):
        return field_certificate(A, B, X_WA[0], X_WB[0], row)
    if A.is_field or B.is_field:
        return _of_groups(A, B, X_WA[0], X_WB[0], row)
    if A.is_region or B.is_region:
        return make_region_certificate(A, B, X_WA[0], X_WB[0])
    if A.meshed or B.meshed:
        return _of_meshes(ProofBody(A, X_WA[0]), ProofBody(B, X_WB[0]), row) or _of_groups(A, B, X_WA[0], X_WB[0], row)
    parts_a, parts_b = exact_parts(A, X_WA[0]), exact_parts(B, X_WB[0])
    pairs = list(zip(row["vertices_a"].tolist(), row["vertices_b"].tolist()))[: row["count"]]
    i, j = decided = int(row["part_a"]), int(row["part_b"])
    if row["hit"]:
        made = [_of_parts(parts_a[i], parts_b[j], i, j, pairs, row)]
    else:
        made = [
            _of_parts(part_a, part_b, i, j, pairs if (i, j) == decided else [(0, 0)], row)
            for i, part_a in enumerate(parts_a)
            for j, part_b in enumerate(parts_b)
        ]
    certificates = tuple(certificate for certificate in made if certificate is not None)
    return certificates if len(certificates) == len(made) else None


def certificate_from_pairs(A, B, X_WA, X_WB, pairs: Sequence[VertexPair], *, hit: bool) -> tuple[Certificate, ...]:
    """The certificate of a boolean about two convex polytopes, from vertex pairs to begin the exact search with.

    pairs : one to four (vertex of A, vertex of B) near where the bodies meet, or are nearest each other.
    """
    (part_a,), (part_b,) = exact_parts(A, X_WA), exact_parts(B, X_WB)
    return (_of_vertices(part_a, part_b, 0, 0, list(pairs)[:4], hit=hit),)


def certificate_from_normal(A, B, X_WA, X_WB, normal: np.ndarray) -> tuple[Certificate, ...] | None:
    """The certificate "plane" of two convex polytopes from a normal (3,) towards A, its doubles taken exactly; None
    where the plane does not part them.
    """
    whole = in_integers([Fraction(float(c)) for c in normal])
    (part_a,), (part_b,) = exact_parts(A, X_WA), exact_parts(B, X_WB)
    if flaw_of_normal(part_a, part_b, whole) is not None:
        return None
    return (Certificate(PLANE, 0, 0, (whole,)),)


def _of_parts(A: ExactPart, B: ExactPart, i: int, j: int, pairs: list[VertexPair], row) -> Certificate | None:
    """The certificate of what a row says, about part i of A and part j of B; ``None`` where no proof is found."""
    if POINTS in (A.kind, B.kind) and all(part.kind in (POINTS, HALFSPACE) for part in (A, B)):
        return _of_vertices(A, B, i, j, pairs, hit=bool(row["hit"]))
    if row["hit"]:
        point = common_point(A, B, _points_of(row), [-row["normal"]])
        return point and Certificate(POINT, i, j, (point,))
    normal = parting_normal(A, B, [-row["normal"]])
    return normal and Certificate(PLANE, i, j, (normal,))


def _points_of(row) -> list[np.ndarray]:
    """Points near both bodies, where a row has them: the middle of its points, and these."""
    return [0.5 * (row["point_a"] + row["point_b"]), row["point_a"], row["point_b"]]


def _of_vertices(A: ExactPart, B: ExactPart, i: int, j: int, pairs: list[VertexPair], *, hit: bool) -> Certificate:
    kind = TOGETHER if hit else APART
    if HALFSPACE in (A.kind, B.kind):
        return Certificate(kind, i, j, tuple(pairs[:1]))
    if not (pairs and all(0 <= p < len(A) and 0 <= q < len(B) for p, q in pairs)):
        pairs = [(0, 0)]
    if flaw_of_proof(A, B, pairs, hit=hit) is not None:
        pairs = _search(A, B, pairs)
    return Certificate(kind, i, j, tuple(pairs))


def _search(A: ExactPart, B: ExactPart, pairs: Sequence[VertexPair] = ((0, 0),)) -> list[VertexPair]:
    points_a, points_b, _ = common_vertices(A, B)
    return nearest_vertex_pairs(points_a, points_b, pairs)


# --- pairs with a mesh --------------------------------------------------------------------------


def _of_meshes(A: ProofBody, B: ProofBody, row) -> Certificates:
    if not (A.has_certificates and B.has_certificates):
        return None
    if HALFSPACE in (A.kind, B.kind):
        return _of_plane(A, B, bool(row["hit"]))
    return _together(A, B, row) if row["hit"] else _apart(A, B)


def _of_groups(A, B, X_WA: np.ndarray, X_WB: np.ndarray, row) -> Certificates:
    """Planes between groups of items, or a point that two items hold."""
    if not (has_groups(A) and has_groups(B)):
        return None
    a, b, normals = BodyGroups(A, X_WA), BodyGroups(B, X_WB), [-row["normal"]]
    if row["hit"]:
        return meeting(a, b, _points_of(row), normals, (int(row["part_a"]), int(row["part_b"])))
    return parted(a, b, normals)


def _of_plane(A: ProofBody, B: ProofBody, hit: bool) -> Certificates:
    """The vertex nearest the plane: a hit if within the radius of the half-space or inside, else a gap."""
    halfspace, body = (A, B) if A.kind == HALFSPACE else (B, A)
    if body.kind == HALFSPACE:
        return None
    n, _ = halfspace.part().plane
    vertex = body.id_of(body.part().vertices.first_along(in_integers(n)), None)
    pair = (NO_VERTEX, vertex) if halfspace is A else (vertex, NO_VERTEX)
    return (Certificate(TOGETHER if hit else APART, 0, 0, (pair,)),)


def _apart(A: ProofBody, B: ProofBody) -> Certificates:
    """Vertex pairs of an axis between the hulls; ``None`` for meeting hulls."""
    part_a, part_b = A.part(), B.part()
    pairs = _search(part_a, part_b)
    if flaw_of_proof(part_a, part_b, pairs, hit=False) is not None:
        return None
    return (Certificate(APART, 0, 0, tuple((A.id_of(i, None), B.id_of(j, None)) for i, j in pairs)),)


def _together(A: ProofBody, B: ProofBody, row) -> Certificates:
    """Two meeting facets, or a vertex of a body inside the other."""
    facet_a, facet_b = int(row["part_a"]) if A.is_mesh else 0, int(row["part_b"]) if B.is_mesh else 0
    ids_a, ids_b = A.corners(facet_a), B.corners(facet_b)
    part_a, part_b = A.part(ids_a), B.part(ids_b)
    pairs = _search(part_a, part_b)
    if flaw_of_proof(part_a, part_b, pairs, hit=True) is None:
        named = tuple((A.id_of(i, ids_a), B.id_of(j, ids_b)) for i, j in pairs)
        return (Certificate(TOGETHER, facet_a, facet_b, named),)
    for solid, body in ((A, B), (B, A)):
        for vertex in _vertex_of_each_shell(body) if solid.is_solid_mesh else ():
            pair = (vertex, NO_VERTEX) if body is A else (NO_VERTEX, vertex)
            if flaw_of_inside_proof(A, B, (pair,)) is None:
                return (Certificate(INSIDE, 0, 0, (pair,)),)
    return None


def _vertex_of_each_shell(body: ProofBody) -> list[int]:
    """Vertex ids: one of every connected part of the surface."""
    if not body.is_mesh:
        return [0]
    _, first = np.unique(body.shape.survey.shells, return_index=True)
    return body.shape.faces[first, 0].tolist()
