"""Two shapes at two poses: whether they meet, how far apart they are, and how that is known."""

import numpy as np

import collide
from collide.results import HOW

# Lengths are metres, angles radians. A pose X_WA is a (4, 4) matrix: the frame of A in the world W.
crate = collide.Box((0.4, 0.3, 0.2))  # full edge lengths, centred in its frame
ball = collide.Sphere(0.1)
X_WA = collide.pose((0, 0, 0.1), rpy=(0, 0, np.pi / 6))
X_WB = collide.pose((0.35, 0.2, 0.15))

print("do they meet?", collide.collide(crate, ball, X_WA, X_WB))

r = collide.distance(crate, ball, X_WA, X_WB)
print("gap [m]:         ", r.distance)
print("normal, A to B:  ", r.normal)
print("nearest points:  ", r.point_a, r.point_b)
# The bracket is proven: rounding cannot have put the true distance outside it. `certified` says that
# it also fixes the sign and is as narrow as promised (docs/conventions.md).
print(f"proven bracket:   {r.lower!r} … {r.upper!r}, {r.upper - r.lower:.0e} m wide, certified: {r.certified}")

# Overlapping, the distance is minus the smallest translation that separates the bodies, and moving B
# by -distance * normal is that translation.
X_WB = collide.pose((0.2, 0.05, 0.15))
r = collide.distance(crate, ball, X_WA, X_WB)
print("\ndeeper: distance", r.distance, "normal", r.normal)
freed = X_WB.copy()
freed[:3, 3] -= r.distance * r.normal
print("after the move:  ", f"{collide.distance(crate, ball, X_WA, freed).distance:.1e} m, touching up to rounding")

# Sets are closed: a box standing exactly on another one touches it, and touching is a hit. One unit in
# the last place higher it does not: doubles leave both open, and integers decide (`how` says so).
lower, upper = collide.Box((1, 1, 1)), collide.Box((0.5, 0.5, 0.5))
for height in (0.75, np.nextafter(0.75, 1)):
    r = collide.distance(lower, upper, np.eye(4), collide.pose((0, 0, height)))
    print(
        f"\nbox at {float(height)!r}: hit {r.hit}, distance {r.distance:.1e}, certified {r.certified}, by {HOW[r.how]}"
    )
