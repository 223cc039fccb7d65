"""Rotations in kernels: from a rotation vector to a matrix, and from two orientations to the vector between them.

A rotation vector ω [rad] points along the axis; its length is the angle. Rotation by it is Rodrigues' formula,

    Rot(ω) = cos θ · I + sin θ · [û]× + (1 − cos θ) · û ûᵀ,    θ = |ω|, û = ω / θ.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.numerics.matrix3 import Matrix3
from collide.numerics.sine_cosine import angle_of, sine_cosine
from collide.numerics.vec3 import Vec3, norm, scale

#: Below this length of a quaternion's vector part, half the angle is its own sine.
_SMALL = 1e-9


@kernel(inline=True)
def rotation_about(axis, angle):
    """The `Matrix3` that turns by ``angle`` [rad] about a unit vector; |angle| ≤ LARGEST_ANGLE."""
    sine, cosine = sine_cosine(abs(angle))
    if angle < 0.0:
        sine = -sine
    rest = 1.0 - cosine
    x, y, z = axis
    xy, yz, zx = rest * x * y, rest * y * z, rest * z * x
    return Matrix3(
        Vec3(cosine + rest * x * x, xy - sine * z, zx + sine * y),
        Vec3(xy + sine * z, cosine + rest * y * y, yz - sine * x),
        Vec3(zx - sine * y, yz + sine * x, cosine + rest * z * z),
    )


@kernel
def rotation_between(X0, X1):
    """The rotation vector ω of the shortest turn from the orientation of X0 to the orientation of X1: Rot(ω) R0 = R1.

    X0, X1 : views of 16 doubles, matrices row by row. Equal orientations give exactly 0.
    Half a turn goes about the axis whose first coordinate ≠ 0 is positive.

    The quaternion of R1 R0ᵀ by its largest component (Shepperd 1978): well-conditioned for all angles.
    """
    xx, xy, xz = _entry(X1, X0, 0, 0), _entry(X1, X0, 0, 1), _entry(X1, X0, 0, 2)
    yx, yy, yz = _entry(X1, X0, 1, 0), _entry(X1, X0, 1, 1), _entry(X1, X0, 1, 2)
    zx, zy, zz = _entry(X1, X0, 2, 0), _entry(X1, X0, 2, 1), _entry(X1, X0, 2, 2)
    trace = xx + yy + zz
    if trace >= max(xx, yy, zz):
        w, v = 1.0 + trace, Vec3(zy - yz, xz - zx, yx - xy)
    elif xx >= max(yy, zz):
        w, v = zy - yz, Vec3(1.0 + xx - yy - zz, yx + xy, xz + zx)
    elif yy >= zz:
        w, v = xz - zx, Vec3(yx + xy, 1.0 + yy - xx - zz, zy + yz)
    else:
        w, v = yx - xy, Vec3(xz + zx, zy + yz, 1.0 + zz - xx - yy)
    first = v.x if v.x != 0.0 else (v.y if v.y != 0.0 else v.z)
    if w < 0.0 or (w == 0.0 and first < 0.0):
        w, v = -w, scale(-1.0, v)
    length = norm(v)
    if length <= _SMALL * w:
        return scale(2.0 / w, v)
    return scale(2.0 * angle_of(length, w) / length, v)


@kernel(inline=True)
def _entry(X1, X0, i, j):
    """Entry (i, j) of R1 R0ᵀ."""
    return X1[4 * i] * X0[4 * j] + X1[4 * i + 1] * X0[4 * j + 1] + X1[4 * i + 2] * X0[4 * j + 2]
