"""Questions about surfaces beside pairs of bodies: rays, points inside, overlays, facets that meet."""
