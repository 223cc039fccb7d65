"""Kinds of convex sets: what a support mapping, and every pair of sets, is chosen by."""

from __future__ import annotations

#: POINTS is the convex hull of points, whose ids results name; the others are the sets of their names.
POINTS, CYLINDER, CONE, ELLIPSOID, HALFSPACE = range(5)
