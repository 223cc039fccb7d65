"""Height fields against their definition in fractions: points, rays, spheres and boxes; how they are made, and what is
refused."""

from __future__ import annotations

import pickle
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import box
from naive import pose, random_pose, rng_of, same_bits, spell
from naive_terrain import Terrain
from reproduction import reproducing

import collide
from collide import HeightField, InvalidArgument, InvalidShape, Mesh
from collide.mesh.mesh_survey import survey_surface

EYE = np.eye(4)


def terrain_of(field: HeightField) -> Terrain:
    return Terrain(field.heights.tolist(), field.cell.tolist(), field.bottom)


def fields(rng, number: int) -> HeightField:
    """Small ones: of eighths, so that things touch exactly, or of any doubles."""
    shape = rng.integers(2, 5, 2)
    if number % 2:
        return HeightField(rng.integers(-6, 7, shape) / 8, rng.integers(1, 9, 2) / 8, bottom=-1.0)
    return HeightField(rng.normal(size=shape) * 10.0 ** rng.integers(-2, 2), 10.0 ** rng.uniform(-1, 1, 2))


# --- what it is ---------------------------------------------------------------------------------


def test_rows_run_along_y_and_columns_along_x():
    field = HeightField([[0, 0, 1], [2, 0, 0]], (10, 4))
    assert field.vertices[:6].tolist() == [[-10, -2, 0], [0, -2, 0], [10, -2, 1], [-10, 2, 2], [0, 2, 0], [10, 2, 0]]
    x, y = np.meshgrid([-10.0, 0, 10], [-2.0, 2])
    assert HeightField(x + 3 * y, (10, 4)).vertices[:6, 2].tolist() == (x + 3 * y).ravel().tolist()


def test_the_diagonal_goes_from_a_grid_point_to_the_next_of_row_and_column():
    """A ridge along the diagonal of the one cell, and a valley: the middle is as high as its ends."""
    for heights, middle in (([[1, 0], [0, 1]], 1.0), ([[0, 1], [1, 0]], 0.0)):
        hits = collide.raycast(HeightField(heights, 2), EYE, [[0, 0, 5], [0.5, -0.5, 5]], (0, 0, -1))
        assert (5 - hits.distance).tolist() == [middle, 0.5]


def test_it_is_a_closed_solid_without_a_defect():
    """What is said without a look at the surface is what a survey of it finds."""
    rng, shapes = rng_of("height field survey"), Counter()
    for number in range(40):
        shape = (2, 2) if number == 0 else (60, 90) if number == 1 else tuple(rng.integers(2, 9, 2).tolist())
        field = HeightField(rng.normal(size=shape), rng.uniform(0.1, 3, 2), bottom=-9 if number % 2 else None)
        with reproducing("collide.HeightField({heights}, {cell}, bottom={bottom})", **parameters(field)):
            found, told = survey_surface(field.vertices, field.faces), field.survey
            for name, value in found._asdict().items():
                same = np.allclose if name == "volumes" else np.array_equal
                assert same(value, getattr(told, name), **({"rtol": 1e-12} if name == "volumes" else {})), name
            assert field.solid and field.report.defects == () and field.report.euler == 2
            assert Mesh(field.vertices, field.faces, solid=True).report.volume == pytest.approx(field.report.volume)
            assert not collide.self_collisions(field).hit
            assert not (field.vertices.flags.writeable or field.faces.flags.writeable or field.heights.flags.writeable)
        shapes[shape] += 1
    assert len(shapes) > 20


def parameters(field: HeightField) -> dict:
    return {name: getattr(field, name) for name in field._fields}


def test_the_default_bottom_is_below_by_the_relief_and_the_longer_side():
    assert HeightField([[3, 1, 1], [1, 2, 1]], (0.5, 2)).bottom == 1 - (2 + 2)
    assert HeightField(np.zeros((2, 9)), 1).bottom == -8.0
    assert HeightField(np.full((2, 3), 100.0), 1).bottom == 98.0


@pytest.mark.parametrize("height", [0.1, 0.5, 1.0, 1.9])
def test_what_sank_in_comes_out_upwards_or_at_the_sides(height):
    """No taller than the field is wide, and up to the lowest height: the bottom is not the way out."""
    rng = rng_of("default bottom", height)
    for number in range(12):
        field = HeightField(rng.uniform(-0.25, 0.25, (3, 5)), 0.5)
        top = field.heights.min() + (0.0 if number % 2 else 0.1)
        body = (collide.Box((0.2, 0.2, height)), collide.Cylinder(0.1, height))[number % 2]
        X_WB = pose(t=(*rng.uniform(-0.3, 0.3, 2), top - 0.5 * height))
        r = collide.distance(field, body, EYE, X_WB)
        assert r.distance < 0 and r.normal[2] > -1e-9, f"{spell(field)}\n{spell(X_WB)}\n{r}"


