"""Eight configurations at once, a lane each: spheres around bodies prove them apart, spheres within prove hits.

Every body of the robot lies within the union of its outer spheres, and holds its inner spheres. So bodies are apart
where each outer sphere is farther from the other body, or from each of its outer spheres, than the radii; and they meet
where an inner sphere meets an inner sphere, or an obstacle that is known exactly: a box, a point or an axis of a part's
box, swept by a ball, a cylinder, a half-space. What neither proves is left to the narrowphase.

Links have the bits of `forward_kinematics.pose_links`. A squared distance is rounded by less than the slack, as a share
of all that goes into it, allows: for centres c and m and sides h, |c|₁ + |m|₁ + |h|₁, matrices that are not quite
rotations included (`check_tables.tables_among`). Radii are larger by as much where bodies are to be apart, smaller
where they are to meet.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.broadphase.graded_boxes import BODY, SKIP
from collide.broadphase.graded_boxes import LINK as NODE_LINK
from collide.kernels import kernel, view_f64, view_i64, view_u8
from collide.kernels.lanes import LANES, any_of, bits_of, root_of, select, view_lanes
from collide.lowering.shape_table import POSE
from collide.numerics.vec3 import Vec3
from collide.robots.check_scene import (
    BODY_INTS,
    BODY_OF_AT,
    BOX,
    LINK,
    N_BODIES,
    N_LINK_PARTS,
    N_LINKS,
    N_NODES,
    N_PARTS,
    N_SELF_PAIRS,
    N_UNBOUNDED,
    NODE_LINKS_AT,
    NODES_AT,
    SELF_PAIRS_AT,
    STAMP,
    UNBOUNDED_AT,
    is_allowed,
)
from collide.robots.forward_kinematics import LINK_POSE, pose_links
from collide.robots.map_layout import (
    CELLS_AT,
    FIRST_COLUMN,
    LOW_FIRST,
    LOW_SECOND,
    MAP_DOUBLES,
    MAP_INTS,
    N_FIRST,
    N_SECOND,
    PER_FIRST,
    PER_SECOND,
    SECOND_COLUMN,
)

# Header: for each body how many spheres it has (BODY_SPHERES integers), and the sphere around it; all spheres; parts
# around: what they are, and their numbers; how many spheres there are.
(
    COUNTS_AT, AROUND_BODIES_AT, SPHERES_AT, PART_KINDS_AT, PART_NUMBERS_AT, N_SPHERES,
    # workspace, in lanes: columns of q; poses of links; spheres around bodies, and all spheres, in the world; for which
    # eight configurations a body's were placed; how often that was
    COLUMNS_AT, N_COLUMNS, LINK_LANES_AT, AROUND_LANES_AT, SPHERE_LANES_AT, PLACED_AT, N_PLACED,
    # verdicts: hits and open ones, in lanes; of fewer configurations none are asked so; pairs that spheres leave open,
    # their number and how many there may be
    VERDICTS_AT, FEWEST, PAIRS_AT, N_PAIRS, PAIR_CAPACITY,
    # of `pair_maps.py`: integers, doubles, cells, how many of the first tested pairs have a map; by how much each
    # column may differ, and flags, in lanes
    MAP_INTS_AT, MAP_DOUBLES_AT, MAP_CELLS_AT, N_MAPS, SPANS_AT, FLAGS_AT,
    # of `sphere_motions.py`: intervals; half their lengths, and how far bodies may move, in lanes
    PIECES_AT, HALF_LANES_AT, MOVED_LANES_AT,
) = range(27)
SPHERE_HEADER = 27
# Integers of a body: its first outer sphere, how many; its first inner sphere, how many. Where its outer spheres are
# the body itself it has no others.
FIRST_OUTER, N_OUTER, FIRST_INNER, N_INNER, IS_EXACT = range(5)
BODY_SPHERES = 5
# Integers of a pair left open: a body, another or −1 − a part around, and the lanes as bits.
OPEN_PAIR = 3
# Doubles of a sphere: its centre in the link; its radius among the robot's bodies, and with the padding; by how much
# less of a sphere that is the body itself lies within.
CENTRE, RADIUS, PADDED_RADIUS, LESS_WITHIN = 0, 3, 4, 5
SPHERE = 6
# Lanes of a sphere in the world: its centre, and by how much rounding may have moved it.
SPHERE_PLACE = 4
#: What a part around is: a box swept by a ball; a cylinder likewise; a half-space; a part known by its box alone.
SWEPT_BOX, SWEPT_CYLINDER, PLANE, ONLY_BOXED = range(4)
# Doubles of a part around: half sides of its box, or radius and half length, or unit normal and offset; the radius of
# the ball, at most and at least. It is −∞ at least of parts known by their boxes.
SIDES, AT_MOST, AT_LEAST = 0, 4, 5
PART_NUMBERS = 6


class Spheres(NamedTuple):
    """Views of what the header names."""

    words: Any
    counts: Any
    around_bodies: Any
    spheres: Any
    part_kinds: Any
    part_numbers: Any
    links: Any
    around_lanes: Any
    sphere_lanes: Any
    placed: Any


@kernel(inline=True)
def view_spheres(scene, spheres_at):
    """The `Spheres` of a header."""
    words = view_i64(spheres_at, SPHERE_HEADER)
    n_bodies = scene.words[N_BODIES]
    n_around = scene.words[N_PARTS] - scene.words[N_LINK_PARTS]
    return Spheres(
        words, view_i64(words[COUNTS_AT], BODY_SPHERES * n_bodies),
        view_f64(words[AROUND_BODIES_AT], SPHERE * n_bodies),
        view_f64(words[SPHERES_AT], SPHERE * words[N_SPHERES]), view_i64(words[PART_KINDS_AT], n_around),
        view_f64(words[PART_NUMBERS_AT], PART_NUMBERS * n_around),
        view_lanes(words[LINK_LANES_AT], LINK_POSE * scene.words[N_LINKS]),
        view_lanes(words[AROUND_LANES_AT], SPHERE_PLACE * n_bodies),
        view_lanes(words[SPHERE_LANES_AT], SPHERE_PLACE * words[N_SPHERES]), view_i64(words[PLACED_AT], n_bodies),
    )


class Verdicts(NamedTuple):
    """Masks: lanes in collision, and lanes in which something is left to others."""

    hits: Any
    open: Any


@kernel
def check_eight(scene, spheres):
    """Write the verdicts of eight configurations, whose columns are written: hits, and lanes left to others."""
    words = scene.words
    place_bodies(scene, spheres)
    verdicts = no_verdicts(spheres)
    for body in range(words[N_BODIES]):
        verdicts = check_among_parts(scene, spheres, body, 0.0, verdicts)
        if not any_of(~verdicts.hits):
            break
    pairs = view_i64(words[SELF_PAIRS_AT], 2 * words[N_SELF_PAIRS])
    for k in range(words[N_SELF_PAIRS]):
        verdicts = check_pair(scene, spheres, k, pairs[2 * k], pairs[2 * k + 1], 0.0, verdicts)
    put_verdicts(spheres, verdicts)


@kernel(inline=True)
def place_bodies(scene, spheres):
    """Place links, and the spheres around bodies, for the columns written."""
    columns = view_lanes(spheres.words[COLUMNS_AT], spheres.words[N_COLUMNS])
    pose_links(scene.joints, columns, 0, spheres.links, LINK_POSE)
    spheres.words[N_PLACED] += 1
    spheres.words[N_PAIRS] = 0
    for body in range(scene.words[N_BODIES]):
        _put_place(scene, spheres.around_bodies, body, body, spheres, spheres.around_lanes)


@kernel
def copy_links(scene, spheres, lane):
    """Write the poses of all links in a lane where `begin_configuration` has them: the same bits."""
    scene.words[STAMP] += 1
    lanes = view_f64(spheres.words[LINK_LANES_AT], LANES * LINK_POSE * scene.words[N_LINKS])
    for link in range(scene.words[N_LINKS]):
        for k in range(LINK_POSE):
            scene.links[POSE * link + k] = lanes[LANES * (LINK_POSE * link + k) + lane]


@kernel(inline=True)
def no_verdicts(spheres):
    """`Verdicts` before anything is asked."""
    some = spheres.around_lanes[0]
    nothing = (some < 0.0) & (some > 0.0)
    return Verdicts(nothing, nothing)


@kernel(inline=True)
def put_verdicts(spheres, verdicts):
    """Write hits, and lanes left to others."""
    out = view_lanes(spheres.words[VERDICTS_AT], 2)
    out[0] = select(verdicts.hits, 1.0, 0.0)
    out[1] = select(verdicts.open & ~verdicts.hits, 1.0, 0.0)


@kernel(inline=True)
def _put_place(scene, rows, k, body, spheres, out):
    """Write the k-th of the spheres in rows, of a body, into the lanes."""
    link = LINK_POSE * scene.bodies[BODY_INTS * body + LINK]
    links = spheres.links
    at = SPHERE * k
    size = 0.0 * links[link]
    for i in range(3):
        c = links[link + 3 * i] * rows[at] + links[link + 3 * i + 1] * rows[at + 1] + (
            links[link + 3 * i + 2] * rows[at + 2])
        t = links[link + 9 + i]
        out[SPHERE_PLACE * k + i] = c + t
        size = size + (abs(c) + abs(t))
    out[SPHERE_PLACE * k + 3] = scene.slack * (size + abs(rows[at]) + abs(rows[at + 1]) + abs(rows[at + 2]))


@kernel(inline=True)
def _place_spheres(scene, spheres, body):
    """Place a body's spheres, unless placed already."""
    if spheres.placed[body] == spheres.words[N_PLACED]:
        return
    spheres.placed[body] = spheres.words[N_PLACED]
    at = BODY_SPHERES * body
    for k in range(spheres.counts[at + N_OUTER]):
        _put_place(scene, spheres.spheres, spheres.counts[at + FIRST_OUTER] + k, body, spheres, spheres.sphere_lanes)
    for k in range(spheres.counts[at + N_INNER]):
        _put_place(scene, spheres.spheres, spheres.counts[at + FIRST_INNER] + k, body, spheres, spheres.sphere_lanes)


