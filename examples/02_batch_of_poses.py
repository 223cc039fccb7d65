"""One call, many poses: a gripper finger swept past a bottle."""

import numpy as np

import collide

finger = collide.ConvexHull([(x, y, z) for x in (-0.01, 0.01) for y in (-0.005, 0.005) for z in (0, 0.06)])
bottle = collide.Capsule(radius=0.035, length=0.18)
X_WB = collide.pose((0, 0, 0.1))

# A leading axis makes a batch; the single pose of the bottle goes with every pose of the finger.
ys = np.linspace(-0.075, 0.075, 7)
X_WAs = np.array([collide.pose((0, y, 0.08)) for y in ys])
r = collide.distance(finger, bottle, X_WAs, X_WB)

print("   y [m]  distance [m]  hit    width of the bracket [m]")
for y, distance, hit, width in zip(ys, r.distance, r.hit, r.upper - r.lower):
    print(f"{y:8.3f}  {distance:12.6f}  {hit!s:5}  {width:.0e}")

# The same call gives the same bits, alone or in a batch.
alone = collide.distance(finger, bottle, X_WAs[1], X_WB)
assert alone.distance == r.distance[1] and (alone.normal == r.normal[1]).all()

# Beyond max_distance only a proven lower bound is worked out, which is cheaper: a planner that keeps
# 2 cm of clearance need not know how much farther the rest is.
near = collide.distance(finger, bottle, X_WAs, X_WB, max_distance=0.02)
print(
    f"\nbeyond 2 cm: {near.beyond.sum()} of {len(near)} poses, each proven at least", near.lower[near.beyond].min(), "m"
)

# Booleans alone are the cheapest question.
print("hits:", collide.collide(finger, bottle, X_WAs, X_WB))