def test_cells_of_facets():
    field = HeightField(np.arange(12.0).reshape(3, 4), 1)
    cells = field.cells_of(range(-1, len(field.faces)))
    assert (cells.row[0], cells.column[0], cells.triangle[0]) == (-1, -1, -1)
    expected = [(i, j, t) for i in range(2) for j in range(3) for t in range(2)]
    assert list(zip(*(part[1:13].tolist() for part in cells))) == expected
    assert all((part[13:] == -1).all() for part in cells) and len(cells.row) == 1 + 12 + 6 * 5
    for facet, (i, j, t) in enumerate(expected):
        corners = {divmod(v, 4) for v in field.faces[facet].tolist()}
        assert corners == {(i, j), (i + 1, j + 1), (i, j + 1) if t == 0 else (i + 1, j)}
    one = field.cells_of(7)
    assert one == (1, 0, 1) and all(type(number) is int for number in one) and field.cells_of(-1) == (-1, -1, -1)
    assert field.cells_of([[0, 3], [11, 12]]).column.tolist() == [[0, 1], [2, -1]]
    assert field.cells_of([]).row.shape == (0,)
    for bad in (len(field.faces), -2, 1.5, "0", [0, 99], None, True):
        with pytest.raises(InvalidArgument, match=r"HeightField\.cells_of"):
            field.cells_of(bad)


# --- queries ------------------------------------------------------------------------------------


def test_points_are_inside_by_their_heights():
    rng, told = rng_of("height field points"), Counter()
    for number in range(60):
        field = fields(rng, number)
        terrain = terrain_of(field)
        points = rng.uniform(-0.6, 0.6, (40, 3)) * (*(field.cell * (np.array(field.heights.shape)[::-1] - 1)), 2)
        points = np.concatenate([np.round(points * 8) / 8 if number % 2 else points, field.vertices[:4]])
        wanted = [terrain.holds(p) for p in points.tolist()]
        with reproducing("collide.HeightField({heights}, {cell}, bottom={bottom})", **parameters(field)):
            assert collide.contains(field, EYE, points).tolist() == wanted
        on_it = [terrain.height(*map(Fraction, p[:2])) == Fraction(p[2]) for p in points.tolist()]
        told.update(zip(wanted, on_it))
    assert told[True, False] > 200 and told[False, False] > 200 and told[True, True] > 200, told


def test_rays_from_above_meet_the_cell_below():
    rng, told = rng_of("height field rays"), Counter()
    for number in range(60):
        field = fields(rng, number)
        terrain, top = terrain_of(field), float(field.heights.max()) + 1
        places = rng.uniform(-0.55, 0.55, (25, 2)) * field.cell * (np.array(field.heights.shape)[::-1] - 1)
        places = np.round(places * 16) / 16 if number % 2 else places
        hits = collide.raycast(field, EYE, np.column_stack([places, np.full(25, top)]), (0, 0, -1.0))
        cells = field.cells_of(hits.facet)
        for k, (x, y) in enumerate(places.tolist()):
            with reproducing("collide.HeightField({heights}, {cell}); {x}, {y}", **parameters(field), x=x, y=y):
                height, place = terrain.height(Fraction(x), Fraction(y)), terrain.cell_at(Fraction(x), Fraction(y))
                assert hits.hit[k] == (height is not None)
                if height is None or place is None:
                    assert cells.row[k] == -1
                    continue
                assert Fraction(hits.lower[k]) <= Fraction(top) - height <= Fraction(hits.upper[k])
                i, j, u, v = place
                inner = 0 < u < 1 and 0 < v < 1 and u != v
                if inner:
                    assert (cells.row[k], cells.column[k], cells.triangle[k]) == (i, j, 0 if u > v else 1)
                told[inner] += 1
    assert told[True] > 700 and told[False] > 50, told


def judge_sphere(field: HeightField, centre, radius: float) -> bool:
    """The answer of `distance` for a sphere, in fractions; whether its centre is outside."""
    terrain, X = terrain_of(field), pose(t=centre)
    r = collide.distance(field, collide.Sphere(radius), EYE, X)
    if terrain.holds(centre):
        assert r.distance <= -radius and collide.collide(field, collide.Sphere(radius), EYE, X)
        return False
    square, low, high = terrain.squared_distance(centre), *(Fraction(v) + Fraction(radius) for v in (r.lower, r.upper))
    assert (low < 0 or low**2 <= square) and square <= high**2
    assert collide.collide(field, collide.Sphere(radius), EYE, X) == (square <= Fraction(radius) ** 2)
    return True


