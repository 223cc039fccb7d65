"""Joint values as they are written on a command line: states by name, files, values in order, values by name."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from collide.errors import InvalidArgument, SceneError
from collide.scenes.description import Scene
from collide.scenes.loaders.states import read_state


def in_states(scene: Scene, words: Iterable[str]) -> list[tuple[str, Scene]]:
    """The scene in every state that the words name: (label, scene), in their order.

    words : each the name of a state or file, several of them separated by commas, numbers in the order of the
        scene's joints (``0,0.5,-1``), or ``joint=value,joint=value``.

    Raises SceneError where a word is none of these, or names no joint.
    """
    return [(label, _placed(scene, label, values)) for word in words for label, values in _states_of(scene, word)]


def _placed(scene: Scene, label: str, values: dict[str, float]) -> Scene:
    try:
        return scene.with_state(values)
    except InvalidArgument as error:
        raise SceneError(str(error), path=f"state {label}") from None


def _states_of(scene: Scene, word: str) -> list[tuple[str, dict[str, float]]]:
    pieces = [piece.strip() for piece in word.split(",") if piece.strip()]
    if word in scene.states or Path(word).is_file() or (len(pieces) < 2 and "=" not in word):
        return [(word, _named(scene, word))]
    if all("=" in piece for piece in pieces):
        return [(word, dict(_assigned(piece) for piece in pieces))]
    numbers = [_number(piece) for piece in pieces]
    if all(number is not None for number in numbers):
        return [(word, _in_order(scene, [number for number in numbers if number is not None]))]
    return [(piece, _named(scene, piece)) for piece in pieces]


def _named(scene: Scene, word: str) -> dict[str, float]:
    if word in scene.states:
        return scene.states[word]
    if Path(word).is_file():
        return read_state(word)
    number = _number(word)
    if number is not None:
        return _in_order(scene, [number])
    raise SceneError(
        f"unknown state {word!r}; it has {', '.join(scene.states) or 'none'}; there is no file of joint values of that "
        "name either",
        path=f"scene {scene.name}",
    )


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _assigned(piece: str) -> tuple[str, float]:
    joint, _, text = piece.rpartition("=")
    value = _number(text)
    if value is None:
        raise SceneError(f"must be a number, got {text!r}", path="--state", element=f"joint {joint.strip()}")
    return joint.strip(), value


def _in_order(scene: Scene, values: list[float]) -> dict[str, float]:
    joints = [joint for placement in scene.placements.values() for joint in placement.robot.joint_names]
    if len(values) != len(joints):
        raise SceneError(
            f"{len(values)} joint value{'s' * (len(values) != 1)} given, its robots have {len(joints)} joints: "
            f"{', '.join(joints) or 'none'}; "
            "joint=value,... names some of them",
            path=f"scene {scene.name}",
        )
    return dict(zip(joints, values))
