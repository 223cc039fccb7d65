"""What a support tree costs, counted; how it is checked and refused; the same bits without compilation."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hull_families import HULLS, LARGE, bipyramid, directions_for, ellipsoid, made, normals_of
from validate_support_tree import validate_support_tree

from collide.kernels import address_of
from collide.support import grow_tree as grow
from collide.support.build_support_tree import build_support_tree
from collide.support.extreme_vertex import LOOKED_AT, SCANNED, STEPS
from collide.support.grow_tree import FINE_RATIO, LARGEST_SCAN, LONGEST_LIST, RATIO, SMALL_HULL
from collide.support.nested_subsets import nested_order
from collide.support.support_tree import SupportTree
from collide.support.support_tree_query import COUNTERS, extreme_vertices

pytest.importorskip("scipy.spatial")


def growing(points, facets):
    """(a tree without levels, the memory that it stands in), for kernels as Python."""
    memory = np.zeros(grow.tree_memory(len(points), len(facets), 1 << 14) // 8, dtype=np.int64)
    return grow._growing(address_of(memory), len(points), len(facets), 1 << 14)[0], memory


def grown(tree, points, facets) -> int:
    return grow._grow(tree, points.ravel(), np.arange(len(points)), len(points), facets.ravel(), len(facets))


# --- size and speed, counted --------------------------------------------------------------------


@pytest.mark.parametrize("name", LARGE)
def test_lists_are_short_and_memory_is_linear(name):
    points, facets, tree = made(name, large=True)
    lengths = np.diff(tree.nodes)
    assert lengths.max() <= LONGEST_LIST and lengths.mean() < 55
    assert tree.nbytes <= 100 * len(points) + 2000, tree.nbytes / len(points)
    counters = np.zeros(COUNTERS, dtype=np.int64)
    directions = np.random.default_rng(11).normal(size=(2000, 3))
    settled = extreme_vertices(tree, directions, True, counters)
    assert (settled != extreme_vertices(tree, directions, False)).sum() < 2
    assert counters[STEPS] < 2
    assert counters[SCANNED] / 2000 < 230
    assert counters[LOOKED_AT] / 2000 < 30
    # Exact ties: facet normals, and those of the flat faces again and again.
    normals = normals_of(points, facets[:: len(facets) // 2000])
    counters[:] = 0
    assert (extreme_vertices(tree, np.concatenate([normals, np.eye(3), -np.eye(3)]), True, counters) >= 0).all()
    assert counters[STEPS] < 2 * len(normals) and counters[LOOKED_AT] < 100 * len(normals)


def test_operations_grow_like_the_logarithm():
    sizes, scanned = [256, 1024, 4096, 16384], []
    for n in sizes:
        points, facets = ellipsoid(n, seed=12)
        tree = build_support_tree(points, np.arange(n), facets)
        subset, depth = n, 1
        while subset > (SMALL_HULL if depth == 1 else LARGEST_SCAN):
            subset, depth = -(-subset // (FINE_RATIO if depth == 1 else RATIO)), depth + 1
        assert tree.depth == depth
        counters = np.zeros(COUNTERS, dtype=np.int64)
        extreme_vertices(tree, np.random.default_rng(13).normal(size=(2000, 3)), True, counters)
        scanned.append(counters[SCANNED] / 2000)
        assert counters[LOOKED_AT] / 2000 < 8
    assert all(count < 14 * np.log2(n) for n, count in zip(sizes, scanned)), scanned


@pytest.mark.plain_kernels
def test_owners_of_long_lists_leave_the_coarse_subsets(monkeypatch):
    """What the degree alone does not show: here it is told to look at nothing."""
    points, facets = bipyramid(400)
    n = len(points)
    tree, _held = growing(points, facets)
    moved = []

    def spy(tree, n_used):
        moved.append(usual_move(tree, n_used))
        return moved[-1]

    usual_move = grow._move_owners_of_long_lists
    monkeypatch.setattr(grow, "_move_owners_of_long_lists", spy)
    monkeypatch.setattr(grow, "HIGHEST_DEGREE", 10**9)
    usual = grow.nested_order

    def apexes_first(vertices, normals, late, n, sizes, first, n_sizes, places, scratch, ordered):
        usual(vertices, normals, late, n, sizes, first, n_sizes, places, scratch, ordered)
        order = np.array(ordered[:n])
        ordered[:n] = order[np.argsort((order < 400) | (np.array(late)[order] != 0), kind="stable")]

    monkeypatch.setattr(grow, "nested_order", apexes_first)
    assert grown(tree, points, facets) == 0 and moved == [True, False]
    nodes, owners = tree.nodes[: tree.header[grow.N_NODES] + 1], tree.owners[: tree.header[grow.N_NODES]]
    assert np.diff(nodes).max() <= grow.LONGEST_LIST and not {400, 401} & set(owners.tolist())
    monkeypatch.setattr(grow, "_ATTEMPTS", 1)
    assert grown(tree, points, facets) == 0 and np.diff(tree.nodes[: tree.header[grow.N_NODES] + 1]).max() > 390
    assert len(owners) < n


@pytest.mark.parametrize("name", ["sphere", "pancake", "needle", "ellipsoid"])
def test_no_list_is_much_longer_than_the_others(name):
    """Of random subsets one in ten is longer than one and a half times the average."""
    lengths = np.diff(made(name, large=True)[2].nodes)[1:]
    assert np.quantile(lengths, 0.9) < 1.4 * lengths.mean() and lengths.max() < 2.5 * lengths.mean()


def ordered_by(vertices, normals, late, sizes) -> np.ndarray:
    n = len(vertices)
    places, scratch, ordered = np.zeros((3, n), dtype=np.int64)
    nested_order(vertices, normals.ravel(), late, n, sizes, 0, len(sizes), places, scratch, ordered)
    return ordered


@pytest.mark.plain_kernels
def test_subsets_are_nested_and_late_vertices_come_last():
    rng = np.random.default_rng(17)
    vertices, normals = rng.permutation(5000)[:1000], rng.normal(size=(1000, 3))
    normals[:50] = 0
    late = rng.random(1000) < 0.3
    ordered = ordered_by(vertices, normals, late, [1000, 42, 3])
    assert np.array_equal(np.sort(ordered), np.sort(vertices))
    assert not np.isin(ordered[:42], vertices[late]).any()
    assert np.isin(ordered_by(vertices, normals, np.ones(1000, dtype=bool), [1000, 42]), vertices).all()
    few = np.arange(1000) >= 20  # a subset larger than what is not late takes the first of the others
    assert np.isin(vertices[:20], ordered_by(vertices, normals, few, [1000, 42])[:42]).all()


@pytest.mark.plain_kernels
def test_neighbours_on_the_curve_are_neighbours_on_the_sphere():
    n = 4000
    normals = np.random.default_rng(18).normal(size=(n, 3))
    normals /= np.sqrt(np.square(normals).sum(axis=1))[:, None]
    ordered = normals[ordered_by(np.arange(n), normals, np.zeros(n, dtype=bool), [n])]
    steps = np.sqrt(np.square(np.diff(ordered, axis=0)).sum(axis=1))
    assert np.median(steps) < 1.5 * np.sqrt(4 * np.pi / n) and (steps > 0.45).sum() < 20


def test_a_vertex_of_many_neighbours_is_proven_by_few():
    """Directions inside the apex's cone, from the apex: work that is logarithmic in its degree."""
    tree = made("bipyramid", large=True)[2]
    directions = np.random.default_rng(14).normal(size=(500, 3)) * (0.3, 0.3, 0) + (0, 0, 1)
    counters = np.zeros(COUNTERS, dtype=np.int64)
    assert (extreme_vertices(tree, directions, True, counters) == 30000).mean() > 0.8
    assert counters[LOOKED_AT] / 500 < 6 * np.log2(30000)


