"""Contacts of meshes and curved shapes: rims, lines and tips where they are known, and random ones judged by formulas
of the curved shapes and dense samples of facets."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from contact_oracle import away_from, facet
from contact_scenes import gripper, table, wedge
from mesh_shapes import block_ring, box

import collide
from collide.contact import curved_contacts
from collide.contact.contact_rows import CONTACT_DTYPE, GAP, OVERLAP, TRANSLATION
from collide.contact.support_face import CURVED, FACE

EYE = np.eye(4)
CAN, CONE, EGG = collide.Cylinder(0.3, 0.5), collide.Cone(0.3, 0.5), collide.Ellipsoid((0.3, 0.2, 0.1))
ON_ITS_SIDE = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])


def beyond(shape, points) -> np.ndarray:
    """How far points (k, 3) of the shape's frame are beyond its surface, at most; negative inside, and then roughly."""
    x, y, z = np.asarray(points).T
    r = np.hypot(x, y)
    if isinstance(shape, collide.Cylinder):
        return np.maximum(r - shape.radius, np.abs(z) - shape.length / 2)
    if isinstance(shape, collide.Cone):
        slant = np.hypot(shape.radius, shape.length)
        side = (shape.length * r + shape.radius * (z - shape.length / 2)) / slant
        return np.maximum(side, -shape.length / 2 - z)
    scaled = np.stack([x, y, z], axis=1) / shape.radii
    return (np.linalg.norm(scaled, axis=1) - 1) * min(shape.radii)


def within(X, points) -> np.ndarray:
    """World points in the frame of a pose."""
    return (np.asarray(points) - X[:3, 3]) @ X[:3, :3]


def same_rows(a, b) -> bool:
    return len(a) == len(b) and all(np.array_equal(a[name], b[name]) for name in CONTACT_DTYPE.names or ())


# --- where contacts are known -------------------------------------------------------------------


@pytest.mark.parametrize("solid", [True, False])
@pytest.mark.parametrize(("height", "margin"), [(0.0, 0.0), (-1e-6, 0.0), (-0.01, 0.0), (1e-3, 0.01), (1e-9, 1e-6)])
def test_on_a_table(height, margin, solid):
    """Eight rim points of a standing can and cone, two of a lying can, one of an ellipsoid and a tip; no ghosts from
    the edges within the table."""
    scenes = [
        (CAN, 0.25, np.eye(3), 8), (CONE, 0.25, np.eye(3), 8), (CAN, 0.3, ON_ITS_SIDE, 2), (EGG, 0.1, np.eye(3), 1),
        (CONE, 0.25, np.diag([1.0, -1, -1]), 1),
    ]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        ground = table(6, seed=seed)
        T = collide.Mesh(*ground, solid=solid)
        for shape, lowest, R, n in scenes:
            about = collide.pose(rpy=(0, 0, rng.uniform(-3, 3)))[:3, :3]
            X_WB = collide.pose((*rng.uniform(-0.2, 0.2, 2), lowest + height), R=about @ R)
            c = collide.contacts(T, shape, EYE, X_WB, margin=margin)
            where = f"seed {seed}, {shape}, height {height}, margin {margin}, X_WB = {X_WB.tolist()}"
            assert len(c) == n and set(c.patch) == {0}, f"{where}: {c.rows}"
            assert np.abs(c.normal - (0, 0, 1)).max() < 1e-7, where
            assert np.abs(c.distance - height).max() < 1e-12, where
            assert (c.kind == (GAP if height > 0 else OVERLAP)).all() and (c.facet_b == -1).all(), where
            assert np.abs(beyond(shape, within(X_WB, c.point_b))).max() < 1e-9, where
            if n == 8:
                assert np.abs(np.linalg.norm(within(X_WB, c.point_b)[:, :2], axis=1) - 0.3).max() < 1e-9, where
                assert sorted(set(c.rows["feature_b"].tolist())) == [4 * k + CURVED for k in range(8)], where
            if n == 2:
                assert abs(np.linalg.norm(c.point_b[0] - c.point_b[1]) - 0.5) < 1e-9, where
            if height <= 0:
                assert c.apart[0] <= -height * 1.01 + 1e-11, (where, c.apart)


