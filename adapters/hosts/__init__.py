"""Programs written for other engines, run on collide: one module a host.

Nothing of a host is imported before it is asked for.
"""
