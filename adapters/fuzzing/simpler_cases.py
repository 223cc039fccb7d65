"""Ways to make a case simpler: fewer bodies, parts, facets and points, plainer poses, shorter numbers.

`complexity` is what a step has to lower, so that shrinking ends.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from collide import distance
from collide.adapters.fuzzing.fuzz_case import Case
from collide.errors import CollideError, InvalidShape
from collide.shapes import Box, Compound, ConvexHull, Halfspace, HeightField, HPolytope, Mesh, Shape
from collide.transforms import pose, rotation_from_degrees

#: What a body, a part, and a point or facet weigh, in digits.
BODY, PART, POINT = 1000, 200, 40
#: What an angle of a pose weighs beside its digits.
ANGLE = 8
#: Digits that numbers are rounded to, one after the other.
DIGITS = (1, 2, 3, 4, 6, 9)
_DEGREES = (90.0, 45.0, 15.0, 5.0, 1.0, 0.1, 0.001)


# --- how complicated a case is --------------------------------------------------------------------


def complexity(case: Case) -> int:
    """How much there is to read in a case, about in digits."""
    return sum(BODY + _of_shape(body.shape) + _of_pose(body.X_WB) for body in case.bodies)


def _of_shape(shape: Shape) -> int:
    if isinstance(shape, Compound):
        return sum(PART + _of_shape(part) + _of_pose(X) for part, X in shape.items)
    arrays = [np.asarray(getattr(shape, field)) for field in shape._fields if field not in ("faces", "solid")]
    rows = sum(len(array) for array in arrays if array.ndim == 2) + (len(shape.faces) if isinstance(shape, Mesh) else 0)
    return POINT * rows + sum(n_digits(x) for array in arrays for x in array.ravel())


def _of_pose(X: np.ndarray) -> int:
    angles = degrees(X[:3, :3])
    return sum(map(n_digits, X[:3, 3])) + sum(ANGLE + n_digits(abs(a)) for a in angles if a)


def n_digits(x: float) -> int:
    """How long a number is to read: 0 for 0, 1 for 1, one more for other numbers of one digit; a power of ten counts
    as its exponent, so that nothing gets tiny for the sake of a digit."""
    if x == 0.0:
        return 0
    if abs(x) == 1.0:
        return 1 + (x < 0)
    digits, _, power = repr(abs(float(x))).partition("e")
    whole, _, part = digits.partition(".")
    length = len((whole + part.rstrip("0")).strip("0"))
    return 1 + length + (x < 0) + abs(int(power or 0))


def degrees(R: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation (3, 3) [degrees], those that come from few digits given in them."""
    pitch = math.asin(min(1.0, max(-1.0, -R[2, 0])))
    if abs(R[2, 0]) < 1 - 1e-12:
        roll, yaw = math.atan2(R[2, 1], R[2, 2]), math.atan2(R[1, 0], R[0, 0])
    else:
        roll, yaw = math.atan2(-R[1, 2], R[1, 1]), 0.0
    a, b, c = (math.degrees(angle) for angle in (roll, pitch, yaw))
    rounded = round(a, 9) + 0.0, round(b, 9) + 0.0, round(c, 9) + 0.0
    return rounded if np.array_equal(rotation_from_degrees(np.array(rounded)), R) else (a, b, c)


def fingerprint(case: Case) -> tuple:
    """Equal for equal bodies at equal poses."""
    return tuple((_key(body.shape), body.X_WB.tobytes()) for body in case.bodies)


def _key(shape: Shape) -> tuple:
    if isinstance(shape, Compound):
        return tuple((_key(part), X.tobytes()) for part, X in shape.items)
    return type(shape).__name__, *(np.asarray(getattr(shape, field)).tobytes() for field in shape._fields)


# --- steps ----------------------------------------------------------------------------------------


