"""Convex sets given by points and by half-spaces: exact answers in the plane, in space and up to d = 8."""

from collide.polytopes.convex_polygon import ConvexPolygon, planar_pose
from collide.polytopes.meeting import Meeting, MeetingCertificate
from collide.polytopes.meets_query import meets
from collide.polytopes.planar_certificates import PlanarCertificate, verify_polygons
from collide.polytopes.planar_pairs import PolygonDistances, PolygonHits, polygon_distance, polygons_meet
from collide.polytopes.verify_meeting import verify

__all__ = [
    "ConvexPolygon", "Meeting", "MeetingCertificate", "PlanarCertificate", "PolygonDistances", "PolygonHits", "meets",
    "planar_pose", "polygon_distance", "polygons_meet", "verify", "verify_polygons",
]  # fmt: skip
