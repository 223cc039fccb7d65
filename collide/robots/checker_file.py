"""A checker as a file for programs in C: the tables of its kernels, with a digest.

Little endian: MAGIC, the version, the number of words in all, a digest of the rest (16 bytes, BLAKE2b); then, for each
of SECTIONS, the word of its first element and the number of its elements; then the elements, each section from a
whole word on. `native/capi_robot_file.c` reads the file, and checks all of it.
"""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING

import numpy as np

from collide.errors import UnsupportedQuery
from collide.lowering.packed_convex import POINTS
from collide.lowering.set_rows import RANK
from collide.lowering.shape_table import ShapeTable
from collide.robots import check_scene as layout
from collide.robots import motion_bounds as motions
from collide.robots import sphere_lanes as lanes
from collide.robots.check_workspace import CheckWorkspace

if TYPE_CHECKING:
    from collide.robots.checker_scene import CheckerScene

MAGIC, VERSION = b"COLLIDER", 2
#: Words before the digest's message: magic, version, words in all, digest.
_HEAD = 5
#: Words of a header that a file holds: how many there are of everything, then what else is a number.
SIZES = {
    "scene": (
        layout.N_LINKS, layout.N_JOINTS, layout.N_BODIES, layout.N_LINK_PARTS, layout.N_PARTS, layout.N_SELF_PAIRS,
        layout.N_AROUND, layout.N_NODES, layout.N_UNBOUNDED, layout.ROOT, layout.PADDED,
    ),
    "spheres": (lanes.N_SPHERES, lanes.N_MAPS, lanes.FEWEST),
    "motions": (motions.PATH_STRIDE, motions.ITEM_CAPACITY),
}
#: Sections in the order of the file, with the types of their elements.
SECTIONS = {
    "sizes": "<i8", "names": "u1", "scalars": "<f8", "joint_ints": "<i8", "joint_doubles": "<f8", "moves": "u1",
    "shape_ints": "<i8", "shape_numbers": "<f8", "points": "<f8", "bodies": "<i8", "body_boxes": "<f8", "parts": "<f8",
    "part_boxes": "<f8", "is_bound": "u1", "shape_of": "<i8", "poses": "<f8", "part_poses": "<f8", "body_of": "<i8",
    "around_poses": "<f8", "self_pairs": "<i8", "allowed": "u1", "nodes": "<f8", "node_links": "<i8",
    "unbounded": "<i8", "sphere_counts": "<i8", "around_bodies": "<f8", "sphere_rows": "<f8",
    "part_kinds": "<i8", "part_numbers": "<f8", "map_ints": "<i8", "map_doubles": "<f8", "map_cells": "u1",
    "paths": "<i8", "path_lengths": "<i8", "between": "<i8", "questions": "<i8", "facet_ints": "<i8",
    "facet_numbers": "<f8", "facet_vertices": "<f8", "facet_faces": "<i8",
}


def checker_bytes(checker: CheckerScene) -> bytes:
    """The file of a checker as its World stands. Raises UnsupportedQuery with fields around."""
    setting = checker.prepare()
    if setting.surroundings.has_fields:
        raise UnsupportedQuery(
            "RobotChecker.save: clouds, grids and large terrain around a robot are asked in Python; programs in C "
            "ask the robot without them, and fields by collide_field_collide"
        )
    space = CheckWorkspace(checker.robot, setting)
    sections = _sections(checker, space)
    return _written({name: np.ascontiguousarray(sections[name], dtype=kind) for name, kind in SECTIONS.items()})


def _written(sections: dict[str, np.ndarray]) -> bytes:
    """The file of arrays, in the order of the file."""
    words = _HEAD + 2 * len(sections)
    table, data = [], []
    for elements in sections.values():
        read = elements.tobytes()
        table += [words, elements.size]
        data.append(read + bytes(-len(read) % 8))
        words += len(data[-1]) // 8
    message = np.array(table, dtype="<i8").tobytes() + b"".join(data)
    digest = blake2b(message, digest_size=16).digest()
    return MAGIC + np.array([VERSION, words], dtype="<i8").tobytes() + digest + message


def _sections(checker: CheckerScene, space: CheckWorkspace) -> dict[str, np.ndarray]:
    robot, setting = checker.robot, space.setting
    made, spheres, paths = space.tables(), space.sphere_tables(), space.motions(1.0)
    headers = {"scene": space.header, "spheres": spheres.pop("header"), "motions": paths.header}
    sizes = [headers[of][word] for of, words in SIZES.items() for word in words]
    meshes = space.mesh_tables()
    has_meshes, n_facet_bodies = int(len(meshes["facet_numbers"]) > 0), len(meshes["facet_ints"])
    counts = robot.dof, len(setting.table.packed), int(setting.spheres is not None), has_meshes, n_facet_bodies
    around = setting.surroundings
    names = [*robot.joint_names, *checker.bodies, *checker.around]
    slack = space.header[layout.SLACK : layout.SLACK + 1].view(np.float64)
    rounding = paths.header[motions.ROUNDING :].view(np.float64)
    return {
        "sizes": np.array([*counts, int(around.has_margins), *sizes]),
        "names": np.frombuffer("".join(f"{name}\0" for name in names).encode(), dtype=np.uint8),
        "scalars": np.concatenate([setting.base, slack, rounding]), "joint_ints": robot.joint_table.ints,
        "joint_doubles": robot.joint_table.doubles, "moves": robot.moves, **_shapes(setting.table), **made,
        "around_poses": np.array([body.X_WB for body in around.bodies]), **spheres, **paths.tables(), **meshes,
    }


def _shapes(table: ShapeTable) -> dict[str, np.ndarray]:
    """Of each convex set: kind, number of points, whether a support tree may be made, rank; its row of doubles."""
    n = len(table.packed)
    ints = [(p.kind, len(p.points), p.prepared.with_tree, rank) for p, rank in zip(table.packed, table.ints[:n, RANK])]
    points = [p.points for p in table.packed if p.kind == POINTS]
    return {
        "shape_ints": np.array(ints, dtype=np.int64), "shape_numbers": table.numbers[:n],
        "points": np.concatenate([np.zeros((0, 3)), *points]),
    }
