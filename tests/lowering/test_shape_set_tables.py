"""Tables of a `ShapeSet`: made once, a row a shape, which is what the shape alone has."""

from __future__ import annotations

import numpy as np
from naive import one_of_each, rng_of

import collide
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.parts import bounding_parts_of
from collide.lowering.shape_set_tables import tables_of
from collide.lowering.shape_table import ShapeTable


def test_tables_of_a_set():
    shapes = list(one_of_each(rng_of("shape set tables")).values())
    offset = collide.Compound([(shapes[0], collide.pose((1.0, 0.0, 0.0)))])
    centred = collide.Compound([(shapes[0], np.eye(4))])
    shapes += [offset, centred]
    shape_set = collide.ShapeSet(shapes)
    tables = tables_of(shape_set)
    assert tables_of(shape_set) is tables and tables_of(collide.ShapeSet(shapes)) is not tables
    assert tables.kinds.tolist() == [kind_of(shape) for shape in shapes]
    several = [isinstance(shape, collide.Compound) and shape is not centred for shape in shapes]
    assert tables.single_convex.tolist() == [not many for many in several]
    assert tables.convex is tables.convex and len(tables.convex.packed) == len(shapes)
    for k, shape in enumerate(shapes):
        first = bounding_parts_of(shape)[0][0]
        assert tables.convex.packed[k].content == first.content
        alone = ShapeTable([first])
        assert (tables.convex.numbers[k] == alone.numbers[0]).all()
        assert (tables.convex.ints[k, :3] == alone.ints[0, :3]).all(), "kind, points and padding"
