"""`collide` and `distance` of meshes, solids and surfaces, against each other and against convex shapes, judged
exactly."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from mesh_families import RIGHT_ANGLES, random_pose, soup
from mesh_shapes import block_ring, box, bumpy_sphere
from naive_triangles import as_integers, facet_pairs, surface_distance, winding, world_points
from validate_bvh import validate_mesh_tree

import collide
from collide.lowering.parts import parts_of

TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def joined(*surfaces):
    """Several surfaces as one."""
    faces, n = [], 0
    for vertices, own in surfaces:
        faces.append(own + n)
        n += len(vertices)
    return np.concatenate([vertices for vertices, _ in surfaces]), np.concatenate(faces)


def hollow_box():
    """A box with a cavity."""
    vertices, faces = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    return joined(box(), (vertices, faces[:, ::-1]))


def meshes():
    """(shape, vertices, faces, solid, radius) of meshes."""
    overlapping = joined(box(), box((0, 0, 0), (2, 2, 2)))
    return [
        (collide.Mesh(*given), *given, True, 0.0)
        for given in (box(), block_ring(), hollow_box(), overlapping, TETRAHEDRON)
    ] + [(collide.Mesh(*given), *given, False, 0.0) for given in (soup(np.random.default_rng(5), 9), surface())]


def surface():
    """A box without its lid."""
    vertices, faces = box()
    return vertices, faces[2:]


def convex_shapes():
    """The same of convex shapes, with facets written down here."""
    point, line = np.zeros((1, 3)), np.array([[0, 0, -0.25], [0, 0, 0.25]])
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    small = box((-0.125,) * 3, (0.125,) * 3)
    return [
        (collide.Box((0.25, 0.25, 0.25)), *small, True, 0.0),
        (collide.ConvexHull(TETRAHEDRON[0]), *TETRAHEDRON, True, 0.0),
        (collide.ConvexHull(square), square, np.array([[0, 1, 2], [0, 2, 3]]), False, 0.0),
        (collide.ConvexHull(line), line, np.array([[0, 1, 1]]), False, 0.0),
        (collide.ConvexHull(point), point, np.array([[0, 0, 0]]), False, 0.0),
        (collide.Sphere(0.25), point, np.array([[0, 0, 0]]), False, 0.25),
        (collide.Capsule(0.125, 0.5), line, np.array([[0, 1, 1]]), False, 0.125),
        (collide.ConvexHull(small[0], radius=0.5), *small, True, 0.5),
    ]


def inside(body, X, points) -> bool:
    """Whether one of the exact world points lies in a solid."""
    a, b = as_integers(world_points(body[1], X), points)
    return any(winding([[a[v] for v in face] for face in body[2].tolist()], p) not in (0,) for p in b)


def truth(A, B, X_WA, X_WB) -> bool:
    if facet_pairs(*A[1:3], X_WA, *B[1:3], X_WB):
        return True
    for one, other, X, Y in ((A, B, X_WA, X_WB), (B, A, X_WB, X_WA)):
        if one[3] and inside(one, X, world_points(other[1], Y)):
            return True
    radius = Fraction(A[4] + B[4])
    return bool(radius) and surface_distance(*A[1:3], X_WA, *B[1:3], X_WB)[0] <= radius**2


def poses(rng, count):
    """Pairs of poses: turned any way, by right angles on a grid (touching, aligned), and middles together."""
    for k in range(count):
        if k % 3 == 0:
            yield random_pose(rng, 0.6), random_pose(rng, 0.6)
        elif k % 3 == 1:
            yield tuple(collide.pose(rng.integers(-8, 9, 3) / 8, R=RIGHT_ANGLES[rng.integers(3)]) for _ in range(2))
        else:
            X = random_pose(rng, 0.2)
            Y = random_pose(rng, 0.0)
            Y[:3, 3] = X[:3, 3] + rng.integers(-4, 5, 3) / 8
            yield X, Y


def snippet(A, B, X, Y) -> str:
    return f"A = {A[0]!r} {A[1].tolist()} {A[2].tolist()}\nB = {B[0]!r}\nX_WA = {X.tolist()}\nX_WB = {Y.tolist()}"


PAIRS = [(A, B) for A, B in product(meshes(), [*meshes(), *convex_shapes()])]


def test_booleans_are_exact():
    rng = np.random.default_rng(71)
    told: list[bool] = []
    within = 0
    for A, B in PAIRS:
        for X, Y in poses(rng, 3):
            want = truth(A, B, X, Y)
            assert collide.collide(A[0], B[0], X, Y) == want, snippet(A, B, X, Y)
            assert collide.collide(B[0], A[0], Y, X) == want, snippet(A, B, X, Y)
            within += want and not facet_pairs(*A[1:3], X, *B[1:3], Y)
            told.append(want)
    assert 0.2 < np.mean(told) < 0.9, np.mean(told)
    assert within > 15, within


def test_distances_are_bracketed_and_overlaps_come_apart():
    rng = np.random.default_rng(72)
    gaps = depths = 0
    for A, B in PAIRS[::4]:
        for X, Y in poses(rng, 3):
            r, swapped = collide.distance(A[0], B[0], X, Y), collide.distance(B[0], A[0], Y, X)
            assert np.array_equal(r.point_a, swapped.point_b) and (r.lower, r.upper) == (swapped.lower, swapped.upper)
            assert r.distance == swapped.distance and np.array_equal(r.normal, 0.0 - swapped.normal), snippet(
                A, B, X, Y
            )
            assert abs(np.linalg.norm(r.normal) - 1) < 1e-12 and r.lower <= r.distance <= r.upper
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-13
            if r.hit:
                depths += 1
                assert truth(A, B, X, Y) and r.distance <= 0.0 and (r.upper <= 0.0 or r.how == 0)
                apart = Y.copy()
                apart[:3, 3] -= r.lower * r.normal * (1 + 1e-9) - 1e-12 * r.normal
                assert not truth(A, B, X, apart), snippet(A, B, X, Y)
            else:
                gaps += 1
                square = surface_distance(*A[1:3], X, *B[1:3], Y)[0]
                radius = Fraction(A[4] + B[4])
                assert (Fraction(r.lower) + radius) ** 2 <= square <= (Fraction(r.upper) + radius) ** 2
                assert 0.0 < r.distance and r.upper - r.lower < 1e-12, snippet(A, B, X, Y)
    assert gaps > 15 and depths > 15, (gaps, depths)


def test_batches_give_the_bits_of_single_calls():
    rng = np.random.default_rng(73)
    gaps = 0
    for A, B in [*PAIRS[::7], (PAIRS[0][0], PAIRS[0][0])]:
        X, Y = (np.stack(side) for side in zip(*poses(rng, 6)))
        hits, rows = collide.collide(A[0], B[0], X, Y), collide.distance(A[0], B[0], X, Y)
        unsigned, swapped = collide.distance(A[0], B[0], X, Y, signed=False), collide.distance(B[0], A[0], Y, X)
        gaps += int((~hits).sum())
        threaded = collide.collide(A[0], B[0], np.repeat(X, 8, axis=0), np.repeat(Y, 8, axis=0), threads=2)
        assert (threaded == np.repeat(hits, 8)).all()
        for k in range(6):
            assert collide.collide(A[0], B[0], X[k], Y[k]) == hits[k]
            assert collide.distance(A[0], B[0], X[k], Y[k]).rows.tobytes() == rows[k].rows.tobytes()
            assert collide.distance(A[0], B[0], X[k], Y[k], signed=False).rows.tobytes() == unsigned[k].rows.tobytes()
            one = collide.distance(B[0], A[0], Y[k], X[k])
            assert one.rows.tobytes() == swapped[k].rows.tobytes()
            assert not (one.normal + rows[k].normal).any() and one.distance == rows[k].distance
        many = collide.collide([A[0]] * 6, [B[0]] * 6, X, Y)
        assert (many == hits).all()
    assert gaps > 15


def test_limits_and_unsigned_distances():
    A, B = collide.Mesh(*box()), collide.Sphere(0.5)
    far = collide.pose((4.0, 0, 0))
    r = collide.distance(A, B, np.eye(4), far, max_distance=1.0)
    assert r.beyond and r.distance == r.lower > 1.0 and r.upper == np.inf and not r.hit
    near = collide.distance(A, B, np.eye(4), far, max_distance=3.0)
    assert not near.beyond and abs(near.distance - 2.5) < 1e-15 and near.certified
    deep = collide.distance(A, B, np.eye(4), np.eye(4), signed=False)
    assert deep.hit and deep.distance == 0.0 and deep.certified and not deep.normal.any()


def test_gaps_beyond_the_range_of_floats():
    """Boxes are floats in units of the bodies: at 1e40 times these they cannot tell how far; hulls do."""
    A = collide.Mesh(*box())
    X = np.stack([collide.pose((x, 0, 0)) for x in (3.0, 1e40, 1e49)])
    point = collide.Mesh(np.zeros((3, 3)), [[0, 1, 2]])
    for B, near in ((collide.Box((1, 1, 1)), 1.5), (collide.Sphere(0.5), 1.5), (point, 2.0)):
        rows = collide.distance(A, B, np.eye(4), X)
        assert rows.certified.all() and not rows.beyond.any() and not rows.hit.any()
        assert (rows.lower <= rows.distance).all() and (rows.distance <= rows.upper).all()
        assert np.abs(rows.distance / [near, 1e40, 1e49] - 1).max() < 1e-12
        assert not collide.collide(A, B, np.eye(4), X).any()
        limited = collide.distance(A, B, np.eye(4), X, max_distance=1e42)
        assert limited.beyond.tolist() == [False, False, True] and limited.lower[2] > 1e42
        for k in range(3):
            assert collide.distance(A, B, np.eye(4), X[k]).rows.tobytes() == rows[k].rows.tobytes()


def test_limits_in_a_notch():
    """The hulls meet, the surfaces are beyond the limit: a ball's core is a point, and no smaller than others for
    that."""
    corner = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    vertices = np.array([[x, y, z] for z in (0, 1) for x, y in corner], dtype=np.float64)
    below = [[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 5, 4]]
    walls = [row for i in range(6) for j in [(i + 1) % 6] for row in ([i, j, j + 6], [i, j + 6, i + 6])]
    L = collide.Mesh(vertices, below + [[a + 6, c + 6, b + 6] for a, b, c in below] + walls)
    assert L.solid
    X_WB = collide.pose((1.5, 1.5, 0.5))
    tiny = L.scaled(2.0**-100)
    for B, gap in (
        (collide.Sphere(0.25), 0.25),
        (collide.ConvexHull([[0, 0, 0]]), 0.5),
        (tiny, 0.5),
        (collide.Box((0.5,) * 3), 0.25),
    ):
        for limit in (0.0, 0.125, 0.1875, 0.5625, np.inf):
            for swapped in (False, True):
                pair = (B, L, X_WB, np.eye(4)) if swapped else (L, B, np.eye(4), X_WB)
                r = collide.distance(*pair, max_distance=limit)
                said = f"collide.distance(*{pair}, max_distance={limit}) -> {r}"
                assert not r.hit and r.lower - 2.0**-40 <= gap <= r.upper and r.distance > 0.0, said
                assert B is tiny or (
                    r.beyond and r.lower > limit if gap > limit else abs(r.distance - gap) < 2.0**-40
                ), said
    world = collide.World()
    world.add(L, np.eye(4), name="L")
    world.add(collide.Sphere(0.25), X_WB, name="ball")
    assert not len(world.distances(max_distance=0.125)) and len(world.distances(max_distance=0.3)) == 1


def test_depth_of_a_small_body_in_a_hollow_one():
    """The hulls overlap by far more: the way out of the wall is found, and proven."""
    ring, small = collide.Mesh(*block_ring()), collide.Mesh(*box((-0.1,) * 3, (0.1,) * 3))
    r = collide.distance(ring, small, np.eye(4), collide.pose((0.42, 0, 0)))
    assert -0.0201 < r.distance <= -0.02 and r.normal.tolist() == [-1, 0, 0] and not r.certified
    touching = collide.distance(ring, small, np.eye(4), collide.pose((0.4, 0, 0)))
    assert touching.hit and -1e-12 < touching.distance <= 0.0


def test_half_spaces():
    rng = np.random.default_rng(74)
    mesh = collide.Mesh(*block_ring())
    for X, Y in poses(rng, 30):
        ground = collide.Halfspace(rng.normal(size=3), -0.5)
        r = collide.distance(mesh, ground, X, Y)
        want = collide.distance(collide.ConvexHull(mesh.vertices), ground, X, Y)
        assert (r.hit, r.lower, r.upper) == (want.hit, want.lower, want.upper)
        assert collide.collide(ground, mesh, Y, X) == r.hit


def test_scaled_copies_share_the_tree():
    rng = np.random.default_rng(75)
    mesh = collide.Mesh(*bumpy_sphere(400))
    other = collide.Mesh(*box((-0.4,) * 3, (0.4,) * 3))
    for factor in (2.0, 0.125, 3.0, 0.7, 1e-9, 1e12 / 7):
        copy = mesh.scaled(factor)
        validate_mesh_tree(copy.tree, copy.vertices, copy.faces)
        assert np.array_equal(copy.tree.ids, mesh.tree.ids)
        fresh = collide.Mesh(copy.vertices, copy.faces)
        X, Y = (np.stack(side) for side in zip(*poses(rng, 12)))
        X[:, :3, 3] *= factor
        Y[:, :3, 3] *= factor
        own = collide.Mesh(other.vertices * factor, other.faces)
        assert (collide.collide(copy, own, X, Y) == collide.collide(fresh, own, X, Y)).all()
    assert mesh.scaled(4.0).tree.nodes is mesh.tree.nodes


def test_worlds_hold_meshes():
    ring, small = collide.Mesh(*block_ring()), collide.Mesh(*box((-0.1,) * 3, (0.1,) * 3))
    world = collide.World()
    world.add(ring, name="ring")
    world.add(small, collide.pose((0.45, 0, 0)), name="small")
    world.add(collide.Sphere(0.25), name="ball in the hole")
    world.add(collide.Box((0.2, 0.2, 0.2)), collide.pose((0.0, 0.1, 0.2)), name="box in the ball")
    assert world.collides()
    found = world.collisions()
    assert found.names == [("ring", "small"), ("ball in the hole", "box in the ball")]
    near = world.distances(max_distance=0.3)
    for row, (a, b) in zip(near.rows, near.names):
        A, B = world.body(a), world.body(b)
        alone = collide.distance(A.shape, B.shape, A.X_WB, B.X_WB)
        assert (row["distance"], row["lower"], row["upper"]) == (alone.distance, alone.lower, alone.upper)
    world.set_pose("small", collide.pose((1.0, 0, 0)))
    world.allow("ball in the hole", "box in the ball")
    assert world.collisions().names == [("ring", "small")]  # wholly inside
    hits = world.query(small, collide.pose((-1.0, 0, 0)))
    assert hits["b"].tolist() == [0] and hits["hit"].all()
    outside = world.query(collide.Sphere(0.5), collide.pose((1.0, 0, 1.5)), max_distance=0.6)
    assert outside["b"].tolist() == [0] and abs(outside["distance"][0] - 0.5) < 1e-12


def test_what_is_not_answered_is_refused_by_name():
    mesh = collide.Mesh(*box())
    with pytest.raises(collide.UnsupportedQuery, match="convex parts"):
        parts_of(collide.Compound([(mesh, np.eye(4))]))
    mirror = np.diag([1.0, 1.0, -1.0, 1.0])
    with pytest.raises(collide.InvalidPose):
        collide.collide(mesh, mesh, np.eye(4), mirror, check_poses=False)


def test_worlds_answer_as_pairs_do():
    rng = np.random.default_rng(76)
    shapes = [shape for shape, *_ in [*meshes(), *convex_shapes()]]
    world = collide.World()
    for k in range(30):
        world.add(shapes[k % len(shapes)], random_pose(rng, 2.0))
    bodies = [world.body(k) for k in range(30)]
    want = [
        (a.id, b.id)
        for i, a in enumerate(bodies)
        for b in bodies[i + 1 :]
        if collide.collide(a.shape, b.shape, a.X_WB, b.X_WB)
    ]
    found = world.collisions()
    assert list(zip(found["a"].tolist(), found["b"].tolist())) == want and 20 < len(want) < 300
    assert world.collides()
    for a, b in want:
        world.allow(a, b)
    assert not world.collides() and len(world.collisions()) == 0


def test_convex_scenes_know_nothing_of_meshes():
    code = (
        "import sys, numpy as np, collide\n"
        "A, B, X = collide.Box((1, 1, 1)), collide.ConvexHull(np.random.default_rng(0).normal(size=(500, 3))), "
        "np.eye(4)\n"
        "collide.collide(A, B, X, X), collide.distance(A, B, X, X), collide.collide(A, B, X, np.stack([X, X]))\n"
        "world = collide.World(); world.add(A); world.add(B); world.collides(), world.collisions(), world.query(A, X)\n"
        "print([name for name in sys.modules if 'narrowphase.facets.' in name or 'bvh' in name])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "[]"
