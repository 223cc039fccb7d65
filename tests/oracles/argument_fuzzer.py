"""Bad arguments for every public function: only errors of collide may come out.

Signatures are read from the library itself: each public function, constructor and method is called with good arguments
of which one, at a time, is replaced by a bad one. A value that is taken is fine; an error must be a `CollideError` that
names the argument. What of the library is not reached must be excused by name (`EXCUSED`).

    python tests/oracles/argument_fuzzer.py [PART_OF_A_NAME]      # all values, each call's failures as snippets
"""

from __future__ import annotations

import atexit
import contextlib
import inspect
import io
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import GeneratorType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

import collide
import collide.scenes
from collide import adapters, polytopes, scenes, shapes, transforms
from collide.base.argument_checks import _KINDS
from collide.base.argument_checks import number as float_of
from collide.errors import brief
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape
from collide.scenes import families, generators

EYE = np.eye(4)
MODULES: tuple[ModuleType, ...] = (collide, polytopes, scenes, transforms, shapes, adapters, families)
#: Seconds that a call with a bad argument may take.
LIMIT = 10.0

#: Bad arguments by name, as source: each call makes its own, since generators can be read once.
BAD: dict[str, str] = {
    "None": "None",
    "text": "'abc'",
    "empty text": "''",
    "bytes": "b'abc'",
    "nan": "float('nan')",
    "inf": "float('inf')",
    "minus inf": "-float('inf')",
    "huge": "10**400",
    "very long": "10**5000",
    "minus huge": "-10**400",
    "large": "10**20",
    "minus one": "-1",
    "zero": "0",
    "half": "0.5",
    "True": "True",
    "complex": "1+2j",
    "fraction": "Fraction(10**400)",
    "decimal": "Decimal('1e400')",
    "empty list": "[]",
    "empty array": "np.zeros((0, 3))",
    "empty 4x4": "np.zeros((0, 4, 4))",
    "ones": "np.ones(7)",
    "matrix": "np.ones((2, 5))",
    "cube": "np.ones((2, 3, 4, 5))",
    "nan 3": "np.full(3, np.nan)",
    "nan 4x4": "np.full((4, 4), np.nan)",
    "objects": "np.array([object(), None])",
    "complex array": "np.ones(3) * 1j",
    "masked": "np.ma.masked_array([1., 2., 3.], [True, False, False])",
    "text array": "np.array(['a', 'b'])",
    "bool array": "np.array([True, False])",
    "int array": "np.arange(3)",
    "dates": "np.array(['2020-01-01'], dtype='M8[D]')",
    "scalar array": "np.array(1.0)",
    "ragged": "[[1, 2], [3]]",
    "lists": "[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]",
    "nested": "[[[[1]]]]",
    "mixed": "[1, 'a', None]",
    "dictionary": "{'a': 1}",
    "empty dictionary": "{}",
    "set": "{1, 2}",
    "generator": "(k for k in range(3))",
    "object": "object()",
    "type": "int",
    "module": "math",
    "function": "len",
    "sphere": "collide.Sphere(1)",
    "shapes": "[collide.Sphere(1)] * 2",
    "shape and none": "[collide.Sphere(1), None]",
    "mesh": "fuzzer.mesh()",
    "world": "collide.World()",
    "pose": "np.eye(4)",
    "poses": "np.zeros((3, 4, 4)) + np.eye(4)",
    "pair": "(1, 2)",
    "robot": "fuzzer.robot()",
    "huge list": "[10**400] * 3",
    "unhashable": "[[]]",
    "negative ids": "[-1, -2]",
    "huge ids": "[10**20]",
    "none list": "[None]",
    "range": "range(3)",
    "slice": "slice(None)",
    "surrogate": "'\\udc80'",
    "null": "'a\\0b'",
    "time span": "np.timedelta64(3, 's')",
    "records": "np.zeros(2, dtype=[('a', float)])",
    "minus zero": "-0.0",
    "subnormal": "5e-324",
    "numpy nan": "np.float64('nan')",
    "numpy single": "np.float32(-2.5)",
    "numpy integer": "np.int64(-7)",
    "numpy bool": "np.bool_(True)",
    "numpy complex": "np.complex128(1j)",
    "read-only": "fuzzer.read_only()",
    "strided": "np.arange(24.0).reshape(4, 6)[::2, ::2]",
    "backwards": "np.eye(4)[::-1]",
    "single precision": "np.eye(4, dtype=np.float32) * 2",
    "other byte order": "np.array([1.0, 2.0, 5.0], dtype='>f8')",
    "nan in the middle": "np.array([[0.0, 1.0, 2.0], [3.0, float('nan'), 4.0]])",
    "huge in the middle": "[1.0, 10**400, 0.0]",
    "objects that are numbers": "np.array([1, 2.5, Fraction(1, 3)], dtype=object)",
    "memory": "memoryview(b'abc')",
}


# --- good arguments -----------------------------------------------------------------------------


@cache
def mesh() -> collide.Mesh:
    """A closed mesh of 12 facets."""
    return collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1)))[:2])


@cache
def robot() -> collide.Robot:
    """Two links that slide along each other."""
    joint = Joint("slide", "prismatic", "base", "slider", lower=-1.0, upper=1.0)
    parts = {name: [LinkShape(collide.Sphere(0.1), EYE, None, "here")] for name in ("base", "slider")}
    return collide.Robot("rail", ["base", "slider"], [joint], parts, semantic_pairs=[])


