"""``depth="least"`` of fields and regions: judged by support functions of what they are made of."""

from __future__ import annotations

import numpy as np
import pytest
import support_gaps
from naive import Case, pose, random_pose, reproducible, rng_of, same_bits
from support_gaps import Convex, deepest_pair, first_gaps, sphere_points

import collide

I = np.eye(4)


def box_mesh(*sizes: float) -> collide.Mesh:
    return collide.Mesh(*collide.tessellate(collide.Box(sizes))[:2])


def rounded(convex: Convex, radius: float) -> Convex:
    return convex._replace(heights=lambda N: convex.heights(N) + radius)


def grid(rng) -> tuple[collide.Shape, list[Convex]]:
    occupied = rng.random((5, 5, 4)) < 0.5
    centres = 0.2 * (np.argwhere(occupied) + 0.5)
    shift = pose(t=(-0.5, -0.5, -0.4))
    cells = [support_gaps.cuboid((0.1, 0.1, 0.1)).at(pose(t=c)).at(shift) for c in centres]
    return collide.VoxelGrid(occupied, 0.2, shift), cells


def cloud(rng) -> tuple[collide.Shape, list[Convex]]:
    points, radii = rng.uniform(-0.4, 0.4, (25, 3)), rng.uniform(0.1, 0.25, 25)
    return collide.PointCloud(points, radii), [support_gaps.ball(r).at(pose(t=p)) for p, r in zip(points, radii)]


def swept(rng) -> tuple[collide.Shape, list[Convex]]:
    return collide.SweptMesh(box_mesh(0.8, 0.6, 0.4), 0.1), [rounded(support_gaps.cuboid((0.4, 0.3, 0.2)), 0.1)]


def terrain(rng) -> tuple[collide.Shape, list[Convex]]:
    """A valley along y with its bottom at x = 0: two prisms."""
    x = 0.05 * (np.arange(1027) - 513)
    slope = rng.uniform(0.5, 1.5)
    field = collide.HeightField(np.tile(slope * np.abs(x), (1027, 1)), (0.05, 0.05), bottom=-1.0)
    x, y = field.grid_lines
    assert field.is_field and abs(x[513]) < 1e-12
    prisms = []
    for end in (x[0], x[-1]):
        outline = [(0.0, -1.0), (0.0, 0.0), (end, slope * abs(end)), (end, -1.0)]
        normals = [*np.eye(3), *-np.eye(3), np.array((-slope * np.sign(end), 0, 1)) / np.hypot(slope, 1)]
        prisms.append(support_gaps.hull([(u, v, z) for u, z in outline for v in (y[0], y[-1])], normals))
    return field, prisms


def region(rng) -> tuple[collide.Shape, list[Convex]]:
    """What is left of a plane and under another: here a box, far larger than all that stands near."""
    wedge = collide.HPolytope([(1, 0, 0), (0, 0, 1)], [0.0, 0.0], bounded=False)
    return wedge, [support_gaps.cuboid((20, 20, 20)).at(pose(t=(-20, 0, -20)))]


FIELDS = {"grid": grid, "cloud": cloud, "swept": swept, "terrain": terrain, "region": region}


def body(rng, kind: str) -> tuple[collide.Shape, list[Convex]]:
    sizes = rng.uniform(0.2, 0.6, 3)
    if kind == "box":
        return collide.Box(sizes), [support_gaps.cuboid(sizes / 2)]
    if kind == "cylinder":
        return collide.Cylinder(sizes[0] / 2, sizes[1]), [support_gaps.cylinder(sizes[0] / 2, sizes[1])]
    X = random_pose(rng, 0.2)
    ball_and_box = [(collide.Sphere(0.15), I), (collide.Box(sizes), X)]
    if kind == "union":
        return collide.Compound(ball_and_box), [support_gaps.ball(0.15), support_gaps.cuboid(sizes / 2).at(X)]
    return box_mesh(*sizes), [support_gaps.cuboid(sizes / 2)]


def checked(case: Case, sets_a: list[Convex], sets_b: list[Convex]) -> tuple[collide.PairResult, float]:
    """The least row, and how much longer its way is than the shortest of the oracle."""
    with reproducible(case):
        quick, r = collide.distance(*case), collide.distance(*case, depth="least")
        assert quick.lower <= r.lower <= r.distance <= r.upper <= quick.upper <= 0 and r.hit
        assert deepest_pair(sets_a, sets_b, -r.lower * r.normal) < 2e-4, "still together"
        assert not collide.collide(*case.with_b_moved((1e-9 - r.lower) * r.normal))
        U = np.concatenate([sphere_points(300), r.normal + 0.05 * sphere_points(60), r.normal[None]])
        gaps = first_gaps(sets_a, sets_b, U / np.linalg.norm(U, axis=1)[:, None], 600)
        assert -r.upper <= gaps.min() * (1 + 1e-9), "a way out is shorter than the lower bound"
        return r, -r.lower / gaps.min()


