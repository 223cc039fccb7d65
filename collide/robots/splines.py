"""Motions as piecewise polynomials of time: B-splines, Bézier curves, polynomials, segments at rest or not.

All are kept as Bézier curves, a piece between two breaks, whose control points are averages of what was given. With
M, the largest number that goes into a piece's column, averages of at most 15 levels are off by less than
15 · 7 u M, u = 2^−53, and coefficients of powers by less than 100 u M, M their sum over a piece; kernels add less than
300 u M (`motion_bounds.py`), forward kinematics some 100 u M. `Spline.errors` has ROUNDING_SHARE · M = 8192 u M:
what is proven of a spline holds of the curve that the given doubles name.
"""

from __future__ import annotations

import math

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.robots.motion_bounds import MAX_DEGREE, ROUNDING_SHARE
from collide.transforms import LARGEST

#: Ends of neighbouring pieces farther apart than this share of the largest value are a jump.
_JUMP = 1e-9


class Spline:
    """A motion in time: each column a piecewise polynomial, kept as Bézier curves.

        spline = collide.Spline.bspline(knots, coefficients, degree=3)     # scipy.interpolate.BSpline: t, c, k
        spline = collide.Spline.polynomials(breaks, coefficients)          # scipy.interpolate.PPoly: x, c
        spline = collide.Spline.min_jerk(Q, times)                         # at rest at every waypoint

    Parameters
    ----------
    breaks : (m + 1,) array_like
        Times at which pieces begin and end [s, or any unit], increasing.
    control_points : (m, degree + 1, columns) array_like
        Control points of the pieces [rad or m], degree at most 15.
    magnitudes : (m, columns) array_like, optional
        The largest numbers that went into the pieces, for bounds of rounding; by default those of the control points.

    Attributes
    ----------
    breaks, control_points : as given.
    errors : (m, columns) float64
        By how much a column may differ from what was given [rad or m].

    Raises
    ------
    InvalidArgument
        Naming the argument: times not increasing, values not finite, pieces that do not meet.
    """

    def __init__(self, breaks, control_points, magnitudes=None):
        self.breaks = _increasing("Spline: breaks", breaks, 2)
        points = _values("Spline: control_points", control_points, 3, "(pieces, degree + 1, columns)")
        if len(points) != len(self.breaks) - 1 or points.shape[1] < 2:
            raise InvalidArgument(
                f"Spline: control_points must be (pieces, degree + 1, columns), degree ≥ 1, with "
                f"{len(self.breaks) - 1} pieces between the breaks {brief(breaks)}, got {points.shape}"
            )
        if points.shape[1] - 1 > MAX_DEGREE:
            raise InvalidArgument(
                f"Spline: degree {points.shape[1] - 1} is too large: at most {MAX_DEGREE}; fit pieces of a lower degree"
            )
        self.control_points = points
        self._magnitudes = sizes = np.abs(points).max(axis=1)
        if magnitudes is not None:
            self._magnitudes = np.maximum(sizes, _like("Spline: magnitudes", magnitudes, sizes))
        jumps = np.abs(points[1:, 0] - points[:-1, -1])
        if (jumps > _JUMP * np.maximum(1.0, sizes.max(axis=0))).any():
            piece, column = np.unravel_index(int(np.argmax(jumps)), jumps.shape)
            raise InvalidArgument(
                f"Spline: control_points: column {column} jumps by {jumps[piece, column]:g} at time "
                f"{self.breaks[piece + 1]:g}, from the end of piece {piece} to the begin of the next: pieces must "
                "meet; certify parts one by one"
            )
        # The step of a rounded jump belongs to both of its pieces.
        self.errors = ROUNDING_SHARE * self._magnitudes
        self.errors[1:] += jumps
        self.errors[:-1] += jumps

    # --- ways to say a motion -------------------------------------------------------------------

    @classmethod
    def straight(cls, Q, times=None) -> Spline:
        """Straight segments between waypoints.

        Parameters
        ----------
        Q : (M, columns) array_like
            Waypoints [rad or m], at least two.
        times : (M,) array_like, optional
            When the motion passes, increasing; by default 0, 1, 2, ….

        Returns
        -------
        Spline
            Of degree 1.
        """
        q, breaks = _waypoints("Spline.straight", Q, times)
        return cls(breaks, np.stack([q[:-1], q[1:]], axis=1))

    @classmethod
    def min_jerk(cls, Q, times=None) -> Spline:
        """Straight segments with the time law of least jerk, s = 10 τ³ − 15 τ⁴ + 6 τ⁵: at rest at every waypoint.

        Parameters
        ----------
        Q, times
            As of `straight`.

        Returns
        -------
        Spline
            Of degree 5.
        """
        q, breaks = _waypoints("Spline.min_jerk", Q, times)
        return cls(breaks, np.stack([q[:-1]] * 3 + [q[1:]] * 3, axis=1))

    @classmethod
    def hermite(cls, times, Q, velocities, accelerations=None) -> Spline:
        """Pieces through waypoints with velocities: cubic; with accelerations as well: quintic.

        Parameters
        ----------
        times : (M,) array_like
            When the motion passes [s], increasing.
        Q, velocities, accelerations : (M, columns) array_like
            [rad or m], [rad/s or m/s], [rad/s² or m/s²].

        Returns
        -------
        Spline
        """
        q, breaks = _waypoints("Spline.hermite", Q, times)
        v = _like("Spline.hermite: velocities, as Q,", velocities, q)
        h = np.diff(breaks)[:, None]
        if accelerations is None:
            first, second = h / 3.0 * v[:-1], h / 3.0 * v[1:]
            points, added = [q[:-1], q[:-1] + first, q[1:] - second, q[1:]], np.abs(first) + np.abs(second)
        else:
            a = _like("Spline.hermite: accelerations, as Q,", accelerations, q)
            first, second = h / 5.0 * v[:-1], h / 5.0 * v[1:]
            bend, unbend = h * h / 20.0 * a[:-1], h * h / 20.0 * a[1:]
            points = [q[:-1], q[:-1] + first, q[:-1] + 2.0 * first + bend]
            points += [q[1:] - 2.0 * second + unbend, q[1:] - second, q[1:]]
            added = 2.0 * (np.abs(first) + np.abs(second)) + np.abs(bend) + np.abs(unbend)
        return cls(breaks, np.stack(points, axis=1), np.maximum(np.abs(q[:-1]), np.abs(q[1:])) + added)

    @classmethod
    def bspline(cls, knots, coefficients, degree: int = 3) -> Spline:
        """A B-spline: ``t``, ``c`` and ``k`` of scipy's BSpline.

        Parameters
        ----------
        knots : (n + degree + 1,) array_like
            Not decreasing; the motion goes from ``knots[degree]`` to ``knots[n]``.
        coefficients : (n, columns) array_like
            Control points [rad or m], n > degree.
        degree : int
            1 … 15.

        Returns
        -------
        Spline
            A Bézier piece for each span of knots; the curve is the B-spline's.

        Raises
        ------
        InvalidArgument
            For knots that decrease, for too few coefficients or another number of knots, for values not finite.
        """
        degree = checks.integer("Spline.bspline: degree", degree, 1)
        if degree > MAX_DEGREE:
            raise InvalidArgument(f"Spline.bspline: degree must be at most {MAX_DEGREE}, got {brief(degree)}")
        t = _values("Spline.bspline: knots", knots, 1, "(n + degree + 1,)")
        c = _values("Spline.bspline: coefficients", coefficients, 2, "(n, columns)")
        n = len(c)
        if n <= degree:
            raise InvalidArgument(
                f"Spline.bspline: {n} coefficients are too few for degree {degree}: at least {degree + 1} rows, got "
                f"{brief(coefficients)}"
            )
        if len(t) != n + degree + 1:
            raise InvalidArgument(
                f"Spline.bspline: knots must be {n + degree + 1}, coefficients + degree + 1, got {len(t)}: "
                f"{brief(knots)}"
            )
        if (np.diff(t) < 0.0).any():
            k = int(np.argmin(np.diff(t)))
            raise InvalidArgument(f"Spline.bspline: knots decrease from {t[k]:g} to {t[k + 1]:g} at knot {k + 1}")
        spans = degree + np.flatnonzero(np.diff(t[degree : n + 1]) > 0.0)
        if not len(spans):
            raise InvalidArgument("Spline.bspline: all knots of the motion are equal: it has no length in time")
        local = c[spans[:, None] + np.arange(-degree, 1)]
        points = np.stack([_blossom(t, local, spans, degree, k) for k in range(degree + 1)], axis=1)
        return cls(t[np.append(spans, spans[-1] + 1)], points, np.abs(local).max(axis=1))

    @classmethod
    def polynomials(cls, breaks, coefficients) -> Spline:
        """Polynomials between breaks: ``x`` and ``c`` of scipy's PPoly and CubicSpline.

        Parameters
        ----------
        breaks : (m + 1,) array_like
            Increasing.
        coefficients : (degree + 1, m, columns) array_like
            Of falling powers of the time since the begin of a piece.

        Returns
        -------
        Spline

        Raises
        ------
        InvalidArgument
            For breaks not increasing, another number of pieces, pieces with a jump in between.
        """
        x = _increasing("Spline.polynomials: breaks", breaks, 2)
        c = _values("Spline.polynomials: coefficients", coefficients, 3, "(degree + 1, pieces, columns)")
        if c.shape[1] != len(x) - 1 or not 1 <= len(c) <= MAX_DEGREE + 1:
            raise InvalidArgument(
                f"Spline.polynomials: coefficients must be (degree + 1, {len(x) - 1}, columns), between the breaks "
                f"{brief(breaks)}, with degree at most {MAX_DEGREE}, got {c.shape}"
            )
        if len(c) == 1:
            c = np.concatenate([np.zeros_like(c), c])
        n = len(c) - 1
        h = np.diff(x)[:, None]
        terms = [c[n - p] * h**p for p in range(n + 1)]
        points = [sum(math.comb(k, p) / math.comb(n, p) * terms[p] for p in range(k + 1)) for k in range(n + 1)]
        return cls(x, np.stack(points, axis=1), np.abs(terms).sum(axis=0))

    @classmethod
    def bezier(cls, control_points, times=None) -> Spline:
        """Bézier curves in sequence.

        Parameters
        ----------
        control_points : (degree + 1, columns) or (m, degree + 1, columns) array_like
            [rad or m].
        times : (m + 1,) array_like, optional
            When pieces begin and end, increasing; by default 0, 1, 2, ….

        Returns
        -------
        Spline

        Raises
        ------
        InvalidArgument
            For another number of times, and for curves that do not meet.
        """
        name = "Spline.bezier: control_points"
        points = checks.array(name, control_points, "(degree + 1, columns)", InvalidArgument)
        points = _values(name, points[None] if points.ndim == 2 else points, 3, "(degree + 1, columns)")
        breaks = np.arange(len(points) + 1.0) if times is None else _increasing("Spline.bezier: times", times, 2)
        if len(breaks) != len(points) + 1:
            raise InvalidArgument(
                f"Spline.bezier: times must be {len(points) + 1}, those of both ends of {len(points)} control_points, "
                f"got {len(breaks)}: {brief(times)}"
            )
        return cls(breaks, points)

    @classmethod
    def of(cls, motion) -> Spline:
        """A `Spline`, or what scipy calls BSpline, PPoly (CubicSpline and its siblings) or BPoly, as a Spline.

        Parameters
        ----------
        motion : Spline, or an object with ``t``, ``c`` and ``k``, or with ``x`` and ``c``

        Returns
        -------
        Spline

        Raises
        ------
        InvalidArgument
            For anything else.
        """
        if isinstance(motion, cls):
            return motion
        if all(hasattr(motion, name) for name in "tck"):
            return cls.bspline(motion.t, motion.c, motion.k)
        if hasattr(motion, "x") and hasattr(motion, "c"):
            if any(kind.__name__ == "BPoly" for kind in type(motion).__mro__):
                return cls.bezier(np.swapaxes(motion.c, 0, 1), motion.x)
            return cls.polynomials(motion.x, motion.c)
        raise InvalidArgument(
            f"the motion must be a collide.Spline (Spline.bspline, .bezier, .polynomials, .min_jerk, .straight) or a "
            f"BSpline or PPoly of scipy, got {brief(motion)}"
        )

    # --- what is known of a motion --------------------------------------------------------------

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return self.control_points.shape[1] - 1

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.control_points.shape[2]

    def __len__(self) -> int:
        return len(self.control_points)

    def __repr__(self) -> str:
        return (
            f"Spline({len(self)} pieces of degree {self.degree}, {self.columns} columns, from {self.breaks[0]:g} to "
            f"{self.breaks[-1]:g})"
        )

    def __call__(self, times) -> np.ndarray:
        """Where the motion is.

        Parameters
        ----------
        times : (N,) array_like or float
            From the first break to the last.

        Returns
        -------
        (N, columns) or (columns,) float64
            [rad or m], within `errors` of the exact value. O(N · degree²).
        """
        t = checks.array("Spline: times", times, "(N,)", InvalidArgument)
        if t.ndim > 1 or not ((self.breaks[0] <= t) & (t <= self.breaks[-1])).all():
            raise InvalidArgument(
                f"Spline: times must be (N,) within [{self.breaks[0]:g}, {self.breaks[-1]:g}], got {brief(times)}"
            )
        piece = np.clip(np.searchsorted(self.breaks, t, "right") - 1, 0, len(self) - 1)
        share = (t - self.breaks[piece]) / (self.breaks[piece + 1] - self.breaks[piece])
        points = np.moveaxis(self.control_points[piece], -2, 0)
        for _ in range(self.degree):
            points = points[:-1] + np.asarray(share)[..., None] * (points[1:] - points[:-1])
        return points[0]

    def beside(self, motion: Spline) -> Spline:
        """Both motions at once, the columns of the second behind.

        Parameters
        ----------
        motion : Spline
            The second motion, from the begin of the first to its end, at least.

        Returns
        -------
        Spline
            With breaks where either has a break, and the larger degree.

        Raises
        ------
        InvalidArgument
            Where the second motion begins later or ends earlier.
        """
        motion = Spline.of(motion)
        if motion.breaks[0] > self.breaks[0] or motion.breaks[-1] < self.breaks[-1]:
            raise InvalidArgument(
                f"the motion lasts from {motion.breaks[0]:g} to {motion.breaks[-1]:g} and must last from "
                f"{self.breaks[0]:g} to {self.breaks[-1]:g} at least; give it pieces that stand still before and after"
            )
        inner = (motion.breaks > self.breaks[0]) & (motion.breaks < self.breaks[-1])
        breaks = np.union1d(self.breaks, motion.breaks[inner])
        degree = max(self.degree, motion.degree)
        both = [spline._cut_at(breaks)._raised(degree) for spline in (self, motion)]
        return Spline(
            breaks, np.concatenate([made.control_points for made in both], axis=2),
            np.concatenate([made._magnitudes for made in both], axis=1),
        )

    def _cut_at(self, breaks: np.ndarray) -> Spline:
        """Pieces between these breaks, each within a piece of the motion."""
        piece = np.clip(np.searchsorted(self.breaks, breaks[:-1], "right") - 1, 0, len(self) - 1)
        begin, length = self.breaks[piece], np.diff(self.breaks)[piece]
        first, last = (breaks[:-1] - begin) / length, np.minimum((breaks[1:] - begin) / length, 1.0)
        points, n = self.control_points[piece].copy(), self.degree
        for level in range(1, n + 1):
            for k in range(n, level - 1, -1):
                points[:, k] = points[:, k - 1] + last[:, None] * (points[:, k] - points[:, k - 1])
        share = (first / last)[:, None]
        for level in range(n, 0, -1):
            for k in range(level):
                points[:, k] = points[:, k] + share * (points[:, k + 1] - points[:, k])
        return Spline(breaks, points, self._magnitudes[piece])

    def _raised(self, degree: int) -> Spline:
        """The same curves, of a higher degree."""
        points = self.control_points
        for n in range(self.degree + 1, degree + 1):
            share = (np.arange(1, n) / n)[:, None]
            middle = share * points[:, :-1] + (1.0 - share) * points[:, 1:]
            points = np.concatenate([points[:, :1], middle, points[:, -1:]], axis=1)
        return Spline(self.breaks, points, self._magnitudes)


