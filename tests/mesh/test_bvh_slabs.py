"""Slabs of a tree's boxes: they hold what their boxes hold, by fractions, and are as thin as their normals allow."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_families import grid, soup
from mesh_shapes import box, bumpy_sphere
from naive import rng_of

from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import SLAB, WIDTH, MeshTree
from collide.mesh.bvh_slabs import make_slabs
from collide.mesh.fine_boxes import with_origins

FAMILIES = {
    "box": lambda rng: box(), "sphere": lambda rng: bumpy_sphere(200), "soup": lambda rng: soup(rng, 60),
    "without area": lambda rng: (rng.normal(size=(30, 3)), np.repeat(rng.integers(0, 30, (40, 1)), 3, axis=1)),
    "grid": lambda rng: grid(rng, 60),
    "flat": lambda rng: (rng.normal(size=(90, 2)) @ [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]], soup(rng, 30)[1]),
    "tiny and far": lambda rng: (bumpy_sphere(100)[0] * 1e-9 + 1.0, bumpy_sphere(100)[1]),
}


def below(tree: MeshTree, link: int) -> list[int]:
    if link < 0:
        return list(range(~link >> 3, (~link >> 3) + (~link & 7)))
    return [k for slot in np.flatnonzero(tree.used()[link]) for k in below(tree, int(tree.links()[link, slot]))]


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("make", [lambda tree: tree, with_origins], ids=["plain", "origins"])
def test_slabs_hold_their_facets_and_little_more(family, make):
    vertices, faces = FAMILIES[family](rng_of("slabs", family))
    tree = make(build_mesh_tree(vertices, faces))
    slabs = make_slabs(tree)
    assert slabs.shape == (len(tree.nodes), SLAB) and slabs.dtype == np.float32
    unit, centre = Fraction(2) ** tree.exponent, [Fraction(x) for x in tree.centre.tolist()]
    thinner = 0
    for node, slot in zip(*np.nonzero(tree.used())):
        facets = below(tree, int(tree.links()[node, slot]))
        corners = tree.triangles[facets].reshape(-1, 3)
        *n, middle, half = (Fraction(float(slabs[node, WIDTH * k + slot])) for k in range(5))
        origin = [Fraction(x) for x in tree.origins()[node].tolist()]
        heights = [
            sum(a * ((Fraction(x) - c) / unit - o) for a, x, c, o in zip(n, point, centre, origin))
            for point in corners.tolist()
        ]
        assert max(abs(h - middle) for h in heights) <= half, (family, node, slot)
        spread = (max(heights) - min(heights)) / 2
        assert half <= spread * (1 + Fraction(1, 10**6)) + Fraction(1, 10**6), (family, node, slot)
        assert float(sum(a * a for a in n)) == pytest.approx(1.0, abs=1e-6)
        total = np.cross(*(tree.triangles[facets].reshape(-1, 3, 3)[:, k] - corners[::3] for k in (1, 2))).sum(axis=0)
        length = np.linalg.norm(total)
        if length > 1e-6 * unit**2:
            assert np.allclose([float(a) for a in n], total / length, atol=1e-5), (family, node, slot)
        box_reach = sum(tree.boxes()[1][node, slot] * np.abs([float(a) for a in n]))
        thinner += float(half) < 0.5 * box_reach
    assert not slabs.reshape(-1, 5, WIDTH).transpose(0, 2, 1)[~tree.used()].any(), "unused slots"
    if family in ("sphere", "flat", "tiny and far"):
        assert thinner > 5


def test_slabs_are_made_once_and_kept_with_the_tree():
    tree, calls = build_mesh_tree(*bumpy_sphere(50)), []
    for _ in range(2):
        tree.need_slabs(lambda t: calls.append(t) or make_slabs(t))
    assert calls == [tree]
