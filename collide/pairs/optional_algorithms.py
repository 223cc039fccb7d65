"""Algorithms that a pair query may be asked for by name, in place of the default narrowphase.

The core knows their names and where they are found, without importing them: a module is loaded when its algorithm is
first asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from collide.errors import InvalidArgument, brief

#: The name of the default narrowphase.
DEFAULT = "gjk"

#: Query → name of the algorithm → module and function. A function takes (A, B, X_WA, X_WB, check_poses) and
#: returns what the query does.
_ALGORITHMS = {
    "collide": {"barba-langerman": ("collide.papers.hierarchies.hierarchy_queries", "collide_by_walk")},
}


def named_algorithm(query: str, name: object) -> Callable | None:
    """The function that answers a query by the algorithm of this name; ``None`` for the default.

    Raises InvalidArgument, with the names to choose from, where the query has no algorithm of this name.
    """
    if name is None or (isinstance(name, str) and name == DEFAULT):
        return None
    place = _ALGORITHMS[query].get(name) if isinstance(name, str) else None
    if place is None:
        names = " or ".join(f'"{known}"' for known in (DEFAULT, *_ALGORITHMS[query]))
        raise InvalidArgument(f"algorithm must be {names}, got {brief(name)}")
    module, function = place
    return getattr(import_module(module), function)
