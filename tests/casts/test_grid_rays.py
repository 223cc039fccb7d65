"""Rays at voxel grids and octrees: the surface of the union, beside chords of all cells in fractions."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from field_unions import random_grid
from naive import random_pose

import collide

EYE = np.eye(4)


class GridByHand:
    """The cells of a grid at a pose, as closed boxes of exact numbers."""

    def __init__(self, grid: collide.VoxelGrid, X_WA: np.ndarray):
        self.cells = {tuple(cell) for cell in grid.cells.tolist()}
        self.side = grid.cell.tolist()
        shifts = bool((grid.X[:3, :3] == np.eye(3)).all())
        self.shift = grid.X[:3, 3].tolist() if shifts else [0.0] * 3
        self.poses = [X_WA] if shifts else [X_WA, grid.X]

    def plane(self, axis: int, index: int) -> Fraction:
        return Fraction(index * self.side[axis] + self.shift[axis])

    def in_frame(self, p, v) -> tuple[list[Fraction], list[Fraction]]:
        """A place and a vector of the world in the frame of the cells."""
        for X in self.poses:
            R = [[Fraction(float(x)) for x in row] for row in X[:3, :3]]
            away = [a - Fraction(float(b)) for a, b in zip(p, X[:3, 3])]
            p, v = solved(R, away), solved(R, v)
        return p, v

    def chords(self, p, v) -> list[tuple[Fraction, Fraction]]:
        """(first t, last t) of every cell that the line p + t v meets."""
        found = []
        for cell in self.cells:
            first, last, misses = None, None, False
            for k in range(3):
                low, high = self.plane(k, cell[k]), self.plane(k, cell[k] + 1)
                if v[k] == 0:
                    misses |= not low <= p[k] <= high
                    continue
                a, b = sorted([(low - p[k]) / v[k], (high - p[k]) / v[k]])
                first, last = a if first is None else max(first, a), b if last is None else min(last, b)
            if not misses and first <= last:
                found.append((first, last))
        return sorted(found)

    def is_inside(self, p) -> bool:
        """Whether a place and all that is next to it lies in cells: of all ways off the place a little."""
        indices = [[], [], []]
        for k in range(3):
            j = int(np.floor(float((p[k] - Fraction(self.shift[k])) / Fraction(self.side[k]))))
            indices[k] = [i for i in (j - 1, j, j + 1) if self.plane(k, i) <= p[k] <= self.plane(k, i + 1)]
        return all(cell in self.cells for cell in product(*indices))


def solved(R, b) -> list[Fraction]:
    """x with R x = b, by Cramer's rule."""
    def det(m):
        return sum(m[0][i] * (m[1][i - 2] * m[2][i - 1] - m[1][i - 1] * m[2][i - 2]) for i in range(3))

    return [det([[b[i] if j == k else R[i][j] for j in range(3)] for i in range(3)]) / det(R) for k in range(3)]


def stretches(chords) -> list[list[Fraction]]:
    """Chords that touch or overlap as one."""
    joined: list[list[Fraction]] = []
    for first, last in chords:
        if joined and first <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], last)
        else:
            joined.append([first, last])
    return joined


def walls(chords) -> list[Fraction]:
    """Ends of stretches from t = 0 on."""
    return [t for ends in stretches(chords) for t in dict.fromkeys(ends) if t >= 0]


