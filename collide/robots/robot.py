"""Robot: a tree of links, its joints, and where every link stands for given joint values.

Plain data and numpy: files are read by `collide.scenes`, which `Robot.load` calls. Frames: R is the
robot's root link, P a joint's parent link, L its child link, J the joint frame (the child's frame
at joint value 0), G a collision element. ``X_WL = X_WP @ X_PJ @ X_JL(q)``.

Columns of a configuration ``q``: one value for each revolute, continuous [rad] or prismatic [m]
joint that does not mimic another; three for a planar joint (``NAME/x``, ``NAME/y`` [m] along two
axes across its normal, ``NAME/yaw`` [rad]); six for a floating joint (``NAME/x``, ``/y``, ``/z``,
``/roll``, ``/pitch``, ``/yaw``). ``Robot.joint_names`` lists the columns in order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, InvalidPose, SceneError, brief, cut, listing
from collide.kernels import address_of
from collide.robots.forward_kinematics import are_finite, joint_table, link_poses_of
from collide.robots.kinematic_tree import (
    COLUMNS,
    Joint,
    broken_mimics,
    broken_note,
    checked_joint,
    indices_of,
    resolve_mimics,
    rigid_clusters,
    tree_of,
)
from collide.shapes.shape import Shape
from collide.transforms import LARGEST, as_pose

#: Module and function that read robots from files: found when first needed, since the engine imports no loader.
_LOADER = ("collide.scenes.loaders.robot_file", "load_robot")


_FLOAT64 = np.dtype(np.float64)


class LinkShape(NamedTuple):
    """A collision element of a link.

    shape : in its own frame G.   X_LG : (4, 4) pose of G in the link.
    approximation : the difference between shape and element in words, ``None`` where equal.
    source : where the element is described, ``file: element``.
    """

    shape: Shape
    X_LG: np.ndarray
    approximation: str | None
    source: str


class Robot:
    """Links, joints, limits, collision geometry and the pairs never tested.

    Parameters
    ----------
    name : str
        Of the robot.
    links : sequence of str
        Names of the links, in the order of the file.
    joints : sequence of Joint
        In the order of the file; together they make a tree. Joints that cannot follow their mimicked joint (a missing
        joint, a cycle) become joints of their own, and a note is added for each.
    geometry : mapping of str to sequence of LinkShape, optional
        Link → its collision elements; links without collision geometry may be left out.
    semantic_pairs : iterable of (link, link, reason), optional
        From an SRDF. ``None``: links next to each other in the tree are taken as never tested.
    states : mapping, optional
        Named joint values [rad or m], ``{"ready": {"joint1": 0.0, ...}}``.
    notes : iterable of str
        Notes for the person who loads the robot.
    missing_meshes : iterable of str
        Elements left out on demand, their meshes not found: nothing is known of collisions with them.
    sources : iterable of str
        The files read, the robot's own first.

    Attributes
    ----------
    joint_names, dof, lower, upper
        The columns of ``q``, their number, and their limits (dof,) [rad or m].
    root
        The link without a parent.
    base_links
        Links welded to the root, root included.
    rigid_clusters
        Tuples of links welded together by fixed joints, in the order of the links.
    disabled_pairs
        [(link, link, reason)], both with collision geometry, in the order of the links.
    prefix
        Put by `renamed` before the names of links and joints in the files.
    place
        The robot and its file, for messages.
    joint_table, moves
        Joints as kernels read them, in the order of `sorted_joints`; (joints, links) uint8, 1 where a joint moves a
        link.

    Raises
    ------
    SceneError
        Naming the link or joint, where names repeat, geometry has no link, or the joints do not make a tree.
    """

    def __init__(
        self,
        name: str,
        links: Sequence[str],
        joints: Sequence[Joint],
        geometry: Mapping[str, Sequence[LinkShape]] | None = None,
        *,
        semantic_pairs: Iterable[tuple[str, str, str]] | None = None,
        states: Mapping[str, Mapping[str, float]] | None = None,
        notes: Iterable[str] = (),
        missing_meshes: Iterable[str] = (),
        sources: Iterable[str] = (),
    ):
        self.name = checks.text("Robot: name", name, SceneError)
        self.links = tuple(_texts("links", links))
        self._index = indices_of("link", self.links)
        self.sources, self.prefix = _texts("sources", sources), ""
        self.missing_meshes = _texts("missing_meshes", missing_meshes)
        self.place = ": ".join((*self.sources[:1], f"robot {cut(name)}"))
        listed = checks.listed_entries("Robot: joints", joints, "a sequence of Joint", SceneError)
        for joint in listed:
            checks.instance("Robot: joints", joint, Joint, "a sequence of Joint", SceneError)
        checked = [checked_joint(joint, self._index) for joint in listed]
        indices_of("joint", [joint.name for joint in checked])
        broken = broken_mimics(checked)
        self.joints = tuple(replace(joint, mimic=None) if joint.name in broken else joint for joint in checked)
        self.root, self._order = tree_of(self.links, self.joints)
        self._drivers = resolve_mimics(self.joints)
        self._set_columns()
        self.joint_table = joint_table(
            self._order, self._index, self._columns, self._drivers, self.root, self.dof
        )
        self.moves = self._joint_moves()
        self.geometry = _checked_geometry({} if geometry is None else geometry)
        for link in self.geometry:
            if link not in self._index:
                raise SceneError(f"unknown link; the robot has {listing(self.links)}", element=f'link "{cut(link)}"')
        #: What checkers make of links and share: link → its elements, and their shape; what tables are of, and tables;
        #: what maps are of, and maps.
        self.link_shapes: dict[str, tuple] = {}
        self.link_tables: tuple | None = None
        self.link_maps: tuple | None = None
        self.rigid_clusters = rigid_clusters(self.links, self.joints)
        self.base_links = next(cluster for cluster in self.rigid_clusters if self.root in cluster)
        self.semantic_pairs = None if semantic_pairs is None else _checked_pairs(semantic_pairs)
        self.states = _checked_states({} if states is None else states)
        file = Path(self.sources[0]).name if self.sources else f"robot {cut(name)}"
        self.notes = [*_texts("notes", notes), *(f"{file}: {broken_note(joint, why)}" for joint, why in broken.items())]

    @classmethod
    def load(cls, path, srdf=None, **options) -> Robot:
        """A robot from a URDF, MJCF or SDFormat file, with the SRDF beside the file or a given SRDF.

        Parameters
        ----------
        path : str or Path
            The URDF file, or ``package://`` and a file in a package; or an MJCF file, read by the package mujoco (extra
            ``[mujoco]``): bodies are links, the root is the world, pairs left out by MuJoCo's filters are never tested,
            keyframes are states; or an SDFormat file with a single robot.
        srdf : str, Path or bool, optional
            The SRDF file. ``None`` looks beside the robot's file, ``False`` does without. An SRDF adds to MuJoCo's
            filters.
        **options
            ``meshes``, ``package_path`` and ``missing_meshes`` as of `collide.scenes.load`.

        Returns
        -------
        Robot
            With all data on collisions in the files.

        Raises
        ------
        SceneError
            Naming file, element and value of anything unreadable. MissingExtra for MJCF without the package mujoco.
        """
        return getattr(import_module(_LOADER[0]), _LOADER[1])(path, srdf=srdf, **options)

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: tables hold addresses."""
        return {**vars(self), "link_shapes": {}, "link_tables": None, "link_maps": None}

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {len(self.links)} links, {self.dof} degrees of freedom)"

    # --- configurations --------------------------------------------------------------------------

    def _set_columns(self) -> None:
        names: list[str] = []
        lower: list[float] = []
        upper: list[float] = []
        self._columns: dict[str, int] = {}
        for joint in self.joints:
            if joint.mimic is not None or not COLUMNS[joint.type]:
                continue
            self._columns[joint.name] = len(names)
            for suffix in COLUMNS[joint.type]:
                limited = joint.type in ("revolute", "prismatic")
                names.append(joint.name + suffix)
                lower.append(joint.lower if limited else -math.inf)
                upper.append(joint.upper if limited else math.inf)
        self.joint_names = tuple(names)
        self.dof = len(names)
        self.lower, self.upper = np.array(lower), np.array(upper)

    def default_configuration(self) -> np.ndarray:
        """The configuration of zeros, or of the limit nearest to 0 where 0 is outside.

        Returns
        -------
        (dof,) float64
            [rad or m], columns as in ``joint_names``.
        """
        return np.clip(np.zeros(self.dof), self.lower, self.upper)

    def configuration(
        self, values: Mapping[str, float], start: np.ndarray | None = None
    ) -> tuple[np.ndarray, list[str]]:
        """Joint values by name as a configuration, and notes about them.

        Parameters
        ----------
        values : mapping of str to float
            Joint, or column of ``joint_names`` → value [rad or m]. Values outside a limit are used and noted; so are
            values for joints without a value of their own.
        start : (dof,) float64, optional
            Values of the other columns; by default `default_configuration`.

        Returns
        -------
        q : (dof,) float64
            [rad or m].
        notes : list of str
            For the person who gave the values.

        Raises
        ------
        InvalidArgument
            For unknown joints (the known ones are listed) and for values other than finite numbers.
        """
        q = self.default_configuration() if start is None else self._one_configuration("start", start).copy()
        values = checks.mapping("Robot.configuration: values", values, "joint → value")
        column = {name: k for k, name in enumerate(self.joint_names)}
        by_name = {joint.name: joint for joint in self.joints}
        followers: list[tuple[Joint, float]] = []
        notes: list[str] = []
        for name, raw in values.items():
            value = _joint_value(checks.text("Robot.configuration: values: a joint", name), raw)
            if name in column:
                q[column[name]] = value
            elif name not in by_name or by_name[name].type in ("planar", "floating"):
                raise InvalidArgument(
                    f"robot {self.name}: values name an unknown joint {brief(name)}; it has "
                    f"{listing(self.joint_names) or 'no joints'}"
                )
            elif by_name[name].mimic is not None:
                followers.append((by_name[name], value))
            elif value != 0.0:
                notes.append(f"robot {self.name}: joint {name} is fixed; its value {value:g} was not used")
        for joint, value in followers:
            follows = self.joint_value(joint.name, q)
            if abs(value - follows) > 1e-6:
                notes.append(
                    f"robot {self.name}: joint {joint.name} follows {joint.mimic.joint} and stands at "  # type: ignore[union-attr]
                    f"{follows:g}; the value {value:g} was not used"
                )
        return q, notes + self.limit_notes(q)

    def default_notes(self, names: Iterable[str], q: np.ndarray) -> list[str]:
        """A note about the columns of a configuration without a given value.

        Parameters
        ----------
        names : iterable of str
            The columns with a given value.
        q : (dof,) float64
            The configuration [rad or m].

        Returns
        -------
        list of str
            A note, or an empty list.
        """
        if not isinstance(names, (set, frozenset)):
            names = checks.listed_entries("Robot.default_notes: names", names, "names of columns")
        names = {checks.text("Robot.default_notes: names", name) for name in names}
        q = self._one_configuration("q", q)
        unset = [(name, value) for name, value in zip(self.joint_names, q) if name not in names]
        if not unset:
            return []
        listed = ", ".join(f"{name} = {value:g}" if value else name for name, value in unset)
        return [f"robot {self.name}: no value given for {listed}: 0 taken, or the limit nearest to 0"]

    def joint_value(self, name: str, q: np.ndarray) -> float:
        """The value of a joint with a single coordinate, mimicking joints included.

        Parameters
        ----------
        name : str
            Of the joint.
        q : (dof,) float64
            The configuration [rad or m].

        Returns
        -------
        float
            [rad or m].

        Raises
        ------
        InvalidArgument
            For a name of no joint with a single coordinate, and for a q of another shape.
        """
        if checks.text("Robot.joint_value: name", name) not in self._drivers:
            raise InvalidArgument(
                f"robot {self.name}: no joint of the name {brief(name)} moves along one coordinate; there are "
                f"{listing(self._drivers) or 'none'}"
            )
        return self._value_at(name, self._one_configuration("q", q))

    def _value_at(self, name: str, q: np.ndarray) -> float:
        driver, multiplier, offset = self._drivers[name]
        return multiplier * float(q[self._columns[driver]]) + offset

    def _one_configuration(self, what: str, q) -> np.ndarray:
        """(dof,) float64, the caller's own array where already (dof,) float64. Raises InvalidArgument."""
        read = checks.array(f"robot {cut(self.name)}: {what}", q, f"({self.dof},)", InvalidArgument)
        if read.shape != (self.dof,):
            raise InvalidArgument(
                f"robot {cut(self.name)}: {what} must have shape ({self.dof},), a value for each of "
                f"{listing(self.joint_names) or 'no joints'}; got {read.shape}"
            )
        return read

    def limit_notes(self, q: np.ndarray) -> list[str]:
        """Notes about joints outside their limits.

        Parameters
        ----------
        q : (dof,) float64
            The configuration [rad or m].

        Returns
        -------
        list of str
            One a joint.
        """
        notes, q = [], self._one_configuration("q", q)
        for joint in self.joints:
            if joint.type not in ("revolute", "prismatic"):
                continue
            value = self._value_at(joint.name, q)
            slack = 1e-9 * max(1.0, abs(value))  # files print limits and values with rounded digits
            if not joint.lower - slack <= value <= joint.upper + slack:
                unit = "rad" if joint.type == "revolute" else "m"
                notes.append(
                    f"robot {self.name}: joint {joint.name} at {value:g} {unit} is outside its limits "
                    f"[{joint.lower:g}, {joint.upper:g}]"
                )
        return notes

    def within_limits(self, q) -> np.ndarray:
        """Whether configurations keep the limits of all joints, mimicking ones included.

        Parameters
        ----------
        q : (dof,) or (N, dof) array_like
            [rad or m]. A billionth beyond a limit is within it, as in `limit_notes`.

        Returns
        -------
        (N,) bool
        """
        q = self.checked_configurations(q)
        within = np.ones(len(q), dtype=bool)
        for joint in self.joints:
            if joint.type in ("revolute", "prismatic"):
                driver, multiplier, offset = self._drivers[joint.name]
                value = multiplier * q[:, self._columns[driver]] + offset
                slack = 1e-9 * np.maximum(1.0, np.abs(value))
                within &= (joint.lower - slack <= value) & (value <= joint.upper + slack)
        return within

    @property
    def sorted_joints(self) -> tuple[Joint, ...]:
        """Joints with parents before children, in the order of `joint_table`."""
        return tuple(self._order)

    def _joint_moves(self) -> np.ndarray:
        """(joints, links) uint8, joints as `sorted_joints`: 1 where a joint moves a link."""
        out = np.zeros((len(self._order), len(self.links)), dtype=np.uint8)
        above: dict[str, list[int]] = {self.root: []}
        for k, joint in enumerate(self._order):
            above[joint.child] = [*above[joint.parent], k]
        for link, joints in above.items():
            out[joints, self._index[link]] = 1
        return out

    # --- kinematics ------------------------------------------------------------------------------

    def link_poses(self, q, X_WR=None) -> np.ndarray:
        """Forward kinematics: the poses of all links.

        Every row is computed alone, by the same additions and multiplications: a row gives the same bits alone and
        in a batch.

        Parameters
        ----------
        q : (dof,) or (N, dof) array_like, float64
            Configurations [rad or m], columns as in ``joint_names``; a single configuration gives N = 1.
        X_WR : (4, 4) float64, optional
            Pose of the root link R in the world W, by default the identity.

        Returns
        -------
        (N, links, 4, 4) float64
            Poses X_WL, links in the order of ``links``. O(N · joints).

        Raises
        ------
        InvalidArgument
            For configurations of another shape, or not finite.
        InvalidPose
            Naming file, link and joint, where a link leaves the range of coordinates of poses.
        """
        q = np.ascontiguousarray(self.checked_configurations(q))
        X_WLs = link_poses_of(self.joint_table, q, np.eye(4) if X_WR is None else as_pose(X_WR, "X_WR"))
        within = np.abs(X_WLs[:, :, :3]) <= LARGEST
        if not within.all():
            self._refuse_pose(X_WLs, within, q)
        return X_WLs

    def _refuse_pose(self, X_WLs: np.ndarray, within: np.ndarray, q: np.ndarray) -> NoReturn:
        """InvalidPose about the link nearest to the root that stands too far away.   within : (N, links, 3, 4)."""
        row = int(np.argmin(within.all(axis=(1, 2, 3))))
        joint = next(joint for joint in self._order if not within[row, self._index[joint.child]].all())
        at = X_WLs[row, self._index[joint.child], :3, 3].tolist()
        value = f" = {self.joint_value(joint.name, q[row]):g}" if joint.name in self._drivers else ""
        follows = f", which follows {cut(joint.mimic.joint)}," if joint.mimic is not None else ""
        raise InvalidPose(
            f'{self.place}: link "{cut(joint.child)}" stands at {at}: coordinates must be finite and within '
            f'{LARGEST:g}; '
            f'look at the origin of joint "{cut(joint.name)}"{follows} and at its value{value}'
        )

    def checked_configurations(self, q, name: str = "q") -> np.ndarray:
        """Configurations as an array.

        Parameters
        ----------
        q : (dof,) or (N, dof) array_like
            [rad or m].
        name : str
            How messages call the argument.

        Returns
        -------
        (N, dof) float64

        Raises
        ------
        InvalidArgument
            For another number of columns; for values that are not finite, naming row and joint.
        """
        if (
            q.__class__ is np.ndarray and q.dtype is _FLOAT64 and q.ndim in (1, 2) and q.shape[-1] == self.dof
            and q.flags.c_contiguous and are_finite(address_of(q), q.size)
        ):  # as of the slow way below, in a microsecond
            return q if q.ndim == 2 else q[None]
        array = checks.array(name, q, f"({self.dof},) or (N, {self.dof})", InvalidArgument)
        if array.ndim not in (1, 2) or array.shape[-1] != self.dof:
            raise InvalidArgument(
                f"{name} must have shape ({self.dof},) or (N, {self.dof}), one column for each of "
                f"{listing(self.joint_names) or 'no joints'}; got {array.shape}"
            )
        array = array if array.ndim == 2 else array[None]
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            row, col = bad[0]
            joint = self.joint_names[col]
            raise InvalidArgument(f"{name}[{row}], joint {joint}, is {array[row, col]}: it must be finite")
        return array

    # --- pairs -----------------------------------------------------------------------------------

    @property
    def disabled_pairs(self) -> list[tuple[str, str, str]]:
        """[(link, link, reason)] of pairs never tested, both with collision geometry, in the order of the links."""
        pairs: dict[tuple[str, str], str] = {}
        for a, b, reason in self.semantic_pairs if self.semantic_pairs is not None else self._adjacent_pairs():
            self._note_pair(pairs, a, b, reason)
        for a, b, reason in self.rigid_pairs:
            self._note_pair(pairs, a, b, reason)
        order = self._index
        return [(a, b, pairs[a, b]) for a, b in sorted(pairs, key=lambda pair: (order[pair[0]], order[pair[1]]))]

    @property
    def rigid_pairs(self) -> list[tuple[str, str, str]]:
        """Pairs of links welded together, both with collision geometry: they cannot move apart."""
        return [
            (a, b, "rigidly joined")
            for cluster in self.rigid_clusters
            for k, a in enumerate(cluster)
            for b in cluster[k + 1 :]
            if a in self.geometry and b in self.geometry
        ]

    def _adjacent_pairs(self) -> Iterable[tuple[str, str, str]]:
        cluster_of = {link: cluster for cluster in self.rigid_clusters for link in cluster}
        for joint in self.joints:
            if joint.type != "fixed":
                for a in cluster_of[joint.parent]:
                    for b in cluster_of[joint.child]:
                        yield a, b, "adjacent links"

    def _note_pair(self, pairs: dict[tuple[str, str], str], a: str, b: str, reason: str) -> None:
        if a in self.geometry and b in self.geometry and a != b:
            key = (a, b) if self._index[a] < self._index[b] else (b, a)
            pairs.setdefault(key, reason)

    def renamed(self, prefix: str) -> Robot:
        """The same robot with a prefix before the name of every link and joint.

        Parameters
        ----------
        prefix : str
            For example ``"left_"``; the empty text gives the robot itself.

        Returns
        -------
        Robot
            A new one; shapes are shared.
        """
        if not checks.text("Robot.renamed: prefix", prefix):
            return self
        robot = Robot(
            self.name,
            [prefix + link for link in self.links],
            [
                replace(
                    joint, name=prefix + joint.name, parent=prefix + joint.parent, child=prefix + joint.child,
                    mimic=joint.mimic and joint.mimic._replace(joint=prefix + joint.mimic.joint),
                )
                for joint in self.joints
            ],
            {prefix + link: elements for link, elements in self.geometry.items()},
            semantic_pairs=None if self.semantic_pairs is None
            else [(prefix + a, prefix + b, reason) for a, b, reason in self.semantic_pairs],
            states={
                label: {prefix + joint: value for joint, value in values.items()}
                for label, values in self.states.items()
            },
            notes=self.notes, missing_meshes=self.missing_meshes, sources=self.sources,
        )
        robot.prefix = prefix + self.prefix
        return robot


