"""Whether a distance has a derivative, and the reasons against a derivative."""

from __future__ import annotations

from collide.base.worded_enum import WordedEnum


class Uniqueness(WordedEnum):
    """Whether the signed distance of a pair has a derivative by the poses, or why not.

    Members are the integers of the field ``uniqueness`` of `PairDerivatives`, and say what they mean:
    ``Uniqueness(4).meaning``.
    """

    UNIQUE = 0, "the distance has a derivative by the poses"
    UNCERTAIN = 1, "the row is not certified"
    TOO_FAR = 2, "the bodies are farther apart than max_distance: no witness points are known"
    NO_DEPTH = 3, "the bodies meet, and signed=False leaves the depth out"
    SEVERAL_POINTS = 4, "several pairs of points are as near, as of parallel faces or edges"
    SEVERAL_DIRECTIONS = 5, "several directions part the bodies by as short a way"
    SEVERAL_PARTS = 6, "several parts are as near, and part along other lines"
    NOT_CONVEX = 7, "the deciding part of a body is not known as a convex set"
    NOT_SETTLED = 8, "no features of the surfaces were proven to hold the witness points to last digits"
