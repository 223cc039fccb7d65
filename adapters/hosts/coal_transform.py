"""coal's `Transform3s`, and the quaternions and axes with angles of eigenpy that go with it."""

from __future__ import annotations

import math

import numpy as np

from collide.adapters.hosts.fcl_transform import Transform, quaternion_of, rotation_of
from collide.adapters.hosts.host_numbers import of_kind, real, shaped
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument


class Quaternion:
    """w + x·i + y·j + z·k, of any length, as eigenpy's.

    ``Quaternion()``, the identity; ``Quaternion(w, x, y, z)``; of coefficients (4,) x, y, z, w; of a rotation (3, 3);
    of an `AngleAxis`, another quaternion, or two vectors (3,) of which the first is turned into the second.
    """

    __slots__ = ("_xyzw",)

    def __init__(self, *args):
        if len(args) == 4:
            self._xyzw = np.roll([real(name, value) for name, value in zip("wxyz", args)], -1)
        elif len(args) == 2:
            self._xyzw = _between(shaped("u", args[0], (3,)), shaped("v", args[1], (3,)))
        elif not args:
            self._xyzw = np.array([0.0, 0.0, 0.0, 1.0])
        elif len(args) == 1 and isinstance(args[0], Quaternion):
            self._xyzw = args[0]._xyzw.copy()
        elif len(args) == 1 and _shape(args[0]) == (4,):
            self._xyzw = shaped("coefficients", args[0], (4,)).copy()
        elif len(args) == 1:
            self._xyzw = np.roll(quaternion_of(rotation_matrix(args[0])), -1)
        else:
            raise TypeError("Quaternion(w, x, y, z), (coefficients x y z w), (R), (AngleAxis), (u, v) or ()")

    x = property(lambda self: float(self._xyzw[0]), lambda self, v: self.__setitem__(0, v), doc="Of i.")
    y = property(lambda self: float(self._xyzw[1]), lambda self, v: self.__setitem__(1, v), doc="Of j.")
    z = property(lambda self: float(self._xyzw[2]), lambda self, v: self.__setitem__(2, v), doc="Of k.")
    w = property(lambda self: float(self._xyzw[3]), lambda self, v: self.__setitem__(3, v), doc="The real part.")

    @staticmethod
    def Identity():
        """1."""
        return Quaternion()

    @staticmethod
    def FromTwoVectors(a, b):
        """The shortest rotation that brings the direction of a (3,) to that of b (3,)."""
        return Quaternion(a, b)

    def setIdentity(self):
        """Becomes 1; returns itself."""
        self._xyzw[:] = 0.0, 0.0, 0.0, 1.0
        return self

    def setFromTwoVectors(self, a, b):
        """Becomes the shortest rotation from a (3,) to b (3,); returns itself."""
        return self.assign(Quaternion(a, b))

    def assign(self, quat):
        """Becomes ``quat``; returns itself."""
        self._xyzw[:] = of_kind("quat", quat, Quaternion)._xyzw
        return self

    def coeffs(self):
        """A copy (4,) x, y, z, w."""
        return self._xyzw.copy()

    def vec(self):
        """A copy (3,) x, y, z."""
        return self._xyzw[:3].copy()

    def norm(self):
        """The length."""
        return float(np.linalg.norm(self._xyzw))

    def squaredNorm(self):
        """The length, squared."""
        return float(self._xyzw @ self._xyzw)

    def normalize(self):
        """Brought to length 1; returns itself."""
        self._xyzw /= self.norm()
        return self

    def normalized(self):
        """One of length 1."""
        return Quaternion(self).normalize()

    def conjugate(self):
        """w − x·i − y·j − z·k."""
        return Quaternion(self._xyzw * (-1.0, -1.0, -1.0, 1.0))

    def inverse(self):
        """The conjugate, divided by the squared length."""
        return Quaternion(self.conjugate()._xyzw / self.squaredNorm())

    def dot(self, other):
        """Product of the coefficients, summed."""
        return float(self._xyzw @ of_kind("other", other, Quaternion)._xyzw)

    def angularDistance(self, other):
        """Angle between two rotations [rad]."""
        d = (self.normalized() * of_kind("other", other, Quaternion).normalized().conjugate())._xyzw
        return 2.0 * math.atan2(float(np.linalg.norm(d[:3])), abs(float(d[3])))

    def slerp(self, t, other):
        """The rotation at part t of the way to ``other``, at even speed."""
        t, cosine = real("t", t), self.dot(other)
        end = other._xyzw if cosine >= 0.0 else -other._xyzw
        angle = math.acos(min(1.0, abs(cosine)))
        if angle < 1e-8:
            return Quaternion((1.0 - t) * self._xyzw + t * end)
        weights = np.sin([(1.0 - t) * angle, t * angle]) / math.sin(angle)
        return Quaternion(weights[0] * self._xyzw + weights[1] * end)

    def isApprox(self, other, prec=1e-12):
        """Whether coefficients agree within ``prec`` of their length."""
        of_kind("other", other, Quaternion)
        return bool(np.linalg.norm(self._xyzw - other._xyzw) <= prec * min(self.norm(), other.norm()))

    def matrix(self):
        """The rotation (3, 3); of a quaternion of length 1, which it is brought to."""
        return rotation_of(np.roll(self._xyzw, 1))

    toRotationMatrix = matrix

    def __mul__(self, other):
        if isinstance(other, Quaternion):
            (a, w), (b, v) = ((q._xyzw[:3], q._xyzw[3]) for q in (self, other))
            return Quaternion(np.append(w * b + v * a + np.cross(a, b), w * v - a @ b))
        return self.matrix() @ shaped("v", other, (3,))

    def __eq__(self, other):
        return isinstance(other, Quaternion) and np.array_equal(self._xyzw, other._xyzw)

    __hash__ = object.__hash__

    def __getitem__(self, k):
        return float(self._xyzw[k])

    def __setitem__(self, k, value):
        self._xyzw[k] = real("a coefficient", value)

    def __len__(self):
        return 4

    def __str__(self):
        return "(x,y,z,w) = " + " ".join(f"{value:.6g}" for value in self._xyzw)

    __repr__ = __str__


