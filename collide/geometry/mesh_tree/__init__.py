"""Box-trees over the triangles of a mesh: the one that queries walk, and the one of the paper.

`layout.py` holds the tree as kernels read it, `build.py` makes it, `validate.py` checks it; `graded.py`
is Erickson's graded box-tree to the letter ("Local polyhedra and geometric graphs", 2005, section 3.2).
"""
