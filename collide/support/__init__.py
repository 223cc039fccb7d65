"""Support mappings: the farthest point of a convex set in a direction, by scans and by support trees.

`build_support_tree.py` makes a `SupportTree` (`support_tree.py`) with the kernels of `grow_tree.py`;
`support_tree_query.py` goes down its candidate lists, `extreme_vertex.py` proves the vertex found or climbs to the
right one.
"""