# --- keeping and checking -----------------------------------------------------------------------


@pytest.mark.many(6)
@pytest.mark.parametrize("name", HULLS)
def test_validation_passes(name):
    validate_support_tree(made(name)[2], samples=25)


#: What a tree is made of, besides its points.
PARTS = ("flat", "depth", "nodes", "owners", "entries", "list_coordinates", "ring_starts", "ring")


def parts_of(tree) -> dict:
    return {name: getattr(tree, name) for name in PARTS}


def test_a_tree_is_read_only():
    with pytest.raises(ValueError):
        made("sphere")[2].ring[0] = 1


def test_building_twice_gives_the_same_bytes():
    points, facets, tree = made("sphere")
    again = parts_of(build_support_tree(points, np.arange(len(points)), facets))
    assert all(np.array_equal(part, again[name]) for name, part in parts_of(tree).items())


@pytest.mark.parametrize("name", HULLS)
def test_growing_stays_in_its_memory_and_asks_for_more(name):
    """With room for few candidates it says for how many there must be, with as many it makes the same tree; nothing is
    written behind the memory that is asked for."""
    points, facets, tree = made(name)
    points, facets = np.ascontiguousarray(points), np.ascontiguousarray(facets, dtype=np.int32)
    vertices, capacity, asked = np.unique(facets), 200, 0
    while True:
        n_words = grow.tree_memory(len(points), len(facets), capacity) // 8
        memory = np.full(n_words + 4096, -7, dtype=np.int64)
        wanted = grow.grow_tree(
            address_of(points), len(points), address_of(vertices), len(vertices), address_of(facets), len(facets),
            address_of(memory), capacity,
        )
        assert (memory[n_words:] == -7).all() and 0 <= wanted and wanted != capacity
        if wanted == 0:
            break
        assert wanted > capacity
        capacity, asked = wanted, asked + 1
    assert memory[grow.N_ENTRIES] == len(tree.entries) and memory[grow.N_NODES] == len(tree.owners)
    assert asked > 0 or len(tree.owners) == 1


