"""Worlds as sensors give them: points in trees, and messages and files of points, octrees and voxels as arrays."""
