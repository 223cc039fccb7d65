"""`install`: ``import pinocchio`` finds Pinocchio with collide's collisions and distances; all other names are its own.

    from collide.adapters.hosts import pinocchio_module
    pinocchio_module.install()        # before anything imports pinocchio; or: with pinocchio_module.install(): …
    import pinocchio
    pinocchio.computeCollisions(model, data, geom_model, geom_data, q, True)

Functions with a capital in the middle are Pinocchio's names, with its forms of arguments: geometries, a model with
geometries, a broadphase manager, pools. What each writes is said in `pinocchio.py` beside this file.
"""

from __future__ import annotations

import sys
import weakref
from types import ModuleType
from typing import Any

import numpy as np

from collide.adapters.hosts import pinocchio as answers
from collide.adapters.hosts.host_numbers import of_kind, row
from collide.adapters.hosts.stand_in import warn_of_holders
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, UnsupportedQuery

__all__ = ["install", "installed", "uninstall"]

_before: ModuleType | None = None
_module: ModuleType | None = None
#: (model, geometry model, geometry data) of managers and pools: each call of theirs makes new Python objects.
_parts: weakref.WeakKeyDictionary[Any, tuple] = weakref.WeakKeyDictionary()


def install() -> _Installed:
    """Let ``import pinocchio`` find this module's functions, until `uninstall`, or to the end of a ``with`` block.

    Returns
    -------
    context manager : its value is the module that imports find. Installing twice is as once.

    Raises
    ------
    MissingExtra : without Pinocchio.

    Notes
    -----
    Modules that imported Pinocchio before keep it: a RuntimeWarning names them. ``pinocchio.__wrapped__`` is Pinocchio.
    """
    global _before, _module
    if _module is None:
        genuine = answers.genuine()
        _before, _module = sys.modules.get("pinocchio"), _Pinocchio(genuine)
        sys.modules["pinocchio"] = _module
        warn_of_holders(genuine, "pinocchio", stacklevel=2)
    return _Installed()


def uninstall() -> None:
    """Let ``import pinocchio`` find Pinocchio again; modules that hold ours keep it."""
    global _before, _module
    if _module is not None and _before is not None:
        sys.modules["pinocchio"] = _before
    _before = _module = None


def installed() -> bool:
    """Whether ``import pinocchio`` finds collide's answers."""
    return _module is not None


class _Installed:
    """Leaving the block takes the module away."""

    def __enter__(self) -> ModuleType:
        return sys.modules["pinocchio"]

    def __exit__(self, *exception) -> None:
        uninstall()


class _Pinocchio(ModuleType):
    """Pinocchio, but for five functions."""

    def __init__(self, genuine: ModuleType):
        super().__init__("pinocchio", genuine.__doc__)
        self.__wrapped__, self.__path__, self.__file__ = genuine, genuine.__path__, genuine.__file__
        self.__all__ = [name for name in dir(genuine) if not name.startswith("_")]
        for function in (
            computeCollisions, computeDistances, computeCollision, computeDistance, computeCollisionsInParallel,
        ):
            setattr(self, function.__name__, function)

    def __getattr__(self, name: str):
        return getattr(self.__wrapped__, name)

    def __dir__(self):
        return dir(self.__wrapped__)


# --- Pinocchio's functions ----------------------------------------------------------------------


def computeCollisions(*args, **keywords) -> bool:
    """Whether any active pair collides.

    Parameters
    ----------
    args : ``(geometry_model, geometry_data)``, ``(model, data, geometry_model, geometry_data, q)``, ``(manager)`` or
        ``(model, data, manager, q)``, and ``stop_at_first_collision``, False if left out.

    Raises
    ------
    UnsupportedQuery : of a callback, whose results Pinocchio alone can write.
    InvalidArgument, InvalidShape : as of `answers.compute_collisions`.
    TypeError : for other arguments.
    """
    model, data, geom_model, geom_data, q, *rest = _asked("computeCollisions", args, keywords, 1)
    return answers.compute_collisions(model, data, geom_model, geom_data, q, stop_at_first=bool(rest and rest[0]))


def computeDistances(*args, **keywords) -> int:
    """Distances of all active pairs into ``geometry_data.distanceResults``; the number of the nearest pair.

    Parameters
    ----------
    args : ``(geometry_model, geometry_data)`` or ``(model, data, geometry_model, geometry_data, q)``.

    Raises
    ------
    InvalidArgument, InvalidShape, UnsupportedQuery, TypeError : as of `computeCollisions`.
    """
    model, data, geom_model, geom_data, q = _asked("computeDistances", args, keywords, 0)
    return answers.compute_distances(model, data, geom_model, geom_data, q)


def computeCollision(geometry_model, geometry_data, pair_index, collision_request=None) -> bool:
    """Whether one pair collides, at the placements as they stand; its result takes the contacts.

    collision_request : in place of the pair's own.
    """
    k = _pair(geometry_model, geometry_data, pair_index)
    return answers.collide_pair(geometry_model, geometry_data, k, collision_request)


