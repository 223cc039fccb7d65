"""MJCF: a MuJoCo model as a robot, and what stands around it.

MuJoCo itself reads the file (the package ``mujoco``), so that defaults, includes, units and frames mean what they mean
there; what is read here is the compiled model. Its bodies are links of one robot, whose root is the world. Geoms of the
world itself, and planes and height fields that cannot move, are surroundings: bodies of a scene, no part of the robot.
Pairs that MuJoCo's filters leave out are never tested.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from collide.errors import CollideError, InvalidShape, MissingExtra, SceneError, cut, listing
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.scenes.description import Placement, Scene, SceneBody, free_name
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.scenes.loaders.mesh_shapes import Taken
from collide.scenes.loaders.mjcf_geoms import FIELD, MESH, PLANE, SDF, mesh_shapes, pose_of, shape_of
from collide.scenes.loaders.mjcf_links import link_tree, values_of
from collide.scenes.loaders.mjcf_pairs import FILTERS, REASONS, contacts_off, filtered, groups_of, moves
from collide.scenes.loaders.mjcf_sources import check_mjcf
from collide.scenes.loaders.srdf import Semantics, find_srdf, read_srdf
from collide.scenes.loaders.xml_text import parse_xml
from collide.transforms import pose

#: The state of a robot in which MuJoCo starts.
START = "qpos0"


class MjcfFile(NamedTuple):
    """What an MJCF file holds.

    robot : all bodies but the world's own geoms.   surroundings : at their poses in the file's world.
    allowed : (body of the surroundings, link, reason), pairs never tested besides the robot's own.
    """

    robot: Robot
    surroundings: list[SceneBody]
    allowed: list[tuple[str, str, str]]


def load_robot(path, srdf=None, *, meshes: str = "mesh", seconds: dict[str, float] | None = None) -> Robot:
    """A `Robot` from an MJCF file, without what stands around it, which is noted; see `load_mjcf`."""
    file = load_mjcf(path, srdf, meshes=meshes, seconds=seconds)
    if file.surroundings:
        names = listing(body.name for body in file.surroundings)
        file.robot.notes.append(
            f"{Path(path).name}: what stands in the world is no part of the robot: {names} (a scene loaded from the "
            "file has it)"
        )
    return file.robot


def load_mjcf(path, srdf=None, *, meshes: str = "mesh", seconds: dict[str, float] | None = None) -> MjcfFile:
    """What an MJCF file holds, by the package ``mujoco``.

    srdf : path of an SRDF that disables pairs besides; None looks beside the file, False does without.
    meshes : "mesh", "hull" or "pieces".   seconds : receives the time spent on ``meshes`` and on the rest, ``read``.

    Raises SceneError, InvalidShape naming file and element, and MissingExtra.
    """
    started = time.perf_counter()
    path = Path(path)
    mesh_loader.check_meshes_option(meshes)
    root = parse_xml(path, [])
    if root.tag != "mujoco":
        raise SceneError("the outermost element of an MJCF file is <mujoco>", path=path, element=f"<{root.tag}>")
    check_mjcf(path, root)
    name = root.get("model") or path.stem
    reading = _Reading(path, _compiled(path), meshes)
    file = reading.build(name, find_srdf(path, name, srdf))
    if seconds is not None:
        seconds["meshes"] = seconds.get("meshes", 0.0) + reading.seconds
        seconds["read"] = seconds.get("read", 0.0) + time.perf_counter() - started - reading.seconds
    return file


def place_mjcf(
    scene: Scene, file: MjcfFile, X_WR: np.ndarray, values: Mapping[str, float] | None = None, *, prefix: str = "",
    name: str | None = None, mobile: bool = False,
) -> Placement:
    """Add robot and surroundings to a scene, both at the pose X_WR of the file's world.

    values : joint → value [rad or m], of which those that are not named stand as MuJoCo starts.
    """
    robot = file.robot.renamed(prefix)
    placement = scene.place_robot(
        robot, X_WR, {**robot.states.get(START, {}), **(values or {})}, name=name, mobile=mobile
    )
    for body in file.surroundings:
        scene.add(replace(body, name=prefix + body.name, X_WB=X_WR @ body.X_WB))
    scene.allowed += [(prefix + a, prefix + b, reason) for a, b, reason in file.allowed]
    return placement


def _compiled(path: Path) -> Any:
    try:
        import mujoco
    except ImportError:
        raise MissingExtra("mujoco", extra="mujoco", purpose=f"read {path.name}, an MJCF model") from None
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError, MemoryError, OverflowError, mujoco.FatalError) as error:
        raise SceneError(f"MuJoCo refuses it: {cut(' '.join(str(error).split()), 400)}", path=path) from None


class _Reading:
    """One compiled model while it becomes a robot and its surroundings."""

    def __init__(self, path: Path, model: Any, meshes: str):
        self.path, self.model, self.meshes = path, model, meshes
        self.seconds = 0.0
        self.tree = link_tree(model)
        self.notes: list[str] = [*self.tree.notes]
        #: number of a geom that collides → link or body of the surroundings that it is part of
        self.owner: dict[int, str] = {}
        self.geometry: dict[str, list[LinkShape]] = {}
        self.surroundings: list[SceneBody] = []

    def build(self, name: str, srdf: Path | None) -> MjcfFile:
        self._add_geoms()
        pairs, allowed = self._pairs()
        semantics = self._semantics(srdf)
        self._note_what_is_left_out()
        try:
            robot = Robot(
                name, self.tree.links, self.tree.joints, self.geometry, semantic_pairs=pairs + semantics.pairs,
                states={**self._states(), **semantics.states},
                notes=[f"{self.path.name}: {note}" for note in self.notes] + semantics.notes,
                sources=[str(self.path)] + ([str(srdf)] if srdf is not None else []),
            )
        except SceneError as error:
            raise SceneError(error.what, path=self.path, element=error.element) from None
        return MjcfFile(robot, self.surroundings, allowed)

    def _semantics(self, srdf: Path | None) -> Semantics:
        if srdf is None:
            return Semantics()
        return read_srdf(srdf, self.tree.links, [joint.name for joint in self.tree.joints])

    # --- geometry -------------------------------------------------------------------------------

    def _add_geoms(self) -> None:
        """Every geom that collides becomes a body of the surroundings, or an element of a link."""
        model, started = self.model, time.perf_counter()
        collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        collides[[*model.pair_geom1.tolist(), *model.pair_geom2.tolist()]] = True
        collides &= model.geom_type != SDF
        geoms = np.flatnonzero(collides)
        used = (int(model.geom_dataid[geom]) for geom in geoms if model.geom_type[geom] == MESH)
        taken = mesh_shapes(model, self.meshes, self.path, used)
        self.seconds += time.perf_counter() - started
        still = ~moves(model)
        names = dict.fromkeys(self.tree.links, 1)
        owners = self._owners(geoms, still, names)
        X_WBs = self._still_poses(still)
        for geom in geoms.tolist():
            body, source = int(model.geom_bodyid[geom]), f"{self.path}: {self._geom_name(geom)}"
            X_BG = pose_of(model, geom)
            shape, approximation = self._shape(geom, taken, source)
            if geom in owners:
                element = LinkShape(shape, X_BG, approximation, source)
                self.geometry.setdefault(owners[geom], []).append(element)
            else:
                owners[geom] = free_name(self._geom_name(geom), names)
                self.surroundings.append(SceneBody(
                    owners[geom], shape, X_WBs[body] @ X_BG, static=True, source=source, approximation=approximation,
                ))
        self.owner = owners

    def _shape(self, geom: int, taken: Mapping[int, Taken], source: str) -> Taken:
        if self.model.geom_type[geom] == MESH:
            return taken[int(self.model.geom_dataid[geom])]
        try:
            return Taken(shape_of(self.model, geom), None)
        except CollideError as error:
            raise InvalidShape(f"{source}: {error}") from None

    def _geom_name(self, geom: int) -> str:
        body = self.tree.of_body[int(self.model.geom_bodyid[geom])]
        return self.model.geom(geom).name or f"{body}/geom {geom}"

    def _still_poses(self, still: np.ndarray) -> dict[int, np.ndarray]:
        """Pose in the world of each body that cannot move."""
        model, X_WBs = self.model, {0: np.eye(4)}
        for body in np.flatnonzero(still).tolist()[1:]:
            X_PB = pose(model.body_pos[body], quat_wxyz=model.body_quat[body])
            X_WBs[body] = X_WBs[int(model.body_parentid[body])] @ X_PB
        return X_WBs

    def _owners(self, geoms: np.ndarray, still: np.ndarray, names: dict[str, int]) -> dict[int, str]:
        """Geom → link, of geoms that are no surroundings.

        Geoms of one body that MuJoCo tests against different geoms are on links of their own, joined to it: so pairs
        of links are tested wholly, or not at all.
        """
        model = self.model
        body, kind = model.geom_bodyid[geoms], model.geom_type[geoms]
        around = (body == 0) | (still[body] & ((kind == PLANE) | (kind == FIELD)))
        link_of_group: dict[int, str] = {}
        owners = {}
        for geom, group in zip(geoms[~around].tolist(), groups_of(model, geoms)[~around].tolist()):
            link = self.tree.of_body[int(model.geom_bodyid[geom])]
            if group not in link_of_group:
                is_first = link not in link_of_group.values()
                link_of_group[group] = link if is_first else self._welded(link, geom, names)
            owners[geom] = link_of_group[group]
        return owners

    def _welded(self, link: str, geom: int, names: dict[str, int]) -> str:
        """A new link, joined to another, for a geom."""
        name = free_name(f"{link}/{self.model.geom(geom).name or f'geom {geom}'}", names)
        self.tree.links.append(name)
        self.tree.joints.append(Joint(free_name(f"{name}/fixed", self.tree.taken_joints), "fixed", link, name))
        return name

    # --- pairs, states, notes -------------------------------------------------------------------

    def _pairs(self) -> tuple[list[tuple[str, str, str]], list[tuple[str, str, str]]]:
        """Pairs that MuJoCo never tests: (of links, of a body of the surroundings and a link)."""
        geom_of: dict[str, int] = {}
        for geom, owner in self.owner.items():
            geom_of.setdefault(owner, geom)
        around = {body.name for body in self.surroundings}
        owners = [*geom_of]
        codes = filtered(self.model, np.array([*geom_of.values()], dtype=np.int64))
        of_links, with_surroundings = [], []
        for i, j in np.argwhere(np.triu((codes > 0) & (codes <= FILTERS), 1)).tolist():
            a, b = (owners[i], owners[j]) if owners[i] in around else (owners[j], owners[i])
            reason = f"MuJoCo: {REASONS[codes[i, j]]}"
            if a in around:
                with_surroundings.append((a, b, reason))
            else:
                of_links.append((b, a, reason))
        return of_links, with_surroundings

    def _states(self) -> dict[str, dict[str, float]]:
        model = self.model
        states = {START: values_of(model, self.tree, model.qpos0)}
        for k in range(model.nkey):
            states[model.key(k).name or f"key {k}"] = values_of(model, self.tree, model.key_qpos[k])
        return states

    def _note_what_is_left_out(self) -> None:
        import mujoco

        model, kinds = self.model, mujoco.mjtGeom
        ghosts = [geom for geom in range(model.ngeom) if geom not in self.owner]
        fields = [geom for geom in ghosts if model.geom_type[geom] == kinds.mjGEOM_SDF]
        visual = [geom for geom in ghosts if geom not in fields]
        if visual:
            bodies = dict.fromkeys(self.tree.of_body[body] for body in model.geom_bodyid[visual].tolist())
            bare = [body for body in bodies if body in self.tree.links and body not in self.geometry]
            about = f"; with no others: {listing(bare)}" if bare else ""
            self.notes.append(f"geoms with contype = conaffinity = 0 are NOT checked, {len(visual)} in all{about}")
        if fields:
            self.notes.append(f"signed distance fields are NOT checked: {listing(map(self._geom_name, fields))}")
        if model.nflex:
            self.notes.append(f"{model.nflex} deformable bodies (flex) are NOT checked")
        if (model.geom_margin > 0).any() or (model.pair_margin > 0).any():
            self.notes.append("margins of geoms and pairs were left out: only bodies that touch collide")
        if off := contacts_off(model):
            flags = " and ".join(f'<flag {name}="disable"/>' for name in off)
            self.notes.append(f"the model turns contacts off by {flags}: its own pairs are NOT checked, as in MuJoCo")
        if not self.geometry:
            self.notes.append("no link has collision geometry: nothing of this robot is checked")
