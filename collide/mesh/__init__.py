"""Triangle meshes: welding, topology, shells, and the bounding volume hierarchy (BVH) that queries traverse.

`bvh.py` holds the tree as kernels read it, `build_bvh.py` makes it, `fine_boxes.py` makes its boxes finer where
details are small beside the whole mesh.
"""
