"""Can a grasp hold its load? Hulls of contact wrenches in six dimensions against what the task asks for."""

import numpy as np

from collide import polytopes


def contact_wrenches(contacts, inward, friction, sides=16):
    """Wrenches (force, torque) of unit forces along the edges of linearised friction cones, and none at all."""
    wrenches = [np.zeros(6)]
    for p_Oc, n in zip(contacts, inward):
        u = np.cross(n, [0.6, 0.64, 0.48])
        u /= np.linalg.norm(u)
        v = np.cross(n, u)
        for angle in np.linspace(0, 2 * np.pi, sides, endpoint=False):
            force = n + friction * (np.cos(angle) * u + np.sin(angle) * v)
            wrenches.append(np.concatenate((force, np.cross(p_Oc, force))))
    return np.array(wrenches)


# Sixty contacts of soft fingers on two opposite faces of a box of 60 x 80 x 100 mm; forces up to 1 each, so that the
# hull of their wrenches, scaled by the number of contacts, is what they can do together.
rng = np.random.default_rng(1)
side = np.where(np.arange(60) % 2 == 0, 1.0, -1.0)
contacts = np.column_stack((0.03 * side, rng.uniform(-0.04, 0.04, 60), rng.uniform(-0.05, 0.05, 60)))
inward = np.column_stack((-side, np.zeros(60), np.zeros(60)))

# The task: carry the weight, give or take a push of 0.5 N along each axis and a torque of 5 mN m about each.
normals = np.vstack((np.eye(6), -np.eye(6)))
allowed = np.array([0.5, 0.5, 0.5, 0.005, 0.005, 0.005])


def task(weight):
    wrench = np.array([0.0, 0.0, weight, 0.0, 0.0, 0.0])
    return np.concatenate((allowed + wrench, allowed - wrench))


for friction in (0.3, 0.8):
    wrenches = 60 * contact_wrenches(contacts, inward, friction)
    for weight in (5.0, 30.0):
        r = polytopes.meets(wrenches, normals, task(weight))
        polytopes.verify(wrenches, normals, task(weight), r)
        what = (
            f"held, by {len(r.certificate.points)} edges of friction cones"
            if r.hit
            else f"not held: {r.lower:.2f} short, proven by {len(r.certificate.halfspaces)} bounds of the task"
        )
        print(f"{len(wrenches)} wrenches, friction {friction}, {weight:.0f} N: {what}")
