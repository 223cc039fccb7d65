"""Dobkin-Kirkpatrick hierarchies of convex hulls, plain and with bounded degree, and of their polars."""
