"""Whether a cylinder, cone or ellipsoid and another convex set share a point, in integers: what doubles leave open.

One front door: `settle_curved.settle_curved`. The signs, with degrees and derivations: docs/curved-signs.md.
"""
