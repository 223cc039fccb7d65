"""Exact convex hulls of points in space: the surface of facets, built once per shape."""