@kernel
def check_among_parts(scene, spheres, body, margin, verdicts):
    """The `Verdicts` after a body has been asked about the parts around: down their tree, wherever a lane is near.

    margin : what is not farther apart is left open [m], a number or lanes.
    """
    words = scene.words
    place = spheres.around_lanes
    at = SPHERE_PLACE * body
    reach = spheres.around_bodies[SPHERE * body + PADDED_RADIUS] + place[at + 3] + margin
    low_x = place[at] - reach
    low_y = place[at + 1] - reach
    low_z = place[at + 2] - reach
    high_x = place[at] + reach
    high_y = place[at + 1] + reach
    high_z = place[at + 2] + reach
    n_nodes = words[N_NODES]
    nodes = view_f64(words[NODES_AT], 6 * n_nodes)
    links = view_i64(words[NODE_LINKS_AT], NODE_LINK * n_nodes)
    node = 0
    while node < n_nodes:
        n = 6 * node
        is_apart = (low_x > nodes[n + 3]) | (high_x < nodes[n]) | (low_y > nodes[n + 4]) | (high_y < nodes[n + 1]) | (
            (low_z > nodes[n + 5]) | (high_z < nodes[n + 2]))
        is_near = ~verdicts.hits & ~is_apart
        meets = any_of(is_near)
        part = links[NODE_LINK * node + BODY]
        if meets and part >= 0:
            verdicts = _check_part(scene, spheres, body, part, margin, is_near, verdicts)
        node = node + 1 if meets else links[NODE_LINK * node + SKIP]
    unbounded = view_i64(words[UNBOUNDED_AT], words[N_UNBOUNDED])
    for k in range(words[N_UNBOUNDED]):
        verdicts = _check_part(scene, spheres, body, unbounded[k], margin, ~verdicts.hits, verdicts)
    return verdicts


