"""Mesh: what is a solid, what is a surface, and which facets are to blame; judged by dictionaries and fractions."""

from __future__ import annotations

import copy
import pickle
from fractions import Fraction

import numpy as np
import pytest
import surfaces
from naive import SHARED, rng_of

import collide
from collide.kernels import address_of
from collide.lowering.parts import parts_of
from collide.mesh import mesh_survey as says
from collide.mesh import mesh_topology as meet
from collide.mesh import shell_nesting as nesting
from collide.mesh.mesh_survey import survey_surface
from collide.mesh.weld import weld

CLOSED = {
    "box": surfaces.box(),
    "ball": surfaces.ball(),
    "torus": surfaces.torus(),
    "two boxes at an edge": surfaces.joined(surfaces.box(), surfaces.box((1, 1, 0), (2, 2, 1))),
    "two boxes at a vertex": surfaces.joined(surfaces.box(), surfaces.box((1, 1, 1), (2, 2, 2))),
    "two boxes, one face": surfaces.joined(surfaces.box(), surfaces.box((1, 0, 0), (2, 1, 1))),
    "one within another": surfaces.joined(surfaces.box((-1, -1, -1), (2, 2, 2)), surfaces.box()),
}


def flagged(survey, bit) -> set[int]:
    return set(np.flatnonzero(survey.flags & bit).tolist())


def snippet(vertices, faces) -> str:
    return f"\ncollide.Mesh({np.asarray(vertices).tolist()}, {np.asarray(faces).tolist()}).report"


def check(vertices, faces) -> None:
    """A survey against what dictionaries know."""
    survey = survey_surface(np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int32))
    known = surfaces.Known(vertices, faces)
    repeat = snippet(vertices, faces)
    same, opposite = known.doubled()
    expected = {
        meet.COLLAPSED: known.collapsed, meet.OPEN: known.open, meet.UNBALANCED: known.unbalanced,
        meet.SEVERAL: known.several, meet.DOUBLED: same, meet.BACK_TO_BACK: opposite, meet.PINCHED: known.pinched(),
        says.NO_AREA: {f for f, c in enumerate(known.corners) if surfaces.exact_area_is_zero(vertices, c)},
    }
    for bit, facets in expected.items():
        assert flagged(survey, bit) == facets, f"bit {bit}{repeat}"
    assert survey.edges == len(known.edges) and survey.euler == known.euler, repeat
    check_orientation(survey, known, repeat)
    assert survey.closed == (bool(known.edges) and known.balanced), repeat
    groups = [set(np.flatnonzero(survey.shells == k).tolist()) for k in range(survey.n_shells)]
    assert sorted(map(sorted, groups)) == sorted(map(sorted, known.shells())), repeat
    if survey.closed:
        for k, group in enumerate(groups):
            volume = surfaces.exact_volume(vertices, np.array([known.corners[f] for f in sorted(group)]))
            assert survey.signs[k] == (volume > 0) - (volume < 0), repeat
            assert float(volume) == pytest.approx(survey.volumes[k], rel=1e-9, abs=1e-300), repeat


def check_orientation(survey, known, repeat) -> None:
    """Turning over what is flagged makes neighbours agree, and is not the greater part, wherever that is possible."""
    turned, one_sided = flagged(survey, meet.TURNED), flagged(survey, meet.ONE_SIDED)
    for group in known.classes():
        pairs = [t for t in known.edges.values() if len(t) == 2 and t[0][0] in group]
        side = two_colours(group, pairs)
        if side is None:
            assert group & one_sided, f"a one-sided part is not named{repeat}"
            continue
        assert not group & one_sided, f"a two-sided part is called one-sided{repeat}"
        others = {f for f in group if side[f] != side[min(group)]}
        wrong = others if 2 * len(others) <= len(group) else group - others
        assert turned & group == wrong, repeat


