"""Meshes of tetrahedra: made and checked, and overlaid on each other, cell by cell."""
