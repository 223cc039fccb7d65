"""`collide.contacts` where the answer is known: corners on tables, grippers, edges that cross, bodies deep inside."""

from __future__ import annotations

import numpy as np
import pytest
from contact_oracle import ConvexBody, check_row
from contact_scenes import gripper, table, wedge, world_corners
from mesh_shapes import block_ring, box
from naive import turn
from naive_triangles import facet_pairs

import collide
from collide.contact.contact_rows import GAP, OVERLAP, TRANSLATION

EYE = np.eye(4)
BOX = box((-0.5, -0.375, -0.25), (0.5, 0.375, 0.25))


def near(points, wanted, tolerance=1e-9):
    """The same points, in any order."""
    points, wanted = np.asarray(points), np.asarray(wanted)
    assert len(points) == len(wanted), f"{points.tolist()}\nwanted {wanted.tolist()}"
    off = np.abs(points[:, None] - wanted[None]).max(axis=2)
    assert (off.min(axis=0) < tolerance).all() and (off.min(axis=1) < tolerance).all(), (
        f"{points.tolist()}\nwanted {wanted.tolist()}"
    )


def clears(a, b, X_WA, X_WB, c) -> bool:
    """Whether B moved by ``apart`` of the first patch is clear of A in every facet, exactly."""
    moved = X_WB.copy()
    moved[:3, 3] += c.normal[0] * (c.apart[0] * (1 + 1e-9) + 1e-12)
    return not facet_pairs(*a, X_WA, *b, moved)


@pytest.mark.many(2)
@pytest.mark.parametrize("as_mesh", [False, True])
@pytest.mark.parametrize("solid", [True, False])
@pytest.mark.parametrize(
    ("height", "margin"),
    [(0.0, 0.0), (-1e-6, 0.0), (-1e-12, 0.0), (-0.01, 0.0), (1e-3, 0.01), (1e-9, 1e-6), (0.0, 0.05), (0.01, 0.01)],
)
def test_a_box_on_a_table(height, margin, as_mesh, solid):
    """Four corners, the table's normal, nothing from the edges within the table."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        ground = table(6, seed=seed)
        T = collide.Mesh(*ground, solid=True) if solid else collide.Mesh(ground[0], ground[1], solid=False)
        B = collide.Mesh(*BOX) if as_mesh else collide.Box((1.0, 0.75, 0.5))
        X_WB = collide.pose((*rng.uniform(-0.2, 0.2, 2), 0.25 + height), rpy=(0, 0, rng.uniform(-3, 3)))
        c = collide.contacts(T, B, EYE, X_WB, margin=margin)
        where = f"seed {seed}, height {height}, margin {margin}"
        assert len(c) == 4 and set(c.patch) == {0}, f"{where}: {c.rows}"
        assert np.abs(c.normal - (0, 0, 1)).max() < 1e-12, where
        assert np.abs(c.distance - height).max() < 1e-12, where
        assert (c.kind == (GAP if height > 0 else OVERLAP)).all(), where
        corners = world_corners(BOX[0], X_WB)
        near(c.point_b, corners[corners[:, 2] < 0.1])
        for row in c:
            faces = ground[1][row["facet_a"]]
            assert (ground[0][faces, 2] == 0).all(), f"{where}: no facet of the top"
            if as_mesh:
                check_row(row, ground, BOX, EYE, X_WB)
        if height <= 0:
            assert c.apart[0] <= -height + 1e-11 and clears(ground, BOX, EYE, X_WB, c), where


def test_the_same_anywhere():
    """A scene turned and moved as a whole has the same contacts, turned and moved."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        X_WS = collide.pose(rng.normal(size=3) * 3, rpy=rng.uniform(-3, 3, 3))
        T, B = collide.Mesh(*table(5, seed=seed)), collide.Mesh(*BOX)
        X_SB = collide.pose((0.1, -0.05, 0.25 - 1e-5), rpy=(0, 0, rng.uniform(-3, 3)))
        c = collide.contacts(T, B, X_WS, X_WS @ X_SB)
        assert (
            len(c) == 4 and np.abs(c.normal - X_WS[:3, 2]).max() < 1e-12 and np.abs(c.distance + 1e-5).max() < 1e-12
        ), seed
        corners = world_corners(BOX[0], X_WS @ X_SB)
        near(c.point_b, corners[[k for k in range(8) if BOX[0][k, 2] < 0]])