def two_colours(group, pairs) -> dict[int, int] | None:
    """Facet to sense, None where there is no consistent one."""
    beside: dict = {f: [] for f in group}
    for (f, d), (g, e) in pairs:
        beside[f].append((g, d == e))
        beside[g].append((f, d == e))
    start = min(group)
    side, todo = {start: 0}, [start]
    while todo:
        f = todo.pop()
        for g, against in beside[f]:
            if g not in side:
                side[g] = side[f] ^ against
                todo.append(g)
            elif side[g] != side[f] ^ against:
                return None
    return side


# --- the survey against the oracle --------------------------------------------------------------


@pytest.mark.parametrize("name", CLOSED)
def test_closed_surfaces_are_solids(name):
    vertices, faces = CLOSED[name]
    check(vertices, faces)
    mesh = collide.Mesh(vertices, faces)
    assert mesh.solid and mesh == collide.Mesh(vertices, faces, solid=True)
    volume = surfaces.exact_volume(vertices, faces)
    assert mesh.report.volume == pytest.approx(float(volume), rel=1e-12)
    check(*surfaces.loosened(vertices, faces))
    assert collide.Mesh(*surfaces.loosened(vertices, faces)).solid


def test_known_characteristics():
    for name, euler in (
        ("box", 2),
        ("ball", 2),
        ("torus", 0),
        ("two boxes at an edge", 3),
        ("two boxes at a vertex", 3),
    ):
        assert collide.Mesh(*CLOSED[name]).report.euler == euler
    assert collide.Mesh(*CLOSED["two boxes at a vertex"]).report.shells == 2


def spoilt(rng, vertices, faces):
    """A surface with one to four random defects."""
    vertices, faces = vertices.copy(), faces.copy()
    for _ in range(int(rng.integers(1, 5))):
        f, v = int(rng.integers(len(faces))), int(rng.integers(len(vertices)))
        what = int(rng.integers(8))
        if what == 0:
            faces[f] = faces[f][::-1]
        elif what == 1 and len(faces) > 2:
            faces = np.delete(faces, f, axis=0)
        elif what == 2:
            faces = np.vstack([faces, np.roll(faces[f], int(rng.integers(3)))])
        elif what == 3:
            faces = np.vstack([faces, faces[f][::-1]])
        elif what == 4:
            faces[f, int(rng.integers(3))] = v
        elif what == 5:
            vertices[v] = vertices[int(rng.integers(len(vertices)))]
        elif what == 6:
            vertices[faces[f, 0]] = (vertices[faces[f, 1]] + vertices[faces[f, 2]]) / 2
        else:
            faces = faces[rng.permutation(len(faces))]
    return vertices, faces


@pytest.mark.many(2)
@pytest.mark.parametrize("name", CLOSED)
def test_random_defects(name):
    rng = rng_of("defects", name)
    for _ in range(60):
        check(*spoilt(rng, *CLOSED[name]))


def test_random_facets_over_few_vertices():
    rng = rng_of("soup")
    for k in range(300):
        n = int(rng.integers(3, 8))
        check(
            rng.integers(0, 3, (n, 3)).astype(float) * 2.0 ** rng.integers(-60, 60), rng.integers(0, n, (1 + k % 14, 3))
        )


def test_welding_compares_numbers():
    rng = rng_of("weld")
    for n in (1, 2, 7, 300):
        points = (
            rng.integers(-1, 2, (n, 3))
            * rng.choice([1.0, 1e-300, 5e-324, 1e50], (n, 3))
            * rng.choice([1.0, -1.0], (n, 3))
        )
        first: dict = {}
        expected = [first.setdefault(tuple((p + 0.0).tolist()), k) for k, p in enumerate(points)]
        assert weld(points).tolist() == expected, points.tolist()