def _texts(field: str, values) -> list[str]:
    what = f"Robot: {field}"
    return [checks.text(what, value, SceneError) for value in checks.listed_entries(what, values, "texts", SceneError)]


def _checked_geometry(geometry) -> dict[str, tuple[LinkShape, ...]]:
    checked = {}
    for link, elements in checks.mapping("Robot: geometry", geometry, "link → its LinkShapes", SceneError).items():
        what = f"Robot: geometry[{brief(link)}]"
        listed = checks.listed_entries(what, elements, "a sequence of LinkShape", SceneError)
        for element in listed:
            checks.instance(what, element, LinkShape, "a sequence of LinkShape", SceneError)
        if listed:
            checked[link] = tuple(listed)
    return checked


def _checked_pairs(pairs) -> tuple[tuple[str, str, str], ...]:
    wanted = "(link, link, reason), three texts each"
    checked = [checks.listed_entries("Robot: semantic_pairs", pair, wanted, SceneError)
             for pair in checks.listed_entries("Robot: semantic_pairs", pairs, wanted, SceneError)]
    for pair in checked:
        if len(pair) != 3 or not all(isinstance(word, str) for word in pair):
            raise SceneError(f"Robot: semantic_pairs must be {wanted}, got {brief(pair)}")
    return tuple((a, b, reason) for a, b, reason in checked)


def _checked_states(states) -> dict[str, dict[str, float]]:
    form = "name → {joint: value}"
    return {
        label: dict(checks.mapping(f"Robot: states[{brief(label)}]", values, form, SceneError))
        for label, values in checks.mapping("Robot: states", states, form, SceneError).items()
    }


def _joint_value(name: str, value) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidArgument(f"joint {cut(str(name))}: the value must be a number, got {brief(value)}") from None
    if isinstance(value, bool) or not math.isfinite(number):
        raise InvalidArgument(f"joint {cut(str(name))}: the value must be a finite number, got {brief(value)}")
    return number