def changed(name, place, value):
    def change(arrays):
        arrays[name] = arrays[name].copy()
        arrays[name][place] = value

    return change


DAMAGES = {
    "depth too large": lambda arrays: arrays.update(depth=arrays["depth"] + 1),
    "depth too small": lambda arrays: arrays.update(depth=arrays["depth"] - 1),
    "depth 0": lambda arrays: arrays.update(depth=0),
    "depth below 0": lambda arrays: arrays.update(depth=-1),
    "no nodes": lambda arrays: arrays.update(nodes=arrays["nodes"][:0]),
    "nodes out of order": changed("nodes", 5, 2**30),
    "nodes cut short": lambda arrays: arrays.update(nodes=arrays["nodes"][:-1]),
    "a node too far": changed("entries", 3, 10**6),
    "a node below 0": changed("entries", 3, -2),
    "a node twice": lambda arrays: changed("entries", 3, arrays["entries"][4])(arrays),
    "a row too far": changed("entries", -1, 10**6),
    "a row below 0": changed("entries", -1, -1),
    "another row": lambda arrays: changed("entries", -1, arrays["entries"][-2])(arrays),
    "entries cut short": lambda arrays: arrays.update(entries=arrays["entries"][:-1]),
    "an owner too far": changed("owners", 3, 10**6),
    "another owner": lambda arrays: changed("owners", 3, arrays["owners"][4])(arrays),
    "another coordinate": changed("list_coordinates", 100, 0.123),
    "not a number": changed("list_coordinates", 100, np.nan),
    "coordinates cut short": lambda arrays: arrays.update(list_coordinates=arrays["list_coordinates"][:-3]),
    "a neighbour too far": changed("ring", 7, 10**6),
    "a neighbour below 0": changed("ring", 7, -1),
    "rings out of order": changed("ring_starts", 7, 10**6),
    "rings cut short": lambda arrays: arrays.update(ring_starts=arrays["ring_starts"][:-1]),
}


@pytest.mark.parametrize("what", DAMAGES)
def test_damaged_arrays_are_refused(what):
    points, _, tree = made("sphere")
    arrays = parts_of(tree)
    DAMAGES[what](arrays)
    with pytest.raises(ValueError, match="support tree"):
        SupportTree(points, **arrays)


