"""Least depths of unions with meshes or half-spaces, and of meshes beside curved shapes, by support functions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import support_gaps
from naive import Case, pose, random_pose, reproducible, rng_of, same_bits, unit
from support_gaps import Convex, first_gaps, sphere_points

import collide

I = np.eye(4)
CURVED = ("cylinder", "cone", "ellipsoid")
CONVEX = ("ball", "capsule", "box", *CURVED)
FAMILIES = ("curved", "meshes", "sheets", "planes", "meshes and planes")
#: Up to so much the oracle's own search of a normal misses [m]; depths are some 0.5 m.
NEAR = 2e-4


def ell(sizes, thick) -> tuple[collide.Mesh, list[Convex]]:
    """An L of a foot along x and a leg along z, as one mesh without inner facets, and as two boxes."""
    (x, y, z), (foot, leg) = sizes, thick
    outline = np.array([(0, 0), (x, 0), (x, foot), (leg, foot), (leg, z), (0, z)], dtype=float)
    vertices = np.concatenate([np.insert(outline, 1, side, axis=1) for side in (0.0, y)])
    front = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    sides = [f for k in range(6) for f in ((k, k + 6, (k + 1) % 6), ((k + 1) % 6, k + 6, (k + 1) % 6 + 6))]
    faces = np.concatenate([front, front[:, ::-1] + 6, sides])
    boxes = [(np.array((x, y, foot)) / 2, I), (np.array((leg, y, z)) / 2, I)]
    return collide.Mesh(vertices, faces), [support_gaps.cuboid(half).at(pose(t=half)) for half, _ in boxes]


def drawn(rng, kind: str) -> tuple[collide.Shape, list[Convex]]:
    """A shape of a kind, and the convex sets that it is made of."""
    r, l, sizes = rng.uniform(0.2, 0.4), rng.uniform(0.3, 1.0), rng.uniform(0.3, 1.0, 3)
    if kind == "mesh" and rng.random() < 0.5:
        return ell(rng.uniform(0.7, 1.3, 3), rng.uniform(0.2, 0.5, 2))
    if kind == "mesh":
        return collide.Mesh(*collide.tessellate(collide.Box(sizes))[:2]), [support_gaps.cuboid(sizes / 2)]
    if kind == "sheet":
        corners = np.array([(0, 0, 0), (sizes[0], 0, 0), (sizes[0], sizes[1], 0), (0, sizes[1], 0)])
        return collide.Mesh(corners, [(0, 1, 2), (0, 2, 3)]), [support_gaps.hull(corners)]
    if kind == "half-space":
        n, offset = unit(rng.normal(size=3)), rng.uniform(-0.6, 0.2)
        return collide.Halfspace(n, offset), [support_gaps.halfspace(n, offset)]
    return {
        "ball": lambda: (collide.Sphere(r), [support_gaps.ball(r)]),
        "capsule": lambda: (collide.Capsule(r, l), [support_gaps.capsule(r, l)]),
        "box": lambda: (collide.Box(sizes), [support_gaps.cuboid(sizes / 2)]),
        "cylinder": lambda: (collide.Cylinder(r, l), [support_gaps.cylinder(r, l)]),
        "cone": lambda: (collide.Cone(r, l), [support_gaps.cone(r, l)]),
        "ellipsoid": lambda: (collide.Ellipsoid(sizes / 2), [support_gaps.ellipsoid(sizes / 2)]),
    }[kind]()


def union_of(rng, kinds) -> tuple[collide.Compound, list[Convex]]:
    items, sets = [], []
    for kind in kinds:
        (shape, of_shape), X = drawn(rng, kind), random_pose(rng, 0.5)
        items.append((shape, X))
        sets += [convex.at(X) for convex in of_shape]
    return collide.Compound(items), sets


def bodies(rng, family: str):
    """Two bodies of a family, and their convex sets."""
    if family == "curved":
        return drawn(rng, "mesh"), drawn(rng, str(rng.choice(CURVED)))
    mesh = ["sheet"] if family == "sheets" else ["mesh"] * ("mesh" in family)
    planes = ["half-space"] * int(rng.integers(1, 3)) * ("planes" in family)
    some = [[str(kind) for kind in rng.choice(CONVEX, rng.integers(1, 3))] for _ in range(2)]
    return union_of(rng, [*some[0], *mesh, *planes]), union_of(rng, [*some[1], *mesh * int(rng.integers(2))])


def overlaps(family: str, n: int, seed: int = 0) -> Iterator[tuple[Case, list[Convex], list[Convex]]]:
    """Cases that collide, in either order, with their sets in the world; of pairs drawn one in four must."""
    rng, n_met = rng_of("least mesh depths", family, seed), 0
    for _ in range(4 * n):
        (A, sets_a), (B, sets_b) = bodies(rng, family)
        case = Case(A, B, random_pose(rng, 0.3), random_pose(rng, 0.4))
        sets_a, sets_b = [s.at(case.X_WA) for s in sets_a], [s.at(case.X_WB) for s in sets_b]
        if rng.random() < 0.5:
            case, sets_a, sets_b = case.swapped(), sets_b, sets_a
        if collide.collide(*case):
            n_met += 1
            yield case, sets_a, sets_b
        if n_met == n:
            return
    raise AssertionError(f"{family}: {n_met} of {4 * n} pairs meet")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("family", FAMILIES)
def test_no_way_out_is_shorter_than_the_lower_bound_and_the_way_given_is_out(family, seed):
    widths, longer, n_refused = [], [], 0
    for case, sets_a, sets_b in overlaps(family, 5, seed):
        with reproducible(case):
            try:
                quick = collide.distance(*case)
            except collide.UnsupportedQuery:  # no way out of half-spaces was found
                n_refused += 1
                continue
            r = collide.distance(*case, depth="least")
            assert quick.lower <= r.lower <= r.distance <= r.upper <= quick.upper <= 0 and r.hit
            shift = -r.lower * r.normal
            assert support_gaps.deepest_pair(sets_a, sets_b, shift) < NEAR, "still together"
            assert not collide.collide(*case.with_b_moved((1e-9 - r.lower) * r.normal))
            U = np.concatenate([sphere_points(600), r.normal[None], r.normal + 0.05 * sphere_points(60)])
            gaps = first_gaps(sets_a, sets_b, U / np.linalg.norm(U, axis=1)[:, None])
            assert -r.upper <= gaps.min() * (1 + 1e-9), "a way out is shorter than the lower bound"
            swapped = collide.distance(*case.swapped(), depth="least")
            assert not same_bits(collide.results.flipped(swapped.rows), r.rows)
            if r.certificate is not None:
                collide.verify(*case, r)
            widths.append(r.lower / min(r.upper, -1e-9))
            longer.append(-r.lower / gaps.min())
    assert len(widths) >= 4 and n_refused <= 1
    assert np.median(widths) < {"planes": 1.002, "sheets": np.inf}.get(family, 1.3)
    assert max(longer) < 1.02 and np.median(longer) < 1 + 1e-3


def block(x: float, y: float, z: float) -> collide.Mesh:
    return collide.Mesh(*collide.tessellate(collide.Box((x, y, z)))[:2])


@pytest.mark.many(3)
@pytest.mark.parametrize(
    "can", [collide.Cylinder(0.2, 0.4), collide.Cone(0.2, 0.4), collide.Ellipsoid((0.2, 0.2, 0.2))], ids=repr
)
def test_what_stands_in_a_table_comes_out_of_its_top(can):
    bottom = 0.2
    case = Case(block(1.0, 1.2, 0.6), can, I, pose(t=(0.05, 0.1, 0.3 + bottom - 0.08)))
    r = collide.distance(*case, depth="least")
    assert 0.08 * (1 - 1e-12) <= -r.lower <= 0.08 * (1 + 2e-3) and 0.08 * 0.85 <= -r.upper <= 0.08 * (1 + 1e-12)
    assert np.linalg.norm(r.normal - (0, 0, 1)) < 0.1
    collide.verify(*case, r)


@pytest.mark.parametrize(
    ("part", "width"), [(block(1.0, 1.0, 1.0), 0.03), (collide.Box((1.0, 1.0, 1.0)), 0.002)], ids=["mesh", "box"]
)
def test_a_union_in_a_corner_of_half_spaces_leaves_both_at_once(part, width):
    corner = collide.Compound([(collide.Halfspace((1, 0, 0), 0.0), I), (collide.Halfspace((0, 0, 1), 0.0), I)])
    body = collide.Compound([(part, I), (collide.Sphere(0.2), pose(t=(0.0, 0.0, 0.6)))])
    case = Case(corner, body, I, pose(t=(0.2, 0.4, 0.3)))
    r = collide.distance(*case, depth="least")
    least = np.hypot(0.3, 0.2)
    assert least * (1 - 1e-12) <= -r.lower <= least * (1 + 2e-3)
    assert least * (1 - width) <= -r.upper <= least * (1 + 1e-12)
    swapped = collide.distance(*case.swapped(), depth="least")
    assert not same_bits(collide.results.flipped(swapped.rows), r.rows)
