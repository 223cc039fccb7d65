"""Volumes of overlaps of a World's bodies: rows as `overlap_volume` says, and what cannot be told is listed."""

from __future__ import annotations

import numpy as np
from mesh_shapes import box

import collide


def test_rows_are_those_of_pairs():
    world = collide.World()
    table = world.add(collide.Box((2, 2, 1)), np.eye(4), name="table", static=True)
    crate = world.add(collide.Box((1, 1, 1)), collide.pose((0, 0, 1)), name="crate")
    part = world.add(collide.Mesh(*box()), collide.pose((0.5, 0, 1.25)), name="part")
    ball = world.add(collide.Sphere(0.5), collide.pose((0, 0, 1)), name="ball")
    world.add(collide.Box((1, 1, 1)), collide.pose((9, 0, 0)), name="far")
    overlaps = world.overlaps()
    assert overlaps.names == [("table", "crate"), ("table", "part"), ("crate", "part")]
    for row in overlaps.rows:
        A, B = (world.body(int(row[k])) for k in "ab")
        alone = collide.overlap_volume(A.shape, B.shape, A.X_WB, B.X_WB)
        for name in ("volume", "lower", "upper", "area_a", "area_b", "patch_area", "flush_area"):
            assert row[name] == getattr(alone, name)
        assert (row["centroid"] == alone.centroid).all()
    assert overlaps["patch_area"][0] == 1.0 and overlaps["volume"][0] == 0.0 and overlaps["volume"][2] > 0.0
    assert [pair[:2] for pair in overlaps.unanswered] == [(table, ball), (crate, ball), (part, ball)]
    assert all("Sphere" in reason for *_, reason in overlaps.unanswered)
    world.remove(part)
    assert len(world.overlaps()) == 1 and len(collide.World().overlaps()) == 0
