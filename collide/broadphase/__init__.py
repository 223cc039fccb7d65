"""Pairs of bodies whose boxes are near: a box-tree over the bodies, and the filters of pairs never tested."""