def test_a_book_of_many_pages_takes_no_time():
    """Facets that all share one edge, and a fan of as many around one vertex."""
    many = 20_000
    angle = np.linspace(0, 6, many)
    vertices = np.concatenate([[(0, 0, 0), (0, 0, 1)], np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)])
    pages = np.stack([np.zeros(many), np.ones(many), np.arange(2, many + 2)], axis=1).astype(int)
    survey = survey_surface(vertices, pages.astype(np.int32))
    assert survey.edges == 2 * many + 1 and flagged(survey, meet.UNBALANCED) == set(range(many))
    fan = np.stack([np.zeros(many - 1), np.arange(2, many + 1), np.arange(3, many + 2)], axis=1).astype(np.int32)
    survey = survey_surface(vertices, fan)
    assert survey.open_edges == many + 1 and survey.n_shells == 1 and survey.euler == 1


# --- inside out -----------------------------------------------------------------------------------


def test_nested_boxes_wind_as_often_as_they_enclose():
    """Each part is a cavity exactly where the parts around it wind once or more."""
    rng = rng_of("nested")
    for _ in range(120):
        boxes = nested_boxes(rng)
        turned = [bool(t) for t in rng.integers(0, 2, len(boxes))]
        parts = [(v, f[:, ::-1] if t else f) for (v, f), t in zip((surfaces.box(*b) for b in boxes), turned)]
        vertices, faces = surfaces.joined(*parts)
        survey = survey_surface(vertices, faces.astype(np.int32))
        expected = set()
        for k, (low, high) in enumerate(boxes):
            around = sum(
                1 - 2 * turned[j] for j, (a, b) in enumerate(boxes) if j != k and (a <= low).all() and (high <= b).all()
            )
            if turned[k] and around < 1:
                expected |= set(range(12 * k, 12 * k + 12))
        assert flagged(survey, says.INSIDE_OUT) == expected, snippet(vertices, faces)
        assert collide.Mesh(vertices, faces).solid == (not expected), snippet(vertices, faces)


def _do_not_cross(low, high, a, b) -> bool:
    if ((low == a) | (high == b) | (low == b) | (high == a)).any():
        return False
    apart = (high <= a).any() or (b <= low).any()
    return bool(apart or ((a <= low) & (high <= b)).all() or ((low <= a) & (b <= high)).all())


def nested_boxes(rng) -> list:
    """Boxes on a lattice whose surfaces neither cross nor touch."""
    boxes: list = []
    for _ in range(40):
        low = rng.integers(0, 12, 3)
        high = low + rng.integers(1, 13 - low)
        if all(_do_not_cross(low, high, a, b) for a, b in boxes):
            boxes.append((low, high))
    return boxes[:6]


def by_solid_angles(vertices, faces, point) -> int:
    """How often facets wind around a point: their solid angles (Van Oosterom, Strackee 1983) over 4 π."""
    a, b, c = (vertices[faces[:, k]] - point for k in range(3))
    la, lb, lc = (np.sqrt(np.square(v).sum(axis=1)) for v in (a, b, c))
    up = (a * np.cross(b, c)).sum(axis=1)
    down = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    turns = np.arctan2(up, down).sum() / (2 * np.pi)
    assert abs(turns - round(turns)) < 1e-6
    return round(turns)


