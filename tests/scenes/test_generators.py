"""Generated scenes: the same seed gives the same numbers, sizes are kept, wrong names are answered."""

from __future__ import annotations

import numpy as np
import pytest

from collide.errors import SceneError
from collide.scenes import generate
from collide.scenes.generators import names


def same(a, b) -> bool:
    return len(a.bodies) == len(b.bodies) and all(
        x.name == y.name and x.shape == y.shape and np.array_equal(x.X_WB, y.X_WB) and x.static == y.static
        for x, y in zip(a.bodies, b.bodies)
    )


@pytest.mark.parametrize("name", names())
def test_seeded(name):
    assert same(generate(name, 7), generate(name, 7))
    assert not same(generate(name, 7), generate(name, 8))
    assert generate(name, 7).sources == [f"generate('{name}', seed=7)"]


def test_sizes():
    assert len(generate("clutter", n=37).bodies) == 37
    assert len(generate("stack", layers=3, wide=5).bodies) == 16
    assert len(generate("workcell", parts=40).bodies) - len(generate("workcell", parts=0).bodies) == 40
    assert {type(body.shape).__name__ for body in generate("clutter", n=200).bodies} == {
        "Sphere", "Box", "Capsule", "Cylinder", "Cone", "Ellipsoid", "ConvexHull", "HPolytope",
    }


def test_density_decides_how_many_collide():
    sparse = generate("clutter", 1, n=60, density=0.02).world().collisions()
    dense = generate("clutter", 1, n=60, density=3.0).world().collisions()
    assert len(sparse) < 10 and len(dense) > 100


def test_static_share():
    bodies = generate("clutter", n=200, static=0.5).bodies
    assert 70 < sum(body.static for body in bodies) < 130


def test_a_stack_rests():
    result = generate("stack", layers=4, wide=3).world().distances(max_distance=1e-6)
    assert len(result) >= 3 + 3 * 3
    assert np.abs(result["distance"]).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (
            "cluter",
            {},
            (r"no generated scene has the name 'cluter' \(did you mean 'clutter'\?\); there are accordions, chazelle, "
            r"clutter, harpsicordia, stack, workcell"),
        ),
        ("clutter", {"m": 3}, "clutter has no argument 'm'.*; it has n, density, static"),
        ("clutter", {"n": 0}, "n must be an integer ≥ 1, got 0"),
        ("clutter", {"density": 0}, "density must lie within"),
        ("clutter", {"seed": -1}, "seed must be a whole number ≥ 0 of at most 64 bits, got -1"),
        ("stack", {"layers": 1.5}, "layers must be an integer"),
        ("stack", {"jitter": -1}, "jitter must lie within"),
        ("harpsicordia", {"n": 9}, "n must be an integer ≥ 10, got 9"),
        ("harpsicordia", {"stretch": 5.9}, r"stretch must lie within \[6, 100000\], got 5.9"),
        ("harpsicordia", {"spread": 2.0}, r"spread, for strings of stretch 10, must lie within"),
        ("harpsicordia", {"gap": "wide"}, "gap must lie within"),
        ("accordions", {"strings": 0}, "strings must be an integer ≥ 1, got 0"),
        ("chazelle", {"strings": 2.5}, "strings must be an integer ≥ 1, got 2.5"),
        ("workcell", {"parts": -1}, "parts must be an integer ≥ 0"),
    ],
)
def test_refused(name, options, message):
    with pytest.raises(SceneError, match=message):
        generate(name, **options)