class AngleAxis:
    """A rotation by ``angle`` [rad] around ``axis`` (3,), as eigenpy's.

    ``AngleAxis()``, ``AngleAxis(angle, axis)``, of a rotation (3, 3), a `Quaternion` or another one.
    """

    __slots__ = ("_axis", "angle")

    def __init__(self, *args):
        if len(args) == 2:
            self.angle, self.axis = real("angle", args[0]), args[1]
        elif not args:
            self.angle, self.axis = 0.0, (1.0, 0.0, 0.0)
        elif isinstance(args[0], AngleAxis):
            self.angle, self.axis = args[0].angle, args[0].axis
        else:
            self.fromRotationMatrix(rotation_matrix(args[0]))

    @property
    def axis(self):
        """A copy (3,)."""
        return self._axis.copy()

    @axis.setter
    def axis(self, value):
        self._axis = shaped("axis", value, (3,)).copy()

    def fromRotationMatrix(self, R):
        """Becomes the rotation R (3, 3); returns itself."""
        w, *v = quaternion_of(shaped("R", R, (3, 3)))
        length = float(np.linalg.norm(v))
        self.angle = 2.0 * math.atan2(length, abs(w))
        self.axis = np.array(v) / (math.copysign(length, w)) if length > 0.0 else (1.0, 0.0, 0.0)
        return self

    def matrix(self):
        """The rotation (3, 3)."""
        x, y, z = self._axis
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.eye(3) + math.sin(self.angle) * K + (1.0 - math.cos(self.angle)) * (K @ K)

    toRotationMatrix = matrix

    def inverse(self):
        """The rotation back."""
        return AngleAxis(-self.angle, self._axis)

    def isApprox(self, other, prec=1e-12):
        """Whether the two rotations agree within ``prec``."""
        return bool(np.abs(self.matrix() - of_kind("other", other, AngleAxis).matrix()).max() <= prec)

    def __mul__(self, other):
        if isinstance(other, (AngleAxis, Quaternion)):
            return Quaternion(self) * Quaternion(other)
        return self.matrix() @ shaped("v", other, (3,))

    def __eq__(self, other):
        return isinstance(other, AngleAxis) and self.angle == other.angle and np.array_equal(self._axis, other._axis)

    __hash__ = object.__hash__

    def __repr__(self):
        return "angle: {:.6g}\naxis: {:.6g} {:.6g} {:.6g}\n".format(self.angle, *self._axis)


