"""Rays against meshes: first hits, all hits and their brackets equal brute force in fractions, wherever rays run."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from mesh_families import grid, random_pose, right_angle_pose, soup
from mesh_shapes import block_ring, box, bumpy_sphere
from naive_triangles import cross, inner, minus, world_points

import collide
from collide.errors import InvalidArgument, InvalidPose
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets import ray_surface as kernels
from collide.narrowphase.facets.facet_queries import facets_on_rays
from collide.numerics.exact_points import enters


def first_on_segment(o, d, a, b) -> Fraction | None:
    """The least t ≥ 0 with o + t d on the segment from a to b."""
    e, w, dd = minus(b, a), minus(o, a), inner(d, d)
    n = cross(d, e)
    if n != [0, 0, 0]:
        if inner(n, w) != 0:
            return None
        s = Fraction(inner(cross(d, w), n), inner(n, n))
        t = Fraction(inner(minus([x + s * y for x, y in zip(a, e)], o), d), dd)
        return t if 0 <= s <= 1 and t >= 0 else None
    if cross(d, w) != [0, 0, 0]:
        return None
    ends = sorted(Fraction(inner(minus(p, o), d), dd) for p in (a, b))
    return None if ends[1] < 0 else max(ends[0], Fraction(0))


def first_in_triangle(o, d, T) -> Fraction | None:
    """The least t ≥ 0 with o + t d in the closed triangle, whatever it is."""
    u, v, w = minus(T[1], T[0]), minus(T[2], T[0]), minus(o, T[0])
    n = cross(u, v)
    slope = inner(n, d)
    if slope != 0:
        t = Fraction(-inner(n, w), slope)
        p = [x + t * y for x, y in zip(w, d)]
        square = inner(n, n)
        beta, gamma = inner(cross(p, v), n), inner(cross(u, p), n)
        return t if t >= 0 and beta >= 0 and gamma >= 0 and beta + gamma <= square else None
    found = [first_on_segment(o, d, T[k], T[(k + 1) % 3]) for k in range(3)]
    if n != [0, 0, 0] and inner(n, w) == 0:
        beta, gamma = inner(cross(w, v), n), inner(cross(u, w), n)
        if beta >= 0 and gamma >= 0 and beta + gamma <= inner(n, n):
            return Fraction(0)
    return min((t for t in found if t is not None), default=None)


def brute_force(vertices, faces, X, o, d):
    """[(t, facet)] of all facets met, sorted."""
    points = world_points(vertices, X)
    o, d = ([Fraction(x) for x in values.tolist()] for values in (o, d))
    met = ((first_in_triangle(o, d, [points[v] for v in face]), k) for k, face in enumerate(faces.tolist()))
    return sorted((t, k) for t, k in met if t is not None)


def some_rays(rng, vertices, faces, X):
    """Rays of every kind: at random, at and through corners and edges, along edges and in planes, from on the
    surface."""
    corners = vertices[faces] @ X[:3, :3].T + X[:3, 3]
    origins, directions = [], []
    for _ in range(3):
        origins.append(rng.normal(size=3) * 2)
        directions.append(rng.normal(size=3) * 2.0 ** rng.integers(-30, 30))
    for _ in range(9):
        a, b, c = corners[rng.integers(len(corners))][rng.permutation(3)]
        aim = [a, (a + b) / 2, a / 2 + b / 4 + c / 4][rng.integers(3)]
        kind = rng.integers(4)
        direction = [b - a, rng.normal(size=3), c - b, np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])][
            rng.integers(4)
        ]
        if not direction.any():
            direction = np.array([0.0, 0.0, 1.0])
        origins.append(aim - direction * [0.0, 1.0, 2.0, -0.5][kind])
        directions.append(direction)
    return np.array(origins), np.array(directions)


def check(shape, vertices, faces, X, origins, directions, limit=np.inf):
    """Both kinds of answers against brute force; returns (rays, hits, rays with ties for the first)."""
    first = collide.raycast(shape, X, origins, directions, max_distance=limit)
    every = collide.raycast(shape, X, origins, directions, max_distance=limit, all_hits=True)
    ties = 0
    for k, (o, d) in enumerate(zip(origins, directions)):
        case = (vertices.tolist(), faces.tolist(), X.tolist(), o.tolist(), d.tolist(), limit)
        want = [(t, f) for t, f in brute_force(vertices, faces, X, o, d) if t <= limit]
        rows = slice(*every.starts[k : k + 2])
        assert every.facet[rows].tolist() == [f for _, f in want], case
        for lower, upper, value, (t, _) in zip(every.lower[rows], every.upper[rows], every.distance[rows], want):
            assert Fraction(lower) <= t <= Fraction(upper) and lower <= value <= upper, case
        assert bool(first.hit[k]) == bool(want) == bool(every.hit[k]), case
        if not want:
            assert first.facet[k] == -1 and first.distance[k] == np.inf, case
            continue
        assert first.facet[k] == want[0][1] and Fraction(first.lower[k]) <= want[0][0] <= Fraction(first.upper[k]), case
        size = (np.abs(o - X[:3, 3]).sum() + np.abs(vertices).sum(axis=1).max() * 4) / np.abs(d).max()
        assert first.upper[k] - first.lower[k] <= 2.0**-36 * size, case
        assert np.allclose(first.point[k], o + first.distance[k] * d, rtol=1e-15, atol=0.0), case
        ties += len(want) > 1 and want[0][0] == want[1][0]
    return len(origins), int(first.hit.sum()), ties


@pytest.mark.many(4)
@pytest.mark.parametrize("kind", ["soup", "grid", "flat", "thin", "scaled"])
def test_hits_are_those_of_brute_force(kind):
    rng = np.random.default_rng(["soup", "grid", "flat", "thin", "scaled"].index(kind) + 700)
    total = np.zeros(3, dtype=int)
    for _ in range(24):
        vertices, faces = grid(rng, 14) if kind in ("grid", "flat") else soup(rng, 10)
        if kind == "flat":
            vertices[:, 2] = 0.5
        if kind == "thin":
            vertices = np.round(vertices * 16) / 16
            vertices[1::3] = vertices[::3] + (vertices[2::3] - vertices[::3]) * rng.choice(
                [0.5, 0.25, 0.3, 1.0], (len(faces), 1)
            )
        scale = 10.0 ** rng.integers(-20, 20) if kind == "scaled" else 1.0
        X = right_angle_pose(rng) if rng.random() < 0.5 else random_pose(rng)
        origins, directions = some_rays(rng, vertices, faces, X)
        vertices, origins = vertices * scale, origins * scale
        X[:3, 3] *= scale
        mesh = collide.Mesh(vertices, faces, solid=False)
        limit = [np.inf, np.inf, np.inf, 1.0, 0.5, 0.0][rng.integers(6)]
        total += check(mesh, vertices, faces, X, origins, directions, limit)
    assert 0.1 < total[1] / total[0] < 0.95 and total[2] >= {"grid": 20, "flat": 20}.get(kind, 0), total


def test_no_ray_slips_through_a_closed_mesh():
    """From inside out, through corners, through points of edges as near as doubles come, and at random."""
    rng = np.random.default_rng(11)
    vertices, faces = bumpy_sphere(600)
    mesh = collide.Mesh(vertices, faces)
    X = random_pose(rng)
    corners = vertices[faces] @ X[:3, :3].T + X[:3, 3]
    centre = X[:3, 3]
    weights = rng.random((len(faces), 1))
    aims = np.concatenate(
        [corners[:, 0], weights * corners[:, 0] + (1 - weights) * corners[:, 1], rng.normal(size=(500, 3)) + centre]
    )
    for sign in (1.0, -1.0):
        found = collide.raycast(mesh, X, np.broadcast_to(centre, aims.shape), sign * (aims - centre))
        assert found.hit.all()
        assert (found.normal * (aims - centre)).sum(axis=1).max() * sign > 0.0
    outside = centre + 3 * (aims - centre) / np.linalg.norm(aims - centre, axis=1)[:, None]
    found = collide.raycast(mesh, X, outside, centre - outside, all_hits=True)
    assert found.hit.all() and (np.diff(found.starts) >= 1).all()


def test_inside_along_and_from_the_surface():
    cube = collide.Mesh(*box())
    for origin, direction, distance, normal in (
        ((3, 0.5, 0.2), (-2, 0, 0), 1.0, (1, 0, 0)),
        ((0, 0.5, 0.2), (1, 0, 0), 1.0, (1, 0, 0)),  # from inside, out
        ((1, 0.5, 0.2), (1, 0, 0), 0.0, (1, 0, 0)),  # on the surface
        ((3, 1, 0.2), (-1, 0, 0), 2.0, (1, 0, 0)),  # along in the plane of a side, through an edge
        ((3, 1, 1), (-1, 0, 0), 2.0, (1, 0, 0)),  # along an edge
        ((3, 3, 3), (-1, -1, -1), 2.0, (1, 0, 0)),  # at a corner
    ):
        got = collide.raycast(cube, np.eye(4), origin, direction)
        assert got.hit and got.lower <= distance <= got.upper and abs(got.distance - distance) < 1e-14, (origin, got)
        assert tuple(got.normal) == normal and (distance > 0 or got.upper == 0), (origin, got)
    assert not collide.raycast(cube, np.eye(4), (3, 1 + 2**-52, 0), (-1, 0, 0)).hit
    assert not collide.raycast(cube, np.eye(4), (3, 0, 0), (1, 0, 0)).hit
    assert not collide.raycast(cube, np.eye(4), (3, 0, 0), (-1, 0, 0), max_distance=np.nextafter(2.0, 1)).hit
    assert collide.raycast(cube, np.eye(4), (3, 0, 0), (-1, 0, 0), max_distance=2.0).hit
    same = collide.raycast(collide.Box((2, 2, 2)), np.eye(4), (3, 0.3, 0), (-1, 0, 0))
    assert same.lower <= 2.0 <= same.upper and same.normal.tolist() == [1, 0, 0]


def test_far_tiny_and_long_directions():
    cube = collide.Mesh(*box())
    for direction in (1e-90, 2.0**-300, 1e90):
        got = collide.raycast(cube, np.eye(4), (3, 0.3, 0.1), (-direction, 0, 0))
        assert got.hit and Fraction(got.lower) <= Fraction(2) / Fraction(direction) <= Fraction(got.upper)
    far = collide.raycast(cube, np.eye(4), (1e40, 0.3, 0.1), (-1, 0, 0))
    assert far.hit and Fraction(far.lower) <= Fraction(1e40) - 1 <= Fraction(far.upper)
    slightly = collide.raycast(cube, np.eye(4), (1e40, 0.3, 0.1), (-1, 1e-30, 0))
    assert not slightly.hit  # 1e10 off by then
    tiny = collide.Mesh(
        np.concatenate([box()[0] * 1e-12, [[1000.0, 0, 0], [1000, 1, 0], [1000, 0, 1]]]),
        [*box()[1], [8, 9, 10]],
        solid=False,
    )
    got = collide.raycast(tiny, np.eye(4), [(-5, 0, 0), (-5, 0.1, 0.1), (-5, 2e-12, 0)], (1, 0, 0))
    assert got.hit.tolist() == [True, True, True] and got.facet[1] == got.facet[2] == 12


def test_batches_are_single_calls():
    rng = np.random.default_rng(5)
    mesh = collide.Mesh(*block_ring())
    poses = np.array([right_angle_pose(rng) if k % 2 else random_pose(rng) for k in range(40)])
    origins = poses[:, :3, 3] + rng.normal(size=(40, 3)) * 2
    directions = poses[:, :3, 3] - origins + rng.normal(size=(40, 3)) * 0.5
    origins[::4], directions[::4] = np.round(origins[::4] * 2) / 2, np.eye(3)[rng.integers(0, 3, 10)]
    together = collide.raycast(mesh, poses, origins, directions)
    assert 8 < together.hit.sum() < 35
    for k in range(40):
        alone = collide.raycast(mesh, poses[k], origins[k], directions[k])
        for name in ("hit", "distance", "lower", "upper", "point", "normal", "facet"):
            one, other = (np.asarray(getattr(r, name)) for r in (alone, together))
            assert one.tobytes() == other[k].tobytes(), name
    one_ray = collide.raycast(mesh, poses, origins[0], directions[0])
    assert one_ray.hit.shape == (40,) and one_ray.hit[0] == together.hit[0]


def test_what_is_refused():
    mesh = collide.Mesh(*box())
    eye = np.eye(4)
    for call, words in (
        (lambda: collide.raycast(mesh, eye, (0, 0, np.nan), (1, 0, 0)), "not finite"),
        (lambda: collide.raycast(mesh, eye, (0, 0, 0), (np.inf, 0, 0)), "not finite"),
        (lambda: collide.raycast(mesh, eye, [(0, 0, 0)] * 2, [(1, 0, 0), (0, 0, 0)]), r"directions_W\[1\].*length 0"),
        (lambda: collide.raycast(mesh, eye, (0, 0, 1e60), (1, 0, 0)), "exceeds"),
        (lambda: collide.raycast(mesh, eye, (0, 0, 0), (1, 1e-200, 0)), "make them 0"),
        (lambda: collide.raycast(mesh, eye, (0, 0, 0), (1e-200, 0, 0)), "no component"),
        (lambda: collide.raycast(mesh, eye, [(0, 0, 0)] * 2, [(1, 0, 0)] * 3), "lengths do not match"),
        (lambda: collide.raycast(mesh, eye, (0, 0), (1, 0, 0)), r"\(3,\) or \(N, 3\)"),
        (lambda: collide.raycast(mesh, eye, (0, 0, 0), (1, 0, 0), max_distance=-1), "max_distance"),
        (lambda: collide.raycast("mesh", eye, (0, 0, 0), (1, 0, 0)), "must be a shape"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            call()
    with pytest.raises(InvalidPose):
        collide.raycast(mesh, -eye, (0, 0, 0), (1, 0, 0))
    assert collide.raycast(mesh, eye, np.zeros((0, 3)), (1, 0, 0)).hit.shape == (0,)


def test_many_hits_are_not_lost():
    """More than there is room for at first: the walk goes on where it stopped."""
    n = 400
    sheet = np.array([[-1.0, -1, 0], [2, -1, 0], [-1, 2, 0]])
    vertices = np.concatenate([sheet + np.array([0, 0, k]) for k in range(n)])
    mesh = collide.Mesh(vertices, np.arange(3 * n).reshape(n, 3), solid=False)
    found = collide.raycast(mesh, np.eye(4), [(0, 0, -1), (0.1, 0.1, n)], [(0, 0, 1), (0, 0, -1)], all_hits=True)
    assert np.diff(found.starts).tolist() == [n, n]
    assert found.facet[:n].tolist() == list(range(n)) and found.distance[:n].tolist() == [k + 1.0 for k in range(n)]


CHILD = """
import hashlib, pickle, sys
import numpy as np
import collide
digest = hashlib.sha256()
vertices, faces, poses, origins, directions = pickle.load(sys.stdin.buffer)
mesh = collide.Mesh(vertices, faces)
hits = 0
for X, o, d in zip(poses, origins, directions):
    for every in (False, True):
        found = collide.raycast(mesh, X, o, d, all_hits=every)
        hits += int(found.hit.sum())
        for values in found[:7]:
            digest.update(np.ascontiguousarray(values).tobytes())
    digest.update(collide.contains(mesh, X, o).tobytes())