def test_spheres_are_as_near_as_the_nearest_triangle():
    rng, told = rng_of("height field spheres"), Counter()
    for number in range(120):
        field = fields(rng, number)
        size = field.cell * (np.array(field.heights.shape)[::-1] - 1)
        centre = (rng.uniform(-0.7, 0.7, 3) * (*size, 1.5)).tolist()
        centre = [round(8 * v) / 8 for v in centre] if number % 2 else centre
        radius = float(rng.choice([0.125, 0.25, 0.5]))
        source = "A = collide.HeightField({heights}, {cell}, bottom={bottom}), collide.Sphere({radius}), {centre}"
        with reproducing(source, **parameters(field), radius=radius, centre=centre):
            told[judge_sphere(field, centre, radius)] += 1
    assert told[True] > 50 and told[False] > 20, told


def test_boxes_hit_and_keep_the_distance_of_their_triangles():
    rng, told = rng_of("height field boxes"), Counter()
    for number in range(70):
        field = HeightField(
            rng.integers(-3, 4, (3, 3)) / 8 if number % 2 else rng.normal(size=(3, 2)) * 0.3, (0.5, 0.75), bottom=-1.0
        )
        sides = rng.integers(1, 5, 3) / 16
        X = pose(t=rng.integers((-8, -8, -4), (9, 9, 13)) / 16) if number % 2 else random_pose(rng, 0.4)
        half = tuple((0.5 * sides).tolist())
        vertices, faces = box(tuple(-h for h in half), half)
        terrain, B = terrain_of(field), collide.Box(sides)
        source = f"collide.distance({spell(field)}, collide.Box({sides.tolist()}), np.eye(4), {spell(X)})"
        r = collide.distance(field, B, EYE, X)
        hit = terrain.meets(vertices, faces, X)
        assert collide.collide(field, B, EYE, X) == hit, source
        if hit:
            moved = X.copy()
            moved[:3, 3] -= r.normal * (r.distance * (1 + 1e-9) - 1e-12)
            assert r.distance <= 0 and not terrain.meets(vertices, faces, moved), source
        else:
            square = terrain.squared_gap(vertices, faces, X)
            assert Fraction(max(r.lower, 0.0)) ** 2 <= square <= Fraction(r.upper) ** 2, source
        if r.certificate is not None:
            collide.verify(field, B, EYE, X, r)
        told[hit, r.certificate is not None] += 1
    assert sum(n for (hit, _), n in told.items() if hit) > 12 and told[False, False] + told[False, True] > 12, told
    assert told[True, True] > 5, told


