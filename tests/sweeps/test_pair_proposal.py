"""Which pairs of links need no test: judged by robots whose truth is known by hand, and by rational arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain_robots import box_corners, chain, joint, robot_of
from reproduction import reproducing

from collide import Box, InvalidArgument, Robot, Sphere
from collide.adapters.peers import exact
from collide.sweeps.pair_proposal import NEVER, adjacent_links, propose_disabled_pairs, wilson_bounds
from collide.sweeps.random_configurations import random_configurations


def reasons(proposal):
    return {(pair.a, pair.b): pair.reason for pair in proposal.pairs}


def test_every_reason_by_hand():
    """A rail along x: a slider beside posts that it always, never, at the start, or sometimes meets."""
    robot = robot_of(
        ["base", "slider", "inner", "far", "start", "there"],
        [
            joint("slide", "prismatic", "base", "slider", lower=-1.0, upper=1.0),
            joint("weld_inner", "fixed", "base", "inner"), joint("weld_far", "fixed", "base", "far"),
            joint("weld_start", "fixed", "base", "start"), joint("weld_there", "fixed", "base", "there"),
        ],
        {
            "slider": (Box((0.2, 0.2, 0.2)), (0, 0, 0)), "inner": (Box((3, 0.01, 0.01)), (0, 0, 0)),
            "far": (Sphere(0.1), (0, 1, 0)), "start": (Box((0.01, 0.01, 0.5)), (0, 0, 0)),
            "there": (Box((0.01, 0.01, 0.5)), (0.6, 0, 0)),
        },
    )
    base_free = propose_disabled_pairs(robot, 2000, seed=3)
    # `base` has no geometry: the slider and what is welded to it are neighbours through it, as MoveIt has them.
    assert set(reasons(base_free).values()) == {"Adjacent"}
    with_base = robot_of(robot.links, robot.joints, {
        **{link: (elements[0].shape, elements[0].X_LG[:3, 3]) for link, elements in robot.geometry.items()},
        "base": (Sphere(0.01), (0, -1, 0)),
    })
    found = propose_disabled_pairs(with_base, 2000, seed=3)
    assert reasons(found) == {
        ("base", "slider"): "Adjacent", ("base", "inner"): "Adjacent", ("base", "far"): "Adjacent",
        ("base", "start"): "Adjacent", ("base", "there"): "Adjacent",
        ("slider", "inner"): "Always", ("slider", "far"): "Never", ("slider", "start"): "Default",
        ("slider", "there"): None,
        ("inner", "far"): "Never", ("inner", "start"): "Always", ("inner", "there"): "Always",
        ("far", "start"): "Never", ("far", "there"): "Never", ("start", "there"): "Never",
    }
    # The slider (half width 0.1) meets the post (0.005) where |slide − 0.6| ≤ 0.105, of a range of 2.
    share = found.pair("there", "slider")
    assert share.share_bounds[0] < 0.105 < share.share_bounds[1]
    assert abs(share.q[0] - 0.6) <= 0.105
    # Nearest: the slider's corner (0.1, 0.1) to the ball around (0, 1): its face y = 0.1 below it.
    far = found.pair("slider", "far")
    assert far.nearest.gap == pytest.approx(0.8, abs=1e-12) and far.samples == 2000
    assert found.pair("inner", "start").fixed and found.pair("inner", "start").samples == 1


def test_counts_are_those_of_rational_arithmetic():
    """Hits of a sample, configuration by configuration, by an oracle in fractions. Poses are those of `link_poses`."""
    robot = chain(5, length=0.2, width=0.15)
    proposal = propose_disabled_pairs(robot, 60, seed=11, rounds=0)
    Q = random_configurations(robot, 0, 60, 11)
    X_WLs = robot.link_poses(Q)
    seen = 0
    for pair in proposal.pairs:
        if pair.reason == "Adjacent":
            continue
        i, j = robot.links.index(pair.a), robot.links.index(pair.b)
        X_AG, X_BG = (robot.geometry[link][0].X_LG for link in (pair.a, pair.b))
        corners = [box_corners(robot.geometry[link][0].shape.size) for link in (pair.a, pair.b)]
        hits = 0
        for X_WLs_k in X_WLs:
            X_WA, X_WB = X_WLs_k[i] @ X_AG, X_WLs_k[j] @ X_BG
            hits += exact.hit(corners[0], X_WA[:3, :3], X_WA[:3, 3], corners[1], X_WB[:3, :3], X_WB[:3, 3])
        with reproducing("pair {a} {b}", a=pair.a, b=pair.b):
            assert (pair.hits, pair.samples) == (hits, 60)
        seen += 0 < hits < 60
    assert seen >= 2, "the sample decides nothing"


def test_rare_collision_is_found_by_search_alone():
    """Three prismatic joints must each stand within a hundredth of a corner: a millionth of all configurations."""
    robot = robot_of(
        ["base", "x", "xy", "tool", "post"],
        [
            joint("jx", "prismatic", "base", "x", axis=(1, 0, 0), upper=1.0),
            joint("jy", "prismatic", "x", "xy", axis=(0, 1, 0), upper=1.0),
            joint("jz", "prismatic", "xy", "tool", axis=(0, 0, 1), upper=1.0),
            joint("weld", "fixed", "base", "post"),
        ],
        {
            "tool": (Sphere(0.005), (0, 0, 0)), "post": (Sphere(0.005), (1.004, 1.004, 1.004)),
            "base": (Sphere(0.1), (-1, -1, -1)), "xy": (Sphere(0.001), (0, 0, -2)),
        },
    )
    sampled = propose_disabled_pairs(robot, 5000, seed=1, rounds=0)
    assert reasons(sampled)["tool", "post"] == "Never"
    searched = propose_disabled_pairs(robot, 5000, seed=1)
    pair = searched.pair("tool", "post")
    assert pair.reason is None and pair.searched and pair.hits == 0
    assert np.linalg.norm(pair.q - 1.004) <= 0.01 and (pair.q <= 1.0).all()
    # One that stays out of reach by a hair stays "Never", with the gap that is left: 1e-4 m.
    post = math.sqrt(3) / 3 * 0.0101 + 1.0
    robot = robot_of(robot.links, robot.joints, {
        "tool": (Sphere(0.005), (0, 0, 0)), "post": (Sphere(0.005), (post, post, post)),
        "base": (Sphere(0.1), (-1, -1, -1)), "xy": (Sphere(0.001), (0, 0, -2)),
    })
    pair = propose_disabled_pairs(robot, 5000, seed=1).pair("tool", "post")
    assert pair.reason == "Never" and 1e-4 - 1e-12 <= pair.nearest.gap < 2e-3


def test_same_seed_same_proposal():
    robot = chain(5, length=0.3, width=0.1)
    one, again, different = (propose_disabled_pairs(robot, 300, seed=seed) for seed in (5, 5, 6))
    assert [(pair.reason, pair.hits) for pair in one.pairs] == [(pair.reason, pair.hits) for pair in again.pairs]
    assert [pair.hits for pair in one.pairs] != [pair.hits for pair in different.pairs]


def test_always_share():
    """A pair in collision in most of the sample is Always where that is asked for."""
    robot = robot_of(
        ["base", "a", "post"],
        [joint("slide", "prismatic", "base", "a", lower=0.0, upper=1.0), joint("weld", "fixed", "base", "post")],
        {"a": (Box((0.1, 0.1, 0.1)), (0, 0, 0)), "post": (Box((1.84, 0.1, 0.1)), (1.0, 0, 0)),
         "base": (Sphere(0.1), (0, 0, 5))},
    )
    # At slide s the faces stand at s + 0.05 and 0.08: apart for s < 0.03, of a range of 1; 0 is the default.
    assert propose_disabled_pairs(robot, 3000).pair("a", "post").reason is None
    assert propose_disabled_pairs(robot, 3000, always_share=0.95).pair("a", "post").reason == "Always"


def test_links_without_geometry_pass_adjacency_on():
    robot = robot_of(
        ["a", "flange", "b", "c", "d"],
        [joint("j1", "revolute", "a", "flange"), joint("j2", "fixed", "flange", "b"),
         joint("j3", "revolute", "flange", "c"), joint("j4", "revolute", "c", "d")],
        {link: (Sphere(0.1), (0, 0, 0)) for link in "abcd"},
    )
    assert adjacent_links(robot) == {frozenset(pair) for pair in ("ab", "ac", "bc", "cd")}


@pytest.mark.parametrize("hits, samples", [(0, 10), (0, 10_000), (3, 50), (50, 50), (5, 7), (199, 10_000)])
def test_wilson_bounds_solve_their_equation(hits, samples):
    """Each bound p is where the sample stands z of p's own standard deviations away."""
    z = 1.6448536269514722
    low, high = wilson_bounds(hits, samples)
    for bound in (low, high):
        if 0 < bound < 1:
            assert abs(hits / samples - bound) == pytest.approx(z * math.sqrt(bound * (1 - bound) / samples), rel=1e-9)
    assert low <= hits / samples <= high and (low == 0) == (hits == 0) and (high == 1) == (hits == samples)


