"""A program written for coal, and Pinocchio's robots, on collide: what it changes in answers and in time."""

import importlib.util
import time

from collide.adapters.hosts import coal_api

with coal_api.install():
    import coal
    import numpy as np

    box, can = coal.Box(1, 1, 0.5), coal.Cylinder(0.25, 0.5)
    lowered, request = coal.Transform3s(np.array([0.0, 0.0, -0.25])), coal.CollisionRequest()
    request.enable_contact = False  # as Pinocchio asks; coal 3.0.3 says no
    hit = coal.collide(box, coal.Transform3s(), can, lowered, request, coal.CollisionResult())
    depth = coal.distance(box, coal.Transform3s(), can, lowered, coal.DistanceRequest(), coal.DistanceResult())
    print(f"import coal is {coal.__name__}: {hit} contact of a can in a box, {depth:.2f} m")

if importlib.util.find_spec("pinocchio") is None:
    raise SystemExit(0)  # the rest needs it: pip install 'collide-robotics[pinocchio]'
import pinocchio as pin

from collide.adapters.hosts import pinocchio as host
from collide.scenes.loaders.resources import installed_folders

folder = next(f for f in installed_folders() if (f / "example-robot-data").is_dir())
for name in ("allegro_hand_description/urdf/allegro_right_hand", "panda_description/urdf/panda"):
    path = str(folder / f"example-robot-data/robots/{name}.urdf")
    model = pin.buildModelFromUrdf(path)
    geom_model = pin.buildGeomFromUrdf(model, path, pin.GeometryType.COLLISION, package_dirs=[str(folder)])
    geom_model.addAllCollisionPairs()
    if "panda" in name:
        pin.removeCollisionPairs(model, geom_model, path.replace("urdf", "srdf"))
    data, ours, theirs = model.createData(), geom_model.createData(), geom_model.createData()
    low, high = np.maximum(model.lowerPositionLimit, -3.0), np.minimum(model.upperPositionLimit, 3.0)
    Q = np.random.default_rng(0).uniform(low, high, (200, model.nq))
    for q in Q:
        host.compute_collisions(model, data, geom_model, ours, q)
        pin.computeCollisions(model, data, geom_model, theirs, q, False)
        for k, (result, reply) in enumerate(zip(ours.collisionResults, theirs.collisionResults)):
            if result.isCollision() and not reply.isCollision():
                depth = -host.distances(model, data, geom_model, ours, None).distance[k]
                print(f"{path[-16:]}: pair {k}, {1e3 * depth:.1f} mm deep, is missed by Pinocchio")
    begin = time.perf_counter()
    hits = host.collides(model, data, geom_model, ours, Q)
    middle = time.perf_counter()
    _ = [pin.computeCollisions(model, data, geom_model, theirs, q, True) for q in Q]
    each, theirs_each = 5e3 * (middle - begin), 5e3 * (time.perf_counter() - middle)
    print(f"{path[-16:]}: {hits.sum()} of 200 collide; {each:.0f} µs each, Pinocchio {theirs_each:.0f} µs")
