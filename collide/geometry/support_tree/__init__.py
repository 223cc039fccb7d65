"""The extreme vertex of a large hull in a direction, in logarithmic time, with an exact last step.

`build.py` makes a `SupportTree` (`layout.py`) with the kernels of `lists.py`; `query.py` walks down its
candidate lists, `settle.py` proves the vertex found or climbs to the right one, `validate.py` checks a tree.
"""
