"""OctoMap's files and messages beside a recursive parser of the test and OctoMap itself, and bytes that are false."""

from __future__ import annotations

import array
import struct
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from collide import InvalidShape
from collide.fields.octree_files import (
    StreamLeaves,
    binary_stream,
    leaves_of_file,
    leaves_of_message,
    read_octree_file,
    write_octree_file,
)

HEAD = "# Octomap OcTree {}file\n# (feel free to add / change comments, but leave the first line as it is!)\n#\n"

# --- trees of the test: a leaf is a number, log-odds or 1 for free and 2 for occupied, a node a dictionary of children


def random_tree(rng, depth: int, leaf) -> dict:
    """Nodes with one child to three at the top, then any; a leaf may be of any size."""
    tree = {}
    for k in rng.choice(8, int(rng.integers(1, 4)), replace=False).tolist():
        deeper = depth > 1 and rng.random() < 0.75
        tree[k] = random_tree(rng, depth - 1, leaf) if deeper else leaf(rng)
    return tree


def chain(depth: int, leaf) -> dict:
    tree = leaf
    for k in range(depth):
        tree = {(3 * k) % 8: tree}
    return tree


def leaves_in(tree, x=0, y=0, z=0, exponent=16) -> list[tuple]:
    """(least cell, exponent, value) of all leaves, by recursion."""
    if not isinstance(tree, dict):
        return [(x - 32768, y - 32768, z - 32768, exponent, tree)]
    half = 2 ** (exponent - 1)
    return [
        leaf for k, child in sorted(tree.items())
        for leaf in leaves_in(child, x + half * (k % 2), y + half * (k // 2 % 2), z + half * (k // 4), exponent - 1)
    ]


def count(tree) -> int:
    return 1 + sum(map(count, tree.values())) if isinstance(tree, dict) else 1


def binary(tree) -> bytes:
    word = sum((3 if isinstance(child, dict) else child) << 2 * k for k, child in tree.items())
    return struct.pack("<H", word) + b"".join(binary(tree[k]) for k in sorted(tree) if isinstance(tree[k], dict))


def full(tree, colour: bytes = b"") -> bytes:
    if not isinstance(tree, dict):
        return struct.pack("<f", tree) + colour + b"\0"
    bits = sum(1 << k for k in tree)
    return struct.pack("<f", 9.0) + colour + bytes([bits]) + b"".join(full(tree[k], colour) for k in sorted(tree))


def file_of(data: bytes, size: int, kind: str = "", res: str = "0.05", name: str = "OcTree") -> bytes:
    return f"{HEAD.format(kind)}id {name}\nsize {size}\nres {res}\ndata\n".encode() + data


def bits(rng) -> int:
    return int(rng.integers(1, 3))


def odds(rng) -> float:
    return float(np.float32(rng.normal()))


def rows_of(leaves: StreamLeaves, values) -> list[tuple]:
    return sorted((*map(int, corner), int(s), v) for corner, s, v in zip(leaves.corners, leaves.exponents, values))


def trees(leaf) -> list[dict]:
    rng = np.random.default_rng(1)
    return [*(random_tree(rng, depth, leaf) for depth in (1, 2, 4, 8, 12)), chain(16, leaf(rng)), chain(1, leaf(rng))]


def test_binary_files_beside_recursion(tmp_path):
    for tree in trees(bits):
        (tmp_path / "a.bt").write_bytes(file_of(binary(tree), count(tree), "binary "))
        leaves = read_octree_file(tmp_path / "a.bt", 0.05)
        assert rows_of(leaves, 1 + leaves.occupied.astype(int)) == sorted(leaves_in(tree))
        assert leaves.resolution == 0.05 and leaves.log_odds is None and leaves.corners.dtype == np.int32
    assert min(leaves_in(chain(16, 2)))[3] == 0, "finest cells are among them"


@pytest.mark.parametrize("colour", [b"", b"\1\2\3"])
def test_full_files_beside_recursion(colour, tmp_path):
    for tree in [*trees(odds), 0.5]:
        content = file_of(full(tree, colour), count(tree), name="ColorOcTree" if colour else "OcTree")
        (tmp_path / "a.ot").write_bytes(content)
        leaves = read_octree_file(tmp_path / "a.ot")
        assert rows_of(leaves, leaves.log_odds.tolist()) == sorted(leaves_in(tree))
        assert np.array_equal(leaves.occupied, leaves.log_odds >= 0.0)


def test_messages_are_streams_without_a_header():
    tree = trees(bits)[3]
    for data in (binary(tree), array.array("b", np.frombuffer(binary(tree), dtype=np.int8).tolist())):
        message = {"id": "OcTree", "resolution": 0.1, "binary": True, "data": data, "header": None}
        for made in (message, SimpleNamespace(**message)):
            leaves = leaves_of_message(made, 0.1)
            assert rows_of(leaves, 1 + leaves.occupied.astype(int)) == sorted(leaves_in(tree))
    tree = trees(odds)[3]
    leaves = leaves_of_message({"id": "OcTree", "resolution": 0.1, "binary": False, "data": full(tree)})
    assert rows_of(leaves, leaves.log_odds.tolist()) == sorted(leaves_in(tree)) and leaves.resolution == 0.1
    for name, value, words in (
        ("id", "SemanticOcTree", "id must be one of OcTree, ColorOcTree, got 'SemanticOcTree'"),
        ("resolution", 0.0, "must be > 0 m, got '0.0'"), ("resolution", "wide", "res must be 1 finite number"),
        ("binary", "yes", "binary must be True or False"), ("data", 3.5, "data must be bytes"),
    ):
        with pytest.raises(ValueError, match=words):
            leaves_of_message({**message, name: value})
    with pytest.raises(InvalidShape, match="must be a message with binary"):
        leaves_of_message({"id": "OcTree", "resolution": 0.1})
    with pytest.raises(InvalidShape, match=r"its resolution is 0\.1 m, not 0\.2"):
        leaves_of_message(message, 0.2)


def random_leaves(seed: int, n: int) -> StreamLeaves:
    """Leaves of several sizes that do not overlap: in each block of 8 cells a side those of one size."""
    rng = np.random.default_rng(seed)
    blocks = np.unique(rng.integers(-4096, 4096, (n, 3)), axis=0)
    exponents = rng.integers(0, 4, len(blocks))
    offsets = rng.integers(0, 8, (len(blocks), 3)) >> exponents[:, None] << exponents[:, None]
    return StreamLeaves(
        0.1, (8 * blocks + offsets).astype(np.int32), exponents.astype(np.int32), rng.random(len(blocks)) < 0.5
    )


def test_what_is_written_is_read_again(tmp_path):
    for n in (1, 2, 50, 3000):
        leaves = random_leaves(n, n)
        write_octree_file(tmp_path / "a.bt", leaves)
        again = read_octree_file(tmp_path / "a.bt", 0.1)
        assert rows_of(again, again.occupied.tolist()) == rows_of(leaves, leaves.occupied.tolist())
        shuffled = np.random.default_rng(n).permutation(len(leaves.corners))
        same = leaves._replace(**{
            name: getattr(leaves, name)[shuffled] for name in ("corners", "exponents", "occupied")
        })
        assert binary_stream(same) == binary_stream(leaves)
    for tree in trees(bits):
        rows = leaves_in(tree)
        made = StreamLeaves(1.0, np.array([row[:3] for row in rows]), np.array([row[3] for row in rows]),
                            np.array([row[4] == 2 for row in rows]))
        assert binary_stream(made) == (binary(tree), count(tree))
    none = StreamLeaves(0.1, np.zeros((0, 3), np.int32), np.zeros(0, np.int32), np.zeros(0, bool))
    write_octree_file(tmp_path / "none.bt", none)
    assert len(read_octree_file(tmp_path / "none.bt").corners) == 0


@pytest.mark.parametrize(
    ("corners", "exponents", "words"),
    [
        ([(0, 0, 0), (0, 0, 0)], [0, 0], "leaves overlap in the cell of 2^0 cells a side at"),
        ([(8, 0, -8), (11, 2, -5)], [3, 0], r"leaves overlap in the cell of 2\^3 cells a side at \[8, 0, -8\]"),
        ([(0, 0, 0), (3, 0, 0)], [0, 1], r"corners\[1\] must lie within ±32768 on multiples of 2\^1, got \[3, 0, 0\]"),
        ([(0, 0, 32768)], [0], r"corners\[0\] must lie within"), ([(0, -32769, 0)], [0], r"corners\[0\] must lie"),
        ([(-32768,) * 3], [16], "exponents must lie within 0 … 15"), ([(0, 0, 0)], [-1], "exponents must lie"),
    ],
)
def test_leaves_that_are_no_octree_are_not_written(corners, exponents, words, tmp_path):
    words = words.replace("2^0", r"2\^0")
    with pytest.raises(InvalidShape, match=words):
        write_octree_file(tmp_path / "a.bt", StreamLeaves(0.1, corners, exponents, [True] * len(exponents)))
    assert not (tmp_path / "a.bt").exists()


# --- what is wrong ------------------------------------------------------------------------------

TREE = {0: 1, 5: {2: 2, 3: 1}, 7: {0: {1: 2}}}
GOOD = file_of(binary(TREE), 8, "binary ")
ODDS = {0: 0.5, 5: {2: -1.0}}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "must begin with '# Octomap OcTree binary file' or"), (GOOD[:60], "must begin with|no line 'data'"),
        (GOOD[:130], "no line 'data'"), (GOOD[:-1], "no whole number of nodes of 2 bytes"),
        (GOOD[:-2], "ends before its last node"), (GOOD + b"\0\0", "have 1 nodes after the last"),
        (GOOD.replace(b"size 8", b"size 9"), "size must be its number of nodes, 8, got '9'"),
        (GOOD.replace(b"size 8", b"size"), "size must be 1 finite number, got ''"),
        (GOOD.replace(b"id OcTree", b"id 1"), "id must be one of OcTree, ColorOcTree, got '1'"),
        (GOOD.replace(b"id OcTree\n", b""), "id must be one of OcTree, ColorOcTree, got None"),
        (GOOD.replace(b"res 0.05", b"res 0"), "the resolution, must be > 0 m, got '0'"),
        (GOOD.replace(b"res 0.05", b"res -1"), "must be > 0 m"), (GOOD.replace(b"res 0.05", b"res nan"), "res must be"),
        (GOOD.replace(b"0.05", b"0.06"), r"its resolution is 0\.06 m, not 0\.05"),
        (file_of(b"\0\0", 1, "binary "), "has a node without children"),
        (file_of(binary(chain(17, 1)), 18, "binary "), "nodes more than 16 levels deep"),
        (file_of(full(chain(17, 0.5)), 18), "nodes more than 16 levels deep"),
        (file_of(full(ODDS), 5), "size must be its number of nodes, 4, got '5'"),
        (file_of(full(ODDS)[:-5], 3), "ends before its last node"), (file_of(full(ODDS)[:-1], 4), "of 5 bytes"),
        (file_of(full({0: float("nan")}), 2), "a leaf has log-odds of nan"),
        (file_of(full(ODDS), 4, name="ColorOcTree"), "no whole number of nodes of 8 bytes"),
    ],
)
def test_damaged_files_are_named(content, words, tmp_path):
    (tmp_path / "a.bt").write_bytes(content)
    with pytest.raises(InvalidShape, match=words) as raised:
        read_octree_file(tmp_path / "a.bt", 0.05)
    assert "a.bt" in str(raised.value)
    with pytest.raises(InvalidShape, match=r"octree: .*absent\.bt: no such file"):
        read_octree_file(tmp_path / "absent.bt")


