"""Derivatives of contacts: how gap, points and normal of each row move with both poses.

The normal n of two convex sets is the normal of `distance`, and moves as `distance(…, derivatives=True)` says; beside a
half-space n is fixed to the half-space. The points a, b of a row lie on features of the cores: a point on k planes of
faces that are not parallel stays on these planes, k = 1 on a face, 2 on an edge, 3 at a vertex. With V the velocities
of the bodies at the points, m the normals of the planes and d the distance of the cores,

    m_A · (da − V_A(a)) = 0,   m_B · (db − V_B(b)) = 0,   db − da − n dd = d dn.

Seven unknowns are solved for where the equations have full rank, and agree: a corner over a face, two edges that cross,
an edge cut by the border of a face. Where the equations disagree, the features change. A ball swept over a core adds
its radius along n. A row with a cylinder, a cone or an ellipsoid moves as the witness points
of `distance`, where its points are these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.contact.contact_query import contacts
from collide.contact.contact_rows import Contacts
from collide.derivatives.implicit import crossed
from collide.lowering.hull_faces import faces_of
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.parts import is_single_convex, parts_of
from collide.pairs.pair_arguments import asked_poses, pose_at, shape_at
from collide.pairs.query import distance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from collide.shapes.shape import Shape
    from collide.transforms import PoseLike

#: A point is on a plane that is nearer than this part of the pair's size, and points so near each other are the same.
_ON = 1e-9
#: Singular values below the first are no full rank; residuals above the second disagree.
_LEAST_SINGULAR, _RESIDUAL = 1e-5, 1e-8
_OF_UNIONS = "contacts of unions, meshes and fields have no derivatives here: ask about their convex parts"
_CHANGES = "the features change: the point is a corner over an edge, or beside it"
_NOT_FOLLOWED = "the point is fixed by no corner, edge or face, and is no witness point of the distance"


class ContactDerivatives(NamedTuple):
    """Contacts, and derivatives of their k rows by both poses; NaN where ``reason`` says why.

    The six numbers of a pose are those of `PairDerivatives`: a turn [rad] about the body's origin, then a shift [m],
    along the axes of W.

    contacts : `Contacts`, k rows.
    d_distance_A, d_distance_B : (k, 6) of ``distance`` [m/rad, m/m].
    d_point_a_A, d_point_a_B, d_point_b_A, d_point_b_B : (k, 3, 6) of the points [m/rad, m/m].
    d_normal_A, d_normal_B : (k, 3, 6) of the normal [1/rad, 1/m].
    reason : list of k, None beside derivatives.
    """

    contacts: Contacts
    d_distance_A: np.ndarray
    d_distance_B: np.ndarray
    d_point_a_A: np.ndarray
    d_point_a_B: np.ndarray
    d_point_b_A: np.ndarray
    d_point_b_B: np.ndarray
    d_normal_A: np.ndarray
    d_normal_B: np.ndarray
    reason: list[str | None]


def contact_derivatives(
    A: Shape | Sequence[Shape], B: Shape | Sequence[Shape], X_WA: PoseLike, X_WB: PoseLike, *, margin: float = 0.0,
    max_contacts: int = 8,
) -> ContactDerivatives:
    """Contacts of two convex bodies, and how gap, points and normal of each row change with both poses.

    Parameters
    ----------
    A, B : Shape, or sequence of Shape
        As of `contacts`.
    X_WA, X_WB : (4, 4) or (N, 4, 4) poses in the world W [m].
    margin : [m], ≥ 0, as of `contacts`.
    max_contacts : of each patch, ≥ 1.

    Returns
    -------
    ContactDerivatives
        A row for each contact. Derivatives are of the contact between the same features: rows that come or go at the
        margin, or by ``max_contacts``, have no say. NaN where features change, where the normal has no derivative
        (faces flush with each other, beside anything but a half-space), and for bodies that are not convex.

    Raises
    ------
    InvalidArgument, InvalidPose, UnsupportedQuery
        As of `contacts`.

    Notes
    -----
    O(f) a row beside `contacts` and `distance`, for f faces of the bodies, by the implicit function theorem
    (docs/derivatives.md).
    """
    rows_of = contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=max_contacts)
    poses_a, poses_b, _ = asked_poses(A, B, X_WA, X_WB)
    moved, reason = np.full((len(rows_of.rows), 10, 12), np.nan), []
    for k, begin, end in zip(range(len(rows_of.starts) - 1), rows_of.starts.tolist(), rows_of.starts[1:].tolist()):
        if begin < end:
            bodies = shape_at(A, k), shape_at(B, k)
            X = pose_at(poses_a, k), pose_at(poses_b, k)
            reason += _differentiate(bodies, X, rows_of.rows[begin:end], moved[begin:end])
    by = [moved[:, 0], moved[:, 1:4], moved[:, 4:7], moved[:, 7:]]
    gap_a, gap_b, a_a, a_b, b_a, b_b, normal_a, normal_b = (of[..., k : k + 6] for of in by for k in (0, 6))
    return ContactDerivatives(rows_of, gap_a, gap_b, a_a, a_b, b_a, b_b, normal_a, normal_b, reason)


class _Core(NamedTuple):
    """A convex set in W without its radius.   normals (f, 3), offsets (f,): planes n · x = offset of its faces.

    ends : (e, 3) vertices.   axis : (2, 3) directions across a segment, None of other sets.   size : its extent [m].
    """

    origin: np.ndarray
    radius: float
    normals: np.ndarray
    offsets: np.ndarray
    ends: np.ndarray
    axis: np.ndarray | None
    size: float

    def across(self, point: np.ndarray, near: float) -> np.ndarray:
        """(r, 3) directions along which a point of the set is held."""
        if (np.linalg.norm(self.ends - point, axis=1) <= near).any():
            return np.eye(3)
        if self.axis is not None:  # beside a tilted segment, surfaces meet lines along n elsewhere
            return self.axis[: 2 if np.abs(self.axis @ (point - self.ends[0])).max() <= near else 0]
        return self.normals[np.abs(self.normals @ point - self.offsets) <= near]


def _core(shape: Shape, X: np.ndarray, n: np.ndarray) -> _Core | None:
    """The core of a hull of points or of a half-space, whose plane is across n; None of other sets."""
    packed, X_SP = parts_of(shape)[0]
    nothing = np.zeros((0, 3))
    if packed.kind == HALFSPACE:
        return _Core(X[:3, 3], 0.0, n[None], np.full(1, np.nan), nothing, None, 0.0)
    if packed.kind != POINTS:
        return None
    X_WP = X @ X_SP
    size = packed.radius + float(np.ptp(packed.points, axis=0).max())
    points = packed.points @ X_WP[:3, :3].T + X_WP[:3, 3]
    if len(points) <= 2:
        axis = None if len(points) == 1 else np.linalg.svd((points[1] - points[0])[None])[2][1:]
        return _Core(X[:3, 3], packed.radius, nothing, np.zeros(0), points, axis, size)
    faces = faces_of(packed).arrays
    normals = faces.normals @ X_WP[:3, :3].T
    offsets = np.einsum("ij,ij->i", normals, points[faces.corners[faces.starts[:-1]]])
    return _Core(X[:3, 3], packed.radius, normals, offsets, points[faces.vertex_ids], None, size)


def _differentiate(bodies, X, rows: np.ndarray, moved: np.ndarray) -> list[str | None]:
    """Write derivatives (k, 10, 12) of distance, points and normal of a pair's rows; returns reasons, row by row."""
    if not all(is_single_convex(shape) for shape in bodies):
        return [_OF_UNIONS] * len(rows)
    r: Any = distance(*bodies, *X, derivatives=True)
    n = rows["normal"][0]
    planes = [parts_of(shape)[0][0].kind == HALFSPACE for shape in bodies]
    dn = np.zeros((3, 12))
    if any(planes):
        first = 6 * planes.index(True)
        dn[:, first : first + 3] = -crossed(n[None])[0]
    elif not r.unique:
        return [f"the normal has no derivative: {r.uniqueness.meaning}"] * len(rows)
    else:
        dn[:, :6], dn[:, 6:] = r.d_normal_A, r.d_normal_B
        if not np.isfinite(dn).all() or np.abs(r.normal - n).max() > _ON:
            return ["the normal has no derivative: features that hold the witness points change"] * len(rows)
    cores = [_core(shape, pose, n) for shape, pose in zip(bodies, X)]
    if any(core is None for core in cores):
        return [_follow_witness(r, row, X, out) for row, out in zip(rows, moved)]
    return [_follow_features(cores, planes, row, dn, out) for row, out in zip(rows, moved)]


