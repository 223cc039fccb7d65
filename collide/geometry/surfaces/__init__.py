"""Triangle surfaces: which facets meet where, what bounds a solid, and what is wrong where nothing does."""
