"""Triangles against triangles, exactly, and the walks over two mesh trees that lead to them.

`placing.py` sets two posed trees in relation, `filtered.py` decides in doubles what doubles can decide,
`exact_points.py` and `exact.py` the rest; `surfaces.py` walks.
"""
