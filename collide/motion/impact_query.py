"""`time_of_impact`: when two bodies in motion first touch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads, share_if_it_helps
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery
from collide.lowering.closed_regions import reach_of
from collide.lowering.kind_of_shape import kind_of
from collide.motion.convex_impact import CONTACT, FREE, OPEN, OPEN_START, TOO_SMALL
from collide.motion.convex_motions import convex_impacts, single_impact
from collide.motion.field_motions import field_impacts
from collide.motion.impact_jobs import WRONG_TURN
from collide.motion.impact_rows import TimeOfImpact, as_result, free_rows
from collide.motion.motions import Motions
from collide.motion.placed_motion import poses_at
from collide.motion.region_motions import with_regions_closed
from collide.motion.surface_motions import surface_impacts
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.dispatch import OF_FACETS, cells_of
from collide.numerics.sine_cosine import LARGEST_ANGLE
from collide.pairs.batches import answer_batch, distinct_shapes
from collide.pairs.pair_arguments import matched_counts
from collide.results import UNDECIDED
from collide.shapes.shape import Shape
from collide.shapes.shape_set import have_any
from collide.transforms import LARGEST, SMALLEST, as_pose, poses_as_given

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.transforms import PoseLike

    Shapes = Shape | Sequence[Shape]

#: Brackets [unit time] that may be asked for.
_TOLERANCES = (1e-14, 1.0)
_LOOKS_AT_FACETS = cells_of(OF_FACETS)


def time_of_impact(
    A: Shapes, B: Shapes, X_WA0: PoseLike, X_WA1: PoseLike, X_WB0: PoseLike, X_WB1: PoseLike, *,
    omega_WA: ArrayLike | None = None, omega_WB: ArrayLike | None = None, tolerance: float = 1e-9,
    check_poses: bool = True, threads: int = 1,
) -> TimeOfImpact:
    """When two moving bodies first touch, with a proven bracket.

    In unit time each body's origin moves on a line from its first pose to its second, and the body turns about it with
    constant angular velocity, the shortest way (half a turn: about the axis whose first coordinate is positive), or as
    ``omega_WA`` and ``omega_WB`` say.

    Parameters
    ----------
    A, B : Shape, or sequence of Shape
        Two shapes of any kind; or sequences of shapes, one a motion, as in `collide.collide`.
    X_WA0, X_WA1, X_WB0, X_WB1 : (4, 4) or (N, 4, 4) array_like, float64
        Poses of A and B in the world W [m] at times 0 and 1; single poses go with every motion of a batch.
    omega_WA, omega_WB : (3,) or (N, 3) array_like, float64, optional
        Angular velocities in W [rad in unit time], up to 1e6: for motions of more than half a turn, or of many. They
        must lead from the first orientation to the second: `moved_poses` makes end poses from velocities.
    tolerance : float
        Width of the bracket that is to be reached [unit time], 1e-14 … 1.
    check_poses : bool
        Refuse matrices that are no rotation.
    threads : int
        Answer a batch in at most so many threads; the answers are the same bits.

    Returns
    -------
    TimeOfImpact
        Scalars for a single motion, arrays with a leading N otherwise. Bodies in contact at the start: time 0.

    Raises
    ------
    InvalidArgument
        Where arguments are no shapes, lengths do not match, an angular velocity is not finite, too large, or leads
        elsewhere, or the tolerance is out of range.
    InvalidPose
        Naming the pose of the batch that is no rigid transform.
    UnsupportedQuery
        For two half-spaces that are apart at the start (the slightest tilt lets them meet, somewhere), and pairs
        smaller than 1e-50 m.

    Notes
    -----
    Conservative advancement (Mirtich 1996; Zhang et al. 2006; Tang, Kim and Manocha 2009) along separating axes that
    are kept, with spans proven by the chord of a function of bounded curvature (`motion/kept_axis.py`). Convex pairs:
    2 to 8 questions to GJK, some microseconds. Spins: steps are about √(gap / (|ω|² reach)), so a pair of many turns
    takes some steps a turn.

    Meshes: facets are culled span by span with motion bounds, spans cut where the distance says: a distance for each of
    some ten spans, and O(k) of the k pairs of facets that come near together in the last; a hull counts as one facet.
    All n m pairs of facets where they come together at once, as of flush faces: seconds of 10^5. Unions of m and k
    parts: O((m + k) log k) a span, and some microseconds for each pair of parts whose boxes come near before the
    contact, m k where all do; facets of those alone whose convex sets meet before it.
    """
    n_threads = check_threads(threads)
    width = _checked_tolerance(tolerance)
    if checks.true_or_false("check_poses", check_poses) and omega_WA is None and omega_WB is None:
        single_answer = single_impact(A, B, (X_WA0, X_WA1, X_WB0, X_WB1), width)
        if single_answer is not None:
            return single_answer
    matrices = {"X_WA0": X_WA0, "X_WA1": X_WA1, "X_WB0": X_WB0, "X_WB1": X_WB1}
    poses, singles = zip(*(_checked_poses(X, name, check_poses) for name, X in matrices.items()))
    turns = {"omega_WA": omega_WA, "omega_WB": omega_WB}
    omegas, single_omegas = zip(*(checked_omega(omega, name) for name, omega in turns.items()))
    counts = {name: len(X) for name, X in zip((*matrices, *turns), (*poses, *omegas)) if X is not None}
    n, are_shapes = matched_counts(A, B, counts)
    motions = Motions(*poses, *omegas)
    single = are_shapes and all(singles) and all(single_omegas)
    if have_any(A, "is_field") or have_any(B, "is_field"):

        def answer(A: Shape, B: Shape, motions: Motions) -> np.ndarray:
            return _answer(_Question(*with_regions_closed(*distinct_shapes(A, B, 1), motions), motions, width, 1))

        return as_result(field_impacts(answer, *distinct_shapes(A, B, n), motions.spread(n)), width, single)
    question = _Question(*with_regions_closed(*distinct_shapes(A, B, n), motions), motions, width, n_threads)
    return as_result(_answer(question), width, single)


def poses_in_motion(
    X_WA0: PoseLike, X_WA1: PoseLike, time: ArrayLike, *, omega_WA: ArrayLike | None = None
) -> np.ndarray:
    """Where a body is at times between 0 and 1, moving as `time_of_impact` has it move.

    Parameters
    ----------
    X_WA0, X_WA1 : (4, 4) or (N, 4, 4) array_like, float64
        Poses of the body in W [m] at times 0 and 1.
    time : float or (N,) array_like
        Times within 0 … 1.
    omega_WA : (3,) or (N, 3) array_like, optional
        As of `time_of_impact`.

    Returns
    -------
    (4, 4) or (N, 4, 4) float64
        Poses in W, good to a few units in the last place of the numbers given, times 1 + |ω|. Where everything is
        single, so is the pose.

    Raises
    ------
    InvalidArgument
        Where times are not within 0 … 1, lengths do not match, or the angular velocity leads elsewhere.
    InvalidPose
        Where a matrix is no rigid transform.
    """
    X0, single0 = _checked_poses(X_WA0, "X_WA0", True)
    X1, single1 = _checked_poses(X_WA1, "X_WA1", True)
    omega, single_omega = checked_omega(omega_WA, "omega_WA")
    array = checks.array("poses_in_motion: time", time, "() or (N,)", InvalidArgument)
    times = np.ascontiguousarray(array.reshape(-1))
    if array.ndim > 1 or not (np.isfinite(times).all() and (times >= 0.0).all() and (times <= 1.0).all()):
        raise InvalidArgument(f"poses_in_motion: time must be numbers within 0 … 1, got {checks.brief(time)}")
    counts = {"X_WA0": len(X0), "X_WA1": len(X1), "time": len(times)}
    if omega is not None:
        counts["omega_WA"] = len(omega)
    matched_counts(None, None, counts)
    placed, misfit = poses_at(X0, X1, omega, times)
    if misfit > _LARGEST_MISFIT:
        name = f"omega_WA {checks.brief(omega_WA)}"
        raise InvalidArgument(_leads_elsewhere(name, "X_WA0", "X_WA1", omega is not None))
    return placed[0] if single0 and single1 and single_omega and array.ndim == 0 else placed


def moved_poses(X_WA0: PoseLike, velocity_WA: ArrayLike, omega_WA: ArrayLike) -> np.ndarray:
    """Where a body is after unit time, from its velocities: what `time_of_impact` takes for ``X_WA1``.

    Parameters
    ----------
    X_WA0 : (4, 4) or (N, 4, 4) array_like, float64
        Poses in W [m].
    velocity_WA : (3,) or (N, 3) array_like
        How far the origin moves in W [m].
    omega_WA : (3,) or (N, 3) array_like
        Angular velocity in W [rad], up to 1e6; hand it to `time_of_impact`, too, where it is more than half a turn.

    Returns
    -------
    (4, 4) or (N, 4, 4) float64
        Poses in W.

    Raises
    ------
    InvalidArgument, InvalidPose
        Where numbers are not finite, or lengths do not match.
    """
    X, single = _checked_poses(X_WA0, "X_WA0", True)
    omega, single_omega = checked_omega(omega_WA, "omega_WA")
    velocity, single_velocity = _vectors(velocity_WA, "velocity_WA")
    if omega is None:
        raise InvalidArgument("moved_poses: omega_WA must be (3,) or (N, 3), got None")
    n, _ = matched_counts(None, None, {"X_WA0": len(X), "velocity_WA": len(velocity), "omega_WA": len(omega)})
    moved = np.broadcast_to(X, (n, 4, 4)).copy()
    angle = np.linalg.norm(omega, axis=1)[:, None]
    axis = omega / np.where(angle > 0.0, angle, 1.0)
    sine, cosine = np.sin(angle)[:, :, None], np.cos(angle)[:, :, None]
    across = np.cross(axis[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
    rotation = cosine * np.eye(3) + sine * across + (1.0 - cosine) * axis[:, :, None] * axis[:, None, :]
    moved[:, :3, :3] = rotation @ moved[:, :3, :3]
    moved[:, :3, 3] += velocity
    return moved[0] if single and single_omega and single_velocity else moved


# --- arguments ----------------------------------------------------------------------------------

#: Entries of a matrix at the end that miss the motion by more are not where the motion leads.
_LARGEST_MISFIT = 4e-4


def _checked_poses(X, name: str, check: bool) -> tuple[np.ndarray, bool]:
    """(poses (n, 4, 4), whether a single one was given)."""
    if check and type(X) is np.ndarray and X.shape == (4, 4):
        return np.ascontiguousarray(as_pose(X, name))[None], True
    return poses_as_given(X, name, check=check)


def _checked_tolerance(tolerance) -> float:
    read, (least, largest) = checks.number(tolerance), _TOLERANCES
    if read is None or not least <= read <= largest:
        raise InvalidArgument(
            f"tolerance must be a width of the bracket within {least:g} … {largest:g}, in units of the motion's time, "
            f"got {checks.brief(tolerance)}"
        )
    return read


def _vectors(values, name: str) -> tuple[np.ndarray, bool]:
    """((n, 3), whether a single one was given)."""
    array = checks.array(name, values, "(3,) or (N, 3)", InvalidArgument)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise InvalidArgument(f"{name} must be (3,) or (N, 3), got {array.shape}")
    rows = np.ascontiguousarray(array.reshape(-1, 3))
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(rows) <= LARGEST).all(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise InvalidArgument(f"{name}[{k}] must be finite numbers within {LARGEST:g}, got {rows[k].tolist()}")
    return rows, array.ndim == 1


def checked_omega(omega, name: str) -> tuple[np.ndarray | None, bool]:
    if omega is None:
        return None, True
    rows, single = _vectors(omega, name)
    angle = np.linalg.norm(rows, axis=1)
    if (angle > LARGEST_ANGLE).any():
        k = int(np.argmax(angle))
        raise InvalidArgument(
            f"{name}[{k}] turns by {angle[k]:g} rad, more than {LARGEST_ANGLE:g}: cut the motion into shorter ones"
        )
    return rows, single


def _leads_elsewhere(name: str, start: str, end: str, has_omega: bool) -> str:
    """Why no motion joins two poses. name : of the angular velocity, with its value if given."""
    if has_omega:
        return f"{name} does not turn {start} into the orientation of {end}; collide.moved_poses makes end poses"
    return f"no rotation turns {start} into {end}: both must be rotations to 1e-4"


class _Question(NamedTuple):
    """Motions, checked.   shapes : distinct ones.   a, b : (n,) which of them A and B are."""

    shapes: list[Shape]
    a: np.ndarray
    b: np.ndarray
    motions: Motions
    tolerance: float
    threads: int


# --- answers ------------------------------------------------------------------------------------


def _answer(question: _Question) -> np.ndarray:
    """Rows of `IMPACT_DTYPE`."""
    shapes, a, b, motions, tolerance, threads = question
    rows = free_rows(len(a))
    kinds = np.array([kind_of(shape) for shape in shapes], dtype=np.int64)
    of_facets = _LOOKS_AT_FACETS[kinds[a], kinds[b]]
    unbounded = np.array([reach_of(shape) == np.inf for shape in shapes], dtype=bool)
    to_ask_first = of_facets | (unbounded[a] & unbounded[b])
    _ask_start(question, rows, np.flatnonzero(to_ask_first))
    apart = rows["status"] == FREE
    _refuse_planes(question, np.flatnonzero(to_ask_first & apart & unbounded[a] & unbounded[b]))
    convex = np.flatnonzero(apart & ~of_facets)
    if 0 < len(convex) == len(rows):
        rows = convex_impacts(shapes, a, b, motions, tolerance, threads)
    elif len(convex):
        rows[convex] = convex_impacts(shapes, a[convex], b[convex], motions.picked(convex), tolerance, threads)
    _surfaces(question, rows, np.flatnonzero(apart & of_facets))
    _refuse(question, rows)
    _ask_start(question, rows, np.flatnonzero(rows["status"] == OPEN_START))
    _describe_start(question, rows)
    _ask_end(question, rows)
    return rows


def _shapes_of(question: _Question, some: np.ndarray) -> tuple:
    """Shapes A and B of motions, as batches take them."""
    sides = []
    for which in (question.a[some], question.b[some]):
        same = len(which) and (which == which[0]).all()
        sides.append(question.shapes[which[0]] if same else [question.shapes[k] for k in which.tolist()])
    return sides[0], sides[1]


def _start_of(question: _Question, some: np.ndarray):
    """(A, B, X_WA, X_WB) of motions at their start."""
    picked = question.motions.picked(some)
    A, B = _shapes_of(question, some)
    return A, B, picked.X_WA0, picked.X_WB0


def _ask_end(question: _Question, rows: np.ndarray) -> None:
    """Open motions in contact at the last poses as given, by the rule of `distance`, have a contact by time 1.

    The search leaves motions open whose only contact is the last pose: poses before come within rounding.
    """
    some = np.flatnonzero((rows["status"] == OPEN) & np.isinf(rows["upper"]))
    picked = question.motions.picked(some)
    if not len(some) or picked.omega_WA is not None or picked.omega_WB is not None:
        return
    A, B = _shapes_of(question, some)
    pairs = answer_batch(A, B, picked.X_WA1, picked.X_WB1, Question(False, np.inf, False), question.threads)
    pairs = np.broadcast_to(pairs, len(some))
    touching = some[pairs["hit"] & (pairs["how"] != UNDECIDED)]
    rows["upper"][touching], rows["status"][touching] = 1.0, CONTACT


def _ask_start(question: _Question, rows: np.ndarray, some: np.ndarray) -> None:
    """Motions that are in contact at the start, decided as `collide` does, become contacts at time 0."""
    if not len(some):
        return
    A, B, X_WA, X_WB = _start_of(question, some)
    hits = answer_batch(A, B, X_WA, X_WB, Question(True), question.threads)
    hit = some[np.broadcast_to(hits, len(some))]
    rows["lower"][hit] = rows["upper"][hit] = 0.0
    rows["status"][hit] = CONTACT


def _describe_start(question: _Question, rows: np.ndarray) -> None:
    """Normal and points of bodies in contact at the start, and whether the contact is proven: as `distance` has
    them."""
    some = np.flatnonzero((rows["status"] == CONTACT) & (rows["upper"] == 0.0))
    if not len(some):
        return
    kinds = np.array([kind_of(shape) for shape in question.shapes])
    of_facets = _LOOKS_AT_FACETS[kinds[question.a[some]], kinds[question.b[some]]]
    for depths in (True, False):  # a depth of meshes takes milliseconds
        _describe_as_distance(question, rows, some[of_facets != depths], depths)


def _describe_as_distance(question: _Question, rows: np.ndarray, some: np.ndarray, depths: bool) -> None:
    if not len(some):
        return
    A, B, X_WA, X_WB = _start_of(question, some)
    pairs = answer_batch(A, B, X_WA, X_WB, Question(False, np.inf, depths), question.threads)
    pairs = np.broadcast_to(pairs, len(some))
    for field in ("normal", "point_a", "point_b", "part_a", "part_b"):
        rows[field][some] = pairs[field]
    unbounded = ~np.isfinite(pairs["distance"])
    for field in ("normal", "point_a", "point_b"):
        rows[field][some[unbounded]] = 0.0
    if not depths:
        rows["normal"][some] = 0.0
    undecided = some[pairs["how"] == UNDECIDED]
    rows["upper"][undecided], rows["status"][undecided] = np.inf, OPEN_START


def _refuse_planes(question: _Question, some: np.ndarray) -> None:
    if len(some):
        names = " and ".join(type(question.shapes[side[some[0]]]).__name__ for side in (question.a, question.b))
        raise UnsupportedQuery(
            f"time_of_impact of {names} (motion {some[0]}): two half-spaces, or regions of them, that start apart may "
            "meet when one tilts, however far away; a large Box can stand in for one of them"
        )


def _surfaces(question: _Question, rows: np.ndarray, some: np.ndarray) -> None:
    shapes, a, b = question.shapes, question.a[some], question.b[some]
    for key in np.unique(a * len(shapes) + b).tolist():
        which = some[a * len(shapes) + b == key]
        A, B = shapes[key // len(shapes)], shapes[key % len(shapes)]
        motions = question.motions.spread(len(rows))

        def work(piece: slice, A=A, B=B, which=which, motions=motions) -> None:
            part = free_rows(len(which[piece]))
            surface_impacts(A, B, motions.picked(which[piece]), question.tolerance, part)
            rows[which[piece]] = part

        if question.threads < 2:
            work(slice(0, len(which)))
        else:
            share_if_it_helps(len(which), work, question.threads)


def _refuse(question: _Question, rows: np.ndarray) -> None:
    """Raise what kernels found to be no question."""
    bad = np.flatnonzero(rows["status"] >= TOO_SMALL)
    if not len(bad):
        return
    k = int(bad[0])
    if rows["status"][k] == WRONG_TURN:
        motions = question.motions
        has_omega = motions.omega_WA is not None or motions.omega_WB is not None
        kind = InvalidArgument if has_omega else InvalidPose
        turns = (("omega_WA", motions.omega_WA), ("omega_WB", motions.omega_WB))
        names = (f"{name} {omega[k % len(omega)].tolist()}" for name, omega in turns if omega is not None)
        where = _leads_elsewhere(" or ".join(names), "the first pose", "the second", has_omega)
        raise kind(f"motion {k}: {where}")
    raise UnsupportedQuery(
        f"motion {k}: a pair whose shapes and distance together measure less than {SMALLEST:g} m is out of range; "
        "scale it"
    )