def test_over_the_table_s_edge():
    """What hangs over has no contacts: two corners of the box and two points on the table's rim."""
    T, B = collide.Mesh(*table(6)), collide.Box((1.0, 0.75, 0.5))
    for height, margin in ((-1e-6, 0.0), (1e-4, 1e-3), (0.0, 0.0)):
        c = collide.contacts(T, B, EYE, collide.pose((0.8, 0, 0.25 + height)), margin=margin)
        near(np.abs(c.point_b[:, :2]), [(0.3, 0.375), (0.3, 0.375), (1.0, 0.375), (1.0, 0.375)])
        assert np.abs(c.normal - (0, 0, 1)).max() < 1e-12


@pytest.mark.parametrize(("sunk", "margin"), [(0.0, 0.0), (1e-6, 0.0), (0.01, 0.0), (-1e-3, 0.01)])
def test_a_gripper_has_two_patches(sunk, margin):
    """Opposite normals, four corners each, whichever body is asked first."""
    U, bar = gripper(), box((-0.5 - sunk, -1, 0.125), (0.5 + sunk, 1, 0.375))
    c = collide.contacts(collide.Mesh(*U, solid=True), collide.Mesh(*bar), EYE, EYE, margin=margin)
    assert len(c) == 8 and sorted(c.patches["normal"][:, 0].tolist()) == [-1.0, 1.0]
    assert np.abs(c.distance + sunk).max() < 1e-12
    for p in range(2):
        own = c.rows[c.patch == p]
        side = -own["normal"][0, 0] * 0.5
        near(own["point_a"], [(side, y, z) for y in (-0.25, 0.25) for z in (0.125, 0.375)])
        assert (own["apart"] <= max(sunk, 0) + 1e-11).all()
        for row in own:
            check_row(row, U, bar, EYE, EYE)


def test_bars_that_cross():
    """Four corners of the square in which they overlap; none of them is a corner of either bar."""
    bar = box((-1, -0.125, -0.125), (1, 0.125, 0.125))
    mesh = collide.Mesh(*bar)
    for sunk in (0.0, 1e-6, 1e-3):
        X_WB = collide.pose((0, 0, 0.25 - sunk), R=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
        c = collide.contacts(mesh, mesh, EYE, X_WB)
        near(c.point_a[:, :2], [(x, y) for x in (-0.125, 0.125) for y in (-0.125, 0.125)])
        assert np.abs(c.normal - (0, 0, 1)).max() < 1e-12 and np.abs(c.distance + sunk).max() < 1e-12
        for row in c:
            check_row(row, bar, bar, EYE, X_WB)


@pytest.mark.parametrize("sunk", [1e-2, 1e-6, 1e-10, 0.0, -1e-10, -1e-6, -1e-2])
def test_edges_that_cross(sunk):
    """One contact, its normal the cross product of the edges."""
    roof = wedge()
    mesh = collide.Mesh(*roof)
    for angle in (np.pi / 2, 1.0, 0.3):
        flip = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
        R = collide.pose(rpy=(0, 0, angle))[:3, :3] @ flip
        X_WB = collide.pose((0, 0, -sunk), R=R)
        c = collide.contacts(mesh, mesh, EYE, X_WB, margin=max(0.0, -2 * sunk))
        assert len(c) == 1, f"angle {angle}, sunk {sunk}: {c.rows}"
        assert np.abs(c.normal - (0, 0, 1)).max() < 1e-8 and abs(c.distance[0] + sunk) < 1e-12
        near(c.point_a, [(0, 0, 0)], 1e-8)
        if sunk > 0:
            assert c.apart[0] < sunk * 1.0001 + 1e-11 and clears(roof, roof, EYE, X_WB, c)


@pytest.mark.parametrize("height", [-1e-3, -1e-7, 0.0, 1e-3])
def test_a_corner_on_a_table(height):
    """One point with the table's normal where nothing else is within the margin."""
    ground, cube = table(6, seed=1), box((-0.25,) * 3, (0.25,) * 3)
    R = collide.pose(rpy=(0.7, 0.5, 0.2))[:3, :3]
    lowest = float((cube[0] @ R.T)[:, 2].min())
    X_WB = collide.pose((0.13, 0.07, height - lowest), R=R)
    c = collide.contacts(collide.Mesh(*ground), collide.Mesh(*cube), EYE, X_WB, margin=max(2 * height, 0.0))
    corners = world_corners(cube[0], X_WB)
    assert np.abs(c.normal - (0, 0, 1)).max() < 1e-9, c.rows
    assert abs(c.distance[0] - height) < 1e-12 and np.abs(c.point_b[0] - corners[np.argmin(corners[:, 2])]).max() < 1e-9
    assert len(c) == 1 or height == -1e-3 or np.abs(c.point_b - c.point_b[0]).max() < 1e-5
    for row in c:
        check_row(row, ground, cube, EYE, X_WB)


def test_bumps_are_patches_of_their_own():
    """A plate over two bumps, with a margin that takes in the tips only: two contacts; with a larger one still two
    patches."""
    pyramid = np.array([(-0.25, -0.25, 0), (0.25, -0.25, 0), (0.25, 0.25, 0), (-0.25, 0.25, 0), (0, 0, 0.25)])
    faces = np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (0, 2, 1), (0, 3, 2)])
    bumps = np.concatenate([pyramid - (0.5, 0, 0), pyramid - (-0.5, 0, 0)]), np.concatenate([faces, faces + 5])
    plate = box((-1, -1, 0.25), (1, 1, 0.5))
    for height in (1e-3, 0.0, -1e-3):
        for margin in (0.0, 0.01, 0.1):
            c = collide.contacts(
                collide.Mesh(*bumps), collide.Mesh(*plate), EYE, collide.pose((0, 0, height)), margin=margin
            )
            if height > margin:
                assert not len(c)
                continue
            assert len(c.patches) == 2 and np.abs(c.normal - (0, 0, 1)).max() < 1e-9, c.rows
            near(c.patches["point_b"], [(-0.5, 0, 0.25 + height), (0.5, 0, 0.25 + height)])
            assert np.abs(c.patches["distance"] - height).max() < 1e-12
    # One of them overlaps, the other hovers: the same normal, and two patches all the same.
    tilted = collide.pose((0, 0, 0), rpy=(0, 1e-3, 0))
    bumps[0][9, 2] += 0.01
    c = collide.contacts(collide.Mesh(*bumps), collide.Mesh(*plate), EYE, collide.pose((0, 0, 0.005)), margin=0.01)
    assert np.abs(np.sort(c.patches["distance"]) - (-0.005, 0.005)).max() < 1e-12 and c.patches["kind"].tolist() == [
        OVERLAP,
        GAP,
    ]
    assert len(collide.contacts(collide.Mesh(*bumps), collide.Mesh(*plate), EYE, tilted, margin=0.02).patches) == 2


