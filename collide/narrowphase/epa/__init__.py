"""EPA: the smallest translation that separates two overlapping cores, with a proven bracket.

van den Bergen 2001. A polytope inside A ⊖ B grows towards the facet whose plane lies nearest the origin, until
the support plane of that facet coincides with it. `initial_polytope.py` is where it begins, `polytope_surface.py` the
polytope, `expand_polytope.py` its growth in doubles, `refine_depth.py` the last digits.

Upper bound of the depth: the value of any support plane. Lower bound: the surface is closed and oriented by
construction (facets are exchanged for others with the same border). If each facet is seen from the origin on its
inner side, the radial map onto the sphere has positive degree, so every ray meets a facet, and the ball as large
as the least distance lies within the surface. Nothing of this needs the surface to be convex, which rounding may dent,
nor its corners to be points of A ⊖ B: taken as they stand, each is at most ``error`` from one, so the surface lies in A
⊖ B grown by that much, and since A ⊖ B is convex, it holds the ball that is smaller by as much.
"""