def winding_around(points, faces, rows) -> int | None:
    """As kernels in Python have it; None where it lies on a facet, or all directions met an edge."""
    n, f, corners = len(points), len(faces), np.ascontiguousarray(faces, dtype=np.int32)
    points, signs = np.ascontiguousarray(points), np.ones(1, dtype=np.int32)
    memory = np.zeros(nesting.shells_memory(n, f, 1) // 8 + 1, dtype=np.int64)
    space = nesting._nesting(address_of(points), n, address_of(corners), f, address_of(signs), 1, address_of(memory))[0]
    nesting._scale(space.points, space.scaled)
    space.gathered[:] = corners.ravel()
    space.row[: len(rows)] = rows
    outcome, winding = nesting.winding_around(space, f, len(rows))
    return winding if outcome == nesting._DECIDED else None


@pytest.mark.plain_kernels
@pytest.mark.parametrize("corners", [1, 3])
def test_winding_numbers_are_those_of_solid_angles(corners):
    """Around points, and around the middles of three; on a lattice, where rays and facets are as awkward as they
    come."""
    rng = rng_of("winding", corners)
    seen = set()
    for k in range(100):
        parts = [
            surfaces.torus(9, 5),
            surfaces.ball(),
            surfaces.box((-2, -2, -2), (2, 2, 2)),
            surfaces.box((-0.5, -0.5, -0.5), (0.5, 1.5, 0.5)),
        ]
        parts = [(v, f[:, ::-1] if rng.random() < 0.3 else f) for v, f in parts]
        vertices, faces = surfaces.joined(*parts)
        if k % 2:
            vertices = np.round(vertices * 8)
            points = rng.integers(-16, 17, (corners, 3)).astype(float)
        else:
            points = rng.uniform(-2.2, 2.2, (corners, 3))
        every = np.vstack([vertices, points])
        rows = np.arange(len(vertices), len(every))
        found = winding_around(every, faces, rows)
        if found is not None:
            assert found == by_solid_angles(vertices, faces, points.mean(axis=0)), snippet(every, faces)
            seen.add(found)
        else:
            assert k % 2, "a random point lies on no facet"
    assert len(seen) >= 4


@pytest.mark.parametrize("last", [(-0.5, -0.5, -0.5), (-1.0, -0.5, 0.25)])
def test_a_cavity_that_touches_its_wall(last):
    """Three or all four corners of the hole lie on the wall."""
    wall = surfaces.box((-1, -1, -1), (1, 1, 1))
    hole = (np.array([(1.0, 0, 0), (0, 1, 0), (0, 0, 1), last]), np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]))
    volume = surfaces.exact_volume(*hole)
    assert volume > 0
    mesh = collide.Mesh(*surfaces.joined(wall, (hole[0], hole[1][:, ::-1])))
    assert mesh.solid and mesh.report.volume == pytest.approx(8 - float(volume))
    beside = collide.Mesh(*surfaces.joined(wall, (hole[0] + (2.0, 0, 0), hole[1][:, ::-1])))
    assert not beside.solid


def test_signs_of_volumes_doubles_cannot_tell():
    """A flat tetrahedron far away, one vertex one unit in the last place above, in or below the plane of the others."""
    for scale in (1.0, 2.0**60, 2.0**-120):
        for step, solid in ((1, True), (0, False), (-1, False)):
            z = np.nextafter(1e6, step * np.inf) if step else 1e6
            vertices = np.array([(0.1, 0.7, 1e6), (1e6, 0.3, 1e6), (0.9, 1e6, 1e6), (3e5, 3e5, z)]) * scale
            faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
            check(vertices, faces)
            assert collide.Mesh(vertices, faces).solid == solid


def test_facets_without_area_are_found_exactly():
    """Points on a line of doubles, and the same a unit in the last place off it."""
    a, u = np.array([0.1, 0.2, 0.3]), np.array([3.0, -5.0, 7.0])
    dyadic = np.array([0.125, 0.25, 0.375])
    line = [dyadic, dyadic + u, dyadic + 3 * u]
    assert surfaces.exact_area_is_zero(line, (0, 1, 2))
    off = [*line[:2], np.nextafter(line[2], np.inf)]
    for points in (line, off, [a, a + u, a + 3 * u]):
        check(np.array(points), [(0, 1, 2)])
        expected = surfaces.exact_area_is_zero(points, (0, 1, 2))
        assert (
            bool(flagged(survey_surface(np.array(points), np.array([[0, 1, 2]], dtype=np.int32)), says.NO_AREA))
            == expected
        )


# --- the class --------------------------------------------------------------------------------------


def opened():
    vertices, faces = surfaces.box()
    return vertices, faces[1:]


