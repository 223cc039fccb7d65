"""Spheres around bodies, proven to contain them, and audits of published spheres."""
