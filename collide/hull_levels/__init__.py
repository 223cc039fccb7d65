"""Convex hulls of few facets around a body, and of few vertices within it, each level within the next, proven."""