def test_over_the_table_s_edge():
    """What of a can hangs over has no contacts: points on the table's rim instead."""
    T = collide.Mesh(*table(6))
    for height, margin in ((-1e-6, 0.0), (1e-4, 1e-3)):
        c = collide.contacts(T, CAN, EYE, collide.pose((0.95, 0, 0.25 + height)), margin=margin)
        assert np.abs(c.normal - (0, 0, 1)).max() < 1e-12 and set(c.patch) == {0}
        assert c.point_a[:, 0].max() < 1.0 + 1e-9 and np.abs(c.point_a[:, 0] - 1.0).min() < 1e-9
        assert np.ptp(c.point_a[:, 1]) > 0.5


@pytest.mark.parametrize("sunk", [1e-6, 1e-3, -1e-3])
def test_between_two_jaws(sunk):
    """A standing can in a gripper: a line of contacts at each jaw, opposite normals."""
    jaws = collide.Mesh(*gripper(height=1.0), solid=True)
    can = collide.Cylinder(0.5 + sunk, 0.25)
    X_WB = collide.pose((0.0, 0.01, 0.5), rpy=(0, 0, 0.3))
    c = collide.contacts(jaws, can, EYE, X_WB, margin=max(-2 * sunk, 0))
    assert sorted(c.patches["normal"][:, 0].round(6).tolist()) == [-1.0, 1.0] and len(c) == 4, c.rows
    assert np.abs(c.distance + sunk).max() < 1e-9
    assert sorted(c.point_a[:, 2].round(9).tolist()) == [0.375, 0.375, 0.625, 0.625]


def test_in_a_groove():
    """A can lying in a V: two lines, one at each wall."""
    walls = np.array([[-1.0, 0, 0], [1, 0, 0], [1, 1, 1], [-1, 1, 1], [1, -1, 1], [-1, -1, 1]])
    groove = collide.Mesh(walls, [[0, 1, 2], [0, 2, 3], [1, 0, 4], [0, 5, 4]], solid=False)
    for gap in (1e-3, -1e-3):
        X_WB = collide.pose((0, 0, (0.3 + gap) * np.sqrt(2)), R=ON_ITS_SIDE)
        c = collide.contacts(groove, CAN, EYE, X_WB, margin=0.01)
        assert len(c) == 4 and len(c.patches) == 2, c.rows
        assert np.abs(np.abs(c.normal) - (0, np.sqrt(0.5), np.sqrt(0.5))).max() < 1e-7
        assert np.abs(c.distance - gap).max() < 1e-9 and np.abs(np.abs(c.point_a[:, 0]) - 0.25).max() < 1e-9


def test_across_and_along_a_ridge():
    roof = collide.Mesh(*wedge(half=0.3, height=0.5))  # steeper than 45°
    for gap in (1e-3, -1e-3):
        along = collide.contacts(roof, CAN, EYE, collide.pose((0.1, 0, 0.3 + gap), R=ON_ITS_SIDE), margin=2e-3)
        assert np.abs(along.normal - (0, 0, 1)).max() < 1e-6 and np.abs(along.distance - gap).max() < 1e-9, along.rows
        assert len(along.patches) == 1 and sorted(along.point_a[:, 0].round(6).tolist()) == [-0.15, 0.35], along.rows
        across = collide.contacts(
            roof, CAN, EYE, collide.pose((0.1, 0, 0.3 + gap), rpy=(np.pi / 2, 0, 0)), margin=1.5e-3
        )
        assert np.abs(across.patches["distance"] - gap).max() < 1e-9 and len(across.patches) == 1, across.rows


def test_rims_stay_while_a_can_creeps():
    """A can that sinks, tilts and slides by millionths keeps its features."""
    T = collide.Mesh(*table(3))
    before = None
    for k in range(20):
        X = collide.pose((0.013 + 1e-6 * k, 0.021, 0.25 - 1e-4 + 1e-6 * (k % 3)), rpy=(1e-5, 2e-5, 1e-6 * k))
        c = collide.contacts(T, CAN, EYE, X, margin=1e-3)
        keys = {(int(a), int(b)) for a, b in zip(c.rows["feature_a"], c.rows["feature_b"])}
        assert len(keys) == 8 and all(a % 4 == FACE and b % 4 == CURVED for a, b in keys)
        assert before is None or keys == before, (k, keys, before)
        before = keys


