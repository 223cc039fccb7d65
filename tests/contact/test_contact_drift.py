"""A body at rest that moves by less than a micrometre keeps its contacts: the same features, points that move no more.

Standing or lying on a plane, a box, a hull, a mesh with inner edges and a height field, a little within and a little
apart, as a solver leaves a body at rest. `tests/differential/test_contact_drift.py` asks other engines the same.
"""

from __future__ import annotations

import numpy as np
import pytest
from resting_bodies import BODIES, FLOORS, WITHIN, moved_poses

import collide

STEPS = 20


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("body", BODIES)
def test_contacts_of_a_body_at_rest_stay(floor, body):
    ground, X_WF = FLOORS[floor]
    shape, n_contacts = BODIES[body].shape, BODIES[body].n_contacts
    for depth in WITHIN:
        before = None
        for X_WB in moved_poses(BODIES[body].X_WB, depth, STEPS, seed=f"{floor} {body} {depth}"):
            rows = collide.contacts(ground, shape, X_WF, X_WB, margin=1e-4, max_contacts=16).rows
            found = {(int(row["feature_a"]), int(row["feature_b"])): row for row in rows}
            assert len(found) == len(rows) == n_contacts, (depth, rows)
            if before is not None:
                assert found.keys() == before.keys(), (depth, before.keys() ^ found.keys())
                for feature, row in found.items():
                    for point in ("point_a", "point_b"):
                        way = abs(row[point] - before[feature][point]).max()
                        assert way <= 1e-6, (depth, feature, point, way)
            before = found


@pytest.mark.parametrize("turned", (0.0, 1e-7))
def test_a_can_along_the_edge_of_a_box_keeps_the_edge(turned):
    """Its contacts were the edge's or a face's, from step to step, and up to 0.3 µm off: the normal is good to 1e-5."""
    box, can, height = collide.Box((0.2, 0.6, 0.2)), collide.Cylinder(0.08, 0.2), np.sqrt(0.08**2 - 0.04**2)
    X_WB = collide.pose((-0.04 + 0.04, 0.01, 0.2 + height), rpy=(np.pi / 2, 0.0, turned))
    X_WA = collide.pose((-0.14, 0.0, 0.1))
    features = set()
    for above in (-1.2e-4, -1e-5, -1e-7):
        for X in moved_poses(X_WB, above, 60, seed=f"edge {above} {turned}"):
            rows = collide.contacts(box, can, X_WA, X, margin=1e-5, max_contacts=4).rows
            features.add(tuple(sorted((int(row["feature_a"]), int(row["feature_b"])) for row in rows)))
            depth = np.hypot(X[0, 3] + 0.04, X[2, 3] - 0.2) - 0.08
            assert len(rows) == 2 and np.abs(rows["distance"] - depth).max() <= 3e-7, (above, rows["distance"], depth)
    assert len(features) == 1, features
