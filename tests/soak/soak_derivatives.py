"""Derivatives of distances by the hundred thousand pairs, beside slopes of distances proven in 80 digits.

    python tests/soak/soak_derivatives.py --pairs 100000 [--seed 1]
    python tests/soak/soak_derivatives.py --seed 1 --case 1234          one pair again

Convex shapes of all kinds, lengths within a factor of 20, in families of poses by turns: random; frames' axes parallel;
axes on one line; nearly so, off by 1e-8 to 0.1; bodies that touch but for 1e-9 to 1e-3. A unique derivative is compared
along a random change of both poses, to a millionth. Where there is none, two active gradients are compared with both
one-sided slopes along their difference, which a kink sets apart. Prints a row a family (pairs, overlaps, those unique,
judged, kinks judged, not settled, wrong, the largest error), and failures as they come. Ends with status 1 where a
derivative is wrong. 100,000 pairs take about two hours of a core.
"""

from __future__ import annotations

import argparse
import collections
import math
import sys
from decimal import Decimal
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "oracles"))

import numpy as np
from distance_differences import slope
from naive import rotation

import collide
from collide import Uniqueness

KINDS = "point", "sphere", "capsule", "box", "hull", "rounded", "cylinder", "cone", "ellipsoid", "half-space"
CURVED = {"Cylinder", "Cone", "Ellipsoid"}
FAMILIES = "random", "parallel", "one line", "nearly", "touching"
#: Steps of slopes at most, of flat pairs and of curved ones, whose brackets are 1e-20 wide.
_STEPS = Decimal(2) ** -46, Decimal(2) ** -38
#: What a slope may be off, as a part of the gradient and the change; a kink's, of which corners are told to 2⁻²⁸.
ENOUGH, ENOUGH_AT_KINKS = 1e-6, 1e-5


def shape_of(rng, kind: str) -> collide.Shape:
    a, b, c = 20.0 ** -rng.uniform(size=3)
    if kind == "point":
        return collide.ConvexHull(0.1 * rng.normal(size=(1, 3)))
    if kind in ("hull", "rounded"):
        return collide.ConvexHull(rng.normal(size=(12, 3)) * (a, b, c), radius=0.3 * a if kind == "rounded" else 0.0)
    makers = {
        "sphere": lambda: collide.Sphere(a), "capsule": lambda: collide.Capsule(a / 2, b),
        "box": lambda: collide.Box((a, b, c)), "cylinder": lambda: collide.Cylinder(a / 2, b),
        "cone": lambda: collide.Cone(a / 2, b), "ellipsoid": lambda: collide.Ellipsoid((a / 2, b / 2, c / 2)),
        "half-space": lambda: collide.Halfspace(np.eye(3)[rng.integers(3)], 0.0),
    }
    return makers[kind]()


def pair_of(seed: int, case: int):
    """(family, A, B, X_WA, X_WB) of a case."""
    rng = np.random.default_rng([seed, case])
    family = FAMILIES[case % len(FAMILIES)]
    kinds = rng.choice(len(KINDS), 2)
    if (kinds == len(KINDS) - 1).all():
        kinds[0] = 0
    A, B = (shape_of(rng, KINDS[k]) for k in kinds)
    X_WA, X_WB = np.eye(4), np.eye(4)
    X_WA[:3, 3] = rng.normal(size=3)
    X_WB[:3, 3] = X_WA[:3, 3] + rng.uniform(0.05, 1.5) * rng.normal(size=3)
    if family in ("random", "touching"):
        X_WA[:3, :3], X_WB[:3, :3] = rotation(rng), rotation(rng)
    if family in ("one line", "nearly"):
        X_WB[:3, 3] = X_WA[:3, 3] + [0.0, 0.0, rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 1.5)]
    if family == "nearly":
        off, axis = 10.0 ** rng.uniform(-8, -1, 2), rng.normal(size=3)
        X_WB = turned(X_WB, off[0] * axis / np.linalg.norm(axis))
        X_WB[:3, 3] += off[1] * rng.normal(size=3)
    if family == "touching":
        r = collide.distance(A, B, X_WA, X_WB)
        X_WB[:3, 3] -= (r.distance - rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9, -3)) * r.normal
    return family, A, B, X_WA, X_WB


