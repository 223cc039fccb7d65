"""The filter before the exact stage: every end it comes to is that of integers, its simplex and its rounds, too."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, Case, hull_points, pose, random_pose, rng_of, with_gap
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.epa.origin_foot import nearest_of_triangle
from collide.narrowphase.exact import filtered_gjk as F
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, gap_of_face, touch_exactly
from collide.narrowphase.exact.exact_workspace import INTEGERS
from collide.narrowphase.exact.plane_depth import depth_of_facet, nearest_plane
from collide.numerics.bounded import Bounded, BoundedVec3
from collide.numerics.vec3 import Vec3, norm
from collide.scenes.families import generate

pytestmark = pytest.mark.plain_kernels


def box(rng, *, dyadic: bool) -> collide.ConvexHull:
    half = rng.integers(1, 17, 3) / 16.0 if dyadic else np.round(rng.uniform(0.05, 1.0, 3), 2)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return collide.ConvexHull(signs * half)


def stacked(rng, turn_a, turn_b, *, dyadic: bool) -> Case:
    """Boxes one on the other as a user writes it down, both turned after that."""
    A, B = box(rng, dyadic=dyadic), box(rng, dyadic=dyadic)
    height = A.points[:, 2].max() + B.points[:, 2].max()
    shift = np.array([*np.round(rng.uniform(-0.5, 0.5, 2), 2), height]) if not dyadic else (0.125, -0.25, height)
    return Case(A, B, pose(turn_a), pose(turn_b, turn_a @ shift))


def dyadic_case(rng) -> Case:
    return stacked(rng, np.eye(3), np.eye(3), dyadic=True)


def decimal_case(rng) -> Case:
    return stacked(rng, np.eye(3), np.eye(3), dyadic=False)


def tilted_case(rng) -> Case:
    turn = random_pose(rng)[:3, :3]
    return stacked(rng, turn, turn, dyadic=False)


def turned_case(rng) -> Case:
    """Both tilted, one also turned about the normal of the faces."""
    turn, angle = random_pose(rng)[:3, :3], rng.uniform(0.0, 6.0)
    c, s = math.cos(angle), math.sin(angle)
    return stacked(rng, turn, turn @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), dyadic=False)


def lattice_case(rng) -> Case:
    A, B = (collide.ConvexHull(rng.integers(-2, 3, size=(int(rng.integers(4, 8)), 3)) * 0.5) for _ in range(2))
    turns = [LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
    return Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-3, 4, 3) * 0.5))


def near_case(rng) -> Case:
    A, B = (collide.ConvexHull(hull_points(rng, int(rng.integers(4, 9)))) for _ in range(2))
    case = with_gap(Case(A, B, random_pose(rng), random_pose(rng)), 0.0)
    return case.with_b_moved(rng.integers(-2, 3, 3) * 2.0**-52)


#: Kinds of pairs, and what part of the searches at least need no integers for their end.
KINDS = {
    dyadic_case: 0.4, decimal_case: 0.7, tilted_case: 0.7, turned_case: 0.9, lattice_case: 0.9, near_case: 0.6,
}


def begun(bodies: PosedBodies, rng, tries: int) -> list[int]:
    """Three vertex pairs to begin with: of as many triples as told, the one nearest to the origin in doubles."""
    difference = {pair: Vec3(*map(float, point)) for pair, point in bodies.difference().items()}
    pairs = sorted(difference, key=lambda pair: norm(difference[pair]))[:12]
    triples = [[pairs[k] for k in rng.choice(len(pairs), 3, replace=False)] for _ in range(tries)]

    def distance(triple) -> float:
        return nearest_of_triangle(*(difference[pair] for pair in triple), Vec3(0.0, 0.0, 0.0)).distance

    return [k for pair in min(triples, key=distance) for k in pair] + [0] * 10


@pytest.mark.many(3)
@pytest.mark.parametrize("draw", KINDS, ids=lambda draw: draw.__name__)
def test_the_same_search_as_in_integers(draw):
    rng = rng_of("filtered", draw.__name__)
    seen = Counter()
    for _ in range(8):
        case = draw(rng)
        bodies = PosedBodies(*case)
        assert F.is_filtered(bodies.ordered), case
        for tries in (1, 20, 20):
            start = begun(bodies, rng, tries)
            ids, theirs = list(start), list(start)
            found = F.search_filtered(bodies.ordered, ids, np.zeros(F.DOUBLES))
            terms, digits = bodies.poses.terms.ravel(), np.zeros(INTEGERS, dtype=np.int64)
            exact = touch_exactly(bodies.ordered, terms, digits, False, theirs, 3, 0.0, 0.0)
            seen[("open", "meet", "apart")[found.end]] += 1
            if found.end == F.OPEN:
                assert ids[:6] == start[:6], f"{case!r} from {start}"
                continue
            expected = {F.MEET: TOUCHING, F.APART: SEPARATE}[found.end]
            told = f"{case!r} from {start}: {found}, {ids}; {exact}, {theirs}"
            assert (expected, found.n, found.rounds) == (exact.verdict, exact.n, exact.rounds), told
            assert ids[: 2 * found.n] == theirs[: 2 * exact.n], told
            if found.end == F.APART and found.n == 3:
                seen["faces"] += 1
                gap = gap_of_face(bodies.ordered, terms, digits, ids, found.rounds)
                assert gap._replace(excess=exact.excess) == exact, told
                off = (gap.excess.high - exact.excess.high) + (gap.excess.low - exact.excess.low)
                assert abs(off) <= 2.0**-74 * exact.excess.high, told
    assert seen["meet"] + seen["apart"] >= KINDS[draw] * 24, seen


def near_planes(rng) -> np.ndarray:
    """Four points, each a sum of two doubles, the origin near the plane or an edge of the first three; now and then all
    are points near the origin, as good as their errors."""
    points = rng.normal(size=(4, 3)) * 2.0 ** rng.integers(-3, 4, size=(4, 1))
    shares = rng.dirichlet(np.ones(3)) * rng.choice((0.0, 1.0), 3, p=(0.2, 0.8))
    shares /= max(shares.sum(), 1.0)
    points -= shares @ points[:3] * (1.0 + rng.choice((0.0, 2.0**-52, 2.0**-30)))
    points[3] = points[:3].mean(axis=0) + rng.normal(size=3) * 2.0 ** float(rng.integers(-70, 2))
    return points * (2.0**-52 if rng.random() < 0.1 else 1.0)


def test_signs_in_doubles_are_those_of_fractions():
    """Each end of each sign, of points off by some error: where it says anything, all points within the error agree."""
    rng = rng_of("signs in doubles")
    seen = Counter()
    for _ in range(600):
        error = float(rng.choice((0.0, 2.0**-105, 2.0**-90)))
        stored, exact = np.zeros(F.DOUBLES), []
        for k, point in enumerate(near_planes(rng)):
            low = point * 2.0**-54 * rng.uniform(-1.0, 1.0, 3)
            stored[9 * k : 9 * k + 9] = np.column_stack([point, low, np.full(3, error)]).ravel()
            off = rng.uniform(-1.0, 1.0, 3) * error
            exact.append([sum(map(Fraction, map(float, parts))) for parts in zip(point, low, off)])
        p, q, r, apex = exact
        normal = crossed(minus(q, p), minus(r, q))
        deltas = [inner(normal, crossed(q, r)), inner(normal, crossed(r, p)), inner(normal, crossed(p, q))]
        has_foot = F._has_foot(stored, 0, 1, 2)
        assert not has_foot or min(deltas) > 0, stored
        seen["foot"] += has_foot
        seen["no foot"] += not has_foot
        edge = np.array([float(x) for x in minus(p, q)])
        d = rng.normal(size=3)
        d -= (d @ edge) / (edge @ edge) * edge * (1.0 + rng.choice((0.0, 2.0**-45)))
        side = F._side_of_difference(BoundedVec3(*(Bounded(float(x), 0.0, 0.0) for x in d)), stored, 0, 1)
        product = inner([Fraction(float(x)) for x in d], minus(p, q))
        assert side == F.UNKNOWN or side == (product > 0) - (product < 0), stored
        seen["side unknown" if side == F.UNKNOWN else "side"] += 1
        beyond = F._is_beyond(stored, 0, 1, 2)
        across = crossed(minus(p, apex), minus(q, apex))
        origin, third = -inner(across, apex), inner(across, minus(r, apex))
        assert beyond == 8 or beyond == ((origin > 0) != (third > 0)), stored
        seen["in a plane" if beyond == 8 else "beyond" if beyond else "not beyond"] += 1
    assert min(seen[k] for k in ("foot", "no foot", "side", "beyond", "not beyond", "in a plane")) > 8, seen


def minus(a: list, b: list) -> list:
    return [x - y for x, y in zip(a, b)]


def inner(a: list, b: list) -> Fraction:
    return sum(x * y for x, y in zip(a, b))


def crossed(a: list, b: list) -> list:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


@pytest.mark.parametrize("draw", [dyadic_case, tilted_case], ids=lambda draw: draw.__name__)
def test_the_same_depths_as_in_integers(draw):
    """Facets that are nearest, and some that are not."""
    rng = rng_of("filtered depths", draw.__name__)
    seen = Counter()
    for _ in range(25):
        bodies = PosedBodies(*draw(rng))
        difference = bodies.difference()
        pairs = sorted(difference, key=lambda pair: sum(float(x) ** 2 for x in difference[pair]))
        for _ in range(6):
            chosen = [pairs[k] for k in rng.integers(0, min(8, len(pairs)), 3)]
            request = [0, 1, 1, *(k for pair in chosen for k in pair)]
            terms, digits = bodies.poses.terms.ravel(), np.zeros(INTEGERS, dtype=np.int64)
            side = F.side_of_facets(bodies.ordered, request, 1, np.zeros(F.DOUBLES))
            exact = nearest_plane(bodies.ordered, terms, digits, request, 1)
            told = f"{bodies.shapes}, {bodies.X}, {request}: {side}, {exact}"
            if side == F.THROUGH_ORIGIN:
                assert exact.proven and exact.depth == (0.0, 0.0), told
            if side == F.OUTERMOST:
                assert exact == depth_of_facet(bodies.ordered, terms, digits, request, 1), told
            seen[("nothing", "through the origin", "outermost")[side]] += 1
            seen["lost"] += side == F.NOTHING and exact.proven
    proven = seen["through the origin"] + seen["outermost"]
    assert proven > 5 and seen["nothing"] > 5, seen
    assert seen["lost"] <= proven, seen


def test_an_edge_whose_last_sign_is_open_leaves_the_first_simplex_to_integers():
    """Two boxes edge to edge: begun from another simplex, integers ended at another of the level edges."""
    case = generate("box_lattice", 78, 77)[77]
    bodies = PosedBodies(*case.shapes())
    ids = [6, 1, 2, 0, 7, 0, *[0] * 10]
    assert F.search_filtered(bodies.ordered, ids, np.zeros(F.DOUBLES)).end == F.OPEN
    assert ids[:6] == [6, 1, 2, 0, 7, 0]


@pytest.mark.parametrize(
    ("A", "X_WB"),
    [
        (collide.Box((1.0, 1.0, 1.0)), pose(t=(0.0, 0.0, 2.0**-70))),  # products of four such bits would vanish
        (collide.ConvexHull(np.eye(3) * 2.0**-110), pose()),
        (collide.Box((2.0**61, 1.0, 1.0)), pose()),
    ],
    ids=["an entry of a pose", "a vertex", "a size"],
)
def test_what_might_underflow_or_overflow_is_left_to_integers(A, X_WB):
    assert not F.is_filtered(PosedBodies(A, A, pose(), X_WB).ordered)


def test_poses_that_are_products_are_left_to_integers():
    part = collide.Compound([(collide.Box((1.0, 1.0, 1.0)), random_pose(rng_of("products")))])
    assert not F.is_filtered(PosedBodies(part, part, random_pose(rng_of("a")), random_pose(rng_of("b"))).ordered)
