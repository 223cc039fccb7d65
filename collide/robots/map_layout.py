"""Layout of the maps of `pair_maps.py`, as kernels read them."""

from __future__ import annotations

# Integers of a map: two columns, their numbers of cells (0 of pairs without a map), where its cells begin.
FIRST_COLUMN, SECOND_COLUMN, N_FIRST, N_SECOND, CELLS_AT = range(5)
MAP_INTS = 5
# Doubles: where the cells of each column begin, and how many there are to a radian or metre.
LOW_FIRST, LOW_SECOND, PER_FIRST, PER_SECOND = range(4)
MAP_DOUBLES = 4