def exact(vector) -> list[Fraction]:
    return [Fraction(float(x)) for x in vector]


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_rays_meet_the_surface_of_the_union(seed):
    """From cells, from beside and from afar; a ray meets edges of cells with probability 0."""
    rng, asked, inside, passed = np.random.default_rng([3, seed]), 0, 0, 0
    for case in range(12):
        grid, X = random_grid(rng, 4), random_pose(rng, 0.5)
        by_hand, cells = GridByHand(grid, X), grid.cells
        middles = cells[rng.integers(len(cells), size=12)] + rng.uniform(0.05, 0.95, (12, 3))
        middles[8:] += rng.normal(size=(4, 3)) * 4.0
        places = X @ (grid.X @ np.column_stack([middles * grid.cell, np.ones(12)]).T)
        origins, directions, limit = places[:3].T, rng.normal(size=(12, 3)), float(rng.choice([np.inf, 0.3]))
        every = collide.raycast(grid, X, origins, directions, all_hits=True, max_distance=limit)
        first = collide.raycast(grid, X, origins, directions, max_distance=limit)
        for k in range(12):
            chords = by_hand.chords(*by_hand.in_frame(exact(origins[k]), exact(directions[k])))
            want = [t for t in walls(chords) if t <= limit]
            rows, named = slice(every.starts[k], every.starts[k + 1]), (seed, case, k)
            assert len(every.distance[rows]) == len(want), named
            assert every.certified[rows].all() and first.certified[k], named
            for t, lower, upper in zip(want, every.lower[rows].tolist(), every.upper[rows].tolist()):
                assert Fraction(lower) <= t <= Fraction(upper), named
            assert first.hit[k] == (len(want) > 0), named
            if want:
                assert Fraction(float(first.lower[k])) <= want[0] <= Fraction(float(first.upper[k])), named
                assert first.distance[k] == pytest.approx(float(want[0]), rel=1e-9, abs=1e-12), named
            single = collide.raycast(grid, X, origins[k], directions[k], max_distance=limit)
            assert single.distance == first.distance[k] and np.array_equal(single.normal, first.normal[k]), named
            begins = any(a <= 0 <= b for a, b in chords)
            asked, inside = asked + 1, inside + begins
            passed += begins and bool(want) and sum(0 < b <= want[0] for _, b in chords) > 1
    assert 0.4 * asked < inside < 0.95 * asked and passed > 0.1 * asked, (asked, inside, passed)


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(2))
def test_rays_through_edges_and_along_faces(seed):
    """Multiples of an eighth, or next to them: all ends of stretches are met, and nothing inside the union; as of one
    box, where cells fill a box."""
    rng, met, kept = np.random.default_rng([4, seed]), 0, 0
    for case in range(300):
        shape, is_full = rng.integers(1, 4, 3), case % 3 == 0
        occupied = np.ones(shape, dtype=bool) if is_full else rng.random(shape) < 0.6
        occupied.flat[0] = True
        grid, X = collide.VoxelGrid(occupied, 0.25), collide.pose(rng.integers(-4, 5, 3) / 8)
        origin = X[:3, 3] + [int(rng.integers(-2, 2 * n + 3)) / 8 for n in shape]
        direction = rng.integers(-1, 2, 3) * rng.integers(1, 3, 3) * 1.0
        if not direction.any():
            continue
        origin += np.where(direction == 0.0, rng.choice((0.0, 0.0, -1e-14, 1e-14), 3), 0.0)  # next to a plane of cells
        by_hand = GridByHand(grid, X)
        p, v = by_hand.in_frame(exact(origin), exact(direction))
        chords = by_hand.chords(p, v)
        every = collide.raycast(grid, X, origin, direction, all_hits=True)
        times = {Fraction(t) for t in every.distance.tolist()}
        named = (seed, case, origin.tolist(), direction.tolist(), occupied.tolist())
        near = {t for t in times if any(abs(t - w) < 1e-9 for w in walls(chords))}
        assert all(any(abs(t - w) < 1e-9 for t in times) for w in walls(chords)), named
        for t in {Fraction(round(float(t) * 240)) / 240 for t in times - near}:  # all t here are such multiples
            assert not by_hand.is_inside([a + t * b for a, b in zip(p, v)]), named
        first = collide.raycast(grid, X, origin, direction)
        assert first.hit == bool(times), named
        assert not times or first.distance == pytest.approx(float(min(times)), abs=1e-9), named
        if is_full:
            box = collide.Compound([(collide.Box(0.25 * shape), collide.pose(0.125 * shape))])
            whole = collide.raycast(box, X, origin, direction, all_hits=True)
            assert sorted({round(float(t), 9) for t in times}) == sorted({round(float(t), 9) for t in whole.distance})
        met, kept = met + len(times), kept + len(times - near)
    assert met > 70 and kept >= 1, (met, kept)


def test_no_rays_at_fields():
    none = np.zeros((0, 3))
    mesh = collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1))))
    for field in (collide.VoxelGrid([(0, 0, 0)], 1.0), collide.PointCloud([(0, 0, 0)]), collide.SweptMesh(mesh, 0.1)):
        assert len(collide.raycast(field, EYE, none, none).hit) == 0
        assert collide.raycast(field, EYE, none, none, all_hits=True).starts.tolist() == [0]
