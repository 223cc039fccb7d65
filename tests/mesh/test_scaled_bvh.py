"""Trees of scaled copies: all that a tree promises, the same nodes, hardly larger boxes, the same answers."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_families import grid, soup
from mesh_shapes import bumpy_sphere
from naive import pose, rng_of, rotation
from validate_bvh import validate_mesh_tree

from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.scaled_bvh import scaled_tree
from collide.narrowphase.facets.facet_queries import all_hits

FACTORS = (0.1, 1 / 3, 0.999, 1.0000000001, 7.3, 1e-12, 1e12, 2.0, 2.0**-30)


@pytest.mark.parametrize("factor", FACTORS)
def test_scaled_trees_are_trees_of_the_scaled_mesh(factor):
    rng = rng_of("scaled trees", factor)
    far = bumpy_sphere(90)[0] + 1e3, bumpy_sphere(90)[1]
    for vertices, faces in (bumpy_sphere(300), soup(rng, 80), grid(rng, 80), far):
        tree = build_mesh_tree(vertices, faces)
        scaled = vertices * factor
        made = scaled_tree(tree, scaled, faces, factor)
        validate_mesh_tree(made, scaled, faces)
        assert np.array_equal(made.ids, tree.ids) and np.array_equal(made.links(), tree.links())
        before, after = tree.boxes()[1][tree.used()], made.boxes()[1][tree.used()]
        lengths = (before * np.ldexp(1.0, tree.exponent) * factor, after * np.ldexp(1.0, made.exponent))
        assert (lengths[1] >= lengths[0] * (1 - 1e-15)).all()
        slack = 1e-6 * lengths[0].max()
        assert (lengths[1] <= lengths[0] * (1 + 1e-6) + slack).all()
        if np.log2(factor).is_integer():
            assert np.array_equal(made.nodes, tree.nodes)


def test_answers_are_those_of_a_tree_built_anew():
    rng = rng_of("answers of scaled trees")
    met = 0
    for factor in FACTORS:
        vertices, faces = soup(rng, 60)
        scaled = vertices * factor
        made = scaled_tree(build_mesh_tree(vertices, faces), scaled, faces, factor)
        anew = build_mesh_tree(scaled, faces)
        X = pose(rotation(rng), rng.normal(size=3) * 0.1 * factor)
        found, want = (all_hits(tree, anew, X, np.eye(4)).pairs.tolist() for tree in (made, anew))
        assert sorted(found) == sorted(want), factor
        met += len(want)
    assert met > 100
