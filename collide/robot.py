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
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from collide.errors import InvalidArgument, InvalidPose, SceneError, brief, cut, listing
from collide.shapes.shape import Shape
from collide.transforms import LARGEST, as_poses

#: Module and function that read robots from files: found when first needed, since the engine imports no loader.
_LOADER = ("collide.scenes.loaders.urdf", "load_robot")
#: Columns of ``q`` by joint type.
COLUMNS = {
    "revolute": ("",),
    "continuous": ("",),
    "prismatic": ("",),
    "planar": ("/x", "/y", "/yaw"),
    "floating": ("/x", "/y", "/z", "/roll", "/pitch", "/yaw"),
    "fixed": (),
}


class Mimic(NamedTuple):
    """A joint that follows another: value = multiplier · value(joint) + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Joint:
    """One joint of the tree.

    X_PJ : (4, 4) pose of the joint frame in the parent link.
    axis : (3,) in the joint frame; any length but zero, normalised when the robot is made.
    lower, upper : limits [rad] or [m]; infinite where there are none.
    """

    name: str
    type: str
    parent: str
    child: str
    X_PJ: np.ndarray = field(default_factory=lambda: np.eye(4))
    axis: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    lower: float = -math.inf
    upper: float = math.inf
    mimic: Mimic | None = None


class LinkShape(NamedTuple):
    """One collision element of a link.

    shape : in its own frame G.   X_LG : (4, 4) pose of G in the link.
    approximation : what the shape leaves out of the element described, None when nothing.
    source : where the element is described, ``file: element``.
    """

    shape: Shape
    X_LG: np.ndarray
    approximation: str | None
    source: str


class Robot:
    """Links, joints, limits, collision geometry and the pairs that are never tested.

    Parameters
    ----------
    name : str
        Of the robot.
    links : sequence of str
        Names of the links, in the order of the file.
    joints : sequence of Joint
        In the order of the file; together they make one tree. Joints that cannot follow what they are said to mimic (a
        joint that does not exist, a cycle) become joints of their own, and a note is added for each.
    geometry : mapping of str to sequence of LinkShape, optional
        Link → its collision elements; links without collision geometry may be left out.
    semantic_pairs : iterable of (link, link, reason), optional
        From an SRDF. None: links next to each other in the tree are taken as never tested.
    states : mapping, optional
        Named joint values [rad or m], ``{"ready": {"joint1": 0.0, ...}}``.
    notes : iterable of str
        What the person who loads the robot should know.
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
    place
        The robot and the file it comes from, for messages.

    Raises
    ------
    SceneError
        Naming the link or joint, where names repeat, geometry has no link, or the joints do not make one tree.
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
        sources: Iterable[str] = (),
    ):
        self.name = name
        self.links = tuple(links)
        self._index = _indices("link", self.links)
        self.sources = list(sources)
        self.place = ": ".join((*self.sources[:1], f"robot {cut(name)}"))
        checked = [_checked_joint(joint, self._index) for joint in joints]
        _indices("joint", [joint.name for joint in checked])
        broken = _broken_mimics(checked)
        self.joints = tuple(replace(joint, mimic=None) if joint.name in broken else joint for joint in checked)
        self.root, self._order = _tree(self.links, self.joints)
        self._drivers = _resolve_mimics(self.joints)
        self._set_columns()
        self.geometry = {link: tuple(elements) for link, elements in (geometry or {}).items() if elements}
        for link in self.geometry:
            if link not in self._index:
                raise SceneError(f"unknown link; the robot has {listing(self.links)}", element=f'link "{cut(link)}"')
        self.rigid_clusters = _clusters(self.links, self.joints)
        self.base_links = next(cluster for cluster in self.rigid_clusters if self.root in cluster)
        self.semantic_pairs = None if semantic_pairs is None else tuple(semantic_pairs)
        self.states = {label: dict(values) for label, values in (states or {}).items()}
        file = Path(self.sources[0]).name if self.sources else f"robot {cut(name)}"
        self.notes = [*notes, *(f"{file}: {_about_broken(joint, why)}" for joint, why in broken.items())]

    @classmethod
    def load(cls, path, srdf=None, **options) -> Robot:
        """A robot from a URDF file, with the SRDF beside it or the one given.

        Parameters
        ----------
        path : str or Path
            The URDF file.
        srdf : str, Path or bool, optional
            The SRDF file. None looks beside the URDF, False does without.
        **options
            ``meshes``, ``package_path`` and ``missing_meshes`` as of `collide.scenes.load`.

        Returns
        -------
        Robot
            With everything that URDF and SRDF say about collisions.

        Raises
        ------
        SceneError
            Naming file, element and value of what cannot be read.
        """
        return getattr(import_module(_LOADER[0]), _LOADER[1])(path, srdf=srdf, **options)

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
            values for joints that cannot take one.
        start : (dof,) float64, optional
            What columns without a value keep; by default `default_configuration`.

        Returns
        -------
        q : (dof,) float64
            [rad or m].
        notes : list of str
            For the person who gave the values.

        Raises
        ------
        InvalidArgument
            For unknown joints (the known ones are listed) and for values that are not finite numbers.
        """
        q = self.default_configuration() if start is None else np.array(start, dtype=np.float64)
        column = {name: k for k, name in enumerate(self.joint_names)}
        by_name = {joint.name: joint for joint in self.joints}
        followers: list[tuple[Joint, float]] = []
        notes: list[str] = []
        for name, raw in values.items():
            value = _joint_value(name, raw)
            if name in column:
                q[column[name]] = value
            elif name not in by_name or by_name[name].type in ("planar", "floating"):
                raise InvalidArgument(
                    f"robot {self.name}: unknown joint {brief(name)}; it has {listing(self.joint_names) or 'no joints'}"
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
        """A note about the columns of a configuration that nobody gave a value.

        Parameters
        ----------
        names : iterable of str
            The columns that were given one.
        q : (dof,) float64
            The configuration [rad or m].

        Returns
        -------
        list of str
            One note, or none.
        """
        names = set(names)
        unset = [(name, value) for name, value in zip(self.joint_names, q) if name not in names]
        if not unset:
            return []
        listed = ", ".join(f"{name} = {value:g}" if value else name for name, value in unset)
        return [f"robot {self.name}: no value given for {listed}: 0 taken, or the limit nearest to 0"]

    def joint_value(self, name: str, q: np.ndarray) -> float:
        """The value of a joint that moves along one coordinate, mimicking ones included.

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
        """
        driver, multiplier, offset = self._drivers[name]
        return multiplier * float(q[self._columns[driver]]) + offset

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
        notes = []
        for joint in self.joints:
            if joint.type not in ("revolute", "prismatic"):
                continue
            value = self.joint_value(joint.name, q)
            slack = 1e-9 * max(1.0, abs(value))  # files print limits and values with rounded digits
            if not joint.lower - slack <= value <= joint.upper + slack:
                unit = "rad" if joint.type == "revolute" else "m"
                notes.append(
                    f"robot {self.name}: joint {joint.name} at {value:g} {unit} is outside its limits "
                    f"[{joint.lower:g}, {joint.upper:g}]"
                )
        return notes

    # --- kinematics ------------------------------------------------------------------------------

    def link_poses(self, q, X_WR=None) -> np.ndarray:
        """Forward kinematics: the poses of all links.

        Every row is computed alone, by the same additions and multiplications: one row gives the same bits as that row
        in a batch.

        Parameters
        ----------
        q : (dof,) or (N, dof) array_like, float64
            Configurations [rad or m], columns as in ``joint_names``; a single one gives N = 1.
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
            Naming file, link and joint, where a link leaves the range of coordinates that poses may have.
        """
        q = self._as_configurations(q)
        X_WLs = np.empty((len(q), len(self.links), 4, 4))
        X_WLs[:, self._index[self.root]] = np.eye(4) if X_WR is None else as_poses(X_WR, "X_WR")[0]
        with np.errstate(over="ignore", invalid="ignore"):  # looked at below
            for joint in self._order:
                X_WJ = _product(X_WLs[:, self._index[joint.parent]], joint.X_PJ[None])
                X_JL = self._motion(joint, q)
                X_WLs[:, self._index[joint.child]] = X_WJ if X_JL is None else _product(X_WJ, X_JL)
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

    def _as_configurations(self, q) -> np.ndarray:
        try:
            array = np.asarray(q, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise InvalidArgument(
                f"q must be numbers of shape ({self.dof},) or (N, {self.dof}), got {brief(q)}"
            ) from None
        if array.ndim not in (1, 2) or array.shape[-1] != self.dof:
            raise InvalidArgument(
                f"q must have shape ({self.dof},) or (N, {self.dof}), one column for each of "
                f"{listing(self.joint_names) or 'no joints'}; got {array.shape}"
            )
        array = array if array.ndim == 2 else array[None]
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            row, col = bad[0]
            raise InvalidArgument(f"q[{row}], joint {self.joint_names[col]}, is {array[row, col]}: it must be finite")
        return array

    def _motion(self, joint: Joint, q: np.ndarray) -> np.ndarray | None:
        """X_JL of a joint, (N, 4, 4), or None where it is the identity."""
        if joint.type == "fixed":
            return None
        if joint.type == "floating":
            return _floating(q[:, self._columns[joint.name] :][:, :6])
        if joint.type == "planar":
            return _planar(joint.axis, q[:, self._columns[joint.name] :][:, :3])
        driver, multiplier, offset = self._drivers[joint.name]
        value = q[:, self._columns[driver]] * multiplier + offset
        if joint.type == "prismatic":
            return _translation(value[:, None] * joint.axis)
        return _rotation(joint.axis, value)

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
        if not prefix:
            return self
        return Robot(
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
            notes=self.notes, sources=self.sources,
        )


# --- the tree -----------------------------------------------------------------------------------


def _indices(kind: str, names: Sequence[str]) -> dict[str, int]:
    index: dict[str, int] = {}
    for k, name in enumerate(names):
        if name in index:
            raise SceneError(
                f"the name is used twice ({kind}s {index[name]} and {k}): rename one", element=f'{kind} "{cut(name)}"'
            )
        index[name] = k
    return index


def _checked_joint(joint: Joint, links: Mapping[str, int]) -> Joint:
    element = f'joint "{cut(joint.name)}"'
    if joint.type not in COLUMNS:
        raise SceneError(f'unknown type "{cut(joint.type)}"; known are {", ".join(COLUMNS)}', element=element)
    for role, link in (("parent", joint.parent), ("child", joint.child)):
        if link not in links:
            raise SceneError(f'its {role} is link "{cut(link)}", which the robot does not have', element=element)
    X_PJ = as_poses(joint.X_PJ, f"{element} origin")[0]
    axis = np.asarray(joint.axis, dtype=np.float64)
    if axis.shape != (3,) or not np.isfinite(axis).all():
        raise SceneError(f"axis must be 3 finite numbers, got {joint.axis!r}", element=element)
    largest = float(np.abs(axis).max())
    axis = axis / largest if largest > 1e100 else axis  # the square of its length must be a number
    length = math.sqrt(float(axis @ axis))
    if joint.type in ("revolute", "continuous", "prismatic", "planar"):
        if not length > 1e-9:
            raise SceneError(f"axis {axis.tolist()} has length 0 and names no direction", element=element)
        # An axis such as (0, 0, 1) must stay as it is, bit by bit.
        axis = axis if length == 1.0 else axis / length
    if math.isnan(joint.lower) or math.isnan(joint.upper):
        raise SceneError(f"limits must be numbers, got [{joint.lower}, {joint.upper}]", element=element)
    # A fixed joint follows nothing, whatever its file says.
    return replace(joint, X_PJ=X_PJ, axis=axis, mimic=None if joint.type == "fixed" else joint.mimic)


def _tree(links: Sequence[str], joints: Sequence[Joint]) -> tuple[str, list[Joint]]:
    """The root link and the joints sorted so that parents come before children."""
    if not links:
        raise SceneError("the robot has no links")
    above: dict[str, Joint] = {}
    for joint in joints:
        if joint.child in above:
            raise SceneError(
                f'link "{cut(joint.child)}" has two parents: it is also the child of joint '
                f'"{cut(above[joint.child].name)}"',
                element=f'joint "{cut(joint.name)}"',
            )
        above[joint.child] = joint
    _refuse_cycles(links, above)
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise SceneError(
            f"{len(roots)} links have no parent ({listing(roots)}): a robot is one tree; join them to one root"
        )
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    order: list[Joint] = []
    waiting = deque([roots[0]])
    while waiting:
        children = below.get(waiting.popleft(), [])
        order.extend(children)
        waiting.extend(joint.child for joint in children)
    return roots[0], order


def _refuse_cycles(links: Sequence[str], above: Mapping[str, Joint]) -> None:
    rooted: set[str] = set()
    for link in links:
        path: dict[str, None] = {}  # in order, and found at once
        here = link
        while here in above and here not in rooted and here not in path:
            path[here] = None
            here = above[here].parent
        if here in path:
            upwards = list(path)
            cycle = [*upwards[upwards.index(here) :][::-1], upwards[-1]]
            raise SceneError(
                f"the joints make a cycle, {_chain(cycle)}: a robot is a tree",
                element=f'joint "{cut(above[here].name)}"',
            )
        rooted.update(path)


def _chain(names: Sequence[str]) -> str:
    return " -> ".join(map(cut, names if len(names) <= 12 else [*names[:6], "...", *names[-6:]]))


def _broken_mimics(joints: Sequence[Joint]) -> dict[str, str]:
    """Joint -> why it cannot follow another: there is none of that name, or they follow each other in a circle."""
    single = {joint.name: joint for joint in joints if len(COLUMNS[joint.type]) == 1}
    broken: dict[str, str] = {}
    for joint in joints:
        if joint.mimic is None:
            continue
        if not (math.isfinite(joint.mimic.multiplier) and math.isfinite(joint.mimic.offset)):
            what = f"multiplier {joint.mimic.multiplier} and offset {joint.mimic.offset} must be finite"
            raise SceneError(what, element=f'joint "{cut(joint.name)}" mimic')
        if joint.name not in single:
            broken[joint.name] = f"a {joint.type} joint has no single value that could follow another"
        elif joint.mimic.joint not in single:
            broken[joint.name] = (
                f'it mimics joint "{cut(joint.mimic.joint)}", which does not exist or has no single value'
            )
    ended: set[str] = set()  # joints whose chain was followed to its end
    for name in single:
        chain: dict[str, int] = {}
        here: str | None = name
        while here is not None and here not in ended and here not in chain:
            chain[here] = len(chain)
            mimic = single[here].mimic
            here = mimic.joint if mimic is not None and here not in broken else None
        if here in chain:
            circle = list(chain)[chain[here] :]
            broken.update(
                {member: f"joints mimic each other in a circle, {_chain([*circle, circle[0]])}" for member in circle}
            )
        ended.update(chain)
    return broken


def _about_broken(name: str, why: str) -> str:
    return (
        f'joint "{cut(name)}": {why}; it was taken as a joint of its own, which stands at 0 or the limit nearest '
        'to it unless a value is given'
    )


def _resolve_mimics(joints: Sequence[Joint]) -> dict[str, tuple[str, float, float]]:
    """Joint of one coordinate -> (the joint that drives it, multiplier, offset), chains followed to their end."""
    single = {joint.name: joint for joint in joints if len(COLUMNS[joint.type]) == 1}
    drivers: dict[str, tuple[str, float, float]] = {}
    for name in single:
        chain = [name]
        while chain[-1] not in drivers and (mimic := single[chain[-1]].mimic) is not None:
            chain.append(mimic.joint)
        drivers.setdefault(chain[-1], (chain[-1], 1.0, 0.0))
        for here in reversed(chain[:-1]):
            mimic = single[here].mimic
            assert mimic is not None
            driver, multiplier, offset = drivers[mimic.joint]
            composed = mimic.multiplier * multiplier, mimic.multiplier * offset + mimic.offset
            if not all(map(math.isfinite, composed)):
                what = (
                    f'along the chain to joint "{cut(driver)}" its multiplier becomes {composed[0]:g} and its '
                    f'offset {composed[1]:g}'
                )
                raise SceneError(f"{what}: both must be finite", element=f'joint "{cut(here)}" mimic')
            drivers[here] = (driver, *composed)
    return drivers


def _clusters(links: Sequence[str], joints: Sequence[Joint]) -> tuple[tuple[str, ...], ...]:
    """Links welded together by fixed joints, each cluster and all clusters in the order of the links."""
    leader = {link: link for link in links}

    def find(link: str) -> str:
        while leader[link] != link:
            leader[link] = link = leader[leader[link]]
        return link

    for joint in joints:
        if joint.type == "fixed":
            leader[find(joint.child)] = find(joint.parent)
    members: dict[str, list[str]] = {}
    for link in links:
        members.setdefault(find(link), []).append(link)
    return tuple(tuple(cluster) for cluster in members.values())


def _joint_value(name: str, value) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidArgument(f"joint {cut(str(name))}: the value must be a number, got {brief(value)}") from None
    if isinstance(value, bool) or not math.isfinite(number):
        raise InvalidArgument(f"joint {cut(str(name))}: the value must be a finite number, got {brief(value)}")
    return number


# --- motions ------------------------------------------------------------------------------------


def _product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A @ B for (N, 4, 4) poses, every entry by the same three products and sums in any batch.

    A matrix product from a library may round differently by the size of the batch.
    """
    R = A[:, :3, 0:1] * B[:, 0:1, :] + A[:, :3, 1:2] * B[:, 1:2, :] + A[:, :3, 2:3] * B[:, 2:3, :]
    out = np.empty((R.shape[0], 4, 4))
    out[:, :3] = R
    out[:, :3, 3] += A[:, :3, 3]
    out[:, 3] = (0.0, 0.0, 0.0, 1.0)
    return out


