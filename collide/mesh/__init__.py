"""Triangle meshes: welding, topology, shells, and the bounding volume hierarchy (BVH) that queries traverse.

`bvh.py` holds the tree in the layout of the kernels, `build_bvh.py` builds trees, `fine_boxes.py` makes boxes finer
where details are small beside the whole mesh.
"""