def test_it_is_said_which():
    mesh = collide.Mesh(*surfaces.box())
    assert mesh.solid is True and repr(mesh) == "Mesh(vertices=<8×3 array>, faces=<12×3 array>, solid=True)"
    assert str(mesh.report).startswith("solid: ")
    mesh = collide.Mesh(*opened())
    assert mesh.solid is False and "solid=False" in repr(mesh)
    (defect,) = mesh.report.defects
    assert defect.name == "open edges" and defect.spoils and defect.facets.tolist() == [0, 4, 10]
    assert str(mesh.report).splitlines()[0] == "surface: open edges"
    assert "facets 0, 4, 10" in str(mesh.report)
    for no, yes in ((False, True), (np.False_, np.True_)):
        chosen = collide.Mesh(*surfaces.box(), solid=no)
        assert chosen.solid is False and "could be a solid" in str(chosen.report)
        assert collide.Mesh(*surfaces.box(), solid=yes).solid is True


def turned_facet():
    vertices, faces = surfaces.box()
    faces[3] = faces[3][::-1].copy()
    return vertices, faces


def moebius():
    around = 8
    a = 2 * np.pi * np.arange(around) / around
    inner, outer = (
        np.stack([(1 + s * np.cos(a / 2)) * np.cos(a), (1 + s * np.cos(a / 2)) * np.sin(a), s * np.sin(a / 2)], axis=1)
        for s in (-0.3, 0.3)
    )
    faces = []
    for i in range(around):
        b, d = (i + 1, around + i + 1) if i + 1 < around else (around, 0)
        faces += [(i, b, d), (i, d, around + i)]
    return np.concatenate([inner, outer]), np.array(faces)


@pytest.mark.parametrize(
    ("mesh", "name", "facets"),
    [
        (opened(), "open edges", "facets 0, 4, 10"),
        (turned_facet(), "inconsistent orientation", "facet 3"),
        ((surfaces.box()[0], surfaces.box()[1][:, ::-1]), "inside out", r"facets 0, 1, 2, 3, 4, 5, … \(12 in all\)"),
        ((surfaces.box()[0], np.vstack([surfaces.box()[1], surfaces.box()[1][5:6]])), "duplicate facets", "facet 12"),
        ((surfaces.box()[0], np.vstack([surfaces.box()[1], [(0, 7, 3)]])), "unbalanced edges", "facets"),
        (moebius(), "one-sided", "facets"),
        ((np.eye(3), [(0, 1, 2), (2, 1, 0)]), "encloses nothing", "facets 0, 1"),
        ((np.eye(3), [(0, 1, 1)]), "no facet has three distinct corners", ""),
    ],
)
def test_no_solid_without_an_inside(mesh, name, facets):
    with pytest.raises(
        collide.InvalidShape, match=rf"(?s)^Mesh: no inside can be told: .*{name}.*{facets}.* Repair the mesh"
    ):
        collide.Mesh(*mesh, solid=True)
    taken = collide.Mesh(*mesh)
    assert not taken.solid and name in str(taken.report)


BAD = [
    ((np.full((3, 3), np.nan), [(0, 1, 2)]), r"Mesh: vertices\[0, 0\] is nan"),
    (([(0, 0, 0), (1, 0, 0), (0, np.inf, 0)], [(0, 1, 2)]), r"Mesh: vertices\[2, 1\] is inf"),
    ((np.eye(3), np.zeros((0, 3), dtype=int)), r"Mesh: no facets: faces has shape \(0, 3\)"),
    ((np.eye(3), []), "Mesh: no facets"),
    (
        (np.eye(3), [(0, 1, 2), (0, 1, 3)]),
        r"Mesh: faces\[1\] is \[0, 1, 3\], but there are vertices 0 … 2 \(1 such facet\)",
    ),
    ((np.eye(3), [(0, -1, 2)]), r"Mesh: faces\[0\] is \[0, -1, 2\]"),
    ((np.eye(3), [(0, 1, np.nan)]), r"Mesh: faces must be integers, got faces\[0, 2\] = nan"),
    ((np.eye(3), [(0, 1, 1.5)]), r"faces\[0, 2\] = 1.5"),
    ((np.eye(3), [(0.0, 1.0, 2.0)]), "got float64"),
    ((np.eye(4)[:, :3], [(0, 1, 2, 3)]), r"Mesh: faces must have shape \(m, 3\), got \(1, 4\); cut polygons"),
    ((np.eye(3), [(0, 1, 2), (0, 1)]), "rows of different lengths"),
    ((np.eye(3), [0, 1, 2]), r"shape \(m, 3\), got \(3,\)"),
    ((np.eye(3), "abc"), "Mesh: faces"),
    ((np.eye(3), [(0, 1, 2**40)]), "but there are vertices"),
    ((np.zeros((0, 3)), [(0, 1, 2)]), "Mesh: vertices is empty"),
    ((np.eye(3)[:, :2], [(0, 1, 2)]), r"Mesh: vertices must have shape \(N, 3\)"),
    ((np.eye(3) * 1e60, [(0, 1, 2)]), "finite and within"),
    ((np.eye(3) * 1e-60, [(0, 1, 2)]), "scale the scene"),
]


