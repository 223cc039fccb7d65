"""A camera's view to stay out of, limits of a workspace to stay within, a corridor: half-spaces in a World."""

import numpy as np

import collide

# What a camera on the ceiling sees, downwards without end: four sides, and a near plane at 0.2 m.
slope = np.tan(np.radians(30.0))
frustum = collide.HPolytope(
    [(1, 0, -slope), (-1, 0, -slope), (0, 1, -slope), (0, -1, -slope), (0, 0, -1)], [0, 0, 0, 0, -0.2], bounded=False
)
X_WC = np.diag([1.0, -1.0, -1.0, 1.0])  # looks down
X_WC[:3, 3] = (0.0, 0.0, 2.5)

# The arm may not leave a prism of six sides: the other side of each is a half-space that it must not touch.
angles = np.radians(60.0 * np.arange(6))
sides, reach = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(6))), 1.4

world = collide.World()
world.add(frustum, X_WC, name="camera's view", static=True)
for k, n in enumerate(sides):
    world.add(collide.Halfspace(-n, -reach), name=f"limit {k}", static=True)
arm = world.add(collide.Capsule(0.06, 0.5), name="forearm")
tool = world.add(collide.Box((0.1, 0.1, 0.2)), name="tool")
world.allow("forearm", "tool")
for x in (1.36, 1.1, 0.7):
    world.set_poses([arm, tool], [collide.pose((x, 0.0, 1.6)), collide.pose((x, 0.0, 1.25))])
    hits = [" and ".join(sorted(names)) for names in world.collisions().names]
    near = world.distances()
    seen = min(row["distance"] for row, names in zip(near, near.names) if "camera's view" in names)
    print(f"x = {x}: {', '.join(hits) or 'free'}; {seen:+.4f} m from the camera's view")

# When does the tool come into view, on its way inwards? Proven to a nanosecond of unit time.
way = collide.pose((1.3, 0, 1.25)), collide.pose((0.3, 0, 1.25))
t = collide.time_of_impact(collide.Box((0.1, 0.1, 0.2)), frustum, *way, X_WC, X_WC)
print(f"on a straight way inwards it is seen from t = {t.time:.4f} on")

# A region of 5,000 half-spaces: its planes, not rounded corners, decide where a ball touches it.
normals = np.random.default_rng(0).normal(size=(5000, 3))
normals /= np.linalg.norm(normals, axis=1)[:, None]
normals[0] = (0.0, 0.0, 1.0)
corridor = collide.HPolytope(normals, 1.0 + np.abs(normals[:, 0]), bounded=False)
for radius in (0.5, np.nextafter(0.5, 0.0)):
    hit = collide.collide(corridor, collide.Sphere(radius), np.eye(4), collide.pose((0.0, 0.0, 1.5)))
    print(f"a ball of radius {float(radius)!r} on top of it: {'touches' if hit else 'apart'}")
try:
    collide.HPolytope([(1, 0, 0), (0, 1, 0), (-1, 0, 0)], [0.0, 5.0, -1.0], bounded=False)
except collide.CollideError as error:
    print(error)
