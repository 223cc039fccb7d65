"""RRT-Connect: a tree of configurations from the start and a tree from the goals, until an edge joins both.

J. Kuffner and S. LaValle, "RRT-Connect: An efficient approach to single-query path planning", ICRA 2000. Edges are
sampled here, the far end first, then the middle, quarters, …; `motion_plan.py` has the edges of a path proven, and
answers where a configuration is left open (meshes that are not convex).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.kernels.lanes import LANES
from collide.robots.check_configurations import (
    COLLIDES,
    IS_FREE,
    IS_OPEN,
    settle_eight,
    verdict_after,
    verdict_in_lane,
    verdict_of,
)
from collide.robots.check_scene import N_OPEN, SPHERE_HEADER_AT, view_scene
from collide.robots.sample_motions import time_of_sample

# Words of a search. Columns of a configuration; both trees: nodes (2, capacity, dof), their parents (2, capacity), −1
# of roots, and a byte each, whether an edge from there to a sample has collided; how many nodes the tree of the start
# has, and that of the goals.
(
    DOF, CAPACITY, NODES_AT, PARENTS_AT, HAS_FAILED_AT, N_START, N_GOALS,
    # samples (n, dof), how many, the next; the configuration a tree grows to, the next node on the way; samples of the
    # edge between
    SAMPLES_AT, N_SAMPLES, NEXT_SAMPLE, TARGET_AT, CANDIDATE_AT, EDGE_AT,
    # whether a tree grows to a sample or to a node of the other; which tree, from which of its nodes, to which node
    PHASE, TREE, FROM, TO,
    # how many edges and configurations were asked; three doubles: the longest edge, the largest change of a column from
    # one sample of an edge to the next, and how near a sample must be to a node that has failed [rad or m]
    N_EDGES, N_CHECKED, STEP, SPACING, REACH,
) = range(22)
SEARCH = 22
#: Values of PHASE.
EXTENDING, CONNECTING = range(2)
#: Why `grow_trees` ends: node FROM of a tree is the same configuration as node TO of the other; no sample is left; no
#: place is left in a tree; the edge from FROM to the candidate is left to others.
CONNECTED, NEEDS_SAMPLES, NEEDS_SPACE, NEEDS_ANSWER = range(4)
#: An answer that is not known yet.
UNKNOWN = -1


class Search(NamedTuple):
    """Views of what the words of a search name.   words : themselves."""

    words: Any
    dof: int
    nodes: Any
    parents: Any
    has_failed: Any
    target: Any
    candidate: Any
    samples: Any
    step: float
    spacing: float
    reach: float


@kernel(inline=True)
def _view_search(search_at):
    words = view_i64(search_at, SEARCH)
    dof, capacity, lengths = words[DOF], words[CAPACITY], view_f64(search_at + 8 * STEP, 3)
    return Search(
        words, dof, view_f64(words[NODES_AT], 2 * capacity * dof), view_i64(words[PARENTS_AT], 2 * capacity),
        view_u8(words[HAS_FAILED_AT], 2 * capacity), view_f64(words[TARGET_AT], dof),
        view_f64(words[CANDIDATE_AT], dof), view_f64(words[EDGE_AT], LANES * dof), lengths[0], lengths[1], lengths[2],
    )


@entry("int64(int64, int64, int64)")
def grow_trees(header_at, search_at, answer):
    """Grow both trees until an edge joins them; returns why the kernel ends.

    answer : of an edge left to others, IS_FREE or COLLIDES; else UNKNOWN.
    """
    scene, search = view_scene(header_at), _view_search(search_at)
    words = search.words
    while True:
        if answer == UNKNOWN:
            if max(words[N_START], words[N_GOALS]) >= words[CAPACITY]:
                return NEEDS_SPACE
            if words[PHASE] == EXTENDING and words[NEXT_SAMPLE] >= words[N_SAMPLES]:
                return NEEDS_SAMPLES
            if not _propose(search):
                continue
            at = search.dof * (words[CAPACITY] * words[TREE] + words[FROM])
            answer = _edge_verdict(scene, search, search.nodes, at, search.candidate, 0)
            if answer == IS_OPEN:
                return NEEDS_ANSWER
        is_joined = _take(search, answer)
        answer = UNKNOWN
        if is_joined:
            return CONNECTED


@kernel
def _propose(search):
    """Write the next edge: a node of a tree, and a candidate towards the target; false for a sample out of reach.

    A node from which an edge has collided grows to near samples alone: others would mostly collide as well (after A.
    Yershova et al., "Dynamic-domain RRTs", 2005, with a single radius).
    """
    words = search.words
    if words[PHASE] == EXTENDING:
        samples = view_f64(words[SAMPLES_AT], words[N_SAMPLES] * search.dof)
        for j in range(search.dof):
            search.target[j] = samples[search.dof * words[NEXT_SAMPLE] + j]
        words[NEXT_SAMPLE] += 1
        words[TREE] = 0 if words[N_START] <= words[N_GOALS] else 1
        words[FROM] = _nearest(search, words[TREE])
    at = search.dof * (words[CAPACITY] * words[TREE] + words[FROM])
    length = math.sqrt(_square_to_target(search, at))
    has_failed = search.has_failed[words[CAPACITY] * words[TREE] + words[FROM]] != 0
    if words[PHASE] == EXTENDING and has_failed and length > search.reach:
        return False
    share = search.step / length if length > search.step else 1.0
    for j in range(search.dof):
        q = search.nodes[at + j]
        search.candidate[j] = q + share * (search.target[j] - q) if share < 1.0 else search.target[j]
    return True


@kernel
def _take(search, answer):
    """Add the candidate where the edge is free, and go on; returns whether the trees are joined."""
    words = search.words
    tree = words[TREE]
    is_extending = words[PHASE] == EXTENDING
    if answer != IS_FREE:
        if is_extending:
            search.has_failed[words[CAPACITY] * tree + words[FROM]] = 1
        words[PHASE] = EXTENDING
        return False
    n = words[N_START + tree]
    place = words[CAPACITY] * tree + n
    is_target = True
    for j in range(search.dof):
        search.nodes[search.dof * place + j] = search.candidate[j]
        is_target = is_target and search.candidate[j] == search.target[j]
    search.parents[place] = words[FROM]
    search.has_failed[place] = 0
    words[N_START + tree] = n + 1
    words[FROM] = n
    if is_extending:
        for j in range(search.dof):
            search.target[j] = search.candidate[j]
        words[PHASE] = CONNECTING
        words[TREE] = 1 - tree
        words[TO] = n
        words[FROM] = _nearest(search, 1 - tree)
        return False
    return is_target


@kernel
def _nearest(search, tree):
    """The node of a tree nearest to the target: all are compared."""
    first = search.words[CAPACITY] * tree
    nearest = 0
    least = math.inf
    for k in range(search.words[N_START + tree]):
        square = _square_to_target(search, search.dof * (first + k))
        if square < least:
            nearest = k
            least = square
    return nearest


@kernel(inline=True)
def _square_to_target(search, at):
    square = 0.0
    for j in range(search.dof):
        change = search.nodes[at + j] - search.target[j]
        square += change * change
    return square


@kernel
def _edge_verdict(scene, search, q0, at0, q1, at1):
    """COLLIDES, IS_OPEN or IS_FREE of samples of an edge: its end, the middle, quarters, …; its begin is free."""
    search.words[N_EDGES] += 1
    dof, q = search.dof, search.samples
    change = 0.0
    for j in range(dof):
        change = max(change, abs(q1[at1 + j] - q0[at0 + j]))
    n = 1
    while n * search.spacing < change:
        n *= 2
    is_open = False
    first = 1
    while first <= n:
        count = 1 if first == 1 else min(LANES, n + 1 - first)  # most edges that collide do so at their end
        for lane in range(count):
            t = time_of_sample(first + lane)
            for j in range(dof):
                a = q0[at0 + j]
                b = q1[at1 + j]
                q[dof * lane + j] = a + t * (b - a) if t < 1.0 else b
        verdict = _verdict_of_samples(scene, search, q, count)
        if verdict == COLLIDES:
            return COLLIDES
        is_open = is_open or verdict == IS_OPEN
        first += count
    return IS_OPEN if is_open else IS_FREE


@kernel
def _verdict_of_samples(scene, search, q, count):
    """COLLIDES, IS_OPEN or IS_FREE of up to LANES configurations: of all at once where the robot has spheres."""
    in_lanes = scene.words[SPHERE_HEADER_AT] != 0 and settle_eight(scene, q, search.dof, 0, count) > 0
    if in_lanes:
        search.words[N_CHECKED] += count
        for lane in range(count):
            if verdict_in_lane(scene, lane) == COLLIDES:
                return COLLIDES
    is_open = False
    for lane in range(count):
        if in_lanes and verdict_in_lane(scene, lane) == IS_FREE:
            continue
        if in_lanes:
            verdict = verdict_after(scene, q, search.dof * lane, 0, lane)
        else:
            verdict = verdict_of(scene, q, search.dof * lane, 0)
            search.words[N_CHECKED] += 1
        scene.words[N_OPEN] = 0  # others ask about the whole edge
        if verdict == COLLIDES:
            return COLLIDES
        is_open = is_open or verdict == IS_OPEN
    return IS_OPEN if is_open else IS_FREE


# Words of a shortening: a path (n, dof), n, numbers of nodes that remain, how many; both ends of the shortcut asked.
PATH_AT, N_PATH, REMAINING_AT, N_REMAINING, BEGIN, END = range(6)
SHORTENING = 6


@entry("int64(int64, int64, int64, int64)")
def shorten_path(header_at, search_at, path_at, answer):
    """Choose nodes of a path: behind each node the last to which a straight edge is free by samples.

    Returns NEEDS_ANSWER where the shortcut from BEGIN to END is left to others, else CONNECTED.
    answer : as of `grow_trees`.
    """
    scene, search = view_scene(header_at), _view_search(search_at)
    words = view_i64(path_at, SHORTENING)
    n = words[N_PATH]
    path, remaining = view_f64(words[PATH_AT], n * search.dof), view_i64(words[REMAINING_AT], n)
    while words[BEGIN] < n - 1:
        if answer == UNKNOWN:
            answer = IS_FREE  # as an edge of the path is
            if words[END] > words[BEGIN] + 1:
                answer = _edge_verdict(scene, search, path, search.dof * words[BEGIN], path, search.dof * words[END])
            if answer == IS_OPEN:
                return NEEDS_ANSWER
        if answer == IS_FREE:
            remaining[words[N_REMAINING]] = words[END]
            words[N_REMAINING] += 1
            words[BEGIN] = words[END]
            words[END] = n - 1
        else:
            words[END] -= 1
        answer = UNKNOWN
    return CONNECTED