def turned(X: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """A pose turned by a rotation vector about its origin."""
    angle = float(np.linalg.norm(omega))
    x, y, z = omega / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    out = X.copy()
    out[:3, :3] = (np.eye(3) + math.sin(angle) * K + 2.0 * math.sin(angle / 2) ** 2 * K @ K) @ X[:3, :3]
    return out


def step_of(A, B, distance: float) -> Decimal:
    """Far below what changes a slope: of small gaps a part of the gap."""
    is_curved = any(type(shape).__name__ in CURVED for shape in (A, B))
    step = _STEPS[is_curved]
    return min(step, Decimal(abs(distance)) * Decimal(2) ** (-18 if is_curved else -22)) if distance else step


def judge(rng, A, B, X_WA, X_WB, r) -> tuple[str, float]:
    """("slope", "kink" or "open", what a derivative is off) of a row."""
    step = step_of(A, B, r.distance)
    if r.unique:
        g, twist = np.concatenate([r.d_distance_A, r.d_distance_B]), rng.normal(size=12)
        told = slope(A, B, X_WA, X_WB, twist, step)
        scale = np.linalg.norm(g) * np.linalg.norm(twist)
        return ("slope", abs(told.middle - g @ twist) / scale) if told.error < 1e-7 * scale else ("open", 0.0)
    corners = r.active_gradients()
    if len(corners) < 2 or r.hit or r.uniqueness is not Uniqueness.SEVERAL_POINTS:
        return "open", 0.0
    twist = corners[0] - corners[1]
    twist /= np.linalg.norm(twist)
    told = slope(A, B, X_WA, X_WB, twist, step)
    if any(type(shape).__name__ in ("Cylinder", "Cone") for shape in (A, B)) and len(corners) > 2:
        return "open", 0.0  # of a rim some corners are told
    products = corners @ twist
    scale = np.abs(corners).max()
    off = max(abs(told.after - products.min()), abs(told.before - products.max())) / scale
    return ("kink", off) if told.error < 1e-7 * scale else ("open", 0.0)


def soak(seed: int, cases, say=print) -> dict[str, collections.Counter]:
    """Counts of each family; failures are told as they come."""
    tally: dict[str, collections.Counter] = collections.defaultdict(collections.Counter)
    for case in cases:
        family, A, B, X_WA, X_WB = pair_of(seed, case)
        count, rng = tally[family], np.random.default_rng([seed, case, 1])
        r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
        count["pairs"] += 1
        count["hits"] += r.hit
        count[str(r.uniqueness)] += 1
        if r.uniqueness is Uniqueness.UNCERTAIN:
            continue
        what, off = judge(rng, A, B, X_WA, X_WB, r)
        count[what] += 1
        count["largest"] = max(count["largest"], off)
        if off > (ENOUGH_AT_KINKS if what == "kink" else ENOUGH):
            count["wrong"] += 1
            say(f"wrong: case {case}: {family}, {r.uniqueness}, {what} off by {off:.1e}, {r.distance}\n"
                f"    {A!r}, {B!r}, np.array({X_WA.tolist()}), np.array({X_WB.tolist()})")  # fmt: skip
    return tally


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", type=int)
    args = parser.parse_args()
    cases = range(args.first, args.first + args.pairs) if args.case is None else [args.case]
    tally = soak(args.seed, cases)
    for family, count in tally.items():
        rest = ", ".join(f"{name} {n}" for name, n in sorted(count.items()) if name != "largest")
        print(f"{family:10} {rest}, largest error {count['largest']:.1e}")
    return int(any(count["wrong"] for count in tally.values()))


if __name__ == "__main__":
    sys.exit(main())
