"""Certificates of large terrain and swept meshes: every boolean beside convex parts has a proof, and verify takes
exactly what a judge in integers takes, of thousands of forgeries none."""

from __future__ import annotations

import json
from collections import Counter
from unittest import mock

import naive
import numpy as np
import pytest
from hollow_bodies import torus
from naive_certificates import FieldJudge, items_of

import collide
from collide.certificates import field_proofs, swept_hulls
from collide.certificates.certificate import CertificateRefused
from collide.shapes import height_field

EYE = np.eye(4)


@pytest.fixture
def large_fields():
    """Every height field is one of too many cells to make triangles of all."""
    with mock.patch.object(height_field, "_MAX_MESHED", 0):
        yield


@pytest.fixture(params=[2, 3, 16])
def blocks(request):
    """Blocks of few cells, so that little terrain has many levels."""
    offsets = np.array(list(np.ndindex(request.param, request.param)))
    with (
        mock.patch.multiple(swept_hulls, _BLOCK=request.param, _IN_BLOCK=offsets),
        mock.patch.object(field_proofs, "_OPENED", request.param),
    ):
        yield


def bodies(rng) -> list:
    return [
        collide.Sphere(0.2), collide.Box((0.3, 0.5, 0.2)), collide.Capsule(0.1, 0.8), collide.Box((0.0, 0.6, 0.0)),
        collide.ConvexHull(rng.normal(size=(9, 3)) * 0.3), collide.Halfspace((0, 0.6, 0.8), -1.0),
        collide.Compound([(collide.Sphere(0.2), collide.pose((0.4, 0, 0))), (collide.Box((0.1, 0.1, 0.1)), EYE)]),
    ]


def terrain(rng, case: int) -> collide.HeightField:
    shape = rng.integers(2, 14, 2)
    heights = rng.normal(size=shape) * 0.4 if case % 2 else rng.integers(-4, 5, shape) / 8
    if case % 3 == 0:
        heights[rng.random(shape) < 0.1] = np.nan
        heights[:2, :2] = 0.25
    return collide.HeightField(heights, (0.25, 0.5), bottom=-3.0)


def swept(rng, case: int) -> collide.SweptMesh:
    if case % 3 == 0:
        return collide.SweptMesh(torus(1.0, 0.4), float(rng.choice([0.05, 0.125])))
    if case % 3 == 1:
        ball = collide.tessellate(collide.Sphere(1.0), size=0.7)
        return collide.SweptMesh(collide.Mesh(ball.vertices, ball.faces, solid=bool(rng.random() < 0.7)), 0.02)
    loose = rng.normal(size=(30, 3))
    return collide.SweptMesh(collide.Mesh(loose, np.arange(30).reshape(-1, 3), solid=False), 0.03)


def place(rng, case: int) -> tuple[np.ndarray, np.ndarray]:
    """Of a field and a body: on a lattice, far from the origin, deep within, or anywhere."""
    if case % 4 == 0:
        return EYE, collide.pose(rng.integers(-8, 9, 3) / 8)
    far = 1e6 if case % 4 == 1 else 1.0
    X = collide.pose(rng.normal(size=3) * far, rpy=rng.uniform(-3, 3, 3))
    spread = 0.3 if case % 4 == 3 else 1.2
    return X, X @ collide.pose(rng.uniform(-spread, spread, 3), rpy=rng.uniform(-3, 3, 3))


def forgeries(rng, proof: list, n_items: int) -> list:
    """Rows (kind, item, part, pairs) that differ from a proof."""
    kind, i, j, rows = proof[0]
    wrong = [[], [[kind, i, j + 1, rows], *proof[1:]], [[kind, i - 1, j, rows], *proof[1:]]]
    wrong += [[[other, i, j, rows]] for other in ("apart", "inside", "together", "plane") if other != kind]
    wrong = [w for w in wrong if not w or w[0][0] != "plane" or len(w[0][3][0]) == 3]
    wrong.append([["inside", n_items, j, [[-1, 0]]]])
    if kind != "plane":
        wrong += [[[kind, n_items, j, rows]], [[kind, i, j, []]], [[kind, i, j, [[rows[0][0], 99]]]]]
        wrong += [[[kind, int(rng.integers(n_items)), j, rows]], [[kind, i, j, rows[:1]]], proof * 2]
        return [*wrong, [[kind, i, j, rng.integers(0, 3, (2, 2)).tolist()]], [["plane", -1, j, [[0, 0, 1]]]]]
    wrong += [proof[:k] + proof[k + 1 :] for k in range(len(proof))]
    for change in (lambda n: [-v for v in n], lambda n: [0, 0, 0], lambda n: n[::-1],
                   lambda n: [v + int(rng.integers(-(2**38), 2**38)) for v in n],
                   lambda n: [v + int(rng.integers(-3, 4)) for v in n]):
        k = int(rng.integers(len(proof)))
        forged = [list(row) for row in proof]
        forged[k] = [*forged[k][:3], [change(forged[k][3][0])]]
        wrong.append(forged)
    return [*wrong, [["together", 0, 0, [[0, 0]]]]]