def test_inside_a_solid():
    """No facet is near: the answer of `distance`."""
    small = collide.Ellipsoid((0.05, 0.04, 0.03))
    solid = collide.Mesh(*box())
    X_WB = collide.pose((0.4, 0.5, 0.5))
    c, r = collide.contacts(solid, small, EYE, X_WB, margin=0.2), collide.distance(solid, small, EYE, X_WB)
    assert c.kind.tolist() == [TRANSLATION] and c.distance[0] == r.distance and np.array_equal(c.normal[0], r.normal)
    # Near a wall, seen from inside: its facets are within the margin, and no contact.
    X_WB = collide.pose((0.9, 0.5, 0.5))
    c, r = collide.contacts(solid, small, EYE, X_WB, margin=0.2), collide.distance(solid, small, EYE, X_WB)
    assert c.kind.tolist() == [TRANSLATION] and c.distance[0] == r.distance
    assert not len(collide.contacts(collide.Mesh(*block_ring()), small, EYE, EYE)), "a hole is a hole"


# --- random ones --------------------------------------------------------------------------------


def scene(rng):
    """A mesh and a curved shape near its surface: ((shape, vertices, faces), B, X_WA, X_WB)."""
    vertices, faces = [table(4, seed=1), block_ring(), wedge(), gripper(), box()][rng.integers(5)]
    mesh = collide.Mesh(vertices, faces, solid=bool(rng.integers(2)))
    B = [
        collide.Cylinder(*rng.uniform(0.05, 0.4, 2)), collide.Cone(*rng.uniform(0.05, 0.4, 2)),
        collide.Ellipsoid(rng.uniform(0.05, 0.3, 3)),
    ][rng.integers(3)]
    X_WA = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
    X_AB = collide.pose(rpy=rng.uniform(-3, 3, 3) if rng.random() < 0.5 else np.pi / 2 * rng.integers(4, size=3))
    corners = vertices[faces[rng.integers(len(faces))]]
    X_AB[:3, 3] = rng.dirichlet(np.ones(3)) @ corners + rng.normal(size=3) * 0.3
    X_WB = X_WA @ X_AB
    r = collide.distance(mesh, B, X_WA, X_WB)
    if not r.hit:
        X_WB[:3, 3] -= (r.distance + rng.choice([1e-2, 1e-5, 1e-9, -1e-9, -1e-5, -1e-2])) * r.normal
    return (mesh, vertices, faces), B, X_WA, X_WB


def test_rows_are_what_they_promise():
    seen: Counter = Counter()
    for seed in range(150):
        judge(seed, seen)
    print(dict(seen))
    assert seen["rows"] > 200 and seen["gap"] > 15 and seen["parted"] > 60 and seen["several"] > 40


def judge(seed, seen) -> None:
    rng = np.random.default_rng(seed)
    posed = scene(rng)
    margin = float(rng.choice([0.0, 0.02, 0.1]))
    judge_scene(posed, margin, seen, f"scene(np.random.default_rng({seed})), margin {margin}")


def judge_scene(posed, margin, seen, where) -> None:
    """``posed`` : as of `scene`.   seen : counts what was met.   where : the case, for messages."""
    (A, vertices, faces), B, X_WA, X_WB = posed
    c = collide.contacts(A, B, X_WA, X_WB, margin=margin)
    r, hit = collide.distance(A, B, X_WA, X_WB), collide.collide(A, B, X_WA, X_WB)
    if hit:
        assert len(c) and c.lower.min() <= 0.0, where
    elif r.lower <= margin:
        assert len(c) and abs(c.distance.min() - r.distance) < 1e-9, (where, c.distance.min(), r.distance)
    else:
        assert not len(c), where
    for row in c:
        n = row["normal"]
        assert abs(np.linalg.norm(n) - 1) < 1e-12 and row["lower"] <= row["distance"] <= row["upper"], where
        assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * n).max() < 1e-12, where
        if row["kind"] == TRANSLATION:
            assert row["distance"] == r.distance and hit, where
            continue
        # The mesh's point on the facet named, the other on the shape's surface.
        P = facet(vertices, faces, X_WA, row["facet_a"])
        assert away_from(P, row["point_a"]) < 1e-7, (where, row, away_from(P, row["point_a"]))
        assert abs(beyond(B, within(X_WB, row["point_b"][None]))[0]) < 1e-7, (where, row)
    for patch in np.unique(c.patch):
        own = c.rows[c.patch == patch]
        assert (own["normal"] == own["normal"][0]).all() and len(own) <= 8, where
        assert own["distance"][0] <= own["distance"].min() + 1e-12, (where, own["distance"])
        if own["kind"][0] == OVERLAP:
            assert_parted(own, vertices, faces, B, X_WA, X_WB, where)
            seen["parted"] += 1
    seen["several"] += len(c) > 1
    seen["patches"] += len(np.unique(c.patch))
    seen["hit" if hit else "gap" if len(c) else "far"] += 1
    seen["translation"] += int((c.kind == TRANSLATION).any())
    seen["rows"] += len(c)
    flipped = collide.contacts(B, A, X_WB, X_WA, margin=margin)
    assert np.array_equal(flipped.point_a, c.point_b) and np.array_equal(flipped.normal, -c.normal), where
    assert np.array_equal(flipped.facet_b, c.facet_a) and np.array_equal(flipped.upper, c.upper), where


