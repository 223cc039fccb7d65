"""Compounds: what they hold, when they are convex or have meshes, and what is no part."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose

from collide import Box, Compound, Halfspace, InvalidPose, InvalidShape, Mesh, Sphere

EYE = np.eye(4)
BALL, MESH = Sphere(0.5), Mesh(np.eye(3), [[0, 1, 2]], solid=False)


def test_what_compounds_know_of_their_parts():
    one = Compound([(BALL, pose(t=(1, 2, 3)))])
    two = Compound([(BALL, EYE), (Box((1, 1, 1)), EYE)])
    deep = Compound([(two, EYE), (Compound([(MESH, EYE)]), EYE)])
    assert one.convex and not two.convex and not deep.convex and Compound([(one, EYE)]).convex
    assert not Compound([(MESH, EYE)]).convex and not Compound([(two, EYE)]).convex
    assert deep.meshed and Compound([(deep, EYE)]).meshed and not two.meshed
    assert repr(deep) == "Compound(<2 items>)"
    ((shape, X),) = one.items
    assert shape is BALL and np.array_equal(X, pose(t=(1, 2, 3))) and not X.flags.writeable


def test_order_and_poses_make_the_difference():
    a, b = (BALL, EYE), (Box((1, 1, 1)), pose(t=(1, 0, 0)))
    assert Compound([a, b]) == Compound((a, b)) and Compound([a, b]) != Compound([b, a])
    assert Compound([a]) != Compound([(BALL, pose(t=(0, 0, 1e-300)))]) and Compound([a]) != BALL
    minus_zero = EYE.copy()
    minus_zero[0, 1] = -0.0
    assert Compound([a]) == Compound([(BALL, minus_zero)]) and hash(Compound([a])) == hash(
        Compound([(BALL, minus_zero)])
    )


@pytest.mark.parametrize(
    ("items", "error", "words"),
    [
        ([], InvalidShape, "empty"), (7, InvalidShape, "sequence of"), ([BALL], InvalidShape, "sequence of"),
        ([(EYE, BALL)], InvalidShape, r"items\[0\] must start with a shape, got ndarray"),
        ([(BALL, EYE), (BALL, 2 * EYE)], InvalidPose, r"items\[1\] pose"),
        ([(BALL, np.stack([EYE, EYE]))], InvalidPose, "one .*pose, got \\(2, 4, 4\\)"),
        ([(BALL, np.full((4, 4), np.nan))], InvalidPose, r"items\[0\]"),
    ],
)
def test_what_is_no_compound(items, error, words):
    with pytest.raises(error, match=words):
        Compound(items)


def test_half_spaces_may_be_parts():
    assert not Compound([(Halfspace((0, 0, 1), 0.0), EYE), (BALL, EYE)]).meshed


def test_parts_are_looked_at_once():
    """Whether a mesh is among many parts is known from when the compound was made."""
    looked_at = []

    class Watched(Sphere):
        __slots__ = ()

        @property
        def meshed(self):
            looked_at.append(1)
            return False

    many = Compound([(Watched(0.1), EYE) for _ in range(50)])
    assert len(looked_at) == 50
    assert not many.meshed and not many.is_asked_whole and len(looked_at) == 50
