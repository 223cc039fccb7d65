"""The walk of Barba and Langerman: two prepared polytopes tested in O(log n + log m) rounds, and proven.

`ladder.py` lays a hierarchy out for kernels, `game.py` compares two constant-size polyhedra, `steps.py` goes down
one level of one hierarchy, `proof.py` proves what the walk says, `walk.py` is what Python calls.
"""