def assert_parted(own, vertices, faces, B, X_WA, X_WB, where) -> None:
    """B moved by ``apart`` is clear of the facets of the patch's rows: of dense samples of them."""
    assert 0.0 < own["apart"][0] < np.inf, where
    moved = X_WB.copy()
    moved[:3, 3] += own["apart"][0] * own["normal"][0]
    s, t = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60))
    s, t = s[s + t <= 1], t[s + t <= 1]
    for k in np.unique(own["facet_a"]):
        p, q, r = vertices[faces[k]] @ X_WA[:3, :3].T + X_WA[:3, 3]
        samples = p + s[:, None] * (q - p) + t[:, None] * (r - p)
        assert beyond(B, within(moved, samples)).min() > -1e-12, (where, own)


def test_batches_threads_and_lists_are_single_calls(monkeypatch):
    monkeypatch.setattr(curved_contacts, "_POSES_OF_PIECE", 16)
    rng = np.random.default_rng(3)
    T = collide.Mesh(*table(6, seed=2))
    X = np.stack([collide.pose(rpy=(*rng.normal(scale=0.02, size=2), rng.uniform(-3, 3))) for _ in range(64)])
    X[:, :3, 3] = rng.uniform(-0.9, 0.9, (64, 3))
    X[:, 2, 3] = 0.25 + rng.choice([-0.05, -1e-3, 0.0, 5e-3, 0.5], 64)
    for shape in (CAN, CONE):
        batch = collide.contacts(T, shape, EYE, X, margin=0.01)
        for k in range(64):
            assert same_rows(collide.contacts(T, shape, EYE, X[k], margin=0.01).rows, batch[k].rows), X[k].tolist()
        assert same_rows(collide.contacts(T, shape, EYE, X, margin=0.01, threads=3).rows, batch.rows)
        listed = collide.contacts([T] * 64, [shape] * 64, EYE, X, margin=0.01)
        assert same_rows(listed.rows, batch.rows) and np.array_equal(listed.starts, batch.starts)
        monkeypatch.setattr(curved_contacts, "_FIRST_ROWS", 1)
        monkeypatch.setattr(curved_contacts, "_ROWS_PER_POSE", 0)
        assert same_rows(collide.contacts(T, shape, EYE, X, margin=0.01).rows, batch.rows), "space for rows grows"


def test_too_many_facets_are_refused(monkeypatch):
    monkeypatch.setattr(curved_contacts, "MAX_FACETS", 5)
    with pytest.raises(collide.UnsupportedQuery, match="smaller margin"):
        collide.contacts(collide.Mesh(*table(6)), CAN, EYE, collide.pose((0, 0, 0.25)))