def _fewer_bodies(case: Case) -> Iterator[Case]:
    others = case.bodies[2:]
    for chunk in _chunks(len(others)):
        yield case._replace(bodies=case.bodies[:2] + tuple(b for k, b in enumerate(others) if k not in chunk))


def _fewer_parts(case: Case) -> Iterator[Case | None]:
    for k, body in enumerate(case.bodies[:2]):
        parts = body.shape.items if isinstance(body.shape, Compound) else ()
        for part, X_BP in parts:
            yield case.replaced(k, shape=part, X_WB=body.X_WB @ X_BP)
        for i in range(len(parts)):
            yield _with_shape(case, k, Compound, [item for j, item in enumerate(parts) if j != i])


def _fewer_points(case: Case) -> Iterator[Case | None]:
    for k, body in enumerate(case.bodies[:2]):
        shape = body.shape
        if isinstance(shape, HeightField):
            for heights in _smaller_fields(shape.heights):
                yield _with_shape(case, k, HeightField, heights, shape.cell, bottom=shape.bottom)
        elif isinstance(shape, Mesh):
            for chunk in _chunks(len(shape.faces)):
                faces = np.delete(shape.faces, sorted(chunk), axis=0)
                yield _with_shape(case, k, _tidy, shape.vertices, faces)
            yield from _collapsed(case, k, shape)
        elif isinstance(shape, ConvexHull):
            if shape.radius:
                yield _with_shape(case, k, ConvexHull, shape.points)
            for chunk in _chunks(len(shape.points)):
                points = np.delete(shape.points, sorted(chunk), axis=0)
                yield _with_shape(case, k, ConvexHull, points, radius=shape.radius)
        elif isinstance(shape, HPolytope):
            for i in range(len(shape.offsets)):
                normals, offsets = np.delete(shape.normals, i, axis=0), np.delete(shape.offsets, i)
                yield _with_shape(case, k, HPolytope, normals, offsets)


def _collapsed(case: Case, k: int, mesh: Mesh) -> Iterator[Case | None]:
    """An edge of a mesh drawn together: what was closed stays so."""
    edges = {tuple(sorted(edge)) for f in mesh.faces.tolist() for edge in itertools.combinations(f, 2)}
    for i, j in sorted(edges)[:60]:
        faces = np.where(mesh.faces == j, i, mesh.faces)
        faces = faces[[len(set(face)) == 3 for face in faces.tolist()]]
        if len(faces):
            yield _with_shape(case, k, _tidy, mesh.vertices, faces, solid=mesh.solid or None)


def _plain_poses(case: Case) -> Iterator[Case | None]:
    """A in the origin; rotations left out, or rounded to few degrees."""
    A, B = case.bodies[:2]
    if not case.world and not np.array_equal(A.X_WB, np.eye(4)):
        R, t = A.X_WB[:3, :3], A.X_WB[:3, 3]
        yield from _placed_again(case, pose(), pose(R.T @ (B.X_WB[:3, 3] - t), R=R.T @ B.X_WB[:3, :3]))
        yield from _placed_again(case, pose((0, 0, 0), R=R), pose(B.X_WB[:3, 3] - t, R=B.X_WB[:3, :3]))
    for k in (0, 1):
        X = case.bodies[k].X_WB
        for R in _plainer_rotations(X[:3, :3]):
            poses = [body.X_WB for body in case.bodies[:2]]
            poses[k] = pose(X[:3, 3], R=R)
            yield from _placed_again(case, *poses)


def _plainer_rotations(R: np.ndarray) -> Iterator[np.ndarray]:
    angles = degrees(R)
    if not any(angles):
        return
    yield np.eye(3)
    seen = set()
    for step in _DEGREES:
        seen.add(tuple(step * round(a / step) for a in angles))
    for k in range(3):
        seen.add(tuple(0.0 if i == k else a for i, a in enumerate(angles)))
        seen |= {tuple(step * round(a / step) if i == k else a for i, a in enumerate(angles)) for step in _DEGREES}
    for rpy in sorted(seen, key=lambda rpy: sum(n_digits(round(a, 9)) for a in rpy)):
        yield rotation_from_degrees(np.array([round(a, 9) for a in rpy]))


