"""Curved convex sets, a file a kind: support point, extents, normal, chord of a line, points within, polytopes around.

`curved_kinds.py` lists the kinds; what it does not list is refused. Sets along z, centred at the origin of their frame.
"""