def test_every_query_answers_as_for_its_mesh():
    """The bytes of the answers of a `Mesh` of its triangles: every kind of shape, lists, batches, threads, Worlds."""
    rng = rng_of("height field as mesh")
    field = HeightField(rng.normal(size=(6, 5)) * 0.3, 0.4)
    mesh = Mesh(field.vertices, field.faces)
    others = [
        collide.Sphere(0.2), collide.Capsule(0.1, 0.4), collide.Box((0.3, 0.2, 0.4)), collide.Cylinder(0.2, 0.3),
        collide.Cone(0.2, 0.3), collide.Ellipsoid((0.1, 0.2, 0.3)), collide.Halfspace((0, 0.1, -1), -0.2),
        HeightField(rng.normal(size=(3, 3)) * 0.1, 0.2),
        collide.ConvexHull(rng.normal(size=(12, 3)) * 0.2, radius=0.05),
        collide.Compound([(collide.Sphere(0.1), EYE), (collide.Box((0.5, 0.1, 0.1)), pose(t=(0, 0, 0.2)))]),
    ]
    X = np.array([random_pose(rng, 0.7) for _ in others])
    X[:, 2, 3] += np.arange(len(others)) % 2
    listed = collide.distance([field] * len(others), others, EYE, X, threads=2)
    hits = collide.collide([field] * len(others), others, EYE, X)
    for k, B in enumerate(others):
        one, other = (collide.distance(A, B, EYE, X[k]).rows for A in (field, mesh))
        assert not same_bits(one, other) and not same_bits(listed.rows[k], other), B
        assert hits[k] == collide.collide(mesh, B, EYE, X[k]), B
        batch = collide.distance(field, B, EYE, X, threads=2)
        assert not same_bits(batch.rows[k], other), B
        contacts, wanted = (collide.contacts(A, B, EYE, X[k], margin=0.3).rows for A in (field, mesh))
        assert contacts.tobytes() == wanted.tobytes(), B
        away = X[k].copy()
        away[2, 3] += 3.0
        fall, landed = (collide.time_of_impact(A, B, EYE, EYE, away, X[k]) for A in (field, mesh))
        assert (fall.hit, fall.time, fall.lower, fall.upper) == (landed.hit, landed.time, landed.lower, landed.upper), B
        if not isinstance(B, collide.Halfspace):
            one, other = (collide.shape_cast(B, away, (0, 0, -1), A, EYE) for A in (field, mesh))
            assert one.hit and all(np.array_equal(x, y) for x, y in zip(one, other)), B
    assert 2 < sum(hits) < len(hits)
    worlds = [collide.World(), collide.World()]
    for world, ground in zip(worlds, (field, mesh)):
        world.add(ground, EYE, name="ground", static=True)
        for k, B in enumerate(others):
            world.add(B, X[k], name=f"body {k}")
    near = [world.distances(max_distance=0.5) for world in worlds]
    assert near[0].names == near[1].names and any("ground" in pair for pair in near[0].names)
    assert near[0].rows.tobytes() == near[1].rows.tobytes()
    rays = [
        world.raycast(rng_of("rays").normal(size=(20, 3)) * (0.3, 0.3, 0) + (0, 0, 9), (0, 0, -1)) for world in worlds
    ]
    assert rays[0].names == rays[1].names and rays[0].rows.tobytes() == rays[1].rows.tobytes()
    assert "ground" in rays[0].names


def test_scaled_copies_pickles_and_files_are_the_same(tmp_path):
    field = HeightField(np.random.default_rng(0).normal(size=(4, 3)), (0.5, 0.25), bottom=-7)
    copy = pickle.loads(pickle.dumps(field))
    assert copy == field and hash(copy) == hash(field) and copy.survey.n_shells == 1 and type(copy) is HeightField
    assert len(pickle.dumps(HeightField(np.zeros((100, 100)), 1))) < 8 * 100 * 100 + 1000
    field.save(tmp_path / "field.npz")
    assert HeightField.load(tmp_path / "field.npz") == field
    with pytest.raises(InvalidShape, match=r"Mesh\.load.*another format"):
        Mesh.load(tmp_path / "field.npz")
    np.savez(tmp_path / "other.npz", heights=field.heights)
    with pytest.raises(InvalidShape, match=r"HeightField\.load"):
        HeightField.load(tmp_path / "other.npz")
    assert field != HeightField(field.heights, field.cell) and field != Mesh(field.vertices, field.faces)
    assert HeightField(np.zeros((2, 2)), 1) == HeightField([[-0.0, 0], [0, 0]], (1, 1), bottom=-1)
    twice = field.scaled(2.0)
    assert type(twice) is Mesh and twice.base is field and (twice.vertices == 2 * field.vertices).all()
    assert twice.solid and pickle.loads(pickle.dumps(twice)) == twice and twice.report.volume == 8 * field.report.volume
    assert repr(field) == "HeightField(heights=<4×3 array>, cell=[0.5, 0.25], bottom=-7.0)"
    assert collide.tessellate(field).faces.tolist() == field.faces.tolist()


# --- at the limits ------------------------------------------------------------------------------

EXTREMES = {
    "flat": (np.zeros((4, 4)), 0.5, None), "one cell": ([[0, 1], [2, -1]], 1, None),
    "flat cell": (np.zeros((2, 2)), 3, None), "cliffs": ([[0, 1e6, 0], [1e6, 0, 1e6], [0, 1e6, 0]], 1e-3, None),
    "thin": ([[0, 1e-9], [1e-9, 0]], 1, -1e-12), "huge cells": ([[0, 1], [1, 0]], 1e40, None),
    "tiny cells": ([[0, 1e-30], [0, 0]], 1e-40, None), "unequal": ([[0, 1], [1, 0]], (1e-8, 1e8), None),
    "far up": (1e12 + np.arange(9.0).reshape(3, 3), 0.1, None), "long": (np.arange(40.0).reshape(2, 20) % 3, 0.1, None),
}


