"""Point clouds and grids around a robot as its kernels ask about them: a walk down a tree for each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.shape_table import POSE_SLOP, POSE_STRETCH, POSE_TERMS
from collide.narrowphase.facets.nearest_item_calls import GapQuestion
from collide.narrowphase.fields.items_of import items_of
from collide.robots.check_tables import BodyAround, Surroundings


class FieldWalks(NamedTuple):
    """The words of WALKS in `check_scene.py`, (1 + parts,) int64, and the questions at their addresses."""

    words: np.ndarray
    held: list[Any]


def field_walks(around: Surroundings, doubles_at: int, integers_at: int) -> FieldWalks:
    """The walks of the parts of the surroundings; zeros for shapes without a tree of items, and for bodies with a
    margin, whose distances are asked in Python.

    doubles, integers : workspace of `answer_pairs`, a thread's.
    """
    words, held = np.zeros(1 + len(around.packed), dtype=np.int64), []
    for k, number in enumerate(around.body_of.tolist()):
        body = around.bodies[number]
        question = _question(body, around, k, (doubles_at, integers_at)) if body.shape.is_field else None
        if question is not None:
            words[1 + k] = address_of(question.header)
            held.append(question)
    return FieldWalks(words, held)


def _question(body: BodyAround, around: Surroundings, part: int, workspace: tuple[int, int]) -> GapQuestion | None:
    """The posed items of a body, beside a convex set in whose place kernels write parts."""
    items = items_of(body.shape)
    if items.walked is None or body.margin != 0.0:
        return None
    question = GapQuestion(items.walked, around.packed[part], workspace)
    X_WG, slop = items.poses_of_items(np.asarray(body.X_WB)[None])
    pose = question.poses[0]
    pose[:9], pose[9:12] = X_WG[0, :3, :3].ravel(), X_WG[0, :3, 3]
    pose[POSE_SLOP], pose[POSE_TERMS], pose[POSE_STRETCH] = np.broadcast_to(slop, 1)[0], -1.0, -1.0
    return question
