"""`collide.contacts` of convex shapes and compounds, in worlds and batches, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from contact_scenes import table, world_corners
from mesh_shapes import box

import collide
from collide.contact.contact_rows import CONTACT_DTYPE, GAP, OVERLAP, TRANSLATION

EYE = np.eye(4)


def near(points, wanted, tolerance=1e-9):
    points, wanted = np.asarray(points), np.asarray(wanted)
    assert len(points) == len(wanted), points
    off = np.abs(points[:, None] - wanted[None]).max(axis=2)
    assert (off.min(axis=0) < tolerance).all() and (off.min(axis=1) < tolerance).all(), points


def convex_pairs(rng):
    """Two convex shapes brought together along the normal of their distance."""
    def one():
        return [
            lambda: collide.Box(rng.uniform(0.2, 1, 3)), lambda: collide.ConvexHull(rng.normal(size=(12, 3)) * 0.4),
            lambda: collide.Sphere(0.3), lambda: collide.Capsule(0.2, 0.6), lambda: collide.Cylinder(0.3, 0.5),
            lambda: collide.Cone(0.3, 0.6), lambda: collide.Ellipsoid((0.2, 0.3, 0.5)),
            lambda: collide.HPolytope(np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 1]]]), [0.3] * 6 + [0.6]),
            lambda: collide.ConvexHull([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
            lambda: collide.ConvexHull([[0.0, 0, -0.5], [0, 0, 0.5]], radius=0.1),
            lambda: collide.Halfspace((0, 0.6, 0.8), 0.1),
        ][rng.integers(11)]()
    while True:
        A, B = one(), one()
        X_WA, X_WB = (collide.pose(rng.normal(size=3) * s, rpy=rng.uniform(-3, 3, 3)) for s in (0.5, 3))
        try:
            r = collide.distance(A, B, X_WA, X_WB)
        except collide.UnsupportedQuery:
            continue
        if not r.hit:
            X_WB[:3, 3] -= (r.distance + rng.choice([1e-2, 1e-4, 1e-7, 0.0, -1e-4, -1e-2])) * r.normal
            return A, B, X_WA, X_WB


def test_convex_rows_are_what_they_promise():
    """The first row is the distance, no row is deeper, points lie on the bodies, roles exchange."""
    hits = gaps = several = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        A, B, X_WA, X_WB = convex_pairs(rng)
        margin = float(rng.choice([0.0, 0.02]))
        where = f"convex_pairs(np.random.default_rng({seed})): {A}, {B}, margin {margin}"
        r, c = collide.distance(A, B, X_WA, X_WB), collide.contacts(A, B, X_WA, X_WB, margin=margin)
        assert (len(c) > 0) == (r.hit or r.distance <= margin), where
        if not len(c):
            continue
        curved = any(isinstance(S, (collide.Cylinder, collide.Cone, collide.Ellipsoid)) for S in (A, B))
        off = 1e-9 if curved else 1e-12
        assert abs(c.distance[0] - r.distance) < off and (c.distance >= r.lower - 1e-12).all(), where
        assert (c.lower <= c.distance).all() and (c.distance <= c.upper).all() and c.lower[0] <= r.upper, where
        assert np.abs(c.normal - r.normal).max() < 1e-12 and (c.normal == c.normal[0]).all(), where
        assert np.abs(c.point_b - c.point_a - c.distance[:, None] * c.normal).max() < 1e-12, where
        assert (c.kind == (OVERLAP if r.hit else GAP)).all() and len(c) <= 8, where
        for body, X, points in ((A, X_WA, c.point_a), (B, X_WB, c.point_b)):
            for p in points:  # on the surface: in the body but for rounding, and no farther in than that
                own = collide.distance(body, collide.ConvexHull([[0.0, 0, 0]]), X, collide.pose(p))
                assert abs(own.distance) < 1e-7 if curved else abs(own.distance) < 1e-10, (where, p, own.distance)
        d = collide.contacts(B, A, X_WB, X_WA, margin=margin)
        assert np.array_equal(d.point_a, c.point_b) and np.array_equal(d.normal, -c.normal), where
        hits, gaps, several = hits + r.hit, gaps + (not r.hit), several + (len(c) > 1)
    assert hits > 80 and gaps > 20 and several > 15


@pytest.mark.parametrize("height", [-1e-3, 0.0, 1e-3])
def test_faces_over_each_other(height):
    """A box on a box, a cylinder on its end and on its side, and hulls that are no meshes: as many corners as there
    are."""
    ground = collide.Box((2, 2, 0.5))
    for turn in (0.0, 0.3, 1.2):
        X_WB = collide.pose((0.1, 0.2, 0.5 + height), rpy=(0, 0, turn))
        c = collide.contacts(ground, collide.Box((0.5, 0.25, 0.5)), EYE, X_WB, margin=2e-3)
        corners = world_corners(box((-0.25, -0.125, -0.25), (0.25, 0.125, 0.25))[0], X_WB)
        near(c.point_b, corners[corners[:, 2] < 0.4])
        assert np.abs(c.distance - height).max() < 1e-12
        mesh = collide.contacts(
            collide.Mesh(*table(5)), collide.Box((0.5, 0.25, 0.5)), collide.pose((0, 0, 0.25)), X_WB, margin=2e-3
        )
        near(mesh.point_b, c.point_b)
    upright = collide.contacts(
        ground, collide.Cylinder(0.25, 0.5), EYE, collide.pose((0, 0, 0.5 + height)), margin=2e-3
    )
    assert len(upright) == 8 and np.abs(np.hypot(*upright.point_b[:, :2].T) - 0.25).max() < 1e-12
    lying = collide.pose((0, 0, 0.5 + height), R=[[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    near(
        collide.contacts(ground, collide.Cylinder(0.25, 0.5), EYE, lying, margin=2e-3).point_a,
        [(-0.25, 0, 0.25), (0.25, 0, 0.25)],
        1e-7,
    )
    ball = collide.contacts(
        ground, collide.Ellipsoid((0.5, 0.25, 0.25)), EYE, collide.pose((0, 0, 0.5 + height)), margin=2e-3
    )
    near(ball.point_a, [(0, 0, 0.25)], 1e-6)


@pytest.mark.parametrize("shape", [collide.Capsule(0.08, 0.4), collide.Cylinder(0.08, 0.4)])
def test_a_line_over_the_end_of_a_cylinder_has_both_its_ends(shape):
    """The nearest point is on the rim, beyond the octagon: the far end is no point between it and the near one."""
    several = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        tilt, yaw, turned = 10 ** rng.uniform(-6, -3), *rng.uniform(-3, 3, 2)
        X_WB = collide.pose((*rng.uniform(-0.02, 0.02, 2), 0.23), rpy=(0.5 * np.pi + tilt, 0, yaw))
        ground, X_WA = collide.Cylinder(0.1, 0.3), collide.pose((0, 0, 0), rpy=(0, 0, turned))
        X_WB[2, 3] -= collide.distance(ground, shape, X_WA, X_WB).distance - rng.choice([-1e-4, 0.0, 1e-4])
        c = collide.contacts(ground, shape, X_WA, X_WB, margin=2e-3)
        ends = c.point[:, :2]
        assert len(c) == 2 and np.linalg.norm(ends[1] - ends[0]) > 0.15, (seed, tilt, c.point, c.distance)
        several += abs(np.hypot(*ends[0]) - 0.1) < 1e-7
    assert several > 10  # that begin on the rim


def test_compounds_are_asked_part_by_part():
    legs = [(collide.Box((0.25, 0.25, 0.5)), collide.pose((x, y, 0))) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    stool = collide.Compound(
        [*legs, (collide.Compound([(collide.Box((1.5, 1.5, 0.25)), EYE)]), collide.pose((0, 0, 0.375)))]
    )
    for ground in (collide.Mesh(*table(6)), collide.Box((2, 2, 0.5)), collide.Halfspace((0, 0, 1), 0)):
        X_WA = collide.pose((0, 0, -0.25)) if isinstance(ground, collide.Box) else EYE
        c = collide.contacts(ground, stool, X_WA, collide.pose((0, 0, 0.25 - 1e-6)))
        assert (
            len(c) == 16
            and len(c.patches) == 4
            and sorted(set(c.part_b)) == [0, 1, 2, 3]
            and set(c.patch) == {0, 1, 2, 3}
        )
        assert (
            np.abs(c.distance + 1e-6).max() < 1e-12
            and (c.lower <= -1e-6 + 1e-16).all()
            and (c.upper >= -1e-6 - 1e-16).all()
        )


def test_batches_are_single_calls():
    ground, cube = collide.Mesh(*table(5)), collide.Mesh(*box((-0.25,) * 3, (0.25,) * 3))
    rng = np.random.default_rng(1)
    X_WBs = np.array(
        [
            collide.pose((*rng.uniform(-0.5, 0.5, 2), rng.uniform(0.2, 0.4)), rpy=rng.uniform(-0.5, 0.5, 3))
            for _ in range(12)
        ]
    )
    batch = collide.contacts(ground, cube, EYE, X_WBs, margin=0.05)
    assert len(batch.starts) == 13 and batch.starts[-1] == len(batch.rows) and batch.rows.dtype == CONTACT_DTYPE
    patches = 0
    for k in range(12):
        single = collide.contacts(ground, cube, EYE, X_WBs[k], margin=0.05)
        assert (
            single.rows.tobytes()
            == batch[k].rows.tobytes()
            == collide.contacts(ground, cube, EYE, X_WBs[k], margin=0.05).rows.tobytes()
        )
        patches += len(single.patches)
    assert len(batch.patches) == patches > 0 and batch[-1].rows.tobytes() == batch[11].rows.tobytes()
    assert len(collide.contacts(ground, cube, EYE, X_WBs[:0])) == 0
    with pytest.raises(IndexError):
        batch[12]
    with pytest.raises(AttributeError, match="point_a"):
        print(batch.depth)
    assert "12 poses" in repr(batch)


def test_a_world_has_them_all():
    world = collide.World()
    world.add(collide.Mesh(*table(6)), name="table", static=True)
    world.add(collide.Box((0.5, 0.25, 0.5)), collide.pose((0.1, 0.2, 0.25)), name="box")
    world.add(collide.Sphere(0.1), collide.pose((-0.5, -0.5, 0.101)), name="ball")
    world.add(collide.Mesh(*box((-0.1,) * 3, (0.1,) * 3)), collide.pose((0.1, 0.2, 0.6)), name="cube")
    world.add(collide.Box((0.1, 0.1, 0.1)), collide.pose((0, 0, 5)), name="far")
    world.allow("box", "cube")
    assert len(world.contacts()) == 4 and set(world.contacts().names) == {("table", "box")}
    near_by = world.contacts(margin=0.01)
    assert (
        near_by.names.count(("table", "box")) == 4 and near_by.names.count(("table", "ball")) == 1 and len(near_by) == 5
    )
    own = collide.contacts(
        world.body("table").shape,
        world.body("ball").shape,
        world.body("table").X_WB,
        world.body("ball").X_WB,
        margin=0.01,
    )
    row = near_by.rows[4]
    assert (
        row["a"] == 0
        and row["b"] == 2
        and np.array_equal(row["point_b"], own.point_b[0])
        and "5 contacts of 2 pairs" in repr(near_by)
    )
    assert len(world.contacts(margin=0.01, max_contacts=1)) == 2
    world.set_pose("ball", collide.pose((0, 0, 3)))
    assert len(world.contacts(margin=0.01)) == 4
    assert len(collide.World().contacts()) == 0
    world.add(collide.Cylinder(0.1, 0.2), name="can")
    world.add(collide.Halfspace((0, 0, 1), -3.0), name="floor")
    world.add(collide.Halfspace((0, 0, 1), -3.5), name="cellar")
    with pytest.raises(collide.UnsupportedQuery, match='"'):
        world.contacts()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"margin": -1.0}, "margin"), ({"margin": np.nan}, "margin"), ({"margin": np.inf}, "margin"),
        ({"margin": "far"}, "margin"),
        ({"max_contacts": 0}, "max_contacts"), ({"max_contacts": 2.5}, "max_contacts"),
        ({"max_contacts": True}, "max_contacts"),
    ],
)
def test_bad_arguments_are_named(options, message):
    mesh = collide.Mesh(*box())
    with pytest.raises(collide.InvalidArgument, match=message):
        collide.contacts(mesh, mesh, EYE, EYE, **options)
    world = collide.World()
    with pytest.raises(collide.InvalidArgument, match=message):
        world.contacts(**options)


def test_what_cannot_be_answered_is_refused():
    mesh, ground = collide.Mesh(*box()), collide.Halfspace((0, 0, 1), 0)
    with pytest.raises(collide.UnsupportedQuery, match="Halfspace and Halfspace"):
        collide.contacts(ground, ground, EYE, EYE)
    with pytest.raises(collide.InvalidArgument, match="A must be a shape"):
        collide.contacts([mesh, None], mesh, EYE, EYE)
    with pytest.raises(collide.InvalidPose, match="X_WB"):
        collide.contacts(mesh, mesh, EYE, 2 * np.eye(4))
    with pytest.raises(collide.InvalidArgument, match="lengths"):
        collide.contacts(mesh, mesh, np.stack([EYE] * 2), np.stack([EYE] * 3))
    with pytest.raises(collide.InvalidPose):
        collide.contacts(mesh, mesh, EYE, np.full((4, 4), np.nan))


def test_too_many_pairs_are_refused_or_told_otherwise(monkeypatch):
    """A margin that takes in all facets of fine meshes is refused; all of them meeting is no patch."""
    line = np.linspace(-1, 1, 21)
    vertices = np.array([(x, y, 0.0) for y in line for x in line])
    cells = [21 * j + i for j in range(20) for i in range(20)]
    sheet = collide.Mesh(vertices, [(k, k + 1, k + 22) for k in cells] + [(k, k + 22, k + 21) for k in cells])
    with pytest.raises(collide.UnsupportedQuery, match="smaller margin"):
        collide.contacts(sheet, sheet, EYE, collide.pose((0, 0, 1e-3)), margin=5.0)
    flat = collide.contacts(sheet, sheet, EYE, EYE)
    near(flat.point_a, [(x, y, 0) for x in (-1, 1) for y in (-1, 1)])
    monkeypatch.setattr("collide.contact.mesh_contacts.MAX_PAIRS", 100)
    c = collide.contacts(sheet, sheet, EYE, EYE)
    assert (
        len(c) == 1 and c.kind[0] == TRANSLATION and c.distance[0] == collide.distance(sheet, sheet, EYE, EYE).distance
    )
    cubes = collide.Mesh(*box()), collide.Mesh(*box((-0.5,) * 3, (0.5,) * 3))
    assert len(collide.contacts(*cubes, EYE, collide.pose((0, 0, 1.5)))) == 4


@pytest.mark.parametrize(
    "shape", [collide.Cylinder(0.1, 0.2), collide.Cone(0.1, 0.2), collide.Ellipsoid((0.1, 0.2, 0.1))]
)
@pytest.mark.parametrize("height", [0.105, 0.25, -0.5])
def test_curved_shapes_against_meshes_agree_with_their_distance(shape, height):
    """Above the table, within it, and out of reach."""
    top, place = collide.Mesh(*table(6)), collide.pose((0.1, 0.2, height))
    r = collide.distance(top, shape, np.eye(4), place)
    c, swapped = (
        collide.contacts(*asked, margin=0.1)
        for asked in ((top, shape, np.eye(4), place), (shape, top, place, np.eye(4)))
    )
    assert bool(len(c)) == bool(len(swapped)) == (r.distance <= 0.1)
    if len(c):
        assert c.kind[0] == (TRANSLATION if r.hit else GAP) and abs(c.distance.min() - r.distance) < 1e-12
        assert c.distance[0] < c.distance.min() + 1e-12 and np.abs(c.normal - r.normal).max() < 1e-6
        assert c.lower[0] <= r.upper and r.lower <= c.upper[0]
        assert c.facet_b[0] == -1 and c.facet_a[0] >= 0
        assert np.array_equal(swapped.normal[0], -c.normal[0]) and swapped.facet_a[0] == -1


def test_single_calls_share_a_workspace_that_grows():
    """Pairs prepared while it was small answer as before after a face of 300 corners has made it larger."""
    angle = np.linspace(0, 2 * np.pi, 301)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(300)], axis=1)
    prism, A = collide.ConvexHull(np.concatenate([ring, ring + np.array((0, 0, 1))])), collide.Box((1, 1, 1))
    small = [
        (A, collide.Box((1, 1, k / 4)), collide.pose((0.1 * k, 0.2, k / 8 + 0.4), rpy=(0, 0, 0.7 * k)))
        for k in range(1, 9)
    ]
    before = [collide.contacts(A, B, EYE, X).rows for A, B, X in small]
    assert min(map(len, before)) >= 3
    large = collide.pose((0, 0, 0.999))
    wide = collide.contacts(prism, prism, EYE, large, max_contacts=1000).rows
    assert len(wide) == 300
    assert collide.contacts(prism, prism, EYE, large, max_contacts=1000).rows.tobytes() == wide.tobytes()
    for (A, B, X), rows in zip(small, before):
        assert collide.contacts(A, B, EYE, X).rows.tobytes() == rows.tobytes()
