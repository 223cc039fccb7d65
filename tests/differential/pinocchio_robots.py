"""Robots of example-robot-data as Pinocchio's models, for the test of agreement and the benchmark of its host."""

from __future__ import annotations

from pathlib import Path

from collide.scenes.loaders.resources import installed_folders

ROBOTS = {
    "Panda": "panda_description/urdf/panda.urdf",
    "UR5": "ur_description/urdf/ur5_robot.urdf",
    "Z1": "z1_description/urdf/z1.urdf",
    "Allegro hand": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "ANYmal B": "anymal_b_simple_description/robots/anymal.urdf",
}


def robots_folder() -> Path | None:
    """Where the robots are, None where they are not installed."""
    folder = next((f for f in installed_folders() if (f / "example-robot-data").is_dir()), None)
    return folder and folder / "example-robot-data" / "robots"


def load(name: str):
    """(model, geometry model) with all pairs of geometries on different joints."""
    import pinocchio as pin

    path = robots_folder() / ROBOTS[name]
    model = pin.buildModelFromUrdf(str(path))
    folders = [str(path.parents[4])]
    geom_model = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=folders)
    geom_model.addAllCollisionPairs()
    return model, geom_model
