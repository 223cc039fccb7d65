"""Who could touch whom: a box-tree over the bodies, and the filters that keep pairs from it."""
