"""Planners of others with collide's checks and proofs: one module a library of planners.

Nothing of a library is imported before the module is asked for.
"""
