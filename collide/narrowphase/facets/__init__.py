"""Bodies of facets: triangles against triangles, exactly, and the traversals of two BVHs that lead to them.

`posed_surfaces.py` sets two posed trees in relation, `filtered_triangles.py` decides in doubles what doubles can decide,
`exact_corners.py` and `exact_triangles.py` the rest; `surface_collision.py` and `surface_distance.py` traverse.
`mesh_rows.py` makes rows of results from their answers, `mesh_curved.py` where one body has no facets.
"""
