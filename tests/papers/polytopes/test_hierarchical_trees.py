"""Hierarchical trees in R^d: answers against the rational simplex and proofs, sets against integers, mutants, gaps."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import rational_simplex

from collide import polytopes
from collide.certificates.certificate import CertificateRefused
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.papers.polytopes import tree_size
from collide.papers.polytopes.boundary_hull import boundary_hull
from collide.papers.polytopes.facet_tree import FacetTree, Sizes
from collide.papers.polytopes.hierarchical_tree import as_grid
from collide.papers.polytopes.tree_walk import extreme_row
from collide.papers.polytopes.validate_facet_tree import validate_facet_tree
from collide.polytopes import (
    HierarchicalTree,
    hull_boundary,
    trees_meet,
    verify_boundary,
    verify_exclusion,
    verify_trees,
)

SMALL = Sizes(0.75, 4, 6)


def _ball(rng, n, d):
    points = rng.normal(size=(n, d))
    return points / np.linalg.norm(points, axis=1)[:, None]


def _pose(rng, d, distance):
    X = np.eye(d + 1)
    X[:d, :d] = np.linalg.qr(rng.normal(size=(d, d)))[0]
    X[:d, d] = distance * _ball(rng, 1, d)[0]
    return X


@pytest.mark.many(2)
@pytest.mark.parametrize("family", ["ball and lattice", "curve"])
@pytest.mark.parametrize("d", [2, 3, 4, 5])
def test_answers_are_those_of_the_rational_simplex(d, family):
    rng = np.random.default_rng([24, d])
    n, hits, cases = {2: 14, 3: 12, 4: 10, 5: 9}[d], 0, 0
    A = np.vstack((_ball(rng, n, d), np.eye(d), -np.eye(d)))
    R = HierarchicalTree(normals=A, offsets=np.ones(len(A)), limits=SMALL)
    for k in range(10):
        if family == "curve":
            V = _curve(n, d)
        else:
            V = rng.integers(-2, 3, (n, d)).astype(float) if k % 2 else _ball(rng, n, d)
        if np.linalg.matrix_rank(V[1:] - V[0]) < d:
            continue
        P = HierarchicalTree(V, limits=SMALL)
        X = _pose(rng, d, rng.uniform(0.5, 3.5))
        moved = [[sum(Fraction(X[i, j]) * Fraction(v[j]) for j in range(d)) + Fraction(X[i, d]) for i in range(d)]
                 for v in V.tolist()]
        wanted = rational_simplex.have_common_point(moved, A, np.ones(len(A)))
        answer = trees_meet(P, R, X)
        assert answer.hit == wanted, f"V = np.array({V.tolist()})\nA = np.array({A.tolist()})\nX = {X.tolist()}"
        verify_trees(V, A, np.ones(len(A)), answer, X)
        hits, cases = hits + wanted, cases + 1
    assert cases >= 6 and 1 <= hits < cases


@pytest.mark.many(2)
@pytest.mark.parametrize(("d", "n"), [(2, 400), (3, 300), (4, 120), (5, 40)])
def test_every_answer_is_proven_and_every_set_recomputed(d, n):
    rng = np.random.default_rng([7, d])
    V, A = _ball(rng, n, d), _ball(rng, n, d)
    P = HierarchicalTree(V, limits=Sizes(0.6, 16, 24))
    R = HierarchicalTree(normals=A, offsets=np.ones(n), limits=Sizes(0.6, 16, 24))
    hits = inside = 0
    for _ in range(12):
        X, Y = _pose(rng, d, rng.uniform(0.0, 2.6)), _pose(rng, d, 0.3)
        answer = trees_meet(P, R, X, Y)
        verify_trees(V, A, np.ones(n), answer, X, Y)
        assert trees_meet(R, P, Y, X, certificate=False).hit == answer.hit
        assert not answer.settled
        hits, inside = hits + answer.hit, inside + (answer.hit and not answer.counters["rounds"])
    assert 3 <= hits <= 11 and inside >= 1
    assert P.tree.n_nodes > 3 and validate_facet_tree(P.tree) > 3
    assert validate_facet_tree(R.tree) >= 1


def _nearly_touching(rng, V, A, d):
    """A pose of the points at which they are 1e-4 from the half-spaces, offsets 1; None where they overlap."""
    X = _pose(rng, d, rng.uniform(1.9, 2.3))
    apart = polytopes.meets(V @ X[:d, :d].T + X[:d, d], A, np.ones(len(A)))
    if apart.hit:
        return None
    X[:d, d] += (apart.distance - 1e-4) * apart.normal
    return X


@pytest.mark.parametrize(("d", "n", "limits"), [
    (2, 200, Sizes(0.6, 12, 12)), (3, 150, Sizes(0.7, 12, 30)), (4, 40, Sizes(0.8, 8, 20)), (5, 20, Sizes(0.8, 6, 14)),
])
def test_planes_of_a_miss_leave_out_the_hull(d, n, limits):
    """O(log n) planes, substituted in fractions by a reader who has checked the boundary once."""
    rng = np.random.default_rng([5, d])
    V, A, b = _ball(rng, n, d) + 0.3, _ball(rng, n, d), np.ones(n)
    P, R = HierarchicalTree(V, limits=limits), HierarchicalTree(normals=A, offsets=b, limits=limits)
    boundary = hull_boundary(P)
    verify_boundary(V, boundary)
    most = misses = needed = 0
    for _ in range(10):
        X = _nearly_touching(rng, V, A, d)
        if X is None:
            continue
        answer = trees_meet(P, R, X, certificate=False)
        proof = answer.exclusion
        assert proof is not None and not answer.hit
        verify_exclusion(boundary, A, b, answer, X)
        misses, most = misses + 1, max(most, len(proof.planes) + len(proof.ray_planes))
        mutants = [
            proof._replace(planes=()), proof._replace(ray_planes=()), proof._replace(ray=tuple(-x for x in proof.ray)),
            proof._replace(outside=(X @ np.append(V.mean(axis=0), 1.0))[:d].tolist()),
            proof._replace(planes=(proof.planes[0]._replace(multipliers=(-1.0,) * len(proof.planes[0].rows)),)),
        ]
        for mutant in mutants:
            with pytest.raises(CertificateRefused):
                verify_exclusion(boundary, A, b, polytopes.TreeMeeting(False, False, None, mutant, {}), X)
        for k in range(len(proof.planes)):
            mutant = proof._replace(planes=proof.planes[:k] + proof.planes[k + 1 :])
            try:
                verify_exclusion(boundary, A, b, polytopes.TreeMeeting(False, False, None, mutant, {}), X)
            except CertificateRefused:
                needed += 1
        u = np.array([np.array(plane.multipliers) @ A[list(plane.rows)] for plane in proof.planes])
        c = np.array([np.array(plane.multipliers) @ b[list(plane.rows)] for plane in proof.planes])
        assert not polytopes.meets(V @ X[:d, :d].T + X[:d, d], u, c).hit
    assert misses >= 4 and needed >= 1 and 2 <= most <= 24, (misses, needed, most)


def test_a_boundary_that_is_none_is_refused():
    rng = np.random.default_rng(2)
    V = _ball(rng, 40, 3)
    boundary = hull_boundary(HierarchicalTree(V))
    verify_boundary(V, boundary)
    grid = np.array(np.meshgrid(*[np.arange(3.0)] * 3)).reshape(3, -1).T
    verify_boundary(grid, hull_boundary(HierarchicalTree(grid)))  # flat faces in several simplices
    facets, whole = boundary.facets, boundary.whole.copy()
    whole[0] += 3
    for mutant, reason in (
        (boundary._replace(facets=facets[1:]), "nothing beyond it"),
        (boundary._replace(facets=np.concatenate((facets, facets[:1]))), "in others too"),
        (boundary._replace(facets=np.concatenate((facets, [[0, 1, 2]]))), "both sides|flat"),
        (boundary._replace(whole=whole), "a unit from its place"),
    ):
        with pytest.raises(CertificateRefused, match=reason):
            verify_boundary(V, mutant)


# --- whole trees ------------------------------------------------------------------------------------------------------


def _curve(n, d):
    t = np.linspace(-1.0, 1.0, n)
    return np.stack([t**k for k in range(1, d + 1)], axis=1)


def _lattice(n, d):
    k = math.ceil(n ** (1.0 / d)) // 2 + 2
    grid = np.array(np.meshgrid(*[np.arange(-k, k + 1.0)] * d)).reshape(d, -1).T
    return grid[np.argsort((grid * grid).sum(axis=1), kind="stable")[:n]]


WHOLE = [
    ("ball", 2, 300, Sizes(0.5, 10, 20)), ("curve", 2, 300, Sizes(0.5, 10, 20)),
    ("lattice", 2, 4000, Sizes(0.6, 10, 16)),
    ("ball", 3, 120, Sizes(0.7, 16, 60)), ("curve", 3, 120, Sizes(0.7, 16, 60)),
    ("lattice", 3, 2000, Sizes(0.7, 16, 60)),
    ("ball", 4, 100, Sizes(0.8, 24, 80)), ("ball", 5, 50, Sizes(0.9, 14, 48)),
]


@pytest.mark.many(3)
@pytest.mark.parametrize(("family", "d", "n", "limits"), WHOLE)
def test_whole_trees_are_validated_and_their_bytes_were_predicted(family, d, n, limits):
    rng = np.random.default_rng([n, d, 0])
    points = _ball(rng, n, d) if family == "ball" else {"curve": _curve, "lattice": _lattice}[family](n, d)
    body = HierarchicalTree(points, whole=True, limits=limits)
    size = body.size
    assert validate_facet_tree(body.tree, whole=True) == size.nodes
    assert body.predicted is not None
    assert family == "lattice" or body.predicted.simplices == pytest.approx(size.simplices, rel=0.1)
    assert size.n_bytes / 4 <= body.predicted.n_bytes <= 4 * size.n_bytes, (body.predicted, size)
    assert size.depth >= 2
    assert body.build() == size  # nothing is made twice
    with pytest.raises(UnsupportedQuery, match=f"predicted to take {body.predicted.n_bytes:,} bytes"):
        HierarchicalTree(points, whole=True, limits=limits, memory=body.predicted.n_bytes - 1)


def test_the_polar_side_is_validated_and_answers_are_those_of_nodes_made_when_needed():
    rng = np.random.default_rng(6)
    limits, A, V = Sizes(0.7, 12, 50), _ball(rng, 120, 3), _ball(rng, 120, 3)
    R = HierarchicalTree(normals=A, offsets=np.ones(120), limits=limits, whole=True)
    P = HierarchicalTree(V, limits=limits, whole=True)
    assert validate_facet_tree(R.tree, whole=True) == R.size.nodes > 20
    before, hits = (P.size, R.size), 0
    for _ in range(20):
        X = _pose(rng, 3, rng.uniform(1.5, 2.4))
        answer = trees_meet(P, R, X)
        verify_trees(V, A, np.ones(120), answer, X)
        hits += answer.hit
    assert 4 <= hits <= 16 and (P.size, R.size) == before


@pytest.mark.slow
def test_sizes_are_predicted_from_a_sample(monkeypatch):
    """A boundary of a million simplices is told from samples of 60 and 120 points, and refused unseen."""
    monkeypatch.setattr(tree_size, "_LARGE_MODEL", 3000)
    curve, limits = _curve(1500, 4), Sizes(0.5, 200, 1000)
    assert tree_size.predicted_simplices(as_grid(curve).whole) == pytest.approx(1500 * 1497 // 2, rel=0.05)
    with pytest.raises(UnsupportedQuery, match=r"boundary is predicted to have 1,[0-9,]* simplices, [0-9,]* bytes"):
        HierarchicalTree(curve, memory=1 << 27, limits=limits)
    with pytest.raises(UnsupportedQuery, match=r"whole tree is predicted to take [0-9,]* bytes"):
        HierarchicalTree(curve, memory=1 << 27, whole=True, limits=limits)
    with pytest.raises(UnsupportedQuery, match=r"after .* of 1,500 points the boundary has"):
        FacetTree(as_grid(curve).whole, 1 << 19, limits)
    assert [tree_size.max_simplices(n, d) for d, n in ((2, 9), (3, 9), (4, 9), (4, 5), (5, 6))] == [9, 14, 27, 5, 6]


def test_touching_is_a_hit_and_is_settled_in_integers():
    cube = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    A, b = np.vstack((np.eye(3), -np.eye(3))), np.array([1.0, 1, 1, 0, 0, 0])
    P, R = HierarchicalTree(cube), HierarchicalTree(normals=A, offsets=b)
    X = np.eye(4)
    for shift, hit in ((1.0, True), (np.nextafter(1.0, 2.0), False), (np.nextafter(1.0, 0.0), True)):
        X[0, 3] = shift
        answer = trees_meet(P, R, X)
        assert answer.hit is hit and answer.settled
        verify_trees(cube, A, b, answer, X)


def test_extreme_rows_are_those_of_all():
    rng = np.random.default_rng(3)
    for d, n in ((2, 2000), (3, 800), (4, 120)):
        tree = HierarchicalTree(_ball(rng, n, d)).tree
        for _ in range(12):
            g = rng.normal(size=d)
            found = extreme_row(tree, g)
            assert found is not None
            assert tree.points[found[0]] @ g == pytest.approx((tree.points @ g).max(), rel=1e-12)


# --- hulls ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("d", [2, 3, 4, 5])
def test_boundary_covers_lattices_and_balls(d):
    rng = np.random.default_rng(d)
    grid = np.array(np.meshgrid(*[np.arange(3.0)] * d)).reshape(d, -1).T
    for points in (rng.permutation(grid), np.rint(_ball(rng, 40, d) * 2**40)):
        hull = boundary_hull(points)
        assert hull is not None
        heights = points @ hull.planes[:, :d].T - hull.planes[:, d]
        assert heights.max() <= 1e-9 * np.abs(points).max()
        ridges = np.concatenate([np.delete(hull.facets, k, axis=1) for k in range(d)])
        assert (np.unique(ridges, axis=0, return_counts=True)[1] == 2).all()
        # A covering has the volume of the body: 2^d for the lattice.
        centre = points.mean(axis=0)
        volume = np.abs(np.linalg.det(points[hull.facets] - centre)).sum() / np.prod(np.arange(1.0, d + 1))
        if points.max() == 2.0:
            assert volume == pytest.approx(2.0**d)
    assert boundary_hull(np.column_stack((grid[:, :-1], grid[:, 0]))) is None


# --- where the text fails ---------------------------------------------------------------------------------------------


def test_a_region_inside_the_hull_meets_no_face_of_it():
    """"P meets R if and only if a face of F* meets R" is false for nested bodies: the rounds for the origin answer."""
    rng = np.random.default_rng(1)
    V = _ball(rng, 60, 2)
    V = V[np.argsort(np.arctan2(V[:, 1], V[:, 0]))]
    A, b = np.vstack((np.eye(2), -np.eye(2))), np.full(4, 1e-3)
    P, R = HierarchicalTree(V, limits=Sizes(0.9, 2, 2)), HierarchicalTree(normals=A, offsets=b)
    nested = 0
    for _ in range(20):
        X = np.eye(3)
        X[:2, 2] = rng.uniform(0.5, 0.99) * _ball(rng, 1, 2)[0]
        answer = trees_meet(P, R, X)
        moved = V + X[:2, 2]
        meets_a_face = any(polytopes.meets(moved[[k, k - 1]], A, b).hit for k in range(len(V)))
        if answer.hit and not meets_a_face:
            nested += 1
            assert answer.counters["rounds"] == 0 and answer.counters["origin_rounds"] >= 1
        verify_trees(V, A, b, answer, X)
    assert nested > 5


def test_the_hull_of_the_faces_left_does_not_stand_in_for_the_body():
    """Nor does CH(F*): after two planes the arc between them has no point near their crossing in its hull."""
    t = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    P = np.column_stack((np.cos(t), np.sin(t)))
    planes = np.array([[0.0, -1.0], [1.0, 0.0]])  # R beyond both: y ≥ 0 and x ≤ 0, near the origin
    left = []
    for k in range(64):
        edge = P[[k, (k + 1) % 64]]
        if all((edge @ plane < 0.0).any() for plane in planes):  # a corner beyond each plane
            left.extend(edge)
    r, box = np.array([-0.01, 0.01]), np.vstack((np.eye(2), -np.eye(2)))
    offsets = np.concatenate((r + 1e-3, 1e-3 - r))
    assert polytopes.meets(P, box, offsets).hit and not polytopes.meets(np.array(left), box, offsets).hit


def test_planes_that_leave_out_every_face_may_hold_a_point_of_the_hull():
    P = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    S, b = np.vstack((np.eye(2), -np.eye(2))), np.full(4, 0.5)
    for k in range(4):
        edge = P[[k, (k + 1) % 4]]
        assert any((edge @ a > c).all() for a, c in zip(S, b))
    assert polytopes.meets(P, S, b).hit


# --- mutants, refusals ------------------------------------------------------------------------------------------------


def test_mutants_are_noticed():
    rng = np.random.default_rng(9)
    V, A = _ball(rng, 300, 3), _ball(rng, 50, 3)
    P = HierarchicalTree(V, limits=Sizes(0.6, 24, 40))
    R = HierarchicalTree(normals=A, offsets=np.ones(50), limits=Sizes(0.6, 24, 40))
    X = _pose(rng, 3, 2.02)
    answer = trees_meet(P, R, X)
    child = next(node for node in P.tree.root.children.values() if node is not None)
    for name in ("facets", "rows", "n_facets", "depth"):
        value = getattr(child, name)
        if len(np.atleast_1d(value)):
            setattr(child, name, value[1:] if isinstance(value, np.ndarray) else value + 1)
            with pytest.raises(AssertionError):
                validate_facet_tree(P.tree)
            setattr(child, name, value)
    validate_facet_tree(P.tree)
    proof = answer.certificate
    assert proof is not None
    numbers = "weights" if answer.hit else "multipliers"
    changed = (-getattr(proof, numbers)[0], *getattr(proof, numbers)[1:])
    forged = polytopes.TreeMeeting(answer.hit, False, proof._replace(**{numbers: changed}), None, {})
    with pytest.raises(CertificateRefused):
        verify_trees(V, A, np.ones(50), forged, X)
    with pytest.raises(CertificateRefused):
        verify_trees(V, A, np.ones(50), polytopes.TreeMeeting(not answer.hit, False, proof, None, {}), X)


def test_refusals_say_what_to_do():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    P = HierarchicalTree(square)
    with pytest.raises(UnsupportedQuery, match="flat"):
        HierarchicalTree(np.column_stack((square, square[:, 0])))
    with pytest.raises(UnsupportedQuery, match="memory=100"):
        HierarchicalTree(square, memory=100)
    with pytest.raises(InvalidArgument, match="half-spaces"):
        trees_meet(P, P)
    with pytest.raises(InvalidArgument, match="either points"):
        HierarchicalTree()
    R = HierarchicalTree(normals=np.vstack((np.eye(2), -np.eye(2))), offsets=np.ones(4))
    with pytest.raises(InvalidPose, match="determinant 0"):
        trees_meet(P, R, np.eye(3), np.diag([1.0, 0.0, 1.0]))
    with pytest.raises(InvalidPose, match="must be a finite"):
        trees_meet(P, R, np.full((3, 3), np.nan))
