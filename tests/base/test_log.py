"""What the library logs: slow things with their sizes when asked for, nothing by default."""

from __future__ import annotations

import logging
import subprocess
import sys

import numpy as np
import surfaces

import collide

EYE = np.eye(4)
PROGRAM = """
import logging, sys, numpy as np, collide
if sys.argv[1:] == ["info"]:
    logging.basicConfig(level=logging.INFO)
t = np.arange(400.0)
hull = collide.ConvexHull(np.stack([np.cos(t), np.sin(t), np.sin(3 * t)], axis=1))
collide.collide(hull, collide.Sphere(1), np.eye(4), np.eye(4))
"""


def test_what_is_made_is_said_once(caplog):
    points = np.random.default_rng(1).normal(size=(400, 3))
    hull, mesh = collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None]), collide.Mesh(*surfaces.torus())
    world = collide.World()
    world.add(hull, name="hull")
    world.add(mesh, name="mesh")
    with caplog.at_level(logging.INFO, logger="collide"):
        for _ in range(2):
            collide.distance(hull, mesh, EYE, collide.pose((4, 0, 0)))
            assert hull.hull and mesh.convex_hull and world.collides() is True
            collide.collide(hull, hull, EYE, EYE)
    told = [record.getMessage() for record in caplog.records if "kernel" not in record.getMessage()]
    for words in (
        "support tree of a hull of 400 points made", "convex hull of 400 points made",
        f"box-tree of a mesh of {len(mesh.faces)} facets made",
        f"convex hull around a mesh of {len(mesh.faces)} facets made",
        "tables and box-tree of a World of 2 bodies made",
    ):
        assert sum(line.startswith(f"{words}: ") and line.endswith(" s") for line in told) == 1, (words, told)
    assert all(record.name == "collide" and record.levelno == logging.INFO for record in caplog.records)


def test_quiet_unless_asked():
    for options, said in (((), False), (("info",), True)):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, *options], capture_output=True, text=True, check=True, timeout=300
        )
        assert ("INFO:collide:support tree of a hull of 400 points made: " in done.stderr) == said and bool(
            done.stderr
        ) == said, done.stderr