def takes(A, B, X_WA, X_WB, proof, hit: bool) -> bool:
    """Whether verify takes a proof."""
    try:
        collide.verify(A, B, X_WA, X_WB, Claim(hit), certificate=proof)
    except CertificateRefused:
        return False
    return True


class Claim:
    """A result that says no more than whether bodies meet."""

    def __init__(self, hit: bool):
        self.hit = hit

    def __len__(self) -> int:
        return 1


def turned(proof: list) -> list:
    """Of the bodies in the opposite order."""
    ways = {"plane": lambda row: [-v for v in row]}
    return [[kind, j, i, [ways.get(kind, lambda row: row[::-1])(row) for row in rows]] for kind, i, j, rows in proof]


def judge(rng, field, B, X, Y, seen: Counter) -> None:
    """One question: its proof is taken, forgeries are taken where the judge takes them."""
    told = f"{naive.spell(field)}, {naive.spell(B)}, {X.tolist()}, {Y.tolist()}"
    row = collide.distance(field, B, X, Y, signed=False)
    hit, judge_of_field = bool(row.hit), FieldJudge(field, B, X, Y)
    assert row.certificate is not None, told
    proof = json.loads(json.dumps(row.certificate))
    assert judge_of_field.proves(proof, hit=hit), told
    for wanted in (proof, collide.distance(B, field, Y, X, signed=False).certificate):
        first = wanted is proof
        assert takes(*((field, B, X, Y) if first else (B, field, Y, X)), wanted, hit), told
    seen["hit" if hit else "gap"] += 1
    seen["inside"] += proof[0][0] == "inside"
    seen["planes"] += len(proof) * (not hit)
    for wrong in [*forgeries(rng, proof, len(judge_of_field.items)), proof]:
        for claim in (hit, not hit):
            if wrong is proof and claim == hit:
                continue
            proves = judge_of_field.proves(wrong, hit=claim)
            assert takes(field, B, X, Y, wrong, claim) == proves, f"{told}, {wrong}, {claim}"
            assert takes(B, field, Y, X, turned(wrong), claim) == proves, f"turned: {told}, {wrong}, {claim}"
            assert not (proves and claim != hit), told
            seen["taken" if proves else "refused"] += 1


@pytest.mark.many(16)
@pytest.mark.parametrize("seed", range(12))
def test_terrain_is_proven_and_forgeries_are_refused(large_fields, blocks, seed):
    rng, seen = np.random.default_rng([21, seed]), Counter()
    for case in range(7):
        judge(rng, terrain(rng, case), bodies(rng)[(case + seed) % 7], *place(rng, case), seen)
    assert seen["hit"] and seen["gap"] and seen["refused"] > 170 and seen["taken"] > 5, seen


@pytest.mark.many(12)
@pytest.mark.parametrize("seed", range(24))
def test_swept_meshes_are_proven_and_forgeries_are_refused(seed):
    rng, seen = np.random.default_rng([22, seed]), Counter()
    for case in range(9):
        judge(rng, swept(rng, case + seed), bodies(rng)[case % 7], *place(rng, case), seen)
    assert seen["hit"] and seen["gap"] and seen["refused"] > 220 and seen["taken"] > 5, seen


# --- permanent cases ----------------------------------------------------------------------------


def certified(field, B, X, Y, *, hit: bool) -> list:
    """The proof of a question whose answer is known, taken by verify and by the judge."""
    row = collide.distance(field, B, X, Y, signed=False)
    assert bool(row.hit) == hit
    collide.verify(field, B, X, Y, row)
    proof = json.loads(json.dumps(row.certificate))
    assert FieldJudge(field, B, X, Y).proves(proof, hit=hit)
    return proof


