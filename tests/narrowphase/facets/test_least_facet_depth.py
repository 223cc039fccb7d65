"""Least depths of solids of facets: bounds hold, and are near each other."""

from __future__ import annotations

import numpy as np
import pytest
from naive import Case, pose, random_pose, reproducible, rng_of, same_bits

import collide
from collide.narrowphase.facets.inner_balls import inner_balls

I = np.eye(4)


def mesh_of(*boxes: tuple[tuple, tuple]) -> collide.Mesh:
    """Boxes (sizes, centre) as one solid mesh."""
    vertices, faces, n = [], [], 0
    for sizes, centre in boxes:
        v, f = collide.tessellate(collide.Box(sizes))[:2]
        vertices.append(v + np.array(centre))
        faces.append(f + n)
        n += len(v)
    return collide.Mesh(np.concatenate(vertices), np.concatenate(faces))


ELL = mesh_of(((2, 2, 2), (0, 0, 0)), ((2, 2, 2), (1.9, 0, 0)), ((2, 2, 2), (0, 0, 1.9)))
BLOCK = mesh_of(((1, 0.8, 0.6), (0, 0, 0)))


def checked(case: Case, r: collide.PairResult, rng) -> None:
    assert r.lower <= r.distance <= r.upper <= 0 and abs(np.linalg.norm(r.normal) - 1) < 1e-14
    assert not collide.collide(*case.with_b_moved(-r.lower * r.normal)), "still together"
    V = rng.normal(size=(200, 3))
    V *= (-r.upper * (1 - 1e-9) * rng.uniform(0, 1, 200) ** 0.2 / np.linalg.norm(V, axis=1))[:, None]
    X_WB = np.repeat(case.X_WB[None], len(V), axis=0)
    X_WB[:, :3, 3] += V
    assert collide.collide(case.A, case.B, case.X_WA, X_WB).all(), "a shorter way out than the lower bound"


def test_two_blocks_face_to_face_are_known():
    case = Case(BLOCK, BLOCK, I, pose(t=(0.1, 0.05, 0.5)))
    r = collide.distance(*case, depth="least")
    assert r.distance == pytest.approx(-0.1, abs=1e-9) and r.upper == pytest.approx(-0.1, rel=2e-3)
    checked(case, r, rng_of("blocks"))


def test_a_block_in_the_notch_of_an_l_comes_out_of_the_notch():
    """Both walls are passed at once: 0.2 along x and 0.15 along z, not 1.1 to the side."""
    case = Case(ELL, mesh_of(((0.2, 0.2, 0.2), (0, 0, 0))), I, pose(t=(0.9, 0, 0.95)))
    r = collide.distance(*case, depth="least")
    assert -0.25 * (1 + 1e-2) <= r.distance <= -0.25 * (1 - 1e-9)
    assert r.upper <= -0.1 * (1 - 1e-9)  # inner facets, of one block within another, end the balls
    checked(case, r, rng_of("notch"))


@pytest.mark.slow
def test_brackets_of_random_solids():
    rng = rng_of("least solids")
    angle = mesh_of(((1, 1, 0.1), (0, 0, 0)), ((0.1, 1, 1), (0.45, 0, 0.45)))
    shapes = [ELL, BLOCK, angle, collide.Box((0.7, 0.9, 1.1))]
    widths = []
    for k in range(10):
        A, B = shapes[k % 3], shapes[(k + 1 + k // 3) % 4]
        case = Case(A, B, random_pose(rng, 0.1), random_pose(rng, 0.4))
        if not collide.collide(*case):
            continue
        with reproducible(case):
            quick, r = collide.distance(*case), collide.distance(*case, depth="least")
            checked(case, r, rng)
            assert quick.lower <= r.lower
            widths.append(r.lower / min(r.upper, -1e-9))
            swapped = collide.distance(*case.swapped(), depth="least")
            assert not same_bits(collide.results.flipped(swapped.rows), r.rows)
    assert len(widths) > 5 and np.median(widths) < 1.2


def test_inner_balls_are_within_the_solid():
    balls = inner_balls(BLOCK)
    centres, radii = balls[:, :3], balls[:, 3]
    room = (np.array([0.5, 0.4, 0.3]) - np.abs(centres)).min(axis=1)
    assert (radii <= room + 1e-15).all() and (radii == 0).any()
    assert radii.max() > 0.28 and len(balls) > 100


def test_a_surface_has_no_lower_bound():
    """A plate without an inside: some translation parts the bodies, and none is proven to be needed."""
    v, f = collide.tessellate(collide.Box((1, 1, 1)))[:2]
    sheet = collide.Mesh(v, f[:10])
    case = Case(sheet, BLOCK, I, pose(t=(0.5, 0.1, 0.2)))
    quick, r = collide.distance(*case), collide.distance(*case, depth="least")
    assert r.upper == 0 and quick.lower <= r.lower < 0
    assert not collide.collide(*case.with_b_moved(-r.lower * r.normal))
