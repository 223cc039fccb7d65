"""Clouds in files and messages: every format beside a writer of the test, and bytes that are cut, changed or false."""

from __future__ import annotations

import array
import base64
import gzip
import struct
import sys
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import collide
from collide import InvalidShape, MissingExtra, PointCloud, SceneError
from collide.fields.lzf_kernel import unpack_lzf
from collide.scenes.loaders import cloud_file

#: 814 bytes, b"abcabcabcabcabc" * 30 + bytes(300) + bytes(range(64)), as liblzf 3.6 packs them.
OF_LIBLZF = (
    "A2FiY2Hg/wLhrQcAAOD/AOAbAB8BAgMEBQYHCAkKCwwNDg8QERITFBUWFxgZGhscHR4fIB4hIiMkJSYnKCkqKywtLi8wMTIzNDU2Nzg5Ojs8PT4/"
)
PATH = Path("cloud.file")


def points_of(seed: int, n: int = 40) -> np.ndarray:
    """Coordinates that floats of 32 bits, hundredths in text and bytes hold alike."""
    return np.random.default_rng(seed).integers(-100, 101, (n, 3)).astype(np.float64)


# --- writers of the test ------------------------------------------------------------------------


def packed(raw: bytes) -> bytes:
    """LZF by the longest earlier copy of at most 264 bytes, found by search; short matches stand as they are."""
    out, run, i = bytearray(), bytearray(), 0

    def flush():
        for begin in range(0, len(run), 32):
            piece = run[begin : begin + 32]
            out.extend([len(piece) - 1, *piece])
        run.clear()

    while i < len(raw):
        size = min(264, len(raw) - i)
        at = -1
        while size >= 3 and at < 0:
            at = raw.find(raw[i : i + size], max(0, i - 8192), i + size - 1)
            size = size if at >= 0 else size // 2
        if at < 0:
            run.append(raw[i])
            i += 1
            continue
        flush()
        back, count = i - at - 1, size - 2
        out.extend([min(count, 7) << 5 | back >> 8, *([count - 7] if count >= 7 else []), back & 255])
        i += size
    flush()
    return bytes(out)


def pcd(points, data: str, kinds: str = "F4 F4 F4", names: str = "x y z", counts: str = "", header: str = "") -> bytes:
    """A PCD whose fields besides x, y and z hold the row's number."""
    fields, types = names.split(), kinds.split()
    repeats = [int(word) for word in counts.split()] or [1] * len(fields)
    columns = []
    for name, kind, repeat in zip(fields, types, repeats):
        column = points[:, "xyz".index(name)] if name in "xyz" else np.arange(len(points)) % 100
        columns.append(np.repeat(column[:, None], repeat, axis=1).astype(f"<{kind.lower()}"))
    text = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {names}\nSIZE {' '.join(kind[1] for kind in types)}\n"
        f"TYPE {' '.join(kind[0] for kind in types)}\n" + (f"COUNT {counts}\n" if counts else "") + (
            header or f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS {len(points)}\n"
        ) + f"DATA {data}\n"
    ).encode()
    if data == "ascii":
        return text + b"".join(
            " ".join(str(v) for column in columns for v in column[row].tolist()).encode() + b"\n"
            for row in range(len(points))
        )
    if data == "binary":
        return text + b"".join(b"".join(column[row].tobytes() for column in columns) for row in range(len(points)))
    raw = b"".join(column.tobytes() for column in columns)
    small = packed(raw)
    return text + struct.pack("<II", len(small), len(raw)) + small


def read(content: bytes, name: str, tmp_path, **options) -> PointCloud:
    (tmp_path / name).write_bytes(content)
    return PointCloud.from_file(tmp_path / name, **options)


# --- formats ------------------------------------------------------------------------------------


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize(
    ("kinds", "names", "counts"),
    [
        ("F4 F4 F4", "x y z", ""), ("F8 F8 F8", "z y x", "1 1 1"), ("I1 I2 I4", "x y z", ""),
        ("F4 F4 U4 F4 F4", "x y rgb z intensity", ""), ("U2 F4 F4 I8 F8", "label x y z stamp", ""),
        ("F4 F4 F4 F4 U1", "x y z descriptor _", "1 1 1 33 5"),
    ],
)
def test_pcd_of_every_kind(data, kinds, names, counts, tmp_path):
    points = points_of(1)
    cloud = read(pcd(points, data, kinds, names, counts), "a.pcd", tmp_path, radius=0.1)
    assert np.array_equal(cloud.points, points) and cloud.radius == 0.1 and cloud.dropped == 0


