"""A body at rest that moves by less than a micrometre keeps its contacts: the same features, points that move no more.

Standing or lying on a plane, a box, a hull, a mesh with inner edges and a height field, a little within and a little
apart, as a solver leaves a body at rest. `tests/differential/test_contact_drift.py` asks other engines the same.
"""

from __future__ import annotations

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
