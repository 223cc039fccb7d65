"""Joints and the tree they make of links: checked, sorted from the root, mimicking chains resolved."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from collide.errors import SceneError, brief, cut, listing
from collide.transforms import as_poses

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
    """A joint of the tree.

    X_PJ : (4, 4) pose of the joint frame in the parent link.
    axis : (3,) in the joint frame; any length but zero, normalised when the robot is made.
    lower, upper : limits [rad] or [m]; infinite for joints without limits.
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


def indices_of(kind: str, names: Sequence[str]) -> dict[str, int]:
    index: dict[str, int] = {}
    for k, name in enumerate(names):
        if name in index:
            raise SceneError(
                f"the name is used twice ({kind}s {index[name]} and {k}): rename one", element=f'{kind} "{cut(name)}"'
            )
        index[name] = k
    return index


def checked_joint(joint: Joint, links: Mapping[str, int]) -> Joint:
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
        # An axis like (0, 0, 1) must keep its bits.
        axis = axis if length == 1.0 else axis / length
    if math.isnan(joint.lower) or math.isnan(joint.upper):
        raise SceneError(f"limits must be numbers, got [{joint.lower}, {joint.upper}]", element=element)
    # A fixed joint follows nothing, whatever its file says.
    return replace(joint, X_PJ=X_PJ, axis=axis, mimic=None if joint.type == "fixed" else joint.mimic)


def tree_of(links: Sequence[str], joints: Sequence[Joint]) -> tuple[str, list[Joint]]:
    """The root link and the joints sorted so that parents come before children."""
    if not links:
        raise SceneError(f"the robot has no links, got {brief(links)}")
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


def broken_mimics(joints: Sequence[Joint]) -> dict[str, str]:
    """Joint → why its mimic fails: its driving joint does not exist, or the mimics form a cycle."""
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


def broken_note(name: str, why: str) -> str:
    return (
        f'joint "{cut(name)}": {why}; it was taken as a joint of its own, which stands at 0 or the limit nearest '
        'to it unless a value is given'
    )


def resolve_mimics(joints: Sequence[Joint]) -> dict[str, tuple[str, float, float]]:
    """Joint with a single coordinate → (its driving joint, multiplier, offset), chains of mimics followed to their
    end.
    """
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


class Joined:
    """Groups of names joined in pairs, directly or by way of further names (union-find)."""

    def __init__(self) -> None:
        self._above: dict[str, str] = {}

    def leader(self, name: str) -> str:
        """The name that stands for the group of a name."""
        while (above := self._above.get(name, name)) != name:
            self._above[name] = name = self._above.get(above, above)
        return name

    def join(self, a: str, b: str) -> bool:
        """Join the groups of two names; whether the groups were apart."""
        a, b = self.leader(a), self.leader(b)
        self._above[b] = a
        return a != b


def rigid_clusters(links: Sequence[str], joints: Sequence[Joint]) -> tuple[tuple[str, ...], ...]:
    """Links welded together by fixed joints, each cluster and all clusters in the order of the links."""
    joined = Joined()
    for joint in joints:
        if joint.type == "fixed":
            joined.join(joint.parent, joint.child)
    members: dict[str, list[str]] = {}
    for link in links:
        members.setdefault(joined.leader(link), []).append(link)
    return tuple(tuple(cluster) for cluster in members.values())
