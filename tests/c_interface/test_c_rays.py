"""Rays through the C interface: Python's `raycast`, bit by bit; where Python takes integers its answer lies in C's
bracket, or C refuses.

Whether Python's are right is judged in `tests/casts`.
"""

from __future__ import annotations

import math

import c_library as c
import numpy as np
import pytest
import soak_pairs

import collide
from collide.casts import ray_facets, ray_parts
from collide.kernels import mode
from collide.lowering.closed_regions import reach_of
from collide.scenes.families.ingredients import direction

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid", "solid", "surface",
)
N = 12


@pytest.fixture
def integers(monkeypatch) -> list[str]:
    """Names of the functions that decide in integers, as often as they are called."""
    called: list[str] = []
    for owner, name in ((ray_parts, "_settle"), (ray_facets._MetFacets, "_in_order")):
        function = getattr(owner, name)
        monkeypatch.setattr(
            owner, name, lambda *given, name=name, function=function: (called.append(name), function(*given))[1]
        )
    return called


def told(hits: collide.RayHits, k: int) -> np.ndarray:
    """A row of C with what Python says of ray k."""
    row = np.zeros((), dtype=c.RAY_HIT)
    for name, values in hits._asdict().items():
        if name != "starts":
            row[name] = values[k]
    return row


def rays_at(shape, X: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """N rays towards a shape, from outside and inside, some beside it, some along its axes."""
    size = 1.0 if isinstance(shape, collide.Halfspace) else reach_of(shape)
    origins = X[:3, 3] + size * random.normal(size=(N, 3)) * random.choice([0.1, 1.0, 3.0], size=(N, 1))
    ways = X[:3, 3] + 0.4 * size * random.normal(size=(N, 3)) - origins
    ways[::5] = X[:3, int(random.integers(3))] * random.choice([-1.0, 1.0])
    ways[1::5] = [direction(random) for _ in ways[1::5]]
    return origins, ways * 10.0 ** random.uniform(-2, 2)


def test_rays_have_pythons_bits(integers):
    asker, counts = c.Asker(), {"met": 0, "missed": 0, "bracket": 0, "refused": 0, "open": 0}
    for number in range(240):
        k = soak_pairs.draw(101, number, 1e3, CONVEX)
        random = np.random.default_rng([102, number])
        origins, ways = rays_at(k.A, k.X_WA, random)
        limit = math.inf if number % 3 else float(random.uniform(0, 2))
        own = c.CMesh(k.A) if isinstance(k.A, collide.Mesh) else c.CShape(k.A)
        _, rows, statuses, _ = asker.rays(own, k.X_WA, origins, ways, limit)
        for i in range(N):
            del integers[:]
            wanted = told(collide.raycast(k.A, k.X_WA[None], origins[i], ways[i], max_distance=limit), 0)
            name = f"draw(101, {number}), ray {i}"
            if statuses[i] == c.UNSUPPORTED:
                assert integers, name
                counts["refused"] += 1
            elif integers and rows[i].tobytes() != wanted.tobytes():
                assert statuses[i] == c.OK and rows[i]["hit"] and wanted["hit"] and rows[i]["certified"], name
                assert rows[i]["lower"] <= wanted["upper"] and wanted["lower"] <= rows[i]["upper"], name
                counts["bracket"] += 1
            else:
                assert (statuses[i], rows[i].tobytes()) == (c.OK, wanted.tobytes()), (name, limit, rows[i], wanted)
                counts["met" if rows[i]["hit"] else "missed"] += 1
                counts["open"] += not rows[i]["certified"]
    assert counts["met"] >= 900 and counts["missed"] >= 900 and counts["refused"] <= 40, counts


def test_rays_through_edges_have_a_bracket_that_holds_the_first_facet(integers):
    """Through the middle of a box's sides, where two triangles meet, and at corners and edges of a turned box."""
    asker, counts = c.Asker(), {"bracket": 0, "refused": 0}
    box = collide.Box(1.0, 0.75, 0.5)
    own, corners = c.CShape(box), np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * box.size
    for number in range(60):
        random = np.random.default_rng([103, number])
        X = soak_pairs.rotation(random)
        X[:3, 3] = random.normal(size=3)
        a, b = corners[random.choice(8, 2, replace=False)]
        target = X[:3, :3] @ (a + b if number % 2 else 0.5 * (a + b)) * 0.5 + X[:3, 3]
        way = X[:3, :3] @ np.eye(3)[number % 3] + (0.1 * random.normal(size=3) if number % 4 else 0.0)
        del integers[:]
        wanted = told(collide.raycast(box, X[None], target - 3.0 * way, way), 0)
        status, rows, _, _ = asker.rays(own, X, target - 3.0 * way, way)
        if status == c.UNSUPPORTED:
            assert integers and not rows[0]["hit"], number
            counts["refused"] += 1
        elif integers and rows[0].tobytes() != wanted.tobytes():
            row = rows[0]
            assert row["hit"] and row["certified"] and row["lower"] <= row["distance"] <= row["upper"], number
            assert row["lower"] <= wanted["lower"] and wanted["upper"] <= row["upper"], (number, row, wanted)
            assert row["upper"] - row["lower"] <= 1e-10 and np.abs(row["point"] - wanted["point"]).max() < 1e-10, number
            counts["bracket"] += 1
        else:
            assert (status, rows[0].tobytes()) == (c.OK, wanted.tobytes()), number
    assert counts["bracket"] >= 10 and counts["refused"] <= 20, counts


def test_rays_at_many_facets_have_pythons_bits():
    """More hits of a ray than there is room for at first: a stack of flush plates, seen through."""
    sheet = np.array([(x, y, z) for z in np.arange(400) * 1e-14 for x, y in ((0, 0), (1, 0), (0, 1))])
    mesh = collide.Mesh(sheet, np.arange(1200).reshape(-1, 3), solid=False)
    status, rows, _, _ = c.Asker().rays(c.CMesh(mesh), np.eye(4), [0.2, 0.2, 5.0], [0, 0, -1.0])
    wanted = collide.raycast(mesh, np.eye(4), [0.2, 0.2, 5.0], [0, 0, -1.0])
    assert status == c.OK and rows[0]["hit"] and rows[0]["lower"] <= wanted.distance <= rows[0]["upper"]


def test_arguments_out_of_range_are_told():
    asker, shape = c.Asker(), collide.Cylinder(0.5, 2.0)
    own, origin, way = c.CShape(shape), [0.125, 0.25, 5.0], [0.0, 0.0, -1.0]
    _, rows, _, _ = asker.rays(own, np.eye(4), origin, way)
    assert rows[0]["distance"] == 4.0 and rows[0]["facet"] == 2
    for given in (([math.nan, 0, 0], way), ([1e51, 0, 0], way), (origin, [0, 0, 0]), (origin, [0, 0, math.inf])):
        with pytest.raises(collide.InvalidArgument):
            collide.raycast(shape, np.eye(4), *given)
        assert asker.rays(own, np.eye(4), *given)[0] == c.INVALID_ARGUMENT, given
    for limit in (-1.0, math.nan):
        assert asker.rays(own, np.eye(4), origin, way, limit)[0] == c.INVALID_ARGUMENT
    assert asker.rays(own, np.eye(4), origin, way, flags=c.UNSIGNED)[0] == c.INVALID_ARGUMENT
    assert asker.rays(own, np.eye(4), [origin] * 3, [way] * 2)[0] == c.INVALID_ARGUMENT
    assert asker.rays(c.CMesh(collide.Sphere(1.0)), np.eye(4), origin, way)[0] == c.INVALID_ARGUMENT
    for one in (shape, collide.Box(1, 1, 1)):
        made = c.CShape(one)
        for number, bad in enumerate(c.odd_poses()):
            for flags, check in ((0, True), (c.TRUST_POSES, False)):
                status, rows, _, _ = asker.rays(made, bad, origin, way, flags=flags)
                try:
                    wanted = told(collide.raycast(one, bad[None], origin, way, check_poses=check), 0)
                except collide.InvalidPose:
                    assert status == c.INVALID_POSE, (number, flags)
                else:
                    assert status == c.UNSUPPORTED or rows[0].tobytes() == wanted.tobytes(), (number, flags)
