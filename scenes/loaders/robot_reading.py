"""What readers of robots share: the file being read, its numbers, its meshes, joints of several coordinates."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import SceneError, cut
from collide.robots.kinematic_tree import Joint, Mimic
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.scenes.loaders import resources
from collide.scenes.loaders.mesh_parts import MeshFile, MeshPart
from collide.scenes.loaders.mesh_shapes import Taken, element_shapes, extent
from collide.shapes.shape import mirrors
from collide.transforms import FULL_TURN, rotation_from_rpy

MISSING_MESHES = ("error", "skip")


@dataclass
class Reading:
    """One description of a robot being read: where it lies, how meshes are taken, and what there is to say.

    Files that the description includes are read with the same lists (`beside`).
    """

    path: Path
    meshes: str = "mesh"
    package_path: tuple = ()
    missing_meshes: str = "error"
    notes: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    mesh_files: dict[Path, MeshFile] = field(default_factory=dict)
    #: seconds spent on each mesh element
    spent: list[float] = field(default_factory=list)

    def beside(self, path: Path) -> Reading:
        """The same reading, in another file."""
        return replace(self, path=path)

    def fail(self, element: str, what: str) -> NoReturn:
        raise SceneError(what, path=self.path, element=element)

    def add_time(self, seconds: dict[str, float] | None, started: float) -> None:
        """Add what was spent since ``started`` to the stages ``meshes`` and ``read``."""
        if seconds is not None:
            meshes = sum(self.spent)
            seconds["meshes"] = seconds.get("meshes", 0.0) + meshes
            seconds["read"] = seconds.get("read", 0.0) + time.perf_counter() - started - meshes

    def numbers(self, text: str, count: int, what: str, place: str) -> np.ndarray:
        """``count`` finite numbers, separated by blanks or commas."""
        wanted = "one finite number" if count == 1 else f"{count} finite numbers"
        try:
            values = [float(_without_dots(word)) for word in text.replace(",", " ").split()]
        except ValueError:
            advice = "; expand the xacro first" if "${" in text or "$(" in text else ""
            self.fail(place, f'{what} must be {wanted}, got "{cut(text)}"{advice}')
        too_many = count == 3 and len(values) == 4  # Bullet reads the first three
        if (len(values) != count and not too_many) or not all(map(math.isfinite, values)):
            self.fail(place, f'{what} must be {wanted}, got "{cut(text)}"')
        if too_many:
            self.notes.append(f'{place}: {what} has four numbers, "{cut(text)}": the first three were read')
        if any(_without_dots(word) != word for word in text.replace(",", " ").split()):
            self.notes.append(f'{place}: {what} "{cut(text)}" was read without the dot after a number')
        return np.array(values[:count])

    def mesh_shapes(
        self, filename: str, scale: np.ndarray, place: str, of_file: Callable[[MeshFile], list[MeshPart]] | None = None
    ) -> list[Taken]:
        """The shapes of a mesh file, as it is named in the description.

        scale : (3,) factors.   of_file : the parts that are meant, all by default.   No shapes where the file is
        missing and that is allowed. Raises SceneError, InvalidShape.
        """
        factors = " ".join(f"{factor:g}" for factor in scale)
        if not scale.all():
            self.fail(place, f'<mesh> scale must not be 0, got "{factors}"')
        if mirrors(scale):
            self.notes.append(f'{place}: the mesh scale "{factors}" mirrors; the mesh was mirrored')
        try:
            file = resources.find(filename, self.path, self.package_path, element=place)
        except resources.NotFound as error:
            if self.missing_meshes == "skip":
                missing = f"{place} has no collision mesh {cut(filename, 240)}: that link is NOT checked by it"
                self.notes.append(missing)
                self.missing.append(missing)
                return []
            raise SceneError(
                f"{error.what}\n    (missing_meshes=\"skip\", --missing-meshes skip, loads the robot without it)",
                path=self.path, element=place,
            ) from None
        started = time.perf_counter()
        if file not in self.mesh_files:
            self.mesh_files[file] = mesh_loader.read_mesh(file, self.meshes)
            self.notes += self.mesh_files[file].notes
        meant = self.mesh_files[file]
        if of_file is not None:
            meant = MeshFile(of_file(meant), [])
        shapes = element_shapes(meant, scale, f"{self.path}: {place}")
        self.note_size(extent(meant, scale), place)
        self.spent.append(time.perf_counter() - started)
        return shapes

    def rotation(self, rpy: np.ndarray, place: str) -> np.ndarray:
        """(3, 3) of roll, pitch, yaw [rad]; angles beyond a full turn are noted, for they look like degrees."""
        if np.abs(rpy).max() > FULL_TURN:
            angles = " ".join(f"{angle:g}" for angle in rpy)
            self.notes.append(f'{place}: rpy "{angles}" exceeds a full turn of radians: is it in degrees?')
        return rotation_from_rpy(rpy)

    def note_size(self, extent: float, place: str) -> None:
        """Note a size [m] that looks like one of another unit."""
        note = mesh_loader.size_note(extent, place)
        if note:
            self.notes.append(note)


def opened(path, meshes: str, package_path, missing_meshes: str) -> Reading:
    """A `Reading` of a file with options as they were handed in. Raises SceneError for options that are none."""
    mesh_loader.check_meshes_option(meshes)
    if not isinstance(missing_meshes, str) or missing_meshes not in MISSING_MESHES:
        raise SceneError(f'missing_meshes must be "error" or "skip", got {checks.brief(missing_meshes)}')
    return Reading(Path(path), meshes, tuple(_as_paths(package_path)), missing_meshes)


def _without_dots(word: str) -> str:
    """A number without a second dot at its end: readers that take what they can, as Bullet's, do not see one."""
    return word[:-1] if word.count(".") > 1 and word.endswith(".") else word


def _as_paths(package_path: str | Path | Iterable) -> list[Path]:
    folders = [package_path] if isinstance(package_path, (str, Path)) else list(package_path)
    return [Path(entry) for entry in folders]


# --- joints of several coordinates ---------------------------------------------------------------


class Motion(NamedTuple):
    """One coordinate of a joint.

    suffix : of its column's name.   kind : revolute, continuous or prismatic.   axis : (3,) in the joint's frame.
    """

    suffix: str
    kind: str
    axis: np.ndarray
    lower: float = -math.inf
    upper: float = math.inf
    mimic: Mimic | None = None


#: A ball joint: turned about the axes of its parent's end, the last of them first.
BALL = tuple(
    Motion(suffix, "continuous", np.eye(3)[axis]) for suffix, axis in (("/yaw", 2), ("/pitch", 1), ("/roll", 0))
)


def chain(
    name: str, motions: Iterable[Motion], parent: str, child: str, X_PJ: np.ndarray, free_link: Callable[[str], str]
) -> list[Joint]:
    """Joints of one coordinate each, in a row from parent to child, whose frame is the joint's at 0.

    free_link : makes the name of a link that is not taken, of the links between.
    """
    motions = list(motions)
    joints = []
    for k, motion in enumerate(motions):
        link = child if k == len(motions) - 1 else free_link(f"{child}{motion.suffix}")
        joints.append(Joint(
            name + motion.suffix, motion.kind, parent, link, X_PJ, motion.axis, motion.lower, motion.upper,
            motion.mimic,
        ))
        parent, X_PJ = link, np.eye(4)
    return joints
