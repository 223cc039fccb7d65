"""Worlds as sensors give them: trees of points and cells, terrain, sampled distances, and files and messages as arrays."""
