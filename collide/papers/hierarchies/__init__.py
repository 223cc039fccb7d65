"""Dobkin-Kirkpatrick hierarchies, polars, the walk of Barba and Langerman, and the graded tree of Erickson.

`hierarchy.py` makes hierarchies, `packed_hierarchy.py` lays one out for kernels; `matrix_game.py` compares two
constant-size polyhedra, `walk_steps.py` goes down one level of one hierarchy, `walk_proof.py` proves what the walk
says, `walk.py` is the kernel and `hierarchy_queries.py` what Python calls. Nothing outside this room needs it.
"""
