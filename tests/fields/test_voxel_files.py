"""binvox files beside a decoder of the test, cell by cell, and trimesh's; and bytes that are false."""

from __future__ import annotations

import io
import itertools
import tracemalloc

import numpy as np
import pytest

from collide import InvalidShape
from collide.fields.voxel_files import Voxels, read_voxel_file, voxels_of_file, write_voxel_file


def file_of(runs: bytes, dim: str = "2 2 2", scale: str = "1", first: str = "#binvox 1") -> bytes:
    return f"{first}\ndim {dim}\ntranslate -0.5 1 2.25\nscale {scale}\ndata\n".encode() + runs


def cell_by_cell(runs: bytes, nx: int, ny: int, nz: int) -> np.ndarray:
    """As binvox's page numbers voxels: x · nz · ny + z · ny + y."""
    flat = [runs[i] for i in range(0, len(runs), 2) for _ in range(runs[i + 1])]
    occupied = np.zeros((nx, ny, nz), dtype=bool)
    for x, y, z in itertools.product(range(nx), range(ny), range(nz)):
        occupied[x, y, z] = flat[x * nz * ny + z * ny + y]
    return occupied


def runs_of(rng, n: int) -> bytes:
    """Runs of random lengths, of 0 too, which fill n voxels."""
    made = bytearray()
    while n:
        length = min(n, int(rng.choice([0, 1, 2, 7, 255])))
        made += bytes([int(rng.integers(0, 2)), length])
        n -= length
    return bytes(made)


def test_voxels_beside_a_decoder_cell_by_cell(tmp_path):
    rng = np.random.default_rng(0)
    for nx, nz, ny in ((1, 1, 1), (2, 2, 2), (5, 5, 5), (3, 4, 5), (16, 2, 9)):
        runs = runs_of(rng, nx * ny * nz)
        (tmp_path / "a.binvox").write_bytes(file_of(runs, f"{nx} {nz} {ny}", "6.5"))
        voxels = read_voxel_file(tmp_path / "a.binvox")
        assert np.array_equal(voxels.occupied, cell_by_cell(runs, nx, ny, nz)) and voxels.occupied.dtype == bool
        assert voxels.cell_sizes.tolist() == [6.5 / nx, 6.5 / ny, 6.5 / nz]
        assert voxels.origin.tolist() == [-0.5, 1.0, 2.25]


@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 7, 7), (20, 3, 11), (1, 40, 2)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_what_is_written_is_read_again_as_a_cube(shape, share, tmp_path):
    occupied = np.random.default_rng(1).random(shape) < share
    given = Voxels(occupied, np.full(3, 0.25), np.array([0.1, -3.0, 1e-9]))
    write_voxel_file(tmp_path / "a.binvox", given)
    again = read_voxel_file(tmp_path / "a.binvox")
    assert again.occupied.shape == (max(shape),) * 3 and again.occupied.sum() == occupied.sum()
    assert np.array_equal(again.occupied[tuple(map(slice, shape))], occupied)
    assert np.array_equal(again.origin, given.origin) and again.cell_sizes == pytest.approx([0.25] * 3, rel=1e-15)


def test_voxels_beside_trimesh(tmp_path):
    binvox = pytest.importorskip("trimesh.exchange.binvox", reason="trimesh reads binvox: the extra [robots]")
    occupied = np.random.default_rng(2).random((9, 9, 9)) < 0.3
    write_voxel_file(tmp_path / "a.binvox", Voxels(occupied, np.full(3, 0.5), np.zeros(3)))
    grid = binvox.load_binvox(io.BytesIO((tmp_path / "a.binvox").read_bytes()))
    assert np.array_equal(grid.matrix, occupied)
    content = binvox.export_binvox(grid)
    assert np.array_equal(voxels_of_file(content, "of trimesh").occupied, occupied)