@pytest.mark.many(3)
@pytest.mark.parametrize("steep", [0.0, 0.5])
def test_flush_bodies(large_fields, blocks, steep):
    """A wedge on a slope: in touch a hit, an ulp above a gap with few planes."""
    x = (np.arange(41) - 20) * 0.125
    field = collide.HeightField(np.broadcast_to(1.0 + steep * x, (21, 41)), 0.125)
    for above, hit in ((0.0, True), (2.0**-52, False)):
        low = [(a, b, 1.0 + steep * a + above) for a in (-0.5, 0.5) for b in (-0.25, 0.5)]
        body = collide.ConvexHull(np.array(low + [(a, b, 3.0) for a, b, _ in low]))
        proof = certified(field, body, EYE, EYE, hit=hit)
        assert len(proof) <= 6
        lower = collide.ConvexHull(body.points - (0, 0, above))
        assert hit or not takes(field, lower, EYE, EYE, proof, hit=False)
        if steep == 0.0:  # other normals are rounded
            certified(field, collide.Halfspace((0.0, 0.0, -1.0), -1.0 - above), EYE, EYE, hit=hit)


def test_a_body_in_a_hole(large_fields, blocks):
    """As wide as its hole a box meets the walls; an ulp narrower, below all heights, it is proven free."""
    heights = np.full((17, 17), 1.0)
    heights[8, 8] = np.nan
    field = collide.HeightField(heights, 0.5, bottom=-1.0)
    for width, hit in ((1.0, True), (1.0 - 2.0**-53, False)):
        proof = certified(field, collide.Box((width, width, 0.5)), EYE, EYE, hit=hit)
        assert hit or len(proof) >= 4
    certified(field, collide.Box((0.5, 0.5, 5.0)), EYE, EYE, hit=False)
    certified(field, collide.Sphere(0.51), EYE, EYE, hit=True)
    certified(field, collide.Sphere(0.49), EYE, EYE, hit=False)


def test_below_and_beside_terrain(large_fields, blocks):
    """Bottom and walls belong to the terrain; a point deep in it meets the prism of its cell."""
    field, point = collide.HeightField(np.zeros((9, 9)), 0.25, bottom=-1.0), collide.ConvexHull([(0.0, 0.0, 0.0)])
    for place, hit in (
        ((0.1, 0.2, -0.5), True), ((0, 0, -1), True), ((0, 0, -1 - 2.0**-52), False), ((1, 0, -0.5), True),
        ((1 + 2.0**-52, 0, -0.5), False), ((1, 1, 0), True), ((0.3, 0.4, 2.0**-1000), False),
    ):
        certified(field, point, EYE, collide.pose(place), hit=hit)


def test_far_from_the_origin(large_fields, blocks):
    """A micrometre above and below a peak 10⁷ m away, where doubles are 2 nm apart."""
    heights = np.zeros((33, 33))
    heights[20, 9] = 1.0
    field = collide.HeightField(heights, 0.5)
    x, y = field.grid_lines
    X = np.eye(4)
    X[:3, 3] = 1e7, -1e7, 1e7
    for above, hit in ((2.0**-20, False), (-(2.0**-20), True)):
        certified(field, collide.Box((0.5, 0.5, 0.5)), X, X @ collide.pose((x[9], y[20], 1.25 + above)), hit=hit)


def test_a_spike_raised_into_the_body_is_found(large_fields, blocks):
    """The proof of a gap above an even slope says nothing of the same slope with one spike, wherever it stands. Boxes
    around blocks reach into the body, so that all blocks are opened.
    """
    rng, x = np.random.default_rng(23), (np.arange(35) - 17) * 0.25
    even = np.broadcast_to(0.5 * x, (20, 35))
    low = [(a, b, 0.5 * a + 2.0**-6) for a in (-5.0, 5.0) for b in (-5.0, 5.0)]
    body = collide.ConvexHull(np.array(low + [(a, b, 9.0) for a, b, _ in low]))
    proof = collide.distance(collide.HeightField(even, 0.25), body, EYE, EYE).certificate
    assert takes(collide.HeightField(even, 0.25), body, EYE, EYE, proof, hit=False)
    for _ in range(40):
        spiked = even.copy()
        spiked[rng.integers(20), rng.integers(35)] += 2.0**-5
        assert not takes(collide.HeightField(spiked, 0.25), body, EYE, EYE, proof, hit=False)