print(digest.hexdigest(), hits)
"""


def test_kernels_as_plain_python_say_the_same_bits():
    rng = np.random.default_rng(71)
    vertices, faces = block_ring()
    poses = [right_angle_pose(rng) if k % 2 else random_pose(rng) for k in range(8)]
    origins = [X[:3, 3] + rng.normal(size=(3, 3)) * 2 for X in poses]
    directions = [X[:3, 3] - o + rng.normal(size=(3, 3)) * 0.5 for X, o in zip(poses, origins)]
    origins[1], directions[1] = np.round(origins[1] * 2) / 2, np.eye(3)
    said = [
        subprocess.run(
            [sys.executable, "-c", CHILD], input=pickle.dumps((vertices, faces, poses, origins, directions)),
            env={**os.environ, "NUMBA_DISABLE_JIT": plain}, cwd=Path(collide.__file__).parents[1], check=True,
            capture_output=True,
        ).stdout
        for plain in ("0", "1")
    ]
    assert said[0] == said[1] and int(said[0].split()[1]) > 10


def test_exact_settling_of_a_walk_that_sees_nothing():
    """`enters` by itself, on every kind of triangle."""
    assert enters([(0, 0, 0), (4, 0, 0), (0, 4, 0)], (1, 1, 8), (0, 0, -2)) == 4
    assert enters([(0, 0, 0), (4, 0, 0), (0, 4, 0)], (-3, 1, 0), (2, 0, 0)) == Fraction(3, 2)
    assert enters([(0, 0, 0), (4, 0, 0), (8, 0, 0)], (5, -6, 0), (0, 4, 0)) == Fraction(3, 2)
    assert enters([(2, 0, 0), (4, 0, 0), (8, 0, 0)], (-2, 0, 0), (1, 0, 0)) == 4
    assert enters([(2, 0, 0)] * 3, (-2, 0, 0), (4, 0, 0)) == 1
    tree = build_mesh_tree(*box())
    given = np.array([[0.0, 0, 5, 0, 0, -1, 16, np.inf]])
    assert kernels.RAY == 8 and len(facets_on_rays(tree, np.eye(4), given, True)[0]) == 2


def test_empty_batches_of_poses_and_numbers_beyond_doubles():
    mesh, none = collide.Mesh(*box()), np.zeros((0, 3))
    for poses, origins, directions in (
        (np.zeros((0, 4, 4)), none, none), (np.zeros((0, 4, 4)), np.zeros(3), np.ones(3)),
        (np.eye(4), none, np.ones(3)),
    ):
        for every in (False, True):
            r = collide.raycast(mesh, poses, origins, directions, all_hits=every)
            assert len(r.hit) == len(r.facet) == 0 and r.point.shape == (0, 3)
    beyond = 10**400
    for more in ({"max_distance": beyond}, {"origins_W": [beyond, 0, 0]}, {"directions_W": [beyond, 0, 0]}):
        with pytest.raises(collide.InvalidArgument):
            collide.raycast(
                **{"shape": mesh, "X_WA": np.eye(4), "origins_W": np.zeros(3), "directions_W": np.ones(3), **more}
            )
    with pytest.raises(collide.InvalidArgument):
        collide.contacts(mesh, mesh, np.eye(4), np.eye(4), margin=beyond)
    with pytest.raises(collide.InvalidPose):
        collide.raycast(mesh, [[beyond] * 4] * 4, np.zeros(3), np.ones(3))
