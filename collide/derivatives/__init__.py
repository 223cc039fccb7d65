"""Derivatives of pair queries: of distance, points and normal by the poses of both bodies (docs/derivatives.md)."""
