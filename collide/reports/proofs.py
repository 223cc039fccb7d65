"""How each answer is known to be right: a sentence for every argument that can decide a pair."""

from __future__ import annotations

from collide.results import HOW, UNDECIDED

#: What each entry of `collide.results.HOW` means to a reader.
SENTENCES = {
    "undecided": "the proven bracket reaches to both sides of zero: gap or overlap is below rounding, "
    "so neither is claimed",
    "separating plane": "all of A lies on one side of a plane and all of B on the other, "
    "by more than rounding can move them",
    "common point": "differences of points of A and B surround zero, clear of rounding: the bodies share a point",
    "swept overlap": "two core points are nearer than the sum of the radii, by more than rounding",
    "exact arithmetic": "worked out from the numbers given, in integers wherever rounding would have decided it",
    "closed form": "a formula for this pair of shapes, its rounding error bounded",
    "broadphase": "bounding boxes of whole bodies, grown by the clearance and rounded outwards, do not meet",
}

#: Why pairs were never tested, for the reasons the engine itself knows.
REASONS = {
    "static–static": "both bodies are fixed: their placement is taken as intended",
    "filtered by group and mask": "their groups and masks exclude each other",
    "allowed": "the scene allows this contact",
    "ignored": "named by --ignore",
    "cannot be answered": "listed above: whether these bodies collide is NOT known",
}

BROADPHASE = "broadphase"
IGNORED = "ignored"

UNDECIDED_NAME = HOW[UNDECIDED]


def name_of(how: int) -> str:
    """The argument's name for the number in a result row."""
    return HOW[how] if how < len(HOW) else f"argument {how}"
