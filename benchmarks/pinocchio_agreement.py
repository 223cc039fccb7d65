"""Robots' pairs answered by Pinocchio and by collide: which differ, who is right, and what a configuration costs.

python benchmarks/pinocchio_agreement.py [--configurations 100] [--seed 22]

Of robots of example-robot-data, with all pairs of geometries that do not hang on one joint, at random configurations:
`pinocchio.computeCollisions` beside `compute_collisions`, pair by pair. Where they differ,
`tests/oracles/curved_oracle.py` says who is right: it proves a bracket of the signed distance in decimals of 80 digits
and shares no code with the engine. Pinocchio is asked in this process; each side writes into results of its own.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from collide.adapters.hosts import pinocchio as host
from collide.adapters.hosts.pinocchio_geometry import geometry_of
from collide.scenes.loaders.resources import installed_folders

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "oracles"))
from curved_oracle import bracket

ROBOTS = {
    "Panda": "panda_description/urdf/panda.urdf",
    "UR5": "ur_description/urdf/ur5_robot.urdf",
    "Z1": "z1_description/urdf/z1.urdf",
    "Allegro hand": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "ANYmal B": "anymal_b_simple_description/robots/anymal.urdf",
}


def load(pin, path: Path):
    """(model, geometry model) with all pairs of geometries on different joints."""
    model = pin.buildModelFromUrdf(str(path))
    folders = [str(path.parents[4])]
    geom_model = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=folders)
    geom_model.addAllCollisionPairs()
    return model, geom_model


def judge(geom_model, geom_data, k: int, hit: bool) -> str:
    """Who is right about pair k, where ``hit`` is what collide says."""
    pair = geom_model.collisionPairs[k]
    rows = pair.first, pair.second
    shapes = (geometry_of(geom_model.geometryObjects[g])._shape for g in rows)
    lower, upper, *_ = bracket(*shapes, *(geom_data.oMg[g].homogeneous for g in rows))
    if lower <= 0.0 < upper:
        return "open"
    if hit != (upper <= 0.0):
        return "OURS WRONG"
    return "Pinocchio wrong" if abs(float(lower)) > 1e-9 else "Pinocchio wrong by less than a nanometre"


def main() -> None:
    import pinocchio as pin

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configurations", type=int, default=100)
    parser.add_argument("--seed", type=int, default=22)
    arguments = parser.parse_args()
    folder = next(f for f in installed_folders() if (f / "example-robot-data").is_dir())
    for name, file in ROBOTS.items():
        model, geom_model = load(pin, folder / "example-robot-data/robots" / file)
        data, ours, theirs = model.createData(), geom_model.createData(), geom_model.createData()
        low, high = np.maximum(model.lowerPositionLimit, -3.0), np.minimum(model.upperPositionLimit, 3.0)
        Q = np.random.default_rng(arguments.seed).uniform(low, high, (arguments.configurations, model.nq))
        counts: Counter = Counter()
        spent = np.zeros((len(Q), 2))
        for row, q in enumerate(Q):
            times = [time.perf_counter()]
            host.compute_collisions(model, data, geom_model, ours, q)
            times.append(time.perf_counter())
            pin.computeCollisions(model, data, geom_model, theirs, q, False)
            times.append(time.perf_counter())
            spent[row] = 1e6 * np.diff(times)
            hits, their_hits = (np.array([r.isCollision() for r in d.collisionResults]) for d in (ours, theirs))
            counts["asked"] += len(hits)
            counts["collide"] += int(hits.sum())
            for k in np.flatnonzero(hits != their_hits).tolist():
                counts[judge(geom_model, ours, k, bool(hits[k]))] += 1
        begin = time.perf_counter()
        host.collides(model, data, geom_model, ours, Q)
        batch = 1e6 * (time.perf_counter() - begin) / len(Q)
        begin = time.perf_counter()
        for q in Q:
            pin.computeCollisions(model, data, geom_model, theirs, q, True)
        first = 1e6 * (time.perf_counter() - begin) / len(Q)
        print(f"{name}: {dict(counts)}")
        each = np.median(spent, axis=0)
        print(f"  µs a configuration, all pairs with results: {each[0]:.0f}, Pinocchio {each[1]:.0f}")
        print(f"  µs a configuration, whether any collides: {batch:.0f}, Pinocchio {first:.0f}")


if __name__ == "__main__":
    main()