GOOD = file_of(bytes([0, 3, 1, 5]))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "must begin with '#binvox 1', got ''"), (file_of(b"", first="#binvox 2"), "got '#binvox 2'"),
        (GOOD[:30], "no line 'data'"), (GOOD[:-1], "8 voxels must follow .* got 3 in 3 bytes"),
        (GOOD[:-2], "8 voxels must follow .* got 3 in 2 bytes"), (GOOD + b"\1\1", "got 9 in 6 bytes"),
        (file_of(bytes([0, 3, 2, 5])), "a value, 0 or 1"), (file_of(b"", "0 2 2"), "dim must be three integers"),
        (file_of(b"", "2 2"), "dim must be 3 finite numbers, got '2 2'"), (file_of(b"", "2 2 2.5"), "three integers"),
        (file_of(b"", "1e300 1e300 9"), "dim must be three"), (file_of(b"", "two 2 2"), "dim must be 3 finite"),
        (file_of(b"", "99999 99999 99999"), "dim of 999970000299999 cells: 2147483647 are the most"),
        (file_of(bytes([0, 8]), scale="0"), "scale > 0, got '2 2 2' and 0"), (file_of(b"", scale="nan"), "scale must"),
        (file_of(bytes([0, 8]), scale="5e-324"), "cells of a length above 0"),
        (GOOD.replace(b"translate", b"moved"), "translate must be 3 finite numbers, got None"),
    ],
)
def test_damaged_files_are_named(content, words, tmp_path):
    (tmp_path / "a.binvox").write_bytes(content)
    with pytest.raises(InvalidShape, match=words) as raised:
        read_voxel_file(tmp_path / "a.binvox")
    assert "a.binvox" in str(raised.value)


def test_grids_that_binvox_has_no_words_for_are_not_written(tmp_path):
    ones = np.ones((2, 2, 2), dtype=bool)
    for given, words in (
        (Voxels(ones, np.array([1.0, 1.0, 2.0]), np.zeros(3)), "cells are cubes"),
        (Voxels(ones, np.zeros(3), np.zeros(3)), "one number > 0"),
        (Voxels(ones[0], np.ones(3), np.zeros(3)), r"occupied must be \(nx, ny, nz\)"),
        (Voxels(ones[:0], np.ones(3), np.zeros(3)), r"got \(0, 2, 2\)"),
    ):
        with pytest.raises(InvalidShape, match=words):
            write_voxel_file(tmp_path / "a.binvox", given)
    assert not (tmp_path / "a.binvox").exists()
    with pytest.raises(InvalidShape, match=r"binvox: .*absent\.binvox: no such file"):
        read_voxel_file(tmp_path / "absent.binvox")


def test_mutated_bytes_are_refused_by_name_or_read():
    """Never another exception, nor more memory than 400 bytes for a byte of the file, and a megabyte."""
    rng = np.random.default_rng(4)
    samples = [GOOD, file_of(runs_of(rng, 512), "8 8 8")]
    refused = taken = 0
    for k in range(600):
        content = samples[k % 2]
        mutant = bytearray(content)
        if k % 5 == 0:
            del mutant[int(rng.integers(0, len(mutant))) :]
        begin, end = (content.index(b"translate") + 10, content.index(b"data")) if k % 3 else (0, len(content))
        for place in rng.integers(begin, end, int(rng.integers(1, 3))):
            if place < len(mutant):
                mutant[int(place)] = int(rng.choice([48, 57, 32, 255, int(rng.integers(0, 256))]))
        tracemalloc.start()
        try:
            voxels = voxels_of_file(bytes(mutant), "mutant")
            assert voxels.occupied.ndim == 3 and (voxels.cell_sizes > 0.0).all() and np.isfinite(voxels.origin).all()
            taken += 1
        except InvalidShape as error:
            assert "mutant" in str(error), (k, error)
            refused += 1
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert peak < 400 * len(content) + 2**20, (k, peak)
    assert refused > 200 and taken > 50, (refused, taken)
