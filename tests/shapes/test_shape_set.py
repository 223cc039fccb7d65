"""Shapes laid out once and picked by number: a sequence in every way, and what is no number is refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from collide import Box, InvalidArgument, InvalidShape, ShapeSet, Sphere
from collide.shapes.shape_set import Picked

SHAPES = [Box((1, 1, 1)), Sphere(0.5), Sphere(2.0)]


def test_a_number_gives_the_shape_and_numbers_a_sequence():
    library = ShapeSet(SHAPES)
    assert len(library) == 3 and library[1] is SHAPES[1] and library[np.int32(-1)] is SHAPES[2]
    for numbers in ([2, 0, 2, 1], np.array([2, 0, 2, 1], dtype=np.uint8), (2, 0, 2, 1)):
        picked = library[numbers]
        assert isinstance(picked, Picked) and isinstance(picked, Sequence) and len(picked) == 4
        assert list(picked) == [SHAPES[k] for k in (2, 0, 2, 1)] and picked[1] is SHAPES[0] and picked[-1] is SHAPES[1]
        assert list(picked[1:3]) == [SHAPES[0], SHAPES[2]] and picked[np.array([3])].rows.tolist() == [1]
        assert picked.rows.dtype == np.int64 and picked.shape_set is library
    assert list(library[1:]) == SHAPES[1:] and list(library[::-1]) == SHAPES[::-1] and len(library[[]]) == 0
    assert list(iter(library)) == SHAPES


@pytest.mark.parametrize("number", [3, -4])
def test_numbers_of_no_shape(number):
    with pytest.raises(IndexError, match="shapes 0 … 2"):
        ShapeSet(SHAPES)[number]


@pytest.mark.parametrize("rows", [[0, 3], [-1, 0], [0.5], [[0, 1]], ["0"], None, [True, False, True]])
def test_what_picks_nothing(rows):
    with pytest.raises(InvalidArgument, match="ShapeSet"):
        ShapeSet(SHAPES)[rows]


@pytest.mark.parametrize(
    ("shapes", "words"), [([], "empty"), ([SHAPES[0], 1.0], r"shapes\[1\] must be a shape, got 1.0"), (7, "got 7")]
)
def test_what_is_no_set(shapes, words):
    with pytest.raises(InvalidShape, match=words):
        ShapeSet(shapes)


def test_a_set_is_not_changed_by_the_list_that_made_it():
    given = list(SHAPES)
    library = ShapeSet(given)
    given[0] = SHAPES[1]
    assert library[0] is SHAPES[0]