QUICK = [(field, kind) for field in ("grid", "cloud", "region") for kind in ("box", "cylinder", "union")]
SLOW = [("terrain", "box"), ("swept", "box"), ("swept", "union"), *((field, "mesh") for field in FIELDS)]


@pytest.mark.many(3)
@pytest.mark.parametrize(("field", "kind"), [*QUICK, *(pytest.param(*of, marks=pytest.mark.slow) for of in SLOW)])
def test_fields_and_regions_are_searched_as_what_they_are_made_of(field, kind):
    rng, widths, longer = rng_of("least of fields", field, kind), [], []
    for k in range(8):
        (A, sets_a), (B, sets_b) = FIELDS[field](rng), body(rng, kind)
        depth = 0.05 if field in ("terrain", "region") else 0.0
        case = Case(A, B, random_pose(rng, 0.2), I)
        case = case._replace(X_WB=case.X_WA @ random_pose(rng, 0.3) @ pose(t=(0, 0, -depth)))
        if not collide.collide(*case):
            continue
        sets_a, sets_b = [s.at(case.X_WA) for s in sets_a], [s.at(case.X_WB) for s in sets_b]
        if k % 2:
            case, sets_a, sets_b = case.swapped(), sets_b, sets_a
        r, ratio = checked(case, sets_a, sets_b)
        widths.append(r.lower / min(r.upper, -1e-9))
        longer.append(ratio)
        swapped = collide.distance(*case.swapped(), depth="least")
        assert not same_bits(collide.results.flipped(swapped.rows), r.rows)
        if len(widths) == 2:
            break
    assert len(widths) == 2
    assert max(longer) < 1.05 and min(widths) < (1.35 if kind == "mesh" or field in ("swept", "terrain") else 1.01)


def test_of_very_many_items_the_bounds_still_hold():
    """A cloud of more balls than are paired: the way out is the cloud's, the lower bound that of some balls."""
    rng = rng_of("a dense cloud")
    points = rng.uniform(-0.4, 0.4, (3000, 3))
    case = Case(collide.PointCloud(points, 0.05), collide.Box((0.3, 0.2, 0.2)), I, random_pose(rng, 0.2))
    quick, r = collide.distance(*case), collide.distance(*case, depth="least")
    assert quick.lower <= r.lower <= r.distance <= r.upper <= quick.upper < 0
    assert not collide.collide(*case.with_b_moved((1e-9 - r.lower) * r.normal))
    U = sphere_points(400)
    balls = [support_gaps.ball(0.05).at(pose(t=p)) for p in points]
    B = [support_gaps.cuboid((0.15, 0.1, 0.1)).at(case.X_WB)]
    assert -r.upper <= first_gaps(balls[::10], B, U, 200).max(initial=0.0) and len(r.certificate) >= 1
    X_WB = np.repeat(case.X_WB[None], 400, axis=0)
    X_WB[:, :3, 3] -= r.upper * (1 - 1e-9) * U
    heights = np.abs((points - X_WB[:, None, :3, 3]) @ case.X_WB[:3, :3]) - (0.15, 0.1, 0.1)
    assert (np.linalg.norm(np.maximum(heights, 0.0), axis=2).min(axis=1) <= 0.05).all(), "a way is free"


def test_batches_and_worlds_answer_fields_as_single_calls_do():
    rng = rng_of("fields in worlds")
    field, other = cloud(rng)[0], collide.Box((0.4, 0.3, 0.5))
    X = np.stack([pose(t=(0.1, 0.05, 0.0)), pose(t=(3.0, 0, 0)), pose(t=(0.0, 0.2, 0.1))])
    rows = collide.distance(field, other, I, X, depth="least").rows
    assert rows["hit"].tolist() == [True, False, True]
    for k in range(3):
        assert rows[k : k + 1].tobytes() == collide.distance(field, other, I, X[k], depth="least").rows.tobytes()
    of_lists = collide.distance([field] * 3, [other] * 3, np.repeat(I[None], 3, axis=0), X, depth="least").rows
    assert of_lists.tobytes() == rows.tobytes()
    world = collide.World()
    world.add(field, I)
    world.add(other, X[0])
    (row,) = world.collisions(depth="least").rows
    assert all(row[name] == rows[0][name] for name in ("distance", "lower", "upper"))
    assert row["lower"] >= row["upper"] * 1.01 and collide.distance(field, other, I, X[0]).lower <= row["lower"]
