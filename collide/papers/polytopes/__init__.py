"""Convex sets given by points and by half-spaces, in the plane and up to d = 8. Public names: `collide.polytopes`."""