def _follow_witness(r: Any, row, X, out: np.ndarray) -> str | None:
    size = max(float(np.abs(row[name] - pose[:3, 3]).max()) for name, pose in zip(("point_a", "point_b"), X))
    apart = max(float(np.abs(row[name] - getattr(r, name)).max()) for name in ("point_a", "point_b"))
    motion = np.vstack([
        np.hstack([r.d_distance_A, r.d_distance_B])[None], np.hstack([r.d_point_a_A, r.d_point_a_B]),
        np.hstack([r.d_point_b_A, r.d_point_b_B]), np.hstack([r.d_normal_A, r.d_normal_B]),
    ])
    if not r.unique or apart > _ON * size or not np.isfinite(motion).all():
        return _NOT_FOLLOWED
    out[:] = motion
    return None


def _follow_features(cores, planes: list[bool], row, dn: np.ndarray, out: np.ndarray) -> str | None:
    """Solve for da, db, dd of a row, lengths in units of the pair's size."""
    n = row["normal"]
    points = row["point_a"] - cores[0].radius * n, row["point_b"] + cores[1].radius * n
    gap = float(row["distance"]) + cores[0].radius + cores[1].radius
    arms = [point - core.origin for point, core in zip(points, cores)]
    size = max(abs(gap), *(core.size for core in cores), *(float(np.abs(arm).max()) for arm in arms))
    unit = np.tile(np.repeat([size, 1.0], 3), 2)  # a unit of each number of both poses moves points by so much
    matrix, right = [np.hstack([-np.eye(3), np.eye(3), -n[:, None]])], [gap * dn / unit]
    for side, (core, point, arm, is_plane) in enumerate(zip(cores, points, arms, planes)):
        held = core.normals if is_plane else core.across(point, _ON * size)
        velocity, rows = np.zeros((3, 12)), np.zeros((len(held), 7))
        velocity[:, 6 * side : 6 * side + 6] = np.hstack([-crossed(arm[None])[0], np.eye(3)])
        rows[:, 3 * side : 3 * side + 3] = held
        matrix.append(rows)
        right.append(held @ velocity / unit)
    M, R = np.vstack(matrix), np.vstack(right)
    if len(M) < 7 or np.linalg.svd(M, compute_uv=False)[-1] < _LEAST_SINGULAR:
        return _NOT_FOLLOWED
    solved = np.linalg.lstsq(M, R, rcond=None)[0]
    if np.abs(M @ solved - R).max() > _RESIDUAL * max(float(np.abs(R).max()), 1.0):
        return _CHANGES
    solved *= unit
    out[0], out[7:] = solved[6], dn
    out[1:4], out[4:7] = solved[:3] + cores[0].radius * dn, solved[3:6] - cores[1].radius * dn
    return None
