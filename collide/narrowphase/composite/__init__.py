"""Bodies of several parts: one row a pair of bodies from rows of pairs of parts."""
