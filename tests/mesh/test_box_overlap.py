"""One box against eight, as plain numbers: no axis parts boxes that share a point, bounds are below all distances."""

from __future__ import annotations

import numpy as np
from naive import rng_of, rotation, unit

from collide.mesh.box_overlap import (
    NEAR_PROBE,
    PRISM,
    PROBE,
    boxes_meeting_one_by_one,
    boxes_meeting_prism_one_by_one,
    boxes_nearest_one_by_one,
    patches_near_place_one_by_one,
)
from collide.mesh.bvh import NODE, NOTHING, SLAB, WIDTH

#: Added to half lengths for the rounding of floats, as whoever fills probes does.
SLACK = 1e-5


def scene(rng, spread: float):
    """(node, frame, probe, centres and half lengths of the eight, R, t, half lengths of the probe).

    A point x of the node's frame is R x + t in the probe's, whose box is around its origin.
    """
    node = np.zeros(NODE, dtype=np.float32)
    centres, halves = rng.normal(size=(WIDTH, 3)) * spread, rng.uniform(0.05, 0.6, (WIDTH, 3))
    node[: 3 * WIDTH], node[3 * WIDTH : 6 * WIDTH] = centres.T.ravel(), halves.T.ravel() + SLACK
    R, t, half = rotation(rng), rng.normal(size=3) * 0.4, rng.uniform(0.05, 0.6, 3)
    probe = np.zeros(PRISM, dtype=np.float32)
    probe[:3], probe[3:6] = -R.T @ t, np.abs(R.T) @ half + SLACK
    probe[6:9], probe[9:12] = t, half + SLACK
    return node, R.ravel().astype(np.float32), probe, centres, halves, R, t, half


def points_in(rng, centre, half, n=300):
    """Points of a box, its corners among them."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return centre + half * np.concatenate([corners, rng.uniform(-1, 1, (n, 3))])


def test_boxes_that_share_a_point_are_never_parted():
    rng = rng_of("boxes meeting")
    kept = shared = 0
    for _ in range(150):
        node, frame, probe, centres, halves, R, t, half = scene(rng, 0.5)
        unused = rng.random(WIDTH) < 0.2
        node[3 * WIDTH : 6 * WIDTH].reshape(3, WIDTH)[:, unused] = NOTHING
        mask = boxes_meeting_one_by_one(node, 0, frame, probe)
        for k in range(WIDTH):
            inside = (np.abs(points_in(rng, centres[k], halves[k]) @ R.T + t) <= half).all(axis=1).any()
            assert not inside or unused[k] or mask >> k & 1
            shared += bool(inside and not unused[k])
            assert not (unused[k] and mask >> k & 1)
        kept += mask.bit_count()
    assert shared > 100 and kept < 3 * shared, (kept, shared)


def test_slabs_and_half_spaces_part_what_lies_beyond_them_only():
    rng = rng_of("prisms")
    fewer = 0
    for _ in range(100):
        node, frame, probe, centres, halves, R, t, _ = scene(rng, 0.5)
        n, out = unit(rng.normal(size=3)), unit(rng.normal(size=3))
        width, top = rng.uniform(0.05, 0.5), rng.uniform(-0.3, 0.5)
        box = boxes_meeting_one_by_one(node, 0, frame, probe)
        probe[12:15], probe[15], probe[16] = R.T @ n, n @ t, width + SLACK
        probe[PROBE : PROBE + 3], probe[PROBE + 3] = R.T @ out, out @ t - top - SLACK
        slab, prism = (f(node, 0, frame, probe) for f in (boxes_meeting_one_by_one, boxes_meeting_prism_one_by_one))
        assert slab & ~box == 0 and prism & ~slab == 0
        for k in range(WIDTH):
            points = points_in(rng, centres[k], halves[k]) @ R.T + t
            in_slab = np.abs(points @ n) <= width
            if (box >> k & 1) and in_slab.any():
                assert slab >> k & 1
            if (slab >> k & 1) and (points @ out <= top).any():
                assert prism >> k & 1
        fewer += box.bit_count() - prism.bit_count()
    assert fewer > 30


def test_bounds_are_below_the_distances():
    rng = rng_of("boxes nearest")
    tight = positive = 0
    for _ in range(120):
        node, frame, probe, centres, halves, R, t, half = scene(rng, 2.5)
        near = np.zeros(NEAR_PROBE, dtype=np.float32)
        near[:12], near[12:19] = probe[:12], 1 - 1e-5
        g = unit(rng.normal(size=3))
        # Along g, seen from the node's frame: how far the probe's box ends before the node's origin.
        near[19:22], near[22] = R.T @ g, g @ t - np.abs(g) @ half - SLACK
        slabs = np.zeros(SLAB, dtype=np.float32)
        normals = np.array([unit(rng.normal(size=3)) for _ in range(WIDTH)])
        middles, reaches = (normals * centres).sum(axis=1), (np.abs(normals) * halves).sum(axis=1)
        slabs[: 3 * WIDTH] = normals.T.ravel()
        slabs[3 * WIDTH : 4 * WIDTH], slabs[4 * WIDTH :] = middles, reaches + SLACK
        out = np.zeros(2 * WIDTH, dtype=np.float32)
        boxes_nearest_one_by_one(node, 0, slabs, 0, frame, near, out)
        for k in range(WIDTH):
            points = points_in(rng, centres[k], halves[k]) @ R.T + t
            distance = np.linalg.norm(points - np.clip(points, -half, half), axis=1).min()
            assert out[k] <= distance + 1e-6
            assert abs(out[WIDTH + k] - ((R @ centres[k] + t) ** 2).sum()) <= 1e-3
            positive += out[k] > 0
            tight += 0 < 0.7 * distance < out[k]
    assert positive > 400 and tight > 0.5 * positive, (tight, positive)


def test_patches_near_a_place_are_never_left_out():
    rng = rng_of("patches near")
    kept = near = 0
    for _ in range(200):
        node, _, _, centres, halves, *_ = scene(rng, 1.0)
        unused = rng.random(WIDTH) < 0.2
        node[3 * WIDTH : 6 * WIDTH].reshape(3, WIDTH)[:, unused] = NOTHING
        slabs = np.zeros(SLAB, dtype=np.float32)
        normals = np.array([unit(rng.normal(size=3)) for _ in range(WIDTH)])
        middles, widths = (normals * centres).sum(axis=1), rng.uniform(0.0, 0.1, WIDTH)
        slabs[: 3 * WIDTH] = normals.T.ravel()
        slabs[3 * WIDTH : 4 * WIDTH], slabs[4 * WIDTH :] = middles, widths + SLACK
        place, reach = rng.normal(size=3), rng.uniform(0.1, 1.5)
        x, y, z, limit, far = np.float32([*place, reach * reach, reach])
        mask = patches_near_place_one_by_one(node, 0, slabs, 0, x, y, z, limit, far)
        for k in range(WIDTH):
            points = points_in(rng, centres[k], halves[k])
            points = points[np.abs(points @ normals[k] - middles[k]) <= widths[k]]
            is_near = bool((np.linalg.norm(points - place, axis=1) <= reach).any()) and not unused[k]
            assert not is_near or mask >> k & 1
            near += is_near
        kept += mask.bit_count()
    assert near > 100 and kept < 3 * near, (near, kept)
