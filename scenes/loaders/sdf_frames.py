"""Frames of an SDFormat file: which element stands where, in the frame of the model or world around it.

A scope is a model or a world. Links, joints, frames and models in it are frames, told by name; ``a::b`` is b within the
model a. Poses are relative to the frame that they name (``relative_to``), else: links, frames and models to the scope's
own frame, joints to their child, frames attached to another to that one. (SDFormat's specification, "Pose frame
semantics"; files up to version 1.6 know no ``relative_to``.)
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

import numpy as np

from collide.errors import InvalidPose, cut, listing
from collide.scenes.loaders.fields import placed
from collide.scenes.loaders.robot_reading import Reading
from collide.transforms import inverse_pose, pose

#: The frame of the model, and that of the world, as they are called within.
MODEL, WORLD = "__model__", "world"


@dataclass
class Scope:
    """A model or a world.

    name : within the scope around it.   element : <model> or <world>.   reading : the file that it is in.
    frames : name → the element with its pose.   models : name → the scope of a model within.
    frame_of_pose : of a model whose pose is that of another of its frames (``placement_frame``).
    version : of the format of its file.
    """

    name: str
    element: ET.Element
    reading: Reading
    placed_by: ET.Element | None = None
    frame_of_pose: str | None = None
    static: bool = False
    version: tuple[int, ...] = ()
    frames: dict[str, ET.Element] = field(default_factory=dict)
    models: dict[str, Scope] = field(default_factory=dict)
    _X_SF: dict[str, np.ndarray] = field(default_factory=dict)

    def X_SF(self, name: str, place: str) -> np.ndarray:
        """(4, 4) pose of a frame F in this scope's own frame S. Raises SceneError for unknown frames and circles."""
        chain: dict[str, None] = {}  # in order, and found at once
        while not (self._is_own(name) or name in self._X_SF):
            if name in chain:
                self.reading.fail(place, f"poses are relative to each other in a circle: {listing([*chain, name])}")
            chain[name] = None
            name = self._relative_to(name, place)
        X_SR = np.eye(4) if self._is_own(name) else self._X_SF[name]
        for frame in reversed(chain):
            X_RF = self._X_RF(frame, place)
            X_SR = X_RF if self._is_own(name) else X_SR if is_identity(X_RF) else X_SR @ X_RF
            self._X_SF[frame], name = X_SR, frame
        return X_SR

    def _is_own(self, name: str) -> bool:
        """Whether a frame is the scope's own."""
        return name in ("", MODEL) or self._is_world(name)

    def _is_world(self, name: str) -> bool:
        """Whether the world is meant: files older than version 1.7 have links that are called so."""
        return name == WORLD and not (WORLD in self.frames and self.frames[WORLD].tag == "link")

    def _relative_to(self, name: str, place: str) -> str:
        """The frame of this scope that the pose of another is relative to."""
        first, _, rest = name.partition("::")
        if first in self.models:
            return first if rest else frame_in_pose(self.models[first].placed_by, "")
        if name not in self.frames:
            known = listing([*self.frames, *self.models])
            self.reading.fail(place, f'unknown frame "{cut(name)}"; {cut(self.name)} has {known or "none"}')
        element = self.frames[name]
        default = ""
        if element.tag == "joint":
            default = text_of(element, "child")
        elif element.tag == "frame":
            default = element.get("attached_to", "")
        return frame_in_pose(element, default)

    def _X_RF(self, name: str, place: str) -> np.ndarray:
        """(4, 4) pose of a frame in the one that its pose is relative to."""
        first, _, rest = name.partition("::")
        if first not in self.models:
            return pose_of(self.frames[name], place, self.reading)
        model = self.models[first]
        if rest:
            return model.X_SF(rest, place)
        X_RP = pose_of(model.placed_by, place, self.reading)
        return X_RP @ inverse_pose(model.X_SF(model.frame_of_pose, place)) if model.frame_of_pose else X_RP

    def link_of(self, name: str, place: str) -> str:
        """The link, by its name in this scope, that a frame is attached to; "world" of what is attached to the world.

        Raises SceneError for frames that are unknown or attached to no link.
        """
        chain: dict[str, None] = {}
        while True:
            if self._is_world(name):
                return WORLD
            if name in chain:
                what = f"frames are attached to each other in a circle: {listing([*chain, name])}"
                self.reading.fail(place, what)
            chain[name] = None
            first, _, rest = name.partition("::")
            if first in self.models:
                return f"{first}::{self.models[first].link_of(rest or MODEL, place)}"
            if name in ("", MODEL):
                name = self.element.get("canonical_link") or self._first_link(place)
                continue
            element = self.frames.get(name)
            if element is None:
                known = listing([*self.frames, *self.models])
                self.reading.fail(place, f'unknown link or frame "{cut(name)}"; {cut(self.name)} has {known or "none"}')
            if element.tag == "link":
                return name
            name = text_of(element, "child") if element.tag == "joint" else element.get("attached_to", "")

    def _first_link(self, place: str) -> str:
        """The first link, else the first model within."""
        for name, element in self.frames.items():
            if element.tag == "link":
                return name
        for name in self.models:
            return name
        self.reading.fail(place, f"model {cut(self.name)} has no link")


def frame_in_pose(element: ET.Element | None, default: str) -> str:
    """The frame that an element's <pose> names, else a default."""
    described = None if element is None else element.find("pose")
    return default if described is None else described.get("relative_to") or default


def is_identity(X: np.ndarray) -> bool:
    return np.array_equal(X, np.eye(4))


def text_of(element: ET.Element | None, tag: str, default: str = "") -> str:
    """The text of a child element, blanks around it left out."""
    child = None if element is None else element.find(tag)
    return default if child is None else (child.text or "").strip() or default


def pose_of(element: ET.Element | None, place: str, reading: Reading) -> np.ndarray:
    """(4, 4) what stands in the <pose> of an element; the identity without one."""
    described = None if element is None else element.find("pose")
    text = "" if described is None else (described.text or "").strip()
    if described is None or not text:
        return np.eye(4)
    try:
        if described.get("rotation_format", "euler_rpy") == "quat_xyzw":
            numbers = reading.numbers(text, 7, "<pose>", place)
            return pose(numbers[:3], quat_xyzw=numbers[3:])
        numbers = reading.numbers(text, 6, "<pose>", place)
        if is_true(described.get("degrees", "false")):
            return pose(numbers[:3], rpy_deg=numbers[3:])
        return pose(numbers[:3], R=reading.rotation(numbers[3:], f"{place} <pose>"))
    except InvalidPose as error:
        raise InvalidPose(placed(error, reading.path, f"{place} <pose>")) from None


def is_true(word: str) -> bool:
    return word.strip().lower() in ("true", "1")
