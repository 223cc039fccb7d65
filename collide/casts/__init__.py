"""Casts: how far a ray, or a body moved along a direction, gets before touching another body."""
