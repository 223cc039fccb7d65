"""Repair: broken surfaces become the solids they were, judged by winding numbers in fractions; steps are told."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
import surfaces
from soak_solids import edges_balance, has_flat_facets
from solid_membership import windings

import collide
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.solids.border_cycles import border_edges, cycles_of
from collide.solids.least_triangulation import closing_triangles


def exact(vertices, faces) -> list:
    points = [tuple(map(Fraction, p)) for p in np.asarray(vertices).tolist()]
    return [[points[v] for v in face] for face in np.asarray(faces).tolist()]


def holds(mesh, points) -> list[bool | None]:
    """Whether facets wind around points once or more, in fractions; None on a facet."""
    return [None if w is None else w >= 1 for w in windings(exact(mesh.vertices, mesh.faces), points)]


def assert_same_inside(mesh, vertices, faces, seed: int, n: int = 80, reach: float = 0.0):
    """The points of a solid are those around which the whole facets wind; within ``reach`` of them nothing is asked."""
    rng = np.random.default_rng(seed)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    points = rng.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), (n, 3))
    if reach:
        points = points[collide.signed_distances(collide.Mesh(vertices, faces), points).lower ** 2 > reach * reach]
    whole = [w is None or w >= 1 for w in windings(exact(vertices, faces), points)]
    assert holds(mesh, points) == whole
    assert sum(whole) > n // 20 and len(whole) - sum(whole) > n // 20


SOLIDS = {
    "torus": surfaces.torus(), "ball": surfaces.ball(),
    "two": surfaces.joined(surfaces.ball(), surfaces.box((3, 0, 0), (4, 1, 1))),
}


def broken(rng, vertices, faces):
    """(vertices, faces, what was done, the deepest change): a solid spoilt in several ways at once."""
    done = Counter()
    faces = faces.copy()
    few = rng.random(len(faces)) < rng.choice([0.0, 0.2])
    few &= np.cumsum(few) < len(faces) // 3
    faces[few] = faces[few, ::-1]
    done["turned"] = int(few.sum())
    if rng.random() < 0.5:  # one in a place, so that the hole is one facet wide
        gone = int(rng.integers(len(faces)))
        faces, done["hole"] = np.delete(faces, gone, axis=0), 1
    if rng.random() < 0.5:
        again = rng.integers(0, len(faces), 3)
        faces, done["repeated"] = np.concatenate([faces, faces[again][:, [1, 2, 0]]]), 3
    if rng.random() < 0.5:
        row = faces[int(rng.integers(len(faces)))]
        faces, done["collapsed"] = np.concatenate([faces, [[row[0], row[0], row[1]]]]), 1
    if rng.random() < 0.5:
        vertices, faces = surfaces.loosened(vertices, faces)
        vertices = vertices + rng.uniform(-1e-8, 1e-8, vertices.shape)
        done["loose"] = 1
    return vertices, faces, done


def test_spoilt_solids_become_solids_again():
    """Facets turned, missing, repeated, collapsed, vertices apart by 1e-8: the same inside, in fractions."""
    done = Counter()
    for seed in range(18):
        rng = np.random.default_rng(seed)
        name = list(SOLIDS)[seed % len(SOLIDS)]
        vertices, faces, what = broken(rng, *SOLIDS[name])
        done += Counter(what.keys())
        made = collide.Mesh(vertices, faces).repaired(widest_hole=2.0)
        assert made.mesh.solid and not made.report.unrepaired, (seed, name, what, str(made.report))
        assert len(made.source_facets) == len(made.mesh.faces)
        assert made.report.moved <= 1e-7
        if what["hole"]:
            assert len(made.report.holes) == 1 and made.report.holes[0].edges == 3, (seed, what)
        else:
            assert not made.report.holes
        assert_same_inside(made.mesh, *SOLIDS[name], seed, reach=0.0 if what["hole"] + what["loose"] == 0 else 1e-6)
    assert min(done[name] for name in ("turned", "hole", "repeated", "collapsed", "loose")) >= 4


def test_each_step_is_told_with_its_facets():
    vertices, faces = surfaces.ball()
    n = len(faces)
    whole = collide.Mesh(vertices, faces)
    same = whole.repaired()
    assert same.mesh is whole and not same.report.changed and str(same.report) == "- nothing to repair"
    assert np.array_equal(same.source_facets, np.arange(n))
    turned = faces.copy()
    turned[[3, 7]] = turned[[3, 7], ::-1]
    assert collide.Mesh(vertices, turned).repaired().report.turned.tolist() == [3, 7]
    repeated = collide.Mesh(vertices, np.concatenate([faces, faces[[5]]])).repaired()
    assert repeated.report.repeated.tolist() == [n] and np.array_equal(repeated.mesh.faces, faces)
    opened = np.delete(faces, 20, axis=0)
    made = collide.Mesh(vertices, opened).repaired(widest_hole=10.0)
    hole = made.report.holes[0]
    around = {f for f, face in enumerate(opened.tolist()) if len({*face} & {*faces[20].tolist()}) == 2}
    assert set(hole.facets.tolist()) == around and hole.edges == 3
    a, b, c = vertices[faces[20]]
    assert hole.length == pytest.approx(math.dist(*(f([a, b, c], axis=0) for f in (np.min, np.max))))
    assert hole.width == pytest.approx(np.linalg.norm(np.cross(b - a, c - a)) / hole.length)
    assert made.source_facets.tolist() == [*range(n - 1), -1]
    assert set(made.mesh.faces[-1].tolist()) == set(faces[20].tolist())
    assert "closed 1 hole" in str(made.report) and "moved" not in str(made.report)
    apart = vertices.copy()
    first = np.concatenate([apart, apart[faces[4]] + 1e-9])
    loose = faces.copy()
    loose[4] = np.arange(len(vertices), len(vertices) + 3)
    made = collide.Mesh(first, loose).repaired()
    assert made.report.welded.tolist() == [len(vertices) + k for k in range(3)]
    assert np.array_equal(made.mesh.faces, faces) and 1e-9 < made.report.moved < 2e-9
    assert not collide.Mesh(first, loose).repaired(weld=0.0, widest_hole=0.0).mesh.solid


def test_wide_holes_stay_open_and_say_so():
    """A box without a lid: told how wide, and beside which facets; nothing is closed, also no small hole."""
    vertices, faces = surfaces.joined(surfaces.box(), surfaces.ball())
    vertices[8:] += 5.0
    faces = np.delete(faces, [10, 11, 30], axis=0)
    mesh = collide.Mesh(vertices, faces)
    made = mesh.repaired()
    assert not made.mesh.solid and not made.report.holes and np.array_equal(made.mesh.faces, faces)
    entry = made.report.unrepaired[0]
    lid = {f for f, face in enumerate(faces[:10].tolist()) if sum(vertices[v][2] == 1.0 for v in face) == 2}
    assert entry.what == "open edges" and set(entry.facets.tolist()) == lid
    share = 100 * math.sqrt(2) / float(np.linalg.norm(np.ptp(vertices, axis=0)))
    assert f"a hole of 4 edges, {share:.3g} % of the size long and {share:.3g} % wide, over" in entry.why
    assert made.mesh is mesh
    made = mesh.repaired(widest_hole=math.inf)
    assert made.mesh.solid and [hole.edges for hole in made.report.holes] == [4, 3]
    assert made.mesh.volume == pytest.approx(1.0 + collide.Mesh(*surfaces.ball()).volume, rel=0.02)


def test_a_sheet_is_no_solid():
    """Triangles over the hole of a flat sheet lie on it: they go again, and the report says why."""
    vertices = np.array([[x, y, 0.0] for x in range(4) for y in range(4)])
    quads = [(4 * x + y, 4 * x + y + 4, 4 * x + y + 5, 4 * x + y + 1) for x in range(3) for y in range(3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    made = collide.Mesh(vertices, faces).repaired(widest_hole=math.inf)
    assert not made.mesh.solid and len(made.mesh.faces) == 18 and not made.report.holes
    assert made.report.unrepaired[0].what == "open edges"
    assert "enclose nothing" in made.report.unrepaired[0].why


def test_parts_inside_out_are_turned_and_cavities_stay():
    outer, inner = surfaces.box((0, 0, 0), (4, 4, 4)), surfaces.box((1, 1, 1), (2, 2, 2))
    vertices, faces = surfaces.joined(outer, inner)
    hollow = faces.copy()
    hollow[12:] = hollow[12:, ::-1]
    reverse = collide.Mesh(vertices, hollow[:, ::-1])
    assert not reverse.solid
    made = reverse.repaired()
    assert made.mesh.solid and made.mesh.volume == 63.0 and len(made.report.turned) == 24
    apart, faces = surfaces.joined(surfaces.box(), surfaces.box((3, 0, 0), (4, 1, 1)))
    faces[12:] = faces[12:, ::-1]
    made = collide.Mesh(apart, faces).repaired()
    assert made.mesh.solid and made.mesh.volume == 2.0 and made.report.turned.tolist() == list(range(12, 24))


def test_surfaces_drawn_from_both_sides_become_solids():
    vertices, faces = surfaces.torus()
    both = np.concatenate([faces[:, ::-1], faces])
    made = collide.Mesh(vertices, both).repaired()
    assert made.mesh.solid and len(made.mesh.faces) == len(faces) and len(made.report.repeated) == len(faces)
    assert made.mesh.volume == pytest.approx(collide.Mesh(vertices, faces).volume)
    fin = np.concatenate([faces, faces[[0]], [[*faces[3][:2], len(vertices)]], [[*faces[3][1::-1], len(vertices)]]])
    made = collide.Mesh(np.concatenate([vertices, [[0.0, 0.0, 9.0]]]), fin).repaired()
    n = len(faces)
    assert made.mesh.solid and made.report.repeated.tolist() == [n, n + 1, n + 2]


@pytest.mark.parametrize("bulge", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("sense", [1, -1])
def test_walls_inside_go(bulge, sense):
    """Two rooms in a row with a wall between, flat or a cone nearly as large as a room."""
    ring = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    rings = [np.column_stack([ring, np.full(4, z)]) for z in (0.0, 1.0, 2.0)]
    vertices = np.concatenate([*rings, [[0.5, 0.5, 0.0], [0.5, 0.5, 2.0], [0.5, 0.5, 1.0 + bulge]]])
    faces = []
    for low in (0, 4):
        for k in range(4):
            a, b = low + k, low + (k + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    for k in range(4):
        j = (k + 1) % 4
        faces += [(j, k, 12), (8 + k, 8 + j, 13), (4 + k, 4 + j, 14)[::sense]]
    faces = np.array(faces)
    walls = [f for f, face in enumerate(faces.tolist()) if 14 in face]
    made = collide.Mesh(vertices, faces).repaired()
    assert made.mesh.solid and made.report.walls.tolist() == walls and made.mesh.volume == pytest.approx(2.0)


def test_facets_that_cross_are_resolved_by_winding():
    vertices, faces = surfaces.joined(surfaces.box(), surfaces.box((0.5, 0.25, 0.25), (2, 0.75, 0.75)))
    mesh = collide.Mesh(vertices, faces)
    assert mesh.solid and mesh.volume == 1.375
    made = mesh.repaired()
    assert made.mesh.volume == 1.25 and not collide.self_collisions(made.mesh).hit
    assert len(made.report.crossings) == len(collide.self_collisions(mesh).pairs)
    assert set(np.unique(made.source_facets).tolist()) <= set(range(24))
    assert_same_inside(made.mesh, vertices, faces, 3)
    assert mesh.repaired(crossings=False).mesh is mesh
    taken_off = np.concatenate([faces[:12], faces[12:, ::-1]])  # where it overlaps; nothing winds around the rest
    assert collide.Mesh(vertices, taken_off).repaired().mesh.volume == 0.875


def test_facets_without_area_go_and_the_surface_stays():
    """A vertex on an edge of one side alone, as CAD leaves them: the gap is closed along the edge, exactly."""
    vertices, faces = surfaces.box()
    rng = np.random.default_rng(5)
    for case in range(20):
        edge = faces[int(rng.integers(12)), :2]
        share = float(rng.choice([0.25, 0.5, 0.75]))
        split = vertices[edge[0]] + share * (vertices[edge[1]] - vertices[edge[0]])
        if (split[:, None] == vertices.T).all(axis=0).any():
            continue
        rows = [f for f, face in enumerate(faces.tolist()) if {*edge.tolist()} <= {*face}]
        one = faces[rows[0]]
        halves = [np.where(one == end, 8, one) for end in edge]
        changed = np.concatenate([np.delete(faces, rows[0], axis=0), halves])
        mesh = collide.Mesh(np.concatenate([vertices, [split]]), changed)
        assert not mesh.solid
        made = mesh.repaired()
        assert made.mesh.solid and made.mesh.volume == 1.0 and not has_flat_facets(made.mesh), case
        assert len(made.mesh.faces) == 14 and edges_balance(made.mesh.faces)
        with_flat = np.concatenate([changed, [[edge[1], 8, edge[0]] if _runs(one, edge) else [edge[0], 8, edge[1]]]])
        flat = collide.Mesh(np.concatenate([vertices, [split]]), with_flat)
        assert flat.solid and has_flat_facets(flat)
        told = flat.repaired()
        assert told.report.flat.tolist() == [13] and told.mesh.solid and not has_flat_facets(told.mesh), case
        assert_same_inside(told.mesh, vertices, faces, case, 60)


def _runs(face, edge) -> bool:
    return any(face[k] == edge[0] and face[(k + 1) % 3] == edge[1] for k in range(3))


def test_many_vertices_on_one_line():
    """Flat facets over flat facets: all go, and the border of the surface is as before."""
    for seed in range(30):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(3, 8))
        line = np.column_stack([np.sort(rng.choice(64, n, replace=False)) / 8.0, np.zeros((n, 2))])
        vertices = np.concatenate([line, [[2.0, 3.0, 0.0], [2.0, -1.0, 2.0]]])
        rows = [rng.choice(n, 3, replace=False) for _ in range(int(rng.integers(1, 9)))]
        faces = np.array([*rows, (0, n - 1, n), (n - 1, 0, n + 1)])
        made = collide.Mesh(vertices, faces, solid=False).repaired(weld=0.0, widest_hole=0.0).mesh
        assert not has_flat_facets(made)
        before, after = (Counter(map(tuple, elementary(vertices, f))) for f in (faces, made.faces))
        assert {e: before[e] - before[e[::-1]] for e in before} == {
            e: after[e] - after[e[::-1]] for e in before
        }, seed


def elementary(vertices, faces) -> list:
    """Edges of facets, those on the line y = z = 0 cut at all vertices of the line."""
    on = [v for v in range(len(vertices)) if not vertices[v, 1:].any()]
    on.sort(key=lambda v: vertices[v, 0])
    out = []
    for face in np.asarray(faces).tolist():
        for k in range(3):
            a, b = face[k], face[(k + 1) % 3]
            if a in on and b in on:
                i, j = on.index(a), on.index(b)
                chain = on[i : j + 1] if i < j else on[j : i + 1][::-1]
                out += list(pairwise(chain))
            else:
                out.append((a, b))
    return out


def test_nothing_but_flat_facets():
    mesh = collide.Mesh(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), [[0, 1, 2]])
    made = mesh.repaired()
    assert made.mesh is mesh and not made.report.changed and made.report.unrepaired[0].what == "no area"


def test_a_surface_by_choice_becomes_the_solid_that_it_is():
    made = collide.Mesh(*surfaces.box(), solid=False).repaired()
    assert made.mesh.solid and not made.report.changed and not made.report.unrepaired


def test_soups_are_solids_or_say_why_not():
    """Random triangles of few vertices, all defects at once: clean solids, the same again, or reasons with facets."""
    solid = 0
    for seed in range(90):
        rng = np.random.default_rng(seed)
        n, side = int(rng.integers(3, 9)), int(rng.integers(3, 5))
        vertices = rng.integers(0, side, (n, 3)).astype(float)
        faces = rng.integers(0, n, (int(rng.integers(1, 22)), 3))
        options = {"widest_hole": (None, math.inf, 0.0)[seed % 3]}
        made = collide.Mesh(vertices, faces).repaired(**options)
        assert len(made.source_facets) == len(made.mesh.faces), seed
        assert -1 <= made.source_facets.min() and made.source_facets.max() < len(faces), seed
        if not made.mesh.solid:
            assert made.report.unrepaired and str(made.report), seed
            continue
        solid += 1
        assert not has_flat_facets(made.mesh) and not collide.self_collisions(made.mesh).hit, seed
        assert not made.mesh.repaired(**options).report.changed, seed
        crossing = collide.Mesh(vertices, faces).repaired(crossings=False, **options).mesh
        points = rng.uniform(-0.3, side - 0.7, (8, 3))
        for inside, whole in zip(holds(made.mesh, points), holds(crossing, points)):
            assert inside is whole or None in (inside, whole), seed
    assert solid >= 9


def test_cycles_cover_the_border_once():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        corners = rng.integers(0, 9, (int(rng.integers(1, 30)), 3)).astype(np.int32)
        corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
        if not len(corners):
            continue
        runs = Counter((a, b) for face in corners.tolist() for a, b in zip(face, face[1:] + face[:1]))
        wanted = Counter({e: n - runs[e[::-1]] for e, n in runs.items() if n > runs[e[::-1]]})
        edges, along = border_edges(corners)
        assert Counter(map(tuple, edges.tolist())) == wanted, seed
        for (a, b), row in zip(edges.tolist(), along.tolist()):
            assert _runs(corners[row], (a, b)), seed
        cycles = cycles_of(edges)
        assert sorted(np.concatenate([[], *cycles]).tolist()) == list(range(len(edges))), seed
        for cycle in cycles:
            assert (edges[cycle, 1] == np.roll(edges[cycle, 0], -1)).all(), seed
            assert len(set(edges[cycle, 0].tolist())) == len(cycle) >= 3, seed


def test_closing_triangles_have_least_area():
    """Against all triangulations of polygons of up to seven corners."""

    def least(points, i, j):
        if j - i < 2:
            return 0.0
        return min(
            least(points, i, k) + least(points, k, j)
            + 0.5 * float(np.linalg.norm(np.cross(points[k] - points[i], points[j] - points[i])))
            for k in range(i + 1, j)
        )

    for seed in range(20):
        points = np.random.default_rng(seed).normal(size=(3 + seed % 5, 3))
        triangles = closing_triangles(points)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        assert area == pytest.approx(least(points, 0, len(points) - 1)), seed
        runs = Counter((x, y) for t in triangles.tolist() for x, y in zip(t, t[1:] + t[:1]))
        border = {e for e, n in runs.items() if n > runs[e[::-1]]}
        assert border == {(k, (k + 1) % len(points)) for k in range(len(points))}, seed


@pytest.mark.parametrize(
    "options, words",
    [
        ({"weld": -1.0}, "repaired: weld"), ({"weld": "x"}, "repaired: weld"),
        ({"widest_hole": -1}, "widest_hole must be"),
        ({"widest_hole": math.nan}, "widest_hole must be"), ({"crossings": "yes"}, "repaired: crossings"),
        ({"time_limit": 0}, "time_limit must be"), ({"progress": 3}, "progress must be"),
    ],
)
def test_arguments_out_of_range(options, words):
    with pytest.raises(InvalidArgument, match=words):
        collide.Mesh(*surfaces.box()).repaired(**options)


def test_what_is_no_mesh_is_refused():
    with pytest.raises(InvalidArgument, match=r"repaired: mesh must be a collide\.Mesh"):
        collide.repaired(collide.Sphere(1.0))


def test_a_limit_stops_the_arrangement():
    vertices, faces = surfaces.joined(surfaces.ball(20, 30), surfaces.ball(20, 30))
    vertices[len(vertices) // 2 :] += 0.3
    with pytest.raises(UnsupportedQuery, match="memory=1"):
        collide.Mesh(vertices, faces).repaired(memory=1)