@kernel
def _check_part(scene, spheres, body, part, margin, is_near, verdicts):
    """The `Verdicts` after a body has been asked about a part around, in the lanes that are near."""
    words = scene.words
    if is_allowed(scene, body, view_i64(words[BODY_OF_AT], part + 1)[part]):
        return verdicts
    place = spheres.around_lanes
    core = _core_of(scene, spheres, part)
    radius = spheres.around_bodies[SPHERE * body + PADDED_RADIUS]
    reach = radius + core.at_most + place[SPHERE_PLACE * body + 3] + margin
    is_near = is_near & ~(_squared_gap(core, place, body) > reach * reach)
    if not any_of(is_near):
        return verdicts
    _place_spheres(scene, spheres, body)
    at = BODY_SPHERES * body
    is_exact = spheres.counts[at + IS_EXACT] != 0
    hits = verdicts.hits
    possible = hits & ~hits
    place = spheres.sphere_lanes
    rows = spheres.spheres
    for k in range(spheres.counts[at + FIRST_OUTER], spheres.counts[at + FIRST_OUTER] + spheres.counts[at + N_OUTER]):
        radius = rows[SPHERE * k + PADDED_RADIUS]
        square = _squared_gap(core, place, k)
        reach = radius + core.at_most + place[SPHERE_PLACE * k + 3] + margin
        possible = possible | (is_near & ~(square > reach * reach))
        if is_exact:
            within = radius - rows[SPHERE * k + LESS_WITHIN] + core.at_least - place[SPHERE_PLACE * k + 3]
            hits = hits | (is_near & (within > 0.0) & (square < within * within))
    if any_of(possible & ~hits) and core.at_least > -math.inf:
        first = spheres.counts[at + FIRST_INNER]
        for k in range(first, first + spheres.counts[at + N_INNER]):
            within = rows[SPHERE * k + PADDED_RADIUS] + core.at_least - place[SPHERE_PLACE * k + 3]
            hits = hits | (possible & (within > 0.0) & (_squared_gap(core, place, k) < within * within))
    return _open_in(spheres, body, -1 - part, hits, possible & ~hits, verdicts)


