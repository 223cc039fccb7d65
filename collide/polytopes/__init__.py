"""Convex sets given by points and by half-spaces: exact answers in the plane, in space and up to d = 8."""

from collide.polytopes.convex_polygon import ConvexPolygon, planar_pose
from collide.polytopes.exclusion import Exclusion, HullBoundary, hull_boundary
from collide.polytopes.hierarchical_tree import HierarchicalTree
from collide.polytopes.meeting import Meeting, MeetingCertificate
from collide.polytopes.meets_query import meets
from collide.polytopes.planar_certificates import PlanarCertificate, verify_polygons
from collide.polytopes.planar_pairs import PolygonDistances, PolygonHits, polygon_distance, polygons_meet
from collide.polytopes.tree_size import TreeSize
from collide.polytopes.trees_meet_query import TreeMeeting, trees_meet
from collide.polytopes.verify_exclusion import verify_boundary, verify_exclusion
from collide.polytopes.verify_meeting import verify
from collide.polytopes.verify_trees import verify_trees

__all__ = [
    "ConvexPolygon", "Exclusion", "HierarchicalTree", "HullBoundary", "Meeting", "MeetingCertificate",
    "PlanarCertificate", "PolygonDistances", "PolygonHits", "TreeMeeting", "TreeSize", "hull_boundary", "meets",
    "planar_pose", "polygon_distance", "polygons_meet", "trees_meet", "verify", "verify_boundary", "verify_exclusion",
    "verify_polygons", "verify_trees",
]
