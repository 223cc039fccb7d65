"""What `combine` makes of r solids, before rounding, against how often each solid's own facets wind around points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from naive_triangles import world_points
from solid_judge import draw_points, exact_corners, in_world, six_volumes, solids_of
from solid_membership import as_doubles, windings

from collide.solids.arrangement import arrange
from collide.solids.solid_operands import solid_operand

#: Families and how many solids, so that every number from 2 to 8 occurs.
CASES = [
    ("smooth", 2), ("boxes", 8), ("cavities", 6), ("rings", 3), ("touching boxes", 5), ("random shells", 3),
    ("grid shells", 4), ("turned grid shells", 4), ("identical shells", 7), ("degenerate shells", 7),
    ("touching shells", 3), ("scaled shells", 4),
]


class ManyVerdict(NamedTuple):
    """wrong : descriptions of points judged otherwise.   n_points, n_in, n_near : points judged, of which the rule
    keeps, and within 1e-9 of the size of a surface.   adds_up : volumes of the rule and of its opposite make the
    union's."""

    wrong: list[str]
    n_points: int
    n_in: int
    n_near: int
    adds_up: bool


def many_solids(family: str, seed: int, r: int):
    """r solids of a family and their poses: the pairs of several of its cases, all but the first near one another."""
    shapes, poses = [], []
    k = 0
    while len(shapes) < r:
        A, B, X, Y = solids_of(family, 1000 * seed + k)
        shapes += [A, B]
        poses += [X, Y]
        k += 1
    return shapes[:r], np.array(poses[:r])


def random_table(r: int, seed: int):
    """A rule by a random truth table, which leaves out what no body holds."""
    table = np.random.default_rng(seed).random(2**r) < 0.5
    table[0] = False
    return lambda bits: bool(table[sum(bit << k for k, bit in enumerate(bits))])


def rules(r: int, seed: int) -> dict:
    """Rules by name, written anew."""
    return {
        "union": lambda bits: True in bits,
        "at least 2": lambda bits: bits.count(True) >= 2,
        "parity": lambda bits: bits.count(True) % 2 == 1,
        "intersection": lambda bits: False not in bits,
        "a random table": random_table(r, seed),
    }


def judge_many(family: str, seed: int, r: int, n_points: int) -> ManyVerdict:
    """All rules at n_points points, half of them within 1e-9 of the size of a surface."""
    rng = np.random.default_rng(seed)
    shapes, poses = many_solids(family, seed, r)
    operands = [solid_operand("test", f"shapes[{k}]", shapes[k], poses[k], True) for k in range(r)]
    arrangement = arrange(operands)
    origin = world_points(shapes[0].vertices[:1], poses[0])[0]
    inputs = [in_world(shape, X, origin) for shape, X in zip(shapes, poses)]
    held = arrangement.holds()
    several = exact_corners(arrangement, arrangement.boundary(held.sum(axis=1) >= 2)[0], origin)
    points, n_near = draw_points(rng, [as_doubles(t) for t in inputs], as_doubles(several), n_points)
    winds = [windings(t, points) for t in inputs]
    wrong, n_judged, n_in, adds_up = [], 0, 0, True
    union = six_volumes(exact_corners(arrangement, arrangement.boundary(held.any(axis=1))[0], origin))
    for name, rule in rules(r, seed).items():
        keep = np.array([rule(tuple(bits)) for bits in held.tolist()])
        corners = exact_corners(arrangement, arrangement.boundary(keep)[0], origin)
        others = exact_corners(arrangement, arrangement.boundary(held.any(axis=1) & ~keep)[0], origin)
        adds_up &= six_volumes(corners) + six_volumes(others) == union
        for k, number in enumerate(windings(corners, points)):
            if any(w[k] is None for w in winds):
                continue  # on a surface: regular sets differ from closed ones
            bits = tuple(w[k] >= 1 for w in winds)
            n_judged, n_in = n_judged + 1, n_in + rule(bits)
            if number != int(rule(bits)):
                wrong.append(f"{name}: winds {number} times around {points[k].tolist()}, held by {bits}")
    return ManyVerdict(wrong, n_judged, n_in, n_near, adds_up)


def snippet_many(family: str, seed: int, r: int, n_points: int) -> str:
    return f"from many_judge import *; print(judge_many({family!r}, {seed}, {r}, {n_points}))  # on tests' path"


def same_bits(a, b) -> bool:
    """Whether two results have the same mesh, byte for byte."""
    if a.empty or b.empty:
        return a.empty and b.empty
    same = [np.array_equal(x.view(np.uint8), y.view(np.uint8)) for x, y in (
        (a.mesh.vertices, b.mesh.vertices), (a.mesh.faces, b.mesh.faces))]
    return all(same)
