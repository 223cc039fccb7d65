"""Bodies and joints of a compiled MuJoCo model as links and joints of one tree, whose root is the world.

MuJoCo turns a body by its joints one after the other, each about an anchor in the body; here each joint has a link of
its own. So a body with several joints becomes a chain of links BODY/JOINT, the last of which is the body itself, and a
body whose last joint turns about a point other than its origin hangs on that joint's link by a fixed joint. The frames
of links that are called like bodies are those of MuJoCo (``xpos``, ``xmat``). Columns of hinges and slides have the
values of ``qpos``: what MuJoCo subtracts from them, ``qpos0``, is in the poses of the joints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from collide.errors import cut, listing
from collide.robots.kinematic_tree import Joint, Mimic
from collide.scenes.description import free_name
from collide.scenes.loaders.robot_reading import BALL as BALL_JOINT
from collide.scenes.loaders.robot_reading import chain
from collide.transforms import pose

#: Kinds of joints (mjtJoint), as a compiled model numbers them.
FREE, BALL, SLIDE, HINGE = range(4)


@dataclass
class LinkTree:
    """Links and joints of a model.

    links : names, the root first.   joints : parents before children.
    of_body : name of the link that each body is, by the body's number.
    X_PJ_of_free : where the frame of each free body is at 0, by the number of its joint.
    names_of_joints : by the number of the joint, of those without a name, too.
    taken_joints : names of joints, for `free_name`.   notes : what the person who loads the model should know.
    """

    links: list[str]
    joints: list[Joint]
    of_body: list[str]
    X_PJ_of_free: dict[int, np.ndarray] = field(default_factory=dict)
    names_of_joints: dict[int, str] = field(default_factory=dict)
    taken_joints: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def link_tree(model) -> LinkTree:
    """The `LinkTree` of a ``mujoco.MjModel``."""
    return _Growing(model).grow()


class _Growing:
    """One tree while it is made, from the world on."""

    def __init__(self, model):
        self.model = model
        self.taken = _taken(model.body(k).name for k in range(1, model.nbody))
        root = free_name("world", self.taken)
        self.tree = LinkTree([root], [], [root])
        self.tree.taken_joints = _taken(model.joint(k).name for k in range(model.njnt))
        self.followers, self.held = self._constraints()

    def grow(self) -> LinkTree:
        model, tree = self.model, self.tree
        balls, mocap = [], []
        for body in range(1, model.nbody):
            parent = int(model.body_parentid[body])
            first, n = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            joints = list(range(first, first + n))
            name = model.body(body).name or free_name(f"body {body}", self.taken)
            tree.of_body.append(name)
            self._add_body(name, tree.of_body[parent], body, joints)
            balls += [joint for joint in joints if model.jnt_type[joint] == BALL]
            mocap += [name] if model.body_mocapid[body] >= 0 else []
        if balls:
            limited = [tree.names_of_joints[joint] for joint in balls if model.jnt_limited[joint]]
            about = f"; the limits of {listing(limited)} were left out" if limited else ""
            names = listing(tree.names_of_joints[joint] for joint in balls)
            tree.notes.append(f"ball joints are columns NAME/yaw, NAME/pitch, NAME/roll: {names}{about}")
        if mocap:
            tree.notes.append(f"mocap bodies stand where the model has them: {listing(mocap)}")
        return tree

    def _add_body(self, name: str, parent: str, body: int, joints: list[int]) -> None:
        """The links and joints of one body; X is the pose of what comes next in the link made last."""
        model, tree = self.model, self.tree
        X = pose(model.body_pos[body], quat_wxyz=model.body_quat[body])
        if not joints:
            self._link(name, Joint(free_name(f"{name}/fixed", self.tree.taken_joints), "fixed", parent, name, X))
        elif model.jnt_type[joints[0]] == FREE:
            joint = self._joint_name(joints[0], f"{name}/free")
            tree.X_PJ_of_free[joints[0]] = X
            self._link(name, Joint(joint, "floating", parent, name, X))
        else:
            for number in joints:
                joint = self._joint_name(number, f"{name}/joint")
                anchor = np.zeros(3) if model.jnt_type[number] == SLIDE else np.array(model.jnt_pos[number])
                last = number == joints[-1] and not anchor.any()
                child = name if last else free_name(f"{name}/{joint.removeprefix(f'{name}/')}", self.taken)
                self._add_joint(number, joint, parent, child, X @ pose(anchor))
                parent, X = child, pose(-anchor)
            if parent != name:
                self._link(name, Joint(free_name(f"{name}/fixed", self.tree.taken_joints), "fixed", parent, name, X))

    def _joint_name(self, number: int, otherwise: str) -> str:
        name = self.model.joint(number).name or free_name(otherwise, self.tree.taken_joints)
        self.tree.names_of_joints[number] = name
        return name

    def _add_joint(self, number: int, name: str, parent: str, child: str, X_PJ: np.ndarray) -> None:
        """A hinge, slide or ball joint."""
        model = self.model
        if model.jnt_type[number] == BALL:
            for ball in chain(name, BALL_JOINT, parent, child, X_PJ, lambda link: free_name(link, self.taken)):
                self._link(ball.child, ball)
            return
        is_hinge, axis = model.jnt_type[number] == HINGE, np.array(model.jnt_axis[number])
        value = self.held.get(number, 0.0) - float(model.qpos0[model.jnt_qposadr[number]])
        if value:
            X_PJ = X_PJ @ (_rotation_about(axis, value) if is_hinge else pose(axis * value))
        limited = bool(model.jnt_limited[number])
        lower, upper = model.jnt_range[number].tolist() if limited else (-math.inf, math.inf)
        kind = "prismatic" if not is_hinge else "revolute" if limited else "continuous"
        joint = Joint(name, kind, parent, child, X_PJ, axis, lower, upper, self._mimic(number))
        self._link(child, replace(joint, type="fixed", mimic=None) if number in self.held else joint)

    def _link(self, name: str, joint: Joint) -> None:
        self.tree.links.append(name)
        self.tree.joints.append(joint)

    # --- constraints ----------------------------------------------------------------------------

    def _constraints(self) -> tuple[dict[int, tuple[int, float, float]], dict[int, float]]:
        """(joint → the joint that it follows, multiplier, offset; joint → the value that it is held at)."""
        import mujoco

        model = self.model
        none_hold = int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        followers: dict[int, tuple[int, float, float]] = {}
        held: dict[int, float] = {}
        lost = []
        for k in range(model.neq):
            if none_hold or not model.eq_active0[k]:
                continue
            a, b = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            constant, slope, *bent = model.eq_data[k, :5].tolist()
            kind = mujoco.mjtEq(int(model.eq_type[k]))
            if kind != mujoco.mjtEq.mjEQ_JOINT or any(bent) or a in followers or a in held:
                lost.append(f"{kind.name.removeprefix('mjEQ_').lower()} {model.equality(k).name or k}")
                continue
            constant += float(model.qpos0[model.jnt_qposadr[a]])
            if b < 0 or slope == 0.0:
                held[a] = constant
            else:
                followers[a] = b, slope, constant - slope * float(model.qpos0[model.jnt_qposadr[b]])
        while after := [a for a, (b, _, _) in followers.items() if b in held]:
            for a in after:
                b, slope, offset = followers.pop(a)
                held[a] = slope * held[b] + offset
        if held:
            names = (f"{cut(model.joint(joint).name)} at {value:g}" for joint, value in held.items())
            self.tree.notes.append(f"joints that a constraint holds are fixed: {listing(names)}")
        if lost:
            self.tree.notes.append(
                f"constraints that are NOT kept, since only a joint that follows one other by a line can be: "
                f"{listing(lost)}"
            )
        return followers, held

    def _mimic(self, number: int) -> Mimic | None:
        if number not in self.followers:
            return None
        followed, slope, offset = self.followers[number]
        name = self.model.joint(followed).name  # a constraint names its joints
        return Mimic(name, slope, offset)


def values_of(model, tree: LinkTree, qpos: np.ndarray) -> dict[str, float]:
    """Column → value [rad or m] where a model has the positions (nq,) of its joints.

    Held joints have no column; the values of those that follow others are told, too. O(joints).
    """
    values: dict[str, float] = {}
    types = {joint.name: joint.type for joint in tree.joints}
    for number in range(model.njnt):
        name, at = tree.names_of_joints[number], int(model.jnt_qposadr[number])
        if model.jnt_type[number] == FREE:
            X_PB = pose(qpos[at : at + 3], quat_wxyz=qpos[at + 3 : at + 7])
            X_JL = np.linalg.inv(tree.X_PJ_of_free[number]) @ X_PB
            numbers = [*X_JL[:3, 3].tolist(), *roll_pitch_yaw(X_JL[:3, :3])]
            values |= {f"{name}/{word}": v + 0.0 for word, v in zip(("x", "y", "z", "roll", "pitch", "yaw"), numbers)}
        elif model.jnt_type[number] == BALL:
            roll, pitch, yaw = roll_pitch_yaw(pose(quat_wxyz=qpos[at : at + 4])[:3, :3])
            values |= {f"{name}/roll": roll, f"{name}/pitch": pitch, f"{name}/yaw": yaw}
        elif types[name] != "fixed":
            values[name] = float(qpos[at])
    return values


def roll_pitch_yaw(R: np.ndarray) -> tuple[float, float, float]:
    """Angles [rad] with R = Rz(yaw) Ry(pitch) Rx(roll), to rounding wherever the pitch is."""
    yaw = math.atan2(R[1, 0], R[0, 0])
    s, c = math.sin(yaw), math.cos(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    return math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw


def _rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """(4, 4) rotation about a unit axis: Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return pose(R=np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K))


def _taken(names) -> dict[str, int]:
    return dict.fromkeys(filter(None, names), 1)
