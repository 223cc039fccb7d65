"""Exact convex hulls of points in space: quickhull with exact tests, and vertices of half-space intersections."""
