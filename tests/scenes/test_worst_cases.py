"""Harpsicordia, accordions and Chazelle's polyhedra: valid, as local as they say, and as slow as is proven."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
import surfaces

import collide
from collide.adapters.peers import exact
from collide.errors import SceneError
from collide.scenes import generate
from collide.scenes.worst_cases import accordion, below, chazelle, harpsicordia, harpsicordion

EYE, ORIGIN = np.eye(3), np.zeros(3)
SMALL = {
    "harpsicordion": harpsicordion(3, 6.0),
    "one string": harpsicordion(1, 20.0),
    "wide harpsicordion": harpsicordion(2, 100.0),
    "accordion": accordion(3),
    "chazelle": chazelle(3),
}


def meet(a, b, shift=ORIGIN) -> bool:
    """Whether the hulls of a few points meet, b shifted; exact."""
    return exact.hit(np.array(a), EYE, ORIGIN, np.array(b), EYE, np.asarray(shift, dtype=float))


def boxes(mesh) -> tuple[np.ndarray, np.ndarray]:
    corners = mesh.vertices[mesh.faces]
    return corners.min(axis=1), corners.max(axis=1)


def near_pairs(A, B, shift=ORIGIN):
    """Facets of two meshes whose boxes meet."""
    (low_a, high_a), (low_b, high_b) = boxes(A), boxes(B)
    together = (low_a[:, None] <= high_b + shift).all(axis=2) & (low_b + shift <= high_a[:, None]).all(axis=2)
    return np.argwhere(together).tolist()


def cross_beyond(points, f, g) -> bool:
    """Whether two facets of a mesh share a point besides their common corners and edges; exact.

    From a shared corner, a common part reaches the opposite edge of one of them. From a shared edge it lies
    in one plane, and the other corners on one side.
    """
    shared = set(f) & set(g)
    if not shared:
        return meet(points[list(f)], points[list(g)])
    if len(shared) == 1:
        sides = [[v for v in t if v not in shared] for t in (f, g)]
        return meet(points[sides[0]], points[list(g)]) or meet(points[sides[1]], points[list(f)])
    (c,), (d,) = (set(f) - shared, set(g) - shared)
    a, b = sorted(shared)
    return (
        meet(points[[a, c]], points[[b, d]])
        or meet(points[[b, c]], points[[a, d]])
        or meet(points[[c]], points[list(g)])
        or meet(points[[d]], points[list(f)])
    )


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize("name", SMALL)
def test_closed_oriented_and_not_crossing_itself(name, side):
    mesh = SMALL[name] if side == "above" else below(SMALL[name])
    report = mesh.report
    assert mesh.solid and not report.defects and report.euler == 2 and report.shells == 1 and report.volume > 0
    faces = mesh.faces.tolist()
    tested = 0
    for f, g in near_pairs(mesh, mesh):
        if f < g:
            tested += 1
            assert not cross_beyond(mesh.vertices, faces[f], faces[g]), f"facets {f} and {g} of the {name}"
    assert tested > len(faces)


def test_crossings_would_be_found():
    """A corner pushed through the opposite side; a facet folded onto its neighbour; two that only touch in a corner."""
    vertices, faces = surfaces.box()
    pushed = vertices.copy()
    pushed[0] = (1.5, 0.5, 0.4)
    found = [(f, g) for f, g in itertools.combinations(faces.tolist(), 2) if cross_beyond(pushed, f, g)]
    assert found and not any(cross_beyond(vertices, f, g) for f, g in itertools.combinations(faces.tolist(), 2))
    points = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0.25, 0.5, 0), (0, 0, 1), (0.25, 0.25, -1)])
    assert cross_beyond(points, [0, 1, 2], [1, 0, 3]) and not cross_beyond(points, [0, 1, 2], [1, 0, 4])
    assert cross_beyond(points, [0, 1, 2], [0, 3, 4]) and not cross_beyond(points, [1, 2, 4], [1, 5, 3])


@pytest.mark.parametrize("name", SMALL)
def test_every_string_meets_every_other_in_one_point(name):
    A, B = SMALL[name], below(SMALL[name])
    strings = {"harpsicordion": 3, "one string": 1, "wide harpsicordion": 2, "accordion": 3, "chazelle": 3}[name]
    met = [pair for pair in near_pairs(A, B) if meet(A.vertices[A.faces[pair[0]]], B.vertices[B.faces[pair[1]]])]
    assert len(met) == (2 * strings) ** 2, "two facets at each string"
    for f, g in met:
        a, b = A.vertices[A.faces[f]], B.vertices[B.faces[g]]
        on_saddle = [t[np.isclose(t[:, 2], t[:, 0] * t[:, 1], rtol=1e-12, atol=0.0)] for t in (a, b)]
        assert all(len(t) == 2 for t in on_saddle) and meet(*on_saddle), "they meet where the strings cross"
    for gap, count in ((2.0**-40, 0), (-(2.0**-40), None)):
        lifted = [
            p
            for p in near_pairs(B, A, (0, 0, gap))
            if meet(B.vertices[B.faces[p[0]]], A.vertices[A.faces[p[1]]], (0, 0, gap))
        ]
        assert len(lifted) == count if count is not None else len(lifted) >= (2 * strings) ** 2


def test_strings_lie_on_the_saddle_exactly():
    for mesh, strings in ((harpsicordion(40, 20.0), 40), (accordion(33), 33), (chazelle(20), 20)):
        exactly = [p for p in mesh.vertices.tolist() if Fraction(p[2]) == Fraction(p[0]) * Fraction(p[1])]
        assert len(exactly) >= 2 * strings, "both ends of every string"
        assert (
            len({x for x, y, _ in exactly if y > 0}) >= strings and len({x for x, y, _ in exactly if y < 0}) >= strings
        )


@pytest.mark.parametrize(("strings", "stretch"), [(2, 6.0), (5, 6.0), (20, 8.0), (30, 10.0), (60, 25.0), (100, 100.0)])
def test_a_harpsicordion_is_as_local_as_it_says(strings, stretch):
    mesh = harpsicordion(strings, stretch)
    assert (len(mesh.vertices), len(mesh.faces)) == (7 * strings + 3, 14 * strings + 2)
    found = mesh.locality()
    assert found.local_stretches[0] == pytest.approx(stretch, rel=1e-5)
    expected = 1.75 / math.hypot(11 / 32, 3 / 16) * (stretch / (stretch - 2)) ** strings
    assert found.global_stretch == pytest.approx(expected, rel=2e-3)


def test_many_harpsicordia_keep_their_stretches():
    for n, stretch, spread in ((300, 6.0, None), (3000, 12.0, None), (5000, 20.0, 40.0)):
        A, B, meetings = harpsicordia(n, stretch, spread)
        for mesh in (A, B):
            found = mesh.locality()
            assert found.local_stretches[0] == pytest.approx(stretch, rel=1e-5)
            assert found.global_stretch <= (spread or n) and 0.8 * n <= len(mesh.vertices) <= n
            assert mesh.solid and not mesh.report.defects
        strings = round(math.sqrt(meetings / A.report.shells))
        assert meetings == A.report.shells * strings**2 and A.report.shells * (7 * strings + 3) == len(A.vertices)


def test_an_accordion_is_not_local():
    for strings in (2, 8, 30):
        found = accordion(strings).locality()
        assert 3.5 * strings <= found.local_stretches[0] <= 7 * strings and found.global_stretch < 4.5
    for strings in (5, 20):
        assert chazelle(strings).locality().local_stretches[0] > strings


# --- how slow they are ----------------------------------------------------------------------------


class BoxTree:
    """Boxes around halves, down to single facets; level by level, children of node i are 2i and 2i + 1."""

    def __init__(self, mesh):
        low, high = boxes(mesh)
        self.leaves = 1 << (len(low) - 1).bit_length()
        self.low, self.high = np.full((2 * self.leaves, 3), np.inf), np.full((2 * self.leaves, 3), -np.inf)
        order = self._halved(np.arange(len(low)), (low + high) / 2, self.leaves)
        self.low[self.leaves :][order >= 0] = low[order[order >= 0]]
        self.high[self.leaves :][order >= 0] = high[order[order >= 0]]
        for node in range(self.leaves - 1, 0, -1):
            self.low[node] = self.low[2 * node : 2 * node + 2].min(axis=0)
            self.high[node] = self.high[2 * node : 2 * node + 2].max(axis=0)

    def _halved(self, facets, centres, room):
        if room == 1:
            return facets if len(facets) else np.array([-1])
        if len(facets):
            facets = facets[np.argsort(centres[facets, np.argmax(np.ptp(centres[facets], axis=0))], kind="stable")]
        middle = (len(facets) + 1) // 2
        return np.concatenate([self._halved(half, centres, room // 2) for half in (facets[:middle], facets[middle:])])


def box_pairs(A, B, gap=0.0) -> int:
    """How many pairs of boxes the standard algorithm looks at to tell A, lifted by a gap, from B."""
    s, t = BoxTree(A), BoxTree(B)
    s.low[:, 2] += gap
    s.high[:, 2] += gap
    i = j = np.array([1])
    looked = 0
    while len(i):
        looked += len(i)
        meeting = (s.low[i] <= t.high[j]).all(axis=1) & (t.low[j] <= s.high[i]).all(axis=1)
        i, j = i[meeting], j[meeting]
        down_i, down_j = i < s.leaves, j < t.leaves
        steps = [(2 * i + a if a >= 0 else i, 2 * j + b if b >= 0 else j, keep) for a, b, keep in (
            *((a, b, down_i & down_j) for a in (0, 1) for b in (0, 1)),
            *((a, -1, down_i & ~down_j) for a in (0, 1)), *((-1, b, ~down_i & down_j) for b in (0, 1)),
        )]
        i, j = (np.concatenate([step[k][step[2]] for step in steps]) for k in (0, 1))
    return looked


@pytest.mark.slow
def test_box_pairs_of_local_meshes_grow_like_n_log_n():
    sizes = (250, 500, 1000, 2000, 4000, 8000)
    looked, meetings = [], []
    for n in sizes:
        A, B, met = harpsicordia(n, 10.0)
        looked.append(box_pairs(A, B) / (len(A.vertices) * math.log2(len(A.vertices))))
        meetings.append(met / (len(A.vertices) * math.log2(len(A.vertices))))
        assert box_pairs(A, B) >= 4 * met, "every meeting is looked at, from both facets of both strings"
    assert max(looked) < 2 * min(looked), f"not proportional to n log n: {looked}"
    assert max(meetings) < 2 * min(meetings), f"not proportional to n log n: {meetings}"


@pytest.mark.parametrize("make", [accordion, chazelle])
def test_box_pairs_of_others_grow_like_the_square(make):
    looked = []
    for strings in (16, 32, 64, 128):
        A = make(strings)
        looked.append(box_pairs(A, below(A)) / strings**2)
    assert max(looked) < 2 * min(looked) and min(looked) > 4, f"not proportional to n²: {looked}"


def test_being_apart_saves_nothing():
    """Theorem 4.2: the boxes of strings that pass each other meet."""
    for A, B in (
        harpsicordia(2000, 10.0)[:2],
        (accordion(64), below(accordion(64))),
        (chazelle(64), below(chazelle(64))),
    ):
        assert box_pairs(A, B, 1e-12) > 0.95 * box_pairs(A, B)


# --- as scenes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "size"), [("harpsicordia", {"n": 200}), ("accordions", {"strings": 5}), ("chazelle", {"strings": 5})]
)
def test_generated_scenes(name, size):
    scene = generate(name, seed=3, gap=0.25, **size)
    upper, lower = scene.bodies
    assert isinstance(upper.shape, collide.Mesh) and upper.shape.solid and lower.shape.solid
    assert upper.X_WB[2, 3] == 0.25 and np.array_equal(lower.X_WB, np.eye(4))
    assert "0.25 m apart at" in scene.notes[0]
    other = generate(name, seed=4, **size).bodies[0].shape
    assert other != upper.shape and sorted(other.vertices.tolist()) == sorted(upper.shape.vertices.tolist())


def test_numbers_that_make_none():
    for ask in (
        lambda: harpsicordion(0), lambda: harpsicordion(3, 5.0), lambda: harpsicordion(3, math.nan),
        lambda: harpsicordion(2000, 6.0),
        lambda: accordion(True), lambda: chazelle("many"), lambda: harpsicordia(1000, 10.0, math.inf),
        lambda: harpsicordia(1000, 10.0, -1.0), lambda: harpsicordia(10**6, 10.0, 1e15),
    ):
        with pytest.raises(SceneError):
            ask()


def test_sizes_of_every_kind_close():
    for strings, stretch in itertools.product((1, 2, 3, 4, 5, 8, 9, 31), (6.0, 7.5, 1000.0)):
        assert not harpsicordion(strings, stretch).report.defects
    for strings in range(1, 12):
        assert not accordion(strings).report.defects and not chazelle(strings).report.defects
