"""Convex sets given by points and by half-spaces: exact answers in the plane, in space and up to d = 8."""

from collide.papers.polytopes.convex_polygon import ConvexPolygon, planar_pose
from collide.papers.polytopes.exclusion import Exclusion, HullBoundary, hull_boundary
from collide.papers.polytopes.hierarchical_tree import HierarchicalTree
from collide.papers.polytopes.meeting import Meeting, MeetingCertificate
from collide.papers.polytopes.meets_query import meets
from collide.papers.polytopes.planar_certificates import PlanarCertificate, verify_polygons
from collide.papers.polytopes.planar_pairs import PolygonDistances, PolygonHits, polygon_distance, polygons_meet
from collide.papers.polytopes.tree_size import TreeSize
from collide.papers.polytopes.trees_meet_query import TreeMeeting, trees_meet
from collide.papers.polytopes.verify_exclusion import verify_boundary, verify_exclusion
from collide.papers.polytopes.verify_meeting import verify
from collide.papers.polytopes.verify_trees import verify_trees

__all__ = [
    "ConvexPolygon", "Exclusion", "HierarchicalTree", "HullBoundary", "Meeting", "MeetingCertificate",
    "PlanarCertificate", "PolygonDistances", "PolygonHits", "TreeMeeting", "TreeSize", "hull_boundary", "meets",
    "planar_pose", "polygon_distance", "polygons_meet", "trees_meet", "verify", "verify_boundary", "verify_exclusion",
    "verify_polygons", "verify_trees",
]
