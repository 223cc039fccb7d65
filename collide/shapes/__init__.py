"""What a user hands in: immutable shapes, validated when made.

One file per family: primitives (a few numbers), hull (points), hpolytope (half-spaces, walls), mesh (triangles),
height_field (a mesh of heights over a grid), point_cloud, voxel_grid, octree, compound (a union), shape_set (many,
picked from by number).
`collide.scenes` still turns the meshes of scene files into hulls or unions of hulls, and says so for every body.
"""

from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.height_field import HeightField
from collide.shapes.hpolytope import HPolytope, Plane
from collide.shapes.mesh import Mesh
from collide.shapes.octree import OcTree, OcTreeLeaves
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import Shape
from collide.shapes.shape_set import ShapeSet
from collide.shapes.swept_mesh import SweptMesh
from collide.shapes.voxel_grid import VoxelGrid

__all__ = [
    "Box", "Capsule", "Compound", "Cone", "ConvexHull", "Cylinder", "Ellipsoid",
    "HPolytope", "Halfspace", "HeightField", "Mesh", "OcTree", "OcTreeLeaves", "Plane", "PointCloud", "Shape",
    "ShapeSet", "Sphere", "SweptMesh", "VoxelGrid",
]