def test_a_slope_across_two_blocks_is_found(large_fields, blocks):
    """A body in the slope of a spike, on either side. Planes below and around it part even cells, and those beyond the
    spike; of the cells between they say nothing, whichever block these are in.
    """
    rng, point = np.random.default_rng(24), collide.ConvexHull([(0.0, 0.0, 0.0)])
    planes = [("plane", -1, 0, [n]) for n in [(0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]]
    for _ in range(60):
        i, j, way = int(rng.integers(1, 19)), int(rng.integers(1, 34)), int(rng.integers(4))
        heights = np.zeros((20, 35))
        heights[i, j] = 1.0
        field = collide.HeightField(heights, 0.25)
        x, y = field.grid_lines
        away = 0.15 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)][way])
        Y = collide.pose((x[j] + away[0], y[i] + away[1], 0.2))
        assert not takes(field, point, EYE, Y, planes, hit=False), (i, j, way)
        assert collide.collide(field, point, EYE, Y)
        Y[2, 3] = 2.0
        assert takes(field, point, EYE, Y, planes, hit=False), (i, j, way)


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_planes_an_ulp_off(large_fields, radius):
    """A plane through the one item's vertex, and the body moved by ulps: nothing is taken that integers refuse, and
    without radii nothing refused that they take.
    """
    rng, seen = np.random.default_rng(25), Counter()
    for case in range(60):
        if case % 3 == 0 and radius == 0.0:
            field = collide.HeightField(rng.normal(size=(2, 2)), 1.0)
        elif case % 3 == 1 and radius > 0.0:
            field = collide.SweptMesh(collide.Mesh(rng.normal(size=(3, 3)), [[0, 1, 2]], solid=False), radius)
        else:
            field = collide.PointCloud(rng.normal(size=(1, 3)), radius)
        X, n = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)), rng.integers(-(2**40), 2**40, 3)
        body, unit = collide.ConvexHull([(0.0, 0.0, 0.0)], radius=radius), n / np.linalg.norm(n)
        corners = [p for points, _ in items_of(field) for p in points]
        least = min(((X[:3, :3] @ p + X[:3, 3]) @ unit, (X[:3, :3] @ p + X[:3, 3]).tolist()) for p in corners)[1]
        for ulps in range(-4, 5):
            Y = collide.pose(np.array(least) - unit * (2 * radius + ulps * 2.0**-52))
            proof = [("plane", -1, 0, [n.tolist()])]
            proves = FieldJudge(field, body, X, Y).proves(proof, hit=False)
            taken = takes(field, body, X, Y, proof, hit=False)
            assert taken == proves if radius == 0.0 else proves or not taken, (naive.spell(field), X.tolist(), ulps)
            seen[taken, ulps > 0] += 1
    assert seen[True, True] > 100 and seen[False, False] > 100 and len(seen) >= 3, seen


def test_no_body_within_a_solid_is_proven_apart():
    """Planes to all triangles part a ball from the shell around it; of the solid it is the inside that it meets."""
    ball = collide.tessellate(collide.Sphere(1.0), size=0.5)
    shell, solid = (collide.SweptMesh(collide.Mesh(ball.vertices, ball.faces, solid=s), 0.05) for s in (False, True))
    proof = certified(shell, collide.Sphere(0.3), EYE, EYE, hit=False)
    assert not takes(solid, collide.Sphere(0.3), EYE, EYE, proof, hit=False)
    ((kind, item, part, rows),) = certified(solid, collide.Sphere(0.3), EYE, EYE, hit=True)
    assert (kind, item, part, rows) == ("inside", len(ball.faces), 0, [[-1, 0]])
    assert not takes(shell, collide.Sphere(0.3), EYE, EYE, [(kind, item, part, rows)], hit=True)


def test_terrain_of_more_than_a_million_cells(monkeypatch):
    """As it is asked about, four million cells: few planes, and a check of few prisms."""
    opened, prisms = [], swept_hulls._Terrain.prisms
    monkeypatch.setattr(swept_hulls._Terrain, "prisms", lambda *of: opened.append(len(of[1])) or prisms(*of))
    i, j = np.ogrid[:2001, :2001]
    field = collide.HeightField(3.0 * np.sin(i / 70) * np.cos(j / 90), 0.1)
    assert field.is_field
    box = collide.Box((1.0, 1.0, 1.0))
    for height, hit in ((1.0, False), (0.4, True)):
        Y = collide.pose((0.3, 0.4, float(field.heights[1004, 1003]) + height), rpy=(0.0, 0.0, 0.3))
        row = collide.distance(field, box, EYE, Y, signed=False)
        assert bool(row.hit) == hit and len(json.dumps(row.certificate)) < 700
        opened.clear()
        collide.verify(field, box, EYE, Y, row)
        assert 0 < sum(opened) < 20_000, opened
