"""Spheres that enclose bodies: excess by their number, seconds, and published sets beside sets of as many.

    python benchmarks/enclosing_spheres.py                      # "robots": link by link, the sets of ../shared/data
    python benchmarks/enclosing_spheres.py --table excess       # excess by count, 1 to 128, of five bodies
    python benchmarks/enclosing_spheres.py --table facets       # seconds to make and to verify, 300 to 100,000 facets

outside: of a link's surface beside the published spheres, share and mm; their mm, ours mm: how far published spheres,
and spheres made, exceed the link. Seconds are the processor's.
"""

from __future__ import annotations

import time
from functools import cache

import numpy as np
from inputs import SHARED, use_tests

use_tests("families", "oracles")
from mesh_shapes import block_ring, bumpy_sphere

import collide
from collide.adapters.bench.claims import Claim, Options, grid, main
from collide.spheres.sphere_audit import audit_spheres

_ROBOTS = ("panda", "ur5", "fetch")


@cache
def robot(name: str, published: bool) -> collide.Robot:
    file = SHARED / "robots" / name / f"{name}{'_spherized' if published else ''}.urdf"
    return collide.Robot.load(file, srdf=False, missing_meshes="skip")


def made(shape: collide.Shape, **arguments) -> tuple[collide.EnclosingSpheres, float]:
    start = time.process_time()
    spheres = collide.enclosing_spheres(shape, **arguments)
    return spheres, time.process_time() - start


def link_cases(options: Options):
    for name in _ROBOTS[: 1 if options.quick else 3] if SHARED.is_dir() else ():
        for link in robot(name, False).geometry:
            if link in robot(name, True).geometry:
                yield {"robot": name, "link": link}


def links(options: Options, **case) -> list[dict]:
    parts, balls = (robot(case["robot"], published).geometry[case["link"]] for published in (False, True))
    shape = collide.Compound([(part.shape, part.X_LG) for part in parts])
    audit = audit_spheres(
        shape, np.array([ball.X_LG[:3, 3] for ball in balls]), np.array([ball.shape.radius for ball in balls])
    )
    spheres, seconds = made(shape, count=len(balls))
    start = time.process_time()
    spheres.verify(shape)
    return [{
        "spheres": len(balls), "outside_share": audit.share[1], "outside_mm": 1e3 * audit.outside[1],
        "their_mm": 1e3 * audit.excess[1], "ours_mm": 1e3 * spheres.excess[1], "s": seconds,
        "verify_s": time.process_time() - start,
    }]


def link_notes(rows: list[dict]):
    for name in dict.fromkeys(row["robot"] for row in rows):
        some = [row for row in rows if row["robot"] == name]
        out = sum(row["outside_mm"] > 0 for row in some)
        yield (f"{name}: published spheres leave parts of {out} of {len(some)} links outside, by up to "
               f"{max(row['outside_mm'] for row in some):.1f} mm, and exceed links by up to "
               f"{max(row['their_mm'] for row in some):.1f} mm; as many for each link enclose it by up to "
               f"{max(row['ours_mm'] for row in some):.1f} mm, in {sum(row['s'] for row in some):.1f} s")


def bodies() -> dict[str, collide.Shape]:
    return {
        "box": collide.Box((1, 2, 3)), "capsule": collide.Capsule(0.1, 1.0), "cylinder": collide.Cylinder(0.3, 1.0),
        "ring": collide.Mesh(*block_ring()), "bumps": collide.Mesh(*bumpy_sphere(400)),
    }


def excess_cases(options: Options):
    yield from grid(body=bodies(), count=(1, 8) if options.quick else (1, 2, 4, 8, 16, 32, 64, 128))


def excess(options: Options, body: str, count: int) -> list[dict]:
    spheres, seconds = made(bodies()[body], count=count)
    lower, upper = spheres.excess
    return [{"spheres": len(spheres.radii), "excess_lower": lower, "excess_upper": upper, "s": seconds}]


def facet_cases(options: Options):
    yield from grid(facets=(300, 3000) if options.quick else (300, 1000, 3000, 10_000, 30_000, 100_000), count=(8, 32))


def facets(options: Options, facets: int, count: int) -> list[dict]:
    mesh = collide.Mesh(*bumpy_sphere(facets))
    spheres, seconds = made(mesh, count=count)
    start = time.process_time()
    spheres.verify(mesh)
    return [{
        "excess": spheres.excess[1], "s": seconds, "verify_s": time.process_time() - start,
        "pieces": sum(len(cover.pieces) for cover in spheres.certificate),
    }]


CLAIMS = [
    Claim("robots", "published spheres of links, and as many that enclose them", link_cases, links, notes=link_notes,
          file="enclosing-spheres"),
    Claim("excess", "how far spheres exceed a body, by their number", excess_cases, excess, asked_for=True,
          file="enclosing-spheres-excess", everywhere=True),
    Claim("facets", "seconds to make and to verify", facet_cases, facets, asked_for=True,
          file="enclosing-spheres-facets"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