class Core(NamedTuple):
    """A part around without its ball.

    kind : SWEPT_BOX, ….   x, y, z : `Vec3`, the axes of its frame in W, columns of its pose.   p : `Vec3`, its middle.
    sides : `Vec3`, half sides; radius, half length; or a normal.   offset : of a half-space.
    at_most, at_least : radius of the ball, rounding included.
    """

    kind: int
    x: Vec3
    y: Vec3
    z: Vec3
    p: Vec3
    sides: Vec3
    offset: float
    at_most: float
    at_least: float


@kernel(inline=True)
def _core_of(scene, spheres, part):
    """The `Core` of a part around, where it stands."""
    k = scene.words[N_LINK_PARTS] + part
    poses = scene.poses
    boxes = scene.part_boxes
    numbers = spheres.part_numbers
    at = POSE * k
    n = PART_NUMBERS * part
    kind = spheres.part_kinds[part]
    x = Vec3(poses[at], poses[at + 3], poses[at + 6])
    y = Vec3(poses[at + 1], poses[at + 4], poses[at + 7])
    z = Vec3(poses[at + 2], poses[at + 5], poses[at + 8])
    b = BOX * k
    p = Vec3(poses[at + 9], poses[at + 10], poses[at + 11])
    size = abs(p.x) + abs(p.y) + abs(p.z) + abs(numbers[n + 3])
    if kind != PLANE:
        c = Vec3(
            x.x * boxes[b] + y.x * boxes[b + 1] + z.x * boxes[b + 2],
            x.y * boxes[b] + y.y * boxes[b + 1] + z.y * boxes[b + 2],
            x.z * boxes[b] + y.z * boxes[b + 1] + z.z * boxes[b + 2],
        )
        size += abs(c.x) + abs(c.y) + abs(c.z) + abs(boxes[b]) + abs(boxes[b + 1]) + abs(boxes[b + 2])
        p = Vec3(p.x + c.x, p.y + c.y, p.z + c.z)
    sides = Vec3(numbers[n], numbers[n + 1], numbers[n + 2])
    size += abs(sides.x) + abs(sides.y) + abs(sides.z) + abs(numbers[n + AT_MOST])
    slop = scene.slack * size + poses[at + 12]
    return Core(
        kind, x, y, z, p, sides, numbers[n + 3], numbers[n + AT_MOST] + slop, numbers[n + AT_LEAST] - slop
    )