def test_text_of_32_bits_in_a_pcd_is_rounded_as_its_header_says(tmp_path):
    content = pcd(points_of(1, 1), "ascii").rpartition(b"ascii\n")[0] + b"ascii\n0.1 0.2 1e60\n"
    with pytest.raises(InvalidShape, match=r"a.pcd: PointCloud: points\[0, 2\] is inf"):
        read(content, "a.pcd", tmp_path)
    points = read(content.replace(b"1e60", b"0.3"), "a.pcd", tmp_path).points
    assert points.tolist() == [np.array([0.1, 0.2, 0.3], dtype=np.float32).astype(float).tolist()]


def test_lzf_as_its_library_packs_it():
    raw = b"abcabcabcabcabc" * 30 + bytes(300) + bytes(range(64))
    content = np.frombuffer(base64.b64decode(OF_LIBLZF), dtype=np.uint8)
    assert unpack_lzf(content, len(raw)).tobytes() == raw
    assert all(unpack_lzf(content, size) is None for size in (0, len(raw) - 1, len(raw) + 1, 2**40))
    assert all(unpack_lzf(content[:cut], len(raw)) is None for cut in range(len(content)))
    rng = np.random.default_rng(2)
    for n in (1, 2, 31, 32, 33, 263, 264, 265, 9000):
        raw = rng.integers(0, 3, n, dtype=np.uint8).tobytes()
        assert unpack_lzf(np.frombuffer(packed(raw), dtype=np.uint8), n).tobytes() == raw, n


@pytest.mark.parametrize("suffix", [".npz", "", ".pcd", ".ply", ".xyz"])
@pytest.mark.parametrize("each", [False, True])
def test_saved_clouds_come_back_with_the_same_doubles(suffix, each, tmp_path):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(5000, 3)) * 10.0 ** rng.integers(-20, 9, (5000, 1))
    cloud = PointCloud(points, rng.uniform(0, 1, 5000) if each else 0.25)
    path = tmp_path / f"cloud{suffix}"
    cloud.save(path)
    if suffix in ("", ".npz"):
        assert PointCloud.load(path) == cloud
        if suffix:
            assert PointCloud.from_file(str(path)) == cloud and PointCloud.from_file(path, 0.5).radius == 0.5
        return
    again = PointCloud.from_file(path, cloud.radius)
    assert again == cloud and PointCloud.from_file(path).radius == 0.0
    (tmp_path / f"packed{suffix}.gz").write_bytes(gzip.compress(path.read_bytes(), 1))
    assert PointCloud.from_file(tmp_path / f"packed{suffix}.gz", cloud.radius) == cloud


