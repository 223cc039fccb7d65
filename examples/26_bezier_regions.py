"""A trajectory of seven joints, in Bézier curves, against convex regions of joint space: when it may be in which."""

import numpy as np

from collide import polytopes

rng = np.random.default_rng(3)

# Six curves of degree 5, each of six control points in the space of seven joints [rad], smooth where they join.
waypoints = np.cumsum(rng.uniform(-0.9, 0.9, (7, 7)), axis=0).clip(-2.5, 2.5)
slopes = np.gradient(waypoints, axis=0)
curves = [
    np.array([p, p + s / 5, p + 2 * s / 5, q - 2 * t / 5, q - t / 5, q])
    for p, q, s, t in zip(waypoints, waypoints[1:], slopes, slopes[1:])
]


# Regions as IRIS grows them around a seed: tangent planes of an ellipsoid, here 40, and the limits of the joints.
def grown_region(seed):
    directions = rng.normal(size=(40, 7))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    reach = np.linalg.norm(directions * rng.uniform(0.3, 0.9, 7), axis=1)
    return np.vstack((np.eye(7), -np.eye(7), directions)), np.append(np.full(14, 2.9), directions @ seed + reach)


def pieces(curve, region, start, length=1.0):
    """(start, end, gap) of pieces: outside by a proven gap, or with gap 0 inside, as far as was looked."""
    r = polytopes.meets(curve, *region)  # a curve lies in the hull of its control points
    if not r.hit and r.lower > 1e-12:  # farther than halves are rounded
        polytopes.verify(curve, *region, r)
        yield start, start + length, r.lower
    elif length < 1e-3 or (region[0] @ curve.T <= region[1][:, None]).all():  # then all of it is inside, by convexity
        yield start, start + length, 0.0
    else:  # halves by de Casteljau
        rows = [curve]
        while len(rows[-1]) > 1:
            rows.append((rows[-1][:-1] + rows[-1][1:]) / 2)
        yield from pieces(np.array([row[0] for row in rows]), region, start, length / 2)
        yield from pieces(np.array([row[-1] for row in rows[::-1]]), region, start + length / 2, length / 2)


for k in range(10):
    region = grown_region(waypoints[k % 7] + rng.normal(0.0, 0.4, 7))
    checked = [piece for c, curve in enumerate(curves) for piece in pieces(curve, region, float(c))]
    inside = [(start, end) for start, end, gap in checked if gap == 0.0]
    print(f"region {k}:", f"entered at {inside[0][0]:.3f}, left at {inside[-1][1]:.3f}" if inside else "never entered",
          f"({len(checked) - len(inside)} of {len(checked)} pieces are proven outside)")