@kernel(inline=True)
def _squared_gap(core, place, k):
    """Squared distances [m²] of the k-th places from a part without its ball; 0 within."""
    dx = place[SPHERE_PLACE * k] - core.p.x
    dy = place[SPHERE_PLACE * k + 1] - core.p.y
    dz = place[SPHERE_PLACE * k + 2] - core.p.z
    u = dx * core.x.x + dy * core.x.y + dz * core.x.z
    v = dx * core.y.x + dy * core.y.y + dz * core.y.z
    w = dx * core.z.x + dy * core.z.y + dz * core.z.z
    if core.kind == PLANE:
        above = _or_nothing(u * core.sides.x + v * core.sides.y + w * core.sides.z - core.offset)
        return above * above
    if core.kind == SWEPT_CYLINDER:
        across = _or_nothing(root_of(u * u + v * v) - core.sides.x)
        along = _or_nothing(abs(w) - core.sides.y)
        return across * across + along * along
    u = _or_nothing(abs(u) - core.sides.x)
    v = _or_nothing(abs(v) - core.sides.y)
    w = _or_nothing(abs(w) - core.sides.z)
    return u * u + v * v + w * w


@kernel(inline=True)
def _or_nothing(length):
    return select(length > 0.0, length, 0.0 * length)


@kernel(inline=True)
def _squared_between(places_a, a, places_b, b):
    dx = places_a[SPHERE_PLACE * a] - places_b[SPHERE_PLACE * b]
    dy = places_a[SPHERE_PLACE * a + 1] - places_b[SPHERE_PLACE * b + 1]
    dz = places_a[SPHERE_PLACE * a + 2] - places_b[SPHERE_PLACE * b + 2]
    return dx * dx + dy * dy + dz * dz


@kernel(inline=True)
def _squared_reach(places_a, a, places_b, b, radii, sign):
    """The square of two radii added, larger (sign 1) or smaller (−1) by the rounding of both places."""
    reach = radii + sign * (places_a[SPHERE_PLACE * a + 3] + places_b[SPHERE_PLACE * b + 3])
    reach = _or_nothing(reach)
    return reach * reach


@kernel
def check_pair(scene, spheres, number, a, b, margin, verdicts):
    """The `Verdicts` after a tested pair of the robot's bodies has been asked.   margin : as of `check_among_parts`."""
    around = spheres.around_lanes
    radius_b = spheres.around_bodies[SPHERE * b + RADIUS]
    radii = spheres.around_bodies[SPHERE * a + RADIUS] + radius_b
    is_near = ~verdicts.hits & ~(
        _squared_between(around, a, around, b) > _squared_reach(around, a, around, b, radii + margin, 1.0))
    if not any_of(is_near):
        return verdicts
    if number < spheres.words[N_MAPS]:
        is_near = is_near & ~_are_mapped_apart(spheres, number)
        if not any_of(is_near):
            return verdicts
    _place_spheres(scene, spheres, a)
    _place_spheres(scene, spheres, b)
    place = spheres.sphere_lanes
    rows = spheres.spheres
    counts = spheres.counts
    at = BODY_SPHERES * a
    to = BODY_SPHERES * b
    are_exact = counts[at + IS_EXACT] != 0 and counts[to + IS_EXACT] != 0
    hits = verdicts.hits
    possible = hits & ~hits
    for i in range(counts[at + FIRST_OUTER], counts[at + FIRST_OUTER] + counts[at + N_OUTER]):
        radius = rows[SPHERE * i + RADIUS]
        some = is_near & ~(
            _squared_between(place, i, around, b)
            > _squared_reach(place, i, around, b, radius + radius_b + margin, 1.0))
        if not any_of(some):
            continue
        for j in range(counts[to + FIRST_OUTER], counts[to + FIRST_OUTER] + counts[to + N_OUTER]):
            radii = radius + rows[SPHERE * j + RADIUS]
            square = _squared_between(place, i, place, j)
            possible = possible | (some & ~(square > _squared_reach(place, i, place, j, radii + margin, 1.0)))
            if are_exact:
                within = radii - (rows[SPHERE * i + LESS_WITHIN] + rows[SPHERE * j + LESS_WITHIN])
                hits = hits | (some & (square < _squared_reach(place, i, place, j, within, -1.0)))
    if not are_exact and any_of(possible):
        hits = _check_within(spheres, a, b, possible, hits)
    return _open_in(spheres, a, b, hits, possible & ~hits, verdicts)


