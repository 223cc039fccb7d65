"""Gaps of meshes and cylinders, cones, ellipsoids: the kernel's rows are those of the search in rounds, and hold."""

from __future__ import annotations

from collections import Counter

import curved_oracle
import naive
import numpy as np
import pytest
import surfaces
from naive import Case, random_pose, rng_of

import collide
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import as_given, body_of
from collide.narrowphase.facets.mesh_curved import _nearest_by_rounds
from collide.narrowphase.facets.nearest_item_calls import facets_of, gap_rows
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe

KINDS = ("cylinder", "cone", "ellipsoid")


def mesh(rng) -> collide.Mesh:
    if rng.random() < 0.3:
        return collide.Mesh(*surfaces.box())
    body = collide.Ellipsoid(rng.uniform(0.5, 1.5, 3)) if rng.random() < 0.5 else collide.Cone(1.0, 2.0)
    vertices, faces = collide.tessellate(body, tolerance=0.05)
    return collide.Mesh(vertices, faces, solid=bool(rng.random() < 0.7))


def shape(kind: str, rng) -> collide.Shape:
    a, b, c = rng.uniform(0.1, 0.6, 3)
    if kind == "ellipsoid":
        return collide.Ellipsoid((a, b, c))
    return collide.Cylinder(a, b) if kind == "cylinder" else collide.Cone(a, b)


def drawn(kind: str, rng) -> Case:
    X_WB = random_pose(rng, float(rng.choice([0.3, 1.0, 3.0])))
    return Case(mesh(rng), shape(kind, rng), random_pose(rng, 0.5), X_WB)


@pytest.mark.parametrize("kind", KINDS)
def test_as_the_search_in_rounds(kind):
    """Bits of the other search, from whatever facet that begins; brackets by decimals of 80 digits."""
    rng, seen = rng_of("curved gaps", kind), Counter()
    for k in range(30):
        case = drawn(kind, rng)
        A, E = body_of(case.A), enclosure_of(case.B)
        X_WA, X_WB = case.X_WA[None], case.X_WB[None]
        with naive.reproducible(case):
            rows, is_written = gap_rows(facets_of(A), E.packed, X_WA, X_WB)
            seen["asked"] += 1
            if not is_written[0]:
                assert collide.collide(*case), "apart, and left to the long way"
                continue
            seen["written"] += 1
            first = np.array([rng.integers(len(A.tree.ids))])
            other = _nearest_by_rounds(A, E, as_given(X_WA), as_given(X_WB), first)
            for name in ("distance", "lower", "upper", "normal", "point_a", "point_b", "part_a", "certified"):
                assert (rows[name] == other[name]).all(), name
            if k < 6:
                truth = curved_oracle.bracket(*case)
                if truth.lower > 0:  # else the shape is inside the solid
                    seen["judged"] += 1
                    assert rows["lower"][0] <= truth.upper and truth.lower <= rows["upper"][0]
    assert seen["written"] > 0.4 * seen["asked"] and seen["judged"] >= 2, seen


@pytest.mark.parametrize("kind", KINDS)
def test_single_gaps_are_those_of_batches(kind):
    """Both orders, prepared or not, signed or not, with a margin; shapes within solids and within surfaces."""
    rng, seen = rng_of("single curved gaps", kind), Counter()
    for k in range(24):
        case = drawn(kind, rng)
        if k % 4 == 0:  # small, and inside
            case = case._replace(B=collide.Ellipsoid((0.02, 0.03, 0.04)), X_WB=case.X_WA)
        A, B, X, Y = case
        with naive.reproducible(case):
            batch = collide.distance(A, B, X[None], Y[None], signed=False)
            hit = bool(collide.collide(A, B, X[None], Y[None])[0])
            assert hit == bool(batch.hit[0])
            for _ in range(2):  # the second time prepared
                single = collide.distance(A, B, X, Y, signed=False)
                assert single.rows.tobytes() == batch.rows.tobytes()
                swapped = collide.distance(B, A, Y, X, signed=False)
                assert swapped.distance == single.distance and (swapped.normal == 0.0 - single.normal).all()
                assert (swapped.point_a == single.point_b).all() and swapped.part_b == single.part_a
                assert collide.collide(A, B, X, Y) is hit and collide.collide(B, A, Y, X) is hit
                for margin in (0.1, 1.0):
                    told = bool(collide.collide(A, B, X[None], Y[None], security_margin=margin)[0])
                    assert collide.collide(A, B, X, Y, security_margin=margin) is told
            if k % 4 == 0:
                assert hit == A.solid
                seen["inside"] += hit
            seen["apart"] += not hit
            if single_calls_are_safe() and not hit:
                assert prepared_pair(A, B).collide(X, Y) is False
                assert prepared_pair(B, A).collide(Y, X) is False
    assert seen["apart"] >= 8 and seen["inside"] >= 2, seen


def test_matrices_off_a_rotation_are_left_to_the_search_in_rounds():
    ball, X, Y = collide.Mesh(*surfaces.box()), np.eye(4), collide.pose((3.0, 0.1, 0.2))
    E = enclosure_of(collide.Cylinder(0.3, 1.0))
    Y[:3, :3] *= 1.0 + 1e-6
    items = facets_of(body_of(ball))
    _, is_written = gap_rows(items, E.packed, np.repeat(X[None], 2, axis=0), np.array([Y, collide.pose((3, 0, 0))]))
    assert is_written.tolist() == [True, True], "the shape's own matrix is taken as it is"
    _, is_written = gap_rows(items, E.packed, Y[None], X[None] @ collide.pose((9, 0, 0))[None])
    assert is_written.tolist() == [False]
    r = collide.distance(ball, collide.Cylinder(0.3, 1.0), Y, collide.pose((9, 0, 0)), check_poses=False)
    assert r.lower <= r.distance <= r.upper and r.distance > 4.0
