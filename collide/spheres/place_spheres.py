"""Places for few spheres, with a union that exceeds a body by little: proposals, by samples.

A ball around c exceeds the body by e at most if its radius is e − s(c), s the signed distance of c: negative, and
large, in the middle of the body. To cover points p by n balls is a k-centre problem with the distance |p − c| + s(c):
the greatest over p of the least over balls is the excess. Candidates for centres are places on the medial axis and a
grid; a greedy cover gives a start, made better by moves of single centres and swaps of spheres.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from collide.spheres.body_facets import Reach, surface_samples

#: Samples of the surface, rays towards the medial axis, and points of the grid.
_N_SURFACE, _N_RAYS, _N_GRID = 1200, 350, 900
#: Rounds of moves at most, for many spheres, and how small the last steps are, in parts of the body's size.
_ROUNDS, _MIN_ROUNDS, _LAST_STEP = 40, 12, 5e-4
_HALVINGS = 12
#: So many spheres are placed from half as many, too.
_MAX_HALVED = 64


class Placement(NamedTuple):
    """Centres (n, 3), how far each is from the body (n,), negative inside, and the excess that the samples need."""

    centers: np.ndarray
    reaches: np.ndarray
    excess: float


class Samples(NamedTuple):
    """What is to be covered, and where centres may go.

    points : (m, 3) of the body.   centers, reaches : (c, 3), (c,) candidates.   needs : (c, m) |p − c| + s(c).
    size : the longest side of the body's box.
    """

    points: np.ndarray
    centers: np.ndarray
    reaches: np.ndarray
    needs: np.ndarray
    size: float


def sampled(reach: Reach, scale: int = 1) -> Samples:
    """Samples of a body: of its surface, its inside, and candidates. ``scale`` times as many."""
    corners = np.concatenate([part.corners for part in reach.parts])
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    surface, vectors = surface_samples(corners, _N_SURFACE * scale)
    grid = _grid(low, high, _N_GRID * scale)
    heights = reach(grid)
    extremes = _extreme_corners(corners.reshape(-1, 3))
    solid = any(part.solid for part in reach.parts)
    inside = grid[heights < 0.0][::3] if solid else grid[:0]
    points = np.concatenate([surface, extremes, inside])
    medial = _medial_centers(reach, surface, vectors, _N_RAYS * scale, float((high - low).max()))
    near = grid[heights < 0.2 * (high - low).max()]
    centers = np.concatenate([medial, near])
    reaches = np.concatenate([reach(medial), heights[heights < 0.2 * (high - low).max()]])
    return Samples(points, centers, reaches, _needs(points, centers, reaches), float((high - low).max()))


def _grid(low: np.ndarray, high: np.ndarray, n: int) -> np.ndarray:
    """About n points of a grid in a box."""
    sides = np.maximum(high - low, 1e-3 * max(float((high - low).max()), np.finfo(float).tiny))
    step = (sides.prod() / n) ** (1 / 3)
    counts = np.maximum(np.rint(sides / step), 1).astype(int)
    axes = [a + (b - a) * (np.arange(k) + 0.5) / k for a, b, k in zip(low, high, counts)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _extreme_corners(vertices: np.ndarray) -> np.ndarray:
    """The vertices farthest along directions spread over the sphere."""
    k = np.arange(192) + 0.5
    z, angle = 1.0 - 2.0 * k / 192, k * np.pi * (3.0 - 5.0**0.5)
    across = np.sqrt(1.0 - z * z)
    directions = np.column_stack([across * np.cos(angle), across * np.sin(angle), z])
    return vertices[np.unique((vertices @ directions.T).argmax(axis=0))]


def _medial_centers(reach: Reach, surface: np.ndarray, vectors: np.ndarray, n: int, size: float) -> np.ndarray:
    """Centres of the largest balls inside the body touching samples of its surface, by bisection."""
    rows = np.linspace(0, len(surface) - 1, min(n, len(surface))).astype(int)
    lengths = np.sqrt(np.square(vectors[rows]).sum(axis=1))
    inward = -vectors[rows] / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    inward[reach(surface[rows] + 1e-3 * size * inward) > 0.0] *= -1.0  # of a surface turned over
    low, high = np.zeros(len(rows)), np.full(len(rows), size)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        touches = reach(surface[rows] + middle[:, None] * inward) + middle <= 2e-3 * size
        low, high = np.where(touches, middle, low), np.where(touches, high, middle)
    return surface[rows] + low[:, None] * inward


def _needs(points: np.ndarray, centers: np.ndarray, reaches: np.ndarray) -> np.ndarray:
    """(c, m) the excess of a ball around each centre to each point."""
    middle = points.mean(axis=0)
    p, c = points - middle, centers - middle
    squares = np.square(c).sum(axis=1)[:, None] + np.square(p).sum(axis=1) - 2.0 * c @ p.T
    return np.sqrt(np.maximum(squares, 0.0)) + reaches[:, None]


# --- starts -------------------------------------------------------------------------------------


def greedy_cover(samples: Samples, excess: float, limit: int) -> list[int] | None:
    """Candidates with balls of an excess around all samples, the ball of most new samples first; ``None`` over a limit.
    """
    covers = samples.needs <= excess
    missing, gains = np.ones(covers.shape[1], dtype=bool), covers.sum(axis=1)
    rows: list[int] = []
    while missing.any():
        best = int(gains.argmax())
        if gains[best] == 0 or len(rows) == limit:
            return None
        rows.append(best)
        new = np.flatnonzero(missing & covers[best])
        gains = gains - covers[:, new].sum(axis=1)
        missing[new] = False
    return rows


def start_of(samples: Samples, count: int) -> Placement:
    """A greedy cover of at most ``count`` balls, its excess bisected."""
    rows = [int(samples.needs.max(axis=1).argmin())]
    low, high = 0.0, float(samples.needs[rows[0]].max())
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        cover = greedy_cover(samples, middle, count)
        if cover is None:
            low = middle
        else:
            rows, high = cover, middle
    while len(rows) < count:  # spheres to spare go where the excess is
        rows.append(_best_row(samples, samples.needs[rows].min(axis=0)))
    return placement_of(samples, rows)


def placement_of(samples: Samples, rows: list[int]) -> Placement:
    """Candidates as a placement."""
    return _placement(samples, samples.centers[rows], samples.reaches[rows])


def _placement(samples: Samples, centers: np.ndarray, reaches: np.ndarray) -> Placement:
    return Placement(centers, reaches, float(_needs(samples.points, centers, reaches).min(axis=0).max()))


def with_points(samples: Samples, points: np.ndarray) -> Samples:
    """The same with more points to cover."""
    needs = _needs(points, samples.centers, samples.reaches)
    return samples._replace(
        points=np.concatenate([samples.points, points]), needs=np.concatenate([samples.needs, needs], axis=1)
    )


def best_addition(samples: Samples, place: Placement) -> Placement:
    """A sphere more, where the excess is."""
    row = _best_row(samples, _needs(samples.points, place.centers, place.reaches).min(axis=0))
    centers = np.vstack([place.centers, samples.centers[row]])
    return _placement(samples, centers, np.append(place.reaches, samples.reaches[row]))


def _best_row(samples: Samples, needs: np.ndarray) -> int:
    """The candidate best for the samples in most need, beside balls with ``needs`` (m,) for the samples."""
    worst = np.argsort(-needs)[: max(8, len(needs) // 40)]
    relieved = np.minimum(samples.needs[:, worst], needs[worst])
    order = np.lexsort((relieved.sum(axis=1), relieved.max(axis=1)))
    return int(order[0])


# --- better places ------------------------------------------------------------------------------


def moved_centers(reach: Reach, samples: Samples, start: Placement, rng: np.random.Generator) -> Placement:
    """Moves of single centres, each towards less excess of the samples it serves, steps halved where no move helps."""
    centers, reaches = start.centers.copy(), start.reaches.copy()
    needs = _needs(samples.points, centers, reaches)
    best, steps = start, np.full(len(centers), 0.08 * samples.size)
    for _ in range(max(_MIN_ROUNDS, min(_ROUNDS, 800 // len(centers)))):
        active = np.flatnonzero(steps > _LAST_STEP * samples.size)
        moved = _move(reach, samples, (centers, reaches, steps), needs.argmin(axis=0), active, rng)
        needs[moved] = _needs(samples.points, centers[moved], reaches[moved])
        excess = float(needs.min(axis=0).max())
        if excess < best.excess:
            best = Placement(centers.copy(), reaches.copy(), excess)
        if not len(active):
            break
    return best


def _move(reach: Reach, samples: Samples, state, owner: np.ndarray, active: np.ndarray, rng) -> list[int]:
    """A step of each active centre, in place; gives the centres that moved."""
    centers, reaches, steps = state
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    directions = np.concatenate([rotation, -rotation, np.array([[1.0] * 3, [-1.0] * 3]) / 3**0.5 @ rotation])
    order = np.argsort(owner, kind="stable")
    ends = np.searchsorted(owner[order], np.arange(len(centers) + 1))
    served, trials = [], []
    for k in active.tolist():
        points = samples.points[order[ends[k] : ends[k + 1]]]
        if not len(points):
            steps[k] = 0.0
            continue
        away = points - centers[k]
        far = away[np.square(away).sum(axis=1).argmax()]
        ahead = far / max(float(np.sqrt(far @ far)), np.finfo(float).tiny)
        served.append((k, points))
        trials.append(centers[k] + steps[k] * np.concatenate([directions, [ahead, 0.5 * ahead, -ahead]]))
    if not served:
        return []
    heights, moved = reach(np.concatenate(trials)).reshape(len(trials), -1), []
    for (k, points), places, high in zip(served, trials, heights):
        needs = _needs(points, np.vstack([centers[k], places]), np.append(reaches[k], high)).max(axis=1)
        j = int(needs.argmin())
        if j and needs[j] < needs[0] * (1 - 1e-4):
            centers[k], reaches[k] = places[j - 1], high[j - 1]
            moved.append(k)
        else:
            steps[k] *= 0.5
    return moved


def _missed(needs: np.ndarray) -> np.ndarray:
    """(k,) the excess of the samples of each sphere without it, of needs (k, m), k ≥ 2."""
    owner, two = needs.argmin(axis=0), np.partition(needs, 1, axis=0)[:2]
    return np.array([np.where(owner == k, two[1], two[0]).max() for k in range(len(needs))])


def without_least_missed(samples: Samples, place: Placement) -> Placement:
    """A sphere fewer, of two or more."""
    k = int(_missed(_needs(samples.points, place.centers, place.reaches)).argmin())
    return _placement(samples, np.delete(place.centers, k, axis=0), np.delete(place.reaches, k))


def swapped(samples: Samples, place: Placement, rank: int) -> Placement:
    """A sphere taken away, the rank-th least missed of two or more, and put where the excess is."""
    needs = _needs(samples.points, place.centers, place.reaches)
    k = int(np.argsort(_missed(needs))[rank % len(needs)])
    row = _best_row(samples, np.delete(needs, k, axis=0).min(axis=0))
    centers, reaches = place.centers.copy(), place.reaches.copy()
    centers[k], reaches[k] = samples.centers[row], samples.reaches[row]
    return _placement(samples, centers, reaches)


def placements(reach: Reach, samples: Samples, count: int) -> Iterator[Placement]:
    """Good places for ``count`` spheres: from a greedy cover, and from half as many with others added."""
    yield _improved(reach, samples, start_of(samples, count))
    if 1 < count <= _MAX_HALVED:
        place = _improved(reach, samples, start_of(samples, count // 2))
        while len(place.centers) < count:
            place = best_addition(samples, place)
        yield _improved(reach, samples, place)


def _improved(reach: Reach, samples: Samples, start: Placement) -> Placement:
    """Moves and swaps for as long as they help."""
    count = len(start.centers)
    rng = np.random.default_rng(count)
    best = moved_centers(reach, samples, start, rng)
    failures = 0
    while 1 < count and failures < min(count, 5):
        trial = moved_centers(reach, samples, swapped(samples, best, failures), rng)
        failures = 0 if trial.excess < best.excess * 0.995 else failures + 1
        best = min(best, trial, key=lambda place: place.excess)
    return best


def shared_counts(bodies: list[Samples], total: int) -> list[int]:
    """How many of ``total`` spheres each body gets, for a small greatest excess: greedy covers of a bisected excess.

    total : at least the number of bodies.
    """
    low, high = 0.0, max(float(samples.needs.max(axis=1).min()) for samples in bodies)
    counts = [1] * len(bodies)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        covers = [greedy_cover(samples, middle, total) for samples in bodies]
        sizes = [total + 1 if cover is None else len(cover) for cover in covers]
        if sum(sizes) <= total:
            counts, high = sizes, middle
        else:
            low = middle
    return counts