class Transform3s(Transform):
    """A rigid transform, kept as one pose (4, 4).

    ``Transform3s()``, ``Transform3s(R, t)`` with a rotation (3, 3) or a quaternion and a translation (3,) [m],
    ``Transform3s(R)``, ``Transform3s(quaternion)``, ``Transform3s(t)``, ``Transform3s(X)`` with another one or a pose
    (4, 4). Quaternions are those of eigenpy and Pinocchio, too. Rotations are checked when a query uses them.
    """

    __slots__ = ()

    def __init__(self, *args):
        X = self._X = np.eye(4)
        if len(args) == 2:
            X[:3, :3], X[:3, 3] = rotation_matrix(args[0]), shaped("T", args[1], (3,))
        elif len(args) == 1 and isinstance(args[0], Transform):
            X[:] = args[0]._X
        elif len(args) == 1 and _shape(args[0]) == (3,):
            X[:3, 3] = shaped("T", args[0], (3,))
        elif len(args) == 1 and _shape(args[0]) == (4, 4):
            X[:3] = shaped("X", args[0], (4, 4))[:3]
        elif len(args) == 1:
            X[:3, :3] = rotation_matrix(args[0])
        elif args:
            raise TypeError("Transform3s(R, t), (quaternion, t), (R), (quaternion), (t), (Transform3s) or ()")

    @staticmethod
    def Identity():
        """The identity."""
        return Transform3s()

    @staticmethod
    def Random():
        """A rotation of even chance, and a translation within a unit cube."""
        X = Transform3s()
        X.setRandom()
        return X

    def setRandom(self):
        """Becomes a random transform."""
        rng = np.random.default_rng(np.random.randint(2**31))
        self._X[:3, :3], self._X[:3, 3] = rotation_of(rng.normal(size=4)), rng.uniform(-1.0, 1.0, 3)

    def getQuatRotation(self):
        """The rotation as a `Quaternion`."""
        return Quaternion(self._X[:3, :3])

    def setQuatRotation(self, q):
        """q : a quaternion."""
        self._X[:3, :3] = rotation_matrix(q)

    def setTransform(self, R, T):
        """R : (3, 3), or a quaternion.   T : (3,) [m]."""
        self._X[:3, :3], self._X[:3, 3] = rotation_matrix(R), shaped("T", T, (3,))

    def setIdentity(self):
        """Becomes the identity."""
        self._X[:] = np.eye(4)

    def isIdentity(self, prec=1e-12):
        """Whether it is the identity within ``prec``."""
        return bool(np.abs(self._X - np.eye(4)).max() <= prec)

    def transform(self, v):
        """The image (3,) of a point (3,), or (n, 3) of (n, 3)."""
        points = checks.array("v", v, "(3,) or (n, 3)", InvalidArgument)
        if points.ndim not in (1, 2) or points.shape[-1] != 3:
            raise InvalidArgument(f"v must be (3,) or (n, 3), got {points.shape}")
        return points @ self._X[:3, :3].T + self._X[:3, 3]

    def inverse(self):
        """The way back."""
        return Transform3s(self).inverseInPlace()

    def inverseInPlace(self):
        """Becomes the way back; returns itself."""
        R, t = self._X[:3, :3].T.copy(), self._X[:3, 3]
        self._X[:3, :3], self._X[:3, 3] = R, -R @ t
        return self

    def inverseTimes(self, other):
        """``self.inverse() * other``."""
        return self.inverse() * other

    def __mul__(self, other):
        return Transform3s(self._X @ of_kind("other", other, Transform)._X)

    def __imul__(self, other):
        self._X[:] = self._X @ of_kind("other", other, Transform)._X
        return self

    def __eq__(self, other):
        return isinstance(other, Transform) and np.array_equal(self._X, other._X)

    __hash__ = object.__hash__

    def __reduce__(self):
        return Transform3s, (self._X,)


def rotation_matrix(R) -> np.ndarray:
    """The rotation (3, 3) of a matrix, or of what has one: quaternions of any package, axes with angles.

    Raises InvalidArgument.
    """
    if hasattr(R, "matrix"):
        R = R.matrix()
    array = checks.array("a rotation", R, "(3, 3)", InvalidArgument)
    if array.shape != (3, 3):
        raise InvalidArgument(f"a rotation is a matrix (3, 3) or a quaternion, got {type(R).__name__} {array.shape}")
    return array


def _shape(value) -> tuple[int, ...] | None:
    """The shape of what has one; None of ragged rows."""
    try:
        return np.shape(value)
    except ValueError:
        return None


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Coefficients x, y, z, w of the shortest rotation from a to b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    w = 1.0 + float(a @ b)
    if w < 1e-12:  # half a turn around any axis across a
        axis = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        return np.append(axis / np.linalg.norm(axis), 0.0)
    q = np.append(np.cross(a, b), w)
    return q / np.linalg.norm(q)
