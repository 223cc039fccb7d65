"""Who touches whom, how far, with proof: one file per method and per special pair.

`dispatch` shows which method answers which pair; `pair_kernel` runs it over a list of pairs.
"""
