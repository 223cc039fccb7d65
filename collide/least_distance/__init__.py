"""The nearest points of a hull of points and an intersection of half-spaces: doubles propose, integers decide."""