def test_mutated_bytes_are_refused_by_name_or_read():
    """Never another exception, nor more memory than 80 bytes for a byte of the file, and a megabyte."""
    rng = np.random.default_rng(3)
    samples = [GOOD, file_of(full(ODDS), 4)]
    for leaf, write, kind in ((bits, binary, "binary "), (odds, full, "")):
        tree = random_tree(rng, 6, leaf)
        samples.append(file_of(write(tree), count(tree), kind))
    refused = taken = 0
    for k in range(600):
        content = samples[k % 4]
        mutant = bytearray(content)
        begin = content.index(b"data\n") + 5 if k % 3 else 0
        if k % 5 == 0:
            del mutant[int(rng.integers(begin, len(mutant))) :]
        for place in rng.integers(begin, len(content), int(rng.integers(1, 3))):
            if place < len(mutant):
                mutant[int(place)] = int(rng.integers(0, 256))
        tracemalloc.start()
        try:
            leaves = leaves_of_file(bytes(mutant), "mutant")
            assert len(leaves.corners) == len(leaves.exponents) == len(leaves.occupied)
            assert leaves.exponents.min(initial=0) >= 0 and np.abs(leaves.corners).max(initial=0) <= 32768
            taken += 1
        except InvalidShape as error:
            assert "mutant" in str(error), (k, error)
            refused += 1
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert peak < 80 * len(content) + 2**20, (k, peak)
    assert refused > 200 and taken > 50, (refused, taken)