def _placed_again(case: Case, X_WA: np.ndarray, X_WB: np.ndarray) -> Iterator[Case | None]:
    """The pair at other poses, as they are, and with B moved so that the signed distance is a plain number again."""
    moved = case.replaced(0, X_WB=X_WA).replaced(1, X_WB=X_WB)
    yield moved
    if not case.world:
        for target in _plain_distances(case):
            yield at_distance(moved, target)


def _plain_distances(case: Case) -> list[float]:
    """Signed distances of few digits near the one of the pair [m]: the power of ten at most as large."""
    d = _signed_distance(case)
    if d is None or d == 0.0 or not math.isfinite(d):
        return [0.0] if d == 0.0 else []
    return [math.copysign(10.0 ** math.floor(math.log10(abs(d))), d)]


def at_distance(case: Case, target: float) -> Case | None:
    """B moved along the normal to a signed distance [m]; None where that cannot be told."""
    try:
        r = distance(*case.pair())
    except CollideError:
        return None
    if not np.isfinite(r.normal).all() or not math.isfinite(float(r.distance)):
        return None
    X = case.bodies[1].X_WB.copy()
    X[:3, 3] += np.asarray(r.normal) * (target - float(r.distance))
    return case.replaced(1, X_WB=X)


def _signed_distance(case: Case) -> float | None:
    try:
        return float(distance(*case.pair()).distance)
    except CollideError:
        return None


def _on_an_axis(case: Case) -> Iterator[Case | None]:
    """B along a coordinate axis from A, about as far as it is, or at a plain signed distance."""
    A, B = case.bodies[:2]
    step = B.X_WB[:3, 3] - A.X_WB[:3, 3]
    length = float(np.linalg.norm(step))
    if case.world or np.count_nonzero(step) < 2:
        return
    for axis in np.argsort(-np.abs(step)).tolist():
        for size in (_to_digits(length, 1), _to_digits(1.1 * length, 1), _to_digits(length, 2), length):
            X = B.X_WB.copy()
            X[:3, 3] = A.X_WB[:3, 3]
            X[axis, 3] += math.copysign(size, step[axis])
            moved = case.replaced(1, X_WB=X)
            yield moved
            for target in _plain_distances(case):
                yield at_distance(moved, target)


def _plain_sizes(case: Case) -> Iterator[Case | None]:
    """Everything scaled so that the larger body is about 1; sizes of a body all 1."""
    for k in (0, 1):
        shape = case.bodies[k].shape
        if isinstance(shape, Mesh | Compound | Halfspace | HPolytope | ConvexHull):
            continue
        ones = [_scalar(np.ones_like(np.asarray(getattr(shape, field)))) for field in shape._fields]
        made = _with_shape(case, k, type(shape), *ones)
        if made is not None:
            yield made
            for target in _plain_distances(case):
                yield at_distance(made, target)


def _rounded(case: Case) -> Iterator[Case | None]:
    """All numbers of sizes and translations rounded at once."""
    for digits in DIGITS:
        for k in ((0, 1), (0,), (1,)):
            made: Case | None = case
            for i in k:
                made = made and _with_numbers(made, i, partial(_to_digits, digits=digits))
            yield made
            if made is not None and not case.world:
                for target in _plain_distances(case):
                    yield at_distance(made, target)