@cache
def files() -> Path:
    """A folder with a robot in URDF and its SRDF, points and maps of cells."""
    folder = Path(tempfile.mkdtemp(prefix="collide-arguments-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    link = '<link name="{0}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    joint = '<joint name="slide" type="prismatic"><parent link="base"/><child link="slider"/><axis xyz="1 0 0"/>'
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    links = link.format("base") + link.format("slider")
    (folder / "rail.urdf").write_text(f'<robot name="rail">{links}{joint}{limit}</robot>')
    (folder / "rail.srdf").write_text(
        '<robot name="rail"><disable_collisions link1="a" link2="b" reason="Never"/></robot>'
    )
    (folder / "cloud.xyz").write_text("1 2 3\n4 5 6\n")
    collide.OcTree(([[0, 0, 0]], [0], [1.0]), 0.1).save(folder / "map.bt")
    collide.VoxelGrid([(0, 0, 0)], 0.1).save(folder / "grid.binvox")
    return folder


@cache
def spline() -> collide.Spline:
    return collide.Spline.straight([[0.0], [0.1]])


def checker() -> collide.RobotChecker:
    held = [("held", robot().links[-1], collide.Sphere(0.01))]
    return collide.RobotChecker(robot(), world(), attached=held)


def poses_of_worlds() -> np.ndarray:
    """(2, n, 4, 4) poses of all bodies of `world` in two worlds."""
    return np.tile(EYE, (2, len(world().ids), 1, 1))


def world() -> collide.World:
    made = collide.World()
    made.add(collide.Box((1, 1, 1)), name="a")
    made.add(collide.Sphere(1.0), collide.pose((1, 0, 0)), name="b")
    return made


def read_only() -> np.ndarray:
    made = np.full((4, 4), 2.0)
    made.flags.writeable = False
    return made


@cache
def tetrahedron() -> collide.TetMesh:
    return collide.TetMesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]])


@cache
def tree() -> polytopes.HierarchicalTree:
    return polytopes.HierarchicalTree(np.vstack([np.eye(3), -np.eye(3)]))


@cache
def planes() -> tuple[np.ndarray, np.ndarray]:
    return np.vstack([np.eye(3), -np.eye(3)]), np.ones(6)


@cache
def region() -> polytopes.HierarchicalTree:
    normals, offsets = planes()
    return polytopes.HierarchicalTree(normals=normals, offsets=offsets)


@cache
def partition() -> collide.SpacePartition:
    return collide.SpacePartition(mesh())


@cache
def point_message() -> dict:
    """A PointCloud2 of two points."""
    fields = [{"name": axis, "offset": 4 * k, "datatype": 7, "count": 1} for k, axis in enumerate("xyz")]
    return {
        "height": 1, "width": 2, "fields": fields, "is_bigendian": False, "point_step": 12, "row_step": 24,
        "data": bytes(24),
    }


def polygon() -> collide.ConvexPolygon:
    return collide.ConvexPolygon([(0, 0), (1, 0), (0, 1)])


def scene() -> scenes.Scene:
    made = scenes.Scene("made", [scenes.SceneBody("a", collide.Sphere(1), EYE)])
    made.place_robot(robot(), EYE)
    return made


