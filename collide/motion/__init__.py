"""Bodies in motion: when two of them first touch."""