# --- OctoMap itself -----------------------------------------------------------------------------


@pytest.fixture
def octomap():
    return pytest.importorskip("pyoctomap", reason="OctoMap itself: pip install 'collide-robotics[all-peers]'")


def rows_of_octomap(tree, value) -> np.ndarray:
    """(middle, side, value) of each leaf, in order."""
    rows = [(*leaf.getCoordinate(), leaf.getSize(), value(leaf.current_node)) for leaf in tree.begin_leafs()]
    return np.array(sorted(rows))


def rows_in_metres(leaves: StreamLeaves, values) -> np.ndarray:
    side = leaves.resolution * 2.0**leaves.exponents
    middle = leaves.resolution * leaves.corners + 0.5 * side[:, None]
    return np.array(sorted(map(tuple, np.column_stack([middle, side, values]).tolist())))


@pytest.mark.parametrize("kind", ["OcTree", "ColorOcTree"])
def test_what_octomap_writes_is_read(octomap, kind, tmp_path):
    tree, rng = getattr(octomap, kind)(0.125), np.random.default_rng(4)
    for p in [*rng.uniform(-2, 2, (150, 3)), *(np.indices((4, 4, 4)).reshape(3, -1).T + 0.5) * 0.125]:
        for _ in range(12):  # to the clamping thresholds: eight equal leaves become one
            tree.updateNode(p.tolist(), bool(p[0] > 0.0))
    tree.write(str(tmp_path / "a.ot"))
    leaves = read_octree_file(tmp_path / "a.ot", 0.125)
    assert len(set(leaves.exponents.tolist())) > 1, "leaves of several sizes"
    wanted = rows_of_octomap(tree, lambda node: node.getLogOdds())
    assert np.allclose(rows_in_metres(leaves, leaves.log_odds), wanted, rtol=0.0, atol=1e-6)
    assert tree.writeBinary(str(tmp_path / "a.bt"))
    leaves = read_octree_file(tmp_path / "a.bt", 0.125)
    wanted = rows_of_octomap(tree, lambda node: node.getLogOdds() >= 0.0)
    assert np.allclose(rows_in_metres(leaves, leaves.occupied), wanted, rtol=0.0, atol=1e-6)


def test_octomap_reads_what_is_written(octomap, tmp_path):
    leaves = random_leaves(5, 500)
    write_octree_file(tmp_path / "a.bt", leaves)
    tree = octomap.OcTree(1.0)
    assert tree.readBinary(str(tmp_path / "a.bt")) and tree.getResolution() == 0.1
    wanted = rows_of_octomap(tree, lambda node: node.getLogOdds() >= 0.0)
    assert np.allclose(rows_in_metres(leaves, leaves.occupied), wanted, rtol=0.0, atol=1e-4)
