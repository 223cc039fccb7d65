"""Solids made of solids: arrangements of posed meshes, decided exactly, booleans and volumes of overlaps."""