def _short_numbers(case: Case) -> Iterator[Case | None]:
    """One number at a time: 0, 1, or fewer digits."""
    for k, body in enumerate(case.bodies[:2]):
        for i in range(3):
            for value in _shorter(float(body.X_WB[i, 3])):
                X = body.X_WB.copy()
                X[i, 3] = value
                yield case.replaced(k, X_WB=X)
        if isinstance(body.shape, Compound | HeightField):
            continue
        for field in body.shape._fields:
            if field in ("faces", "solid"):
                continue
            array = np.asarray(getattr(body.shape, field), dtype=np.float64)
            for place in itertools.islice(np.ndindex(array.shape), 90):
                for value in _shorter(float(array[place])):
                    changed = array.copy()
                    changed[place] = value
                    yield _with_shape(case, k, _with_field, body.shape, field, changed)


def _shorter(x: float) -> Iterator[float]:
    """0, ±1, and x in fewer digits."""
    seen = {x}
    for value in (0.0, math.copysign(1.0, x), *(_to_digits(x, digits) for digits in DIGITS)):
        if value not in seen:
            seen.add(value)
            yield value


def _to_digits(x: float, digits: int) -> float:
    return float(f"{x:.{digits - 1}e}")


#: From a case to simpler ones, the boldest first; None stands for one that cannot be built.
STEPS: tuple[Callable[[Case], Iterator[Case | None]], ...] = (
    _fewer_bodies, _fewer_parts, _fewer_points, _plain_poses, _on_an_axis, _plain_sizes, _rounded, _short_numbers,
)


# --- making shapes --------------------------------------------------------------------------------


def _with_shape(case: Case, k: int, make: Callable[..., Shape], *numbers, **options) -> Case | None:
    """The case with another shape of body k, made of these numbers; None where there is no such shape."""
    try:
        return case.replaced(k, shape=make(*numbers, **options))
    except (CollideError, IndexError, ValueError):
        return None


def _with_field(shape: Shape, field: str, value: np.ndarray) -> Shape:
    if isinstance(shape, Mesh):
        return _tidy(value, shape.faces, solid=shape.solid or None)
    values = {name: getattr(shape, name) for name in shape._fields} | {field: _scalar(value)}
    if isinstance(shape, ConvexHull):
        return ConvexHull(values["points"], radius=float(values["radius"]))
    if isinstance(shape, Box) and shape.size.all() and not np.all(value):
        raise InvalidShape("Box: a flat box is another question, which few engines take")
    return type(shape)(*values.values())


def _with_numbers(case: Case, k: int, change: Callable[[float], float]) -> Case | None:
    """Translation and sizes of body k, every number changed."""
    X = case.bodies[k].X_WB.copy()
    X[:3, 3] = [change(float(x)) for x in X[:3, 3]]
    shape = case.bodies[k].shape
    made: Case | None = case.replaced(k, X_WB=X)
    if isinstance(shape, Compound | HeightField):
        return made
    for field in shape._fields:
        if field in ("faces", "solid") or made is None:
            continue
        array = np.asarray(getattr(shape, field), dtype=np.float64)
        changed = np.array([change(float(x)) for x in array.ravel()]).reshape(array.shape)
        made = _with_shape(made, k, _with_field, made.bodies[k].shape, field, changed)
    return made


def _tidy(vertices: np.ndarray, faces: np.ndarray, solid: bool | None = None) -> Mesh:
    """A mesh without the vertices that no facet uses."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], renumbered.reshape(-1, 3), solid=solid)


def _smaller_fields(heights: np.ndarray) -> Iterator[np.ndarray]:
    rows, columns = heights.shape
    if rows > 2:
        yield from (heights[: (rows + 1) // 2 + 1], heights[rows // 2 - 1 :], heights[:-1], heights[1:])
    if columns > 2:
        yield from (heights[:, :-1], heights[:, 1:])


def _scalar(value: np.ndarray):
    return float(value) if np.ndim(value) == 0 else value


def _chunks(n: int) -> Iterator[set[int]]:
    """Runs of 0 … n − 1 to leave out: halves, quarters, …, single ones."""
    size = n // 2 if n > 1 else n
    while size >= 1:
        for start in range(0, n, size):
            yield set(range(start, min(start + size, n)))
        size //= 2