def _blossom(t: np.ndarray, local: np.ndarray, spans: np.ndarray, degree: int, k: int) -> np.ndarray:
    """(spans, columns) the k-th Bézier control point of each span of knots.

    The polar form of a span's polynomial at its begin, degree − k times, and its end, k times, by de Boor's averages:
    their weights are within [0, 1], since both arguments are within the span.
    """
    d = local.copy()
    for level in range(1, degree + 1):
        a = (t[spans] if level <= degree - k else t[spans + 1])[:, None]
        j = spans[:, None] + np.arange(level - degree, 1)  # coefficients that stay
        low, high = t[j], t[j + degree - level + 1]
        share = ((a - low) / (high - low))[:, :, None]
        d = d[:, :-1] + share * (d[:, 1:] - d[:, :-1])
    return d[:, 0]


def _values(what: str, values, n_axes: int, wanted: str) -> np.ndarray:
    """A copy of finite numbers of so many axes, none of them empty. Raises InvalidArgument."""
    read = np.array(checks.array(what, values, wanted, InvalidArgument), dtype=np.float64)
    if read.ndim != n_axes or not read.size:
        raise InvalidArgument(f"{what} must be {wanted} and not empty, got {read.shape}")
    if not (np.abs(read) <= LARGEST).all():
        at = tuple(np.argwhere(~(np.abs(read) <= LARGEST))[0].tolist())
        raise InvalidArgument(f"{what}{list(at)} is {read[at]}: it must be finite and within ±{LARGEST:g}")
    return read


