"""Arguments of questions about surfaces: vectors, lengths of batches, bodies of facets; what is none is named."""

from __future__ import annotations

import numpy as np
import pytest

from collide import Box, Capsule, ConvexHull, InvalidArgument, InvalidPose, Mesh, Sphere, UnsupportedQuery
from collide.base.argument_checks import matched_count, refuse_rows, vectors
from collide.surface_queries.checked_arguments import two_bodies

EYE = np.eye(4)
MESH = Mesh(np.eye(3), [[0, 1, 2]], solid=False)


@pytest.mark.parametrize(
    ("values", "count", "single"),
    [((1, 2, 3), 1, True), ([[1, 2, 3]], 1, False), (np.zeros((4, 3)), 4, False), (np.zeros((0, 3)), 0, False)],
)
def test_vectors(values, count, single):
    rows, is_single = vectors("ask", "points", values)
    assert rows.shape == (count, 3) and rows.dtype == np.float64 and is_single is single and rows.flags.c_contiguous
    assert np.array_equal(rows, np.reshape(values, (-1, 3)))


@pytest.mark.parametrize(
    ("values", "words"),
    [((1, 2), r"ask: points must be \(3,\) or \(N, 3\), got \(2,\)"), (np.zeros((2, 2, 3)), r"\(2, 2, 3\)"),
     ([[0, 0, 0], [0, np.nan, 0]], r"points\[1\] has entries that are not finite, got \[0.0, nan, 0.0\]"),
     ("abc", "points"), ([[0, 0, np.inf]], r"points\[0\]")],
)
def test_what_is_no_vector(values, words):
    with pytest.raises(InvalidArgument, match=words):
        vectors("ask", "points", values)


def test_the_first_bad_row_is_named():
    rows = np.arange(9.0).reshape(3, 3)
    refuse_rows("ask", "d", rows, np.zeros(3, dtype=bool), "is bad")
    with pytest.raises(InvalidArgument, match=r"ask: d\[1\] is bad, got \[3.0, 4.0, 5.0\]"):
        refuse_rows("ask", "d", rows, np.array([False, True, True]), "is bad")


@pytest.mark.parametrize(
    ("counts", "n"), [((1, 1), 1), ((5, 1), 5), ((5, 5), 5), ((1, 0), 0), ((0, 0), 0), ((5, 3), None), ((0, 2), None)]
)
def test_lengths_of_batches(counts, n):
    if n is None:
        with pytest.raises(InvalidArgument, match=f"lengths do not match: a {counts[0]}, b {counts[1]};"):
            matched_count("ask", a=counts[0], b=counts[1])
    else:
        assert matched_count("ask", a=counts[0], b=counts[1]) == n


def test_two_bodies_of_facets():
    hull = ConvexHull(np.eye(3))
    for A, B in ((MESH, MESH), (Box((1, 1, 1)), MESH), (MESH, hull)):
        body_a, body_b, X_WA, X_WB = two_bodies("ask", A, B, EYE, np.stack([EYE] * 3), True)
        assert X_WA.shape == X_WB.shape == (3, 4, 4) and X_WA.flags.c_contiguous
        assert len(body_a.tree.ids) == (12 if A is not MESH else 1) and len(body_b.tree.ids) >= 1
    with pytest.raises(InvalidArgument, match="Box and ConvexHull: one of them at least must be a Mesh"):
        two_bodies("ask", Box((1, 1, 1)), hull, EYE, EYE, True)
    for shape in (Sphere(1.0), Capsule(0.1, 1.0)):
        with pytest.raises(UnsupportedQuery, match=type(shape).__name__):
            two_bodies("ask", MESH, shape, EYE, EYE, True)
    with pytest.raises(InvalidPose, match="X_WB"):
        two_bodies("ask", MESH, MESH, EYE, 2 * EYE, True)
    with pytest.raises(InvalidArgument, match="lengths do not match"):
        two_bodies("ask", MESH, MESH, np.stack([EYE] * 2), np.stack([EYE] * 3), True)
