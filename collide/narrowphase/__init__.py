"""Who touches whom, how far, with proof: one file per method and per special pair.

`dispatch` shows which method answers which pair; `convex_pairs` runs it over a list of pairs.
"""