def test_a_single_point_with_a_radius_of_its_own_comes_back(tmp_path):
    for radius in (0.5, [0.5]):
        cloud = PointCloud([(1, 2, 3)], radius)
        cloud.save(tmp_path / "a.npz")
        assert PointCloud.load(tmp_path / "a.npz") == cloud


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xyz", "1 2 3\n4 5 6\n"), ("a.xyz", "# made by hand\n\n  1 2 3 255 0 0\n4\t5 6 # the last\n"),
        ("a.asc", "//X Y Z R G B\n1 2 3 9 9 9\n4 5 6 9 9 9"), ("a.txt", "1;2;3;word\n4;5;6;word\n"),
        ("a.csv", "time,Z,Y,X\n0.5,3,2,1\n0.6,6,5,4\n"), ("a.csv", "x,y,z\r\n1,2,3\r\n4,5,6\r\n"),
        ("a.xyz", "\ufeff1 2 3\n4 5 6\n"), ("a.csv", '"x";"y";"z"\n1;2;3\n4;5;6\n'),
    ],
)
def test_text_of_many_forms(name, text, tmp_path):
    assert read(text.encode(), name, tmp_path).points.tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_vertices_of_a_ply_with_faces_and_holes(form, tmp_path):
    points = points_of(4, 6)
    points[2, 1] = np.nan
    head = (
        f"ply\nformat {form} 1.0\nelement vertex 6\nproperty uchar red\nproperty float x\nproperty double y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        body = "".join(f"7 {x} {y} {z}\n" for x, y, z in points) + "3 0 1 2\n"
        content = head + body.encode()
    else:
        order = "<" if "little" in form else ">"
        content = head + b"".join(struct.pack(f"{order}Bfdf", 7, *p) for p in points.tolist())
        content += struct.pack(f"{order}B3i", 3, 0, 1, 2)
    with pytest.raises(InvalidShape, match=r"points\[2, 1\] is nan"):
        read(content, "a.ply", tmp_path)
    cloud = read(content, "a.ply", tmp_path, drop_invalid=True)
    assert cloud.dropped == 1 and np.array_equal(cloud.points, np.delete(points, 2, axis=0))


@pytest.fixture
def laspy():
    return pytest.importorskip("laspy", reason="reads LAS and LAZ: pip install 'collide-robotics[clouds]'")


def las(laspy, path: Path, n: int = 200, point_format: int = 3) -> np.ndarray:
    header = laspy.LasHeader(point_format=point_format, version="1.2" if point_format < 6 else "1.4")
    header.offsets, header.scales = np.array([500_000.0, 5_000_000.0, 100.0]), np.array([0.001, 0.001, 0.01])
    data = laspy.LasData(header)
    data.X, data.Y, data.Z = (np.random.default_rng(5).integers(-(10**6), 10**6, (3, n))).astype(np.int32)
    data.write(path)
    whole = np.stack([np.asarray(axis) for axis in (data.X, data.Y, data.Z)], axis=1)
    return whole * header.scales + header.offsets


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("point_format", [3, 7])
def test_las_and_laz(laspy, suffix, point_format, tmp_path):
    points = las(laspy, tmp_path / f"a{suffix}", point_format=point_format)
    assert np.array_equal(PointCloud.from_file(tmp_path / f"a{suffix}").points, points)
    content = (tmp_path / f"a{suffix}").read_bytes()
    for cut in (100, len(content) // 2, len(content) - 60):
        with pytest.raises(SceneError, match=r"a\.la[sz]"):
            read(content[:cut], f"a{suffix}", tmp_path)
    grown = bytearray(content)
    begin, size = (107, 4) if point_format < 6 else (247, 8)  # of the number of points
    grown[begin : begin + size] = (2**31).to_bytes(size, "little")
    with pytest.raises(SceneError, match=r"laspy cannot read it|declares 2147483648 points"):
        read(bytes(grown), f"a{suffix}", tmp_path)


def test_tables_that_ask_for_much_memory_are_refused(laspy, tmp_path):
    """Lazrs would reserve what they say, and end the process."""
    las(laspy, tmp_path / "a.laz", point_format=7)
    content = (tmp_path / "a.laz").read_bytes()
    begin = int.from_bytes(content[96:100], "little")
    table = int.from_bytes(content[begin : begin + 8], "little")
    for place, value, words in (
        (table + 4, 2**32 - 1, "its table has 4294967295 chunks"), (begin, 2**31, "its table of chunks is said to"),
        (begin + 8 + 36 + 4, 2**32 - 1, "a chunk of points ends at byte"), (100, 2**31, "declares 2147483648 records"),
    ):
        changed = bytearray(content)
        changed[place : place + 4] = value.to_bytes(4, "little")
        with pytest.raises(SceneError, match=words):
            read(bytes(changed), "a.laz", tmp_path)
    with pytest.raises(SceneError, match="is no LAS"):
        read(content[:226], "a.laz", tmp_path)


@pytest.mark.parametrize("point_format", [0, 6, 8])
def test_laz_of_several_chunks_with_further_dimensions(laspy, point_format, tmp_path):
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.add_extra_dim(laspy.ExtraBytesParams("height", "f8"))
    data, rng = laspy.LasData(header), np.random.default_rng(6)
    data.X, data.Y, data.Z = rng.integers(-1000, 1000, (3, 50_001)).astype(np.int32)
    data.height = np.arange(50_001.0)
    data.write(tmp_path / "a.laz")
    cloud = PointCloud.from_file(tmp_path / "a.laz")
    assert np.array_equal(cloud.points, np.stack([data.X, data.Y, data.Z], axis=1) * header.scales + header.offsets)


def test_without_laspy_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(MissingExtra, match=r"laspy is needed to read the points of a.laz: .*\[clouds\]"):
        read(b"LASF", "a.laz", tmp_path)


# --- what is wrong ------------------------------------------------------------------------------

GOOD_PCD = pcd(points_of(6, 3), "binary")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.xyz", b"1 2 3\n4 five 6\n", "line 2: must have numbers in columns 1, 2, 3, got '4 five 6'"),
        ("a.xyz", b"# c\n1 2 3\n4 5\n", "line 3: must have numbers"), ("a.xyz", b"# nothing\n", "holds no points"),
        ("a.csv", b"x,y,z\n1,2,3\n1,,3\n", "line 3: must have numbers"), ("a.csv", b"x,y,z\n", "points is empty"),
        ("a.xyz", b"\xff\xfe1 2 3", "is not UTF-8 text"), ("a.xyz", b"2\ncomment\nH 0 0 0\n", "line 1: must have"),
        ("a.pcd", b"", "no line DATA"), ("a.pcd", b"FIELDS x y z\n", "no line DATA"),
        ("a.pcd", GOOD_PCD[:-1], "declares 36 bytes of points, but 35 follow"),
        ("a.pcd", GOOD_PCD + b"\1", "declares 36 bytes of points, but 37 follow"),
        ("a.pcd", GOOD_PCD.replace(b"x y z", b"x y w"), "FIELDS must have x, y and z"),
        ("a.pcd", GOOD_PCD.replace(b"x y z", b"x y z x"), "as many of FIELDS, SIZE, TYPE and COUNT"),
        ("a.pcd", GOOD_PCD.replace(b"F F F", b"F F C"), "field 'z': TYPE must be F of SIZE 4 or 8"),
        ("a.pcd", GOOD_PCD.replace(b"4 4 4", b"4 4 2"), "field 'z': TYPE must be F of SIZE 4 or 8"),
        ("a.pcd", GOOD_PCD.replace(b"POINTS 3", b"POINTS 4"), "declares 3 × 1 points, and 4"),
        ("a.pcd", GOOD_PCD.replace(b"POINTS 3", b"POINTS -3"), "line 9: POINTS must be a number of points"),
        ("a.pcd", GOOD_PCD.replace(b"POINTS 3", b"POINTS many"), "POINTS must be a whole number, got 'many'"),
        ("a.pcd", GOOD_PCD.replace(b"DATA binary", b"DATA zip"), "DATA must be ascii, binary or binary_compressed"),
        ("a.pcd", GOOD_PCD.replace(b"WIDTH 3", b"SIZE 4 4 4"), "two lines 'SIZE'"),
        ("a.pcd", pcd(points_of(6, 3), "ascii") + b"1 2 3\n", "declares 3 points, but 4 follow"),
        ("a.pcd", pcd(points_of(6, 0), "binary"), "holds no points"),
        ("a.pcd", pcd(points_of(6, 3), "binary_compressed")[:-1], "bytes of points, the data"),
        ("a.pcd", GOOD_PCD[:-36].replace(b"DATA binary", b"DATA binary_compressed"), "the data 0 in 0 packed bytes"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "x, y and z"),
        ("a.mesh", b"", "unknown format of points '.mesh'; known are .npz, .pcd"),
    ],
)
def test_errors_name_file_and_place(name, content, message, tmp_path):
    with pytest.raises((SceneError, InvalidShape), match=message) as raised:
        read(content, name, tmp_path)
    assert name in str(raised.value)


