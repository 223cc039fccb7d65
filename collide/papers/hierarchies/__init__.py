"""Dobkin-Kirkpatrick hierarchies, polars, the walk of Barba and Langerman, and the graded tree of Erickson.

`hierarchy.py` makes hierarchies, `packed_hierarchy.py` lays a hierarchy out for kernels; `matrix_game.py` compares two
constant-size polyhedra, `walk_steps.py` goes down a level of a hierarchy, `walk_proof.py` proves the walk's
answers, `walk.py` is the kernel and `hierarchy_queries.py` the functions for Python. No other room needs this room.
"""