BOX = collide.Box((1, 1, 1))
PAIR = {"A": BOX, "B": collide.Sphere(1.0), "X_WA": EYE, "X_WB": EYE}
#: Good arguments of functions and constructors, by the parameters that they need or that are worth a good one.
GOOD: dict[str, Callable[[], dict[str, Any]]] = {
    "Box": lambda: {"size": (1, 1, 1)},
    "Capsule": lambda: {"radius": 1, "length": 1},
    "Compound": lambda: {"items": [(BOX, EYE)]},
    "Cone": lambda: {"radius": 1, "length": 1},
    "ConvexHull": lambda: {"points": np.vstack([np.eye(3), np.zeros(3)])},
    "ConvexPolygon": lambda: {"points": np.eye(3)[:, :2]},
    "Cylinder": lambda: {"radius": 1, "length": 1},
    "DrawnConfigurations": lambda: {"rows": 5},
    "Ellipsoid": lambda: {"radii": (1, 1, 2)},
    "HPolytope": lambda: dict(zip(("normals", "offsets"), planes())),
    "Halfspace": lambda: {"normal": (0, 0, 1), "offset": 0},
    "HeightField": lambda: {"heights": np.eye(3), "cell": 1.0},
    "Mesh": lambda: {"vertices": mesh().vertices, "faces": mesh().faces},
    "OcTree": lambda: {"leaves": ([[0, 0, 0]], [0], [1.0]), "resolution": 0.1},
    "OcTreeLeaves": lambda: {"cell": [[0, 0, 0]], "exponent": [0], "log_odds": [1.0]},
    "Plane": lambda: {"normal": (0, 0, 1), "offset": 0},
    "PointCloud": lambda: {"points": np.eye(3)},
    "Robot": lambda: {"name": "r", "links": ["a"], "joints": []},
    "RobotChecker": lambda: {"robot": robot()},
    "enclosing_spheres": lambda: {"shape": collide.Box((1.0, 1.0, 1.0))},
    "impact_derivatives": lambda: {
        "A": BOX, "B": collide.Sphere(1.0), "X_WA0": EYE, "X_WA1": EYE, "X_WB0": collide.pose((3, 0, 0)), "X_WB1": EYE,
    },
    "nested_hulls": lambda: {"shape": collide.Box((1.0, 1.0, 1.0)), "sizes": [8, 16]},
    "audit_pieces": lambda: {"shape": collide.Box((1.0, 1.0, 1.0)), "pieces": collide.Box((1.0, 1.0, 1.1))},
    "plan": lambda: {
        "checker": collide.RobotChecker(robot(), allowed=[("base", "slider")]), "start": [0.0], "goal": [0.1],
    },
    "ShapeSet": lambda: {"shapes": [BOX]},
    "signed_distances": lambda: {"mesh": mesh(), "points": (0, 0, 0)},
    "SpacePartition": lambda: {"mesh": mesh()},
    "Sphere": lambda: {"radius": 1},
    "Spline": lambda: {"breaks": [0.0, 1.0], "control_points": [[[0.0], [1.0]]]},
    "SweptMesh": lambda: {"mesh": mesh(), "radius": 0.1},
    "TetMesh": lambda: {"vertices": tetrahedron().vertices, "cells": [[0, 1, 2, 3]]},
    "VoxelGrid": lambda: {"occupied": np.ones((2, 2, 2), dtype=bool), "cell": 0.1},
    "World": dict,
    "polytopes.HierarchicalTree": lambda: {"points": np.vstack([np.eye(3), -np.eye(3)])},
    "boolean": lambda: {**PAIR, "A": mesh(), "B": BOX, "op": "union"},
    "certify": lambda: {**PAIR, "r": collide.distance(**PAIR)},
    "collide": lambda: PAIR,
    "distance": lambda: PAIR,
    "smoothed_distances": lambda: {**PAIR, "angle": 0.1, "length": 0.01, "samples": 8},
    "WorldBatch": lambda: {"world": world()},
    "RobotBatch": lambda: {"checker": checker(), "moving": ["a"]},
    "to_library": lambda: {"values": np.eye(3), "like": "numpy"},
    "soft_minimum": lambda: {"distances": [0.1, 0.3], "gradients": [[1.0], [2.0]], "sharpness": 20.0},
    "contact_derivatives": lambda: PAIR,
    "contacts": lambda: PAIR,
    "walk": lambda: {**PAIR, "B": BOX},
    "combine": lambda: {"shapes": [mesh(), BOX], "poses": [EYE, EYE], "rule": "union"},
    "configuration_obstacle": lambda: {"A": BOX, "B": mesh()},
    "contains": lambda: {"shape": BOX, "X_WA": EYE, "points_W": (0, 0, 0)},
    "facet_pairs": lambda: {**PAIR, "A": mesh(), "B": BOX},
    "overlap_volume": lambda: {**PAIR, "A": mesh(), "B": BOX},
    "repaired": lambda: {"mesh": mesh()},
    "overlay": lambda: {**PAIR, "A": mesh(), "B": mesh()},
    "overlapping_cells": lambda: {**PAIR, "A": tetrahedron(), "B": tetrahedron()},
    "moved_poses": lambda: {"X_WA0": EYE, "velocity_WA": (1, 0, 0), "omega_WA": (0, 0, 0)},
    "poses_in_motion": lambda: {"X_WA0": EYE, "X_WA1": EYE, "time": 0.5},
    "propose_disabled_pairs": lambda: {"robot": robot(), "samples": 20, "rounds": 1},
    "raycast": lambda: {"shape": BOX, "X_WA": EYE, "origins_W": (0, 0, 5), "directions_W": (0, 0, -1)},
    "read_sweep": lambda: {"folder": "absent"},
    "self_collisions": lambda: {"mesh": mesh()},
    "self_overlapping_cells": lambda: {"mesh": tetrahedron()},
    "shape_cast": lambda: {"A": BOX, "X_WA": EYE, "direction_W": (1, 0, 0), "B": BOX, "X_WB": EYE},
    "sweep": lambda: {
        "checker": checker(),
        "configurations": np.zeros((2, 1)),
        "folder": "swept",
        "workers": 0,
        "restart": True,
    },
    "tessellate": lambda: {"shape": collide.Sphere(1), "tolerance": 0.1},
    "time_of_impact": lambda: {
        "A": BOX,
        "B": BOX,
        "X_WA0": EYE,
        "X_WA1": EYE,
        "X_WB0": collide.pose((3, 0, 0)),
        "X_WB1": EYE,
    },
    "verify": lambda: {**PAIR, "r": collide.distance(**PAIR)},
    "get_include": dict,
    "get_library": dict,
    "pose": dict,
    "poses": lambda: {"p": np.zeros((2, 3))},
    "polytopes.hull_boundary": lambda: {"body": tree()},
    "polytopes.meets": lambda: {"points": np.eye(3), "normals": planes()[0], "offsets": planes()[1]},
    "polytopes.planar_pose": dict,
    "scenes.shipped": dict,
    "scenes.path": lambda: {"name": "workcell"},
    "polytopes.polygon_distance": lambda: {"A": polygon(), "B": polygon(), "X_WA": np.eye(3), "X_WB": np.eye(3)},
    "polytopes.polygons_meet": lambda: {"A": polygon(), "B": polygon(), "X_WA": np.eye(3), "X_WB": np.eye(3)},
    "polytopes.trees_meet": lambda: {"A": tree(), "B": region()},
    "polytopes.verify": lambda: {
        "points": np.eye(3),
        "normals": planes()[0],
        "offsets": planes()[1],
        "answer": polytopes.meets(np.eye(3), *planes()),
    },
    "polytopes.verify_boundary": lambda: {
        "points": np.vstack([np.eye(3), -np.eye(3)]),
        "boundary": polytopes.hull_boundary(tree()),
    },
    "polytopes.verify_exclusion": lambda: {
        "boundary": polytopes.hull_boundary(tree()),
        "normals": planes()[0],
        "offsets": planes()[1],
        "answer": polytopes.trees_meet(tree(), region(), collide.pose((10, 0, 0))),
        "X_WP": collide.pose((10, 0, 0)),
    },
    "polytopes.verify_polygons": lambda: {
        "A": polygon(),
        "B": polygon(),
        "X_WA": np.eye(3),
        "X_WB": np.eye(3),
        "certificate": polytopes.polygons_meet(polygon(), polygon(), np.eye(3), np.eye(3)).certificate(),
    },
    "polytopes.verify_trees": lambda: {
        "points": np.vstack([np.eye(3), -np.eye(3)]),
        "normals": planes()[0],
        "offsets": planes()[1],
        "answer": polytopes.trees_meet(tree(), region()),
    },
    "scenes.allow_pairs": lambda: {"world": world(), "path": files() / "rail.srdf"},
    "scenes.generate": lambda: {"name": "clutter", "n": 3},
    **{
        f"scenes.generate: {name}": (lambda name=name: {"name": name})
        for name in ("accordions", "chazelle", "clutter", "harpsicordia", "stack", "workcell")
    },
    "scenes.load": lambda: {"path": "workcell"},
    "scenes.save": lambda: {"scene": scene(), "path": "s.json"},
    "scenes.Scene": lambda: {"name": "s"},
    "scenes.SceneBody": lambda: {"name": "a", "shape": BOX, "X_WB": EYE},
    "adapters.WorldViewer": lambda: {"world": world()},
    "adapters.view": lambda: {"world": world()},
    "families.describe": lambda: {"name": "touch_ee"},
    "families.generate": lambda: {"name": "touch_ee", "n": 1},
    "families.mesh_names": dict,
    "families.names": dict,
    "transforms.as_pose": lambda: {"X": EYE},
    "transforms.as_poses": lambda: {"X": EYE},
    "transforms.poses_as_given": lambda: {"X": EYE, "name": "X"},
}
#: Objects whose methods are tried: made by queries where users do not make them.
OBJECTS: dict[str, Callable[[], Any]] = {
    **{
        name: (lambda name=name: getattr(collide, name)(**GOOD[name]()))
        for name in (
            "Box",
            "Capsule",
            "Compound",
            "Cone",
            "ConvexHull",
            "ConvexPolygon",
            "Cylinder",
            "DrawnConfigurations",
            "Ellipsoid",
            "HPolytope",
            "Halfspace",
            "HeightField",
            "Mesh",
            "OcTree",
            "Plane",
            "PointCloud",
            "ShapeSet",
            "Sphere",
            "SweptMesh",
            "TetMesh",
            "VoxelGrid",
        )
    },
    "SignedDistanceGrid": lambda: collide.SignedDistanceGrid.from_arrays(np.zeros((2, 2, 2)), 1.0),
    "Robot": robot,
    "RobotChecker": checker,
    "Spline": spline,
    "World": world,
    "SpacePartition": partition,
    "ConvexCells": lambda: partition().convex_pieces(),
    "Contacts": lambda: collide.contacts(**PAIR),
    "PairDerivatives": lambda: collide.distance(**PAIR, derivatives=True),
    "PairResult": lambda: collide.distance(**PAIR),
    "RayHits": lambda: collide.raycast(**GOOD["raycast"]()),
    "WorldBatch": lambda: collide.WorldBatch(world()),
    "RobotBatch": lambda: collide.RobotBatch(checker(), ["a"]),
    "WorldBatchResult": lambda: collide.WorldBatch(world()).distances(poses_of_worlds()),
    "WorldResult": lambda: world().distances(),
    "WorldHits": lambda: world().raycast((0, 0, 5), (0, 0, -1)),
    "Proposal": lambda: collide.propose_disabled_pairs(**GOOD["propose_disabled_pairs"]()),
    "RobotDistances": lambda: checker().distances(np.zeros((2, 1))),
    "CertifiedEdges": lambda: checker().certify_edges(np.zeros((1, 1)), np.ones((1, 1))),
    "polytopes.HierarchicalTree": tree,
    "scenes.Scene": scene,
    "polytopes.PolygonHits": lambda: polytopes.polygons_meet(**GOOD["polytopes.polygons_meet"]()),
    "polytopes.PolygonDistances": lambda: polytopes.polygon_distance(**GOOD["polytopes.polygons_meet"]()),
}
METHODS: dict[str, Callable[[], dict[str, Any]]] = {
    "ConvexCells.corners": lambda: {"i": 0},
    "ConvexCells.hull": lambda: {"i": 0},
    "ConvexCells.planes": lambda: {"i": 0},
    "ConvexCells.rows_of": lambda: {"leaves": [0]},
    "DrawnConfigurations.block": lambda: {"start": 0, "stop": 2},
    "DrawnConfigurations.of": lambda: {"robot": robot()},
    "Box.rounded": lambda: {"size": (1, 1, 1), "radius": 0.1},
    "HPolytope.closed": lambda: {"size": 1.0},
    "HeightField.cells_of": lambda: {"facets": [0]},
    "HeightField.from_image": lambda: {"image": np.eye(3), "cell": 1.0},
    "OcTree.from_file": lambda: {"path": files() / "map.bt"},
    "OcTree.from_message": lambda: {
        "message": {"id": "OcTree", "resolution": 0.1, "binary": True, "data": [3, 0] * 15 + [2, 0]}
    },
    "OcTree.cells_of": lambda: {"parts": [0]},
    "OcTree.from_points": lambda: {"points": np.eye(3), "resolution": 0.1},
    "OcTree.from_rays": lambda: {"origins": (0, 0, 0), "points": np.eye(3), "resolution": 0.1},
    "Plane.closed": lambda: {"size": 1.0},
    "PointCloud.cropped": lambda: {"box": [(0, 0, 0), (1, 1, 1)]},
    "PointCloud.filtered": lambda: {"spacing": 0.1},
    "PointCloud.from_depth": lambda: {"depth": np.ones((2, 2)), "fx": 1.0, "fy": 1.0},
    "PointCloud.from_file": lambda: {"path": files() / "cloud.xyz"},
    "PointCloud.from_message": lambda: {"message": point_message()},
    "PointCloud.nearest": lambda: {"p": (0, 0, 0)},
    "PointCloud.updated": lambda: {"added": [(0, 0, 1)]},
    "PointCloud.within": lambda: {"p": (0, 0, 0), "r": 1.0},
    "SignedDistanceGrid.distances": lambda: {"points": (0, 0, 0)},
    "SignedDistanceGrid.from_arrays": lambda: {"values": np.zeros((2, 2, 2)), "cell": 1.0},
    "SignedDistanceGrid.from_mesh": lambda: {"mesh": mesh(), "cell": 0.5},
    "Proposal.pair": lambda: {"a": "base", "b": "slider"},
    "Robot.load": lambda: {"path": files() / "rail.urdf"},
    "Robot.configuration": lambda: {"values": {"slide": 0.1}},
    "Robot.joint_value": lambda: {"name": "slide", "q": [0.0]},
    "Robot.default_notes": lambda: {"names": ["slide"], "q": np.zeros(1)},
    "Robot.limit_notes": lambda: {"q": np.zeros(1)},
    "Robot.renamed": lambda: {"prefix": "p"},
    "RobotChecker.names_of": lambda: {"a": 0, "b": 1},
    "RobotChecker.point_jacobians": lambda: {"Q": [0.0], "bodies": [0], "points_W": [(0, 0, 0)]},
    "RobotChecker.self_filter": lambda: {"points": np.eye(3), "Q": [0.0]},
    "RobotChecker.from_scene": lambda: {"scene": scene()},
    "RobotChecker.attach": lambda: {"name": "cup", "link": robot().links[-1], "shape": collide.Sphere(0.01)},
    "RobotChecker.detach": lambda: {"name": "held"},
    "HeightField.inertia": lambda: {"density": 1.0},
    "Mesh.inertia": lambda: {"density": 1.0},
    "RobotChecker.allow": lambda: {"a": robot().links[-1], "b": "held"},
    "RobotChecker.certify_path": lambda: {"Q": [[0.0], [0.1]]},
    "RobotChecker.certify_spline": lambda: {"motion": spline()},
    "RobotChecker.certify_boxes": lambda: {"lo": [[0.0]], "hi": [[0.1]]},
    "Spline.straight": lambda: {"Q": [[0.0], [0.1]]},
    "Spline.min_jerk": lambda: {"Q": [[0.0], [0.1]]},
    "Spline.hermite": lambda: {"times": [0.0, 1.0], "Q": [[0.0], [0.1]], "velocities": [[0.0], [0.0]]},
    "Spline.bspline": lambda: {"knots": np.arange(8.0), "coefficients": np.zeros((4, 1))},
    "Spline.polynomials": lambda: {"breaks": [0.0, 1.0], "coefficients": np.zeros((3, 1, 1))},
    "Spline.bezier": lambda: {"control_points": [[0.0], [0.1]]},
    "Spline.of": lambda: {"motion": spline()},
    "Spline.beside": lambda: {"motion": spline()},
    "SpacePartition.locate": lambda: {"points": (0, 0, 0)},
    "SpacePartition.parts": lambda: {"pieces": partition().convex_pieces()},
    "SpacePartition.portals": lambda: {"cells": partition().convex_pieces()},
    "TetMesh.from_file": lambda: {"path": "absent.msh"},
    "VoxelGrid.from_file": lambda: {"path": files() / "grid.binvox"},
    "VoxelGrid.cells_of": lambda: {"parts": [0]},
    "VoxelGrid.from_points": lambda: {"points": np.eye(3), "cell": 0.1},
    "World.allow": lambda: {"a": "a", "b": "b"},
    "World.add": lambda: {"shape": BOX},
    "World.add_many": lambda: {"shapes": [BOX, BOX], "X_WBs": np.stack([EYE, EYE])},
    "World.body": lambda: {"body": "a"},
    "World.boxes_near": lambda: {"low_W": (0, 0, 0), "high_W": (1, 1, 1)},
    "World.nearest": lambda: {"points_W": (0, 0, 2)},
    "World.query": lambda: {"shape": BOX, "X_WS": EYE},
    "World.raycast": lambda: {"origins_W": (0, 0, 5), "directions_W": (0, 0, -1)},
    "World.remove": lambda: {"body": "a"},
    "World.replace": lambda: {"body": "a", "shape": BOX},
    "World.set_margin": lambda: {"body": "a", "margin": 0.1},
    "World.set_pose": lambda: {"body": "a", "X_WB": EYE},
    "World.set_poses": lambda: {"bodies": ["a"], "X_WBs": [EYE]},
    "World.shape_cast": lambda: {"shape": BOX, "X_WS": EYE, "direction_W": (1, 0, 0)},
    "World.sleep": lambda: {"bodies": ["a"]},
    "World.wake": lambda: {"bodies": ["a"]},
    "RobotBatch.collides": lambda: {"Q": [0.0], "X_WBs": [[EYE], [EYE]]},
    "RobotBatch.distances": lambda: {"Q": [0.0], "X_WBs": [[EYE], [EYE]]},
    "WorldBatch.collides": lambda: {"X_WBs": poses_of_worlds()},
    "WorldBatch.distances": lambda: {"X_WBs": poses_of_worlds()},
    "WorldBatch.minimum": lambda: {"X_WBs": poses_of_worlds()},
    "WorldResult.pair": lambda: {"k": 0},
    **{f"{result}.to": lambda: {"like": "numpy"} for result in (
        "PairDerivatives", "PairResult", "WorldBatchResult", "WorldResult"
    )},
    "scenes.Scene.add": lambda: {"body": scenes.SceneBody("n", BOX, EYE)},
    "scenes.Scene.body": lambda: {"name": "a"},
    "scenes.Scene.joint_shares": lambda: {"values": {"slide": 0.0}},
    "scenes.Scene.with_state": lambda: {"state": {"slide": 0.0}},
    "scenes.Scene.place_robot": lambda: {"robot": robot().renamed("second"), "X_WR": EYE, "name": "second"},
    "scenes.Scene.carry": lambda: {
        "owner": "rail",
        "link": "slider",
        "body": scenes.SceneBody("n", BOX, EYE),
        "X_LB": EYE,
    },
}
#: Of methods that many classes have.
_OF_ANY = {
    "save": {"path": "saved.npz"},
    "load": {"path": "absent.npz"},
    "scaled": {"factors": 2.0},
    "collides": {"Q": [[0.0]]},
    "distances": {"Q": [[0.0]]},
    "certify_edges": {"Q0": [[0.0]], "Q1": [[0.1]]},
    "edge_collides": {"Q0": [[0.0]], "Q1": [[0.1]]},
    "explain": {"q": [0.0]},
    "link_poses": {"q": [0.0]},
    "within_limits": {"q": [0.0], "Q": [[0.0]]},
    "checked_configurations": {"q": [0.0]},
}
#: Public names whose arguments are not tried, and why.
EXCUSED = {
    "adapters.to_foxglove": "needs Foxglove's SDK: tests/adapters/viewers",
    "adapters.to_rerun": "needs rerun: tests/adapters/viewers",
    "adapters.to_viser": "needs viser: tests/adapters/viewers",
    "Shape": "the base of shapes: it has no arguments",
    "SignedDistanceGrid": "made by its class methods",
    "Shape.scaled": "asked of every shape",
    "transforms.refuse_no_pose": "only ever raises, of what a check found",
    "transforms.rotation_from_rpy": "its numbers are checked by `pose` and `poses`",
    "transforms.rotation_from_degrees": "as rotation_from_rpy",
    "transforms.refuse_degrees": "as rotation_from_rpy",
    "transforms.rotation_from_unit": "as rotation_from_rpy",
    "transforms.inverse_pose": "of poses that loaders and hosts have made",
    "How": "an enumeration of Python's own",
    "WorldResult": "made by World's queries",
    "WorldBatchResult": "made by WorldBatch's queries",
    "transforms.unchecked_poses": "for kernels, which check what it reads",
    "WorldHits": "made by World's queries",
    "PairDerivatives": "made by queries",
    "ContactDerivatives": "a tuple, made by queries",
    "ImpactDerivatives": "a tuple, made by queries",
    "NestedHull": "a tuple, made by queries",
    "PairResult": "made by queries",
    "Uniqueness": "an enumeration of Python's own",
    "Contacts": "made by queries",
    "RayHits": "a tuple, made by queries",
    "ConvexCells": "made by SpacePartition",
    "CertifiedBoxes": "made by RobotChecker",
    "CertifiedEdges": "made by RobotChecker",
    "CertifiedMotion": "made by RobotChecker",
    "MotionPlan": "made by plan",
    "RobotDistances": "made by RobotChecker",
    "LinkPair": "made by Proposal",
    "Proposal": "made by propose_disabled_pairs",
    "SweepResults": "made by sweep; its table needs pyarrow",
    "polytopes.PolygonHits": "made by polygons_meet",
    "polytopes.PolygonDistances": "made by polygon_distance",
    "polytopes.Meeting": "made by meets",
    "polytopes.TreeMeeting": "made by trees_meet",
    "scenes.Scene": "plain data",
    "scenes.SceneBody": "plain data, looked at where it is added",
    "SweepResults.table": "made by sweep: tests/sweeps asks it for wrong columns",
    "RobotChecker.in_pieces": "for methods of the class: it takes their functions",
    "World.changes": "it has no arguments",
    "adapters.WorldViewer.close": "it has no arguments",
    "adapters.WorldViewer.update": "of a page that is open: tests/adapters/live asks it",
    "families.Body": "plain data", "families.Case": "plain data", "families.MeshCase": "plain data",
    "transforms.HasMatrix": "a description for type checkers",
}
#: Parameters that are called, or are the library's own: code of a caller may raise what it likes.
#: Errors that are about no argument: what a certificate fails to prove, and what is not installed.
VERDICTS = (collide.CertificateRefused, collide.MissingExtra)
#: Parameters that name files: messages about a file are about its path as it is given.
FILES = {"path", "folder", "srdf", "package_path", "state"}
#: Where the argument is fine and what is wrong stands within: what the message names instead.
SAID_OTHERWISE = {
    ("scenes.Scene.place_robot", "robot"): "the link that is in the scene already",
    ("World.add_many", "shapes"): "of none at all, how many there are",
    ("scenes.allow_pairs", "world"): "the file, which names none of its bodies",
    ("polytopes.HierarchicalTree", "points"): "that the body is flat, or has another dimension than there are trees of",
}
CALLBACKS = {"browser", "progress", "scheduler", "options", "limits", "size", "how"}


