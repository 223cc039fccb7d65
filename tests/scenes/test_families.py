"""The hard families keep their recipes: seeded, exactly touching where promised, at the gaps promised."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from collide.adapters.peers import exact
from collide.adapters.peers.stress_truth import truth
from collide.errors import InvalidArgument
from collide.scenes.families import HALFSPACE, STANDARD, Case, describe, generate, names
from collide.scenes.families.case import mean_diagonal
from collide.scenes.families.exact_gaps import measure, set_gap
from collide.scenes.families.ingredients import EXACT_ROTATIONS, box, random_hull, rotation
from collide.scenes.families.touching import contact

#: As the study lists them.
RECIPES = [
    "rand_sep", "rand_pen", "near_sep", "near_pen", "touch_vf", "touch_ee", "touch_ff", "touch_vv",
    "touch_ve", "touch_1ulp", "boxes_flush", "boxes_exact", "boxes_rest", "scale", "tiny_vs_huge",
    "far_origin", "needles", "plates", "flat", "degenerate", "spheres_big", "cyl1000", "concentric", "inside",
    "identical", "rot90", "badrot",
]
#: Hundreds of vertices each: fewer cases.
LARGE = ("spheres_big", "cyl1000", "bipyramids", "repeats")


def same(a: Case, b: Case) -> bool:
    return all(np.array_equal(x, y) if isinstance(x, np.ndarray) else x == y for x, y in zip(a, b))


def signed(case: Case) -> float:
    """The exact signed distance, rounded once [m]."""
    return float(truth(case).distance)


def test_the_27_come_first():
    assert sorted(STANDARD) == sorted(RECIPES) and len(set(STANDARD)) == 27
    assert names()[:27] == list(STANDARD) and len(set(names())) == len(names()) > 27


@pytest.mark.many(3)
@pytest.mark.parametrize("name", names())
def test_a_case_depends_on_family_seed_and_index_alone(name):
    n = 2 if name in LARGE else 5
    cases = generate(name, n, 3)
    assert len(cases) == n and [c.index for c in cases] == list(range(n))
    assert all(map(same, cases, generate(name, n, 3)))
    assert all(map(same, cases, generate(name, n - 1, 3)))
    assert not any(map(same, cases, generate(name, n, 4)))


@pytest.mark.many(2)
@pytest.mark.parametrize("name", names())
def test_a_case_is_plain_finite_numbers(name):
    for case in generate(name, 2 if name in LARGE else 10, 5):
        assert case.family == name and case.seed == 5 and case.radius_a >= 0 and case.radius_b >= 0
        for points, R, t in (case.a, case.b):
            assert points.dtype == R.dtype == t.dtype == np.float64
            assert points.ndim == 2 and points.shape[1:] == t.shape == (3,) and R.shape == (3, 3)
            assert np.isfinite(points).all() and np.isfinite(R).all() and np.isfinite(t).all()
            # An engine that checks poses takes them all.
            assert np.abs(R.T @ R - np.eye(3)).max() < 1e-5 and np.linalg.det(R) > 0
        if name in STANDARD:
            assert case.radius_a == case.radius_b == 0 and case.kind == "hulls"
        assert same(case, Case.from_dict(json.loads(json.dumps(case.to_dict(), allow_nan=False))))
    assert len(describe(name)) > 20 and describe(name).endswith(".")


# --- exactly touching ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["vf", "ee", "ff", "vv", "ve"])
def test_a_contact_is_what_its_letters_say(kind):
    rng = np.random.default_rng(2)
    sizes = {"v": (1, 1), "e": (2, 2), "f": (3, 6)}
    for _ in range(40):
        A, B, n = contact(rng, kind)
        assert (A @ n <= 0).all() and (B @ n >= 0).all()
        held = sorted(np.count_nonzero(points @ n == 0) for points in (A, B))
        for count, letter in zip(held, sorted(kind, key="vef".index)):
            assert sizes[letter][0] <= count <= sizes[letter][1]


@pytest.mark.parametrize(
    "name", ["touch_vf", "touch_ee", "touch_ff", "touch_vv", "touch_ve", "boxes_exact", "swept_touch"]
)
def test_touching_is_exact(name):
    cases = generate(name, 80, 11)
    for case in cases:
        found = truth(case)
        assert found.hit and found.distance == 0, case.snippet()
        for R in (case.R1, case.R2):
            assert (EXACT_ROTATIONS == R).all(axis=(1, 2)).any()
        assert all((64 * x == np.round(64 * x)).all() for x in (case.P, case.t1, case.Q, case.t2))
    if name.startswith("touch"):
        doubled = sum(len(np.unique(case.P, axis=0)) < len(case.P) for case in cases)
        assert 3 <= doubled <= 25  # 15 % of 80


def test_one_ulp_decides():
    for case in generate("touch_1ulp", 60, 2):
        assert truth(case).hit == (case.index % 2 == 0)
        assert 0 < abs(signed(case)) <= 2.0**-50
    for case in generate("swept_1ulp", 60, 2):
        assert truth(case).hit == (case.index % 2 == 0) and 0 < abs(signed(case)) < 1e-14
    for case in generate("touch_scaled", 60, 2):
        assert np.sign(signed(case)) == (-1, 1, 0)[case.index % 3]
    for case in generate("touch_tiny_step", 60, 2):
        assert np.sign(signed(case)) == (-1, 1)[case.index % 2] and abs(signed(case)) < 2.0**-54
    for case in generate("halfspace_touch", 60, 2):
        assert np.sign(signed(case)) == (0, -1, 1)[case.index % 3] and abs(signed(case)) <= 2.0**-50
    for case in generate("padded_touch", 60, 2):
        assert np.sign(signed(case)) == (0, -1, 1)[case.index % 3] and abs(signed(case)) < 1e-14
        assert min(case.radius_a, case.radius_b) == 0 < max(case.radius_a, case.radius_b)


def test_identical_bodies_stand_in_the_same_pose():
    for case in generate("identical", 8, 1):
        assert same(case, case.swapped())


# --- gaps and hit rates ---------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "way"), [("near_sep", 1), ("near_pen", -1)])
def test_near_gaps_are_as_set(name, way):
    for case in generate(name, 45, 6):
        gap = 10.0 ** -(2 + case.index % 15) * mean_diagonal(case)
        # Below some 1e-13 the rounding of the translation decides.
        assert signed(case) == pytest.approx(way * gap, rel=1e-2, abs=1e-15)


def test_a_set_gap_is_the_exact_one():
    rng = np.random.default_rng(1)
    for gap in (2.0, 0.1, 1e-6, 1e-12, -1e-12, -1e-6, -0.05):
        case = generate("rand_pen", 1, int(rng.integers(1000)))[0]
        moved = set_gap(case, gap, rng.standard_normal(3))
        distance, normal = measure(moved)
        assert distance == pytest.approx(gap, rel=2e-3, abs=2e-15)
        assert np.linalg.norm(normal) == pytest.approx(1)
        assert exact.hit(*moved[2:8]) == (gap < 0)


#: name -> smallest and largest |gap| / L, and share of hits; None: no bound.
BOUNDS = {
    "rand_sep": (9.9e-3, 10.1, 0, 0),
    "rand_pen": (None, None, 0.4, 0.9),
    "near_sep": (None, 1.1e-2, 0, 0.1),
    "near_pen": (None, 1.1e-2, 0.9, 1),
    "boxes_flush": (None, 1e-14, 0.25, 0.8),
    "boxes_rest": (1e-11, 1e-2, 0.3, 0.7),
    "rot90": (None, 1e-3, 0.3, 0.8),
    "scale": (0.9e-4, 1.1, 0.3, 0.7),
    "far_origin": (0.9e-4, 0.4, 0.3, 0.7),
    "badrot": (0.9e-4, 0.4, 0.3, 0.7),
    "needles": (None, 0.2, 0.15, 0.55),
    "plates": (None, 0.2, 0.15, 0.55),
    "flat": (None, None, 0.1, 0.6),
    "degenerate": (None, None, 0.05, 0.5),
    "concentric": (1e-3, None, 1, 1),
    "inside": (1e-4, None, 1, 1),
    "identical": (1e-2, None, 1, 1),
    "tiny_motions": (None, None, 0.2, 0.8),
    "long_boxes": (None, 1e-13, 0.3, 0.9),
    "swept_near": (None, 1e-1, 0.2, 0.7),
    "swept_deep": (None, None, 0.5, 1),
    "box_lattice": (None, 1e-12, 0.4, 0.95),
    "halfspace_near": (None, None, 0.3, 0.7),
}


@pytest.mark.many(14)
@pytest.mark.parametrize("name", BOUNDS)
def test_gaps_and_hit_rates(name):
    smallest, largest, fewest, most = BOUNDS[name]
    cases = generate(name, 60, 8)
    found = [truth(case) for case in cases]
    gaps = [abs(float(f.distance)) / (mean_diagonal(case) or 1.0) for f, case in zip(found, cases)]
    assert smallest is None or min(gaps) >= smallest
    assert largest is None or max(gaps) <= largest
    assert fewest <= np.mean([f.hit for f in found]) <= most


@pytest.mark.slow
def test_large_bodies_hit_and_miss():
    for name in ("spheres_big", "cyl1000", "bipyramids", "repeats"):
        hits = [truth(case).hit for case in generate(name, 10, 3)]
        assert 0 < sum(hits) < 10, name


def test_tiny_against_huge_comes_near():
    for case in generate("tiny_vs_huge", 20, 3):
        tiny, huge = sorted((case.a.diagonal(), case.b.diagonal()))
        assert tiny < 2e-3 and huge > 5e3
        assert 0.9e-7 <= abs(signed(case)) <= 1e-3


# --- shapes of particular families ----------------------------------------------------------------


def test_thin_bodies_are_thin():
    for name, thin_axes in (("needles", 2), ("plates", 1)):
        for case in generate(name, 16, 1):
            extent = np.sort(np.ptp(case.P, axis=0))
            a = 10.0 ** -(6 + case.index % 4)
            assert (extent[:thin_axes] < 12 * a).all() and extent[thin_axes] > 0.3
    parallel = [np.array_equal(case.R1, case.R2) for case in generate("plates", 64, 1)]
    assert sum(parallel) == 16
    assert all((case.P[:, 2] == 0).all() and 3 <= len(case.P) <= 11 for case in generate("flat", 20, 1))


def test_degenerate_bodies_of_every_kind():
    found = set()
    for case in generate("degenerate", 60, 1):
        for points in (case.P, case.Q):
            distinct = len(np.unique(points, axis=0))
            found.add(
                "point"
                if len(points) == 1
                else "segment"
                if len(points) == 2
                else "doubled"
                if distinct < len(points)
                else "grid"
                if len(points) == 64
                else "line"
                if np.linalg.matrix_rank(points - points[0]) == 1
                else "solid"
            )
    assert found == {"point", "segment", "doubled", "grid", "line", "solid"}


def test_rotations_of_badrot_are_off_by_1e_7():
    off = [np.abs(R.T @ R - np.eye(3)).max() for c in generate("badrot", 20, 1) for R in (c.R1, c.R2)]
    assert 1e-8 < min(off) and max(off) < 2e-6


def test_long_chains_drift():
    off = [np.abs(c.R1.T @ c.R1 - np.eye(3)).max() for c in generate("tiny_motions", 20, 1)]
    assert 1e-15 < np.median(off) < 1e-11
    short, long = (generate("tiny_motions", 1, 1, steps=k)[0] for k in (10, 1000))
    assert not np.array_equal(short.t1, long.t1)


def test_sizes():
    assert {len(c.P) for c in generate("bipyramids", 3, 1, sides=40)} == {42}
    assert {len(c.P) for c in generate("bipyramids", 1, 1)} == {302}
    assert {len(c.P) for c in generate("cyl1000", 2, 1)} == {2000}
    assert {len(c.P) for c in generate("cyl1000", 3, 1, sides=12)} == {24}
    assert all(200 <= len(c.P) <= 2000 for c in generate("spheres_big", 4, 1))
    for case in generate("repeats", 2, 1, copies=7):
        assert len(case.P) == 7 * len(np.unique(case.P, axis=0)) and case.size == (("copies", 7),)
    assert generate("near_sep", 0, 1) == []


def test_parts():
    rng = np.random.default_rng(0)
    assert len(EXACT_ROTATIONS) == 24 == len({R.tobytes() for R in EXACT_ROTATIONS})
    assert all(4 <= len(random_hull(rng)) <= 64 for _ in range(100))
    assert sorted(np.ptp(box((1, 2, 3)), axis=0)) == [1, 2, 3]
    R = rotation(rng)
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-15 and np.linalg.det(R) > 0


# --- shapes, snippets, errors ---------------------------------------------------------------------


@pytest.mark.parametrize("name", ["touch_ee", "swept_near", "halfspace_near", "cyl1000", "bipyramids"])
def test_a_snippet_asks_the_same_question(name, capsys):
    size = {"sides": 90} if name == "bipyramids" else {}
    case = generate(name, 4, 9, **size)[-1]
    namespace: dict = {}
    exec(compile(case.snippet(), "snippet", "exec"), namespace)  # noqa: S102 - a snippet is there to be run
    A, B, X_WA, X_WB = case.shapes()
    assert namespace["A"] == A and namespace["B"] == B
    for mine, theirs in ((X_WA, namespace["X_WA"]), (X_WB, namespace["X_WB"])):
        R, t = theirs if isinstance(theirs, tuple) else (theirs[:3, :3], theirs[:3, 3])
        assert np.array_equal(mine[:3, :3], R) and np.array_equal(mine[:3, 3], t)
    assert capsys.readouterr().out.startswith(str(truth(case).hit))


def test_half_spaces_come_first():
    case = generate("halfspace_touch", 1, 1)[0]
    assert case.kind == HALFSPACE and type(case.shapes()[0]).__name__ == "Halfspace"
    with pytest.raises(ValueError, match=r"halfspace_touch\[0\]: a half-space comes first"):
        case.swapped()


@pytest.mark.parametrize(
    ("name", "n", "options", "message"),
    [
        ("near_spe", 1, {}, "no family has the name 'near_spe'; there are rand_sep, rand_pen, .*halfspace_near"),
        ("near_sep", -1, {}, "n must be an integer ≥ 0, got -1"),
        ("near_sep", 1.5, {}, "n must be an integer"),
        ("near_sep", 1, {"seed": True}, "seed must be an integer ≥ 0, got True"),
        ("near_sep", 1, {"sides": 3}, "near_sep has no size 'sides'; it has none"),
        ("bipyramids", 1, {"edges": 3}, "bipyramids has no size 'edges'; it has sides"),
    ],
)
def test_refused(name, n, options, message):
    with pytest.raises(InvalidArgument, match=message):
        generate(name, n, **options)


def test_families_load_neither_the_engine_nor_the_oracle():
    code = (
        "import sys, collide.scenes.families as f; f.generate('touch_ee', 2, 1); "
        "print(sorted(m for m in sys.modules if m.startswith(('numba', 'scipy', 'collide.adapters', "
        "'collide.narrowphase'))))"
    )
    result = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=60)
    assert result.stdout.strip() == "[]", result.stdout + result.stderr
