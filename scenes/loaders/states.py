"""Joint states from YAML or JSON: ``{joint: value}``, or lists of names and positions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from collide.errors import brief, cut
from collide.scenes.loaders.documents import read_document
from collide.scenes.loaders.fields import Fields


def read_state(path) -> dict[str, float]:
    """joint -> value [rad] or [m] from a file.

    Accepted: a mapping of joints to numbers; a mapping with ``name`` or ``joint_names`` beside
    ``position`` or ``positions``, as ROS prints a JointState; either of these under ``joint_state``.

    Raises SceneError naming file, joint and value.
    """
    path = Path(path)
    return state_of(read_document(path), path)


def state_of(data: Any, path: object, element: str = "") -> dict[str, float]:
    """The joint values that a piece of a document holds."""
    fields = Fields(data, path, element)
    if "joint_state" in fields and isinstance(data["joint_state"], dict):
        return state_of(data["joint_state"], path, fields.place("joint_state"))
    names_key = next((key for key in ("name", "joint_names") if isinstance(fields.get(key), list)), None)
    if names_key is None:
        return {str(joint): fields.checked_number(value, str(joint)) for joint, value in data.items()}
    names, positions_key = fields.words(names_key), "positions" if "positions" in fields else "position"
    positions = fields.get(positions_key)
    if not isinstance(positions, list) or len(positions) != len(names):
        fields.fail(
            f"must hold one value for each of the {len(names)} joints in {names_key}, got {brief(positions)}",
            positions_key,
        )
    values: dict[str, float] = {}
    for k, (joint, value) in enumerate(zip(names, positions)):
        if joint in values:
            fields.fail(f'joint "{cut(joint)}" stands twice', names_key)
        values[joint] = fields.checked_number(value, f'{positions_key}[{k}] "{cut(joint)}"')
    return values


def looks_like_state(data: Any) -> bool:
    """Whether a document is joint values rather than a scene: for a helpful message."""
    if not isinstance(data, dict) or not data:
        return False
    if any(isinstance(data.get(key), list) for key in ("position", "positions")) or "joint_state" in data:
        return True
    return all(isinstance(value, (int, float)) for value in data.values())