def computeDistance(geometry_model, geometry_data, pair_index):
    """The distance of one pair at the placements as they stand: its ``DistanceResult``."""
    k = _pair(geometry_model, geometry_data, pair_index)
    answers.compute_distances(None, None, geometry_model, geometry_data, None, only=k)
    return geometry_data.distanceResults[k]


def computeCollisionsInParallel(num_thread, *args, **keywords):
    """The same of many configurations, (nq, N) columns of a pool's model; or of one, as of `computeCollisions`.

    Returns
    -------
    (N,) bool; of one configuration a bool

    Notes
    -----
    ``num_thread`` is checked and has no effect: pairs of many configurations are one batch. Columns after the first
    that collides are False with ``stop_at_first_collision_in_batch``.
    """
    checks.integer("num_thread", num_thread, 1)
    pin = answers.genuine()
    if args and isinstance(args[0], (pin.GeometryModel, pin.Model)):
        return computeCollisions(*args, **keywords)
    pool, q, _, in_batch = _bound(
        "computeCollisionsInParallel", args, keywords,
        ("pool", "q", "stop_at_first_collision_in_configuration", "stop_at_first_collision_in_batch"), (False, False),
    )
    if not hasattr(pool, "getGeometryModel"):
        raise TypeError(f"computeCollisionsInParallel takes a pool or models, got {checks.brief(pool)}")
    if pool not in _parts:
        _parts[pool] = pool.getModel(0), pool.getData(0), pool.getGeometryModel(0), pool.getGeometryData(0)
    columns = checks.array("q", q, "(nq, N)", InvalidArgument)
    hits = answers.collides(*_parts[pool], np.ascontiguousarray(columns.T))
    if in_batch and hits.any():
        hits[hits.argmax() + 1 :] = False
    return hits


# --- arguments ----------------------------------------------------------------------------------


def _asked(name: str, args: tuple, keywords: dict, n_options: int) -> tuple:
    """(model, data, geom_model, geom_data, q, and up to one option) of each form; model, data and q None where
    placements count as they stand.
    """
    pin = answers.genuine()
    option = ("stop_at_first_collision",)[:n_options]
    first = args[0] if args else next(iter(keywords.values()), None)
    if isinstance(first, pin.GeometryModel):
        names = ("geometry_model", "geometry_data", *option)
        geom_model, geom_data, *rest = _bound(name, args, keywords, names, (False,) * n_options)
        return None, None, geom_model, geom_data, None, *rest
    if isinstance(first, pin.Model) and len(args) > 2 and hasattr(args[2], "getGeometryModel") and n_options:
        model, data, manager, q, stop = _bound(
            name, args, keywords, ("model", "data", "broadphase_manager", "q", *option), (False,)
        )
        _refuse_callback(q)
        return model, data, *_of_manager(manager), q, stop
    if isinstance(first, pin.Model):
        names = ("model", "data", "geometry_model", "geometry_data", "q", *option)
        return _bound(name, args, keywords, names, (False,) * n_options)
    if hasattr(first, "getGeometryModel") and n_options:
        manager, stop = _bound(name, args, keywords, ("manager", *option), (False,))
        _refuse_callback(stop)
        return None, None, *_of_manager(manager), None, stop
    raise TypeError(f"{name} takes a geometry model, a model or a broadphase manager first, got {checks.brief(first)}")


def _of_manager(manager) -> tuple:
    """(geometry model, geometry data) of a broadphase manager."""
    if manager not in _parts:
        _parts[manager] = manager.getGeometryModel(), manager.getGeometryData()
    return _parts[manager]


def _refuse_callback(value) -> None:
    if isinstance(value, answers.genuine().CollisionCallBackBase):
        raise UnsupportedQuery(
            f"computeCollisions: a {type(value).__name__} can be written by Pinocchio alone; leave it out and read "
            "geometry_data.collisionResults, or ask pinocchio.__wrapped__"
        )


def _bound(name: str, args: tuple, keywords: dict, names: tuple[str, ...], defaults: tuple) -> tuple:
    """The arguments of a call by their names. Raises TypeError as Pinocchio's bindings do."""
    positional = dict(zip(names, args))
    wrong = [key for key in keywords if key not in names or key in positional]
    required = names[: len(names) - len(defaults)]
    values = dict(zip(names[len(required) :], defaults)) | positional | keywords
    if len(args) > len(names) or wrong or any(key not in values for key in required):
        raise TypeError(f"{name} takes ({', '.join(names)})" + (f", not {', '.join(wrong)}" if wrong else ""))
    return tuple(values[key] for key in names)


def _pair(geom_model, geom_data, pair_index) -> int:
    pin = answers.genuine()
    of_kind("geometry_model", geom_model, pin.GeometryModel)
    of_kind("geometry_data", geom_data, pin.GeometryData)
    return row("pair_index", pair_index, len(geom_model.collisionPairs))