def test_contacts_of_facets_tiny_beside_the_set_lie_on_both():
    """Rounding put the nearest point of a facet of 1e-7 m beside its corner, within the facet: the patch got the
    facet's normal, 17 degrees off, and a point 1.5e-5 m off a cone 1e-4 m away."""
    rng = np.random.default_rng(5)
    n_rows = 0
    for _ in range(60):
        points = rng.normal(size=(12, 3)) * (2e-7, 1e-7, 5e-8)
        M = collide.Mesh(points, rng.permutation(12).reshape(4, 3), solid=False)
        S = [CAN, CONE, EGG][rng.integers(3)]
        X_WA, X_WS = collide.pose(1e-6 * rng.normal(size=3)), np.eye(4)
        direction = rng.normal(size=3)
        X_WS[:3, 3] = direction / np.linalg.norm(direction)
        r = collide.distance(M, S, X_WA, X_WS)
        X_WS[:3, 3] -= (r.distance - 10.0 ** rng.uniform(-6, -3)) * r.normal
        r = collide.distance(M, S, X_WA, X_WS)
        for row in collide.contacts(M, S, X_WA, X_WS, margin=1.5 * r.distance).rows:
            off = beyond(S, within(X_WS, row["point_b"][None]))[0]
            assert abs(off) < 1e-10, (off, points.tolist(), M.faces.tolist(), S, X_WA.tolist(), X_WS.tolist())
            n_rows += 1
    assert n_rows > 100


def test_the_point_of_a_speck_beside_a_far_corner_lies_on_the_speck():
    """A cone of half a micrometre 0.4 m from the corner of a sheet, and 5 nm beside it: the facet's normal, 1.4e-8 rad
    off, laid its point 2.5 nm off the cone."""
    x, y = 0.07094780567312997, 0.5
    sheet = collide.Mesh([[a, b, 0.0] for a in (-x, x) for b in (-y, y)], [[0, 2, 3], [0, 3, 1]], solid=False)
    cone = collide.Cone(5.298901415169268e-07, 9.809577671573438e-07)
    X_WA = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    X_WB = np.array([
        [0.24221303903608715, 0.9702098033590105, -0.005077517796411357, 0.3958937904112512],
        [-0.7165225721818909, 0.17534655111886344, -0.6751658985498059, -0.07094813501117088],
        [-0.6541622484328715, 0.16717214025306293, 0.7376484448898812, -0.49999964018370263], [0.0, 0.0, 0.0, 1.0]])
    rows = collide.contacts(sheet, cone, X_WA, X_WB, margin=0.3958936589116268).rows
    assert len(rows) >= 1
    for row in rows:
        p = X_WB[:3, :3].T @ (row["point_b"] - X_WB[:3, 3])
        radius = cone.radius * (0.5 - p[2] / cone.length)
        assert np.hypot(p[0], p[1]) - radius <= 1e-12 and abs(p[2]) <= 0.5 * cone.length + 1e-12, row
        assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * row["normal"]).max() <= 1e-15


@pytest.mark.many(4)
@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("margin", [0.0, 1e-3, 0.05, 0.4])
def test_what_is_beyond_the_margin_is_left_out_and_nothing_else(margin, solid, monkeypatch):
    """With the walk that finds what is beyond the margin, alone, in batches, and without it: the same bytes."""
    rng, n_without = np.random.default_rng(17), 0
    vertices, faces = collide.tessellate(collide.Sphere(0.5), tolerance=2e-2)
    mesh = collide.Mesh(vertices * rng.uniform(0.9, 1.0, (len(vertices), 1)), faces, solid=solid)
    for shape in (collide.Cylinder(0.2, 0.5), collide.Cone(0.2, 0.5), collide.Ellipsoid((0.3, 0.2, 0.1))):
        n = 60
        X = np.stack([collide.pose(rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])
        Y = np.stack([collide.pose(0.45 * rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])
        batch = collide.contacts(mesh, shape, X, Y, margin=margin)
        with monkeypatch.context() as without:
            without.setattr(curved_contacts, "serves", lambda packed: False)
            long_way = collide.contacts(mesh, shape, X, Y, margin=margin)
        assert batch.rows.tobytes() == long_way.rows.tobytes() and np.array_equal(batch.starts, long_way.starts)
        for k in range(n):
            one = collide.contacts(mesh, shape, X[k].copy(), Y[k].copy(), margin=margin)
            swapped = collide.contacts(shape, mesh, Y[k].copy(), X[k].copy(), margin=margin)
            case = f"{shape!r}, X_WA={X[k].tolist()}, X_WB={Y[k].tolist()}"
            assert one.rows.tobytes() == batch[k].rows.tobytes() and len(swapped) == len(one), case
            assert (len(one) > 0) == collide.collide(mesh, shape, X[k], Y[k], security_margin=margin), case
            n_without += len(one) == 0
    assert 5 < n_without < 150