# --- what is tried ------------------------------------------------------------------------------


class Target:
    """A callable with good arguments. name : as in GOOD and METHODS.   call : gives it; methods bind to an object."""

    def __init__(self, name: str, call: Callable[[], Callable], good: Callable[[], dict[str, Any]], parameters=None):
        self.name, self.call, self.good = name, call, good
        self.parameters = [
            parameter
            for parameter in parameters or inspect.signature(call()).parameters.values()
            if parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
        ]


def public_names() -> Iterator[tuple[str, Any]]:
    """(name, object) of every public name that can be called, once: "Box", "polytopes.meets"."""
    seen = set()
    for module in MODULES:
        own = [name for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__]
        for name in getattr(module, "__all__", [name for name in own if not name.startswith("_")]):
            value = getattr(module, name)
            if callable(value) and id(value) not in seen:
                seen.add(id(value))
                yield (name if module is collide else f"{module.__name__.split('.')[-1]}.{name}"), value


def targets() -> tuple[list[Target], list[str]]:
    """What is tried, and the names for which no good arguments are known."""
    tried, unknown = [], []
    for name, value in public_names():
        if inspect.isclass(value):
            if issubclass(value, BaseException):
                continue  # raised, not called
            is_tuple = issubclass(value, tuple)  # plain data of answers
            if name in GOOD and name not in EXCUSED:
                tried.append(Target(name, lambda value=value: value, GOOD[name]))
            elif name not in EXCUSED and not is_tuple:
                unknown.append(name)
            tried += _methods(name, value, unknown) if not is_tuple and name not in ("How", "Uniqueness") else []
        elif name in GOOD:
            tried.append(Target(name, lambda value=value: value, GOOD[name]))
        elif name not in EXCUSED:
            unknown.append(name)
    for name, good in GOOD.items():
        if name.startswith("scenes.generate: "):  # each with sizes of its own
            sizes = inspect.signature(generators._GENERATORS[name.split()[-1]]).parameters.values()
            own = [size for size in sizes if size.name != "rng"]
            tried.append(Target(name, lambda: scenes.generate, good, own))
    return tried, unknown