@pytest.mark.parametrize(("given", "message"), BAD)
def test_bad_input_is_refused_by_name(given, message):
    for solid in (None, True, False):
        with pytest.raises(collide.InvalidShape, match=message):
            collide.Mesh(*given, solid=solid)
    with pytest.raises(collide.InvalidShape, match="solid must be True, False or None"):
        collide.Mesh(np.eye(3), [(0, 1, 2)], solid="yes")


def test_a_value_like_other_shapes(tmp_path):
    vertices, faces = surfaces.torus()
    mesh = collide.Mesh(vertices, faces)
    for name in ("vertices", "faces", "solid"):
        with pytest.raises(AttributeError, match="immutable"):
            setattr(mesh, name, 1)
    for array in (mesh.vertices, mesh.faces, mesh.survey.flags, mesh.survey.corners):
        assert not array.flags.writeable
    vertices[0] = 9.0
    assert mesh.vertices[0, 0] != 9.0
    mesh.save(tmp_path / "torus.npz")
    copies = [
        pickle.loads(pickle.dumps(mesh)),
        copy.copy(mesh),
        copy.deepcopy(mesh),
        collide.Mesh.load(tmp_path / "torus.npz"),
    ]
    for other in copies:
        assert other == mesh and hash(other) == hash(mesh) and other.solid and str(other.report) == str(mesh.report)
        assert not other.vertices.flags.writeable
    assert mesh != collide.Mesh(mesh.vertices, mesh.faces, solid=False)
    assert mesh != collide.Mesh(mesh.vertices * 2, mesh.faces)
    with pytest.raises(collide.UnsupportedQuery, match="Mesh"):
        parts_of(mesh)


def test_what_is_pickled_keeps_its_word():
    """A surface by choice stays one, though it would close."""
    for solid in (None, False):
        mesh = collide.Mesh(*surfaces.ball(), solid=solid)
        assert pickle.loads(pickle.dumps(mesh)).solid is mesh.solid


def test_files_that_are_no_mesh(tmp_path):
    mesh = collide.Mesh(*surfaces.box())
    place = tmp_path / "box.npz"
    mesh.save(place)
    collide.ConvexHull(np.eye(3)).save(tmp_path / "hull.npz")
    (tmp_path / "text.npz").write_text("no")
    with pytest.raises(collide.InvalidShape, match="of another format"):
        collide.Mesh.load(tmp_path / "hull.npz")
    for name in ("text.npz", "absent.npz"):
        with pytest.raises(collide.InvalidShape, match=r"Mesh\.load"):
            collide.Mesh.load(tmp_path / name)
    with pytest.raises(collide.InvalidShape, match=r"Mesh\.save"):
        mesh.save(tmp_path / "no" / "folder.npz")
    arrays = dict(np.load(place))
    arrays["faces"] = arrays["faces"][::-1]
    np.savez(place, **arrays)
    with pytest.raises(collide.InvalidShape, match="damaged"):
        collide.Mesh.load(place)


