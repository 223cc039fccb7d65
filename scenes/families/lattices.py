"""Neighbours in lattices of touching boxes, and hulls that stand on a half-space."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.case import HALFSPACE, Body, Case, pair
from collide.scenes.families.ingredients import EXACT_ROTATIONS, box, decimals, random_hull, rotation
from collide.scenes.families.touching import contact, placed


def box_lattice(rng, index) -> Case:
    """Two neighbouring cells of a lattice that boxes fill without a gap: they share a face, an edge or
    a corner. Sizes dyadic (exactly touching) or of two decimals, the lattice straight or turned."""
    dyadic, turned = index % 2 == 0, index // 2 % 2 == 1
    size = rng.integers(1, 17, 3) / 16.0 if dyadic else decimals(rng, 0.05, 0.9)
    cell = rng.integers(-20, 21, 3)
    shared = (1, 2, 3)[index // 4 % 3]
    step = np.where(np.arange(3) < shared, rng.choice((-1, 1), 3), 0)[rng.permutation(3)]
    if turned:
        R = EXACT_ROTATIONS[rng.integers(24)] if dyadic else rotation(rng)
    else:
        R = np.eye(3)
    return pair(*(Body(box(size), R, R @ (size * where)) for where in (cell, cell + step)))


def halfspace_touch(rng, index) -> Case:
    """A half-space under a lattice hull: exactly touching, one ulp of its height into it, one ulp out of
    it, in turn; the plane has an integer normal and an exact rotation."""
    placement = contact(rng, ("vf", "ff", "ve")[index // 3 % 3])
    case, normal = placed(rng, placement)
    # A's lattice hull gives way to the half-space behind the plane of contact, in A's frame.
    n = (case.R1.T @ normal).astype(float)
    in_plane = next(p for p, w in zip(placement.B, placement.B @ placement.normal) if w == 0)
    world = _world_of(case, placement, in_plane)
    offset = float(n @ (case.R1.T @ (world - case.t1)))
    t2 = case.t2.copy()
    axis = int(np.abs(normal).argmax())
    way = (0, -1, 1)[index % 3]  # into it is against the normal
    if way:
        t2[axis] = np.nextafter(t2[axis], way * np.sign(normal[axis]) * np.inf)
    return case._replace(P=n[None], kind=HALFSPACE, offset=offset, t2=t2)


def _world_of(case: Case, placement, point) -> np.ndarray:
    """Where a lattice point of B stands in the world, exactly."""
    row = int(np.flatnonzero((placement.B == point).all(axis=1))[0])
    return case.R2 @ case.Q[row] + case.t2


def halfspace_near(rng, index) -> Case:
    """A random half-space and a random hull, swept every other time, with signed distance
    ±10^-k for k = 2 … 16 in turn, as far as rounding lets it be set."""
    normal = rng.standard_normal(3)
    normal /= np.linalg.norm(normal)
    R1, t1, offset = rotation(rng), rng.uniform(-1, 1, 3), float(rng.uniform(-1, 1))
    radius = float(rng.uniform(0.01, 0.3)) if index % 2 else 0.0
    B = Body(random_hull(rng), rotation(rng), rng.uniform(-1, 1, 3))
    n = R1 @ normal
    gap = float(rng.choice((-1.0, 1.0))) * 10.0 ** -(2 + index % 15)
    lowest = float((B.world() @ n).min())
    t2 = B.t + (float(n @ t1) + offset + radius + gap - lowest) * n
    case = pair(Body(normal[None], R1, t1), B._replace(t=t2), radius_b=radius)
    return case._replace(kind=HALFSPACE, offset=offset)


MORE_FAMILIES = (box_lattice, halfspace_touch, halfspace_near)
