"""Bodies of facets: triangles against triangles, exactly, and the traversals of two BVHs that lead to them.

The way in is `mesh_batches.py` (any two shapes with a mesh), then by method `mesh_pairs.py`; two bodies of facets (a
mesh and a hull, too) go to `facet_kernel_calls.py`, whose kernels `mesh_collide_kernel.py` (booleans) and
`mesh_distance_kernel.py` (rows) take whole batches; curved shapes to `mesh_curved.py`. `facet_queries.py` asks
single traversals from Python: `surface_collision.py`, `surface_distance.py`, `winding_numbers.py`, `facets_within.py`,
`ray_surface.py`, `self_collision.py`.
`posed_surfaces.py` sets two posed trees in relation, `filtered_triangles.py` decides in doubles what doubles can
decide, `exact_corners.py` and `exact_triangles.py` the rest.
"""
