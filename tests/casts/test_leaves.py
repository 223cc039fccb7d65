"""What unions come down to, against a walk by hand."""

from __future__ import annotations

import numpy as np
from naive import LATTICE_ROTATIONS, pose, rng_of

import collide
from collide.casts.leaves import leaves_of
from collide.shapes.shape import IDENTITY


def nested(rng, depth: int):
    """(a union, [(shape, pose) of its leaves in order]): poses are exact, so that their order cannot be seen."""
    if not depth or rng.random() < 0.25:
        shape = collide.Sphere(float(rng.uniform(0.1, 1.0)))
        return shape, [(shape, np.eye(4))]
    items, leaves = [], []
    for _ in range(int(rng.integers(1, 4))):
        X = pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-4, 5, 3) * 0.5)
        item, below = nested(rng, depth - 1)
        items.append((item, X))
        leaves += [(leaf, X @ X_leaf) for leaf, X_leaf in below]
    return collide.Compound(items), leaves


def test_leaves_stand_in_order_where_their_unions_put_them():
    rng, n_deep = rng_of("leaves"), 0
    for _ in range(40):
        shape, expected = nested(rng, 3)
        found = leaves_of(shape)
        assert [id(leaf.shape) for leaf in found] == [id(leaf) for leaf, _ in expected]
        for leaf, (_, X) in zip(found, expected):
            assert np.array_equal(leaf.X, X)
        X_up = pose(t=(1.0, 2.0, 3.0))
        for leaf, (_, X) in zip(leaves_of(shape, X_up), expected):
            assert np.array_equal(leaf.X, X_up @ X)
        n_deep += len(expected) > 3
    assert n_deep > 10


def test_a_shape_is_its_own_leaf():
    ball = collide.Sphere(1.0)
    ((shape, X),) = leaves_of(ball)
    assert shape is ball and X is IDENTITY
