"""Robots' pairs answered by Pinocchio and by collide, at random configurations: what differs is judged in 80 digits.

All pairs of geometries that do not hang on one joint; each side writes into results of its own.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

pin = pytest.importorskip("pinocchio", reason="pinocchio is not installed")
from curved_oracle import bracket
from pinocchio_robots import ROBOTS, load, robots_folder
from samples import sizes, told

from collide.adapters.hosts import pinocchio as host
from collide.adapters.hosts.pinocchio_geometry import geometry_of


def judge(geom_model, geom_data, k: int, hit: bool) -> str:
    """Who is right about pair k, of which collide says ``hit``."""
    pair = geom_model.collisionPairs[k]
    rows = pair.first, pair.second
    shapes = (geometry_of(geom_model.geometryObjects[g])._shape for g in rows)
    lower, upper, *_ = bracket(*shapes, *(geom_data.oMg[g].homogeneous for g in rows))
    if lower <= 0.0 < upper:
        return "open"
    if hit != (upper <= 0.0):
        return "OURS WRONG"
    return "Pinocchio wrong" if abs(float(lower)) > 1e-9 else "Pinocchio wrong by less than a nanometre"


@sizes(2, 1000)
def test_pairs_that_differ_are_judged_in_our_favour(n):
    """n configurations a robot."""
    if robots_folder() is None:
        pytest.skip("example-robot-data is not installed")
    for name in ROBOTS:
        model, geom_model = load(name)
        data, ours, theirs = model.createData(), geom_model.createData(), geom_model.createData()
        low, high = np.maximum(model.lowerPositionLimit, -3.0), np.minimum(model.upperPositionLimit, 3.0)
        counts: Counter = Counter()
        for q in np.random.default_rng(22).uniform(low, high, (n, model.nq)):
            host.compute_collisions(model, data, geom_model, ours, q)
            pin.computeCollisions(model, data, geom_model, theirs, q, False)
            hits, their_hits = (np.array([r.isCollision() for r in d.collisionResults]) for d in (ours, theirs))
            counts.update({"asked": len(hits), "collide": int(hits.sum())})
            for k in np.flatnonzero(hits != their_hits).tolist():
                who = judge(geom_model, ours, k, bool(hits[k]))
                counts[who] += 1
                assert who != "OURS WRONG", f"{name}, pair {k} at {q.tolist()}"
        told(f"{name}, {n} configurations", counts)
        assert counts["asked"] and counts["collide"] < counts["asked"]
