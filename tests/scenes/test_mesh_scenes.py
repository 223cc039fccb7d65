"""Meshes of scene files as they are: solids, surfaces, mirrored scales, and what reports say of them."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from collide import Box, Compound, ConvexHull, Cylinder, Mesh, World, collide, distance, pose
from collide.cli.main import main
from collide.mesh.convex_surface import is_own_hull
from collide.reports import report, terminal
from collide.scenes import load
from collide.scenes.description import Scene, SceneBody

trimesh = pytest.importorskip("trimesh", reason="trimesh reads the meshes")




def l_solid() -> tuple[np.ndarray, np.ndarray]:
    """A closed L: two boxes that share a face, z from 0 to 1."""
    profile = np.array([(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2.0)])
    vertices = np.array([(x, y, z) for z in (0, 1) for x, y in profile])
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in caps] + [(a + 6, b + 6, c + 6) for a, b, c in caps]
    for k in range(6):
        j = (k + 1) % 6
        faces += [(k, j, j + 6), (k, j + 6, k + 6)]
    return vertices, np.array(faces)


def write_obj(file: Path, *meshes: tuple[np.ndarray, np.ndarray]) -> Path:
    text, first = "", 1
    for k, (vertices, faces) in enumerate(meshes):
        text += f"o part{k}\n" + "".join("v {!r} {!r} {!r}\n".format(*v) for v in vertices.tolist())
        text += "".join("f {} {} {}\n".format(*(i + first for i in f)) for f in faces.tolist())
        first += len(vertices)
    file.write_text(text)
    return file


def urdf(tmp_path: Path, mesh: str, scale: str = "1 1 1") -> Path:
    file = tmp_path / "r.urdf"
    file.write_text(
        f'<robot name="r"><link name="a"><collision><geometry><mesh filename="{mesh}" scale="{scale}"/></geometry>'
        "</collision></link></robot>"
    )
    return file


# --- what a mesh becomes ----------------------------------------------------------------------------


def test_a_mesh_is_itself_and_its_notch_is_free(tmp_path):
    write_obj(tmp_path / "l.obj", l_solid())
    (body,) = load(tmp_path / "l.obj").bodies
    assert isinstance(body.shape, Mesh) and body.shape.solid and body.approximation is None
    probe = Box((0.5, 0.5, 0.5)), pose((1.25, 1.25, 0.5))
    assert not collide(body.shape, probe[0], body.X_WB, probe[1])
    (hull,) = load(tmp_path / "l.obj", meshes="hull").bodies
    assert collide(hull.shape, probe[0], hull.X_WB, probe[1]) and "fills" in hull.approximation


def test_facets_keep_the_numbers_of_the_file(tmp_path):
    vertices, faces = l_solid()
    write_obj(tmp_path / "l.obj", (vertices, faces))
    shape = load(tmp_path / "l.obj").bodies[0].shape
    assert np.array_equal(shape.vertices[shape.faces], vertices[faces])


@pytest.mark.parametrize("suffix", ["stl", "ply", "glb", "off"])
def test_loose_triangles_close(tmp_path, suffix):
    """An STL is a soup, and others may be written as one."""
    vertices, faces = l_solid()
    soup = trimesh.Trimesh(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3), process=False)
    soup.export(tmp_path / f"l.{suffix}")
    shape = load(tmp_path / f"l.{suffix}").bodies[0].shape
    assert isinstance(shape, Mesh) and shape.solid and len(shape.vertices) == 12 and len(shape.faces) == len(faces)


@pytest.mark.parametrize("scale", ["-1 1 1", "-1 -2 -0.5", "-1 -1 1", "0.001 0.001 0.001", "3 0.1 7", "-2"])
def test_scales_mirror_the_facets_with_the_vertices(tmp_path, scale):
    vertices, faces = l_solid()
    write_obj(tmp_path / "l.obj", (vertices, faces))
    factors = np.broadcast_to(np.array([float(word) for word in scale.split()]), (3,))
    for _ in range(2):  # read, then from the cache
        robot = load(urdf(tmp_path, "l.obj", scale))
        shape = robot.bodies[0].shape
        assert isinstance(shape, Mesh) and shape.solid
        assert {tuple(v) for v in shape.vertices.tolist()} == {tuple(v) for v in (vertices * factors).tolist()}
        assert shape.report.volume == pytest.approx(1.75 * abs(np.prod(factors)), rel=1e-12)
        assert any("the mesh was mirrored" in note for note in robot.notes) == (np.prod(factors) < 0)


def test_an_open_mesh_is_a_surface_and_its_report_says_why(tmp_path):
    vertices, faces = l_solid()
    write_obj(tmp_path / "l.obj", (vertices, faces[1:]))
    scene = load(tmp_path / "l.obj")
    assert not scene.bodies[0].shape.solid
    (entry,) = report.make(scene).meshes
    assert entry["body"] == "l" and entry["facets"] == 19 and not entry["solid"]
    assert entry["what"].startswith("surface of 19 facets without an inside (open edges: facets 0, ")
    scene.add(SceneBody("pip", Box((0.1, 0.1, 0.1)), pose((0.25, 1.0, 0.5))))
    assert report.make(scene).verdict().startswith("no collision"), "a surface has no inside"
    write_obj(tmp_path / "closed.obj", (vertices, faces))
    whole = load(tmp_path / "closed.obj")
    whole.add(scene.bodies[-1])
    assert report.make(whole).collides


def test_parts_of_one_thing_are_taken_together(tmp_path):
    vertices, faces = l_solid()
    # two patches of one surface, neither of them closed
    write_obj(tmp_path / "patches.obj", (vertices, faces[:9]), (vertices, faces[9:]))
    (element,) = load(urdf(tmp_path, "patches.obj")).robots["r"].geometry["a"]
    assert element.shape.solid and len(element.shape.faces) == 20
    # two solids apart: their union
    write_obj(tmp_path / "two.obj", (vertices, faces), (vertices + np.array([5, 0, 0]), faces))
    (element,) = load(urdf(tmp_path, "two.obj")).robots["r"].geometry["a"]
    assert element.shape.solid and element.shape.report.shells == 2
    # a hollow: the inner one runs the other way round
    write_obj(tmp_path / "hollow.obj", (vertices * 9 - np.array([1, 1, 4]), faces), (vertices, faces[:, ::-1]))
    (element,) = load(urdf(tmp_path, "hollow.obj")).robots["r"].geometry["a"]
    assert element.shape.solid and not collide(element.shape, Box((0.1, 0.1, 0.1)), np.eye(4), pose((0.25, 1, 0.5)))
    # a solid and a patch stay apart: together they have no inside
    write_obj(tmp_path / "mixed.obj", (vertices, faces), (vertices + np.array([5, 0, 0]), faces[1:]))
    shapes = [element.shape for element in load(urdf(tmp_path, "mixed.obj")).robots["r"].geometry["a"]]
    assert [shape.solid for shape in shapes] == [True, False]
    # files given by themselves: a body each
    assert len(load(tmp_path / "two.obj").bodies) == 2


def test_the_scene_file_chooses(tmp_path):
    write_obj(tmp_path / "l.obj", l_solid())
    scene = {
        "collide": 1,
        "bodies": [
            {"name": "mesh", "shape": {"mesh": {"file": "l.obj"}}},
            {"name": "hull", "shape": {"mesh": {"file": "l.obj", "as": "hull"}}},
            {"name": "small", "shape": {"mesh": {"file": "l.obj", "scale": 0.5, "as": "mesh"}}},
        ],
    }
    (tmp_path / "s.json").write_text(json.dumps(scene))
    assert [type(b.shape).__name__ for b in load(tmp_path / "s.json").bodies] == ["Mesh", "ConvexHull", "Mesh"]
    kinds = [type(b.shape).__name__ for b in load(tmp_path / "s.json", meshes="hull").bodies]
    assert kinds == ["ConvexHull", "ConvexHull", "Mesh"], "what a shape says itself counts"
    scene["bodies"][1]["shape"]["mesh"]["as"] = "hulls"
    (tmp_path / "s.json").write_text(json.dumps(scene))
    with pytest.raises(
        Exception, match=r'mesh\.as: must be "mesh", .*"hull:64", .* or "pieces", got .hulls. \(did you mean .hull.\?\)'
    ):
        load(tmp_path / "s.json")


def small_box(lid: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """A box of a tenth beside the L, with or without its two facets at z = 0.1."""
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    vertices, faces = box.vertices + np.array([1.5, 1.5, 0.05]), np.asarray(box.faces)
    return vertices, faces if lid else faces[(vertices[faces][:, :, 2] < 0.09).any(axis=1)]


def test_broken_meshes_are_repaired_on_request_and_told(tmp_path, capsys):
    """By part, and once more as the whole link: a hole that is wide for a part may be small for the link."""
    vertices, faces = l_solid()
    faces[3] = faces[3, ::-1]
    write_obj(tmp_path / "l.obj", (vertices, faces), small_box(lid=False))
    file = str(urdf(tmp_path, "l.obj"))
    (body,) = load(file).bodies
    assert not any(part.solid for part in getattr(body.shape, "items", [body.shape]) if isinstance(part, Mesh))
    assert body.approximation is None
    (body,) = load(file, meshes="repaired").bodies
    assert body.shape.solid and body.shape.volume == pytest.approx(1.751)
    assert body.approximation.startswith("repaired: part0: turned over: facet 3; closed 1 hole, ")
    assert load(file, meshes="repaired").bodies[0].approximation == body.approximation, "from the cache"
    assert main(["report", file, "--repair", "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [entry["what"] for entry in told["approximations"]] == [body.approximation]
    assert [entry["solid"] for entry in told["meshes"]] == [True]
    main(["report", file, "--repair"])
    assert "repaired: part0: turned over: facet 3" in " ".join(capsys.readouterr().out.split())
    assert main(["check", file, "--repair", "--meshes", "hull"]) == 2
    assert "not allowed with argument" in capsys.readouterr().err


def test_meshes_beyond_repair_say_why(tmp_path):
    write_obj(tmp_path / "open.obj", small_box(lid=False))
    (body,) = load(tmp_path / "open.obj", meshes="repaired").bodies
    assert not body.shape.solid
    assert body.approximation.startswith("not repaired: open edges: a hole of 4 edges, 81.6 % of the size long")
    write_obj(tmp_path / "whole.obj", small_box(), l_solid())
    assert [body.approximation for body in load(tmp_path / "whole.obj", meshes="repaired").bodies] == [None, None]


def test_shapes_of_scene_files_say_that_they_are_repaired(tmp_path):
    vertices, faces = l_solid()
    faces[3] = faces[3, ::-1]
    write_obj(tmp_path / "l.obj", (vertices, faces))
    inline = {"vertices": vertices.tolist(), "faces": faces.tolist()}
    scene = {
        "collide": 1,
        "bodies": [
            {"name": "file", "shape": {"mesh": {"file": "l.obj", "as": "repaired", "scale": 0.5}}},
            {"name": "as it is", "shape": {"mesh": {"file": "l.obj"}}},
            {"name": "inline", "shape": {"mesh": inline}},
        ],
    }
    (tmp_path / "s.json").write_text(json.dumps(scene))
    assert [body.shape.solid for body in load(tmp_path / "s.json").bodies] == [True, False, False]


def test_planning_scenes_hold_meshes_themselves(tmp_path):
    pytest.importorskip("yaml")
    vertices, faces = l_solid()
    (tmp_path / "robots/r").mkdir(parents=True)
    (tmp_path / "robots/r/r.urdf").write_text('<robot name="r"><link name="a"/></robot>')

    def scene(triangles, **options):
        thing = {"id": "thing", "meshes": [{"vertices": vertices.tolist(), "triangles": triangles}]}
        file = tmp_path / "scene.yaml"
        file.write_text(json.dumps({"robot_model_name": "r", "world": {"collision_objects": [thing]}}))
        return load(file, **options).body("thing")

    for triangles in (faces.tolist(), [{"vertex_indices": f} for f in faces.tolist()]):
        assert scene(triangles).shape.solid and scene(triangles).approximation is None
        hull = scene(triangles, meshes="hull")
        assert isinstance(hull.shape, ConvexHull) and hull.approximation == "hull of 12 vertices of a mesh in the file"
    assert isinstance(scene([]).shape, ConvexHull)
    for bad, message in (
        ([[0, 1, 12]], r"triangle 0 names vertices \[0, 1, 12\], but there are 12"),
        ([[0, 1, 0.5]], "must be whole numbers"),
        ([[0, 1]], "must be N × 3 numbers"),
    ):
        with pytest.raises(Exception, match=message):
            scene(bad)


# --- meshes that are their own hulls ----------------------------------------------------------------


def supports_all(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """The same in Fractions, by the definition: no vertex beyond any facet."""
    points = [[Fraction(x) for x in p] for p in vertices.tolist()]
    for a, b, c in faces.tolist():
        u, v = ([y - x for x, y in zip(points[a], points[k])] for k in (b, c))
        n = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        if any(sum(x * (y - z) for x, y, z in zip(n, p, points[a])) > 0 for p in points):
            return False
    return True


def test_exactly_convex_meshes_are_hulls(tmp_path):
    box = trimesh.creation.box((1, 2, 3))
    box.export(tmp_path / "box.stl")
    assert load(tmp_path / "box.stl").bodies[0].shape == ConvexHull(load(tmp_path / "box.stl").bodies[0].shape.points)
    inside_out = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
    inside_out.export(tmp_path / "out.stl")
    assert not load(tmp_path / "out.stl").bodies[0].shape.solid
    vertices = box.vertices.copy()
    vertices[0] *= 1 + 2.0**-52  # three sides are bent by an ulp: the facets say which way
    write_obj(tmp_path / "bent.obj", (vertices, box.faces))
    bent = load(tmp_path / "bent.obj").bodies[0].shape
    assert isinstance(bent, ConvexHull) == supports_all(vertices, box.faces)
    vertices[0] = box.vertices[0] * (1 - 2.0**-52)
    write_obj(tmp_path / "dented.obj", (vertices, box.faces))
    assert isinstance(load(tmp_path / "dented.obj").bodies[0].shape, ConvexHull) == supports_all(vertices, box.faces)


@pytest.mark.slow
def test_own_hulls_against_fractions():
    """Hulls whose vertices are moved by a few ulps, boxes cut into facets that are coplanar, and scaled ones."""
    rng = np.random.default_rng(0)
    found = []
    for k in range(120):
        if k % 3 == 0:
            solid = trimesh.creation.box(rng.uniform(0.1, 3, 3)).subdivide()
        elif k % 3 == 1:
            solid = trimesh.convex.convex_hull(np.round(rng.normal(size=(20, 3)), 1))
        else:
            solid = trimesh.creation.icosphere(1)
        vertices, faces = np.array(solid.vertices), np.array(solid.faces)
        if k % 2:
            moved = rng.integers(len(vertices))
            vertices[moved] *= 1 + rng.choice([-1, 1]) * 2.0 ** -rng.integers(30, 53)
        vertices = vertices * [1.0, 1e-3, 0.3, 1e-40][k % 4]
        says = is_own_hull(vertices, faces)
        assert says == supports_all(vertices, faces), (
            f"case {k}: vertices = {vertices.tolist()}, faces = {faces.tolist()}"
        )
        found.append(says)
    assert 20 <= sum(found) <= 100, sum(found)


# --- reports ----------------------------------------------------------------------------------------


def scene_of(*bodies: tuple[str, object, np.ndarray]) -> Scene:
    return Scene("s", [SceneBody(name, shape, X) for name, shape, X in bodies])


def test_deep_touching_and_near_meshes_are_told_apart():
    vertices, faces = l_solid()
    L = Mesh(vertices, faces)
    scene = scene_of(
        ("a", L, np.eye(4)),
        ("deep", L, pose((0.25, 0.0, 0.25))),
        ("on top", L, pose((0, 0, -1))),
        ("near", L, pose((0, 2.01, 0))),
    )
    r = report.make(scene, clearance=0.05)
    assert ("a", "deep") in [(p.a, p.b) for p in r.colliding]
    assert ("a", "on top") in [(p.a, p.b) for p in r.touching]
    assert ("a", "near") in [(p.a, p.b) for p in r.near]
    deep = next(p for p in r.colliding if (p.a, p.b) == ("a", "deep"))
    assert deep.upper == 0.0 and 0 < deep.depth <= 0.75 and not deep.certified
    text = "\n".join("".join(t for t, _ in line) for line in terminal.render(r, width=140))
    assert f"≤ {deep.depth * 1e3:.3f} mm" in text and "a shorter one may do" in text
    assert "4 as they are, triangle by triangle; all are solid" in text
    everything = "\n".join("".join(t for t, _ in line) for line in terminal.render(r, everything=True, width=140))
    assert "MESHES  as they are" in everything and "solid of 20 facets" in everything


def test_pairs_that_cannot_be_answered_are_listed_and_the_rest_is_answered(tmp_path, monkeypatch):
    from collide.errors import UnsupportedQuery
    from collide.narrowphase.facets import mesh_batches

    def refuse(A, B, *rest, **options):
        if isinstance(B, Cylinder) or isinstance(A, Cylinder):
            raise UnsupportedQuery("Cylinder against Mesh: not today")
        return honest(A, B, *rest, **options)

    honest = mesh_batches.pair_rows
    monkeypatch.setattr(mesh_batches, "pair_rows", refuse)
    L = Mesh(*l_solid())
    # The cylinder stands in the notch: hulls meet. The far one is answered by the hulls.
    scene = scene_of(
        ("a", L, np.eye(4)),
        ("can", Cylinder(0.2, 0.5), pose((1, 1, 0.5))),
        ("far", Cylinder(0.2, 0.5), pose((9, 9, 0.5))),
        ("b", Box((1, 1, 1)), pose((1, 0.9, 0.5))),
    )
    r = report.make(scene, clearance=0.01)
    assert [(u["a"], u["b"]) for u in r.unanswered] == [("a", "can")]
    assert ("a", "b") in [(p.a, p.b) for p in r.colliding]
    assert "1 pair NOT ANSWERED" in r.verdict()
    assert {"reason": "cannot be answered", "pairs": 1} == {k: r.skipped[0][k] for k in ("reason", "pairs")}
    text = "\n".join("".join(t for t, _ in line) for line in terminal.render(r, width=140))
    assert "NOT ANSWERED  near each other" in text and "not today" in text
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(Path(report.__file__).with_name("schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(json.loads(json.dumps(r.to_dict(), allow_nan=False)), schema)
    # A free scene with such a pair is not free.
    write_obj(tmp_path / "l.obj", l_solid())
    document = {
        "collide": 1,
        "bodies": [
            {"name": "a", "shape": {"mesh": {"file": "l.obj"}}},
            {"name": "can", "shape": {"cylinder": {"radius": 0.2, "length": 0.5}}, "pose": {"xyz": [1.2, 1.2, 0.5]}},
        ],
    }
    (tmp_path / "s.json").write_text(json.dumps(document))
    assert main(["check", str(tmp_path / "s.json"), "--quiet"]) == 2


def test_hulls_answer_for_meshes_far_apart_and_never_wrongly():
    """World.distances with a limit, where hulls are asked first, against distance() without them."""
    rng = np.random.default_rng(3)
    L = Mesh(*l_solid())
    others = [L, L.scaled(0.5), Box((0.4, 0.4, 0.4)), ConvexHull(rng.normal(size=(12, 3)) * 0.3, radius=0.05)]
    counts = [0, 0, 0]
    for k in range(60):
        other, X = others[k % 4], pose(rng.uniform(-2.5, 2.5, 3), rpy=rng.uniform(-3, 3, 3))
        world = World()
        world.add(L, name="a")
        world.add(other, X, name="b")
        limit = float(rng.uniform(0, 0.5))
        rows, truth = world.distances(max_distance=limit).rows, distance(L, other, np.eye(4), X)
        wanted = bool(truth.hit) or truth.distance <= limit
        assert len(rows) == wanted, f"case {k}: {truth}"
        if wanted:
            assert rows["distance"][0] == truth.distance and rows["lower"][0] == truth.lower
        counts[0 if truth.hit else 1 if wanted else 2] += 1
        seen = world.query(other, X, max_distance=limit).rows
        assert len(seen) == 1 + wanted
    assert min(counts) >= 6, counts


def test_a_links_hull_and_meshes_in_compounds_are_found():
    from collide.reports.mesh_notes import is_meshed, meshes_of

    L = Mesh(*l_solid())
    both = Compound(
        [(L, np.eye(4)), (Compound([(L.scaled(2.0), np.eye(4)), (Box((1, 1, 1)), np.eye(4))]), pose((1, 0, 0)))]
    )
    assert list(meshes_of(both)) == [L, L.scaled(2.0)] and is_meshed(both) and not is_meshed(Box((1, 1, 1)))
    assert np.array_equal(np.sort(L.convex_hull.points, axis=0), np.sort(L.vertices, axis=0))


def test_check_says_what_has_no_inside_and_what_stands_in(tmp_path, capsys):
    """What lies inside a mesh whose facets are turned over is free of it: whoever reads "free" has to know."""
    vertices, faces = l_solid()
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in vertices.tolist())
    (tmp_path / "out.obj").write_text(text + "".join(f"f {a + 1} {c + 1} {b + 1}\n" for a, b, c in faces.tolist()))
    bodies = [
        {"name": "mesh", "shape": {"mesh": {"file": "out.obj"}}},
        {"name": "ball", "shape": {"sphere": {"radius": 1e-3}}, "pose": {"xyz": [99, 0, 0]}},
    ]
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "bodies": bodies}))
    assert main(["check", str(tmp_path / "s.json")]) == 0
    assert "collide: surfaces without an inside: mesh (see: collide report)\n" in capsys.readouterr().err
    assert main(["check", str(tmp_path / "s.json"), "--meshes", "hull"]) == 0
    err = capsys.readouterr().err
    assert "surfaces" not in err and "collide: not the shape the scene names: mesh (see: collide report)\n" in err
