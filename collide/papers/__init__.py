"""The structures of three papers, letter by letter: hierarchies, polytopes in R^d, partitions, cells of tetrahedra.

Erickson, "Local polyhedra and geometric graphs"; Barba and Langerman, "Optimal detection of intersections between
convex polyhedra"; Barba and Mulzer, "Asymmetric convex intersection testing". No query outside this room needs them.
"""
