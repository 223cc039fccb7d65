"""Casts: how far a ray, or a body that is moved along a direction, gets before it touches something."""