def test_scaled_copies(tmp_path):
    mesh = collide.Mesh(*surfaces.torus())
    big = mesh.scaled(3.0)
    assert big.base is mesh and big.scale == 3.0 and big.solid and big.faces is mesh.faces
    assert np.array_equal(big.vertices, mesh.vertices * 3.0) and big == collide.Mesh(mesh.vertices * 3.0, mesh.faces)
    assert big.survey is mesh.survey and big.report.volume == pytest.approx(27 * mesh.report.volume)
    assert big.scaled(0.5).scale == 1.5 and big.scaled(0.5).base is mesh
    assert mesh.scaled(2).scaled(0.5) is mesh
    big.save(tmp_path / "big.npz")
    for other in (pickle.loads(pickle.dumps(big)), collide.Mesh.load(tmp_path / "big.npz")):
        assert other == big and other.scale == 3.0 and other.base == mesh
    for factor in (0.0, (1, 0, 1), np.nan, np.inf, "two", None):
        with pytest.raises(collide.InvalidShape, match=r"Mesh\.scaled: factor"):
            mesh.scaled(factor)
    with pytest.raises(collide.InvalidShape, match="Mesh: vertices"):
        mesh.scaled(1e49).scaled(1e49)


def test_corruptions_are_answered_or_refused():
    """Whatever is done to the arrays: a mesh with a report, or InvalidShape."""
    rng = rng_of("corruptions")
    refused = 0
    for _ in range(200):
        vertices, faces = (a.astype(float) for a in CLOSED[list(CLOSED)[int(rng.integers(len(CLOSED)))]])
        for _ in range(int(rng.integers(1, 4))):
            array = vertices if rng.random() < 0.5 else faces
            value = rng.choice([np.nan, np.inf, -1.0, 0.0, 1e9, 0.5, 1e-320, 7.0])
            array[int(rng.integers(len(array))), int(rng.integers(3))] = value
        ids = faces.astype(int) if np.isfinite(faces).all() and (faces == np.floor(faces)).all() else faces
        try:
            assert str(collide.Mesh(vertices, ids).report)
        except collide.InvalidShape as error:
            assert str(error).startswith("Mesh: ") and len(str(error)) < 300
            refused += 1
    assert 40 < refused < 190


# --- meshes that people use ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(not (SHARED / "data/meshes").is_dir(), reason="shared/data/meshes is not there")
@pytest.mark.parametrize(
    ("name", "solid", "facets", "shells", "euler", "open_edges"),
    [
        ("teapot_1177.ply", False, 2256, 4, 1, 96),
        ("bunny_35947.ply", False, 69451, 1, -3, 223),
        ("dragon_vrip_res2.ply.gz", False, 202520, None, None, None),
        ("dragon_vrip.ply.gz", True, 871414, 1, -108, 0),
    ],
)
def test_known_meshes(name, solid, facets, shells, euler, open_edges):
    trimesh = pytest.importorskip("trimesh")
    import gzip
    import io

    blob = (SHARED / "data/meshes" / name).read_bytes()
    if name.endswith(".gz"):
        blob = gzip.decompress(blob)
    found = trimesh.load(io.BytesIO(blob), file_type="ply", process=False)
    mesh = collide.Mesh(found.vertices, found.faces)
    report = mesh.report
    assert mesh.solid == solid and report.facets == facets
    if shells is not None:
        assert (report.shells, report.euler, mesh.survey.open_edges) == (shells, euler, open_edges)
    if name == "dragon_vrip.ply.gz":
        flat = next(defect for defect in report.defects if defect.name == "no area")
        assert len(flat.facets) == 108 and report.welded == 2100
        assert all(surfaces.exact_area_is_zero(mesh.vertices, mesh.faces[f]) for f in flat.facets)
    assert Fraction(report.volume) != 0 or not mesh.survey.closed
