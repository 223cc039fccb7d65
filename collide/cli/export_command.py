"""The command ``collide export``: a robot among what stands around, written for programs in C."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable

from collide.cli import scenes as cli_scenes
from collide.cli.files import check_place
from collide.errors import InvalidArgument

EPILOG = """examples:
  collide export panda_workbench --out panda.collide
  collide export robot.urdf cell.yaml --padding 5mm --out arm.collide
  collide export cell.yaml --name left_arm --state packing --out left.collide

Writes one robot of a scene, with what it carries, the pairs that are never
tested, and all other bodies where they stand, as a file for collide_robot_load:
programs in C, C++ and Rust then ask whether configurations collide, how near
they are, and which motions are free, with the same answers as in Python, which
they do not need. In Python the same is RobotChecker.save.

Meshes that are not convex are asked as they are; how near they are, C does not
say: --meshes hull, or pieces, for that. docs/c-interface.md is the manual.

exit status: 0 written, 2 error"""


def add_arguments(parser: argparse.ArgumentParser, add_scene_arguments: Callable, length: Callable) -> None:
    add_scene_arguments(parser)
    group = parser.add_argument_group("export")
    group.add_argument("--out", metavar="FILE", required=True, help="the file to write: .collide")
    group.add_argument("--name", metavar="NAME", help="which robot, of a scene with several")
    group.add_argument("--padding", type=length, default=0.0, metavar="D",
                       help="links count as larger by this against the scene: 0.005 (metres), 5mm")
    parser.add_argument("--quiet", action="store_true", help="no summary, no progress; errors are still told")


def run(args: argparse.Namespace, progress: Callable) -> int:
    """Write the file, and say what is in it; 0."""
    from collide import RobotChecker

    check_place("--out", args.out, ".collide")
    states = cli_scenes.load_states(args, progress)
    if len(states) != 1:
        raise InvalidArgument(f"--state: a file is of one state, got {len(states)}: they tell where other bodies stand")
    scene = states[0][1]
    if not scene.placements:
        raise InvalidArgument(f"scene {scene.name} has no robot to export; add its URDF, or --robot FILE")
    with progress("preparing the robot"):
        checker = RobotChecker.from_scene(scene, args.name, padding=args.padding)
        checker.save(args.out)
    if not args.quiet:
        print(
            f"{args.out}: {checker.robot.name}, {checker.robot.dof} columns, {len(checker.bodies)} bodies among "
            f"{len(checker.around)}, {checker.n_pairs} pairs tested; {os.path.getsize(args.out) / 1000:.0f} kB"
        )
    return 0
