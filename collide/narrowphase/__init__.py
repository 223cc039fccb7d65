"""Contact, gaps and depths of pairs of bodies, with proofs: a file per method and per special pair.

`dispatch` shows the method of each pair of kinds; `pair_kernel` runs the methods over a list of pairs.
"""
