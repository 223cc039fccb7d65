"""Kinds of convex sets: what a support mapping, and every pair of sets, is chosen by."""

from __future__ import annotations

#: POINTS is the convex hull of points, whose ids results name; the others are the sets of their names.
POINTS, CYLINDER, CONE, ELLIPSOID, HALFSPACE = range(5)
#: The numbers by name, as `lowering/kinds.py: Kind` has the names of sets.
NUMBERS = {"POINTS": POINTS, "CYLINDER": CYLINDER, "CONE": CONE, "ELLIPSOID": ELLIPSOID, "HALFSPACE": HALFSPACE}
