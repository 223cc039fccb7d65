"""Whether certificates of pairs with a mesh prove what they claim. Every vertex in use is looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from collide.certificates.body_groups import flaw_of_group_certificates
from collide.certificates.certificate import (
    APART,
    INSIDE,
    NO_VERTEX,
    PLANE,
    POINT,
    TOGETHER,
    Certificate,
    VertexPair,
)
from collide.certificates.convex_proofs import flaw_of_plane_proof, flaw_of_proof
from collide.certificates.exact_parts import IDENTITY, ExactPart, exact_part, has_exact_numbers
from collide.certificates.winding_number import winding_number_around
from collide.lowering.convex_sets import HALFSPACE, POINTS, sets_of
from collide.numerics.exact_points import PlacedPoints


class ProofBody:
    """A mesh or a convex shape at a pose: its vertices by id, its facets.

    is_mesh : ``False`` for a convex shape, read as a single facet.
    has_certificates : whether proofs by vertices are of the body: exact numbers, no union, no curved part.
    vertex_ids : ascending, of the vertices used by facets; ``None`` for a convex shape, where all are used.
    """

    def __init__(self, shape, X: np.ndarray):
        self.shape, self.X = shape, X
        self.is_mesh = bool(shape.meshed and hasattr(shape, "faces"))
        self.kind, self.has_certificates = POINTS, False
        self.vertex_ids: np.ndarray | None = None
        self._part: ExactPart | None = None
        if self.is_mesh:
            self.vertex_ids, self.has_certificates = np.flatnonzero(np.bincount(shape.faces.ravel())), True
            return
        parts = [] if shape.meshed else sets_of(shape)
        if parts:
            first, X_BP = parts[0]
            part = exact_part(first, X)
            self.kind, self._part = first.kind, part
            is_plain = len(parts) == 1 and np.array_equal(X_BP, IDENTITY) and first.slop == 0.0
            self.has_certificates = is_plain and has_exact_numbers(part)

    def part(self, ids: Sequence[int] | np.ndarray | None = None) -> ExactPart:
        """The hull of all vertices in use, or of those of these ids, in this order; a convex shape whole."""
        if self._part is not None:
            return self._part
        ids = self.vertex_ids if ids is None else ids
        return ExactPart(POINTS, self.shape.vertices[np.asarray(ids)], 0.0, None, self.X, IDENTITY)

    @property
    def n_facets(self) -> int:
        return len(self.shape.faces) if self.is_mesh else 1

    def corners(self, facet: int) -> list[int] | None:
        """Vertex ids of a facet; None for a convex shape."""
        return self.shape.faces[facet].tolist() if self.is_mesh else None

    def has_vertex(self, vertex: int) -> bool:
        """Whether an id is one of a vertex in use."""
        if self.vertex_ids is None:
            return self.kind == POINTS and 0 <= vertex < len(self.part())
        return 0 <= vertex < len(self.shape.vertices) and vertex in self.vertex_ids

    def id_of(self, index: int, ids: Sequence[int] | np.ndarray | None) -> int:
        """The vertex id of a point of ``part(ids)``."""
        ids = self.vertex_ids if ids is None else ids
        return index if ids is None else int(ids[index])

    def indices_of(self, vertices: Sequence[int]) -> list[int]:
        """Indices of vertex ids among the points of ``part()``; −1 for unknown or unused ids."""
        if self.vertex_ids is None:
            return list(vertices)
        places = {int(v): k for k, v in enumerate(self.vertex_ids)}
        return [places.get(v, -1) for v in vertices]

    @property
    def is_solid_mesh(self) -> bool:
        return self.is_mesh and bool(self.shape.solid)


def flaw_of_mesh_certificates(A, B, X_WA, X_WB, certificates: Sequence[Certificate], claim: str) -> str | None:
    """Why certificates do not prove a claim, "together" or "apart", of two shapes, a mesh among them.

    None where they do.
    """
    if {certificate.kind for certificate in certificates} <= {PLANE, POINT} and certificates:
        return flaw_of_group_certificates(A, B, X_WA, X_WB, certificates, claim)
    body_a, body_b = ProofBody(A, X_WA), ProofBody(B, X_WB)
    if not (body_a.has_certificates and body_b.has_certificates):
        return "these shapes have certificates of planes, or of a point, alone"
    if len(certificates) != 1:
        return f"one certificate is needed, not {len(certificates)}"
    kind, facet_a, facet_b, pairs = certificates[0]
    if (kind == APART) != (claim == APART):
        return f"the result says {claim}, the certificate {kind!r}"
    if kind == INSIDE:
        return flaw_of_inside_proof(body_a, body_b, pairs)
    if kind not in (APART, TOGETHER):
        return f"there is no kind {kind!r}"
    for body, facet, name in ((body_a, facet_a, "A"), (body_b, facet_b, "B")):
        if not 0 <= facet < body.n_facets:
            return f"{name} has no facet {facet}"
    if HALFSPACE in (body_a.kind, body_b.kind):
        indices = _index_pairs(body_a, body_b, pairs)
        return flaw_of_plane_proof(body_a.part(), body_b.part(), indices, hit=kind == TOGETHER)
    if kind == APART:
        return _flaw_of_axis(body_a, body_b, pairs)
    return _flaw_of_facets(body_a, body_b, facet_a, facet_b, pairs)


def _flaw_of_axis(A: ProofBody, B: ProofBody, pairs: Sequence[VertexPair]) -> str | None:
    indices = _index_pairs(A, B, pairs)
    if not 1 <= len(indices) <= 4:
        return f"one to four vertex pairs are needed, not {len(indices)}"
    if any(k < 0 for pair in indices for k in pair):
        return "a vertex named is none, or is in no facet"
    return flaw_of_proof(A.part(), B.part(), indices, hit=False)


def _flaw_of_facets(A: ProofBody, B: ProofBody, facet_a: int, facet_b: int, pairs: Sequence[VertexPair]) -> str | None:
    """Of a proof that two facets meet."""
    corners_a, corners_b = A.corners(facet_a), B.corners(facet_b)
    indices = []
    for pair in pairs:
        for vertex, corners in zip(pair, (corners_a, corners_b)):
            if corners is not None and vertex not in corners:
                return f"vertex {vertex} is no corner of the facet named"
        i, j = (v if corners is None else corners.index(v) for v, corners in zip(pair, (corners_a, corners_b)))
        indices.append((i, j))
    return flaw_of_proof(A.part(corners_a), B.part(corners_b), indices, hit=True)


def _index_pairs(A: ProofBody, B: ProofBody, pairs: Sequence[VertexPair]) -> list[VertexPair]:
    """Vertex ids as places among the points of ``part()``."""
    return list(zip(A.indices_of([i for i, _ in pairs]), B.indices_of([j for _, j in pairs])))


def flaw_of_inside_proof(A: ProofBody, B: ProofBody, pairs: Sequence[VertexPair]) -> str | None:
    """The flaw of a proof of a vertex of A or B inside the other body, a solid mesh: O(facets)."""
    if len(pairs) != 1 or sum(k == NO_VERTEX for k in pairs[0]) != 1:
        return "one vertex of one body is needed, and −1 for the other"
    i, j = pairs[0]
    solid, body, vertex = (A, B, j) if i == NO_VERTEX else (B, A, i)
    if not solid.is_solid_mesh:
        return "the other body is no solid mesh"
    if not body.has_vertex(vertex):
        return f"there is no vertex {vertex}"
    points = body.part([vertex] if body.is_mesh else None).vertices
    vertices = PlacedPoints(solid.shape.vertices, [solid.X])
    number = winding_number_around(0 if body.is_mesh else vertex, points, vertices, solid.shape.faces)
    if number is not None and number > 0:
        return None
    return f"vertex {vertex} does not lie in the solid"
