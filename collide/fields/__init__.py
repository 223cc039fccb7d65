"""Worlds as sensors give them: trees of points and cells, terrain, sampled distances, files and messages."""