def test_swept_balls():
    ground = collide.Mesh(*table(6))
    for height in (-1e-3, 0.0, 1e-3):
        ball = collide.contacts(
            ground, collide.Sphere(0.125), EYE, collide.pose((0.1, 0.2, 0.125 + height)), margin=0.002
        )
        assert len(ball) == 1 and abs(ball.distance[0] - height) < 1e-12
        near(ball.point_a, [(0.1, 0.2, 0)])
        lying = collide.pose((0.1, 0.2, 0.125 + height), R=[[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        capsule = collide.contacts(ground, collide.Capsule(0.125, 0.5), EYE, lying, margin=0.002)
        near(capsule.point_a, [(-0.15, 0.2, 0), (0.35, 0.2, 0)])
        assert np.abs(capsule.distance - height).max() < 1e-12


def grid_of(n: int) -> collide.Mesh:
    """An open square of side 2 across z, of n · n cells."""
    k = np.linspace(-1.0, 1.0, n + 1)
    cells = [(n + 1) * i + j for i in range(n) for j in range(n)]
    faces = [f for c in cells for f in ((c, c + n + 1, c + n + 2), (c, c + n + 2, c + 1))]
    return collide.Mesh([(x, y, 0.0) for x in k for y in k], faces, solid=False)


SWEPT = {
    "capsule": (collide.Capsule(0.3, 1.0), turn((0, 1, 0), np.pi / 2)),
    "triangle": (collide.ConvexHull([(-0.4, -0.3, 0), (0.5, -0.2, 0), (0, 0.4, 0)], radius=0.2), np.eye(3)),
    "box": (collide.ConvexHull(0.3 * np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T, radius=0.1), np.eye(3)),
    "brick": (collide.ConvexHull(np.random.default_rng(2).normal(size=(30, 3)) * 0.4, radius=0.1), np.eye(3)),
}


@pytest.mark.parametrize("gap", [1e-3, -1e-3, -0.15])
@pytest.mark.parametrize("name", SWEPT)
def test_points_of_swept_bodies_that_lean_are_on_their_surface(name, gap):
    """Corners moved by the radius along the contact's normal were up to radius · θ² / 2 inside, and more."""
    ground, (B, R_B) = grid_of(3), SWEPT[name]
    rng = np.random.default_rng(4)
    rows = 0
    for lean in [*10.0 ** rng.uniform(-4, -0.2, 12), 0.7, 0.78, 1.1]:
        X = np.eye(4)
        X[:3, :3] = turn((*rng.normal(size=2), 0), lean) @ R_B
        X[:3, 3] = *rng.uniform(-0.2, 0.2, 2), 3.0
        X[2, 3] -= collide.distance(ground, B, EYE, X).distance - gap
        c = collide.contacts(ground, B, EYE, X, margin=0.5)
        off = np.abs(ConvexBody(B, X).signed(c.rows["point_b"][c.rows["kind"] != TRANSLATION]).astype(float))
        assert len(c.rows) and off.max(initial=0.0) < 1e-12, (B, X.tolist(), off)
        assert abs(c.rows["distance"].min() - gap) < 1e-9 or gap < -1e-2, (B, X.tolist())
        rows += len(c.rows)
    assert rows >= 30


@pytest.mark.parametrize("n", [1, 3])
def test_a_capsule_along_the_rim_of_a_surface_has_both_ends(n):
    """One end over the facets, the other a hair beyond the rim: it fell off."""
    ground, B = grid_of(n), collide.Capsule(0.2, 0.8)
    R_B = turn((1, 0, 0), -np.pi / 2)
    rng = np.random.default_rng(5)
    for k in range(40):
        angle = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, -3.1)
        X = np.eye(4)
        X[:3, :3] = turn((0, 0, 1), angle) @ R_B
        X[:3, 3] = 1.0 + rng.choice([0.0, 1e-6, -1e-6]), rng.uniform(-0.2, 0.2), 0.2 + 1e-5
        c = collide.contacts(ground, B, EYE, X, margin=1e-3)
        assert np.ptp(c.point_a[:, 1]) > 0.8 - 1e-3, (n, k, X.tolist(), c.rows)
        assert np.abs(ConvexBody(B, X).signed(c.point_b)).max() < 1e-12


def test_deep_inside_there_is_no_patch():
    """The answer of `distance`, and it says so."""
    solid, small = collide.Mesh(*box()), collide.Box((0.25, 0.25, 0.25))
    X_WB = collide.pose((0.1, 0.2, 0.5))
    c, r = collide.contacts(solid, small, EYE, X_WB), collide.distance(solid, small, EYE, X_WB)
    assert len(c) == 1 and c.kind[0] == TRANSLATION and c.distance[0] == r.distance and c.lower[0] == r.lower
    assert np.array_equal(c.normal[0], r.normal) and c.apart[0] == -r.lower and c.upper[0] == 0.0
    crossing = collide.contacts(solid, collide.Mesh(*box()), EYE, collide.pose((0.1, 0.05, 0.07)))
    assert len(crossing) and crossing.distance.min() < -1.0
    ring = collide.Mesh(*block_ring())
    assert len(collide.contacts(ring, small, EYE, EYE)) == 0, "a hole is a hole"


def test_half_spaces():
    ground = collide.Halfspace((0, 0, 1), 0.0)
    for height, margin, many in ((0.0, 0.0, 4), (-1e-3, 0.0, 4), (1e-3, 1e-2, 4), (1e-3, 1e-4, 0)):
        X_WB = collide.pose((0.3, 0.2, 0.25 + height), rpy=(0, 0, 0.4))
        for B in (collide.Mesh(*BOX), collide.Box((1.0, 0.75, 0.5))):
            c = collide.contacts(ground, B, EYE, X_WB, margin=margin)
            assert len(c) == many and (c.facet_a == -1).all()
            if many:
                corners = world_corners(BOX[0], X_WB)
                near(c.point_b, corners[corners[:, 2] < 0.1])
                assert np.abs(c.distance - height).max() < 1e-12 and np.abs(c.normal - (0, 0, 1)).max() < 1e-12


def test_a_few_of_many():
    """Of an octagon's corners those that span most are kept, the deepest first."""
    turn = 2 * np.pi * np.arange(24) / 24
    disc = np.stack([np.cos(turn), np.sin(turn), np.zeros(24)], axis=1) * 0.5
    prism = collide.Mesh(*_prism(disc))
    ground = collide.Mesh(*table(8, size=3.0))
    tilted = collide.pose((0, 0, 0), rpy=(1e-3, 0, 0))
    low = (world_corners(disc, tilted))[:, 2].min()
    X_WB = collide.pose((0, 0, 1e-3 - low), rpy=(1e-3, 0, 0))
    whole = collide.contacts(ground, prism, EYE, X_WB, margin=0.1, max_contacts=100)
    assert len(whole) == 24, whole.point_b
    for most in (1, 2, 3, 4, 8):
        few = collide.contacts(ground, prism, EYE, X_WB, margin=0.1, max_contacts=most)
        assert len(few) == most and few.distance[0] == whole.distance.min()
        assert set(map(bytes, few.rows["point_b"])) <= set(map(bytes, whole.rows["point_b"]))
    four = collide.contacts(ground, prism, EYE, X_WB, margin=0.1, max_contacts=4).point_b[:, :2]
    area = 0.5 * abs(
        sum(np.cross(np.append(p, 0), np.append(q, 0))[2] for p, q in zip(four, np.roll(four, -1, axis=0)))
    )
    assert area > 0.9 * 0.5, "a square within the disc has half"


def _prism(outline):
    n = len(outline)
    vertices = np.concatenate([outline, outline - (0, 0, -0.5), [[0, 0, 0], [0, 0, 0.5]]])
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i), (j, i, 2 * n), (n + i, n + j, 2 * n + 1)]
    return vertices, np.array(faces)