@kernel
def _are_mapped_apart(spheres, number):
    """Lanes in which a tested pair is apart by its map: in all cells around the columns."""
    ints = view_i64(spheres.words[MAP_INTS_AT] + 8 * MAP_INTS * number, MAP_INTS)
    doubles = view_f64(spheres.words[MAP_DOUBLES_AT] + 8 * MAP_DOUBLES * number, MAP_DOUBLES)
    flags = view_f64(spheres.words[FLAGS_AT], LANES)
    columns = view_f64(spheres.words[COLUMNS_AT], LANES * spheres.words[N_COLUMNS])
    spans = view_f64(spheres.words[SPANS_AT], LANES * spheres.words[N_COLUMNS])
    n_first = ints[N_FIRST]
    n_second = ints[N_SECOND]
    cells = view_u8(spheres.words[MAP_CELLS_AT] + ints[CELLS_AT], n_first * n_second)
    for lane in range(LANES):
        at = LANES * ints[FIRST_COLUMN] + lane
        to = LANES * ints[SECOND_COLUMN] + lane
        low = (columns[at] - spans[at] - doubles[LOW_FIRST]) * doubles[PER_FIRST]
        high = (columns[at] + spans[at] - doubles[LOW_FIRST]) * doubles[PER_FIRST]
        low_second = 0.0
        high_second = 0.0
        if n_second > 1:
            low_second = (columns[to] - spans[to] - doubles[LOW_SECOND]) * doubles[PER_SECOND]
            high_second = (columns[to] + spans[to] - doubles[LOW_SECOND]) * doubles[PER_SECOND]
        is_apart = low >= 0.0 and high < n_first and low_second >= 0.0 and high_second < n_second
        if is_apart:
            for i in range(int(low), int(high) + 1):
                for j in range(int(low_second), int(high_second) + 1):
                    is_apart = is_apart and cells[i * n_second + j] != 0
        flags[lane] = 1.0 if is_apart else 0.0
    return view_lanes(spheres.words[FLAGS_AT], 1)[0] > 0.5


@kernel(inline=True)
def _open_in(spheres, body, partner, hits, possible, verdicts):
    """The `Verdicts` with these hits, and a pair left open in these lanes. Without space pairs are counted alone."""
    if any_of(possible):
        n = spheres.words[N_PAIRS]
        if n < spheres.words[PAIR_CAPACITY]:
            pairs = view_i64(spheres.words[PAIRS_AT], OPEN_PAIR * (n + 1))
            pairs[OPEN_PAIR * n] = body
            pairs[OPEN_PAIR * n + 1] = partner
            pairs[OPEN_PAIR * n + 2] = bits_of(possible)
        spheres.words[N_PAIRS] = n + 1
    return Verdicts(hits, verdicts.open | possible)


@kernel
def _check_within(spheres, a, b, possible, hits):
    """Hits of inner spheres of two bodies added; of a body that is its outer spheres these are inner ones, too."""
    place = spheres.sphere_lanes
    rows = spheres.spheres
    counts = spheres.counts
    at = BODY_SPHERES * a
    to = BODY_SPHERES * b
    which_a = FIRST_OUTER if counts[at + IS_EXACT] != 0 else FIRST_INNER
    which_b = FIRST_OUTER if counts[to + IS_EXACT] != 0 else FIRST_INNER
    for i in range(counts[at + which_a], counts[at + which_a] + counts[at + which_a + 1]):
        for j in range(counts[to + which_b], counts[to + which_b] + counts[to + which_b + 1]):
            within = rows[SPHERE * i + RADIUS] - rows[SPHERE * i + LESS_WITHIN] + (
                rows[SPHERE * j + RADIUS] - rows[SPHERE * j + LESS_WITHIN])
            reach = _squared_reach(place, i, place, j, within, -1.0)
            hits = hits | (possible & (_squared_between(place, i, place, j) < reach))
    return hits