def _translation(p: np.ndarray) -> np.ndarray:
    X = np.zeros((len(p), 4, 4))
    X[:, (0, 1, 2, 3), (0, 1, 2, 3)] = 1.0
    X[:, :3, 3] = p
    return X


def _rotation(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(N, 4, 4) rotations by ``angle`` (N,) about a unit ``axis`` (3,): Rodrigues' formula.

    The diagonal is a² + cos·(1 − a²), so that turning about a coordinate axis leaves exact 0 and 1.
    """
    x, y, z = axis
    s, c = np.sin(angle), np.cos(angle)
    t = 1.0 - c
    X = np.zeros((len(angle), 4, 4))
    X[:, 0, 0], X[:, 1, 1], X[:, 2, 2] = (a * a + c * (1.0 - a * a) for a in (x, y, z))
    X[:, 0, 1], X[:, 1, 0] = x * y * t - z * s, x * y * t + z * s
    X[:, 0, 2], X[:, 2, 0] = x * z * t + y * s, x * z * t - y * s
    X[:, 1, 2], X[:, 2, 1] = y * z * t - x * s, y * z * t + x * s
    X[:, 3, 3] = 1.0
    return X


def _planar(normal: np.ndarray, values: np.ndarray) -> np.ndarray:
    """A shift within the plane across ``normal``, then a turn about it."""
    # The first in-plane axis is the coordinate axis farthest from the normal, made orthogonal to
    # it: for normal z the two are x and y themselves.
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - (first @ normal) * normal
    first /= math.sqrt(float(first @ first))
    second = np.cross(normal, first)
    X = _rotation(normal, values[:, 2])
    X[:, :3, 3] = values[:, 0:1] * first + values[:, 1:2] * second
    return X


def _floating(values: np.ndarray) -> np.ndarray:
    """x, y, z, roll, pitch, yaw: the turns about fixed x, y, z axes, as URDF has them."""
    roll, pitch, yaw = (_rotation(axis, values[:, 3 + k]) for k, axis in enumerate(np.eye(3)))
    X = _product(yaw, _product(pitch, roll))
    X[:, :3, 3] = values[:, :3]
    return X