@pytest.mark.parametrize("scale", [2.0**-30, 1e-6, 1e3, 2.0**20])
def test_any_size(scale):
    """Scaled copies on scaled poses have the same contacts, scaled; of powers of two to the last bit."""
    T, B = collide.Mesh(*table(5, seed=1)), collide.Mesh(*BOX)
    for height in (-1e-6, 0.0, 1e-3):
        X_WB = collide.pose((0.1, 0.05, 0.25 + height), rpy=(0, 0, 0.3))
        X_WC = X_WB.copy()
        X_WC[:3, 3] *= scale
        own = collide.contacts(T, B, EYE, X_WB, margin=0.002)
        c = collide.contacts(T.scaled(scale), B.scaled(scale), EYE, X_WC, margin=0.002 * scale)
        assert (
            len(c) == 4
            and np.abs(c.distance / scale - height).max() < 1e-12
            and np.abs(c.normal - (0, 0, 1)).max() < 1e-12
        )
        if np.log2(scale) % 1 == 0:
            for name in ("point_a", "point_b", "distance"):
                assert np.array_equal(c.rows[name], own.rows[name] * scale), name


def test_one_point_a_contact():
    c = collide.contacts(
        collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), np.eye(4), collide.pose((0.0, 0.0, 1.25)), margin=0.5
    )
    assert np.array_equal(c.point[:, 2], np.full(4, 0.625)) and c.point.shape == (4, 3) and (c.distance == 0.25).all()


