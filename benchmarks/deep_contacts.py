"""Contacts of meshes that overlap deeply, beside coal's: a ball of a metre across in a box, or in a ball like it.

    python benchmarks/deep_contacts.py              # ten seconds
    python benchmarks/deep_contacts.py --quick      # three; no file

deep   µs a call of one pair, 1 mm to 25 cm deep, balls of 2,000 to 92,000 facets. coal is asked for one contact, and
       for all: pairs of facets that meet
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

from contact_peers import CoalContacts

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main

#: Tolerances of balls of 2,000, 23,120 and 92,480 facets [m].
BALLS = {"ball 2k": 2.2e-3, "ball 23k": 1.4e-4, "ball 92k": 3.3e-5}


@cache
def ball_mesh(name: str) -> collide.Mesh:
    return collide.Mesh(*collide.tessellate(collide.Sphere(0.5), tolerance=BALLS[name]))


def deep(options: Options, case: str, depth: float) -> Race:
    name, solid = case.split(" in ")
    A, X = ball_mesh(name), collide.pose(rpy=(0.3, -0.2, 0.5))
    if solid == "box":
        B, Y = collide.Box((1.0, 0.8, 0.6)), collide.pose((0.02, 0.03, depth - 0.8))
    else:
        B, Y = A, collide.pose((0.6 * (1.0 - depth), 0.0, 0.8 * (1.0 - depth)), rpy=(0.7, 0.2, 0.1))
    tasks: dict[str, Callable] = {"collide": partial(collide.contacts, A, B, X, Y)}
    beside = {"collide": {"contacts": len(tasks["collide"]())}}
    if installed(coal="coal"):
        for peer, max_contacts in (("coal", 1), ("coal, all", 1 << 20)):
            made = CoalContacts([A], [B], [X], [Y], 0.0, max_contacts=max_contacts)
            beside[peer], tasks[peer] = {"contacts": len(made.manifolds()[0].distance)}, made.detect
    return Race(tasks, beside=beside, columns={"facets": len(A.faces)})


def deep_cases(options: Options):
    names = list(BALLS)[: 2 if options.quick else None]
    cases = [f"{name} in {solid}" for name in names for solid in ("box", "ball")]
    return grid(case=cases, depth=(1e-3, 1e-2, 5e-2, 0.25))


CLAIMS = [Claim("deep", "µs a call", deep_cases, deep, turns=5, file="contacts-deep", bar="median")]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
