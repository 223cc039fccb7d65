"""EPA: the smallest translation that separates two overlapping cores, with a proven bracket.

van den Bergen 2001. A polytope inside A ⊖ B grows towards the facet whose plane lies nearest the origin, until the
support plane of this facet coincides with the facet's plane. `initial_polytope.py` is the beginning,
`polytope_surface.py` the polytope, `expand_polytope.py` its growth in doubles, `refine_depth.py` the last digits.

Upper bound of the depth: the value of any support plane. Lower bound: the surface is closed and oriented by
construction (facets are exchanged for others with the same border). If each facet is seen from the origin on its inner
side, the radial map onto the sphere has positive degree, so every ray meets a facet, and the ball as large as the least
distance lies within the surface. The proof needs neither a convex surface (rounding may dent the surface), nor corners
in A ⊖ B: taken as they stand, each is at most ``error`` from a point of A ⊖ B, so the surface lies in A ⊖ B grown by
``error``, and A ⊖ B, being convex, holds the ball shrunk by as much.
"""
