"""Contact manifolds: where two bodies touch, overlap or nearly do, as few points with one normal a patch."""
