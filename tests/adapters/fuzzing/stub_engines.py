"""Engines with planted errors: right on everything else, since they ask collide."""

from __future__ import annotations

import math
import os
import time

import collide
from collide import Box, Cone, Ellipsoid, Sphere
from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer


class Honest(PairwisePeer):
    """collide's own answers."""

    name = "stub"

    def build(self, part):
        return part

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        r = collide.distance(A, B, X_WA, X_WB)
        return Reply(bool(r.hit), float(r.distance))


class LargeBoxes(Honest):
    """Calls apart whatever has a box with a side above 2, and is right about the distance."""

    name = "large_boxes"

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        reply = super().ask(A, X_WA, B, X_WB)
        large = any(isinstance(part, Box) and part.size.max() > 2.0 for part in (A, B))
        return reply._replace(hit=False, distance=None) if large else reply


class ConesAbort(Honest):
    """Ends its process when it builds a cone."""

    name = "cones_abort"

    def build(self, part):
        if isinstance(part, Cone):
            os.abort()
        return part


class EllipsoidsHang(Honest):
    """Never answers about an ellipsoid."""

    name = "ellipsoids_hang"

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        if isinstance(A, Ellipsoid) or isinstance(B, Ellipsoid):
            time.sleep(60)
        return super().ask(A, X_WA, B, X_WB)


class SpheresNaN(Honest):
    """No number for two spheres, ±1.8e308 for a sphere and a box."""

    name = "spheres_nan"

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        reply = super().ask(A, X_WA, B, X_WB)
        spheres = isinstance(A, Sphere) + isinstance(B, Sphere)
        if spheres == 2:
            return reply._replace(distance=math.nan)
        return reply._replace(distance=-1.7976931348623157e308) if spheres else reply


class Raises(Honest):
    """Refuses bodies more than 5 m apart, with an exception; adds a hundredth to gaps of capsules."""

    name = "raises"

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        reply = super().ask(A, X_WA, B, X_WB)
        if reply.distance > 5.0:
            raise RuntimeError("too far")
        capsules = type(A).__name__ == type(B).__name__ == "Capsule"
        return reply._replace(distance=reply.distance + 0.01) if capsules and not reply.hit else reply


class ExchangesPoints(Honest):
    """Nearest points of two spheres the other way round, of boxes a hundredth too far along the normal on A."""

    name = "exchanges_points"

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        r = collide.distance(A, B, X_WA, X_WB)
        point_a, point_b = r.point_a, r.point_b
        if type(A) is type(B) is Sphere:
            point_a, point_b = point_b, point_a
        if type(A) is type(B) is Box:
            point_a = point_a + 0.01 * r.normal
        return Reply(bool(r.hit), float(r.distance), point_a=tuple(point_a), point_b=tuple(point_b))