def _methods(name: str, kind: type, unknown: list[str]) -> Iterator[Target]:
    for method in sorted(dir(kind)):
        static = inspect.getattr_static(kind, method)
        full = f"{name}.{method}"
        if method.startswith("_") or not callable(getattr(kind, method)) or isinstance(static, type) or full in EXCUSED:
            continue
        needs = [p for p in inspect.signature(getattr(kind, method)).parameters.values() if p.name != "self"]
        good = METHODS.get(full)
        if good is None:
            known = _OF_ANY.get(method, {})
            good = lambda known=known, needs=needs: {p.name: known[p.name] for p in needs if p.name in known}
            if any(
                p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and p.name not in known
                for p in needs
            ):
                unknown.append(full)
                continue
        if name not in OBJECTS and not isinstance(static, (classmethod, staticmethod)):
            if needs or name not in EXCUSED:
                unknown.append(full)
            continue
        make = OBJECTS.get(name, lambda kind=kind: kind)
        yield Target(full, lambda make=make, method=method: getattr(make(), method), good)


# --- trying ---------------------------------------------------------------------------------------


def cases(seed: int | None = None, each: int = 4, only: str = "") -> list[tuple[Target, str, str]]:
    """(target, parameter, name of the bad value): all values of every parameter, or ``each`` of them, seeded."""
    rng = random.Random(seed)
    return [
        (target, parameter.name, bad)
        for target in targets()[0]
        if only in target.name
        for parameter in target.parameters
        if parameter.name not in CALLBACKS or target.name == "tessellate"
        for bad in (BAD if seed is None else rng.sample(list(BAD), each))
    ]


