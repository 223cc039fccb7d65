"""Triangle meshes: welding, topology, shells, and the bounding volume hierarchy (BVH) that queries traverse.

`bvh.py` holds the tree as kernels read it, `build_bvh.py` makes it.
"""