@pytest.mark.many(2)
@pytest.mark.parametrize("name", EXTREMES)
def test_extreme_fields_answer_within_their_brackets(name):
    heights, cell, bottom = EXTREMES[name]
    field = HeightField(heights, cell, bottom=bottom)
    rng, told = rng_of("extreme height fields", name), Counter()
    assert (survey_surface(field.vertices, field.faces).flags == 0).all()
    span = np.ptp(field.vertices, axis=0)
    for number in range(16):
        place = rng.uniform(-0.6, 0.6, 2) * span[:2]
        above = (0.0, 1e-9, 0.01, 0.5)[number % 4] * float(rng.choice([-1, 1])) * max(span[:2])
        height = terrain_of(field).height(*map(Fraction, place.tolist()))
        centre = [*place.tolist(), (float(height) if height is not None else float(field.heights[0, 0])) + above]
        radius = float(rng.choice([1e-6, 0.1, 1.0]) * min(span[:2]))
        with reproducing("{field} {centre} {radius}", field=spell(field), centre=centre, radius=radius):
            told[judge_sphere(field, centre, radius)] += 1
    assert min(told[True], told[False]) > 0, told


REFUSED = {
    "holes alone": (
        lambda: HeightField([[0, 0], [0, np.nan]], 1), "HeightField: heights: every cell has a corner in a hole (nan)",
    ),
    "infinite": (lambda: HeightField([[0, -np.inf], [0, 0]], 1), "HeightField: heights[0, 1] is -inf"),
    "too high": (lambda: HeightField([[0, 0], [1e60, 0]], 1), "HeightField: heights[1, 0] is 1e+60"),
    "one row": (lambda: HeightField([[0, 0, 0]], 1), "at least 2 rows and 2 columns of grid points, got shape (1, 3)"),
    "one column": (lambda: HeightField(np.zeros((3, 1)), 1), "at least 2 rows and 2 columns"),
    "empty": (lambda: HeightField([], 1), "at least 2 rows and 2 columns of grid points, got shape (0,)"),
    "a row": (lambda: HeightField([0.0, 1.0], 1), "got shape (2,)"),
    "points": (lambda: HeightField(np.zeros((2, 2, 3)), 1), "got shape (2, 2, 3)"),
    "text": (lambda: HeightField("high", 1), "heights must be numbers, got 'high'; files are read by HeightField"),
    "too many": (
        lambda: HeightField(np.broadcast_to(0.0, (40_000, 40_000)), 1),
        "heights of shape (40000, 40000) are more than the 2³⁰ that a field holds; cut it",
    ),
    "no cell": (lambda: HeightField(np.eye(2), None), "HeightField: cell"),
    "cell of 0": (lambda: HeightField(np.eye(2), 0), "HeightField: cell must be > 0, got 0"),
    "negative cell": (lambda: HeightField(np.eye(2), (1, -2)), "HeightField: cell.y must be > 0, got -2.0"),
    "cell of NaN": (lambda: HeightField(np.eye(2), (np.nan, 1)), "HeightField: cell.x must be finite, got nan"),
    "small cell": (lambda: HeightField(np.eye(2), 1e-60), "HeightField: cell must lie within [1e-50, 1e+50] m"),
    "three cells": (lambda: HeightField(np.eye(2), (1, 2, 3)), "HeightField: cell must be one length or (dx, dy)"),
    "text cell": (lambda: HeightField(np.eye(2), "1"), "HeightField: cell must be real numbers"),
    "wide": (lambda: HeightField(np.zeros((2, 9)), 1e50), "HeightField: cell: 9 grid points dx = 1e+50 m apart reach"),
    "bottom at a height": (
        lambda: HeightField([[3, 2], [4, 5]], 1, bottom=2),
        "HeightField: bottom must lie below all heights, got 2.0, and heights[0, 1] is 2.0",
    ),
    "bottom of NaN": (lambda: HeightField(np.eye(2), 1, bottom=np.nan), "HeightField: bottom must be finite"),
    "text bottom": (lambda: HeightField(np.eye(2), 1, bottom="-1"), "HeightField: bottom must be a number, got '-1'"),
    "far bottom": (lambda: HeightField(np.eye(2), 1, bottom=-1e60), "HeightField: bottom must not exceed 1e+50"),
    "lost in rounding": (lambda: HeightField(np.full((2, 2), 1e17), 1), "heights are near 1e+17 m, where a field 1 m"),
    "bottom beyond": (
        lambda: HeightField([[-1e50, 1e50], [0, 0]], 1),
        "HeightField: heights: the bottom would be at -3e+50 m, beyond 1e+50 m",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_height_field_is_refused(name):
    make, words = REFUSED[name]
    with pytest.raises(InvalidShape) as caught:
        make()
    assert words in str(caught.value), str(caught.value)
