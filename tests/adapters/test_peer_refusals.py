"""Pairs that an engine would be asked about unfairly are refused by name; the ones beside them are answered."""

from __future__ import annotations

import pytest

from collide import Box, ConvexHull, Mesh, Sphere, pose
from collide.adapters.peers.protocol import Question, Table, engine

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
OPEN = Mesh(CORNERS, [[0, 2, 1], [0, 1, 3]])
SURFACE = Mesh(CORNERS, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], solid=False)
SOLID = Mesh(CORNERS, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def answered(name: str, *pairs) -> Table:
    peer = engine(name)
    if peer.missing():
        pytest.skip(str(peer.missing()))
    table = peer.answer(Question.from_pairs((A, B, pose(), pose((3, 0, 0))) for A, B in pairs))
    assert not table.rows["failed"].any(), table.reasons
    return table


def test_coal_has_no_hull_with_a_radius_against_meshes():
    swept, plain = ConvexHull(CORNERS, radius=0.1), ConvexHull(CORNERS)
    table = answered("coal", (OPEN, swept), (swept, OPEN), (OPEN, plain), (OPEN, OPEN), (swept, plain))
    assert table.rows["unsupported"].tolist() == [True, True, False, False, False]
    assert "no hull with a radius against meshes" in table.reasons[0]
    assert table.rows["distance"][2:] == pytest.approx([2.0, 2.0, 1.9])


def test_trimesh_takes_a_convex_surface_for_a_solid():
    table = answered("trimesh", (SURFACE, Box((1, 1, 1))), (SOLID, Box((1, 1, 1))), (OPEN, Box((1, 1, 1))))
    assert table.rows["unsupported"].tolist() == [True, False, False]
    assert "convex surface" in table.reasons[0]
    assert table.rows["distance"][1:] == pytest.approx([11**0.5 / 2, 11**0.5 / 2])


def test_drake_makes_no_hull_of_a_segment():
    table = answered("drake", (ConvexHull(CORNERS[:2]), Sphere(1)), (ConvexHull(CORNERS), Sphere(1)))
    assert table.rows["unsupported"].tolist() == [True, False] and "MakeConvexHull" in table.reasons[0]
