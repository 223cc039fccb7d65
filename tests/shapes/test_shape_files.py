"""Shapes in files and pickles: they come back as they were, and nothing in them is believed that proofs rest on.

Every stored array is forged in every way below, with a right digest: what comes out is refused as no shape, or is the
shape
that its constructor makes of the same numbers, bit by bit. Arrays that older files carried besides change nothing.
"""

from __future__ import annotations

import copy
import io
import pickle
import struct
import tracemalloc
import zipfile
from functools import cache

import numpy as np
import pytest
import surfaces

import collide
from collide import ConvexHull, InvalidShape, Mesh
from collide.lowering.lazy_structures import support_tree_of
from collide.lowering.parts import convex_set_of
from collide.shapes.shape_files import _digest

EYE = np.eye(4)


def ball(seed: int, n: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


SHAPES = ("mesh", "scaled mesh", "open mesh", "hull", "rounded hull", "hull with faces", "cloud", "cloud of radii")


@cache
def shapes() -> dict:
    hull = ConvexHull(ball(1, 300))
    return {
        "mesh": Mesh(*surfaces.torus()),
        "scaled mesh": Mesh(*surfaces.torus()).scaled(1.5),
        "open mesh": Mesh(surfaces.ball()[0], surfaces.ball()[1][:-3]),
        "hull": hull,
        "rounded hull": ConvexHull(ball(2, 300), radius=0.1),
        "hull with faces": ConvexHull(ball(3, 40), faces=ConvexHull(ball(3, 40)).hull.facets),
        "cloud": collide.PointCloud(ball(6, 60), 0.125),
        "cloud of radii": collide.PointCloud(ball(6, 60), np.linspace(0.0, 0.25, 60)),
    }


def poses(n: int = 12) -> np.ndarray:
    rng = np.random.default_rng(5)
    return np.array([collide.pose(rng.uniform(-1.2, 1.2, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])


def answers(shape) -> list[bytes]:
    probe = ConvexHull(ball(4, 60) * 0.4)
    r = collide.distance(shape, probe, EYE, poses())
    return [r[name].tobytes() if name == "rows" else getattr(r, name).tobytes() for name in (
        "hit", "distance", "lower", "upper", "normal", "point_a", "point_b")]


def stored(shape, tmp_path) -> dict[str, np.ndarray]:
    shape.save(tmp_path / "right.npz")
    with np.load(tmp_path / "right.npz") as found:
        return {name: found[name] for name in found.files if name != "digest"}


def write(path, arrays: dict) -> None:
    """As the library does, digest included."""
    told = {name: array for name, array in arrays.items() if name != "format"}
    np.savez(path, **arrays, digest=_digest(told))


def forged(array: np.ndarray) -> dict[str, np.ndarray]:
    """Everything that is done to an array."""
    rng = np.random.default_rng(7)
    found = {
        "zero": np.zeros_like(array), "one more axis": array[None], "as text": array.astype(str),
        "as complex": array.astype(complex), "as float32": array.astype(np.float32), "as int16": array.astype(np.int16),
        "flat and longer": np.concatenate([array.ravel(), array.ravel()]),
    }
    for value in (np.nan, np.inf, -1, 1e300, 2**20):
        changed = array.copy()
        with np.errstate(all="ignore"):
            changed.flat[len(changed.flat) // 2] = np.asarray(value).astype(array.dtype)
        found[f"one {value}"] = changed
    if array.ndim:
        found["shuffled"] = rng.permuted(array, axis=0)
        found["rows shuffled"] = rng.permutation(array)
        found["truncated"] = array[:-1]
        found["empty"] = array[:0]
        nudged = array.copy()
        nudged[0] = nudged[-1]
        found["one row twice"] = nudged
    return found


@pytest.mark.parametrize("kind", SHAPES)
def test_files_and_pickles_bring_shapes_back(kind, tmp_path):
    shape = shapes()[kind]
    expected = answers(shape)
    shape.save(tmp_path / "file.npz")
    for other in (
        type(shape).load(tmp_path / "file.npz"),
        type(shape).load(str(tmp_path / "file.npz")),
        pickle.loads(pickle.dumps(shape)),
    ):
        assert other == shape and answers(other) == expected
        assert getattr(other, "scale", 1.0) == getattr(shape, "scale", 1.0)
    assert copy.copy(shape) is shape and copy.deepcopy([shape])[0] is shape


@pytest.mark.many(3)
@pytest.mark.parametrize("kind", SHAPES)
def test_forged_arrays_are_refused_or_are_another_shape(kind, tmp_path):
    """Another shape is what its constructor makes of the numbers: the file adds nothing to it."""
    shape = shapes()[kind]
    arrays = stored(shape, tmp_path)
    refused, taken = [], []
    for name, array in arrays.items():
        for how, damage in forged(array).items():
            path = tmp_path / "forged.npz"
            write(path, {**arrays, name: damage})
            try:
                found = type(shape).load(path)
            except InvalidShape as error:
                assert type(shape).__name__ in str(error)
                refused.append((name, how))
                continue
            taken.append((name, how))
            if isinstance(found, Mesh):
                fresh = Mesh(found.base.vertices, found.base.faces, solid=found.solid).scaled(found.scale)
            elif isinstance(found, collide.PointCloud):
                fresh = collide.PointCloud(found.points, found.radius)
            else:
                fresh = ConvexHull(found.points, faces=found.faces, radius=found.radius)
            assert found == fresh and answers(found) == answers(fresh), (name, how)
    assert len(refused) > 2 * len(arrays) and len(taken) > len(arrays) // 2, (refused, taken)


def old_arrays(shape) -> dict[str, np.ndarray]:
    """What files carried before, under their names then."""
    collide.collide(shape, shape, EYE, EYE)
    if isinstance(shape, Mesh):
        tree = shape.base.tree
        stamp = np.array([1, tree.exponent, tree.depth], dtype=np.int64)
        return {"mesh_tree": stamp, "mesh_nodes": tree.nodes, "mesh_order": tree.ids, "mesh_centre": tree.centre}
    tree = support_tree_of(convex_set_of(shape)).tree
    names = ("nodes", "owners", "entries", "ring_starts", "ring", "list_coordinates")
    return {
        "tree_support_tree": np.array([1, tree.flat, tree.depth]),
        **{f"tree_{name}": getattr(tree, name) for name in names},
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mesh", "scaled mesh", "hull", "rounded hull"])
def test_trees_of_older_files_are_not_believed(kind, tmp_path):
    shape = shapes()[kind]
    expected, arrays = answers(shape), stored(shape, tmp_path)
    old = old_arrays(shape)
    same = 0
    for name, array in [("", np.zeros(0)), *old.items()]:
        for how, damage in forged(array).items() if name else [("as it was", array)]:
            path = tmp_path / "forged.npz"
            write(path, {**arrays, **old, **({name: damage} if name else {})})
            try:
                assert answers(type(shape).load(path)) == expected, (name, how)
                same += 1
            except InvalidShape:
                assert name, "a file of before must be read"
    assert same > 5 * len(old)


def test_a_solid_must_be_one(tmp_path):
    open_mesh = shapes()["open mesh"]
    write(tmp_path / "lie.npz", {**stored(open_mesh, tmp_path), "solid": np.array(True)})
    with pytest.raises(InvalidShape, match="no inside can be told: open edges"):
        Mesh.load(tmp_path / "lie.npz")
    function, (cls, (vertices, faces, _, scale)) = open_mesh.__reduce__()
    with pytest.raises(InvalidShape, match="no inside can be told"):
        function(cls, (vertices, faces, True, scale))
    unseen = Mesh._known(vertices, faces, True)  # as prepared input of a scene may say: seen when first asked
    with pytest.raises(InvalidShape, match="no inside can be told"):
        collide.collide(unseen, collide.Sphere(1), EYE, EYE)


# --- files that are no files of ours --------------------------------------------------------------


def members(path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as found:
        return {name: found.read(name) for name in found.namelist()}


def zipped(path, files: dict[str, bytes], **options) -> None:
    with zipfile.ZipFile(path, "w", **options) as out:
        for name, blob in files.items():
            out.writestr(name, blob)


def header(blob: bytes, old: str, new: str) -> bytes:
    """The member with a changed header of the same length."""
    end = 10 + struct.unpack("<H", blob[8:10])[0]
    text = blob[10:end].decode().replace(old, new)
    return blob[:10] + text.rstrip().ljust(end - 11).encode() + b"\n" + blob[end:]


def with_patch(path, magic: bytes, offset: int, value: int) -> None:
    """Change a 16-bit word of the first zip record of a kind."""
    blob = bytearray(path.read_bytes())
    place = blob.index(magic) + offset
    blob[place : place + 2] = struct.pack("<H", value)
    path.write_bytes(bytes(blob))


def damages(path):
    files = members(path)
    points = "points.npy" if "points.npy" in files else "vertices.npy"

    def rewritten(**options):
        return lambda: zipped(path, files, **options)

    def changed(name: str, blob: bytes):
        return lambda: zipped(path, {**files, name: blob})

    shape = f"({np.load(io.BytesIO(files[points])).shape[0]}, 3)"
    return {
        "compressed": (rewritten(compression=zipfile.ZIP_DEFLATED), "another format"),
        "a huge array": (changed(points, header(files[points], shape, "(10000000000000, 3)")), "another length"),
        "a negative array": (changed(points, header(files[points], shape, "(-1, 3)")), "another length"),
        "objects": (changed(points, header(files[points], "'<f8'", "'|O'")), "another format"),
        "a header that is no header": (changed(points, header(files[points], "descr", "rcsed")), "no file that"),
        "a header of code": (changed(points, header(files[points], shape, "print()")), "no file that"),
        "cut short": (changed(points, files[points][:-8]), "another length"),
        "only magic": (changed(points, b"\x93NUMPY\x01\x00"), "no file that"),
        "nothing in it": (changed(points, b""), "no file that"),
        "an array besides": (changed("extra.npy", files[points]), "another format"),
        "an array less": (lambda: zipped(path, {k: v for k, v in files.items() if k != points}), "another format"),
        "a newer array format": (changed(points, files[points][:6] + b"\x03" + files[points][7:]), "another format"),
        "encrypted": (
            lambda: [with_patch(path, b"PK\x01\x02", 8, 1), with_patch(path, b"PK\x03\x04", 6, 1)], "another format",
        ),
        "compression 99": (
            lambda: [with_patch(path, b"PK\x01\x02", 10, 99), with_patch(path, b"PK\x03\x04", 8, 99)], "another format",
        ),
        "empty": (lambda: path.write_bytes(b""), r"scenes\.load"),
        "another kind": (lambda: path.write_bytes(b"solid ascii stl\nendsolid\n"), r"scenes\.load"),
        "half a file": (lambda: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]), "no file that"),
        "another version": (changed("format.npy", header_of(np.array(99))), "another format"),
    }


def header_of(array) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


KINDS = sorted(["compressed", "a huge array", "a negative array", "objects", "a header that is no header",
    "a header of code", "cut short", "only magic", "nothing in it", "an array besides", "an array less",
    "a newer array format", "encrypted", "compression 99", "empty", "another kind", "half a file",
    "another version"])


@pytest.mark.parametrize("kind", ["mesh", "hull"])
@pytest.mark.parametrize("damage", KINDS)
def test_damaged_files_are_refused_by_name(kind, damage, tmp_path):
    shape = shapes()[kind]
    path = tmp_path / "damaged.npz"
    shape.save(path)
    found = damages(path)
    assert sorted(found) == KINDS
    do, words = found[damage]
    do()
    with pytest.raises(InvalidShape, match=rf"{type(shape).__name__}\.load: .*damaged\.npz.*{words}"):
        type(shape).load(path)


def test_any_flipped_byte_is_refused_or_harmless(tmp_path):
    shape = ConvexHull(ball(9, 30), radius=0.25)
    path = tmp_path / "flipped.npz"
    shape.save(path)
    blob, rng, refused = path.read_bytes(), np.random.default_rng(11), 0
    for place in rng.integers(len(blob), size=300).tolist():
        spoilt = bytearray(blob)
        spoilt[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(spoilt))
        try:
            assert ConvexHull.load(path) == shape
        except InvalidShape:
            refused += 1
    assert refused > 200


def test_a_small_file_asks_for_little_memory(tmp_path):
    """A member of zeros, packed a thousand times smaller: refused by its header."""
    path = tmp_path / "bomb.npz"
    np.savez_compressed(
        path, points=np.zeros((2_000_000, 3)), radius=np.array(0.0), format=np.array(1), digest=np.zeros(16, np.uint8)
    )
    assert path.stat().st_size < 100_000
    tracemalloc.start()
    for kind in (ConvexHull, Mesh):
        with pytest.raises(InvalidShape, match="another format"):
            kind.load(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2_000_000, peak


@pytest.mark.parametrize("path", ["a\0b", 7, None, b"\xff\0", ["x"], 10**5000], ids=range(6))
def test_paths_that_are_none(path):
    for call in (ConvexHull(np.eye(3)).save, Mesh(*surfaces.box()).save, ConvexHull.load, Mesh.load):
        with pytest.raises(InvalidShape, match=r"(ConvexHull|Mesh)\.(save|load)"):
            call(path)


def test_places_that_are_no_files(tmp_path):
    import os

    mesh = Mesh(*surfaces.box())
    with pytest.raises(InvalidShape, match=r"Mesh\.save"):
        mesh.save(tmp_path / "no" / "folder.npz")
    with pytest.raises(InvalidShape, match=r"Mesh\.load: .*No such file"):
        Mesh.load(tmp_path / "absent.npz")
    places = [tmp_path]
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.npz")
        places.append(tmp_path / "pipe.npz")  # opening it would wait for ever
    for place in places:
        with pytest.raises(InvalidShape, match=r"Mesh\.load: .*no regular file"):
            Mesh.load(place)
    with pytest.raises(InvalidShape, match="another format"):
        ConvexHull(np.eye(3)).save(tmp_path / "hull.npz")
        Mesh.load(tmp_path / "hull.npz")
