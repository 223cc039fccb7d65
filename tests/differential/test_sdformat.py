"""SDFormat beside Drake: random models, the same links at the same poses.

Drake reads the files with libsdformat, which shares no code with collide's reader.
"""

from __future__ import annotations

import logging

import numpy as np
import pytest

from collide.scenes import load

pytestmark = pytest.mark.slow

KINDS = ("revolute", "continuous", "prismatic", "universal", "ball", "screw", "fixed")


def pose_text(rng, about: str = "") -> str:
    xyz, rpy = rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3)
    style = rng.integers(3)
    if style == 0:
        numbers, how = [*xyz, *np.degrees(rpy)], ' degrees="true"'
    elif style == 1:
        quat = rng.normal(size=4)
        numbers, how = [*xyz, *(quat / np.linalg.norm(quat))], ' rotation_format="quat_xyzw"'
    else:
        numbers, how = [*xyz, *rpy], ""
    return f'<pose{about}{how}>{" ".join(map(repr, map(float, numbers)))}</pose>'


def relative(rng, frames: list[str]) -> str:
    return f' relative_to="{rng.choice(frames)}"' if frames and rng.random() < 0.6 else ""


def random_model(rng, name: str, depth: int = 0) -> tuple[str, list[str]]:
    """(a model, names of its links): a tree of links with every kind of joint that both read."""
    links = [f"l{k}" for k in range(int(rng.integers(1, 6)))]
    inside, frames = [], []
    for k, link in enumerate(links):
        inside.append(f'<link name="{link}">{pose_text(rng, relative(rng, frames))}</link>')
        frames.append(link)
        if rng.random() < 0.4:
            frame, attached = f"f{depth}_{k}", f' attached_to="{rng.choice(frames)}"' if rng.random() < 0.6 else ""
            inside.append(f'<frame name="{frame}"{attached}>{pose_text(rng, relative(rng, frames))}</frame>')
            frames.append(frame)
    ends, every = list(links), list(links)
    if depth < 2 and rng.random() < 0.5:
        within = f"n{depth}"
        nested, inner = random_model(rng, within, depth + 1)
        if rng.random() < 0.7:
            opening, _, rest = nested.partition(">")
            nested = f"{opening}>{pose_text(rng, relative(rng, frames))}{rest}"
        inside.append(nested)
        every += [f"{within}::{link}" for link in inner]
        frames += [within, *every[len(links) :]]
        ends.append(every[len(links)])  # its root: all else in it is joined to that
    for k, child in enumerate(ends[1:]):
        parent, kind = str(rng.choice(ends[: k + 1])), str(rng.choice(KINDS))
        inside.append(random_joint(rng, f"j{depth}_{k}", kind, parent, child, frames))
    about = f' placement_frame="{rng.choice(links)}"' if rng.random() < 0.3 else ""
    return f'<model name="{name}"{about}>' + "\n".join(inside) + "</model>", every


def random_joint(rng, name: str, kind: str, parent: str, child: str, frames: list[str]) -> str:
    axes, axis = [], np.zeros(3)
    for tag in {"universal": ("axis", "axis2"), "ball": (), "fixed": ()}.get(kind, ("axis",)):
        xyz = rng.normal(size=3)
        if tag == "axis2":  # Drake wants them at right angles
            xyz = np.cross(axis, xyz)
        axis = xyz / np.linalg.norm(xyz)
        about = f' expressed_in="{rng.choice(frames)}"' if rng.random() < 0.4 and kind != "universal" else ""
        numbers = " ".join(map(repr, map(float, axis)))
        axes.append(f"<{tag}><xyz{about}>{numbers}</xyz><limit><lower>-9</lower><upper>9</upper></limit></{tag}>")
    pitch = "<screw_thread_pitch>0.3</screw_thread_pitch>" if kind == "screw" else ""
    at = pose_text(rng, relative(rng, frames)) if rng.random() < 0.7 else ""
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{ends}{at}{pitch}{"".join(axes)}</joint>'


def drake_poses(path, drake, rng):
    """(link → pose in the world, joint → values) of Drake's plant at a random configuration. Names of joints are
    unique."""
    plant = drake.MultibodyPlant(0.0)
    models = drake.Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    values: dict[str, list[float]] = {}

    def full(instance, name: str) -> str:
        return plant.GetModelInstanceName(instance).partition("::")[2] + "::" + name

    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.type_name() in ("revolute", "prismatic", "universal", "screw", "ball_rpy"):
            q = rng.uniform(-1, 1, joint.num_positions())
            everything = plant.GetPositions(context)
            everything[joint.position_start() : joint.position_start() + len(q)] = q
            plant.SetPositions(context, everything)
            values[joint.name()] = q.tolist()  # Drake has joints in the model of their child
    poses = {}
    for instance in range(plant.num_model_instances()):
        for index in plant.GetBodyIndices(drake.ModelInstanceIndex(instance)):
            body = plant.get_body(index)
            if body.name() != "world":
                name = full(body.model_instance(), body.name()).removeprefix("::")
                poses[name] = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
    assert models
    return poses, values


def test_links_of_random_models_stand_where_drake_has_them(tmp_path):
    drake = pytest.importorskip("pydrake.all", reason="the package drake is not installed")
    logging.getLogger("drake").setLevel(logging.CRITICAL)
    rng, compared, moved = np.random.default_rng(43), 0, 0
    for case in range(150):
        text, _ = random_model(rng, "m")
        path = tmp_path / "m.sdf"
        path.write_text(f'<sdf version="1.10">{text}</sdf>')
        theirs, values = drake_poses(path, drake, rng)
        scene = load(path)
        ours: dict[str, float] = {}
        for joint, q in values.items():
            names = [
                name for robot in scene.robots.values() for name in robot.joint_names
                if name.rpartition("::")[2].partition("/")[0] == joint
            ]
            if len(names) == 3:  # Drake's columns are roll, pitch, yaw
                q = q[::-1]
            if len(names) == len(q):
                ours.update(zip(names, q))
                moved += 1
        at = {}
        for placement in scene.with_state(ours).placements.values():
            at.update(zip(placement.robot.links, placement.robot.link_poses(placement.q, placement.X_WR)[0]))
        for link, X_WL in theirs.items():
            if link in at:
                compared += 1
                np.testing.assert_allclose(at[link], X_WL, atol=1e-12, err_msg=f"case {case}, link {link}\n{text}")
    assert compared > 400 and moved > 150, (compared, moved)