@pytest.mark.parametrize(
    "options, words",
    [({"samples": 0}, "samples"), ({"seed": -1}, "seed"), ({"rounds": 1.5}, "rounds"), ({"always_share": 0.2}, "0.5")],
)
def test_bad_numbers_are_refused(options, words):
    with pytest.raises(InvalidArgument, match=words):
        propose_disabled_pairs(chain(3, length=0.3, width=0.1), **options)


def test_robot_without_geometry_is_refused():
    with pytest.raises(InvalidArgument, match="0 of its links have collision geometry"):
        propose_disabled_pairs(Robot("bare", ["a", "b"], [joint("j", "revolute", "a", "b")]))


def test_joints_without_limits_are_told():
    robot = robot_of(["a", "b"], [joint("j", "floating", "a", "b")],
                     {link: (Sphere(0.1), (0, 0, 0)) for link in "ab"})
    proposal = propose_disabled_pairs(robot, 10)
    assert any("j/x, j/y, j/z" in note for note in proposal.notes)


def test_poses_of_elements_in_their_links_count():
    """A shape far from its link's origin, turned by the joint: the pair collides on part of the turn."""
    robot = robot_of(
        ["base", "arm", "post"],
        [joint("turn", "revolute", "base", "arm", axis=(0, 0, 1), lower=-math.pi, upper=math.pi),
         joint("weld", "fixed", "base", "post")],
        {"arm": (Sphere(0.1), (1, 0, 0)), "post": (Sphere(0.1), (-1, 0, 0)), "base": (Sphere(0.1), (0, 0, 3))},
    )
    pair = propose_disabled_pairs(robot, 4000).pair("arm", "post")
    # Chord 2 sin(angle / 2) ≤ 0.2, on both sides of π.
    low, high = pair.share_bounds
    assert low < 2 * math.asin(0.1) * 2 / (2 * math.pi) < high
    assert np.linalg.norm(np.array([math.cos(pair.q[0]) + 1, math.sin(pair.q[0])])) <= 0.2


def test_a_pair_that_never_collided_has_no_configuration_where_it_does():
    proposal = propose_disabled_pairs(chain(5, length=0.4, width=0.05), samples=200)
    never = [pair for pair in proposal.pairs if pair.reason == NEVER]
    hit = [pair for pair in proposal.pairs if pair.hits]
    assert never + hit and all(pair.q is None for pair in never) and all(pair.q is not None for pair in hit)
