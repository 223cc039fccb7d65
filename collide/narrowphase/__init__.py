"""Who touches whom, how far, with proof: one file per method and per special pair.

`matrix` shows which method answers which pair; `answer` runs it over a list of pairs.
"""