def test_other_points_are_refused():
    points, _, tree = made("sphere")
    with pytest.raises(ValueError, match="coordinates"):
        SupportTree(points[::-1], **parts_of(tree))
    with pytest.raises(ValueError, match="points"):
        SupportTree(points[:-1], **parts_of(tree))


def test_validation_sees_what_its_structure_cannot_show():
    points, _, tree = made("ellipsoid")
    assert tree.depth == 2
    arrays = parts_of(tree)
    changed("ring", 0, (arrays["ring"][0] + 100) % len(points))(arrays)
    with pytest.raises(AssertionError):
        validate_support_tree(SupportTree(points, **arrays))
    # Every list of the last level shrunk to copies of its owner: complete in form, wrong in most directions.
    arrays = parts_of(tree)
    entries, coordinates = arrays["entries"].copy(), arrays["list_coordinates"].copy()
    for node in range(1, len(tree.owners)):
        begin, end = tree.nodes[node], tree.nodes[node + 1]
        entries[begin:end] = tree.owners[node]
        coordinates[3 * begin : 3 * end] = np.repeat(points[tree.owners[node]], end - begin)
    arrays.update(entries=entries, list_coordinates=coordinates)
    crippled = SupportTree(points, **arrays)
    with pytest.raises(AssertionError, match="climbing"):
        validate_support_tree(crippled)
    # Answers stay exact all the same.
    directions = np.random.default_rng(16).normal(size=(50, 3))
    assert np.array_equal(extreme_vertices(crippled, directions), extreme_vertices(tree, directions))


def test_wrong_input_is_refused():
    points, facets = ellipsoid(50, seed=17)
    rows = np.arange(50)
    for bad_points, vertices, bad_facets in (
        (points * np.nan, rows, facets),
        (points[:, :2], rows, facets),
        (points, rows, facets[1:]),
        (points, rows, np.concatenate([facets, facets[:1]])),
        (points, rows, np.concatenate([facets[1:], facets[:1, ::-1]])),
        (points, rows[1:], facets),
        (points, rows[[0, *range(50)]], facets),
        (points, rows, facets + 1),
        (points, rows, facets[:1]),
        (points, rows, facets[:, :2]),
    ):
        with pytest.raises(ValueError):
            build_support_tree(bad_points, vertices, bad_facets)


PLAIN = """
import sys, numpy as np
from collide import kernels
assert kernels.PLAIN_PYTHON
from collide.support.build_support_tree import build_support_tree
from collide.support.support_tree_query import extreme_vertices
given = dict(np.load(sys.argv[1]))
tree = build_support_tree(given["points"], given["vertices"], given["facets"])
parts = {name: getattr(tree, name) for name in sys.argv[3:]}
np.savez(sys.argv[2], ids=extreme_vertices(tree, given["directions"]), **parts)
"""


@pytest.mark.many(2)
@pytest.mark.parametrize("name", ["small sphere", "sphere", "bipyramid"])
def test_without_compilation_the_bits_are_the_same(name, tmp_path):
    points, facets = {
        "small sphere": lambda: ellipsoid(100), "sphere": lambda: ellipsoid(400, seed=18),
        "bipyramid": lambda: bipyramid(250),
    }[name]()
    tree = build_support_tree(points, np.arange(len(points)), facets)
    directions = directions_for(points, facets, seed=19, each=10)
    directions = directions[np.abs(directions).max(axis=1) < 1e100]
    np.savez(
        tmp_path / "in.npz", points=points, vertices=np.arange(len(points)), facets=facets, directions=directions,
        none=np.zeros((0, 3)),
    )
    child = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PLAIN, str(tmp_path / "in.npz"), str(tmp_path / "out.npz"), *PARTS],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=False, timeout=100,
    )
    assert child.returncode == 0, child.stderr[-2000:]
    with np.load(tmp_path / "out.npz") as plain:
        for part, array in parts_of(tree).items():
            assert np.array_equal(plain[part], array), part
        assert np.array_equal(plain["ids"], extreme_vertices(tree, directions))