def test_files_that_are_not_there_and_suffixes_that_are_not_written(tmp_path):
    with pytest.raises(SceneError, match="no such file"):
        PointCloud.from_file(tmp_path / "absent.pcd")
    with pytest.raises(InvalidShape, match=r"no such file|No such file"):
        PointCloud.from_file(tmp_path / "absent.npz")
    with pytest.raises(InvalidShape, match=r"the suffix must be one of \.npz, \.pcd, \.ply, \.xyz"):
        PointCloud([(0, 0, 0)]).save(tmp_path / "a.las")
    collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1)))[:2]).save(tmp_path / "mesh.npz")
    with pytest.raises(InvalidShape, match=r"PointCloud.load: .*another format"):
        PointCloud.from_file(tmp_path / "mesh.npz")


def test_packed_files_stop_at_the_limit(monkeypatch, tmp_path):
    monkeypatch.setattr(cloud_file, "LARGEST_CLOUD", 2**20)
    with pytest.raises(SceneError, match="unpacks to more than 1 MiB, the most that is read of a cloud"):
        read(gzip.compress(b"1 2 3\n" * 10**6), "a.xyz.gz", tmp_path)
    with pytest.raises(SceneError, match="is larger than 1 MiB, the most that is read of a cloud"):
        read(b"1 2 3\n" * 10**6, "a.xyz", tmp_path)