def snippet(target: Target, parameter: str, bad: str) -> str:
    return f"{target.name}({parameter}={BAD[bad]})"


def complaint(target: Target, parameter: str, bad: str) -> tuple[str, str | None]:
    """(what happened: "taken", "refused" or "wrong"; what is wrong with that)."""
    import math

    call, arguments = target.call(), dict(target.good())
    value = eval(
        BAD[bad],
        {
            "np": np,
            "collide": collide,
            "Fraction": Fraction,
            "Decimal": Decimal,
            "math": math,
            "fuzzer": SimpleNamespace(mesh=mesh, robot=robot, read_only=read_only),
        },
    )
    arguments[parameter] = value
    positional = [
        arguments.pop(p.name) for p in target.parameters if p.kind is p.POSITIONAL_ONLY and p.name in arguments
    ]
    try:
        with limited(), warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            answer = call(*positional, **arguments)
            if isinstance(answer, adapters.WorldViewer):
                answer.close()
    except collide.CollideError as error:
        text = str(error)
        if len(text) > 5000:
            return "wrong", f"a message of {len(text)} characters"
        if isinstance(error, VERDICTS) or (target.name, parameter) in SAID_OTHERWISE:
            return "refused", None
        missing = unsaid(text, "" if isinstance(error, collide.UnsupportedQuery) else parameter, value)
        return ("refused", None) if missing is None else ("wrong", f"{missing}: {text}")
    except IndexError as error:  # as of sequences, and documented
        return ("refused", None) if target.name == "WorldResult.pair" else ("wrong", str(error))
    except OSError as error:
        # what the system says of a file that was named stays the system's
        return (
            ("refused", None)
            if error.filename is not None or parameter in ("path", "folder")
            else ("wrong", repr(error))
        )
    except TookTooLong:
        return "wrong", f"took more than {LIMIT} s"
    except Exception as error:  # noqa: BLE001 - that is what is looked for
        try:
            return "wrong", f"{type(error).__name__}: {str(error)[:200]}"
        except ValueError:  # an integer that Python does not write out
            return "wrong", type(error).__name__
    return "taken", None


