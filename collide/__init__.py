"""collide: collision detection for robotics whose answers carry proofs.

    import collide
    r = collide.distance(collide.Box((1, 1, 1)), collide.Sphere(0.5), X_WA, X_WB)
    r.distance, r.normal, r.point_a, r.point_b, r.lower, r.upper, r.certified

Shapes, pair queries and `World` are documented in docs/conventions.md; `collide --help` shows
the command line. Names below load when first used, so that importing collide costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collide import errors as errors
    from collide import polytopes as polytopes
    from collide import results as results
    from collide import transforms as transforms
    from collide.base.array_libraries import to_library
    from collide.casts.ray_hits import RayHits
    from collide.casts.raycast import raycast
    from collide.casts.shape_cast import ShapeCasts, shape_cast
    from collide.certificates.certificate import Certificate, CertificateRefused
    from collide.certificates.make_certificate import certify
    from collide.certificates.verify import verify
    from collide.contact.contact_derivatives import ContactDerivatives, contact_derivatives
    from collide.contact.contact_query import contacts
    from collide.contact.contact_rows import Contacts
    from collide.derivatives.pair_derivatives import PairDerivatives
    from collide.derivatives.soft_minimum import SoftMinimum, soft_minimum
    from collide.derivatives.uniqueness import Uniqueness
    from collide.errors import (
        CollideError,
        InvalidArgument,
        InvalidPose,
        InvalidShape,
        MissingExtra,
        SceneError,
        UnknownBody,
        UnsupportedQuery,
    )
    from collide.hull_levels.nested_hulls import NestedHull, nested_hulls
    from collide.kernels.library import include_folder as get_include
    from collide.kernels.library import library_path as get_library
    from collide.motion.impact_derivatives import ImpactDerivatives, impact_derivatives
    from collide.motion.impact_query import moved_poses, poses_in_motion, time_of_impact
    from collide.motion.impact_rows import TimeOfImpact
    from collide.pairs.query import collide, distance
    from collide.pairs.smoothed_distances import SmoothedDistances, smoothed_distances
    from collide.papers.hierarchies.hierarchy_queries import walk
    from collide.papers.partitions.cell_records import CellPlanes, ConvexCells
    from collide.papers.partitions.convex_parts import ConvexParts
    from collide.papers.partitions.portals import Portals
    from collide.papers.partitions.space_partition import Located, PartitionSize, SpacePartition
    from collide.papers.polytopes.convex_polygon import ConvexPolygon
    from collide.papers.tetrahedra.cell_overlaps import CellOverlaps, overlapping_cells, self_overlapping_cells
    from collide.papers.tetrahedra.tet_mesh import TetMesh
    from collide.pose_arrays import poses
    from collide.results import How, PairResult, WorldResult
    from collide.robots.certified_boxes import CertifiedBoxes
    from collide.robots.certified_edges import CertifiedEdges
    from collide.robots.certified_motions import CertifiedMotion
    from collide.robots.motion_plan import MotionPlan, plan
    from collide.robots.robot import Robot
    from collide.robots.robot_batch import RobotBatch
    from collide.robots.robot_checker import RobotChecker
    from collide.robots.robot_distances import RobotDistances
    from collide.robots.splines import Spline
    from collide.shapes import (
        Box,
        Capsule,
        Compound,
        Cone,
        ConvexHull,
        Cylinder,
        Ellipsoid,
        Halfspace,
        HeightField,
        HPolytope,
        Mesh,
        OcTree,
        OcTreeLeaves,
        Plane,
        PointCloud,
        Shape,
        ShapeSet,
        Sphere,
        SweptMesh,
        VoxelGrid,
    )
    from collide.shapes.tessellation import tessellate
    from collide.solids.boolean import BooleanResult, boolean
    from collide.solids.combine import combine
    from collide.solids.configuration_obstacle import ConfigurationObstacle, configuration_obstacle
    from collide.solids.overlap_volume import OverlapVolume, overlap_volume
    from collide.solids.planar_obstacle import PlanarObstacle
    from collide.solids.repair import RepairedMesh, repaired
    from collide.spheres.enclosing_spheres import EnclosingSpheres, enclosing_spheres
    from collide.spheres.facets_outside import PieceAudit
    from collide.spheres.piece_audit import audit_pieces
    from collide.surface_queries.contains import contains
    from collide.surface_queries.facet_pairs import FacetPairs, SelfCollisions, facet_pairs, self_collisions
    from collide.surface_queries.overlay import Overlay, overlay
    from collide.surface_queries.signed_distance_grid import GridDistances, SignedDistanceGrid
    from collide.surface_queries.signed_distances import SignedDistances, signed_distances
    from collide.sweeps.configurations import DrawnConfigurations
    from collide.sweeps.pair_proposal import LinkPair, Proposal, propose_disabled_pairs
    from collide.sweeps.sweep import sweep
    from collide.sweeps.sweep_results import SweepResults, read_sweep
    from collide.transforms import pose
    from collide.worlds.hits import WorldHits
    from collide.worlds.world import World
    from collide.worlds.world_batch import WorldBatch, WorldBatchResult

__version__ = "0.1.0"

_HOMES = {
    "collide.errors": (
        "CollideError", "InvalidArgument", "InvalidPose", "InvalidShape", "MissingExtra", "SceneError",
        "UnknownBody", "UnsupportedQuery",
    ),
    "collide.base.array_libraries": ("to_library",),
    "collide.casts.ray_hits": ("RayHits",),
    "collide.casts.raycast": ("raycast",),
    "collide.casts.shape_cast": ("ShapeCasts", "shape_cast"),
    "collide.certificates.certificate": ("Certificate", "CertificateRefused"),
    "collide.certificates.make_certificate": ("certify",),
    "collide.certificates.verify": ("verify",),
    "collide.contact.contact_derivatives": ("ContactDerivatives", "contact_derivatives"),
    "collide.contact.contact_query": ("contacts",),
    "collide.contact.contact_rows": ("Contacts",),
    "collide.spheres.enclosing_spheres": ("EnclosingSpheres", "enclosing_spheres"),
    "collide.spheres.facets_outside": ("PieceAudit",),
    "collide.spheres.piece_audit": ("audit_pieces",),
    "collide.surface_queries.contains": ("contains",),
    "collide.surface_queries.overlay": ("Overlay", "overlay"),
    "collide.surface_queries.signed_distance_grid": ("GridDistances", "SignedDistanceGrid"),
    "collide.surface_queries.signed_distances": ("SignedDistances", "signed_distances"),
    "collide.surface_queries.facet_pairs": ("FacetPairs", "SelfCollisions", "facet_pairs", "self_collisions"),
    "collide.papers.hierarchies.hierarchy_queries": ("walk",),
    "collide.motion.impact_derivatives": ("ImpactDerivatives", "impact_derivatives"),
    "collide.motion.impact_query": ("moved_poses", "poses_in_motion", "time_of_impact"),
    "collide.motion.impact_rows": ("TimeOfImpact",),
    "collide.papers.polytopes.convex_polygon": ("ConvexPolygon",),
    "collide.papers.partitions.cell_records": ("CellPlanes", "ConvexCells"),
    "collide.papers.partitions.convex_parts": ("ConvexParts",),
    "collide.papers.partitions.portals": ("Portals",),
    "collide.papers.partitions.space_partition": ("Located", "PartitionSize", "SpacePartition"),
    "collide.derivatives.pair_derivatives": ("PairDerivatives",),
    "collide.derivatives.soft_minimum": ("SoftMinimum", "soft_minimum"),
    "collide.derivatives.uniqueness": ("Uniqueness",),
    "collide.hull_levels.nested_hulls": ("NestedHull", "nested_hulls"),
    "collide.pairs.query": ("collide", "distance"),
    "collide.pairs.smoothed_distances": ("SmoothedDistances", "smoothed_distances"),
    "collide.pose_arrays": ("poses",),
    "collide.results": ("How", "PairResult", "WorldResult"),
    "collide.robots.certified_boxes": ("CertifiedBoxes",),
    "collide.robots.certified_edges": ("CertifiedEdges",),
    "collide.robots.certified_motions": ("CertifiedMotion",),
    "collide.robots.motion_plan": ("MotionPlan", "plan"),
    "collide.robots.robot": ("Robot",),
    "collide.robots.robot_batch": ("RobotBatch",),
    "collide.robots.robot_checker": ("RobotChecker",),
    "collide.robots.robot_distances": ("RobotDistances",),
    "collide.robots.splines": ("Spline",),
    "collide.shapes": (
        "Box", "Capsule", "Compound", "Cone", "ConvexHull", "Cylinder", "Ellipsoid", "HPolytope",
        "Halfspace", "HeightField", "Mesh", "OcTree", "OcTreeLeaves", "Plane", "PointCloud", "Shape", "ShapeSet",
        "Sphere", "SweptMesh", "VoxelGrid",
    ),
    "collide.shapes.tessellation": ("tessellate",),
    "collide.solids.boolean": ("BooleanResult", "boolean"),
    "collide.solids.combine": ("combine",),
    "collide.solids.configuration_obstacle": ("ConfigurationObstacle", "configuration_obstacle"),
    "collide.solids.overlap_volume": ("OverlapVolume", "overlap_volume"),
    "collide.solids.planar_obstacle": ("PlanarObstacle",),
    "collide.solids.repair": ("RepairedMesh", "repaired"),
    "collide.sweeps.configurations": ("DrawnConfigurations",),
    "collide.sweeps.pair_proposal": ("LinkPair", "Proposal", "propose_disabled_pairs"),
    "collide.sweeps.sweep": ("sweep",),
    "collide.sweeps.sweep_results": ("SweepResults", "read_sweep"),
    "collide.papers.tetrahedra.cell_overlaps": ("CellOverlaps", "overlapping_cells", "self_overlapping_cells"),
    "collide.papers.tetrahedra.tet_mesh": ("TetMesh",),
    "collide.transforms": ("pose",),
    "collide.worlds.world": ("World",),
    "collide.worlds.world_batch": ("WorldBatch", "WorldBatchResult"),
    "collide.worlds.hits": ("WorldHits",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

#: Public functions under other names than those of the modules that have them.
_RENAMED = {
    "get_include": ("collide.kernels.library", "include_folder"),
    "get_library": ("collide.kernels.library", "library_path"),
}

__all__ = [
    "BooleanResult", "Box", "Capsule", "CellOverlaps", "CellPlanes", "Certificate", "CertificateRefused",
    "CertifiedBoxes", "CertifiedEdges", "CertifiedMotion", "CollideError", "Compound", "Cone", "ConfigurationObstacle",
    "ContactDerivatives", "Contacts", "ConvexCells", "ConvexHull", "ConvexParts", "ConvexPolygon", "Cylinder",
    "DrawnConfigurations", "Ellipsoid", "EnclosingSpheres", "FacetPairs", "GridDistances", "HPolytope", "Halfspace",
    "HeightField", "How", "ImpactDerivatives", "InvalidArgument", "InvalidPose", "InvalidShape", "LinkPair",
    "Located", "Mesh", "MissingExtra", "MotionPlan", "NestedHull", "OcTree", "OcTreeLeaves", "OverlapVolume",
    "Overlay", "PairDerivatives", "PairResult", "PartitionSize", "PieceAudit", "PlanarObstacle", "Plane",
    "PointCloud", "Portals", "Proposal", "RayHits", "RepairedMesh", "Robot", "RobotBatch", "RobotChecker",
    "RobotDistances", "SceneError", "SelfCollisions",
    "Shape", "ShapeCasts", "ShapeSet", "SignedDistanceGrid", "SignedDistances", "SmoothedDistances", "SoftMinimum",
    "SpacePartition", "Sphere", "Spline", "SweepResults", "SweptMesh", "TetMesh", "TimeOfImpact", "Uniqueness",
    "UnknownBody", "UnsupportedQuery", "VoxelGrid", "World", "WorldBatch", "WorldBatchResult", "WorldHits",
    "WorldResult", "audit_pieces", "boolean", "certify", "collide", "combine", "configuration_obstacle",
    "contact_derivatives", "contacts", "contains", "distance", "enclosing_spheres", "facet_pairs", "get_include",
    "get_library", "impact_derivatives", "moved_poses", "nested_hulls", "overlap_volume", "overlapping_cells",
    "overlay", "plan", "pose", "poses", "poses_in_motion", "propose_disabled_pairs", "raycast", "read_sweep",
    "repaired", "self_collisions", "self_overlapping_cells", "shape_cast", "signed_distances", "smoothed_distances",
    "soft_minimum", "sweep", "tessellate", "time_of_impact", "to_library", "verify", "walk",
]


#: Modules that are reached by name alone: ``collide.results.HOW``, ``collide.scenes.load``.
_MODULES = ("adapters", "errors", "polytopes", "results", "scenes", "transforms")

if not TYPE_CHECKING:  # checkers are to know the names above, and no others

    def __getattr__(name: str):
        if name in _MODULES:
            return import_module(f"collide.{name}")
        if name not in _HOME and name not in _RENAMED:
            advice = "" if name.startswith("__") else _advice_on(name)
            raise AttributeError(f"module 'collide' has no attribute {name!r}{advice}")
        module, attribute = _RENAMED.get(name) or (_HOME[name], name)
        value = getattr(import_module(module), attribute)
        globals()[name] = value
        return value


def _advice_on(name: str) -> str:
    """What to write in place of a name of another library, or of one spelt wrongly."""
    return import_module("collide.base.foreign_names").advice_on_name(name, (*__all__, *_MODULES))


def __dir__():
    return sorted({*globals(), *__all__})