def _increasing(what: str, values, least: int) -> np.ndarray:
    read = _values(what, values, 1, "(n,)")
    if len(read) < least:
        raise InvalidArgument(f"{what} must be {least} or more, got {brief(values)}")
    if not (np.diff(read) > 0.0).all():
        k = int(np.argmin(np.diff(read)))
        raise InvalidArgument(f"{what} must increase: entry {k + 1} is {read[k + 1]:g}, after {read[k]:g}")
    return read


def _waypoints(what: str, Q, times) -> tuple[np.ndarray, np.ndarray]:
    """(waypoints, times)."""
    q = _values(f"{what}: Q", Q, 2, "(waypoints, columns)")
    if len(q) < 2:
        raise InvalidArgument(f"{what}: Q must be two waypoints or more, got {brief(Q)}")
    breaks = np.arange(float(len(q))) if times is None else _increasing(f"{what}: times", times, 2)
    if len(breaks) != len(q):
        raise InvalidArgument(
            f"{what}: times must be {len(q)}, one for each waypoint of Q, got {len(breaks)}: {brief(times)}"
        )
    return q, breaks


def _like(what: str, values, q: np.ndarray) -> np.ndarray:
    read = _values(what, values, 2, str(q.shape))
    if read.shape != q.shape:
        raise InvalidArgument(f"{what} must be {q.shape}, got {read.shape}")
    return read
