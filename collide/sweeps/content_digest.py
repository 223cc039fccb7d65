"""What robots, scenes and arrays hold, as a digest: equal where every number and name is, on any machine."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from collide.robots.kinematic_tree import Joint
from collide.robots.robot import Robot
from collide.shapes.shape import Shape
from collide.worlds.world import World


def digest(*values: Any) -> str:
    """A digest of plain data, arrays, shapes, robots and Worlds.

    Parameters
    ----------
    *values
        Numbers, text, None, sequences, mappings (in sorted order), numpy arrays, shapes, robots, Worlds.

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    hasher = hashlib.sha256()
    _update(hasher, values)
    return hasher.hexdigest()[:32]


def _update(hasher: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        whole = np.ascontiguousarray(value)
        hasher.update(f"array {whole.dtype.str} {whole.shape}\n".encode())
        hasher.update(whole.data if whole.size else b"")
    elif isinstance(value, Shape):
        hasher.update(f"shape {type(value).__name__}\n".encode())
        hasher.update(_of_shape(value).encode())
    elif isinstance(value, Robot):
        _update(hasher, _robot(value))
    elif isinstance(value, World):
        _update(hasher, _world(value))
    elif isinstance(value, Joint):
        _update(hasher, vars(value))
    elif isinstance(value, Mapping):
        hasher.update(f"mapping {len(value)}\n".encode())
        for key in sorted(value, key=repr):
            _update(hasher, key)
            _update(hasher, value[key])
    elif isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        hasher.update(f"sequence {len(value)}\n".encode())
        for entry in value:
            _update(hasher, entry)
    elif isinstance(value, (np.generic, str, bytes, int, float, type(None))):
        plain = value.item() if isinstance(value, np.generic) else value
        hasher.update(f"{type(plain).__name__} {plain!r}\n".encode())
    else:
        raise TypeError(f"no digest of a {type(value).__name__}")


#: Digests of shapes, never changing: id -> (the shape, kept alive so that its id stays unique; its digest).
_SHAPES: dict[int, tuple[Shape, str]] = {}
_MAX_SHAPES = 20_000


def _of_shape(shape: Shape) -> str:
    entry = _SHAPES.get(id(shape))
    if entry is None:
        values = [value for value in shape.__reduce__()[1] if not isinstance(value, type)]
        if len(_SHAPES) >= _MAX_SHAPES:
            _SHAPES.clear()
        entry = _SHAPES[id(shape)] = shape, digest(*values)
    return entry[1]


def _robot(robot: Robot) -> list[Any]:
    geometry = {
        link: [(element.shape, element.X_LG) for element in elements] for link, elements in robot.geometry.items()
    }
    return ["robot", robot.links, robot.joints, geometry, sorted((a, b) for a, b, _ in robot.disabled_pairs)]


def _world(world: World) -> list[Any]:
    bodies = [world.body(identity) for identity in world.ids]
    names = world.names
    return [
        "world",
        [
            (body.name, body.shape, body.X_WB, body.static, body.group, body.mask, body.margin, body.sleeping)
            for body in bodies
        ],
        sorted((names[a], names[b]) for a, b in world.allowed),
    ]