def samples(laspy_or_none, tmp_path) -> list[tuple[str, bytes]]:
    points = points_of(7, 30)
    PointCloud(points).save(tmp_path / "a.ply")
    some = [(".pcd", pcd(points, data, "F4 U1 F8 F4", "x a y z")) for data in ("ascii", "binary", "binary_compressed")]
    some += [(".ply", (tmp_path / "a.ply").read_bytes()), (".csv", b"x,y,z\n" + b"1,2,3\n" * 20)]
    some += [(".xyz", b"#c\n" + b"1 2 3 4\n" * 20)]
    for suffix, kind in ((".las", 3), (".laz", 3), (".laz", 7)) if laspy_or_none else ():
        las(laspy_or_none, tmp_path / f"b{suffix}", 50, kind)
        some.append((suffix, (tmp_path / f"b{suffix}").read_bytes()))
    return some


def test_mutated_bytes_are_refused_by_name_or_read(tmp_path):
    """Never another exception, nor more memory than a hundred times the file, and a megabyte."""
    try:
        import laspy
    except ImportError:
        laspy = None
    rng = np.random.default_rng(8)
    refused = taken = 0
    for suffix, content in samples(laspy, tmp_path):
        tries = 25 if suffix in (".las", ".laz") else 80
        for k in range(tries):
            mutant = bytearray(content)
            if k % 3 == 0:
                del mutant[int(rng.integers(0, len(mutant))) :]
            for place in rng.integers(0, max(len(mutant), 1), int(rng.integers(0, 4))) if mutant else ():
                mutant[int(place)] = int(rng.choice([0, 255, 48, 57, 10, 32, int(rng.integers(0, 256))]))
            tracemalloc.start()
            try:
                points = cloud_file.READERS[suffix](bytes(mutant), PATH)
                assert points.ndim == 2 and points.shape[1] == 3 and points.dtype == np.float64
                taken += 1
            except SceneError as error:
                assert "cloud.file" in str(error), (suffix, k, error)
                refused += 1
            finally:
                peak = tracemalloc.get_traced_memory()[1]
                tracemalloc.stop()
            assert peak < 100 * len(content) + 2**23, (suffix, k, peak)
    assert refused > 100 and taken > 100, (refused, taken)


# --- messages -----------------------------------------------------------------------------------

FIELDS = [("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("intensity", 16, 7, 1)]


def message(points, height: int = 1, padding: int = 0, order: str = "<") -> dict:
    """A PointCloud2 of floats, 20 bytes a point."""
    width = len(points) // height
    layout = np.dtype({"names": ["x", "y", "z"], "formats": [f"{order}f4"] * 3, "offsets": [0, 4, 8], "itemsize": 20})
    rows = np.zeros((height, width * 20 + padding), dtype=np.uint8)
    for row, some in zip(rows, points.reshape(height, width, 3)):
        records = np.zeros(width, dtype=layout)
        for axis in range(3):
            records["xyz"[axis]] = some[:, axis]
        row[: width * 20] = np.frombuffer(records.tobytes(), dtype=np.uint8)
    names = ("name", "offset", "datatype", "count")
    return {
        "height": height, "width": width, "fields": [dict(zip(names, field)) for field in FIELDS],
        "is_bigendian": order == ">", "point_step": 20, "row_step": width * 20 + padding,
        "data": rows.tobytes(), "is_dense": False,
    }


def as_object(mapping: dict) -> SimpleNamespace:
    return SimpleNamespace(**{**mapping, "fields": [SimpleNamespace(**field) for field in mapping["fields"]]})


@pytest.mark.parametrize(("height", "padding", "order"), [(1, 0, "<"), (5, 0, "<"), (5, 12, "<"), (5, 3, ">")])
def test_messages_in_every_layout(height, padding, order):
    points = points_of(9)
    read_in = message(points, height, padding, order)
    raw = read_in["data"]
    for data in (
        raw, bytearray(raw), memoryview(raw), array.array("B", raw), np.frombuffer(raw, dtype=np.uint8), list(raw),
        np.frombuffer(raw, dtype=np.int8), base64.b64encode(raw).decode(),
    ):
        for made in ({**read_in, "data": data}, as_object({**read_in, "data": data})):
            cloud = PointCloud.from_message(made, 0.05)
            assert np.array_equal(cloud.points, points) and cloud.radius == 0.05, type(data)


def test_numbers_of_every_type_in_a_message():
    points = np.abs(points_of(10))
    for number, kind in enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), 1):
        size = np.dtype(kind).itemsize
        fields = [{"name": axis, "offset": k * size, "datatype": number, "count": 1} for k, axis in enumerate("zyx")]
        cloud = PointCloud.from_message({
            "height": 1, "width": len(points), "fields": fields, "is_bigendian": False, "point_step": 3 * size,
            "row_step": 3 * size * len(points), "data": points[:, ::-1].astype(kind).tobytes(),
        })
        assert np.array_equal(cloud.points, points), kind