def unsaid(text: str, parameter: str, value: Any) -> str | None:
    """What a message does not say: the argument's name, or the value."""
    if parameter not in FILES and not re.search(rf"(?<!\w){re.escape(parameter)}(?!\w)", text):
        return "the argument is not named"
    if not any(re.search(rf"(?<!\w){re.escape(word)}(?!\w)", text) for word in words_of(value) if word):
        return "the value is not shown"
    return None


def words_of(value: Any) -> list[str]:
    """How a message may show a value: as it is written, by its type, its shape or its kind; of many, by an entry."""
    words = [brief(value), brief([value])[1:-1], written(value)[:20].rstrip(), type(value).__name__]
    with contextlib.suppress(ValueError):
        words.append(str(np.shape(value)))
    if isinstance(value, np.ma.MaskedArray) and value.ndim:
        words.append("masked")
    if isinstance(value, (np.ndarray, list)):
        with contextlib.suppress(ValueError, OverflowError):
            read = np.asarray(value)
            words += [_KINDS.get(read.dtype.kind, ""), str(read.dtype), str(read.shape[1:])]
            words += [f"(n, {read.shape[-1]})"] if read.ndim > 1 else []
            words += [str(len(read))] if read.ndim > 2 else []  # of a batch how many there are
    elif isinstance(value, str):
        words += [value, str(Path(value))]
    elif (number := float_of(value)) is not None:
        words += [str(number), f"{number:g}"]
    if (isinstance(value, np.ndarray) and not value.size) or (isinstance(value, (list, tuple, dict)) and not value):
        words += ["empty", "()", "[]"]
    for entry in [] if value is np.ma.masked else entries_of(value)[:24]:
        words += words_of(entry)
    return words


