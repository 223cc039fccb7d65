"""Where two links with one or two joints between them are apart, whatever all other joints do: a grid of cells of the
two columns, each proven.

Links near each other in the tree are within a hand's breadth in most configurations, and their distance depends on the
few columns between them alone. In the middle of a cell the parts of both are asked with the most that they move towards
each other within the cell as a margin (`motion_bounds.py`: the bounds hold for all values of the columns).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64, view_u8
from collide.robots.check_scene import (
    BODY_INTS,
    COUNT,
    FIRST,
    SELF_PAIRS_AT,
    place,
    view_scene,
)
from collide.robots.forward_kinematics import COLUMN, KIND, ROTATION, ROTATION_ABOUT_COORDINATE, TRANSLATION
from collide.robots.map_layout import FIRST_COLUMN, MAP_DOUBLES, MAP_INTS, N_FIRST, N_SECOND, SECOND_COLUMN
from collide.robots.motion_bounds import begin_interval, motion_at, moved_between
from collide.robots.part_pairs import BEYOND_MARGIN, state_of_parts

#: Cells of a column, of one and of two between both links.
_CELLS_OF_ONE, _CELLS = 256, 96
#: Where fewer cells than this share are free, cells of a quarter of the width are asked as well.
_MIN_FREE, FINER = 0.9, 4
#: Cells are wider than said by this share of the numbers they are made of.
_WIDER = 1e-12

class PairMaps(NamedTuple):
    """Of the first of the tested pairs of bodies.   ints : (pairs, MAP_INTS) int64.   doubles : (pairs, MAP_DOUBLES).
    cells : (n,) uint8, 1 of a cell proven free; the second column's stand side by side.   names : of both bodies.
    """

    ints: np.ndarray
    doubles: np.ndarray
    cells: np.ndarray
    names: list[tuple[str, str]]

    def among(self, names: list[tuple[str, str]]) -> PairMaps:
        """The maps of pairs by names; none of unknown pairs."""
        rows = {pair: k for k, pair in enumerate(self.names)}
        known = [(k, rows[pair]) for k, pair in enumerate(names) if pair in rows]
        ints = np.zeros((len(names), MAP_INTS), dtype=np.int64)
        doubles = np.zeros((len(names), MAP_DOUBLES))
        if known:
            at, of = np.array(known).T
            ints[at], doubles[at] = self.ints[of], self.doubles[of]
        return PairMaps(ints, doubles, self.cells, names)

    def of_first(self, n: int) -> PairMaps:
        """The maps of the first n pairs."""
        return PairMaps(self.ints[:n], self.doubles[:n], self.cells, self.names[:n]) if n < len(self.names) else self

    def without(self, row: int) -> PairMaps:
        """The maps without the map of a pair."""
        if row >= len(self.names):
            return self
        ints, doubles = np.delete(self.ints, row, axis=0), np.delete(self.doubles, row, axis=0)
        return PairMaps(ints, doubles, self.cells, [*self.names[:row], *self.names[row + 1 :]])


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def map_pair(header_at, motions_at, pair, q0_at, q1_at, dof, ints_at, lows_at, widths_at, cells_at, coarse_at):
    """Write a byte a cell, 1 where the bodies of a tested pair are apart all over.

    q0, q1 : a configuration each, of which the columns of the map are written.   ints : MAP_INTS.   lows, widths : two
        doubles each.   coarse : cells of FINER times the width, whose parts are not asked where they are free; or 0.
    """
    scene = view_scene(header_at)
    ints = view_i64(ints_at, MAP_INTS)
    q0, q1 = view_f64(q0_at, dof), view_f64(q1_at, dof)
    lows, widths = view_f64(lows_at, 2), view_f64(widths_at, 2)
    cells = view_u8(cells_at, ints[N_FIRST] * ints[N_SECOND])
    for i in range(ints[N_FIRST]):
        _put_ends(q0, q1, ints[FIRST_COLUMN], lows[0] + i * widths[0], lows[0] + (i + 1) * widths[0])
        for j in range(ints[N_SECOND]):
            if ints[SECOND_COLUMN] != ints[FIRST_COLUMN]:
                _put_ends(q0, q1, ints[SECOND_COLUMN], lows[1] + j * widths[1], lows[1] + (j + 1) * widths[1])
            if coarse_at != 0:
                finer = FINER if ints[N_SECOND] > 1 else 1
                coarse = (i // FINER) * (ints[N_SECOND] // finer) + j // finer
                if view_u8(coarse_at, coarse + 1)[coarse] != 0:
                    cells[i * ints[N_SECOND] + j] = 1
                    continue
            motion = motion_at(scene, motions_at, q0_at, q1_at, dof, 0)
            begin_interval(motion, 0.0, 1.0)
            cells[i * ints[N_SECOND] + j] = 1 if _are_apart(motion, pair) else 0


@kernel(inline=True)
def _put_ends(q0, q1, column, low, high):
    wider = _WIDER * (abs(low) + abs(high))
    q0[column] = low - wider
    q1[column] = high + wider


@kernel(inline=True)
def _are_apart(motion, pair):
    scene = motion.scene
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * pair + 2)
    a = pairs[2 * pair]
    b = pairs[2 * pair + 1]
    margin = moved_between(motion, pair, a, b)
    first_a = scene.bodies[BODY_INTS * a + FIRST]
    first_b = scene.bodies[BODY_INTS * b + FIRST]
    for p in range(first_a, first_a + scene.bodies[BODY_INTS * a + COUNT]):
        place(scene, p, a)
        for r in range(first_b, first_b + scene.bodies[BODY_INTS * b + COUNT]):
            place(scene, r, b)
            if state_of_parts(scene, p, r, margin) != BEYOND_MARGIN:
                return False
    return True


def pair_maps(robot, setting, space) -> PairMaps:
    """Maps of tested pairs of bodies with a column or two between both.

    robot : `Robot`.   setting : `Setting`.   space : `CheckWorkspace` of it.
    """
    n = len(setting.self_pairs)
    ints, doubles = np.zeros((n, MAP_INTS), dtype=np.int64), np.zeros((n, MAP_DOUBLES))
    work, cells, at = space.motions(1.0), [np.zeros(0, dtype=np.uint8)], 0
    low, high = _ranges(robot)
    for k, columns in enumerate(_columns_between(robot, setting)):
        if columns is None:
            continue
        numbers = [_CELLS, _CELLS] if len(columns) == 2 else [_CELLS_OF_ONE, 1]
        first, second = columns[0], columns[-1]
        lows = np.array([low[first], low[second]])
        sizes, coarse = np.array([high[first] - low[first], high[second] - low[second]]), None
        while True:
            widths, q = sizes / numbers, np.zeros((2, max(robot.dof, 1)))
            ints[k], of_pair = (first, second, *numbers, at), np.zeros(numbers[0] * numbers[1], dtype=np.uint8)
            map_pair(
                space.address, work.address, k, address_of(q[0]), address_of(q[1]), robot.dof, address_of(ints[k]),
                address_of(lows), address_of(widths), address_of(of_pair), 0 if coarse is None else address_of(coarse),
            )
            if coarse is not None or of_pair.mean() >= _MIN_FREE:
                break
            coarse, numbers = of_pair, [FINER * n if n > 1 else 1 for n in numbers]
        doubles[k] = *lows, *(1.0 / widths)
        cells.append(of_pair)
        at += len(of_pair)
        if not of_pair.any():
            ints[k, N_FIRST] = 0
    return PairMaps(ints, doubles, np.concatenate(cells), names_of_pairs(setting.bodies, setting.self_pairs))


def names_of_pairs(bodies: Sequence, self_pairs: np.ndarray) -> list[tuple[str, str]]:
    """Names of both bodies of each pair."""
    names = [body.name for body in bodies]
    return [(names[a], names[b]) for a, b in self_pairs.tolist()]


def _ranges(robot) -> tuple[np.ndarray, np.ndarray]:
    """(dof,) each: where maps begin and end: limits, or a full turn about 0."""
    is_limited = np.isfinite(robot.lower) & np.isfinite(robot.upper) & (robot.upper > robot.lower)
    is_limited &= robot.upper - robot.lower < 1e6
    return np.where(is_limited, robot.lower, -math.pi), np.where(is_limited, robot.upper, math.pi)


def _columns_between(robot, setting) -> list[list[int] | None]:
    """Of each tested pair the columns, at most two, that move its bodies against each other; ``None`` of pairs with
    more, or with a joint of several columns.
    """
    table = robot.joint_table.ints
    kinds = (ROTATION, ROTATION_ABOUT_COORDINATE, TRANSLATION)
    moves = [frozenset(np.flatnonzero(robot.moves[:, body.link]).tolist()) for body in setting.bodies]
    out: list[list[int] | None] = []
    for a, b in setting.self_pairs.tolist():
        between = [k for k in moves[a] ^ moves[b] if table[k, KIND] != 0]
        columns = sorted({int(table[k, COLUMN]) for k in between})
        is_simple = all(table[k, KIND] in kinds for k in between) and 1 <= len(columns) <= 2
        out.append(columns if is_simple else None)
    return out