def test_pixels_without_an_echo_are_dropped_where_asked():
    points = points_of(11)
    points[[3, 8]] = np.nan
    with pytest.raises(InvalidShape, match=r"from_message: PointCloud: points\[3, 0\] is nan"):
        PointCloud.from_message(message(points, 4))
    cloud = PointCloud.from_message(message(points, 4), np.arange(40.0), drop_invalid=True)
    assert cloud.dropped == 2 and np.array_equal(cloud.points, np.delete(points, [3, 8], axis=0))
    assert cloud.radii.tolist() == [k for k in range(40) if k not in (3, 8)]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"width": 41}, "do not fit 800 bytes"), ({"row_step": 0}, "do not fit"), ({"data": b""}, "do not fit 0"),
        ({"height": -1}, "message.height must be an integer ≥ 0, got -1"), ({"width": 2.0}, "message.width"),
        ({"data": "%%"}, "must be bytes, or base64"), ({"data": [300] * 800}, r"message.data must be bytes \(n,\)"),
        ({"data": None}, "message.data must be bytes"), ({"is_bigendian": "no"}, "is_bigendian must be True or False"),
        ({"fields": []}, r"message.fields must have x, y and z, got \[\]"), ({"fields": 3}, "message.fields must be"),
        ({"fields": [{"name": "x"}] * 2}, "two fields are named 'x'"),
        ({"fields": [{"name": axis, "offset": 0, "datatype": 9, "count": 1} for axis in "xyz"]}, "of datatype 9"),
        ({"fields": [{"name": axis, "offset": 17, "datatype": 7, "count": 1} for axis in "xyz"]}, "is beyond a point_"),
        ({"fields": [{"name": axis, "offset": 0, "datatype": 7, "count": 2} for axis in "xyz"]}, "got 2 of datatype 7"),
        ({"fields": [{"name": axis, "offset": 0} for axis in "xyz"]}, "must be a message with datatype"),
        ({"width": 0, "row_step": 0, "height": 10**30, "data": b""}, "points is empty"),
    ],
)
def test_messages_that_do_not_fit_are_named(changes, words):
    with pytest.raises(collide.CollideError, match=words) as raised:
        PointCloud.from_message({**message(points_of(12)), **changes})
    assert "PointCloud.from_message" in str(raised.value)
    missing = message(points_of(12))
    del missing["point_step"]
    with pytest.raises(InvalidShape, match="must be a message with point_step, or a mapping with such a key"):
        PointCloud.from_message(missing)


def test_records_with_fields_are_points():
    points = points_of(13, 24)
    records = np.zeros((4, 6), dtype=[("intensity", "f4"), ("z", "f4"), ("y", "f8"), ("x", "i2")])
    for k, axis in enumerate("xyz"):
        records[axis] = points[:, k].reshape(4, 6)
    assert np.array_equal(PointCloud(records, 0.1).points, points)
    assert np.array_equal(PointCloud(records.ravel().view(np.recarray)).points, points)
    records["y"][0, 1] = np.nan
    assert PointCloud(records, drop_invalid=True).dropped == 1
    with pytest.raises(InvalidShape, match="got records"):
        PointCloud(records[["x", "y"]])


class Tensor:
    """What torch gives for a tensor with a gradient."""

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")


def test_tensors_are_points_where_numpy_can_read_them():
    with pytest.raises(InvalidShape, match=r"points must be an array of numbers .*requires grad"):
        PointCloud(Tensor())