def entries_of(value: Any) -> list:
    """What stands in a value, one level down."""
    if isinstance(value, np.ndarray):
        return list(value.ravel()) if value.ndim else [value.item()]
    if isinstance(value, GeneratorType):
        return [0, 1, 2]  # read already
    if isinstance(value, dict) and value:
        return [part for item in value.items() for part in item]
    if isinstance(value, str):
        return list(value) if len(value) > 1 else []
    return list(value) if isinstance(value, (list, tuple, set, range, memoryview, bytes, np.void)) else []


def written(value: Any) -> str:
    try:
        return repr(value)
    except Exception:  # noqa: BLE001 - an integer that Python does not write out
        return brief(value)


class TookTooLong(BaseException):
    """No `Exception`: nothing on the way may take it for one of its own."""


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """At most `LIMIT` seconds, where the platform has alarms and this is the main thread."""
    if not hasattr(signal, "SIGALRM"):
        yield
        return

    def stop(*_):
        raise TookTooLong

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def run(
    chosen: list[tuple[Target, str, str]], say: Callable[[str], None] = lambda text: None
) -> tuple[dict[str, int], list[str]]:
    """(how often each thing happened, complaints as snippets), in a folder of its own."""
    counts = {"taken": 0, "refused": 0, "wrong": 0}
    complaints = []
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for target, parameter, bad in chosen:
                what, why = complaint(target, parameter, bad)
                counts[what] += 1
                if why:
                    complaints.append(f"{snippet(target, parameter, bad)}  # {why}")
                    say(complaints[-1])
        finally:
            os.chdir(here)
    return counts, complaints


def main(words: list[str]) -> int:
    tried, unknown = targets()
    for name in unknown:
        print("no good arguments known:", name)
    chosen = cases(only=words[0] if words else "")
    print(f"{len(tried)} callables, {len(chosen)} calls", flush=True)
    counts, complaints = run(chosen, lambda text: print(text, flush=True))
    print(counts)
    return 1 if complaints or unknown else 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    sys.exit(main(sys.argv[1:]))
