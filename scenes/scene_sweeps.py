"""Sweeps over scene files: one scene whose files are watched while it is asked, or scene after scene."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from collide.errors import InvalidArgument, SceneError, listing
from collide.robots.robot_checker import RobotChecker
from collide.scenes.description import Scene
from collide.scenes.loaders.load_scene import load
from collide.scenes.loaders.state_words import in_states
from collide.sweeps.configurations import as_configurations
from collide.sweeps.content_digest import digest
from collide.sweeps.sweep import SweepRun
from collide.sweeps.sweep_question import OneQuestion, ScenesQuestion, file_digest, question_digest
from collide.sweeps.sweep_results import SweepResults


def load_checker(place: str, options: dict[str, Any]) -> tuple[RobotChecker, np.ndarray]:
    """The checker of a scene file, and the configuration in which its robot stands (dof,)."""
    scene = _load([place], options)
    return RobotChecker.from_scene(scene), next(iter(scene.placements.values())).q


def _load(places: Sequence[str], options: dict[str, Any]) -> Scene:
    """A scene; its state may be values, as ``--state`` takes them."""
    state = options.get("state")
    if not isinstance(state, str) or not re.search(r"[,=]|^[-+\d.]", state):
        return load(*places, **options)
    return in_states(load(*places, **{**options, "state": None}), [state])[0][1]


def sweep_scene(
    places: Sequence[str], configurations: Any, folder: str | Path, *, robot: str | None = None,
    options: dict[str, Any] | None = None, distances: bool = False, values: bool = False, chunk: int | None = None,
    **how: Any,
) -> SweepResults:
    """Ask about many configurations of a robot in a scene from files, as `collide.sweep` does.

    Files that are written to while the sweep runs are noticed.

    Parameters
    ----------
    places : sequence of str
        Files of one scene, or its name where it is shipped.
    configurations, folder, distances, values, chunk
        As of `collide.sweep`.
    robot : str, optional
        Which one, of a scene with several.
    options : dict, optional
        What `load` is told.
    **how
        ``workers``, ``scheduler``, ``restart`` and ``progress`` of `collide.sweep`.

    Returns
    -------
    SweepResults
        What there is in the folder.
    """
    watch = _SceneWatch(list(places), robot, options or {})
    question = OneQuestion(watch.checker, distances, values)
    asked = as_configurations(configurations, question.robot)
    about = {"scenes": [str(place) for place in places], "robot": question.robot.name}
    return SweepRun(question, 1, asked, folder, watch.look, chunk=chunk, about=about).go(**how)


def sweep_scenes(
    places: Sequence[str], folder: str | Path, *, configurations: Any = None, options: dict[str, Any] | None = None,
    distances: bool = False, values: bool = False, chunk: int | None = None, **how: Any,
) -> SweepResults:
    """Ask scene after scene: about the configuration that each has, or about all of the given ones.

    Workers read the files themselves. The bytes of the scene files, and of a robot and an SRDF named in the options,
    must stay what they were; meshes and robots that scene files name are not looked at.

    Parameters
    ----------
    places : sequence of str
        Scene files with one robot each, or names of shipped ones.
    folder, distances, values, chunk
        As of `collide.sweep`; rows of a scene follow one another, and a column ``scene`` names it.
    configurations : optional
        As of `collide.sweep`; they must fit the robots of all scenes.
    options : dict, optional
        What `load` is told.
    **how
        ``workers``, ``scheduler``, ``restart`` and ``progress`` of `collide.sweep`.

    Returns
    -------
    SweepResults
        What there is in the folder.

    Raises
    ------
    InvalidArgument
        Where there is no scene, or one twice.
    """
    options, files = options or {}, [str(place) for place in places]
    if not files or len(set(files)) < len(files):
        raise InvalidArgument(f"scenes must be several files, each once, got {listing(files) or 'none'}")
    question = ScenesQuestion(files, options, load_checker, distances, values)
    asked = configurations
    if asked is not None:
        asked = as_configurations(asked, load_checker(files[0], options)[0].robot)
    named = [str(options[key]) for key in ("robot", "srdf") if isinstance(options.get(key), (str, Path))]
    watch = _FilesWatch([*files, *named], options)
    about = {"scenes": files, "robot": None}
    return SweepRun(question, len(files), asked, folder, watch.look, chunk=chunk, about=about).go(**how)


class _SceneWatch:
    """A scene from files, and whether it is still the same: they are read again where they were written to."""

    def __init__(self, places: list[str], name: str | None, options: dict[str, Any]):
        self._question = places, name, options
        self.checker, self._sources = self._load()
        self._digest, self._stamps = question_digest(self.checker), _stamps(self._sources)

    def _load(self) -> tuple[RobotChecker, list[str]]:
        places, name, options = self._question
        scene = _load(places, options)
        return RobotChecker.from_scene(scene, name), scene.sources

    def look(self, final: bool) -> str:
        """The digest of the scene as its files are now; files of meshes are looked at the last time only."""
        stamps = _stamps(self._sources)
        if final or stamps != self._stamps:
            try:
                self._digest = question_digest(self._load()[0])
            except SceneError as error:  # half written, or gone
                self._digest = str(error)
            self._stamps = stamps
        return self._digest


class _FilesWatch:
    """Files by their bytes, read again where they were written to."""

    def __init__(self, files: list[str], options: dict[str, Any]):
        self._files, self._options = files, {key: str(value) for key, value in options.items()}
        self._stamps: list[tuple[int, int] | None] = []
        self._digest = ""

    def look(self, final: bool) -> str:
        """The digest of what the files hold now."""
        stamps = _stamps(self._files)
        if stamps != self._stamps:
            self._digest, self._stamps = digest(self._options, [file_digest(file) for file in self._files]), stamps
        return self._digest


def _stamps(files: list[str]) -> list[tuple[int, int] | None]:
    return [_stamp(file) for file in files]


def _stamp(file: str) -> tuple[int, int] | None:
    """When a file was written to last, and how long it is; None where it is gone."""
    try:
        status = os.stat(file)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