def test_next_to_a_hollow_edge_some_row_is_told():
    """Nearer to the edge of two walls than rounding tells it from the edge: neither wall's nearest point looks like a
    local one."""
    walls = np.array([[-4.0, 0, 0], [4, 0, 0], [4, 4, 0], [-4, 4, 0], [4, 0, 4], [-4, 0, 4]])
    surface = collide.Mesh(walls, [[0, 1, 2], [0, 2, 3], [0, 4, 1], [0, 5, 4]], solid=False)
    X_WB = collide.pose((1, 1e-9, 1e-9))
    for shape in (collide.Sphere(0.5), collide.ConvexHull([[0.0, 0, 0]])):
        d = collide.distance(surface, shape, np.eye(4), X_WB)
        for margin in (0.0, 0.1, 1e-9 * (1 + 1e-3)):
            c = collide.contacts(surface, shape, np.eye(4), X_WB, margin=margin)
            s = collide.contacts(shape, surface, X_WB, np.eye(4), margin=margin)
            assert bool(len(c)) == bool(len(s)) == (d.hit or d.upper <= margin), (shape, margin)
            if not d.hit and margin:
                assert c.lower[0] <= d.upper and d.lower <= c.upper[0]
    mixed = np.concatenate([walls, [[1e6, 1e6, 9], [1e6, -1e6, 9], [-1e6, 0, 9]]])  # and coordinates of few digits
    far = collide.Mesh(mixed, [[0, 1, 2], [0, 2, 3], [0, 4, 1], [0, 5, 4], [6, 7, 8]], solid=False)
    assert collide.collide(far, collide.Sphere(0.5), np.eye(4), X_WB)
    assert len(collide.contacts(far, collide.Sphere(0.5), np.eye(4), X_WB))
