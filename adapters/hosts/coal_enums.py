"""coal's enums, with its numbers; each member also stands in `coal_api` under its name, as in coal."""

from __future__ import annotations

from enum import IntEnum


class _Enum(IntEnum):
    """An enum as Boost.Python makes them: an int that prints its name."""

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"coal.{type(self).__name__}.{self.name}"


class NODE_TYPE(_Enum):
    """What `getNodeType` returns."""

    (
        BV_UNKNOWN, BV_AABB, BV_OBB, BV_RSS, BV_kIOS, BV_OBBRSS, BV_KDOP16, BV_KDOP18, BV_KDOP24, GEOM_BOX,
        GEOM_SPHERE, GEOM_CAPSULE, GEOM_CONE, GEOM_CYLINDER, GEOM_CONVEX, GEOM_PLANE, GEOM_HALFSPACE, GEOM_TRIANGLE,
        GEOM_OCTREE, GEOM_ELLIPSOID, HF_AABB, HF_OBBRSS,
    ) = range(22)


class OBJECT_TYPE(_Enum):
    """What `getObjectType` returns."""

    OT_UNKNOWN, OT_BVH, OT_GEOM, OT_OCTREE, OT_HFIELD = range(5)


class CollisionRequestFlag(_Enum):
    """What the first argument of `CollisionRequest` says."""

    CONTACT, DISTANCE_LOWER_BOUND, NO_REQUEST = 1, 2, 4096


class BVHBuildState(_Enum):
    """Where the making of a model stands."""

    (
        BVH_BUILD_STATE_EMPTY, BVH_BUILD_STATE_BEGUN, BVH_BUILD_STATE_PROCESSED, BVH_BUILD_STATE_UPDATE_BEGUN,
        BVH_BUILD_STATE_UPDATED, BVH_BUILD_STATE_REPLACE_BEGUN,
    ) = range(6)


class BVHModelType(_Enum):
    """What a model is made of."""

    BVH_MODEL_UNKNOWN, BVH_MODEL_TRIANGLES, BVH_MODEL_POINTCLOUD = range(3)


class ContactPatchDirection(_Enum):
    """Whether the z-axis of a patch's frame is the normal, or its negative."""

    DEFAULT, INVERTED = range(2)


class GJKVariant(_Enum):
    """Accepted, and without effect."""

    DefaultGJK, PolyakAcceleration, NesterovAcceleration = range(3)


class GJKInitialGuess(_Enum):
    """Accepted, and without effect."""

    DefaultGuess, CachedGuess, BoundingVolumeGuess = range(3)


class GJKConvergenceCriterion(_Enum):
    """Accepted, and without effect."""

    Default, DualityGap, Hybrid = range(3)


class GJKConvergenceCriterionType(_Enum):
    """Accepted, and without effect."""

    Relative, Absolute = range(2)


class GJKStatus(_Enum):
    """What coal's low-level search returns; nothing here does."""

    DidNotRun, Failed, NoCollisionEarlyStopped, NoCollision, CollisionWithPenetrationInformation, Collision = range(6)


ENUMS = (
    NODE_TYPE, OBJECT_TYPE, CollisionRequestFlag, BVHBuildState, BVHModelType, ContactPatchDirection, GJKVariant,
    GJKInitialGuess, GJKConvergenceCriterion, GJKConvergenceCriterionType, GJKStatus,
)
#: Boost's tables of an enum: ``NODE_TYPE.names["GEOM_BOX"]``, ``NODE_TYPE.values[9]``.
for _enum in ENUMS:
    setattr(_enum, "names", dict(_enum.__members__))  # noqa: B010 - members of enums are not to be declared
    setattr(_enum, "values", {int(member): member for member in _enum})  # noqa: B010
#: Every member by its name, as coal's module has them.
MEMBERS = {name: member for enum in ENUMS for name, member in enum.__members__.items()}
