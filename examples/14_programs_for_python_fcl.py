"""A program written for python-fcl, and trimesh's CollisionManager, on collide: one line, and what it changes."""

import importlib.util
import time

from collide.adapters.hosts import fcl_api

fcl_api.install()  # before anything imports fcl

import fcl
import numpy as np

print(f"import fcl is {fcl.__name__}")
box = fcl.Box(1, 1, 1)
a, b = fcl.CollisionObject(box), fcl.CollisionObject(box, fcl.Transform(np.array([0.9, 0.2, 0.1])))
result = fcl.CollisionResult()
n = fcl.collide(a, b, fcl.CollisionRequest(num_max_contacts=8, enable_contact=True), result)
print(f"{n} contacts, each {result.contacts[0].penetration_depth:.3f} m deep along {result.contacts[0].normal}")

# Where python-fcl errs, aborts, hangs or tunnels: hulls face to face, concentric balls, half-spaces, motions.
corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
cube = fcl.Convex(corners, 2, np.array([4, 0, 1, 3, 2, 4, 4, 6, 7, 5]))  # the hull counts, whatever faces are listed
below = fcl.CollisionObject(cube, fcl.Transform(np.array([0.0, -3.0, 0.0])))
print(f"cubes as hulls: {fcl.distance(fcl.CollisionObject(cube), below):.3f} m apart; python-fcl says 2.236")
signed = fcl.DistanceRequest(enable_signed_distance=True)
ball = fcl.CollisionObject(fcl.Sphere(0.5))
print(f"concentric balls: {fcl.distance(ball, fcl.CollisionObject(fcl.Sphere(0.5)), signed):.1f} m")
ground = fcl.CollisionObject(fcl.Halfspace(np.array([0.0, 0.0, 1.0]), -2.0))
print(f"above a half-space: {fcl.distance(a, ground):.2f} m")
b.setTranslation(np.array([2.0, 0.0, 0.0]))
toc = fcl.continuousCollide(a, fcl.Transform(), b, fcl.Transform(np.array([-2.0, 0.0, 0.0])))
print(f"boxes that fly through each other touch at {toc:.6f}")

begin = time.perf_counter()
for _ in range(10_000):
    fcl.collide(a, b)
print(f"a call of fcl.collide: {(time.perf_counter() - begin) * 100:.1f} µs")

if importlib.util.find_spec("trimesh"):
    import trimesh
    from trimesh.collision import CollisionManager
    from trimesh.collision import fcl as held

    manager = CollisionManager()
    for k in range(3):
        X = trimesh.transformations.translation_matrix((0.75 * k, 0, 0))
        manager.add_object(f"cube {k}", trimesh.creation.box((1, 1, 1)), X)
    print(f"trimesh asks {held.__name__}:", sorted(manager.in_collision_internal(return_names=True)[1]))
fcl_api.uninstall()
